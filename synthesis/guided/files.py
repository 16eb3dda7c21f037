"""Linkages on two guides as files: CSV for tables, SVG to look at, DXF for CAD, MJCF for simulation.

Coordinates are the user's own; DXF and MJCF know units, so there `unit_mm` says how many millimetres the user's unit has.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes
from synthesis.errors import FieldError
from synthesis.fourbar.files import (
    DXF_COLOURS,
    FARTHEST,
    SOLVER,
    SPEED,
    STYLE,
    check_size,
    dxf_with_motion,
    model_text,
    motion_columns,
    places,
    requested_poses,
    requested_positions,
    unit_in_words,
    xy0,
)
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import BODY, Linkage, LinkMotion, Mass
from synthesis.sheet import Extra, More, Sheet, csv_text, dxf_document
from synthesis.target import Interval, Target

SECONDS = 2.0
"""In which the simulation's drive goes through the used part of a rail or slot."""
_BEYOND = 0.06
"""Part of a drawing's size by which rails and slots reach beyond their used ends."""
_SLIGHT = 1e-3
"""Of the heaviest link: what a slider or a block weighs in a simulation, which is no part of its own."""
_SLIDER = 0.05
"""Length of a slider or block in a drawing, as a part of its size."""
_OWN_STYLE = (
    "<style>.rail{stroke:#7b8794;stroke-width:3}.slot{stroke:#2563eb;stroke-width:3}"
    ".slider{fill:#fff;stroke:#1d2733;stroke-width:4}</style>"
)


class _Shown(NamedTuple):
    """A linkage as it is drawn, over the used interval."""

    links: tuple[LinkMotion, ...]
    """Over the interval."""
    body: LinkMotion
    """At the first sample."""
    pins: list[complex]
    """Of each guide: its body point, or its fixed pin in a slot, at the first sample."""
    points: list[Complexes]
    """The same over the interval."""
    rails: list[Complexes | None]
    """Of each guide: both ends of a rail, or of a slot at the first sample."""
    size: float


def _pin_of(linkage: Linkage, place: int, body: LinkMotion) -> Complexes:
    guide = linkage.guides[place]
    if isinstance(guide, Slot):
        return np.full(body.origin.shape, guide.pin)
    return body.place(guide.body_point)


def shown(linkage: Linkage, interval: Interval) -> _Shown:
    """What is drawn. FieldError for a linkage that does not close there, at the place that fails."""
    travel = linkage.travel_over(interval)
    links = linkage.motions(travel)
    body = links[1]
    size = linkage.reach
    for place, guide in enumerate(linkage.guides):
        if not abs(guide[0]) <= FARTHEST * size:
            raise FieldError(
                f"/solution/guides/{place}", f"lies more than {FARTHEST:.0e} of its lengths from the origin: move it"
            )
    closed = np.isfinite(body.angle)
    if not closed.all() or not linkage.closes_over(interval.after(linkage.start)):
        at = travel[int(np.argmin(closed))]
        where = f"{np.rad2deg(at):.6g} degrees" if linkage.driver.turns else f"{at:.6g}"
        raise FieldError("/solution/guides", f"both guides cannot hold the body {where} after the start")
    now = linkage.motions(np.zeros(1))[1]
    points = [_pin_of(linkage, place, body) for place in (0, 1)]
    rails: list[Complexes | None] = []
    spread = np.concatenate([*points, body.origin])
    size = max(float(np.ptp(spread.real)), float(np.ptp(spread.imag)))
    for place, guide in enumerate(linkage.guides):
        if isinstance(guide, Circle):
            rails.append(None)
            continue
        low, high = linkage.used(place, interval)
        ends = np.array([low - _BEYOND * size, high + _BEYOND * size])
        if isinstance(guide, Rail):
            rails.append(guide.point + ends * np.exp(1j * guide.direction))
        else:
            along = np.exp(1j * (now.angle[0] + guide.body_direction))
            rails.append(now.place(guide.body_point)[0] + ends * along)
    pins = [complex(_pin_of(linkage, place, now)[0]) for place in (0, 1)]
    return _Shown(links, now, pins, points, rails, size)


