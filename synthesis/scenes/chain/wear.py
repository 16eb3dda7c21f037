"""What becomes of a chain whose pitch is worn or whose track is made within tolerances: slack, stretch, play in the slot.

The track and its slot stay as they were made for the nominal chain; every link of the worn chain has the same pitch.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Floats, rising_root, secant
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, highest, lowest
from synthesis.scenes.chain.crescent import Crescent, given_crescent
from synthesis.scenes.chain.slot import Slot
from synthesis.work import Work

BASE_SAMPLES = 4001
"""Points of the slot between which its depth is interpolated."""
STEP = 1e-5
"""Half step of the central differences of the slack, in pitches."""


class Worn(NamedTuple):
    """A chain of one pitch error on the track and in the slot that were made for the nominal one."""

    pitch_error: float
    slack_min: float
    """Least slack over the phase; negative: length that is missing."""
    slack_max: float
    stretched: bool
    depth_max: float | None
    """How far a taut chain lifts its free pin off the bare track; null: stretched."""
    beyond_slot: float | None
    """How far past the slot that is, at most: the chain is loose by it, or needs a slot that much deeper."""


def worn(slot: Slot, pitch_errors: Floats, work: Work | None = None) -> list[Worn]:
    """The chain with each pitch error, shape (n,), added to every link; the slot's own chain is the nominal one.

    Law: an error of 0 gives the nominal slack, and nothing beyond the slot.
    """
    work = work or Work()
    along, depth = slot.foot(slot.path(np.linspace(slot.start, slot.end, BASE_SAMPLES)))
    order = np.argsort(along)
    along, depth = along[order], depth[order]
    found = []
    for error in pitch_errors.tolist():
        work.go_on()
        other = _with_pitch(slot, slot.chain.pitch + error)
        least, most = _slack_range(other)
        if least < -STRETCH_TOLERANCE * other.chain.pitch:
            found.append(Worn(error, least, most, True, None, None))
            continue

        def beyond(phase: Floats, other: Slot = other) -> Floats:
            at, hung = other.foot(other.path(phase))
            return hung - np.interp(at, along, depth, left=0.0, right=0.0)

        ends, cells = (other.start, other.end), other.chain.cells
        deepest = highest(other.depth, *ends, cells).value
        found.append(Worn(error, least, most, False, deepest, highest(beyond, *ends, cells).value))
    return found


def tightest_pitch_error(slot: Slot, work: Work | None = None) -> float:
    """The pitch error at which the chain just begins to be stretched: what its links may be too short.

    Law: at that error the least slack is 0.
    """
    work, pitch = work or Work(), slot.chain.pitch

    def least(error: float) -> float:
        work.go_on()
        return _slack_range(_with_pitch(slot, pitch + error))[0]

    nominal = least(0.0)
    # every link adds about its own error to the slack, and on arcs more
    reach = -np.sign(nominal) * (abs(nominal) / slot.chain.links + 1e-9 * pitch)
    while nominal * (other := least(float(reach))) > 0:
        reach *= 2
    low, high = sorted((0.0, float(reach)))
    known = (0.0, nominal) if low == 0.0 else (float(reach), other)
    rising = secant(lambda x: np.array([least(float(x[0]))]), *known)
    return float(rising_root(rising, low, high, [0.5 * (low + high)], noise=1e-13 * pitch)[0])


class Corners(NamedTuple):
    """The layouts at all corners of the tolerances."""

    sensitivity: dict[str, float]
    """Change of the least slack per change of each length."""
    slack_min: float
    """The least over all corners; negative: some such layouts stretch the chain."""
    slack_max: float
    slack_min_linear: float
    """The same by the sensitivities alone."""
    corners: int


def made_within(crescent: Crescent, slot: Slot, tolerances: Mapping[str, float], work: Work | None = None) -> Corners:
    """The chain on every corner of the tolerances of ``wheel_radius, upper_radius, lower_radius, eccentricity, pitch``.

    A corner is a layout of its own: the wheels then lie where they touch both arcs.
    """
    work = work or Work()
    nominal = {
        name: getattr(crescent, name) for name in ("wheel_radius", "upper_radius", "lower_radius", "eccentricity")
    }
    nominal["pitch"] = slot.chain.pitch

    def slack(changes: Mapping[str, float]) -> tuple[float, float]:
        work.go_on()
        size = {name: value + changes.get(name, 0.0) for name, value in nominal.items()}
        pitch = size.pop("pitch")
        other = Slot(Chain(given_crescent(**size).track, pitch, slot.chain.links), slot.free, slot.side, slot.start)
        return _slack_range(other)

    step = STEP * slot.chain.pitch
    sensitivity = {name: (slack({name: step})[0] - slack({name: -step})[0]) / (2 * step) for name in nominal}
    varied = {name: tolerance for name, tolerance in tolerances.items() if tolerance > 0}
    corners = [
        slack(dict(zip(varied, (sign * tolerance for sign, tolerance in zip(signs, varied.values())))))
        for signs in itertools.product((-1, 1), repeat=len(varied))
    ]
    least, most = zip(*corners)
    linear = slack({})[0] - sum(abs(sensitivity[name]) * tolerance for name, tolerance in varied.items())
    return Corners(sensitivity, min(least), max(most), linear, len(corners))


def _with_pitch(slot: Slot, pitch: float) -> Slot:
    """The same track, free pin and phase for a chain of another pitch."""
    return Slot(Chain(slot.chain.track, pitch, slot.chain.links), slot.free, slot.side, slot.start)


def _slack_range(slot: Slot) -> tuple[float, float]:
    ends, cells = (slot.start, slot.end), slot.chain.cells
    return lowest(slot.slack, *ends, cells).value, highest(slot.slack, *ends, cells).value
