"""Charts of curves over a common axis as SVG."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

import numpy as np

from synthesis.arrays import Floats

COLOURS = ("#1f6fb2", "#d1495b", "#3a7d44", "#8e5ea2", "#b8860b", "#444444")
"""Colours of the curves of a panel, in order; they repeat."""


@dataclass(frozen=True)
class ChartOptions:
    """Sizes of a chart in units of its page."""

    width: float = 720.0
    """Width of the page."""
    height: float = 190.0
    """Height of a panel with its margins."""
    left: float = 80.0
    """Space for the numbers of the vertical axis."""
    margin: float = 24.0
    """Space above, below and to the right of a panel."""
    ticks: int = 5
    """Approximate number of numbers along an axis."""


OPTIONS = ChartOptions()


def nice_ticks(low: float, high: float, count: int) -> Floats:
    """Return about ``count`` round numbers from ``low`` to ``high``: multiples of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return np.asarray(step * np.arange(first, last + 1), dtype=np.float64)


def chart_svg(panels: Mapping[str, Mapping[str, tuple[Floats, Floats]]], x_label: str) -> str:
    """Draw panels with curves, one below the other.

    Parameters
    ----------
    panels : mapping
        By the label of the vertical axis: x and y, (n,) each, of each curve by its name. A curve is interrupted at values that
        are not finite.
    x_label : str
        Label of the common horizontal axis.

    Returns
    -------
    str
        The text of the SVG file.
    """
    names = sorted({name for curves in panels.values() for name in curves})
    colour = {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(names)}
    x_range = _range_of([x for curves in panels.values() for x, _ in curves.values()])
    parts = []
    for index, (label, curves) in enumerate(panels.items()):
        parts += _panel(label, curves, colour, x_range, index * OPTIONS.height)
    below = len(panels) * OPTIONS.height
    parts.append(f'<text x="{OPTIONS.width / 2:g}" y="{below + 14:g}" text-anchor="middle">{escape(x_label)}</text>')
    for index, name in enumerate(names):
        y = below + 38 + 20 * index
        parts.append(f'<path d="M{OPTIONS.left:g},{y - 4:g}h28" stroke="{colour[name]}"/>')
        parts.append(f'<text x="{OPTIONS.left + 36:g}" y="{y:g}">{escape(name)}</text>')
    height = below + 34 + 20 * len(names)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {OPTIONS.width:g} {height:g}" font-family="sans-serif" '
    return f'{head}font-size="12" fill="none" stroke-width="2">\n{_STYLE}\n' + "\n".join(parts) + "\n</svg>\n"


_STYLE = "<style>text{fill:#333}.grid{stroke:#ddd;stroke-width:1}</style>"


def _range_of(columns: list[Floats]) -> tuple[float, float]:
    """Return the smallest and the largest finite value; a range of no extent is widened."""
    values = np.concatenate(columns)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    widened = 0.5 * abs(low) or 0.5
    return (low, high) if high - low > 1e-9 * max(abs(low), abs(high)) else (low - widened, high + widened)


def _panel(
    label: str,
    curves: Mapping[str, tuple[Floats, Floats]],
    colour: Mapping[str, str],
    x_range: tuple[float, float],
    top: float,
) -> list[str]:
    y_range = _range_of([y for _, y in curves.values()])
    right, bottom = OPTIONS.width - OPTIONS.margin, top + OPTIONS.height - OPTIONS.margin
    above = top + OPTIONS.margin

    def across(x: Floats) -> Floats:
        return OPTIONS.left + (x - x_range[0]) / (x_range[1] - x_range[0]) * (right - OPTIONS.left)

    def up(y: Floats) -> Floats:
        return bottom - (y - y_range[0]) / (y_range[1] - y_range[0]) * (bottom - above)

    parts = [f'<text x="{OPTIONS.left:g}" y="{above - 8:g}">{escape(label)}</text>']
    x_ticks, y_ticks = (nice_ticks(*limits, OPTIONS.ticks) for limits in (x_range, y_range))
    for tick, x in zip(x_ticks, across(x_ticks)):
        parts.append(f'<path class="grid" d="M{x:.2f},{above:g}V{bottom:g}"/>')
        parts.append(f'<text x="{x:.2f}" y="{bottom + 15:g}" text-anchor="middle">{tick:.6g}</text>')
    for tick, y in zip(y_ticks, up(y_ticks)):
        parts.append(f'<path class="grid" d="M{OPTIONS.left:g},{y:.2f}H{right:g}"/>')
        parts.append(f'<text x="{OPTIONS.left - 6:g}" y="{y + 4:.2f}" text-anchor="end">{tick:.6g}</text>')
    for name, (x, y) in curves.items():
        finite = np.isfinite(x) & np.isfinite(y)
        pen, path = "M", ""
        for is_finite, h, v in zip(finite, across(x), up(y)):
            path += f"{pen}{h:.2f},{v:.2f}" if is_finite else ""
            pen = "L" if is_finite else "M"
        parts.append(f'<path d="{path}" stroke="{colour[name]}"/>')
    return parts
