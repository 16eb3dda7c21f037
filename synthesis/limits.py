"""The limits of a request: `Limits` states each limit once, with its default, its form in a request (`Form`) and its text.

`synthesis.constraints` holds them as functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, get_type_hints

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.errors import FieldError
from synthesis.four_bar import FULL_CRANK, family, grashof_excesses
from synthesis.mechanism import Box
from synthesis.target import MIN_LENGTH, Samples

FAMILIES = ("full_crank", "crank_rocker", "double_crank", "any")
LINKS = ("crank", "coupler", "rocker", "ground")
PIVOTS = "pivot_a", "pivot_b"
# the practical limits: where a request says so, and what a verdict calls practical
TRANSMISSION_ANGLE = np.deg2rad(35.0)
"""Least over the used interval: below it friction grows, and play in the pins shows."""
TRANSMISSION_ANGLE_TURN = np.deg2rad(15.0)
"""Least over the whole turn, where the crank turns fully."""
LINK_RATIO = 10.0
"""Most of the longest link over the shortest."""
REACH = 10.0
"""No link, and no distance of a pivot from the motion's middle, is longer than this many extents of the motion."""
SHORTEST = 0.05
"""No link is shorter than this fraction of the motion's extent: a tiny link hardly holds a body that reaches far out."""
ROOM = 2.0
"""So many times a shortest length that is given links may be long, and pivots be away, at least."""
BETWEEN_LENGTHS = "the least and the greatest link length (`limits.link_min`, `limits.link_max`)"


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
    """Largest distances of the fixed pivots from a point, and of the body point from both coupler joints; None: no limit."""

    middle: complex
    pivot_a: float | None
    pivot_b: float | None
    body: float | None = None


