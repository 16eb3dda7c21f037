"""Search for springs of a catalogue that leave the smallest root mean square torque to the drive.

A spring of length l pulls with ``preload + stiffness (l - free_length)``; a gas spring's pull is negative. The drive gives the
torque of the load and stretches the spring besides: ``T + F(l) dl/dphi``. The ends of the springs are sought on a grid, then by a
descent within boxes, at a distance from the pivots and with every length in the spring's range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.descent import Bounds, DescentOptions, Functions, MaxMinProblem
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.placement_search import grid_of
from synthesis.drives.springs import Behaviour, Between, Spring, SpringRegion, SpringRow, rms_of, torque_of
from synthesis.work import Work


@dataclass(frozen=True)
class SpringSearchOptions:
    """Options of the search for springs of a catalogue."""

    grid: int = 12
    """Number of grid points of a box in each direction."""
    directions: int = 12
    """Number of directions of grid points on a link."""
    radii: tuple[float, ...] = (0.3, 0.6, 0.95)
    """Distances of grid points on a link, as fractions of its reach."""
    descents: int = 4
    """Number of descents for each row of the catalogue on each pair of links."""
    rows: int = 6
    """Number of rows, the best of all pairs of links, for which descents are made."""
    rows_per_pair: int = 2
    """Number of rows of each pair of links for which descents are made."""
    behaviour_descents: int = 24
    """Number of descents for a row and a pair of links if a behaviour is required, which few placements show."""
    violation_cost: float = 1e3
    """Cost on the grid of a violated behaviour, per fraction of the rms torque without springs or of the longest length."""
    descent: DescentOptions = field(default_factory=lambda: DescentOptions(tolerance=1e-12, max_steps=500))
    """Options of the descents."""
    range_slack: float = 0.2
    """Fraction of the longest length by which a grid placement may leave the range of lengths at the start of a descent."""
    digits: int = 9
    """Decimal digits of the cost on the grid; placements of equal cost keep their order."""
    gain: float = 1e-6
    """Smallest relative decrease of the rms torque that counts as an improvement."""


OPTIONS = SpringSearchOptions()
_TOLERANCE = 1e-6
"""Margin of lengths inside their range at the positions of the search, as a fraction of the longest length."""


class _Start(NamedTuple):
    """A row of the catalogue on a pair of links, with placements of the grid at which descents begin."""

    cost: float
    between: Between
    row: SpringRow
    ends: Complexes
    """(m, 2): first ends, in the plane at the first sample, and points of the second link."""


@dataclass(frozen=True)
class SpringSearch:
    """Search for springs between links of a machine.

    Parameters
    ----------
    machine : LinkMotions
    rows : list of SpringRow
        The catalogue.
    room : SpringRegion
    behaviour : Behaviour, optional
        Limits on the torque that remains; placements that satisfy them come before all others.
    work : Work, optional
        The search returns the best known placement once its time is up.
    options : SpringSearchOptions
    """

    machine: LinkMotions
    rows: list[SpringRow]
    room: SpringRegion
    behaviour: Behaviour | None = None
    work: Work = field(default_factory=Work)
    options: SpringSearchOptions = OPTIONS

    def best(self, torque: Floats, betweens: Sequence[Between], keeps_behaviour: bool = True) -> Spring | str:
        """Find the spring of the catalogue, the pair of links and its ends that leave the smallest rms torque.

        Parameters
        ----------
        torque : ndarray, shape (n,)
            Torque that the drive gives without the spring.
        betweens : sequence of pairs of str
            Pairs of links to try.
        keeps_behaviour : bool
            Apply the limits of the behaviour.

        Returns
        -------
        Spring or str
            The spring, or a sentence with the reason why no row fits.
        """
        behaviour = self.behaviour if keeps_behaviour else None
        starts: list[_Start] = []
        nearest: tuple[float, float, float, Between] | None = None
        for between in betweens:
            if starts and self.work.expired():
                break
            candidates, spread = self._screen(torque, between, behaviour)
            starts += candidates
            if nearest is None or spread[0] < nearest[0]:
                nearest = (*spread, between)
        if not starts:
            assert nearest is not None
            change, low, high, (first, second) = nearest
            where = f" between {first} and {second}" if len(betweens) == 1 else " between any two links"
            return (
                f"no spring of {len(self.rows)} fits{where}: the smallest change of length there is {change:.4g}, "
                f"and lengths range from {low:.4g} to {high:.4g}"
            )
        best: tuple[tuple[float, float, float], Spring] | None = None
        for start in self._promising(starts):
            problem = _SpringProblem(self, [(start.between, start.row)], torque, behaviour)
            for ends in start.ends:
                if self.work.expired() and best is not None:
                    break
                rank, found = problem.descend(ends)
                if best is None or rank < (*best[0][:2], best[0][2] * (1 - self.options.gain)):
                    best = rank, found[0]
        assert best is not None
        if best[0][0] > 0 and behaviour is not None:  # no spring fits and behaves: the best fit shows the deficit
            return self.best(torque, betweens, keeps_behaviour=False)
        return best[1]

    def best_set(self, torque: Floats, betweens: Sequence[Between]) -> list[Spring] | str:
        """Find a spring on each of several pairs of links; the springs work together.

        They are placed in turn, each with the earlier springs mounted; then all together.
        """
        springs: list[Spring] = []
        for between in betweens:
            found = self.best(torque + torque_of(springs, self.machine), [between], keeps_behaviour=False)
            if isinstance(found, str):
                return found
            springs.append(found)
        problem = _SpringProblem(self, [(spring.between, spring.row) for spring in springs], torque, self.behaviour)
        # the first end is an unknown in the plane at the first sample
        start = [(spring.ends(self.machine)[0][0], spring.points[1]) for spring in springs]
        return problem.descend(np.array(start).ravel())[1]

    def _promising(self, starts: list[_Start]) -> list[_Start]:
        """Return the starts with the lowest cost of all, and the best starts of each pair of links."""
        starts = sorted(starts, key=lambda start: start.cost)
        chosen = []
        for k, start in enumerate(starts):
            rank_of_pair = sum(earlier.between == start.between for earlier in starts[:k])
            if k < self.options.rows or rank_of_pair < self.options.rows_per_pair:
                chosen.append(start)
        return chosen

    def _screen(
        self, torque: Floats, between: Between, behaviour: Behaviour | None
    ) -> tuple[list[_Start], tuple[float, float, float]]:
        """Evaluate the rows of the catalogue on a grid of placements on two links.

        The torque of a spring is linear in its stiffness and its force at length 0, so that sums over the motion are made once
        for all rows.

        Returns
        -------
        starts : list of _Start
            The rows that fit somewhere.
        spread : tuple of float
            Smallest change of length on the grid, and the smallest and the largest length.
        """
        options = self.options
        ends = self._grid(*between)
        if not ends.size:
            return [], (np.inf, 0.0, 0.0)
        length, arm = self.machine.seen(between[1], between[0]).leverage(ends[:, :1], ends[:, 1:])
        shortest, longest = length.min(axis=1), length.max(axis=1)
        pull = length * arm
        square_sum = float(np.dot(torque, torque)) or 1.0
        by_arm, by_pull = arm @ torque, pull @ torque
        arms, pulls, products = (np.einsum("mn,mn->m", a, b) for a, b in ((arm, arm), (pull, pull), (arm, pull)))
        starts = []
        for row in self.rows:
            a, k = row.offset, row.stiffness
            square = square_sum + a * a * arms + k * k * pulls + 2 * (a * by_arm + k * by_pull + a * k * products)
            beyond = np.maximum(row.shortest - shortest, longest - row.longest)
            # few placements show a behaviour, and a descent moves other placements into the range of lengths
            slack = 0.0 if behaviour is None else options.range_slack * row.longest
            usable = np.flatnonzero(beyond <= slack)
            if not usable.size:
                continue
            cost = square[usable] / square_sum
            if behaviour is not None:
                violations = behaviour.violation(torque + a * arm[usable] + k * pull[usable])
                violations = (
                    violations / np.sqrt(square_sum / torque.size) + np.maximum(beyond[usable], 0.0) / row.longest
                )
                cost = cost + options.violation_cost * violations
            # of equal placements the first, whatever rounding makes of them
            order = usable[np.argsort(np.round(cost, options.digits), kind="stable")]
            if behaviour is not None:
                order = order[np.sort(np.unique(ends[order, 0], return_index=True)[1])]
            count = options.descents if behaviour is None else options.behaviour_descents
            starts.append(_Start(float(cost.min()), between, row, ends[order[:count]]))
        return starts, (float((longest - shortest).min()), float(shortest.min()), float(longest.max()))

    def _grid(self, first: str, second: str) -> Complexes:
        """Return all pairs (m, 2) of first ends, in the plane at the first sample, and points of the second link."""
        machine, room, options = self.machine, self.room, self.options
        angles = np.exp(1j * np.linspace(0, 2 * np.pi, options.directions, endpoint=False))
        around = (np.maximum(np.array(options.radii) * room.reach, room.clear)[:, None] * angles).ravel()
        if first == GROUND:
            grounds = grid_of(room.box, options.grid)
            for pivot in machine.pivots:
                grounds = grounds[np.abs(grounds - pivot) >= room.clear]
        else:
            link = machine.link(first)
            grounds = link.origin[0] + link.direction[0] * around
        return np.stack([np.repeat(grounds, around.size), np.tile(around, grounds.size)], axis=1)


class _SpringProblem:
    """Least rms torque with some springs together; the points are the two ends of each spring in turn."""

    def __init__(
        self,
        search: SpringSearch,
        mounts: list[tuple[Between, SpringRow]],
        torque: Floats,
        behaviour: Behaviour | None,
    ) -> None:
        self.search, self.mounts, self.torque, self.behaviour = search, mounts, torque, behaviour
        left, bottom, right, top = search.room.box
        self.size = max(right - left, top - bottom, search.room.reach)
        self.rms = rms_of(torque) or 1.0
        self.links = [search.machine.seen(second, first) for (first, second), _ in mounts]
        box: Bounds = [(left / self.size, right / self.size), (bottom / self.size, top / self.size)]
        free: Bounds = [(None, None)] * 2
        bounds = [bound for (first, _), _ in mounts for bound in (*(box if first == GROUND else free), *free)]
        self.problem = MaxMinProblem(self._evaluate, self.size, bounds)

    def descend(self, start: Complexes) -> tuple[tuple[float, float, float], list[Spring]]:
        """Descend to the nearest optimum from ends (2 k,).

        Returns
        -------
        rank : tuple of float
            Violations of the ranges of lengths and places, and of the behaviour, 0 within rounding; then the remaining rms
            torque.
        springs : list of Spring
            The springs at the end of the descent, or at its start if this has a lower rank.
        """
        end = self.problem.solve(start, self.search.options.descent)
        points = end if np.all(np.isfinite(end)) and self._rank(end) <= self._rank(start) else start
        machine = self.search.machine
        springs = [
            Spring(between, (machine.point_on(between[0], complex(first)), complex(second)), row)
            for (between, row), (first, second) in zip(self.mounts, points.reshape(-1, 2))
        ]
        return self._rank(points), springs

    def _rank(self, points: Complexes) -> tuple[float, float, float]:
        cost, limits, _ = self._evaluate(points[None])
        behaved = self._behaviour_rows(self._remaining(points[None])).shape[1]
        ranges, rows = np.split(limits[0], [limits.shape[1] - behaved])
        excess, violation = (max(-float(part.min(initial=0.0)), 0.0) for part in (ranges, rows))
        return (
            excess if excess > _TOLERANCE / 2 else 0.0,
            violation if violation > _TOLERANCE else 0.0,
            float(np.sqrt(-cost[0, 0])) * self.rms,
        )

    def _remaining(self, points: Complexes) -> Floats:
        """Return the torque (m, n) of the drive with the springs at points (m, 2 k)."""
        remaining = np.broadcast_to(self.torque, (len(points), self.torque.size))
        for k, (link, (_, row)) in enumerate(zip(self.links, self.mounts)):
            length, arm = link.leverage(points[:, [2 * k]], points[:, [2 * k + 1]])
            remaining = remaining + row.force(length) * arm
        return remaining

    def _behaviour_rows(self, remaining: Floats) -> Floats:
        return remaining[:, :0] if self.behaviour is None else self.behaviour.rows(remaining) / self.rms

    def _evaluate(self, points: Complexes) -> Functions:
        """Return minus the mean square torque; lengths, squared distances and behaviour are limits."""
        room, machine, limits = self.search.room, self.search.machine, []
        for k, (link, ((on, _), row)) in enumerate(zip(self.links, self.mounts)):
            first, second = points[:, [2 * k]], points[:, [2 * k + 1]]
            length = np.abs(link.position(second) - first)
            low, high = row.shortest + _TOLERANCE * row.longest, row.longest * (1 - _TOLERANCE)
            centres = machine.pivots if on == GROUND else [complex(machine.link(on).origin[0])]
            offsets = [second, *(first - centre for centre in centres)]
            distances = [np.abs(offset) ** 2 - room.clear**2 for offset in offsets]
            distances += [
                room.reach**2 - np.abs(offset) ** 2 for offset in (offsets[:1] if on == GROUND else offsets)
            ]
            limits += [(length - low) / self.size, (high - length) / self.size, np.hstack(distances) / self.size**2]
        remaining = self._remaining(points)
        cost = np.mean((remaining / self.rms) ** 2, axis=1, keepdims=True)
        return Functions(-cost, np.hstack([*limits, self._behaviour_rows(remaining)]), cost[:, :0])
