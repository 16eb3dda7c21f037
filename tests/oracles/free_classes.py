"""Random requests without crank angles that some four-bar performs exactly, by independent arithmetic.

Crank-rockers in increasing and in any order and double-cranks (a third each), lengths uniform on the simplex, spans 40 to 360
degrees with uneven gaps, both directions and branches, any place, size and body point; or linkages whose crank swings only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.oracles.classes import any_order, base_order, double_crank

FULL_CRANK = (base_order, any_order, double_crank)


@dataclass(frozen=True)
class FreeCase:
    """Samples and the linkage that they come from."""

    position: np.ndarray
    """(N,) complex."""
    rotation: np.ndarray
    """(N,) radians, wrapped."""
    lengths: np.ndarray
    branch: int
    theta1: np.ndarray
    """(N,)"""
    scale: float


def close(lengths: Any, branch: Any, theta1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Crank pin and coupler pin with pivot A at 0 and the ground on the real axis, by intersecting circles; NaN where open."""
    l1, l2, l3, l4 = lengths
    pin = l1 * np.exp(1j * theta1)
    toward = l4 - pin
    distance = np.abs(toward)
    along = (distance**2 + l2**2 - l3**2) / (2 * distance)
    square = l2**2 - along**2
    across = np.sqrt(np.where(square >= 0, square, np.nan))
    return pin, pin + (along + 1j * branch * across) * toward / distance


def free_case(seed: int, samples: int, swinging: bool = False) -> FreeCase:
    """One seeded case: a full crank, or with ``swinging`` a linkage whose crank cannot turn fully."""
    random = np.random.default_rng([31, seed, samples, swinging])
    branch = int(random.choice([-1, 1]))
    while True:
        lengths = random.dirichlet(np.ones(4)) if swinging else FULL_CRANK[seed % 3](random)
        span = np.deg2rad(random.uniform(20, 120) if swinging else random.uniform(40, 360)) * random.choice([-1, 1])
        gaps = random.uniform(0.2, 1, samples)  # the last leads back to the first
        direction = np.concatenate([[0.0], np.cumsum(gaps[:-1])])
        full_turn = abs(span) > np.deg2rad(355)
        first = random.uniform(0, 2 * np.pi)
        theta1 = first + span * direction / (gaps.sum() if full_turn else direction[-1])
        if not swinging:
            break
        dense = np.linspace(theta1[0], theta1[-1], 721)
        turn = close(lengths, branch, np.linspace(0, 2 * np.pi, 721))[1]
        pin, coupler_pin = close(lengths, branch, dense)
        if np.isnan(turn).any() and not np.isnan(coupler_pin).any():
            sine = np.abs(np.imag(np.conj(coupler_pin - pin) * (coupler_pin - lengths[3]))) / (
                lengths[1] * lengths[2]
            )
            if sine.min() > 0.05:
                break
    pin, coupler_pin = close(lengths, branch, theta1)
    size, turned = random.uniform(20, 300), np.exp(1j * random.uniform(0, 2 * np.pi))
    coupler = (coupler_pin - pin) / lengths[1]
    radius = random.uniform(0.1, 1.5) * lengths[1]
    point = pin + radius * np.exp(1j * random.uniform(0, 2 * np.pi)) * coupler
    position = 200 * np.exp(1j * random.uniform(0, 2 * np.pi))
    rotation = np.angle(coupler * turned * np.exp(1j * random.uniform(0, 2 * np.pi)))
    return FreeCase(position + size * turned * point, rotation, lengths, branch, theta1, size)


NOISE = 1e-3


