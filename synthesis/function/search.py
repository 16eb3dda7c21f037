"""The search for function generators: that for motions where it serves; else limits, and the least largest error.

Data flow::

    wanted --(clockwise: mirrored)--> the coupler of the linkage with coupler and rocker exchanged turns as wanted
      -> least squares, nothing limited but the family: `search.search`
      -> else: a coarse grid of all ratios, then linkages within the limits
      -> least squares, limits as penalties, all at once
      -> sequential quadratic steps over fixed places -> different ones, best first
      -> steps over the extremes of each candidate's own error curve, until they are level
      -> coupler and rocker exchanged back -> errors recomputed from the linkage's numbers, within the limits, different
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.constraints import BEGIN, END, Constraints, keeps
from synthesis.four_bar import Family
from synthesis.fourbar.mechanism import AnyChart
from synthesis.function.answers import (
    PEAKS,
    Generator,
    Generators,
    exchanged,
    extremes,
    finished,
    fraction_back,
    look,
    turns_back,
)
from synthesis.function.descent import (
    FIRST_RADIUS,
    PENALTY,
    Descended,
    Linear,
    Linearise,
    descend,
)
from synthesis.function.few_pairs import HARDLY_BACK, MOST_PAIRS, exact_functions, function_merit, is_few
from synthesis.function.wanted import TargetFunction
from synthesis.least_squares import Evaluation, minimise
from synthesis.limits import Limits
from synthesis.linkage import Linkage, as_lengths, four_bar, with_links
from synthesis.mechanism import Placed
from synthesis.pose import whole_turns
from synthesis.ranking import APART, PROPORTION, Status, counted_error, distinct
from synthesis.scores import NEAR_CHANGE_POINT
from synthesis.search.report import SearchReport, StoppedBy, stopped_by
from synthesis.search.search import SEARCH_SAMPLES, search
from synthesis.search.seeds import SeedTables
from synthesis.target import TURN
from synthesis.work import Work

# -- errors and their derivatives ---------------------------------------------------------------------------------------

_RATIO, _WIDE = 20.0, 1e6
"""Lengths over the ground that are sought, and one over it, where no limit says otherwise; and where only the samples count."""
_CLOSES = 1e-4
"""Least transmission angle in radians: where the linkage locks, the rocker's angle has no derivative."""
_MARGIN = 1e-9
"""How far inside the limits of angles and family is aimed: what rounding leaves of it is inside too."""
_RATES, _LEAST_RATE, _DIFFERENCE = 9, 1e-3, 1e-6
"""Places at which the rocker must go on, its least rate beside the mean one, and the step of the rate's differences."""
LEVELLED = 1e-7
"""The least largest error has been found where the linear program over the extremes foretells a smaller part to be gained."""
_FARTHEST = 2.2
"""ln of the largest length ratio of the grid."""
_LEVELS = (1, 200, 21, 7)
"""Levels of each ratio on the grid, by how many are free."""
_STARTS = 24
_TOGETHER = 1 << 13
"""Candidates of the grid whose conditions are computed at once: some megabytes."""
_EVEN = 20.0
"""Largest ratio of two links of the linkages that are searched if the best one is out of proportion."""
_RANKED = 10
"""Answers that are known at least, of which exact ones are then ordered by what one would build."""
_USABLE = np.deg2rad(20.0)
"""Transmission angle of the best four-bar through two to four pairs above which nothing else is searched."""
_LOCKED = np.deg2rad(5.0)
"""Transmission angle below which a linkage nearly locks and cannot be used."""
_FIRST_PLACES, _SAMPLES_LEAST_SQUARES = 9, 33
_SEEDS, _VALLEYS, _CANDIDATES = 160, 48, 24
_FIRST_CANDIDATES = 8
"""Candidates that are looked at as answers at each stage."""
_SOFT = 0.5
"""Weight of a broken condition beside errors in radians, while the descent finds its valley."""
_NEARLY = 1e-3
"""The same for those behind the best."""
_ROUNDING = 1e-12
"""Part of the longest length by which rounding may break a limit that an answer stands at."""
_AROUND = 0.4 * np.array([0.0, 1.0, -1.0])
"""Starts beside a solution's, in radians: rounded links may be at their best in another valley."""
_LEAST_RADIUS = 1e-5
_EXCHANGES, _EXCHANGE_STEPS = 16, 8


class OutputCurve(NamedTuple):
    """The output of candidates over their input."""

    value: Floats
    """(n, M): without the offset; an angle up to whole turns; any number where a candidate is impossible."""
    slope: Floats
    """(n, 4, M): derivatives by the shape's unknowns and the zero; the last is that by the input too."""
    possible: NDArray[np.bool_]
    """(n, M), or (n, 1): where it closes."""


