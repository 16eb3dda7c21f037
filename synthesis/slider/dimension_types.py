"""Enumeration of slider-cranks: all of whole lengths and one sum whose crank turns fully, mirror images once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError

MAX_PERIMETER = 10_000
"""Largest sum; the count is about its square over 8."""


@dataclass(frozen=True)
class SliderTypeRule:
    """What an atlas of slider-cranks enumerates.

    ``perimeter``: crank, rod and offset add up to it. ``smallest``: smallest crank.
    """

    kind: ClassVar[str] = "slider_crank"
    perimeter: int = 640
    smallest: int = 2

    def __post_init__(self) -> None:
        if not 1 <= self.smallest:
            raise FieldError("/smallest", f"the smallest crank must be at least 1, found {self.smallest}")
        if not 4 <= self.perimeter <= MAX_PERIMETER:
            raise FieldError("/perimeter", f"must be from 4 to {MAX_PERIMETER}, found {self.perimeter}")


def _per_crank(rule: SliderTypeRule) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The cranks, and how many offsets each has: r + e < l with r + l + e the sum reads r + e < sum / 2."""
    half = (rule.perimeter + 1) // 2
    crank = np.arange(rule.smallest, max(half, rule.smallest), dtype=np.int64)
    return crank, half - crank


def count_slider_types(rule: SliderTypeRule) -> int:
    """How many types `enumerate_slider_types` gives, without making them."""
    return int(_per_crank(rule)[1].sum())


def enumerate_slider_types(rule: SliderTypeRule, begin: int = 0, end: int | None = None) -> NDArray[np.int32]:
    """The dimension types of a rule, (crank, rod, offset), ordered by crank and offset, or those of some rows.

    Whole lengths that add up to the sum: offset at least 0, crank at least ``smallest``, and strictly crank + offset < rod.
    So each linkage is there once up to scale: a negative offset is the mirror image, branch -1 of its type, and the second way
    to assemble it is, half a turn on, that mirror image's. Type number n (counted from 1) is row n - 1.

    ``begin``, ``end``: rows, as of a slice.

    Shape (types, 3). May be empty. Law: the rows from ``begin`` to ``end`` are that slice of all.
    """
    crank, count = _per_crank(rule)
    before = np.concatenate([[0], np.cumsum(count)])
    begin, end, _ = slice(begin, end).indices(int(before[-1]))
    rows = np.arange(begin, max(begin, end))
    place = np.searchsorted(before, rows, side="right") - 1
    offset = rows - before[place]
    chosen = crank[place] if crank.size else rows
    return np.stack([chosen, rule.perimeter - chosen - offset, offset], axis=1).astype(np.int32)
