"""Refinements of candidates agree with the general kinematics, with differences and with dense least squares.

A wrong derivative, a wrong pose or a step that loses the order of the samples would show here.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from synthesis.constraints import Constraints
from synthesis.descents import Problem, Stage, Timed
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import AnyChart, GrashofChart
from synthesis.free.joint import JointProblem
from synthesis.free.limited import limited_problem
from synthesis.limits import Limits, Reach
from synthesis.mechanism import Placed
from synthesis.poses import Poses
from synthesis.search.prescribed import GivenProblem
from synthesis.target import Interval, Samples, Target

LENGTHS = np.array([[0.15, 0.3, 0.25, 0.3], [0.4, 0.25, 0.28, 0.07]])
FOURBARS = [AnyChart(), GrashofChart()]
every_chart = pytest.mark.parametrize("chart", FOURBARS, ids=["any", "grashof"])
timings = pytest.mark.parametrize("timing", ["free", "given"])
limited_timings = pytest.mark.parametrize(
    ("timing", "posed"),
    [("free", True), ("given", True), ("given", False)],
    ids=["free", "given", "given, of shape and start"],
)
MARGIN = 1e-7
"""Margin by which refinements satisfy limits."""
LIMITS = Limits(
    transmission_angle_min=0.6,
    transmission_angle_min_turn=0.3,
    link_max=0.6,
    pivot_a=0.1 - 0.3j,
    pivot_b_box=(1.0, -0.2, 2.0, 0.1),
    pivot_reach=Reach(0.1j, 0.9, 0.9),
    coupler_radius_max=0.4,
    envelope=(-1.0, -0.8, 1.2, 0.7),
)
"""Of nearly every kind; no linkage keeps them all."""
ON_SHAPE = Limits(
    transmission_angle_min=1.2, transmission_angle_min_turn=0.9, link_min=0.9, links=(0.95, None, None, None)
)
"""Limits that concern no pose."""


def poses(rotation: bool = True, position: bool = True, samples: int = 11) -> Poses:
    """Return poses with unequal weights."""
    random = np.random.default_rng(7)
    points = np.cumsum(random.standard_normal(samples) + 1j * random.standard_normal(samples))
    turned = np.cumsum(random.uniform(0, 0.3, samples)) if rotation else None
    weights = random.uniform(0.5, 2.0, (2, samples))
    weighed = {
        "rotation_weights": weights[0] if rotation else None,
        "position_weights": weights[1] if position else None,
    }
    return Poses(turned, points if position else None, length_scale=2.0, **weighed)


def candidates(
    chart: Any,
    rotation: bool = True,
    limits: Limits | None = None,
    position: bool = True,
    timing: str = "free",
    posed: bool = True,
    **fixed: float,
) -> tuple[Any, Timed]:
    """Two candidates, a crank-rocker and a double-crank, some way off some poses, in their best pose there.

    ``fixed``: start or offset of a given timing; ``posed``: whether its limits concern the pose.
    """
    request = poses(rotation, position)
    angles = np.cumsum(np.random.default_rng(8).uniform(0.1, 0.8, (2, request.samples)), axis=1)
    timed = unposed(chart.unknowns(LENGTHS), angles, np.array([1.0, -1]))
    if timing == "free":
        plain: Problem = JointProblem(request, chart)
        problem = plain if limits is None else limited_problem(request, chart, limits)
        return problem, plain.measured(timed, facing=True).timed
    samples = (vars(request)[name] for name in Samples.__dataclass_fields__)
    target = Target(*samples, crank=angles[0] - angles[0, 0], **fixed)
    middle, scale = (request.middle, request.length_scale) if posed else (0j, 1.0)
    problem = plain = GivenProblem(target, chart)
    if limits is not None:
        problem = GivenProblem(target, chart, Constraints(limits, middle, scale, exact=False), posed)
    start = np.full((2, 1), fixed.get("start", 0.9))
    return problem, plain.measured(timed._replace(angles=start)).timed


def unposed(shape: np.ndarray, angles: np.ndarray, branch: Any = 1.0) -> Timed:
    """Candidates (n, m) at crank angles (n, N), in no pose yet."""
    count = len(shape)
    return Timed(
        shape, np.zeros((count, 3), dtype=complex), np.zeros(count), angles, np.broadcast_to(branch, count) + 0.0
    )


def asked_of(problem: Any) -> Any:
    """The motion that a problem is made of."""
    return problem.target if isinstance(problem, GivenProblem) else problem.poses


def angles_of(problem: Any, timed: Timed) -> np.ndarray:
    """Crank angles (n, N) at all samples."""
    return timed.angles + problem.target.crank if isinstance(problem, GivenProblem) else timed.angles


def body_of(problem: Any, timed: Timed) -> np.ndarray:
    """theta2 at all samples by the general kinematics, (n, N)."""
    lengths, angles = problem.chart.shape(timed.shape).lengths, angles_of(problem, timed)
    return coupler_angle(lengths, timed.branch, angles)


def naive_residual(problem: Any, timed: Timed) -> np.ndarray:
    """The samples' rows by the general kinematics, (n, R N): rotations, then x, then y."""
    request, turned, rows = asked_of(problem), body_of(problem, timed), []
    if request.rotation is not None:
        mean = request.rotation_mean
        gap = request.rotation - timed.offset[:, None] - turned
        if isinstance(problem, GivenProblem):
            gap = gap - (mean(request.rotation) if request.offset is None else request.offset)
            if request.offset is not None:
                gap = gap - 2 * np.pi * np.round(mean(gap) / (2 * np.pi))[:, None]
        else:
            gap = np.angle(np.exp(1j * gap))
        rows.append(mean.root * gap)
    if request.position is not None:
        a, z1, z2 = timed.pose.T[:, :, None]
        at = a + z1 * np.exp(1j * angles_of(problem, timed)) + z2 * np.exp(1j * turned)
        gap = request.position_mean.root * (request.scaled - at)
        rows += [gap.real, gap.imag]
    return np.concatenate(rows, axis=1)


