"""Springs of zero free length that balance a linkage in every position, in closed form.

The plane of motion is vertical. The potential of masses on a linkage is a sum of parts Re(U e) for links that turn with the
direction e: pendulums. A spring from s to p e on such a link gives -k Re(conj(s) p e), which cancels its part. A four-bar has
two pendulums, crank and rocker, because its coupler's direction is a combination of theirs; two springs balance it (Kuo,
Mechanism and Machine Theory 214, 106140, derived independently here). A body on guides has two pendulums as well: a crank about
its pivot, a block about its pin, and the body about the pin that a slider carries, which does not turn. If the guides include a
circle, or are two rails, these pendulums carry every weight. They do not carry a weight along the rail beside a slot or between
two slots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.springs import Spring, SpringRow
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage

_LEFT = 1e-9
"""Fraction of the largest torque that springs may leave because of rounding."""


@dataclass(frozen=True)
class _Pendulum:
    """A link that turns about a point of a neighbour, with the part Re(U e) of the potential that depends on its direction e."""

    between: tuple[str, str]
    pivot: complex
    """Pivot in the frame of the first link."""
    level: complex
    """Direction of the first link's frame, which does not turn."""
    joint: complex
    """Pivot in the frame of the second link."""
    arm: float
    """Distance from the pivot at which the spring acts."""
    direction: Complexes
    rate: Floats

    @property
    def rows(self) -> Floats:
        """Derivatives (n, 2) of Re(U e) by the drive, for the real and the imaginary part of U."""
        return np.column_stack([-self.direction.imag * self.rate, -self.direction.real * self.rate])

    def spring(self, part: complex, stiffness: float | None) -> Spring:
        """Return the spring that cancels Re(U e)."""
        rate = abs(part) / self.arm**2 if stiffness is None else stiffness
        end = self.pivot + np.conj(part / (rate * self.arm)) / self.level
        return Spring(self.between, (complex(end), self.joint + self.arm), SpringRow(None, float(rate)))


def _pendulums(linkage: Linkage | None, machine: LinkMotions) -> list[_Pendulum]:
    """Return the links on circles and a single link that turns with the body: a block, or otherwise the body on a slider.

    A hinged link without a linkage is a pendulum itself.
    """
    if linkage is None:
        arm, links = machine.extent / 2, machine.links.values()
        return [
            _Pendulum((GROUND, link.name), link.origin[0], 1 + 0j, 0j, arm, link.direction, link.rate)
            for link in links
        ]
    first, body, second = linkage.link_names
    found: list[_Pendulum] = []
    turning: list[_Pendulum] = []
    for guide, name in zip(linkage.guides, (first, second)):
        if isinstance(guide, Rail):
            link, level = machine.links[body], complex(machine.links[name].direction[0])
            turning.append(
                _Pendulum((name, body), 0j, level, guide.body_point, machine.extent / 4, link.direction, link.rate)
            )
            continue
        link = machine.links[name]
        pivot, arm = (guide.pivot, guide.radius) if isinstance(guide, Circle) else (guide.pin, machine.extent / 4)
        pendulum = _Pendulum((GROUND, name), complex(pivot), 1 + 0j, 0j, arm, link.direction, link.rate)
        if isinstance(guide, Circle):
            # the spring of a second crank acts on its midpoint
            found.append(replace(pendulum, arm=arm / (1 + len(found))))
        else:
            turning.insert(0, pendulum)
    return found + turning[:1]


def springs_on_pendulums(
    linkage: Linkage | None, machine: LinkMotions, torque: Floats, stiffness: float | None = None
) -> list[Spring] | None:
    """Return springs that balance the torque of the drive of a linkage; None if there are none.

    The coefficients of the potential follow from the torque by least squares; if the pendulums carry all of it, nothing remains.

    Parameters
    ----------
    linkage : Linkage or None
        None for a link on a hinge.
    machine : LinkMotions
    torque : ndarray, shape (n,)
        Torque that the drive must give.
    stiffness : float, optional
        Stiffness of all springs.
    """
    if not np.all(np.isfinite(torque)):
        return None
    pendulums = _pendulums(linkage, machine)
    rows = np.concatenate([pendulum.rows for pendulum in pendulums], axis=1)
    size = np.abs(rows).max()
    parts = np.linalg.lstsq(rows / size, torque / size, rcond=None)[0]
    largest = np.abs(torque).max()
    if np.abs(rows @ parts - torque).max() > _LEFT * largest:
        return None
    springs = []
    for pendulum, (real, imaginary) in zip(pendulums, parts.reshape(-1, 2)):
        part = complex(real, imaginary)
        if abs(part) * np.abs(pendulum.rate).max() > _LEFT * largest:
            springs.append(pendulum.spring(part, stiffness))
    return springs
