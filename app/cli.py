"""The service's questions on the command line: the same requests, from a JSON file or standard input."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from app.query import Query
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings
from linkage_atlas import BATCH_COMMANDS, AtlasError, AtlasFault, FieldError, __version__, run_batch

EXIT_OK, EXIT_USAGE, EXIT_DAMAGED, EXIT_INTERRUPTED = 0, 2, 3, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (0 ok, 1 failed, 2 bad request, 3 damaged data, 130 interrupted)."""
    argv = sys.argv[1:] if argv is None else argv
    if argv and argv[0] in BATCH_COMMANDS:
        return run_batch(argv)
    parser = make_parser()
    if not argv:
        parser.print_help(sys.stderr)
        return EXIT_USAGE
    options = parser.parse_args(list(argv))
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader, say `head`, has enough; at exit nothing more may be flushed into the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except ValidationError as error:
        for row in error.errors(include_input=False, include_url=False):
            print(f"{'.'.join(map(str, row['loc'])) or 'request'}: {row['msg']}", file=sys.stderr)
        return EXIT_USAGE
    except (FieldError, OSError) as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except AtlasError as error:
        print(error, file=sys.stderr)
        if error.fault is not AtlasFault.MISSING:
            return EXIT_DAMAGED
        print("`linkage-atlas build --out FILE` makes one; `--atlas FILE` says where it is", file=sys.stderr)
        return EXIT_USAGE


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(prog="linkage-atlas", description="Finds planar linkages for a required motion.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for name, text in BATCH_COMMANDS.items():
        commands.add_parser(name, help=text)
    groups: dict[str, argparse._SubParsersAction] = {}
    for query in all_queries():
        *group, verb = query.command.split()
        at = commands
        if group:
            if group[0] not in groups:
                scene = commands.add_parser(group[0], help=f"the {group[0]} scene")
                groups[group[0]] = scene.add_subparsers(metavar="COMMAND", required=True)
            at = groups[group[0]]
        _add_query(at.add_parser(verb, help=query.summary, description=query.summary), query)
    serve = commands.add_parser("serve", help="answer over HTTP", description="Serves the queries over HTTP.")
    serve.add_argument("--atlas", type=Path, help="the atlas file (default: atlas.h5)")
    serve.add_argument("--host", default="127.0.0.1", help="(%(default)s)")
    serve.add_argument("--port", type=_port, default=8000, help="(%(default)s)")
    serve.set_defaults(run=_serve)
    return parser


def _port(text: str) -> int:
    port = int(text)
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f"must be 0 to 65535, found {port}")
    return port


def _serve(options: argparse.Namespace) -> int:
    from app.server import serve

    resources = ServiceResources(_settings(options))
    _ = resources.atlas  # `serve` needs its atlas: fail here, with an exit code
    serve(resources, options.host, options.port)
    return EXIT_OK


_FILE_HELP = (
    "the request as JSON (default: standard input)",
    "the request as JSON, or the motion as a .csv file (default: standard input)",
)


def _add_query(parser: argparse.ArgumentParser, query: Query) -> None:
    parser.add_argument("file", nargs="?", default="-", help=_FILE_HELP[query.from_csv is not None])
    parser.add_argument("--example", choices=sorted(query.examples), help="answer a bundled example instead")
    if query.practical is not None:
        parser.add_argument(
            "--no-preset",
            action="store_true",
            help="keep to no limits but those of the request; otherwise to the practical ones (limits.preset) too",
        )
    parser.add_argument("--json", action="store_true", help="print the reply as JSON, not as a table")
    parser.add_argument("--atlas", type=Path, help="the atlas file, for queries that read it (default: atlas.h5)")
    if query.exports:
        formats = ", ".join(query.exports)
        parser.add_argument(
            "--export",
            type=Path,
            metavar="FILE",
            help=f"write a file instead; its ending says which: {formats}",
        )
    parser.set_defaults(run=lambda options: _run_query(options, query))


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(atlas=options.atlas) if options.atlas else Settings()


def _run_query(options: argparse.Namespace, query: Query) -> int:
    if options.example and options.file != "-":
        raise FieldError("", "give a file or --example, not both")
    if options.example:
        text = json.dumps(query.examples[options.example]).encode()
    elif options.file == "-":
        if sys.stdin.isatty():
            print("reading the request from this terminal; Ctrl-D ends it", file=sys.stderr)
        text = sys.stdin.buffer.read()
    else:
        text = Path(options.file).read_bytes()
    if query.from_csv and options.file.lower().endswith(".csv"):
        request = query.request.model_validate(query.from_csv(text.decode("utf-8", "replace")))
    else:
        request = query.request.model_validate_json(text)
    if query.practical is not None and not (options.example or options.no_preset):
        request = query.practical(request)
    resources = ServiceResources(_settings(options))
    if query.exports and options.export:
        # of two that fit the longer: plates.dxf before dxf
        fits = [name for name in query.exports if options.export.name.lower().endswith(f".{name}")]
        name = max(fits, key=len, default=options.export.suffix.lstrip("."))
        if name not in query.exports:
            raise FieldError("/export", f"the file must end in one of {', '.join(query.exports)}, found '{name}'")
        options.export.write_bytes(query.exports[name].render(request, resources))
        return EXIT_OK
    reply = query.answer(request, resources)
    print(reply.model_dump_json(indent=2) if options.json else query.table(reply))
    return EXIT_OK
