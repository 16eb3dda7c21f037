"""Poses of a machine's links over its drive's interval, with derivatives, and the torque that a load requires of the drive.

All quantities are given at n even values of one parameter, the drive's: for a four-bar the crank angle. Derivatives are by that
parameter, so a torque times the parameter's rate is a power, and a moment arm is a length per radian of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.guides import Circle
from synthesis.link_motion import LinkMotion
from synthesis.linkage import BODY, Linkage
from synthesis.one_variable import closer_looks
from synthesis.studies.forces import Load
from synthesis.target import Interval

SAMPLES = 61
"""Number of positions over the interval at which forces and arms are computed."""
_PEAKS = 3
"""Number of peaks that are refined between positions."""
_REFINEMENTS = (9, 9, 9, 9)
"""Number of nodes of each refinement of a peak."""
GROUND = "ground"


@dataclass(frozen=True)
class LinkMotions:
    """Motion of a linkage over its drive's interval, at n positions."""

    at: Floats
    """Drive parameter at each position, (n,), counted from the first sample."""
    links: dict[str, LinkMotion]
    """Moving links by name."""
    body: LinkMotion | None
    """Body that the linkage moves; None if it has none."""
    drive: str = "crank"
    """Link or part whose angle or displacement is the drive parameter."""
    extent: float = 1.0
    """Length that characterizes the machine's size."""
    reaches: dict[str, float] = field(default_factory=dict)
    """Largest distance of each link's joints, and of the body point of the coupler, from the origin of its frame."""
    middles: dict[str, complex] = field(default_factory=dict)
    """Midpoint of the two joints of a link, in its frame."""

    @property
    def pivots(self) -> list[complex]:
        """Fixed pivots of the links."""
        return [link.pivot for link in self.links.values() if link.pivot is not None]

    @property
    def sense(self) -> float:
        """Direction of the drive parameter: 1 if it grows, -1 if it falls."""
        return 1.0 if self.at[-1] >= self.at[0] else -1.0

    @property
    def turns(self) -> bool:
        """True if the drive parameter is an angle."""
        return self.drive not in ("slider", "cylinder")

    @property
    def span(self) -> float:
        """Absolute change of the drive parameter over the interval."""
        return float(abs(self.at[-1] - self.at[0]))

    def link(self, name: str) -> LinkMotion:
        """Return the motion of a link, or of the body."""
        if name == "body":
            assert self.body is not None
            return self.body
        return self.links[name]

    def seen(self, name: str, on: str) -> LinkMotion:
        """Return the motion of a link relative to another link, or to the ground."""
        return self.link(name) if on == GROUND else self.link(name).seen_from(self.link(on))

    def end(self, name: str, point: complex) -> Complexes:
        """Return the path (n,) of a point that is given in a link's frame; for the ground in the plane."""
        return np.full(self.at.size, point, dtype=complex) if name == GROUND else self.link(name).position(point)

    def point_on(self, name: str, position: complex) -> complex:
        """Return the point of a link, in its frame, that lies at a position of the plane at the first sample."""
        return position if name == GROUND else self.link(name).point_at(position)

    def torque(self, load: Load) -> Floats:
        """Return the torque that the drive must give, (n,), a force times a length per radian of the parameter.

        It is minus the power of the load per unit of the parameter's rate, with inertia counted as a load.
        """
        torque = np.zeros(self.at.size)
        if self.body is not None:
            torque -= dot(load.force, self.body.speed(0j)) + load.torque * self.body.rate
        for acting in load.forces:
            torque -= dot(acting.force, self.link(acting.link).speed(acting.at))
        for mass in load.masses:
            link = self.link(mass.link)
            torque -= mass.mass * dot(load.gravity, link.speed(mass.at))
            if load.speed:
                inertial = mass.mass * dot(link.change(mass.at), link.speed(mass.at))
                torque += load.metre * load.speed**2 * (inertial + mass.inertia * link.rate_change * link.rate)
        return torque


def ends_of(at: Floats) -> Interval:
    """Return the smallest and the largest coordinate of a drive, starting with the end that is nearer to the first position."""
    low, high = float(np.min(at)), float(np.max(at))
    return Interval(low, high) if abs(at[0] - low) <= abs(at[0] - high) else Interval(high, low)


