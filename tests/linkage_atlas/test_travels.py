"""Functions with travel are made by the linkages of the reply, in every unit and within every limit.

A slider that is measured from a wrong origin, or an error that does not belong to the numbers, would show here.
"""

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of, ticking

FROM, TO = {"input_unit": "length"}, {"output_unit": "length"}
BOTH = {**FROM, **TO}
BLOCK, SLOT = {"mechanisms": ["swinging_block"]}, {"mechanisms": ["rail_slot"]}
CASES: dict[str, dict[str, Any]] = {
    "crank to slider": {"output": [0, 4, 11, 20, 29, 36, 40], "crank_span": 90, **TO},
    "crank to cylinder": {"output": [0, 4, 11, 20, 29, 36, 40], "crank_span": -90, **TO, **BLOCK},
    "slider to crank": {"output": [0, 6, 13, 22, 34, 47, 60], "travel_span": 35, **FROM},
    "slider to lever": {"output": [0, 6, 13, 22, 34, 47, 60], "travel_span": -35, **FROM, **SLOT},
    "slider to slider": {"output": [0, 3, 8, 14, 22], "travel_span": 35, **BOTH},
    "slider to cylinder": {"output": [0, 2, 7, 15, 26], "travel_span": 40, **BOTH, **SLOT},
    "cylinder to crank": {"output": [75, 53.6, 35.2, 17.8, 0], "input": [60, 45, 30, 15, 0], **FROM, **BLOCK},
    "cylinder to slider": {"output": [0, 13.7, 25.4, 36.9, 47.6], "travel_span": 40, **BOTH, **SLOT},
}
SORTED = sorted(CASES, key=["slider to crank", "crank to slider", "slider to slider", *CASES].index)
some_cases = pytest.mark.parametrize("case", some_of(SORTED, 2))


@cache
def answered(case: str, objective: str = "rms") -> Any:
    """The answer to a case, which several tests begin from."""
    return la.function(**CASES[case], objective=objective, top=2, curves=True)


def output_of(linkage: Any, case: dict[str, Any], travel: np.ndarray) -> np.ndarray:
    """The output of a solution from its lengths and zeros, by formulas of books, up to whole turns."""
    size, position, side = linkage.lengths, linkage.input_zero + travel, linkage.branch
    if linkage.kind == "slider_crank" and linkage.driver == "crank":
        t, across = np.deg2rad(position), linkage.lengths["offset"] - size["crank"] * np.sin(np.deg2rad(position))
        return size["crank"] * np.cos(t) + side * np.sqrt(size["rod"] ** 2 - across**2)
    if linkage.kind == "swinging_block" and linkage.driver == "crank":
        return np.abs(size["ground"] - size["crank"] * np.exp(1j * np.deg2rad(position)))
    if linkage.kind == "two_rails":
        angle = np.deg2rad(size["angle"])
        along = np.sqrt(size["rod"] ** 2 - (position * np.sin(angle)) ** 2)
        return np.array([position * np.cos(angle) + direction * along for direction in (1, -1)])
    if linkage.kind == "slider_crank":
        distant = position + 1j * size["offset"]
        cosine = (np.abs(distant) ** 2 + size["crank"] ** 2 - size["rod"] ** 2) / (
            2 * size["crank"] * np.abs(distant)
        )
        between = np.arccos(cosine)
        return np.rad2deg(np.array([np.angle(distant) + direction * between for direction in (1, -1)]))
    if linkage.kind == "swinging_block":
        cosine = (size["ground"] ** 2 + size["crank"] ** 2 - position**2) / (2 * size["ground"] * size["crank"])
        return np.rad2deg(np.array([direction * np.arccos(cosine) for direction in (1, -1)]))
    if "slot_offset" not in size:
        return side * np.sqrt(position**2 + (1 if linkage.driver == "slider" else -1) * size["pin_distance"] ** 2)
    arm = 1j * size["pin_distance"] - position
    return np.rad2deg(np.angle(arm) - np.arcsin(size["slot_offset"] / np.abs(arm)))


EITHER = [(case, ("rms", "max")[(k + turn) % 2]) for turn in range(2) for k, case in enumerate(CASES)]


@pytest.mark.parametrize(("case", "objective"), some_of(EITHER, 5))
def test_the_reply_does_what_it_says(case: str, objective: str) -> None:
    request = CASES[case]
    found = answered(case, objective)
    assert found.status == "closest" and found.solutions
    travel, expected = found.input, found.output
    for linkage in found:
        built = np.atleast_2d(output_of(linkage, request, travel)) + linkage.output_offset
        gaps = built - expected
        if request.get("output_unit") != "length":
            gaps = (gaps + 180) % 360 - 180
        gap = gaps[np.argmin(np.abs(gaps).max(axis=1))]
        assert np.sqrt(np.mean(gap**2)) == pytest.approx(linkage.errors.rms, rel=1e-5, abs=1e-9)
        assert np.abs(gap).max() <= linkage.errors.max * (1 + 1e-6)
        assert (
            np.abs(linkage.error_curve.error).max() == pytest.approx(linkage.errors.max, rel=0.02)
            or objective == "rms"
        )
        # the linkage and its file agree with the numbers
        table = [line.split(",") for line in found.render("csv", linkage.rank).splitlines()]
        errors = np.array([float(row[table[0].index("error")]) for row in table[1:]])
        np.testing.assert_allclose(errors, gap, atol=1e-6)
        assert linkage.transmission_angle_min > 0 and linkage.verdict.works
        repeated = la.Linkage.from_dict(linkage.to_dict())
        np.testing.assert_allclose(
            repeated.joints(travel).rotation, linkage.linkage.joints(travel).rotation, atol=1e-9
        )
        for kind in ("svg", "dxf", "mjcf"):
            assert found.render(kind, linkage.rank)
    assert json.loads(json.dumps(found.to_dict())) == found.to_dict() and linkage.kind in repr(found)


