"""Springs balance in every position, and their torque is the derivative of their energy.

A fitted spring that leaves its range of lengths would show here.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthesis.drives.links import motions_of
from synthesis.drives.spring_search import SpringSearch
from synthesis.drives.springs import Spring, SpringRegion, SpringRow
from synthesis.link_motion import Mass
from synthesis.studies.forces import Load
from synthesis.target import Interval
from tests.oracles.driven_cases import random_linkage

KINDS = [
    SpringRow("soft", 0.5, 0.3, 0.1, 0.3, 2.5),
    SpringRow("stiff", 4.0, 0.4, 0.5, 0.4, 1.6),
    SpringRow("short", 9, 0.05, 1, 0.05, 0.06),
]


def weights(rng: np.random.Generator) -> Load:
    parts = [
        Mass(name, rng.uniform(0, 2), complex(*rng.normal(size=2))) for name in ("crank", "coupler", "rocker", "body")
    ]
    return Load(complex(*rng.normal(size=2)), 0.0, tuple(parts), complex(*rng.normal(size=2)))


@given(st.integers(0, 10_000))
def test_a_springs_torque_is_the_derivative_of_its_energy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    linkage, interval = random_linkage(rng)
    machine = motions_of(linkage, Interval(0.0, float(np.copysign(0.04, interval.last))), 201)
    first, second = rng.permutation(["ground", "crank", "coupler", "rocker"])[:2]
    points = complex(*rng.normal(size=2)) * 3, complex(*rng.normal(size=2))
    row = SpringRow("any", rng.uniform(0.1, 2), rng.uniform(0, 1), rng.normal())
    spring = Spring((str(first), str(second)), points, row)
    torque, stretch = spring.torque(machine), spring.length(machine) - row.free_length
    energy = row.preload * stretch + row.stiffness * stretch**2 / 2
    step = machine.at[1] - machine.at[0]
    measured = (energy[:-4] - 8 * energy[1:-3] + 8 * energy[3:-1] - energy[4:]) / (12 * step)
    size = np.abs(torque).max() + np.abs(energy).max()
    assert measured == pytest.approx(torque[2:-2], abs=1e-6 * max(size, 1.0) * 100)


@pytest.mark.parametrize("seed", range(6))
def test_a_fitted_spring_helps_and_keeps_its_lengths_and_places(seed: int) -> None:
    rng = np.random.default_rng(seed)
    linkage, interval = random_linkage(rng)
    machine, load = motions_of(linkage, interval), weights(rng)
    torque = machine.torque(load)
    room = SpringRegion((-3.0, -3.0, 3.0, 3.0), 1.2, 0.1)
    between = [("ground", "crank"), ("ground", "coupler"), ("crank", "rocker")][seed % 3]
    spring = SpringSearch(machine, KINDS, room).best(torque, [between])
    if isinstance(spring, str):
        assert "no spring of 3 fits" in spring
        return
    kind, length = spring.row, spring.length(machine)
    assert kind.shortest <= length.min()
    assert length.max() <= kind.longest
    assert abs(spring.points[1]) <= 1.2 + 1e-6
    if between[0] == "ground":
        assert max(abs(spring.points[0].real), abs(spring.points[0].imag)) <= 3 + 1e-6
        assert (
            min(abs(spring.points[0] - fixed_pivot) for fixed_pivot in (linkage.pivot_a, linkage.pivot_b))
            >= 0.1 - 1e-6
        )
    # no random place within the room does better by more than a little
    rms = np.sqrt(np.mean((torque + spring.torque(machine)) ** 2))
    for _ in range(300):
        ends = complex(*rng.uniform(-3, 3, 2)), complex(*rng.uniform(-0.8, 0.8, 2))
        if between[0] != "ground":
            ends = complex(*rng.uniform(-0.8, 0.8, 2)), ends[1]
        wish = KINDS[rng.choice(len(KINDS))]
        trial = Spring(between, ends, wish)
        lengths = trial.length(machine)
        if lengths.min() >= wish.shortest and lengths.max() <= wish.longest:
            clear = between[0] != "ground" or min(abs(ends[0] - p) for p in (linkage.pivot_a, linkage.pivot_b)) >= 0.1
            if clear and min(map(abs, ends[1:])) >= 0.1:
                assert rms <= np.sqrt(np.mean((torque + trial.torque(machine)) ** 2)) * 1.02
