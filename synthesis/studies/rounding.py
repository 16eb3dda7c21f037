"""Linkages with lengths on a grid or from stock, and everything else fitted again.

`round_lengths` is the entry for all kinds. The search for combinations of the lengths of four-bars is
`four_bar_rounding`.

The lengths are the lengths of cranks and rockers and, if both guides hold a point of the body, the distance of these
points. The positions of the guides, the position of the body on them, and the drive at each sample are refined by least
squares; if the drive is free, the error that it could remove is projected out at each sample.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.guides import Circle, Guide, Rail, Slot
from synthesis.least_squares import Evaluation, minimise
from synthesis.limits import Limits
from synthesis.linkage import Linkage, on_guides
from synthesis.local_refinement import refined_in_place
from synthesis.poses import Poses
from synthesis.solution import Solution, assess, target_of
from synthesis.studies.four_bar_rounding import NO_TIME, Rounding, best_from_stock, round_to_grid
from synthesis.target import TURN, Samples, Target
from synthesis.violations import violations_of
from synthesis.work import Work

AROUND = 2
"""Number of nearest lengths that are combined for each length."""
NONE_KEEPS = "no combination of lengths that was tried closes at every sample and satisfies the limits"
_STEPS = 15
"""Largest number of steps of the least squares."""
_DAMPING = 1e-3
"""Damping of the first step."""
_STEP = 1e-6
"""Half the step of difference quotients, in lengths of the linkage's size."""
_STALL = 1e-5
"""Relative decrease of the squared error below which a step is the last."""
_TRAVEL_STEPS = 30
"""Largest number of Newton steps towards the travel at which the body is nearest to a sample."""
_ARRIVED = 1e-7
"""Step, relative to the longest step, that is the last: the next step would be its square."""
_BACK = 20
"""Largest number of halvings of a step that would increase a sample's error, or open the loop."""


@dataclass(frozen=True)
class RoundingOptions:
    """Options of `round_lengths`."""

    four_bar_tries: int = 4000
    """Number of combinations of lengths that are fitted in all four-bars of a request: about two seconds."""
    min_four_bar_tries: int = 40
    """Minimum number of combinations for each four-bar."""
    tries: int = 40
    """Number of combinations that are fitted in all linkages with rails or slots of a request."""
    min_tries: int = 2
    """Minimum number of combinations for each such linkage."""
    max_tries: int = 8
    """Maximum number of combinations for each such linkage."""