class Form(NamedTuple):
    """How a limit is given, and what it says."""

    kind: Literal["family", "angle", "length", "ratio", "links", "point", "box", "boxes", "reach"]
    """``reach`` is none that a request gives: the practical limits set it."""
    concerns: Literal["shape", "lengths", "place", "sliders"]
    """Length ratios and the start alone; actual lengths; where the linkage stands; or what only rails and slots have."""
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
    pivot_box: Annotated[
        Box | None,
        Form("box", "place", "xmin, ymin, xmax, ymax for both fixed pivots, used travel of rails and pins of slots."),
    ] = None
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
    stroke_max: Annotated[
        float | None, Form("length", "sliders", "Longest travel that is used of any rail, slot or cylinder.")
    ] = None
    rail_box: Annotated[
        Box | None,
        Form(
            "box",
            "sliders",
            "A box for both ends of the used travel of every rail, beside the boxes of pivots: xmin, ymin, xmax, ymax.",
        ),
    ] = None
    cylinder_dead_length: Annotated[
        float | None, Form("length", "sliders", "Shortest length of a driving cylinder, pin to pin.", least=True)
    ] = None
    cylinder_extended_max: Annotated[
        float | None, Form("length", "sliders", "Longest length of a driving cylinder, pin to pin.")
    ] = None
    arm_min: Annotated[
        float | None,
        Form(
            "length", "sliders", "Least moment arm of a slot that is not driven, over the used interval.", least=True
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
            raise FieldError(
                "/limits/link_min", f"{low:g} is above the greatest link length {high:g} (`limits.link_max`)"
            )
        for name, length in zip(LINKS, self.links):
            if length is not None and not low <= length <= high:
                raise FieldError(f"/limits/links/{name}", f"{length:g} is not within {BETWEEN_LENGTHS}")
        given = [length for length in self.links if length is not None]
        if self.link_ratio_max is not None and given and max(given) > self.link_ratio_max * min(given):
            ratio = max(given) / min(given)
            raise FieldError(
                "/limits/link_ratio_max",
                f"the longest given length is {ratio:.4g} times the shortest (`limits.links`)",
            )

    def _check_pivots(self) -> None:
        if self.pivot_a is not None and self.pivot_b is not None:
            apart, ground = abs(self.pivot_b - self.pivot_a), self.links[3]
            if not apart > 0:
                raise FieldError("/limits/pivot_b", "is the same point as pivot A (`limits.pivot_a`)")
            if ground is not None and abs(apart - ground) > 1e-9 * ground:
                raise FieldError("/limits/links/ground", f"the given pivots are {apart:.6g} apart, not {ground:g}")
            low, high = self.link_min or 0.0, self.link_max or np.inf
            if not low <= apart <= high:
                raise FieldError(
                    "/limits/pivot_b",
                    f"the given pivots are {apart:.6g} apart, which is not within {BETWEEN_LENGTHS}",
                )
        for name, point in (("pivot_a", self.pivot_a), ("pivot_b", self.pivot_b)):
            box = self.box(f"{name}_box")
            if box is not None and (box[0] > box[2] or box[1] > box[3]):
                raise FieldError(f"/limits/{name}_box", "has no point in common with the pivot box or the envelope")
            if point is not None:
                if box is not None and not (box[0] <= point.real <= box[2] and box[1] <= point.imag <= box[3]):
                    raise FieldError(f"/limits/{name}", "lies outside the box of this pivot")
                box = (point.real, point.imag, point.real, point.imag)
            for number, out in enumerate(self.keep_out):
                if box is not None and out[0] < box[0] and out[1] < box[1] and box[2] < out[2] and box[3] < out[3]:
                    if point is not None:
                        raise FieldError(f"/limits/{name}", "lies in a box kept free of pivots (`limits.keep_out`)")
                    pivot = name.replace("pivot_a", "pivot A").replace("pivot_b", "pivot B")
                    raise FieldError(f"/limits/keep_out/{number}", f"covers the whole box of {pivot}")

    def box(self, name: str) -> Box | None:
        """Where a pivot may lie by all boxes that concern it; ``name`` is its own: pivot_a_box or pivot_b_box."""
        return _common([self.pivot_box, getattr(self, name), self.envelope])

    def rail_box_of(self, pivot: str) -> Box | None:
        """Return the box for the used travel of a rail in the place of a fixed pivot, ``pivot_a`` or ``pivot_b``."""
        return _common([self.rail_box, self.pivot_box, getattr(self, f"{pivot}_box")])

    def check_against(self, samples: Samples) -> None:
        """FieldError for limits that have no meaning for these samples, or that no linkage keeps."""
        if None not in self.links and 2 * max(given := [length or 0.0 for length in self.links]) >= sum(given):
            raise FieldError("/limits/links", "the given lengths do not close: one is as long as the others together")
        for name in PIVOTS if self.rail_box is not None else ():
            rails = self.rail_box_of(name)
            if rails is not None and (rails[0] > rails[2] or rails[1] > rails[3]):
                raise FieldError(
                    "/limits/rail_box", "has no point in common with the box of a pivot that a rail replaces"
                )
        if samples.position is not None:
            return
        for name, form in FORMS.items():
            if form.concerns in ("place", "sliders") and getattr(self, name) not in (None, ()):
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
            if FORMS[name].concerns not in ("place", "sliders") and (value := getattr(self, name)) is not None
        }
        return Limits(**kept | {"links": (*links, None)})

    @property
    def given(self) -> list[str]:
        """Names of the limits that are given: those of shape, of lengths, of places, and the family last."""
        order = ("shape", "lengths", "place", "sliders")
        names = [name for name in FORMS if getattr(self, name) != _FREE[name]]
        return sorted(names, key=lambda name: (name == "family", order.index(FORMS[name].concerns)))

    @property
    def practical(self) -> bool:
        """Whether they are, beside others, the practical ones of `practical_limits`."""
        return self.pivot_reach is not None

    @property
    def dead_length(self) -> float | None:
        """Smallest length of a driving cylinder; 0 if only the largest length, or practical limits, are given."""
        given = self.cylinder_dead_length
        return 0.0 if given is None and (self.practical or self.cylinder_extended_max is not None) else given

    @property
    def swings(self) -> bool:
        """Whether all lengths are given, and the crank does not turn fully: at a change point rounding alone would say so."""
        return None not in self.links and family(np.array(self.links, dtype=float)).item() not in FULL_CRANK

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


def _common(boxes: Sequence[Box | None]) -> Box | None:
    """Return what boxes have in common, which may be empty; None without boxes."""
    given = [box for box in boxes if box is not None]
    return (*np.max(given, axis=0)[:2].tolist(), *np.min(given, axis=0)[2:].tolist()) if given else None


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
        far = max(far, ROOM * given.get("link_min", 0.0))
        asked["link_max"] = max(far, *(one or 0.0 for one in given.get("links", ())), 0.0)
        asked["link_min"] = min(SHORTEST * samples.extent, *_possible_lengths(given))
        arm = None if "coupler_radius_max" in given else given.get("link_max", asked["link_max"])
        places = [None if given.keys() & {name, f"{name}_box", "pivot_box", "envelope"} else far for name in PIVOTS]
        asked["pivot_reach"] = Reach(middle, places[0], places[1], arm)
    lengths = [one for one in given.get("links", ()) if one is not None]
    if lengths:
        asked["link_ratio_max"] = max(LINK_RATIO, max(lengths) / min(lengths))
    return asked | given


def _possible_lengths(given: dict[str, Any]) -> list[float]:
    """Return lengths that the limits of a request require of its links: the practical shortest length is no longer."""
    found = [given.get("link_max", np.inf) / LINK_RATIO, *(one for one in given.get("links", ()) if one is not None)]
    if "pivot_a" in given and "pivot_b" in given:
        found.append(abs(given["pivot_b"] - given["pivot_a"]))
    if box := _common([given.get("pivot_box"), given.get("envelope")]):
        left, low, right, high = box
        # half of the longest ground that the box allows leaves a search room
        found.append(max(float(np.hypot(right - left, high - low)) / 2, MIN_LENGTH))
    return found


def placed_by(limits: Limits, pivot: str) -> bool:
    """Whether limits themselves say where a fixed pivot, ``pivot_a`` or ``pivot_b``, lies."""
    return any(getattr(limits, name) is not None for name in (pivot, f"{pivot}_box", "pivot_box", "envelope"))
