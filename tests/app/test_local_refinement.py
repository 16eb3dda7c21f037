"""Given linkages are refined alike in Python, over HTTP and on the command line.

A refinement that is worse than its start, or an error at the wrong field, would show here.
"""

import json

import numpy as np
import pytest
from fastapi.testclient import TestClient

import linkage_atlas as la
from app import cli
from app.registry import worked_example
from linkage_atlas.result_notes import LOCAL, NO_DESCENT_WITHIN_LIMITS

EXAMPLE = worked_example()
POSES = {name: EXAMPLE[name] for name in ("rotation", "position")}
FREE = {**POSES, "timing": "free", "limits": {"preset": "none"}}


@pytest.fixture(scope="module")
def exact() -> la.Solution:
    return la.synthesize(**EXAMPLE, top=1).best


def changed(solution: la.Solution, **parts) -> dict:
    """The solution as plain values, its crank a little longer and its first pivot a little aside."""
    values = json.loads(json.dumps(solution.to_dict()))
    values["links"]["crank"] *= 1.02
    values["mount"]["pivot_a"][0] += 0.3
    return values | parts


@pytest.mark.parametrize("request_of", [EXAMPLE, FREE], ids=["timed", "free"])
def test_python_and_http_refine_alike(request_of, exact, client: TestClient) -> None:
    begin = changed(exact)
    found = la.synthesize(**request_of, start_from=[begin], refine_only=True)
    assert found.status == "reached" and len(found.solutions) == 1 and found.report.seeds == 1
    assert found.best.errors.objective < 1e-9 and found.report.notes[0] == LOCAL
    assert found.linkage.links == pytest.approx(exact.linkage.links, rel=1e-5)
    reply = client.post("/v2/synthesize", json={**request_of, "start_from": [begin], "refine_only": True})
    assert reply.status_code == 200
    assert reply.json()["solutions"][0]["links"] == found.best.to_dict()["links"]
    assert reply.json()["report"]["notes"] == found.report.notes


def test_a_linkage_a_solution_and_its_values_are_the_same_beginning(exact) -> None:
    alike = exact, exact.linkage, exact.to_dict(), exact.linkage.to_dict()
    links = [la.synthesize(**EXAMPLE, start_from=[beginning], refine_only=True).linkage.links for beginning in alike]
    assert all(np.array_equal(link, links[0]) for link in links)
    radians = {name: np.deg2rad(EXAMPLE[name]) for name in ("rotation", "crank_span")}
    found = la.synthesize(**{**EXAMPLE, **radians}, degrees=False, start_from=[exact], refine_only=True)
    assert found.status == "reached" and found.linkage.links == pytest.approx(links[0])


@pytest.mark.parametrize("more", [{}, {"round_to": 1}], ids=["exact", "rounded"])
def test_what_is_refined_keeps_its_proportion(more) -> None:
    """Poses on a line led to a coupler of 2e4 times their extent."""
    line = {"position": [[10 * k, 0] for k in range(6)], "crank_span": 60, **more}
    begin = la.FourBar(30, 80, 60, 70, pivot_a=(10, -40), coupler_point_polar=(50, 20))
    anyhow = la.synthesize(**line, start_from=[begin], refine_only=True, limits={"preset": "none"})
    assert anyhow.best.size > 1e3, "the error alone counts"
    found = la.synthesize(**line, start_from=[begin], refine_only=True)
    assert len(found.solutions) == 1 and found.best.size <= 30 * (1 + 1e-9)
    assert found.best.errors.objective < 0.02 and any("out of all proportion" in note for note in found.report.notes)
    repeated = la.synthesize(**line, start_from=[anyhow.best], refine_only=True)
    assert repeated.best.errors.objective <= anyhow.best.errors.objective, "one that is given so is not made worse"


def test_functions_are_refined_too(client: TestClient) -> None:
    expected = {"input": [0, 15, 35, 60, 80], "output": [0, 12, 31, 62, 90]}
    first = client.post("/v2/function", json={**expected, "top": 1}).json()["solutions"][0]
    first["links"]["crank"] *= 1.01
    reply = client.post("/v2/function", json={**expected, "start_from": [first], "refine_only": True}).json()
    assert reply["status"] == "reached" and reply["report"]["notes"][0] == LOCAL and reply["report"]["seeds"] == 1
    links = [reply["solutions"][0]["links"][name] for name in ("crank", "coupler", "rocker", "ground")]
    begin = la.FourBar(*links, branch=first["branch"], start_angle=reply["solutions"][0]["start_angle"])
    assert (
        la.function(expected["output"], input=expected["input"], start_from=[begin], refine_only=True).status
        == "reached"
    )
    limits = {"transmission_angle_min": 89}
    distant = la.function(
        expected["output"], input=expected["input"], start_from=[begin], refine_only=True, limits=limits
    )
    assert distant.status == "unknown" and NO_DESCENT_WITHIN_LIMITS in distant.report.notes
    first["links"]["crank"] = 1e9
    reply = client.post("/v2/function", json={**expected, "start_from": [first], "refine_only": True})
    assert reply.json()["errors"][0]["pointer"].startswith("#/start_from/0/links/")


def test_the_command_refines_what_was_written(tmp_path, capsys, exact) -> None:
    request, begin = tmp_path / "request.json", tmp_path / "begin.json"
    request.write_text(json.dumps(EXAMPLE))
    shifted = changed(exact)
    for content in ({"request": EXAMPLE, "linkage": shifted}, shifted, {"solutions": [shifted]}):
        begin.write_text(json.dumps(content))
        assert cli.main(["synthesize", str(request), "--no-preset", "--start-from", str(begin), "--refine-only"]) == 0
        out = capsys.readouterr().out
        assert out.startswith("reached: 1 solution") and f"note: {LOCAL}" in out
    for content, words in (
        ('{"solutions": []}', "0 solutions"),
        ("{", "not valid JSON"),
        ("3", "start_from"),
        (None, "No such"),
    ):
        begin.unlink() if content is None else begin.write_text(content)
        assert cli.main(["synthesize", str(request), "--start-from", str(begin), "--refine-only"]) == 2
        assert words in capsys.readouterr().err
