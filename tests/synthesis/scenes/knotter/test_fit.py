"""Fit of unknown dimensions: the published patterns from seeded starts, checked by the study, and what is free by the report."""

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.fit import Pattern, Wanted, directions, extents, rank, search, single_ranges
from synthesis.scenes.knotter.mechanism import dimensions, varied
from synthesis.scenes.knotter.study import study
from synthesis.work import Cancelled, Work

PAPER = json.loads((Path(__file__).parents[3] / "reference" / "knotter.json").read_text())["paper"]
RANGES = {
    "d1": (40.0, 250.0), "D": (-150.0, 150.0), "beta.lead": (0.0, np.pi / 2), "beta.ratio": (0.2, 1.1), "S1.j": (-30.0, 30.0),
    "S5.k": (0.0, 12.0), "S10.i": (20.0, 80.0), "S10.k": (0.0, 80.0),
}  # fmt: skip
AT = d_knotter.CLEARANCE_AT


def wanted(name, condition):
    pairs = [tuple(map(int, key.split(","))) for key in PAPER[name]]
    items = {axis: np.radians([pair[k] for pair in pairs]) for k, axis in enumerate(("alpha1", "alpha3"))}
    return Wanted(condition, items, np.array(list(PAPER[name].values())))


@pytest.fixture(scope="module")
def pattern():
    parts = [wanted("wrap_pattern", d_knotter.wrap()), wanted("clearance_pattern", d_knotter.clearance(AT, (AT, AT)))]
    return Pattern(d_knotter.mechanism(), parts, RANGES)


def agrees(machine) -> bool:
    """The pattern by the ordinary study of one machine, apart from margins."""
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    result = study(machine, grid, d_knotter.conditions()[:2])
    pairs = [f"{a:g},{b:g}" for a in d_knotter.GRID_DEGREES["alpha1"] for b in d_knotter.GRID_DEGREES["alpha3"]]
    row = {key: pairs.index(key) for key in pairs}
    wraps = all(result.conditions["wrap"].holds[row[key]] == holds for key, holds in PAPER["wrap_pattern"].items())
    value = result.conditions["clearance"].value
    return wraps and all((value[row[key]] < 0) == holds for key, holds in PAPER["clearance_pattern"].items())


@pytest.fixture(scope="module")
def best(pattern):
    return search(pattern, 128, 4, seed=1)[0][0]


def machine_at(pattern, share):
    return varied(pattern.mechanism, dict(zip(pattern.names, pattern.values(share))))


def test_a_seeded_start_reproduces_the_published_patterns(pattern, best) -> None:
    assert best.worst > 0.2 and best.around > 0 and len(best.margins) == 16
    assert agrees(machine_at(pattern, best.share))
    first, second = (search(pattern, 8, 1, seed=1)[0][0] for _ in range(2))
    assert np.array_equal(first.share, second.share)


def test_the_default_inputs_reproduce_them_and_are_not_the_only_ones(pattern, best) -> None:
    known = dimensions(pattern.mechanism)
    start = pattern.shares(np.array([known[name] for name in pattern.names]))
    (found,), kept = search(pattern, 0, 0, 0, start)
    assert found.worst == pytest.approx(0.138, abs=1e-3) and kept == 0 and np.array_equal(found.share, start)
    assert np.abs(best.share - start).max() > 0.05
    for (low, high), value in zip(single_ranges(pattern, start), pattern.values(start)):
        assert low <= value <= high and high > low


def test_ranges_end_where_the_verdict_breaks(pattern, best) -> None:
    """Naively: the ordinary study holds just inside and fails just outside each end."""
    size = pattern.high - pattern.low
    for k, (low, high) in list(enumerate(single_ranges(pattern, best.share)))[::4]:
        for end, sign in ((low, -1), (high, 1)):
            inner, outer = best.share.copy(), best.share.copy()
            inner[k] = (end - pattern.low[k]) / size[k] - sign * 1e-5
            outer[k] = inner[k] + sign * 2e-5
            assert agrees(machine_at(pattern, inner)), pattern.names[k]
            if 0 < outer[k] < 1:
                assert not agrees(machine_at(pattern, outer)), pattern.names[k]


def test_directions_are_orthogonal_and_free_ones_are_told(pattern, best) -> None:
    found = directions(pattern, best)
    vectors = np.array([way.vector for way in found])
    assert vectors @ vectors.T == pytest.approx(np.eye(8), abs=1e-12)
    assert [way.strength for way in found] == sorted(way.strength for way in found)
    assert all(way.back >= 0 and way.forth >= 0 and way.back + way.forth > 0 for way in found)
    for way in found[:1]:
        assert agrees(machine_at(pattern, np.clip(best.share + 0.99 * way.forth * way.vector, 0, 1)))
    # S7 decides about the bite alone: no margin of this pattern sees it
    wider = Pattern(pattern.mechanism, pattern.wanted, {**RANGES, "S7.i": (0.0, 50.0), "S9.k": (-50.0, 0.0)})
    spread = wider.found(np.append(best.share, [0.5, 0.5]), Work())
    free = directions(wider, spread)
    assert rank(free) == 8 and rank(found) == 8
    for way in free[:2]:
        assert np.abs(way.vector[:8]).max() < 1e-9 and way.back + way.forth >= 1 - 1e-12


def test_margins_of_many_are_those_of_each(pattern) -> None:
    shares = np.random.default_rng(5).random((4, 8))
    together = pattern.margins(shares, Work())
    for share, row in zip(shares, together):
        assert pattern.margins(share[None], Work())[0] == pytest.approx(row, abs=1e-9)
        first = pattern.wanted[0]
        result = d_knotter.wrap().evaluate(varied(machine_at(pattern, share), first.items), len(first.holds))
        assert (row[:9] > 0).tolist() == (result.holds == pattern.wanted[0].holds).tolist()


def test_slopes_are_those_of_small_steps(pattern, best) -> None:
    step = 1e-6 * np.eye(8)
    both = pattern.margins(np.concatenate([best.share + step, best.share - step]), Work())
    fine = (both[:8] - both[8:]).T / 2e-6
    assert np.median(np.abs(best.slopes - fine) / (1 + np.abs(fine))) < 0.02


def test_a_search_that_is_given_up_or_out_of_time_ends(pattern) -> None:
    with pytest.raises(Cancelled):
        search(pattern, 96, 2, 0, work=Work(cancelled=lambda: True))
    now = iter(range(10**6))
    found, _ = search(pattern, 16, 2, 0, work=Work(50.0, clock=lambda: float(next(now))))
    assert len(found) == 2  # the best so far
    assert extents(pattern, found[0].share, np.eye(8), Work()).min() >= 0


def test_draws_and_descents_end_with_the_budget(pattern) -> None:
    found, kept = search(pattern, 1000, 6, 0, work=Work(1e-2))
    assert len(found) == 1 and kept <= 64  # of the first draws alone
