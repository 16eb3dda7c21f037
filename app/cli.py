"""The program ``linkage-atlas``: commands, options, help and exit codes."""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, get_args

from app.fourbar import QUESTIONS
from app.registry import queries_named
from app.scenes import SCENES
from app.terminal import EPILOG, Exit
from linkage_atlas import AtlasError, AtlasFault, FieldError, __version__

DESCRIPTION = """Find planar linkages for a required motion.

  linkage-atlas example casement > request.json   print an example request to edit
  linkage-atlas synthesize request.json           find linkages for a request
  linkage-atlas synthesize poses.csv --length-unit mm --export linkage.dxf
  linkage-atlas export request.json --format step export the best linkage to CAD
  linkage-atlas serve                             serve the page at http://127.0.0.1:8000
  linkage-atlas COMMAND --help                    list the options and fields of a command
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    return run(parsed(sys.argv[1:] if argv is None else argv))


def parsed(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments of a command; the attribute ``run`` of the result is the function that runs it."""
    parser = make_parser(next((word for word in argv if not word.startswith("-")), None))
    if not argv:
        return argparse.Namespace(run=lambda _: parser.print_help(sys.stderr) or Exit.USAGE)
    return parser.parse_args(list(_with_negative_values(argv)))


def _with_negative_values(argv: Sequence[str]) -> Iterator[str]:
    """Join an option and a negative value such as -10,0,90,90, which argparse would read as an option."""
    words = list(argv)
    while words:
        word = words.pop(0)
        is_value = word.startswith("--") and "=" not in word and words and re.match(r"-[\d.]", words[0])
        yield f"{word}={words.pop(0)}" if is_value else word


def run(options: argparse.Namespace) -> int:
    """Run a parsed command; report its errors and return its exit code."""
    try:
        code: int = options.run(options)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return Exit.INTERRUPTED
    except BrokenPipeError:  # the reader has closed the pipe; do not flush into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.OK
    except FieldError as error:
        print(error, file=sys.stderr)
        return Exit.USAGE
    except OSError as error:
        print(f"{error.filename}: {error.strerror}{_near_file(error)}" if error.filename else error, file=sys.stderr)
        return Exit.USAGE
    except AtlasError as error:
        print(error, file=sys.stderr)
        if error.fault is not AtlasFault.MISSING:
            return Exit.DAMAGED
        print(
            "Build an atlas with `linkage-atlas build --out FILE`, or name one with `--atlas FILE`.", file=sys.stderr
        )
        return Exit.USAGE


def _near_file(error: OSError) -> str:
    """Return a hint to a file of a similar name."""
    path = Path(str(error.filename))
    if not isinstance(error, FileNotFoundError) or not path.parent.is_dir():
        return ""
    similar = get_close_matches(path.name, [file.name for file in path.parent.iterdir()], 1)
    return f"; did you mean {path.with_name(similar[0])}?" if similar else ""


# -- the parser -------------------------------------------------------------------------------------------------------

_PLAIN = argparse.RawDescriptionHelpFormatter
FILE: dict[str, str] = {}
"""Completion of file names in each shell; the command ``completion`` fills it."""
SHELLS = ("bash", "zsh", "fish")