@some_cases
def test_units_only_name(case: str) -> None:
    """Millimetres or metres, degrees or radians: the same linkages."""
    request = CASES[case]
    first = answered(case).best
    lengths = {"output": request.get("output_unit") == "length", "input": request.get("input_unit") == "length"}
    rescaled: dict[str, Any] = dict(request)
    for name, kind in (("output", "output"), ("input", "input"), ("crank_span", "input"), ("travel_span", "input")):
        if name in request:
            rescaled[name] = np.multiply(request[name], 1e-3 if lengths[kind] else np.pi / 180)
    second = la.function(**rescaled, degrees=False, top=1).best
    if "cylinder" not in case:  # crank and ground can be exchanged
        for name, value in first.lengths.items():
            mine, size = second.lengths[name], np.pi / 180 if name == "angle" else 1e-3
            assert abs(mine) == pytest.approx(abs(value) * size, rel=1e-4)
    unit = 1e-3 if lengths["output"] else np.pi / 180
    assert second.errors.rms == pytest.approx(first.errors.rms * unit, rel=1e-6)
    assert second.errors.objective == pytest.approx(first.errors.objective, rel=1e-6)


@some_cases
def test_an_exact_function_is_found(case: str) -> None:
    request = CASES[case]
    close = answered(case)
    exact = np.atleast_2d(output_of(close.best, request, close.input))
    built = exact[np.argmin(np.ptp(np.array(request["output"]) - exact, axis=1))]
    if request.get("output_unit") != "length":
        built = np.rad2deg(np.unwrap(np.deg2rad(built)))
    found = la.function(**{**request, "output": built}, tolerance=1e-7)
    assert found.status == "reached"


def test_limits_are_kept_and_the_first_is_the_best_of_them() -> None:
    request = CASES["crank to slider"]
    free = answered("crank to slider").best
    limits = {"transmission_angle_min": free.transmission_angle_min + 5, "link_max": 200, "link_ratio_max": 3}
    found = la.function(**request, limits=limits, top=5)
    for solution in found:
        links = [solution.lengths["crank"], solution.lengths["rod"]]
        assert solution.transmission_angle_min >= limits["transmission_angle_min"] - 1e-6
        assert max(links) <= 200 * (1 + 1e-6) and max(links) <= 3 * min(links) * (1 + 1e-6)
        assert solution.errors.rms >= free.errors.rms * (1 - 1e-9)
    prescribed = la.function(**request, limits={"offset": 0, "links": {"crank": 30, "coupler": 90}}, top=1).best
    assert prescribed.lengths == {"crank": 30.0, "rod": 90.0, "offset": 0.0}
    practical = la.function(**request, limits={"preset": "practical"}, top=1).best
    assert practical.verdict.practical and practical.transmission_angle_min >= 35 - 1e-6


def test_one_way_and_several_kinds_and_little_time() -> None:
    request = CASES["slider to crank"]
    found = la.function(**{**request, "mechanisms": "all"}, one_way=True, objective="max", top=6)
    assert {linkage.kind for linkage in found} == {"slider_crank", "swinging_block", "rail_slot"}
    assert any("several kinds" in note for note in found.report.notes)
    for generator in found:
        assert not [reason for reason in generator.verdict.reasons if "turns back" in reason]
    objectives = [solution.errors.objective for solution in found]
    assert objectives == sorted(objectives) and [solution.rank for solution in found] == list(
        range(1, len(found) + 1)
    )
    quick = la.function(**request, budget=0.02, work=ticking(1e-3))
    assert quick.status in ("closest", "unknown") and quick.report.elapsed_ms["total"] < 1000


@pytest.mark.parametrize("driver", ["slider", "cylinder"])
def test_a_slider_and_a_cylinder_that_make_a_function_exactly_are_found(driver) -> None:
    slider = np.linspace(10.0, 60.0, 9)
    cylinder = np.hypot(slider, 30.0)
    request, built = (slider, cylinder) if driver == "slider" else (cylinder, slider)
    found = la.function(built - built[0], input=request - request[0], **BOTH, **SLOT)
    assert (found.status, found.best.driver) == ("reached", driver)
    assert found.best.lengths["pin_distance"] == pytest.approx(30.0, rel=1e-9)
    assert found.best.input_zero == pytest.approx(request[0], rel=1e-9)
