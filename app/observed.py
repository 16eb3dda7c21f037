"""What is seen of the service from outside: a line of JSON for each request, and figures that Prometheus collects."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from resource import getpagesize
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Histogram
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest
from prometheus_client.registry import Collector
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.bodies import Held
from app.settings import MOST_LOGGED, Settings
from app.turns import Turns

_SECONDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30)
lines = logging.getLogger("linkage_atlas.requests")


class Observed:
    """Middleware that tells of each request once it is answered.

    Parameters
    ----------
    app : ASGI application
    tell : list of callables
        Each is told scope, status, bytes of the body and seconds.
    """

    def __init__(self, app: ASGIApp, tell: list[Callable[[Scope, int, int, float], None]]) -> None:
        self.app, self._tell = app, tell

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        begin, status, size = time.perf_counter(), 500, 0

        async def counted(message: Message) -> None:
            nonlocal status, size
            if message["type"] == "http.response.start":
                status = message["status"]
            elif message["type"] == "http.response.body":
                size += len(message.get("body", b""))
            await send(message)

        try:
            await self.app(scope, receive, counted)
        finally:
            seconds = time.perf_counter() - begin
            for tell in self._tell:
                tell(scope, status, size, seconds)


def install(app: Starlette, settings: Settings, computing: Any) -> None:
    """Lines and figures, as far as the settings ask for them, also of the processes of ``computing``."""
    tell: list[Callable[[Scope, int, int, float], None]] = []
    if settings.log_json:
        if not lines.handlers:
            lines.addHandler(logging.StreamHandler(sys.stdout))
            lines.setLevel(logging.INFO)
            lines.propagate = False
        tell.append(_line)
    if settings.metrics:
        figures = _Figures(app, computing)
        tell.append(figures.tell)
        app.add_route("/metrics", figures.reply, ["GET"], include_in_schema=False)
    if tell:
        app.add_middleware(Observed, tell=tell)


def _line(scope: Scope, status: int, size: int, seconds: float) -> None:
    client = scope.get("client")
    row = {
        "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "client": client[0] if client else None,
        "method": scope["method"],
        "path": scope["path"][:MOST_LOGGED],
        "status": status,
        "bytes": size,
        "ms": round(1000 * seconds, 3),
    }
    lines.info(json.dumps(row))


class _Figures:
    """Requests by route and status, their times, and what holds at the moment."""

    def __init__(self, app: Starlette, computing: Any) -> None:
        self._registry = CollectorRegistry()
        self._count = Counter(
            "linkage_atlas_requests", "Requests answered.", ["route", "status"], registry=self._registry
        )
        self._seconds = Histogram(
            "linkage_atlas_request_seconds",
            "From a request's header to the end of its reply.",
            ["route"],
            buckets=_SECONDS,
            registry=self._registry,
        )
        self._registry.register(_Now(app.state.turns, computing))

    def tell(self, scope: Scope, status: int, size: int, seconds: float) -> None:
        """Count a request; addresses that are none are one."""
        route = getattr(scope.get("route"), "path", "none")
        self._count.labels(route, str(status)).inc()
        self._seconds.labels(route).observe(seconds)

    async def reply(self, request: Request) -> Response:
        """The figures in Prometheus' text format."""
        return Response(generate_latest(self._registry), media_type=CONTENT_TYPE_LATEST)


class _Now(Collector):
    """What holds when it is asked for."""

    def __init__(self, turns: Turns, computing: Any) -> None:
        self._turns, self._computing = turns, computing

    def collect(self) -> Iterable[Metric]:
        """Gauges of the moment, and the processes that have ended by how they did."""
        for name, about, value in (
            ("computing", "Requests that compute now.", self._turns.computing),
            ("waiting", "Requests that wait for their turn.", self._turns.waiting),
            ("unread_reply_bytes", "Bytes of replies that clients have not yet taken.", Held.total),
        ):
            yield GaugeMetricFamily(f"linkage_atlas_{name}", about, value)
        memory = GaugeMetricFamily(
            "linkage_atlas_process_memory_bytes", "Resident memory of a computing process.", labels=["process"]
        )
        for number, size in _memory(self._computing.alive):
            memory.add_metric([str(number)], size)
        yield memory
        ends = CounterMetricFamily(
            "linkage_atlas_process_ends", "Computing processes that have ended.", labels=["how"]
        )
        for how, count in self._computing.ends.items():
            ends.add_metric([how], count)
        yield ends


def _memory(numbers: Iterable[int]) -> Iterator[tuple[int, int]]:
    for number in numbers:
        try:
            pages = int(Path(f"/proc/{number}/statm").read_bytes().split()[1])
        except OSError:  # it has just ended
            continue
        yield number, pages * getpagesize()
