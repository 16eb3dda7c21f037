"""A slider-crank whose rod is the body, from its formula: crank r, rod l, offset e, theta2 = asin((e - r sin theta1) / l)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from synthesis import kernel


def body_angle(lengths: np.ndarray, crank: np.ndarray) -> np.ndarray:
    """theta2, (n, N); NaN where the crank does not get there."""
    r, l, e = (column[:, None] for column in np.asarray(lengths, dtype=float).T)  # noqa: E741
    with np.errstate(invalid="ignore"):
        return np.arcsin((e - r * np.sin(crank)) / l)


class SliderCrankChart:
    """With r = 1: the rod beyond its least length, (l - r - |e|) / r = exp(x), and the offset as a part of it."""

    cell, hop = np.array([0.7, 0.5, 0.6]), np.array([0.7, 0.5, 0.4])
    edges = np.empty((0, 2))
    kind, sheet = kernel.SLIDER_CRANK, 0

    def shape(self, unknowns: np.ndarray) -> Any:
        excess, e = np.exp(np.clip(unknowns[:, 0], -20, 20)), unknowns[:, 1]
        return SimpleNamespace(lengths=np.stack([np.ones_like(e), 1 + np.abs(e) + excess, e], axis=1))

    def unknowns(self, lengths: Any) -> np.ndarray:
        r, l, e = np.asarray(lengths, dtype=float).T  # noqa: E741
        return np.stack([np.log((l - r - np.abs(e)) / r), e / r], axis=1)

    def hopped(self, unknowns: np.ndarray, noise: np.ndarray) -> np.ndarray:
        return unknowns + noise
