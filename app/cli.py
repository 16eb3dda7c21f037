"""The command: questions as the service answers them, the batch job, examples, and the service itself."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence

import shtab
from pydantic import ValidationError

from app import bundled
from app.arguments import add_atlas, whole_number
from app.asking import add_query, settings_of
from app.cache import find_atlas, open_atlas
from app.exits import EPILOG, Exit
from app.registry import all_queries
from app.resources import ServiceResources
from app.study import add_study
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
  linkage-atlas serve                             the page, at http://127.0.0.1:8000
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code, as `app.exits` lists them."""
    argv = sys.argv[1:] if argv is None else argv
    if argv and argv[0] in BATCH_COMMANDS:
        return run_batch(argv)
    parser = make_parser(named=argv[0] if argv else None)
    if not argv:
        parser.print_help(sys.stderr)
        return Exit.USAGE
    options = parser.parse_args(list(argv))
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return Exit.INTERRUPTED
    except BrokenPipeError:  # the reader, say `head`, has enough; at exit nothing more may be flushed into the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return Exit.OK
    except ValidationError as error:
        for row in error.errors(include_input=False, include_url=False):
            print(f"{'.'.join(map(str, row['loc'])) or 'request'}: {row['msg']}", file=sys.stderr)
        return Exit.USAGE
    except (FieldError, OSError) as error:
        print(error, file=sys.stderr)
        return Exit.USAGE
    except AtlasError as error:
        print(error, file=sys.stderr)
        if error.fault is not AtlasFault.MISSING:
            return Exit.DAMAGED
        print("`linkage-atlas build --out FILE` makes one; `--atlas FILE` says where it is", file=sys.stderr)
        return Exit.USAGE


def make_parser(whole: bool = False, named: str | None = None) -> argparse.ArgumentParser:
    """The parser of all commands; of one alone, where that is ``named`` and is no query: the others take a while to load.

    The batch's options are in it only where it is to be ``whole``.
    """
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="linkage-atlas", description=DESCRIPTION, epilog=EPILOG, formatter_class=plain
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    if named in _ALONE:
        help_text, add = _ALONE[named]
        add(commands.add_parser(named, help=help_text))
        return parser
    groups: dict[str, argparse._SubParsersAction] = {}
    for query in sorted(all_queries(), key=lambda query: query.reads_atlas and query.file_of is None):
        *group, verb = query.command.split()
        at = commands
        if group:
            if group[0] not in groups:
                scene = commands.add_parser(group[0], help=f"the {group[0]} scene")
                groups[group[0]] = scene.add_subparsers(metavar="COMMAND", required=True)
            at = groups[group[0]]
        add_query(at.add_parser(verb, help=query.summary, description=query.summary), query)
    add_study(commands.add_parser("study", help="answer many requests, a line each"))
    _add_example(commands.add_parser("example", help="print a request to edit, or the list of examples"))
    for name, (text, add) in _ALONE.items():
        add(commands.add_parser(name, help=text))
    if whole:
        add_batch_commands(commands)
    else:
        for name, text in BATCH_COMMANDS.items():
            commands.add_parser(name, help=text)
    completion = commands.add_parser("completion", help="print what completes this command in a shell")
    completion.description = (
        "Prints a script that completes commands and options; what to do with it stands at its top."
    )
    completion.add_argument("shell", choices=("bash", "zsh", "fish"))
    completion.set_defaults(run=_completion)
    return parser


def _completion(options: argparse.Namespace) -> int:
    print(shtab.complete(make_parser(whole=True), options.shell))
    return Exit.OK


def _add_example(parser: argparse.ArgumentParser) -> None:
    parser.description = "Prints a bundled request as JSON, to be edited and answered; without a name, all names."
    parser.add_argument("name", nargs="?", choices=tuple(bundled.all_examples()), metavar="NAME")
    parser.set_defaults(run=_example)


def _example(options: argparse.Namespace) -> int:
    if options.name is None:
        print(bundled.listed())
        return Exit.OK
    example = bundled.all_examples()[options.name]
    print(bundled.pretty(example.request))
    print(f"answered by: linkage-atlas {example.command} FILE", file=sys.stderr)
    return Exit.OK


def _add_index(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Prepares an atlas for scanning, in files beside it (or in the cache folder), which later starts and other "
        "processes map. Starting without them makes them, too."
    )
    add_atlas(parser)
    parser.set_defaults(run=_index)


def _index(options: argparse.Namespace) -> int:
    settings = settings_of(options).model_copy(update={"index": True})
    atlas = open_atlas(find_atlas(settings), settings)
    atlas.prepare(positions=settings.prepare_positions)
    for path in atlas.index_files:
        print(f"{path}: {path.stat().st_size:,} bytes")
    return Exit.OK if atlas.index_files else Exit.FAILED


def _add_serve(parser: argparse.ArgumentParser) -> None:
    parser.description = "Serves the queries over HTTP, and the page."
    group = parser.add_mutually_exclusive_group()
    add_atlas(group)
    group.add_argument(
        "--no-atlas", action="store_true", help="start at once: searching needs none, what needs one says so"
    )
    parser.add_argument("--no-index", action="store_true", help="prepare the scan in memory, at every start")
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
    from app.server import serve

    settings = settings_of(options)
    if options.no_atlas:
        settings = settings.model_copy(update={"with_atlas": False})
    if options.no_index:
        settings = settings.model_copy(update={"index": False})
    resources = ServiceResources(settings, find_atlas)
    if settings.with_atlas:
        _ = resources.atlas  # fail here, with an exit code
    return serve(resources, options.host, options.port, options.workers)


_ALONE: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None]]] = {
    "serve": ("answer over HTTP, with a page to draw motions on", _add_serve),
    "index": ("prepare an atlas for scanning, so that later starts take no time", _add_index),
}
"""Commands that need none of the questions, by name: their help and what adds their arguments."""
