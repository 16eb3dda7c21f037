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
_NOTED = 1e-3
"""Relative difference of distances above which a note mentions it."""
Vector = tuple[float, float]


def check_distances(vectors: Sequence[Vector | None], error: Callable[[int, str], FieldError]) -> str | None:
    """Check that the vectors between two points of a rigid body have the same length.

    Each length is compared with the median. Missing vectors are None. ``error(index, message)`` makes the `FieldError` of a
    row. A variation that is taken as rounding is not refused, but returned as a note if it is large enough to be noticed.
    """
    lengths = {index: math.hypot(*vector) for index, vector in enumerate(vectors) if vector is not None}
    median_length = median(lengths.values()) if lengths else 0.0
    deviations = {index: abs(length - median_length) for index, length in lengths.items()}
    worst = max(deviations, key=lambda index: deviations[index], default=None)
    if worst is None:
        return None
    if median_length == 0 or deviations[worst] > ROUNDING * median_length:
        side = "more" if lengths[worst] > median_length else "less"
        percentage = "" if median_length == 0 else f" ({100 * deviations[worst] / median_length:.2g} %)"
        raise error(
            worst,
            f"the two points are {lengths[worst]:.4g} apart, {deviations[worst]:.3g}{percentage} {side} than {median_length:.4g} "
            f"as usual: two points of a rigid body keep their distance, and only {100 * ROUNDING:g} % is taken as rounding",
        )
    if deviations[worst] <= _NOTED * median_length:
        return None
    return f"the distance of the two points varies by {100 * deviations[worst] / median_length:.2g} %, which is taken as rounding"


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
