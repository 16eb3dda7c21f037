"""Closure of a chain on a track: slack over the phase, number of links, and the size of the track that just fits.

The phase of a chain is the arc length of its first pin P1 along the first segment of the track, which is the driver.
After a link length on the driver the chain is the same with renumbered pins, so this length is the period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Floats, closer_looks, rising_root, secant
from synthesis.scenes.chain.track import ChordError, ChordFault, NotClosing, PinMotion, Track, TrackPosition
from synthesis.work import Work


@dataclass(frozen=True)
class ExtremeSearchOptions:
    """Grid sizes of the search for extremes of a function of the phase."""

    period_cells: int = 192
    """Smallest number of cells into which a period is divided."""
    cells_per_segment: int = 24
    """Smallest number of cells per segment of the track."""
    max_minima: int = 32
    """Largest number of local minima that are refined."""
    refinement_nodes: int = 33
    """Number of nodes in each refinement of a local minimum."""


OPTIONS = ExtremeSearchOptions()

STRETCH_TOLERANCE = 1e-6
"""Missing length, as a fraction of the pitch, up to which a chain counts as not stretched."""


class Extreme(NamedTuple):
    """An extreme value of a function of the phase."""

    phase: float
    """Phase of the extreme."""
    value: float
    """Value of the function."""


def find_minimum(
    function: Callable[[Floats], Floats], start: float, end: float, cells: int, refinements: int = 4, tie: float = 0.0
) -> Extreme:
    """Find the smallest value of a continuous function of the phase, to rounding accuracy if the function is smooth.

    Parameters
    ----------
    function : callable
        ``function(phase) -> value`` for arrays of shape (n,).
    start, end : float
        Range of the phase.
    cells : int
        Number of cells into which the range is divided. Local minima of the grid are refined.
    refinements : int
        Number of refinements of each local minimum.
    tie : float
        Among minima within this difference of the smallest value, the first is returned.

    Returns
    -------
    Extreme
    """
    x = np.linspace(start, end, cells + 1)
    y = function(x)
    padded = np.pad(y, 1, constant_values=np.inf)
    minima = np.flatnonzero((y <= padded[:-2]) & (y <= padded[2:]))
    # a constant function has a local minimum at every node, so limit their number
    minima = minima[np.argsort(y[minima], kind="stable")][: OPTIONS.max_minima]
    left, right = x[np.maximum(minima - 1, 0)], x[np.minimum(minima + 1, cells)]
    values, phases = closer_looks(
        lambda samples: function(samples.ravel()).reshape(samples.shape),
        left,
        right,
        (OPTIONS.refinement_nodes,) * refinements,
    )
    tied = values <= values.min() + tie
    first = np.argmin(np.where(tied, phases, np.inf))
    return Extreme(float(phases[first]), float(values[first]))


def find_maximum(
    function: Callable[[Floats], Floats], start: float, end: float, cells: int, refinements: int = 4
) -> Extreme:
    """Find the largest value of a continuous function of the phase; see `find_minimum`."""
    minimum = find_minimum(lambda x: -function(x), start, end, cells, refinements)
    return Extreme(minimum.phase, -minimum.value)


@dataclass(frozen=True)
class Chain:
    """A chain of constant pitch on a track whose first segment drives it."""

    track: Track
    """The track; its first segment must hold at least one link."""
    pitch: float
    """Length of a link."""
    links: int
    """Number of links, and of pins."""

    def __post_init__(self) -> None:
        if not self.period <= self.track.length[0]:
            raise ChordError(ChordFault.NO_POINT, 0.0)

    @property
    def period(self) -> float:
        """Return the arc length of a link on the driver, after which the chain repeats."""
        return float(self.track.link_lengths(self.pitch)[0])

    @property
    def search_cells(self) -> int:
        """Return the number of cells of a period in the search for extremes."""
        return max(OPTIONS.period_cells, OPTIONS.cells_per_segment * self.track.count)

    def drive(self, phase: Floats) -> tuple[TrackPosition, PinMotion]:
        """Return position and motion of P1 at phases of at least 0.

        Beyond the end of the driver the phase continues as if the driver were longer. P1 is then stepped ahead from a
        pin further back in the chain that is still on the driver.
        """
        passed_links = np.maximum(np.ceil((phase - self.track.length[0]) / self.period), 0)
        along = np.maximum(phase - passed_links * self.period, 0.0)
        start = TrackPosition(np.zeros(len(phase), dtype=np.intp), along, np.zeros(len(phase), dtype=np.int64))
        motion = PinMotion(np.ones(len(phase)), np.zeros(len(phase)))
        return self.track.carry(start, motion, self.pitch, passed_links) if passed_links.any() else (start, motion)

    def phase_at(self, position: TrackPosition) -> Floats:
        """Return the phase for positions of P1 on the driver or up to one period beyond it.

        This function is the inverse of `drive`.
        """
        phase = self.track.arc_length(position)
        past_end = np.flatnonzero(phase > self.track.length[0])
        if len(past_end):
            phase[past_end] = (
                self.track.arc_length(self.track.step(position.select(past_end), self.pitch, -1)) + self.period
            )
        return phase

    def overrun(self, phase: Floats) -> Floats:
        """Return the length by which the chain overruns P1 when it is laid on the bare track from P1 round to P1.

        A negative overrun is a missing length. Each additional link increases the overrun by about one link length.
        """
        start, _ = self.drive(phase)
        end = self.track.advance(start, self.pitch, self.links)
        return self.track.arc_length(end) - self.track.arc_length(start) - self.track.total

    def smallest_overrun(self) -> Extreme:
        """Return phase and overrun of the state in which the chain is stretched most."""
        return find_minimum(self.overrun, 0.0, self.period, self.search_cells)


def closing_links(track: Track, pitch: float, work: Work | None = None) -> int:
    """Return the smallest number of links with which the chain is not stretched at any phase.

    Parameters
    ----------
    track : Track
    pitch : float
        Length of a link.
    work : Work, optional
        Called before each number of links to check whether the result is still wanted.
    """
    work = work or Work()

    def margin(links: int) -> float:
        work.go_on()
        return Chain(track, pitch, links).smallest_overrun().value + STRETCH_TOLERANCE * pitch

    # each link covers between 1 and pi/2 pitches of the track, so this number of links is enough
    links = int(np.ceil(track.total / pitch))
    while (slack := margin(links)) < 0:
        links += 1
    while links > 1:
        removable = max(1, int(slack / (pitch * np.pi / 2)))
        reduced = margin(links - removable)
        if reduced < 0 and removable > 1:
            removable, reduced = 1, margin(links - 1)
        if reduced < 0:
            break
        links, slack = links - removable, reduced
    return links


def critical_parameter(
    family: Callable[[float], Track],
    pitch: float,
    links: int,
    longest: float,
    shortest: float,
    family_name: str,
    work: Work | None = None,
) -> float:
    """Find the parameter of a family of tracks for which the chain just closes, with a smallest overrun of 0.

    This generalises the remark of the paper that R2 is maximal at theta1m: the critical phase is not assumed but
    found.

    Parameters
    ----------
    family : callable
        ``family(parameter) -> Track``; the length of the track must decrease from ``longest`` to ``shortest``.
    pitch : float
        Length of a link.
    links : int
        Number of links.
    longest, shortest : float
        Parameters of the longest and of the shortest track.
    family_name : str
        The family in the message of `NotClosing`.
    work : Work, optional
        Called before each parameter to check whether the result is still wanted.

    Returns
    -------
    float

    Raises
    ------
    NotClosing
        The chain closes on no track of the family.
    """
    work = work or Work()

    def overrun(parameter: float) -> float:
        work.go_on()
        return Chain(family(parameter), pitch, links).smallest_overrun().value

    at_longest, at_shortest = overrun(longest), overrun(shortest)
    if at_shortest < 0:
        raise NotClosing(links, closing_links(family(shortest), pitch, work), -at_shortest, family_name)
    if at_longest > 0:
        longest_chain = Chain(family(longest), pitch, links)
        nearest = closing_links(longest_chain.track, pitch, work)
        # with `nearest` links the longest track is slack, unless it fits exactly; a link less closes on a shorter track
        fits_exactly = (
            abs(Chain(longest_chain.track, pitch, nearest).smallest_overrun().value) <= STRETCH_TOLERANCE * pitch
        )
        raise NotClosing(links, nearest if fits_exactly else nearest - 1, -at_longest, family_name)
    # the overrun rises with the negative parameter
    rising = secant(lambda x: np.array([overrun(-x[0])]), -longest, at_longest)
    guess = -longest + (longest - shortest) * at_longest / (at_longest - at_shortest)
    return -float(rising_root(rising, -longest, -shortest, [guess])[0])
