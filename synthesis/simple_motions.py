"""Motions that need no linkage: a hinge makes a turn about a fixed point, and a straight guide makes a straight shift."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.limits import REACH
from synthesis.target import Samples

WITHIN = 1e-3
"""Default of the largest distance of a position from the motion of the hinge or guide, as a fraction of the extent."""
_POSES, _POINTS = 3, 4
"""Smallest numbers of poses and of points that can contradict a hinge: a hinge always fits two poses, or three points.
"""
_NO_TURN = np.deg2rad(0.1)
"""Largest turn of a body that counts as shifted only."""


class Hinge(NamedTuple):
    """A fixed point about which a motion turns, and the largest distance of a position from its circle."""

    centre: complex
    radius: float
    error: float


def hinge_of(samples: Samples, allowed: float | None = None, min_poses: int = _POSES) -> Hinge | None:
    """Find the hinge that makes a motion without a linkage.

    With rotations the positions belong to a point of the body, ``p = centre + arm e^{i rotation}``, which is linear
    in centre and arm. Without rotations they must follow in order on a circle.

    Parameters
    ----------
    samples : Samples
        The motion. Samples without a position are left out, and samples without a rotation if other samples have a rotation.
    allowed : float, optional
        Largest distance of a position from the hinge's motion. Default: `WITHIN` of the extent.
    min_poses : int, optional
        Smallest number of poses for which a hinge is returned. Default: 3, since two poses always fit a hinge.

    Returns
    -------
    Hinge or None
        None if no hinge makes the motion, or the centre is farther away than practical limits allow.
    """
    if samples.position is None:
        return None
    position, rotation = _complete_samples(samples)
    found = _circle(position) if rotation is None else _turning(position, rotation, min_poses)
    if found is None or found.error > (WITHIN * samples.extent if allowed is None else allowed):
        return None
    return found if abs(found.centre - samples.middle) <= REACH * samples.extent else None


def straight_guide_error(samples: Samples, allowed: float | None = None) -> float | None:
    """Measure how well a straight guide makes a motion without a linkage.

    Parameters
    ----------
    samples : Samples
        The motion; incomplete samples are left out.
    allowed : float, optional
        Largest distance of a position from the line. Default: `WITHIN` of the extent.

    Returns
    -------
    float or None
        Largest distance of a position from the line; None if the body turns, has fewer than three poses, or leaves
        the line.
    """
    if samples.position is None or samples.rotation is None:
        return None
    position, rotation = _complete_samples(samples)
    if position.size < _POSES or rotation is None or np.ptp(rotation) > _NO_TURN:
        return None
    offset = position - position.mean()
    _, _, (direction, _) = np.linalg.svd(np.column_stack([offset.real, offset.imag]), full_matrices=False)
    error = float(np.abs(offset.imag * direction[0] - offset.real * direction[1]).max())
    return error if error <= (WITHIN * samples.extent if allowed is None else allowed) else None


def _complete_samples(samples: Samples) -> tuple[Complexes, Floats | None]:
    """Return positions and rotations of the samples that have both, or only positions if no rotation is given."""
    assert samples.position is not None
    known = np.isfinite(samples.position)
    for values, weights in (
        (samples.position, samples.position_weights),
        (samples.rotation, samples.rotation_weights),
    ):
        if values is not None:
            known &= np.isfinite(values) & (True if weights is None else weights > 0)
    return samples.position[known], None if samples.rotation is None else samples.rotation[known]


def _turning(position: Complexes, rotation: Floats, min_poses: int) -> Hinge | None:
    if position.size < min_poses or np.ptp(rotation) <= _NO_TURN:
        return None
    turn = np.exp(1j * rotation)
    rows = np.column_stack([np.ones(turn.size), turn])
    (centre, arm), *_ = np.linalg.lstsq(rows, position, rcond=None)
    return Hinge(complex(centre), float(abs(arm)), float(np.abs(rows @ np.array([centre, arm]) - position).max()))


def _circle(position: Complexes) -> Hinge | None:
    if position.size < _POINTS:
        return None
    # |p|^2 = 2 Re(conj(c) p) + radius^2 - |c|^2, measured from the middle
    middle = position.mean()
    off = position - middle
    rows = np.column_stack([2 * off.real, 2 * off.imag, np.ones(off.size)])
    (x, y, constant), *_, rank, _ = (*np.linalg.lstsq(rows, np.abs(off) ** 2, rcond=1e-9),)
    if rank < 3:
        return None
    centre = complex(x, y)
    radius = float(np.sqrt(constant + abs(centre) ** 2))
    steps = np.angle((off[1:] - centre) / (off[:-1] - centre))
    if not (np.all(steps > 0) or np.all(steps < 0)):
        return None
    return Hinge(centre + complex(middle), radius, float(np.abs(np.abs(off - centre) - radius).max()))
