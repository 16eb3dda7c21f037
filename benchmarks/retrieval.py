"""The exact scan beside a plain matrix product and an earlier version: times, memory, file, build and start.

``python -m benchmarks.retrieval [--base FOLDER] [--large 800]``. Requests are rotations of random crank-rockers of real
lengths. Times are of the processor, on one core, the better of three. The plain product bounds every window of the atlas from
series. ``--base`` is a checkout of an earlier version with its environment and its ``atlas.h5``; it answers the same requests in
the same run. ``--large`` is the perimeter of a second, larger atlas, which is built for it.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import report
from benchmarks.scan_times import CLASSES, request
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import coupler_turns
from synthesis.search.error_table import ErrorTable

LARGE_SAMPLES = 128
PLAIN_TYPES = 8192
"""Types of which the plain product is timed; its time is proportional to their number."""
PLAIN_AT_ONCE = 512
HARMONICS = np.array([5, 8, 12, 16, 24, 32, 64])
"""Lengths of series to choose from."""
SERIES_ERROR = 3e-7
"""Largest sum of the amplitudes that a series leaves out, in radians, unless it is the longest."""


def times_of(python: str, path: Path, requests: int) -> list[dict[str, Any]]:
    """Return the times of the scan of an atlas by a version's own Python."""
    command = [python, str(Path(__file__).with_name("scan_times.py")), str(path), str(requests)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: list[dict[str, Any]] = json.loads(done.stdout.splitlines()[-1])
    return found


def harmonics_of(lengths: Any) -> Any:
    """Return the length of the series of theta2 that each type needs, (T,)."""
    crank = np.arange(256) * (2 * np.pi / 256)
    periodic = coupler_angle(lengths, np.ones(len(lengths)), crank) - coupler_turns(lengths)[:, None] * crank
    size = 2 * np.abs(np.fft.rfft(periodic, axis=1)) / 256
    left_out = np.cumsum(size[:, ::-1], axis=1)[:, ::-1][:, HARMONICS[:-1] + 1]
    return HARMONICS[np.sum(left_out > SERIES_ERROR, axis=1)]


def measure_plain(lengths: Any) -> list[float]:
    """Return the milliseconds of a plain matrix product over all windows, for each class, from a part of the types."""
    chosen = np.sort(np.random.default_rng(1).permutation(len(lengths))[:PLAIN_TYPES])
    harmonics, parts = harmonics_of(lengths[chosen].astype(float)), []
    for count in np.unique(harmonics).tolist():
        rows = chosen[harmonics == count]
        for part in np.array_split(rows, -(-rows.size // PLAIN_AT_ONCE)):
            parts.append(ErrorTable(lengths[part].astype(float), 360, 256, count))
    times = []
    for samples, span in CLASSES:
        target, runs = request(samples, span, 0), []
        for _ in range(2):
            begin = time.process_time()
            for part in parts:
                part.squared(target).min(axis=(1, 2))
            runs.append(time.process_time() - begin)
        times.append(1000 * min(runs) * len(lengths) / chosen.size)
    return times


STARTED = """
import time
begin = time.perf_counter(), time.process_time()
import linkage_atlas as la
atlas = la.load_atlas({path!r})
atlas.scan
seconds, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
import json, resource
peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({{"start_s": seconds, "start_cpu_s": processor, "peak_bytes": peak, "scan_bytes": atlas.scan.nbytes}}))
"""


def measure_atlas(path: Path, requests: int) -> dict[str, Any]:
    """Return facts about a file: size, start in a process of its own, and times of requests."""
    started = subprocess.run(
        [sys.executable, "-c", STARTED.format(path=str(path))], capture_output=True, text=True, check=True
    )
    atlas = la.load_atlas(path)
    facts = {"types": len(atlas), "windows": atlas.scan.windows, "file_bytes": path.stat().st_size}
    return {**facts, **json.loads(started.stdout), "classes": times_of(sys.executable, path, requests)}


def built(path: Path, *options: str) -> dict[str, Any]:
    """Build an atlas in a process of its own; return its time and the memory of the largest process."""
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(
        [sys.executable, "-m", "app.start", "build", "--out", str(path), *options], check=True, capture_output=True
    )
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = usage.ru_utime - before
    return {"build_s": time.perf_counter() - begin, "build_cpu_s": cpu, "build_peak_bytes": 1024 * usage.ru_maxrss}


def measure(
    requests: Annotated[int, "of each class"] = 12,
    base: Annotated[Path, "checkout of an earlier version with its environment and atlas.h5"] = Path("none"),
    large: Annotated[int, "perimeter of the larger atlas; 0: none"] = 800,
) -> Iterator[dict[str, Any]]:
    """Both atlases, the plain product and the earlier version, one after the other."""
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        path = Path(folder) / "atlas.h5"
        build = built(path)
        atlases = [measure_atlas(path, requests) | build]
        plain = measure_plain(la.load_atlas(path).lengths)
        earlier = []
        if base.is_dir():
            earlier = times_of(str(base.absolute() / ".venv/bin/python"), base.absolute() / "atlas.h5", requests)
        if large:
            larger = Path(folder) / "large.h5"
            build = built(larger, "--perimeter", str(large), "--samples", str(LARGE_SAMPLES))
            atlases.append(measure_atlas(larger, requests) | build)
    yield {"atlases": atlases, "plain_ms": plain, "earlier": earlier}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md."""
    default, *larger_atlases = results["atlases"]
    rows = []
    for number, row in enumerate(default["classes"]):
        plain = results["plain_ms"][number]
        earlier = f"{results['earlier'][number]['ms']:.1f}" if results["earlier"] else "-"
        larger = [f"{atlas['classes'][number]['ms']:.1f}" for atlas in larger_atlases]
        rows.append(
            [
                str(row["samples"]),
                str(row["span"]),
                f"{row['ms']:.1f}",
                f"{row['max_ms']:.1f}",
                earlier,
                f"{plain:.0f}",
                f"{plain / row['ms']:.0f}",
                f"{row['evaluated']:,.0f}",
                *larger,
            ]
        )
    heads = ["samples", "span", "ms", "largest", "earlier version", "plain product", "plain / ours", "evaluated"]
    heads += [f"{atlas['types']:,} types, ms" for atlas in larger_atlases]
    size = report.size
    facts = [
        [
            f"{atlas['types']:,}",
            size(atlas["file_bytes"]),
            f"{atlas['build_cpu_s']:.1f}",
            size(atlas["build_peak_bytes"]),
            f"{atlas['start_cpu_s']:.2f}",
            size(atlas["scan_bytes"]),
            size(atlas["peak_bytes"]),
        ]
        for atlas in results["atlases"]
    ]
    columns = [
        "types",
        "file",
        "build, processor s",
        "build, largest process",
        "start, processor s",
        "scan",
        "process",
    ]
    return {"classes": report.lines(heads, rows, 0), "atlases": report.lines(columns, facts, 0)}


if __name__ == "__main__":
    report.run(measure)
