"""Springs of a catalogue help on the best pair of links and behave as requested.

Catches a "best" spring that increases the torque, a pair of links that is not tried, and a hatch that falls shut.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of

HATCH = {
    "rocker": {"pivot": [0, 0], "start": -90, "swing": 90, "length": 1500},
    "load": {"masses": [{"link": "rocker", "mass": 50, "centre": [750, 0]}]},
    "hand_point": [0, -1500],
}
POSITION = {"kind": "gas", "between": ["ground", "rocker"], "ground_box": [-200, -700, 300, 100], "reach_max": 600}
MECHANISM = la.FourBar(
    25, 70, 55, 60, start_angle=60, coupler_point_polar=(53.85164807134504, 21.80140948635181), body_offset=0
)
MASSES = {
    "masses": [
        {"link": "coupler", "mass": 0.4, "centre": [50, 20]},
        {"link": "crank", "mass": 0.02, "centre": [12.5, 0]},
        {"link": "rocker", "mass": 0.04, "centre": [27.5, 0]},
    ]
}


def gas(force: float, extended: float, stroke: float, progression: float = 1.3) -> dict[str, float]:
    return {"force": force, "extended": extended, "stroke": stroke, "progression": progression}


def hatch_torque(spring: Any, row: Mapping[str, float], mass: float, at: complex, low: float, high: float) -> Any:
    """Torque that a hinge must give, by central differences of the potential energy of weight and gas."""
    ground, pin = complex(*spring.points_on_links[0]), complex(*spring.points_on_links[1])
    rate = row["force"] * (row["progression"] - 1) / row["stroke"]

    def energy(angle: Any) -> Any:
        turned = np.exp(1j * angle)
        squeezed = row["extended"] - np.abs(pin * turned - ground)
        return mass * 9.81 * (at * turned).imag + row["force"] * squeezed + rate * squeezed**2 / 2

    angles, step = np.deg2rad(np.linspace(low, high, 61)), 1e-5
    lengths = np.abs(pin * np.exp(1j * angles) - ground)
    return angles, lengths, (energy(angles + step) - energy(angles - step)) / (2 * step)


@pytest.mark.parametrize("row", some_of([gas(1100, 700, 300), gas(1100, 500, 200, 1.4), gas(1100, 585, 250)], 2))
def test_a_hatch_is_held_open_and_shut(row: dict[str, float]) -> None:
    """The placement of smallest torque lets it fall shut; a random placement in 100,000 holds it."""
    found = la.drives(
        rocker=HATCH["rocker"],
        drives=[],
        load=HATCH["load"],
        hand_point=HATCH["hand_point"],
        springs=[POSITION | {"catalogue": [row], "holds": {"open": True, "closed": True}}],
    )
    (spring,) = found.springs
    _, lengths, torque = hatch_torque(spring, row, 50, 750, -90, 0)
    assert torque == pytest.approx(spring.curve.torque, abs=1e-3 * np.abs(torque).max())
    assert torque[0] > 0 > torque[-1]
    assert spring.holds == (True, True)
    assert row["extended"] - row["stroke"] <= lengths.min() and lengths.max() <= row["extended"]
    assert -200 <= spring.points[0][0] <= 300 and -700 <= spring.points[0][1] <= 100
    assert spring.hand_force_max == pytest.approx(np.abs(torque).max() / 1500, rel=1e-3)


def test_a_behaviour_that_no_placement_has_is_refused_with_what_is_missing() -> None:
    """A random search of 20 million placements finds none either."""
    request = POSITION | {"catalogue": [gas(1100, 905, 400)], "holds": {"open": True, "closed": True}}
    found = la.drives(rocker=HATCH["rocker"], drives=[], load=HATCH["load"], springs=[request])
    assert not found.springs
    assert "does not hold the last position (open)" in found.refused[0].reason


@pytest.mark.parametrize("catalogue", some_of([[gas(4, 60, 25), gas(9, 70, 30)], None], 1))
def test_every_pair_of_links_is_tried(catalogue: Any) -> None:
    """Ground to crank leaves 136 % of this mechanism's torque."""
    request: dict[str, Any] = {"kind": "gas"} if catalogue is None else {"kind": "gas", "catalogue": catalogue}
    pairs = [
        ("ground", "crank"),
        ("ground", "coupler"),
        ("ground", "rocker"),
        ("crank", "coupler"),
        ("crank", "rocker"),
    ]
    left = []
    for pair in pairs:
        found = la.drives(MECHANISM, [], load=MASSES, crank_angle=[0, 90], springs=[request | {"between": pair}])
        assert bool(found.springs) != bool(found.refused)
        left += [found.springs[0].torque.after.rms] if found.springs else []
    free = la.drives(MECHANISM, [], load=MASSES, crank_angle=[0, 90], springs=[request])
    if left:
        assert free.springs[0].torque.after.rms <= min(left) * (1 + 1e-6)
        assert len(free.springs) == 1 or free.springs[0].torque.after.rms < min(left)
    for spring in free.springs:
        assert spring.torque.after.rms <= 0.5 * spring.torque.before.rms


