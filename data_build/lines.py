"""Many questions, a line each: answered on an executor, in order, in a file that a kill leaves so that one can go on.

Data flow: questions (number, text, key) -> the answers that the file already holds, checked against the keys -> the others to an
executor, some way ahead of the one that is waited for -> each answer appended as a line, in order.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, wait
from pathlib import Path
from typing import Any, NamedTuple

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
