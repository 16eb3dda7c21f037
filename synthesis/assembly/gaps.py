"""Whether shapes on moving bodies keep clear of one another over an interval: proved, not sampled; and how near they come.

The gap of two shapes at crank angle t, c the clearance that is wanted::

    f(t) = dist(core_i(t), core_j(t)) - r_i - r_j - c            collision: f < 0

In a cell |t - tm| <= h the shapes move by at most D_i and D_j from their places at tm: it is free where f(tm) > D_i + D_j,
collides where f(tm) < -(D_i + D_j), and is halved otherwise. All pairs are proved together, in arrays of cells.

A shape is everything within a radius of a point, a line or a polygon.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats, Ints
from synthesis.assembly.movement import Bodies, Movement
from synthesis.target import Interval
from synthesis.work import Work

FLAT = 1e-9
"""A polygon less high than this part of its longest side is a line."""
ROOM = 1e-3
"""Of half a polygon's extent: how near a place with room is to the nearest, and how much room is overlooked."""
_SQUARES = 1000
"""At most so many are looked at for such a place: within ordinary outlines some hundred."""
OVERLAP = 1e-6
"""Of the size: how deep sharp outlines count as lying in one another; `distances` is 0 there, whatever the depth."""


@dataclass(frozen=True)
class Shape:
    """All points within `radius` of a core, in the frame of the body that carries it.

    ``core``: one point; the two ends of a line; or the corners of a simple polygon, counter-clockwise, convex or not.
    """

    core: tuple[complex, ...]
    radius: float

    @cached_property
    def reach(self) -> float:
        """Largest distance of a corner of the core from the origin of its frame."""
        return max(map(abs, self.core))

    @property
    def corners(self) -> tuple[complex, ...]:
        """The core with a point as a line of no length, so that there are lines and polygons only."""
        return self.core * 2 if len(self.core) == 1 else self.core


def disc(centre: complex, radius: float) -> Shape:
    """A pin, a post or a head."""
    return Shape((complex(centre),), float(radius))


def hull(points: Sequence[complex]) -> tuple[complex, ...]:
    """Corners of the convex hull, counter-clockwise; two where all points lie on a line, one where they are one.

    Law: no point lies outside of it by more than `FLAT` of the largest distance.
    """
    rest = sorted({complex(z) for z in points}, key=lambda z: (z.real, z.imag))
    if len(rest) < 3:
        return tuple(rest)
    halves = []
    for way in (rest, rest[::-1]):
        half: list[complex] = []
        for z in way:
            while len(half) > 1 and _cross(half[-1] - half[-2], z - half[-1]) <= 0:
                half.pop()
            half.append(z)
        halves.append(half[:-1])
    corners = halves[0] + halves[1]
    first, last = max(((a, b) for a in corners for b in corners), key=lambda pair: abs(pair[0] - pair[1]))
    longest = abs(last - first)
    if all(abs(_cross(last - first, z - first)) <= FLAT * longest**2 for z in corners):
        return (first, last)
    return tuple(corners)


def _cross(one: complex, other: complex) -> float:
    return one.real * other.imag - one.imag * other.real


def signed_area(corners: Sequence[complex]) -> float:
    """Area of a polygon, above 0 where its corners run counter-clockwise."""
    return sum(_cross(a, b) for a, b in zip(corners, [*corners[1:], corners[0]])) / 2


def crosses_itself(corners: Sequence[complex]) -> bool:
    """Whether two sides of a polygon that are no neighbours meet, or a corner has no angle."""
    z = np.asarray(corners, dtype=complex)
    side = np.roll(z, -1) - z
    count = z.size
    first, second = np.triu_indices(count, 2)
    apart = ~((first == 0) & (second == count - 1))
    first, second = first[apart], second[apart]
    ends = (
        np.stack([z[first], z[first] + side[first]], axis=-1),
        np.stack([z[second], z[second] + side[second]], axis=-1),
    )
    meets = bool(np.any(distances(*ends) <= 0)) if first.size else False
    back = np.conj(side) * np.roll(side, -1)
    return meets or bool(np.any((back.imag == 0) & (back.real < 0))) or bool(np.any(side == 0))


