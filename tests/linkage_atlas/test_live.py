"""Answers that go on from the last while a motion is being changed (`la.Live`)."""

from itertools import count

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas import door
from tests.conftest import some_of

RANDOM = np.random.default_rng(3)
TURN = np.linspace(0, 2 * np.pi, 12, endpoint=False)
PATH = np.column_stack([60 * np.cos(TURN), 30 * np.sin(TURN)]) + RANDOM.normal(size=(12, 2))
POSES = {"position": RANDOM.normal(size=(8, 2)), "rotation": RANDOM.uniform(-50, 50, 8)}
QUESTIONS = {
    "path": {"position": PATH, "timing": "free", "closed": True},
    "any order": POSES | {"timing": "free", "order": "any"},
    "within limits": POSES | {"crank_span": 200, "limits": {"preset": "practical", "pivot_box": [-2, -2, 2, 2]}},
    "crank angles": POSES | {"crank_span": -200},
    "rotation": {"rotation": POSES["rotation"], "crank_span": 200},
    "path without limits": {"position": PATH, "timing": "free", "limits": {"preset": "none"}},
    "long path": {"position": np.repeat(PATH, 4, axis=0) + RANDOM.normal(size=(48, 2)), "timing": "free"},
    "closed by its first": {"position": np.vstack([PATH, PATH[:1]]), "timing": "free", "closed": True},
    "poses": POSES | {"timing": "free", "limits": {"family": "any"}},
}


def stepped(budget: float | None) -> la.Work:
    """Each reading of the clock takes a fifth of a millisecond, on every machine."""
    return la.Work(budget, clock=count(step=2e-4).__next__)


def objective(reply: la.Result) -> float:
    return reply.best.errors.objective if reply.solutions else np.inf


@pytest.mark.parametrize("name", some_of(list(QUESTIONS), 3))
def test_the_same_question_again_is_answered_at_once_and_no_worse(name) -> None:
    question, live = QUESTIONS[name], la.Live()
    first = la.synthesize(**question, live=live, work=stepped)
    assert first.report.live is not None and not first.report.live.continued
    assert first.solutions and 0 < len(live.state) < 30_000
    for budget in (0.001, None):  # in the first there is time for nothing else
        again = la.synthesize(**question, live=live, work=stepped, budget=budget)
        assert again.report.live is not None and again.report.live.continued
        assert objective(again) <= objective(first) * (1 + 1e-9) + 1e-12
        first = again
    assert first.report.elapsed_ms["total"] < 1000


def test_an_answer_that_is_not_live_says_nothing_of_it() -> None:
    assert la.synthesize(**QUESTIONS["crank angles"], top=1, budget=0.1).report.live is None


def test_samples_may_be_added_and_removed() -> None:
    live = la.Live()
    before = objective(la.synthesize(position=PATH, timing="free", live=live, work=stepped))
    for path in (np.insert(PATH, 5, (PATH[4] + PATH[5]) / 2, axis=0), np.delete(PATH, 3, axis=0)):
        reply = la.synthesize(position=path, timing="free", live=live, work=stepped)
        assert reply.report.live is not None and reply.report.live.continued
        assert objective(reply) < 3 * before


def test_what_is_left_of_one_kind_of_question_serves_another() -> None:
    live = la.Live()
    for name in ("poses", "crank angles", "rotation", "any order", "path"):
        assert la.synthesize(**QUESTIONS[name], live=live, work=stepped).solutions, name


def test_an_atlas_and_a_given_linkage_are_no_searches_to_go_on() -> None:
    with pytest.raises(la.FieldError, match="live: a search"):
        la.synthesize(**QUESTIONS["crank angles"], live=la.Live(), effort="atlas")
    with pytest.raises(la.FieldError, match="live: a search"):
        la.synthesize(**QUESTIONS["crank angles"], live=la.Live(), refine_from=la.FourBar(19, 72, 144, 165))


def test_after_a_large_drag_fresh_seeds_come_at_once(monkeypatch) -> None:
    """Within 100 looks at the clock: before, they came at every third request only, and late in others."""
    looks, fresh = 0, []

    def clock() -> float:
        nonlocal looks
        looks += 1
        return 0.0 if looks < 100 else np.inf

    screens = door.screens
    monkeypatch.setattr(door, "screens", lambda family: (fresh.append(looks < 100), screens(family))[1])
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    place, live, soon = 60 * np.cos(turn) + 35j * np.sin(turn), la.Live(), []
    for drag in (0.0, 0.3, 0.3, 0.3, 0.3, 45.0):  # the fourth takes them in its turn
        place[2] += drag * np.exp(0.25j * np.pi)
        looks = 0
        fresh.clear()
        asked = {"timing": "free", "closed": True, "work": lambda budget: la.Work(budget, clock=clock)}
        la.synthesize(position=place, live=live, budget=1.0, **asked)
        soon.append(any(fresh))
    assert soon == [True, False, False, True, False, True]