def work_of(found: la.Drives, spring: Any) -> Any:
    """Work that the drive gives because of the spring, up to each second position, by Simpson's rule."""
    torque = spring.curve.torque - found.torque.torque
    step = np.deg2rad(found.torque.crank_angle[1] - found.torque.crank_angle[0])
    return np.cumsum(step / 3 * (torque[:-2:2] + 4 * torque[1:-1:2] + torque[2::2]))


LID = {"pivot": [0, 0], "start": 10, "swing": 80, "length": 300}
LID_LOAD = {"masses": [{"link": "rocker", "mass": 1.5, "centre": [150, 0]}]}


def test_a_torsion_spring_is_mounted_with_the_best_twist() -> None:
    """Against 20,001 mounting twists in both directions, and by its energy."""
    row = {"name": "own", "rate": 12, "preload": 100, "angle_max": 200}
    found = la.drives(
        rocker=LID, drives=[], load=LID_LOAD, springs=[{"kind": "torsion", "catalogue": [row], "count": 2}]
    )
    (spring,) = found.springs
    angles = np.deg2rad(found.torque.crank_angle)
    weight = 1.5 * 9.81 * 150 * np.cos(np.deg2rad(10) + angles)
    assert found.torque.torque == pytest.approx(weight, rel=1e-9)
    rate, best = 2 * 12 * 180 / np.pi, np.inf
    for direction in (1, -1):
        change = direction * angles
        for mounted in np.linspace(-change.min(), np.deg2rad(200) - change.max(), 20_001):
            left = weight + direction * (200 + rate * (mounted + change))
            best = min(best, float(np.sqrt(np.mean(left**2))))
    assert spring.torque.after.rms == pytest.approx(best, rel=1e-6) and spring.torque.after.rms < best * (1 + 1e-9)
    assert spring.direction == -1 and spring.point == (0, 0) and spring.count == 2
    twist = np.deg2rad(spring.curve.twist)
    energy = 200 * twist + rate * twist**2 / 2
    assert work_of(found, spring) == pytest.approx(energy[2::2] - energy[0], rel=1e-9)
    assert spring.curve.moment == pytest.approx(100 + 12 * spring.curve.twist)
    assert 0 <= spring.twist[0] < spring.twist[1] <= 200


@pytest.mark.parametrize("kind", ["tension", "compression", "torsion"])
def test_a_lid_without_weight_is_held_shut_with_a_force(kind: str) -> None:
    """A hand at its edge must give at least this force to leave the stop; no length leaves its range between positions."""
    wish = {"kind": kind, "holds": {"closed": True, "force_min": 4}}
    wish |= {"catalogue": "tension_springs"} if kind == "tension" else {}
    found = la.drives(rocker=LID, drives=[], springs=[wish])
    (spring,) = found.springs
    assert any("buckling" in note for note in found.notes) == (kind == "compression")
    assert spring.holds.closed and spring.curve.torque[0] >= 4 * 300 * (1 - 1e-5)
    assert spring.curve.hand_force[0] == pytest.approx(spring.curve.torque[0] / 300)
    if kind != "torsion":
        pin, ground = (complex(*spring.points_on_links[k]) for k in (1, 0))
        lengths = np.abs(pin * np.exp(1j * np.deg2rad(np.linspace(10, 90, 20_001))) - ground)
        assert spring.length == pytest.approx((lengths.min(), lengths.max()), rel=1e-9)
        pull = spring.preload + spring.stiffness * (lengths - spring.free_length)
        assert np.all(pull * (1 if kind == "tension" else -1) >= -1e-6 * np.abs(pull).max())
