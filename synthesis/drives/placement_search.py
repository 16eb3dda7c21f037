"""Search for the placement of a linear actuator with the smallest peak force, or for the reason why there is none.

The pin q follows from the ground point G: it lies on two circles in the link's frame, for the first and the last position. So a
grid covers the plane of G in four families: extending or retracting, and two intersections. The grid yields starting points; a
descent of G and q on the largest u with ``arm >= u |torque|`` at every position ends at the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats, Ints, rows_at, rows_of_all
from synthesis.drives.descent import DescentOptions, Functions, MaxMinProblem
from synthesis.drives.placements import TOLERANCE, Actuator, Placement, PlacementLimits, Refusal, Sizes
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class PlacementOptions:
    """Options of the search for a placement."""

    starts_per_family: int = 3
    """Number of grid placements of each family from which a descent may start."""
    spacing: float = 0.06
    """Smallest distance of such placements from each other, as a fraction of the size of box and reach."""
    max_descents: int = 8
    """Number of descents for each actuator."""
    stroke_fractions: tuple[float, ...] = (0.12, 0.25, 0.4, 0.55, 0.7, 0.85, 0.97)
    """Initial strokes if the stroke is free, as fractions of the longest displacement of a pin."""
    length_ratio: float = 1.5
    """Ratio of successive initial retracted lengths if the retracted length is free."""
    refinements: int = 4
    """Number of times that the grid is refined around its best placements if none satisfies the limits."""
    arm_fraction: float = 0.7
    """Fraction of the required moment arm at which a descent is started although no grid placement reaches it."""
    descent: DescentOptions = field(default_factory=lambda: DescentOptions(fraction=0.999))
    """Options of the descents."""


OPTIONS = PlacementOptions()
GRID = 60
"""Number of grid points in each direction for an actuator of fixed sizes."""
COARSE_GRID = 30
"""Number of grid points in each direction for a catalogue or free sizes, which gain more from many actuators."""
_NEIGHBOURS = np.array([complex(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])
"""Neighbours of a grid point, in steps of the grid."""
_REASONS = ("arm", "dead", "pin_box", "reach", "stroke")
"""Reasons of a refusal, from the closest to a placement to the farthest."""


class GridPlacements(NamedTuple):
    """Placements from which descents start, the best first; arrays of m rows."""

    grounds: Complexes
    pins: Complexes
    extends: Flags
    sides: Floats
    """Intersection of the circles, 1 or -1."""
    actuators: Floats
    """Retracted length and stroke, (m, 2)."""
    arm_min: Floats
    value: Floats
    """Smallest ratio of arm and burden; negative by the missing arm if the arm is too small."""

    @property
    def best_value(self) -> float:
        """Value of the first placement."""
        return float(self.value[0])

    @property
    def shortfall(self) -> Refusal | None:
        """Refusal if every arm is a little too small."""
        return None if self.best_value > 0 else Refusal("arm", float(self.arm_min[0]))


class PlacementSearch:
    """Search for placements on one link, for actuators of several sizes.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link relative to the link, or ground, that carries the other end.
    at : ndarray, shape (n,)
        Drive parameter at each position.
    torque : ndarray, shape (n,)
        Torque that the drive must give. If it is zero everywhere, the search maximizes the minimum arm.
    limits : PlacementLimits
    grid_size : int
        Number of grid points of a search in each direction.
    torque_integral : float, optional
        Integral of ``|torque|`` over the interval; by default from the n positions.
    """

    def __init__(
        self,
        link: LinkMotion,
        at: Floats,
        torque: Floats,
        limits: PlacementLimits,
        grid_size: int = GRID,
        torque_integral: float | None = None,
    ) -> None:
        self.grid_size, self.options = grid_size, OPTIONS
        self.link, self.at, self.torque, self.limits = link, at, torque, limits
        self.loaded = bool(np.any(torque))
        burden = np.abs(torque) if self.loaded else np.ones(at.size)
        self.torque_scale = float(burden.max()) if self.loaded else 1.0
        self.burden = burden / burden.max()
        self.sense = 1.0 if at[-1] >= at[0] else -1.0
        self.burden_integral = float(np.trapezoid(self.burden, at) * self.sense)
        self.torque_integral = (
            torque_integral if self.loaded and torque_integral else self.burden_integral * self.torque_scale
        )
        left, bottom, right, top = limits.box
        self.directions = (True, False) if limits.extends is None else (limits.extends,)
        self.size = max(right - left, top - bottom, limits.reach)

    def force_bound(self, stroke: float) -> float:
        """Return a lower bound of the peak force of all placements with a stroke."""
        return self.torque_integral / stroke

    def evaluate(self, ground: complex, pin: complex) -> Placement:
        """Return the placement with these ends."""
        length, arm = self.link.leverage(ground, pin)
        with np.errstate(divide="ignore", invalid="ignore"):
            force = self.torque / arm
            worst = float(np.max(self.burden / np.abs(arm))) * self.torque_scale
        return Placement(ground, pin, bool(length[-1] > length[0]), length, arm, force, worst)

    def problem(self, sizes: Sizes, extends: bool) -> MaxMinProblem:
        """Return the problem of the largest u with ``arm >= u burden`` within the limits, for one direction of the actuator.

        Its points are the ground point and the pin. Fixed sizes are equations; this formulation stays regular if the circles
        about both ends of the pin's path only touch, as they do at many optima.
        """
        limits = self.limits
        sign = self.sense * (1.0 if extends else -1.0)
        short_end, long_end = (0, -1) if extends else (-1, 0)
        # u in units of its upper bound, so that all unknowns have similar magnitudes
        unit = sizes.start.stroke / max(self.burden_integral, 1e-300)

        def evaluate(points: Complexes) -> Functions:
            ground, pin = points[:, :1], points[:, 1:]
            length, arm = self.link.leverage(ground, pin)
            arm *= sign / unit
            short, long = length[:, [short_end]], length[:, [long_end]]
            inside = (1 - np.abs(pin) / limits.reach) * (1 + np.abs(pin) / limits.reach)
            rows = [arm - limits.arm / unit, inside]
            if sizes.retracted_free or sizes.stroke_free:
                rows.append((2 * short - long - sizes.dead_length) / self.size)
            fixed = [] if sizes.retracted_free else [short - sizes.start.retracted]
            fixed += [] if sizes.stroke_free else [long - short - sizes.start.stroke]
            return Functions(arm, np.hstack(rows), np.hstack([points.real[:, :0], *fixed]) / self.size)

        reach = limits.reach
        corners = (*limits.box, *(limits.pin_box or (-reach, -reach, reach, reach)))
        low, high = (np.array([corners[k] for k in ks]) / self.size for ks in ((0, 1, 4, 5), (2, 3, 6, 7)))
        return MaxMinProblem(evaluate, self.size, list(zip(low.tolist(), high.tolist())), self.burden)

    def satisfies_limits(self, placement: Placement) -> bool:
        """Check the limits of a placement up to rounding."""
        room = TOLERANCE * self.size
        signed = placement.arm * self.sense * (1.0 if placement.extends else -1.0)
        return bool(
            outside(placement.ground, self.limits.box) <= room
            and abs(placement.pin) <= self.limits.reach + room
            and (self.limits.pin_box is None or outside(placement.pin, self.limits.pin_box) <= room)
            and np.all(np.isfinite(signed))
            and signed.min() >= self.limits.arm - room
            and signed.min() > 0
        )

    # -- entry points -------------------------------------------------------------------------------------------------

    def best(self, actuator: Actuator, work: Work = UNLIMITED) -> Placement | Refusal:
        """Return the placement of an actuator with the smallest peak force, or why there is none."""
        return self.descend(self.screen([actuator], work=work), Sizes(actuator), work)

    def best_of_sizes(self, sizes: Sizes, work: Work = UNLIMITED) -> Placement | Refusal:
        """Return the best placement with free sizes, or why there is none."""
        return self.descend(self.screen_sizes(sizes, work), sizes, work)

    # -- descents -----------------------------------------------------------------------------------------------------

    def descend(self, starts: GridPlacements | Refusal, sizes: Sizes, work: Work) -> Placement | Refusal:
        """Return the best end point of the descents from the grid placements of `screen`; return a refusal as it is."""
        if isinstance(starts, Refusal):
            return starts
        found: list[Placement] = []
        for ground, pin, extends, actuator in zip(starts.grounds, starts.pins, starts.extends, starts.actuators):
            if not work.expired():
                own_sizes = replace(sizes, start=Actuator(*actuator.tolist()))
                end = self._descend_from(own_sizes, np.array([ground, pin]), bool(extends))
                found += [] if end is None else [end]
        if starts.shortfall is None:  # the best grid placement competes, in case that no descent ended well
            found.append(self.evaluate(complex(starts.grounds[0]), complex(starts.pins[0])))
        best = min(found, key=lambda placement: placement.worst, default=None)
        return best or starts.shortfall or Refusal("arm", 0.0)

    def _descend_from(self, sizes: Sizes, start: Complexes, extends: bool) -> Placement | None:
        """Return the local optimum, or None if the descent leaves the limits."""
        problem = self.problem(sizes, extends)
        end = problem.solve(start, self.options.descent)
        if not np.isfinite(end).all():
            return None
        end = problem.restored(end, 2)
        found, functions = self.evaluate(*end.tolist()), problem.evaluate(end[None])
        has_sizes = np.abs(functions.equalities).max(initial=0.0) <= TOLERANCE
        if sizes.retracted_free or sizes.stroke_free:
            has_sizes &= functions.limits[0, -1] >= -TOLERANCE
        return found if has_sizes and found.extends is extends and self.satisfies_limits(found) else None

    # -- the grid -----------------------------------------------------------------------------------------------------

    def screen_sizes(self, sizes: Sizes, work: Work = UNLIMITED) -> GridPlacements | Refusal:
        """Return grid placements for free sizes, or why there are none.

        The initial retracted lengths are the shortest one and a geometric series that does not depend on the box or the dead
        length.
        """
        options, reach = self.options, self.limits.reach
        longest = self.link.largest_shift(reach)
        if longest <= TOLERANCE * self.size:  # the link returns to its first position
            return Refusal("stroke", 0.0 if sizes.stroke_free else sizes.start.stroke)
        farthest = float(np.abs(grid_of(self.limits.box, 2) - self.link.origin[0]).max()) + reach
        found = []
        for stroke in np.multiply(options.stroke_fractions, longest) if sizes.stroke_free else [sizes.start.stroke]:
            shortest = float(stroke) + sizes.dead_length
            if sizes.retracted_free:
                ends = np.log(np.array([shortest, farthest]) / longest) / np.log(options.length_ratio)
                lengths = [shortest, *(longest * options.length_ratio ** np.arange(*np.ceil(ends))).tolist()]
            else:
                lengths = [sizes.start.retracted] * (sizes.start.retracted >= shortest)
            found += [Actuator(retracted, float(stroke)) for retracted in lengths]
        return self.screen(found, work=work)

    def screen(
        self, actuators: list[Actuator], max_results: int | None = None, work: Work = UNLIMITED
    ) -> GridPlacements | Refusal:
        """Return the best grid placements of some actuators, or why there are none.

        If none satisfies the limits, the grid is refined around the best placements.

        Parameters
        ----------
        actuators : list of Actuator
        max_results : int, optional
            Largest number of placements; by default `PlacementOptions.max_descents`.
        work : Work, optional
            Once it has expired, only the first actuator is evaluated.
        """
        box = self.limits.pin_box or self.limits.box
        points, selected, refusals = grid_of(box, self.grid_size), [], []
        for k, actuator in enumerate(actuators):
            if k and work.expired():
                break
            placements = self._evaluate_grid(points, np.array([actuator]))
            if isinstance(placements, Refusal):
                refusals.append(placements)
            else:
                selected.append(self._select(placements))
        if not selected:
            return min(refusals, key=lambda refusal: _REASONS.index(refusal.reason), default=Refusal("stroke", 0.0))
        best = self._refine(self._select(rows_of_all(*selected)), box)
        return self._accept(rows_at(best, slice(max_results or self.options.max_descents)))

    def _refine(self, best: GridPlacements, box: Box) -> GridPlacements:
        """Refine the grid around the best placements until one of them satisfies the limits."""
        left, bottom, right, top = box
        step = complex(right - left, top - bottom) / max(self.grid_size - 1, 1)
        for _ in range(self.options.refinements):
            if best.best_value > 0:
                break
            step /= 2
            centres = best.grounds if self.limits.pin_box is None else best.pins
            points = centres[:, None] + (_NEIGHBOURS.real * step.real + 1j * _NEIGHBOURS.imag * step.imag)
            points = np.clip(points.real, left, right) + 1j * np.clip(points.imag, bottom, top)
            closer = self._evaluate_grid(points.ravel(), np.repeat(best.actuators, _NEIGHBOURS.size, axis=0))
            if not isinstance(closer, Refusal):
                best = self._select(rows_of_all(best, closer))
        return best

    def _accept(self, best: GridPlacements) -> GridPlacements | Refusal:
        """Return the placements from which a descent can start, or the refusal that the best placement shows."""
        arm_min = float(best.arm_min[0])
        if arm_min <= 0:
            arm = self.evaluate(best.grounds[0], best.pins[0]).arm * (self.sense if best.extends[0] else -self.sense)
            low = int(np.argmin(arm))
            neighbour = low + 1 if low == 0 or (low + 1 < arm.size and arm[low + 1] > 0) else low - 1
            return Refusal("dead", float(self.at[low]), (min(low, neighbour), max(low, neighbour)))
        if best.best_value > 0:
            return rows_at(best, best.value > 0)
        # the arm is a little too small, but a descent may still reach it
        is_close = arm_min >= self.options.arm_fraction * self.limits.arm
        few = rows_at(best, slice(self.options.starts_per_family))
        return few if is_close else few.shortfall or Refusal("arm", arm_min)

    def _evaluate_grid(self, points: Complexes, actuators: Floats) -> GridPlacements | Refusal:
        """Return all placements of actuators (1, 2) or (m, 2) from grid points (m,) within the limits, or why there are none.

        The grid consists of ground points, or of pins if these have a box; the other ends follow.
        """
        link, limits = self.link, self.limits
        if limits.pin_box is not None:
            first, last = (link.origin[k] + link.direction[k] * points for k in (0, -1))
        else:
            first, last = (np.conj(link.direction[k]) * (points - link.origin[k]) for k in (0, -1))
        actuators = np.broadcast_to(actuators, (points.size, 2))
        short, long = actuators[:, 0], actuators.sum(axis=1)
        distance = np.abs(last - first)
        families = []
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (last - first) / distance
            for extends in self.directions:
                start, end = (short, long) if extends else (long, short)
                foot = ((start - end) * (start + end) / distance + distance) / 2
                height = start**2 - foot**2
                meets = np.flatnonzero(height >= 0)
                for side in (1.0, -1.0):
                    opposite = first[meets] + (foot[meets] + 1j * side * np.sqrt(height[meets])) * along[meets]
                    grounds, pins = (points[meets], opposite) if limits.pin_box is None else (opposite, points[meets])
                    labels, zeros = np.broadcast_to([extends, side], (meets.size, 2)), np.zeros(meets.size)
                    families.append(
                        GridPlacements(grounds, pins, labels[:, 0] > 0, labels[:, 1], actuators[meets], zeros, zeros)
                    )
        found = rows_of_all(*families)
        if not found.pins.size:
            return Refusal("stroke", float((actuators[:, 1] - distance).min()))
        inside = np.abs(found.pins) <= limits.reach
        if not inside.any():
            return Refusal("reach", self._needed_reach(found.pins, actuators))
        beyond = outside(found.grounds, limits.box) if limits.pin_box is not None else np.zeros(inside.size)
        if not (inside & (beyond <= 0)).any():
            return Refusal("pin_box", float(beyond[inside].min()))
        found = rows_at(found, inside & (beyond <= 0))
        # in blocks that fit into the cache
        blocks = zip(*(np.array_split(ends, 1 + ends.size // 500) for ends in (found.grounds, found.pins)))
        arm = np.concatenate([link.leverage(grounds[:, None], pins[:, None])[1] for grounds, pins in blocks])
        arm *= (self.sense * np.where(found.extends, 1.0, -1.0))[:, None]
        arm_min = arm.min(axis=1)
        strong = (arm_min > 0) & (arm_min >= limits.arm)
        value = arm_min - limits.arm
        value[strong] = np.min(arm[strong] / np.maximum(self.burden, 1e-300), axis=1)
        return found._replace(arm_min=arm_min, value=value)

    def _needed_reach(self, pins: Complexes, actuators: Floats) -> float:
        """Return the smallest distance of a pin, on a link that turns about a pivot whatever the grid is."""
        nearest = float(np.abs(pins).min())
        if self.link.pivot is None:
            return nearest
        exact = float(actuators[:, 1].min() / (2 * np.sin(min(abs(self.link.swing()), np.pi) / 2)))
        return exact if exact > self.limits.reach else nearest

    def _select(self, placements: GridPlacements) -> GridPlacements:
        """Return the best placements of each family that lie apart from each other, the best first."""
        family = 2 * placements.extends + (placements.sides > 0)
        room, few = self.options.spacing * self.size, self.options.starts_per_family
        separated = [
            separate(np.where(family == k, placements.value, -np.inf), placements.grounds[:, None], room, few)
            for k in range(4)
        ]
        indices = np.concatenate(separated)
        return rows_at(placements, indices[np.argsort(-placements.value[indices], kind="stable")])


def separate(value: Floats, points: Complexes, distance: float, max_results: int) -> Ints:
    """Return the indices of the largest values in different basins, not neighbours in the same basin, the best first.

    Parameters
    ----------
    value : ndarray, shape (m,)
        -inf for candidates that are no choice.
    points : ndarray of complex, shape (m, k)
        Points of each candidate.
    distance : float
        Smallest sum of the distances of the points of two candidates.
    max_results : int
    """
    found: list[int] = []
    value = value.copy()
    while len(found) < max_results:
        k = int(np.argmax(value))
        if value[k] == -np.inf:
            break
        found.append(k)
        value[np.abs(points - points[k]).sum(axis=1) < distance] = -np.inf
    return np.array(found, dtype=np.int64)


def grid_of(box: Box, count: int) -> Complexes:
    """Return the points of a grid over a box, ``count`` in each direction."""
    left, bottom, right, top = box
    x, y = np.meshgrid(np.linspace(left, right, count), np.linspace(bottom, top, count))
    return np.asarray((x + 1j * y).ravel())
