"""Windows of short spans as points: an index of the few numbers that the shape of a curve is over a short interval.

A *storey* serves the spans up to one of them. It lays intervals of half width w = (span + step) / 2 about every step of the turn,
so that a window of that span, wherever it begins, lies inside the interval whose middle is nearest to its own. An *entry* is
a type and an interval: the Legendre coefficients a_1 .. a_K of theta2 there, and a *rest* that no value of the curve is further
from them (`legendre`). There are as many entries for one start as for all of them.

Order. All entries, of all types and intervals, lie in one order, by interleaved bits of their coefficients (Morton), so
that neighbours are alike; those of a large rest, which spoil what they lie with, behind those of a small one. Each
`LEAF` of them have a *box*: middle and half width of every coefficient, and the largest rest; each `PARTS` boxes one above. An
entry is kept as one byte a coefficient within the box of its leaf.

Sharp windows. Where a linkage nearly folds, no polynomial of few terms follows its curve, and a rest so large would
exclude nothing. But it is sharp in one place only: such an entry is kept by the coefficients over a *part* of its interval, in
a tree of that part, and is compared with the samples that lie there (see `queries`).

`path_storeys` keeps the shapes that paths are compared with in the same way.

The index is plain arrays by name, so that they can be mapped from a file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.legendre import Expansion
from synthesis.atlas.series import Bucket, Column, Floats, join
from synthesis.target import TURN

Singles = NDArray[np.float32]
Arrays = dict[str, NDArray[Any]]

LEAF = 32
"""Entries of a box of the finest level."""
PARTS = 16
"""Boxes that make one of the next coarser level."""
CODES = 127
"""Steps of a code on either side of the middle of a box."""
NO_ENTRY = np.uint32(0xFFFFFFFF)
"""Fills the last leaf of a tree."""
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
_CLASSES = np.array([1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3])
"""Rests between the classes of the order."""
_SINGLE = np.float32(1 + 2.0**-22)
_USUAL = 0.995
"""Part of the values that the steps of the order are made for."""
_COUNTED = 1 << 16


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
    Storey(np.deg2rad(12.0), 30, 5, 2e-5),
    Storey(np.deg2rad(20.0), 24, 5, 1e-4),
    Storey(np.deg2rad(60.0), 24, 6, 1e-3),
    Storey(np.deg2rad(100.0), 30, 6, 3e-3),
)


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
        As `build_storey` makes them.

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
        self.types = int(arrays["types"][0])
        self.trees = []
        box = leaf = 0
        for part, leaves in zip(INTERVAL_PARTS, np.asarray(arrays["leaves"]).tolist()):
            counts = _counts(leaves)
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


def _counts(leaves: int) -> list[int]:
    """Boxes of each level of a tree, coarse to fine."""
    counts = [leaves] if leaves else []
    while counts and counts[0] > PARTS:
        counts.insert(0, -(-counts[0] // PARTS))
    return counts


def build_storey(storey: Storey, buckets: Sequence[Bucket], go_on: Callable[[], None] = lambda: None) -> Arrays:
    """The arrays of a `StoreyIndex` from the series of all types.

    Parameters
    ----------
    storey : Storey
    buckets : sequence of Bucket
    go_on : callable
        Called between the steps; may raise to end the work.

    Returns
    -------
    dict
        Law: every type is in each interval once.
    """
    types = sum(len(bucket.rows) for bucket in buckets)
    count = types * storey.places
    if count >= NO_ENTRY:
        raise ValueError(f"an index has at most {NO_ENTRY:,} entries, wanted {count:,}")
    values, rests = np.empty((count, storey.terms), np.float32), np.empty(count, np.float32)
    sharp: list[tuple[Bucket, NDArray[np.intp], NDArray[np.intp]]] = []
    centres = storey.centres
    for bucket in buckets:
        expansion = Expansion(bucket.harmonics, centres, storey.half_width, storey.terms)
        at_once = max(1, _AT_ONCE // expansion.width)
        for first in range(0, len(bucket.rows), at_once):
            go_on()
            part = bucket.take(slice(first, first + at_once))
            found, rest = expansion.coefficients(part.periodic, part.winding, part.error)
            at = part.rows[:, None] * storey.places + np.arange(storey.places)
            values[at], rests[at] = found, upwards(rest)
            unresolved, place = np.nonzero(rests[at] > storey.sharp)
            kept, which = np.unique(unresolved, return_inverse=True)
            sharp.append((part.take(kept), which, place))
    trees = [tree_of(np.flatnonzero(rests <= storey.sharp), values, rests, go_on)]
    del values, rests
    trees += _sharp_trees(storey, centres, sharp, go_on)
    return joined_trees(trees, types)


def joined_trees(trees: Sequence[Arrays], types: int) -> Arrays:
    """The arrays of a `StoreyIndex` of some types."""
    leaves = np.array([len(tree["entries"]) for tree in trees])
    joined = {name: np.concatenate([tree[name] for tree in trees]) for name in trees[0]}
    return {**joined, "leaves": leaves, "types": np.array([types])}


def upwards(values: NDArray[np.floating]) -> Singles:
    """As float32, not smaller."""
    return np.nextafter(values.astype(np.float32) * _SINGLE, np.float32(np.inf))


def _sharp_trees(
    storey: Storey,
    centres: Floats,
    sharp: list[tuple[Bucket, NDArray[np.intp], NDArray[np.intp]]],
    go_on: Callable[[], None],
) -> Iterator[Arrays]:
    """The trees of the parts: each sharp entry in that of the first part that resolves it, or else does best."""
    entries, chosen, values, rests = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [], []
    values.append(np.empty((0, storey.terms), np.float32))
    rests.append(np.empty(0, np.float32))
    groups: dict[tuple[int, int, int], list[tuple[Bucket, NDArray[np.intp]]]] = {}
    for bucket, types, places in sharp:
        order = np.argsort(places, kind="stable")
        types, places = types[order], places[order]
        for place, some in zip(*_runs(places, types)):
            key = (bucket.winding, bucket.harmonics, int(place))
            groups.setdefault(key, []).append((bucket, some))
    for (winding, harmonics, place), members in groups.items():
        go_on()
        own = join([bucket.take(types) for bucket, types in members])
        best = np.zeros(len(own.rows), dtype=np.int64)
        least, found = np.full(len(own.rows), np.inf, np.float32), np.empty((len(own.rows), storey.terms), np.float32)
        for index, (low, high) in enumerate(INTERVAL_PARTS[1:]):
            left = np.flatnonzero(least > storey.sharp)
            if not left.size:
                break
            middle = centres[place : place + 1] + storey.half_width * (low + high) / 2
            half = storey.half_width * (high - low) / 2 * (1 + _MARGIN)
            expansion = Expansion(harmonics, middle, half, storey.terms)
            every, rest = expansion.coefficients(own.periodic[left], winding, own.error[left])
            better = upwards(rest[:, 0]) < (least[left] if index < _CENTRAL else storey.sharp)
            at = left[better]
            best[at], least[at], found[at] = index, upwards(rest[better, 0]), every[better, 0]
        entries.append(own.rows * storey.places + place)
        chosen.append(best)
        values.append(found)
        rests.append(least)
    numbers, part = np.concatenate(entries), np.concatenate(chosen)
    coefficients, largest = np.concatenate(values), np.concatenate(rests)
    for index in range(len(INTERVAL_PARTS) - 1):
        yield tree_of(np.flatnonzero(part == index), coefficients, largest, go_on, numbers)


def _runs(keys: NDArray[np.intp], values: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[NDArray[np.intp]]]:
    """Each of some sorted keys once, with its values."""
    found, first = np.unique(keys, return_index=True)
    return found, np.split(values, first[1:]) if found.size else []


def tree_of(
    chosen: NDArray[np.intp],
    values: Singles,
    rests: Singles,
    go_on: Callable[[], None],
    numbers: NDArray[np.int64] | None = None,
    weight: Floats | None = None,
) -> Arrays:
    """Boxes (coarse to fine), codes and entries of some points, in the order of their bits.

    Parameters
    ----------
    chosen : ndarray of int
        Which of the points.
    values, rests : ndarray of float32, shapes (n, K) and (n,)
    go_on : callable
    numbers : ndarray of int, optional
        Entry of each point; default: its place.
    weight : ndarray, shape (K,), optional
        By what a value counts in the order, in steps. Default: by what a coefficient does to the rms of a curve.
    """
    terms = values.shape[1]
    if weight is None:
        weight = 1 / np.sqrt(2 * np.arange(1, terms + 1) + 1) / _CELL
    if not chosen.size:
        return {
            "boxes": np.empty((0, 2 * terms + 1), np.float32),
            "codes": np.empty((0, terms + 1, LEAF), np.int8),
            "entries": np.empty((0, LEAF), np.uint32),
            "reach": np.zeros((1, terms), np.float32),
        }
    order = chosen[np.argsort(_keys(chosen, values, rests, weight.astype(np.float32)), kind="stable")]
    leaves = -(-order.size // LEAF)
    entries = np.full(leaves * LEAF, NO_ENTRY)
    entries[: order.size] = order if numbers is None else numbers[order]
    order = np.concatenate([order, np.repeat(order[-1:], leaves * LEAF - order.size)]).reshape(leaves, LEAF)
    boxes = np.empty((leaves, 2 * terms + 1), np.float32)
    codes = np.empty((leaves, terms + 1, LEAF), np.int8)
    at_once = max(1, _AT_ONCE // (LEAF * terms))
    for first in range(0, leaves, at_once):
        go_on()
        part = slice(first, first + at_once)
        some, rest = values[order[part]], rests[order[part]]
        box = _box(some.min(axis=1), some.max(axis=1), rest.max(axis=1))
        middle, half = box[:, None, :terms], box[:, None, terms:-1]
        codes[part, :terms] = np.rint((some - middle) / half * CODES).swapaxes(1, 2)
        codes[part, terms] = np.ceil(rest / box[:, -1:] * np.float32(255) * _SINGLE).clip(max=255) - 128
        boxes[part] = box
    levels, reach = [boxes], np.abs(values[chosen]).max(axis=0, keepdims=True)
    for count in _counts(leaves)[-2::-1]:
        below = levels[0]
        below = np.concatenate([below, np.repeat(below[-1:], count * PARTS - len(below), axis=0)])
        below = below.reshape(count, PARTS, -1)
        middle, half, rest = below[..., :terms], below[..., terms:-1], below[..., -1]
        levels.insert(0, _box((middle - half).min(axis=1), (middle + half).max(axis=1), rest.max(axis=1)))
    return {
        "boxes": np.concatenate(levels),
        "codes": codes,
        "entries": entries.reshape(leaves, LEAF),
        "reach": upwards(reach),
    }


def _box(low: Singles, high: Singles, rest: Singles) -> Singles:
    """Boxes from their corners: whatever the rounding, what lay between the corners lies in the box."""
    middle = (low + high) / 2
    slack = np.maximum(np.abs(low), np.abs(high)) * np.float32(2.0**-22)
    half = upwards(np.maximum(high - middle, middle - low) + slack)
    return np.concatenate([middle, half, rest[:, None]], axis=1)


def _keys(chosen: NDArray[np.intp], values: Singles, rests: Singles, weight: Singles) -> NDArray[np.uint64]:
    """Places in the order: class of the rest, then the bits of the values in steps, coarse ones first.

    The few largest values share the outermost step: bits for them would be lost to all others.
    """
    keys = np.searchsorted(_CLASSES, rests[chosen]).astype(np.uint64)
    some = chosen[:: max(1, chosen.size // _COUNTED)]
    largest = [float(np.quantile(np.abs(column[some]), _USUAL) * w) for column, w in zip(values.T, weight)]
    bits = [int(np.ceil(np.log2(max(size, 1.0)))) + 1 for size in largest]
    whole = [
        (np.floor(column[chosen] * w) + (1 << (b - 1))).clip(0, (1 << b) - 1).astype(np.uint32)
        for column, w, b in zip(values.T, weight, bits)
    ]
    used = 3
    for level in range(max(bits) - 1, -1, -1):
        for column, b in zip(whole, bits):
            if level < b and used < 64:
                keys <<= np.uint64(1)
                keys |= (column >> np.uint32(level)) & np.uint32(1)
                used += 1
    return keys