def _outline(linkage: Linkage, found: _Shown) -> Complexes:
    """The body at the first sample: its guided points, or the middle of a slot, and the body point."""
    corners = []
    for place, guide in enumerate(linkage.guides):
        ends = found.rails[place]
        if isinstance(guide, Slot) and ends is not None:
            corners.append(complex(ends.mean()))
        else:
            corners.append(found.pins[place])
    return np.array([*corners, complex(found.body.origin[0])])


def to_svg(linkage: Linkage, target: Target, extra: Extra | None = None, length_unit: str | None = None) -> str:
    """A drawing at the first sample, y up, with rails, slots, and the names of the joints."""
    found = shown(linkage, target.interval)
    body, path, marks = found.body, found.links[1].origin, requested_positions(target)
    seen = [*found.points, path, marks, *(one for one in found.rails if one is not None)]
    seen += [np.array([one.pivot]) for one in linkage.guides if isinstance(one, Circle)]
    seen += [] if extra is None else [extra.points]
    sheet = Sheet(np.concatenate(seen), 0.08, 1000, digits=7)

    def block(at: complex, direction: float) -> str:
        return sheet.line(_block(found, at, direction), "slider", closed=True)

    ground, links, dots, labels = [], [], [], []
    for place, guide in enumerate(linkage.guides):
        at, name = found.pins[place], "AB"[place]
        pin = "DC"[place]
        colour = "crank" if place == 0 and linkage.driver is Driver.CRANK else "rocker"
        if isinstance(guide, Circle):
            links.append(sheet.line(np.array([guide.pivot, at]), colour))
            dots += [sheet.dot(guide.pivot, 11, 'class="pivot"'), sheet.dot(at, 8, 'class="pin"')]
            labels += [sheet.label(guide.pivot, name), sheet.label(at, pin)]
            labels.append(sheet.label((guide.pivot + at) / 2, f"{guide.radius:.5g}", 'class="size"'))
            continue
        ends = found.rails[place]
        assert ends is not None
        if isinstance(guide, Rail):
            ground.append(sheet.line(ends, "rail"))
            links.append(block(at, guide.direction))
            dots.append(sheet.dot(at, 8, 'class="pin"'))
            labels.append(sheet.label(at, pin))
        else:
            links += [block(at, float(body.angle[0]) + guide.body_direction), sheet.line(ends, "slot")]
            dots.append(sheet.dot(at, 11, 'class="pivot"'))
            labels.append(sheet.label(at, name))
    curves = sheet.line(path, "path") + "".join(sheet.dot(mark, 5, 'class="pose"') for mark in marks)
    labels.append(sheet.label(body.origin[0], "P"))
    words = linkage.kind.replace("_", " ")
    dots.append(sheet.dot(body.origin[0], 7, 'class="point"'))
    return sheet.text(
        f"{words}, driven by a {linkage.driver}{unit_in_words(length_unit)}",
        [
            STYLE,
            _OWN_STYLE,
            f'<g id="GROUND">{"".join(ground)}</g>',
            f'<g id="PATH">{curves}</g>',
            f'<g id="BODY">{sheet.line(_outline(linkage, found), "body", closed=True)}</g>',
            f'<g id="LINKS">{"".join(links)}</g>',
            f"<g>{''.join(dots)}</g>",
            *([] if extra is None else [f'<g id="DRIVE">{extra.draw(sheet)}</g>']),
            f'<g id="NAMES">{"".join(labels)}</g>',
            sheet.unit_text(length_unit),
        ],
    )


def to_csv(linkage: Linkage, target: Target, unit: float, more: Mapping[str, Iterable[Any]] | None = None) -> str:
    """The motion at the samples: what was asked for, what the linkage does, and where its guided points are.

    Angles are divided by ``unit`` (radians in one unit of angle); an empty cell is a number that was not asked for. ``more`` are
    further columns, a value a sample.
    """
    shown(linkage, target.interval)
    links, found = linkage.motions(target.crank), linkage.body(linkage.start + target.crank)
    body = links[1]
    own = unit if linkage.driver.turns else 1.0
    columns: dict[str, Any] = {
        "crank_angle" if linkage.driver.turns else "travel": target.crank / own,
        **motion_columns(target, unit, body.angle, body.origin),
        "transmission_angle": found.transmission_angle / unit,
        "arm": found.arm,
    }
    for place, guide in enumerate(linkage.guides):
        link = links[0] if place == 0 else links[2]
        at = _pin_of(linkage, place, body)
        if not isinstance(guide, Rail):
            columns[f"{link.name}_direction"] = link.angle / unit
        if not isinstance(guide, Circle):
            columns[f"{link.name}_travel"] = linkage.along(place, target.crank)
        if not isinstance(guide, Slot):
            columns |= places(f"{link.name}_pin_{{}}", at, target.samples)
    return csv_text(columns | dict(more or {}))


