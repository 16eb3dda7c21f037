"""Drives over HTTP and on the command line, and in the solutions of a search."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from app.cli import main
from app.fourbar.answers import find_drives
from app.fourbar.models import DrivesRequest
from app.query import bundled_requests
from app.resources import ServiceResources
from app.settings import Settings
from synthesis.drives.links import motions_at
from synthesis.studies.forces import Load
from tests.oracles.largest import TWO_RAILS

EXAMPLES = bundled_requests()["drive"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_answered_alike_by_service_and_command(
    client: TestClient, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    reply = client.post("/v1/drives", json=EXAMPLES[name])
    assert reply.status_code == 200
    body = reply.json()
    assert body["drives"] or body["springs"]
    assert main(["drive", "--example", name, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == body
    assert main(["drive", "--example", name]) == 0
    assert "rocker" in capsys.readouterr().out


def test_the_window_opener_is_the_designs(client: TestClient) -> None:
    body = client.post("/v1/drives", json=EXAMPLES["window_opener"]).json()
    forces = {one["link"]: one["peak_force"] for one in body["drives"] if one["kind"] == "actuator"}
    torques = {one["link"]: one["peak_torque"] for one in body["drives"] if one["kind"] == "rotary"}
    # the design's are the largest of 61 places, the peaks lie between those
    for found, design in (
        (forces, {"coupler": 200.036417, "rocker": 221.025743}),
        (torques, {"crank": 61227.275531, "rocker": 20666.310442}),
    ):
        assert found == pytest.approx(design, rel=2e-5) and all(found[name] >= design[name] - 1e-5 for name in design)
    said = "stroke 150 needs a pin at 258.6 from the pivot; reach_max is 250"
    assert [one["reason"] for one in body["refused"]] == [said]
    coupler = next(one for one in body["drives"] if one["link"] == "coupler")
    curve = coupler["curve"]
    away = np.subtract(curve["pin"], curve["ground"])
    assert np.hypot(*away.T) == pytest.approx(curve["length"], abs=1e-9)
    assert coupler["bound"] == pytest.approx(197.985987, abs=1e-6)
    assert coupler["holding"] == pytest.approx([curve["force"][0], curve["force"][-1]])
    slope = np.gradient(curve["length"], np.deg2rad(curve["crank_angle"]))
    assert slope[2:-2] == pytest.approx(curve["arm"][2:-2], rel=2e-3)


def test_peaks_are_those_of_the_whole_way() -> None:
    """Against 50,001 places: forces, arms and buckling between those of the curve too, of either sign and on moving links."""
    linkage = la.FourBar(240, 101.3, 83.8, 155.1, start_angle=18, coupler_point=(162, 115.7))
    asked = [
        {"kind": "rotary"},
        {"kind": "actuator", "retracted": 255, "stroke": 150, "rod": 12},
        {"kind": "actuator", "links": ["rocker"], "on": "crank", "rod": 12},
    ]
    for load in ({"force": [0, 100]}, {"force": [60, -80], "torque": 3000}):
        found = la.drives(linkage, asked, crank_angle=[0, -33.7], load=load, top=9)
        at = np.deg2rad(np.linspace(0, -33.7, 50_001))
        machine = motions_at(linkage.plain, at)
        torque = machine.torque(Load(complex(*load["force"]), load.get("torque", 0.0)))
        assert {getattr(one, "on", "ground") for one in found.drives} == {"ground", "crank"}
        for one in found.drives:
            link = machine.links[one.link]
            if one.kind == "rotary":
                assert one.peak_torque == pytest.approx(np.abs(torque / link.rate).max(), rel=1e-8)
                continue
            other = complex(*one.ground_point)
            if one.on != "ground":
                other = machine.links[one.on].place(machine.links[one.on].point_at(other))
            length = np.abs(link.place(complex(*one.pin_on_link)) - other)
            arm = np.gradient(length, at, edge_order=2)
            force = torque / arm
            assert one.arm_min == pytest.approx(np.abs(arm).min(), rel=1e-7)
            assert one.peak_force == pytest.approx(np.abs(force).max(), rel=1e-7)
            assert one.over_bound == pytest.approx(one.peak_force / one.bound)
            euler = np.pi**2 * 210_000 * np.pi / 64 * 12**4 / length**2
            if force.max() > 0:
                assert one.buckling.safety == pytest.approx((euler / np.maximum(force, 1e-9)).min(), rel=1e-6)
                assert one.buckling.critical_force == pytest.approx(euler[force > 0].min(), rel=1e-4)
            else:
                assert one.buckling.safety is None
                assert one.buckling.critical_force == pytest.approx(euler.min(), rel=1e-7)


def test_units_change_numbers_and_nothing_else(client: TestClient) -> None:
    """Degrees and radians, millimetres and metres: the same drive of a bundled catalogue."""
    asked = EXAMPLES["cylinder_of_a_catalogue"]
    first = client.post("/v1/drives", json={**asked, "top": 1}).json()["drives"][0]
    metres = {"angle_unit": "rad", "length_unit": "m", "top": 1}
    metres["rocker"] = {"pivot": [0, 0], "start": 0, "swing": np.deg2rad(55), "length": 0.9}
    metres["load"] = {"masses": [{"link": "body", "mass": 8, "at": [-0.4, 0]}]}
    metres["drives"] = [asked["drives"][0] | {"ground_box": [0, -0.5, 0.5, -0.15], "reach_max": 0.4}]
    other = client.post("/v1/drives", json=metres).json()["drives"][0]
    assert other["name"] == first["name"]
    assert other["peak_force"] == pytest.approx(first["peak_force"], rel=1e-6)
    assert other["stroke"] * 1000 == pytest.approx(first["stroke"])
    assert np.deg2rad(first["swing"]) == pytest.approx(other["swing"])
    assert other["buckling"]["critical_force"] == pytest.approx(first["buckling"]["critical_force"], rel=1e-6)


@pytest.mark.parametrize("name", ["window_opener", "bonnet_with_a_gas_spring"])
def test_an_answer_does_not_depend_on_the_threads_of_a_product(name: str) -> None:
    """Descents whose products of matrices two threads shared ended elsewhere by 1e-11, another time again."""
    import scipy.linalg  # noqa: F401 - its BLAS is one of its own

    question, resources = DrivesRequest(**EXAMPLES[name]), ServiceResources(Settings(with_atlas=False))
    replies = []
    for threads in (1, 2, 2):
        with threadpool_limits(threads, "blas"):
            replies.append(find_drives(question, resources).to_dict())
    assert replies[0]["drives"] == replies[1]["drives"] == replies[2]["drives"]
    assert replies[0]["springs"] == replies[1]["springs"] == replies[2]["springs"]


def test_options_of_the_command_hold_for_its_question(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The unit was that of the heads alone, and a catalogue was passed over where nothing is of it."""
    replies, file = [], tmp_path / "asked.json"
    asked = EXAMPLES["cylinder_of_a_catalogue"]
    for unit, option in ((None, ()), ("cm", ()), (None, ("--length-unit", "cm"))):
        file.write_text(json.dumps(asked | ({"length_unit": unit} if unit else {})))
        assert main(["drive", str(file), *option, "--json"]) == 0
        replies.append(json.loads(capsys.readouterr().out))
    assert replies[0] != replies[1] == replies[2]
    file.write_text(json.dumps(asked | {"drives": [{"kind": "rotary"}]}))
    assert main(["drive", str(file), "--catalogue", str(file)]) == 2
    assert "catalogue: " in capsys.readouterr().err


