"""Four-bars within limits: the charts in which they are looked for, the types it begins with, and the check of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.grashof_chart import GrashofChart, LengthsChart
from synthesis.fourbar.kinematics import transmission_angle_over
from synthesis.fourbar.limits import Constraints, Limits, in_family
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.solution import Solution
from synthesis.mechanism import Bounded, BoundedChart, Box, Boxes, Placed
from synthesis.pose import DEGENERATE
from synthesis.target import Samples, Target

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_PERIMETER = 32
_EDGE = 1e-5
"""An excess of types next to a change point, of the sum of shortest link and excesses."""
_ANY = (1.0, 1.7, 3.0, 4.5)
"""Length ratios of types of all families."""
_EVERYWHERE: Box = (-np.inf, -np.inf, np.inf, np.inf)
_KEPT = 1e-12
"""To which, over the largest number involved, an answer must keep a given length or place."""


def ways(target: Samples, limits: Limits, posed: bool | None = None) -> list[Bounded]:
    """How four-bars within limits are looked for: among full cranks, and then, where any family will do, among all.

    ``posed``: whether the pose is an unknown beside the shape; default: where limits concern it.
    """
    if posed is None:
        posed = target.position is not None and not limits.on_shape
    middle, scale, boxes = 0j, 1.0, None
    if posed:
        assert target.position is not None
        middle, scale = complex(target.position_mean(target.position)), target.length_scale
        boxes = _boxes(limits, middle, scale)
    constraints = Constraints(limits, middle, scale, exact=False)
    on_shape = Constraints(limits.of_shape if posed else limits)
    charts: list[BoundedChart] = [GrashofChart(scaled=not posed)]
    if limits.family == "any":
        charts.append(LengthsChart())
    return [Bounded(chart, constraints, on_shape, boxes) for chart in charts]


def _boxes(limits: Limits, middle: complex, scale: float) -> Boxes:
    """Where the limits leave pivots and lengths: as far as boxes can say it."""
    places = []
    for name in ("pivot_a", "pivot_b"):
        box, given, reach = limits.box(f"{name}_box") or _EVERYWHERE, getattr(limits, name), limits.pivot_reach
        if given is not None:
            box = (given.real, given.imag, given.real, given.imag)
        elif reach is not None and (far := getattr(reach, name)) is not None:
            x, y = reach.middle.real, reach.middle.imag
            low, high = np.maximum(box[:2], [x - far, y - far]), np.minimum(box[2:], [x + far, y + far])
            box = (*low.tolist(), *high.tolist())
        corner = np.array([middle.real, middle.imag])
        low, high = (np.array(box[:2]) - corner) / scale, (np.array(box[2:]) - corner) / scale
        places.append((*low.tolist(), *high.tolist()))
    shortest, longest = np.full(4, (limits.link_min or 0.0) / scale), np.full(4, (limits.link_max or np.inf) / scale)
    for k, length in enumerate(limits.links):
        if length is not None:
            shortest[k] = longest[k] = length / scale
    if limits.pivot_a is not None and limits.pivot_b is not None:
        shortest[3] = longest[3] = abs(limits.pivot_b - limits.pivot_a) / scale
    return Boxes(places[0], places[1], shortest, longest)


def bounded_types(family: str) -> Floats:
    """Lengths (T, 4) of the types that a search within limits begins with.

    Full cranks of a small perimeter, and others next to each change point and to two at once: with the fold of a change point
    inside the window a curve is kinked, and no smooth descent leads there. For any family rockers as well.
    """
    full = enumerate_types(TypeRule(_PERIMETER, 1, OrderRule.FULL_CRANK)).astype(float)
    chart = GrashofChart()
    edges = []
    for least, share in product((0.04, 0.2, 0.4, 0.65), (0.15, 0.5, 0.85)):
        rest = np.array([_EDGE, (1 - least) * share, (1 - least) * (1 - share)])
        edges += [[side * least, *np.roll(rest, k)] for k in range(3) for side in (1, -1)]
    for least in (0.03, 0.1, 0.25, 0.45, 0.65, 0.85):
        rest = np.array([1 - least, _EDGE, _EDGE])
        edges += [[side * least, *np.roll(rest, k)] for k in range(3) for side in (1, -1)]
    lengths = np.concatenate([full, chart.shape(chart.within(np.array(edges))).lengths])
    if family == "any":
        others = np.array(list(product(_ANY, repeat=4)))
        others = others[2 * others.max(axis=1) < others.sum(axis=1)]
        others = np.unique(np.round(others / others.sum(axis=1, keepdims=True), 9), axis=0)
        return np.concatenate([lengths, others[~in_family("full_crank", others)]])
    return lengths[in_family(family, lengths)]


def keeps(target: Samples, limits: Limits, placed: Placed, rounding: float = 0.0) -> Flags:
    """Which linkages, placed in the user's unit, keep limits, (n,).

    Parameters
    ----------
    target : Samples
        Whose mean position and length scale the constraints are measured in.
    limits : Limits
    placed : Placed
    rounding : float
        Part of the longest length by which a limit may be broken.
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
        middle, scale = complex(target.position_mean(target.position)), target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    size = np.maximum(placed.lengths.max(axis=1, keepdims=True), 1 + abs(middle) / scale)
    inside = np.where(found.equal, np.abs(found.values) <= _KEPT * size, found.values >= -rounding * size)
    if placed.pivot is not None:  # a linkage shrunk to a point keeps many limits, and is no answer
        inside = inside & (placed.lengths[:, :1] * scale > DEGENERATE * target.extent)
    return holds & np.all(inside, axis=1)


def placed_linkages(target: Target, linkages: Sequence[Linkage]) -> Placed:
    """Linkages as the limits see them, in the user's unit."""
    found = Placed(
        np.array([one.links for one in linkages]),
        np.array([float(one.branch) for one in linkages]),
        target.interval.after(np.array([one.start for one in linkages])),
    )
    if target.position is None:
        return found
    turned = np.array([one.ground_angle for one in linkages])
    points = np.array([one.coupler_point for one in linkages])
    coupler = points[:, 0] * np.exp(1j * (points[:, 1] + turned))
    return found._replace(pivot=np.array([one.pivot_a for one in linkages]), turned=turned, coupler=coupler)


def within(target: Target, limits: Limits, solutions: list[Solution]) -> list[Solution]:
    """The solutions that keep limits, checked on their own numbers."""
    if not solutions:
        return []
    kept = keeps(target, limits, placed_linkages(target, [one.linkage for one in solutions]))
    kept &= np.isfinite([one.errors.objective for one in solutions])
    return [one for one, keep in zip(solutions, kept) if keep]
