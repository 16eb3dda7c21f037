"""Answers to the queries about linkages, computed by functions of `linkage_atlas`, and exports of linkages."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from inspect import signature
from typing import Any, NamedTuple

import linkage_atlas as la
from app.fourbar import QUESTIONS, worked_example
from app.fourbar.function_models import FunctionExportRequest, FunctionRequest
from app.fourbar.models import AssemblyRequest, DrivesRequest, ExportRequest, MatchRequest, SynthesizeRequest
from app.fourbar.motion import answer_motion, motion_table
from app.fourbar.parts import GivenLinkage
from app.fourbar.tables import assembly_table, drives_table, function_table, matches_table, synthesize_table
from app.query import Files, Query, RequestModel, Resources, bundled_requests, in_unit
from linkage_atlas.arguments import pointing
from linkage_atlas.assemblies import ASSEMBLY
from linkage_atlas.formats import HELD, OF_PARTS
from linkage_atlas.notes import counted

# -- motions ----------------------------------------------------------------------------------------------------------

SHORT_MS = 200.0
"""Largest budget of a short request, ms; a worker is reserved for short requests."""


def is_long(request: Any) -> bool:
    """Return whether an answer may take long: a search without a short budget, or with no linkage to begin with."""
    if "budget_ms" in type(request).model_fields:
        return request.budget_ms is None or request.budget_ms > SHORT_MS
    return request.linkage is None


def answer_match(request: MatchRequest, resources: Resources) -> la.Matches:
    """Find the rows of the atlas with the most similar rotation."""
    return la.match(**_arguments(request, resources), atlas=resources.atlas)


def _arguments(request: MatchRequest | FunctionRequest, resources: Resources) -> dict[str, Any]:
    """Return the fields of a request as arguments, with the unit of angles and the time limit."""
    return {
        **request.arguments(exclude=("angle_unit", "budget_ms")),
        "degrees": request.angle_unit == "deg",
        "budget": budget_of(request.budget_ms, resources),
        "work": resources.work,
    }


def budget_of(budget_ms: float | None, resources: Resources) -> float | None:
    """Return the time limit of a request in seconds: its budget or the limit of the service; None for no limit."""
    limit = min(budget_ms or resources.max_budget_ms, resources.max_budget_ms)
    return None if math.isinf(limit) else limit / 1000


def answer_synthesize(request: SynthesizeRequest, resources: Resources) -> la.Result:
    """Find linkages for a motion, best first."""
    arguments = request.arguments(exclude=("angle_unit", "budget_ms"))
    return la.synthesize(
        **arguments,
        degrees=request.degrees,
        budget=None if request.budget_ms is None else budget_of(request.budget_ms, resources),
        atlas=resources.atlas if request.effort == "atlas" else None,
        work=lambda budget: resources.work(budget or budget_of(None, resources)),
    )


MOTION = tuple(name for name in signature(la.Motion).parameters if name in SynthesizeRequest.model_fields)
"""Fields of a request that describe its motion."""
PLACES = {
    "solution": "/linkage",
    "crank_angle": "/linkage/crank_angle",
    "travel": "/linkage/travel",
    "motion": "/request",
    "analysis": "/request/analysis",
    "kind": "/format",
}
"""Fields of the bodies of routes by the arguments of a linkage's methods that have another name."""


def in_body(field: str, **more: str) -> str:
    """Return the field of the body of a route for an argument of a linkage's method."""
    first, slash, remainder = field.lstrip("/").partition("/")
    return (PLACES | more).get(first, f"/{first}" if first else "") + slash + remainder


def motion_of(request: SynthesizeRequest) -> la.Motion:
    """Return the motion of a request that is a part of a body."""
    with pointing(lambda field: "/request" + field):
        return la.Motion(**request.arguments(*MOTION), degrees=request.degrees)


class Subject(NamedTuple):
    """Linkage of a body: given, or the solution of a request."""

    motion: la.Motion | None
    linkage: la.Linkage
    travel: Any
    """Travel of the drive at the samples; None if it is not known."""
    source: Any
    """The given linkage or the solution."""


