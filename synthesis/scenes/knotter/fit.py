"""Fit of unknown dimensions to a pattern of verdicts, and the degree to which the pattern determines them.

Every prescribed verdict has a margin that is positive if the mechanism gives that verdict.
The search maximises the smallest of these margins: it starts from the best of several seeded draws over the ranges of the
unknowns, and improves each by a sequence of linear programs on the slopes of the margins.
A pattern of verdicts bounds the unknowns but never determines them uniquely; the bounds are part of the result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from synthesis.one_variable import Flags, Floats, bisect
from synthesis.scenes.knotter.conditions import Condition
from synthesis.scenes.knotter.mechanism import Mechanism, with_dimensions
from synthesis.work import OutOfTime, Work


@dataclass(frozen=True)
class FitOptions:
    """Options of the fit; lengths in normalised unknowns are fractions of the ranges of the unknowns."""

    iterations: int = 30
    """Largest number of linear programs in a descent."""
    initial_trust_radius: float = 0.15
    """Largest change of a normalised unknown in the first linear program."""
    min_trust_radius: float = 1e-3
    """Trust radius below which a descent ends."""
    difference_step: float = 4e-3
    """Step of the finite differences, in normalised unknowns.
    A candidate whose neighbours at this distance violate the pattern is ranked lower."""
    line_samples: int = 24
    """Number of samples along a direction that locate the first violated verdict."""
    line_halvings: int = 18
    """Number of halvings of the interval before the first violated verdict."""
    first_candidate_budget: float = 1e3
    """Extension of the budget for the first candidate, as a multiple of the budget: without it there is no result."""
    reserved_for_descents: float = 0.5
    """Fraction of the budget that the draws leave to the descents."""
    first_batch: int = 8
    """Number of draws evaluated before the time is first checked; the number doubles with each batch."""
    max_batch: int = 64
    """Largest number of draws evaluated between two checks of the time."""
    rank_tolerance: float = 1e-6
    """Singular values below this fraction of the largest singular value count as zero."""


DEFAULT_OPTIONS = FitOptions()


@dataclass(frozen=True)
class PrescribedVerdicts:
    """Verdicts that the mechanism must give for a condition."""

    condition: Condition
    """The condition."""
    items: Mapping[str, Floats]
    """Dimensions in which the entries of the pattern differ, each of shape (entries,)."""
    holds: Flags
    """Prescribed verdicts, shape (entries,)."""


class Pattern:
    """Margins of all prescribed verdicts as functions of the unknown dimensions.

    An unknown is normalised: 0 at the lower end and 1 at the upper end of its range.
    A margin is positive if the mechanism gives the prescribed verdict.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, which provides all other dimensions.
    verdicts : sequence of PrescribedVerdicts
        The pattern.
    ranges : mapping
        Lower and upper end of the range of each unknown.
    options : FitOptions, optional
        Options of the fit.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        verdicts: Sequence[PrescribedVerdicts],
        ranges: Mapping[str, tuple[float, float]],
        options: FitOptions = DEFAULT_OPTIONS,
    ) -> None:
        self.mechanism, self.verdicts, self.names = mechanism, tuple(verdicts), tuple(ranges)
        self.low, self.high = np.array(list(ranges.values())).T
        self.options = options

    def denormalise(self, unknowns: Floats) -> Floats:
        """Return the dimensions for normalised unknowns, shape (..., unknowns)."""
        return self.low + unknowns * (self.high - self.low)

    def normalise(self, values: Floats) -> Floats:
        """Return the normalised unknowns for dimensions, shape (..., unknowns)."""
        return (values - self.low) / (self.high - self.low)

    def margins(self, unknowns: Floats, work: Work) -> Floats:
        """Evaluate the margins of several candidates.

        Parameters
        ----------
        unknowns : ndarray, shape (candidates, unknowns)
            Normalised unknowns.
        work : Work
            Time budget and cancellation.

        Returns
        -------
        ndarray, shape (candidates, entries)
            Margins, positive for entries with the prescribed verdict.

        Raises
        ------
        OutOfTime
            The budget is used up.
        """
        values, candidates, margins = self.denormalise(unknowns), len(unknowns), []
        for prescribed in self.verdicts:
            entries = len(prescribed.holds)
            items = {name: np.repeat(values[:, k], entries) for k, name in enumerate(self.names)}
            items |= {name: np.tile(column, candidates) for name, column in prescribed.items.items()}
            mechanism = with_dimensions(self.mechanism, items)
            result = prescribed.condition.evaluate(mechanism, candidates * entries, work)
            sign = np.where(prescribed.holds, 1.0, -1.0)
            margins.append(result.margin.reshape(candidates, entries) * sign)
        return np.concatenate(margins, axis=1)

    def linearise(self, unknowns: Floats, work: Work) -> Candidate:
        """Evaluate the margins of a candidate and their derivatives.

        Where another window of the rope becomes the first, a margin is discontinuous.
        There the difference on the side away from the discontinuity is used.

        Parameters
        ----------
        unknowns : ndarray, shape (unknowns,)
            Normalised unknowns.
        work : Work
            Time budget and cancellation.

        Returns
        -------
        Candidate
            The candidate with its slopes.

        Raises
        ------
        OutOfTime
            The budget is used up.
        """
        step, count = self.options.difference_step, len(unknowns)
        steps = step * np.eye(count)
        stencil = self.margins(np.concatenate([unknowns[None], unknowns + steps, unknowns - steps]), work)
        forward, backward = (stencil[1 : count + 1] - stencil[0]) / step, (stencil[0] - stencil[count + 1 :]) / step
        size = np.maximum(np.abs(forward), np.abs(backward))
        smaller = np.where(np.abs(forward) < np.abs(backward), forward, backward)
        slopes = np.where(np.abs(forward - backward) <= 0.5 * size, 0.5 * (forward + backward), smaller).T
        return Candidate(unknowns, stencil[0], slopes, float(stencil.min()))


