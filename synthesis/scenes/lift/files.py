"""Files of the lift: a drawing as SVG or DXF, and the motion as CSV."""

from __future__ import annotations

from typing import Any

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
    """Write the motion with the moving joints as CSV.

    Parameters
    ----------
    trajectory : Motion
    closed_length : float
        Cylinder length at the start.

    Returns
    -------
    str
        Every row repeats the lengths of the design.
    """
    columns = motion_columns(trajectory) | joint_columns(trajectory)
    lengths = {**trajectory.pose.design.as_dict(), "closed_length": closed_length}
    columns |= {name: np.full(len(trajectory.time), value) for name, value in lengths.items()}
    return csv_text(columns, "\n")


def _poses(design: Design, turn: float) -> tuple[dict[str, complex], dict[str, complex], dict[str, Any]]:
    """Return the joints at the start, at the top, and along the whole path."""
    path = joints(pose_at_turn(design, np.linspace(turn, 0.0, POSES_PER_PATH)))
    return (
        {name: complex(at[0]) for name, at in path.items()},
        {name: complex(at[-1]) for name, at in path.items()},
        path,
    )


def design_svg(design: Design, turn: float) -> str:
    """Draw the lift in its start and top positions, with the paths of B and C and the symbols of the documentation, as SVG.

    Parameters
    ----------
    design : Design
        A single design, in millimetres.
    turn : float
        Turn at the start.
    """
    start, top, path = _poses(design, turn)
    half_width = 0.14 * abs(top["A"])
    extent = [start["D"] - half_width, start["D"] + half_width, top["A"] - half_width]
    sheet = Sheet(np.concatenate([np.array(extent), *path.values()]), 0.08, 900, digits=6)
    parts = [
        "<style>.ink{fill:none;stroke:#1a2430;stroke-width:2;stroke-linejoin:round;stroke-linecap:round}"
        ".thin{stroke:#8a94a0;stroke-width:1.2}.path{stroke:#0f766e;stroke-width:1.2}.axis{stroke:#8a94a0;"
        "stroke-dasharray:8 5;stroke-width:1.2}.cylinder{stroke:#b8430a;stroke-width:5}.link{stroke-width:5}"
        ".body{fill:#2563eb;fill-opacity:.12;stroke:#2563eb;stroke-width:3}.pin{fill:#fff}"
        "text{font:italic 18px Georgia,serif;fill:#1a2430}</style>",
        f'<rect width="{sheet.width:.6g}" height="{sheet.height:.6g}" fill="#fff"/>',
    ]

    def line(points: Any, name: str, closed: bool = False) -> None:
        parts.append(f'<path class="ink {name}" d="M{" L".join(map(sheet.at, points))}{"Z" if closed else ""}"/>')

    line([start["D"], top["A"]], "axis")
    line([start["D"] - half_width, start["O"]], "axis")
    for name in ("B", "C"):
        line(path[name], "path")
    for points, styles in ((top, ("thin", "thin", "thin")), (start, ("body", "cylinder", "link"))):
        line([points["A"], points["B"], points["C"]], styles[0], closed=True)
        line([points["O"], points["B"]], styles[1])
        line([points["D"], points["C"]], styles[2])
        line([points["A"] - half_width, points["A"] + half_width], styles[2] if points is top else "")
    for pin in start.values():
        parts.append(sheet.dot(pin, 6, 'class="ink pin"'))
    labels = {
        **start,
        "l1": (start["O"] + start["B"]) / 2,
        "l2": (start["A"] + start["B"]) / 2,
        "l3": (start["A"] + start["C"]) / 2,
        "l4": (start["B"] + start["C"]) / 2,
        "l5": (start["D"] + start["C"]) / 2,
    }
    for name, point in labels.items():
        x, y = (float(value) for value in sheet.at(point).split(","))
        parts.append(f'<text x="{x + 9:.5g}" y="{y - 9:.5g}">{name}</text>')
    lengths = {**design.as_dict(), "l1": abs(start["B"])}
    label = ", ".join(f"{name} = {lengths[name]:.6g}" for name in ("l1", "l2", "l3", "l4", "l5", "b"))
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
    start, top, path = _poses(design, turn)
    document = dxf_document(LAYERS, MILLIMETRES)
    space = document.modelspace()

    def xy(at: complex) -> tuple[float, float]:
        return at.real, at.imag

    def line(layer: str, *points: complex, closed: bool = False) -> None:
        space.add_lwpolyline([xy(at) for at in points], close=closed, dxfattribs={"layer": layer})

    height = 0.02 * abs(top["A"] - start["D"])
    line("GROUND", start["D"], start["O"])
    line("GROUND", start["D"], top["A"])
    for at, layers in ((start, ("TRIANGLE", "LINK", "CYLINDER")), (top, ("TOP",) * 3)):
        line(layers[0], at["A"], at["B"], at["C"], closed=True)
        line(layers[1], at["D"], at["C"])
        line(layers[2], at["O"], at["B"])
    for name in ("B", "C"):
        line("PATHS", *path[name])
    for name, pin in start.items():
        space.add_circle(xy(pin), 0.4 * height, dxfattribs={"layer": "GROUND" if name in "OD" else "TEXT"})
        space.add_text(name, height=height, dxfattribs={"layer": "TEXT"}).set_placement(
            (pin.real + height, pin.imag + height)
        )
    return dxf_text(document)
