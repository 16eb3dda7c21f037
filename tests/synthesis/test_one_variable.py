"""Golden-section search finds known minima of scalar functions, kinks included.

A bracket that loses its minimum would show here.
"""

import numpy as np
import pytest

from synthesis.one_variable import golden_section


def test_golden_section_finds_kinks_and_round_minima_of_many_functions_at_once() -> None:
    position = np.array([0.1, 0.5, 2.0, 3.0])
    value, found = golden_section(lambda x: np.abs(x - position) + 0.25, np.zeros(4), np.full(4, 3.0), 60)
    assert found == pytest.approx(position, abs=1e-11) and value == pytest.approx(0.25, abs=1e-11)
    value, found = golden_section(lambda x: (x - position) ** 2, np.zeros(4), np.full(4, 3.0), 60)
    assert found == pytest.approx(position, abs=1e-7) and value == pytest.approx(0, abs=1e-14)
