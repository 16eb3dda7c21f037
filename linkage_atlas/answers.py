"""What comes back from `synthesize` and `match`: solutions, matches and reports, and how they are made.

Fields are those of the HTTP contract, in its order; ``to_dict`` gives what goes over HTTP.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, overload

import numpy as np

from linkage_atlas.linkages import FourBar, Links, Mount
from linkage_atlas.motions import Motion
from linkage_atlas.records import KEPT, Record, Values, names_of
from linkage_atlas.studies import (
    STUDIES,
    Analysis,
    Studies,
    ToleranceStudy,
    analysed,
    read_studies,
    share_of,
    studied,
)
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.fourbar import solution as search
from synthesis.fourbar.determination import Sensitivity, determinations, determinations_within, sensitivities
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.passage import Verdict as Passing
from synthesis.fourbar.passage import excursions, practical_faults, size_of, verdicts
from synthesis.fourbar.rounding import Rounding, best_from_stock, round_to_grid
from synthesis.free.poses import Poses
from synthesis.free.search import in_turn
from synthesis.ranking import Errors, Status
from synthesis.work import Work

One = TypeVar("One")
StatusName = Annotated[str, Literal["reached", "closest", "infeasible", "unknown"]]
StoppedBy = Annotated[str, Literal["tolerance", "converged", "budget"]]

FINISHING = 0.1
"""Part of its budget that an answer may take beyond it, to finish what the search has found."""
_AT_ONCE = 8
"""Solutions finished between two looks at the time; one where each is rounded."""
TRIES, FEWEST_TRIES = 4000, 40
"""Combinations of lengths that are fitted in all solutions of one request (about two seconds), and at least in each."""


@dataclass(frozen=True)
class AtlasType(Record):
    """A dimension type of the atlas."""

    number: int
    """Number of the dimension type, from 1."""
    lengths: list[int]
    """L1 crank, L2 coupler, L3 rocker, L4 ground."""


TypeOf = Callable[[int], AtlasType]
"""The type of a row of the atlas."""


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


class Origin(NamedTuple):
    """What a solution is described from."""

    found: search.Solution
    motion: Motion
    """With the solution's own crank angles."""
    limits: Limits


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
    origin: Origin = field(metadata=KEPT, repr=False)

    def studied(self, work: Work | None = None, **studies: Any) -> Solution:
        """The same solution with studies of it, under the names of the HTTP contract.

        Parameters
        ----------
        work : Work, optional
            Asked whether the answer is still wanted.
        round_to : float
            ``rounded``: the links on this grid and the rest fitted anew, within the limits of the request.
        lengths_from : array_like, shape (n,)
            Instead: each link of one of these lengths, in the best combination.
        sensitivity : bool
            ``sensitivity``: the change of the motion per unit of each length.
        analysis : mapping
            ``analysis``: ``crank_speed`` and perhaps ``load``, as of `FourBar.analysis`.
        tolerance_study : mapping
            ``tolerance_study``: ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``, as of `FourBar.tolerance_study`.

        Examples
        --------
        >>> import numpy as np, linkage_atlas as la
        >>> made = la.FourBar(19, 72, 144, 165, start_angle=30).joints(np.linspace(0, 70, 16))
        >>> motion = la.Motion(made.rotation, made.crank_pin, crank_span=70)
        >>> la.synthesize(motion, top=1).best.studied(round_to=1).rounded.closes
        True
        """
        for name in studies:
            if name not in STUDIES:
                raise FieldError.no_such("", name, STUDIES, "study")
        return _studied(self, read_studies(studies, self.origin.motion), 1, work or Work())

    def errors_in_words(self) -> str:
        """The largest errors at the samples, rotation in the linkage's unit of angle, position in the unit of the positions."""
        largest = {"rotation": self.errors.rotation_max, "position": self.errors.position_max}
        unit = {"rotation": " deg" if self.linkage.degrees else " rad", "position": ""}
        return ", ".join(
            f"{name} within {value:.3g}{unit[name]}" for name, value in largest.items() if value is not None
        )


