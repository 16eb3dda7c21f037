"""What the benchmarks call of the product, gathered: one place to change where its modules change."""

from __future__ import annotations

import json
from typing import Any

import linkage_atlas as la
from app.fourbar.answers import answer_synthesize
from app.fourbar.models import SynthesizeRequest
from app.resources import ServiceResources
from app.settings import Settings
from benchmarks.report import Times
from linkage_atlas.motions import read_limits
from synthesis.atlas.best import best_rows
from synthesis.atlas.file import generator_versions, load_atlas
from synthesis.atlas.rows import compute_rows
from synthesis.atlas.scan import STARTS, Scan
from synthesis.atlas.table import Atlas, AtlasRule
from synthesis.atlas.windows import TIE, Windows
from synthesis.errors import FieldError
from synthesis.fourbar.charts import AnyChart, FullCrankChart
from synthesis.fourbar.dimension_types import (
    MAX_PERIMETER,
    OrderRule,
    TypeRule,
    count_types,
    enumerate_types,
)
from synthesis.fourbar.kinematics import close_loop, coupler_angle, family
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.least_squares import minimise
from synthesis.mechanism import Chart
from synthesis.pose import objective
from synthesis.search.limited import LimitedProblem
from synthesis.search.projected import ProjectedProblem
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.search.seeds import SeedTables
from synthesis.target import MIN_SPAN, TURN, Target, make_target
from synthesis.work import Work

__all__ = [
    "DEFAULT_TOLERANCE",
    "FOURBAR",
    "MAX_PERIMETER",
    "MIN_SPAN",
    "STARTS",
    "TIE",
    "TURN",
    "AnyChart",
    "Atlas",
    "AtlasRule",
    "Chart",
    "FieldError",
    "FullCrankChart",
    "LimitedProblem",
    "Limits",
    "OrderRule",
    "ProjectedProblem",
    "Scan",
    "SeedTables",
    "ServiceResources",
    "Settings",
    "Target",
    "TypeRule",
    "Windows",
    "Work",
    "answer",
    "atlas_of",
    "best_rows",
    "close_loop",
    "count_types",
    "counter_clockwise",
    "coupler_angle",
    "enumerate_types",
    "family",
    "limits_of",
    "load_atlas",
    "make_target",
    "minimise",
    "objective",
    "prepared_service",
    "search",
    "target_of",
]


def prepared_service() -> ServiceResources:
    """What a service holds after its start without an atlas file."""
    la.prepare()
    return ServiceResources(Settings())


def answer(request: dict[str, Any], resources: ServiceResources, times: Times) -> dict[str, Any]:
    """The reply of /v1/synthesize as JSON values; timed is the way from the parsed request to the reply's text."""

    def reply() -> str:
        return answer_synthesize(SynthesizeRequest.model_validate(request), resources).model_dump_json()

    return json.loads(times.run(reply))


def _motion(request: dict[str, Any]) -> la.Motion:
    parts = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return la.Motion.of(*(request.get(name) for name in parts), degrees=request.get("angle_unit", "deg") == "deg")


def target_of(request: dict[str, Any]) -> Target:
    """A request as the numerics see it."""
    return _motion(request).target


def counter_clockwise(target: Target) -> Target:
    """The same motion, mirrored where the crank turns clockwise."""
    return target.mirrored() if target.clockwise else target


def limits_of(request: dict[str, Any]) -> Limits:
    """The limits of a request, mirrored where its crank turns clockwise."""
    motion = _motion(request)
    limits = read_limits(request["limits"], motion)
    return limits.mirrored() if motion.target.clockwise else limits


def atlas_of(rule: AtlasRule) -> Atlas:
    """An atlas made in this process, without a file."""
    lengths = enumerate_types(rule.types)
    rows = compute_rows(lengths, rule.samples)
    return Atlas(rule=rule, lengths=lengths.astype("<u2"), generator=generator_versions(), **rows._asdict())
