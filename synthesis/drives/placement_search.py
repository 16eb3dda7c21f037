"""Search for the placement of a linear actuator with the smallest peak force, or for the reason why there is none.

The pin q follows from the ground point G: it lies on two circles in the link's frame, for the first and the last position. So a
grid covers the plane of G in four families: extending or retracting, and two intersections. The grid, a product of matrices,
yields starting points; a descent of G and q on the largest u with ``arm >= u |torque|`` at every position ends at the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats, Ints
from synthesis.drives.leverage import lengths_and_arms
from synthesis.drives.placement_descent import PlacementProblem
from synthesis.drives.placements import TOLERANCE, Actuator, Placement, PlacementLimits, PlacementTask, Refusal, Sizes
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.work import Work


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
    start_fraction: float = 0.999
    """Initial u of a descent, as a fraction of the smallest ratio of arm and burden at its start."""
    retry_fraction: float = 0.9
    """Initial u of a descent that is repeated because it failed, as the same fraction."""
    max_retries: int = 1
    """Number of failed descents that are repeated."""
    max_restarts: int = 6
    """Number of restarts from the best end point."""
    restart_gain: float = 1e-8
    """Relative improvement that a restart must bring for another restart."""
    arm_fraction: float = 0.7
    """Fraction of the required moment arm at which a descent is started although no grid placement reaches it."""
    descent_tolerance: float = 1e-13
    """Change of u at which a descent ends."""
    descent_steps: int = 60
    """Largest number of steps of a descent."""


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
    shortfall: Refusal | None = None
    """Refusal if every arm is a little too small."""

    @property
    def best_value(self) -> float:
        """Value of the first placement."""
        return float(self.value[0])

    def select(self, indices: Ints) -> GridPlacements:
        """Return the placements with some indices."""
        columns: list[Any] = [column[indices] for column in list(self)[:7]]  # type: ignore[index]
        return GridPlacements(*columns)

    @classmethod
    def concatenate(cls, parts: list[GridPlacements]) -> GridPlacements:
        """Return the placements of several searches."""
        columns: list[Any] = [np.concatenate(column) for column in list(zip(*parts))[:7]]
        return cls(*columns)


class PlacementSearch(PlacementTask):
    """Search for placements on one link, for actuators of several sizes.

    Parameters
    ----------
    link, at, torque, limits, torque_integral
        See `PlacementTask`.
    grid_size : int
        Number of grid points in each direction.
    options : PlacementOptions
    """

    def __init__(
        self,
        link: LinkMotion,
        at: Floats,
        torque: Floats,
        limits: PlacementLimits,
        grid_size: int = GRID,
        torque_integral: float | None = None,
        options: PlacementOptions = OPTIONS,
    ) -> None:
        super().__init__(link, at, torque, limits, torque_integral)
        self.options, self.grid_size, self.grounds = options, grid_size, grid_of(limits.box, grid_size)
        self.middle = complex(np.mean(link.origin))

    # -- entry points -------------------------------------------------------------------------------------------------

    def best(self, actuator: Actuator, work: Work | None = None) -> Placement | Refusal:
        """Return the placement of an actuator with the smallest peak force, or why there is none."""
        return self.descend(self.screen([actuator], work=work), Sizes(actuator), work)

    def best_of_sizes(self, sizes: Sizes, work: Work | None = None) -> Placement | Refusal:
        """Return the best placement with free sizes, or why there is none."""
        return self.descend(self.screen_sizes(sizes, work), sizes, work)

    # -- descents -----------------------------------------------------------------------------------------------------

    def descend(
        self, starts: GridPlacements | Refusal, sizes: Sizes, work: Work | None, restart: bool = True
    ) -> Placement | Refusal:
        """Return the best end point of the descents from grid placements.

        Parameters
        ----------
        starts : GridPlacements or Refusal
            Result of `screen`; a refusal is returned as it is.
        sizes : Sizes
        work : Work, optional
        restart : bool
            Restart from the best end point, see `restart_from`.
        """
        if isinstance(starts, Refusal):
            return starts
        found = self.descents(starts, sizes, work)
        if not found:
            return starts.shortfall or Refusal("arm", 0.0)
        return self.restart_from(found[0], sizes) if restart else found[0]

    def descents(self, starts: GridPlacements, sizes: Sizes, work: Work | None) -> list[Placement]:
        """Return the end points of the descents from grid placements, the best first."""
        options = self.options
        found, failed = [], []
        columns = (starts.grounds.tolist(), starts.pins.tolist(), starts.extends.tolist())
        for actuator, ground, pin, extends in zip(starts.actuators, *columns):
            if work is None or not work.expired():
                own_sizes = replace(sizes, start=Actuator(*actuator.tolist()))
                end = self._descend_from(own_sizes, ground, pin, extends, options.start_fraction)
                if end is None:
                    failed.append((own_sizes, ground, pin, extends))
                else:
                    found.append(end)
        for start in failed[: options.max_retries]:  # the line search left the region of placements
            end = self._descend_from(*start, options.retry_fraction)
            found += [] if end is None else [end]
        if starts.shortfall is None:  # the best grid placement competes, in case that no descent ended well
            found.append(self.evaluate(complex(starts.grounds[0]), complex(starts.pins[0])))
        return sorted(found, key=lambda placement: placement.worst)

    def restart_from(self, best: Placement, sizes: Sizes) -> Placement:
        """Improve a placement by descents with a new curvature matrix: a descent can end early along a narrow ridge."""
        options = self.options
        for _ in range(options.max_restarts):
            low, high = sorted(best.length[[0, -1]].tolist())
            start = Actuator(
                low if sizes.retracted_free else sizes.start.retracted,
                high - low if sizes.stroke_free else sizes.start.stroke,
            )
            own_sizes = replace(sizes, start=start)
            end = self._descend_from(own_sizes, best.ground, best.pin, best.extends, options.start_fraction)
            gain = 0.0 if end is None else 1 - end.worst / best.worst
            if end is not None and gain > 0:
                best = end
            if gain < options.restart_gain:
                break
        return best

    def _descend_from(
        self, sizes: Sizes, ground: complex, pin: complex, extends: bool, fraction: float
    ) -> Placement | None:
        """Return the local optimum, or None if the descent leaves the limits."""
        problem = PlacementProblem(self, sizes, extends)
        has_equalities = not (sizes.retracted_free and sizes.stroke_free)
        options = self.options
        start = problem.start(ground, pin, fraction)
        end = problem.solve(start, has_equalities, options.descent_tolerance, options.descent_steps)
        if not np.isfinite(end).all():
            return None
        end = problem.restore_sizes(end)
        found = self.evaluate(*problem.points(end))
        is_valid = found.extends is extends and self.satisfies_limits(found) and problem.has_sizes(end)
        return found if is_valid else None

    # -- the grid -----------------------------------------------------------------------------------------------------

    def screen_sizes(self, sizes: Sizes, work: Work | None = None) -> GridPlacements | Refusal:
        """Return grid placements for free sizes, or why there are none."""
        if (
            self.link.largest_shift(self.limits.reach) <= TOLERANCE * self.size
        ):  # the link returns to its first position
            return Refusal("stroke", 0.0 if sizes.stroke_free else sizes.start.stroke)
        return self.screen(self._initial_sizes(sizes), work=work)

    def _initial_sizes(self, sizes: Sizes) -> list[Actuator]:
        """Return the sizes from which descents start.

        The retracted lengths are the shortest one and a geometric series that does not depend on the box or the dead
        length.
        """
        options = self.options
        longest = self.link.largest_shift(self.limits.reach)
        farthest = float(np.abs(self.grounds - self.link.origin[0]).max()) + self.limits.reach
        fractions = np.array(options.stroke_fractions)
        found = []
        for stroke in (fractions * longest if sizes.stroke_free else np.array([sizes.start.stroke])).tolist():
            shortest = stroke + sizes.dead_length
            if sizes.retracted_free:
                first, last = (
                    int(np.ceil(np.log(length / longest) / np.log(options.length_ratio)))
                    for length in (shortest, farthest)
                )
                lengths = [shortest, *(longest * options.length_ratio ** np.arange(first, last)).tolist()]
            else:
                lengths = [sizes.start.retracted] * (sizes.start.retracted >= shortest)
            found += [Actuator(retracted, stroke) for retracted in lengths]
        return found

    def screen(
        self, actuators: list[Actuator], max_results: int | None = None, work: Work | None = None
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
        max_results = self.options.max_descents if max_results is None else max_results
        box = self.limits.pin_box or self.limits.box
        points = self.grounds if self.limits.pin_box is None else grid_of(box, self.grid_size)
        found = [
            self._evaluate_grid(points, np.array([actuator]))
            for k, actuator in enumerate(actuators)
            if not (k and work is not None and work.expired())
        ]
        selected = [self._select(placements) for placements in found if not isinstance(placements, Refusal)]
        if not selected:
            refusals = [refusal for refusal in found if isinstance(refusal, Refusal)]
            return min(refusals, key=lambda refusal: _REASONS.index(refusal.reason), default=Refusal("stroke", 0.0))
        best = self._refine(self._select(GridPlacements.concatenate(selected)), box)
        return self._accept(best.select(np.arange(min(max_results, best.value.size))))

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
                best = self._select(GridPlacements.concatenate([best, closer]))
        return best

    def _accept(self, best: GridPlacements) -> GridPlacements | Refusal:
        """Return the placements from which a descent can start, or the refusal that the best placement shows."""
        arm_min = float(best.arm_min[0])
        if arm_min <= 0:
            arm = self.arms(best.grounds[:1], best.pins[:1])[0] * (self.sense if best.extends[0] else -self.sense)
            low = int(np.argmin(arm))
            neighbour = low + 1 if low == 0 or (low + 1 < arm.size and arm[low + 1] > 0) else low - 1
            return Refusal("dead", float(self.at[low]), (min(low, neighbour), max(low, neighbour)))
        if best.best_value > 0:
            return best.select(np.flatnonzero(best.value > 0))
        # the arm is a little too small, but a descent may still reach it
        shortfall = Refusal("arm", arm_min)
        few = best.select(np.arange(min(self.options.starts_per_family, best.value.size)))
        is_close = arm_min >= self.options.arm_fraction * self.limits.arm
        return few._replace(shortfall=shortfall) if is_close else shortfall

    def _evaluate_grid(self, points: Complexes, actuators: Floats) -> GridPlacements | Refusal:
        """Return all placements of actuators (1, 2) or (m, 2) from grid points (m,) within the limits, or why there are none.

        The grid consists of ground points, or of pins if these have a box.
        """
        grounds, pins, extends, sides, actuators, excess = self.families(points, actuators)
        if not grounds.size:
            return Refusal("stroke", excess)
        inside = np.abs(pins) <= self.limits.reach
        if not inside.any():
            return Refusal("reach", self._needed_reach(pins, actuators))
        if self.limits.pin_box is not None:
            beyond = outside(grounds, self.limits.box)
            if not (inside & (beyond <= 0)).any():
                return Refusal("pin_box", float(beyond[inside].min()))
            inside &= beyond <= 0
        grounds, pins, extends, sides = grounds[inside], pins[inside], extends[inside], sides[inside]
        arm = self.arms(grounds, pins) * (self.sense * np.where(extends, 1.0, -1.0))[:, None]
        arm_min = arm.min(axis=1)
        strong = (arm_min > 0) & (arm_min >= self.limits.arm)
        value = arm_min - self.limits.arm
        value[strong] = np.min(arm[strong] / np.maximum(self.burden, 1e-300), axis=1)
        return GridPlacements(grounds, pins, extends, sides, actuators[inside], arm_min, value)

    def _needed_reach(self, pins: Complexes, actuators: Floats) -> float:
        """Return the smallest distance of a pin, on a link that turns about a pivot whatever the grid is."""
        nearest = float(np.abs(pins).min())
        if self.link.pivot is None:
            return nearest
        exact = float(actuators[:, 1].min() / (2 * np.sin(min(abs(self.link.swing()), np.pi) / 2)))
        return exact if exact > self.limits.reach else nearest

    def families(
        self, points: Complexes, actuators: Floats
    ) -> tuple[Complexes, Complexes, Flags, Floats, Floats, float]:
        """Return the placements of all four families.

        Parameters
        ----------
        points : ndarray of complex, shape (m,)
            Ground points, or pins if these have a box; the other ends follow.
        actuators : ndarray, shape (m, 2) or (1, 2)

        Returns
        -------
        grounds, pins, extends, sides, actuators : ndarray
            Rows of all families.
        excess : float
            Smallest amount by which a stroke exceeds the displacement of a point.
        """
        link, has_pins = self.link, self.limits.pin_box is not None
        if has_pins:
            first, last = (link.origin[k] + link.direction[k] * points for k in (0, -1))
        else:
            first, last = (np.conj(link.direction[k]) * (points - link.origin[k]) for k in (0, -1))
        actuators = np.broadcast_to(actuators, (points.size, 2))
        short, long = actuators[:, 0], actuators[:, 0] + actuators[:, 1]
        between = last - first
        distance = np.abs(between)
        parts: list[tuple[Any, ...]] = []
        with np.errstate(divide="ignore", invalid="ignore"):
            along = between / distance
            for extends in self.directions:
                start, end = (short, long) if extends else (long, short)
                foot = ((start - end) * (start + end) / distance + distance) / 2
                height = start**2 - foot**2
                meets = np.flatnonzero(height >= 0)
                root = np.sqrt(height[meets])
                for side in (1.0, -1.0):
                    opposite = first[meets] + (foot[meets] + 1j * side * root) * along[meets]
                    labels = np.full(meets.size, extends), np.full(meets.size, side)
                    ends = (opposite, points[meets]) if has_pins else (points[meets], opposite)
                    parts.append((*ends, *labels, actuators[meets]))
        grounds, pins, directions, sides, sizes = (np.concatenate(column) for column in zip(*parts))
        return grounds, pins, directions, sides, sizes, float((actuators[:, 1] - distance).min())

    def arms(self, grounds: Complexes, pins: Complexes) -> Floats:
        """Return the moment arms of m placements at n positions, (m, n)."""
        return lengths_and_arms(self.link, self.middle, grounds, pins)[1]

    def _select(self, placements: GridPlacements) -> GridPlacements:
        """Return the best placements of each family that lie apart from each other, the best first."""
        family = 2 * placements.extends.astype(int) + (placements.sides > 0)
        separated = [
            self._separated(placements.grounds, np.where(family == k, placements.value, -np.inf)) for k in range(4)
        ]
        indices = np.concatenate(separated)
        return placements.select(indices[np.argsort(-placements.value[indices], kind="stable")])

    def _separated(self, grounds: Complexes, value: Floats) -> Ints:
        """Return the indices of the best placements of a family in different basins, not neighbours in the same basin."""
        found, value = [], value.copy()
        for _ in range(self.options.starts_per_family):
            k = int(np.argmax(value))
            if value[k] == -np.inf:
                break
            found.append(k)
            value[np.abs(grounds - grounds[k]) < self.options.spacing * self.size] = -np.inf
        return np.array(found, dtype=np.int64)


def grid_of(box: Box, count: int) -> Complexes:
    """Return the points of a grid over a box, ``count`` in each direction."""
    left, bottom, right, top = box
    x, y = np.meshgrid(np.linspace(left, right, count), np.linspace(bottom, top, count))
    return np.asarray((x + 1j * y).ravel())
