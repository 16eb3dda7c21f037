"""Tables, drawings, pictures and models hold the drive of the reply.

A column, a layer or an actuator that belongs to another drive would show here.
"""

import csv
import io

import numpy as np
import pytest

from tests.app.test_drives import POSES

KINDS = ["rotary", "actuator", "dyad"]


@pytest.fixture(scope="module")
def found(client):
    request = {**POSES, "top": 1}
    solution = client.post("/v2/synthesize", json=request).json()["solutions"][0]
    body = {"linkage": solution, "request": request, "load": {"force": [0, -10]}}
    body["drives"] = [{"kind": kind} for kind in KINDS]
    return request, solution, client.post("/v2/drives", json=body).json()["drives"]


def export(client, found, kind, drive):
    request, solution, _ = found
    body = {"request": request, "linkage": solution, "format": kind, "drive": drive}
    reply = client.post("/v2/export", json=body)
    assert reply.status_code == 200, reply.text
    return reply.text


def one_of(found, kind):
    return next(solution for solution in found[2] if solution["kind"] == kind)


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_has_the_drive_at_each_sample(client, found, kind) -> None:
    drive = one_of(found, kind)
    rows = list(csv.DictReader(io.StringIO(export(client, found, "csv", drive))))
    at = [float(row["crank_angle"]) for row in rows]
    curve = drive["curve"]
    if kind == "rotary":
        assert [float(rows[0][f"drive_ground_{axis}"]) for axis in "xy"] == pytest.approx(drive["motor"])
        return
    order = np.argsort(curve["crank_angle"])
    length = np.interp(at, np.array(curve["crank_angle"])[order], np.array(curve["length"])[order])
    assert [float(row["drive_length"]) for row in rows] == pytest.approx(length, rel=2e-3)
    if kind == "dyad":
        sizes = (drive["six_bar"]["crank"], drive["six_bar"]["coupler"])

        def position(row, part: str) -> complex:
            return complex(*(float(row[f"drive_{part}_{axis}"]) for axis in "xy"))

        for row in rows:
            ground, pin, knee = (position(row, part) for part in ("ground", "pin", "knee"))
            assert (abs(knee - ground), abs(pin - knee)) == pytest.approx(sizes, rel=1e-6)
        knees = np.array([[float(row[f"drive_knee_{axis}"]) for axis in "xy"] for row in rows])
        expected = np.array(curve["knee"])[order]
        between = np.transpose([np.interp(at, np.array(curve["crank_angle"])[order], axis) for axis in expected.T])
        # bent the same way: at the samples between up to the curve's steps, at both ends to rounding
        assert np.abs(knees - between).max() < 0.01 * max(sizes)
        assert knees[[0, -1]] == pytest.approx(np.array(curve["knee"])[[0, -1]], abs=1e-6 * max(sizes))


def test_a_drive_that_is_none_or_in_a_file_that_has_none_is_refused(client, found) -> None:
    request, solution, drives = found
    body = {"request": request, "linkage": solution, "drive": drives[0]}
    for kind in ("mjcf", "json"):
        refused = client.post("/v2/export", json={**body, "format": kind})
        assert refused.json()["errors"][0]["pointer"].endswith("/drive")
    bad = {**one_of(found, "actuator"), "link": "wing"}
    assert client.post("/v2/export", json={**body, "drive": bad, "format": "csv"}).status_code == 422
    short = {"kind": "actuator", "link": "crank"}
    assert client.post("/v2/export", json={**body, "drive": short, "format": "csv"}).status_code == 422
