"""Prove that shapes on moving bodies stay clear of each other over an interval, and find their smallest gaps.

The gap of two shapes at crank angle t with the required clearance c is::

    f(t) = dist(core_i(t), core_j(t)) - r_i - r_j - c            collision: f < 0

In a cell |t - tm| <= h the shapes move by at most D_i and D_j from their positions at tm. The cell is free if f(tm) > D_i + D_j,
collides if f(tm) < -(D_i + D_j), and is halved otherwise. All pairs are proved together, in arrays of cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Flags, Floats, Ints, rows_at, rows_of_all
from synthesis.assembly.movement import Bodies, Movement
from synthesis.assembly.shapes import Shape, distances
from synthesis.one_variable import bisect
from synthesis.target import Interval
from synthesis.work import Work

OVERLAP = 1e-6
"""Depth, as a fraction of the size, that is assumed for sharp outlines that overlap, for which `distances` returns 0."""


@dataclass(frozen=True)
class GapOptions:
    """Options of the proof that shapes do not collide; lengths are fractions of the machine's size."""

    cells: int = 48
    """Number of initial cells of each pair."""
    resolution: float = 1e-9
    """Bound below which the sign of the gap at its middle decides a cell, or the pair touches there."""
    collision: float = 0.0
    """Bound below which a cell in whose middle the shapes collide is decided, as overlapping sharp outlines have no depth."""
    rounding: float = 1e-12
    """Absolute gap that counts as zero."""
    max_cells: int = 6000
    """Number of undecided cells of a pair above which it touches wherever it does not collide."""
    gap_resolution: float = 1e-3
    """Cells whose gap may be smaller than the smallest known gap by more than this are halved."""
    batch: int = 400_000
    """Number of pairs of corners that are compared at the same time, which limits the memory."""
    refinements: int = 8
    """Number of final refinements of a smallest gap."""
    nodes: int = 65
    """Number of nodes of each refinement."""
    root_steps: int = 24
    """Number of bisections for an end of a collision, which lies between two of the smallest cells."""


OPTIONS = GapOptions()
_FREE, _HITS, _TOUCHES = 0, 1, 2


class Run(NamedTuple):
    """Range of crank angles over which two shapes collide or touch, in radians from the first sample."""

    first: float
    last: float


@dataclass(frozen=True)
class Proof:
    """Ranges of an interval in which a pair collides, or may touch; it is free elsewhere."""

    hits: tuple[Run, ...]
    touches: tuple[Run, ...]

    @property
    def free(self) -> bool:
        """True if the pair neither collides nor touches."""
        return not (self.hits or self.touches)


class MinimumGap(NamedTuple):
    """Smallest gap of a pair less the clearance, and the crank angle at which it occurs."""

    gap: float
    at: float


class CarriedShape(NamedTuple):
    """A shape and the body that carries it."""

    body: int
    shape: Shape


class _Cells(NamedTuple):
    """Cells of pairs, (m,): index of the pair, middle, half the width, gap at the middle and bound of its change."""

    pair: Ints
    middle: Floats
    half: Floats
    gap: Floats
    bound: Floats

    def halved(self) -> tuple[Ints, Floats, Floats]:
        """Return pair, middle and half width of the two halves of each cell."""
        half = np.repeat(self.half / 2, 2)
        middle = np.repeat(self.middle, 2)
        middle[::2] -= half[::2]
        middle[1::2] += half[1::2]
        return np.repeat(self.pair, 2), middle, half