def contains(corners: Sequence[complex], point: complex) -> bool:
    """Whether a polygon has a point inside."""
    return bool(_inside(np.asarray(corners, dtype=complex)[None], np.array([point]))[0])


def nearest_on(corners: Sequence[complex], point: complex) -> complex:
    """The point of a polygon's outline that is nearest to a point."""
    best = min(
        (_foot(a, b, point) for a, b in zip(corners, [*corners[1:], corners[0]])), key=lambda foot: abs(foot - point)
    )
    return complex(best)


def nearest_room(
    corners: Sequence[complex], kept: Sequence[Sequence[complex]], rim: float, apart: float, point: complex
) -> complex | None:
    """The place nearest to a point, to `ROOM`, that lies `rim` within a polygon and `apart` from lines that are kept; or None.

    Squares are looked at from the point on, at most `_SQUARES`: room changes by no more than the way, so that one without any is
    left out as a whole.
    """
    sides = np.asarray(corners, dtype=complex)[None]

    def room(at: complex) -> float:
        depth = float(_to_sides(np.array([[at]]), sides)[0]) * (1 if contains(corners, at) else -1)
        return min([depth - rim, *(abs(nearest_on(line, at) - at) - apart for line in kept)])

    if room(point) >= 0:
        return point
    low, high = (complex(of(sides.real), of(sides.imag)) for of in (np.min, np.max))
    half = max((high - low).real, (high - low).imag) / 2
    least, best, far = ROOM * half, None, np.inf
    squares, number = [(0.0, 0, (low + high) / 2, half)], 0
    for _ in range(_SQUARES):
        if not squares or squares[0][0] >= far - least:
            break
        _, _, at, half = heappop(squares)
        here, reach = room(at), np.sqrt(2) * half
        way = abs(point - at)
        if here >= 0 and way - here < far:
            # all within its room has some
            best, far = at + (point - at) / way * here, way - here
        if -reach <= here < reach and half > least:
            for step in (-1 - 1j, 1 - 1j, -1 + 1j, 1 + 1j):
                number += 1
                within = at + step * half / 2
                off = point - within
                outside = complex(max(abs(off.real) - half / 2, 0.0), max(abs(off.imag) - half / 2, 0.0))
                heappush(squares, (abs(outside), number, within, half / 2))
    return best


def _foot(first: complex, last: complex, point: complex) -> complex:
    along = last - first
    square = abs(along) ** 2
    share = 0.0 if square == 0 else float(np.clip((np.conj(along) * (point - first)).real / square, 0, 1))
    return first + share * along


# -- distances ----------------------------------------------------------------------------------------------------------


def distances(one: Complexes, other: Complexes) -> Floats:
    """How far cores are apart, row by row: 0 where their lines cross or one lies in the other.

    ``one`` (m, j), ``other`` (m, k): corners; two are a line (also of no length), more a simple polygon.

    Shape (m,). Law: symmetric, and the same for both moved alike.
    """
    best = np.minimum(_to_sides(one, other), _to_sides(other, one))
    meet = _cross_somewhere(one, other)
    for polygon, rest in ((one, other), (other, one)):
        if polygon.shape[-1] > 2:
            # where no sides cross, all of the rest is inside or all of it outside
            meet |= _inside(polygon, rest[:, 0])
    return np.where(meet, 0.0, best)


def _sides(corners: Complexes) -> tuple[Complexes, Complexes]:
    """Beginnings of the sides and the ways to their ends, (m, sides)."""
    if corners.shape[-1] == 2:
        return corners[:, :1], corners[:, 1:] - corners[:, :1]
    return corners, np.roll(corners, -1, axis=-1) - corners


def _to_sides(points: Complexes, corners: Complexes) -> Floats:
    """Least distance of points (m, p) from the sides of polygons or lines (m, k), shape (m,)."""
    begin, way = _sides(corners)
    square = way.real**2 + way.imag**2
    inverse = (1 / np.where(square > 0, square, np.inf))[:, None]
    off = points[:, :, None] - begin[:, None]
    along = way[:, None]
    share = np.clip((off.real * along.real + off.imag * along.imag) * inverse, 0.0, 1.0)
    rest = off - share * along
    return np.sqrt((rest.real**2 + rest.imag**2).reshape(len(points), -1).min(axis=-1))


