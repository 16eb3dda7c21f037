"""Planar linkage: a body on two guides, the first of which is driven; its dimensions and the motion of its links.

Each guide imposes a condition on the body: a *circle* (a body point on a crank or rocker), a *rail* (a body point on
a line of the ground), or a *slot* (a line of the body through a fixed pin). A four-bar has two circles. The first
guide is the driven guide:

=========  ======  =======================================================================================
driver     guide   coordinate q
=========  ======  =======================================================================================
crank      circle  direction of the line from pivot to body point, radians
slider     rail    position of the body point along the rail, from the rail's point
cylinder   slot    position of the pin along the slot, from the slot's body point
hinge      slot    direction of the slot in the plane, radians (the body turns as the drive does)
=========  ======  =======================================================================================

If the drive is locked, the body can still turn about a pin Z, which is the pin of the crank or slider, or the fixed
pin of the cylinder; if a hinge is locked, the body can slide along its slot. The other guide then pushes along a line
through X with direction f, and

    sin mu = cross(X - Z, f) / |X - Z|,   hinge:  sin mu = f . (direction of the slot).

Its sign is the branch, and its absolute value is the sine of the transmission angle. It vanishes at the dead
positions. It must be computed without cancellation: a loop closes if certain differences are not negative, for
example of a squared length and a square, or of a length and a projection. Each is written as a sum of terms that are
not negative wherever the drive moves freely, as in `four_bar`.

The pose of a body is its position P (complex) and its rotation gamma, R = e^{i gamma}; body points m are in the
body's frame: P + R m.

The dimensions are in the linkage's own frames, see `Linkage`. Therefore the lengths of a four-bar are stored
unchanged, and a large distance from the origin costs no accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.four_bar import FULL_CRANK, Family, family, wrap
from synthesis.guides import (
    DRIVERS,
    GUIDES,
    Circle,
    Condition,
    Driver,
    Guide,
    Kind,
    Rail,
    Round,
    Slot,
    Straight,
    Vector,
    mapped,
    positions_within,
)
from synthesis.link_motion import BodyPoses, BodyRates, LinkMotion
from synthesis.target import TURN, Interval
from synthesis.triangle import Triangle

BODY = "coupler"
"""Name of the link that is the body."""
Lengths = tuple[float, float, float, float]
"""Crank, coupler, rocker and ground of a four-bar."""


@dataclass(frozen=True)
class Linkage:
    """A body on two guides with actual lengths; angles in radians.

    Use `four_bar` to make a four-bar, and `on_guides` for all other kinds.

    Attributes
    ----------
    local_guides : tuple of Circle, Rail or Slot
        The guides in the linkage's own frames of ground and body. The first is driven. The frames of a four-bar begin
        at pivot A and at the crank pin, and lie along ground and coupler: its guides are Circle(0, crank, 0) and
        Circle(ground, rocker, coupler). Other linkages use the frames of the plane and of their motion.
    driver : Driver
        Drive of the first guide.
    branch : int
        The sign of sin mu, +1 or -1. With a hinge on the first of two slots the dimensions decide it. For a
        four-bar, +1
        has the coupler pin to the left of the line from the crank pin to pivot B.
    start : float
        Coordinate of the drive at the first sample of the motion, in the linkage's own frame of the ground: the crank
        angle of a four-bar is measured from its ground line.
    pivot_a, ground_angle : complex, float
        Origin and direction of the own frame of the ground in the plane.
    coupler_point_polar : tuple of float or None
        Radius and angle of the body point in the own frame of the body. None if the motion has no positions: then the
        linkage is not mounted.
    body_offset : float or None
        Rotation of the body less the rotation of its own frame, which lies in (-pi, pi] to the ground line at the
        first sample. None if the motion has no rotations.
    """

    local_guides: tuple[Guide, Guide]
    driver: Driver
    branch: int = 1
    start: float = 0.0
    pivot_a: complex = 0j
    ground_angle: float = 0.0
    coupler_point_polar: tuple[float, float] | None = (0.0, 0.0)
    body_offset: float | None = 0.0

    def __post_init__(self) -> None:
        driven, _ = self.local_guides
        if self.driver not in DRIVERS[type(driven)]:
            raise ValueError(f"driver: a {type(driven).__name__.lower()} has no {self.driver}")

    # -- kind and dimensions ----------------------------------------------------------------------------------------------

    @property
    def kind(self) -> Kind:
        """Pair of guides, in either order."""
        types = {type(guide) for guide in self.local_guides}
        return next(kind for kind, guides in GUIDES.items() if set(guides) == types)

    @property
    def is_four_bar(self) -> bool:
        """True if both guides are circles."""
        return isinstance(self.local_guides[0], Circle) and isinstance(self.local_guides[1], Circle)

    @property
    def mounted(self) -> bool:
        """True if it has a position in the user's plane."""
        return self.coupler_point_polar is not None

    @property
    def arm(self) -> complex:
        """Body point in the own frame of the body; 0 if there is none."""
        if self.coupler_point_polar is None:
            return 0j
        radius, angle = self.coupler_point_polar
        return complex(radius * np.exp(1j * angle))

    @cached_property
    def _in_place(self) -> bool:
        """True if its own frames are the frames of the plane and of the motion."""
        return not (self.pivot_a or self.ground_angle or self.arm or self.body_offset)

    @cached_property
    def guides(self) -> tuple[Guide, Guide]:
        """The guides in the plane and in the body frame of the motion."""
        if self._in_place:
            return self.local_guides
        along, arm, offset = np.exp(1j * self.ground_angle), self.arm, self.body_offset or 0.0
        back = np.exp(-1j * offset)
        first, second = (
            mapped(
                guide,
                lambda z: self.pivot_a + along * z,
                lambda z: (z - arm) * back,
                turn=self.ground_angle,
                turn_in_body=-offset,
            )
            for guide in self.local_guides
        )
        return first, second

    @property
    def period(self) -> float | None:
        """2 pi if the drive's coordinate is an angle, otherwise None."""
        return TURN if self.driver.turns else None

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the moving links: the link of the driven guide, the body, and the link of the other guide."""
        first, second = (_LINK_OF[type(guide)] for guide in self.local_guides)
        if first == second:
            second = "rocker" if first == "crank" else f"second_{second}"
        return first, BODY, second

    @property
    def named_guides(self) -> tuple[tuple[str, Guide], ...]:
        """Both guides with the names of their links."""
        return tuple(zip(self.link_names[::2], self.guides))

    @property
    def reach(self) -> float:
        """Length that measures the size, regardless of the position: the largest radius or distance of points."""
        first, second = self.local_guides
        radii = [guide.radius for guide in self.local_guides if isinstance(guide, Circle)]
        return max(*radii, abs(first.body_point - second.body_point), abs(first[0] - second[0]), 1e-300)

    @property
    def lengths(self) -> dict[str, float]:
        """Lengths by name: cranks and rockers, the coupler if both guides hold a body point, and the ground of a four-bar."""
        if self.is_four_bar:
            return dict(zip(("crank", "coupler", "rocker", "ground"), self.links))
        names = self.link_names[::2]
        found = {name: guide.radius for name, guide in zip(names, self.local_guides) if isinstance(guide, Circle)}
        points = [guide.body_point for guide in self.local_guides if guide.holds_point]
        return found | ({"coupler": abs(points[1] - points[0])} if len(points) == 2 else {})

    # -- properties of four-bars ------------------------------------------------------------------------------------------

    @property
    def links(self) -> Lengths:
        """Crank, coupler, rocker and ground of a four-bar; the ground is 1 if the motion has no positions."""
        crank, rocker = self.local_guides
        assert isinstance(crank, Circle) and isinstance(rocker, Circle)
        coupler, ground = abs(rocker.body_point - crank.body_point), abs(rocker.pivot - crank.pivot)
        return crank.radius, coupler, rocker.radius, ground

    @property
    def pivot_b(self) -> complex:
        """Fixed pivot of the rocker of a four-bar."""
        return complex(self.pivot_a + self.links[3] * np.exp(1j * self.ground_angle))

    @property
    def link_ratio(self) -> float:
        """The longest length over the shortest; 1 without lengths."""
        lengths = self.lengths.values()
        return float(max(lengths) / min(lengths)) if lengths and min(lengths) > 0 else 1.0

    @cached_property
    def family(self) -> Family | None:
        """Grashof family of a four-bar; None for other kinds."""
        return Family(family(np.array(self.links)).item()) if self.is_four_bar else None

    # -- other linkages derived from it -----------------------------------------------------------------------------------

    def scaled(self, scale: float) -> Linkage:
        """Return the linkage with all lengths scaled about the origin."""
        first, second = (
            mapped(guide, lambda z: z * scale, lambda z: z * scale, scale) for guide in self.local_guides
        )
        point = self.coupler_point_polar
        return replace(
            self,
            local_guides=(first, second),
            start=self.start if self.driver.turns else self.start * scale,
            pivot_a=self.pivot_a * scale,
            coupler_point_polar=None if point is None else (point[0] * scale, point[1]),
        )

    def moved(self, turn: float, shift: complex) -> Linkage:
        """Return the linkage turned about the origin, then shifted; the frame of the body moves with it."""
        return replace(
            self, pivot_a=complex(self.pivot_a * np.exp(1j * turn) + shift), ground_angle=self.ground_angle + turn
        )

    def mirrored(self) -> Linkage:
        """Return the mirror image about the x axis: positions, directions and rotations change the sign of y."""
        first, second = (
            mapped(guide, complex.conjugate, complex.conjugate, sense=-1.0) for guide in self.local_guides
        )
        # mirroring changes the sign of a cross product and of a normal
        flips = (self.driver is Driver.HINGE) != isinstance(second, Circle)
        start = -self.start if self.driver.turns else self.start
        point, offset = self.coupler_point_polar, self.body_offset
        return replace(
            self,
            local_guides=(first, second),
            branch=-self.branch if flips else self.branch,
            start=float(start % TURN) if self.is_four_bar else start,
            pivot_a=self.pivot_a.conjugate(),
            ground_angle=-self.ground_angle,
            coupler_point_polar=None if point is None else (point[0], -point[1]),
            body_offset=None if offset is None else -offset,
        )

    def turned_body(self, angle: float) -> Linkage:
        """Return the linkage with the frame turned in the body: rotations increase by the angle."""
        if self.is_four_bar:
            return replace(self, body_offset=(self.body_offset or 0.0) + angle)
        angle -= TURN * round(angle / TURN)
        factor = complex(np.exp(-1j * angle))
        first, second = (
            mapped(guide, lambda z: z, lambda z: z * factor, turn_in_body=-angle) for guide in self.local_guides
        )
        return replace(self, local_guides=(first, second))

    @property
    def by_coupler(self) -> Linkage:
        """Return the same linkage with the own frame of its body in place of the frame of the motion."""
        return replace(self, coupler_point_polar=(0.0, 0.0), body_offset=0.0)

    def on_body(self, point: complex) -> complex:
        """Convert a point from the own frame of the body to the frame of its motion."""
        return complex((point - self.arm) * np.exp(-1j * (self.body_offset or 0.0)))

    # -- the loop -----------------------------------------------------------------------------------------------------

    @cached_property
    def _pin(self) -> Vector:
        """Vector from the pin Z, about which the body turns while the drive is locked, to the origin; not for a hinge."""
        return self.local_guides[0].from_pin()

    @cached_property
    def _spread(self) -> Vector:
        """Vector from Z to the fixed point of the other guide: pivot, point or pin."""
        return self._pin.plus(self.local_guides[1][0])

    @cached_property
    def _arm(self) -> Vector:
        """Vector from Z to the body point of the other guide, in the frame of the body."""
        driven, second = self.local_guides
        vector = second.body_point - driven.body_point
        if isinstance(driven, Slot):
            return Straight(vector, driven.body_direction)
        return Vector(vector)

    @cached_property
    def _pushed(self) -> Round:
        """Vector of a hinge with a circle, whose component across the slot is the distance of the pivot from the slot."""
        driven, second = self.local_guides
        assert isinstance(driven, Slot)
        between = driven.pin - second[0]
        beside = _turned(second.body_point - driven.body_point, -driven.body_direction).imag
        return Round(_turned(1j * beside, float(np.angle(between))), abs(between))

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Functions that must not be negative for the loop to close; if any vanishes, both branches meet."""
        driven, second = self.local_guides
        if self.driver is Driver.HINGE:
            if not isinstance(second, Circle):
                return ()
            assert isinstance(driven, Slot)
            towards = float(np.angle(driven.pin - second.pivot))
            return tuple(self._pushed.across(towards, second.radius, sign) for sign in (1, -1))
        cylinder = self.driver is Driver.CYLINDER
        varying, still = (self._arm, self._spread) if cylinder else (self._spread, self._arm)
        assert isinstance(varying, Round | Straight)
        length = abs(still.middle)
        if isinstance(second, Circle):
            return varying.shorter_than(length, second.radius), varying.longer_than(length, second.radius)
        direction = second.direction if isinstance(second, Rail) else second.body_direction
        if cylinder == isinstance(second, Slot):  # project the vector that varies
            return tuple(varying.across(direction, length, sign) for sign in (1, -1))
        return (varying.longer_than(abs(_turned(still.middle, -direction).imag)),)

    def _closed(self, q: Floats) -> list[Floats]:
        """Return the values of the conditions; NaN if the loop does not close."""
        values = [condition.value(q) for condition in self.conditions]
        closed = np.ones(np.shape(q), dtype=bool)
        for value in values:
            closed &= value >= 0
        return [np.where(closed, value, np.nan) for value in values]

    def body(self, coordinate: ArrayLike, branch: int | None = None) -> BodyPoses:
        """Return the poses of the body in the plane at coordinates q (n,) of the drive.

        ``branch``: default is the branch of the linkage.

        Law: both guides hold to rounding at every pose, and ``configuration`` recovers the coordinate and sin mu.
        """
        q = np.atleast_1d(np.asarray(coordinate, dtype=float))
        found = self._poses(q, self.branch if branch is None else branch)
        position = found.position
        if not self._in_place:
            on_body = position + np.exp(1j * found.rotation) * self.arm
            position = self.pivot_a + np.exp(1j * self.ground_angle) * on_body
        return found._replace(position=position, rotation=found.rotation + self._turned_by)

    @cached_property
    def _turned_by(self) -> float:
        """Rotation of the body less the rotation of `_poses`."""
        at_start = float(self._poses(np.array([self.start]), self.branch).rotation[0])
        turns = np.nan_to_num(np.round((at_start - wrap(at_start)) / TURN))
        return float(self.ground_angle + (self.body_offset or 0.0) - TURN * turns)

    def _poses(self, q: Floats, side: int) -> BodyPoses:
        """Return the pose of the body's own frame in the own frame of the ground; rotations up to whole turns."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return self._by_hinge(q, side) if self.driver is Driver.HINGE else self._by_pin(q, side)

    def _by_pin(self, q: Floats, side: int) -> BodyPoses:
        """Turn the body about the pin Z until the other guide holds it."""
        second = self.local_guides[1]
        spread, arm = self._spread, self._arm
        if isinstance(second, Circle):
            triangle, length = self._triangle(q), np.abs(arm.at(q))
            rotation = spread.direction(q) + side * triangle.at_z - arm.direction(q)
            push = triangle.root / second.radius
            sine, angle = push / length, triangle.at_x
        else:
            root = np.prod([np.sqrt(value) for value in self._closed(q)], axis=0)
            projected, direction = (
                (spread, second.direction) if isinstance(second, Rail) else (arm, second.body_direction)
            )
            beside = np.imag(projected.at(q) * np.exp(-1j * direction))
            turned = np.arctan2(beside, root)
            turned = turned if side > 0 else math.pi - turned
            if isinstance(second, Rail):
                rotation = direction + turned - arm.direction(q)
                length = np.abs(arm.at(q))
            else:
                rotation = spread.direction(q) - turned - direction
                length = np.abs(spread.at(q))
            push = root
            sine, angle = root / length, np.arctan2(root, np.abs(beside))
        rotation = np.where(spread.at(q) != 0, rotation, np.nan)  # the direction is arbitrary at a change point
        position = -self._pin.at(q) - np.exp(1j * rotation) * self.local_guides[0].body_at(q)
        return BodyPoses(position, rotation, side * sine, push, angle)

    def _triangle(self, q: Floats) -> Triangle:
        """Return the triangle of the pin Z and the pivot and body point of the other guide."""
        second = self.local_guides[1]
        assert isinstance(second, Circle)
        distance, length = np.abs(self._spread.at(q)), np.abs(self._arm.at(q))
        if self.driver is not Driver.CYLINDER:
            return Triangle.of(distance, length, second.radius, *self._closed(q))
        found = Triangle.of(length, distance, second.radius, *self._closed(q))
        return found._replace(beyond=found.less_arm, less_arm=found.beyond)

    def _by_hinge(self, q: Floats, side: int) -> BodyPoses:
        """Slide the body along its slot until the other guide holds it."""
        driven = self.local_guides[0]
        assert isinstance(driven, Slot)
        rotation = q - driven.body_direction
        extension, sine, cosine = self._extension(q, side)
        position = driven.pin - np.exp(1j * rotation) * driven.body_at(extension)
        rotation, push = np.where(np.isfinite(sine), rotation, np.nan), np.abs(sine)
        return BodyPoses(position, rotation, sine, push, np.arctan2(push, np.abs(cosine)))

    def _extension(self, q: Floats, side: int) -> tuple[Floats, Floats, Floats]:
        """Return the pin's position along the slot of a hinge, and sine and cosine of the push against the slot."""
        driven, second = self.local_guides
        assert isinstance(driven, Slot)
        along = np.exp(1j * q)
        arm = _turned(second.body_point - driven.body_point, -driven.body_direction)
        between = driven.pin - second[0]
        if isinstance(second, Circle):
            upper, lower = self._closed(q)
            root = np.sqrt(upper) * np.sqrt(lower)
            free = np.conj(along) * between + arm
            return free.real - side * root, side * root / second.radius, free.imag / second.radius
        if isinstance(second, Rail):
            slope = np.sin(q - second.direction)
            beside = np.imag((between + arm * along) * np.exp(-1j * second.direction))
            sine = np.where(np.sign(slope) == side, slope, np.nan)
            return beside / sine, sine, np.cos(q - second.direction)
        tilt = second.body_direction - driven.body_direction
        turned = np.conj(along) * between + arm
        sine = np.full(q.shape, -math.sin(tilt))
        return np.imag(turned * np.exp(-1j * tilt)) / -math.sin(tilt), sine, np.full(q.shape, math.cos(tilt))

    # -- derivatives and links --------------------------------------------------------------------------------------------

    def rates(self, coordinate: ArrayLike) -> BodyRates:
        """Return first and second derivatives of the body's pose by the drive, at coordinates (n,).

        Law: they are the limits of difference quotients of `body`.
        """
        q = np.atleast_1d(np.asarray(coordinate, dtype=float))
        found = self._poses(q, self.branch)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            turning = self._rates(q, found)
            if not self._in_place:
                along, arm = np.exp(1j * self.ground_angle), np.exp(1j * found.rotation) * self.arm
                first, second = turning.rotation, turning.rotation_second
                turning = turning._replace(
                    position=along * (turning.position + 1j * first * arm),
                    position_second=along * (turning.position_second + (1j * second - first**2) * arm),
                )
        return BodyRates(*(np.where(np.isfinite(rate), rate, np.nan) for rate in turning))

    def _rates(self, q: Floats, found: BodyPoses) -> BodyRates:
        """Differentiate the conditions of both guides twice, in the own frames.

        With the drive locked, the body can still turn about the pin, or slide along the slot of a hinge; the other guide decides
        how much it does, divided by the signed arm of its push.
        """
        driven, other = self.local_guides
        turned, still, hinge = np.exp(1j * found.rotation), 0j * q, self.driver is Driver.HINGE
        held = driven.contact(found.position, turned) - found.position
        contact = other.contact(found.position, turned) - found.position
        push = other.push(found.position, turned)
        pin, pin_second, along = still, still, still
        if isinstance(driven, Circle):
            spoke = driven.radius * np.exp(1j * q)
            pin, pin_second = 1j * spoke, -spoke
        elif isinstance(driven, Rail):
            pin = still + np.exp(1j * driven.direction)
        else:
            along = turned * np.exp(1j * driven.body_direction)
        if hinge:
            begin, turn, moves, turns, lever = -1j * held, 1.0, -along, 0.0, -found.sine
        else:
            begin, turn, moves, turns = pin - along, 0.0, -1j * held, 1.0
            lever = np.copysign(found.arm, found.sine)
        lever = np.where(lever != 0, lever, np.nan)
        free = -dot(push, begin + 1j * turn * contact) / lever
        position, rotation = begin + free * moves, turn + turns * free
        second = pin_second + rotation**2 * held - 2j * rotation * along * (free if hinge else 1.0)
        arm = turned * other.body_point
        velocity, curved = position + 1j * rotation * arm, 0.0 * q
        if isinstance(other, Circle):
            curved = np.abs(velocity) ** 2 / other.radius
        elif isinstance(other, Slot):
            curved = -2 * rotation * dot(-1j * push, velocity)
        change = -(dot(push, second - rotation**2 * arm) + curved) / lever
        return BodyRates(position, rotation, second + change * moves, turns * change)

    def motions(self, travel: ArrayLike) -> tuple[LinkMotion, ...]:
        """Return the motions of the three moving links, in the order of `link_names`.

        Parameters
        ----------
        travel : array_like, shape (n,)
            Travel of the drive from the first sample, in radians or lengths.

        Returns
        -------
        tuple of three LinkMotion
            Derivatives are by the drive's coordinate.

        Notes
        -----
        The frames of the links are:

        * crank or rocker: at its pivot, towards its body point;
        * body: its own frame, at its position;
        * slider: at its body point, along the rail;
        * block: at its fixed pin, along the slot.

        Law: positions and directions agree with `body`, and rates are the limits of their difference quotients.
        """
        coordinate = self.start + np.atleast_1d(np.asarray(travel, dtype=float))
        poses, rates = self.body(coordinate), self.rates(coordinate)
        body = LinkMotion(
            BODY,
            poses.position,
            poses.rotation,
            rates.position,
            rates.rotation,
            rates.position_second,
            rates.rotation_second,
        )
        names = self.link_names
        with np.errstate(invalid="ignore", over="ignore"):
            return self._link(0, names[0], coordinate, body), body, self._link(1, names[2], coordinate, body)

    def _link(self, index: int, name: str, q: Floats, body: LinkMotion) -> LinkMotion:
        """Return the motion of the link of a guide."""
        guide = self.guides[index]
        closed = np.where(np.isfinite(body.angle), 1.0, np.nan)
        still = 0j * closed
        if isinstance(guide, Slot):
            angle = body.angle + guide.body_direction
            return LinkMotion(name, guide.pin * closed, angle, still, body.rate, still, body.rate_change, guide.pin)
        arm = body.direction * guide.body_point
        point, velocity = body.origin + arm, body.velocity + 1j * body.rate * arm
        change = body.acceleration + (1j * body.rate_change - body.rate**2) * arm
        if isinstance(guide, Rail):
            none = 0.0 * closed
            return LinkMotion(name, point, guide.direction * closed, velocity, none, change, none)
        pivot = guide.pivot * closed
        if index == 0:
            return LinkMotion(
                name, pivot, (q + self.ground_angle) * closed, still, closed, still, 0.0 * closed, guide.pivot
            )
        spoke = point - guide.pivot
        turn, spin = (cross(spoke, rate) / guide.radius**2 for rate in (velocity, change))
        return LinkMotion(
            name, pivot, self._rocker_direction(q) + self.ground_angle, still, turn, still, spin, guide.pivot
        )

    def _rocker_direction(self, q: Floats) -> Floats:
        """Return the direction of the other guide's radius, continuous in the drive's coordinate."""
        second = self.local_guides[1]
        assert isinstance(second, Circle)
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.driver is Driver.HINGE:
                _, sine, cosine = self._extension(q, self.branch)
                turned = np.arctan2(cosine, np.abs(sine))
                return q + (turned if self.branch > 0 else math.pi - turned)
            triangle = self._triangle(q)
            return self._spread.direction(q) + math.pi - self.branch * triangle.at_c

    def configuration(self, rotation: Floats, position: Complexes) -> tuple[Floats, Floats]:
        """Return the drive's coordinate and sin mu for poses (n,) that satisfy the guides, accurate to the last digit.

        Directions are in (-pi, pi].
        """
        driven, second = self.guides
        turned, level = np.exp(1j * rotation), np.exp(-1j * self.ground_angle)
        with np.errstate(invalid="ignore", divide="ignore"):
            push, contact = second.push(position, turned), second.contact(position, turned)
            if self.driver is Driver.HINGE:
                assert isinstance(driven, Slot)
                along = turned * np.exp(1j * driven.body_direction)
                return np.angle(level * along), dot(push, along)
            pin, coordinate = driven.contact(position, turned), driven.coordinate_of(position, turned)
            if self.driver is Driver.CRANK:
                coordinate = np.angle(level * (pin - driven[0]))
            return coordinate, cross(contact - pin, push) / np.abs(contact - pin)

    # -- over an interval ---------------------------------------------------------------------------------------------

    def closes_over(self, interval: Interval) -> bool:
        """Check that the loop closes at every coordinate of an interval, exactly and not by samples."""
        first, last = float(interval.first), float(interval.last)
        if self._apart(first, last):
            return False
        for condition in self.conditions:
            inner = positions_within(condition.extremes, first, last, self.period)
            if not np.all(condition.value(np.array([first, last, *inner])) >= 0):
                return False
        return True

    def _apart(self, first: float, last: float) -> bool:
        """Check whether a slot with a hinge becomes parallel to the rail: the body would be infinitely far away."""
        second = self.local_guides[1]
        if self.driver is not Driver.HINGE or not isinstance(second, Rail):
            return False
        ends = np.sin(np.array([first, last]) - second.direction)
        between = positions_within([second.direction, second.direction + math.pi], first, last, TURN)
        return bool(between) or bool(np.any(np.sign(ends) != self.branch))

    def transmission_angle_over(self, interval: Interval) -> float:
        """Return the exact smallest transmission angle over an interval of the coordinate; NaN if the loop opens in it."""
        first, last = float(interval.first), float(interval.last)
        if self._apart(first, last):
            return math.nan
        positions = np.array([first, last, *self._extreme_positions(first, last)])
        return float(np.min(self._poses(positions, self.branch).transmission_angle))

    def transmission_angle_min(self, interval: Interval) -> float:
        """Return the smallest transmission angle over travel from the first sample; NaN if the loop opens."""
        return self.transmission_angle_over(interval.after(self.start))

    def arm_over(self, interval: Interval) -> float:
        """Return the smallest moment arm over an interval of the coordinate; NaN if the loop opens.

        It is exact between two points of the body, and otherwise the minimum over steps of at most a degree.
        """
        if all(guide.holds_point for guide in self.local_guides):
            return abs(self._arm.middle) * math.sin(self.transmission_angle_over(interval))
        if not self.closes_over(interval):
            return math.nan
        first, last = float(interval.first), float(interval.last)
        positions = [*self.travel_over(Interval(first, last)), *self._extreme_positions(first, last)]
        return float(np.min(self.body(positions).arm))

    def _extreme_positions(self, first: float, last: float) -> list[float]:
        """Return the coordinates in an interval at which the transmission angle, or the arm, may be smallest."""
        positions = [extreme for condition in self.conditions for extreme in condition.extremes]
        if self.driver is not Driver.HINGE:
            positions += [*self._spread.turning_points, *self._arm.turning_points]
        return positions_within(positions, first, last, self.period)

    @cached_property
    def turns_fully(self) -> bool:
        """True if the drive turns fully; a four-bar that can fold flat does not."""
        if self.is_four_bar:
            return self.family in FULL_CRANK
        return self.driver.turns and self.closes_over(Interval(self.start, self.start + TURN))

    def travel_over(self, interval: Interval) -> Floats:
        """Return the travel over an interval from the first sample in even steps, of at most a degree for angles."""
        (first, last), steps = interval, 181
        if self.driver.turns:
            steps = min(max(steps, int(np.ceil(np.rad2deg(abs(last - first)))) + 1), 7201)
        return np.linspace(first, last, steps)

    def along(self, index: int, travel: ArrayLike) -> Floats:
        """Return the coordinate of a rail or slot (the first or second guide) over travel (n,) of the drive.

        On a rail it is the position of the body point from the rail's point; in a slot, the position of the pin
        from the body point.
        """
        guide = self.guides[index]
        q = self.start + np.atleast_1d(np.asarray(travel, dtype=float))
        if index == 0 and not self.driver.turns:
            return q
        found = self.body(q)
        return guide.coordinate_of(found.position, np.exp(1j * found.rotation))

    def used(self, index: int, interval: Interval) -> tuple[float, float]:
        """Return the smallest and the largest coordinate of a rail or slot over an interval of travel of the drive.

        Turning points in the interval are found from the derivative, between steps of at most a degree.
        """
        travel = self.travel_over(interval)
        ends = np.array([float(interval.first), float(interval.last)])
        if index == 1 or self.driver.turns:
            rate = self.along_rate(index, travel)
            turns = np.flatnonzero(rate[:-1] * rate[1:] < 0)
            low, high, sign = travel[turns], travel[turns + 1], np.sign(rate[turns])
            for _ in range(4 if turns.size else 0):  # to 2e-8 radians: the coordinate there to all digits
                steps = np.linspace(low, high, 33)
                before = self.along_rate(index, steps.ravel()).reshape(steps.shape) * sign > 0
                last = np.clip(np.argmin(before, axis=0) - 1, 0, len(steps) - 2)
                low, high = (np.take_along_axis(steps, (last + k)[None], 0)[0] for k in (0, 1))
            ends = np.concatenate([ends, low])
        values = self.along(index, ends)
        return float(np.min(values)), float(np.max(values))

    def along_rate(self, index: int, travel: Floats) -> Floats:
        """Return the derivative of `along`; its sign is correct beside a dead position too."""
        guide = self.guides[index]
        body = self.motions(travel)[1]
        velocity = body.speed(guide.body_point)
        if isinstance(guide, Rail):
            return dot(np.exp(1j * guide.direction), velocity)
        assert isinstance(guide, Slot)
        along = np.exp(1j * (body.angle + guide.body_direction))
        return -dot(along, velocity) + body.rate * cross(along, guide.pin - body.position(guide.body_point))


