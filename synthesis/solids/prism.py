"""Prisms: flat parts with an outline of lines and arcs, holes and slits, and their area, volume and inertia."""

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
    """Area, centroid, and second moments of an area about its centroid."""

    area: float
    centre: complex
    xx: float
    yy: float
    xy: float


class Hole(NamedTuple):
    """Round hole, or slit: all points within ``radius`` of the line from ``centre - reach`` to ``centre + reach``."""

    centre: complex
    radius: float
    reach: complex = 0j

    @property
    def ends(self) -> tuple[complex, ...]:
        """End points of the line; only the centre for a round hole."""
        return (self.centre,) if self.reach == 0 else (self.centre - self.reach, self.centre + self.reach)

    @property
    def outline(self) -> Floats:
        """Outline of the slit as in `Prism`, shape (4, 3), but clockwise: the part lies to the left."""
        bulge = np.array([0.0, -1.0, 0.0, -1.0])
        across = self.radius * 1j * self.reach / abs(self.reach)
        first, last = self.ends
        corners = np.array([first + across, last + across, last - across, first - across])
        return np.column_stack([corners.real, corners.imag, bulge])

    @property
    def moments(self) -> Moments:
        """Moments of the area of the hole."""
        square, half = self.radius**2, abs(self.reach)
        area, round_ = np.pi * square + 4 * self.radius * half, np.pi * square
        # along the line: two half discs at the ends of a rectangle; across the line: equal heights
        off = 4 * self.radius / (3 * np.pi)
        along = 4 * self.radius * half**3 / 3 + round_ * (square / 4 - off**2 + (half + off) ** 2)
        across = 4 * half * self.radius**3 / 3 + round_ * square / 4
        direction = self.reach / half if half else 1.0 + 0j
        cos, sin = direction.real, direction.imag
        return Moments(
            area,
            self.centre,
            along * cos**2 + across * sin**2,
            along * sin**2 + across * cos**2,
            (along - across) * cos * sin,
        )

    def distance(self, point: complex) -> float:
        """Return the distance of a point from the line of the hole."""
        return min(abs(_foot(first, last, point) - point) for first, last in zip(self.ends, self.ends[::-1]))

    def apart(self, hole: Hole) -> float:
        """Return the thickness of material between two holes; at most 0 if they meet."""
        distance = min([self.distance(end) for end in hole.ends] + [hole.distance(end) for end in self.ends])
        if self.reach and hole.reach:
            lines, between = (2 * self.reach, 2 * hole.reach), hole.ends[0] - self.ends[0]
            area = float(np.imag(np.conj(lines[0]) * lines[1]))
            shares = [float(np.imag(np.conj(between) * line)) for line in lines[::-1]]
            if area and all(0 <= share / area <= 1 for share in shares):
                distance = 0.0
        return distance - self.radius - hole.radius


class Arc(NamedTuple):
    """Arc of an outline, counter-clockwise for a positive ``angle``."""

    centre: complex
    radius: float
    first: float
    """Direction from the centre to the first point, in radians."""
    angle: float
    """Angle of the arc in radians; negative around a concave corner."""

    def at(self, share: Floats) -> Complexes:
        """Return the points at fractions 0 to 1 of the arc."""
        return self.centre + self.radius * np.exp(1j * (self.first + self.angle * share))

    def covers(self, angle: float) -> bool:
        """Check if the arc contains the point at an angle from its first point, in radians with the sign of ``self.angle``."""
        return min(self.angle, 0.0) <= angle <= max(self.angle, 0.0)


class MassProperties(NamedTuple):
    """Mass, centre of mass and inertia about it, for a part or for all parts of a body.

    Units follow from the units of length and density.
    """

    mass: float
    centre: Floats
    """Centre of mass, shape (3,)."""
    inertia: Floats
    """Inertia about the centre along the axes of the frame, shape (3, 3)."""

    def turned(self, turn: complex, shift: Floats) -> MassProperties:
        """Return the properties in a frame rotated about z by the unit number ``turn``, then translated by ``shift``."""
        rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
        return MassProperties(self.mass, rotation @ self.centre + shift, rotation @ self.inertia @ rotation.T)


