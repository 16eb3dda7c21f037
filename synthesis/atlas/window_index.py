"""An index of windows of short spans: types by interval of the turn, as points whose coordinates are Legendre coefficients.

`Intervals` of half width w = (span + step) / 2 lie about every step of the turn, so that a window of that span, wherever it
begins, lies inside the interval whose middle is nearest to its own. An *entry* is a type and an interval: the Legendre
coefficients a_1 .. a_K of theta2 there, and a *remainder* that no value of the curve is further from them. There are as many
entries for one start as for all of them.

Coefficients. With p(x) = Re sum_h c_h e^{ihx} and x = c + w v, -1 <= v <= 1, the plane wave's expansion (DLMF 10.60.7)

    e^{ihwv} = sum_k (2k + 1) i^k j_k(hw) P_k(v)        (j_k: spherical Bessel functions)

gives the coefficients a_k = Re sum_h c_h e^{ihc} (2k + 1) i^k j_k(hw). As |P_k| <= 1, what the terms above K leave of the
curve is nowhere more than

    sum_{K < k <= M} |a_k|  +  sum_h |c_h| sum_{k > M} (2k + 1) |j_k(hw)|

for any M. j_k(z) falls faster than any power once k is beyond z, so an M a little above the largest hw suffices.

Sharp windows. Where a linkage nearly folds, no polynomial of few terms follows its curve, and a remainder so large would
exclude nothing. But it is sharp in one place only: such an entry is kept by the coefficients over a *part* of its interval,
and is compared with the samples that lie there (see `window_search`).

Boxes. The entries of each part are the leaves of an R-tree that is packed in Morton order, by the interleaved bits of the
coefficients, coarse ones first, so that neighbours are alike; entries of a large remainder, which spoil what they lie with, stand
behind those of a small one. Each `LEAF` of them have a *box*: middle and half width of every coefficient, and the largest
remainder; each `CHILDREN` boxes one above. An entry is kept as one byte a coefficient within the box of its leaf.

Making. A sample of the entries tells which bits tell most, and where the order is to be cut into runs. Then all entries are
written to a file for each run, and run after run is read, sorted and boxed. So in memory is one run, and the index is the same
however long a run is.
"""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cache, lru_cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Singles
from synthesis.atlas.series import New, SeriesGroup
from synthesis.target import TURN

