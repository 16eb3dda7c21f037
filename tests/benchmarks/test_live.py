"""Answers that follow a drag are as good as those of searches that take their time."""

from __future__ import annotations

import numpy as np

from benchmarks.engine import FRESH
from benchmarks.live import CLASSES, drag, near


def test_a_drag_is_followed() -> None:
    drags = (("drawn path", 0, 6), ("random poses", 1, 9))
    rows = [row for name, kind, seed in drags for row in drag(CLASSES[name][kind](FRESH + 500 + seed), seed, 0.5)]
    held = [near(row) for row in rows if "final" in row]
    assert len(held) == 10 and np.mean(held) >= 0.9
    assert max(row["state"] for row in rows) < 30_000
