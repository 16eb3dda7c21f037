"""Limits as smooth functions of a placed linkage, at least 0 where they are kept, with their derivatives.

A search descends along them, and an answer is checked by them. All are over the length scale, of order one. Equations, such
as a given pivot, are 0 where they are kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import close_loop, grashof_excesses
from synthesis.fourbar.limits import LINKS, Box, Limits
from synthesis.mechanism import Constrained, Placed
from synthesis.target import TURN, Interval

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

BEGIN, END, PIVOT, TURNED, COUPLER = 4, 5, 6, 8, 9
COLUMNS = 11
"""Derivatives as `mechanism.Constrained` has them."""
_GROUND = 3
_TRACED = 33
"""Crank angles at which joints are looked at before their extremes are refined."""


class Constraints:
    """The limits of a request, in the unit of the linkages that are to keep them.

    Parameters
    ----------
    limits : Limits
    middle, scale : complex, float
        Positions of the placed linkages are measured from the middle, and all their lengths over the scale.
    """

    def __init__(self, limits: Limits, middle: complex = 0j, scale: float = 1.0) -> None:
        self.limits, self.middle, self.scale = limits, middle, scale

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return not self.limits.only_family

    def __call__(self, placed: Placed) -> Constrained:
        """The constraints at linkages."""
        columns, limits = _Columns(placed), self.limits
        if limits.transmission_angle_min:
            columns.transmission("transmission_angle_min", limits.transmission_angle_min, *_nearest(placed.used))
        if limits.transmission_angle_min_turn:
            columns.transmission("transmission_angle_min_turn", limits.transmission_angle_min_turn)
        if limits.link_min is not None:
            columns.lengths("link_min", 1.0, -limits.link_min / self.scale)
        if limits.link_max is not None:
            columns.lengths("link_max", -1.0, limits.link_max / self.scale)
        if limits.link_ratio_max is not None:
            columns.ratio("link_ratio_max", limits.link_ratio_max)
        for k, length in enumerate(limits.links):
            if length is not None:
                columns.length(f"links.{LINKS[k]}", k, 1.0, -length / self.scale, equal=True)
        if placed.pivot is not None:
            self._on_pose(columns)
        return columns.result()

    def _on_pose(self, columns: _Columns) -> None:
        limits, reach = self.limits, self.limits.pivot_reach
        for name, pivot, given in (
            ("pivot_a", columns.pivot_a, limits.pivot_a),
            ("pivot_b", columns.pivot_b, limits.pivot_b),
        ):
            if given is not None:
                columns.at(name, pivot, self._point(given))
                continue
            for box_name in (f"{name}_box", "pivot_box"):
                if (box := getattr(limits, box_name)) is not None:
                    columns.inside(box_name, pivot, self._box(box))
            if reach is not None and (far := getattr(reach, name)) is not None:
                columns.near("pivot_reach", pivot, self._point(reach.middle), far / self.scale)
            for out in limits.keep_out:
                columns.outside("keep_out", pivot, self._box(out))
        if limits.coupler_radius_max is not None:
            columns.near("coupler_radius_max", columns.coupler, 0j, limits.coupler_radius_max / self.scale)
        if limits.envelope is not None:
            box = self._box(limits.envelope)
            for point in (columns.pivot_a, columns.pivot_b, *columns.moving_joints()):
                columns.inside("envelope", point, box)

    def _point(self, point: complex) -> complex:
        return (point - self.middle) / self.scale

    def _box(self, box: Box) -> Box:
        low, high = self._point(complex(*box[:2])), self._point(complex(*box[2:]))
        return low.real, low.imag, high.real, high.imag


def _nearest(used: Interval) -> tuple[Floats, Floats]:
    """The crank angles of an interval at which the diagonal is shortest and longest, (n,) each."""
    first, last = np.minimum(*used), np.maximum(*used)
    middle = (first + last) / 2
    near = [np.clip(far + TURN * np.rint((middle - far) / TURN), first, last) for far in (0.0, np.pi)]
    return near[0], near[1]


class _Point(NamedTuple):
    """A point of linkages, (n,), and its derivatives, (n, 11); moving ones hold (n, K) extremes of each direction."""

    place: Complexes
    slope: Complexes
    sides: tuple[int, ...] = (0, 1, 2, 3)
    """Which sides of a box it may leave: left, lower, right, upper."""


class _Columns:
    """Collects the constraints of one batch of linkages."""

    def __init__(self, placed: Placed) -> None:
        self.placed = placed
        self.count = len(placed.lengths)
        self.values: list[Floats] = []
        self.slopes: list[Floats] = []
        self.equal: list[bool] = []
        self.names: list[str] = []
        if placed.pivot is None:
            return
        assert placed.turned is not None and placed.coupler is not None
        one = np.exp(1j * placed.turned)
        ground = placed.lengths[:, _GROUND] * one
        slope = np.zeros((self.count, COLUMNS), dtype=complex)
        slope[:, PIVOT], slope[:, PIVOT + 1] = 1.0, 1j
        self.pivot_a = _Point(placed.pivot, slope)
        slope = slope.copy()
        slope[:, _GROUND], slope[:, TURNED] = one, 1j * ground
        self.pivot_b = _Point(placed.pivot + ground, slope)
        slope = np.zeros((self.count, COLUMNS), dtype=complex)
        slope[:, COUPLER], slope[:, COUPLER + 1] = 1.0, 1j
        self.coupler = _Point(placed.coupler, slope)

    def result(self) -> Constrained:
        """All that was collected."""
        values, slopes = np.empty((self.count, 0)), np.empty((self.count, 0, COLUMNS))
        if self.values:
            values, slopes = np.stack(self.values, axis=1), np.stack(self.slopes, axis=1)
        return Constrained(values, slopes, np.array(self.equal, dtype=bool), self.names)

    def add(self, name: str, value: Floats, slope: Floats, equal: bool = False) -> None:
        """One constraint: values (n,) and derivatives (n, 11)."""
        self.names.append(name)
        self.values.append(value)
        self.slopes.append(slope)
        self.equal.append(equal)

    # -- angles -------------------------------------------------------------------------------------------------------

    def transmission(self, name: str, least: float, near: Floats | None = None, far: Floats | None = None) -> None:
        """The transmission angle where the diagonal is shortest and longest: at ``near`` and ``far``, or over the turn."""
        l1, l2, l3, l4 = self.placed.lengths.T
        turn = near is None
        reaches = np.ones(self.count, dtype=bool)
        if turn:  # the limit concerns only those whose crank turns fully
            a, b, c = grashof_excesses(self.placed.lengths)
            reaches = (c > 0) & (a * b > 0)
        for sign, angle in ((1.0, near), (-1.0, far)):
            theta1 = np.full(self.count, 0.0 if sign > 0 else np.pi) if angle is None else angle
            sine, cosine = np.sin(theta1 / 2), np.cos(theta1)
            square = (l4 - l1) ** 2 + 4 * l1 * l4 * sine**2
            ratio = (l2**2 + l3**2 - square) / (2 * l2 * l3)
            slope = np.zeros((self.count, COLUMNS))
            slope[:, 0], slope[:, _GROUND] = (l4 * cosine - l1) / (l2 * l3), (l1 * cosine - l4) / (l2 * l3)
            slope[:, 1], slope[:, 2] = 1 / l3 - ratio / l2, 1 / l2 - ratio / l3
            if not turn:
                by_angle = -l1 * l4 * np.sin(theta1) / (l2 * l3)
                first, last = np.minimum(*self.placed.used), np.maximum(*self.placed.used)
                slope[:, BEGIN] = np.where(theta1 <= first, by_angle, 0.0)
                slope[:, END] = np.where(theta1 >= last, by_angle, 0.0)
            value = np.cos(least) - sign * ratio
            self.add(name, np.where(reaches, value, 1.0), np.where(reaches[:, None], -sign * slope, 0.0))

    # -- lengths ------------------------------------------------------------------------------------------------------

    def length(self, name: str, k: int, sign: float, rest: float, equal: bool = False) -> None:
        """``sign`` times the length k, and ``rest`` units, is at least 0 (or 0)."""
        lengths = self.placed.lengths
        slope = np.zeros((self.count, COLUMNS))
        slope[:, k] = sign
        if self.placed.pivot is None:
            slope[:, _GROUND] += rest
            self.add(name, sign * lengths[:, k] + rest * lengths[:, _GROUND], slope, equal)
        else:
            self.add(name, sign * lengths[:, k] + rest, slope, equal)

    def lengths(self, name: str, sign: float, rest: float) -> None:
        """The same for each length."""
        for k in range(len(LINKS)):
            self.length(name, k, sign, rest)

    def ratio(self, name: str, most: float) -> None:
        """The shortest length, times ``most``, is at least each other."""
        lengths = self.placed.lengths
        shortest = lengths.argmin(axis=1)
        rows, size = np.arange(self.count), lengths.sum(axis=1)
        for k in range(len(LINKS)):
            slope = np.zeros((self.count, COLUMNS))
            slope[rows, shortest] = most
            slope[:, k] -= 1.0
            value = most * lengths[rows, shortest] - lengths[:, k]
            # over the perimeter, whose change does not matter where the constraint holds
            self.add(name, value / size, slope / size[:, None])

    # -- places -------------------------------------------------------------------------------------------------------

    def at(self, name: str, point: _Point, place: complex) -> None:
        """The point is there."""
        gap = point.place - place
        self.add(name, gap.real, point.slope.real, equal=True)
        self.add(name, gap.imag, point.slope.imag, equal=True)

    def near(self, name: str, point: _Point, middle: complex, far: float) -> None:
        """The point is no farther than that from the middle."""
        gap = point.place - middle
        away = np.abs(gap)
        along = np.conj(gap) / np.where(away > 0, away, 1.0)
        self.add(name, far - away, -(along[:, None] * point.slope).real)

    def inside(self, name: str, point: _Point, box: Box) -> None:
        """The point lies in the box."""
        for side in point.sides:
            value, slope = _from_side(point, box, side)
            self.add(name, value, slope)

    def outside(self, name: str, point: _Point, box: Box) -> None:
        """The point lies on the outer side of the side of the box that it is nearest to."""
        parts = [_from_side(point, box, side) for side in point.sides]
        values, slopes = np.stack([-value for value, _ in parts]), np.stack([-slope for _, slope in parts])
        best = values.argmax(axis=0)
        rows = np.arange(self.count)
        self.add(name, values[best, rows], slopes[best, rows])

    # -- joints that move ---------------------------------------------------------------------------------------------

    def moving_joints(self) -> list[_Point]:
        """Crank pin, coupler pin and body point where each goes farthest to each side over the used interval."""
        share = np.broadcast_to(np.linspace(0, 1, _TRACED), (self.count, _TRACED))
        trace = [joint.place for joint in self._joints(share)]
        farthest, step = [], 1 / (_TRACED - 1)
        for place in trace:
            for side in range(4):
                way = _SIGN[side] * (place.imag if side % 2 else place.real)  # least where it goes farthest
                farthest.append((way.argmin(axis=1), way))
        at = np.stack([_refined(k, way, step) for k, way in farthest], axis=1)
        joints = self._joints(at)
        return [
            _Point(joint.place[:, 4 * j + side], joint.slope[:, 4 * j + side], (side,))
            for j, joint in enumerate(joints)
            for side in range(4)
        ]

    def _joints(self, share: Floats) -> list[_Point]:
        """The moving joints at parts of the used interval (n, K): places (n, K) and derivatives (n, K, 11)."""
        lengths, used = self.placed.lengths, self.placed.used
        turned, coupler, pivot = self.placed.turned, self.placed.coupler, self.placed.pivot
        assert turned is not None and coupler is not None and pivot is not None
        theta1 = used.first[:, None] + share * (used.last - used.first)[:, None]
        closure = close_loop(lengths, theta1)
        theta2 = closure.coupler_angle(self.placed.branch)
        by_length = closure.coupler_angle_gradient(self.placed.branch)
        crank, arm = np.exp(1j * (theta1 + turned[:, None])), np.exp(1j * theta2)
        pin = lengths[:, :1] * crank
        points = []
        slope = np.zeros((*share.shape, COLUMNS), dtype=complex)
        slope[..., PIVOT], slope[..., PIVOT + 1] = 1.0, 1j
        slope[..., 0], slope[..., TURNED] = crank, 1j * pin
        points.append((pivot[:, None] + pin, slope, 1j * pin))
        for rod, on_ground in ((lengths[:, 1:2] * np.exp(1j * turned)[:, None], True), (coupler[:, None], False)):
            reach = rod * arm
            mine, by_theta1 = slope.copy(), 1j * pin + 1j * reach * by_length[..., 4]
            mine[..., :4] += (1j * reach)[..., None] * by_length[..., :4]
            if on_ground:
                mine[..., 1] += reach / lengths[:, 1:2]
                mine[..., TURNED] += 1j * reach
            else:
                mine[..., COUPLER], mine[..., COUPLER + 1] = arm, 1j * arm
            points.append((pivot[:, None] + pin + reach, mine, by_theta1))
        for _, mine, by_theta1 in points:
            mine[..., BEGIN], mine[..., END] = (1 - share) * by_theta1, share * by_theta1
        return [_Point(place, mine) for place, mine, _ in points]


_SIGN = (1.0, 1.0, -1.0, -1.0)


def _from_side(point: _Point, box: Box, side: int) -> tuple[Floats, Floats]:
    """How far inside of a side of a box a point is: left, lower, right or upper."""
    sign = _SIGN[side]
    place, slope = (point.place.imag, point.slope.imag) if side % 2 else (point.place.real, point.slope.real)
    return sign * (place - box[side]), sign * slope


def _refined(least: NDArray[np.intp], values: Floats, step: float) -> Floats:
    """Parts of the interval where a function is least, from its values at steps (n, K): the vertex of a parabola."""
    last = values.shape[1] - 1
    rows, middle = np.arange(len(values)), np.clip(least, 1, last - 1)
    before, here, after = (values[rows, middle + d] for d in (-1, 0, 1))
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.where(bend > 0, 0.5 * (before - after) / bend, 0.0)
    inner = (least > 0) & (least < last) | (np.abs(vertex) < 1)
    return np.clip(np.where(inner, middle + np.clip(vertex, -1, 1), least) * step, 0.0, 1.0)

