"""The four-bar as a mechanism for scan and search: its motion, charts of its shapes, and its linkages.

Each chart maps its unknowns, without bounds or with change points at bounds, to four lengths (their common scale is
free, and the pose absorbs it) and to the two constants X0, Y0 of the closure (see `kinematics`), computed without
cancellation; `synthesis.kernels.crank_loops` computes both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.constraints import Constraints
from synthesis.four_bar import close_loop, grashof_excesses, wrap
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.kernels import codes
from synthesis.limits import PIVOTS, Limits, in_family
from synthesis.linkage import Linkage, as_lengths, four_bar
from synthesis.mechanism import Box, Boxes, Chart
from synthesis.pose import fit_positions
from synthesis.target import TURN, Samples, Target


@dataclass(frozen=True)
class AnyChart(Chart):
    """All four-bars: the logarithms of L1 / L4, L2 / L4, L3 / L4. Most points close only over a fraction of the turn."""

    cell = np.array([0.7, 1.0, 1.0, 0.6])
    hop = np.array([0.7, 1.5, 1.5, 0.4])
    kind = codes.ANY

    def shape_coordinates(self, unknowns: Floats) -> Floats:
        """Return logarithms of length ratios, (n, 3), in which distances of shapes are measured."""
        return unknowns / 0.7

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Return the unknowns (n, 3) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        return np.log(lengths[..., :3] / lengths[..., 3:])


@dataclass(frozen=True)
class GrashofChart(Chart):
    """All four-bars whose crank turns fully, by homogeneous unknowns (l, x, y, z), x, y, z >= 0.

    |l| is the shortest link: the crank if l > 0 (crank-rocker), the ground if l < 0 (double-crank);
    L2 = |l| + (x + y) / 2, L3 = |l| + (x + z) / 2, and the fourth length is |l| + (y + z) / 2. Then
    X0 = x (4 |l| + x + y + z) and Y0 = y z, without cancellation. The common scale is free: `within` normalizes
    the sum of magnitudes to 1.
    Law: ``unknowns(shape(x).lengths) == within(x)``.
    """

    LEAST = 1e-9
    """Smallest magnitude of an unknown: at change points the slope of theta2 has no limit."""

    cell = np.array([0.1, 0.1, 0.1, 0.1, 0.6])
    hop = np.array([0.4, 0.8, 0.8, 0.8, 0.3])
    """Standard deviations of perturbations: of the logarithms of the magnitudes, and of the start."""
    kind = codes.GRASHOF

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Return the unknowns (n, 4) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        a, b, c = grashof_excesses(lengths)
        rocker = lengths[..., 0] < lengths[..., 3]
        out = np.stack(
            [
                np.where(rocker, lengths[..., 0], -lengths[..., 3]),
                c,
                np.where(rocker, a, -b),
                np.where(rocker, b, -a),
            ],
            axis=-1,
        )
        return self.within(out)

    def within(self, unknowns: Floats) -> Floats:
        """Return the nearest unknowns within the bounds, each with its own sign of l, with scale 1."""
        unknowns = unknowns / np.sum(np.abs(unknowns), axis=-1, keepdims=True)
        out = np.maximum(unknowns, self.LEAST)
        out[..., 0] = np.copysign(np.maximum(np.abs(unknowns[..., 0]), self.LEAST), unknowns[..., 0])
        return out

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Perturb the logarithms of unknowns by noise (n, 4); excesses at a bound are lifted off it first."""
        side = np.sign(unknowns)
        return self.within(side * np.maximum(np.abs(unknowns), 1e-4) * np.exp(np.clip(noise, -8.0, 8.0)))

    def shape_coordinates(self, unknowns: Floats) -> Floats:
        """Return scale-free numbers of shapes, (n, 4): the family, and logarithms of ratios of the unknowns."""
        size = np.log(np.maximum(np.abs(unknowns), 1e-5 * np.sum(np.abs(unknowns), axis=1, keepdims=True)))
        ratios = size[:, :3] - size[:, 3:]
        return np.hstack([2 * np.sign(unknowns[:, :1]), ratios / [0.7, 1.0, 1.0]])


BRANCHES = (1, -1)
_TABLE_PERIMETER = 40
_PERIMETER = 32
_EDGE = 1e-5
"""Excess of types next to a change point, relative to the sum of shortest link and excesses."""
_ANY = (1.0, 1.7, 3.0, 4.5)
"""Length ratios of types of all families."""
_FREE = (0.05, 4.0), (1, 40, 12)
"""Range of free lengths over the longest prescribed length, and their number of values, by the number of free lengths."""
_EVERYWHERE: Box = (-np.inf, -np.inf, np.inf, np.inf)


class Bounded(NamedTuple):
    """One way to look for the best linkages of a target within limits."""

    chart: Chart
    constraints: Constraints
    on_shape: Constraints
    """Limits that concern only shape and start."""
    boxes: Boxes | None
    """Boxes if limits concern the pose or actual lengths; otherwise the best pose of a shape is used."""
    types: Floats = np.empty((0, 4))
    """Initial lengths (T, 4) if no coarse type is close to the given lengths."""


