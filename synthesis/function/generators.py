"""Generators of functions from all searches: exact linkages first, the general search, and the choice of answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from synthesis.function.answers import Generator, exchanged_back, fraction_back, generators_of
from synthesis.function.few_pairs import HARDLY_BACK, MOST_PAIRS, exact_functions, function_merit, is_few
from synthesis.function.laws import FOUR_BAR, FunctionLimits
from synthesis.function.problem import AnyLaw
from synthesis.function.search import FunctionSearch, FunctionTask
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits
from synthesis.ranking import APART, PROPORTION, Status, counted_error, distinct
from synthesis.search.report import SearchReport, StoppedBy, fallen, stopped_by
from synthesis.search.search import search
from synthesis.search.seeds import SeedTables
from synthesis.work import Work


@dataclass(frozen=True)
class GeneratorOptions:
    """Options of the choice of answers."""

    even_ratio_max: float = 20.0
    """Largest ratio of two links if the best linkage is out of proportion."""
    ranked: int = 10
    """Smallest number of candidates for the answers, among which exact linkages are ordered by merit."""
    usable: float = float(np.deg2rad(20.0))
    """Transmission angle of an exact four-bar above which nothing else is searched."""
    spare: int = 4
    """Number of further answers of a law, because some prove to lie in the same basin."""
    answer_max: float = 0.1
    """Error above which a law has no answer if another law is much better."""
    much_better: float = 10.0
    """Ratio of errors above which another law is much better."""


OPTIONS = GeneratorOptions()


def generate(tables: SeedTables, task: FunctionTask, top: int) -> tuple[list[Generator], SearchReport]:
    """Find the best four-bars for a function.

    Parameters
    ----------
    tables : SeedTables
        Tables of the four-bar.
    task : FunctionTask
        The function, with limits of four-bars.
    top : int
        Maximum number of linkages.

    Returns
    -------
    generators : list of Generator
        Distinct linkages within the limits, best first. Law: a mirrored function gives the mirrored linkages.
    report : SearchReport
        How the search ended.
    """
    target, limits, largest, tolerance, work = task
    if target.clockwise:
        found, report = generate(tables, task._replace(target=target.mirrored()), top)
        return [generator.mirrored() for generator in found], report
    few, max_results = list[Generator](), max(top, OPTIONS.ranked)
    if not largest and is_few(target, limits.relative):
        few = exact_generators(target, limits, max_results, tolerance, work)
        if few and few[0].transmission_angle_min > OPTIONS.usable and target.crank.size < MOST_PAIRS:
            trace = [(work.elapsed, few[0].errors.objective)]
            return few[:top], SearchReport(StoppedBy.TOLERANCE, trace, work.elapsed, len(few))
    found, report = _generate_any(tables, task, max_results)
    found = distinct(few + found, max_results, APART) if few else found
    if found and not min(found, key=_error).usable and not work.expired():
        within = replace(limits, limits=replace(limits.limits, transmission_angle_min=OPTIONS.usable))
        more, _ = _generate_any(tables, task._replace(limits=within), max_results)
        found = distinct(found + more, 2 * max_results, APART)
    return best_built(target, found, top, tolerance, is_sized(limits)), report


def generate_with(laws: Sequence[AnyLaw], task: FunctionTask, top: int) -> tuple[list[Generator], SearchReport]:
    """Find the best distinct linkages of some laws for a function, best first, including the best of each law.

    Arguments and results are as in `generate`.
    """
    of_each, reports, tolerance, work = list[list[Generator]](), list[SearchReport](), task.tolerance, task.work
    for law in laws:
        if any(of_each) and work.expired():
            break
        found, report = _searched(law, task, top + OPTIONS.spare)
        of_each.append(distinct(found, top, APART, exact=tolerance))
        reports.append(report)
    smallest = min((found[0].errors.objective for found in of_each if found), default=0.0)
    worst = max(OPTIONS.answer_max, OPTIONS.much_better * smallest)
    of_each = [found for found in of_each if found and found[0].errors.objective <= worst]
    best = [found[0] for found in of_each]
    others = distinct([other for found in of_each for other in found[1:]], max(0, top - len(best)), APART)
    found = sorted(best + others, key=_error)[:top]
    settled = all(report.settled for report in reports)
    report = SearchReport.joined(reports)._replace(stopped_by=stopped_by(found, tolerance, work), settled=settled)
    return found, report._replace(screen_seconds=sum(report.screen_seconds for report in reports))


def _searched(law: AnyLaw, task: FunctionTask, max_results: int) -> tuple[list[Generator], SearchReport]:
    """Search for ``max_results`` linkages of a law."""
    run = FunctionSearch(task, law, max_results)
    found = run.run()
    stopped = stopped_by(found, task.tolerance, task.work)
    return found, SearchReport(stopped, run.trace, run.screened, run.seeds, run.settled or not found)


def _generate_any(tables: SeedTables, task: FunctionTask, max_results: int) -> tuple[list[Generator], SearchReport]:
    """Search for ``max_results`` four-bars for any number of pairs; see `generate`."""
    target, limits, largest, tolerance, work = task
    if largest or not limits.relative.only_family or target.one_way:
        return _searched(FOUR_BAR, task, max_results)
    family, answers = Limits(family=limits.limits.family), partial(exchanged_back, target, limits)
    found, report = search(tables, target.target, family, max_results, tolerance, work, answers)
    prescribed = target.start is not None or target.offset is not None
    lopsided = _is_lopsided(found, tolerance)
    missed = prescribed and Status.of(found, tolerance) is not Status.REACHED
    if work.expired() or not (lopsided or missed):
        return found, report
    # With prescribed zeros the search for motions only finds full cranks.
    # If its best linkage is out of proportion, as for the function of a parallelogram, others may be as good.
    even = replace(limits, limits=replace(limits.limits, link_ratio_max=OPTIONS.even_ratio_max))
    within = limits if missed else even
    more, second = _searched(FOUR_BAR, task._replace(limits=within), max_results)
    found = best_built(
        target, distinct(found + more, 2 * max_results, APART), max_results, tolerance, is_sized(limits)
    )
    trace = fallen(report.trace, second.trace)
    return found, second._replace(
        stopped_by=stopped_by(found, tolerance, work),
        trace=trace,
        screen_seconds=report.screen_seconds,
        seeds=report.seeds + second.seeds,
    )


def _error(generator: Generator) -> float:
    return generator.errors.objective


def is_sized(limits: FunctionLimits) -> bool:
    """Return whether the ground is prescribed, see `function_merit`."""
    return limits.limits.links[3] is not None


def _is_lopsided(found: Sequence[Generator], tolerance: float) -> bool:
    """Check that all exact linkages are out of proportion, or the linkage with the smallest error if none is exact."""
    exact = [generator for generator in found if _error(generator) < tolerance]
    best = exact or sorted(found, key=_error)[:1]
    return all(generator.linkage.link_ratio > PROPORTION for generator in best)


def exact_generators(
    target: TargetFunction, limits: FunctionLimits, max_count: int, tolerance: float, work: Work
) -> list[Generator]:
    """Return distinct linkages that meet two to five pairs, the most practical first."""
    exact = exact_functions(target, limits.relative, is_sized(limits), work)
    found = [generator for generator in generators_of(target, limits, *exact) if _error(generator) < tolerance]
    ranks = {id(generator): rank for rank, generator in enumerate(found)}
    found = distinct(found, max_count, APART, order=lambda generator: ranks[id(generator)], exact=tolerance)
    return sorted(found, key=lambda generator: (not generator.usable, fraction_back(target, generator) > HARDLY_BACK))


def best_built(
    target: TargetFunction, found: list[Generator], top: int, tolerance: float, sized: bool
) -> list[Generator]:
    """Return the leading answers: exact linkages by merit, others by `counted_error`.

    The linkage with the smallest error is among the first two, or if it cannot be used the last. Exact linkages whose rocker
    turns back on the way come behind the other exact linkages, and linkages that cannot be used come last. ``sized``: see
    `function_merit`.
    """
    if not found:
        return []
    exact = [generator for generator in found if _error(generator) < tolerance]
    back = np.array([fraction_back(target, generator) > HARDLY_BACK for generator in exact], bool)
    lengths = np.array([generator.linkage.links for generator in exact]).reshape(-1, 4)
    merits = function_merit(lengths, np.array([generator.transmission_angle_min for generator in exact]), sized)
    ranked = [exact[k] for k in np.lexsort((merits, back))]
    ranked += sorted((generator for generator in found if _error(generator) >= tolerance), key=_error)

    def key(generator: Generator) -> tuple[bool, float]:
        own = 0.0 if _error(generator) < tolerance else _error(generator)
        return not generator.usable, counted_error(own, generator.linkage.link_ratio, PROPORTION)

    ordered = sorted(ranked, key=key)
    built = [generator for generator in ordered if generator.linkage.link_ratio <= PROPORTION]
    best = ranked[0] if exact else min(ranked, key=_error)
    # only the best of the linkages out of proportion is listed
    listed = (built or ordered)[:top]
    if all(generator is not best for generator in listed):
        listed.insert(0 if best is ordered[0] else 1 if best.usable else top - 1, best)
    return listed[:top]
