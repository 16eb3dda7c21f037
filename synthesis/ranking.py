"""Errors of linkages, and their order: scores, the sort key, deduplication and the Pareto front.

`key` is the rule of the order: it compares the criteria in turn, and smaller values come first.
The table in the documents is generated from `CRITERIA` and `PREFERENCES`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.pose import rotation_residual
from synthesis.target import Mean, Target

SAME = 1e-6
"""Linkages whose numbers agree to this, relative to their size, are the same linkage."""
APART = 1e-2
"""Refined solutions that agree to this belong to the same basin of the objective; only the best of them is shown."""

_AS_GOOD, _SIMILAR = 0.02, 0.25
"""Relative differences of the objectives and of the identities up to which two solutions belong to the same basin."""
NEAR, PENALTY_FACTOR = 0.02, 2.0
"""A linkage out of proportion, or a candidate that strays in a search, is compared with twice its error and at least
0.02.
"""
COMFORTABLE_TRANSMISSION = np.deg2rad(40.0)
"""Transmission angle below which the merit rises steeply."""
LONG_SWING = np.deg2rad(120.0)
"""Swing of the crank above which the merit rises steeply: no cylinder and no gas spring can act on a longer swing."""
PROPORTION = 100.0
"""Largest practical ratio of the longest part to the extent of the motion, or to the shortest link."""
FAIR_PROPORTION = 30.0
"""Largest such ratio of the linkages that are searched in addition if the best linkage is out of proportion."""
EVERYDAY_POSITION, EVERYDAY_ROTATION = 1e-3, np.deg2rad(0.1)
"""Everyday accuracy: largest position error over the extent of the motion, and largest rotation error in radians."""
TRADE_RATIO = 1.1
"""Ratio to the smallest error up to which other merits count if no linkage has the everyday accuracy."""


@dataclass(frozen=True)
class Errors:
    """Errors of a motion at the samples in its units; null if the motion does not prescribe the quantity."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float
    """sqrt(mean square rotation error in radians + mean square position error / l^2)"""


class HasObjective(Protocol):
    """Errors with a single measure of their size."""

    @property
    def objective(self) -> float:
        """The number that a search minimizes."""


class Answer(Protocol):
    """Linkage with its errors, of any mechanism."""

    @property
    def errors(self) -> HasObjective:
        """Errors of the linkage."""

    @property
    def identity(self) -> Floats:
        """Numbers of order 1 that identify the linkage."""

    @property
    def looks(self) -> Floats:
        """Numbers that differ by less than 1 for linkages whose pictures look the same."""

    def mirrored(self) -> Any:
        """Return the linkage for the mirrored request."""


A = TypeVar("A", bound=Answer)


class Status(StrEnum):
    """Outcome of a search; `UNKNOWN` if it was stopped before it found a linkage."""

    REACHED = "reached"
    CLOSEST = "closest"
    INFEASIBLE = "infeasible"
    UNKNOWN = "unknown"

    @classmethod
    def of(cls, answers: Sequence[Answer], tolerance: float) -> Status:
        """Return the status of answers within the limits, best first: reached if the best objective is below the tolerance."""
        if not answers:
            return cls.INFEASIBLE
        return cls.REACHED if answers[0].errors.objective < tolerance else cls.CLOSEST


def motion_errors(target: Target, angle: Floats, points: Complexes | None) -> tuple[list[float | None], list[Errors]]:
    """Compute the best offsets of the rotation and the errors of linkages.

    Parameters
    ----------
    target : Target
        The motion.
    angle : ndarray, shape (n, N)
        theta2 at the samples, in radians.
    points : ndarray, shape (n, N), or None
        The body point at the samples; required if the target has positions.

    Returns
    -------
    offsets : list
        Added to theta2 to give the requested rotation; None without rotation.
    errors : list of Errors
    """
    count = len(angle)
    square = np.zeros(count)
    offsets: list[float | None] = [None] * count
    rotation: list[Any] = [(None, None)] * count
    position = rotation
    if target.rotation is not None:
        offset, residual = rotation_residual(target, angle)
        offsets, rotation = offset.tolist(), rms_and_max(residual, target.rotation_mean)
        square = square + np.array([rms for rms, _ in rotation]) ** 2
    if target.position is not None:
        assert points is not None
        position = rms_and_max(target.position - points, target.position_mean)
        square = square + (np.array([rms for rms, _ in position]) / target.length_scale) ** 2
    errors = [Errors(r[0], r[1], p[0], p[1], float(s)) for r, p, s in zip(rotation, position, np.sqrt(square))]
    return offsets, errors


