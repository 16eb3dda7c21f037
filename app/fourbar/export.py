"""The linkage as a file: the exports of /v1/synthesize, and /v1/export for any solution of a reply."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

from pydantic import Field, Strict

import linkage_atlas as la
from app.fourbar import worked_example
from app.fourbar.answers import analysis_of, answer_synthesize, is_long, motion_of
from app.fourbar.models import FarLength, GivenLinkage, SynthesizeRequest
from app.query import FILES, Files, LengthUnit, RequestModel, Resources


class PlatesRequest(RequestModel):
    """Sizes of link plates, in the unit of the request's lengths."""

    hole: FarLength | None = Field(None, description="Diameter of the holes.")
    width: FarLength | None = Field(None, description="Width of the plates.")


class ExportRequest(RequestModel):
    """A motion, one of its solutions, and the kind of file that is wanted."""

    request: SynthesizeRequest = Field(description="The request of /v1/synthesize; angles are in its unit.")
    solution: GivenLinkage | None = Field(
        None, description="One of the reply's solutions. Without it the request is solved."
    )
    rank: Annotated[int, Strict(), Field(ge=1, le=100)] = Field(1, description="Which solution, if none is given.")
    format: Literal["json", "csv", "svg", "dxf", "plates", "mjcf", "pylinkage"] = "json"
    length_unit: LengthUnit = Field("mm", description="The unit of the request's lengths, for DXF and MJCF.")
    plates: PlatesRequest | None = Field(None, description="Sizes of the plates; each has a default.")


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


def _best_linkage(request: SynthesizeRequest, resources: Resources, kind: str) -> str:
    best = ranked(request, 1, resources)
    with pointing(lambda field: field if field == "/format" else ""):
        return best.linkage.render(kind, analysis=analysis_of(request))


def exports_of(
    formats: tuple[str, ...], render: Callable[[Any, Resources, str], str]
) -> dict[str, Callable[[Any, Resources], bytes]]:
    """The best solution of a request in some formats."""
    return {
        FILES[kind].endings[0]: lambda *asked, kind=kind: render(*asked, kind).encode()  # type: ignore[misc]
        for kind in formats
    }


SYNTHESIZE_EXPORTS = exports_of(("csv", "svg", "dxf", "plates", "mjcf", "pylinkage"), _best_linkage)


def as_json(request: RequestModel, solution: Any) -> bytes:
    """A solution beside its request."""
    content = {"request": request.model_dump(mode="json", exclude_defaults=True), "solution": solution}
    return json.dumps(content, indent=1, allow_nan=False).encode()


_PREFIXES = {"crank_angle": "/solution", "travel": "/solution", "analysis": "/request"}


def _linkage_file(body: ExportRequest, resources: Resources) -> bytes:
    request, given = body.request, body.solution
    with pointing(lambda field: field if field == "/rank" else "/request" + field):
        motion = la.Motion(**motion_of(request))
        found = None if given else ranked(request, body.rank, resources)
    with pointing(lambda field: "/solution" + field):
        linkage = found.linkage if found else given.linkage(request.degrees)
    if body.format == "json":
        return as_json(request, found.to_dict() if found else given.model_dump(mode="json", exclude_none=True))
    one = found or given
    place = one.crank_angle if one.crank_angle is not None else getattr(one, "travel", None)
    with pointing(lambda field: _PREFIXES.get(field.lstrip("/").partition("/")[0], "") + field):
        plates = None if body.plates is None else body.plates.model_dump(exclude_none=True)
        text = linkage.render(body.format, motion, body.length_unit, place, analysis_of(request), plates)
    return text.encode()


LINKAGE_FILES = Files(
    "/v1/export",
    "export",
    "linkage",
    "A linkage as a file: JSON, CSV, SVG, DXF, plates to cut, MJCF or pylinkage's JSON.",
    ExportRequest,
    _linkage_file,
    {"request": worked_example()},
    lambda body: body.solution is None and is_long(body.request),
)
