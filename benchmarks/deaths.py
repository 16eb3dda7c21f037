"""What becomes of a service whose processes are killed, whose mapped files are cut short, and whose disk is full.

Parts of ``python -m benchmarks.reliability``. Clients ask all the while, and each answer is compared with the right one.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from benchmarks import hostile, many_requests, service

ASKING = 4
"""Clients, each with a connection a request."""
LIFE = 20
"""Kills of processes of a service before it is killed itself."""
STUDIED = 300
"""Requests of a study."""
BACK_SECONDS = 10.0
"""In which a service must answer again."""


def _answer(port: int, name: str) -> tuple[int, Any]:
    """Status and answer to a short request, without its times; 0 where the connection ended before it."""
    path, body = hostile.SHORT[name]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=hostile.PATIENCE)
    try:
        content = body if body is None or isinstance(body, str) else json.dumps(body)
        connection.request("GET" if body is None else "POST", path, content, {"Content-Type": "application/json"})
        reply = connection.getresponse()
        values = json.loads(reply.read())
    except (OSError, http.client.HTTPException):
        return 0, None
    finally:
        connection.close()
    values.pop("report", None)
    return reply.status, values


class Clients:
    """Clients that ask short requests again and again, and what they saw."""

    def __init__(self, port: int) -> None:
        self._port, self._end = port, threading.Event()
        self.status: Counter[str] = Counter()
        self.wrong = 0
        self.right = {name: _answer(port, name) for name in hostile.SHORT}

    def _ask(self, seed: int) -> None:
        rng = random.Random(seed)
        while not self._end.is_set():
            name = rng.choice(list(hostile.SHORT))
            status, values = _answer(self._port, name)
            self.status[str(status)] += 1
            self.wrong += status == 200 and values != self.right[name][1]
            time.sleep(0.02)

    @contextlib.contextmanager
    def asking(self) -> Iterator[None]:
        """While the block runs."""
        threads = [threading.Thread(target=self._ask, args=(seed,)) for seed in range(ASKING)]
        for one in threads:
            one.start()
        try:
            yield
        finally:
            self._end.set()
            for one in threads:
                one.join()


def _back(running: service.Service) -> float:
    """Seconds until the service answers; infinite where it does not."""
    begin = time.perf_counter()
    while time.perf_counter() - begin < BACK_SECONDS:
        if _answer(running.port, "match")[0] == 200:
            return time.perf_counter() - begin
        time.sleep(0.01)
    return float("inf")


def _front(running: service.Service) -> int:
    return int(re.findall(r"Started server process \[(\d+)\]", running.log.read_text())[-1])


def deaths(atlas: Path, count: int) -> dict[str, Any]:
    """Processes that compute, the front and the supervisor killed at random moments."""
    rng, killed, status = random.Random(5), Counter[str](), Counter[str]()
    wrong, longest, orphans = 0, 0.0, 0
    while killed.total() < count:
        with service.running(service.serve_command, atlas=atlas) as running:
            clients = Clients(running.port)
            with clients.asking():
                for _ in range(min(LIFE - 1, count - killed.total() - 1)):
                    time.sleep(rng.uniform(0.0, 0.3))
                    front = _front(running)
                    others = [one for one in running.processes()[1:] if one != front]
                    what, number = ("front", front) if rng.random() < 0.2 else ("computing", rng.choice(others))
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(number, signal.SIGKILL)
                        killed[what] += 1
                    longest = max(longest, _back(running))
            status, wrong = status + clients.status, wrong + clients.wrong
            children = running.processes()[1:]
            os.kill(running.process.pid, signal.SIGKILL)
            running.process.wait()
            killed["supervisor"] += 1
            time.sleep(2.0)
            orphans += sum(service.status(one, "State") not in ("", "Z") for one in children)
    told = {"kills": dict(killed), "statuses": dict(status), "wrong": wrong, "longest_s": longest}
    return told | {"left_behind": orphans}


def _interrupted(
    command: list[str], made: Callable[[], Any], remove: Callable[[], None], count: int
) -> dict[str, Any]:
    """A command killed at random moments and run again; what those runs make that end is compared with that of the first."""

    def run() -> subprocess.Popen[bytes]:
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": service.environment()}
        return subprocess.Popen([sys.executable, "-m", *command], cwd=service.ROOT, **silent)

    rng, kills, finished, other = random.Random(6), 0, 0, 0
    begin = time.perf_counter()
    run().wait()
    whole, wanted = time.perf_counter() - begin, made()
    remove()
    while True:
        process = run()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(rng.uniform(0.1, 1.2) * whole if kills < count else None)
        if process.returncode is None:
            process.kill()
            process.wait()
            kills += 1
            continue
        other += made() != wanted
        finished += 1
        if kills >= count:
            return {"kills": kills, "finished": finished, "other": other}
        remove()


def builds(count: int) -> dict[str, Any]:
    """Builds of an atlas."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "atlas.h5"
        command = ["data_build", "--out", str(out), "--perimeter", "300", "--samples", "32", "--jobs", "2"]
        return _interrupted(command, out.read_bytes, out.unlink, count)


