"""A four-bar as files: CSV for tables, SVG to look at, DXF for CAD and for cutting, MJCF for simulation, JSON for pylinkage.

Coordinates are the user's own; DXF and MJCF know units, so there `unit_mm` says how many millimetres the user's unit has.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError
from synthesis.four_bar import close_loop
from synthesis.fourbar.joints import Joints, joints_at, joints_over
from synthesis.linkage import Linkage, Mass
from synthesis.sheet import Extra, More, Sheet, csv_text, dxf_document, dxf_text, given_cells
from synthesis.target import TURN, Interval, Target

FARTHEST = 1e9
"""Largest distance from the origin, in longest links, at which coordinates still hold the shape."""
STYLE = (
    "<style>path{fill:none;stroke:#1d2733;stroke-width:4;stroke-linejoin:round;stroke-linecap:round}"
    ".ground{stroke:#7b8794;stroke-dasharray:14 10}.crank{stroke:#c2410c;stroke-width:8}.rocker{stroke-width:8}"
    ".body{fill:#2563eb33;stroke:#2563eb}.path{stroke:#0f766e}.turn{stroke:#0f766e66;stroke-width:2}"
    "circle{fill:#fff;stroke:#1d2733;stroke-width:3}.pivot{fill:#1d2733}.pose{fill:#b91c1c;stroke:none}"
    ".point{fill:#0f766e;stroke:none}text{font:22px sans-serif;fill:#1d2733}.size{font-size:18px;fill:#566272}</style>"
)
DXF_COLOURS = {"GROUND": 8, "LINKS": 7, "BODY": 5, "PATH": 1}
"""AutoCAD colour index of each layer."""
LARGEST_MM = 1e12
"""Largest coordinate of a DXF or MJCF file in millimetres: beyond, their readers lose digits."""
SPEED = 1.0
"""Crank speed of the simulation's drive in radians a second."""
TIMESTEP = 1e-4
"""Step of the simulation in seconds."""
SOLVER = f'solref="{2 * TIMESTEP!r} 1" solimp="0.99999 0.99999 1e-6"'
"""How stiffly a loop is closed."""
HOLE_OF_SHORTEST, HOLE_OF_LONGEST = 0.3, 0.05
"""The default diameter of a hole: the lesser of these parts of the shortest and of the longest link."""
WIDTH_OF_HOLE = 2.5


def used_joints(linkage: Linkage, interval: Interval) -> Joints:
    """The joints over the used interval. FieldError for a linkage that does not close there, at the crank angle that fails."""
    if max(abs(linkage.pivot_a.real), abs(linkage.pivot_a.imag)) > FARTHEST * max(linkage.links):
        raise FieldError(
            "/solution/mount/pivot_a", f"lies more than {FARTHEST:.0e} link lengths from the origin: move the origin"
        )
    joints = joints_over(linkage, interval)
    if not joints.closed:
        place = int(np.argmin(np.isfinite(joints.coupler_pin))) / (joints.crank_angle.size - 1)
        first, last = interval
        raise FieldError(
            "/solution/links",
            f"the four links do not close {np.rad2deg(first + place * (last - first)):.6g} degrees after the start",
        )
    return joints


def _turn(linkage: Linkage) -> Joints | None:
    """The joints over a whole turn; None where the crank cannot turn fully."""
    return joints_over(linkage, Interval(0.0, TURN)) if linkage.turns_fully else None


def requested_positions(target: Target) -> Complexes:
    """The positions that a target asks for; none where it asks for none."""
    asked = target.asked.position
    return np.empty(0, dtype=complex) if asked is None else asked[np.isfinite(asked)]


def requested_poses(target: Target, turned: Floats) -> Iterable[tuple[complex, float]]:
    """Position and rotation of each pose that a target asks for; ``turned`` (N,): of the body, where no rotation is asked for."""
    rotation, places, _ = target.asked
    if places is None:
        return []
    turns = turned if rotation is None else np.where(np.isnan(rotation), turned, rotation)
    return ((place, turn) for place, turn in zip(places, turns) if np.isfinite(place))


