"""Searches that start from given linkages continue the linkage on show while its motion is dragged.

A search without memory would answer a motion that moved by a pixel with a linkage that jumps about on the page.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of, ticking

ROOT = Path(__file__).parents[2]
EXAMPLES = {row["name"]: row["request"] for row in json.loads((ROOT / "app/static/examples.json").read_text())}
TIMED = json.loads((ROOT / "app/examples/worked_example.json").read_text()) | {"limits": {"preset": "practical"}}
QUESTIONS = {name: EXAMPLES[name] for name in ("casement", "wiper", "bucket", "film", "pick")} | {"timed": TIMED}
ARGUMENTS = ("rotation", "position", "crank_span", "timing", "closed", "limits", "tolerances", "order")
WIDTH = 400
"""Pixels of the canvas that the motion fills."""


def question(name: str, pixels: float = 0.0) -> dict:
    """The question of an example, with its middle sample dragged to the right."""
    request = {key: value for key, value in QUESTIONS[name].items() if key in ARGUMENTS}
    positions = [list(position) for position in request["position"]]
    positions[len(positions) // 2][0] += pixels * np.ptp(np.array(positions), axis=0).max() / WIDTH
    return request | {"position": positions}


stepped = ticking(2e-4)


def plain(solution: la.Solution) -> dict:
    """The solution as a client has it."""
    return json.loads(json.dumps(solution.to_dict()))


def links(solution: dict) -> np.ndarray:
    return np.array(list(solution["links"].values()))


def continued(request: dict, start: dict, budget: float | None = 0.5, **options) -> dict:
    """The solution that continues a linkage."""
    result = la.synthesize(**request, start_from=[start], top=3, budget=budget, work=stepped, **options)
    (rank,) = result.report.start_from_ranks
    return plain(result.solutions[rank - 1])


@pytest.mark.parametrize("name", some_of(["casement", "film", "timed", "wiper", "bucket", "pick"], 2))
def test_a_drag_by_a_pixel_continues_the_linkage_on_show_and_back_restores_it(name) -> None:
    shown = plain(la.synthesize(**question(name), top=1, budget=2.0, work=stepped).best)
    second = continued(question(name, pixels=1), shown)
    assert second["branch"] == shown["branch"]
    assert np.abs(links(second) - links(shown)).max() < 0.05 * links(shown).max(), (
        "the same linkage, a little changed"
    )
    back = continued(question(name), second)
    assert np.abs(links(back) - links(shown)).max() < 0.02 * links(shown).max()
    assert back["errors"]["objective"] <= 1.05 * shown["errors"]["objective"] + 1e-9


@pytest.mark.parametrize("crank_angles", ["free", "given"])
def test_a_compact_linkage_moves_no_farther_than_needed(crank_angles) -> None:
    """The smallest error lies far along a flat valley, and most of that distance gains almost nothing."""
    before, after = question("casement"), question("casement", pixels=1)
    if crank_angles == "given":
        before, after = ({**question("timed", pixels), "limits": {"preset": "none"}} for pixels in (0, 1))
    shown = plain(la.synthesize(**before, prefer="balanced", top=1, budget=2.0, work=stepped).best)
    nearby, optimum = (continued(after, shown, prefer=prefer) for prefer in ("balanced", "error"))
    changes = [np.abs(links(solution) - links(shown)).max() for solution in (nearby, optimum)]
    assert changes[0] < 0.75 * changes[1]
    assert nearby["errors"]["objective"] < 1.1 * optimum["errors"]["objective"]
    (refined,) = la.synthesize(**after, start_from=[shown], refine_only=True, work=stepped).solutions
    assert refined.errors.objective == pytest.approx(optimum["errors"]["objective"], rel=1e-3)


def test_the_answer_is_no_worse_than_the_given_linkage_however_short_the_time() -> None:
    good = la.synthesize(**question("film"), top=1, budget=2.0, work=stepped).best
    repeated = continued(question("film"), plain(good), budget=1e-3)
    assert repeated["errors"]["objective"] <= good.errors.objective * (1 + 1e-9)


def test_the_search_runs_too() -> None:
    distant = {"links": dict(crank=30, coupler=80, rocker=70, ground=100), "branch": 1, "start_angle": 0}
    request = {key: TIMED[key] for key in ("rotation", "position", "crank_span")}
    started_from = la.synthesize(**request, start_from=[distant, la.FourBar(19, 70, 140, 160)], top=3)
    assert started_from.status == "reached" and len(started_from.report.start_from_ranks) == 2


BENDING = {"rotation": [0, 5, 11, 20, 30], "position": [[0, 0], [20, 5], [45, 8], [70, 20], [100, 25]]}


@pytest.mark.parametrize(
    ("kind", "timing"),
    [
        ("two_slots", {"timing": "free"}),
        ("rail_slot", {"timing": "free"}),
        ("slider_crank", {"travel_span": 100}),
        ("swinging_block", {"crank_span": 60}),
    ],
)
def test_every_kind_of_linkage_continues_while_the_motion_is_dragged(kind, timing) -> None:
    """The kinds of a request are those of its linkages unless it names others."""
    requested = BENDING | timing
    shown = plain(la.synthesize(**requested, mechanisms=[kind], top=1, budget=2.0, work=stepped).best)
    indices = [*requested["position"][:2], [45.5, 8], *requested["position"][3:]]
    for local in (True, False):
        found = la.synthesize(
            **requested | {"position": indices}, start_from=[shown], refine_only=local, budget=1.0, work=stepped
        )
        close = found.solutions[found.report.start_from_ranks[0] - 1]
        assert (close.kind, close.driver, close.branch) == (kind, shown["driver"], shown["branch"])
        assert close.errors.objective < 1.1 * shown["errors"]["objective"]
        guides = [np.array(one["guides"][0]["body_point"]) for one in (plain(close), shown)]
        assert np.abs(guides[0] - guides[1]).max() < 15, "the same linkage, a little changed"


def test_a_linkage_by_its_joints_is_refined() -> None:
    requested = {key: TIMED[key] for key in ("rotation", "position", "crank_span")}
    at = la.FourBar(19, 72, 144, 165, start_angle=30, coupler_point_polar=(20, 60)).joints(0)
    points = (at.pivot_a, at.crank_pin, at.coupler_pin, at.pivot_b, at.body_point)
    joints = {name: point.ravel().tolist() for name, point in zip("ADCBP", points)}
    found = la.synthesize(**requested, start_from=[{"joints": joints}], refine_only=True)
    assert found.status == "reached" and found.best.links.crank == pytest.approx(19, rel=1e-3)
