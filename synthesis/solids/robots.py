"""A linkage for simulators of robots: URDF, a tree whose loop is left to be closed, and SDF, whose joints may close it.

Lengths in metres, masses in kilograms, angles in radians; every joint is at zero at the first sample. Frames of links stand where
those of the machine's bodies do: crank, coupler and rocker begin in pivot A, the crank pin and pivot B. The loop is cut where the
last pin joins two bodies that are joined already: in a four-bar at C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.assembly.machine import Machine
from synthesis.assembly.movement import GROUND
from synthesis.solids.prism import MassProperties
from synthesis.solids.solid import Solid, Solids
from synthesis.target import Interval

INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
EFFORT, VELOCITY = 1000.0, 100.0
"""Limits that URDF wants of every joint, in newton metres and radians a second: larger than a model meets."""
_ZEROS = " ".join(f'{name}="0"' for name in INERTIA)
_NO_MASS = f'<inertial><origin xyz="0 0 0"/><mass value="0"/><inertia {_ZEROS}/></inertial>'
"""Of frames: where nothing is said PyBullet takes a kilogram."""


@dataclass(frozen=True)
class Joint:
    """A pin that joins two bodies; ``closing``: both are joined already, so it closes a loop."""

    name: str
    parent: int
    child: int
    at_parent: complex
    """In the frame of that body, in the machine's unit."""
    at_child: complex
    closing: bool


def tree_of(machine: Machine) -> list[Joint]:
    """The joints of a machine from the ground on, those that close a loop last.

    Law: without them they make a tree of all bodies; with them there are as many as a plane mechanism of one degree of freedom
    has: three for each two moving bodies.
    """
    known, found, closing = {GROUND}, [], []
    left = [
        (pin, one, other) for pin in machine.pins if not pin.post for one, other in zip(pin.places, pin.places[1:])
    ]
    while left:
        number = next(
            (k for k, (_, one, other) in enumerate(left) if (one.body in known) != (other.body in known)), None
        )
        if number is None:
            break
        pin, one, other = left.pop(number)
        if one.body not in known:
            one, other = other, one
        known.add(other.body)
        found.append(Joint(pin.name, one.body, other.body, one.at, other.at, False))
    closing = [Joint(pin.name, one.body, other.body, one.at, other.at, True) for pin, one, other in left]
    return found + closing


class _Frame(NamedTuple):
    """A place in the plane, in metres, and an angle."""

    at: complex
    angle: float

    def text(self) -> str:
        return " ".join(map(_number, (self.at.real, self.at.imag, 0.0)))


def _number(value: float) -> str:
    return f"{value + 0.0:.12g}"


class _Model:
    """What both formats say: frames, masses and shapes of bodies in metres."""

    def __init__(self, solids: Solids) -> None:
        self.solids, self.machine = solids, solids.machine
        self.names = self.machine.movement.names
        self.metre = solids.unit / 1000
        origin, direction = self.machine.movement.bodies(np.zeros(1))[:2]
        self.frames = [
            _Frame(complex(origin[body, 0] + self.machine.origin) * self.metre, float(np.angle(direction[body, 0])))
            for body in range(len(self.names))
        ]
        self.masses = [_in_metres(mass) for mass in solids.masses().values()]
        self.joints = tree_of(self.machine)

    def inertial(self, body: int) -> str:
        """The same element in both formats, apart from the place, which is given."""
        inertia = self.masses[body].inertia
        return "".join(
            f'{name}="{_number(value)}" ' for name, value in zip(INERTIA, inertia[np.triu_indices(3)])
        ).strip()

    def centre(self, body: int) -> str:
        return " ".join(_number(value) for value in self.masses[body].centre)


def _in_metres(mass: MassProperties) -> MassProperties:
    return MassProperties(mass.mass, mass.centre / 1000, mass.inertia / 1e6)


def to_urdf(solids: Solids, name: str, used: Interval | None = None) -> str:
    """The file: a tree of links from ``ground`` on, with frames ``closing_C_1`` and ``closing_C_2`` that a loop constraint joins.

    The convention of these frames is that of onshape-to-robot. A rocker does not turn in proportion to its crank, so no joint
    mimics another. ``used``: crank angles that limit the joint of the crank; without it turns freely. Shapes that are seen are
    boxes and cylinders: the format has no extruded outlines.

    Law: at zero both closing frames coincide; masses, centres and inertia are those of the parts.
    """
    model = _Model(solids)
    lines = [f'<?xml version="1.0"?>\n<robot name="{name}">']
    for body, link in enumerate(model.names):
        seen = "".join(_visual(part, model.metre) for part in solids.parts if part.body == body)
        mass = model.masses[body].mass
        inertial = (
            f'<inertial><origin xyz="{model.centre(body)}"/><mass value="{_number(mass)}"/>'
            f"<inertia {model.inertial(body)}/></inertial>"
            if mass
            else ""
        )
        lines.append(f'<link name="{link}">{inertial}{seen}</link>')
    for number, joint in enumerate(model.joints):
        if joint.closing:
            for side, (body, at) in enumerate(((joint.parent, joint.at_parent), (joint.child, joint.at_child)), 1):
                frame = f"closing_{joint.name}_{side}"
                lines.append(
                    f'<link name="{frame}">{_NO_MASS}</link>\n<joint name="{frame}_fixed" type="fixed">'
                    f'<parent link="{model.names[body]}"/><child link="{frame}"/>'
                    f'<origin xyz="{_Frame(at * model.metre, 0.0).text()}"/></joint>'
                )
            continue
        turn = model.frames[joint.child].angle - model.frames[joint.parent].angle
        limits = f'<limit effort="{EFFORT:g}" velocity="{VELOCITY:g}"/>'
        kind = "continuous"
        if number == 0 and used is not None:
            kind = "revolute"
            ends = f'lower="{_number(min(used))}" upper="{_number(max(used))}"'
            limits = f'<limit {ends} effort="{EFFORT:g}" velocity="{VELOCITY:g}"/>'
        lines.append(
            f'<joint name="{joint.name}" type="{kind}"><parent link="{model.names[joint.parent]}"/>'
            f'<child link="{model.names[joint.child]}"/><origin xyz="{_origin(model, joint)}" '
            f'rpy="0 0 {_number(turn)}"/><axis xyz="0 0 1"/>{limits}</joint>'
        )
    return "\n".join(lines) + "\n</robot>\n"


