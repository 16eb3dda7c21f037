"""Order of linkages of several kinds: their measures, the Pareto front, and linkages of fair proportions first.

A rail or slot is the limit of a circle, so that without limits a four-bar always has the smallest error; a slider offers a better
transmission angle, a smaller machine or a straight drive. Of linkages with the same drive, all stay that no other linkage beats
in error, size and transmission angle at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from linkage_atlas.answers import proportion_of
from linkage_atlas.mechanism_search import Found
from linkage_atlas.motions import Motion
from synthesis.arrays import Flags
from synthesis.defects import size_of
from synthesis.fourbar import solution as fourbar
from synthesis.fourbar.limits import Limits
from synthesis.free.poses import Poses
from synthesis.free.search import go_astray
from synthesis.guided import solution as guided
from synthesis.guides import Driver, Kind
from synthesis.ranking import APART, FAIR, behind, by_proportion, distinct
from synthesis.target import Samples, Target

_NEAR_ENOUGH = 1.1
"""Without tolerances: ratio to the smallest error up to which another merit decides."""
_NO_ANSWER = 0.1
"""J from which a linkage is dropped if another linkage is much better."""
_MUCH_BETTER = 10.0
"""Ratio of errors that counts as much better."""
_ROUNDING = 1e-6
"""Relative difference of errors of linkages that make the same motion."""
_SAME = 1e-3
"""Relative difference of all measures of two linkages that are shown once."""
_STEP = np.deg2rad(5.0)
"""Exact linkages are ordered by their transmission angle in steps of this size."""

F = TypeVar("F", fourbar.Solution, Found)
LayerRank = tuple[bool, int, int]
"""Merit of layers, smaller is better: whether parts collide, fixed pivots under a passing link, number of layers."""
UNRANKED: LayerRank = (True, 0, 0)
"""Rank without layers, or if the time was up before: behind layers without collisions."""


class Measures(NamedTuple):
    """Measures by which linkages of several kinds are compared; smaller is better."""

    error: float
    """J, at least the tolerance: all linkages below it are exact."""
    size: float
    loss: float
    """Negative transmission angle."""
    driver: str
    layers: LayerRank = (False, 0, 0)
    """Used if layers are preferred."""

    def beats(self, other: Measures) -> bool:
        """Return whether it is as good in everything, better in something, and has the same drive."""
        pairs: list[tuple[Any, Any]] = [*zip(self[:3], other[:3]), (self.layers, other.layers)]
        return self.driver == other.driver and all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)

    def same_as(self, other: Measures) -> bool:
        """Return whether both have practically the same measures."""
        return all(abs(a - b) <= _SAME * max(abs(a), abs(b)) for a, b in zip(self[:3], other[:3]))


def measures_of(solution: Found, samples: Samples, tolerance: float, layers: LayerRank = (False, 0, 0)) -> Measures:
    """Return the measures of a linkage."""
    error = max(solution.errors.objective, tolerance)
    if isinstance(solution, guided.GuidedSolution):
        size, driver = guided.size_of(solution, samples), solution.linkage.driver.value
    else:
        size, driver = size_of(solution.linkage, samples), Driver.CRANK.value
    return Measures(error, np.inf if size is None else size, -solution.transmission_angle_min, driver, layers)


def smaller_first(found: Sequence[F], samples: Samples) -> list[F]:
    """Sort solutions by their errors; among equal errors, as cognates have, the best proportioned solution comes first."""
    ranked, ends = sorted(found, key=lambda solution: solution.errors.objective), 0
    for k, solution in enumerate(ranked):
        if k == ends:  # the first of a group with equal errors
            limit = (1 + _ROUNDING) * solution.errors.objective
            ends = next((j for j in range(k, len(ranked)) if ranked[j].errors.objective > limit), len(ranked))
            ranked[k:ends] = sorted(ranked[k:ends], key=lambda other: proportion_of(other, samples))
    return ranked


def exact_below(samples: Samples, tolerance: float) -> float:
    """Return J below which a linkage is exact: the tolerance, or the rounding error of positions far from the origin."""
    if samples.position is None:
        return tolerance
    return max(tolerance, 2 * float(np.finfo(float).eps * np.abs(samples.position).max() / samples.length_scale))


def proportionate(found: Sequence[F], samples: Samples, tolerance: float, fair: float = FAIR) -> list[F]:
    """Sort solutions in the order in which they are shown, see `by_proportion`."""
    if not found:
        return []
    ranked = smaller_first(found, samples)
    objective = np.array([solution.errors.objective for solution in ranked])
    proportions = np.array([proportion_of(solution, samples) for solution in ranked])
    return [ranked[k] for k in by_proportion(objective, proportions, exact_below(samples, tolerance), fair).tolist()]


def _staying(found: Sequence[Found], samples: Samples, tolerance: float) -> list[Found]:
    """Return the linkages whose body stays between samples; all linkages if none of these has a small error."""
    if not isinstance(samples, Poses) or samples.position is None:
        return list(found)
    strays = strays_between(found, samples)
    groups = behind(np.array([solution.errors.objective for solution in found]), strays, tolerance)
    left_out = strays & np.where(groups == 1, np.any(groups == 0), np.any((groups == 0) | (groups == 2)))
    return [solution for solution, out in zip(found, left_out) if not out]


def strays_between(found: Sequence[Found], poses: Poses) -> Flags:
    """Check for each linkage whether the body leaves the path between samples, (n,)."""
    strays = np.zeros(len(found), dtype=bool)
    four_bars = {k: solution for k, solution in enumerate(found) if isinstance(solution, fourbar.Solution)}
    strays[list(four_bars)] = go_astray(list(four_bars.values()), poses)
    for k, solution in enumerate(found):
        if isinstance(solution, guided.GuidedSolution):
            strays[k] = guided.goes_astray(solution, poses)
    return strays


def front(
    found: Sequence[Found],
    motion: Motion,
    limits: Limits,
    prefer: str,
    tolerance: float,
    top: int,
    ranks: Mapping[int, LayerRank] | None = None,
) -> list[Found]:
    """Return the Pareto front of linkages of several kinds, at most ``top``, in the order of the preference.

    Law: none of them beats another. If there are more, the best of each kind and drive come before further ones. Within
    the practical limits, linkages that stray between samples are dropped if there are others with a small error.

    ``ranks``: for the preference "layers" the rank of the layers by id of a solution; without it no linkage is dropped for being
    beaten.
    """
    samples = motion.samples
    if limits.practical:
        found = _staying(found, samples, tolerance)
    poor = max(_NO_ANSWER, _MUCH_BETTER * min((solution.errors.objective for solution in found), default=0.0))
    unranked, rank_of = prefer == "layers" and ranks is None, ranks or {}
    measured = [
        (measures_of(solution, samples, tolerance, rank_of.get(id(solution), UNRANKED)), solution)
        for solution in found
        if solution.errors.objective <= poor
    ]
    chosen: list[tuple[Measures, Found]] = []
    for measures, solution in measured:
        if (unranked or not any(other.beats(measures) for other, _ in measured)) and not any(
            _group(solution) == _group(before) and measures.same_as(other) for other, before in chosen
        ):
            chosen.append((measures, solution))
    if not chosen:
        return []
    near = near_enough(motion, min(measures.error for measures, _ in chosen))

    def key(pair: tuple[Measures, Found]) -> tuple[Any, ...]:
        measures, solution = pair
        by_error = (measures.error, np.floor(measures.loss / _STEP), measures.size)
        if prefer == "error":
            return False, *by_error
        if not near(solution):
            return True, *by_error
        if prefer == "layers":
            return False, measures.layers, *by_error
        if prefer == "crank_span":
            return False, span_of(solution), *by_error
        return False, measures.size if prefer == "size" else measures.loss, *by_error

    chosen.sort(key=key)
    rank = {id(solution): number for number, (_, solution) in enumerate(chosen)}
    apart: list[Found] = []
    for group in {_group(solution) for _, solution in chosen}:
        alike: list[Any] = [solution for _, solution in chosen if _group(solution) == group]
        apart += distinct(alike, top, APART, order=lambda solution: rank[id(solution)], exact=tolerance)
    apart.sort(key=lambda solution: rank[id(solution)])
    first = {group: solution for solution in reversed(apart) if (group := _group(solution))}
    shown = sorted(first.values(), key=lambda solution: rank[id(solution)])[:top]
    shown += [solution for solution in apart if all(solution is not other for other in shown)][: top - len(shown)]
    return sorted(shown, key=lambda solution: rank[id(solution)])


def target_of(solution: Found, motion: Motion) -> Target:
    """Return the motion over the coordinate of the linkage's own drive."""
    if isinstance(solution, guided.GuidedSolution):
        return guided.as_target(motion.samples, solution.linkage, solution.travel)
    return motion.one_of(motion.with_angles([solution.linkage], [solution.crank]), 0).target


def near_enough(motion: Motion, smallest: float) -> Callable[[Found], bool]:
    """Return a check whether a linkage is inside the tolerances; without tolerances, whether J is near the smallest J."""
    tolerances = motion.tolerances
    if tolerances is None:
        return lambda solution: solution.errors.objective <= _NEAR_ENOUGH * smallest
    return lambda solution: bool(np.all(tolerances.shares(target_of(solution, motion), solution.linkage) <= 1))


def span_of(solution: Found) -> float:
    """Return the swing of a crank or hinge in radians; infinite for other drives."""
    if not isinstance(solution, guided.GuidedSolution):
        assert solution.crank is not None
        return float(np.ptp(solution.crank))
    return float(np.ptp(solution.travel)) if solution.linkage.driver.turns else np.inf


def _group(solution: Found) -> tuple[str, str]:
    """Return the kind and the drive of a linkage."""
    if isinstance(solution, guided.GuidedSolution):
        return solution.linkage.kind.value, solution.linkage.driver.value
    return Kind.FOUR_BAR.value, Driver.CRANK.value
