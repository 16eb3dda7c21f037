"""The one order of linkages: their scores, the ranking key, deduplication, the Pareto front, and the errors of a motion.

`key` is the rule: its criteria are compared one after the other, and smaller is better. The table of the documents is made from
`CRITERIA` and `PREFERENCES`, so that a change of the rule is made here and nowhere else.
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
"""Refined solutions that agree to this belong to one valley of the objective; only its best is worth a user's look."""

_AS_GOOD, _ALIKE = 0.02, 0.25
"""Parts by which objectives, and numbers of order one, of two answers in one valley differ at most."""
NEAR, STANDS_BACK = 0.02, 2.0
"""A linkage out of proportion, and in a search one that strays, counts with twice its error, and with at least 0.02."""
COMFORTABLE_TRANSMISSION = np.deg2rad(40.0)
"""Transmission angle below which the merit rises steeply."""
LONG_SWING = np.deg2rad(120.0)
"""Swing of the crank above which the merit rises steeply: neither a cylinder nor a gas spring acts on it all along."""
PROPORTION = 100.0
"""Ratio of the longest part to the extent of the motion, or to the shortest link, above which nobody builds a linkage."""
FAIR = 30.0
"""The same ratio within which linkages of fair size are searched if the best linkage is out of proportion."""
EVERYDAY_POSITION, EVERYDAY_ROTATION = 1e-3, np.deg2rad(0.1)
"""Everyday accuracy: largest position error over the extent of the motion, and largest rotation error in radians."""
TRADED = 1.1
"""Ratio to the smallest error up to which other merits count if no linkage has the everyday accuracy."""


@dataclass(frozen=True)
class Errors:
    """Errors of a motion at the samples, in its units of angle and length; null for what was not asked."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float
    """sqrt(mean square rotation error in radians + mean square position error / l^2)"""


class Judged(Protocol):
    """Errors of which one number says how large they are."""

    @property
    def objective(self) -> float:
        """What a search makes least."""


class WithErrors(Protocol):
    """Anything that has errors."""

    @property
    def errors(self) -> Judged:
        """Errors of the answer."""


class Answer(WithErrors, Protocol):
    """Linkage with its errors, of any mechanism."""

    @property
    def identity(self) -> Floats:
        """Numbers of order one that tell it from others."""

    @property
    def looks(self) -> Floats:
        """Numbers of which two answers that look alike in a picture differ by less than one."""

    def mirrored(self) -> Any:
        """The answer to the mirrored request."""


A = TypeVar("A", bound=Answer)


class Status(StrEnum):
    """What was found; unknown: nothing, before the search ran to its end."""

    REACHED = "reached"
    CLOSEST = "closest"
    INFEASIBLE = "infeasible"
    UNKNOWN = "unknown"

    @classmethod
    def of(cls, answers: Sequence[WithErrors], tolerance: float) -> Status:
        """Return the status of answers within the limits, best first: reached if the best objective is below the tolerance."""
        if not answers:
            return cls.INFEASIBLE
        return cls.REACHED if answers[0].errors.objective < tolerance else cls.CLOSEST


def motion_errors(target: Target, angle: Floats, points: Complexes | None) -> tuple[list[float | None], list[Errors]]:
    """Best offsets of the rotation, and errors, of linkages.

    ``angle`` (n, N): theta2 at the samples. ``points`` (n, N): the body point at the samples; needed where the target
    has positions.

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
    """Root mean square and largest size of errors (n, N), those of missing samples left out, as n pairs."""
    size = mean.given(np.abs(values))
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
    answers: Sequence[A],
    top: int,
    apart: float = SAME,
    order: Callable[[A], Any] = _objective,
    exact: float = np.inf,
) -> list[A]:
    """The best ``top`` that differ from one another by more than ``apart``, by objective; ties keep their order.

    Where objectives are not ``exact``, an answer about as good as a better one and alike it lies in that one's valley, on its
    way to the same optimum, and is left out. So is one that looks like a better one, unless the rows of a table are wanted as
    they are (``apart`` is `SAME`).
    """
    kept: list[A] = []
    identities, objectives, looks = np.empty((0, 0)), np.empty(0), np.empty((0, 0))
    for answer in sorted(answers, key=order):
        if len(kept) == top:
            break
        mine, objective = answer.identity, answer.errors.objective
        if kept:
            gap = np.max(np.abs(identities - mine) / np.maximum(1.0, np.abs(mine)), axis=1)
            same_valley = (objective >= exact) & (objective <= (1 + _AS_GOOD) * objectives) & (gap <= _ALIKE)
            alike = (apart > SAME) & (np.max(np.abs(looks - answer.looks), axis=1) < 1)
            if np.any((gap <= apart) | same_valley | alike):
                continue
        kept.append(answer)
        looks = np.vstack([looks, answer.looks]) if looks.size else answer.looks[None, :]
        identities = np.vstack([identities, mine]) if identities.size else mine[None, :]
        objectives = np.append(objectives, objective)
    return kept