def together(parts: Sequence[MassProperties]) -> MassProperties:
    """Combine masses to a rigid body.

    Inertia adds up by the parallel axis theorem, so no principal moment exceeds the sum of the two others.
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
    """Outline extruded from height ``low`` to height ``high``, with through holes.

    Attributes
    ----------
    outline : ndarray, shape (n, 3)
        x, y and bulge of each vertex, counter-clockwise. The bulge is the tangent of a quarter of the angle of the arc to the
        next vertex, 0 for a line. Two vertices with bulge 1 are a disc.
    low, high : float
    holes : tuple of Hole
        Holes inside the outline that do not meet.
    """

    outline: Floats
    low: float
    high: float
    holes: tuple[Hole, ...] = ()

    @classmethod
    def disc(cls, centre: complex, radius: float, low: float, high: float, hole: float = 0.0) -> Prism:
        """Return a pin, or a washer if ``hole``, the radius of a hole, is positive."""
        outline = np.array([[centre.real + radius, centre.imag, 1.0], [centre.real - radius, centre.imag, 1.0]])
        return cls(outline, low, high, (Hole(centre, hole),) if hole else ())

    def grown(self, by: float) -> Prism:
        """Return the part with its outline offset outwards by a distance and the radius of holes reduced by it.

        Lines keep their direction, arcs their angle, and corners stay sharp. The distance must be smaller than the radius of each
        concave arc.
        """
        if not by:
            return self
        z, bulge = self.corners, self.outline[:, 2]
        chord = np.roll(z, -1) - z
        turn = np.exp(2j * np.arctan(bulge))
        direction = chord / np.abs(chord)
        # directions at the end of the segment before each vertex and at the start of the segment after it
        before, after = np.roll(direction * turn, 1), direction / turn
        normals = -1j * before, -1j * after
        moved = z + by * (normals[0] + normals[1]) / (1 + np.real(np.conj(normals[0]) * normals[1]))
        outline = np.column_stack([moved.real, moved.imag, bulge])
        return replace(
            self, outline=outline, holes=tuple(hole._replace(radius=hole.radius - by) for hole in self.holes)
        )

    @property
    def height(self) -> float:
        """Thickness."""
        return self.high - self.low

    @cached_property
    def corners(self) -> Complexes:
        """Vertices of the outline, x + i y."""
        return np.asarray(self.outline[:, 0] + 1j * self.outline[:, 1])

    @cached_property
    def circle(self) -> Hole | None:
        """Centre and radius if the outline is a circle, otherwise None."""
        if len(self.outline) != 2 or not np.all(self.outline[:, 2] == 1.0):
            return None
        first, second = self.corners
        return Hole(complex(first + second) / 2, float(abs(first - second)) / 2)

    @cached_property
    def arcs(self) -> tuple[Arc | None, ...]:
        """Arc from each vertex to the next; None for a line."""
        return tuple(
            arc_between(complex(start), complex(end), float(bulge)) if bulge else None
            for start, end, bulge in zip(self.corners, np.roll(self.corners, -1), self.outline[:, 2])
        )

    @cached_property
    def moments(self) -> Moments:
        """Moments of the base, by Green's theorem along the outline; exact to rounding."""
        corners = self.corners
        # about a local origin, so that a part far from the global origin loses no digits
        origin = complex(corners.real.min() + corners.real.max(), corners.imag.min() + corners.imag.max()) / 2
        share = (1 + _NODES) / 2
        points, steps = [], []
        for start, end, arc in zip(corners, np.roll(corners, -1), self.arcs):
            if arc is None:
                points.append(start + (end - start) * share)
                steps.append(np.full(share.size, end - start))
            else:
                points.append(arc.at(share))
                steps.append(1j * arc.angle * (points[-1] - arc.centre))
        offset = np.concatenate(points) - origin
        step = np.concatenate(steps) * np.tile(_WEIGHTS / 2, len(points))
        x, y, dx, dy = offset.real, offset.imag, step.real, step.imag
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
        """Volume."""
        return self.moments.area * self.height

    def mass(self, density: float) -> MassProperties:
        """Return the mass properties for a density per cubic unit of length."""
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
        """Return the part rotated about z by the unit number ``turn`` and then translated."""
        corners = self.corners * turn + shift
        outline = np.column_stack([corners.real, corners.imag, self.outline[:, 2]])
        holes = tuple(
            Hole(complex(hole.centre * turn + shift), hole.radius, hole.reach * turn) for hole in self.holes
        )
        return Prism(outline, self.low + up, self.high + up, holes)

    def scaled(self, scale: float) -> Prism:
        """Return the part with all lengths multiplied by ``scale``."""
        outline = self.outline * np.array([scale, scale, 1.0])
        holes = tuple(Hole(hole.centre * scale, hole.radius * scale, hole.reach * scale) for hole in self.holes)
        return replace(self, outline=outline, low=self.low * scale, high=self.high * scale, holes=holes)

    @cached_property
    def extent(self) -> tuple[complex, complex]:
        """Lower left and upper right corner of the bounding box of the outline, x + i y."""
        low, high = (
            [self.corners.real.min(), self.corners.imag.min()],
            [
                self.corners.real.max(),
                self.corners.imag.max(),
            ],
        )
        for arc in self.arcs:
            if arc is not None:
                # extreme points of the circle that lie on the arc
                for quarter in range(4):
                    angle = (quarter * np.pi / 2 - arc.first) % (2 * np.pi)
                    if arc.covers(angle - (2 * np.pi if arc.angle < 0 else 0)):
                        point = arc.centre + arc.radius * 1j**quarter
                        low = [min(low[0], point.real), min(low[1], point.imag)]
                        high = [max(high[0], point.real), max(high[1], point.imag)]
        return complex(*low), complex(*high)

    @cached_property
    def thinnest_wall(self) -> float:
        """Smallest of the height, the distances between holes and from holes to the outline, and the diameter of a pin.

        This is exact for plates that are rounded about their holes. Narrow necks of a drawn outline are not examined.
        """
        walls = [self.height]
        if self.circle is not None and not self.holes:
            walls.append(2 * self.circle.radius)
        for k, hole in enumerate(self.holes):
            walls += [hole.apart(previous) for previous in self.holes[:k]]
            rims = [distance_to_outline(self, end) for end in hole.ends]
            if hole.reach:
                rims += [hole.distance(complex(corner)) for corner in self.corners]
            walls.append(min(rims) - hole.radius)
        return float(min(walls))


