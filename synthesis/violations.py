"""Violations of limits by finished linkages of all kinds, measured from their own numbers.

A limit concerns the parts that a kind has: a rail has no pivot, and a linkage with a single crank has no rocker.
Links are the cranks, the distance of two pins of the body (coupler) and the distance of two pins of the ground (ground).
`family` concerns four-bars only. The searches for four-bars satisfy the same limits as functions, see `synthesis/constraints.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.guides import Driver, Guide
from synthesis.limits import LINKS, PIVOTS, REACH, Limits, in_family
from synthesis.linkage import Linkage
from synthesis.mechanism import Box, outside
from synthesis.one_variable import Floats as Numbers
from synthesis.one_variable import closer_looks
from synthesis.pose import DEGENERATE
from synthesis.solution import Solution
from synthesis.target import Samples

_EQUATION = 1e-12
"""Largest violation of an equation by a four-bar, as a fraction of the largest number involved."""
_ROUNDING = 1e-9
"""Largest violation by other kinds that is rounding, as a fraction of the motion's extent or in radians."""
_TOUCHED = 1e-5
"""Distance from a bound, in the same unit, up to which a solution lies at it."""
_FEW_POSITIONS, _MORE = 41, 0.3
"""Number of travels that estimate the used part of a guide from above, and the fraction of the longest step added for it."""
_NODES = 17, 17, 17, 17
"""Nodes of the repeated grids that locate where a joint is farthest out of the envelope."""
_BY_ENDS = {"stroke_max", "rail_box", "pivot_reach", "link_max", "cylinder_dead_length", "cylinder_extended_max"}
"""Limits of the used parts of rails and slots."""
Used = tuple[float, float] | None
"""Smallest and largest used coordinate of a rail or slot; None for a circle."""
Violations = Iterator[tuple[str, float]]
"""Names of limits, each with its violation: negative if it is satisfied."""


def within(samples: Samples, limits: Limits, solutions: Sequence[Solution]) -> list[Solution]:
    """Return the solutions that satisfy limits by their own numbers."""
    finite = (solution for solution in solutions if np.isfinite(solution.errors.objective))
    return [solution for solution in finite if not violations_of(solution, samples, limits)]


def violations_of(solution: Solution, samples: Samples, limits: Limits) -> dict[str, float]:
    """Return the violation of each limit that a solution does not satisfy over its interval, by name.

    The values are fractions of the motion's extent (without positions, of the ground), radians, or for ratios relative.
    A four-bar violates an inequality by any number above 0, because its search has a margin; other kinds by more than rounding.
    """
    found = _violations(solution, samples, limits, _used(solution, False))
    return _violations(solution, samples, limits, _used(solution, True)) if found.keys() & _BY_ENDS else found


def touched(solution: Solution, samples: Samples, limits: Limits) -> tuple[str, ...]:
    """Return the names of the limits at whose bounds a solution lies."""
    return tuple(_violations(solution, samples, limits, _used(solution, True), -_TOUCHED))


def _violations(
    solution: Solution, samples: Samples, limits: Limits, ends: Sequence[Used], beyond: float = 0.0
) -> dict[str, float]:
    linkage, lengths = solution.linkage, _lengths(solution.linkage)
    extent = lengths.get("ground", 1.0) if samples.position is None else samples.extent
    rounding = equation = _ROUNDING
    if linkage.is_four_bar:
        rounding = 0.0
        equation = _EQUATION * max(*lengths.values(), extent + abs(samples.middle)) / extent
    found: dict[str, float] = {}
    for spare, violations in (
        (rounding, _by_angles(solution, limits)),
        (rounding, _by_pivots(linkage, limits, extent)),
        (rounding, _by_travel(solution, limits, samples, extent, ends)),
        (rounding, _by_lengths(linkage, lengths, limits, extent, ends)),
        (rounding, _by_envelope(solution, limits, extent)),
        (equation, _by_equations(linkage, lengths, limits, extent)),
    ):
        for name, amount in violations:
            if amount > spare + beyond:
                found[name] = max(found.get(name, -np.inf), amount)
    return found


