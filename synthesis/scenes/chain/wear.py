"""Slack, stretch and play of a chain with a worn pitch, or on a track manufactured within tolerances.

Track and slot are manufactured for the nominal chain. All links of a worn chain have the same pitch.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Floats, rising_root, secant
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, find_maximum, find_minimum
from synthesis.scenes.chain.crescent import Crescent, given_crescent
from synthesis.scenes.chain.slot import Slot
from synthesis.work import Work


@dataclass(frozen=True)
class WearOptions:
    """Options of the analysis of wear and tolerances."""

    depth_samples: int = 4001
    """Number of points of the slot between which its depth is interpolated."""
    difference_step: float = 1e-5
    """Step of the central differences of the slack, in pitches."""


OPTIONS = WearOptions()


class WornChain(NamedTuple):
    """A chain with a pitch error on the track and in the slot of the nominal chain."""

    pitch_error: float
    """Pitch minus nominal pitch."""
    slack_min: float
    """Smallest slack over the phase; negative for a missing length."""
    slack_max: float
    """Largest slack over the phase."""
    stretched: bool
    """True if the chain is stretched at some phase."""
    depth_max: float | None
    """Largest distance by which a taut chain lifts its free pin off the bare track; null if the chain is
    stretched."""
    beyond_slot: float | None
    """Largest distance of that free pin beyond the slot, which is the play of the chain; null if the chain is
    stretched."""


def worn_chains(slot: Slot, pitch_errors: Floats, work: Work | None = None) -> list[WornChain]:
    """Analyse chains whose pitch differs from that of the slot's chain.

    Parameters
    ----------
    slot : Slot
        Slot of the nominal chain.
    pitch_errors : ndarray, shape (n,)
        Errors added to the pitch.
    work : Work, optional
        Called before each chain to check whether the result is still wanted.

    Returns
    -------
    list of WornChain
        An error of 0 gives the nominal slack and no distance beyond the slot.
    """
    work = work or Work()
    along, depth = slot.foot(slot.path(np.linspace(slot.start, slot.end, OPTIONS.depth_samples)))
    order = np.argsort(along)
    along, depth = along[order], depth[order]
    results = []
    for error in pitch_errors.tolist():
        work.go_on()
        worn_slot = _with_pitch(slot, slot.chain.pitch + error)
        slack_min, slack_max = _slack_range(worn_slot)
        if slack_min < -STRETCH_TOLERANCE * worn_slot.chain.pitch:
            results.append(WornChain(error, slack_min, slack_max, True, None, None))
            continue

        def beyond(phase: Floats, worn_slot: Slot = worn_slot) -> Floats:
            position, worn_depth = worn_slot.foot(worn_slot.path(phase))
            return worn_depth - np.interp(position, along, depth, left=0.0, right=0.0)

        ends, cells = (worn_slot.start, worn_slot.end), worn_slot.chain.search_cells
        deepest = find_maximum(worn_slot.depth, *ends, cells).value
        results.append(
            WornChain(error, slack_min, slack_max, False, deepest, find_maximum(beyond, *ends, cells).value)
        )
    return results


def tightest_pitch_error(slot: Slot, work: Work | None = None) -> float:
    """Find the pitch error at which the chain just begins to be stretched.

    Parameters
    ----------
    slot : Slot
        Slot of the nominal chain.
    work : Work, optional
        Called before each evaluation to check whether the result is still wanted.

    Returns
    -------
    float
        The smallest slack is 0 at this error.
    """
    work, pitch = work or Work(), slot.chain.pitch

    def smallest_slack(error: float) -> float:
        work.go_on()
        return _slack_range(_with_pitch(slot, pitch + error))[0]

    nominal = smallest_slack(0.0)
    # each link adds at least its pitch error to the slack
    bracket = -np.sign(nominal) * (abs(nominal) / slot.chain.links + 1e-9 * pitch)
    while nominal * (slack_at_bracket := smallest_slack(float(bracket))) > 0:
        bracket *= 2
    low, high = sorted((0.0, float(bracket)))
    known = (0.0, nominal) if low == 0.0 else (float(bracket), slack_at_bracket)
    rising = secant(lambda x: np.array([smallest_slack(float(x[0]))]), *known)
    return float(rising_root(rising, low, high, [0.5 * (low + high)], noise=1e-13 * pitch)[0])


class ToleranceCorners(NamedTuple):
    """Results for the layouts at all corners of the tolerances."""

    sensitivity: dict[str, float]
    """Change of the smallest slack per change of each length."""
    slack_min: float
    """Smallest slack over all corners; if it is negative, some layouts stretch the chain."""
    slack_max: float
    """Largest slack over all corners."""
    slack_min_linear: float
    """Smallest slack over all corners, predicted from the sensitivities."""
    corners: int
    """Number of corners."""


def tolerance_corners(
    crescent: Crescent, slot: Slot, tolerances: Mapping[str, float], work: Work | None = None
) -> ToleranceCorners:
    """Analyse the chain on the layout at each corner of the tolerances.

    In each layout, the wheels lie where they touch both arcs.

    Parameters
    ----------
    crescent : Crescent
        Nominal layout.
    slot : Slot
        Slot of the nominal chain.
    tolerances : mapping of str to float
        Half widths for ``wheel_radius``, ``upper_radius``, ``lower_radius``, ``eccentricity`` and ``pitch``.
    work : Work, optional
        Called before each layout to check whether the result is still wanted.

    Returns
    -------
    ToleranceCorners
    """
    work = work or Work()
    nominal = {
        name: getattr(crescent, name) for name in ("wheel_radius", "upper_radius", "lower_radius", "eccentricity")
    }
    nominal["pitch"] = slot.chain.pitch

    def slack(changes: Mapping[str, float]) -> tuple[float, float]:
        work.go_on()
        lengths = {name: value + changes.get(name, 0.0) for name, value in nominal.items()}
        pitch = lengths.pop("pitch")
        varied_slot = Slot(
            Chain(given_crescent(**lengths).track, pitch, slot.chain.links), slot.free, slot.side, slot.start
        )
        return _slack_range(varied_slot)

    step = OPTIONS.difference_step * slot.chain.pitch
    sensitivity = {name: (slack({name: step})[0] - slack({name: -step})[0]) / (2 * step) for name in nominal}
    toleranced = {name: tolerance for name, tolerance in tolerances.items() if tolerance > 0}
    corners = [
        slack(dict(zip(toleranced, (sign * tolerance for sign, tolerance in zip(signs, toleranced.values())))))
        for signs in itertools.product((-1, 1), repeat=len(toleranced))
    ]
    smallest_slacks, largest_slacks = zip(*corners)
    linear = slack({})[0] - sum(abs(sensitivity[name]) * tolerance for name, tolerance in toleranced.items())
    return ToleranceCorners(sensitivity, min(smallest_slacks), max(largest_slacks), linear, len(corners))


def _with_pitch(slot: Slot, pitch: float) -> Slot:
    """Return the slot with the same track, free pin and phase for a chain of another pitch."""
    return Slot(Chain(slot.chain.track, pitch, slot.chain.links), slot.free, slot.side, slot.start)


def _slack_range(slot: Slot) -> tuple[float, float]:
    """Return the smallest and the largest slack over the window."""
    ends, cells = (slot.start, slot.end), slot.chain.search_cells
    return find_minimum(slot.slack, *ends, cells).value, find_maximum(slot.slack, *ends, cells).value
