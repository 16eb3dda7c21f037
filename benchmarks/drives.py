"""Drives of random linkages of all kinds: optima against finer grids, full motor turns, Newton-Euler forces, times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from linkage_atlas.drive_design.operation import FINE as FINE_WAY
from synthesis.drives.crank_rocker import place_motor_about_pivot
from synthesis.drives.links import GROUND, motions_at, motions_of
from synthesis.drives.motor import MotorCycle, evaluate_motor
from synthesis.drives.motor_search import place_motor
from synthesis.drives.placements import Placement, Refusal
from synthesis.guides import Kind
from synthesis.linkage import Linkage
from synthesis.target import Interval
from tests.oracles.driven_cases import Case, any_linkage
from tests.oracles.newton_euler import bodies
from tests.oracles.turned_motor import turned

FINE = 240
"""Number of points of the finer grid in each direction, four times the number of the search."""
ANGLES = 20_001
"""Number of angles of the motor at which its links are evaluated."""
BETTER = 1e-6


def equilibrium(case: Case, found: Placement) -> float:
    """Return the largest difference between the force of the actuator and a model of three bodies, relative to the largest force.

    The bodies are tracked at every position, because larger steps near a dead centre lead to the other circuit.
    """
    end = found.ground if case.on == GROUND else case.machine.links[case.on].point_at(found.ground)
    three, every_twelfth = bodies(case.linkage), slice(None, None, 12)
    states = three.along(case.machine.at)[every_twelfth]
    expected = [three.force(state, case.load, case.name, found.pin, case.on, end) for state in states]
    return float(np.abs(found.force[every_twelfth] - expected).max()) / found.peak


def actuators(cases: int) -> list[dict[str, Any]]:
    """Compare optima with the finer grid; return a row for each kind."""
    rows: dict[str, dict[str, Any]] = {kind.value: _empty() for kind in Kind}
    for seed in range(cases):
        case = Case(seed)
        row = rows[case.kind]
        times: Times = row["times"]
        question, actuator = case.question(), case.actuator
        found = times.run(lambda question=question, actuator=actuator: question.best(actuator))
        fine = case.question(FINE)
        best_of_grid = fine.best(actuator)
        # the optimum of the grid itself, also on links with a pivot, for which the search does not need a grid
        fine.link = replace(fine.link, pivot=None)
        grid = fine.screen([actuator])
        row["cases"] += 1
        row["clockwise"] += int(case.interval.last < 0)
        if isinstance(found, Refusal):
            row["refused"] += 1
            row["missed"] += not isinstance(best_of_grid, Refusal) or (
                not isinstance(grid, Refusal) and grid.shortfall is None
            )
            continue
        best = found.worst
        if not isinstance(best_of_grid, Refusal):
            row["gap"] = float(max(row["gap"], best / best_of_grid.worst - 1))
            row["worse"] += int(best > best_of_grid.worst * (1 + BETTER))
        if not isinstance(grid, Refusal) and grid.shortfall is None:
            row["worse_than_grid"] += int(best > question.torque_scale / grid.best_value * (1 + BETTER))
        row["equilibrium"] = float(max(row["equilibrium"], equilibrium(case, found)))
    return [
        {"link": kind.replace("_", " "), **{key: value for key, value in row.items() if key != "times"}}
        | {"ms": 1000 * row["times"].median.processor, "p99": 1000 * row["times"].percentile(99).processor}
        for kind, row in rows.items()
        if row["cases"]
    ]


def _empty() -> dict[str, Any]:
    numbers = dict.fromkeys(("cases", "clockwise", "refused", "missed", "worse", "worse_than_grid"), 0)
    return {**numbers, "gap": 0.0, "equilibrium": 0.0, "times": Times()}


def motors(cases: int) -> list[dict[str, Any]]:
    """Check motors on links with and without a fixed pivot over a full turn."""
    rows = []
    for what in ("with a fixed pivot", "without one"):
        times, gaps, lost, angles, refused, count = Times(), [0.0], 0, [0.0], 0, 0
        for seed in range(cases):
            linkage, interval = any_linkage(seed)
            machine = motions_of(linkage, interval)
            candidates = [
                candidate
                for candidate in machine.links.values()
                if (candidate.pivot is not None) == (what == "with a fixed pivot")
            ]
            if not candidates or seed // 4 % 2 != (what == "without one"):
                continue
            link, rng = candidates[seed % len(candidates)], np.random.default_rng([seed, 3])
            ratio = [None, 1.0 + rng.uniform(0.02, 0.5)][seed // 8 % 2]
            torque = np.ones(machine.at.size)
            count += 1
            if link.pivot is None:
                middle = complex(np.mean(link.origin))
                box = (middle.real - 4, middle.imag - 4, middle.real + 4, middle.imag + 4)
                found = times.run(place_motor, link, machine.at, torque, ratio, 1.5, box)
            else:
                found = times.run(place_motor_about_pivot, link, torque, ratio, 1.0, False, None)
            if isinstance(found, str):
                refused += 1
                continue
            gap, between = _turned(linkage, interval, link.name, found, ratio)
            gaps.append(gap)
            lost += not np.isfinite(gap)
            angles.append(between)
        rows.append(
            {
                "link": what,
                "cases": count,
                "refused": refused,
                "worst": float(np.max([gap for gap in gaps if np.isfinite(gap)])),
                "lost": lost,
                "between": float(np.nanmax(angles)),
                "ms": 1000 * times.median.processor,
                "p99": 1000 * times.percentile(99).processor,
            }
        )
    return rows


def _turned(
    linkage: Linkage | Linkage, interval: Interval, name: str, found: MotorCycle, ratio: float | None
) -> tuple[float, float]:
    """Return the largest error of swing, time ratio and rod (infinite if the link turns back), and the decrease of the angle."""

    def pin(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        link = motions_at(linkage, at).links[name]
        return link.position(found.pin), link.speed(found.pin)

    start = float(found.motor_angle[0, 0])
    with np.errstate(all="ignore"):
        motion = turned(pin, interval.first, found.motor, start, found.crank, found.rod, ANGLES)
    if not motion.swings:
        return np.inf, np.nan
    fine = motions_of(linkage, interval, FINE_WAY).links[name]
    evaluation = evaluate_motor(
        fine, np.ones(FINE_WAY), found.motor, found.pin, found.crank, found.rod, found.extends
    )
    assert evaluation is not None
    span = abs(interval.last - interval.first)
    swing = float(np.abs(motion.ends - np.sort([interval.first, interval.last])).max()) / span
    times = abs(motion.time_ratio / (found.time_ratio if ratio is None else ratio) - 1)
    return max(swing, times, motion.rod), float(
        np.rad2deg(evaluation.transmission_angle_min - motion.transmission_angle)
    )


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md."""
    return report.tables("drives", results["tables"])


def measure(cases: Annotated[int, "linkages"] = 600) -> Iterator[dict[str, Any]]:
    """Measure all tables."""
    import scipy.optimize  # noqa: F401 - its import is no part of the first time

    tables = {"actuators": actuators(cases)}
    tables["motors"] = motors(cases)
    yield {"tables": tables}


if __name__ == "__main__":
    report.run(measure)
