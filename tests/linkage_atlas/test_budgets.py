"""A search whose budget ends returns the best linkage found by then and names the omitted work; more time is never worse.

A search that continues, that ends without an answer, or whose work depends on its budget would show here.
"""

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.excursions import LEAVES_SAMPLES
from synthesis.work import Work
from tests.conftest import COUNTED_BUDGETS, never_rising, some_of, ticking

RANDOM = np.random.default_rng(1)
POSES = {"rotation": RANDOM.normal(size=5), "position": RANDOM.normal(size=(5, 2)), "crank_span": 300}

TURN = np.arange(12) * np.pi / 6
WAVE = np.column_stack([np.linspace(0, 200, 12), 40 * np.sin(np.linspace(0, 3, 12))])
TILT = np.linspace(0, 40, 12) + 3 * np.sin(np.arange(12))
OVAL = {"position": np.column_stack([60 * np.cos(TURN) + 8 * np.cos(2 * TURN), 25 * np.sin(TURN)]), "closed": True}
CRANK = {"rotation": TILT, "position": WAVE, "crank_span": 200}
FREE = {"rotation": TILT, "position": WAVE, "timing": "free"}
MOTIONS: dict[str, dict[str, Any]] = {
    "with crank angles": CRANK,
    "closed path": OVAL | {"timing": "free", "prefer": "error"},
    "poses, compact": FREE,
    "three poses": {"rotation": [0, 20, 40], "position": [[0, 0], [50, 30], [120, 20]], "timing": "free"},
    "slider-crank": FREE | {"mechanisms": ["slider_crank"]},
    "slider-crank with crank angles": CRANK | {"mechanisms": ["slider_crank"]},
    "with crank angles, within limits": CRANK | {"limits": {"transmission_angle_min": 40}},
    "path, any family": {"position": WAVE, "timing": "free", "limits": {"family": "any"}},
    "few rotations": FREE | {"rotation": [0, *[None] * 10, 40]},
    "path of all kinds": {"position": WAVE, "timing": "free", "mechanisms": "all"},
    "from a linkage": FREE | {"start_from": [la.FourBar(40, 150, 120, 160, pivot_a=(0, -80))], "prefer": "error"},
}


class Clock:
    """Return a time that advances by a fixed step at each reading, from a given reading on."""

    def __init__(self, step: float, after: int = 0) -> None:
        self.step, self.left, self.now = step, after, 0.0

    def __call__(self) -> float:
        self.left -= 1
        if self.left < 0:
            self.now += self.step
        return self.now


@pytest.fixture(scope="module")
def atlas(small_bytes, tmp_path_factory) -> la.Atlas:
    path = tmp_path_factory.mktemp("budgets") / "small.h5"
    path.write_bytes(small_bytes)
    return la.load_atlas(path)


def test_a_match_that_is_cut_short_says_so(atlas) -> None:
    motion = {"rotation": RANDOM.normal(size=40).cumsum(), "crank_span": 300}
    complete = la.match(**motion, atlas=atlas, top=20)
    assert complete.report.exhaustive and not any("cut short" in note for note in complete.report.notes)
    short = la.match(**motion, atlas=atlas, top=20, budget=2.5, work=lambda budget: Work(budget, clock=Clock(1.0)))
    assert not short.report.exhaustive and short.matches
    assert any("The time was up" in note for note in short.report.notes)
    assert short.matches[0].rotation_rms >= complete.matches[0].rotation_rms
    assert short.to_dict()["report"]["exhaustive"] is False


@pytest.mark.parametrize(("round_to", "top"), [(None, 12), (0.01, 3)])
def test_solutions_are_left_out_where_finishing_them_takes_too_long(round_to, top) -> None:
    def work(budget: float | None) -> Work:
        return Work(budget, clock=clock)

    clock = Clock(0.0)
    complete = la.synthesize(**POSES, top=top, budget=1.0, round_to=round_to, work=work)
    clock = Clock(1.0, 10_000)
    readings = []
    work_of_steps = Work(1e9, clock=lambda: readings.append(0) or 0.0)
    la.synthesize(**POSES, top=top, budget=1.0, work=lambda _: work_of_steps)
    clock = Clock(1.0, len(readings) - 4)
    short = la.synthesize(**POSES, top=top, budget=1.0, round_to=round_to, work=work)
    assert 1 <= len(short.solutions) < len(complete.solutions)
    assert any("The time was up" in note for note in short.report.notes)
    assert [solution.rank for solution in short.solutions] == list(range(1, len(short.solutions) + 1))


@pytest.mark.parametrize("name", some_of([*MOTIONS], 6))
def test_more_time_never_gives_a_larger_error(name) -> None:
    errors = []
    for budget in COUNTED_BUDGETS:
        found = la.synthesize(**MOTIONS[name], budget=budget, work=ticking(1.0)).solutions
        staying = [solution for solution in found if (solution.excursion or 0.0) <= LEAVES_SAMPLES]
        errors.append(min((solution.errors.objective for solution in staying), default=np.inf))
    assert np.isfinite(errors[-1]) and never_rising(errors), errors


def test_a_first_answer_is_late_by_a_bounded_time() -> None:
    """A large request with a small budget is answered by an interrupted descent."""
    random = np.random.default_rng(2)
    wandering = {
        "rotation": random.normal(size=400).cumsum(),
        "position": random.normal(size=(400, 2)).cumsum(axis=0),
    }
    clock = Clock(0.02)
    reply = la.synthesize(
        **wandering,
        timing="free",
        limits={"preset": "none"},
        budget=0.01,
        work=lambda budget: Work(budget, clock=clock),
    )
    assert reply.solutions and clock.now < 1.5
