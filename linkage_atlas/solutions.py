"""Solutions as users read them: linkages with their errors, verdict and studies, in the user's units."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from linkage_atlas.analysis import Analysis, analysed
from linkage_atlas.arguments import check_names
from linkage_atlas.assemblies import AskedAssembly, Assembly, assembled
from linkage_atlas.drive_design.design import driven_solution
from linkage_atlas.drive_design.records import AnySpring, Drive, Refusal
from linkage_atlas.geometry import AnyGuide, AtlasType, Dimensions, Links, Mount, dimensions_of
from linkage_atlas.linkages import Linkage
from linkage_atlas.motions import Motion
from linkage_atlas.notes import fault
from linkage_atlas.records import LAST, PYTHON_ONLY, Record, Values
from linkage_atlas.studies import STUDIES, Studies, read_studies
from linkage_atlas.tolerance_study import ToleranceStudy, share_of, studied
from synthesis import defects
from synthesis import solution as model
from synthesis.arrays import Floats
from synthesis.defects import shared_positions
from synthesis.errors import FieldError
from synthesis.excursions import excursion_faults, excursions_of
from synthesis.free.search import in_turn
from synthesis.limits import LINKS, PIVOTS, Limits, judged_limits
from synthesis.linkage import Linkage as Plain
from synthesis.poses import Poses, spin_faults
from synthesis.ranking import Errors
from synthesis.scores import passing, rotations_of, size_of
from synthesis.solution import target_of
from synthesis.studies import determination
from synthesis.studies.rounding import round_lengths
from synthesis.studies.sensitivity import Change, changes
from synthesis.target import Target
from synthesis.violations import practical_violations, touched
from synthesis.work import OutOfTime, Work

FINISHING = 0.1
"""Fraction of the budget by which a request may exceed it to finish the candidates of the search."""
_ALWAYS, _ALWAYS_SAMPLES = 8, 2048
"""Number of four-bars, and of their samples, that are described even if the time is up."""
_LEADERS = 3
"""Number of linkages of any kind that are, without long studies: the best and those with the smallest errors."""
_HELD = 1e-8
"""Objective below which no limit holds a linkage."""

TypeOf = Callable[[int], AtlasType]
"""Returns the type of a row of the atlas."""


@dataclass(frozen=True)
class Determination(Record):
    """Determination of each length of a four-bar by the motion."""

    ill_posed: bool
    """A length is not even fixed to a thousandth by the motion at this resolution."""
    resolution: float
    """Error of the motion that is considered: the objective, at least the tolerance; within limits the tolerance."""
    active_limits: tuple[str, ...]
    """Limits at whose bounds an inexact linkage lies: without them the error would be smaller."""
    length_uncertainty: Values
    """Relative change of crank, coupler, rocker, ground within that resolution; null: not determined at all, or not computed
    because limits keep the linkage from the motion."""


@dataclass(frozen=True, kw_only=True)
class Verdict(Record):
    """Check that a linkage works as a machine, not only at the samples."""

    order: bool
    """A drive that moves in one direction passes the samples in the requested order."""
    branch: bool
    """All samples lie on one branch."""
    circuit: bool
    """All samples, and all positions between them, lie on one circuit: nothing must be taken apart."""
    within_tolerance: bool | None
    """Every sample satisfies the tolerances; null without tolerances."""
    works: bool
    """True if the linkage can be used: no defect of order, branch or circuit, no change point near the motion, no two samples at
    the same position of the drive, and a path that does not leave the samples between them. Other linkages are ranked last."""
    practical: bool
    """No practical limit is violated; a limit of the request replaces the practical limit."""
    practical_without_collisions: bool | None
    """`practical`, and an assembly was found without collisions; null until an assembly was checked."""
    reasons: tuple[str, ...]
    """A sentence for each fault; samples count from 1."""
    assembly: Assembly | None = None
    """If requested: layers in which nothing collides; null if the drive does not carry the linkage through the samples."""

    @property
    def is_driven(self) -> bool:
        """True if the drive moves the linkage through the samples: no defect of order, branch or circuit."""
        return self.order and self.branch and self.circuit


class Origin(NamedTuple):
    """Model of a solution from which it is described."""

    found: model.Solution
    motion: Motion
    """With the travel of the solution's own drive as crank angles."""
    limits: Limits
    samples: Poses | Target
    """Samples of the request."""