class _Parser(argparse.ArgumentParser):
    """Parser of a command, which reports unknown options with its own usage and names similar options."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            word = unknown[0].partition("=")[0]
            similar = get_close_matches(word, self._option_string_actions, 1)
            hint = f"; did you mean {similar[0]}?" if similar else f"; see {self.prog} --help"
            if re.match(r"-?[\d.]", word):
                hint = "; separate the items of a list with commas, as in 0,0,200,100"
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return options, unknown

    def error(self, message: str) -> Any:
        """End with the usage and the message; name the closest choice if a choice is invalid."""
        if found := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            similar = get_close_matches(found[1], re.findall(r"[\w.-]+", found[2]), 1)
            message += f"; did you mean {similar[0]}?" if similar else ""
            if Path(found[1]).is_file():
                message = f"write a command before the file, as in: {self.prog} synthesize {found[1]}"
        super().error(message)


def make_parser(named: str | None = None, all_commands: bool = False) -> argparse.ArgumentParser:
    """Return the parser with the options of the named command, or of all; the modules of other commands are not imported."""
    parser = _Parser(prog="linkage-atlas", description=DESCRIPTION, epilog=EPILOG, formatter_class=_PLAIN)
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for name, (text, add) in _COMMANDS.items():
        command = commands.add_parser(name, help=text, formatter_class=_PLAIN)
        if all_commands or name == named:
            add(command, name)
    return parser


def whole_number(minimum: int, maximum: int | None = None) -> Callable[[str], int]:
    """Return a function that reads a whole number from ``minimum`` to ``maximum``, for the type of an argument."""
    allowed = f"of at least {minimum}" if maximum is None else f"from {minimum} to {maximum}"

    def read(text: str) -> int:
        if not re.fullmatch(r"-?\d+", text) or int(text) < minimum or (maximum is not None and int(text) > maximum):
            raise argparse.ArgumentTypeError(f"must be a whole number {allowed}, found {text}")
        return int(text)

    return read


def add_file(parser: Any, *names: str, **options: Any) -> None:
    """Add an argument that is a file name; shells complete it."""
    parser.add_argument(*names, **{"type": Path, "metavar": "FILE"} | options).complete = FILE


def add_atlas(parser: Any, description: str = "atlas file") -> None:
    """Add the option ``--atlas``."""
    add_file(
        parser,
        "--atlas",
        help=f"{description} (default: atlas.h5 in this folder; otherwise the default atlas, which is built once in the cache)",
    )


# -- questions and exports --------------------------------------------------------------------------------------------

_LACKING = {"export": [], "plot": False, "rank": None, "length_unit": None, "columns": None}
_LACKING |= {"unwrap": False, "set": [], "json": False, "linkage": None}
"""Default values of options that a command does not have."""


def _add_questions(parser: argparse.ArgumentParser, name: str) -> None:
    queries = queries_named(name)
    if queries[0].command == name:
        return _add_query(parser, queries[0])
    verbs = parser.add_subparsers(metavar="COMMAND", required=True)
    for query in queries:
        _add_query(verbs.add_parser(query.command.split()[1], help=query.summary, formatter_class=_PLAIN), query)


def _add_query(parser: argparse.ArgumentParser, query: Any) -> None:
    from app.command import run_question
    from app.query import FILES
    from app.sources import Target

    target = Target.of(query)
    examples = _add_request(parser, target, query, "answer")
    parser.add_argument(
        "--json", action="store_true", help="print the reply as JSON" + (", with its request" if query.files else "")
    )
    if len(query.formats) > 1:
        endings = ", ".join(FILES[kind].endings[0] for kind in query.formats)
        text = f"also write a file; its suffix selects the format: {endings}; may be repeated"
        add_file(parser, "--export", action="append", default=[], help=text)
    if "svg" in query.formats:
        drawn = "curves" if query.command == "drive" else "linkage"
        parser.add_argument("--plot", action="store_true", help=f"also draw the {drawn} and open the drawing")
    if query.reads_atlas:
        add_atlas(parser, "atlas file, if the request needs an atlas")
    parser.set_defaults(run=partial(run_question, query=query), examples=examples)


def _add_writer(parser: argparse.ArgumentParser, name: str) -> None:
    """Add the arguments of a command that writes a file of a solution: ``export`` or ``report``."""
    from app.command import run_export, run_report
    from app.fourbar.answers import LINKAGE_FILES
    from app.fourbar.models import ExportRequest
    from app.sources import Target

    (query,), exports = queries_named("synthesize"), name == "export"
    target = Target("export", ExportRequest) if exports else Target.of(query)
    examples = _add_request(parser, target, query, "export the linkage of" if exports else "report on")
    parser.description = (
        "Write a page of HTML on a solution: drawing, dimensions, errors, verdict, drives and springs."
    )
    add_file(parser, "--out", help="output file (default: named after the example or the request)")
    if exports:
        parser.description, formats = LINKAGE_FILES.summary, LINKAGE_FILES.formats
        words = "format (default: from the suffix of --out or the request)"
        parser.add_argument("--format", choices=formats, help=words)
    add_atlas(parser, "atlas file, if the request needs an atlas")
    parser.set_defaults(run=run_export if exports else run_report, examples=examples)


_FIELDS = {
    "limits.family": "--family",
    "limits.pivot_box": "--pivot-box",
    "limits.link_min": "--link-min",
    "limits.link_max": "--link-max",
    "limits.transmission_angle_min": "--transmission",
    "limits.preset=none": "--no-preset",
    "refine_only=true": "--refine-only",
    "solids.fit": "--fit",
    "solids.material": "--material",
    "solids.allow_collisions=true": "--allow-collisions",
    "assembly.boards": "--boards",
    "assembly.pin_heads=true": "--pin-heads",
    **{f"assembly.{name}": f"--{name}" for name in ("hole", "width", "thickness", "clearance", "kerf", "scale")},
}
"""Option for a field of a request, or for a field with a certain value."""


def _add_request(parser: argparse.ArgumentParser, target: Any, query: Any, verb: str) -> dict[str, Any]:
    """Add the arguments that define the request; return the requests of the examples by name."""
    from app.query import LengthUnit
    from app.registry import examples_of
    from app.sources import setting
    from linkage_atlas.tables import read_columns

    examples = {name: example.request for name, example in examples_of(query).items()}
    prefix = query.command.replace(" ", "-") + "-"
    reads = ["a request (JSON)"]
    if target.linkage:
        reads.append("a saved solution or a reply")
    if target.table:
        reads.append("a table of samples (CSV, or pasted from a spreadsheet)")
    parser.description = query.summary
    parser.epilog = f"{_fields_help(target)}\n\n{EPILOG}"
    files = f"{', '.join(reads[:-1])}{', or ' if reads[1:] else ''}{reads[-1]}; default, and -: standard input"
    add_file(parser, "file", nargs="?", default="-", type=str, help=files, metavar="file")
    shown = ", ".join(name for name in examples if not name.startswith(prefix))
    parser.add_argument(
        "--example", choices=sorted(examples), metavar="NAME", help=f"{verb} a bundled example: {shown}"
    )
    parser.add_argument(
        "--set",
        type=_argument(setting),
        metavar="FIELD=VALUE",
        action="append",
        default=[],
        help="set a field of the request, as in top=3, limits.pivot_box=[0,0,200,100], drives.1.stroke=90 (items are counted "
        "from 1) or limits=@limits.json (content of a file); objects are merged; may be repeated; the fields are listed below",
    )
    fields = dict(_fields(target.model)) | dict(_fields(target.motion) if target.motion else ())
    for assignment, option in _FIELDS.items():
        path, _, value = assignment.partition("=")
        is_used = "solids" in fields or not path.startswith("assembly.")
        is_used = is_used and not (path.startswith("limits.") and target.command == "drive")
        if path in fields and is_used:
            action = {"action": "append_const", "const": setting(assignment)} if value else {"action": "append"}
            metavar = "XMIN,YMIN,XMAX,YMAX" if option.endswith("box") else "VALUE"
            action |= {} if value else {"type": _argument(partial(_field, path)), "metavar": metavar}
            text = "Apply only the limits of the request." if value == "none" else fields[path]
            parser.add_argument(option, dest="set", help=f"{text} (--set {assignment})", **action)
    name = target.linkage or ("start_from" if "start_from" in target.model.model_fields else None)
    if name is not None:
        option = "--linkage" if target.linkage else "--start-from"
        text = "linkage" if target.linkage else "linkage from which the search starts"
        add_file(parser, option, dest="linkage", help=f"{text}: a saved solution or a reply (--set {name}=@FILE)")
    if target.table:
        parser.add_argument(
            "--columns",
            type=_argument(read_columns),
            metavar="x=TX,y=TY,angle=RZ",
            help="headings of the columns of a table, or their numbers; other columns are ignored",
        )
        parser.add_argument(
            "--unwrap",
            action="store_true",
            help="shift each angle of a table to within half a turn of the previous angle: 350, 10, 30 is read as 350, 370, 390",
        )
    if query.files is not None or target.linkage:
        parser.add_argument(
            "--rank", type=whole_number(1, 100), help="rank of the solution to export, or to read from a reply (1)"
        )
    if query.shows_units:
        parser.add_argument(
            "--length-unit",
            choices=get_args(LengthUnit),
            help="unit of the lengths of the request, for tables and for files with a unit (mm)",
        )
    parser.set_defaults(**_LACKING)
    return examples


def _field(path: str, value: str) -> Any:
    """Read the value of a field; the brackets of a list may be omitted."""
    from app.sources import setting

    return setting(f"{path}=[{value}]" if "," in value and not value.startswith("[") else f"{path}={value}")


def _argument(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a function that reads a value and reports a `FieldError` through argparse."""

    def checked(text: str) -> Any:
        try:
            return read(text)
        except FieldError as error:
            raise argparse.ArgumentTypeError(error.message) from None

    return checked


