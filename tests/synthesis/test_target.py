"""Targets: what is checked, and which field is named."""

from __future__ import annotations

import numpy as np
import pytest

from synthesis.errors import FieldError
from synthesis.target import make_target

LINE = np.array([0.0, 1, 3, 4])


@pytest.mark.parametrize(
    "make", [lambda p: p.real.astype(int), lambda p: np.repeat(p, 2)[::2], list, lambda p: p.astype("c8")]
)
def test_positions_of_any_kind_of_array_are_the_same(make) -> None:
    plain = make_target(position=LINE + 0j, crank_span=1.0)
    other = make_target(position=make(LINE + 0j if make is not list else LINE), crank_span=1.0)
    assert np.array_equal(other.position, plain.position) and other.length_scale == plain.length_scale == 2.0


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({}, ""),
        ({"rotation": LINE}, "/crank_span"),
        ({"rotation": LINE, "crank_span": 1.0, "crank_angle": LINE}, "/crank_span"),
        ({"rotation": LINE[:2], "crank_span": 1.0}, "/rotation"),
        ({"rotation": LINE * np.nan, "crank_span": 1.0}, "/rotation/0"),
        ({"rotation": LINE, "position": LINE[:3], "crank_span": 1.0}, "/position"),
        ({"rotation": LINE, "crank_span": 0.0}, "/crank_span"),
        ({"rotation": LINE, "crank_span": np.inf}, "/crank_span"),
        ({"rotation": LINE, "crank_span": np.nan}, "/crank_span"),
        ({"rotation": LINE, "crank_angle": [0, 1, 1, 2]}, "/crank_angle/2"),
        ({"rotation": LINE, "crank_span": 1.0, "length_scale": 1.0}, "/length_scale"),
        ({"position": LINE * 0 + 7, "crank_span": 1.0}, "/position"),
        ({"position": LINE * 1e101, "crank_span": 1.0}, "/position"),
        ({"position": LINE, "crank_span": 1.0, "length_scale": 0.0}, "/length_scale"),
    ],
)
def test_what_is_wrong_is_named(fields, pointer) -> None:
    with pytest.raises(FieldError) as caught:
        make_target(**fields)
    assert caught.value.field == pointer
