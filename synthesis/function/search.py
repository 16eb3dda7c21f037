"""Search for function generators within limits, with the least squared errors or the smallest largest error.

Data flow::

    shapes and zeros spread over the useful range -> the best of each cell -> least squares, with the limits as penalties
      -> sequential quadratic steps over fixed inputs -> distinct candidates, best first
      -> steps over the extremes of the error curve of each candidate, until they are level
      -> distinct linkages within the limits, with recomputed errors
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Flags, Floats, Ints, rows_at, rows_of_all
from synthesis.constrained_descent import OPTIONS as STEPS
from synthesis.constrained_descent import Descended, descend
from synthesis.function.answers import OPTIONS as ANSWERS
from synthesis.function.answers import Generator, extremes, look, within_limits
from synthesis.function.laws import ANGLE, FOUR_BAR, FunctionLimits
from synthesis.function.problem import AnyLaw, FunctionProblem, Inputs
from synthesis.function.target_function import TargetFunction
from synthesis.least_squares import Evaluation, minimise
from synthesis.ranking import APART, distinct
from synthesis.search.multistart import Incumbents, MultiStart, SearchProblem
from synthesis.search.options import Schedule, SearchOptions
from synthesis.search.search import SEARCH_SAMPLES
from synthesis.work import Work


class FunctionTask(NamedTuple):
    """A function that linkages make within limits, and the end of its search."""

    target: TargetFunction
    limits: FunctionLimits
    largest: bool
    """Minimize the largest error over the interval; otherwise the root mean square error at the samples."""
    tolerance: float
    """Objective below which the search ends."""
    work: Work
    """When it expires, the best linkages found are returned."""


class Fit(NamedTuple):
    """A descent to least squares, with the limits as penalties."""

    inputs: int
    """Number of inputs at which the largest error is evaluated."""
    samples: int
    """Number of samples of a fit by least squares."""
    steps: int


class Level(NamedTuple):
    """Sequential quadratic steps over fixed inputs."""

    inputs: int
    steps: int
    gain: float
    """Predicted relative gain below which a candidate ends."""
    spare: int
    """Number of candidates that continue, beyond the requested answers."""


@dataclass(frozen=True)
class FunctionOptions(SearchOptions):
    """Options of the search for functions."""

    schedule: Schedule = Schedule(  # noqa: RUF009
        (Fit(17, 17, 12),), 48, (Fit(33, SEARCH_SAMPLES, 80),), end=(Level(21, 12, 1e-2, 10), Level(33, 25, 1e-4, 4))
    )
    pool_distance: float = 0.02
    answer_distance: float = 0.02
    exact_distance: float = 0.02
    candidates: int = 24
    """Smallest number of candidates that are refined to convergence."""
    first_answers: int = 8
    """Number of candidates of a stage that may be answers."""
    soft: float = 0.5
    """Weight of a violated condition beside errors in radians while a descent finds its basin."""
    beginnings: int = 6000
    """Number of shapes and zeros that are evaluated for each branch."""
    beginnings_within: int = 40_000
    """Number of shapes and zeros of which those within the limits are evaluated, if the first ones lead to no answer."""
    seeds: int = 130
    """Number of starting points that descend."""
    inputs: int = 9
    """Number of inputs at which starting points are evaluated."""
    cell: float = 0.75
    """Size of the cells of which each gives a single starting point."""
    open_error: float = 1e3
    """Error of a linkage that does not close."""
    evaluated_at_once: int = 1 << 13
    """Number of starting points whose conditions are evaluated together: some megabytes."""
    exchanges: int = 16
    """Largest number of times that the extremes of an error curve are located."""
    exchange_steps: int = 8
    """Number of quadratic steps between them."""
    nearly_level: float = 1e-3
    """Relative gain below which an alternative to the best candidate is level."""
    radius_min: float = 1e-5
    """Smallest first radius of quadratic steps that continue."""
    level: float = 1e-7
    """Predicted relative gain of the linear program over the extremes below which the minimax error counts as found."""
    nearby_starts: tuple[float, ...] = (0.0, 0.4, -0.4)
    """Starts relative to the start of a solution, in radians: the best rounded links may lie in another basin."""


class Candidates(NamedTuple):
    """Candidates of a function (n,), with their squared errors."""

    unknowns: Floats
    branch: Floats
    cost: Floats
    answer: Ints
    """Index of the answer that a candidate is, or -1."""

    def take(self, indices: Any) -> Candidates:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Candidates) -> Candidates:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)


def candidates_at(unknowns: Floats, branch: Floats, cost: Floats | None = None) -> Candidates:
    """Return candidates that are no answers yet."""
    count = len(branch)
    return Candidates(unknowns, branch, np.zeros(count) if cost is None else cost, np.full(count, -1))


def first_of_cells(cells: Floats, cost: Floats, max_count: int) -> Ints:
    """Return the indices of the best candidates with a finite cost, at most one of each cell (n, m)."""
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    return order[np.sort(np.unique(cells[order], axis=0, return_index=True)[1])[:max_count]]


class FunctionSearch(SearchProblem):
    """A function that linkages of a law make within limits, as a problem of the multistart search."""

    def __init__(self, task: FunctionTask, law: AnyLaw, top: int) -> None:
        self.function, limits, self.largest, self.tolerance, self.work = task
        self.problem = FunctionProblem(self.function, law, limits, self.largest)
        self.law, self.top = law, top
        self.seeds, self.screened = 0, 0.0
        self.settled = False
        self.trace: list[tuple[float, float]] = []
        self.answers: list[Generator] = []
        """All answers found."""
        options = FunctionOptions()
        finished = max(options.candidates, top + 8)
        self.options = replace(
            options, schedule=options.schedule._replace(finished=finished), max_pool=max(2 * top, finished)
        )
        incumbents = Incumbents(self.tolerance, lambda error: self.trace.append((self.work.elapsed, error)))
        self.multistart = MultiStart(self, incumbents, self.work, self.options)

    # -- problem of the multistart search -----------------------------------------------------------------------------

    def basin_coordinates(self, unknowns: Floats) -> Floats:
        """Return numbers of order 1 that differ between basins."""
        zero = unknowns[:, 3]
        around = [np.cos(zero), np.sin(zero)] if self.law.input == ANGLE else [np.arcsinh(zero), 0 * zero]
        logarithms = [*self.law.positive, *[False] * (3 - self.law.size)]
        return np.column_stack([np.where(logarithms, unknowns[:, :3], np.arcsinh(unknowns[:, :3])), *around])

    def identity(self, candidates: Candidates) -> Floats:
        """Return numbers that differ between basins, of order 1."""
        return np.column_stack([self.basin_coordinates(candidates.unknowns), candidates.branch])

    def usable(self, candidates: Candidates) -> Flags:
        """Return whether answers can be used, (n,)."""
        is_four_bar = self.law is FOUR_BAR
        return np.array([not is_four_bar or self.answers[k].usable for k in candidates.answer], dtype=bool)

    def perturb(self, origins: Candidates, copies: int) -> Candidates:
        """Return no starting points: the seeds cover all basins."""
        return origins.take([])

    def refine(
        self, starts: Candidates, stages: Sequence[Fit], between: Callable[[Any], None] | None = None
    ) -> Candidates:
        """Refine starting points by least squares."""
        for stage in stages:
            count = stage.inputs if self.largest else stage.samples
            unknowns, cost = self.least_squares(starts.unknowns, starts.branch, count, stage.steps)
            starts = candidates_at(unknowns, starts.branch, cost)
        return starts

    def converge(self, candidates: Candidates, stages: Sequence[Level]) -> Candidates:
        """Refine basins by quadratic steps, first over fixed inputs and then over the extremes of their error curves."""
        unknowns, branch = candidates.unknowns, candidates.branch
        radii = np.full(branch.size, STEPS.first_radius)
        for stage in stages:
            if not branch.size or self.multistart.work.expired():
                return candidates.take([])
            inputs = self.problem.inputs(branch, *self.error_samples(stage.inputs))
            done = self._descended(unknowns, inputs, stage.steps, stage.gain, radii)
            cells = np.round(
                np.column_stack([self.basin_coordinates(done.unknowns), branch]) / self.options.pool_distance
            )
            best = first_of_cells(cells, done.merit, self.top + stage.spare)
            unknowns, branch = done.unknowns[best], branch[best]
            radii = np.maximum(2 * done.radius[best], self.options.radius_min)
            self.multistart.accept(candidates_at(unknowns, branch))
        if not branch.size or self.multistart.work.expired():
            return candidates.take([])
        return candidates_at(self.levelled(unknowns, branch, radii), branch)

    def satisfying(self, candidates: Candidates, steps: int) -> Iterator[Candidates]:
        """Yield the candidates that satisfy the limits, with the errors of their linkages."""
        leading = candidates
        if not (self.multistart.incumbents.reached or candidates.cost.min(initial=np.inf) < self.tolerance**2):
            leading = candidates.take(slice(0, max(self.options.first_answers, self.top + 4)))
        good, found = [], []
        for index, answer in enumerate(within_limits(self.problem, leading.unknowns, leading.branch)):
            if answer is not None:
                good.append(index)
                found.append(answer)
        first = len(self.answers)
        self.answers += found
        cost = np.array([answer.errors.objective**2 for answer in found])
        yield leading.take(np.array(good, dtype=np.intp))._replace(
            cost=cost, answer=np.arange(first, len(self.answers))
        )

    # -- inputs -------------------------------------------------------------------------------------------------------

    def error_samples(self, count: int) -> tuple[Floats, Floats]:
        """Return the crank angles at which errors count and their factors, (M,) each.

        The largest error uses angles that are denser towards the ends, and least squares uses the samples.
        """
        if self.largest:
            crank = (1 - np.cos(np.linspace(0.0, np.pi, count))) / 2 * self.function.crank[-1]
            return crank, self.function.weight(crank)
        thinned = self.function.target.thinned(count)
        return thinned.crank, np.broadcast_to(thinned.rotation_mean.root, thinned.crank.shape)

    # -- starting points --------------------------------------------------------------------------------------------------

    def begin(self, within: bool = False) -> tuple[Floats, Floats]:
        """Return the most promising starting points: unknowns (n, 5) and branches.

        ``within``: only points that satisfy the limits.
        """
        options = self.options
        unknowns = self.problem.beginnings(options.beginnings_within if within else options.beginnings)
        parts = np.array_split(unknowns, 1 + len(unknowns) // options.evaluated_at_once)
        broken = np.concatenate([np.minimum(self.problem.conditions(part)[0], 0.0) for part in parts])
        if within:
            inside = (broken == 0).all(axis=1)
            unknowns, broken = unknowns[inside], broken[inside]
        penalty = np.sum((options.soft * broken) ** 2, axis=1)
        crank, root = self.error_samples(options.inputs)
        found = []
        for branch in self.law.branches:
            side = np.full(len(unknowns), float(branch))
            placed = self.problem.with_offset(unknowns, side, crank, root)
            gap = self.problem.gap(placed, side, crank)
            # also infinite if a sample of weight 0 cannot be reached
            gap = np.multiply(root, gap, out=np.full_like(gap, np.inf), where=np.isfinite(gap))
            cost = np.sum(gap * gap, axis=1) / np.sum(root * root) + penalty
            cells = np.floor(self.basin_coordinates(placed) / options.cell)
            first = first_of_cells(cells, cost, options.seeds // len(self.law.branches))
            found.append((placed[first], side[first]))
        return np.concatenate([placed for placed, _ in found]), np.concatenate([side for _, side in found])

    def with_best_offset(self, unknowns: Floats, branch: Floats) -> Floats:
        """Return unknowns (n, 5) with the prescribed numbers and offset, or the best offset."""
        problem, out = self.problem, unknowns.copy()
        out[:, :3] = np.where(np.isnan(problem.prescribed), out[:, :3], problem.prescribed)
        if self.function.start is not None:
            out[:, 3] = self.function.start
        return problem.with_offset(out, branch, *self.error_samples(SEARCH_SAMPLES))

    # -- descents -----------------------------------------------------------------------------------------------------

    def least_squares(self, unknowns: Floats, branch: Floats, count: int, steps: int) -> tuple[Floats, Floats]:
        """Minimize squared errors with the limits and the box as penalties; return the candidates and their costs."""
        problem, free = self.problem, self.problem.free
        crank, root = self.error_samples(count)
        inputs, (low, high) = problem.inputs(branch, crank, root / np.sqrt(np.sum(root * root))), problem.box

        def evaluate(moving: Floats, which: Floats) -> Evaluation:
            chosen = which.astype(np.intp)
            full = unknowns[chosen]
            full[:, free] = moving
            model = problem.linearised(full, rows_at(inputs, chosen))
            out = np.where(full < low, full - low, np.where(full > high, full - high, 0.0))[:, free]
            beyond = self.options.soft * np.eye(len(free)) * (out != 0)[:, None, :]
            broken = np.minimum(model.condition, 0.0)
            slope = np.where(broken[:, :, None] < 0, model.condition_slope, 0.0)
            derivative = np.concatenate(
                [model.slope.transpose(0, 2, 1), self.options.soft * slope.transpose(0, 2, 1), beyond], 2
            )
            residual = np.concatenate([model.error, self.options.soft * broken, self.options.soft * out], axis=1)
            cost = np.sum(residual * residual, axis=1)
            stack = np.concatenate([derivative, residual[:, None, :]], axis=1)
            cost = np.where(np.isnan(cost), np.inf, cost)
            return Evaluation(cost, np.where(np.isfinite(cost)[:, None, None], stack, 0.0))

        labels, work = np.arange(len(unknowns), dtype=float), self.multistart.work
        found = minimise(evaluate, unknowns[:, free], labels, steps, 0.3 * self.tolerance, work)
        out = unknowns.copy()
        out[:, free] = found.unknowns
        return out, found.cost

    def _descended(self, unknowns: Floats, inputs: Inputs, steps: int, gain: float, radius: Floats) -> Descended:
        """Take sequential quadratic steps."""
        problem = self.problem
        return descend(
            lambda points, which: problem.linearised(points, rows_at(inputs, which)),
            unknowns,
            problem.free,
            problem.box,
            largest=self.largest,
            steps=steps,
            gain=gain,
            work=self.multistart.work,
            radius=radius,
        )

    def run(self) -> list[Generator]:
        """Return the best distinct answers of a search from everywhere."""
        before = self.work.elapsed
        unknowns, branch = self.begin()
        self.screened, self.seeds = self.work.elapsed - before, len(branch)
        if not self.problem.free.size:  # everything is prescribed: nothing is left to search
            self.settled = True
            self.multistart.accept(candidates_at(unknowns, branch))
        elif not (self.best_from(unknowns, branch) or self.work.expired()):
            self.best_from(*self.begin(within=True))  # all linkages near the function may violate the limits
        return self.known

    @property
    def known(self) -> list[Generator]:
        """Return the best distinct answers found, the best usable four-bar among them."""
        pool = self.multistart.incumbents.pools.get(None)
        if pool is None:
            return []
        found = distinct([self.answers[k] for k in pool.answer], self.top, APART)
        usable = [self.answers[k] for k in pool.take(self.usable(pool)).answer]
        best = min(usable, key=lambda answer: answer.errors.objective, default=None)
        if best is None or any(answer is best for answer in found):
            return found
        return [*found[: max(1, self.top - 1)], best][: self.top]

    def best_from(self, unknowns: Floats, branch: Floats) -> list[Generator]:
        """Return the best answers after a round from starting points (n, 5)."""
        if len(branch):
            starts, count = candidates_at(unknowns, branch), self.options.first_answers
            self.multistart.accept(starts.take(slice(0, count)))
            self.multistart.accept(starts.take(slice(-count, None)))
            for _ in self.multistart.run(iter([starts]), max_rounds=1):
                self.settled = self.settled or self.multistart.incumbents.reached
        return self.known

    def levelled(self, unknowns: Floats, branch: Floats, radii: Floats) -> Floats:
        """Take steps over the extremes of the error curves, which are located again after every few steps."""
        if not self.largest:
            inputs = self.problem.inputs(branch, *self.error_samples(self.function.crank.size))
            done = self._descended(unknowns, inputs, 40, 1e-5, radii)
            self.settled = bool(done.ended[np.argmin(done.merit)])
            return done.unknowns
        best, smallest = unknowns.copy(), np.full(len(branch), np.inf)
        rows = np.arange(len(branch))
        inspection, coarse = look(self.function), self.error_samples(self.options.inputs)[0]
        peaks = np.broadcast_to(coarse, (len(rows), coarse.size))
        for turn in range(self.options.exchanges):
            found = extremes(self.weighted_gap(unknowns[rows], branch[rows]), inspection, ANSWERS.peaks // 2)
            broken = np.minimum(self.problem.conditions(unknowns[rows])[0], 0.0).min(axis=1)
            largest = found.size.max(axis=1)
            merit = largest - STEPS.penalty * broken
            better = merit < smallest[rows]
            # no longer falling: the steps saw all the extremes
            first = rows == np.argmin(smallest)
            # candidates behind the best are alternatives, which may be slightly short of level
            level = merit >= smallest[rows] * (1 - np.where(first, self.options.level, self.options.nearly_level))
            best[rows[better]], smallest[rows[better]] = unknowns[rows[better]], merit[better]
            if turn and level.any():
                self.settled = self.settled or bool(np.any(level & first))
                keep = ~level
                rows, peaks, found = rows[keep], peaks[keep], type(found)(*(values[keep] for values in found))
            if not rows.size or self.multistart.work.expired():
                break
            fixed = np.broadcast_to(coarse, (len(rows), coarse.size))
            angles = np.sort(np.concatenate([found.crank, peaks[:, -ANSWERS.peaks :], fixed], axis=1))
            peaks, options = found.crank, self.options
            inputs = self.problem.inputs(branch[rows], angles, self.function.weight(angles))
            steps, gain = options.exchange_steps, options.level
            done = self._descended(best[rows], inputs, steps, gain, radii[rows])
            unknowns[rows], radii[rows] = done.unknowns, np.maximum(2 * done.radius, self.options.radius_min)
        return best

    def weighted_gap(self, unknowns: Floats, branch: Floats) -> Callable[[Floats], Floats]:
        """Return the weighted errors of candidates as a function of crank angles (n, q)."""

        def error(crank: Floats) -> Floats:
            each = np.broadcast_to(crank, (len(branch), crank.shape[-1]))
            gap = np.clip(self.problem.gap(unknowns, branch, each), -self.options.open_error, self.options.open_error)
            return self.function.weight(each) * gap

        return error


def refit(task: FunctionTask, generator: Generator) -> Generator | None:
    """Return a four-bar of prescribed lengths near a generator, with zeros fitted again; None if it does not close."""
    run = FunctionSearch(task._replace(target=replace(task.target, one_way=False)), generator.law, 1)
    start = generator.zero + np.array(run.options.nearby_starts)
    if task.target.start is not None:
        start = np.array([task.target.start])
    unknowns, branch = np.zeros((start.size, 5)), np.full(start.size, float(generator.branch))
    unknowns[:, 3] = start
    return next(iter(run.best_from(run.with_best_offset(unknowns, branch), branch)), None)
