"""Catalogues of actuators and springs: bundled catalogues, CSV texts, and lists of rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

from linkage_atlas.arguments import Fields, check_names, number, sequence
from synthesis.drives.catalogue import CatalogueRow
from synthesis.drives.placements import Actuator
from synthesis.drives.springs import SpringRow
from synthesis.drives.torsion import TorsionRow
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


def _rows(field: str, value: object, kind: str, names: Sequence[str], max_rows: int) -> list[Fields]:
    """Return the rows of a catalogue from its name, a CSV text, or a list of rows."""
    if isinstance(value, str):
        if "\n" in value:
            rows: list[Fields] = list(_table(field, value))
        elif value in names:
            return list(_bundled(value))
        else:
            raise FieldError(
                f"/{field}", f"must be one of {', '.join(names)}, a list of rows, or a CSV text; it is {value[:60]!r}"
            )
    else:
        rows = [row if isinstance(row, Mapping) else {} for row in sequence(value)]
    if not 1 <= len(rows) <= max_rows:
        raise FieldError(f"/{field}", f"must have 1 to {max_rows} rows; it has {len(rows)}")
    for index, row in enumerate(rows):
        check_names(f"/{field}/{index}", row, _COLUMNS[kind], "column")
        for name in _NEEDED[kind]:
            if row.get(name) is None:
                raise FieldError(f"/{field}/{index}/{name}", "is required")
    return rows


def _value(field: str, row: Fields, name: str, scale: float, default: float | None = None) -> float | None:
    found = row.get(name)
    if found is None:
        return default
    value = number(f"{field}/{name}", found)
    if name != "preload" and not value > 0 and not (name == "price" and value == 0):
        raise FieldError(f"/{field}/{name}", f"must be a number above 0; it is {value:g}")
    return value / scale if name in _LENGTHS else value


def read_actuators(
    field: str, value: object, millimetres: float, pressure: float
) -> tuple[list[CatalogueRow], dict[str, float]]:
    """Return the rows of a catalogue of actuators, and the rod diameters by the names of the rows.

    Only bundled catalogues are converted from millimetres to the request's unit, which has ``millimetres`` millimetres. A row
    with a bore and without a force pushes with ``pressure`` (bar) on the bore, and pulls on the bore without the rod.
    """
    bundled = isinstance(value, str) and "\n" not in value
    scale = millimetres if bundled else 1.0
    rows, rods = [], {}
    for index, row in enumerate(_rows(field, value, "actuator", ACTUATORS, MOST_ROWS)):
        at = f"{field}/{index}"
        retracted, stroke = (_value(at, row, name, scale) for name in ("retracted", "stroke"))
        bore, rod = (_value(at, row, name, scale) for name in ("bore", "rod"))
        push = _value(at, row, "force", scale)
        pull = _value(at, row, "pull", scale, push)
        if push is None and bore is not None:
            area = math.pi / 4 * (bore * millimetres) ** 2
            taken = math.pi / 4 * ((rod or 0.0) * millimetres) ** 2
            if taken >= area:
                raise FieldError(f"/{at}/rod", "must be less than the bore")
            push, pull = (pressure * _NEWTONS_A_BAR * part for part in (area, area - taken))
        name = str(row.get("name") or f"row {index + 1}")
        assert retracted is not None and stroke is not None
        price, never = _value(at, row, "price", scale), math.inf
        rows.append(
            CatalogueRow(
                name,
                Actuator(retracted, stroke),
                never if push is None else push,
                never if pull is None else pull,
                price,
            )
        )
        if rod is not None:
            rods[name] = rod
    return rows, rods


def read_springs(field: str, value: object, kind: str, millimetres: float) -> list[SpringRow]:
    """Read a catalogue of tension, gas or compression springs; None selects the bundled catalogue."""
    value = SPRINGS[kind] if value is None else value
    bundled = isinstance(value, str) and "\n" not in value
    scale = millimetres if bundled else 1.0
    kinds = []
    for index, row in enumerate(_rows(field, value, kind, tuple(SPRINGS.values()), MOST_SPRING_ROWS)):
        at = f"{field}/{index}"
        name, price = str(row.get("name") or f"row {index + 1}"), _value(at, row, "price", scale)
        if kind == "gas":
            force, extended, stroke = (_value(at, row, name, scale) for name in ("force", "extended", "stroke"))
            assert force is not None and extended is not None and stroke is not None
            if stroke >= extended:
                raise FieldError(f"/{at}/stroke", "must be less than the extended length")
            progression = _value(at, row, "progression", scale, 1.0)
            assert progression is not None
            rate = force * (progression - 1) / stroke
            kinds.append(SpringRow(name, rate, extended, -force, extended - stroke, extended, price))
            continue
        if kind == "compression":
            kinds.append(_compression(at, row, name, scale, price))
            continue
        stiffness, free, longest = (_value(at, row, name, scale) for name in ("stiffness", "free_length", "longest"))
        assert stiffness is not None and free is not None and longest is not None
        if longest <= free:
            raise FieldError(f"/{at}/longest", "must be more than the free length")
        preload, shortest = _value(at, row, "preload", scale, 0.0), _value(at, row, "shortest", scale, free)
        assert preload is not None and shortest is not None
        kinds.append(SpringRow(name, stiffness * scale, free, preload, shortest, longest, price))
    return kinds


def _compression(at: str, row: Fields, name: str, scale: float, price: float | None) -> SpringRow:
    """Read a row of a compression spring, which pushes between its free length and its length under the largest load."""
    stiffness, free, load = (_value(at, row, column, scale) for column in ("stiffness", "free_length", "load_max"))
    assert stiffness is not None and free is not None and load is not None
    rate = stiffness * scale
    if load >= rate * free:
        raise FieldError(f"/{at}/load_max", f"must be less than stiffness times free length, {rate * free:g}")
    return SpringRow(name, rate, free, 0.0, free - load / rate, free, price)


def read_torsion_springs(field: str, value: object, millimetres: float, radian: float) -> list[TorsionRow]:
    """Read a catalogue of torsion springs; None selects the bundled catalogue.

    The bundled catalogue has newtons times millimetres per degree and degrees; other rows are in the request's units.
    """
    value = SPRINGS["torsion"] if value is None else value
    bundled = isinstance(value, str) and "\n" not in value
    scale, unit = (millimetres, math.pi / 180) if bundled else (1.0, radian)
    found = []
    for index, row in enumerate(_rows(field, value, "torsion", tuple(SPRINGS.values()), MOST_SPRING_ROWS)):
        at = f"{field}/{index}"
        rate, angle = (_value(at, row, name, 1.0) for name in ("rate", "angle_max"))
        preload, price = _value(at, row, "preload", 1.0, 0.0), _value(at, row, "price", 1.0)
        assert rate is not None and angle is not None and preload is not None
        name = str(row.get("name") or f"row {index + 1}")
        found.append(TorsionRow(name, rate / scale / unit, preload / scale, angle * unit, price))
    return found
