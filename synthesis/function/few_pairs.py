"""Four-bars that meet two to five pairs of a function exactly: sample the exact family densely, then improve the best within it.

With the crank angle phi and the rocker angle psi of a pair, both from the ground line, and the ground as the unit of length,
Freudenstein's equation is linear in three ratios of the lengths::

    K1 cos psi - K2 cos phi + K3 = cos(phi - psi),   K1 = 1 / crank,   K2 = 1 / rocker,
    K3 = (crank^2 - coupler^2 + rocker^2 + 1) / (2 crank rocker)

(F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77 (1955) 853-861). So the zeros of both dials are free
numbers of the family, and every pair fixes one ratio; two pairs leave one ratio free as well. Four pairs leave one zero free, and
five leave a few four-bars (`dial_zeros`). The improvement moves the free numbers, and never has to trade exactness for anything
else.
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
from synthesis.function.dial_zeros import zeros_of_five_pairs, zeros_of_four_pairs
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits, in_family
from synthesis.mechanism import Placed
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
    samples_on_curve: int = 1440
    """Number of samples for four pairs, whose zeros lie on a curve."""
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

    def take(self, indices: Any) -> Parameters:
        """Select parameters."""
        return rows_at(self, indices)


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
        if self.pairs > 3:
            return self._sample_on_curve()
        ratio_is_free = self.pairs == 2 and self._held is None
        count = options.samples if ratio_is_free or target.start is None or target.offset is None else 1
        start, offset = (
            self.random.uniform(-np.pi, np.pi, count) if zero is None else np.full(count, zero)
            for zero in (target.start, target.offset)
        )
        ratio = self.random.uniform(-options.farthest, options.farthest, count)
        return Parameters(start, offset, ratio if self._held is None else np.full(count, np.log(self._held)))

    def _sample_on_curve(self) -> Parameters:
        """Return both roots for zeros all around, or for the given zero; the few four-bars of five pairs."""
        options, target = self.options, self.function
        if self.pairs == 5:
            start, offset = zeros_of_five_pairs(target.crank, target.output)
            return Parameters(start, offset, np.zeros_like(start))
        prescribed = [zero for zero in (target.start, target.offset) if zero is not None]
        zeros = np.array(prescribed or np.arange(options.samples_on_curve) * (np.pi / options.samples_on_curve))
        pairs = np.repeat(zeros, 2), self._other_zeros(zeros).ravel()
        start, offset = pairs if target.offset is None else pairs[::-1]
        return Parameters(start, offset, np.zeros_like(start))

    def _other_zeros(self, zeros: Floats) -> Floats:
        """Return the two offsets for starts (n,), or the two starts for given offsets, of four pairs, (n, 2)."""
        crank, output = self.function.crank, self.function.output
        if self.function.offset is None:
            return zeros_of_four_pairs(zeros[:, None] + crank, output)
        return -zeros_of_four_pairs(output - zeros[:, None], crank)

    def _on_curve(self, parameters: Parameters) -> Parameters:
        """Return parameters of four pairs with the nearest zero for which the equations are dependent."""
        free = "offset" if self.function.offset is None else "start"
        initial = getattr(parameters, free)
        roots = self._other_zeros(parameters.start if free == "offset" else parameters.offset)
        away = roots - initial[:, None]
        away -= np.pi * np.round(away / np.pi)
        nearest = np.argmin(np.abs(np.nan_to_num(away, nan=np.inf)), axis=1)
        return parameters._replace(**{free: initial + away[np.arange(initial.size), nearest]})

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
        if self.pairs == 4:
            parameters = self._on_curve(parameters)
        pairs = np.unique(np.linspace(0, self.pairs - 1, 3).round().astype(int))
        crank = parameters.start[:, None] + self.function.crank[pairs]
        rocker = self.function.output[pairs] - parameters.offset[:, None]
        columns = [np.cos(rocker), -np.cos(crank), np.ones_like(crank)]
        right = np.cos(crank - rocker)
        ratio = np.exp(-parameters.ratio)
        if self.pairs == 2:
            right = right - columns.pop(0 if self._by_crank else 1) * ratio[:, None]
        matrix = np.stack(columns, axis=2)
        # a pair of dials at which the equations are dependent has no neighbour that is exact in rounded numbers
        with np.errstate(all="ignore"):
            found = _solved(matrix, right)
            if self.pairs == 2:
                found = np.insert(found, 0 if self._by_crank else 1, ratio, axis=1)
            first, second, third = found.T
            start = parameters.start + np.where((first < 0) & (self.function.start is None), np.pi, 0.0)
            offset = parameters.offset - np.where((second < 0) & (self.function.offset is None), np.pi, 0.0)
            third = third * np.where(self.function.start is None, np.sign(first), 1.0)
            third = third * np.where(self.function.offset is None, np.sign(second), 1.0)
            first = np.abs(first) if self.function.start is None else first
            second = np.abs(second) if self.function.offset is None else second
            l1, l3 = 1 / first, 1 / second
            l2 = np.sqrt(l1 * l1 + l3 * l3 + 1 - 2 * l1 * l3 * third)
        lengths = np.stack([l1, l2, l3, np.ones_like(l1)], axis=1)
        lengths[~np.all(lengths > 0, axis=1)] = np.nan
        return Parameters(start, offset, parameters.ratio), lengths

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
        branch, forward = self._at_pairs(parameters.take(origin), lengths[origin])
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
        return Candidates(parameters.take(origin), lengths[origin], branch, forward, merits, origin)

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


def _solved(matrix: Floats, right: Floats) -> Floats:
    """Return the solutions of two or three equations (n, k, k) by Cramer's rule; not finite if they are dependent."""
    columns = list(np.moveaxis(matrix, 2, 0))

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


def exact_functions(
    target: TargetFunction, limits: Limits, sized: bool, work: Work, options: FewPairsOptions | None = None
) -> tuple[Floats, Floats, Floats]:
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
    options : FewPairsOptions, optional

    Returns
    -------
    lengths, branch, start : ndarray, shape (n, 4), (n,) and (n,)
        First the best of each region by merit, then the others by merit; those whose rocker turns back come last.
    """
    options = options or FewPairsOptions()
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
