"""The service under load: ``python -m benchmarks.reliability --atlas FILE [--before CHECKOUT]``.

Another checkout, with an environment of its own, is measured in the same run for comparison. Not measured there: what happens
when a process is killed, because its processes have other parts.
"""

from __future__ import annotations

import http.client
import itertools
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from app.registry import worked_example
from benchmarks import report, service
from benchmarks.report import ROOT, significant
from benchmarks.service import Service, quantile
from tests.oracles.largest import requests

ALONE_SECONDS, CROWD_SECONDS, BESIDE_SECONDS = 4.0, 20.0, 12.0
BUDGET_MS = 3000
LARGEST = 20
AFTER = 2000
"""Number of requests after which memory is measured again."""
JSON = {"Content-Type": "application/json"}


def noise(budget_ms: float) -> bytes:
    """A search that takes its whole budget: poses that no linkage follows."""
    random = np.random.default_rng(1)
    body = {
        "position": (100 * random.normal(size=(30, 2))).round(3).tolist(),
        "rotation": (100 * random.normal(size=30)).round(3).tolist(),
        "timing": "free",
        "tolerance": 0,
        "mechanisms": "all",
        "prefer": "size",
        "tolerances": {"position": 200, "rotation": 200},
        "budget_ms": budget_ms,
    }
    return json.dumps(body).encode()


def ask(port: int, path: str, body: bytes) -> tuple[int, float, bytes]:
    """Ask on a connection of its own: status (0 if it was cut off), seconds, and the reply."""
    begin = time.perf_counter()
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=120)) as connection:
        try:
            connection.request("POST", path, body, JSON)
            reply = connection.getresponse()
            content = reply.read()
        except (OSError, http.client.HTTPException):
            return 0, time.perf_counter() - begin, b""
    return reply.status, time.perf_counter() - begin, content


@contextmanager
def meanwhile(*work: Callable[[], Any]) -> Iterator[None]:
    """Repeat pieces of work, each in a thread, until the end of the block."""
    over = threading.Event()

    def repeat(job: Callable[[], Any]) -> None:
        while not over.is_set():
            job()

    with ThreadPoolExecutor(len(work)) as pool:
        for job in work:
            pool.submit(repeat, job)
        try:
            yield
        finally:
            over.set()


def milliseconds(values: list[float], *shares: float) -> str:
    return " / ".join(significant(1000 * quantile(values, share)) for share in shares)


def figures(server: Service, matches: list[bytes]) -> dict[str, str]:
    """The figures of a running service that both versions have."""
    found = {"seconds until ready": significant(server.ready_seconds)}
    port, example = server.port, json.dumps(worked_example()).encode()
    idle = server.shared_out()
    for name, path, bodies in (
        ("`/livez`", "/livez", [None]),
        ("match", "/v2/match", matches),
        ("worked example", "/v2/synthesize", [example]),
    ):
        service.drive([port], path, bodies, 1, 1.0)
        load, _ = service.drive([port], path, bodies, 1, ALONE_SECONDS)
        found[f"one client, {name}: ms, median / 99 %"] = milliseconds(load.seconds, 0.5, 0.99)
    load, beats = service.drive([port], "/v2/match", matches, 64, CROWD_SECONDS)
    served = [seconds for seconds, status in zip(load.seconds, load.status) if status == 200]
    found["64 clients, matches for 20 s: other answers than 200"] = str(len(load.status) - len(served))
    found["the same: answers a second"] = significant(len(served) / load.elapsed)
    found["the same: ms, 99 %"] = milliseconds(served, 0.99)
    found["the same: `/livez`, ms, 99 %"] = milliseconds(beats, 0.99)
    seen: list[float] = []
    search = partial(ask, port, "/v2/synthesize", noise(BUDGET_MS))
    with meanwhile(*[lambda: seen.append(float(json.loads(search()[2])["report"]["elapsed_ms"]["total"]))] * 4):
        load, beats = service.drive([port], "/v2/match", matches, 2, BESIDE_SECONDS)
    found["beside 4 searches of 3 s, 2 clients, matches: ms, median / 99 %"] = milliseconds(load.seconds, 0.5, 0.99)
    found["the same: `/livez` beside the searches, ms, 99 %"] = milliseconds(beats, 0.99)
    found["the same: longest search, times its budget"] = f"{max(seen) / BUDGET_MS:.2f}"
    found["from a client's leaving to the next search: ms, median / largest"] = milliseconds(left(port), 0.5, 1.0)
    server.connection.close()  # the service may have closed it meanwhile
    for body in itertools.islice(itertools.cycle(matches), AFTER):
        server.ask("POST", "/v2/match", body)
    found[f"memory of all processes: MB, at first / after {AFTER:,} requests"] = (
        f"{idle / 1e6:.0f} / {server.shared_out() / 1e6:.0f}"
    )
    found[f"{LARGEST} of the largest requests at once: MB, peak"] = f"{largest(server) / 1e6:.0f}"
    return found