_LINK_OF: dict[type, str] = {Circle: "crank", Rail: "slider", Slot: "block"}


def _turned(vector: complex, angle: float) -> complex:
    return complex(vector * np.exp(1j * angle))


def on_guides(guides: tuple[Guide, Guide], driver: Driver, branch: int = 1, start: float = 0.0) -> Linkage:
    """Return the linkage on guides in the plane and in the body's frame of its motion.

    ``start``: the drive's coordinate at the first sample, directions against the x axis.
    """
    first, second = guides
    if not (isinstance(first, Circle) and isinstance(second, Circle)):
        return Linkage(guides, driver, branch, start)
    ground, coupler = second.pivot - first.pivot, second.body_point - first.body_point
    turn, offset = float(np.angle(ground)), -float(np.angle(coupler))
    point = complex(-first.body_point * np.exp(1j * offset))
    return four_bar(
        (first.radius, abs(coupler), second.radius, abs(ground)),
        branch,
        start - turn,
        first.pivot,
        turn,
        (abs(point), float(np.angle(point))),
        offset,
    )


def four_bar(
    links: Lengths,
    branch: int = 1,
    start: float = 0.0,
    pivot_a: complex = 0j,
    ground_angle: float = 0.0,
    coupler_point_polar: tuple[float, float] | None = None,
    body_offset: float | None = None,
) -> Linkage:
    """Return the four-bar with the lengths of crank, coupler, rocker and ground; see `Linkage` for the rest."""
    crank, coupler, rocker, ground = links
    guides = Circle(0j, crank, 0j), Circle(complex(ground), rocker, complex(coupler))
    return Linkage(guides, Driver.CRANK, branch, start, pivot_a, ground_angle, coupler_point_polar, body_offset)


def as_lengths(row: Iterable[float]) -> Lengths:
    """Return a row of four lengths as plain numbers."""
    crank, coupler, rocker, ground = map(float, row)
    return crank, coupler, rocker, ground


def with_links(linkage: Linkage, links: Lengths) -> Linkage:
    """Return a four-bar with other lengths."""
    return replace(linkage, local_guides=four_bar(links).local_guides)


def through(guides: tuple[Guide, Guide], driver: Driver, rotation: float, position: complex) -> Linkage:
    """Return the linkage on guides with the start and the branch of a pose of the body."""
    linkage = on_guides(guides, driver)
    q, sine = linkage.configuration(np.array([rotation]), np.array([position]))
    return replace(linkage, branch=1 if sine[0] >= 0 else -1, start=float(q[0]))
