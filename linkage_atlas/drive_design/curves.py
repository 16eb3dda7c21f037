"""Curves of drives and springs over the motion, as CSV and SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkage_atlas.drive_design.records import AnySpring, Drive, TorqueCurve
from synthesis.arrays import Floats
from synthesis.export.charts import chart_svg
from synthesis.sheet import csv_text

QUANTITIES = ("length", "arm", "force", "twist", "moment", "torque", "hand_force")
"""Fields of the curves of drives and springs, in the order of columns and panels."""


def curves_csv(items: Sequence[Drive | AnySpring]) -> str:
    """Write the curves of all drives and springs as a table with a row for each position.

    Parameters
    ----------
    items : sequence
        Drives and springs.

    Returns
    -------
    str
        CSV with the columns ``number``, ``kind``, ``crank_angle`` (or travel), and a column for each quantity.
    """
    columns: dict[str, list[object]] = {name: [] for name in ("number", "kind", "crank_angle", *QUANTITIES)}
    for number, item in enumerate(items, 1):
        rows = len(item.curve.crank_angle)
        columns["number"] += [number] * rows
        columns["kind"] += [item.kind] * rows
        for name in ("crank_angle", *QUANTITIES):
            values = getattr(item.curve, name, None)
            cells = [None] * rows if values is None else np.asarray(values).tolist()
            columns[name] += [None if cell is not None and not np.isfinite(cell) else cell for cell in cells]
    return csv_text(columns)


def curves_svg(items: Sequence[Drive | AnySpring], required: TorqueCurve | None = None) -> str:
    """Draw the curves of all drives and springs, with a panel for each quantity.

    Parameters
    ----------
    items : sequence
        Drives and springs.
    required : TorqueCurve, optional
        Torque that the load requires at the crank, which is drawn too.

    Returns
    -------
    str
        SVG with the travel from the first sample along the horizontal axis.
    """
    panels: dict[str, dict[str, tuple[Floats, Floats]]] = {}
    for number, item in enumerate(items, 1):
        for name in QUANTITIES:
            values = getattr(item.curve, name, None)
            if values is not None:
                curve = (np.asarray(item.curve.crank_angle), np.asarray(values, dtype=float))
                panels.setdefault(name.replace("_", " "), {})[f"{number}  {item.summary}"] = curve
    if required is not None:
        curve = (np.asarray(required.crank_angle), np.asarray(required.torque, dtype=float))
        panels.setdefault("torque", {})["required by the load at the crank"] = curve
    order = [name.replace("_", " ") for name in QUANTITIES]
    return chart_svg({name: panels[name] for name in sorted(panels, key=order.index)}, "travel from the first sample")
