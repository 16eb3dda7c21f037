"""Radii and coupler lengths of linkages on two guides that can be had: on a grid or from stock, with all else fitted anew.

The lengths are those of cranks and rockers and, where both guides lead a point of the body, the distance of these points. Where
the guides stand, how the body lies on them and where the drive is at each sample are refined by least squares; where the drive is
free, what it could do itself is projected out of each sample's error.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.fourbar.rounding import NO_TIME, Rounding
from synthesis.free.poses import Poses
from synthesis.guided.solution import GuidedSolution, assess, nearest_travel
from synthesis.guides import Circle, Guide, Rail, Slot
from synthesis.least_squares import Evaluation, minimise
from synthesis.linkage import Linkage
from synthesis.target import TURN, Target
from synthesis.work import Work

AROUND = 2
"""Of each length the nearest so many are combined."""
NONE_KEEPS = "none of the lengths tried closes at every sample and keeps the limits"
_STEPS = 15
"""Largest number of steps of the least squares."""
_DAMPING = 1e-3
"""Damping of the first step."""
_STEP = 1e-6
"""Half the step of difference quotients, in lengths of the linkage's size."""
_STALL = 1e-5
"""Relative decrease of the squared error below which a step is the last."""


def rounded(
    samples: Poses | Target,
    solution: GuidedSolution,
    choices: Callable[[float], Sequence[float]],
    combinations: int | None,
    keeps: Callable[[GuidedSolution], bool],
    tries: int,
    work: Work,
) -> Rounding[GuidedSolution]:
    """The best linkage with lengths that can be had and that keeps limits.

    ``choices``: the nearest lengths that can be had, nearest first. ``combinations``: how many there are of all lengths
    together; None for a grid.
    """
    own = solution.linkage.lengths
    rows = [list(choices(length))[:AROUND] for length in own.values()]
    together = sorted(
        itertools.product(*rows), key=lambda row: sum(abs(np.log(a / b)) for a, b in zip(row, own.values()))
    )
    best: GuidedSolution | None = None
    tried = 0
    for row in together[:tries]:
        if tried and work.expired():
            break
        work.check()
        tried += 1
        found = fitted(samples, solution, dict(zip(own, row)), work)
        if found is None or not keeps(found):
            continue
        if best is None or found.errors.objective < best.errors.objective:
            best = found
    exhaustive = None if combinations is None else tried == combinations and not work.expired()
    why = None if best is not None else NO_TIME if work.expired() else NONE_KEEPS
    return Rounding(best, tried, combinations, exhaustive, why)


def on_grid(grid: float) -> Callable[[float], Sequence[float]]:
    """The nearest multiples of a grid, above 0."""

    def nearest(length: float) -> list[float]:
        low = max(1, int(np.floor(length / grid)))
        return sorted({low * grid, (low + 1) * grid}, key=lambda one: abs(one - length))

    return nearest


def from_stock(stock: Sequence[float]) -> Callable[[float], Sequence[float]]:
    """The nearest of a list of lengths."""
    return lambda length: sorted(set(stock), key=lambda one: abs(one - length))


# -- a linkage of given lengths ---------------------------------------------------------------------------------------


class _Chart:
    """Linkages of given lengths by what is left of their dimensions, in units of their size."""

    def __init__(self, linkage: Linkage, lengths: dict[str, float], timed: bool) -> None:
        self.linkage, self.lengths, self.timed = linkage, lengths, timed
        first, second = linkage.guides
        self.size = linkage.reach
        self.along = float(np.angle(second.body_point - first.body_point))
        self.count = 2 * 4 + timed

    def at(self, x: Floats) -> Linkage:
        """The linkage at changes x of the one that it began with."""
        guides: list[Guide] = []
        for place, (name, one) in enumerate(self.linkage.named_guides):
            own = x[4 * place : 4 * place + 4]
            fixed = one[0] + self.size * complex(own[0], own[1])
            point = one.body_point + self.size * complex(own[2], own[3])
            if place and "coupler" in self.lengths:
                # the second body point goes round the first; what would lengthen the coupler does nothing
                turn = self.along + float(own[2])
                point = complex(guides[0].body_point + self.lengths["coupler"] * np.exp(1j * turn))
            if isinstance(one, Circle):
                guides.append(Circle(fixed, self.lengths.get(name, one.radius), point))
            elif isinstance(one, Rail):
                # one change shifts the line, the other turns it
                normal = 1j * np.exp(1j * one.direction)
                shifted = complex(one.point + self.size * own[0] * normal)
                guides.append(Rail(shifted, one.direction + float(own[1]), point))
            else:
                normal = 1j * np.exp(1j * one.body_direction)
                moved = complex(one.body_point + self.size * own[2] * normal)
                guides.append(Slot(fixed, moved, one.body_direction + float(own[3])))
        unit = 1.0 if self.linkage.driver.turns else self.size
        start = self.linkage.start + (unit * float(x[8]) if self.timed else 0.0)
        return replace(self.linkage, local_guides=(guides[0], guides[1]), start=start)


