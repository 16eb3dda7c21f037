"""A knee (toggle) that locks a linkage at one end of its motion.

Its strut of two links u + v between G and q is placed like an actuator. It is straight just before that end and there, on a
stop, bent to the other side by the over-centre angle delta, with the length
``(u + v) sqrt(1 - 4 k (1 - k) sin^2(delta / 2))``, k = u / (u + v). A load that compresses the strut then presses it onto the
stop. The linkage moves slightly beyond its end while the knee passes the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import Actuator, Placement, PlacementLimits, Refusal, Sizes
from synthesis.link_motion import LinkMotion
from synthesis.triangle import angle_at
from synthesis.work import Work


@dataclass(frozen=True)
class Knee:
    """A strut of two links, placed, at the n positions of the motion."""

    placement: Placement
    handle: float
    """Length of the link at the ground point."""
    strut: float
    """Length of the link at the pin."""
    knee: Complexes
    """Joint of both links, (n,); at the locked end it is beyond the line."""
    overshoot: float
    """Travel of the drive beyond its end while the knee passes the line, to first order."""
    handle_torque: Floats
    """Torque on the handle, (n,), counter-clockwise; at the locked end the stop carries it."""
    holds: bool
    """True if the load presses the knee onto its stop."""


def place_knee(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    limits: PlacementLimits,
    locks_last: bool,
    over_centre: float,
    handle_fraction: float,
    work: Work,
) -> Knee | Refusal:
    """Return the knee with the smallest force along it whose handle does not turn back, or why there is none.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link relative to the ground, at n positions.
    at, torque : ndarray, shape (n,)
        Drive parameter, and torque that the drive must give.
    limits : PlacementLimits
    locks_last : bool
        The knee locks the last position, or else the first.
    over_centre : float
        Angle by which the locked knee is bent beyond the line, in radians.
    handle_fraction : float
        Length of the handle divided by the length of both links.
    work : Work
    """
    search = PlacementSearch(link, at, torque, limits._replace(extends=locks_last))
    sizes = Sizes(Actuator(search.size, search.size), True, True)
    starts = search.screen_sizes(sizes, work)
    if isinstance(starts, Refusal):
        return starts
    knees = (
        _bend(search, search.restart_from(placement, sizes), over_centre, handle_fraction)
        for placement in search.descents(starts, sizes, work)
    )
    first = next(knees, None)
    if first is None:
        return starts.shortfall or Refusal("arm", 0.0)
    return first if isinstance(first, Knee) else next((knee for knee in knees if isinstance(knee, Knee)), first)


def _bend(
    search: PlacementSearch, placement: Placement, over_centre: float, handle_fraction: float
) -> Knee | Refusal:
    """Bend a placement to the better side; refuse it if the handle turns back on both sides."""
    link, at, torque, end = search.link, search.at, search.torque, -1 if placement.extends else 0
    length = placement.length
    shortening = np.sqrt(1 - 4 * handle_fraction * (1 - handle_fraction) * np.sin(over_centre / 2) ** 2)
    straight = float(length[end] / shortening)
    handle, strut = handle_fraction * straight, (1 - handle_fraction) * straight
    pin, speed = link.position(placement.pin), link.speed(placement.pin)
    angle = angle_at(handle, strut, length)
    angle[end] = -angle[end]
    bends = []
    for side in (1, -1):
        knee = placement.ground + handle * (pin - placement.ground) / length * np.exp(1j * side * angle)
        rod = (pin - knee) / strut
        arm = np.real(np.conj(rod) * speed)
        with np.errstate(divide="ignore", invalid="ignore"):
            handle_torque = torque / arm * np.real(np.conj(rod) * 1j * (knee - placement.ground))
        # the handle turns back if the strut's arm changes sign: prefer a side without that, then the smaller torque
        turns_back, peak = arm * arm[end] <= 0, float(np.abs(handle_torque).max())
        rank = bool(turns_back.any()), peak, -float(np.abs(arm).min()), side
        bends.append((rank, knee, handle_torque, turns_back))
    rank, knee, handle_torque, turns_back = min(bends, key=lambda bend: bend[0])
    if rank[0]:
        return Refusal("knee", float(at[np.argmax(turns_back)]))
    overshoot = float((straight - length[end]) / abs(placement.arm[end]))
    return Knee(placement, handle, strut, knee, overshoot, handle_torque, bool(placement.force[end] > 0))
