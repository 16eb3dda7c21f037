"""A motor and its linkage move as a single mechanism.

A rod that changes its length would show here.
"""

import numpy as np
import pytest

from synthesis.drives.six_bar import Motor, SixBar
from synthesis.linkage import four_bar
from synthesis.target import TURN, Interval
from tests.oracles.assembly import other_six_bars

WATT = four_bar((30.0, 60.0, 70.0, 50.0), 1, np.deg2rad(40.0), 3 - 2j, 0.2, (40.0, 0.5), 0.1)
USED = Interval(0.0, np.deg2rad(60.0))
TURNED = np.linspace(0.0, 2 * TURN, 97)


def watt() -> SixBar:
    """The motor of the assembly's example, turned and moved with the linkage."""
    at = 3 - 2j + (74.76662388200997 - 5.0943059670631925j) * np.exp(0.2j)
    return SixBar.of(WATT, USED, Motor("crank", complex(at), 12.0, 72.0, 24 + 0j))


CASES = [*((SixBar.of(*case), case[0]) for case in other_six_bars(6)), (watt(), WATT)]


@pytest.mark.parametrize(("six", "linkage"), CASES)
def test_everywhere_the_rod_keeps_its_length_and_the_linkage_its_way(six, linkage) -> None:
    assert np.abs(six.rod(TURNED)) == pytest.approx(np.full(TURNED.size, six.motor.rod), rel=1e-12)
    at = six.travel(np.linspace(0, TURN, 1001))
    first, last = six.used
    assert at.min() >= first - 1e-9 and at.max() <= last + 1e-9
    assert six.travel(np.array([0.0, six.last, TURN])) == pytest.approx([first, last, first], abs=1e-9)
    rising = np.linspace(0, six.last, 400)
    assert np.all(np.diff(six.travel(rising)) > 0)
    assert np.all(np.diff(six.travel(rising - six.last)[::-1]) > 0) or six.last != TURN / 2
    # there and back by the other formula
    inner = six.travel(np.array([0.3, 1.7, 3.0, 4.4, 5.9]))
    assert np.abs(six.turned(inner) - [0.3, 1.7, 3.0, 4.4, 5.9]).min(axis=0) == pytest.approx(np.zeros(5), abs=1e-7)
    forwards = six.forwards(inner)
    assert six.travel(forwards) == pytest.approx(inner, abs=1e-9)
    assert np.all(forwards * six.sense >= 0)
    assert np.all(np.abs(forwards) <= max(six.last, TURN - six.last) + 1e-9)


@pytest.mark.parametrize(("six", "linkage"), CASES)
def test_a_dwell_is_as_long_as_the_linkage_is_near_an_end(six, linkage) -> None:
    positions, (first, last) = np.linspace(0, TURN, 10_001), six.used
    at = np.interp(np.linspace(0, TURN, 200_001), positions, six.travel(positions))
    for end, found in zip((first, last), six.dwell(0.05)):
        assert TURN * np.mean(np.abs(at - end) <= 0.05 * (last - first)) == pytest.approx(found, abs=1e-4)
