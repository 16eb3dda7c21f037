"""Layers of plates: the acceptance table, facts that hold for every linkage, and a search without any pruning."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.assembly.layers import Asked, arrange
from synthesis.assembly.machine import Sizes, four_bar
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Interval
from synthesis.work import Work

TABLE = json.loads((Path(__file__).parents[2] / "reference/assembly.json").read_text())["linkages"]
NEAR = 1.5e-7
"""Of the table's seven places, with the last rounded; in degrees or units of length."""


def linkage_of(case):
    point = case["body_point"]
    return Linkage(
        tuple(case["links"]),
        case["branch"],
        np.deg2rad(case["start"]),
        0j,
        np.deg2rad(case["ground"]),
        None if point is None else (point[0], np.deg2rad(point[1])),
    )


def machine_of(case, **more):
    sizes = Sizes(*(case[name] for name in ("hole", "width", "clearance")))
    return four_bar(linkage_of(case), Interval(*np.deg2rad(case["used"])), sizes, **more)


def in_order(layers):
    return [layers[name] for name in ("crank", "coupler", "rocker")]


@pytest.mark.parametrize("name", TABLE)
def test_layers_and_stops_are_those_of_the_table(name) -> None:
    case = TABLE[name]
    below = arrange(machine_of(case), Asked("below"), Work())
    if wanted := case["below"].get("layers"):
        assert below.status == "free"
        assert in_order(below.stack.layers) == wanted
        for stop, at in zip((below.low, below.high), case["stops"]):
            assert (stop is None) == (at is None)
            if stop is not None:
                assert stop.pair is None
                assert np.rad2deg(stop.at) == pytest.approx(at, abs=NEAR)
    else:
        assert below.status == "blocked"
        assert below.tried == case["below"]["tried"]
        assert np.rad2deg(below.free) == pytest.approx(case["below"]["free"], abs=NEAR)
        assert {*below.low.pair, *below.high.pair} == set(case["below"]["pair"].split())
    both = arrange(machine_of(case), Asked("both"), Work())
    assert both.status == "free"
    assert in_order(both.stack.layers) == case["both"]["layers"]
    assert [both.stack.mounts[pin] for pin in "AB"] == case["both"]["mounts"]
    if "stops" in case["both"]:
        assert np.rad2deg([both.low.at, both.high.at]) == pytest.approx(case["both"]["stops"], abs=NEAR)
    heads = arrange(machine_of(case), Asked("below", heads=True), Work())
    assert (in_order(heads.stack.layers) if heads.status == "free" else None) == case["heads"]
