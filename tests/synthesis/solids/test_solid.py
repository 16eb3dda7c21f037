"""Parts of the worked linkages are apart in every position, with their fits, washers and masses.

A pin without play, or a post in the path of a link, would show here.
"""

from typing import Any

import numpy as np
import pytest

from synthesis.solids.solid import COLOURS, FITS, parts_list
from tests.conftest import some_of
from tests.oracles.four_bar_joints import joints_at
from tests.oracles.solids import SASH, TABLE, built, deepest, linkage_of, places_of

CASES = [
    ("E1", "below", False, ()),
    ("E1", "both", True, ()),
    ("E2", "below", False, SASH),
    ("E2", "both", False, ()),
]
CASES += [("E3", "both", False, ()), ("E3", "both", True, ()), ("E3", "bar", False, ())]
CASES += [("E4", "below", True, ()), ("E4", "both", False, ())]


def fitted() -> list[Any]:
    """Each case with each fit; the default run takes one of them for each case, in turn."""
    fits = [*FITS]
    turns = [(fits[(k + turn) % len(fits)], *case) for turn in range(len(fits)) for k, case in enumerate(CASES)]
    return some_of(turns, len(CASES))


@pytest.mark.parametrize(("fit", "name", "boards", "heads", "body"), fitted())
def test_no_two_parts_overlap_anywhere(name, boards, heads, body, fit) -> None:
    solids = built(name, boards, heads, fit, body)
    deep, who = deepest(solids, 20)
    assert deep <= 1e-9, who
    names = [part.name for part in solids.parts]
    assert len(set(names)) == len(names)
    assert {"crank", "coupler", "rocker"} <= set(names)
    assert all(part.prism.thinnest_wall > 0 for part in solids.parts)
    assert solids.thinnest_wall[0] == min(part.prism.thinnest_wall for part in solids.parts)


def test_poses_are_those_of_the_linkage() -> None:
    solids, linkage = built("E2", "both"), linkage_of(TABLE["E2"])
    for travel in places_of(solids.machine, 7):
        joints = joints_at(linkage, np.array([travel]))
        expected = {
            "crank": (joints.pivot_a, joints.crank_angle),
            "coupler": (joints.crank_pin[0], joints.coupler_angle),
            "rocker": (joints.pivot_b, joints.rocker_angle),
            "pin_C": (joints.coupler_pin[0], joints.coupler_angle),
            "board_below": (joints.pivot_a, [0.0]),
        }
        for part, (turn, shift, up) in zip(solids.parts, solids.posed(travel), strict=True):
            assert up == part.up and abs(abs(turn) - 1) < 1e-15
            if part.name in expected:
                origin, angle = expected[part.name]
                assert shift == pytest.approx(complex(origin), abs=1e-10)
                assert turn == pytest.approx(np.exp(1j * angle[0]), abs=1e-11)


def test_holes_and_pins_have_the_play_of_their_fit() -> None:
    for fit, turning, held in (("H7", 0.0, 0.0), ("print", 0.4, 0.1)):
        solids = {part.name: part for part in built("E4", "both", True, fit).parts}
        diameter = solids["pin_D"].prism.diameter
        assert diameter == pytest.approx(6 - turning)
        # the crank holds pin D and turns on pin A
        sizes = {hole.core[0]: 2 * hole.radius for hole in solids["crank"].prism.holes}
        assert sizes[0j] == pytest.approx(diameter + turning)
        assert sizes[30 + 0j] == pytest.approx(diameter + held)
        assert all(2 * hole.radius == pytest.approx(diameter + held) for hole in solids["board_below"].prism.holes)
        assert 2 * solids["head_C_above"].prism.holes[0].radius == pytest.approx(diameter + held)
        assert solids["pin_A"].turns == "crank" and solids["pin_C"].turns == "rocker"


def test_the_parts_list_says_what_a_workshop_asks() -> None:
    solids = built("E4", "both", True)
    columns = parts_list(solids, FITS["H7"])
    rows = {name: {key: values[k] for key, values in columns.items()} for k, name in enumerate(columns["name"])}
    assert rows["crank"]["length"] == 48 and rows["crank"]["width"] == 18 and rows["crank"]["thickness"] == 3
    assert rows["crank"]["holes"] == "2 x 6" and rows["crank"]["tolerance"] == "H7 +0.012/0"
    assert rows["pin_C"]["diameter"] == 6 and rows["pin_C"]["tolerance"] == "g6 -0.004/-0.012"
    assert rows["pin_C"]["thickness"] is None and rows["pin_C"]["length"] > 6
    assert rows["washer_A1"]["diameter"] == pytest.approx(10.8)
    assert sum(columns["mass"]) == pytest.approx(1000 * sum(part.mass.mass for part in solids.parts))
    assert set(parts_list(built("E4", "both", fit="print"), FITS["print"])["tolerance"]) == {None}
    assert set(COLOURS.values()) >= {part.colour for part in solids.parts if part.kind in ("plate", "board")}
