"""The limits of a request as functions: along which a search descends, and by which a finished linkage is checked.

`Constraints` holds the limits of four-bars as smooth functions of placed linkages. They are at least 0 if a limit is satisfied,
over the length scale and of order one; equations, such as a given pivot, are 0 if they are satisfied. `within` chooses the
four-bars that satisfy their limits, and `broken_limits` measures by how much a linkage of another kind violates them.

A limit concerns the parts that a kind has: a rail has no pivot, and a linkage with one crank has no rocker. Links are the cranks,
the distance of two pins of the body (coupler) and that of two pins of the ground (ground). `family` concerns four-bars only.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.four_bar import transmission_angle_over
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.kernels import codes, four_bar_limits
from synthesis.limits import LINKS, PIVOTS, REACH, Limits, in_family
from synthesis.linkage import Linkage
from synthesis.mechanism import Box, Constrained, Placed, outside
from synthesis.pose import DEGENERATE
from synthesis.solution import Solution
from synthesis.target import Samples, Target

_TRACED = {True: (257, 3), False: (25, 1)}
"""Number of crank angles at which joints are examined, and of refinements of their extremes: exactly, and in a search."""
SPARE = 1e-4
"""Fraction of the length scale by which the envelope of a search is smaller."""
_EXACT = 1e-12
"""Largest violation of an equation, as a fraction of the largest number involved."""
_ROUNDING = 1e-9
"""Largest violation of a limit that is rounding, as a fraction of the motion's extent or in radians; searches add a margin."""
_FEW_PLACES, _MORE = 41, 0.3
"""Number of travels that estimate the used part of a guide from above, and the fraction of the longest step added for it."""

BEGIN, END, PIVOT, TURNED, COUPLER = 4, 5, 6, 8, 9
"""Columns of the derivatives of `mechanism.Constrained` behind those by the lengths."""
_COUPLER, _COUPLER_FROM_ROCKER = 2, 3
"""Codes of points beside the fixed pivots: the body point from the crank pin and from the coupler pin."""
_SIGNS = {"crank_rocker": 1.0, "double_crank": -1.0}
"""Signs of the first two excesses of a family, see `four_bar.grashof_excesses`."""


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
        self._made: dict[bool, tuple[four_bar_limits.Limits, _Table]] = {}

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return not self.limits.only_family

    def __call__(self, placed: Placed, derivatives: bool = True) -> Constrained:
        """The constraints at linkages."""
        posed = placed.pivot is not None
        count, (limits, table) = len(placed.lengths), self._once(posed)
        nothing = np.zeros(count)
        pivot, turned, coupler = (0.0 if one is None else np.asarray(one) for one in placed[3:])
        values, slopes = limits(
            np.ascontiguousarray(placed.lengths, dtype=float),
            nothing + placed.branch,
            nothing + placed.used.first,
            nothing + placed.used.last,
            (nothing + 0j + pivot)[:, None].view(float),
            nothing + turned,
            (nothing + 0j + coupler)[:, None].view(float),
            derivatives,
        )
        return Constrained(values, slopes, table.equal, table.names)

    def compiled(self, posed: bool) -> four_bar_limits.Limits:
        """Them as a descent takes them: for linkages in a place, or for shapes alone."""
        return self._once(posed)[0]

    def _once(self, posed: bool) -> tuple[four_bar_limits.Limits, _Table]:
        if posed not in self._made:
            table = self._table(posed)
            self._made[posed] = four_bar_limits.Limits(np.array(table.rows).reshape(-1, 8), posed, table.equal), table
        return self._made[posed]

    def _table(self, posed: bool) -> _Table:
        table, limits, scale = _Table(), self.limits, self.scale
        every = self.smooth and limits.family != "any"
        if limits.transmission_angle_min:
            table.add("transmission_angle_min", codes.USED, np.cos(limits.transmission_angle_min))
        if every:
            table.add("family", codes.FAMILY, _SIGNS.get(limits.family, 0.0))
        if (least := limits.transmission_angle_min_turn) and not limits.swings:
            table.add("transmission_angle_min_turn", codes.OVER_TURN, np.cos(least), every)
        for name, bound, sign in (("link_min", limits.link_min, 1.0), ("link_max", limits.link_max, -1.0)):
            if bound is not None:
                for k, given in enumerate(limits.links):
                    if given is None:  # the others are within it
                        table.add(name, codes.LENGTH, k, sign, -sign * bound / scale)
        if limits.link_ratio_max is not None:
            table.add("link_ratio_max", codes.RATIOS if self.smooth else codes.RATIO, limits.link_ratio_max)
        for k, given in enumerate(limits.links):
            if given is not None:
                table.add(f"links.{LINKS[k]}", codes.LENGTH, k, 1.0, -given / scale, equal=True)
        if posed:
            self._on_pose(table)
        return table

    def _on_pose(self, table: _Table) -> None:
        limits, reach = self.limits, self.limits.pivot_reach
        for point, name in enumerate(PIVOTS):
            if (given := getattr(limits, name)) is not None:
                table.add(name, codes.AT, point, *self._point(given), equal=True)
                continue
            for box_name in (f"{name}_box", "pivot_box"):
                if (box := getattr(limits, box_name)) is not None:
                    table.add(box_name, codes.INSIDE, point, *self._box(box))
            if reach is not None and (far := getattr(reach, name)) is not None:
                table.add("pivot_reach", codes.NEAR, point, *self._point(reach.middle), far / self.scale)
            for out in limits.keep_out:
                table.add("keep_out", codes.OUTSIDE, point, *self._box(out))
        if limits.coupler_radius_max is not None:
            table.add("coupler_radius_max", codes.NEAR, _COUPLER, 0.0, 0.0, limits.coupler_radius_max / self.scale)
        if reach is not None and reach.body is not None:
            for point in (_COUPLER, _COUPLER_FROM_ROCKER):
                table.add("body_reach", codes.NEAR, point, 0.0, 0.0, reach.body / self.scale)
        if limits.envelope is not None:
            spare = 0.0 if self.exact else SPARE
            x, y, right, upper = self._box(limits.envelope)
            box = x + spare, y + spare, right - spare, upper - spare
            table.add("envelope", codes.ENVELOPE, *box, *_TRACED[self.exact])

    def _point(self, point: complex) -> tuple[float, float]:
        moved = (point - self.middle) / self.scale
        return moved.real, moved.imag

    def _box(self, box: Box) -> Box:
        return *self._point(complex(*box[:2])), *self._point(complex(*box[2:]))


