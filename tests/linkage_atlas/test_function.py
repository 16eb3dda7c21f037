"""Functions by name, by a callable or by pairs become generators with the documented dials, notes and files.

A wrong dial, an unusable first generator or a wrong rocker curve would show here.
"""

import json
import math

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of

SQUARE = {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 90}


def test_a_callable_is_the_function_whether_it_takes_arrays_or_numbers() -> None:
    options = {"crank_span": 60, "objective": "max", "limits": {"transmission_angle_min": 30}, "top": 1}
    named = la.function(function={"name": "log10", "x": [1, 2], "output_span": -90, "samples": 41}, **options)
    for of in (np.log10, lambda x: math.log10(x)):
        found = la.function(of, interval=(1, 2), output_span=-90, samples=41, **options)
        np.testing.assert_array_equal(found.x, named.x)
        np.testing.assert_allclose(found.y, named.y, rtol=1e-15)
        assert found.best.errors.max == pytest.approx(named.best.errors.max, rel=1e-6)
        assert found.best.errors.max_y == pytest.approx(named.best.errors.max_y, rel=1e-6)


@pytest.mark.parametrize(
    ("of", "more", "field", "words"),
    [
        (lambda x: 1 / (x - 1.5), {}, "/output", "it is inf at x = 1.5"),
        (np.log10, {"interval": (0, 1)}, "/output", "it is -inf at x = 0"),
        (lambda x: np.where(np.abs(x - 1.50012207) < 1e-4, np.nan, x), {}, "/output", "it is nan at x = 1.50012"),
        (lambda x: math.log(x - 1.2), {}, "/output", "the function fails at x = 1: math domain error"),
        (lambda x: 1j * x, {}, "/output", "the function fails at x = 1: "),
        (lambda x: 3.0, {}, "/output", "the same y everywhere"),
        (np.sqrt, {"interval": None}, "/interval", "is required"),
        (np.sqrt, {"interval": (1, 1)}, "/interval", "two different"),
        (np.sqrt, {"output_span": None}, "/output_span", "is required"),
        (np.sqrt, {"samples": 2}, "/samples", "whole number"),
        (np.sqrt, {"crank_span": None}, "/crank_span", "is required"),
        (np.sqrt, {"function": {"name": "ln"}}, "/output", "either"),
        ([0, 10, 30], {"output_span": None}, "/interval", "applies only"),
    ],
)
def test_what_is_wrong_with_a_callable_is_named(of, more, field, words) -> None:
    with pytest.raises(la.FieldError, match=words) as error:
        la.function(of, **{"crank_span": 60, "interval": (1, 2), "output_span": 90} | more)
    assert error.value.field == field


def test_a_reply_tells_everything_and_holds_plain_numbers() -> None:
    limits = {"links": {"ground": 100}, "preset": "practical"}
    request = {"function": SQUARE, "crank_span": 90, "objective": "max", "limits": limits, "top": 2}
    found = la.function(**request, round_to=1, sensitivity=True, curves=True)
    reply = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    best = reply["solutions"][0]
    assert best["links"]["ground"] == 100
    assert all(value == round(value) for value in best["rounded"]["links"].values())
    assert best["rounded"]["errors"]["max"] >= best["errors"]["max"] * (1 - 1e-9)
    assert best["verdict"]["practical"] and best["transmission_angle_min"] >= 35
    assert best["errors"]["max_y"] == pytest.approx(best["errors"]["max"] / 90, rel=1e-9)
    curve = np.array(best["error_curve"]["error"])
    assert np.abs(curve).max() == pytest.approx(best["errors"]["max"], rel=1e-3)
    crank = np.array(best["error_curve"]["input"])
    got = found.linkage.joints(crank).rocker_direction + best["output_offset"]
    np.testing.assert_allclose(curve, (got - 90 * (crank / 90) ** 2 + 180) % 360 - 180, atol=1e-9)
    np.testing.assert_allclose(reply["y"], np.array(reply["x"]) ** 2, atol=1e-14)
    # the first-order change of the output is what a longer link does, up to the offset
    travel = np.linspace(0, 90, 101)
    plain = found.linkage.joints(travel).rocker_direction
    for k, name in enumerate(("crank", "coupler", "rocker")):
        longer = found.linkage.links + 1e-5 * np.eye(4)[k]
        moved = la.FourBar(*longer, found.linkage.branch, start_angle=found.linkage.start_angle).joints(travel)
        change = np.sqrt(np.mean(((moved.rocker_direction - plain) / 1e-5) ** 2))
        assert best["sensitivity"][k] == pytest.approx(change, rel=1e-3), name


