"""Gaps between moving shapes agree with the acceptance table and with shapely at many positions.

A body outside its enclosure, or a collision between two samples, would show here.
"""

from __future__ import annotations

import numpy as np
import pytest

from synthesis.assembly.gaps import CarriedShape, Gaps
from synthesis.assembly.movement import GROUND, BodyPoint, Crank, Movement
from synthesis.assembly.shapes import Shape, disc, distances
from synthesis.target import TURN, Interval
from synthesis.work import Work
from tests.oracles.assembly import shapely_gap
from tests.oracles.solids import TABLE
from tests.synthesis.assembly.test_layers import CLOSE, machine_of

SEED = 20351


def shapes_of(machine):
    found = {plate.name: CarriedShape(plate.body, plate.shape) for plate in machine.plates}
    return found | {
        pin.name: CarriedShape(pin.points[0].body, disc(pin.points[0].at, pin.radius)) for pin in machine.pins
    }


def gaps_of(machine, pairs):
    shapes = shapes_of(machine)
    carried = [(shapes[a], shapes[b]) for a, b in pairs]
    return Gaps(machine.movement, carried, machine.clearance, machine.size)


@pytest.mark.parametrize("name", TABLE)
def test_gaps_are_those_of_the_table(name) -> None:
    case = TABLE[name]
    machine = machine_of(case)
    gaps = gaps_of(machine, [tuple(pair.split()) for pair in case["pairs"]])
    proofs = gaps.prove(machine.used, Work())
    free = [k for k, proof in enumerate(proofs) if proof.free]
    smallest = gaps.minimum_gaps(free)
    for k, expected in enumerate(case["pairs"].values()):
        if "hits" in expected:
            assert np.rad2deg(proofs[k].hits) == pytest.approx(np.array(expected["hits"]), abs=CLOSE)
        else:
            assert proofs[k].free
            assert smallest[k].gap == pytest.approx(expected["least"], abs=CLOSE)
            if "at" in expected:
                assert np.rad2deg(smallest[k].at) == pytest.approx(expected["at"], abs=1e-6)


# -- distances ----------------------------------------------------------------------------------------------------------


def random_core(rng, corners):
    """A point, a line, or a simple polygon: a star about its middle."""
    middle = complex(*rng.normal(size=2))
    if corners < 3:
        return tuple(middle + complex(*rng.normal(size=2)) for _ in range(corners))
    angle = np.sort(rng.uniform(0, TURN, corners)) + np.arange(corners) * 1e-3
    return tuple(middle + rng.uniform(0.2, 1.5, corners) * np.exp(1j * angle))


def test_distances_are_those_of_shapely() -> None:
    rng = np.random.default_rng(SEED)
    for first, second in [(1, 1), (1, 2), (2, 2), (3, 1), (3, 2), (3, 3), (7, 1), (7, 2), (7, 4), (12, 9)]:
        for _ in range(200):
            a, b = Shape(random_core(rng, first), 0.0), Shape(random_core(rng, second), 0.0)
            expected = shapely_gap(a.core, b.core)
            found = distances(np.array([a.corners]), np.array([b.corners]))[0]
            assert found == pytest.approx(expected, abs=1e-12), (a, b)


# -- proofs -------------------------------------------------------------------------------------------------------------


def test_shapes_that_touch_by_design_are_not_decided() -> None:
    """A disc on a crank that just reaches a disc of the ground all the way, and a second crank that would touch it
    for an instant.
    """
    movement = Movement(("ground", "crank"), (Crank(1, BodyPoint(GROUND, 0j), 0.0),))
    discs = [(GROUND, 0j, 1.0), (1, 3 + 0j, 2.0), (GROUND, 6 + 0j, 1.0), (1, 3 + 0j, 1.9)]
    shapes = [CarriedShape(body, disc(at, radius)) for body, at, radius in discs]
    pairs = [(shapes[first], shapes[second]) for first, second in ((0, 1), (1, 2), (0, 3))]
    gaps = Gaps(movement, pairs, 0.0, 6.0)
    around, once, clear = gaps.prove(Interval(-1.0, 2.0), Work())
    assert not around.hits
    assert [(run.first, run.last) for run in around.touches] == [(-1.0, 2.0)]
    assert not once.hits
    assert np.abs(once.touches[0]).max() < 2e-4
    assert clear.free
    assert gaps.minimum_gaps([2])[2].gap == pytest.approx(0.1, abs=1e-14)
