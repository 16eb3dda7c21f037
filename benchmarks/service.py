"""The real build and the real service as processes of their own: started as the documents say, measured from outside.

The clients of `drive` run in a process of their own, so that they do not share the interpreter with what measures; they speak
just enough HTTP/1.1 to be cheap beside a service on the same cores.
"""

from __future__ import annotations

import asyncio
import http.client
import itertools
import json
import multiprocessing
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.product import TURN, coupler_angle
from benchmarks.report import ROOT
from tests.oracles.classes import SAMPLES, base_order, generator, make_case

START_SECONDS = 1800.0
"""Longest wait for a service's first answer."""
BEAT_SECONDS = 0.05
_JSON = {"Content-Type": "application/json"}


def quantile(values: Sequence[float], share: float) -> float:
    """The smallest value that at least this share of all does not exceed; of fewer than 100 values, 0.99 gives the largest."""
    return float(np.quantile(values, share, method="inverted_cdf"))


def match_bodies(count: int) -> list[bytes]:
    """Return bodies for /v2/match: reachable rotations at 32 samples over 20 to 300 degrees, the best 10 rows; seeded.

    They come from crank-rockers with L1 < L2 < L3 < L4 of real lengths, which lie on no integer lattice: an atlas contains a
    similar linkage, the more similar the finer it is. A smaller count gives the first bodies of a larger count.
    """
    bodies = []
    for seed in range(count):
        random = generator("service", seed)
        lengths = base_order(random)
        span = random.uniform(20, 300)
        crank = random.uniform(0, TURN) + np.linspace(0, np.deg2rad(span), SAMPLES)
        rotation = np.rad2deg(coupler_angle(lengths, random.choice([-1, 1]), crank))
        bodies.append(json.dumps({"rotation": rotation.tolist(), "crank_span": span, "top": 10}).encode())
    return bodies


def synthesize_bodies(count: int) -> list[bytes]:
    """Bodies for /v2/synthesize: cases of the class "plain", refined, as `classes` makes them; seeded."""
    return [json.dumps(make_case("plain", seed).request).encode() for seed in range(count)]


BETWEEN = """import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
sys.stdout.buffer.write(done.stdout)
print(json.dumps([used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss]))
sys.exit(done.returncode)
"""
"""Helper that starts a command. On Linux the peak memory of a process starts at the memory of its small parent."""


def spent(*words: str, **settings: Any) -> tuple[bytes, float, int]:
    """Return the output of a command, its processor seconds, and the peak memory of the largest of its processes in bytes."""
    command = [sys.executable, "-c", BETWEEN, sys.executable, *words]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, env=environment(**settings), check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} failed with exit code {done.returncode}")
    written, _, last = done.stdout.rstrip().rpartition(b"\n")
    return (written, *json.loads(last))


def build(out: Path, **options: Any) -> dict[str, Any]:
    """Build an atlas by the command in a process of its own: seconds, memory of the largest of its processes, bytes, types."""
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    begin = time.perf_counter()
    built, _, peak = spent("-m", "app.start", "build", *words, "--out", str(out), "--json")
    return {
        "types": json.loads(built)["types"],
        "build_s": time.perf_counter() - begin,
        "build_peak_bytes": peak,
        "file_bytes": out.stat().st_size,
    }


