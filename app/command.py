"""Questions on the command line: a request from a file, an example or a pasted table; its reply as table, JSON and files."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import threading
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import pydantic_core
from pydantic import ValidationError

from app.query import FILES, LengthUnit, Query, RequestModel, Resources, in_unit, invalid
from app.registry import examples_of, queries_named
from app.terminal import EPILOG, FILE, Exit, Units, add_atlas, exit_of, whole_number
from linkage_atlas import FieldError
from linkage_atlas.formats import kind_of
from linkage_atlas.tables import decoded, length_unit_of

NO_PRESET = ((["limits", "preset"], "none"),)
"""Field and value that turn the practical limits off."""
DELAY = 1.0
"""Seconds before a line says that a command still works: most answers are there sooner."""
STEP = 0.2
"""Seconds between two drawings of that line."""
_FILE_HELP = (
    "the request as JSON",
    "the request as JSON, or its samples as a table (CSV, or pasted from a spreadsheet)",
)


_LACKING: dict[str, Any] = {
    "catalogue": None,
    "no_preset": False,
    "refine_from": None,
    "unwrap": False,
    "export": [],
    "plot": False,
    "rank": 1,
    "length_unit": None,
}
"""Values of options that a question does not have."""


def add_query(parser: argparse.ArgumentParser, query: Query) -> None:
    prefix = query.command.replace(" ", "-") + "-"
    shown = ", ".join(name for name in examples_of(query) if not name.startswith(prefix))
    about = f"answer a bundled example instead: {shown}"
    file = _FILE_HELP[query.from_csv is not None]
    if _takes_linkage(query):
        file = file.replace(
            "the request as JSON", "the request as JSON, or a file of `synthesize --export FILE.json`"
        )
    examples = add_request(parser, query, query.summary, file, about)
    if "limits" in query.request.model_fields:
        parser.add_argument(
            "--no-preset",
            action="store_true",
            help="keep to no limits but those of the request, as --set limits.preset=none",
        )
    add_set(
        parser, "a field of the request, as in top=3 or limits.pivot_box=[0,0,200,100]; may be given several times"
    )
    if "refine_from" in query.request.model_fields:
        parser.add_argument(
            "--refine-from",
            type=Path,
            metavar="FILE",
            help="search nowhere, but refine this linkage from just there: a solution as JSON, as --export FILE.json or --json "
            "writes it (of a reply its first)",
        ).complete = FILE  # type: ignore[attr-defined]
    if query.command == "drive":
        parser.add_argument(
            "--catalogue",
            type=Path,
            metavar="FILE",
            help="a CSV file of actuators (name, retracted, stroke, force, ..) for every actuator that is asked for",
        ).complete = FILE
    if query.from_csv is not None:
        parser.add_argument(
            "--unwrap",
            action="store_true",
            help="take each angle of a table within half a turn of the one before: 350, 10, 30 as 350, 370, 390",
        )
    parser.add_argument("--json", action="store_true", help="print the reply as JSON, not as a table")
    if query.reads_atlas:
        add_atlas(parser, "the atlas, if one is needed")
    if query.exports:
        formats = ", ".join((*query.exports, "json"))
        parser.add_argument(
            "--export",
            type=Path,
            metavar="FILE",
            action="append",
            default=[],
            help=f"also write a file; its ending says which: {formats}; may be given several times",
        ).complete = FILE  # type: ignore[attr-defined]
    if "svg" in query.exports:
        parser.add_argument(
            "--plot", action="store_true", help="also draw it, and open the picture where there is a screen"
        )
    if query.files is not None:
        parser.add_argument(
            "--rank",
            type=whole_number(1, 100),
            default=1,
            help="which solution to write or draw, if need be of more than `top` (%(default)s)",
        )
    if query.shows_units:
        parser.add_argument(
            "--length-unit",
            choices=get_args(LengthUnit),
            help="the unit of the request's lengths, for heads of tables and for files that know a unit (mm)",
        )
    parser.set_defaults(run=lambda options: _run(options, query), examples=examples, **_LACKING)


def add_request(parser: argparse.ArgumentParser, query: Query, about: str, file: str, example: str) -> dict[str, Any]:
    """What a command does, and where its request comes from; returns the requests of the examples by their names."""
    examples = {name: one.request for name, one in examples_of(query).items()}
    parser.description, parser.epilog = about, EPILOG
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    given = parser.add_argument("file", nargs="?", default="-", help=f"{file}; - or nothing: standard input")
    given.complete = FILE  # type: ignore[attr-defined]
    parser.add_argument("--example", choices=sorted(examples), metavar="NAME", help=example)
    return examples


def add_set(parser: Any, what: str) -> None:
    parser.add_argument("--set", type=setting, metavar="FIELD=VALUE", action="append", default=[], help=what)


def setting(text: str) -> tuple[list[str], Any]:
    """A field's path and its value: JSON, or else a word, or words in brackets."""
    path, equals, value = text.partition("=")
    if not equals or not all(path.split(".")):
        raise argparse.ArgumentTypeError(f"wanted FIELD=VALUE, found {text!r}")

    def read(value: str) -> Any:
        try:
            return json.loads(value)
        except ValueError:
            words = re.fullmatch(r"\[([\w\s,.-]+)\]", value)
            return [read(word.strip()) for word in words[1].split(",")] if words else value

    return path.split("."), read(value)


