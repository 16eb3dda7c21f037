"""Windows of a table: a type, a branch and a start, with their errors; and the best of those that a scan has evaluated.

Windows are in order of their *place*: error in steps of `TIE`, then number, start and branch. The place that a window has by a
lower bound of its error is never behind its own, so windows are evaluated in the order of those places, and once the next
one's is behind the last of the best, none of the others is among them. A thousand or a million windows whose bounds are
equal are settled that way too, by number, start and branch, with as many evaluations as answers are wanted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints

TIE = 1e-12
"""Errors (radians, or the objective's unit) that agree to this are ties, broken by number, start, branch."""
FIRST_BATCH = 64
"""Windows that are evaluated at once, at first; while the next ones are as good it doubles."""
_TRIED_FIRST = 4
_ROUNDING = 1e-14
"""Relative rounding of a bound and of an error."""


class Windows(NamedTuple):
    """Windows as columns: row of the type (number - 1), number of the start, branch, and error."""

    row: Ints
    start: Ints
    branch: Ints
    error: Floats

    def take(self, index: NDArray[np.intp]) -> Windows:
        """The windows at some places."""
        columns: list[Any] = [column[index] for column in self]
        return Windows(*columns)


_NOTHING: Ints = np.empty(0, dtype=np.int64)
NO_WINDOWS = Windows(_NOTHING, _NOTHING, _NOTHING, np.empty(0))


def joined(parts: list[Windows]) -> Windows:
    """The windows of all parts, in order."""
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts)]
    return Windows(*columns)


def each_once(parts: list[Windows]) -> Windows:
    """The windows of all parts, each once; the errors of one window may differ in the last bits."""
    windows = joined(parts)
    _, first = np.unique(np.stack([windows.row, windows.start, windows.branch]), axis=1, return_index=True)
    return windows.take(first)


def best_of(windows: Windows, top: int) -> Windows:
    """The best ``top`` of some windows: by error, ties by number, start, branch."""
    order = np.lexsort((windows.branch < 0, windows.start, windows.row, np.round(windows.error / TIE)))
    return windows.take(order[:top])


class ScanReport(NamedTuple):
    """How much a scan looked at, and whether its answer is proved to be the best.

    ``evaluated`` are the windows whose error was computed from the lengths, after a first look at the most promising cells that
    computes those of 64 or more.
    """

    windows: int
    evaluated: int
    exhaustive: bool


class Place(NamedTuple):
    """A place in the order of windows: error in steps of `TIE`, and rank among those of the same step."""

    step: float
    rank: float

    @property
    def bound(self) -> float:
        """A number that no lower bound of a window up to this place exceeds."""
        return (self.step + 1) * TIE * (1 + 2 * _ROUNDING)


NOWHERE = Place(np.inf, np.inf)


def steps_of(errors: Floats) -> Floats:
    """Errors in steps of `TIE`."""
    return np.round(errors / TIE)


def lowest_steps(bounds: Floats) -> Floats:
    """The least step of windows with some lower bounds, whatever the rounding of bound and error was."""
    return steps_of(np.maximum(bounds * (1 - _ROUNDING) - TIE / 8, 0.0))


class Numbering(NamedTuple):
    """Numbers of windows: type by type, all starts of branch +1 and then of branch -1, if there is one."""

    starts: int
    branches: int = 2

    @property
    def per_type(self) -> int:
        """Windows of a type."""
        return self.branches * self.starts

    def ids(self, windows: Windows) -> Ints:
        """Numbers of windows."""
        return (self.branches * windows.row + (windows.branch < 0)) * self.starts + windows.start

    def windows(self, ids: Ints) -> Windows:
        """Windows by number, without errors."""
        row, column = np.divmod(ids, self.per_type)
        return Windows(row, column % self.starts, np.where(column < self.starts, 1, -1), np.zeros(ids.size))

    def ranks(self, ids: Ints) -> Ints:
        """Rank of windows among windows of the same error: by type, start, branch."""
        row, column = np.divmod(ids, self.per_type)
        return (row * self.starts + column % self.starts) * self.branches + column // self.starts

    def at_ranks(self, row: Ints, within: Ints) -> Ints:
        """Numbers of the windows of some types that come at some place among their type's."""
        return (self.branches * row + within % self.branches) * self.starts + within // self.branches


def lowest(numbering: Numbering, ids: Ints, bounds: Floats, count: int) -> tuple[NDArray[np.intp], Place]:
    """Which windows have the first ``count`` places by their bounds, and the first place of the others."""
    if ids.size <= count:
        return np.arange(ids.size), NOWHERE
    steps = lowest_steps(bounds)
    step = np.partition(steps, count)[count]
    before, at = np.flatnonzero(steps < step), np.flatnonzero(steps == step)
    ranks, wanted = numbering.ranks(ids[at]), count - before.size
    order = np.argpartition(ranks, wanted)
    return np.concatenate([before, at[order[:wanted]]]), Place(float(step), float(ranks[order[wanted]]))


