"""Placements of a linear actuator between two links: sizes, limits, lengths, moment arms and forces.

An actuator of retracted length L0 and stroke s between a point G and a pin q of a moving link has the length
``L = |X + R q - G|`` and, per radian of the drive, the moment arm dL/dphi; its force is the drive's torque over its arm. It
uses its whole stroke: its length is L0 at one end of the interval and L0 + s at the other. No placement has a smaller peak
force than the integral of the torque's absolute value over s, and none has a larger minimum arm than s over the interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.descent import Functions, MaxMinProblem
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside

TOLERANCE = 1e-7
"""Allowed violation of the limits of a placement by rounding, as a fraction of its size."""

GRID = 60
"""Number of grid points in each direction for an actuator of fixed sizes."""


class Actuator(NamedTuple):
    """Sizes of an actuator: its retracted length and its stroke."""

    retracted: float
    stroke: float


@dataclass(frozen=True)
class Sizes:
    """Sizes of an actuator, some of which a search may change."""

    start: Actuator
    """Sizes that are fixed, and the initial values of the free sizes."""
    retracted_free: bool = False
    stroke_free: bool = False
    dead_length: float = 0.0
    """Smallest difference of retracted length and stroke, if one of them is free."""


class PlacementLimits(NamedTuple):
    """Limits on a placement."""

    box: Box
    """Region of the ground point."""
    reach: float
    """Largest distance of the pin from the origin of its link's frame."""
    arm: float
    """Smallest moment arm, a length per radian of the drive."""
    extends: bool | None = None
    """Required direction: extending (True) or retracting (False) from the first position; None allows both."""
    pin_box: Box | None = None
    """Region of the pin in its link's frame."""


@dataclass(frozen=True)
class Placement:
    """Ends of an actuator, with its length, moment arm and force at the n positions of the motion."""

    ground: complex
    pin: complex
    """Pin in its link's frame."""
    extends: bool
    """True if the actuator is retracted at the first position."""
    length: Floats
    arm: Floats
    """Moment arm dL/dphi; negative if the actuator shortens as the drive's parameter grows."""
    force: Floats
    """Force along the actuator; positive if it pushes."""
    worst: float
    """Objective of the search: the maximum of ``|torque / arm|``, or without a load of ``1 / |arm|``."""

    @property
    def peak(self) -> float:
        """Largest absolute force."""
        return float(np.max(np.abs(self.force)))


class Refusal(NamedTuple):
    """Reason why an actuator cannot be placed, with the number that shows it."""

    reason: str
    """``stroke``, ``reach``, ``pin_box``, ``dead`` or ``arm``."""
    needed: float
    """Reach or arm that would be needed or that can be attained; for a dead point the drive's parameter there."""
    between: tuple[int, int] | None = None
    """Indices of the positions between which the dead point lies."""


class PlacementTask:
    """Motion, load and limits for which actuators are placed on one link.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link relative to the link, or ground, that carries the other end.
    at : ndarray, shape (n,)
        Drive parameter at each position.
    torque : ndarray, shape (n,)
        Torque that the drive must give. If it is zero everywhere, the search maximizes the minimum arm.
    limits : PlacementLimits
    grid_size : int
        Number of grid points of a search in each direction.
    torque_integral : float, optional
        Integral of ``|torque|`` over the interval; by default from the n positions.
    """

    def __init__(
        self,
        link: LinkMotion,
        at: Floats,
        torque: Floats,
        limits: PlacementLimits,
        grid_size: int = GRID,
        torque_integral: float | None = None,
    ) -> None:
        self.grid_size = grid_size
        self.link, self.at, self.torque, self.limits = link, at, torque, limits
        self.loaded = bool(np.any(torque))
        burden = np.abs(torque) if self.loaded else np.ones(at.size)
        self.torque_scale = float(burden.max()) if self.loaded else 1.0
        self.burden = burden / burden.max()
        self.sense = 1.0 if at[-1] >= at[0] else -1.0
        self.burden_integral = float(np.trapezoid(self.burden, at) * self.sense)
        self.torque_integral = (
            torque_integral if self.loaded and torque_integral else self.burden_integral * self.torque_scale
        )
        left, bottom, right, top = limits.box
        self.directions = (True, False) if limits.extends is None else (limits.extends,)
        self.size = max(right - left, top - bottom, limits.reach)

    def force_bound(self, stroke: float) -> float:
        """Return a lower bound of the peak force of all placements with a stroke."""
        return self.torque_integral / stroke

    def evaluate(self, ground: complex, pin: complex) -> Placement:
        """Return the placement with these ends."""
        length, arm = self.link.leverage(ground, pin)
        with np.errstate(divide="ignore", invalid="ignore"):
            force = self.torque / arm
            worst = float(np.max(self.burden / np.abs(arm))) * self.torque_scale
        return Placement(ground, pin, bool(length[-1] > length[0]), length, arm, force, worst)

    def problem(self, sizes: Sizes, extends: bool) -> MaxMinProblem:
        """Return the problem of the largest u with ``arm >= u burden`` within the limits, for one direction of the actuator.

        Its points are the ground point and the pin. Fixed sizes are equations; this formulation stays regular if the circles
        about both ends of the pin's path only touch, as they do at many optima.
        """
        limits = self.limits
        sign = self.sense * (1.0 if extends else -1.0)
        short_end, long_end = (0, -1) if extends else (-1, 0)
        # u in units of its upper bound, so that all unknowns have similar magnitudes
        unit = sizes.start.stroke / max(self.burden_integral, 1e-300)

        def evaluate(points: Complexes) -> Functions:
            ground, pin = points[:, :1], points[:, 1:]
            length, arm = self.link.leverage(ground, pin)
            arm *= sign / unit
            short, long = length[:, [short_end]], length[:, [long_end]]
            inside = (1 - np.abs(pin) / limits.reach) * (1 + np.abs(pin) / limits.reach)
            rows = [arm - limits.arm / unit, inside]
            if sizes.retracted_free or sizes.stroke_free:
                rows.append((2 * short - long - sizes.dead_length) / self.size)
            fixed = [] if sizes.retracted_free else [short - sizes.start.retracted]
            fixed += [] if sizes.stroke_free else [long - short - sizes.start.stroke]
            return Functions(arm, np.hstack(rows), np.hstack([points.real[:, :0], *fixed]) / self.size)

        reach = limits.reach
        corners = (*limits.box, *(limits.pin_box or (-reach, -reach, reach, reach)))
        low, high = (np.array([corners[k] for k in ks]) / self.size for ks in ((0, 1, 4, 5), (2, 3, 6, 7)))
        return MaxMinProblem(evaluate, self.size, list(zip(low.tolist(), high.tolist())), self.burden)

    def satisfies_limits(self, placement: Placement) -> bool:
        """Check the limits of a placement up to rounding."""
        room = TOLERANCE * self.size
        signed = placement.arm * self.sense * (1.0 if placement.extends else -1.0)
        return bool(
            outside(placement.ground, self.limits.box) <= room
            and abs(placement.pin) <= self.limits.reach + room
            and (self.limits.pin_box is None or outside(placement.pin, self.limits.pin_box) <= room)
            and np.all(np.isfinite(signed))
            and signed.min() >= self.limits.arm - room
            and signed.min() > 0
        )
