"""A linkage as files: CSV for tables, SVG for the eye, DXF for CAD, MJCF for simulation.

Coordinates are the user's own; DXF and MJCF know units, so there `unit_mm` says how many millimetres the user's unit has.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import FULL_CRANK, close_loop, family
from synthesis.fourbar.solution import Solution, principal
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

DXF_COLOURS = {"GROUND": 8, "LINKS": 7, "BODY": 5, "PATH": 1}
"""AutoCAD colour index of each layer."""
LARGEST_MM = 1e12
"""Largest coordinate of a DXF or MJCF file in millimetres: beyond, their readers lose digits."""
FARTHEST = 1e9
"""Largest distance from the origin, in longest links, at which coordinates still hold the shape."""
SPEED = 1.0
"""Crank speed of the simulation's drive in radians a second."""
TIMESTEP = 1e-4
"""Step of the simulation in seconds."""


@dataclass(frozen=True)
class Joints:
    """Places and angles of a linkage at crank positions; every array has shape (n,).

    ``body_point`` is None where there is no pose (rotation only). Angles are those of the links against the x axis, in
    radians and continuous; ``rotation`` is the body's. NaN where the loop does not close.
    """

    pivot_a: complex
    pivot_b: complex
    crank_pin: Complexes
    coupler_pin: Complexes
    body_point: Complexes | None
    crank_angle: Floats
    coupler_angle: Floats
    rocker_angle: Floats
    rotation: Floats
    transmission_angle: Floats


@dataclass(frozen=True)
class MountedLinkage:
    """A linkage in the plane, from the numbers that a reply holds; angles in radians.

    Parameters
    ----------
    links : tuple of float
        Crank, coupler, rocker, ground.
    branch : int
    start : float
        Crank angle from the ground line at the first sample.
    body_offset : float
        rotation = coupler angle + ground angle + this.
    ground_angle : float
    pivot_a : complex
    coupler_point : tuple of float, optional
        Radius and angle of the body point in the coupler's frame.
    """

    links: tuple[float, float, float, float]
    branch: int
    start: float
    body_offset: float = 0.0
    ground_angle: float = 0.0
    pivot_a: complex = 0j
    coupler_point: tuple[float, float] | None = None

    @classmethod
    def from_solution(cls, solution: Solution) -> MountedLinkage:
        """The linkage that a solution is; without a pose it lies along the x axis from the origin."""
        pose = solution.mount
        where = {}
        if pose is not None:
            where = {
                "ground_angle": pose.ground_angle,
                "pivot_a": pose.pivot_a,
                "coupler_point": (pose.coupler_radius, pose.coupler_angle),
            }
        links = tuple(float(value) for value in solution.links)
        return cls(links, solution.branch, solution.start, solution.body_offset or 0.0, **where)

    def joints(self, travel: Floats) -> Joints:
        """Places at crank angles measured from the first sample.

        Law: ``|D-A|, |C-D|, |C-B|`` are the links at every position, and C is the same from both sides of the loop to
        rounding.
        """
        travel = np.atleast_1d(np.asarray(travel, dtype=float))
        closure = close_loop(np.array(self.links), np.concatenate([[self.start], self.start + travel]))
        branch = np.array(self.branch)
        turn = self.ground_angle
        coupler = principal(closure.coupler_angle(branch))[1:] + turn
        rocker = closure.rocker_angle(branch)[1:] + turn
        crank = self.start + travel + turn
        pivot_b = self.pivot_a + self.links[3] * np.exp(1j * turn)
        pin = self.pivot_a + self.links[0] * np.exp(1j * crank)
        point = None
        if self.coupler_point is not None:
            radius, angle = self.coupler_point
            point = pin + radius * np.exp(1j * (angle + coupler))
        return Joints(
            complex(self.pivot_a),
            complex(pivot_b),
            np.where(closure.closed[1:], pin, np.nan),
            pin + self.links[1] * np.exp(1j * coupler),
            point,
            crank,
            coupler,
            rocker,
            coupler + self.body_offset,
            closure.transmission_angle[1:],
        )

    def over(self, first: float, last: float, least: int = 181) -> Joints:
        """Joints at even steps of at most a degree between two crank angles from the first sample."""
        steps = max(least, int(np.ceil(np.rad2deg(abs(last - first)))) + 1)
        return self.joints(np.linspace(first, last, min(steps, 7201)))

    @property
    def turns_fully(self) -> bool:
        return family(np.array(self.links))[()] in FULL_CRANK


