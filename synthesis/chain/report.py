"""What a slot is and does: its extremes, the chords it leaves, its curvature, and the wheels' disagreement."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.chain.closure import Extreme, highest, lowest
from synthesis.chain.errors import ChordError, ChordFault
from synthesis.chain.slot import SINGULAR, Slot, polished
from synthesis.chain.track import cross
from synthesis.one_variable import Floats
from synthesis.work import Work

PINS_AT_ONCE = 200_000
"""Pins that are placed at once: bounds the memory, and the time until a client that has left is noticed."""
TIGHTEST = 4
"""Pieces of a slot that are searched closely for its smallest curvature radius."""


class Report(NamedTuple):
    """What a slot is and does; lengths in the track's unit, phases as arc length of P1."""

    slack_min: float
    slack_max: Extreme
    depth_max: Extreme
    end_step: float
    radius_min: float
    """Smallest curvature radius of the pin's path; infinite on a straight path."""
    single_valued: bool
    """Whether the slot's own x runs one way: then y(x) exists."""
    condition: float
    """Largest change of the free pin's place per change of a link's length."""
    clearance: float
    """Smallest distance of the slot from the segments that it does not replace."""
    chord_error: float
    """Largest difference between a chord and the pitch, over all links."""
    free_speed: tuple[float, float]
    """Smallest and largest speed of the free pin per speed of P1."""
    held_chord_error: float
    """Without a slot: by how much each link of a pin held half-way on the bare track is too short."""


def report(slot: Slot, phases: Floats, work: Work | None = None) -> Report:
    """Extremes of a slot over its window; the chords are checked at ``phases``, shape (n,); ``work`` is asked in between."""
    track, cells, work = slot.chain.track, slot.chain.cells, work or Work()
    work.go_on()
    most = highest(slot.slack, slot.start, slot.end, cells)
    slack_max = Extreme(polished(slot, most.phase, -1), most.value)
    grid = np.concatenate([np.linspace(a, b, 33) for a, b in _smooth_pieces(slot)])
    points, velocity, _ = slot.motion(grid)
    known = velocity[np.isfinite(velocity)]
    speed = np.abs(known)
    work.go_on()
    _, direction = slot.frame
    replaced = {segment for segment, _ in slot.base}
    others = [track.distance(index, points).min() for index in range(track.count) if index not in replaced]
    return Report(
        slack_min=lowest(slot.slack, slot.start, slot.end, cells).value,
        slack_max=slack_max,
        depth_max=highest(slot.depth, slot.start, slot.end, cells),
        end_step=float(np.abs(slot.depth(np.array([slot.start, slot.end]))).max()),
        radius_min=smallest_radius(slot),
        single_valued=bool(np.all((known / direction).real < 0)),
        condition=_condition(slot, np.concatenate([[slot.start], grid, [slot.end]])),
        clearance=float(min(others, default=np.inf)),
        chord_error=chord_error(slot, phases, work),
        free_speed=(float(speed.min()), float(speed.max())),
        held_chord_error=_held_chord_error(slot, slack_max.phase, cells),
    )


def _smooth_pieces(slot: Slot) -> list[tuple[float, float]]:
    """Windows between the breaks, just inside them: at a break the curvature has two values."""
    inside = 1e-9 * slot.chain.period
    return [(float(a) + inside, float(b) - inside) for a, b in zip(slot.breaks[:-1], slot.breaks[1:])]


def smallest_radius(slot: Slot) -> float:
    """The smallest curvature radius of the pin's path, an upper limit for a roller's; infinite on a straight path."""

    def radius(phase: Floats) -> Floats:
        bent = np.abs(slot.curvature(phase))
        known = np.isfinite(bent) & (bent > 0)
        return np.where(known, 1 / np.where(known, bent, 1.0), np.inf)

    pieces = _smooth_pieces(slot)
    coarse = radius(np.concatenate([np.linspace(a, b, 33) for a, b in pieces])).reshape(len(pieces), 33).min(axis=1)
    # Only the pieces that may hold the smallest one are searched closely: a track may have hundreds.
    tightest = np.argsort(coarse, kind="stable")[:TIGHTEST]
    return min(lowest(radius, start, end, 32, 3).value for start, end in (pieces[index] for index in tightest))


def chord_error(slot: Slot, phases: Floats, work: Work | None = None) -> float:
    """Largest difference between any of the chain's chords and the pitch, at phases of shape (n,)."""
    worst, few, work = 0.0, max(1, PINS_AT_ONCE // slot.chain.links), work or Work()
    for first in range(0, len(phases), few):
        work.go_on()
        pins = slot.pins(phases[first : first + few])
        worst = max(worst, float(np.abs(np.abs(pins - np.roll(pins, -1, axis=1)) - slot.chain.pitch).max()))
    return worst


def _condition(slot: Slot, phases: Floats) -> float:
    """1/|sin| of the angle between the free pin's links, at its worst; infinite where they are in line."""
    first, last = slot.held(phases)
    point = slot.hung(first, last)
    sine = np.abs(cross(point - first, point - last)).min() / slot.chain.pitch**2
    return float(1 / sine) if sine > SINGULAR else np.inf


def _held_chord_error(slot: Slot, phase: float, cells: int) -> float:
    """By how much the links are too short of a free pin that is held half-way between its neighbours on the track."""
    track = slot.chain.track

    def shortfall(phase: Floats) -> Floats:
        (before, _), (after, _) = slot.neighbours(phase)
        middle = 0.5 * (track.position(before) + (track.position(after) + track.total))
        held = track.points(track.place(middle))
        chords = np.abs([held - track.points(end) for end in (before, after)])
        return np.abs(slot.chain.pitch - chords).max(axis=0)

    return highest(shortfall, slot.start, slot.end, cells, 3).value


def wheel_conflict(slot: Slot, wheel: int) -> Extreme:
    """Largest phase difference, in links, between the driver and another wheel that the chain turns.

    A pin that enters the wheel marks its phase; a pin one link further on marks the same. The value is the range over
    a period, the phase where the wheel is furthest ahead.

    Raises
    ------
    ChordError
        The wheel cannot hold one link.
    """
    chain, track = slot.chain, slot.chain.track
    own = float(track.link_lengths(chain.pitch)[wheel])
    if not own <= track.length[wheel]:
        raise ChordError(ChordFault.NO_POINT, float(track.joints[wheel]))
    first, _ = chain.drive(np.array([slot.start]))
    places = track.advance(first.repeated(chain.links + 1), chain.pitch, np.arange(chain.links + 1))
    onto = track.joints[wheel] + track.total * (track.joints[wheel] < track.position(first)[0])
    # The last pin that is still short of the wheel enters it within the period.
    short = int(np.count_nonzero(track.position(places) < onto)) - 1

    def lead(phase: Floats) -> Floats:
        start, _ = chain.drive(phase)
        entering = track.advance(start, chain.pitch, short)
        entered = track.position(entering) >= onto
        later = track.step(entering, chain.pitch)
        along = np.where(entered, track.position(entering) - onto, track.position(later) - onto - own)
        return along / own - (phase - slot.start) / chain.period

    most = highest(lead, slot.start, slot.end, chain.cells)
    return Extreme(most.phase, most.value - lowest(lead, slot.start, slot.end, chain.cells).value)
