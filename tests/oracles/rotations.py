"""Requests of a scan: motions of linkages on no lattice, and what is far from every row or makes a scan inexact."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import coupler_angle
from synthesis.target import MIN_SPAN, TURN, Target, make_target
from tests.oracles.classes import SAMPLES, base_order, generator

Floats = NDArray[np.float64]

SPANS = (20, 30, 60, 100, 150, 200, 250, 300)


def atlas_lengths(random: Generator, smallest: float) -> Floats:
    """Lengths of a crank-rocker of perimeter 1 with ``smallest`` <= L1 < L2 < L3 < L4, uniform: on no lattice."""
    while (lengths := base_order(random))[0] < smallest:
        pass
    return lengths


def folding_lengths(random: Generator) -> Floats:
    """Lengths of a crank-rocker that almost folds: L1 + L4 is below L2 + L3 by 1e-9 to 1e-3 of the perimeter."""
    while True:
        l1, l2, l3, _ = base_order(random)
        l4 = l2 + l3 - l1 - 10.0 ** random.uniform(-9, -3)
        if l4 > l3:
            return np.array([l1, l2, l3, l4])


def crank_angles(random: Generator, span_deg: float, samples: int = SAMPLES, uneven: bool = False) -> Floats:
    """Crank increments (samples,) in radians, from 0 on; uneven steps differ by up to a factor of nine."""
    steps = random.uniform(0.2, 1.8, samples - 1) if uneven else np.ones(samples - 1)
    crank = np.concatenate([[0.0], np.cumsum(steps)])
    return crank / crank[-1] * np.deg2rad(span_deg)


def any_order(random: Generator, smallest: float) -> Floats:
    """Lengths as by `atlas_lengths`, the crank or the ground the shortest, the other three in any order."""
    shortest, *others = atlas_lengths(random, smallest)
    others = random.permutation(others)
    return np.array([shortest, *others] if random.random() < 0.5 else [*others, shortest])


def motion_of(
    random: Generator, lengths: Floats, crank: Floats, start: float | None = None, positions: bool = False
) -> Target:
    """The motion of a linkage's coupler, from a random start and on a random branch unless told."""
    start = random.uniform(0, TURN) if start is None else start
    angle = coupler_angle(lengths, random.choice([-1, 1]), start + crank)
    rotation = angle + random.uniform(-9, 9)
    if not positions:
        return make_target(rotation, crank_angle=crank)
    arm = random.uniform(0.2, 2) * lengths[1] * np.exp(1j * random.uniform(0, TURN))
    point = lengths[0] * np.exp(1j * (start + crank)) + arm * np.exp(1j * angle)
    return make_target(rotation, point, crank_angle=crank)


def reachable(
    name: str,
    seed: int,
    span_deg: float,
    smallest: float,
    orders: bool = False,
    samples: int = SAMPLES,
    uneven: bool = False,
    positions: bool = False,
) -> Target:
    """The motion of a random crank-rocker, or with ``orders`` of a full-crank four-bar of any order; seeded."""
    random = generator(f"retrieval {name}", seed)
    lengths = (any_order if orders else atlas_lengths)(random, smallest)
    return motion_of(random, lengths, crank_angles(random, span_deg, samples, uneven), positions=positions)


def _waves(random: Generator, share: Floats) -> Floats:
    number = np.arange(1, 7)[:, None]
    wave = random.standard_normal(6) @ np.cos(np.pi * number * share + random.uniform(0, TURN, (6, 1)))
    return wave / np.max(np.abs(wave))


SHAPES: dict[str, Callable[[Generator, Floats], Floats]] = {
    "cosines": lambda random, x: random.uniform(0.1, 5) * _waves(random, x),
    "steps": lambda random, x: (
        random.uniform(0.1, 5) * np.searchsorted(np.sort(random.uniform(0, 1, random.integers(1, 5))), x)
    ),
    "saw teeth": lambda random, x: random.uniform(0.1, 5) * (random.integers(1, 9) * x % 1.0),
    "constant": lambda random, x: np.full(x.size, random.uniform(-9, 9)),
    "noise": lambda random, x: random.uniform(0.1, 5) * random.standard_normal(x.size),
    "huge": lambda random, x: 10.0 ** random.uniform(3, 5) * _waves(random, x),
    "line": lambda random, x: random.uniform(-5, 5) * x,
}
"""Rotations that come from no linkage, in radians over the share of the span."""
KINDS = (*SHAPES, "change point", "tiny span", "full turn", "almost full turn", "3 samples", "1,000 samples")


def hard_target(kind: str, seed: int, smallest: float) -> Target:
    """A request that is far from every row, or near what makes a scan inexact; the same for the same arguments."""
    random = generator(f"retrieval {kind}", seed)
    span, samples = float(random.choice(SPANS)) * random.choice([-1, 1]), SAMPLES
    if kind == "tiny span":
        span = np.exp(random.uniform(np.log(1.001 * np.rad2deg(MIN_SPAN)), np.log(5)))
    elif kind in ("full turn", "almost full turn"):
        span = 360.0 if kind == "full turn" else 359.9
    elif kind in ("3 samples", "1,000 samples"):
        samples = 3 if kind == "3 samples" else 1000
    crank = crank_angles(random, span, samples, uneven=bool(seed % 3 == 2))
    if kind in SHAPES:
        return make_target(SHAPES[kind](random, crank / crank[-1]), crank_angle=crank)
    if kind == "change point":  # with the fold, at theta1 = pi, inside the span
        return motion_of(random, folding_lengths(random), crank, np.pi - random.uniform(0, 1) * crank[-1])
    if seed % 2:
        return make_target(SHAPES["cosines"](random, crank / crank[-1]), crank_angle=crank)
    return motion_of(random, atlas_lengths(random, smallest), crank)


def any_span(
    random: Generator, least: float, most: float, tops: Sequence[float], samples: int
) -> tuple[Floats, Floats]:
    """Crank increments of a span, degrees, often one of ``tops`` (radians), forward or back, and where they lie in it, 0 to 1.

    Half of them are uneven, some neighbours nearly alike.
    """
    span = random.choice([-1, 1]) * np.deg2rad(np.exp(random.uniform(np.log(least), np.log(most))))
    if random.random() < 0.2:
        span = np.sign(span) * random.choice(np.array(tops))
    share = np.linspace(0, 1, samples)
    if random.random() < 0.5:
        share[1:-1] = np.sort(random.random(samples - 2)) * 0.99 + 0.005
    share[1:-1] = np.maximum.accumulate(share[1:-1] + 1e-4 * np.arange(1, samples - 1)) / (1 + 1e-4 * samples)
    return span * share, share


def any_weights(random: Generator, samples: int, kept: int) -> Floats | None:
    """Weights, none in most cases; many are 0, but so many of the first or, if that is 0, any one of them are not."""
    if random.random() >= 0.3:
        return None
    weights = random.uniform(0.01, 3, samples) * (random.random(samples) < 0.7)
    weights[slice(kept) if kept else random.integers(samples)] += 1
    return weights