def to_svg(linkage: Linkage, target: Target, extra: Extra | None = None, length_unit: str | None = None) -> str:
    """A drawing at the first sample, y up, with the names of the joints and the lengths of the links; `Extra`: further parts."""
    used, turn, now = used_joints(linkage, target.interval), _turn(linkage), joints_at(linkage, np.zeros(1))
    a, b, d, c = now.pivot_a, now.pivot_b, now.crank_pin[0], now.coupler_pin[0]
    point = None if now.body_point is None else now.body_point[0]
    path, marks = used.body_point, requested_positions(target)
    way = None if turn is None else turn.body_point
    shown = [np.array([a, b]), used.crank_pin, used.coupler_pin, marks]
    if path is not None:
        shown.append(path)
        if way is not None and np.all(np.isfinite(way)):
            shown.append(way)
    if extra is not None:
        shown.append(extra.points)
    sheet = Sheet(np.concatenate(shown), 0.08, 1000, digits=7)

    def dot(z: complex, radius: float, name: str) -> str:
        return sheet.dot(z, radius, f'class="{name}"')

    curves = ""
    if path is not None:
        curves = ("" if way is None else sheet.line(way, "turn")) + sheet.line(path, "path")
    curves += "".join(dot(mark, 5, "pose") for mark in marks)
    body = np.array([d, c] if point is None else [d, c, point])
    pins = dot(a, 11, "pivot") + dot(b, 11, "pivot") + dot(d, 8, "pin") + dot(c, 8, "pin")
    named = {"A": a, "B": b, "D": d, "C": c} | ({} if point is None else {"P": point})
    names = "".join(sheet.label(z, name) for name, z in named.items())
    middles = ((a + d) / 2, (d + c) / 2, (b + c) / 2, (a + b) / 2)
    sizes = "".join(
        sheet.label(z, f"{length:.5g}", 'class="size"') for z, length in zip(middles, linkage.links, strict=True)
    )
    return sheet.text(
        "Four-bar linkage: crank {:.6g}, coupler {:.6g}, rocker {:.6g}, ground {:.6g}".format(*linkage.links)
        + unit_in_words(length_unit),
        [
            STYLE,
            f'<g id="GROUND">{sheet.line(np.array([a, b]), "ground")}</g>',
            f'<g id="PATH">{curves}</g>',
            f'<g id="BODY">{sheet.line(body, "body", closed=True)}</g>',
            f'<g id="LINKS">{sheet.line(np.array([a, d]), "crank")}{sheet.line(np.array([b, c]), "rocker")}</g>',
            f"<g>{pins}{'' if point is None else dot(point, 7, 'point')}</g>",
            *([] if extra is None else [f'<g id="DRIVE">{extra.draw(sheet)}</g>']),
            f'<g id="NAMES">{names}{sizes}</g>',
            sheet.unit_text(length_unit),
        ],
    )


def unit_in_words(length_unit: str | None) -> str:
    """Return the end of a title that names the unit of lengths, if it is known."""
    return f"; lengths in {length_unit}" if length_unit else ""


def to_csv(linkage: Linkage, target: Target, unit: float, more: Mapping[str, Iterable[Any]] | None = None) -> str:
    """The motion at the samples: what was asked for, what the linkage does, and where its joints are.

    Angles are divided by ``unit`` (radians in one unit of angle); an empty cell is a number that was not asked for. ``more`` are
    further columns, a value a sample.
    """
    used_joints(linkage, target.interval)
    joints = joints_at(linkage, target.crank)
    columns = {
        "crank_angle": target.crank / unit,
        **motion_columns(target, unit, joints.rotation, joints.body_point),
        "transmission_angle": joints.transmission_angle / unit,
        "crank_direction": joints.crank_angle / unit,
        "coupler_direction": joints.coupler_angle / unit,
        "rocker_direction": joints.rocker_angle / unit,
        **places("crank_pin_{}", joints.crank_pin, target.samples),
        **places("coupler_pin_{}", joints.coupler_pin, target.samples),
        **(more or {}),
    }
    return csv_text(columns)


def motion_columns(
    target: Target, unit: float, rotation: Floats, position: Complexes | None
) -> dict[str, Iterable[Any]]:
    """Return columns of the wanted and the actual motion, and of its errors: rotation got minus wanted, and a distance.

    A cell is empty if its number was not given.
    """
    asked, rows = target.asked, target.samples
    wanted = None if asked.rotation is None else asked.rotation / unit
    turned = rotation - asked.moved
    if asked.rotation is not None:  # a body a whole turn away lies where it was asked for
        turned = turned - TURN * np.round(np.nanmean(turned - asked.rotation) / TURN)
    turned = turned / unit
    off = None if position is None or asked.position is None else np.abs(asked.position - position)
    return {
        "rotation_wanted": given_cells(wanted, rows),
        **places("{}_wanted", asked.position, rows),
        "rotation": turned,
        **places("{}", position, rows),
        "rotation_error": given_cells(None if wanted is None else turned - wanted, rows),
        "position_error": given_cells(off, rows),
    }


