"""Cells of a table in a text: CSV, columns pasted from a spreadsheet, with heads, units and decimal commas."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from synthesis.errors import FieldError

LENGTH_NAMES = {
    "um": ("um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"),
    "mm": ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    "cm": ("cm", "centimeter", "centimeters", "centimetre", "centimetres", "zentimeter"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "in": ("in", "inch", "inches", "zoll", '"', "″", "”"),
    "ft": ("ft", "foot", "feet", "′"),
}
"""Spellings of each unit of length, in lower case."""
ANGLE_NAMES = {
    "deg": ("deg", "degs", "degree", "degrees", "°", "º", "grad"),
    "rad": ("rad", "rads", "radian", "radians"),
}
"""Spellings of each unit of angle, in lower case; "grad" is the German degree."""
UNITS = {spelling: unit for names in (LENGTH_NAMES, ANGLE_NAMES) for unit, all_ in names.items() for spelling in all_}
OTHER_UNITS = frozenset("nm dm km mil mils thou yd px pixel pixels gon".split())
"""Names of units that are recognised in "x_km" and refused."""

_FILES = (
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "an Excel workbook or another zip archive"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook or another Office file"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"AC10", "a DWG drawing"),
    (b"glTF", "a glTF model"),
    (b"ISO-10303-21", "a STEP model"),
    (b"AutoCAD Binary DXF", "a DXF drawing"),
    (b"%!PS", "a PostScript document"),
    (b"<svg", "an SVG picture"),
    (b"<mujoco", "an MJCF model"),
    (b"<!doctype html", "a web page"),
    (b"<html", "a web page"),
    (b"<?xml", "an XML file"),
    (b"<", "an XML or HTML file"),
)
"""First bytes of files that hold no table; the first entry that fits decides."""
_STL = re.compile(rb"solid [^,;\t\n]*\n\s*facet")
_DXF = re.compile(rb"\s*(999\r?\n[^\n]*\n\s*)*0\r?\n\s*SECTION")
_INSTEAD = (
    "save the samples as CSV (in a spreadsheet: Save as, CSV; in CAD: export the points), or give a request as JSON"
)

_SEPARATOR_LINE = re.compile(r"sep=.")
_RULE = re.compile(r"[|+:\s-]*-{3}[|+:\s-]*")
"""Line that separates heads from rows in Markdown."""
_COMMENTS = ("#", "%", "//")
_NUMBER = re.compile(r"[+\-\u2212]?(?:\d[\d.,\u00a0\u202f\u2009'\u2019]*|[.,]\d+)(?:[eE][+-]?\d+)?")
_MISSING = re.compile(r"[#(<]?(nan|n/?a|null|none|nil|missing|-+|\.|\?)[)>!]?")
"""Texts that programs write in place of a missing number, in lower case."""
_ONE_GROUP = re.compile(r"[+\-\u2212]?[1-9]\d{0,2}[.,]\d{3}(?!\d|[.,])")
"""A number whose mark may group thousands or separate decimals."""
_BRACKETS = re.compile(r"(.*?)\s*[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]\s*")


class Row(NamedTuple):
    """Cells of a line; lines count from 1."""

    line: int
    cells: list[str]


class Head(NamedTuple):
    """Head of a column: its text as written, its name in lower case with underscores, and the text of its unit ("")."""

    text: str
    name: str
    unit: str


@dataclass(frozen=True)
class Sheet:
    """Rows of a table and the heads of its columns, if it has any.

    ``line`` is the line of the heads, or of the first row if there are none; ``units`` come from a row of units below them.
    """

    heads: list[Head]
    rows: list[Row]
    line: int

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.heads) if self.heads else len(self.rows[0].cells)


def decoded(content: bytes) -> str:
    """Decode a table as spreadsheets save it: UTF-8, UTF-16 with its mark, or Windows-1252.

    Raises `FieldError` for a file that is known to hold no table.
    """
    start = content.removeprefix(b"\xef\xbb\xbf").lstrip()[:400]
    for first, name in _FILES:
        if start.lower().startswith(first.lower()):
            raise FieldError("", f"this is {name}, not a table of samples: {_INSTEAD}")
    for pattern, name in ((_DXF, "a DXF drawing"), (_STL, "an STL model")):
        if pattern.match(start):
            raise FieldError("", f"this is {name}, not a table of samples: {_INSTEAD}")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", "replace")
    if b"\0" in start:
        raise FieldError("", f"this is a binary file, not a table of samples: {_INSTEAD}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")


def sheet_of(text: str, known: frozenset[str], needed: Sequence[str] = ()) -> Sheet:
    """Split a text into rows of cells and heads.

    Parameters
    ----------
    text : str
    known : frozenset of str
        Names of columns that distinguish a line of heads from a title above it.
    needed : sequence of str
        Texts of heads that the user has named.

    Raises
    ------
    FieldError
        Naming the line; without any row of numbers too.
    """
    text = text.lstrip("\ufeff")
    if text.lstrip().startswith(("[", "(")):  # a list of lists, or points
        text = re.sub(r"[\])]\s*,?\s*[\[(]", "\n", text)
        text = "\n".join(re.sub(r"^[\s\[(]+|[\s\]),;]+$", "", line) for line in text.splitlines())
    lines = list(enumerate(text.splitlines(), 1))
    tabs = any("\t" in line.strip() for _, line in lines)
    lines = [
        (number, line)
        for number, line in lines
        if (line.strip() or (tabs and "\t" in line)) and not _RULE.fullmatch(line.strip())
    ]
    while lines and not lines[-1][1].strip(" \t;,|"):
        lines.pop()
    if lines and _SEPARATOR_LINE.fullmatch(lines[0][1].strip()):
        lines = lines[1:]
    plain = [(number, line) for number, line in lines if not line.lstrip().startswith(_COMMENTS)]
    first = next((k for k, (_, line) in enumerate(plain) if _holds_numbers(line)), None)
    if first is None:
        raise FieldError(
            "", "the table has no rows; it needs a line of numbers for each sample, below a line of headings"
        )
    above, below = plain[:first], plain[first:]
    separator = _separator([line for _, line in below], [line for _, line in above])
    rows = [Row(number, _split(line, separator, number)) for number, line in below]
    width = max(len(_trimmed(rows[0].cells)), 1)
    titles = [(number, _head_cells(line, separator, width, number)) for number, line in above]
    units: list[str] = []
    if len(titles) > 1 and _are_units(titles[-1][1]):
        units = [re.sub(r"^[(\[]|[)\]]$", "", cell) for cell in titles.pop()[1]]
    if not titles:
        comments = [(number, line) for number, line in lines if number < below[0][0] and (number, line) not in plain]
        if comments:
            number, line = comments[-1]
            cells = _head_cells(line.lstrip("#%/ "), separator, width, number)
            named = sum(head_of(cell).name in known for cell in cells)
            if len(cells) == width and 2 * named >= width:
                titles = [(number, cells)]
    if not titles:
        return Sheet([], rows, rows[0].line)
    chosen_names = {_name(head) for head in needed}
    heads = [(number, [head_of(cell) for cell in _trimmed(cells)]) for number, cells in titles]
    at = max(range(len(heads)), key=lambda k: (any(head.name in known | chosen_names for head in heads[k][1]), k))
    if at < len(heads) - 1:
        number, extra = heads[at + 1]
        raise FieldError(
            "", f"line {number}: '{extra[0].text[:20]}' is neither a number nor a unit; give a row of units, or none"
        )
    at_line, found = heads[at]
    if units:
        found = [
            head._replace(unit=head.unit or unit)
            for head, unit in zip(found, [*units, *[""] * len(found)], strict=False)
        ]
    return Sheet(found, rows, at_line)


def _holds_numbers(line: str) -> bool:
    """Return whether a line is a row of a table, in contrast to a title or a line of heads."""
    separators = "\t;|" if re.search(r"[\t;|]", line) else "," if "," in line else " "
    cells = [cell.strip(' "') for cell in re.split(f"[{separators}]", line)]
    filled = [cell for cell in cells if cell]
    numbers = sum(map(_is_number, filled))
    if not filled or numbers > 1:
        return True
    return 2 * numbers > len(filled) or (2 * numbers == len(filled) and separators != " ")


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number, possibly with a unit, a time, or a text in place of a missing number."""
    found = _NUMBER.match(cell)
    suffix = cell[found.end() :].strip().lower() if found else ""
    if found and (suffix in UNITS or not re.search(r"[^\W\d_]", suffix)):
        return True
    return _MISSING.fullmatch(cell.lower()) is not None


