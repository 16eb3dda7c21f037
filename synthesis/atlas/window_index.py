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
and is compared with the samples that lie there (see the search below).

Boxes. The entries of each part are the leaves of an R-tree that is packed in Morton order, by the interleaved bits of the
coefficients, coarse ones first, so that neighbours are alike; entries of a large remainder, which spoil what they lie with, stand
behind those of a small one. Each `LEAF` of them have a *box*: middle and half width of every coefficient, and the largest
remainder; each `CHILDREN` boxes one above. An entry is kept as one byte a coefficient within the box of its leaf.

Making. A sample of the entries tells which bits tell most, and where the order is to be cut into runs. Then all entries are
written to a file for each run, and run after run is read, sorted and boxed. So in memory is one run, and the index is the same
however long a run is.

The search. Boxes that may hold some, their entries, then windows.

    likely windows, a few exact errors: a first limit
    boxes of all parts, level by level, all queries at once --(bound <= limit)--> leaves, each with some of the queries
    --(bound from the codes)--> windows --(limit of the likeliest)--> windows --(some exact samples)--> those to evaluate

The bound of a box holds for all it contains, so no window below the limit is lost. Where the limit is large or many leaves are
left, boxes of windows exclude little and the cells of types do better: the search is given up, and what it knows by then serves
as their ceiling.

A request's windows differ, for the entries, only by where a window's middle lies in its interval: by one of starts / intervals
offsets, on one of two branches. (Branch -1 is the same curve mirrored, theta2(x, -1) = -theta2(-x, +1): there the request is
(-g, -t).) So a request is a few dozen *queries*, whatever the number of types.

Bounds. Let v_m be the samples in an interval's coordinate for one offset, V the matrix of P_k(v_m), k = 1 .. K, less its mean
over the samples, each row times the root of its weight, and g the centred target, weighted alike. Whatever Q of orthonormal
columns spans the columns of V, with R = Q' V, y = Q' g and l^2 = |g|^2 - |y|^2 (computed as the size of g - Q y),

    | g - V a |^2 = | y - R a |^2 + l^2

without any approximation. An entry's curve is sum_k a_k P_k to within its remainder E, and the rms of what is left after the best
constant is a seminorm, so by the triangle inequality

    error >= sqrt(| y - R a |^2 + l^2) - E.

* *Box*, a within ``half`` of ``middle``: component j of R a is within h_j = sum_k |R_jk| half_k of that of the middle, so
  | y - R a | is at least the norm of max(0, |y - R middle|_j - h_j). A code is a box of half a step.
* *Part of the samples*, total weight s^2 of 1: any constant leaves at least what the best one of the part leaves, so the
  error is at least the norm over the part: sqrt(| y - R a |^2 + l^2) - s E with y, R, l of those samples. By this the entries
  that are kept by a part of their interval are bounded, and windows by a few exact samples.

