"""Cells of alike types: what their radii promise, and the scan that rests on them against the one that does without."""

from itertools import count, pairwise
from typing import Any

import numpy as np
import pytest

from synthesis.atlas import cells as scan_cells
from synthesis.atlas.cells import PARTS, Cells, GroupKey, SeriesGroup, make_cells, prepare
from synthesis.atlas.file import load_atlas
from synthesis.atlas.scan import HARMONICS, SERIES_ERROR, STARTS, Arcs, Left, RotationMatrix, Scan
from synthesis.atlas.table import Atlas, AtlasRule
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.target import TURN, Target, make_target
from synthesis.work import Cancelled, Work
from tests.conftest import make_atlas, some_of


@pytest.fixture(scope="module")
def cells() -> list[Cells]:
    """Cells of several levels, of short and of long series, with and without winding."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan_cells, "LEAF", 3)
        patch.setattr(scan_cells, "FEWEST", 1)
        atlas = make_atlas(AtlasRule(TypeRule(72, 2, OrderRule.FULL_CRANK), 64))
        made = [make_cells(group, new_array) for group in groups(atlas)]
        return [cells for cells in made if len(cells.levels) > 1]


def new_array(name: str, dtype: Any, shape: tuple[int, ...]) -> np.ndarray:
    return np.empty(shape, dtype)


def groups(atlas: Atlas) -> list[SeriesGroup]:
    """The series of an atlas as a scan prepares them."""
    return list(prepare(atlas, np.arange(len(atlas)), SERIES_ERROR, HARMONICS))


def types_below(cells: Cells, level: int, cell: int) -> np.ndarray:
    """Places of all types of a cell."""
    finest = len(cells.levels) - 1
    first, last = cell * PARTS ** (finest - level), (cell + 1) * PARTS ** (finest - level)
    return np.arange(cells.first[first], cells.first[last])


def series_at(periodic: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Values of series, cosine and sine side by side."""
    turned = np.outer(np.arange(1, periodic.shape[-1] // 2 + 1), angle)
    return periodic[..., ::2] @ np.cos(turned) + periodic[..., 1::2] @ np.sin(turned)


def some_crank(rng: np.random.Generator) -> np.ndarray:
    """Increments of the crank: tiny spans to more than a turn, both directions, even and uneven."""
    samples = int(rng.integers(3, 40))
    crank = (
        rng.choice([1, -1]) * np.deg2rad(np.exp(rng.uniform(np.log(0.2), np.log(500)))) * np.linspace(0, 1, samples)
    )
    if rng.random() < 0.5:
        crank[1:-1] = np.sort(crank[-1] * rng.random(samples - 2) ** 3)[:: int(np.sign(crank[-1]))]
    return crank


def test_every_type_is_in_one_cell_of_each_level(cells) -> None:
    for tree in cells:
        assert np.all(np.diff(tree.first) > 0) and tree.most <= 3
        assert np.array_equal(np.unique(tree.group.rows), np.sort(tree.group.rows))
        for level, its_cells in enumerate(tree.levels):
            below = [types_below(tree, level, cell) for cell in range(len(its_cells.representatives.rows))]
            assert np.array_equal(np.concatenate(below), np.arange(len(tree.group.rows)))
            for types, representative in zip(below, its_cells.representatives.rows):
                assert representative in tree.group.rows[types]
        finest = np.arange(len(tree.first) - 1)
        assert np.array_equal(np.unique(tree.types_of(finest)), np.arange(len(tree.group.rows)))


def naive_cells(features: np.ndarray, members: list[int], depth: int) -> list[list[int]]:
    """Cells by a recursion over lists of Python's whole numbers."""
    if not depth:
        return [members]
    values = [[int(features[place, k]) for place in members] for k in range(features.shape[1])]
    spreads = [len(some) * sum(v * v for v in some) - sum(some) ** 2 for some in values]
    widest = spreads.index(max(spreads))
    ranked = sorted(members, key=lambda place: (int(features[place, widest]), place))
    half = len(members) // 2
    low, high = sorted(ranked[:half]), sorted(ranked[half:])
    return naive_cells(features, low, depth - 1) + naive_cells(features, high, depth - 1)


@pytest.mark.parametrize(
    ("number", "harmonics", "seed"), [(1, 5, 0), (7, 5, 1), (500, 5, 2), (1031, 3, 3), (2048, 8, 4)]
)
def test_the_order_is_that_of_a_plain_recursion(number, harmonics, seed) -> None:
    """Of types with coefficients that repeat, so that ties are many, and some beyond what is told apart."""
    rng = np.random.default_rng(seed)
    series = rng.normal(size=(number, 6 * harmonics)).round(1) * rng.choice([1e-3, 1.0, 9.0], 6 * harmonics)
    types = SeriesGroup(GroupKey(0, harmonics), np.arange(number), series, np.zeros(number), np.zeros(number))
    columns, limit = 2 * min(scan_cells._HALVED_HARMONICS, harmonics), scan_cells._LARGEST_STEP
    features = np.rint(types.periodic[:, :columns] / scan_cells._STEP).clip(-limit, limit).astype(int)
    order, begins = scan_cells.halve(types, 6)
    cells = [order[begin:end].tolist() for begin, end in pairwise(begins)]
    assert cells == naive_cells(features, list(range(number)), len(cells).bit_length() - 1)
    assert max(map(len, cells)) <= 6 and sorted(order) == list(range(number))


@pytest.mark.parametrize("seed", some_of(range(30), 8))
def test_no_type_is_further_from_its_representative_than_the_radius(cells, seed) -> None:
    rng = np.random.default_rng(seed)
    crank = some_crank(rng)
    # every third target looks at the ends of its windows alone, where the differences are largest
    weights = np.abs(np.linspace(-1, 1, crank.size)) ** 30 + 1e-12 if seed % 3 == 0 else None
    target = make_target(rng.normal(size=crank.size), crank_angle=crank, rotation_weights=weights)
    arcs, spread = Arcs(target, STARTS), target.rotation_mean.spread
    for tree in cells:
        for level, its_cells in enumerate(tree.levels):
            radius = arcs.radius(its_cells, np.arange(len(its_cells.error)))
            for cell in rng.choice(len(its_cells.representatives.rows), 3):
                below = types_below(tree, level, cell)
                assert np.all(tree.group.error[below] <= its_cells.error[cell])
                differences = tree.group.periodic[below] - its_cells.representatives.periodic[cell]
                for window in rng.choice(2 * STARTS, 8):
                    start = np.deg2rad(window % STARTS) + target.crank
                    values = series_at(differences, start if window < STARTS else -start)
                    assert np.all(spread(values) <= radius[cell, arcs.piece[window]])


@pytest.mark.parametrize("seed", some_of(range(20), 8))
def test_chunks_hold_every_window_once(seed) -> None:
    rng = np.random.default_rng(seed)
    count = rng.integers(1, rng.choice([3, 40, 700]), rng.integers(1, 300))
    left = Left(np.arange(count.size), count, rng.integers(0, 720, count.sum()))
    wanted = sorted(zip(np.repeat(left.cell, count).tolist(), left.window.tolist()))
    found = []
    for cell, window, real in left.chunks(int(rng.choice([8, 800, 10**7]))):
        assert window.shape == real.shape == (cell.size, real.shape[1]) and real[:, 0].all()
        assert real.mean() >= 0.5 or cell.size == 1
        found += list(zip(np.broadcast_to(cell[:, None], real.shape)[real].tolist(), window[real].tolist()))
    assert sorted(found) == wanted


@pytest.mark.parametrize("points", [128, 1 << 12, 1 << 17])
def test_a_transform_in_single_precision_is_as_exact_as_the_bounds_take_it(points) -> None:
    rng = np.random.default_rng(points)
    for shape in ("alike", "falling", "one", "in phase"):
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        phases = np.exp(1j * rng.uniform(0, TURN, points // 8)) if shape != "in phase" else np.ones(points // 8)
        order = np.arange(1, points // 8 + 1)
        size = {"falling": 1.0 / order**2, "one": (order == order[-1]) * 1.0}.get(shape, np.ones(order.size))
        spectrum[1 : order.size + 1] = phases * size * (points / 2)
        off = np.fft.irfft(spectrum.astype(np.complex64), points) - np.fft.irfft(spectrum, points)
        assert abs(off).max() <= scan_cells._ROUNDING / 4 * size.sum()


# -- cells of the published size --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def published(atlas_path) -> tuple[Scan, Scan]:
    """The default atlas, with cells and without; the series for positions are left to the test of how they are made."""
    atlas = load_atlas(atlas_path)
    return Scan(atlas, threads=2), Scan(atlas, threads=2, cells=False)


@pytest.fixture(scope="module")
def quarter() -> tuple[Scan, Scan]:
    """26,481 types, with cells and without: as in the default atlas some of the series have two levels of cells."""
    atlas = make_atlas(AtlasRule(TypeRule(260, 2), 256))
    scan = Scan(atlas, threads=2)
    assert {len(cells.levels) for cells in scan.prepared.cells} == {1, 2}
    return scan, Scan(atlas, threads=2, cells=False)


def some_request(scan: Scan, rng: np.random.Generator, kind: str) -> Target:
    """A motion between the types of the atlas, one beside them, one near a change point, or any curve."""
    span = np.deg2rad(rng.choice([2.0, 20, 45, 90, 180, 300, 360]))
    crank = np.linspace(0, span, 32)
    lengths = scan.lengths[rng.integers(len(scan.lengths))] + rng.uniform(-0.4, 0.4, 4)
    if kind == "change point":
        lengths[3] = lengths[1] + lengths[2] - lengths[0] - 10.0 ** rng.uniform(-6, 0)
    angle = coupler_angle(lengths, rng.choice([1, -1]), rng.uniform(0, TURN) + crank)
    position = lengths[0] * np.exp(1j * crank) + 90 * np.exp(1j * angle) if kind == "both" else None
    if kind == "anything":
        angle = np.cumsum(rng.normal(size=32)) * 10.0 ** rng.uniform(-3, 2)
    return make_target(angle, position, span)


SHOWN = {"between": (5,), "both": (2,), "change point": (2, 5), "anything": (4,)}
"""Of the requests of each kind those that show the smallest faults of the radii: by a fifth, two fifths and more too small."""


@pytest.mark.parametrize("amount", ["some", pytest.param("all", marks=pytest.mark.wide)])
@pytest.mark.parametrize(
    ("atlas", "kind"),
    # Motions near those of the types need the default atlas: fewer types leave a fault of the radii too few chances to show.
    [("published", "between"), ("quarter", "both"), ("published", "change point"), ("quarter", "anything")],
)
def test_cells_change_no_answer(atlas, kind, amount, request) -> None:
    scan, plain = request.getfixturevalue(atlas)
    rng = np.random.default_rng(len(kind))
    targets = [some_request(scan, rng, kind) for _ in range(4 if kind == "both" else 7)]
    for target in targets if amount == "all" else [targets[k] for k in SHOWN[kind]]:
        found, report = scan.best(target, 10)
        wanted, _ = plain.best(target, 10)
        assert report.exhaustive
        for column in ("row", "start", "branch", "error"):
            assert np.array_equal(getattr(found, column), getattr(wanted, column)), column


def test_few_windows_of_a_reachable_motion_are_looked_at(published, monkeypatch) -> None:
    scan, _ = published
    looked_at = 0

    def counting(method):
        def counted(*values):
            nonlocal looked_at
            result = method(*values)
            looked_at += result.size
            return result

        return counted

    for name in ("mean_square_error", "of_windows", "of_pairs"):
        monkeypatch.setattr(RotationMatrix, name, counting(getattr(RotationMatrix, name)))
    rng = np.random.default_rng(4)
    for _ in range(5):
        looked_at = 0
        scan.best(some_request(scan, rng, "between"), 10)
        assert 0 < looked_at < 0.06 * scan.windows


def test_a_scan_whose_series_for_positions_are_not_there_keeps_a_short_budget(published) -> None:
    """By a clock that counts its readings; making the series alone takes many times the budget."""
    scan, _ = published
    for seed in range(4):
        target = some_request(scan, np.random.default_rng(seed), "both")
        readings = count()
        found, report = scan.best(target, 10, work=Work(5, clock=readings.__next__))
        assert next(readings) < 20
        assert not report.exhaustive and found.row.size == 10
        # what is returned are windows with their exact errors, if not the best ones
        assert np.allclose(found.error, scan.errors(target, found), rtol=1e-9)
    readings = count()
    assert scan.prepare_positions(Work(1e9, clock=readings.__next__)) and next(readings) > 50


def test_types_that_the_file_leaves_unresolved_are_taken_from_their_lengths() -> None:
    atlas = make_atlas(AtlasRule(TypeRule(60, 2, OrderRule.FULL_CRANK), 16))
    assert np.mean(atlas.curve_error > 1e-3) > 0.1
    scan = Scan(atlas)
    assert np.mean(np.concatenate([cells.group.error for cells in scan.prepared.cells]) > 1e-5) < 0.01
    assert scan.prepare_positions(Work())
    assert np.mean(np.concatenate([phasors.error for phasors in scan.prepared.phasors]) > 1e-4) < 0.01


@pytest.mark.parametrize("end", ["cancelled", "out of time"])
def test_a_preparation_that_is_given_up_leaves_nothing_half_made(end) -> None:
    atlas = make_atlas(AtlasRule(TypeRule(150, 2), 256))
    scan, other = Scan(atlas, threads=2), Scan(atlas)
    before = scan.nbytes
    if end == "cancelled":
        with pytest.raises(Cancelled):
            scan.prepare_positions(Work(cancelled=lambda: True))
    else:
        assert not scan.prepare_positions(Work(0.0))
    assert scan.nbytes == before
    assert scan.prepare_positions(Work()) and other.prepare_positions(Work())
    assert scan.nbytes == other.nbytes > before
    assert scan.prepare_positions(Work(0.0)), "they are there: no time is needed"
