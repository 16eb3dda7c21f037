"""What one would rather have than the least error: the smallest linkage, the best transmission angle or the shortest swing.

Data flow::

    linkages that are near enough -> the best of them by the measure -> the same search within a tighter limit on that measure,
      half way to what is known to be out of reach -> near enough? then the limit is tighter still, otherwise looser -> ...
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from linkage_atlas.motions import Motion
from synthesis.errors import FieldError
from synthesis.fourbar.limits import Limits, Reach
from synthesis.fourbar.passage import size_of
from synthesis.fourbar.solution import Solution
from synthesis.free.poses import Poses
from synthesis.ranking import APART, distinct
from synthesis.target import MIN_SPAN
from synthesis.work import Work

Prefer = Literal["error", "size", "transmission", "crank_span"]
PREFER = get_args(Prefer)

_TRIES = 6
"""Searches at most."""
TRY_ROUNDS = 2
"""Rounds of each where the crank angles are free."""
_SMALLEST = 0.5
"""Extents of the motion below which no linkage is looked for."""
_NEAR_ENOUGH = 1.1
"""Without tolerances: times the least error that a linkage may be off."""
_SHARE = 0.35
"""Part of what is allowed at which a search ends: the largest error of a linkage is some two to three times its mean."""

Search = Callable[[Motion, Limits, float], list[Solution]]


class _Measure(NamedTuple):
    """A measure of which less is better."""

    of: Callable[[Solution], float]
    tightened: Callable[[float], tuple[Motion, Limits]]
    """The request in which it is at most so large."""
    least: float
    """It is never less."""
    near: float
    """Two values of which one is this much larger, as a part or where `least` is not positive outright, are as good."""


def read_prefer(prefer: str | None, motion: Motion, tolerances: bool, searches: bool) -> Prefer:
    """What is preferred, by default the least size where there are tolerances, and otherwise the least error.

    Parameters
    ----------
    prefer : str or None
    motion : Motion
    tolerances : bool
        Whether there are any.
    searches : bool
        Whether linkages are searched for, and not taken from a table or from one that is given.
    """
    positions = motion.samples.position is not None
    if prefer is None:
        return "size" if tolerances and searches and positions else "error"
    for name in PREFER:
        if name != prefer:
            continue
        if name != "error" and not searches:
            raise FieldError("/prefer", "linkages are not searched for here, so that only 'error' has a meaning")
        if name == "size" and not positions:
            raise FieldError("/prefer", "'size' needs `position`: without it no length is actual")
        if name == "crank_span" and not motion.free:
            raise FieldError("/prefer", "the crank angles are given: all linkages turn alike far")
        return name
    raise FieldError("/prefer", f"wanted one of {', '.join(PREFER)}, found {prefer!r}")


def goal_of(allowed: float | None, tolerance: float) -> float:
    """The objective at which a search for linkages that are near enough may end."""
    return tolerance if allowed is None else max(tolerance, _SHARE * allowed)


def improved(
    found: Sequence[Solution],
    motion: Motion,
    limits: Limits,
    prefer: Prefer,
    keeps: Callable[[Solution], bool] | None,
    goal: float,
    top: int,
    search: Search,
    work: Work,
) -> list[Solution]:
    """Linkages that are near enough, the best by a measure first, and the others after them.

    Parameters
    ----------
    found : sequence of Solution
        What a search found, best first.
    motion : Motion
    limits : Limits
    prefer : str
        The measure.
    keeps : callable or None
        Whether a linkage keeps the tolerances; None where there are none: then it is near enough with an error of
        `_NEAR_ENOUGH` times the least.
    goal : float
        The objective at which a search may end.
    top : int
        At most so many.
    search : callable
        ``search(motion, limits, goal)``: the search that found those, for other limits.
    work : Work
    """
    if not found:
        return []
    least = _NEAR_ENOUGH * max(found[0].errors.objective, goal)
    near_enough = keeps or (lambda one: one.errors.objective <= least)
    goal = goal if keeps else least
    measure = _measure(prefer, motion, limits)
    good = [one for one in found if near_enough(one)]
    if not good:
        return list(found[:top])
    best, out_of_reach = min(map(measure.of, good)), measure.least
    for _ in range(_TRIES):
        if work.expired() or _as_good(best, out_of_reach, measure):
            break
        middle = np.sqrt(best * out_of_reach) if measure.least > 0 else (best + out_of_reach) / 2
        try:
            asked = measure.tightened(float(middle))
        except FieldError:  # another limit excludes it
            more = []
        else:
            more = [one for one in search(*asked, goal) if near_enough(one)]
        if more:
            good += more
            best = min(best, *map(measure.of, more))
        else:
            out_of_reach = float(middle)
    ranked = distinct(sorted(good, key=measure.of), top, APART, order=measure.of)
    return (ranked + [one for one in found if not near_enough(one)])[:top]


def _as_good(best: float, other: float, measure: _Measure) -> bool:
    return best <= other * (1 + measure.near) if measure.least > 0 else best - other <= measure.near


def _measure(prefer: Prefer, motion: Motion, limits: Limits) -> _Measure:
    samples = motion.samples

    def size(one: Solution) -> float:
        found = size_of(one.linkage, samples)
        assert found is not None
        return found

    def smaller(extents: float) -> tuple[Motion, Limits]:
        assert samples.position is not None
        far, reach = extents * samples.extent, limits.pivot_reach
        links = [length for length in (limits.link_max, far) if length is not None]
        radii = [length for length in (limits.coupler_radius_max, far) if length is not None]
        places = [
            min(far, place) if reach and (place := getattr(reach, name)) else far for name in ("pivot_a", "pivot_b")
        ]
        middle = complex(samples.position_mean(samples.position))
        return motion, replace(
            limits,
            link_max=min(links),
            coupler_radius_max=min(radii),
            pivot_reach=Reach(middle, places[0], places[1]),
        )

    def straighter(minus: float) -> tuple[Motion, Limits]:
        return motion, replace(limits, transmission_angle_min=-minus)

    def shorter(span: float) -> tuple[Motion, Limits]:
        assert isinstance(samples, Poses)
        return replace(motion, samples=replace(samples, span_max=span)), limits

    def swing(one: Solution) -> float:
        assert one.crank is not None
        return float(np.ptp(one.crank))

    return {
        "size": _Measure(size, smaller, _SMALLEST, 0.03),
        "transmission": _Measure(lambda one: -one.transmission_angle_min, straighter, -np.pi / 2, np.deg2rad(1.0)),
        "crank_span": _Measure(swing, shorter, MIN_SPAN, 0.03),
    }[prefer]
