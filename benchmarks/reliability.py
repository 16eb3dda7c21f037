"""What the software withstands: ``python -m benchmarks.reliability [--scale SHARE] [--parts ...]``; ``make fault`` runs it whole.

Kills, failing writes, flipped bits and changed bodies are counted; expensive requests are measured against their budget; and
well-meant clients ask beside hostile ones. Each promise is one row of docs/reliability.md.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import http.client
import itertools
import json
import os
import random
import re
import signal
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks import deaths, hostile, report, service
from linkage_atlas import load_atlas
from synthesis.errors import AtlasError

BUDGET_MS = 1000.0
SHARE_OF_BUDGET = 1.2
CLIENTS = 64
LEAVING, LEFT_EACH_SECOND = 2, 90
"""Clients that ask and close at once, and how often each does."""
RELOADING = 8
"""Clients that ask while the service is started anew."""
MEGABYTE = 1e6
EARLY = 1_000
"""Requests after which memory is compared with that after all."""
UNREAD_SECONDS = 20.0


def flips(atlas: Path, count: int) -> dict[str, Any]:
    """Flip bits of an atlas file, one at a time, and load it."""
    data, rng, accepted = bytearray(atlas.read_bytes()), np.random.default_rng(2), 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "atlas.h5"
        path.write_bytes(data)
        with path.open("r+b") as file:
            for place, bit in zip(rng.integers(len(data), size=count).tolist(), rng.integers(8, size=count).tolist()):
                for value in (data[place] ^ 1 << bit, data[place]):
                    file.seek(place)
                    file.write(bytes([value]))
                    file.flush()
                    if value != data[place]:
                        with contextlib.suppress(AtlasError):
                            load_atlas(path)
                            accepted += 1
    return {"flips": count, "accepted": accepted}


def _sent(port: int, count: int, seed: int) -> tuple[dict[str, int], list[str]]:
    """Statuses of changed bodies, and what was answered otherwise than promised."""
    statuses: dict[str, int] = {}
    broken: list[str] = []
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=hostile.PATIENCE)
    bodies = hostile.mutated(seed)
    for _ in range(count):
        path, content = next(bodies)
        connection.request("POST", path, content, {"Content-Type": "application/json"})
        reply = connection.getresponse()
        body = reply.read()
        statuses[str(reply.status)] = statuses.get(str(reply.status), 0) + 1
        is_problem = reply.headers.get_content_type() == "application/problem+json"
        told = reply.status == 200 or (is_problem and json.loads(body)["status"] == reply.status)
        if not told or (reply.status >= 500 and reply.status != 503):
            broken.append(f"{path} {reply.status}: {content[:200]!r}")
    connection.close()
    return dict(sorted(statuses.items())), broken


def bodies(running: service.Service, port: int, count: int) -> dict[str, Any]:
    """Changed bodies over all routes."""
    statuses, broken = _sent(port, count, 3)
    for line in broken[:5]:
        print(line, flush=True)
    return {"bodies": count, "statuses": statuses, "broken": len(broken)}


class Peaks:
    """The most memory that each process took, and how much more that was than before."""

    def __init__(self, running: service.Service) -> None:
        self._running, self._most = running, {}
        for process in running.processes():
            with contextlib.suppress(OSError), open(f"/proc/{process}/clear_refs", "w") as file:
                file.write("5")
        self._before = running.each("VmRSS")
        self._typical = max(list(self._before.values())[1:] or [0])

    def look(self) -> None:
        """To be called again and again: a process may end any time."""
        for process, most in self._running.each("VmHWM").items():
            self._most[process] = max(self._most.get(process, 0), most)

    @property
    def grown(self) -> int:
        """Bytes by which the process that grew most did; one that is new began with as much as those before."""
        return max(
            (most - self._before.get(process, self._typical) for process, most in self._most.items()), default=0
        )


async def _watched(port: int, work: Any, seen: hostile.Seen, look: Callable[[], None]) -> Any:
    """Some work, while /livez is asked."""
    task = asyncio.ensure_future(work)
    while not task.done():
        begin = time.perf_counter()
        status = await hostile.ask(port, "/livez")
        seen.seconds.append(time.perf_counter() - begin)
        seen.status[str(status)] += 1
        look()
        await asyncio.sleep(0.01)
    return task.result()


def budgets(running: service.Service, port: int) -> list[dict[str, Any]]:
    """Each expensive request, alone, against the service's budget of `BUDGET_MS`."""
    rows = []
    running.settle()
    for name, (path, body) in hostile.expensive().items():
        beats, peaks = hostile.Seen(), Peaks(running)
        before, begin = running.computing_seconds(), time.perf_counter()
        status = asyncio.run(_watched(port, hostile.ask(port, path, body), beats, peaks.look))
        wall = time.perf_counter() - begin
        time.sleep(0.3)  # a process that was ended with its request is counted once its place is taken
        row = {
            "request": name,
            "route": path,
            "bytes": len(body),
            "status": status,
            "wall_ms": 1000 * wall,
            "processor_ms": 1000 * (running.computing_seconds() - before),
            "megabytes": peaks.grown / MEGABYTE,
            "livez_p99_ms": 1000 * service.quantile(beats.seconds, 0.99),
        }
        print(json.dumps(row), flush=True)
        rows.append(row)
    return rows


