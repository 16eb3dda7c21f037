"""Knees that lock an end of the motion."""

from __future__ import annotations

import numpy as np

from linkage_atlas.drive_design.actuators import Mounted, limits_of, reason_of
from linkage_atlas.drive_design.question import ToggleRequest
from linkage_atlas.drive_design.records import Lock, ToggleCurve, ToggleDrive
from linkage_atlas.drive_design.task import DriveTask, envelope
from linkage_atlas.records import plane
from synthesis.drives.knee import Knee, place_knee
from synthesis.drives.links import GROUND
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import Actuator, Refusal


def find_knees(task: DriveTask, request: ToggleRequest) -> None:
    """Place a knee on each requested link."""
    machine, last = task.machine, request.locked_at == "last"
    for name in request.links:
        if task.work.expired():
            return
        link = machine.links[name]
        limits = limits_of(task, name, GROUND, request.ground_box, request.reach_max, request.arm_min)
        found = place_knee(link, machine.at, task.torque, limits, last, request.over_centre, request.knee, task.work)
        if isinstance(found, Refusal):
            question = PlacementSearch(link, machine.at, task.torque, limits._replace(extends=last))
            reason = reason_of(task.operation, found, question, Actuator(1.0, 1.0), True)
            task.findings.refuse("toggle", name, reason)
        else:
            _add(task, request, name, found)


def _add(task: DriveTask, request: ToggleRequest, name: str, found: Knee) -> None:
    placement, operation = found.placement, task.operation
    mounted = Mounted(task, GROUND, name, placement)
    if mounted.turns_back("toggle"):
        return
    loads, (ground, pin) = mounted.loads(), mounted.ends(task.machine)
    lock = Lock(
        found.handle,
        found.strut,
        request.over_centre / operation.radian,
        request.locked_at,
        found.overshoot / operation.unit,
        task.if_loaded(float(np.abs(found.handle_torque).max())),
        task.if_loaded(found.holds),
    )
    words = "holds with its knee on the stop" if found.holds else "does not hold: the load pulls its knee straight"
    drive = ToggleDrive(
        **mounted.fields(loads),
        stops="a stop for the joint of handle and strut beyond the dead centre",
        holds=words if task.loaded else "where the load pushes the strut together",
        peak_torque=lock.handle_torque_max,
        envelope=envelope(ground, pin, found.knee),
        curve=ToggleCurve(
            operation.curve_at,
            placement.length,
            placement.arm,
            task.if_loaded(placement.force),
            task.if_loaded(found.handle_torque),
            plane(ground),
            plane(pin),
            plane(found.knee),
        ),
        lock=lock,
    )
    task.findings.ranked.append(((not found.holds, placement.worst), drive))
