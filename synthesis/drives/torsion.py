"""Torsion springs in joints: mounting angle, direction and row of a catalogue that leave the smallest torque of the drive.

A torsion spring between two links with a common joint has the twist ``t = t0 + s (theta - theta0)``, with theta the angle of the
second link from the first, theta0 its value at the first position and the direction of winding s = 1 or -1. Its moment is
``preload + rate t``, and the drive gives ``s (preload + rate t) dtheta/dphi`` besides the load. This is linear in the mounting
twist t0, so the best t0 within the range of twists, and within the limits of a `Behaviour`, follows in closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.springs import Behaviour, Between, TorsionRow, TorsionSpring, pairs_of, rms_of

JOINT_TOLERANCE = 1e-9
"""Largest distance of two points of a joint, as a fraction of the linkage's size."""
TWIST_STEPS = 257
"""Mounting twists that are compared if none satisfies the limits."""


def joint_of(machine: LinkMotions, between: Between) -> complex | None:
    """Return the common joint of two links in the plane at the first position; None if they have none."""
    first, second = between
    if first == GROUND:
        pivot = machine.links[second].pivot
        return None if pivot is None else complex(pivot)
    for carrier, partner in (
        (machine.links[first], machine.links[second]),
        (machine.links[second], machine.links[first]),
    ):
        for point in (0j, 2 * machine.middles.get(carrier.name, 0j)):
            path = carrier.position(point)
            distance = np.abs(partner.position(partner.point_at(complex(path[0]))) - path)
            if distance.max() <= JOINT_TOLERANCE * machine.extent:
                return complex(path[0])
    return None


def best_torsion_spring(
    machine: LinkMotions,
    torque: Floats,
    between: Between | None,
    rows: list[TorsionRow],
    behaviour: Behaviour | None = None,
) -> TorsionSpring | str:
    """Find the joint, the row, the direction and the mounting twist that leave the smallest rms torque.

    Parameters
    ----------
    machine : LinkMotions
    torque : ndarray, shape (n,)
        Torque that the drive gives without the spring.
    between : pair of str, optional
        Links with a common joint; default: each joint is tried.
    rows : list of TorsionRow
    behaviour : Behaviour, optional
        Limits on the torque that remains; springs that satisfy them come before all others.

    Returns
    -------
    TorsionSpring or str
        The spring, or a sentence with the reason why no row fits.
    """
    pairs = [pair for pair in ([between] if between else pairs_of(machine)) if joint_of(machine, pair) is not None]
    if not pairs:
        subject = "no two links" if between is None else f"{between[0]} and {between[1]}"
        return f"{subject} have a common joint that a torsion spring could sit in"
    best: tuple[tuple[float, float], TorsionSpring] | None = None
    swing = np.inf
    for pair in pairs:
        turned = TorsionSpring(rows[0], pair, machine).turned(machine)
        swing = min(swing, float(np.ptp(turned)))
        for row in rows:
            for direction in (1, -1):
                change = direction * turned
                low, high = -float(change.min()), row.angle_max - float(change.max())
                if low > high:
                    continue
                spring = _mounted(
                    machine, torque, TorsionSpring(row, pair, machine, 0.0, direction), (low, high), behaviour
                )
                left = torque + spring.torque(machine)
                lack = 0.0 if behaviour is None else float(behaviour.violation(left))
                rank = lack, rms_of(left)
                if best is None or rank < best[0]:
                    best = rank, spring
    if best is None:
        return f"no spring of {len(rows)} twists far enough: the smallest swing of a joint is {np.rad2deg(swing):.4g} degrees"
    return best[1]


def _mounted(
    machine: LinkMotions,
    torque: Floats,
    spring: TorsionSpring,
    limits: tuple[float, float],
    behaviour: Behaviour | None,
) -> TorsionSpring:
    """Return a spring with the best mounting twist within its limits."""
    base = torque + spring.torque(machine)
    slope = spring.direction * spring.row.rate * spring.rate(machine)
    low, high = limits
    square = float(slope @ slope)
    best = -float(base @ slope) / square if square > 0 else low
    if behaviour is not None:
        gaps = behaviour.rows(base)
        gains = behaviour.rows(base + slope) - gaps
        with np.errstate(divide="ignore", invalid="ignore"):
            needed = -gaps / gains
        inside_low = max(low, float(needed[gains > 0].max(initial=-np.inf)))
        inside_high = min(high, float(needed[gains < 0].min(initial=np.inf)))
        if inside_low <= inside_high:
            low, high = inside_low, inside_high
        else:
            twists = np.linspace(low, high, TWIST_STEPS)
            best = float(twists[np.argmin(behaviour.violation(base + twists[:, None] * slope))])
    return replace(spring, mounted=float(np.clip(best, low, high)))