def studies(count: int) -> dict[str, Any]:
    """Studies of some hundred requests, which go on from what is written."""
    with tempfile.TemporaryDirectory() as name:
        asked, out = Path(name) / "requests.ndjson", Path(name) / "results.ndjson"
        asked.write_bytes(b"\n".join(many_requests.bodies(STUDIED)) + b"\n")
        command = ["app.start", "study", str(asked), "--out", str(out), "--no-preset", "--jobs", "2"]
        return _interrupted(command, out.read_bytes, out.unlink, count)


@contextlib.contextmanager
def _disk(size: int) -> Iterator[Path | None]:
    """A disk of so many bytes in memory; None where we may not mount one."""
    with tempfile.TemporaryDirectory() as name:
        mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", name]
        if subprocess.run(mount, stderr=subprocess.DEVNULL).returncode:
            yield None
            return
        try:
            yield Path(name)
        finally:
            subprocess.run(["umount", name], check=True)


def _gone_on(what: str, command: Callable[[Path], list[str]]) -> Iterator[dict[str, Any]]:
    """A command on a disk with room for half of what it makes, and again once there is room."""

    def run(out: Path) -> int:
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": service.environment()}
        return subprocess.run([sys.executable, "-m", *command(out)], cwd=service.ROOT, **silent).returncode

    with tempfile.TemporaryDirectory() as name:
        wanted = Path(name) / "wanted"
        run(wanted)
        size = wanted.stat().st_size
        with _disk(size // 2) as disk:
            if disk is not None:
                failed = run(disk / "made")
                subprocess.run(["mount", "-o", f"remount,size={8 * size}", str(disk)], check=True)
                fine = failed and run(disk / "made") == 0 and (disk / "made").read_bytes() == wanted.read_bytes()
                yield {
                    "what": f"a disk that is full during {what}, which goes on",
                    "answered": 1,
                    "wrong": int(not fine),
                }


def disks(atlas: Path) -> list[dict[str, Any]]:
    """Answer on disks that are full, build and study on disks that become full."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name) / "atlas.h5"
        shutil.copy(atlas, copy)
        with service.running(service.serve_command, atlas=copy) as running:
            right = Clients(running.port).right
        with service.running(service.serve_command, atlas=copy) as running:
            rows.append({"what": "a second service of the same file", **_compared(running, right)})
    with _disk(atlas.stat().st_size + 1_000_000) as disk:
        if disk is not None:
            full = disk / "atlas.h5"
            shutil.copy(atlas, full)
            cache = mock.patch.dict(os.environ, XDG_CACHE_HOME=str(disk))
            with cache, service.running(service.serve_command, atlas=full) as running:
                running.settle()
                rows.append({"what": "a disk with room for the atlas alone", **_compared(running, right)})
    build = ["data_build", "--perimeter", "200", "--samples", "32", "--jobs", "2", "--out"]
    rows += _gone_on("a build", lambda out: [*build, str(out)])
    with tempfile.TemporaryDirectory() as name:
        asked = Path(name) / "requests.ndjson"
        asked.write_bytes(b"\n".join(many_requests.bodies(STUDIED)) + b"\n")
        rows += _gone_on("a study", lambda out: ["app.start", "study", str(asked), "--out", str(out), "--no-preset"])
    return rows


def _compared(running: service.Service, right: dict[str, Any]) -> dict[str, int]:
    answers = {short: _answer(running.port, short) for short in hostile.SHORT}
    return {"answered": len(answers), "wrong": sum(answers[k] != right[k] for k in right)}