def check_closes(linkage: MountedLinkage, span: float) -> Joints:
    """The joints over the used interval. FieldError for a linkage that does not close there, at the crank angle that fails."""
    if max(abs(linkage.pivot_a.real), abs(linkage.pivot_a.imag)) > FARTHEST * max(linkage.links):
        raise FieldError(
            "/solution/mount/pivot_a", f"lies more than {FARTHEST:.0e} link lengths from the origin: move the origin"
        )
    joints = linkage.over(0.0, span)
    if not np.all(np.isfinite(joints.coupler_pin)):
        place = int(np.argmin(np.isfinite(joints.coupler_pin))) / (joints.crank_angle.size - 1)
        raise FieldError(
            "/solution/links", f"the four links do not close {np.rad2deg(place * span):.6g} degrees after the start"
        )
    return joints


def to_csv(linkage: MountedLinkage, target: Target, unit: float) -> str:
    """The motion at the samples: what was asked for, what the linkage does, and where its joints are.

    Angles are divided by ``unit`` (radians in one unit of angle); an empty cell is a number that was not asked for.
    """
    check_closes(linkage, target.span)
    joints = linkage.joints(target.crank)
    blank = [None] * target.samples

    def xy(values: Complexes | None) -> list[list[float | None]]:
        return [blank, blank] if values is None else [values.real.tolist(), values.imag.tolist()]

    rotation = None if target.rotation is None else target.rotation / unit
    point = joints.body_point
    off = None if point is None or target.position is None else np.abs(target.position - point)
    columns = {
        "crank_angle": (target.crank / unit).tolist(),
        "rotation_wanted": blank if rotation is None else rotation.tolist(),
        **dict(zip(("x_wanted", "y_wanted"), xy(target.position))),
        "rotation": (joints.rotation / unit).tolist(),
        **dict(zip(("x", "y"), xy(point))),
        "rotation_error": blank if rotation is None else (rotation - joints.rotation / unit).tolist(),
        "position_error": blank if off is None else off.tolist(),
        "transmission_angle": (joints.transmission_angle / unit).tolist(),
        "crank_direction": (joints.crank_angle / unit).tolist(),
        "coupler_direction": (joints.coupler_angle / unit).tolist(),
        "rocker_direction": (joints.rocker_angle / unit).tolist(),
        **dict(zip(("crank_pin_x", "crank_pin_y"), xy(joints.crank_pin))),
        **dict(zip(("coupler_pin_x", "coupler_pin_y"), xy(joints.coupler_pin))),
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
    return text.getvalue()


def _marks(target: Target) -> Complexes:
    return np.empty(0, dtype=complex) if target.position is None else target.position


def to_svg(linkage: MountedLinkage, target: Target, unit_name: str = "") -> str:
    """A drawing at the first sample, y up: ground, links, body, path of the body point, requested poses."""
    used = check_closes(linkage, target.span)
    turn = linkage.over(0.0, TURN) if linkage.turns_fully else None
    a, b, d, c = used.pivot_a, used.pivot_b, used.crank_pin[0], used.coupler_pin[0]
    path = used.body_point
    marks = _marks(target)
    everything = [np.array([a, b]), used.crank_pin, used.coupler_pin, marks]
    if path is not None:
        everything.append(path)
        if turn is not None and np.all(np.isfinite(turn.body_point)):
            everything.append(turn.body_point)
    points = np.concatenate(everything)
    low, high = complex(points.real.min(), points.imag.min()), complex(points.real.max(), points.imag.max())
    size = max(high.real - low.real, high.imag - low.imag)
    margin = 0.08 * size
    # Drawn about its own corner in thousandths of its size: viewers hold coordinates in single precision.
    scale = 1000 / (size + 2 * margin)
    corner = complex(low.real - margin, high.imag + margin)
    width, height = ((high - low).real + 2 * margin) * scale, ((high - low).imag + 2 * margin) * scale

    def at(z: complex) -> str:
        moved = (z - corner) * scale
        return f"{moved.real:.7g},{-moved.imag + 0.0:.7g}"

    def line(points: Complexes, name: str, closed: bool = False) -> str:
        tail = "Z" if closed else ""
        return f'<path class="{name}" d="M{" L".join(at(z) for z in points)}{tail}"/>'

    def dot(z: complex, radius: float, name: str) -> str:
        x, y = at(z).split(",")
        return f'<circle class="{name}" cx="{x}" cy="{y}" r="{radius:g}"/>'

    title = "Four-bar linkage: crank {:.6g}, coupler {:.6g}, rocker {:.6g}, ground {:.6g}".format(*linkage.links)
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.7g} {height:.7g}">',
        f"<title>{escape(title)}{escape(' ' + unit_name if unit_name else '')}</title>",
        "<style>path{fill:none;stroke:#1d2733;stroke-width:4;stroke-linejoin:round;stroke-linecap:round}"
        ".ground{stroke:#7b8794;stroke-dasharray:14 10}.crank{stroke:#c2410c;stroke-width:8}.rocker{stroke-width:8}"
        ".body{fill:#2563eb33;stroke:#2563eb}.path{stroke:#0f766e}.turn{stroke:#0f766e66;stroke-width:2}"
        "circle{fill:#fff;stroke:#1d2733;stroke-width:3}.pivot{fill:#1d2733}.pose{fill:#b91c1c;stroke:none}"
        ".point{fill:#0f766e;stroke:none}</style>",
        f'<g id="GROUND">{line(np.array([a, b]), "ground")}</g>',
    ]
    curves = ""
    if path is not None:
        if turn is not None:
            curves += line(turn.body_point, "turn")
        curves += line(path, "path")
    curves += "".join(dot(mark, 5, "pose") for mark in marks)
    parts.append(f'<g id="PATH">{curves}</g>')
    body = np.array([d, c] if path is None else [d, c, path[0]])
    parts.append(f'<g id="BODY">{line(body, "body", closed=True)}</g>')
    parts.append(f'<g id="LINKS">{line(np.array([a, d]), "crank")}{line(np.array([b, c]), "rocker")}</g>')
    parts.append(
        "<g>"
        + dot(a, 11, "pivot")
        + dot(b, 11, "pivot")
        + dot(d, 8, "pin")
        + dot(c, 8, "pin")
        + ("" if path is None else dot(path[0], 7, "point"))
        + "</g>"
    )
    return "\n".join([*parts, "</svg>"]) + "\n"


