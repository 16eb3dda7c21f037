"""Searches and scans find slider-cranks and swinging blocks by the formulas of textbooks.

A mechanism whose branch, start or body angle is exchanged would show here.
"""

from typing import Any

import numpy as np
import pytest

from synthesis.guided.by_crank import BY_CRANK, linkages_by_crank
from synthesis.guides import Kind
from synthesis.target import Target
from tests.oracles.slider_crank import random_motion

KINDS = list(BY_CRANK)
every_kind = pytest.mark.parametrize("kind", KINDS)
WHAT = ("rotation", "position", "both")


def points_of(linkage: Any, target: Target) -> tuple[np.ndarray, np.ndarray]:
    """Return position and rotation of the body from its circle and its rail or slot: crank pin, then the direction
    of the second guide.
    """
    circle, second = linkage.guides
    pin = circle.pivot + circle.radius * np.exp(1j * (linkage.start + target.crank))
    if linkage.kind is Kind.SLIDER_CRANK:
        beside = ((pin - second.point) * np.exp(-1j * second.direction)).imag
        arm = second.body_point - circle.body_point
        turned = second.direction + np.arcsin(-beside / abs(arm)) - np.angle(arm)
    else:
        across = ((second.body_point - circle.body_point) * np.exp(-1j * second.body_direction)).imag
        away = second.pin - pin
        turned = np.unwrap(np.angle(away)) - np.arcsin(across / np.abs(away)) - second.body_direction
    return pin - circle.body_point * np.exp(1j * turned), turned


@every_kind
@pytest.mark.parametrize("what", WHAT)
def test_random_linkages_are_recovered(kind: Kind, what: str) -> None:
    for seed in range(12):
        random = np.random.default_rng([seed, WHAT.index(what)])
        span = random.uniform(60, 360) * (-1 if seed % 3 == 2 else 1)
        target = random_motion(random, BY_CRANK[kind].guide, span, what, samples=24)
        solutions, _ = linkages_by_crank(kind, target, "full_crank", 3)
        assert solutions[0].errors.objective < 1e-9, seed
        for solution in solutions:  # errors are recomputed from the linkage's own numbers
            assert solution.linkage.kind is kind and solution.linkage.turns_fully and solution.linkage.branch == 1
            position, turned = points_of(solution.linkage, target)
            gap = 0.0
            if target.rotation is not None:
                off = np.exp(1j * (target.rotation - turned))
                gap += np.mean(np.angle(off) ** 2)
            if target.position is not None:
                gap += np.mean(np.abs(target.position - position) ** 2) / target.length_scale**2
            assert np.sqrt(gap) == pytest.approx(solution.errors.objective, rel=1e-6, abs=1e-12)
