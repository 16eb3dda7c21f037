"""Generators of functions from all searches: exact linkages first, the general search, and the choice of answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.four_bar import Family
from synthesis.function.answers import Generator, Generators, finished, fraction_back
from synthesis.function.few_pairs import HARDLY_BACK, MOST_PAIRS, exact_functions, function_merit, is_few
from synthesis.function.search import FunctionSearch, ground_of
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits
from synthesis.linkage import as_lengths, with_links
from synthesis.ranking import APART, PROPORTION, Status, counted_error, distinct
from synthesis.scores import NEAR_CHANGE_POINT
from synthesis.search.report import SearchReport, StoppedBy, stopped_by
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
    locked: float = float(np.deg2rad(5.0))
    """Transmission angle below which a linkage nearly locks."""


OPTIONS = GeneratorOptions()


def generate(
    tables: SeedTables,
    target: TargetFunction,
    limits: Limits,
    largest: bool,
    top: int,
    tolerance: float,
    work: Work | None = None,
) -> tuple[list[Generator], SearchReport]:
    """Find the best linkages for a function.

    Parameters
    ----------
    tables : SeedTables
        Tables of the four-bar.
    target : TargetFunction
        The function.
    limits : Limits
        Limits, with lengths in the unit of the ground, see `ground_of`.
    largest : bool
        Minimize the largest error over the interval; otherwise the root mean square error at the samples.
    top : int
        Maximum number of linkages.
    tolerance : float
        Stop the search when the objective is below this value.
    work : Work, optional
        When it expires, return the best linkages found.

    Returns
    -------
    generators : list of Generator
        Distinct linkages within the limits, best first. Law: a mirrored function gives the mirrored linkages.
    report : SearchReport
        How the search ended.
    """
    work = work or Work()
    if target.clockwise:
        found, report = generate(tables, target.mirrored(), limits, largest, top, tolerance, work)
        return [generator.mirrored() for generator in found], report
    few, many = list[Generator](), max(top, OPTIONS.ranked)
    if not largest and is_few(target, limits):
        few = exact_generators(target, limits, many, tolerance, work)
        if few and few[0].transmission_angle_min > OPTIONS.usable and target.crank.size < MOST_PAIRS:
            trace = [(work.elapsed, few[0].errors.objective)]
            return few[:top], SearchReport(StoppedBy.TOLERANCE, trace, work.elapsed, len(few))
    found, report = _generate_any(tables, target, limits, largest, many, tolerance, work)
    found = distinct(few + found, many, APART) if few else found
    if found and not is_usable(min(found, key=lambda generator: generator.errors.objective)) and not work.expired():
        within = replace(limits, transmission_angle_min=OPTIONS.usable)
        more, _ = _generate_any(tables, target, within, largest, many, tolerance, work)
        found = distinct(found + more, 2 * many, APART)
    return best_built(target, found, top, tolerance, limits.links[3] is not None), report


def _generate_any(
    tables: SeedTables, target: TargetFunction, limits: Limits, largest: bool, many: int, tolerance: float, work: Work
) -> tuple[list[Generator], SearchReport]:
    """Search for ``many`` linkages for any number of pairs; see `generate`."""
    ground = ground_of(limits)
    if not largest and limits.over(ground).only_family and not target.one_way:
        mechanism = Generators(target, ground)
        found, report = search(tables, target.target, Limits(family=limits.family), many, tolerance, work, mechanism)
        prescribed = target.start is not None or target.offset is not None
        lopsided = _is_lopsided(found, tolerance)
        reached = Status.of(found, tolerance) is Status.REACHED
        if work.expired() or not (lopsided or (prescribed and not reached)):
            return found, report
        # With prescribed zeros the search for motions only finds full cranks.
        # If its best linkage is out of proportion, as for the function of a parallelogram, others may be as good.
        within = (
            replace(limits, link_ratio_max=OPTIONS.even_ratio_max)
            if lopsided and not (prescribed and not reached)
            else limits
        )
        run = FunctionSearch(target, within, False, many, tolerance, work)
        found = best_built(
            target, distinct(found + run.run(), 2 * many, APART), many, tolerance, limits.links[3] is not None
        )
        trace = report.trace + [
            (at, min(value, report.trace[-1][1]) if report.trace else value) for at, value in run.trace
        ]
        stopped = stopped_by(found, tolerance, work)
        return found, SearchReport(stopped, trace, report.screen_seconds, report.seeds + run.seeds, run.settled)
    run = FunctionSearch(target, limits, largest, many, tolerance, work)
    found = run.run()
    stopped = stopped_by(found, tolerance, work)
    return found, SearchReport(stopped, run.trace, run.screened, run.seeds, run.settled or not found)


def _is_lopsided(found: Sequence[Generator], tolerance: float) -> bool:
    """Check that all exact linkages are out of proportion, or the linkage with the smallest error if none is exact."""
    exact = [generator for generator in found if generator.errors.objective < tolerance]
    best = exact or sorted(found, key=lambda generator: generator.errors.objective)[:1]
    return all(generator.linkage.link_ratio > PROPORTION for generator in best)


def exact_generators(
    target: TargetFunction, limits: Limits, max_count: int, tolerance: float, work: Work
) -> list[Generator]:
    """Return distinct linkages that meet two to five pairs, the most practical first."""
    ground = ground_of(limits)
    linkages, offsets = exact_functions(target, limits.over(ground), limits.links[3] is not None, work)
    prescribed = [(k, length) for k, length in enumerate(limits.links) if length is not None]
    scaled = []
    for linkage in linkages:
        lengths = np.array(linkage.links) * ground
        for k, length in prescribed:  # restore the prescribed value to the last bit
            lengths[k] = length
        scaled.append(with_links(linkage, as_lengths(lengths)))
    found = [
        generator for generator in finished(target, scaled, False, offsets) if generator.errors.objective < tolerance
    ]
    ranks = {id(generator): rank for rank, generator in enumerate(found)}
    found = distinct(found, max_count, APART, order=lambda generator: ranks[id(generator)], exact=tolerance)
    return sorted(
        found,
        key=lambda generator: (not is_usable(generator), fraction_back(target, generator.linkage) > HARDLY_BACK),
    )


def is_usable(generator: Generator) -> bool:
    """Check that a rocker stays away from dead positions and from a change point."""
    change_point = generator.family is Family.CHANGE_POINT
    return generator.transmission_angle_min >= (NEAR_CHANGE_POINT if change_point else OPTIONS.locked)


def best_built(
    target: TargetFunction, found: list[Generator], top: int, tolerance: float, sized: bool
) -> list[Generator]:
    """Return the leading answers: exact linkages by merit, others by `counted_error`.

    The linkage with the smallest error is among the first two. Exact linkages whose rocker turns back on the way come
    behind the other exact linkages, and linkages that cannot be used come last. ``sized``: see `function_merit`.
    """
    if not found:
        return []
    exact = [generator for generator in found if generator.errors.objective < tolerance]
    back = np.array([fraction_back(target, generator.linkage) > HARDLY_BACK for generator in exact], bool)
    lengths = np.array([generator.linkage.links for generator in exact]).reshape(-1, 4)
    merits = function_merit(lengths, np.array([generator.transmission_angle_min for generator in exact]), sized)
    ranked = [exact[k] for k in np.lexsort((merits, back))]
    ranked += sorted(
        (generator for generator in found if generator.errors.objective >= tolerance),
        key=lambda generator: generator.errors.objective,
    )

    def key(generator: Generator) -> tuple[bool, float]:
        own = 0.0 if generator.errors.objective < tolerance else generator.errors.objective
        return not is_usable(generator), counted_error(own, generator.linkage.link_ratio, PROPORTION)

    ordered = sorted(ranked, key=key)
    built = [generator for generator in ordered if generator.linkage.link_ratio <= PROPORTION]
    best = ranked[0] if exact else min(ranked, key=lambda generator: generator.errors.objective)
    # only the best of the linkages out of proportion is listed
    if built and all(generator is not best for generator in built):
        built.insert(0 if best is ordered[0] else 1 if is_usable(best) else top - 1, best)
    return (built or ordered)[:top]
