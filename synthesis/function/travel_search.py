"""Search for function generators with travel: linkages with a slider or a cylinder whose output follows a function of the input.

The steps are those of `search` with other linkages: starting points spread over all shapes and zeros, least squares,
then sequential quadratic steps within the limits, for the largest error over the extremes of the error curve of each
candidate. Inputs and outputs are radians, or lengths over a scale that all lengths share. The laws are those of `travel_laws`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.function.answers import FunctionErrors, errors_of, turning_back
from synthesis.function.problem import FunctionProblem, OutputCurve
from synthesis.function.search import FunctionSearch, candidates_at
from synthesis.function.target_function import TargetFunction
from synthesis.function.travel_laws import ANGLE, LAWS, Law
from synthesis.guides import Driver
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.one_variable import closer_looks
from synthesis.pose import whole_turns
from synthesis.ranking import APART, distinct
from synthesis.search.report import SearchReport, stopped_by
from synthesis.target import TURN, Interval
from synthesis.work import Work


@dataclass(frozen=True)
class TravelOptions:
    """Options of the search for functions with travel."""

    sine_min: float = 1e-4
    """Smallest sine of the transmission angle: where the linkage locks, the output has no derivative."""
    margin: float = 1e-9
    """Margin by which descents satisfy limits."""
    length_max: float = 1e3
    """Largest length over the scale if no limit is smaller."""
    few_samples: int = 9
    """Number of inputs at which starting points and limits are evaluated."""
    imaginary_step: float = 1e-30
    """Imaginary step of the derivatives of sines."""
    starting_points: int = 6000
    """Number of shapes and zeros that are evaluated for each branch."""
    seeds: int = 120
    """Number of starting points that descend."""
    spare: int = 4
    """Number of further answers, because some prove to lie in the same basin."""
    looks: tuple[int, ...] = (33, 33, 33, 33)
    """Numbers of nodes of closer looks at the smallest transmission angle."""
    short_steps: int = 40
    """Number of steps above which a descent is the last."""
    continued: int = 8
    """Number of the best candidates whose last descent continues."""
    continued_steps: int = 300
    """Number of steps of these continued descents."""
    open_error: float = 1e3
    """Error of a linkage that does not close."""
    answer_max: float = 0.1
    """Error above which a law has no answer if another law is much better."""
    much_better: float = 10.0
    """Ratio of errors above which another law is much better."""
    rounding: float = 1e-9
    """Fraction of the output below which a reversal is rounding."""


OPTIONS = TravelOptions()


@dataclass(frozen=True)
class TravelLimits:
    """Limits of shape and lengths for a linkage with a slider, and ``prescribed`` lengths by their names."""

    limits: Limits
    prescribed: Mapping[str, float] = field(default_factory=dict)

    def over(self, scale: float) -> TravelLimits:
        """Return the limits with lengths over a scale."""
        scaled = {name: value if name == "angle" else value / scale for name, value in self.prescribed.items()}
        return TravelLimits(self.limits.over(scale), scaled)


class TravelProblem(FunctionProblem):
    """A function, a law and limits; unknowns that the law does not have, or that are prescribed, are fixed."""

    def __init__(self, target: TargetFunction, law: Law, limits: TravelLimits, largest: bool) -> None:
        self.function, self.law, self.limits = target, law, limits.limits
        self.offset, self.turns, self.wraps = target.offset, law.output == ANGLE, law.output == ANGLE
        self.moving = [*range(law.size), 3]
        self.least_sine = max(np.sin(self.limits.transmission_angle_min), OPTIONS.sine_min)
        prescribed = np.full(3, np.nan)
        prescribed[law.size :] = 0.0
        for name, value in limits.prescribed.items():
            if name in law.lengths:
                index = law.lengths.index(name)
                prescribed[index] = np.log(value) if law.positive[index] else value
        self.prescribed = prescribed
        held = np.concatenate([~np.isnan(prescribed), [target.start is not None, target.offset is not None]])
        self.free = np.flatnonzero(~held)
        low, high = np.full(5, -np.inf), np.full(5, np.inf)
        smallest, max_count = (
            self.limits.link_min or 1 / OPTIONS.length_max,
            self.limits.link_max or OPTIONS.length_max,
        )
        for k, above in enumerate(law.positive):
            low[k], high[k] = (np.log(smallest), np.log(max_count)) if above else (-max_count, max_count)
            if law.lengths[k] == "angle":
                low[k], high[k] = -np.inf, np.inf
        low[:3], high[:3] = np.where(np.isnan(prescribed), [low[:3], high[:3]], prescribed)
        if law.input != ANGLE:
            low[3], high[3] = -4 * OPTIONS.length_max, 4 * OPTIONS.length_max
        self.box = low, high
        self.rate_inputs = (1 - np.cos(np.linspace(0.0, np.pi, OPTIONS.few_samples))) / 2 * target.crank[-1]

    # -- conditions ---------------------------------------------------------------------------------------------------

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return the conditions of transmission angles, at some inputs and at the minimum, and of the ratio of lengths."""
        inputs = self.lowest(unknowns)
        sines = self.law.sines(unknowns, inputs)
        value, slope = [sines - self.least_sine - OPTIONS.margin], [np.zeros((*sines.shape, 5))]
        for k in self.moving:
            aside: Any = unknowns + 0j
            aside[:, k] += 1j * OPTIONS.imaginary_step
            by = self.law.sines(aside, inputs).imag / OPTIONS.imaginary_step
            slope[0][:, :, k] = np.clip(np.nan_to_num(by), -1e6, 1e6)
        above = np.flatnonzero(self.law.positive)
        if self.limits.link_ratio_max is not None and above.size == 2:
            a, b = above
            apart = unknowns[:, a] - unknowns[:, b]
            largest_ratio = np.log(self.limits.link_ratio_max)
            value.append(np.stack([largest_ratio - apart, largest_ratio + apart], axis=1))
            rows = np.zeros((len(unknowns), 2, 5))
            rows[:, 0, a], rows[:, 0, b], rows[:, 1, a], rows[:, 1, b] = -1.0, 1.0, 1.0, -1.0
            slope.append(rows)
        return np.concatenate(value, axis=1), np.concatenate(slope, axis=1)

    def lowest(self, unknowns: Floats) -> Floats:
        """Return the fixed inputs and the input of the smallest transmission angle between them, (n, q + 1)."""
        fixed = np.broadcast_to(self.rate_inputs, (len(unknowns), self.rate_inputs.size))
        best = np.argmin(self.law.sines(unknowns, fixed), axis=1)
        ends = (
            self.rate_inputs[np.maximum(best - 1, 0)],
            self.rate_inputs[np.minimum(best + 1, self.rate_inputs.size - 1)],
        )
        _, minima = closer_looks(partial(self.law.sines, unknowns), *ends, OPTIONS.looks)
        return np.concatenate([fixed, minima[:, None]], axis=1)

    # -- errors -------------------------------------------------------------------------------------------------------

    def at(self, unknowns: Floats, branch: Floats, crank: Floats, derivatives: bool = True) -> OutputCurve:
        """Evaluate the law."""
        return self.law.at(unknowns, branch, crank)

    # -- starting points --------------------------------------------------------------------------------------------------

    def beginnings(self, count: int) -> Floats:
        """Spread shapes and zeros (n, 5) over the useful range; the same each time."""
        random, law = np.random.default_rng(21), self.law
        out = np.zeros((count, 5))
        size = np.exp(random.uniform(-1.5, 4.5, (count, 1)) + random.uniform(-1.2, 1.2, (count, 3)))
        for k, above in enumerate(law.positive):
            out[:, k] = np.log(size[:, k]) if above else random.choice([-1.0, 1.0], count) * size[:, k]
            if law.lengths[k] == "angle":
                out[:, k] = random.uniform(-np.pi, np.pi, count)
            elif law.lengths[k] == "offset":
                reach = size[:, 0] + size[:, 1]
                out[:, k] = reach * np.where(random.random(count) < 0.2, 0.0, random.uniform(-0.8, 0.8, count))
            elif law.lengths[k] == "slot_offset":
                out[:, k] = out[:, 0] * random.uniform(-1.2, 1.2, count) * (random.random(count) > 0.3)
        out[:, :3] = np.where(np.isnan(self.prescribed), out[:, :3], self.prescribed)
        lengths = law.of(out)
        if law.input == ANGLE:
            out[:, 3] = random.uniform(0, TURN, count)
        else:
            reach = np.abs(lengths[:, 0]) + (np.abs(lengths[:, 1]) if "angle" not in law.lengths else 0.0)
            if "angle" in law.lengths:
                reach = lengths[:, 0] / np.maximum(np.abs(np.sin(lengths[:, 1])), 0.1)
            out[:, 3] = (
                1.2 * reach * random.uniform(-1, 1, count) - random.uniform(0, 1, count) * self.function.crank[-1]
            )
            if law.driver is Driver.CYLINDER:
                out[:, 3] = np.abs(out[:, 3])
        if self.function.start is not None:
            out[:, 3] = self.function.start
        return out


