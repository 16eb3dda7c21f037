"""Layers of random linkages, compared with shapely at many positions of the motion, and their times (`make assembly`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine
from synthesis.assembly.stacks import StackRequest, StackSearch
from synthesis.linkage import four_bar
from synthesis.target import TURN, Interval
from synthesis.work import Work
from tests.oracles.assembly import SEED, _sizes, _star, disagreements, motors_elsewhere, nearest, six_bars, sliders
from tests.oracles.four_bar_joints import joints_at


def four_bars(count: int) -> Iterator[Machine]:
    """Random four-bars: lengths over a decade, both branches, plates of all sizes, over a turn or a fraction of a
    turn.
    """
    random = np.random.default_rng(SEED)
    while count:
        links = tuple(10.0 ** random.uniform(-0.8, 0, 4))
        point = (random.uniform(0, 0.7), random.uniform(0, TURN))
        linkage = four_bar(
            links, int(random.choice([-1, 1])), random.uniform(0, TURN), 0j, random.uniform(0, TURN), point
        )
        span = float(random.choice([TURN, random.uniform(0.2, 3.0)]))
        if not joints_at(linkage, np.linspace(0.0, span, 400)).closed:
            continue
        body = _star(random)
        try:
            yield as_plates(linkage, Interval(0.0, span), _sizes(random, 0.3 * min(links)), body)
        except ValueError:
            continue
        count -= 1


KINDS = {
    "four-bars": (four_bars, 1),
    "bodies on rails and slots": (sliders, 1),
    "motors on cranks and rockers of four-bars": (six_bars, 2),
    "motors on couplers, and on bodies on rails and slots": (motors_elsewhere, 2),
}
"""Random machines of each kind, and the fraction of the cases for each kind."""
REQUESTS = (
    StackRequest("below"),
    StackRequest("both"),
    StackRequest("bar"),
    StackRequest("below", heads=True),
    StackRequest("both", heads=True),
)


def measure(cases: Annotated[int, "linkages of each kind"] = 400) -> Iterator[dict[str, Any]]:
    """Measure each kind with a board below, boards on both sides, a bar, and heads in turn."""
    rows: list[dict[str, Any]] = []
    for kind, (machines, part) in KINDS.items():
        times, proved = Times(), Times()
        counts = dict.fromkeys(("pairs", "places", "wrong", "free", "touching", "blocked", "stacks"), 0)
        smallest = np.inf
        for number, machine in enumerate(machines(cases // part)):
            question = REQUESTS[number % len(REQUESTS)]
            search = proved.run(StackSearch, machine, question, Work())
            found = times.run(lambda: StackSearch(machine, question, Work()).solve())  # noqa: B023
            for name, value in zip(("pairs", "places", "wrong"), disagreements(machine, search)):
                counts[name] += value
            counts[found.status] += 1
            if found.status == "free":
                counts["stacks"] += 1
                smallest = min(smallest, nearest(machine, found))
        rows.append(
            {
                "kind": kind,
                "cases": cases // part,
                **counts,
                "least": report.finite(smallest),
                "ms": 1000 * times.median.processor,
                "p99": 1000 * times.percentile(99).processor,
                "proof": 1000 * proved.median.processor,
            }
        )
        yield {"kinds": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return a row for each kind of machine."""
    return report.tables("assembly", results)


if __name__ == "__main__":
    report.run(measure)
