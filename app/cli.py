"""The service's questions on the command line: the same requests, from a JSON file or standard input."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from app.queries import all_queries
from app.query import Query
from app.resources import ServiceResources
from app.settings import Settings
from synthesis.errors import AtlasError, FieldError

EXIT_OK, EXIT_USAGE, EXIT_DAMAGED, EXIT_INTERRUPTED = 0, 2, 3, 130


def main(argv: Sequence[str]) -> int:
    """Run one query command; returns the exit code (0 ok, 2 bad request, 3 damaged data, 130 interrupted)."""
    parser = _parser()
    options = parser.parse_args(list(argv))
    try:
        return options.run(options)
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except ValidationError as error:
        for row in error.errors(include_input=False, include_url=False):
            print(f"{'.'.join(map(str, row['loc'])) or 'request'}: {row['msg']}", file=sys.stderr)
        return EXIT_USAGE
    except (FieldError, OSError) as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except AtlasError as error:
        print(error, file=sys.stderr)
        return EXIT_DAMAGED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="linkage-atlas", description="Finds planar linkages for a required motion.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
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
    serve.add_argument("--port", type=int, default=8000, help="(%(default)s)")
    serve.set_defaults(run=_serve)
    return parser


def _serve(options: argparse.Namespace) -> int:
    import uvicorn

    from app.main import create_app

    resources = ServiceResources(_settings(options))
    _ = resources.atlas  # a service without its atlas is no service: fail here, with an exit code
    uvicorn.run(create_app(resources=resources), host=options.host, port=options.port, log_level="info")
    return EXIT_OK


def _add_query(parser: argparse.ArgumentParser, query: Query) -> None:
    parser.add_argument("file", nargs="?", default="-", help="the request as JSON (default: standard input)")
    parser.add_argument("--example", choices=sorted(query.examples), help="answer a bundled example instead")
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
    if options.example:
        text = json.dumps(query.examples[options.example]).encode()
    elif options.file == "-":
        text = sys.stdin.buffer.read()
    else:
        text = Path(options.file).read_bytes()
    request = query.request.model_validate_json(text)
    resources = ServiceResources(_settings(options))
    if query.exports and options.export:
        name = options.export.suffix.lstrip(".").lower()
        if name not in query.exports:
            raise FieldError("/export", f"the file must end in one of {', '.join(query.exports)}, found '{name}'")
        options.export.write_bytes(query.exports[name].render(request, resources))
        return EXIT_OK
    reply = query.answer(request, resources)
    print(reply.model_dump_json(indent=2) if options.json else query.table(reply))
    return EXIT_OK