def largest(function: Callable[[Floats], Floats], at: Floats) -> float:
    """Return the maximum of a smooth function over an interval, at given positions and between them.

    The maximum is correct up to rounding if the positions are so dense that no two peaks lie between neighbours.

    Parameters
    ----------
    function : callable
        Return the values (m,) at positions (m,).
    at : ndarray, shape (n,)
        Positions.
    """
    values = np.nan_to_num(function(at), nan=-np.inf)
    before, after = np.append(-np.inf, values[:-1]), np.append(values[1:], -np.inf)
    peaks = np.flatnonzero((values >= before) & (values >= after))
    peaks = peaks[np.argsort(-values[peaks])[:_PEAKS]]
    low, high = at[np.maximum(peaks - 1, 0)], at[np.minimum(peaks + 1, at.size - 1)]
    minima, _ = closer_looks(
        lambda nodes: -function(np.asarray(nodes.ravel(), dtype=float)).reshape(nodes.shape), low, high, _REFINEMENTS
    )
    return float(max(values.max(), -np.nanmin(minima)))


def motions_of(linkage: Linkage, interval: Interval, samples: int = SAMPLES) -> LinkMotions:
    """Return the motion of a linkage between two coordinates of its drive, counted from the first sample; see `motions_at`."""
    return motions_at(linkage, np.linspace(*interval, samples))


def motions_at(linkage: Linkage, at: Floats) -> LinkMotions:
    """Return the motion of a linkage at given coordinates of its drive; NaN if it does not close or is at a dead position.

    The frames of a four-bar lie along its links: the crank's starts at pivot A, the coupler's at the crank pin and the
    rocker's at pivot B. The body's frame has its origin at the body point and turns with the body. For the frames of a body
    on two guides see `Linkage.motions`; there the coupler's frame is the body's frame, and a link on a circle and the block
    of a slot turn about fixed pivots.

    Parameters
    ----------
    linkage : Linkage
    at : ndarray, shape (n,)
        Coordinates of the drive, counted from the first sample.
    """
    first, body, second = linkage.motions(at)
    pin = linkage.on_body(0j)
    coupler = replace(
        body,
        origin=body.position(pin),
        angle=body.angle - (linkage.body_offset or 0.0),
        velocity=body.speed(pin),
        acceleration=body.change(pin),
    )
    links = {motion.name: motion for motion in (first, coupler, second)}
    extent = _extent(linkage, links.values())
    reaches, middles = dict.fromkeys(links, extent), {}
    for name, guide in linkage.named_guides:
        if isinstance(guide, Circle):
            reaches[name], middles[name] = guide.radius, guide.radius / 2 + 0j
    if linkage.is_four_bar:
        reaches[BODY], middles[BODY] = max(linkage.links[1], abs(linkage.arm)), linkage.links[1] / 2 + 0j
    carried = replace(body, name="body") if linkage.mounted else None
    return LinkMotions(at, links, carried, linkage.driver.value, extent, reaches, middles)


def _extent(linkage: Linkage, links: Iterable[LinkMotion]) -> float:
    if linkage.is_four_bar:
        return max(*linkage.links, abs(linkage.arm))
    path = float(max(np.ptp(link.origin.real) + np.ptp(link.origin.imag) for link in links))
    sizes = [guide.radius for guide in linkage.guides if isinstance(guide, Circle)]
    return max(path, *sizes, *(abs(guide.body_point) for guide in linkage.guides), 1e-300)


def hinged_at(pivot: complex, start: float, length: float, at: Floats) -> LinkMotions:
    """Return the motion of a single hinged link that is the body, for example a flap, a wiper or a boom.

    Parameters
    ----------
    pivot : complex
        Position of the hinge.
    start : float
        Direction of the link at angle 0, in radians.
    length : float
        Distance of the body point from the hinge.
    at : ndarray, shape (n,)
        Angles by which the link is turned, in radians.
    """
    ones, zeros, tip = np.ones(at.size), np.zeros(at.size, dtype=complex), complex(length)
    rocker = LinkMotion("rocker", pivot + zeros, start + at, zeros, ones, zeros, 0 * ones, pivot)
    body = LinkMotion("body", rocker.position(tip), start + at, rocker.speed(tip), ones, rocker.change(tip), 0 * ones)
    return LinkMotions(
        at,
        {"rocker": rocker},
        body,
        drive="rocker",
        extent=length,
        reaches={"rocker": length},
        middles={"rocker": tip / 2},
    )
