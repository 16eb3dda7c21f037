"""Report of a search: the reason why it ended, and its progress."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from enum import StrEnum
from typing import NamedTuple

from synthesis.ranking import Answer, Status
from synthesis.work import Work


class StoppedBy(StrEnum):
    """Reason why a search ended."""

    TOLERANCE = "tolerance"
    CONVERGED = "converged"
    BUDGET = "budget"

    @classmethod
    def worst(cls, reasons: Collection[StoppedBy]) -> StoppedBy:
        """Return the reason of several searches together: the budget if it ended one of them."""
        return next(reason for reason in (cls.BUDGET, cls.CONVERGED, cls.TOLERANCE) if reason in reasons)


def stopped_by(solutions: Sequence[Answer], tolerance: float, work: Work) -> StoppedBy:
    """Return why a search ended that found these solutions, best first."""
    if Status.of(solutions, tolerance) is Status.REACHED:
        return StoppedBy.TOLERANCE
    return StoppedBy.BUDGET if work.expired() else StoppedBy.CONVERGED


class SearchReport(NamedTuple):
    """Report of a search among any kinds of mechanism."""

    stopped_by: StoppedBy
    trace: list[tuple[float, float]]
    """Seconds, and the best objective within the limits after them."""
    screen_seconds: float = 0.0
    seeds: int = 0
    """Number of starting points that were refined."""
    settled: bool = True
    """False if the best was still improving when its last step was used up."""
    notes: Sequence[str] = ()
    windows: int | None = None
    """Number of windows of an atlas that were compared."""
    exhaustive: bool | None = None
    """True if these were all windows of the atlas."""

    def ended_by(self, time_up: bool) -> SearchReport:
        """Return the report with the budget as the reason to stop, if the time was up."""
        return self._replace(stopped_by=StoppedBy.BUDGET) if time_up else self

    @property
    def time_up(self) -> bool:
        """True if the budget ended the search."""
        return self.stopped_by is StoppedBy.BUDGET

    @classmethod
    def joined(cls, reports: Sequence[SearchReport]) -> SearchReport:
        """Return the report of several consecutive refinements."""
        trace: list[tuple[float, float]] = []
        for report in reports:
            trace = fallen(trace, report.trace)
        notes = list(dict.fromkeys(note for report in reports for note in report.notes))
        stopped = StoppedBy.worst([report.stopped_by for report in reports])
        screen_seconds = sum(report.screen_seconds for report in reports)
        seeds = sum(report.seeds for report in reports)
        return cls(stopped, trace, screen_seconds, seeds, notes=notes)


def smallest(trace: Sequence[tuple[float, float]]) -> float:
    """Return the best objective of a trace."""
    return min((error for _, error in trace), default=float("inf"))


def fallen(trace: list[tuple[float, float]], more: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return a trace with those entries of another search that improve on it."""
    best = smallest(trace)
    return trace + [entry for entry in more if entry[1] < best]
