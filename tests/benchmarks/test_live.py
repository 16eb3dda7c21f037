"""Answers that follow a drag are as good as those of searches that take their time."""

from __future__ import annotations

import pytest

from benchmarks.engine import FRESH
from benchmarks.live import CLASSES, drag, near
from tests.conftest import some_of


@pytest.mark.parametrize(("kind", "seed"), some_of([(0, 6), (1, 5), (2, 6)], 1))
def test_a_drag_of_a_path_is_followed(kind, seed) -> None:
    """All five answers that are judged are near, or one is not; where nothing were kept of the last, one is at the most."""
    rows = list(drag(CLASSES["drawn path"][kind](FRESH + 500 + seed), seed, 0.3))
    assert sum(near(row) for row in rows if "final" in row) >= 4
    assert max(row["state"] for row in rows) < 30_000
