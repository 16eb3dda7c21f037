"""Searches find slider-cranks and swinging blocks that a turning crank drives, by the formulas of textbooks.

A mechanism whose branch, start or body angle is exchanged would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from tests.oracles.slider_crank import RAIL, SLOT, random_motion

WHAT = ("position", "both")


@pytest.mark.parametrize("kind", [RAIL, SLOT])
@pytest.mark.parametrize("what", WHAT)
def test_random_linkages_are_recovered(kind: str, what: str) -> None:
    for seed in range(8):
        random = np.random.default_rng([seed, WHAT.index(what)])
        span = random.uniform(60, 360) * (-1 if seed % 3 == 2 else 1)
        target = random_motion(random, kind, span, what, samples=24)
        crank, rotation = np.rad2deg(target.crank), None if what == "position" else np.rad2deg(target.rotation)
        request = {"crank_angle": crank, "mechanisms": [kind], "limits": {"preset": "none"}, "top": 1}
        best = la.synthesize(rotation, target.position, **request).best
        assert best.kind == kind and best.errors.objective < 1e-9, seed
        joints = best.linkage.joints(crank)
        if rotation is not None:
            gap = joints.rotation - rotation
            assert np.abs(gap - 360 * np.round(gap / 360)).max() < 1e-6
        assert np.abs(joints.body_point @ [1, 1j] - target.position).max() < 1e-7 * target.length_scale
