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

from collections.abc import Callable, Sequence

import numpy as np

from synthesis.atlas.legendre import PhasorExpansion
from synthesis.atlas.series import Bucket, Phasors
from synthesis.atlas.storeys import NO_ENTRY, Arrays, Storey, joined_trees, tree_of, upwards

PATH_STOREYS = (
    Storey(np.deg2rad(9.0), 30, 6, np.inf),
    Storey(np.deg2rad(25.0), 24, 7, np.inf),
    Storey(np.deg2rad(75.0), 24, 9, np.inf),
    Storey(np.deg2rad(160.0), 18, 16, np.inf),
    Storey(np.deg2rad(360.0), 12, 28, np.inf),
)
"""No window is kept by a part of its interval: what is left of those with a large rest is few."""
MOST_TYPES = 1 << 18
"""Larger atlases have no index of shapes: one storey is held in memory while it is made, up to 5 kB a type."""
_LARGEST_REST = 4.0
"""Rest over |a_2|, and size of a shape's number, beyond which nothing is known of an entry."""
_UNKNOWN = np.float32(1e6)
_STEP = 2.0**-12
"""Step of the finest cells of the order, in the rms of P_2."""
_AT_ONCE = 1 << 22


def build_path_storey(
    storey: Storey, buckets: Sequence[Bucket], phasors: Sequence[Phasors], go_on: Callable[[], None] = lambda: None
) -> Arrays:
    """The arrays of a `StoreyIndex` of shapes, from the series of e^{i theta2} of all types.

    Parameters
    ----------
    storey : Storey
    buckets : sequence of Bucket
    phasors : sequence of Phasors
        Of each bucket.
    go_on : callable
        Called between the steps; may raise to end the work.

    Returns
    -------
    dict
        Law: every type is in each interval once.
    """
    types = sum(len(bucket.rows) for bucket in buckets)
    count, size = types * storey.places, 2 * (storey.terms - 2)
    if count >= NO_ENTRY:
        raise ValueError(f"an index has at most {NO_ENTRY:,} entries, wanted {count:,}")
    values, rests = np.empty((count, size), np.float32), np.empty(count, np.float32)
    for bucket, known in zip(buckets, phasors):
        expansion = PhasorExpansion(known.reach, storey.centres, storey.half_width, storey.terms)
        at_once = max(1, _AT_ONCE // expansion.width)
        for first in range(0, len(bucket.rows), at_once):
            go_on()
            part = slice(first, first + at_once)
            shapes, rest = expansion.shapes(np.asarray(known.series[part]), np.asarray(known.error[part]))
            unknown = ~((rest <= _LARGEST_REST) & (np.abs(shapes).max(axis=-1) <= _LARGEST_REST))
            shapes[unknown], rest[unknown] = 0, _UNKNOWN
            at = np.asarray(bucket.rows[part])[:, None] * storey.places + np.arange(storey.places)
            values[at], rests[at] = np.ascontiguousarray(shapes).view(float), upwards(rest)
    order = np.repeat(np.arange(3, storey.terms + 1), 2)
    weight = np.sqrt(5 / (2 * order + 1)) / _STEP
    tree = tree_of(np.arange(count), values, rests, go_on, weight=weight)
    return joined_trees([tree], types)
