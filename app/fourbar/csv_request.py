"""A motion as a CSV file: a row a sample; without a column of crank angles they are free."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

from linkage_atlas import FieldError

COLUMNS = {
    **dict.fromkeys(("crank", "crank_angle", "theta1", "t"), "crank_angle"),
    **dict.fromkeys(("x", "y"), ""),
    **dict.fromkeys(("angle", "rotation", "gamma"), "rotation"),
}
"""Names of columns, and the field of the request that each fills."""


def request_from_csv(text: str) -> dict[str, Any]:
    """The body of /v1/synthesize that a CSV file asks for, angles in degrees.

    The first line names the columns: x and y, rotation (or angle, gamma), crank_angle (or crank, theta1, t). An empty cell
    of rotation, or of x and y, is a sample without it. Separated by commas, semicolons or tabs; with these two a comma in a
    number is its decimal point.

    Raises
    ------
    FieldError
        Naming the line.
    """
    lines = [line for line in text.lstrip("\ufeff").splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise FieldError("", "the file has no rows: wanted a line of names and a line for each sample")
    separator = next((mark for mark in (";", "\t") if mark in lines[0]), ",")
    head, *rows = csv.reader(io.StringIO("\n".join(lines)), delimiter=separator)
    names = [re.split(r"[^a-z0-9_]", name.strip().lower())[0] for name in head]
    if unknown := [name for name in names if name not in COLUMNS]:
        raise FieldError("", f"line 1: there is no column '{unknown[0]}'; there are {', '.join(COLUMNS)}")
    columns: dict[str, list[float | None]] = {name: [] for name in names}
    for number, row in enumerate(rows, 2):
        if len(row) != len(names):
            raise FieldError("", f"line {number}: wanted {len(names)} cells, found {len(row)}")
        for name, cell in zip(names, row):
            columns[name].append(_number(cell.strip(), separator, number))
    request: dict[str, Any] = {COLUMNS[name]: values for name, values in columns.items() if COLUMNS[name]}
    if ("x" in columns) != ("y" in columns):
        raise FieldError("", "line 1: wanted both x and y, or neither")
    if "x" in columns:
        pairs = list(zip(columns["x"], columns["y"]))
        if half := [number for number, pair in enumerate(pairs, 2) if (pair[0] is None) != (pair[1] is None)]:
            raise FieldError("", f"line {half[0]}: wanted both x and y, or neither")
        request["position"] = [None if None in pair else list(pair) for pair in pairs]
    if "crank_angle" not in request:
        request["timing"] = "free"
    return request


def _number(cell: str, separator: str, line: int) -> float | None:
    if not cell:
        return None
    try:
        return float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        raise FieldError("", f"line {line}: '{cell[:20]}' is not a number") from None
