"""The strongest baseline of the knotter's benchmark finds the same entries as the cells.

A baseline with a fault would make the comparison of errors and times meaningless.
"""

from __future__ import annotations

import numpy as np

from benchmarks import knotter


def test_entries_by_brents_method_agree_with_the_cells() -> None:
    """The tolerance is 1e-11 degrees; both roots have errors of a few roundings of an angle of 2 rad, 1e-13 degrees."""
    nine = knotter.knotters_at(*map(np.array, zip(*knotter.PAIRS)))
    assert np.degrees(np.max(np.abs(knotter.brent_entries(nine, 9) - knotter.cell_entries(nine, 9)))) < 1e-11