def test_a_catalogue_of_ones_own(client: TestClient, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = "name,retracted,stroke,force,price\nsmall,255,150,60,10\ngood,255,150,900,30\ndear,255,150,9000,80\n"
    asked = EXAMPLES["window_opener"]
    wish = {name: value for name, value in asked["drives"][1].items() if name not in ("retracted", "stroke")}
    body = client.post("/v1/drives", json={**asked, "drives": [{**wish, "catalogue": table}], "top": 1}).json()
    assert [one["name"] for one in body["drives"]] == ["good"]
    (tmp_path / "own.csv").write_text(table)
    (tmp_path / "asked.json").write_text(json.dumps({**asked, "drives": [wish], "top": 1}))
    assert main(["drive", str(tmp_path / "asked.json"), "--catalogue", str(tmp_path / "own.csv"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == body
    small = {**wish, "catalogue": table.split("good")[0], "links": ["coupler"]}
    weak = client.post("/v1/drives", json={**asked, "drives": [small]}).json()
    assert weak["refused"][0]["name"] == "small"
    assert "needs a force of 198, and it gives 60" in weak["refused"][0]["reason"]


@pytest.mark.parametrize(
    ("part", "model", "row"),
    [
        ("drives", "DriveRequest", {"retracted": 255, "stroke": 150}),
        ("springs", "SpringRequest", {"stiffness": 1, "free_length": 50, "longest": 900}),
    ],
)
def test_a_catalogue_has_as_many_rows_as_are_described(client: TestClient, part: str, model: str, row: dict) -> None:
    """Of springs 400 were described and 200 taken."""
    described = client.get("/openapi.json").json()["components"]["schemas"][model]["properties"]["catalogue"]["anyOf"]
    (most,) = (one["maxItems"] for one in described if one.get("type") == "array")
    kind = "actuator" if part == "drives" else "tension"
    for count, status in ((most, 200), (most + 1, 422)):
        asked = {"rocker": FLAP, "load": {"force": [0, -10]}, "drives": []}
        found = client.post("/v1/drives", json={**asked, part: [{"kind": kind, "catalogue": [row] * count}]})
        assert found.status_code == status, found.text


PLACES = [[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]]
POSES = {"timing": "free", "position": PLACES, "rotation": [0, 12, 27, 45, 66], "top": 2, "tolerance": 0.02}
"""A search that soon ends."""
FLAP = {"pivot": [0, 0], "start": 0, "swing": 60, "length": 400}


def test_each_solution_of_a_search_gets_its_drives(client: TestClient) -> None:
    asked = {**POSES, "load": {"force": [0, -10]}, "drives": [{"kind": "rotary"}, {"kind": "actuator"}]}
    body = client.post("/v1/synthesize", json={**asked, "springs": [{"kind": "tension"}]}).json()
    for one in body["solutions"]:
        kinds = [drive["kind"] for drive in one["drives"]]
        assert len(kinds) == len(set(kinds))
        assert "actuator" in kinds
        assert one["drivable"] is None
        for spring in one["springs"]:
            assert spring["exact"]
            assert spring["torque"]["after"]["rms"] < 1e-9 * spring["torque"]["before"]["rms"]
        # the same of the solution that was sent back
        again = {"linkage": one, "request": POSES, "load": asked["load"], "drives": asked["drives"], "top": 1}
        found = client.post("/v1/drives", json=again).json()
        for mine, other in zip(found["drives"], one["drives"], strict=True):
            assert (mine["kind"], mine["link"]) == (other["kind"], other["link"])
            for name in ("peak_force", "peak_torque", "arm_min", "swing"):
                assert mine.get(name, 0) == pytest.approx(other.get(name, 0), rel=1e-6)


def test_solutions_without_a_drive_come_last(client: TestClient) -> None:
    poses = {**POSES, "top": 6, "tolerance": 0}
    plain = client.post("/v1/synthesize", json=poses).json()["solutions"]
    box = [plain[-1]["mount"]["pivot_a"][0] - 60, plain[-1]["mount"]["pivot_a"][1] - 60]
    box = [*box, box[0] + 60, box[1] + 60]
    wish = {"kind": "cylinder", "stroke": 30, "retracted": 45, "ground_box": box, "reach_max": 30}
    found = client.post("/v1/synthesize", json={**poses, "drive": wish}).json()["solutions"]
    able = [one["drivable"] for one in found]
    assert able == sorted(able, reverse=True) and set(able) == {True, False}
    assert len(found) == len(plain)
    for one in found:
        assert bool(one["drives"]) is one["drivable"]
        assert one["drives"] or one["refused"][0]["reason"]


def test_the_drive_that_decides_stands_before_the_best_of_each_kind(client: TestClient) -> None:
    wish = {"kind": "cylinder", "catalogue": "iso_6432"}
    asked = {**POSES, "top": 1, "drive": wish, "load": {"force": [0, -10]}}
    asked["drives"] = [{"kind": "rotary"}, {"kind": "actuator"}]
    for more, kind in (({}, None), ({"mechanisms": ["slider_crank"]}, "slider_crank")):
        (one,) = client.post("/v1/synthesize", json={**asked, **more}).json()["solutions"]
        assert kind is None or one["kind"] == kind
        assert one["drivable"]
        assert "ISO 6432" in one["drives"][0]["name"]
        assert [drive["kind"] for drive in one["drives"]] == ["actuator", "rotary", "actuator"]


@cache
def the_best() -> la.Solution:
    return la.synthesize(**POSES | {"top": 1}).best


def test_a_solution_in_python() -> None:
    solution = the_best()
    found = la.drives(solution, [{"kind": "dyad"}, {"kind": "toggle"}], load={"force": [0, -10]})
    motor = found.best("dyad")
    assert motor is not None
    assert motor.six_bar is not None
    assert motor.six_bar.motor_torque[[0, -1]] == pytest.approx(0, abs=1e-6)
    knee = found.best("toggle")
    assert knee is not None
    assert knee.lock is not None
    assert knee.lock.over_centre == pytest.approx(5)
    assert solution.studied(drives=[{"kind": "rotary"}]).drives


def test_a_body_on_guides_goes_along_the_travel_of_its_request(client: TestClient) -> None:
    request = {"rotation": [0, 5, 11, 20, 30], "position": [[0, 0], [20, 5], [45, 8], [70, 20], [100, 25]], "top": 1}
    travelling = request | {"travel_span": 100, "mechanisms": ["slider_crank"]}
    solution = client.post("/v1/synthesize", json=travelling).json()["solutions"][0]
    bare = {name: value for name, value in solution.items() if name != "travel"}
    wanted = client.post("/v1/drives", json={"linkage": solution, "request": travelling}).json()
    found = client.post("/v1/drives", json={"linkage": bare, "request": travelling}).json()
    assert len(found["drives"]) == len(wanted["drives"]) > 0
    assert found["torque"]["crank_angle"] == pytest.approx(wanted["torque"]["crank_angle"])
    free = request | {"timing": "free"}
    refused = client.post("/v1/drives", json={"linkage": bare, "request": free}).json()["errors"][0]
    assert refused == {"pointer": "#/linkage/travel", "detail": "needed: the motion's timing is free"}


def test_a_body_on_guides_is_driven_too() -> None:
    crank = {"guide": "circle", "pivot": [0, 0], "radius": 10, "body_point": [0, 0]}
    rail = {"guide": "rail", "point": [0, 3], "direction": 0, "body_point": [20, 0]}
    pump = la.Linkage([crank, rail], "crank", start=30)
    found = la.drives(pump, crank_angle=[0, 60], load={"force": [0, -10]})
    assert {one.kind for one in found.drives} == {"rotary", "actuator", "dyad"}
    slider = la.Linkage([rail, crank], "slider", start=24)
    slid = la.drives(slider, crank_angle=[0, -4], load={"force": [0, -10]})
    assert any(one.kind == "actuator" and one.link == "coupler" for one in slid.drives)


def test_a_spring_of_a_catalogue_finds_its_own_links(client: TestClient) -> None:
    """On two rails no link turns about a fixed pivot: all the same, no pair of links has to be named."""
    spring = {"kind": "tension", "catalogue": [{"stiffness": 1, "free_length": 20, "longest": 500}]}
    body = {"linkage": TWO_RAILS, "load": {"force": [-10, 0]}, "drives": [], "springs": [spring]}
    free = client.post("/v1/drives", json=body).json()["springs"][0]
    body["springs"][0]["between"] = ["ground", "coupler"]
    given = client.post("/v1/drives", json=body).json()["springs"][0]
    assert free["torque"]["after"]["rms"] <= given["torque"]["after"]["rms"] * (1 + 1e-6)


@pytest.mark.parametrize(("kind", "count"), [("slider_crank", 2), ("swinging_block", 2), ("two_rails", 1)])
def test_ideal_springs_carry_a_body_on_guides(client: TestClient, kind: str, count: int) -> None:
    asked = {**POSES, "mechanisms": [kind], "top": 1, "load": {"force": [0, -10]}}
    (one,) = client.post("/v1/synthesize", json={**asked, "springs": [{"kind": "tension"}]}).json()["solutions"]
    assert len(one["springs"]) == count
    for spring in one["springs"]:
        assert spring["exact"] and spring["free_length"] == 0
        assert spring["torque"]["after"]["peak"] < 1e-8 * spring["torque"]["before"]["peak"]


def test_springs_that_cannot_carry_a_body_on_a_rail_and_a_slot_are_refused(client: TestClient) -> None:
    asked = {**POSES, "mechanisms": ["rail_slot"], "top": 1}
    request = {"linkage": client.post("/v1/synthesize", json=asked).json()["solutions"][0], "request": asked}
    more = {"load": {"force": [0, -10]}, "drives": [], "springs": [{"kind": "tension"}]}
    found = client.post("/v1/drives", json={**request, **more}).json()
    assert not found["springs"]
    assert any("rail_slot" in row["reason"] and "catalogue" in row["reason"] for row in found["refused"])


def test_drives_in_python_are_told_in_a_line_each() -> None:
    told = repr(la.drives(the_best(), load={"force": [0, -10]}, springs=[{"kind": "tension"}]))
    lines = told.splitlines()
    assert lines[0].endswith("2 springs") and max(map(len, lines)) < 200
    assert any("actuator on the coupler" in line and "force at most" in line for line in lines)
    assert any("tension spring ground-crank" in line for line in lines)


@pytest.mark.parametrize(("wish", "usual"), [({}, 1.4), ({"dead_length": 60}, None), ({"stroke": 100}, 1.4)])
def test_an_actuator_of_free_length_is_no_longer_than_it_must_be(wish: dict, usual: float | None) -> None:
    found = la.drives(rocker=FLAP, drives=[{"kind": "actuator", **wish}], load={"force": [0, -100]}).drives[0]
    assert found.stroke and found.retracted and found.over_bound
    assert found.retracted == pytest.approx(found.stroke * usual if usual else found.stroke + 60, rel=1e-6)
    assert found.over_bound < 1.16


def test_no_actuator_of_free_sizes_is_shorter_than_can_be_had() -> None:
    mount = {"ground_angle": -25, "pivot_a": (-100, 22), "coupler_point": (160, 116)}
    linkage = la.FourBar(240, 100, 84, 155, start_angle=18, **mount)
    for wish in ({}, {"stroke": 100}):
        asked = [{"kind": "actuator", **wish}]
        found = la.drives(linkage, asked, load={"force": [0, -100]}, crank_angle=[0, -34]).drives
        assert len(found) == 3
        assert all(one.retracted and one.stroke and one.retracted >= 1.399 * one.stroke for one in found)


def test_a_refused_row_is_named_in_words() -> None:
    asked = [{"kind": "cylinder", "catalogue": "iso_6432"}]
    assert "no actuator on the rocker (ISO 6432" in repr(
        la.drives(rocker=FLAP, drives=asked, load={"force": [0, -1e6]})
    )


TOLD = [(True, 270, "32.3438 degrees"), (False, 4.7, "0.567917 radians")]


@pytest.mark.parametrize(("degrees", "way", "words"), TOLD)
def test_a_dead_point_is_told_with_the_unit_of_its_angle(degrees: bool, way: float, words: str) -> None:
    linkage = la.FourBar(crank=40, coupler=100, rocker=80, ground=90, degrees=degrees)
    motor = [{"kind": "rotary", "links": ["rocker"]}]
    (one,) = la.drives(linkage, motor, crank_angle=np.linspace(0, way, 4), degrees=degrees).refused
    assert f"at {words}: the rocker turns back there" in one.reason


def test_inertia_without_a_speed_is_told() -> None:
    for more, told in (({}, True), ({"speed": 10}, False)):
        load = {"masses": [{"link": "body", "mass": 1, "inertia": 5}], **more}
        notes = la.drives(rocker=FLAP, drives=[{"kind": "rotary"}], load=load).notes
        assert any("load.speed" in note for note in notes) is told


def test_a_knee_whose_handle_turns_back_on_both_sides_is_refused() -> None:
    links = dict(crank=23.09, coupler=76.16, rocker=56.51, ground=91.82)
    place = {"ground_angle": 10, "pivot_a": (5, 8), "coupler_point": (40, 30)}
    linkage = la.FourBar(**links, branch=-1, start_angle=-41.366, **place)
    asked = [{"kind": "toggle", "links": ["coupler"]}]
    found = la.drives(linkage, asked, crank_angle=[0, 195.26], load={"force": [3, -20], "torque": 30})
    assert not found.drives
    assert "turns back at 78.1" in found.refused[0].reason


def test_of_knees_the_next_best_is_taken_where_the_best_ones_handle_turns_back() -> None:
    crank = {"guide": "circle", "pivot": [40, -292], "radius": 844, "body_point": [-257, 8]}
    rail = {"guide": "rail", "point": [-2388, -2366], "direction": 337.15, "body_point": [-2711, -1889]}
    linkage = la.Linkage([crank, rail], "crank", -1, start=147.7)
    asked = [{"kind": "toggle", "links": ["crank"], "over_centre": 12.7, "knee": 0.8}]
    masses = [{"link": name, "mass": 1} for name in ("slider", "body")]
    found = la.drives(linkage, asked, crank_angle=[0, 40.8], load={"masses": masses})
    assert [one.link for one in found.drives] == ["crank"]
