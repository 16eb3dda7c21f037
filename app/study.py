"""Studies on the command line: a file with a request on each line is answered into a file of replies."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from functools import cache, partial
from pathlib import Path

from tqdm import tqdm

from app.query import Query, json_of
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import atlas_of, settings_of
from app.sources import Setting, Target, parsed, read_source
from app.terminal import Exit
from linkage_atlas import AtlasError, FieldError
from linkage_atlas.batch import Question, answer_line, answers, key_of
from linkage_atlas.notes import counted

DESCRIPTION = """Answer a file of requests, a line of JSON each, in order.

Each line of the result has the line number of the request, and its reply (as --json prints it, without times) or an
error message. An interrupted study continues with the same command; only one process may write a file at a time. A
request without budget_ms has the same reply on every run, because its search has no time limit.
"""


def run_study(options: argparse.Namespace) -> int:
    """Answer the requests of a file that have no answer yet."""
    limits = options.no_preset and "limits" in _query(options.command).request.model_fields
    settings: list[Setting] = [(["limits", "preset"], "none")] if limits else []
    atlas = None if options.atlas is None else str(options.atlas.resolve())
    depends = (options.command, f"preset {not options.no_preset}", f"atlas {atlas}")
    if options.out.exists() and options.out.samefile(options.requests):
        raise FieldError("/out", "must not be the file of the requests")
    total, errors = sum(1 for _ in _questions(options.requests, depends)), []
    lines = answers(
        partial(answer, options.command, settings, atlas),
        _questions(options.requests, depends),
        options.out,
        jobs=options.jobs,
        scheduler=options.scheduler,
    )
    try:
        for line in tqdm(lines, total=total, disable=None, unit="request", desc="study", file=sys.stderr):
            if '"error"' in str(line[:80]) and "error" in (row := json.loads(line)):
                errors.append(f"line {row['line']}: {row['error']}")
    except KeyboardInterrupt:
        print("interrupted; run the same command again to continue", file=sys.stderr)
        return Exit.INTERRUPTED
    except (OSError, BrokenExecutor) as error:
        what = "a worker process ended" if isinstance(error, BrokenExecutor) else "cannot write"
        print(f"{what}: {error}; run the same command again to continue", file=sys.stderr)
        return Exit.FAILED
    refused = f", {len(errors):,} refused; the first: {errors[0]}" if errors else ""
    answered = f"{counted(total, 'request')}, {total - len(errors):,} answered{refused}"
    print(f"wrote {options.out}: {answered}", file=sys.stderr)
    return Exit.FAILED if errors else Exit.OK


def _questions(path: Path, depends: Sequence[str]) -> Iterator[Question]:
    """Yield the lines of a file that are not empty."""
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if text := line.strip():
                yield Question(number, text, key_of(text, *depends))


@cache
def _query(command: str) -> Query:
    return next(query for query in all_queries() if query.command == command)


@cache
def _resources(atlas: str | None) -> ServiceResources:
    """Return the resources of this process, without a time limit, so that replies do not depend on the machine."""
    settings = settings_of(argparse.Namespace(atlas=atlas))
    return ServiceResources(settings.model_copy(update={"max_budget_ms": math.inf}), atlas_of)


def answer(command: str, settings: Sequence[Setting], atlas: str | None, question: Question) -> bytes:
    """Return the line that answers a question: the reply that the command prints for this request with ``--json``."""
    query, resources = _query(command), _resources(atlas)
    try:
        if len(question.text) > resources.settings.max_body_bytes:
            raise FieldError("", f"the line is longer than {resources.settings.max_body_bytes:,} bytes")
        parsed(question.text)  # a line must be JSON, not a table
        request = read_source(Target.of(query), question.text, settings).request
        return answer_line(question, json.loads(json_of(query.answer(request, resources))))
    except FieldError as error:
        return answer_line(question, error=str(error).partition("\n")[0] if error.field else error.message)
    except AtlasError:
        raise  # concerns all requests
    except Exception as error:  # a faulty request must not end the study
        return answer_line(question, error=f"a fault of the program: {type(error).__name__}: {error}")
