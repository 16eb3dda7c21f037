"""Windows of a table (a type, a branch and a start) with their errors, and the best of those evaluated so far.

Windows are ordered by their *place*: the error in steps of `TIE`, then number of the type, start and branch. The place of a
window by a lower bound of its error is never behind its true place. Windows are therefore evaluated in the order of these
places, and once the next place is behind the last of the best, no other window belongs to the best.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats, Ints, rows_at, rows_of_all

TIE = 1e-12
"""Errors (radians, or the objective's unit) that agree to this are ties, broken by number, start, branch."""
FIRST_BATCH = 64
"""Number of windows in the first batch that is evaluated; each further batch is twice as large."""
_TRIED_FIRST = 4
_ROUNDING = 1e-14
"""Relative rounding of a bound and of an error."""


class Windows(NamedTuple):
    """Windows as columns: row of the type (number - 1), number of the start, branch, and error."""

    row: Ints
    start: Ints
    branch: Ints
    error: Floats


_NOTHING: Ints = np.empty(0, dtype=np.int64)
NO_WINDOWS = Windows(_NOTHING, _NOTHING, _NOTHING, np.empty(0))


def best_of(windows: Windows, top: int) -> Windows:
    """Return the best ``top`` windows by error, ties by number, start, branch."""
    order = np.lexsort((windows.branch < 0, windows.start, windows.row, steps_of(windows.error)))
    return rows_at(windows, order[:top])


class ScanReport(NamedTuple):
    """Number of windows, of those evaluated from the lengths after a first look, and whether the answer is proved the best."""

    windows: int
    evaluated: int
    exhaustive: bool


class WindowRank(NamedTuple):
    """Place of a window: error in steps of `TIE`, and rank among windows of the same step."""

    step: float
    rank: float


NOWHERE = WindowRank(np.inf, np.inf)


def steps_of(errors: Floats) -> Floats:
    """Return errors in steps of `TIE`."""
    return np.round(errors / TIE)


def lowest_steps(bounds: Floats) -> Floats:
    """Return the smallest step of windows with some lower bounds, whatever the rounding of bound and error was."""
    return steps_of(np.maximum(bounds * (1 - _ROUNDING) - TIE / 8, 0.0))


class Numbering(NamedTuple):
    """Numbers of windows: type by type, all starts of branch +1 and then of branch -1."""

    starts: int

    @property
    def per_type(self) -> int:
        """Number of windows of a type."""
        return 2 * self.starts

    def ids(self, windows: Windows) -> Ints:
        """Return the numbers of windows."""
        return (2 * windows.row + (windows.branch < 0)) * self.starts + windows.start

    def windows(self, ids: Ints) -> Windows:
        """Return windows by number, with errors of zero."""
        row, column = np.divmod(ids, self.per_type)
        return Windows(row, column % self.starts, np.where(column < self.starts, 1, -1), np.zeros(ids.size))

    def ranks(self, ids: Ints) -> Ints:
        """Return the order of windows by type, start, branch."""
        row, column = np.divmod(ids, self.per_type)
        return (row * self.starts + column % self.starts) * 2 + column // self.starts

    def at_ranks(self, row: Ints, within: Ints) -> Ints:
        """Return the numbers of the windows that come at some index among those of their type."""
        return (2 * row + within % 2) * self.starts + within // 2


class BestWindows:
    """Best of the windows evaluated so far.

    ``windows``: at most ``top``, in order. ``last``: place of the last of them; `NOWHERE` if there are fewer than ``top``.

    Parameters
    ----------
    top : int
        Number of windows wanted.
    exact : callable
        ``exact(windows) -> error``; infinite for windows that are no answer.
    at_once : int
        Largest number of windows evaluated together.
    expired : callable
        Whether the time is up; called between evaluations.
    enough : float
        Once ``top`` windows have an error of at most this, the search ends.
    max_windows : float
        Largest number of windows evaluated.
    """

    def __init__(
        self,
        top: int,
        numbering: Numbering,
        exact: Callable[[Windows], Floats],
        at_once: int,
        expired: Callable[[], bool],
        enough: float = -1.0,
        max_windows: float = np.inf,
    ) -> None:
        self.windows, self.last, self.evaluated = NO_WINDOWS, NOWHERE, 0
        self.numbering, self.top, self.enough, self.most = numbering, top, enough, max_windows
        self._exact, self._expired, self._at_once = exact, expired, max(1, at_once)
        self.cut_short = False

    @property
    def worst(self) -> float:
        """Error of the last window; infinite if there are fewer than wanted."""
        return float(self.windows.error[-1]) if self.windows.row.size == self.top else np.inf

    @property
    def stopped(self) -> bool:
        """True if the scan must stop: the time is up, all windows are good enough, or too many have been evaluated."""
        if not self.cut_short:
            self.cut_short = self.worst <= self.enough or self.evaluated >= self.most or self._expired()
        return self.cut_short

    def evaluate(self, ids: Ints, known: Floats | None = None) -> Windows:
        """Evaluate windows and keep the best; return the answers among them with their errors.

        If errors are ``known``, only whether the windows are answers is evaluated: its rounding then breaks no tie.
        """
        windows = self.numbering.windows(ids)
        error = self._exact(windows)
        windows = windows._replace(error=error if known is None else np.where(np.isfinite(error), known, np.inf))
        windows = rows_at(windows, np.flatnonzero(np.isfinite(windows.error)))
        self.windows = best_of(rows_of_all(self.windows, windows), self.top)
        self.evaluated += ids.size
        if self.windows.row.size == self.top:
            last = rows_at(self.windows, np.array([-1]))
            rank = self.numbering.ranks(self.numbering.ids(last))
            self.last = WindowRank(float(steps_of(last.error)[0]), float(rank[0]))
        return windows

    def consider(self, ids: Ints, bounds: Floats) -> None:
        """Evaluate all windows that their bounds allow among the best, except those that are already among them."""
        steps, ranks = lowest_steps(bounds), self.numbering.ranks(ids)
        close = np.flatnonzero((steps < self.last.step) | ((steps == self.last.step) & (ranks < self.last.rank)))
        close = close[np.isin(ids[close], self.numbering.ids(self.windows), invert=True)]
        close = close[np.lexsort((ranks[close], steps[close]))]
        done, batch = 0, min(self._at_once, max(FIRST_BATCH, 2 * self.top))
        while (
            done < close.size and WindowRank(steps[close[done]], ranks[close[done]]) < self.last and not self.stopped
        ):
            self.evaluate(ids[close[done : done + batch]])
            done, batch = done + batch, min(2 * batch, self._at_once)

    def settled_in_order(self, types: int, alike: Floats | None) -> bool:
        """Evaluate windows by number, start and branch while each has the smallest possible error; return whether that suffices.

        Every four-bar meets three positions, for example, and every start of a type gives the same rotations if the samples lie
        whole turns of the crank apart.

        ``alike`` (types,): the error of each type if it is the same for all of its windows.
        """
        per_type = self.numbering.per_type
        total = int(min(types * per_type, self.most))
        rows = None if alike is None else np.argsort(steps_of(alike), kind="stable")
        done, batch = 0, _TRIED_FIRST
        while done < total:
            row, within = np.divmod(np.arange(done, min(done + batch, total)), per_type)
            row = row if rows is None else rows[row]
            ids, known = self.numbering.at_ranks(row, within), None if alike is None else alike[row]
            step = 0.0 if known is None else float(steps_of(known[0]))
            if not WindowRank(step, float(self.numbering.ranks(ids[:1])[0])) < self.last:
                return True
            if done and self.stopped:
                return True
            found = self.evaluate(ids, known)
            if known is None and 2 * np.count_nonzero(steps_of(found.error) == 0) < max(found.row.size, 1):
                return False
            done, batch = done + ids.size, min(2 * batch, self._at_once)
        self.cut_short = self.cut_short or done < types * per_type
        return True
