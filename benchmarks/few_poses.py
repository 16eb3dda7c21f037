"""Random lids, flaps and everyday machines with two, three and four poses and a box for the pivots, beside plain sampling.

The sampler (`tests.oracles.few_poses`) draws 60,000 dyads and judges random pairs of them by closing the loop; it knows
nothing of the software. Practical limits hold on both sides: 35 degrees of transmission angle, links of ratio 10.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import report
from benchmarks.report import Times
from tests.oracles.few_poses import Task, random_task, sampled_four_bars

EXACT = 1e-9
ENOUGH = 60
"""Number of sampled four-bars with a transmission angle of 40 degrees from which on ten exact answers are expected."""


class Machine(NamedTuple):
    """A body that people hang on linkages, of length 1, and where its pivots may lie."""

    turn: tuple[float, float]
    """Smallest and largest rotation in degrees."""
    end: complex
    """Shift of the body's reference point."""
    bulge: float
    """Deviation of the path from a straight line, as a fraction of the shift."""
    box: tuple[float, float, float, float]


MACHINES = {
    "cabinet shelf that comes down": Machine((0, 0), 0.8 - 0.9j, 0.25, (-0.2, -0.6, 0.6, 0.5)),
    "tipping bucket": Machine((80, 130), 0.9 + 0.7j, 0.2, (-0.6, -0.8, 0.8, 0.6)),
    "casement window": Machine((70, 95), 0.5 - 0.7j, -0.1, (-0.3, -0.3, 1.0, 0.3)),
    "oven door": Machine((80, 95), -0.25 - 0.1j, 0.1, (-0.2, -0.8, 0.9, 0.5)),
    "tailgate": Machine((60, 90), -0.5 + 1.0j, -0.2, (-0.8, -0.1, 0.8, 1.2)),
    "table leg that folds": Machine((85, 105), 0.4 - 0.5j, 0.1, (-0.3, -0.5, 1.0, 0.2)),
    "wiper": Machine((70, 110), 1.2 + 0.3j, 0.3, (-0.4, -1.0, 1.4, 0.1)),
    "flap that goes over": Machine((150, 175), -0.4 + 0.3j, 0.3, (-1.0, -0.6, 0.4, 0.8)),
}


def machine_task(seed: int, poses: int) -> Task:
    """Draw poses of an everyday machine; all its sizes vary by a fifth."""
    random = np.random.default_rng([seed, poses, 99])
    machine = list(MACHINES.values())[seed % len(MACHINES)]
    turn, end = np.deg2rad(random.uniform(*machine.turn)), machine.end * random.uniform(0.8, 1.2)
    share = np.linspace(0, 1, poses)
    share[1:-1] += random.uniform(-0.08, 0.08, poses - 2)
    path = end * (share + 1j * machine.bulge * random.uniform(0.8, 1.2) * np.sin(np.pi * share))
    left, low, right, high = random.uniform(0.8, 1.2) * np.array(machine.box)
    return Task(path, turn * share, (left, low, right, high))


TASKS: dict[str, Callable[[int, int], Task]] = {"lids and flaps": random_task, "machines": machine_task}
"""Generators of tasks by seed and number of poses."""


def measure_poses(name: str, poses: int, cases: int) -> dict[str, Any]:
    """Solve random tasks with some number of poses and compare the answers with the sampled four-bars."""
    times, exact_of_ten, first_exact, sizes, angles = Times(), [], [], [], []
    for seed in range(cases):
        task = TASKS[name](seed, poses)
        sampled = sampled_four_bars(task)
        position = np.stack([task.position.real, task.position.imag], axis=1)
        limits = {"family": "any", "pivot_box": task.box}
        comfortable = sampled.longest[sampled.transmission >= np.deg2rad(40)]
        if comfortable.size < ENOUGH:
            continue
        found = times.run(la.synthesize, np.rad2deg(task.rotation), position, timing="free", limits=limits)
        exact = [solution.errors.objective < EXACT for solution in found]
        exact_of_ten.append(sum(exact[:10]) / 10)
        first_exact.append(bool(exact and exact[0]))
        sizes.append(found.best.linkage.links.max() / np.quantile(comfortable, 0.05))
        angles.append(found.best.transmission_angle_min)
    return {
        "tasks": name,
        "poses": poses,
        "cases": cases,
        "counted": len(sizes),
        "exact_of_ten": float(np.mean(exact_of_ten)),
        "first_exact": float(np.mean(first_exact)),
        "size_median": float(np.median(sizes)),
        "size_p95": float(np.quantile(sizes, 0.95)),
        "transmission_median": float(np.median(angles)),
        **times.summary(),
    }


def measure(cases: Annotated[int, "of each number of poses"] = 100) -> Iterator[dict[str, Any]]:
    """Measure two, three and four poses."""
    la.synthesize([0, 10], [[0, 0], [1, 1]], timing="free")  # what the first request makes is not timed
    with threadpool_limits(1):
        yield {"rows": [measure_poses(name, poses, cases) for name in TASKS for poses in (2, 3, 4)]}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the table of the document."""
    return report.tables("few_poses", results)


if __name__ == "__main__":
    report.run(measure)