class _Table:
    """Limits as the compiled kernel takes them, and what each of its rows is."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []
        self.names: list[str] = []
        self._equal: list[bool] = []

    def add(self, name: str, kind: int, *numbers: float, equal: bool = False) -> None:
        """One limit."""
        self.rows.append([kind, *numbers, *[0.0] * (7 - len(numbers))])
        self.names += [name] * codes.COUNTS[kind]
        self._equal += [equal] * codes.COUNTS[kind]

    @property
    def equal(self) -> Flags:
        """Which rows are equations."""
        return np.array(self._equal, dtype=bool)


# -- checks of four-bars ------------------------------------------------------------------------------------------------


def keeps(target: Samples, limits: Limits, placed: Placed, rounding: float = 0.0) -> Flags:
    """Check which placed four-bars satisfy limits, (n,).

    Parameters
    ----------
    target : Samples
        Its mean position and length scale are the units of the constraints.
    limits : Limits
    placed : Placed
        In the user's unit.
    rounding : float
        Fraction of the longest length by which a limit may be violated.
    """
    if limits.family == "any":
        holds = transmission_angle_over(placed.lengths, placed.used) > 0
    else:
        holds = in_family(limits.family, placed.lengths)
    if limits.only_family:
        return holds
    middle, scale = 0j, 1.0
    if placed.pivot is not None:
        assert target.position is not None
        middle, scale = target.middle, target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    size = np.maximum(placed.lengths.max(axis=1, keepdims=True), 1 + abs(middle) / scale)
    inside = np.where(found.equal, np.abs(found.values) <= _EXACT * size, found.values >= -rounding * size)
    if placed.pivot is not None:  # a linkage that has shrunk to a point satisfies many limits, but it is no answer
        inside = inside & (placed.lengths[:, :1] * scale > DEGENERATE * target.extent)
    return holds & np.all(inside, axis=1)


def placed_linkages(target: Target, linkages: Sequence[Linkage]) -> Placed:
    """Return four-bars in the form used to evaluate limits, in the user's unit."""
    links = np.array([linkage.links for linkage in linkages])
    branch, start, turned = np.array(
        [(linkage.branch, linkage.start, linkage.ground_angle) for linkage in linkages], dtype=float
    ).T
    placed = Placed(links, branch, target.interval.after(start))
    if target.position is None:
        return placed
    pivot, arm = np.array([(linkage.pivot_a, linkage.arm) for linkage in linkages]).T
    return placed._replace(pivot=pivot, turned=turned, coupler=arm * np.exp(1j * turned))


