"""A linkage with its motor moves and is saved as the reply of its drive describes.

A motor at a wrong position in a file would show here.
"""

import csv
import io

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.drives.links import motions_at

FOUR_BAR = la.FourBar(30, 60, 70, 50, start_angle=40, coupler_point_polar=(40, 30), pivot_a=(5, -3))
LOAD = {"force": [0, -10]}
GUIDES = [
    {"guide": "circle", "pivot": [0, 0], "radius": 10, "body_point": [0, 0]},
    {"guide": "rail", "point": [0, 3], "direction": 0, "body_point": [20, 0]},
]
PUMP = la.Linkage(GUIDES, "crank", start=30)


@pytest.fixture(
    scope="module",
    params=[
        (FOUR_BAR, "crank", [0, 60]),
        (FOUR_BAR, "coupler", [0, 60]),
        (FOUR_BAR, "rocker", [60, 130]),
        (PUMP, "crank", [0, 50]),
        (PUMP, "coupler", [0, 50]),
    ],
)
def driven(request):
    linkage, link, ends = request.param
    found = la.drives(linkage, [{"kind": "dyad", "links": [link]}], crank_angle=ends, load=LOAD)
    assert found.drives, found.refused
    return linkage, ends, found.drives[0]


def test_motor_and_rod_keep_their_lengths_over_a_turn(driven) -> None:
    linkage, ends, drive = driven
    six = drive.six_bar
    assert np.min(six.crank_angle) == pytest.approx(min(ends), abs=1e-9)
    assert np.max(six.crank_angle) <= max(ends) + 1e-9
    moved = motions_at(linkage.plain, np.deg2rad(six.crank_angle)).links[drive.link]
    pin, knee = moved.position(complex(*drive.pin_on_link)), six.motor_pin @ [1, 1j]
    assert np.abs(pin - knee) == pytest.approx(np.full(knee.shape, six.coupler))
    assert np.abs(knee - complex(*drive.motor)) == pytest.approx(np.full(knee.shape, six.crank))
    assert np.abs(np.diff(six.motor_angle)) == pytest.approx(np.full(120, 3.0))
    assert sum(six.motor_turn) == pytest.approx(np.sign(six.motor_turn[0]) * 360)


def test_its_files_hold_the_motor(driven) -> None:
    linkage, ends, drive = driven
    travel = np.linspace(*ends, 20)
    rows = list(csv.DictReader(io.StringIO(linkage.render("csv", crank_angle=travel, drive=drive))))
    for row in rows:
        knee, pin = (
            complex(float(row[f"drive_{name}_x"]), float(row[f"drive_{name}_y"])) for name in ("knee", "pin")
        )
        assert abs(knee - complex(*drive.motor)) == pytest.approx(drive.six_bar.crank)
        assert abs(knee - pin) == pytest.approx(drive.six_bar.coupler)
    assert 'id="DRIVE"' in linkage.render("svg", crank_angle=travel, drive=drive) or drive.kind
    assert "DRIVE" in linkage.render("dxf", crank_angle=travel, drive=drive)


def test_layers_and_parts_hold_the_motor_within_its_motion_only() -> None:
    drive = la.drives(FOUR_BAR, [{"kind": "dyad", "links": ["crank"]}], crank_angle=[0, 60]).drives[0]
    assert {"motor_crank", "rod"} <= set(FOUR_BAR.assembly(crank_angle=[0, 60], drive=drive).layers)
    with pytest.raises(la.FieldError) as refused:
        FOUR_BAR.assembly(crank_angle=[0, 90], drive=drive)
    assert refused.value.field == "/drive"