def naive_cost(problem: Any, timed: Timed) -> np.ndarray:
    """J squared, (n,)."""
    return np.sum(naive_residual(problem, timed) ** 2, axis=1)


def naive_limits(problem: Any, limits: Limits, timed: Timed, posed: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return values (n, C) of the limits for the candidates, and which of them are equations."""
    lengths, request, angles = problem.chart.shape(timed.shape).lengths, asked_of(problem), angles_of(problem, timed)
    used = Interval(angles.min(axis=1), angles.max(axis=1))
    if not posed:
        found = Constraints(limits, exact=False)(Placed(lengths, timed.branch, used))
        return found.values, found.equal
    a, z1, z2 = timed.pose.T
    placed = Placed(lengths * (np.abs(z1) / lengths[:, 0])[:, None], timed.branch, used, a, np.angle(z1), z2)
    found = Constraints(limits, request.middle, request.length_scale, exact=False)(placed)
    return found.values, found.equal


def unknowns_of(problem: Any, timed: Timed) -> int:
    """Count the unknowns except free crank angles: pose, offset, shape, and the start for prescribed timing."""
    given_timing = timed.angles.shape[1] == 1
    return 6 * problem.has_position + problem.has_rotation + timed.shape.shape[1] + given_timing


def changed(problem: Any, timed: Timed, step: np.ndarray, turns: np.ndarray) -> Timed:
    """Candidates after steps (n, m) of pose, offset, shape and start, and turns (n, N) of free crank angles, uncut."""
    linear, size = 6 * problem.has_position + problem.has_rotation, timed.shape.shape[1]
    pose, offset = timed.pose, timed.offset
    if problem.has_position:
        pose = pose + step[:, 0:6:2] + 1j * step[:, 1:6:2]
    if problem.has_rotation:
        offset = offset + step[:, linear - 1]
    turns = turns if timed.angles.shape[1] > 1 else step[:, linear + size :]
    return Timed(timed.shape + step[:, linear : linear + size], pose, offset, timed.angles + turns, timed.branch)


def slopes(problem: Any, rows: Callable[[Timed], np.ndarray], timed: Timed) -> tuple[np.ndarray, np.ndarray]:
    """Central differences of rows (n, R) by all unknowns, (n, m, R), and by each free crank angle, (n, N, R)."""
    columns, step, count = unknowns_of(problem, timed), 1e-6, len(timed.branch)
    free = timed.angles.shape[1] if timed.angles.shape[1] > 1 else 0
    found = []
    for unit in np.eye(columns + free) * step:
        by = np.tile(unit, (count, 1))
        there, here = (
            rows(changed(problem, timed, direction * by[:, :columns], direction * by[:, columns:]))
            for direction in (1, -1)
        )
        found.append((there - here) / (2 * step))
    return np.stack(found[:columns], axis=1), np.array(found[columns:]).reshape(free, *found[0].shape).swapaxes(0, 1)


# -- rows --------------------------------------------------------------------------------------------------------------


@every_chart
@timings
@pytest.mark.parametrize(("rotation", "position"), [(True, True), (False, True), (True, False)])
def test_rows_and_derivatives_are_those_of_the_general_kinematics(
    chart: Any, timing: str, rotation: bool, position: bool
) -> None:
    problem, timed = candidates(chart, rotation, position=position, timing=timing)
    by_unknowns, by_angles = slopes(problem, partial(naive_residual, problem), timed)
    for k, block in enumerate(problem.linearised(timed, 1e-3)):
        np.testing.assert_allclose(block["rows"][-1], naive_residual(problem, timed)[k], atol=1e-14)
        np.testing.assert_allclose(block["rows"][:-1], by_unknowns[k], atol=2e-8)
        if timing == "free":
            own = by_angles[k].reshape(problem.samples, -1, problem.samples)
            np.testing.assert_allclose(
                block["turn"].reshape(-1, problem.samples), np.einsum("iri->ri", own), atol=2e-8
            )


@every_chart
@limited_timings
def test_rows_of_limits_and_their_derivatives(chart: Any, timing: str, posed: bool) -> None:
    limits, weight = LIMITS if posed else ON_SHAPE, 3.0
    problem, timed = candidates(chart, limits=limits, timing=timing, posed=posed)
    values, equal = naive_limits(problem, limits, timed, posed)
    by_unknowns, by_angles = slopes(problem, lambda moved: naive_limits(problem, limits, moved, posed)[0], timed)
    reported = problem.linearised(timed, 1e-3, weight)
    for k, block in enumerate(reported):
        broken = np.flatnonzero(np.where(equal, values[k] != 0, values[k] < MARGIN))
        # the envelope's extremes, which lie between the angles looked at
        traced = broken >= values.shape[1] - 12 if posed else np.zeros(broken.size, dtype=bool)
        assert ((~traced).sum() > 5 and traced.sum() > 5) if posed else broken.size > 1
        rows = block["rows"][:, 3 * problem.samples :]
        np.testing.assert_allclose(rows[-1], weight * (MARGIN * ~equal - values[k])[broken], atol=1e-14)
        found, expected = rows[:-1], by_unknowns[k]
        if timing == "free":
            beside = np.zeros((problem.samples, broken.size))
            beside[block["at_sample"], np.arange(broken.size)] = block["by_angle"]
            found, expected = np.vstack([found, beside]), np.vstack([expected, by_angles[k]])
        expected = expected[:, broken] * -weight
        np.testing.assert_allclose(found[:, ~traced], expected[:, ~traced], atol=1e-6)
        np.testing.assert_allclose(found[:, traced], expected[:, traced], rtol=1e-3, atol=3e-3)
    by_crank = [
        block["by_angle"] if timing == "free" else block["rows"][-2, 3 * problem.samples :] for block in reported
    ]
    assert np.abs(np.concatenate(by_crank)).max() > 0.1


# -- descents ----------------------------------------------------------------------------------------------------------


@every_chart
@timings
def test_descents_never_get_worse_and_keep_the_order(chart: Any, timing: str) -> None:
    problem, timed = candidates(chart, False, timing=timing)
    done = problem.descended(timed, [Stage(30)])
    assert np.all(done.cost <= naive_cost(problem, timed))
    # beside a change point lengths determine less than the unknowns
    np.testing.assert_allclose(done.cost, naive_cost(problem, done.timed), rtol=1e-6)
    angles = angles_of(problem, done.timed)
    assert np.all(np.diff(angles, axis=1) > 0) and np.all(np.ptp(angles, axis=1) < 2 * np.pi)
