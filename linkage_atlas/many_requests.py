"""Studies: many questions answered in order, on processes or a cluster, a line each, and gone on with after a kill."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, Future, wait
from contextlib import AbstractContextManager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from data_build.batch import dask_executor, local_executor
from synthesis.errors import FieldError

AHEAD = 128
"""Questions for each place that may be under way, or be answered and wait for one before them."""
_LOOK_SECONDS = 0.1
_HEAD = b'{"line": '
"""How every answer begins."""


class Question(NamedTuple):
    """A line of a study."""

    number: int
    """Of the line, from 1."""
    text: bytes
    key: str
    """Of the text and of all else that the answer depends on; its answer bears it too."""


class StudyLocked(Exception):
    """Another study writes the same file."""


def answer_of(question: Question, reply: bytes | None = None, error: str | None = None) -> bytes:
    """The line of an answer: its number, its key, and the reply (JSON) or one line of what is wrong."""
    head = json.dumps({"line": question.number, "key": question.key})[:-1].encode()
    if reply is not None:
        return head + b', "reply": ' + reply + b"}"
    return head + b', "error": ' + json.dumps(" ".join((error or "").split())).encode() + b"}"


def is_error(answer: bytes) -> bool:
    """Whether the line of an answer holds an error."""
    return answer.split(b", ", 2)[2].startswith(b'"error"')


def in_order(
    work: Callable[[Question], bytes],
    questions: Iterable[Question],
    executor: Executor,
    places: int,
    stopped: Callable[[], bool] = lambda: False,
) -> Iterator[bytes]:
    """The answers to questions, in their order, from an executor with so many places.

    Law: the answers are those of ``work`` for each question alone, whatever the executor. Raises KeyboardInterrupt once it is
    stopped; nothing is submitted afterwards.
    """
    under_way: deque[Future[bytes]] = deque()
    try:
        for question in questions:
            under_way.append(executor.submit(work, question))
            if len(under_way) >= AHEAD * places:
                yield _taken(under_way, stopped)
        while under_way:
            yield _taken(under_way, stopped)
    finally:
        for future in under_way:
            future.cancel()


def _taken(under_way: deque[Future[bytes]], stopped: Callable[[], bool]) -> bytes:
    while not wait([under_way[0]], _LOOK_SECONDS).done:
        if stopped():
            raise KeyboardInterrupt
    if stopped():
        raise KeyboardInterrupt
    return under_way.popleft().result()


@contextlib.contextmanager
def answer_file(path: Path) -> Iterator[AnswerFile]:
    """A file of answers, open and locked for this process.

    Raises `StudyLocked`. Raises `FieldError`: it is no regular file.
    """
    if os.path.lexists(path) and not path.is_file():
        raise FieldError("/out", f"{path} exists and is no regular file")
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StudyLocked(f"another study writes {path}") from None
        yield AnswerFile(path, handle)
        os.fsync(handle)
    finally:
        os.close(handle)


class AnswerFile:
    """Answers in order, a line each; of the last one perhaps only a part, where its writer was killed."""

    def __init__(self, path: Path, handle: int) -> None:
        self.path = path
        self._handle = handle

    def keep(self, questions: Iterator[Question]) -> Iterator[bytes]:
        """The answers that are there, each to the next of the questions; what was cut off in writing is removed.

        Raises `FieldError`: a line is no answer to its question: another file, other requests, another version.
        """
        good = 0
        with self.path.open("rb") as file:
            for line in file:
                if not line.endswith(b"\n") or b"\0" in line:  # the writer, or the machine, stopped within it
                    if not (line.startswith(_HEAD) or _HEAD.startswith(line) or not line.strip(b"\0\n")):
                        raise FieldError(
                            "/out", f"{self.path} holds no answers: name another file, or remove this one"
                        )
                    break
                question = next(questions, None)
                self._check(line, question)
                good += len(line)
                yield line[:-1]
        os.ftruncate(self._handle, good)

    def _check(self, line: bytes, question: Question | None) -> None:
        try:
            found: Any = json.loads(line)
        except ValueError:
            found = None
        if question is None or not isinstance(found, dict) or found.get("line") != question.number:
            what = "holds lines that are no answers to these requests"
        elif found.get("key") != question.key:
            what = f"has an answer for line {question.number} to another request, or of another version or command"
        else:
            return
        raise FieldError("/out", f"{self.path} {what}: name another file, or remove this one")

    def append(self, line: bytes) -> None:
        """Add an answer."""
        left = memoryview(line + b"\n")
        while left:
            left = left[os.write(self._handle, left) :]


def study_lines(
    work: Callable[[Question], bytes],
    questions: Callable[[], Iterator[Question]],
    total: int,
    out: Path | None,
    executor: contextlib.AbstractContextManager[Executor],
    places: int,
    stopped: Callable[[], bool] = lambda: False,
) -> Iterator[tuple[bytes, bool]]:
    """Every answer in order, and whether it was there already; new ones are appended to the file, if there is one.

    ``questions`` is called anew for each pass over them. The executor is entered only where something is left to do.
    """
    with contextlib.ExitStack() as stack:
        left = questions()
        file = None if out is None else stack.enter_context(answer_file(out))
        kept = 0
        for line in [] if file is None else file.keep(left):
            kept += 1
            yield line, True
        if kept == total:
            return
        running = stack.enter_context(executor)
        for line in in_order(work, left, running, places, stopped):
            if file is not None:
                file.append(line)
            yield line, False


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
