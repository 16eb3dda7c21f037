"""Figures of the documents: common style, colours, and elements that several of them use.

Example::

    with figure("name.png", 1, 2) as (drawing, (left, right)):
        curve(left, rows, "types", "ms", color=BLUE)     # rows with both numbers
        note(left, "here", (x, y), (5, 5))               # text, five points to the right and up
        arrow(right, start, end)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from benchmarks.report import ROOT

IMAGES = ROOT / "docs" / "img"
INK, GREY, SOFT, PAPER = "#1f2933", "#9aa5b1", "#e4e7eb", "#ffffff"
GREEN, BLUE, ORANGE, RED, PURPLE, BROWN = "#0b6e4f", "#2563a8", "#d97706", "#b83232", "#a23b72", "#7a4a00"
STYLE = {
    "font.family": "DejaVu Sans",
    "axes.prop_cycle": f"cycler('color', {[BLUE, GREEN, ORANGE, RED, PURPLE, BROWN]})",
    **dict.fromkeys(("axes.labelcolor", "text.color", "xtick.color", "ytick.color"), INK),
    **dict.fromkeys(("axes.spines.top", "axes.spines.right", "legend.frameon"), False),
    **dict.fromkeys(("axes.grid", "axes.axisbelow"), True),
    "axes.edgecolor": GREY,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "grid.color": SOFT,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.8,
    "legend.fontsize": 9,
    "savefig.dpi": 150,
    "svg.hashsalt": "linkage-atlas",
}


@contextmanager
def figure(
    name: str, rows: int = 1, columns: int = 1, size: tuple[float, float] = (11, 4.6), **options: Any
) -> Iterator[tuple[Any, Any]]:
    """Provide a figure in the common style, saved as ``docs/img/NAME`` if the block ends without an error.

    Equal drawings give equal bytes.

    Yields
    ------
    drawing : matplotlib Figure
        Figure with constrained layout.
    panels : ndarray of Axes, shape (rows * columns,)
        Axes of the panels.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
        settings = {"figsize": size, "layout": "constrained", "squeeze": False, **options}
        drawing, panels = plt.subplots(rows, columns, **settings)
        try:
            yield drawing, panels.ravel()
            IMAGES.mkdir(parents=True, exist_ok=True)
            drawing.savefig(IMAGES / name, metadata={"Date": None} if name.endswith(".svg") else {"Software": None})
        finally:
            plt.close(drawing)


def note(axes: Any, text: str, at: tuple[float, float], offset: tuple[float, float] = (0, 0), **style: Any) -> None:
    """Write text at a point of the axes, moved by an offset in points."""
    axes.annotate(text, at, offset, textcoords="offset points", **style)


def bare(axes: Any, **limits: Any) -> None:
    """Prepare axes for the drawing of a mechanism: equal scales, no frame."""
    axes.set(aspect="equal", **limits)
    axes.set_axis_off()


def curve(axes: Any, rows: Sequence[Mapping[str, Any]], x: str, y: str, *marks: str, **style: Any) -> None:
    """Draw a line through two numbers of each row; rows without finite numbers are omitted."""
    pairs = [(row[x], row[y]) for row in rows if None not in (row[x], row[y])]
    axes.plot(*zip(*(pair for pair in pairs if all(map(math.isfinite, pair)))), *marks, **style)


def arrow(axes: Any, start: Any, end: Any, text: str = "", shape: str = "-|>", color: str = INK, **line: Any) -> None:
    """Draw an arrow between two points of the axes, with text at its start."""
    line = {"arrowstyle": shape, "color": color, "lw": 0.8} | line
    axes.annotate(text, end, start, arrowprops=line, fontsize=9 if text else None)  # the head grows with the text
