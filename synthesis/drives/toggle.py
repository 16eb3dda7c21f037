"""A knee that locks a linkage at one end of its way: two links in a line, and a little beyond, that hold a load without power.

A strut of two links u + v between a point O and a pin of the linkage is straight just before the end of the way and bent by the
over-centre angle delta the other way at the end, where it rests on a stop; its length there is
``(u + v) sqrt(1 - 4 k (1 - k) sin^2(delta / 2))``, k = u / (u + v). A load that pushes the strut together then presses it onto
the stop. The linkage goes beyond its end by a little while the knee passes the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.actuator import Actuator, Placement, Question, Refused, Sizes, Wanted
from synthesis.guided.linkage import LinkMotion
from synthesis.work import Work


@dataclass(frozen=True)
class Knee:
    """A strut of two links in its place, at the n positions of the way."""

    placement: Placement
    handle: float
    """Length of the link at O."""
    strut: float
    """Length of the link at the pin."""
    knee: Complexes
    """Where both meet, (n,); at the locked end beyond the line."""
    overshoot: float
    """By how much the drive's parameter goes beyond its end while the knee passes the line, to first order."""
    handle_torque: Floats
    """What a handle on the link at O must give, (n,), counter-clockwise; at the locked end what the stop bears."""
    holds: bool
    """Whether the load presses it onto its stop."""


def locked(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    wanted: Wanted,
    last: bool,
    over_centre: float,
    share: float,
    work: Work,
) -> Knee | Refused:
    """The knee with the least force along it that locks the last position, or the first."""
    question = Question(link, at, torque, wanted._replace(extends=last))
    size = question.size
    found = question.best_of_sizes(Sizes(Actuator(size, size), True, True), work)
    if isinstance(found, Refused):
        return found
    end = -1 if last else 0
    length = found.length
    whole = float(length[end] / np.sqrt(1 - 4 * share * (1 - share) * np.sin(over_centre / 2) ** 2))
    handle, strut = share * whole, (1 - share) * whole
    v = link.place(found.pin) - found.ground
    near = np.maximum((strut - (handle - length)) * (strut + (handle - length)), 0.0)
    far = np.maximum((handle + length - strut) * (handle + length + strut), 0.0)
    angle = 2 * np.arctan2(np.sqrt(near), np.sqrt(far))
    angle[end] = -angle[end]
    knee = found.ground + handle * v / length * np.exp(1j * angle)
    rod = (link.place(found.pin) - knee) / strut
    with np.errstate(divide="ignore", invalid="ignore"):
        force = torque / np.real(np.conj(rod) * link.speed(found.pin))
        turned = force * np.real(np.conj(rod) * 1j * (knee - found.ground))
    return Knee(
        found,
        handle,
        strut,
        knee,
        float((whole - length[end]) / abs(found.arm[end])),
        turned,
        bool(found.force[end] > 0),
    )
