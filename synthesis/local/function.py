"""A given function generator refined: the search's own descents, under its limits, from just there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.function.answers import Generator, exchanged
from synthesis.function.search import FunctionSearch
from synthesis.function.wanted import Wanted
from synthesis.local.beginning import report_of, turning_fully
from synthesis.pose import whole_turns
from synthesis.search.search import SEARCH_SAMPLES, SearchReport
from synthesis.work import Work

Floats = NDArray[np.float64]


def refine_function(
    wanted: Wanted,
    limits: Limits,
    largest: bool,
    linkage: Linkage,
    offset: float | None,
    tolerance: float,
    work: Work,
) -> tuple[list[Generator], SearchReport]:
    """The best generator that descents from a given one lead to.

    Parameters
    ----------
    wanted : Wanted
    limits : Limits
        Lengths that are given replace those of the linkage, and zeros that are given its own.
    largest : bool
        As of `function.search.generate`.
    linkage : Linkage
    offset : float or None
        output = theta3 + offset, theta3 in (-pi, pi] at the first sample; None: the best for the root of the mean square.
    tolerance : float
    work : Work

    Returns
    -------
    generators : list of Generator
        One, within the limits; none where no descent led into them. Law: where the linkage keeps the limits itself, what is
        returned is no worse.
    report : SearchReport
    """
    if wanted.clockwise:
        other = None if offset is None else -offset
        mirrored = wanted.mirrored(), limits, largest, linkage.mirrored(), other
        made, report = refine_function(*mirrored, tolerance, work)
        return [one.mirrored() for one in made], report
    run = FunctionSearch(wanted, limits, largest, 1, tolerance, work)
    given: list[Generator] = []
    found: list[Generator] = []
    seconds = work.elapsed
    for one in (linkage, turning_fully(linkage, limits.family)):
        if found:
            break
        begin = _unknowns(run, one, offset)
        as_it_is = run.kept(*begin)
        if one is linkage:
            given, seconds = as_it_is, work.elapsed
        found = sorted(run.led(*begin) + as_it_is, key=lambda each: each.errors.objective)[:1]
    return found, report_of(found, given, seconds, tolerance, work)


def _unknowns(run: FunctionSearch, linkage: Linkage, offset: float | None) -> tuple[Floats, Floats]:
    """A linkage as a candidate of the search, with coupler and rocker exchanged: unknowns (1, 5) and its branch."""
    wanted, problem, one = run.wanted, run.problem, exchanged(linkage)
    lengths, branch = np.array(one.links), np.array([float(one.branch)])
    ratios = np.where(np.isnan(problem.given), np.log(lengths[:3] / lengths[3]), problem.given)
    start = one.start if wanted.start is None else wanted.start
    places, root = run.places(SEARCH_SAMPLES)
    begin = problem.with_offset(np.array([[*ratios, start, 0.0]]), branch, places, root)
    if offset is not None and wanted.offset is None:
        own = offset + np.pi
        begin[:, 4] = own + whole_turns(begin[:, 4] - own)
    return begin, branch
