"""Robot simulator files: URDF, a tree of links with an open loop, and SDF, whose joints close the loop.

Lengths are in metres, masses in kilograms, angles in radians; every joint is zero at the first sample. The frames of links are
the frames of the bodies: crank, coupler and rocker begin at pivot A, at the crank pin and at pivot B. The loop is cut at the pin
that joins two connected bodies, in a four-bar at C.
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
"""Limits that URDF requires for every joint, in newton metres and radians per second; no model reaches them."""
_ZEROS = " ".join(f'{name}="0"' for name in INERTIA)
_NO_MASS = f'<inertial><origin xyz="0 0 0"/><mass value="0"/><inertia {_ZEROS}/></inertial>'
"""Inertial element of frames. Without it, PyBullet assumes a kilogram."""


@dataclass(frozen=True)
class Joint:
    """Pin between two bodies; ``closing`` if the bodies are already connected, so that the pin closes a loop."""

    name: str
    parent: int
    child: int
    at_parent: complex
    """Position in the frame of the parent, in the unit of the machine."""
    at_child: complex
    closing: bool


def tree_of(machine: Machine) -> list[Joint]:
    """Return the joints of a machine as a tree from the ground, followed by the joints that close a loop."""
    known, found, closing = {GROUND}, [], []
    left = [
        (pin, first, second)
        for pin in machine.pins
        if not pin.post
        for first, second in zip(pin.points, pin.points[1:])
    ]
    while left:
        number = next(
            (k for k, (_, first, second) in enumerate(left) if (first.body in known) != (second.body in known)), None
        )
        if number is None:
            break
        pin, first, second = left.pop(number)
        if first.body not in known:
            first, second = second, first
        known.add(second.body)
        found.append(Joint(pin.name, first.body, second.body, first.at, second.at, False))
    closing = [Joint(pin.name, first.body, second.body, first.at, second.at, True) for pin, first, second in left]
    return found + closing


class _Frame(NamedTuple):
    """Position in metres and angle."""

    at: complex
    angle: float

    def text(self) -> str:
        return " ".join(map(_number, (self.at.real, self.at.imag, 0.0)))


def _number(value: float) -> str:
    return f"{value + 0.0:.12g}"


class _Model:
    """Frames, masses and shapes of bodies in metres, for both formats."""

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
        """Return the attributes of the inertia, which both formats share."""
        inertia = self.masses[body].inertia
        return "".join(
            f'{name}="{_number(value)}" ' for name, value in zip(INERTIA, inertia[np.triu_indices(3)])
        ).strip()

    def centre(self, body: int) -> str:
        return " ".join(_number(value) for value in self.masses[body].centre)


def _in_metres(mass: MassProperties) -> MassProperties:
    return MassProperties(mass.mass, mass.centre / 1000, mass.inertia / 1e6)


def to_urdf(solids: Solids, name: str, used: Interval | None = None) -> str:
    """Write a tree of links from ``ground``, with frames ``closing_C_1`` and ``closing_C_2`` for a loop constraint.

    The frames follow the convention of onshape-to-robot and coincide at zero. No joint mimics another, because a rocker does not
    turn in proportion to its crank. ``used`` limits the joint of the crank; by default it turns freely. Visual shapes are boxes
    and cylinders, because the format has no extruded outlines.
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
    """Return the origin of the child's frame in the parent's frame."""
    parent, child = model.frames[joint.parent], model.frames[joint.child]
    return _Frame((child.at - parent.at) * np.exp(-1j * parent.angle), 0.0).text()


def _visual(part: Solid, metre: float) -> str:
    """Draw a part by boxes and cylinders."""
    prism, shapes = part.prism, []
    tall = prism.height / 1000
    rgba = " ".join(_number(int(part.colour[k : k + 2], 16) / 255) for k in (1, 3, 5)) + " 1"
    material = f'<material name="{part.colour}"><color rgba="{rgba}"/></material>'
    middle = (part.up + (prism.low + prism.high) / 2) / 1000

    def add(at: complex, angle: float, geometry: str) -> None:
        position = " ".join(map(_number, (*_xy((part.at + at) / 1000), middle)))
        shapes.append(
            f'<visual><origin xyz="{position}" rpy="0 0 {_number(angle)}"/><geometry>{geometry}</geometry>{material}</visual>'
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
        # as wide as the rounded ends of the side, or thin without rounded ends
        before = prism.arcs[k - 1]
        half = 0.0 if before is None else before.radius
        side = end - start
        inward = 1j * side / abs(side)
        at = (start + end) / 2 + inward * half
        key = (round(at.real, 6), round(at.imag, 6))
        if key not in boxes:
            boxes.add(key)
            size = " ".join(map(_number, (abs(side) / 1000, max(2 * half, 0.02 * abs(side)) / 1000, tall)))
            add(at, float(np.angle(side)), f'<box size="{size}"/>')
    return "".join(shapes)


def _xy(point: complex) -> tuple[float, float]:
    return point.real, point.imag


def to_sdf(solids: Solids, name: str) -> str:
    """Write SDF 1.9: a link for each body, the ground fixed to the world, and a revolute joint for each pin.

    Bodies of a loop are children of two joints, which URDF does not allow. Shapes are the extruded outlines without holes.
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
    # coarse arcs suffice for a picture
    points = "".join(f"<point>{_number(z.real / 1000)} {_number(z.imag / 1000)}</point>" for z in ring_of(prism))
    pose = " ".join(map(_number, (*_xy(part.at / 1000), (part.up + prism.low) / 1000)))
    colour = " ".join(_number(int(part.colour[k : k + 2], 16) / 255) for k in (1, 3, 5)) + " 1"
    return (
        f'<visual name="{part.name}"><pose>{pose} 0 0 0</pose><geometry><polyline>{points}'
        f"<height>{_number(prism.height / 1000)}</height></polyline></geometry>"
        f"<material><ambient>{colour}</ambient><diffuse>{colour}</diffuse></material></visual>"
    )
