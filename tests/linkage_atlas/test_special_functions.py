"""Quick returns and symmetric steering have the stroke, the time ratio and the proportions of the request.

Catches linkages whose dead centres are elsewhere, whose crank does not turn fully, and arms of the size of the car.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of
from tests.linkage_atlas.test_few_pairs import rocker as angles_of


def slider(lengths: dict[str, float], crank: np.ndarray) -> np.ndarray:
    """Return the position of the slider by Pythagoras' theorem."""
    across = lengths["offset"] - lengths["crank"] * np.sin(crank)
    return lengths["crank"] * np.cos(crank) + np.sqrt(lengths["rod"] ** 2 - across**2)


def rocker(links: Any, branch: int, crank: np.ndarray) -> np.ndarray:
    return np.rad2deg(angles_of(links, branch, crank)[0])


TURN = np.deg2rad(np.arange(0, 360, 0.01))


@pytest.mark.parametrize("ratio", [1.0, 1.4, 2.5])
def test_a_slider_crank_has_the_stroke_and_the_time_ratio(ratio: float) -> None:
    found = la.function(quick_return={"stroke": 300, "time_ratio": ratio})
    assert found.status == "reached" and len(found) > 3
    for solution in found:
        assert solution.kind == "slider_crank"
        built = slider(solution.lengths, np.deg2rad(solution.start) + TURN)
        assert np.ptp(built) == pytest.approx(300, rel=1e-6) and built[0] == pytest.approx(built.min(), abs=1e-4)
        slow = np.argmax(built) * 0.01
        assert slow / (360 - slow) == pytest.approx(ratio, rel=1e-3)


def test_the_best_slider_crank_transmits_best() -> None:
    """No offset slider-crank of this time ratio, on a fine grid of rods and offsets, has a larger transmission angle."""
    found = la.function(quick_return={"stroke": 1, "time_ratio": 1.4}, limits={"transmission_angle_min": 32.6})
    crank, offset = np.meshgrid(np.linspace(0.02, 0.98, 400), np.linspace(0.0, 0.98, 400))
    with np.errstate(invalid="ignore"):  # lengths over the rod
        alpha = np.rad2deg(np.arcsin(offset / (1 - crank)) - np.arcsin(offset / (1 + crank)))
        transmission = np.rad2deg(np.arccos(crank + offset))
    best = np.nanmax(np.where(np.abs(alpha - 30) < 0.3, transmission, np.nan))
    assert found.best.transmission_angle_min == pytest.approx(best, abs=0.3)
    impossible = la.function(quick_return={"stroke": 1, "time_ratio": 1.4}, limits={"transmission_angle_min": 33})
    assert impossible.status == "infeasible" and "at most 32.6 degrees" in impossible.report.notes[0]


def test_no_slider_crank_has_a_time_ratio_of_three() -> None:
    found = la.function(quick_return={"stroke": 10, "time_ratio": 3})
    assert found.status == "infeasible" and "3 or more" in found.report.notes[0]


def test_a_length_of_a_quick_return_may_be_given() -> None:
    found = la.function(quick_return={"stroke": 300, "time_ratio": 1.4}, limits={"links": {"crank": 140}})
    assert found.best.lengths["crank"] == 140
    found = la.function(
        quick_return={"swing": 60, "time_ratio": 1.2}, limits={"links": {"ground": 100, "rocker": 60}}
    )
    assert (found.best.links.rocker, found.best.links.ground) == (60, 100)
    assert np.ptp(rocker(found.best.links, found.best.branch, TURN)) == pytest.approx(60, abs=1e-5)


@pytest.mark.parametrize(("swing", "ratio"), some_of([(60, 1.0), (100, 2.0), (60, 1.2), (40, 1.25)], 2))
def test_a_crank_rocker_has_the_swing_and_the_time_ratio(swing: float, ratio: float) -> None:
    found = la.function(quick_return={"swing": swing, "time_ratio": ratio})
    assert found.status == "reached" and len(found) > 3
    for solution in found:
        assert solution.family == "crank_rocker"
        built = rocker(solution.links, solution.branch, np.deg2rad(solution.start_angle) + TURN)
        assert np.ptp(built) == pytest.approx(swing, abs=1e-5) and built[0] == pytest.approx(built.min(), abs=1e-4)
        slow = np.argmax(built) * 0.01
        assert slow / (360 - slow) == pytest.approx(ratio, rel=1e-3)