def places(name: str, values: Complexes | None, samples: int) -> dict[str, Iterable[Any]]:
    """Two columns of points, blank where there are none; ``name`` has a place for x and y."""
    x, y = (given_cells(None if values is None else part(values), samples) for part in (np.real, np.imag))
    return {name.format("x"): x, name.format("y"): y}


def check_size(size: float, largest: float, unit_mm: float) -> None:
    """FieldError for a drawing that the readers of a file cannot hold: of so large a size, up to so far from the origin."""
    if not 1e-9 <= size * unit_mm or not largest * unit_mm <= LARGEST_MM:
        raise FieldError("/length_unit", f"wanted a drawing between 1e-9 and {LARGEST_MM:.0e} mm in size")


def _check_size(linkage: Linkage, unit_mm: float) -> None:
    joints = joints_at(linkage, np.zeros(1))
    reach = linkage.coupler_point[0] if linkage.coupler_point else 0.0
    largest = max(abs(joints.pivot_a), abs(joints.pivot_b), max(linkage.links), reach)
    check_size(max(linkage.links), largest, unit_mm)


def to_dxf(linkage: Linkage, target: Target, unit_mm: float = 1.0, more: More | None = None) -> str:
    """The linkage for CAD, in millimetres, at the first sample.

    Layers: GROUND (ground line, pivots), LINKS (crank, coupler, rocker, pins), BODY (triangle of coupler and body point,
    and a cross with a direction at each requested pose), PATH (the body point's way over the used interval). See
    `More` for further parts.

    Law: the ends of the four links meet to 1e-6 mm; the drawing passes ezdxf's audit.
    """
    _check_size(linkage, unit_mm)
    used = used_joints(linkage, target.interval)
    document = dxf_document(DXF_COLOURS, 4)
    space = document.modelspace()

    def xy(z: complex) -> tuple[float, float]:
        return float(z.real * unit_mm), float(z.imag * unit_mm)

    now = joints_at(linkage, np.zeros(1))
    a, b, d, c = now.pivot_a, now.pivot_b, now.crank_pin[0], now.coupler_pin[0]
    size = max(linkage.links) * unit_mm
    space.add_line(xy(a), xy(b), dxfattribs={"layer": "GROUND"})
    for pivot in (a, b):
        space.add_circle(xy(pivot), 0.02 * size, dxfattribs={"layer": "GROUND"})
    for first, second in ((a, d), (d, c), (c, b)):
        space.add_line(xy(first), xy(second), dxfattribs={"layer": "LINKS"})
    for pin in (d, c):
        space.add_circle(xy(pin), 0.012 * size, dxfattribs={"layer": "LINKS"})
    body = None if now.body_point is None else np.array([d, c, now.body_point[0]])
    turned = joints_at(linkage, target.crank).rotation
    return dxf_with_motion(document, xy, size, unit_mm, body, used.body_point, requested_poses(target, turned), more)


def dxf_with_motion(
    document: Any,
    xy: Callable[[complex], tuple[float, float]],
    size: float,
    unit_mm: float,
    body: Complexes | None,
    path: Complexes | None,
    poses: Iterable[tuple[complex, float]],
    more: More | None,
) -> str:
    """The file of a drawing of links of some ``size`` in millimetres, with the body's outline, its way, and requested poses."""
    space = document.modelspace()
    if body is not None and path is not None:
        space.add_lwpolyline([xy(z) for z in body], close=True, dxfattribs={"layer": "BODY"})
        space.add_lwpolyline([xy(z) for z in path], dxfattribs={"layer": "PATH"})
    for place, turn in poses:
        space.add_point(xy(place), dxfattribs={"layer": "BODY"})
        arm = place + 0.08 * size / unit_mm * np.exp(1j * turn)
        space.add_line(xy(place), xy(arm), dxfattribs={"layer": "BODY"})
    if more is not None:
        document.layers.add(more.layer, color=more.colour)
        more.draw(space, xy, size)
    return dxf_text(document)


