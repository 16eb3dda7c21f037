"""Drives of random linkages: optima against finer grids, motors simulated, forces against equilibrium, times (`make drives`)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from synthesis.drives.actuator import Actuator, Placement, Question, Refused, Wanted
from synthesis.drives.dyad import about_pivot, driven, on_any_link
from synthesis.drives.links import Loading, Machine, machine_of
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Interval
from tests.oracles.driven_cases import loads, random_linkage
from tests.oracles.equilibrium import Moving, drive_force

LINKS = ("crank", "coupler", "rocker")
FINE = 240
"""Points of the finer grid, either way: four times as many as the search's."""
ANGLES = 20_001
"""Positions at which a motor's links are looked at."""
BETTER = 1e-6


def question(
    linkage: Linkage, interval: Interval, seed: int, grid: int = 60
) -> tuple[Question, Actuator, Machine, Loading]:
    """One link of a linkage, a load, and an actuator that may fit."""
    rng = np.random.default_rng([seed, 1])
    machine = machine_of(linkage, interval)
    load = loads(linkage, rng)
    link = machine.links[LINKS[seed % 3]]
    middle = complex(np.mean(link.origin))
    box = (middle.real - 2.5, middle.imag - 2.5, middle.real + 2.5, middle.imag + 2.5)
    stroke = float(rng.uniform(0.15, 0.8))
    asked = Question(link, machine.at, machine.torque(load), Wanted(box, 1.5, 0.02 * stroke), grid)
    return asked, Actuator(stroke * float(rng.uniform(1.1, 2.5)), stroke), machine, load


def equilibrium(linkage: Linkage, machine: Machine, load: Loading, link: str, place: Placement) -> float:
    """The largest difference of the actuator's force from that of nine equations a position, over the largest force."""
    turn = np.exp(1j * (linkage.body_offset or 0.0))
    masses = [
        ("coupler", one.mass, complex(linkage.arm + one.at * turn), one.inertia)
        if one.link == "body"
        else (one.link, one.mass, one.at, one.inertia)
        for one in load.masses
    ]
    a, b = linkage.pivot_a, linkage.pivot_b
    worst = 0.0
    for k in range(0, machine.at.size, 12):
        crank = linkage.start + linkage.ground_angle + machine.at[k]
        at = Moving(linkage.links, linkage.branch, (a.real, a.imag), (b.real, b.imag), crank)
        held = linkage.arm, (load.force.real, load.force.imag), load.torque, masses
        gravity = (load.gravity.real, load.gravity.imag)
        rod = ("rod", link, place.pin, (place.ground.real, place.ground.imag))
        worst = max(worst, abs(drive_force(at, *held, gravity, load.speed, rod) - place.force[k]))
    return worst / place.peak


def actuators(cases: int) -> list[dict[str, Any]]:
    """Optima against the finer grid, and why there are none; a row a link."""
    rows: dict[str, dict[str, Any]] = {name: _empty() for name in LINKS}
    for seed in range(cases):
        linkage, interval = random_linkage(np.random.default_rng([seed, 0]))
        name = LINKS[seed % 3]
        row = rows[name]
        times: Times = row["times"]
        asked, actuator, machine, load = question(linkage, interval, seed)
        found = times.run(lambda asked=asked, actuator=actuator: asked.best(actuator))
        fine, *_ = question(linkage, interval, seed, FINE)
        again = fine.best(actuator)
        # the grid's own best, also on links with a pivot, where the search needs none
        fine.link = replace(fine.link, pivot=None)
        grid = fine.screened(actuator)
        row["cases"] += 1
        row["clockwise"] += int(interval.last < 0)
        if isinstance(found, Refused):
            row["refused"] += 1
            row["missed"] += not isinstance(again, Refused) or (grid.refused is None and grid.short is None)
            continue
        best = found.worst
        if not isinstance(again, Refused):
            row["gap"] = float(max(row["gap"], best / again.worst - 1))
            row["worse"] += int(best > again.worst * (1 + BETTER))
        if grid.refused is None and grid.short is None:
            row["worse_than_grid"] += int(best > asked.scale_of_burden / grid.worth * (1 + BETTER))
        row["equilibrium"] = float(max(row["equilibrium"], equilibrium(linkage, machine, load, name, found)))
    return [
        {"link": name, **{key: value for key, value in row.items() if key != "times"}}
        | {"ms": 1000 * row["times"].median.processor, "p99": 1000 * row["times"].percentile(99).processor}
        for name, row in rows.items()
    ]