class FunctionProblem:
    """A wanted function and limits made ready for many evaluations: errors and conditions with derivatives, for any linkage.

    Unknowns are three of the shape, the zero and the offset.
    """

    wanted: TargetFunction
    free: NDArray[np.intp]
    """Unknowns that are not given."""
    moving: Sequence[int] = range(4)
    """Unknowns by which the output changes."""
    rate_inputs: Floats
    """Inputs (q,) at which the output must go on, where it may not turn back."""
    offset: float | None
    """The unknown one, where it is given."""
    turns: bool
    """Whether the output is an angle, so that whole turns of the offset do not count,"""
    wraps: bool
    """and whether outputs are known up to whole turns only."""

    def at(self, unknowns: Floats, branch: Floats, crank: Floats, derivatives: bool = True) -> OutputCurve:
        """Outputs at inputs (n, M) from the first sample, with slopes where they are wanted."""
        raise NotImplementedError

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """The conditions at unknowns (n, 5), at least 0 where they are kept, (n, m), and derivatives (n, m, 5)."""
        raise NotImplementedError

    def wrapped_error(self, gap: Floats) -> Floats:
        """Errors as they count: to the nearest whole turn, where outputs are known up to whole turns."""
        return gap - whole_turns(gap) if self.wraps else gap

    def gap(self, unknowns: Floats, branch: Floats, crank: Floats) -> Floats:
        """Errors (n, M) at inputs (n, M) of the candidates' own; infinite where it does not close."""
        found = self.at(unknowns, branch, crank, derivatives=False)
        with np.errstate(invalid="ignore"):  # an output beyond all numbers
            gap = self.wrapped_error(self.wanted.curve(crank) - unknowns[:, 4:] - found.value)
        return np.where(found.possible, gap, np.inf)

    def with_offset(self, unknowns: Floats, branch: Floats, crank: Floats, root: Floats) -> Floats:
        """Candidates with the given offset, or the best over inputs (M,), whose errors count ``root`` (M,)."""
        angles, share = np.broadcast_to(crank, (len(unknowns), crank.size)), root**2 / np.sum(root**2)
        found = self.at(unknowns, branch, angles, derivatives=False)
        gap = np.where(found.possible, self.wanted.curve(angles) - found.value, 0.0)
        out = unknowns.copy()
        middle = np.angle(np.exp(1j * gap) @ share) if self.wraps else np.zeros(len(out))
        best = middle + self.wrapped_error(gap - middle[:, None]) @ share
        if self.offset is not None:
            best = self.offset + (whole_turns(best - self.offset) if self.turns else np.zeros(len(out)))
        out[:, 4] = best
        return out

    def _rates(self, unknowns: Floats, branch: Floats) -> tuple[Floats, Floats]:
        """How fast the output goes the wanted way, less a little, at some places (n, q), and derivatives (n, q, 5)."""
        rise = self.wanted.output[-1] - self.wanted.output[0]
        sense = np.sign(rise) * np.sign(self.wanted.crank[-1])
        smallest = _LEAST_RATE * abs(rise / self.wanted.crank[-1])
        inputs = np.broadcast_to(self.rate_inputs, (len(unknowns), self.rate_inputs.size))

        def rate(at: Floats) -> Floats:
            return sense * np.clip(self.at(at, branch, inputs).slope[:, 3], -1e3, 1e3)

        by = np.zeros((*inputs.shape, 5))
        for k in self.moving:
            step = _DIFFERENCE * np.eye(5)[k]
            by[:, :, k] = (rate(unknowns + step) - rate(unknowns - step)) / (2 * _DIFFERENCE)
        return rate(unknowns) - smallest, by

    def linear(self, branch: Floats, crank: Floats, root: Floats) -> Linearise:
        """The errors at inputs (n, M) times ``root`` (n, M), and the conditions, ready for `descent.descend`."""
        curve = self.wanted.curve(crank)

        def evaluate(unknowns: Floats, which: Ints) -> Linear:
            scale = root[which]
            found = self.at(unknowns, branch[which], crank[which])
            error = self.wrapped_error(curve[which] - unknowns[:, 4:] - found.value) * scale
            error[~found.possible.all(axis=1)] = np.inf
            slope = np.empty((*error.shape, 5))
            slope[:, :, :4] = -found.slope.transpose(0, 2, 1) * scale[:, :, None]
            slope[:, :, 4] = -scale
            condition, by = self.conditions(unknowns)
            if self.wanted.one_way:
                rate, by_rate = self._rates(unknowns, branch[which])
                condition, by = np.concatenate([condition, rate], axis=1), np.concatenate([by, by_rate], axis=1)
            return Linear(error, np.clip(slope, -1e9, 1e9)[:, :, self.free], condition, by[:, :, self.free])

        return evaluate


