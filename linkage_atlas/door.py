"""Which four-bars make a motion: `synthesize`.

Data flow: read the question; search for the best linkages by their error; where something else is preferred, search again
within tighter limits on that measure; finish them as a user reads them; report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypedDict, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.answers import (
    FINISHING,
    Report,
    Result,
    by_rounded,
    cognate_notes,
    errors_in_words,
    finished,
    in_unit,
    proportion_of,
    status_of,
)
from linkage_atlas.arguments import check_above_zero, check_top, column, number, pointing
from linkage_atlas.assemblies import read_assembly
from linkage_atlas.atlases import Atlas, as_atlas, default_atlas
from linkage_atlas.driving import check_asked
from linkage_atlas.kinds import (
    UNRANKED,
    Course,
    Found,
    Kinds,
    Rank,
    check_kinds_alone,
    check_sliders_alone,
    exact_below,
    finished_kinds,
    front,
    layers_of,
    measures_of,
    near_enough,
    proportionate,
    read_kinds,
    search_kinds,
    smaller_first,
    span_of,
    strays_between,
    target_of,
)
from linkage_atlas.limits import QUICK, QUICK_ROUNDS, read_limits, thinned, what_excludes
from linkage_atlas.linkages import DriverName, FourBar, KindName
from linkage_atlas.motions import Motion
from linkage_atlas.notes import counted, in_percent, limit_label, listed, sentences
from linkage_atlas.studies import STUDIES, Studies, check_lengths, check_rows, read_studies, study_notes
from synthesis.arrays import Floats
from synthesis.atlas.scan import Scan
from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import Family, wrap
from synthesis.fourbar.limits import Limits, Reach
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.fourbar.passage import proportion, size_of
from synthesis.fourbar.solution import Solution, assess, within
from synthesis.free.few_poses import is_few
from synthesis.free.poses import Poses
from synthesis.free.screen import PathScreen
from synthesis.free.search import path_screens, search_free
from synthesis.from_linkage import refine_motion, refine_poses
from synthesis.guided.search import NOTHING_ROUND
from synthesis.ranking import APART, FAIR, NEAR, PROPORTION, Status, distinct, spread
from synthesis.search.atlas_rows import best_rows
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.search.seeds import SeedTables
from synthesis.target import MAX_LENGTH, MIN_LENGTH, MIN_SPAN, TURN, Samples
from synthesis.work import Work

NUMERALS = {2: "two", 3: "three", 4: "four"}
"""Numbers of poses as words."""
DIVERSE_LOSS = 2.0
"""Times the best objective that the objectives of diverse solutions may be."""
UNASKED = (
    "With given {drive} the practical limits apply only if they are switched on (`limits.preset`): "
    "the verdict names those that the best linkage violates."
)
OUT_OF_PROPORTION = (
    "The linkage of least error (objective {error:.2g}) is out of all proportion: its largest part is {times:.2g} times the "
    "extent of the motion or the shortest link. Linkages within {fair:g} times come before it; only the error counts if the "
    "request declines the practical limits (`limits.preset`)."
)
FIRST_OUT_OF_PROPORTION = (
    "The {which} linkage is out of all proportion: its largest part is {times:.2g} times the extent of the motion or the "
    "shortest link. "
)
FAIR_FOUND = "The best linkage of fair size has the objective {:.2g}.", "No linkage of fair size was found."
"""With such a linkage, and without."""
SWINGS = (
    "Only linkages whose crank can turn fully were searched, but this motion takes no more than half a turn of it: "
    "linkages that only swing may come nearer if any family is allowed (`limits.family`)."
)
HOPELESS = (
    "No linkage that was found comes near this motion: the error of the best is {0:.2g} times that of a body at rest"
)
_HOPELESS = 0.5
"""Ratio to the error of a body at rest from which on a linkage is said not to make the motion."""
IN_ANY_ORDER = (
    "The samples go back and forth. In their order the best linkage meets them with {0}; in any order a linkage was found that "
    "meets them with {1} (`order`)."
)
_IN_ANY_ORDER = 0.5
"""Largest ratio of the error in any order to the error in the given order for which a note mentions the former."""
_BACK_AND_FORTH = 1.1
"""Smallest ratio of the way through the samples in their order to the shortest way for which they go back and forth."""
_HALF_TURN = np.pi
_SHIFTED = 1e-9
"""Radians that a body turns at most which is only shifted."""
ILL_POSED = (
    "The problem is ill-posed: lengths that differ by {0} make this motion about equally well "
    "(see `determination` of each solution)."
)
FEW_POSES = (
    "Infinitely many four-bars pass {0} poses exactly: those listed differ clearly from one another, and the first are compact "
    "with a good transmission angle. Add a pose, or limits, to narrow the choice."
)
_EXACT = 1e-6
"""Objective below which a linkage passes a few poses exactly."""
MAX_STARTS = 10
"""Maximum number of linkages in `start_from`."""
_FOR_STARTS = 0.6
"""Fraction of the budget for the refinement of the linkages of `start_from`."""
_LAYERED, _LAYERED_LEAST, _FOR_LAYERS = 3, 20, 0.3
"""Where layers are preferred: times as many linkages whose layers are compared, and at least so many; and the part of a budget
that is left for them."""
_ROUNDED_LEAST = 5
"""Linkages at least that are rounded, of which the best are answered: the nearest is seldom that of whole lengths."""
_POOL = 20
"""So many linkages more among which those in proportion are chosen."""
_VARIETY = 6
"""Times as many solutions among which diverse ones are chosen."""
Prefer = Literal["error", "size", "transmission", "crank_span", "layers"]
PREFER = get_args(Prefer)

_TRIES = 6
"""Searches at most."""
TRY_ROUNDS = 5
"""Rounds of each where the crank angles are free."""
_SMALLEST = 0.5
"""Extents of the motion below which no linkage is looked for."""
_SHARE = 0.35
"""Part of what is allowed at which a search ends: the largest error of a linkage is some two to three times its mean."""
FAR = 1e6
"""Largest ratio of a given linkage's lengths and distances to one another and to the motion's extent."""
SAME_LENGTHS = "{0} of {1} linkages are listed: the others have the same lengths once rounded, and a larger error."
LOCAL = (
    "The given linkage was refined to the nearest optimum that the descent reached: linkages elsewhere were not searched and "
    "may be better."
)
UNARRANGED = "The time was up: the layers of {0} of the {1} linkages that are near enough were not examined."
CUT_SHORT = "No linkage within the limits was found before the time was up; that does not prove that there is none."
NOWHERE = (
    "No descent from the given linkage led within the limits; that does not prove that there is no other linkage."
)
TIME_UP = "The time was up: only the best {0} of {1} found are reported."


StartingLinkage = Any
"""A `FourBar`, a `Solution` or `FunctionSolution`, or its plain values."""


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


class MotionAndStudies(TypedDict, total=False):
    """Arguments of a `Motion` by name, and studies of each solution as of `Solution.studied`."""

    rotation: ArrayLike | None
    position: ArrayLike | None
    crank_span: float | None
    crank_angle: ArrayLike | None
    timing: Literal["free"] | None
    order: Literal["given", "any"]
    closed: bool
    crank_span_max: float | None
    travel: ArrayLike | None
    travel_span: float | None
    weights: Mapping[str, ArrayLike] | None
    tolerances: Mapping[str, ArrayLike] | None
    length_scale: float | None
    degrees: bool
    round_to: float | None
    lengths_from: ArrayLike | None
    sensitivity: bool
    analysis: Mapping[str, Any] | None
    tolerance_study: Mapping[str, Any] | None
    load: Mapping[str, Any] | None
    drives: Sequence[Mapping[str, Any]] | None
    springs: Sequence[Mapping[str, Any]] | None
    drive: Mapping[str, Any] | None
    assembly: Mapping[str, Any] | bool | None


def synthesize(
    *motion: Motion | Mapping[str, Any] | ArrayLike | None,
    limits: Mapping[str, Any] | None = None,
    top: int = 10,
    effort: Literal["refine", "atlas"] = "refine",
    prefer: Prefer | None = None,
    diverse: bool = False,
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    refine_from: StartingLinkage | None = None,
    atlas: Atlas | str | Path | None = None,
    work: Callable[[float | None], Work] = Work,
    start_from: Sequence[StartingLinkage] | None = None,
    mechanisms: Sequence[KindName] | Literal["all"] | None = None,
    driver: DriverName | None = None,
    **more: Unpack[MotionAndStudies],
) -> Result:
    """The linkages that make a motion: actual dimensions and where they are mounted.

    Called as ``synthesize(motion, limits)``, or with the arguments of a `Motion` in its place:
    ``synthesize(rotation, position, crank_span=70)``.

    Parameters
    ----------
    *motion : Motion, or array_like
        What is wanted.
    limits : Limits or mapping, optional
        Within what, see `Limits`.
    top : int
        At most so many linkages, different from one another.
    effort : {"refine", "atlas"}
        The search, which refines to machine precision; or the best rows of ``atlas`` as they are.
    prefer : {"error", "size", "transmission", "crank_span", "layers"}, optional
        What is wanted of linkages inside the tolerances: the least error, the smallest links and reach, the best transmission
        angle, the shortest swing of the crank, or layers over whose fixed pivots nothing passes
        (``assembly`` is then asked for too). Default: "size" where there are tolerances, otherwise "error". Without
        tolerances those count whose error is at most a tenth above the least.
    diverse : bool
        Spread the solutions over families, branches and places, the objective at most twice the best, in place of the best ones.
    tolerance : float
        The search ends once the objective is below it.
    budget : float, optional
        Seconds; the best found by then is returned.
    refine_from : FourBar, Solution or mapping, optional
        Search nowhere, but refine this linkage (or its plain values, as `Solution.to_dict` gives them) from just there: one
        solution, its nearest optimum within the limits, of which nothing says that it is the best there is.
    atlas : Atlas, str or Path, optional
        For effort "atlas"; default: as for `match`.
    work : callable
        Makes what watches over time and cancellation from a budget in seconds.
    start_from : sequence of FourBar, Solution or mapping, optional
        Linkages to begin with, for example the one on show while a motion is changed. Each is refined to its nearest optimum
        within the limits before the search begins; ``report.continued`` has the rank of each result. With free timing each
        is a solution or its plain values, since its mount is needed.
    mechanisms : sequence of str or "all", optional
        Kinds of mechanism: "four_bar" (default alone), "slider_crank", "swinging_block", "rail_slot", "two_rails", "two_slots".
        Of several kinds those come back that no other one driven alike beats in error, size and transmission angle at once.
    driver : {"crank", "slider", "cylinder", "hinge"}, optional
        Only linkages that are driven so.
    **more
        Arguments of `Motion`, where it is not given; and studies of each solution, as of `Solution.studied`, within the budget.

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
    >>> la.synthesize(la.Motion(wanted, crank_span=70), la.Limits(link_ratio_max=12), top=1).status
    'reached'
    >>> la.synthesize(wanted, crank_span=70, top=1).status
    'reached'
    """
    if effort not in ("refine", "atlas"):
        raise FieldError("/effort", f"wanted 'refine' or 'atlas', found {effort!r}")
    if effort == "atlas" and refine_from is not None:
        raise FieldError("/refine_from", "rows of the atlas are not refined: only effort 'refine' does that")
    if start_from is not None and (effort == "atlas" or refine_from is not None):
        other = "effort 'atlas'" if effort == "atlas" else "refine_from"
        raise FieldError("/start_from", f"a search begins with these linkages, and with {other} there is none")
    check_top(top)
    check_above_zero(budget=budget)
    tolerance = number("tolerance", tolerance, 0.0)
    named: dict[str, Any] = dict(more)
    asked = {name: named.pop(name) for name in STUDIES if name in named}
    given: tuple[Any, ...] = motion
    if given and isinstance(given[0], Motion):
        wanted, limits = given[0], given[1] if len(given) > 1 else limits
        if named or len(given) > 2:
            raise TypeError(f"beside a Motion and its limits there is no {', '.join(named) or 'third argument'}")
    else:
        wanted = Motion(*given, **named)
    if effort == "atlas" and wanted.free:
        raise FieldError("/effort", "the atlas holds curves over crank angles: with free ones only 'refine' answers")
    kinds = read_kinds(mechanisms, driver, wanted)
    if not kinds.four_bars_alone:
        check_kinds_alone(effort, refine_from, start_from)
    # made once, by whoever asks first: no part of this request's time
    source: SeedTables | Scan | Start
    atlas = None if atlas is None else as_atlas(atlas)
    source = seed_tables() if effort == "refine" else (atlas := atlas or default_atlas()).scan
    watch = work(budget)
    notes, kept, studies = wanted.notes(), read_limits(limits, wanted), read_studies(asked, wanted)
    notes += _envelope_notes(wanted, kept)
    if refine_from is not None:
        source = read_start(refine_from, wanted.degrees)
        _check_start(source, wanted)
        notes.append(LOCAL)
    starts = [] if start_from is None else _read_starts(start_from, wanted)
    if studies.drives is not None:
        check_asked(studies.drives, wanted.radian)
    if studies.analysis is not None:
        check_rows(top, None if wanted.free else wanted.target.interval)
    question = _Question(
        wanted,
        kept,
        limits or {},
        _preference(prefer, wanted, isinstance(source, SeedTables)),
        tolerance,
        top,
        diverse and kinds.four_bars_alone,
        studies,
        _fair_within(limits, wanted, kept, source),
        watch,
    )
    if kinds.four_bars_alone:
        check_sliders_alone(kept)
        check_lengths(studies, kept)
        found, course, studies, look = _best_four_bars(question, source, starts)
    else:
        found, course, studies, look = _best_of_kinds(question, kinds)
    notes += course.notes
    searched, finishing = watch.elapsed, watch.extended(FINISHING)
    solutions: Any
    if kinds.four_bars_alone:
        type_of = None if atlas is None else atlas.type_of
        solutions = finished(found, wanted, kept, tolerance, studies, type_of, finishing, question.by_error)
    else:
        solutions = finished_kinds(found, wanted, kept, tolerance, studies, finishing)
    cut_short, refines = course.stopped_by == "budget", isinstance(source, Start)
    status = status_of(solutions, tolerance, wanted.tolerances is not None, cut_short or refines)
    if question.rounds:
        reported = min(len(solutions), top)
        found, solutions = found[:top], by_rounded(solutions, top, question.fair is not None)
        if same := reported - len(solutions):
            found = found[:-same]
            notes.append(SAME_LENGTHS.format(len(solutions), reported))
    if kinds.four_bars_alone and solutions and solutions[0].determination.ill_posed:
        few = isinstance(wanted.samples, Poses) and is_few(wanted.samples)
        few = few and solutions[0].errors.objective < max(tolerance, _EXACT)
        uncertainty = in_percent(solutions[0].determination.length_uncertainty)
        notes.append(FEW_POSES.format(NUMERALS[wanted.samples.samples]) if few else ILL_POSED.format(uncertainty))
    notes += _hopeless_notes(solutions, wanted)
    notes += _order_notes(question, solutions, look)
    notes += _unasked_notes(question, solutions)
    notes += _swing_notes(solutions, wanted, limits, tolerance)
    notes += study_notes(studies.manufacture, solutions)
    if kinds.four_bars_alone and wanted.samples.rotation is None:
        notes += cognate_notes(solutions)
    if not solutions and cut_short:
        notes.append(CUT_SHORT)
    elif not solutions and refines:
        notes.append(NOWHERE)
    elif not (solutions or kept.only_family or effort == "atlas" or set(notes) & set(NOTHING_ROUND.values())):

        def quick(eased: Limits, some: Work) -> tuple[Sequence[Found], Course]:
            return look(thinned(wanted), eased, max(tolerance, QUICK), some, QUICK_ROUNDS, 1)

        notes += what_excludes(kept, wanted, quick, watch, limits)
    if len(solutions) < len(found):
        notes.append(TIME_UP.format(len(solutions), counted(len(found), "linkage")))
    seconds = course.stages | {"report": watch.elapsed - searched, "total": watch.elapsed}
    report = Report(
        elapsed_ms={name: 1000 * value for name, value in seconds.items()},
        trace=[(1000 * value, objective) for value, objective in course.trace],
        stopped_by=course.stopped_by,
        length_scale=None if wanted.samples.position is None else wanted.samples.length_scale,
        notes=sentences(notes),
        continued=None if start_from is None else _ranks_of(course.continued, solutions),
        unseen=None if cut_short else course.unseen,
        **course.counts,
    )
    return Result(status, list(solutions), report)


Look = Callable[..., tuple[Sequence[Found], Course]]
"""A search for other motions and limits: ``look(motion, limits, goal, work, rounds, most)``."""
Answered = tuple[Any, Course, Studies, Look]
"""Linkages in the order of what is preferred, how they were found, studies of them, and how others are looked for."""


@dataclass(frozen=True)
class _Question:
    """What is searched for, checked."""

    motion: Motion
    limits: Limits
    given: Mapping[str, Any]
    """The limits as the request names them."""
    prefers: Prefer
    tolerance: float
    top: int
    diverse: bool
    studies: Studies
    fair: _Fair | None
    """See `_fair_within`."""
    watch: Work

    @property
    def by_error(self) -> bool:
        """Whether the least error is preferred."""
        return self.prefers == "error"

    @property
    def rounds(self) -> bool:
        """Whether solutions are ranked by what is left of them once their lengths are rounded."""
        return self.studies.rounds and self.by_error and not self.diverse

    def searching(self, less: float = 0.0) -> Work:
        """What watches over the search; ``less``: the part of the budget that is left for what comes after it."""
        return self.watch.extended(-FINISHING - less)


def _best_four_bars(question: _Question, source: SeedTables | Scan | Start, starts: Sequence[Start]) -> Answered:
    """Find the best four-bars."""
    wanted, kept, prefers, top = question.motion, question.limits, question.prefers, question.top
    studies, searching = question.studies, question.searching()
    goal = question.tolerance if question.by_error else goal_of(_allowed(wanted), question.tolerance)
    many = _VARIETY * top if question.diverse else top
    many = max(many, _ROUNDED_LEAST) if question.rounds else many
    wish = 0.0
    if prefers == "layers":
        many, wish = max(many, _LAYERED * top, _LAYERED_LEAST), _FOR_LAYERS
    many = 1 if isinstance(source, Start) else many

    def look(
        asked: Motion, within: Limits, near: float, work: Work, rounds: int | None = None, most: int = many
    ) -> tuple[list[Solution], Course]:
        return _search(source, asked, within, most, near, work, rounds)

    continued = [_continued(question, start, goal) for start in starts]
    pool = many + _POOL * bool(question.fair)
    found, course = _search(source, wanted, kept, pool, goal, question.searching(wish))
    if question.fair:
        work = question.searching(wish)
        found, course = _with_fair(found, course, source, wanted, question.fair, many, goal, work)
    if isinstance(source, SeedTables):
        found = [_drawn_near(one, wanted, kept) for one in found]
    if not found:
        pass
    elif prefers == "layers":
        least = max(found[0].errors.objective, goal)
        ranks, studies, course = _arranged(found, question, least, searching, course)
        found.sort(key=lambda one: (id(one) not in ranks, ranks.get(id(one), UNRANKED)))
        found = found if question.diverse else found[:top]
    elif not question.by_error:
        good = _improved(found, found[0].errors.objective, question, goal, look, searching)
        measure, near = _measure(prefers, wanted, kept).of, {id(one) for one in good}
        ranked = distinct(sorted(good, key=measure), many, APART, order=measure)
        found = (ranked + [one for one in found if id(one) not in near])[:many]
        course = course.ended_by(searching.expired())
    if question.diverse:
        found = spread(found, top, DIVERSE_LOSS, goal)
    if continued:
        found, continued = _with_continued(found, continued, many, question.by_error)
        course = course._replace(continued=continued)
    return found, course, studies, look


def _continued(question: _Question, start: Start, goal: float) -> Solution | None:
    """Refine a given linkage in its fraction of the time; return None if that leads to nothing within the limits."""
    work = question.searching()
    found, _ = _search(start, question.motion, question.limits, 1, goal, work.part(_FOR_STARTS * work.budget))
    return found[0] if found else None


def _with_continued(
    found: Sequence[Solution], continued: Sequence[Solution | None], top: int, by_error: bool
) -> tuple[list[Solution], list[Solution | None]]:
    """Return at most ``top`` linkages with those of ``continued`` among them, and those of ``continued`` as they are there.

    A linkage that was both found and continued is there once, with the smaller of its errors.
    """
    every, held = list(found), list(continued)
    for k, solution in enumerate(held):
        if solution is None:
            continue
        twin = next((other for other in every if len(distinct([other, solution], 2)) == 1), None)
        if twin is not None:
            if twin.errors.objective <= solution.errors.objective:
                held[k] = twin
                continue
            every.remove(twin)
            held = [solution if other is twin else other for other in held]
        worse = (j for j, other in enumerate(every) if other.errors.objective > solution.errors.objective)
        every.insert(next(worse, len(every)) if by_error else len(every), solution)
    others = [other for other in every if all(other is not one for one in held)]
    dropped = others[max(0, len(others) - max(0, len(every) - top)) :]
    return [one for one in every if all(one is not other for other in dropped)], held


def _ranks_of(continued: Sequence[Solution | None], solutions: Sequence[Any]) -> list[int | None]:
    """Return the rank of each linkage among the finished solutions; None if it is not there."""
    ranks = {id(solution.origin.found): solution.rank for solution in solutions}
    return [ranks.get(id(one)) for one in continued]


def _best_of_kinds(question: _Question, kinds: Kinds) -> Answered:
    """The best linkages of several kinds, or of others than four-bars, side by side."""
    motion, limits, prefers, top = question.motion, question.limits, question.prefers, question.top
    tolerance, fair = question.tolerance, question.fair
    studies, searching, layered = question.studies, question.searching(), prefers == "layers"

    def look(
        asked: Motion, within: Limits, goal: float, work: Work, rounds: int | None = None, most: int = top
    ) -> tuple[list[Found], Course]:
        def four_bars(within: Limits, work: Work, rounds: int | None) -> tuple[list[Solution], Course]:
            found, course = _search(seed_tables(), asked, within, top, goal, work, rounds)
            if fair and within is limits:
                return _with_fair(found, course, seed_tables(), asked, fair, top, goal, work)
            return found, course

        return search_kinds(kinds, asked, within, goal, four_bars, work, rounds)

    found, course = look(motion, limits, tolerance, question.searching(_FOR_LAYERS if layered else 0.0))
    many = max(_LAYERED * top, _LAYERED_LEAST) if layered else top
    if fair and found:
        best = smaller_first(found, motion.samples)[0]
        found = proportionate(found, motion.samples, tolerance, fair.most)
        if found[0] is not best:
            found = [one for one in found if proportion_of(one, motion.samples) <= fair.most]
    chosen = front(found, motion, limits, prefers, tolerance, many)
    if not chosen:
        pass
    elif layered:
        least = max(tolerance, min(one.errors.objective for one in chosen))
        ranks, studies, course = _arranged(chosen, question, least, searching, course)
        chosen = front(chosen, motion, limits, prefers, tolerance, top, ranks)
    elif not question.by_error:
        goal, least = goal_of(_allowed(motion), tolerance), min(one.errors.objective for one in chosen)
        found += _improved(chosen, least, question, goal, look, searching)
        chosen = front(found, motion, limits, prefers, tolerance, top)
        course = course.ended_by(searching.expired())
    return chosen, course, studies, look


def _hopeless_notes(solutions: Sequence[Any], motion: Motion) -> list[str]:
    """Return that the best linkage does not make the motion, with the limits that hold it."""
    if not solutions or solutions[0].verdict.within_tolerance:
        return []
    best, at_rest = solutions[0], motion.asked.error_at_rest(modulo_turn=motion.free)
    if not at_rest or (ratio := best.errors.objective / at_rest) <= _HOPELESS:
        return []
    limits = best.determination.at_limits if best.kind == "four_bar" else ()
    held = f"; it is held by {listed([limit_label(name) for name in limits])}" if limits else ""
    return [f"{HOPELESS.format(ratio)}{held}."]


def _order_notes(question: _Question, solutions: Sequence[Any], look: Look) -> list[str]:
    """Return the errors of a linkage that passes jumbled samples in any order, if they are much smaller."""
    motion, samples = question.motion, question.motion.samples
    if (
        not (solutions and isinstance(samples, Poses) and samples.ordered)
        or samples.closed
        or motion.travel is not None
    ):
        return []
    best = solutions[0]
    if best.verdict.within_tolerance or best.errors.objective <= NEAR or samples.detour < _BACK_AND_FORTH:
        return []
    any_order = Motion.of(replace(samples, ordered=False, span_max=TURN), motion.degrees, motion.tolerances)
    found, _ = look(any_order, question.limits, question.tolerance, question.watch, None, 1)
    if not found:
        return []
    nearest = min(found, key=lambda one: one.errors.objective)
    if nearest.errors.objective > _IN_ANY_ORDER * best.errors.objective:
        return []
    errors = in_unit(nearest.errors, motion.radian)
    ordered, any_way = (errors_in_words(found, motion.degrees) for found in (best.errors, errors))
    return [IN_ANY_ORDER.format(ordered, any_way)]


def _unasked_notes(question: _Question, solutions: Sequence[Any]) -> list[str]:
    """That the practical limits were not kept, where nobody said so and the best linkage breaks one."""
    motion = question.motion
    if (motion.free and motion.travel is None) or "preset" in question.given:
        return []
    if not solutions or solutions[0].verdict.practical:
        return []
    return [UNASKED.format(drive="crank angles" if motion.travel is None else "travel")]


def _envelope_notes(motion: Motion, limits: Limits) -> list[str]:
    """That a position lies outside of the box that the body point must not leave."""
    box, asked = limits.envelope, motion.asked
    if box is None or asked.position is None:
        return []
    given = np.isfinite(asked.position) & (True if asked.position_weights is None else asked.position_weights > 0)
    x, y = asked.position.real, asked.position.imag
    beyond = np.hypot(
        np.maximum(np.maximum(box[0] - x, x - box[2]), 0), np.maximum(np.maximum(box[1] - y, y - box[3]), 0)
    )
    out = np.flatnonzero(given & (beyond > 0))
    if not out.size:
        return []
    worst = int(out[np.argmax(beyond[out])])
    missed = f"missed by at least {beyond[worst]:.4g} (`limits.envelope`)"
    if out.size == 1:
        return [f"The position of sample {worst + 1} lies outside the envelope and is {missed}."]
    return [f"{out.size} positions lie outside the envelope; that of sample {worst + 1} is {missed}."]


def _swing_notes(
    solutions: Sequence[Any], motion: Motion, limits: Mapping[str, Any] | None, tolerance: float
) -> list[str]:
    """That four-bars which only swing were not looked at, where they would do and none that turns fully is good enough."""
    if not motion.free or (limits or {}).get("family") is not None or not isinstance(motion.samples, Poses):
        return []
    best = next((one for one in solutions if one.kind == "four_bar"), None)
    if best is None or motion.samples.closed or not motion.samples.ordered or best.crank_angle is None:
        return []
    if solutions[0].verdict.within_tolerance or any(one.errors.objective < tolerance for one in solutions):
        return []
    return [SWINGS] if np.ptp(best.crank_angle) * motion.radian <= _HALF_TURN else []


# -- the search -------------------------------------------------------------------------------------------------------


def _search(
    source: SeedTables | Scan | Start,
    motion: Motion,
    limits: Limits,
    top: int,
    tolerance: float,
    work: Work,
    rounds: int | None = None,
) -> tuple[list[Solution], Course]:
    """The best linkages: by the search with free crank angles or with given ones, from the atlas, or from a given linkage."""
    counts: dict[str, Any] = {"seeds": None, "windows": None, "exhaustive": None}
    if isinstance(source, Scan):
        found, scanned = best_rows(source, motion.target, limits, top, work, tolerance)
        searched = work.elapsed
        trace = [(searched, found[0].errors.objective)] if found else []
        reached = Status.of(found, tolerance) is Status.REACHED
        stopped_by = "tolerance" if reached else ("converged" if scanned.exhaustive else "budget")
        counts |= {"windows": scanned.windows, "exhaustive": scanned.exhaustive}
        return found, Course({"screen": searched}, trace, stopped_by, counts)
    samples = motion.samples
    if isinstance(source, Start):
        with pointing_to_start(source.place):
            if isinstance(samples, Poses):
                found, report = refine_poses(samples, limits, source.linkage, source.crank, tolerance, work)
            else:
                found, report = refine_motion(samples, limits, source.linkage, tolerance, work)
    elif isinstance(samples, Poses):
        found, report = search_free(samples, limits, top, tolerance, work, screens, source.windows, rounds)
    else:
        found, report = search(source, samples, limits, top, tolerance, work)
        found = smaller_first(found, samples)
    stages = {"screen": report.screen_seconds, "refine": work.elapsed - report.screen_seconds}
    counts["seeds"] = report.seeds
    return found, Course(stages, report.trace, report.stopped_by.value, counts, report.unseen)


class _Fair(NamedTuple):
    """Within what linkages of fair size are looked for."""

    limits: Limits
    most: float
    """Extents of the motion, or shortest links, that their longest part is at most."""


def _fair_within(given: Mapping[str, Any] | None, motion: Motion, limits: Limits, source: Any) -> _Fair | None:
    """Limits within which linkages are of fair size, where a search keeps none because nobody said which.

    Where a length or ratio that is given allows more, all that is in proportion is fair: what is wider gives nothing worse.
    """
    if motion.free or "preset" in (given or {}) or isinstance(source, Scan):
        return None
    samples, units = motion.samples, {"link_ratio_max": 1.0}
    if samples.position is not None:
        units |= dict.fromkeys(("link_max", "coupler_radius_max"), samples.extent)
    allowed = {name: getattr(limits, name) for name in units}
    wider = any(allowed[name] is not None and allowed[name] > FAIR * unit for name, unit in units.items())
    most = PROPORTION if wider else FAIR
    if isinstance(source, Start) and proportion(source.linkage, samples) > most:  # it comes back no worse
        return None
    lengths: dict[str, Any] = {name: min(most * unit, allowed[name] or np.inf) for name, unit in units.items()}
    if samples.position is not None:
        far = most * samples.extent
        lengths["pivot_reach"] = Reach(complex(samples.position_mean(samples.position)), far, far)
    try:
        return _Fair(replace(limits, **lengths), most)
    except FieldError:  # a limit of its own excludes them
        return None


def _drawn_near(one: Solution, motion: Motion, limits: Limits) -> Solution:
    """A linkage whose body is only shifted, as a parallelogram's, beside the motion: any of its points goes the same way.

    As it was where that breaks a limit or saves nothing.
    """
    samples, linkage = motion.samples, one.linkage
    if samples.position is None or one.family is not Family.CHANGE_POINT:
        return one
    target = target_of(one, motion)
    at = linkage.joints(target.crank)
    assert at.body_point is not None
    if not np.ptp(at.coupler_angle) <= _SHIFTED:
        return one
    # the crank pin's way to the body point, and either pivot's to the motion's middle, are to be short
    ways = at.body_point[0] - at.crank_pin[0], samples.middle - at.pivot_a, samples.middle - at.pivot_b
    moved = complex(np.mean(ways))
    arm = (ways[0] - moved) * np.exp(-1j * at.coupler_angle[0])
    point = float(abs(arm)), wrap(float(np.angle(arm)))
    near = assess(target, [linkage.placed(linkage.pivot_a + moved, linkage.ground_angle, point)])
    for other in within(target, limits, near):
        gained = (size_of(other.linkage, samples) or 0.0) < (size_of(linkage, samples) or 0.0)
        if gained and abs(other.errors.objective - one.errors.objective) <= _SHIFTED:
            return replace(other, crank=one.crank)
    return one


def _as_it_is(_: object) -> int:
    """An order that changes none."""
    return 0


def _with_fair(
    found: list[Solution],
    course: Course,
    source: SeedTables | Scan | Start,
    motion: Motion,
    fair: _Fair,
    top: int,
    tolerance: float,
    work: Work,
) -> tuple[list[Solution], Course]:
    """What a search found, as `proportionate` orders it; where the best is out of all proportion, with linkages of fair size."""
    if not found:
        return found, course
    samples, exact, again = motion.samples, exact_below(motion.samples, tolerance), course

    def least_fair() -> float:
        """The least error of those of fair size."""
        errors = [one.errors.objective for one in found if proportion_of(one, samples) <= fair.most]
        return min(errors, default=np.inf)

    if proportion_of(found[0], samples) > PROPORTION and (
        found[0].errors.objective >= exact or least_fair() == np.inf
    ):
        more, again = _search(source, motion, fair.limits, top, tolerance, work)
        found = smaller_first(found + more, samples)
    best, ranked = found[0], proportionate(found, samples, tolerance, fair.most)
    error, times, least, said = best.errors.objective, proportion_of(best, samples), least_fair(), ""
    if ranked[0] is not best:
        said = OUT_OF_PROPORTION.format(error=error, times=times, fair=fair.most)
        course = course._replace(unseen=again.unseen, stopped_by=again.stopped_by)
    elif times > PROPORTION and least >= tolerance:
        said = FIRST_OUT_OF_PROPORTION.format(which="exact" if error < exact else "best", times=times)
        said += FAIR_FOUND[0].format(least) if least < np.inf else FAIR_FOUND[1]
    chosen = distinct(ranked, top, APART, _as_it_is, tolerance)
    if top > 1 and all(one is not best for one in chosen):  # left out, for it looks like those before it
        chosen[1:] = [best, *chosen[1:]][: top - 1]
    return chosen, course._replace(notes=[*course.notes, said] if said else course.notes)


# -- what is preferred ------------------------------------------------------------------------------------------------


class _Measure(NamedTuple):
    """A measure of which less is better."""

    of: Callable[[Any], float]
    """Of a linkage of any kind."""
    tightened: Callable[[float], tuple[Motion, Limits]]
    """The request in which it is at most so large."""
    least: float
    """It is never less."""
    near: float
    """Two values of which one is this much larger, as a part or where `least` is not positive outright, are as good."""


def _preference(prefer: str | None, motion: Motion, searches: bool) -> Prefer:
    """What is preferred; ``searches`` says whether linkages are searched for, and not taken from a table or a given one."""
    positions = motion.samples.position is not None
    if prefer is None:
        return "size" if motion.tolerances is not None and searches and positions else "error"
    for name in PREFER:
        if name != prefer:
            continue
        if name != "error" and not searches:
            raise FieldError("/prefer", "linkages are not searched for here, so that only 'error' has a meaning")
        if name == "size" and not positions:
            raise FieldError("/prefer", "'size' needs `position`: only positions fix the size of a linkage")
        if name == "crank_span" and (not motion.free or motion.travel is not None):
            raise FieldError("/prefer", "the crank angles or the travel are given: all linkages turn alike far")
        return name
    raise FieldError("/prefer", f"wanted one of {', '.join(PREFER)}, found {prefer!r}")


def _allowed(motion: Motion) -> float | None:
    return None if motion.tolerances is None else motion.tolerances.objective(motion.samples)


def goal_of(allowed: float | None, tolerance: float) -> float:
    """The objective at which a search for linkages that are near enough may end."""
    return tolerance if allowed is None else max(tolerance, _SHARE * allowed)


def _improved(
    found: Sequence[Any], least: float, question: _Question, goal: float, look: Look, work: Work
) -> list[Any]:
    """Linkages that are near enough, of any kinds: those of some found, and better ones by a measure.

    The same search within a tighter limit on the measure, half way to what is known to be out of reach, finds better ones or
    none, and the limit is tighter or looser next time. ``least``: J that is near.
    """
    motion, limits = question.motion, question.limits
    near = near_enough(motion, least := max(least, goal))
    goal = goal if motion.tolerances is not None else least
    steady = _steady(motion, limits)
    if any(map(steady, filter(near, found))):  # what strays between samples is not preferred, however small
        close = near

        def near(one: Any) -> bool:
            return close(one) and steady(one)

    measure = _measure(question.prefers, motion, limits)
    good = list(filter(near, found))
    best, out_of_reach = min(map(measure.of, good), default=np.inf), measure.least
    for _ in range(_TRIES):
        if work.expired() or not np.isfinite(best) or _as_good(best, out_of_reach, measure):
            break
        middle = np.sqrt(best * out_of_reach) if measure.least > 0 else (best + out_of_reach) / 2
        try:
            asked = measure.tightened(float(middle))
        except FieldError:  # another limit excludes it
            more = []
        else:
            more = list(filter(near, look(*asked, goal, work, TRY_ROUNDS)[0]))
        if more:
            good += more
            best = min(best, *map(measure.of, more))
        else:
            out_of_reach = float(middle)
    return good


def _steady(motion: Motion, limits: Limits) -> Callable[[Any], bool]:
    """Whether the body of a linkage stays between samples, where that counts: within the practical limits."""
    samples = motion.samples
    if not limits.practical or not isinstance(samples, Poses) or samples.position is None:
        return lambda _: True
    return lambda one: not strays_between([one], samples)[0]


def _arranged(
    found: Sequence[Any], question: _Question, least: float, work: Work, course: Course
) -> tuple[dict[int, Rank], Studies, Course]:
    """How the layers of linkages rank, by id, of those that are near enough; the studies with them; the search with its notes."""
    motion, limits, studies = question.motion, question.limits, question.studies
    asked = studies.assembly or read_assembly(True)
    assert asked is not None
    ranks, made, left = layers_of(found, motion, least, asked.within(limits.envelope, limits.keep_out), work)
    said = [UNARRANGED.format(left, len(ranks))] if left else []
    course = course.ended_by(bool(said))._replace(notes=[*course.notes, *said])
    return ranks, studies._replace(assembly=asked, arranged=made), course


def _as_good(best: float, other: float, measure: _Measure) -> bool:
    return best <= other * (1 + measure.near) if measure.least > 0 else best - other <= measure.near


def _measure(prefer: Prefer, motion: Motion, limits: Limits) -> _Measure:
    samples = motion.samples

    def smaller(extents: float) -> tuple[Motion, Limits]:
        assert samples.position is not None
        far, reach = extents * samples.extent, limits.pivot_reach
        links = [length for length in (limits.link_max, far) if length is not None]
        radii = [length for length in (limits.coupler_radius_max, far) if length is not None]
        places = [
            min(far, place) if reach and (place := getattr(reach, name)) else far for name in ("pivot_a", "pivot_b")
        ]
        middle = complex(samples.position_mean(samples.position))
        return motion, replace(
            limits,
            link_max=min(links),
            coupler_radius_max=min(radii),
            pivot_reach=Reach(middle, places[0], places[1], None if reach is None else reach.body),
        )

    def straighter(minus: float) -> tuple[Motion, Limits]:
        return motion, replace(limits, transmission_angle_min=-minus)

    def shorter(span: float) -> tuple[Motion, Limits]:
        assert isinstance(samples, Poses)
        return Motion.of(
            replace(samples, span_max=span), motion.degrees, motion.tolerances, motion.length_unit
        ), limits

    return {
        "size": _Measure(lambda one: measures_of(one, samples, 0.0).size, smaller, _SMALLEST, 0.03),
        "transmission": _Measure(lambda one: -one.transmission_angle_min, straighter, -np.pi / 2, np.deg2rad(1.0)),
        "crank_span": _Measure(span_of, shorter, MIN_SPAN, 0.03),
    }[prefer]


# -- the linkage that is refined --------------------------------------------------------------------------------------


class Start(NamedTuple):
    """A linkage to refine, in radians."""

    linkage: Linkage
    crank: Floats | None = None
    """(N,): its crank angles at the samples, from the first."""
    offset: float | None = None
    """Of a function generator: the output less the rocker's angle."""
    place: str = "refine_from"
    """The argument that holds it."""


