"""Finished linkages on two guides: the drive's place at each sample, errors, size and broken limits from their own numbers.

A limit concerns what a kind has: a rail has no pivot, and a linkage with one crank has no rocker. Links are the cranks, the
distance of two pins of the body (coupler) and that of two pins of the ground (ground). `family` concerns four-bars alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.defects import LEAVES_SAMPLES, SHORTEST_CHORD
from synthesis.fourbar.limits import REACH, Limits
from synthesis.free.poses import Poses
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.mechanism import outside
from synthesis.ranking import Errors, motion_errors
from synthesis.target import TURN, Interval, Samples, Target

_STEPS = 30
"""Newton steps towards the drive's best place at a sample."""
_ARRIVED = 1e-7
"""A step below this part of the longest is the last: the next would be its square."""
_BACK = 20
"""Halvings of a step that would make a sample's error larger, or open the loop."""
_WAY_STEPS = 48
"""Chords that the body point's way between two samples is measured by."""
_ROUNDING = 1e-9
"""Part of the motion's extent, or angle, by which an answer may break a limit: what a search adds to be sure is more."""


_FEW_PLACES, _MORE = 41, 0.3
"""Places of the drive, and the part of the longest step between them, that used parts are estimated by from above."""


@dataclass(frozen=True)
class GuidedSolution:
    """A linkage on two guides that answers a request.

    Attributes
    ----------
    linkage : Linkage
        Started at the first sample.
    errors : Errors
        Recomputed from the linkage's numbers: its motion is compared with the request.
    travel : ndarray, shape (N,)
        Of the drive from the first sample on, at all samples that were asked for.
    transmission_angle_min : float
        Over the used interval, exactly; 0 where it does not close between samples.
    transmission_angle_min_turn : float or None
        Over the whole turn; None where the drive does not turn fully.
    interval : Interval
        The travel that the motion uses.
    """

    linkage: Linkage
    errors: Errors
    travel: Floats
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    interval: Interval

    @property
    def identity(self) -> Floats:
        """Numbers, relative to the linkage's size, that tell linkages of one kind and drive apart; the start does not count."""
        numbers: list[float] = [self.linkage.branch]
        size = max(abs(one.body_point) for one in self.linkage.guides) + sum(
            one.radius for one in self.linkage.guides if isinstance(one, Circle)
        )
        size = size if size > 0 else 1.0
        for one in self.linkage.guides:
            body = one.body_point / size
            fixed = one[0] / size
            if isinstance(one, Circle):
                numbers += [one.radius / size, fixed.real, fixed.imag, body.real, body.imag]
            elif isinstance(one, Rail):
                # the line itself, not the point that it is named by
                normal = 1j * np.exp(1j * one.direction)
                height = np.real(np.conj(normal) * fixed)
                numbers += [np.cos(2 * one.direction), np.sin(2 * one.direction), abs(height), body.real, body.imag]
            else:
                normal = 1j * np.exp(1j * one.body_direction)
                height = np.real(np.conj(normal) * body)
                turned = 2 * one.body_direction
                numbers += [np.cos(turned), np.sin(turned), abs(height), fixed.real, fixed.imag]
        return np.array([*numbers, math.log(size)])

    @property
    def looks(self) -> Floats:
        """Numbers of which two linkages that look alike in a picture differ by less than one."""
        return self.identity / 0.02

    def mirrored(self) -> GuidedSolution:
        """The linkage in a mirror, for the mirrored request; its errors are the same."""
        mirrored = replace(self, linkage=self.linkage.mirrored())
        if not self.linkage.driver.turns:
            return mirrored
        return replace(mirrored, travel=-self.travel, interval=Interval(-self.interval.last, -self.interval.first))


# -- where the drive is -----------------------------------------------------------------------------------------------


