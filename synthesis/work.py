"""The time that a piece of work may take, and whether its answer is still wanted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from copy import copy


class Cancelled(Exception):
    """Nobody waits for the answer any more."""


class OutOfTime(Exception):
    """The budget is used up, and there is no answer yet."""


class Work:
    """A budget of time that begins now, and a way to end the work early.

    Long computations ask between their steps: `expired` where the best found so far is an answer, `go_on` where there
    is none yet.

    ``budget``: seconds; default: no limit. ``cancelled``: true once the answer is no longer wanted; asked at every look
    at the time. ``clock``: seconds of a monotonic clock.
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

    def check(self) -> None:
        """Raise `Cancelled` where the answer is no longer wanted."""
        if self._cancelled is not None and self._cancelled():
            raise Cancelled

    def expired(self) -> bool:
        """Whether the budget is used up. Raises `Cancelled` like `check`."""
        self.check()
        return self.elapsed >= self._budget

    def go_on(self) -> None:
        """Raise `OutOfTime` where the budget is used up (for work without an answer until its end); `Cancelled` like `check`."""
        if self.expired():
            raise OutOfTime

    def extended(self, share: float) -> Work:
        """The same work with its budget grown by a share, or shrunk: a search leaves time to finish what it finds."""
        longer = copy(self)
        longer._budget = self._budget * (1 + share)
        return longer

    @property
    def budget(self) -> float:
        """Seconds in all; infinite without a limit."""
        return self._budget

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return self._clock() - self._begin

    def part(self, most: float) -> Work:
        """Work of its own that begins now, with at most so many seconds and at most what is left of these."""
        return Work(max(0.0, min(most, self._budget - self.elapsed)), self._cancelled, self._clock)
