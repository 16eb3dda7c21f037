"""Points in an order in which neighbours are alike, and boxes of them above boxes: the trees of an index of windows.

A *point* is K numbers, a *rest* by which they may be off, and what it is the point of. The order is by interleaved bits of the
numbers (Morton), coarse ones first, so that neighbours are alike; points of a large rest, which spoil what they lie with,
stand behind those of a small one. Each `LEAF` of them have a *box*: middle and half width of every number, and the largest rest;
each `PARTS` boxes one above. A point is kept as one byte a number within the box of its leaf.

Making. A few of the points tell which of their bits tell most, and where the order is to be cut into parts that are put in order
one by one. Then all points are written to the files of their parts, and part after part is read, put in order and boxed. So in
memory is one part, not all points, and the trees are the same whatever a part holds.
"""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.series import Floats, New

Singles = NDArray[np.float32]
Arrays = dict[str, NDArray[Any]]

LEAF = 32
"""Points of a box of the finest level."""
PARTS = 16
"""Boxes that make one of the next coarser level."""
CODES = 127
"""Steps of a code on either side of the middle of a box."""
NO_ENTRY = np.uint32(0xFFFFFFFF)
"""Fills the last leaf of a tree."""
FEW = 1 << 18
"""Points that are looked at beforehand, about."""
PART_BYTES = 1 << 26
"""Of the points that are put in order at a time, unless there would be more than `_MOST_PARTS` of such parts."""
_MOST_PARTS = 256
_AT_ONCE = 1 << 22
_CLASSES = np.array([1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3])
"""Rests between the classes of the order."""
_BITS = 64
_CLASS_BITS = 3
_MOST_BITS = 20
"""Of a number: beyond them its values share the outermost step."""
_SINGLE = np.float32(1 + 2.0**-22)
_USUAL = 0.995
"""Part of the values that the steps of the order are made for: bits for the few largest would be lost to all others."""


class Points(NamedTuple):
    """Some points of a tree.

    Attributes
    ----------
    tree : int
    numbers : ndarray of uint32, shape (n,)
        What they are the points of.
    values : ndarray of float32, shape (n, K)
    rests : ndarray of float32, shape (n,)
    """

    tree: int
    numbers: NDArray[np.uint32]
    values: Singles
    rests: Singles


Source = Callable[[int], Iterator[Points]]
"""``source(every)``: the points of every so-many-th thing that has any, in the same order each time."""


def upwards(values: NDArray[np.floating]) -> Singles:
    """As float32, not smaller."""
    return np.nextafter(values.astype(np.float32) * _SINGLE, np.float32(np.inf))


