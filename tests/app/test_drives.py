"""Drives are the same over HTTP, on the command line and in the solutions of a search.

A peak that is missed between two samples, or a drive in the wrong unit, would show here.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

import linkage_atlas as la
from app.cli import main
from app.query import bundled_requests
from synthesis.drives.links import motions_at
from synthesis.studies.forces import Load

EXAMPLES = bundled_requests()["drive"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_answered_alike_by_service_and_command(
    client: TestClient, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    reply = client.post("/v2/drives", json=EXAMPLES[name])
    assert reply.status_code == 200
    body = reply.json()
    assert body["drives"] or body["springs"]
    assert main(["drive", "--example", name, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == body
    assert main(["drive", "--example", name]) == 0
    assert "rocker" in capsys.readouterr().out


def test_the_window_opener_is_the_designs(client: TestClient) -> None:
    body = client.post("/v2/drives", json=EXAMPLES["window_opener"]).json()
    forces = {drive["link"]: drive["peak_force"] for drive in body["drives"] if drive["kind"] == "actuator"}
    torques = {drive["link"]: drive["peak_torque"] for drive in body["drives"] if drive["kind"] == "rotary"}
    # the design's are the largest of 61 places, the peaks lie between those
    for found, design in (
        (forces, {"coupler": 200.036417, "rocker": 221.025743}),
        (torques, {"crank": 61227.275531, "rocker": 20666.310442}),
    ):
        assert found == pytest.approx(design, rel=2e-5) and all(found[name] >= design[name] - 1e-5 for name in design)
    said = "stroke 150 needs a pin at 258.6 from the pivot; reach_max is 250"
    assert [refusal["reason"] for refusal in body["refused"]] == [said]
    coupler = next(drive for drive in body["drives"] if drive["link"] == "coupler")
    curve = coupler["curve"]
    away = np.subtract(curve["pin"], curve["ground"])
    assert np.hypot(*away.T) == pytest.approx(curve["length"], abs=1e-9)
    assert coupler["peak_force_bound"] == pytest.approx(197.985987, abs=1e-6)
    assert coupler["holding"] == pytest.approx([curve["force"][0], curve["force"][-1]])
    slope = np.gradient(curve["length"], np.deg2rad(curve["crank_angle"]))
    assert slope[2:-2] == pytest.approx(curve["arm"][2:-2], rel=2e-3)


def test_peaks_are_those_of_the_whole_way() -> None:
    """Compare with 50,001 positions: extremes between the samples of the curve, of either sign and on moving links."""
    linkage = la.FourBar(240, 101.3, 83.8, 155.1, start_angle=18, coupler_point_polar=(162, 115.7))
    request = [
        {"kind": "rotary"},
        {"kind": "actuator", "retracted": 255, "stroke": 150, "rod": 12},
        {"kind": "actuator", "links": ["rocker"], "base_link": "crank", "rod": 12},
    ]
    for load in ({"force": [0, 100]}, {"force": [60, -80], "torque": 3000}):
        found = la.drives(linkage, request, crank_angle=[0, -33.7], load=load, top=9)
        at = np.deg2rad(np.linspace(0, -33.7, 50_001))
        machine = motions_at(linkage.plain, at)
        torque = machine.torque(Load(complex(*load["force"]), load.get("torque", 0.0)))
        assert {getattr(drive, "base_link", "ground") for drive in found.drives} == {"ground", "crank"}
        for drive in found.drives:
            link = machine.links[drive.link]
            if drive.kind == "rotary":
                assert drive.peak_torque == pytest.approx(np.abs(torque / link.rate).max(), rel=1e-8)
                continue
            second = complex(*drive.ground_point)
            if drive.base_link != "ground":
                second = machine.links[drive.base_link].position(machine.links[drive.base_link].point_at(second))
            length = np.abs(link.position(complex(*drive.pin_on_link)) - second)
            arm = np.gradient(length, at, edge_order=2)
            force = torque / arm
            assert drive.arm_min == pytest.approx(np.abs(arm).min(), rel=1e-7)
            assert drive.peak_force == pytest.approx(np.abs(force).max(), rel=1e-7)
            assert drive.peak_force_ratio == pytest.approx(drive.peak_force / drive.peak_force_bound)
            euler = np.pi**2 * 210_000 * np.pi / 64 * 12**4 / length**2
            if force.max() > 0:
                assert drive.buckling.safety == pytest.approx((euler / np.maximum(force, 1e-9)).min(), rel=1e-6)
                assert drive.buckling.critical_force == pytest.approx(euler[force > 0].min(), rel=1e-4)
            else:
                assert drive.buckling.safety is None
                assert drive.buckling.critical_force == pytest.approx(euler.min(), rel=1e-7)


def test_units_change_numbers_and_nothing_else(client: TestClient) -> None:
    """Degrees and radians, millimetres and metres: the same drive of a bundled catalogue."""
    request = EXAMPLES["cylinder_of_a_catalogue"]
    first = client.post("/v2/drives", json={**request, "top": 1}).json()["drives"][0]
    metres = {"angle_unit": "rad", "length_unit": "m", "top": 1}
    metres["rocker"] = {"pivot": [0, 0], "start": 0, "swing": np.deg2rad(55), "length": 0.9}
    metres["load"] = {"masses": [{"link": "body", "mass": 8, "centre": [-0.4, 0]}]}
    metres["drives"] = [request["drives"][0] | {"ground_box": [0, -0.5, 0.5, -0.15], "reach_max": 0.4}]
    second = client.post("/v2/drives", json=metres).json()["drives"][0]
    assert second["name"] == first["name"]
    assert second["peak_force"] == pytest.approx(first["peak_force"], rel=1e-6)
    assert second["stroke"] * 1000 == pytest.approx(first["stroke"])
    assert np.deg2rad(first["swing"]) == pytest.approx(second["swing"])
    assert second["buckling"]["critical_force"] == pytest.approx(first["buckling"]["critical_force"], rel=1e-6)


def test_a_catalogue_of_ones_own(client: TestClient, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = "name,retracted,stroke,force,price\nsmall,255,150,60,10\ngood,255,150,900,30\ndear,255,150,9000,80\n"
    request = EXAMPLES["window_opener"]
    wish = {name: value for name, value in request["drives"][1].items() if name not in ("retracted", "stroke")}
    body = client.post("/v2/drives", json={**request, "drives": [{**wish, "catalogue": table}], "top": 1}).json()
    assert [drive["name"] for drive in body["drives"]] == ["good"]
    (tmp_path / "own.csv").write_text(table)
    (tmp_path / "asked.json").write_text(json.dumps({**request, "drives": [wish], "top": 1}))
    assert (
        main(["drive", str(tmp_path / "asked.json"), "--set", f"drives.1.catalogue=@{tmp_path}/own.csv", "--json"])
        == 0
    )
    assert json.loads(capsys.readouterr().out) == body
    small = {**wish, "catalogue": table.split("good")[0], "links": ["coupler"]}
    weak = client.post("/v2/drives", json={**request, "drives": [small]}).json()
    assert weak["refused"][0]["name"] == "small"
    assert "needs a force of 198, but this actuator gives only 60" in weak["refused"][0]["reason"]


POSITIONS = [[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]]
POSES = {"timing": "free", "position": POSITIONS, "rotation": [0, 12, 27, 45, 66], "top": 2, "tolerance": 0.02}
"""A search that soon ends."""


def test_each_solution_of_a_search_gets_its_drives(client: TestClient) -> None:
    request = {**POSES, "load": {"force": [0, -10]}, "drives": [{"kind": "rotary"}, {"kind": "actuator"}]}
    body = client.post("/v2/synthesize", json={**request, "springs": [{"kind": "tension"}]}).json()
    for solution in body["solutions"]:
        kinds = [drive["kind"] for drive in solution["drives"]]
        assert len(kinds) == len(set(kinds))
        assert "actuator" in kinds
        assert solution["has_drive"] is None
        for spring in solution["springs"]:
            assert spring["exact"]
            assert spring["torque"]["after"]["rms"] < 1e-9 * spring["torque"]["before"]["rms"]
        # the same of the solution that was sent back
        repeated = {
            "linkage": solution,
            "request": POSES,
            "load": request["load"],
            "drives": request["drives"],
            "top": 1,
        }
        found = client.post("/v2/drives", json=repeated).json()
        for mine, second in zip(found["drives"], solution["drives"], strict=True):
            assert (mine["kind"], mine["link"]) == (second["kind"], second["link"])
            for name in ("peak_force", "peak_torque", "arm_min", "swing"):
                assert mine.get(name, 0) == pytest.approx(second.get(name, 0), rel=1e-6)


def test_a_linkage_with_the_requested_drive_comes_first() -> None:
    drive = {"kind": "actuator", "links": ["rocker"], "retracted": 50, "stroke": 25, "reach_max": 50}
    found = la.synthesize(**POSES, drive=drive, load={"force": [0, -10]}, limits={"preset": "none"})
    assert [solution.has_drive for solution in found] == [True, False]


def test_a_body_on_guides_goes_along_the_travel_of_its_request(client: TestClient) -> None:
    request = {"rotation": [0, 5, 11, 20, 30], "position": [[0, 0], [20, 5], [45, 8], [70, 20], [100, 25]], "top": 1}
    travelling = request | {"travel_span": 100, "mechanisms": ["slider_crank"]}
    solution = client.post("/v2/synthesize", json=travelling).json()["solutions"][0]
    bare = {name: value for name, value in solution.items() if name != "travel"}
    expected = client.post("/v2/drives", json={"linkage": solution, "request": travelling}).json()
    found = client.post("/v2/drives", json={"linkage": bare, "request": travelling}).json()
    assert len(found["drives"]) == len(expected["drives"]) > 0
    assert found["torque"]["crank_angle"] == pytest.approx(expected["torque"]["crank_angle"])
    free = request | {"timing": "free"}
    refused = client.post("/v2/drives", json={"linkage": bare, "request": free}).json()["errors"][0]
    assert refused["pointer"] == "#/linkage/travel"
    assert refused["detail"].startswith("is required, because the timing of the motion is free")


@pytest.mark.parametrize("order", ["given", "any"])
def test_the_crank_angles_of_a_request_of_free_timing_are_found_again(client: TestClient, order: str) -> None:
    request = {"rotation": [0, 15, 40], "position": [[0, 0], [40, 8], [75, 30]], "timing": "free", "order": order}
    solution = client.post("/v2/synthesize", json=request | {"top": 1}).json()["solutions"][0]
    bare = {name: solution[name] for name in ("links", "branch", "start_angle", "mount", "body_offset")}
    drives = [{"kind": "rotary"}]
    expected, found = (
        client.post("/v2/drives", json={"linkage": linkage, "request": request, "drives": drives}).json()["drives"]
        for linkage in (solution, bare)
    )
    assert [drive["swing"] for drive in found] == pytest.approx([drive["swing"] for drive in expected], rel=1e-6)


@pytest.mark.parametrize(("kind", "count"), [("slider_crank", 2), ("swinging_block", 2), ("two_rails", 1)])
def test_ideal_springs_carry_a_body_on_guides(client: TestClient, kind: str, count: int) -> None:
    request = {**POSES, "mechanisms": [kind], "top": 1, "load": {"force": [0, -10]}}
    (solution,) = client.post("/v2/synthesize", json={**request, "springs": [{"kind": "tension"}]}).json()[
        "solutions"
    ]
    assert len(solution["springs"]) == count
    for spring in solution["springs"]:
        assert spring["exact"] and spring["free_length"] == 0
        assert spring["torque"]["after"]["peak"] < 1e-8 * spring["torque"]["before"]["peak"]
