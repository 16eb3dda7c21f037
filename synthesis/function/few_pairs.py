"""Four-bars that meet two to five pairs of a function exactly: sample the exact family densely, then improve the best within it.

With the crank angle phi and the rocker angle psi of a pair, both from the ground line, and the ground as the unit of length,
Freudenstein's equation is linear in three ratios of the lengths::

    K1 cos psi - K2 cos phi + K3 = cos(phi - psi),   K1 = 1 / crank,   K2 = 1 / rocker,
    K3 = (crank^2 - coupler^2 + rocker^2 + 1) / (2 crank rocker)

(F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77 (1955) 853-861). So the zeros of both dials are free
numbers of the family, and every pair fixes one ratio; two pairs leave one ratio free as well. Four pairs leave one zero free,
and five leave a few four-bars: random members of the family of three of these pairs are led to them by Newton's method. The
improvement moves the free numbers, and never has to trade exactness for anything else.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats, rows_at, rows_of_all
from synthesis.constraints import Constraints
from synthesis.exact_family import ImprovementOptions, improved
from synthesis.four_bar import close_loop, transmission_angle_over
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits, in_family
from synthesis.mechanism import Placed
from synthesis.pose import whole_turns
from synthesis.ranking import PROPORTION, distinct_rows, merit
from synthesis.work import Work

HARDLY_BACK = 0.01
"""Fraction of the output's range by which a rocker may turn back on the way and is still ranked with those that do not."""
MOST_PAIRS = 5
"""Number of pairs that a four-bar can meet exactly in general."""
_EQUAL = 1e-12
"""Difference of the turns of input and output, in radians, up to which they are equal."""


@dataclass(frozen=True)
class FewPairsOptions(ImprovementOptions):
    """Options of the search for four-bars that meet two to five pairs; steps are in radians and in logarithms of a ratio."""

    samples: int = 16_000
    """Random members of the family."""
    samples_on_curve: int = 640
    """Number of samples for four pairs, whose zeros lie on a curve, and for five."""
    newton_steps: int = 7
    """Number of Newton steps to the equations of four and five pairs."""
    damping: float = 1e-15
    """Damping of these steps, over the trace of their matrix."""
    solved: float = 1e-10
    """Residual of the equations above which a sample is discarded."""
    examined: int = 1000
    regions: int = 20
    region_size: float = 0.12
    rounds: int = 6
    trials: int = 30
    step: float = 0.3
    step_ratio: float = 0.6
    farthest: float = 2.2
    """Largest logarithm of a sampled ratio of crank or rocker to the ground, either sign."""
    tracked_angles: int = 41
    """Number of crank angles at which the rocker is followed."""
    parallelograms: int = 50
    """Number of parallelograms among the samples if the output turns as far as the input."""
    returned: int = 60
    """Maximum number of four-bars that are returned."""


class Parameters(NamedTuple):
    """Free numbers of exact four-bars, shape (n,) each."""

    start: Floats
    """Crank angle at the first pair, from the ground line."""
    offset: Floats
    """Output less rocker angle."""
    ratio: Floats
    """Logarithm of crank or rocker over the ground; used for two pairs only."""


class Candidates(NamedTuple):
    """Exact four-bars within the limits, shape (n,) each unless noted."""

    parameters: Parameters
    lengths: Floats
    """(n, 4): crank, coupler, rocker, ground over the ground."""
    branch: Floats
    forward: NDArray[np.bool_]
    """Return True for rockers that turn in the required direction at all pairs, if the output is monotonic."""
    merit: Floats
    """See `synthesis.ranking.merit`."""
    origin: NDArray[np.intp]
    """Index of each in the parameters that were evaluated."""

    def take(self, indices: Any) -> Candidates:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Candidates) -> Candidates:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)