@dataclass(frozen=True)
class Candidate:
    """One set of unknown dimensions with the margins of the pattern."""

    unknowns: Floats
    """Normalised unknowns, shape (unknowns,)."""
    margins: Floats
    """Margins, shape (entries,)."""
    slopes: Floats | None
    """Derivatives of the margins with respect to the normalised unknowns, shape (entries, unknowns).
    None if the time was up before they were known."""
    robust_margin: float
    """Smallest margin of this candidate and of its neighbours at a distance of the difference step, if these are known."""

    @property
    def smallest_margin(self) -> float:
        """Smallest margin; positive if the candidate reproduces the whole pattern."""
        return float(self.margins.min())


@dataclass(frozen=True)
class Direction:
    """Direction in the space of the unknowns, with the distances over which the pattern persists along it."""

    strength: float
    """Rate at which the margins change along the direction, length per fraction of the ranges; 0 for no change."""
    backward: float
    """Distance backwards over which the pattern persists, as a fraction of the ranges, at most to their ends."""
    forward: float
    """Distance forwards over which the pattern persists, as a fraction of the ranges, at most to their ends."""
    vector: Annotated[Floats, dict[str, float]]
    """Unit vector in fractions of the ranges."""


def fit_pattern(
    pattern: Pattern, draws: int, descents: int, seed: int, start: Floats | None = None, work: Work | None = None
) -> tuple[list[Candidate], int]:
    """Search for dimensions that reproduce a pattern with margins as large as possible.

    Parameters
    ----------
    pattern : Pattern
        The pattern and the ranges of the unknowns.
    draws : int
        Number of seeded draws over the ranges (Latin hypercube).
    descents : int
        Number of best draws that are improved; with 0, only the start is evaluated, without improving it.
    seed : int
        Seed of the draws.
    start : ndarray, shape (unknowns,), optional
        Normalised unknowns of an additional start, which is improved as well.
    work : Work, optional
        Time budget and cancellation; when the budget is used up, the best candidates found are returned.

    Returns
    -------
    candidates : list of Candidate
        The improved candidates, best first.
    reproducing_draws : int
        Number of draws that reproduce the pattern without being improved.
    """
    work = work or Work()
    first_work = work.extended(pattern.options.first_candidate_budget)
    starts, reproducing_draws = [] if start is None else [start], 0
    if draws and descents:
        samples = _latin_hypercube(draws, len(pattern.names), seed)
        smallest = _smallest_margins(pattern, samples, first_work, work)
        reproducing_draws = int(np.count_nonzero(smallest > 0))
        best = np.argsort(-smallest, kind="stable")[:descents]
        starts += list(samples[best[np.isfinite(smallest[best])]])
    candidates: list[Candidate] = []
    for unknowns in starts:
        if candidates and work.expired():
            break
        try:
            improve = _improve if descents else Pattern.linearise
            candidates.append(improve(pattern, unknowns, work))
        except OutOfTime:  # before the slopes are known
            if not candidates:
                margins = pattern.margins(unknowns[None], first_work)[0]
                candidates.append(Candidate(unknowns, margins, None, float(margins.min())))
    candidates.sort(key=lambda candidate: (candidate.smallest_margin <= 0, -candidate.robust_margin))
    return candidates, reproducing_draws