def test_radians_and_degrees_are_the_same() -> None:
    maker = la.FourBar(2, 5, 4.5, 5.5, start_angle=40)
    output = maker.joints(np.linspace(0, 100, 9)).rocker_direction
    solution = la.function(output, 100, top=1, input_zero=40).best
    second = la.function(np.deg2rad(output), np.deg2rad(100), top=1, input_zero=np.deg2rad(40), degrees=False).best
    np.testing.assert_allclose(solution.linkage.links, second.linkage.links, rtol=1e-9)
    assert solution.output_offset == pytest.approx(np.rad2deg(second.output_offset), abs=1e-7)


def test_a_jump_is_named_and_infeasible_is_said() -> None:
    found = la.function([0, 1, 2, 60, 61, 62, 63], 60, top=1)
    assert found.status == "closest" and any("sample 3 to 4" in note for note in found.report.notes)
    links = {"ground": 100, "crank": 10, "coupler": 10, "rocker": 10}
    nothing = la.function([0, 10, 30], 60, limits={"links": links})
    assert nothing.status == "infeasible" and not nothing.solutions


def test_equal_angles_are_made_by_a_parallelogram_that_can_be_built() -> None:
    """Cranks of 8.9e6 times the ground at a transmission angle of 0.1 degrees make them too, to within rounding."""
    found = la.function([0, 30, 60, 90], crank_span=90)
    best, links = found.best, found.best.links
    assert found.status == "reached"
    assert best.transmission_angle_min > 40
    assert max(links) < 100 * min(links)
    assert [links.crank, links.coupler] == pytest.approx([links.rocker, links.ground], rel=1e-9)


@pytest.mark.parametrize("top", [1, 10])
def test_of_exact_answers_the_first_is_the_one_to_build(top: int) -> None:
    """Five pairs: an exact linkage has a transmission angle of 19 degrees, a second linkage 70."""
    found = la.function([0, 30, 55, 75, 90], input=[0, 20, 40, 60, 80], top=top)
    assert found.status == "reached" and len(found) <= top
    assert found.best.transmission_angle_min > 60


@pytest.mark.parametrize(
    ("name", "x", "span", "crank", "limits"),
    some_of(
        [
            ("tan", [0, 36.669], -84.73, 116.17, {"family": "full_crank"}),
            ("log10", [1, 8.48], 87.74, 95.42, {"family": "crank_rocker", "preset": "practical"}),
            ("sin", [0, 72.01], -68.92, 142.67, {}),
            ("exp", [0, 2.03], 112.56, 90.53, {"family": "crank_rocker"}),
            ("cos", [0, 60.9], -88.11, 71.01, {"family": "double_crank"}),
        ],
        3,
    ),
)
def test_the_least_largest_error_is_no_larger_than_that_of_the_least_squares(name, x, span, crank, limits) -> None:
    """If the best linkage lay at the edge of its family, the function was called infeasible."""
    request = {"function": {"name": name, "x": x, "output_span": span}, "crank_span": crank, "limits": limits}
    found = [la.function(**request, objective=objective).solutions[0] for objective in ("max", "rms")]
    assert found[0].errors.max <= (0.95 if limits.get("family") == "full_crank" else 1.0001) * found[1].errors.max
    assert found[1].errors.rms <= 1.0001 * found[0].errors.rms


@pytest.mark.parametrize("fields", [{"limits": {"preset": "practical"}}, {"objective": "max"}])
def test_a_sample_of_weight_0_that_cannot_be_reached_gives_no_warning(fields) -> None:
    """Warnings are errors here: infinity times 0 used to give a warning."""
    found = la.function([60, 80, 100], input=[45, 90, 135], weights=[1, 1, 0], top=2, **fields)
    assert found.solutions
