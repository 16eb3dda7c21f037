"""What comes back from `synthesize` and `match`: solutions, matches and reports, in the user's unit of angle.

Fields are those of the HTTP contract, in its order; ``to_dict`` gives what goes over HTTP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeVar, overload

from linkage_atlas.linkages import FourBar, Links, Mount
from linkage_atlas.records import KEPT, Floats, Record, Values
from linkage_atlas.studies import Analysis, ToleranceStudy
from synthesis.fourbar.determination import Sensitivity
from synthesis.ranking import Errors

One = TypeVar("One")
Status = Annotated[str, Literal["reached", "closest", "infeasible", "unknown"]]
StoppedBy = Annotated[str, Literal["tolerance", "converged", "budget"]]

FINISHING = 0.1
"""Part of its budget that an answer may take beyond it, to finish what the search has found."""


@dataclass(frozen=True)
class AtlasType(Record):
    """A dimension type of the atlas."""

    number: int
    """Number of the dimension type, from 1."""
    lengths: list[int]
    """L1 crank, L2 coupler, L3 rocker, L4 ground."""


@dataclass(frozen=True, kw_only=True)
class Rounded(Record):
    """A linkage whose links lie on a grid or are of stock lengths, the rest fitted anew within the limits."""

    closes: bool
    """Whether a combination of lengths closes within the limits; if not, the rest is null."""
    links: Links | None
    start_angle: float | None
    body_offset: float | None
    mount: Mount | None
    errors: Errors | None
    transmission_angle_min: float | None
    """Over the used interval."""
    tried: int
    """Combinations of lengths that were fitted."""
    combinations: int | None
    """How many there are; null for a grid."""
    exhaustive: bool | None
    """Whether this is the best of all combinations; null for a grid."""
    linkage: FourBar | None = field(default=None, metadata=KEPT)


@dataclass(frozen=True)
class Determination(Record):
    """How well the motion fixes each length."""

    ill_posed: bool
    """A length is not even fixed to a thousandth by the motion at this resolution."""
    resolution: float
    """Error of the motion that is considered: the objective, at least the tolerance; within limits the tolerance."""
    at_limits: tuple[str, ...]
    """Limits without which the motion would be met better."""
    length_uncertainty: Values
    """Relative change of crank, coupler, rocker, ground within that resolution; null: not determined at all."""


@dataclass(frozen=True, kw_only=True)
class Verdict(Record):
    """Whether a linkage does as a machine what it does at the samples."""

    order: bool
    """A crank that turns one way passes the samples in the order asked for."""
    branch: bool
    """All samples lie on one branch."""
    circuit: bool
    """All samples, and all between, lie on one circuit: nothing must be taken apart."""
    within_tolerance: bool | None
    """Every sample keeps the tolerances; null without any."""
    practical: bool
    """No practical limit is broken; what the request limits itself is judged by its own limit."""
    buildable: bool
    """The same as `practical`: whether links collide is not checked."""
    reasons: tuple[str, ...]
    """A sentence for everything that is amiss; samples count from 1."""

    @property
    def works(self) -> bool:
        """Whether the crank drives the linkage through the samples."""
        return self.order and self.branch and self.circuit


@dataclass(frozen=True, kw_only=True)
class Solution(Record):
    """A linkage that answers a request, and how well."""

    rank: int
    """From 1, by what was preferred, `errors.objective` by default."""
    source: Literal["atlas", "refined"]
    """A row of the atlas as it is, or what a search found."""
    type: AtlasType | None
    """The row of the atlas that it is, if it is one."""
    links: Links
    branch: Literal[-1, 1]
    start_angle: float
    body_offset: float | None
    """rotation = coupler angle (in -180..180 degrees at the first sample, continuous) + ground angle + this."""
    mount: Mount | None
    crank_angle: Floats | None = None
    """With free timing: crank angle at each sample from the first; one way for order `given`, in [0, 360) degrees for `any`."""
    errors: Errors
    verdict: Verdict
    excursion: float | None = None
    """With free timing: the largest way of the body point between two neighbouring samples over their distance, which counts as
    at least 5 % of the motion's extent."""
    size: float | None = None
    """Largest of the links, the coupler point's radius and the distances of the fixed pivots from the motion's middle, over the
    motion's extent."""
    family: str
    transmission_angle_min: float
    """Over the used interval, exactly."""
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the crank cannot turn."""
    condition: float
    """Condition number of the motion's derivatives by all unknowns."""
    determination: Determination
    sensitivity: Sensitivity | None = None
    rounded: Rounded | None = None
    analysis: Analysis | None = field(default=None, repr=False)
    tolerance_study: ToleranceStudy | None = field(default=None, repr=False)
    linkage: FourBar = field(metadata=KEPT)
    """It moves, draws and saves itself."""

    def errors_in_words(self) -> str:
        """The largest errors at the samples, rotation in the linkage's unit of angle, position in the unit of the positions."""
        largest = {"rotation": self.errors.rotation_max, "position": self.errors.position_max}
        unit = {"rotation": " deg" if self.linkage.degrees else " rad", "position": ""}
        return ", ".join(
            f"{name} within {value:.3g}{unit[name]}" for name, value in largest.items() if value is not None
        )


