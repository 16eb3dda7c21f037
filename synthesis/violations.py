"""Limits as measures of finished linkages of all kinds: a number of the linkage, its bound, and its violation.

A limit concerns the parts that a kind has: a rail has no pivot, and a linkage with a single crank has no rocker.
Links are the cranks, the distance of two pins of the body (coupler) and the distance of two pins of the ground (ground).
`family` concerns four-bars only. Compiled searches evaluate the same measures with derivatives (`synthesis/constraints.py` and
`synthesis/kernels/pair_rows.py`), and tests compare both with these.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.guides import Driver
from synthesis.limits import FORMS, LINKS, PIVOTS, REACH, Limits, in_family
from synthesis.linkage import Linkage
from synthesis.mechanism import Box, outside
from synthesis.one_variable import Floats as Numbers
from synthesis.one_variable import closer_looks
from synthesis.pose import DEGENERATE
from synthesis.solution import Solution
from synthesis.target import Samples

EQUATION = 1e-12
"""Largest violation of an equation by a four-bar, as a fraction of the largest number involved."""
_ROUNDING = 1e-9
"""Largest violation that is rounding, as a fraction of the motion's extent or in radians."""
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


class Measure(NamedTuple):
    """Number of a linkage that a limit bounds."""

    limit: str
    value: float
    bound: float
    unit: float = 1.0
    """Unit of the violation: the motion's extent (without positions the ground), a radian, or the shortest link for a ratio."""
    sense: int = 1
    """The value is at most (+1), at least (-1) or exactly (0) the bound."""

    @property
    def violation(self) -> float:
        """Violation in its unit; negative if the limit is satisfied with room to spare."""
        beyond = self.value - self.bound
        return (self.sense * beyond if self.sense else abs(beyond)) / self.unit


Measures = Iterator[Measure]


def within(samples: Samples, limits: Limits, solutions: Sequence[Solution]) -> list[Solution]:
    """Return the solutions that satisfy limits by their own numbers."""
    finite = (solution for solution in solutions if np.isfinite(solution.errors.objective))
    return [solution for solution in finite if not violations_of(solution, samples, limits)]


def violations_of(solution: Solution, samples: Samples, limits: Limits) -> dict[str, float]:
    """Return the violation of each limit that a solution does not satisfy over its interval, by name.

    A four-bar violates an inequality by any number above 0, because its search has a margin; other kinds by more than rounding.
    """
    found = _violations(solution, samples, limits, _used(solution, False))
    return _violations(solution, samples, limits, _used(solution, True)) if found.keys() & _BY_ENDS else found


def touched(solution: Solution, samples: Samples, limits: Limits) -> tuple[str, ...]:
    """Return the names of the limits at whose bounds a solution lies."""
    return tuple(_violations(solution, samples, limits, _used(solution, True), -_TOUCHED))


def practical_violations(solution: Solution, samples: Samples, practical: Limits) -> list[Measure]:
    """Return the worst measure of each practical limit that a solution violates; see `synthesis.limits.judged_limits`."""
    found, linkage = _Measures(solution, samples, practical), solution.linkage
    measures = [*found.angles(), *_of_ratio(linkage.lengths.values(), found.limits), *found.links(linkage.lengths)]
    measures += [*found.body_point(), *found.pivots()]
    if linkage.driver is Driver.CYLINDER:
        measures += found.cylinder(linkage.used(0, solution.interval))
    return _worst(measures)


def violations_of_shape(
    angles: tuple[float, float | None], lengths: Collection[float], practical: Limits
) -> list[Measure]:
    """Return the worst measure of each practical limit of shape that transmission angles and lengths violate.

    ``angles``: smallest transmission angles over the used interval, and over the turn if there is one. ``practical``: see
    `synthesis.limits.judged_limits`.
    """
    return _worst([*_of_angles(*angles, practical), *_of_ratio(lengths, practical)])


def _worst(measures: Iterable[Measure]) -> list[Measure]:
    """Return the measure with the largest violation of each limit that is violated by more than rounding."""
    found: dict[str, Measure] = {}
    for measure in measures:
        worst = found.get(measure.limit)
        if measure.violation > (_ROUNDING if worst is None else worst.violation):
            found[measure.limit] = measure
    return list(found.values())


