"""Excursions of the body point between samples: length of the curve over the distance of neighbouring samples.

A path may meet every sample and make a loop between two. The coordinate round a circuit of a four-bar follows from two signs:
X of `four_bar` is smallest at theta1 = pi, and Y at theta1 = 0.

* If neither is negative, the crank turns fully, and the two branches are the two circuits.
* If one is negative, the crank swings about the other position. Both branches meet at both ends of the swing: one circuit.
* If both are negative, theta1 reaches neither 0 nor pi: two circuits, mirror images. In each both branches meet at both ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.defects import SHORTEST_CHORD, one_way
from synthesis.four_bar import Closure, close_loop, grashof_excesses
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.solution import Solution
from synthesis.target import TURN

PANEL = np.deg2rad(15.0)
"""Longest panel of the rule for arc lengths, in the coordinate round the circuit."""
HALVINGS = 14
"""Largest number of times that a panel is halved, which a cusp of the curve requires."""
_GROWN = 50
"""Largest growth of the number of panels; if more panels are rough, the cause is rounding of the positions."""
ACCURACY = 1e-8
"""Estimated error of a panel, of the whole way between two samples, above which it is halved."""
CHORDS = 48
"""Chords of the curve between two samples, for linkages with rails or slots."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
# of values at the nodes, the last two coefficients of their Legendre series
TAIL = (np.polynomial.legendre.legvander(NODES, 7) * WEIGHTS[:, None] * (np.arange(8) + 0.5))[:, 6:]


@dataclass(frozen=True)
class Circuits:
    """Angles that the crank of four-bars can reach.

    ``turns``, ``at_zero``, ``at_pi`` (n, 1): the loop closes at every crank angle; at theta1 = 0; at theta1 = pi.
    """

    turns: Flags
    at_zero: Flags
    at_pi: Flags

    @classmethod
    def of(cls, lengths: Floats) -> Circuits:
        """Return the circuits of lengths (n, 4), by the signs of Y at theta1 = 0, a b, and of X at pi, c times the perimeter."""
        a, b, c = grashof_excesses(lengths)
        at_zero, at_pi = (np.sign(a) * np.sign(b) >= 0)[:, None], (c >= 0)[:, None]
        return cls(at_zero & at_pi, at_zero, at_pi)

    def carry(self, lengths: Floats, angle: Floats, side: Floats, timed: bool) -> Flags:
        """Return, for each linkage (n,), True if one circuit carries all samples (n, N)."""
        changes = np.diff(self.swing(angle)[1], axis=-1)
        mirrored = ~(self.at_zero | self.at_pi) & (changes % 2 != 0)
        changed = np.where(self.turns, np.diff(side, axis=-1) != 0, mirrored | (timed & (changes != 0)))
        return np.asarray(np.all(close_loop(lengths, angle).closed, axis=-1) & ~np.any(changed, axis=-1))

    def swing(self, angle: Floats) -> tuple[Floats, Floats]:
        """Return angles (n, N) without whole turns, cut between swings, and the number of the swing, which each cut increases."""
        shift = np.where(self.at_zero, np.pi, 0.0)
        swings = np.where(self.at_zero | self.at_pi, 1.0, 2.0)  # in a turn
        number = np.floor((angle + shift) * swings / TURN)
        return angle - TURN * np.floor(number / swings), number


