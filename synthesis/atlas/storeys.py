"""Windows of short spans as points: an index of the few numbers that the shape of a curve is over a short interval.

A *storey* serves the spans up to one of them. It lays intervals of half width w = (span + step) / 2 about every step of the turn,
so that a window of that span, wherever it begins, lies inside the interval whose middle is nearest to its own. An *entry* is
a type and an interval: the Legendre coefficients a_1 .. a_K of theta2 there, and a *rest* that no value of the curve is further
from them (`legendre`). There are as many entries for one start as for all of them. They are the points of `trees`, of all types
and intervals in one order.

Sharp windows. Where a linkage nearly folds, no polynomial of few terms follows its curve, and a rest so large would
exclude nothing. But it is sharp in one place only: such an entry is kept by the coefficients over a *part* of its interval, in
a tree of that part, and is compared with the samples that lie there (see `queries`).

`path_storeys` keeps the shapes that paths are compared with in the same way.

The index is plain arrays by name, so that they can be mapped from a file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.legendre import Expansion
from synthesis.atlas.series import Bucket, Column, Floats, Ints, New, in_memory
from synthesis.atlas.trees import Arrays, Points, Singles, level_counts, make_trees, upwards
from synthesis.target import TURN

INTERVAL_PARTS = (
    (-1.0, 1.0),
    (-1.0, 0.3),
    (-0.3, 1.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (-1 / 3, 1 / 3),
    (-1 / 3, 0.0),
    (0.0, 1 / 3),
    (-1.0, -1 / 3),
    (1 / 3, 1.0),
    (-2 / 3, -1 / 3),
    (1 / 3, 2 / 3),
    (-1.0, -2 / 3),
    (2 / 3, 1.0),
)
"""The whole interval, and the parts of one where a curve is sharp, in the order in which they are preferred: near the middle lie
samples of every window."""
_CENTRAL = 6
"""Parts that come first: near the middle, for what no part resolves. Few windows have a sample in the others."""
_AT_ONCE = 1 << 22
_MARGIN = 1e-9
_CELL = 2.0**-14
"""Side of the finest cells of the order, radians."""


class Storey(NamedTuple):
    """Which windows a storey is for.

    Attributes
    ----------
    top : float
        Largest span, radians.
    places : int
        Intervals of the turn.
    terms : int
        Legendre coefficients that are kept.
    sharp : float
        Rest beyond which an entry is kept by a part of its interval.
    """

    top: float
    places: int
    terms: int
    sharp: float

    @property
    def half_width(self) -> float:
        """Half width of an interval."""
        return (self.top + TURN / self.places) / 2 * (1 + _MARGIN)

    def serves(self, span: float, starts: int) -> bool:
        """Whether the windows of so long a span lie in the intervals, each interval having the same ``starts``."""
        return span <= self.top * (1 + _MARGIN / 4) and starts % self.places == 0

    @property
    def centres(self) -> Floats:
        """Middles of the intervals, radians."""
        return np.arange(self.places, dtype=np.float64) * (TURN / self.places)


STOREYS = (
    Storey(np.deg2rad(20.0), 60, 5, 5e-5),
    Storey(np.deg2rad(60.0), 36, 6, 1e-3),
    Storey(np.deg2rad(100.0), 40, 6, 3e-3),
)
"""So many intervals that the shortest windows of a storey still reach across the middle of theirs: in wide intervals some of them
have no sample in the part by which a sharp entry is kept, and all such entries are left."""


class Tree(NamedTuple):
    """Where the boxes and entries of one part of the intervals lie in the arrays of a storey.

    Attributes
    ----------
    part : tuple of float
        In the interval's coordinate, -1 to 1.
    levels : list of (int, int)
        First box and number of boxes of each level, coarse to fine.
    first : int
        Leaf number in ``entries`` and ``codes`` of its first leaf.
    """

    part: tuple[float, float]
    levels: list[tuple[int, int]]
    first: int


class StoreyIndex:
    """The entries of a storey.

    Parameters
    ----------
    storey : Storey
    arrays : dict
        As `make_trees` makes them.

    Attributes
    ----------
    boxes : ndarray of float32, shape (boxes, 2 K + 1)
        Middles, half widths, rest.
    codes : ndarray of int8, shape (leaves, K + 1, LEAF)
        Of the coefficients, -CODES to CODES over the box of the leaf; of the rest, -128 to 127 for its share of the box's.
    entries : ndarray of uint32, shape (leaves, LEAF)
        type * places + interval.
    reach : ndarray, shape (parts, K)
        Largest size of each coefficient.
    """

    def __init__(self, storey: Storey, arrays: Mapping[str, Column]) -> None:
        self.storey = storey
        self.arrays = arrays
        self.boxes: Column = arrays["boxes"]
        self.codes: Column = arrays["codes"]
        self.entries: Column = arrays["entries"]
        self.reach: Singles = np.array(arrays["reach"])  # a copy: what is mapped is not to be kept
        self.types = int(arrays["count"][0]) // storey.places
        self.trees = []
        box = leaf = 0
        for part, leaves in zip(INTERVAL_PARTS, np.asarray(arrays["leaves"]).tolist()):
            counts = level_counts(leaves)
            first = box + np.cumsum([0, *counts])
            self.trees.append(Tree(part, [(int(f), c) for f, c in zip(first, counts)], leaf))
            box, leaf = int(first[-1]), leaf + leaves

    @property
    def size(self) -> int:
        """Numbers that an entry is kept by, K of the boxes."""
        return int(self.boxes.shape[1]) // 2

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(int(array.nbytes) for array in self.arrays.values())


def build_storey(
    storey: Storey,
    buckets: Sequence[Bucket],
    new: New = in_memory,
    folder: Path | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> Arrays:
    """The arrays of a `StoreyIndex` from the series of all types; parameters of `make_trees`.

    Returns
    -------
    dict
        Law: every type is in each interval once.
    """
    order = np.arange(1, storey.terms + 1)
    weight = 1 / np.sqrt(2 * order + 1) / _CELL  # by what a coefficient does to the rms of a curve

    def source(every: int) -> Iterator[Points]:
        for bucket in buckets:
            yield from _entries(storey, bucket, every, go_on)

    count = storey.places * sum(len(bucket.rows) for bucket in buckets)
    return make_trees(source, len(INTERVAL_PARTS), count, weight, new, folder, go_on)


def _entries(storey: Storey, bucket: Bucket, every: int, go_on: Callable[[], None]) -> Iterator[Points]:
    """The entries of every so-many-th type of a bucket: each in the tree of what it is kept by."""
    whole = Expansion(bucket.harmonics, storey.centres, storey.half_width, storey.terms)
    parts = _PartsOfIntervals(storey, bucket)
    step = every * max(1, _AT_ONCE // whole.width)
    for first in range(0, len(bucket.rows), step):
        go_on()
        some = bucket.take(slice(first, first + step, every))
        values, rest = whole.coefficients(some.periodic, some.winding, some.error)
        numbers = numbers_of(storey, some.rows)
        rests = upwards(rest)
        resolved = rests <= storey.sharp
        yield Points(0, numbers[resolved], values[resolved].astype(np.float32), rests[resolved])
        for place in np.flatnonzero(~resolved.all(axis=0)).tolist():
            sharp = np.flatnonzero(~resolved[:, place])
            yield from parts.points(some.take(sharp), place, numbers[sharp, place])


def numbers_of(storey: Storey, rows: Ints) -> NDArray[np.uint32]:
    """Of the entries of some types, (n, places)."""
    numbers: NDArray[np.uint32] = (rows[:, None] * storey.places + np.arange(storey.places)).astype(np.uint32)
    return numbers


class _PartsOfIntervals:
    """Curves of a bucket over the parts of intervals of a storey."""

    def __init__(self, storey: Storey, bucket: Bucket) -> None:
        self._storey, self._harmonics, self._winding = storey, bucket.harmonics, bucket.winding
        self._expansion = cache(self._made)

    def _made(self, place: int, part: int) -> Expansion:
        half, (low, high) = self._storey.half_width, INTERVAL_PARTS[part]
        middle = self._storey.centres[place] + half * (low + high) / 2
        return Expansion(
            self._harmonics, np.array([middle]), half * (high - low) / 2 * (1 + _MARGIN), self._storey.terms
        )

    def points(self, curves: Bucket, place: int, numbers: NDArray[np.uint32]) -> Iterator[Points]:
        """Curves that are sharp in an interval: each in the tree of the first part that resolves it, or else does best."""
        best = np.zeros(len(numbers), dtype=np.int64)
        least = np.full(len(numbers), np.inf, np.float32)
        found = np.empty((len(numbers), self._storey.terms), np.float32)
        for part in range(1, len(INTERVAL_PARTS)):
            left = np.flatnonzero(least > self._storey.sharp)
            if not left.size:
                break
            expansion = self._expansion(place, part)
            values, rest = expansion.coefficients(curves.periodic[left], self._winding, curves.error[left])
            rests = upwards(rest[:, 0])
            better = rests < (least[left] if part <= _CENTRAL else self._storey.sharp)
            at = left[better]
            best[at], least[at], found[at] = part, rests[better], values[better, 0]
        for part in np.unique(best):
            kept = best == part
            yield Points(int(part), numbers[kept], found[kept], least[kept])
