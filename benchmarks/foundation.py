"""Time, size and memory of building, loading and scanning an atlas.

``python -m benchmarks.foundation [--atlas FILE]`` prints a table and writes ``benchmarks/results/foundation.json``. Times
are medians of several runs on one machine; the scan is measured against the scan of every window one by one (on a
part of the atlas, scaled up), which is what a ratio can be made of.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from synthesis.atlas.file import load_atlas
from synthesis.atlas.scan import STARTS, Scan, Windows, window_errors
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.target import Target, make_target

RESULTS = Path(__file__).parent / "results" / "foundation.json"
NAIVE_TYPES = 500


def timed(function, runs: int = 5) -> float:
    """Median seconds."""
    seconds = []
    for _ in range(runs):
        begin = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def build() -> dict[str, float]:
    """Build the default atlas in a process of its own: seconds, bytes, peak memory of it and its workers."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "atlas.h5"
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "data_build", "--out", str(out)], check=True, capture_output=True)
        seconds = time.perf_counter() - begin
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
        return {"build_s": seconds, "file_bytes": out.stat().st_size, "build_peak_bytes_largest_process": peak}


def targets(scan: Scan, span: float, rng: np.random.Generator) -> dict[str, Target]:
    """A reachable and an unreachable request of 32 samples, rotation only and with positions."""
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


def naive_seconds(scan: Scan, target: Target) -> float:
    """Seconds for every window one by one, from a part of the types."""
    rows = np.linspace(0, len(scan.lengths) - 1, NAIVE_TYPES).astype(int)
    row, start, branch = (v.ravel() for v in np.meshgrid(rows, np.arange(STARTS), [1, -1], indexing="ij"))
    windows = Windows(row, start, branch, np.zeros(row.size))
    return timed(lambda: window_errors(scan.lengths, target, windows), 1) * len(scan.lengths) / NAIVE_TYPES


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--atlas", type=Path, default=Path("atlas.h5"))
    options = parser.parse_args()
    results: dict[str, object] = dict(build())
    with threadpool_limits(1, "blas"):
        results["load_s"] = timed(lambda: load_atlas(options.atlas))
        atlas = load_atlas(options.atlas)
        results["prepare_s"] = timed(lambda: Scan(atlas), 3)
        scan = Scan(atlas, threads=os.cpu_count() or 1)
        results["scan_bytes"] = scan.nbytes
        results["details_bytes"] = atlas.details.nbytes
        rng = np.random.default_rng(3)
        rows = []
        for degrees in (20, 70, 200, 360):
            for name, target in targets(scan, np.deg2rad(degrees), rng).items():
                seconds = timed(lambda target=target: scan.best(target, 10), 3)
                rows.append({"span_deg": degrees, "request": name, "scan_s": seconds})
                if degrees == 70:
                    rows[-1]["one_by_one_s"] = naive_seconds(scan, target)
                    rows[-1]["ratio"] = rows[-1]["one_by_one_s"] / seconds
        results["scan"] = rows
    results["peak_bytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    for name, value in results.items():
        if name != "scan":
            print(f"{name:<34} {value:,.2f}")
    for row in rows:
        extra = f"   one by one {row['one_by_one_s']:.0f} s, {row['ratio']:.0f} x" if "ratio" in row else ""
        print(f"{row['span_deg']:>4} deg  {row['request']:<22} {1000 * row['scan_s']:8.0f} ms{extra}")


if __name__ == "__main__":
    main()
