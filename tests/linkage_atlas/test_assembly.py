"""Assemblies have the layers, verdicts and sentences that users rely on, in every unit.

A free linkage that is called blocked, or an order that ignores layers, would show here.
"""

import json

import numpy as np
import pytest

import linkage_atlas as la
from app.registry import worked_example

CRANK_ROCKER = (30, 60, 70, 50)


def motion(**more) -> la.Motion:
    example = worked_example()
    return la.Motion(example["rotation"], example["position"], example["crank_span"], **more)


def by_layers(solution: la.Solution) -> tuple[bool, int, int]:
    """Return the order of preference in layers: free, pivots that no link passes over, and few layers."""
    assembly = solution.verdict.assembly
    return not assembly.free, sum(not shaft.both_sides for shaft in assembly.pivot_supports.values()), assembly.count


def test_the_reply_says_what_was_found() -> None:
    found = la.FourBar(*CRANK_ROCKER).assembly(hole=6, width=18)
    assert (found.status, found.count, found.layers) == ("free", 3, {"crank": 1, "coupler": 2, "rocker": 3})
    assert found.mounts == {"A": "below", "B": "below"}
    assert found.smallest_gap.value == pytest.approx(7.787878787878787)
    assert set(found.smallest_gap.pair) == {"crank", "B"}
    assert found.fewer_layers["2"]["pair"] == ["crank", "rocker"]
    assert found.fewer_layers["2"]["from"] == pytest.approx(345.44264, abs=1e-6)
    assert not found.pivot_supports["A"].both_sides
    assert "coupler passes over A" in found.pivot_supports["A"].blocking_parts
    assert found.pivot_supports["B"] == (True, None)
    assert found.stops.low == found.stops.high == (None, None, None)
    assert found.sizes.thickness == 3.0
    assert json.loads(json.dumps(found.to_dict()))["collisions"] == []


def test_radians_are_degrees_in_radians() -> None:
    layers = la.FourBar(*CRANK_ROCKER).assembly(hole=6, width=18)
    second = la.FourBar(*CRANK_ROCKER, degrees=False).assembly(hole=6, width=18)
    assert np.rad2deg(second.fewer_layers["2"]["to"]) == pytest.approx(layers.fewer_layers["2"]["to"])
    assert any(" rad" in reason for reason in second.reasons)


def test_lengths_scale() -> None:
    """Law: k times the lengths gives k times the gaps, and the same angles."""
    layers = la.FourBar(*CRANK_ROCKER).assembly(hole=6, width=18)
    for k in (1e-20, 3.7, 1e20):
        second = la.FourBar(*(k * length for length in CRANK_ROCKER)).assembly(hole=6 * k, width=18 * k)
        assert second.layers == layers.layers
        assert second.smallest_gap.value / k == pytest.approx(layers.smallest_gap.value)
        assert second.fewer_layers["2"]["to"] == pytest.approx(layers.fewer_layers["2"]["to"], abs=1e-9)


def test_a_mirror_changes_nothing_but_signs() -> None:
    layers = la.FourBar(19, 72, 144, 165, start_angle=30).assembly(motion(), boards="both")
    mirrored = la.Motion([0, -1, -2], crank_span=-70)
    second = la.FourBar(19, 72, 144, 165, -1, start_angle=-30).assembly(mirrored, boards="both")
    assert second.layers == layers.layers
    assert second.stops.low.crank_angle == pytest.approx(-layers.stops.high.crank_angle)
    assert second.stops.high.crank_angle == pytest.approx(-layers.stops.low.crank_angle)


def test_a_blocked_linkage_is_told_what_would_free_it() -> None:
    found = la.FourBar(60, 50, 70, 30).assembly(hole=3.5, width=8.75)
    assert found.status == "blocked"
    assert found.longest_free == pytest.approx((12.1948754, 347.8051246))
    assert found.stops.low.cause == "pair"
    assert any("with boards on both sides 3 layers are free: A below, B above" in reason for reason in found.reasons)
    assert la.FourBar(60, 50, 70, 30).assembly(boards="both").free
    assert la.FourBar(60, 50, 70, 30).assembly(boards="bar").free


def test_buildable_is_practical_and_free() -> None:
    without = la.synthesize(motion(), top=2)
    assert all(solution.verdict.practical_without_collisions is None for solution in without), (
        "no layers were looked for"
    )
    assert without.best.verdict.assembly is None
    # plates as wide as the ground: nothing passes
    blocked = la.synthesize(motion(), top=2, limits={"preset": "practical"}, assembly={"hole": 5, "width": 150})
    for solution in blocked:
        assert solution.verdict.practical
        assert not solution.verdict.practical_without_collisions
        assert solution.verdict.assembly.status == "blocked"
        assert solution.verdict.reasons[-1].startswith("layers:")
    free = la.synthesize(motion(), top=2, limits={"preset": "practical"}, assembly=True)
    assert free.best.verdict.practical_without_collisions
    assert free.best.verdict.assembly.free


