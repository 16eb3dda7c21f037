"""What comes back from `synthesize` and `match`: solutions, matches and reports, and how they are made.

Fields are those of the HTTP contract, in its order; ``to_dict`` gives what goes over HTTP.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Generic, Literal, NamedTuple, Self, TypeAlias, TypeVar, cast, overload

import numpy as np

from linkage_atlas.arguments import check_names
from linkage_atlas.assemblies import AskedAssembly, Assembly, assembled
from linkage_atlas.drive_design.design import driven_solution
from linkage_atlas.drive_design.records import AnySpring, Drive, Refusal
from linkage_atlas.linkages import (
    AnyGuide,
    CircleGuide,
    DriverName,
    Linkage,
    Links,
    Mount,
    OtherKindName,
    guides_of,
)
from linkage_atlas.motions import Motion
from linkage_atlas.notes import counted
from linkage_atlas.records import KEPT, LAST, Record, Values, names_of
from linkage_atlas.studies import (
    STUDIES,
    Analysis,
    GuidedAnalysis,
    Sensitivity,
    Studies,
    ToleranceStudy,
    read_studies,
    sensitivity_of,
    share_of,
)
from synthesis import solution as model
from synthesis.arrays import Floats
from synthesis.constraints import broken_limits
from synthesis.defects import Verdict as Passing
from synthesis.defects import practical_faults, shared_positions, verdict
from synthesis.errors import FieldError
from synthesis.excursions import excursions_of
from synthesis.fourbar.determination import determinations, determinations_within
from synthesis.fourbar.rounding import best_from_stock, round_to_grid
from synthesis.free.search import in_turn
from synthesis.guided.rounding import from_stock, on_grid, rounded
from synthesis.limits import Limits
from synthesis.linkage import Linkage as Plain
from synthesis.local_refinement import refined_in_place
from synthesis.poses import Poses, spin_faults
from synthesis.ranking import Errors, Status
from synthesis.scores import passing, rotations_of, size_of
from synthesis.solution import target_of
from synthesis.studies.sensitivity import Change, changes
from synthesis.target import Target
from synthesis.work import OutOfTime, Work

One = TypeVar("One")
S = TypeVar("S", bound="AnySolution")
Found = TypeVar("Found")
StatusName = Annotated[str, Literal["reached", "closest", "infeasible", "unknown"]]
StoppedBy = Annotated[str, Literal["tolerance", "converged", "budget"]]

FINISHING = 0.1
"""Part of its budget that an answer may take beyond it, to finish what the search has found."""
_AT_ONCE, _SAMPLES_AT_ONCE = 8, 2048
"""Solutions, and samples of all of them, finished between two looks at the time; one solution where each is rounded."""
ROUNDINGS, MOST_ROUNDINGS, FEWEST_ROUNDINGS = 40, 8, 2
"""Combinations of lengths that are fitted in all linkages with rails or slots of a request, and at most and at least in each."""
TRIES, FEWEST_TRIES = 4000, 40
"""Combinations of lengths that are fitted in all solutions of one request (about two seconds), and at least in each."""


@dataclass(frozen=True)
class AtlasType(Record):
    """A dimension type of the atlas."""

    number: int
    """Number of the dimension type, from 1."""
    lengths: list[int]
    """L1 crank, L2 coupler, L3 rocker, L4 ground; of a slider-crank r crank, l rod, e offset of the rail from the pivot."""


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
    crank_angle: Floats | None
    """Where the crank angles are free: those of these links at the samples."""
    tried: int
    """Combinations of lengths that were fitted."""
    combinations: int | None
    """How many there are; null for a grid."""
    exhaustive: bool | None
    """Whether this is the best of all combinations; null for a grid."""
    reason: str | None = None
    """Why none closes."""
    linkage: Linkage | None = field(default=None, metadata=KEPT)


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
    buildable: bool | None
    """`practical`, and an assembly was found without collisions; null until an assembly was checked."""
    reasons: tuple[str, ...]
    """A sentence for everything that is amiss; samples count from 1."""
    assembly: Assembly | None = None
    """Where it was asked for: layers in which nothing collides; null where the loop does not carry the motion."""

    @property
    def works(self) -> bool:
        """Whether the crank drives the linkage through the samples."""
        return self.order and self.branch and self.circuit


class Origin(NamedTuple, Generic[Found]):
    """What a solution is described from."""

    found: Found
    motion: Motion
    """With the solution's own crank angles, or the travel of its own drive in their place."""
    limits: Limits
    asked: Poses | Target
    """The samples of the request."""