def pointing_to_start(place: str = "refine_from") -> AbstractContextManager[None]:
    """Make errors of the linkage's fields point into an argument."""

    def within(field: str) -> str:
        link = field.lstrip("/") in ("crank", "coupler", "rocker", "ground")
        return f"/{place}{'/links' if link else ''}{field}"

    return pointing(within)


def read_start(given: StartingLinkage, degrees: bool, place: str = "refine_from") -> Start:
    """Read a linkage to refine: a `FourBar`, a solution, or the plain values of either in the request's unit of angle.

    Raises
    ------
    FieldError
        With the field within the argument ``place``.
    """
    if isinstance(given, FourBar):
        return _checked(given, place)
    if isinstance(given, Mapping):
        with pointing_to_start(place):
            try:
                linkage = FourBar.from_dict(given, degrees)
            except (KeyError, TypeError, ValueError) as error:
                if isinstance(error, FieldError):
                    raise
                raise FieldError("", "wanted links (crank, coupler, rocker, ground), branch, start_angle") from None
        crank, offset = given.get("crank_angle"), given.get("output_offset")
    else:
        found: Any = getattr(given, "linkage", None)
        crank, offset = getattr(given, "crank_angle", None), getattr(given, "output_offset", None)
        if not isinstance(found, FourBar):
            raise FieldError(f"/{place}", "wanted a FourBar, a solution, or its plain values")
        linkage = found
    radian = np.pi / 180 if linkage.degrees else 1.0
    angles = None if crank is None else column(f"{place}/crank_angle", crank) * radian
    if angles is not None and not np.isfinite(angles).all():
        raise FieldError(f"/{place}/crank_angle", "wanted finite numbers")
    own = None if offset is None else number(f"{place}/output_offset", offset) * radian
    return _checked(linkage, place)._replace(crank=angles, offset=own)


