"""Does a chain close on a track: at which phases it is slack, with how many links, and for which size of the track.

The phase of a chain is the arc length of its first pin P1 along the first segment of the track, the driver. One link
further on, the chain looks the same with every pin renumbered, so the driver's link length is the period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Floats, closer_looks, rising_root, secant
from synthesis.scenes.chain.track import ChordError, ChordFault, Motion, NotClosing, Place, Track
from synthesis.work import Work

PHASE_CELLS = 192
"""Cells a period is searched in for the extremes of a function of the phase; more for tracks of many segments."""
CELLS_PER_SEGMENT = 24
VALLEYS, NODES = 32, 33
"""Local minima of the cells that are looked at more closely, and nodes of each look."""
STRETCH_TOLERANCE = 1e-6
"""Missing length, as a fraction of the pitch, up to which a chain counts as not stretched."""


class Extreme(NamedTuple):
    """Where a function of the phase is smallest or largest, and its value there."""

    phase: float
    value: float


def lowest(
    function: Callable[[Floats], Floats], start: float, end: float, cells: int, looks: int = 4, tie: float = 0.0
) -> Extreme:
    """The smallest value of a continuous function of the phase, to rounding where it is smooth.

    Every local minimum of the cells is looked at. Of minima within ``tie`` of the smallest the first is taken.
    """
    x = np.linspace(start, end, cells + 1)
    y = function(x)
    inner = np.pad(y, 1, constant_values=np.inf)
    valleys = np.flatnonzero((y <= inner[:-2]) & (y <= inner[2:]))
    # A level function has a valley at every node: enough are some.
    valleys = valleys[np.argsort(y[valleys], kind="stable")][:VALLEYS]
    left, right = x[np.maximum(valleys - 1, 0)], x[np.minimum(valleys + 1, cells)]
    values, places = closer_looks(
        lambda looked: function(looked.ravel()).reshape(looked.shape), left, right, (NODES,) * looks
    )
    equal = values <= values.min() + tie
    first = np.argmin(np.where(equal, places, np.inf))
    return Extreme(float(places[first]), float(values[first]))


def highest(function: Callable[[Floats], Floats], start: float, end: float, cells: int, looks: int = 4) -> Extreme:
    """The largest value of a continuous function of the phase: the mirror image of `lowest`."""
    found = lowest(lambda x: -function(x), start, end, cells, looks)
    return Extreme(found.phase, -found.value)


@dataclass(frozen=True)
class Chain:
    """A chain of constant pitch on a track whose first segment drives it."""

    track: Track
    """Its first segment must hold at least one link."""
    pitch: float
    """Length of a link."""
    links: int
    """Number of links, and of pins."""

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
        """P1 at phases of at least 0.

        Beyond the driver's end the phase goes on as if the driver were longer: the first pin is then the link that
        followed it, so many links ahead.
        """
        beyond = np.maximum(np.ceil((phase - self.track.length[0]) / self.period), 0)
        along = np.maximum(phase - beyond * self.period, 0.0)
        start = Place(np.zeros(len(phase), dtype=np.intp), along, np.zeros(len(phase), dtype=np.int64))
        motion = Motion(np.ones(len(phase)), np.zeros(len(phase)))
        return self.track.carry(start, motion, self.pitch, beyond) if beyond.any() else (start, motion)

    def phase_of(self, place: Place) -> Floats:
        """The phase for places of P1 on the driver or up to one period beyond it: the inverse of `drive`."""
        phase = self.track.position(place)
        beyond = np.flatnonzero(phase > self.track.length[0])
        if len(beyond):
            phase[beyond] = self.track.position(self.track.step(place.rows(beyond), self.pitch, -1)) + self.period
        return phase

    def overrun(self, phase: Floats) -> Floats:
        """Length by which the chain, laid on the bare track from P1 all round, overruns P1; negative: too short.

        Law: grows by about one link for each link that is added.
        """
        start, _ = self.drive(phase)
        end = self.track.advance(start, self.pitch, self.links)
        return self.track.position(end) - self.track.position(start) - self.track.total

    def least_overrun(self) -> Extreme:
        """Phase and overrun of the state that stretches the chain most."""
        return lowest(self.overrun, 0.0, self.period, self.cells)


def closing_links(track: Track, pitch: float, work: Work | None = None) -> int:
    """The smallest number of links that is not stretched at any phase; ``work`` is asked before each number.

    Law: with one link fewer, some phase misses more than the tolerance.
    """
    work = work or Work()

    def least(links: int) -> float:
        work.go_on()
        return Chain(track, pitch, links).least_overrun().value + STRETCH_TOLERANCE * pitch

    # A link takes at least its pitch of the track, so this many suffice; and on an arc at most pi/2 pitches.
    links = int(np.ceil(track.total / pitch))
    while (room := least(links)) < 0:
        links += 1
    while links > 1:
        spare = max(1, int(room / (pitch * np.pi / 2)))
        below = least(links - spare)
        if below < 0 and spare > 1:
            spare, below = 1, least(links - 1)
        if below < 0:
            break
        links, room = links - spare, below
    return links


def critical_parameter(
    family: Callable[[float], Track],
    pitch: float,
    links: int,
    longest: float,
    shortest: float,
    where: str,
    work: Work | None = None,
) -> float:
    """The parameter of a family of tracks for which the chain just closes: its least overrun is 0.

    The general form of the paper's remark that R2 is maximal at theta1m; no state is assumed to be the critical one.

    ``family``: ``family(parameter) -> Track``; its length must fall from ``longest`` to ``shortest``. ``longest``,
    ``shortest``: parameters of the longest and of the shortest track. ``where``: the family, as `NotClosing` names it.
    ``work``: asked before each parameter.

    Raises `NotClosing`: the number of links is outside those of the family.
    """
    work = work or Work()

    def least(parameter: float) -> float:
        work.go_on()
        return Chain(family(parameter), pitch, links).least_overrun().value

    at_longest, at_shortest = least(longest), least(shortest)
    if at_shortest < 0:
        raise NotClosing(links, closing_links(family(shortest), pitch, work), -at_shortest, where)
    if at_longest > 0:
        most = Chain(family(longest), pitch, links)
        nearest = closing_links(most.track, pitch, work)
        # With `nearest` links the longest track is slack, unless it happens to fit: one fewer closes on another.
        fits = abs(Chain(most.track, pitch, nearest).least_overrun().value) <= STRETCH_TOLERANCE * pitch
        raise NotClosing(links, nearest if fits else nearest - 1, -at_longest, where)
    # the overrun rises with the negative parameter
    rising = secant(lambda x: np.array([least(-x[0])]), -longest, at_longest)
    guess = -longest + (longest - shortest) * at_longest / (at_longest - at_shortest)
    return -float(rising_root(rising, -longest, -shortest, [guess])[0])
