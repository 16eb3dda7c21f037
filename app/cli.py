"""The command: questions as the service answers them, the batch job, examples, and the service itself."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.fourbar import QUESTIONS
from app.registry import queries_named
from app.scenes import SCENES
from app.terminal import EPILOG, FILE, Exit, add_atlas, whole_number
from linkage_atlas import (
    BATCH_COMMANDS,
    AtlasError,
    AtlasFault,
    FieldError,
    __version__,
    add_batch_commands,
    run_batch,
)

DESCRIPTION = """Finds planar linkages for a required motion.

  linkage-atlas example casement > request.json   a request to edit
  linkage-atlas synthesize request.json           linkages for it
  linkage-atlas synthesize poses.csv --length-unit mm --export linkage.dxf
  linkage-atlas export request.json --format step its first solution for CAD
  linkage-atlas serve                             the page, at http://127.0.0.1:8000
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code, as `app.exits` lists them."""
    return run(parsed(sys.argv[1:] if argv is None else argv))


def parsed(argv: Sequence[str]) -> argparse.Namespace:
    """The arguments of a command, and as ``run`` what it does with them; imports what the command needs."""
    if argv and argv[0] in BATCH_COMMANDS:
        return argparse.Namespace(run=lambda _: run_batch(argv))
    parser = make_parser(named=next((word for word in argv if not word.startswith("-")), None))
    if not argv:
        return argparse.Namespace(run=lambda _: parser.print_help(sys.stderr) or Exit.USAGE)
    return parser.parse_args(list(argv))


def run(options: argparse.Namespace) -> int:
    """Run a command with its arguments; returns its exit code."""
    try:
        code: int = options.run(options)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return Exit.INTERRUPTED
    except BrokenPipeError:  # the reader, say `head`, has enough; at exit nothing more may be flushed into the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.OK
    except FieldError as error:
        print(error, file=sys.stderr)
        return Exit.USAGE
    except OSError as error:
        print(f"{error.filename}: {error.strerror}" if error.filename else error, file=sys.stderr)
        return Exit.USAGE
    except AtlasError as error:
        print(error, file=sys.stderr)
        if error.fault is not AtlasFault.MISSING:
            return Exit.DAMAGED
        print("`linkage-atlas build --out FILE` makes one; `--atlas FILE` says where it is", file=sys.stderr)
        return Exit.USAGE


class _Command(argparse.ArgumentParser):
    """Of one command: what it does not know it says itself, with its own usage."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return options, unknown


def make_parser(whole: bool = False, named: str | None = None) -> argparse.ArgumentParser:
    """The parser of a command that is ``named``, or the ``whole`` one; the arguments of the others are not loaded."""
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="linkage-atlas", description=DESCRIPTION, epilog=EPILOG, formatter_class=plain
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Command)
    for name, (text, add) in _COMMANDS.items():
        command = commands.add_parser(name, help=text)
        if whole or name == named:
            add(command, name)
    if whole:
        add_batch_commands(commands)
    else:
        for name, text in BATCH_COMMANDS.items():
            commands.add_parser(name, help=text)
    return parser


def _add_questions(parser: argparse.ArgumentParser, name: str) -> None:
    from app.command import add_query

    queries = queries_named(name)
    if queries[0].command == name:
        return add_query(parser, queries[0])
    verbs = parser.add_subparsers(metavar="COMMAND", required=True)
    for query in queries:
        add_query(verbs.add_parser(query.command.split()[1], help=query.summary), query)


def _add_export(parser: argparse.ArgumentParser, name: str) -> None:
    from app.command import add_export

    add_export(parser)


def _add_study(parser: argparse.ArgumentParser, name: str) -> None:
    from app.study import add_study

    add_study(parser)


