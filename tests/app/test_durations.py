"""What a search will take, by the measured table: known for every everyday question, and a guess for all others."""

import json
from pathlib import Path

import pytest

from app.fourbar import answers
from app.fourbar.answers import is_long_search
from app.fourbar.models import SynthesizeRequest
from app.registry import all_queries, worked_example
from tests.everyday.battery import KINDS, limited, rows

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "durations.json"
MODELS = {query.path: query.request for query in all_queries()}


def test_the_table_is_the_committed_one_and_within_a_factor_of_three() -> None:
    results = json.loads(RESULTS.read_text())
    assert answers._durations() == results["table"] and results["within"] >= 0.95
    near, named = 0, {row.name: row for row in rows()}
    for one in results["asked"]:
        row = named[one["row"]]
        request = MODELS[f"/v1/{row.route}"].model_validate(limited(row, one["limits"]))
        near += 1 / 3 <= one["seconds"] / answers.seconds_of(request) <= 3
    assert near >= 0.95 * len(results["asked"])


def test_every_kind_of_everyday_question_has_been_measured() -> None:
    kinds = {answers.kind_of(MODELS[f"/v1/{row.route}"](**limited(row, kind))) for row in rows() for kind in KINDS}
    assert len(kinds & answers._durations()["kinds"].keys()) >= 0.9 * len(kinds), sorted(kinds)


@pytest.mark.parametrize(
    ("more", "long"),
    [
        ({}, False),
        ({"limits": {"pivot_box": [0, 0, 1, 1], "family": "any"}}, False),
        ({"crank_span": None, "timing": "free"}, False),
        ({"crank_span": None, "timing": "free", "order": "any"}, True),
        ({"crank_span": None, "timing": "free", "order": "any", "budget_ms": 150}, False),
        ({"mechanisms": "all"}, True),
        *(({name: asked}, True) for name, asked in (("tolerance_study", {}), ("diverse", True), ("prefer", "size"))),
        ({"lengths_from": [1, 2]}, True),
        ({"crank_span": None, "timing": "free", "live": "a client's own"}, False),
        ({"lengths_from": [1, 2, 3], "live": "a client's own"}, True),
        ({"rotation": [0.5 * k for k in range(100)], "position": None, "live": "a client's own"}, True),
    ],
)
def test_what_takes_little_is_short(more, long) -> None:
    asked = {**worked_example(), **more}
    assert is_long_search(SynthesizeRequest(**asked)) is long
    assert not is_long_search(SynthesizeRequest(**asked | {"budget_ms": 100}))


@pytest.mark.parametrize(
    ("position", "rotation", "left"),
    [
        ([[k, k * k] for k in range(9)], None, 0),
        ([[k, k * k] for k in range(5)], [5.0 * k for k in range(5)], 0),
        ([[k, k * k] for k in range(3)], [0.0, 5.0, 15.0], 4),
        ([[0, 0], None, [2, 4], [3, 9], [4, 16]], [0.0, 5.0, None, 9.0, 20.0], 3),
        ([[k, k * k] for k in range(20)], None, -11),
    ],
)
def test_nine_points_or_five_poses_leave_no_unknown_free(position, rotation, left) -> None:
    request = SynthesizeRequest(position=position, rotation=rotation, angle_unit="deg", timing="free")
    assert answers.freedom_of(request) == left


def test_no_request_is_said_to_take_longer_than_its_budget() -> None:
    request = SynthesizeRequest(**{**worked_example(), "timing": "free", "crank_span": None, "budget_ms": 5})
    assert answers.seconds_of(request) == 0.005


LINKAGE = {"links": {"crank": 30, "coupler": 80, "rocker": 70, "ground": 100}, "branch": 1, "start_angle": 28}
LINKAGE["mount"] = {"ground_angle": 0, "pivot_a": [0, 0], "coupler_point": {"radius": 50, "angle": 40}}
GUIDED = {"driver": "slider", "branch": 1, "guides": [{"guide": "rail", "body_point": [0, 0]}] * 2, "start": 0}
CORNERS = [[k % 7, k] for k in range(40)]


@pytest.mark.parametrize(
    ("path", "body", "long"),
    [
        ("/v1/match", {"rotation": [0, 1, 2], "crank_span": 70}, False),
        ("/v1/match", {"rotation": [0, 1, 2], "crank_span": 1}, True),
        ("/v1/match", {"rotation": [0, 1, 2], "crank_angle": [0, 0.5, 1], "angle_unit": "deg"}, True),
        ("/v1/match", {"rotation": [0, 1, 2], "crank_span": 1, "angle_unit": "rad"}, False),
        ("/v1/drives", {"linkage": LINKAGE, "drives": [{"kind": "rotary"}]}, False),
        ("/v1/drives", {"linkage": LINKAGE, "drives": [{"kind": "actuator"}]}, True),
        ("/v1/drives", {"linkage": LINKAGE, "drives": [{"kind": "actuator"}], "budget_ms": 100}, False),
        ("/v1/assembly", {"linkage": LINKAGE}, False),
        ("/v1/assembly", {"linkage": LINKAGE, "body": CORNERS}, True),
        ("/v1/assembly", {"linkage": GUIDED, "body": CORNERS[:3]}, True),
        ("/v1/export", {"request": worked_example(), "solution": LINKAGE, "format": "step"}, False),
        ("/v1/export", {"request": worked_example(), "solution": LINKAGE, "assembly": {"body": CORNERS}}, True),
    ],
)
def test_what_takes_little_of_other_routes_is_short(path, body, long) -> None:
    query = next(query for query in all_queries() if path in (query.path, query.files and query.files.path))
    question = query if path == query.path else query.files
    assert question.is_long(question.request.model_validate(body)) is long
