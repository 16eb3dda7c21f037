"""The manufacturing view: link lengths on a grid, and the best that is left to fit then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import close_loop
from synthesis.fourbar.pose import Mount, rotation_residual, wrap
from synthesis.fourbar.solution import Solution, finish_solutions
from synthesis.target import Target

Floats = NDArray[np.float64]

_STEPS = 40


def round_solution(target: Target, solution: Solution, grid: float) -> Solution | None:
    """The solution with its links rounded to a grid and everything else fitted anew.

    Parameters
    ----------
    target : Target
        With positions: only then are lengths actual.
    solution : Solution
    grid : float
        Step of the lengths, in the user's unit; a link is at least one step long.

    Returns
    -------
    Solution or None
        None where the rounded linkage does not close over the samples. Fitted are the start, the ground angle, the pivot, the
        coupler point and the offset. Law: no length is off the grid, none moved by more than half a step (or up to one step).
    """
    links = np.maximum(np.round(solution.links / grid), 1.0) * grid
    place = np.array([solution.start, solution.mount.ground_angle])
    state = _fit(target, links, solution.branch, place)
    if state is None:
        return None
    damping = 1e-6
    for _ in range(_STEPS):
        residual, pose = state
        slopes = []
        for k in range(2):
            step = np.zeros(2)
            step[k] = 1e-6
            ahead, behind = (_fit(target, links, solution.branch, place + s) for s in (step, -step))
            if ahead is None or behind is None:
                return _solution(target, links, solution.branch, place, pose)
            slopes.append((ahead[0] - behind[0]) / 2e-6)
        matrix = np.stack(slopes, axis=1)
        moved = False
        while damping < 1e6 and not moved:
            scaled = np.vstack([matrix, np.diag(np.sqrt(damping) * np.linalg.norm(matrix, axis=0))])
            step = np.linalg.lstsq(scaled, -np.concatenate([residual, np.zeros(2)]), rcond=None)[0]
            new = _fit(target, links, solution.branch, place + step)
            if new is not None and new[0] @ new[0] < residual @ residual:
                moved, place, state = True, place + step, new
                damping = max(damping / 10, 1e-12)
            else:
                damping *= 10
        if not moved or np.max(np.abs(step)) < 1e-12:
            break
    return _solution(target, links, solution.branch, place, state[1])


def _fit(target: Target, links: Floats, branch: int, place: Floats) -> tuple[Floats, Mount] | None:
    """Residual of the objective and the pose at a start and ground angle; None where the loop does not close."""
    start, ground_angle = place
    crank = start + target.crank
    closure = close_loop(links, crank)
    if not closure.closed.all():
        return None
    angle = closure.coupler_angle(branch)
    parts = []
    if target.rotation is not None:
        parts.append(rotation_residual(target, angle[None, :])[1][0])
    scale = target.length_scale
    mean = target.position.mean()
    wanted = (target.position - mean - links[0] * np.exp(1j * (crank + ground_angle))) / scale
    arm = np.exp(1j * (angle + ground_angle))
    arm_mean, wanted_mean = arm.mean(), wanted.mean()
    own = arm - arm_mean
    square = float(np.mean(np.abs(own) ** 2))
    coupler = np.mean(np.conj(own) * wanted) / square if square > 1e-28 else 0.0
    gap = wanted - wanted_mean - coupler * own
    parts += [gap.real, gap.imag]
    pivot = mean + scale * (wanted_mean - coupler * arm_mean)
    pivot_b = pivot + links[3] * np.exp(1j * ground_angle)
    pose = Mount(
        1.0,
        wrap(ground_angle),
        complex(pivot),
        complex(pivot_b),
        float(scale * abs(coupler)),
        wrap(float(np.angle(coupler))),
    )
    return np.concatenate(parts) / np.sqrt(target.samples), pose


def _solution(target: Target, links: Floats, branch: int, place: Floats, pose: Mount) -> Solution:
    start = np.array([place[0] % (2 * np.pi)])
    return finish_solutions(target, links[None, :], np.array([branch]), start, [pose])[0]