def round_lengths(
    samples: Poses | Target,
    solution: Solution,
    limits: Limits,
    grid: float | None,
    stock: Sequence[float] | None,
    work: Work,
    solutions: int = 1,
    options: RoundingOptions | None = None,
) -> Rounding:
    """Return the best linkage with lengths on a grid or from stock, everything else fitted again within the limits.

    Parameters
    ----------
    samples : Poses or Target
    solution : Solution
    limits : Limits
    grid : float or None
        Step of the lengths.
    stock : sequence of float or None
        Lengths to choose from, instead of a grid.
    work : Work
    solutions : int
        Number of solutions of the request that are rounded.
    options : RoundingOptions, optional
    """
    options = options or RoundingOptions()
    if not solution.linkage.is_four_bar:
        tries = max(options.min_tries, min(options.max_tries, options.tries // solutions))
        return _best_of_nearest(samples, solution, limits, grid, stock, tries, work)
    tries = max(options.min_four_bar_tries, options.four_bar_tries // solutions)
    target = target_of(samples, solution.linkage, solution.travel)
    if stock is not None:
        found = best_from_stock(target, solution, stock, limits, tries, work)
    else:
        found = round_to_grid(target, solution, grid or 0.0, limits, tries, work)
    if found.solution is None or not isinstance(samples, Poses):
        return found
    return replace(found, solution=refined_in_place(samples, limits, found.solution, target.crank, work))


def _best_of_nearest(
    samples: Poses | Target,
    solution: Solution,
    limits: Limits,
    grid: float | None,
    stock: Sequence[float] | None,
    tries: int,
    work: Work,
) -> Rounding:
    """Fit combinations of the nearest lengths, the nearest first, and return the best within the limits."""
    own = solution.linkage.lengths
    combinations = itertools.product(*(_nearest(length, grid, stock) for length in own.values()))
    nearest_first = sorted(combinations, key=lambda row: sum(abs(np.log(a / b)) for a, b in zip(row, own.values())))
    best: Solution | None = None
    tried = 0
    for row in nearest_first[:tries]:
        if tried and work.expired():
            break
        work.check()
        tried += 1
        found = fitted(samples, solution, dict(zip(own, row)), work)
        if found is None or violations_of(found, samples, limits):
            continue
        if best is None or found.errors.objective < best.errors.objective:
            best = found
    count = None if stock is None else len(set(stock)) ** len(own)
    exhaustive = None if count is None else tried == count and not work.expired()
    reason = None if best is not None else NO_TIME if work.expired() else NONE_KEEPS
    return Rounding(best, tried, count, exhaustive, reason)


def _nearest(length: float, grid: float | None, stock: Sequence[float] | None) -> list[float]:
    """Return the multiples of a grid above 0, or the lengths from stock, nearest to a length, nearest first."""
    choices = set(stock or ())
    if grid is not None:
        low = max(1, int(np.floor(length / grid)))
        choices = {low * grid, (low + 1) * grid}
    return sorted(choices, key=lambda choice: abs(choice - length))[:AROUND]


# -- a linkage of given lengths ---------------------------------------------------------------------------------------


class _Chart:
    """Linkages with given lengths; the unknowns are changes of the remaining dimensions, in units of the linkage's size."""

    def __init__(self, linkage: Linkage, lengths: dict[str, float], timed: bool) -> None:
        self.linkage, self.lengths, self.timed = linkage, lengths, timed
        first, second = linkage.guides
        self.size = linkage.reach
        self.along = float(np.angle(second.body_point - first.body_point))
        self.count = 2 * 4 + timed

    def at(self, x: Floats) -> Linkage:
        """Return the linkage after changes x."""
        guides: list[Guide] = []
        for index, (name, guide) in enumerate(self.linkage.named_guides):
            own = x[4 * index : 4 * index + 4]
            fixed = guide[0] + self.size * complex(own[0], own[1])
            point = guide.body_point + self.size * complex(own[2], own[3])
            if index and "coupler" in self.lengths:
                # the second body point turns about the first; a change along the coupler has no effect
                turn = self.along + float(own[2])
                point = complex(guides[0].body_point + self.lengths["coupler"] * np.exp(1j * turn))
            if isinstance(guide, Circle):
                guides.append(Circle(fixed, self.lengths.get(name, guide.radius), point))
            elif isinstance(guide, Rail):
                # a single change shifts the line, the other turns it
                normal = 1j * np.exp(1j * guide.direction)
                shifted = complex(guide.point + self.size * own[0] * normal)
                guides.append(Rail(shifted, guide.direction + float(own[1]), point))
            else:
                normal = 1j * np.exp(1j * guide.body_direction)
                moved = complex(guide.body_point + self.size * own[2] * normal)
                guides.append(Slot(fixed, moved, guide.body_direction + float(own[3])))
        unit = 1.0 if self.linkage.driver.turns else self.size
        start = self.linkage.start + self.linkage.ground_angle + (unit * float(x[8]) if self.timed else 0.0)
        return on_guides((guides[0], guides[1]), self.linkage.driver, self.linkage.branch, start)


def fitted(samples: Poses | Target, solution: Solution, lengths: dict[str, float], work: Work) -> Solution | None:
    """Fit a linkage of given lengths by least squares, starting from a solution; None if the loop opens at a sample."""
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
        return assess(samples, [linkage], begin)[0]
    travel = _complete_travel(samples, linkage, nearest_travel(samples, linkage, begin))
    return assess(samples, [linkage], travel)[0]


def _complete_travel(samples: Poses | Target, linkage: Linkage, travel: Floats) -> Floats:
    """Return the travel at all requested samples, including the last sample of a closed path, which repeats the first."""
    if not isinstance(samples, Poses) or samples.requested is None:
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
            slope = (_rows(samples, linkage, travel + step) - _rows(samples, linkage, travel - step)) / (2 * step)
            # remove the error that the drive could remove at a sample
            square = np.sum(slope**2, axis=0)
            part = np.einsum("rn,krn->kn", slope, jacobian) / np.where(square > 0, square, 1.0)
            jacobian = jacobian - slope * part[:, None]
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


# -- travel of the drive ----------------------------------------------------------------------------------------------


def nearest_travel(samples: Samples, linkage: Linkage, begin: Floats) -> Floats:
    """Return the travel from the linkage's start at which the body is nearest to each sample, by Newton's method.

    ``samples``: rotations count modulo a turn. ``begin`` (N,): initial travel, at which the loop closes.

    Law: at every sample the derivative of the error by the travel is zero, unless the drive is at an end of its range.
    """
    travel = np.array(begin, dtype=float)
    square = squared_errors(samples, linkage, travel)
    weights = _weights(samples)
    for _ in range(_TRAVEL_STEPS):
        first, second = _slopes(samples, linkage, travel, weights)
        # towards a minimum if the error is convex, otherwise along the first-order step
        step = np.nan_to_num(-first / np.where(second > 0, second, np.inf))
        longest = 0.3 if linkage.driver.turns else 0.3 * samples.length_scale
        step = np.clip(step, -longest, longest)
        going = np.abs(step) > _ARRIVED * longest
        if not going.any():
            there = squared_errors(samples, linkage, travel + step)
            return np.where(np.isfinite(there), travel + step, travel)
        for _ in range(_BACK):
            there = squared_errors(samples, linkage, travel + step)
            worse = going & ~(there <= square)
            if not worse.any():
                break
            step = np.where(worse, step / 2, step)
        keep = there <= square
        travel, square = np.where(keep, travel + step, travel), np.where(keep, there, square)
        if not np.any(keep & going):
            break
    return travel


def _weights(samples: Samples) -> tuple[Floats, Floats]:
    """Return the weights of squared errors of rotation and of position at each sample, (N,)."""
    # for a single sample only the ratio of both matters
    turning: Floats = np.zeros(samples.samples)
    placing = turning
    if samples.rotation is not None:
        turning = turning + samples.rotation_mean.root**2
    if samples.position is not None:
        placing = placing + samples.position_mean.root**2 / samples.length_scale**2
    return turning, placing


def _gaps(samples: Samples, linkage: Linkage, travel: Floats) -> tuple[Floats, Complexes]:
    """Return errors of rotation (to the nearest whole turn) and position; zeros if the sample does not prescribe them."""
    found = linkage.body(linkage.start + travel)
    turned: Floats = np.zeros(travel.shape)
    if samples.rotation is not None:
        turned = found.rotation - samples.rotation
        turned = turned - TURN * np.round(turned / TURN)
    off = np.zeros(travel.shape, dtype=complex) if samples.position is None else found.position - samples.position
    return turned, off


def squared_errors(samples: Samples, linkage: Linkage, travel: Floats) -> Floats:
    """Return the weighted squared error at each sample, (N,); infinite if the loop does not close."""
    turning, placing = _weights(samples)
    turned, off = _gaps(samples, linkage, travel)
    square = turning * turned**2 + placing * np.abs(off) ** 2
    return np.where(np.isfinite(square), square, np.inf)


def _slopes(
    samples: Samples, linkage: Linkage, travel: Floats, weights: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """Return first and second derivatives of half the squared error by the travel; the second has a lower bound."""
    turning, placing = weights
    turned, off = _gaps(samples, linkage, travel)
    rates = linkage.rates(linkage.start + travel)
    first = turning * turned * rates.rotation + placing * np.real(np.conj(off) * rates.position)
    gauss = turning * rates.rotation**2 + placing * np.abs(rates.position) ** 2
    curved = turning * turned * rates.rotation_second + placing * np.real(np.conj(off) * rates.position_second)
    return first, np.where(gauss + curved > 0.1 * gauss, gauss + curved, gauss)