class TravelGenerator(NamedTuple):
    """Linkage whose output follows the function; lengths over the scale."""

    law: Law
    lengths: Floats
    """(k,): lengths of the law."""
    branch: int
    zero: float
    """Input at the first sample."""
    offset: float
    """Added to the linkage's own output, whose angle lies in (-pi, pi] at the first sample, to give the output."""
    errors: FunctionErrors
    linkage: Linkage
    transmission_angle_min: float
    """Exact minimum over the used interval."""

    @property
    def identity(self) -> Floats:
        """Numbers that differ between linkages."""
        angle = np.array(self.law.lengths) == "angle"
        size = np.abs(self.lengths[~angle]).max()
        # two sliders make the same function in a mirror
        shape = np.where(angle, np.abs(self.lengths), self.lengths / size)
        missing = np.zeros(3 - shape.size)
        return np.array([*shape, *missing, np.log(size), self.branch, LAWS.index(self.law)])

    @property
    def looks(self) -> Floats:
        """Numbers that differ by less than 1 for linkages whose pictures look the same."""
        return self.identity / 0.02

    def output(self, travel: Floats) -> Floats:
        """Output at inputs (M,) from the first sample, continuous."""
        unknowns = np.zeros((1, 5))
        unknowns[0, : self.law.size] = np.where(
            self.law.positive, np.log(np.where(self.law.positive, self.lengths, 1.0)), self.lengths
        )
        unknowns[0, 3] = self.zero
        inputs = np.concatenate([[0.0], travel])
        value = self.law.at(unknowns, np.array([float(self.branch)]), inputs[None]).value[0]
        if self.law.output == ANGLE:
            value = np.unwrap(value)
            value = value - whole_turns(value[0])
        return value[1:] + self.offset


