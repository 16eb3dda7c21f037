"""Random linkages with sliders by each kind's own formulas: they share nothing with the search."""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.arrays import Complexes, Floats

KINDS = ("slider_crank", "swinging_block", "rail_slot", "two_rails", "two_slots")
_BETWEEN = 400
"""Number of crank positions at which a linkage must close to reach a sample from the previous sample."""


def random_motion(random: np.random.Generator, kind: str, samples: int) -> tuple[Floats, Complexes, Floats]:
    """Rotation, position and drive of a random linkage that turns its body by 0.2 rad and more.

    The drive is the first guide's of the kind's name: crank, crank, slider, slider, cylinder (from pin to meeting point).
    """
    while True:
        drive, angle, position = _FORMULAS[kind](random, samples)
        if not (np.isfinite(angle).all() and np.isfinite(position).all() and np.ptp(angle) > 0.2):
            continue
        # any point of the body, and the whole anywhere
        point = complex(*random.normal(size=2))
        turn, size, shift = (
            random.uniform(0, 2 * np.pi),
            10 ** random.uniform(0, 2),
            complex(*random.normal(size=2)) * 50,
        )
        position = position + point * np.exp(1j * angle)
        if np.abs(position - position.mean()).max() < 0.2:
            continue
        length = size if kind in ("rail_slot", "two_rails", "two_slots") else 1.0
        position = shift + size * np.exp(1j * turn) * position
        return angle + turn + random.uniform(0, 2 * np.pi), position, (drive - drive[0]) * length


def _even(random: np.random.Generator, low: float, high: float, samples: int) -> Floats:
    steps = random.uniform(0.3, 1.0, samples - 1)
    along = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    return low + (high - low) * along


def _crank(random: np.random.Generator, samples: int) -> Floats:
    begin, span = random.uniform(0, 2 * np.pi), random.uniform(0.6, 5.0) * random.choice([-1, 1])
    return _even(random, begin, begin + span, samples)


def _slider_crank(random: np.random.Generator, samples: int) -> Any:
    r, rod = random.uniform(0.3, 1.5), random.uniform(0.8, 3.0)
    offset, t = random.uniform(-0.5, 0.5), _crank(random, samples)
    if np.any(np.abs(offset - r * np.sin(np.linspace(t[0], t[-1], _BETWEEN))) >= rod):
        return t, np.full(samples, np.nan), 0j * t
    with np.errstate(invalid="ignore"):
        angle = np.arcsin((offset - r * np.sin(t)) / rod)
    return t, angle, r * np.exp(1j * t)


def _swinging_block(random: np.random.Generator, samples: int) -> Any:
    r, ground, beside = random.uniform(0.3, 1.5), random.uniform(0.5, 3.0), random.uniform(-0.3, 0.3)
    t = _crank(random, samples)
    if np.any(np.abs(ground - r * np.exp(1j * np.linspace(t[0], t[-1], _BETWEEN))) <= abs(beside)):
        return t, np.full(samples, np.nan), 0j * t
    gap = ground - r * np.exp(1j * t)
    with np.errstate(invalid="ignore"):
        s = np.sqrt(np.abs(gap) ** 2 - beside**2)
    return t, np.unwrap(np.angle(gap) - np.arctan2(beside, s)), r * np.exp(1j * t)


def _rail_slot(random: np.random.Generator, samples: int) -> Any:
    height, beside = random.uniform(0.4, 1.5), random.uniform(-0.3, 0.3)
    p = _even(random, random.uniform(-2, 0), random.uniform(0.4, 2), samples)
    gap = 1j * height - p
    with np.errstate(invalid="ignore"):
        s = np.sqrt(np.abs(gap) ** 2 - beside**2)
    return p, np.angle(gap) - np.arctan2(beside, s), p + 0j


def _two_rails(random: np.random.Generator, samples: int) -> Any:
    delta, length = random.uniform(0.6, 2.5), random.uniform(0.5, 2.0)
    # the first pin on the real axis at p, the second `length` from it on the line through 0 under delta
    widest = length / np.sin(delta)
    low = random.uniform(-0.9, 0.3)
    p = _even(random, low * widest, random.uniform(low + 0.3, 0.95) * widest, samples)
    with np.errstate(invalid="ignore"):
        direction = p * np.cos(delta) + np.sqrt(length**2 - (p * np.sin(delta)) ** 2)
    return p, np.angle(direction * np.exp(1j * delta) - p), p + 0j


def _two_slots(random: np.random.Generator, samples: int) -> Any:
    delta, ground = random.uniform(0.6, 2.5), random.uniform(0.5, 2.0)
    # both lines of the body meet at its origin; pins at 0 and at `ground`
    begin = random.uniform(0, 2 * np.pi)
    angle = _even(random, begin, begin + random.uniform(0.3, 1.5) * random.choice([-1, 1]), samples)
    first = ground * np.sin(angle + delta) / np.sin(delta)
    rate = np.cos(angle + delta)  # of the first: it does not turn back, not even between samples
    if np.any(rate * rate[0] <= 0) or np.ptp(angle) > np.pi or first.min() < 0.05:
        return first, np.full(samples, np.nan), 0j * first
    return first, angle, first * np.exp(1j * angle)


_FORMULAS: dict[str, Any] = {
    "slider_crank": _slider_crank,
    "swinging_block": _swinging_block,
    "rail_slot": _rail_slot,
    "two_rails": _two_rails,
    "two_slots": _two_slots,
}
