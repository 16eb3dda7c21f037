"""What comes back from `synthesize` and `match`: solutions, matches and reports, in the user's unit of angle.

Names of attributes are those of the HTTP contract, and ``to_dict`` gives what goes over HTTP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from linkage_atlas.linkages import FourBar
from linkage_atlas.studies import Analysis, ToleranceStudy
from synthesis.fourbar.determination import Determination, Sensitivity
from synthesis.ranking import Errors

Floats = NDArray[np.float64]
One = TypeVar("One")

FINISHING = 0.1
"""Part of its budget that an answer may take beyond it, to finish what the search has found."""


@dataclass(frozen=True)
class AtlasType:
    """A dimension type: its number in the atlas, from 1, and its lengths crank, coupler, rocker, ground."""

    number: int
    lengths: list[int]


@dataclass(frozen=True)
class Rounded:
    """A linkage whose links lie on a grid or are of stock lengths, the rest fitted anew within the limits.

    ``tried`` combinations of lengths were fitted, of so many ``combinations`` (None for a grid); ``exhaustive`` says whether the
    choice is the best of all of them (None for a grid).
    """

    linkage: FourBar
    errors: Errors
    transmission_angle_min: float
    tried: int
    combinations: int | None
    exhaustive: bool | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        linkage = self.linkage.to_dict()
        del linkage["branch"]
        return {
            "closes": True,
            **linkage,
            "errors": asdict(self.errors),
            "transmission_angle_min": self.transmission_angle_min,
            **{name: getattr(self, name) for name in ("tried", "combinations", "exhaustive")},
        }


@dataclass(frozen=True)
class NotRounded:
    """That no combination of lengths was found that closes within the limits; attributes as of `Rounded`."""

    tried: int
    combinations: int | None
    exhaustive: bool | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        absent = ("links", "start_angle", "body_offset", "mount", "errors", "transmission_angle_min")
        return {"closes": False, **dict.fromkeys(absent), **asdict(self)}


@dataclass(frozen=True)
class Verdict:
    """Whether a linkage does as a machine what it does at the samples.

    Attributes
    ----------
    order : bool
        A crank that turns one way passes the samples in the order asked for.
    branch : bool
        All samples lie on one branch.
    circuit : bool
        All samples, and all between, lie on one circuit: nothing must be taken apart.
    within_tolerance : bool or None
        Every sample keeps the tolerances; None where there are none.
    practical : bool
        No practical limit is broken, or what the request sets in its place.
    reasons : tuple of str
        A sentence for everything that is amiss; samples count from 1.
    """

    order: bool
    branch: bool
    circuit: bool
    within_tolerance: bool | None
    practical: bool
    reasons: tuple[str, ...]

    @property
    def buildable(self) -> bool:
        """The same as ``practical``: whether links collide is not checked."""
        return self.practical

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        return asdict(self) | {"buildable": self.buildable, "reasons": list(self.reasons)}

    @property
    def works(self) -> bool:
        """Whether the crank drives the linkage through the samples."""
        return self.order and self.branch and self.circuit


@dataclass(frozen=True)
class Solution:
    """A linkage that answers a request, and how well.

    Attributes
    ----------
    rank : int
        From 1, by ``errors.objective``.
    linkage : FourBar
    errors : Errors
        At the samples: rotation_rms, rotation_max, position_rms, position_max (None for what was not asked for) and the
        objective, in radians.
    family : str
    transmission_angle_min : float
        Over the used interval, exactly.
    transmission_angle_min_turn : float or None
        Over the whole turn; None where the crank cannot turn fully.
    condition : float
        Condition number of the motion's derivatives by all unknowns.
    determination : Determination
        How well the motion fixes each length.
    type : AtlasType or None
        The atlas row that it is, if it is one.
    sensitivity : Sensitivity or None
        Change of the motion per unit of each length, if asked for.
    rounded : Rounded, NotRounded or None
        With links on a grid or of stock lengths, if asked for; crank angles that were found are held.
    verdict : Verdict
    crank_angle : ndarray, shape (N,), or None
        Crank angles at the samples from the first one, where they were free.
    excursion : float or None
        With free crank angles: the largest way of the body point between two neighbouring samples over their distance.
    size : float or None
        Largest of the links, the coupler point's radius and the distances of the fixed pivots from the motion's middle, over
        the motion's extent; None without positions.
    analysis : Analysis or None
        Velocities, accelerations and forces, if asked for.
    tolerance_study : ToleranceStudy or None
        What tolerances of manufacture do, if asked for.
    """

    rank: int
    linkage: FourBar
    errors: Errors
    family: str
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    condition: float
    determination: Determination
    type: AtlasType | None
    sensitivity: Sensitivity | None
    rounded: Rounded | NotRounded | None
    verdict: Verdict
    crank_angle: Floats | None = None
    excursion: float | None = None
    size: float | None = None
    analysis: Analysis | None = field(default=None, repr=False)
    tolerance_study: ToleranceStudy | None = field(default=None, repr=False)

    @property
    def source(self) -> str:
        """``atlas`` for a row as it is, ``refined`` for the search's."""
        return "refined" if self.type is None else "atlas"

    def errors_in_words(self) -> str:
        """The largest errors at the samples, rotation in the linkage's unit of angle, position in the unit of the positions."""
        largest = {"rotation": self.errors.rotation_max, "position": self.errors.position_max}
        unit = {"rotation": " deg" if self.linkage.degrees else " rad", "position": ""}
        return ", ".join(
            f"{name} within {value:.3g}{unit[name]}" for name, value in largest.items() if value is not None
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        parts = ("rounded", "analysis", "tolerance_study")
        more = {name: None if getattr(self, name) is None else getattr(self, name).to_dict() for name in parts}
        return {
            "rank": self.rank,
            "source": self.source,
            "type": None if self.type is None else asdict(self.type),
            **self.linkage.to_dict(),
            "crank_angle": listed(self.crank_angle),
            "errors": asdict(self.errors),
            "verdict": self.verdict.to_dict(),
            "excursion": self.excursion,
            "size": self.size,
            "family": self.family,
            "transmission_angle_min": self.transmission_angle_min,
            "transmission_angle_min_turn": self.transmission_angle_min_turn,
            "condition": self.condition,
            "determination": {
                "ill_posed": self.determination.ill_posed,
                "resolution": self.determination.resolution,
                "at_limits": list(self.determination.at_limits),
                "length_uncertainty": [
                    value if np.isfinite(value) else None for value in self.determination.length_uncertainty.tolist()
                ],
            },
            "sensitivity": None
            if self.sensitivity is None
            else {name: listed(getattr(self.sensitivity, name)) for name in ("rotation", "position")},
            **more,
        }


def listed(values: Floats | None) -> list[float] | None:
    """An array as plain numbers."""
    return None if values is None else values.tolist()


@dataclass(frozen=True)
class Report:
    """How an answer came about.

    Attributes
    ----------
    elapsed_ms : dict
        Milliseconds of each stage and in total.
    trace : list of tuple
        (milliseconds, best objective) after each round: the error against run time of this very request.
    stopped_by : str
        tolerance, converged or budget.
    length_scale : float or None
        What position errors were divided by.
    seeds : int or None
        Starting points refined; None for effort "atlas".
    windows : int or None
        Atlas windows that the answer is the best of; None for effort "refine".
    exhaustive : bool or None
        Whether all of them were considered.
    notes : list of str
    """

    elapsed_ms: dict[str, float]
    trace: list[tuple[float, float]]
    stopped_by: str
    length_scale: float | None
    seeds: int | None
    windows: int | None
    exhaustive: bool | None
    notes: list[str]


class Ranked(Sequence[One]):
    """What can be indexed, counted and iterated as the list of its answers, best first; false where there are none."""

    @property
    def _answers(self) -> list[One]:
        raise NotImplementedError

    @overload
    def __getitem__(self, place: int) -> One: ...

    @overload
    def __getitem__(self, place: slice) -> list[One]: ...

    def __getitem__(self, place: int | slice) -> One | list[One]:
        return self._answers[place]

    def __len__(self) -> int:
        return len(self._answers)


@dataclass(frozen=True)
class Result(Ranked[Solution]):
    """The answer to `linkage_atlas.synthesize`: solutions, best first, and a report.

    ``result[0]``, ``len(result)`` and ``for solution in result`` are those of ``solutions``; a result without any is false.

    ``status`` is "reached" (the best objective is below the tolerance), "closest" or "infeasible" (none within the limits).
    """

    status: str
    solutions: list[Solution]
    report: Report

    @property
    def _answers(self) -> list[Solution]:
        return self.solutions

    @property
    def best(self) -> Solution:
        """The best solution; IndexError where there is none."""
        return self.solutions[0]

    @property
    def linkage(self) -> FourBar:
        """The linkage of the best solution."""
        return self.best.linkage

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        return {
            "status": self.status,
            "solutions": [solution.to_dict() for solution in self.solutions],
            "report": asdict(self.report),
        }

    def __repr__(self) -> str:
        rows = [f"  {s.rank}  {s.linkage!r}  {s.errors_in_words()}" for s in self.solutions]
        count = len(self.solutions)
        return "\n".join([f"{self.status}: {count} solution{'' if count == 1 else 's'}", *rows])


@dataclass(frozen=True)
class Features:
    """Haar features of a rotation curve: average and details, (mean of first half - mean of second half) / 2 of each block."""

    samples: int
    resampled: bool
    average: float
    details: list[float]


@dataclass(frozen=True)
class Match:
    """A row of the atlas and the start at which it turns like the request.

    Attributes
    ----------
    rank : int
    type : AtlasType
    linkage : FourBar
        With the type's lengths, its start angle and offset.
    start_angle, offset : float
        The requested rotation is the coupler angle from ``start_angle`` on, plus ``offset``.
    branch : int
    similarity : float
        Rms rotation error: a distance, the name is the contract's.
    features : Features or None
    """

    rank: int
    type: AtlasType
    linkage: FourBar
    start_angle: float
    branch: int
    offset: float
    similarity: float
    features: Features | None


@dataclass(frozen=True)
class MatchReport:
    """How much a scan looked at."""

    elapsed_ms: dict[str, float]
    windows: int
    evaluated: int
    notes: list[str]
    features: Features | None
    exhaustive: bool = True


@dataclass(frozen=True)
class Matches(Ranked[Match]):
    """The answer to `linkage_atlas.match`: the best rows of the atlas, best first, indexed and iterated as ``matches``."""

    matches: list[Match]
    report: MatchReport

    @property
    def _answers(self) -> list[Match]:
        return self.matches

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        rows = []
        for match in self.matches:
            row = {name: getattr(match, name) for name in _MATCH_FIELDS}
            rows.append(row | {"type": asdict(match.type), "features": _as_dict(match.features)})
        return {"matches": rows, "report": asdict(self.report)}

    def __repr__(self) -> str:
        rows = [
            f"  {m.rank}  type {m.type.number} {m.type.lengths}, start {m.start_angle:g}, branch {m.branch:+d}, "
            f"rms error {m.similarity:.3g}"
            for m in self.matches
        ]
        return "\n".join([f"{len(self.matches)} matches", *rows])


_MATCH_FIELDS = ("rank", "start_angle", "branch", "offset", "similarity")


def _as_dict(features: Features | None) -> dict[str, Any] | None:
    # `asdict` copies number by number: a second for a thousand rows
    return None if features is None else dict(vars(features))
