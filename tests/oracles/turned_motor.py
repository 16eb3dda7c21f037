"""A motor's crank turned all the way round in small steps, its rod kept by Newton's method: what the linkage does."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_MARCH = 361


class Turned(NamedTuple):
    """Over a whole turn of the motor."""

    ends: np.ndarray
    """(2,): coordinates of the linkage's drive with crank and rod in a line, the smaller first."""
    time_ratio: float
    transmission_angle: float
    """The least, between rod and normal of the pin's path."""
    rod: float
    """The largest error of the rod's length, over it."""
    swings: bool
    """True if the drive's coordinate rises all the way between its two ends, and falls all the way back."""


def turned(
    pin: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    begin: float,
    motor: complex,
    start: float,
    crank: float,
    rod: float,
    angles: int,
) -> Turned:
    """From ``start`` on, the linkage's drive then at ``begin``; ``pin``: places (n,) and velocities of the rod's end."""

    def closed(angle: np.ndarray, at: np.ndarray) -> np.ndarray:
        knee = motor + crank * np.exp(1j * angle)
        for _ in range(12):
            position, speed = pin(at)
            off = position - knee
            step = (np.abs(off) - rod) * np.abs(off) / np.real(np.conj(off) * speed)
            at = at - step
            if np.abs(step).max() < 1e-15 * max(1.0, np.abs(at).max()):
                break
        return at

    coarse = start + np.linspace(0, 2 * np.pi, _MARCH)
    positions, at = [], np.array([begin])
    for angle in coarse:
        at = closed(np.array([angle]), at)
        positions.append(at[0])
    # half a step on: not begun at a dead centre, where rounding decides signs
    all_cases = start + np.linspace(0, 2 * np.pi, angles) + np.pi / angles
    at = closed(all_cases, np.interp(all_cases, coarse, positions, period=2 * np.pi))

    def across(angle: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.imag(np.exp(-1j * angle) * (pin(at)[0] - motor))

    values = across(all_cases, at)
    low = np.flatnonzero(values[:-1] * values[1:] < 0)
    if low.size != 2:
        return Turned(np.full(2, np.nan), np.nan, np.nan, np.nan, False)
    before, second = all_cases[low], all_cases[low + 1]
    sign, close = np.sign(values[low]), at[low]
    for _ in range(60):
        middle = (before + second) / 2
        same = across(middle, closed(middle, close)) * sign > 0
        before, second = np.where(same, middle, before), np.where(same, second, middle)
    dead = (before + second) / 2
    ends = closed(dead, close)
    position, speed = pin(at)
    rods = position - motor - crank * np.exp(1j * all_cases)
    pull = np.real(np.conj(rods) * speed) / np.abs(speed) / np.abs(rods)
    rising = np.sign(np.diff(at))
    turns = int(np.count_nonzero(rising[:-1] != rising[1:])) + int(rising[0] != rising[-1])
    between = abs(dead[1] - dead[0])
    directions = sorted([between, 2 * np.pi - between])
    return Turned(
        np.sort(ends),
        float(directions[1] / directions[0]),
        float(np.arcsin(np.abs(pull).min())),
        float(np.abs(np.abs(rods) / rod - 1).max()),
        turns == 2,
    )