def _fields_help(target: Any) -> str:
    """Return the help of the fields of a request."""
    lines, width = ["fields of the request, for --set and in JSON:"], min(shutil.get_terminal_size().columns, 120)
    for path, text in _fields(target.model):
        lines += textwrap.wrap(f"{path}  {text}", width, initial_indent="  ", subsequent_indent=" " * 8)
    if target.motion:
        lines.append("  The fields of the motion are listed by: linkage-atlas synthesize --help")
    return "\n".join(lines)


def _fields(model: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the help of each field, including the fields of objects."""
    from app.query import models_in

    descriptions = model.descriptions()
    for name, info in model.model_fields.items():
        within = [] if name in ("linkage", "start_from") else models_in(info.annotation)
        is_list = "list[" in str(info.annotation)
        if name == "request":
            continue
        parts = [descriptions.get(name) or ((within and within[0].__doc__) or "").partition("\n")[0]]
        if values := [str(value) for value in get_args(info.annotation) if isinstance(value, str)]:
            parts.append(f"One of {', '.join(values)}.")
        if within and is_list:
            parts.append(f"Fields of each: {', '.join(within[0].model_fields)}.")
        if not (info.is_required() or info.default is None or info.default_factory):
            parts.append(f"Default: {json.dumps(info.default, default=str)}.")
        yield path + name, " ".join(filter(None, parts))
        if within and not is_list and path.count(".") < 2:
            yield from _fields(within[0], f"{path}{name}.")


# -- other commands ---------------------------------------------------------------------------------------------------


def _add_study(parser: argparse.ArgumentParser, name: str) -> None:
    from app.registry import all_queries
    from app.study import DESCRIPTION, run_study

    parser.description, parser.epilog = DESCRIPTION, EPILOG
    add_file(
        parser,
        "requests",
        help="file with a request (JSON) on each line; empty lines are ignored",
        metavar="requests",
    )
    add_file(
        parser, "--out", required=True, help="file of the results; an interrupted study continues with this file"
    )
    commands = [query.command for query in all_queries()]
    parser.add_argument(
        "--command",
        choices=commands,
        metavar="COMMAND",
        default="synthesize",
        help=f"command that answers the requests: {', '.join(commands)} (%(default)s)",
    )
    _add_workers(parser)
    parser.add_argument("--no-preset", action="store_true", help="apply only the limits of each request")
    add_atlas(parser, "atlas file, if a request needs an atlas")
    parser.set_defaults(run=run_study)


def _add_completion(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = "Print a script that completes commands and options, or install it."
    parser.add_argument("shell", nargs="?", choices=SHELLS, help="default: the shell of the user")
    parser.add_argument("--install", action="store_true", help="write the script to the user's folder for this shell")
    parser.set_defaults(run=_completion)


def _completion(options: argparse.Namespace) -> int:
    import shtab

    from app.command import write

    shell = options.shell or Path(os.environ.get("SHELL", "bash")).name
    if shell not in SHELLS:
        raise FieldError("/shell", f"there is no completion for {shell}; name bash, zsh or fish")
    FILE.update(shtab.FILE)
    script = shtab.complete(make_parser(all_commands=True), shell)
    if not options.install:
        print(script)
        return Exit.OK
    variable, standard, name = {
        "bash": ("XDG_DATA_HOME", ".local/share", "bash-completion/completions/linkage-atlas"),
        "zsh": ("XDG_DATA_HOME", ".local/share", "zsh/site-functions/_linkage-atlas"),
        "fish": ("XDG_CONFIG_HOME", ".config", "fish/completions/linkage-atlas.fish"),
    }[shell]
    file = Path(os.environ.get(variable) or Path.home() / standard) / name
    file.parent.mkdir(parents=True, exist_ok=True)
    if shell == "zsh":
        print(f"add this line to ~/.zshrc before compinit: fpath+=({file.parent})", file=sys.stderr)
    return write({file: script.encode()})


def _add_example(parser: argparse.ArgumentParser, name: str) -> None:
    from app.registry import all_examples

    parser.description = "Print a bundled example request as JSON, or list the names of all examples."
    parser.add_argument("name", nargs="?", choices=tuple(all_examples()), metavar="NAME")
    parser.set_defaults(run=_example)


def _example(options: argparse.Namespace) -> int:
    from app.registry import all_examples
    from app.terminal import table

    if options.name is None:
        rows, before = [], ""
        for name, (by, _, about) in all_examples().items():
            if not name.startswith("synthesize-"):
                rows.append((name, by, '"' if about == before else about))
                before = about
        print(table(("name", "command", "description"), rows, left=True))
        return Exit.OK
    example = all_examples()[options.name]
    print(_pretty(example.request))
    print(f"answer this request with: linkage-atlas {example.command} FILE", file=sys.stderr)
    return Exit.OK


def _pretty(value: Any, indent: str = "") -> str:
    """Format JSON for editing: a line for each field, and a single line for a list of numbers such as a pose."""
    inner = indent + "  "
    if isinstance(value, Mapping) and value:
        rows = [f"{inner}{json.dumps(name)}: {_pretty(part, inner)}" for name, part in value.items()]
        return "{\n" + ",\n".join(rows) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(part, (list, Mapping)) for part in value):
        return "[\n" + ",\n".join(inner + _pretty(part, inner) for part in value) + f"\n{indent}]"
    return json.dumps(value)


def _add_build(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = "Build an atlas file."
    add_file(parser, "--out", default=Path("atlas.h5"), help="output file (default: %(default)s)")
    parser.add_argument("--perimeter", type=int, help="sum of the lengths of each linkage (default: 400)")
    parser.add_argument("--smallest", type=int, help="length of the smallest crank (default: 2)")
    orders = "increasing (default), crank_shortest or full_crank"
    parser.add_argument("--order", help=f"orders of the four lengths that are enumerated: {orders}")
    parser.add_argument("--samples", type=int, help="number of samples of a curve, a power of two (default: 256)")
    _add_workers(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_build)


def _add_workers(parser: argparse.ArgumentParser) -> None:
    cores = os.cpu_count() or 1
    parser.add_argument(
        "--jobs", type=whole_number(1), default=cores, help="number of processes (default: one per core)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster at this address")


def _build(options: argparse.Namespace) -> Exit:
    from linkage_atlas.atlases import build_atlas, shown_progress

    begin, names = time.perf_counter(), ("perimeter", "smallest", "order", "samples", "jobs", "scheduler")
    try:
        with shown_progress() as progress:
            rule = {name: getattr(options, name) for name in names}
            atlas = build_atlas(options.out, **rule, progress=progress)
    except OSError as error:
        print(f"cannot write: {error}", file=sys.stderr)
        return Exit.FAILED
    return _print_atlas(options, options.out, atlas, seconds=round(time.perf_counter() - begin, 2))


def _add_description(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = _COMMANDS[name][0]
    add_file(parser, "file", metavar="file")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_describe, verifies=name == "verify")


def _describe(options: argparse.Namespace) -> Exit:
    from linkage_atlas import load_atlas

    atlas = load_atlas(options.file)
    if options.verifies:
        atlas.check()
    return _print_atlas(options, options.file, atlas, **({"status": "sound"} if options.verifies else {}))


def _print_atlas(options: argparse.Namespace, file: Path, atlas: Any, **facts: Any) -> Exit:
    """Print a description of an atlas and its file, as JSON or as lines."""
    values = {"file": str(file), "bytes": file.stat().st_size, **atlas.describe(), **facts}
    if options.json:
        print(json.dumps(values))
        return Exit.OK
    for name, value in values.items():
        text = ", ".join(f"{key} {part}" for key, part in value.items()) if isinstance(value, dict) else value
        print(f"{name:<16} {text:,}" if isinstance(text, int) else f"{name:<16} {text}")
    return Exit.OK


def _add_serve(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = "Serve the page and all queries over HTTP."
    group = parser.add_mutually_exclusive_group()
    add_atlas(group)
    group.add_argument(
        "--no-atlas", action="store_true", help="start without an atlas; only queries that need an atlas are refused"
    )
    parser.add_argument("--host", default="127.0.0.1", help="address on which the service listens (%(default)s)")
    parser.add_argument("--port", type=whole_number(0, 65535), default=8000, help="port (%(default)s)")
    parser.add_argument(
        "--workers",
        type=whole_number(1, 64),
        metavar="N",
        help="number of processes that compute answers (default: number of cores, at least 2 and at most 4)",
    )
    parser.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> int:
    from app.resources import ServiceResources
    from app.server import serve
    from app.settings import atlas_of, settings_of

    settings = settings_of(options)
    changes: dict[str, Any] = {"workers": options.workers} if options.workers else {}
    if options.no_atlas:
        changes["with_atlas"] = False
    elif settings.with_atlas:
        changes["atlas"] = atlas_of(settings)  # builds the default atlas if it does not exist
    settings = settings.model_copy(update=changes)
    if settings.with_atlas:
        _ = ServiceResources(settings).atlas  # fail here, with an exit code
    serve(settings, options.host, options.port)
    return Exit.OK


_COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser, str], None]]] = {
    "synthesize": (QUESTIONS["synthesize"], _add_questions),
    "export": ("Export a linkage for CAD, 3D printing, simulation or a workshop.", _add_writer),
    "report": ("Write a page about a solution, to print or pass on.", _add_writer),
    "drive": (QUESTIONS["drive"], _add_questions),
    "assembly": (QUESTIONS["assembly"], _add_questions),
    "function": (QUESTIONS["function"], _add_questions),
    "match": (QUESTIONS["match"], _add_questions),
    "motion": (QUESTIONS["motion"], _add_questions),
    **{scene: (f"Compute the {scene}.", _add_questions) for scene in SCENES},
    "study": ("Answer a file of requests.", _add_study),
    "example": ("Print an example request, or list the examples.", _add_example),
    "serve": ("Serve the page and all queries over HTTP.", _add_serve),
    "completion": ("Print or install a completion script for a shell.", _add_completion),
    "build": ("Build an atlas file.", _add_build),
    "verify": ("Check all contents of an atlas file.", _add_description),
    "info": ("Describe an atlas file.", _add_description),
}
"""Help of each command, and the function that adds its arguments."""
