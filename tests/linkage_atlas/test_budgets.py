"""A search whose budget ends returns the best linkage found by then and names the omitted work.

A search that continues, or that ends without an answer, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.work import Work

RANDOM = np.random.default_rng(1)
POSES = {"rotation": RANDOM.normal(size=5), "position": RANDOM.normal(size=(5, 2)), "crank_span": 300}


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
