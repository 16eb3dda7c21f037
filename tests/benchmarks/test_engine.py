"""The measurement of all searches: its requests are the same for ever, its judges refuse what breaks a request."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import engine, report

APPROXIMATE = [engine.CLASSES[name] for name in engine.APPROXIMATE]


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


def test_a_mark_sees_changes_and_no_rounding() -> None:
    case = engine.poses(6, 3)
    for by, same in ((1e-13, True), (1e-3, False)):
        rotation = [turn * (1 + by) for turn in case.request["rotation"]]
        assert (case._replace(request=case.request | {"rotation": rotation}).mark == case.mark) == same


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


def test_the_judge_refuses_what_breaks_the_practical_limits_or_the_order() -> None:
    case = engine.path("by hand", 1)
    free, within = (case.ask(0.3, limits={"preset": preset}).solutions for preset in ("none", "practical"))
    assert any("below 35" in reason for reason in free[0].verdict.reasons)
    assert case.cost(free[0].to_dict()) == np.inf and free[0].errors.objective < within[0].errors.objective
    assert np.isfinite(case.cost(within[0].to_dict()))
    assert all(np.isfinite(case.cost(solution.to_dict())) for solution in within if solution.verdict.practical)
    best = case.ask(0.3, top=1).best.to_dict()
    crank = best["crank_angle"]
    assert np.isfinite(case.cost(best))
    assert case.cost(best | {"crank_angle": [crank[1], crank[0], *crank[2:]]}) == np.inf


def test_a_reference_only_falls(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(engine, "REFERENCE", tmp_path / "some_reference.json")
    references = engine.References()
    for cost, seconds, expected in ((2.0, 0.0, (2.0, 0.0)), (1.0, 10.0, (1.0, 10.0)), (3.0, 5.0, (1.0, 15.0))):
        references.improve("drawn path", 1, 77, cost, seconds)
        assert engine.References().of("drawn path", 1, 77) == expected
    references.improve("drawn path", 2, 77, np.inf, 10.0)
    assert engine.References().of("drawn path", 2, 77) == (np.inf, 10.0)
    assert engine.References().of("drawn path", 1, 78) == (np.inf, 0.0), "another request"


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
