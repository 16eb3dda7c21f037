"""Studies: many requests answered in order, on processes or a cluster, and gone on with after a kill (`study`)."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from data_build.batch import dask_executor, local_executor
from data_build.lines import Question, StudyLocked, answer_of, is_error, study_lines
from synthesis.errors import FieldError

__all__ = [
    "Question",
    "StudyLocked",
    "answer_of",
    "is_error",
    "key_of",
    "places_of",
    "study",
    "study_lines",
    "without_times",
]

CLUSTER_PLACES = 64
"""Places of a cluster, for how far ahead it is asked; more of its processes are busy all the same."""


def study(
    requests: Iterable[Mapping[str, Any]],
    out: str | Path | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Iterator[dict[str, Any]]:
    """Answers to many requests, in their order.

    Parameters
    ----------
    requests : iterable of mappings
        Arguments of `synthesize` each, as numbers, lists and arrays (so without ``atlas`` and ``work``). Without a ``budget`` an
        answer does not depend on the machine's speed; with one it may.
    out : str or Path, optional
        A file to which each answer is appended as a line of JSON. If it is there already, a study that was cut off goes on: its
        answers are kept, whatever moment it was killed at, and none is lost or doubled.
    jobs : int, optional
        Processes; default: one a core. (More than one needs a script that can be imported, as all Python processes do.)
    scheduler : str, optional
        Address of a Dask cluster to run on instead; needs the extra ``[distributed]`` here and this package on its workers.
    progress : callable
        ``progress(done, total)`` after each answer.

    Yields
    ------
    dict
        ``line``, the request's number from 1; ``key``, a digest of the request and the version; and ``reply``, the
        `Result.to_dict` of `synthesize` without times, or ``error``, one line of what is wrong with the request. Law: each equals
        that of its request alone.

    Raises
    ------
    FieldError
        A request cannot be written as JSON, or the file holds something else.
    StudyLocked
        Another study writes the file.
    """
    questions = [_question(number, arguments) for number, arguments in enumerate(requests, 1)]
    executor, places = places_of(jobs, scheduler)
    place = None if out is None else Path(out)
    for done, (line, _) in enumerate(
        study_lines(_answer, lambda: iter(questions), len(questions), place, executor, places), 1
    ):
        progress(done, len(questions))
        yield json.loads(line)


def places_of(jobs: int | None, scheduler: str | None) -> tuple[AbstractContextManager[Any], int]:
    """Where a study runs, to be entered, and how many answers at the same time."""
    if scheduler is not None:
        return dask_executor(scheduler), CLUSTER_PLACES
    jobs = jobs or os.cpu_count() or 1
    return local_executor(jobs), jobs


def key_of(text: bytes, *depends: str) -> str:
    """The key of a question: a digest of its text, this version and whatever else its answer depends on."""
    return hashlib.sha256(_head(depends) + b"\n" + text).hexdigest()[:16]


@cache
def _head(depends: tuple[str, ...]) -> bytes:
    return json.dumps([version("linkage-atlas"), *depends]).encode()


def _question(number: int, arguments: Mapping[str, Any]) -> Question:
    try:
        text = json.dumps(dict(arguments), default=_plain, sort_keys=True).encode()
    except (TypeError, ValueError) as error:
        raise FieldError(f"/{number - 1}", f"wanted numbers, lists and words: {error}") from None
    return Question(number, text, key_of(text, "synthesize"))


def _plain(value: Any) -> Any:
    """An array or a number of numpy's as JSON has it; complex points as pairs."""
    if not hasattr(value, "tolist"):
        raise TypeError(f"found {type(value).__name__}")
    if getattr(value, "dtype", None) is not None and value.dtype.kind == "c":
        return [[point.real, point.imag] for point in value.ravel().tolist()]
    return value.tolist()


@cache
def _one_thread() -> Any:
    """One thread of a matrix product, in this process from now on: others would only wait for each other."""
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1, "blas")


def _answer(question: Question) -> bytes:
    """The line that answers a question of `study`."""
    from linkage_atlas.door import synthesize

    _one_thread()
    try:
        result = synthesize(**json.loads(question.text)).to_dict()
    except FieldError as error:
        return answer_of(question, error=str(error))
    except TypeError as error:  # an argument that there is not
        return answer_of(question, error=str(error))
    return answer_of(question, json.dumps(without_times(result)).encode())


def without_times(reply: dict[str, Any]) -> dict[str, Any]:
    """A reply without what differs from run to run."""
    report = {name: value for name, value in reply.get("report", {}).items() if name not in TIMES}
    return reply | {"report": report} if report else reply


TIMES = ("elapsed_ms", "trace")
"""Parts of a report that differ from run to run."""