@dataclass(frozen=True, kw_only=True)
class Rounded(Record):
    """Linkage whose lengths lie on a grid or are stock lengths; the rest is fitted again within the limits."""

    closes: bool
    """True if a combination of lengths closes within the limits; otherwise the dimensions and errors are null."""
    lengths: dict[str, float] | None = None
    """Radii of cranks, the coupler if two points of the body are guided, and the ground of a four-bar."""
    guides: list[AnyGuide] | None = None
    branch: Literal[-1, 1] | None = None
    start: float | None = None
    links: Links | None = None
    start_angle: float | None = None
    body_offset: float | None = None
    mount: Mount | None = None
    crank_angle: Floats | None = None
    """With free timing: angle of a crank or hinge at each sample."""
    travel: Floats | None = None
    """With free timing: travel of a slider or cylinder at each sample."""
    errors: Errors | None = None
    transmission_angle_min: float | None = None
    """Over the used interval."""
    combinations_examined: int
    """Number of combinations of lengths that were fitted."""
    combinations: int | None
    """Number of all combinations; null for a grid."""
    exhaustive: bool | None
    """True if this is the best of all combinations; null for a grid."""
    reason: str | None = None
    """Reason if no combination closes."""
    linkage: Linkage | None = field(default=None, metadata=PYTHON_ONLY)


