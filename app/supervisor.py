"""The parent of the service's processes: loads everything once, forks the others, puts new ones where one has ended.

One process talks to the clients, the *front* (`app.server`); the others compute (`app.computer`). All are forked from this one,
which runs no threads while it forks, so they share the atlas and begin within milliseconds. It ends when it is told to, and
with the front.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import select
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from types import FrameType
from typing import Any

from app.computed import Question
from app.computer import Computer, packed
from app.resources import ServiceResources

_LATE_SECONDS = 1.0
"""After the time in which the front ends by itself."""
_QUIET_SECONDS = 0.3
"""Without a wish of the front, before something is prepared."""
_LOOK_SECONDS = 0.5
"""At most, between two looks at who has ended and whether the time is up."""
DRAIN_SECONDS = 60.0
"""For the requests of a service whose successor answers already."""
SUCCESSION = "LINKAGE_ATLAS_SUCCESSION"
"""Environment variable of a successor: the end of a pipe to write to once it answers, and the listeners that it takes over."""
_LEAST_LIFE = 2.0
"""A front that has ended sooner, by itself, would do so again."""
_ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_SIGNALS = (*_ENDS, signal.SIGUSR1, signal.SIGCHLD)
log = logging.getLogger("uvicorn.error")


class Supervisor:
    """The parent.

    Parameters
    ----------
    front : callable
        ``front(control)`` runs the front in its process, with its end of a socket to the supervisor, until that is told to end.
    questions : mapping
        What the computing processes answer, by the path of its route.
    resources : ServiceResources
        With the atlas loaded.
    listeners : list of socket.socket
        Of the front; kept open for the next one.
    """

    def __init__(
        self,
        front: Callable[[socket.socket], None],
        questions: Mapping[str, Question],
        resources: ServiceResources,
        listeners: list[socket.socket],
    ) -> None:
        self._run_front, self._questions, self._resources, self._listeners = front, questions, resources, listeners
        self._computers: set[int] = set()
        self._deadline: float | None = None
        self._steps = [self._prepare_rest, self._prepare_more] if resources.wants_more else []
        self._front: int | None = None
        self._successor: int | None = None

    def run(self) -> int:
        """Until SIGINT, SIGTERM or SIGHUP; returns the exit code."""
        woken, self._wake = socket.socketpair()
        for end in (woken, self._wake):
            end.setblocking(False)
        self._woken = woken
        signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        for told in _ENDS:
            if told != signal.SIGHUP or signal.getsignal(told) != signal.SIG_IGN:  # as nohup has it
                signal.signal(told, self._end)
        signal.signal(signal.SIGUSR1, self._succeed)
        self._start_front()
        if self._steps:  # while the front begins, which computes nothing
            self._resources.prepare()
        else:
            self._prepare_rest()
        try:
            return self._watch()
        finally:
            self._kill(self._computers)

    # -- what happens -----------------------------------------------------------------------------------------------------

    def _watch(self) -> int:
        while True:
            self._calls(_QUIET_SECONDS if self._steps else _LOOK_SECONDS)
            while (code := self._reaped()) is None and self._calls(0):
                self._serve()
            if code is not None:
                return code
            if self._deadline is not None and time.monotonic() > self._deadline:
                self._kill({self._front or 0} - {0})
            elif self._steps and not self._calls(0):
                self._prepare()

    def _calls(self, seconds: float) -> bool:
        """Whether the front wishes something, or a signal has come; waits so long for it."""
        if self._deadline is not None:
            seconds = max(0.0, min(seconds, self._deadline - time.monotonic()))
        ready = self._ready(seconds)
        if self._woken in ready:
            with contextlib.suppress(BlockingIOError):
                self._woken.recv(4096)
        if self._successor in ready:
            self._succeeded()
        return bool(ready)

    def _ready(self, seconds: float) -> list[socket.socket | int]:
        ends: list[socket.socket | int] = [self._woken, self._control] if self._heard else [self._woken]
        return select.select(ends if self._successor is None else [*ends, self._successor], [], [], seconds)[0]

    def _serve(self) -> None:
        """Do what the front wishes."""
        try:
            wish, files, _, _ = socket.recv_fds(self._control, 1, 1)
        except BlockingIOError:
            return
        except OSError:
            wish = b""
        self._heard = bool(wish)
        if wish == b"c":
            with socket.socket(fileno=files[0]) as connection:
                self._computers.add(self._fork(lambda: self._compute(connection)))
        elif wish == b"r":
            self._make(lambda: self._resources.atlas.rocker_scan)
            self._tell_of_more()
        elif wish == b"p":
            self._make(lambda: self._resources.atlas.prepare(short_spans=False))
            self._tell_of_more()

    def _prepare(self) -> None:
        """Make the next of what later requests need; one that takes long is given up where something is wanted meanwhile."""
        made = self._make(self._steps[0])
        if made is not False:
            del self._steps[0]
        if made:
            self._tell_of_more()

    def _prepare_rest(self) -> bool:
        self._resources.prepare_rest()
        return True

    def _prepare_more(self) -> bool:
        return self._resources.prepare_more(lambda: bool(self._ready(0)))

    @staticmethod
    def _make(something: Callable[[], Any]) -> Any:
        """What is made; None where that fails: then those that compute are without it, and the service goes on."""
        try:
            return something()
        except Exception:
            log.exception("What all processes were to share could not be made")
            return None

    def _tell_of_more(self) -> None:
        gc.collect()
        gc.freeze()
        self._say("prepared")

    def _say(self, *words: object) -> None:
        with contextlib.suppress(OSError):
            self._control.sendall(packed(words))

    def _reaped(self) -> int | None:
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
        self._control.close()
        self._start_front()
        return None

    def _succeed(self, number: int, frame: FrameType | None) -> None:
        """Start the service anew, perhaps of other code or with another atlas, and end once it answers in this one's place."""
        if self._successor is not None or self._deadline is not None:
            return
        self._successor, theirs = os.pipe()
        passed = [theirs, *(listener.fileno() for listener in self._listeners)]
        environment = os.environ | {SUCCESSION: ",".join(map(str, passed))}
        subprocess.Popen([sys.executable, *sys.orig_argv[1:]], pass_fds=passed, env=environment)
        os.close(theirs)

    def _succeeded(self) -> None:
        """The successor answers, or has ended before it did."""
        assert self._successor is not None
        answers = os.read(self._successor, 1)
        os.close(self._successor)
        self._successor = None
        if not answers:
            log.error("The service that was to take over has ended; this one goes on")
        elif self._deadline is None:
            self._deadline = time.monotonic() + DRAIN_SECONDS + _LATE_SECONDS
            self._tell_front(signal.SIGUSR1)

    def _end(self, number: int, frame: FrameType | None) -> None:
        if self._deadline is None:
            self._deadline = time.monotonic() + self._resources.settings.ending_seconds + _LATE_SECONDS
        elif number == signal.SIGINT:  # pressed again: at once
            self._deadline = 0.0
        if self._front is None:
            os._exit(0)  # nothing has begun
        self._tell_front(signal.SIGTERM)

    def _tell_front(self, what: signal.Signals) -> None:
        assert self._front is not None
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._front, what)

    # -- processes --------------------------------------------------------------------------------------------------------

    def _start_front(self) -> None:
        self._control, theirs = socket.socketpair()
        self._control.setblocking(False)  # `recv_fds` passes no flags on
        self._heard = True  # until the front closes its end
        self._began = time.monotonic()
        with theirs:
            self._front = self._fork(lambda: self._talk(theirs))

    def _talk(self, control: socket.socket) -> None:
        self._control.close()
        signal.signal(signal.SIGTERM, lambda *_: os._exit(0))  # until the server takes over: nothing has begun
        self._run_front(control)

    def _compute(self, connection: socket.socket) -> None:
        self._control.close()
        for listener in self._listeners:
            listener.close()
        Computer(connection, self._questions, self._resources).run()

    def _fork(self, run: Callable[[], None]) -> int:
        """The number of a new process that runs something and ends."""
        sys.stdout.flush()
        sys.stderr.flush()
        signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)  # none may come to the new process before its own handlers
        number = os.fork()
        if number:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
            return number
        code = 1
        try:
            signal.set_wakeup_fd(-1)
            for told in _SIGNALS:
                signal.signal(told, signal.SIG_DFL)
            signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the supervisor tells the front, and ends the others
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)
            self._wake.close()
            self._woken.close()
            if self._successor is not None:
                os.close(self._successor)
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

    @staticmethod
    def _kill(numbers: set[int]) -> None:
        for number in numbers:
            with contextlib.suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
