"""The compiled kernels return the same numbers as their sources run as plain Python.

An index beyond the end of an array, an integer division or a wrong type in the compiled code would show here.
"""

from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from synthesis.constraints import Constraints
from synthesis.fourbar.mechanism import AnyChart, GrashofChart
from synthesis.guided.pairs import numbers_of
from synthesis.kernels import codes, distinct
from synthesis.limits import Limits, Reach
from synthesis.poses import make_poses
from tests.oracles.kernel import compiled, uncompiled

CHARTS = [GrashofChart(), AnyChart()]
NAMES = ["grashof", "any"]


LENGTHS = np.array([[0.15, 0.3, 0.25, 0.3], [0.4, 0.25, 0.28, 0.07]])
FIXED = {"start given": {"fixed": (True, False)}, "offset given": {"fixed": (False, True)}}
TIMINGS: dict[str, dict[str, Any]] = {"free": {}, "given": {}, **FIXED}
timings = pytest.mark.parametrize("timing", TIMINGS)
EVERY_KIND = Limits(
    transmission_angle_min=0.6,
    transmission_angle_min_turn=0.3,
    link_min=0.2,
    link_max=0.9,
    link_ratio_max=3.0,
    links=(0.5, None, None, None),
    pivot_a=0.3 + 0.1j,
    pivot_b_box=(1.0, -0.2, 2.0, 0.1),
    pivot_reach=Reach(0.1 - 0.2j, 0.4, 0.5),
    keep_out=((-0.5, -0.4, 0.2, 0.5), (1.2, -1.0, 2.0, 1.0)),
    coupler_radius_max=0.4,
    envelope=(-1.0, -0.9, 1.1, 0.8),
)


@pytest.fixture(autouse=True)
def as_c_does():
    """Nothing is said of a division by zero."""
    with np.errstate(all="ignore"):
        yield


def limits_of(module: ModuleType, smooth: bool, posed: bool = True) -> Any:
    """Limits of every kind, the family and the ratios in the form that they have over all length ratios, or not."""
    table = Constraints(EVERY_KIND, exact=False, smooth=smooth)._table(posed)
    return module.Limits(np.array(table.rows), posed, table.equal)


class Descent:
    """Two candidates, a crank-rocker and a double-crank, some way off poses that a linkage nearly makes."""

    def __init__(
        self,
        module: ModuleType,
        chart: Any,
        timing: str = "free",
        rotation: bool = True,
        position: bool = True,
        limited: bool = False,
        ordered: bool = True,
        samples: int = 6,
        posed: bool = True,
    ) -> None:
        random, lengths = np.random.default_rng(5), LENGTHS
        crank = 0.4 + np.sort(random.uniform(0, 3, samples))
        turned = chart.at(chart.unknowns(lengths[:1]), crank[None], np.ones(1)).angle[0]
        position_of_body = (
            0.5 * np.exp(1j * crank) + np.exp(1j * (turned + 0.3)) + 0.05 * random.standard_normal(samples)
        )
        position_of_body -= position_of_body.mean()
        root = np.sqrt(random.dirichlet(np.full(samples, 9.0)))
        limits = limits_of(module, chart.kind == codes.ANY, posed) if limited else None
        prescribed = timing != "free"
        self.kernel = module.Descent(
            turned + 0.02 * random.standard_normal(samples) if rotation else None,
            root,
            np.stack([position_of_body.real, position_of_body.imag], axis=1) if position else None,
            root,
            chart.kind,
            ordered,
            6.0,
            limits,
            crank=crank - crank[0] if prescribed else None,
            crank_min=1e-9 if prescribed and position else 0.0,
            **TIMINGS[timing],
        )
        angles = np.stack([crank, crank[::-1]]) + 0.1 * random.uniform(-1, 1, (2, 1))
        self.arrays = [
            chart.unknowns(lengths * random.uniform(0.9, 1.1, lengths.shape)),
            random.normal(size=(2, 6)),
            random.normal(size=2),
            angles[:, :1].copy() if prescribed else angles,
            np.array([1.0, -1.0]),
        ]
        self.columns = self.arrays[0].shape[1] + 6 * position + rotation + prescribed
        self.turns = (2, samples)
        self.random, self.costs = random, self.kernel.set_candidates(*self.arrays, 0.3)

    @property
    def state(self) -> list[np.ndarray]:
        """State of the candidates."""
        return [*self.arrays, self.costs]


def same(work: Callable[[ModuleType], list[Any]], tolerance: float = 1e-12) -> None:
    """Both do the same."""
    first, second = work(compiled()), work(uncompiled())
    assert len(first) == len(second)
    for found, source in zip(first, second):
        size = np.abs(np.asarray(source, dtype=float))
        size = size[np.isfinite(size)].max(initial=0.0)
        np.testing.assert_allclose(found, source, rtol=tolerance, atol=tolerance * size)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("posed", [False, True])
def test_limits_of_every_kind(smooth: bool, posed: bool) -> None:
    random = np.random.default_rng(2)
    # also of part of a turn, and that never closes
    lengths = np.concatenate([LENGTHS, [[0.3, 0.1, 0.2, 0.3], [1.0, 0.1, 0.1, 5.0]]])
    first, pivot = random.uniform(0, 6, 4), random.normal(size=(4, 2))
    where = first, first + random.uniform(-3, 3, 4), pivot, random.uniform(-3, 3, 4), random.normal(size=(4, 2))
    side = np.array([1.0, -1.0, 1.0, 1.0])
    kinds = {int(row[0]) for row in Constraints(EVERY_KIND, smooth=smooth)._table(posed).rows}
    ours = {codes.USED, codes.OVER_TURN, codes.LENGTH}
    ours |= {codes.FAMILY, codes.RATIOS} if smooth else {codes.RATIO}
    assert kinds == ours | (set(range(codes.AT, codes.ENVELOPE + 1)) if posed else set())
    same(lambda module: list(limits_of(module, smooth, posed)(lengths, side, *where)))