def _are_units(cells: list[str]) -> bool:
    """Return whether a line between heads and numbers names units."""
    names = [re.sub(r"^[(\[]|[)\]]$", "", cell).strip().lower() for cell in cells if cell]
    return any(name in UNITS for name in names) and all(len(name) <= 12 and " " not in name for name in names)


def _separator(below: list[str], above: list[str]) -> str:
    """Find the character between cells; a blank means any white space."""
    bare = [re.sub('"[^"]*"', "", line) for line in below]
    for separator in "\t;":
        if any(separator in line for line in bare):
            return separator
    if all("|" in line for line in bare):
        return "|"
    if above:  # the separator for which a row and the heads have the same number of cells
        heads = {len(_trimmed(_split(above[-1], mark, 0))) for mark in "\t;,| "} - {1} or {1}
        fits = [mark for mark in ", " if len(_trimmed(_split(below[0], mark, 0))) in heads]
        return fits[0] if len(fits) == 1 else "," if "," in above[-1] else " "
    first = re.sub(r"[(\[][^)\]]*[)\]]", "", bare[0]).strip()
    # numbers between which there are blanks without a comma before them: "1,5 2,5", in contrast to "1, 5"
    return " " if "," not in first or re.search(r"[^,\s]\s+[^,\s]", first) else ","


