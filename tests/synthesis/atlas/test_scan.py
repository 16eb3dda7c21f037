"""The exact scan against its twin that evaluates every window and sorts them all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count, product

import numpy as np
import pytest

from synthesis.atlas import cells as scan_cells
from synthesis.atlas import scan as scan_module
from synthesis.atlas.cells import Cells, Phasors
from synthesis.atlas.preparation import Preparation
from synthesis.atlas.scan import KIND, STARTS, Arcs, Descent, Matrices, Scan
from synthesis.atlas.table import AtlasRule, Table
from synthesis.atlas.windows import TIE, Windows
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.pose import objective
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.conftest import make_atlas, some_of
from tests.oracles import naive

ATLASES = {
    "increasing": AtlasRule(TypeRule(70, 9, OrderRule.INCREASING), 64),
    "crank_shortest": AtlasRule(TypeRule(52, 8, OrderRule.CRANK_SHORTEST), 32),
    "full_crank": AtlasRule(TypeRule(52, 8, OrderRule.FULL_CRANK), 32),
    "coarse": AtlasRule(TypeRule(46, 7, OrderRule.FULL_CRANK), 16),
}
"""From 42 to 84 types each: most of the time goes to the twin, and each has series with and without a second level of cells."""
OWN = {name: getattr(scan_cells, name) for name in ("LEAF", "FEWEST")}
"""The product's own thresholds: how many types a cell has, and how many make cells at all."""
KINDS = ("rotation", "both", "position")
AT_ONCE = 1 << 11
"""Windows that the twin evaluates together: few enough to stay in a core's cache."""


