"""The index of shapes of paths: its bounds against every window, and the scan that asks it against the plain scan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas import path_queries, short_spans, trees
from synthesis.atlas.index import Index
from synthesis.atlas.leaders import Leaders
from synthesis.atlas.legendre import LEAST_SEEN, TAIL, PhasorExpansion, polynomials
from synthesis.atlas.path_storeys import PATH_STOREYS
from synthesis.atlas.scan import KIND, Scan
from synthesis.atlas.short_spans import ShortSpan
from synthesis.atlas.table import AtlasRule
from synthesis.atlas.trees import NO_ENTRY
from synthesis.atlas.windows import TIE, Windows
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.pose import fixed_columns, position_errors
from synthesis.target import TURN, Target, make_target
from synthesis.work import OutOfTime, Work
from tests.conftest import make_atlas
from tests.oracles.rotations import any_span, any_weights

RULES = {
    "increasing": AtlasRule(TypeRule(30, 2, OrderRule.INCREASING), 64),
    "full_crank": AtlasRule(TypeRule(20, 1, OrderRule.FULL_CRANK), 32),
}
SHAPES = ("linkage", "folding", "noisy", "line", "waves", "far")


@pytest.fixture(scope="module", autouse=True)
def small_leaves() -> Iterator[None]:
    """Boxes of several levels, and no giving up, although the atlases are small."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (trees, short_spans):
            patch.setattr(module, "LEAF", 4)
            patch.setattr(module, "PARTS", 3)
        for name in ("LARGEST_SINE", "MOST_COMPARED", "MOST_PATHS", "MOST_SHORT_PATHS"):
            patch.setattr(short_spans, name, np.inf if name != "LARGEST_SINE" else 0.99)
        patch.setattr(short_spans, "_MANY", 16)
        yield


@pytest.fixture(scope="module")
def scans(small_leaves) -> dict[str, Scan]:
    made = {name: Scan(make_atlas(rule)) for name, rule in RULES.items()}
    for scan in made.values():
        scan.prepare_paths(Work())
    return made


def every_error(scan: Scan, target: Target) -> np.ndarray:
    """The error of every window, by its number."""
    return scan.errors(target, scan.numbering.windows(np.arange(scan.windows)))


def request(scan: Scan, seed: int, shape: str = "", samples: int = 0) -> Target:
    """A path over 8 to 360 degrees: of a type, near one, or of none; even or not, some samples weighed or missing."""
    rng = np.random.default_rng(seed)
    shape = shape or str(rng.choice(SHAPES))
    samples = samples or int(rng.choice([5, 6, 8, 17, 40]))
    crank, share = any_span(rng, 8, 360, [storey.top for storey in PATH_STOREYS], samples)
    span = crank[-1]
    lengths = scan.lengths[rng.integers(scan.types)].astype(float)
    lengths *= np.exp(rng.normal(scale=rng.choice([0, 1e-3, 1e-1]), size=4))
    start = rng.uniform(0, TURN) if shape != "folding" else np.pi - rng.random() * span
    body = np.nan_to_num(coupler_angle(lengths, rng.choice([1, -1]), start + crank))
    arm = rng.uniform(0.2, 2) * lengths[1] * np.exp(1j * rng.uniform(0, TURN))
    path = lengths[0] * np.exp(1j * (start + crank)) + arm * np.exp(1j * body)
    if shape == "noisy":
        path += 10.0 ** rng.uniform(-4, 0) * (rng.normal(size=samples) + 1j * rng.normal(size=samples))
    elif shape == "line":
        path = (1 + 0.3j) * (share + 0.1 * rng.uniform(-1, 1) * share**2)
    elif shape == "waves":
        path = share + 1j * np.cos(np.pi * rng.integers(1, 7) * share + rng.uniform(0, 6))
    elif shape == "far":
        path = path + 1e4 * np.exp(1j)
    weights = any_weights(rng, samples, 5)
    return make_target(None, path, crank_angle=crank + rng.uniform(-3, 3), position_weights=weights)


def short_path(scan: Scan, target: Target) -> ShortSpan:
    short = scan._short_span(target, lambda: False)
    assert short is not None
    return short


