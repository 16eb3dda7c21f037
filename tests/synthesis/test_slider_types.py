"""The enumeration of slider-crank types agrees with a plain double loop.

A type that is missing, repeated or a mirror image of another type would show here.
"""

import numpy as np
import pytest

from synthesis.slider import SliderTypeRule, count_slider_types, enumerate_slider_types


def naive(rule: SliderTypeRule) -> list[tuple[int, int, int]]:
    """Return all whole lengths of the sum in order."""
    found = []
    for crank in range(rule.smallest, rule.perimeter + 1):
        for offset in range(rule.perimeter + 1):
            rod = rule.perimeter - crank - offset
            if crank + offset < rod:
                found.append((crank, rod, offset))
    return found


@pytest.mark.parametrize("perimeter", [4, 5, 17, 40, 41])
@pytest.mark.parametrize("smallest", [1, 2, 9, 30])
def test_the_types_are_those_of_the_plain_loop(perimeter: int, smallest: int) -> None:
    rule = SliderTypeRule(perimeter, smallest)
    found = enumerate_slider_types(rule)
    assert found.shape[1] == 3 and found.dtype == np.int32
    assert [tuple(row) for row in found.tolist()] == naive(rule)
    assert count_slider_types(rule) == len(found)


def test_the_default_has_more_than_fifty_thousand_none_of_which_is_another_or_its_mirror_image() -> None:
    lengths = enumerate_slider_types(SliderTypeRule())
    assert len(lengths) == 50_721
    ratios = lengths / lengths[:, :1]
    assert len(np.unique(np.round(np.abs(ratios), 12), axis=0)) == len(lengths)
    assert (lengths[:, 2] == 0).sum() == 318
    large = SliderTypeRule(10_000)
    assert enumerate_slider_types(large, count_slider_types(large) - 1).tolist() == [[4999, 5001, 0]]
