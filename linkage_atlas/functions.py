"""Function generation as a user asks for it: pairs of angles, or a function by name, and limits, checked by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.answers import FINISHING
from linkage_atlas.door import seed_tables
from linkage_atlas.generators import Asked, FunctionReport, FunctionResult, described, rounded
from linkage_atlas.limits import read_function_limits
from linkage_atlas.motions import check_above_zero, check_top, column, number, radians_in
from linkage_atlas.named import Dials, read_dials
from linkage_atlas.refining import LOCAL, NOWHERE, Beginning, Given, named, read_beginning
from synthesis.errors import FieldError
from synthesis.function.search import generate
from synthesis.function.wanted import Wanted
from synthesis.local.function import refine_function
from synthesis.ranking import Status
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.target import make_target
from synthesis.work import Work

_CALLED = {
    "/function": "/output",
    "/function/x": "/interval",
    "/function/output_span": "/output_span",
    "/function/samples": "/samples",
}
"""Where the arguments of a callable are told of."""
_STEEP = 8.0
"""A step of the output this many times as steep as any other is called a jump."""


def function(
    output: ArrayLike | Callable[[Any], Any] | None = None,
    crank_span: float | None = None,
    *,
    input: ArrayLike | None = None,
    interval: ArrayLike | None = None,
    output_span: float | None = None,
    samples: int | None = None,
    function: Mapping[str, Any] | None = None,
    objective: Literal["rms", "max"] = "rms",
    input_zero: float | None = None,
    output_zero: float | None = None,
    weights: ArrayLike | None = None,
    one_way: bool = False,
    degrees: bool = True,
    limits: Mapping[str, Any] | None = None,
    top: int = 10,
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    round_to: float | None = None,
    refine_from: Given | None = None,
    sensitivity: bool = False,
    curves: bool = False,
    work: Callable[[float | None], Work] = Work,
) -> FunctionResult:
    """The four-bar linkages whose rocker's angle is a wanted function of the crank's.

    Parameters
    ----------
    output : array_like, shape (N,), or callable, optional
        Rocker angles at the samples, continuous, up to a constant; falling ones turn against a rising input. 3 to 1,024.
        Or y = f(x) on two linear dials: a callable of arrays or of numbers.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    input : array_like, shape (N,), optional
        Crank angles in place of ``crank_span``; what counts is the increment from the first.
    interval : array_like, shape (2,), optional
        Of a callable: first and last x, which ``crank_span`` is for.
    output_span : float, optional
        Of a callable: how far the rocker turns from the least y to the largest, negative: clockwise from the first sample to
        the last.
    samples : int, optional
        Of a callable: how many, 3 to 1,024 (101).
    function : mapping, optional
        In place of ``output``: a function by ``name``, one of log10, ln, exp, power (with ``exponent``), sin, cos, tan (x in
        the unit of angle), reciprocal; ``x`` is [first, last]. Or ``table``: [[x, y], ...]. ``output_span`` and ``samples`` as
        of a callable.
    objective : {"rms", "max"}
        Make least the root of the mean square at the samples, or the largest error over the whole interval.
    input_zero, output_zero : float, optional
        The crank angle at the first sample, and the rocker angle that is wanted there, both from the ground line A->B.
        Default: as they are best.
    weights : array_like, shape (N,), optional
        At least 0: what each squared error counts, or for "max" each error, linear between the samples.
    one_way : bool
        The rocker must not turn back within the interval.
    degrees : bool
        Unit of every angle in and out; False: radians.
    limits : mapping, optional
        family ("any": closes over the interval, the default; full_crank, crank_rocker, double_crank),
        transmission_angle_min, transmission_angle_min_turn (where the crank turns fully), link_ratio_max, link_min,
        link_max, links ({"ground": 100, ...}: lengths that are given; a ground that is not is 1), preset ("practical").
    top : int
        At most so many linkages, different from one another.
    tolerance : float
        The search ends once the objective is below it.
    budget : float, optional
        Seconds; the best found by then is returned.
    round_to : float, optional
        Also give each solution with its links on this grid and the zeros fitted anew; needs limits.links.ground.
    refine_from : FourBar, FunctionSolution or mapping, optional
        Search nowhere, but refine this linkage (or its plain values, as `FunctionSolution.to_dict` gives them) from just
        there: one solution, its nearest optimum within the limits, of which nothing says that it is the best there is.
    sensitivity : bool
        Also give the change of the output per unit of each length.
    curves : bool
        Also give each solution's error over the interval.
    work : callable
        Makes what watches over time and cancellation from a budget in seconds.

    Returns
    -------
    FunctionResult

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> asked = {"name": "log10", "x": [1, 2], "output_span": 90}
    >>> found = la.function(function=asked, crank_span=60, objective="max", limits={"transmission_angle_min": 30}, top=1)
    >>> round(found.best.errors.max, 4)
    0.0469
    >>> la.function(lambda x: x**1.5, 90, interval=(1, 4), output_span=90, top=1).status
    'closest'
    """
    if objective not in ("rms", "max"):
        raise FieldError("/objective", f"wanted 'rms' or 'max', found {objective!r}")
    check_top(top)
    check_above_zero(budget=budget, round_to=round_to)
    tolerance = number("tolerance", tolerance, 0.0)
    begin = None if refine_from is None else read_beginning(refine_from, degrees)
    tables = begin or seed_tables()
    watch = work(budget)
    called = {"x": interval, "output_span": output_span, "samples": samples}
    if callable(output):
        if function is not None:
            raise FieldError("/output", "give either `output` or `function`")
        output, function = None, {"of": output, **called}
    elif given := [name for name, value in called.items() if value is not None]:
        name = "interval" if given[0] == "x" else given[0]
        raise FieldError(f"/{name}", "belongs to an `output` that is a callable")
    wanted, dials = read_wanted(
        output,
        crank_span,
        input=input,
        function=function,
        input_zero=input_zero,
        output_zero=output_zero,
        weights=weights,
        degrees=degrees,
    )
    kept = read_function_limits(limits, wanted.target, degrees)
    if round_to is not None and kept.links[3] is None:
        raise FieldError("/round_to", "needs `limits.links.ground`: without it no length is actual")
    if one_way:
        _check_one_way(wanted, "/function" if function is not None else "/output")
        wanted = replace(wanted, one_way=True)
    largest = objective == "max"
    if isinstance(tables, Beginning):
        with named():
            found, went = refine_function(wanted, kept, largest, tables.linkage, tables.offset, tolerance, watch)
    else:
        found, went = generate(tables, wanted, kept, largest, top, tolerance, watch.extended(-FINISHING))
    searched = watch.elapsed
    asked = Asked(wanted, dials, degrees, largest, tolerance)
    solutions = described(asked, found, kept, sensitivity, curves)
    if round_to is not None:
        solutions = [
            replace(one, rounded=rounded(asked, generator, round_to, watch))
            for one, generator in zip(solutions, found)
        ]
    notes = [*_notes(wanted), *([] if begin is None else [LOCAL])]
    if not went.settled:
        notes.append(
            "the best linkage was still getting better, by little, when the steps of the search were used up"
        )
    if largest and found and wanted.doubt > 0.2 * found[0].errors.max:
        notes.append(
            f"between the samples the wanted curve is a spline, in doubt by up to {wanted.doubt / radians_in(degrees):.2g}: "
            "with more samples the largest error would mean more"
        )
    if solutions and solutions[0].determination.ill_posed:
        notes.append("the problem is ill-posed: quite different linkages make this function to within the resolution")
    status = Status.of(found, tolerance).value
    if not solutions and begin is not None:
        status = "unknown"
        notes.append(NOWHERE)
    elif not solutions and went.stopped_by == "budget":
        status = "unknown"
        notes.append("nothing within the limits was found before the search was cut short; that proves nothing")
    total, radian = watch.elapsed, radians_in(degrees)
    stages = {"screen": went.screen_seconds, "refine": searched - went.screen_seconds}
    stages |= {"report": total - searched, "total": total}
    report = FunctionReport(
        elapsed_ms={name: 1000 * seconds for name, seconds in stages.items()},
        trace=[(1000 * seconds, value) for seconds, value in went.trace],
        stopped_by=went.stopped_by.value,
        seeds=went.seeds,
        notes=notes,
    )
    x, y = (None, None) if dials is None else (dials.x, dials.y)
    return FunctionResult(
        status, solutions, wanted.crank / radian, wanted.output / radian, x, y, report, wanted, degrees
    )


# -- what is asked ----------------------------------------------------------------------------------------------------


def read_wanted(
    output: ArrayLike | None = None,
    crank_span: float | None = None,
    *,
    input: ArrayLike | None = None,
    function: Mapping[str, Any] | None = None,
    input_zero: float | None = None,
    output_zero: float | None = None,
    weights: ArrayLike | None = None,
    degrees: bool = True,
) -> tuple[Wanted, Dials | None]:
    """A checked function in radians, and its dials where it was named; see `function`."""
    radian = radians_in(degrees)
    if (output is None) == (function is None):
        raise FieldError("/output", "give either `output` or `function`")
    span = None if crank_span is None else number("crank_span", crank_span) * radian
    angles = None if input is None else column("input", input) * radian
    dials = exact = None
    if function is not None:
        if angles is not None:
            raise FieldError("/input", "the input dial of a `function` is linear: give `crank_span`")
        try:
            dials = read_dials(function, span, degrees)
        except FieldError as error:
            if "of" not in function:
                raise
            raise FieldError(_CALLED.get(error.field, error.field), error.message) from error
        values, angles, span, exact = dials.output, dials.input, None, dials.exact
    else:
        assert output is not None
        values = column("output", output) * radian
    given = None if weights is None else column("weights", weights)
    try:
        target = make_target(rotation=values, crank_span=span, crank_angle=angles, rotation_weights=given)
    except FieldError as error:
        named = {"/rotation": "/output", "/crank_angle": "/input", "/crank_span": "/crank_span"}
        named["/weights/rotation"] = "/weights"
        at = next((old for old in named if error.field.startswith(old)), None)
        if at is None:
            raise
        whole = "/function" if function is not None and "of" not in function else named[at]
        place = named[at] if at == "/weights/rotation" else whole
        message = error.message.replace("rotation", "output").replace("crank_angle", "input")
        raise FieldError(place + error.field[len(at) :], message, **error.details) from error
    assert target.rotation is not None
    start = None if input_zero is None else number("input_zero", input_zero) * radian
    offset = None
    if output_zero is not None:
        offset = float(target.rotation[0]) - number("output_zero", output_zero) * radian
    return Wanted(target.crank, target.rotation, target.rotation_weights, start, offset, exact), dials


def _check_one_way(wanted: Wanted, where: str) -> None:
    steps = np.diff(wanted.output)
    back = steps * np.sign(wanted.output[-1] - wanted.output[0]) <= 0
    if back.any():
        place = int(np.argmax(back)) + 1
        at = f"{where}/{place}" if where == "/output" else where
        raise FieldError(
            at,
            f"the rocker must not turn back, but sample {place + 1} of the output does not go on from the one before",
        )


def _notes(wanted: Wanted) -> list[str]:
    """What a user should know about a function with a jump."""
    slope = np.abs(np.diff(wanted.output) / np.diff(wanted.crank))
    if slope.size < 4:
        return []
    place = int(np.argmax(slope))
    others = np.delete(slope, place)
    step = abs(wanted.output[place + 1] - wanted.output[place])
    if slope[place] <= _STEEP * others.max() or step <= np.deg2rad(1.0):
        return []
    return [
        f"the output jumps from sample {place + 1} to {place + 2}, {slope[place] / max(others.max(), 1e-300):.3g} times as steep "
        "as anywhere else: no rocker follows a jump; if it is a wrap at a whole turn, unwrap it"
    ]
