"""Which limits exclude every linkage that was looked for, and how far one of them would have to give way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from itertools import combinations
from typing import Any

import numpy as np

from linkage_atlas.motions import Motion
from synthesis.fourbar.limits import ANGLES, BOXES, LARGEST, Box, Limits
from synthesis.fourbar.solution import Solution
from synthesis.work import Work

_STEPS = 6
"""Halvings of the way that a limit gives."""
_SECONDS = 4.0
"""Longest time that is spent on the reason."""

Search = Callable[[Limits, Work], tuple[list[Solution], Any]]


def what_excludes(limits: Limits, motion: Motion, search: Search, work: Work) -> list[str]:
    """Sentences on the limits, one or two, without which there are linkages; none where that was not found out in time.

    Parameters
    ----------
    limits : Limits
        Within which a search found nothing.
    motion : Motion
    search : callable
        The search that found nothing, for other limits and work of its own.
    work : Work
        What is left of its time may be used.
    """
    watch = work.part(_SECONDS)
    names = _given(limits)
    notes: list[str] = []
    for name in names:
        if watch.expired():
            return notes
        found, _ = search(_without(limits, name), watch)
        if found:
            notes.append(_sentence(limits, name, motion, search, watch))
    for one, other in combinations(names, 2):
        if notes or watch.expired():
            break
        found, _ = search(_without(_without(limits, one), other), watch)
        if found:
            notes.append(f"no linkage was found within {one} and {other} together; without these two there are")
    return notes


def _given(limits: Limits) -> list[str]:
    """The limits that a request gives, the family last."""
    free = Limits()
    names = [one.name for one in fields(Limits) if getattr(limits, one.name) != getattr(free, one.name)]
    return sorted(names, key=lambda name: name == "family")


def _without(limits: Limits, name: str) -> Limits:
    """The limits without one of them; a family gives way to any."""
    return _changed(limits, name, "any" if name == "family" else getattr(Limits(), name))


def _changed(limits: Limits, name: str, value: Any) -> Limits:
    changes: dict[str, Any] = {name: value}
    return replace(limits, **changes)


def _sentence(limits: Limits, name: str, motion: Motion, search: Search, watch: Work) -> str:
    """What a limit would have to be, as near to what it is as was found."""
    extent = 1.0 if motion.samples.position is None else motion.samples.extent
    low, high, best = 0.0, 1.0, None
    for _ in range(_STEPS):
        middle = (low + high) / 2
        eased = _eased(limits, name, middle, extent)
        if eased is None or watch.expired():
            break
        if search(eased, watch)[0]:
            high, best = middle, eased
        elif not watch.expired():
            low = middle
    shown = name if name != "pivot_reach" else "the distance of the pivots"
    if best is None:
        return f"{shown} excludes every linkage that was looked for; without it there are some"
    return f"{shown} excludes every linkage that was looked for; at {_shown(best, name, motion)} there is one"


def _eased(limits: Limits, name: str, part: float, extent: float) -> Limits | None:
    """The limits with one that has given way by a part of all that it can; None where it cannot in degrees."""
    value = getattr(limits, name)
    if name in (*ANGLES, "link_min"):
        return _changed(limits, name, value * (1 - part))
    if name in LARGEST:
        return _changed(limits, name, value / (1 - part))
    if name in BOXES:
        return _changed(limits, name, _grown(value, part / (1 - part) * extent))
    return None


def _grown(box: Box, by: float) -> Box:
    return box[0] - by, box[1] - by, box[2] + by, box[3] + by


def _shown(limits: Limits, name: str, motion: Motion) -> str:
    """A limit's value in the user's unit."""
    value = getattr(limits, name)
    if name in ANGLES:
        return f"{value / motion.radian:.3g} {'degrees' if motion.degrees else 'radians'}"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{number:.4g}' for number in np.array(value))}]"
    return f"{value:.4g}"