def level_counts(leaves: int) -> list[int]:
    """Boxes of each level of a tree, coarse to fine."""
    counts = [leaves] if leaves else []
    while counts and counts[0] > PARTS:
        counts.insert(0, -(-counts[0] // PARTS))
    return counts


def make_trees(
    source: Source,
    trees: int,
    count: int,
    weight: Floats,
    new: New,
    folder: Path | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> Arrays:
    """The trees of some points, one after the other.

    Parameters
    ----------
    source : callable
    trees, count : int
        How many trees, and how many points in all of them.
    weight : ndarray, shape (K,)
        Steps of the finest cells of the order in one of each number.
    new : callable
        Where the arrays lie.
    folder : Path, optional
        For temporary files; default: all points are held in memory.
    go_on : callable
        Called between the steps; may raise to end the work.

    Returns
    -------
    dict
        Coarse boxes before fine ones: ``boxes`` float32 (boxes, 2 K + 1), middles, half widths, rest. ``codes`` int8
        (leaves, K + 1, LEAF): of the numbers, -CODES to CODES over the box of the leaf; of the rest, -128 to 127 for its share
        of the box's. ``entries`` uint32 (leaves, LEAF): what each is the point of. ``reach`` float32 (trees, K): largest size
        of each number. ``leaves`` int (trees,), ``count`` int (1,).
        Law: each point is in its tree once, within the boxes above it.

    Raises
    ------
    OSError
        There is not twice the place on the disk that the points and their trees take.
    """
    if count >= NO_ENTRY:
        raise OSError(errno.EFBIG, f"an index has at most {NO_ENTRY:,} entries, wanted {count:,}")
    size = weight.size
    if folder is not None:
        needed = count * (_record(size).itemsize + size + 6 + 12 * (size + 1) // LEAF)
        if shutil.disk_usage(folder).free < 2 * needed:
            raise OSError(
                errno.ENOSPC, f"an index takes {needed:,} bytes while it is made, and as many are to be left"
            )
    with ExitStack() as files:
        made = _collected(source, trees, count, weight, lambda: files.enter_context(_spool(folder)), go_on)
        return _arrays(made, new, go_on)


def _spool(folder: Path | None) -> IO[bytes]:
    """A file to be written and read again."""
    return BytesIO() if folder is None else TemporaryFile(dir=folder)


def _collected(
    source: Source, trees: int, count: int, weight: Floats, spool: Callable[[], IO[bytes]], go_on: Callable[[], None]
) -> list[_Tree]:
    """All points, in the files of the parts of their trees."""
    every = max(1, count // FEW)
    few = list(source(every))
    part_bytes = max(PART_BYTES, count * _record(weight.size).itemsize // _MOST_PARTS)
    made = [
        _Tree([one for one in few if one.tree == number], every, weight, part_bytes, spool) for number in range(trees)
    ]
    for points in few if every == 1 else source(1):
        go_on()
        made[points.tree].add(points)
    return made


def _arrays(made: list[_Tree], new: New, go_on: Callable[[], None]) -> Arrays:
    """What `make_trees` returns."""
    size = made[0].reach.size
    leaves = [-(-tree.count // LEAF) for tree in made]
    boxes = [sum(level_counts(own)) for own in leaves]
    arrays = {
        "boxes": new("boxes", np.float32, (sum(boxes), 2 * size + 1)),
        "codes": new("codes", np.int8, (sum(leaves), size + 1, LEAF)),
        "entries": new("entries", np.uint32, (sum(leaves), LEAF)),
    }
    begins = zip(np.cumsum([0, *boxes]), np.cumsum([0, *leaves]))
    for tree, own, (box, leaf) in zip(made, leaves, begins):
        _fill(tree, own, arrays["boxes"][box:], arrays["codes"][leaf:], arrays["entries"][leaf:], go_on)
    reach = upwards(np.stack([tree.reach for tree in made]))
    told = {"reach": reach, "leaves": np.array(leaves), "count": np.array([sum(tree.count for tree in made)])}
    for name, values in told.items():
        arrays[name] = new(name, values.dtype, values.shape)
        arrays[name][...] = values
    return arrays


def _record(size: int) -> np.dtype[Any]:
    """A point and its place in the order."""
    return np.dtype([("key", "u8"), ("number", "u4"), ("rest", "f4"), ("values", "f4", (size,))])


class _Order:
    """The places of points in an order that a few of them suggest.

    Parameters
    ----------
    few : ndarray of float32, shape (n, K)
    weight : ndarray, shape (K,)
    """

    def __init__(self, few: Singles, weight: Floats) -> None:
        self._weight = weight.astype(np.float32)
        usual = np.quantile(np.abs(few), _USUAL, axis=0) if len(few) else np.ones(weight.size)
        bits = np.ceil(np.log2(np.maximum(usual * weight, 1))).astype(int) + 1
        self._bits = np.minimum(bits, _MOST_BITS).tolist()
        told = [
            (level, column) for level in range(max(self._bits)) for column, b in enumerate(self._bits) if level < b
        ]
        told = sorted(told, key=lambda one: (-one[0], one[1]))[: _BITS - _CLASS_BITS]
        self._used = len(told)
        # where the bits of each value of a column come to lie
        self._spread = [np.zeros(1 << b, dtype=np.uint64) for b in self._bits]
        for place, (level, column) in enumerate(told):
            spread = self._spread[column]
            bit = (np.arange(spread.size, dtype=np.uint64) >> np.uint64(level)) & np.uint64(1)
            spread |= bit << np.uint64(self._used - 1 - place)

    def keys(self, values: Singles, rests: Singles) -> NDArray[np.uint64]:
        """Class of the rest, then the bits of the values in steps."""
        keys = np.searchsorted(_CLASSES, rests).astype(np.uint64) << np.uint64(self._used)
        for column, weight, bits, spread in zip(values.T, self._weight, self._bits, self._spread):
            step = np.floor(column * weight) + (1 << (bits - 1))
            keys |= spread[step.clip(0, (1 << bits) - 1).astype(np.intp)]
        return keys


class _Tree:
    """The points of a tree while they are collected: in files, one for each part of their order.

    Parameters
    ----------
    few : list of Points
        Every so-many-th of those to come, about.
    every : int
    weight : ndarray, shape (K,)
    part_bytes : int
        Of the points of a part, about.
    spool : callable
        A file for a part, which is closed once it has been read.
    """

    def __init__(
        self, few: list[Points], every: int, weight: Floats, part_bytes: int, spool: Callable[[], IO[bytes]]
    ) -> None:
        nothing = Points(0, np.empty(0, np.uint32), np.empty((0, weight.size), np.float32), np.empty(0, np.float32))
        values = np.concatenate([nothing.values, *(one.values for one in few)])
        rests = np.concatenate([nothing.rests, *(one.rests for one in few)])
        self._order, self._record = _Order(values, weight), _record(weight.size)
        keys = np.sort(self._order.keys(values, rests))
        parts = -(-keys.size * every * self._record.itemsize // part_bytes) or 1
        self._cuts = keys[np.arange(1, parts) * keys.size // parts]
        self._files = [spool() for _ in range(parts)]
        self.count, self.reach = 0, np.zeros(weight.size, np.float32)

    def add(self, points: Points) -> None:
        """Some of its points."""
        records = np.empty(len(points.numbers), self._record)
        records["key"] = self._order.keys(points.values, points.rests)
        records["number"], records["rest"], records["values"] = points.numbers, points.rests, points.values
        self.count += records.size
        if records.size:
            np.maximum(self.reach, np.abs(points.values).max(axis=0), out=self.reach)
        if not self._cuts.size:
            self._files[0].write(records.data)
            return
        part = np.searchsorted(self._cuts, records["key"], side="right")
        records = records[np.argsort(part, kind="stable")]
        ends = np.cumsum(np.bincount(part, minlength=len(self._files)))
        for file, begin, end in zip(self._files, [0, *ends], ends):
            file.write(records[begin:end].data)

    def in_order(self) -> Iterator[NDArray[Any]]:
        """Its points, part after part; they are forgotten on the way."""
        while self._files:
            with self._files.pop(0) as file:
                file.seek(0)
                records = np.frombuffer(file.read(), self._record)
            yield records[np.argsort(records["key"], kind="stable")]


def _fill(
    tree: _Tree,
    leaves: int,
    boxes: Singles,
    codes: NDArray[np.int8],
    entries: NDArray[np.uint32],
    go_on: Callable[[], None],
) -> None:
    """Boxes, codes and entries of a tree, from the beginning of these arrays on."""
    counts = level_counts(leaves)
    firsts = np.cumsum([0, *counts])
    levels = [boxes[first : first + count] for first, count in zip(firsts, counts)]
    size, done, taken = tree.reach.size, 0, 0
    left = np.empty(0, _record(size))
    at_once = max(1, _AT_ONCE // (LEAF * size))
    for records in tree.in_order():
        taken += records.size
        left = np.concatenate([left, records])
        if taken == tree.count:
            filling = np.repeat(left[-1:], -left.size % LEAF)
            filling["number"] = NO_ENTRY
            left = np.concatenate([left, filling])
        whole = left.size // LEAF
        points, left = left[: whole * LEAF].reshape(whole, LEAF), left[whole * LEAF :]
        for first in range(0, whole, at_once):
            go_on()
            some = points[first : first + at_once]
            at = slice(done + first, done + first + len(some))
            levels[-1][at], codes[at] = _leaves(some["values"], some["rest"])
            entries[at] = some["number"]
        done += whole
    for below, above in zip(levels[:0:-1], levels[-2::-1]):
        _boxes_of_boxes(below, above)


def _boxes_of_boxes(below: Singles, above: Singles) -> None:
    """Fill a level from the next finer one."""
    size = below.shape[1] // 2
    at_once = max(1, _AT_ONCE // (PARTS * size))
    for first in range(0, len(above), at_once):
        last = min(first + at_once, len(above))
        members = np.minimum(np.arange(first * PARTS, last * PARTS), len(below) - 1).reshape(-1, PARTS)
        some = below[members]
        middle, half = some[..., :size], some[..., size:-1]
        above[first:last] = _box((middle - half).min(axis=1), (middle + half).max(axis=1), some[..., -1].max(axis=1))


def _leaves(values: Singles, rests: Singles) -> tuple[Singles, NDArray[np.int8]]:
    """Boxes and codes of leaves, (n, LEAF, K) and (n, LEAF)."""
    size = values.shape[2]
    box = _box(values.min(axis=1), values.max(axis=1), rests.max(axis=1))
    codes = np.empty((len(values), size + 1, LEAF), np.int8)
    codes[:, :size] = np.rint((values - box[:, None, :size]) / box[:, None, size:-1] * CODES).swapaxes(1, 2)
    codes[:, size] = np.ceil(rests / box[:, -1:] * np.float32(255) * _SINGLE).clip(max=255) - 128
    return box, codes


def _box(low: Singles, high: Singles, rest: Singles) -> Singles:
    """Boxes from their corners: whatever the rounding, what lay between the corners lies in the box."""
    middle = (low + high) / 2
    slack = np.maximum(np.abs(low), np.abs(high)) * np.float32(2.0**-22)
    half = upwards(np.maximum(high - middle, middle - low) + slack)
    return np.concatenate([middle, half, rest[:, None]], axis=1)