def subject_of(
    request: SynthesizeRequest | None, known: GivenLinkage | None, rank: int, resources: Resources
) -> Subject:
    """Return the given linkage of a body, or solve its request; raise `FieldError` if there are fewer solutions."""
    motion = None if request is None else motion_of(request)
    source: Any = known
    if known is not None:
        linkage = known.linkage(motion is None or motion.degrees)
    elif request is None:
        raise la.FieldError(
            "/linkage", "is required: pass a solution of a reply, or give a `request`, which is then solved"
        )
    else:
        with pointing(lambda field: field if field == "/rank" else "/request" + field):
            source = ranked(request, rank, resources)
        linkage = source.linkage
    return Subject(motion, linkage, source.travel if source.crank_angle is None else source.crank_angle, source)


# -- a linkage as a file ----------------------------------------------------------------------------------------------


def ranked(request: SynthesizeRequest, rank: int, resources: Resources) -> la.Solution:
    """Solve a request and return the solution of a rank; raise `FieldError` if there are fewer solutions."""
    solutions = answer_synthesize(request.model_copy(update={"top": max(request.top, rank)}), resources).solutions
    if not solutions:
        raise la.FieldError("/limits", "no linkage was found within these limits; relax a limit")
    if len(solutions) < rank:
        found = f"{counted(len(solutions), 'linkage')} {'was' if len(solutions) == 1 else 'were'} found"
        message = f"must be at most {len(solutions)}; within these limits {found}"
        raise la.FieldError("/rank", message)
    return solutions[rank - 1]


def as_json(request: RequestModel, linkage: Any, length_unit: str | None = None) -> bytes:
    """Return a linkage with its request as JSON, and the unit of their lengths if it is known."""
    content = {"request": request.model_dump(mode="json", exclude_defaults=True), "linkage": linkage}
    content |= {"length_unit": length_unit} if length_unit else {}
    return json.dumps(content, indent=1, allow_nan=False).encode()


def _linkage_file(body: ExportRequest, resources: Resources) -> bytes:
    from linkage_atlas.files import check_held  # a command that writes no file does not load it

    options = body.arguments("assembly", "solids", "drive")
    check_held(body.format, **options)
    with pointing(lambda field: "/request" + field):
        request = in_unit(body.request, body.length_unit)
    motion, linkage, travel, source = subject_of(request, body.linkage, body.rank, resources)

    def plain(part: Any) -> Any:
        return part.to_dict() if body.linkage is None else part.model_dump(mode="json", exclude_none=True)

    if body.format == "json":
        return as_json(body.request, plain(source), body.length_unit)
    if "drive" not in body.model_fields_set and (drive := _drive_in(body.format, source.drives or ())) is not None:
        options["drive"] = plain(drive)
    more = {}
    if body.format in HELD["assembly"] and body.assembly is None and request.assembly is not None:
        options |= request.arguments("assembly")
        more = {"assembly": "/request/assembly"}

    def in_export(field: str) -> str:
        if field.startswith("/assembly/drive") and options.get("drive") is not None:  # the drive is one of the parts
            return field.removeprefix("/assembly")
        return in_body(field, **more)

    with pointing(in_export):
        unit = body.length_unit or (request.analysis.length_unit if request.analysis else None)
        arguments = request.arguments("analysis") | options
        return linkage.file(body.format, motion, unit, travel, **arguments, work=resources.work())


def _drive_in(kind: str, drives: Sequence[Any]) -> Any:
    """Return the first of a solution's drives that a file of a kind can hold; None if it can hold no drive."""
    if kind in HELD["drive"]:
        return next(iter(drives), None)
    if kind not in (*OF_PARTS, "plates"):
        return None
    on_plates = [drive for drive in drives if not drive.link.endswith("slider")]
    return next(iter([*on_plates, *drives]), None)


LINKAGE_FILES = Files(
    "/v2/export",
    "export",
    "linkage",
    "Export a linkage: JSON, CSV, SVG, DXF, plates to cut, MJCF, STEP, 3MF, STL or a parts list.",
    ExportRequest,
    _linkage_file,
    {"request": worked_example()},
    is_long,
)


# -- what drives a linkage --------------------------------------------------------------------------------------------