def _by_equations(linkage: Linkage, lengths: dict[str, float], limits: Limits, extent: float) -> Violations:
    for guide, name in zip(linkage.guides, PIVOTS):
        if (pivot := getattr(limits, name)) is not None and guide.has_pin:
            yield name, abs(guide[0] - pivot) / extent
    for name, length in zip(LINKS, limits.links):
        if length is not None and name in lengths:
            yield f"links.{name}", abs(lengths[name] - length) / extent


def _by_angles(solution: Solution, limits: Limits) -> Violations:
    linkage = solution.linkage
    yield "transmission_angle_min", limits.transmission_angle_min - solution.transmission_angle_min
    if solution.transmission_angle_min == 0.0:
        yield "transmission_angle_min", 1.0
    turn = solution.transmission_angle_min_turn
    if turn is not None and linkage.driver is Driver.CRANK and not limits.swings:
        yield "transmission_angle_min_turn", limits.transmission_angle_min_turn - turn
    if linkage.is_four_bar and not in_family(limits.family, np.array([linkage.links])).item():
        yield "family", np.inf


def _by_pivots(linkage: Linkage, limits: Limits, extent: float) -> Violations:
    reach = limits.pivot_reach
    for guide, name in zip(linkage.guides, PIVOTS):
        if not guide.has_pin or getattr(limits, name) is not None:
            continue
        pivot = guide[0]
        for box_name in (f"{name}_box", "pivot_box"):
            if (box := getattr(limits, box_name)) is not None:
                yield box_name, float(outside(pivot, box)) / extent
        if reach is not None and (radius := getattr(reach, name)) is not None:
            yield "pivot_reach", (abs(pivot - reach.middle) - radius) / extent
        for box in limits.keep_out:
            yield "keep_out", -float(outside(pivot, box)) / extent


def _by_travel(
    solution: Solution, limits: Limits, samples: Samples, extent: float, ends: Sequence[Used]
) -> Violations:
    linkage = solution.linkage
    for guide, used, name in zip(linkage.guides, ends, PIVOTS):
        if used is None:
            continue
        if limits.stroke_max is not None:
            yield "stroke_max", (used[1] - used[0] - limits.stroke_max) / extent
        if not guide.has_pin:
            ends_of_rail = guide.ground_at(np.array(used))
            if (box := limits.rail_box_of(name)) is not None:
                yield "rail_box", float(outside(ends_of_rail, box).max()) / extent
            if limits.pivot_reach is not None:
                yield "pivot_reach", float(np.abs(ends_of_rail - samples.middle).max()) / extent - REACH
    if linkage.driver is Driver.CYLINDER:
        assert ends[0] is not None
        first, last = ends[0]
        low, high = sorted((abs(first), abs(last)))
        dead_length = limits.dead_length
        yield "cylinder_dead_length", ((dead_length or 0.0) - low) / extent
        if first * last < 0 and dead_length is not None:  # the cylinder would pass its own pin
            yield "cylinder_dead_length", low / extent
        yield "cylinder_extended_max", (high - (limits.cylinder_extended_max or np.inf)) / extent
    if limits.arm_min is not None and not linkage.guides[1].holds_point and linkage.driver is not Driver.HINGE:
        arms = linkage.body(_coordinates(solution)).arm
        yield "arm_min", (limits.arm_min - float(np.nan_to_num(np.min(arms)))) / extent


def _lengths(linkage: Linkage) -> dict[str, float]:
    """Return the lengths of all links by name; the ground is the distance of two pins of the ground."""
    pins = [guide[0] for guide in linkage.guides if guide.has_pin]
    ground = {"ground": abs(pins[1] - pins[0])} if len(pins) == 2 else {}
    return ground | linkage.lengths