class ExactFamily:
    """The four-bars that meet two to five pairs exactly within limits.

    Parameters
    ----------
    target : TargetFunction
        Of two to five pairs, with a crank that turns counter-clockwise.
    limits : Limits
        Lengths over the ground.
    sized : bool
        See `function_merit`.
    options : FewPairsOptions
    """

    def __init__(self, target: TargetFunction, limits: Limits, sized: bool, options: FewPairsOptions) -> None:
        self.function, self.limits, self.sized, self.options = target, limits, sized, options
        self.pairs = target.crank.size
        self.random = np.random.default_rng(20)
        self._constraints = Constraints(replace(limits, links=(None,) * 4))
        crank, _, rocker, _ = limits.links
        directions = np.sign(np.diff(target.output))
        self._direction = float(directions[0]) if np.all(directions == directions[0]) else 0.0
        """Direction in which the output goes all the way; 0 if it turns back."""
        self._held = crank if crank is not None else rocker
        self._by_crank = rocker is None
        """True if the free ratio of two pairs is the ratio of the crank, otherwise the ratio of the rocker."""

    # -- sampling and moving ------------------------------------------------------------------------------------------

    def sample(self) -> Parameters:
        """Draw members of the family evenly over its free numbers."""
        options, target = self.options, self.function
        ratio_is_free = self.pairs == 2 and self._held is None
        several = ratio_is_free or target.start is None or target.offset is None
        count = (options.samples if self.pairs < 4 else options.samples_on_curve) if several else 1
        start, offset = (
            self.random.uniform(-np.pi, np.pi, count) if zero is None else np.full(count, zero)
            for zero in (target.start, target.offset)
        )
        ratio = self.random.uniform(-options.farthest, options.farthest, count)
        return Parameters(start, offset, ratio if self._held is None else np.full(count, np.log(self._held)))

    def moved(self, parameters: Parameters, step: float) -> Parameters:
        """Return random neighbours of parameters, by changes of very different sizes."""
        count = parameters.start.size
        size = step * 10.0 ** self.random.uniform(-1.5, 0.0, count)
        start, offset, ratio = size * self.random.standard_normal((3, count))
        return Parameters(
            parameters.start + (start if self.function.start is None else 0.0),
            parameters.offset + (offset if self.function.offset is None else 0.0),
            parameters.ratio + (ratio if self._held is None else 0.0),
        )

    # -- evaluation ---------------------------------------------------------------------------------------------------

    def solved(self, parameters: Parameters) -> tuple[Parameters, Floats]:
        """Return parameters with positive crank and rocker, and the lengths (n, 4), which are NaN if there are none.

        A negative length is a positive length whose link points in the opposite direction, which a dial without a given zero
        allows.
        """
        pairs = np.unique(np.linspace(0, self.pairs - 1, 3).round().astype(int))
        rows, right = self._equations(parameters.start, parameters.offset, pairs)
        columns = list(np.moveaxis(rows, 2, 0))
        ratio = np.exp(-parameters.ratio)
        if self.pairs == 2:
            right = right - columns.pop(0 if self._by_crank else 1) * ratio[:, None]
        # a pair of dials at which the equations are dependent has no neighbour that is exact in rounded numbers
        with np.errstate(all="ignore"):
            found = _solved(columns, right)
            if self.pairs == 2:
                found = np.insert(found, 0 if self._by_crank else 1, ratio, axis=1)
            unknowns = np.column_stack([found, parameters.start, parameters.offset])
            first, second, third, start, offset = (self._corrected(unknowns) if self.pairs > 3 else unknowns).T
            turned = (first < 0) & (self.function.start is None), (second < 0) & (self.function.offset is None)
            start, offset = start + np.where(turned[0], np.pi, 0.0), offset - np.where(turned[1], np.pi, 0.0)
            l1, l3 = (1 / np.where(turns, -value, value) for turns, value in zip(turned, (first, second)))
            l2 = np.sqrt(l1 * l1 + l3 * l3 + 1 - 2 * l1 * l3 * np.where(turned[0] != turned[1], -third, third))
        lengths = np.stack([l1, l2, l3, np.ones_like(l1)], axis=1)
        lengths[~np.all(lengths > 0, axis=1)] = np.nan
        return Parameters(start, offset, parameters.ratio), lengths

    def _equations(self, start: Floats, offset: Floats, pairs: Any = slice(None)) -> tuple[Floats, Floats]:
        """Return Freudenstein's equations of pairs for the three ratios: matrices (n, N, 3) and right sides (n, N)."""
        crank, rocker = start[:, None] + self.function.crank[pairs], self.function.output[pairs] - offset[:, None]
        return np.stack([np.cos(rocker), -np.cos(crank), np.ones_like(crank)], axis=2), np.cos(crank - rocker)

    def _corrected(self, unknowns: Floats) -> Floats:
        """Return ratios and zeros (n, 5) after Newton steps to the equations of four or five pairs; NaN if they fail."""
        target, finite = self.function, np.isfinite(unknowns).all(axis=1)
        free = np.flatnonzero([True, True, True, target.start is None, target.offset is None])
        found, residual = unknowns[finite], np.empty(0)
        for _ in range(self.options.newton_steps):
            first, second, _, start, offset = found.T[:, :, None]
            rows, right = self._equations(start[:, 0], offset[:, 0])
            crank, rocker = start + target.crank, target.output - offset
            turned = np.sin(crank - rocker)
            zeros = np.stack([second * np.sin(crank) + turned, first * np.sin(rocker) + turned], axis=2)
            slope = np.concatenate([rows, zeros], axis=2)[:, :, free]
            residual = (rows @ found[:, :3, None])[:, :, 0] - right
            square = slope @ slope.transpose(0, 2, 1)
            damping = self.options.damping * np.trace(square, axis1=1, axis2=2)
            multipliers = np.linalg.solve(square + damping[:, None, None] * np.eye(self.pairs), residual[:, :, None])
            found[:, free] -= (slope.transpose(0, 2, 1) @ multipliers)[:, :, 0]
        found[:, 3:] -= whole_turns(found[:, 3:])
        found[~(np.abs(residual).max(axis=1, initial=0.0) < self.options.solved)] = np.nan
        out = np.full_like(unknowns, np.nan)
        out[finite] = found
        return out

    def parallelograms(self) -> Candidates:
        """Return the parallelograms that turn the output as far as the input, for which the equations are dependent."""
        options, target, (crank, _, rocker, _) = self.options, self.function, self.limits.links
        gap = target.output - target.crank
        starts = [] if target.start is None else [target.start]
        starts += [] if target.offset is None else [float(target.output[0] - target.offset)]
        same = bool(np.ptp(gap) <= _EQUAL) and (len(starts) < 2 or abs(np.sin((starts[1] - starts[0]) / 2)) <= _EQUAL)
        prescribed = {length for length in (crank, rocker) if length is not None}
        count = options.parallelograms if same and len(prescribed) < 2 else 0
        start = np.full(count, starts[0]) if starts else self.random.uniform(-np.pi, np.pi, count)
        ratio = self.random.uniform(-options.farthest, options.farthest, count)
        length = np.full(count, prescribed.pop()) if prescribed else np.exp(ratio)
        lengths = np.stack([length, np.ones(count), length, np.ones(count)], axis=1)
        return self.rated(Parameters(start, gap[0] - start + target.crank[0], np.log(length)), lengths)

    def evaluate(self, parameters: Parameters) -> Candidates:
        """Return the four-bars of parameters that stay on the same branch over the interval and satisfy the limits."""
        return self.rated(*self.solved(parameters))

    def rated(self, parameters: Parameters, lengths: Floats) -> Candidates:
        """Return the exact four-bars of lengths (n, 4) that stay on the same branch over the interval and satisfy the limits."""
        ratio = lengths.max(axis=1) / lengths.min(axis=1)
        origin = np.flatnonzero((ratio < PROPORTION) & in_family(self.limits.family, lengths))
        branch, forward = self._at_pairs(rows_at(parameters, origin), lengths[origin])
        used = self.function.interval.after(parameters.start[origin])
        transmission = np.nan_to_num(transmission_angle_over(lengths[origin], used))
        inside = (branch != 0) & (transmission > 0) & (transmission >= self.limits.transmission_angle_min)
        if not self.limits.only_family:
            found = self._constraints(
                Placed(lengths[origin], np.where(branch == 0, 1.0, branch), used), derivatives=False
            )
            inside &= (found.values >= 0).all(axis=1)
        keep = np.flatnonzero(inside)
        origin, branch, forward, transmission = origin[keep], branch[keep], forward[keep], transmission[keep]
        merits = function_merit(lengths[origin], transmission, self.sized)
        return Candidates(rows_at(parameters, origin), lengths[origin], branch, forward, merits, origin)

    def _at_pairs(self, parameters: Parameters, lengths: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the branch (n,), 0 if it differs between pairs, and whether the rocker turns the wanted way at all pairs."""
        crank = lengths[:, :1] * np.exp(1j * (parameters.start[:, None] + self.function.crank))
        rocker = lengths[:, 2:3] * np.exp(1j * (self.function.output - parameters.offset[:, None]))
        coupler = 1 + rocker - crank
        side = np.sign(np.imag(np.conj(1 - crank) * coupler))
        same = np.all(side == side[:, :1], axis=1)
        speed = np.sign(np.imag(np.conj(coupler) * crank) * np.imag(np.conj(coupler) * rocker))
        return np.where(same, side[:, 0], 0.0), np.all(speed == self._direction, axis=1) | (self._direction == 0)

    def order(self, candidates: Candidates) -> tuple[Floats | Flags, ...]:
        """Return the merit, and flags of the rockers that turn back."""
        return candidates.merit, ~candidates.forward

    def usable(self, candidates: Candidates) -> Candidates:
        """Return the candidates whose rockers turn as wanted, best first; those that turn back come last, or not at all."""
        turns, forward = self.follows(candidates)
        found = candidates._replace(forward=forward).take(
            np.flatnonzero(turns & (forward | (not self.function.one_way)))
        )
        return found.take(np.lexsort(self.order(found)))

    def follows(self, candidates: Candidates) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return masks of rockers that follow the output without extra turns, and of rockers that reverse at most slightly."""
        share = (1 - np.cos(np.linspace(0.0, np.pi, self.options.tracked_angles))) / 2
        travel = np.concatenate([self.function.crank, share * self.function.crank[-1]])
        closure = close_loop(candidates.lengths, candidates.parameters.start[:, None] + travel)
        at_pairs, between = np.split(closure.rocker_angle(candidates.branch), [self.pairs], axis=1)
        gap = at_pairs - at_pairs[:, :1] - (self.function.output - self.function.output[0])
        turns = np.all(np.abs(gap) < 1.0, axis=1)
        back = np.minimum(np.diff(between, axis=1) * self._direction, 0.0).sum(axis=1)
        allowed = 0.0 if self.function.one_way else HARDLY_BACK * np.ptp(self.function.output)
        return turns, np.nan_to_num(back, nan=-np.inf) >= -allowed


def function_merit(lengths: Floats, transmission: Floats, sized: bool) -> Floats:
    """Rate function generators by their suitability for construction: lower is better; see `synthesis.ranking.merit`.

    ``sized``: True if the ground is given. Then the size is the longest link over the ground; otherwise a linkage can be built
    in any size, and only its proportions count.
    """
    longest = lengths.max(axis=1)
    size = longest / lengths[:, 3] if sized else np.ones_like(longest)
    return merit(size, transmission, np.zeros_like(longest), longest / lengths.min(axis=1))


def _solved(columns: list[Floats], right: Floats) -> Floats:
    """Return the solutions (n, k) of two or three equations by Cramer's rule; not finite if they are dependent.

    ``columns``: k columns (n, k) of the matrices.
    """

    def determinant(parts: list[Floats]) -> Floats:
        if len(parts) == 2:
            return parts[0][:, 0] * parts[1][:, 1] - parts[0][:, 1] * parts[1][:, 0]
        return np.einsum("ni,ni->n", parts[0], np.cross(parts[1], parts[2]))

    denominator = determinant(columns)
    replaced = ([*columns[:k], right, *columns[k + 1 :]] for k in range(len(columns)))
    return np.stack([determinant(parts) / denominator for parts in replaced], axis=1)


def is_few(target: TargetFunction, limits: Limits) -> bool:
    """Check that the lengths of four-bars through two to five pairs follow from the zeros, and possibly a ratio."""
    crank, coupler, rocker, _ = limits.links
    pairs, free = target.crank.size, (crank is None) + (rocker is None) + 1
    if coupler is not None or (target.weights is not None and not np.all(target.weights > 0)):
        return False
    zeros = (target.start is None) + (target.offset is None)
    return pairs <= free or (free == 3 and pairs <= MOST_PAIRS and pairs <= free + zeros)


def exact_functions(target: TargetFunction, limits: Limits, sized: bool, work: Work) -> tuple[Floats, Floats, Floats]:
    """Search for good four-bars that meet two to five pairs exactly.

    Parameters
    ----------
    target : TargetFunction
        See `is_few`; with a crank that turns counter-clockwise.
    limits : Limits
        Lengths over the ground.
    sized : bool
        See `function_merit`.
    work : Work
        The search ends once it has expired.

    Returns
    -------
    lengths, branch, start : ndarray, shape (n, 4), (n,) and (n,)
        First the best of each region by merit, then the others by merit; those whose rocker turns back come last.
    """
    options = FewPairsOptions()
    family = ExactFamily(target, limits, sized, options)
    sampled = family.evaluate(family.sample()).joined(family.parallelograms())
    sampled = family.usable(sampled.take(np.lexsort(family.order(sampled))[: options.examined]))
    seeds = sampled.take(_regions(sampled, options, options.regions))
    free = family.pairs < MOST_PAIRS
    found = family.usable((improved(family, seeds, work) if free else seeds).joined(sampled))
    first = _regions(found, options, options.returned)
    found = found.take([*first, *np.setdiff1d(np.arange(found.merit.size), first)][: options.returned])
    return found.lengths, found.branch, found.parameters.start


def _regions(candidates: Candidates, options: FewPairsOptions, maximum: int) -> NDArray[np.intp]:
    """Return the indices of the first candidates that differ from all before them in some length or the branch."""
    numbers = np.column_stack([candidates.lengths / candidates.lengths.max(axis=1, keepdims=True), candidates.branch])
    return distinct_rows(numbers, options.region_size, maximum)