class _Parts(Record):
    """What solutions of all kinds have, each of its own kind and in its own place."""

    errors: Errors
    verdict: Verdict
    linkage: Any
    origin: Any


@dataclass(frozen=True, kw_only=True)
class Driven(_Parts):
    """A solution of any kind, with what drives it; studies can be made of it."""

    drives: list[Drive] | None = field(default=None, repr=False, metadata=LAST)
    """The best of each kind that was asked for."""
    refused: list[Refusal] | None = field(default=None, repr=False, metadata=LAST)
    """Why there is none of a kind on a link."""
    springs: list[AnySpring] | None = field(default=None, repr=False, metadata=LAST)
    drivable: bool | None = field(default=None, repr=False, metadata=LAST)
    """With `drive`: whether there is one."""

    def studied(self, work: Work | None = None, **studies: Any) -> Self:
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
            ``analysis``: ``crank_speed`` and perhaps ``load``, as of `Linkage.analysis`.
        load, drives, springs, drive
            ``drives``, ``refused``, ``springs``, ``drivable``: as of `linkage_atlas.drives`, the best of each kind.
        tolerance_study : mapping
            ``tolerance_study``: ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``, as of `Linkage.tolerance_study`.
        assembly : mapping or True
            ``verdict.assembly``: layers in which nothing collides; arguments as of `Linkage.assembly`, or their defaults.

        Examples
        --------
        >>> import numpy as np, linkage_atlas as la
        >>> made = la.FourBar(19, 72, 144, 165, start_angle=30).joints(np.linspace(0, 70, 16))
        >>> motion = la.Motion(made.rotation, made.crank_pin, crank_span=70)
        >>> la.synthesize(motion, top=1).best.studied(round_to=1).rounded.closes
        True
        """
        check_names("", studies, STUDIES, "study")
        found: Self = _studied(cast("Any", self), read_studies(studies, self.origin.motion), 1, work or Work())
        return found

    def errors_in_words(self) -> str:
        """Return the largest errors at the samples in words, in the units of the motion."""
        return errors_in_words(self.errors, self.linkage.degrees)


@dataclass(frozen=True, kw_only=True)
class Solution(Driven):
    """A linkage that answers a request, and how well."""

    rank: int
    """From 1, by what was preferred, `errors.objective` by default."""
    least_error: bool = False
    """Whether it has the smallest error of the solutions that can be used."""
    source: Literal["atlas", "refined"]
    """A row of the atlas as it is, or what a search found."""
    type: AtlasType | None
    """The row of the atlas that it is, if it is one."""
    kind: Literal["four_bar"] = "four_bar"
    driver: Literal["crank"] = "crank"
    guides: list[CircleGuide] | None = None
    """The same as two circles, that of the crank first, in the body's frame; null where nothing is mounted."""
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
    linkage: Linkage = field(metadata=KEPT)
    """It moves, draws and saves itself."""
    origin: Origin[model.Solution] = field(metadata=KEPT, repr=False)


@dataclass(frozen=True, kw_only=True)
class GuidedRounded(Record):
    """A linkage with rails or slots whose lengths lie on a grid or are of stock, the rest fitted anew within the limits."""

    closes: bool
    """Whether a combination of lengths that was tried closes within the limits; if not, the rest is null."""
    lengths: dict[str, float] | None
    """Radii of cranks, and the coupler between two points of the body that are guided; none for a slot beside a rail or slot."""
    guides: list[AnyGuide] | None
    branch: Literal[-1, 1] | None
    start: float | None
    crank_angle: Floats | None
    travel: Floats | None
    errors: Errors | None
    transmission_angle_min: float | None
    tried: int
    """Combinations of lengths that were fitted: of each length the nearest two."""
    combinations: int | None
    """How many there are; null for a grid."""
    exhaustive: bool | None
    """Whether all combinations were tried; null for a grid."""
    reason: str | None = None
    """Why none closes."""
    linkage: Linkage | None = field(default=None, metadata=KEPT)


