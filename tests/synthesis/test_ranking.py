"""Which answers come first: exact ones, then near ones that stay on their curve between samples, or are of fair size."""

import numpy as np
import pytest

from synthesis.ranking import behind, by_proportion


@pytest.mark.parametrize(
    ("objective", "strays", "groups"),
    [
        ([1e-12, 1e-12], [True, False], [1, 0]),
        ([1e-3, 4e-3], [True, False], [3, 2]),
        ([1e-3, 0.019, 0.021], [True, False, False], [3, 2, 3]),
        ([0.1, 0.19, 0.21], [True, False, False], [3, 2, 3]),
        ([1e-12, 1e-3], [True, False], [1, 2]),
        ([], [], []),
    ],
)
def test_answers_that_stray_come_after_near_ones_that_do_not(objective, strays, groups):
    found = behind(np.array(objective, dtype=float), np.array(strays, dtype=bool), 1e-10)
    assert found.tolist() == groups


@pytest.mark.parametrize(
    ("objective", "times", "order"),
    [
        ([1e-12, 1e-3], [1e9, 5], [0, 1]),  # an exact one stays first,
        ([1e-12, 1e-11, 1e-3], [1e9, 1e8, 5], [0, 2]),
        ([1e-12, 1e-3, 2e-3], [5, 1e4, 60], [0, 2]),  # and of others only those in proportion are shown
        ([1e-4, 2e-4, 0.019, 0.021], [1e4, 20, 10, 5], [1, 0, 2, 3]),
        ([1e-4, 0.021, 0.2], [1e4, 20, 1e5], [0, 1]),
        ([1e-4, 2e-4, 3e-4], [90, 1e4, 60], [0, 2]),
        ([1e-4, 2e-4, 3e-4], [1e4, 60, 1e7], [0, 1]),  # 60 is in proportion, and no fair size
        ([1e-4, 2e-4], [1e7, 1e8], [0, 1]),
    ],
)
def test_what_is_out_of_all_proportion_comes_behind_what_is_near(objective, times, order):
    found = by_proportion(np.array(objective), np.array(times, dtype=float), 1e-10)
    assert found.tolist() == order


@pytest.mark.parametrize("seed", range(5))
def test_the_best_is_among_the_first_two_and_nothing_is_shown_twice(seed):
    random = np.random.default_rng(seed)
    for _ in range(200):
        count = random.integers(1, 8)
        objective = np.sort(10.0 ** random.uniform(-13, 0, count))
        times = 10.0 ** random.uniform(0, 9, count)
        found = by_proportion(objective, times, 1e-10).tolist()
        assert 0 in found[:2] and len(set(found)) == len(found)
        assert found[0] == 0 or objective[0] >= 1e-10
        rest = [times[k] > 100 for k in found[found.index(0) + 1 :] if objective[k] >= 1e-10]
        assert rest == sorted(rest)
