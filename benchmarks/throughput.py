"""How many requests a service answers, and what it does with too many: ``python -m benchmarks.throughput [--atlas FILE]``.

Three arrangements, all settings at their defaults: one service as the container runs it; two of them, as
``docker compose up --scale atlas=2`` runs them, their clients dealt out evenly; and one of two workers that share a socket, as
docs/http.md says for a machine without containers. Clients keep their connections and ask again as soon as they are answered.
Writes ``benchmarks/results/throughput.json``, and with `scaling` the tables of ``docs/scaling.md``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import scaling
from benchmarks.service import (
    ROOT,
    Load,
    Service,
    drive,
    environment,
    machine,
    match_bodies,
    quantile,
    running,
    serve_command,
    synthesize_bodies,
    uvicorn_command,
)

ARRANGEMENTS = {
    "one service": (serve_command, 1, 1),
    "two services": (serve_command, 1, 2),
    "`--workers 2`": (partial(uvicorn_command, workers=2), 2, 1),
}
"""Command, workers that it starts, and how many times it is started."""
CLIENTS = (1, 8, 64)
OVERLOAD_CLIENTS = 200
BODIES = 200


def summarise(load: Load, beats: Sequence[float]) -> dict[str, Any]:
    """The figures of one run; latencies are those of the requests that were answered with 200."""
    served = [seconds for seconds, status in zip(load.seconds, load.status) if status == 200]
    refused = [after for after, status in zip(load.retry_after, load.status) if status == 503]
    row: dict[str, Any] = {
        "replies": len(load.status),
        "served": len(served),
        "elapsed_s": load.elapsed,
        "per_second": len(served) / load.elapsed,
        "share_503": len(refused) / len(load.status),
        "with_retry_after": sum(after is not None for after in refused),
        "others": len(load.status) - len(served) - len(refused),
        "client_cores": load.client_cpu / load.elapsed,
        "livez_replies": len(beats),
    }
    for name, values in (("", served), ("livez_", beats)):
        if values:
            row |= {f"{name}p50_ms": 1000 * quantile(values, 0.5), f"{name}p99_ms": 1000 * quantile(values, 0.99)}
    return row


def measure(
    services: Sequence[Service],
    path: str,
    bodies: Sequence[bytes | None],
    clients: int,
    seconds: float,
    patient: bool = False,
) -> dict[str, Any]:
    """One run of clients: `summarise`, the processor time of all services per second, and the busiest process's share of it."""

    def spent() -> dict[int, float]:
        return {process: seconds for service in services for process, seconds in service.cpu_seconds().items()}

    before = spent()
    load, beats = drive([service.port for service in services], path, bodies, clients, seconds, patient)
    used = [seconds - before.get(process, 0.0) for process, seconds in spent().items()]
    row = {"path": path, "clients": clients} | summarise(load, beats)
    if used:  # none without /proc
        row |= {"service_cores": sum(used) / load.elapsed, "busiest_share": max(used) / max(sum(used), 1e-9)}
    return row


def run(
    command: Callable[[int], list[str]],
    workers: int,
    times: int,
    atlas: Path,
    bodies: dict[str, list[bytes]],
    seconds: float,
) -> dict[str, Any]:
    """One arrangement: requests to each route from few and many clients, then from too many."""
    rows: list[dict[str, Any]] = []

    def measured(*arguments: Any, **options: Any) -> dict[str, Any]:
        rows.append(measure(services, *arguments, **options))
        print(json.dumps(rows[-1]), flush=True)
        return rows[-1]

    with ExitStack() as stack:
        services = [stack.enter_context(running(command, workers, atlas=atlas.resolve())) for _ in range(times)]
        for service in services:
            if service.ready.status != 200:
                raise RuntimeError(f"the service is not ready: {service.ready.body.decode()}")
        for path, some in bodies.items():  # what the first requests prepare is not to be measured
            drive([service.port for service in services], path, some, 4, seconds / 5)
        livez = measured("/livez", [None], 8, seconds / 5)
        loads = [measured(path, some, clients, seconds) for path, some in bodies.items() for clients in CLIENTS]
        overload = [
            {"patient": patient} | measured(path, some, OVERLOAD_CLIENTS, seconds, patient=patient)
            for path, some in bodies.items()
            for patient in (True, False)
        ]
        peak = [service.memory("VmHWM") for service in services]
    return {
        "peak_bytes": None if None in peak else sum(peak),
        "livez": livez,
        "loads": loads,
        "overload": overload,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, write the numbers and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--atlas", type=Path, help="the default atlas; built anew if not given")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run (%(default)s)")
    options = parser.parse_args(arguments)
    bodies = {"/v1/match": match_bodies(BODIES), "/v1/synthesize": synthesize_bodies(BODIES)}
    result: dict[str, Any] = {"machine": machine(), "seconds": options.seconds, "services": []}
    with tempfile.TemporaryDirectory() as folder:
        atlas = options.atlas
        if atlas is None:
            atlas = Path(folder) / "atlas.h5"
            command = [sys.executable, "-m", "data_build", "--out", str(atlas)]
            subprocess.run(command, check=True, capture_output=True, cwd=ROOT, env=environment())
        for name, (command, workers, times) in ARRANGEMENTS.items():
            result["services"].append(
                {"service": name} | run(command, workers, times, atlas, bodies, options.seconds)
            )
    scaling.THROUGHPUT.write_text(json.dumps(result, indent=1) + "\n")
    scaling.write()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
