"""Samples as a table, CSV or pasted from a spreadsheet, made into the body of a request."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from linkage_atlas import FieldError

COLUMNS = {
    **dict.fromkeys(("crank", "crank_angle", "theta1", "t"), "crank_angle"),
    "x": "x",
    "y": "y",
    **dict.fromkeys(("angle", "rotation", "gamma", "phi", "theta", "\u03b3", "\u03c6", "\u03b8"), "rotation"),
    **dict.fromkeys(("no", "nr", "n", "pose", "point", "sample", "index"), None),
}
"""Names of columns and what each holds; None: a number of the row, which is not read."""
KNOWN = "x, y; rotation, angle, phi, theta, gamma; crank_angle, crank, theta1, t"
BY_NUMBER = {1: ("rotation",), 2: ("x", "y"), 3: ("x", "y", "rotation"), 4: ("crank_angle", "x", "y", "rotation")}
"""What the columns of a table without names hold, by how many there are."""
ANGLES = ("crank_angle", "rotation")


class _Row(NamedTuple):
    line: int
    """Of the file, from 1."""
    cells: list[str]


def request_from_csv(text: str, also: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The body of /v1/synthesize that a table asks for, angles in degrees unless the heads of their columns say rad.

    The first line names the columns: x and y, rotation (or angle, phi, theta, gamma), crank_angle (or crank, theta1, t), each
    perhaps with a unit behind it. Without names two columns are x and y, three x, y, rotation, four crank_angle, x, y, rotation,
    one rotation. An empty cell of rotation, or of x and y, is a sample without it. Fields in ``also`` join those of the table.
    Without crank angles in either they are free.

    Cells are separated by tabs, semicolons, commas or spaces. A comma in a number is its decimal point where cells are not
    separated by commas, or where it is quoted; a table that writes some numbers so and others with a point is refused.

    Raises
    ------
    FieldError
        Naming the line.
    """
    separator, rows = _rows(text)
    names, unit = _names(rows)
    if not rows:
        raise FieldError("", "the table has no rows: wanted a line for each sample, perhaps below a line of names")
    columns = _numbers(names, rows, separator)
    request: dict[str, Any] = {name: values for name, values in columns.items() if name in ANGLES}
    if ("x" in columns) != ("y" in columns):
        raise FieldError("", "line 1: wanted both x and y, or neither")
    if "x" in columns:
        pairs = list(zip(columns["x"], columns["y"]))
        if half := [row.line for row, pair in zip(rows, pairs) if (pair[0] is None) != (pair[1] is None)]:
            raise FieldError("", f"line {half[0]}: wanted both x and y, or neither")
        request["position"] = [None if None in pair else list(pair) for pair in pairs]
    if not request.keys() & {"rotation", "position"}:
        raise FieldError("", "line 1: wanted x and y, or rotation, or both")
    if unit == "rad":
        request["angle_unit"] = unit
    request |= also or {}
    return request if request.keys() & {"crank_angle", "crank_span"} else {"timing": "free"} | request


def _rows(text: str) -> tuple[str, list[_Row]]:
    """What separates the cells, and the lines that are neither empty nor a comment."""
    lines = [
        (number, line)
        for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    bare = [re.sub('"[^"]*"', "", line) for _, line in lines]
    for separator in "\t;":
        if any(separator in line for line in bare):
            break
    else:
        first = re.sub(r"[(\[][^)\]]*[)\]]", "", bare[0]).strip() if bare else ""
        # numbers behind spaces that no comma ends are cells of their own: "1,5 2,5", and not "1, 5"
        spaced = not _is_head(first) and re.search(r"[^,\s]\s+[^,\s]", first)
        separator = " " if spaced or "," not in first else ","
    if separator == " ":
        return separator, [_Row(number, _words(line)) for number, line in lines]
    return separator, [_Row(number, _cells(line, separator, number)) for number, line in lines]


def _cells(line: str, separator: str, number: int) -> list[str]:
    """The cells of one line; a quote that is not closed ends with it."""
    try:
        (row,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    except csv.Error as error:
        raise FieldError("", f"line {number}: {error}") from None
    return [cell.strip() for cell in row]


def _is_head(cell: str) -> bool:
    """Whether a cell, or a line, begins with a name."""
    return re.match(r"[^\W\d]", cell) is not None


def _words(line: str) -> list[str]:
    """The cells of a line that spaces separate; a unit in brackets belongs to the name before it."""
    return re.sub(r"\s+([(\[])", r"\1", line).split()


def _names(rows: list[_Row]) -> tuple[list[str | None], str]:
    """What each column holds, and the unit of angles; takes the line of names from the rows."""
    if not rows:
        return [], "deg"
    head = rows[0]
    if not any(map(_is_head, head.cells)):
        if len(head.cells) not in BY_NUMBER:
            raise FieldError(
                "", f"line {head.line}: wanted 1 to 4 columns, or names above them, found {len(head.cells)}"
            )
        return list(BY_NUMBER[len(head.cells)]), "deg"
    rows.pop(0)
    names: list[str | None] = []
    units = set()
    for cell in _trimmed(head.cells, 1):
        found = re.fullmatch(r"(\w+)(|[\s(\[/].*)", cell.lower())  # a name, and perhaps a unit
        if found is None or found[1] not in COLUMNS:
            raise FieldError("", f"line {head.line}: there is no column '{cell[:20]}'; there are {KNOWN}")
        word, behind = found.groups()
        name = COLUMNS[word]
        if name is not None and name in names:
            raise FieldError("", f"line {head.line}: two columns hold {name.replace('_', ' ')}")
        names.append(name)
        if name in ANGLES:
            units.add("rad" if re.search(r"\brad", behind) else "deg")
    if len(units) > 1:
        raise FieldError("", f"line {head.line}: wanted all angles in one unit, found degrees and radians")
    return names, units.pop() if units else "deg"


def _trimmed(cells: list[str], least: int) -> list[str]:
    """The cells without empty ones beyond the least number, as a separator at the end of a line makes one."""
    while len(cells) > least and not cells[-1]:
        cells = cells[:-1]
    return cells


def _numbers(names: list[str | None], rows: list[_Row], separator: str) -> dict[str, list[float | None]]:
    """The columns that are read; a mark for decimals is one mark in the whole table."""
    columns: dict[str, list[float | None]] = {name: [] for name in names if name is not None}
    mark = ""
    for line, cells in rows:
        cells = _trimmed(cells, len(names))
        if len(cells) != len(names):
            raise FieldError("", f"line {line}: wanted {len(names)} cells, found {len(cells)}")
        for name, cell in zip(names, cells):
            if name is None:
                continue
            found = "".join(sorted(set(cell) & set(".,")))
            if (found and mark and found != mark) or len(found) > 1:
                raise FieldError(
                    "",
                    f"line {line}: '{cell[:20]}': wanted one decimal mark in the whole table, found comma and point",
                )
            mark = mark or found
            columns[name].append(_number(cell, line))
    return columns


def _number(cell: str, line: int) -> float | None:
    cell = cell.replace("\u2212", "-").removesuffix("\u00b0").strip()
    if not cell:
        return None
    plain = cell.replace(",", ".")
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", plain, re.ASCII):
        raise FieldError("", f"line {line}: '{cell[:20]}' is not a number")
    return float(plain)