@dataclass(frozen=True, kw_only=True)
class GuidedSolution(Driven):
    """A body on two guides that answers a request, rails and slots among them, and how well."""

    rank: int
    """From 1, by what was preferred."""
    least_error: bool = False
    """Whether it has the smallest error of the solutions that can be used."""
    source: Literal["refined"] = "refined"
    kind: OtherKindName
    driver: DriverName
    """What moves the first guide."""
    guides: list[AnyGuide]
    """The driven one first; body points and directions are in the body's frame."""
    branch: Literal[-1, 1]
    """Sign of the sine of the transmission angle."""
    start: float
    """The drive's coordinate at the first sample: direction of crank or slot in the plane, place along rail or slot."""
    crank_angle: Floats | None = None
    """Of a crank or hinge at each sample from the first."""
    travel: Floats | None = None
    """Of a slider or cylinder at each sample from the first."""
    errors: Errors
    verdict: Verdict
    excursion: float | None = None
    """With free timing: the largest way of the body point between two neighbouring samples over their distance, which counts as
    at least 5 % of the motion's extent."""
    size: float | None = None
    """Largest of radii, used slots, body points and the distances of fixed pivots, pins and used rails from the motion's middle,
    over the motion's extent."""
    transmission_angle_min: float
    """Over the used interval, exactly."""
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the drive does not turn fully."""
    arm_min: float
    """Least moment arm of the second guide's push about the driven guide's pin, over the used interval."""
    sensitivity: list[Change] | None = None
    """Rms changes of the motion per unit of each dimension, all else held."""
    rounded: GuidedRounded | None = None
    analysis: GuidedAnalysis | None = field(default=None, repr=False)
    tolerance_study: ToleranceStudy | None = field(default=None, repr=False)
    linkage: Linkage = field(metadata=KEPT)
    """It moves, draws and saves itself."""
    origin: Origin[model.Solution] = field(metadata=KEPT, repr=False)


AnySolution: TypeAlias = Solution | GuidedSolution


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
    continued: list[int | None] | None = None
    """With `start_from`: the rank of the solution to which each of its linkages led, null if there is none."""


class Ranked(Sequence[One]):
    """What can be indexed, counted and iterated as the list of its answers, best first; false where there are none."""

    @property
    def _answers(self) -> Sequence[One]:
        raise NotImplementedError

    @overload
    def __getitem__(self, place: int) -> One: ...

    @overload
    def __getitem__(self, place: slice) -> list[One]: ...

    def __getitem__(self, place: int | slice) -> One | list[One]:
        found = self._answers[place]
        return list(cast("Sequence[One]", found)) if isinstance(place, slice) else cast("One", found)

    def __len__(self) -> int:
        return len(self._answers)


@dataclass(frozen=True)
class Result(Record, Ranked[AnySolution]):
    """The answer to `linkage_atlas.synthesize`: solutions, best first, and a report.

    ``result[0]``, ``len(result)`` and ``for solution in result`` are those of ``solutions``; a result without any is false.

    ``status`` is "reached" (a solution keeps the tolerances of every sample; without any, its objective is below the tolerance),
    "closest", "infeasible" (none within the limits) or "unknown" (none was found before the time was up).
    """

    status: StatusName
    solutions: list[Solution | GuidedSolution]
    report: Report

    @property
    def _answers(self) -> list[AnySolution]:
        return self.solutions

    @property
    def best(self) -> AnySolution:
        """The best solution; IndexError where there is none."""
        return self.solutions[0]

    @property
    def linkage(self) -> Linkage:
        """The linkage of the best solution."""
        return self.best.linkage

    def __repr__(self) -> str:
        rows = [f"  {s.rank}  {s.linkage!r}  {s.errors_in_words()}" for s in self.solutions]
        notes = [f"note: {note}" for note in self.report.notes]
        return "\n".join([f"{self.status}: {counted(len(self.solutions), 'solution')}", *rows, *notes])


@dataclass(frozen=True)
class Features(Record):
    """Haar features of a rotation curve."""

    samples: int
    resampled: bool
    """Whether the samples were resampled to a power of two of even crank angles."""
    average: float
    details: list[float]
    """(mean of first half - mean of second half) / 2 of each block, coarse to fine."""


_SHOWN_KINDS = {"four_bar": "", "slider_crank": "slider-crank "}
"""How a match names its kind to a reader."""


@dataclass(frozen=True, kw_only=True)
class Match(Record):
    """A row of the atlas and the start at which it turns like the request."""

    rank: int
    kind: str
    """What it is: four_bar or slider_crank."""
    type: AtlasType
    start_angle: float
    """Crank angle at the first sample, from the ground line; of a slider-crank from the direction of the rail."""
    branch: Literal[-1, 1]
    """Of a slider-crank: -1 is the mirror image, its offset negated."""
    offset: float
    """Added to the angle of the coupler, rocker or rod (in -180..180 degrees at the first sample, continuous)."""
    similarity: float
    """Rms rotation error of this row at this start: a distance."""
    features: Features | None = None
    linkage: Linkage = field(metadata=KEPT)
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
            f"  {m.rank}  {_SHOWN_KINDS[m.kind]}type {m.type.number} {m.type.lengths}, start {m.start_angle:g}, "
            f"branch {m.branch:+d}, rms error {m.similarity:.3g}"
            for m in self.matches
        ]
        return "\n".join([counted(len(self.matches), "match"), *rows])


# -- from what a search found to what a user reads --------------------------------------------------------------------


def status_of(solutions: Sequence[AnySolution], tolerance: float, tolerances: bool, cut_short: bool) -> str:
    """Return what was found: reached if a solution keeps the tolerances, or without any, if the smallest objective is small."""
    if not solutions:
        return (Status.UNKNOWN if cut_short else Status.INFEASIBLE).value
    if tolerances:
        reached = any(solution.verdict.within_tolerance for solution in solutions)
    else:
        reached = any(solution.errors.objective < tolerance for solution in solutions)
    return (Status.REACHED if reached else Status.CLOSEST).value


def finished(
    found: Sequence[model.Solution],
    motion: Motion,
    limits: Limits,
    tolerance: float,
    studies: Studies,
    type_of: TypeOf | None,
    work: Work,
) -> list[Solution]:
    """Return solutions in the user's unit, with how well they are determined and what else was asked for, in their order.

    Once the work's time is up no further ones are finished. The first always is.
    """
    return _finished(
        found,
        1 if studies.long else max(1, min(_AT_ONCE, _SAMPLES_AT_ONCE // motion.samples.samples)),
        lambda some: _described(some, motion, limits, tolerance, type_of),
        studies,
        work,
    )


def _finished(
    found: Sequence[Any],
    at_once: int,
    describe: Callable[[Sequence[Any]], list[S]],
    studies: Studies,
    work: Work,
) -> list[S]:
    """Return solutions of one kind with their studies."""
    solutions: list[S] = []
    for first in range(0, len(found), at_once):
        if solutions and work.expired():
            break
        for solution in describe(found[first : first + at_once]):
            solutions.append(_studied(solution, studies, len(found), work))
    return solutions


def _described(
    found: Sequence[model.Solution], motion: Motion, limits: Limits, tolerance: float, type_of: TypeOf | None
) -> list[Solution]:
    """Some solutions without studies."""
    linkages = [one.linkage for one in found]
    samples, radian, allowed = motion.samples, motion.radian, motion.tolerances
    target = motion.with_angles(linkages, [one.travel for one in found])
    if limits.only_family:
        fixed = determinations(target, linkages, [max(one.errors.objective, tolerance) for one in found])
    else:
        resolution = tolerance if allowed is None else max(tolerance, allowed.objective(samples))
        fixed = determinations_within(target, linkages, resolution, limits)
    crank = np.array([one.start for one in linkages])[:, None] + target.crank
    passed = [verdict(one, row, **passing(samples)) for one, row in zip(linkages, crank)]
    ways: list[float | None] = [None] * len(found)
    if isinstance(samples, Poses):
        ways = excursions_of(found, samples, [one.circuit for one in passed])
        turned = rotations_of(found, samples)
    solutions = []
    for k, one in enumerate(found):
        own, turn = motion.one_of(target, k), one.transmission_angle_min_turn
        faults = practical_faults(one, own.target, limits, one.interval, ways[k])
        if isinstance(samples, Poses):
            faults += spin_faults(samples, turned[k])
        kind = None if one.row is None or type_of is None else type_of(one.row)
        linkage = Linkage.of(one.linkage, own.radian, own.target, own.length_unit)
        solutions.append(
            Solution(
                rank=0,
                source="refined" if kind is None else "atlas",
                type=kind,
                guides=_circles(one.linkage),
                **linkage.dimensions._asdict(),
                crank_angle=in_turn(own.target.crank, samples.ordered) / radian
                if isinstance(samples, Poses)
                else None,
                errors=in_unit(one.errors, radian),
                verdict=_judged(passed[k], own, one.linkage, faults),
                excursion=ways[k],
                size=size_of(one.linkage, samples),
                family=str(one.linkage.family),
                transmission_angle_min=one.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                condition=fixed[k].condition,
                determination=Determination(
                    fixed[k].ill_posed, fixed[k].resolution, fixed[k].at_limits, fixed[k].length_uncertainty
                ),
                linkage=linkage,
                origin=Origin(one, own, limits, samples),
            )
        )
    return solutions


def _circles(linkage: Plain) -> list[CircleGuide] | None:
    if not linkage.mounted:
        return None
    return [one for one in guides_of(linkage, 1.0, None) if isinstance(one, CircleGuide)]


def finished_guided(
    found: Sequence[model.Solution], motion: Motion, limits: Limits, studies: Studies, work: Work
) -> list[GuidedSolution]:
    """Solutions with rails or slots in the user's unit, with what else was asked for, in their order.

    Once the work's time is up no further ones are finished; the first always is.
    """
    return _finished(found, 1, lambda some: [_guided_described(one, motion, limits) for one in some], studies, work)


def _guided_described(one: model.Solution, motion: Motion, limits: Limits) -> GuidedSolution:
    """A solution without studies."""
    samples, radian, allowed = motion.samples, motion.radian, motion.tolerances
    target = target_of(samples, one.linkage, one.travel)
    own = Motion.of(target, motion.degrees, allowed, motion.length_unit)
    strays = excursions_of([one], samples)[0] if isinstance(samples, Poses) else None
    passed = verdict(one.linkage, one.linkage.start + target.crank, **passing(samples))
    faults = practical_faults(one, target, limits, one.interval, strays)
    if isinstance(samples, Poses):
        faults += spin_faults(samples, rotations_of([one], samples)[0])
    linkage = Linkage.of(one.linkage, radian, target, own.length_unit)
    turns, turn = one.linkage.driver.turns, one.transmission_angle_min_turn
    kind: Any = one.linkage.kind.value
    return GuidedSolution(
        rank=0,
        kind=kind,
        driver=one.linkage.driver.value,
        guides=linkage.guides,
        branch=-1 if one.linkage.branch < 0 else 1,
        start=linkage.start,
        crank_angle=_angles(samples, target, turns, radian),
        travel=None if turns or not motion.free else target.crank,
        errors=in_unit(one.errors, radian),
        verdict=_judged(passed, own, one.linkage, faults, turns),
        excursion=strays,
        size=size_of(one.linkage, target, one.interval),
        transmission_angle_min=one.transmission_angle_min / radian,
        transmission_angle_min_turn=None if turn is None else turn / radian,
        arm_min=one.linkage.arm_over(target.interval.after(one.linkage.start)),
        linkage=linkage,
        origin=Origin(one, own, limits, samples),
    )


def _angles(samples: Poses | Target, target: Target, turns: bool, radian: float) -> Floats | None:
    """The angles of a drive that turns, where they were free."""
    return in_turn(target.crank, samples.ordered) / radian if turns and isinstance(samples, Poses) else None


def _guided_rounded(
    solution: GuidedSolution, grid: float | None, stock: Sequence[float] | None, solutions: int, work: Work
) -> GuidedRounded:
    """One of several solutions with lengths that can be had, in the motion's unit."""
    tries = max(FEWEST_ROUNDINGS, min(MOST_ROUNDINGS, ROUNDINGS // solutions))
    one, own, limits, samples = solution.origin
    if stock is None:
        assert grid is not None
        choices, combinations = on_grid(grid), None
    else:
        choices, combinations = from_stock(stock), len(set(stock)) ** len(one.linkage.lengths)
    found = rounded(
        samples, one, choices, combinations, lambda made: not broken_limits(made, samples, limits), tries, work
    )
    values = _tried(GuidedRounded, found)
    if found.solution is None:
        return GuidedRounded(**values)
    again, radian, free = found.solution, own.radian, isinstance(samples, Poses)
    target = target_of(samples, again.linkage, again.travel)
    linkage = Linkage.of(again.linkage, radian, target, own.length_unit)
    turns = again.linkage.driver.turns
    values |= {
        "lengths": again.linkage.lengths,
        "guides": linkage.guides,
        "branch": again.linkage.branch,
        "start": linkage.start,
        "crank_angle": _angles(samples, target, turns, radian),
        "travel": None if turns or not free else target.crank,
        "errors": in_unit(again.errors, radian),
        "transmission_angle_min": again.transmission_angle_min / radian,
    }
    return GuidedRounded(**values, linkage=linkage)


def _studied(solution: S, studies: Studies, solutions: int, work: Work) -> S:
    """One of several solutions with what else was asked of it."""
    work.check()
    own, linkage = solution.origin.motion, solution.linkage
    done: dict[str, Any] = {}
    target = own.target
    if studies.sensitivity:
        done["sensitivity"] = _sensitivity(linkage.plain, target, own.radian)
    if studies.round_to is not None or studies.lengths_from is not None:
        asked = studies.round_to, studies.lengths_from, solutions, work
        done["rounded"] = (
            _guided_rounded(solution, *asked) if isinstance(solution, GuidedSolution) else _rounded(solution, *asked)
        )
    if studies.analysis is not None:
        done["analysis"] = linkage.analysed(studies.analysis, target.crank, target.interval)
    if studies.drives is not None:
        done |= driven_solution(linkage.plain, target.way, studies.drives, own.radian, work)
    if studies.manufacture is not None:
        share = share_of(studies.manufacture, target.samples, solutions, work.budget)
        done["tolerance_study"] = linkage.made_within(share, target, work)
    if studies.assembly is not None:
        done["verdict"] = _with_assembly(solution, studies.assembly, studies.arranged, work)
    return replace(solution, **done) if done else solution


def _sensitivity(linkage: Plain, target: Target, radian: float) -> Sensitivity | list[Change]:
    if not linkage.is_four_bar:
        return changes(linkage, target, radian)
    return sensitivity_of(linkage, target, radian)


def _with_assembly(
    solution: AnySolution, asked: AskedAssembly, arranged: Mapping[int, Assembly], work: Work
) -> Verdict:
    """The verdict with the assembly; the parts of a linkage that does not carry its motion are not arranged."""
    verdict, (one, own, limits) = solution.verdict, solution.origin[:3]
    found: Assembly | None = None
    if not verdict.works:
        why = ["layers were not looked for: the drive does not carry the linkage through the samples"]
    else:
        try:
            asked = asked.within(limits.envelope, limits.keep_out)
            found = arranged.get(id(one.linkage)) or assembled(
                one.linkage, asked, own.target.interval, own.radian, work
            )
            why = [] if found.free else [f"layers: {found.reasons[0]}"]
        except FieldError as error:
            why = [f"layers were not looked for: {error}"]
        except OutOfTime:
            why = ["layers were not looked for: the time was up"]
    buildable = None if found is None else verdict.practical and found.free
    return replace(verdict, assembly=found, buildable=buildable, reasons=(*verdict.reasons, *why))


def _judged(passage: Passing, motion: Motion, linkage: Any, faults: Sequence[str], turns: bool = True) -> Verdict:
    """The verdict on a linkage at its own crank angles, tolerances included; ``turns``: its drive does."""
    reasons, within = list(passage.reasons), None
    if motion.tolerances is not None:
        shares = motion.tolerances.shares(motion.target, linkage)
        within, worst = bool(np.all(shares <= 1)), int(np.argmax(shares))
        if not within:
            reasons.append(f"sample {worst + 1} is off by {shares[worst]:.3g} times what is allowed, the most of all")
    shared = shared_positions(motion.target, turns) if motion.target.found and not within else []
    return verdict_of(passage, within, [*reasons, *faults, *shared], practical=not faults)


def verdict_of(passage: Passing, within: bool | None, reasons: Sequence[str], practical: bool) -> Verdict:
    """A verdict as a user reads it."""
    return Verdict(
        order=passage.order,
        branch=passage.branch,
        circuit=passage.circuit,
        within_tolerance=within,
        practical=practical,
        buildable=None,
        reasons=tuple(reasons),
    )


def cognate_notes(solutions: Sequence[Solution]) -> list[str]:
    """Which solutions of a path draw the same curve by Roberts' theorem."""
    pairs = itertools.combinations(solutions, 2)
    alike = [(one.rank, other.rank) for one, other in pairs if one.linkage.is_cognate_of(other.linkage)]
    return [
        f"Solutions {a} and {b} are Roberts cognates: different linkages that draw the same curve." for a, b in alike
    ]


def errors_in_words(errors: Errors, degrees: bool) -> str:
    """Return the largest errors in words: "rotation within 0.5 deg, position within 1.2"."""
    largest = {"rotation": errors.rotation_max, "position": errors.position_max}
    unit = {"rotation": " deg" if degrees else " rad", "position": ""}
    return ", ".join(f"{name} within {value:.3g}{unit[name]}" for name, value in largest.items() if value is not None)


def in_unit(errors: Errors, radian: float) -> Errors:
    """Return errors with rotations in the user's unit of angle."""
    rms, largest = errors.rotation_rms, errors.rotation_max
    return replace(
        errors,
        rotation_rms=None if rms is None else rms / radian,
        rotation_max=None if largest is None else largest / radian,
    )


def _tried(kind: type, found: Any) -> dict[str, Any]:
    """The fields of a rounding, with what was tried; the rest is null."""
    return dict.fromkeys(names_of(kind)) | {
        "closes": found.solution is not None,
        "tried": found.tried,
        "combinations": found.combinations,
        "exhaustive": found.exhaustive,
        "reason": found.reason,
    }


def _rounded(
    solution: Solution, grid: float | None, stock: Sequence[float] | None, solutions: int, work: Work
) -> Rounded:
    """One of several solutions with links that can be had, in the motion's unit."""
    one, motion, limits, asked = solution.origin
    tries = max(FEWEST_TRIES, TRIES // solutions)
    if stock is None:
        assert grid is not None
        found = round_to_grid(motion.target, one, grid, limits, tries, work)
    else:
        found = best_from_stock(motion.target, one, stock, limits, tries, work)
    values, again = _tried(Rounded, found), found.solution
    if again is None:
        return Rounded(**values)
    if isinstance(asked, Poses):
        again = refined_in_place(asked, limits, again, motion.target.crank, work)
        target = target_of(asked, again.linkage, again.travel)
        motion = Motion.of(target, motion.degrees, motion.tolerances, motion.length_unit)
        values["crank_angle"] = in_turn(motion.target.crank, asked.ordered) / motion.radian
    linkage = Linkage.of(again.linkage, motion.radian, motion.target, motion.length_unit)
    dimensions = linkage.dimensions._asdict()
    del dimensions["branch"]
    values |= dimensions | {
        "errors": in_unit(again.errors, motion.radian),
        "transmission_angle_min": again.transmission_angle_min / motion.radian,
    }
    return Rounded(**values, linkage=linkage)
