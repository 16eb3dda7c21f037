"""Replies of `synthesize` and `match`: solutions or matches, best first, and a report.

The fields are those of the HTTP contract, in its order; ``to_dict`` returns the body of an HTTP reply.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal, cast

from linkage_atlas.geometry import AtlasType
from linkage_atlas.linkages import Linkage
from linkage_atlas.notes import counted
from linkage_atlas.records import PYTHON_ONLY, Item, Ranked, Record
from linkage_atlas.solutions import Solution
from synthesis.ranking import Status
from synthesis.search.report import SearchReport

StatusName = Annotated[str, Literal["reached", "closest", "infeasible", "unknown"]]
StoppedBy = Annotated[str, Literal["tolerance", "converged", "budget"]]


@dataclass(frozen=True)
class Report(Record):
    """Report on a search."""

    elapsed_ms: dict[str, float]
    """Milliseconds of each stage and in total."""
    trace: list[tuple[float, float]]
    """[milliseconds, best objective] after each round, of all linkages within the limits. They count even with a defect, which
    ranks them last, so that the last value may be below the error of the first solution."""
    stopped_by: StoppedBy
    length_scale: float | None
    """Length by which position errors were divided."""
    seeds: int | None
    """Starting points refined; null for effort atlas."""
    windows: int | None
    """Number of atlas windows that were compared; null for effort refine."""
    exhaustive: bool | None
    """True if all windows were considered; null for effort refine."""
    notes: list[str]
    start_from_ranks: list[int | None] | None = None
    """With `start_from`: the rank of the solution to which each of its linkages led, null if there is none."""

    @classmethod
    def of(
        cls, search: SearchReport, searched: float, total: float, notes: list[str], length_scale: float | None = None
    ) -> Report:
        """Return the report on a search that took ``searched`` of ``total`` seconds."""
        screened, is_refined = search.screen_seconds, search.windows is None
        seconds = {"screen": screened, **({"refine": searched - screened} if is_refined else {})}
        seconds |= {"report": total - searched, "total": total}
        return cls(
            elapsed_ms={name: 1000 * value for name, value in seconds.items()},
            trace=[(1000 * value, objective) for value, objective in search.trace],
            stopped_by=search.stopped_by.value,
            length_scale=length_scale,
            seeds=search.seeds if is_refined else None,
            windows=search.windows,
            exhaustive=search.exhaustive,
            notes=notes,
        )


class Solved(Ranked[Item]):
    """Base of replies whose results are solutions with linkages."""

    solutions: list[Item]

    @property
    def _results(self) -> list[Item]:
        return self.solutions

    @property
    def best(self) -> Item:
        """The best solution; IndexError without solutions."""
        return self.solutions[0]

    @property
    def linkage(self) -> Linkage:
        """The linkage of the best solution."""
        return cast("Solution", self.best).linkage


@dataclass(frozen=True)
class Result(Record, Solved[Solution]):
    """Reply of `linkage_atlas.synthesize`: solutions, best first, and a report.

    ``result[0]``, ``len(result)`` and ``for solution in result`` act on ``solutions``; a result without solutions is false.

    ``status`` is "reached" (a solution satisfies the tolerances of every sample; without tolerances, its objective is below
    the tolerance), "closest", "infeasible" (none within the limits) or "unknown" (none was found before the time was up).

    Examples
    --------
    >>> import linkage_atlas as la
    >>> result = la.synthesize([0, 12, 27, 45], crank_span=60, top=2)
    >>> result.status, len(result), result[0] is result.best
    ('reached', 2, True)
    """

    status: StatusName
    solutions: list[Solution]
    report: Report

    def __repr__(self) -> str:
        rows = [f"  {s.rank}  {s.linkage!r}  {s.errors_in_words()}" for s in self.solutions]
        notes = [f"note: {note}" for note in self.report.notes]
        return "\n".join([f"{self.status}: {counted(len(self.solutions), 'solution')}", *rows, *notes])


@dataclass(frozen=True)
class Match(Record):
    """Row of the atlas, and the start at which it turns like the request.

    Examples
    --------
    >>> import tempfile, numpy as np, linkage_atlas as la
    >>> rotation = la.FourBar(5, 9, 12, 14, start_angle=30).joints(np.linspace(0, 70, 16)).rotation
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     atlas = la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1)
    >>> match = la.match(rotation, 70, atlas=atlas)[0]
    >>> match.type.number, match.type.lengths, match.start_angle
    (33, [5, 9, 12, 14], 30.0)
    """

    rank: int
    type: AtlasType
    start_angle: float
    """Crank angle at the first sample, from the ground line."""
    branch: Literal[-1, 1]
    offset: float
    """Added to the angle of the coupler (in -180..180 degrees at the first sample, continuous)."""
    rotation_rms: float
    """Rms rotation error of this row at this start, in the angle unit of the request (smaller is better)."""
    linkage: Linkage = field(metadata=PYTHON_ONLY)
    """With the type's lengths, this start and offset."""


@dataclass(frozen=True)
class MatchReport(Record):
    """Report on a scan."""

    elapsed_ms: dict[str, float]
    windows: int
    """Number of types times starts times branches that were compared."""
    evaluated: int
    """Number of windows evaluated sample by sample; bounds excluded the others."""
    exhaustive: bool
    """True if all windows were considered; false if the time ended the scan."""
    notes: list[str]


@dataclass(frozen=True)
class Matches(Record, Ranked[Match]):
    """Reply of `linkage_atlas.match`: the best rows of the atlas, best first, indexed and iterated as ``matches``.

    Examples
    --------
    >>> import tempfile, linkage_atlas as la
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     atlas = la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1)
    >>> matches = la.match([0, 12, 27, 45], 60, atlas=atlas, top=3)
    >>> len(matches), matches.report.exhaustive
    (3, True)
    >>> matches[0].linkage.kind
    'four_bar'
    """

    matches: list[Match]
    report: MatchReport

    @property
    def _results(self) -> list[Match]:
        return self.matches

    def __repr__(self) -> str:
        rows = [
            f"  {m.rank}  type {m.type.number} {m.type.lengths}, start {m.start_angle:g}, "
            f"branch {m.branch:+d}, rms error {m.rotation_rms:.3g}"
            for m in self.matches
        ]
        return "\n".join([counted(len(self.matches), "match"), *rows])


def status_of(solutions: Sequence[Solution], tolerance: float, tolerances: bool, cut_short: bool) -> str:
    """Return the status: reached if a solution satisfies the tolerances, or if the smallest objective is small without them."""
    if not solutions:
        return (Status.UNKNOWN if cut_short else Status.INFEASIBLE).value
    if tolerances:
        reached = any(solution.verdict.within_tolerance for solution in solutions)
    else:
        reached = any(solution.errors.objective < tolerance for solution in solutions)
    return (Status.REACHED if reached else Status.CLOSEST).value
