"""Pairs of guides as functions: derivatives against differences, and circles as large as can be."""

from __future__ import annotations

import numpy as np
import pytest

from synthesis.fourbar.limits import Limits, Reach
from synthesis.free.poses import make_poses
from synthesis.guided.dyads import Guides
from synthesis.guided.limits import Bounds, Signs
from synthesis.guided.pairs import Chart, Corrected, Driven, Pairs, Samples

_COUNT, _SAMPLES, _STEP = 12, 5, 1e-6


def guides(random: np.random.Generator, inverse: np.ndarray, straight: np.ndarray) -> Guides:
    point, foot = (random.normal(size=_COUNT) + 1j * random.normal(size=_COUNT) for _ in range(2))
    bent = np.where(straight, 0.0, random.uniform(0.1, 2.0, _COUNT))
    return Guides(point, foot, random.uniform(0, 2 * np.pi, _COUNT), bent, inverse)


@pytest.fixture
def made() -> tuple[Samples, np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    number = np.arange(_COUNT)
    first = guides(random, number % 3 == 0, number % 3 != 1)
    second = guides(random, number % 4 == 0, number % 4 != 1)
    chart = Chart(Pairs(first, second, (number % 3 == 0) & (number % 2 == 0)))
    start = chart.start
    start[:, [3, 8]] = 0.1
    nothing = np.zeros(_SAMPLES, dtype=bool)
    place = random.normal(size=_SAMPLES) + 1j * random.normal(size=_SAMPLES)
    ones = np.full(_SAMPLES, 5.0)
    drive = np.linspace(0, 0.1, _SAMPLES)
    return Samples(random.uniform(0, 1, _SAMPLES), place, ones, ones, nothing, nothing, drive), start, chart.labels


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("column", range(10))
def test_derivatives_by_the_dimensions_at_given_poses(made, column):
    samples, start, labels = made
    found = Corrected(samples, start, labels, 1)
    ahead, behind = (start.copy() for _ in range(2))
    ahead[:, column] += _STEP
    behind[:, column] -= _STEP
    one, other = Corrected(samples, ahead, labels, 1), Corrected(samples, behind, labels, 1)
    k = column // 5
    slope = (one.at[k].distance - other.at[k].distance) / (2 * _STEP)
    assert np.allclose(slope, found.at[k].columns()[:, column % 5], atol=1e-8)
    slope = wrapped(one.drive() - other.drive()) / (2 * _STEP)
    assert np.allclose(slope, found.drive_derivatives()[0][:, column], atol=1e-8)
    slope = (one.transmission() - other.transmission()) / (2 * _STEP)
    assert np.allclose(slope, found.transmission_derivatives()[0][:, column], atol=1e-8)


@pytest.mark.parametrize("part", ["angle", "x", "y"])
def test_derivatives_by_the_pose(made, part):
    samples, start, labels = made
    turn, shift = {"angle": (_STEP, 0), "x": (0, _STEP), "y": (0, 1j * _STEP)}[part]
    found = Corrected(samples, start, labels, 1)
    one, other = (
        Corrected(
            samples._replace(angle=samples.angle + way * turn, position=samples.position + way * shift),
            start,
            labels,
            1,
        )
        for way in (1, -1)
    )

    def of(by_angle: np.ndarray, by_position: np.ndarray) -> np.ndarray:
        return {"angle": by_angle, "x": by_position.real, "y": by_position.imag}[part]

    for k in range(2):
        slope = (one.at[k].distance - other.at[k].distance) / (2 * _STEP)
        assert np.allclose(slope, of(found.at[k].turn, found.at[k].shift), atol=1e-8)
    slope = wrapped(one.drive() - other.drive()) / (2 * _STEP)
    assert np.allclose(slope, of(*found.drive_derivatives()[1:]), atol=1e-8)
    slope = (one.transmission() - other.transmission()) / (2 * _STEP)
    assert np.allclose(slope, of(*found.transmission_derivatives()[1:]), atol=1e-8)


def exact(random: np.random.Generator) -> tuple[Samples, Chart]:
    """Slider-cranks, and samples that one of them passes."""
    t = np.linspace(0.3, 1.5, _SAMPLES)
    angle = np.arcsin((0.2 - np.sin(t)) / 2.0)
    place = np.exp(1j * t)
    nothing, ones = np.zeros(_SAMPLES, dtype=bool), np.full(_SAMPLES, 5.0)
    one, no = np.ones(1), np.zeros(1, dtype=bool)
    crank = Guides(0j * one, -1.0 + 0j * one, 0 * one, one, no)
    rail = Guides(2.0 + 0j * one, 0.2j * one, np.pi / 2 * one, 0 * one, no)
    return Samples(angle, place, ones, ones, nothing, nothing, t - t[0]), Chart(Pairs(crank, rail, no))


def test_where_the_drive_is_given_the_rows_derivatives_are_exact():
    samples, chart = exact(np.random.default_rng(0))
    x = np.concatenate([chart.start, [[0.3 + np.pi]]], axis=1)
    x[0, 10] = Corrected(samples, chart.start, chart.labels).drive()[0, 0]
    x += np.random.default_rng(2).normal(size=x.shape) * 1e-3
    sign = np.ones((1, 1))
    found = Driven(samples, x, chart.labels, sign)
    assert found.closed.all()
    rows, _, _ = found.derivatives()
    for column in range(11):
        ahead, behind = (x.copy() for _ in range(2))
        ahead[:, column] += _STEP
        behind[:, column] -= _STEP
        slope = (
            Driven(samples, ahead, chart.labels, sign).rows - Driven(samples, behind, chart.labels, sign).rows
        ) / (2 * _STEP)
        assert np.allclose(slope, rows[:, column], atol=1e-8)


def test_limits_slopes_follow_the_poses_that_the_drive_leads_to():
    samples, chart = exact(np.random.default_rng(0))
    x = np.concatenate([chart.start, Corrected(samples, chart.start, chart.labels).drive()[:, :1]], axis=1)
    poses = make_poses(samples.angle, samples.position)
    box = (-3.0, -2.0, 4.0, 5.0)
    limits = Limits(
        family="any", transmission_angle_min=0.3, link_max=9.0, link_min=0.1, link_ratio_max=3.0, rail_box=box,
        pivot_box=box, envelope=box, stroke_max=1.0, pivot_reach=Reach(0j, 8.0, 8.0), coupler_radius_max=3.0,
        keep_out=((5.0, 5.0, 6.0, 6.0),),
    )  # fmt: skip
    bounds = Bounds(limits, poses, timed=True)
    one = np.ones((1, 1))
    signs = Signs(one, one, 0 * one)

    def at(unknowns: np.ndarray) -> Driven:
        return Driven(samples, unknowns, chart.labels, one)

    every = bounds(at(x), signs)
    assert len({bound.name for bound in every}) >= 9
    for column in range(11):
        ahead, behind = (x.copy() for _ in range(2))
        ahead[:, column] += _STEP
        behind[:, column] -= _STEP
        for bound, more, less in zip(every, bounds(at(ahead), signs), bounds(at(behind), signs)):
            slope = (more.values - less.values) / (2 * _STEP)
            assert np.allclose(slope, bound.slopes[:, column], atol=1e-7), (bound.name, column)


@pytest.mark.parametrize("radius", [1e2, 1e4, 1e8])
def test_a_circle_of_any_radius_keeps_its_digits(radius):
    """Ten places of an arc of chord 2: the curvature that fits them best is its own."""
    along = np.linspace(-1, 1, 10) / radius
    place = radius * np.sin(along) + 1j * 2 * radius * np.sin(along / 2) ** 2
    nothing, ones = np.zeros(10, dtype=bool), np.full(10, 10.0)
    samples = Samples(0 * along, place, ones, ones, nothing, nothing, along)
    one, no = np.ones(1), np.zeros(1, dtype=bool)
    circle = Guides(0j * one, 0j * one, np.pi / 2 * one, 1 / radius * one, no)
    chart = Chart(Pairs(circle, circle, no))
    found = Corrected(samples, chart.start, chart.labels, 1)
    assert np.abs(found.at[0].distance).max() < 1e-15
