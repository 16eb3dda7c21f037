"""The pneumatic side of the lift: force and pressure of the cylinder over the stroke, and the forces in its joints.

The platform carries a vertical load and a mass on the line of the slide; links and friction are without weight. By virtual
work the cylinder's force is F = P ds/dl1 for a weight P. By Newton's law the triangle with the platform is held by the
cylinder at B, the link at C and the slide at A: three equations for F, the link's force and the slide's. Geometry, symbols
and source are those of `synthesis.lift.pose`. Forces in newtons, lengths in millimetres, pressures in bar.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.lift.motion import Motion
from synthesis.one_variable import Floats

GRAVITY = 9.80665
"""m/s^2."""
BAR = 0.1
"""One bar in N/mm^2."""


@dataclass(frozen=True)
class Drive:
    """What the cylinder has to carry, and the cylinder: ``load`` in N, ``mass`` in kg, ``bore`` and ``rod`` in mm.

    The mass acts by its weight and by its inertia. ``pressure``: what is available, in bar over the surroundings.
    """

    load: float
    mass: float
    bore: float
    rod: float
    pressure: float


@dataclass(frozen=True)
class Forces:
    """Forces over a motion, shape (n,) each: the cylinder pushes with ``cylinder`` > 0, the link with ``link`` > 0.

    ``slide``: horizontal force of the slide on A. ``weight``: what the platform weighs with its inertia. ``pressure``
    needed, on the bore where the cylinder pushes, on the ring around the rod where it pulls. ``pivot_o`` and ``pivot_d``,
    shape (n, 2): forces of the ground on the cylinder and on the link.
    """

    weight: Floats
    cylinder: Floats
    link: Floats
    slide: Floats
    pressure: Floats
    pivot_o: Floats
    pivot_d: Floats


def piston_areas(drive: Drive) -> tuple[float, float]:
    """Areas in mm^2 that push and that pull."""
    push = 0.25 * np.pi * drive.bore**2
    return push, push - 0.25 * np.pi * drive.rod**2


def forces(moved: Motion, drive: Drive) -> Forces:
    """The forces over a motion.

    Laws: the cylinder's force is `newton`'s; power in is power out, F v_l = P v_s; at the top the cylinder's force is 0 and
    the link carries the weight.
    """
    pose, design = moved.pose, moved.pose.design
    weight = drive.load + drive.mass * (GRAVITY + moved.acceleration / 1000)
    cylinder = weight * pose.gain
    along = np.stack([pose.x, pose.y], axis=-1) / pose.length[:, None]
    link_way = np.stack([design.l3 * pose.sin_turn, pose.root], axis=-1) / design.l5
    # what the cylinder does not carry of the weight the link does; the slide takes the rest
    link = (weight - cylinder * along[:, 1]) / link_way[:, 1]
    slide = -cylinder * along[:, 0] - link * link_way[:, 0]
    push, pull = piston_areas(drive)
    pressure = np.where(cylinder >= 0, cylinder / push, -cylinder / pull) / BAR
    return Forces(weight, cylinder, link, slide, pressure, cylinder[:, None] * along, link[:, None] * link_way)


def newton(moved: Motion, weight: Any) -> Floats:
    """Cylinder, link and slide force by the equilibrium of the triangle with the platform, shape (n, 3).

    A second way that shares nothing with the derivatives of a `Pose`: moments about A and forces in x and y.
    """
    pose, design = moved.pose, moved.pose.design
    a = np.stack(np.broadcast_arrays(-design.b, pose.height), axis=-1)
    b = np.stack([pose.x, pose.y], axis=-1)
    c = np.stack([design.l3 * pose.sin_turn - design.b, pose.root], axis=-1)
    along = b / np.linalg.norm(b, axis=-1, keepdims=True)
    way = (c - np.array([-design.b, 0.0])) / design.l5
    matrix = np.zeros((len(b), 3, 3))
    matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2] = along[:, 0], way[:, 0], 1.0
    matrix[:, 1, 0], matrix[:, 1, 1] = along[:, 1], way[:, 1]
    for k, (point, direction) in enumerate(((b, along), (c, way))):
        arm = point - a
        matrix[:, 2, k] = (arm[:, 0] * direction[:, 1] - arm[:, 1] * direction[:, 0]) / design.l2
    right = np.zeros((len(b), 3, 1))
    right[:, 1, 0] = weight
    return np.asarray(np.linalg.solve(matrix, right)[:, :, 0])


def least_bore(found: Forces, drive: Drive) -> float:
    """The bore in mm that just carries the load at the pressure available, with the same rod.

    Law: with it the largest pressure needed is the one available.
    """
    push = max(float(np.max(found.cylinder)), 0.0)
    pull = max(-float(np.min(found.cylinder)), 0.0)
    available = drive.pressure * BAR
    square = max(push / available, pull / available + 0.25 * np.pi * drive.rod**2 if pull > 0 else 0.0)
    return float(np.sqrt(square / (0.25 * np.pi)))
