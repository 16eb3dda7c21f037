"""Which four-bars make a motion: `synthesize`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Literal, NamedTuple

from numpy.typing import ArrayLike

from linkage_atlas.answers import FINISHING, Report, Result
from linkage_atlas.atlases import Atlas
from linkage_atlas.cache import default_atlas
from linkage_atlas.finish import Wishes, cognate_notes, finished, read_lengths, read_tolerances, status_of
from linkage_atlas.limits import read_limits, what_excludes
from linkage_atlas.motions import Motion, check_above_zero, check_top, number
from linkage_atlas.preferred import TRY_ROUNDS, Prefer, goal_of, improved, read_prefer
from linkage_atlas.refining import LOCAL, NOWHERE, Beginning, Given, check_against, read_beginning, refined
from linkage_atlas.studies import check_rows, read_drive, read_manufacture, study_notes
from synthesis.atlas.best import best_rows
from synthesis.atlas.scan import Scan
from synthesis.errors import FieldError
from synthesis.fourbar import solution as answers
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.free.poses import Poses
from synthesis.free.screen import PathScreen
from synthesis.free.search import path_screens, search_free
from synthesis.ranking import Status, spread
from synthesis.search.search import DEFAULT_TOLERANCE, StoppedBy, search
from synthesis.search.seeds import SeedTables
from synthesis.work import Work

DIVERSE_LOSS = 2.0
"""Times the best objective that the objectives of diverse solutions may be."""
UNASKED = (
    "the crank angles are given, and then the practical limits are kept only where `limits.preset` asks for them; "
    "the verdict says which of them the best linkage breaks"
)
_VARIETY = 6
"""Times as many solutions among which diverse ones are chosen."""


@cache
def seed_tables() -> SeedTables:
    """The coarse tables of the search; made by the first that asks."""
    return SeedTables(FOURBAR)


@cache
def screens(family: str) -> tuple[PathScreen, ...]:
    """What paths without crank angles are compared with; made by the first that asks."""
    return path_screens(family)


def prepare() -> None:
    """Make now what the first request would make: the coarse tables of the searches (about 0.3 s)."""
    seed_tables()
    screens("full_crank")


def synthesize(
    rotation: ArrayLike | None = None,
    position: ArrayLike | None = None,
    crank_span: float | None = None,
    *,
    crank_angle: ArrayLike | None = None,
    timing: Literal["free"] | None = None,
    order: Literal["given", "any"] = "given",
    closed: bool = False,
    crank_span_max: float | None = None,
    weights: Mapping[str, ArrayLike] | None = None,
    tolerances: Mapping[str, ArrayLike] | None = None,
    prefer: Prefer | None = None,
    degrees: bool = True,
    limits: Mapping[str, Any] | None = None,
    top: int = 10,
    effort: Literal["refine", "atlas"] = "refine",
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    length_scale: float | None = None,
    round_to: float | None = None,
    lengths_from: ArrayLike | None = None,
    diverse: bool = False,
    refine_from: Given | None = None,
    sensitivity: bool = False,
    analysis: Mapping[str, Any] | None = None,
    tolerance_study: Mapping[str, Any] | None = None,
    atlas: Atlas | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Result:
    """The four-bar linkages that make a motion: actual dimensions and where they are mounted.

    Parameters
    ----------
    rotation : array_like, shape (N,), optional
        Rotation of the body at the samples, continuous: no jumps by whole turns (where the crank angles are free, whole
        turns do not count). None: missing there.
    position : array_like, shape (N, 2), or complex, shape (N,), optional
        A point of the body at the samples, in any unit. At least one of the two is needed; 3 to 1,024 samples (2 with free
        crank angles). None: missing there.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    crank_angle : array_like, shape (N,), optional
        Crank angles in place of ``crank_span``; what counts is the increment from the first.
    timing : {"free"}, optional
        In place of both: the crank angles are unknown, and each solution has its own.
    order : {"given", "any"}
        With free crank angles: whether the crank must pass the samples in the order given, turning one way, either way.
    closed : bool
        With free crank angles: whether the way leads from the last sample on to the first.
    crank_span_max : float, optional
        With free crank angles: the crank turns by no more than this from the first sample to the last.
    weights : mapping, optional
        ``rotation`` and ``position``, (N,) each, at least 0: what each sample counts. Default: all alike.
    tolerances : mapping, optional
        ``rotation`` and ``position``, a number or (N,) each: the largest errors allowed. The status is then "reached" when
        every sample is inside, and solutions that keep them come first.
    prefer : {"error", "size", "transmission", "crank_span"}, optional
        What is wanted of linkages inside the tolerances: the least error, the smallest links and reach, the best transmission
        angle or the shortest swing of the crank. Default: "size" where there are tolerances, otherwise "error". Without
        tolerances those count whose error is at most a tenth above the least.
    degrees : bool
        Unit of every angle in and out; False: radians.
    limits : mapping, optional
        transmission_angle_min, transmission_angle_min_turn; pivot_a, pivot_b [x, y], pivot_box, pivot_a_box, pivot_b_box
        [xmin, ymin, xmax, ymax], keep_out (boxes); link_min, link_max, link_ratio_max, links {"crank": length, ..};
        coupler_radius_max, envelope (a box); family: full_crank (default), crank_rocker, double_crank or any; preset:
        "practical", see the limits' page of the documents.
    top : int
        At most so many linkages, different from one another.
    effort : {"refine", "atlas"}
        The search, which refines to machine precision; or the best rows of ``atlas`` as they are.
    tolerance : float
        The search ends once the objective is below it.
    budget : float, optional
        Seconds; the best found by then is returned.
    length_scale : float, optional
        Weighs position errors against rotation errors in radians; default: the largest distance from the mean position.
    round_to : float, optional
        Also give each solution with its links on this grid and the rest fitted anew, within the limits.
    lengths_from : array_like, shape (n,), optional
        Instead: with each link of one of these lengths, in the best combination.
    diverse : bool
        Spread the solutions over families, branches and places, the objective at most twice the best, in place of the best ones.
    refine_from : FourBar, Solution or mapping, optional
        Search nowhere, but refine this linkage (or its plain values, as `Solution.to_dict` gives them) from just there: one
        solution, its nearest optimum within the limits, of which nothing says that it is the best there is.
    sensitivity : bool
        Also give the change of the motion per unit of each length.
    analysis : mapping, optional
        ``crank_speed`` and perhaps ``load``, as of `FourBar.analysis`: also give velocities, accelerations and forces.
    tolerance_study : mapping, optional
        ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``, as of `FourBar.tolerance_study`: also give what tolerances of
        manufacture do.
    atlas : Atlas, optional
        For effort "atlas"; default: as for `match`.
    work : callable
        Makes what watches over time and cancellation from a budget in seconds.

    Returns
    -------
    Result

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import numpy as np, linkage_atlas as la
    >>> wanted = la.FourBar(19, 72, 144, 165, start_angle=30).joints(np.linspace(0, 70, 16)).rotation
    >>> la.synthesize(wanted, crank_span=70, top=1).status
    'reached'
    """
    if effort not in ("refine", "atlas"):
        raise FieldError("/effort", f"wanted 'refine' or 'atlas', found {effort!r}")
    if effort == "atlas" and refine_from is not None:
        raise FieldError("/refine_from", "rows of the atlas are not refined: only effort 'refine' does that")
    if effort == "atlas" and timing is not None:
        raise FieldError("/effort", "the atlas holds curves over crank angles: with free ones only 'refine' answers")
    if effort == "atlas" and atlas is None:
        atlas = default_atlas()
    check_top(top)
    check_above_zero(budget=budget, round_to=round_to)
    tolerance = number("tolerance", tolerance, 0.0)
    begin = None if refine_from is None else read_beginning(refine_from, degrees)
    # made once, by whoever asks first: no part of this request's time
    prepared = begin or (atlas.scan if effort == "atlas" and atlas is not None else seed_tables())
    watch = work(budget)
    motion = Motion.of(
        rotation,
        position,
        crank_span,
        crank_angle,
        length_scale,
        degrees,
        timing=timing,
        order=order,
        closed=closed,
        weights=weights,
        crank_span_max=crank_span_max,
    )
    notes, kept = motion.notes(), read_limits(limits, motion)
    allowed = read_tolerances(tolerances, motion)
    wishes = Wishes(
        kept,
        round_to,
        read_lengths(lengths_from),
        sensitivity,
        None if analysis is None else read_drive(analysis, motion.samples.position is not None),
        None if tolerance_study is None else read_manufacture(tolerance_study),
    )
    wishes.check_against(motion)
    if begin is not None:
        check_against(begin, motion)
        notes.append(LOCAL)
    if wishes.drive is not None:
        check_rows(top, None if motion.free else motion.target.interval)
    wanted = read_prefer(prefer, motion, allowed is not None, begin is None and effort == "refine")
    goal = (
        tolerance
        if wanted == "error"
        else goal_of(None if allowed is None else allowed.objective(motion.samples), tolerance)
    )
    searching, many = watch.extended(-FINISHING), _VARIETY * top if diverse else top
    found, went = _searched(motion, kept, many, goal, searching, prepared)
    if wanted != "error":
        found = improved(
            found,
            motion,
            kept,
            wanted,
            None if allowed is None else lambda one: allowed.kept(motion, one),
            goal,
            many,
            lambda other, tight, near: _searched(other, tight, many, near, searching, prepared, TRY_ROUNDS)[0],
            searching,
        )
        if searching.expired():
            went = went._replace(stopped_by=StoppedBy.BUDGET.value)
    if diverse:
        found = spread(found, top, DIVERSE_LOSS, goal)
    searched = watch.elapsed
    solutions = finished(
        found, motion, tolerance, allowed, wishes, atlas, watch.extended(FINISHING), wanted == "error"
    )
    if solutions and solutions[0].determination.ill_posed:
        notes.append(
            "the problem is ill-posed: quite different linkages give this motion to within the resolution; "
            "see `determination` of each solution"
        )
    if not motion.free and "preset" not in (limits or {}) and solutions and not solutions[0].verdict.practical:
        notes.append(UNASKED)
    notes += study_notes(wishes.manufacture, solutions)
    notes += cognate_notes(solutions) if motion.samples.rotation is None else []
    cut_short = went.stopped_by == "budget"
    if not solutions and begin is not None and not cut_short:
        notes.append(NOWHERE)
    elif not solutions and not kept.only_family and effort == "refine" and not cut_short:
        notes += what_excludes(
            kept, motion, lambda limits, some: _searched(motion, limits, 3, tolerance, some, prepared), watch
        )
    elif not solutions and cut_short:
        notes.append("nothing within the limits was found before the search was cut short; that proves nothing")
    if len(solutions) < len(found):
        notes.append(f"the time was up: of {len(found)} linkages found the best {len(solutions)} are reported")
    total = watch.elapsed
    return Result(
        status_of(solutions, tolerance, allowed, cut_short or begin is not None),
        solutions,
        Report(
            elapsed_ms={
                name: 1000 * seconds
                for name, seconds in (went.stages | {"report": total - searched, "total": total}).items()
            },
            trace=[(1000 * seconds, objective) for seconds, objective in went.trace],
            stopped_by=went.stopped_by,
            length_scale=None if motion.samples.position is None else motion.samples.length_scale,
            notes=notes,
            **went.counts,
        ),
    )


class _Went(NamedTuple):
    """How a search went, whichever it was."""

    stages: dict[str, float]
    """Seconds."""
    trace: list[tuple[float, float]]
    stopped_by: str
    counts: dict[str, Any]


def _searched(
    motion: Motion,
    limits: Limits,
    top: int,
    tolerance: float,
    work: Work,
    prepared: SeedTables | Scan | Beginning,
    rounds: int | None = None,
) -> tuple[list[answers.Solution], _Went]:
    """The best linkages: by the search with free crank angles or with given ones, from the atlas, or from a given linkage."""
    counts: dict[str, Any] = {"seeds": None, "windows": None, "exhaustive": None}
    if not isinstance(prepared, Scan):
        if isinstance(prepared, Beginning):
            found, went = refined(motion, limits, prepared, tolerance, work)
        elif isinstance(motion.samples, Poses):
            found, went = search_free(motion.samples, limits, top, tolerance, work, screens, prepared.windows, rounds)
        else:
            found, went = search(prepared, motion.target, limits, top, tolerance, work)
        stages = {"screen": went.screen_seconds, "refine": work.elapsed - went.screen_seconds}
        return found, _Went(stages, went.trace, went.stopped_by.value, counts | {"seeds": went.seeds})
    found, scanned = best_rows(prepared, motion.target, limits, top, work, tolerance)
    searched = work.elapsed
    trace = [(searched, found[0].errors.objective)] if found else []
    reached = Status.of(found, tolerance) is Status.REACHED
    stopped_by = "tolerance" if reached else ("converged" if scanned.exhaustive else "budget")
    counts |= {"windows": scanned.windows, "exhaustive": scanned.exhaustive}
    return found, _Went({"screen": searched}, trace, stopped_by, counts)