def within(target: Target, limits: Limits, solutions: Sequence[Solution]) -> list[Solution]:
    """Return the four-bars that satisfy limits by their own numbers."""
    if not solutions:
        return []
    inside = keeps(target, limits, placed_linkages(target, [solution.linkage for solution in solutions]))
    inside &= np.isfinite([solution.errors.objective for solution in solutions])
    return [solution for solution, holds in zip(solutions, inside) if holds]


# -- checks of other linkages -------------------------------------------------------------------------------------------

_BY_ENDS = {"stroke_max", "rail_box", "pivot_reach", "link_max", "cylinder_dead_length", "cylinder_extended_max"}
"""Limits of the used parts of rails and slots."""
Used = tuple[float, float] | None
"""Smallest and largest used coordinate of a rail or slot; None for a circle."""
Violations = Iterator[tuple[str, float]]
"""Names of limits, and by how much each is violated: negative if it is satisfied."""


def broken_limits(solution: Solution, samples: Samples, limits: Limits) -> dict[str, float]:
    """Return by how much a solution violates limits over its interval, by name.

    The values are fractions of the motion's extent, radians, or for ratios relative.
    """
    broken = _broken(solution, samples, limits, _used_at_most(solution))
    return _broken(solution, samples, limits, _used(solution)) if broken.keys() & _BY_ENDS else broken


def _broken(solution: Solution, samples: Samples, limits: Limits, ends: tuple[Used, Used]) -> dict[str, float]:
    broken: dict[str, float] = {}
    for violations in (
        _by_angles(solution, limits),
        _by_pivots(solution, limits, samples.extent),
        _by_travel(solution, limits, samples, ends),
        _by_lengths(solution, limits, samples.extent, ends),
        _by_envelope(solution, limits, samples.extent),
    ):
        for name, amount in violations:
            if amount > _ROUNDING:
                broken[name] = max(broken.get(name, 0.0), amount)
    return broken


def _by_angles(solution: Solution, limits: Limits) -> Violations:
    yield "transmission_angle_min", limits.transmission_angle_min - solution.transmission_angle_min
    if solution.transmission_angle_min == 0.0:
        yield "transmission_angle_min", 1.0
    turn = solution.transmission_angle_min_turn
    if turn is not None and solution.linkage.driver is Driver.CRANK:
        yield "transmission_angle_min_turn", limits.transmission_angle_min_turn - turn


def _by_pivots(solution: Solution, limits: Limits, extent: float) -> Violations:
    reach = limits.pivot_reach
    for guide, name in zip(solution.linkage.guides, PIVOTS):
        if isinstance(guide, Rail):
            continue
        pivot = guide[0]
        if (given := getattr(limits, name)) is not None:
            yield name, abs(pivot - given) / extent
        elif (box := limits.box(f"{name}_box")) is not None:
            yield "pivot_box", float(outside(pivot, box)) / extent
        if reach is not None and (far := getattr(reach, name)) is not None:
            yield "pivot_reach", (abs(pivot - reach.middle) - far) / extent
        for box in limits.keep_out:
            yield "keep_out", -float(outside(pivot, box)) / extent


