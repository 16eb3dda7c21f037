"""The search for linkages of two guides, sliders among them, whose drive is free or prescribed.

Data flow of a request::

    poses -> exact guides (rails and slots in closed form, circles by the four-bar's dyads) -> their pairs, refined together
      -> if those do not answer: guides of points all over the body and the ground -> pairs, the best of each kind and drive
      -> rounds within the limits (`synthesis.search.multistart`) -> answers, examined on the linkage's own motion

All kinds and drives share the rounds of one search (`synthesis.guided.problem`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.guided.problem import Candidates, DrivenOptions, DrivenPairProblem, PairOptions, PairProblem
from synthesis.guided.seeds import Drive, drives
from synthesis.guides import Driver, Kind
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.search.multistart import Incumbents, MultiStart
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.solution import Solution
from synthesis.target import TURN
from synthesis.work import UNLIMITED, Work

ALTERNATIVES_TIME = 0.02
"""Minimum time in seconds for alternatives to an exact linkage, if the search may end soon."""


_HINGE = "the body returns without a full turn, but in these linkages it is driven by a hinge that turns fully."
_SLIDER = "the body makes a full turn, which is impossible if a crank drives a slider."
_ROUND = "No linkage of these kinds passes this closed path: "
_LEADS = "No linkage of these kinds was found for this closed path. Only rotations of the best four-bars were tried, with which "
NOTHING_ROUND = {
    (from_other_drive, turns): words + why
    for from_other_drive, words in ((False, _ROUND), (True, _LEADS))
    for turns, why in ((False, _HINGE), (True, _SLIDER))
}
"""Reason for an empty result, by the origin of the rotations (a four-bar or not), and by full turns of the body."""


def search_guided(
    poses: Poses,
    limits: Limits,
    kinds: Sequence[Kind],
    driver: Driver | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work = UNLIMITED,
    prescribed: Floats | None = None,
    turned: Floats | None = None,
    rounds: int | None = None,
    soon: bool = False,
) -> tuple[list[Solution], SearchReport]:
    """Find the best linkages with sliders for poses whose drive is free or prescribed.

    Parameters
    ----------
    poses : Poses
        At least two samples with both rotation and position, or positions only.
    limits : Limits
    kinds : sequence of Kind
        Kinds to search; each has at least one rail or slot.
    driver : Driver, optional
        Required driver of the linkages.
    tolerance : float
        Error below which a linkage is exact.
    work : Work, optional
        When it has expired, the best solutions so far are returned.
    prescribed : ndarray, shape (N,), optional
        Drive at the samples from the first sample: radians, or lengths, as ``driver`` requires. Without a driver it is the drive
        of sliders and cylinders.
    turned : ndarray, shape (N,), optional
        Initial rotations if the request has none, for example the rotations of a four-bar on the same path.
    rounds : int, optional
        Largest number of rounds.
    soon : bool
        True if the search for alternatives to the first exact linkage may take only as long as the search for it, at least 20 ms.

    Returns
    -------
    solutions : list of Solution
        Best different solutions of each kind and drive, in no order, since the error is not the only criterion. With more time no
        smallest error increases.
    report : SearchReport
    """
    candidates_of_drives = drives(kinds, driver)
    if prescribed is not None and driver is None:
        candidates_of_drives = [drive for drive in candidates_of_drives if not drive.driver.turns]
    round_once = _comes_round_turned(poses, turned) if poses.closed else None
    if poses.closed:  # round and round goes only what turns
        candidates_of_drives = [drive for drive in candidates_of_drives if _goes_round(drive, round_once)]
    if not candidates_of_drives:
        notes = [] if round_once is None else [NOTHING_ROUND[turned is not None, round_once]]
        return [], SearchReport(StoppedBy.CONVERGED, [], seeds=0, notes=notes)
    search = PairSearch(poses, limits, candidates_of_drives, tolerance, work, prescribed, turned, rounds, soon)
    complete = search.run()
    solutions = search.solutions()
    reached = search.incumbents.reached or (soon and search.incumbents.smallest < tolerance)
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if complete else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, search.trace, seeds=search.problem.seeds)


class PairSearch:
    """Search for a single request: it chooses the seeds of the multistart search.

    ``prescribed`` (N,): prescribed drive from the first sample, in radians or in the unit of length.
    """

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        drive_list: Sequence[Drive],
        tolerance: float,
        work: Work,
        prescribed: Floats | None = None,
        turned: Floats | None = None,
        rounds: int | None = None,
        soon: bool = False,
    ) -> None:
        self.work, self.soon, self.trace = work, soon, list[tuple[float, float]]()
        self.incumbents = Incumbents(tolerance, self._note, len(drive_list))
        options = PairOptions() if prescribed is None else DrivenOptions()
        if turned is not None:
            options = replace(options, idle_rounds=options.idle_rounds_led)
        self.max_rounds = options.max_rounds if rounds is None else rounds
        problem = PairProblem if prescribed is None else DrivenPairProblem
        self.problem = problem(poses, limits, drive_list, self.incumbents, work, options, turned, prescribed)
        self.multistart = MultiStart(self.problem, self.incumbents, work, options)

    def _note(self, smallest: float) -> None:
        """Write down the smallest error; once it is exact, limit the time for alternatives if the request allows that."""
        self.trace.append((self.work.elapsed, smallest))
        if self.soon and smallest < self.incumbents.tolerance:
            self.soon, work = False, self.work.ending_in(max(ALTERNATIVES_TIME, self.work.elapsed))
            self.work = self.problem.work = self.multistart.work = work

    def run(self) -> bool:
        """Search until nothing is gained or the time is up. Return whether the search is complete."""
        incumbents = self.incumbents
        exact = self.problem.exact()
        if exact is not None:
            self.multistart.accept(self._timed(exact))
        if incumbents.reached or (self.work.expired() and np.isfinite(incumbents.smallest)):
            return incumbents.reached
        for _ in self.multistart.run(self._seeds(exact), self.max_rounds):
            if self.work.expired():
                return False
        return not self.work.expired()

    def refine(self, linkage: Linkage) -> None:
        """Refine a given linkage, without a search elsewhere."""
        problem, starts = self.problem, self.problem.pair_of(linkage)
        schedule = problem.options.schedule
        for stages in (schedule.first, schedule.end) if isinstance(problem, DrivenPairProblem) else (schedule.end,):
            self.multistart.accept(problem.converge(starts, stages))

    def _timed(self, exact: Candidates) -> Candidates:
        """Return exact pairs, the best of them with the prescribed drive if there is one."""
        problem = self.problem
        if not isinstance(problem, DrivenPairProblem):
            return exact
        best = problem.best(exact, problem.options.seeds, problem.few)
        return problem.timed(best, problem.options.schedule.first)

    def _seeds(self, exact: Candidates | None) -> Iterator[Candidates]:
        """Yield the seeds of the first round."""
        problem = self.problem
        seeds = problem.seed_pairs()
        if exact is not None and not isinstance(problem, DrivenPairProblem):
            seeds = seeds.joined(problem.best(exact, problem.options.exact_seeds, problem.few))
        yield seeds

    def solutions(self) -> list[Solution]:
        """Return the best answers of each drive, with those that were no gain when they were found."""
        problem, pool = self.problem, self.incumbents.pools.get(None)
        if pool is None:
            return []
        options = problem.options
        if problem.waiting is not None:
            count = max(options.further[0] // problem.groups, options.further[1])
            waiting = self.multistart.basins(problem.waiting, options.max_pool, options.answer_distance)
            both = self.multistart.basins(pool.joined(waiting), count, options.answer_distance)
            good = []
            for index in range(both.cost.size):
                candidate = both.take([index])
                good.append(
                    problem.is_answer(candidate) or (not self.work.expired() and not problem.missing(candidate))
                )
            pool = pool.joined(both.take(np.array(good, dtype=bool)))
            pool = self.multistart.basins(pool, options.max_pool, options.answer_distance)
        return problem.solutions(pool)


def _comes_round_turned(poses: Poses, turned: Floats | None) -> bool | None:
    """Return True if the body makes whole turns over a closed path according to its angles; None if some are missing."""
    rotation = turned if poses.rotation is None or poses.rotation_weights is not None else poses.rotation
    if rotation is None:
        return None
    steps = np.diff(np.append(rotation, rotation[0]))
    return bool(round(float(np.sum(steps - TURN * np.round(steps / TURN))) / TURN))


def _goes_round(drive: Drive, turned: bool | None) -> bool:
    """Return True if a drive may turn fully, with or without the body turning."""
    if drive.kind is Kind.RAIL_SLOT or not drive.driver.turns:  # its slot never passes the rail's direction
        return False
    if turned is None:
        return True
    return turned if drive.driver is Driver.HINGE else not turned or drive.kind is not Kind.SLIDER_CRANK