def _cross_somewhere(one: Complexes, other: Complexes) -> Flags:
    """Whether a side of each crosses a side of the other, shape (m,)."""
    (p, v), (q, w) = _sides(one), _sides(other)
    p, v, q, w = p[:, :, None], v[:, :, None], q[:, None], w[:, None]
    off = p - q
    turned = w.real * v.imag - w.imag * v.real
    before = w.real * off.imag - w.imag * off.real
    beside = v.imag * off.real - v.real * off.imag
    crossing = (before * (before + turned) < 0) & (beside * (beside - turned) < 0)
    return np.asarray(crossing.reshape(len(one), -1).any(axis=-1))


def _inside(polygon: Complexes, point: Complexes) -> Flags:
    """Whether polygons (m, k) have points (m,) inside, by the sides that a ray along x meets."""
    begin, way = _sides(polygon)
    height = point[:, None] - begin
    last = begin + way
    spans = (begin.imag > point.imag[:, None]) != (last.imag > point.imag[:, None])
    rise = np.where(spans, way.imag, 1.0)
    beyond = height.real < way.real * (height.imag / rise)
    return np.asarray((spans & beyond).sum(axis=-1) % 2 == 1)


# -- over an interval -----------------------------------------------------------------------------------------------------


CELLS = 48
"""Cells at the beginning, of each pair."""
FINE = 1e-9
"""Of the size: below this bound a cell is decided by the sign at its middle, or it touches."""
ROUGH = 1e-5
"""The same of a rough proof, whose ends of collisions are no finer."""
SEEN = 1e-2
"""The same of a rough proof where shapes collide in the middle of a cell."""
ROUNDING = 1e-12
"""Of the size: gaps less than this either way are as good as none."""
MOST_CELLS = 6000
"""Undecided cells of a pair at once: with more it touches where it does not collide."""
NEAR = 1e-3
"""Of the size: cells in which a gap may be less than the least known by this are halved."""
AT_ONCE = 400_000
"""Pairs of corners that are compared at once: a bound of the memory."""
LOOKS, PLACES = 8, 65
"""Of the last refinement of a least gap: how often, and places at each."""
_FEW = 8
"""Pairs of corners that are compared as fast as the discs around them."""
_ROOTS, _ROUGH_ROOTS = 60, 12
"""Steps to an end of a collision at most."""
_FREE, _HITS, _TOUCHES = 0, 1, 2


class Run(NamedTuple):
    """Crank angles over which two shapes collide, or touch, in radians from the first sample."""

    first: float
    last: float


@dataclass(frozen=True)
class Proof:
    """What is proved of a pair over an interval: where it collides, and where it may touch; elsewhere it is free."""

    hits: tuple[Run, ...]
    touches: tuple[Run, ...]

    @property
    def free(self) -> bool:
        """Whether it collides nowhere, and touches nowhere."""
        return not (self.hits or self.touches)


class Least(NamedTuple):
    """The least gap of a pair, clearance taken off, and the crank angle at which it is."""

    gap: float
    at: float


class Carried(NamedTuple):
    """A shape and the body that carries it."""

    body: int
    shape: Shape


class _Cells(NamedTuple):
    """Cells of pairs (m,): the pair's number, the middle, half the width, the gap there and its bound."""

    pair: Ints
    middle: Floats
    half: Floats
    gap: Floats
    bound: Floats

    def some(self, which: Flags | Ints) -> _Cells:
        """Some of them."""
        return _Cells(self.pair[which], self.middle[which], self.half[which], self.gap[which], self.bound[which])

    def halved(self) -> tuple[Ints, Floats, Floats]:
        """Pair, middle and half width of their halves."""
        half = np.repeat(self.half / 2, 2)
        middle = np.repeat(self.middle, 2)
        middle[::2] -= half[::2]
        middle[1::2] += half[1::2]
        return np.repeat(self.pair, 2), middle, half

    @classmethod
    def joined(cls, parts: Sequence[_Cells]) -> _Cells:
        """All of several."""
        return cls(*(np.concatenate(columns) for columns in zip(*parts)))