def _add_completion(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = "Prints a script that completes commands and options; what to do with it stands at its top."
    parser.add_argument("shell", choices=("bash", "zsh", "fish"))
    parser.set_defaults(run=_completion)


def _completion(options: argparse.Namespace) -> int:
    import shtab

    FILE.update(shtab.FILE)
    print(shtab.complete(make_parser(whole=True), options.shell))
    return Exit.OK


def _add_example(parser: argparse.ArgumentParser, name: str) -> None:
    from app.registry import all_examples

    parser.description = "Prints a bundled request as JSON, to be edited and answered; without a name, all names."
    parser.add_argument("name", nargs="?", choices=tuple(all_examples()), metavar="NAME")
    parser.set_defaults(run=_example)


def _example(options: argparse.Namespace) -> int:
    from app.registry import all_examples
    from app.terminal import left_table

    if options.name is None:
        rows, before = [], ""
        for name, (by, _, about) in all_examples().items():
            if not name.startswith("synthesize-"):
                rows.append((name, by, '"' if about == before else about))
                before = about
        print(left_table(("name", "answered by", "what it is"), rows))
        return Exit.OK
    example = all_examples()[options.name]
    print(_pretty(example.request))
    print(f"answered by: linkage-atlas {example.command} FILE", file=sys.stderr)
    return Exit.OK


def _pretty(value: Any, indent: str = "") -> str:
    """JSON to edit: a field a line, but what holds only numbers, such as a pose, on one line."""
    inner = indent + "  "
    if isinstance(value, Mapping) and value:
        rows = [f"{inner}{json.dumps(name)}: {_pretty(one, inner)}" for name, one in value.items()]
        return "{\n" + ",\n".join(rows) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(one, (list, Mapping)) for one in value):
        return "[\n" + ",\n".join(inner + _pretty(one, inner) for one in value) + f"\n{indent}]"
    return json.dumps(value)


def _add_serve(parser: argparse.ArgumentParser, name: str) -> None:
    parser.description = "Serves the queries over HTTP, and the page."
    group = parser.add_mutually_exclusive_group()
    add_atlas(group)
    group.add_argument(
        "--no-atlas", action="store_true", help="start at once: searching needs none, what needs one says so"
    )
    parser.add_argument("--host", default="127.0.0.1", help="(%(default)s)")
    parser.add_argument("--port", type=whole_number(0, 65535), default=8000, help="(%(default)s)")
    parser.add_argument(
        "--workers",
        type=whole_number(1, 64),
        metavar="N",
        help="processes that compute, a request each at a time (default: one for each core, at least 2 and at most 4)",
    )
    parser.set_defaults(run=_serve)


def _serve(options: argparse.Namespace) -> int:
    from app.resources import ServiceResources
    from app.server import serve
    from app.settings import atlas_of, settings_of

    settings = settings_of(options)
    if options.no_atlas:
        settings = settings.model_copy(update={"with_atlas": False})
    resources = ServiceResources(settings, atlas_of)
    if settings.with_atlas:
        _ = resources.atlas  # fail here, with an exit code
    return serve(resources, options.host, options.port, options.workers)


_COMMANDS: dict[str, tuple[str, Callable[[argparse.ArgumentParser, str], None]]] = {
    "synthesize": (QUESTIONS["synthesize"], _add_questions),
    "function": (QUESTIONS["function"], _add_questions),
    "drive": (QUESTIONS["drive"], _add_questions),
    **{scene: (f"the {scene} scene", _add_questions) for scene in SCENES},
    "match": (QUESTIONS["match"], _add_questions),
    "assembly": (QUESTIONS["assembly"], _add_questions),
    "export": ("write a linkage as a file: for CAD, a printer, a simulator, a workshop", _add_export),
    "study": ("answer many requests, a line each", _add_study),
    "example": ("print a request to edit, or the list of examples", _add_example),
    "serve": ("answer over HTTP, with a page to draw motions on", _add_serve),
    "completion": ("print what completes this command in a shell", _add_completion),
}
"""Commands by name, but the batch's: their help, and what adds their arguments once they are called."""
