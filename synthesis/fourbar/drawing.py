"""A four-bar as an SVG drawing: ground, links, body, path of the body point, requested positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.linkage import Joints, Linkage
from synthesis.sheet import Sheet
from synthesis.target import Interval, Target

Complexes = NDArray[np.complex128]

FARTHEST = 1e9
"""Largest distance from the origin, in longest links, at which coordinates still hold the shape."""
STYLE = (
    "<style>path{fill:none;stroke:#1d2733;stroke-width:4;stroke-linejoin:round;stroke-linecap:round}"
    ".ground{stroke:#7b8794;stroke-dasharray:14 10}.crank{stroke:#c2410c;stroke-width:8}.rocker{stroke-width:8}"
    ".body{fill:#2563eb33;stroke:#2563eb}.path{stroke:#0f766e}.turn{stroke:#0f766e66;stroke-width:2}"
    "circle{fill:#fff;stroke:#1d2733;stroke-width:3}.pivot{fill:#1d2733}.pose{fill:#b91c1c;stroke:none}"
    ".point{fill:#0f766e;stroke:none}text{font:22px sans-serif;fill:#1d2733}.size{font-size:18px;fill:#566272}</style>"
)


def used_joints(linkage: Linkage, interval: Interval) -> Joints:
    """The joints over the used interval. FieldError for a linkage that does not close there, at the crank angle that fails."""
    if max(abs(linkage.pivot_a.real), abs(linkage.pivot_a.imag)) > FARTHEST * max(linkage.links):
        raise FieldError(
            "/solution/mount/pivot_a", f"lies more than {FARTHEST:.0e} link lengths from the origin: move the origin"
        )
    joints = linkage.over(interval)
    if not joints.closed:
        place = int(np.argmin(np.isfinite(joints.coupler_pin))) / (joints.crank_angle.size - 1)
        first, last = interval
        raise FieldError(
            "/solution/links",
            f"the four links do not close {np.rad2deg(first + place * (last - first)):.6g} degrees after the start",
        )
    return joints


def requested_positions(target: Target) -> Complexes:
    """The positions of a target; none where it has none."""
    return np.empty(0, dtype=complex) if target.position is None else target.position


def to_svg(linkage: Linkage, target: Target) -> str:
    """A drawing at the first sample, y up, with the names of the joints and the lengths of the links."""
    used, turn = used_joints(linkage, target.interval), linkage.turn()
    a, b, d, c = used.pivot_a, used.pivot_b, used.crank_pin[0], used.coupler_pin[0]
    path, marks = used.body_point, requested_positions(target)
    way = None if turn is None else turn.body_point
    shown = [np.array([a, b]), used.crank_pin, used.coupler_pin, marks]
    if path is not None:
        shown.append(path)
        if way is not None and np.all(np.isfinite(way)):
            shown.append(way)
    sheet = Sheet(np.concatenate(shown), 0.08, 1000, digits=7)

    def line(points: Complexes, name: str, closed: bool = False) -> str:
        tail = "Z" if closed else ""
        return f'<path class="{name}" d="M{" L".join(sheet.at(z) for z in points)}{tail}"/>'

    def dot(z: complex, radius: float, name: str) -> str:
        return sheet.dot(z, radius, f'class="{name}"')

    curves = ""
    if path is not None:
        curves = ("" if way is None else line(way, "turn")) + line(path, "path")
    curves += "".join(dot(mark, 5, "pose") for mark in marks)
    body = np.array([d, c] if path is None else [d, c, path[0]])
    pins = dot(a, 11, "pivot") + dot(b, 11, "pivot") + dot(d, 8, "pin") + dot(c, 8, "pin")
    named = {"A": a, "B": b, "D": d, "C": c} | ({} if path is None else {"P": path[0]})
    names = "".join(sheet.label(z, name) for name, z in named.items())
    middles = ((a + d) / 2, (d + c) / 2, (b + c) / 2, (a + b) / 2)
    sizes = "".join(
        sheet.label(z, f"{length:.5g}", 'class="size"') for z, length in zip(middles, linkage.links, strict=True)
    )
    return sheet.text(
        "Four-bar linkage: crank {:.6g}, coupler {:.6g}, rocker {:.6g}, ground {:.6g}".format(*linkage.links),
        [
            STYLE,
            f'<g id="GROUND">{line(np.array([a, b]), "ground")}</g>',
            f'<g id="PATH">{curves}</g>',
            f'<g id="BODY">{line(body, "body", closed=True)}</g>',
            f'<g id="LINKS">{line(np.array([a, d]), "crank")}{line(np.array([b, c]), "rocker")}</g>',
            f"<g>{pins}{'' if path is None else dot(path[0], 7, 'point')}</g>",
            f'<g id="NAMES">{names}{sizes}</g>',
        ],
    )
