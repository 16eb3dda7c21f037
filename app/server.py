"""The service's own server: uvicorn with its limits, and an end in a stated time, before the processes that compute."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import socket
import sys
import threading
from copy import deepcopy
from types import FrameType

import uvicorn
from fastapi import FastAPI

from app.admission import LOOPBACK
from app.connections import ACCEPTED_AT_ONCE, BACKLOG, Connection, protocol_of
from app.main import create_app
from app.processes import Processes
from app.resources import ServiceResources
from app.settings import MOST_LOGGED, Settings
from app.supervisor import DRAIN_SECONDS, SUCCEEDED, SUCCESSION, Supervisor
from app.terminal import Exit

SWITCH_SECONDS = 0.001
"""Between two turns of threads in the interpreter, where threads compute: so long a short answer waits for a long one."""
SEND_BUFFER = 1 << 18
"""Bytes of a connection's replies that the system takes, for each client that does not read."""
_LAST_SECOND = 1.0
"""Before the end: what still computes is told to stop, and its client that the service ends."""


class _Server(uvicorn.Server):
    """Ends in a stated time, whatever is being computed."""

    seconds: float
    predecessor: int | None = None
    """A handle of the process whose place the service takes."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        for listener in sockets or []:
            listener.listen(BACKLOG)
            host, port = listener.getsockname()[:2]
            where = f"http://{f'[{host}]' if ':' in host else host}:{port}"
            logging.getLogger("uvicorn.error").info("Uvicorn running on %s (Press CTRL+C to quit)", where)
        _tell_ready(self.predecessor)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if not self.should_exit:
            steps = [(self.seconds, lambda: os._exit(0))]
            steps.append((self.seconds - 2 * _LAST_SECOND, self.config.app.state.computing.stop))
            for seconds, step in steps:
                timer = threading.Timer(max(0.0, seconds), step)
                timer.daemon = True
                timer.start()
        super().handle_exit(
            signal.SIGTERM, frame
        )  # a terminal's SIGINT comes twice, from the supervisor too: no one hurries
        self._captured_signals.clear()  # ending so is no failure: not handed on


def _tell_ready(predecessor: int | None) -> None:
    """Tell the service manager, if there is one, that the service answers, and the predecessor that it may end."""
    if place := os.environ.get("NOTIFY_SOCKET"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, contextlib.suppress(OSError):
            manager.connect("\0" + place[1:] if place[0] == "@" else place)
            manager.send(f"READY=1\nMAINPID={os.getppid()}".encode())
    if predecessor is not None:
        with contextlib.suppress(OSError):
            signal.pidfd_send_signal(predecessor, SUCCEEDED)


def serve(resources: ServiceResources, host: str, port: int, workers: int | None = None) -> int:
    """Answer on an address until SIGINT or SIGTERM; returns the exit code.

    On Linux ``workers`` processes compute; elsewhere, where forking a process that has computed is not safe, threads do.
    """
    settings = resources.settings
    if host in LOOPBACK and "allowed_hosts" not in settings.model_fields_set:
        settings = settings.model_copy(update={"allowed_hosts": LOOPBACK})
    first, *taken = map(int, os.environ.pop(SUCCESSION, "-1").split(","))
    try:
        listeners = [socket.socket(fileno=number) for number in taken] or listening(host, port)
    except OSError as error:
        print(f"no service at {host}, port {port}: {(error.strerror or str(error)).lower()}", file=sys.stderr)
        return Exit.FAILED
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))  # until the service takes over: nothing has begun
    if sys.platform != "linux":
        return _serve_with_threads(settings, resources, listeners)
    predecessor = os.pidfd_open(first) if first == os.getppid() else None  # it may have ended
    count = workers or settings.workers or default_workers()
    return _serve_with_processes(settings, resources, listeners, count, predecessor)


def default_workers() -> int:
    """Processes that compute unless told otherwise: a long request must leave one to the short ones."""
    return min(max(2, len(os.sched_getaffinity(0))), 4)


def listening(host: str, port: int) -> list[socket.socket]:
    """Sockets of a host's addresses. Their connections know that they are TCP: else asyncio leaves Nagle's algorithm on."""
    listeners: list[socket.socket] = []
    known = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    for family, kind, _, _, (name, _, *rest) in dict.fromkeys(known):
        listener = socket.socket(family, kind, socket.IPPROTO_TCP)
        listeners.append(listener)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            if family == socket.AF_INET6:
                listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            listener.bind((name, port or listeners[0].getsockname()[1], *rest))
        except OSError:
            for one in listeners:
                one.close()
            raise
    return listeners


def _serve_with_threads(settings: Settings, resources: ServiceResources, listeners: list[socket.socket]) -> int:
    sys.setswitchinterval(SWITCH_SECONDS)
    _run(_server(settings, create_app(settings, resources), protocol_of(settings)), listeners)
    return Exit.OK


def _serve_with_processes(
    settings: Settings,
    resources: ServiceResources,
    listeners: list[socket.socket],
    workers: int,
    predecessor: int | None,
) -> int:
    settings = settings.model_copy(update={"max_concurrent": workers})  # each computes one request at a time
    app = create_app(settings, resources, lambda turns: Processes(turns, settings))
    protocol = protocol_of(settings)
    server = _server(settings, app, protocol)
    server.predecessor = predecessor

    def drain(*_: object) -> None:
        server.seconds = server.config.timeout_graceful_shutdown = int(DRAIN_SECONDS)
        protocol.drains = True
        server.handle_exit(signal.SIGTERM, None)

    def front(supervisor: socket.socket) -> None:
        signal.signal(signal.SIGUSR1, drain)
        app.state.computing.supervisor = supervisor
        _run(server, listeners)

    resources.load()
    if predecessor is not None:  # which answers meanwhile
        resources.prepare_rest()
    return Supervisor(front, app.state.questions, resources, listeners, workers).run()


def _server(settings: Settings, app: FastAPI, protocol: type[Connection]) -> _Server:
    logs = deepcopy(uvicorn.config.LOGGING_CONFIG)
    logs["formatters"]["access"]["fmt"] = (
        f'%(levelprefix)s %(client_addr)s - "%(request_line).{MOST_LOGGED}s" %(status_code)s'
    )
    config = uvicorn.Config(
        app,
        log_config=logs,
        log_level="info",
        access_log=not settings.log_json,
        http=protocol,
        ws="none",
        backlog=ACCEPTED_AT_ONCE,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies or None,
        timeout_graceful_shutdown=max(1, int(settings.ending_seconds - _LAST_SECOND)),
    )
    server = _Server(config)
    server.seconds = settings.ending_seconds
    return server


def _run(server: _Server, listeners: list[socket.socket]) -> None:
    try:
        server.run(listeners)
    except KeyboardInterrupt:
        pass
