"""Function generators are answered and exported over HTTP.

An export of another solution or of a generator that does not close would show here.
"""

from typing import Any

import pytest
from fastapi.testclient import TestClient

PAIRS = {"input": [0, 15, 35, 60, 80], "output": [0, 12, 31, 62, 90], "top": 2}


def test_export_of_what_does_not_close_or_was_not_asked(client: TestClient) -> None:
    links = {"crank": 5, "coupler": 1, "rocker": 1, "ground": 1}
    solution = {"links": links, "branch": 1, "start_angle": 0, "output_offset": 0}
    body = {"request": PAIRS, "linkage": solution, "format": "svg"}
    refused = client.post("/v2/function/export", json=body).json()["errors"][0]
    assert refused["pointer"] == "#/linkage/links/crank" and "cannot be assembled" in refused["detail"]
    links["crank"] = 0.5
    bad = client.post("/v2/function/export", json={**body, "request": {"output": [1, 2, 3]}})
    assert bad.json()["errors"][0]["pointer"] == "#/request/crank_span"


SQUARE = {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 40, "samples": 21}
TRAVEL: dict[str, Any] = {"function": SQUARE, "crank_span": 90, "output_unit": "length", "top": 2}


BODIES: dict[str, dict[str, Any]] = {
    "pairs": PAIRS,
    "travel": TRAVEL,
    "stroke": {"quick_return": {"stroke": 300, "time_ratio": 1.4}},
    "swing": {"quick_return": {"swing": 60, "time_ratio": 1.2}},
    "steering": {"steering": {"track": 1200, "wheelbase": 2400, "angle": 35}, "curves": True},
}


@pytest.fixture(scope="module")
def replies(client: TestClient) -> dict[str, dict[str, Any]]:
    return {name: client.post("/v2/function", json=body).json() for name, body in BODIES.items()}


@pytest.fixture(params=BODIES)
def exchange(
    request: pytest.FixtureRequest, replies: dict[str, dict[str, Any]]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """A request, of four-bars or of slider-cranks, and the reply that each of its files begins from."""
    return BODIES[request.param], replies[request.param]


def test_a_function_with_travel_is_made_by_a_slider_crank(replies: dict[str, dict[str, Any]]) -> None:
    reply = replies["travel"]
    solution = reply["solutions"][1]
    assert solution["kind"] == "slider_crank" and solution["driver"] == "crank" and solution["errors"]["max"] < 1
    assert solution["lengths"].keys() == {"crank", "rod", "offset"} and reply["output"][-1] == pytest.approx(40)


@pytest.mark.parametrize("kind", ["json", "csv", "svg", "dxf", "mjcf"])
def test_any_solution_is_exported(
    client: TestClient, exchange: tuple[dict[str, Any], dict[str, Any]], kind: str
) -> None:
    request, reply = exchange
    solution = reply["solutions"][1]
    built = client.post("/v2/function/export", json={"request": request, "linkage": solution, "format": kind})
    assert built.status_code == 200 and len(built.content) > 100, built.text
    if kind == "csv":
        head, *rows = [line.split(",") for line in built.text.splitlines()]
        errors = [abs(float(row[head.index("error")])) for row in rows]
        assert max(errors) == pytest.approx(solution["errors"]["max"], rel=1e-6, abs=1e-9)