def free_request(case: FreeCase, kind: str, seed: int) -> tuple[FreeCase, dict[str, Any]]:
    """Return the requested samples and the request in degrees, without limits.

    A kind is a "path", "mixed" (half of the rotations missing), with "noise", of "any family", or every pose.
    """
    random = np.random.default_rng([77, seed])
    rotation: Any = None if kind == "path" else case.rotation.copy()
    if kind == "mixed":
        rotation[random.permutation(rotation.size)[: rotation.size // 2]] = np.nan
    if kind == "noise":
        size = np.max(np.abs(case.position - case.position.mean()))
        off = random.standard_normal((3, rotation.size)) * NOISE / np.sqrt([[1], [2], [2]])
        rotation = rotation + off[0]
        case = replace(case, position=case.position + size * (off[1] + 1j * off[2]))
    reported = (
        None if rotation is None else [None if np.isnan(turn) else float(np.rad2deg(turn)) for turn in rotation]
    )
    request: dict[str, Any] = {"rotation": reported, "position": case.position, "timing": "free"}
    request["limits"] = {"preset": "none", "family": "any" if kind == "any family" else "full_crank"}
    return replace(case, rotation=rotation), request


@dataclass(frozen=True)
class Recomputed:
    """Results of a linkage at its crank angles, from its own numbers."""

    objective: float
    one_way: bool
    """True if the crank angles rise or fall strictly by at most a turn."""


def recompute_free(position: Any, rotation: Any, solution: dict[str, Any], scale: float | None = None) -> Recomputed:
    """J of a solution in the form of a reply in degrees, by circles; rotations modulo a turn, missing samples None or NaN."""
    position = None if position is None else np.asarray(position, dtype=complex)
    links = [solution["links"][name] for name in ("crank", "coupler", "rocker", "ground")]
    crank, mount = np.deg2rad(solution["crank_angle"]), solution["mount"]
    pin, coupler_pin = close(links, solution["branch"], np.deg2rad(solution["start_angle"]) + crank)
    ground = np.exp(1j * np.deg2rad(mount["ground_angle"]))
    coupler = (coupler_pin - pin) / links[1]
    point = mount["coupler_point_polar"]
    arm = point["radius"] * np.exp(1j * np.deg2rad(point["angle"]))
    positions = complex(*mount["pivot_a"]) + ground * (pin + arm * coupler)
    square = 0.0
    if position is not None:
        prescribed = ~np.isnan(position)
        scale = scale or float(np.max(np.abs(position[prescribed] - position[prescribed].mean())))
        square += np.mean(np.abs(positions - position)[prescribed] ** 2) / scale**2
    if rotation is not None:
        expected = np.asarray(rotation, dtype=float)
        prescribed = ~np.isnan(expected)
        turned = coupler * ground * np.exp(1j * np.deg2rad(solution["body_offset"]))
        square += np.mean(np.angle(np.exp(1j * expected[prescribed]) / turned[prescribed]) ** 2)
    steps = np.diff(crank)
    one_way = bool(np.all(steps > 0) or np.all(steps < 0)) and abs(crank[-1] - crank[0]) <= 2 * np.pi * (1 + 1e-9)
    return Recomputed(float(np.sqrt(square)), one_way)


def burmester_dyads(
    position: np.ndarray, rotation: np.ndarray, farthest: float = 1e3
) -> list[tuple[complex, complex]]:
    """All points of the body, in its frame over the motion's size, whose five places lie on a circle, and the centres.

    By brute force: Newton's method on two determinants from a dense net of starts; no algebra is shared with the search.
    """
    middle = position.mean()
    size = np.max(np.abs(position - middle))
    p, r = (position - middle) / size, np.exp(1j * rotation)
    radii, angles = np.geomspace(0.01, 300, 40), np.linspace(0, 2 * np.pi, 48, endpoint=False)
    m = (radii[:, None] * np.exp(1j * angles)).ravel()

    def concyclic(m: np.ndarray, four: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The determinant's value and its derivatives by Re m and Im m."""
        pairs = [(0, 2), (1, 3), (0, 3), (1, 2)]
        factors = [p[four[i]] - p[four[j]] + (r[four[i]] - r[four[j]]) * m for i, j in pairs]
        slopes = [r[four[i]] - r[four[j]] for i, j in pairs]
        left, right = factors[0] * factors[1], factors[2] * factors[3]
        by_left = slopes[0] * factors[1] + factors[0] * slopes[1]
        by_right = slopes[2] * factors[3] + factors[2] * slopes[3]
        by_x = by_left * np.conj(right) + left * np.conj(by_right)
        by_y = 1j * by_left * np.conj(right) - 1j * left * np.conj(by_right)
        return (left * np.conj(right)).imag, by_x.imag, by_y.imag

    for _ in range(100):
        (f, fx, fy), (g, gx, gy) = (concyclic(m, four) for four in ([0, 1, 2, 3], [0, 1, 2, 4]))
        below = fx * gy - fy * gx
        below = np.where(np.abs(below) > 1e-300, below, np.inf)
        change = -(f * gy - g * fy) / below - 1j * (fx * g - gx * f) / below
        m = m + change * np.minimum(1.0, 0.3 * (1 + np.abs(m)) / np.maximum(np.abs(change), 1e-300))
    m = m[np.abs(change) < 1e-7 * (1 + np.abs(m))]
    found: list[tuple[complex, complex]] = []
    for point in m[np.isfinite(m) & (np.abs(m) < farthest)]:
        positions = p + r * point
        rows = np.column_stack([2 * positions.real, 2 * positions.imag, np.ones(5)])
        cx, cy, _ = np.linalg.lstsq(rows, np.abs(positions) ** 2, rcond=None)[0]
        distance = np.abs(positions - complex(cx, cy))
        apart = min(abs(positions[i] - positions[j]) for i in range(5) for j in range(i))
        if distance.std() > 1e-9 * distance.mean() or apart < 1e-7 or abs(complex(cx, cy)) > farthest:
            continue  # no root, or a pole, where two places coincide and the determinants vanish for no dyad
        if all(abs(point - second) > 1e-5 * (1 + abs(point)) for second, _ in found):
            found.append((complex(point), complex(cx, cy)))
    return found
