"""What makes an answer good: the errors of its motion, whether they are small enough, and whether two answers differ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol, TypeVar

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
"""An answer is near if its objective is at most the first, a fiftieth of the motion's extent, or so many times the best."""
COMFORTABLE_TRANSMISSION = np.deg2rad(40.0)
"""Transmission angle above which a larger one matters little."""
PROPORTION, FAIR = 100.0, 30.0
"""Extents of the motion, or shortest links, that the longest part is: above the first nobody builds it, within the second it is
of fair size."""


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


class Answer(Protocol):
    """A linkage with its errors, as any mechanism gives it."""

    @property
    def errors(self) -> Judged:
        """Its errors."""

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
    def of(cls, answers: Sequence[Answer], tolerance: float) -> Status:
        """The status of answers within the limits, best first: reached where the best objective is below the tolerance."""
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


def merit(size: Floats, transmission: Floats, swing: Floats, ratio: Floats) -> Floats:
    """Rate exact linkages by what one would build: lower is better.

    The merit is the size, raised by four factors: below a transmission angle of 40 degrees steeply, above it slightly; for a
    crank that swings by more than half a turn; and for links of very different lengths, since play in the pins of a short link
    turns the body by much.

    Parameters
    ----------
    size : ndarray
        Largest length of the linkage over the motion's extent, see `synthesis.defects.size_of`.
    transmission, swing : ndarray
        Smallest transmission angle over the motion, and the crank's swing, in radians.
    ratio : ndarray
        Longest link over the shortest.

    Returns
    -------
    ndarray
        size * (1 + 4 max(0, 1 - sin t / sin 40)) * (1.5 - sin t / 2) * sqrt(max(1, swing / 180)) * (1 + max(0, ratio - 4) / 8),
        with the transmission angle t.
    """
    sine = np.sin(transmission)
    below = 1 + 4 * np.maximum(0.0, 1 - sine / np.sin(COMFORTABLE_TRANSMISSION))
    turned = np.sqrt(np.maximum(1.0, swing / np.pi))
    return np.asarray(size * below * (1.5 - sine / 2) * turned * (1 + np.maximum(0.0, ratio - 4) / 8))


def rms_and_max(values: NDArray[Any], mean: Mean) -> list[Any]:
    """Root mean square and largest size of errors (n, N), those of missing samples left out, as n pairs."""
    size = mean.given(np.abs(values))
    largest = size.max(axis=-1)
    # squares of ratios: no under- or overflow at any unit of length
    rms = largest * np.sqrt(mean((size / np.where(largest > 0, largest, 1.0)[..., None]) ** 2))
    return list(zip(rms.tolist(), largest.tolist()))


def _objective(answer: Answer) -> Any:
    return answer.errors.objective


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


def behind(objective: Floats, strays: NDArray[np.bool_], tolerance: float) -> NDArray[np.intp]:
    """Groups of answers (n,) that are ranked one behind the other, each by objective.

    0: exact ones, 1: exact ones that stray between samples, 2: others that are near and do not stray, 3: the rest. A curve that
    meets its samples closely by going far away between them is not what anybody draws; but where all that stay are
    far off, it is the better answer.

    >>> behind(np.array([1e-12, 1e-12, 1e-3, 4e-3, 0.3]), np.array([True, False, True, False, False]), 1e-10)
    array([1, 0, 3, 2, 3])
    """
    exact = objective < tolerance
    best = np.min(objective, initial=np.inf, where=~exact)
    near = ~strays & (objective <= max(NEAR, STANDS_BACK * best))
    return np.where(exact, strays.astype(int), np.where(near, 2, 3))


def by_proportion(
    objective: Floats, times: Floats, exact: float, fair: float = FAIR, back: float = STANDS_BACK
) -> NDArray[np.intp]:
    """Places of answers (n,), the best of which is the first, in the order in which they are shown.

    Law: an exact one stays first, and the best is among the first two. Where it is neither exact nor in proportion, those of
    fair size that are near come before it. Behind them come others in proportion; beside any that are, no other than the best
    that is not.

    >>> by_proportion(np.array([1e-4, 2e-4, 3e-4, 4e-4, 0.3]), np.array([1e9, 1e8, 1e5, 20, 9]), 1e-10)
    array([3, 0, 4])
    """
    out = times > PROPORTION
    first = (times <= fair) & (objective <= max(NEAR, back * objective[0])) & out[0] & (objective[0] >= exact)
    groups = np.where(objective < exact, 0, np.where(first, 2, 3))
    groups[0] = first.any()
    groups[first & (np.cumsum(first) == 1)] = 0
    shown = ~out | out.all()
    shown[0] = True
    order = np.argsort(groups, kind="stable")
    return order[shown[order]]


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
