"""Reading of a table of samples over HTTP and on the command line: the fields of a request, and how each column was read."""

from __future__ import annotations

import base64
import binascii
from typing import Annotated, Any, Literal

from pydantic import Field

from app.fourbar import QUESTIONS
from app.query import AngleUnit, Flag, LengthUnit, Query, ReplyModel, RequestModel, Resources
from linkage_atlas import FieldError
from linkage_atlas.motions import looks_like_radians
from linkage_atlas.tables import KINDS, decoded, read_table

MAX_COLUMNS = 16
"""Columns that can be chosen."""
RADIANS = (
    "all angles lie below 6.29: if they are radians, say so in the head of their column, as in angle [rad]; they were read as "
    "degrees"
)


class MotionRequest(RequestModel):
    """Which column of a table is what, in which unit, and which fields of a request does it make?"""

    table: str | None = Field(None, description="The table as text: CSV, or cells pasted from a spreadsheet.")
    file: str | None = Field(
        None, description="Its file in base64, in any encoding that spreadsheets write; give either this or `table`."
    )
    question: Literal["synthesize", "match", "function"] = Field(
        "synthesize", description="The question that the samples are for."
    )
    columns: Annotated[dict[str, str], Field(max_length=MAX_COLUMNS)] | None = Field(
        None,
        description="Head, or number from 1, of the column to read for each of x, y, angle, crank, x1, y1, x2, y2, cos, sin, "
        "input, output. Default: columns are recognised by their heads.",
    )
    unwrap: Flag = Field(
        False, description="Move each angle by whole turns to within half a turn of the angle before."
    )
    angle_unit: AngleUnit = Field("deg", description="Unit of the angles in the reply.")
    length_unit: LengthUnit | None = Field(
        None, description="Unit of the lengths in the reply. Default: the unit of the table."
    )


class ColumnRead(ReplyModel):
    """How a column was read."""

    head: str = Field(description="As written; without heads the number of the column, from 1.")
    role: str = Field(description="x, y, angle, crank, input, output, ..")
    unit: str = Field(description="Unit that the table names; empty if it names none.")


class MotionReply(ReplyModel):
    """The samples of a table as fields of a request."""

    status: Literal["read", "refused"]
    message: str | None = Field(None, description="Why the table was refused.")
    request: dict[str, Any] | None = Field(None, description="Fields of a request to the question.")
    length_unit: LengthUnit | None = Field(None, description="Unit of the lengths; null if the table names none.")
    columns: list[ColumnRead] = Field([])
    heads: list[str] = Field(
        [], description="All columns to choose from; empty if the table was refused for another reason."
    )
    notes: list[str] = Field([])


def answer_motion(request: MotionRequest, _: Resources) -> MotionReply:
    """Read a table; a table that cannot be read is refused with a sentence, and with its heads if the choice of columns helps."""
    if (request.table is None) == (request.file is None):
        raise FieldError("/table", "give either `table`, the text, or `file`, its bytes in base64")
    try:
        content = None if request.file is None else base64.b64decode(request.file, validate=True)
    except binascii.Error:
        raise FieldError("/file", "wanted the bytes of a file in base64") from None
    kind, also = KINDS[request.question], {"angle_unit": request.angle_unit}
    try:
        text = (request.table or "") if content is None else decoded(content)
        found = read_table(text, kind, also, request.unwrap, request.columns, request.length_unit)
    except FieldError as error:
        return MotionReply(status="refused", message=error.message, heads=error.details.get("heads", []))
    fields = dict(found.fields)
    if request.angle_unit == "deg":
        del fields["angle_unit"]
    notes = [found.note]
    angles = [fields[name] for name in ("rotation", "input", "output") if name in fields]
    if request.angle_unit == "deg" and not found.angle_named and any(map(looks_like_radians, angles)):
        notes.append(RADIANS)
    columns = [ColumnRead(**column._asdict()) for column in found.columns]
    return MotionReply(
        status="read",
        request=fields,
        length_unit=found.length_unit,
        columns=columns,
        heads=list(found.heads),
        notes=notes,
    )


def motion_table(reply: MotionReply) -> str:
    """Say how a table was read, for a terminal. Raises `FieldError` if it was refused."""
    if reply.request is None:
        raise FieldError("", str(reply.message))
    counts = ", ".join(
        f"{name} ({len(value)})" if isinstance(value, list) else f"{name} {value}"
        for name, value in reply.request.items()
    )
    unit = f"lengths in {reply.length_unit}" if reply.length_unit else "unit of lengths not named"
    return "\n".join([*reply.notes, f"fields: {counts}; {unit}"])


MOTION = Query(
    "motion",
    QUESTIONS["motion"],
    answer_motion,
    motion_table,
    {
        "table": {"table": "Frame,X (mm),Y (mm),Z (mm),RZ (rad)\n1,0,0,0,0\n2,22,5,0,0.21\n3,41,17,0,0.47\n"},
        "columns": {"table": "left;right\n0;0\n22;5\n41;17\n", "columns": {"x": "left", "y": "right"}},
    },
    shows_units=False,
)