@dataclass(frozen=True)
class Continued(Record):
    """How an answer to a `live` request began."""

    continued: bool
    """Whether with what the last answer left."""


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
    live: Continued | None = None
    """With `live`: whether the search went on from the last answer."""
    unseen: float | None = None
    """The estimated chance that a better linkage was missed: of the searches that say 10 %, one in ten was beaten by more than
    1 % by ten seconds of search. Null for exact answers, for effort atlas and from a given linkage."""


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

    status: StatusName
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


# -- from what a search found to what a user reads --------------------------------------------------------------------


def status_of(solutions: Sequence[Solution], tolerance: float, tolerances: bool, cut_short: bool) -> str:
    """What was found: reached where the best solution keeps the tolerances, or without any, where its objective is small."""
    if not solutions:
        return (Status.UNKNOWN if cut_short else Status.INFEASIBLE).value
    if tolerances:
        return (Status.REACHED if solutions[0].verdict.within_tolerance else Status.CLOSEST).value
    return (Status.REACHED if solutions[0].errors.objective < tolerance else Status.CLOSEST).value


def finished(
    found: list[search.Solution],
    motion: Motion,
    limits: Limits,
    tolerance: float,
    studies: Studies,
    type_of: TypeOf | None,
    work: Work,
    by_error: bool,
) -> list[Solution]:
    """Solutions in the user's unit, with how well they are determined and what else was asked for.

    Where they are not ranked by their error they keep their order among those that work and keep the tolerances. Once the
    work's time is up no further ones are finished: those are left out. The first always is.
    """
    at_once = 1 if studies.long else _AT_ONCE
    solutions: list[Solution] = []
    for first in range(0, len(found), at_once):
        if solutions and work.expired():
            break
        for solution in _described(found[first : first + at_once], motion, limits, tolerance, type_of):
            solutions.append(_studied(solution, studies, len(found), work))
    # a linkage that does not work as a machine never comes before one that does
    solutions.sort(
        key=lambda one: (
            not one.verdict.works,
            one.verdict.within_tolerance is False,
            *_worth(one, motion, tolerance if by_error else 0.0),
        )
    )
    return [replace(one, rank=rank) for rank, one in enumerate(solutions, 1)]


