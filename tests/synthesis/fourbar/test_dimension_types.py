"""The enumeration of dimension types agrees with three nested loops.

A type that is missing, repeated or not a full crank would show here.
"""

from itertools import permutations

import numpy as np
import pytest

from synthesis.errors import FieldError
from synthesis.four_bar import Family, family
from synthesis.fourbar.dimension_types import MAX_PERIMETER, OrderRule, TypeRule, count_types, enumerate_types
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


def test_every_type_turns_fully_and_no_two_are_equal() -> None:
    for order, families in (
        (OrderRule.CRANK_SHORTEST, {Family.CRANK_ROCKER}),
        (OrderRule.FULL_CRANK, {Family.CRANK_ROCKER, Family.DOUBLE_CRANK}),
    ):
        types = enumerate_types(TypeRule(120, 2, order))
        assert set(family(types)) == families
        assert np.all(types.sum(axis=1) == 120) and len(np.unique(types, axis=0)) == len(types)


BAD = [((400, 0), "/smallest"), ((400, -3), "/smallest")]
BAD += [((perimeter, 2), "/perimeter") for perimeter in (3, -400, MAX_PERIMETER + 1)]


@pytest.mark.parametrize(("arguments", "field"), BAD)
def test_bad_values_are_refused_by_name(arguments, field) -> None:
    with pytest.raises(FieldError) as caught:
        TypeRule(*arguments)
    assert caught.value.field == field and str(arguments[0 if "per" in field else 1]) in caught.value.message


def test_unknown_order_is_refused() -> None:
    assert TypeRule(60, 2, "full_crank").order is OrderRule.FULL_CRANK
    with pytest.raises(ValueError, match="sideways"):
        TypeRule(60, 2, "sideways")
