"""Windows of paths as points: an index of the few numbers that the shape of e^{i theta2} is over an interval of the crank.

A path is fitted by {1, e^{it}, e^{i theta2}} with three complex factors (`pose`), so of e^{i theta2} neither the size nor
the angle counts, nor what of it lies along 1 and e^{it}. Over an interval in whose coordinate v it is sum a_k P_k(v),
less so much of e^{ix} that a_1 is 0, what counts is the *shape* a_3 / a_2 .. a_K / a_2 alone
(`legendre.PhasorExpansion`). a_2 is 0 only where theta2'' = 0 and theta2' is 0 or 1 at once, so it is hardly ever small
beside the others.

The entries are those of `storeys`, a type and an interval, in the same boxes and order; each has the real and imaginary
parts of its shape. What no few terms follow has a large rest and a place behind the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from synthesis.atlas.legendre import PhasorExpansion
from synthesis.atlas.series import Bucket, New, Phasors, in_memory
from synthesis.atlas.storeys import Storey, numbers_of
from synthesis.atlas.trees import Arrays, Points, make_trees, upwards

PATH_STOREYS = (
    Storey(np.deg2rad(9.0), 30, 6, np.inf),
    Storey(np.deg2rad(25.0), 24, 7, np.inf),
    Storey(np.deg2rad(75.0), 24, 9, np.inf),
    Storey(np.deg2rad(160.0), 18, 16, np.inf),
    Storey(np.deg2rad(225.0), 18, 20, np.inf),
    Storey(np.deg2rad(360.0), 12, 28, np.inf),
)
"""No window is kept by a part of its interval: what is left of those with a large rest is few."""
_LARGEST_REST = 4.0
"""Rest over |a_2|, and size of a shape's number, beyond which nothing is known of an entry."""
_UNKNOWN = np.float32(1e6)
_STEP = 2.0**-12
"""Step of the finest cells of the order, in the rms of P_2."""
_AT_ONCE = 1 << 22


def build_path_storey(
    storey: Storey,
    buckets: Sequence[Bucket],
    phasors: Sequence[Phasors],
    new: New = in_memory,
    folder: Path | None = None,
    go_on: Callable[[], None] = lambda: None,
) -> Arrays:
    """The arrays of a `StoreyIndex` of shapes, from the series of e^{i theta2} of each bucket; parameters of `make_trees`.

    Returns
    -------
    dict
        Law: every type is in each interval once.
    """
    order = np.repeat(np.arange(3, storey.terms + 1), 2)
    weight = np.sqrt(5 / (2 * order + 1)) / _STEP

    def source(every: int) -> Iterator[Points]:
        for bucket, known in zip(buckets, phasors):
            yield from _entries(storey, bucket, known, every, go_on)

    count = storey.places * sum(len(bucket.rows) for bucket in buckets)
    return make_trees(source, 1, count, weight, new, folder, go_on)


def _entries(
    storey: Storey, bucket: Bucket, known: Phasors, every: int, go_on: Callable[[], None]
) -> Iterator[Points]:
    """The entries of every so-many-th type of a bucket."""
    expansion = PhasorExpansion(known.reach, storey.centres, storey.half_width, storey.terms)
    step = every * max(1, _AT_ONCE // expansion.width)
    for first in range(0, len(bucket.rows), step):
        go_on()
        part = slice(first, first + step, every)
        shapes, rest = expansion.shapes(np.asarray(known.series[part]), np.asarray(known.error[part]))
        unknown = ~((rest <= _LARGEST_REST) & (np.abs(shapes).max(axis=-1) <= _LARGEST_REST))
        shapes[unknown], rest[unknown] = 0, _UNKNOWN
        values = np.ascontiguousarray(shapes).view(float).astype(np.float32)
        numbers = numbers_of(storey, np.asarray(bucket.rows[part]))
        yield Points(0, numbers.ravel(), values.reshape(numbers.size, -1), upwards(rest.ravel()))
