"""Poses of a machine's links over its drive's interval, with derivatives, and the torque that a load asks of the drive.

Everything is given at n even values of one parameter, the drive's: for a four-bar the crank angle. Derivatives are by that
parameter, so a torque here times the parameter's rate is a power, and a moment arm is a length per radian of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.guides import Circle
from synthesis.linkage import BODY, Linkage, LinkMotion
from synthesis.one_variable import closer_looks
from synthesis.studies.forces import Load
from synthesis.target import Interval

SAMPLES = 61
"""Positions over the interval at which forces and arms are looked at."""
_TOPS, _LOOKS = 3, (9, 9, 9, 9)
"""Peaks that are looked at between places, and how often, at how many nodes."""
GROUND = "ground"


@dataclass(frozen=True)
class LinkMotions:
    """A linkage over its drive's interval, (n,) positions: its moving links by name, the body's among them as ``body``.

    ``at`` (n,): the drive's parameter, from the first sample on. ``drive``: what it is the angle, or the place, of.
    """

    at: Floats
    links: dict[str, LinkMotion]
    body: LinkMotion | None
    drive: str = "crank"
    extent: float = 1.0
    """A length of the machine's size."""
    reaches: dict[str, float] = field(default_factory=dict)
    """How far each link goes from its frame's origin to its joints and, of the coupler, to the body point."""
    middles: dict[str, complex] = field(default_factory=dict)
    """The middle between the two joints of a link, in its frame."""

    @property
    def sense(self) -> float:
        """Which way the parameter runs: 1 or -1."""
        return 1.0 if self.at[-1] >= self.at[0] else -1.0

    @property
    def turns(self) -> bool:
        """Whether the parameter is an angle."""
        return self.drive not in ("slider", "cylinder")

    @property
    def span(self) -> float:
        """How far it runs."""
        return float(abs(self.at[-1] - self.at[0]))

    def link(self, name: str) -> LinkMotion:
        """A link, or the body."""
        if name == "body":
            assert self.body is not None
            return self.body
        return self.links[name]

    def seen(self, name: str, on: str) -> LinkMotion:
        """A link as an observer on the ground, or on another link, has it."""
        return self.link(name) if on == GROUND else self.link(name).seen_from(self.link(on))

    def end(self, name: str, point: complex) -> Complexes:
        """Where a point goes that is told in a link's frame, of the ground in the plane, (n,)."""
        return np.full(self.at.size, point, dtype=complex) if name == GROUND else self.link(name).place(point)

    def point_on(self, name: str, place: complex) -> complex:
        """The point, as of `end`, that lies at a place of the plane at the first sample."""
        return place if name == GROUND else self.link(name).point_at(place)

    def torque(self, load: Load) -> Floats:
        """What the drive must give, (n,): force times length per radian of the parameter.

        Law: minus the power of the load per unit of the parameter's rate, inertia counted as a load.
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
    """The least and the largest of places of a drive, from the end that is nearer to the first one."""
    low, high = float(np.min(at)), float(np.max(at))
    return Interval(low, high) if abs(at[0] - low) <= abs(at[0] - high) else Interval(high, low)


def largest(of: Callable[[Floats], Floats], at: Floats) -> float:
    """The largest value of a smooth function over places (n,), at them and between: where one is larger than its neighbours.

    ``of``: values (m,) at places (m,). Law: with places so close that one peak lies between two of them, to rounding.
    """
    values = np.nan_to_num(of(at), nan=-np.inf)
    before, after = np.append(-np.inf, values[:-1]), np.append(values[1:], -np.inf)
    tops = np.flatnonzero((values >= before) & (values >= after))
    tops = tops[np.argsort(-values[tops])[:_TOPS]]
    low, high = at[np.maximum(tops - 1, 0)], at[np.minimum(tops + 1, at.size - 1)]
    least, _ = closer_looks(
        lambda looks: -of(np.asarray(looks.ravel(), dtype=float)).reshape(looks.shape), low, high, _LOOKS
    )
    return float(max(values.max(), -np.nanmin(least)))


def motions_of(linkage: Linkage, interval: Interval, samples: int = SAMPLES) -> LinkMotions:
    """A linkage between two places of its drive from the first sample, at even steps; see `motions_at`."""
    return motions_at(linkage, np.linspace(*interval, samples))


def motions_at(linkage: Linkage, at: Floats) -> LinkMotions:
    """A linkage at places (n,) of its drive from the first sample; NaN where it does not close or is dead.

    Frames of a four-bar: the crank's from pivot A, the coupler's from the crank pin and the rocker's from pivot B, each along
    its link; the body's from the body point, turned by the body's rotation. Of a body on two guides they are those of
    `Linkage.motions`, the coupler's is the body's; a link on a circle, and the block of a slot, turn about fixed pivots.
    """
    first, body, second = linkage.motions(at)
    pin = linkage.on_body(0j)
    coupler = replace(
        body,
        origin=body.place(pin),
        angle=body.angle - (linkage.body_offset or 0.0),
        velocity=body.speed(pin),
        acceleration=body.change(pin),
    )
    links = {one.name: one for one in (first, coupler, second)}
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
    way = float(max(np.ptp(one.origin.real) + np.ptp(one.origin.imag) for one in links))
    sizes = [guide.radius for guide in linkage.guides if isinstance(guide, Circle)]
    return max(way, *sizes, *(abs(guide.body_point) for guide in linkage.guides), 1e-300)


def hinged_at(pivot: complex, start: float, length: float, at: Floats) -> LinkMotions:
    """A link on a hinge that is the body itself, its body point at its end: a flap, a wiper, a boom; at angles (n,)."""
    ones, still, end = np.ones(at.size), np.zeros(at.size, dtype=complex), complex(length)
    rocker = LinkMotion("rocker", pivot + still, start + at, still, ones, still, 0 * ones, pivot)
    body = LinkMotion("body", rocker.place(end), start + at, rocker.speed(end), ones, rocker.change(end), 0 * ones)
    return LinkMotions(at, {"rocker": rocker}, body, "rocker", length, {"rocker": length}, {"rocker": end / 2})