def to_mjcf(linkage: Linkage, target: Target, unit_mm: float = 1.0, masses: Mapping[str, Mass] | None = None) -> str:
    """The linkage as a MuJoCo model in metres: three bodies, hinges, and the loop closed by an equality constraint.

    ``masses``: of crank, coupler and rocker, in kilograms and the unit of the lengths; without them links are slender rods.

    Reference position is the first sample. The actuator ``drive`` turns the crank at the speed of its control, in radians a
    second; the keyframe ``start`` sets it to turn the used way. The plane is x-y, without gravity. Sites: ``body_point``,
    and ``loop_coupler`` and ``loop_rocker``, whose distance is the loop's residual.
    """
    _check_size(linkage, unit_mm)
    used_joints(linkage, target.interval)
    now = joints_at(linkage, np.zeros(1))
    metre = unit_mm / 1000
    crank, coupler, rocker, ground = (value * metre for value in linkage.links)
    longest = max(crank, coupler, rocker, ground)
    thick = 0.02 * longest
    at_a, at_b = now.pivot_a * metre, now.pivot_b * metre
    angle1, angle2, angle3 = (float(x[0]) for x in (now.crank_angle, now.coupler_angle, now.rocker_angle))

    def rod(name: str, length: float, colour: str) -> str:
        if masses is None:
            # A slender rod of 1 kg per metre at the longest link's scale, with contacts off.
            mass, centre = length / longest, f"{length / 2!r} 0 0"
            inertia = mass * max(length, thick) ** 2 / 12
        else:
            # about the axis of a hinge; in the plane no other counts
            one = masses[name]
            mass, centre, inertia = one.mass, xy0(one.at * metre), one.inertia * metre**2
        return (
            f'<inertial pos="{centre}" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
            f'<geom name="{name}_rod" type="capsule" fromto="0 0 0 {length!r} 0 0" size="{thick / 2!r}" rgba="{colour}"/>'
        )

    point = ""
    if linkage.coupler_point is not None:
        radius, angle = linkage.coupler_point
        local = complex(radius * metre * np.exp(1j * angle))
        point = f'\n        <site name="body_point" pos="{xy0(local)}" size="{thick!r}" rgba="0.06 0.46 0.43 1"/>'
        point += f'\n        <geom name="body" type="capsule" fromto="0 0 0 {xy0(local)}" size="{thick / 3!r}"/>'
    way = SPEED if not target.clockwise else -SPEED
    # The drive gains its speed within tenths of a second: a harder start would pull the loop's constraint apart.
    gain = longest**2 / 0.2 * (1.0 if masses is None else sum(one.mass for one in masses.values()))
    slope = float(close_loop(np.array(linkage.links), [linkage.start]).coupler_angle_gradient(linkage.branch)[0, 4])
    # From the loop: L1 sin(t1 - t2) = L3 t3' sin(t3 - t2).
    lever = linkage.links[2] * np.sin(angle3 - angle2)
    rocking = float(linkage.links[0] * np.sin(angle1 - angle2) / lever) if lever else 0.0
    speeds = " ".join(repr(way * value) for value in (1.0, slope - 1.0, rocking) if np.isfinite(value))
    moving = f' qvel="{speeds}"' if speeds.count(" ") == 2 else ""
    duration = abs(target.interval.last - target.interval.first) / SPEED
    site = f'size="{thick / 2!r}"'
    return model_text(
        "four-bar linkage",
        f"""{duration:.6g} s at the keyframe's speed are the used interval;
       masses are {"those of slender rods" if masses is None else "kilograms of its parts"}""",
        'rgba="0.15 0.39 0.92 1"',
        longest,
        f"""<geom name="ground" type="capsule" fromto="{xy0(at_a)} {xy0(at_b)}" size="{thick / 4!r}" rgba="0.5 0.5 0.5 1"/>
    <body name="crank" pos="{xy0(at_a)}" euler="0 0 {angle1!r}">
      <joint name="crank"/>
      {rod("crank", crank, "0.76 0.25 0.05 1")}
      <body name="coupler" pos="{crank!r} 0 0" euler="0 0 {angle2 - angle1!r}">
        <joint name="coupler"/>
        {rod("coupler", coupler, "0.15 0.39 0.92 1")}
        <site name="loop_coupler" pos="{coupler!r} 0 0" {site}/>{point}
      </body>
    </body>
    <body name="rocker" pos="{xy0(at_b)}" euler="0 0 {angle3!r}">
      <joint name="rocker"/>
      {rod("rocker", rocker, "0.11 0.15 0.2 1")}
      <site name="loop_rocker" pos="{rocker!r} 0 0" {site}/>
    </body>""",
        f'<connect name="loop" site1="loop_coupler" site2="loop_rocker" {SOLVER}/>',
        "crank",
        gain,
        f'ctrl="{way!r}"{moving}',
    )


def xy0(z: complex) -> str:
    """A place of the plane in a MuJoCo model."""
    return f"{float(z.real)!r} {float(z.imag)!r} 0"