class TravelSearch(FunctionSearch):
    """Search with a single law."""

    def __init__(
        self,
        target: TargetFunction,
        law: Law,
        limits: TravelLimits,
        largest: bool,
        top: int,
        tolerance: float,
        work: Work,
    ) -> None:
        self.function, self.law, self.travel_limits, self.largest = target, law, limits, largest
        self.begin_with(TravelProblem(target, law, limits, largest), top, tolerance, work)

    def least_squares(self, unknowns: Floats, branch: Floats, count: int, steps: int) -> tuple[Floats, Floats]:
        """Minimize squared errors; the best candidates continue, because basins near a dead position are narrow."""
        unknowns, cost = super().least_squares(unknowns, branch, count, steps)
        best = np.argsort(cost, kind="stable")[: OPTIONS.continued]
        if steps > OPTIONS.short_steps and best.size and cost[best[0]] > (0.3 * self.tolerance) ** 2:
            unknowns[best], cost[best] = super().least_squares(
                unknowns[best], branch[best], count, OPTIONS.continued_steps
            )
        return unknowns, cost

    def weighted_gap(self, unknowns: Floats, branch: Floats) -> Callable[[Floats], Floats]:
        """As for four-bars; very large if a candidate does not close between the inputs of its steps."""
        error = super().weighted_gap(unknowns, branch)
        return lambda crank: np.minimum(error(crank), OPTIONS.open_error)

    def basin_coordinates(self, unknowns: Floats) -> Floats:
        """Return numbers of order 1 that differ between basins."""
        zero = unknowns[:, 3]
        around = [np.cos(zero), np.sin(zero)] if self.law.input == ANGLE else [np.arcsinh(zero), 0 * zero]
        return np.column_stack([np.arcsinh(unknowns[:, :3]), *around])

    def run(self) -> list[Any]:
        """Return the best distinct candidates within the limits."""
        before, branches = self.work.elapsed, self.law.branches
        begin = self.problem.beginnings(OPTIONS.starting_points)
        begin, root = self.screened_from(
            begin, *self.error_samples(OPTIONS.few_samples), branches, OPTIONS.seeds // len(branches)
        )
        self.screened = self.work.elapsed - before
        self.seeds = len(root)
        if not self.problem.free.size:  # everything is prescribed: nothing is left to search
            self.settled = True
            self.multistart.accept(candidates_at(begin, root))
            return self.known
        return self.best_from(begin, root)

    def assessed(self, unknowns: Floats, branch: Floats) -> list[Any]:
        """Return candidates as generators with recomputed errors; None if a limit is violated."""
        problem, target, law = self.problem, self.function, self.law
        if not self.largest:
            root = np.broadcast_to(target.mean.root, target.crank.shape)
            unknowns = problem.with_offset(unknowns, branch, target.crank, root)
        lengths = law.of(unknowns)[:, : law.size]
        for k, name in enumerate(law.lengths):
            if name in self.travel_limits.prescribed:
                lengths[:, k] = self.travel_limits.prescribed[name]
        crank = np.broadcast_to(target.crank, (len(branch), target.crank.size))
        good = np.all(np.isfinite(problem.gap(unknowns, branch, crank)), axis=1)
        rows = zip(unknowns, lengths, branch, good)
        return [self.generator(row, size, int(side)) if closes else None for row, size, side, closes in rows]

    def generator(self, unknowns: Floats, lengths: Floats, branch: int) -> TravelGenerator | None:
        """Return a linkage with its errors; None if it violates a limit."""
        law, target, limits = self.law, self.function, self.travel_limits.limits
        zero = float(unknowns[3])
        all_lengths = np.zeros(3)
        all_lengths[: law.size] = lengths
        if law.input == ANGLE:
            zero = zero % TURN
        linkage = law.linkage(all_lengths, branch, zero)
        used = Interval(0.0, float(target.crank[-1]))
        smallest_angle = linkage.transmission_angle_over(used.after(linkage.start))
        if not smallest_angle >= limits.transmission_angle_min * (1 - OPTIONS.rounding) or not smallest_angle > 0:
            return None
        sizes = np.abs(lengths[[name not in ("angle", "offset", "slot_offset") for name in law.lengths]])
        shortest, longest = sizes.min(), sizes.max()
        if limits.link_min is not None and shortest < limits.link_min * (1 - OPTIONS.rounding):
            return None
        if limits.link_max is not None and longest > limits.link_max * (1 + OPTIONS.rounding):
            return None
        if limits.link_ratio_max is not None and longest > shortest * limits.link_ratio_max * (1 + OPTIONS.rounding):
            return None
        side, offset = np.array([float(branch)]), float(unknowns[4])

        def gap(crank: Floats) -> Floats:
            return np.asarray(self.problem.gap(unknowns[None], side, crank))

        (errors,) = errors_of(target, gap, 1, self.largest, gap(target.crank[None]))
        generator = TravelGenerator(law, lengths, branch, zero, 0.0, errors, linkage, smallest_angle)
        own = float(generator.output(np.zeros(1))[0])
        raw = float(law.at(unknowns[None], np.array([float(branch)]), np.zeros((1, 1))).value[0, 0])
        generator = generator._replace(offset=offset + raw - own)
        if law.output == ANGLE:  # nearest to the function by whole turns
            generator = generator._replace(
                offset=generator.offset + float(whole_turns(target.output[0] - own - generator.offset))
            )
        if target.one_way and travel_turns_back(target, generator) is not None:
            return None
        return generator