class BestWindows:
    """The best of the windows that have been evaluated so far.

    ``windows``: at most ``top``, in order. ``last``: of the last of them; `NOWHERE` while there are fewer than ``top``.

    Parameters
    ----------
    top : int
        How many are wanted.
    exact : callable
        ``exact(windows) -> error``; infinite for windows that are no answer.
    at_once : int
        Most windows that are evaluated together.
    expired : callable
        Asked between evaluations, whether there is time for more.
    enough : float
        Once ``top`` windows have an error of at most this, no better ones are looked for.
    """

    def __init__(
        self,
        top: int,
        numbering: Numbering,
        exact: Callable[[Windows], Floats],
        at_once: int,
        expired: Callable[[], bool],
        enough: float = -1.0,
    ) -> None:
        self.windows, self.last, self.evaluated = NO_WINDOWS, NOWHERE, 0
        self.numbering = numbering
        self.top, self._exact, self._expired, self._enough = top, exact, expired, enough
        self.at_once = max(1, at_once)

    @property
    def worst(self) -> float:
        """Error of the last; infinite while there are fewer than wanted."""
        return float(self.windows.error[-1]) if self.windows.row.size == self.top else np.inf

    @property
    def reached(self) -> bool:
        """Whether all that are wanted are good enough."""
        return self.worst <= self._enough

    def evaluate(self, ids: Ints, known: Floats | None = None) -> Windows:
        """Evaluate windows, and keep the best; those that are answers, with their errors.

        Where errors are ``known``, only whether they are answers is asked: the rounding of an evaluation breaks no tie.
        """
        windows = self.numbering.windows(ids)
        error = self._exact(windows)
        windows = windows._replace(error=error if known is None else np.where(np.isfinite(error), known, np.inf))
        windows = windows.take(np.flatnonzero(np.isfinite(windows.error)))
        self.windows = best_of(joined([self.windows, windows]), self.top)
        self.evaluated += ids.size
        if self.windows.row.size == self.top:
            last = self.windows.take(np.array([-1]))
            rank = self.numbering.ranks(self.numbering.ids(last))
            self.last = Place(float(steps_of(last.error)[0]), float(rank[0]))
        return windows

    def consider(self, ids: Ints, bounds: Floats) -> None:
        """Evaluate all windows that may be among the best by their bounds; none of them again that is among them."""
        steps, ranks = lowest_steps(bounds), self.numbering.ranks(ids)
        near = np.flatnonzero((steps < self.last.step) | ((steps == self.last.step) & (ranks < self.last.rank)))
        if self.windows.row.size:
            near = near[np.isin(ids[near], self.numbering.ids(self.windows), invert=True)]
        near = near[np.lexsort((ranks[near], steps[near]))]
        done, batch = 0, min(self.at_once, max(FIRST_BATCH, 2 * self.top))
        while done < near.size and Place(steps[near[done]], ranks[near[done]]) < self.last:
            if self.reached or (self.evaluated and self._expired()):
                break
            self.evaluate(ids[near[done : done + batch]])
            done, batch = done + batch, min(2 * batch, self.at_once)

    def settled_in_order(self, types: int, alike: Floats | None, most: float) -> bool:
        """Evaluate windows by number, start and branch while each has the least error there can be; whether that is the answer.

        Every four-bar meets three positions, and every start of a type the same rotations when the samples lie whole turns
        of the crank apart.

        ``alike`` (types,): the error of each type, where it is the same for all of its windows. Default: no more is
        known than that none is below 0. ``most``: windows that are evaluated at most.
        """
        per_type = self.numbering.per_type
        total = int(min(types * per_type, most))
        rows = None if alike is None else np.argsort(steps_of(alike), kind="stable")
        done, batch = 0, _TRIED_FIRST
        while done < total:
            row, within = np.divmod(np.arange(done, min(done + batch, total)), per_type)
            row = row if rows is None else rows[row]
            ids, known = self.numbering.at_ranks(row, within), None if alike is None else alike[row]
            step = 0.0 if known is None else float(steps_of(known[0]))
            if not Place(step, float(self.numbering.ranks(ids[:1])[0])) < self.last or self.reached:
                return True
            if done and self._expired():
                return known is not None
            found = self.evaluate(ids, known)
            if known is None and 2 * np.count_nonzero(steps_of(found.error) == 0) < max(found.row.size, 1):
                return False
            done, batch = done + ids.size, min(2 * batch, self.at_once)
        return alike is not None or done >= types * per_type
