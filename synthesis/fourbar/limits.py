"""What a linkage must keep to: the limits of a request, and each of them as smooth functions with derivatives.

`Limits` states each limit once: its default, the form in which it is given (`Form`) and its text. `Constraints` holds each as
smooth functions of placed linkages, at least 0 where it is kept, all over the length scale and of order one; equations, such
as a given pivot, are 0 where they are kept. A search descends along them, and an answer is checked by them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import permutations
from typing import Annotated, Any, Literal, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import EXCESSES, close_loop, grashof_excesses
from synthesis.mechanism import Box, Constrained, Placed
from synthesis.target import TURN, Interval, Samples

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

FAMILIES = ("full_crank", "crank_rocker", "double_crank", "any")
LINKS = ("crank", "coupler", "rocker", "ground")
# the practical limits: where a request says so, and what a verdict calls practical
TRANSMISSION_ANGLE = np.deg2rad(35.0)
"""Least over the used interval: below it friction grows, and play in the pins shows."""
TRANSMISSION_ANGLE_TURN = np.deg2rad(15.0)
"""Least over the whole turn, where the crank turns fully."""
LINK_RATIO = 10.0
"""Most of the longest link over the shortest."""
REACH = 10.0
"""No link, and no distance of a pivot from the motion's middle, is longer than this many extents of the motion."""
# tuning of the constraints
_TRACED = {True: (257, 3), False: (25, 1)}
"""Crank angles at which joints are looked at, and how often their extremes are then refined: exactly, and in a search."""
SPARE = 1e-4
"""Part of the length scale by which the envelope of a search is smaller."""


def in_family(family: str, lengths: Floats) -> Flags:
    """Which linkages (n, 4) are of one of `FAMILIES`, whatever their interval, shape (n,)."""
    a, b, c = grashof_excesses(lengths)
    crank_rocker = (a > 0) & (b > 0) & (c > 0)
    double_crank = (a < 0) & (b < 0) & (c > 0)
    return {
        "full_crank": crank_rocker | double_crank,
        "crank_rocker": crank_rocker,
        "double_crank": double_crank,
        "any": np.ones(len(lengths), dtype=bool),
    }[family]


# -- what is asked ----------------------------------------------------------------------------------------------------


class Reach(NamedTuple):
    """How far from a point the fixed pivots may lie; None: as far as they like."""

    middle: complex
    pivot_a: float | None
    pivot_b: float | None


class Form(NamedTuple):
    """How a limit is given, and what it says."""

    kind: Literal["family", "angle", "length", "ratio", "links", "point", "box", "boxes", "reach"]
    """``reach`` is none that a request gives: the practical limits set it."""
    concerns: Literal["shape", "lengths", "place"]
    """Length ratios and the start alone; actual lengths; or where the linkage stands."""
    says: str
    """Its description in a request."""
    least: bool = False
    """Whether a length is the least and not the largest; angles are the least."""