def left(port: int) -> list[float]:
    """Seconds from a client's leaving until the next search of noise begins, while there is room for one search."""
    found = []
    for _ in range(10):
        with closing(http.client.HTTPConnection("127.0.0.1", port)) as connection:
            connection.request("POST", "/v2/synthesize", noise(20_000), JSON)
            time.sleep(0.4)
        _, seconds, content = ask(port, "/v2/synthesize", noise(300))
        found.append(max(0.0, seconds - json.loads(content)["report"]["elapsed_ms"]["total"] / 1000))
    return found


def largest(service: Service) -> int:
    """Peak bytes of all processes while the largest requests are asked at the same time."""
    peak = 0

    def look() -> None:
        nonlocal peak
        peak = max(peak, service.shared_out())
        time.sleep(0.1)

    selected = sorted(requests().values(), key=lambda request: -len(request.content))[:LARGEST]
    with meanwhile(look), ThreadPoolExecutor(LARGEST) as pool:
        list(pool.map(lambda request: ask(service.port, request.path, request.content), selected))
    return peak


def killed(service: Service, matches: list[bytes]) -> dict[str, str]:
    """Kill a worker; return the number of requests that fail and the time until the worker is replaced."""
    workers = lambda: set(service.processes()[3:])  # noqa: E731 - after the service, the tracker and the fork server
    before, seen = workers(), list[int]()
    bodies = itertools.cycle(matches)
    with meanwhile(*[lambda: seen.append(ask(service.port, "/v2/match", next(bodies))[0])] * 16):
        time.sleep(1.0)
        os.kill(min(before), signal.SIGKILL)
        begin = time.perf_counter()
        while len(workers() - {min(before)}) < len(before) and time.perf_counter() - begin < 30:
            time.sleep(0.01)
        replaced = time.perf_counter() - begin
        time.sleep(2.0)
    return {
        "a worker is killed beside 16 clients: requests that fail": str(sum(status != 200 for status in seen)),
        "the same: seconds until it is replaced": f"{replaced:.2f}",
    }


def ended(service: Service) -> dict[str, str]:
    """End the service while it searches; return the time that this takes."""
    with ThreadPoolExecutor(2) as pool:
        for _ in range(2):
            pool.submit(ask, service.port, "/v2/synthesize", noise(25_000))
        time.sleep(1.0)
        begin = time.perf_counter()
        service.process.send_signal(signal.SIGTERM)
        service.process.wait(60)
    return {"SIGTERM with 2 searches under way: seconds until it has ended": f"{time.perf_counter() - begin:.1f}"}


def measured(root: Path, atlas: Path, also_killed: bool) -> dict[str, str]:
    """All figures of the version in a folder."""
    python = sys.executable if root == ROOT else str(root / ".venv" / "bin" / "python")
    matches = service.match_bodies(50)

    def command(port: int) -> list[str]:
        return [python, "-m", "app.start", "serve", "--port", str(port), "--workers", "2"]

    with service.running(command, root, atlas=atlas.resolve()) as server:
        server.need_ready()
        found = figures(server, matches)
        if also_killed:
            found |= killed(server, matches)
        return found | ended(server)


def measure(
    atlas: Annotated[Path, "the atlas"] = Path("atlas.h5"),
    before: Annotated[Path | None, "a checkout of another version, with its own .venv and atlas.h5"] = None,
) -> Iterator[dict[str, Any]]:
    """Measure the other version, if it is given, and then this version."""
    old = measured(before, before / "atlas.h5", also_killed=False) if before else {}
    now = measured(ROOT, atlas, also_killed=True)
    yield {"rows": [{"name": name, "before": old.get(name, "-"), "now": value} for name, value in now.items()]}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/reliability.md."""
    return report.tables("reliability", {"figures": results["rows"]})


if __name__ == "__main__":
    report.run(measure)
