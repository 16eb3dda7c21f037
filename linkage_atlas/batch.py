"""Studies: many requests answered in order on processes or a Dask cluster, with a line for each answer."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, Future
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from data_build.batch import dask_executor, local_executor
from linkage_atlas.arguments import Fields
from synthesis.errors import FieldError

AHEAD = 64
"""Requests per process that are computed, or wait for an earlier answer, at the same time."""
CLUSTER_JOBS = 64
"""Processes of a cluster for which requests are submitted ahead."""
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


def key_of(text: bytes, *depends: str) -> str:
    """Return the digest of a request, this version and whatever else its answer depends on."""
    return hashlib.sha256(json.dumps([version("linkage-atlas"), *depends]).encode() + b"\n" + text).hexdigest()[:16]


def answer_line(question: Question, reply: Fields | None = None, error: str | None = None) -> bytes:
    """Return the line with an answer: the reply without times, or the error."""
    row: dict[str, object] = {"line": question.line, "key": question.key}
    row |= {"reply": without_times(reply or {})} if error is None else {"error": " ".join(error.split())}
    return json.dumps(row).encode()


def without_times(reply: Fields) -> Fields:
    """Return a reply without the fields that differ from run to run."""
    report = reply.get("report")
    if not isinstance(report, Mapping):
        return reply
    return {**reply, "report": {name: value for name, value in report.items() if name not in TIMES}}


def answers(
    work: Callable[[Question], bytes],
    questions: Iterable[Question],
    out: Path | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Iterator[bytes]:
    """Yield the lines with the answers to all questions, in order.

    Complete lines that are in the file ``out`` already are not computed again; new lines are appended. The lines are the same
    for any number of processes. Raises `FieldError` if the file holds anything else.
    """
    remaining = iter(questions)
    if out is not None and out.exists():
        yield from _continued(out, remaining)
    first = next(remaining, None)
    if first is None:
        return
    jobs = jobs or os.cpu_count() or 1
    executor = dask_executor(scheduler) if scheduler else local_executor(jobs)
    ahead = AHEAD * (CLUSTER_JOBS if scheduler else jobs)
    with executor as pool, open(out, "ab") if out else contextlib.nullcontext() as file:
        for line in _in_order(pool, work, chain([first], remaining), ahead):
            if file is not None:
                file.write(line + b"\n")
                file.flush()
            yield line


def _in_order(
    pool: Executor, work: Callable[[Question], bytes], questions: Iterable[Question], ahead: int
) -> Iterator[bytes]:
    """Map questions over a pool without submitting all of them at once."""
    submitted: deque[Future[bytes]] = deque()
    try:
        for question in questions:
            submitted.append(pool.submit(work, question))
            if len(submitted) >= ahead:
                yield submitted.popleft().result()
        while submitted:
            yield submitted.popleft().result()
    finally:
        for future in submitted:
            future.cancel()


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
            _check(line, next(questions, None), out)
            complete += len(line)
            yield line[:-1]
    os.truncate(out, complete)


def _check(line: bytes, question: Question | None, out: Path) -> None:
    try:
        found = json.loads(line)
    except ValueError:
        found = None
    if question is None or not isinstance(found, dict) or found.get("line") != question.line:
        problem = "contains lines that are not replies to these requests"
    elif found.get("key") != question.key:
        problem = f"has a reply to another request in line {question.line}, or comes from another version or command"
    else:
        return
    raise FieldError("/out", f"{out} {problem}: name another file, or remove this one")


# -- from Python ------------------------------------------------------------------------------------------------------


def study(
    requests: Iterable[Fields],
    out: str | Path | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Iterator[dict[str, object]]:
    """Answer many requests in order.

    Parameters
    ----------
    requests : iterable of mappings
        Arguments of `synthesize`, as numbers, lists and arrays (without ``atlas`` and ``work``). Without a ``budget`` an answer
        does not depend on the machine's speed.
    out : str or Path, optional
        File to which each answer is appended as a line of JSON. If it exists, the study continues after its last complete line.
        Two studies must not write it at the same time.
    jobs : int, optional
        Number of processes; default: the number of cores. Several processes need a script that can be imported.
    scheduler : str, optional
        Address of a Dask cluster to run on; needs the extra ``[distributed]`` here and this package on its workers.
    progress : callable
        ``progress(done, total)`` after each answer.

    Yields
    ------
    dict
        ``line``, the number of the request from 1; ``key``, a digest of the request and the version; and ``reply``, the
        `Result.to_dict` of `synthesize` without times, or ``error``, the error message.

    Raises
    ------
    FieldError
        If a request cannot be written as JSON, or the file holds something else.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> motion = {"rotation": [0, 12, 27, 45], "crank_span": 60, "top": 1}
    >>> requests = [motion | {"limits": {"transmission_angle_min": angle}} for angle in (30, 40)]
    >>> [row["reply"]["status"] for row in la.study(requests, jobs=1)]
    ['reached', 'reached']
    """
    questions = [_question(number, arguments) for number, arguments in enumerate(requests, 1)]
    lines = answers(_answer, questions, None if out is None else Path(out), jobs=jobs, scheduler=scheduler)
    for done, line in enumerate(lines, 1):
        progress(done, len(questions))
        yield json.loads(line)


def _question(number: int, arguments: Fields) -> Question:
    try:
        text = json.dumps(dict(arguments), default=_plain, sort_keys=True).encode()
    except (TypeError, ValueError) as error:
        raise FieldError(f"/requests/{number - 1}", f"must hold numbers, lists and words: {error}") from None
    return Question(number, text, key_of(text, "synthesize"))


def _plain(value: object) -> object:
    """Return an array or a number of numpy's as JSON has it; complex points as pairs."""
    if isinstance(value, Mapping):
        return dict(value)
    if not isinstance(value, (np.ndarray, np.generic)):
        raise TypeError(f"found {type(value).__name__}")
    if value.dtype.kind == "c":
        return [[point.real, point.imag] for point in value.ravel().tolist()]
    return value.tolist()


def _answer(question: Question) -> bytes:
    """Return the line that answers a question of `study`."""
    from threadpoolctl import threadpool_limits

    from linkage_atlas.pipeline import synthesize

    try:
        with threadpool_limits(1, "blas"):  # the processes would only wait for each other's threads
            return answer_line(question, synthesize(**json.loads(question.text)).to_dict())
    except (FieldError, TypeError) as error:  # a TypeError names an argument that does not exist
        return answer_line(question, error=str(error))
