"""Bodies on a crank that a rail or a slot guides, from the formulas as they stand in books: no care for the last digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.slider.charts import RAIL, SLOT, AnySliderChart, SliderCrankChart, SwingingBlockChart

SLIDER_CHARTS: list[Any] = [SliderCrankChart(), SwingingBlockChart(), AnySliderChart(RAIL), AnySliderChart(SLOT)]
SLIDER_NAMES = ["slider", "block", "any slider", "any block"]
SLIDERS = np.array([[1.0, 2.2, 0.7], [1.0, 1.9, -0.4]])
"""Two whose cranks turn fully: crank, rod or ground, offset."""


def body_angle(lengths: np.ndarray, crank: np.ndarray, guide: int = RAIL) -> np.ndarray:
    """theta2, (n, N), continuous along the last axis; NaN where the crank does not get there."""
    r, long, offset = (column[:, None] for column in np.asarray(lengths, dtype=float).T)
    with np.errstate(invalid="ignore"):
        if guide == RAIL:
            return np.arcsin((offset - r * np.sin(crank)) / long)
        arm = long - r * np.exp(1j * crank)
        return np.unwrap(np.angle(arm)) - np.arcsin(offset / np.abs(arm))
