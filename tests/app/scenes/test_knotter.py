"""The knotter answers alike over HTTP and on the command line, with its provenance.

A figure that changes with the unit, or a bad field without its name, would show here.
"""

import json
import math
from pathlib import Path

import pytest

from app import cli
from tests.conftest import finite

ROOT = Path(__file__).parents[3]
FIGURES = json.loads((ROOT / "tests" / "reference" / "knotter.json").read_text())
POINTS = ("S0", "S1", "S3", "S4", "S5", "S7", "S8", "S9", "S10")


@pytest.fixture(scope="module")
def reference(client):
    return ask(client, "scan")


def ask(client, path, **body):
    reply = client.post(f"/v2/knotter/{path}", json=body)
    assert reply.status_code == 200, reply.text
    return reply.json()


def scan(client, **body):
    return ask(client, "scan", **body)


def test_defaults_give_the_published_pattern(reference) -> None:
    assert reference["status"] == "feasible"
    assert reference["feasible"] == FIGURES["paper"]["feasible"]
    pairs = {f"{pair['alpha1']:g},{pair['alpha3']:g}": pair for pair in reference["pairs"]}
    # the other figures: tests/synthesis/scenes/knotter/test_d_knotter.py
    for key, (angle, edge, y, z, leave) in FIGURES["wrap"].items():
        wrap = pairs[key]["wrap"]
        assert wrap["angle"] == pytest.approx(angle, abs=1e-9) and wrap["exit_angle"] == pytest.approx(
            leave, abs=1e-9
        )
        assert wrap["edge"] == edge and wrap["holds"] == (edge == "S3S4")
        assert wrap["point"] == pytest.approx([0, y, z], abs=1e-8)
    for pair in pairs.values():
        assert pair["feasible"] == all(pair[name]["holds"] for name in ("wrap", "clearance", "bite"))
        assert pair["margin"] == min(pair[name]["margin"] for name in ("wrap", "clearance", "bite"))


def test_reply_tells_assumed_from_published(client, reference) -> None:
    assert {"d1", "D", "d9", "d10", "beta", "alpha4"} | {*POINTS} - {"S3", "S4"} <= set(reference["assumed"])
    assert {"alpha2", "d5", "d6", "S3", "S4"} <= set(reference["published"])
    assert not reference["from_request"]
    frames = dict.fromkeys(POINTS, "u4") | {"S0": "u3", "S8": "u5", "S10": "u5"}
    assert {name: reference["frames"][name] for name in POINTS} == frames
    own = scan(client, parameters={"d1": 136}, laws={"beta": {"lead": 23.5, "ratio": 0.5}}, senses={"beta": -1})
    assert set(own["from_request"]) == {"d1", "beta", "senses.beta"}
    assert not {"d1", "beta", "senses.beta"} & set(own["assumed"])
    assert own["pairs"] == reference["pairs"]
    all_cases = set(own["assumed"]) | set(own["published"]) | set(own["from_request"])
    assert all_cases == set(reference["assumed"]) | set(reference["published"])


def test_radians_are_the_same_answer(client, reference) -> None:
    found = scan(client, angle_unit="rad")
    for degrees, radians in zip(reference["pairs"], found["pairs"]):
        assert radians["alpha1"] == pytest.approx(math.radians(degrees["alpha1"]), abs=1e-15)
        for name, field in (
            ("wrap", "angle"),
            ("wrap", "exit_angle"),
            ("bite", "angle"),
            ("clearance", "worst_angle"),
        ):
            assert radians[name][field] == pytest.approx(math.radians(degrees[name][field]), abs=1e-12)
        assert radians["wrap"]["point"] == degrees["wrap"]["point"]
    table = [[math.radians(270), math.radians(22.5)], [math.radians(337), 0]]
    laws = {"beta": {"lead": math.radians(23.5), "ratio": 0.5}, "alpha4": {"table": table}}
    own = scan(client, angle_unit="rad", parameters={"alpha2": math.radians(8)}, laws=laws)
    assert own["pairs"] == found["pairs"]