def _empty() -> dict[str, Any]:
    numbers = dict.fromkeys(("cases", "clockwise", "refused", "missed", "worse", "worse_than_grid"), 0)
    return {**numbers, "gap": 0.0, "equilibrium": 0.0, "times": Times()}


def motors(cases: int) -> list[dict[str, Any]]:
    """Swing and times of motors by circles at many positions, with the rod's angle between what the search looked at."""
    rows = []
    for name in ("crank or rocker", "coupler"):
        times, gaps, lost, angles, refused = Times(), [0.0], 0, [], 0
        for seed in range(cases // 2):
            linkage, interval = random_linkage(np.random.default_rng([seed, 2]))
            rng = np.random.default_rng([seed, 3])
            machine = machine_of(linkage, interval)
            ratio = [None, 1.0 + rng.uniform(0.02, 0.5)][seed % 2]
            link = machine.links["coupler" if name == "coupler" else ("crank", "rocker")[seed % 2]]
            torque = np.ones(machine.at.size)
            if name == "coupler":
                box = (-4.0, -4.0, 4.0, 4.0)
                found = times.run(on_any_link, link, machine.at, torque, ratio, 1.5, box)
            else:
                found = times.run(about_pivot, link, torque, ratio, 1.0, False, None)
            if isinstance(found, str):
                refused += 1
                continue
            gaps.append(_simulated(linkage, interval, link.name, found, ratio))
            fine = machine_of(linkage, interval, ANGLES)
            exact = driven(
                fine.links[link.name], np.ones(ANGLES), found.motor, found.pin, found.crank, found.rod, found.extends
            )
            lost += exact is None
            if exact is not None:
                angles.append(np.rad2deg(found.least_angle - exact.least_angle))
        rows.append(
            {
                "link": name,
                "cases": cases // 2,
                "refused": refused,
                "worst": max(gaps),
                "lost": lost,
                "between": float(max(angles)),
                "ms": 1000 * times.median.processor,
                "p99": 1000 * times.percentile(99).processor,
            }
        )
    return rows


def _simulated(linkage: Linkage, interval: Interval, name: str, found: Any, ratio: float | None) -> float:
    """By how much the ends of the way differ where the motor's crank and rod are in line, and the times from those asked for."""
    ends = machine_of(linkage, interval, 3).links[name].place(found.pin)[[0, -1]]
    reach = np.abs(ends - found.motor)
    lengths = [found.rod - found.crank, found.rod + found.crank][:: 1 if found.extends else -1]
    gap = float(np.max(np.abs(reach / lengths - 1)))
    # turn of the motor between both dead centres, forwards and backwards
    way = [1.0, -1.0] if not found.extends else [-1.0, 1.0]
    turn = abs(float(np.angle((ends[1] - found.motor) * way[1] / ((ends[0] - found.motor) * way[0]))))
    times = (2 * np.pi - turn) / turn
    asked = found.time_ratio if ratio is None else ratio
    return max(gap, abs(times / asked - 1))


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/drives.md."""
    return report.tables("drives", results["tables"])


def measure(cases: Annotated[int, "linkages"] = 300) -> Iterator[dict[str, Any]]:
    """Every table."""
    import scipy.optimize  # noqa: F401 - its import is no part of the first time

    tables = {"actuators": actuators(cases)}
    tables["motors"] = motors(cases)
    yield {"tables": tables}


if __name__ == "__main__":
    report.run(measure)
