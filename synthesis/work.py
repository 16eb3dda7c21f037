"""Time budget and cancellation of a long computation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from copy import copy

OVERRUN_MAX = 0.25
"""Seconds by which work without a result may exceed its budget."""


class Cancelled(Exception):
    """Raised when the result is no longer needed.

    Examples
    --------
    >>> try:
    ...     Work(cancelled=lambda: True).check()
    ... except Cancelled:
    ...     print("cancelled")
    cancelled
    """


class OutOfTime(Exception):
    """Raised when the budget is used up before there is a result.

    Examples
    --------
    >>> try:
    ...     Work(budget=0).go_on()
    ... except OutOfTime:
    ...     print("no time left")
    no time left
    """


class Work:
    """A time budget that starts when the object is created, and a means of cancelling the computation.

    A long computation checks its `Work` between its steps: `expired` if the best candidate so far is a usable result, and
    `go_on` if there is no result yet.

    Parameters
    ----------
    budget : float, optional
        Seconds; without a value there is no limit.
    cancelled : callable, optional
        Returns True once the result is no longer needed; called at each check.
    clock : callable, optional
        Returns the seconds of a monotonic clock.

    Examples
    --------
    >>> work = Work(budget=10)
    >>> work.budget, work.expired()
    (10, False)
    >>> Work(budget=0).expired()
    True
    """

    def __init__(
        self,
        budget: float | None = None,
        cancelled: Callable[[], bool] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._cancelled = cancelled
        self._clock = clock
        self._begin = clock()
        self._budget = math.inf if budget is None else budget
        self._has_result: Callable[[], bool] = lambda: True

    def check(self) -> None:
        """Raise `Cancelled` if the result is no longer needed."""
        if self._cancelled is not None and self._cancelled():
            raise Cancelled

    def expired(self) -> bool:
        """Return True if the budget is used up; raise `Cancelled` like `check`."""
        self.check()
        overrun = self.elapsed - self._budget
        return overrun >= 0 and (overrun >= OVERRUN_MAX or self._has_result())

    def go_on(self) -> None:
        """Raise `OutOfTime` if the budget is used up, and `Cancelled` like `check`.

        This check is meant for a computation that has no result until its end.
        """
        if self.expired():
            raise OutOfTime

    def extended(self, fraction: float) -> Work:
        """Return the same work with its budget increased by a fraction of itself, or reduced by it if negative.

        A search with a reduced budget leaves time to complete its results.
        """
        work = copy(self)
        work._budget = self._budget * (1 + fraction)
        return work

    @property
    def budget(self) -> float:
        """Total budget in seconds; infinite without a limit."""
        return self._budget

    @property
    def elapsed(self) -> float:
        """Seconds since the work began."""
        return self._clock() - self._begin

    def awaiting(self, has_result: Callable[[], bool]) -> Work:
        """Return the same work whose budget ends it only once there is a result, or a quarter of a second later."""
        work = copy(self)
        work._has_result = has_result
        return work

    def ending_in(self, seconds: float) -> Work:
        """Return the same work that ends after at most ``seconds`` from now."""
        work = copy(self)
        work._budget = min(self._budget, self.elapsed + seconds)
        return work

    def part(self, seconds: float) -> Work:
        """Return new work that starts now, with at most ``seconds`` and at most the rest of this budget."""
        return Work(max(0.0, min(seconds, self._budget - self.elapsed)), self._cancelled, self._clock)


UNLIMITED = Work()
"""Unlimited time, never cancelled."""
