"""Slider-cranks and swinging blocks by their crank: atlas, its scan against the plain scan, searches for given crank angles.

``python -m benchmarks.sliders [--requests 300] [--cases 1000]`` ends with 1 if an answer of the scan differs from that of all
windows bounded one by one. Requests are motions of random linkages on no lattice by the formulas of books, a third of them with
noise; searches are for exact motions, a third each of rotations, positions and both, a third of them clockwise.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import linkage_atlas as la
from benchmarks import report
from benchmarks.product import Scan
from benchmarks.report import Times, spread
from benchmarks.retrieval import duels, summaries
from synthesis.atlas.file import load_atlas
from synthesis.guided.by_crank import BY_CRANK, linkages_by_crank, seed_tables
from synthesis.slider import RAIL
from synthesis.work import Work
from tests.oracles.rotations import SPANS
from tests.oracles.slider_crank import random_motion

REACHED = 1e-9
WHAT = ("rotation", "position", "both")


def requests(count: int) -> Iterator[tuple[str, int, Any]]:
    """Rotations over all spans, a third with noise, and every tenth with positions."""
    for seed in range(count):
        random, span = np.random.default_rng([41, seed]), SPANS[seed % len(SPANS)]
        what = "both" if seed % 10 == 9 else "rotation"
        noise = 10.0 ** random.uniform(-4, -1) if seed % 3 == 2 else 0.0
        yield str(span), seed, random_motion(random, RAIL, span, what, noise=noise)


def measure_atlas(count: int) -> dict[str, Any]:
    """Its file by one process, the first question, and the scan against the plain one."""
    with tempfile.TemporaryDirectory() as folder:
        path, begin = Path(folder) / "slider.h5", time.perf_counter()
        la.build_atlas(path, kind="slider_crank", jobs=1)
        told: dict[str, Any] = {"build_s": time.perf_counter() - begin, "file_bytes": path.stat().st_size}
        atlas = load_atlas(path)
        # beside an atlas of four-bars: what the first question for slider-cranks costs
        small = Path(folder) / "four_bars.h5"
        la.build_atlas(small, 60, jobs=1)
        beside, begin = la.load_atlas(small, index=Path(folder) / "index"), time.perf_counter()
        before = time.process_time()
        found = la.match(list(range(12)), 60, atlas=beside, mechanisms=["slider_crank"])
        told |= {"first_s": time.perf_counter() - begin, "first_cpu_s": time.process_time() - before}
        told |= {"windows": found.report.windows, "types": len(beside.slider_cranks)}
        made = Path(folder) / "index" / "slider_crank_cells"
        told["index_bytes"] = sum(one.stat().st_size for one in made.iterdir())
    ours, plain = Scan(atlas), Scan(atlas, cells=False)
    ours.prepare_short_spans(Work())
    done = duels(ours, plain, requests(count))
    told |= {"spans": summaries(done, SPANS), "requests": count, "differ": sum(not one["same"] for one in done)}
    return told | {"ratio": spread([one["ratio"] for one in done])}


def measure_searches(cases: int) -> list[dict[str, Any]]:
    """Exact motions of each kind: how many are reached, and in what time."""
    rows = []
    for kind, mechanism in BY_CRANK.items():
        seed_tables(kind)
        for what in WHAT:
            times, missed, worst = Times(), 0, 0.0
            for seed in range(WHAT.index(what), cases, len(WHAT)):
                random = np.random.default_rng([43, seed])
                span = random.uniform(60, 360) * (-1 if seed % 4 == 3 else 1)
                target = random_motion(random, mechanism.guide, span, what, samples=24)
                found, _ = times.run(linkages_by_crank, kind, target, "any", 3)
                error = found[0].errors.objective if found else np.inf
                missed, worst = missed + (not error < REACHED), max(worst, error if error < REACHED else 0.0)
            row = {"kind": str(kind), "what": what, "cases": len(times.wall), "missed": missed, "worst": worst}
            rows.append(row | times.summary())
            print(row, flush=True)
    return rows


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The figures of docs/scaling.md."""
    atlas = results["atlas"]
    spans, searches = list(atlas["spans"].values()), results["searches"]
    facts = [
        ["types, windows", f"{atlas['types']:,}, {atlas['windows']:,}"],
        ["build by one process", f"{atlas['build_s']:.1f} s"],
        ["file", report.size(atlas["file_bytes"])],
        ["made beside the atlas of four-bars at the first question", f"{atlas['first_s']:.1f} s"],
        ["its part of the index", report.size(atlas["index_bytes"])],
        [f"answers that differ from the plain scan's, of {atlas['requests']} requests", str(atlas["differ"])],
    ]
    return {
        "atlas": report.lines(["what", "figure"], facts, 2),
        "spans": f"{report.ends([1000 * part['ours']['median'] for part in spans])} ms, the plain one "
        f"{report.ends([1000 * part['plain']['median'] for part in spans], 0)} ms",
        "searches": f"{sum(row['cases'] - row['missed'] for row in searches):,} of "
        f"{sum(row['cases'] for row in searches):,}",
    }


def measure(
    requests: Annotated[int, "to the scan"] = 300, cases: Annotated[int, "searches for each kind"] = 1000
) -> Iterator[dict[str, Any]]:
    """The atlas and its scan, then the searches; exit code 1 if an answer of the scan differs."""
    atlas = measure_atlas(requests)
    yield {"atlas": atlas, "searches": measure_searches(cases)}
    if atlas["differ"]:
        raise SystemExit(f"{atlas['differ']} answers differ from those of the plain scan")


if __name__ == "__main__":
    report.run(measure)