def _check_size(linkage: MountedLinkage, unit_mm: float) -> None:
    joints = linkage.joints(np.zeros(1))
    reach = linkage.coupler_point[0] if linkage.coupler_point else 0.0
    largest = max(abs(joints.pivot_a), abs(joints.pivot_b), max(linkage.links), reach) * unit_mm
    if not 1e-9 <= max(linkage.links) * unit_mm or not largest <= LARGEST_MM:
        raise FieldError("/length_unit", f"wanted a drawing between 1e-9 and {LARGEST_MM:.0e} mm in size")


def to_dxf(linkage: MountedLinkage, target: Target, unit_mm: float = 1.0) -> str:
    """The linkage for CAD, in millimetres, at the first sample.

    Layers: GROUND (ground line, pivots), LINKS (crank, coupler, rocker, pins), BODY (triangle of coupler and body point,
    and a cross with a direction at each requested pose), PATH (the body point's way over the used interval).

    Law: the ends of the four links meet to 1e-6 mm; the drawing passes ezdxf's audit.
    """
    import ezdxf
    from ezdxf import units

    _check_size(linkage, unit_mm)
    used = check_closes(linkage, target.span)
    document = ezdxf.new("R2010", setup=False)
    document.units = units.MM
    document.header["$MEASUREMENT"] = 1
    for name, colour in DXF_COLOURS.items():
        document.layers.add(name, color=colour)
    space = document.modelspace()

    def xy(z: complex) -> tuple[float, float]:
        return float(z.real * unit_mm), float(z.imag * unit_mm)

    a, b, d, c = used.pivot_a, used.pivot_b, used.crank_pin[0], used.coupler_pin[0]
    size = max(linkage.links) * unit_mm
    space.add_line(xy(a), xy(b), dxfattribs={"layer": "GROUND"})
    for pivot in (a, b):
        space.add_circle(xy(pivot), 0.02 * size, dxfattribs={"layer": "GROUND"})
    for first, second in ((a, d), (d, c), (c, b)):
        space.add_line(xy(first), xy(second), dxfattribs={"layer": "LINKS"})
    for pin in (d, c):
        space.add_circle(xy(pin), 0.012 * size, dxfattribs={"layer": "LINKS"})
    if used.body_point is not None:
        point = used.body_point
        space.add_lwpolyline([xy(d), xy(c), xy(point[0])], close=True, dxfattribs={"layer": "BODY"})
        space.add_lwpolyline([xy(z) for z in point], dxfattribs={"layer": "PATH"})
    turns = target.rotation if target.rotation is not None else linkage.joints(target.crank).rotation
    for place, turn in zip(_marks(target), turns):
        space.add_point(xy(place), dxfattribs={"layer": "BODY"})
        arm = place + 0.08 * size / unit_mm * np.exp(1j * turn)
        space.add_line(xy(place), xy(arm), dxfattribs={"layer": "BODY"})
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()


