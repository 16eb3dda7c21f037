"""Function generation over HTTP and on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.cli import main

PAIRS = {"input": [0, 15, 35, 60, 80], "output": [0, 12, 31, 62, 90], "top": 2}


def test_five_pairs_are_met(client: TestClient) -> None:
    reply = client.post("/v1/function", json=PAIRS)
    assert reply.status_code == 200
    body = reply.json()
    assert body["status"] == "reached" and body["input"] == pytest.approx(PAIRS["input"]) and body["x"] is None
    assert body["solutions"][0]["errors"]["max"] < 1e-7


@pytest.mark.parametrize("kind", ["json", "csv", "svg", "dxf", "mjcf"])
def test_any_solution_is_exported(client: TestClient, kind: str) -> None:
    solution = client.post("/v1/function", json=PAIRS).json()["solutions"][1]
    reply = client.post("/v1/function/export", json={"request": PAIRS, "solution": solution, "format": kind})
    assert reply.status_code == 200 and len(reply.content) > 100
    if kind != "json":
        best = client.post(f"/v1/function.{kind}", json=PAIRS)
        assert best.status_code == 200 and best.headers["content-type"] == reply.headers["content-type"]


def test_export_of_what_does_not_close_or_was_not_asked(client: TestClient) -> None:
    links = {"crank": 5, "coupler": 1, "rocker": 1, "ground": 1}
    solution = {"links": links, "branch": 1, "start_angle": 0, "output_offset": 0}
    body = {"request": PAIRS, "solution": solution, "format": "svg"}
    assert client.post("/v1/function/export", json=body).status_code == 422
    bad = client.post("/v1/function/export", json={**body, "request": {"output": [1, 2, 3]}})
    assert bad.json()["errors"][0]["pointer"] == "#/request/crank_span"


def test_a_budget_ends_the_search(client: TestClient) -> None:
    asked = {"function": {"name": "exp", "x": [0, 1], "output_span": 90}, "crank_span": 90, "objective": "max"}
    reply = client.post("/v1/function", json={**asked, "budget_ms": 0.01}).json()
    assert reply["report"]["stopped_by"] == "budget"


@pytest.mark.parametrize("name", ["logarithm", "five_pairs"])
def test_the_command(capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str) -> None:
    assert main(["function", "--example", name]) == 0
    assert "rank" in capsys.readouterr().out
    if name == "five_pairs":
        assert main(["function", "--example", name, "--export", str(tmp_path / "one.csv")]) == 0
        assert (tmp_path / "one.csv").read_text().startswith("input,output_wanted")


def test_the_command_names_what_is_wrong(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text(json.dumps({**PAIRS, "input": [0, 1, 1, 2, 3]}))
    assert main(["function", str(tmp_path / "bad.json")]) == 2
    assert "input.2" in capsys.readouterr().err


TRAVEL: dict[str, Any] = {
    "function": {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 40, "samples": 21},
    "crank_span": 90,
    "output_unit": "length",
    "top": 2,
}


@pytest.fixture(scope="module")
def travelled(client: TestClient) -> dict[str, Any]:
    """The reply that each of its files begins from."""
    return client.post("/v1/function", json=TRAVEL).json()


@pytest.mark.parametrize("kind", ["json", "csv", "svg", "dxf", "mjcf"])
def test_a_function_with_travel_and_its_files(client: TestClient, travelled: dict[str, Any], kind: str) -> None:
    reply = travelled
    one = reply["solutions"][1]
    assert one["kind"] == "slider_crank" and one["driver"] == "crank" and one["errors"]["max"] < 1
    assert one["lengths"].keys() == {"crank", "rod", "offset"} and reply["output"][-1] == pytest.approx(40)
    body = {"request": TRAVEL, "solution": one, "format": kind}
    made = client.post("/v1/function/export", json=body)
    assert made.status_code == 200, made.text
    if kind == "csv":
        head, *rows = [line.split(",") for line in made.text.splitlines()]
        errors = [abs(float(row[head.index("error")])) for row in rows]
        assert max(errors) == pytest.approx(one["errors"]["max"], rel=1e-6)
    best = client.post(f"/v1/function.{kind}", json=TRAVEL)
    assert best.status_code == (404 if kind == "json" else 200)
