"""Everything that the documents and container files mention exists, and commands print the documented output.

A setting, route, link or command that was renamed in the code only would show here.
"""

from __future__ import annotations

import importlib.util
import io
import json
import re
import runpy
import shlex
from contextlib import redirect_stdout
from pathlib import Path

import ezdxf
import pytest

from app.cli import main, make_parser
from app.openapi import FILE
from app.settings import Settings
from docs import data_model, figures, generated_pages, messages

ROOT = Path(__file__).parents[1]
SHELVES = ("", "start", "howto", "reference", "background")
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *(path for shelf in SHELVES for path in sorted((ROOT / "docs" / shelf).glob("*.md"))),
]
EXAMPLES = sorted((ROOT / "docs" / "examples").glob("ex*.py"))
GENERATED = {"http_fields.md": generated_pages.http_routes(json.loads(FILE.read_text()))}
"""Content of pages of the reference that is generated when the site is built."""


def names(path: Path) -> str:
    return str(path.relative_to(ROOT))


def commands(text: str) -> list[str]:
    """Return code blocks, fenced or indented, and code spans; continued lines are joined."""
    text = text.replace("\\\n", " ")
    fenced = re.findall(r"^```.*?\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    remaining = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = [line for block in fenced for line in block.splitlines()]
    lines += re.findall(r"^    (\S.*)$", remaining, re.MULTILINE)
    lines += re.findall(r"`([^`\n]+)`", remaining)
    return [re.sub(r"\s#.*", "", line).strip().removeprefix("$ ") for line in lines]


NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*\.?\d*(?:e[-+]?\d+)?")


TIMES = re.compile(r"best objective after.*|stopped by.*|(?<=; )screen.*|\.\.\.")


def assert_same_output(found: str, expected: str) -> None:
    """Compare words exactly, numbers to a thousandth, rounding errors as rounding errors; times, or ``...``, are
    left out.
    """
    found, expected = (TIMES.sub("", text) for text in (found, expected))
    assert NUMBER.sub(" # ", found).split() == NUMBER.sub(" # ", expected).split(), found
    numbers = [[float(number.replace(",", "")) for number in NUMBER.findall(text)] for text in (found, expected)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-3, abs=1e-10), found


# -- generated pages -------------------------------------------------------------------------------------------------


def test_the_generated_pages_have_every_route_field_and_setting() -> None:
    document, page = json.loads(FILE.read_text()), GENERATED["http_fields.md"]
    schemas = document["components"]["schemas"].values()
    assert all(f"{path}\n" in page for path in document["paths"])
    assert all(f"`{name}`" in page for schema in schemas for name in schema.get("properties", ()))
    assert all(f"`LINKAGE_ATLAS_{name.upper()}`" in generated_pages.settings() for name in Settings.model_fields)
    assert "limits.pivot_box" in generated_pages.command_line()


def test_the_table_of_messages_has_errors_notes_and_texts_of_the_page() -> None:
    source = '''
def check(name: str, count: int) -> None:
    """Check a field that this sentence describes."""
    if count > 3:
        raise FieldError(f"/{name}", f"must be at most 3; it is {count:g}")
    notes.append("The time was up before all limits were examined.")
'''
    found = list(messages.python_messages(source))
    assert found == ["must be at most 3; it is {count}", "The time was up before all limits were examined."]
    script = "// a comment in plain English\nshow(`Read ${rows.length} of the rows.`, 'status-line wide-box')"
    assert list(messages.script_messages(script)) == ["Read {rows.length} of the rows."]
    page = messages.messages_page()
    assert all(f"\n## {title}\n" in f"\n{page}" for title in (*messages.PACKAGES, "The page"))
    assert page.count("\n| `") > 1000


# -- commands and links -----------------------------------------------------------------------------------------------


def anchors(path: Path) -> set[str]:
    """Fragments of a document's headings, as they are shown on the web."""
    text = re.sub(r"^```.*?^```", "", path.read_text() + GENERATED.get(path.name, ""), flags=re.MULTILINE | re.DOTALL)
    titles = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title) for title in re.findall(r"^#+ (.+)$", text, re.MULTILINE))
    return {re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("path", DOCUMENTS, ids=names)
def test_every_link_leads_to_a_file_and_every_fragment_to_a_heading(path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text()):
        if not re.match(r"[a-z]+:", target):
            name, _, fragment = target.partition("#")
            file = path.parent / name if name else path
            if "gallery" in file.parts:  # made of the examples when the site is built
                file = ROOT / "docs" / "examples" / f"{file.name}.py"
            assert file.exists(), f"{names(path)} links to {target}"
            assert not fragment or fragment in anchors(file), f"{names(path)} links to {target}"


def test_no_document_repeats_a_sentence_of_another() -> None:
    found: dict[str, Path] = {}
    for path in DOCUMENTS:
        text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
        for sentence in re.split(r"(?<=[.:;])\s+|[|\n]", re.sub(r"\]\([^)]*\)", "]", text)):
            words = " ".join(re.findall(r"\w+", sentence.lower()))
            if words.count(" ") >= 7:
                assert found.setdefault(words, path) == path, f"{names(found[words])} and {names(path)}: {sentence}"


def test_every_picture_is_shown() -> None:
    shown = "".join(path.read_text() for path in DOCUMENTS)
    assert [path.name for path in (ROOT / "docs" / "img").iterdir() if path.name not in shown] == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=names)
