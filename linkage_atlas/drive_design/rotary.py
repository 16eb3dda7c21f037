"""Rotary drives at fixed pivots."""

from __future__ import annotations

import numpy as np

from linkage_atlas.drive_design.question import RotaryRequest
from linkage_atlas.drive_design.records import RotaryCurve, RotaryDrive
from linkage_atlas.drive_design.task import DriveTask, both_ends
from linkage_atlas.records import xy
from synthesis.arrays import Floats, cross, dot
from synthesis.drives.links import largest
from synthesis.studies.forces import Pull


def find_rotary(task: DriveTask, request: RotaryRequest, name: str) -> None:
    """Evaluate a rotary drive at the pivot of a link."""
    operation = task.operation
    link, rates = task.machine.links[name], task.fine.links[name].rate
    if np.any(rates * rates[0] <= 0):
        k = int(np.argmax(rates * rates[0] <= 0))
        at = operation.words(task.fine.at[k])
        where = operation.poses_around(*task.fine.at[[max(k - 1, 0), k]])
        task.refuse("rotary", name, f"the {name} reverses at a dead point {where}at {at}")
        return
    angle = _transmission_angle(task, name)
    words = "its transmission angle falls to"
    if link.pivot is None or task.too_flat("rotary", name, words, angle, request.transmission_angle_min):
        return
    torque = task.torque / link.rate
    peak = _peak_torque(task, name) if task.loaded else None
    drive = RotaryDrive(
        link=name,
        swing=task.swing(name),
        stops="two stops or position control",
        holds="with a worm gear or a brake",
        motor=xy(link.pivot),
        peak_torque=peak,
        holding=task.if_loaded(both_ends(torque)),
        transmission_angle_min=None if angle is None else angle / operation.radian,
        curve=RotaryCurve(crank_angle=operation.curve_at, torque=task.if_loaded(torque)),
        pin_forces=task.pin_peaks(
            task.machine, [Pull(name, link.origin, 0 * link.origin, torque)] * (name == "rocker")
        ),
    )
    task.ranked.append(((peak or 0.0,), drive))


def _peak_torque(task: DriveTask, name: str) -> float:
    def needed(at: Floats) -> Floats:
        machine = task.operation.poses(at)
        return np.abs(machine.torque(task.question.load) / machine.links[name].rate)

    return largest(needed, task.machine.at)


def _transmission_angle(task: DriveTask, name: str) -> float | None:
    """Return the smallest transmission angle of a four-bar that is driven at its crank or rocker."""
    links = task.fine.links
    if task.operation.linkage is None or set(links) != {"crank", "coupler", "rocker"}:
        return None
    coupler, opposite = links["coupler"].direction, links["rocker" if name == "crank" else "crank"].direction
    return float(np.min(np.arctan2(np.abs(cross(coupler, opposite)), np.abs(dot(coupler, opposite)))))