def _worth(one: Solution, motion: Motion, tolerance: float) -> tuple[float, ...]:
    """The place of an exact answer for given crank angles by what one would build, not by its rounding; others keep theirs."""
    if motion.free or one.errors.objective >= tolerance:
        return 1.0, 0.0, 0.0
    step = 5 if motion.degrees else np.deg2rad(5)
    return 0.0, -(one.transmission_angle_min // step), one.size or 0.0


def _described(
    found: list[search.Solution], motion: Motion, limits: Limits, tolerance: float, type_of: TypeOf | None
) -> list[Solution]:
    """Some solutions without studies."""
    linkages = [one.linkage for one in found]
    samples, radian, allowed = motion.samples, motion.radian, motion.tolerances
    target = motion.with_angles(linkages, [one.crank for one in found])
    if limits.only_family:
        fixed = determinations(target, linkages, [max(one.errors.objective, tolerance) for one in found])
    else:
        resolution = tolerance if allowed is None else max(tolerance, allowed.objective(samples))
        fixed = determinations_within(target, linkages, resolution, limits)
    crank = np.array([one.start for one in linkages])[:, None] + target.crank
    side = np.broadcast_to(np.array([one.branch for one in linkages])[:, None], crank.shape)
    way: dict[str, bool] = {"timed": True}
    ways: list[Any] = [None] * len(found)
    if isinstance(samples, Poses):
        way = {"ordered": samples.ordered, "closed": samples.closed}
    passed = verdicts(linkages, crank, side, **way)
    if isinstance(samples, Poses):
        ways = excursions(linkages, crank, side, samples.extent, **way, carried=[one.circuit for one in passed])
    solutions = []
    for k, one in enumerate(found):
        own, turn = motion.one_of(target, k), one.transmission_angle_min_turn
        reasons, within = list(passed[k].reasons), None
        if allowed is not None:
            shares = allowed.shares(own.target, one.linkage)
            within, worst = bool(np.all(shares <= 1)), int(np.argmax(shares))
            if not within:
                reasons.append(
                    f"sample {worst + 1} is off by {shares[worst]:.3g} times what is allowed, the most of all"
                )
        faults = practical_faults(one, own.target, limits, ways[k])
        kind = None if one.row is None or type_of is None else type_of(one.row)
        linkage = FourBar.of(one.linkage, own)
        solutions.append(
            Solution(
                rank=0,
                source="refined" if kind is None else "atlas",
                type=kind,
                **linkage.dimensions._asdict(),
                crank_angle=in_turn(own.target.crank, samples.ordered) / radian
                if isinstance(samples, Poses)
                else None,
                errors=_in_unit(one.errors, radian),
                verdict=verdict_of(passed[k], within, [*reasons, *faults], practical=not faults),
                excursion=ways[k],
                size=size_of(one.linkage, samples),
                family=one.family.value,
                transmission_angle_min=one.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                condition=fixed[k].condition,
                determination=Determination(
                    fixed[k].ill_posed, fixed[k].resolution, fixed[k].at_limits, fixed[k].length_uncertainty
                ),
                linkage=linkage,
                origin=Origin(one, own, limits),
            )
        )
    return solutions


def _studied(solution: Solution, studies: Studies, solutions: int, work: Work) -> Solution:
    """One of several solutions with what else was asked of it."""
    work.check()
    one, own, limits = solution.origin
    done: dict[str, Any] = {}
    target, radian, linkage = own.target, own.radian, one.linkage
    tries = max(FEWEST_TRIES, TRIES // solutions)
    if studies.sensitivity:
        (change,) = sensitivities(target, [linkage])
        turned = None if change.rotation is None else change.rotation / radian
        done["sensitivity"] = Sensitivity(turned, change.position)
    if studies.round_to is not None:
        done["rounded"] = _rounded(round_to_grid(target, one, studies.round_to, limits, tries, work), own)
    if studies.lengths_from is not None:
        done["rounded"] = _rounded(best_from_stock(target, one, studies.lengths_from, limits, tries, work), own)
    if studies.drive is not None:
        done["analysis"] = analysed(linkage, studies.drive, target.crank, radian, target.interval)
    if studies.manufacture is not None:
        share = share_of(studies.manufacture, target.samples, solutions, work.budget)
        done["tolerance_study"] = studied(linkage, share, target.crank, target.interval, radian, work)
    return replace(solution, **done) if done else solution


def verdict_of(passing: Passing, within: bool | None, reasons: Sequence[str], practical: bool) -> Verdict:
    """A verdict as a user reads it."""
    return Verdict(
        order=passing.order,
        branch=passing.branch,
        circuit=passing.circuit,
        within_tolerance=within,
        practical=practical,
        buildable=practical,
        reasons=tuple(reasons),
    )


def cognate_notes(solutions: Sequence[Solution]) -> list[str]:
    """Which solutions of a path draw the same curve by Roberts' theorem."""
    pairs = itertools.combinations(solutions, 2)
    alike = [(one.rank, other.rank) for one, other in pairs if one.linkage.is_cognate_of(other.linkage)]
    return [
        f"solutions {a} and {b} are Roberts cognates: different linkages that draw the same curve" for a, b in alike
    ]


def _in_unit(errors: Errors, radian: float) -> Errors:
    """Errors with their rotations in a user's unit of angle."""
    rms, largest = errors.rotation_rms, errors.rotation_max
    return replace(
        errors,
        rotation_rms=None if rms is None else rms / radian,
        rotation_max=None if largest is None else largest / radian,
    )


def _rounded(found: Rounding, motion: Motion) -> Rounded:
    """Rounded links in the motion's unit."""
    solution = found.solution
    values: dict[str, Any] = dict.fromkeys(names_of(Rounded)) | {
        "closes": False,
        "tried": found.tried,
        "combinations": found.combinations,
        "exhaustive": found.exhaustive,
    }
    if solution is None:
        return Rounded(**values)
    linkage = FourBar.of(solution.linkage, motion)
    dimensions = linkage.dimensions._asdict()
    del dimensions["branch"]
    values |= dimensions | {
        "closes": True,
        "errors": _in_unit(solution.errors, motion.radian),
        "transmission_angle_min": solution.transmission_angle_min / motion.radian,
    }
    return Rounded(**values, linkage=linkage)
