"""Poses given as two points of the body: position and direction, and a check that the points keep their distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import column
from synthesis.arrays import Complexes
from synthesis.errors import FieldError

ROUNDING = 5e-3
"""Relative difference of two distances that is taken as rounding of drawn or measured numbers."""
_NOTED = 1e-3
"""Relative difference of distances above which a note mentions it."""


def check_distances(vectors: Complexes, error: Callable[[int, str], FieldError]) -> str | None:
    """Check that the vectors (n,) between two points of a rigid body have the same length; missing vectors are NaN.

    Each length is compared with the median. ``error(index, message)`` makes the `FieldError` of a row. A variation that is taken
    as rounding is not refused, but returned as a note if it is large enough to be noticed.
    """
    lengths = np.abs(vectors)
    if np.isnan(lengths).all():
        return None
    usual = float(np.nanmedian(lengths))
    index = int(np.nanargmax(np.abs(lengths - usual)))
    length, deviation = float(lengths[index]), float(abs(lengths[index] - usual))
    percentage = f"{100 * deviation / usual:.2g} %" if usual else ""
    if usual == 0 or deviation > ROUNDING * usual:
        side = "more" if length > usual else "less"
        beside = f" ({percentage})" if usual else ""
        raise error(
            index,
            f"the two points are {length:.4g} apart, {deviation:.3g}{beside} {side} than {usual:.4g} "
            f"as usual: two points of a rigid body keep their distance, and only {100 * ROUNDING:g} % is taken as rounding",
        )
    if deviation <= _NOTED * usual:
        return None
    return f"the distance of the two points varies by {percentage}, which is taken as rounding"


def poses_of_points(points: ArrayLike, degrees: bool) -> tuple[list[float], list[list[float]], list[str]]:
    """Return continuous rotations, positions and notes of two points, rows [x1, y1, x2, y2].

    The position belongs to the first point, and the rotation is the direction to the second.

    Raises
    ------
    FieldError
        Of the field ``points``, with the row.
    """
    rows = column("points", points)
    if rows.ndim != 2 or rows.shape[1] != 4:
        raise FieldError("/points", "must be rows [x1, y1, x2, y2] of two points of the body")
    if not np.isfinite(rows).all():
        index = int(np.argmin(np.isfinite(rows).all(axis=1)))
        raise FieldError(f"/points/{index}", "must be four finite numbers [x1, y1, x2, y2]")
    along = (rows[:, 2] - rows[:, 0]) + 1j * (rows[:, 3] - rows[:, 1])
    note = check_distances(along, lambda index, message: FieldError(f"/points/{index}", message))
    angle = np.unwrap(np.angle(along))
    rotation = np.rad2deg(angle) if degrees else angle
    return rotation.tolist(), rows[:, :2].tolist(), [] if note is None else [note]
