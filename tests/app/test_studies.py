"""Analyses, tolerance studies and further files are the same over HTTP, on the command line and in Python.

A study without bounds, or a file that ignores the settings of the request, would show here.
"""

import json

import numpy as np
import pytest

import linkage_atlas as la
from app.registry import worked_example

EXAMPLE = {**worked_example(), "top": 2}
ANALYSIS = {"crank_speed": 90, "load": {"force": [1.5, -20], "torque": 30}}
STUDY = {"links": 0.05, "pivots": 0.05, "clearance": 0.02, "samples": 500, "seed": 3}
POSES = {"position": [[0, 0], [40, 8], [75, 30]], "rotation": [0, 15, 40], "timing": "free"}
FREE = {**POSES, "top": 2, "limits": {"family": "any"}}


def ask(client, **more):
    reply = client.post("/v2/synthesize", json={**EXAMPLE, **more})
    assert reply.status_code == 200, reply.text
    return reply.json()


@pytest.mark.parametrize(
    "request_body", [EXAMPLE, FREE, {**FREE, "order": "any"}], ids=["timed", "free", "any order"]
)
def test_an_analysis_is_the_derivative_of_the_motion(client, request_body) -> None:
    reply = client.post("/v2/synthesize", json={**request_body, "analysis": ANALYSIS}).json()
    assert reply["solutions"]
    for solution in reply["solutions"]:
        linkage, analysis = la.Linkage.from_dict(solution), solution["analysis"]
        crank = solution["crank_angle"] or np.linspace(0, EXAMPLE["crank_span"], 16)
        assert np.mod(analysis["crank_angle"], 360) == pytest.approx(np.mod(crank, 360))
        curve = np.array(analysis["curve"]["crank_angle"])
        assert np.abs(np.diff(curve)).max() <= 1 + 1e-9
        assert min(analysis["crank_angle"]) == pytest.approx(curve.min())
        assert max(analysis["crank_angle"]) == pytest.approx(curve.max())
        step = 1e-3  # degrees, at 90 degrees a second
        for part in (analysis, analysis["curve"]):
            at = np.array(part["crank_angle"])
            moved = [linkage.joints(at + sign * step).body_point for sign in (1, -1)]
            steep = np.array(part["transmission_angle"]) > 10
            velocity = (moved[0] - moved[1]) / (2 * step / 90)
            np.testing.assert_allclose(np.array(part["velocity"])[steep], velocity[steep], rtol=1e-3, atol=1e-4)
            power = np.array(part["velocity"]) @ [1.5, -20] + 30 * np.deg2rad(part["angular_velocity"]["coupler"])
            np.testing.assert_allclose(np.array(part["drive_load"]) * np.deg2rad(90), -power, rtol=1e-9, atol=1e-9)
            assert len(part["pin_forces"]["coupler_pin"]) == len(at)


def test_python_and_http_say_the_same(client) -> None:
    wishes = {"analysis": ANALYSIS, "tolerance_study": STUDY, "lengths_from": [20, 70, 145, 165]}
    over_http = ask(client, **wishes)["solutions"]
    mine = la.synthesize(**EXAMPLE, **wishes)
    assert json.loads(json.dumps([solution.to_dict() for solution in mine.solutions])) == over_http
    repeated = mine.linkage.analysis(90, ANALYSIS["load"])
    assert repeated.to_dict() == mine.best.analysis.to_dict()
    study = mine.linkage.tolerance_study(**STUDY)
    assert study.to_dict() == mine.best.tolerance_study.to_dict()
    assert mine.best.tolerance_study.position.simulated.p95.shape == (16,)


def test_a_study_has_its_bounds_and_says_so(client, monkeypatch) -> None:
    monkeypatch.setattr("linkage_atlas.tolerance_study.MOST_POSITIONS", 130_000)
    study = {"links": 0.1, "samples": 100_000}
    reply = la.synthesize(**EXAMPLE, tolerance_study=study).to_dict()  # here, where the bound is set
    study = reply["solutions"][0]["tolerance_study"]
    assert study["samples"] == 1000, "for 2 linkages at 16 samples and 49 places of the band"
    assert any("1,000 linkages instead of 100,000" in note for note in reply["report"]["notes"])
    assert study["largest"]["position"] == "body point" or study["largest"]["position"].endswith("length")
    assert sum(row["position"] for row in study["contributions"]) == pytest.approx(1)
    assert len(study["band"]["crank_angle"]) == len(study["band"]["position"]["p95"])
    quiet = ask(client, tolerance_study={})["solutions"][0]["tolerance_study"]
    assert quiet["largest"] == {"position": None, "rotation": None} and max(quiet["position"]["p95"]) < 1e-9


@pytest.mark.parametrize(
    ("kind", "names"),
    [("json", "assembly solids drive"), *((kind, "assembly solids") for kind in ("csv", "svg", "dxf"))],
)
def test_what_a_file_does_not_hold_is_refused(kind, names, client) -> None:
    """Fields without effect used to be ignored."""
    motor = {"kind": "rotary", "link": "crank", "motor": [0, 0]}
    values = {"assembly": {"pin_heads": True}, "solids": {"fit": "print"}, "drive": motor}
    for name in names.split():
        wrong = client.post("/v2/export", json={"request": EXAMPLE, "format": kind, name: values[name]})
        assert wrong.status_code == 422 and wrong.json()["errors"][0]["pointer"] == f"#/{name}", name
    if kind != "step":  # what the request asks for is of its reply
        body = {"request": {**EXAMPLE, "assembly": True}, "format": kind}
        assert client.post("/v2/export", json=body).status_code == 200


def test_a_linkage_of_joint_coordinates_is_analysed_driven_and_exported(client) -> None:
    joints = {"A": [0, 0], "D": [0, 3], "C": [4, 6], "B": [6, 0], "P": [2, 7]}
    own = la.Linkage.from_points(**joints)
    request = {
        "linkage": {"joints": joints},
        "crank_angle": [0, 60],
        "drives": [{"kind": "rotary", "links": ["crank"]}],
    }
    driven = client.post("/v2/drives", json=request)
    assert driven.status_code == 200, driven.text
    plain = {"linkage": own.to_dict(), **{name: request[name] for name in ("crank_angle", "drives")}}
    same = client.post("/v2/drives", json=plain).json()
    assert driven.json()["drives"] == same["drives"] and same["drives"]
    wrong = client.post("/v2/drives", json=request | {"linkage": {"joints": joints | {"D": [0, 0]}}})
    assert wrong.status_code == 422 and wrong.json()["errors"][0]["pointer"] == "#/linkage/joints/D"