def _run(options: argparse.Namespace, query: Query) -> int:
    from app.query import json_of
    from app.resources import ServiceResources
    from app.settings import atlas_of, settings_of

    wanted = {path: _format_of(query, path) for path in options.export}
    also = [*options.set, *(NO_PRESET if options.no_preset else ())]
    if options.refine_from is not None:
        also = [*also, (["refine_from"], _solution_in(options.refine_from))]
    if options.length_unit is not None and "length_unit" in query.request.model_fields:
        also = [*also, (["length_unit"], options.length_unit)]
    text, rank = text_of(options), options.rank
    request, length_unit = read_request(query, text, also, options.unwrap), _length_unit(options, query, text)
    request = in_unit(request, length_unit)
    if options.catalogue is not None:
        rows = decoded(options.catalogue.read_bytes())
        cylinders = ("actuator", "cylinder")
        if not any(one.kind in cylinders for one in request.drives):
            raise FieldError("/catalogue", "is for actuators, and none is asked for")
        given = [
            one.model_copy(update={"catalogue": rows} if one.kind in cylinders else {}) for one in request.drives
        ]
        request = request.model_copy(update={"drives": given})
    if rank > getattr(request, "top", rank):
        request = request.model_copy(update={"top": rank})
    resources = ServiceResources(settings_of(options), atlas_of)
    with waiting("searching" if query.files else "computing", resources.max_budget_ms / 1000):
        reply = query.answer(request, resources)
    code = exit_of(request, reply)
    found = len(getattr(reply, "solutions", [None] * rank))

    def file(name: str) -> bytes:
        return _file(query, request, reply, rank, name, length_unit, resources)

    if found < rank and (wanted or options.plot or rank > 1):
        there = "there is 1 solution" if found == 1 else f"there are {found} solutions"
        print(f"no solution of rank {rank}: {there}", file=sys.stderr)
        code = code or Exit.USAGE
    else:
        code = write({path: file(name) for path, name in wanted.items()}) or code
        if options.plot:
            _show(file("svg"))
    unit = getattr(request, "angle_unit", "deg")  # a question without angles has none
    units = (Units(unit, length_unit or ""),) if query.shows_units else ()
    print(json_of(reply, 2).decode() if options.json else query.table(reply, *units))
    return code


