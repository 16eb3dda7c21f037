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
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import NoReturn

from app.computed import Question
from app.computer import Computer
from app.resources import INDEX, PARTS, ServiceResources

_LATE_SECONDS = 1.0
"""After the time in which the front ends by itself."""
_AGAIN_SECONDS = 0.5
"""Before what must be done is tried again."""
_RESTART_SECONDS = 0.2
"""Before another process takes the place of one that could not begin."""
DRAIN_SECONDS = 60.0
"""For the requests of a service whose successor answers already."""
SUCCESSION = "LINKAGE_ATLAS_SUCCESSION"
"""Environment variable of a successor: the process whose place it takes, and the listeners that it takes over."""
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
        self._ended: dict[int, Callable[[int], object]] = {}
        """What is to be done, with its exit code, once a process has ended."""
        self._computers: set[int] = set()
        self._front: int | None = None
        self._quick: int | None = None
        self._successor: int | None = None
        self._making: set[str] = set()
        self._code: int | None = None
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
        try:
            self._fill()
            self._make_missing()
            self._resources.prepare_rest()  # while the first processes answer
            self._say("fresh")
            while self._code is None:
                self._fill()
                self._next()
            return self._code
        finally:
            for number in self._ended:
                os.kill(number, signal.SIGKILL)

    def _next(self) -> None:
        """Wait for a signal, or for what must be tried again, and do what it says."""
        settled = self._deadline is None and self._front is not None and len(self._computers) == self._count
        came, _, _ = select.select([self._came], [], [], None if settled else _AGAIN_SECONDS)
        told = os.read(self._came, 1)[0] if came else None
        if self._deadline is not None and time.monotonic() > self._deadline:
            self._tell_front(signal.SIGKILL)  # and its end is told
        if told is None:
            return
        if told == signal.SIGCHLD:
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
        with contextlib.suppress(ChildProcessError):  # there is none
            while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                self._ended.pop(ended[0], lambda code: None)(os.waitstatus_to_exitcode(ended[1]))

    def _computer_ended(self, number: int, code: int) -> None:
        self._computers.discard(number)
        self._say("ended", number, code)
        if code > 0:
            time.sleep(_RESTART_SECONDS)

    def _front_ended(self, code: int) -> None:
        self._front = None
        if self._deadline is not None:
            self._code = 0
        elif code >= 0 and time.monotonic() - self._began < _LEAST_LIFE:
            self._code = code
        else:
            log.error("The process that talks to the clients ended by %s; another takes its place", code)
            for number in self._computers:
                os.kill(number, signal.SIGKILL)
            self._computers.clear()

    def _successor_ended(self, code: int) -> None:
        log.error("The service that was to take over has ended by %s; this one goes on", code)
        self._successor = None

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
            self._tell_front(signal.SIGKILL)
        self._tell_front(signal.SIGTERM)

    def _tell_front(self, number: int) -> None:
        if self._front is None:  # none could begin
            self._code = 0
        else:
            os.kill(self._front, number)

    def _succeed(self) -> None:
        """Start a successor, which listens on the same sockets."""
        if self._successor is None and self._deadline is None:
            with self._room():
                self._successor = self._fork(self._become_successor)
                self._ended[self._successor] = self._successor_ended

    def _become_successor(self) -> None:
        if signal.SIGHUP in self._signals:
            signal.signal(signal.SIGHUP, signal.SIG_DFL)
        passed = [listener.fileno() for listener in self._listeners]
        for number in passed:
            os.set_inheritable(number, True)
        known = os.environ | {SUCCESSION: ",".join(map(str, [os.getppid(), *passed]))}
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], known)

    def _drain(self) -> None:
        """The successor answers: end once all that has been asked here is answered."""
        if self._successor is not None and self._deadline is None:
            self._deadline = time.monotonic() + DRAIN_SECONDS + _LATE_SECONDS
            del self._ended[self._successor]  # it stays
            self._tell_front(signal.SIGUSR1)

    # -- beginnings -------------------------------------------------------------------------------------------------------

    def _fill(self) -> None:
        """Fork what there is not of the front, and of those that compute."""
        with self._room():
            if self._front is None:
                self._start_front()
            while len(self._computers) < self._count:
                self._start_computer()

    @contextlib.contextmanager
    def _room(self) -> Iterator[None]:
        """Where the system has no room for another process or file, what is there goes on."""
        try:
            yield
        except OSError as error:
            log.error("No further process can begin: %s", error)

    def _start_front(self) -> None:
        self._told, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._told.setblocking(False)
        self._began = time.monotonic()
        with theirs:
            self._front = self._fork(partial(self._run_front, theirs))
            self._ended[self._front] = self._front_ended
        for part in self._making:
            self._say("making", part)

    def _start_computer(self) -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            quick = self._count > 1 and self._quick not in self._computers
            number = self._fork(partial(self._compute, theirs, ours, quick))
            self._ended[number] = partial(self._computer_ended, number)
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
        if part not in self._making:
            if part == INDEX:
                log.error("A file of the index cannot be read: what is damaged is made anew")
                self._resources.leave_index()
                self._say("fresh")
            self._making.add(part)
            self._say("making", part)
            with self._room():
                self._ended[self._fork(partial(self._make_here, part))] = partial(self._made, part)
                return
            self._made(part, 1)

    def _make_here(self, part: str) -> None:
        os.nice(_MAKER_NICE)
        for listener in self._listeners:
            listener.close()
        self._resources.make(part)

    def _fork(self, run: Callable[[], None]) -> int:
        """The number of a new process that runs something and ends; raises OSError."""
        sys.stdout.flush()
        signal.pthread_sigmask(signal.SIG_BLOCK, self._signals)  # none may come to the new process as if to this one
        try:
            if not (number := os.fork()):
                self._begin(run)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, self._signals)
        return number

    def _begin(self, run: Callable[[], None]) -> NoReturn:
        """In the new process: until its end."""
        code: object = 1
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
            code = end.code
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code if isinstance(code, int) else 1)
