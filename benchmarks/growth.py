"""How build, index, start, memory and requests grow with the atlas: ``python -m benchmarks.growth [--perimeters 100 200 ...]``.

Every atlas is built, prepared, served and asked by processes of their own, as users run them; the requests are the same for
all. Perimeter 800 has 850,000 types and takes 6 GB of disk meanwhile; nothing else should run.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tqdm import tqdm

from benchmarks import report
from benchmarks.figures import curve, figure
from benchmarks.index import ANY_SIZE, make
from benchmarks.product import MAX_PERIMETER
from benchmarks.report import Times
from benchmarks.service import build, match_bodies, quantile, running, serve_command

PERIMETERS = (100, 200, 400, 800)
SAMPLES = {400: 256, MAX_PERIMETER: 128}
"""Samples of a curve up to each perimeter. The series of a typical curve needs 8 to 16 harmonics, which 128 samples hold;
more of them would only take memory, 4 bytes a sample and type, several times over while a file is written or read."""
WARM_UP = 5
SETTINGS = {**ANY_SIZE, "prepare_positions": False}
LARGE = 200
"""Perimeter from which on what every process costs at any size is small beside what grows."""


def serve(atlas: Path, bodies: Sequence[bytes]) -> dict[str, Any]:
    """Start the service on an atlas with its index and send it requests one after the other on one connection."""
    with running(serve_command, atlas=atlas, **SETTINGS) as service:
        service.need_ready()
        row: dict[str, Any] = {"ready_s": service.ready_seconds}
        row |= {"resident_bytes": service.shared_out() or None, "own_bytes": max(service.own())}
        row["scan_bytes"] = service.ask("GET", "/v1/atlas").json()["scan_bytes"]
        for body in bodies[:WARM_UP]:
            service.ask("POST", "/v1/match", body)
        times, replies = Times(), []
        for body in bodies:
            answer = times.run(service.ask, "POST", "/v1/match", body)
            if answer.status != 200:
                raise RuntimeError(f"/v1/match answered {answer.status}: {answer.body.decode()}")
            replies.append(answer.json())
        row |= {"asked_bytes": service.shared_out() or None, "asked_own_bytes": max(service.own())}
    return row | {
        "median_ms": 1000 * quantile(times.wall, 0.5),
        "p99_ms": 1000 * quantile(times.wall, 0.99),
        "windows": replies[0]["report"]["windows"],
        "evaluated": quantile([reply["report"]["evaluated"] for reply in replies], 0.5),
        "similarity_deg": quantile([reply["matches"][0]["similarity"] for reply in replies], 0.5),
        "ms": [round(1000 * value, 2) for value in times.wall],
    }


QUANTITIES = ("build_s", "ready_s", "p99_ms", "median_ms", "build_peak_bytes", "resident_bytes", "file_bytes")
"""Those that are drawn."""


def slope(types: Sequence[float], values: Sequence[float | None]) -> float:
    """Slope of the least-squares line of log values against log types. Law: 3 types^e has the slope e."""
    if len(types) < 2 or None in values:
        return math.nan
    return float(np.polyfit(np.log(types), np.log(np.array(values, dtype=float)), 1)[0])


def exponents(rows: Sequence[dict[str, Any]], least: int = 0) -> dict[str, float]:
    """e in quantity ~ types^e for each of `QUANTITIES`, over the perimeters from one on; NaN for fewer than two."""
    some = [row for row in rows if row["perimeter"] >= least]
    return {name: slope([row["types"] for row in some], [row[name] for row in some]) for name in QUANTITIES}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of growth in docs/scaling.md."""
    every = results["rows"]
    (requests,) = {len(row["ms"]) for row in every}
    percentile = "; their 99th percentile is the largest of them" if requests < 100 else ""
    return {
        **report.tables("growth", {"build": every, "served": every}),
        "requests": f"{requests} requests to each atlas, {results['made']['machine']['cores']} cores{percentile}.",
    }


PANELS = {
    "seconds": {"build_s": ("build", 1), "ready_s": ("start until ready", 1)},
    "request, ms": {"p99_ms": ("99th percentile", 1), "median_ms": ("median", 1)},
    "memory and file, MB": {
        "build_peak_bytes": ("build, largest process", 1e-6),
        "resident_bytes": ("service, resident", 1e-6),
        "file_bytes": ("file", 1e-6),
    },
}


def draw(results: dict[str, Any]) -> None:
    """Seconds, milliseconds and bytes against types, each with its exponent."""
    rows = results["rows"]
    found = exponents(rows, LARGE)
    with figure("growth.svg", 1, len(PANELS), size=(11.5, 3.9)) as (_, grid):
        for axes, (unit, curves) in zip(grid, PANELS.items()):
            for (name, (label, factor)), marker in zip(curves.items(), "so^"):
                scaled = [{"types": row["types"], name: row[name] and row[name] * factor} for row in rows]
                text = f"{label}: types^{found[name]:.2f}"
                curve(axes, scaled, "types", name, marker=marker, markersize=5, label=text)
            axes.set(xscale="log", yscale="log", xlabel="types", title=unit)
            axes.minorticks_off()
            axes.legend(loc="upper left")
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** 0.35)  # room for the legend


def measured(rule: dict[str, Any], bodies: Sequence[bytes]) -> dict[str, Any]:
    """An atlas: built, prepared, served."""
    with tempfile.TemporaryDirectory() as folder:
        atlas = Path(folder) / "atlas.h5"
        row = {**rule, **build(atlas, **rule), **make(atlas, prepare_positions=False), **serve(atlas, bodies)}
        print(json.dumps({name: value for name, value in row.items() if name != "ms"}), flush=True)
        return row


def measure(
    perimeters: Annotated[int, "of the atlases"] = PERIMETERS,
    requests: Annotated[int, "to each atlas"] = 40,
) -> Iterator[dict[str, Any]]:
    """Every perimeter in turn, from the smallest."""
    bodies, rows = match_bodies(requests), []
    for perimeter in tqdm(sorted(perimeters), disable=None, unit="atlas"):
        samples = next(samples for largest, samples in SAMPLES.items() if perimeter <= largest)
        rows.append(measured({"perimeter": perimeter, "order": "increasing", "samples": samples}, bodies))
        yield {"rows": rows}


if __name__ == "__main__":
    report.run(measure)
