"""What pairs of guides must keep to: the limits of a request as numbers for the compiled descents, and of finished linkages.

Each is at least 0 where it is kept, lengths over the length scale. A limit concerns what a kind has: a rail has no pivot, and a
linkage with one crank has no rocker. Links are the cranks, the distance of two pins of the body (coupler) and that of two pins of
the ground (ground). `family` concerns four-bars alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.fourbar.limits import REACH, Limits
from synthesis.free.poses import Poses
from synthesis.guided.linkage import Circle, Driver, Guide, GuidedLinkage, Rail, Slot
from synthesis.guided.solution import GuidedSolution
from synthesis.mechanism import Box
from synthesis.target import Samples

_LENGTHS = (
    "arm_min", "stroke_max", "link_max", "link_min", "coupler_radius_max", "cylinder_dead_length", "cylinder_extended_max",
)  # fmt: skip
_ROUNDING = 1e-9
"""Part of the motion's extent, or angle, by which an answer may break a limit: what a search adds to be sure is more."""


_FEW_PLACES, _MORE = 41, 0.3
"""Places of the drive, and the part of the longest step between them, that used parts are estimated by from above."""


def _dead_length(limits: Limits) -> float | None:
    """The least length of a driving cylinder: nothing where only the largest, or what is practical, is asked for."""
    given = limits.cylinder_dead_length
    return 0.0 if given is None and (limits.practical or limits.cylinder_extended_max is not None) else given


def numbers_of(limits: Limits, poses: Poses, timed: bool) -> dict[str, Any]:
    """The limits of a request for `kernel.PairDescent`: lengths over the length scale, places from the mean position.

    ``timed``: whether the drive is given, and with it the order.
    """
    scale, middle = poses.length_scale, poses.middle
    none, reach = (np.nan, np.nan, np.nan, np.nan), limits.pivot_reach

    def length(value: float | None) -> float | None:
        return None if value is None else value / scale

    def box(sides: Box | None) -> Floats:
        near, far = middle.real, middle.imag
        return (np.array(none if sides is None else sides) - (near, far, near, far)) / scale

    def place(point: complex | None) -> tuple[float, float]:
        off = complex(np.nan, np.nan) if point is None else (point - middle) / scale
        return off.real, off.imag

    crank, coupler, _, ground = limits.links
    reaches = (None, None) if reach is None else (reach.pivot_a, reach.pivot_b)
    return {
        "transmission": limits.transmission_angle_min,
        "ordered": poses.ordered and not timed,
        "span_max": poses.span_max,
        "crank": length(crank),
        "coupler": length(coupler),
        "ground": length(ground),
        "link_ratio_max": limits.link_ratio_max,
        **{name: length(getattr(limits, name)) for name in _LENGTHS},
        "cylinder_dead_length": length(_dead_length(limits)),
        "pivots": np.array([place(limits.pivot_a), place(limits.pivot_b)]),
        "pivot_boxes": np.stack([box(limits.box("pivot_a_box")), box(limits.box("pivot_b_box"))]),
        "reach_middle": 0j if reach is None else complex(*place(reach.middle)),
        "reaches": np.array([np.nan if far is None else far / scale for far in reaches]),
        "rail_box": box(limits.rail_box),
        "far": None if reach is None else REACH * poses.extent / scale,
        "envelope": box(limits.envelope),
        "keep_out": np.array([box(out) for out in limits.keep_out]).reshape(-1, 4),
    }


# -- of finished linkages -----------------------------------------------------------------------------------------------

_BY_ENDS = {"stroke_max", "rail_box", "pivot_reach", "link_max", "cylinder_dead_length", "cylinder_extended_max"}
"""Limits of what is used of rails and slots."""
Used = tuple[float, float] | None
"""The least and the largest place in use of a rail or slot; None of a circle."""


def used_of(solution: GuidedSolution) -> tuple[Used, Used]:
    """What both guides use, exactly."""
    first, second = (
        None if isinstance(guide, Circle) else solution.linkage.used(place, solution.interval)
        for place, guide in enumerate(solution.linkage.guides)
    )
    return first, second


def _no_more_than(solution: GuidedSolution) -> tuple[Used, Used]:
    """What both guides use, or a little more: from few places, and so in a hundredth of the time."""
    travel = np.linspace(*solution.interval, _FEW_PLACES)
    found: list[Used] = []
    for place, guide in enumerate(solution.linkage.guides):
        if isinstance(guide, Circle):
            found.append(None)
            continue
        at = solution.linkage.along(place, travel)
        low, high = float(np.min(at)), float(np.max(at))
        spare = _MORE * float(np.max(np.abs(np.diff(at))))
        found.append((low - spare, high + spare))
    return found[0], found[1]


def lengths_of(solution: GuidedSolution) -> dict[str, float]:
    """The links: crank and rocker, the distance of two points of the body (coupler), that of two pins of the ground (ground)."""
    circles = [guide for guide in solution.linkage.guides if isinstance(guide, Circle)]
    found = {name: one.radius for name, one in zip(("crank", "rocker"), circles)}
    points = [guide.body_point for guide in solution.linkage.guides if not isinstance(guide, Slot)]
    if len(points) == 2:
        found["coupler"] = abs(points[1] - points[0])
    pins = [_pin(guide) for guide in solution.linkage.guides if not isinstance(guide, Rail)]
    if len(pins) == 2:
        found["ground"] = abs(pins[1] - pins[0])
    return found


def _slot_ends(solution: GuidedSolution, ends: tuple[Used, Used]) -> list[complex]:
    """Both ends of the used part of each slot, in the body."""
    return [
        complex(guide.body_point + end * np.exp(1j * guide.body_direction))
        for guide, used in zip(solution.linkage.guides, ends)
        if isinstance(guide, Slot) and used is not None
        for end in used
    ]


