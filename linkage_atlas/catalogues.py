"""Catalogues of actuators and springs: bundled catalogues, CSV texts, and lists of rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from linkage_atlas.arguments import Fields, check_names, check_required, number, sequence
from synthesis.drives.catalogue import CatalogueRow
from synthesis.drives.placements import Actuator
from synthesis.drives.springs import SpringRow, TorsionRow
from synthesis.errors import FieldError

MOST_ROWS = 400
"""Maximum number of rows of a catalogue of actuators."""
MOST_SPRING_ROWS = 200
"""Maximum number of rows of a catalogue of springs."""
ACTUATORS = ("iso_6432", "iso_15552", "spindle")
"""Bundled catalogues of actuators, in millimetres and newtons: pneumatic cylinders by two standards, with typical retracted
lengths from rear pin to rod eye, and spindle actuators of no particular maker. Check a size with its maker before you buy it."""
SPRINGS = {
    "tension": "tension_springs",
    "gas": "gas_springs",
    "compression": "compression_springs",
    "torsion": "torsion_springs",
}
"""Bundled catalogues of springs by kind, of no particular maker; torsion springs have rates per degree."""
PRESSURE = 6.0
"""Default supply pressure of cylinders, in bar."""
_NEWTONS_A_BAR = 0.1
"""Force of a pressure of one bar on a square millimetre."""
_LENGTHS = ("retracted", "stroke", "bore", "rod", "free_length", "shortest", "longest", "extended")
_COLUMNS = {
    "actuator": ("name", "retracted", "stroke", "force", "pull", "bore", "rod", "price"),
    "tension": ("name", "stiffness", "free_length", "preload", "shortest", "longest", "price"),
    "gas": ("name", "force", "progression", "extended", "stroke", "price"),
    "compression": ("name", "stiffness", "free_length", "load_max", "price"),
    "torsion": ("name", "rate", "preload", "angle_max", "price"),
}
_NEEDED = {
    "actuator": ("retracted", "stroke"),
    "tension": ("stiffness", "free_length", "longest"),
    "gas": ("force", "extended", "stroke"),
    "compression": ("stiffness", "free_length", "load_max"),
    "torsion": ("rate", "angle_max"),
}


@cache
def _bundled(name: str) -> tuple[Fields, ...]:
    return tuple(_table(name, files("linkage_atlas").joinpath(f"catalogues/{name}.csv").read_text()))


def _table(field: str, text: str) -> list[dict[str, object]]:
    """Return the rows of a CSV text with heads; all cells except names are numbers."""
    reader = csv.DictReader(io.StringIO(text.strip()), delimiter=";" if ";" in text.partition("\n")[0] else ",")
    rows: list[dict[str, object]] = []
    for line, row in enumerate(reader, 2):
        values: dict[str, object] = {}
        for name, value in row.items():
            if name is None or value is None:
                raise FieldError(f"/{field}", f"line {line} has a different number of columns from the headings")
            if name.strip() == "name":
                values["name"] = value.strip()
            elif value.strip():
                try:
                    values[name.strip()] = float(value)
                except ValueError:
                    raise FieldError(f"/{field}", f"line {line}: {name} must be a number; it is {value!r}") from None
        rows.append(values)
    return rows


class _Row(NamedTuple):
    """Checked row of a catalogue."""

    at: str
    """Path of the row in error messages."""
    name: str
    values: dict[str, float]
    """Numbers by column; lengths are in the unit of the request."""


def _rows(
    field: str, value: object, kind: str, names: Sequence[str], max_rows: int, millimetres: float
) -> Iterator[_Row]:
    """Yield the rows of a catalogue from its name, a CSV text, or a list of rows.

    Only the lengths of a bundled catalogue are converted, from millimetres to the request's unit of ``millimetres`` millimetres.
    """
    scale = 1.0
    if not isinstance(value, str):
        rows: Sequence[Fields] = [row if isinstance(row, Mapping) else {} for row in sequence(value)]
    elif "\n" in value:
        rows = _table(field, value)
    elif value in names:
        rows, scale = _bundled(value), millimetres
    else:
        raise FieldError(
            f"/{field}", f"must be one of {', '.join(names)}, a list of rows, or a CSV text; it is {value[:60]!r}"
        )
    if not 1 <= len(rows) <= max_rows:
        raise FieldError(f"/{field}", f"must have 1 to {max_rows} rows; it has {len(rows)}")
    for index, row in enumerate(rows):
        at, values = f"{field}/{index}", dict[str, float]()
        check_names(f"/{at}", row, _COLUMNS[kind], "column")
        check_required(f"{at}/", row, _NEEDED[kind])
        for column, cell in row.items():
            if column == "name" or cell is None:
                continue
            found = number(f"{at}/{column}", cell)
            if column != "preload" and not found > 0 and not (column == "price" and found == 0):
                raise FieldError(f"/{at}/{column}", f"must be a number above 0; it is {found:g}")
            values[column] = found / scale if column in _LENGTHS else found
        yield _Row(at, str(row.get("name") or f"row {index + 1}"), values)


def read_actuators(field: str, value: object, millimetres: float, pressure: float) -> list[CatalogueRow]:
    """Return the rows of a catalogue of actuators.

    A row with a bore and without a force pushes with ``pressure`` (bar) on the bore, and pulls on the bore without the rod.
    """
    rows = []
    for at, name, row in _rows(field, value, "actuator", ACTUATORS, MOST_ROWS, millimetres):
        push = row.get("force", math.inf)
        pull = row.get("pull", push)
        if "force" not in row and "bore" in row:
            area, taken = (math.pi / 4 * (row.get(size, 0.0) * millimetres) ** 2 for size in ("bore", "rod"))
            if taken >= area:
                raise FieldError(f"/{at}/rod", "must be less than the bore")
            push, pull = (pressure * _NEWTONS_A_BAR * part for part in (area, area - taken))
        sizes = Actuator(row["retracted"], row["stroke"])
        rows.append(CatalogueRow(name, sizes, push, pull, row.get("price"), row.get("rod")))
    return rows


def read_springs(field: str, value: object, kind: str, millimetres: float) -> list[SpringRow]:
    """Read a catalogue of tension, gas or compression springs; None selects the bundled catalogue.

    A compression spring pushes between its free length and its length under the largest load.
    """
    rows = _spring_rows(field, value, kind, millimetres)
    scale = millimetres if _is_bundled(value) else 1.0  # a stiffness is a force per length
    springs = []
    for at, name, row in rows:
        free, stiffness = row.get("free_length", 0.0), row.get("stiffness", 0.0) * scale
        if kind == "gas":
            force, extended, stroke = (row[size] for size in ("force", "extended", "stroke"))
            if stroke >= extended:
                raise FieldError(f"/{at}/stroke", "must be less than the extended length")
            rate = force * (row.get("progression", 1.0) - 1) / stroke
            numbers = rate, extended, -force, extended - stroke, extended
        elif kind == "compression":
            if row["load_max"] >= stiffness * free:
                message = f"must be less than stiffness times free length, {stiffness * free:g}"
                raise FieldError(f"/{at}/load_max", message)
            numbers = stiffness, free, 0.0, free - row["load_max"] / stiffness, free
        else:
            if row["longest"] <= free:
                raise FieldError(f"/{at}/longest", "must be more than the free length")
            numbers = stiffness, free, row.get("preload", 0.0), row.get("shortest", free), row["longest"]
        springs.append(SpringRow(name, *numbers, row.get("price")))
    return springs


def read_torsion_springs(field: str, value: object, millimetres: float, radian: float) -> list[TorsionRow]:
    """Read a catalogue of torsion springs; None selects the bundled catalogue.

    The bundled catalogue has newtons times millimetres per degree and degrees; other rows are in the request's units.
    """
    scale, unit = (millimetres, math.pi / 180) if _is_bundled(value) else (1.0, radian)
    return [
        TorsionRow(
            name,
            row["rate"] / scale / unit,
            row.get("preload", 0.0) / scale,
            row["angle_max"] * unit,
            row.get("price"),
        )
        for _, name, row in _spring_rows(field, value, "torsion", millimetres)
    ]


def _spring_rows(field: str, value: object, kind: str, millimetres: float) -> Iterator[_Row]:
    catalogue = SPRINGS[kind] if value is None else value
    return _rows(field, catalogue, kind, tuple(SPRINGS.values()), MOST_SPRING_ROWS, millimetres)


def _is_bundled(value: object) -> bool:
    return value is None or (isinstance(value, str) and "\n" not in value)
