"""Commands read requests from files and standard input, and end with the documented exit codes.

A traceback, a wrong exit code, or a service that does not end would show here.
"""

import json
import re
import socket
import subprocess
import sysconfig
from pathlib import Path

import pytest

import linkage_atlas
from app.registry import all_queries, worked_example
from tests.conftest import PATIENCE

ROOT = Path(__file__).parents[2]
COMMAND = [str(Path(sysconfig.get_path("scripts")) / "linkage-atlas")]
OK, USAGE, DAMAGED, INTERRUPTED = 0, 2, 3, 130


@pytest.fixture(scope="module")
def small_path(small_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound atlas file of few types."""
    path = tmp_path_factory.mktemp("atlas") / "small.h5"
    path.write_bytes(small_bytes)
    return path


@pytest.fixture
def request_file(tmp_path: Path) -> Path:
    """The worked example's rotation as a request of either query."""
    example = worked_example()
    path = tmp_path / "request.json"
    path.write_text(json.dumps({"rotation": example["rotation"], "crank_span": 70, "top": 3}))
    return path


# -- requests ---------------------------------------------------------------------------------------------------------


# -- errors -----------------------------------------------------------------------------------------------------------

GOOD = '"rotation": [1, 2, 4], "crank_span": 70'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "standard input: is empty"),
        ("nonsense", "the table has no rows"),
        ('{"rotation": 1'.encode("utf-16"), "not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ("null", "'null' is not a number"),
        ("{" + GOOD.replace("70", "NaN") + "}", "crank_span: must be a finite number, found NaN"),
        ("{" + GOOD.replace("70", "9" * 5000) + "}", "not valid JSON"),
        ("{" + GOOD.replace("4", "1e308") + "}", "rotation, sample 3: "),
        ('{"spin": 1, ' + GOOD + "}", "spin: "),
        ('{"\\ud800": 1, ' + GOOD + "}", ""),
    ],
    ids=lambda value: str(value)[:24],
)
def test_a_bad_request_is_named_in_a_line_and_ends_with_2(text, words, run, small_path) -> None:
    code, out, err = run("match", "--atlas", small_path, stdin=text)
    assert (code, out) == (USAGE, "")
    assert words in err and "Traceback" not in err
    assert len(err) < 500, "a request is not repeated"


def test_what_is_no_request_is_told_in_words(run) -> None:
    assert (
        run("synthesize", stdin="x,y,angle\n1,2,3\n")[2]
        == "standard input: the table has 1 row, but at least 2 are required\n"
    )
    code, _, err = run("drive", stdin="x,y,angle\n0,0,0\n1,2,3\n")
    assert code == USAGE and err.startswith("linkage: is required")


@pytest.mark.parametrize("verb", ["match", "serve"])
def test_a_missing_atlas_ends_with_2_and_says_how_to_make_one(verb, run, tmp_path) -> None:
    request = ["--example", "worked_example"] if verb == "match" else []
    code, out, err = run(verb, *request, "--atlas", tmp_path / "none.h5")
    assert (code, out) == (USAGE, "")
    assert "none.h5" in err and "linkage-atlas build" in err


@pytest.mark.parametrize("verb", ["match", "verify", "info"])
@pytest.mark.parametrize("fault", ["bit flip", "cut off", "foreign", "empty"])
def test_a_damaged_atlas_ends_with_3(verb, fault, run, small_bytes, tmp_path) -> None:
    path = tmp_path / "damaged.h5"
    flipped = bytearray(small_bytes)
    flipped[len(flipped) // 2] ^= 1
    damaged = {"bit flip": bytes(flipped), "cut off": small_bytes[:-1], "foreign": b"x" * 4096, "empty": b""}
    path.write_bytes(damaged[fault])
    position = [path] if verb in ("verify", "info") else ["--atlas", path]
    request = ["--example", "worked_example"] if verb == "match" else []
    code, out, err = run(verb, *request, *position)
    assert (code, out) == (DAMAGED, "")
    assert "the file" in err and "Traceback" not in err


def test_a_bad_setting_is_named(run, small_path, monkeypatch) -> None:
    monkeypatch.setenv("LINKAGE_ATLAS_MAX_WAITING", "many")
    code, _, err = run("match", "--example", "worked_example", "--atlas", small_path)
    assert code == USAGE and "max_waiting" in err


def test_without_arguments_all_commands_are_listed(run) -> None:
    code, out, err = run()
    assert (code, out) == (USAGE, "")
    code, out, _ = run("--help")
    assert code == OK and out == err
    for command in ("build", "verify", "info", "serve", *(query.command.split()[0] for query in all_queries())):
        assert re.search(rf"^    {command}\b", out, re.MULTILINE), command
    code, _, err = run("biuld")
    assert code == USAGE and "build" in err


def test_version(run) -> None:
    assert run("--version") == (OK, f"linkage-atlas {linkage_atlas.__version__}\n", "")


def test_an_interrupt_ends_with_130(run, request_file, small_path, monkeypatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("linkage_atlas.match", interrupt)
    assert run("match", request_file, "--atlas", small_path) == (INTERRUPTED, "", "interrupted\n")


# -- processes --------------------------------------------------------------------------------------------------------


def test_a_closed_pipe_is_no_error(small_path) -> None:
    arguments = [*COMMAND, "match", "--example", "worked_example", "--json", "--atlas", str(small_path)]
    with subprocess.Popen(arguments, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        messages = process.stderr.read().decode()
        assert process.wait(PATIENCE) == OK
    assert messages == ""


def test_a_port_in_use_is_said(small_path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        command = [*COMMAND, "serve", "--atlas", small_path, "--port", str(taken.getsockname()[1])]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    output = done.stdout + done.stderr
    assert done.returncode != OK and "address already in use" in output and "Traceback" not in output
