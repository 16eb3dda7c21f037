"""Linkages for a motion: `synthesize`, a pipeline of stages from a request to a `Result`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields
from linkage_atlas.atlases import Atlas
from linkage_atlas.candidates import CandidateSearch, find_candidates
from linkage_atlas.finishing import finish_candidates, rank_solutions
from linkage_atlas.geometry import DriverName, KindName
from linkage_atlas.limits import Limits
from linkage_atlas.motions import Motion
from linkage_atlas.result_notes import notes_of, report_of
from linkage_atlas.results import Result
from linkage_atlas.task import Effort, Prefer, SearchOptions, read_task
from linkage_atlas.warm_start import StartingLinkage
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.work import Work


def synthesize(
    *motion: Motion | Fields | ArrayLike | None,
    limits: Limits | Fields | None = None,
    top: int = 10,
    effort: Effort = "refine",
    prefer: Prefer | None = None,
    diverse: bool = False,
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    start_from: Sequence[StartingLinkage] | None = None,
    refine_only: bool = False,
    atlas: Atlas | str | Path | None = None,
    work: Callable[[float | None], Work] = Work,
    mechanisms: Sequence[KindName] | Literal["all"] | None = None,
    driver: DriverName | None = None,
    **more: object,
) -> Result:
    """Find linkages that make a motion, with their dimensions and mounting.

    Call it as ``synthesize(motion, limits)``, or with the arguments of a `Motion` in its place:
    ``synthesize(rotation, position, crank_span=70)``.

    Parameters
    ----------
    *motion : Motion, or array_like
        The required motion.
    limits : Limits or mapping, optional
        Limits on the linkages, see `Limits`.
    top : int
        Maximum number of linkages, which differ from one another.
    effort : {"refine", "atlas"}
        "refine" searches and refines to machine precision; "atlas" returns the best rows of the atlas without refinement.
    prefer : {"balanced", "error", "size", "transmission", "crank_span", "layers"}, optional
        Merit by which linkages that are accurate enough are ranked: "balanced" weighs size, pivots, transmission angle and
        swing of the crank, then smallest error, smallest links and reach, best transmission angle, shortest swing of the
        crank, or layers in which nothing passes over the fixed pivots (this includes an ``assembly``).
        Default: "size" with tolerances, "balanced" with free timing, otherwise "error".
    diverse : bool
        For four-bars only: spread the solutions over families, branches and positions; their objective is at most twice the best
        objective.
    tolerance : float
        Objective below which the search ends.
    budget : float, optional
        Time limit in seconds; the best linkages found by then are returned. Without a limit, and with one kind of linkage that
        has rails or slots, alternatives to an exact linkage are searched for as long again as it took, at least 20 ms.
    start_from : sequence of Linkage, Solution or mapping, optional
        Linkages that are candidates from the first step, for example the displayed solution while a motion is changed: solutions
        of a reply, or ``joints`` of a four-bar, see `Linkage.from_points`. Each is refined within the limits before the search
        begins: with the preference "balanced" a four-bar until its error is small or almost stops falling, otherwise to its
        nearest optimum. ``report.start_from_ranks`` has the rank of each result. With free timing a four-bar needs its ``mount``
        or ``joints``, and ``crank_angle`` if it is known.
    refine_only : bool
        Search nowhere else: only the linkages of ``start_from`` are refined, which need not lead to the best linkage.
    atlas : Atlas, str or Path, optional
        The atlas for effort "atlas"; default: see `match`.
    work : callable
        Makes the object that watches time and cancellation from a budget in seconds.
    mechanisms : sequence of str or "all", optional
        Kinds of mechanism: "four_bar", "slider_crank", "swinging_block", "rail_slot", "two_rails", "two_slots".
        Default: the kinds of ``start_from``, or else "four_bar".
        With several kinds the result is the Pareto front of error, size and transmission angle for each drive.
    driver : {"crank", "slider", "cylinder", "hinge"}, optional
        Restrict the search to linkages with this drive.
    **more
        Arguments of `Motion` if ``motion`` holds arrays; and studies of each solution within the budget, see `Solution.studied`.

    Returns
    -------
    Result
        Linkages, best first, with a report.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.
    TypeError
        If there is no argument of this name; the error lists similar names.

    Examples
    --------
    >>> import numpy as np, linkage_atlas as la
    >>> rotation = la.FourBar(19, 72, 144, 165, start_angle=30).joints(np.linspace(0, 70, 16)).rotation
    >>> la.synthesize(la.Motion(rotation, crank_span=70), la.Limits(link_ratio_max=12), top=1).status
    'reached'
    >>> la.synthesize(rotation, crank_span=70, top=1).status
    'reached'
    """
    arguments = locals()
    options = SearchOptions(**{name: arguments[name] for name in SearchOptions.__dataclass_fields__})
    task = read_task(motion, limits, options, more, work)
    search = CandidateSearch(task)
    candidates = find_candidates(task, search)
    solutions = finish_candidates(task, candidates)
    ranked = rank_solutions(task, candidates, solutions)
    notes = notes_of(task, search, candidates, ranked)
    return Result(ranked.status, ranked.solutions, report_of(task, candidates, ranked, notes))
