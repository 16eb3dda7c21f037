"""Enumeration of the base dimension types: all four-bars of integer lengths with a given perimeter whose crank turns fully."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError

MAX_PERIMETER = 10_000
"""Largest perimeter; above it the count (about perimeter^3 / 580 for the first rule) exceeds the capacity of a machine."""


class OrderRule(StrEnum):
    """Orders of the four lengths that are enumerated."""

    INCREASING = "increasing"
    """L1 < L2 < L3 < L4: the published atlas."""
    CRANK_SHORTEST = "crank_shortest"
    """L1 the shortest, the other three in all six orders: all crank-rockers."""
    FULL_CRANK = "full_crank"
    """Crank or ground the shortest, the other three in all six orders: crank-rockers and double-cranks."""


@dataclass(frozen=True)
class TypeRule:
    """Rule of the types of an atlas.

    ``perimeter``: sum of the four lengths. ``smallest``: smallest length allowed for the shortest link (the paper's smallest
    crank).
    """

    perimeter: int = 400
    smallest: int = 2
    order: OrderRule = OrderRule.INCREASING

    def __post_init__(self) -> None:
        if not 1 <= self.smallest:
            raise FieldError("/smallest", f"the smallest crank must be at least 1, found {self.smallest}")
        if not 4 <= self.perimeter <= MAX_PERIMETER:
            raise FieldError("/perimeter", f"must be from 4 to {MAX_PERIMETER}, found {self.perimeter}")
        object.__setattr__(self, "order", OrderRule(self.order))


def _ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows ``first[i], first[i]+1, ...`` of ``count[i]`` numbers each, concatenated, and the row of each number."""
    count = np.maximum(count, 0)
    row = np.repeat(np.arange(count.size), count)
    within = np.arange(row.size) - np.repeat(np.cumsum(count) - count, count)
    return first[row] + within, row


def _pairs(rule: TypeRule) -> tuple[NDArray[np.int64], ...]:
    """Shortest and second length a < b, and for each pair the first third length c and how many there are."""
    total = rule.perimeter
    # d = total - a - b - c, so c < d reads 2c < total - a - b, and a + d < b + c reads 2(b + c) > total.
    a = np.arange(rule.smallest, max(rule.smallest, total // 4) + 1, dtype=np.int64)
    b, row = _ranges(a + 1, (total - a) // 3 - a)
    a = a[row]
    first = np.maximum(b, total // 2 - b) + 1
    return a, b, first, np.maximum((total - a - b + 1) // 2 - first, 0)


def _orders(rule: TypeRule) -> list[tuple[int, ...]]:
    """Places of the sorted lengths a, b, c, d in (L1, L2, L3, L4), as lists of indices into them."""
    if rule.order is OrderRule.INCREASING:
        return [(0, 1, 2, 3)]
    orders = [(0, *permutation) for permutation in permutations((1, 2, 3))]
    if rule.order is OrderRule.FULL_CRANK:
        orders += [(*permutation, 0) for permutation in permutations((1, 2, 3))]
    return orders


def count_types(rule: TypeRule) -> int:
    """Return the number of types of `enumerate_types` without building them."""
    return int(_pairs(rule)[3].sum()) * len(_orders(rule))


@lru_cache(maxsize=2)
def _all_types(rule: TypeRule) -> NDArray[np.int32]:
    a, b, first, count = _pairs(rule)
    c, row = _ranges(first, count)
    lengths = np.stack([a[row], b[row], c, rule.perimeter - a[row] - b[row] - c], axis=-1)
    found = np.concatenate([lengths[:, order] for order in _orders(rule)]).astype(np.int32)
    found = found[np.lexsort((found[:, 2], found[:, 1], found[:, 0]))]
    found.flags.writeable = False
    return found


def enumerate_types(rule: TypeRule, begin: int = 0, end: int | None = None) -> NDArray[np.int32]:
    """The dimension types of a rule, ordered by (L1, L2, L3), or those of some rows.

    With the four lengths sorted, a < b < c < d: all different, a at least ``smallest``, a + b + c + d the perimeter, and
    strictly a + d < b + c, Grashof's condition. Type number n (counted from 1) is row n - 1.

    ``begin``, ``end``: rows, as of a slice.

    Shape (types, 4). May be empty. Law: each row has the rule's perimeter and turns fully, and no two rows are equal;
    the rows from ``begin`` to ``end`` are that slice of all. Source: Sun, Liu, Chu, "Wavelet feature parameter method
    for rigid-body guidance synthesis", section on base dimension types: perimeter 400 gives 101,408 types, of which
    number 45,185 is (19, 72, 144, 165).
    """
    return _all_types(rule)[begin:end].copy()