def _block(found: _Shown, at: complex, direction: float) -> Complexes:
    """The corners of a slider or of a slot's block."""
    half = found.size * _SLIDER / 2
    corners = np.array([-2 - 1j, 2 - 1j, 2 + 1j, -2 + 1j]) * half / 1.5
    return np.asarray(at + corners * np.exp(1j * direction))


def _check_size(found: _Shown, unit_mm: float) -> None:
    largest = max(float(np.max(np.abs(one))) for one in (*found.points, found.links[1].origin))
    check_size(found.size, largest, unit_mm)


def to_dxf(linkage: Linkage, target: Target, unit_mm: float = 1.0, more: More | None = None) -> str:
    """The linkage for CAD, in millimetres, at the first sample.

    Layers: GROUND (pivots, fixed pins, rails), LINKS (cranks, sliders, blocks, pins), BODY (the body with its slots, and a cross
    with a direction at each requested pose), PATH (the body point's way over the used interval). See
    `More` for further parts.

    Law: a slider's middle lies on its rail and a slot's line through its pin to 1e-6 mm; the drawing passes ezdxf's audit.
    """
    found = shown(linkage, target.interval)
    _check_size(found, unit_mm)
    document = dxf_document(DXF_COLOURS, 4)
    space = document.modelspace()
    size = found.size * unit_mm

    def xy(z: complex) -> tuple[float, float]:
        return float(z.real * unit_mm), float(z.imag * unit_mm)

    def block(at: complex, direction: float) -> None:
        corners = [xy(z) for z in _block(found, at, direction)]
        space.add_lwpolyline(corners, close=True, dxfattribs={"layer": "LINKS"})

    body = found.body
    for place, guide in enumerate(linkage.guides):
        at = found.pins[place]
        if isinstance(guide, Circle):
            space.add_circle(xy(guide.pivot), 0.02 * size, dxfattribs={"layer": "GROUND"})
            space.add_line(xy(guide.pivot), xy(at), dxfattribs={"layer": "LINKS"})
            space.add_circle(xy(at), 0.012 * size, dxfattribs={"layer": "LINKS"})
            continue
        ends = found.rails[place]
        assert ends is not None
        if isinstance(guide, Rail):
            space.add_line(xy(ends[0]), xy(ends[1]), dxfattribs={"layer": "GROUND"})
            block(at, guide.direction)
            space.add_circle(xy(at), 0.012 * size, dxfattribs={"layer": "LINKS"})
        else:
            space.add_circle(xy(at), 0.02 * size, dxfattribs={"layer": "GROUND"})
            block(at, float(body.angle[0]) + guide.body_direction)
            space.add_line(xy(ends[0]), xy(ends[1]), dxfattribs={"layer": "BODY"})
    corners, way = _outline(linkage, found), found.links[1].origin
    poses = requested_poses(target, linkage.motions(target.crank)[1].angle)
    return dxf_with_motion(document, xy, size, unit_mm, corners, way, poses, more)