def _checked(given: FourBar, place: str) -> Start:
    """A linkage whose numbers can be computed with, its angles within a turn."""
    one = given.plain
    for name, length in zip(("crank", "coupler", "rocker", "ground"), one.links):
        if not MIN_LENGTH <= length <= MAX_LENGTH:
            field = f"/{place}/links/{name}"
            raise FieldError(field, f"wanted a length from {MIN_LENGTH:g} to {MAX_LENGTH:g}, found {length:g}")
        if length * FAR < max(one.links):
            raise FieldError(f"/{place}/links/{name}", f"wanted no link more than {FAR:g} times another")
    point = one.coupler_point
    for name, angles in (("start_angle", one.start), ("mount/ground_angle", one.ground_angle)):
        number(f"{place}/{name}", angles)
    if point is not None and not (np.isfinite(point).all() and point[0] >= 0):
        raise FieldError(f"/{place}/mount/coupler_point", "wanted a radius of at least 0 and an angle")
    return Start(replace(one, start=one.start % TURN, ground_angle=wrap(one.ground_angle)), place=place)


def _read_starts(given: Sequence[StartingLinkage], motion: Motion) -> list[Start]:
    """Read the linkages of ``start_from``."""
    if not 1 <= len(given) <= MAX_STARTS:
        raise FieldError("/start_from", f"wanted 1 to {MAX_STARTS} linkages, found {len(given)}")
    starts = []
    for k, linkage in enumerate(given):
        start = read_start(linkage, motion.degrees, f"start_from/{k}")
        if start.crank is not None and start.crank.shape != (motion.asked.samples,):  # samples were added or removed
            start = start._replace(crank=None)
        _check_start(start, motion)
        starts.append(start)
    return starts


