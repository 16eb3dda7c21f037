"""A budget expires exactly when it is used up, and cancellation ends the work at each check.

The clock counts its readings, so that an early, a late or an additional reading shows.
"""

from itertools import count

import pytest

from synthesis.work import Cancelled, Work


def ticking() -> count:
    return count().__next__


@pytest.mark.parametrize("budget", [1, 2, 5])
def test_the_budget_expires_when_it_is_used_up_and_not_before(budget) -> None:
    work = Work(budget, clock=ticking())  # the first reading, 0, is the start
    assert [work.expired() for _ in range(budget + 2)] == [False] * (budget - 1) + [True] * 3


def test_time_starts_with_the_work_and_not_with_the_clock() -> None:
    clock = count(1000.0, 0.25).__next__
    work = Work(1.0, clock=clock)
    assert [work.elapsed for _ in range(3)] == [0.25, 0.5, 0.75]
    assert work.expired()


@pytest.mark.parametrize("check", [Work.check, Work.expired], ids=["check", "expired"])
def test_every_check_ends_cancelled_work(check) -> None:
    needed = True
    work = Work(10, lambda: not needed, ticking())
    check(work)
    needed = False
    for _ in range(2):
        with pytest.raises(Cancelled):
            check(work)


def test_cancellation_takes_precedence_over_expiry() -> None:
    with pytest.raises(Cancelled):
        Work(0.0, lambda: True).expired()
