"""Searches for slider-cranks and swinging blocks with given crank angles: ``python -m benchmarks.sliders [--cases 1000]``.

Motions are exact, of random linkages on no lattice, a third each rotations, positions and both, a quarter of them clockwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from synthesis.guided.by_crank import BY_CRANK, linkages_by_crank, seed_tables
from tests.oracles.slider_crank import random_motion

REACHED = 1e-9
WHAT = ("rotation", "position", "both")


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
    """Return the figures of docs/scaling.md."""
    searches = results["searches"]
    reached = sum(row["cases"] - row["missed"] for row in searches)
    return {"searches": f"{reached:,} of {sum(row['cases'] for row in searches):,}"}


def measure(cases: Annotated[int, "searches for each kind"] = 1000) -> Iterator[dict[str, Any]]:
    """Searches for exact motions."""
    yield {"searches": measure_searches(cases)}


if __name__ == "__main__":
    report.run(measure)
