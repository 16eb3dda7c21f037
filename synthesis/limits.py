"""Limits of a request: `Limits` has a field for each limit, with its default, its form in a request (`Form`) and its text.

`synthesis.constraints` evaluates limits as functions.
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
# the practical limits, which a request can select and which a verdict checks
TRANSMISSION_ANGLE = np.deg2rad(35.0)
"""Smallest practical transmission angle over the used interval: below it friction and the effect of play increase."""
TRANSMISSION_ANGLE_TURN = np.deg2rad(15.0)
"""Smallest practical transmission angle over the whole turn, if the crank turns fully."""
LINK_RATIO = 10.0
"""Largest practical ratio of the longest link to the shortest."""
REACH = 10.0
"""Largest length of a link, and largest distance of a pivot from the motion's centre, in extents of the motion."""
SHORTEST = 0.05
"""Shortest length of a link as a fraction of the motion's extent: a tiny link cannot guide a distant body accurately."""
ROOM = 2.0
"""Lower bound of the largest length and the largest distance of a pivot, as a multiple of a given shortest length."""
BETWEEN_LENGTHS = "the smallest and the largest link length (`limits.link_min`, `limits.link_max`)"


def in_family(family: str, lengths: Floats) -> Flags:
    """Return flags (n,) of linkages with lengths (n, 4) that belong to a family of `FAMILIES`, for any interval."""
    a, b, c = grashof_excesses(lengths)
    crank_rocker = (a > 0) & (b > 0) & (c > 0)
    double_crank = (a < 0) & (b < 0) & (c > 0)
    return {
        "full_crank": crank_rocker | double_crank,
        "crank_rocker": crank_rocker,
        "double_crank": double_crank,
        "any": np.ones(len(lengths), dtype=bool),
    }[family]


# -- limits of a request ----------------------------------------------------------------------------------------------


class Reach(NamedTuple):
    """Largest distances of the fixed pivots from a point, and of the body point from both coupler joints; None: no limit."""

    middle: complex
    pivot_a: float | None
    pivot_b: float | None
    body: float | None = None


class Form(NamedTuple):
    """Form of a limit in a request, and its description."""

    kind: Literal["family", "angle", "length", "ratio", "links", "point", "box", "boxes", "reach"]
    """Form of the value; a request cannot contain ``reach``, which is set by the practical limits."""
    concerns: Literal["shape", "lengths", "position", "sliders"]
    """Subject: length ratios and the start only, actual lengths, position of the linkage, or rails and slots."""
    says: str
    """Description in a request."""
    minimum: bool = False
    """True for a smallest length; a limit of an angle is always the smallest angle."""


