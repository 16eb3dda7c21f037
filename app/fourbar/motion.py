"""Reading of a table of samples over HTTP and on the command line: the fields of a request, and how each column was read."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import AngleUnit, Flag, LengthUnit, RequestModel, Resources
from linkage_atlas import FieldError
from linkage_atlas.cells import decoded
from linkage_atlas.heads import KINDS
from linkage_atlas.motions import looks_like_radians
from linkage_atlas.records import Record
from linkage_atlas.tables import Column, read_table

MAX_COLUMNS = 16
"""Largest number of columns that a request can assign."""
RADIANS = (
    "All angles are below 6.29 and were read as degrees. If they are radians, write the unit in the heading of the column, "
    "as in angle [rad]."
)


class MotionTableRequest(RequestModel):
    """A table of samples that is to be read as fields of a request."""

    table: str | None = None
    """The table as text: CSV, or cells pasted from a spreadsheet."""
    file: str | None = None
    """Content of the file of the table in base64, in any text encoding that spreadsheets write. Give either this or `table`."""
    query: Literal["synthesize", "match", "function"] = "synthesize"
    """Query for which the samples are read."""
    columns: Annotated[dict[str, str], Field(max_length=MAX_COLUMNS)] | None = None
    """Heading, or number from 1, of the column to read for each of x, y, angle, crank, x1, y1, x2, y2, cos, sin, input,
    output. Default: columns are recognised by their headings."""
    unwrap: Flag = False
    """Shift each angle by full turns to within half a turn of the previous angle."""
    angle_unit: AngleUnit = "deg"
    """Unit of the angles in the reply."""
    length_unit: LengthUnit | None = None
    """Unit of the lengths in the reply. Default: the unit of the table."""


@dataclass(frozen=True, kw_only=True)
class MotionTable(Record):
    """The samples of a table as fields of a request."""

    status: Literal["read", "refused"]
    message: str | None = None
    """Reason for which the table was refused."""
    request: dict[str, Any] | None = None
    """Fields of a request to the query."""
    length_unit: LengthUnit | None = None
    """Unit of the lengths; null if the table does not contain it."""
    columns: Sequence[Column] = ()
    headings: Sequence[str] = ()
    """Headings of all columns; empty if the table was refused and an assignment of columns would not help."""
    notes: Sequence[str] = ()


def answer_motion(request: MotionTableRequest, _: Resources) -> MotionTable:
    """Read a table. If it cannot be read, the reply has a message, and the headings if an assignment of columns may help."""
    if (request.table is None) == (request.file is None):
        raise FieldError("/table", "give either `table`, the text, or `file`, the content of a file in base64")
    try:
        content = None if request.file is None else base64.b64decode(request.file, validate=True)
    except binascii.Error:
        raise FieldError("/file", "must be the content of a file in base64") from None
    kind, also = KINDS[request.query], {"angle_unit": request.angle_unit}
    try:
        text = (request.table or "") if content is None else decoded(content)
        samples = read_table(text, kind, also, request.unwrap, request.columns, request.length_unit)
    except FieldError as error:
        return MotionTable(status="refused", message=error.message, headings=error.details.get("headings", []))
    fields = dict(samples.fields)
    if request.angle_unit == "deg":
        del fields["angle_unit"]
    notes = [samples.note]
    angles = [fields[name] for name in ("rotation", "input", "output") if name in fields]
    if request.angle_unit == "deg" and not samples.angle_named and any(map(looks_like_radians, angles)):
        notes.append(RADIANS)
    return MotionTable(
        status="read",
        request=fields,
        length_unit=samples.length_unit,
        columns=samples.columns,
        headings=samples.headings,
        notes=notes,
    )


def motion_table(reply: MotionTable) -> str:
    """Return a description of how a table was read; raise `FieldError` if it was refused."""
    if reply.request is None:
        raise FieldError("", str(reply.message))
    counts = ", ".join(
        f"{name} ({len(value)})" if isinstance(value, list) else f"{name} {value}"
        for name, value in reply.request.items()
    )
    unit = f"lengths in {reply.length_unit}" if reply.length_unit else "no unit of length"
    return "\n".join([*reply.notes, f"fields: {counts}; {unit}"])
