"""The fit reproduces the published patterns from seeded draws, and reports correctly which unknowns they leave free.

The ordinary study of each resulting machine is the check; a wrong margin or slope would give a set that fails it.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.fit import (
    Pattern,
    PrescribedVerdicts,
    extents,
    fit_pattern,
    single_ranges,
)
from synthesis.scenes.knotter.mechanism import dimensions, with_dimensions
from synthesis.scenes.knotter.study import study
from synthesis.work import Cancelled, Work

PAPER = json.loads((Path(__file__).parents[3] / "reference" / "knotter.json").read_text())["paper"]
RANGES = {
    "d1": (40.0, 250.0), "D": (-150.0, 150.0), "beta.lead": (0.0, np.pi / 2), "beta.ratio": (0.2, 1.1), "S1.j": (-30.0, 30.0),
    "S5.k": (0.0, 12.0), "S10.i": (20.0, 80.0), "S10.k": (0.0, 80.0),
}  # fmt: skip
AT = d_knotter.CLEARANCE_AT


def published_verdicts(name, condition):
    pairs = [tuple(map(int, key.split(","))) for key in PAPER[name]]
    items = {axis: np.radians([pair[k] for pair in pairs]) for k, axis in enumerate(("alpha1", "alpha3"))}
    return PrescribedVerdicts(condition, items, np.array(list(PAPER[name].values())))


@pytest.fixture(scope="module")
def pattern():
    wrap = published_verdicts("wrap_pattern", d_knotter.wrap())
    clearance = published_verdicts("clearance_pattern", d_knotter.clearance(AT, (AT, AT)))
    return Pattern(d_knotter.mechanism(), [wrap, clearance], RANGES)


def reproduces_pattern(machine) -> bool:
    """Check the verdicts of the pattern by the ordinary study of a machine, without margins."""
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    result = study(machine, grid, d_knotter.conditions()[:2])
    pairs = [f"{a:g},{b:g}" for a in d_knotter.GRID_DEGREES["alpha1"] for b in d_knotter.GRID_DEGREES["alpha3"]]
    row = {key: pairs.index(key) for key in pairs}
    wrap_agrees = all(
        result.conditions["wrap"].holds[row[key]] == holds for key, holds in PAPER["wrap_pattern"].items()
    )
    value = result.conditions["clearance"].value
    return wrap_agrees and all((value[row[key]] < 0) == holds for key, holds in PAPER["clearance_pattern"].items())


@pytest.fixture(scope="module")
def best(pattern):
    return fit_pattern(pattern, 64, 2, seed=1)[0][0]


def machine_at(pattern, unknowns):
    return with_dimensions(pattern.mechanism, dict(zip(pattern.names, pattern.denormalise(unknowns))))


def test_the_fit_reproduces_the_published_patterns(pattern, best) -> None:
    assert best.smallest_margin > 0.2 and best.robust_margin > 0 and len(best.margins) == 16
    assert reproduces_pattern(machine_at(pattern, best.unknowns))
    first, second = (fit_pattern(pattern, 8, 1, seed=1)[0][0] for _ in range(2))
    assert np.array_equal(first.unknowns, second.unknowns)


def test_the_default_inputs_reproduce_them_and_are_not_unique(pattern, best) -> None:
    nominal = dimensions(pattern.mechanism)
    start = pattern.normalise(np.array([nominal[name] for name in pattern.names]))
    (candidate,), reproducing_draws = fit_pattern(pattern, 0, 0, 0, start)
    assert candidate.smallest_margin == pytest.approx(0.138, abs=1e-3)
    assert reproducing_draws == 0 and np.array_equal(candidate.unknowns, start)
    assert np.abs(best.unknowns - start).max() > 0.05
    for (low, high), value in zip(single_ranges(pattern, start), pattern.denormalise(start)):
        assert low <= value <= high and high > low


def test_ranges_end_where_a_verdict_changes(pattern, best) -> None:
    """The ordinary study reproduces the pattern just inside each end of a range, and not just outside."""
    width = pattern.high - pattern.low
    for k, (low, high) in list(enumerate(single_ranges(pattern, best.unknowns)))[::4]:
        for end, sign in ((low, -1), (high, 1)):
            inner, outer = best.unknowns.copy(), best.unknowns.copy()
            inner[k] = (end - pattern.low[k]) / width[k] - sign * 1e-5
            outer[k] = inner[k] + sign * 2e-5
            assert reproduces_pattern(machine_at(pattern, inner)), pattern.names[k]
            if 0 < outer[k] < 1:
                assert not reproduces_pattern(machine_at(pattern, outer)), pattern.names[k]


def test_a_cancelled_or_expired_fit_ends(pattern) -> None:
    with pytest.raises(Cancelled):
        fit_pattern(pattern, 96, 2, 0, work=Work(cancelled=lambda: True))
    ticks = iter(range(10**6))
    candidates, _ = fit_pattern(pattern, 16, 2, 0, work=Work(50.0, clock=lambda: float(next(ticks))))
    assert len(candidates) == 2  # the best found within the budget
    assert extents(pattern, candidates[0].unknowns, np.eye(8), Work()).min() >= 0
