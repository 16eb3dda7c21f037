"""Motions that a single hinge makes: a body, or a point, that only turns about a fixed point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.limits import REACH
from synthesis.target import Samples

WITHIN = 1e-3
"""Largest distance of a position from the hinge's motion, as a fraction of the motion's extent, if no tolerances are given."""
_POSES, _POINTS = 3, 4
"""Smallest numbers of poses and of points that can contradict a hinge: two poses, and three points, always fit one."""
_TURN = np.deg2rad(1.0)
"""A body that turns by less is taken to be shifted."""


class Hinge(NamedTuple):
    """A fixed point about which a motion turns, and the largest distance of a position from its circle."""

    centre: complex
    radius: float
    error: float


def hinge_of(samples: Samples, allowed: float | None = None) -> Hinge | None:
    """Find the hinge that makes a motion by itself.

    With rotations the positions belong to a point of the body, ``p = centre + arm e^{i rotation}``: linear in centre and arm.
    Without rotations they lie on a circle, in turn along it.

    Parameters
    ----------
    samples : Samples
        The motion; samples without a position, or without a rotation where the motion has some, are left out.
    allowed : float, optional
        Largest distance of a position from the hinge's motion. Default: `WITHIN` of the extent.

    Returns
    -------
    Hinge or None
        None if no hinge makes the motion, or the centre is farther than practical limits allow.
    """
    if samples.position is None:
        return None
    position, rotation = samples.position, samples.rotation
    given = np.isfinite(position)
    for values, weights in ((position, samples.position_weights), (rotation, samples.rotation_weights)):
        if values is not None:
            given &= np.isfinite(values) & (True if weights is None else weights > 0)
    if rotation is None:
        found = _circle(position[given])
    else:
        found = _turning(position[given], rotation[given])
    if found is None or found.error > (WITHIN * samples.extent if allowed is None else allowed):
        return None
    return found if abs(found.centre - samples.middle) <= REACH * samples.extent else None


def _turning(position: Complexes, rotation: Floats) -> Hinge | None:
    if position.size < _POSES or np.ptp(rotation) < _TURN:
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
    (x, y, rest), *_, rank, _ = (*np.linalg.lstsq(rows, np.abs(off) ** 2, rcond=1e-9),)
    if rank < 3:
        return None
    centre = complex(x, y)
    radius = float(np.sqrt(rest + abs(centre) ** 2))
    steps = np.angle((off[1:] - centre) / (off[:-1] - centre))
    if not (np.all(steps > 0) or np.all(steps < 0)):
        return None
    return Hinge(centre + complex(middle), radius, float(np.abs(np.abs(off - centre) - radius).max()))