def test_every_named_source_file_exists(path) -> None:
    folders = "app|synthesis|linkage_atlas|data_build|benchmarks|tests|docs|deploy"
    for file in re.findall(rf"`((?:{folders})/[\w./]+\.\w+)`", path.read_text()):
        assert (ROOT / file).exists(), f"{names(path)} names {file}"


def test_the_diffs_of_the_architecture_fit_the_sources() -> None:
    """Files, names and removed lines of each diff exist, so that a contributor can apply it."""
    text = (ROOT / "docs" / "architecture.md").read_text()
    for diff in re.findall(r"^```diff\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        source = ""
        for line in diff.splitlines():
            if line.startswith(" ") and "a new file" not in line:
                path, _, place = line.strip().partition(", ")
                source = (ROOT / path).read_text()
                words = re.findall(r"`([^`]+)`|class (\w+)|\b([A-Z_]{5,})\b", place)
                assert all(any(word in source for word in found if word) for found in words), line
            elif line.startswith("-"):
                assert line[1:].strip() in source, line


def test_the_picture_of_the_data_model_is_current() -> None:
    assert data_model.PICTURE.read_text() == data_model.picture(), "renew it: python -m docs.data_model"


def test_the_picture_of_the_architecture_names_every_package_and_every_module_of_the_front_door() -> None:
    picture = (ROOT / "docs" / "img" / "architecture.svg").read_text()
    packages = {path.parent.name for path in ROOT.glob("synthesis/*/__init__.py")}
    modules = {path.stem for path in ROOT.glob("linkage_atlas/[a-z]*.py")}
    # those that a request does not meet
    modules -= {"atlases", "motion_errors", "plotting", "records"}
    assert all(re.search(rf"\b{name}\b", picture) for name in packages | modules)


@pytest.mark.parametrize("path", DOCUMENTS, ids=names)
def test_every_command_exists(path) -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    verbs = set(make_parser()._subparsers._group_actions[0].choices)
    for line in commands(path.read_text()):
        for target in re.findall(r"^make ([a-z]\S*)", line):
            assert target in targets, f"{names(path)}: {line}"
        for verb in re.findall(r"(?:^|\| |/)linkage-atlas ([a-z]\S*)", line):
            assert verb in verbs, f"{names(path)}: {line}"
        for module in re.findall(r"python3? -m ([\w.]+)", line):
            assert importlib.util.find_spec(module), f"{names(path)}: {line}"
        for file in re.findall(
            r"\s@?((?:app|docs|tests|benchmarks|deploy|synthesis|linkage_atlas|data_build)/[\w./]+\w)", line
        ):
            assert (ROOT / file).exists(), f"{names(path)}: {line}"


# -- outputs ----------------------------------------------------------------------------------------------------------

CASEMENT = ROOT / "app" / "examples" / "casement.csv"
LONG_OUTPUT = ("infeasible.md", "first_example.md")
"""Documents that print a result without showing it."""


@pytest.mark.parametrize("path", [path for path in DOCUMENTS if "```python" in path.read_text()], ids=names)
def test_the_python_of_each_document_runs_and_prints_what_it_shows(path, tmp_path, monkeypatch, atlas_path) -> None:
    """The blocks of a document are run in turn; a block of text below a block of Python is its output."""
    for name, target in (("app", ROOT / "app"), ("atlas.h5", atlas_path), ("casement.csv", CASEMENT)):
        (tmp_path / name).symlink_to(target)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    blocks = re.findall(
        r"^```python\n(.*?)^```\n(?:\n+```text\n(.*?)^```)?", path.read_text(), re.MULTILINE | re.DOTALL
    )
    for source, expected in blocks:
        for words, extra in (("import mujoco", "mujoco"), (".plot(", "matplotlib"), ("to_dataframe(", "pandas")):
            if words in source:
                pytest.importorskip(extra)
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(source, path.name, "exec"), names)
        assert bool(expected) or "print(" not in source or path.name in LONG_OUTPUT
        if expected:
            assert_same_output(printed.getvalue(), expected)
    for drawing in tmp_path.glob("*.dxf"):
        assert not ezdxf.readfile(drawing).audit().errors