class Gaps:
    """The gaps of pairs of shapes that a movement carries.

    ``pairs`` (n, 2): numbers of shapes. ``size``: a length of the mechanism, against which lengths are small. Pairs on one body
    are evaluated once. ``rough``: ends of collisions to `ROUGH` only, and where shapes of many corners are far
    apart the gap of the discs around them does; then there are no least gaps.

    Law: no gap at any crank angle of the interval is below 0 where a proof says free.
    """

    def __init__(
        self,
        movement: Movement,
        shapes: Sequence[Carried],
        pairs: Sequence[tuple[int, int]],
        clearance: float,
        size: float,
        rough: bool = False,
    ) -> None:
        self.movement, self.size, self._rough = movement, size, rough
        # of two shapes that with more corners first: fewer kinds of pairs
        counts = [len(one.shape.corners) for one in shapes]
        ordered = [pair if counts[pair[0]] >= counts[pair[1]] else pair[::-1] for pair in pairs]
        self._pairs = np.array(ordered, dtype=int).reshape(-1, 2)
        self._body = np.array([one.body for one in shapes])
        self._reach = np.array([one.shape.reach for one in shapes])
        self._corners = np.zeros((len(shapes), max(counts)), dtype=complex)
        for row, one in zip(self._corners, shapes):
            row[: len(one.shape.corners)] = one.shape.corners
        self._middle = np.array([np.mean(one.shape.corners) for one in shapes])
        self._around = np.array(
            [np.abs(np.array(one.shape.corners) - np.mean(one.shape.corners)).max() for one in shapes]
        )
        radius = np.array([one.shape.radius for one in shapes])
        self._apart = radius[self._pairs].sum(axis=-1) + clearance
        kinds = [(counts[i], counts[j]) for i, j in self._pairs.tolist()]
        self._kinds = sorted(set(kinds))
        self._kind = np.array([self._kinds.index(kind) for kind in kinds], dtype=int)
        self._still = self._body[self._pairs[:, 0]] == self._body[self._pairs[:, 1]]
        self._work = Work()

    def at(self, pair: Ints, travel: Floats, half: Floats | float = 0.0) -> tuple[Floats, Floats]:
        """Gaps of pairs (m,) at crank angles (m,), and the bounds of their change over cells of half widths (m,)."""
        times, place = np.unique(travel, return_inverse=True)
        if np.ndim(half):
            # cells of one middle have one width in the course of a proof; elsewhere the widest counts
            widths: Floats = np.zeros(times.size)
            np.maximum.at(widths, place, half)
            half = widths
        bodies = self.movement.bodies(times, half)
        gap: Floats = np.empty(travel.size)
        bound: Floats = np.empty(travel.size)
        kind = self._kind[pair]
        for number, counts in enumerate(self._kinds):
            every = np.flatnonzero(kind == number) if len(self._kinds) > 1 else np.arange(travel.size)
            step = max(1, AT_ONCE // (counts[0] * counts[1]))
            for first in range(0, every.size, step):
                self._work.go_on()
                rows = every[first : first + step]
                gap[rows], bound[rows] = self._of(pair[rows], place[rows], counts, bodies)
        return gap, bound

    def _of(self, pair: Ints, time: Ints, counts: tuple[int, int], bodies: Bodies) -> tuple[Floats, Floats]:
        """Gaps and bounds of pairs (m,) of shapes with as many corners, at places of the motion by number."""
        ends, spread, middles = [], [], []
        for side, count in enumerate(counts):
            shape = self._pairs[pair, side]
            body = self._body[shape]
            corners = self._corners[shape, :count]
            ends.append(bodies.origin[body, time][:, None] + bodies.direction[body, time][:, None] * corners)
            middles.append(bodies.origin[body, time] + bodies.direction[body, time] * self._middle[shape])
            turn = np.minimum(2.0, bodies.turn[body, time])
            spread.append(bodies.shift[body, time] + self._reach[shape] * turn)
        apart, bound = self._apart[pair], np.where(self._still[pair], 0.0, spread[0] + spread[1])
        gap: Floats = np.empty(pair.size)
        near = np.ones(pair.size, dtype=bool)
        if self._rough and counts[0] * counts[1] > _FEW:
            between = np.abs(np.subtract(*middles)) - self._around[self._pairs[pair]].sum(axis=-1) - apart
            near = between <= bound
            gap = np.where(near, gap, between)
        distance = distances(ends[0][near], ends[1][near]) if near.any() else np.zeros(0)
        gap[near] = np.where(distance > 0, distance - apart[near], -np.maximum(apart[near], OVERLAP * self.size))
        return gap, bound

    def prove(self, interval: Interval, work: Work) -> list[Proof]:
        """Where each pair collides within an interval of crank angles, its ends to rounding. Raises `OutOfTime`."""
        self._work = work
        first, last = min(interval), max(interval)
        self._extent = max(abs(first), abs(last), last - first)
        edges = np.linspace(first, last, CELLS + 1)
        moving = np.flatnonzero(~self._still)
        pair = np.repeat(moving, CELLS)
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
            open_, kind = self._decided(cells)
            decided.append(cells.some(~open_))
            kinds.append(kind[~open_])
            pair, middle, half = cells.some(open_).halved()
        self._cells, self._decisions = _Cells.joined(decided), np.concatenate(kinds)
        return self._proofs(first, last)

    def _decided(self, cells: _Cells) -> tuple[Flags, Ints]:
        """Which cells are to be halved, and what the others do."""
        gap, bound = cells.gap, cells.bound
        free, hits = gap > bound, gap < -bound
        if self._rough:  # sharp outlines in one another have no depth that would decide: the place in the middle does
            hits |= (gap < 0) & (bound < SEEN * self.size)
        open_ = ~(free | hits)
        small = (bound < (ROUGH if self._rough else FINE) * self.size) | (cells.half < 4e-16 * self._extent)
        many = np.bincount(cells.pair[open_], minlength=len(self._pairs)) > MOST_CELLS
        small |= many[cells.pair]
        touches = np.abs(gap) <= ROUNDING * self.size
        kind = np.where(free, _FREE, np.where(hits, _HITS, np.where((gap < 0) & ~touches, _HITS, _TOUCHES)))
        return open_ & ~small, kind

    def _proofs(self, first: float, last: float) -> list[Proof]:
        """Runs of cells that lie beside one another, with their ends."""
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
        roots = self._roots(np.concatenate([run_pair[left], run_pair[right]]), inner, outer)
        begin, end = middle[starts] - half[starts], middle[ends] + half[ends]
        begin[left], end[right] = roots[: left.size], roots[left.size :]
        begin = np.where(middle[starts] - 1.5 * half[starts] < first, first, begin)
        end = np.where(middle[ends] + 1.5 * half[ends] > last, last, end)
        found: list[tuple[list[Run], list[Run]]] = [([], []) for _ in self._pairs]
        for k, (own, what) in enumerate(zip(run_pair.tolist(), run_kind.tolist())):
            if what == _FREE:
                continue
            beside = [n for n in (k - 1, k + 1) if 0 <= n < starts.size and run_pair[n] == own]
            if what == _TOUCHES and any(run_kind[n] == _HITS for n in beside):
                continue  # the end of a collision
            found[own][what - 1].append(Run(float(begin[k]), float(end[k])))
        return [Proof(tuple(hits), tuple(touches)) for hits, touches in found]

    def _roots(self, pair: Ints, inner: Floats, outer: Floats) -> Floats:
        """Where gaps of pairs (m,) change sign between places with f < 0 and places with f >= 0."""
        if not pair.size:
            return inner
        values = self.at(np.tile(pair, 2), np.concatenate([inner, outer]))[0]
        low, high = values[: pair.size], values[pair.size :]
        inner, outer = inner.copy(), outer.copy()
        weights = np.ones((2, pair.size))
        for step in range(_ROUGH_ROOTS if self._rough else _ROOTS):
            wide = np.abs(outer - inner)
            if np.all(wide <= 4e-16 * self._extent):
                break
            # regula falsi, the end that stays halved (Illinois); each third step halves the bracket
            share = np.where(
                step % 3 == 2,
                0.5,
                np.abs(low) * weights[0] / np.maximum(np.abs(low) * weights[0] + high * weights[1], 1e-300),
            )
            middle = inner + (outer - inner) * np.clip(share, 1e-3, 1 - 1e-3)
            gap = self.at(pair, middle)[0]
            hits = gap < 0
            weights = np.where(hits, [np.ones(pair.size), weights[1] / 2], [weights[0] / 2, np.ones(pair.size)])
            inner, low = np.where(hits, middle, inner), np.where(hits, gap, low)
            outer, high = np.where(hits, outer, middle), np.where(hits, high, gap)
            if np.all(np.minimum(np.abs(low), np.abs(high)) <= 2e-15 * self.size) and np.all(
                wide < 1e-12 * self._extent
            ):
                break
        return np.where(np.abs(low) <= np.abs(high), inner, outer)

    def least(self, pairs: Sequence[int], interval: Interval) -> dict[int, Least]:
        """The least gap of pairs that are free over the interval that was proved last.

        The value is good to rounding; the place, where the gap has no corner there, to its square root.
        """
        if not pairs:
            return {}
        wanted = np.zeros(len(self._pairs), dtype=bool)
        wanted[list(pairs)] = True
        cells = self._cells.some(wanted[self._cells.pair])
        ends = np.tile([min(interval), max(interval)], len(pairs))
        own = np.repeat(np.array(pairs), 2)
        best = np.full(len(self._pairs), np.inf)
        at_ends = self.at(own, ends)[0]
        np.minimum.at(best, own, at_ends)
        found: dict[int, Least] = {}
        for pair, gap, where in zip(own.tolist(), at_ends.tolist(), ends.tolist()):
            if pair not in found or gap < found[pair].gap:
                found[pair] = Least(gap, where)
        np.minimum.at(best, cells.pair, cells.gap)
        kept: list[_Cells] = []
        while cells.pair.size:
            low = cells.gap - cells.bound
            cells = cells.some(low < best[cells.pair])
            rough = (cells.gap - cells.bound < best[cells.pair] - NEAR * self.size) & (
                cells.half > 1e-12 * self._extent
            )
            rough &= (np.bincount(cells.pair[rough], minlength=best.size) < MOST_CELLS)[cells.pair]
            kept.append(cells.some(~rough))
            halves = cells.some(rough).halved()
            if not halves[0].size:
                break
            numbers, middle, half = halves
            cells = _Cells(numbers, middle, half, *self.at(numbers, middle, half))
            np.minimum.at(best, cells.pair, cells.gap)
        rest = _Cells.joined(kept)
        rest = rest.some(rest.gap - rest.bound < best[rest.pair])
        return self._lowest(rest, found) if rest.pair.size else found

    def _lowest(self, cells: _Cells, found: dict[int, Least]) -> dict[int, Least]:
        """The least gaps in runs of cells, by looking closer and closer; ``found``: those at the ends."""
        order = np.lexsort([cells.middle, cells.pair])
        cells = cells.some(order)
        gapped = cells.middle[1:] - cells.half[1:] > (cells.middle[:-1] + cells.half[:-1]) + 1e-3 * cells.half[1:]
        starts = np.flatnonzero(np.r_[True, (np.diff(cells.pair) != 0) | gapped])
        ends = np.r_[starts[1:], cells.pair.size] - 1
        pair = cells.pair[starts]
        low, high = cells.middle[starts] - cells.half[starts], cells.middle[ends] + cells.half[ends]
        begin, end = low, high
        best, at = np.full(pair.size, np.inf), low.copy()
        for _ in range(LOOKS):
            places = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, PLACES)
            gap = self.at(np.repeat(pair, PLACES), places.ravel())[0].reshape(places.shape)
            lowest = np.argmin(gap, axis=-1)
            value = np.take_along_axis(gap, lowest[:, None], axis=-1)[:, 0]
            where = np.take_along_axis(places, lowest[:, None], axis=-1)[:, 0]
            better = value < best
            best, at = np.where(better, value, best), np.where(better, where, at)
            step = (high - low) / (PLACES - 1)
            low, high = np.maximum(begin, at - step), np.minimum(end, at + step)
        for own, value, where in zip(pair.tolist(), best.tolist(), at.tolist()):
            if value < found[own].gap:
                found[own] = Least(value, where)
        return found
