"""Requests that many windows, or all, meet alike: answered in order, without evaluating them, in bounded memory and time."""

import numpy as np
import pytest

from synthesis.atlas import scan as descent_module
from synthesis.atlas import scan as scan_module
from synthesis.atlas import windows as windows_module
from synthesis.atlas.scan import STARTS, Scan
from synthesis.atlas.table import AtlasRule
from synthesis.atlas.windows import TIE, BestWindows, Numbering, Windows, lowest, lowest_steps
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.pose import objective
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.conftest import make_atlas

WHOLE_TURNS = {
    "even": {"rotation": np.arange(5.0), "crank_span": 8 * np.pi},
    "far apart": {"rotation": np.deg2rad([0.0, 100, -50]), "crank_span": 20 * np.pi},
    "clockwise": {"rotation": np.array([3.0, 1, 4, 1, 5]), "crank_span": -8 * np.pi},
    "uneven": {"rotation": np.array([0.0, 7, 6]), "crank_angle": np.deg2rad([90.0, 450, 3330])},
    "that of the crank": {"rotation": np.array([0.0, 2 * np.pi, 4 * np.pi]), "crank_span": 4 * np.pi},
    "weighted": {
        "rotation": np.arange(5.0),
        "crank_angle": np.deg2rad([0.0, 100, 360, 720, 1000]),
        "rotation_weights": np.array([1.0, 0, 2, 1, 0]),
    },
}


@pytest.fixture(scope="module")
def scan() -> Scan:
    return Scan(make_atlas(AtlasRule(TypeRule(60, 8, OrderRule.FULL_CRANK), 32)))


def in_order(scan: Scan, target: Target) -> np.ndarray:
    """All windows sorted by error in steps of a tie, stably, from the order that breaks ties."""
    row, start, branch = np.meshgrid(np.arange(len(scan.lengths)), np.arange(STARTS), [1, -1], indexing="ij")
    errors = scan.errors(target, Windows(row.ravel(), start.ravel(), branch.ravel(), np.zeros(row.size)))
    return np.argsort(np.round(errors / TIE), kind="stable")