def _check_start(begin: Start, motion: Motion) -> None:
    """FieldError for a linkage that this motion cannot be refined from."""
    one, asked = begin.linkage, motion.asked
    if motion.free:
        if not one.mounted:
            raise FieldError(f"/{begin.place}/mount", "needed, with its coupler point: the crank angles are free")
        if begin.crank is not None and begin.crank.shape != (asked.samples,):
            found = begin.crank.size
            raise FieldError(f"/{begin.place}/crank_angle", f"wanted {asked.samples} crank angles, found {found}")
    if asked.position is not None and one.mounted:
        _check_place(one, asked, begin.place)


def _check_place(one: Linkage, samples: Samples, place: str) -> None:
    """FieldError for a linkage that is too far from the positions, too large or too small beside them."""
    assert samples.position is not None and one.coupler_point is not None
    scale = samples.length_scale
    if abs(one.pivot_a - complex(samples.position_mean(samples.position))) > FAR * scale:
        raise FieldError(f"/{place}/mount/pivot_a", f"lies farther than {FAR:g} times the motion's extent from it")
    if max(one.coupler_point[0], *one.links) > FAR * scale or min(one.links) * FAR < scale:
        raise FieldError(f"/{place}/links", f"wanted lengths within {FAR:g} times the motion's extent, either way")