def rms_and_max(values: NDArray[Any], mean: Mean) -> list[Any]:
    """Return the root mean square and the maximum of errors (n, N) as n pairs, without missing samples."""
    size = mean.zero_missing(np.abs(values))
    largest = size.max(axis=-1)
    # squares of ratios: no under- or overflow at any unit of length
    rms = largest * np.sqrt(mean((size / np.where(largest > 0, largest, 1.0)[..., None]) ** 2))
    return list(zip(rms.tolist(), largest.tolist()))


def _objective(answer: Answer) -> Any:
    return answer.errors.objective


def distinct_rows(numbers: Floats, apart: float, maximum: int) -> NDArray[np.intp]:
    """Return the indices of the first rows (n, k) that differ from all before them by more than ``apart`` in some column."""
    chosen = list[int]()
    for index, row in enumerate(numbers):
        if len(chosen) == maximum:
            break
        if np.all(np.max(np.abs(numbers[chosen] - row), axis=1, initial=0.0) > apart):
            chosen.append(index)
    return np.array(chosen, dtype=np.intp)


def distinct(
    answers: Sequence[A], top: int, apart: float = SAME, order: Callable[[A], Any] = _objective, exact: float = np.inf
) -> list[A]:
    """Return the best linkages by objective that differ from each other; equal objectives preserve the order.

    Parameters
    ----------
    answers : sequence
        The linkages.
    top : int
        Maximum number of linkages.
    apart : float
        Relative difference of the identities up to which two linkages are the same. With `SAME` the rows of a table
        are returned
        as they are; with a larger value a linkage whose picture looks like a better linkage is dropped too.
    order : callable
        Sort key; by default the objective.
    exact : float
        Objective below which a linkage is exact. Above it, a linkage that is similar to a better linkage and about as
        good belongs to the same basin and is dropped.
    """
    chosen: list[A] = []
    identities, objectives, appearances = np.empty((0, 0)), np.empty(0), np.empty((0, 0))
    for answer in sorted(answers, key=order):
        if len(chosen) == top:
            break
        identity, looks, objective = answer.identity, answer.looks, answer.errors.objective
        if chosen:
            gap = np.max(np.abs(identities - identity) / np.maximum(1.0, np.abs(identity)), axis=1)
            same_basin = (objective >= exact) & (objective <= (1 + _AS_GOOD) * objectives) & (gap <= _SIMILAR)
            alike = (apart > SAME) & (np.max(np.abs(appearances - looks), axis=1) < 1)
            if np.any((gap <= apart) | same_basin | alike):
                continue
        chosen.append(answer)
        appearances = np.vstack([appearances, looks]) if appearances.size else looks[None, :]
        identities = np.vstack([identities, identity]) if identities.size else identity[None, :]
        objectives = np.append(objectives, objective)
    return chosen


# -- the order of linkages --------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Score:
    """Measures by which a linkage is ranked, in model units."""

    usable: bool
    """True if it passes the samples without a defect, each at its own position of the drive, and stays near them in between."""
    error: float
    """The objective; 0 if the linkage is exact."""
    size: float
    """Largest length over the extent of the motion; without positions the ratio of the links."""
    transmission: float
    """Smallest transmission angle in radians."""
    swing: float
    """Swing of the crank or hinge in radians; infinite for a drive that slides."""
    ratio: float
    """Longest link over the shortest."""
    strays: bool = False
    """True if it leaves the path between samples, or the body turns otherwise; it cannot be used then."""
    accurate: bool = True
    """True if its error is small enough for the preference to count."""
    longest: float = np.inf
    """Largest proportion (size or ratio) up to which a linkage counts with its own error."""
    layers: tuple[bool, int, int] = (False, 0, 0)
    """Collision of parts, number of fixed pivots under a passing link, and the number of layers, if layers were
    assigned.
    """
    has_drive: bool = True
    """False if a drive was requested and none was found."""

    @property
    def merit(self) -> float:
        """See `merit`."""
        swing = self.swing if np.isfinite(self.swing) else 0.0
        return float(merit(self.size, self.transmission, swing, self.ratio))

    @property
    def counted_error(self) -> float:
        """See `counted_error`; rounded to six digits."""
        return float(f"{counted_error(self.error, self.proportion, self.longest):.6g}")

    @property
    def proportion(self) -> float:
        """Longest part over the extent of the motion or over the shortest link, whichever is larger."""
        return max(self.size, self.ratio)


def counted_error(error: float, proportion: float, longest: float) -> float:
    """Return the error by which a linkage is compared: doubled, and at least 0.02, if it is out of proportion and not exact."""
    return max(NEAR, PENALTY_FACTOR * error) if error > 0 and proportion > longest else error