def _by_lengths(
    linkage: Linkage, lengths: dict[str, float], limits: Limits, extent: float, ends: Sequence[Used]
) -> Violations:
    link_max = limits.link_max or np.inf
    for name, length in lengths.items():
        if limits.links[LINKS.index(name)] is None:
            yield "link_max", (length - link_max) / extent
            yield "link_min", ((limits.link_min or 0.0) - length) / extent
    if limits.link_ratio_max is not None and len(lengths) > 1:
        longest_allowed = limits.link_ratio_max * min(lengths.values())
        yield "link_ratio_max", (max(lengths.values()) - longest_allowed) / longest_allowed
    if not linkage.mounted:
        return
    arm_name, arm_max = "link_max", link_max
    if linkage.is_four_bar:
        reach = limits.pivot_reach
        arm_name, arm_max = "body_reach", np.inf if reach is None or reach.body is None else reach.body
        yield "link_min", DEGENERATE - lengths["crank"] / extent  # a linkage that has shrunk to a point is no answer
    for guide, used in zip(linkage.guides, ends):
        for point in _body_points(guide, used):
            yield arm_name, (abs(point) - arm_max) / extent
    driven = linkage.guides[0]
    if limits.coupler_radius_max is not None and driven.holds_point:
        yield "coupler_radius_max", (abs(driven.body_point) - limits.coupler_radius_max) / extent


def _by_envelope(solution: Solution, limits: Limits, extent: float) -> Violations:
    if limits.envelope is None:
        return
    linkage = solution.linkage
    for guide in linkage.guides:
        if guide.has_pin:
            yield "envelope", float(outside(guide[0], limits.envelope)) / extent
    points = [0j, *(guide.body_point for guide in linkage.guides if guide.holds_point)]
    yield "envelope", _farthest_out(linkage, np.array(points), limits.envelope, _coordinates(solution)) / extent


def _farthest_out(linkage: Linkage, points: Complexes, envelope: Box, coordinates: Floats) -> float:
    """Return the largest distance of points of the body out of a box, also between the coordinates of the drive."""
    left, lower, right, upper = envelope
    direction, side = np.array([[1], [-1], [-1j], [1j]]), np.array([[left], [-right], [lower], [-upper]])
    joints, directions = np.repeat(points, 4)[:, None], np.tile(direction, (points.size, 1))
    sides = np.tile(side, (points.size, 1))

    def inside(q: Numbers) -> Numbers:
        """Return the distance of each joint from each side; 0 if the loop does not close."""
        body = linkage.body(q.ravel())
        position = body.position.reshape(q.shape) + np.exp(1j * body.rotation.reshape(q.shape)) * joints
        return np.nan_to_num(np.real(position * directions) - sides)

    first, last = (np.full(sides.size, coordinates[k]) for k in (0, -1))
    return -float(closer_looks(inside, first, last, (coordinates.size, *_NODES))[0].min())


def _coordinates(solution: Solution) -> Floats:
    """Return coordinates of the drive over the used interval."""
    return solution.linkage.start + solution.linkage.travel_over(solution.interval)


def _body_points(guide: Guide, used: Used) -> list[complex]:
    """Return the guided point of the body, or both ends of the used part of a slot."""
    return [guide.body_point] if used is None or guide.holds_point else guide.body_at(np.array(used)).tolist()


def _used(solution: Solution, exactly: bool) -> list[Used]:
    """Return the used coordinates of both guides: exactly, or a little more in a hundredth of the time."""
    linkage, found = solution.linkage, list[Used]()
    for index, guide in enumerate(linkage.guides):
        if not guide.slides:
            found.append(None)
        elif exactly:
            found.append(linkage.used(index, solution.interval))
        else:
            coordinates = linkage.along(index, np.linspace(*solution.interval, _FEW_POSITIONS))
            spare = _MORE * float(np.max(np.abs(np.diff(coordinates))))
            found.append((float(np.min(coordinates)) - spare, float(np.max(coordinates)) + spare))
    return found
