"""Local optimization of an actuator's placement: the smallest peak force near given ends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.drives.leverage import leverage_derivatives
from synthesis.drives.max_min import MaxMinProblem
from synthesis.drives.placements import TOLERANCE, PlacementTask, Sizes

_NEWTON_STEPS = 3
"""Newton steps by which the ends of a descent are moved to the fixed sizes."""


class PlacementProblem(MaxMinProblem):
    """Problem of the largest u with ``arm >= u burden`` within the limits, for one direction of the actuator.

    The unknowns are the ground point G, the pin q and u. Fixed sizes are equations; this formulation stays regular if the
    circles about both ends of the pin's path only touch, as they do at many optima.

    Parameters
    ----------
    task : PlacementTask
    sizes : Sizes
    extends : bool
        Direction of the actuator: retracted at the first position or at the last.
    """

    def __init__(self, task: PlacementTask, sizes: Sizes, extends: bool) -> None:
        self.task, self.sizes = task, sizes
        self.sign = task.sense * (1.0 if extends else -1.0)
        self.short, self.long = (0, -1) if extends else (-1, 0)
        self.free = sizes.retracted_free or sizes.stroke_free
        self.size = task.size
        left, bottom, right, top = np.array(task.limits.box) / self.size
        reach = task.limits.reach / self.size
        low_x, low_y, high_x, high_y = -reach, -reach, reach, reach
        if task.limits.pin_box is not None:
            low_x, low_y, high_x, high_y = np.array(task.limits.pin_box) / self.size
        self.bounds = [(left, right), (bottom, top), (low_x, high_x), (low_y, high_y), (0.0, 1e6)]
        # u in units of its upper bound, so that all unknowns have similar magnitudes
        burden_integral = float(np.trapezoid(task.burden, task.at) * task.sense)
        self.unit = sizes.start.stroke / max(burden_integral, 1e-300)

    def start(self, ground: complex, pin: complex, fraction: float) -> Floats:
        """Return the unknowns at two points, with u as a fraction of the smallest ratio of arm and burden there."""
        z = self.unknowns(ground, pin)
        arm = self._at(z).arm
        z[-1] = fraction * np.min(arm / np.maximum(self.task.burden, 1e-300))
        return z

    def constraints(self, z: Floats) -> Floats:
        """Return values that are at least 0 within the limits: arms, reach and dead length."""
        task, leverage = self.task, self._at(z)
        n, short, long = task.at.size, leverage.length[self.short], leverage.length[self.long]
        rows = np.empty(2 * n + 1 + self.free)
        rows[:n] = leverage.arm - z[-1] * task.burden
        rows[n : 2 * n] = leverage.arm - task.limits.arm / self.unit
        reach = task.limits.reach
        rows[2 * n] = (1 - abs(leverage.pin) / reach) * (1 + abs(leverage.pin) / reach)
        if self.free:
            rows[-1] = (2 * short - long - self.sizes.dead_length) / self.size
        return rows

    def constraint_jacobian(self, z: Floats) -> Floats:
        """Return the derivatives of `constraints` by the unknowns."""
        task, leverage = self.task, self._at(z)
        n, (lengths, arms) = task.at.size, leverage.derivatives
        slopes = np.zeros((2 * n + 1 + self.free, 5))
        slopes[:n, :4], slopes[:n, 4] = arms, -task.burden
        slopes[n : 2 * n, :4] = arms
        slopes[2 * n, 2:4] = np.array([leverage.pin.real, leverage.pin.imag]) * (
            -2 * self.size / task.limits.reach**2
        )
        if self.free:
            slopes[-1, :4] = 2 * lengths[self.short] - lengths[self.long]
        return slopes

    def equalities(self, z: Floats) -> Floats:
        """Return the differences from the fixed sizes, divided by the size of the problem."""
        short, long = (self._at(z).length[k] for k in (self.short, self.long))
        differences = [] if self.sizes.retracted_free else [short - self.sizes.start.retracted]
        differences += [] if self.sizes.stroke_free else [long - short - self.sizes.start.stroke]
        return np.array(differences) / self.size

    def equality_jacobian(self, z: Floats) -> Floats:
        """Return the derivatives of `equalities` by the unknowns."""
        lengths, _ = self._at(z).derivatives
        short, long = lengths[self.short], lengths[self.long]
        slopes = np.zeros((2, 5))
        slopes[0, :4], slopes[1, :4] = short, long - short
        return slopes[[not self.sizes.retracted_free, not self.sizes.stroke_free]]

    def restore_sizes(self, z: Floats) -> Floats:
        """Return the nearest unknowns with the fixed sizes, up to rounding."""
        for _ in range(_NEWTON_STEPS):
            difference = self.equalities(z)
            if difference.size:
                z = z - np.linalg.pinv(self.equality_jacobian(z)) @ difference
        return z

    def has_sizes(self, z: Floats) -> bool:
        """Check that the actuator has the fixed sizes and the dead length, up to rounding."""
        return bool(
            np.abs(self.equalities(z)).max(initial=0.0) <= TOLERANCE
            and (not self.free or self.constraints(z)[-1] >= -TOLERANCE)
        )

    def _evaluate(self, ground: complex, pin: complex) -> _Leverage:
        v, speed = self.task.link.position(pin) - ground, self.task.link.speed(pin)
        length = np.maximum(np.abs(v), 1e-300)
        along = v / length
        return _Leverage(self, pin, length, along, speed, dot(along, speed) * (self.sign / self.unit))


@dataclass(frozen=True)
class _Leverage:
    """Lengths and arms of a placement; their derivatives are computed when they are needed."""

    problem: PlacementProblem
    pin: complex
    length: Floats
    along: Complexes
    speed: Complexes
    arm: Floats
    """Moment arm in the problem's direction, in units of u."""

    @cached_property
    def derivatives(self) -> tuple[Floats, Floats]:
        """Derivatives (n, 4) of lengths and arms by G and q, in the problem's units."""
        problem = self.problem
        lengths, arms = leverage_derivatives(problem.task.link, self.along, self.length, self.speed, 1.0)
        return lengths, arms * (problem.size * problem.sign / problem.unit)