def merit(size: Floats | float, transmission: Floats | float, swing: Floats | float, ratio: Floats | float) -> Floats:
    """Rate exact linkages by their practicality; lower is better.

    The merit is the size, increased by four factors: a steep one below a transmission angle of 40 degrees and a
    gentle one above it; a factor for a crank that swings by more than about 100 degrees; and a factor for links of
    very different lengths, because play in the pins of a short link turns the body considerably.

    Parameters
    ----------
    size : ndarray or float
        Largest length of the linkage over the extent of the motion, see `synthesis.scores.size_of`.
    transmission, swing : ndarray or float
        Smallest transmission angle over the motion, and the swing of the crank, in radians.
    ratio : ndarray or float
        Longest link over the shortest.

    Returns
    -------
    ndarray
        size * (1 + 4 max(0, 1 - sin t / sin 40)) * (2.5 - 1.5 sin t) * sqrt(1 + (swing / 120)^4)
        * (1 + max(0, ratio - 4) / 8), with the transmission angle t.
    """
    sine = np.sin(transmission)
    below = 1 + 4 * np.maximum(0.0, 1 - sine / np.sin(COMFORTABLE_TRANSMISSION))
    turned = np.sqrt(1 + (swing / LONG_SWING) ** 4)
    return np.asarray(size * below * (2.5 - 1.5 * sine) * turned * (1 + np.maximum(0.0, ratio - 4) / 8))


class Criterion(NamedTuple):
    """A comparison of the ranking; smaller values come first."""

    rule: str
    """Sentence of the documents."""
    value: Callable[[Score], Any]


CRITERIA = {
    "usable": Criterion(
        "A linkage that cannot be used comes last: it has a defect of order, branch or circuit, passes two different samples at "
        "one position of its drive, comes near a change point, or leaves the path between samples.",
        lambda score: not score.usable,
    ),
    "accurate": Criterion(
        "A linkage within the tolerances precedes one outside. Without tolerances and with another preference than `error`, the "
        "everyday accuracy takes their place: 0.1 % of the extent of the motion and 0.1 degrees; if no linkage reaches it, an "
        "error up to a tenth above the smallest.",
        lambda score: not score.accurate,
    ),
    "assembled": Criterion(
        "If layers were requested, a linkage without collisions comes first.", lambda score: score.layers[0]
    ),
    "has_drive": Criterion(
        "If a drive was requested, a linkage with a drive comes first.", lambda score: not score.has_drive
    ),
}
"""Criteria that all preferences share, in their order."""

PREFERENCES = {
    "error": Criterion("The smallest error; exact linkages by their merit.", lambda score: score.counted_error),
    "balanced": Criterion("The smallest merit.", lambda score: score.merit),
    "size": Criterion("The smallest size.", lambda score: score.size),
    "transmission": Criterion("The largest transmission angle.", lambda score: -score.transmission),
    "crank_span": Criterion("The shortest swing of the drive.", lambda score: score.swing),
    "layers": Criterion(
        "The fewest pivots under a passing link, then the fewest layers.", lambda score: score.layers[1:]
    ),
}
"""The last criterion, by the name of the preference; linkages that are not accurate are compared by their error."""


def key(score: Score, prefer: str) -> tuple[Any, ...]:
    """Return the sort key of a linkage: the criteria, the preference, and for equal linkages the error and the merit."""
    first = tuple(criterion.value(score) for criterion in CRITERIA.values())
    measure = PREFERENCES[prefer].value(score) if score.accurate else score.counted_error
    return *first, measure, score.counted_error, score.merit


def pareto_front(measures: Floats) -> NDArray[np.bool_]:
    """Return the mask of the rows of measures (n, m) on the Pareto front; smaller measures are better.

    A row is on the front if no other row is at least as good in every measure and better in some measure.

    >>> pareto_front(np.array([[1, 2], [2, 1], [2, 2], [1, 2]])).tolist()
    [True, True, False, True]
    """
    as_good = np.all(measures[:, None] <= measures, axis=2)
    better = np.any(measures[:, None] < measures, axis=2)
    return ~np.any(as_good & better, axis=0)


def spread(answers: Sequence[A], top: int, loss: float, floor: float) -> list[A]:
    """Return linkages that are as different as possible, including the best, sorted by objective.

    Parameters
    ----------
    answers : sequence
        Linkages, best first.
    top : int
        Maximum number of linkages.
    loss : float
        Largest ratio of an objective to the best objective.
    floor : float
        Smaller objectives count as this value.
    """
    if not answers:
        return []
    worst = loss * max(answers[0].errors.objective, floor)
    allowed = [answer for answer in answers if answer.errors.objective <= worst]
    identities = np.array([answer.identity for answer in allowed])
    chosen, nearest = [0], np.full(len(allowed), np.inf)
    while len(chosen) < min(top, len(allowed)):
        nearest = np.minimum(nearest, np.linalg.norm(identities - identities[chosen[-1]], axis=1))
        nearest[chosen] = -np.inf
        chosen.append(int(nearest.argmax()))
    return [allowed[k] for k in sorted(chosen)]
