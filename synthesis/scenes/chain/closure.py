"""Closure of a chain on a track: slack over the phase, and the number of links.

The phase of a chain is the arc length of its first pin P1 along the first segment of the track, which is the driver.
After a link length on the driver the chain is the same with renumbered pins, so this length is the period.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Floats, closer_looks
from synthesis.scenes.chain.track import PinMotion, Track, TrackPosition, no_point_error
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class ExtremeSearchOptions:
    """Options of the search for extremes of a function of the phase."""

    cells: int = 192
    """Number of cells into which a period is divided."""
    max_minima: int = 32
    """Largest number of local minima that are refined."""
    refinements: tuple[int, ...] = (33, 33, 33, 33)
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


def find_minimum(function: Callable[[Floats], Floats], start: float, end: float, tie: float = 0.0) -> Extreme:
    """Find the smallest value of a continuous function of the phase, to rounding accuracy if the function is smooth.

    Parameters
    ----------
    function : callable
        ``function(phase) -> value`` for arrays of shape (n,).
    start, end : float
        Range of the phase.
    tie : float
        Among minima within this difference of the smallest value, the first is returned.
    """
    x = np.linspace(start, end, OPTIONS.cells + 1)
    y = function(x)
    padded = np.pad(y, 1, constant_values=np.inf)
    minima = np.flatnonzero((y <= padded[:-2]) & (y <= padded[2:]))
    # a constant function has a local minimum at every node, so limit their number
    minima = minima[np.argsort(y[minima], kind="stable")][: OPTIONS.max_minima]
    values, phases = closer_looks(
        lambda samples: function(samples.ravel()).reshape(samples.shape),
        x[np.maximum(minima - 1, 0)],
        x[np.minimum(minima + 1, OPTIONS.cells)],
        OPTIONS.refinements,
    )
    tied = values <= values.min() + tie
    first = np.argmin(np.where(tied, phases, np.inf))
    return Extreme(float(phases[first]), float(values[first]))


def find_maximum(function: Callable[[Floats], Floats], start: float, end: float) -> Extreme:
    """Find the largest value of a continuous function of the phase; see `find_minimum`."""
    minimum = find_minimum(lambda x: -function(x), start, end)
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
            raise no_point_error(0.0)

    @property
    def period(self) -> float:
        """Return the arc length of a link on the driver, after which the chain repeats."""
        return float(self.track.link_lengths(self.pitch)[0])

    def drive(self, phase: Floats) -> tuple[TrackPosition, PinMotion]:
        """Return position and motion of P1 at phases of at least 0, shape (n,).

        Beyond the end of the driver the phase continues as if the driver were longer. P1 is then stepped ahead from a
        pin further back in the chain that is still on the driver.
        """
        passed_links = np.maximum(np.ceil((phase - self.track.length[0]) / self.period), 0)
        along = np.maximum(phase - passed_links * self.period, 0.0)
        start = TrackPosition(np.zeros(len(phase), dtype=np.intp), along, np.zeros(len(phase), dtype=np.int64))
        motion = PinMotion(np.ones(len(phase)), np.zeros(len(phase)))
        return self.track.carry(start, motion, self.pitch, passed_links) if passed_links.any() else (start, motion)

    def phase_at(self, position: TrackPosition) -> float:
        """Return the phase for a position of P1 on the driver or up to one period beyond it; the inverse of `drive`."""
        phase = float(self.track.arc_length(position)[0])
        if phase <= self.track.length[0]:
            return phase
        return float(self.track.arc_length(self.track.advance(position, self.pitch, 1, -1))[0]) + self.period

    def overrun(self, phase: Floats) -> Floats:
        """Return the length by which the chain overruns P1 when it is laid on the bare track from P1 round to P1.

        A negative overrun is a missing length. Each additional link increases the overrun by about one link length.
        """
        start, _ = self.drive(phase)
        end = self.track.advance(start, self.pitch, self.links)
        return self.track.arc_length(end) - self.track.arc_length(start) - self.track.total

    def smallest_overrun(self) -> Extreme:
        """Return phase and overrun of the state in which the chain is stretched most."""
        return find_minimum(self.overrun, 0.0, self.period)


def closing_links(track: Track, pitch: float, work: Work = UNLIMITED) -> int:
    """Return the smallest number of links with which the chain is not stretched at any phase."""

    def closes(links: int) -> bool:
        work.go_on()
        return Chain(track, pitch, links).smallest_overrun().value >= -STRETCH_TOLERANCE * pitch

    links = int(track.total / pitch)  # each link covers at least a pitch of the track
    while not closes(links):
        links += 1
    while links > 1 and closes(links - 1):
        links -= 1
    return links


def closure_error(links: int, nearest_links: int, missing: float, where: str) -> FieldError:
    """Return the error for a chain with the wrong number of links for its track.

    Parameters
    ----------
    links, nearest_links : int
        Number of links of the chain, and the nearest number of links with which the chain closes.
    missing : float
        Missing length at the worst phase; negative for an excess length.
    where : str
        End of the sentence: the track or the family of tracks.
    """
    verb, word, length = "does not close", "in excess", {"excess_length": -missing}
    if missing > 0:
        verb, word, length = "would be stretched", "missing", {"missing_length": missing}
    message = f"a chain of {links} links {verb} {where}: {abs(missing):.6g} of length is {word}; {nearest_links} links close"
    return FieldError(
        "/links", message, constraint="closure", amount=abs(missing), nearest_links=nearest_links, **length
    )