@contextmanager
def waiting(words: str, most: float | None = None) -> Iterator[None]:
    """Show words and seconds on standard error while the block runs, of at most so many; only on a terminal.

    A thread draws: what computes need not know of it.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    limit = "" if most is None else f" of at most {most:g}"
    done = threading.Event()

    def draw() -> None:
        if done.wait(DELAY):
            return
        from tqdm import tqdm

        with tqdm(
            file=sys.stderr, leave=False, bar_format=f"{words}: {{postfix[0]:.0f}} s{limit}", postfix=[DELAY]
        ) as bar:
            while not done.wait(STEP):
                bar.postfix[0] += STEP
                bar.refresh()

    drawing = threading.Thread(target=draw, daemon=True)
    drawing.start()
    try:
        yield
    finally:
        done.set()
        drawing.join()


def write(files: Mapping[Path, bytes]) -> Exit:
    """Write files and say which; FAILED where one cannot be."""
    for path, content in files.items():
        try:
            path.write_bytes(content)
        except OSError as error:
            print(f"cannot write: {error}", file=sys.stderr)
            return Exit.FAILED
        print(f"wrote {path}", file=sys.stderr)
    return Exit.OK


def text_of(options: argparse.Namespace) -> bytes:
    """The text of a file, of a bundled example, or of standard input, without the mark of UTF-8."""
    if options.example and options.file != "-":
        raise FieldError("", "give a file or --example, not both")
    if options.example:
        return json.dumps(options.examples[options.example]).encode()
    if options.file == "-":
        if sys.stdin.isatty():
            print("reading the request from this terminal; Ctrl-D ends it", file=sys.stderr)
        return sys.stdin.buffer.read().removeprefix(BOM_UTF8)
    return Path(options.file).read_bytes().removeprefix(BOM_UTF8)


def _solution_in(path: Path) -> Any:
    """The solution in a file: alone, beside its request, or the first of a reply."""
    try:
        content = parsed(path.read_bytes())
    except FieldError as error:
        raise FieldError("/refine_from", f"{path.name}: {error.message}") from None
    if isinstance(content, dict) and isinstance(content.get("solutions"), list):
        if not content["solutions"]:
            raise FieldError("/refine_from", f"{path.name} is a reply without solutions")
        return content["solutions"][0]
    return content.get("solution", content) if isinstance(content, dict) else content


def read_request(query: Query, text: bytes, also: Sequence[tuple[list[str], Any]] = (), unwrap: bool = False) -> Any:
    """The request of a JSON text, or of a table where the query takes one.

    Fields in ``also`` go before those of the text; ``unwrap`` takes the angles of a table as continuous.
    """
    is_json = _is_json(query, text)
    request: RequestModel
    if not text.strip():
        if not also:
            raise FieldError("", "it is empty: name a file or an --example, or give it on standard input")
        text = b"{}"
    elif query.from_csv is None and not is_json:
        raise FieldError("", "wanted JSON: tables are read where the samples of a motion or a function are asked for")
    if unwrap and is_json:
        raise FieldError("", "--unwrap is for a table of samples, and this is JSON")
    try:
        if query.from_csv is not None and not is_json:
            request = query.request.model_validate(query.from_csv(decoded(text), with_fields({}, also), unwrap))
        elif also or _takes_linkage(query):
            request = query.request.model_validate(with_fields(_asked_of(query, parsed(text)), also))
        else:
            request = query.request.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if not is_json and first["type"] == "too_short":  # of each of its columns
            few = first["ctx"]
            raise FieldError("", f"wanted at least {few['min_length']} rows, found {few['actual_length']}") from None
        raise invalid(error, query.request) from None
    return request


def _is_json(query: Query, text: bytes) -> bool:
    """Whether a text is no table; a table may begin with a name in quotes."""
    return text.lstrip()[:1] in (b"{", b"[", b"" if query.from_csv else b'"', b"")


def _length_unit(options: argparse.Namespace, query: Query, text: bytes) -> str | None:
    """The unit of lengths that the option names, or the heads of a table of poses."""
    of_poses = "position" in query.request.model_fields and not _is_json(query, text)
    named: str | None = length_unit_of(decoded(text)) if of_poses else None
    if None not in (named, options.length_unit) and named != options.length_unit:
        raise FieldError("/length_unit", f"the heads of the table say {named}, --length-unit {options.length_unit}")
    return options.length_unit or named


def _takes_linkage(query: Query) -> bool:
    return {"linkage", "request"} <= query.request.model_fields.keys()


def _asked_of(query: Query, body: Any) -> Any:
    """A body; a file of `synthesize --export` has its linkage as its solution."""
    if _takes_linkage(query) and isinstance(body, dict) and "linkage" not in body and "solution" in body:
        return {("linkage" if name == "solution" else name): value for name, value in body.items()}
    return body


def parsed(text: bytes) -> Any:
    """JSON, without NaN and infinity."""
    try:
        return pydantic_core.from_json(text, allow_inf_nan=False)
    except ValueError as error:
        raise FieldError("", f"Invalid JSON: {error}") from None


def with_fields(body: Any, also: Sequence[tuple[list[str], Any]]) -> Any:
    """A body with some fields set, also within objects that it has or has not."""
    if not isinstance(body, dict):
        raise FieldError("", "wanted a JSON object")
    for path, value in also:
        at = body
        for name in path[:-1]:
            at[name] = at[name] if isinstance(at.get(name), dict) else {}
            at = at[name]
        at[path[-1]] = value
    return body


def _format_of(query: Query, path: Path) -> str:
    """The format that the name of a file means; of two that fit the longer: plates.dxf before dxf."""
    formats = {name: name for name in (*query.exports, "json")}
    for known in FILES.values():
        if known.endings[0] in query.exports:
            formats |= dict.fromkeys(known.endings, known.endings[0])
    ending = max((one for one in formats if path.name.lower().endswith(f".{one}")), key=len, default="")
    if not ending:
        raise FieldError("/export", f"the file must end in one of {', '.join(formats)}, found '{path.name}'")
    return formats[ending]


def _file(
    query: Query, request: Any, reply: Any, rank: int, name: str, length_unit: str | None, resources: Resources
) -> bytes:
    if query.files is not None:
        kind = next(kind for kind in query.files.formats if FILES[kind].endings[0] == name)
        solution = reply.solutions[rank - 1].to_dict()
        body = {"request": request, "solution": solution, "format": kind}
        body |= {"length_unit": length_unit} if length_unit else {}
        return query.files.render(query.files.request(**body), resources)
    from app.query import json_of

    if name == "json":
        return json_of(reply, 2)
    return query.exports[name](request, resources)


def _show(picture: bytes) -> None:
    """Keep a picture in a file of its own and open it; where nothing opens it, its place is said."""
    import tempfile
    import webbrowser

    with tempfile.NamedTemporaryFile(prefix="linkage-", suffix=".svg", delete=False) as file:
        file.write(picture)
    screen = sys.platform == "darwin" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())
    opened = screen and webbrowser.open(
        Path(file.name).as_uri()
    )  # without one it might start a browser in the terminal
    print(f"{'opened' if opened else 'no screen to open it on: wrote'} {file.name}", file=sys.stderr)


# -- a linkage as a file: of a request that is solved, or of a solution that was saved with its request ------------------


def add_export(parser: argparse.ArgumentParser) -> None:
    from app.fourbar.answers import LINKAGE_FILES
    from app.fourbar.models import Material, SolidsRequest

    (query,) = queries_named("synthesize")
    examples = add_request(
        parser,
        query,
        LINKAGE_FILES.summary,
        "as JSON a request, or one with its solution as `synthesize --export FILE.json` writes it; or samples as a table "
        "(CSV, or pasted from a spreadsheet)",
        "solve a bundled example instead",
    )
    parser.add_argument(
        "--format", choices=LINKAGE_FILES.formats, help="default: as the ending of --out or the body says"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="the file to write (default: its example's or request's name)"
    ).complete = FILE  # type: ignore[attr-defined]
    parser.add_argument(
        "--rank", type=whole_number(1, 100), help="which solution of the request (default: as it says, or 1)"
    )
    parser.add_argument("--length-unit", choices=get_args(LengthUnit), help="the unit of the lengths (mm)")
    add_atlas(parser, "the atlas, if one is needed")
    parts = parser.add_argument_group("parts, for step, 3mf, stl, urdf, sdf, parts and the masses in mjcf")
    fits = get_args(SolidsRequest.model_fields["fit"].annotation)
    parts.add_argument(
        "--fit", choices=fits, help="how pins fit: tolerances for a workshop (H7), or play for a printer"
    )
    parts.add_argument("--material", choices=get_args(Material), help="of plates and boards")
    parts.add_argument("--boards", choices=("below", "above", "both", "bar"), help="where fixed pins stand (below)")
    parts.add_argument("--heads", action="store_true", default=None, help="pins with heads")
    for name, words in (
        ("hole", "diameter of the pins"),
        ("width", "of the plates"),
        ("thickness", "of the plates"),
        ("clearance", "least gap of parts that pass one another"),
        ("kerf", "width of the cut, for plates (0)"),
        ("scale", "of a model (1)"),
    ):
        parts.add_argument(f"--{name}", type=float, help=words)
    parts.add_argument("--nevertheless", action="store_true", default=None, help="also where parts would collide")
    add_set(
        parts,
        "another field of the body of /v1/export, as in assembly.width=20 or solids.pins=brass; may be given several times",
    )
    parser.set_defaults(run=_export, examples=examples)


_FIELDS = {
    "solids": ("fit", "material", "nevertheless"),
    "assembly": ("boards", "heads", "hole", "width", "thickness", "clearance", "kerf", "scale"),
}


def _export(options: argparse.Namespace) -> int:
    from app.fourbar.answers import LINKAGE_FILES
    from app.fourbar.models import ExportRequest
    from app.resources import ServiceResources
    from app.settings import atlas_of, settings_of

    kind = options.format or (None if options.out is None else _kind_of(options.out.name))
    given = {part: {name: getattr(options, name) for name in names} for part, names in _FIELDS.items()}
    also = [([part, name], value) for part, values in given.items() for name, value in values.items()]
    also += [(["rank"], options.rank), (["format"], kind)]
    body = with_fields(_body(options), [*(one for one in also if one[1] is not None), *options.set])
    try:
        request = ExportRequest.model_validate(body)
    except ValidationError as error:
        raise invalid(error, ExportRequest) from None
    resources = ServiceResources(settings_of(options), atlas_of)
    with waiting("computing", resources.max_budget_ms / 1000):
        content = LINKAGE_FILES.render(request, resources)
    source = None if options.example or options.file == "-" else Path(options.file)
    stem = options.example or ("linkage" if source is None else source.name.partition(".")[0])
    path = options.out or Path(f"{stem}.{FILES[request.format].endings[-1]}")
    if options.out is None and source is not None and path.exists() and path.samefile(source):
        raise FieldError("/out", f"{path} is the request itself: name another file")
    return write({path: content})


def _kind_of(name: str) -> str:
    return "json" if name.endswith(".json") and not name.endswith(".pylinkage.json") else kind_of(name)


def _body(options: argparse.Namespace) -> dict[str, Any]:
    """What is exported: a body of /v1/export, or the request of one."""
    (query,) = queries_named("synthesize")
    text = text_of(options)
    if text.strip() and _is_json(query, text) and isinstance(content := parsed(text), dict):
        if isinstance(content.get("solutions"), list):
            raise FieldError(
                "", "this is a reply: wanted its request, or what `synthesize --export FILE.json` writes"
            )
        if "request" in content:
            return content | ({"length_unit": options.length_unit} if options.length_unit else {})
    request, length_unit = read_request(query, text), _length_unit(options, query, text)
    return {"request": in_unit(request, length_unit), "length_unit": length_unit}
