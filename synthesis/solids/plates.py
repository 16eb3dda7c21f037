"""DXF file in millimetres of the flat parts of an assembly, for cutting."""

from __future__ import annotations

import numpy as np

from synthesis.errors import FieldError
from synthesis.sheet import dxf_document, dxf_text
from synthesis.solids.prism import contour
from synthesis.solids.solid import Solids

FLAT = ("plate", "board", "washer", "head")
"""Kinds of parts that are cut from sheets."""
COLOURS = {"CRANK": 1, "COUPLER": 5, "ROCKER": 3, "BODY": 4, "MARK": 2}
"""AutoCAD colour index of each layer; other layers are grey."""
GREY = 8


def to_plates(solids: Solids, kerf: float = 0.0) -> str:
    """Write the flat parts of an assembly below each other, with the holes of their fit, each on its own layer.

    The name of a part on the layer MARK is followed by the thickness of its sheet.
    ``kerf`` is the width of the cut in millimetres. Contours are offset by half of it, so that the parts have their size after
    the cut.

    Raises
    ------
    FieldError
        If the cut closes a hole.
    """
    parts = {part.name.upper(): part.prism for part in solids.parts if part.kind in FLAT}
    document = dxf_document({name: COLOURS.get(name, GREY) for name in (*parts, "MARK")}, 4)
    space = document.modelspace()
    top = 0.0
    for layer, prism in parts.items():
        hole = prism.holes[0]
        if not all(opening.radius > kerf / 2 for opening in prism.holes):
            raise FieldError(
                "/assembly/kerf",
                f"must be smaller, because it closes a hole of {2 * hole.radius:g} mm in {layer.lower()}",
            )
        outline = prism.shape.grown(kerf / 2)
        low, high = outline.extent
        lift = complex(0.0, top - high.imag)
        top -= 1.02 * (high - low).imag
        holes = [opening.grown(-kerf / 2) for opening in prism.holes]
        for shape in (outline, *holes):
            if len(shape.core) == 1:
                centre = shape.core[0] + lift
                space.add_circle((centre.real, centre.imag), shape.radius, dxfattribs={"layer": layer})
                continue
            points = [
                (
                    (side.start + lift).real,
                    (side.start + lift).imag,
                    float(np.tan(side.arc.angle / 4)) if side.arc else 0.0,
                )
                for side in contour(shape, hole=shape is not outline)
            ]
            space.add_lwpolyline(points, format="xyb", close=True, dxfattribs={"layer": layer})
        # letters as high as the rim around the first hole, but small beside a hole of a large body
        at = hole.core[0]
        depth = min(abs(at - side.start) for side in contour(prism.shape))
        rim = min(depth - hole.radius, 3 * hole.radius)
        words = f"{layer.lower()} {prism.height:.4g} mm"
        text = space.add_text(words, height=0.6 * rim, dxfattribs={"layer": "MARK"})
        word = at + complex(1.1 * hole.radius, -0.3 * rim) + lift
        text.set_placement((word.real, word.imag))
    return dxf_text(document)
