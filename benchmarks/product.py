"""What the benchmarks call of the product, gathered: one place to change where its modules change."""

# ruff: noqa: F401 - other benchmarks import these names from here

from __future__ import annotations

import json
from typing import Any

import numpy as np
from app.motion import SynthesizeRequest, answer_synthesize
from synthesis.fourbar.pose import objective
from synthesis.search.refine import LimitedProblem, Problem, refine

from app.resources import ServiceResources
from app.settings import Settings
from benchmarks.report import Times
from synthesis.atlas.best import best_rows
from synthesis.atlas.file import Atlas, AtlasRule, generator_versions, load_atlas
from synthesis.atlas.rows import compute_rows
from synthesis.atlas.scan import STARTS, TIE, Scan, Windows, window_errors
from synthesis.errors import FieldError
from synthesis.fourbar.charts import AnyChart, Chart, FullCrankChart
from synthesis.fourbar.dimension_types import (
    MAX_PERIMETER,
    OrderRule,
    TypeRule,
    count_types,
    enumerate_types,
)
from synthesis.fourbar.kinematics import TURN, close_loop, coupler_angle, family
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.solution import make_solutions
from synthesis.search.search import DEFAULT_TOLERANCE, Levels, mirrored, search
from synthesis.target import MIN_SPAN, Target, make_target


def prepared_service() -> ServiceResources:
    """What a service holds after its start without an atlas file."""
    resources = ServiceResources(Settings())
    _ = resources.levels
    return resources


def answer(request: dict[str, Any], resources: ServiceResources, times: Times) -> dict[str, Any]:
    """The reply of /v1/synthesize as JSON values; timed is the way from the parsed request to the reply's text."""

    def reply() -> str:
        return answer_synthesize(SynthesizeRequest.model_validate(request), resources).model_dump_json()

    return json.loads(times.run(reply))


def target_of(request: dict[str, Any]) -> Target:
    """A request as the numerics see it."""
    model = SynthesizeRequest.model_validate(request)
    return model.target(model.rotation, model.position, model.length_scale)


def counter_clockwise(target: Target) -> Target:
    """The same motion, mirrored where the crank turns clockwise."""
    return mirrored(target) if target.span < 0 else target


def limits_of(request: dict[str, Any], clockwise: bool = False) -> Limits:
    """The limits of a request, mirrored where its crank turns clockwise."""
    asked = request["limits"]
    box = asked.get("pivot_box")
    if clockwise and box is not None:
        box = (box[0], -box[3], box[2], -box[1])
    least = np.radians(asked.get("transmission_angle_min", 0.0))
    return Limits(
        asked["family"], least, None if box is None else tuple(box), asked.get("link_min"), asked.get("link_max")
    )


def atlas_of(rule: AtlasRule) -> Atlas:
    """An atlas made in this process, without a file."""
    lengths = enumerate_types(rule.types)
    rows = compute_rows(lengths, rule.samples)
    return Atlas(rule, lengths.astype("<u2"), generator=generator_versions(), **rows._asdict())
