"""Linkages with lengths on a grid or from stock, and everything else fitted again.

The lengths are the lengths of cranks and rockers, the distance of the points of the body if both guides hold a point, and the
ground of a four-bar. The positions of the guides, the position of the body on them, and the drive at each sample are refined by
least squares; if the drive is free, the error that it could remove is projected out at each sample.

Near a solution the squared error is a quadratic form of the logarithms of the lengths, with everything else fitted again.
Combinations of available lengths are fitted in the order of this estimate, from the dimensions that it predicts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.errors import FieldError
from synthesis.four_bar import close_loop, transmission_angle_over, wrap
from synthesis.fourbar.mechanism import mounted
from synthesis.guides import Circle, Guide
from synthesis.least_squares import Evaluation, minimise
from synthesis.limits import PIVOTS, Limits, in_family
from synthesis.linkage import Linkage, as_lengths, four_bar, on_guides, with_links
from synthesis.local_refinement import refine_motion, refine_poses
from synthesis.poses import Poses
from synthesis.solution import Solution, assess, target_of
from synthesis.studies.sensitivity import (
    Deviation,
    Deviations,
    derivatives,
    deviated,
    guide_dimensions,
    length_changes,
    null_space,
    weighted,
    without_drive,
)
from synthesis.target import TURN, Interval, Samples, Target
from synthesis.violations import violations_of
from synthesis.work import Work

NONE_FITS = "none of the lengths that were tried closes at all crank angles of this solution within the limits"
NO_TIME = "the time was up before a linkage with available lengths was found"


class Steps(NamedTuple):
    """End of a least-squares fit."""

    max_steps: int
    """Largest number of steps."""
    stall: float
    """Relative decrease of the squared error below which the fit ends."""


@dataclass(frozen=True)
class RoundingOptions:
    """Options of `round_lengths`."""

    choices: int = 6
    """Largest number of available lengths, the nearest, that are combined for each link."""
    tries: int = 144
    """Number of combinations that are fitted in all linkages of a request."""
    min_tries: int = 8
    """Minimum number of combinations for each linkage."""
    max_tries: int = 96
    """Maximum number of combinations for each linkage."""
    batch: int = 32
    """Number of combinations that are fitted before the others are estimated again, from the best of these."""
    sufficient_ratio: float = 1.01
    """Ratio of the objectives of available lengths and of the solution up to which no other lengths are tried."""
    exact: float = 1e-12
    """Objective that is only rounding."""
    starts: int = 48
    """Number of starts at which the transmission angles of combinations of a four-bar are compared with the limits."""
    descents: int = 8
    """Number of four-bars of the nearest lengths that are refined within the limits if no fit is within them."""
    turned: int = 4
    """Number of other starts, over the whole turn, from which a four-bar is fitted."""
    other_kinds: int = 4
    """Number of four-bars that are fitted in the time of a linkage of another kind."""
    first_steps: Steps = Steps(8, 1e-3)  # noqa: RUF009
    """End of the fit of a combination."""
    together_steps: Steps = Steps(12, 1e-2)  # noqa: RUF009
    """End of the fit of combinations of four-bars, which are fitted together."""
    steps: Steps = Steps(30, 1e-7)  # noqa: RUF009
    """End of the fit of the best combination."""
    change_weight: float = 1e-2
    """Weight of a length's own change beside the estimate: of lengths that the motion does not fix the nearest come first."""
    travel_steps: int = 30
    """Largest number of Newton steps towards the travel at which the body is nearest to a sample."""
    few_travel_steps: int = 5
    """Largest number of these Newton steps in a step of the least squares, which begins with the travel of the step before."""
    arrived: float = 1e-7
    """Step, relative to the longest step, that is the last: the next step would be its square."""
    halvings: int = 20
    """Largest number of halvings of a step that would increase a sample's error, or open the loop."""


OPTIONS = RoundingOptions()


