"""Function generation: linkages whose output is a required function of their input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, check_above_zero, check_top
from linkage_atlas.functions.dials import RealFunction
from linkage_atlas.functions.notes import function_notes
from linkage_atlas.functions.question import FunctionFields, FunctionQuestion
from linkage_atlas.functions.results import FunctionResult, FunctionSolution
from linkage_atlas.functions.solutions import described, rounded
from linkage_atlas.notes import sentences
from linkage_atlas.result_notes import NO_DESCENT_WITHIN_LIMITS, NOTHING_FOUND_IN_TIME, PRACTICAL_LIMITS_OFF
from linkage_atlas.results import Report
from linkage_atlas.solutions import FINISHING
from linkage_atlas.task import seed_tables
from linkage_atlas.warm_start import FOR_STARTS, Start, StartingLinkage, check_refine_only, read_starts
from synthesis.errors import FieldError
from synthesis.function.answers import Generator
from synthesis.function.generators import best_built, generate, generate_with, is_sized
from synthesis.function.quick_return import crank_rocker_answers, slider_crank_answers
from synthesis.function.search import FunctionTask
from synthesis.function.symmetric import symmetric_question
from synthesis.function.travel_laws import laws_for
from synthesis.local_refinement import refine_function
from synthesis.ranking import APART, Status, distinct
from synthesis.search.report import SearchReport, StoppedBy, stopped_by
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.work import Work


def function(
    output: ArrayLike | RealFunction | None = None,
    crank_span: float | None = None,
    *,
    input: ArrayLike | None = None,
    interval: ArrayLike | None = None,
    output_span: float | None = None,
    samples: int | None = None,
    function: Fields | None = None,
    quick_return: Fields | None = None,
    steering: Fields | None = None,
    symmetric: bool = False,
    objective: Literal["rms", "max"] = "rms",
    input_zero: float | None = None,
    output_zero: float | None = None,
    weights: ArrayLike | None = None,
    one_way: bool = False,
    degrees: bool = True,
    travel_span: float | None = None,
    input_unit: Literal["deg", "rad", "length"] | None = None,
    output_unit: Literal["deg", "rad", "length"] | None = None,
    mechanisms: Sequence[str] | Literal["all"] | None = None,
    limits: Fields | None = None,
    top: int = 10,
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    round_to: float | None = None,
    start_from: Sequence[StartingLinkage] | None = None,
    refine_only: bool = False,
    sensitivity: bool = False,
    curves: bool = False,
    work: Callable[[float | None], Work] = Work,
) -> FunctionResult:
    """Find linkages whose output is a required function of their input: four-bars, or linkages with sliders if it has travel.

    Parameters
    ----------
    output : array_like, shape (N,), or callable, optional
        Rocker angles, or travel, at 2 to 1,024 samples, continuous, up to a constant; falling values move against a rising input.
        In Python also a callable of arrays or numbers: a function y = f(x) with linear scales of input and output.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    input : array_like, shape (N,), optional
        Crank angles, or travel, in place of the span; only the increments from the first value count.
    interval : array_like, shape (2,), optional
        First and last x of a callable, between which the crank turns by ``crank_span``.
    output_span : float, optional
        Angle of the rocker between the smallest and the largest y of a callable; negative: the rocker turns clockwise from the
        first sample to the last.
    samples : int, optional
        Number of samples of a callable, 3 to 1,024 (101).
    function : mapping, optional
        Function by ``name`` in place of ``output``: log10, ln, exp, power (with ``exponent``), sin, cos, tan (x in the unit of
        angle) or reciprocal; ``x`` is [first, last]. Or ``table``: [[x, y], ...]. The rocker turns by ``output_span`` from the
        smallest to the largest y, at ``samples`` samples (101).
    quick_return : mapping, optional
        Motion there and back in place of ``output``: ``time_ratio``, the duration of the slow over the fast
        motion, and ``stroke`` for a slider-crank or ``swing`` (an angle) for a crank-rocker. The crank turns evenly and fully.
    steering : mapping, optional
        Ackermann's condition in place of ``output``: ``track`` (distance of the kingpins), ``wheelbase`` and ``angle``, the
        largest angle of an inner wheel. The linkage is symmetric, and its ground is the track.
    symmetric : bool
        True if left and right arm are mirror images. ``input`` and ``output`` are both needed, and measured from the symmetric
        position. Arms are between 0.1 and 0.2 of the ground unless ``limits`` give lengths.
    objective : {"rms", "max"}
        Minimise the root of the mean square error at the samples, or the largest error over the whole interval.
    input_zero, output_zero : float, optional
        Prescribed input and output at the first sample: angles from the ground line A->B or from the rail, the position of a
        slider, or the length of a cylinder. Default: the best.
    weights : array_like, shape (N,), optional
        Weights of at least 0 of the squared errors, or for "max" of the errors, linear between the samples.
    one_way : bool
        True if the rocker must not turn back within the interval.
    degrees : bool
        Unit of all angles; False: radians.
    travel_span : float, optional
        Travel from the first sample to the last, in place of ``crank_span``, if the input is a length.
    input_unit, output_unit : {"deg", "rad", "length"}, optional
        "length": the input, or the output, is the travel of a slider or cylinder. Default: angles of crank and rocker.
    mechanisms : sequence of str, or "all", optional
        Kinds of linkages: "four_bar" from angle to angle; "slider_crank" and "swinging_block" (a cylinder between two pins) from
        angle to length and back; "rail_slot" (a slotted lever) from length to angle; "two_rails" (two sliders and a rod) from
        length to length. Default: the first kind that fits.
    limits : mapping, optional
        Limits on shape and lengths. The family is "any" by default, which closes over the interval.
        Lengths are given as links: {"ground": 100, ...}; the ground is 1 unless it is given.
        With travel: transmission_angle_min, link_min, link_max, link_ratio_max, links (crank, coupler for the rod, ground),
        offset (of the rail from the crank pivot) and preset.
    top : int
        Maximum number of linkages, which differ from one another.
    tolerance : float
        The search ends once the objective is below this value.
    budget : float, optional
        Time in seconds; the best linkages found by then are returned.
    round_to : float, optional
        Grid of lengths: each solution is also given with rounded links and zeros fitted again; needs limits.links.ground.
    start_from : sequence of Linkage, FunctionSolution or mapping, optional
        Four-bars that are candidates from the first step, for example solutions of a reply. Each is refined to its nearest
        optimum within the limits before the search begins.
    refine_only : bool
        Search nowhere else: only the linkages of ``start_from`` are refined, which need not lead to the best linkage.
    sensitivity : bool
        Also compute the change of the output per unit of each length.
    curves : bool
        Also return the error of each solution over the interval, made output minus wanted output: ``error_curve``.
    work : callable
        Maker of the object that watches time and cancellation, from a budget in seconds.

    Returns
    -------
    FunctionResult
        Linkages, best first, with a report.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> table = {"name": "log10", "x": [1, 2], "output_span": 90}
    >>> found = la.function(function=table, crank_span=60, objective="max", limits={"transmission_angle_min": 30}, top=1)
    >>> round(found.best.errors.max, 4)
    0.0469
    >>> la.function(lambda x: x**1.5, 90, interval=(1, 4), output_span=90, top=1).status
    'closest'
    """
    arguments = locals()
    check_top(top)
    check_above_zero(budget=budget, round_to=round_to)
    question = FunctionFields.of(arguments).question()
    refine_only = check_refine_only(refine_only, start_from)
    if question.dial.travels or quick_return is not None or steering is not None:
        only_angles: dict[str, object] = {"start_from": start_from}
        if question.dial.travels:
            only_angles |= {"round_to": round_to, "sensitivity": sensitivity or None}
        kind = "from angle to angle" if question.dial.travels else "by pairs or a name"
        if foreign := [name for name, value in only_angles.items() if value is not None]:
            raise FieldError(f"/{foreign[0]}", f"applies only to functions {kind}; leave it out")
    if round_to is not None and question.limits.limits.links[3] is None:
        raise FieldError("/round_to", "needs the length of the ground (`limits.links.ground`), which fixes the size")
    starts = read_starts(start_from, degrees)
    if foreign_start := next((start for start in starts if not start.linkage.is_four_bar), None):
        raise FieldError(
            f"/{foreign_start.field}", "must be a four-bar, because only four-bars make functions from angle to angle"
        )
    watch = work(budget)
    candidates, course = _searched(question, starts, refine_only, max(top, 2), watch)
    searched, found = watch.elapsed, candidates[:top]
    solutions = described(question, found, sensitivity, curves)
    if round_to is not None:
        for index, (solution, generator) in enumerate(zip(solutions, found)):
            assert isinstance(solution, FunctionSolution)
            solutions[index] = replace(solution, rounded=rounded(question, generator, round_to, watch))
    notes = function_notes(question, candidates, solutions, course.settled, refine_only)
    if not question.has_preset and solutions and not solutions[0].verdict.practical:
        notes.append(PRACTICAL_LIMITS_OFF.format(case="For functions"))
    status = Status.of(found, question.tolerance).value
    if not solutions and (refine_only or course.stopped_by == "budget"):
        status = "unknown"
        notes.append(NO_DESCENT_WITHIN_LIMITS if refine_only else NOTHING_FOUND_IN_TIME)
    report = Report.of(course, searched, watch.elapsed, sentences(notes))
    return FunctionResult(
        status,
        solutions,
        question.function.crank / question.scales.input,
        question.function.output / question.scales.output,
        None if question.dials is None else question.dials.x,
        None if question.dials is None else question.dials.y,
        report,
        question,
    )


def _searched(
    question: FunctionQuestion, starts: Sequence[Start], refine_only: bool, count: int, watch: Work
) -> tuple[list[Generator], SearchReport]:
    """Search for linkages by the method that the question allows."""
    work, quick = watch.extended(-FINISHING), question.quick
    task = question.task(work)
    if quick is not None:
        answers = slider_crank_answers if question.dial.travels else crank_rocker_answers
        return _closed_form(answers(task.target, quick.alpha, task.limits, count), work)
    if question.symmetric_from is not None:
        target, law, limits = symmetric_question(task.target, question.symmetric_from, task.limits.limits)
        return generate_with([law], task._replace(target=target, limits=limits), count)
    if question.dial.travels:
        return generate_with(laws_for(question.kinds, *question.dial), task, count)
    refined, course = _refined(question.task(work if refine_only else work.part(FOR_STARTS * work.budget)), starts)
    if refine_only:
        return refined, course
    found, course = generate(seed_tables(), task, count)
    if starts:
        merged = distinct([*refined, *found], len(refined) + len(found), APART)
        found = best_built(task.target, merged, count, task.tolerance, is_sized(task.limits))
    return found, course


def _refined(task: FunctionTask, starts: Sequence[Start]) -> tuple[list[Generator], SearchReport]:
    """Refine given four-bars in turn; return their nearest optima, best first, and how it went."""
    found, reports = list[Generator](), list[SearchReport]()
    for start in starts:
        results, report = refine_function(task, start.linkage, start.offset)
        found += results
        reports.append(report)
    found = distinct(found, max(1, len(found)), APART)
    joined = SearchReport.joined(reports) if reports else SearchReport(StoppedBy.CONVERGED, [])
    return found, joined._replace(stopped_by=stopped_by(found, task.tolerance, task.work))


def _closed_form(found: list[Generator], work: Work) -> tuple[list[Generator], SearchReport]:
    """Return answers with the report of a search that is finished once they are known."""
    trace = [(work.elapsed, min(generator.errors.objective for generator in found))] if found else []
    return found, SearchReport(StoppedBy.CONVERGED, trace, 0.0, len(found))
