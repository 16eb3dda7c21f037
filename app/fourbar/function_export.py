"""POST /v1/function/export: any solution of a reply of /v1/function as a file."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

import linkage_atlas as la
from app.fourbar.csv_request import function_from_csv
from app.fourbar.function import MEDIA_TYPES, QUERY, FunctionRequest
from app.fourbar.given import GivenGenerator
from app.query import LengthUnit, RequestModel, Resources
from linkage_atlas.functions import read_wanted
from linkage_atlas.generators import render_function

if TYPE_CHECKING:
    from fastapi import FastAPI


class FunctionExportRequest(RequestModel):
    """A function, one of its linkages, and the kind of file that is wanted."""

    request: FunctionRequest = Field(description="The request of /v1/function; angles are in its unit.")
    solution: GivenGenerator
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = Field("mm", description="The unit of the lengths, for DXF and MJCF.")


def answer_export(body: FunctionExportRequest, resources: Resources | None) -> tuple[bytes, str]:
    """Content and media type of a file."""
    request, solution = body.request, body.solution
    if body.format == "json":
        content = {
            "request": request.model_dump(mode="json", exclude_defaults=True),
            "solution": solution.model_dump(mode="json"),
        }
        return json.dumps(content, indent=1, allow_nan=False).encode(), "application/json"
    degrees = request.angle_unit == "deg"
    asked = None if request.function is None else request.function.model_dump(exclude_none=True)
    try:
        wanted, _ = read_wanted(
            request.output, request.crank_span, input=request.input, function=asked, degrees=degrees
        )
    except la.FieldError as error:
        raise la.FieldError("/request" + error.field, error.message, **error.details) from error
    links = {name: getattr(solution.links, name) for name in ("crank", "coupler", "rocker", "ground")}
    linkage = la.FourBar(**links, branch=solution.branch, start_angle=solution.start_angle, degrees=degrees)
    made = SimpleNamespace(linkage=linkage, output_offset=solution.output_offset)
    text = render_function(wanted, made, body.format, body.length_unit, degrees)
    return text.encode(), MEDIA_TYPES[body.format]


def function_file(
    request: FunctionRequest, reply: la.FunctionResult, rank: int, name: str, length_unit: str
) -> bytes:
    """A solution of a reply as a file; the name is the ending, which is the format."""
    solution = GivenGenerator.model_validate(reply.solutions[rank - 1].to_dict())
    body = FunctionExportRequest(request=request, solution=solution, format=name, length_unit=length_unit)
    return answer_export(body, None)[0]


QUERIES = (replace(QUERY, file_of=function_file, from_csv=function_from_csv),)


def install(app: FastAPI, responses: dict[int | str, dict[str, Any]]) -> None:
    """The route /v1/function/export."""
    from starlette.responses import Response

    from app import computed
    from app.bodies import Reply

    files = {media_type: {} for media_type in ["application/json", *MEDIA_TYPES.values()]}
    example = {
        "request": {"input": [0, 20, 50], "output": [0, 10, 30]},
        "solution": {
            "links": {"crank": 1, "coupler": 3, "rocker": 2.5, "ground": 3.2},
            "branch": 1,
            "start_angle": 40,
            "output_offset": 0,
        },
    }
    bodies = {name: {"value": {**example, "format": name}} for name in ("csv", "svg", "dxf", "mjcf", "json")}

    def answer(body: FunctionExportRequest, resources: Resources) -> Response:
        content, media_type = answer_export(body, resources)
        ending = "xml" if body.format == "mjcf" else body.format
        return Reply(content, media_type, {"Content-Disposition": f'attachment; filename="function.{ending}"'})

    computed.add(
        app,
        computed.Question("/v1/function/export", FunctionExportRequest, answer, lambda _: False),
        "export_function",
        tags=["function"],
        summary="A function generator as a file: JSON, CSV, SVG, DXF or MJCF.",
        response_class=Response,
        response_model=None,
        responses={**responses, 200: {"content": files}},
        openapi_extra={"requestBody": {"content": {"application/json": {"examples": bodies}}}},
    )
