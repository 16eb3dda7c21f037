"""Search among several kinds of mechanism for a motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from linkage_atlas.mechanism_types import Kinds, as_poses, has_poses, is_path
from linkage_atlas.motions import Motion
from synthesis.arrays import Floats
from synthesis.guided.search import NOTHING_ROUND, search_guided
from synthesis.guides import Driver
from synthesis.limits import Limits
from synthesis.search.report import SearchReport, smallest
from synthesis.solution import Solution
from synthesis.target import Target
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
_MAX_LEADS = 3
"""Maximum number of rotation curves taken from four-bars."""
_OTHER_ROTATION = 1e-2
"""Smallest difference of two such rotation curves, in radians."""

Found = tuple[list[Solution], SearchReport]
"""Linkages that were found, and how the search went."""
FourBarSearch = Callable[[Limits, Work, int | None], Found]
"""The search among four-bars within limits, with a maximum number of rounds."""


@dataclass
class KindSearch:
    """Search for linkages of several kinds within limits, in stages whose results add up."""

    kinds: Kinds
    motion: Motion
    limits: Limits
    tolerance: float
    search_four_bars: FourBarSearch
    work: Work
    rounds: int | None = None
    """Maximum number of rounds of each search for linkages with sliders."""
    soon: bool = False
    """See `search_guided`."""
    found: list[Solution] = field(default_factory=list)
    reports: list[SearchReport] = field(default_factory=list)

    def run(self) -> Found:
        """Return linkages, in no particular order, and the report of all stages."""
        kinds, samples, limits = self.kinds, self.motion.samples, self.limits
        by_path = bool(kinds.sliders) and is_path(self.motion)
        with_sliders = by_path or (bool(kinds.sliders) and has_poses(samples))
        leads: list[Solution] = []
        if (kinds.four_bars or by_path) and self.motion.travel is None:
            shared = with_sliders and np.isfinite(self.work.budget)
            leads = self._four_bars(self.work.part(_FOUR_BARS * self.work.budget) if shared else self.work, by_path)
        between, notes = self.work.elapsed, list[str]()
        if with_sliders and self.found and self.work.expired():
            notes.append(NO_TIME)
        elif with_sliders and not (self.soon and smallest(self._trace) < self.tolerance):
            if by_path and not leads:
                notes.append(NO_TIME if self.work.expired() else NO_LEAD)
            self._sliders(self._rotations(leads) if by_path else [None])
            nothing_round = any(note in NOTHING_ROUND.values() for report in self.reports for note in report.notes)
            if samples.closed and not nothing_round:
                notes.append(ROUND_AGAIN)
        if kinds.sliders and not with_sliders:
            notes.append(NO_ROTATION)
        elif self.found and any(getattr(limits, name) is not None for name in _PIVOT_BOXES):
            found_kinds = {found.linkage.kind for found in self.found}
            if missing := [kind.value.replace("_", " ") for kind in kinds.sliders if kind not in found_kinds]:
                notes.append(OUTSIDE_BOX.format(", ".join(missing)))
        report = SearchReport.joined(self.reports)
        useless = NOTHING_ROUND.values() if self.found else ()
        notes = [note for note in (*report.notes, *notes) if note not in useless]
        return self.found, report._replace(screen_seconds=between, notes=notes)

    @property
    def _trace(self) -> list[tuple[float, float]]:
        return [entry for report in self.reports for entry in report.trace]

    def _add(self, found: Sequence[Solution], report: SearchReport) -> None:
        self.found += found
        self.reports.append(report)

    def _four_bars(self, part: Work, by_path: bool) -> list[Solution]:
        """Search four-bars and return those whose rotations lead the linkages with sliders.

        The first lead is the first four-bar that any search finds, and the others come from a complete search: the time does not
        change their order. ``part``: the fraction of the budget for four-bars.
        """
        kinds, search, limits = self.kinds, self.search_four_bars, self.limits
        leads, report = search(limits, part, self.rounds)
        self._add(leads if kinds.four_bars else [], report if kinds.four_bars else report._replace(trace=[]))
        if not by_path:
            return leads
        if self.motion.samples.closed and kinds.only_a_hinge_turns:
            # a hinge turns the body fully, as a double-crank does
            limits = replace(limits, family="double_crank")
            leads, report = search(limits, part, self.rounds)
        first, _ = search(limits, part.part(0.0), 1)
        return first[:1] + ([] if report.time_up else leads)

    def _sliders(self, rotations: Sequence[Floats | None]) -> None:
        """Search linkages with rails or slots, once for each rotation curve."""
        poses, kinds, work = as_poses(self.motion.samples), self.kinds.sliders, self.work
        drive, driver = drive_of(self.motion, self.kinds.driver)
        for turned in rotations:
            more = drive, turned, self.rounds, self.soon
            self._add(*search_guided(poses, self.limits, kinds, driver, self.tolerance, work, *more))
            if work.expired():
                break

    def _rotations(self, leads: Sequence[Solution]) -> list[Floats | None]:
        """Return the rotation curves of the first four-bars that clearly differ, in radians (N,) each."""
        curves: list[Floats] = []
        samples = as_poses(self.motion.samples).samples
        for lead in leads:
            turned = lead.linkage.body(lead.linkage.start + lead.travel[:samples]).rotation
            if all(np.ptp(turned - curve) > _OTHER_ROTATION for curve in curves):
                curves.append(turned)
        return list(curves[:_MAX_LEADS])


def drive_of(motion: Motion, driver: Driver | None) -> tuple[Floats | None, Driver | None]:
    """Return the given coordinates of the drive, and the driver."""
    if motion.travel is not None:
        return motion.travel, driver
    if isinstance(motion.samples, Target):
        return motion.samples.crank, Driver.CRANK
    return None, driver
