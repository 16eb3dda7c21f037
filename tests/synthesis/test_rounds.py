"""What a search says of itself."""

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.rounds import Found, Rounds

PATH = [[0, 0], [40, 12], [75, 40], [60, 80], [20, 95], [-20, 70], [-25, 30], [10, -20], [50, -35], [90, 10]]


def found(*led: float, least: float = 1.0) -> Found:
    one = Found(1e-10, lambda least: None)
    one.led, one.least = list(led), least
    return one


def test_the_more_rounds_lead_elsewhere_the_likelier_a_better_valley_was_missed() -> None:
    said = [found(*[0.5] * k, *[0.6] * (10 - k)).unseen(Rounds.odds) for k in range(1, 11)]
    assert all(0 < one < 1 for one in said) and np.all(np.diff(said) < 0)
    assert found(0.5, 0.504).unseen(Rounds.odds) == found(0.5, 0.5).unseen(Rounds.odds)
    assert found(0.5, 0.6, least=1e-11).unseen(Rounds.odds) is None
    odds = np.exp(-Rounds.odds[0] - Rounds.odds[1] * np.log(0.5))
    assert found().unseen(Rounds.odds) == pytest.approx(1 / (1 + odds))


def test_a_reply_carries_it_unless_it_is_exact() -> None:
    approximate = la.synthesize(position=PATH, timing="free", closed=True)
    assert approximate.status == "closest" and 0 < approximate.report.unseen < 1
    given = la.synthesize(rotation=[0, 30, 0, 30, 0, 30], crank_span=200, limits={"preset": "practical"})
    assert given.status == "closest" and 0 < given.report.unseen < 1
    cut = la.synthesize(position=PATH, timing="free", closed=True, budget=0.02)
    assert cut.report.stopped_by == "budget"
    assert cut.report.unseen is None, "nothing is known of what it did not come to"
    poses = {"rotation": [0, 33, 40], "position": [[0, 0], [-39, -32], [-39, 36]], "mechanisms": "all"}
    for exact in ({"position": PATH[:5]}, poses):
        reply = la.synthesize(**exact, timing="free")
        assert reply.status == "reached" and reply.report.unseen is None


def test_of_several_kinds_it_is_that_of_the_search_that_found_the_best() -> None:
    def asked(kinds) -> la.Result:
        poses = {"rotation": [0, 12, 40, 55, 90, 100], "position": PATH[:6]}
        return la.synthesize(
            **poses, timing="free", mechanisms=kinds, prefer="error", limits={"family": "full_crank"}
        )

    alone, sliders, both = asked(["four_bar"]), asked(["slider_crank"]), asked(["four_bar", "slider_crank"])
    best = min((alone, sliders), key=lambda one: one.solutions[0].errors.objective)
    assert 0 < sliders.report.unseen < 1 and alone.report.unseen != sliders.report.unseen
    assert both.report.unseen == best.report.unseen
