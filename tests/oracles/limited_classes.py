"""Random, seeded classes of requests with limits, for tests and measurements of the search; see `classes`.

* "broken": the motion of a crank-rocker that violates the limits, so that the best linkage within them is
different.

* "boxed": smooth curves that no four-bar makes, with a box for the pivots and a transmission angle of 30 to 40
degrees.

* "machine": straight transfer, dwell, arc, pick and place, with a link ratio of at most 6 and a transmission angle
of 40.

* "kept": the motion of a linkage that just satisfies all of the limits: there is an exact answer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.oracles.classes import Case, generator, make_case


def make_limited(kind: str, seed: int, samples: int = 32) -> Case:
    """One case of a kind; the same for the same arguments."""
    random = generator(f"limited {kind}", seed)
    if kind == "machine":
        return Case(kind, seed, _machine(random, samples), None)
    base = make_case("unreachable" if kind == "boxed" else "any order", 200_000 + seed, samples)
    position = np.array(base.request["position"])
    extent = float(np.max(np.linalg.norm(position - position.mean(axis=0), axis=1)))
    limits: dict[str, Any] = {}
    if kind == "kept":
        return Case(kind, seed, base.request | {"limits": _just_kept(random, base.truth)}, base.truth)
    if kind == "boxed":
        limits["transmission_angle_min"] = random.uniform(30, 40)
        limits["pivot_box"] = _box(
            position.mean(axis=0) + 0.5 * extent * random.standard_normal(2), 2 * extent, random
        )
    else:
        own = transmission_angle(base.truth, base.request)
        limits["transmission_angle_min"] = float(np.clip(own + random.uniform(5, 25), 20, 45))
        shape = random.integers(3)
        if shape == 1:
            limits["pivot_box"] = _box(position.mean(axis=0), 2.5 * extent, random)
        elif shape == 2:
            limits["link_min"], limits["link_max"] = 0.2 * extent, random.uniform(3, 6) * extent
    return Case(kind, seed, base.request | {"limits": limits}, base.truth)


def transmission_angle(truth: dict[str, Any], request: dict[str, Any]) -> float:
    """Least transmission angle of a linkage over 20,001 crank angles of a request, in degrees."""
    l1, l2, l3, l4 = truth["links"].values()
    span = request.get("crank_span") or request["crank_angle"][-1]
    theta1 = np.radians(truth["start_angle"] + np.linspace(0, span, 20_001))
    cosine = (l2**2 + l3**2 - l1**2 - l4**2 + 2 * l1 * l4 * np.cos(theta1)) / (2 * l2 * l3)
    return float(np.degrees(np.arccos(np.minimum(np.abs(cosine), 1)).min()))


def _box(middle: np.ndarray, half: float, random: Generator) -> list[float]:
    sides = half * random.uniform(0.7, 1.3, 2)
    return [*(middle - sides).tolist(), *(middle + sides).tolist()]


def _just_kept(random: Generator, truth: dict[str, Any]) -> dict[str, Any]:
    """Limits that a linkage keeps by a part in a thousand, some of them drawn at random."""
    links = np.array(list(truth["links"].values()))
    mount = truth["mount"]
    a = np.array(mount["pivot_a"])
    turned = np.radians(mount["ground_angle"])
    b = a + links[3] * np.array([np.cos(turned), np.sin(turned)])
    low, high = np.minimum(a, b) - 1e-3, np.maximum(a, b) + 1e-3
    all_cases: dict[str, Any] = {
        "link_ratio_max": 1.001 * float(links.max() / links.min()),
        "link_max": 1.001 * float(links.max()),
        "link_min": 0.999 * float(links.min()),
        "pivot_box": [*low.tolist(), *high.tolist()],
        "pivot_a_box": [*(a - 1e-3).tolist(), *(a + 0.5).tolist()],
        "coupler_radius_max": 1.001 * mount["coupler_point_polar"]["radius"],
    }
    chosen = random.choice(list(all_cases), size=random.integers(1, 4), replace=False)
    return {name: all_cases[name] for name in sorted(chosen)}


def _machine(random: Generator, samples: int) -> dict[str, Any]:
    share = np.linspace(0, 1, samples)
    smooth = share - np.sin(2 * np.pi * share) / (2 * np.pi)
    directions: list[Callable[[], tuple[np.ndarray, np.ndarray]]] = [
        lambda: (np.column_stack([200 * share, 0 * share]), 0 * share),  # straight transfer, held level
        lambda: (np.column_stack([150 * smooth, 40 * np.sin(np.pi * share)]), random.uniform(20, 90) * smooth),
        lambda: (_arc(share, random.uniform(40, 120), 100.0), random.uniform(-30, 60) * share),
        lambda: (  # a dwell in the middle of the way
            np.column_stack([80 * _dwell(share), 30 * _dwell(share) ** 2]),
            random.uniform(20, 60) * _dwell(share),
        ),
        lambda: (np.column_stack([120 * np.sin(np.pi * share / 2), 60 * share]), random.uniform(20, 100) * share),
    ]
    position, rotation = directions[random.integers(len(directions))]()
    position = position * random.uniform(0.3, 3) + random.uniform(-100, 100, 2)
    return {
        "crank_span": random.uniform(60, 300),
        "rotation": (rotation + random.uniform(-90, 90)).tolist(),
        "position": position.tolist(),
        "limits": {"link_ratio_max": random.uniform(4, 6), "transmission_angle_min": 40.0},
    }


def _arc(share: np.ndarray, degrees: float, radius: float) -> np.ndarray:
    angle = np.radians(degrees) * share
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _dwell(share: np.ndarray) -> np.ndarray:
    return 0.5 * np.clip(share / 0.35, 0, 1) + 0.5 * np.clip((share - 0.65) / 0.35, 0, 1)
