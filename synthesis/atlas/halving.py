"""The order of a bucket's types in cells: halved again and again along the coefficient in which they differ most.

Each half keeps its types in ascending order of their place, the lower half being those of the least coefficients and, among
equal ones, of the least places. Coefficients count as whole numbers of `STEP`, so that sums are exact: the order does not depend
on how many types are worked on at a time. In memory are at most 26 bytes for each type of the bucket, and the coefficients of
`AT_ONCE` types; large cells read them in passes, from memory that the caller provides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.series import Bucket, Ints, New

Wholes = NDArray[np.integer]

HARMONICS = 6
"""Of the series, whose coefficients are looked at."""
STEP = 2.0**-16
"""Radians: a fraction of what neighbouring types of a billion differ by."""
_LARGEST = 1 << 18
"""Steps: whole sums of the squares of 100 million such numbers are still exact. What is larger counts as this."""
AT_ONCE = 1 << 18


def halve(bucket: Bucket, leaf: int, scratch: New) -> tuple[Ints, Ints]:
    """Order of the types in cells of at most ``leaf``, and where in it each cell begins (and the last ends).

    Law: the same for every `AT_ONCE`.
    """
    count = len(bucket.rows)
    features = scratch("features", np.int32, (count, 2 * min(HARMONICS, bucket.harmonics)))
    for first in range(0, count, AT_ONCE):
        part = bucket.periodic[first : first + AT_ONCE, : features.shape[1]] / STEP
        features[first : first + AT_ONCE] = np.rint(part).clip(-_LARGEST, _LARGEST)
    sizes, depth = np.array([count]), 0
    while sizes.max() > leaf:
        sizes, depth = np.stack([sizes // 2, sizes - sizes // 2], axis=1).ravel(), depth + 1
    order = np.arange(count)
    _settle(features, order, depth)
    return order, np.concatenate([[0], np.cumsum(sizes)])


def _settle(features: Wholes, members: Ints, depth: int) -> None:
    """Halve a cell so many times, in place."""
    if len(members) <= AT_ONCE:
        members[...] = members[_halved(features[members], depth)]
    elif depth:
        low = _lower_half(features, members)
        members[...] = np.concatenate([members[low], members[~low]])
        half = len(members) // 2
        for part in (members[:half], members[half:]):
            _settle(features, part, depth - 1)


def _widest(total: Wholes, squares: Wholes, sizes: Wholes | int) -> Ints:
    """The column in which cells differ most, from their sums."""
    widest: Ints = (squares / sizes - (total / sizes) ** 2).argmax(axis=-1)
    return widest


def _lower_half(features: Wholes, members: Ints) -> NDArray[np.bool_]:
    """Which members of a large cell are in its lower half."""
    count, half = len(members), len(members) // 2
    parts = [slice(first, first + AT_ONCE) for first in range(0, count, AT_ONCE)]
    total, squares = np.zeros((2, features.shape[1]), dtype=np.int64)
    for part in parts:
        some = features[members[part]].astype(np.int64)
        total += some.sum(axis=0)
        squares += (some * some).sum(axis=0)
    column = _widest(total, squares, count)
    key = np.empty(count, dtype=np.int32)
    for part in parts:
        key[part] = features[members[part], column]
    limit = np.partition(key, half)[half]
    low: NDArray[np.bool_] = key < limit
    low[np.flatnonzero(key == limit)[: half - np.count_nonzero(low)]] = True
    return low


def _halved(features: Wholes, depth: int) -> Ints:
    """Places of the types of a cell, in the order of the cells that so many halvings make of it."""
    count = len(features)
    order, sizes = np.arange(count), np.array([count])
    for _ in range(depth):
        first, half = np.cumsum(sizes) - sizes, sizes // 2
        some = features[order].astype(np.int64)
        total, squares = (np.add.reduceat(values, first, axis=0) for values in (some, some * some))
        column = _widest(total, squares, sizes[:, None])
        cell = np.repeat(np.arange(sizes.size), sizes)
        ranked = np.argsort((cell << 32) + some[np.arange(count), column[cell]], kind="stable")
        high = np.ones(count, dtype=bool)
        high[ranked[np.arange(count) - first[cell] < half[cell]]] = False
        order = order[np.argsort(2 * cell + high, kind="stable")]
        sizes = np.stack([half, sizes - half], axis=1).ravel()
    return order