@dataclass(frozen=True)
class RoundCircuit:
    """A coordinate that runs once round each circuit, 0 to 2 pi; arrays of shape (n, 1).

    It is theta1 where the crank turns fully. A crank that swings between theta1 = ``low`` and ``low + width`` moves as
    ``low + width sin^2(t/2)``, out on side +1 (0 < t < pi) and back on side -1: where the sides meet, at the ends of the
    swing, theta2 is infinitely fast in theta1 and smooth in t.
    """

    lengths: Floats
    turns: NDArray[np.bool_]
    low: Floats
    width: Floats
    side: Floats

    @classmethod
    def through(cls, lengths: Floats, crank_angle: Floats, side: Floats) -> tuple[RoundCircuit, Floats]:
        """The coordinate on the circuit of the first sample, and where samples (n, N) are in it."""
        where = Circuits.of(lengths)
        within, _ = where.swing(crank_angle)
        a, b, c = grashof_excesses(lengths)
        product = 4 * lengths[:, 0] * lengths[:, 3]
        # Y = 0 and X = 0 of `kinematics`; zero where the crank can be in line with the ground
        nearest = 2 * np.arcsin(np.sqrt(np.clip(-a * b / product, 0, 1)))[:, None]
        farthest = 2 * np.arccos(np.sqrt(np.clip(-c * lengths.sum(axis=-1) / product, 0, 1)))[:, None]
        low, high = np.where(where.at_zero, -farthest, nearest), np.where(where.at_pi, TURN - nearest, farthest)
        beyond = ~(where.at_zero | where.at_pi) & (within[:, :1] > np.pi)
        low, high = np.where(beyond, TURN - high, low), np.where(beyond, TURN - low, high)
        half = np.arctan2(np.sqrt(np.maximum(within - low, 0)), np.sqrt(np.maximum(high - within, 0)))
        return cls(lengths, where.turns, low, high - low, side[:, :1]), np.where(
            where.turns, crank_angle, 2 * side * half
        )

    def of_rows(self, row: NDArray[np.intp]) -> RoundCircuit:
        """Select linkages, possibly repeated."""
        return RoundCircuit(self.lengths[row], self.turns[row], self.low[row], self.width[row], self.side[row])

    def closure(self, parameter: Floats) -> tuple[Closure, Floats, Floats]:
        """The loop at places (n, m), the sides, and theta2."""
        angle = np.where(self.turns, parameter, self.low + self.width * np.sin(parameter / 2) ** 2)
        side = np.where(self.turns, self.side, np.where(np.sin(parameter) >= 0, 1.0, -1.0))
        closure = close_loop(self.lengths, angle)
        return closure, side, closure.diagonal_angle + side * 2 * np.arctan2(*closure.coupler_half_angle)

    def speed(self, parameter: Floats, point: Complexes) -> Floats:
        """|dP/dt| at places (n, m); ``point`` (n, 1) is P - D in the coupler's frame."""
        closure, side, theta2 = self.closure(parameter)
        angle = closure.crank_angle
        rate = np.where(self.turns, 1.0, self.width / 2 * np.sin(parameter))
        l1, l2, _, l4 = (closure.lengths[..., k] for k in range(4))
        # the loop's derivative, times e^{-i theta3}: theta2' = -L1 sin(t1 - t3) / (L2 sin(t2 - t3)), both over L3
        root = np.sqrt(closure.excess_x * closure.excess_y)
        slope = -2 * l1 * side * (l2 * np.sin(theta2 - angle) + l4 * np.sin(angle)) / np.where(root > 0, root, np.nan)
        crank = self.lengths[:, :1] * np.exp(1j * angle)
        # at the very end of a swing this is 0 / 0 in double precision; the other nodes of the panel are used instead
        return np.nan_to_num(np.abs(rate * (crank + point * slope * np.exp(1j * theta2))))

    def body_point(self, parameter: Floats, point: Complexes) -> Complexes:
        """P at places (n, m), in the ground frame."""
        closure, _, theta2 = self.closure(parameter)
        return self.lengths[:, :1] * np.exp(1j * closure.crank_angle) + point * np.exp(1j * theta2)


def excursions(
    linkages: Sequence[Linkage],
    crank_angle: ArrayLike,
    side: ArrayLike,
    length_scale: float,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
    carried: ArrayLike | None = None,
) -> list[float | None]:
    """Return the excursion of the body point of each linkage.

    It is the largest ratio, over neighbouring samples in the order in which they are passed, of the length of the curve between
    them to their distance; a distance below `SHORTEST_CHORD` of the length scale counts as this distance. Above `LEAVES_SAMPLES`
    the curve makes a detour between two samples. If the order is free, the widest gap is omitted.

    The result is accurate to 1e-6 of its value, or to rounding of the positions near a change point.

    ``linkages``: linkages with a pose. ``crank_angle``, ``side``, ``ordered``, ``closed``, ``timed``: see
    `synthesis.defects.passage`, with a row for each linkage. ``length_scale``: l of the objective, in the unit of the linkages.
    ``carried`` (n,): `synthesis.defects.Passage.circuit` of each linkage, if it is known.

    The result is at least 1 if no distance is below the shortest, and None without a body point or if no circuit contains all
    samples. It does not change if the samples are reversed, or if linkages and length scale are multiplied by k.
    """
    found: list[float | None] = [None] * len(linkages)
    crank_angle, side = np.asarray(crank_angle, dtype=float), np.asarray(side)
    mounted = [k for k, linkage in enumerate(linkages) if linkage.mounted]
    if not mounted:
        return found
    lengths = np.array([linkages[k].links for k in mounted])
    angle, side = crank_angle[mounted], side[mounted]
    if carried is None:
        carried = Circuits.of(lengths).carry(lengths, angle, side, timed)
    else:
        carried = np.asarray(carried)[mounted]
    rows = np.array(mounted)[carried]
    if not rows.size:
        return found
    lengths, angle, side = lengths[carried], angle[carried], side[carried]
    radius, direction = np.array([linkages[k].coupler_point_polar for k in rows]).T
    point = (radius * np.exp(1j * direction))[:, None]
    circuit, parameter = RoundCircuit.through(lengths, angle, side)
    first, step = _paths(parameter, circuit.turns, ordered, closed, timed)
    arc = _arcs(circuit, point, first, step)
    ends = circuit.body_point(np.concatenate([first, first + step], axis=-1), point)
    chord = np.abs(np.subtract(*np.split(ends, 2, axis=-1)))
    ratio = np.max(arc / np.maximum(chord, SHORTEST_CHORD * length_scale), axis=-1)
    for k, value in zip(rows, ratio):
        found[k] = float(value)
    return found