def assert_best(order: np.ndarray, found: Windows) -> None:
    """The windows found are these."""
    assert np.array_equal(found.row, order // (2 * STARTS))
    assert np.array_equal(found.start, order // 2 % STARTS)
    assert np.array_equal(found.branch, np.where(order % 2, -1, 1))


@pytest.mark.parametrize("kind", WHOLE_TURNS)
def test_samples_whole_turns_apart_are_answered_in_order_and_at_once(kind, scan) -> None:
    target = make_target(**WHOLE_TURNS[kind])
    order = in_order(scan, target)
    for top in (1, 30, 1000):
        found, report = scan.best(target, top)
        assert_best(order[:top], found)
        assert report.exhaustive and report.evaluated <= 4 * top + 8


@pytest.mark.parametrize("samples", [3, 7, 12])
def test_a_path_that_every_window_meets_is_answered_in_order_and_at_once(samples, scan) -> None:
    # any three positions; or the crank pin's own circle
    crank = np.linspace(0, 1, samples)
    path = np.exp(1j * crank) if samples > 3 else np.array([0, 1 + 0.3j, 1.5 + 2j])
    target = make_target(None, path, crank_angle=crank)
    found, report = scan.best(target, 20)
    assert_best(in_order(scan, target)[:20], found)
    assert report.exhaustive and report.evaluated <= 100


def test_positions_whole_turns_apart_are_refused() -> None:
    for field, crank in (("crank_span", 4 * np.pi), ("crank_angle", np.array([0, 2, 4]) * np.pi)):
        with pytest.raises(FieldError, match="whole turns apart") as error:
            make_target(np.arange(3.0), np.array([0, 1, 1j]), **{field: crank})
        assert error.value.field == f"/{field}"


@pytest.mark.parametrize(("kind", "held"), [("rotation", 64), ("position", 1000), ("both", 64)])
def test_more_windows_than_may_be_held_are_evaluated_one_by_one(kind, held, scan, monkeypatch) -> None:
    monkeypatch.setattr(scan_module, "_MOST_HELD", held)
    monkeypatch.setattr(scan_module, "_COUNT_BELOW", 64)
    monkeypatch.setattr(scan_module, "_FIRST_COUNT", 64)
    most = []
    plain = windows_module.lowest
    sized = lambda numbering, ids, *more: most.append(ids.size) or plain(numbering, ids, *more)  # noqa: E731
    monkeypatch.setattr(descent_module, "lowest", sized)
    # next to no motion at all, which no bound of a series resolves
    crank = np.linspace(0, np.deg2rad(0.2), 6)
    path = 1e-3 * np.exp(3j * crank)
    rotation = 1e-9 * np.cos(5000 * crank)
    asked = rotation if kind != "position" else None, path if kind != "rotation" else None
    target = make_target(*asked, crank_angle=crank)
    found, report = scan.best(target, 12)
    assert report.exhaustive
    assert_best(in_order(scan, target)[:12], found)
    block = 64 * 2 * STARTS
    assert max(most) <= 5 * max(held, 64) + block


def test_tied_bounds_are_kept_in_order() -> None:
    numbering, random = Numbering(STARTS), np.random.default_rng(3)
    ids = random.permutation(4 * 2 * STARTS)
    bounds = np.where(random.random(ids.size) < 0.9, 0.0, random.random(ids.size))
    for count in (1, 10, 2000, ids.size, 2 * ids.size):
        keep, first_left = lowest(numbering, ids, bounds, count)
        order = np.lexsort((numbering.ranks(ids), lowest_steps(bounds)))
        assert set(keep) == set(order[:count])
        if count < ids.size:
            left = order[count]
            assert first_left == (lowest_steps(bounds[[left]])[0], numbering.ranks(ids[[left]])[0])


def test_a_bound_that_rounding_lifts_above_its_error_excludes_nothing() -> None:
    errors = np.concatenate([[0.0], 10.0 ** np.arange(-13, 8), (np.arange(20) + 0.5) * TIE])
    for lifted in (errors, errors * (1 + 2e-15) + 1e-15):
        assert np.all(lowest_steps(lifted) <= np.round(errors / TIE))


def test_the_search_stops_where_as_many_as_are_wanted_are_good_enough(scan) -> None:
    crank = np.linspace(0, 1, 9)
    target = make_target(coupler_angle(scan.lengths[7], 1, 1 + crank) + 0.01 * np.cos(9 * crank), crank_angle=crank)
    _, whole = scan.best(target, 10)
    found, report = scan.best(target, 10, enough=1.0)
    assert found.error.max() <= 1.0 and found.row.size == 10
    assert whole.exhaustive and report.evaluated <= whole.evaluated


@pytest.mark.parametrize("kind", ["rotation", "position"])
@pytest.mark.parametrize("budget", [1.5, 3.5, 9.5])
def test_little_more_is_evaluated_once_the_time_is_up(kind, budget, scan) -> None:
    """Whatever it is about, between two looks at the clock lies at most one evaluation of some 100,000 samples."""
    random = np.random.default_rng(4)
    noise = random.normal(size=500)
    asked = (noise, None) if kind == "rotation" else (None, noise + 1j * random.normal(size=500))
    target, after, readings = make_target(*asked, 5.0), [], []
    work = Work(budget, clock=lambda: readings.append(1) or float(len(readings)))

    def exact(windows: Windows) -> np.ndarray:
        if len(readings) > budget + 1:
            after.append(windows.row.size)
        return objective(target, scan.angles(target, windows))

    found, report = scan.best(target, 40, exact, work=work)
    assert (budget > 5 or not report.exhaustive) and found.row.size
    assert sum(after) * 500 <= 3 * scan_module._EXACT_SAMPLES


def test_the_best_evaluate_no_more_at_once_than_they_are_told() -> None:
    sizes: list[int] = []

    def exact(windows: Windows) -> np.ndarray:
        sizes.append(windows.row.size)
        return 1.0 + windows.start

    best = BestWindows(5, Numbering(STARTS), exact, 100, lambda: False)
    best.consider(np.arange(3000), np.zeros(3000))
    assert max(sizes) <= 100 and best.windows.start.max() < 5
