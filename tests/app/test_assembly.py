"""Assemblies over HTTP and on the command line agree with Python, and errors point to the wrong field.

A route that drops the assembly of a request would show here.
"""

import json

import linkage_atlas as la
from app import cli
from app.registry import worked_example

EXAMPLE = {**worked_example(), "top": 1}
LINKAGE = {"links": {"crank": 60, "coupler": 50, "rocker": 70, "ground": 30}, "branch": 1, "start_angle": 0}


def test_the_route_answers_as_python_does(client) -> None:
    reply = client.post("/v2/assembly", json={"linkage": LINKAGE, "boards": "both"})
    assert reply.status_code == 200, reply.text
    assert reply.json() == json.loads(json.dumps(la.Linkage.from_dict(LINKAGE).assembly(boards="both").to_dict()))


def test_a_solution_as_it_came_with_its_request(client) -> None:
    solved = client.post("/v2/synthesize", json={**EXAMPLE, "assembly": True}).json()["solutions"][0]
    reply = client.post("/v2/assembly", json={"linkage": solved, "request": EXAMPLE}).json()
    assert reply == solved["verdict"]["assembly"]
    repeated = client.post("/v2/assembly", json={"request": EXAMPLE}).json()
    assert repeated["layers"] == reply["layers"]


def test_without_an_assembly_there_is_none(client) -> None:
    for request in ({}, {"assembly": False}, {"assembly": None}):
        verdict = client.post("/v2/synthesize", json={**EXAMPLE, **request}).json()["solutions"][0]["verdict"]
        assert verdict["assembly"] is None


def test_the_command_shows_layers_from_the_top_down(capsys, tmp_path) -> None:
    assert cli.main(["assembly", "--example", "double_crank"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "free: 3 layers"
    stack = ["4 board_above", "3 rocker", "2 coupler", "1 crank", "0 board_below"]
    assert [" ".join(line.split()[:2]) for line in lines[4:9]] == stack
    assert cli.main(["assembly", "--example", "double_crank", "--set", "boards=below"]) == 5
    assert "with boards on both sides" in capsys.readouterr().out
    path = tmp_path / "poses.csv"
    path.write_text("x,y,angle\n0,0,0\n40,8,15\n75,30,40\n")
    assert cli.main(["assembly", str(path), "--set", "request.limits.family=any"]) in (0, 5)
    assert "layer" in capsys.readouterr().out
