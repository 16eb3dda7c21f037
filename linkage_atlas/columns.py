"""Columns of a table: the field that each holds, its unit, and its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from linkage_atlas.arguments import MILLIMETRES, radians_in
from linkage_atlas.cells import ANGLE_NAMES, LENGTH_NAMES, UNITS, Head, Numbers, Sheet, head_of
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
)
from linkage_atlas.two_points import check_distances
from synthesis.errors import FieldError
from synthesis.target import MAX_LENGTH


class Column(NamedTuple):
    """Column of a table with the field and the unit that were read."""

    head: str
    """As written; of a table without heads the number of the column."""
    role: str
    """Field of the request, or `x`, `y`, `x1`, .., `cos`, `sin`."""
    unit: str
    """Unit named by the table; "" if it names none."""


_EXAMPLES = {
    POSES.described: "x=TX,y=TY,angle=RZ",
    ROTATIONS.described: "angle=RZ",
    FUNCTIONS.described: "input=IN,output=OUT",
}
"""Choices of columns for messages."""
_ALIASES = {"angle": "rotation", "rotation": "rotation", "crank": "crank_angle", "theta": "rotation"}


def with_aliases(columns: Mapping[str, str] | None, kind: Kind) -> dict[str, str]:
    """Return the columns that a user has named by role."""
    aliases = {"angle": "output", "crank": "input"} if kind is FUNCTIONS else _ALIASES
    roles = {role for role in kind.roles if role != "angle"} | ({"x1", "y1", "x2", "y2"} if kind is POSES else set())
    found = {}
    if not isinstance(columns, Mapping | None):
        raise FieldError("/columns", f"must be a mapping such as {{'x': 'TX', 'y': 'TY'}}; it is {columns!r}")
    for name, head in (columns or {}).items():
        role = aliases.get(name, name)
        if role not in roles:
            known = (
                ("input", "output", "x", "y")
                if kind is FUNCTIONS
                else ("x", "y", "angle", "crank", "x1", "y1", "x2", "y2")
            )
            raise FieldError.no_such(
                "/columns", name, (*known, *(("cos", "sin") if "cos" in roles else ())), "column"
            )
        found[role] = str(head)
    return found


class Reading:
    """Columns of a table while they are read: which have a role, their units, their numbers."""

    def __init__(self, sheet: Sheet, kind: Kind, degrees: bool, length_unit: str | None) -> None:
        self.sheet, self.kind, self.degrees, self.length_unit = sheet, kind, degrees, length_unit
        self.roles: dict[int, str] = {}
        self.units: dict[int, str] = {}
        self.values: dict[str, list[float | None]] = {}
        self.ends: dict[str, str] = {}
        """Units of input and output that the request asks for: deg, rad or length."""
        self.remarks: list[str] = []
        self.angle_named = False

    # -- which column has which role

    def refuse(self, message: str, choose: bool = False) -> FieldError:
        """Return an error of the line of heads; with ``choose`` it asks for `columns` and carries the heads."""
        if not choose:
            return FieldError("", f"line {self.sheet.line}: {message}")
        example = _EXAMPLES[self.kind.described]
        return FieldError(
            "",
            f"line {self.sheet.line}: {message}; or choose columns, as in columns {example}",
            headings=list(self.headings),
        )

    @property
    def headings(self) -> tuple[str, ...]:
        """Heads of all columns, or their numbers."""
        named = tuple(head.text or str(k + 1) for k, head in enumerate(self.sheet.heads))
        return named or tuple(str(k + 1) for k in range(self.sheet.width))

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
        return self._by_heads() if self.sheet.heads else self._by_number()

    def _by_heads(self) -> dict[int, str]:
        found: dict[int, str] = {}
        names = [head.name for head in self.sheet.heads]
        for role, known in self.kind.roles.items():
            alike = [k for k, name in enumerate(names) if name in known and k not in found]
            if len(alike) > 1 and role != "angle":
                exact = [k for k in alike if names[k] == role]
                if len(exact) != 1:
                    same = " and ".join(f"'{self.sheet.heads[k].text}'" for k in alike[:3])
                    raise self.refuse(
                        f"the columns {same} may both be {_word(role)}; rename all except one of them", True
                    )
                alike = exact
            found |= dict.fromkeys(alike, role)
        roles = set(found.values())
        for pair in ({"cos", "sin"}, {"qw", "qx", "qy", "qz"}):
            if roles & pair and ("rotation" in roles or not {"cos", "sin", "qw", "qz"} & pair <= roles):
                found = {k: role for k, role in found.items() if role not in pair}
        if self.kind is POSES and not roles & {"x", "y"}:
            found |= self._two_points(names)
        if self.kind is FUNCTIONS:
            found = self._input_and_output(found)
        return found

    def _two_points(self, names: Sequence[str]) -> dict[int, str]:
        """Return the columns of two points of the body, or of a single labelled point."""
        columns: dict[str, dict[str, int]] = {}
        for k, name in enumerate(names):
            if found := COORDINATE.fullmatch(name):
                label, axis = found["before"] or found["behind"] or "", found["axis"] or found["first"]
                if label not in NO_POINTS:
                    columns.setdefault(label, {})[axis] = k
        points = {label: found for label, found in columns.items() if len(found) == 2}
        if len(points) > 2:
            raise self.refuse(
                f"the table has {len(points)} points, but a body has one or two; leave out the others", True
            )
        labels = ("1", "2") if len(points) == 2 else ("",)
        roles = {
            point[axis]: f"{axis}{label}"
            for point, label in zip(points.values(), labels, strict=False)
            for axis in "xy"
        }
        if len(points) == 1:
            (label,) = points
            roles |= {
                k: "rotation" for k, name in enumerate(names) if name in {f"{label}_{angle}" for angle in ANGLES}
            }
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
            raise self.refuse(f"the columns {same} may be input or output; name them input and output", True)
        remaining = {k: role for k, role in found.items() if role != "angle"}
        return remaining | dict(zip(sorted(angles), missing, strict=False))

    def _by_number(self) -> dict[int, str]:
        width = (
            len([cell for cell in self.sheet.rows[0].cells if cell])
            if len(self.sheet.rows) == 1
            else self.sheet.width
        )
        width = max(width, min(self.sheet.width, max(self.kind.bare)))
        roles = self.kind.bare.get(width)
        if roles is None:
            max_columns = max(self.kind.bare)
            raise self.refuse(
                f"the table has {width} columns; give 1 to {max_columns} columns, or a line of headings above them",
                True,
            )
        if self.kind is POSES and len(self.sheet.rows) > 1:
            self._check_bare(roles)
        self.remarks.append("columns without headings were read as " + ", ".join(map(_word, roles)))
        return dict(enumerate(roles))

    def _check_bare(self, roles: tuple[str, ...]) -> None:
        """Refuse columns without headings whose numbers may mean something else."""
        cells = [[*row.cells, *[""] * len(roles)][: len(roles)] for row in self.sheet.rows]
        numbers = Numbers([cell for row in cells for cell in row])
        try:
            rows = [[numbers.read(cell, "", True).value for cell in row] for row in cells]
        except FieldError:
            return  # reported with its line and column when the numbers are read
        if any(None in row for row in rows):
            return
        values: list[list[float]] = [list(column) for column in zip(*rows)]
        if len(roles) == 3 and len(set(values[2])) == 1:
            raise self.refuse(
                f"the third of three columns without headings is {values[2][0]:g} in every row, which may be a z or an angle; "
                "write x,y,z or x,y,angle above them",
                True,
            )
        if len(roles) != 4:
            return
        first, steps = values[0], [b - a for a, b in zip(values[0], values[0][1:])]
        is_crank = (min(steps) > 0 or max(steps) < 0) and abs(first[-1] - first[0]) <= 360
        is_number = first[0] in (0, 1) and set(steps) == {1}
        lengths = [math.hypot(c - a, d - b) for a, b, c, d in zip(*values)]
        is_rigid = len(lengths) > 2 and max(lengths) - min(lengths) < 0.05 * max(lengths)
        is_unit = all(abs(math.hypot(c, d) - 1) < 0.02 for c, d in zip(*values[2:]))
        if not is_crank or is_number or is_rigid or is_unit:
            raise self.refuse(
                "four columns without headings may be crank,x,y,angle or number,x,y,angle or x1,y1,x2,y2 or x,y,cos,sin; write "
                "one of these lines above them",
                True,
            )

    def assign(self, roles: dict[int, str]) -> None:
        """Take the roles of columns and check the units in their heads."""
        self.roles = dict(sorted(roles.items()))
        for k, role in self.roles.items():
            head = self.sheet.heads[k] if self.sheet.heads else Head("", "", "")
            self.units[k] = self.unit_of(head.unit, role, f"line {self.sheet.line}: the heading '{head.text[:30]}'")
            if not self.units[k] and head.name in RADIAN_ANGLES:
                self.units[k] = "rad"

    def unit_of(self, text: str, role: str, where: str) -> str:
        """Return the unit that a text names for a column of a role; FieldError if there is none."""
        name = text.strip().lower()
        known = (*(MILLIMETRES if self.is_length(role) else ()), *(ANGLE_NAMES if self.is_angle(role) else ()))
        if not name or (not known and name in ("-", "1", "%")):
            return ""
        unit = UNITS.get(name, "")
        if role in ("x", "y") and self.kind is FUNCTIONS:
            return ""
        if unit not in known:
            there = f"use one of {', '.join(known)}" if known else "remove it, because this column has no unit"
            raise FieldError(
                "", f"{where} has the unit '{text[:20]}', which is not a known unit of {_word(role)}; {there}"
            )
        return unit

    def is_angle(self, role: str) -> bool:
        """Return whether a column of a role may be in a unit of angle."""
        return role in self.kind.angles

    def is_length(self, role: str) -> bool:
        """Return whether a column of a role may be in a unit of length."""
        return role in self.kind.lengths or (self.kind is FUNCTIONS and role in ("input", "output"))

    # -- numbers

    def read_numbers(self) -> None:
        """Read the cells of all columns that have a role, and convert them to a common unit of length and a unit of angle."""
        if self.kind is POSES and len({"x", "y"} & set(self.roles.values())) == 1:
            raise self.refuse("give both x and y, or neither", True)
        width, heads = self.sheet.width, self.sheet.heads
        numbers = Numbers([cell for row in self.sheet.rows for k, cell in enumerate(row.cells) if k in self.roles])
        for row in self.sheet.rows:
            cells = row.cells
            while len(cells) > width and not cells[-1]:
                cells = cells[:-1]
            if len(cells) != width:
                commas = (
                    "; put numbers with a decimal comma in quotes, or separate the cells by semicolons"
                    if len(cells) > width
                    else ""
                )
                raise FieldError(
                    "", f"line {row.line}: the line must have {width} cells; it has {len(cells)}{commas}"
                )
            for k, role in self.roles.items():
                where = f"line {row.line}, column {k + 1}{f' ({heads[k].text[:20]})' if heads else ''}: "
                value, unit = numbers.read(cells[k], where, self.kind.gaps)
                if value is not None and not abs(value) <= MAX_LENGTH:
                    bound = f"more than {MAX_LENGTH:g}" if value > 0 else f"less than {-MAX_LENGTH:g}"
                    raise FieldError("", f"{where}'{cells[k][:20]}' is {bound}")
                self.values.setdefault(role, []).append(value)
                if unit:
                    self._take_unit(k, role, unit, where)
        self._convert()

    def _take_unit(self, k: int, role: str, text: str, where: str) -> None:
        """Take the unit behind a number as the unit of its column."""
        unit = self.unit_of(text, role, where + "the number")
        if self.units[k] not in ("", unit):
            raise FieldError("", f"{where}the number is in {unit}, the column in {self.units[k]}")
        self.units[k] = unit

    def _convert(self) -> None:
        units = {role: self.units[k] for k, role in self.roles.items()}
        lengths = {role: unit for role, unit in units.items() if unit in LENGTH_NAMES}
        self.angle_named = all(unit for role, unit in units.items() if self.is_angle(role))
        if lengths:
            own = next(iter(lengths.values()))
            self.length_unit = self.length_unit or own
            for role, unit in units.items():
                if unit in lengths.values() or (role in self.kind.lengths and not unit):
                    self._scale(role, MILLIMETRES[unit or own] / MILLIMETRES[self.length_unit])
        for role, unit in units.items():
            quantity = self.ends.get(role, "")
            if unit and quantity and (quantity == "length") != (unit in LENGTH_NAMES):
                kind = "a length" if unit in LENGTH_NAMES else "an angle"
                raise FieldError(f"/{role}_unit", f"is {quantity!r}, and the table has {kind} in {unit} for {role}")
            target_unit = quantity if quantity in ANGLE_NAMES else "deg" if self.degrees else "rad"
            if unit in ANGLE_NAMES and unit != target_unit:
                self._scale(role, radians_in(unit == "deg") / radians_in(target_unit == "deg"))

    def _scale(self, role: str, factor: float) -> None:
        if factor != 1:
            self.values[role] = [
                None if value is None else float(f"{value * factor:.15g}") for value in self.values[role]
            ]

    @property
    def turn(self) -> float:
        """Whole turn in the unit of the request."""
        return 360.0 if self.degrees else 2 * math.pi

    def combine_points(self) -> None:
        """Make a rotation of cosine and sine, of a quaternion, or of two points of the body."""
        values = self.values
        if {"qw", "qz"} <= values.keys():
            tilts = [value for name in ("qx", "qy") for value in values.pop(name, []) if value is not None]
            if any(abs(value) > 0.05 for value in tilts):
                raise self.refuse("the quaternions tilt the body out of the plane: qx and qy must be 0")
            values["rotation"] = self._directions(values.pop("qw"), values.pop("qz"), 2.0)
        elif {"cos", "sin"} <= values.keys():
            values["rotation"] = self._directions(values.pop("cos"), values.pop("sin"), 1.0)
        elif values.keys() & {"cos", "sin"}:
            raise self.refuse("give both cos and sin")
        if not values.keys() & {"x1", "y1", "x2", "y2"}:
            return
        if not {"x1", "y1", "x2", "y2"} <= values.keys():
            raise self.refuse("give all of x1, y1, x2 and y2")
        if "rotation" in values:
            raise self.refuse("give either two points or an angle, not both")
        ends = [values.pop(name) for name in ("x1", "y1", "x2", "y2")]
        along = [None if None in row else (row[2] - row[0], row[3] - row[1]) for row in zip(*ends)]
        lines = [row.line for row in self.sheet.rows]
        remark = check_distances(along, lambda index, message: FieldError("", f"line {lines[index]}: {message}"))
        self.remarks += [] if remark is None else [remark]
        values["x"], values["y"] = ends[0], ends[1]
        values["rotation"] = self._directions(
            [None if vector is None else vector[0] for vector in along],
            [None if vector is None else vector[1] for vector in along],
            0.0,
        )
        self.angle_named = True

    def _directions(
        self, cosines: Sequence[float | None], sines: Sequence[float | None], factor: float
    ) -> list[float | None]:
        """Return continuous angles of vectors; of unit vectors if ``factor``, which multiplies the angles, is not 0."""
        angles: list[float | None] = []
        self.angle_named = True
        for row, c, s in zip(self.sheet.rows, cosines, sines):
            if c is None or s is None:
                angles.append(None)
                continue
            if factor and not abs(math.hypot(c, s) - 1) < 0.05:
                raise FieldError(
                    "", f"line {row.line}: ({c:g}, {s:g}) is not a cosine and a sine, whose squares sum to 1"
                )
            angles.append((factor or 1.0) * math.atan2(s, c) / radians_in(self.degrees))
        return [None if angle is None else float(f"{angle:.12g}") for angle in _unwrapped(angles, self.turn)]

    def unwrap(self) -> None:
        """Make all angles continuous."""
        for role in self.kind.angles:
            if role in self.values and role not in SHARES:
                self.values[role] = _unwrapped(self.values[role], self.turn)

    # -- how the table was read

    def columns(self) -> list[Column]:
        """Return how each column was read."""
        heads = self.sheet.heads
        return [
            Column(heads[k].text if heads else str(k + 1), _word(role), self.units[k])
            for k, role in self.roles.items()
        ]

    def note(self) -> str:
        """Return a sentence on the columns that were read."""
        parts = list(self.remarks)
        unit_name = "degrees" if self.degrees else "radians"
        if self.sheet.heads:
            read = []
            for k, role in self.roles.items():
                named = self.units[k]
                text = self.sheet.heads[k].text
                beside = (
                    f" in {named}" if named and not head_of(text).unit else ""
                )  # of a row of units or of the cells
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
            lacking = [k + 1 for k, value in enumerate(self.values.get(name, [])) if value is None]
            if lacking:
                which = ", ".join(map(str, lacking[:6])) + (" and more" if len(lacking) > 6 else "")
                parts.append(f"no {words} for sample{'s' if len(lacking) > 1 else ''} {which}")
        return "; ".join(parts)


def _word(role: str) -> str:
    """Return the name of a role for a user."""
    return {"rotation": "angle", "crank_angle": "crank"}.get(role, role)


def _unwrapped(angles: Iterable[float | None], turn: float) -> list[float | None]:
    """Move angles by whole turns to within half a turn of the angle before; gaps are passed over."""
    found: list[float | None] = []
    before = None
    for angle in angles:
        if angle is not None and before is not None:
            angle -= turn * round((angle - before) / turn)
        before = before if angle is None else angle
        found.append(angle)
    return found
