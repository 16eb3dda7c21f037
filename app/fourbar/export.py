"""The linkage as a file: the exports of /v1/synthesize, and /v1/export for any solution of a reply."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from pydantic import Field, Strict

import linkage_atlas as la
from app.fourbar import worked_example
from app.fourbar.answers import answer_synthesize, has_much_to_arrange, is_long, motion_of
from app.fourbar.models import AssemblyOptions, FarLength, GivenDrive, GivenLinkage, Size, SynthesizeRequest
from app.query import FILES, Files, Flag, LengthUnit, Number, RequestModel, Resources
from linkage_atlas.solids import LARGEST_SCALE, LEAST_SCALE

Material = Literal["steel", "stainless", "aluminium", "brass", "plywood", "acrylic", "POM", "PLA", "PETG", "ABS"]


class PlatesRequest(RequestModel):
    """Sizes of link plates, in the unit of the request's lengths."""

    hole: FarLength | None = Field(None, description="Diameter of the holes.")
    width: FarLength | None = Field(None, description="Width of the plates.")


class SolidsRequest(RequestModel):
    """What parts are made of, and how they fit."""

    fit: Literal["H7", "print"] = Field(
        "H7",
        description="`H7`: drawn at the nominal size, with tolerances in the parts list; `print`: with play for a printer, "
        "0.4 mm where a plate turns and 0.1 mm where it holds the pin.",
    )
    material: Material | None = Field(
        None, description="Of plates and boards. Default: aluminium, to be printed PLA."
    )
    pins: Material | None = Field(None, description="Of pins, washers and heads. Default: steel, to be printed PLA.")
    fillet: Size = Field(0.0, description="Radius at the convex corners of the body, in the unit of the lengths.")
    scale: Annotated[Number, Field(ge=LEAST_SCALE, le=LARGEST_SCALE)] = Field(
        1.0, description="Of a model; plays are not scaled."
    )
    layout: Literal["assembled", "bed"] | None = Field(
        None,
        description="Where parts stand in STEP and 3MF. Default: assembled in STEP, beside one another on the bed in 3MF.",
    )
    nevertheless: Flag = Field(False, description="Also where parts would collide.")


class ExportRequest(RequestModel):
    """A motion, one of its solutions, and the kind of file that is wanted."""

    request: SynthesizeRequest = Field(description="The request of /v1/synthesize; angles are in its unit.")
    solution: GivenLinkage | None = Field(
        None, description="One of the reply's solutions. Without it the request is solved."
    )
    rank: Annotated[int, Strict(), Field(ge=1, le=100)] = Field(1, description="Which solution, if none is given.")
    format: Literal[
        "json", "csv", "svg", "dxf", "plates", "mjcf", "pylinkage", "step", "3mf", "stl", "urdf", "sdf", "parts"
    ] = Field("json", description="`stl`: a zip file with a file a part; `parts`: a parts list (CSV).")
    length_unit: LengthUnit = Field("mm", description="The unit of the request's lengths, for files that know one.")
    plates: PlatesRequest | None = Field(None, description="For a DXF of plates: their sizes; each has a default.")
    assembly: AssemblyOptions | None = Field(
        None,
        description="From `step` on, and for masses in MJCF: how plates and pins are made and held. Default: as in the request.",
    )
    solids: SolidsRequest | None = Field(None, description="For the same: fits, materials, scale.")
    drive: GivenDrive | None = Field(
        None,
        description="A drive of a reply, as it came: columns of CSV, lines of SVG, a layer of DXF, the drive of MJCF; of a "
        "motor and its rod also their parts.",
    )


def ranked(request: SynthesizeRequest, rank: int, resources: Resources) -> la.Solution | la.GuidedSolution:
    """The solution of a rank of a request that is solved; FieldError where there are fewer."""
    found = answer_synthesize(request.model_copy(update={"top": max(request.top, rank)}), resources).solutions
    if len(found) < rank:
        raise la.FieldError(
            "/limits" if not found else "/rank", f"there are {len(found)} linkages within these limits"
        )
    return found[rank - 1]


@contextmanager
def pointing(change: Callable[[str], str]) -> Iterator[None]:
    """Errors of fields within point to where this route's body has the field."""
    try:
        yield
    except la.FieldError as error:
        raise la.FieldError(change(error.field), error.message, **error.details) from error


def _best_linkage(request: SynthesizeRequest, resources: Resources, kind: str) -> bytes:
    best = ranked(request, 1, resources)
    with pointing(lambda field: field if field == "/format" else ""):
        return best.linkage.file(kind, **request.given("analysis", "assembly"), work=resources.work())


def exports_of(
    formats: tuple[str, ...], render: Callable[[Any, Resources, str], bytes]
) -> dict[str, Callable[[Any, Resources], bytes]]:
    """The best solution of a request in some formats."""
    return {
        FILES[kind].endings[0]: lambda *asked, kind=kind: render(*asked, kind)  # type: ignore[misc]
        for kind in formats
    }


SYNTHESIZE_EXPORTS = exports_of(tuple(kind for kind in FILES if kind != "json"), _best_linkage)


def as_json(request: RequestModel, solution: Any) -> bytes:
    content = {"request": request.model_dump(mode="json", exclude_defaults=True), "solution": solution}
    return json.dumps(content, indent=1, allow_nan=False).encode()


_PREFIXES = {"crank_angle": "/solution", "travel": "/solution", "analysis": "/request"}


def _in_export(field: str) -> str:
    """Where this route's body has an argument of `file`."""
    return "/format" if field == "/kind" else _PREFIXES.get(field.lstrip("/").partition("/")[0], "") + field


def _linkage_file(body: ExportRequest, resources: Resources) -> bytes:
    request, given = body.request, body.solution
    if given is None:
        from linkage_atlas.exports import check_format  # a command that writes no file does not load it

        check_format(body.format, request.mechanisms or ("four_bar",))
    with pointing(lambda field: field if field == "/rank" else "/request" + field):
        motion = motion_of(request)
        found = None if given else ranked(request, body.rank, resources)
    with pointing(lambda field: "/solution" + field):
        linkage = found.linkage if found else given.linkage(request.degrees)
    if body.format == "json":
        return as_json(request, found.to_dict() if found else given.model_dump(mode="json", exclude_none=True))
    one = found or given
    place = one.crank_angle if one.crank_angle is not None else getattr(one, "travel", None)
    with pointing(_in_export):
        asked = request.given("analysis") | body.given("plates", "assembly", "solids", "drive", "length_unit")
        if body.assembly is None and body.format != "plates":
            asked |= request.given("assembly")
        return linkage.file(body.format, motion, crank_angle=place, **asked, work=resources.work())


def _is_long(body: ExportRequest) -> bool:
    if body.solution is None:
        return is_long(body.request)
    return has_much_to_arrange(body.assembly or body.request.assembly, body.solution.driver)


LINKAGE_FILES = Files(
    "/v1/export",
    "export",
    "linkage",
    "A linkage as a file: JSON, CSV, SVG, DXF, plates to cut, MJCF, pylinkage's JSON, STEP, 3MF, STL, URDF, SDF or a parts list.",
    ExportRequest,
    _linkage_file,
    {"request": worked_example()},
    _is_long,
)
