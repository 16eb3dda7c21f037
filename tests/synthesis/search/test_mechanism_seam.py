"""Searches and scans find slider-cranks and swinging blocks by the formulas of textbooks.

A mechanism whose branch, start or body angle is exchanged would show here.
"""

from typing import Any

import numpy as np
import pytest

from synthesis.atlas.scan import Scan
from synthesis.atlas.windows import Windows, best_of, joined
from synthesis.guided.by_crank import BY_CRANK, linkages_by_crank
from synthesis.guides import Kind
from synthesis.mechanism import Mechanism
from synthesis.pose import objective
from synthesis.slider import SLIDER_CRANK_TYPES
from synthesis.target import Target, make_target
from tests.conftest import some_of
from tests.oracles.slider_crank import body_angle, random_lengths, random_motion

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


def tables(guide: int) -> np.ndarray:
    random = np.random.default_rng(guide)
    return np.array([random_lengths(random, guide) for _ in range(24)])


STARTS = 360


def every_window(mechanism: Mechanism, lengths: np.ndarray, target: Target) -> Windows:
    """All windows with their errors, type after type and branch after branch."""
    start, found = np.arange(STARTS), []
    crank = np.deg2rad(start)[:, None] + target.crank
    for row, row_lengths in enumerate(lengths):
        for branch in mechanism.branches:
            same = np.full(STARTS, branch)
            error = objective(target, mechanism.body_angle(np.tile(row_lengths, (STARTS, 1)), same, crank))
            found.append(Windows(np.full(STARTS, row), start, same, error))
    return joined(found)


MECHANISMS = [*BY_CRANK.values(), SLIDER_CRANK_TYPES]


SPANS = (20.0, 75.0, 360.0)


@pytest.mark.parametrize(
    ("mechanism", "span"), some_of([(MECHANISMS[(k + turn) % 3], SPANS[k]) for turn in range(3) for k in range(3)], 3)
)
def test_the_scan_finds_the_best_windows_of_all_branches_that_there_are(mechanism, span) -> None:
    lengths = tables(mechanism.guide)
    scan = Scan(mechanism, lengths)
    assert scan.windows == len(lengths) * STARTS * len(mechanism.branches)
    crank = np.deg2rad(np.linspace(0, span, 13))
    # nearly what a second branch would do
    expected = -body_angle(lengths[:1] * [1, 1.02, 1], 0.3 - crank, mechanism.guide)[0]
    position = np.array([1, 0.3, -0.8]) @ [np.ones(13), np.exp(1j * crank), np.exp(1j * expected)]
    request = (expected, None), (None, position), (expected, position), (np.zeros(13), None)
    targets = [make_target(*fields, crank_angle=crank) for fields in request]
    for target in targets:
        windows = every_window(mechanism, lengths, target)
        for top in (1, 50, 3000):
            found, report = scan.best(target, top)
            best = best_of(windows, top)
            assert report.exhaustive
            np.testing.assert_allclose(found.error, best.error, rtol=1e-9, atol=1e-12)
            for column, wished in zip(found[:3], best[:3]):
                np.testing.assert_array_equal(column, wished)