def _by_travel(solution: Solution, limits: Limits, samples: Samples, ends: tuple[Used, Used]) -> Violations:
    linkage, extent = solution.linkage, samples.extent
    for guide, used, name in zip(linkage.guides, ends, PIVOTS):
        if used is None:
            continue
        if limits.stroke_max is not None:
            yield "stroke_max", (used[1] - used[0] - limits.stroke_max) / extent
        if isinstance(guide, Rail):
            places = guide.point + np.array(used) * np.exp(1j * guide.direction)
            if (box := limits.rail_box_of(name)) is not None:
                yield "rail_box", float(outside(places, box).max()) / extent
            if limits.pivot_reach is not None:
                yield "pivot_reach", float(np.abs(places - samples.middle).max()) / extent - REACH
    if linkage.driver is Driver.CYLINDER:
        assert ends[0] is not None
        first, last = ends[0]
        low, high = sorted((abs(first), abs(last)))
        dead_length = limits.dead_length
        yield "cylinder_dead_length", ((dead_length or 0.0) - low) / extent
        if first * last < 0 and dead_length is not None:  # the cylinder would pass its own pin
            yield "cylinder_dead_length", low / extent
        yield "cylinder_extended_max", (high - (limits.cylinder_extended_max or np.inf)) / extent
    if limits.arm_min is not None and isinstance(linkage.guides[1], Slot) and linkage.driver is not Driver.HINGE:
        arms = linkage.body(_coordinates(solution)).arm
        yield "arm_min", (limits.arm_min - float(np.nan_to_num(np.min(arms)))) / extent


def _by_lengths(solution: Solution, limits: Limits, extent: float, ends: tuple[Used, Used]) -> Violations:
    linkage, lengths = solution.linkage, solution.linkage.lengths
    pins = [guide[0] for guide in linkage.guides if not isinstance(guide, Rail)]
    if len(pins) == 2:
        lengths["ground"] = abs(pins[1] - pins[0])
    link_max = limits.link_max or np.inf
    for length in lengths.values():
        yield "link_max", (length - link_max) / extent
        yield "link_min", ((limits.link_min or 0.0) - length) / extent
    for name, given in zip(LINKS, limits.links):
        if given is not None and name in lengths:
            yield f"links.{name}", abs(lengths[name] - given) / extent
    if limits.link_ratio_max is not None and len(lengths) > 1:
        yield "link_ratio_max", max(lengths.values()) / min(lengths.values()) / limits.link_ratio_max - 1
    for guide, used in zip(linkage.guides, ends):
        for point in _body_points(guide, used):
            yield "link_max", (abs(point) - link_max) / extent
    driven = linkage.guides[0]
    if limits.coupler_radius_max is not None and not isinstance(driven, Slot):
        yield "coupler_radius_max", (abs(driven.body_point) - limits.coupler_radius_max) / extent


def _by_envelope(solution: Solution, limits: Limits, extent: float) -> Violations:
    if limits.envelope is None:
        return
    linkage = solution.linkage
    body = linkage.body(_coordinates(solution))
    turned = np.exp(1j * body.rotation)
    paths: list[Complexes] = [body.position]
    for guide in linkage.guides:
        if not isinstance(guide, Rail):
            paths.append(np.array([guide[0]]))
        if not isinstance(guide, Slot):
            paths.append(body.position + turned * guide.body_point)
    for path in paths:
        yield "envelope", float(outside(path, limits.envelope).max()) / extent


def _coordinates(solution: Solution) -> Floats:
    """Return coordinates of the drive over the used interval."""
    return solution.linkage.start + solution.linkage.travel_over(solution.interval)


def _body_points(guide: Guide, used: Used) -> list[complex]:
    """Return the guided point of the body, or both ends of the used part of a slot."""
    if not isinstance(guide, Slot):
        return [guide.body_point]
    along = np.exp(1j * guide.body_direction)
    return [] if used is None else [complex(guide.body_point + end * along) for end in used]


def _used(solution: Solution) -> tuple[Used, Used]:
    """Return the used coordinates of both guides, exactly."""
    first, second = (
        None if isinstance(guide, Circle) else solution.linkage.used(index, solution.interval)
        for index, guide in enumerate(solution.linkage.guides)
    )
    return first, second


def _used_at_most(solution: Solution) -> tuple[Used, Used]:
    """Return slightly larger intervals than the used ones, from few travels and so in a hundredth of the time."""
    travel = np.linspace(*solution.interval, _FEW_PLACES)
    found: list[Used] = []
    for index, guide in enumerate(solution.linkage.guides):
        if isinstance(guide, Circle):
            found.append(None)
            continue
        at = solution.linkage.along(index, travel)
        spare = _MORE * float(np.max(np.abs(np.diff(at))))
        found.append((float(np.min(at)) - spare, float(np.max(at)) + spare))
    return found[0], found[1]
