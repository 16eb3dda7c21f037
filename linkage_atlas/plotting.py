"""Drawings of linkages, poses and curves with matplotlib, which the extra ``plot`` installs.

The methods `Linkage.plot`, `Motion.plot` and `Drives.plot` of `linkage_atlas` call these functions. Each draws on the current
axes if none are given, and returns the axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.records import plane
from synthesis.arrays import Floats
from synthesis.export.layout import layout_of, pins_of
from synthesis.linkage import Linkage
from synthesis.target import TURN, Interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REQUESTED, BODY_COLOUR, LINK_COLOUR, PATH_COLOUR = "tab:red", "tab:blue", "0.25", "tab:green"
POSITIONS = 181
"""Number of positions of the drive that are drawn along a path."""


def axes_for(ax: Axes | None) -> Axes:
    """Return ``ax``, or the current axes of pyplot if it is None; the message of the `ImportError` names the extra."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("Drawing needs matplotlib: install it with `pip install matplotlib`.") from error
    return pyplot.gca() if ax is None else ax


def plot_poses(position: Floats, rotation: Floats | None, ax: Axes | None, arrow: float | None = None) -> Axes:
    """Draw positions (N, 2), with an arrow along the x axis of the body if rotations (N,) in radians are known.

    ``arrow``: length of the arrows; by default a tenth of the extent of the positions.
    """
    ax = axes_for(ax)
    ax.plot(*position.T, "o", color=REQUESTED, markersize=4, label="requested")
    if rotation is not None:
        length = arrow or 0.1 * float(np.nanmax(np.ptp(position, axis=0))) or 1.0
        heading = length * np.column_stack([np.cos(rotation), np.sin(rotation)])
        ax.quiver(*position.T, *heading.T, angles="xy", scale_units="xy", scale=1, color=REQUESTED, width=0.004)
    ax.margins(0.1)
    ax.set_aspect("equal")
    return ax


def plot_linkage(
    linkage: Linkage, ax: Axes | None, travel: Floats, used: Interval | None = None, *, names: bool = True
) -> Axes:
    """Draw a linkage in one or several positions of its drive, with the path of its body point.

    Parameters
    ----------
    travel : ndarray, shape (n,)
        Travel of the drive from its start, radians or lengths, of the positions to draw.
        Positions after the first are drawn faintly.
    used : Interval, optional
        Travel along which the path is drawn; default: the positions drawn, or a whole turn for a single position.
    names : bool
        Whether the joints A, B, C and D of a four-bar are named.
    """
    ax = axes_for(ax)
    if used is None and (len(travel) > 1 or not linkage.turns_fully):
        used = Interval(float(np.min(travel)), float(np.max(travel)))
    layout = layout_of(linkage, used or Interval(0.0, TURN))
    if layout.path is not None:
        along = np.linspace(*(used or Interval(0.0, TURN)), POSITIONS)
        ax.plot(*plane(linkage.body(linkage.start + along).position).T, color=PATH_COLOUR, lw=1, label="path")
    body = linkage.motions(travel)[1]
    pins = [plane(pins_of(linkage, index, body)) for index in (0, 1)]
    corners = np.stack([*pins, *([plane(body.origin)] if linkage.mounted else [])], axis=1)
    for index in range(len(travel)):
        opacity = 1.0 if index == 0 else 0.3
        ax.fill(*corners[index].T, facecolor=BODY_COLOUR, alpha=0.2 * opacity)
        ax.plot(*corners[index][[*range(corners.shape[1]), 0]].T, color=BODY_COLOUR, alpha=opacity, lw=2)
        for guide, pin in zip(linkage.guides, pins):
            if not guide.slides:
                bar = np.array([plane(guide[0]), pin[index]])
                ax.plot(*bar.T, "o-", color=LINK_COLOUR, alpha=opacity, lw=3, markersize=5)
    for track in [ends for ends in map(layout.track, (0, 1)) if ends is not None]:
        ax.plot(*plane(track).T, color=LINK_COLOUR, lw=1, linestyle="--")
    for block in layout.blocks:
        ax.fill(*plane(block).T, facecolor="white", edgecolor=LINK_COLOUR)
    if names and linkage.is_four_bar:
        for name, point in (layout.fixed | layout.moving).items():
            ax.annotate(name, tuple(plane(point)), xytext=(5, 5), textcoords="offset points")
    ax.margins(0.1)
    ax.set_aspect("equal")
    return ax


def plot_curves(x: ArrayLike, curves: Mapping[str, ArrayLike], ax: Axes | None, xlabel: str, ylabel: str) -> Axes:
    """Draw curves, which map names to values (n,), over ``x`` (n,), with a legend."""
    ax = axes_for(ax)
    for name, values in curves.items():
        ax.plot(np.asarray(x), np.asarray(values), label=name)
    ax.set(xlabel=xlabel, ylabel=ylabel)
    ax.legend()
    return ax