class Answer(NamedTuple):
    """One reply."""

    status: int
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Service:
    """A running service."""

    process: subprocess.Popen[bytes]
    port: int
    log: Path
    connection: http.client.HTTPConnection
    """Kept; a request after it was closed opens it again."""
    ready_seconds: float = np.nan
    """From the start of the process to its first answer at /readyz."""
    ready: Answer | None = None

    def ask(self, method: str, path: str, body: bytes | None = None) -> Answer:
        """Return the reply to a request on the persistent connection."""
        self.connection.request(method, path, body, _JSON if body else {})
        reply = self.connection.getresponse()
        return Answer(reply.status, reply.read())

    def need_ready(self) -> None:
        """RuntimeError where the first answer said that the service is not ready."""
        if self.ready.status != 200:
            raise RuntimeError(f"the service is not ready: {self.ready.body.decode()}")

    def processes(self) -> list[int]:
        """Return the process ids of the service, its main process first; only the main process without /proc."""
        return [self.process.pid, *_below(self.process.pid)]

    def peak(self) -> int | None:
        """Return the peak bytes of its first process, which loads everything; None without /proc."""
        return _bytes(_proc(self.process.pid, "status"), "VmHWM") or None

    def each(self, key: str) -> dict[int, int]:
        """Return bytes of a kind of each process, by its number; 0 if it has ended."""
        texts = {process: _proc(process, "status") for process in self.processes()}
        return {process: _bytes(text, key) for process, text in texts.items()}

    def shared_out(self) -> int:
        """Bytes of all its processes together: what several share is counted once. 0 without /proc."""
        return sum(_bytes(_proc(process, "smaps_rollup"), "Pss") for process in self.processes())

    def own(self) -> list[int]:
        """Bytes that each process shares with no other."""
        texts = [_proc(process, "smaps_rollup") for process in self.processes()]
        return [_bytes(text, "Private_Clean") + _bytes(text, "Private_Dirty") for text in texts]

    def cpu_seconds(self) -> dict[int, float]:
        """Processor time of each of its processes until now; empty without /proc."""
        found = {process: _times(process) for process in self.processes()}
        return {process: sum(times[:2]) for process, times in found.items() if times}


def _below(process: int) -> list[int]:
    """Return the children of all threads of a process, and theirs."""
    lists = Path(f"/proc/{process}/task").glob("*/children")
    children = sorted(int(child) for each in lists for child in each.read_text().split())
    return [each for child in children for each in (child, *_below(child))]


def _times(process: int) -> list[float]:
    """Seconds of a process in itself and in the system, and of its children that have ended."""
    words = _proc(process, "stat").rpartition(")")[2].split()
    return [int(word) / os.sysconf("SC_CLK_TCK") for word in words[11:15]]


def _bytes(text: str, key: str) -> int:
    found = re.search(rf"^{key}:\s*(\d+)", text, re.MULTILINE)
    return 1024 * int(found[1]) if found else 0


def _proc(process: int, name: str) -> str:
    try:
        return Path(f"/proc/{process}/{name}").read_text()
    except OSError:
        return ""


def serve_command(port: int) -> list[str]:
    """Return the command of the container: the script `linkage-atlas`, by this interpreter."""
    return [sys.executable, "-m", "app.start", "serve", "--host", "127.0.0.1", "--port", str(port)]


def environment(**settings: Any) -> dict[str, str]:
    """Return the environment of this process with given settings of the service, all others at their defaults.

    Compiled modules are cached, as in an installation; otherwise each start would compile all of them.
    """
    excluded = ("LINKAGE_ATLAS_", "PYTHONDONTWRITEBYTECODE")
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(excluded)}
    variables = {f"LINKAGE_ATLAS_{name.upper()}": str(value) for name, value in settings.items()}
    return {**inherited, "OMP_NUM_THREADS": "1", **variables}


@contextmanager
def running(command: Callable[[int], list[str]], root: Path = ROOT, **settings: Any) -> Iterator[Service]:
    """A service from its first answer at /readyz to the end of the block.

    Parameters
    ----------
    command : callable
        ``command(port)``, the command's words.
    root : Path
        The checkout that is measured.
    **settings
        Of `app.settings.Settings`; the others are at their defaults.

    Raises
    ------
    RuntimeError
        The process ended, or answered nothing for half an hour; with the end of its log.
    """
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))  # a port that nothing listens on
            port = probe.getsockname()[1]
        begin, options = (
            time.perf_counter(),
            {"cwd": root, "env": environment(**settings), "stderr": subprocess.STDOUT},
        )
        with log.open("wb") as file:
            process = subprocess.Popen(command(port), stdout=file, **options)
        service = Service(process, port, log, http.client.HTTPConnection("127.0.0.1", port))
        try:
            service.ready = _first_answer(service, begin)
            service.ready_seconds = time.perf_counter() - begin
            yield service
        finally:
            service.connection.close()
            process.terminate()
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:
                process.kill()
                raise


