"""Baselines for comparison in the same run: differential evolution of scipy and motion generation of pylinkage."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks import product
from benchmarks.report import Times
from tests.oracles.classes import generator

EVOLUTION_GENERATIONS = (5, 20, 80, 320, 1280)
_EVOLUTION_BOUNDS = [(-6.0, 6.0), (-12.0, 3.0), (-6.0, 6.0), (0.0, product.TURN)]
_EVOLUTION_POPULATION = 10
_EVOLUTION_SPREAD = 1e-8
_GAPS = 2.5
"""Largest natural logarithm of a gap between crank angles before all gaps are scaled to the span."""
POSE_SUBSETS = (1, 3, 9)
POSE_SECONDS = 3.0
"""Processor time in seconds after which no further subset is started."""
_POSES = (3, 4, 5)
_UNTIMED_CRANK = np.linspace(0, product.TURN, 720, endpoint=False)


def need() -> None:
    """Exit before the measurement if pylinkage is not installed."""
    if not importlib.util.find_spec("pylinkage"):
        raise SystemExit("pylinkage is not installed: pip install -e '.[baselines]'")


def evolve(target: product.Target, generations: int, seed: int) -> float:
    """Minimize the error by differential evolution over the unknowns of the search, with the linear unknowns projected out.

    There is a run for each branch. A run ends after a fixed number of generations, if the error is below the
    tolerance of the search, or if the population has converged: the standard deviation of its costs is less than
    1e-8 of their mean or less than the square of the tolerance. The polishing of scipy (L-BFGS-B) follows. If an
    error is within the tolerance, no second branch is tried. The crank must turn counter-clockwise.
    """
    problem = product.GivenProblem(target, product.GrashofChart())
    best, goal = np.inf, product.DEFAULT_TOLERANCE**2
    for branch in (1.0, -1.0):

        def cost(unknowns: np.ndarray, branch: float = branch) -> np.ndarray:
            points = np.atleast_2d(unknowns.T)
            timed = product.candidates_at(points[:, :3], np.full(len(points), branch), points[:, 3])
            value = problem.measured(timed).cost
            value = np.where(np.isfinite(value), value, 1e6)
            return value if unknowns.ndim == 2 else value[0]

        done = _evolved(cost, _EVOLUTION_BOUNDS, generations, seed)
        best = min(best, float(done.fun))
        if best <= goal:
            break
    return float(np.sqrt(max(best, 0.0)))


def evolve_poses(position: np.ndarray, rotation: np.ndarray, generations: int, seed: int) -> float:
    """Minimize the error of poses without crank angles by differential evolution over shape, start and crank gaps.

    There is a run for each branch and direction. Pose and offset are projected out; positive gaps preserve the
    order. A run ends as in `evolve`.
    """
    problem = product.JointProblem(product.make_poses(rotation, position), product.GrashofChart())
    bounds = [*_EVOLUTION_BOUNDS, (0.05, 0.999 * product.TURN)] + [(-_GAPS, _GAPS)] * (position.size - 1)
    best, goal = np.inf, product.DEFAULT_TOLERANCE**2
    for branch, direction in itertools.product((1.0, -1.0), (1.0, -1.0)):

        def cost(unknowns: np.ndarray, branch: float = branch, direction: float = direction) -> np.ndarray:
            points = np.atleast_2d(unknowns.T)
            gaps = np.exp(points[:, 5:])
            steps = np.cumsum(gaps / gaps.sum(axis=1, keepdims=True), axis=1) * points[:, 4:5]
            angles = points[:, 3:4] + direction * np.concatenate([np.zeros((len(points), 1)), steps], axis=1)
            pose, sides = np.zeros((len(points), 3), dtype=complex), np.full(len(points), branch)
            timed = product.Timed(points[:, :3], pose, np.zeros(len(points)), angles, sides)
            value = problem.measured(timed, facing=True).cost
            value = np.where(np.isfinite(value), value, 1e6)
            return value if unknowns.ndim == 2 else value[0]

        done = _evolved(cost, bounds, generations, seed, polish=False)
        best = min(best, float(done.fun))
        if best <= goal:
            break
    return float(np.sqrt(max(best, 0.0)))


def _evolved(
    cost: Any, bounds: Sequence[tuple[float, float]], generations: int, seed: int, polish: bool = True
) -> Any:
    """Return the result of scipy for a cost of unknowns (k,) or (k, n), with the stopping criteria of `evolve`."""
    from scipy.optimize import differential_evolution

    goal = product.DEFAULT_TOLERANCE**2
    return differential_evolution(
        cost,
        bounds,
        maxiter=generations,
        popsize=_EVOLUTION_POPULATION,
        tol=_EVOLUTION_SPREAD,
        atol=goal,
        rng=seed,
        updating="deferred",
        vectorized=True,
        polish=polish,
        callback=lambda intermediate_result: intermediate_result.fun <= goal,
    )


def pose_subsets(samples: int, seed: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield samples to use as precision poses: subsets of 3, 4 and 5 poses, evenly spaced first, then random."""
    random = generator("poses", seed)
    yield tuple(np.round(np.linspace(0, samples - 1, count)).astype(int) for count in _POSES)
    while True:
        yield tuple(np.sort(random.choice(samples, count, replace=False)) for count in _POSES)


