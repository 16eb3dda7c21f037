"""Prisms: flat parts with holes and slits, their contours of lines and arcs, and their area, volume and inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.assembly.shapes import Shape, disc, distances, nearest_on
from synthesis.target import TURN

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss-Legendre on [-1, 1]: exact to rounding for the moments of an arc of up to a full turn."""


class Arc(NamedTuple):
    """Arc of a contour, counter-clockwise for a positive ``angle``."""

    centre: complex
    radius: float
    first: float
    """Direction from the centre to the first point, in radians."""
    angle: float
    """Angle of the arc in radians."""

    def at(self, share: Floats) -> Complexes:
        """Return the points at fractions 0 to 1 of the arc."""
        return self.centre + self.radius * np.exp(1j * (self.first + self.angle * share))


class Side(NamedTuple):
    """Side of a contour from a point to the start of the next side: an arc, or a line if there is no arc."""

    start: complex
    arc: Arc | None


def contour(shape: Shape, hole: bool = False, phase: float = 0.0) -> list[Side]:
    """Return the contour of a shape, counter-clockwise, or clockwise for a hole: the material lies to the left.

    A circle is a single arc, which begins in the direction ``phase``. Concave corners of a polygon stay sharp.
    """
    core, radius = shape.core, shape.radius
    count, sides = len(core), []
    normals = [-1j * (core[(k + 1) % count] - corner) for k, corner in enumerate(core)]
    for k, corner in enumerate(core if count > 1 else ()):
        before, after = normals[k - 1] / abs(normals[k - 1]), normals[k] / abs(normals[k])
        angle = float(np.angle(after / before)) if count > 2 else np.pi
        if angle > 0 and radius:
            sides.append(Side(corner + radius * before, Arc(corner, radius, float(np.angle(before)), angle)))
            sides.append(Side(corner + radius * after, None))
        else:
            meet = radius * (before + after) / (1 + (before.conjugate() * after).real) if radius else 0j
            sides.append(Side(corner + meet, None))
    if count == 1:
        arc = Arc(core[0], radius, phase, TURN)
        sides = [Side(complex(arc.at(np.zeros(()))), arc)]
    if not hole:
        return sides
    turned = [
        side.arc and side.arc._replace(first=side.arc.first + side.arc.angle, angle=-side.arc.angle) for side in sides
    ]
    return [Side(sides[(k + 1) % len(sides)].start, turned[k]) for k in reversed(range(len(sides)))]


class MassProperties(NamedTuple):
    """Mass, centre of mass and inertia about it, for a part or for all parts of a body.

    Units follow from the units of length and density.
    """

    mass: float
    centre: Floats
    """Centre of mass, shape (3,)."""
    inertia: Floats
    """Inertia about the centre along the axes of the frame, shape (3, 3)."""


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


class Moments(NamedTuple):
    """Area, centroid, and second moments of an area about its centroid."""

    area: float
    centre: complex
    xx: float
    yy: float
    xy: float


@dataclass(frozen=True, eq=False)
class Prism:
    """Shape between the heights 0 and ``height``, with through holes that do not meet."""

    shape: Shape
    """Disc, thick line, rounded convex polygon, or simple polygon."""
    height: float
    holes: tuple[Shape, ...] = ()
    """Discs and, for slits, thick lines."""

    @classmethod
    def disc(cls, radius: float, height: float, hole: float = 0.0) -> Prism:
        """Return a pin, or a washer if ``hole``, the radius of a hole, is positive."""
        return cls(disc(0j, radius), height, (disc(0j, hole),) if hole else ())

    @property
    def diameter(self) -> float | None:
        """Diameter if the outline is a circle, otherwise None."""
        return 2 * self.shape.radius if len(self.shape.core) == 1 else None

    @cached_property
    def contours(self) -> list[list[Side]]:
        """Contour of the outline, followed by the contours of the holes."""
        return [contour(self.shape), *(contour(hole, hole=True) for hole in self.holes)]

    @cached_property
    def moments(self) -> Moments:
        """Moments of the base, by Green's theorem along the contours; exact to rounding."""
        # about a local origin, so that a part far from the global origin loses no digits
        origin = sum(self.shape.extent) / 2
        share = (1 + _NODES) / 2
        points, steps = [], []
        for sides in self.contours:
            for side, after in zip(sides, [*sides[1:], sides[0]]):
                if side.arc is None:
                    points.append(side.start + (after.start - side.start) * share)
                    steps.append(np.full(share.size, after.start - side.start))
                else:
                    points.append(side.arc.at(share))
                    steps.append(1j * side.arc.angle * (points[-1] - side.arc.centre))
        offset = np.concatenate(points) - origin
        step = np.concatenate(steps) * np.tile(_WEIGHTS / 2, len(points))
        x, y, dx, dy = offset.real, offset.imag, step.real, step.imag
        area = float(np.sum(x * dy - y * dx)) / 2
        centre = complex(np.sum(x**2 * dy) / 2, -np.sum(y**2 * dx) / 2) / area
        return Moments(
            area,
            centre + origin,
            float(np.sum(x**3 * dy)) / 3 - area * centre.real**2,
            -float(np.sum(y**3 * dx)) / 3 - area * centre.imag**2,
            float(np.sum(x**2 * y * dy)) / 2 - area * centre.real * centre.imag,
        )

    @property
    def volume(self) -> float:
        """Volume."""
        return self.moments.area * self.height

    def mass(self, density: float, at: complex = 0j, up: float = 0.0) -> MassProperties:
        """Return the mass properties for a density per cubic unit of length, with the prism's origin at ``at`` and ``up``."""
        base, tall = self.moments, self.height
        mass, centre = density * self.volume, base.centre + at
        inertia = np.array([[base.yy, -base.xy, 0], [-base.xy, base.xx, 0], [0, 0, base.xx + base.yy]])
        inertia = density * tall * inertia + mass * tall**2 / 12 * np.diag([1.0, 1.0, 0.0])
        return MassProperties(mass, np.array([centre.real, centre.imag, up + tall / 2]), inertia)

    @cached_property
    def thinnest_wall(self) -> float:
        """Smallest of the height, the distances between holes and from holes to the outline, and the diameter of a pin.

        Narrow necks of a drawn outline are not examined.
        """
        walls = [self.height, *([2 * self.shape.radius] if self.diameter and not self.holes else [])]
        for k, hole in enumerate(self.holes):
            walls += [material_between(hole, previous) for previous in self.holes[:k]]
            depth = min(abs(nearest_on(self.shape.core, end) - end) for end in hole.core)
            walls.append(self.shape.radius + depth - hole.radius)
        return float(min(walls))


def material_between(first: Shape, second: Shape) -> float:
    """Return the thickness of material between two holes; at most 0 if they meet."""
    distance = distances(np.array([first.corners]), np.array([second.corners]))[0]
    return float(distance) - first.radius - second.radius