def nearest_travel(samples: Samples, linkage: Linkage, begin: Floats) -> Floats:
    """Travel of the drive from the linkage's start at which the body comes nearest to each sample, by Newton's method.

    ``samples``: rotations count modulo a turn. ``begin`` (N,): where each begins; the loop closes there.

    Law: at every sample the error's derivative by the travel is zero, unless the drive is at the end of its way.
    """
    travel = np.array(begin, dtype=float)
    square = _squares(samples, linkage, travel)
    weights = _weights(samples)
    for _ in range(_STEPS):
        first, second = _slopes(samples, linkage, travel, weights)
        # towards a minimum where the error is convex, along the first-order step where it is not
        step = np.nan_to_num(-first / np.where(second > 0, second, np.inf))
        longest = 0.3 if linkage.driver.turns else 0.3 * samples.length_scale
        step = np.clip(step, -longest, longest)
        going = np.abs(step) > _ARRIVED * longest
        if not going.any():
            there = _squares(samples, linkage, travel + step)
            return np.where(np.isfinite(there), travel + step, travel)
        for _ in range(_BACK):
            there = _squares(samples, linkage, travel + step)
            worse = going & ~(there <= square)
            if not worse.any():
                break
            step = np.where(worse, step / 2, step)
        keep = there <= square
        travel, square = np.where(keep, travel + step, travel), np.where(keep, there, square)
        if not np.any(keep & going):
            break
    return travel


def _weights(samples: Samples) -> tuple[Floats, Floats]:
    """What a square of an error of rotation, and of position, counts at each sample, (N,)."""
    # a sample on its own: only the ratio of both counts
    turning: Floats = np.zeros(samples.samples)
    placing = turning
    if samples.rotation is not None:
        turning = turning + samples.rotation_mean.root**2
    if samples.position is not None:
        placing = placing + samples.position_mean.root**2 / samples.length_scale**2
    return turning, placing


def _gaps(samples: Samples, linkage: Linkage, travel: Floats) -> tuple[Floats, Complexes]:
    """Errors of rotation (to the nearest whole turn) and position, zeros where there is none."""
    found = linkage.body(linkage.start + travel)
    turned: Floats = np.zeros(travel.shape)
    if samples.rotation is not None:
        turned = found.rotation - samples.rotation
        turned = turned - TURN * np.round(turned / TURN)
    off = np.zeros(travel.shape, dtype=complex) if samples.position is None else found.position - samples.position
    return turned, off


def _squares(samples: Samples, linkage: Linkage, travel: Floats) -> Floats:
    turning, placing = _weights(samples)
    turned, off = _gaps(samples, linkage, travel)
    square = turning * turned**2 + placing * np.abs(off) ** 2
    return np.where(np.isfinite(square), square, np.inf)


def _slopes(
    samples: Samples, linkage: Linkage, travel: Floats, weights: tuple[Floats, Floats]
) -> tuple[Floats, Floats]:
    """First derivatives of half the squares by the travel, and second ones, at least those of first-order errors."""
    turning, placing = weights
    turned, off = _gaps(samples, linkage, travel)
    rates = linkage.rates(linkage.start + travel)
    first = turning * turned * rates.rotation + placing * np.real(np.conj(off) * rates.position)
    gauss = turning * rates.rotation**2 + placing * np.abs(rates.position) ** 2
    curved = turning * turned * rates.rotation_second + placing * np.real(np.conj(off) * rates.position_second)
    return first, np.where(gauss + curved > 0.1 * gauss, gauss + curved, gauss)


# -- errors -----------------------------------------------------------------------------------------------------------


def as_target(samples: Samples, linkage: Linkage, travel: Floats) -> Target:
    """A request with the travel of a drive in the place of crank angles; rotations by whole turns nearest to the body's."""
    if isinstance(samples, Target):
        return samples
    assert isinstance(samples, Poses)
    turns = linkage.body(linkage.start + travel).rotation
    target = samples.timed(travel, None if samples.rotation is None else turns)
    return replace(target, closed=target.closed and linkage.turns_fully)


