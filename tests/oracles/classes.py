"""The classes of requests that the search is tested and measured on: random, seeded, made by independent arithmetic.

A case is a request as a user would send it, and the linkage that it was made from. Lengths are uniform on the simplex
L1 + L2 + L3 + L4 = 1 (by rejection), N = 32, the body point and the pose are random. The motion is computed as in
`recompute` and rounded once to double precision, so that an exact answer exists to within rounding.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf
from numpy.random import Generator

from tests.oracles.recompute import DIGITS, LINKS, body_points, close_by_circles

SAMPLES = 32


@dataclass(frozen=True)
class Case:
    """A request and the linkage that made it."""

    kind: str
    seed: int
    request: dict[str, Any]
    truth: dict[str, Any] | None
    """The linkage in the form of a reply's solution; None for targets that come from no linkage."""


@dataclass(frozen=True)
class Draw:
    """Options of a class; each has a common default."""

    lengths: Callable[[Generator], np.ndarray]
    span: tuple[float, float] = (30.0, 360.0)
    scale: float = 1.0
    offset: float = 0.0
    """Distance of the motion from the origin over its size; 0: about as far as it is large."""
    clockwise: bool = False
    uneven: bool = False
    rotation: bool = True
    position: bool = True
    noise: float = 0.0


def simplex(random: Generator, holds: Callable[[np.ndarray], bool]) -> np.ndarray:
    """Four lengths uniform on the simplex among those that ``holds`` accepts."""
    while True:
        for lengths in random.dirichlet(np.ones(4), size=64):
            if holds(lengths):
                return lengths


def _excesses(lengths: np.ndarray) -> tuple[float, float, float]:
    l1, l2, l3, l4 = lengths
    return l2 + l3 - l1 - l4, l3 + l4 - l1 - l2, l2 + l4 - l1 - l3


def is_crank_rocker(lengths: np.ndarray) -> bool:
    """Crank shortest and Grashof's condition."""
    return min(_excesses(lengths)) > 0


def is_double_crank(lengths: np.ndarray) -> bool:
    """Ground shortest and Grashof's condition."""
    return is_crank_rocker(lengths[::-1])


def base_order(random: Generator) -> np.ndarray:
    """Crank-rockers with L1 < L2 < L3 < L4, the order of the published atlas."""
    return simplex(random, lambda x: bool(np.all(np.diff(x) > 0)) and is_crank_rocker(x))


def any_order(random: Generator) -> np.ndarray:
    """Crank-rockers in any order."""
    return simplex(random, is_crank_rocker)


def double_crank(random: Generator) -> np.ndarray:
    """Double-cranks."""
    return simplex(random, is_double_crank)


def tiny_crank(random: Generator) -> np.ndarray:
    """Crank-rockers whose crank is below 1/400 of the perimeter."""
    while True:
        crank = random.uniform(0, 1 / 400)
        lengths = np.concatenate([[crank], random.dirichlet(np.ones(3)) * (1 - crank)])
        if is_crank_rocker(lengths):
            return lengths


def change_point(random: Generator, low: float = -8, high: float = -1) -> np.ndarray:
    """Crank-rockers and double-cranks, evenly; the Grashof excess is 10^low .. 10^high of the perimeter, its logarithm even."""
    while True:
        lengths = simplex(random, is_crank_rocker)
        longest = int(np.argmax(lengths))
        remaining = np.delete(lengths, [0, longest])
        excess = 10.0 ** random.uniform(low, high)
        lengths[longest] = remaining.sum() - lengths[0] - excess
        if lengths[longest] <= remaining.max() or lengths[0] >= remaining.min() or not is_crank_rocker(lengths):
            continue
        return lengths if random.random() < 0.5 else lengths[::-1].copy()


CLASSES: dict[str, Draw] = {
    "plain": Draw(base_order),
    "full turn": Draw(base_order, span=(360.0, 360.0)),
    "any order": Draw(any_order),
    "double-crank": Draw(double_crank),
    "clockwise": Draw(any_order, clockwise=True),
    "uneven crank angles": Draw(any_order, uneven=True),
    "lengths x 1e6": Draw(any_order, scale=1e6),
    "lengths x 1e-4": Draw(any_order, scale=1e-4),
    "rotation only": Draw(any_order, position=False),
    "position only": Draw(any_order, rotation=False),
    "tiny span": Draw(any_order, span=(2.0, 12.0)),
    "tiny crank": Draw(tiny_crank),
    "change point": Draw(change_point),
    "offset 1e6": Draw(any_order, offset=1e6),
    "noise": Draw(any_order, noise=1e-3),
}
"""All classes that come from a linkage; `UNREACHABLE` comes from none."""
UNREACHABLE = "unreachable"
NAMES = (*CLASSES, UNREACHABLE)
EXACT = tuple(name for name in CLASSES if name != "noise")