@settings(max_examples=40, deadline=None)
@given(
    reach=st.integers(2, 30),
    centre=st.floats(-10, 10),
    half_width=st.floats(0.05, 3.4),
    terms=st.integers(4, 16),
    samples=st.integers(4, 40),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_samples_see_more_beside_a_shape_than_its_rest(reach, centre, half_width, terms, samples, seed) -> None:
    rng = np.random.default_rng(seed)
    order = np.arange(-reach, reach + 1)
    series = rng.normal(size=(3, order.size, 2)).view(complex)[..., 0] / 2.0 ** np.abs(order)
    shapes, rest = PhasorExpansion(reach, np.array([centre]), half_width, terms).shapes(series, np.zeros(3))
    place = np.sort(rng.uniform(-1, 1, samples))
    curve = series @ np.exp(1j * np.outer(order, centre + half_width * place))
    every = polynomials(place, terms + TAIL)[:, 1:].astype(complex)
    fixed = np.linalg.qr(np.stack([np.ones(samples), np.exp(1j * half_width * place)], axis=1))[0]
    columns = every - fixed @ (fixed.conj().T @ every)
    seen = max(np.sqrt(np.mean(np.abs(columns[:, terms - 1 :]) ** 2, axis=0)).max(), LEAST_SEEN)
    left = curve.T - fixed @ (fixed.conj().T @ curve.T)
    point, weight = np.polynomial.legendre.leggauss(120)
    wave = np.exp(1j * np.outer(order, centre + half_width * point))
    own, crank = (
        np.polynomial.legendre.legvander(point, 2)[:, 1:].T * weight * np.array([[1.5], [2.5]]) @ values.T
        for values in (series @ wave, np.exp(1j * half_width * point)[None])
    )
    lead = own[1] - own[0] / crank[0] * crank[1]
    gap = left - lead * (columns[:, : terms - 1] @ np.concatenate([np.ones((1, 3)), shapes[:, 0].T]))
    known = np.abs(lead) > 1e-9
    assert np.all((np.sqrt(np.mean(np.abs(gap) ** 2, axis=0)) <= seen * np.abs(lead) * rest[:, 0] + 1e-11)[known])


@pytest.mark.parametrize("name", RULES)
def test_each_type_is_in_each_interval_once(scans, name) -> None:
    for index in scans[name].prepared.path_storeys:
        entries = np.asarray(index.entries)
        found = np.sort(entries[entries != NO_ENTRY])
        assert np.array_equal(found, np.arange(scans[name].types * index.storey.places))
        assert index.size == 2 * (index.storey.terms - 2)


@settings(max_examples=25, deadline=None)
@given(name=st.sampled_from(sorted(RULES)), seed=st.integers(0, 2**32 - 1))
def test_each_bound_is_below_the_error_and_no_window_is_lost(scans, name, seed) -> None:
    scan = scans[name]
    target = request(scan, seed)
    errors = every_error(scan, target)
    short = short_path(scan, target)
    size = np.sqrt(target.position_mean(np.abs(fixed_columns(target).rest) ** 2))
    for share in (1e-4, 1e-2, 0.3):
        limit = min(float(np.quantile(errors, share)), 0.9 * size)
        near = short._below(limit)
        assert np.unique(near.id).size == near.id.size
        assert np.all(near.bound <= errors[near.id])
        assert set(np.flatnonzero(errors <= limit)) <= set(near.id)


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_of_a_few_samples_is_below_the_error(scans, seed) -> None:
    scan = scans["increasing"]
    target = request(scan, seed, SHAPES[seed], 17)
    errors = every_error(scan, target)
    near = short_path(scan, target)._below(float(np.quantile(errors, 0.05)))
    leaders = Leaders(10, scan.numbering, lambda windows: windows.error + np.inf, 64, lambda: False)
    ids, bounds = short_path(scan, target)._by_samples(
        near._replace(bound=np.zeros(near.id.size)), leaders, scan._errors_of_some
    )
    assert np.array_equal(ids, near.id) and np.all(bounds <= errors[ids])


def test_a_fit_of_some_samples_keeps_to_no_rule_about_the_crank(scans) -> None:
    """A linkage that is shrunk to a point for some samples need not be so for all of them."""
    scan = scans["increasing"]
    crank = np.linspace(0, 1, 9)
    window = Windows(np.array([5]), np.array([40]), np.array([1]), np.zeros(1))
    body = coupler_angle(scan.lengths[5], 1, scan.start_angles(window)[0] + crank)
    target = make_target(None, np.exp(1j * body), crank_angle=crank)
    assert np.isinf(scan.errors(target, window)[0])
    assert position_errors(target, scan.angles(target, window))[0] < 1e-12
    assert scan._errors_of_some(target, window)[0] < 1e-12


def test_bounds_exclude_what_is_far(scans) -> None:
    """A bound of 0 would be correct, and useless."""
    scan = scans["increasing"]
    left = []
    for seed in range(9):
        target = request(scan, seed, "linkage", 17)
        errors = np.sort(every_error(scan, target))
        left.append(short_path(scan, target)._below(float(errors[9])).id.size)
    assert np.median(left) < scan.windows / 100


def assert_same(scan: Scan, target: Target, top: int, **options) -> None:
    """The answers of a scan with an index are those of the plain scan; products' last bits depend on how many are evaluated."""
    plain = Scan(scan.prepared.table, cells=False)
    (found, report), (wanted, plainly) = scan.best(target, top, **options), plain.best(target, top, **options)
    assert report.exhaustive and plainly.exhaustive and report.windows == plainly.windows
    for column in ("row", "start", "branch"):
        assert np.array_equal(getattr(found, column), getattr(wanted, column)), column
    assert np.allclose(found.error, wanted.error, rtol=0, atol=TIE)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", RULES)
def test_answers_are_those_of_the_plain_scan(scans, name, shape) -> None:
    for seed in range(3):
        assert_same(scans[name], request(scans[name], 100 * SHAPES.index(shape) + seed, shape), (1, 10, 200)[seed])


@pytest.mark.parametrize("samples", [3, 4, 1024])
def test_few_and_many_samples(scans, samples) -> None:
    assert_same(scans["full_crank"], request(scans["full_crank"], 3, "noisy", samples), 10)


def test_what_every_window_meets_alike_is_in_order(scans) -> None:
    """A circle about the crank's pivot needs no coupler, and there is nothing to compare shapes with."""
    scan = scans["increasing"]
    target = make_target(None, 5 + np.exp(1j * np.linspace(0, 1, 12)), crank_span=1.0)
    assert_same(scan, target, 12)
    leaders = Leaders(10, scan.numbering, lambda windows: scan.errors(target, windows), 64, lambda: False)
    assert short_path(scan, target).candidates(leaders, scan._errors_of_some) is None


def test_the_index_is_what_answers(scans, monkeypatch) -> None:
    """Else nothing of all this tests it."""
    scan = scans["increasing"]
    monkeypatch.setattr(Scan, "_requested", lambda *_: pytest.fail("all windows were compared"))
    for degrees in (6, 9, 10, 75, 76, 360):
        scan.best(request_of(degrees), 10)
    for degrees in (4.9, 361):
        assert scan._short_span(request_of(degrees), lambda: False) is None


def request_of(degrees: float) -> Target:
    """A path that no window meets exactly."""
    share = np.linspace(0, 1, 9)
    crank = np.deg2rad(degrees) * share
    return make_target(None, 3 * np.exp(1j * crank) + np.exp(0.3j * np.sin(crank + 1)), crank_angle=crank)


@pytest.mark.parametrize(("name", "value"), [("MOST_COMPARED", 0), ("LARGEST_SINE", 0.0), ("MOST_PATHS", 0.01)])
def test_where_it_gives_up_all_windows_are_compared(scans, monkeypatch, name, value) -> None:
    monkeypatch.setattr(short_spans, name, value)
    assert_same(scans["increasing"], request(scans["increasing"], 1, "linkage", 17), 10)


@pytest.mark.parametrize("patience", [0, 1, 3, 10])
def test_a_search_without_time_says_so(scans, patience) -> None:
    scan, readings = scans["increasing"], iter(range(10**7))
    found, report = scan.best(
        request(scan, 4, "noisy", 17), 10, work=Work(patience + 0.5, clock=lambda: next(readings))
    )
    assert report.exhaustive == (next(readings) <= patience + 1)
    assert found.row.size == 10 and np.all(np.isfinite(found.error))


def test_making_the_index_can_be_ended(scans) -> None:
    scan = Scan(make_atlas(RULES["full_crank"]))
    with pytest.raises(OutOfTime):
        scan.prepare_paths(Work(0))
    assert not scan.prepared.path_storeys
    scan.prepare_positions(Work())
    with pytest.raises(OutOfTime):
        scan.prepare_paths(Work(0))
    assert not scan.prepared.path_storeys


def test_the_index_is_mapped_from_a_file_and_no_answer_comes_from_a_damaged_one(tmp_path) -> None:
    table, place = make_atlas(RULES["full_crank"]), tmp_path / "atlas.index"

    def index() -> Index:
        return Index(place, "of a test", FOURBAR, lambda: table, KIND)

    made = Scan(index().prepared(table, 1))
    made.prepare_paths(Work())
    opened = index().opened(1)
    assert opened is not None and len(opened.path_storeys) == len(PATH_STOREYS)
    for one, other in zip(made.prepared.path_storeys, opened.path_storeys):
        assert all(np.array_equal(one.arrays[name], other.arrays[name]) for name in one.arrays)
    target = request(made, 2, "linkage", 17)
    assert_same(Scan(opened), target, 10)

    paths = place.with_name(place.name + ".paths")
    content = bytearray(paths.read_bytes())
    for byte in range(4096, len(content), 512):
        content[byte] ^= 1
    paths.write_bytes(bytes(content))
    damaged = index().opened(1)
    assert damaged is not None
    assert_same(Scan(damaged), target, 10)


@pytest.mark.parametrize("name", RULES)
def test_few_offsets_at_a_time_are_compared_as_all_at_once(name, scans, monkeypatch) -> None:
    scan = scans[name]
    found = []
    for at_once in (1 << 30, 1):
        monkeypatch.setattr(path_queries, "_AT_ONCE", at_once)
        part = []
        for seed in range(3):
            best, report = scan.best(request(scan, seed, "linkage", 17), 8)
            part += [*best, report.evaluated]
        found.append(part)
    for one, other in zip(*found):
        np.testing.assert_array_equal(one, other)