@dataclass(frozen=True)
class Limits:
    """Limits of a request; angles in radians, lengths in the user's unit (without positions: the ground is 1)."""

    family: Annotated[
        str, Form("family", "shape", "`any`: closes over the used interval without changing its branch.")
    ] = "full_crank"
    transmission_angle_min: Annotated[
        float, Form("angle", "shape", "Smallest transmission angle over the used interval.")
    ] = 0.0
    transmission_angle_min_turn: Annotated[
        float,
        Form(
            "angle",
            "shape",
            "Smallest transmission angle over the whole turn, where the crank turns fully.",
        ),
    ] = 0.0
    pivot_a: Annotated[complex | None, Form("point", "place", "The crank's fixed pivot is given.")] = None
    pivot_b: Annotated[complex | None, Form("point", "place", "The rocker's fixed pivot is given.")] = None
    pivot_box: Annotated[Box | None, Form("box", "place", "xmin, ymin, xmax, ymax for both fixed pivots.")] = None
    pivot_a_box: Annotated[Box | None, Form("box", "place", "The same for the crank's pivot.")] = None
    pivot_b_box: Annotated[Box | None, Form("box", "place", "The same for the rocker's pivot.")] = None
    pivot_reach: Annotated[Reach | None, Form("reach", "place", "The distance of the pivots.")] = None
    keep_out: Annotated[tuple[Box, ...], Form("boxes", "place", "Boxes in which no fixed pivot may lie.")] = ()
    link_ratio_max: Annotated[float | None, Form("ratio", "shape", "Longest link over the shortest, at most.")] = None
    link_min: Annotated[float | None, Form("length", "lengths", "Shortest length of any link.", least=True)] = None
    link_max: Annotated[float | None, Form("length", "lengths", "Longest length of any link.")] = None
    links: Annotated[tuple[float | None, ...], Form("links", "lengths", "Lengths that are given.")] = (None,) * 4
    coupler_radius_max: Annotated[
        float | None, Form("length", "place", "Farthest place of the body point from the crank pin.")
    ] = None
    envelope: Annotated[
        Box | None,
        Form(
            "box",
            "place",
            "A box for all joints and the body point over the used interval: xmin, ymin, xmax, ymax.",
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise FieldError("/limits/family", f"wanted one of {', '.join(FAMILIES)}")
        for name in of_kind("angle"):
            if not 0 <= getattr(self, name) < np.pi / 2:
                raise FieldError(f"/limits/{name}", "wanted 0 to less than 90 degrees")
        boxes = [(name, getattr(self, name)) for name in of_kind("box")]
        boxes += [(f"keep_out/{k}", box) for k, box in enumerate(self.keep_out)]
        for name, box in boxes:
            if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
                raise FieldError(
                    f"/limits/{name}", "wanted [xmin, ymin, xmax, ymax] with xmin <= xmax and ymin <= ymax"
                )
        lengths = [(name, getattr(self, name)) for name in of_kind("length")]
        lengths += [(f"links/{name}", length) for name, length in zip(LINKS, self.links)]
        for name, value in lengths:
            if value is not None and not value > 0:
                raise FieldError(f"/limits/{name}", "wanted a length above 0")
        for name in of_kind("ratio"):
            if (value := getattr(self, name)) is not None and not value >= 1:
                raise FieldError(f"/limits/{name}", "wanted a ratio of at least 1")
        self._check_lengths()
        self._check_pivots()

    def _check_lengths(self) -> None:
        low, high = self.link_min or 0.0, self.link_max or np.inf
        if low > high:
            raise FieldError("/limits/link_min", "is above link_max")
        for name, length in zip(LINKS, self.links):
            if length is not None and not low <= length <= high:
                raise FieldError(f"/limits/links/{name}", "lies outside of link_min and link_max")
        given = [length for length in self.links if length is not None]
        if self.link_ratio_max is not None and given and max(given) > self.link_ratio_max * min(given):
            raise FieldError("/limits/link_ratio_max", "the given lengths exceed it")

    def _check_pivots(self) -> None:
        if self.pivot_a is not None and self.pivot_b is not None:
            apart, ground = abs(self.pivot_b - self.pivot_a), self.links[3]
            if not apart > 0:
                raise FieldError("/limits/pivot_b", "is the same point as pivot_a")
            if ground is not None and abs(apart - ground) > 1e-9 * ground:
                raise FieldError("/limits/links/ground", f"the given pivots are {apart:.6g} apart")
            low, high = self.link_min or 0.0, self.link_max or np.inf
            if not low <= apart <= high:
                raise FieldError(
                    "/limits/pivot_b", "the given pivots are nearer than link_min or farther than link_max"
                )
        for name, point, box in (
            ("pivot_a", self.pivot_a, self.box("pivot_a_box")),
            ("pivot_b", self.pivot_b, self.box("pivot_b_box")),
        ):
            if point is not None:
                if box is not None and not (box[0] <= point.real <= box[2] and box[1] <= point.imag <= box[3]):
                    raise FieldError(f"/limits/{name}", "lies outside of the box that it must lie in")
                if any(out[0] < point.real < out[2] and out[1] < point.imag < out[3] for out in self.keep_out):
                    raise FieldError(f"/limits/{name}", "lies in a box of keep_out")
        for name in ("pivot_a_box", "pivot_b_box"):
            box = self.box(name)
            if box is not None and (box[0] > box[2] or box[1] > box[3]):
                raise FieldError(f"/limits/{name}", "has no point in common with pivot_box or envelope")

    def box(self, name: str) -> Box | None:
        """Where a pivot may lie by all boxes that concern it; ``name`` is its own: pivot_a_box or pivot_b_box."""
        boxes = [one for one in (self.pivot_box, getattr(self, name), self.envelope) if one is not None]
        if not boxes:
            return None
        return (*np.max(boxes, axis=0)[:2].tolist(), *np.min(boxes, axis=0)[2:].tolist())

    def check_against(self, samples: Samples) -> None:
        """FieldError for limits that have no meaning for these samples, or that no linkage keeps."""
        if None not in self.links and 2 * max(given := [length or 0.0 for length in self.links]) >= sum(given):
            raise FieldError("/limits/links", "the given lengths do not close: one is as long as the others together")
        if samples.position is not None:
            return
        for name, form in FORMS.items():
            if form.concerns == "place" and getattr(self, name) not in (None, ()):
                raise FieldError(f"/limits/{name}", "needs `position`: without it nothing is mounted")
        if self.links[3] not in (None, 1.0):
            raise FieldError("/limits/links/ground", "without `position` the ground is 1")

    def mirrored(self) -> Limits:
        """The same limits for a target mirrored in the x axis."""
        mirror: dict[str, Callable[[Any], Any]] = {
            "point": lambda point: point.conjugate(),
            "box": _flipped,
            "boxes": lambda boxes: tuple(map(_flipped, boxes)),
            "reach": lambda reach: reach._replace(middle=reach.middle.conjugate()),
        }
        changed: dict[str, Any] = {
            name: value and mirror[FORMS[name].kind](value)
            for name, value in vars(self).items()
            if name in FORMS and FORMS[name].kind in mirror
        }
        return replace(self, **changed)

    def exchanged(self) -> Limits:
        """The same limits for linkages with coupler and rocker exchanged."""
        crank, coupler, rocker, ground = self.links
        return replace(self, links=(crank, rocker, coupler, ground))

    def over(self, ground: float) -> Limits:
        """The limits of shape and lengths, lengths over that of a ground, which is then 1."""
        links = [None if length is None else length / ground for length in self.links[:3]]
        kept: dict[str, Any] = {
            name: value / ground if FORMS[name].kind == "length" else value
            for name in self.given
            if FORMS[name].concerns != "place" and (value := getattr(self, name)) is not None
        }
        return Limits(**kept | {"links": (*links, None)})

    @property
    def given(self) -> list[str]:
        """Names of the limits that are given: those of shape, of lengths, of places, and the family last."""
        order = ("shape", "lengths", "place")
        names = [name for name in FORMS if getattr(self, name) != _FREE[name]]
        return sorted(names, key=lambda name: (name == "family", order.index(FORMS[name].concerns)))

    @cached_property
    def only_family(self) -> bool:
        """Whether nothing but the family is limited."""
        return set(self.given) <= {"family"}

    @cached_property
    def of_shape(self) -> Limits:
        """Those of the limits that concern length ratios and the start alone."""
        return Limits(**{name: getattr(self, name) for name, form in FORMS.items() if form.concerns == "shape"})

    @cached_property
    def on_shape(self) -> bool:
        """Whether there are no others, so that a shape's best pose is as good as any."""
        return self == self.of_shape


FORMS: dict[str, Form] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(Limits, include_extras=True).items()
}
"""The form of each limit."""
_FREE = {one.name: one.default for one in fields(Limits)}


def of_kind(kind: str) -> list[str]:
    """Names of the limits of a kind, see `Form`."""
    return [name for name, form in FORMS.items() if form.kind == kind]


def _flipped(box: Box) -> Box:
    return box[0], -box[3], box[2], -box[1]


def practical_limits(samples: Samples, given: dict[str, Any]) -> dict[str, Any]:
    """The practical limits as arguments of `Limits`; one that is given replaces them where it says the same.

    Parameters
    ----------
    samples : Samples
        The motion, whose extent limits lengths and distances.
    given : dict
        Arguments of `Limits` that a request gives.
    """
    asked: dict[str, Any] = {
        "transmission_angle_min": TRANSMISSION_ANGLE,
        "transmission_angle_min_turn": TRANSMISSION_ANGLE_TURN,
        "link_ratio_max": LINK_RATIO,
    }
    if samples.position is not None:
        far, middle = REACH * samples.extent, complex(samples.position_mean(samples.position))
        asked["link_max"] = max(far, given.get("link_min", 0.0), *(one or 0.0 for one in given.get("links", ())), 0.0)
        places = [
            None if given.keys() & {name, f"{name}_box", "pivot_box", "envelope"} else far
            for name in ("pivot_a", "pivot_b")
        ]
        asked["pivot_reach"] = Reach(middle, *places)
    lengths = [one for one in given.get("links", ()) if one is not None]
    if lengths:
        asked["link_ratio_max"] = max(LINK_RATIO, max(lengths) / min(lengths))
    return asked | given


def placed_by(limits: Limits, pivot: str) -> bool:
    """Whether limits themselves say where a fixed pivot, ``pivot_a`` or ``pivot_b``, lies."""
    return any(getattr(limits, name) is not None for name in (pivot, f"{pivot}_box", "pivot_box", "envelope"))


# -- as functions -----------------------------------------------------------------------------------------------------

BEGIN, END, PIVOT, TURNED, COUPLER = 4, 5, 6, 8, 9
COLUMNS = 11
"""Derivatives as `mechanism.Constrained` has them."""
_GROUND = 3
_EVERY = list(range(len(LINKS)))
_TURNED_OVER = np.array([0.0, np.pi])
"""Crank angles at which the diagonal is shortest and longest."""
_SHORT_LONG = np.array([1.0, -1.0])


class Constraints:
    """The limits of a request as functions, in the unit of the linkages that are to keep them.

    Parameters
    ----------
    limits : Limits
    middle, scale : complex, float
        Positions of the placed linkages are measured from the middle, and all their lengths over the scale.
    exact : bool
        Whether the joints' extremes are found to rounding; otherwise to a part of `SPARE`, by which the envelope is smaller.
    smooth : bool
        Whether each constraint is smooth wherever the linkage is, the family among them: for a search over all length ratios.
        Otherwise the charts hold the family.
    """

    def __init__(
        self, limits: Limits, middle: complex = 0j, scale: float = 1.0, exact: bool = True, smooth: bool = False
    ) -> None:
        self.limits, self.middle, self.scale, self.exact, self.smooth = limits, middle, scale, exact, smooth

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return not self.limits.only_family

    def __call__(self, placed: Placed) -> Constrained:
        """The constraints at linkages."""
        columns, limits = _Columns(placed), self.limits
        if limits.transmission_angle_min:
            columns.transmission("transmission_angle_min", limits.transmission_angle_min, _nearest(placed.used))
        if self.smooth and limits.family != "any":
            columns.family("family", limits.family)
        if limits.transmission_angle_min_turn:
            least = limits.transmission_angle_min_turn
            columns.transmission("transmission_angle_min_turn", least, every=self.smooth and limits.family != "any")
        if limits.link_min is not None:
            columns.lengths("link_min", _EVERY, 1.0, -limits.link_min / self.scale)
        if limits.link_max is not None:
            columns.lengths("link_max", _EVERY, -1.0, limits.link_max / self.scale)
        if limits.link_ratio_max is not None:
            (columns.ratios if self.smooth else columns.ratio)("link_ratio_max", limits.link_ratio_max)
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
        values = np.concatenate([np.empty((self.count, 0)), *self.values], axis=1)
        slopes = np.concatenate([np.empty((self.count, 0, COLUMNS)), *self.slopes], axis=1)
        return Constrained(values, slopes, np.array(self.equal, dtype=bool), self.names)

    def add(self, name: str, values: Floats, slopes: Floats, equal: bool = False) -> None:
        self.names += [name] * values.shape[1]
        self.values.append(values)
        self.slopes.append(slopes)
        self.equal += [equal] * values.shape[1]

    # -- angles -------------------------------------------------------------------------------------------------------

    def transmission(self, name: str, least: float, theta1: Floats | None = None, every: bool = False) -> None:
        """The transmission angle where the diagonal is shortest and longest: at theta1 (n, 2), or over the turn.

        A limit over the turn concerns ``every`` linkage, or only those whose crank turns fully.
        """
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
        if turn and not every:
            reaches = in_family("full_crank", self.placed.lengths)
            values, slopes = np.where(reaches[:, None], values, 1.0), np.where(reaches[:, None, None], slopes, 0.0)
        self.add(name, values, slopes)

    # -- lengths ------------------------------------------------------------------------------------------------------

    def family(self, name: str, family: str) -> None:
        """The signs of the three excesses, over the perimeter, are those of a family of full cranks."""
        lengths = self.placed.lengths
        side = np.where(lengths[:, 0] > lengths[:, _GROUND], -1.0, 1.0)
        side = {"crank_rocker": np.ones_like(side), "double_crank": -np.ones_like(side)}.get(family, side)
        signs, size = np.stack([side, side, np.ones_like(side)], axis=1), lengths.sum(axis=1)[:, None]
        values = signs * (lengths @ EXCESSES.T) / size
        slopes = np.zeros((self.count, 3, COLUMNS))
        slopes[:, :, :BEGIN] = (signs[:, :, None] * EXCESSES - values[:, :, None]) / size[:, :, None]
        self.add(name, values, slopes)

    def ratios(self, name: str, most: float) -> None:
        """The logarithm of no length is above that of another by more than that of ``most``: `ratio`, pair by pair."""
        lengths = self.placed.lengths
        pairs = np.array(list(permutations(_EVERY, 2)))
        slopes, rows = np.zeros((self.count, len(pairs), COLUMNS)), np.arange(len(pairs))
        slopes[:, rows, pairs[:, 0]], slopes[:, rows, pairs[:, 1]] = (
            -1 / lengths[:, pairs[:, 0]],
            1 / lengths[:, pairs[:, 1]],
        )
        logs = np.log(lengths)
        self.add(name, np.log(most) - logs[:, pairs[:, 0]] + logs[:, pairs[:, 1]], slopes)

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
        gap = point.place - place
        self.add(name, _two(gap), _two(point.slope), equal=True)

    def near(self, name: str, point: _Point, middle: complex, far: float) -> None:
        gap = point.place - middle
        away = np.abs(gap)
        along = np.conj(gap) / np.where(away > 0, away, 1.0)
        self.add(name, (far - away)[:, None], -(along[:, None] * point.slope).real[:, None])

    def inside(self, name: str, point: _Point, box: Box) -> None:
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
