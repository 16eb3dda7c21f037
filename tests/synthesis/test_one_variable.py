"""Minima of functions of one variable: against places that are known."""

import numpy as np
import pytest

from synthesis.one_variable import golden_section


def test_golden_section_finds_kinks_and_round_minima_of_many_functions_at_once() -> None:
    place = np.array([0.1, 0.5, 2.0, 3.0])
    value, found = golden_section(lambda x: np.abs(x - place) + 0.25, np.zeros(4), np.full(4, 3.0), 60)
    assert found == pytest.approx(place, abs=1e-11) and value == pytest.approx(0.25, abs=1e-11)
    value, found = golden_section(lambda x: (x - place) ** 2, np.zeros(4), np.full(4, 3.0), 60)
    assert found == pytest.approx(place, abs=1e-7) and value == pytest.approx(0, abs=1e-14)
