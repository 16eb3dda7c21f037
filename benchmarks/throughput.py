"""Throughput of a service: ``python -m benchmarks.throughput [--atlas FILE]``.

The service has a single worker or two workers and defaults for all other settings. Clients keep their connections and send the
next request after each reply. Then services of both sizes run side by side and get requests in turn, so that a drift of the
machine affects both.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

from benchmarks import report, service
from benchmarks.figures import curve, figure
from benchmarks.report import significant

ONE_WORKER, TWO = "`--workers 1`", "`--workers 2`"
ARRANGEMENTS = {ONE_WORKER: (1, 1), TWO: (2, 1)}
"""Workers, and how many times the service is started."""
CLIENTS = (1, 8, 64)
COMPARED = CLIENTS[1:]
ROUNDS = 4
"""Number of alternating parts of the comparison, which share `--seconds`."""
BODIES = 200
UNKNOWN = dict.fromkeys(("p50_ms", "p99_ms", "livez_p99_ms", "service_cores", "front_ms"))
"""Default of a row without answered requests, or for values that the system does not provide."""


def summarise(load: service.Load, beats: Sequence[float]) -> dict[str, Any]:
    """Measure a run; latencies are the latencies of requests with status 200."""
    served = [seconds for seconds, status in zip(load.seconds, load.status) if status == 200]
    row: dict[str, Any] = {
        "replies": len(load.status),
        "served": len(served),
        "elapsed_s": load.elapsed,
        "per_second": len(served) / load.elapsed,
        "client_cores": load.client_cpu / load.elapsed,
    }
    for name, values in (("", served), ("livez_", beats)):
        if values:
            row |= {
                f"{name}p50_ms": 1000 * service.quantile(values, 0.5),
                f"{name}p99_ms": 1000 * service.quantile(values, 0.99),
            }
    return row


def measure_load(
    services: Sequence[service.Service], path: str, *load: Any, clients: int, **options: Any
) -> dict[str, Any]:
    """One run of clients: `summarise`, the processor time of all services per second, and the busiest process's share of it."""

    def spent() -> dict[int, float]:
        return {process: seconds for server in services for process, seconds in server.cpu_seconds().items()}

    before = spent()
    found, beats = service.drive([server.port for server in services], path, *load, clients=clients, **options)
    used = [seconds - before.get(process, 0.0) for process, seconds in spent().items()]
    row = {"path": path, "clients": clients} | summarise(found, beats)
    if used:  # none without /proc
        row |= {"service_cores": sum(used) / found.elapsed, "busiest_share": max(used) / max(sum(used), 1e-9)}
        fronts = {server.processes()[1] for server in services}
        in_front = sum(
            seconds - before.get(process, 0.0) for process, seconds in spent().items() if process in fronts
        )
        row["front_ms"] = 1000 * in_front / len(found.status)
    print(json.dumps(row), flush=True)
    return row


def run(workers: int, times: int, atlas: Path, bodies: dict[str, list], seconds: float) -> dict[str, Any]:
    """One arrangement: requests to each route from few and many clients."""
    with ExitStack() as stack:
        services = [
            stack.enter_context(service.running(service.serve_command, atlas=atlas.resolve(), workers=workers))
            for _ in range(times)
        ]
        for server in services:
            server.need_ready()
        for path, contents in bodies.items():  # what the first requests prepare is not to be measured
            service.drive([server.port for server in services], path, contents, 4, seconds / 5)
        row: dict[str, Any] = {"livez": measure_load(services, "/livez", [None], clients=8, seconds=seconds / 5)}
        row["loads"] = [
            measure_load(services, path, contents, clients=clients, seconds=seconds)
            for path, contents in bodies.items()
            for clients in CLIENTS
        ]
        row["bytes"] = sum(server.shared_out() for server in services) or None
        row["worker_bytes"] = max((own for server in services for own in server.own()[2:]), default=None)
    return row


def compare(atlas: Path, bodies: dict[str, list], seconds: float) -> list[dict[str, Any]]:
    """Compare the requests per second of a single worker and of two workers in alternating runs."""
    rows = []
    with ExitStack() as stack:
        both = [
            stack.enter_context(service.running(service.serve_command, atlas=atlas.resolve(), workers=workers))
            for workers in (1, 2)
        ]
        for server in both:
            server.need_ready()
        for path, contents in bodies.items():
            for server in both:  # what the first requests prepare is not to be measured
                service.drive([server.port], path, contents, 4, seconds / 5)
            for clients in COMPARED:
                rates: tuple[list[float], list[float]] = [], []
                for rate, server in report.in_turn(zip(rates, both), ROUNDS):
                    found = measure_load([server], path, contents, clients=clients, seconds=seconds / ROUNDS)
                    rate.append(found["per_second"])
                ratios = [two / first for first, two in zip(*rates)]
                rows.append({"path": path, "clients": clients, "ratio": report.spread(ratios)})
    return rows


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of requests in docs/background/measurements.md."""
    services = results["services"]

    rows = [UNKNOWN | {"service": entry["service"], **load} for entry in services for load in entry["loads"]]
    rows.sort(key=lambda row: row["path"])  # stable: the order of services stays
    return report.tables("throughput", {"loads": rows}) | {"ratios": ratios_text(results)}


def draw(results: dict[str, Any]) -> None:
    """Draw the requests per second of both routes over the number of clients."""
    with figure("throughput.svg", 1, 2, (9, 3.4), sharey=True) as (_, panels):
        for axes, path in zip(panels, ("/v2/match", "/v2/synthesize")):
            for entry in results["services"]:
                loads = [load for load in entry["loads"] if load["path"] == path]
                curve(axes, loads, "clients", "per_second", "o-", label=entry["service"].strip("`"))
            axes.set(title=path, xlabel="clients", xscale="log")
            axes.set_xticks([1, 8, 64], ["1", "8", "64"])
            axes.minorticks_off()
        fastest = max(load["per_second"] for entry in results["services"] for load in entry["loads"])
        panels[0].set(ylabel="replies per second", ylim=(0, 1.1 * fastest))
        panels[0].legend()


def ratios_text(results: dict[str, Any]) -> str:
    """Describe the ratio of the throughput of two workers to a single worker."""
    medians = [row["ratio"]["median"] for row in results["compared"]]
    return (
        f"Asked in turn, {ROUNDS} runs of {significant(results['seconds'] / ROUNDS)} s each, two workers answer "
        f"{report.ends(medians, 2)} times the requests that one does (medians of 8 and 64 clients)."
    )


def measure(
    atlas: Annotated[Path | None, "the default atlas; built anew if not given"] = None,
    seconds: Annotated[float, "of each run"] = 10.0,
) -> Iterator[dict[str, Any]]:
    """All arrangements."""
    bodies = {"/v2/match": service.match_bodies(BODIES), "/v2/synthesize": service.synthesize_bodies(BODIES)}
    with tempfile.TemporaryDirectory() as folder:
        if atlas is None:
            atlas = Path(folder) / "atlas.h5"
            service.build(atlas)
        rows = [{"service": name, **run(*how, atlas, bodies, seconds)} for name, how in ARRANGEMENTS.items()]
        compared = compare(atlas, bodies, seconds)
    yield {"seconds": seconds, "services": rows, "compared": compared}


if __name__ == "__main__":
    report.run(measure)
