"""Answers that follow a drag are as good as those of searches that take their time."""

from __future__ import annotations

import numpy as np

from benchmarks.engine import FRESH
from benchmarks.live import CLASSES, drag, near


def test_a_drag_is_followed() -> None:
    drags = (("drawn path", 0, 6), ("drawn path", 1, 5), ("random poses", 1, 9))
    every = [list(drag(CLASSES[name][kind](FRESH + 500 + seed), seed, 0.3)) for name, kind, seed in drags]
    rows = [row for one in every for row in one]
    followed = [np.mean([near(row) for row in one if "final" in row]) >= 0.9 for one in every]
    assert sum(followed) >= 2  # one may begin in another valley than the best
    assert max(row["state"] for row in rows) < 30_000