async def _crowd(port: int, seconds: float, with_hostile: bool) -> dict[str, hostile.Seen]:
    """64 clients on a mix of short requests, /livez beside, and one hostile client of each kind.

    The clients know nothing of each other: each begins at a random moment of the first second.
    """
    until = time.perf_counter() + seconds
    seen = {name: hostile.Seen() for name in (*hostile.SHORT, "beat", "hostile", "half closed", "gone")}
    tasks = [hostile.repeat(until, seen["beat"], lambda: hostile.ask(port, "/livez"), 0.02)]
    names, rng = list(hostile.SHORT), random.Random(4)
    for number in range(CLIENTS):
        name = names[number % len(names)]
        path, body = hostile.SHORT[name]
        work = functools.partial(hostile.ask, port, path, body)
        tasks.append(hostile.repeat(until, seen[name], work, pause=1.0, after=rng.random()))
    if with_hostile:
        for path, body in hostile.expensive().values():
            tasks.append(hostile.repeat(until, seen["hostile"], lambda p=path, b=body: hostile.ask(port, p, b), 0.5))
        for said, count, reads in hostile.SLOW.values():
            tasks.append(hostile.hold(port, said, count, until, reads))
        path, body = hostile.SHORT["match"]
        for _ in range(LEAVING):
            gone = functools.partial(hostile.leave, port, path, body)
            tasks.append(hostile.repeat(until, seen["gone"], gone, 1 / LEFT_EACH_SECOND))
        tasks.append(hostile.repeat(until, seen["half closed"], lambda: hostile.ask(port, path, body, True), 0.5))
    await asyncio.gather(*tasks)
    return seen


async def _sampled(work: Any, sample: Callable[[], int]) -> tuple[Any, int]:
    """Some work, and the most that a sample of twice a second was."""
    task, most = asyncio.ensure_future(work), 0
    while not task.done():
        most = max(most, await asyncio.to_thread(sample))
        await asyncio.sleep(0.5)
    return task.result(), most


def crowd(running: service.Service, port: int, seconds: float, with_hostile: bool) -> dict[str, Any]:
    """What the well-meant clients saw, one request a second each."""
    running.settle()
    seen, most = asyncio.run(_sampled(_crowd(port, seconds, with_hostile), running.shared_out))
    short = [value for name in hostile.SHORT if name != "livez" for value in seen[name].seconds]
    statuses: dict[str, int] = {}
    for name in hostile.SHORT:
        for status, count in seen[name].status.items():
            statuses[status] = statuses.get(status, 0) + count
    return {
        "hostile": with_hostile,
        "seconds": seconds,
        "requests": sum(statuses.values()),
        "statuses": statuses,
        "hostile_statuses": dict(seen["hostile"].status),
        "half_closed": dict(seen["half closed"].status),
        "load": os.getloadavg()[0],
        "short_p50_ms": 1000 * service.quantile(short, 0.5),
        "short_p99_ms": 1000 * service.quantile(short, 0.99),
        "livez_p99_ms": 1000 * service.quantile(seen["beat"].seconds, 0.99),
        "megabytes": most / MEGABYTE,
    }