@dataclass(frozen=True)
class Report(Record):
    """How an answer came about."""

    elapsed_ms: dict[str, float]
    """Milliseconds of each stage and in total."""
    trace: list[tuple[float, float]]
    """[milliseconds, best objective] after each round."""
    stopped_by: StoppedBy
    length_scale: float | None
    """What position errors were divided by."""
    seeds: int | None
    """Starting points refined; null for effort atlas."""
    windows: int | None
    """Atlas windows that the answer is the best of; null for effort refine."""
    exhaustive: bool | None
    """Whether all windows were considered; null for effort refine."""
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
class Result(Record, Ranked[Solution]):
    """The answer to `linkage_atlas.synthesize`: solutions, best first, and a report.

    ``result[0]``, ``len(result)`` and ``for solution in result`` are those of ``solutions``; a result without any is false.

    ``status`` is "reached" (the best objective is below the tolerance), "closest", "infeasible" (none within the limits) or
    "unknown" (none was found before the time was up).
    """

    status: Status
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

    def __repr__(self) -> str:
        rows = [f"  {s.rank}  {s.linkage!r}  {s.errors_in_words()}" for s in self.solutions]
        count = len(self.solutions)
        return "\n".join([f"{self.status}: {count} solution{'' if count == 1 else 's'}", *rows])


@dataclass(frozen=True)
class Features(Record):
    """Haar features of a rotation curve."""

    samples: int
    resampled: bool
    """Whether the samples were resampled to a power of two of even crank angles."""
    average: float
    details: list[float]
    """(mean of first half - mean of second half) / 2 of each block, coarse to fine."""


@dataclass(frozen=True, kw_only=True)
class Match(Record):
    """A row of the atlas and the start at which it turns like the request."""

    rank: int
    type: AtlasType
    start_angle: float
    branch: Literal[-1, 1]
    offset: float
    """Added to the angle of the coupler, or rocker (in -180..180 degrees at the first sample, continuous)."""
    similarity: float
    """Rms rotation error of this row at this start: a distance."""
    features: Features | None = None
    linkage: FourBar = field(metadata=KEPT)
    """With the type's lengths, this start and offset."""


@dataclass(frozen=True)
class MatchReport(Record):
    """How much a scan looked at."""

    elapsed_ms: dict[str, float]
    windows: int
    """Types x starts x branches that the answer is the best of."""
    evaluated: int
    """Windows evaluated sample by sample; the bounds excluded the others."""
    exhaustive: bool
    """Whether all windows were considered; false where the time cut it short."""
    notes: list[str]
    features: Features | None = None


@dataclass(frozen=True)
class Matches(Record, Ranked[Match]):
    """The answer to `linkage_atlas.match`: the best rows of the atlas, best first, indexed and iterated as ``matches``."""

    matches: list[Match]
    report: MatchReport

    @property
    def _answers(self) -> list[Match]:
        return self.matches

    def __repr__(self) -> str:
        rows = [
            f"  {m.rank}  type {m.type.number} {m.type.lengths}, start {m.start_angle:g}, branch {m.branch:+d}, "
            f"rms error {m.similarity:.3g}"
            for m in self.matches
        ]
        return "\n".join([f"{len(self.matches)} matches", *rows])