def test_needle_over_http(client) -> None:
    for name, field in (("L", "clearance"), ("d5", "d5")):
        for degrees, value in FIGURES[name].items():
            reply = client.post("/v2/knotter/needle", json={"alpha2": float(degrees)}).json()
            assert reply[field] == pytest.approx(value, abs=1e-10), degrees
    found = client.post("/v2/knotter/needle", json={"alpha2": 8}).json()
    assert found["status"] == "free"
    assert found["alpha2_range"] == pytest.approx(FIGURES["L_roots"], abs=1e-9)
    best = found["clearance_max"], found["clearance_max_angle"]
    assert best == pytest.approx(tuple(FIGURES["L_max"]), abs=1e-8)
    assert found["alpha2_for_d5"] == pytest.approx(FIGURES["alpha2_for_54"], abs=1e-9)
    assert (found["alpha2_whole_degrees"], found["d5_whole"]) == (7, 54)
    radians = client.post("/v2/knotter/needle", json={"alpha2": math.radians(8), "angle_unit": "rad"}).json()
    assert radians["alpha2_range"] == pytest.approx([math.radians(x) for x in found["alpha2_range"]], rel=1e-14)
    blocked = client.post("/v2/knotter/needle", json={"r0": 60, "d5": 500}).json()
    assert blocked["status"] == "blocked" and blocked["alpha2_range"] is None and blocked["alpha2_for_d5"] is None


EXTREMES = {
    "huge": {"parameters": {name: 1e9 for name in ("d1", "D", "d5", "d6", "d9", "d10")}},
    "tiny": {"parameters": {name: 1e-9 for name in ("d1", "D", "d5", "d6", "d9", "d10")}},
    "zero": {"parameters": {name: 0 for name in ("d1", "D", "d5", "d6", "d9", "d10")}},
    "small triangle": {"points": {"S3": [0, 2e-9, 1e-9], "S4": [0, 1e-9, 2e-9]}},
    "small points": {"points": {name: [1e-9, 2e-9 * k, 3e-9 * k * k] for k, name in enumerate(POINTS)}},
    "huge angles": {"grid": {"alpha1": [1e9], "alpha3": [-1e9]}, "laws": {"beta": {"lead": -1e9, "ratio": 0}}},
    "step": {"laws": {"beta": {"table": [[0, 0], [100, 0], [100.0000001, 90], [400, 90]]}}},
    "smooth step": {"laws": {"beta": {"table": [[0, 0], [100, 0], [100.0000001, 90], [400, 90]], "kind": "pchip"}}},
    "fast": {"laws": {"beta": {"lead": 1, "ratio": 100}}},
    "narrow range": {"windows": {"wrap": [90, 90.0000000001], "bite": [300, 300.0000000001]}},
    "two turns": {
        "windows": {"wrap": [0, 720], "bite": [-360, 360]},
        "clearance": {"angle_range": [0, 720], "disc_radius": 30},
    },
    "needle upright": {"parameters": {"alpha2": 90}},
}


@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_are_answered_with_finite_numbers(name: str, client) -> None:
    assert finite(scan(client, **EXTREMES[name]))


def test_a_rope_that_never_enters_says_why(client) -> None:
    pair = scan(client, grid={"alpha1": [10], "alpha3": [25], "d5": [120]}, conditions=["wrap"])["pairs"][0]["wrap"]
    assert pair["angle"] is None and pair["margin"] < 0
    assert 0 <= pair["nearest_angle"] <= 180
    plane = scan(client, points={"S1": [0, 14, -39]}, conditions=["wrap"])["pairs"][0]["wrap"]
    assert "plane throughout" in plane["status"]


def test_command_line_prints_a_table_and_names_a_bad_field(tmp_path, capsys) -> None:
    request = tmp_path / "request.json"
    request.write_text(json.dumps({"grid": {"alpha1": [10], "alpha3": [25]}}))
    assert cli.main(["knotter", "scan", str(request)]) == 0
    table = capsys.readouterr().out
    assert "90.139580 S3S4" in table and "feasible: 1 of 1" in table and "assumed, not published: d1" in table
    assert cli.main(["knotter", "scan", str(request), "--export", str(tmp_path / "pairs.csv")]) == 0
    assert (tmp_path / "pairs.csv").read_text().startswith("alpha1,alpha3,wrap.holds")
    request.write_text(json.dumps({"points": {"S4": [0, 16, -12]}}))
    assert cli.main(["knotter", "scan", str(request)]) == 2
    assert "points: S3 and S4 coincide" in capsys.readouterr().err
