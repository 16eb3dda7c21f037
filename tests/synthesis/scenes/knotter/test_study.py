"""Verdicts, margins and limits: against a naive twin of matrices and a fine scan, and the laws they obey."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from synthesis.errors import FieldError
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import (
    Clearance,
    Found,
    inside_windows,
    segment_triangle_distance,
)
from synthesis.scenes.knotter.events import Events
from synthesis.scenes.knotter.mechanism import (
    ANGLES,
    Chain,
    Linear,
    Mechanism,
    Shift,
    Table,
    Turn,
    dimensions,
    varied,
)
from synthesis.scenes.knotter.study import solve, spread, study
from tests.oracles.knotter import Twin


def made(twin: Twin) -> Mechanism:
    """The product's mechanism of a random knotter."""
    laws = {
        "beta": Linear(twin.lead, twin.ratio) if twin.kind == "lead" else Table(*twin.rows, twin.kind, "error"),
        "alpha4": Table(*twin.hook),
    }
    return d_knotter.mechanism(twin.size, twin.sense, laws, twin.points)


WINDOWS = {"wrap": d_knotter.WRAP_WINDOW, "bite": d_knotter.BITE_WINDOW}


@cache
def scanned(seed: int, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The driver of a fine scan, whether the rope is inside, and where that begins."""
    alpha = np.linspace(*WINDOWS[name], 6001)
    inside = np.all(Twin(seed).shares(name, alpha) > 0, axis=-1)
    return alpha, inside, np.flatnonzero(inside & ~np.append(False, inside[:-1]))


@cache
def evaluated(seed: int, name: str):
    """What the product finds; once for all tests that ask about it."""
    return getattr(d_knotter, name)().evaluate(made(Twin(seed)), 1)


def case(seed: int, name: str) -> str:
    """What a fine scan sees; the product sees as many windows."""
    _, _, starts = scanned(seed, name)
    assert evaluated(seed, name).windows[0] == len(starts), seed
    return "never" if not len(starts) else "starts inside" if starts[0] == 0 else "enters"


@pytest.fixture(scope="module")
def cases() -> dict[tuple[str, str], list[int]]:
    """The seeds of each condition by what happens."""
    found = {}
    for name in WINDOWS:
        for seed in (*range(30), 59):
            found.setdefault((name, case(seed, name)), []).append(seed)
    return found


@pytest.mark.parametrize("name", WINDOWS)
def test_entry_is_where_the_naive_twin_finds_it(name: str, cases) -> None:
    assert len(cases[name, "enters"]) >= 5
    for seed in cases[name, "enters"]:
        twin, condition = Twin(seed), getattr(d_knotter, name)()
        found = evaluated(seed, name)
        alpha, inside, starts = scanned(seed, name)
        low, high = alpha[starts[0] - 1], alpha[starts[0]]
        # The share that becomes positive last is the one that opens the window.
        roots = {}
        for share in np.flatnonzero(twin.shares(name, low) <= 0):
            value = lambda at, share=share, twin=twin: twin.shares(name, np.float64(at))[share]  # noqa: E731
            roots[share] = brentq(value, low, high, xtol=1e-15, rtol=1e-15)
        opened, enter = max(roots.items(), key=lambda row: row[1])
        assert np.degrees(found.enter[0] - enter) == pytest.approx(0.0, abs=1e-9)
        assert found.opened_by[0] == (2, 3, 4, 0, 1)[opened]
        assert found.holds[0] == (opened == condition.enter)
        p, q, *_ = twin.corners(name, np.float64(enter))
        t = twin.shares(name, np.float64(enter))[3]
        assert found.point[0] == pytest.approx(p + t * (q - p), abs=1e-9)
        # It leaves in the step after the last one inside, or stays until the range ends.
        last = starts[0] + np.argmin(np.append(inside[starts[0] :], False)) - 1
        assert alpha[last] - 1e-12 <= found.leave[0] <= alpha[min(last + 1, len(alpha) - 1)] + 1e-12


@pytest.mark.parametrize("name", WINDOWS)
def test_rope_that_never_enters_or_is_inside_from_the_start(name: str, cases) -> None:
    assert cases[name, "never"]
    for seed in cases[name, "never"]:
        found = evaluated(seed, name)
        assert found.found[0] == Found.NEVER and not found.holds[0] and found.margin[0] <= 0
    assert cases[name, "starts inside"]
    for seed in cases[name, "starts inside"]:
        found = evaluated(seed, name)
        assert found.found[0] == Found.INSIDE_AT_START and found.enter[0] == WINDOWS[name][0]


@pytest.mark.parametrize("locked", [True, False])
@pytest.mark.parametrize("radius", [np.inf, 60.0, 20.0])
@pytest.mark.parametrize("seed", range(12))
def test_worst_clearance_is_no_better_than_a_fine_scan(seed: int, radius: float, locked: bool) -> None:
    twin = Twin(seed)
    condition = d_knotter.clearance(radius=radius, jaw_locked=locked)
    found = condition.evaluate(made(twin), 1)
    alpha = np.linspace(*condition.over, 40_001)

    def depth(at: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(twin.hook_depth(at, locked), -1, 0)
        if np.isinf(radius):
            return y
        across = np.hypot(x, z) - radius
        outside = np.hypot(np.maximum(across, 0), np.maximum(-y, 0))
        return np.where((across < 0) & (y > 0), np.minimum(y, -across), -outside)

    scanned = depth(alpha).max()
    assert scanned - 1e-9 <= found.worst[0] <= scanned + 1e-2
    assert depth(found.worst_driver)[0] == pytest.approx(found.worst[0], abs=1e-9)
    assert depth(np.array([condition.at]))[0] == pytest.approx(found.value[0], abs=1e-9)
    assert found.holds[0] == (found.worst[0] < 0) and found.margin[0] == -found.worst[0]


def test_deepest_place_in_a_disc_may_be_a_corner() -> None:
    """A point on a circle beside the rim: deeper past the plane and nearer to the rim at once; solved by hand."""
    chains = (Chain("arm", "disc", (Turn("k", "driver"), Shift(i=15.0))),)
    arm = Mechanism({}, {}, chains, {"tip": ("arm", (10.0, 0.0, 0.0))})
    condition = Clearance("clear", "tip", "disc", 1, -1, 0.0, (0.0, np.pi), radius=20.0)
    found = condition.evaluate(arm, 1)
    # The tip is 10 sin behind the plane and 5 - 10 cos inside the rim: equal where sin + cos = 1/2.
    angle = np.pi - np.arcsin(0.5 / np.sqrt(2)) - np.pi / 4
    assert found.worst_driver[0] == pytest.approx(angle, abs=1e-12)
    assert found.worst[0] == pytest.approx(10 * np.sin(angle), abs=1e-11)


def test_an_event_of_no_width_does_not_split_a_window() -> None:
    def always_inside(driver: np.ndarray, item: np.ndarray) -> np.ndarray:
        return np.array([1.0, -1.0, 1.0, 1.0, 1.0])[:, None] * np.ones_like(driver)

    touch = Events(np.array([0, 0, 0]), np.array([2, 2, 3]), np.array([0.5, 0.5, 0.7]))
    item, start, end, opened_by = inside_windows(always_inside, touch, np.array([0.0, 1.0]), 1, np.array([True]))
    assert (list(item), list(start), list(end), list(opened_by)) == ([0], [0.0], [1.0], [-1])


def test_an_item_does_not_know_its_neighbours() -> None:
    """Also across chunks: 40 x 40 items are several chunks."""
    grid = {"alpha1": np.linspace(-0.2, 0.6, 40), "alpha3": np.linspace(0.1, 0.7, 40)}
    whole = study(d_knotter.mechanism(), grid, d_knotter.conditions())
    for index in (0, 777, 1599):
        point = {name: values[index : index + 1] for name, values in whole.grid.items()}
        alone = study(d_knotter.mechanism(), point, d_knotter.conditions())
        for name, result in alone.conditions.items():
            for field in result.__dataclass_fields__:
                many = np.asarray(getattr(whole.conditions[name], field)[index], float)
                one = np.asarray(getattr(result, field)[0], float)
                assert many == pytest.approx(one, rel=1e-9, abs=1e-9, nan_ok=True), (name, field)


@settings(derandomize=True, max_examples=6, deadline=None)
@given(st.integers(0, 500), st.integers(-30, 30))
def test_the_unit_of_length_changes_no_angle(seed: int, power: int) -> None:
    twin, scale = Twin(seed), 2.0**power
    size = {name: value if name.startswith("alpha") else value * scale for name, value in twin.size.items()}
    points = {name: tuple(scale * x for x in point) for name, point in twin.points.items()}
    scaled = d_knotter.mechanism(size, twin.sense, made(twin).laws, points)
    for condition in d_knotter.conditions():
        one, other = condition.evaluate(made(twin), 1), condition.evaluate(scaled, 1)
        assert one.holds[0] == other.holds[0]
        assert other.margin[0] == pytest.approx(scale * one.margin[0], rel=1e-9, abs=1e-9 * scale)
        if condition.name != "clearance":
            assert one.enter == pytest.approx(other.enter, abs=1e-13, nan_ok=True)


def test_closest_approach_is_the_distance_of_a_dense_scan(cases) -> None:
    condition = d_knotter.wrap()
    assert len(cases["wrap", "never"]) >= 10
    for seed in cases["wrap", "never"][:20]:
        machine = made(Twin(seed))
        found = evaluated(seed, "wrap")
        alpha = np.linspace(*condition.window, 20_001)
        dense = segment_triangle_distance(*condition.positions(machine, alpha)).min()
        assert dense - 5e-3 <= -found.margin[0] <= dense + 1e-9


def test_condition_number_is_the_shift_of_the_event() -> None:
    """Moving S3 and S4 by h across their edge moves the entry by h times the sensitivity."""
    at = {"alpha1": np.radians(10.0), "alpha3": np.radians(25.0)}
    before = d_knotter.wrap().evaluate(d_knotter.mechanism(at), 1)
    (_, y3, z3), (_, y4, z4) = (d_knotter.POINTS[name] for name in ("S3", "S4"))
    across = np.array([z4 - z3, y3 - y4]) / np.hypot(z4 - z3, y3 - y4)
    moved = {name: (0.0, *(np.array(d_knotter.POINTS[name][1:]) + 1e-6 * across)) for name in ("S3", "S4")}
    after = d_knotter.wrap().evaluate(d_knotter.mechanism(at, points=moved), 1)
    assert abs(after.enter[0] - before.enter[0]) == pytest.approx(1e-6 * before.sensitivity[0], rel=1e-4)


def test_limits_are_found_on_both_sides() -> None:
    machine = d_knotter.mechanism({"alpha1": np.radians(10.0)})
    limits, starts = solve(machine, d_knotter.bite(), "alpha3", (0.0, 1.2))
    assert not starts and [limit.holds_above for limit in limits] == [True, False]
    for limit in limits:
        assert limit.result.holds[0]
        beyond = limit.value + (-1e-13 if limit.holds_above else 1e-13)
        assert not d_knotter.bite().evaluate(machine.with_parameters(alpha3=beyond), 1).holds[0]


# What cannot be answered


def test_a_rope_end_in_the_triangles_plane_never_crosses() -> None:
    found = d_knotter.wrap().evaluate(d_knotter.mechanism(points={"S1": (0.0, 14.0, -39.0)}), 1)
    assert found.found[0] == Found.ALWAYS_IN_PLANE and not found.holds[0] and found.windows[0] == 0
    tilted = {"S3": (1.0, 16.0, -12.0), "S4": (3.0, 8.0, -28.0), "S5": (-2.0, 0.0, 0.0)}
    a, b, c = (np.array(tilted[name]) for name in ("S3", "S4", "S5"))
    rope_end = tuple(a + 1.7 * (b - a) + 0.4 * (c - a))
    found = d_knotter.wrap().evaluate(d_knotter.mechanism(points={**tilted, "S1": rope_end}), 1)
    assert found.found[0] == Found.ALWAYS_IN_PLANE


def test_empty_grid_and_too_much_work_are_refused() -> None:
    with pytest.raises(FieldError, match="empty"):
        study(d_knotter.mechanism(), {"alpha1": []}, d_knotter.conditions())
    fast = d_knotter.mechanism(laws={"beta": Linear(0.0, 900.0)})
    with pytest.raises(FieldError, match="pieces"):
        study(fast, {"alpha1": np.zeros(1000)}, d_knotter.conditions())


# Within tolerances

CONDITIONS = {condition.name: condition for condition in d_knotter.conditions()}


@pytest.fixture(scope="module")
def machine():
    return d_knotter.mechanism().with_parameters(alpha1=math.radians(10), alpha3=math.radians(25))


def box(machine, length: float, degrees: float) -> dict[str, float]:
    names = (name for name in dimensions(machine) if not name.endswith("ratio"))
    return {name: math.radians(degrees) if name in ANGLES else length for name in names}


@pytest.fixture(scope="module")
def found(machine):
    return spread(machine, CONDITIONS, box(machine, 0.1, 0.1), 50, 7)


def margin(machine, name, changes) -> float:
    known = dimensions(machine)
    moved = varied(machine, {key: known[key] + change for key, change in changes.items()})
    return float(CONDITIONS[name].evaluate(moved, 1).margin[0])


@pytest.mark.parametrize("name", CONDITIONS)
def test_corner_and_sensitivities_are_those_of_machines_made_one_by_one(name, machine, found) -> None:
    one, tolerances = found[0][name], box(machine, 0.1, 0.1)
    assert one.margin == margin(machine, name, {}) > 0
    for key in list(tolerances)[::5]:
        step = 1e-4 * tolerances[key]
        slope = (margin(machine, name, {key: step}) - margin(machine, name, {key: -step})) / (2 * step)
        assert one.sensitivity[key] == pytest.approx(slope, rel=2e-3, abs=1e-6), key
    worst = {key: -math.copysign(tolerances[key], one.sensitivity[key]) for key in tolerances if one.sensitivity[key]}
    assert one.corner == pytest.approx(margin(machine, name, worst), abs=1e-12)
    assert one.corner == pytest.approx(one.linear, abs=0.15)
    assert one.corner <= one.least <= one.margin
    edge = {key: one.factor * change for key, change in worst.items()}
    assert margin(machine, name, edge) == pytest.approx(0, abs=1e-6) and one.factor > 1


def test_wide_tolerances_break_the_knot_and_samples_tell_how_often(machine) -> None:
    tolerances = box(machine, 0.5, 0.5)
    wide, share = spread(machine, CONDITIONS, tolerances, 50, 1)
    assert any(one.corner < 0 for one in wide.values()) and 0.5 < share < 1
    known, random = dimensions(machine), np.random.default_rng(1)
    draws = random.uniform(-1, 1, (4, len(tolerances)))
    holds = []
    for draw in draws:
        moved = varied(machine, {key: known[key] + x * half for x, (key, half) in zip(draw, tolerances.items())})
        holds.append(all(condition.evaluate(moved, 1).holds[0] for condition in CONDITIONS.values()))
    again, part = spread(machine, CONDITIONS, tolerances, 4, 1)
    assert part == np.mean(holds) and again["wrap"].margin == wide["wrap"].margin


def test_a_knot_that_fails_as_it_is_has_no_factor() -> None:
    machine = d_knotter.mechanism().with_parameters(alpha1=0.0, alpha3=math.radians(20))
    one = spread(machine, {"wrap": d_knotter.wrap()}, box(machine, 0.1, 0.1), 20, 0)[0]["wrap"]
    assert one.margin < 0 and one.factor is None and one.share == 0