def _origin(model: _Model, joint: Joint) -> str:
    """Where the child's frame stands in the parent's: its origin, which is its first joint."""
    parent, child = model.frames[joint.parent], model.frames[joint.child]
    return _Frame((child.at - parent.at) * np.exp(-1j * parent.angle), 0.0).text()


def _visual(part: Solid, metre: float) -> str:
    """Boxes and cylinders about the outline of a part."""
    prism, shapes = part.prism, []
    tall = prism.height / 1000
    rgba = " ".join(_number(int(part.colour[k : k + 2], 16) / 255) for k in (1, 3, 5)) + " 1"
    material = f'<material name="{part.colour}"><color rgba="{rgba}"/></material>'
    middle = (part.up + (prism.low + prism.high) / 2) / 1000

    def add(at: complex, angle: float, geometry: str) -> None:
        place = " ".join(map(_number, (*_xy((part.at + at) / 1000), middle)))
        shapes.append(
            f'<visual><origin xyz="{place}" rpy="0 0 {_number(angle)}"/><geometry>{geometry}</geometry>{material}</visual>'
        )

    rounds = [(arc.centre, arc.radius) for arc in prism.arcs if arc is not None and arc.angle > 0]
    if prism.circle is not None:
        rounds = rounds[:1]
    for centre, radius in rounds:
        add(centre, 0.0, f'<cylinder radius="{_number(radius / 1000)}" length="{_number(tall)}"/>')
    boxes = set()
    corners = [complex(corner) for corner in prism.corners]
    for k, (start, end, arc) in enumerate(zip(corners, corners[1:] + corners[:1], prism.arcs)):
        if arc is not None:
            continue
        # as wide as the rounds at both ends of the side, or thin where it has none
        before = prism.arcs[k - 1]
        half = 0.0 if before is None else before.radius
        way = end - start
        inward = 1j * way / abs(way)
        at = (start + end) / 2 + inward * half
        key = (round(at.real, 6), round(at.imag, 6))
        if key not in boxes:
            boxes.add(key)
            size = " ".join(map(_number, (abs(way) / 1000, max(2 * half, 0.02 * abs(way)) / 1000, tall)))
            add(at, float(np.angle(way)), f'<box size="{size}"/>')
    return "".join(shapes)


def _xy(point: complex) -> tuple[float, float]:
    return point.real, point.imag


def to_sdf(solids: Solids, name: str) -> str:
    """The file (SDF 1.9): a link a body, fixed to the world by the ground, and a revolute joint a pin, also where it closes one.

    Shapes are the extruded outlines of the parts, without their holes.

    Law: as in `to_urdf`; bodies of a loop are children of two joints, which the format allows and URDF does not.
    """
    model = _Model(solids)
    lines = [f'<?xml version="1.0"?>\n<sdf version="1.9">\n<model name="{name}">']
    for body, link in enumerate(model.names):
        frame = model.frames[body]
        mass = model.masses[body]
        inertia = "".join(
            f"<{key}>{value}</{key}>"
            for key, value in (pair.split("=") for pair in model.inertial(body).replace('"', "").split())
        )
        inertial = (
            f"<inertial><pose>{model.centre(body)} 0 0 0</pose><mass>{_number(mass.mass)}</mass>"
            f"<inertia>{inertia}</inertia></inertial>"
            if mass.mass
            else ""
        )
        seen = "".join(_polyline(part) for part in solids.parts if part.body == body)
        pose = f"{frame.text()} 0 0 {_number(frame.angle)}"
        lines.append(f'<link name="{link}"><pose>{pose}</pose>{inertial}{seen}</link>')
    lines.append(
        f'<joint name="ground_fixed" type="fixed"><parent>world</parent><child>{model.names[GROUND]}</child></joint>'
    )
    for joint in model.joints:
        pose = f"{_Frame(joint.at_child * model.metre, 0.0).text()} 0 0 0"
        lines.append(
            f'<joint name="{joint.name}" type="revolute"><pose relative_to="{model.names[joint.child]}">{pose}</pose>'
            f"<parent>{model.names[joint.parent]}</parent><child>{model.names[joint.child]}</child>"
            "<axis><xyz>0 0 1</xyz></axis></joint>"
        )
    return "\n".join(lines) + "\n</model>\n</sdf>\n"


def _polyline(part: Solid) -> str:
    from synthesis.solids.mesh import ring_of

    prism = part.prism
    # to a hundredth of its rounds: it is looked at, not cut
    points = "".join(f"<point>{_number(z.real / 1000)} {_number(z.imag / 1000)}</point>" for z in ring_of(prism))
    pose = " ".join(map(_number, (*_xy(part.at / 1000), (part.up + prism.low) / 1000)))
    colour = " ".join(_number(int(part.colour[k : k + 2], 16) / 255) for k in (1, 3, 5)) + " 1"
    return (
        f'<visual name="{part.name}"><pose>{pose} 0 0 0</pose><geometry><polyline>{points}'
        f"<height>{_number(prism.height / 1000)}</height></polyline></geometry>"
        f"<material><ambient>{colour}</ambient><diffuse>{colour}</diffuse></material></visual>"
    )
