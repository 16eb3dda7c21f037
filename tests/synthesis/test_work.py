"""Budgets of time and cancellation, with a clock that counts its readings."""

from itertools import count

import pytest

from synthesis.work import Cancelled, Work


def ticking() -> count:
    return count().__next__


@pytest.mark.parametrize("budget", [1, 2, 5])
def test_the_budget_runs_out_when_it_is_used_up_and_not_before(budget) -> None:
    work = Work(budget, clock=ticking())  # the first reading, 0, is the beginning
    assert [work.expired() for _ in range(budget + 2)] == [False] * (budget - 1) + [True] * 3


def test_time_begins_with_the_work_and_not_with_the_clock() -> None:
    clock = count(1000.0, 0.25).__next__
    work = Work(1.0, clock=clock)
    assert [work.elapsed for _ in range(3)] == [0.25, 0.5, 0.75]
    assert work.expired()


def test_without_a_budget_nothing_expires() -> None:
    work = Work(clock=count(step=10.0**300).__next__)
    assert not any(work.expired() for _ in range(100))
    assert Work(0.0).expired()


def test_a_check_reads_no_clock() -> None:
    work = Work(2, clock=ticking())
    for _ in range(10):
        work.check()
    assert work.elapsed == 1


@pytest.mark.parametrize("look", [Work.check, Work.expired], ids=["check", "expired"])
def test_every_look_at_cancelled_work_ends_it(look) -> None:
    wanted = True
    work = Work(10, lambda: not wanted, ticking())
    look(work)
    wanted = False
    for _ in range(2):
        with pytest.raises(Cancelled):
            look(work)


def test_cancelled_work_that_has_also_expired_is_cancelled() -> None:
    with pytest.raises(Cancelled):
        Work(0.0, lambda: True).expired()