@dataclass(frozen=True, kw_only=True)
class Solution(Dimensions):
    """Linkage that answers a request, with its errors; fields that its kind does not have are null.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> solution = la.synthesize([0, 12, 27, 45], crank_span=60, top=1).best
    >>> solution.kind, solution.verdict.works, solution.errors.objective < 1e-9
    ('four_bar', True, True)
    """

    rank: int
    """From 1, by the preference; see ``prefer`` of `synthesize`."""
    has_smallest_error: bool = False
    """True if it has the smallest error of the linkages that were found and can be used, up to 1 %."""
    source: Literal["atlas", "refined"]
    """A row of the atlas as it is, or a result of a search."""
    type: AtlasType | None
    """The row of the atlas, for a row as it is."""
    crank_angle: Floats | None = None
    """With free timing: angle of a crank or hinge at each sample from the first; in one direction for order `given`, in [0, 360)
    degrees for `any`."""
    travel: Floats | None = None
    """With free timing: travel of a slider or cylinder at each sample from the first."""
    errors: Errors
    verdict: Verdict
    excursion: float | None = None
    """With free timing: the largest length of the path of the body point between neighbouring samples over their distance, which
    counts as at least 5 % of the motion's extent."""
    size: float | None = None
    """Largest of the links or radii, body points, used slots, and distances of fixed pivots, pins and used rails from the middle
    of the motion, over its extent."""
    family: str | None
    """Grashof family of a four-bar."""
    transmission_angle_min: float
    """Over the used interval, exactly."""
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the drive does not turn fully."""
    arm_min: float | None
    """Smallest moment arm of the second guide's push about the driven guide's pin, over the used interval."""
    determination: Determination | None
    """Determination of a four-bar; null for other kinds, for which it is not computed."""
    sensitivity: list[Change] | None = None
    """If requested: rms change of the motion per unit of each dimension, all other dimensions held."""
    rounded: Rounded | None = None
    analysis: Analysis | None = field(default=None, repr=False)
    tolerance_study: ToleranceStudy | None = field(default=None, repr=False)
    drives: list[Drive] | None = field(default=None, repr=False, metadata=LAST)
    """The best of each requested kind."""
    refused: list[Refusal] | None = field(default=None, repr=False, metadata=LAST)
    """Reasons why there is no drive of a kind on a link."""
    springs: list[AnySpring] | None = field(default=None, repr=False, metadata=LAST)
    has_drive: bool | None = field(default=None, repr=False, metadata=LAST)
    """With `drive`: true if there is a drive."""
    linkage: Linkage = field(metadata=PYTHON_ONLY)
    """Linkage with methods to move, draw and save it."""
    origin: Origin = field(metadata=PYTHON_ONLY, repr=False)

    def studied(self, work: Work | None = None, **studies: object) -> Solution:
        """Return the solution with studies of it, under the names of the HTTP contract.

        Parameters
        ----------
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
        round_to : float
            Also report ``rounded``: the links at multiples of this length and the other dimensions fitted again, within the
            limits.
        lengths_from : array_like, shape (n,)
            Stock lengths from which the links are selected in the best combination, in place of ``round_to``.
        sensitivity : bool
            Also report the change of the motion per unit of each length.
        analysis : mapping
            Also report velocities and accelerations and, with a load, torque and pin forces: ``crank_speed`` and optionally
            ``load``, see `Linkage.analysis`.
        load : mapping
            Load for ``drives``, ``springs`` and ``drive``, see `linkage_atlas.drives`.
        drives : sequence of mapping
            Also report the best drive of each of these kinds, and in ``refused`` why a kind is missing.
        springs : sequence of mapping
            Also report springs that balance the load.
        drive : mapping
            Rank solutions with such a drive before solutions without (``has_drive``), and report the drive.
        tolerance_study : mapping
            Also report the effect of manufacturing tolerances, the arguments of `Linkage.tolerance_study`.
        assembly : mapping or True
            Also search for layers in which nothing collides (``verdict.assembly``), and rank solutions with such layers first:
            arguments of `Linkage.assembly`, or True for their defaults.

        Examples
        --------
        >>> import numpy as np, linkage_atlas as la
        >>> made = la.FourBar(19, 72, 144, 165, start_angle=30).joints(np.linspace(0, 70, 16))
        >>> motion = la.Motion(made.rotation, made.crank_pin, crank_span=70)
        >>> la.synthesize(motion, top=1).best.studied(round_to=1).rounded.closes
        True
        """
        check_names("", studies, STUDIES, "study")
        return _studied(self, read_studies(studies, self.origin.motion), 1, work or Work())

    def errors_in_words(self) -> str:
        """Return the largest errors at the samples in words, in the units of the motion."""
        return errors_in_words(self.errors, self.linkage.degrees)


# -- from candidates to solutions -----------------------------------------------------------------------------------------


def finished(
    found: Sequence[model.Solution],
    motion: Motion,
    limits: Limits,
    tolerance: float,
    studies: Studies,
    type_of: TypeOf | None,
    work: Work,
) -> list[Solution]:
    """Describe candidates as solutions with their studies, in their order.

    Once the time is up no further candidates are finished. The first is always finished, and without long studies so are the
    first few.
    """
    solutions: list[Solution] = []
    few = max(_LEADERS, min(_ALWAYS, _ALWAYS_SAMPLES // motion.samples.samples))
    four_bars = [candidate for candidate in found if candidate.linkage.is_four_bar]
    determinations = _determinations(four_bars, motion, limits, tolerance, few)
    practical = judged_limits(motion.samples, limits)
    for candidate in found:
        certain = 1 if studies.long else few if candidate.linkage.is_four_bar else _LEADERS
        if len(solutions) >= certain and work.expired():
            break
        determined = next(determinations) if candidate.linkage.is_four_bar else None
        solution = _described(candidate, determined, motion, limits, practical, type_of)
        solutions.append(_studied(solution, studies, len(found), work))
    return solutions


def _described(
    candidate: model.Solution,
    determined: Determination | None,
    motion: Motion,
    limits: Limits,
    practical: Limits,
    type_of: TypeOf | None,
) -> Solution:
    """Describe a candidate without studies."""
    samples, radian = motion.samples, motion.radian
    linkage, turn = candidate.linkage, candidate.transmission_angle_min_turn
    own = motion.over(linkage, candidate.travel)
    interval = own.target.interval
    passage = defects.verdict(linkage, linkage.start + candidate.travel, **passing(samples))
    faults = [fault(measure) for measure in practical_violations(candidate, own.target, practical)]
    excursion: float | None = None
    if isinstance(samples, Poses):
        (excursion,), (rotation,) = excursions_of([candidate], samples), rotations_of([candidate], samples)
        faults += [*excursion_faults(excursion), *spin_faults(samples, rotation)]
    kind = None if candidate.row is None or type_of is None else type_of(candidate.row)
    crank_angle, travel = _travel(samples, candidate, radian)
    return Solution(
        rank=0,
        source="refined" if kind is None else "atlas",
        type=kind,
        **vars(dimensions_of(linkage, radian, interval)),
        crank_angle=crank_angle,
        travel=travel,
        errors=in_unit(candidate.errors, radian),
        verdict=_judged(passage, own, linkage, faults),
        excursion=excursion,
        size=size_of(linkage, samples, candidate.interval),
        family=None if linkage.family is None else linkage.family.value,
        transmission_angle_min=candidate.transmission_angle_min / radian,
        transmission_angle_min_turn=None if turn is None else turn / radian,
        arm_min=linkage.arm_over(interval.after(linkage.start)),
        determination=determined,
        linkage=Linkage.of(linkage, radian, own.target, own.length_unit),
        origin=Origin(candidate, own, limits, samples),
    )


def _determinations(
    four_bars: Sequence[model.Solution], motion: Motion, limits: Limits, tolerance: float, at_once: int
) -> Iterator[Determination]:
    """Yield the determination of each four-bar; several are computed together."""
    samples, allowed = motion.samples, motion.tolerances
    resolution = tolerance if allowed is None else max(tolerance, allowed.objective(samples))
    held = [name for name, length in zip(LINKS, limits.links) if length is not None]
    held += [name for name in PIVOTS if getattr(limits, name) is not None]
    for chunk in (four_bars[first : first + at_once] for first in range(0, len(four_bars), at_once)):
        linkages, errors = [each.linkage for each in chunk], [each.errors.objective for each in chunk]
        resolutions = [max(error, tolerance) if limits.only_family else resolution for error in errors]
        target = model.targets_of(samples, linkages, np.array([each.travel for each in chunk]))
        determined = determination.determinations(target, linkages, resolutions, held)
        for candidate, error, fixed in zip(chunk, errors, determined):
            if limits.only_family or error < max(tolerance, _HELD):
                yield Determination(fixed.ill_posed, fixed.resolution, (), fixed.length_uncertainty)
            else:
                yield Determination(False, resolution, touched(candidate, samples, limits), np.full(4, np.nan))


def _travel(samples: Poses | Target, candidate: model.Solution, radian: float) -> tuple[Floats | None, Floats | None]:
    """Return the crank angles, or the travel, that were found with the linkage."""
    if not isinstance(samples, Poses):
        return None, None
    if candidate.linkage.driver.turns:
        return in_turn(candidate.travel, samples.ordered) / radian, None
    return None, candidate.travel


def _judged(passage: defects.Verdict, motion: Motion, linkage: Plain, faults: Sequence[str]) -> Verdict:
    """Return the verdict on a linkage at its own travel, with the tolerances."""
    reasons, within = list(passage.reasons), None
    if motion.tolerances is not None:
        shares = motion.tolerances.shares(motion.target, linkage)
        within, worst = bool(np.all(shares <= 1)), int(np.argmax(shares))
        if not within:
            reasons.append(
                f"sample {worst + 1} is off by {shares[worst]:.3g} times the tolerance, the largest ratio of all samples"
            )
    shared = shared_positions(motion.target, linkage.driver.turns) if motion.target.found and not within else []
    return verdict_of(passage, within, [*reasons, *faults, *shared], practical=not faults)


def verdict_of(passage: defects.Verdict, within: bool | None, reasons: Sequence[str], practical: bool) -> Verdict:
    """Return a verdict as a user reads it."""
    return Verdict(
        order=passage.order,
        branch=passage.branch,
        circuit=passage.circuit,
        within_tolerance=within,
        works=passage.order and passage.branch and passage.circuit,
        practical=practical,
        practical_without_collisions=None,
        reasons=tuple(reasons),
    )


# -- studies --------------------------------------------------------------------------------------------------------------


def _studied(solution: Solution, studies: Studies, solutions: int, work: Work) -> Solution:
    """Add studies to one of several solutions."""
    work.check()
    own, linkage = solution.origin.motion, solution.linkage
    done: dict[str, Any] = {}
    target = own.target
    if studies.sensitivity:
        done["sensitivity"] = changes(linkage.plain, target, own.radian)
    if studies.rounds:
        done["rounded"] = _rounded(solution, studies, solutions, work)
    if studies.analysis is not None:
        done["analysis"] = analysed(linkage.plain, studies.analysis, target.crank, own.radian, target.interval)
    if studies.drives is not None:
        done |= driven_solution(linkage.plain, target.way, studies.drives, own.radian, work)
    if studies.manufacture is not None:
        share = share_of(studies.manufacture, target.samples, solutions, work.budget)
        done["tolerance_study"] = studied(linkage.plain, share, target.crank, target.interval, own.radian, work)
    if studies.assembly is not None:
        done["verdict"] = _with_assembly(solution, studies.assembly, studies.arranged, work)
    return replace(solution, **done) if done else solution


def _rounded(solution: Solution, studies: Studies, solutions: int, work: Work) -> Rounded:
    """Return one of several solutions with lengths on a grid or from stock, in the motion's unit."""
    candidate, motion, limits, samples = solution.origin
    found = round_lengths(
        samples, candidate, limits, studies.round_to, studies.lengths_from, work, solutions=solutions
    )
    rounded = Rounded(
        closes=found.solution is not None,
        combinations_examined=found.tried,
        combinations=found.combinations,
        exhaustive=found.exhaustive,
        reason=found.reason,
    )
    if found.solution is None:
        return rounded
    refitted, radian = found.solution, motion.radian
    target = target_of(samples, refitted.linkage, refitted.travel)
    dimensions = dimensions_of(refitted.linkage, radian, target.interval)
    crank_angle, travel = _travel(samples, refitted, radian)
    return replace(
        rounded,
        lengths=refitted.linkage.lengths,
        **{name: value for name, value in vars(dimensions).items() if name not in ("kind", "driver")},
        crank_angle=crank_angle,
        travel=travel,
        errors=in_unit(refitted.errors, radian),
        transmission_angle_min=refitted.transmission_angle_min / radian,
        linkage=Linkage.of(refitted.linkage, radian, target, motion.length_unit),
    )