def test_preferring_layers_ranks_by_pivots_that_nothing_passes_over() -> None:
    poses = {"position": [[0, 0], [40, 8], [75, 30]], "rotation": [0, 15, 40], "timing": "free"}
    wide_plates = {"width": 20, "hole": 4}
    found = la.synthesize(**poses, prefer="layers", top=8, assembly=wide_plates)
    keys = [by_layers(solution) for solution in found]
    assert keys == sorted(keys)
    assert len(set(keys)) > 2


def test_the_body_turns_with_the_requested_rotation() -> None:
    """A corner of the body's plate at the first sample is where the request's frame has it."""
    example = worked_example()
    best = la.synthesize(motion(), top=1).best
    corners = [[0, 0], [30, 0], [30, 20], [0, 20]]
    found = best.linkage.assembly(body=corners)
    plate = next(part for part in found.parts if part.name == "body")
    joints = best.linkage.joints([0.0])
    pin, turn = complex(*joints.crank_pin[0]), np.deg2rad(joints.coupler_direction[0])
    world = [pin + np.exp(1j * turn) * complex(*corner) for corner in plate.core]
    frame = complex(*example["position"][0]), np.deg2rad(example["rotation"][0])
    expected = [frame[0] + np.exp(1j * frame[1]) * complex(*corner) for corner in corners]
    assert np.array(world) == pytest.approx(np.array(expected), abs=1e-6)


def test_the_request_s_envelope_holds_for_plates_and_the_body() -> None:
    example = worked_example()
    free = la.synthesize(motion(), top=1, assembly=True).best
    joints = free.linkage.joints(np.linspace(0, example["crank_span"], 200))
    all_cases = joints.crank_pin, joints.coupler_pin, joints.body_point, [joints.pivot_a, joints.pivot_b]
    low, high = (end(np.concatenate(all_cases), axis=0) for end in (np.min, np.max))
    lines = [*(low - 1), *(high + 1)]
    # the lines stay within, the plates of half the width around them do not
    tight = free.linkage.assembly(envelope=lines)
    assert tight.status == "blocked"
    assert "leaves the envelope" in tight.reasons[0]
    assert tight.collisions[0]["pair"][0] == "envelope"
    wide = [*(low - 20), *(high + 20)]
    assert free.linkage.assembly(envelope=wide).free
    assert not free.linkage.assembly(envelope=wide, body=[[0, 0], [300, 0], [300, 20], [0, 20]]).free
    found = la.synthesize(motion(), {"envelope": lines}, top=1, assembly=True).best
    assert found.verdict.assembly.status == "blocked"
    assert not found.verdict.practical_without_collisions


def test_sliders_have_layers_too() -> None:
    crank = {"guide": "circle", "pivot": [0, 0], "radius": 1, "body_point": [0, 0]}
    rail = {"guide": "rail", "point": [0, 0.3], "direction": 0, "body_point": [2, 0]}
    pump = la.Linkage([crank, rail], "crank")
    found = pump.assembly()
    assert found.free
    assert set(found.layers) == {"crank", "coupler", "rail"}
    (slit,) = next(part for part in found.parts if part.name == "rail").slits
    assert slit.last[0] - slit.first[0] == pytest.approx(np.sqrt(9 - 0.09) - np.sqrt(1 - 0.09))
    assert la.Linkage.from_dict(pump.to_dict()).assembly().layers == found.layers
    pushed = la.Linkage([rail, {**crank, "body_point": [0, 0]}], "slider", start=2.0)
    request = la.Motion([0, 1, 2], [[0, 0], [0.1, 0], [0.2, 0]], timing="free")
    reported = pushed.assembly(request, travel=[0, 0.3, 0.6])
    assert all("degrees" not in reason for reason in reported.reasons)


def test_a_motor_and_its_rod_are_two_more_plates() -> None:
    linkage, request = la.FourBar(*CRANK_ROCKER, start_angle=40), la.Motion([0, 1, 2], crank_span=60)
    drive = next(drive for drive in la.drives(linkage, [{"kind": "dyad", "links": ["crank"]}], motion=request).drives)
    found = linkage.assembly(request, drive=drive)
    assert set(found.layers) == {"crank", "coupler", "rocker", "motor_crank", "rod"}
    assert {pin.name for pin in found.pins} == {"A", "B", "C", "D", "K", "M", "Q"}
    assert any("angles of the motor" in reason for reason in found.reasons)
    assert linkage.assembly(request, drive=drive.to_dict()).layers == found.layers
