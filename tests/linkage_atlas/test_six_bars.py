"""A linkage with its motor moves, is drawn and saved as the reply of its drive describes.

A motor at a wrong position in a file would show here.
"""

import csv
import io

import numpy as np
import pytest

import linkage_atlas as la

FOUR_BAR = la.FourBar(30, 60, 70, 50, start_angle=40, coupler_point_polar=(40, 30), pivot_a=(5, -3))
LOAD = {"force": [0, -10]}
GUIDES = [
    {"guide": "circle", "pivot": [0, 0], "radius": 10, "body_point": [0, 0]},
    {"guide": "rail", "point": [0, 3], "direction": 0, "body_point": [20, 0]},
]


def found(linkage, links, direction, **request) -> la.SixBarLinkage:
    drives = la.drives(linkage, [{"kind": "dyad", "links": links, **request}], crank_angle=direction, load=LOAD)
    assert drives.drives, drives.refused
    return drives.drives[0].linkage, drives.drives[0]


@pytest.fixture(scope="module", params=["crank", "coupler", "rocker", "pump", "pump body"])
def six(request):
    if request.param.startswith("pump"):
        pump = la.Linkage(GUIDES, "crank", start=30)
        return found(pump, ["crank" if request.param == "pump" else "coupler"], [0, 20, 50])
    return found(FOUR_BAR, [request.param], [60, 90, 130] if request.param == "rocker" else [0, 25, 60])


def test_it_is_what_the_reply_of_its_drive_says(six) -> None:
    linkage, drive = six
    bar = drive.six_bar
    assert linkage.kind == bar.kind
    assert linkage.dwell() == pytest.approx(bar.dwell)
    assert linkage.turn == pytest.approx(bar.motor_turn)
    assert linkage.time_ratio == pytest.approx(bar.time_ratio)
    assert linkage.transmission_angle_min() == pytest.approx(bar.transmission_angle_min, abs=1e-3)
    sense = np.sign(bar.motor_turn[0])
    turned = (bar.motor_angle - bar.motor_angle[0]) * 1.0
    joints = linkage.joints(turned)
    assert joints.travel == pytest.approx(bar.crank_angle, abs=1e-9)
    assert joints.joints["K"] == pytest.approx(bar.motor_pin, abs=1e-9)
    assert linkage.joints(sense * abs(linkage.turn[0])).travel == pytest.approx(linkage.ends[1], abs=1e-6)
    # the rod is between its pins all the way
    assert np.linalg.norm(joints.joints["Q"] - joints.joints["K"], axis=1) == pytest.approx(np.full(121, linkage.rod))
    repeated = la.SixBarLinkage.from_dict(linkage.to_dict())
    assert repeated.joints(turned).joints["C"] == pytest.approx(joints.joints["C"], abs=1e-9)
    assert repr(repeated) == repr(linkage)


def test_its_files_hold_the_motor(six, tmp_path) -> None:
    linkage, drive = six
    rows = list(csv.DictReader(io.StringIO(linkage.render("csv"))))
    assert len(rows) == 73
    assert [float(row["motor_angle"]) for row in rows] == pytest.approx(np.linspace(0, 360, 73))
    for row in rows:
        knee, pin = (complex(float(row[f"{name}_x"]), float(row[f"{name}_y"])) for name in "KQ")
        assert abs(knee - complex(*drive.motor)) == pytest.approx(drive.six_bar.crank)
        assert abs(knee - pin) == pytest.approx(drive.six_bar.coupler)
    assert len(list(csv.DictReader(io.StringIO(linkage.render("csv", motor=[0, 90]))))) == 2
    assert 'id="DRIVE"' in linkage._repr_svg_()
    assert "DRIVE" in linkage.render("dxf")
    linkage.save(tmp_path / "wiper.svg")
    assert (tmp_path / "wiper.svg").read_text() == linkage.render("svg")


def test_of_a_solution_it_passes_the_samples() -> None:
    position = [[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]]
    best = la.synthesize(position=position, rotation=[0, 12, 27, 45, 66], timing="free", top=1)[0]
    linkage = la.drives(best, [{"kind": "dyad"}]).drives[0].linkage
    passed = linkage.joints(np.rad2deg(linkage.motion_travel)).linkage
    assert passed.body_point == pytest.approx(best.linkage.joints(best.crank_angle).body_point, abs=1e-6)
    assert np.all(np.diff(linkage.motion_travel) * np.sign(linkage.turn[0]) > 0)
    assert la.SixBarLinkage(best, linkage.drive).ends == pytest.approx(linkage.ends)


def test_what_is_amiss_is_named() -> None:
    six_bar, drive = found(FOUR_BAR, ["crank"], [0, 60])
    for call, field in (
        (lambda: la.SixBarLinkage(FOUR_BAR, drive), "/crank_angle"),
        (lambda: la.SixBarLinkage(FOUR_BAR, {"kind": "rotary"}, [0, 60]), "/drive"),
        (lambda: la.SixBarLinkage(FOUR_BAR, {**six_bar.drive, "link": "wing"}, [0, 60]), "/drive"),
        (lambda: la.SixBarLinkage(FOUR_BAR, drive, [0, 90]), "/drive"),
        (lambda: la.SixBarLinkage(six_bar, drive, [0, 60]), "/linkage"),
        (lambda: la.drives(six_bar), "/linkage"),
        (lambda: la.SixBarLinkage.from_dict({}), "/linkage"),
        (lambda: six_bar.dwell(0.7), "/share"),
        (lambda: six_bar.analysis(9), "/linkage"),
        (lambda: six_bar.assembly(drive=six_bar.drive), "/drive"),
        (lambda: six_bar.file("pylinkage"), "/drive"),
        (lambda: six_bar.file("dwg"), "/kind"),
        (lambda: six_bar.file("parts", assembly=True, solids={"fit": "loose"}), "/solids/fit"),
        (lambda: six_bar.file("parts", assembly={"hole": 1e3}), "/assembly/hole"),
        (lambda: six_bar.file("mjcf"), "/drive"),
        (lambda: six_bar.tolerance_study(links=1), "/linkage"),
        (lambda: six_bar.assembly(la.Motion(rotation=[0, 1, 2], crank_span=60)), "/motion"),
    ):
        try:
            call()
        except la.FieldError as refused:
            assert refused.field == field, refused
        else:
            pytest.fail(f"nothing amiss with {field}")
    assert six_bar.file("parts", assembly=True) == six_bar.file("parts")