def memory(running: service.Service, port: int, count: int) -> dict[str, Any]:
    """Memory after the first requests, after all of them, and after clients that did not read."""
    mix = [hostile.SHORT[name] for name in ("needle", "lift", "type")] * 16 + [hostile.SHORT["match"]]
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=hostile.PATIENCE)
    found = []
    running.settle()
    for number in range(1, count + 1):
        path, body = mix[number % len(mix)]
        content = body if body is None or isinstance(body, str) else json.dumps(body)
        connection.request("GET" if body is None else "POST", path, content, {"Content-Type": "application/json"})
        connection.getresponse().read()
        if number in (EARLY, count):
            found.append(running.shared_out() / MEGABYTE)
    connection.close()
    until = time.perf_counter() + UNREAD_SECONDS
    asyncio.run(hostile.hold(port, hostile.LARGE, CLIENTS, until, reads=False))
    time.sleep(1.0)
    running.settle()
    unread = running.shared_out() / MEGABYTE
    return {"requests": count, "early_megabytes": found[0], "late_megabytes": found[1], "unread_megabytes": unread}


def ends(atlas: Path) -> list[dict[str, Any]]:
    """Seconds from SIGTERM to the end, whatever is under way."""
    rows = []
    scan = hostile.expensive()["nearly no motion, 1,024 samples"]
    request = f"POST {scan[0]} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: {len(scan[1])}"
    for name, said in (
        ("nothing", b""),
        ("an unfinished body", hostile.HEAD),
        ("a long scan", f"{request}\r\n\r\n{scan[1]}".encode()),
    ):
        with service.running(service.serve_command, atlas=atlas) as running:
            import socket

            with socket.create_connection(("127.0.0.1", running.port)) as client:
                client.sendall(said)
                time.sleep(1.0)
                begin = time.perf_counter()
                running.process.send_signal(signal.SIGTERM)
                code = running.process.wait(60)
                rows.append({"under_way": name, "seconds": time.perf_counter() - begin, "code": code})
    return rows


def reloads(atlas: Path, count: int) -> dict[str, Any]:
    """The service started anew by SIGUSR1, again and again, while clients ask, each request on a connection of its own."""
    statuses: Counter[str] = Counter()
    seconds: list[float] = []
    ended = threading.Event()

    async def client(port: int, names: Iterator[str]) -> None:
        while not ended.is_set():  # Python 3.11 may lose a cancelling
            name = next(names)
            path, body = hostile.SHORT[name]
            begin = time.perf_counter()
            statuses[str(await hostile.ask(port, path, body))] += 1
            seconds.append(time.perf_counter() - begin)
            await asyncio.sleep(0.05)

    async def story(running: service.Service) -> int:
        clients = [
            asyncio.create_task(client(running.port, itertools.cycle(hostile.SHORT))) for _ in range(RELOADING)
        ]
        supervisor = running.process.pid
        for reload in range(count):
            os.kill(supervisor, signal.SIGUSR1)
            while (
                len(fronts := re.findall(r"Started server process \[(\d+)\]", running.log.read_text())) < reload + 2
            ):
                await asyncio.sleep(0.05)
            old, supervisor = supervisor, int(service.status(int(fronts[-1]), "PPid"))
            while old != running.process.pid and service.status(old, "State") not in ("", "Z"):
                await asyncio.sleep(0.05)
            await asyncio.to_thread(running.process.wait)
        ended.set()
        await asyncio.gather(*clients)
        return supervisor

    with service.running(service.serve_command, atlas=atlas) as running:
        last = asyncio.run(story(running))
        os.kill(last, signal.SIGTERM)
        while service.status(last, "State") not in ("", "Z"):
            time.sleep(0.05)
    told = {"reloads": count, "clients": RELOADING, "requests": len(seconds), "statuses": dict(statuses)}
    return told | {"p99_ms": 1000 * service.quantile(seconds, 0.99), "longest_ms": 1000 * max(seconds)}


