"""A flat part: an outline of lines and arcs with holes and slits between two heights; its area, volume and inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss-Legendre on [-1, 1]: exact to rounding for the moments of an arc of less than a full turn."""


class Moments(NamedTuple):
    """Integrals over an area: of one, of the place, and of the squares and the product of its coordinates from the centre."""

    area: float
    centre: complex
    xx: float
    yy: float
    xy: float


class Hole(NamedTuple):
    """A hole through a part: round, or with a ``reach`` all within its radius of a line, as far from its centre either way."""

    centre: complex
    radius: float
    reach: complex = 0j

    @property
    def ends(self) -> tuple[complex, ...]:
        """Of its line; of a round hole the centre alone."""
        return (self.centre,) if self.reach == 0 else (self.centre - self.reach, self.centre + self.reach)

    @property
    def outline(self) -> Floats:
        """(4, 3) as that of a `Prism`, but clockwise: the part lies to the left of it."""
        bulge = np.array([0.0, -1.0, 0.0, -1.0])
        across = self.radius * 1j * self.reach / abs(self.reach)
        first, last = self.ends
        corners = np.array([first + across, last + across, last - across, first - across])
        return np.column_stack([corners.real, corners.imag, bulge])

    @property
    def moments(self) -> Moments:
        """Of its area."""
        square, half = self.radius**2, abs(self.reach)
        area, round_ = np.pi * square + 4 * self.radius * half, np.pi * square
        # along its line two half discs about the ends of a rectangle, across it all of the same height
        off = 4 * self.radius / (3 * np.pi)
        along = 4 * self.radius * half**3 / 3 + round_ * (square / 4 - off**2 + (half + off) ** 2)
        across = 4 * half * self.radius**3 / 3 + round_ * square / 4
        way = self.reach / half if half else 1.0 + 0j
        cos, sin = way.real, way.imag
        return Moments(
            area,
            self.centre,
            along * cos**2 + across * sin**2,
            along * sin**2 + across * cos**2,
            (along - across) * cos * sin,
        )

    def distance(self, point: complex) -> float:
        """How far a point is from its line."""
        return min(abs(_foot(one, other, point) - point) for one, other in zip(self.ends, self.ends[::-1]))

    def apart(self, other: Hole) -> float:
        """How much material is between two holes; at most 0 where they meet."""
        least = min([self.distance(end) for end in other.ends] + [other.distance(end) for end in self.ends])
        if self.reach and other.reach:
            ways, between = (2 * self.reach, 2 * other.reach), other.ends[0] - self.ends[0]
            turned = float(np.imag(np.conj(ways[0]) * ways[1]))
            shares = [float(np.imag(np.conj(between) * way)) for way in ways[::-1]]
            if turned and all(0 <= share / turned <= 1 for share in shares):
                least = 0.0
        return least - self.radius - other.radius


class Arc(NamedTuple):
    """An arc of an outline: from its centre, counter-clockwise where ``angle`` is positive."""

    centre: complex
    radius: float
    first: float
    """Direction of its first point from the centre, radians."""
    angle: float
    """What it turns by, radians; negative where it goes around a hollow."""

    def at(self, share: Floats) -> Complexes:
        """Points of it at parts of its way, 0 to 1."""
        return self.centre + self.radius * np.exp(1j * (self.first + self.angle * share))


class MassProperties(NamedTuple):
    """MassProperties, centre and inertia about the centre, of a part or of several parts of one body.

    Units: those of length and density; `kg_mm` says how a density in kg/m^3 and millimetres go together.
    """

    mass: float
    centre: Floats
    """(3,)"""
    inertia: Floats
    """(3, 3), about the centre, along the axes of the frame."""

    def turned(self, turn: complex, shift: Floats) -> MassProperties:
        """The same in another frame: turned about z by the unit number ``turn``, then moved by ``shift`` (3,)."""
        rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
        return MassProperties(self.mass, rotation @ self.centre + shift, rotation @ self.inertia @ rotation.T)


