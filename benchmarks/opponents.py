"""Other ways to a linkage, for comparison in the same run: scipy's differential evolution and pylinkage's motion generation."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.classes import generator
from synthesis.charts import FullCrankChart
from synthesis.fourbar import TURN, close_loop
from synthesis.mounting import objective
from synthesis.refine import Problem
from synthesis.target import Target

EVOLUTION_GENERATIONS = (5, 20, 80, 320, 1280)
_EVOLUTION_BOUNDS = [(-6.0, 6.0), (-12.0, 3.0), (-6.0, 6.0), (0.0, TURN)]
_EVOLUTION_POPULATION = 10
POSE_SUBSETS = (1, 3, 9)
POSE_SECONDS = 3.0
"""No further subset is begun after this much time of the processor."""
_POSES = (3, 4, 5)
_UNTIMED_CRANK = np.linspace(0, TURN, 720, endpoint=False)


def missing() -> dict[str, str]:
    """Opponents that cannot take part, and why."""
    reasons = {"scipy": "differential evolution", "pylinkage": "motion generation"}
    return {
        name: f"{what} skipped: {name} is not installed"
        for name, what in reasons.items()
        if importlib.util.find_spec(name) is None
    }


def evolve(target: Target, generations: int, seed: int) -> float:
    """Least J by differential evolution, one run a branch, over the same four unknowns with everything linear projected out.

    scipy's own polishing (L-BFGS-B) follows, as is its default. The crank must turn counter-clockwise.
    """
    from scipy.optimize import differential_evolution

    problem = Problem(target, FullCrankChart())
    best = np.inf
    for branch in (1.0, -1.0):

        def cost(unknowns: np.ndarray, branch: float = branch) -> np.ndarray:
            points = np.atleast_2d(unknowns.T)
            value = problem.evaluate(points, np.full(len(points), branch), derivatives=False).cost
            value = np.where(np.isfinite(value), value, 1e6)
            return value if unknowns.ndim == 2 else value[0]

        done = differential_evolution(
            cost,
            _EVOLUTION_BOUNDS,
            maxiter=generations,
            popsize=_EVOLUTION_POPULATION,
            tol=0,
            atol=0,
            rng=seed,
            updating="deferred",
            vectorized=True,
        )
        best = min(best, float(done.fun))
    return float(np.sqrt(max(best, 0.0)))


def pose_subsets(samples: int, seed: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Samples to use as precision poses: for 3, 4 and 5 poses, evenly spaced first, then at random."""
    random = generator("poses", seed)
    yield tuple(np.round(np.linspace(0, samples - 1, count)).astype(int) for count in _POSES)
    while True:
        yield tuple(np.sort(random.choice(samples, count, replace=False)) for count in _POSES)


def generate_motion(target: Target, seed: int) -> Iterator[tuple[int, float, float, float]]:
    """pylinkage's motion generation on more and more subsets of the poses, the best kept.

    Yields
    ------
    subsets : int
    seconds : float
        Of the processor, of pylinkage's calls alone: choosing among its answers costs it nothing here.
    timed : float
        Least J of an answer whose crank starts where the answer puts it and turns as the request says; offset and pose are
        fitted anew, in its favour.
    untimed : float
        The same measure where each requested pose counts by the nearest of the motion, whatever the crank angle: precision
        poses say nothing about the crank.
    """
    from pylinkage.synthesis import Pose, motion_generation

    timed = untimed = np.inf
    spent = 0.0
    for number, chosen_poses in enumerate(pose_subsets(target.samples, seed), 1):
        for chosen in chosen_poses:
            poses = [Pose(p.real, p.imag, r) for p, r in zip(target.position[chosen], target.rotation[chosen])]
            begin = time.process_time()
            found = motion_generation(poses, max_solutions=50, require_grashof=False).raw_solutions
            spent += time.process_time() - begin
            for answer in found:
                crank_at, free = _judge(target, int(chosen[0]), answer)
                timed, untimed = min(timed, crank_at), min(untimed, free)
        if number in POSE_SUBSETS:
            yield number, spent, float(timed), float(untimed)
        if number == max(POSE_SUBSETS):
            return
        if spent > POSE_SECONDS:
            for later in (subsets for subsets in POSE_SUBSETS if subsets > number):
                yield later, spent, float(timed), float(untimed)
            return


def _judge(target: Target, first: int, answer: Any) -> tuple[float, float]:
    """Timed and untimed error of an answer, either of its two pivoted links as the crank."""
    pivots = [complex(*answer.ground_pivot_a), complex(*answer.ground_pivot_d)]
    pins = [complex(*answer.crank_pivot_b), complex(*answer.coupler_pivot_c)]
    timed = untimed = np.inf
    for a, b in ((0, 1), (1, 0)):
        ground, coupler = pivots[b] - pivots[a], pins[b] - pins[a]
        crank, rocker = pins[a] - pivots[a], pins[b] - pivots[b]
        lengths = np.abs([crank, coupler, rocker, ground])
        start = np.angle(crank / ground)
        branch = 1.0 if (np.conj(pivots[b] - pins[a]) * coupler).imag > 0 else -1.0
        angles = start + target.crank - target.crank[first]
        angle = close_loop(lengths, angles[None]).coupler_angle(branch)
        if np.all(np.isfinite(angle)):
            timed = min(timed, objective(target, angles[None], angle)[0])
        untimed = min(untimed, _untimed(target, first, lengths, branch, start, pivots[a], pins[a], np.angle(ground)))
    return timed, untimed


def _untimed(
    target: Target,
    first: int,
    lengths: np.ndarray,
    branch: float,
    start: float,
    pivot: complex,
    pin: complex,
    ground_angle: float,
) -> float:
    crank = np.concatenate([[start], start + _UNTIMED_CRANK])
    angle = close_loop(lengths, crank).coupler_angle(branch)
    keep = np.isfinite(angle)
    if not keep[0]:
        return np.inf
    turned = angle[keep] - angle[0]
    pins = pivot + lengths[0] * np.exp(1j * (crank[keep] + ground_angle))
    points = pins + np.exp(1j * turned) * (target.position[first] - pin)
    gap = target.rotation[:, None] - (target.rotation[first] + turned)
    gap = gap - TURN * np.round(gap / TURN)
    square = gap**2 + (np.abs(target.position[:, None] - points) / target.length_scale) ** 2
    return float(np.sqrt(np.mean(square.min(axis=1))))