def assess(samples: Poses | Target, linkage: Linkage, travel: Floats) -> GuidedSolution:
    """A linkage with its errors: the best offset of the rotation, and all else recomputed from its own numbers.

    ``travel`` (N,): of the drive from the linkage's start at all samples asked for; of a `Target` its own. The linkage that
    comes back starts at the first sample, and its body's frame is turned by the best offset.
    """
    linkage = replace(linkage, start=linkage.start + float(travel[0]))
    travel = travel - travel[0]
    target = as_target(samples, linkage, travel)
    found = linkage.body(linkage.start + travel)
    points = None if target.position is None else found.position[None]
    offsets, errors = motion_errors(target, found.rotation[None], points)
    if offsets[0] is not None and math.isfinite(offsets[0]):
        linkage = linkage.turned_body(offsets[0] - TURN * round(offsets[0] / TURN))
    used = target.interval if target.closed else Interval(float(travel.min()), float(travel.max()))
    least = linkage.transmission_angle_over(used.after(linkage.start))
    turn = linkage.transmission_angle_over(Interval(0.0, TURN).after(linkage.start)) if linkage.turns_fully else None
    return GuidedSolution(linkage, errors[0], travel, 0.0 if math.isnan(least) else least, turn, used)


# -- as a machine -----------------------------------------------------------------------------------------------------


def excursion(solution: GuidedSolution, samples: Samples, ordered: bool = True, closed: bool = False) -> float | None:
    """The largest way of the body point between two neighbouring samples over their distance, see `synthesis.excursions`.

    Distances below `SHORTEST_CHORD` of the length scale count as that. ``closed``: a drive that turns leads on to the first
    sample. None where the loop opens between samples.
    """
    travel = solution.travel if ordered else np.sort(solution.travel)
    if closed and solution.linkage.driver.turns:
        travel = np.append(travel, travel[0] + np.copysign(TURN, travel[-1] - travel[0]))
    parts = np.linspace(0.0, 1.0, _WAY_STEPS + 1)
    places = travel[:-1, None] + np.diff(travel)[:, None] * parts
    points = solution.linkage.body(solution.linkage.start + places.ravel()).position.reshape(places.shape)
    ways = np.abs(np.diff(points, axis=1)).sum(axis=1)
    chords = np.abs(points[:, -1] - points[:, 0])
    ratios = ways / np.maximum(chords, SHORTEST_CHORD * samples.length_scale)
    largest = float(np.max(ratios))
    return max(1.0, largest) if math.isfinite(largest) else None


def rotation_of(solution: GuidedSolution, poses: Poses) -> Floats:
    """The body's rotation, followed without a jump, at the travel of `Poses.there_and_back`; what slides does not come back."""
    travel = poses.there_and_back(solution.travel) if solution.linkage.driver.turns else solution.travel
    parts = np.linspace(0.0, 1.0, _WAY_STEPS, endpoint=False)
    places = np.append(travel[:-1, None] + np.diff(travel)[:, None] * parts, travel[-1])
    return np.unwrap(solution.linkage.body(solution.linkage.start + places).rotation)[::_WAY_STEPS]


def goes_astray(solution: GuidedSolution, poses: Poses) -> bool:
    """Whether the body point goes elsewhere between samples, or the body turns otherwise than asked for."""
    way = excursion(solution, poses, poses.ordered, poses.closed)
    return bool(poses.turned_otherwise(rotation_of(solution, poses))) or (way is not None and way > LEAVES_SAMPLES)


def lengths(solution: GuidedSolution, samples: Samples) -> dict[str, float]:
    """Every length that makes the linkage large, by name: radii, reaches in the body, distances from the motion's middle."""
    linkage, middle = solution.linkage, samples.middle
    found: dict[str, float] = {}
    for place, one in enumerate(linkage.guides):
        name = ("first", "second")[place]
        if isinstance(one, Circle):
            found[f"{name} radius"] = one.radius
            found[f"{name} pivot"] = abs(one.pivot - middle)
            found[f"{name} body point"] = abs(one.body_point)
            continue
        ends = np.array(linkage.used(place, solution.interval))
        if isinstance(one, Rail):
            found[f"{name} rail"] = float(np.max(np.abs(one.point + ends * np.exp(1j * one.direction) - middle)))
            found[f"{name} body point"] = abs(one.body_point)
        else:
            found[f"{name} pin"] = abs(one.pin - middle)
            found[f"{name} slot"] = float(np.max(np.abs(one.body_point + ends * np.exp(1j * one.body_direction))))
        found[f"{name} stroke"] = float(np.ptp(ends))
    return found | {name: length for name, length in linkage.lengths.items() if name == "coupler"}


