"""Motors that turn continuously and swing a linkage through a rod."""

from __future__ import annotations

import numpy as np

from linkage_atlas.drive_design.operation import FINE
from linkage_atlas.drive_design.question import MotorRequest
from linkage_atlas.drive_design.records import MotorCurve, MotorDrive, SixBar, SixBarLink
from linkage_atlas.drive_design.task import DriveTask, both_ends, envelope
from linkage_atlas.records import plane, xy
from synthesis.arrays import dot
from synthesis.drives.crank_rocker import place_motor_about_pivot
from synthesis.drives.links import GROUND
from synthesis.drives.motor import MotorCycle, evaluate_motor
from synthesis.drives.motor_search import place_motor
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor
from synthesis.drives.six_bar import SixBar as Swung
from synthesis.studies.forces import Pull
from synthesis.target import TURN, Interval

DWELL_SHARE = 0.01
"""Fraction of the motion within which a linkage counts as resting at its end."""
PIN_SHARE = 0.8
"""Default distance of the rod's pin from a fixed pivot, as a fraction of the link's size."""
STEPS = 121
"""Motor angles of a reply, over a whole turn."""


def find_motor(task: DriveTask, request: MotorRequest, name: str) -> None:
    """Place a motor and a rod on a link."""
    found = _placed(task, request, name)
    if isinstance(found, str):
        task.refuse("dyad", name, found)
        return
    link = task.fine.links[name]
    cycle = evaluate_motor(link, task.fine_torque, found.motor, found.pin, found.crank, found.rod, found.extends)
    if cycle is None:
        task.refuse("dyad", name, "the rod of the best motor reverses between the positions of the search")
        return
    words = "the best transmission angle is"
    if not task.too_flat("dyad", name, words, cycle.transmission_angle_min, request.transmission_angle_min):
        _add(task, name, cycle)


def _placed(task: DriveTask, request: MotorRequest, name: str) -> MotorCycle | str:
    machine, link, ratio = task.machine, task.machine.links[name], request.time_ratio
    reach = task.reach(request.reach_max, name)
    if request.motor is not None:
        pin = task.given_pin(name, request.pin, request.pin_on_link)
        first, last = np.abs(link.position(pin) - request.motor)[[0, -1]].tolist()
        crank, rod = abs(last - first) / 2, (first + last) / 2
        found = evaluate_motor(link, task.torque, request.motor, pin, crank, rod, last > first)
        return found or "the distance from the motor to the pin reverses: it has a dead point"
    if link.pivot is None:
        box = request.motor_box or task.box
        return place_motor(link, machine.at, task.torque, ratio, request.pin_radius or reach, box, task.work)
    radius = request.pin_radius or min(reach, PIN_SHARE * machine.reaches.get(name, reach))
    is_given = request.pin_radius is not None
    return place_motor_about_pivot(link, task.torque, ratio, radius, is_given, request.motor_box, reach=reach)


def _add(task: DriveTask, name: str, cycle: MotorCycle) -> None:
    operation, coarse = task.operation, slice(None, None, (FINE - 1) // (task.machine.at.size - 1))
    pin = task.fine.links[name].position(cycle.pin)
    interval = Interval(*task.fine.at[[0, -1]].tolist())
    six = Swung(operation.poses, interval, Motor(name, cycle.motor, cycle.crank, cycle.rod, cycle.pin))
    bar, motor = _six_bar(task, six, cycle), np.full(FINE, cycle.motor)
    pushes = [force * (pin - knee) / cycle.rod for force, knee in zip(cycle.rod_force, cycle.crank_pin)]
    drive = MotorDrive(
        link=name,
        swing=task.swing(name),
        stops="none, because the linkage is at rest when the motor passes either end",
        holds="near its dead centres",
        motor=xy(cycle.motor),
        pin=xy(pin[0]),
        pin_on_link=xy(cycle.pin),
        length=both_ends(cycle.length),
        extends=cycle.extends,
        peak_torque=bar.motor_torque_max,
        peak_force=task.if_loaded(float(np.abs(cycle.rod_force).max())),
        envelope=envelope(pin, *cycle.crank_pin, motor),
        pin_forces=task.pin_peaks(task.fine, *([Pull(name, pin, push)] for push in pushes)),
        curve=MotorCurve(
            crank_angle=operation.curve_at,
            length=cycle.length[coarse],
            force=task.if_loaded(cycle.rod_force[0][coarse]),
            torque=task.if_loaded(cycle.motor_torque[0][coarse]),
            ground=plane(motor[coarse]),
            pin=plane(pin[coarse]),
            knee=plane(cycle.crank_pin[0][coarse]),
        ),
        six_bar=bar,
    )
    task.ranked.append(((-bar.transmission_angle_min,), drive))


def _six_bar(task: DriveTask, six: Swung, cycle: MotorCycle) -> SixBar:
    """Describe a motor with its rod over a whole turn at even steps."""
    operation, motor = task.operation, six.motor
    radian = operation.radian
    even = six.sense * np.linspace(0.0, TURN, STEPS)
    machine, rod, knee = six.machine(even), six.rod(even) / motor.rod, six.knee(even)
    force = machine.torque(task.question.load) / dot(rod, machine.links[motor.link].speed(motor.pin))
    (forwards, backwards), dwell = six.turn, six.dwell(DWELL_SHARE)
    joints = six.joints(operation.plain)
    points = {joint.name: xy(joint.position) for joint in joints}
    names = {
        link: [joint.name for joint in joints if link in joint.links]
        for link in (GROUND, *machine.links, MOTOR_CRANK, ROD)
    }
    if operation.plain is not None and machine.body is not None:
        points["P"] = xy(six.machine(six.forwards(np.zeros(1))).link("body").origin[0])
        names["coupler"].append("P")
    return SixBar(
        crank=motor.crank,
        coupler=motor.rod,
        kind="crank_rocker" if operation.plain is None else six.kind,
        time_ratio=cycle.time_ratio,
        transmission_angle_min=cycle.transmission_angle_min / radian,
        motor_torque_max=task.if_loaded(float(np.abs(cycle.motor_torque).max())),
        motor_turn=(forwards / radian, backwards / radian),
        dwell=(dwell[0] / radian, dwell[1] / radian),
        motor_angle=(six.start + even) / radian,
        crank_angle=six.travel(even) / operation.unit,
        motor_torque=task.if_loaded(force * dot(rod, 1j * (knee - motor.at))),
        rod_force=task.if_loaded(force),
        motor_pin=plane(knee),
        driver=MOTOR_CRANK,
        joints=points,
        links=[SixBarLink(link, on_link) for link, on_link in names.items()],
    )