def generate_motion(target: product.Target, seed: int) -> Iterator[tuple[int, float, float, float]]:
    """Run the motion generation of pylinkage on an increasing number of subsets of the poses.

    The motion is centred at the origin and has size 1, as its tolerances require.

    Yields
    ------
    subsets : int
        Number of subsets so far.
    seconds : float
        Processor time of the calls of pylinkage; the selection of its best answer is not counted.
    timed : float
        Smallest error of an answer whose crank starts at the angle of the answer and turns as in the request;
        offset and pose are fitted again, in its favour.
    untimed : float
        Smallest error if each requested pose is compared with the nearest pose of the motion, since precision poses
        do not prescribe crank angles.
    """
    from pylinkage.synthesis import Pose, motion_generation

    position = (target.position - target.position.mean()) / target.length_scale
    target = product.make_target(target.rotation, position, crank_angle=target.crank)
    timed = untimed = np.inf
    times, subsets = Times(), pose_subsets(target.samples, seed)
    for number in range(1, max(POSE_SUBSETS) + 1):
        for chosen in next(subsets) if sum(times.processor) <= POSE_SECONDS else ():
            poses = [Pose(p.real, p.imag, r) for p, r in zip(target.position[chosen], target.rotation[chosen])]
            found = times.run(motion_generation, poses, max_solutions=50, require_grashof=False)
            for answer in found.raw_solutions:
                crank_at, free = _judge(target, int(chosen[0]), answer)
                timed, untimed = min(timed, crank_at), min(untimed, free)
        if number in POSE_SUBSETS:
            yield number, sum(times.processor), float(timed), float(untimed)


def motion_through_poses(position: np.ndarray, rotation: np.ndarray) -> float:
    """Return the smallest error of the answers of pylinkage to a few poses, in any order and branch.

    The error is the rms change of the lengths of crank and rocker that the poses require, relative to the size of
    the motion.
    """
    from pylinkage.synthesis import Pose, motion_generation

    middle = position.mean()
    normalised = (position - middle) / np.max(np.abs(position - middle))
    poses = [Pose(p.real, p.imag, r) for p, r in zip(normalised, rotation)]
    best = np.inf
    for answer in motion_generation(poses, max_solutions=50, require_grashof=False).raw_solutions:
        pivots = np.array([complex(*answer.ground_pivot_a), complex(*answer.ground_pivot_d)])
        pins = np.array([complex(*answer.crank_pivot_b), complex(*answer.coupler_pivot_c)])
        moved = normalised[:, None] + np.exp(1j * (rotation - rotation[0]))[:, None] * (pins - normalised[0])
        lengths = np.abs(moved - pivots)
        best = min(best, float(np.sqrt(np.mean((lengths - lengths.mean(axis=0)) ** 2))))
    return best


def _judge(target: product.Target, first: int, answer: Any) -> tuple[float, float]:
    """Return the timed and the untimed error of an answer, with either of its two pivoted links as the crank."""
    pivots = [complex(*answer.ground_pivot_a), complex(*answer.ground_pivot_d)]
    pins = [complex(*answer.crank_pivot_b), complex(*answer.coupler_pivot_c)]
    timed = untimed = np.inf
    for a, b in ((0, 1), (1, 0)):
        ground, coupler, crank = pivots[b] - pivots[a], pins[b] - pins[a], pins[a] - pivots[a]
        lengths = np.abs([crank, coupler, pins[b] - pivots[b], ground])
        start = np.angle(crank / ground)
        branch = 1.0 if (np.conj(pivots[b] - pins[a]) * coupler).imag > 0 else -1.0
        angle = product.close_loop(lengths, start + target.crank[None] - target.crank[first]).coupler_angle(branch)
        if np.all(np.isfinite(angle)):
            timed = min(timed, product.objective(target, angle)[0])
        turn = start + np.concatenate([[0.0], _UNTIMED_CRANK])
        angle = product.close_loop(lengths, turn).coupler_angle(branch)
        closes = np.isfinite(angle)
        if closes[0]:
            turned = angle[closes] - angle[0]
            pin = pivots[a] + lengths[0] * np.exp(1j * turn[closes]) * ground / abs(ground)
            points = pin + np.exp(1j * turned) * (target.position[first] - pins[a])
            gap = target.rotation[:, None] - (target.rotation[first] + turned)
            gap = gap - product.TURN * np.round(gap / product.TURN)
            square = gap**2 + (np.abs(target.position[:, None] - points) / target.length_scale) ** 2
            untimed = min(untimed, float(np.sqrt(np.mean(square.min(axis=1)))))
    return timed, untimed