class Gaps:
    """Gaps of pairs of shapes that a movement carries.

    If a proof states that a pair is free, its gap is not negative at any crank angle of the interval. Pairs on the same body are
    evaluated once.

    Parameters
    ----------
    movement : Movement
    pairs : sequence of pairs of CarriedShape
    clearance : float
    size : float
        Length that characterizes the mechanism, to which tolerances are relative.
    options : GapOptions, optional
    """

    def __init__(
        self,
        movement: Movement,
        pairs: Sequence[tuple[CarriedShape, CarriedShape]],
        clearance: float,
        size: float,
        options: GapOptions = OPTIONS,
    ) -> None:
        self.movement, self.size, self._options = movement, size, options
        # of two shapes that with more corners first: fewer kinds of pairs
        ordered = [sorted(pair, key=lambda carried: -len(carried.shape.corners)) for pair in pairs]
        numbers = {
            carried: k for k, carried in enumerate(dict.fromkeys(carried for pair in ordered for carried in pair))
        }
        shapes = list(numbers)
        counts = [len(carried.shape.corners) for carried in shapes]
        self._pairs = np.array([[numbers[carried] for carried in pair] for pair in ordered], dtype=int).reshape(-1, 2)
        self._body = np.array([carried.body for carried in shapes])
        self._reach = np.array([carried.shape.reach for carried in shapes])
        self._corners = np.zeros((len(shapes), max(counts, default=0)), dtype=complex)
        for row, carried in zip(self._corners, shapes):
            row[: len(carried.shape.corners)] = carried.shape.corners
        radius = np.array([carried.shape.radius for carried in shapes])
        self._apart = radius[self._pairs].sum(axis=-1) + clearance
        kinds = [(counts[i], counts[j]) for i, j in self._pairs.tolist()]
        self._kinds = sorted(set(kinds))
        self._kind = np.array([self._kinds.index(kind) for kind in kinds], dtype=int)
        self._still = self._body[self._pairs[:, 0]] == self._body[self._pairs[:, 1]]
        self._work = Work()

    def at(self, pair: Ints, travel: Floats, half: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Return gaps and the bounds of their change, (m,), of pairs at crank angles, over cells of half widths."""
        times, index = np.unique(travel, return_inverse=True)
        if np.ndim(half):
            # in a proof, cells with the same middle have the same width; otherwise the widest counts
            widths: Floats = np.zeros(times.size)
            np.maximum.at(widths, index, half)
            half = widths
        bodies = self.movement.bodies(times, half)
        gap: Floats = np.empty(travel.size)
        bound: Floats = np.empty(travel.size)
        kind = self._kind[pair]
        for number, counts in enumerate(self._kinds):
            members = np.flatnonzero(kind == number) if len(self._kinds) > 1 else np.arange(travel.size)
            step = max(1, self._options.batch // (counts[0] * counts[1]))
            for first in range(0, members.size, step):
                self._work.go_on()
                rows = members[first : first + step]
                gap[rows], bound[rows] = self._evaluate(pair[rows], index[rows], counts, bodies)
        return gap, bound

    def _evaluate(self, pair: Ints, time: Ints, counts: tuple[int, int], bodies: Bodies) -> tuple[Floats, Floats]:
        """Return gaps and bounds of pairs (m,) of shapes with these numbers of corners, at positions of the motion by index."""
        ends, spread = [], []
        for side, count in enumerate(counts):
            shape = self._pairs[pair, side]
            body = self._body[shape]
            corners = self._corners[shape, :count]
            ends.append(bodies.origin[body, time][:, None] + bodies.direction[body, time][:, None] * corners)
            turn = np.minimum(2.0, bodies.turn[body, time])
            spread.append(bodies.shift[body, time] + self._reach[shape] * turn)
        apart, bound = self._apart[pair], np.where(self._still[pair], 0.0, spread[0] + spread[1])
        distance = distances(*ends)
        return np.where(distance > 0, distance - apart, -np.maximum(apart, OVERLAP * self.size)), bound

    def prove(self, interval: Interval, work: Work) -> list[Proof]:
        """Return the ranges of an interval of crank angles in which each pair collides, with ends that are exact up to rounding.

        Raise `OutOfTime` if the time of ``work`` is up.
        """
        self._work = work
        first, last = min(interval), max(interval)
        self._extent = max(abs(first), abs(last), last - first)
        edges = np.linspace(first, last, self._options.cells + 1)
        moving = np.flatnonzero(~self._still)
        pair = np.repeat(moving, self._options.cells)
        middle = np.tile((edges[1:] + edges[:-1]) / 2, moving.size)
        half = np.tile(np.diff(edges) / 2, moving.size)
        still = np.flatnonzero(self._still)
        if still.size:
            pair = np.concatenate([pair, still])
            middle = np.concatenate([middle, np.full(still.size, (first + last) / 2)])
            half = np.concatenate([half, np.full(still.size, (last - first) / 2)])
        decided: list[_Cells] = []
        kinds: list[Ints] = []
        while pair.size:
            cells = _Cells(pair, middle, half, *self.at(pair, middle, half))
            open_, kind = self._decide(cells)
            decided.append(rows_at(cells, ~open_))
            kinds.append(kind[~open_])
            pair, middle, half = rows_at(cells, open_).halved()
        self._cells, self._decisions = rows_of_all(*decided), np.concatenate(kinds)
        return self._proofs(first, last)

    def _decide(self, cells: _Cells) -> tuple[Flags, Ints]:
        """Return the cells that must be halved, and the result of all others."""
        gap, bound = cells.gap, cells.bound
        free, hits = gap > bound, gap < -bound
        hits |= (gap < 0) & (bound < self._options.collision * self.size)
        open_ = ~(free | hits)
        small = (bound < self._options.resolution * self.size) | (cells.half < 4e-16 * self._extent)
        many = np.bincount(cells.pair[open_], minlength=len(self._pairs)) > self._options.max_cells
        small |= many[cells.pair]
        touches = np.abs(gap) <= self._options.rounding * self.size
        kind = np.where(free, _FREE, np.where(hits, _HITS, np.where((gap < 0) & ~touches, _HITS, _TOUCHES)))
        return open_ & ~small, kind

    def _proofs(self, first: float, last: float) -> list[Proof]:
        """Return the ranges of neighbouring cells, with their ends."""
        cells = self._cells
        order = np.lexsort([cells.middle, cells.pair])
        pair, middle, half = cells.pair[order], cells.middle[order], cells.half[order]
        kind = self._decisions[order]
        starts = np.flatnonzero(np.r_[True, (np.diff(pair) != 0) | (np.diff(kind) != 0)])
        ends = np.r_[starts[1:], pair.size] - 1
        run_pair, run_kind = pair[starts], kind[starts]
        # an end of a collision lies between its last cell's middle and the next one's
        left = np.flatnonzero((run_kind == _HITS) & (starts > 0) & (np.r_[-1, run_pair[:-1]] == run_pair))
        right = np.flatnonzero((run_kind == _HITS) & (np.r_[run_pair[1:], -1] == run_pair))
        inner = np.concatenate([middle[starts[left]], middle[ends[right]]])
        outer = np.concatenate([middle[starts[left] - 1], middle[ends[right] + 1]])
        ends_of = np.concatenate([run_pair[left], run_pair[right]])
        steps = self._options.root_steps
        roots = bisect(lambda at: self.at(ends_of, np.asarray(at, dtype=float))[0] < 0, inner, outer, steps)[0]
        start, end = middle[starts] - half[starts], middle[ends] + half[ends]
        start[left], end[right] = roots[: left.size], roots[left.size :]
        start = np.where(middle[starts] - 1.5 * half[starts] < first, first, start)
        end = np.where(middle[ends] + 1.5 * half[ends] > last, last, end)
        found: list[tuple[list[Run], list[Run]]] = [([], []) for _ in self._pairs]
        for k, (number, label) in enumerate(zip(run_pair.tolist(), run_kind.tolist())):
            if label == _FREE:
                continue
            neighbours = [n for n in (k - 1, k + 1) if 0 <= n < starts.size and run_pair[n] == number]
            if label == _TOUCHES and any(run_kind[n] == _HITS for n in neighbours):
                continue  # the end of a collision
            found[number][label - 1].append(Run(float(start[k]), float(end[k])))
        return [Proof(tuple(hits), tuple(touches)) for hits, touches in found]

    def minimum_gaps(self, pairs: Sequence[int]) -> dict[int, MinimumGap]:
        """Return the smallest gaps of pairs that are free over the interval of the last proof.

        The gap is exact up to rounding; its crank angle is exact up to the square root of that, except at a corner of the gap.
        """
        mask = np.zeros(len(self._pairs), dtype=bool)
        mask[list(pairs)] = True
        cells = rows_at(self._cells, mask[self._cells.pair])
        best = np.full(len(self._pairs), np.inf)
        finished = [rows_at(cells, np.zeros(0, dtype=int))]
        while cells.pair.size:
            np.minimum.at(best, cells.pair, cells.gap)
            cells = rows_at(cells, cells.gap - cells.bound <= best[cells.pair])
            coarse = (cells.gap - cells.bound < best[cells.pair] - self._options.gap_resolution * self.size) & (
                cells.half > 1e-12 * self._extent
            )
            coarse &= (np.bincount(cells.pair[coarse], minlength=best.size) < self._options.max_cells)[cells.pair]
            finished.append(rows_at(cells, ~coarse))
            pair, middle, half = rows_at(cells, coarse).halved()
            if not pair.size:
                break
            cells = _Cells(pair, middle, half, *self.at(pair, middle, half))
        remaining = rows_of_all(*finished)
        return self._lowest(rows_at(remaining, remaining.gap - remaining.bound <= best[remaining.pair]))

    def _lowest(self, cells: _Cells) -> dict[int, MinimumGap]:
        """Refine the smallest gaps in ranges of neighbouring cells, and return the smallest of each pair."""
        cells = rows_at(cells, np.lexsort([cells.middle, cells.pair]))
        gapped = cells.middle[1:] - cells.half[1:] > (cells.middle[:-1] + cells.half[:-1]) + 1e-3 * cells.half[1:]
        starts = np.flatnonzero(np.r_[True, (np.diff(cells.pair) != 0) | gapped][: cells.pair.size])
        ends = np.r_[starts[1:], cells.pair.size][: starts.size] - 1
        pair = cells.pair[starts]
        start, end = cells.middle[starts] - cells.half[starts], cells.middle[ends] + cells.half[ends]
        low, high = start, end
        best, at = np.full(pair.size, np.inf), low.copy()
        for _ in range(self._options.refinements if pair.size else 0):
            nodes = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, self._options.nodes)
            gap = self.at(np.repeat(pair, self._options.nodes), nodes.ravel())[0].reshape(nodes.shape)
            lowest = np.argmin(gap, axis=-1)[:, None]
            value, position = (np.take_along_axis(of, lowest, axis=-1)[:, 0] for of in (gap, nodes))
            at, best = np.where(value < best, position, at), np.minimum(value, best)
            step = (high - low) / (self._options.nodes - 1)
            low, high = np.maximum(start, at - step), np.minimum(end, at + step)
        found: dict[int, MinimumGap] = {}
        for number, value, position in zip(pair.tolist(), best.tolist(), at.tolist()):
            if number not in found or value < found[number].gap:
                found[number] = MinimumGap(value, position)
        return found
