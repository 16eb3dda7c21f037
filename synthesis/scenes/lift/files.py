"""Files of the lift: a drawing as SVG or DXF, and the motion as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.one_variable import Floats
from synthesis.scenes.lift.motion import Motion
from synthesis.scenes.lift.pose import Design, joints, pose_at_turn
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

POSES_PER_PATH = 121
"""Number of poses from which the path of a joint is drawn."""
MILLIMETRES = 4
"""Value of $INSUNITS in a DXF file."""
LAYERS = {"GROUND": 8, "TRIANGLE": 5, "LINK": 7, "CYLINDER": 30, "TOP": 9, "PATHS": 3, "TEXT": 7}
"""AutoCAD colour index of each layer."""
STYLE = (
    "<style>.ink,.ground,.triangle,.link,.cylinder,.top,.paths{fill:none;stroke:#1a2430;stroke-width:2;"
    "stroke-linejoin:round;stroke-linecap:round}.link{stroke-width:5}.cylinder{stroke:#b8430a;stroke-width:5}"
    ".top{stroke:#8a94a0;stroke-width:1.2}.paths{stroke:#0f766e;stroke-width:1.2}"
    ".ground{stroke:#8a94a0;stroke-dasharray:8 5;stroke-width:1.2}"
    ".triangle{fill:#2563eb;fill-opacity:.12;stroke:#2563eb;stroke-width:3}.pin{fill:#fff}"
    "text{font:italic 18px Georgia,serif;fill:#1a2430}</style>"
)
SIDES = {name: tuple(ends) for name, ends in {"l1": "OB", "l2": "AB", "l3": "AC", "l4": "BC", "l5": "DC"}.items()}
"""Joints at the ends of each length."""


def motion_columns(trajectory: Motion) -> dict[str, Floats]:
    """Return the quantities over time that every file and reply contains."""
    return {
        "time": trajectory.time,
        "height": trajectory.pose.height,
        "velocity": trajectory.velocity,
        "acceleration": trajectory.acceleration,
        "cylinder_length": trajectory.cylinder_length,
        "cylinder_speed": trajectory.cylinder_speed,
    }


def joint_columns(trajectory: Motion) -> dict[str, Floats]:
    """Return the coordinates of the moving joints over time."""
    points = joints(trajectory.pose)
    columns: dict[str, Floats] = {}
    for name in "ABC":
        columns |= {f"{name}_x": points[name].real, f"{name}_y": points[name].imag}
    return columns


def design_csv(trajectory: Motion, closed_length: float) -> str:
    """Write the motion with the moving joints as CSV; every row repeats the lengths of the design and the closed length."""
    columns = motion_columns(trajectory) | joint_columns(trajectory)
    lengths = {**trajectory.pose.design.as_dict(), "closed_length": closed_length}
    columns |= {name: np.full(len(trajectory.time), value) for name, value in lengths.items()}
    return csv_text(columns, "\n")


class Line(NamedTuple):
    """A line of the drawing."""

    layer: str
    """A key of `LAYERS`."""
    points: Sequence[complex]
    """Points x + i y."""
    closed: bool = False
    """True if the line returns to its first point."""


def _drawing(design: Design, turn: float) -> tuple[dict[str, complex], complex, list[Line]]:
    """Return the joints at the start, A at the top, and the lines from the background to the foreground."""
    path: dict[str, Any] = joints(pose_at_turn(design, np.linspace(turn, 0.0, POSES_PER_PATH)))
    start, top = ({name: complex(at[index]) for name, at in path.items()} for index in (0, -1))
    lines = [Line("GROUND", [start["O"], start["D"], top["A"]])]
    lines += [Line("PATHS", path[name]) for name in "BC"]
    for at, layers in ((top, ("TOP",) * 3), (start, ("TRIANGLE", "CYLINDER", "LINK"))):
        lines += [
            Line(layer, [at[name] for name in names], len(names) == 3)
            for layer, names in zip(layers, ("ABC", "OB", "DC"))
        ]
    return start, top["A"], lines


def design_svg(design: Design, turn: float) -> str:
    """Draw the lift in its start and top positions, with the paths of B and C and the symbols of the documentation, as SVG.

    Parameters
    ----------
    design : Design
        A single design, in millimetres.
    turn : float
        Turn at the start.
    """
    start, top, lines = _drawing(design, turn)
    half_width = 0.14 * abs(top)
    platforms = [np.array([at - half_width, at + half_width]) for at in (start["A"], top)]
    points = [np.array(line.points) for line in lines]
    sheet = Sheet(np.concatenate([*points, *platforms]), 0.08, 900, digits=6)
    parts = [STYLE, f'<rect width="{sheet.width:.6g}" height="{sheet.height:.6g}" fill="#fff"/>']
    parts += [sheet.line(at, line.layer.lower(), line.closed) for line, at in zip(lines, points)]
    parts += [sheet.line(platform, name) for platform, name in zip(platforms, ("ink", "top"))]
    parts += [sheet.dot(pin, 6, 'class="ink pin"') for pin in start.values()]
    labels = start | {name: (start[first] + start[last]) / 2 for name, (first, last) in SIDES.items()}
    parts += [sheet.label(point, name) for name, point in labels.items()]
    lengths = {"l1": abs(start["B"]), **design.as_dict()}
    label = ", ".join(f"{name} = {length:.6g}" for name, length in lengths.items())
    parts.append(f'<text x="12" y="{sheet.height - 12:.5g}">{label} mm</text>')
    return sheet.text(f"Pneumatic lift: {label} mm", parts)


def design_dxf(design: Design, turn: float) -> str:
    """Draw the lift in its start and top positions, with pivots, slide and the paths of B and C, as DXF in millimetres.

    Parameters
    ----------
    design : Design
        A single design, in millimetres.
    turn : float
        Turn at the start.
    """
    start, top, lines = _drawing(design, turn)
    document = dxf_document(LAYERS, MILLIMETRES)
    space = document.modelspace()
    for line in lines:
        points = [(at.real, at.imag) for at in line.points]
        space.add_lwpolyline(points, close=line.closed, dxfattribs={"layer": line.layer})
    height = 0.02 * abs(top - start["D"])
    for name, pin in start.items():
        layer = {"layer": "GROUND" if name in "OD" else "TEXT"}
        space.add_circle((pin.real, pin.imag), 0.4 * height, dxfattribs=layer)
        space.add_text(name, height=height, dxfattribs={"layer": "TEXT"}).set_placement(
            (pin.real + height, pin.imag + height)
        )
    return dxf_text(document)
