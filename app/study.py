"""Studies on the command line: a file of requests, a line each, into a file of replies that can be gone on with."""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from app.command import NO_PRESET, read_request
from app.query import Query, json_of, plain_of
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import atlas_of, settings_of
from app.terminal import EPILOG, FILE, Exit, whole_number
from linkage_atlas import AtlasError, FieldError
from linkage_atlas.many_requests import (
    Question,
    StudyLocked,
    answer_of,
    is_error,
    key_of,
    places_of,
    study_lines,
    without_times,
)

DESCRIPTION = """Answers many requests, a line of JSON each, in order.

Each line of the result bears the number of the request's line and its reply as --json prints it, without times,
or one line of what is wrong with it. Killed or interrupted, the same command goes on: no line is lost or
doubled. A request without budget_ms has the same reply on every run; no time limits its search.
"""


def add_study(parser: argparse.ArgumentParser) -> None:
    parser.description, parser.epilog = DESCRIPTION, EPILOG
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "requests", type=Path, help="requests, a line of JSON each; empty lines do not count"
    ).complete = (  # type: ignore[attr-defined]
        FILE
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="the results; a study that was cut off goes on here"
    ).complete = FILE  # type: ignore[attr-defined]
    parser.add_argument(
        "--command",
        choices=[query.command for query in all_queries()],
        default="synthesize",
        help="the question that all requests are of (%(default)s)",
    )
    parser.add_argument(
        "--jobs", type=whole_number(1), default=os.cpu_count() or 1, help="processes (default: one a core)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster at this address instead")
    parser.add_argument("--no-preset", action="store_true", help="no limits but those of each request")
    parser.add_argument("--atlas", type=Path, metavar="FILE", help="the atlas, for questions that need one")
    parser.set_defaults(run=run_study)


def run_study(options: argparse.Namespace) -> int:
    place = None if options.atlas is None else str(options.atlas.resolve())
    also = NO_PRESET if options.no_preset and "limits" in _query(options.command).request.model_fields else ()
    work = partial(answer_line, options.command, also, place)
    depends = (options.command, f"preset {not options.no_preset}", f"atlas {place}")
    if options.out.exists() and options.out.samefile(options.requests):
        raise FieldError("/out", "the results cannot be the file of the requests")
    total = sum(1 for _ in _questions(options.requests, depends))
    executor, places = places_of(options.jobs, options.scheduler)
    asked_to_stop = threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):  # a flag: raised within a callback an exception would be lost
        if signal.getsignal(name) is not signal.SIG_IGN:
            signal.signal(name, lambda *_: asked_to_stop.set())
    refused, first = 0, ""
    lines = study_lines(
        work,
        lambda: _questions(options.requests, depends),
        total,
        options.out,
        executor,
        places,
        asked_to_stop.is_set,
    )
    try:
        with tqdm(total=total, disable=None, unit="request", desc="study", file=sys.stderr) as bar:
            for line, was_there in lines:
                if is_error(line):
                    refused += 1
                    error = json.loads(line)
                    first = first or f"line {error['line']}: {error['error']}"
                if was_there and not bar.disable:
                    bar.initial += 1  # so that the time left is told from what is done now
                bar.update()
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return Exit.INTERRUPTED
    except OSError as error:
        print(f"cannot write: {error}; the same command goes on from here", file=sys.stderr)
        return Exit.FAILED
    except StudyLocked as error:
        raise FieldError("/out", str(error)) from None
    except BrokenExecutor as error:
        print(f"a worker process ended: {error}; the same command goes on from here", file=sys.stderr)
        return Exit.FAILED
    rest = f", {refused:,} refused; the first: {first}" if refused else ""
    print(f"wrote {options.out}: {total:,} requests, {total - refused:,} answered{rest}", file=sys.stderr)
    return Exit.FAILED if refused else Exit.OK


def _questions(path: Path, depends: tuple[str, ...]) -> Iterator[Question]:
    """The lines of a file that are not empty."""
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if text := line.strip():
                yield Question(number, text, key_of(text, *depends))


@cache
def _query(command: str) -> Query:
    query = next(query for query in all_queries() if query.command == command)
    return replace(query, from_csv=None)  # a line is JSON


@cache
def _resources(atlas: str | None) -> ServiceResources:
    """What all answers of this process share. No time limits them: a reply must not depend on the machine's speed."""
    settings = settings_of(argparse.Namespace(atlas=atlas))
    return ServiceResources(settings.model_copy(update={"max_budget_ms": math.inf}), atlas_of)


def answer_line(command: str, also: Sequence[tuple[list[str], Any]], atlas: str | None, question: Question) -> bytes:
    """The line that answers a question: what the command prints for that request alone with ``--json``, without times."""
    query, resources = _query(command), _resources(atlas)
    try:
        if len(question.text) > resources.settings.max_body_bytes:
            raise FieldError("", f"longer than {resources.settings.max_body_bytes:,} bytes")
        reply = query.answer(read_request(query, question.text, also), resources)
    except FieldError as error:
        return answer_of(question, error=str(error).partition("\n")[0])
    except AtlasError:
        raise  # of all requests, not of this one
    except Exception as error:  # one request must not end the study of all others
        return answer_of(question, error=f"a fault of the program: {type(error).__name__}: {error}")
    return answer_of(question, json_of(without_times(plain_of(reply))))