def _foot(first: complex, last: complex, point: complex) -> complex:
    """Return the point of a line segment that is nearest to a point."""
    line = last - first
    if line == 0:
        return first
    return first + line * min(max(float(np.real(np.conj(line) * (point - first))) / abs(line) ** 2, 0.0), 1.0)


def arc_between(start: complex, end: complex, bulge: float) -> Arc:
    """Return the arc of a bulge: its angle is four times the arctangent; a positive bulge lies to the right."""
    angle = 4 * float(np.arctan(bulge))
    chord = end - start
    centre = (start + end) / 2 + 1j * chord * (1 - bulge**2) / (4 * bulge)
    radius = abs(chord) * (1 + bulge**2) / (4 * abs(bulge))
    return Arc(centre, radius, float(np.angle(start - centre)), angle)


def distance_to_outline(prism: Prism, point: complex) -> float:
    """Return the distance of a point from the outline."""
    smallest = np.inf
    for start, end, arc in zip(prism.corners, np.roll(prism.corners, -1), prism.arcs):
        ends = min(abs(point - start), abs(point - end))
        if arc is None:
            distance = abs(_foot(complex(start), complex(end), point) - point)
        else:
            distance = ends
            off = point - arc.centre
            angle = (np.angle(off) - arc.first) % (2 * np.pi) - (2 * np.pi if arc.angle < 0 else 0) if off else 0.0
            if arc.covers(angle):
                distance = min(distance, abs(abs(off) - arc.radius))
        smallest = min(smallest, distance, ends)
    return float(smallest)


def rounded(core: Sequence[complex], radius: float) -> Floats:
    """Return the rounded outline at a distance from a point, a line or a convex polygon.

    Parameters
    ----------
    core : sequence of complex
        Distinct vertices, counter-clockwise; two vertices are a line, a single vertex gives a circle.
    radius : float

    Returns
    -------
    outline : ndarray, shape (n, 3)
        Convex outline, see `Prism`.
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
            vertex = corner + radius * normal
            vertices.append((vertex.real, vertex.imag, float(bulge)))
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
        longest = 0.4 * min(abs(back), abs(on))
        tangent = min(radius * abs(np.tan(turn / 2)), longest)
        if turn <= 0 or tangent <= 1e-9 * longest:
            vertices.append((corner.real, corner.imag, 0.0))
            continue
        first, last = corner + tangent * back / abs(back), corner + tangent * on / abs(on)
        vertices += [(first.real, first.imag, float(np.tan(turn / 4))), (last.real, last.imag, 0.0)]
    return np.array(vertices)