def _alone(part: Callable[..., Any], atlas: Path, *arguments: Any, **options: Any) -> Any:
    """A part at a service of its own."""
    with service.running(service.serve_command, atlas=atlas, **options) as running:
        return part(running, running.port, *arguments)


PARTS: dict[str, Callable[[Path, Callable[[int], int]], Any]] = {
    "budgets": lambda atlas, some: _alone(budgets, atlas, max_budget_ms=BUDGET_MS),
    "crowds": lambda atlas, some: [
        _alone(crowd, atlas, some(seconds), bad) for seconds, bad in ((120, False), (600, True))
    ],
    "memory": lambda atlas, some: _alone(memory, atlas, max(5 * EARLY, some(100_000))),
    "bodies": lambda atlas, some: _alone(bodies, atlas, some(100_000), max_budget_ms=20),
    "ends": lambda atlas, some: ends(atlas),
    "reloads": lambda atlas, some: reloads(atlas, some(50)),
    "flips": lambda atlas, some: flips(atlas, some(10_000)),
    "kills": lambda atlas, some: deaths.builds(some(1_000)),
    "deaths": lambda atlas, some: deaths.deaths(atlas, some(1_000)),
    "studies": lambda atlas, some: deaths.studies(some(1_000)),
    "disks": lambda atlas, some: deaths.disks(atlas),
}
"""By their names; each takes the atlas, and the number to try for a full number."""


