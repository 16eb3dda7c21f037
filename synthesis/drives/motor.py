"""A motor that turns continuously and swings a linkage through a crank and a rod.

The motor's crank a about O and the rod b to a pin Q of the linkage reach the ends of its swing where ``|OQ|`` is ``b - a`` and
``b + a``: an actuator of retracted length b - a and stroke 2a has the same lengths. The rod's transmission angle lies between
the rod and the normal of Q's path: it is 90 degrees if the rod pulls along the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.link_motion import LinkMotion
from synthesis.target import TURN
from synthesis.triangle import angle_at

DEAD_CENTRE_TOLERANCE = 1e-5
"""Allowed distance of the ends of the motion from the dead centres, as a fraction of crank and rod together."""


@dataclass(frozen=True)
class MotorCycle:
    """A motor and a rod on a linkage at the n positions of its motion, over one turn of the motor.

    The first axis of pairs is the forward and the return stroke. In the forward stroke the linkage passes its positions in
    order. The motor's angle grows counter-clockwise.
    """

    motor: complex
    pin: complex
    """Pin of the rod in its link's frame."""
    crank: float
    rod: float
    extends: bool
    """True if the crank is folded over the rod at the first position."""
    length: Floats
    """Distance of motor and pin, (n,)."""
    crank_pin: Complexes
    """Joint of crank and rod, (2, n)."""
    motor_angle: Floats
    """Direction of the crank from the x axis, (2, n), continuous over the turn that begins with the forward stroke."""
    transmission: Floats
    """Angle between the rod and the normal of the pin's path, (2, n), in radians."""
    gain: Floats
    """Change of the drive's parameter per radian of the motor, counter-clockwise, (2, n); zero at both ends."""
    rod_force: Floats
    """Force in the rod, (2, n), compression positive."""
    motor_torque: Floats
    """Torque that the motor gives, (2, n), counter-clockwise."""

    @property
    def transmission_angle_min(self) -> float:
        """Smallest transmission angle of both strokes."""
        return float(self.transmission.min())

    @property
    def turns(self) -> tuple[float, float]:
        """Rotation of the motor in the forward and in the return stroke; together a whole turn."""
        forwards, backwards = np.abs(self.motor_angle[:, -1] - self.motor_angle[:, 0]).tolist()
        return forwards, backwards

    @property
    def time_ratio(self) -> float:
        """Ratio of the longer and the shorter stroke."""
        return max(self.turns) / min(self.turns)

    @property
    def sense(self) -> float:
        """Direction in which the motor turns: 1 for counter-clockwise, -1 for clockwise."""
        return float(np.sign(self.motor_angle[0, -1] - self.motor_angle[0, 0]))

    @property
    def order(self) -> float:
        """Sort key of both directions: the slower forward stroke is preferred, then counter-clockwise."""
        forwards, backwards = self.turns
        return forwards - backwards + 1e-9 * self.sense


def evaluate_motor(
    link: LinkMotion,
    torque: Floats,
    motor: complex,
    pin: complex,
    crank: float,
    rod: float,
    extends: bool,
    tolerance: float = DEAD_CENTRE_TOLERANCE,
) -> MotorCycle | None:
    """Compute the motion and the forces of a motor and a rod on a link.

    The motor turns so that the rod stays on one side of the line from the motor to the pin in each stroke. It passes a dead
    centre at either end, so the distance of the pin must grow or shrink monotonically between the ends.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link that carries the pin, at n positions.
    torque : ndarray, shape (n,)
        Torque that the linkage's drive must give.
    motor, pin : complex
        Position of the motor in the plane, and of the pin in the link's frame.
    crank, rod : float
        Lengths.
    extends : bool
        True if the crank is folded over the rod at the first position.
    tolerance : float
        Allowed distance of the ends of the motion from the dead centres, as a fraction of crank and rod together.

    Returns
    -------
    MotorCycle or None
        None if motor and rod do not drive the link.
    """
    v = link.position(pin) - motor
    length = np.abs(v)
    along = v / length
    steps = np.diff(length)
    ends = [rod - crank, rod + crank] if extends else [rod + crank, rod - crank]
    if np.max(np.abs(length[[0, -1]] - ends)) > tolerance * (rod + crank):
        return None
    if not (np.all(steps > 0) if extends else np.all(steps < 0)):
        return None
    # angle at the pin between the rod and the line to the motor, from the sides of the triangle: no cancellation at the ends
    beta = angle_at(rod, crank, length)
    beta[0] = beta[-1] = 0.0
    # angle at the motor between its crank and the line to the pin
    gamma = angle_at(crank, rod, length)
    gamma[0], gamma[-1] = (np.pi, 0.0) if extends else (0.0, np.pi)
    line = np.unwrap(np.angle(v))
    speed = link.speed(pin)
    best: MotorCycle | None = None
    for side in (1.0, -1.0):
        sides = np.array([side, -side])[:, None]
        angle = line + sides * gamma
        pins = motor + crank * np.exp(1j * angle)
        rods = along * np.exp(-1j * sides * beta)
        pull = np.real(np.conj(rods) * speed)
        with np.errstate(divide="ignore", invalid="ignore"):
            transmission = np.arcsin(np.clip(np.abs(pull) / np.abs(speed), 0, 1))
            gain = np.real(np.conj(rods) * 1j * (pins - motor)) / pull
            force = torque / pull
        signed = pull * (1.0 if extends else -1.0) * np.sign(pull[0, 0] * (1.0 if extends else -1.0))
        if signed.min() <= 0:
            return None
        gain[:, [0, -1]] = 0.0
        # in the return stroke, from the last position to the first, the motor continues in the same direction
        forwards, backwards = angle[0], angle[1] + TURN * np.round((angle[0, -1] - angle[1, -1]) / TURN)
        motor_angle = np.stack([forwards, backwards])
        motor_torque = force * np.real(np.conj(rods) * 1j * (pins - motor))
        cycle = MotorCycle(
            motor, pin, crank, rod, extends, length, pins, motor_angle, transmission, gain, force, motor_torque
        )
        if best is None or cycle.order > best.order:
            best = cycle
    return best


def return_angle(time_ratio: float) -> float:
    """Return the angle, in radians, by which the forward stroke exceeds half a turn for a time ratio."""
    ratio = max(time_ratio, 1 / time_ratio)
    return float(np.pi * (ratio - 1) / (ratio + 1))
