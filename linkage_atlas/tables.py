"""Tables of samples, read as the fields of a request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from linkage_atlas.arguments import Fields
from linkage_atlas.cells import LENGTH_NAMES, sheet_of
from linkage_atlas.columns import Column, Reading, with_aliases
from linkage_atlas.heads import FUNCTIONS, POSES, ROTATIONS, SHARES, Kind, axis_names
from synthesis.errors import FieldError
from synthesis.target import MAX_SAMPLES


@dataclass(frozen=True)
class Table:
    """Samples read from a table, as the fields of a request."""

    fields: dict[str, object]
    """Angles are in the unit that the request asks for, degrees by default."""
    length_unit: str | None
    """Unit of the lengths; None if the table names none."""
    columns: list[Column]
    note: str
    """Sentence on the columns that were read."""
    headings: tuple[str, ...]
    """All columns of the table; without heads their numbers."""
    angle_named: bool = field(default=False, repr=False)
    """True if the table names the unit of its angles."""


def read_columns(text: str) -> dict[str, str]:
    """Read ``x=TX,y=TY,angle=RZ`` as a mapping of fields to heads. Raises `FieldError`."""
    pairs = [part.partition("=") for part in text.split(",") if part.strip()]
    if not pairs or not all(equals and name.strip() and head.strip() for name, equals, head in pairs):
        raise FieldError("/columns", f"must be pairs such as x=TX,y=TY,angle=RZ; it is {text[:60]!r}")
    return {name.strip(): head.strip() for name, _, head in pairs}


def read_table(
    text: str,
    kind: Kind = POSES,
    also: Fields | None = None,
    unwrap: bool = False,
    columns: Mapping[str, str] | None = None,
    length_unit: str | None = None,
) -> Table:
    r"""Read a table of samples.

    Cells are separated by tabs, semicolons, bars, commas or blanks. A comma in a number is its decimal mark unless commas
    separate cells; a table in which some numbers have a decimal comma and others a decimal point is refused. Titles above the
    heads and comments (#, %, //) are ignored, and so are columns that have no role.

    Parameters
    ----------
    text : str
    kind : Kind
        Question that the table belongs to: `POSES`, `ROTATIONS` or `FUNCTIONS`.
    also : mapping, optional
        Further fields of the request. Their unit of angle, ``angle_unit``, is the unit that the table's angles are converted to.
    unwrap : bool
        Move each angle by whole turns to within half a turn of the angle before it.
    columns : mapping, optional
        Head of the column for each of x, y, angle, crank, x1, y1, x2, y2, cos, sin, input, output; or its number, from 1. Only
        these columns are read. Default: columns are recognised by their heads.
    length_unit : str, optional
        Unit that lengths are converted to. Default: the unit of the table.

    Raises
    ------
    FieldError
        Naming the line, and the column if one cell is wrong. If the columns have to be chosen its details have ``headings``.

    Examples
    --------
    >>> from linkage_atlas.tables import read_table
    >>> table = read_table("TX [cm];TY [cm];RZ [rad];Frame\n0;0;0;1\n1,5;2;1,5708;2")
    >>> table.length_unit, [round(angle) for angle in table.fields["rotation"]]
    ('cm', [0, 90])
    >>> print(table.note)
    columns read: x from 'TX [cm]', y from 'TY [cm]', angle from 'RZ [rad]' (converted to degrees); not read: 'Frame'
    """
    more, chosen = dict(also or {}), with_aliases(columns, kind)
    sheet = sheet_of(text, kind.known, tuple(chosen.values()))
    reading = Reading(sheet, kind, more.get("angle_unit", "deg") != "rad", length_unit)
    reading.ends = {role: str(unit) for role in ("input", "output") if (unit := more.get(f"{role}_unit"))}
    reading.assign(reading.chosen(chosen) if chosen else reading.recognised())
    reading.read_numbers()
    reading.combine_points()
    if unwrap:
        reading.unwrap()
    found = _poses(reading) if kind is POSES else _rotations(reading) if kind is ROTATIONS else _function(reading)
    table, own = found.get("function"), more.get("function")
    if isinstance(table, dict) and isinstance(own, dict):
        more["function"] = table | own
    fields = found | more
    if kind is not FUNCTIONS and len(sheet.rows) > MAX_SAMPLES:
        raise FieldError(
            "", f"the table has {len(sheet.rows):,} rows, but at most {MAX_SAMPLES:,} are allowed; leave out rows"
        )
    if kind is POSES and not fields.keys() & {"crank_angle", "crank_span", "travel", "travel_span"}:
        fields = {"timing": "free"} | fields
    return Table(
        fields, reading.length_unit, reading.columns(), reading.note(), reading.headings, reading.angle_named
    )


def _poses(reading: Reading) -> dict[str, object]:
    """Return rotation, position, crank angles, weights and tolerances."""
    columns, rows = reading.values, reading.sheet.rows
    if "crank_angle" in columns and None in columns["crank_angle"]:
        line = rows[columns["crank_angle"].index(None)].line
        raise FieldError("", f"line {line}: the cell is empty; enter a number for the crank angle")
    request: dict[str, object] = {name: columns[name] for name in ("crank_angle", "rotation") if name in columns}
    if "x" in columns:
        pairs = list(zip(columns["x"], columns["y"]))
        if half := [row.line for row, pair in zip(rows, pairs) if (pair[0] is None) != (pair[1] is None)]:
            raise FieldError("", f"line {half[0]}: give both x and y, or neither")
        request["position"] = [None if None in pair else list(pair) for pair in pairs]
    parts = request.keys() & {"rotation", "position"}
    if not parts:
        heads = ", ".join(f"'{head.text[:20]}'" for head in reading.sheet.heads[:8])
        raise reading.refuse(
            f"none of the headings {heads} is recognized as x and y or as angle; give {POSES.described}", True
        )
    _check_plane(reading)
    shares: dict[str, dict[str, list[float]]] = {}
    for name in SHARES:
        if name not in columns:
            continue
        what, _, part = name.partition("_")
        if part and part not in parts:
            raise FieldError(
                "",
                f"line {reading.sheet.line}: {name} needs {'a column of angles' if part == 'rotation' else 'x and y'}",
            )
        if what == "tolerance" and None in columns[name]:
            raise FieldError("", f"line {rows[columns[name].index(None)].line}: enter a number for {name}")
        values = [1.0 if value is None else value for value in columns[name]]
        shares.setdefault(f"{what}s", {}).update(dict.fromkeys([part] if part else sorted(parts), values))
    return request | shares


def _check_plane(reading: Reading) -> None:
    """Refuse a motion in another plane than x and y, and remark on a z that varies."""
    axis = {head.name: k for k, head in enumerate(reading.sheet.heads)}
    at = next(
        (axis[name] for name in sorted(axis_names("z", 2)) if name in axis and axis[name] not in reading.roles), None
    )
    if at is None or "x" not in reading.values:
        return
    texts = {row.cells[at].strip() for row in reading.sheet.rows if at < len(row.cells)}
    still = [name for name in ("x", "y") if len(set(reading.values[name])) == 1]
    if len(texts) > 1 and still and len(reading.sheet.rows) > 1:
        raise reading.refuse(
            f"{still[0]} is the same in every row and '{reading.sheet.heads[at].text}' is not, "
            "so that the motion lies in another plane; name the columns of its plane x and y",
            True,
        )
    if len(texts) > 1:
        reading.remarks.append(
            f"'{reading.sheet.heads[at].text}' varies and is ignored, the motion is taken as plane"
        )


def _rotations(reading: Reading) -> dict[str, object]:
    """Return rotation and crank angles."""
    if "rotation" not in reading.values:
        raise reading.refuse("a column of angles with the heading angle is required", True)
    return dict(reading.values)


def _function(reading: Reading) -> dict[str, object]:
    """Return input and output, or the table of a function."""
    columns = dict(reading.values)
    if {"x", "y"} <= columns.keys():
        pairs = [list(pair) for pair in zip(columns.pop("x"), columns.pop("y"))]
        return {**columns, "function": {"table": pairs}}
    if "output" not in columns or columns.keys() & {"x", "y"}:
        raise reading.refuse("columns with the headings input and output, or x and y, are required", True)
    units = {role: reading.units[k] for k, role in reading.roles.items()}
    return columns | {f"{role}_unit": "length" for role, unit in units.items() if unit in LENGTH_NAMES}
