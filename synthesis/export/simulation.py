"""Simulation model of a linkage: MJCF for MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from synthesis.arrays import dot
from synthesis.export.layout import SLIDER_LENGTH, Layout, layout_of, name_of
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.link_motion import Mass
from synthesis.linkage import BODY, Linkage
from synthesis.target import Target

SPEED = 1.0
"""Speed of a drive that turns, in radians a second."""
SECONDS = 2.0
"""Time in which a drive that slides covers its used stroke."""
TIMESTEP = 1e-4
"""Step of the simulation in seconds."""
SOLVER = f'solref="{2 * TIMESTEP!r} 1" solimp="0.99999 0.99999 1e-6"'
"""Stiffness with which the loop is closed."""
_SLIGHT = 1e-3
"""Mass of a slider or block that is no part of its own, as a fraction of the heaviest link."""
_COLOURS = {"crank": "0.76 0.25 0.05 1", BODY: "0.15 0.39 0.92 1", "rocker": "0.11 0.15 0.2 1"}
_GREY = "0.5 0.5 0.5 1"


def xy0(point: complex) -> str:
    """Return a point of the plane as a position in a MuJoCo model."""
    return f"{float(point.real)!r} {float(point.imag)!r} 0"


def to_mjcf(linkage: Linkage, target: Target, unit_mm: float = 1.0, masses: Mapping[str, Mass] | None = None) -> str:
    """Write a MuJoCo model in metres: hinges and slides, and the loop closed by an equality constraint.

    The reference position is the first sample. Bodies are named like the links: the driven link carries the coupler, which is the
    body. The link of the other guide is closed to it by a ``connect`` (of a slot by a ``weld``, between the coupler and the part
    that slides in the block). The actuator ``drive`` moves the driven joint at the speed of its control, in radians or metres a
    second; the keyframe ``start`` sets it to move the requested way. The plane is x-y, without gravity. Sites: ``body_point``,
    and ``loop_coupler`` and ``loop_`` with the name of the other link, whose distance is the residual of the loop.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    target : Target
        The motion, with the travel of the drive at the samples.
    unit_mm : float, optional
        Millimetres in the unit of lengths.
    masses : mapping, optional
        Mass of each link that is a part, in kilograms and the unit of lengths; sliders and blocks weigh next to nothing.
        Without masses bars are slender rods.

    Raises
    ------
    FieldError
        For a linkage that does not close over the used interval, or whose coordinates the file cannot hold.
    """
    layout = layout_of(linkage, target.interval)
    layout.check_size(unit_mm)
    return _Model(layout, unit_mm / 1000, masses).text(target)


class _Model:
    """A MuJoCo model of a linkage, in metres."""

    def __init__(self, layout: Layout, metre: float, masses: Mapping[str, Mass] | None) -> None:
        self.layout, self.linkage, self.metre, self.masses = layout, layout.linkage, metre, masses
        self.size = layout.size * metre
        self.thick = 0.02 * self.size
        self.heaviest = 1.0 if masses is None else max(mass.mass for mass in masses.values())
        self.total = 1.0 if masses is None else sum(mass.mass for mass in masses.values())
        self.pins = [pin * metre for pin in layout.pins]
        # the coupler's frame begins at the pin about which it turns or along whose slot it slides
        first, second = self.linkage.guides
        slides = not (first.holds_point and second.holds_point)
        self.direction = float(layout.body.angle[0])
        self.direction += 0.0 if slides else float(np.angle(second.body_point - first.body_point))

    def local(self, point: complex) -> complex:
        """Return a point of the plane, in metres, in the coupler's frame."""
        return complex((point - self.pins[0]) * np.exp(-1j * self.direction))

    def rod(self, name: str, start: complex, end: complex, radius: float, colour: str | None) -> str:
        """Return a capsule between two points of a body; nothing between equal points."""
        if abs(end - start) < 1e-6 * self.size:
            return ""
        paint = "" if colour is None else f' rgba="{colour}"'
        return f'<geom name="{name}" type="capsule" fromto="{xy0(start)} {xy0(end)}" size="{radius!r}"{paint}/>'

    def inertial(self, name: str, length: float | None = None, centre: complex | None = None) -> str:
        """Return the mass of a link: of its part, of a slender rod of a length, or next to nothing."""
        if self.masses is not None and name in self.masses:
            part = self.masses[name]
            mass, inertia, at = part.mass, part.inertia * self.metre**2, part.at * self.metre
            if name == BODY:
                at = self.local(complex(self.layout.body.position(self.linkage.on_body(part.at))[0]) * self.metre)
        elif self.masses is None and length is not None:
            mass, at = length / self.size, complex(length / 2) if centre is None else centre
            inertia = mass * max(length, self.thick) ** 2 / 12
        else:
            mass, at = _SLIGHT * self.heaviest, centre or 0j
            inertia = mass * (SLIDER_LENGTH * self.size) ** 2 / 12
        return f'<inertial pos="{xy0(at)}" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'

    def site(self, name: str, point: complex) -> str:
        """Return a marked point of a body."""
        return f'<site name="{name}" pos="{xy0(point)}" size="{self.thick / 2!r}"/>'

    def coupler(self) -> str:
        """Return the body, carried by the driven link."""
        first, second = self.linkage.guides
        driven, body = self.layout.first[:2]
        end, point = self.local(self.pins[1]), self.local(complex(body.origin[0]) * self.metre)
        parts = [self.rod("coupler_rod", 0j, end, self.thick / 2, _COLOURS[BODY]), self.site("loop_coupler", end)]
        if self.linkage.mounted:
            mark = f'size="{self.thick!r}" rgba="0.06 0.46 0.43 1"'
            parts += [f'<site name="body_point" pos="{xy0(point)}" {mark}/>']
            parts += [self.rod("body", 0j, point, self.thick / 3, None)]
        for index, guide in enumerate((first, second)):
            if not guide.holds_point and (track := self.layout.track(index)) is not None:
                low, high = (self.local(complex(end) * self.metre) for end in track)
                parts.append(self.rod(f"slot_{index + 1}", low, high, self.thick / 2, _COLOURS[BODY]))
        if not (first.holds_point and second.holds_point):
            mass = self.inertial(BODY, self.size / 2, (end + point) / 2)
        else:
            mass = self.inertial(BODY, abs(end))
        # a slot slides in its block, against the slot's direction
        joint = _joint(BODY, xy0(-np.exp(1j * first.body_direction)) if isinstance(first, Slot) else None)
        start = driven.point_at(self.layout.pins[0]) * self.metre
        content = [joint, mass + parts[0], *filter(None, parts[1:])]
        return _body(BODY, start, self.direction - float(driven.angle[0]), content, 6)

    def guide(self, index: int, carried: str) -> str:
        """Return the link of a guide with the part that it carries."""
        guide, link = self.linkage.guides[index], self.layout.first[2 * index]
        if isinstance(guide, Circle):
            length, colour = guide.radius * self.metre, _COLOURS["crank" if index == 0 else "rocker"]
            shape = self.inertial(link.name, length)
            shape += self.rod(f"{link.name}_rod", 0j, length + 0j, self.thick / 2, colour)
        else:
            half = SLIDER_LENGTH * self.size / 2
            box = f'type="box" size="{2 * half!r} {half!r} {self.thick!r}" rgba="0.6 0.65 0.7 1"'
            shape = f'{self.inertial(link.name)}<geom name="{link.name}_box" {box}/>'
        joint = _joint(link.name, "1 0 0" if isinstance(guide, Rail) else None)
        content = [joint, shape, carried]
        return _body(link.name, complex(link.origin[0]) * self.metre, float(link.angle[0]), content, 4)

    def other(self) -> tuple[str, str]:
        """Return the link of the second guide, and the constraint that closes the loop."""
        guide, name = self.linkage.guides[1], f"loop_{self.layout.first[2].name}"
        if isinstance(guide, Slot):
            slide = _body(
                "slide", 0j, 0.0, [_joint("slide", "-1 0 0"), self.inertial("slide"), self.site(name, 0j)], 6
            )
            return self.guide(1, slide), f'<weld name="loop" body1="slide" body2="{BODY}" {SOLVER}/>'
        end = complex(guide.radius * self.metre) if isinstance(guide, Circle) else 0j
        connect = f'<connect name="loop" site1="loop_coupler" site2="{name}" {SOLVER}/>'
        return self.guide(1, self.site(name, end)), connect

    def speeds(self) -> list[float]:
        """Return the speeds of the joints in their order, in radians or metres for a radian or a metre of the drive."""
        driven, body, second = self.layout.first
        turning = 1.0 if self.linkage.driver.turns else 1 / self.metre
        sliding = turning * self.metre
        speeds = []
        for index, link in enumerate((driven, second)):
            guide = self.linkage.guides[index]
            along = dot(link.direction, link.velocity) * sliding
            speeds.append(along if isinstance(guide, Rail) else link.rate * turning)
            if isinstance(guide, Slot):
                speeds.append(self.linkage.along_rate(index, np.zeros(1)) * sliding)
            elif index == 0:
                speeds.append((body.rate - driven.rate) * turning)
        return [float(speed[0]) for speed in speeds]

    def text(self, target: Target) -> str:
        """Return the model."""
        linkage, turns = self.linkage, self.linkage.driver.turns
        tracks = [self.layout.track(index) for index in (0, 1)]
        rails = {
            f"rail_{index + 1}": track
            for index, track in enumerate(tracks)
            if track is not None and not linkage.guides[index].has_pin
        }
        if self.layout.ground is not None:
            rails["ground"] = np.array(self.layout.ground[1:])
        world = [
            self.rod(name, complex(start) * self.metre, complex(end) * self.metre, self.thick / 4, _GREY)
            for name, (start, end) in rails.items()
        ]
        second, loop = self.other()
        span = abs(float(target.interval.last) - float(target.interval.first)) * (1.0 if turns else self.metre)
        pace = SPEED if turns else span / SECONDS
        signed = -pace if target.clockwise else pace
        speeds = [signed * value for value in self.speeds()]
        moving = f' qvel="{" ".join(map(repr, speeds))}"' if np.all(np.isfinite(speeds)) else ""
        # the drive gains its speed within tenths of a second: a harder start would pull the loop's constraint apart
        gain = self.total * (self.size**2 if turns else 1.0) / 0.2
        masses = "those of slender rods" if self.masses is None else "kilograms of its parts"
        return f"""<mujoco model="{name_of(linkage)}">
  <!-- lengths in metres, angles in radians; {span / pace:.6g} s at the keyframe's speed are the used interval;
       masses are {masses} -->
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{TIMESTEP!r}" gravity="0 0 0" integrator="implicitfast" iterations="200" tolerance="1e-16"/>
  <default>
    <geom contype="0" conaffinity="0" rgba="0.15 0.39 0.92 1"/>
    <joint type="hinge" axis="0 0 1"/>
  </default>
  <worldbody>
    <light pos="0 0 {4 * self.size!r}" dir="0 0 -1"/>
    {"".join(geom + chr(10) + "    " for geom in world if geom)}{self.guide(0, self.coupler())}
    {second}
  </worldbody>
  <equality>
    {loop}
  </equality>
  <actuator>
    <velocity name="drive" joint="{linkage.link_names[0] if linkage.driver is not Driver.CYLINDER else BODY}" kv="{gain!r}"/>
  </actuator>
  <keyframe>
    <key name="start" ctrl="{signed!r}"{moving}/>
  </keyframe>
</mujoco>
"""


def _joint(name: str, axis: str | None) -> str:
    """Return a joint: a slide along an axis of its body, or a hinge."""
    slide = "" if axis is None else f' type="slide" axis="{axis}"'
    return f'<joint name="{name}"{slide}/>'


def _body(name: str, start: complex, angle: float, content: list[str], indent: int) -> str:
    """Return a body of a model at a position and an angle in the body that carries it."""
    margin = "\n" + " " * (indent + 2)
    head = f'<body name="{name}" pos="{xy0(start)}" euler="0 0 {angle!r}">'
    return margin.join([head, *content]) + "\n" + " " * indent + "</body>"
