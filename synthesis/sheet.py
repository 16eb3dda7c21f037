"""Tables and drawings as text: what the files of all machines share. What is drawn is each machine's own."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_AT_ONCE = 1024
"""Cells of a column that are Python's numbers at a time."""


def csv_text(columns: Mapping[str, Iterable[Any]], line_end: str = "\r\n") -> str:
    """A table with a head; numbers at full precision, an empty cell for None."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=line_end)
    writer.writerow(columns)
    writer.writerows(zip(*map(_cells, columns.values()), strict=True))
    return text.getvalue()


def given_cells(values: NDArray[Any] | None, rows: int) -> list[Any]:
    """A column of real numbers, with empty cells for NaN; all are empty where there is none."""
    if values is None:
        return [None] * rows
    return [None if np.isnan(one) else one for one in values.tolist()]


def _cells(column: Iterable[Any]) -> Iterable[Any]:
    """A column as Python's own numbers; of an array few at a time."""
    if not isinstance(column, np.ndarray):
        return column
    return (cell for first in range(0, len(column), _AT_ONCE) for cell in column[first : first + _AT_ONCE].tolist())


class Sheet:
    """The page of an SVG drawing, y up in the drawing and down on the page.

    It is written about its own corner, because viewers hold coordinates in single precision.

    ``points``: what must be on the page, x + i y. ``margin``: room on each side, as a share of the larger extent.
    ``size``: the larger side of the page; default: the drawing's own unit is kept. ``digits``: digits of a coordinate.
    """

    def __init__(
        self, points: NDArray[np.complex128], margin: float, size: float | None = None, digits: int = 9
    ) -> None:
        low = complex(points.real.min(), points.imag.min())
        high = complex(points.real.max(), points.imag.max())
        extent = max(high.real - low.real, high.imag - low.imag)
        margin *= extent
        self.scale = 1.0 if size is None else size / (extent + 2 * margin)
        self.corner = complex(low.real - margin, high.imag + margin)
        self.width = ((high - low).real + 2 * margin) * self.scale
        self.height = ((high - low).imag + 2 * margin) * self.scale
        self.digits = digits

    def at(self, point: complex) -> str:
        """The coordinates of a point, as a path has them."""
        moved = (point - self.corner) * self.scale
        return f"{moved.real:.{self.digits}g},{-moved.imag + 0.0:.{self.digits}g}"

    def dot(self, point: complex, radius: float, attributes: str = "") -> str:
        """A circle on the page; the radius in the page's unit."""
        x, y = self.at(point).split(",")
        return f'<circle {attributes}{" " if attributes else ""}cx="{x}" cy="{y}" r="{radius:.6g}"/>'

    def line(self, points: NDArray[np.complex128], name: str, closed: bool = False) -> str:
        """A line through points, of a class of the style sheet."""
        tail = "Z" if closed else ""
        return f'<path class="{name}" d="M{" L".join(self.at(z) for z in points)}{tail}"/>'

    def label(self, point: complex, words: str, attributes: str = "") -> str:
        """Words beside a point, a little above it to the right."""
        x, y = self.at(point).split(",")
        return f'<text {attributes}{" " if attributes else ""}x="{x}" y="{y}" dx="12" dy="-10">{escape(words)}</text>'

    def unit_text(self, length_unit: str | None) -> str:
        """Return words in the lower left corner that name the unit of lengths, if it is known."""
        if not length_unit:
            return ""
        return f'<text class="size" x="12" y="{self.height - 12:.{self.digits}g}">lengths in {escape(length_unit)}</text>'

    def text(self, title: str, parts: Sequence[str]) -> str:
        """The file."""
        head = (
            '<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" '
            f'viewBox="0 0 {self.width:.{self.digits}g} {self.height:.{self.digits}g}">'
        )
        return "\n".join([head, f"<title>{title}</title>", *parts, "</svg>"]) + "\n"


class Extra(NamedTuple):
    """What a drawing to look at holds besides: ``points`` that must be on its page, and what is drawn on it."""

    points: NDArray[np.complex128]
    draw: Callable[[Sheet], str]


class More(NamedTuple):
    """What a drawing holds besides, on a layer of its own: ``draw(modelspace, xy, size)`` of the drawing's own size."""

    layer: str
    colour: int
    draw: Callable[[Any, Callable[[complex], tuple[float, float]], float], None]


def dxf_document(layers: Mapping[str, int], unit: int) -> Any:
    """An empty DXF document (R2010) with layers by AutoCAD colour index.

    ``unit``: $INSUNITS: 4 millimetres, 0 none (the user's own).
    """
    from ezdxf.filemanagement import new

    document: Any = new("R2010", setup=False)
    document.units = unit
    document.header["$MEASUREMENT"] = 1
    for name, colour in layers.items():
        document.layers.add(name, color=colour)
    return document


def dxf_text(document: Any) -> str:
    """The file of a DXF document."""
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()