# -- the order of linkages --------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Score:
    """Measures of one linkage by which it is ranked, in model units."""

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
    accurate: bool = True
    """True if its error is small enough for the preference to count."""
    longest: float = np.inf
    """Largest proportion (size or ratio) up to which a linkage counts with its own error."""
    layers: tuple[bool, int, int] = (False, 0, 0)
    """Whether parts collide, number of fixed pivots under a passing link, number of layers; used if layers were made."""
    has_drive: bool = True
    """False if a drive was requested and none was found."""

    @property
    def merit(self) -> float:
        """See `merit`."""
        swing = self.swing if np.isfinite(self.swing) else 0.0
        columns = np.array([[self.size], [self.transmission], [swing], [self.ratio]])
        return float(merit(*columns)[0])

    @property
    def counted_error(self) -> float:
        """See `counted_error`; to six digits."""
        return float(f"{counted_error(self.error, self.proportion, self.longest):.6g}")

    @property
    def proportion(self) -> float:
        """Longest part over the extent of the motion or the shortest link, whichever is more."""
        return max(self.size, self.ratio)


def counted_error(error: float, proportion: float, longest: float) -> float:
    """Return the error by which a linkage is compared: out of proportion twice its own error, at least 0.02, unless it is 0."""
    return max(NEAR, STANDS_BACK * error) if error > 0 and proportion > longest else error


def merit(size: Floats, transmission: Floats, swing: Floats, ratio: Floats) -> Floats:
    """Rate exact linkages by what one would build: lower is better.

    The merit is the size, raised by four factors: below a transmission angle of 40 degrees steeply, above it gently; for a
    crank that swings by more than about 100 degrees; and for links of very different lengths, since play in the pins of a short
    link turns the body by much.

    Parameters
    ----------
    size : ndarray
        Largest length of the linkage over the motion's extent, see `synthesis.scores.size_of`.
    transmission, swing : ndarray
        Smallest transmission angle over the motion, and the crank's swing, in radians.
    ratio : ndarray
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
"""Criteria of every preference, in their order."""

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
    """Return which rows of measures (n, m), smaller is better, no other row equals everywhere and beats somewhere.

    >>> pareto_front(np.array([[1, 2], [2, 1], [2, 2], [1, 2]])).tolist()
    [True, True, False, True]
    """
    as_good = np.all(measures[:, None] <= measures, axis=2)
    better = np.any(measures[:, None] < measures, axis=2)
    return ~np.any(as_good & better, axis=0)


def spread(answers: Sequence[A], top: int, loss: float, floor: float) -> list[A]:
    """Answers as different from one another as can be, the best of them first, the rest by objective.

    ``answers``: best first. ``top``: at most so many. ``loss``: none has an objective above this many times the best.
    ``floor``: objectives below count as this.
    """
    if not answers:
        return []
    most = loss * max(answers[0].errors.objective, floor)
    allowed = [one for one in answers if one.errors.objective <= most]
    identities = np.array([one.identity for one in allowed])
    chosen, nearest = [0], np.full(len(allowed), np.inf)
    while len(chosen) < min(top, len(allowed)):
        nearest = np.minimum(nearest, np.linalg.norm(identities - identities[chosen[-1]], axis=1))
        nearest[chosen] = -np.inf
        chosen.append(int(nearest.argmax()))
    return [allowed[k] for k in sorted(chosen)]