def fitted(
    samples: Poses | Target, solution: GuidedSolution, lengths: dict[str, float], work: Work
) -> GuidedSolution | None:
    """A linkage of given lengths by least squares from a solution, as far as the time allows.

    None where its loop does not close at every sample.
    """
    timed = isinstance(samples, Target)
    chart = _Chart(solution.linkage, lengths, timed)
    begin = solution.travel if timed else solution.travel[: samples.samples]

    def evaluate(unknowns: Floats, _: Floats) -> Evaluation:
        rows = _evaluated(samples, chart, unknowns[0], begin)
        if rows is None:
            return Evaluation(np.array([np.inf]), np.zeros((1, chart.count + 1, 3 * begin.size)))
        return Evaluation(np.sum(rows[-1:] ** 2, axis=1), rows[None])

    start = np.zeros((1, chart.count))
    found = minimise(evaluate, start, np.zeros(1), _STEPS, work=work, stall=_STALL, damping=_DAMPING)
    if not np.isfinite(found.cost[0]):
        return None
    linkage = chart.at(found.unknowns[0])
    if timed:
        return assess(samples, linkage, begin)
    return assess(samples, linkage, _whole(samples, linkage, nearest_travel(samples, linkage, begin)))


def _whole(samples: Poses | Target, linkage: Linkage, travel: Floats) -> Floats:
    """Travel at all samples that were asked for: of a closed way whose last sample repeats the first a turn on, or back there."""
    if not isinstance(samples, Poses) or samples.asked is None:
        return travel
    return samples.whole(travel) if linkage.turns_fully else np.append(travel, travel[0])


def _evaluated(samples: Poses | Target, chart: _Chart, x: Floats, travel: Floats) -> Floats | None:
    """Return derivatives of the errors by the unknowns, and the errors as the last row; None if the loop is open."""
    linkage = chart.at(x)
    with np.errstate(all="ignore"):
        if not np.isfinite(linkage.body(linkage.start + travel).rotation).all():
            return None
        if not chart.timed:
            travel = nearest_travel(samples, linkage, travel)
        rows = _rows(samples, linkage, travel)
        columns = []
        for off in _STEP * np.eye(chart.count):
            ends = [_rows(samples, chart.at(x + sign * off), travel) for sign in (1, -1)]
            columns.append((ends[0] - ends[1]) / (2 * _STEP))
        jacobian = np.array(columns)
        if not chart.timed:
            step = _STEP * (1.0 if linkage.driver.turns else chart.size)
            way = (_rows(samples, linkage, travel + step) - _rows(samples, linkage, travel - step)) / (2 * step)
            # what the drive could do at a sample is no error of the linkage
            square = np.sum(way**2, axis=0)
            part = np.einsum("rn,krn->kn", way, jacobian) / np.where(square > 0, square, 1.0)
            jacobian = jacobian - way * part[:, None]
    stack = np.concatenate([jacobian, rows[None]]).reshape(chart.count + 1, -1)
    return stack if np.isfinite(stack).all() else None


def _rows(samples: Poses | Target, linkage: Linkage, travel: Floats) -> Floats:
    """Weighted errors (3, N): rotation, and position by x and y over the length scale."""
    found = linkage.body(linkage.start + travel)
    rows = np.zeros((3, travel.size))
    if samples.rotation is not None:
        gap = found.rotation - samples.rotation
        # rotations count modulo a turn, or to a constant whole number of turns
        gap = gap - TURN * np.round((gap if isinstance(samples, Poses) else gap[:1]) / TURN)
        rows[0] = samples.rotation_mean.root * gap
    if samples.position is not None:
        off = samples.position_mean.root * (found.position - samples.position) / samples.length_scale
        rows[1:] = off.real, off.imag
    return rows
