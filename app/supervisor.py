"""The parent of the service's processes: loads everything once, forks the others, puts new ones where one has ended.

One process talks to the clients, the *front* (`app.server`); the others compute (`app.computer`), or make a part of the index
that is missing, and end. All are forked from this one, which runs no threads and takes signals one by one, so they share what it
has loaded and begin within milliseconds. What others make later is in files, which each opens when it needs them.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from app.computed import Question
from app.computer import Computer
from app.resources import INDEX, PARTS, ServiceResources

_LATE_SECONDS = 1.0
"""After the time in which the front ends by itself."""
_REBIRTH_SECONDS = 0.2
"""Before another process takes the place of one that could not begin."""
DRAIN_SECONDS = 60.0
"""For the requests of a service whose successor answers already."""
SUCCESSION = "LINKAGE_ATLAS_SUCCESSION"
"""Environment variable of a successor: the listeners that it takes over."""
_LEAST_LIFE = 2.0
"""A front that has ended sooner, by itself, would do so again."""
_MAKER_NICE = 5
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
RELOAD, SUCCEEDED = signal.SIGUSR1, signal.SIGUSR2
"""Start the service anew, perhaps of other code or with another atlas; and what the new one says once it answers."""
MAKE = {part: signal.SIGRTMIN + number for number, part in enumerate((*PARTS, INDEX))}
"""Make a part of the index, or what is damaged of it."""
log = logging.getLogger("uvicorn.error")


class Supervisor:
    """The parent.

    Parameters
    ----------
    front : callable
        ``front(told)`` runs the front in its process until that is told to end, with a socket on which it is told, each time by a
        pickled tuple: of a process that computes ("computer", number, whether it is the quick one, with a socket to it) and its
        end ("ended", number, status), that those so far lack what the next ones share ("fresh",), and of parts of the index
        ("making", part; "made", part).
    questions : mapping
        What the computing processes answer, by the path of its route.
    resources : ServiceResources
        With the atlas loaded.
    listeners : sequence of socket.socket
        Of the front; kept open for the next one.
    count : int
        Processes that compute.
    """

    def __init__(
        self,
        front: Callable[[socket.socket], None],
        questions: Mapping[str, Question],
        resources: ServiceResources,
        listeners: Sequence[socket.socket],
        count: int,
    ) -> None:
        self._run_front, self._questions, self._resources, self._listeners = front, questions, resources, listeners
        self._count = count
        self._computers: set[int] = set()
        self._quick = 0
        self._makers: dict[int, str] = {}
        self._successor: subprocess.Popen[bytes] | None = None
        self._deadline: float | None = None
        nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        ends = [told for told in _ENDS if told != signal.SIGHUP or not nohup]
        self._signals = {*ends, RELOAD, SUCCEEDED, signal.SIGCHLD, *MAKE.values()}

    def run(self) -> int:
        """Until SIGINT, SIGTERM or SIGHUP; returns the exit code."""
        self._came, self._coming = os.pipe()  # of signals, whichever thread they come to
        os.set_blocking(self._coming, False)
        signal.set_wakeup_fd(self._coming, warn_on_full_buffer=False)
        for told in self._signals:
            signal.signal(told, lambda *_: None)
        self._start_front()
        try:
            self._make_missing()
            self._fill()
            self._resources.prepare_rest()  # while the first processes answer
            self._say("fresh")
            while (code := self._next()) is None:
                self._fill()
            return code
        finally:
            self._kill([*self._computers, *self._makers])

    def _next(self) -> int | None:
        """Wait for a signal and do what it says; the service's exit code where that was its end."""
        left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
        told = os.read(self._came, 1)[0] if select.select([self._came], [], [], left)[0] else None
        if told is None:
            self._kill([self._front])  # and its end is told
        elif told == signal.SIGCHLD:
            return self._reap()
        elif told in _ENDS:
            self._end(told)
        elif told == RELOAD:
            self._succeed()
        elif told == SUCCEEDED:
            self._drain()
        else:
            self._make(next(part for part, number in MAKE.items() if number == told))
        return None

    def _say(self, *words: object, file: int | None = None) -> None:
        with contextlib.suppress(OSError):  # a front that has ended is replaced
            socket.send_fds(self._told, [pickle.dumps(words)], [] if file is None else [file])

    # -- ends -------------------------------------------------------------------------------------------------------------

    def _reap(self) -> int | None:
        """Take note of processes that have ended; the service's exit code where the front has, for good."""
        while True:
            try:
                number, status = os.waitpid(-1, os.WNOHANG)
            except ChildProcessError:
                return 0
            if not number:
                return None
            if number in self._computers:
                self._computers.discard(number)
                self._say("ended", number, status)
                if os.waitstatus_to_exitcode(status) > 0:
                    time.sleep(_REBIRTH_SECONDS)
            elif part := self._makers.pop(number, ""):
                self._made(part, status)
            elif self._successor is not None and number == self._successor.pid:
                log.error("The service that was to take over has ended; this one goes on")
                self._successor = None
            elif number == self._front and (code := self._front_ended(status)) is not None:
                return code

    def _front_ended(self, status: int) -> int | None:
        code = os.waitstatus_to_exitcode(status)
        if self._deadline is not None:
            return 0
        if code >= 0 and time.monotonic() - self._began < _LEAST_LIFE:
            return code
        log.error("The process that talks to the clients ended by %s; another takes its place", code)
        self._kill(self._computers)
        self._computers.clear()
        self._told.close()
        self._start_front()
        for part in self._makers.values():
            self._say("making", part)
        return None

    def _made(self, part: str, status: int) -> None:
        """Take note of a part of the index, or of all of it; those that compute without it are replaced then."""
        if part == INDEX and status == 0:
            self._resources.renew()
            self._say("fresh")
            self._make_missing()
        self._say("made", part)

    def _end(self, number: int) -> None:
        """Have the front end."""
        if self._deadline is None:
            self._deadline = time.monotonic() + self._resources.settings.ending_seconds + _LATE_SECONDS
        elif number == signal.SIGINT:  # pressed again: at once
            self._deadline = 0.0
        os.kill(self._front, signal.SIGTERM)

    def _succeed(self) -> None:
        """Start a successor, which listens on the same sockets."""
        if self._successor is None and self._deadline is None:
            passed = [listener.fileno() for listener in self._listeners]
            self._successor = subprocess.Popen(
                [sys.executable, *sys.orig_argv[1:]],
                pass_fds=passed,
                env=os.environ | {SUCCESSION: ",".join(map(str, passed))},
            )

    def _drain(self) -> None:
        """The successor answers: end once all that has been asked here is answered."""
        if self._successor is not None and self._deadline is None:
            self._deadline = time.monotonic() + DRAIN_SECONDS + _LATE_SECONDS
            os.kill(self._front, signal.SIGUSR1)

    @staticmethod
    def _kill(numbers: Sequence[int] | set[int]) -> None:
        for number in numbers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)

    # -- beginnings -------------------------------------------------------------------------------------------------------

    def _start_front(self) -> None:
        self._told, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._told.setblocking(False)
        self._began = time.monotonic()
        with theirs:
            self._front = self._fork(lambda: self._run_front(theirs))

    def _fill(self) -> None:
        """Fork as many that compute as there are to be."""
        while len(self._computers) < self._count:
            ours, theirs = socket.socketpair()
            with ours, theirs:
                quick = self._count > 1 and self._quick not in self._computers
                number = self._fork(partial(self._compute, theirs, ours, quick))
                self._computers.add(number)
                self._quick = number if quick else self._quick
                self._say("computer", number, quick, file=ours.fileno())

    def _compute(self, connection: socket.socket, other: socket.socket, quick: bool) -> None:
        for foreign in (other, *self._listeners):
            foreign.close()
        Computer(connection, self._questions, self._resources, quick).run()

    def _make_missing(self) -> None:
        for part in self._resources.missing():
            self._make(part)

    def _make(self, part: str) -> None:
        if part not in self._makers.values():
            if part == INDEX:
                log.error("A file of the index cannot be read: what is damaged is made anew")
                self._resources.leave_index()
                self._say("fresh")
            self._makers[self._fork(lambda: self._make_here(part))] = part
            self._say("making", part)

    def _make_here(self, part: str) -> None:
        os.nice(_MAKER_NICE)
        for listener in self._listeners:
            listener.close()
        self._resources.make(part)

    def _fork(self, run: Callable[[], None]) -> int:
        """The number of a new process that runs something and ends."""
        sys.stdout.flush()
        sys.stderr.flush()
        signal.pthread_sigmask(signal.SIG_BLOCK, self._signals)  # none may come to the new process as if to this one
        if number := os.fork():
            signal.pthread_sigmask(signal.SIG_UNBLOCK, self._signals)
            return number
        code = 1
        try:
            signal.set_wakeup_fd(-1)
            for told in self._signals:
                signal.signal(told, signal.SIG_DFL)
            signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the supervisor tells the front, and ends the others
            signal.pthread_sigmask(signal.SIG_UNBLOCK, self._signals)
            for end in (self._came, self._coming):
                os.close(end)
            self._told.close()
            run()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
