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
_EVERY = list(range(len(LINKS)))
_TURNED_OVER = np.array([0.0, np.pi])
"""Crank angles at which the diagonal is shortest and longest."""
_SHORT_LONG = np.array([1.0, -1.0])
_TRACED = {True: (257, 3), False: (25, 1)}
"""Crank angles at which joints are looked at, and how often their extremes are then refined: exactly, and in a search."""
SPARE = 1e-4
"""By which the envelope of a search is smaller."""


class Constraints:
    """The limits of a request, in the unit of the linkages that are to keep them.

    Parameters
    ----------
    limits : Limits
    middle, scale : complex, float
        Positions of the placed linkages are measured from the middle, and all their lengths over the scale.
    exact : bool
        Whether the joints' extremes are found to rounding; otherwise to a part of `SPARE`, by which the envelope is smaller.
    """

    def __init__(self, limits: Limits, middle: complex = 0j, scale: float = 1.0, exact: bool = True) -> None:
        self.limits, self.middle, self.scale, self.exact = limits, middle, scale, exact

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return not self.limits.only_family

    def __call__(self, placed: Placed) -> Constrained:
        """The constraints at linkages."""
        columns, limits = _Columns(placed), self.limits
        if limits.transmission_angle_min:
            columns.transmission("transmission_angle_min", limits.transmission_angle_min, _nearest(placed.used))
        if limits.transmission_angle_min_turn:
            columns.transmission("transmission_angle_min_turn", limits.transmission_angle_min_turn)
        if limits.link_min is not None:
            columns.lengths("link_min", _EVERY, 1.0, -limits.link_min / self.scale)
        if limits.link_max is not None:
            columns.lengths("link_max", _EVERY, -1.0, limits.link_max / self.scale)
        if limits.link_ratio_max is not None:
            columns.ratio("link_ratio_max", limits.link_ratio_max)
        for k, length in enumerate(limits.links):
            if length is not None:
                columns.lengths(f"links.{LINKS[k]}", [k], 1.0, -length / self.scale, equal=True)
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
            box, spare = self._box(limits.envelope), 0.0 if self.exact else SPARE
            box = box[0] + spare, box[1] + spare, box[2] - spare, box[3] - spare
            for point in (columns.pivot_a, columns.pivot_b, *columns.moving_joints(*_TRACED[self.exact])):
                columns.inside("envelope", point, box)

    def _point(self, point: complex) -> complex:
        return (point - self.middle) / self.scale

    def _box(self, box: Box) -> Box:
        low, high = self._point(complex(*box[:2])), self._point(complex(*box[2:]))
        return low.real, low.imag, high.real, high.imag


def _nearest(used: Interval) -> Floats:
    """The crank angles of an interval at which the diagonal is shortest and longest, (n, 2)."""
    first, last = np.minimum(*used)[:, None], np.maximum(*used)[:, None]
    near = _TURNED_OVER + TURN * np.rint(((first + last) / 2 - _TURNED_OVER) / TURN)
    return np.minimum(np.maximum(near, first), last)


