"""What the search found, as a user reads it: solutions in the user's unit, with errors and verdicts."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkage_atlas.answers import Determination, Rounded, Solution, Verdict
from linkage_atlas.atlases import Atlas
from linkage_atlas.linkages import FourBar
from linkage_atlas.motions import MOST_STOCK, Motion, column, number
from linkage_atlas.records import names_of
from linkage_atlas.studies import Drive, Manufacture, analysed, share_of, studied
from synthesis.errors import FieldError
from synthesis.fourbar import solution as answers
from synthesis.fourbar.determination import Sensitivity, determinations, determinations_within, sensitivities
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.passage import Verdict as Passing
from synthesis.fourbar.passage import excursions, practical_faults, size_of, verdicts
from synthesis.fourbar.rounding import Rounding, best_from_stock, round_to_grid
from synthesis.free.answers import in_turn
from synthesis.free.poses import Poses
from synthesis.ranking import Errors, Status
from synthesis.target import MAX_LENGTH, MIN_LENGTH, TURN, Samples, Target
from synthesis.work import Work

Floats = NDArray[np.float64]

_AT_ONCE = 8
"""Solutions finished between two looks at the time; one where each is rounded."""


TRIES, FEWEST_TRIES = 4000, 40
"""Combinations of lengths that are fitted in all solutions of one request (about two seconds), and at least in each."""


@dataclass(frozen=True)
class Wishes:
    """What a request asks of each solution, beyond the linkage itself; None or False: not asked for.

    Attributes
    ----------
    limits : Limits
        What rounded links keep to.
    round_to : float or None
        A grid for the links.
    lengths_from : tuple of float or None
        Stock lengths for the links.
    sensitivity : bool
    drive : Drive or None
        Of an analysis.
    manufacture : Manufacture or None
        Of a tolerance study.
    """

    limits: Limits
    round_to: float | None = None
    lengths_from: tuple[float, ...] | None = None
    sensitivity: bool = False
    drive: Drive | None = None
    manufacture: Manufacture | None = None

    @property
    def long(self) -> bool:
        """Whether each solution takes long enough to look at the time after it."""
        return not (self.round_to is None and self.lengths_from is None and self.manufacture is None)

    def check_against(self, motion: Motion) -> None:
        """FieldError for wishes that this motion cannot have."""
        if self.round_to is not None and self.lengths_from is not None:
            raise FieldError("/lengths_from", "give either this or `round_to`")
        wishes = {"round_to": self.round_to, "lengths_from": self.lengths_from, "tolerance_study": self.manufacture}
        for name, wish in wishes.items():
            if wish is not None and motion.samples.position is None:
                raise FieldError(f"/{name}", "needs `position`: without it no length is actual")

    def rounded(self, target: Target, one: answers.Solution, solutions: int, work: Work) -> Rounding | None:
        """One of several solutions with lengths that can be had."""
        tries = max(FEWEST_TRIES, TRIES // solutions)
        if self.round_to is not None:
            return round_to_grid(target, one, self.round_to, self.limits, tries, work)
        if self.lengths_from is not None:
            return best_from_stock(target, one, self.lengths_from, self.limits, tries, work)
        return None


def read_lengths(lengths: ArrayLike | None) -> tuple[float, ...] | None:
    """Checked stock lengths."""
    if lengths is None:
        return None
    stock = column("lengths_from", lengths)
    if stock.ndim != 1 or not 1 <= stock.size <= MOST_STOCK:
        raise FieldError("/lengths_from", f"wanted 1 to {MOST_STOCK:,} lengths")
    for place, length in enumerate(stock):
        if not MIN_LENGTH <= number(f"lengths_from/{place}", length) <= MAX_LENGTH:
            raise FieldError(f"/lengths_from/{place}", f"wanted a length from {MIN_LENGTH:g} to {MAX_LENGTH:g}")
    return tuple(stock.tolist())


@dataclass(frozen=True)
class Tolerances:
    """Largest errors allowed at the samples, (N,) each: radians, and the user's unit of length; None: not limited."""

    rotation: Floats | None
    position: Floats | None

    def objective(self, samples: Samples) -> float:
        """The objective of a motion that is off by as much as is allowed at every sample."""
        square = 0.0
        if self.rotation is not None:
            square += float(np.mean(self.rotation**2))
        if self.position is not None:
            square += float(np.mean((self.position / samples.length_scale) ** 2))
        return float(np.sqrt(square))

    def kept(self, motion: Motion, one: answers.Solution) -> bool:
        """Whether every sample of a solution is inside."""
        target = motion.one_of(motion.with_angles([one.linkage], [one.crank]), 0).target
        return bool(np.all(self.shares(target, one.linkage) <= 1))

    def shares(self, target: Target, linkage: Linkage) -> Floats:
        """Each sample's largest error over what is allowed, (N,); a missing part counts as kept."""
        joints = linkage.joints(target.crank)
        share = np.zeros(target.samples)
        if self.rotation is not None and target.rotation is not None:
            off = target.rotation - joints.rotation
            if target.found:  # whole turns do not count
                off -= TURN * np.round(off / TURN)
            gap = target.rotation_mean.given(np.abs(off))
            share = np.maximum(share, gap / self.rotation)
        if self.position is not None and target.position is not None:
            assert joints.body_point is not None
            gap = target.position_mean.given(np.abs(target.position - joints.body_point))
            share = np.maximum(share, gap / self.position)
        return share