def model_text(
    name: str, about: str, geometry: str, size: float, bodies: str, loop: str, joint: str, gain: float, start: str
) -> str:
    """A MuJoCo model of a linkage of some ``size`` in metres, whose ``loop`` is closed by an equality constraint.

    ``geometry``: what all its geoms have. ``joint``, ``gain``: of the actuator ``drive``. ``start``: attributes of the keyframe.
    """
    return f"""<mujoco model="{name}">
  <!-- lengths in metres, angles in radians; {about} -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{TIMESTEP!r}" gravity="0 0 0" integrator="implicitfast" iterations="200" tolerance="1e-16"/>
  <default>
    <geom contype="0" conaffinity="0" {geometry}/>
    <joint type="hinge" axis="0 0 1"/>
  </default>
  <worldbody>
    <light pos="0 0 {4 * size!r}" dir="0 0 -1"/>
    {bodies}
  </worldbody>
  <equality>
    {loop}
  </equality>
  <actuator>
    <velocity name="drive" joint="{joint}" kv="{gain!r}"/>
  </actuator>
  <keyframe>
    <key name="start" {start}/>
  </keyframe>
</mujoco>
"""


def to_pylinkage(linkage: Linkage, target: Target, length_unit: str | None = None) -> str:
    """The linkage as the JSON of a pylinkage ``Mechanism``, at the first sample: its ``mechanism_from_json`` reads it.

    Joints: pivot_a, pivot_b, crank_pin, coupler_pin, and body_point where the linkage guides one, which follows the coupler. A
    crank that turns fully is a driver in the sense of the motion; any other swings over the used interval and back. The drive
    turns in the steps of `Interval.by_degrees`, of at most a degree.

    Law: pylinkage's places of the body point are ours to rounding.
    """
    used = used_joints(linkage, target.interval)
    travel = target.interval.by_degrees()
    joints = joints_at(linkage, np.zeros(1))
    first, last = (linkage.start + linkage.ground_angle + float(end) for end in target.interval)
    start = linkage.start + linkage.ground_angle

    def place(z: complex) -> list[float]:
        return [float(z.real), float(z.imag)]

    def joint(name: str, kind: str, z: complex, **more: Any) -> dict[str, Any]:
        return {"id": name, "type": kind, "position": place(z), **more}

    parts = [
        joint("pivot_a", "ground", used.pivot_a),
        joint("pivot_b", "ground", used.pivot_b),
        joint("crank_pin", "revolute", joints.crank_pin[0]),
        joint("coupler_pin", "revolute", joints.coupler_pin[0]),
    ]
    if linkage.coupler_point is not None:
        assert joints.body_point is not None
        radius, angle = linkage.coupler_point
        way = {"ref_joint1_id": "crank_pin", "ref_joint2_id": "coupler_pin", "distance": radius, "angle": angle}
        parts.append(joint("body_point", "tracker", joints.body_point[0], **way))
    step = float(travel[1] - travel[0])
    drive: dict[str, Any] = {"type": "driver", "angular_velocity": step}
    if not linkage.turns_fully:
        drive = {"type": "arc_driver", "angular_velocity": abs(step)}
        drive |= {"arc_start": min(first, last), "arc_end": max(first, last)}
    mechanism = {
        "name": "four-bar linkage" + unit_in_words(length_unit),
        "joints": parts,
        "links": [
            {"id": "ground", "type": "ground", "joints": ["pivot_a", "pivot_b"]},
            {
                "id": "crank",
                "joints": ["pivot_a", "crank_pin"],
                "motor_joint": "pivot_a",
                "initial_angle": start,
                **drive,
            },
            {"id": "coupler", "type": "link", "joints": ["crank_pin", "coupler_pin"]},
            {"id": "rocker", "type": "link", "joints": ["pivot_b", "coupler_pin"]},
        ],
        "ground": "ground",
    }
    return json.dumps(mechanism, indent=1, allow_nan=False) + "\n"


def plate_sizes(
    links: Sequence[float], hole: float | None = None, width: float | None = None, share: float = 1.0
) -> tuple[float, float]:
    """Diameter of the holes and width of the plates of links; the defaults go by the shortest and the longest.

    ``share``: of the default diameter, where that leaves no room for something else.
    """
    if hole is None:
        most = np.inf if width is None else width / WIDTH_OF_HOLE
        hole = share * min(HOLE_OF_SHORTEST * min(links), HOLE_OF_LONGEST * max(links), most)
    return float(hole), float(WIDTH_OF_HOLE * hole if width is None else width)


def check_sizes(links: Sequence[float], hole: float, width: float, where: str) -> None:
    """FieldError for a hole that leaves no material: wider than the plate, or than the distance of two joints."""
    if not hole < width:
        raise FieldError(f"{where}/hole", f"wanted less than the width {width:g}, found {hole:g}")
    if not hole < min(links):
        raise FieldError(f"{where}/hole", f"wanted less than the shortest link {min(links):g}, found {hole:g}")