def measure(
    atlas: Annotated[Path | None, "the default atlas; built anew if not given"] = None,
    scale: Annotated[float, "share of the full counts"] = 1.0,
    parts: Annotated[str, "parts of the run; the others stay as they are", tuple(PARTS)] = tuple(PARTS),
) -> Iterator[dict[str, Any]]:
    """The parts in turn; on two idle cores at full scale about two and a half hours.

    Minutes of each: crowds 12, memory 12, bodies, flips 15, kills, deaths 10, studies 50, budgets, reloads,
    disks 2, ends 1.
    """

    def some(full: int) -> int:
        return max(full // 50, round(scale * full))

    stamp = report.stamp()
    kept = report.load("reliability")["parts"] if (report.RESULTS / "reliability.json").exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        if atlas is None:
            atlas = Path(folder) / "atlas.h5"
            service.build(atlas)
        for name in parts:
            begin = time.perf_counter()
            kept[name] = {"made": stamp, "found": PARTS[name](atlas, some)}
            kept[name]["seconds"] = round(time.perf_counter() - begin)
            print(name, kept[name]["seconds"], "s", json.dumps(kept[name]["found"]), flush=True)
            yield {"made": stamp, "parts": kept}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/reliability.md."""
    found = {name: part["found"] for name, part in results["parts"].items()}
    rows: list[tuple[str, str, str, str]] = []
    if kills := found.get("kills"):
        count, wrong = f"{kills['kills']:,} kills", f"{kills['other']} files with other bytes"
        rows.append(("A killed build, started again, ends in the same bytes", "`kills`", count, wrong))
    if deaths_ := found.get("deaths"):
        count = ", ".join(f"{count:,} x {what}" for what, count in sorted(deaths_["kills"].items()))
        told = ", ".join(f"{count:,} x {status}" for status, count in sorted(deaths_["statuses"].items()))
        text = "A service whose processes are killed answers again, and what it answers is right; none is left behind"
        wrong = (
            f"{deaths_['wrong']} wrong, {deaths_['left_behind']} left behind, at most {deaths_['longest_s']:.1f} s"
        )
        rows.append((text, "`deaths`", count, f"{wrong}; {told} (0: cut off)"))
    if studies := found.get("studies"):
        count, wrong = f"{studies['kills']:,} kills", f"{studies['other']} files with other bytes"
        rows.append(("A killed study goes on and ends in the same bytes", "`studies`", count, wrong))
    for row in found.get("disks", []):
        refused = f", {row['refused']} refused" if "refused" in row else ""
        text = f"{row['what'][0].upper()}{row['what'][1:]}: right answers"
        rows.append((text, "`disks`", f"{row['answered']} answers{refused}", f"{row['wrong']} wrong"))
    if flips := found.get("flips"):
        count, wrong = f"{flips['flips']:,} flips", f"{flips['accepted']} accepted"
        rows.append(("A flipped bit of an atlas file is noticed", "`flips`", count, wrong))
    if bodies := found.get("bodies"):
        told = ", ".join(f"{count:,} x {status}" for status, count in bodies["statuses"].items())
        text = "Every changed body is answered or refused as problem+json, never with a fault"
        rows.append((text, "`bodies`", f"{bodies['bodies']:,} bodies", f"{bodies['broken']} otherwise; {told}"))
    if crowds := found.get("crowds"):
        short, bad = crowds
        count = f"{short['requests']:,} requests in {short['seconds']:.0f} s, load average {short['load']:.1f}"
        text = "Short requests of 64 clients, one a second each: 99th percentile at most 250 ms"
        rows.append((text, "`crowds`", count, f"{short['short_p99_ms']:.0f} ms"))
        told = ", ".join(f"{count:,} x {status}" for status, count in sorted(bad["statuses"].items()))
        told_of = f"/livez {bad['livez_p99_ms']:.0f} ms, short requests {bad['short_p99_ms']:.0f} ms; {told}"
        text = "The same beside one hostile client of each kind: /livez at most 50 ms at the 99th percentile"
        count = f"{bad['requests']:,} requests in {bad['seconds']:.0f} s, load average {bad['load']:.1f}"
        rows.append((text, "`crowds`", count, f"{told_of}; at most {bad['megabytes']:.0f} MB in all"))
    if after := found.get("memory"):
        grown = after["late_megabytes"] - after["early_megabytes"]
        text = "Memory does not grow with the number of requests: at most 10 MB more than after the first 1,000"
        told = f"{grown:+.1f} MB"
        if "unread_megabytes" in after:
            grown = after["unread_megabytes"] - after["early_megabytes"]
            told = f"{told}; {grown:+.1f} MB after {CLIENTS} clients that did not read replies of some MB"
        rows.append((text, "`memory`", f"{after['requests']:,} requests", told))
    if after := found.get("reloads"):
        told = ", ".join(f"{count:,} x {status}" for status, count in sorted(after["statuses"].items()))
        count = f"{after['reloads']} times, {after['requests']:,} requests of {after['clients']} clients"
        text = "`systemctl reload` (SIGUSR1) starts the service anew without a refused request"
        rows.append((text, "`reloads`", count, f"{told}; 99th percentile {after['p99_ms']:,.0f} ms"))
    for row in found.get("ends", []):
        count, ended = f"with {row['under_way']} under way", f"{row['seconds']:.1f} s, code {row['code']}"
        rows.append(("SIGTERM ends the service within 5 s", "`ends`", count, ended))
    head = ["promise", "test", "count", "result"]
    budget = [
        (
            row["request"],
            f"`{row['route']}`",
            str(row["status"]),
            f"{row['processor_ms']:,.0f}",
            f"{row['megabytes']:.0f}",
            f"{row['livez_p99_ms']:.0f}",
        )
        for row in found["budgets"]
    ]
    budget_head = ["request", "route", "status", "processor, ms", "memory, MB", "/livez p99, ms"]
    return {
        "promises": report.lines(head, rows, 4),
        "budgets": report.lines(budget_head, budget, 3),
        "made": report.made_text([part["made"] for part in results["parts"].values()]),
    }


if __name__ == "__main__":
    report.run(measure)