ROWS = [(chart, False) for chart in CHARTS] + [(chart, True) for chart in CHARTS]


@timings
@pytest.mark.parametrize(("chart", "limited"), ROWS, ids=NAMES + [f"{name}, limited" for name in NAMES])
def test_rows_and_steps(chart: Any, timing: str, limited: bool) -> None:
    def work(module: ModuleType) -> list[Any]:
        reported = []
        for damping in (1e-2, 1e-12):  # by normal equations and by reflections
            descent = Descent(module, chart, timing, limited=limited)
            reported += [value for n in range(2) for value in descent.kernel.linearised(n, damping).values()]
        return reported

    same(work, 1e-10)


@pytest.mark.parametrize(("rotation", "position"), [(True, True), (False, True), (True, False)])
@timings
def test_descents(timing: str, rotation: bool, position: bool) -> None:
    def work(module: ModuleType) -> list[Any]:
        descent = Descent(module, CHARTS[0], timing, rotation, position)
        descent.kernel.evaluate_candidates(True, rotation)
        descent.kernel.configure(4, 1e-3, 1e-9, 0.0, 1.0, 1.0)
        assert not descent.kernel.run(3) and descent.kernel.run(100)
        return descent.state

    same(work, 1e-6)  # normal equations of a condition up to 1e11 are solved in each step


TASKS: dict[str, Callable[[Descent], Any]] = {
    "look": lambda descent: descent.kernel.evaluate_candidates(False, False),
    "look, posed": lambda descent: descent.kernel.evaluate_candidates(True, True),
    "nearest": lambda descent: descent.kernel.move_to_nearest_angles(3),
    "broken": lambda descent: descent.kernel.violations(),
    "excursions": lambda descent: np.column_stack(descent.kernel.excursions(0.05, 0.2)),
    "restore": lambda descent: descent.kernel.restore(3),
}


@pytest.mark.parametrize("samples", [1, 2, 3])
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("timing", ["free", "given"])
def test_few_samples(timing: str, samples: int, limited: bool) -> None:
    """Fewer rows than unknowns: only the uncompiled source notices a write beyond the end of an array."""

    def work(module: ModuleType) -> list[Any]:
        descent = Descent(module, CHARTS[0], timing, limited=limited, samples=samples)
        for task in TASKS.values():
            task(descent)
        descent.kernel.configure(3, 1e-3, 1e-9, 0.0, 1.0, 0.3)
        assert descent.kernel.run(100)
        return [descent.costs] if samples == 3 else []

    same(work, 1e-5)


def test_rows_that_are_apart() -> None:
    random = np.random.default_rng(4)
    rows, reach = random.uniform(size=(60, 3)), random.uniform(0.1, 0.4, 60)
    same(
        lambda module: [
            retained := module.apart(rows, reach, (), 0, 20),
            module.apart(rows, reach, retained[:5], 30, 12),
        ]
    )
    retained: list[int] = []
    for n, row in enumerate(rows):
        if all(np.abs(rows[k] - row).max() >= reach[n] for k in retained):
            retained.append(n)
    assert distinct.apart(rows, reach, (), 0, 100).tolist() == retained
    assert distinct.apart(rows, reach, (), 0, 3).tolist() == retained[:3]
    assert distinct.apart(rows, reach, (7, 9), 60, 100).tolist() == [7, 9]


def test_damped_steps() -> None:
    rows = np.random.default_rng(2).normal(size=(3, 5, 9))
    rows[1, 2] = 0.0
    same(lambda module: [*module.damped_steps(rows, np.array([1e-3, 1e-8, 10.0]), 1.5)])


@pytest.mark.parametrize("driven", [False, True])
def test_pairs_of_guides(driven: bool) -> None:
    """Evaluated with and without derivatives: pairs of all sorts within limits of every kind."""
    random, count, number = np.random.default_rng(3), 9, 5
    along = np.linspace(0, 1, number)
    poses = make_poses(0.5 * along, along + 0.05 * random.normal(size=number) + 0.2j * along**2)
    samples = np.stack(
        [0.5 * along, along - 0.5, 0.2 * along**2, np.full(number, 5.0), np.full(number, 5.0), 0 * along, 0 * along,
         0.3 * along], axis=1,
    )  # fmt: skip
    samples[2, [3, 5]] = 1e10, 1.0
    slid = {"arm_min": 0.3, "stroke_max": 0.2, "rail_box": (-1.0, -0.2, 0.4, 0.3)}
    limits = replace(EVERY_KIND, **slid, cylinder_dead_length=0.9, cylinder_extended_max=1.0)
    numbers = numbers_of(limits, poses, driven)
    sort = np.arange(count)
    labels = np.zeros((count, 14))
    labels[:, 0] = sort % 3 == 2
    for first, kind in ((1, sort % 3), (6, sort // 3)):
        labels[:, first : first + 2] = random.normal(size=(count, 2))
        labels[:, first + 2], labels[:, first + 3], labels[:, first + 4] = 1.0, kind == 2, kind > 0
    labels[:, 0] *= sort % 2
    labels[:, 11:13], labels[:, 13] = np.sign(random.normal(size=(count, 2))), 1.0
    x = 0.7 * random.normal(size=(count, 11))[:, : 11 if driven else 10]

    def work(module: ModuleType) -> list[Any]:
        kernel = module.PairRows(samples, numbers, driven)
        return [*kernel.evaluate_candidates(x, labels, 3, True), *kernel.linearise(x, labels, 10.0, 3)]

    same(work, 1e-8)
