"""Layers over HTTP and on the command line: can a linkage be built so that its parts pass one another, and how?"""

from __future__ import annotations

from typing import Any

from pydantic import Field

import linkage_atlas as la
from app.fourbar import QUESTIONS, worked_example
from app.fourbar.answers import budget_of, has_much_to_arrange, motion_of
from app.fourbar.answers import is_long as is_long_search
from app.fourbar.export import pointing, ranked
from app.fourbar.models import AssemblyOptions, GivenLinkage, Rank, SynthesizeRequest
from app.query import Query, Resources
from app.tables import DEGREES, Units, left_table, number
from linkage_atlas.assemblies import ASSEMBLY
from linkage_atlas.tables import request_from_csv


class AssemblyRequest(AssemblyOptions):
    """Layers for the plates of a linkage over the interval that it is used for."""

    linkage: GivenLinkage | None = Field(
        None, description="One of the solutions of a reply. Without it the request is solved."
    )
    request: SynthesizeRequest | None = Field(
        None,
        description="The request of /v1/synthesize that it answers; angles are in its unit. Without it the crank turns fully, "
        "and angles are in degrees.",
    )
    rank: Rank = Field(1, description="Which solution, if no linkage is given.")


_PLACES = {
    "solution": "/linkage",
    "crank_angle": "/linkage/crank_angle",
    "travel": "/linkage/travel",
    "motion": "/request",
}
"""Where this route has what the front door names otherwise."""


def _placed(field: str) -> str:
    first, slash, rest = field.lstrip("/").partition("/")
    return _PLACES[first] + slash + rest if first in _PLACES else field


def answer_assembly(request: AssemblyRequest, resources: Resources) -> la.Assembly:
    """Layers that are free, or what stops the best ones."""
    asked = request.given(*ASSEMBLY)
    question, given = request.request, request.linkage
    if question is None and given is None:
        raise la.FieldError("/linkage", "needed, or a `request` to be solved")
    motion = None
    if question is not None:
        for name in ("envelope", "keep_out"):
            asked[name] = asked[name] or getattr(question.limits, name)
        with pointing(lambda field: "/request" + field):
            motion = motion_of(question)
    work = resources.work(budget_of(None, resources))
    if given is None:
        assert question is not None
        with pointing(lambda field: field if field == "/rank" else "/request" + field):
            found = ranked(question, request.rank, resources)
        return la.assembly(found, work=work, **asked)
    with pointing(lambda field: "/linkage" + field):
        linkage = given.linkage(motion is None or motion.degrees)
    with pointing(_placed):
        place = given.travel if given.crank_angle is None else given.crank_angle
        return linkage.assembly(motion, place, work=work, **asked)


def _is_long(request: AssemblyRequest) -> bool:
    if request.linkage is not None:
        return has_much_to_arrange(request, request.linkage.driver)
    return request.request is not None and (is_long_search(request.request) or has_much_to_arrange(request, "crank"))


def _from_table(text: str, also: dict[str, Any], unwrap: bool) -> dict[str, Any]:
    """A table of samples is the motion of the request."""
    inner = also.get("request")
    return also | {"request": request_from_csv(text, inner if isinstance(inner, dict) else {}, unwrap)}


def assembly_table(reply: la.Assembly, units: Units = DEGREES) -> str:
    """Layers from the top down with the pins that fill them, and what is to be said of them."""
    ends = (0, reply.count + 1)
    rows = []
    for layer in range(ends[1], ends[0] - 1, -1):
        parts = [one.name for one in reply.parts if one.kind in ("plate", "board") and one.layers == (layer, layer)]
        heads = [one.name for one in reply.parts if one.kind == "head" and one.layers == (layer, layer)]
        pins = [pin.name for pin in reply.pins if pin.layers[0] <= layer <= pin.layers[1]]
        if parts or heads or layer not in ends:
            rows.append((str(layer), ", ".join([*parts, *heads]) or "-", " ".join(pins)))
    lines = [f"{reply.status}: {reply.count} layers", "", left_table(("layer", "parts", "pins"), rows), ""]
    if reply.least_gap is not None:
        gap = reply.least_gap
        where = f"at {number(gap.crank_angle)}{units.behind(units.angle)}"
        lines.append(
            f"least gap beyond the clearance: {units.value(gap.value, units.length, 6)}, {' and '.join(gap.pair)}, {where}"
        )
    sizes = ", ".join(
        f"{name} {units.value(value, units.length, 4)}" for name, value in reply.sizes._asdict().items()
    )
    return "\n".join([*lines, *reply.reasons[reply.status != "blocked" :], f"sizes: {sizes}"])


_WORKED = {
    "links": {"crank": 19, "coupler": 72, "rocker": 144, "ground": 165},
    "branch": 1,
    "start_angle": 30,
    "body_offset": -75.9054,
    "mount": {
        "ground_angle": 30,
        "pivot_a": [7.0710678118654755, 7.0710678118654755],
        "coupler_point": {"radius": 20, "angle": 60},
    },
}
"""The linkage of the worked example, as a reply has it."""
QUERIES = (
    Query(
        "assembly",
        QUESTIONS["assembly"],
        answer_assembly,
        assembly_table,
        {
            "worked_example": {"request": worked_example(), "linkage": _WORKED},
            "double_crank": {
                "linkage": {
                    "links": {"crank": 60, "coupler": 50, "rocker": 70, "ground": 30},
                    "branch": 1,
                    "start_angle": 0,
                },
                "boards": "both",
            },
            "slider_crank": {
                "linkage": {
                    "guides": [
                        {"guide": "circle", "pivot": [0, 0], "radius": 20, "body_point": [0, 0]},
                        {"guide": "rail", "point": [0, 6], "direction": 0, "body_point": [50, 0]},
                    ],
                    "driver": "crank",
                    "branch": 1,
                    "start": 0,
                },
            },
        },
        from_csv=_from_table,
        is_long=_is_long,
        reads_atlas=True,
    ),
)