def read_tolerances(tolerances: Mapping[str, ArrayLike] | None, motion: Motion) -> Tolerances | None:
    """The tolerances of a request, checked against its motion."""
    given = {name: value for name, value in (tolerances or {}).items() if value is not None}
    samples, found = motion.asked, {}
    for name, value in given.items():
        if name not in ("rotation", "position"):
            raise FieldError(f"/tolerances/{name}", "there are tolerances of rotation and position only")
        if getattr(samples, name) is None:
            raise FieldError(f"/tolerances/{name}", f"limits errors of `{name}`, but there is none")
        numbers = column(f"tolerances/{name}", value)
        if numbers.ndim and numbers.shape != (samples.samples,):
            raise FieldError(f"/tolerances/{name}", f"wanted one or {samples.samples} numbers, found {numbers.size}")
        if np.any(bad := ~(np.isfinite(numbers) & (numbers > 0))):
            place = f"/{int(np.argmax(bad))}" if numbers.ndim else ""
            raise FieldError(f"/tolerances/{name}{place}", "wanted a number above 0")
        found[name] = np.broadcast_to(numbers, samples.samples) * (motion.radian if name == "rotation" else 1.0)
    return Tolerances(found.get("rotation"), found.get("position")) if found else None


def status_of(solutions: Sequence[Solution], tolerance: float, allowed: Tolerances | None, cut_short: bool) -> str:
    """What was found: reached where the best solution keeps the tolerances, or without any, where its objective is small."""
    if not solutions:
        return (Status.UNKNOWN if cut_short else Status.INFEASIBLE).value
    if allowed is not None:
        return (Status.REACHED if solutions[0].verdict.within_tolerance else Status.CLOSEST).value
    return (Status.REACHED if solutions[0].errors.objective < tolerance else Status.CLOSEST).value


def finished(
    found: list[answers.Solution],
    motion: Motion,
    tolerance: float,
    allowed: Tolerances | None,
    wishes: Wishes,
    atlas: Atlas | None,
    work: Work,
    by_error: bool = True,
) -> list[Solution]:
    """Solutions in the user's unit, with how well they are determined and what else was asked for.

    Where they are not ranked by their error they keep their order among those that work and keep the tolerances. Once the
    work's time is up no further ones are finished: those are left out. The first always is.
    """
    at_once = 1 if wishes.long else _AT_ONCE
    solutions: list[Solution] = []
    for first in range(0, len(found), at_once):
        if solutions and work.expired():
            break
        part = found[first : first + at_once]
        done, target = _finished(part, motion, tolerance, allowed, wishes, atlas)
        solutions += [
            _with_wishes(one, raw, motion.one_of(target, k), wishes, len(found), work)
            for k, (one, raw) in enumerate(zip(done, part))
        ]
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


