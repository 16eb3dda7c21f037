"""The linkage as a file: the exports of /v1/synthesize, and /v1/export for any solution of a reply."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, Strict

import linkage_atlas as la
from app.fourbar.answers import analysis_of, answer_synthesize, is_long, motion_of
from app.fourbar.given import FarLength, GivenSolution
from app.fourbar.models import SynthesizeRequest
from app.query import Export, LengthUnit, RequestModel, Resources

if TYPE_CHECKING:
    from fastapi import FastAPI


class PlatesRequest(RequestModel):
    """Sizes of link plates, in the unit of the request's lengths."""

    hole: FarLength | None = Field(None, description="Diameter of the holes.")
    width: FarLength | None = Field(None, description="Width of the plates.")


class ExportRequest(RequestModel):
    """A motion, one of its solutions, and the kind of file that is wanted."""

    request: SynthesizeRequest = Field(description="The request of /v1/synthesize; angles are in its unit.")
    solution: GivenSolution | None = Field(
        None, description="One of the reply's solutions. Without it the request is solved."
    )
    rank: Annotated[int, Strict(), Field(ge=1, le=100)] = Field(1, description="Which solution, if none is given.")
    format: Literal["json", "csv", "svg", "dxf", "plates", "mjcf", "pylinkage"] = "json"
    length_unit: LengthUnit = Field("mm", description="The unit of the request's lengths, for DXF and MJCF.")
    plates: PlatesRequest | None = Field(None, description="Sizes of the plates; each has a default.")


def _ranked(request: SynthesizeRequest, rank: int, resources: Resources) -> la.Solution:
    found = answer_synthesize(request.model_copy(update={"top": max(request.top, rank)}), resources).solutions
    if len(found) < rank:
        raise la.FieldError(
            "/limits" if not found else "/rank", f"there are {len(found)} linkages within these limits"
        )
    return found[rank - 1]


MEDIA_TYPES = {
    "csv": "text/csv; charset=utf-8",
    "svg": "image/svg+xml",
    "dxf": "image/vnd.dxf",
    "plates": "image/vnd.dxf",
    "mjcf": "application/xml",
    "pylinkage": "application/json",
}
ENDINGS = {"plates": "plates.dxf", "mjcf": "xml", "pylinkage": "pylinkage.json"}
"""Endings of files, where they are not their format's name."""


@contextmanager
def _pointing(change: Callable[[str], str]) -> Iterator[None]:
    """Errors of fields within point to where this route's body has the field."""
    try:
        yield
    except la.FieldError as error:
        raise la.FieldError(change(error.field), error.message, **error.details) from error


def _best(name: str) -> Callable[[SynthesizeRequest, Resources], bytes]:
    def render(request: SynthesizeRequest, resources: Resources) -> bytes:
        best = _ranked(request, 1, resources)
        with _pointing(lambda _: ""):
            return best.linkage.render(name, analysis=analysis_of(request)).encode()

    return render


SYNTHESIZE_EXPORTS = {
    name if name == "mjcf" else ENDINGS.get(name, name): Export(media_type, _best(name))
    for name, media_type in MEDIA_TYPES.items()
}
"""Of /v1/synthesize: the best solution as a file."""


def synthesize_file(request: SynthesizeRequest, reply: la.Result, rank: int, name: str, length_unit: str) -> bytes:
    """A solution of a reply as a file; the name is the ending, or ``json``."""
    kinds = {ending: kind for kind, ending in ENDINGS.items()}
    body = {"format": kinds.get(name, name), "length_unit": length_unit, "request": request}
    solution = GivenSolution.model_validate(reply.solutions[rank - 1].to_dict())
    return answer_export(ExportRequest(**body, solution=solution), None)[0]


_PREFIXES = {"crank_angle": "/solution", "analysis": "/request"}


def answer_export(body: ExportRequest, resources: Resources | None) -> tuple[bytes, str]:
    """Content and media type of a file."""
    request = body.request
    with _pointing(lambda field: field if field == "/rank" else "/request" + field):
        motion = la.Motion.of(**motion_of(request))
        found = None if body.solution else _ranked(request, body.rank, resources)
    if body.format == "json":
        solution = found.to_dict() if found else body.solution.model_dump(mode="json")
        content = {"request": request.model_dump(mode="json", exclude_defaults=True), "solution": solution}
        return json.dumps(content, indent=1, allow_nan=False).encode(), "application/json"
    linkage = found.linkage if found else la.FourBar.from_dict(body.solution.model_dump(), request.degrees)
    crank = found.crank_angle if found else body.solution.crank_angle
    with _pointing(lambda field: _PREFIXES.get(field.lstrip("/").partition("/")[0], "") + field):
        plates = None if body.plates is None else body.plates.model_dump(exclude_none=True)
        text = linkage.render(body.format, motion, body.length_unit, crank, analysis_of(request), plates)
    return text.encode(), MEDIA_TYPES[body.format]


def install(app: FastAPI, responses: dict[int | str, dict[str, Any]], example: Any) -> None:
    """The route /v1/export."""
    from starlette.responses import Response

    from app import computed
    from app.bodies import Reply

    files = {media_type: {} for media_type in ["application/json", *MEDIA_TYPES.values()]}
    names = ("dxf", "plates", "svg", "csv", "mjcf", "pylinkage", "json")
    bodies = {name: {"value": {"request": example, "format": name}} for name in names}

    def answer(body: ExportRequest, resources: Resources) -> Response:
        content, media_type = answer_export(body, resources)
        ending = ENDINGS.get(body.format, body.format)
        return Reply(content, media_type, {"Content-Disposition": f'attachment; filename="linkage.{ending}"'})

    computed.add(
        app,
        computed.Question(
            "/v1/export", ExportRequest, answer, lambda body: body.solution is None and is_long(body.request)
        ),
        "export",
        tags=["synthesize"],
        summary="A linkage as a file: JSON, CSV, SVG, DXF, plates to cut, MJCF or pylinkage's JSON.",
        response_class=Response,
        response_model=None,
        responses={**responses, 200: {"content": files}},
        openapi_extra={"requestBody": {"content": {"application/json": {"examples": bodies}}}},
    )
