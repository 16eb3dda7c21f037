"""Tables (CSV) of the motion of a linkage at the samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.export.layout import closed_motions, pins_of
from synthesis.linkage import Linkage
from synthesis.sheet import csv_text, given_cells
from synthesis.target import TURN, Target


def to_csv(linkage: Linkage, target: Target, unit: float, more: Mapping[str, Iterable[Any]] | None = None) -> str:
    """Write the motion at the samples: the request, the motion of the linkage, and the position of its joints.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    target : Target
        The motion, with the travel of the drive at the samples.
    unit : float
        Radians in one unit of angle.
    more : mapping, optional
        Further columns, with a value for each sample.

    Returns
    -------
    str
        The table; a cell is empty if its number was not requested.

    Raises
    ------
    FieldError
        For a linkage that does not close over the used interval.
    """
    closed_motions(linkage, target.interval)
    links, poses = linkage.motions(target.crank), linkage.body(linkage.start + target.crank)
    body, turns = links[1], linkage.driver.turns
    columns: dict[str, Any] = {
        "crank_angle" if turns else "travel": target.crank / (unit if turns else 1.0),
        **_motion_columns(target, unit, body.angle, body.origin if linkage.mounted else None),
        "transmission_angle": poses.transmission_angle / unit,
        **({} if linkage.is_four_bar else {"arm": poses.arm}),
    }
    for link in linkage.by_coupler.motions(target.crank):
        if not link.name.endswith("slider"):
            columns[f"{link.name}_direction"] = link.angle / unit
    for index, guide in enumerate(linkage.guides):
        name = linkage.link_names[2 * index]
        if guide.slides:
            columns[f"{name}_travel"] = linkage.along(index, target.crank)
        if guide.holds_point:
            pin = "coupler" if name == "rocker" else name
            columns |= _coordinates(f"{pin}_pin_{{}}", pins_of(linkage, index, body), target.samples)
    return csv_text(columns | dict(more or {}))


def _motion_columns(
    target: Target, unit: float, rotation: Floats, position: Complexes | None
) -> dict[str, Iterable[Any]]:
    """Return columns of the requested motion, the motion of the linkage, and the errors.

    ``rotation`` (rad) and ``position`` are the motion of the body. Whole turns are added to its rotation so that it lies near the
    request.
    """
    request, rows = target.requested, target.samples
    requested_rotation = None if request.rotation is None else request.rotation / unit
    actual_rotation = rotation - request.moved
    if request.rotation is not None:  # whole turns do not matter
        actual_rotation = actual_rotation - TURN * np.round(np.nanmean(actual_rotation - request.rotation) / TURN)
    actual_rotation = actual_rotation / unit
    position_error = None if position is None or request.position is None else np.abs(request.position - position)
    return {
        "rotation_wanted": given_cells(requested_rotation, rows),
        **_coordinates("{}_wanted", request.position, rows),
        "rotation": actual_rotation,
        **_coordinates("{}", position, rows),
        "rotation_error": given_cells(
            None if requested_rotation is None else actual_rotation - requested_rotation, rows
        ),
        "position_error": given_cells(position_error, rows),
    }


def _coordinates(name: str, points: Complexes | None, rows: int) -> dict[str, Iterable[Any]]:
    """Return the columns x and y of points, blank without points; ``name`` has a gap for x and y."""
    x, y = (given_cells(None if points is None else part(points), rows) for part in (np.real, np.imag))
    return {name.format("x"): x, name.format("y"): y}
