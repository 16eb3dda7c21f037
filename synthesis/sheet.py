"""CSV tables, SVG drawings and DXF documents as text, shared by the files of all machines."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_BLOCK_CELLS = 1024
"""Number of cells of a column that are converted to Python numbers at a time."""


def csv_text(columns: Mapping[str, Iterable[Any]], line_end: str = "\r\n") -> str:
    """Write a CSV table with a header line.

    Parameters
    ----------
    columns : mapping
        Cells of each column, by name; None gives an empty cell, and numbers keep their full precision.
    line_end : str, optional
        End of a line.

    Returns
    -------
    str
        The text of the file.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=line_end)
    writer.writerow(columns)
    writer.writerows(zip(*map(_cells, columns.values()), strict=True))
    return text.getvalue()


def given_cells(values: NDArray[Any] | None, rows: int) -> list[Any]:
    """Return the cells of a column of numbers: None for NaN, and only None if there are no values."""
    if values is None:
        return [None] * rows
    return [None if np.isnan(value) else value for value in values.tolist()]


def _cells(column: Iterable[Any]) -> Iterable[Any]:
    """Return a column as Python numbers; an array is converted in blocks."""
    if not isinstance(column, np.ndarray):
        return column
    return (
        cell
        for first in range(0, len(column), _BLOCK_CELLS)
        for cell in column[first : first + _BLOCK_CELLS].tolist()
    )


class Sheet:
    """The page of an SVG drawing, with y upwards in the drawing and downwards on the page.

    Coordinates are relative to the corner of the page, because viewers store them in single precision.

    Parameters
    ----------
    points : ndarray of complex
        Points x + i y that must be on the page.
    margin : float
        Margin on each side, as a fraction of the larger extent of the points.
    size : float, optional
        Larger side of the page; without a value the unit of the drawing is kept.
    digits : int, optional
        Number of significant digits of a coordinate.
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
        """Return the page coordinates of a point in the syntax of an SVG path."""
        moved = (point - self.corner) * self.scale
        return f"{moved.real:.{self.digits}g},{-moved.imag + 0.0:.{self.digits}g}"

    def dot(self, point: complex, radius: float, attributes: str = "") -> str:
        """Return a circle; the radius is in the unit of the page."""
        x, y = self.at(point).split(",")
        return f'<circle {attributes}{" " if attributes else ""}cx="{x}" cy="{y}" r="{radius:.6g}"/>'

    def line(self, points: NDArray[np.complex128], name: str, closed: bool = False) -> str:
        """Return a line through points, with ``name`` as its class in the style sheet."""
        tail = "Z" if closed else ""
        return f'<path class="{name}" d="M{" L".join(self.at(z) for z in points)}{tail}"/>'

    def label(self, point: complex, words: str, attributes: str = "") -> str:
        """Return a text label to the upper right of a point."""
        x, y = self.at(point).split(",")
        return f'<text {attributes}{" " if attributes else ""}x="{x}" y="{y}" dx="12" dy="-10">{escape(words)}</text>'

    def unit_text(self, length_unit: str | None) -> str:
        """Return words in the lower left corner that name the unit of lengths, if it is known."""
        if not length_unit:
            return ""
        return f'<text class="size" x="12" y="{self.height - 12:.{self.digits}g}">lengths in {escape(length_unit)}</text>'

    def text(self, title: str, parts: Sequence[str]) -> str:
        """Return the text of the SVG file."""
        head = (
            '<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" '
            f'viewBox="0 0 {self.width:.{self.digits}g} {self.height:.{self.digits}g}">'
        )
        return "\n".join([head, f"<title>{title}</title>", *parts, "</svg>"]) + "\n"


class Extra(NamedTuple):
    """Additional elements of an SVG drawing."""

    points: NDArray[np.complex128]
    """Points that must be on the page."""
    draw: Callable[[Sheet], str]
    """Returns the elements as SVG."""


class More(NamedTuple):
    """Additional elements of a DXF drawing, on a layer of their own."""

    layer: str
    """Name of the layer."""
    colour: int
    """AutoCAD colour index of the layer."""
    draw: Callable[[Any, Callable[[complex], tuple[float, float]], float], None]
    """``draw(modelspace, xy, size)`` adds the elements, given the size of the drawing."""


def dxf_document(layers: Mapping[str, int], unit: int) -> Any:
    """Create an empty DXF document (R2010).

    Parameters
    ----------
    layers : mapping
        AutoCAD colour index of each layer.
    unit : int
        Value of $INSUNITS: 4 for millimetres, 0 for no unit.
    """
    from ezdxf.filemanagement import new

    document: Any = new("R2010", setup=False)
    document.units = unit
    document.header["$MEASUREMENT"] = 1
    for name, colour in layers.items():
        document.layers.add(name, color=colour)
    return document


def dxf_text(document: Any) -> str:
    """Return the text of a DXF document."""
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()