class Problem(FunctionProblem):
    """A wanted function and limits made ready for many evaluations, for linkages with coupler and rocker exchanged.

    Least and largest lengths, and lengths that are given, are edges of a box; all other limits are conditions on the unknowns.

    Parameters
    ----------
    target : TargetFunction
        With a crank that turns counter-clockwise.
    limits : Limits
        Of the exchanged linkages, lengths over the ground's.
    largest : bool
        Whether ratios are sought within `_RATIO`, or as far as numbers go where no limit says otherwise.
    """

    turns, wraps = True, False

    def __init__(self, target: TargetFunction, limits: Limits, largest: bool) -> None:
        self.wanted, self.offset = target, target.target.offset
        self.chart = AnyChart()
        smallest_angle = max(limits.transmission_angle_min, _CLOSES)
        in_box = replace(
            limits, transmission_angle_min=smallest_angle, link_min=None, link_max=None, links=(None,) * 4
        )
        self.constraints = Constraints(in_box, smooth=True)
        self.given = prescribed = np.log([np.nan if length is None else length for length in limits.links[:3]])
        """ln of the ratios that are given, NaN of the others, (3,)."""
        held = np.concatenate([~np.isnan(prescribed), [target.start is not None, target.offset is not None]])
        self.free = np.flatnonzero(~held)
        ratio = limits.link_ratio_max or (_RATIO if largest else _WIDE)
        low, high = np.log([limits.link_min or 1 / ratio, limits.link_max or ratio])
        low, high = np.where(np.isnan(prescribed), low, prescribed), np.where(np.isnan(prescribed), high, prescribed)
        wide = np.full(2, np.inf)
        self.box = np.concatenate([low, -wide]), np.concatenate([high, wide])
        self.rate_inputs = (1 - np.cos(np.linspace(0.0, np.pi, _RATES))) / 2 * target.crank[-1]

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Of lengths, angles and family."""
        lengths = np.concatenate([np.exp(unknowns[:, :3]), np.ones((len(unknowns), 1))], axis=1)
        used = self.wanted.interval.after(unknowns[:, 3])
        found = self.constraints(Placed(lengths, np.ones(len(lengths)), used))
        slopes = np.zeros((*found.values.shape, 5))
        slopes[:, :, :3] = found.slopes[:, :, :3] * lengths[:, None, :3]
        slopes[:, :, 3] = found.slopes[:, :, BEGIN] + found.slopes[:, :, END]
        return found.values - _MARGIN * np.array([name != "link_ratio_max" for name in found.names]), slopes

    def at(self, unknowns: Floats, branch: Floats, crank: Floats, derivatives: bool = True) -> OutputCurve:
        """theta2 of the exchanged linkages."""
        found = self.chart.at(unknowns[:, :3], unknowns[:, 3:4] + crank, branch, derivatives)
        return OutputCurve(found.angle, found.slope, found.closes[:, None])


# -- the search ---------------------------------------------------------------------------------------------------------

Ints = NDArray[np.intp]


def first_of_cells(cells: Floats, cost: Floats, max_count: int) -> Ints:
    """Candidates, the best first: at most so many, one a cell, (n, m) whole numbers, and whose cost is finite."""
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    return order[np.sort(np.unique(cells[order], axis=0, return_index=True)[1])[:max_count]]


class FunctionSearch:
    """One request that the search for motions does not serve."""

    def __init__(
        self, target: TargetFunction, limits: Limits, largest: bool, top: int, tolerance: float, work: Work
    ) -> None:
        self.wanted, self.limits, self.largest = target, limits.exchanged(), largest
        self.top, self.tolerance, self.work = top, tolerance, work
        self.ratios = self.limits.over(ground_of(limits))
        """The limits of the exchanged linkages, lengths over the ground's."""
        self.begin_with(Problem(target, self.ratios, largest))

    def begin_with(self, problem: Any) -> None:
        """Know nothing yet of a problem."""
        self.problem: Any = problem
        self.seeds, self.screened = 0, 0.0
        self.settled = False
        self.trace: list[tuple[float, float]] = []
        self.known: list[Any] = []
        """The best answers so far, different ones."""

    def place(self, unknowns: Floats) -> Floats:
        """Where candidates lie, in numbers of order one."""
        return np.column_stack([unknowns[:, :3], np.cos(unknowns[:, 3]), np.sin(unknowns[:, 3])])

    def apart(self, unknowns: Floats, branch: Floats, cost: Floats, max_count: int) -> Ints:
        """Return the indices of the best ``max_count`` candidates in different basins."""
        return first_of_cells(np.round(np.column_stack([self.place(unknowns), branch]) / 0.02), cost, max_count)

    # -- places -------------------------------------------------------------------------------------------------------

    def error_samples(self, count: int) -> tuple[Floats, Floats]:
        """Crank angles at which errors count, and what each is multiplied with, (M,) each.

        For the least largest error places that are denser towards the ends; for least squares the samples themselves.
        """
        if self.largest:
            crank = (1 - np.cos(np.linspace(0.0, np.pi, count))) / 2 * self.wanted.crank[-1]
            return crank, self.wanted.weight(crank)
        thinned = self.wanted.target.thinned(count)
        return thinned.crank, np.broadcast_to(thinned.rotation_mean.root, thinned.crank.shape)

    # -- beginnings ---------------------------------------------------------------------------------------------------

    def grid(self, within: bool = False) -> tuple[Floats, Floats]:
        """The most promising of a grid of all ratios, starts and branches: unknowns (n, 5) and branches.

        ``within``: only those that keep the limits.
        """
        problem = self.problem
        low, high = problem.box[0][:3], problem.box[1][:3]
        low, high = np.maximum(low, np.minimum(high, -_FARTHEST)), np.minimum(high, np.maximum(low, _FARTHEST))
        free = np.isnan(problem.given)
        levels = _LEVELS[int(free.sum())]
        axes = [np.linspace(a, b, levels) if moves else np.array([a]) for a, b, moves in zip(low, high, free)]
        shapes = np.array(list(itertools.product(*axes)))
        starts = np.arange(_STARTS) * (TURN / _STARTS)
        if self.wanted.start is not None:
            starts = np.array([self.wanted.start])
        unknowns = np.zeros((len(shapes) * starts.size, 5))
        unknowns[:, :3], unknowns[:, 3] = np.repeat(shapes, starts.size, axis=0), np.tile(starts, len(shapes))
        crank, root = self.error_samples(_FIRST_PLACES)
        if within:
            unknowns = unknowns[(self.problem.conditions(unknowns)[0] >= 0).all(axis=1)]
        return self.screened_from(unknowns, crank, root, (1.0, -1.0), _SEEDS // 2, [0.5, 0.5, 0.5, 0.4])

    def candidate(self, linkage: Linkage, offset: float | None = None) -> tuple[Floats, Floats]:
        """A linkage with coupler and rocker exchanged: unknowns (1, 5) and its branch; numbers that are given replace its own.

        ``offset``: output = theta3 + offset, theta3 in (-pi, pi] at the first sample; default: the best.
        """
        target, problem, exchanged_linkage = self.wanted, self.problem, exchanged(linkage)
        lengths, branch = np.array(exchanged_linkage.links), np.array([float(exchanged_linkage.branch)])
        ratios = np.where(np.isnan(problem.given), np.log(lengths[:3] / lengths[3]), problem.given)
        start = exchanged_linkage.start if target.start is None else target.start
        crank, root = self.error_samples(SEARCH_SAMPLES)
        begin = problem.with_offset(np.array([[*ratios, start, 0.0]]), branch, crank, root)
        if offset is not None and target.offset is None:
            own = offset + np.pi
            begin[:, 4] = own + whole_turns(begin[:, 4] - own)
        return begin, branch

    def screened_from(
        self,
        unknowns: Floats,
        crank: Floats,
        root: Floats,
        branches: Sequence[float],
        max_count: int,
        cell: Any = None,
    ) -> tuple[Floats, Floats]:
        """The most promising of beginnings (n, 5) and their branches: of each branch at most so many, and one a cell.

        ``cell``: of the unknowns but the offset; default: of `place`.
        """
        problem, found, sides = self.problem, [], []
        parts = np.array_split(unknowns, 1 + len(unknowns) // _TOGETHER)
        broken = np.concatenate([np.minimum(problem.conditions(part)[0], 0.0) for part in parts])
        penalty = np.sum((_SOFT * broken) ** 2, axis=1)
        for branch in branches:
            side = np.full(len(unknowns), float(branch))
            placed = problem.with_offset(unknowns, side, crank, root)
            gap = problem.gap(placed, side, np.broadcast_to(crank, (len(placed), crank.size)))
            # also infinite if a sample of weight 0 cannot be reached
            gap = np.multiply(root, gap, out=np.full_like(gap, np.inf), where=np.isfinite(gap))
            cost = np.sum(gap * gap, axis=1) / np.sum(root * root) + penalty
            cells = self.place(placed) / 0.4 if cell is None else placed[:, :4] / cell
            first = first_of_cells(np.floor(cells), cost, max_count)
            found.append(placed[first])
            sides.append(side[first])
        return np.concatenate(found), np.concatenate(sides)

    # -- descents -----------------------------------------------------------------------------------------------------

    def least_squares(self, unknowns: Floats, branch: Floats, count: int, steps: int) -> tuple[Floats, Floats]:
        """Candidates after a descent to least squares, limits and box as penalties, and their costs."""
        problem, free = self.problem, self.problem.free
        crank, root = self.error_samples(count)
        root = root / np.sqrt(np.sum(root * root))
        low, high = problem.box
        each = np.broadcast_to(crank, (len(unknowns), crank.size)), np.broadcast_to(root, (len(unknowns), crank.size))

        def evaluate(moving: Floats, which: Floats) -> Evaluation:
            chosen = which.astype(np.intp)
            full = unknowns[chosen]
            full[:, free] = moving
            model = problem.linear(branch, *each)(full, chosen)
            out = np.where(full < low, full - low, np.where(full > high, full - high, 0.0))[:, free]
            beyond = _SOFT * np.eye(len(free)) * (out != 0)[:, None, :]
            broken = np.minimum(model.condition, 0.0)
            slope = np.where(broken[:, :, None] < 0, model.condition_slope, 0.0)
            derivative = np.concatenate([model.slope.transpose(0, 2, 1), _SOFT * slope.transpose(0, 2, 1), beyond], 2)
            residual = np.concatenate([model.error, _SOFT * broken, _SOFT * out], axis=1)
            cost = np.sum(residual * residual, axis=1)
            stack = np.concatenate([derivative, residual[:, None, :]], axis=1)
            cost = np.where(np.isnan(cost), np.inf, cost)
            return Evaluation(cost, np.where(np.isfinite(cost)[:, None, None], stack, 0.0))

        found = minimise(
            evaluate, unknowns[:, free], np.arange(len(unknowns), dtype=float), steps, 0.3 * self.tolerance, self.work
        )
        out = unknowns.copy()
        out[:, free] = found.unknowns
        return out, found.cost

    def stepped(
        self,
        unknowns: Floats,
        branch: Floats,
        crank: Floats,
        root: Floats,
        steps: int,
        gain: float,
        radius: Floats | float = FIRST_RADIUS,
    ) -> Descended:
        """Candidates after sequential quadratic steps over places (n, M)."""
        return descend(
            self.problem.linear(branch, crank, root),
            unknowns,
            self.problem.free,
            self.problem.box,
            largest=self.largest,
            steps=steps,
            gain=gain,
            work=self.work,
            radius=radius,
        )

    def run(self) -> list[Generator]:
        """The best candidates, different ones, within the limits."""
        unknowns, branch = self.grid()
        self.screened, self.seeds = self.work.elapsed, len(branch)
        if not (self.best_from(unknowns, branch) or self.work.expired()):
            self.best_from(*self.grid(within=True))  # all linkages near the function may violate the limits
        return self.known

    def best_from(self, unknowns: Floats, branch: Floats) -> list[Generator]:
        """The best of what beginnings lead to."""
        if not len(branch):
            return self.known
        self.add(unknowns[:_FIRST_CANDIDATES], branch[:_FIRST_CANDIDATES])
        self.add(unknowns[-_FIRST_CANDIDATES:], branch[-_FIRST_CANDIDATES:])
        unknowns, cost = self.least_squares(unknowns, branch, 17, 12)
        best = self.apart(unknowns, branch, cost, _VALLEYS)
        unknowns, branch = unknowns[best], branch[best]
        self.add(unknowns[:_FIRST_CANDIDATES], branch[:_FIRST_CANDIDATES])
        unknowns, cost = self.least_squares(
            unknowns, branch, _SAMPLES_LEAST_SQUARES if self.largest else SEARCH_SAMPLES, 80
        )
        best = self.apart(unknowns, branch, cost, max(_CANDIDATES, self.top + 8))
        unknowns, branch = unknowns[best], branch[best]
        self.add(unknowns[:_FIRST_CANDIDATES], branch[:_FIRST_CANDIDATES])
        if Status.of(self.known, self.tolerance) is Status.REACHED:
            self.settled = True
            return distinct(self.within_limits(unknowns, branch), self.top, APART)
        radii = np.full(len(branch), FIRST_RADIUS)
        for count, steps, gain, max_count in (
            (21, 12, 1e-2, self.top + 10),
            (_SAMPLES_LEAST_SQUARES, 25, 1e-4, self.top + 4),
        ):
            if not branch.size or self.work.expired():
                return self.known
            crank, root = (
                np.broadcast_to(values, (len(branch), values.size)) for values in self.error_samples(count)
            )
            done = self.stepped(unknowns, branch, crank, root, steps, gain, radii)
            best = self.apart(done.unknowns, branch, done.merit, max_count)
            unknowns, branch, radii = (
                done.unknowns[best],
                branch[best],
                np.maximum(2 * done.radius[best], _LEAST_RADIUS),
            )
            self.add(unknowns, branch)
        if branch.size and not self.work.expired():
            self.add(self.levelled(unknowns, branch, radii), branch)
        return self.known

    def add(self, unknowns: Floats, branch: Floats) -> None:
        """Take candidates within the limits as answers; those of a step that the time cut short only where there are none yet.

        More time would lead them elsewhere, and an answer must not be lost by that.
        """
        if branch.size and not (self.known and self.work.expired()):
            self.known = distinct(self.known + self.within_limits(unknowns, branch), self.top, APART)
            self.note(self.known)

    def levelled(self, unknowns: Floats, branch: Floats, radii: Floats) -> Floats:
        """Candidates led on over the extremes of their own error curves, which are looked up again after each few steps."""
        if not self.largest:
            crank, root = (
                np.broadcast_to(values, (len(branch), values.size))
                for values in self.error_samples(self.wanted.crank.size)
            )
            done = self.stepped(unknowns, branch, crank, root, 40, 1e-5, radii)
            self.settled = bool(done.ended[np.argmin(done.merit)])
            return done.unknowns
        best, smallest = unknowns.copy(), np.full(len(branch), np.inf)
        rows = np.arange(len(branch))
        grid, coarse = look(self.wanted), self.error_samples(_FIRST_PLACES)[0]
        peaks = np.broadcast_to(coarse, (len(rows), coarse.size))
        for turn in range(_EXCHANGES):
            found = extremes(self.weighted_gap(unknowns[rows], branch[rows]), grid, PEAKS // 2)
            broken = np.minimum(self.problem.conditions(unknowns[rows])[0], 0.0).min(axis=1)
            largest = found.size.max(axis=1)
            merit = largest - PENALTY * broken
            better = merit < smallest[rows]
            # no longer falling: the places that the steps saw were all the extremes that there are
            first = rows == np.argmin(smallest)
            # those behind the best are alternatives: they may be a little short of level
            level = merit >= smallest[rows] * (1 - np.where(first, LEVELLED, _NEARLY))
            best[rows[better]], smallest[rows[better]] = unknowns[rows[better]], merit[better]
            if turn and level.any():
                self.settled = self.settled or bool(np.any(level & first))
                keep = ~level
                rows, peaks, found = rows[keep], peaks[keep], type(found)(*(values[keep] for values in found))
            if not rows.size or self.work.expired():
                break
            angles = np.sort(
                np.concatenate([found.crank, peaks[:, -PEAKS:], np.broadcast_to(coarse, (len(rows), coarse.size))], 1)
            )
            peaks = found.crank
            done = self.stepped(
                best[rows], branch[rows], angles, self.wanted.weight(angles), _EXCHANGE_STEPS, LEVELLED, radii[rows]
            )
            unknowns[rows], radii[rows] = done.unknowns, np.maximum(2 * done.radius, _LEAST_RADIUS)
        return best

    def weighted_gap(self, unknowns: Floats, branch: Floats) -> Callable[[Floats], Floats]:
        """The weighted errors of candidates as a function of crank angles (n, q)."""

        def error(crank: Floats) -> Floats:
            each = np.broadcast_to(crank, (len(branch), crank.shape[-1]))
            return self.wanted.weight(each) * self.problem.gap(unknowns, branch, each)

        return error

    # -- answers ------------------------------------------------------------------------------------------------------

    def within_limits(self, unknowns: Floats, branch: Floats) -> list[Generator]:
        """Candidates as generators, those outside of the limits left out; coupler and rocker exchanged back."""
        ratios = np.where(np.isnan(self.problem.given), unknowns[:, :3], self.problem.given)
        ground = ground_of(self.limits)
        lengths = ground * np.concatenate([np.exp(ratios), np.ones((len(ratios), 1))], axis=1)
        for k, length in enumerate(self.limits.links):
            if length is not None:  # as it was given, to the last bit
                lengths[:, k] = length
        start = unknowns[:, 3] % TURN
        placed = Placed(lengths / ground, branch, self.wanted.interval.after(start))
        within = keeps(self.wanted.target, self.ratios, placed, _ROUNDING)
        linkages = [
            exchanged(four_bar(as_lengths(row), int(side), float(at)))
            for row, side, at in zip(lengths[within], branch[within], start[within])
        ]
        # of least squares the offset is found anew, of the largest error it is the candidate's own
        offsets = unknowns[within, 4] - np.pi if self.largest else None
        found = finished(self.wanted, linkages, self.largest, offsets)
        if not self.wanted.one_way:
            return found
        return [generator for generator, back in zip(found, turns_back(self.wanted, linkages)) if back is None]

    def note(self, solutions: list[Generator]) -> None:
        """Add the best objective so far to the trace."""
        if solutions:
            best = min(generator.errors.objective for generator in solutions)
            self.trace.append((self.work.elapsed, best))


def ground_of(limits: Limits) -> float:
    """The ground of a function generator, 1 where it is not given."""
    return limits.links[3] or 1.0


def generate(
    tables: SeedTables,
    target: TargetFunction,
    limits: Limits,
    largest: bool,
    top: int,
    tolerance: float,
    work: Work | None = None,
) -> tuple[list[Generator], SearchReport]:
    """The best linkages for a wanted function.

    Parameters
    ----------
    tables : SeedTables
        Of the four-bar.
    target : TargetFunction
    limits : Limits
        Lengths in the unit of the ground's, see `ground_of`.
    largest : bool
        Make the largest error over the interval least, or else the root of the mean square at the samples.
    top : int
        At most this many, different from one another, best first.
    tolerance : float
        Stop the search when the objective is below it.
    work : Work, optional
        Once it has expired the best found so far is returned.

    Returns
    -------
    generators : list of Generator
        All within the limits. Law: a mirrored function gives the mirrored linkages.
    report : SearchReport
    """
    work = work or Work()
    if target.clockwise:
        found, report = generate(tables, target.mirrored(), limits, largest, top, tolerance, work)
        return [generator.mirrored() for generator in found], report
    few, many = list[Generator](), max(top, _RANKED)
    if not largest and is_few(target, limits):
        few = exact_generators(target, limits, many, tolerance, work)
        if few and few[0].transmission_angle_min > _USABLE and target.crank.size < MOST_PAIRS:
            trace = [(work.elapsed, few[0].errors.objective)]
            return few[:top], SearchReport(StoppedBy.TOLERANCE, trace, work.elapsed, len(few))
    found, report = _generate_any(tables, target, limits, largest, many, tolerance, work)
    found = distinct(few + found, many, APART) if few else found
    if found and not is_usable(min(found, key=lambda generator: generator.errors.objective)) and not work.expired():
        within = replace(limits, transmission_angle_min=_USABLE)
        more, _ = _generate_any(tables, target, within, largest, many, tolerance, work)
        found = distinct(found + more, 2 * many, APART)
    return best_built(target, found, top, tolerance, limits.links[3] is not None), report


def _generate_any(
    tables: SeedTables, target: TargetFunction, limits: Limits, largest: bool, many: int, tolerance: float, work: Work
) -> tuple[list[Generator], SearchReport]:
    """Search for ``many`` linkages for any number of pairs; see `generate`."""
    ground = ground_of(limits)
    if not largest and limits.over(ground).only_family and not target.one_way:
        mechanism = Generators(target, ground)
        found, report = search(tables, target.target, Limits(family=limits.family), many, tolerance, work, mechanism)
        prescribed = target.start is not None or target.offset is not None
        lopsided = _is_lopsided(found, tolerance)
        reached = Status.of(found, tolerance) is Status.REACHED
        if work.expired() or not (lopsided or (prescribed and not reached)):
            return found, report
        # with given zeros the search for motions ends with full cranks; and where its answer is of lengths that nobody makes,
        # as for a parallelogram's function, others may do as well
        within = replace(limits, link_ratio_max=_EVEN) if lopsided and not (prescribed and not reached) else limits
        run = FunctionSearch(target, within, False, many, tolerance, work)
        found = best_built(
            target, distinct(found + run.run(), 2 * many, APART), many, tolerance, limits.links[3] is not None
        )
        trace = report.trace + [
            (at, min(value, report.trace[-1][1]) if report.trace else value) for at, value in run.trace
        ]
        stopped = stopped_by(found, tolerance, work)
        return found, SearchReport(stopped, trace, report.screen_seconds, report.seeds + run.seeds, run.settled)
    run = FunctionSearch(target, limits, largest, many, tolerance, work)
    found = run.run()
    stopped = stopped_by(found, tolerance, work)
    return found, SearchReport(stopped, run.trace, run.screened, run.seeds, run.settled or not found)


def _is_lopsided(found: Sequence[Generator], tolerance: float) -> bool:
    """Check that all exact linkages are out of all proportion, or the one of least error if none is exact."""
    exact = [generator for generator in found if generator.errors.objective < tolerance]
    best = exact or sorted(found, key=lambda generator: generator.errors.objective)[:1]
    return all(generator.linkage.link_ratio > PROPORTION for generator in best)


def exact_generators(
    target: TargetFunction, limits: Limits, max_count: int, tolerance: float, work: Work
) -> list[Generator]:
    """Return linkages that meet two to five pairs, different from one another, the best to build first."""
    ground = ground_of(limits)
    linkages, offsets = exact_functions(target, limits.over(ground), limits.links[3] is not None, work)
    prescribed = [(k, length) for k, length in enumerate(limits.links) if length is not None]
    scaled = []
    for linkage in linkages:
        lengths = np.array(linkage.links) * ground
        for k, length in prescribed:  # as it was given, to the last bit
            lengths[k] = length
        scaled.append(with_links(linkage, as_lengths(lengths)))
    found = [
        generator for generator in finished(target, scaled, False, offsets) if generator.errors.objective < tolerance
    ]
    ranks = {id(generator): rank for rank, generator in enumerate(found)}
    found = distinct(found, max_count, APART, order=lambda generator: ranks[id(generator)], exact=tolerance)
    return sorted(
        found,
        key=lambda generator: (not is_usable(generator), fraction_back(target, generator.linkage) > HARDLY_BACK),
    )


def is_usable(generator: Generator) -> bool:
    """Check that a rocker comes near no dead position, and near no position of a change point."""
    change_point = generator.family is Family.CHANGE_POINT
    return generator.transmission_angle_min >= (NEAR_CHANGE_POINT if change_point else _LOCKED)


def best_built(
    target: TargetFunction, found: list[Generator], top: int, tolerance: float, sized: bool
) -> list[Generator]:
    """Return the first of answers: exact ones by merit, others by `counted_error`, the best at least second.

    Exact ones whose rocker turns back on the way come behind the other exact ones, and those that cannot be used behind all
    others. ``sized``: see `function_merit`.
    """
    if not found:
        return []
    exact = [generator for generator in found if generator.errors.objective < tolerance]
    back = np.array([fraction_back(target, generator.linkage) > HARDLY_BACK for generator in exact], bool)
    lengths = np.array([generator.linkage.links for generator in exact]).reshape(-1, 4)
    merits = function_merit(lengths, np.array([generator.transmission_angle_min for generator in exact]), sized)
    ranked = [exact[k] for k in np.lexsort((merits, back))]
    ranked += sorted(
        (generator for generator in found if generator.errors.objective >= tolerance),
        key=lambda generator: generator.errors.objective,
    )

    def key(generator: Generator) -> tuple[bool, float]:
        own = 0.0 if generator.errors.objective < tolerance else generator.errors.objective
        return not is_usable(generator), counted_error(own, generator.linkage.link_ratio, PROPORTION)

    ordered = sorted(ranked, key=key)
    built = [generator for generator in ordered if generator.linkage.link_ratio <= PROPORTION]
    best = ranked[0] if exact else min(ranked, key=lambda generator: generator.errors.objective)
    if built and all(
        generator is not best for generator in built
    ):  # of those that nobody builds only the best is listed
        built.insert(0 if best is ordered[0] else 1 if is_usable(best) else top - 1, best)
    return (built or ordered)[:top]


def refit(
    target: TargetFunction, generator: Generator, links: Floats, largest: bool, tolerance: float, work: Work
) -> Generator | None:
    """A generator with other lengths (4,) near its own, its zeros fitted anew; None where it does not close."""
    if target.clockwise:
        found = refit(target.mirrored(), generator.mirrored(), links, largest, tolerance, work)
        return None if found is None else found.mirrored()
    target = replace(target, one_way=False)
    run = FunctionSearch(target, Limits("any", links=as_lengths(links)), largest, 1, tolerance, work)
    start = generator.linkage.start + _AROUND
    if target.start is not None:
        start = np.array([target.start])
    unknowns = np.zeros((start.size, 5))
    unknowns[:, :3], unknowns[:, 3] = run.problem.given, start
    branch = np.full(start.size, -float(generator.linkage.branch))
    crank, root = run.error_samples(SEARCH_SAMPLES)
    return next(iter(run.best_from(run.problem.with_offset(unknowns, branch, crank, root), branch)), None)
