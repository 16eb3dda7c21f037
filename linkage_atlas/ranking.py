"""The order of the linkages of a task: their scores, and the choice of the linkages that are shown.

The rule is `synthesis.ranking.key`. A rail or slot is the limit of a circle, so that without limits a four-bar
always has the
smallest error; a slider offers a better transmission angle, a smaller machine or a straight drive. Among linkages
of several kinds
with the same drive, only those on the Pareto front of error, size and transmission angle remain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from linkage_atlas.motions import Motion, Tolerances
from synthesis.ranking import (
    APART,
    EVERYDAY_POSITION,
    EVERYDAY_ROTATION,
    PROPORTION,
    TRADE_RATIO,
    Score,
    distinct,
    key,
    pareto_front,
    spread,
)
from synthesis.scores import scores_of
from synthesis.solution import Solution, target_of

_NO_ANSWER = 0.1
"""J from which a linkage is dropped if another linkage is much better."""
_MUCH_BETTER = 10.0
"""Ratio of errors that counts as much better."""
_DIVERSE_LOSS = 2.0
"""Largest ratio of the objective of a diverse linkage to the best objective."""
_SAME = 1e-3
"""Relative difference of all measures of two linkages that are shown once."""
_AS_GOOD = 1.01
"""Ratio of errors that makes no practical difference."""
_ROUNDING = 1e-9
"""Relative excess of an error that counts as within a tolerance."""

LayerRank = tuple[bool, int, int]
"""See `synthesis.ranking.Score.layers`."""
UNRANKED: LayerRank = (True, 0, 0)
"""Rank without layers, or if the time was up before: behind layers without collisions."""


class Ranking:
    """Order of the linkages for a motion and a preference.

    Parameters
    ----------
    motion : Motion
    prefer : str
        One of `synthesis.ranking.PREFERENCES`.
    tolerance : float
        Objective below which a linkage is exact.
    fair : float, optional
        If the linkage with the smallest error is out of proportion, linkages above this proportion count with a
        larger error.
    """

    def __init__(self, motion: Motion, prefer: str, tolerance: float, fair: float | None = None) -> None:
        self.motion, self.prefer, self.tolerance = motion, prefer, tolerance
        self.fair = fair
        self.layers: Mapping[int, LayerRank] = {}
        """Rank of the layers by id of a linkage, if layers are preferred and were made."""
        self._facts: dict[int, tuple[Solution, Score, bool]] = {}
        """Each linkage by id, its score without regard to others, and whether it is within the tolerances of the request, or
        else within the everyday accuracy."""
        self._smallest: Solution | None = None
        """The linkage with the smallest error among all from which the shown linkages were chosen."""

    # -- scores ---------------------------------------------------------------------------------------------------------

    def scores(self, found: Sequence[Solution]) -> list[Score]:
        """Return the score of each linkage; whether it is accurate depends on the others."""
        facts = self._examined(found)
        usable = np.array([score.usable for _, score, _ in facts], dtype=bool)
        within = np.array([inside for *_, inside in facts], dtype=bool)
        accurate = self._accurate(found, usable, within)
        scores = [replace(score, accurate=bool(flag)) for (_, score, _), flag in zip(facts, accurate)]
        if self.fair is not None:
            out = bool(found) and self.smallest_score(found).proportion > PROPORTION
            scores = [replace(score, longest=self.fair if out else PROPORTION) for score in scores]
        if not self.layers:
            return scores
        ranks = [self.layers.get(id(solution), UNRANKED) for solution in found]
        return [replace(score, layers=rank) for score, rank in zip(scores, ranks)]

    def smallest_score(self, found: Sequence[Solution]) -> Score:
        """Return the score of the linkage with the smallest error; of equal errors the smallest proportion decides."""
        scores = (score for _, score, _ in self._examined(found))
        return min(scores, key=lambda score: (float(f"{score.error:.6g}"), score.proportion))

    def usable(self, found: Sequence[Solution]) -> list[bool]:
        """Return which linkages can be used."""
        return [score.usable for _, score, _ in self._examined(found)]

    def accurate(self, found: Sequence[Solution]) -> list[Solution]:
        """Return the linkages that the preference may choose: the usable linkages if there are any."""
        scores = self.scores(found)
        accurate = [(score, solution) for score, solution in zip(scores, found) if score.accurate]
        usable = [solution for score, solution in accurate if score.usable]
        return usable or [solution for _, solution in accurate]

    def _examined(self, found: Sequence[Solution]) -> list[tuple[Solution, Score, bool]]:
        fresh = [solution for solution in found if id(solution) not in self._facts]
        within = [self._within(solution) for solution in fresh]
        tolerated = within if self.motion.tolerances is not None else None
        scores = scores_of(fresh, self.motion.samples, self.tolerance, tolerated)
        for solution, score, inside in zip(fresh, scores, within):
            self._facts[id(solution)] = solution, score, inside
        return [self._facts[id(solution)] for solution in found]

    def _within(self, solution: Solution) -> bool:
        tolerances = self.motion.tolerances
        if tolerances is not None:
            target = target_of(self.motion.samples, solution.linkage, solution.travel)
            return bool(np.all(tolerances.shares(target, solution.linkage) <= 1))
        errors, samples = solution.errors, self.motion.samples
        position = samples.position is None or (errors.position_max or 0.0) <= EVERYDAY_POSITION * samples.extent
        return position and (errors.rotation_max or 0.0) <= EVERYDAY_ROTATION * (1 + _ROUNDING)

    def _accurate(
        self, found: Sequence[Solution], usable: np.ndarray, within: np.ndarray
    ) -> Sequence[bool] | np.ndarray:
        if self.prefer == "error":
            return within if self.motion.tolerances is not None else np.ones(len(found), dtype=bool)
        candidates = usable if usable.any() else ~usable
        if np.any(within & candidates):
            return within
        errors = np.array([solution.errors.objective for solution in found])
        return np.asarray(errors <= TRADE_RATIO * max(errors[candidates].min(initial=np.inf), self.tolerance))

    def merits(self, found: Sequence[Solution], beside: Sequence[Solution]) -> list[tuple[float, Solution]]:
        """Return the accurate linkages with their merits, smallest first; ``beside`` are other known linkages."""
        accurate = {id(solution) for solution in self.accurate([*beside, *found])}
        scored = [(score.merit, solution) for score, solution in zip(self.scores(found), found)]
        return sorted((pair for pair in scored if id(pair[1]) in accurate), key=lambda pair: pair[0])

    # -- order and choice -----------------------------------------------------------------------------------------------

    def ordered(self, found: Sequence[Solution]) -> list[Solution]:
        """Return the linkages, best first."""
        keys = [key(score, self.prefer) for score in self.scores(found)]
        return [found[k] for k in sorted(range(len(found)), key=keys.__getitem__)]

    def chosen(self, found: Sequence[Solution], top: int) -> list[Solution]:
        """Return the best distinct four-bars, at most ``top``; the four-bar with the smallest error is among them."""
        ordered = self.ordered(found)
        chosen = distinct(ordered, top, APART, order=lambda _: 0, exact=self.tolerance)
        return self._with_smallest_error(chosen, found, top)

    def diverse(self, found: Sequence[Solution], top: int, floor: float) -> list[Solution]:
        """Return linkages that are as different as possible, with at most twice the smallest error.

        Linkages that cannot be used are dropped if others can be. ``floor``: smaller errors count as this error.
        """
        if any(usable := self.usable(found)):
            found = [solution for solution, use in zip(found, usable) if use]
        chosen = spread(self.ordered(found), top, _DIVERSE_LOSS, floor)
        return self._with_smallest_error(chosen, found, top)

    def chosen_of_kinds(self, found: Sequence[Solution], top: int) -> list[Solution]:
        """Return the Pareto front of linkages of several kinds, best first, at most ``top``.

        Law: no linkage dominates another linkage with the same drive. If the front is longer than ``top``, the best
        linkage of each kind and
        drive has precedence. Linkages that cannot be used are dropped if others can be.
        """
        if any(usable := self.usable(found)):
            found = [solution for solution, use in zip(found, usable) if use]
        poor = max(_NO_ANSWER, _MUCH_BETTER * min((solution.errors.objective for solution in found), default=0.0))
        front = self._front([solution for solution in found if solution.errors.objective <= poor])
        ordered = self.ordered(front)
        rank = {id(solution): number for number, solution in enumerate(ordered)}
        apart: list[Solution] = []
        for group in dict.fromkeys(map(group_of, ordered)):
            alike = [solution for solution in ordered if group_of(solution) == group]
            apart += distinct(alike, top, APART, order=lambda _: 0, exact=self.tolerance)
        apart.sort(key=lambda solution: rank[id(solution)])
        first = {group_of(solution): solution for solution in reversed(apart)}
        shown = sorted(apart, key=lambda solution: solution is not first[group_of(solution)])[:top]
        return self._with_smallest_error(sorted(shown, key=lambda solution: rank[id(solution)]), found, top)

    def smallest_error(self, found: Sequence[Solution]) -> Solution | None:
        """Return the linkage with the smallest error, or None without linkages.

        Unless the error is preferred, linkages that cannot be used are only considered if no other linkage was found.
        """
        usable = [solution for solution, use in zip(found, self.usable(found)) if use and self.prefer != "error"]
        return min(usable or found, key=lambda solution: solution.errors.objective, default=None)

    def leaders(self, found: Sequence[Solution]) -> list[Solution | None]:
        """Return the linkage with the smallest error among those that stay near the path between samples, and among all."""
        staying = [solution for solution, score, _ in self._examined(found) if not score.strays]
        return [self.smallest_error(staying), self.smallest_error(found)]

    def marked(self, shown: Sequence[Solution]) -> Solution | None:
        """Return the shown linkage with the smallest error; None if a linkage with a clearly smaller error is not shown."""
        best = self.smallest_error(shown)
        return best if best is None or self._smallest is None or self._as_good(best, self._smallest) else None

    def _as_good(self, solution: Solution, smallest: Solution) -> bool:
        """Return whether the errors differ by nothing that matters in practice."""
        return solution.errors.objective <= max(_AS_GOOD * smallest.errors.objective, self.tolerance)

    def _with_smallest_error(self, chosen: list[Solution], found: Sequence[Solution], top: int) -> list[Solution]:
        self._smallest = self.smallest_error(found)
        missing: dict[int, Solution] = {}
        for leader, best in zip(self.leaders(found), self.leaders(chosen)):
            if leader is not None and (best is None or not self._as_good(best, leader)):
                missing[id(leader)] = leader
        if top < 2 or not missing:
            return chosen
        return self.ordered([*chosen[: max(1, top - len(missing))], *missing.values()][:top])

    def _front(self, found: Sequence[Solution]) -> list[Solution]:
        """Return the Pareto front of each drive; of linkages with equal measures only the first."""
        scores = self.scores(found)
        unranked = self.prefer == "layers" and not self.layers
        measures = np.array(
            [
                [max(score.error, self.tolerance), score.size, -score.transmission, *map(float, score.layers)]
                for score in scores
            ]
        )
        stays = np.ones(len(found), dtype=bool)
        drives = np.array([group_of(solution)[1] for solution in found])
        for drive in set(drives.tolist()) if not unranked else ():
            rows = np.flatnonzero(drives == drive)
            stays[rows] = pareto_front(measures[rows])
        front: list[int] = []
        for k in np.flatnonzero(stays).tolist():
            equal = [
                group_of(found[k]) == group_of(found[j])
                and np.allclose(measures[k, :3], measures[j, :3], rtol=_SAME, atol=0.0)
                for j in front
            ]
            if not any(equal):
                front.append(k)
        return [found[k] for k in front]


def everyday_tolerances(motion: Motion) -> Tolerances:
    """Return the everyday accuracy of a motion as tolerances."""
    samples = motion.requested
    rotation = None if samples.rotation is None else np.full(samples.samples, EVERYDAY_ROTATION)
    position = None if samples.position is None else np.full(samples.samples, EVERYDAY_POSITION * samples.extent)
    return Tolerances(rotation, position)


def group_of(solution: Solution) -> tuple[str, str]:
    """Return the kind and the drive of a linkage."""
    return solution.linkage.kind.value, solution.linkage.driver.value