def together(parts: Sequence[MassProperties]) -> MassProperties:
    """Several masses as one rigid body.

    Law: mass and mass times centre add up; inertia adds up by the parallel axis theorem, so the least principal moment never
    exceeds the sum of the two others.
    """
    mass = float(sum(part.mass for part in parts))
    if not mass:
        return MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))
    centre = sum((part.mass * part.centre for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        off = part.centre - centre
        inertia += part.inertia + part.mass * (off @ off * np.eye(3) - np.outer(off, off))
    return MassProperties(mass, centre, inertia)


@dataclass(frozen=True, eq=False)
class Prism:
    """An outline pulled from height ``low`` to height ``high``, with holes through all of it.

    ``outline``: (n, 3) x, y and bulge of each vertex, counter-clockwise; the bulge is the tangent of a quarter of the angle of
    the arc to the next vertex, 0 for a line. Two vertices of bulge 1 are a disc. Holes lie inside and apart from one another.
    """

    outline: Floats
    low: float
    high: float
    holes: tuple[Hole, ...] = ()

    @classmethod
    def disc(cls, centre: complex, radius: float, low: float, high: float, hole: float = 0.0) -> Prism:
        """A pin, or with a hole of that radius a washer."""
        outline = np.array([[centre.real + radius, centre.imag, 1.0], [centre.real - radius, centre.imag, 1.0]])
        return cls(outline, low, high, (Hole(centre, hole),) if hole else ())

    def grown(self, by: float) -> Prism:
        """Return the part with its outline moved outwards by a distance, and holes as much smaller in radius.

        Lines and arcs keep their direction and their angle; corners stay sharp. For distances below the radius of any arc that
        goes around a hollow.
        """
        if not by:
            return self
        z, bulge = self.corners, self.outline[:, 2]
        chord = np.roll(z, -1) - z
        turn = np.exp(2j * np.arctan(bulge))
        way = chord / np.abs(chord)
        # directions at the end of the segment before each vertex, and at the begin of that after it
        before, after = np.roll(way * turn, 1), way / turn
        normals = -1j * before, -1j * after
        moved = z + by * (normals[0] + normals[1]) / (1 + np.real(np.conj(normals[0]) * normals[1]))
        outline = np.column_stack([moved.real, moved.imag, bulge])
        return replace(self, outline=outline, holes=tuple(one._replace(radius=one.radius - by) for one in self.holes))

    @property
    def height(self) -> float:
        """Its thickness."""
        return self.high - self.low

    @cached_property
    def corners(self) -> Complexes:
        """The vertices of the outline, x + i y."""
        return np.asarray(self.outline[:, 0] + 1j * self.outline[:, 1])

    @cached_property
    def circle(self) -> Hole | None:
        """Centre and radius, where the outline is a circle."""
        if len(self.outline) != 2 or not np.all(self.outline[:, 2] == 1.0):
            return None
        first, second = self.corners
        return Hole(complex(first + second) / 2, float(abs(first - second)) / 2)

    @cached_property
    def arcs(self) -> tuple[Arc | None, ...]:
        """The way from each vertex to the next: an arc, or None for a line."""
        return tuple(
            arc_between(complex(start), complex(end), float(bulge)) if bulge else None
            for start, end, bulge in zip(self.corners, np.roll(self.corners, -1), self.outline[:, 2])
        )

    @cached_property
    def moments(self) -> Moments:
        """Of its base, by Green's theorem along outline and holes.

        Law: those of a disc, a ring, a rounded rectangle are the closed forms to rounding.
        """
        corners = self.corners
        # about a place of its own, so that a part far from the origin loses no digits
        origin = complex(corners.real.min() + corners.real.max(), corners.imag.min() + corners.imag.max()) / 2
        share = (1 + _NODES) / 2
        ways, steps = [], []
        for start, end, arc in zip(corners, np.roll(corners, -1), self.arcs):
            if arc is None:
                ways.append(start + (end - start) * share)
                steps.append(np.full(share.size, end - start))
            else:
                ways.append(arc.at(share))
                steps.append(1j * arc.angle * (ways[-1] - arc.centre))
        place = np.concatenate(ways) - origin
        step = np.concatenate(steps) * np.tile(_WEIGHTS / 2, len(ways))
        x, y, dx, dy = place.real, place.imag, step.real, step.imag
        area = float(np.sum(x * dy - y * dx)) / 2
        first = complex(np.sum(x**2 * dy) / 2, -np.sum(y**2 * dx) / 2)
        xx, yy = float(np.sum(x**3 * dy)) / 3, -float(np.sum(y**3 * dx)) / 3
        xy = float(np.sum(x**2 * y * dy)) / 2
        for hole in self.holes:
            size, at = hole.moments, hole.centre - origin
            area -= size.area
            first -= size.area * at
            xx -= size.xx + size.area * at.real**2
            yy -= size.yy + size.area * at.imag**2
            xy -= size.xy + size.area * at.real * at.imag
        centre = first / area
        return Moments(
            area,
            centre + origin,
            xx - area * centre.real**2,
            yy - area * centre.imag**2,
            xy - area * centre.real * centre.imag,
        )

    @property
    def volume(self) -> float:
        """Area times height."""
        return self.moments.area * self.height

    def mass(self, density: float) -> MassProperties:
        """MassProperties and inertia for a density per cube of the unit of its lengths."""
        base, tall = self.moments, self.height
        mass = density * base.area * tall
        upright = mass * tall**2 / 12
        inertia = (
            density * tall * np.array([[base.yy, -base.xy, 0], [-base.xy, base.xx, 0], [0, 0, base.xx + base.yy]])
        )
        inertia += np.diag([upright, upright, 0.0])
        return MassProperties(
            mass, np.array([base.centre.real, base.centre.imag, (self.low + self.high) / 2]), inertia
        )

    def moved(self, turn: complex = 1.0 + 0j, shift: complex = 0j, up: float = 0.0) -> Prism:
        """The same part, turned about z by the unit number ``turn``, then moved."""
        corners = self.corners * turn + shift
        outline = np.column_stack([corners.real, corners.imag, self.outline[:, 2]])
        holes = tuple(
            Hole(complex(hole.centre * turn + shift), hole.radius, hole.reach * turn) for hole in self.holes
        )
        return Prism(outline, self.low + up, self.high + up, holes)

    def scaled(self, scale: float) -> Prism:
        """The same part with all lengths times ``scale``."""
        outline = self.outline * np.array([scale, scale, 1.0])
        holes = tuple(Hole(hole.centre * scale, hole.radius * scale, hole.reach * scale) for hole in self.holes)
        return replace(self, outline=outline, low=self.low * scale, high=self.high * scale, holes=holes)

    @cached_property
    def extent(self) -> tuple[complex, complex]:
        """Its lowest and highest coordinates, x + i y."""
        low, high = (
            [self.corners.real.min(), self.corners.imag.min()],
            [
                self.corners.real.max(),
                self.corners.imag.max(),
            ],
        )
        for arc in self.arcs:
            if arc is not None:
                # the four outermost points of its circle, where the arc passes them
                for quarter in range(4):
                    turned = (quarter * np.pi / 2 - arc.first) % (2 * np.pi)
                    if turned - (2 * np.pi if arc.angle < 0 else 0) in _Between(arc.angle):
                        point = arc.centre + arc.radius * 1j**quarter
                        low = [min(low[0], point.real), min(low[1], point.imag)]
                        high = [max(high[0], point.real), max(high[1], point.imag)]
        return complex(*low), complex(*high)

    @cached_property
    def thinnest_wall(self) -> float:
        """The least of its height, the room between two holes, and between a hole and the outline; of a pin its diameter.

        A plate rounded about its holes has no thinner place; narrow necks of an outline that was drawn are not looked for.
        """
        walls = [self.height]
        if self.circle is not None and not self.holes:
            walls.append(2 * self.circle.radius)
        for k, hole in enumerate(self.holes):
            walls += [hole.apart(other) for other in self.holes[:k]]
            rims = [distance_to_outline(self, end) for end in hole.ends]
            if hole.reach:
                rims += [hole.distance(complex(corner)) for corner in self.corners]
            walls.append(min(rims) - hole.radius)
        return float(min(walls))


class _Between:
    """Angles that an arc passes."""

    def __init__(self, angle: float) -> None:
        self.low, self.high = min(angle, 0.0), max(angle, 0.0)

    def __contains__(self, angle: float) -> bool:
        return self.low <= angle <= self.high


def _foot(first: complex, last: complex, point: complex) -> complex:
    """The point of a line between two places that is nearest to a point."""
    way = last - first
    if way == 0:
        return first
    return first + way * min(max(float(np.real(np.conj(way) * (point - first))) / abs(way) ** 2, 0.0), 1.0)


def arc_between(start: complex, end: complex, bulge: float) -> Arc:
    """The arc of a bulge: its angle is four times the arctangent; positive bulges lie to the right of the way."""
    angle = 4 * float(np.arctan(bulge))
    chord = end - start
    centre = (start + end) / 2 + 1j * chord * (1 - bulge**2) / (4 * bulge)
    radius = abs(chord) * (1 + bulge**2) / (4 * abs(bulge))
    return Arc(centre, radius, float(np.angle(start - centre)), angle)


def distance_to_outline(prism: Prism, point: complex) -> float:
    """How far a point is from the nearest point of the outline."""
    least = np.inf
    for start, end, arc in zip(prism.corners, np.roll(prism.corners, -1), prism.arcs):
        ends = min(abs(point - start), abs(point - end))
        if arc is None:
            near = abs(_foot(complex(start), complex(end), point) - point)
        else:
            near = ends
            off = point - arc.centre
            turned = (np.angle(off) - arc.first) % (2 * np.pi) - (2 * np.pi if arc.angle < 0 else 0) if off else 0.0
            if turned in _Between(arc.angle):
                near = min(near, abs(abs(off) - arc.radius))
        least = min(least, near, ends)
    return float(least)


def rounded(core: Sequence[complex], radius: float) -> Floats:
    """The outline at a distance from a line or a convex polygon, with a round at each corner; of one point a circle.

    ``core``: counter-clockwise, neighbours apart; two are a line. Returns (n, 3), see `Prism`.

    Law: convex, so free of self-crossing, and nowhere nearer to the core than ``radius``.
    """
    count = len(core)
    if count == 1:
        return Prism.disc(complex(core[0]), radius, 0.0, 1.0).outline
    sides = [core[(k + 1) % count] - core[k] for k in range(count)]
    normals = [-1j * side / abs(side) for side in sides]
    vertices = []
    for k, corner in enumerate(core):
        turn = float(np.angle(normals[k] / normals[k - 1])) if count > 2 else np.pi
        for normal, bulge in ((normals[k - 1], np.tan(turn / 4)), (normals[k], 0.0)):
            place = corner + radius * normal
            vertices.append((place.real, place.imag, float(bulge)))
    return np.array(vertices)


def filleted(corners: Sequence[complex], radius: float) -> Floats:
    """A simple polygon, counter-clockwise, whose convex corners are rounded by at most ``radius``; (n, 3), see `Prism`.

    A fillet takes at most four tenths of the shorter of its two sides, so that the next one has room. Law: within the polygon.
    """
    count = len(corners)
    vertices: list[tuple[float, float, float]] = []
    for k, corner in enumerate(corners):
        back, on = corners[k - 1] - corner, corners[(k + 1) % count] - corner
        turn = float(np.angle(on / -back))
        # tangent length of a fillet: radius times tan(turn / 2)
        most = 0.4 * min(abs(back), abs(on))
        tangent = min(radius * abs(np.tan(turn / 2)), most)
        if turn <= 0 or tangent <= 1e-9 * most:
            vertices.append((corner.real, corner.imag, 0.0))
            continue
        first, last = corner + tangent * back / abs(back), corner + tangent * on / abs(on)
        vertices += [(first.real, first.imag, float(np.tan(turn / 4))), (last.real, last.imag, 0.0)]
    return np.array(vertices)
