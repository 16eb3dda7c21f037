"""The lift as files: a drawing of a design at its start and its top as SVG and DXF, and its motion as CSV."""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.one_variable import Floats
from synthesis.scenes.lift.motion import Motion
from synthesis.scenes.lift.pose import Design, joints, pose_at_turn
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

PATH_POINTS = 121
MILLIMETRES = 4
"""$INSUNITS of a DXF."""
LAYERS = {"GROUND": 8, "TRIANGLE": 5, "LINK": 7, "CYLINDER": 30, "TOP": 9, "PATHS": 3, "TEXT": 7}


def columns(moved: Motion) -> dict[str, Floats]:
    """What every file and reply lists over the time."""
    return {
        "time": moved.time,
        "height": moved.pose.height,
        "velocity": moved.velocity,
        "acceleration": moved.acceleration,
        "cylinder_length": moved.cylinder_length,
        "cylinder_speed": moved.cylinder_speed,
    }


def joint_columns(moved: Motion) -> dict[str, Floats]:
    """The joints that move, over the time."""
    places = joints(moved.pose)
    rows: dict[str, Floats] = {}
    for name in "ABC":
        rows |= {f"{name}_x": places[name].real, f"{name}_y": places[name].imag}
    return rows


def design_csv(moved: Motion, closed: float) -> str:
    """The design, once in each line, and its motion with the joints that move."""
    rows = columns(moved) | joint_columns(moved)
    lengths = {**moved.pose.design.as_dict(), "closed_length": closed}
    rows |= {name: np.full(len(moved.time), value) for name, value in lengths.items()}
    return csv_text(rows, "\n")


def _poses(design: Design, turn: float) -> tuple[dict[str, complex], dict[str, complex], dict[str, Any]]:
    """The joints at the start and at the top, and all of them on the way."""
    way = joints(pose_at_turn(design, np.linspace(turn, 0.0, PATH_POINTS)))
    return (
        {name: complex(at[0]) for name, at in way.items()},
        {name: complex(at[-1]) for name, at in way.items()},
        way,
    )


def design_svg(design: Design, turn: float) -> str:
    """The lift at the start, thin at the top, with the paths of B and C and the symbols of the documents."""
    start, top, way = _poses(design, turn)
    wide = 0.14 * abs(top["A"])
    around = [start["D"] - wide, start["D"] + wide, top["A"] - wide]
    sheet = Sheet(np.concatenate([np.array(around), *way.values()]), 0.08, 900, digits=6)
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
    line([start["D"] - wide, start["O"]], "axis")
    for name in ("B", "C"):
        line(way[name], "path")
    for at, kinds in ((top, ("thin", "thin", "thin")), (start, ("body", "cylinder", "link"))):
        line([at["A"], at["B"], at["C"]], kinds[0], closed=True)
        line([at["O"], at["B"]], kinds[1])
        line([at["D"], at["C"]], kinds[2])
        line([at["A"] - wide, at["A"] + wide], kinds[2] if at is top else "")
    for pin in start.values():
        parts.append(sheet.dot(pin, 6, 'class="ink pin"'))
    middle = {
        **start,
        "l1": (start["O"] + start["B"]) / 2,
        "l2": (start["A"] + start["B"]) / 2,
        "l3": (start["A"] + start["C"]) / 2,
        "l4": (start["B"] + start["C"]) / 2,
        "l5": (start["D"] + start["C"]) / 2,
    }
    for name, place in middle.items():
        x, y = (float(value) for value in sheet.at(place).split(","))
        parts.append(f'<text x="{x + 9:.5g}" y="{y - 9:.5g}">{name}</text>')
    lengths = {**design.as_dict(), "l1": abs(start["B"])}
    shown = ", ".join(f"{name} = {lengths[name]:.6g}" for name in ("l1", "l2", "l3", "l4", "l5", "b"))
    parts.append(f'<text x="12" y="{sheet.height - 12:.5g}">{shown} mm</text>')
    return sheet.text(f"Pneumatic lift: {shown} mm", parts)


def design_dxf(design: Design, turn: float) -> str:
    """The lift in millimetres: pivots and slide, the parts at the start, the parts at the top, and the paths of B and C."""
    start, top, way = _poses(design, turn)
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
        line("PATHS", *way[name])
    for name, pin in start.items():
        space.add_circle(xy(pin), 0.4 * height, dxfattribs={"layer": "GROUND" if name in "OD" else "TEXT"})
        space.add_text(name, height=height, dxfattribs={"layer": "TEXT"}).set_placement(
            (pin.real + height, pin.imag + height)
        )
    return dxf_text(document)