def _first_answer(service: Service, begin: float) -> Answer:  # it loads its atlas before it listens: this is final
    while time.perf_counter() - begin < START_SECONDS:
        if service.process.poll() is not None:
            break
        try:
            return service.ask("GET", "/readyz")
        except OSError:
            service.connection.close()
        time.sleep(0.01)
    raise RuntimeError(f"the service did not answer:\n{service.log.read_text()[-2000:]}")


class Load(NamedTuple):
    """Results of a number of clients; the lists have an entry for each reply."""

    status: list[int]
    seconds: list[float]
    retry_after: list[float | None]
    elapsed: float
    """Seconds from the first request to the last reply."""
    client_cpu: float
    """Processor seconds of all clients together."""


async def _ask(connection: Any, path: str, body: bytes | None) -> tuple[int, float | None]:
    """Return Status and Retry-After of a complete reply; without a body GET, otherwise POST."""
    reader, writer = connection
    head = f"{'GET' if body is None else 'POST'} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    if body is not None:
        head += f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n"
    writer.write(head.encode() + b"\r\n" + (body or b""))
    first, *lines = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
    fields = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    await reader.readexactly(int(fields["content-length"]))
    after = fields.get("retry-after")
    return int(first.split()[1]), float(after) if after else None


async def _clients(
    ports: Sequence[int], path: str, bodies: Sequence[bytes | None], clients: int, seconds: float, patient: bool
) -> Load:
    opened = [await asyncio.open_connection("127.0.0.1", ports[number % len(ports)]) for number in range(clients)]
    seen: list[tuple[int, float, float | None]] = []
    cpu, begin = time.process_time(), time.perf_counter()
    end = begin + seconds

    async def client(turn: int, connection: Any) -> None:
        while time.perf_counter() < end:
            sent = time.perf_counter()
            status, after = await _ask(connection, path, bodies[turn % len(bodies)])
            seen.append((status, time.perf_counter() - sent, after))
            turn += clients
            if patient and status == 503:
                await asyncio.sleep(min(after or 0.0, max(end - time.perf_counter(), 0.0)))

    await asyncio.gather(*(client(number, connection) for number, connection in enumerate(opened)))
    elapsed, used = time.perf_counter() - begin, time.process_time() - cpu
    for _, writer in opened:
        writer.close()
    return Load(*map(list, zip(*seen)), elapsed, used)


def _run_clients(*arguments: Any) -> Load:
    return asyncio.run(_clients(*arguments))


async def _beats(ports: Sequence[int], over: Callable[[], bool]) -> list[float]:
    seconds: list[float] = []

    async def beat(due: float, port: int) -> None:
        connection = await asyncio.open_connection("127.0.0.1", port)
        await _ask(connection, "/livez", None)
        seconds.append(time.perf_counter() - due)  # from when it was due: a late start is waiting too
        connection[1].close()

    due = time.perf_counter()
    async with asyncio.TaskGroup() as group:
        for port in itertools.takewhile(lambda _: not over(), itertools.cycle(ports)):
            group.create_task(beat(due, port))
            due += BEAT_SECONDS
            await asyncio.sleep(max(due - time.perf_counter(), 0))
    return seconds


def drive(
    ports: Sequence[int],
    path: str,
    bodies: Sequence[bytes | None],
    clients: int,
    seconds: float,
    patient: bool = False,
) -> tuple[Load, list[float]]:
    """Run a closed loop of clients in a separate process, and record the replies of /livez during it.

    Parameters
    ----------
    ports : sequence of int
        Port of each service; clients are distributed evenly.
    path : str
    bodies : sequence of bytes or None
        Bodies used in turn, from a different start for each client; None: GET.
    clients : int
        Number of persistent connections; each client sends the next request as soon as it has a reply.
    seconds : float
        Duration in which new requests are sent; outstanding replies are awaited.
    patient : bool
        True if a client waits after status 503 for the time in ``Retry-After``; otherwise it sends the request again at once.

    Returns
    -------
    Load
    beats : list of float
        Seconds of GET /livez every 50 ms, each on a separate connection.
    """
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        pool.submit(os.getpid).result()  # its start is not to be measured
        future = pool.submit(_run_clients, ports, path, bodies, clients, seconds, patient)
        beats = asyncio.run(_beats(ports, future.done))
        return future.result(), beats