def excursions_of(
    solutions: Sequence[Solution], poses: Poses, carried: ArrayLike | None = None
) -> list[float | None]:
    """Return the excursion of the body point of each solution; None if the loop opens between samples.

    Those of four-bars are accurate to rounding, see `excursions`; for other linkages the curve is a polygon.

    ``carried`` (n,): whether one circuit carries all samples of each four-bar, if that is known.
    """
    linkages = [solution.linkage for solution in solutions]
    if not all(linkage.is_four_bar for linkage in linkages):
        return [_excursion(solution, poses) for solution in solutions]
    travel = np.array([solution.travel for solution in solutions])
    crank = np.array([[linkage.start] for linkage in linkages]) + travel
    side = np.broadcast_to(np.array([[linkage.branch] for linkage in linkages]), crank.shape)
    return excursions(
        linkages, crank, side, poses.extent, ordered=poses.ordered, closed=poses.closed, carried=carried
    )


def _excursion(solution: Solution, poses: Poses) -> float | None:
    """Return the excursion of the body point of any linkage, from chords of its curve."""
    travel = solution.travel if poses.ordered else np.sort(solution.travel)
    if poses.closed and solution.linkage.driver.turns:
        travel = np.append(travel, travel[0] + np.copysign(TURN, travel[-1] - travel[0]))
    parts = np.linspace(0.0, 1.0, CHORDS + 1)
    positions = travel[:-1, None] + np.diff(travel)[:, None] * parts
    points = solution.linkage.body(solution.linkage.start + positions.ravel()).position.reshape(positions.shape)
    arcs = np.abs(np.diff(points, axis=1)).sum(axis=1)
    chords = np.abs(points[:, -1] - points[:, 0])
    largest = float(np.max(arcs / np.maximum(chords, SHORTEST_CHORD * poses.extent)))
    return max(1.0, largest) if math.isfinite(largest) else None


def _arcs(circuit: RoundCircuit, point: Complexes, first: Floats, step: Floats) -> Floats:
    """Return the lengths of the curve between parameters ``first`` and ``first + step``, shape (n, m).

    Gauss-Legendre sums of |dP/dt| with eight nodes in panels of at most 15 degrees, halved if needed. For analytic values the
    coefficients of their Legendre series fall geometrically, the coefficients of degree 6 and 7 by a factor q, and the error of
    the sum, of degree 16, by about q^(16/7); Trefethen, Approximation Theory and Approximation Practice, chapter 19.
    """
    panels = np.maximum(np.ceil(np.abs(step) / PANEL), 1).astype(int).ravel()
    gap = np.repeat(np.arange(panels.size), panels)
    width = (step.ravel() / panels)[gap]
    begin = first.ravel()[gap] + (np.arange(gap.size) - (np.cumsum(panels) - panels)[gap]) * width
    arc: Floats = np.zeros(step.size)
    allowed: Floats = np.zeros(step.size)
    max_size = _GROWN * gap.size
    for halved in range(HALVINGS + 1):
        row = gap // step.shape[1]
        nodes = begin[:, None] + width[:, None] * ((NODES + 1) / 2)
        speed = circuit.of_rows(row).speed(nodes, point[row])
        mean = speed @ WEIGHTS / 2
        part = np.abs(width) * mean
        if not halved:
            allowed[:] = ACCURACY * np.bincount(gap, part, minlength=arc.size)
        tail = np.max(np.abs(speed @ TAIL), axis=-1) / np.where(mean > 0, mean, 1.0)
        rough = part * tail ** (16 / 7) > allowed[gap]
        if halved == HALVINGS or 2 * np.count_nonzero(rough) > max_size:
            rough[:] = False
        arc += np.bincount(gap[~rough], part[~rough], minlength=arc.size)
        gap, begin, width = gap[rough].repeat(2), begin[rough].repeat(2), width[rough].repeat(2) / 2
        begin[1::2] += width[1::2]
        if not gap.size:
            break
    return arc.reshape(step.shape)


def _paths(
    parameter: Floats, turns: NDArray[np.bool_], ordered: bool, closed: bool, timed: bool
) -> tuple[Floats, Floats]:
    """Return the starts of the paths between neighbours and their lengths, (n, N - 1), or (n, N) if closed."""
    if not ordered:
        parameter = np.sort(parameter % TURN, axis=-1)
        step = np.diff(parameter, axis=-1, append=parameter[:, :1] + TURN)
        if not closed:
            widest = np.argmax(step, axis=-1)[:, None]
            order = (widest + 1 + np.arange(parameter.shape[-1] - 1)) % parameter.shape[-1]
            parameter, step = np.take_along_axis(parameter, order, axis=-1), np.take_along_axis(step, order, axis=-1)
        return parameter, step
    steps, sign = one_way(np.diff(parameter, axis=-1))
    step = sign * steps
    if timed:
        step = np.where(turns, np.diff(parameter, axis=-1), step)
    if not closed:
        return parameter[:, :-1], step
    return parameter, np.concatenate([step, sign * ((sign * (parameter[:, :1] - parameter[:, -1:])) % TURN)], axis=-1)