def generator(kind: str, seed: int) -> Generator:
    """Return the random numbers of a case: independent of the other cases."""
    return np.random.default_rng([zlib.crc32(kind.encode()), seed])


def make_case(kind: str, seed: int, samples: int = SAMPLES) -> Case:
    """One case of a class.

    Parameters
    ----------
    kind : str
        One of `NAMES`.
    seed : int
    samples : int

    Returns
    -------
    Case
        Law: the same for the same arguments, bit for bit.
    """
    random = generator(kind, seed)
    if kind == UNREACHABLE:
        return Case(kind, seed, _smooth_request(random, samples), None)
    draw = CLASSES[kind]
    lengths = draw.lengths(random) * draw.scale
    crank = _crank_degrees(random, draw, samples)
    pivot = random.uniform(-1, 1, 2) * draw.scale
    truth = {
        "links": dict(zip(LINKS, lengths.tolist())),
        "branch": int(random.choice([-1, 1])),
        "start_angle": random.uniform(0, 360),
        "body_offset": random.uniform(-180, 180),
        "mount": {
            "ground_angle": random.uniform(-180, 180),
            "pivot_a": pivot.tolist(),
            "coupler_point_polar": {
                "radius": draw.scale * random.uniform(0, 0.5),
                "angle": random.uniform(-180, 180),
            },
        },
    }
    rotation, position = truth_motion(truth, crank)
    if draw.offset:
        distant = draw.offset * _extent(position) * np.array(_unit_vector(random))
        truth["mount"]["pivot_a"] = distant.tolist()
        rotation, position = truth_motion(truth, crank)
    if draw.noise:
        rotation = rotation + np.rad2deg(draw.noise) * random.standard_normal(samples)
        position = position + draw.noise * _extent(position) * random.standard_normal((samples, 2))
    request: dict[str, Any] = {"crank_angle": crank.tolist()} if draw.uneven else {"crank_span": float(crank[-1])}
    if draw.rotation:
        request["rotation"] = rotation.tolist()
    if draw.position:
        request["position"] = position.tolist()
    else:
        truth["body_offset"] += truth["mount"]["ground_angle"]
        truth["mount"] = None
    if not draw.rotation:
        truth["body_offset"] = None
    return Case(kind, seed, request, truth)


def _extent(position: np.ndarray) -> float:
    return float(np.max(np.linalg.norm(position - position.mean(axis=0), axis=1)))


def _unit_vector(random: Generator) -> tuple[float, float]:
    angle = random.uniform(0, 2 * np.pi)
    return float(np.cos(angle)), float(np.sin(angle))


def _crank_degrees(random: Generator, draw: Draw, samples: int) -> np.ndarray:
    span = random.uniform(*draw.span)
    steps = random.uniform(0.2, 1.8, samples - 1) if draw.uneven else np.ones(samples - 1)
    crank = np.concatenate([[0.0], np.cumsum(steps)])
    return crank / crank[-1] * span * (-1 if draw.clockwise else 1)


def truth_motion(truth: dict[str, Any], crank_degrees: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation in degrees (N,) and positions (N, 2) of a linkage, right to the last bit."""
    mount = truth["mount"]
    with mp.workdps(DIGITS):
        unit = mp.pi / 180
        start = mpf(truth["start_angle"])
        crank = [(start + mpf(float(t))) * unit for t in crank_degrees]
        links = list(truth["links"].values())
        closed = close_by_circles(links, truth["branch"], crank)
        ground = mpf(mount["ground_angle"])
        turns = mp.ceil((closed.theta2[0] / mp.pi - 1) / 2)
        rotation = [a / unit - 360 * turns + ground + mpf(truth["body_offset"]) for a in closed.theta2]
        points = body_points(links[0], mount, unit, ground * unit, crank, closed)
        return np.array([float(value) for value in rotation]), np.array([(float(x), float(y)) for x, y in points])


def _smooth_request(random: Generator, samples: int) -> dict[str, Any]:
    """Smooth random curves: four harmonics of random size over the interval, falling with the square of their number."""
    share = np.linspace(0, 1, samples)
    number = np.arange(1, 5)[:, None]

    def curve() -> np.ndarray:
        size = random.standard_normal((2, 4)) / number.T**2
        return size[0] @ np.cos(np.pi * number * share) + size[1] @ np.sin(np.pi * number * share)

    rotation = 40 * curve()
    position = np.column_stack([curve(), curve()]) + random.uniform(-1, 1, 2)
    return {"crank_span": random.uniform(30, 360), "rotation": rotation.tolist(), "position": position.tolist()}