def to_mjcf(linkage: MountedLinkage, target: Target, unit_mm: float = 1.0) -> str:
    """The linkage as a MuJoCo model in metres: three bodies, hinges, and the loop closed by an equality constraint.

    Reference position is the first sample. The actuator ``drive`` turns the crank at the speed of its control, in radians a
    second; the keyframe ``start`` sets it to turn the used way. The plane is x-y, without gravity. Sites: ``body_point``,
    and ``loop_coupler`` and ``loop_rocker``, whose distance is the loop's residual.
    """
    _check_size(linkage, unit_mm)
    used = check_closes(linkage, target.span)
    metre = unit_mm / 1000
    crank, coupler, rocker, ground = (value * metre for value in linkage.links)
    longest = max(crank, coupler, rocker, ground)
    thick = 0.02 * longest
    at_a, at_b = used.pivot_a * metre, used.pivot_b * metre
    angle1, angle2, angle3 = (float(x[0]) for x in (used.crank_angle, used.coupler_angle, used.rocker_angle))

    def rod(name: str, length: float, colour: str) -> str:
        # A slender rod of 1 kg per metre at the longest link's scale, with contacts off.
        mass, inertia = length / longest, length / longest * max(length, thick) ** 2 / 12
        return (
            f'<inertial pos="{length / 2!r} 0 0" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
            f'<geom name="{name}_rod" type="capsule" fromto="0 0 0 {length!r} 0 0" size="{thick / 2!r}" rgba="{colour}"/>'
        )

    def place(z: complex) -> str:
        return f"{z.real!r} {z.imag!r} 0"

    point = ""
    if linkage.coupler_point is not None:
        radius, angle = linkage.coupler_point
        local = complex(radius * metre * np.exp(1j * angle))
        point = f'\n        <site name="body_point" pos="{place(local)}" size="{thick!r}" rgba="0.06 0.46 0.43 1"/>'
        point += f'\n        <geom name="body" type="capsule" fromto="0 0 0 {place(local)}" size="{thick / 3!r}"/>'
    way = SPEED if target.span > 0 else -SPEED
    # The drive gains its speed within tenths of a second: a harder start would pull the loop's constraint apart.
    gain = longest**2 / 0.2
    slope = float(close_loop(np.array(linkage.links), [linkage.start]).coupler_angle_gradient(linkage.branch)[0, 4])
    # From the loop: L1 sin(t1 - t2) = L3 t3' sin(t3 - t2).
    lever = linkage.links[2] * np.sin(angle3 - angle2)
    rocking = float(linkage.links[0] * np.sin(angle1 - angle2) / lever) if lever else 0.0
    speeds = " ".join(repr(way * value) for value in (1.0, slope - 1.0, rocking) if np.isfinite(value))
    moving = f' qvel="{speeds}"' if speeds.count(" ") == 2 else ""
    duration = abs(target.span) / SPEED
    site = f'size="{thick / 2!r}"'
    return f"""<mujoco model="four-bar linkage">
  <!-- lengths in metres, angles in radians; {duration:.6g} s at the keyframe's speed are the used interval -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{TIMESTEP!r}" gravity="0 0 0" integrator="implicitfast" iterations="200" tolerance="1e-16"/>
  <default>
    <geom contype="0" conaffinity="0" rgba="0.15 0.39 0.92 1"/>
    <joint type="hinge" axis="0 0 1"/>
  </default>
  <worldbody>
    <light pos="0 0 {4 * longest!r}" dir="0 0 -1"/>
    <geom name="ground" type="capsule" fromto="{place(at_a)} {place(at_b)}" size="{thick / 4!r}" rgba="0.5 0.5 0.5 1"/>
    <body name="crank" pos="{place(at_a)}" euler="0 0 {angle1!r}">
      <joint name="crank"/>
      {rod("crank", crank, "0.76 0.25 0.05 1")}
      <body name="coupler" pos="{crank!r} 0 0" euler="0 0 {angle2 - angle1!r}">
        <joint name="coupler"/>
        {rod("coupler", coupler, "0.15 0.39 0.92 1")}
        <site name="loop_coupler" pos="{coupler!r} 0 0" {site}/>{point}
      </body>
    </body>
    <body name="rocker" pos="{place(at_b)}" euler="0 0 {angle3!r}">
      <joint name="rocker"/>
      {rod("rocker", rocker, "0.11 0.15 0.2 1")}
      <site name="loop_rocker" pos="{rocker!r} 0 0" {site}/>
    </body>
  </worldbody>
  <equality>
    <connect name="loop" site1="loop_coupler" site2="loop_rocker" solref="{2 * TIMESTEP!r} 1" solimp="0.99999 0.99999 1e-6"/>
  </equality>
  <actuator>
    <velocity name="drive" joint="crank" kv="{gain!r}"/>
  </actuator>
  <keyframe>
    <key name="start" ctrl="{way!r}"{moving}/>
  </keyframe>
</mujoco>
"""
