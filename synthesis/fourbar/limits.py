"""What a solution must keep to: family, transmission angle, lengths, and where pivots and joints may lie."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import grashof_excesses
from synthesis.target import Samples

Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax"""


class Reach(NamedTuple):
    """How far from a point the fixed pivots may lie; None: as far as they like."""

    middle: complex
    pivot_a: float | None
    pivot_b: float | None


FAMILIES = ("full_crank", "crank_rocker", "double_crank", "any")
LINKS = ("crank", "coupler", "rocker", "ground")
ANGLES = ("transmission_angle_min", "transmission_angle_min_turn")
BOXES = ("pivot_box", "pivot_a_box", "pivot_b_box", "envelope")
LARGEST = ("link_max", "link_ratio_max", "coupler_radius_max")
"""Names of the limits that are angles, boxes, and largest values."""
_ON_SHAPE = ("family", *ANGLES, "link_ratio_max")
_MOUNTED = (
    "pivot_box",
    "pivot_a",
    "pivot_b",
    "pivot_a_box",
    "pivot_b_box",
    "coupler_radius_max",
    "envelope",
    "keep_out",
)


def in_family(family: str, lengths: Floats) -> NDArray[np.bool_]:
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


@dataclass(frozen=True)
class Limits:
    """Limits of a request; angles in radians, lengths in the user's unit (without positions: the ground is 1).

    Attributes
    ----------
    family : str
        One of `FAMILIES`; ``any`` closes over the used interval and stays on its branch there.
    transmission_angle_min, transmission_angle_min_turn : float
        Over the whole used interval, and over the whole turn where the crank turns fully; 0 to pi/2.
    link_min, link_max, link_ratio_max : float, optional
        For each of the four lengths; the longest over the shortest.
    links : tuple of float or None
        Lengths that are given: crank, coupler, rocker, ground.
    pivot_a, pivot_b : complex, optional
        Fixed pivots that are given.
    pivot_box, pivot_a_box, pivot_b_box : tuple of float, optional
        xmin, ymin, xmax, ymax for both fixed pivots, or for one.
    pivot_reach : Reach, optional
    keep_out : tuple of boxes
        Where no fixed pivot may lie.
    coupler_radius_max : float, optional
        From the crank pin to the body point.
    envelope : tuple of float, optional
        A box for all joints and the body point over the used interval.
    """

    family: str = "full_crank"
    transmission_angle_min: float = 0.0
    transmission_angle_min_turn: float = 0.0
    link_min: float | None = None
    link_max: float | None = None
    link_ratio_max: float | None = None
    links: tuple[float | None, ...] = (None,) * 4
    pivot_a: complex | None = None
    pivot_b: complex | None = None
    pivot_box: Box | None = None
    pivot_a_box: Box | None = None
    pivot_b_box: Box | None = None
    pivot_reach: Reach | None = None
    keep_out: tuple[Box, ...] = ()
    coupler_radius_max: float | None = None
    envelope: Box | None = None

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise FieldError("/limits/family", f"wanted one of {', '.join(FAMILIES)}")
        for name in ANGLES:
            if not 0 <= getattr(self, name) < np.pi / 2:
                raise FieldError(f"/limits/{name}", "wanted 0 to less than 90 degrees")
        boxes = [(name, getattr(self, name)) for name in BOXES]
        boxes += [(f"keep_out/{k}", box) for k, box in enumerate(self.keep_out)]
        for name, box in boxes:
            if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
                raise FieldError(
                    f"/limits/{name}", "wanted [xmin, ymin, xmax, ymax] with xmin <= xmax and ymin <= ymax"
                )
        lengths = [(name, getattr(self, name)) for name in ("link_min", "link_max", "coupler_radius_max")]
        lengths += [(f"links/{name}", length) for name, length in zip(LINKS, self.links)]
        for name, value in lengths:
            if value is not None and not value > 0:
                raise FieldError(f"/limits/{name}", "wanted a length above 0")
        if self.link_ratio_max is not None and not self.link_ratio_max >= 1:
            raise FieldError("/limits/link_ratio_max", "wanted a ratio of at least 1")
        self._check_lengths()
        self._check_pivots()

    def _check_lengths(self) -> None:
        """FieldError for lengths that exclude one another whatever the linkage."""
        low, high = self.link_min or 0.0, self.link_max or np.inf
        if low > high:
            raise FieldError("/limits/link_min", "is above link_max")
        for name, length in zip(LINKS, self.links):
            if length is not None and not low <= length <= high:
                raise FieldError(f"/limits/links/{name}", "lies outside of link_min and link_max")
        given = [length for length in self.links if length is not None]
        if self.link_ratio_max is not None and given and max(given) > self.link_ratio_max * min(given):
            raise FieldError("/limits/link_ratio_max", "the given lengths exceed it")
        if len(given) == len(LINKS) and 2 * max(given) >= sum(given):
            raise FieldError("/limits/links", "the given lengths do not close: one is as long as the others together")

    def _check_pivots(self) -> None:
        """FieldError for given pivots that another limit excludes."""
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
        """FieldError for limits that have no meaning for these samples."""
        if samples.position is not None:
            return
        for name in _MOUNTED:
            if getattr(self, name) not in (None, ()):
                raise FieldError(f"/limits/{name}", "needs `position`: without it nothing is mounted")
        if self.links[3] not in (None, 1.0):
            raise FieldError("/limits/links/ground", "without `position` the ground is 1")

    def mirrored(self) -> Limits:
        """The same limits for a target mirrored in the x axis."""

        def flipped(box: Box | None) -> Box | None:
            return None if box is None else (box[0], -box[3], box[2], -box[1])

        boxes = {name: flipped(getattr(self, name)) for name in BOXES}
        points = {
            name: None if (p := getattr(self, name)) is None else p.conjugate() for name in ("pivot_a", "pivot_b")
        }
        reach = None if (r := self.pivot_reach) is None else r._replace(middle=r.middle.conjugate())
        keep_out = tuple((x0, -y1, x1, -y0) for x0, y0, x1, y1 in self.keep_out)
        return replace(self, **boxes, **points, pivot_reach=reach, keep_out=keep_out)  # type: ignore[arg-type]

    @cached_property
    def only_family(self) -> bool:
        """Whether nothing but the family is limited."""
        return replace(self, family="full_crank") == Limits()

    @cached_property
    def of_shape(self) -> Limits:
        """Those of the limits that concern length ratios and the start alone."""
        return Limits(**{name: getattr(self, name) for name in _ON_SHAPE})

    @cached_property
    def on_shape(self) -> bool:
        """Whether there are no others, so that a shape's best pose is as good as any."""
        return self == self.of_shape
