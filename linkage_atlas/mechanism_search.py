"""Search among several kinds of mechanism for a motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from linkage_atlas.mechanism_types import Kinds, as_poses, has_poses, is_closed, is_path
from linkage_atlas.motions import Motion
from synthesis.arrays import Floats
from synthesis.guided.by_crank import linkages_by_crank
from synthesis.guided.search import NOTHING_ROUND, search_guided
from synthesis.guides import Driver
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.search.report import SearchReport, StoppedBy, fallen, smallest
from synthesis.solution import Solution
from synthesis.target import Target
from synthesis.violations import within
from synthesis.work import Work

NO_ROTATION = (
    "Only four-bars were searched: linkages with sliders need positions with no rotation, or with at least two "
    "rotations."
)
NO_LEAD = (
    "Linkages with sliders were not searched: their search starts from the rotations of a four-bar, and no four-bar was "
    "found for this path."
)
ROUND_AGAIN = (
    "Only drives that turn fully were searched: sliders and cylinders would have to reverse on a closed path."
)
OUTSIDE_BOX = "Left out, because no such linkage has its pivots, rails and pins of slots inside the pivot box: {}."
NO_TIME = "The time was up before linkages with sliders were searched."
_PIVOT_BOXES = ("pivot_box", "pivot_a_box", "pivot_b_box")
_FOUR_BARS = 0.4
"""Largest fraction of the budget for four-bars if other kinds are searched too."""
_FIRST_ROUNDS = 4
"""Rounds of the first search for four-bars whose rotations lead the linkages with sliders, independent of the time."""
_MAX_LEADS = 3
"""Maximum number of rotation curves taken from four-bars."""
_OTHER_ROTATION = 1e-2
"""Smallest difference of two such rotation curves, in radians."""

FourBarSearch = Callable[[Limits, Work, int | None], tuple[list[Solution], SearchReport]]
"""The search among four-bars within limits, with a maximum number of rounds."""


@dataclass
class _Progress:
    """Accumulated results of consecutive searches."""

    found: list[Solution] = field(default_factory=list)
    trace: list[tuple[float, float]] = field(default_factory=list)
    seeds: int = 0
    notes: list[str] = field(default_factory=list)
    stopped: set[StoppedBy] = field(default_factory=set)

    def add(self, found: Sequence[Solution], trace: Sequence[tuple[float, float]]) -> None:
        """Add linkages of another search; its trace counts from the point at which it improves on previous searches."""
        self.found = [*self.found, *found]
        self.trace = fallen(self.trace, trace)

    def report(self, screen_seconds: float) -> SearchReport:
        """Return the report of all searches."""
        nothing = set(NOTHING_ROUND.values()) if self.found else set()
        notes = [note for note in self.notes if note not in nothing]
        return SearchReport(StoppedBy.worst(self.stopped), self.trace, screen_seconds, self.seeds, notes=notes)


def search_kinds(
    kinds: Kinds,
    motion: Motion,
    limits: Limits,
    tolerance: float,
    search_four_bars: FourBarSearch,
    work: Work,
    rounds: int | None = None,
    soon: bool = False,
) -> tuple[list[Solution], SearchReport]:
    """Find linkages of several kinds within the limits, in no particular order.

    ``rounds``: maximum number of rounds of each search for linkages with sliders. ``soon``: see `search_guided`.
    """
    progress = _Progress()
    by_path = bool(kinds.sliders) and is_path(motion)
    with_sliders = by_path or (bool(kinds.sliders) and has_poses(motion.samples))
    leads: list[Solution] = []
    if (kinds.four_bars or by_path) and motion.travel is None:
        shared = with_sliders and np.isfinite(work.budget)
        part = work.part(_FOUR_BARS * work.budget) if shared else work
        leads = _search_four_bars(kinds, motion, limits, search_four_bars, (work, part), rounds, progress, by_path)
    beginnings: list[Linkage] = []
    if isinstance(motion.samples, Target) and motion.samples.position is not None:
        beginnings = _search_by_crank(kinds, motion.samples, limits, tolerance, work, progress)
    between = work.elapsed
    if with_sliders and progress.found and work.expired():
        progress.notes.append(NO_TIME)
    elif with_sliders and not (soon and smallest(progress.trace) < tolerance):
        poses = as_poses(motion.samples)
        if by_path and not leads:
            progress.notes.append(NO_TIME if work.expired() else NO_LEAD)
        turned = _rotations(leads, poses) if by_path else [None]
        _search_sliders(kinds, motion, limits, tolerance, work, turned, rounds, beginnings, progress, soon)
        if is_closed(motion.samples) and not set(progress.notes) & set(NOTHING_ROUND.values()):
            progress.notes.append(ROUND_AGAIN)
    if kinds.sliders and not with_sliders and not kinds.by_crank:
        progress.notes.append(NO_ROTATION)
    elif progress.found and any(getattr(limits, name) is not None for name in _PIVOT_BOXES):
        found_kinds = {found.linkage.kind for found in progress.found if not found.linkage.is_four_bar}
        if missing := [kind.value.replace("_", " ") for kind in kinds.sliders if kind not in found_kinds]:
            progress.notes.append(OUTSIDE_BOX.format(", ".join(missing)))
    return progress.found, progress.report(between)


def _search_four_bars(
    kinds: Kinds,
    motion: Motion,
    limits: Limits,
    search: FourBarSearch,
    work: tuple[Work, Work],
    rounds: int | None,
    progress: _Progress,
    by_path: bool,
) -> list[Solution]:
    """Search four-bars and return those whose rotations lead the linkages with sliders.

    ``work``: all of the budget, and the fraction for four-bars. If four-bars are results too, the first rounds for the leads
    may use all of it: a search with more time then only adds to what a search with less time examines.
    """
    full, part = work
    first_search = [search(limits, full if kinds.four_bars else part, _FIRST_ROUNDS)] if by_path else []
    first = [lead for leads, _ in first_search for lead in leads[:1]]
    cut_off = any(report.time_up for _, report in first_search)
    searches = first_search if cut_off else [search(limits, part, rounds), *first_search]
    leads, report = searches[0]
    if kinds.four_bars:
        for found, its_report in reversed(searches):
            progress.add(found, its_report.trace)
    progress.seeds += report.seeds
    progress.stopped.add(report.stopped_by)
    progress.notes += report.notes
    if by_path and is_closed(motion.samples) and kinds.only_a_hinge_turns:
        # a hinge turns the body fully, as a double-crank does
        first, (leads, _) = [], search(replace(limits, family="double_crank"), part, rounds)
    if first:
        leads = first + ([] if report.time_up else leads)
    return leads


def _search_by_crank(
    kinds: Kinds, target: Target, limits: Limits, tolerance: float, work: Work, progress: _Progress
) -> list[Linkage]:
    """Search linkages with a rail or slot for given crank angles; return all, also those outside the limits."""
    beginnings: list[Linkage] = []
    for kind in kinds.by_crank:
        solutions, report = linkages_by_crank(kind, target, tolerance=tolerance, work=work)
        inside = within(target, limits, solutions)
        beginnings += [found.linkage for found in solutions]
        best = min((found.errors.objective for found in inside), default=np.inf)
        progress.add(inside, [(work.elapsed, best)] if inside else [])
        progress.seeds += report.seeds
        progress.stopped.add(report.stopped_by)
    return beginnings


def _search_sliders(
    kinds: Kinds,
    motion: Motion,
    limits: Limits,
    tolerance: float,
    work: Work,
    rotations: Sequence[Floats | None],
    rounds: int | None,
    beginnings: Sequence[Linkage],
    progress: _Progress,
    soon: bool,
) -> None:
    """Search linkages with rails or slots, once for each rotation curve."""
    poses = as_poses(motion.samples)
    drive, driver = drive_of(motion, kinds.driver)
    for turned in rotations:
        found, report = search_guided(
            poses, limits, kinds.sliders, driver, tolerance, work, drive, turned, rounds, beginnings, soon
        )
        progress.add(found, report.trace)
        progress.seeds += report.seeds
        progress.notes += [note for note in report.notes if note not in progress.notes]
        progress.stopped.add(report.stopped_by)
        if work.expired():
            break


def _rotations(leads: Sequence[Solution], poses: Poses) -> list[Floats]:
    """Return the rotation curves of the first four-bars that clearly differ, in radians (N,) each."""
    curves: list[Floats] = []
    for lead in leads:
        turned = lead.linkage.body(lead.linkage.start + lead.travel[: poses.samples]).rotation
        if all(np.ptp(turned - curve) > _OTHER_ROTATION for curve in curves):
            curves.append(turned)
        if len(curves) == _MAX_LEADS:
            break
    return curves


def drive_of(motion: Motion, driver: Driver | None) -> tuple[Floats | None, Driver | None]:
    """Return the given coordinates of the drive, and the driver."""
    if motion.travel is not None:
        return motion.travel, driver
    if isinstance(motion.samples, Target):
        return motion.samples.crank, Driver.CRANK
    return None, driver