def _latin_hypercube(draws: int, unknowns: int, seed: int) -> Floats:
    """Return draws of shape (draws, unknowns), one in each of ``draws`` equal intervals of every range."""
    random = np.random.default_rng(seed)
    intervals = random.permuted(np.tile(np.arange(draws), (unknowns, 1)), axis=1).T
    return np.asarray((intervals + random.random((draws, unknowns))) / draws)


def _smallest_margins(pattern: Pattern, samples: Floats, first_work: Work, work: Work) -> Floats:
    """Return the smallest margin of each draw, shape (draws,); -inf for draws that the budget does not cover."""
    options = pattern.options
    drawing = work.extended(-options.reserved_for_descents)
    smallest = np.full(len(samples), -np.inf)
    begin, batch_size = 0, options.first_batch
    while begin < len(samples) and not (begin and drawing.expired()):
        batch = slice(begin, begin + batch_size)
        smallest[batch] = pattern.margins(samples[batch], first_work).min(axis=1)
        begin, batch_size = begin + batch_size, min(2 * batch_size, options.max_batch)
    return smallest


def _improve(pattern: Pattern, unknowns: Floats, work: Work) -> Candidate:
    """Increase the robust margin by linear programs within a trust radius, which shrinks if they promise too much."""
    from scipy.optimize import linprog

    options = pattern.options
    best = pattern.linearise(unknowns, work)
    trust_radius, count = options.initial_trust_radius, len(unknowns)
    for _ in range(options.iterations):
        if trust_radius < options.min_trust_radius or work.expired():
            break
        assert best.slopes is not None
        # Maximise t subject to margin + slope . step >= t for every entry.
        rows = np.column_stack([-best.slopes, np.ones(len(best.margins))])
        low, high = np.maximum(-trust_radius, -best.unknowns), np.minimum(trust_radius, 1 - best.unknowns)
        bounds = [*zip(low, high), (None, None)]
        solution = linprog(np.append(np.zeros(count), -1.0), A_ub=rows, b_ub=best.margins, bounds=bounds)
        if not solution.success:
            break
        try:
            trial = pattern.linearise(np.clip(best.unknowns + solution.x[:count], 0.0, 1.0), work)
        except OutOfTime:
            break
        gain, predicted_gain = trial.robust_margin - best.robust_margin, -solution.fun - best.smallest_margin
        if gain > 0.1 * predicted_gain > 0:
            best = trial
            trust_radius = min(2 * trust_radius, 0.5) if gain > 0.7 * predicted_gain else trust_radius
        else:
            trust_radius *= 0.4
    return best


