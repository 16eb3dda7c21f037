"""The knotter's strongest baseline finds what the cells find."""

from __future__ import annotations

import numpy as np

from benchmarks import knotter


def test_brents_entries_are_those_of_the_cells() -> None:
    """To 1e-11 degrees: the roots are good to some roundings of an angle of 2 rad, 1e-13 degrees."""
    nine = knotter.pairs_of(*map(np.array, zip(*knotter.PAIRS)))
    assert np.degrees(np.max(np.abs(knotter.bracketed(nine, 9) - knotter.cells(nine, 9)))) < 1e-11