def _violations(
    solution: Solution, samples: Samples, limits: Limits, ends: Sequence[Used], beyond: float = 0.0
) -> dict[str, float]:
    linkage, lengths = solution.linkage, _lengths(solution.linkage)
    measures = _Measures(solution, samples, limits)
    rounding = equation = _ROUNDING
    if linkage.is_four_bar:
        rounding = 0.0
        equation = EQUATION * max(*lengths.values(), measures.extent + abs(samples.middle)) / measures.extent
    found: dict[str, float] = {}
    for measure in measures.over_interval(lengths, ends):
        amount = measure.violation
        if amount > (rounding if measure.sense else equation) + beyond:
            found[measure.limit] = max(found.get(measure.limit, -np.inf), amount)
    return found


# -- measures ---------------------------------------------------------------------------------------------------------


class _Measures:
    """Measures of a finished linkage over its interval."""

    def __init__(self, solution: Solution, samples: Samples, limits: Limits) -> None:
        self.solution, self.linkage, self.limits, self.middle = solution, solution.linkage, limits, samples.middle
        self.extent = _lengths(self.linkage).get("ground", 1.0) if samples.position is None else samples.extent

    def over_interval(self, lengths: Mapping[str, float], ends: Sequence[Used]) -> Measures:
        """Return all measures, for lengths of links by name and the used coordinates of both guides."""
        yield from self.angles()
        yield from self.family()
        yield from self.pivots()
        yield from self.travel(ends)
        yield from self.links(lengths)
        yield from _of_ratio(lengths.values(), self.limits)
        yield from self.body_point()
        yield from self.points_of_body(ends)
        yield from self.envelope()
        yield from self.equations(lengths)

    def angles(self) -> Measures:
        """Measure the transmission angles over the interval and over the turn of a crank."""
        solution = self.solution
        turn = solution.transmission_angle_min_turn if self.linkage.driver is Driver.CRANK else None
        return _of_angles(solution.transmission_angle_min, turn, self.limits)

    def family(self) -> Measures:
        """Compare the family of a four-bar."""
        if self.linkage.is_four_bar and not in_family(self.limits.family, np.array([self.linkage.links])).item():
            yield Measure("family", np.inf, 0.0)

    def links(self, lengths: Mapping[str, float]) -> Measures:
        """Measure the lengths of links that are not given."""
        for name, length in lengths.items():
            if self.limits.links[LINKS.index(name)] is None:
                yield from self.bounded("link_max", length)
                yield from self.bounded("link_min", length)

    def body_point(self) -> Measures:
        """Measure the distances of the body point from the joints of the body."""
        reach = self.limits.pivot_reach
        if reach is not None and reach.body is not None:
            for guide in self.linkage.guides:
                if guide.holds_point:
                    yield Measure("body_reach", abs(guide.body_point), reach.body, self.extent)

    def points_of_body(self, ends: Sequence[Used]) -> Measures:
        """Measure the crank pin, and the joints and used slots of a body that is no coupler."""
        linkage, driven = self.linkage, self.linkage.guides[0]
        if not linkage.mounted:
            return
        if linkage.is_four_bar:  # a linkage that has shrunk to a point is no answer
            yield Measure("link_min", linkage.lengths["crank"], DEGENERATE * self.extent, self.extent, sense=-1)
        else:
            for guide, used in zip(linkage.guides, ends):
                in_slot = used is not None and not guide.holds_point
                for point in guide.body_at(np.array(used)).tolist() if in_slot else [guide.body_point]:
                    yield from self.bounded("link_max", abs(point))
        if driven.holds_point:
            yield from self.bounded("coupler_radius_max", abs(driven.body_point))

    def pivots(self) -> Measures:
        """Measure the positions of fixed pivots and pins that are not given."""
        limits, reach = self.limits, self.limits.pivot_reach
        for guide, name in zip(self.linkage.guides, PIVOTS):
            if not guide.has_pin or getattr(limits, name) is not None:
                continue
            pivot = guide[0]
            for box_name in (f"{name}_box", "pivot_box"):
                if (box := getattr(limits, box_name)) is not None:
                    yield self.outside(box_name, pivot, box)
            if reach is not None and (radius := getattr(reach, name)) is not None:
                yield Measure("pivot_reach", abs(pivot - reach.middle), radius, self.extent)
            for box in limits.keep_out:
                yield self.outside("keep_out", pivot, box, sense=-1)

    def bounded(self, limit: str, value: float) -> Measures:
        """Compare a length with a limit that is set."""
        if (bound := getattr(self.limits, limit)) is not None:
            yield Measure(limit, value, bound, self.extent, -1 if FORMS[limit].minimum else 1)

    def outside(self, limit: str, points: Any, box: Box, sense: int = 1) -> Measure:
        """Measure the largest distance of points from a box, negative inside."""
        return Measure(limit, float(np.max(outside(points, box))), 0.0, self.extent, sense)

    def travel(self, ends: Sequence[Used]) -> Measures:
        """Measure the used parts of rails, slots and cylinders, and the moment arm of a slot."""
        limits, linkage = self.limits, self.linkage
        for guide, used, name in zip(linkage.guides, ends, PIVOTS):
            if used is None:
                continue
            yield from self.bounded("stroke_max", used[1] - used[0])
            if not guide.has_pin:
                ends_of_rail = guide.ground_at(np.array(used))
                if (box := limits.rail_box_of(name)) is not None:
                    yield self.outside("rail_box", ends_of_rail, box)
                if limits.pivot_reach is not None:
                    distance = float(np.abs(ends_of_rail - self.middle).max())
                    yield Measure("pivot_reach", distance, REACH * self.extent, self.extent)
        if linkage.driver is Driver.CYLINDER:
            yield from self.cylinder(ends[0])
        if limits.arm_min is not None and not linkage.guides[1].holds_point and linkage.driver is not Driver.HINGE:
            arms = linkage.body(_coordinates(self.solution)).arm
            yield from self.bounded("arm_min", float(np.nan_to_num(np.min(arms))))

    def cylinder(self, used: Used) -> Measures:
        """Measure the shortest and the longest length of a cylinder, negative if it would pass its own pin."""
        assert used is not None
        low, high = sorted(used, key=abs)
        if self.limits.dead_length is not None:
            length = low * float(np.sign(high))
            yield Measure("cylinder_dead_length", length, self.limits.dead_length, self.extent, sense=-1)
        yield from self.bounded("cylinder_extended_max", abs(high))

    def envelope(self) -> Measures:
        """Measure the joints over the interval."""
        if (box := self.limits.envelope) is None:
            return
        for guide in self.linkage.guides:
            if guide.has_pin:
                yield self.outside("envelope", guide[0], box)
        points = [0j, *(guide.body_point for guide in self.linkage.guides if guide.holds_point)]
        farthest = _farthest_out(self.linkage, np.array(points), box, _coordinates(self.solution))
        yield Measure("envelope", farthest, 0.0, self.extent)

    def equations(self, lengths: Mapping[str, float]) -> Measures:
        """Compare given pivots and lengths."""
        for guide, name in zip(self.linkage.guides, PIVOTS):
            if (pivot := getattr(self.limits, name)) is not None and guide.has_pin:
                yield Measure(name, abs(guide[0] - pivot), 0.0, self.extent, sense=0)
        for name, length in zip(LINKS, self.limits.links):
            if length is not None and name in lengths:
                yield Measure(f"links.{name}", lengths[name], length, self.extent, sense=0)


def _of_angles(smallest: float, over_turn: float | None, limits: Limits) -> Measures:
    required = limits.transmission_angle_min or float(smallest == 0.0)  # an angle of 0 is never enough
    yield Measure("transmission_angle_min", smallest, required, sense=-1)
    if over_turn is not None and not limits.swings:
        yield Measure("transmission_angle_min_turn", over_turn, limits.transmission_angle_min_turn, sense=-1)


def _of_ratio(lengths: Collection[float], limits: Limits) -> Measures:
    if limits.link_ratio_max is not None and len(lengths) > 1:
        shortest = max(min(lengths), np.finfo(float).tiny)
        yield Measure("link_ratio_max", max(lengths), limits.link_ratio_max * shortest, shortest)


def _lengths(linkage: Linkage) -> dict[str, float]:
    """Return the lengths of all links by name; the ground is the distance of two pins of the ground."""
    pins = [guide[0] for guide in linkage.guides if guide.has_pin]
    ground = {"ground": abs(pins[1] - pins[0])} if len(pins) == 2 else {}
    return ground | linkage.lengths


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
