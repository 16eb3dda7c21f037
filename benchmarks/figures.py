"""The figures of the documents: one style, the colours, and what several of them draw.

In short::

    with figure("name.png", 1, 2) as (drawing, (left, right)):
        curve(left, rows, "types", "ms", color=BLUE)     # of rows that have both numbers
        note(left, "here", (x, y), (5, 5))               # words, five points to the right and up
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
    """A figure of the documents in the common style, saved as ``docs/img/NAME`` where the block ends without an error.

    Law: the same drawing gives the same bytes.

    Yields
    ------
    drawing : matplotlib Figure
        With constrained layout.
    panels : ndarray of Axes, shape (rows * columns,)
    """
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
        made = {"figsize": size, "layout": "constrained", "squeeze": False, **options}
        drawing, panels = plt.subplots(rows, columns, **made)
        try:
            yield drawing, panels.ravel()
            IMAGES.mkdir(parents=True, exist_ok=True)
            drawing.savefig(IMAGES / name, metadata={"Date": None} if name.endswith(".svg") else {"Software": None})
        finally:
            plt.close(drawing)


def note(axes: Any, text: str, at: tuple[float, float], offset: tuple[float, float] = (0, 0), **style: Any) -> None:
    """Words at a place of the axes, moved by an offset in points."""
    axes.annotate(text, at, offset, textcoords="offset points", **style)


def bare(axes: Any, **limits: Any) -> None:
    """Axes for the drawing of a mechanism: equal scales, nothing of the frame."""
    axes.set(aspect="equal", **limits)
    axes.set_axis_off()


def curve(axes: Any, rows: Sequence[Mapping[str, Any]], x: str, y: str, *marks: str, **style: Any) -> None:
    """One line through two finite numbers of each row; rows that lack one are left out."""
    pairs = [(row[x], row[y]) for row in rows if None not in (row[x], row[y])]
    axes.plot(*zip(*(pair for pair in pairs if all(map(math.isfinite, pair)))), *marks, **style)


def arrow(axes: Any, start: Any, end: Any, text: str = "", shape: str = "-|>", color: str = INK, **line: Any) -> None:
    """An arrow between two places of the axes, with words where it starts."""
    line = {"arrowstyle": shape, "color": color, "lw": 0.8} | line
    axes.annotate(text, end, start, arrowprops=line, fontsize=9 if text else None)  # the head grows with the words