def test_commands_print_what_the_documents_show(atlas_path, monkeypatch, capsys) -> None:
    monkeypatch.setenv("LINKAGE_ATLAS_ATLAS", str(atlas_path))
    blocks = re.findall(
        r"^```console\n(.*?)^```", "".join(path.read_text() for path in DOCUMENTS), re.MULTILINE | re.DOTALL
    )
    commands = [command for block in blocks for command in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]]
    shown = [command.partition("\n") for command in commands if command.partition("\n")[2].strip()]
    assert len(shown) > 1
    for command, _, expected in shown:
        words = shlex.split(command)
        assert words[0] == "linkage-atlas"
        assert main(words[1:]) == 0
        assert_same_output(capsys.readouterr().out, expected)


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_each_example_runs(script, monkeypatch, atlas_path) -> None:
    """Examples check their results themselves, and draw a picture."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(script.parent)
    monkeypatch.setattr("sys.argv", [str(script), *([str(atlas_path)] if "atlas" in script.stem else [])])
    pyplot.switch_backend("agg")
    with redirect_stdout(io.StringIO()) as printed:
        runpy.run_path(str(script))
    assert printed.getvalue()
    assert pyplot.get_fignums()
    pyplot.close("all")


def test_the_figures_are_those_of_their_script(tmp_path, monkeypatch) -> None:
    committed = {name: (figures.IMAGES / name).read_text() for name in ("notation.svg", "kinds.svg", "motion.svg")}
    monkeypatch.setattr(figures, "IMAGES", tmp_path)
    figures.notation()
    figures.kinds()
    figures.motion()
    number = re.compile(r"-?\d+\.?\d*(?:e[-+]?\d+)?")
    for name, expected in committed.items():
        found = (tmp_path / name).read_text()
        assert number.sub("#", found) == number.sub("#", expected), f"{name}: make docs"
        apart = [abs(float(a) - float(b)) for a, b in zip(number.findall(found), number.findall(expected))]
        assert max(apart) < 0.1, f"{name}: make docs"


# -- container --------------------------------------------------------------------------------------------------------


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile as (instruction, arguments)."""
    text = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(), flags=re.MULTILINE).replace("\\\n", " ")
    return [tuple(line.split(maxsplit=1)) for line in text.splitlines() if line.strip()]


def stages() -> list[list[tuple[str, str]]]:
    parts: list[list[tuple[str, str]]] = []
    for instruction in instructions():
        if instruction[0] == "FROM":
            parts.append([])
        parts[-1].append(instruction)
    return parts


def allowed_in_context(path: str) -> bool:
    rules = [line for line in (ROOT / ".dockerignore").read_text().splitlines() if line and line[0] != "#"]
    return rules[0] == "*" and f"!{path}" in rules


def test_the_dockerfile_copies_what_exists() -> None:
    build, final = stages()
    copied = [word for name, words in build if name == "COPY" for word in words.split()[:-1]]
    for path in copied:
        assert (ROOT / path).exists() and allowed_in_context(path), path
    project = (ROOT / "pyproject.toml").read_text()
    for needed in ("linkage_atlas", "synthesis", "data_build", "app", "build_backend", "README.md", "LICENSE"):
        assert needed in copied and needed in project
    assert {"pyproject.toml", "setup.py"} <= {*copied}
    assert all(words.startswith("--from=build /opt/") for name, words in final if name == "COPY")


def test_what_the_dockerfile_runs_is_a_command_with_these_options() -> None:
    parser = make_parser(named="serve")
    run = re.findall(r'"([^"]*)"', dict(stages()[1])["CMD"])
    assert run[0] == "linkage-atlas"
    options = parser.parse_args(run[1:])
    assert (options.host, options.port) == ("0.0.0.0", 8000)
    assert dict(stages()[1])["EXPOSE"] == "8000"
    for name, words in instructions():
        for line in re.findall(r"bin/linkage-atlas ([^&]+)", words) if name == "RUN" else []:
            make_parser(all_commands=True).parse_args(
                line.replace("\\", " ").split()
            )  # ends the process if it is none
    health = re.findall(r'"([^"]*)"', dict(stages()[1])["HEALTHCHECK"])
    compile(health[2], "HEALTHCHECK", "exec")


def test_the_proxy_stands_in_front_with_read_timeouts() -> None:
    import yaml  # here: every process of the tests reads this file

    services = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
    assert "ports" not in services["atlas"], "only the proxy is reached from outside"
    proxy = services["proxy"]
    assert proxy["ports"] and proxy["image"].startswith("nginx")
    source = proxy["volumes"][0].split(":")[0]
    text = (ROOT / source).read_text()
    assert text.count("{") == text.count("}")
    for directive in (
        "client_header_timeout",
        "client_body_timeout",
        "send_timeout",
        "proxy_read_timeout",
        "keepalive_timeout",
    ):
        assert re.search(rf"^\s*{directive} \d+s;", text, re.MULTILINE), directive
    assert "server atlas:8000;" in text
    assert "proxy_set_header X-Forwarded-For $remote_addr;" in text, "the log has the address of the client"
    assert services["atlas"]["environment"]["FORWARDED_ALLOW_IPS"] == "*"
    limit = int(re.search(r"client_max_body_size (\d+);", text)[1])
    assert limit == Settings.model_fields["max_body_bytes"].default
    published = proxy["ports"][0].split(":")[-1]
    assert f"listen {published} " in text
    wait = int(re.search(r"proxy_read_timeout (\d+)s", text)[1])
    assert wait * 1000 > Settings.model_fields["max_budget_ms"].default
    own = [name for name in services["atlas"]["environment"] if name.startswith("LINKAGE_ATLAS_")]
    assert own and {name.removeprefix("LINKAGE_ATLAS_").lower() for name in own} <= {*Settings.model_fields}