def test_practical_limits_leave_the_arms_of_a_steering_well_below_the_track() -> None:
    """The largest ratio of lengths counted as a bound of the arms: they were up to 0.52 of the track; cars have 0.1 to 0.2."""
    request = {"track": 1200, "wheelbase": 2400, "angle": 30}
    found = la.function(steering=request, objective="max", limits={"preset": "practical"})
    assert all(solution.links.crank < 0.201 * 1200 for solution in found)
    assert found.best.verdict.practical


def test_steering_is_symmetric_with_arms_well_below_the_track() -> None:
    """Arms of 4.1 m came for a track of 315 mm. The best trapezoid of a fine grid has no smaller error."""
    track, wheelbase, inner = 315.0, 480.0, 35.0
    request = {"track": track, "wheelbase": wheelbase, "angle": inner}
    found = la.function(steering=request, objective="max")
    left = np.deg2rad(np.linspace(-25.663, inner, 201))
    right = np.arctan(np.tan(left) / (1 + np.tan(left) * track / wheelbase))
    for solution in found:
        crank, _, arm, ground = solution.links
        assert crank == arm and 0.099 * track < arm < 0.201 * track and ground == track
    best = np.inf
    for arm in np.linspace(0.1, 0.2, 12):
        for angle in np.linspace(-np.pi, np.pi, 721):
            links = (arm, 1 - 2 * arm * np.cos(angle), arm, 1.0)
            side = 1 if np.sin(angle) > 0 else -1
            with np.errstate(invalid="ignore"):
                gap = rocker(links, side, left + angle) - np.rad2deg(right) - (180 - np.rad2deg(angle))
            size = np.abs(gap - 360 * np.round(gap[0] / 360)).max()
            best = min(best, size if np.isfinite(size) else np.inf)
    assert found.best.errors.max == pytest.approx(best, rel=0.05) and found.best.errors.max <= best


def test_given_arms_of_a_symmetric_function() -> None:
    """A trapezoid made the pairs, so it is found again."""
    maker = la.FourBar(90, 315 - 180 * np.cos(np.deg2rad(70)), 90, 315, -1, start_angle=-70)
    travel = np.linspace(-25, 35, 21)
    right = maker.joints(travel).rocker_direction
    right -= maker.joints(np.zeros(1)).rocker_direction[0]
    found = la.function(right, input=travel, symmetric=True, limits={"links": {"ground": 315, "crank": 90}})
    np.testing.assert_allclose(found.linkage.links, maker.links, rtol=1e-6)
    assert found.best.links.crank == found.best.links.rocker == 90.0
    assert found.best.start_angle == pytest.approx(-95 + 360, abs=1e-4)


@pytest.mark.parametrize(
    ("quick_return", "limit", "value", "words", "side"),
    [
        ({"swing": 90, "time_ratio": 2.5}, "transmission_angle_min", 20, "crank-rocker is at most ", -1),
        ({"stroke": 300, "time_ratio": 1.4}, "transmission_angle_min", 60, "transmission angle of at most ", -1),
        ({"stroke": 300, "time_ratio": 1.4}, "link_max", 100, "a rod of at least ", 1),
    ],
)
def test_a_quick_return_that_cannot_be_names_limits_that_can(
    quick_return: dict[str, float], limit: str, value: float, words: str, side: int
) -> None:
    refused = la.function(quick_return=quick_return, limits={limit: value})
    assert refused.status == "infeasible"
    (note,) = [note for note in refused.report.notes if words in note]
    bound = float(note.partition(words)[2].split()[0])
    for factor, status in ((1 + 0.05 * side, "reached"), (1 - 0.05 * side, "infeasible")):
        assert la.function(quick_return=quick_return, limits={limit: factor * bound}).status == status