Q spans the polynomials of degree K over the samples, less the constant: the same for all offsets and both branches.
"""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, cached_property, lru_cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints, Singles
from synthesis.atlas.cells import New, SeriesGroup, gather
from synthesis.atlas.windows import TIE, BestWindows, Windows
from synthesis.target import TURN, Target

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
LEAST_SPAN = np.deg2rad(5.0)
"""Below it the error of a tenth window is less than the remainder of the entries."""
LARGEST_LIMIT = 0.05
"""First limit, radians, beyond which cells of types are left to do it: extreme curves are few, and cells are made for them."""
MOST_LEAVES = 5.0
"""Leaves, over the root of the number of types, beyond which the same."""
MOST_WINDOWS = 0.25
"""Windows, over the number of types, likewise: each costs a microsecond, and the cells need less."""
MOST_PLACED = 0.04
"""The same where positions are wanted too, of which the index knows nothing."""
_BEAM = 48
_LIKELY = 64
_BOXES_AT_ONCE = 512
_PAIRS_AT_ONCE = 512
_EVALUATED_AT_ONCE = 1 << 14
_TOO_MANY = 0.71
_MANY = 128
"""Windows for which a closer limit, or a few of their samples, are worth their time."""
_LOOSENED = np.float32(1 + 2e-6)
"""Makes up for the rounding of a few operations in single precision."""
_SINGLE = 16 * 2.0**-24
"""Rounding of a few products in single precision, relative to the sum of the sizes of their terms."""
_MALUS = 0.3
"""By how much of its remainder an entry counts as worse in a first look."""
_RANGES = 32
_FEW_SAMPLES = 4
_OF_ALL_SAMPLES = 8
_LEAST_SHARE = 0.3


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


# -- the search in it ---------------------------------------------------------------------------------------------------

_NEXT_TO_NOTHING = np.finfo(float).tiny


class Bounds(NamedTuple):
    """Entries that are left of some leaves: place, lower bound and estimate of the error."""

    near: Ints
    bound: Floats
    estimate: Floats


class Queries(NamedTuple):
    """A request against the entries of some parts of the intervals: of each part all offsets of branch +1, then of -1.

    Attributes
    ----------
    rows : ndarray of float32, shape (parts, J, Q, K)
        R of each query: part, j, query, k.
    sizes : ndarray of float32, shape (parts, J, Q, K)
        Their sizes |R_jk|.
    wanted : ndarray of float32, shape (parts, J, Q)
        y.
    slack : ndarray of float32, shape (parts, J, Q)
        Rounding of y - R a.
    left : ndarray of float32, shape (parts, Q)
        l^2.
    share : ndarray of float32, shape (parts, Q)
        s, by which an entry's remainder counts.
    """

    rows: Singles
    sizes: Singles
    wanted: Singles
    slack: Singles
    left: Singles
    share: Singles

    def likely(self, part: int, points: Singles, remainder: Singles) -> Singles:
        """About the error of entries of a part, for each query: (Q, points); the worse the less is known of one."""
        gap = self.rows[part].reshape(-1, points.shape[1]) @ points.T
        gap -= self.wanted[part].reshape(-1, 1)
        gap = gap.reshape(-1, self.rows.shape[2], len(points))
        far: Singles = np.sqrt(np.einsum("jqn,jqn->qn", gap, gap) + self.left[part][:, None])
        far += np.float32(_MALUS) * remainder
        far[self.share[part] < _LEAST_SHARE] = np.inf
        return far

    def entries(self, limit: float, problem: Ints, points: Singles, half: Singles, remainder: Singles) -> Bounds:
        """Which entries of some leaves, each for a query, may have an error of at most ``limit``.

        ``problem`` (n,): part * Q + query. ``points`` (n, K, LEAF). ``half`` (n, K): by how much the points may be
        off. ``remainder`` (n, LEAF).
        """

        def of(values: Singles) -> Singles:
            return gather(values.swapaxes(1, 2).reshape(-1, *values.shape[1:2], *values.shape[3:]), problem)

        gap = of(self.rows) @ points
        gap -= of(self.wanted)[..., None]
        estimate = np.einsum("pjn,pjn->pn", gap, gap)
        np.abs(gap, out=gap)
        largest = np.einsum("pjk,pk->pj", of(self.sizes), half) + of(self.slack)
        gap -= largest[..., None]
        np.maximum(gap, 0, out=gap)
        least = np.einsum("pjn,pjn->pn", gap, gap)
        left = gather(self.left.ravel(), problem)[:, None]
        error = gather(self.share.ravel(), problem)[:, None] * remainder
        near = np.flatnonzero(least <= (error + np.float32(limit)) ** 2 * _LOOSENED - left)
        left = left[near // points.shape[-1], 0].astype(float)
        bound = np.sqrt(least.ravel()[near] * (1 - 2e-6) + left) - error.ravel()[near] * (1 + 1e-6)
        return Bounds(near, bound, np.sqrt(estimate.ravel()[near] + left))

    def may_be_below(self, limit: float, part: int, box: Singles) -> NDArray[np.bool_]:
        """Which boxes may hold an error of at most ``limit``, for each query of a part: (Q, boxes)."""
        terms = self.rows.shape[-1]
        gap = self.rows[part].reshape(-1, terms) @ box[:, :terms].T
        gap -= self.wanted[part].reshape(-1, 1)
        np.abs(gap, out=gap)
        largest = self.sizes[part].reshape(-1, terms) @ box[:, terms:-1].T
        largest += self.slack[part].reshape(-1, 1)
        gap -= largest
        np.maximum(gap, 0, out=gap)
        gap *= gap
        most = self.share[part][:, None] * box[:, -1]
        most += np.float32(limit)
        most *= most
        most *= _LOOSENED
        most -= self.left[part][:, None]
        return gap.reshape(-1, self.rows.shape[2], len(box)).sum(axis=0) <= most


class Request:
    """A rotation as it meets the entries of some intervals.

    ``target``: of a span that the intervals are for. ``starts``: of the turn, a multiple of the intervals.
    ``branches``: of the mechanism: 2, or 1.

    ``rounding``: of errors, in radians, and of what bounds them.
    """

    def __init__(self, target: Target, intervals: Intervals, starts: int, branches: int = 2) -> None:
        self.target, self.intervals, self.starts, self.branches = target, intervals, starts, branches
        self._signs = np.array([1.0, -1.0])[:branches]
        low, high = float(target.crank.min()), float(target.crank.max())
        self._along = target.crank - (low + high) / 2
        self._per_branch = starts // intervals.number
        step = TURN / starts
        middle = (low + high) / 2 / step * self._signs  # of a window that begins at crank angle 0
        self._first = np.ceil(-self._per_branch / 2 - middle).astype(np.int64)
        offsets = (self._first + middle)[:, None] + np.arange(self._per_branch)
        along = self._along * self._signs[:, None]
        places = along[:, None] + step * offsets[..., None]
        self._places = places.reshape(self.size, -1) / intervals.half_width
        self._shift = step * offsets.ravel()
        assert target.rotation is not None
        mean = target.rotation_mean
        centred = target.rotation - mean(target.rotation)
        self._given = centred - mean(centred)
        self._weights = np.full(target.samples, 1 / target.samples) if mean.weights is None else mean.weights
        # of theta2 and of the rotation at the samples, as the exact error has them
        self.rounding = 1e-12 + 16 * np.finfo(float).eps * float(np.abs(target.rotation).max())

    @property
    def size(self) -> int:
        """Queries of a part: offsets of all branches."""
        return self.branches * self._per_branch

    def windows(self, entry: NDArray[np.integer], query: Ints) -> Ints:
        """Numbers of the windows that entries are to queries; all windows of a table between them, each once."""
        row, place = np.divmod(entry.astype(np.int64), self.intervals.number)
        mirrored, offset = np.divmod(query, self._per_branch)
        start = place * self._per_branch + offset + self._first[mirrored]
        start = np.where(mirrored == 1, -start, start) % self.starts
        return (self.branches * row + mirrored) * self.starts + start

    def some_samples(self) -> tuple[Target, float]:
        """The rotation at a few of the samples, and the root of their part of the weights."""
        target, weights = self.target, self.target.rotation_weights
        given = np.arange(target.samples) if weights is None else np.flatnonzero(weights)
        count = min(max(_FEW_SAMPLES, -(-given.size // _OF_ALL_SAMPLES)), given.size)
        some = given[np.round(np.linspace(0, given.size - 1, count)).astype(int)]
        share = count / target.samples if weights is None else weights[some].sum() / weights.sum()
        own = None if weights is None else weights[some]
        assert target.rotation is not None
        part = replace(target, crank=target.crank[some], rotation=target.rotation[some], rotation_weights=own)
        return replace(part, position=None, position_weights=None), float(np.sqrt(share))

    def queries(self, parts: NDArray[np.float64], largest: NDArray[np.floating]) -> Queries:
        """The request against the entries of some parts of the intervals.

        ``parts`` (parts, 2): their ends. ``largest`` (parts, K): largest size of each coefficient of the entries.
        """
        count, samples = len(parts), self._along.size
        low, high = (np.repeat(end, self.size)[:, None] for end in parts.T)
        within = (np.tile(self._places, (count, 1)) >= low) & (np.tile(self._places, (count, 1)) <= high)
        # where samples are many, ranges of them that are nearly the same are made the same
        grain = -(-samples // _RANGES)
        first = -(-within.argmax(axis=1) // grain) * grain
        last = within.argmax(axis=1) + within.sum(axis=1)
        last = np.maximum(np.where(last == samples, last, last // grain * grain), first)
        ranges, which = np.unique(first * (samples + 1) + last, return_inverse=True)
        first, last = np.divmod(ranges, samples + 1)
        inside = (np.arange(samples) >= first[:, None]) & (np.arange(samples) < last[:, None])
        weights = np.where(inside, self._weights, 0.0)
        share = weights.sum(axis=1)
        total = np.maximum(share, _NEXT_TO_NOTHING)[:, None]
        roots = np.sqrt(weights)
        # the polynomials of the range's own coordinate, place = (along - middle) / half, made orthonormal
        ends = self._along[np.minimum(first, samples - 1)], self._along[np.maximum(last, 1) - 1]
        middle, half = (ends[0] + ends[1]) / 2, np.abs(ends[1] - ends[0]) / 2
        half = np.where(half > 0, half, 1.0)
        columns = polynomials(
            np.where(inside, (self._along - middle[:, None]) / half[:, None], 0.0), self.intervals.terms
        )
        columns -= (weights[:, None] @ columns) / total[..., None]
        columns *= roots[..., None]
        basis = np.linalg.qr(columns)[0]
        along = basis.transpose(0, 2, 1) @ columns
        given = roots * (self._given - (weights @ self._given)[:, None] / total)
        wanted = (given[:, None] @ basis)[:, 0]
        unexplained = given - (basis @ wanted[..., None])[..., 0]
        left = (unexplained**2).sum(axis=1)
        # those of the part's coordinate are sums of those of the range's
        sign = np.tile(np.repeat(self._signs, self._per_branch), count)
        scale = 2 / (high - low)[:, 0] / self.intervals.half_width
        shifted = scale * (sign * middle[which] + np.tile(self._shift, count)) - ((high + low) / (high - low))[:, 0]
        rows = along[which] @ _substituted(scale * sign * half[which], shifted, self.intervals.terms)
        y = sign[:, None] * wanted[which]
        slack = _SINGLE * (np.abs(y) + (np.abs(rows) @ np.repeat(largest, self.size, axis=0)[..., None])[..., 0])

        def single(values: Floats) -> Singles:
            """Part, j, query, ..."""
            values = values.reshape(count, self.size, *values.shape[1:])
            return np.ascontiguousarray(values.swapaxes(1, 2) if values.ndim > 2 else values, dtype=np.float32)

        left, share = left[which] * (1 - 2e-6), np.sqrt(share)[which] * (1 + 1e-6)
        return Queries(single(rows), single(np.abs(rows)), *map(single, (y, slack, left, share)))


def polynomials(v: Floats, terms: int) -> Floats:
    """P_1 .. P_terms at points in [-1, 1]; shape (..., terms). Law: P_k(1) = 1, and |P_k| <= 1 (DLMF 18.9.1)."""
    result = np.empty((*v.shape, terms))
    before, now = np.ones_like(v), v
    for k in range(1, terms + 1):
        result[..., k - 1] = now
        before, now = now, ((2 * k + 1) * v * now - k * before) / (k + 1)
    return result


def _substituted(scale: Floats, shift: Floats, terms: int) -> Floats:
    """Coefficients in P_j(x) of P_k(scale x + shift), j and k = 1 .. terms, (n, j, k).

    By Gauss's rule, which is exact here: a product of two of them is of degree 2 terms at most.
    """
    point, weight = np.polynomial.legendre.leggauss(terms + 1)
    own = polynomials(point, terms) * (weight[:, None] * (np.arange(1, terms + 1) + 0.5))
    return own.T @ polynomials(scale[:, None] * point + shift[:, None], terms)


# -- the search --------------------------------------------------------------------------------------------------------


class Candidates(NamedTuple):
    """Windows that are left, with a lower bound and an estimate of their error."""

    id: Ints
    bound: Floats
    estimate: Floats

    def take(self, places: Any) -> Candidates:
        """Some of them."""
        return Candidates(*(column[places] for column in self))


_NOTHING = Candidates(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))


class _GivenUp(Exception):
    """It does not pay to go on."""


class _OutOfTime(Exception):
    """The time is up."""


class WindowSearch:
    """A rotation over a short span, and the index of the intervals for it.

    ``target``: of a span that its intervals are for. ``starts``: of the turn, a multiple of the intervals. ``expired``:
    asked between the steps, whether there is time for more. ``branches``: of the mechanism: 2, or 1.
    """

    def __init__(
        self, index: WindowIndex, target: Target, starts: int, expired: Callable[[], bool], branches: int = 2
    ) -> None:
        self.index, self.target = index, target
        self._expired = expired
        self._request = Request(target, index.intervals, starts, branches)
        self._most_leaves = MOST_LEAVES * np.sqrt(index.types)
        self._most_windows = index.types * (MOST_WINDOWS if target.position is None else MOST_PLACED)
        self._parts = [number for number, tree in enumerate(index.trees) if tree.levels]

    def candidates(
        self, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> tuple[Ints, Floats] | None:
        """Numbers and lower bounds of all windows that may be among the best; None where the cells of types do better.

        ``best``: gets the windows that are looked at on the way. Those that are left are compared with the worst of the
        best of them, also where the answer is None; where the time runs out it has the best found so far, and nothing
        is left. ``errors``: ``errors(target, windows)``: the exact errors of windows for some of the samples, whatever
        rule there is beside them.
        """
        try:
            return self._candidates(best, errors)
        except _GivenUp:
            return None
        except _OutOfTime:
            return _NOTHING.id, _NOTHING.bound

    def _candidates(self, best: BestWindows, errors: Callable[[Target, Windows], Floats]) -> tuple[Ints, Floats]:
        if not self._parts or not self._any_below(LARGEST_LIMIT):
            raise _GivenUp
        wanted = max(_LIKELY, best.top)
        looked = self._likely(0, wanted)
        self._evaluate(best, looked)
        if best.worst > self.index.intervals.sharp:
            looked = np.union1d(looked, self._look_at_sharp_ones(looked, wanted, best, errors))
        if best.reached:
            return _NOTHING.id, _NOTHING.bound
        if not best.worst <= LARGEST_LIMIT:
            raise _GivenUp
        near = self._below(best.worst + TIE)
        if near.id.size > _MANY:
            likely = np.argpartition(near.estimate, min(_LIKELY, near.id.size - 1))[:_LIKELY]
            likely = near.id[likely]
            self._go_on()
            self._evaluate(best, likely[np.isin(likely, looked, invert=True)])
            near = near.take(near.bound <= best.worst + TIE)
        return self._by_samples(near, best, errors) if near.id.size > _MANY else (near.id, near.bound)

    def _look_at_sharp_ones(
        self, looked: Ints, wanted: int, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> Ints:
        """Evaluate windows of the entries that are kept by a part of their interval, those first that few samples favour."""
        self._go_on()
        found = [self._likely(number, 4 * wanted) for number, _ in enumerate(self._parts) if number]
        ids = np.concatenate([looked[:0], *found])
        ids = ids[np.isin(ids, looked, invert=True)]
        if not ids.size:
            return ids
        part, _ = self._request.some_samples()
        error = errors(part, best.numbering.windows(ids))
        nearest = ids[np.argsort(error, kind="stable")[:wanted]]
        self._go_on()
        self._evaluate(best, nearest)
        return nearest

    def _evaluate(self, best: BestWindows, ids: Ints) -> None:
        for first in range(0, ids.size, best.at_once):
            if first:
                self._go_on()
            best.evaluate(ids[first : first + best.at_once])

    def _by_samples(
        self, near: Candidates, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> tuple[Ints, Floats]:
        """Those of some windows whose exact error over a few samples allows them among the best."""
        part, share = self._request.some_samples()
        if share > _TOO_MANY:
            return near.id, near.bound
        bound = near.bound
        for first in range(0, near.id.size, _EVALUATED_AT_ONCE):
            self._go_on()
            chosen = slice(first, first + _EVALUATED_AT_ONCE)
            error = share * (1 - 1e-12) * errors(part, best.numbering.windows(near.id[chosen]))
            bound[chosen] = np.maximum(bound[chosen], error - self._request.rounding)
        kept = np.flatnonzero(bound <= best.worst + TIE)
        return near.id[kept], bound[kept]

    def _go_on(self) -> None:
        if self._expired():
            raise _OutOfTime

    @cached_property
    def _queries(self) -> Queries:
        ends = np.array([self.index.trees[part].part for part in self._parts])
        return self._request.queries(ends, self.index.largest[self._parts])

    def _any_below(self, limit: float) -> bool:
        """Whether a resolved entry may have an error of at most a limit, by the coarsest boxes and by what no entry follows."""
        first, count = self.index.trees[0].levels[0]
        whole = self._request.queries(np.array([[-1.0, 1.0]]), self.index.largest[:1])
        return bool(whole.may_be_below(limit, 0, self.index.boxes[first : first + count]).any())

    # -- a first look -------------------------------------------------------------------------------------------------

    def _likely(self, number: int, wanted: int) -> Ints:
        """Windows of a tree that are likely among the best, each once."""
        tree, terms = self.index.trees[self._parts[number]], self.index.intervals.terms
        queries = self._queries

        at = np.arange(tree.levels[0][1])
        for level, (first, _) in enumerate(tree.levels):
            box = gather(self.index.boxes, first + at)
            if at.size > _BEAM:
                far = queries.likely(number, box[:, :terms], box[:, -1]).min(axis=0)
                best = np.argpartition(far, _BEAM)[:_BEAM]
                at, box = at[best], box[best]
            if level + 1 < len(tree.levels):
                at = (CHILDREN * at[:, None] + np.arange(CHILDREN)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        points, remainder = self._points(tree.first_leaf + at, box)
        entry = gather(self.index.entries, tree.first_leaf + at).ravel()
        far = queries.likely(number, points.swapaxes(1, 2).reshape(-1, terms), remainder.ravel())
        far[:, entry == NO_ENTRY] = np.inf
        far = far.ravel()
        count = min(wanted, far.size)
        best = np.argpartition(far, count - 1)[:count]
        best = best[np.isfinite(far[best])]
        query, place = np.divmod(best, entry.size)
        return self._request.windows(entry[place], query)

    def _points(self, leaves: Ints, box: Singles) -> tuple[Singles, Singles]:
        """Coefficients of the entries of some leaves, (leaves, K, LEAF), to half a step of their codes, and their remainders."""
        terms = self.index.intervals.terms
        codes = gather(self.index.codes, leaves).astype(np.float32)
        points = codes[:, :terms]
        points *= box[:, terms:-1, None] / np.float32(CODES)
        points += box[:, :terms, None]
        remainder = codes[:, terms]
        remainder += 128
        remainder *= (box[:, -1:] / np.float32(255)) * _LOOSENED
        return points, remainder

    # -- the search ---------------------------------------------------------------------------------------------------

    def _below(self, limit: float) -> Candidates:
        limit += self._request.rounding
        queries, trees = self._queries, [self.index.trees[part] for part in self._parts]
        most, pairs = self._most_leaves, []
        for number, tree in enumerate(trees):
            leaves, boxes, mask = self._leaves(tree, queries, number, limit, most)
            which, query = np.nonzero(mask.T)  # leaf by leaf: the entries of each are decoded once
            pairs.append((number * self._request.size + query, leaves[which] + tree.first_leaf, boxes[which]))
            most -= leaves.size
        problem, leaf, box = (np.concatenate(column) for column in zip(*pairs))
        found, held = [_NOTHING], 0
        for first in range(0, problem.size, _PAIRS_AT_ONCE):
            part = slice(first, first + _PAIRS_AT_ONCE)
            found.append(self._entries(queries, limit, problem[part], leaf[part], box[part]))
            held += found[-1].id.size
            if held > self._most_windows:
                raise _GivenUp
            self._go_on()
        return Candidates(*(np.concatenate(column) for column in zip(*found)))

    def _leaves(
        self, tree: RTree, queries: Queries, number: int, limit: float, most: float
    ) -> tuple[Ints, Ints, NDArray[np.bool_]]:
        """Leaves that are left, their boxes, and for which queries (Q, leaves)."""
        at = np.arange(tree.levels[0][1])
        for level, (first, _) in enumerate(tree.levels):
            finest = level + 1 == len(tree.levels)
            kept, masks = [at[:0]], [np.empty((self._request.size, 0), dtype=bool)]
            for begin in range(0, at.size, _BOXES_AT_ONCE):
                part = at[begin : begin + _BOXES_AT_ONCE]
                mask = queries.may_be_below(limit, number, gather(self.index.boxes, first + part))
                some = np.flatnonzero(mask.any(axis=0))
                kept.append(part[some])
                masks.append(mask[:, some])
            at = np.concatenate(kept)
            if at.size > most * (1 if finest else 0.5):
                raise _GivenUp
            self._go_on()
            if not finest:
                at = (CHILDREN * at[:, None] + np.arange(CHILDREN)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        return at, first + at, np.concatenate(masks, axis=1)

    def _entries(self, queries: Queries, limit: float, problem: Ints, leaf: Ints, boxes: Ints) -> Candidates:
        terms = self.index.intervals.terms
        leaves, first, which = np.unique(leaf, return_index=True, return_inverse=True)
        box = gather(self.index.boxes, boxes[first])
        points, remainder = self._points(leaves, box)
        half: Singles = np.divide(box[:, terms:-1], 2 * CODES, dtype=np.float32)
        near, bound, likely = queries.entries(limit, problem, points[which], half[which], remainder[which])
        entry = gather(self.index.entries, leaf).ravel()[near]
        real = entry != NO_ENTRY
        near, bound, likely = near[real], bound[real] - self._request.rounding, likely[real]
        ids = self._request.windows(entry[real], problem[near // LEAF] % self._request.size)
        return Candidates(ids, np.maximum(bound, 0.0), likely)