def search_spaces(target: Samples, limits: Limits, posed: bool | None = None) -> list[Bounded]:
    """Return the search spaces of four-bars within limits: full cranks, and then all four-bars if any family is allowed.

    ``posed``: the pose is an unknown beside the shape; default: if limits concern the pose.
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
    charts: list[Chart] = [GrashofChart()]
    if limits.family == "any":
        charts.append(AnyChart())
    types = given_types(limits)
    families = ("full_crank" if limits.family == "any" else limits.family, "any")
    own = [types if family == "any" else types[in_family(family, types)] for family in families]
    return [Bounded(chart, constraints, on_shape, boxes, box_set) for chart, box_set in zip(charts, own)]


def _boxes(limits: Limits, middle: complex, scale: float) -> Boxes:
    """Return the boxes that the limits impose on pivots and lengths."""
    own, boxes = limits.relative(middle, scale), []
    for name in PIVOTS:
        box, point, reach = own.box(f"{name}_box") or _EVERYWHERE, getattr(own, name), own.pivot_reach
        if point is not None:
            box = (point.real, point.imag, point.real, point.imag)
        elif reach is not None and (distance := getattr(reach, name)) is not None:
            x, y = reach.middle.real, reach.middle.imag
            box = (
                max(box[0], x - distance),
                max(box[1], y - distance),
                min(box[2], x + distance),
                min(box[3], y + distance),
            )
        boxes.append(box)
    shortest, longest = np.full(4, own.link_min or 0.0), np.full(4, own.link_max or np.inf)
    for k, length in enumerate(own.links):
        if length is not None:
            shortest[k] = longest[k] = length
    if own.pivot_a is not None and own.pivot_b is not None:
        shortest[3] = longest[3] = abs(own.pivot_b - own.pivot_a)
    return Boxes(boxes[0], boxes[1], shortest, longest)


def given_types(limits: Limits) -> Floats:
    """Return lengths (T, 4) with at least two prescribed lengths; free lengths lie on a grid."""
    known = [length for length in limits.links if length is not None]
    if len(known) < 2:
        return np.empty((0, 4))
    free = max(known) * np.geomspace(*_FREE[0], _FREE[1][4 - len(known)])
    lengths = np.array(list(product(*(free if length is None else [length] for length in limits.links))))
    return lengths[2 * lengths.max(axis=1) < lengths.sum(axis=1)]


def bounded_types(family: str) -> Floats:
    """Return the lengths (T, 4) of the initial types of a search within limits.

    They are full cranks of a small perimeter, and types next to each change point and next to two at once, because a
    curve with the fold of a change point inside the window is kinked, and no smooth descent leads to it. If any family
    is allowed, they include rockers.
    """
    full = enumerate_types(TypeRule(_PERIMETER, 1, OrderRule.FULL_CRANK)).astype(float)
    chart = GrashofChart()
    edges = []
    for excess, share in product((0.04, 0.2, 0.4, 0.65), (0.15, 0.5, 0.85)):
        remaining = np.array([_EDGE, (1 - excess) * share, (1 - excess) * (1 - share)])
        edges += [[side * excess, *np.roll(remaining, k)] for k in range(3) for side in (1, -1)]
    for excess in (0.03, 0.1, 0.25, 0.45, 0.65, 0.85):
        remaining = np.array([1 - excess, _EDGE, _EDGE])
        edges += [[side * excess, *np.roll(remaining, k)] for k in range(3) for side in (1, -1)]
    lengths = np.concatenate([full, chart.shape(chart.within(np.array(edges))).lengths])
    if family == "any":
        triangles = np.array(list(product(_ANY, repeat=4)))
        triangles = triangles[2 * triangles.max(axis=1) < triangles.sum(axis=1)]
        triangles = np.unique(np.round(triangles / triangles.sum(axis=1, keepdims=True), 9), axis=0)
        return np.concatenate([lengths, triangles[~in_family("full_crank", triangles)]])
    return lengths[in_family(family, lengths)]


def mounted(target: Target, lengths: ArrayLike, branch: ArrayLike, start: ArrayLike) -> list[Linkage]:
    """Return candidates as linkages in their best pose and with actual lengths; without positions with a ground of 1.

    Parameters
    ----------
    target : Target
    lengths : array_like, shape (n, 4)
        In any scale; each closes at every sample.
    branch, start : array_like, shape (n,)
        Branches, and crank angles theta1 at the first sample in radians.
    """
    links, side, begin = np.asarray(lengths, dtype=float), np.asarray(branch, dtype=float), np.asarray(start) % TURN
    if not begin.size:
        return []
    if target.position is None:
        return placed_linkages(links / links[:, 3:], side, begin, None)
    fit = fit_positions(target, close_loop(links, begin[:, None] + target.crank).coupler_angle(side))
    links = links * (np.abs(fit.crank_vector) / links[:, 0])[:, None]
    turned = np.array([wrap(angle) for angle in np.angle(fit.crank_vector) - begin])
    return placed_linkages(links, side, begin, (fit.pivot, turned, fit.coupler_vector))


def placed_linkages(
    lengths: Floats, branch: Floats, start: Floats, pose: tuple[Complexes, Floats, Complexes] | None
) -> list[Linkage]:
    """Return linkages in a given pose."""
    columns = zip(lengths, branch, np.asarray(start) % TURN)
    rows = [(as_lengths(row), int(side), float(at)) for row, side, at in columns]
    if pose is None:
        return [four_bar(*row) for row in rows]
    return [
        four_bar(*row, complex(a), wrap(turn), (float(abs(z)), wrap(float(np.angle(z)) - turn)))
        for row, a, turn, z in zip(rows, *pose)
    ]


@cache
def coarse_types() -> Floats:
    """Return crank-rockers and double-cranks of integer lengths and a small perimeter, (T, 4)."""
    return enumerate_types(TypeRule(_TABLE_PERIMETER, 1, OrderRule.FULL_CRANK)).astype(float)


def coupler_turns(lengths: Floats) -> NDArray[np.int8]:
    """Return the turns of the coupler in a turn of the crank, of full cranks: 1 for double-cranks, otherwise 0."""
    return (lengths[:, 0] > lengths[:, 3]).astype(np.int8)
