"""The measurement of all searches: its requests are the same for ever, its judges refuse what breaks a request."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import engine, report
from tests.conftest import COUNTED_BUDGETS, never_rising, ticking

APPROXIMATE = [engine.CLASSES[name] for name in engine.APPROXIMATE]
WORSENED = {"drawn path": 7000012, "random poses": 7000007, "within limits": 7000003, "largest error": 7000002}
"""Seeds of requests for which more time once gave a larger error."""


def test_every_reference_belongs_to_a_request_of_today() -> None:
    known = engine.References().known
    assert set(known) <= set(engine.CLASSES) and all(known.get(name) for name in engine.APPROXIMATE)
    for name, selected in known.items():
        for seed, (mark, cost, seconds) in selected.items():
            assert engine.CLASSES[name].case(int(seed)).mark == mark, (name, seed)
            assert cost > 0 and seconds >= 0


def test_seeds_are_distinct_and_lead_back_to_their_requests() -> None:
    for kind in engine.CLASSES.values():
        seeds = kind.seeds_of(12)
        assert len(set(seeds)) == len(seeds) == 12 * kind.many and set(kind.seeds) <= set(seeds)
    marks = [kind.case(seed).mark for kind in APPROXIMATE for seed in kind.seeds_of(12)]
    assert len(set(marks)) == len(marks)


@pytest.mark.parametrize("name", engine.CLASSES)
def test_the_judge_agrees_with_the_reply_and_refuses_another_linkage(name) -> None:
    case = engine.CLASSES[name].case(engine.FRESH)
    best = case.ask(0.1, top=1).best.to_dict()
    cost, reported = case.cost(best), best["errors"]["objective"]
    assert cost == pytest.approx(
        np.rad2deg(reported) if name == "largest error" else reported, rel=1e-5, abs=engine.EXACT
    )
    longer = best | {"links": best["links"] | {"coupler": 1.01 * best["links"]["coupler"]}}
    assert case.cost(longer) > cost + engine.EXACT


@pytest.mark.wide
@pytest.mark.parametrize("name", engine.CLASSES)
def test_as_many_of_30_requests_are_answered_well_as_when_they_were_measured(name, capsys) -> None:
    """Exact requests exactly, the others as well as the best known answer; the clock may cost a single request of 30."""
    references, retained = engine.References(), report.load("engine")["parts"][name]
    now = engine.measure_class(name, 30 // engine.CLASSES[name].many, (), references, keep=False)
    positions = [retained["seed"].index(seed) for seed in now["seed"]]
    then = {"seed": now["seed"], "cost": [retained["cost"][position] for position in positions]}
    rate, before = (engine.share(engine.over(name, part, "cost", references)) for part in (now, then))
    with capsys.disabled():
        print(f"\n{name}: {rate:.0%} of {len(positions)} requests, {before:.0%} when measured")
    assert len(positions) == 30 and rate >= before - 1.01 / 30


@pytest.mark.parametrize(("name", "seed"), WORSENED.items())
def test_more_time_never_gives_a_larger_error(name, seed) -> None:
    case = engine.CLASSES[name].case(seed)
    errors = [engine.smallest_cost(case, case.ask(budget, work=ticking(1.0))) for budget in COUNTED_BUDGETS]
    assert never_rising(errors), errors
