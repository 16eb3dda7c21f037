"""Studies on the command line: a file with a request on each line is answered into a file of replies."""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from app.query import Query, json_of
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import atlas_of, settings_of
from app.sources import Setting, Target, parsed, read_source
from app.terminal import Exit
from linkage_atlas import AtlasError, FieldError
from linkage_atlas.atlases import executor
from linkage_atlas.notes import counted

DESCRIPTION = """Answer a file of requests, a line of JSON each, in order.

Each line of the result has the line number of the request, and its reply (as --json prints it, without times) or an
error message. An interrupted study continues with the same command; only one process may write a file at a time. A
request without budget_ms has the same reply on every run, because its search has no time limit.
"""
HEAD = b'{"line": '
"""Beginning of each line of answers."""
TIMES = ("elapsed_ms", "trace")
"""Fields of a report that differ from run to run."""


class Question(NamedTuple):
    """A request of a study."""

    line: int
    """Number of its line, from 1."""
    text: bytes
    key: str
    """Digest of the text and of everything else that its answer depends on."""


def run_study(options: argparse.Namespace) -> int:
    """Answer the requests of a file that have no answer yet."""
    limits = options.no_preset and "limits" in _query(options.command).request.model_fields
    settings: list[Setting] = [(["limits", "preset"], "none")] if limits else []
    atlas = None if options.atlas is None else str(options.atlas.resolve())
    depends = (options.command, f"preset {not options.no_preset}", f"atlas {atlas}")
    if options.out.exists() and options.out.samefile(options.requests):
        raise FieldError("/out", "must not be the file of the requests")
    questions, errors = _questions(options.requests, depends), []
    lines = answers(
        partial(answer, options.command, settings, atlas), questions, options.out, options.jobs, options.scheduler
    )
    try:
        for line in tqdm(lines, total=len(questions), disable=None, unit="request", desc="study", file=sys.stderr):
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
    answered = f"{counted(len(questions), 'request')}, {len(questions) - len(errors):,} answered{refused}"
    print(f"wrote {options.out}: {answered}", file=sys.stderr)
    return Exit.FAILED if errors else Exit.OK


def _questions(path: Path, depends: Sequence[str]) -> list[Question]:
    """Return the lines of a file that are not empty."""
    head = json.dumps([version("linkage-atlas"), *depends]).encode()
    lines = ((number, line.strip()) for number, line in enumerate(path.read_bytes().split(b"\n"), 1))
    return [
        Question(number, text, hashlib.sha256(head + b"\n" + text).hexdigest()[:16]) for number, text in lines if text
    ]


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


# -- the file of answers ----------------------------------------------------------------------------------------------


def answer_line(question: Question, reply: Mapping[str, Any] | None = None, error: str | None = None) -> bytes:
    """Return the line with an answer: the reply without times, or the error."""
    row: dict[str, object] = {"line": question.line, "key": question.key}
    row |= {"reply": without_times(reply or {})} if error is None else {"error": " ".join(error.split())}
    return json.dumps(row).encode()


def without_times(reply: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a reply without the fields that differ from run to run."""
    report = reply.get("report")
    if not isinstance(report, Mapping):
        return reply
    return {**reply, "report": {name: value for name, value in report.items() if name not in TIMES}}


def answers(
    work: Callable[[Question], bytes],
    questions: Sequence[Question],
    out: Path,
    jobs: int,
    scheduler: str | None = None,
) -> Iterator[bytes]:
    """Yield the lines with the answers to all questions, in order.

    Complete lines that are in the file ``out`` already are not computed again; new lines are appended. The lines are the same
    for any number of processes. Raises `FieldError` if the file holds anything else.
    """
    remaining = iter(questions)
    if out.exists():
        yield from _continued(out, remaining)
    with executor(jobs, scheduler) as pool, out.open("ab") as file:
        for line in pool.map(work, list(remaining)):
            file.write(line + b"\n")
            file.flush()
            yield line


def _continued(out: Path, questions: Iterator[Question]) -> Iterator[bytes]:
    """Yield the complete lines of a file of answers, and cut off an incomplete line."""
    if not out.is_file():
        raise FieldError("/out", f"{out} is not a regular file")
    complete = 0
    with out.open("rb") as file:
        for line in file:
            if not line.endswith(b"\n"):
                if not (line.startswith(HEAD) or HEAD.startswith(line) or not line.strip(b"\0")):
                    raise FieldError("/out", f"{out} contains no replies: name another file, or delete this one")
                break
            question, problem = next(questions, None), "contains lines that are not replies to these requests"
            start = HEAD + b'%d, "key": "' % (question.line if question else 0)
            if question and line.startswith(start):
                where = f"line {question.line}, or comes from another version or command"
                problem = f"has a reply to another request in {where}"
            if not question or not line.startswith(start + question.key.encode()):
                raise FieldError("/out", f"{out} {problem}: name another file, or remove this one")
            complete += len(line)
            yield line[:-1]
    os.truncate(out, complete)
