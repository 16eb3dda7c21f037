"""Linkages of two guides as a problem of the multistart search: with a free or a prescribed drive.

The kinds of linkages and their drives are the groups of the search; their candidates differ in labels only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats, Ints, rows_at, rows_of_all
from synthesis.free.dyads import FEW, Body
from synthesis.guided.answers import as_guides, linkage_of
from synthesis.guided.pairs import OWN, Chart, Guides, Looked, Motion, Pairs, Problem, Samples, Stage
from synthesis.guided.seeds import Drive, exact_guides, near_guides, pairs_of
from synthesis.guides import Circle, Driver, Rail
from synthesis.kernels import distinct
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.search.multistart import Incumbents, SearchProblem
from synthesis.search.options import Schedule, SearchOptions
from synthesis.solution import Solution
from synthesis.violations import violations_of
from synthesis.work import Work

_SEARCH = Stage(8, 0.1, 2), Stage(6, 1.0, 2), Stage(8, 10.0, 2)
_END = Stage(8, 1e2, 2), Stage(8, 1e4, 3), Stage(5, 1e6, 3)
_POLISH = Stage(15, 1e4, 3), Stage(10, 1e6, 3)
_DRIVEN = Stage(12, 1.0, 8, 1e-6, 1e-3), Stage(20, 100.0, 8, 1e-6, 1e-3)
_DRIVEN_END = tuple(stage._replace(sweeps=8, stall=1e-6, damping=1e-3) for stage in _END)
_EXACT = Stage(12, 0.0, 4, 0.1, 1e-8)


@dataclass(frozen=True)
class PairOptions(SearchOptions):
    """Options of the search for pairs of guides; numbers of candidates count for each group."""

    schedule: Schedule = Schedule(_SEARCH, finished=2, end=_END)  # noqa: RUF009
    polish: tuple[Stage, ...] = _POLISH
    polished: int = 1
    max_pool: int = 6
    pool_distance: float = 0.02
    answer_distance: float = 0.02
    exact_distance: float = 0.02
    seed_rounds: int = 1
    origins: int = 3
    copies: int = 5
    gain: float = 0.01
    idle_rounds: float = 20
    idle_fraction: float = 0.0
    idle_rounds_unanswered: float = 16
    drop_exact: bool = True
    idle_rounds_led: float = 5
    """Number of idle rounds if a four-bar gives the rotations."""
    max_rounds: int = 160
    """Largest number of rounds."""
    seeds: int = 40
    """Number of seeds."""
    exact_seeds: int = 3
    """Number of exact pairs, refined together, among the seeds."""
    max_samples: int = 40
    """Number of samples up to which the search uses all."""
    thinned_samples: int = 24
    """Number of samples that the search uses of a longer motion."""
    max_polished_samples: int = 300
    """Number of samples up to which answers are polished, and guides are fitted to all."""
    screened_guides: int = 40
    """Number of guides of each type that are paired."""
    screened_pairs: int = 300
    """Number of pairs whose limits are evaluated when seeds are chosen."""
    screened_samples: tuple[int, int] = (10, 8)
    """Number of samples up to which seeds are chosen by all, and number otherwise."""
    perturbation: tuple[float, ...] = (0.25, 0.25, 0.15, 0.15, 0.3)
    """Widths of the perturbations in the unknowns of a guide."""
    bend: float = 0.2
    """Curvature of a circle that starts from a rail."""
    pairs_at_once: int = 1 << 13
    """Number of exact pairs that are evaluated between two looks at the time."""
    driven_at_once: int = 1 << 12
    """Number of candidates times samples with a prescribed drive between two looks at the time: some 20 ms."""
    sweeps: int = 8
    """Newton steps of the poses of answers."""
    search_sweeps: int = 6
    """Newton steps of the poses of candidates."""
    between: int = 4
    """Number of poses between two samples at which pairs for few samples are evaluated."""
    examined: int = 3
    """Number of candidates of a group whose motion is examined between the samples."""
    examined_of_few: int = 12
    """Number of such candidates for few samples, which leave long gaps."""
    further: tuple[int, int] = (24, 2)
    """Number of further candidates that are examined at the end, of all groups together, and smallest number of a group."""


@dataclass(frozen=True)
class DrivenOptions(PairOptions):
    """Options of the search with a prescribed drive."""

    schedule: Schedule = Schedule(_DRIVEN, finished=2, end=_DRIVEN_END)  # noqa: RUF009
    idle_rounds: float = 4


class Candidates(NamedTuple):
    """Pairs of guides with their drives and costs."""

    pairs: Pairs
    drive: Ints
    """(n,): index of the drive, which is the group."""
    cost: Floats
    """(n,): squared error."""
    branch: Floats
    direction: Floats
    """(n,): direction in which the drive moves."""
    first: Floats
    """(n,): prescribed drive at the first sample."""

    def take(self, indices: Any) -> Candidates:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Candidates) -> Candidates:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)


class PairProblem(SearchProblem):
    """Poses for linkages of two guides whose drive is free.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    drives : sequence of Drive
    incumbents : Incumbents
        Only candidates that improve on its answers are examined.
    work : Work
    options : PairOptions
    turned : ndarray, shape (N,), optional
        Rotations to start from if the request has none.
    prescribed : ndarray, shape (N,), optional
        Prescribed drive from the first sample on.
    """

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        drives: Sequence[Drive],
        incumbents: Incumbents,
        work: Work,
        options: PairOptions,
        turned: Floats | None = None,
        prescribed: Floats | None = None,
    ) -> None:
        if prescribed is not None and not drives[0].driver.turns:
            prescribed = prescribed / poses.length_scale
        self.poses, self.limits, self.drives, self.incumbents = poses, limits, list(drives), incumbents
        self.work, self.options, self.groups, self.prescribed = work, options, len(self.drives), prescribed
        samples = Samples.of(poses, prescribed)
        if turned is not None:
            samples = samples._replace(angle=np.where(samples.rotation_missing, turned, samples.angle))
        self.all = self._problem(samples)
        self.samples = self.all.samples
        self.few = self.all
        if self.samples.number > options.max_samples:
            self.few = self._problem(thinned(self.samples, options.max_samples, options.thinned_samples))
        self.posed = poses if turned is None else replace(poses, rotation=turned, rotation_weights=None)
        self.body = Body(self.posed)
        full, limit = poses.full, options.max_polished_samples
        self.thin = self.body if full.size <= limit else Body(poses.at(full[:: 3 * full.size // limit]))
        self._types = {guide for drive in self.drives for guide in (drive.first, drive.second)}
        self.random = np.random.default_rng(options.seed)
        self.seeds = 0
        self.waiting: Candidates | None = None
        """Candidates within the limits at the samples that were no gain; they are examined when the search has ended."""
        self._solutions: dict[tuple[int, float], Solution] = {}
        """Answers as linkages, by their drive and cost."""

    # -- candidates -------------------------------------------------------------------------------------------------

    def _problem(self, samples: Samples, driven: bool = False) -> Problem:
        """Return the refinement problem at some samples."""
        return Problem(samples, self.limits, self.poses, driven)

    def group(self, candidates: Candidates) -> Ints:
        """Return the drives of candidates."""
        return candidates.drive

    def identity(self, candidates: Candidates) -> Floats:
        """Return numbers that differ between pairs, of order 1, (n, 12)."""
        columns: list[Any] = []
        for guide in candidates.pairs.guides:
            size = np.maximum(1.0, np.abs(guide.point))
            columns += [guide.point.real / size, guide.point.imag / size]
            columns += [np.cos(2 * guide.normal), np.sin(2 * guide.normal)]
            columns += [np.log1p(np.abs(guide.curvature)), np.log(size)]
        return np.stack(columns, axis=1)

    def may_answer(self, candidates: Candidates) -> bool:
        """Return False: candidates violate limits before they converge."""
        return False

    def measured(self, pairs: Pairs, drive: Ints, problem: Problem, sweeps: int = 2) -> Candidates:
        """Return pairs with squared error, branch and direction at the poses that they allow."""
        at = problem.look(Chart(pairs), np.zeros((drive.size, 3)), sweeps, bounded=False)
        branch, direction = np.where(at.sines >= 0, 1.0, -1.0), np.where(at.gone >= 0, 1.0, -1.0)
        return Candidates(pairs, drive, at.cost, branch, direction, np.zeros(drive.size))

    def measured_again(self, found: Candidates, problem: Problem) -> Candidates:
        """Return candidates measured at well corrected poses."""
        return self.measured(found.pairs, found.drive, problem, self.options.search_sweeps)

    def look(self, found: Candidates, problem: Problem, sweeps: int) -> Looked:
        """Evaluate candidates and their violations of the limits."""
        return problem.look(Chart(found.pairs), labels(found), sweeps)

    def at(self, found: Candidates) -> Looked:
        """Evaluate candidates at the poses that close."""
        return self.look(found, self.all, self.options.sweeps)

    # -- refinement -------------------------------------------------------------------------------------------------

    def descended(self, starts: Candidates, stages: Sequence[Stage], problem: Problem) -> Candidates:
        """Return candidates after descents in which violated limits weigh more from stage to stage; costs are not updated."""
        work = self.incumbents.awaited(self.work)
        for stage in stages:
            if not starts.cost.size or work.expired():
                break
            pairs, _ = problem.descended(Chart(starts.pairs), labels(starts), stage, work)
            starts = starts._replace(pairs=pairs)
        return starts

    def refine(
        self, starts: Candidates, stages: Sequence[Stage], between: Callable[[Any], None] | None = None
    ) -> Candidates:
        """Refine starting points; their costs contain the violated limits, weighted as in the last stage."""
        found = self.descended(starts, stages, self.few)
        at = self.look(found, self.few, self.options.search_sweeps)
        return found._replace(cost=at.cost + stages[-1].weight * at.excess)

    def converge(self, candidates: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Refine basins within the limits. Return the candidates that are a gain."""
        return self._gains(candidates, stages, self.few)

    def polish(self, answers: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Refine answers on all samples, of groups without an exact answer."""
        few = self.samples.number <= self.options.max_polished_samples
        return self._gains(answers.take(self.incumbents.unsolved[answers.drive] & few), stages, self.all)

    def _gains(self, starts: Candidates, stages: Sequence[Stage], problem: Problem) -> Candidates:
        ended = self.measured_again(self.descended(starts, stages, problem), self.all)
        ended, good = self._examine(ended._replace(branch=starts.branch, direction=starts.direction))
        return ended.take(good)

    # -- answers ----------------------------------------------------------------------------------------------------

    def satisfying(self, candidates: Candidates, steps: int) -> Iterable[Candidates]:
        """Return candidates that are a gain and satisfy the limits over their whole motion."""
        known = np.array([self.is_answer(candidates.take([k])) for k in range(candidates.cost.size)], dtype=bool)
        if known.all():
            return [candidates]
        found, good = self._examine(candidates.take(~known))
        return [candidates.take(known).joined(found.take(good))]

    def _examine(self, found: Candidates) -> tuple[Candidates, Ints]:
        """Examine the best candidates between the samples, if they are a gain; others within the limits wait for the end.

        Returns
        -------
        found : Candidates
            With their squared errors at the poses that close.
        good : ndarray
            Indices of the candidates that satisfy the limits.
        """
        found, worst = self.broken(found)
        levels = self.incumbents.levels[:, 0] ** 2
        few = self.body.position.size <= FEW
        count = self.options.examined_of_few if few else self.options.examined
        work = self.incumbents.awaited(self.work)
        good: list[int] = []
        later: list[int] = []
        for group, own in enumerate(self.best_indices(found, np.where(worst <= 0, found.cost, np.inf), count)):
            if work.expired():
                break
            for index in own.tolist():
                if found.cost[index] >= levels[group]:
                    later.append(index)
                    continue
                if not self.missing(found.take([index])):
                    good.append(index)
                    levels[group] = found.cost[index]
        if later:
            waiting = found.take(np.array(later))
            self.waiting = waiting if self.waiting is None else self.waiting.joined(waiting)
        return found, np.array(good, dtype=int)

    def broken(self, found: Candidates) -> tuple[Candidates, Floats]:
        """Return candidates with their squared errors at the poses that close, and their largest violations there."""
        at = self.at(found)
        worst = np.where(at.closed & np.isfinite(at.cost), at.worst, np.inf)
        return found._replace(cost=at.cost), worst

    def missing(self, candidate: Candidates) -> dict[str, float]:
        """Return the violations of a single candidate over its whole motion, by the name of the limit."""
        if self.is_answer(candidate):
            return {}
        solution = self._linkage(candidate)
        if solution is None or solution.transmission_angle_min <= 0:
            return {"samples": np.inf}
        missing = violations_of(solution, self.poses, self.limits)
        if not missing:
            self._solutions[_key(candidate)] = solution
        return missing

    def is_answer(self, candidate: Candidates) -> bool:
        """Return whether a single candidate is known to satisfy the limits over its whole motion."""
        return _key(candidate) in self._solutions

    def solutions(self, answers: Candidates) -> list[Solution]:
        """Return answers as linkages in the user's unit."""
        return [self._solutions[_key(answers.take([k]))] for k in range(answers.cost.size)]

    def _linkage(self, candidate: Candidates) -> Solution | None:
        """Return a single candidate as a linkage with its errors, or None if it does not pass the samples."""
        driver = self.drives[int(candidate.drive[0])].driver
        return linkage_of(candidate.pairs.guides, driver, self.poses, self.at(candidate).poses[0], self.prescribed)

    # -- seeds ------------------------------------------------------------------------------------------------------

    def exact(self) -> Candidates | None:
        """Return pairs of exact guides, refined together, of all drives."""
        travel = None
        if self.prescribed is not None and not self.drives[0].driver.turns:
            travel = self.prescribed[self.poses.full]
        pairs, drive = pairs_of(exact_guides(self.body, self._types, travel), self.drives)
        if not pairs.number:
            return None
        if self.body.position.size <= FEW:
            pairs, drive = self._promising(pairs, drive)
        found = self.measured(pairs, drive, self.all)
        pairs, _ = self.all.descended(Chart(found.pairs), labels(found), _EXACT, Work())
        self.seeds += found.cost.size
        return self.measured(pairs, found.drive, self.all, 4)

    def _promising(self, pairs: Pairs, drive: Ints) -> tuple[Pairs, Ints]:
        """Select the pairs that violate the limits least, the same number for each drive, within the time."""
        problem, merit = self._problem(self._with_between()), np.full(pairs.number, np.inf)
        parts = -(-pairs.number // self.options.pairs_at_once)
        for first in range(parts):
            part = slice(first, None, parts)
            merit[part] = self._merit(self.measured(pairs.take(part), drive[part], self.all), problem, False)
            if self.work.expired():
                break
        found = Candidates(pairs, drive, *np.zeros((4, drive.size)))
        chosen = in_turn(self.best_indices(found, merit, 4 * self.options.seeds))
        return pairs.take(chosen), drive[chosen]

    def best(self, found: Candidates, count: int, problem: Problem) -> Candidates:
        """Return the best candidates of each drive by violated limits and squared errors."""
        return found.take(in_turn(self.best_indices(found, self._merit(found, problem), count)))

    def _merit(self, found: Candidates, problem: Problem, errors: bool = True) -> Floats:
        """Return violated limits and, unless they are left out, squared errors; smaller is better."""
        at = self.look(found, problem, 2)
        merit = 0.3 * at.merit + np.where(np.isfinite(at.cost), errors * at.cost, np.inf)
        return merit + self._timing_error(found, at, problem)

    def _timing_error(self, found: Candidates, at: Looked, problem: Problem) -> Floats | float:
        """Return the squared difference from a prescribed drive."""
        return 0.0

    def best_indices(self, found: Candidates, merit: Floats, count: int) -> list[Ints]:
        """Return the indices of the best different candidates of each drive with finite merit."""
        rows, order = self.identity(found), np.argsort(merit, kind="stable")
        order = order[np.isfinite(merit[order])]
        indices = []
        for group in range(self.groups):
            own = order[found.drive[order] == group]
            reach = np.full(own.size, self.options.pool_distance)
            indices.append(own[distinct.apart(rows[own], reach, (), 0, count)])
        return indices

    def seed_pairs(self) -> Candidates:
        """Return pairs of guides of points all over body and ground: the best of each drive."""
        options, motion = self.options, Motion.of(self.thin)
        guides = near_guides(self.thin, self._types)
        for kind, own in guides.items():
            best = np.argsort(_distances(own, motion), kind="stable")[: options.screened_guides]
            guides[kind] = own.take(best)
        pairs, drive = pairs_of(guides, self.drives)
        thin = self._problem(thinned(self.samples, *options.screened_samples))
        found = self.measured(pairs, drive, thin, 2)
        self.seeds += options.seeds * self.groups
        # limits take longer to evaluate: of each drive only the pairs that fit best
        best_fitting = []
        for group in range(self.groups):
            own_pairs = np.flatnonzero(found.drive == group)
            best_fitting.append(own_pairs[np.argsort(found.cost[own_pairs], kind="stable")[: options.screened_pairs]])
        return self.best(found.take(np.concatenate(best_fitting)), options.seeds, thin)

    def pair_of(self, linkage: Linkage) -> Candidates:
        """Return a given linkage with the first drive as a starting point."""
        first, second = (as_guides(guide, self.posed) for guide in linkage.guides)
        hinge = np.array([linkage.driver is Driver.HINGE])
        return self.measured(Pairs(first, second, hinge), np.zeros(1, dtype=np.intp), self.all)

    def _with_between(self) -> Samples:
        """Return the samples with others between them on a straight way, for limits."""
        samples, more = self.samples, self.options.between + 1
        number = samples.number
        at = np.linspace(0, number - 1, (number - 1) * more + 1)
        index = np.arange(number)
        before = np.arange(at.size) // more
        return Samples(
            np.interp(at, index, np.unwrap(samples.angle)),
            np.interp(at, index, samples.position.real) + 1j * np.interp(at, index, samples.position.imag),
            samples.rotation_variance[before],
            samples.position_variance[before],
            samples.rotation_missing[before],
            samples.position_missing[before],
            np.interp(at, index, samples.drive),
        )

    # -- perturbation -----------------------------------------------------------------------------------------------

    def perturb(self, origins: Candidates, copies: int) -> Candidates:
        """Return perturbed copies of basins."""
        chosen = []
        for group in range(self.groups):
            own = np.flatnonzero(origins.drive == group)
            chosen.append(np.resize(own, copies) if own.size else own)
        starts = origins.take(in_turn(chosen))
        chart, count = Chart(starts.pairs), starts.cost.size
        noise = self.random.standard_t(3, size=(count, 2 * OWN)) * np.tile(self.options.perturbation, 2)
        self.seeds += count
        return self.measured(chart.pairs_at(chart.start + noise), starts.drive, self.few, 2)

    def relatives(self, new: Candidates) -> Candidates | None:
        """Return new basins as starting points of other drives of their guides, and of circles in place of their rails."""
        kin = [(k, *row) for k, number in enumerate(new.drive) for row in self._kin[number]]
        if not kin:
            return None
        index, drive, exchanged, bent = (np.array(column) for column in zip(*kin))
        pairs = new.pairs.take(index)
        guides = []
        for own, partner in ((pairs.first, pairs.second), (pairs.second, pairs.first)):
            guides.append(Guides(*(np.where(exchanged, b, a) for a, b in zip(own, partner))))
        for k in (0, 1):
            bend = self.options.bend * np.where(self.random.random(drive.size) < 0.5, 1.0, -1.0)
            guides[k] = guides[k]._replace(curvature=np.where(bent[:, k], bend, guides[k].curvature))
        hinge = np.array([own.driver is Driver.HINGE for own in self.drives])[drive]
        self.seeds += drive.size
        return self.measured(Pairs(guides[0], guides[1], hinge), drive, self.few, 2)

    @cached_property
    def _kin(self) -> list[list[tuple[int, bool, tuple[bool, bool]]]]:
        """For each drive, others that its basins start: index, whether the guides are exchanged, and which are bent."""
        found: list[list[tuple[int, bool, tuple[bool, bool]]]] = []
        for number, drive in enumerate(self.drives):
            kin = []
            for index, target in enumerate(self.drives):
                for exchanged in (False, True):
                    types = (drive.second, drive.first) if exchanged else (drive.first, drive.second)
                    targets = (target.first, target.second)
                    bent = tuple(a is Rail and b is Circle for a, b in zip(types, targets))
                    alike = all(a is b or bend for a, b, bend in zip(types, targets, bent))
                    if alike and (index != number or exchanged):
                        kin.append((index, exchanged, (bent[0], bent[1])))
            found.append(kin)
        return found


class DrivenPairProblem(PairProblem):
    """Poses for linkages of two guides whose drive is prescribed."""

    @cached_property
    def driven(self) -> Problem:
        """The refinement problem with the prescribed drive."""
        return self._problem(self.samples, driven=True)

    def refine(
        self, starts: Candidates, stages: Sequence[Stage], between: Callable[[Any], None] | None = None
    ) -> Candidates:
        """Refine starting points: first only the poses, then with the prescribed drive."""
        found = self.measured_again(self.descended(starts, _SEARCH[:1], self.few), self.few)
        return self.timed(found.take(in_turn(self.best_indices(found, found.cost, self.options.seeds))), stages)

    def converge(self, candidates: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Refine new basins to convergence."""
        return self.timed(candidates, stages)

    def polish(self, answers: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Return no candidates: answers have converged."""
        return answers.take([])

    def relatives(self, new: Candidates) -> None:
        """Return no further starting points."""

    def timed(self, starts: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Return candidates after descents with the prescribed drive, within the time."""
        work, count = self.incumbents.awaited(self.work), max(1, self.options.driven_at_once // self.samples.number)
        parts = [self._timed(starts.take(slice(count)), stages)]
        for k in range(count, starts.cost.size, count):
            if work.expired():
                break
            parts.append(self._timed(starts.take(slice(k, k + count)), stages))
        return parts[0].joined(*parts[1:])

    def _timed(self, starts: Candidates, stages: Sequence[Stage]) -> Candidates:
        at = self.look(starts, self.all, self.options.search_sweeps)
        sign = self._signs(starts, at)
        first, _ = self._timing(at, sign, self.samples.drive)
        work = self.incumbents.awaited(self.work)
        for stage in stages:
            chart = Chart(starts.pairs)
            pairs, first = self.driven.descended(chart, labels(starts, sign=sign), stage, work, first)
            starts = starts._replace(pairs=pairs)
        at = self.driven.look(Chart(starts.pairs), labels(starts, sign=sign), 12, first)
        return starts._replace(cost=np.where(at.closed, at.cost, np.inf), first=first)

    def at(self, found: Candidates) -> Looked:
        """Evaluate candidates at the poses to which the prescribed drive leads them."""
        sign = self._signs(found, self.look(found, self.all, self.options.search_sweeps))
        return self.driven.look(Chart(found.pairs), labels(found, sign=sign), self.options.sweeps, found.first)

    def _signs(self, found: Candidates, at: Looked) -> Floats:
        """Return the direction in which the prescribed drive counts, (n,): a longer cylinder has a larger drive."""
        first, second, hinge = found.pairs
        # the intersection of two slots does not determine the end of a rod
        cylinder = first.inverse & ~hinge & ~second.inverse
        slides = first.straight & ~hinge
        along = found.direction * np.sign(self.samples.drive[-1])
        return np.where(cylinder, np.sign(at.extension), np.where(slides, along, 1.0))

    def _timing(self, at: Looked, sign: Floats, drive: Floats) -> tuple[Floats, Floats]:
        """Return the best drive at the first sample (n,), and the mean squared difference from the candidates' own drive."""
        off = at.drive - sign[:, None] * drive
        if self.drives[0].driver.turns:
            first = np.angle(np.mean(np.exp(1j * off), axis=1))
            off = (off - first[:, None] + np.pi) % (2 * np.pi) - np.pi
            return first, np.mean(off**2, axis=1)
        first = np.mean(off, axis=1)
        return first, np.mean((off - first[:, None]) ** 2, axis=1)

    def _timing_error(self, found: Candidates, at: Looked, problem: Problem) -> Floats:
        """Return the squared difference from the prescribed drive."""
        return self._timing(at, self._signs(found, at), problem.samples.drive)[1]


def in_turn(indices: list[Ints]) -> Ints:
    """Return the first index of each group, then the second of each: the remaining time serves all groups alike."""
    rank = np.concatenate([np.arange(own.size) for own in indices])
    return np.concatenate(indices)[np.argsort(rank, kind="stable")]


def labels(found: Candidates, sign: Floats | None = None) -> Floats:
    """Return the labels of candidates for `Problem.descended`, (n, 3)."""
    return np.stack([found.branch, found.direction, np.zeros(found.cost.size) if sign is None else sign], axis=1)


def thinned(samples: Samples, max_samples: int, count: int) -> Samples:
    """Return all samples, or a number of evenly chosen samples that represent all."""
    if samples.number <= max_samples:
        return samples
    chosen = np.unique(np.round(np.linspace(0, samples.number - 1, count)).astype(int))
    share = chosen.size / samples.number
    few = Samples(*(column[chosen] for column in samples))
    rotation, position = few.rotation_variance, few.position_variance
    return few._replace(
        rotation_variance=np.where(few.rotation_missing, rotation, rotation * share),
        position_variance=np.where(few.position_missing, position, position * share),
    )


def _key(candidate: Candidates) -> tuple[int, float]:
    """Return the drive and the cost of a single candidate."""
    return int(candidate.drive[0]), float(candidate.cost[0])


def _distances(guides: Guides, motion: Motion) -> Floats:
    """Return the first-order rms distance of guides from the poses, (n,)."""
    distance = np.empty(guides.point.size)
    for inverse, seen in ((False, motion), (True, motion.inverse)):
        own = guides.inverse == inverse
        points = seen.positions(guides.point[own])
        centre, curvature = guides.centre[own][:, None], guides.curvature[own][:, None]
        straight = guides.straight[own][:, None]
        inward = np.exp(1j * guides.normal[own])[:, None]
        gap = points - centre
        normal = np.where(straight, -inward, gap / np.maximum(np.abs(gap), 1e-12))
        radius = 1 / np.where(straight, 1.0, curvature)
        off = np.where(straight, (np.conj(-inward) * gap).real, np.abs(gap) - radius)
        swing = (np.conj(normal) * 1j * (points - seen.position)).real
        distance[own] = np.sqrt(np.sum((off**2 / (1 + swing**2)) * seen.root**2, axis=1))
    return distance
