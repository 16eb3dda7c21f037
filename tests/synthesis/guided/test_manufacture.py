"""Made linkages on two guides: Newton's poses are the closed form's, slopes are right, and studies keep their laws."""

import numpy as np
import pytest

from synthesis.fourbar import tolerance_study as fourbar
from synthesis.fourbar.tolerance_study import Tolerances
from synthesis.guided.manufacture import Deviation, dimensions_of, made, simulate, slopes, sources_of
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage, four_bar, on_guides
from synthesis.work import Work
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage


def _good(random: np.random.Generator, drive) -> Linkage:
    return good_linkage(random, drive, -0.3, 0.7, 0.41)


def _changed(linkage: Linkage, place: int, off: Deviation) -> Linkage:
    guides = list(linkage.guides)
    one = guides[place]
    point = complex(one.body_point + off.body_point)
    if isinstance(one, Circle):
        guides[place] = Circle(complex(one.pivot + off.fixed), float(one.radius + off.radius), point)
    elif isinstance(one, Rail):
        guides[place] = Rail(complex(one.point + off.fixed), float(one.direction + off.direction), point)
    else:
        turned = float(one.body_direction + off.direction)
        guides[place] = one._replace(pin=complex(one.pin + off.fixed), body_point=point, body_direction=turned)
    return on_guides((guides[0], guides[1]), linkage.driver, linkage.branch, linkage.start + linkage.ground_angle)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_made_linkages_are_the_closed_forms(drive) -> None:
    random = np.random.default_rng(81)
    travel = np.linspace(0.0, 0.4, 5)
    for _ in range(10):
        linkage = _good(random, drive)
        offs = []
        for _ in range(2):
            off = (*random.normal(size=1), *_plane(random), *_plane(random), *random.normal(size=1))
            offs.append(Deviation(*(0.02 * value for value in off)))
        place, rotation = made(linkage, linkage.start + travel, *offs)
        other = linkage
        for guide, off in enumerate(offs):
            other = _changed(other, guide, off)
        found = other.body(linkage.start + (linkage.ground_angle - other.ground_angle) + travel)
        assert np.allclose(place[0], found.position, atol=1e-9)
        assert np.allclose(np.exp(1j * rotation[0]), np.exp(1j * found.rotation), atol=1e-9)


def _plane(random: np.random.Generator) -> list[complex]:
    return [complex(*random.normal(size=2))]


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_slopes_predict_small_changes(drive) -> None:
    random = np.random.default_rng(82)
    linkage, travel = _good(random, drive), np.linspace(0.0, 0.4, 5)
    at = linkage.body(linkage.start + travel)
    for name, guide, unit in dimensions_of(linkage):
        place, turn = slopes(linkage, linkage.start + travel, [(guide, unit)])
        small = 1e-5
        other = _changed(linkage, guide, Deviation(*(small * value for value in unit)))
        there = other.body(linkage.start + (linkage.ground_angle - other.ground_angle) + travel)
        size = 1 + np.abs(place[0]).max() ** 2
        assert np.allclose((there.position - at.position) / small, place[0], atol=2e-3 * size), name
        assert np.allclose((there.rotation - at.rotation) / small, turn[0], atol=2e-3 * size), name


@pytest.mark.parametrize("drive", DRIVES[1:], ids=NAMES[1:])
def test_a_study_is_linear_in_small_tolerances_and_agrees_with_first_order(drive) -> None:
    linkage, travel = _good(np.random.default_rng(83), drive), np.linspace(0.0, 0.4, 5)
    sizes = Tolerances(1e-5, 2e-5, 1.5e-5)
    one = simulate(linkage, travel, 5, sizes, 4000, 0, Work(None))
    twice = simulate(linkage, travel, 5, Tolerances(*(2 * size for size in sizes)), 4000, 0, Work(None))
    assert one.open_share == 0
    for small, large in ((one.rotation, twice.rotation), (one.position, twice.position)):
        assert np.allclose(large.simulated, 2 * small.simulated, rtol=5e-3, atol=1e-12)
        assert np.allclose(large.linear, 2 * small.linear, rtol=1e-6, atol=1e-12)
        assert np.allclose(small.simulated[:, 1:], small.linear[:, 1:], rtol=0.12, atol=1e-9)
        assert len(small.contributions) == len(sources_of(linkage))
        assert small.contributions.sum() == pytest.approx(1.0, abs=1e-9) or small.contributions.sum() == 0


def test_radii_pivots_and_play_of_a_four_bar_do_what_they_did() -> None:
    linkage = four_bar((1.0, 3.0, 2.5, 3.2), -1, 0.3, 0j, 0.7, (1.3, 0.4), 0.2)
    travel, sizes = np.linspace(0, 2, 9), Tolerances(0.0, 1e-3, 2e-3)
    known = fourbar.simulate(linkage, travel, 9, sizes, 4000, 0, Work(None))
    found = simulate(linkage, travel, 9, sizes, 4000, 0, Work(None))
    assert np.allclose(found.rotation.linear, known.rotation.linear, rtol=1e-5)
    assert np.allclose(found.position.linear, known.position.linear, rtol=1e-5)
    assert np.allclose(found.position.worst, known.position.worst, rtol=0.05)
