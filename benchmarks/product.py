"""Internal functions of the product that the benchmarks call, gathered in a module that is adapted when the product changes."""

# ruff: noqa: F401 - other benchmarks import these names from here

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np

import linkage_atlas as la
from app.fourbar.answers import answer_synthesize
from app.fourbar.models import SynthesizeRequest
from app.query import json_of
from app.resources import ServiceResources
from app.settings import Settings
from benchmarks.report import Times
from linkage_atlas.limits import read_limits
from linkage_atlas.motions import Motion
from synthesis.atlas.scan import STARTS, Scan
from synthesis.atlas.windows import TIE, Windows
from synthesis.descents import Pool, Stage, Timed
from synthesis.errors import FieldError
from synthesis.four_bar import close_loop, coupler_angle, family
from synthesis.fourbar.dimension_types import MAX_PERIMETER, OrderRule, TypeRule, count_types, enumerate_types
from synthesis.fourbar.mechanism import AnyChart, GrashofChart, mounted, search_spaces
from synthesis.free.joint import JointProblem
from synthesis.limits import Limits
from synthesis.mechanism import Placed
from synthesis.pose import objective
from synthesis.poses import make_poses
from synthesis.search.atlas_rows import best_rows
from synthesis.search.error_table import ErrorTable
from synthesis.search.prescribed import GivenProblem, candidates_at, problem_of
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.search.seeds import SeedTables
from synthesis.solution import Solution, assess
from synthesis.target import MIN_SPAN, TURN, Target, make_target
from synthesis.violations import within
from synthesis.work import Work


def prepared_service() -> ServiceResources:
    """Tables of a service after its start without an atlas file."""
    la.prepare()
    return ServiceResources(Settings())


def answer(request: dict[str, Any], resources: ServiceResources, times: Times) -> dict[str, Any]:
    """The reply of /v2/synthesize as JSON values; timed is the way from the parsed request to the reply's text."""

    def reply() -> bytes:
        return json_of(answer_synthesize(SynthesizeRequest.model_validate(request), resources))

    return json.loads(times.run(reply))


def target_of(request: dict[str, Any]) -> Target:
    """A request as the numerics see it."""
    names = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return Motion(**{name: request.get(name) for name in names}).target


class ProcessorWork(Work):
    """Work measured in processor time, which other processes do not lengthen."""

    def __init__(self, budget: float | None = None) -> None:
        super().__init__(budget, clock=time.process_time)


def limits_of(request: dict[str, Any]) -> Limits:
    """The limits of a request as the numerics see them."""
    names = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return read_limits(request["limits"], Motion(**{name: request.get(name) for name in names}))


def counter_clockwise(motion: Target, *limits: Limits) -> Any:
    """Return the motion, and its limits if given, mirrored if the crank turns clockwise."""
    both = (motion, *limits)
    both = tuple(search_space.mirrored() for search_space in both) if motion.clockwise else both
    return both if limits else both[0]


def refine(problem: GivenProblem, seeds: Timed, steps: int, tolerance: float = 0.0) -> Pool:
    """Refine seeds in turn until an error is below the tolerance."""
    return problem.descended(seeds, [Stage(steps)], tolerance, steps_after_first=0.0)


def solved(target: Target, lengths: Any, branch: Any, start: Any) -> list[Solution]:
    """Linkages of given shapes in their best pose, with their errors."""
    return assess(target, mounted(target, lengths, branch, start))


def solution_of(linkage: la.FourBar, target: Target) -> Solution:
    """A linkage as an answer to a motion."""
    return assess(target, [linkage._linkage])[0]


def scan_of(rule: TypeRule) -> Scan:
    """Return the scan of the types of a rule, made in this process."""
    return Scan(enumerate_types(rule))