class _Point(NamedTuple):
    """A point of linkages, (n,), and its derivatives, (n, 11)."""

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
        values = np.concatenate([np.empty((self.count, 0)), *self.values], axis=1)
        slopes = np.concatenate([np.empty((self.count, 0, COLUMNS)), *self.slopes], axis=1)
        return Constrained(values, slopes, np.array(self.equal, dtype=bool), self.names)

    def add(self, name: str, values: Floats, slopes: Floats, equal: bool = False) -> None:
        """Constraints of one limit: values (n, k) and derivatives (n, k, 11)."""
        self.names += [name] * values.shape[1]
        self.values.append(values)
        self.slopes.append(slopes)
        self.equal += [equal] * values.shape[1]

    # -- angles -------------------------------------------------------------------------------------------------------

    def transmission(self, name: str, least: float, theta1: Floats | None = None) -> None:
        """The transmission angle where the diagonal is shortest and longest: at theta1 (n, 2), or over the turn."""
        l1, l2, l3, l4 = self.placed.lengths.T[:, :, None]
        turn = theta1 is None
        at = _TURNED_OVER if theta1 is None else theta1
        sine, cosine = np.sin(at / 2), np.cos(at)
        square = (l4 - l1) ** 2 + 4 * l1 * l4 * sine**2
        product = l2 * l3
        ratio = (l2**2 + l3**2 - square) / (2 * product)
        slopes = np.zeros((self.count, 2, COLUMNS))
        slopes[:, :, 0], slopes[:, :, _GROUND] = (l4 * cosine - l1) / product, (l1 * cosine - l4) / product
        slopes[:, :, 1], slopes[:, :, 2] = 1 / l3 - ratio / l2, 1 / l2 - ratio / l3
        if not turn:
            by_angle = -l1 * l4 * np.sin(at) / product
            first, last = np.minimum(*self.placed.used)[:, None], np.maximum(*self.placed.used)[:, None]
            slopes[:, :, BEGIN] = np.where(at <= first, by_angle, 0.0)
            slopes[:, :, END] = np.where(at >= last, by_angle, 0.0)
        values = np.cos(least) - _SHORT_LONG * ratio
        slopes *= -_SHORT_LONG[:, None]
        if turn:  # the limit concerns only those whose crank turns fully
            a, b, c = grashof_excesses(self.placed.lengths)
            reaches = (c > 0) & (a * b > 0)
            values, slopes = np.where(reaches[:, None], values, 1.0), np.where(reaches[:, None, None], slopes, 0.0)
        self.add(name, values, slopes)

    # -- lengths ------------------------------------------------------------------------------------------------------

    def lengths(self, name: str, links: list[int], sign: float, rest: float, equal: bool = False) -> None:
        """``sign`` times each of these lengths, and ``rest`` units, is at least 0 (or 0)."""
        lengths, places = self.placed.lengths, np.arange(len(links))
        values, slopes = sign * lengths[:, links], np.zeros((self.count, len(links), COLUMNS))
        slopes[:, places, links] = sign
        if self.placed.pivot is None:
            slopes[:, :, _GROUND] += rest
            self.add(name, values + rest * lengths[:, _GROUND:], slopes, equal)
        else:
            self.add(name, values + rest, slopes, equal)

    def ratio(self, name: str, most: float) -> None:
        """The shortest length, times ``most``, is at least each other."""
        lengths, every = self.placed.lengths, np.arange(len(LINKS))
        shortest = lengths.argmin(axis=1)
        rows, size = np.arange(self.count), lengths.sum(axis=1)[:, None]
        slopes = np.zeros((self.count, len(LINKS), COLUMNS))
        slopes[rows, :, shortest] = most
        slopes[:, every, every] -= 1.0
        values = most * lengths[rows, shortest][:, None] - lengths
        # over the perimeter, whose change does not matter where the constraint holds
        self.add(name, values / size, slopes / size[:, None])

    # -- places -------------------------------------------------------------------------------------------------------

    def at(self, name: str, point: _Point, place: complex) -> None:
        """The point is there."""
        gap = point.place - place
        self.add(name, _two(gap), _two(point.slope), equal=True)

    def near(self, name: str, point: _Point, middle: complex, far: float) -> None:
        """The point is no farther than that from the middle."""
        gap = point.place - middle
        away = np.abs(gap)
        along = np.conj(gap) / np.where(away > 0, away, 1.0)
        self.add(name, (far - away)[:, None], -(along[:, None] * point.slope).real[:, None])

    def inside(self, name: str, point: _Point, box: Box) -> None:
        """The point lies in the box."""
        self.add(name, *_from_sides(point, box))

    def outside(self, name: str, point: _Point, box: Box) -> None:
        """The point lies on the outer side of the side of the box that it is nearest to."""
        values, slopes = _from_sides(point, box)
        rows, best = np.arange(self.count), values.argmin(axis=1)
        self.add(name, -values[rows, best][:, None], -slopes[rows, best][:, None])

    # -- joints that move ---------------------------------------------------------------------------------------------

    def moving_joints(self, traced: int, refinements: int) -> list[_Point]:
        """Crank pin, coupler pin and body point where each goes farthest to each side over the used interval."""
        joint, side = np.divmod(np.arange(12), 4)

        def ways(places: Complexes) -> Floats:
            """How far joints (n, 12, K) are from going beyond their side: least where they go farthest."""
            parts = np.where((side % 2)[:, None] == 1, places.imag, places.real)
            return parts * np.array(_SIGN)[side][:, None]

        step, rows = 1 / (traced - 1), np.arange(self.count)[:, None, None]
        share = np.broadcast_to(np.linspace(0, 1, traced), (self.count, traced))
        trace = ways(self._traced(share)[0][:, joint])
        middle = np.clip(trace.argmin(axis=2), 1, traced - 2)
        three = middle[:, :, None] + np.arange(-1, 2)
        at = _least_near(middle * step, trace[rows, np.arange(12)[:, None], three], step)
        for _ in range(refinements):
            step /= 8
            middle = np.clip(at, step, 1 - step)
            around = self._traced((middle[:, :, None] + step * np.arange(-1, 2)).reshape(self.count, -1))[0]
            own = around[:, joint[:, None], np.arange(36).reshape(12, 3)]
            at = _least_near(middle, ways(own), step)
        places, slopes = self._traced(at, slopes=True)
        assert slopes is not None
        every = np.arange(12)
        places, slopes = places[:, joint, every], slopes[:, joint, every]
        return [_Point(places[:, t], slopes[:, t], (int(side[t]),)) for t in every]

    def _traced(self, share: Floats, slopes: bool = False) -> tuple[Complexes, Complexes | None]:
        """Crank pin, coupler pin, body point at parts of the used interval (n, K): (n, 3, K), and derivatives (n, 3, K, 11)."""
        lengths, used = self.placed.lengths, self.placed.used
        turned, coupler, pivot = self.placed.turned, self.placed.coupler, self.placed.pivot
        assert turned is not None and coupler is not None and pivot is not None
        theta1 = used.first[:, None] + share * (used.last - used.first)[:, None]
        closure = close_loop(lengths, theta1)
        arm = np.exp(1j * closure.coupler_angle(self.placed.branch))
        crank, ground = np.exp(1j * (theta1 + turned[:, None])), np.exp(1j * turned)[:, None]
        pin = lengths[:, :1] * crank
        rods = np.stack([0 * pin, lengths[:, 1:2] * ground * arm, coupler[:, None] * arm], axis=1)
        places = (pivot[:, None] + pin)[:, None] + rods
        if not slopes:
            return places, None
        by_length = closure.coupler_angle_gradient(self.placed.branch)
        slope = np.zeros((self.count, 3, share.shape[1], COLUMNS), dtype=complex)
        slope[..., PIVOT], slope[..., PIVOT + 1] = 1.0, 1j
        slope[..., :BEGIN] = (1j * rods)[..., None] * by_length[:, None, :, :BEGIN]
        slope[..., 0] += crank[:, None]
        slope[:, 1, :, 1] += ground * arm
        slope[..., TURNED] = (1j * pin)[:, None]
        slope[:, 1, :, TURNED] += 1j * rods[:, 1]
        slope[:, 2, :, COUPLER], slope[:, 2, :, COUPLER + 1] = arm, 1j * arm
        by_theta1 = (1j * pin)[:, None] + 1j * rods * by_length[:, None, :, BEGIN]
        slope[..., BEGIN], slope[..., END] = (1 - share)[:, None] * by_theta1, share[:, None] * by_theta1
        return places, slope


_SIGN = (1.0, 1.0, -1.0, -1.0)


def _two(column: Complexes) -> Floats:
    """Real and imaginary parts (n, 2, ...) of a column (n, ...)."""
    return np.stack([column.real, column.imag], axis=1)


def _from_sides(point: _Point, box: Box) -> tuple[Floats, Floats]:
    """How far inside of the sides of a box a point is, (n, k), of those that it may leave: left, lower, right, upper."""
    place, slope = _two(point.place), _two(point.slope)
    values = np.concatenate([place - np.array(box[:2]), np.array(box[2:]) - place], axis=1)
    slopes = np.concatenate([slope, -slope], axis=1)
    if len(point.sides) == len(_SIGN):
        return values, slopes
    return values[:, point.sides], slopes[:, point.sides]


def _least_near(middle: Floats, values: Floats, step: float) -> Floats:
    """Where a function is least, from its values (..., 3) a step before a place, there, and a step after: a parabola's vertex."""
    before, here, after = np.moveaxis(values, -1, 0)
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.where(bend > 0, 0.5 * (before - after) / bend, np.sign(before - after))
    return np.clip(middle + step * np.clip(np.nan_to_num(vertex), -1, 1), 0.0, 1.0)
