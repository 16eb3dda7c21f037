"""Samples as a table, CSV or pasted from a spreadsheet, made into the fields of a request."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Any, NamedTuple

from synthesis.errors import FieldError

CRANK = ("crank", "crank_angle", "theta1")
TIME = ("t", "time")
"""Names of columns that are no crank angles, though the crank may turn evenly with them."""
TURN = ("angle", "rotation", "gamma", "phi", "theta", "\u03b3", "\u03c6", "\u03b8")
NUMBER = dict.fromkeys(("no", "nr", "n", "id", "pose", "point", "sample", "index"), None)
"""Names of columns that number the rows, and are not read."""
SHARES = ("weight", "weight_rotation", "weight_position", "tolerance_rotation", "tolerance_position")
"""Names of columns of what each sample counts, of either part or both, and of the errors that are allowed there."""


@dataclass(frozen=True)
class Kind:
    """What tables of one question hold."""

    columns: Mapping[str, str | None]
    """Names of columns and what each holds; None: it is not read."""
    known: str
    """The names, for people."""
    by_number: Mapping[int, tuple[str, ...]]
    """What the columns of a table without names hold, by how many there are."""
    angles: tuple[str, ...]
    """What is in the unit of angle."""
    lengths: tuple[str, ...] = ()
    """What is in the unit of length."""
    gaps: bool = False
    """Whether a cell may be empty."""


POSES = Kind(
    {
        **dict.fromkeys(CRANK, "crank_angle"),
        **{"x": "x", "y": "y"},
        **dict.fromkeys(TURN, "rotation"),
        **{name: name for name in SHARES},
        **NUMBER,
    },
    f"x, y; rotation, angle, phi, theta, gamma; crank_angle, crank, theta1; {', '.join(SHARES)}",
    {1: ("rotation",), 2: ("x", "y"), 3: ("x", "y", "rotation"), 4: ("crank_angle", "x", "y", "rotation")},
    ("crank_angle", "rotation", "tolerance_rotation"),
    ("x", "y", "tolerance_position"),
    gaps=True,
)
TURNS = Kind(
    {**dict.fromkeys(CRANK, "crank_angle"), **dict.fromkeys(TURN, "rotation"), **NUMBER},
    "rotation, angle, phi, theta, gamma; crank_angle, crank, theta1",
    {1: ("rotation",), 2: ("crank_angle", "rotation")},
    ("crank_angle", "rotation"),
)
ROCKERS = Kind(
    {
        **dict.fromkeys(("input", *CRANK), "input"),
        **dict.fromkeys(("output", "rocker", "rocker_angle", "theta3", "psi", "\u03c8", "angle"), "output"),
        **{"x": "x", "y": "y"},
        **NUMBER,
    },
    "output, rocker, rocker_angle, theta3, psi, angle; input, crank, crank_angle, theta1; x, y",
    {1: ("output",), 2: ("input", "output")},
    ("input", "output"),
)


_ONE_GROUP = re.compile(r"[+\-\u2212]?[1-9]\d{0,2}[.,]\d{3}(?!\d|[.,])")
"""A number of which nothing shows whether its mark is that of decimals or of thousands."""


_HEAD = re.compile(r"(\w+?)\.?(?:_(mm|cm|m|in|inch|deg|rad))?(|[\s(\[/].*)")
"""The head of a column in small letters: a name, and perhaps a unit, also as in x_mm."""
_LENGTH = re.compile(r"[\s(\[/]*(?:in\s+)?[(\[]?(mm|cm|m|in)(?:(?<=in)ch(?:es)?)?[)\]]?")
"""What stands behind the name of a column of lengths, in small letters."""
_MISSING = re.compile(r"[#(<]?(nan|n/?a|null|none|nil|missing|-+|\.|\?)[)>!]?")
"""What programs write in place of a number that is missing, in small letters."""
_SEPARATOR = re.compile(r"sep=.")
"""The first line by which a spreadsheet is told what separates cells."""


class _Row(NamedTuple):
    line: int
    """Of the file, from 1."""
    cells: list[str]


def decoded(text: bytes) -> str:
    """A table as spreadsheets save it: UTF-8, or UTF-16 with its mark, or the 8 bits of older ones."""
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return text.decode("utf-16", "replace")
    try:
        return text.decode("utf-8-sig")
    except UnicodeDecodeError:
        return text.decode("cp1252", "replace")


def request_from_csv(text: str, also: Mapping[str, Any] | None = None, unwrap: bool = False) -> dict[str, Any]:
    """The body of /v1/synthesize that a table asks for, angles in degrees unless the heads of their columns say rad.

    The first line names the columns: x and y, rotation (or angle, phi, theta, gamma), crank_angle (or crank, theta1), each
    perhaps with a unit behind it. Without names two columns are x and y, three x, y, rotation, four crank_angle, x, y, rotation,
    one rotation. An empty cell of rotation, or of x and y, is a sample without it. Further columns are weight, or
    weight_rotation and weight_position (an empty cell counts 1), tolerance_rotation and tolerance_position. Fields in ``also``
    join those of the table. Without crank angles in either they are free.

    Cells are separated by tabs, semicolons, commas or spaces. A comma in a number is its decimal point where cells are not
    separated by commas, or where it is quoted; a table that writes some numbers so and others with a point is refused. Before
    three digits the other mark groups thousands, as in 1.000,5. With ``unwrap`` each angle is moved by whole turns to within
    half a turn of the one before.

    Raises `FieldError`: naming the line, and the column where one cell is wrong.
    """
    columns, rows, unit = _read(text, POSES, unwrap)
    request: dict[str, Any] = {name: columns[name] for name in ("crank_angle", "rotation") if name in columns}
    if ("x" in columns) != ("y" in columns):
        raise FieldError("", "line 1: wanted both x and y, or neither")
    if "x" in columns:
        pairs = list(zip(columns["x"], columns["y"]))
        if half := [row.line for row, pair in zip(rows, pairs) if (pair[0] is None) != (pair[1] is None)]:
            raise FieldError("", f"line {half[0]}: wanted both x and y, or neither")
        request["position"] = [None if None in pair else list(pair) for pair in pairs]
    if not request.keys() & {"rotation", "position"}:
        raise FieldError("", "line 1: wanted x and y, or rotation, or both")
    request |= _shares(columns, request.keys() & {"rotation", "position"}, rows) | unit | dict(also or {})
    return request if request.keys() & {"crank_angle", "crank_span"} else {"timing": "free"} | request


def length_unit_of(text: str) -> str | None:
    """The unit of lengths in the heads of a table of poses; None: they name none. Raises `FieldError` where they name two."""
    return _names(_rows(text, POSES), POSES)[2]


def _shares(columns: Mapping[str, list[float | None]], parts: Set[str], rows: list[_Row]) -> dict[str, Any]:
    """Weights and tolerances of the parts that a table has."""
    shares: dict[str, Any] = {}
    for name in SHARES:
        if name not in columns:
            continue
        what, _, part = name.partition("_")
        if part and part not in parts:
            raise FieldError(
                "", f"line 1: {name} needs {'a column of rotation' if part == 'rotation' else 'x and y'}"
            )
        if what == "tolerance" and None in columns[name]:
            raise FieldError("", f"line {rows[columns[name].index(None)].line}: wanted a number for {name}")
        values = [1.0 if value is None else value for value in columns[name]]
        shares.setdefault(f"{what}s", {}).update(dict.fromkeys([part] if part else sorted(parts), values))
    return shares


def match_from_csv(text: str, also: Mapping[str, Any] | None = None, unwrap: bool = False) -> dict[str, Any]:
    """The body of /v1/match that a table asks for: rotation, and perhaps crank_angle before it; see `request_from_csv`."""
    columns, _, unit = _read(text, TURNS, unwrap)
    if "rotation" not in columns:
        raise FieldError("", "line 1: wanted a column of rotation")
    return {**columns, **unit, **(also or {})}


def function_from_csv(text: str, also: Mapping[str, Any] | None = None, unwrap: bool = False) -> dict[str, Any]:
    """The body of /v1/function that a table asks for; see `request_from_csv`.

    Columns are output, and perhaps input before it; or x and y, named, which make the table of a function.
    """
    columns, _, unit = _read(text, ROCKERS, unwrap)
    given = dict(also or {})
    if {"x", "y"} <= columns.keys():
        pairs = [list(pair) for pair in zip(columns.pop("x"), columns.pop("y"))]
        dials = given.get("function")
        given["function"] = {"table": pairs} | (dials if isinstance(dials, dict) else {})
    elif "output" not in columns or columns.keys() & {"x", "y"}:
        raise FieldError("", "line 1: wanted a column of output, or both x and y")
    return {**columns, **unit, **given}


def _read(text: str, kind: Kind, unwrap: bool) -> tuple[dict[str, list[float | None]], list[_Row], dict[str, str]]:
    """The columns of a table, its rows, and the unit of its angles where that is not the degree."""
    rows = _rows(text, kind)
    heads = rows[0].cells if rows and any(map(_is_head, rows[0].cells)) else []
    names, unit, _ = _names(rows, kind)
    if not rows:
        raise FieldError("", "the table has no rows: wanted a line for each sample, perhaps below a line of names")
    columns = _numbers(names, heads, rows, kind.gaps)
    if unwrap:
        turn = 2 * math.pi if unit == "rad" else 360.0
        turning = [name for name in kind.angles if name in columns and name not in SHARES]
        columns |= {name: _unwrapped(columns[name], turn) for name in turning}
    return columns, rows, {"angle_unit": unit} if unit == "rad" else {}


def _unwrapped(angles: list[float | None], turn: float) -> list[float | None]:
    """Angles moved by whole turns to within half a turn of the one before; gaps are passed over."""
    out: list[float | None] = []
    before = None
    for angle in angles:
        if angle is not None and before is not None:
            angle -= turn * round((angle - before) / turn)
        before = before if angle is None else angle
        out.append(angle)
    return out


def _rows(text: str, kind: Kind) -> list[_Row]:
    """The lines that are neither empty nor a comment, in cells; a comment that names the columns is the line of names.

    Lines of separators alone are samples without anything; behind the last sample they are what spreadsheets make of empty lines.
    """
    every = list(enumerate(text.lstrip("\ufeff").splitlines(), 1))
    tabs = any("\t" in line.strip() for _, line in every)
    filled = [(number, line) for number, line in every if line.strip() or (tabs and "\t" in line)]
    while filled and not filled[-1][1].strip(" \t;,"):
        filled.pop()
    if filled and _SEPARATOR.fullmatch(filled[0][1].strip()):
        filled = filled[1:]
    lines = [(number, line) for number, line in filled if not line.startswith("#")]
    above = [(number, line) for number, line in filled if lines and line.startswith("#") and number < lines[0][0]]
    if above and _names_columns(above[-1][1], lines[0][1], kind):
        lines.insert(0, (above[-1][0], above[-1][1].lstrip("# ")))
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
        return [_Row(number, _words(line)) for number, line in lines]
    return [_Row(number, _cells(line, separator, number)) for number, line in lines]


def _names_columns(comment: str, first: str, kind: Kind) -> bool:
    """Whether a comment names a column for each cell of the line below it, as "# x, y, theta"."""
    names = [
        _HEAD.fullmatch(one) for one in re.split(r"[;,\t]\s*|\s+(?![(\[/])", comment.lower().lstrip("# ").strip())
    ]
    cells = re.split(r"\s*[;\t]\s*|\s*,\s+|\s+" if re.search(r"[;\t\s]", first.strip()) else ",", first.strip())
    return len(names) == len(cells) and all(one is not None and one[1] in kind.columns for one in names)


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


def _names(rows: list[_Row], kind: Kind) -> tuple[list[str | None], str, str | None]:
    """What each column holds, and the units of angles and of lengths; takes the line of names from the rows."""
    if not rows:
        return [], "deg", None
    head = rows[0]
    if not any(map(_is_head, head.cells)):
        if len(head.cells) not in kind.by_number:
            most = max(kind.by_number)
            raise FieldError(
                "", f"line {head.line}: wanted 1 to {most} columns, or names above them, found {len(head.cells)}"
            )
        return list(kind.by_number[len(head.cells)]), "deg", None
    rows.pop(0)
    names: list[str | None] = []
    units, lengths = set(), set()
    for cell in _trimmed(head.cells, 1):
        found = _HEAD.fullmatch(cell.lower())
        if found is not None and found[1] in TIME:
            free = "free, or " if kind is POSES else ""
            raise FieldError(
                "",
                f"line {head.line}: the column '{cell[: len(found[1])]}' is a time, and no crank angle: name it 'crank' if it "
                f"holds crank angles in degrees, or leave it out (then crank angles are {free}even over a crank_span)",
            )
        if found is None or found[1] not in kind.columns:
            raise FieldError("", f"line {head.line}: there is no column '{cell[:20]}'; there are {kind.known}")
        word, unit, behind = found.groups(default="")
        name = kind.columns[word]
        if name is not None and name in names:
            raise FieldError("", f"line {head.line}: two columns hold {name.replace('_', ' ')}")
        names.append(name)
        if name in kind.angles:
            units.add("rad" if unit == "rad" or re.search(r"\brad", behind) else "deg")
        elif name in kind.lengths and (measure := _LENGTH.fullmatch(unit or behind)):
            lengths.add(measure[1])
    if len(units) > 1:
        raise FieldError("", f"line {head.line}: wanted all angles in one unit, found degrees and radians")
    if len(lengths) > 1:
        named = " and ".join(sorted(lengths))
        raise FieldError("", f"line {head.line}: wanted all lengths in one unit, found {named}")
    return names, units.pop() if units else "deg", lengths.pop() if lengths else None


def _trimmed(cells: list[str], least: int) -> list[str]:
    """The cells without empty ones beyond the least number, as a separator at the end of a line makes one."""
    while len(cells) > least and not cells[-1]:
        cells = cells[:-1]
    return cells


def _numbers(
    names: list[str | None], heads: list[str], rows: list[_Row], gaps: bool
) -> dict[str, list[float | None]]:
    """The columns that are read; a mark for decimals is one mark in the whole table."""
    columns: dict[str, list[float | None]] = {name: [] for name in names if name is not None}
    read = [cell for _, cells in rows for name, cell in zip(names, cells) if name is not None]
    mark = next(filter(None, map(_decimal_mark, read)), "," if any("," in cell for cell in read) else ".")
    thousands = re.compile(rf"(?<=\d)[{'.,'.replace(mark, '')}](?=\d{{3}}(?!\d))")
    for line, cells in rows:
        cells = _trimmed(cells, len(names))
        if len(cells) != len(names):
            commas = (
                "; a number with a decimal comma is quoted, or semicolons separate" if len(cells) > len(names) else ""
            )
            raise FieldError("", f"line {line}: wanted {len(names)} cells, found {len(cells)}{commas}")
        for k, (name, cell) in enumerate(zip(names, cells)):
            if name is None:
                continue
            place = f"line {line}, column {k + 1}{f' ({heads[k][:20]})' if heads else ''}: "
            plain = thousands.sub("", cell)
            if _decimal_mark(cell) not in ("", mark) or len(set(plain) & set(".,")) > 1:
                wanted = "wanted one decimal mark in the whole table, found comma and point"
                raise FieldError("", f"{place}'{cell[:20]}': {wanted}")
            value = _number(plain, place, gaps)
            if value is None and not gaps:
                raise FieldError("", f"{place}wanted a number, found an empty cell")
            columns[name].append(value)
    return columns


def _decimal_mark(cell: str) -> str:
    """The decimal mark of a number, where it shows one: the last of two, or the one that does not stand twice."""
    marks = re.findall("[.,]", cell)
    if not marks or _ONE_GROUP.match(cell):
        return ""
    several = len(marks) > 1 and len(set(marks)) == 1
    return ".,".replace(marks[0], "") if several else marks[-1]


def _number(cell: str, place: str, gaps: bool) -> float | None:
    cell = cell.replace("\u2212", "-").removesuffix("\u00b0").strip()
    if not cell:
        return None
    plain = re.sub("(?<=\\d)[\u00a0\u202f\u2009'\u2019](?=\\d{3})", "", cell).replace(",", ".")
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", plain, re.ASCII):
        unit = "; a unit stands in the head of its column, as x [mm]" if re.match(r"[+-]?\d.*[^\W\d_]", plain) else ""
        left = "; what is missing is left empty" if gaps and _MISSING.fullmatch(plain.lower()) else ""
        raise FieldError("", f"{place}'{cell[:20]}' is not a number{unit}{left}")
    return float(plain)
