"""The enumeration of dimension types agrees with three nested loops.

A type that is missing, repeated or not a full crank would show here.
"""

from itertools import permutations

import pytest

from synthesis.fourbar.dimension_types import OrderRule, TypeRule, count_types, enumerate_types
from tests.oracles import naive

REMAINING = list(permutations((1, 2, 3)))
POSITIONS = {
    OrderRule.INCREASING: [(0, 1, 2, 3)],
    OrderRule.CRANK_SHORTEST: [(0, *remaining) for remaining in REMAINING],
    OrderRule.FULL_CRANK: [(0, *remaining) for remaining in REMAINING] + [(*remaining, 0) for remaining in REMAINING],
}


@pytest.mark.parametrize("order", OrderRule)
def test_types_are_those_of_three_loops(order) -> None:
    counts = set()
    for perimeter in [*range(4, 40), 61, 80]:
        for smallest in (1, 2, 3, 7, perimeter):
            rule = TypeRule(perimeter, smallest, order)
            found = enumerate_types(rule)
            assert found.shape == (count_types(rule), 4)
            assert [tuple(row) for row in found.tolist()] == naive.types(perimeter, smallest, POSITIONS[order])
            counts.add(len(found))
    assert 0 in counts and len(counts) > 15