PARTS = (
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
LEAF = 32
"""Entries of a box of the finest level."""
CHILDREN = 16
"""Boxes that make one of the next coarser level."""
CODES = 127
"""Steps of a code on either side of the middle of a box."""
NO_ENTRY = np.uint32(0xFFFFFFFF)
"""Fills the last leaf of a tree."""
SAMPLED = 1 << 18
"""Entries that are looked at beforehand, about."""
RUN_BYTES = 1 << 26
"""Of the entries that are sorted at a time, unless there would be more than `_MOST_RUNS` runs."""
_MOST_RUNS = 256
_AT_ONCE = 1 << 22
_MARGIN = 1e-9
_CELL = 2.0**-14
"""Side of the finest cells of the order, radians."""
_CLASSES = np.array([1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3])
"""Remainders between the classes of the order."""
_BITS = 64
_CLASS_BITS = 3
_MOST_BITS = 20
"""Of a coefficient: beyond them its values share the outermost step."""
_USUAL = 0.995
"""Part of the values that the steps of the order are made for: bits for the few largest would be lost to all others."""
_ABOVE = np.float32(1 + 2.0**-22)
_BEYOND = 24
"""Terms behind M that are added up; the next would be below the rounding of a double."""


class Intervals(NamedTuple):
    """Intervals of the turn for windows of some spans.

    ``largest_span``: radians. ``number``: intervals of the turn. ``terms``: Legendre coefficients that are kept.
    ``sharp``: remainder beyond which an entry is kept by a part of its interval.
    """

    largest_span: float
    number: int
    terms: int
    sharp: float

    @property
    def half_width(self) -> float:
        """Half width of an interval."""
        return (self.largest_span + TURN / self.number) / 2 * (1 + _MARGIN)

    def serves(self, span: float, starts: int) -> bool:
        """Whether the windows of so long a span lie in the intervals, each interval having the same ``starts``."""
        return span <= self.largest_span * (1 + _MARGIN / 4) and starts % self.number == 0

    @property
    def centres(self) -> Floats:
        """Middles of the intervals, radians."""
        return np.arange(self.number, dtype=np.float64) * (TURN / self.number)


INTERVALS = (
    Intervals(np.deg2rad(20.0), 60, 5, 5e-5),
    Intervals(np.deg2rad(60.0), 36, 6, 1e-3),
    Intervals(np.deg2rad(100.0), 40, 6, 3e-3),
)
"""So many intervals that the shortest windows that they serve still reach across the middle of theirs: in wide intervals some of
them have no sample in the part by which a sharp entry is kept, and all such entries are left."""


# -- Legendre coefficients ---------------------------------------------------------------------------------------------


@lru_cache(maxsize=512)
def _waves(harmonics: int, half_width: float, terms: int) -> tuple[NDArray[np.complex128], Floats]:
    """(2k + 1) i^k j_k(hw) for k = 1 .. M (M, H), and the sum of their sizes above M (H,)."""
    from scipy.special import spherical_jn

    largest = harmonics * half_width
    most = max(2 * terms, terms + 6, int(np.ceil(12 + 1.15 * largest)))
    order = np.arange(1, most + _BEYOND + int(largest / 4) + 1)
    argument = np.arange(1, harmonics + 1) * half_width
    size = (2 * order[:, None] + 1) * spherical_jn(order[:, None], argument)
    return size[:most] * (1j ** order[:most])[:, None], np.abs(size[most:]).sum(axis=0)


class Expansion:
    """What series of some length are multiplied with to give their Legendre coefficients over intervals.

    ``harmonics``: of the series: cosine and sine of each side by side. ``centres`` (P,): middles of the intervals,
    radians. ``half_width``: of each interval. ``terms``: coefficients that are kept.
    """

    def __init__(self, harmonics: int, centres: Floats, half_width: float, terms: int) -> None:
        waves, self._beyond = _waves(harmonics, half_width, terms)
        turned = np.exp(1j * np.outer(centres, np.arange(1, harmonics + 1)))
        matrix = np.ascontiguousarray(turned[:, None, :] * waves).view(float)  # Re (C - iS)(x + iy) = Cx + Sy
        self._matrix = matrix.reshape(-1, 2 * harmonics).T
        self._shape = (len(centres), len(waves))
        self.terms = terms
        self.half_width = half_width

    @property
    def width(self) -> int:
        """Numbers that are computed for each curve."""
        return self._shape[0] * self._shape[1]

    def coefficients(self, periodic: Floats, winding: int, error: Floats) -> tuple[Floats, Floats]:
        """a_1 .. a_K of curves with their winding, and the remainder: no value of a curve is further from its a_1 .. a_K.

        ``periodic`` (n, 2H). ``winding``: turns of the body in one of the crank: a straight line more. ``error`` (n,):
        by how much a series may be off its curve.

        Returns
        -------
        coefficients : ndarray, shape (n, P, K)
        remainder : ndarray, shape (n, P)
            Law: at least |curve - constant - sum a_k P_k| anywhere on the interval, for some constant.
        """
        every = (periodic @ self._matrix).reshape(len(periodic), *self._shape)
        every[..., 0] += winding * self.half_width
        tail = np.hypot(periodic[:, ::2], periodic[:, 1::2]) @ self._beyond
        remainder = np.abs(every[..., self.terms :]).sum(axis=-1) + (tail + error)[:, None] + 1e-12
        return every[..., : self.terms], remainder


# -- the index ---------------------------------------------------------------------------------------------------------


class RTree(NamedTuple):
    """Where the boxes and entries of one part of the intervals lie in the arrays of an index.

    ``part``: in the interval's coordinate, -1 to 1. ``levels``: first box and number of boxes of each level, coarse to
    fine. ``first_leaf``: its place in ``entries`` and ``codes``.
    """

    part: tuple[float, float]
    levels: list[tuple[int, int]]
    first_leaf: int


class WindowIndex:
    """The entries of some intervals.

    ``arrays``: those that `build_window_index` makes.

    Attributes
    ----------
    boxes : ndarray of float32, shape (boxes, 2 K + 1)
        Coarse ones before fine ones: middles, half widths, remainder.
    codes : ndarray of int8, shape (leaves, K + 1, LEAF)
        Of the coefficients, -CODES to CODES over the box of the leaf; of the remainder, -128 to 127 for its share of the box's.
    entries : ndarray of uint32, shape (leaves, LEAF)
        type * intervals + interval.
    largest : ndarray of float32, shape (parts, K)
        Largest size of each coefficient.
    trees : list of RTree
        One for each part.
    """

    def __init__(self, intervals: Intervals, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.intervals = intervals
        self.arrays = arrays
        self.boxes, self.codes, self.entries = arrays["boxes"], arrays["codes"], arrays["entries"]
        self.largest: Singles = np.array(arrays["largest"])
        self.types = int(arrays["count"][0]) // intervals.number
        self.trees = []
        box = leaf = 0
        for part, leaves in zip(PARTS, arrays["leaves"].tolist()):
            counts = _level_counts(leaves)
            first = box + np.cumsum([0, *counts])
            self.trees.append(RTree(part, [(int(f), c) for f, c in zip(first, counts)], leaf))
            box, leaf = int(first[-1]), leaf + leaves

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(int(array.nbytes) for array in self.arrays.values())


def _level_counts(leaves: int) -> list[int]:
    counts = [leaves] if leaves else []
    while counts and counts[0] > CHILDREN:
        counts.insert(0, -(-counts[0] // CHILDREN))
    return counts


class _Points(NamedTuple):
    """Some entries of a part: what they are, coefficients (n, K), remainders."""

    part: int
    entries: NDArray[np.uint32]
    values: Singles
    remainders: Singles


def build_window_index(
    intervals: Intervals,
    groups: Sequence[SeriesGroup],
    new: New,
    folder: Path | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> None:
    """Fill the arrays of a `WindowIndex` from the series of all types.

    Law: every type is in each interval once, within the boxes above it.

    ``new``: where the arrays lie. ``folder``: for temporary files; default: all entries are held in memory. ``go_on``:
    called between the steps; may raise to end the work.

    Raises `OSError`: there is not twice the place on the disk that the entries and the index take.
    """
    count, terms = intervals.number * sum(len(group.rows) for group in groups), intervals.terms
    if count >= NO_ENTRY:
        raise OSError(errno.EFBIG, f"an index has at most {NO_ENTRY:,} entries, wanted {count:,}")
    if folder is not None:
        needed = count * (_record(terms).itemsize + terms + 6 + 12 * (terms + 1) // LEAF)
        if shutil.disk_usage(folder).free < 2 * needed:
            raise OSError(
                errno.ENOSPC, f"an index takes {needed:,} bytes while it is made, and as many are to be left"
            )

    def points(every: int) -> Iterator[_Points]:
        for group in groups:
            yield from _points_of(intervals, group, every, go_on)

    with ExitStack() as files:

        def spool() -> IO[bytes]:
            return files.enter_context(BytesIO() if folder is None else TemporaryFile(dir=folder))

        every = max(1, count // SAMPLED)
        sample = list(points(every))
        run_bytes = max(RUN_BYTES, count * _record(terms).itemsize // _MOST_RUNS)
        runs = [
            _SortedRuns([some for some in sample if some.part == part], every, terms, run_bytes, spool)
            for part in range(len(PARTS))
        ]
        for some in sample if every == 1 else points(1):
            go_on()
            runs[some.part].add(some)
        _fill(runs, terms, new, go_on)


def _points_of(intervals: Intervals, group: SeriesGroup, every: int, go_on: Callable[[], None]) -> Iterator[_Points]:
    """The entries of every so-many-th type of a group, each by the part of its interval that it is kept by."""
    whole = Expansion(group.harmonics, intervals.centres, intervals.half_width, intervals.terms)
    sharp_ones = _SharpWindows(intervals, group)
    step = every * max(1, _AT_ONCE // whole.width)
    for first in range(0, len(group.rows), step):
        go_on()
        some = group.take(slice(first, first + step, every))
        values, remainder = whole.coefficients(some.periodic, some.winding, some.error)
        entries = (some.rows[:, None] * intervals.number + np.arange(intervals.number)).astype(np.uint32)
        remainders = upwards(remainder)
        resolved = remainders <= intervals.sharp
        yield _Points(0, entries[resolved], values[resolved].astype(np.float32), remainders[resolved])
        for place in np.flatnonzero(~resolved.all(axis=0)).tolist():
            sharp = np.flatnonzero(~resolved[:, place])
            yield from sharp_ones.points(some.take(sharp), place, entries[sharp, place])


class _SharpWindows:
    def __init__(self, intervals: Intervals, group: SeriesGroup) -> None:
        self._intervals, self._harmonics, self._winding = intervals, group.harmonics, group.winding
        self._expansion = cache(self._expansion_over)

    def _expansion_over(self, place: int, part: int) -> Expansion:
        half, (low, high) = self._intervals.half_width, PARTS[part]
        middle = np.array([self._intervals.centres[place] + half * (low + high) / 2])
        return Expansion(self._harmonics, middle, half * (high - low) / 2 * (1 + _MARGIN), self._intervals.terms)

    def points(self, curves: SeriesGroup, place: int, entries: NDArray[np.uint32]) -> Iterator[_Points]:
        """Curves that are sharp in an interval: each by the first part that resolves it, or else does best."""
        best = np.zeros(len(entries), dtype=np.int64)
        least = np.full(len(entries), np.inf, np.float32)
        found = np.empty((len(entries), self._intervals.terms), np.float32)
        for part in range(1, len(PARTS)):
            left = np.flatnonzero(least > self._intervals.sharp)
            if not left.size:
                break
            expansion = self._expansion(place, part)
            values, remainder = expansion.coefficients(curves.periodic[left], self._winding, curves.error[left])
            remainders = upwards(remainder[:, 0])
            better = remainders < (least[left] if part <= _CENTRAL else self._intervals.sharp)
            at = left[better]
            best[at], least[at], found[at] = part, remainders[better], values[better, 0]
        for part in np.unique(best):
            kept = best == part
            yield _Points(int(part), entries[kept], found[kept], least[kept])


# -- sorting -----------------------------------------------------------------------------------------------------------


def upwards(values: NDArray[np.floating]) -> Singles:
    """As float32, not smaller."""
    return np.nextafter(values.astype(np.float32) * _ABOVE, np.float32(np.inf))


def _record(terms: int) -> np.dtype[Any]:
    """An entry and its place in the order."""
    return np.dtype([("key", "u8"), ("entry", "u4"), ("remainder", "f4"), ("values", "f4", (terms,))])


class _MortonOrder:
    """The places of points in an order that a sample of them suggests, (n, K)."""

    def __init__(self, sample: Singles) -> None:
        terms = sample.shape[1]
        weight = (
            1 / np.sqrt(2 * np.arange(1, terms + 1) + 1) / _CELL
        )  # by what a coefficient does to the rms of a curve
        self._weight = weight.astype(np.float32)
        usual = np.quantile(np.abs(sample), _USUAL, axis=0) if len(sample) else np.ones(terms)
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

    def keys(self, values: Singles, remainders: Singles) -> NDArray[np.uint64]:
        """Class of the remainder, then the bits of the values in steps."""
        keys = np.searchsorted(_CLASSES, remainders).astype(np.uint64) << np.uint64(self._used)
        for column, weight, bits, spread in zip(values.T, self._weight, self._bits, self._spread):
            step = np.floor(column * weight) + (1 << (bits - 1))
            keys |= spread[step.clip(0, (1 << bits) - 1).astype(np.intp)]
        return keys


class _SortedRuns:
    """The entries of a part while they are collected: in a file for each run of their order, which a sample divides."""

    def __init__(
        self, sample: list[_Points], every: int, terms: int, run_bytes: int, spool: Callable[[], IO[bytes]]
    ) -> None:
        values = np.concatenate([np.empty((0, terms), np.float32), *(some.values for some in sample)])
        remainders = np.concatenate([np.empty(0, np.float32), *(some.remainders for some in sample)])
        self._order, self._record = _MortonOrder(values), _record(terms)
        keys = np.sort(self._order.keys(values, remainders))
        runs = -(-keys.size * every * self._record.itemsize // run_bytes) or 1
        self._cuts = keys[np.arange(1, runs) * keys.size // runs]
        self._files = [spool() for _ in range(runs)]
        self.count, self.largest = 0, np.zeros(terms, np.float32)

    @property
    def leaves(self) -> int:
        return -(-self.count // LEAF)

    def add(self, points: _Points) -> None:
        if not points.entries.size:
            return
        records = np.empty(points.entries.size, self._record)
        records["key"] = self._order.keys(points.values, points.remainders)
        records["entry"], records["remainder"], records["values"] = points[1], points.remainders, points.values
        self.count += records.size
        np.maximum(self.largest, np.abs(points.values).max(axis=0), out=self.largest)
        run = np.searchsorted(self._cuts, records["key"], side="right")
        records = records[np.argsort(run, kind="stable")]
        ends = np.cumsum(np.bincount(run, minlength=len(self._files)))
        for file, begin, end in zip(self._files, [0, *ends], ends):
            file.write(records[begin:end].data)

    def in_order(self) -> Iterator[NDArray[Any]]:
        """Its entries, run after run; they are forgotten on the way."""
        while self._files:
            with self._files.pop(0) as file:
                file.seek(0)
                records = np.frombuffer(file.read(), self._record)
            records = records[np.argsort(records["key"], kind="stable")]
            yield records


# -- boxes -------------------------------------------------------------------------------------------------------------


def _fill(parts: list[_SortedRuns], terms: int, new: New, go_on: Callable[[], None]) -> None:
    counts = [_level_counts(part.leaves) for part in parts]
    leaves = sum(part.leaves for part in parts)
    boxes = new("boxes", np.float32, (sum(sum(own) for own in counts), 2 * terms + 1))
    codes, entries = new("codes", np.int8, (leaves, terms + 1, LEAF)), new("entries", np.uint32, (leaves, LEAF))
    box = leaf = 0
    for part, own in zip(parts, counts):
        firsts = box + np.cumsum([0, *own])
        levels = [boxes[first : first + count] for first, count in zip(firsts, own)]
        done = 0
        for some in _leaves(part, terms, go_on):
            at, in_all = slice(done, done + len(some)), slice(leaf + done, leaf + done + len(some))
            levels[-1][at], codes[in_all] = _boxed(some["values"], some["remainder"])
            entries[in_all] = some["entry"]
            done += len(some)
        for below, above in zip(levels[:0:-1], levels[-2::-1]):
            _fill_level(below, above)
        box, leaf = int(firsts[-1]), leaf + part.leaves
    largest = upwards(np.stack([part.largest for part in parts]))
    told = {
        "largest": largest,
        "leaves": np.array([part.leaves for part in parts]),
        "count": np.array([sum(part.count for part in parts)]),
    }
    for name, values in told.items():
        new(name, values.dtype, values.shape)[...] = values


def _leaves(part: _SortedRuns, terms: int, go_on: Callable[[], None]) -> Iterator[NDArray[Any]]:
    """The entries of a part in order, some leaves at a time, (leaves, LEAF); the last is filled."""
    left, taken = np.empty(0, _record(terms)), 0
    at_once = max(1, _AT_ONCE // (LEAF * terms))
    for records in part.in_order():
        taken += records.size
        left = np.concatenate([left, records])
        del records  # a run is held as few times as can be
        if taken == part.count:
            filling = np.repeat(left[-1:], -left.size % LEAF)
            filling["entry"] = NO_ENTRY
            left = np.concatenate([left, filling])
        whole = left.size // LEAF
        leaves, left = left[: whole * LEAF].reshape(whole, LEAF), left[whole * LEAF :]
        for first in range(0, whole, at_once):
            go_on()
            yield leaves[first : first + at_once]


def _fill_level(below: Singles, above: Singles) -> None:
    terms = below.shape[1] // 2
    at_once = max(1, _AT_ONCE // (CHILDREN * terms))
    for first in range(0, len(above), at_once):
        last = min(first + at_once, len(above))
        children = below[np.minimum(np.arange(first * CHILDREN, last * CHILDREN), len(below) - 1)]
        children = children.reshape(-1, CHILDREN, below.shape[1])
        middle, half, remainder = children[..., :terms], children[..., terms:-1], children[..., -1]
        above[first:last] = _box((middle - half).min(axis=1), (middle + half).max(axis=1), remainder.max(axis=1))


def _boxed(values: Singles, remainders: Singles) -> tuple[Singles, NDArray[np.int8]]:
    """Boxes and codes of leaves, (n, LEAF, K) and (n, LEAF)."""
    terms = values.shape[2]
    box = _box(values.min(axis=1), values.max(axis=1), remainders.max(axis=1))
    codes = np.empty((len(values), terms + 1, LEAF), np.int8)
    codes[:, :terms] = np.rint((values - box[:, None, :terms]) / box[:, None, terms:-1] * CODES).swapaxes(1, 2)
    codes[:, terms] = np.ceil(remainders / box[:, -1:] * np.float32(255) * _ABOVE).clip(max=255) - 128
    return box, codes


def _box(low: Singles, high: Singles, remainder: Singles) -> Singles:
    """Boxes from their corners: whatever the rounding, what lay between the corners lies in the box."""
    middle = (low + high) / 2
    slack = np.maximum(np.abs(low), np.abs(high)) * np.float32(2.0**-22)
    half = upwards(np.maximum(high - middle, middle - low) + slack)
    return np.concatenate([middle, half, remainder[:, None]], axis=1)
