"""The lift answers alike over HTTP and on the command line, and refusals have a name and an amount.

A quantity that was not requested, or a design that violates a constraint, would show here.
"""

import json

import pytest

from app import cli
from tests.conftest import changed

DESIGN = {"l2": 300, "l3": 180, "l4": 240, "l5": 330, "b": 480}
MOTION = {"design": DESIGN, "cylinder": {"length": 220, "speed": 100, "acceleration": 0}, "samples": 11}
OPTIMIZE = {"cylinder": {"length": 220, "speed": 100}, "stroke": [200, 510], "upper_bound": 600}
OPTIMIZE["objective"] = {"kind": "discrete", "n": 31}


def test_motion_replies_what_the_contract_names(client) -> None:
    reply = client.post("/v2/lift/motion", json=MOTION).json()
    assert reply["status"] == "ok" and reply["direction"] == "rising"
    assert reply["rise_time"] == pytest.approx(5.720227, abs=1e-6)
    assert reply["height_start"] == pytest.approx(199.999314, abs=1e-5)
    assert reply["height_top"] == 510.0
    assert reply["dead_point_length"] == pytest.approx(218.42632, abs=1e-5)
    for name in ("time", "height", "velocity", "acceleration", "cylinder_length"):
        assert len(reply[name]) == 11
    assert reply["cylinder_length"][-1] == pytest.approx(792.022727, abs=1e-5)
    for name in ("angles", "points", "angular_velocities", "angular_accelerations"):
        assert reply[name] is None


BUILDABLE = changed(OPTIMIZE, {"-upper_bound": 0, "objective": {"kind": "normalized"}, "constraints": {}})


def test_optimize_replies_what_the_contract_names(client) -> None:
    body = changed(OPTIMIZE, {"objective": {"kind": "discrete", "n": 310}})
    reply = client.post("/v2/lift/optimize", json=body).json()
    assert reply["status"] == "optimal"
    assert reply["objective"] == pytest.approx(334.8844, abs=1e-3)
    assert reply["design"]["l2"] == pytest.approx(378.034, abs=0.1)
    assert reply["active"] == ["l4<=l2"]
    assert reply["motion"]["rise_time"] == pytest.approx(8.068, abs=2e-3)
    assert reply["motion"]["velocity_start"] == pytest.approx(100 * (220 + reply["design"]["l2"]) / 200)
    moved = client.post("/v2/lift/motion", json={"design": reply["design"], "cylinder": body["cylinder"]}).json()
    assert moved["rise_time"] == pytest.approx(reply["motion"]["rise_time"], rel=1e-9)
    assert moved["velocity"][0] == pytest.approx(reply["motion"]["velocity_start"], rel=1e-7)


def test_csv_has_a_line_for_each_time(client, tmp_path) -> None:
    reply = client.post("/v2/lift/motion.csv", json=MOTION)
    assert reply.headers["content-type"].startswith("text/csv")
    lines = reply.text.splitlines()
    assert lines[0].startswith("time,height,velocity") and len(lines) == 12
    target = tmp_path / "motion.csv"
    request = tmp_path / "request.json"
    request.write_text(json.dumps(MOTION))
    assert cli.main(["lift", "motion", str(request), "--export", str(target)]) == 0
    assert target.read_bytes() == reply.content


# -- constraints, pneumatics, files -----------------------------------------------------------------------------


def test_the_default_constraints_give_a_lift_that_can_be_built(client) -> None:
    reply = client.post("/v2/lift/optimize", json=BUILDABLE).json()
    rows = {(row["name"], row["kind"]): row for row in reply["constraints"]}
    for row in rows.values():
        assert row["value"] >= row["limit"] if row["kind"] == "minimum" else row["value"] <= row["limit"]
    largest = {"extension": 1.8, "acceleration": 1000.0, "jerk": 10_000.0}
    smallest = {"dead_point": 0.05, "transmission_angle": 30.0, "y_min": 0.0, "l2": 51.0}
    for kind, limits in (("maximum", largest), ("minimum", smallest)):
        for name, limit in limits.items():
            assert rows[name, kind]["limit"] == pytest.approx(limit)
    # the source's optimum of the same objective, and the constraints that it breaks
    beside = reply["unconstrained"]
    source = client.post("/v2/lift/optimize", json=changed(BUILDABLE, {"-constraints": 0})).json()
    assert beside["objective"] == source["objective"] and beside["design"] == source["design"]
    assert {row["name"] for row in beside["violated"]} >= {"extension", "dead_point", "acceleration", "jerk", "y_min"}
    assert reply["objective_increase"] == pytest.approx(reply["objective"] / source["objective"] - 1)
    cylinder = {"length": reply["closed_length"], "speed": 100}
    body = {"design": reply["design"], "cylinder": cylinder, "samples": 2001}
    moved = client.post("/v2/lift/motion", json=body).json()
    assert [moved["height_start"], moved["height_end"]] == pytest.approx([200, 510], abs=1e-6)
    assert moved["rise_time"] == pytest.approx(reply["motion"]["rise_time"], rel=1e-9)
    assert max(map(abs, moved["acceleration"])) <= 1000
    assert moved["length_top"] / reply["closed_length"] <= 1.8
    assert moved["velocity"][0] == pytest.approx(reply["motion"]["velocity_start"], rel=1e-6)


def test_the_optimum_as_files(client) -> None:
    reply = client.post("/v2/lift/optimize", json=OPTIMIZE).json()
    rows = client.post("/v2/lift/optimize.csv", json=OPTIMIZE).text.splitlines()
    first = dict(zip(rows[0].split(","), map(float, rows[1].split(","))))
    assert len(rows) == 202 and first["closed_length"] == reply["closed_length"] == 220
    assert {name: first[name] for name in DESIGN} == reply["design"]
    assert client.post("/v2/lift/optimize.svg", json=BUILDABLE).text.startswith("<?xml")
    assert "LWPOLYLINE" in client.post("/v2/lift/optimize.dxf", json=OPTIMIZE).text