def travel_turns_back(target: TargetFunction, generator: TravelGenerator) -> str | None:
    """Return a sentence if the output reverses although the function is monotonic."""
    back = turning_back(target, generator.output, OPTIONS.rounding * abs(target.output[-1] - target.output[0]))
    return None if back is None else f"the output turns back at {100 * back[1]:.3g} % of the interval"


def generate_travel(
    laws: Sequence[Law],
    target: TargetFunction,
    limits: TravelLimits,
    largest: bool,
    top: int,
    tolerance: float,
    work: Work | None = None,
) -> tuple[list[Any], SearchReport]:
    """Find the best distinct linkages of some laws for a function, best first, including the best of each kind.

    Arguments and results are as in `generators.generate`; lengths are over the scale.
    """
    work = work or Work()
    of_each: list[list[Any]] = []
    trace: list[tuple[float, float]] = []
    seeds, screened, settled = 0, 0.0, True
    for law in laws:
        if any(of_each) and work.expired():
            break
        run = TravelSearch(target, law, limits, largest, top + OPTIONS.spare, tolerance, work)
        of_each.append(distinct(run.run(), top, APART, exact=tolerance))
        seeds, screened, settled = (
            seeds + run.seeds,
            screened + run.screened,
            settled and (run.settled or not run.known),
        )
        best = trace[-1][1] if trace else np.inf
        trace += [(at, min(value, best)) for at, value in run.trace]
    smallest = min((solutions[0].errors.objective for solutions in of_each if solutions), default=0.0)
    of_each = [
        solutions
        for solutions in of_each
        if solutions and solutions[0].errors.objective <= max(OPTIONS.answer_max, OPTIONS.much_better * smallest)
    ]
    best_of = [solutions[0] for solutions in of_each]
    alternatives = distinct(
        [solution for solutions in of_each for solution in solutions[1:]], max(0, top - len(best_of)), APART
    )
    found = sorted(best_of + alternatives, key=lambda generator: generator.errors.objective)[:top]
    stopped = stopped_by(found, tolerance, work)
    return found, SearchReport(stopped, trace, screened, seeds, settled)
