"""Sequential quadratic steps of many candidates within limits: least squares, or the minimax error.

With the weighted errors e and the conditions c of the limits at the unknowns x of a candidate, linearized in a step d, a step
is the solution of a convex program in (d, h, s)::

    minimax error         minimise h + nu s              over |e + J d| <= h
    least squares         minimise |e + J d|^2 / (2 |e|) + nu s
    both                  over c + C d + s >= 0, s >= 0, |d| <= radius, x + d in the box

The step is accepted if h + nu s decreases at its true values; the radius grows and shrinks with the quality of the
prediction (Madsen and Schjaer-Jacobsen, Linearly constrained minimax optimization, Math. Programming 14 (1978)
208-223).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from synthesis.arrays import Flags, Floats, Ints
from synthesis.quadratic import minimise_quadratics
from synthesis.work import Work


@dataclass(frozen=True)
class DescentOptions:
    """Options of the quadratic steps."""

    penalty: float = 1000.0
    """Cost nu of a violation by one radian, or by one in a logarithm; it exceeds the possible gain in error."""
    first_radius: float = 0.2
    """Radius of the first step."""
    radius_max: float = 1.0
    """Largest radius of a step."""
    radius_min: float = 1e-12
    """Radius below which a candidate ends."""


OPTIONS = DescentOptions()


class Linear(NamedTuple):
    """Errors and conditions of candidates with their derivatives by the k free unknowns."""

    error: Floats
    """(n, M): weighted; infinite if a candidate is impossible."""
    slope: Floats
    """(n, M, k)"""
    condition: Floats
    """(n, m)"""
    condition_slope: Floats
    """(n, m, k)"""


class Linearise(Protocol):
    """Linearization of a problem."""

    def __call__(self, unknowns: Floats, which: Ints) -> Linear:
        """Return errors and conditions of the candidates ``which`` at unknowns (n, 5)."""


class Descended(NamedTuple):
    """Candidates after their descent."""

    unknowns: Floats
    size: Floats
    """(n,): the largest error, or the root mean square error."""
    broken: Floats
    """(n,): violation of the worst condition."""
    ended: Flags
    """(n,): True if the linear program predicts no further gain."""
    radius: Floats
    """(n,): radius of the next step."""

    @property
    def merit(self) -> Floats:
        """Size and the penalty of violated conditions, (n,)."""
        return self.size + OPTIONS.penalty * self.broken


def descend(
    linear: Linearise,
    unknowns: Floats,
    free: Ints,
    box: tuple[Floats, Floats],
    *,
    largest: bool,
    steps: int,
    gain: float,
    work: Work,
    radius: Floats | float = OPTIONS.first_radius,
) -> Descended:
    """Minimize the error of candidates (n, 5), all at once.

    Parameters
    ----------
    linear : callable
        ``linear(unknowns, which)`` linearizes the candidates ``which`` at unknowns.
    unknowns : ndarray, shape (n, 5)
    free : ndarray of int, shape (k,)
        Unknowns that move.
    box : tuple of ndarray, shape (5,)
        Lower and upper bounds of the unknowns.
    largest : bool
        Minimize the largest error; otherwise the squared errors.
    steps : int
        Maximum number of steps.
    gain : float
        A candidate has ended if its program predicts a smaller relative gain.
    work : Work
    radius : ndarray, shape (n,), or float
        Radius of the first step.

    Returns
    -------
    Descended
        Law: size + penalty * violation of a candidate never exceeds its initial value.
    """
    unknowns = np.clip(unknowns, *box)
    count = len(unknowns)
    accuracy = min(1e-3, 0.1 * gain)
    here = linear(unknowns, np.arange(count))
    merit = _merit(here, largest)
    radii = np.full(count, radius, dtype=float)
    ended = np.full(count, not free.size)
    active = np.flatnonzero(np.isfinite(merit) & ~ended)
    for _ in range(steps):
        if not active.size or work.expired():
            break
        active_model = Linear(*(values[active] for values in here))
        low, high = (edge[free] - unknowns[active][:, free] for edge in box)
        step, predicted = _program(active_model, radii[active], low, high, largest, accuracy)
        trial = _moved(unknowns[active], free, step, box)
        there = linear(trial, active)
        new = _merit(there, largest)
        # in a curved basin the step leaves the floor: correct it by the error of the first step (Fletcher, Practical
        # Methods of Optimization, 14.4)
        repeated = np.flatnonzero((merit[active] - new < 0.5 * (merit[active] - predicted)) & np.isfinite(new))
        if repeated.size:
            part = Linear(*(values[repeated] for values in active_model))
            missed = there.error[repeated] - (part.slope @ step[repeated][:, :, None])[:, :, 0]
            broke = there.condition[repeated] - (part.condition_slope @ step[repeated][:, :, None])[:, :, 0]
            part = part._replace(error=missed, condition=broke)
            back = _program(part, radii[active[repeated]], low[repeated], high[repeated], largest, accuracy)[0]
            corrected = _moved(unknowns[active[repeated]], free, back, box)
            corrected_model = linear(corrected, active[repeated])
            value = _merit(corrected_model, largest)
            helped = value < new[repeated]
            rows = repeated[helped]
            trial[rows], new[rows], step[rows] = corrected[helped], value[helped], back[helped]
            for column, found in zip(there, corrected_model):
                column[rows] = found[helped]
        expected = merit[active] - predicted
        ratio = (merit[active] - new) / np.maximum(expected, 1e-300)
        better = (new < merit[active]) & (ratio > 1e-3)
        took = active[better]
        unknowns[took], merit[took] = trial[better], new[better]
        for column, value in zip(here, there):
            column[took] = value[better]
        length = np.abs(step).max(axis=1)
        grown = np.where(ratio > 0.75, np.maximum(radii[active], 2.5 * length), radii[active])
        radii[active] = np.minimum(np.where(ratio < 0.25, 0.3 * length, grown), OPTIONS.radius_max)
        over = (expected <= gain * merit[active]) | (merit[active] < 1e-15)
        ended[active[over]] = True
        active = active[~over & (radii[active] > OPTIONS.radius_min)]
    return Descended(unknowns, _size(here.error, largest), _broken(here.condition), ended, radii)


def _moved(unknowns: Floats, free: Ints, step: Floats, box: tuple[Floats, Floats]) -> Floats:
    """Return unknowns (n, 5) after steps (n, k), within the box."""
    moved = unknowns.copy()
    moved[:, free] += step
    return np.clip(moved, *box)


def _size(error: Floats, largest: bool) -> Floats:
    if largest:
        return np.abs(error).max(axis=1)
    return np.sqrt(np.einsum("nm,nm->n", error, error))


def _broken(condition: Floats) -> Floats:
    return np.maximum(0.0, -condition.min(axis=1, initial=np.inf))


def _merit(model: Linear, largest: bool) -> Floats:
    merit = _size(model.error, largest) + OPTIONS.penalty * _broken(model.condition)
    return np.where(np.isnan(merit), np.inf, merit)


def _program(
    model: Linear, radius: Floats, low: Floats, high: Floats, largest: bool, accuracy: float
) -> tuple[Floats, Floats]:
    """Return the steps (n, k) of the programs, and the merits (n,) that they predict."""
    count, samples, size = model.slope.shape
    conditions = model.condition.shape[1]
    low, high = np.maximum(low, -radius[:, None]), np.minimum(high, radius[:, None])
    # give an unknown at its bound a little room, so that the starting point lies inside
    room = 1e-12 * radius[:, None]
    low, high = np.minimum(low, -room), np.maximum(high, room)
    z = np.zeros((count, size + 2))
    broken = _broken(model.condition)
    height = np.abs(model.error).max(axis=1)
    z[:, size] = 1.1 * height + 1e-12
    scale = np.maximum(height, broken)
    z[:, size + 1] = broken + 0.1 * scale + 1e-12
    rows = (2 * samples if largest else 0) + conditions + 2 * size + 1
    matrix, bound = np.zeros((count, rows, size + 2)), np.zeros((count, rows))
    at = 0
    if largest:
        for side in (-1.0, 1.0):
            part = slice(at, at + samples)
            matrix[:, part, :size], matrix[:, part, size] = side * model.slope, 1.0
            bound[:, part] = side * model.error
            at += samples
    part = slice(at, at + conditions)
    matrix[:, part, :size], matrix[:, part, size + 1] = model.condition_slope, 1.0
    bound[:, part] = model.condition
    at += conditions
    for side, edge in ((1.0, -low), (-1.0, high)):
        part = slice(at, at + size)
        matrix[:, part, :size] = side * np.eye(size)
        bound[:, part] = edge
        at += size
    matrix[:, at, size + 1] = 1.0
    hessian, gradient = np.zeros((count, size + 2, size + 2)), np.zeros((count, size + 2))
    gradient[:, size + 1] = OPTIONS.penalty
    norm = np.maximum(_size(model.error, False), 1e-300)[:, None]
    if largest:
        gradient[:, size] = 1.0
    else:
        turned = model.slope.transpose(0, 2, 1)
        hessian[:, :size, :size] = turned @ model.slope / norm[:, :, None]
        hessian[:, size, size] = 1.0
        gradient[:, :size] = (turned @ model.error[:, :, None])[:, :, 0] / norm
    z, _ = minimise_quadratics(hessian, gradient, matrix, bound, z, accuracy * np.maximum(height, 1e-300))
    step = z[:, :size]
    ahead = model.error + (model.slope @ step[:, :, None])[:, :, 0]
    linearised = model.condition + (model.condition_slope @ step[:, :, None])[:, :, 0]
    return step, _size(ahead, largest) + OPTIONS.penalty * _broken(linearised)
