"""Bodies on a crank that a rail or a slot guides, from textbook formulas without care for the last digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.target import make_target

RAIL, SLOT = "slider_crank", "swinging_block"


def body_angle(lengths: np.ndarray, crank: np.ndarray, guide: str = RAIL) -> np.ndarray:
    """theta2, (n, N), continuous along the last axis; NaN where the crank does not get there."""
    r, long, offset = (column[:, None] for column in np.asarray(lengths, dtype=float).T)
    with np.errstate(invalid="ignore"):
        if guide == RAIL:
            return np.arcsin((offset - r * np.sin(crank)) / long)
        arm = long - r * np.exp(1j * crank)
        return np.unwrap(np.angle(arm)) - np.arcsin(offset / np.abs(arm))


def random_lengths(random: np.random.Generator, guide: str) -> np.ndarray:
    """Lengths whose crank turns fully, on no lattice: ratios up to about ten, offsets up to nearly the change point."""
    if guide == RAIL:
        x, y = np.exp(random.uniform(-3, 2.3, 2))
        return np.array([1.0, 1 + (x + y) / 2, (y - x) / 2])
    ratio = np.exp(random.choice([-1.0, 1.0]) * random.uniform(0.1, 2.3))
    return np.array([ratio, 1.0, abs(1 - ratio) * np.tanh(random.uniform(-2, 2))]) / (1 + ratio)


def random_motion(
    random: np.random.Generator, guide: str, span: float, what: str, samples: int = 16, noise: float = 0.0
) -> Any:
    """Return the motion of a random body on a crank over a span in degrees by the textbook formula, optionally with
    noise.

    ``what``: "rotation", "position" or "both".
    """
    crank, start = np.deg2rad(np.linspace(0.0, span, samples)), random.uniform(0, 2 * np.pi)
    angle = body_angle([random_lengths(random, guide)], start + crank, guide)[0]
    pivot, z1, z2 = random.normal(size=3) + 1j * random.normal(size=3)
    position = pivot + z1 * np.exp(1j * (start + crank)) + z2 * np.exp(1j * angle)
    position = position + noise * (random.normal(size=samples) + 1j * random.normal(size=samples))
    turned = angle + random.uniform(-9, 9) + noise * random.normal(size=samples)
    return make_target(
        None if what == "position" else turned, None if what == "rotation" else position, crank_angle=crank
    )
