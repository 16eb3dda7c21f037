"""Time, size and memory of building, loading and scanning an atlas: ``python -m benchmarks.foundation [--atlas FILE]``.

Times are medians of several runs. The scan runs on all cores as in the service; its ratio to the evaluation of every window one
by one (on a part of the atlas, scaled up) is that of the processor times of both.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import report
from benchmarks.product import STARTS, Scan, Target, Windows, coupler_angle, load_atlas, make_target
from benchmarks.report import repeat, significant, size
from benchmarks.service import build

NAIVE_TYPES, NAIVE_SPAN = 500, 70
SPANS = (20, 70, 200, 360)


def targets(scan: Scan, span: float, rng: np.random.Generator) -> dict[str, Target]:
    """Requests of 32 samples, one of which comes from no linkage, by what they give."""
    row = int(rng.integers(len(scan.lengths)))
    crank = rng.uniform(0, 2 * np.pi) + np.linspace(0, span, 32)
    angle = coupler_angle(scan.lengths[row], 1, crank)
    x = np.linspace(0, np.pi, 32)
    wave = sum(rng.normal() * np.cos(k * x) / (1 + k) for k in range(6))
    path = np.exp(1j * crank) + 2 * np.exp(1j * angle)
    return {
        "rotation, reachable": make_target(angle, None, span),
        "rotation, unreachable": make_target(wave, None, span),
        "both, reachable": make_target(angle, path, span),
        "position, reachable": make_target(None, path, span),
    }


def one_by_one(scan: Scan, target: Target) -> float:
    """Processor seconds for every window one by one, from a part of the types."""
    rows = np.linspace(0, len(scan.lengths) - 1, NAIVE_TYPES).astype(int)
    row, start, branch = (v.ravel() for v in np.meshgrid(rows, np.arange(STARTS), [1, -1], indexing="ij"))
    windows = Windows(row, start, branch, np.zeros(row.size))
    times = repeat(lambda: scan.errors(target, windows), 1, warm_up=0)
    return times.median.processor * len(scan.lengths) / NAIVE_TYPES


def measure(file: Path) -> dict[str, Any]:
    """All figures of one atlas, and of building the default one."""
    with tempfile.TemporaryDirectory() as folder:
        results: dict[str, Any] = build(Path(folder) / "atlas.h5")
    with threadpool_limits(1, "blas"):
        results["load_s"] = repeat(lambda: load_atlas(file)).median.wall
        atlas = load_atlas(file)
        results["prepare_s"] = repeat(lambda: Scan(atlas), 3, warm_up=0).median.wall
        scan = Scan(atlas, threads=os.cpu_count() or 1)
        results |= {"scan_bytes": scan.nbytes, "details_bytes": atlas.details.nbytes, "windows": scan.windows}
        rng = np.random.default_rng(3)
        results["scan"] = []
        for degrees in SPANS:
            for name, target in targets(scan, np.deg2rad(degrees), rng).items():
                seconds = repeat(lambda target=target: scan.best(target, 10), 3).median
                row = {"span_deg": degrees, "request": name, "scan_s": seconds.wall}
                if degrees == NAIVE_SPAN:
                    row["ratio"] = one_by_one(scan, target) / seconds.processor
                results["scan"].append(row)
                print(row, flush=True)
    results["positions_bytes"] = scan.nbytes - results["scan_bytes"]  # prepared by the first request with positions
    return results


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/file_format.md; what concerns the service comes from `growth` and `throughput`."""
    served = next(row for row in report.load("growth")["rows"] if row["perimeter"] == 400)
    loaded = report.load("throughput")["services"][0]

    def between(values: Sequence[float], digits: int = 2) -> str:
        return " to ".join(dict.fromkeys(significant(value, digits) for value in (min(values), max(values))))

    def scans(kind: str) -> str:
        rows = [row for row in results["scan"] if row["request"].startswith(kind)]
        text = f"{between([1000 * row['scan_s'] for row in rows])} ms"
        ratios = [row["ratio"] for row in rows if "ratio" in row]
        if ratios:
            text += f"; at {NAIVE_SPAN} degrees {between(ratios, 1)} times faster than one window at a time"
        return text

    spans = f"{SPANS[0]}..{SPANS[-1]} degrees"
    rows = [
        [
            "build, two processes",
            f"{significant(results['build_s'], 2)} s, {size(results['build_peak_bytes'])} the largest",
        ],
        ["file", size(results["file_bytes"])],
        ["load and verify", f"{significant(results['load_s'], 2)} s"],
        [
            "prepare the scan, one thread",
            f"{significant(results['prepare_s'], 2)} s, {size(results['scan_bytes'])}; "
            f"the details stay in memory with {size(results['details_bytes'])}",
        ],
        ["the series for requests with positions, behind the readiness", f"{size(results['positions_bytes'])} more"],
        [
            "service: start until ready",
            f"{significant(served['ready_s'], 2)} s; {size(served['resident_bytes'])} then, "
            f"{size(served['peak_bytes'])} at most on the way; {size(loaded['peak_bytes'])} at most with positions, under load",
        ],
        [f"scan of {results['windows'] / 1e6:.0f} million windows, exact, spans {spans}", scans("rotation")],
        ["the same with positions", scans("both")],
        ["positions only", scans("position")],
    ]
    return {"figures": report.lines(["what", "figure"], rows, 2)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and publish."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--atlas", type=Path, default=Path("atlas.h5"))
    report.publish("foundation", measure(parser.parse_args(arguments).atlas))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