def extents(pattern: Pattern, unknowns: Floats, vectors: Floats, work: Work) -> Floats:
    """Compute the distances over which a pattern persists along several directions.

    Parameters
    ----------
    pattern : Pattern
        The pattern.
    unknowns : ndarray, shape (unknowns,)
        Normalised unknowns of a candidate that reproduces the pattern.
    vectors : ndarray, shape (n, unknowns)
        Directions, in normalised unknowns.
    work : Work
        Time budget and cancellation.

    Returns
    -------
    ndarray, shape (n,)
        Distances in multiples of the vectors, at most to the ends of the ranges.

    Raises
    ------
    OutOfTime
        The budget is used up.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        to_upper, to_lower = (1 - unknowns) / vectors, -unknowns / vectors
        room = np.where(vectors > 0, to_upper, np.where(vectors < 0, to_lower, np.inf)).min(axis=1)

    def persists(lengths: Floats) -> Flags:
        return np.asarray(pattern.margins(unknowns + lengths[:, None] * vectors, work).min(axis=1) > 0)

    count = pattern.options.line_samples
    fractions = np.linspace(0, 1, count + 1)[1:]
    samples = unknowns + (room[:, None] * fractions)[..., None] * vectors[:, None]
    margins = pattern.margins(np.clip(samples, 0, 1).reshape(-1, len(unknowns)), work).min(axis=1)
    violated = margins.reshape(len(vectors), count) <= 0
    first = np.argmax(violated, axis=1)
    never_violated = ~violated.any(axis=1)
    inner = room * np.where(never_violated, 1.0, fractions[first] - fractions[0])
    outer = room * np.where(never_violated, 1.0, fractions[first])
    return bisect(persists, inner, outer, pattern.options.line_halvings)[0]


def directions(pattern: Pattern, candidate: Candidate, work: Work | None = None) -> list[Direction]:
    """Compute orthogonal directions of the unknowns, those that change the margins least first.

    The directions are the right singular vectors of the slopes of the margins.
    Along a direction of strength 0, no margin changes to first order.

    Parameters
    ----------
    pattern : Pattern
        The pattern.
    candidate : Candidate
        A candidate that reproduces the pattern and whose slopes are known.
    work : Work, optional
        Time budget and cancellation.

    Returns
    -------
    list of Direction
        As many directions as unknowns.

    Raises
    ------
    OutOfTime
        The budget is used up.
    """
    work, unknowns = work or Work(), candidate.unknowns
    assert candidate.slopes is not None, "the slopes are unknown because the time was up"
    _, strengths, vectors = np.linalg.svd(candidate.slopes)
    strengths = np.append(strengths, np.zeros(len(unknowns) - len(strengths)))
    forward = extents(pattern, unknowns, vectors, work)
    backward = extents(pattern, unknowns, -vectors, work)
    rows = zip(vectors, strengths, backward, forward)
    return [Direction(float(s), float(b), float(f), v) for v, s, b, f in rows][::-1]


def rank(singular_directions: Sequence[Direction], options: FitOptions = DEFAULT_OPTIONS) -> int:
    """Return the number of directions that change the margins to first order."""
    strengths = np.array([direction.strength for direction in singular_directions])
    return int(np.count_nonzero(strengths > options.rank_tolerance * strengths.max()))


def single_ranges(pattern: Pattern, unknowns: Floats, work: Work | None = None) -> list[tuple[float, float]]:
    """Compute the range of each unknown over which the pattern persists while the other unknowns are fixed.

    Parameters
    ----------
    pattern : Pattern
        The pattern.
    unknowns : ndarray, shape (unknowns,)
        Normalised unknowns of a candidate that reproduces the pattern.
    work : Work, optional
        Time budget and cancellation.

    Returns
    -------
    list of tuple of float
        Lower and upper end of each range, as dimensions.

    Raises
    ------
    OutOfTime
        The budget is used up.
    """
    axes, work = np.eye(len(unknowns)), work or Work()
    below, above = extents(pattern, unknowns, -axes, work), extents(pattern, unknowns, axes, work)
    width, nominal = pattern.high - pattern.low, pattern.denormalise(unknowns)
    return [(float(low), float(high)) for low, high in zip(nominal - below * width, nominal + above * width)]
