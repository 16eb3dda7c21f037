"""Tables of samples, read as the fields of a request: which field each column holds, its unit, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from linkage_atlas.arguments import MILLIMETRES, Fields, radians_in
from linkage_atlas.cells import ANGLE_NAMES, LENGTH_NAMES, UNITS, Head, Numbers, Sheet, head_of, sheet_of
from linkage_atlas.heads import (
    ANGLES,
    COORDINATE,
    FUNCTIONS,
    NO_POINTS,
    POSES,
    RADIAN_ANGLES,
    ROTATIONS,
    SHARES,
    Kind,
    axis_names,
)
from linkage_atlas.two_points import check_distances
from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError
from synthesis.target import MAX_LENGTH, MAX_SAMPLES, TURN

_EXAMPLES = {
    POSES.described: "x=TX,y=TY,angle=RZ",
    ROTATIONS.described: "angle=RZ",
    FUNCTIONS.described: "input=IN,output=OUT",
}
"""Choices of columns for messages."""
_TWO_POINTS = ("x1", "y1", "x2", "y2")


class Column(NamedTuple):
    """Column of a table with the field and the unit that were read."""

    head: str
    """As written; of a table without heads the number of the column."""
    role: str
    """Field of the request, or `x`, `y`, `x1`, .., `cos`, `sin`."""
    unit: str
    """Unit named by the table; "" if it names none."""


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
    more, chosen = dict(also or {}), _with_aliases(columns, kind)
    reading = _Reading(sheet_of(text, kind.known, tuple(chosen.values())), kind, more, length_unit)
    reading.assign(reading.chosen(chosen) if chosen else reading.recognised())
    reading.read_numbers()
    reading.combine_points()
    for role in kind.angles if unwrap else ():
        if role in reading.values and role not in SHARES:
            reading.values[role] = _unwrapped(reading.values[role], reading.turn)
    found = _poses(reading) if kind is POSES else _rotations(reading) if kind is ROTATIONS else _function(reading)
    table, own = found.get("function"), more.get("function")
    if isinstance(table, dict) and isinstance(own, dict):
        more["function"] = table | own
    fields, rows = found | more, len(reading.sheet.rows)
    if kind is not FUNCTIONS and rows > MAX_SAMPLES:
        raise FieldError("", f"the table has {rows:,} rows, but at most {MAX_SAMPLES:,} are allowed; leave out rows")
    if kind is POSES and not fields.keys() & {"crank_angle", "crank_span", "travel", "travel_span"}:
        fields = {"timing": "free"} | fields
    heads = reading.sheet.heads
    read = [
        Column(heads[k].text if heads else str(k + 1), _word(role), reading.units[k])
        for k, role in reading.roles.items()
    ]
    return Table(fields, reading.length_unit, read, reading.note(), reading.headings, reading.angle_named)


def _with_aliases(columns: Mapping[str, str] | None, kind: Kind) -> dict[str, str]:
    """Return the columns that a user has named by role."""
    if not isinstance(columns, Mapping | None):
        raise FieldError("/columns", f"must be a mapping such as {{'x': 'TX', 'y': 'TY'}}; it is {columns!r}")
    aliases = {"angle": "rotation", "crank": "crank_angle", "theta": "rotation"}
    known = ["x", "y", "angle", "crank", *_TWO_POINTS]
    if kind is FUNCTIONS:
        aliases, known = {"angle": "output", "crank": "input"}, ["input", "output", "x", "y"]
    roles = {*kind.roles} - {"angle"} | ({*_TWO_POINTS} if kind is POSES else set())
    for name in columns or {}:
        if aliases.get(name, name) not in roles:
            raise FieldError.no_such("/columns", name, known + ["cos", "sin"] * ("cos" in roles), "column")
    return {aliases.get(name, name): str(head) for name, head in (columns or {}).items()}


class _Reading:
    """Columns of a table while they are read: which have a role, their units, and their numbers, NaN for a missing number."""

    def __init__(self, sheet: Sheet, kind: Kind, fields: Fields, length_unit: str | None) -> None:
        self.sheet, self.kind, self.length_unit = sheet, kind, length_unit
        self.degrees = fields.get("angle_unit", "deg") != "rad"
        self.turn = 360.0 if self.degrees else TURN
        self.ends = {role: str(unit) for role in ("input", "output") if (unit := fields.get(f"{role}_unit"))}
        """Units of input and output that the request asks for: deg, rad or length."""
        named = tuple(head.text or str(k + 1) for k, head in enumerate(sheet.heads))
        self.headings = named or tuple(str(k + 1) for k in range(sheet.width))
        self.roles: dict[int, str] = {}
        self.units: dict[int, str] = {}
        self.values: dict[str, Floats] = {}
        self.remarks: list[str] = []
        self.angle_named = False

    def refuse(self, message: str) -> FieldError:
        """Return an error of the line of heads that asks for `columns` and carries the heads."""
        words = (
            f"line {self.sheet.line}: {message}; or choose columns, as in columns {_EXAMPLES[self.kind.described]}"
        )
        return FieldError("", words, headings=list(self.headings))

    # -- which column has which role

    def chosen(self, columns: Mapping[str, str]) -> dict[int, str]:
        """Return the roles of the columns that a user has named by head or number."""
        heads, found = self.sheet.heads, dict[int, str]()
        for role, text in columns.items():
            alike = [k for k, head in enumerate(heads) if head.text.casefold() == text.strip().casefold()]
            alike = alike or [k for k, head in enumerate(heads) if head.name and head.name == head_of(text).name]
            if not alike and text.isdigit() and 1 <= int(text) <= self.sheet.width:
                alike = [int(text) - 1]
            if len(alike) != 1 or alike[0] in found:
                there = ", ".join(repr(head.text) for head in heads) or f"{self.sheet.width} columns without headings"
                what = "is named twice" if alike else "is not a column of the table"
                raise FieldError(f"/columns/{_word(role)}", f"{text!r} {what}; there are {there}")
            found[alike[0]] = role
        return found

    def recognised(self) -> dict[int, str]:
        """Return the roles of the columns by their heads, or by their number if there are none."""
        if not self.sheet.heads:
            return self._by_number()
        found: dict[int, str] = {}
        names = [head.name for head in self.sheet.heads]
        for role, known in self.kind.roles.items():
            alike = [k for k, name in enumerate(names) if name in known and k not in found]
            if len(alike) > 1 and role != "angle":
                exact = [k for k in alike if names[k] == role]
                if len(exact) != 1:
                    same = " and ".join(f"'{self.sheet.heads[k].text}'" for k in alike[:3])
                    raise self.refuse(f"the columns {same} may both be {_word(role)}; rename all except one of them")
                alike = exact
            found |= dict.fromkeys(alike, role)
        roles = set(found.values())
        for group, needed in (({"cos", "sin"}, {"cos", "sin"}), ({"qw", "qx", "qy", "qz"}, {"qw", "qz"})):
            if "rotation" in roles or not needed <= roles:
                found = {k: role for k, role in found.items() if role not in group}
        if self.kind is POSES and not roles & {"x", "y"}:
            found |= self._points(names)
        return self._input_and_output(found) if self.kind is FUNCTIONS else found

    def _points(self, names: Sequence[str]) -> dict[int, str]:
        """Return the columns of two points of the body, or of a single labelled point."""
        columns: dict[str, dict[str, int]] = {}
        for k, name in enumerate(names):
            if found := COORDINATE.fullmatch(name):
                label, axis = found["before"] or found["behind"] or "", found["axis"] or found["first"]
                if label not in NO_POINTS:
                    columns.setdefault(label, {})[axis] = k
        points = {label: found for label, found in columns.items() if len(found) == 2}
        if len(points) > 2:
            raise self.refuse(f"the table has {len(points)} points, but a body has one or two; leave out the others")
        numbers = ("1", "2") if len(points) == 2 else ("",)
        roles = {
            point[axis]: f"{axis}{n}" for point, n in zip(points.values(), numbers, strict=False) for axis in "xy"
        }
        for label in points if len(points) == 1 else ():
            angles = {f"{label}_{angle}" for angle in ANGLES}
            roles |= {k: "rotation" for k, name in enumerate(names) if name in angles}
        return roles

    def _input_and_output(self, found: dict[int, str]) -> dict[int, str]:
        """Take columns of angles without a role as the input and output that are missing."""
        angles = [k for k, role in found.items() if role == "angle"]
        missing = [role for role in ("input", "output") if role not in found.values()]
        if {"x", "y"} <= set(found.values()):
            angles = []
        elif len(angles) == 1:
            missing = missing[-1:]
        if len(angles) > len(missing):
            same = ", ".join(f"'{self.sheet.heads[k].text}'" for k in angles)
            raise self.refuse(f"the columns {same} may be input or output; name them input and output")
        remaining = {k: role for k, role in found.items() if role != "angle"}
        return remaining | dict(zip(sorted(angles), missing, strict=False))

    def _by_number(self) -> dict[int, str]:
        """Return the roles of columns without headings; refuse columns whose numbers may mean something else."""
        rows, max_columns = self.sheet.rows, max(self.kind.bare)
        width = self.sheet.width if len(rows) > 1 else len(list(filter(None, rows[0].cells)))
        width = max(width, min(self.sheet.width, max_columns))
        roles = self.kind.bare.get(width)
        if roles is None:
            words = f"give 1 to {max_columns} columns, or a line of headings above them"
            raise self.refuse(f"the table has {width} columns; {words}")
        if self.kind is POSES and len(rows) > 1:
            self._check_bare([[*row.cells, *[""] * len(roles)][: len(roles)] for row in rows])
        self.remarks.append("columns without headings were read as " + ", ".join(map(_word, roles)))
        return dict(enumerate(roles))

    def _check_bare(self, cells: list[list[str]]) -> None:
        numbers = Numbers([cell for row in cells for cell in row])
        try:
            rows = np.array([[numbers.read(cell, "", True).value for cell in row] for row in cells], dtype=float)
        except FieldError:
            return  # reported with its line and column when the numbers are read
        if np.isnan(rows).any():
            return
        if rows.shape[1] == 3 and not np.ptp(rows[:, 2]):
            raise self.refuse(
                f"the third of three columns without headings is {rows[0, 2]:g} in every row, which may be a z or an angle; "
                "write x,y,z or x,y,angle above them"
            )
        if rows.shape[1] != 4:
            return
        steps, lengths = np.diff(rows[:, 0]), np.hypot(*(rows[:, 2:] - rows[:, :2]).T)
        is_crank = (steps.min() > 0 or steps.max() < 0) and abs(rows[-1, 0] - rows[0, 0]) <= 360
        is_number = rows[0, 0] in (0, 1) and np.all(steps == 1)
        is_rigid = len(lengths) > 2 and np.ptp(lengths) < 0.05 * lengths.max()
        is_unit = np.all(np.abs(np.hypot(*rows[:, 2:].T) - 1) < 0.02)
        if not is_crank or is_number or is_rigid or is_unit:
            raise self.refuse(
                "four columns without headings may be crank,x,y,angle or number,x,y,angle or x1,y1,x2,y2 or x,y,cos,sin; write "
                "one of these lines above them"
            )

    # -- units and numbers

    def assign(self, roles: dict[int, str]) -> None:
        """Take the roles of columns and check the units in their heads."""
        self.roles = dict(sorted(roles.items()))
        for k, role in self.roles.items():
            head = self.sheet.heads[k] if self.sheet.heads else Head("", "", "")
            unit = self._unit_of(head.unit, role, f"line {self.sheet.line}: the heading '{head.text[:30]}'")
            self.units[k] = unit or ("rad" if head.name in RADIAN_ANGLES else "")

    def _unit_of(self, text: str, role: str, where: str) -> str:
        """Return the unit that a text names for a column of a role; FieldError if there is none."""
        name, known = text.strip().lower(), list[str]()
        if role in self.kind.lengths or (self.kind is FUNCTIONS and role in ("input", "output")):
            known += MILLIMETRES
        known += ANGLE_NAMES if role in self.kind.angles else ()
        is_pure = role in ("x", "y") and self.kind is FUNCTIONS
        if not name or is_pure or (not known and name in ("-", "1", "%")):
            return ""
        unit = UNITS.get(name, "")
        if unit not in known:
            there = f"use one of {', '.join(known)}" if known else "remove it, because this column has no unit"
            raise FieldError(
                "", f"{where} has the unit '{text[:20]}', which is not a known unit of {_word(role)}; {there}"
            )
        return unit

    def read_numbers(self) -> None:
        """Read the cells of all columns that have a role, and convert them to a common unit of length and a unit of angle."""
        if self.kind is POSES and len({"x", "y"} & set(self.roles.values())) == 1:
            raise self.refuse("give both x and y, or neither")
        width, heads, found = self.sheet.width, self.sheet.heads, dict[str, list[float]]()
        numbers = Numbers([cell for row in self.sheet.rows for k, cell in enumerate(row.cells) if k in self.roles])
        for line, cells in self.sheet.rows:
            while len(cells) > width and not cells[-1]:
                cells = cells[:-1]
            if len(cells) != width:
                commas = "; put numbers with a decimal comma in quotes, or separate the cells by semicolons"
                message = f"line {line}: the line must have {width} cells; it has {len(cells)}"
                raise FieldError("", message + (commas if len(cells) > width else ""))
            for k, role in self.roles.items():
                where = f"line {line}, column {k + 1}{f' ({heads[k].text[:20]})' if heads else ''}: "
                value, text = numbers.read(cells[k], where, self.kind.gaps)
                if value is not None and not abs(value) <= MAX_LENGTH:
                    bound = f"more than {MAX_LENGTH:g}" if value > 0 else f"less than {-MAX_LENGTH:g}"
                    raise FieldError("", f"{where}'{cells[k][:20]}' is {bound}")
                found.setdefault(role, []).append(math.nan if value is None else value)
                unit = self._unit_of(text, role, where + "the number") if text else ""
                if unit and self.units[k] not in ("", unit):
                    raise FieldError("", f"{where}the number is in {unit}, the column in {self.units[k]}")
                self.units[k] = unit or self.units[k]
        self.values = {role: np.array(values) for role, values in found.items()}
        self._convert()

    def _convert(self) -> None:
        units = {role: self.units[k] for k, role in self.roles.items()}
        own = next((unit for unit in units.values() if unit in LENGTH_NAMES), None)
        self.angle_named = all(unit for role, unit in units.items() if role in self.kind.angles)
        if own is not None:
            self.length_unit = self.length_unit or own
        for role, unit in units.items():
            quantity, is_length = self.ends.get(role, ""), unit in LENGTH_NAMES
            if own is not None and (is_length or (role in self.kind.lengths and not unit)):
                self._scale(role, MILLIMETRES[unit or own] / MILLIMETRES[str(self.length_unit)])
            if unit and quantity and (quantity == "length") != is_length:
                kind = "a length" if is_length else "an angle"
                raise FieldError(f"/{role}_unit", f"is {quantity!r}, and the table has {kind} in {unit} for {role}")
            target_unit = quantity if quantity in ANGLE_NAMES else "deg" if self.degrees else "rad"
            if unit in ANGLE_NAMES and unit != target_unit:
                self._scale(role, radians_in(unit == "deg") / radians_in(target_unit == "deg"))

    def _scale(self, role: str, factor: float) -> None:
        if factor != 1:
            self.values[role] = np.array([float(f"{value * factor:.15g}") for value in self.values[role]])

    def combine_points(self) -> None:
        """Make a rotation of cosine and sine, of a quaternion, or of two points of the body."""
        values, line = self.values, f"line {self.sheet.line}"
        if {"qw", "qz"} <= values.keys():
            if any(np.any(np.abs(values.pop(name, np.zeros(1))) > 0.05) for name in ("qx", "qy")):
                raise FieldError("", f"{line}: the quaternions tilt the body out of the plane: qx and qy must be 0")
            values["rotation"] = self._directions(values.pop("qw") + 1j * values.pop("qz"), 2.0)
        elif {"cos", "sin"} <= values.keys():
            values["rotation"] = self._directions(values.pop("cos") + 1j * values.pop("sin"), 1.0)
        elif values.keys() & {"cos", "sin"}:
            raise FieldError("", f"{line}: give both cos and sin")
        if not values.keys() & {*_TWO_POINTS}:
            return
        if not {*_TWO_POINTS} <= values.keys():
            raise FieldError("", f"{line}: give all of x1, y1, x2 and y2")
        if "rotation" in values:
            raise FieldError("", f"{line}: give either two points or an angle, not both")
        values["x"], values["y"], x, y = (values.pop(name) for name in _TWO_POINTS)
        along = x - values["x"] + 1j * (y - values["y"])
        lines = [row.line for row in self.sheet.rows]
        remark = check_distances(along, lambda index, message: FieldError("", f"line {lines[index]}: {message}"))
        self.remarks += [] if remark is None else [remark]
        values["rotation"] = self._directions(along)

    def _directions(self, vectors: Complexes, factor: float | None = None) -> Floats:
        """Return continuous angles of vectors; of unit vectors with a factor that multiplies the angles."""
        self.angle_named = True
        for row, vector in zip(self.sheet.rows, vectors.tolist()):
            if factor and abs(abs(vector) - 1) >= 0.05:
                pair = f"({vector.real:g}, {vector.imag:g})"
                raise FieldError("", f"line {row.line}: {pair} is not a cosine and a sine, whose squares sum to 1")
        angles = (factor or 1.0) * np.angle(vectors) / radians_in(self.degrees)
        return np.array([float(f"{angle:.12g}") for angle in _unwrapped(angles, self.turn)])

    def note(self) -> str:
        """Return a sentence on the columns that were read."""
        parts, unit_name = list(self.remarks), "degrees" if self.degrees else "radians"
        if self.sheet.heads:
            read = []
            for k, role in self.roles.items():
                named, text = self.units[k], self.sheet.heads[k].text
                # a unit of a row of units or of the cells
                beside = f" in {named}" if named and not head_of(text).unit else ""
                converted = f" (converted to {unit_name})" if named in ANGLE_NAMES and named != unit_name[:3] else ""
                if named in LENGTH_NAMES and self.length_unit not in (None, named):
                    converted = f" (converted to {self.length_unit})"
                read.append(f"{_word(role)} from '{text[:40]}'{beside}{converted}")
            parts.insert(0, "columns read: " + ", ".join(read))
            left = [head.text for k, head in enumerate(self.sheet.heads) if k not in self.roles and head.text]
            if left:
                more = f" and {len(left) - 6} more" if len(left) > 6 else ""
                parts.append("not read: " + ", ".join(f"'{text[:40]}'" for text in left[:6]) + more)
        roles = set(self.roles.values())
        if {"x1", "x2"} <= roles:
            parts.append("the body point is x1, y1, and the angle is the direction from there to x2, y2")
        if "cos" in roles or "qw" in roles:
            parts.append(f"the angle is computed from {'cos and sin' if 'cos' in roles else 'the quaternions'}")
        for name, words in (("rotation", "angle"), ("x", "position")):
            lacking = (np.flatnonzero(np.isnan(self.values.get(name, np.zeros(0)))) + 1).tolist()
            if lacking:
                which = ", ".join(map(str, lacking[:6])) + (" and more" if len(lacking) > 6 else "")
                parts.append(f"no {words} for sample{'s' if len(lacking) > 1 else ''} {which}")
        return "; ".join(parts)


def _word(role: str) -> str:
    """Return the name of a role for a user."""
    return {"rotation": "angle", "crank_angle": "crank"}.get(role, role)


def _unwrapped(angles: Floats, turn: float) -> Floats:
    """Move angles by whole turns to within half a turn of the angle before; missing angles are passed over."""
    found, before = angles.copy(), math.nan
    for k in np.flatnonzero(~np.isnan(angles)):
        if not math.isnan(before):
            found[k] -= turn * round((found[k] - before) / turn)
        before = found[k]
    return found


def _listed(values: Floats) -> list[float | None]:
    """Return numbers as a list with None for missing numbers."""
    return [None if math.isnan(value) else value for value in values.tolist()]


# -- fields of the questions --------------------------------------------------------------------------------------------


def _poses(reading: _Reading) -> dict[str, object]:
    """Return rotation, position, crank angles, weights and tolerances."""
    columns, rows = reading.values, reading.sheet.rows

    def first_missing(name: str) -> int | None:
        missing = np.isnan(columns.get(name, np.zeros(0)))
        return rows[int(np.argmax(missing))].line if missing.any() else None

    if (line := first_missing("crank_angle")) is not None:
        raise FieldError("", f"line {line}: the cell is empty; enter a number for the crank angle")
    request: dict[str, object] = {
        name: _listed(columns[name]) for name in ("crank_angle", "rotation") if name in columns
    }
    if "x" in columns:
        half = np.flatnonzero(np.isnan(columns["x"]) != np.isnan(columns["y"]))
        if half.size:
            raise FieldError("", f"line {rows[half[0]].line}: give both x and y, or neither")
        pairs = zip(_listed(columns["x"]), _listed(columns["y"]))
        request["position"] = [None if x is None else [x, y] for x, y in pairs]
    parts = request.keys() & {"rotation", "position"}
    if not parts:
        heads = ", ".join(f"'{head.text[:20]}'" for head in reading.sheet.heads[:8])
        described = f"none of the headings {heads} is recognized as x and y or as angle; give {POSES.described}"
        raise reading.refuse(described)
    _check_plane(reading)
    shares: dict[str, dict[str, list[float]]] = {}
    for name in [name for name in SHARES if name in columns]:
        what, _, part = name.partition("_")
        if part and part not in parts:
            needed = "a column of angles" if part == "rotation" else "x and y"
            raise FieldError("", f"line {reading.sheet.line}: {name} needs {needed}")
        if what == "tolerance" and (line := first_missing(name)) is not None:
            raise FieldError("", f"line {line}: enter a number for {name}")
        values = np.where(np.isnan(columns[name]), 1.0, columns[name]).tolist()
        shares.setdefault(f"{what}s", {}).update(dict.fromkeys([part] if part else sorted(parts), values))
    return request | shares


def _check_plane(reading: _Reading) -> None:
    """Refuse a motion in another plane than x and y, and remark on a z that varies."""
    axis = {head.name: k for k, head in enumerate(reading.sheet.heads)}
    at = next(
        (axis[name] for name in sorted(axis_names("z", 2)) if name in axis and axis[name] not in reading.roles), None
    )
    if at is None or "x" not in reading.values:
        return
    texts = {row.cells[at].strip() for row in reading.sheet.rows if at < len(row.cells)}
    still = [name for name in ("x", "y") if len(set(_listed(reading.values[name]))) == 1]
    if len(texts) > 1 and still and len(reading.sheet.rows) > 1:
        raise reading.refuse(
            f"{still[0]} is the same in every row and '{reading.sheet.heads[at].text}' is not, "
            "so that the motion lies in another plane; name the columns of its plane x and y"
        )
    if len(texts) > 1:
        text = reading.sheet.heads[at].text
        reading.remarks.append(f"'{text}' varies and is ignored, the motion is taken as plane")


def _rotations(reading: _Reading) -> dict[str, object]:
    """Return rotation and crank angles."""
    if "rotation" not in reading.values:
        raise reading.refuse("a column of angles with the heading angle is required")
    return {name: _listed(values) for name, values in reading.values.items()}


def _function(reading: _Reading) -> dict[str, object]:
    """Return input and output, or the table of a function."""
    columns = {name: _listed(values) for name, values in reading.values.items()}
    if {"x", "y"} <= columns.keys():
        pairs = [list(pair) for pair in zip(columns.pop("x"), columns.pop("y"))]
        return {**columns, "function": {"table": pairs}}
    if "output" not in columns or columns.keys() & {"x", "y"}:
        raise reading.refuse("columns with the headings input and output, or x and y, are required")
    units = {role: reading.units[k] for k, role in reading.roles.items()}
    return columns | {f"{role}_unit": "length" for role, unit in units.items() if unit in LENGTH_NAMES}