def _finished(
    found: list[answers.Solution],
    motion: Motion,
    tolerance: float,
    allowed: Tolerances | None,
    wishes: Wishes,
    atlas: Atlas | None,
) -> tuple[list[Solution], Target]:
    """Some solutions without what was asked for beyond the linkage, and the motion with the crank angles of each."""
    linkages: list[Linkage] = [one.linkage for one in found]
    target = motion.with_angles(linkages, [one.crank for one in found])
    if wishes.limits.only_family:
        fixed = determinations(target, linkages, [max(one.errors.objective, tolerance) for one in found])
    else:
        resolution = tolerance if allowed is None else max(tolerance, allowed.objective(motion.samples))
        fixed = determinations_within(target, linkages, resolution, wishes.limits)
    changes: list[Any] = sensitivities(target, linkages) if wishes.sensitivity else [None] * len(found)
    passed, excursions = _passed(found, motion, target)
    solutions = [
        _solution(
            one,
            motion,
            motion.one_of(target, k),
            fixed[k],
            changes[k],
            passed[k],
            excursions[k],
            allowed,
            wishes.limits,
            atlas,
        )
        for k, one in enumerate(found)
    ]
    return solutions, target


def _passed(found: list[answers.Solution], motion: Motion, target: Target) -> tuple[list[Passing], list[Any]]:
    """How each solution passes the samples, and how far it leaves them in between where the crank angles were free."""
    linkages = [one.linkage for one in found]
    crank = np.array([one.start for one in linkages])[:, None] + target.crank
    side = np.broadcast_to(np.array([one.branch for one in linkages])[:, None], crank.shape)
    if not isinstance(motion.samples, Poses):
        return verdicts(linkages, crank, side, timed=True), [None] * len(found)
    way = {"ordered": motion.samples.ordered, "closed": motion.samples.closed}
    passed = verdicts(linkages, crank, side, **way)
    carried = [one.circuit for one in passed]
    return passed, excursions(linkages, crank, side, motion.samples.extent, **way, carried=carried)


def _solution(
    one: answers.Solution,
    motion: Motion,
    own: Motion,
    determined: Any,
    change: Any,
    passing: Passing,
    excursion: float | None,
    allowed: Tolerances | None,
    limits: Limits,
    atlas: Atlas | None,
) -> Solution:
    radian, turn = motion.radian, one.transmission_angle_min_turn
    if change is not None and change.rotation is not None:
        change = Sensitivity(change.rotation / radian, change.position)
    crank = None
    if isinstance(motion.samples, Poses):
        crank = in_turn(own.target.crank, motion.samples.ordered) / radian
    kind = None if one.row is None or atlas is None else atlas.type_of(one.row)
    linkage = FourBar.of(one.linkage, own)
    return Solution(
        rank=0,
        source="refined" if kind is None else "atlas",
        type=kind,
        **linkage.dimensions._asdict(),
        linkage=linkage,
        errors=_in_unit(one.errors, radian),
        family=one.family.value,
        transmission_angle_min=one.transmission_angle_min / radian,
        transmission_angle_min_turn=None if turn is None else turn / radian,
        condition=determined.condition,
        determination=Determination(
            determined.ill_posed, determined.resolution, determined.at_limits, determined.length_uncertainty
        ),
        sensitivity=change,
        verdict=_verdict(one, own.target, passing, excursion, allowed, limits),
        crank_angle=crank,
        excursion=excursion,
        size=size_of(one.linkage, motion.samples),
    )


def _with_wishes(
    done: Solution, one: answers.Solution, own: Motion, wishes: Wishes, solutions: int, work: Work
) -> Solution:
    """One of several solutions with what else was asked of it."""
    work.check()
    target, radian = own.target, own.radian
    interval, rounded = target.interval, wishes.rounded(target, one, solutions, work)
    analysis = study = None
    if wishes.drive is not None:
        analysis = analysed(one.linkage, wishes.drive, target.crank, radian, interval)
    if wishes.manufacture is not None:
        share = share_of(wishes.manufacture, target.samples, solutions)
        study = studied(one.linkage, share, target.crank, interval, radian, work)
    return replace(
        done,
        rounded=None if rounded is None else _rounded(rounded, own),
        analysis=analysis,
        tolerance_study=study,
    )


def _verdict(
    one: answers.Solution,
    target: Target,
    passing: Passing,
    excursion: float | None,
    allowed: Tolerances | None,
    limits: Limits,
) -> Verdict:
    reasons, within = list(passing.reasons), None
    if allowed is not None:
        shares = allowed.shares(target, one.linkage)
        within, worst = bool(np.all(shares <= 1)), int(np.argmax(shares))
        if not within:
            reasons.append(f"sample {worst + 1} is off by {shares[worst]:.3g} times what is allowed, the most of all")
    faults = practical_faults(one, target, limits, excursion)
    return verdict_of(passing, within, [*reasons, *faults], practical=not faults)


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
