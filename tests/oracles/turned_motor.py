"""A motor's crank turned all the way round in small steps, its rod kept by Newton's method: what the linkage does."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_MARCH = 361


class Turned(NamedTuple):
    """Over a whole turn of the motor."""

    ends: np.ndarray
    """(2,): places of the linkage's drive where crank and rod lie in one line, the lesser first."""
    time_ratio: float
    transmission_angle: float
    """The least, between rod and normal of the pin's path."""
    rod: float
    """The largest error of the rod's length, over it."""
    swings: bool
    """Whether the drive's place rises all the way between one end and the other, and falls all the way back."""


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
            place, speed = pin(at)
            off = place - knee
            step = (np.abs(off) - rod) * np.abs(off) / np.real(np.conj(off) * speed)
            at = at - step
            if np.abs(step).max() < 1e-15 * max(1.0, np.abs(at).max()):
                break
        return at

    coarse = start + np.linspace(0, 2 * np.pi, _MARCH)
    places, at = [], np.array([begin])
    for angle in coarse:
        at = closed(np.array([angle]), at)
        places.append(at[0])
    # half a step on: not begun at a dead centre, where rounding decides signs
    every = start + np.linspace(0, 2 * np.pi, angles) + np.pi / angles
    at = closed(every, np.interp(every, coarse, places, period=2 * np.pi))

    def across(angle: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.imag(np.exp(-1j * angle) * (pin(at)[0] - motor))

    values = across(every, at)
    low = np.flatnonzero(values[:-1] * values[1:] < 0)
    if low.size != 2:
        return Turned(np.full(2, np.nan), np.nan, np.nan, np.nan, False)
    one, other = every[low], every[low + 1]
    sign, near = np.sign(values[low]), at[low]
    for _ in range(60):
        middle = (one + other) / 2
        same = across(middle, closed(middle, near)) * sign > 0
        one, other = np.where(same, middle, one), np.where(same, other, middle)
    dead = (one + other) / 2
    ends = closed(dead, near)
    place, speed = pin(at)
    rods = place - motor - crank * np.exp(1j * every)
    pull = np.real(np.conj(rods) * speed) / np.abs(speed) / np.abs(rods)
    rising = np.sign(np.diff(at))
    turns = int(np.count_nonzero(rising[:-1] != rising[1:])) + int(rising[0] != rising[-1])
    between = abs(dead[1] - dead[0])
    ways = sorted([between, 2 * np.pi - between])
    return Turned(
        np.sort(ends),
        float(ways[1] / ways[0]),
        float(np.arcsin(np.abs(pull).min())),
        float(np.abs(np.abs(rods) / rod - 1).max()),
        turns == 2,
    )