def find_drives(request: DrivesRequest, resources: Resources) -> la.Drives:
    """Find drives of each kind, best first, and the reasons for which a kind is not possible."""
    if request.linkage is None and request.rocker is None:
        raise la.FieldError(
            "/linkage", "is required: pass a solution of a reply, or give `rocker`, a link on a hinge"
        )
    unit = request.angle_unit or ("deg" if request.request is None else request.request.angle_unit)
    motion = None
    if request.request is not None:
        if request.request.angle_unit != unit:
            raise la.FieldError(
                "/angle_unit",
                f"must be {request.request.angle_unit!r}, the unit of the request that the linkage comes from",
            )
        motion = motion_of(request.request)
        if request.crank_angle is not None and (not motion.free or motion.travel is not None):
            message = "must be left out, because the `request` already prescribes the crank angles or the travel"
            raise la.FieldError("/crank_angle", message)
    linkage, crank = None, request.crank_angle
    if request.linkage is not None:
        linkage = request.linkage.linkage(unit == "deg")
        crank = crank or request.linkage.crank_angle or request.linkage.travel
    return la.drives(
        linkage,
        **request.arguments("drives", "load", "springs", "rocker", "hand_point", "length_unit", "top"),
        motion=motion,
        crank_angle=crank,
        degrees=unit == "deg",
        budget=budget_of(request.budget_ms, resources),
        work=resources.work,
    )


def _drive_curves(request: DrivesRequest, resources: Resources, kind: str) -> bytes:
    """Return the curves of all drives and springs over the motion."""
    from linkage_atlas.drive_design.curves import curves_csv, curves_svg

    found = find_drives(request, resources)
    items = [*found.drives, *found.springs]
    return (curves_csv(items) if kind == "csv" else curves_svg(items, found.torque)).encode()


# -- layers -----------------------------------------------------------------------------------------------------------


def answer_assembly(request: AssemblyRequest, resources: Resources) -> la.Assembly:
    """Arrange the plates of a linkage in layers without collisions, or find what prevents it."""
    options, work = request.arguments(*ASSEMBLY), resources.work(budget_of(None, resources))
    for name in ("envelope", "keep_out") if request.request is not None else ():
        options[name] = getattr(request.request.limits, name) if options[name] is None else options[name]
    motion, linkage, travel, source = subject_of(request.request, request.linkage, request.rank, resources)
    if source is not request.linkage:
        return linkage.assembly(work=work, **options)
    with pointing(in_body):
        return linkage.assembly(motion, travel, work=work, **options)


# -- functions --------------------------------------------------------------------------------------------------------


def solve_function(request: FunctionRequest, resources: Resources) -> la.FunctionResult:
    """Find linkages that generate a function."""
    return la.function(**_arguments(request, resources))


def _function_file(body: FunctionExportRequest, resources: Resources) -> bytes:
    from linkage_atlas.functions.question import FunctionFields
    from linkage_atlas.functions.results import render

    request, solution = body.request, body.linkage
    if body.format == "json":
        unit = body.length_unit if "length_unit" in body.model_fields_set else None
        unused = {"joints"} if solution.joints is None else None
        return as_json(request, solution.model_dump(mode="json", exclude=unused), unit)
    degrees = request.angle_unit == "deg"
    generator = solution.linkage(degrees)
    names = [field.name for field in fields(FunctionFields) if field.name in FunctionRequest.model_fields]
    with pointing(lambda field: "/request" + field):
        question = FunctionFields(**request.arguments(*names), degrees=degrees).question()
        if question.dial.travels == generator.plain.is_four_bar:
            raise la.FieldError("/output_unit", "is not the unit of the solution; send the request of this solution")
    return render(question, generator, solution.output_offset, body.format, body.length_unit).encode()


FUNCTION_FILES = Files(
    "/v2/function/export",
    "export_function",
    "function",
    "Export a function generator: JSON, CSV, SVG, DXF or MJCF.",
    FunctionExportRequest,
    _function_file,
    bundled_requests()["export_function"],
)

# -- all queries ----------------------------------------------------------------------------------------------------------

QUERIES = (
    Query("match", QUESTIONS["match"], answer_match, matches_table, is_long=is_long, reads_atlas=True),
    Query(
        "synthesize",
        QUESTIONS["synthesize"],
        answer_synthesize,
        synthesize_table,
        is_long=is_long,
        files=LINKAGE_FILES,
        reads_atlas=True,
    ),
    Query("function", QUESTIONS["function"], solve_function, function_table, is_long=is_long, files=FUNCTION_FILES),
    Query("assembly", QUESTIONS["assembly"], answer_assembly, assembly_table, is_long=is_long, reads_atlas=True),
    Query("motion", QUESTIONS["motion"], answer_motion, motion_table, shows_units=False),
    Query(
        "drive",
        QUESTIONS["drive"],
        find_drives,
        drives_table,
        exports={kind: partial(_drive_curves, kind=kind) for kind in ("csv", "svg")},
        is_long=is_long,
        route="/v2/drives",
    ),
)