@dataclass
class Bounds:
    """The bounds of windows that a scan of a table rests on, made from its parts."""

    prepared: Preparation

    @classmethod
    def of(cls, table: Table) -> Bounds:
        return cls(Preparation(table.mechanism, lambda: table, KIND))

    @property
    def cells(self) -> list[Cells]:
        return self.prepared.cells

    @property
    def phasors(self) -> list[Phasors]:
        assert self.prepared.prepare_positions(Work())
        return self.prepared.phasors

    def below(self, target: Target, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (as of `every_window`, see `place_of`) and bounds of all windows that a limit leaves."""
        phasors = [None] * len(self.cells) if target.position is None else self.phasors
        harmonics = [cells.group.harmonics for cells in self.cells] + [p.harmonics for p in phasors if p is not None]
        arcs, matrices = Arcs(target, STARTS), Matrices(target, 2 * max(harmonics), STARTS)
        parts = [Descent(cells, arcs, matrices, known) for cells, known in zip(self.cells, phasors)]
        found = [batch(limit) for part in parts for batch in part.batches(limit)[0]]
        found = [(np.empty(0, dtype=np.int64), np.empty(0)), *filter(None, found)]
        ids, bounds = (np.concatenate(column) for column in zip(*found))
        return place_of(ids), bounds


def place_of(ids: np.ndarray) -> np.ndarray:
    """Places in `every_window` of window numbers: type by type, all starts of branch +1, then of branch -1."""
    row, window = np.divmod(ids, 2 * STARTS)
    side, start = np.divmod(window, STARTS)
    return (row * STARTS + start) * 2 + side


@pytest.fixture(scope="module", autouse=True)
def small_cells() -> Iterator[None]:
    """Cells of several levels although the atlases are small enough for the twin."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan_cells, "LEAF", 3)
        patch.setattr(scan_cells, "FEWEST", 1)
        yield


@pytest.fixture(scope="module")
def scans(small_cells) -> dict[str, Scan]:
    return {name: Scan(make_atlas(rule)) for name, rule in ATLASES.items()}


@pytest.fixture(scope="module")
def bounds_of(small_cells) -> dict[str, Bounds]:
    return {name: Bounds.of(make_atlas(rule)) for name, rule in ATLASES.items()}


def every_window(scan: Scan) -> Windows:
    """All windows in the order that breaks ties: number, start, branch +1 before -1."""
    row, start, branch = np.meshgrid(np.arange(len(scan.lengths)), np.arange(STARTS), [1, -1], indexing="ij")
    return Windows(row.ravel(), start.ravel(), branch.ravel(), np.zeros(row.size))


def naive_scan(scan: Scan, target: Target, top: int) -> tuple[Windows, Windows]:
    """The best ``top`` windows by evaluating and sorting all, and all of them."""
    windows = every_window(scan)
    errors = []
    for first in range(0, windows.row.size, AT_ONCE):
        part = windows.take(np.arange(first, min(first + AT_ONCE, windows.row.size)))
        crank = np.deg2rad(part.start)[:, None] + target.crank
        errors.append(objective(target, coupler_angle(scan.lengths[part.row], part.branch, crank)))
    windows = windows._replace(error=np.concatenate(errors))
    order = np.argsort(np.round(windows.error / TIE), kind="stable")
    return windows.take(order[:top]), windows


def random_target(scan: Scan, rng: np.random.Generator, kind: str, reachable: bool, weighted: bool = False) -> Target:
    """A motion of some type of the atlas, or of nothing at all; samples weighed and some missing, or all alike."""
    samples = int(8 ** rng.uniform(1, 2))
    span = rng.choice([1, -1]) * np.deg2rad(rng.uniform(10, 350))
    crank = np.linspace(0, span, samples)
    if rng.random() < 0.4:
        crank[1:-1] += rng.uniform(-0.4, 0.4, samples - 2) * span / samples
    start = np.deg2rad(rng.integers(360))
    lengths = scan.lengths[rng.integers(len(scan.lengths))]
    theta2 = coupler_angle(lengths, rng.choice([1, -1]), start + crank)
    rotation = theta2 + rng.uniform(-9, 9)
    z1, z2, pivot = rng.normal(size=3) + 1j * rng.normal(size=3)
    position = pivot + z1 * np.exp(1j * crank) + z2 * np.exp(1j * theta2)
    if not reachable:
        wave = rng.normal(size=4) @ np.sin(np.outer(np.arange(1, 5), 2 * crank / span))
        rotation = rng.uniform(0.01, 1) * wave + rng.choice([0, 1]) * crank
        position = position * (1 + 0.3 * wave * rng.random())
    angle = crank + rng.uniform(-3, 3)

    def weights() -> np.ndarray | None:
        return rng.uniform(0.1, 3, samples) * (rng.random(samples) < 0.7) + 0.01 * (np.arange(samples) % 3 == 0)

    return make_target(
        rotation if kind != "position" else None,
        position if kind != "rotation" else None,
        crank_angle=angle,
        rotation_weights=weights() if weighted and kind != "position" else None,
        position_weights=weights() if weighted and kind != "rotation" else None,
    )


def check_scan(scan: Scan, bounds_of: Bounds, target: Target, tops: tuple[int, ...]) -> None:
    """The scan's answers are the twin's, and the bounds that its proof rests on hold."""
    sorted_windows, everything = naive_scan(scan, target, max(tops))
    for top in tops:
        wanted = sorted_windows.take(np.arange(top))
        found, report = scan.best(target, top)
        assert report.exhaustive and report.windows == scan.windows == everything.row.size
        for column in ("row", "start", "branch"):
            assert np.array_equal(getattr(found, column), getattr(wanted, column)), column
        assert np.allclose(found.error, wanted.error, rtol=0, atol=TIE)

    # no window's bound is above its exact error
    # ... and, whatever the limit is, every window that it does not exclude is found, and once
    for share in (1e-4, 1e-2, 0.1, 1):
        limit = np.inf if share == 1 else np.quantile(everything.error, share)
        place, bounds = bounds_of.below(target, limit)
        assert np.unique(place).size == place.size and np.all(bounds <= limit)
        assert np.all(bounds <= everything.error[place] + 1e-15)
        assert set(np.flatnonzero(everything.error <= limit)) <= set(place)


FEW = [(kind, perimeter) for k in range(3) for kind, perimeter in zip(KINDS[k:] + KINDS[:k], (20, 24, 32))]


@pytest.mark.parametrize(("kind", "perimeter"), some_of(FEW, 3))
def test_atlases_of_few_types_are_answered_by_the_product_s_own_thresholds(kind, perimeter, monkeypatch) -> None:
    """Of 12, 36 and 168 types: below, between and above the thresholds; with the index of short spans and without."""
    for name, value in OWN.items():
        monkeypatch.setattr(scan_cells, name, value)
    scan = Scan(make_atlas(AtlasRule(TypeRule(perimeter, 2, OrderRule.FULL_CRANK), 32)))
    targets = [random_target(scan, np.random.default_rng(seed), kind, reachable=seed == 0) for seed in range(2)]
    wanted = [naive_scan(scan, target, 40)[0] for target in targets]
    for by_index in (False, True):
        if by_index:
            scan.prepare_short_spans(Work())
        for target, twin in zip(targets, wanted):
            found, report = scan.best(target, 40)
            assert report.exhaustive
            assert all(np.array_equal(*pair) for pair in zip(found[:3], twin[:3]))
            np.testing.assert_allclose(found.error, twin.error, rtol=0, atol=TIE)


def cases() -> list:
    """Every atlas, kind, reach and weighting; the default run takes a quarter, each value of one with each of every other."""
    found = []
    for (i, name), (j, kind), reachable, weighted in product(
        enumerate(ATLASES), enumerate(KINDS), (True, False), (False, True)
    ):
        shown = reachable == (i + j) % 2 and weighted == (i // 2 + j) % 2
        marks = [] if shown else [pytest.mark.wide]
        names = f"{name}-{kind}-{'' if reachable else 'un'}reachable-{'weighted' if weighted else 'all alike'}"
        found.append(pytest.param(name, kind, reachable, weighted, marks=marks, id=names))
    return found


@pytest.mark.parametrize(("name", "kind", "reachable", "weighted"), cases())
def test_scan_is_that_of_all_windows(scans, bounds_of, name, kind, reachable, weighted) -> None:
    rng = np.random.default_rng([list(ATLASES).index(name), len(kind), reachable, weighted])
    target = random_target(scans[name], rng, kind, reachable, weighted)
    check_scan(scans[name], bounds_of[name], target, (1, 10, 60))


@pytest.mark.parametrize("weighted", [False, True], ids=["all alike", "weighted"])
@pytest.mark.parametrize("kind", ["rotation", "both", "position"])
def test_errors_are_those_of_the_textbook(scans, kind, weighted) -> None:
    scan, rng = scans["full_crank"], np.random.default_rng(5)
    for reachable in (True, False):
        target = random_target(scan, rng, kind, reachable, weighted)
        chosen = rng.choice(scan.windows, 100, replace=False)
        windows = every_window(scan).take(chosen)
        motion = (target.crank, target.rotation, target.position, target.length_scale)
        weights = (target.rotation_weights, target.position_weights)
        plain = [
            naive.window_error(scan.lengths[row], branch, start, *motion, *weights)
            for row, start, branch, _ in zip(*windows)
        ]
        assert scan.errors(target, windows) == pytest.approx(plain, rel=1e-6, abs=1e-9)


def test_answers_do_not_depend_on_the_series(scans) -> None:
    scan = scans["increasing"]
    target = random_target(scan, np.random.default_rng(8), "both", True)
    coarse = Scan(make_atlas(ATLASES["increasing"]), series_error=1e-2)
    assert all(np.array_equal(*pair) for pair in zip(coarse.best(target, 30)[0], scan.best(target, 30)[0]))


def test_refused_windows_are_no_answers(scans) -> None:
    scan = scans["increasing"]
    target = random_target(scan, np.random.default_rng(9), "rotation", True)

    def odd_rows(windows: Windows) -> np.ndarray:
        return np.where(windows.row % 2 == 1, scan.errors(target, windows), np.inf)

    _, everything = naive_scan(scan, target, 1)
    odd = everything.take(np.flatnonzero(everything.row % 2 == 1))
    wanted = odd.take(np.argsort(np.round(odd.error / TIE), kind="stable")[:15])
    found, _ = scan.best(target, 15, odd_rows)
    assert all(np.array_equal(*pair) for pair in zip(found[:3], wanted[:3]))
    none, report = scan.best(target, 15, lambda windows: np.full(windows.row.size, np.inf))
    assert none.row.size == 0 and report.exhaustive and report.evaluated == scan.windows
    _, cut_short = scan.best(target, 15, lambda windows: np.full(windows.row.size, np.inf), max_windows=100)
    assert not cut_short.exhaustive


def test_what_the_first_look_found_is_not_lost(scans) -> None:
    """Where most windows are refused and only a few may be evaluated, the best found so far is the answer."""
    scan = scans["full_crank"]
    target = random_target(scan, np.random.default_rng(12), "rotation", False)
    probed: list[Windows] = []

    def few(windows: Windows) -> np.ndarray:
        error = scan.errors(target, windows)
        allowed = windows.row % 50 == 7
        probed.append(windows.take(np.flatnonzero(allowed)))
        return np.where(allowed, error, np.inf)

    found, report = scan.best(target, 5, few, max_windows=64)
    assert not report.exhaustive and report.evaluated <= 64
    seen = {(row, start, branch) for part in probed for row, start, branch, _ in zip(*part)}
    assert 0 < len(seen) and found.row.size == min(5, len(seen))


def test_no_pass_forgets_the_ceiling(scans, monkeypatch) -> None:
    scan = scans["full_crank"]
    target = random_target(scan, np.random.default_rng(12), "rotation", True)
    monkeypatch.setattr(scan_module, "_COUNT_BELOW", 8)
    limits: list[float] = []
    batches = Descent.batches
    seen = lambda part, limit, *more: limits.append(limit) or batches(part, limit, *more)  # noqa: E731
    monkeypatch.setattr(Descent, "batches", seen)

    def of_few(windows: Windows) -> np.ndarray:
        return np.where(windows.row % 5 == 2, scan.errors(target, windows), np.inf)

    _, everything = naive_scan(scan, target, 1)
    rare = everything.take(np.flatnonzero(everything.row % 5 == 2))
    wanted = rare.take(np.argsort(np.round(rare.error / TIE), kind="stable")[:12])
    found, report = scan.best(target, 12, of_few)
    assert report.exhaustive and all(np.array_equal(*pair) for pair in zip(found[:3], wanted[:3]))
    assert len(limits) > 1 and np.all(np.diff(limits) <= 0)


@pytest.mark.parametrize("constant", some_of([99995.50866340027, 1e6 - 1, 0.0], 1))
def test_a_large_constant_in_the_rotation_breaks_no_bound(scans, bounds_of, constant) -> None:
    # Rounding of so large a mean leaves a mean of 6e-11, which counts for targets as short as this.
    scan = scans["increasing"]
    target = make_target(np.full(100, constant), crank_angle=np.deg2rad(np.linspace(0, 0.3, 100)))
    wanted, everything = naive_scan(scan, target, 60)
    found, _ = scan.best(target, 60)
    assert all(np.array_equal(*pair) for pair in zip(found[:3], wanted[:3]))
    place, bounds = bounds_of["increasing"].below(target, np.inf)
    assert place.size == scan.windows
    assert np.all(bounds <= everything.error[place] + 1e-15)


@pytest.mark.parametrize("scale", some_of([1e-50, 1e50, 1e-21], 2))
def test_objectives_of_any_size_are_scanned(scans, scale) -> None:
    scan = scans["increasing"]
    crank = np.linspace(0, 1, 12)
    angle = coupler_angle(scan.lengths[40], 1, 1 + crank)
    wave = 0.01 * np.cos(9 * crank)
    target = make_target(angle + wave, np.exp(1j * crank) + (0.5 + wave) * np.exp(1j * angle), 1.0, None, scale)
    wanted, _ = naive_scan(scan, target, 10)
    found, _ = scan.best(target, 10)
    assert found.error == pytest.approx(wanted.error, rel=1e-9)


@pytest.mark.parametrize("patience", [0, 1, 3, 10**6])
def test_a_scan_without_time_says_so(scans, patience) -> None:
    scan = scans["increasing"]
    target = random_target(scan, np.random.default_rng(3), "both", False)
    readings = count()
    found, report = scan.best(target, 10, work=Work(patience + 0.5, clock=readings.__next__))
    assert report.exhaustive == (next(readings) <= patience + 1)  # the first reading is the work's beginning
    assert found.row.size == 10 and np.all(np.isfinite(found.error))
    same = np.array_equal(found.error, scan.best(target, 10)[0].error)
    assert same or not report.exhaustive
    assert report.exhaustive == (patience == 10**6)


@pytest.mark.parametrize("short_spans", [False, True])
def test_an_atlas_without_types_has_no_answers(short_spans) -> None:
    scan = Scan(make_atlas(AtlasRule(TypeRule(10, 9), 16)))
    if short_spans:
        scan.prepare_short_spans(Work())
    found, report = scan.best(make_target(np.arange(4.0), crank_span=1.0), 5)
    assert found.row.size == 0 and report == (0, 0, True)


def test_table_is_the_squared_error_of_every_window(scans) -> None:
    scan = scans["full_crank"]
    target = random_target(scan, np.random.default_rng(10), "rotation", False)
    table = scan.error_table(target)
    _, everything = naive_scan(scan, target, 1)
    exact = everything.error.reshape(len(scan.lengths), STARTS, 2).transpose(0, 2, 1)
    assert np.sqrt(table) == pytest.approx(exact, abs=1e-2)
