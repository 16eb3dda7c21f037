"""The examples of the page are made by their script, and their stored replies are true.

An example whose stored error no longer belongs to its linkage would show here.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import linkage_atlas as la
from benchmarks import page_examples

STORED = json.loads(page_examples.FILE.read_text())


def test_the_examples_are_made_by_their_script() -> None:
    replies = page_examples.stored_replies()
    assert len(replies) == len(STORED), "a request has changed since it was searched: run with --solve"
    assert page_examples.FILE.read_text() == page_examples.text(replies)


@pytest.mark.parametrize("example", STORED, ids=lambda example: example["name"])
def test_the_stored_errors_are_those_of_the_stored_linkages(example) -> None:
    request, solutions = example["request"], example["reply"]["solutions"]
    assert solutions and all(solution["verdict"]["practical"] for solution in solutions if example["machine"])
    for solution in solutions:
        angles = solution["crank_angle"] or request.get("crank_angle")
        if angles is None:
            angles = np.linspace(0, request["crank_span"], len(request["position"]))
        joints = la.Linkage.from_dict(solution).joints(np.asarray(angles))
        off = np.hypot(*(joints.body_point - np.array(request["position"])).T).max()
        assert off == pytest.approx(solution["errors"]["position_max"], rel=1e-4, abs=1e-5)
        if "rotation" in request:
            turned = joints.rotation - np.array(request["rotation"])
            turned -= 360 * np.round(turned / 360)
            assert np.abs(turned).max() == pytest.approx(solution["errors"]["rotation_max"], rel=1e-4, abs=1e-5)


@pytest.mark.parametrize(
    "example",
    [example for example in STORED if example["request"].get("closed")],
    ids=lambda example: example["name"],
)
def test_a_stored_transmission_angle_of_a_closed_way_holds_over_the_turn(example) -> None:
    for solution in example["reply"]["solutions"]:
        crank, coupler, rocker, ground = (
            solution["links"][name] for name in ("crank", "coupler", "rocker", "ground")
        )
        across = crank**2 + ground**2 - 2 * crank * ground * np.cos(np.linspace(0, 2 * np.pi, 3601))
        between = np.degrees(np.arccos((coupler**2 + rocker**2 - across) / (2 * coupler * rocker)))
        smallest = np.minimum(between, 180 - between).min()
        assert solution["transmission_angle_min"] == pytest.approx(smallest, abs=1e-3)
