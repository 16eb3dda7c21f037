"""The index of windows of short spans: its bounds against every window, and the scan that asks it against the plain scan."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas import preparation, window_index
from synthesis.atlas.scan import Scan
from synthesis.atlas.table import AtlasRule
from synthesis.atlas.window_index import INTERVALS, NO_ENTRY, PARTS, Expansion, WindowIndex, WindowSearch, polynomials
from synthesis.atlas.windows import TIE, BestWindows
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.target import TURN, Target, make_target
from synthesis.work import OutOfTime, Work
from tests.conftest import make_atlas
from tests.oracles.rotations import any_span, any_weights

RULES = {
    "increasing": AtlasRule(TypeRule(40, 2, OrderRule.INCREASING), 64),
    "full_crank": AtlasRule(TypeRule(22, 1, OrderRule.FULL_CRANK), 32),
}
"""With windings, and with types whose crank is so short or that come so near to folding that no few terms follow them."""


@pytest.fixture(scope="module", autouse=True)
def small_leaves() -> Iterator[None]:
    """Boxes of several levels, and no giving up, although the atlases are small."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(window_index, "LEAF", 4)
        patch.setattr(window_index, "CHILDREN", 3)
        # so that enough windows are sharp
        patch.setattr(preparation, "INTERVALS", [one._replace(sharp=one.sharp / 100) for one in INTERVALS])
        patch.setattr(window_index, "MOST_LEAVES", np.inf)
        patch.setattr(window_index, "LARGEST_LIMIT", np.inf)
        patch.setattr(window_index, "MOST_WINDOWS", np.inf)
        patch.setattr(window_index, "MOST_PLACED", np.inf)
        patch.setattr(window_index, "_MANY", 16)
        yield


@pytest.fixture(scope="module")
def scans(small_leaves) -> dict[str, Scan]:
    made = {name: Scan(make_atlas(rule)) for name, rule in RULES.items()}
    for scan in made.values():
        scan.prepare_short_spans(Work())
    return made


@pytest.fixture(scope="module")
def plain(small_leaves) -> dict[str, Scan]:
    return {name: Scan(make_atlas(rule), cells=False) for name, rule in RULES.items()}


def every_error(scan: Scan, target: Target) -> np.ndarray:
    """The error of every window, by its number."""
    return scan.errors(target, scan.numbering.windows(np.arange(scan.windows)))


SHAPES = ("linkage", "folding", "noisy", "constant", "line", "waves", "steps")


def request(scan: Scan, seed: int, shape: str = "", samples: int = 0) -> Target:
    """A motion over 5 to 100 degrees: of a type, near one, or of none; even or not, some samples weighed or missing."""
    rng = np.random.default_rng(seed)
    shape = shape or str(rng.choice(SHAPES))
    samples = samples or int(rng.choice([3, 4, 5, 8, 17, 40]))
    crank, share = any_span(rng, 5.01, 99.9, [one.largest_span for one in INTERVALS], samples)
    span = crank[-1]
    lengths = scan.lengths[rng.integers(scan.types)].astype(float)
    lengths *= np.exp(rng.normal(scale=rng.choice([0, 1e-3, 1e-1]), size=4))
    start = rng.uniform(0, TURN) if shape != "folding" else np.pi - rng.random() * span
    motion = coupler_angle(lengths, rng.choice([1, -1]), start + crank)
    if shape == "noisy" or not np.all(np.isfinite(motion)):
        motion = np.nan_to_num(motion) + 10.0 ** rng.uniform(-5, -1) * rng.normal(size=samples)
    elif shape == "constant":
        motion = np.full(samples, rng.uniform(-9, 9))
    elif shape == "line":
        motion = rng.uniform(-1, 1) * crank
    elif shape == "waves":
        motion = 10.0 ** rng.uniform(-4, 0) * np.cos(np.pi * rng.integers(1, 7) * share + rng.uniform(0, 6))
    elif shape == "steps":
        motion = 10.0 ** rng.uniform(-3, 0) * (share > rng.random())
    weights = any_weights(rng, samples, 0)
    return make_target(
        motion + rng.uniform(-50, 50), crank_angle=crank + rng.uniform(-3, 3), rotation_weights=weights
    )


def search(scan: Scan, target: Target) -> WindowSearch:
    found = scan._window_search(target, lambda: False)
    assert found is not None
    return found


