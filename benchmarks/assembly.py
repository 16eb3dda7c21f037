"""Layers of random linkages against shapely at many places of the motion, and how long they take (`make assembly`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
import shapely

from benchmarks import report
from benchmarks.report import Times
from synthesis.assembly.layers import Arrangement, Asked, Search
from synthesis.assembly.machine import Machine, Sizes, four_bar
from synthesis.assembly.parts import Heights, parts_of
from synthesis.fourbar.linkage import Linkage
from synthesis.target import TURN, Interval
from synthesis.work import Work

PLACES = 721
"""Of each motion, its ends among them."""
NEAR = 1e-9
"""Of the size: gaps less than this either way are not compared."""
SEED = 7


def four_bars(count: int) -> Iterator[Machine]:
    """Random four-bars: lengths over a decade, both branches, plates of all sizes, over a turn or a part of one."""
    random = np.random.default_rng(SEED)
    while count:
        links = tuple(10.0 ** random.uniform(-0.8, 0, 4))
        point = (random.uniform(0, 0.7), random.uniform(0, TURN))
        linkage = Linkage(
            links, int(random.choice([-1, 1])), random.uniform(0, TURN), 0j, random.uniform(0, TURN), point
        )
        span = float(random.choice([TURN, random.uniform(0.2, 3.0)]))
        if not linkage.joints(np.linspace(0.0, span, 400)).closed:
            continue
        body: tuple[complex, ...] = ()
        if random.random() < 0.3:  # a star, mostly not convex
            angle = np.sort(random.uniform(0, TURN, 9))
            body = tuple(random.uniform(0.05, 0.3, 9) * np.exp(1j * angle)) if np.all(np.diff(angle) > 1e-3) else ()
        hole = 0.3 * min(links) * random.uniform(0.3, 1.0)
        sizes = Sizes(hole, hole * random.uniform(1.3, 3.5), random.uniform(0, 0.02))
        try:
            yield four_bar(linkage, Interval(0.0, span), sizes, body)
        except ValueError:
            continue
        count -= 1


KINDS = {"four-bars": four_bars}


def outlines(machine: Machine, body: int, core: tuple[complex, ...], travel: Any) -> Any:
    """A core as shapely's geometries at places (n,)."""
    bodies = machine.movement.bodies(travel)
    points = bodies.origin[body][:, None] + bodies.direction[body][:, None] * np.array(core)
    places = np.stack([points.real, points.imag], axis=-1)
    if len(core) == 1:
        return shapely.points(places[:, 0])
    return shapely.linestrings(places) if len(core) == 2 else shapely.polygons(places)


def disagreements(machine: Machine, search: Search) -> tuple[int, int, int]:
    """Pairs, places that were compared, and of them those where the proof and shapely differ."""
    travel = np.linspace(*machine.used, PLACES)
    drawn: dict[int, Any] = {}
    compared = wrong = 0
    shapes, clearance = search.shapes, machine.clearance
    for (one, other), proof in zip(search.numbers, search.proofs):
        for number in (one, other):
            if number not in drawn:
                drawn[number] = outlines(machine, shapes[number].body, shapes[number].shape.core, travel)
        radii = shapes[one].shape.radius + shapes[other].shape.radius
        gap = shapely.distance(drawn[one], drawn[other]) - radii - clearance
        hits = np.zeros(PLACES, dtype=bool)
        told = np.abs(gap) > NEAR * machine.size
        for run in proof.hits:
            hits |= (run.first <= travel) & (travel <= run.last)
        for run in proof.touches:
            told &= ~((run.first <= travel) & (travel <= run.last))
        compared += int(told.sum())
        wrong += int((told & (hits != (gap < 0))).sum())
    return len(search.proofs), compared, wrong


def nearest(machine: Machine, found: Arrangement) -> float:
    """The least gap less clearance of parts that fill a common layer and are not joined, at all places, over the size."""
    travel = np.linspace(*machine.used, PLACES)
    joined = {pin.name: set(pin.joins) for pin in machine.pins}
    parts = [one for one in parts_of(machine, found.stack, Heights.of(machine)) if one.kind != "board"]
    drawn = [outlines(machine, part.body, part.shape.core, travel) for part in parts]
    least = np.inf
    for k, one in enumerate(parts):
        for n, other in enumerate(parts[:k]):
            common = set(range(one.layers[0], one.layers[1] + 1)) & set(range(other.layers[0], other.layers[1] + 1))
            common &= set(range(1, found.stack.count + 1))
            # where a pin has a plate of its own the plate stands for it
            for part in (one, other):
                if part.kind != "plate":
                    common -= {found.stack.layers[plate] for plate in joined[part.name.split("_")[1]]}
            if common:
                gap = shapely.distance(drawn[k], drawn[n]) - one.shape.radius - other.shape.radius - machine.clearance
                least = min(least, float(np.min(gap)))
    return least / machine.size


def measure(cases: Annotated[int, "linkages of each kind"] = 1000) -> Iterator[dict[str, Any]]:
    """Each kind, with a board below, on both sides, and heads in turn."""
    rows: list[dict[str, Any]] = []
    asked = [Asked("below"), Asked("both"), Asked("below", heads=True), Asked("both", heads=True)]
    for kind, machines in KINDS.items():
        times, proved = Times(), Times()
        counts = dict.fromkeys(("pairs", "places", "wrong", "free", "touching", "blocked", "stacks"), 0)
        least = np.inf
        for number, machine in enumerate(machines(cases)):
            question = asked[number % len(asked)]
            proved.run(Search, machine, question, Work())
            search = Search(machine, question, Work())
            found = times.run(lambda: Search(machine, question, Work()).answer())  # noqa: B023
            for name, value in zip(("pairs", "places", "wrong"), disagreements(machine, search)):
                counts[name] += value
            counts[found.status] += 1
            if found.status == "free":
                counts["stacks"] += 1
                least = min(least, nearest(machine, found))
        rows.append(
            {
                "kind": kind,
                "cases": cases,
                **counts,
                "least": report.finite(least),
                "ms": 1000 * times.median.processor,
                "p99": 1000 * times.percentile(99).processor,
                "proof": 1000 * proved.median.processor,
            }
        )
        yield {"kinds": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Its table."""
    return report.tables("assembly", results)


if __name__ == "__main__":
    report.run(measure, blocks)