def to_mjcf(linkage: Linkage, target: Target, unit_mm: float = 1.0, masses: Mapping[str, Mass] | None = None) -> str:
    """The linkage as a MuJoCo model in metres: hinges and slides, and the loop closed by an equality constraint.

    ``masses``: of the body and of links on circles, in kilograms and the unit of the lengths; sliders and blocks then weigh next
    to nothing. Without them every link weighs a kilogram.

    Reference position is the first sample. Bodies are named as the links: the driven one carries the coupler, which is the body;
    the other guide's link is closed to it by a ``connect`` (in a slot by a ``weld``, between the coupler and what slides in the
    block). The actuator ``drive`` moves the driven joint at the speed of its control, radians or metres a second; the keyframe
    ``start`` sets it to go the used way. Sites: ``body_point``, and ``loop_coupler`` and ``loop_other``, whose distance is the
    loop's residual.
    """
    found = shown(linkage, target.interval)
    _check_size(found, unit_mm)
    metre = unit_mm / 1000
    size = found.size * metre
    thick = 0.02 * size
    heaviest = 1.0 if masses is None else max(one.mass for one in masses.values())
    # radians and metres of a joint by a radian or a metre of the drive, of a derivative in the user's unit
    turning = 1.0 if linkage.driver.turns else 1 / metre
    sliding = turning * metre
    links = linkage.motions(np.zeros(1))
    names = linkage.link_names
    body, rates = links[1], {link.name: link for link in links}
    at = [one * metre for one in found.pins]
    gamma = float(body.angle[0])
    origin = at[0]  # of the coupler's frame: the pin about which it turns, or along whose slot it slides

    def local(z: complex) -> complex:
        """A place in the plane, in metres, in the coupler's frame."""
        return complex((z - origin) * np.exp(-1j * gamma))

    def rod(name: str, begin: complex, end: complex, colour: str) -> str:
        if abs(end - begin) < 1e-6 * size:
            return ""
        return (
            f'<geom name="{name}" type="capsule" fromto="{xy0(begin)} {xy0(end)}" size="{thick / 2!r}" '
            f'rgba="{colour}"/>'
        )

    def box(name: str, turn: float) -> str:
        half = _SLIDER * size / 2
        return (
            f'<geom name="{name}_box" type="box" size="{2 * half!r} {half!r} {thick!r}" euler="0 0 {turn!r}" '
            'rgba="0.6 0.65 0.7 1"/>'
        )

    def inertial(name: str, centre: complex, length: float) -> str:
        mass = 1.0 if masses is None else _SLIGHT * heaviest
        inertia = mass * max(length, thick) ** 2 / 12
        if masses is not None and name in masses:
            one = masses[name]
            mass, inertia, centre = one.mass, one.inertia * metre**2, one.at * metre
            if name == BODY:  # whose frame here begins at the pin
                centre = local((complex(body.origin[0]) + np.exp(1j * gamma) * one.at) * metre)
        return f'<inertial pos="{xy0(centre)}" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'

    def guide_body(place: int, inner: str) -> tuple[str, list[float]]:
        """The link of a guide, with what it carries, and the speeds of its joints at a unit speed of the drive."""
        guide, name = linkage.guides[place], names[0] if place == 0 else names[2]
        link = rates[name]
        if isinstance(guide, Circle):
            pivot, direction = guide.pivot * metre, float(link.angle[0])
            long = guide.radius * metre
            colour = "0.76 0.25 0.05 1" if place == 0 else "0.11 0.15 0.2 1"
            text = (
                f'<body name="{name}" pos="{xy0(pivot)}" euler="0 0 {direction!r}">\n      <joint name="{name}"/>\n      '
                f"{inertial(name, complex(long / 2), long)}{rod(f'{name}_rod', 0j, complex(long), colour)}\n      {inner}\n"
                "    </body>"
            )
            return text, [float(link.rate[0]) * turning]
        if isinstance(guide, Rail):
            axis = xy0(complex(np.exp(1j * guide.direction)))
            text = (
                f'<body name="{name}" pos="{xy0(at[place])}">\n      <joint name="{name}" type="slide" axis="{axis}"/>\n      '
                f"{inertial(name, 0j, _SLIDER * size)}{box(name, guide.direction)}\n      {inner}\n    </body>"
            )
            along = np.real(np.exp(-1j * guide.direction) * link.velocity[0]) * sliding
            return text, [float(along)]
        direction = float(link.angle[0])
        text = (
            f'<body name="{name}" pos="{xy0(at[place])}" euler="0 0 {direction!r}">\n      <joint name="{name}"/>\n      '
            f"{inertial(name, 0j, _SLIDER * size)}{box(name, 0.0)}\n      {inner}\n    </body>"
        )
        return text, [float(link.rate[0]) * turning]

    def slot_rate(place: int) -> float:
        """Metres by the drive's coordinate in radians or metres."""
        return float(linkage.along_rate(place, np.zeros(1))[0]) * sliding

    # the coupler, carried by the driven link
    driven, other = linkage.guides
    point = complex(body.origin[0]) * metre
    parts = [rod("coupler_rod", local(origin), local(at[1]), "0.15 0.39 0.92 1")]
    parts.append(rod("body", local(origin), local(point), "0.15 0.39 0.92 0.6"))
    for place, ends in enumerate(found.rails):
        if ends is not None and isinstance(linkage.guides[place], Slot):
            low, high = (local(complex(end) * metre) for end in ends)
            parts.append(rod(f"slot_{place + 1}", low, high, "0.15 0.39 0.92 1"))
    parts.append(f'<site name="body_point" pos="{xy0(local(point))}" size="{thick!r}" rgba="0.06 0.46 0.43 1"/>')
    parts.append(f'<site name="loop_coupler" pos="{xy0(local(at[1]))}" size="{thick / 2!r}"/>')
    parts.append(inertial(BODY, (local(at[1]) + local(point)) / 2, size / 2))
    inner_pieces = "\n        ".join(part for part in parts if part)
    carrier = links[0]
    turned = float(carrier.angle[0]) if not isinstance(driven, Rail) else 0.0
    if isinstance(driven, Slot):
        # it slides in its block, against the slot's direction
        axis = xy0(complex(-np.exp(1j * driven.body_direction)))
        joint, speed = f'<joint name="coupler" type="slide" axis="{axis}"/>', slot_rate(0)
        where = 0j
    else:
        joint = '<joint name="coupler"/>'
        speed = (float(body.rate[0]) - (float(carrier.rate[0]) if isinstance(driven, Circle) else 0)) * turning
        where = complex(driven.radius * metre) if isinstance(driven, Circle) else 0j
    coupler = (
        f'<body name="{BODY}" pos="{xy0(where)}" euler="0 0 {gamma - turned!r}">\n        '
        f"{joint}\n        {inner_pieces}\n      </body>"
    )
    first, speeds = guide_body(0, coupler)
    speeds.append(speed)
    end = f'<site name="loop_other" pos="{{}}" size="{thick / 2!r}"/>'
    if isinstance(other, Slot):
        slide = (
            '<body name="slide">\n        <joint name="slide" type="slide" axis="-1 0 0"/>\n        '
            f"{inertial('slide', 0j, _SLIDER * size)}\n        {end.format(xy0(0j))}\n      </body>"
        )
        second, more = guide_body(1, slide)
        more.append(slot_rate(1))
        loop = f'<weld name="loop" body1="slide" body2="{BODY}" {SOLVER}/>'
    else:
        inside = complex(other.radius * metre) if isinstance(other, Circle) else 0j
        second, more = guide_body(1, end.format(xy0(inside)))
        loop = f'<connect name="loop" site1="loop_coupler" site2="loop_other" {SOLVER}/>'
    speeds += more
    forward = target.crank[-1] >= 0
    drive_joint = names[0] if linkage.driver is not Driver.CYLINDER else BODY
    span = float(abs(target.interval.last - target.interval.first)) * (1.0 if linkage.driver.turns else metre)
    pace = SPEED if linkage.driver.turns else span / SECONDS
    gain = heaviest * 15 * (size**2 if linkage.driver.turns else 1.0)
    way = pace if forward else -pace
    moving = ""
    if np.all(np.isfinite(speeds)):
        moving = f' qvel="{" ".join(repr(float(way * value)) for value in speeds)}"'
    unit = "radians" if linkage.driver.turns else "metres"
    return model_text(
        f"{linkage.kind.replace('_', ' ')}, {linkage.driver}",
        f"""the used interval takes {span / pace:.6g} s at {pace:.6g} {unit} a second;
       masses are {"a kilogram a link" if masses is None else "kilograms of its parts"}""",
        'mass="0"',
        size,
        "\n    ".join((_rails(found, linkage, metre, thick), first, second)),
        loop,
        drive_joint,
        gain,
        f'ctrl="{way!r}"{moving}',
    )


def _rails(found: _Shown, linkage: Linkage, metre: float, thick: float) -> str:
    rails = [
        f'<geom name="rail_{place + 1}" type="capsule" fromto="{xy0(complex(ends[0]) * metre)} '
        f'{xy0(complex(ends[1]) * metre)}" size="{thick / 4!r}" rgba="0.5 0.5 0.5 1"/>'
        for place, ends in enumerate(found.rails)
        if ends is not None and isinstance(linkage.guides[place], Rail)
    ]
    return "\n    ".join(rails)