def _pin(guide: Guide) -> complex:
    assert not isinstance(guide, Rail)
    return guide.pivot if isinstance(guide, Circle) else guide.pin


def broken_limits(solution: GuidedSolution, samples: Samples, limits: Limits) -> dict[str, float]:
    """By how much a linkage breaks limits over what it uses, by name: as a part of the motion's extent, or in radians."""
    broken = _broken(solution, samples, limits, _no_more_than(solution))
    return _broken(solution, samples, limits, used_of(solution)) if broken.keys() & _BY_ENDS else broken


def _broken(solution: GuidedSolution, samples: Samples, limits: Limits, ends: tuple[Used, Used]) -> dict[str, float]:
    """The same where the used parts of rails and slots are known."""
    extent, middle = samples.extent, samples.middle
    linkage = solution.linkage
    missing: dict[str, float] = {}

    def least(name: str, by: float) -> None:
        if by > _ROUNDING:
            missing[name] = max(missing.get(name, 0.0), by)

    least("transmission_angle_min", limits.transmission_angle_min - solution.transmission_angle_min)
    if solution.transmission_angle_min == 0.0:
        least("transmission_angle_min", 1.0)
    turn = solution.transmission_angle_min_turn
    if turn is not None and linkage.driver is Driver.CRANK:
        least("transmission_angle_min_turn", limits.transmission_angle_min_turn - turn)
    for guide, name in zip(linkage.guides, ("pivot_a", "pivot_b")):
        if isinstance(guide, Rail):
            continue
        place = _pin(guide)
        if (given := getattr(limits, name)) is not None:
            least(name, abs(place - given) / extent)
        elif (box := limits.box(f"{name}_box")) is not None:
            least("pivot_box", _outside(place, box) / extent)
        reach = limits.pivot_reach
        if reach is not None and (far := getattr(reach, name)) is not None:
            least("pivot_reach", (abs(place - reach.middle) - far) / extent)
        for out in limits.keep_out:
            least("keep_out", -_outside(place, out) / extent)
    for guide, used in zip(linkage.guides, ends):
        if used is None:
            continue
        if limits.stroke_max is not None:
            least("stroke_max", (used[1] - used[0] - limits.stroke_max) / extent)
        if isinstance(guide, Rail):
            for end in used:
                place = complex(guide.point + end * np.exp(1j * guide.direction))
                if limits.rail_box is not None:
                    least("rail_box", _outside(place, limits.rail_box) / extent)
                if limits.pivot_reach is not None:
                    least("pivot_reach", abs(place - middle) / extent - REACH)
    if linkage.driver is Driver.CYLINDER:
        used = ends[0]
        assert used is not None
        low, high = sorted(np.abs(used))
        least("cylinder_dead_length", ((_dead_length(limits) or 0.0) - low) / extent)
        if used[0] * used[1] < 0 and _dead_length(limits) is not None:  # it would pass its own pin
            least("cylinder_dead_length", low / extent)
        least("cylinder_extended_max", (high - (limits.cylinder_extended_max or np.inf)) / extent)
    if limits.arm_min is not None and isinstance(linkage.guides[1], Slot) and linkage.driver is not Driver.HINGE:
        q = linkage.start + linkage.over(solution.interval)
        least("arm_min", (limits.arm_min - float(np.nan_to_num(np.min(linkage.body(q).arm)))) / extent)
    _lengths(solution, limits, extent, ends, least)
    if limits.envelope is not None:
        q = linkage.start + linkage.over(solution.interval)
        for way in _traced(linkage, q):
            box = limits.envelope
            least("envelope", float(np.max([_outside(one, box) for one in way])) / extent)
    return missing


def _lengths(
    solution: GuidedSolution,
    limits: Limits,
    extent: float,
    ends: tuple[Used, Used],
    least: Callable[[str, float], None],
) -> None:
    lengths = lengths_of(solution)
    for length in lengths.values():
        least("link_max", (length - (limits.link_max or np.inf)) / extent)
        least("link_min", ((limits.link_min or 0.0) - length) / extent)
    for name, given in zip(("crank", "coupler", "rocker", "ground"), limits.links):
        if given is not None and name in lengths:
            least(f"links.{name}", abs(lengths[name] - given) / extent)
    if limits.link_ratio_max is not None and len(lengths) > 1:
        least("link_ratio_max", max(lengths.values()) / min(lengths.values()) / limits.link_ratio_max - 1)
    body = [guide.body_point for guide in solution.linkage.guides if not isinstance(guide, Slot)]
    for point in (*body, *_slot_ends(solution, ends)):
        least("link_max", (abs(point) - (limits.link_max or np.inf)) / extent)
    first = solution.linkage.guides[0]
    if limits.coupler_radius_max is not None and not isinstance(first, Slot):
        least("coupler_radius_max", (abs(first.body_point) - limits.coupler_radius_max) / extent)


def _traced(linkage: GuidedLinkage, q: Floats) -> list[Complexes]:
    """Where the body point and both joints are."""
    body = linkage.body(q)
    turned = np.exp(1j * body.rotation)
    found = [body.position]
    for guide in linkage.guides:
        found.append(np.array([guide.pin]) if isinstance(guide, Slot) else body.position + turned * guide.body_point)
        if isinstance(guide, Circle):
            found.append(np.array([guide.pivot]))
    return found


def _outside(place: complex, box: Box) -> float:
    """How far a place lies outside of a box; negative inside: how far from its nearest side."""
    return max(box[0] - place.real, box[1] - place.imag, place.real - box[2], place.imag - box[3])
