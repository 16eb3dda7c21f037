"""The parent of the service's processes: loads everything once, forks the others, puts new ones where one has ended.

One process talks to the clients, the *front* (`app.server`); the others compute (`app.computer`), or make a part of the index
that is missing, and end. All are forked from this one, which runs no threads and takes signals one by one, so they share what it
has loaded and begin within milliseconds. What others make later is in files, which each opens when it needs them.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import pickle
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from multiprocessing.context import ForkProcess

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
    """The parent, which runs a front on ``listeners``, and ``count`` processes that answer ``questions``.

    ``front(told)`` runs the front until its end, with a socket on which it is told, each time by a pickled tuple: of a process
    that computes ("computer", number, whether it is the quick one, with a socket to it) and its end ("ended", number, exit
    code), that those so far lack what the next ones share ("fresh",), and of parts of the index ("making", part; "made", part).
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
        self._ended: dict[ForkProcess, Callable[[int], object]] = {}
        """What is to be done, with its exit code, once a process has ended."""
        self._computers: set[ForkProcess] = set()
        self._quick: ForkProcess | None = None
        self._making: set[str] = set()
        self._code: int | None = None
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
            while self._code is None:
                self._next()
                self._fill()
            return self._code
        finally:
            for process in self._ended:
                process.kill()

    def _next(self) -> None:
        """Wait for a signal and do what it says."""
        left = None if self._deadline is None else max(0.0, self._deadline - time.monotonic())
        told = os.read(self._came, 1)[0] if select.select([self._came], [], [], left)[0] else None
        if told is None:
            self._front.kill()  # and its end is told
        elif told == signal.SIGCHLD:
            self._reap()
        elif told in _ENDS:
            self._end(told)
        elif told == RELOAD:
            self._succeed()
        elif told == SUCCEEDED:
            self._drain()
        else:
            self._make(next(part for part, number in MAKE.items() if number == told))

    def _say(self, *words: object, file: int | None = None) -> None:
        with contextlib.suppress(OSError):  # a front that has ended is replaced
            socket.send_fds(self._told, [pickle.dumps(words)], [] if file is None else [file])

    # -- ends -------------------------------------------------------------------------------------------------------------

    def _reap(self) -> None:
        for process, ended in list(self._ended.items()):
            if process.exitcode is not None:
                del self._ended[process]
                ended(process.exitcode)
        if self._successor is not None and self._successor.poll() is not None:
            log.error("The service that was to take over has ended; this one goes on")
            self._successor = None

    def _computer_ended(self, process: ForkProcess, code: int) -> None:
        self._computers.discard(process)
        self._say("ended", process.pid, code)
        if code > 0:
            time.sleep(_REBIRTH_SECONDS)

    def _front_ended(self, code: int) -> None:
        if self._deadline is not None:
            self._code = 0
        elif code >= 0 and time.monotonic() - self._began < _LEAST_LIFE:
            self._code = code
        else:
            log.error("The process that talks to the clients ended by %s; another takes its place", code)
            for process in self._computers:
                process.kill()
            self._computers.clear()
            self._told.close()
            self._start_front()
            for part in self._making:
                self._say("making", part)

    def _made(self, part: str, code: int) -> None:
        """Take note of a part of the index, or of all of it; those that compute without it are replaced then."""
        self._making.discard(part)
        if part == INDEX and code == 0:
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
        self._front.terminate()

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
            os.kill(self._front.pid, signal.SIGUSR1)

    # -- beginnings -------------------------------------------------------------------------------------------------------

    def _start_front(self) -> None:
        self._told, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._told.setblocking(False)
        self._began = time.monotonic()
        with theirs:
            self._front = self._fork(partial(self._run_front, theirs))
            self._ended[self._front] = self._front_ended

    def _fill(self) -> None:
        """Fork as many that compute as there are to be."""
        while len(self._computers) < self._count:
            ours, theirs = socket.socketpair()
            with ours, theirs:
                quick = self._count > 1 and self._quick not in self._computers
                process = self._fork(partial(self._compute, theirs, ours, quick))
                self._ended[process] = partial(self._computer_ended, process)
                self._computers.add(process)
                self._quick = process if quick else self._quick
                self._say("computer", process.pid, quick, file=ours.fileno())

    def _compute(self, connection: socket.socket, other: socket.socket, quick: bool) -> None:
        for foreign in (other, *self._listeners):
            foreign.close()
        Computer(connection, self._questions, self._resources, quick).run()

    def _make_missing(self) -> None:
        for part in self._resources.missing():
            self._make(part)

    def _make(self, part: str) -> None:
        if part not in self._making:
            if part == INDEX:
                log.error("A file of the index cannot be read: what is damaged is made anew")
                self._resources.leave_index()
                self._say("fresh")
            self._making.add(part)
            self._ended[self._fork(partial(self._make_here, part))] = partial(self._made, part)
            self._say("making", part)

    def _make_here(self, part: str) -> None:
        os.nice(_MAKER_NICE)
        for listener in self._listeners:
            listener.close()
        self._resources.make(part)

    def _fork(self, run: Callable[[], None]) -> ForkProcess:
        """A new process that runs something and ends."""
        process = multiprocessing.get_context("fork").Process(target=self._begin, args=(run,))
        signal.pthread_sigmask(signal.SIG_BLOCK, self._signals)  # none may come to the new process as if to this one
        process.start()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, self._signals)
        return process

    def _begin(self, run: Callable[[], None]) -> None:
        signal.set_wakeup_fd(-1)
        for told in self._signals:
            signal.signal(told, signal.SIG_DFL)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the supervisor tells the front, and ends the others
        signal.pthread_sigmask(signal.SIG_UNBLOCK, self._signals)
        for end in (self._came, self._coming):
            os.close(end)
        self._told.close()
        run()