def size_of(solution: GuidedSolution, samples: Samples) -> float | None:
    """The largest of `lengths` over the motion's extent; None without positions."""
    if samples.position is None:
        return None
    return max(lengths(solution, samples).values()) / samples.extent


# -- limits -------------------------------------------------------------------------------------------------------------


def dead_length(limits: Limits) -> float | None:
    """The least length of a driving cylinder: nothing where only the largest, or what is practical, is asked for."""
    given = limits.cylinder_dead_length
    return 0.0 if given is None and (limits.practical or limits.cylinder_extended_max is not None) else given


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
            least("pivot_box", float(outside(place, box)) / extent)
        reach = limits.pivot_reach
        if reach is not None and (far := getattr(reach, name)) is not None:
            least("pivot_reach", (abs(place - reach.middle) - far) / extent)
        for out in limits.keep_out:
            least("keep_out", -float(outside(place, out)) / extent)
    for guide, used, name in zip(linkage.guides, ends, ("pivot_a", "pivot_b")):
        if used is None:
            continue
        if limits.stroke_max is not None:
            least("stroke_max", (used[1] - used[0] - limits.stroke_max) / extent)
        if isinstance(guide, Rail):
            places = guide.point + np.array(used) * np.exp(1j * guide.direction)
            if (box := limits.rail_box_of(name)) is not None:
                least("rail_box", float(outside(places, box).max()) / extent)
            if limits.pivot_reach is not None:
                least("pivot_reach", float(np.abs(places - middle).max()) / extent - REACH)
    if linkage.driver is Driver.CYLINDER:
        used = ends[0]
        assert used is not None
        low, high = sorted(np.abs(used))
        least("cylinder_dead_length", ((dead_length(limits) or 0.0) - low) / extent)
        if used[0] * used[1] < 0 and dead_length(limits) is not None:  # it would pass its own pin
            least("cylinder_dead_length", low / extent)
        least("cylinder_extended_max", (high - (limits.cylinder_extended_max or np.inf)) / extent)
    if limits.arm_min is not None and isinstance(linkage.guides[1], Slot) and linkage.driver is not Driver.HINGE:
        q = linkage.start + linkage.travel_over(solution.interval)
        least("arm_min", (limits.arm_min - float(np.nan_to_num(np.min(linkage.body(q).arm)))) / extent)
    _break_lengths(solution, limits, extent, ends, least)
    if limits.envelope is not None:
        q = linkage.start + linkage.travel_over(solution.interval)
        for way in _traced(linkage, q):
            least("envelope", float(outside(way, limits.envelope).max()) / extent)
    return missing


def _break_lengths(
    solution: GuidedSolution,
    limits: Limits,
    extent: float,
    ends: tuple[Used, Used],
    least: Callable[[str, float], None],
) -> None:
    linkage, lengths = solution.linkage, solution.linkage.lengths
    pins = [_pin(guide) for guide in linkage.guides if not isinstance(guide, Rail)]
    if len(pins) == 2:
        lengths["ground"] = abs(pins[1] - pins[0])
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


def _traced(linkage: Linkage, q: Floats) -> list[Complexes]:
    """Where the body point and both joints are."""
    body = linkage.body(q)
    turned = np.exp(1j * body.rotation)
    found = [body.position]
    for guide in linkage.guides:
        found.append(np.array([guide.pin]) if isinstance(guide, Slot) else body.position + turned * guide.body_point)
        if isinstance(guide, Circle):
            found.append(np.array([guide.pivot]))
    return found
