"""``python -m docs.figures``: draws notation.svg, limits.svg, kinds.svg and motion.svg in docs/img by the project's own code.

Both hold their own paper, light or dark as the reader's system asks, so that they are legible on any background.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import linkage_atlas as la
from synthesis.guides import Circle, Guide, Rail, Slot
from synthesis.linkage import Linkage, four_bar
from synthesis.sheet import Sheet

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "img"

STYLE = """<style>
svg{--paper:#fff;--ink:#1d2733;--soft:#7b8794;--line:#cbd2d9;--crank:#c2410c;--body:#2563eb;--path:#0f766e;--wanted:#b91c1c}
@media (prefers-color-scheme:dark){svg{--paper:#12181f;--ink:#e4e7eb;--soft:#9aa5b1;--line:#3e4c59;--crank:#fb923c;
--body:#60a5fa;--path:#2dd4bf;--wanted:#f87171}}
.paper{fill:var(--paper)}
path{fill:none;stroke:var(--ink);stroke-width:3;stroke-linejoin:round;stroke-linecap:round}
.crank{stroke:var(--crank);stroke-width:9}.rocker{stroke-width:9}.coupler{stroke:var(--body);stroke-width:9}
.ground{stroke:var(--soft);stroke-width:4}.hatch{stroke:var(--soft);stroke-width:2}
.body{stroke:var(--body);stroke-width:3;fill:var(--body);fill-opacity:.14}
.thin{stroke:var(--soft);stroke-width:1.6}.dash{stroke:var(--soft);stroke-width:2;stroke-dasharray:9 8}
.box{stroke:var(--path);stroke-width:2;stroke-dasharray:9 8}
.out{stroke:var(--wanted);stroke-width:2;fill:var(--wanted);fill-opacity:.08}
.arc{stroke:var(--ink);stroke-width:1.8}.head{fill:var(--ink);stroke:none}
.turn{stroke:var(--path);stroke-width:2;stroke-opacity:.45}.path{stroke:var(--path);stroke-width:4}
.mark{stroke:var(--path);stroke-width:5}.wanted{stroke:var(--wanted);stroke-width:2.2}
circle{fill:var(--paper);stroke:var(--ink);stroke-width:3}.pivot{fill:var(--ink)}.point{fill:var(--path);stroke:none}
.pose{fill:var(--wanted);stroke:none}.ghost{stroke:var(--soft);stroke-width:2}
text{font:italic 27px Georgia,'DejaVu Serif',serif;fill:var(--ink)}
.word{font:20px system-ui,'DejaVu Sans',sans-serif;fill:var(--soft)}.big{font:600 23px system-ui,'DejaVu Sans',sans-serif}
.t-crank{fill:var(--crank)}.t-body{fill:var(--body)}.t-path{fill:var(--path)}.t-wanted{fill:var(--wanted)}
</style>"""


class Figure:
    """A sheet that is drawn on in the plane's own coordinates; offsets and radii of labels are in the page's unit."""

    def __init__(self, corners: list[complex], size: float) -> None:
        self.sheet = Sheet(np.array(corners), 0.0, size, digits=5)
        self.parts = [
            STYLE,
            f'<rect class="paper" width="{self.sheet.width:.5g}" height="{self.sheet.height:.5g}" rx="14"/>',
        ]

    def line(self, points: Any, name: str, closed: bool = False) -> None:
        self.parts.append(
            f'<path class="{name}" d="M{" L".join(map(self.sheet.at, np.atleast_1d(points)))}{"Z" if closed else ""}"/>'
        )

    def dot(self, z: complex, radius: float, name: str) -> None:
        self.parts.append(self.sheet.dot(z, radius, f'class="{name}"'))

    def text(
        self, words: str, z: complex, offset: tuple[float, float] = (0, 0), name: str = "", at: str = "middle"
    ) -> None:
        x, y = (float(coordinate) for coordinate in self.sheet.at(z).split(","))
        self.parts.append(
            f'<text class="{name}" x="{x + offset[0]:.5g}" y="{y - offset[1]:.5g}" text-anchor="{at}">{words}</text>'
        )

    def arc(
        self, centre: complex, radius: float, first: float, last: float, words: str, out: float = 24, name: str = ""
    ) -> None:
        """Draw an angle from a direction to another, with an arrowhead at its end and its name outside of its middle."""
        reach = radius / self.sheet.scale
        shown = np.linspace(first, last, 40)
        self.line(centre + reach * np.exp(1j * shown), "arc")
        side = np.sign(last - first)
        back = last - side * 11 / radius
        self.line(
            [centre + reach * np.exp(1j * last)]
            + [centre + (reach + k * 4.5 / self.sheet.scale) * np.exp(1j * back) for k in (1, -1)],
            "head",
            closed=True,
        )
        middle = (first + last) / 2
        self.text(words, centre + (radius + out) / self.sheet.scale * np.exp(1j * middle), (0, -9), name)

    def pivot(self, z: complex, below: float) -> None:
        """A fixed pivot on its hatched ground; ``below`` is the direction of the ground."""
        unit = 1 / self.sheet.scale
        down, along = np.exp(1j * below) * unit, np.exp(1j * (below + np.pi / 2)) * unit
        foot = [z + 30 * down - 21 * along, z + 30 * down + 21 * along]
        self.line([z, foot[0], foot[1]], "ground", closed=True)
        for k in range(-2, 3):
            self.line([z + 30 * down + 10 * k * along, z + 40 * down + (10 * k - 8) * along], "hatch")
        self.dot(z, 9, "pivot")

    def save(self, name: str, title: str) -> None:
        (IMAGES / name).write_text(self.sheet.text(title, self.parts))


def sub(letter: str, index: str) -> str:
    """A letter with an index."""
    return f'{letter}<tspan font-size="70%" dy="6">{index}</tspan>'


def joints(linkage: Linkage, travel: Any) -> list[Any]:
    """Return positions (n,) of crank pin, coupler pin and body point at travel of the drive."""
    body = linkage.motions(travel)[1]
    return [*(body.position(guide.body_point) for guide in linkage.guides), body.origin]


def notation() -> None:
    """Draw the symbols of the documents on a four-bar: both branches, all angles, the body and its point."""
    turn, start, radius, angle = np.deg2rad(10), np.deg2rad(52), 6.3, np.deg2rad(38)
    marked = np.deg2rad(62)
    linkage = four_bar((4.6, 9.2, 8.0, 12.2), 1, start, 0j, turn, (radius, angle), marked - np.deg2rad(30))
    other_branch = four_bar(linkage.links, -1, start, 0j, turn)
    a, b = linkage.pivot_a, linkage.pivot_b
    (d, c, p), (_, mirrored, _) = (np.array(joints(view, 0.0))[:, 0].tolist() for view in (linkage, other_branch))
    _, body, rocker = linkage.motions(0.0)
    theta3, gamma = float(rocker.angle[0]), float(body.angle[0])
    theta2 = gamma - (linkage.body_offset or 0.0)
    origin = a - 3.6 - 2.4j
    figure = Figure([-4.9 - 6.5j, 19.6 + 15.2j], 1100)
    ray = np.exp(1j * turn)

    # axes, and where pivot A lies
    for axis, word, offset in ((3.0, "x", (16, -8)), (2.6j, "y", (0, 10))):
        figure.line([origin, origin + axis], "thin")
        figure.text(word, origin + axis, offset)
    figure.line([origin, a], "dash")
    figure.text(sub("L", "B") + '<tspan dy="-6">, β</tspan>', (origin + a) / 2, (-40, 8))
    # the other branch
    figure.line([d, mirrored, b], "dash")
    figure.line([d, b], "thin")
    figure.dot(mirrored, 7, "ghost")
    figure.text("branch −1: C to the right of D → B", mirrored, (14, -30), "word")
    figure.text("branch +1: C to the left of D → B", c, (22, 16), "word", "start")
    # directions that angles are measured from
    figure.line([a, a + 7.4], "thin")
    figure.line([d, d + 4.6 * ray], "thin")
    figure.line([b, b + 4.4 * ray], "thin")
    figure.line([p, p + 4.2], "thin")
    # the linkage
    figure.line([a, b], "ground")
    figure.line([d, c, p], "body", closed=True)
    figure.line([d, c], "coupler")
    figure.line([a, d], "crank")
    figure.line([b, c], "rocker")
    figure.line([p, p + 3.4 * np.exp(1j * gamma)], "mark")
    # angles
    figure.arc(a, 245, 0.0, turn, sub("θ", "4"), 26)
    figure.arc(a, 80, turn, turn + start, sub("θ", "1"), 22)
    figure.arc(d, 125, turn, theta2, sub("θ", "2"), 24)
    figure.arc(d, 84, theta2, theta2 + angle, sub("θ", "P"), 26, "t-body")
    figure.arc(b, 70, turn, theta3, sub("θ", "3"), 24)
    figure.arc(p, 100, 0.0, gamma, "γ", 24, "t-path")
    # joints and names
    figure.pivot(a, -np.pi / 2)
    figure.pivot(b, -np.pi / 2)
    figure.dot(d, 8, "pin")
    figure.dot(c, 8, "pin")
    figure.dot(p, 8, "point")
    for word, z, offset in (
        ("A", a, (-26, 8)),
        ("B", b, (30, -22)),
        ("C", c, (4, 22)),
        ("D", d, (-26, 4)),
        ("P", p, (-24, 6)),
    ):
        figure.text(word, z, offset)
    for word, z, offset, name in (
        (sub("L", "1"), (a + d) / 2, (-26, 6), "t-crank"),
        (sub("L", "2"), (d + c) / 2, (52, -2), "t-body"),
        (sub("L", "3"), (b + c) / 2, (34, 0), ""),
        (sub("L", "4"), (a + b) / 2, (110, -24), ""),
        (sub("L", "P"), (d + p) / 2, (-26, 6), "t-body"),
    ):
        figure.text(word, z, offset, name)
    low = -4.5 - 6.0j
    figure.text(
        "crank AD, coupler DC with the guided body CDP, rocker BC, ground AB; γ: the body's rotation",
        low,
        (0, 0),
        "word",
        "start",
    )
    figure.save("notation.svg", "Notation of the four-bar linkage")


def box(low: complex, high: complex) -> list[complex]:
    """Corners of a box."""
    return [low, complex(high.real, low.imag), high, complex(low.real, high.imag)]


def limits() -> None:
    """Draw the meaning of each limit of a request on a four-bar over its used interval."""
    linkage = four_bar((4.6, 9.2, 8.0, 12.2), 1, np.deg2rad(30), 0j, 0.0, (6.3, np.deg2rad(38)), 0.0)
    crank = np.linspace(0, np.deg2rad(110), 90)
    a, b = linkage.pivot_a, linkage.pivot_b
    paths = joints(linkage, crank)
    d, c, p = np.array(joints(linkage, np.deg2rad(35)))[:, 0].tolist()
    figure = Figure([-8.6 - 7.2j, 19.5 + 12.2j], 1100)
    points = np.concatenate([*paths, [a, b]])
    room = box(
        complex(points.real.min() - 0.7, points.imag.min() - 0.7),
        complex(points.real.max() + 0.7, points.imag.max() + 0.7),
    )
    figure.line(room, "dash", closed=True)
    figure.text("envelope", room[3], (6, 10), "word", "start")
    for pivot, name, low, high in (
        (a, "pivot_a_box", -2.2 - 1.6j, 1.8 + 1.1j),
        (b, "pivot_b_box", -1.6 - 1.6j, 3.0 + 1.5j),
    ):
        figure.line(box(pivot + low, pivot + high), "box", closed=True)
        figure.text(name, pivot + low, (4, -24), "word t-path", "start")
    out = 3.2 - 5.4j
    figure.line(box(out, out + 5.0 + 2.6j), "out", closed=True)
    figure.text("keep_out: no fixed pivot here", out, (4, -24), "word t-wanted", "start")
    figure.line(d + abs(p - d) * 1.12 * np.exp(1j * np.linspace(0, 2 * np.pi, 120)), "dash")
    figure.text("coupler_radius_max", d - abs(p - d) * 1.12j, (-8, -24), "word", "end")
    for path, style in zip((paths[2], *paths[:2]), ("path", "turn", "turn")):
        figure.line(path, style)
    figure.line([a, b], "ground")
    figure.line([d, c, p], "body", closed=True)
    figure.line([d, c], "coupler")
    figure.line([a, d], "crank")
    figure.line([b, c], "rocker")
    toward_d, toward_b = float(np.angle(d - c)), float(np.angle(b - c))
    figure.arc(c, 62, toward_d + 2 * np.pi, toward_b + 2 * np.pi, "", 24)
    figure.text("transmission_angle_min", c, (100, -4), "word", "start")
    for point in (a, b):
        figure.pivot(point, -np.pi / 2)
    for point in (d, c):
        figure.dot(point, 8, "pin")
    figure.dot(p, 8, "point")
    figure.text("body point", p, (16, 10), "word", "start")
    for word, z, offset, name in (
        ("crank", (a + d) / 2, (-14, 6), "word t-crank"),
        ("coupler", (d + c) / 2, (0, -30), "word t-body"),
        ("rocker", (b + c) / 2, (-18, -20), "word"),
        ("ground", (a + b) / 2, (0, 12), "word"),
    ):
        figure.text(word, z, offset, name, {"crank": "end", "rocker": "end"}.get(word, "middle"))
    figure.text(
        "link_min, link_max, link_ratio_max, links: crank, coupler, rocker and ground; all over the used interval",
        -8.2 - 6.9j,
        (0, 0),
        "word",
        "start",
    )
    figure.save("limits.svg", "What each limit concerns")


_CIRCLE = {"guide": "circle", "pivot": [0, 0], "radius": 1.5, "body_point": [-1.2, -1.0]}
_ROCKER = {"guide": "circle", "pivot": [4.6, -0.2], "radius": 2.3, "body_point": [1.9, -0.9]}
_RAIL = {"guide": "rail", "point": [2.6, -0.9], "direction": 14, "body_point": [1.9, -1.1]}
_LEFT = {"guide": "rail", "point": [-0.6, -0.7], "direction": 70, "body_point": [-1.4, -0.9]}
_SLOT = {"guide": "slot", "pin": [4.4, -0.6], "body_point": [0.7, -1.2], "body_direction": -6}
_OWN = {"guide": "slot", "pin": [-0.4, -0.4], "body_point": [-1.0, -1.2], "body_direction": 205}
KINDS = {
    "four_bar": (_CIRCLE, _ROCKER, "crank"),
    "slider_crank": (_CIRCLE, _RAIL, "crank"),
    "swinging_block": (_CIRCLE, _SLOT, "crank"),
    "rail_slot": (_LEFT, _SLOT, "slider"),
    "two_rails": (_LEFT, _RAIL, "slider"),
    "two_slots": (_OWN, _SLOT, "hinge"),
}
"""Guides of each kind, the driven guide first, and its driver, as in a reply."""


def kinds() -> None:
    """A linkage of each kind with the names of its guides' dimensions."""
    wide, high = 7.6, 6.0
    figure = Figure([complex(-2.9, -high - 2.2), complex(2 * wide + 5.9, 3.6)], 1500)
    starts = {
        "four_bar": 62,
        "slider_crank": 62,
        "swinging_block": 62,
        "rail_slot": 1.3,
        "two_rails": 1.4,
        "two_slots": 196,
    }
    for number, (kind, (first, second, driver)) in enumerate(KINDS.items()):
        shift = complex(wide * (number % 3), -high * (number // 3))
        linkage = next(
            candidate
            for branch in (1, -1)
            if np.isfinite(
                (candidate := la.Linkage([first, second], driver, branch, starts[kind])).joints(0).rotation[0]
            )
        )
        joints, guides = linkage.joints(0), linkage.plain.guides
        position, turn = complex(joints.body_point[0] @ [1, 1j]), float(np.deg2rad(joints.rotation[0]))
        held = [complex(pin[0] @ [1, 1j]) for pin in (joints.crank_pin, joints.coupler_pin)]
        corners = []
        for guide, at in zip(guides, held):
            corners.append(at if not isinstance(guide, Slot) else position + np.exp(1j * turn) * guide.body_point)
        figure.line([z + shift for z in (*corners, position)], "body", closed=True)
        for k, (guide, at) in enumerate(zip(guides, held)):
            _draw_guide(figure, guide, at, position, turn, shift, k == 0)
        figure.dot(position + shift, 8, "point")
        figure.line([position + shift, position + shift + 0.8 * np.exp(1j * turn)], "mark")
        figure.text("P", position + shift, (0, 16), "t-path")
        figure.text(kind, shift + complex(-2.4, 3.0), (0, 0), "big", "start")
        figure.text(f"driven by a {driver}", shift + complex(-2.4, 3.0), (0, -26), "word", "start")
    figure.save("kinds.svg", "The kinds of linkages of a body on two guides")


def _draw_guide(
    figure: Figure, guide: Guide, at: complex, position: complex, turn: float, shift: complex, driven: bool
) -> None:
    """A guide with the names of its dimensions; ``at``: its body point, or its pin in a slot."""
    unit = 1 / figure.sheet.scale
    colour = "crank" if driven else "rocker"

    def block(middle: complex, direction: float) -> None:
        corners = np.array([-30 - 15j, 30 - 15j, 30 + 15j, -30 + 15j]) * unit * np.exp(1j * direction)
        figure.parts.append(
            f'<path style="fill:var(--paper)" d="M{" L".join(map(figure.sheet.at, middle + corners))}Z"/>'
        )

    if isinstance(guide, Circle):
        figure.line([guide.pivot + shift, at + shift], colour)
        figure.pivot(guide.pivot + shift, -np.pi / 2)
        figure.dot(at + shift, 8, "pin")
        figure.text("pivot", guide.pivot + shift, (30, -4), "word", "start")
        figure.text("radius", (guide.pivot + at) / 2 + shift, (14, 0), "word", "start")
        figure.text("body_point", at + shift, (0, 18), "word")
    elif isinstance(guide, Rail):
        along = np.exp(1j * guide.direction)
        figure.line([at - 1.5 * along + shift, at + 1.5 * along + shift], "ground")
        for k in range(-3, 4):
            foot = at + 0.45 * k * along
            figure.line([foot + shift, foot + shift + (-14 - 14j) * unit * along], "hatch")
        block(at + shift, guide.direction)
        figure.dot(at + shift, 8, "pin")
        steep = abs(along.imag) > abs(along.real)
        figure.text("body_point", at + shift, (-34, -4) if steep else (10, -48), "word", "end" if steep else "start")
        figure.text("direction", at + 1.5 * along + shift, (8, 6), "word", "start")
        figure.dot(at - 1.2 * along + shift, 5, "pivot")
        figure.text("point", at - 1.2 * along + shift, (8, -26), "word", "start")
    else:
        along = np.exp(1j * (turn + guide.body_direction))
        foot = position + np.exp(1j * turn) * guide.body_point
        reach = float(np.real(np.conj(along) * (at - foot)))
        block(at + shift, turn + guide.body_direction)
        figure.line([foot + shift, foot + (reach + np.copysign(0.9, reach)) * along + shift], "coupler")
        figure.dot(foot + shift, 6, "pin")
        figure.text("body_point", foot + shift, (30, -42), "word", "end")
        side = np.sign(reach * along.real)
        figure.text(
            "body_direction",
            foot + 0.35 * reach * along + shift,
            (6 * side, 16),
            "word",
            "start" if side > 0 else "end",
        )
        figure.pivot(at + shift, -np.pi / 2)
        figure.text("pin", at + shift, (0, -62), "word")


def motion(seconds: float = 8.0, frames: int = 180) -> None:
    """Solve the worked example and draw its best linkage through the requested motion."""
    request = json.loads((ROOT / "app" / "examples" / "worked_example.json").read_text())
    result = la.synthesize(request["rotation"], request["position"], request["crank_span"], top=1)
    assert result.status == "reached"
    linkage = result.linkage
    turn = linkage.joints(np.linspace(0, 360, frames + 1))
    used = linkage.joints(np.linspace(0, request["crank_span"], 71))

    def plane(points: Any) -> Any:
        return points @ [1, 1j]

    assert turn.body_point is not None and used.body_point is not None
    a, b = complex(plane(turn.pivot_a)), complex(plane(turn.pivot_b))
    pins, ends, points = plane(turn.crank_pin), plane(turn.coupler_pin), plane(turn.body_point)
    positions = plane(np.array(request["position"]))
    figure = Figure([-34 - 20j, 166 + 108j], 1100)
    scale = figure.sheet.scale

    figure.line([a, b], "dash")
    figure.line(points, "turn", closed=True)
    figure.line(plane(used.body_point), "path")
    for number, (position, angle) in enumerate(zip(positions, np.deg2rad(request["rotation"]))):
        if number % 3 == 0:
            figure.line([position, position + 9 * np.exp(1j * angle)], "wanted")
        figure.dot(position, 4.5, "pose")
    figure.pivot(a, -np.pi / 2)
    figure.pivot(b, -np.pi / 2)

    def moved(kind: str, values: list[str]) -> str:
        return (
            f'<animateTransform attributeName="transform" type="{kind}" dur="{seconds:g}s" repeatCount="indefinite" '
            f'values="{";".join(values)}"/>'
        )

    def shape(z: Any) -> str:
        return " L".join(f"{scale * point.real:.5g},{-scale * point.imag:.5g}" for point in z)

    def turns(direction: Any) -> list[str]:
        return [f"{-angle:.2f}" for angle in direction]

    def at(z: complex) -> str:
        return figure.sheet.at(z).replace(",", " ")

    # the body in the frame of its crank pin, at coupler direction 0
    back = np.exp(-1j * np.deg2rad(turn.coupler_direction[0]))
    c, p = (ends[0] - pins[0]) * back, (points[0] - pins[0]) * back
    direction = np.exp(1j * np.deg2rad(turn.rotation[0])) * back
    crank, rocker, still = abs(pins[0] - a), abs(ends[0] - b), turn.coupler_direction[0]
    figure.parts += [
        f'<g transform="translate({at(b)})"><g transform="rotate({-turn.rocker_direction[0]:.2f})">'
        f'<path class="rocker" d="M0,0 L{scale * rocker:.5g},0"/>{moved("rotate", turns(turn.rocker_direction))}</g></g>',
        f'<g transform="translate({at(pins[0])})">{moved("translate", [at(z) for z in pins])}'
        f'<g transform="rotate({-still:.2f})">{moved("rotate", turns(turn.coupler_direction))}'
        f'<path class="body" d="M0,0 L{shape([c, p])}Z"/><path class="coupler" d="M0,0 L{shape([c])}"/>'
        f'<path class="mark" d="M{shape([p, p + 12 * direction])}"/>'
        f'<circle class="point" r="8" cx="{scale * p.real:.5g}" cy="{-scale * p.imag:.5g}"/>'
        f'<circle class="pin" r="8" cx="{scale * c.real:.5g}" cy="{-scale * c.imag:.5g}"/></g></g>',
        f'<g transform="translate({at(a)})"><g transform="rotate({-turn.crank_direction[0]:.2f})">'
        f'<path class="crank" d="M0,0 L{scale * crank:.5g},0"/><circle class="pin" r="8" cx="{scale * crank:.5g}" cy="0"/>'
        f"{moved('rotate', turns(turn.crank_direction))}</g></g>",
    ]
    figure.dot(a, 7, "pivot")
    figure.dot(b, 7, "pivot")
    lengths = [f"{name} {getattr(linkage, name):.6g}" for name in ("crank", "coupler", "rocker", "ground")]
    for number, (words, name) in enumerate(
        (
            (f"requested: {len(positions)} poses of a body", "big t-wanted"),
            (f"while a crank turns by {request['crank_span']}°", "big t-wanted"),
            (f"found: {', '.join(lengths[:2])},", "big"),
            (", ".join(lengths[2:]), "big"),
            ("reached: the error lies below the tolerance of 1e-10", "word"),
        )
    ):
        figure.text(words, 66 + 8j, (0, -34 * number), name, "start")
    figure.save("motion.svg", "The linkage found for the worked example, turning through the motion asked for")


if __name__ == "__main__":
    notation()
    limits()
    kinds()
    motion()
    print(f"wrote notation.svg, limits.svg, kinds.svg and motion.svg to {IMAGES}")
