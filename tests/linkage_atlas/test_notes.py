"""The notes of a reply are true, the same on every run, and whole sentences in the user's terms.

It would catch a limit that holds the best linkage and is not named, a comparison with a wrong error, and notes that depend on
the clock.
"""

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.notes import FAULTS, LIMIT_WORDS
from synthesis.limits import FORMS, practical_limits
from synthesis.target import make_target
from tests.conftest import ticking

GIVEN_PIVOTS: dict[str, Any] = {
    "timing": "free",
    "position": [[0, 0], [-0.907, 0], [-1.447, 0]],
    "rotation": [111.8, 191.1, 237.4],
    "limits": {"pivot_a": [-1.788, -1.994], "pivot_b": [0.212, -1.994]},
}
"""Three poses with both fixed pivots: the exact four-bar is a double-rocker with a transmission angle of 10.8 degrees."""
LID: dict[str, Any] = {
    "timing": "free",
    "position": [[0, 0], [40, 8], [75, 30], [90, 60]],
    "rotation": [0, 15, 40, 60],
}
PATH: dict[str, Any] = {"timing": "free", "position": LID["position"]}
NOWHERE = {"pivot_box": [-30, -30, 0, 0], "link_min": 200}
"""Limits within which no linkage lies."""


def relaxed(request: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    return {**request, "limits": {**request.get("limits", {}), **more}}


@pytest.mark.parametrize("family", ["full_crank", "any"])
def test_a_transmission_angle_that_holds_the_best_linkage_is_named(family: str) -> None:
    """The limit depends on the first and last crank angle, which are unknowns of free timing: only the pivots were named."""
    request = relaxed(GIVEN_PIVOTS, {"family": family})
    best = la.synthesize(**request, top=1).best
    held = best.determination.active_limits
    assert {"transmission_angle_min", "pivot_a", "pivot_b"} <= set(held)
    eased = la.synthesize(
        **relaxed(request, {"transmission_angle_min": 34}), start_from=[best], refine_only=True, top=1
    ).best
    assert eased.errors.objective < best.errors.objective * (1 - 1e-3)
    exact = la.synthesize(**relaxed(request, {"family": "any", "transmission_angle_min": 5}), top=1).best
    assert exact.errors.objective < 1e-9 and "transmission_angle_min" not in exact.determination.active_limits


@pytest.mark.parametrize("seed", range(2))
def test_only_limits_without_which_the_error_falls_are_named(seed: int) -> None:
    """A transmission angle at its limit is named if, and only if, a slightly smaller limit gives a smaller error nearby."""
    random = np.random.default_rng(seed)
    turned, direction = random.uniform(20, 60, 5).cumsum(), random.normal(size=(5, 2)).cumsum(axis=0) * 30
    request = {"timing": "free", "rotation": turned, "position": direction}
    request["limits"] = {"transmission_angle_min": 50, "family": "full_crank"}
    best = la.synthesize(**request, top=1, prefer="error").best
    nearby = la.synthesize(
        **relaxed(request, {"transmission_angle_min": 49.5}), start_from=[best], refine_only=True, top=1
    ).best
    gained = nearby.errors.objective < best.errors.objective * (1 - 1e-6)
    assert ("transmission_angle_min" in best.determination.active_limits) == gained


def at_rest(rotation: Any, position: Any, scale: float) -> float:
    """Return the error of the best body at rest, rotations modulo a turn, by trying angles."""
    angles, tried = np.deg2rad(rotation), np.linspace(0, 2 * np.pi, 20_001)[:, None]
    off = (angles - tried + np.pi) % (2 * np.pi) - np.pi
    centred = np.asarray(position) - np.mean(position, axis=0)
    return float(np.sqrt(np.mean(off**2, axis=1).min() + np.sum(centred**2) / len(centred) / scale**2))


@pytest.mark.parametrize("turns", [1, 7])
def test_a_motion_that_no_linkage_makes_is_compared_with_a_body_at_rest(turns: int) -> None:
    """The angles of a body that turns many times count modulo a turn: once no note came, or a ratio far too small."""
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rotation, position = np.rad2deg(turns * t), np.c_[40 * np.cos(t), 45 * np.sin(t)]
    found = la.synthesize(rotation, position, timing="free", closed=True, top=1)
    share = found.best.errors.objective / at_rest(rotation, position, found.report.length_scale)
    notes = [note for note in found.report.notes if "a body at rest" in note]
    assert [f"{share:.2g} times" in note for note in notes] == [True] * (share > 0.5)
    assert turns == 1 or share > 0.5


def test_poses_in_a_jumbled_order_are_offered_any_order() -> None:
    """In the order given the best linkage is 20.7 off; passed in any order the poses are met to 0.16."""
    jumbled = {**LID, "position": [[0, 0], [75, 30], [40, 8], [90, 60]], "rotation": [0, 40, 15, 60]}
    request = (jumbled, jumbled | {"order": "any"}, LID, jumbled | {"closed": True})
    ordered, any_order, *remaining = (la.synthesize(**fields, top=1) for fields in request)
    (note,) = [note for note in ordered.report.notes if "in any order" in note]
    prescribed, free = [float(number) for number in re.findall(r"position within (\d+\.?\d*)", note)]
    assert prescribed == pytest.approx(ordered.best.errors.position_max, rel=1e-2)
    # the balanced answer may have a tenth more error, and the note gives two digits
    assert any_order.best.errors.position_max < 1.1 * (free + 0.005) and free < 0.02 * prescribed
    for second in (any_order, *remaining):
        assert not any("in any order" in note for note in second.report.notes)


@cache
def excluded(seconds: float) -> la.Result:
    """Return the answer within limits that exclude all linkages, for such a clock."""
    return la.synthesize(**relaxed(PATH, NOWHERE), work=ticking(seconds))


def test_what_excludes_linkages_does_not_depend_on_the_clock() -> None:
    """Once the same request gave three different sets of notes in five runs."""
    request = relaxed(PATH, NOWHERE)
    found = [excluded(seconds) for seconds in (0.0, 1.0)]
    assert [result.status for result in found] == ["infeasible"] * 2
    assert found[0].report.notes == found[1].report.notes
    fields = [re.findall(r"`limits\.(\w+)`", note) for note in found[0].report.notes]
    assert fields == [["link_min"], ["pivot_box"], []]
    # what each note offers is so
    first, second, third = found[0].report.notes
    assert "errors may be large" in third
    link = float(re.findall(r"at least ([\d.]+) there is one", first)[0])
    box = [float(number) for number in second.split("; ")[1].split("[")[1].split("]")[0].split(",")]
    for more in ({"link_min": link}, {"pivot_box": box}):
        assert la.synthesize(**relaxed(request, more), top=1).solutions


def test_a_budget_that_ends_before_all_limits_were_examined_is_said() -> None:
    request = relaxed(PATH, NOWHERE)
    complete = excluded(1.0).report.elapsed_ms
    searched = (complete["total"] - complete["report"]) / 1000
    budget = searched / 0.8
    assert budget < complete["total"] / 1000
    short = la.synthesize(**request, budget=budget, work=ticking(1.0))
    assert short.status == "infeasible" and short.report.elapsed_ms["total"] / 1000 < 1.2 * budget
    assert short.report.notes[-2] == "The time was up before all limits were examined."


@pytest.mark.parametrize("limits", [{"pivot_box": [500, 500, 501, 501]}, {"link_max": 2}])
def test_poses_that_limits_put_out_of_reach_are_not_called_exact(limits: dict[str, Any]) -> None:
    request = {name: values[:3] if isinstance(values, list) else values for name, values in LID.items()}
    exact, off = (la.synthesize(**request, limits={"family": "any"} | more, top=1) for more in ({}, limits))
    assert any("pass three poses exactly" in note for note in exact.report.notes)
    assert off.best is not None and off.best.errors.objective > 0.1
    assert not any("exactly" in note for note in off.report.notes), off.report.notes


def test_every_limit_has_its_words() -> None:
    assert LIMIT_WORDS.keys() - {"body_reach"} == FORMS.keys()
    practical = practical_limits(make_target(position=np.array([0, 1, 1j]), crank_span=1.0), {})
    assert FAULTS.keys() - {"body_reach", "cylinder_dead_length"} == practical.keys()


def test_given_lengths_are_not_called_loosely_determined() -> None:
    """A trapezoid with ground and arms given: only the coupler is open, which the function fixes."""
    turned = np.deg2rad(np.linspace(-35, 35, 15))
    output = np.rad2deg(np.arctan2(np.tan(turned), 1 + 0.4 * np.tan(turned)))
    request: dict[str, Any] = {"input": np.rad2deg(turned), "output": output, "objective": "max", "top": 1}
    found = la.function(**request, limits={"links": {"ground": 315, "crank": 90, "rocker": 90}})
    fixed = found.best.determination.length_uncertainty
    assert fixed[[0, 2, 3]].tolist() == [0, 0, 0] and fixed[1] > 0
    shown = [note for note in found.report.notes if "ill-posed" in note]
    assert [f"{100 * fixed[1]:.2g} %" in note for note in shown] == [True] * int(fixed[1] > 1e-3)


def test_a_given_zero_fixes_the_lengths_more_closely() -> None:
    request: dict[str, Any] = {"input": [0, 15, 35, 60, 80], "output": [0, 12, 31, 62, 90], "top": 1}
    free = la.function(**request).best
    held = la.function(**request, input_zero=free.start_angle, start_from=[free], refine_only=True).best
    assert np.all(held.determination.length_uncertainty[:3] < 0.95 * free.determination.length_uncertainty[:3])
