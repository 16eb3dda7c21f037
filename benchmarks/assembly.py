"""Layers of random linkages against shapely at many places of the motion, and how long they take (`make assembly`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from synthesis.assembly.stacks import StackRequest, StackSearch
from synthesis.work import Work
from tests.oracles.assembly import disagreements, four_bars, motors_elsewhere, nearest, six_bars, sliders

KINDS = {
    "four-bars": (four_bars, 1),
    "bodies on rails and slots": (sliders, 1),
    "motors on cranks and rockers of four-bars": (six_bars, 2),
    "motors on couplers, and on bodies on rails and slots": (motors_elsewhere, 2),
}
"""Random machines of each kind, and the part of the cases that is taken of it."""
ASKED = (
    StackRequest("below"),
    StackRequest("both"),
    StackRequest("bar"),
    StackRequest("below", heads=True),
    StackRequest("both", heads=True),
)


def measure(cases: Annotated[int, "linkages of each kind"] = 400) -> Iterator[dict[str, Any]]:
    """Each kind, with a board below, on both sides, a bar, and heads in turn."""
    rows: list[dict[str, Any]] = []
    for kind, (machines, part) in KINDS.items():
        times, proved = Times(), Times()
        counts = dict.fromkeys(("pairs", "places", "wrong", "free", "touching", "blocked", "stacks"), 0)
        least = np.inf
        for number, machine in enumerate(machines(cases // part)):
            question = ASKED[number % len(ASKED)]
            search = proved.run(StackSearch, machine, question, Work())
            found = times.run(lambda: StackSearch(machine, question, Work()).solve())  # noqa: B023
            for name, value in zip(("pairs", "places", "wrong"), disagreements(machine, search)):
                counts[name] += value
            counts[found.status] += 1
            if found.status == "free":
                counts["stacks"] += 1
                least = min(least, nearest(machine, found))
        rows.append(
            {
                "kind": kind,
                "cases": cases // part,
                **counts,
                "least": report.finite(least),
                "ms": 1000 * times.median.processor,
                "p99": 1000 * times.percentile(99).processor,
                "proof": 1000 * proved.median.processor,
            }
        )
        yield {"kinds": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The comparison, and what it takes."""
    told = []
    for row in results["kinds"]:
        times = " and ".join(report.significant(row[name]) for name in ("ms", "p99"))
        told.append(
            f"{row['pairs']:,} pairs of parts of {row['cases']:,} {row['kind']} at {row['places']:,} places: {row['wrong']} "
            f"disagree; {row['free']} have free layers, in {times} ms at the median and 99 %"
        )
    return {"kinds": "; ".join(told)}


if __name__ == "__main__":
    report.run(measure)
