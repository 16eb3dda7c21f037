"""One guide of a pair (circle, rail or slot) and its point at a pose; `guided.pairs` derives the formulas.

Angles are in radians, lengths are relative to the length scale.
"""

import cython
from cython import cclass, cfunc, double, doublecomplex, final
from cython.cimports.libc.math import cos, sin, sqrt
from cython.cimports.synthesis.kernels.codes import BY_ROTATION, BY_X, BY_Y, GUIDE_UNKNOWNS, PAIR_WIDTH
from cython.cimports.synthesis.kernels.plane import cross, inner, times, vector


@final
@cclass
class Guide:
    """One guide of a pair (circle, rail or slot) and its point at a pose; `guided.pairs` derives the formulas."""

    @cfunc
    def load(self, unknowns: double[::1], labels: double[::1], index: cython.int):
        """Load a guide of a candidate."""
        own = GUIDE_UNKNOWNS * index
        self.index = index
        self.point = vector(unknowns[own], unknowns[own + 1])
        self.inward_normal = vector(cos(unknowns[own + 2]), sin(unknowns[own + 2]))
        self.offset = unknowns[own + 3]
        first = 1 + own
        self.origin = vector(labels[first], labels[first + 1])
        self.unit = labels[first + 2]
        self.is_slot = labels[first + 3] > 0.0
        self.is_straight = labels[first + 4] > 0.0
        self.curvature = 0.0 if self.is_straight else unknowns[own + 4] * self.unit

    @cfunc
    def set_pose(self, turned: doublecomplex, position: doublecomplex):
        """Compute its point, the distance of the point from the curve, and the derivatives with respect to the pose."""
        if self.is_slot:
            self.frame = vector(turned.real, -turned.imag)
            self.rotated_point = self.frame * self.point
            self.local_point = self.rotated_point - self.frame * position
            self.by_rotation = vector(self.local_point.imag, -self.local_point.real)
            self.by_position = vector(-self.frame.real, -self.frame.imag)
        else:
            self.frame = turned
            self.rotated_point = self.frame * self.point
            self.local_point = self.rotated_point + position
            self.by_rotation = vector(-self.rotated_point.imag, self.rotated_point.real)
            self.by_position = vector(1.0, 0.0)
        self.rotation = turned
        away = self.local_point - self.origin - times(self.offset, self.inward_normal)
        bent = self.curvature
        self.foot_offset = away
        self.rise = 0.5 * bent * inner(away, away) - inner(self.inward_normal, away)
        self.root = sqrt(max(1.0 + 2.0 * bent * self.rise, 1e-24))
        self.distance = 2.0 * self.rise / (1.0 + self.root)
        self.normal = times(1.0 / self.root, times(bent, away) - self.inward_normal)
        self.rotation_slope = inner(self.normal, self.by_rotation)
        self.position_slope = vector(inner(self.by_position, self.normal), cross(self.by_position, self.normal))

    @cfunc
    def put_point_slopes(self, out: doublecomplex[::1], moved: doublecomplex):
        """Fill the derivatives, with respect to the body point, of a vector that rotates and scales with it."""
        own = GUIDE_UNKNOWNS * self.index
        out[own] = moved
        out[own + 1] = vector(-moved.imag, moved.real)

    @cfunc
    def distance_slopes(self, out: double[::1]):
        """Fill the derivatives of the distance with respect to the guide's unknowns."""
        own, bent, away = GUIDE_UNKNOWNS * self.index, self.curvature, self.foot_offset
        out[own] = inner(self.normal, self.frame)
        out[own + 1] = -cross(self.normal, self.frame)
        out[own + 2] = -(1.0 + bent * self.offset) * cross(self.inward_normal, away) / self.root
        out[own + 3] = -inner(self.normal, self.inward_normal)
        out[own + 4] = 0.0
        if not self.is_straight:
            ratio = self.rise / (1.0 + self.root)
            out[own + 4] = (0.5 * inner(away, away) - 2.0 * ratio * ratio) / self.root * self.unit

    @cfunc
    def normal_slopes(self, out: double[::1], sign: double):
        """Add the derivatives of the direction of the normal, times a sign."""
        own, bent = GUIDE_UNKNOWNS * self.index, self.curvature
        part = sign / self.root
        out[BY_ROTATION] += part * bent * cross(self.normal, self.by_rotation)
        across = vector(cross(self.normal, self.by_position), inner(self.normal, self.by_position))
        out[BY_X] += part * bent * across.real
        out[BY_Y] += part * bent * across.imag
        out[own] += part * bent * cross(self.normal, self.frame)
        out[own + 1] += part * bent * inner(self.normal, self.frame)
        out[own + 2] -= part * (1.0 + bent * self.offset) * inner(self.normal, self.inward_normal)
        out[own + 3] -= part * bent * cross(self.normal, self.inward_normal)
        if not self.is_straight:
            out[own + 4] += part * self.unit * cross(self.normal, self.foot_offset)

    @cfunc
    def travel(self) -> double:
        """Return the coordinate of the point along a straight curve."""
        return cross(self.inward_normal, self.local_point - self.origin)

    @cfunc
    def travel_slopes(self, out: double[::1]):
        """Add the derivatives of the travel."""
        own = GUIDE_UNKNOWNS * self.index
        out[BY_ROTATION] += cross(self.inward_normal, self.by_rotation)
        out[BY_X] += cross(self.inward_normal, self.by_position)
        out[BY_Y] += inner(self.inward_normal, self.by_position)
        out[own] += cross(self.inward_normal, self.frame)
        out[own + 1] += inner(self.inward_normal, self.frame)
        out[own + 2] -= inner(self.inward_normal, self.local_point - self.origin)

    @cfunc
    def ground_point(self) -> doublecomplex:
        """Return the point of the ground that coincides with the guided point."""
        return self.point if self.is_slot else self.local_point

    @cfunc
    def ground_point_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the ground point."""
        if not self.is_slot:
            self.local_slopes(out)
            return
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        self.put_point_slopes(out, vector(1.0, 0.0))

    @cfunc
    def local_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the guided point in the guide's own frame."""
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        self.put_point_slopes(out, self.frame)
        out[BY_ROTATION] = self.by_rotation
        out[BY_X] = self.by_position
        out[BY_Y] = vector(-self.by_position.imag, self.by_position.real)

    @cfunc
    def pivot(self) -> doublecomplex:
        """Return the centre of a circle or the pin of a slot."""
        if self.is_slot or self.is_straight:
            return self.point
        return self.origin + times(self.offset + 1.0 / self.curvature, self.inward_normal)

    @cfunc
    def pivot_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the pivot."""
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        if self.is_slot or self.is_straight:
            self.put_point_slopes(out, vector(1.0, 0.0))
            return
        own, bent = GUIDE_UNKNOWNS * self.index, self.curvature
        out[own + 2] = times(self.offset + 1.0 / bent, vector(-self.inward_normal.imag, self.inward_normal.real))
        out[own + 3] = self.inward_normal
        out[own + 4] = times(-self.unit / (bent * bent), self.inward_normal)
