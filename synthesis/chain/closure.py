"""Does a chain close on a track: at which phases it is slack, with how many links, and for which size of the track.

The phase of a chain is the arc length of its first pin P1 along the first segment of the track, the driver. One link
further on, the chain looks the same with every pin renumbered, so the driver's link length is the period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.chain.track import ChordError, ChordFault, Floats, Motion, Place, Track

PHASE_CELLS = 192
"""Cells a period is searched in for the extremes of a function of the phase; more for tracks of many segments."""
CELLS_PER_SEGMENT = 24
ZOOM = 32
"""Parts a cell is split into, again and again, to find an extreme."""
STRETCH_TOLERANCE = 1e-6
"""Missing length, as a fraction of the pitch, up to which a chain counts as not stretched."""


class Extreme(NamedTuple):
    """Where a function of the phase is smallest or largest, and its value there."""

    phase: float
    value: float


def lowest(
    function: Callable[[Floats], Floats], start: float, end: float, cells: int, passes: int = 4, tie: float = 0.0
) -> Extreme:
    """The smallest value of a continuous function of one variable, to rounding where it is smooth.

    Every local minimum of a grid is zoomed into at once. The value's error falls with the square of the cell. Of
    minima within ``tie`` of the smallest the first is taken.
    """
    x = np.linspace(start, end, cells + 1)
    y = function(x)
    inner = np.pad(y, 1, constant_values=np.inf)
    valleys = np.flatnonzero((y <= inner[:-2]) & (y <= inner[2:]))
    # A level function is one valley, not as many as the grid has points.
    valleys = valleys[np.argsort(y[valleys], kind="stable")][:32]
    low, high = x[np.maximum(valleys - 1, 0)], x[np.minimum(valleys + 1, cells)]
    least, where = y[valleys].copy(), x[valleys].copy()
    for _ in range(passes):
        grid = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, ZOOM + 1)
        values = function(grid.ravel()).reshape(grid.shape)
        at = np.argmin(values, axis=1)
        rows = np.arange(len(at))
        better = values[rows, at] < least
        least, where = np.where(better, values[rows, at], least), np.where(better, grid[rows, at], where)
        low, high = grid[rows, np.maximum(at - 1, 0)], grid[rows, np.minimum(at + 1, ZOOM)]
    equal = np.flatnonzero(least <= least.min() + tie)
    first = equal[np.argmin(where[equal])]
    return Extreme(float(where[first]), float(least[first]))


def highest(function: Callable[[Floats], Floats], start: float, end: float, cells: int, passes: int = 4) -> Extreme:
    """The largest value of a continuous function of one variable: the mirror image of `lowest`."""
    found = lowest(lambda x: -function(x), start, end, cells, passes)
    return Extreme(found.phase, -found.value)


@dataclass(frozen=True)
class Chain:
    """A chain of constant pitch on a track whose first segment drives it.

    Parameters
    ----------
    track : Track
        Its first segment must hold at least one link.
    pitch : float
        Length of a link.
    links : int
        Number of links, and of pins.
    """

    track: Track
    pitch: float
    links: int

    def __post_init__(self) -> None:
        if not self.period <= self.track.length[0]:
            raise ChordError(ChordFault.NO_POINT, 0.0)

    @property
    def period(self) -> float:
        """Arc length of one link on the driver: the chain repeats itself after it."""
        return float(self.track.link_lengths(self.pitch)[0])

    @property
    def cells(self) -> int:
        """Cells of a period for the search of extremes."""
        return max(PHASE_CELLS, CELLS_PER_SEGMENT * self.track.count)

    def drive(self, phase: Floats) -> tuple[Place, Motion]:
        """P1 at phases of at least 0. Beyond the driver's end the phase goes on as if the driver were longer: the
        first pin is then the link that followed it, so many links ahead.
        """
        beyond = np.maximum(np.ceil((phase - self.track.length[0]) / self.period), 0)
        along = np.maximum(phase - beyond * self.period, 0.0)
        none = np.zeros(len(phase), dtype=np.intp)
        start = Place(none, along, none.astype(np.int64))
        motion = Motion(np.ones(len(phase)), np.zeros(len(phase)))
        if not beyond.any():
            return start, motion
        return self.track.advance(start, self.pitch, beyond, 1, motion)

    def phase_of(self, place: Place) -> Floats:
        """The phase for places of P1 on the driver or up to one period beyond it: the inverse of `drive`."""
        beyond = self.track.position(place) > self.track.length[0]
        phase = self.track.position(place)
        if beyond.any():
            later = Place(*(part[beyond] for part in place))
            phase[beyond] = self.track.position(self.track.step(later, self.pitch, -1)) + self.period
        return phase

    def overrun(self, phase: Floats) -> Floats:
        """Length by which the chain, laid on the bare track from P1 all round, overruns P1; negative: too short.

        Law: grows by about one link for each link that is added.
        """
        start, _ = self.drive(phase)
        end, _ = self.track.advance(start, self.pitch, self.links)
        return self.track.position(end) - self.track.position(start) - self.track.total

    def least_overrun(self) -> Extreme:
        """Phase and overrun of the state that stretches the chain most."""
        return lowest(self.overrun, 0.0, self.period, self.cells)

    def most_overrun(self) -> Extreme:
        """Phase and overrun of the state in which the chain is slackest."""
        return highest(self.overrun, 0.0, self.period, self.cells)


def closing_links(track: Track, pitch: float) -> int:
    """The smallest number of links that is not stretched at any phase.

    Law: with one link fewer, some phase misses more than the tolerance.
    """

    def least(links: int) -> float:
        return Chain(track, pitch, links).least_overrun().value + STRETCH_TOLERANCE * pitch

    # A link takes at least its pitch of the track, so this many suffice; and on an arc at most pi/2 pitches.
    links = int(np.ceil(track.total / pitch))
    while (room := least(links)) < 0:
        links += 1
    while links > 1:
        spare = max(1, int(room / (pitch * np.pi / 2)))
        below = least(links - spare)
        if below < 0:
            if spare == 1:
                break
            spare = 1
            below = least(links - 1)
            if below < 0:
                break
        links, room = links - spare, below
    return links


class NotClosing(ValueError):
    """No member of a family of tracks closes with a number of links.

    Parameters
    ----------
    nearest_links : int
        The nearest number that does close.
    missing : float
        Length that the chain lacks on the shortest track of the family; negative: its excess on the longest.
    """

    def __init__(self, nearest_links: int, missing: float) -> None:
        super().__init__(f"{nearest_links} links close; missing length {missing:.6g}")
        self.nearest_links = nearest_links
        self.missing = missing


def critical_parameter(
    family: Callable[[float], Track], pitch: float, links: int, longest: float, shortest: float
) -> float:
    """The parameter of a family of tracks for which the chain just closes: its least overrun is 0.

    The general form of the paper's remark that R2 is maximal at theta1m; no state is assumed to be the critical one.

    Parameters
    ----------
    family : callable
        ``family(parameter) -> Track``; its length must fall from ``longest`` to ``shortest``.
    longest, shortest : float
        Parameters of the longest and of the shortest track.

    Raises
    ------
    NotClosing
        The number of links is outside those of the family.
    """
    from scipy.optimize import brentq

    def least(parameter: float) -> float:
        return Chain(family(parameter), pitch, links).least_overrun().value

    at_longest, at_shortest = least(longest), least(shortest)
    if at_shortest < 0:
        raise NotClosing(closing_links(family(shortest), pitch), -at_shortest)
    if at_longest > 0:
        most = Chain(family(longest), pitch, links)
        nearest = closing_links(most.track, pitch)
        # With `nearest` links the longest track is slack, unless it happens to fit: one fewer closes on another.
        fits = abs(Chain(most.track, pitch, nearest).least_overrun().value) <= STRETCH_TOLERANCE * pitch
        raise NotClosing(nearest if fits else nearest - 1, -at_longest)
    return float(brentq(least, longest, shortest, xtol=1e-300, rtol=8.9e-16, maxiter=200))