# -- coefficients -----------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(
    harmonics=st.integers(1, 40),
    centre=st.floats(-10, 10),
    half_width=st.floats(0.01, 1.6),
    terms=st.integers(1, 6),
    falls=st.floats(0, 3),
    winding=st.integers(0, 1),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_value_is_further_from_its_coefficients_than_the_remainder(
    harmonics, centre, half_width, terms, falls, winding, seed
) -> None:
    rng = np.random.default_rng(seed)
    order = np.arange(1, harmonics + 1)
    series = rng.normal(size=(3, harmonics, 2)) / order[:, None] ** falls
    expansion = Expansion(harmonics, np.array([centre]), half_width, terms)
    found, remainder = expansion.coefficients(series.reshape(3, -1), winding, np.zeros(3))
    place = np.linspace(-1, 1, 400)
    turned = np.outer(order, centre + half_width * place)
    curve = series[..., 0] @ np.cos(turned) + series[..., 1] @ np.sin(turned) + winding * half_width * place
    difference = curve - found[:, 0] @ polynomials(place, terms).T
    point, weight = np.polynomial.legendre.leggauss(200)
    turned = np.outer(order, centre + half_width * point)
    mean = (series[..., 0] @ np.cos(turned) + series[..., 1] @ np.sin(turned)) @ weight / 2
    largest = np.abs(difference - mean[:, None]).max(axis=1)
    assert np.all(largest <= remainder[:, 0] * (1 + 1e-9) + 1e-12 * np.abs(series).sum(axis=(1, 2)))
    if falls > 2 and harmonics * half_width < 3:  # and it is no idle number
        assert np.all(remainder[:, 0] <= 40 * largest + 1e-9)


# -- the index --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RULES)
def test_each_type_is_in_each_interval_once(scans, name) -> None:
    scan, kept = scans[name], set()
    for index in scan.prepared.short_spans:
        entries = np.asarray(index.entries)
        found = np.sort(entries[entries != NO_ENTRY])
        assert np.array_equal(found, np.arange(scan.types * index.intervals.number))
        assert index.trees[0].levels and index.trees[0].part == PARTS[0]
        kept |= {tree.part for tree in index.trees if tree.levels}
    assert len(kept) > (2 if name == "increasing" else 1), "no window is sharp: nothing of the parts is tested"


