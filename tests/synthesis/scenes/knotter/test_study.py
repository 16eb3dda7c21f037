"""Verdicts and margins of random knotters agree with an independent model and a fine scan.

A missed window, a wrong edge of entry or an item that depends on its neighbours would show here.
"""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import Clearance, EntryStatus
from synthesis.scenes.knotter.mechanism import Linear, Mechanism, Table
from tests.oracles.knotter import RandomKnotter


def mechanism_of(knotter: RandomKnotter) -> Mechanism:
    """Return the mechanism under test for a random knotter."""
    linear = knotter.kind == "lead"
    beta = Linear(knotter.lead, knotter.ratio) if linear else Table(*knotter.rows, knotter.kind, "error")
    laws = {"beta": beta, "alpha4": Table(*knotter.jaw)}
    return d_knotter.mechanism(knotter.size, knotter.sense, laws, knotter.points)


WINDOWS = {"wrap": d_knotter.WRAP_WINDOW, "bite": d_knotter.BITE_WINDOW}


@cache
def scanned(seed: int, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the driver angles of a fine scan, True for those with the rope inside, and the indices where windows start."""
    alpha = np.linspace(*WINDOWS[name], 6001)
    inside = np.all(RandomKnotter(seed).inside_coordinates(name, alpha) > 0, axis=-1)
    return alpha, inside, np.flatnonzero(inside & ~np.append(False, inside[:-1]))


@cache
def evaluated(seed: int, name: str):
    """Return the result under test, evaluated once for all tests."""
    return getattr(d_knotter, name)().evaluate(mechanism_of(RandomKnotter(seed)), 1)


def case(seed: int, name: str) -> str:
    """Classify a random knotter by a fine scan, and check that the result under test has as many windows."""
    _, _, starts = scanned(seed, name)
    assert evaluated(seed, name).windows[0] == len(starts), seed
    return "never" if not len(starts) else "starts inside" if starts[0] == 0 else "enters"


@pytest.fixture(scope="module")
def cases() -> dict[tuple[str, str], list[int]]:
    """Return the seeds of each condition by case."""
    seeds = {}
    for name in WINDOWS:
        for seed in (*range(30), 59):
            seeds.setdefault((name, case(seed, name)), []).append(seed)
    return seeds


@pytest.mark.parametrize("name", WINDOWS)
def test_entry_agrees_with_the_independent_model(name: str, cases) -> None:
    assert len(cases[name, "enters"]) >= 5
    for seed in cases[name, "enters"]:
        knotter, condition = RandomKnotter(seed), getattr(d_knotter, name)()
        found = evaluated(seed, name)
        alpha, inside, starts = scanned(seed, name)
        low, high = alpha[starts[0] - 1], alpha[starts[0]]
        # The coordinate that becomes positive last opens the window.
        roots = {}
        for index in np.flatnonzero(knotter.inside_coordinates(name, low) <= 0):

            def coordinate(alpha: float, index: int = index, knotter: RandomKnotter = knotter) -> float:
                return knotter.inside_coordinates(name, np.float64(alpha))[index]

            roots[index] = brentq(coordinate, low, high, xtol=1e-15, rtol=1e-15)
        opened, enter = max(roots.items(), key=lambda row: row[1])
        assert np.degrees(found.enter[0] - enter) == pytest.approx(0.0, abs=1e-9)
        assert found.entered_by[0] == (2, 3, 4, 0, 1)[opened]
        assert found.holds[0] == (opened == condition.required_edge)
        p, q, *_ = knotter.corners(name, np.float64(enter))
        t = knotter.inside_coordinates(name, np.float64(enter))[3]
        assert found.point[0] == pytest.approx(p + t * (q - p), abs=1e-9)
        # The rope leaves in the step after the last step inside, or stays until the end of the range.
        last = starts[0] + np.argmin(np.append(inside[starts[0] :], False)) - 1
        assert alpha[last] - 1e-12 <= found.leave[0] <= alpha[min(last + 1, len(alpha) - 1)] + 1e-12


@pytest.mark.parametrize("name", WINDOWS)
def test_rope_that_never_enters_or_is_inside_from_the_start(name: str, cases) -> None:
    assert cases[name, "never"]
    for seed in cases[name, "never"]:
        found = evaluated(seed, name)
        assert found.status[0] == EntryStatus.NEVER and not found.holds[0] and found.margin[0] <= 0
    assert cases[name, "starts inside"]
    for seed in cases[name, "starts inside"]:
        found = evaluated(seed, name)
        assert found.status[0] == EntryStatus.INSIDE_AT_START and found.enter[0] == WINDOWS[name][0]


@pytest.mark.parametrize("locked", [True, False])
@pytest.mark.parametrize("radius", [np.inf, 60.0, 20.0])
@pytest.mark.parametrize("seed", range(12))
def test_worst_clearance_agrees_with_a_fine_scan(seed: int, radius: float, locked: bool) -> None:
    knotter = RandomKnotter(seed)
    condition = Clearance(d_knotter.CLEARANCE_AT, d_knotter.CLEARANCE_OVER, radius, locked)
    found = condition.evaluate(mechanism_of(knotter), 1)
    alpha = np.linspace(*condition.over, 40_001)

    def depth(driver: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(knotter.jaw_in_seat(driver, locked), -1, 0)
        if np.isinf(radius):
            return y
        beyond_rim = np.hypot(x, z) - radius
        outside = np.hypot(np.maximum(beyond_rim, 0), np.maximum(-y, 0))
        return np.where((beyond_rim < 0) & (y > 0), np.minimum(y, -beyond_rim), -outside)

    scanned = depth(alpha).max()
    assert scanned - 1e-9 <= found.worst[0] <= scanned + 1e-2
    assert depth(found.worst_driver)[0] == pytest.approx(found.worst[0], abs=1e-9)
    assert depth(np.array([condition.at]))[0] == pytest.approx(found.value[0], abs=1e-9)
    assert found.holds[0] == (found.worst[0] < 0) and found.margin[0] == -found.worst[0]


def test_largest_depth_in_a_disc_may_be_at_a_kink() -> None:
    """A point on a circle near the rim moves away from the plane and towards the rim at the same time; solved by hand."""
    # The bill turns the tip about the axis k of the disc's seat, 15 beside the disc's axis j.
    parameters = dict.fromkeys(("alpha2", "d1", "D", "d6", "d9", "d10"), 0.0) | {"d5": -15.0}
    arm = d_knotter.mechanism(parameters, laws={"alpha4": Linear(0.0)}, points={"S10": (10.0, 0.0, 0.0)})
    found = Clearance(0.0, (-np.pi, 0.0), radius=20.0).evaluate(arm, 1)
    # The tip is 10 sin behind the plane and 5 - 10 cos inside the rim; both are equal if sin + cos = 1/2.
    angle = np.pi - np.arcsin(0.5 / np.sqrt(2)) - np.pi / 4
    assert found.worst_driver[0] == pytest.approx(-angle, abs=1e-12)
    assert found.worst[0] == pytest.approx(10 * np.sin(angle), abs=1e-11)


# Infeasible and refused mechanisms