@dataclass(frozen=True)
class Rounding:
    """Result of a search for available lengths.

    ``solution``: the best solution; None if no examined combination can be fitted within the limits. ``tried``: number of fitted
    combinations. ``combinations``: number of all combinations; None for a grid, which has no end. ``exhaustive``: True if all
    combinations were fitted; None for a grid. ``reason``: reason for an empty result.
    """

    solution: Solution | None
    tried: int
    combinations: int | None = None
    exhaustive: bool | None = None
    reason: str | None = None


def round_lengths(
    samples: Poses | Target,
    solution: Solution,
    limits: Limits,
    grid: float | None,
    stock: Sequence[float] | None,
    work: Work,
    solutions: int = 1,
) -> Rounding:
    """Return the best linkage with lengths on a grid or from stock, everything else fitted again within the limits.

    Parameters
    ----------
    samples : Poses or Target
    solution : Solution
    limits : Limits
        Lengths and pivots that it gives do not change.
    grid : float or None
        Step of the lengths. If the nearest lengths increase the error only slightly, no others are tried.
    stock : sequence of float or None
        Lengths to choose from, instead of a grid.
    work : Work
    solutions : int
        Number of solutions of the request that are rounded.
    """
    own = solution.linkage.lengths
    given = given_lengths(limits) if solution.linkage.is_four_bar else np.full(len(own), np.nan)
    choices = [
        _nearest(length, grid, stock) if np.isnan(fixed) else [fixed]
        for length, fixed in zip(own.values(), given.tolist())
    ]
    count = None if stock is None else len(set(stock)) ** int(np.isnan(given).sum())
    combinations = _allowed(np.array(list(itertools.product(*choices)), dtype=float), solution, limits)
    tries = max(OPTIONS.min_tries, min(OPTIONS.max_tries, OPTIONS.tries // solutions))
    tries = tries if solution.linkage.is_four_bar else tries // OPTIONS.other_kinds
    sufficient = max(OPTIONS.sufficient_ratio * solution.errors.objective, OPTIONS.exact)
    best: Solution | None = None
    tried = 0
    for found in itertools.islice(_in_order(samples, solution, combinations, limits, work), tries):
        tried += 1
        best = _better(best, found)
        if work.expired() or (best is not None and best.errors.objective <= sufficient):
            break
    if best is None:  # fits know no limits, descents do
        fit = _Fit(samples, solution, limits, work)
        change = np.sum(np.abs(np.log(combinations / [*own.values()])), axis=1)
        for k in np.argsort(change)[: OPTIONS.descents]:
            best = _better(best, fit.descended(solution, combinations[k]))
    exhaustive = None if count is None else tried == count
    if best is None:
        return Rounding(None, tried, count, exhaustive, NO_TIME if work.expired() else NONE_FITS)
    fit = _Fit(samples, best, limits, work)
    finest = fit.fitted(np.array([*best.linkage.lengths.values()]), fit.no_change, OPTIONS.steps)
    if finest is not None and not violations_of(finest, samples, limits):
        best = _better(best, finest)
    return Rounding(best, tried, count, exhaustive)


def _in_order(
    samples: Poses | Target, solution: Solution, combinations: Floats, limits: Limits, work: Work
) -> Iterator[Solution | None]:
    """Yield the fitted linkages of lengths in the order of their estimates, or None if it opens or violates limits."""
    best = solution
    batch = OPTIONS.batch // (1 if solution.linkage.is_four_bar else OPTIONS.other_kinds)
    while len(combinations):
        fit = _Fit(samples, best, limits, work)
        order, starts = fit.in_order(combinations)
        combinations = combinations[order]
        fitted: Solution | None = None
        for found in fit.fitted_each(combinations[:batch], starts):
            work.check()
            within = found if found is not None and not violations_of(found, samples, limits) else None
            fitted = _better(fitted, within)
            yield within
        best, combinations = fitted or best, combinations[batch:]


def _better(first: Solution | None, second: Solution | None) -> Solution | None:
    known = [solution for solution in (first, second) if solution is not None]
    return min(known, key=lambda solution: solution.errors.objective, default=None)


def given_lengths(limits: Limits) -> Floats:
    """Return the lengths of a four-bar that the limits give, which are no choice, (4,); NaN for the others."""
    lengths = np.array([np.nan if length is None else length for length in limits.links])
    if limits.pivot_a is not None and limits.pivot_b is not None:
        lengths[3] = abs(limits.pivot_b - limits.pivot_a)
    return lengths


def multiples(steps: Floats, grid: float) -> Floats:
    """Return whole numbers of steps of a grid as decimal numbers: three tenths are exactly 0.3."""
    return np.array([float(f"{length:.15g}") for length in (steps * grid).tolist()])


def _allowed(links: Floats, solution: Solution, limits: Limits) -> Floats:
    """Return the combinations of lengths (n, lengths) that the limits of lengths and shape allow from some start."""
    low, high = limits.link_min or 0.0, limits.link_max or np.inf
    allowed = np.all((links >= low) & (links <= high), axis=1)
    if limits.link_ratio_max is not None and links.size:
        allowed &= links.max(axis=1) <= limits.link_ratio_max * links.min(axis=1)
    if solution.linkage.is_four_bar:
        start = np.linspace(0.0, TURN, OPTIONS.starts, endpoint=False)[:, None]
        angle = np.nan_to_num(transmission_angle_over(links, solution.interval.after(start))).max(axis=0)
        over_turn = transmission_angle_over(links, Interval(0.0, TURN))  # NaN if the crank does not turn fully
        allowed &= in_family(limits.family, links) & (angle > 0) & (angle >= limits.transmission_angle_min)
        allowed &= ~(over_turn < limits.transmission_angle_min_turn)
    return links[allowed]


def _nearest(length: float, grid: float | None, stock: Sequence[float] | None) -> list[float]:
    """Return the multiples of a grid above 0, or the lengths from stock, nearest to a length, nearest first."""
    choices = np.unique(stock or ())
    if grid is not None:
        step, around = max(1.0, round(length / grid)), OPTIONS.choices // 2
        choices = multiples(np.arange(max(1.0, step - around), step + around + 1), grid)
    return choices[np.argsort(np.abs(np.log(choices / length)), kind="stable")][: OPTIONS.choices].tolist()


# -- linkages of given lengths ----------------------------------------------------------------------------------------


class _Fit:
    """Least squares of linkages with given lengths, starting from a solution.

    The unknowns are changes of all dimensions but the radii, in units of the linkage's size, and with given timing the start of
    the drive. After a change the lengths are restored.
    """

    def __init__(self, samples: Poses | Target, solution: Solution, limits: Limits, work: Work) -> None:
        self.samples, self.limits, self.work = samples, limits, work
        self.linkage, self.size = solution.linkage, solution.linkage.reach
        self.timed = isinstance(samples, Target)
        self.travel = solution.travel if self.timed else solution.travel[: samples.samples]
        self.held = limits.pivot_a is not None, limits.pivot_b is not None
        self.target = target_of(samples, self.linkage, solution.travel)
        self.units = [
            pair
            for name, pair in guide_dimensions(self.linkage)
            if not any(unit.fixed and getattr(limits, pivot) is not None for pivot, unit in zip(PIVOTS, pair))
        ]
        self.no_change = np.zeros(len(self.units) + self.timed)

    def in_order(self, links: Floats) -> tuple[Ints, Floats]:
        """Return the order of combinations of lengths (n, lengths) by their estimates, and the unknowns predicted for each."""
        own = self.linkage.lengths
        lengths = np.array([*own.values()])
        residual = _misses_of(self.samples, self.linkage, self.travel).ravel()
        matrix = np.nan_to_num(self._derivatives(self.linkage, self.units, self.travel))
        by_length = length_changes(self.linkage, self.units)
        changes = np.array([by_length[name] for name in own]).reshape(len(own), len(self.units)) * self.size
        changes = np.pad(changes, ((0, 0), (0, len(matrix) - len(self.units))))
        free = null_space(changes)
        begin = (links - lengths) @ np.linalg.pinv(changes).T
        begin = begin - (residual + begin @ matrix) @ np.linalg.pinv(matrix.T @ free).T @ free.T
        own_change = OPTIONS.change_weight * np.linalg.norm(matrix) * np.log(links / lengths)
        estimate = np.sum((residual + begin @ matrix) ** 2, axis=1) + np.sum(own_change**2, axis=1)
        order = np.argsort(estimate, kind="stable")
        return order, begin[order]

    def fitted(self, links: Floats, start: Floats, steps: Steps) -> Solution | None:
        """Return a linkage of given lengths, fitted without limits; None if the loop opens at a sample."""
        travel, lengths = self.travel, dict(zip(self.linkage.lengths, links.tolist()))

        def evaluate(unknowns: Floats, _: Floats) -> Evaluation:
            nonlocal travel
            linkage, units = self._at(unknowns[0], lengths)
            with np.errstate(all="ignore"):
                closes = np.isfinite(linkage.body(linkage.start + travel).rotation).all()
                if closes and not self.timed:
                    travel = nearest_travel(self.samples, linkage, travel, OPTIONS.few_travel_steps)
                residual = _misses_of(self.samples, linkage, travel).ravel()
                rows = np.vstack([self._derivatives(linkage, units, travel), residual])
            known = closes and np.isfinite(rows).all()
            cost = np.sum(residual**2) if known else np.inf
            return Evaluation(np.array([cost]), np.nan_to_num(rows)[None])

        found = minimise(evaluate, start[None], np.zeros(1), steps.max_steps, work=self.work, stall=steps.stall)
        if not np.isfinite(found.cost[0]):
            return self.fitted(links, self.no_change, steps) if start.any() else None
        linkage = self._at(found.unknowns[0], lengths)[0]
        if linkage.is_four_bar:
            linkage = with_links(linkage, as_lengths(lengths.values()))
        if not self.timed:
            travel = self._complete(linkage, nearest_travel(self.samples, linkage, travel))
        return assess(self.samples, [linkage], travel)[0]

    def fitted_each(self, links: Floats, starts: Floats) -> Iterable[Solution | None]:
        """Return linkages of lengths (n, lengths), fitted by a few steps; the travel of four-bars is right to first order."""
        if not self.linkage.is_four_bar:
            return (self.fitted(row, start, OPTIONS.first_steps) for row, start in zip(links, starts))
        begun = [
            [with_links(linkage, as_lengths(row)) for linkage in self._starts(row, start)]
            for row, start in zip(links, starts)
        ]
        return self._together(_FourBars(self, list(itertools.chain(*begun))), len(begun))

    def _starts(self, links: Floats, start: Floats) -> list[Linkage]:
        """Return the linkage as predicted and unchanged, and in its best pose from other starts (unchanged if it opens)."""
        lengths = dict(zip(self.linkage.lengths, links.tolist()))
        near = [self._at(x, lengths)[0] for x in (start, self.no_change)]
        if any(self.held):
            return near
        begin = self.linkage.start + np.linspace(0.0, TURN, OPTIONS.turned + 1, endpoint=False)[1:]
        closes = np.all(close_loop(links, begin[:, None] + self.travel).closed, axis=1)
        count = int(np.sum(closes))
        found = iter(mounted(self.target, [links] * count, [self.linkage.branch] * count, begin[closes]))
        return near + [next(found) if closed else self.linkage for closed in closes]

    def _together(self, four_bars: _FourBars, count: int) -> list[Solution | None]:
        """Return the best of the four-bars of each of several combinations, all fitted together; None if all open."""
        numbers = np.arange(len(four_bars.begun), dtype=float)
        steps, stall = OPTIONS.together_steps
        found = minimise(four_bars.evaluate, four_bars.begin, numbers, steps, work=self.work, stall=stall).unknowns
        cost = four_bars.evaluate(found, numbers).cost
        closes = close_loop(four_bars.links, four_bars.crank + found[:, 2:3]).closed.all(axis=1)
        cost = np.where(closes, cost, np.inf).reshape(count, -1)
        best = np.argmin(cost, axis=1) + np.arange(0, cost.size, cost.shape[1])
        closes = np.isfinite(cost.min(axis=1))
        linkages, travels = [], []
        for k in best[closes].tolist():
            linkages.append(four_bars.linkage(k, found[k]))
            travel = four_bars.crank[k] - four_bars.begun[k].start
            travels.append(self.travel if self.timed else self._complete(linkages[-1], travel))
        fitted = iter(assess(self.samples, linkages, np.array(travels)))
        return [next(fitted) if closed else None for closed in closes.tolist()]

    def descended(self, found: Solution, lengths: Floats) -> Solution | None:
        """Return a four-bar of given lengths that a descent within the limits finds from a linkage out of them."""
        if not found.linkage.is_four_bar:
            return None
        links = as_lengths(lengths)
        try:
            held = replace(self.limits, links=links)
        except FieldError:  # the lengths themselves violate a limit
            return None
        begin = with_links(found.linkage, links)
        if isinstance(self.samples, Target):
            refined, _ = refine_motion(self.samples, held, begin, 0.0, self.work)
        else:
            refined, _ = refine_poses(self.samples, held, begin, found.travel, 0.0, self.work)
        for solution in refined:
            linkage = with_links(solution.linkage, links)
            exact = assess(target_of(self.samples, linkage, solution.travel), [linkage])[0]
            if not violations_of(exact, self.samples, self.limits):
                return exact
        return None

    def _complete(self, linkage: Linkage, travel: Floats) -> Floats:
        """Return the travel at all requested samples, including the last sample of a closed path, which repeats the first."""
        if not isinstance(self.samples, Poses) or self.samples.requested is None:
            return travel
        return self.samples.whole(travel) if linkage.turns_fully else np.append(travel, travel[0])

    def _at(self, x: Floats, lengths: dict[str, float]) -> tuple[Linkage, list[Deviations]]:
        """Return the linkage after changes x with its lengths restored, and its changes by each unknown."""
        guides = [self._changed(index, x, lengths) for index in (0, 1)]
        units = [[unit._replace(radius=0.0) for unit in pair] for pair in self.units]
        # the second guide moves, or the first if the pivot of the second is given
        for name, field, moved in (
            ("coupler", "body_point", 1),
            ("ground", "fixed", int(self.limits.pivot_b is None)),
        ):
            if name not in lengths:
                continue
            points = [guide.body_point if name == "coupler" else guide[0] for guide in guides]
            restored = _Restored(points[moved] - points[1 - moved], lengths[name])
            end: dict[str, Any] = {
                "body_point" if name == "coupler" else "pivot": points[1 - moved] + restored.vector
            }
            guides[moved] = guides[moved]._replace(**end)
            for pair in units:
                held, free = (getattr(pair[index], field) for index in (1 - moved, moved))
                pair[moved] = pair[moved]._replace(**{field: held + restored.change(free - held)})
        unit = 1.0 if self.linkage.driver.turns else self.size
        start = self.linkage.start + self.linkage.ground_angle + (unit * float(x[-1]) if self.timed else 0.0)
        linkage = on_guides((guides[0], guides[1]), self.linkage.driver, self.linkage.branch, start)
        return linkage, [(first, second) for first, second in units]

    def _changed(self, index: int, x: Floats, lengths: dict[str, float]) -> Guide:
        """Return a guide after changes x."""
        name, guide = self.linkage.named_guides[index]
        parts = zip(*(unit[index] for unit in self.units))
        _, point, fixed, turn = (complex(np.dot(x[: len(self.units)], part)) for part in parts)
        changed = deviated(guide, Deviation(0.0, self.size * point, self.size * fixed, turn.real))
        return changed._replace(radius=lengths.get(name, guide.radius)) if isinstance(guide, Circle) else changed

    def _derivatives(self, linkage: Linkage, units: Sequence[Deviations], travel: Floats) -> Floats:
        """Return the derivatives of the weighted errors by all unknowns, (unknowns, rows N)."""
        coordinate = linkage.start + travel
        positions, rotations = derivatives(linkage, coordinate, units)
        rates = linkage.rates(coordinate)
        found = weighted(self.samples, rotations, positions)
        drive = weighted(self.samples, rates.rotation, rates.position)
        found = np.concatenate([found, drive[None]]) if self.timed else without_drive(found, drive)
        scale = np.array([1.0 if any(change.direction for change in pair) else self.size for pair in units])
        if self.timed:
            scale = np.append(scale, 1.0 if linkage.driver.turns else self.size)
        return (found * scale[:, None, None]).reshape(len(found), -1)


class _FourBars:
    """Least squares of many four-bars, each of its own lengths.

    The unknowns are the ground's angle, the offset of the body, the start, the body point, and the pivot about which the ground
    turns: B if only B is given, else A. If the drive is free, it takes a Newton step in each step of the least squares.
    """

    def __init__(self, fit: _Fit, begun: Sequence[Linkage]) -> None:
        self.fit, self.begun, self.scale = fit, begun, fit.samples.length_scale
        self.links = np.array([linkage.links for linkage in begun])
        self.branch = np.array([linkage.branch for linkage in begun])
        self.crank = np.array([linkage.start for linkage in begun])[:, None] + fit.travel
        self.to_a = -self.links[:, 3:] if fit.held == (False, True) else np.zeros((len(begun), 1))
        turns = np.array([(linkage.ground_angle, linkage.body_offset or 0.0, 0.0) for linkage in begun])
        points = np.array([(linkage.arm, linkage.pivot_a) for linkage in begun])
        points[:, 1:] -= self.to_a * np.exp(1j * turns[:, :1])
        self.begin = np.hstack([turns, points.view(float) / self.scale])
        self.varies = np.array([not all(fit.held), *[True] * 4, *[not any(fit.held)] * 2])

    def linkage(self, k: int, unknowns: Floats) -> Linkage:
        """Return the four-bar of number k."""
        turn, offset, start, x, y, pivot_x, pivot_y = unknowns.tolist()
        begun, point = self.begun[k], self.scale * complex(x, y)
        pivot_a = complex(self.scale * complex(pivot_x, pivot_y) + self.to_a[k, 0] * np.exp(1j * turn))
        polar = abs(point), float(np.angle(point))
        return four_bar(begun.links, begun.branch, begun.start + start, pivot_a, wrap(turn), polar, offset)

    def evaluate(self, unknowns: Floats, numbers: Floats) -> Evaluation:
        """Return residuals and derivatives of the four-bars of some numbers."""
        index, samples, scale = numbers.astype(int), self.fit.samples, self.scale
        turn, offset, start, x, y, pivot_x, pivot_y = unknowns.T[:, :, None]
        loop, branch = close_loop(self.links[index], self.crank[index] + start), self.branch[index]
        coupler, rate = loop.coupler_angle(branch), loop.coupler_angle_gradient(branch)[..., 4]
        pin = self.links[index, :1] * np.exp(1j * (loop.crank_angle + turn))
        axis = scale * np.exp(1j * (coupler + turn))
        arm = (x + 1j * y) * axis
        around = self.to_a[index] * np.exp(1j * turn) + pin + arm
        missed = _misses(samples, scale * (pivot_x + 1j * pivot_y) + around, coupler + turn + offset)
        still, one = np.zeros(coupler.shape), np.ones(coupler.shape)
        moves = [1j * around, still, 1j * (pin + rate * arm), axis, 1j * axis, scale * one, 1j * scale * one]
        rows = weighted(samples, np.stack([one, one, rate, *[still] * 4]), np.stack(moves))
        drive = rows[2]
        rows = np.concatenate([rows * self.varies[:, None, None, None], missed[None]])
        if not self.fit.timed:
            with np.errstate(all="ignore"):
                share = np.sum(rows * drive, axis=-2) / np.sum(drive**2, axis=-2)
            rows = rows - share[:, :, None] * drive
            self.crank[index] -= np.nan_to_num(np.clip(share[-1], -0.3, 0.3))
        rows = rows.reshape(len(rows), len(index), -1).swapaxes(0, 1)
        known = np.isfinite(rows).all(axis=(1, 2))
        return Evaluation(np.where(known, np.sum(rows[:, -1] ** 2, axis=1), np.inf), np.nan_to_num(rows))


class _Restored:
    """Vector restored to a given length."""

    def __init__(self, vector: complex, length: float) -> None:
        self.direction = vector / abs(vector)
        self.vector, self._stretch = self.direction * length, length / abs(vector)

    def change(self, change: Complexes | complex) -> complex:
        """Return the change of the restored vector by a change of the vector."""
        return complex(self._stretch * 1j * self.direction * np.imag(np.conj(self.direction) * change))


# -- travel of the drive ----------------------------------------------------------------------------------------------


def nearest_travel(samples: Samples, linkage: Linkage, begin: Floats, steps: int = OPTIONS.travel_steps) -> Floats:
    """Return the travel from the linkage's start at which the body is nearest to each sample, by Newton's method.

    ``samples``: rotations count modulo a turn. ``begin`` (N,): initial travel, where the loop closes.
    ``steps``: largest number of steps.

    Law: at every sample the derivative of the error by the travel is zero, unless the drive is at an end of its range.
    """
    travel = np.array(begin, dtype=float)
    square = squared_errors(samples, linkage, travel)
    for _ in range(steps):
        first, second = _slopes(samples, linkage, travel)
        # towards a minimum if the error is convex, otherwise along the first-order step
        step = np.nan_to_num(-first / np.where(second > 0, second, np.inf))
        longest = 0.3 if linkage.driver.turns else 0.3 * samples.length_scale
        step = np.clip(step, -longest, longest)
        going = np.abs(step) > OPTIONS.arrived * longest
        if not going.any():
            there = squared_errors(samples, linkage, travel + step)
            return np.where(np.isfinite(there), travel + step, travel)
        for _ in range(OPTIONS.halvings):
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


def _misses(samples: Samples, position: Complexes, rotation: Floats) -> Floats:
    """Return weighted errors (..., rows, N) of positions and rotations (..., N)."""
    turned, off = 0.0 * rotation, 0.0 * position
    if samples.rotation is not None:
        turned = rotation - samples.rotation
        # rotations count modulo a turn, or with given timing to a constant whole number of turns
        turned = turned - TURN * np.round((turned[..., :1] if isinstance(samples, Target) else turned) / TURN)
    if samples.position is not None:
        off = position - samples.position
    return weighted(samples, turned, off)


def _misses_of(samples: Samples, linkage: Linkage, travel: Floats) -> Floats:
    """Return the weighted errors (rows, N) of a linkage."""
    found = linkage.body(linkage.start + travel)
    return _misses(samples, found.position, found.rotation)


def squared_errors(samples: Samples, linkage: Linkage, travel: Floats) -> Floats:
    """Return the weighted squared error at each sample, (N,); infinite if the loop does not close."""
    square = np.sum(_misses_of(samples, linkage, travel) ** 2, axis=0)
    return np.where(np.isfinite(square), square, np.inf)


def _slopes(samples: Samples, linkage: Linkage, travel: Floats) -> tuple[Floats, Floats]:
    """Return first and second derivatives of half the squared error by the travel; the second has a lower bound."""
    missed, rates = _misses_of(samples, linkage, travel), linkage.rates(linkage.start + travel)
    drive = weighted(samples, rates.rotation, rates.position)
    gauss = np.sum(drive**2, axis=0)
    second = gauss + np.sum(missed * weighted(samples, rates.rotation_second, rates.position_second), axis=0)
    return np.sum(missed * drive, axis=0), np.where(second > 0.1 * gauss, second, gauss)
