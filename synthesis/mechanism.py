"""Shapes of four-bars in charts, and four-bars placed within limits.

The crank turns by theta1, the coupler, which is the *body*, by theta2, and a point P of the body moves as::

    P = A + z1 e^{i theta1} + z2 e^{i theta2}

with A the fixed pivot of the crank, so that pose and body point are linear (see `pose`). All lengths scale together. A *shape* is
a set of lengths up to scale, and a *chart* describes shapes by unknowns without bounds. A *candidate* consists of the unknowns of
a shape, theta1 at the first sample, and a branch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.kernels import crank_loops
from synthesis.target import Interval

Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax"""


def outside(points: Any, box: Box) -> Floats:
    """Return distances of points from a box; negative inside, where the distance to the closest side counts."""
    x, y = np.real(points), np.imag(points)
    return np.asarray(np.maximum(np.maximum(box[0] - x, x - box[2]), np.maximum(box[1] - y, y - box[3])))


class BodyAngles(NamedTuple):
    """Rotation of the body of candidates."""

    angle: Floats
    """(n, N): theta2, continuous; any numbers where the candidate does not close."""
    slope: Floats
    """(n, k + 1, N): derivatives of theta2 by the unknowns and theta1; empty if derivatives are not required."""
    closes: Flags
    """(n,): which candidates close at every crank angle."""


class Shape(NamedTuple):
    """Lengths at points of a chart."""

    lengths: Floats
    """(n, d)"""
    x0: Floats
    """(n,): the two numbers that the loop closes by, see `crank_loops.Loop`,"""
    y0: Floats
    """formed without cancellation."""
    jacobian: Floats
    """(n, d, k): derivatives of the lengths by the chart's unknowns."""


class Chart:
    """Coordinates of shapes for a search: unknowns (n, k) that the compiled kernel makes lengths of."""

    kind: int
    """Code of the chart in the kernel."""
    cell: Floats
    """Extent of unknowns and start within which two seeds are alike, (k + 1,)."""
    hop: Floats
    """Scale of the perturbations of unknowns and start that reach other valleys, (k + 1,)."""

    def shape(self, unknowns: Floats) -> Shape:
        """Shapes at unknowns."""
        return Shape(*crank_loops.shapes(self.kind, np.array(unknowns, dtype=float, order="C")))

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, k) of lengths (n, d). Law: ``unknowns(shape(x).lengths) == x`` for moderate x."""
        raise NotImplementedError

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Perturb unknowns by noise (n, k) in units of order one."""
        return unknowns + np.clip(noise, -8.0, 8.0)

    def shape_coordinates(self, unknowns: Floats) -> Floats:
        """Return coordinates (n, c) of shapes, independent of scale; shapes in the same unit cell are similar."""
        raise NotImplementedError

    def at(self, unknowns: Floats, theta1: Floats, branch: Floats, derivatives: bool = True) -> BodyAngles:
        """Angles of shapes (n, k) at crank angles (n, N), each candidate's own."""
        shape, theta1 = self.shape(unknowns), np.array(theta1, dtype=float, order="C")
        side = np.array(branch, dtype=float, order="C")
        angle, slopes, closes = crank_loops.body_angles(*shape[:3], side, theta1, derivatives)
        slope = slopes
        if derivatives:
            by_shape = np.matmul(shape.jacobian.transpose(0, 2, 1), slopes[:, :-1])
            slope = np.concatenate([by_shape, slopes[:, -1:]], axis=1)
        return BodyAngles(angle, slope, closes.all(axis=1))


class Placed(NamedTuple):
    """Linkages in their pose, n of them. Without a pose the unit of length is the last length."""

    lengths: Floats
    """(n, d)"""
    branch: Floats
    used: Interval
    """theta1 where the motion begins and ends, (n,) each."""
    pivot: Complexes | None = None
    turned: Floats | None = None
    """Ground angle."""
    coupler: Complexes | None = None
    """z2 of the position."""

    def over(self, middle: complex, scale: float) -> Placed:
        """Return the target with positions relative to a centre and all lengths over a scale."""
        assert self.pivot is not None and self.coupler is not None
        pivot, coupler = (self.pivot - middle) / scale, self.coupler / scale
        return self._replace(lengths=self.lengths / scale, pivot=pivot, coupler=coupler)


class Constrained(NamedTuple):
    """Limits as smooth functions of placed linkages."""

    values: Floats
    """(n, C): at least 0 where a limit is kept, 0 where an equation is; NaN where a linkage does not close."""
    slopes: Floats
    """(n, C, d + 7): by the lengths, the first and last theta1, pivot A (x, y), the ground angle and z2 (x, y)."""
    equal: Flags
    """(C,): which are equations."""
    names: list[str]
    """Scale of the limit of each constraint, (C,)."""

    @property
    def lacking(self) -> Floats:
        """Return the violation of each constraint, (n, C)."""
        return np.where(self.equal, np.abs(self.values), np.maximum(-self.values, 0.0))


class Boxes(NamedTuple):
    """Positions that the limits allow for the pivots, as required for seeds; lengths over l, positions from the mean position."""

    pivot_a: Box
    pivot_b: Box
    shortest: Floats
    """(d,) least lengths."""
    longest: Floats
    """(d,) largest lengths."""

    def clip_a(self, point: Complexes) -> Complexes:
        """The nearest places for pivot A."""
        return _clipped(point, self.pivot_a)

    def clip_b(self, point: Complexes) -> Complexes:
        """The nearest places for pivot B."""
        return _clipped(point, self.pivot_b)

    def reach(self, lengths: Floats) -> tuple[Floats, Floats]:
        """Least and largest ground of types (n, d) whose lengths are all allowed, (n,) each."""
        ratio = lengths / lengths[:, -1:]
        return np.max(self.shortest / ratio, axis=1), np.min(self.longest / ratio, axis=1)


def _clipped(point: Complexes, box: Box) -> Complexes:
    return np.clip(point.real, box[0], box[2]) + 1j * np.clip(point.imag, box[1], box[3])