def _with_assembly(
    solution: Solution, request: AskedAssembly, arranged: Mapping[int, Assembly], work: Work
) -> Verdict:
    """Add the assembly to the verdict; the parts of a linkage that fails at the samples are not arranged."""
    verdict, (candidate, own, limits, _) = solution.verdict, solution.origin
    found: Assembly | None = None
    if not verdict.is_driven:
        why = ["layers were not searched for: the drive does not carry the linkage through the samples"]
    else:
        try:
            request = request.within(limits.envelope, limits.keep_out)
            found = arranged.get(id(candidate.linkage)) or assembled(
                candidate.linkage, request, own.target.interval, own.radian, work
            )
            why = [] if found.free else [f"layers: {found.reasons[0]}"]
        except FieldError as error:
            why = [f"layers were not searched for: {error}"]
        except OutOfTime:
            why = ["layers were not searched for: the time was up"]
    is_buildable = None if found is None else verdict.practical and found.free
    return replace(
        verdict, assembly=found, practical_without_collisions=is_buildable, reasons=(*verdict.reasons, *why)
    )


# -- words ----------------------------------------------------------------------------------------------------------------


def cognate_notes(solutions: Sequence[Solution]) -> list[str]:
    """Return a note for each pair of solutions that draw the same curve by Roberts' theorem."""
    pairs = itertools.combinations(solutions, 2)
    ranks = [(first.rank, second.rank) for first, second in pairs if first.linkage.is_cognate_of(second.linkage)]
    return [
        f"Solutions {a} and {b} are Roberts cognates: different linkages that draw the same curve." for a, b in ranks
    ]


def errors_in_words(errors: Errors, degrees: bool) -> str:
    """Return the largest errors in words: "rotation within 0.5 deg, position within 1.2"."""
    largest = {"rotation": errors.rotation_max, "position": errors.position_max}
    unit = {"rotation": " deg" if degrees else " rad", "position": ""}
    return ", ".join(f"{name} within {value:.3g}{unit[name]}" for name, value in largest.items() if value is not None)


def in_unit(errors: Errors, radian: float) -> Errors:
    """Return errors with rotations in the user's unit of angle."""
    if errors.rotation_rms is None or errors.rotation_max is None:
        return errors
    return replace(errors, rotation_rms=errors.rotation_rms / radian, rotation_max=errors.rotation_max / radian)
