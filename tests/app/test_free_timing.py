"""Free crank angles over HTTP and on the command line: the same answers as the front door's."""

from __future__ import annotations

import json

import pytest

import linkage_atlas as la
from app import cli
from tests.oracles.free_classes import free_case, recompute_free


@pytest.fixture(scope="module")
def request_body():
    case = free_case(1, 7)
    position = [[point.real, point.imag] for point in case.position.tolist()]
    return {
        "timing": "free",
        "limits": {"preset": "none"},
        "rotation": case.rotation.tolist(),
        "angle_unit": "rad",
        "position": position,
        "top": 4,
    }


def test_replies_are_the_front_doors(client, request_body) -> None:
    reply = client.post("/v1/synthesize", json=request_body).json()
    own = la.synthesize(
        request_body["rotation"],
        request_body["position"],
        timing="free",
        limits={"preset": "none"},
        degrees=False,
        top=4,
    )
    assert reply["status"] == own.status == "reached"
    assert reply["solutions"] == own.to_dict()["solutions"]
    case = free_case(1, 7)
    degrees = {**request_body, "angle_unit": "deg", "rotation": [57.29577951308232 * r for r in case.rotation]}
    told = client.post("/v1/synthesize", json=degrees).json()["solutions"][0]
    again = recompute_free(case.position, case.rotation, told)
    assert again.objective < 1e-9 and again.one_way


def test_missing_samples_are_null(client, request_body) -> None:
    body = {**request_body, "rotation": [None, *request_body["rotation"][1:]]}
    assert client.post("/v1/synthesize", json=body).json()["status"] == "reached"
    body["rotation"] = [None] * 7
    reply = client.post("/v1/synthesize", json=body)
    assert reply.status_code == 422 and reply.json()["errors"][0]["pointer"] == "#/rotation"


def test_a_solution_is_exported_with_its_crank_angles(client, request_body) -> None:
    found = client.post("/v1/synthesize", json=request_body).json()["solutions"]
    for solution in found[:2]:
        body = {"request": request_body, "solution": solution, "format": "csv"}
        rows = client.post("/v1/export", json=body).text.splitlines()
        assert [float(row.split(",")[0]) for row in rows[1:]] == pytest.approx(solution["crank_angle"], abs=1e-12)
    del solution["crank_angle"]
    reply = client.post("/v1/export", json={"request": request_body, "solution": solution, "format": "svg"})
    assert reply.status_code == 422 and reply.json()["errors"][0]["pointer"] == "#/solution/crank_angle"
    assert client.post("/v1/synthesize.svg", json=request_body).text.startswith("<?xml")


def test_a_csv_file_without_crank_angles_is_a_request(tmp_path, capsys) -> None:
    case = free_case(2, 6)
    rows = [
        f"{p.real!r},{p.imag!r},{float(57.29577951308232 * r)!r}"
        for p, r in zip(case.position.tolist(), case.rotation)
    ]
    path = tmp_path / "motion.csv"
    path.write_text("x,y,rotation\n" + "\n".join(rows) + "\n")
    assert cli.main(["synthesize", str(path), "--json"]) == 0
    reply = json.loads(capsys.readouterr().out)
    assert reply["status"] == "reached" and len(reply["solutions"][0]["crank_angle"]) == 6
    assert cli.main(["synthesize", str(path)]) == 0
    assert "crank angles of rank 1: 0, " in capsys.readouterr().out