def _split(line: str, separator: str, number: int) -> list[str]:
    """Split a line; a quote that is not closed ends with it."""
    if separator == " ":
        return re.sub(r"\s+([(\[])", r"\1", line).split()
    if separator == "|":
        line = line.strip().strip("|")
    try:
        (row,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    except csv.Error as error:
        raise FieldError("", f"line {number}: {error}") from None
    return [cell.strip() for cell in row]


def _head_cells(line: str, separator: str, width: int, number: int) -> list[str]:
    """Split a line of heads, which may have another separator than the numbers below it."""
    cells = _trimmed(_split(line, separator, number))
    for candidate in "\t;,| ":
        if len(cells) == width:
            break
        if len(found := _trimmed(_split(line, candidate, number))) == width:
            cells = found
    return cells


def _trimmed(cells: list[str]) -> list[str]:
    """Drop empty cells at the end, as a separator at the end of a line makes."""
    while len(cells) > 1 and not cells[-1]:
        cells = cells[:-1]
    return cells


_GREEK = str.maketrans(
    {"γ": "gamma", "φ": "phi", "ϕ": "phi", "θ": "theta", "ϑ": "theta", "ψ": "psi", "α": "alpha", "β": "beta"}
)


def _name(text: str) -> str:
    return re.sub(r"[^\w]+|_+", "_", text.strip().casefold().translate(_GREEK)).strip("_")


def head_of(text: str) -> Head:
    """Split a head into name and unit: "X [mm]", "x_mm", "x/mm", "x in mm" and "x mm" are x in mm."""
    text = text.strip()
    if (found := _BRACKETS.fullmatch(text)) and found[1]:
        if found[2].isdigit():  # an index: rvec[2]
            return Head(text, f"{_name(found[1])}_{found[2]}", "")
        return Head(text, _name(found[1]), found[2])
    if found := re.fullmatch(r"(.+?)(?:\s*/\s*|\s+in\s+)(\S.*)", text, re.IGNORECASE):
        return Head(text, _name(found[1]), found[2].strip("[]()"))
    if (found := re.fullmatch(r"(.*\w)[_\s](\S+)", text)) and found[2].lower() in {*UNITS, *OTHER_UNITS}:
        return Head(text, _name(found[1]), found[2])
    if found := re.fullmatch(r"(.*\w)(°)", text):
        return Head(text, _name(found[1]), found[2])
    return Head(text, _name(text), "")


class Cell(NamedTuple):
    """Number in a cell, None for an empty cell, and the text of a unit behind it ("")."""

    value: float | None
    unit: str


class Numbers:
    """Reads the numbers of a table whose decimals all have the same mark."""

    def __init__(self, cells: Sequence[str]) -> None:
        marks = filter(None, map(_decimal_mark, cells))
        self.mark = next(marks, "," if any("," in cell for cell in cells) else ".")
        self._thousands = re.compile(rf"(?<=\d)[{'.,'.replace(self.mark, '')}](?=\d{{3}}(?!\d))")

    def read(self, cell: str, where: str, gaps: bool) -> Cell:
        """Read a cell; ``where`` begins the sentence of an error, ``gaps``: it may be empty."""
        plain = self._thousands.sub("", cell)
        number = re.match(r"[^A-Za-z°]*", plain)
        if _decimal_mark(cell) not in ("", self.mark) or len(set(number[0] if number else "") & set(".,")) > 1:
            raise FieldError(
                "", f"{where}'{cell[:20]}': use the same decimal mark in the whole table; it has both comma and point"
            )
        plain = plain.replace("\u2212", "-").strip()
        if not plain:
            if gaps:
                return Cell(None, "")
            raise FieldError("", f"{where}the cell is empty; enter a number")
        plain = re.sub("(?<=\\d)[\u00a0\u202f\u2009'\u2019](?=\\d{3})", "", plain).replace(",", ".")
        found = re.fullmatch(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D.*)?", plain, re.ASCII | re.DOTALL)
        if found and (not found[2] or found[2].strip().lower() in UNITS):
            return Cell(float(found[1]), (found[2] or "").strip())
        missing = (
            "; leave the cell empty if the number is missing" if gaps and _MISSING.fullmatch(plain.lower()) else ""
        )
        unit = ""
        if found and found[2] and re.fullmatch(r"[^\W\d_]+", found[2]):
            unit = f"; '{found[2][:10]}' is not a known unit; use one of {', '.join(dict.fromkeys(UNITS.values()))}"
        raise FieldError("", f"{where}'{cell[:20]}' is not a number{unit}{missing}")


def _decimal_mark(cell: str) -> str:
    """Return the decimal mark that a number shows: the last of two different marks, or a mark that does not occur twice."""
    marks = re.findall("[.,]", cell)
    if not marks or _ONE_GROUP.match(cell):
        return ""
    several = len(marks) > 1 and len(set(marks)) == 1
    return ".,".replace(marks[0], "") if several else marks[-1]
