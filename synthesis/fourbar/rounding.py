"""Link lengths rounded to a grid for manufacturing, with start, pose and offset fitted anew."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import close_loop, wrap
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.solution import Solution, assess, four
from synthesis.least_squares import Evaluation, minimise
from synthesis.pose import rotation_residual
from synthesis.target import TURN, Target
from synthesis.work import Work

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_STEPS = 400
_AROUND = 0.4 * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
"""Starts and ground angles beside the solution's, in radians: rounded links may have their best place in another valley."""
_DIFFERENCE = 1e-6


def round_solution(target: Target, solution: Solution, grid: float, work: Work | None = None) -> Solution | None:
    """The solution with its links rounded to a grid and everything else fitted anew.

    Parameters
    ----------
    target : Target
        With positions: only then are lengths actual.
    solution : Solution
    grid : float
        Step of the lengths, in the user's unit; a link is at least one step long.
    work : Work, optional
        Once it has expired the rest is fitted no better than it is by then.

    Returns
    -------
    Solution or None
        None where the rounded linkage does not close over the samples. Fitted are the start, the ground angle, the pivot, the
        coupler point and the offset. Law: no length is off the grid, none moved by more than half a step (or up to one step).
    """
    old = solution.linkage
    links = np.maximum(np.round(np.array(old.links) / grid), 1.0) * grid

    def evaluate(place: Floats, branch: Floats) -> Evaluation:
        residual = _fit(target, links, branch, place)[0]
        stack = np.empty((len(place), 3, residual.shape[1]))
        stack[:, 2] = residual
        for k in range(2):
            step = _DIFFERENCE * np.eye(2)[k]
            ahead, behind = (_fit(target, links, branch, moved)[0] for moved in (place + step, place - step))
            stack[:, k] = (ahead - behind) / (2 * _DIFFERENCE)
        cost = np.einsum("nm,nm->n", residual, residual)
        # next to where it opens there are no derivatives: such a place is no answer, unless it is all there is
        return Evaluation(np.where(np.isnan(stack).any(axis=(1, 2)), np.inf, cost), np.nan_to_num(stack))

    branch = np.full(len(_AROUND), float(old.branch))
    found = minimise(
        evaluate,
        np.array([old.start, old.ground_angle]) + _AROUND,
        branch,
        _STEPS,
        0.0,
        work,
        stall=0.0,
        damping=1e-6,
    )
    place = found.unknowns[[found.cost.argmin()]]
    start, turn = place[0]
    residual, pivot, coupler = _fit(target, links, branch[:1], place)
    if np.isnan(residual).any():
        return None
    point = float(abs(coupler[0])), wrap(float(np.angle(coupler[0])))
    linkage = Linkage(four(links), old.branch, float(start % TURN), complex(pivot[0]), wrap(float(turn)), point)
    return assess(target, [linkage])[0]


def _fit(target: Target, links: Floats, branch: Floats, place: Floats) -> tuple[Floats, Complexes, Complexes]:
    """Residuals of the objective (n, rows), pivot A and coupler vector (n,) at starts and ground angles; NaN where it opens."""
    assert target.position is not None
    start, turn = place[:, :1], place[:, 1:]
    crank = start + target.crank
    angle = close_loop(links, crank).coupler_angle(branch)
    parts: list[Any] = []
    if target.rotation is not None:
        parts.append(rotation_residual(target, angle)[1] * target.rotation_mean.root)
    mean, scale = target.position_mean, target.length_scale
    middle = mean(target.position)
    wanted = (target.position - middle - links[0] * np.exp(1j * (crank + turn))) / scale
    arm = np.exp(1j * (angle + turn))
    own = arm - mean(arm)[:, None]
    square = mean(np.abs(own) ** 2)
    independent = square > 1e-28
    coupler: Any = np.where(independent, mean(np.conj(own) * wanted), 0.0) / np.where(independent, square, 1.0)
    gap = (wanted - mean(wanted)[:, None] - coupler[:, None] * own) * mean.root
    pivot = middle + scale * (mean(wanted) - coupler * mean(arm))
    return np.concatenate([*parts, gap.real, gap.imag], axis=1), pivot, scale * coupler
