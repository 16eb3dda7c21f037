"""Poses given as two points of the body: position and direction, and a check that the points keep their distance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from statistics import median

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import column
from synthesis.errors import FieldError

ROUNDING = 5e-3
"""Relative difference of two distances that is taken as rounding of drawn or measured numbers."""
_REMARKED = 1e-3
"""Relative difference of distances above which a note mentions it."""
Vector = tuple[float, float]


def check_distances(along: Sequence[Vector | None], error: Callable[[int, str], FieldError]) -> str | None:
    """Check that the vectors between two points have the same length, and return a note if they vary a little.

    ``error(index, message)`` makes the `FieldError` of a row.
    """
    lengths = {index: math.hypot(*vector) for index, vector in enumerate(along) if vector is not None}
    usual = median(lengths.values()) if lengths else 0.0
    gaps = {index: abs(length - usual) for index, length in lengths.items()}
    worst = max(gaps, key=lambda index: gaps[index], default=None)
    if worst is None:
        return None
    if usual == 0 or gaps[worst] > ROUNDING * usual:
        side = "more" if lengths[worst] > usual else "less"
        part = "" if usual == 0 else f" ({100 * gaps[worst] / usual:.2g} %)"
        raise error(
            worst,
            f"the two points are {lengths[worst]:.4g} apart, {gaps[worst]:.3g}{part} {side} than {usual:.4g} as usual: two "
            f"points of a rigid body keep their distance, and only {100 * ROUNDING:g} % is taken as rounding",
        )
    if gaps[worst] <= _REMARKED * usual:
        return None
    return f"the distance of the two points varies by {100 * gaps[worst] / usual:.2g} %, which is taken as rounding"


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
    along = rows[:, 2:] - rows[:, :2]
    note = check_distances(
        [(x, y) for x, y in along.tolist()], lambda index, message: FieldError(f"/points/{index}", message)
    )
    angle = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    rotation = np.rad2deg(angle) if degrees else angle
    return rotation.tolist(), rows[:, :2].tolist(), [] if note is None else [note]