@dataclass(frozen=True)
class Limits:
    """Limits of a request; angles in radians, lengths in the user's unit (without positions: the ground is 1)."""

    family: Annotated[
        str,
        Form(
            "family",
            "shape",
            "`any`: closes over the used interval without changing its branch. Default: `full_crank` if crank angles are given, "
            "if the path is closed or if a transmission angle over the whole turn is given; otherwise, and for functions, `any`.",
        ),
    ] = "full_crank"
    transmission_angle_min: Annotated[
        float, Form("angle", "shape", "Smallest transmission angle over the used interval.")
    ] = 0.0
    transmission_angle_min_turn: Annotated[
        float, Form("angle", "shape", "Smallest transmission angle over the whole turn, where the crank turns fully.")
    ] = 0.0
    pivot_a: Annotated[complex | None, Form("point", "position", "The crank's fixed pivot is given.")] = None
    pivot_b: Annotated[complex | None, Form("point", "position", "The rocker's fixed pivot is given.")] = None
    pivot_box: Annotated[
        Box | None,
        Form(
            "box", "position", "xmin, ymin, xmax, ymax for both fixed pivots, used travel of rails and pins of slots."
        ),
    ] = None
    pivot_a_box: Annotated[Box | None, Form("box", "position", "The same for the crank's pivot.")] = None
    pivot_b_box: Annotated[Box | None, Form("box", "position", "The same for the rocker's pivot.")] = None
    pivot_reach: Annotated[Reach | None, Form("reach", "position", "The distance of the pivots.")] = None
    keep_out: Annotated[tuple[Box, ...], Form("boxes", "position", "Boxes in which no fixed pivot may lie.")] = ()
    link_ratio_max: Annotated[float | None, Form("ratio", "shape", "Longest link over the shortest, at most.")] = None
    link_min: Annotated[float | None, Form("length", "lengths", "Shortest length of any link.", minimum=True)] = None
    link_max: Annotated[float | None, Form("length", "lengths", "Longest length of any link.")] = None
    links: Annotated[tuple[float | None, ...], Form("links", "lengths", "Lengths that are given.")] = (None,) * 4
    coupler_radius_max: Annotated[
        float | None, Form("length", "position", "Farthest place of the body point from the crank pin.")
    ] = None
    envelope: Annotated[
        Box | None,
        Form(
            "box",
            "position",
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
        float | None, Form("length", "sliders", "Shortest length of a driving cylinder, pin to pin.", minimum=True)
    ] = None
    cylinder_extended_max: Annotated[
        float | None, Form("length", "sliders", "Longest length of a driving cylinder, pin to pin.")
    ] = None
    arm_min: Annotated[
        float | None,
        Form(
            "length",
            "sliders",
            "Least moment arm of a slot that is not driven, over the used interval.",
            minimum=True,
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise FieldError("/limits/family", f"must be one of {', '.join(FAMILIES)}")
        for name in of_kind("angle"):
            if not 0 <= getattr(self, name) < np.pi / 2:
                raise FieldError(f"/limits/{name}", "must be at least 0 and less than 90 degrees")
        boxes = [(name, getattr(self, name)) for name in of_kind("box")]
        boxes += [(f"keep_out/{k}", box) for k, box in enumerate(self.keep_out)]
        for name, box in boxes:
            if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
                raise FieldError(
                    f"/limits/{name}", "must be [xmin, ymin, xmax, ymax] with xmin <= xmax and ymin <= ymax"
                )
        lengths = [(name, getattr(self, name)) for name in of_kind("length")]
        lengths += [(f"links/{name}", length) for name, length in zip(LINKS, self.links)]
        for name, value in lengths:
            if value is not None and not value > 0:
                raise FieldError(f"/limits/{name}", "must be a length above 0")
        for name in of_kind("ratio"):
            if (value := getattr(self, name)) is not None and not value >= 1:
                raise FieldError(f"/limits/{name}", "must be a ratio of at least 1")
        self._check_lengths()
        self._check_pivots()

    def _check_lengths(self) -> None:
        low, high = self.link_min or 0.0, self.link_max or np.inf
        if low > high:
            raise FieldError(
                "/limits/link_min", f"{low:g} is above the largest link length {high:g} (`limits.link_max`)"
            )
        for name, length in zip(LINKS, self.links):
            if length is not None and not low <= length <= high:
                raise FieldError(f"/limits/links/{name}", f"{length:g} is not between {BETWEEN_LENGTHS}")
        lengths = [length for length in self.links if length is not None]
        if self.link_ratio_max is not None and lengths and max(lengths) > self.link_ratio_max * min(lengths):
            ratio = max(lengths) / min(lengths)
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
                    f"the given pivots are {apart:.6g} apart, which is not between {BETWEEN_LENGTHS}",
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
        """Return the intersection of all boxes of a pivot; ``name`` is pivot_a_box or pivot_b_box."""
        return _common([self.pivot_box, getattr(self, name), self.envelope])

    def rail_box_of(self, pivot: str) -> Box | None:
        """Return the box for the used travel of a rail in the place of a fixed pivot, ``pivot_a`` or ``pivot_b``."""
        return _common([self.rail_box, self.pivot_box, getattr(self, f"{pivot}_box")])

    def check_against(self, samples: Samples) -> None:
        """Raise FieldError for a limit that does not apply to these samples or that no linkage can satisfy."""
        if None not in self.links and 2 * max(lengths := [length or 0.0 for length in self.links]) >= sum(lengths):
            raise FieldError(
                "/limits/links", "the given lengths do not close: a link is at least as long as the others together"
            )
        for name in PIVOTS if self.rail_box is not None else ():
            rails = self.rail_box_of(name)
            if rails is not None and (rails[0] > rails[2] or rails[1] > rails[3]):
                raise FieldError(
                    "/limits/rail_box", "has no point in common with the box of a pivot that a rail replaces"
                )
        if samples.position is not None:
            return
        for name, form in FORMS.items():
            if form.concerns in ("position", "sliders") and getattr(self, name) not in (None, ()):
                raise FieldError(f"/limits/{name}", "needs `position`, which fixes the position of the linkage")
        if self.links[3] not in (None, 1.0):
            raise FieldError("/limits/links/ground", "must be 1 without `position`, because the motion has no size")

    def _mapped(self, move: Callable[[complex], complex], scale: float = 1.0) -> Limits:
        """Return the limits for moved points, and with lengths over a scale; unchecked, as rounding may violate what holds."""

        def over(length: float | None) -> float | None:
            return None if length is None else length / scale

        def box(sides: Box) -> Box:
            first, last = move(complex(*sides[:2])), move(complex(*sides[2:]))
            low, high = sorted((first.imag, last.imag))
            return first.real, low, last.real, high

        change: dict[str, Callable[[Any], Any]] = {
            "length": over,
            "links": lambda lengths: tuple(map(over, lengths)),
            "point": move,
            "box": box,
            "boxes": lambda boxes: tuple(map(box, boxes)),
            "reach": lambda reach: Reach(move(reach.middle), *map(over, reach[1:])),
        }
        mapped = object.__new__(Limits)
        for name, form in FORMS.items():
            value = getattr(self, name)
            vars(mapped)[name] = value if value is None or form.kind not in change else change[form.kind](value)
        return mapped

    def mirrored(self) -> Limits:
        """Return the limits for a target that is mirrored in the x axis."""
        return self._mapped(complex.conjugate)

    def relative(self, middle: complex, scale: float) -> Limits:
        """Return the limits with positions measured from a middle, and all lengths over a scale."""
        return self._mapped(lambda point: (point - middle) / scale, scale)

    def over(self, ground: float) -> Limits:
        """Return the limits of shape and lengths for a ground of length 1, with all lengths divided by ``ground``."""
        relative = self.relative(0j, ground)
        names = [name for name, form in FORMS.items() if form.concerns in ("shape", "lengths")]
        values = {name: getattr(relative, name) for name in names}
        return Limits(**values | {"links": (*relative.links[:3], None)})

    @property
    def active_names(self) -> list[str]:
        """Names of the limits that are set, in the order shape, lengths, positions, sliders, and the family last."""
        order = ("shape", "lengths", "position", "sliders")
        names = [name for name in FORMS if getattr(self, name) != _FREE[name]]
        return sorted(names, key=lambda name: (name == "family", order.index(FORMS[name].concerns)))

    @property
    def practical(self) -> bool:
        """True if the limits include the practical limits of `practical_limits`."""
        return self.pivot_reach is not None

    @property
    def over_whole_turn(self) -> Limits:
        """The limits for a closed path, which uses the whole turn: the transmission angle holds over all of it."""
        angle = max(self.transmission_angle_min, self.transmission_angle_min_turn)
        return replace(self, transmission_angle_min_turn=angle)

    @property
    def dead_length(self) -> float | None:
        """Smallest length of a driving cylinder; 0 if only the largest length, or practical limits, are given."""
        dead_length = self.cylinder_dead_length
        return (
            0.0 if dead_length is None and (self.practical or self.cylinder_extended_max is not None) else dead_length
        )

    @property
    def swings(self) -> bool:
        """True if all lengths are given and the crank does not turn fully; at a change point rounding decides."""
        return None not in self.links and family(np.array(self.links, dtype=float)).item() not in FULL_CRANK

    @cached_property
    def only_family(self) -> bool:
        """True if no limit except the family is set."""
        return set(self.active_names) <= {"family"}

    @cached_property
    def of_shape(self) -> Limits:
        """The limits that concern only length ratios and the start."""
        return Limits(**{name: getattr(self, name) for name, form in FORMS.items() if form.concerns == "shape"})

    @cached_property
    def on_shape(self) -> bool:
        """True if all limits concern only the shape, so that the best pose of a shape satisfies them too."""
        return self == self.of_shape


FORMS: dict[str, Form] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(Limits, include_extras=True).items()
}
"""The form of each limit."""
_FREE = {item.name: item.default for item in fields(Limits)}


def of_kind(kind: str) -> list[str]:
    """Return the names of the limits of a kind, see `Form`."""
    return [name for name, form in FORMS.items() if form.kind == kind]


def _common(boxes: Sequence[Box | None]) -> Box | None:
    """Return the intersection of boxes, which may be empty; None without boxes."""
    present = [box for box in boxes if box is not None]
    return (*np.max(present, axis=0)[:2].tolist(), *np.min(present, axis=0)[2:].tolist()) if present else None


def _practical(samples: Samples | None, arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the practical limits beside other arguments of `Limits`; those of lengths need positions."""
    practical: dict[str, Any] = {
        "transmission_angle_min": TRANSMISSION_ANGLE,
        "transmission_angle_min_turn": TRANSMISSION_ANGLE_TURN,
        "link_ratio_max": LINK_RATIO,
    }
    if samples is not None and samples.position is not None:
        reach = max(REACH * samples.extent, ROOM * arguments.get("link_min", 0.0))
        body = None if "coupler_radius_max" in arguments else arguments.get("link_max", reach)
        pivots = [
            None if arguments.keys() & {name, f"{name}_box", "pivot_box", "envelope"} else reach for name in PIVOTS
        ]
        practical |= {"link_min": SHORTEST * samples.extent, "link_max": reach}
        practical["pivot_reach"] = Reach(samples.middle, pivots[0], pivots[1], body)
    return practical


def practical_limits(samples: Samples, arguments: dict[str, Any]) -> dict[str, Any]:
    """Complete the arguments of `Limits` with the practical limits for a search.

    A limit of the request replaces the practical limit, and its lengths are allowed.

    Parameters
    ----------
    samples : Samples
        Motion, whose extent limits lengths and distances.
    arguments : dict
        Arguments of `Limits` in the request.
    """
    practical = _practical(samples, arguments)
    lengths = [length for length in arguments.get("links", ()) if length is not None]
    if lengths:
        practical["link_ratio_max"] = max(LINK_RATIO, max(lengths) / min(lengths))
    if samples.position is not None:
        reach, longest = practical["pivot_reach"], max(practical["link_max"], *lengths, 0.0)
        practical["link_max"] = longest
        practical["link_min"] = min(practical["link_min"], *_possible_lengths(arguments))
        if reach.body is not None:
            practical["pivot_reach"] = reach._replace(body=arguments.get("link_max", longest))
    return practical | arguments


def judged_limits(samples: Samples | None, limits: Limits) -> Limits:
    """Return the practical limits that a verdict checks; a limit of the request replaces the practical limit.

    Given lengths count like all others. Without ``samples`` or positions lengths are ratios.
    """
    own = {name: getattr(limits, name) for name in limits.active_names}
    practical = _practical(samples, own)
    own = {name: value for name, value in own.items() if name in practical and name != "pivot_reach"}
    if "link_max" in own:
        own["link_max"] = None  # the search satisfies it
    return Limits("any", **practical | own)


def within_practical(samples: Samples, limits: Limits, closed: bool) -> Limits | None:
    """Return limits with the practical limits in addition; None if they contain these, or exclude them.

    ``closed``: the motion is a closed path.
    """
    if limits.practical:
        return None
    try:
        practical = Limits(**practical_limits(samples, {name: getattr(limits, name) for name in limits.active_names}))
    except FieldError:
        return None
    return practical.over_whole_turn if closed else practical


def _possible_lengths(arguments: dict[str, Any]) -> list[float]:
    """Return link lengths that the limits of a request imply; the practical shortest length does not exceed them."""
    found = [
        arguments.get("link_max", np.inf) / LINK_RATIO,
        *(length for length in arguments.get("links", ()) if length is not None),
    ]
    if "pivot_a" in arguments and "pivot_b" in arguments:
        found.append(abs(arguments["pivot_b"] - arguments["pivot_a"]))
    if box := _common([arguments.get("pivot_box"), arguments.get("envelope")]):
        left, low, right, high = box
        # half of the longest ground that the box allows leaves a search room
        found.append(max(float(np.hypot(right - left, high - low)) / 2, MIN_LENGTH))
    return found
