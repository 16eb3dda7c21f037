"""Which answers come first: exact ones, then near ones that stay on their curve between samples."""

import numpy as np
import pytest

from synthesis.ranking import behind


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