@pytest.mark.parametrize("name", RULES)
def test_what_lies_in_a_box_lies_in_those_above(scans, name) -> None:
    for index in scans[name].prepared.short_spans:
        terms, boxes = index.intervals.terms, np.asarray(index.boxes, dtype=float)
        for tree in index.trees:
            for (first, count), (below, parts) in zip(tree.levels, tree.levels[1:]):
                above = boxes[first + np.arange(parts) // window_index.CHILDREN]
                own = boxes[below : below + parts]
                assert (parts - 1) // window_index.CHILDREN + 1 == count
                apart = np.abs(own[:, :terms] - above[:, :terms]) + own[:, terms:-1]
                assert np.all(apart <= above[:, terms:-1]) and np.all(own[:, -1] <= above[:, -1])


@settings(max_examples=12, deadline=None)
@given(name=st.sampled_from(sorted(RULES)), seed=st.integers(0, 2**32 - 1))
def test_each_bound_is_below_the_error_and_no_window_is_lost(scans, name, seed) -> None:
    scan = scans[name]
    target = request(scan, seed, samples=int(seed) % 7 + 3)
    errors = every_error(scan, target)
    short = search(scan, target)
    for share in (1e-3, 0.1, 1):
        limit = float(np.quantile(errors, share)) if share < 1 else 1e3
        near = short._below(limit)
        assert np.unique(near.id).size == near.id.size
        assert np.all(near.bound <= errors[near.id])
        assert set(np.flatnonzero(errors <= limit)) <= set(near.id)
    assert near.id.size == scan.windows


@pytest.mark.parametrize("seed", range(8))
def test_the_bound_of_a_few_samples_is_below_the_error(scans, seed) -> None:
    scan = scans["increasing"]
    target = request(scan, seed, SHAPES[seed % len(SHAPES)], 9)
    short = search(scan, target)
    near = short._below(1e3)
    best = BestWindows(10, scan.numbering, lambda windows: windows.error + np.inf, 64, lambda: False)
    ids, bounds = short._by_samples(near._replace(bound=np.zeros(near.id.size)), best, scan._errors_of_some)
    assert np.array_equal(ids, near.id) and np.all(bounds <= every_error(scan, target)[ids])
    assert np.median(bounds) > 0 or short._request.some_samples()[1] > 0.7


def test_bounds_exclude_what_is_far(scans) -> None:
    """A bound of 0 would be correct, and useless."""
    scan = scans["increasing"]
    left = []
    for seed in range(9):
        target = request(scan, seed, "linkage", 17)
        errors = np.sort(every_error(scan, target))
        left.append(search(scan, target)._below(float(errors[9])).id.size)
    assert np.median(left) < 60


# -- answers ----------------------------------------------------------------------------------------------------------


def assert_same(scan: Scan, plain: Scan, target: Target, top: int, **options) -> None:
    """The answers of a scan with an index are those of the plain scan, bit for bit.

    Weighted means are products of matrices, whose last bits depend on how many windows are evaluated at a time.
    """
    (found, report), (wanted, plainly) = scan.best(target, top, **options), plain.best(target, top, **options)
    assert report.exhaustive and plainly.exhaustive and report.windows == plainly.windows
    for column in ("row", "start", "branch"):
        assert np.array_equal(getattr(found, column), getattr(wanted, column)), column
    near = 0 if target.rotation_weights is None else TIE
    assert np.allclose(found.error, wanted.error, rtol=0, atol=near)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", RULES)
def test_answers_are_those_of_the_plain_scan(scans, plain, name, shape) -> None:
    for seed in range(6):
        target = request(scans[name], 100 * SHAPES.index(shape) + seed, shape)
        assert_same(scans[name], plain[name], target, (1, 10, 10, 10, 10, 300)[seed])


@pytest.mark.parametrize("samples", [3, 1024])
def test_few_and_many_samples(scans, plain, samples) -> None:
    for seed in range(3):
        assert_same(scans["increasing"], plain["increasing"], request(scans["increasing"], seed, "", samples), 10)


def test_the_index_is_what_answers(scans, monkeypatch) -> None:
    """Else nothing of all this tests it."""
    scan = scans["increasing"]
    monkeypatch.setattr(Scan, "_requested", lambda *_: pytest.fail("the cells were asked"))
    for degrees in (5, 20, 21, 60, 61, 100):
        scan.best(make_target(np.linspace(0, 0.3, 9) ** 2, crank_span=np.deg2rad(degrees)), 10)
    for degrees in (4.9, 100.1, 360):
        target = make_target(np.linspace(0, 0.3, 9) ** 2, crank_span=np.deg2rad(degrees))
        assert scan._window_search(target, lambda: False) is None


@pytest.mark.parametrize(("name", "value"), [("MOST_LEAVES", 0), ("LARGEST_LIMIT", 0.0), ("MOST_WINDOWS", 0.01)])
def test_where_it_gives_up_the_cells_answer_with_its_limit(scans, plain, monkeypatch, name, value) -> None:
    monkeypatch.setattr(window_index, name, value)
    scan, asked = scans["increasing"], []
    requested = Scan._requested
    monkeypatch.setattr(Scan, "_requested", lambda *more: asked.append(1) or requested(*more))
    for seed in range(4):
        assert_same(scan, plain["increasing"], request(scan, seed), 10)
    assert len(asked) >= 4


def test_positions_are_answered_by_the_rotations_bounds(scans, plain) -> None:
    scan = scans["full_crank"]
    for seed in range(3):
        target = request(scan, seed, "linkage", 9)
        position = np.exp(1j * target.crank) + 0.7 * np.exp(1j * target.rotation) + 0.01 * np.cos(5 * target.crank)
        target = make_target(target.rotation, position, crank_angle=target.crank)
        found, report = scan.best(target, 10)
        wanted, _ = plain["full_crank"].best(target, 10)
        assert report.exhaustive and np.allclose(found.error, wanted.error, rtol=0, atol=1e-12)
        assert all(np.array_equal(*pair) for pair in zip(found[:3], wanted[:3]))


def test_no_more_windows_are_evaluated_than_are_allowed(scans) -> None:
    scan = scans["increasing"]
    target = make_target(np.zeros(9), crank_span=0.5)
    found, report = scan.best(target, 5, max_windows=20)
    assert report.evaluated <= 20 and found.row.size == 5
    good, report = scan.best(target, 5, enough=1e3)
    assert good.row.size == 5 and not report.exhaustive


@pytest.mark.parametrize("patience", [0, 1, 3, 10, 10**6])
def test_a_search_without_time_says_so(scans, patience) -> None:
    scan, readings = scans["increasing"], iter(range(10**7))
    target = request(scan, 4, "waves", 17)
    found, report = scan.best(target, 10, work=Work(patience + 0.5, clock=lambda: next(readings)))
    assert report.exhaustive == (next(readings) <= patience + 1)
    assert found.row.size == 10 and np.all(np.isfinite(found.error))
    assert report.exhaustive == {0: False, 10**6: True}.get(patience, report.exhaustive)


def test_making_the_index_can_be_ended(scans) -> None:
    scan = Scan(make_atlas(RULES["increasing"]))
    with pytest.raises(OutOfTime):
        scan.prepare_short_spans(Work(0))
    assert not scan.prepared.short_spans
    assert scan.best(request(scan, 1), 3)[1].exhaustive


def test_an_index_of_other_starts_is_not_asked(scans) -> None:
    odd = Scan(make_atlas(RULES["increasing"]), starts=50)
    odd.prepare_short_spans(Work())
    assert odd._window_search(make_target(np.arange(4.0), crank_span=1.0), lambda: False) is None
    assert WindowIndex(INTERVALS[0], odd.prepared.short_spans[0].arrays).types == odd.types
