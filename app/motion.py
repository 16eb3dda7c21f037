"""The four-bar's questions: /v1/match and /v1/synthesize, their models and their answers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from app.query import AngleUnit, Count, Flag, Number, PositiveNumber, ReplyModel, RequestModel, Resources
from synthesis.atlas.best import best_rows
from synthesis.atlas.haar import features, resample
from synthesis.atlas.scan import window_angles
from synthesis.errors import FieldError
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.rounding import round_solution
from synthesis.fourbar.solution import (
    Determination,
    Sensitivity,
    Solution,
    Status,
    determinations,
    principal,
    sensitivities,
)
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.target import MAX_LENGTH, MAX_SAMPLES, MIN_LENGTH, MIN_SAMPLES, Target, make_target

MAX_TOP = 1000

Curve = Annotated[list[Number], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)]
Coordinate = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
Length = Annotated[Number, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Path = Annotated[list[Point], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)]
Top = Annotated[Count, Field(ge=1, le=MAX_TOP)]


class CrankMotion(RequestModel):
    """Crank angles of a request: evenly spaced over a span, or given one by one."""

    crank_span: Number | None = Field(
        None,
        description="Crank angle from the first sample to the last, both included, evenly spaced; < 0: clockwise.",
    )
    crank_angle: Curve | None = Field(
        None, description="Crank angles in place of `crank_span`; what counts is the increment from the first."
    )
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")

    @property
    def unit(self) -> float:
        """Radians in one unit of angle."""
        return np.pi / 180 if self.angle_unit == "deg" else 1.0

    def target(self, rotation: list[float] | None, position: list[Any] | None, length_scale: float | None) -> Target:
        """The checked target of this request."""
        with np.errstate(over="ignore"):
            xy = None if position is None else np.array([complex(x, y) for x, y in position])
            return make_target(
                None if rotation is None else np.array(rotation) * self.unit,
                xy,
                None if self.crank_span is None else self.crank_span * self.unit,
                None if self.crank_angle is None else np.array(self.crank_angle) * self.unit,
                length_scale,
            )


class MatchRequest(CrankMotion):
    """Which atlas rows turn the body like this, and from which start?"""

    rotation: Curve = Field(description="Rotation of the body at the samples, continuous: no jumps by whole turns.")
    top: Top = Field(10, description="How many rows to return.")
    features: Flag = Field(
        False, description="Also return Haar average and details of the request and of each match."
    )


class TypeReply(ReplyModel):
    number: int = Field(description="Number of the dimension type, from 1.")
    lengths: list[int] = Field(description="L1 crank, L2 coupler, L3 rocker, L4 ground.")


class FeaturesReply(ReplyModel):
    samples: int
    resampled: bool = Field(description="Whether the samples were resampled to a power of two of even crank angles.")
    average: float
    details: list[float] = Field(
        description="(mean of first half - mean of second half) / 2 of each block, coarse to fine."
    )


class MatchReply(ReplyModel):
    rank: int
    type: TypeReply
    start_angle: float
    branch: Literal[-1, 1]
    offset: float = Field(
        description="Added to the coupler angle (in -180..180 degrees at the first sample, continuous)."
    )
    similarity: float = Field(description="Rms rotation error of this row at this start.")
    features: FeaturesReply | None = None


class MatchesReport(ReplyModel):
    elapsed_ms: dict[str, float]
    windows: int = Field(description="Types x starts x branches that the answer is the best of.")
    evaluated: int = Field(description="Windows evaluated sample by sample; the bounds excluded the others.")
    notes: list[str]
    features: FeaturesReply | None = None


class MatchesReply(ReplyModel):
    matches: list[MatchReply]
    report: MatchesReport


def _expiry(resources: Resources, deadline: float) -> Callable[[], bool]:
    """Whether the deadline has passed; asks the clock also where there is none, for whether the answer is still wanted."""
    return lambda: resources.clock() >= deadline


def rotation_notes(target: Target) -> list[str]:
    """What a user should know about a rotation that looks wrapped."""
    if target.rotation is None:
        return []
    jump = np.abs(np.diff(target.rotation))
    if jump.max() <= np.pi:
        return []
    place = int(np.argmax(jump))
    return [
        f"rotation jumps by more than half a turn from sample {place} to {place + 1}; it is taken as continuous, "
        "so if that is a wrap at 180 or 360 degrees, unwrap it"
    ]


def _features(crank: np.ndarray, curve: np.ndarray, unit: float) -> FeaturesReply:
    resampled = resample(crank, curve)[1]
    average, details = features(resampled)
    return FeaturesReply(
        samples=resampled.size,
        resampled=resampled is not curve,
        average=float(average / unit),
        details=[float(value / unit) for value in details],
    )


def answer_match(request: MatchRequest, resources: Resources) -> MatchesReply:
    """The best rows by rotation alone; no pose is computed."""
    scan = resources.atlas.scan
    begin = resources.clock()
    unit = request.unit
    target = request.target(request.rotation, None, None)
    windows, report = scan.best(target, request.top, expired=_expiry(resources, np.inf))
    screened = resources.clock()
    angles = window_angles(scan.lengths, target, windows)
    matches = []
    for rank, angle in enumerate(angles, 1):
        angle = principal(angle)
        lengths = [int(value) for value in scan.lengths[windows.row[rank - 1]]]
        matches.append(
            MatchReply(
                rank=rank,
                type=TypeReply(number=int(windows.row[rank - 1]) + 1, lengths=lengths),
                start_angle=float(windows.start[rank - 1]) * (np.pi / 180 / unit),
                branch=int(windows.branch[rank - 1]),
                offset=float(np.mean(target.rotation - angle) / unit),
                similarity=float(windows.error[rank - 1] / unit),
                features=_features(target.crank, angle, unit) if request.features else None,
            )
        )
    own = _features(target.crank, target.rotation, unit) if request.features else None
    end = resources.clock()
    elapsed = {"screen": screened - begin, "rest": end - screened, "total": end - begin}
    return MatchesReply(
        matches=matches,
        report=MatchesReport(
            elapsed_ms={name: 1000 * value for name, value in elapsed.items()},
            windows=report.windows,
            evaluated=report.evaluated,
            notes=rotation_notes(target),
            features=own,
        ),
    )


# -- synthesize -------------------------------------------------------------------------------------------------------


class LimitsRequest(RequestModel):
    """What every solution must keep to."""

    transmission_angle_min: Number = Field(0.0, description="Smallest transmission angle over the used interval.")
    pivot_box: Annotated[list[Coordinate], Field(min_length=4, max_length=4)] | None = Field(
        None, description="xmin, ymin, xmax, ymax for both fixed pivots."
    )
    link_min: Length | None = Field(None, description="Shortest length of any link.")
    link_max: Length | None = Field(None, description="Longest length of any link.")
    family: Literal["full_crank", "crank_rocker", "double_crank", "any"] = Field(
        "full_crank", description="`any`: closes over the used interval without changing its branch."
    )


class SynthesizeRequest(CrankMotion):
    """Which linkage moves a body like this: its dimensions and where it is mounted?"""

    rotation: Curve | None = Field(None, description="Rotation of the body at the samples, continuous.")
    position: Path | None = Field(None, description="Positions [x, y] of a point of the body, in any unit of length.")
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="How many different linkages to return.")
    effort: Literal["atlas", "refine"] = Field("refine", description="`atlas`: the best rows as they are, mounted.")
    limits: LimitsRequest = Field(default_factory=LimitsRequest)
    tolerance: Annotated[Number, Field(ge=0, le=1)] = Field(
        DEFAULT_TOLERANCE, description="The search ends when the objective is below this."
    )
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")
    length_scale: Length | None = Field(
        None,
        description="Weighs position errors against rotation errors in radians. Default: the largest distance of a "
        "position from the mean position.",
    )
    round_to: Length | None = Field(
        None, description="Also report each solution with its links rounded to this grid and the rest fitted anew."
    )
    sensitivity: Flag = Field(False, description="Also report the change of the motion per unit of each length.")


class LinksReply(ReplyModel):
    crank: float
    coupler: float
    rocker: float
    ground: float


class CouplerPointReply(ReplyModel):
    radius: float
    angle: float


class MountReply(ReplyModel):
    ground_angle: float = Field(description="Angle of the line from pivot A to pivot B.")
    pivot_a: tuple[float, float] = Field(description="Fixed pivot of the crank.")
    pivot_b: tuple[float, float] = Field(description="Fixed pivot of the rocker.")
    coupler_point: CouplerPointReply = Field(
        description="P = D + radius e^(i (angle + coupler angle + ground angle)), D the crank pin."
    )
    L_B: float = Field(description="Distance of pivot A from the origin.")
    beta: float = Field(description="Angle of pivot A as seen from the origin.")


class ErrorsReply(ReplyModel):
    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float = Field(
        description="sqrt(mean square rotation error in radians + mean square position error / l^2)"
    )


class DeterminationReply(ReplyModel):
    ill_posed: bool = Field(
        description="A length is not even fixed to a thousandth by the motion at this resolution."
    )
    resolution: float = Field(
        description="Error of the motion that is considered: the objective, at least the tolerance."
    )
    length_uncertainty: list[float | None] = Field(
        description="Relative change of crank, coupler, rocker, ground within that resolution; null: not determined at all."
    )


class SensitivityReply(ReplyModel):
    rotation: list[float] | None = Field(
        description="Rms change of rotation per unit of crank, coupler, rocker, ground."
    )
    position: list[float] | None = Field(
        description="Rms change of position per unit of crank, coupler, rocker, ground."
    )


class RoundedReply(ReplyModel):
    closes: bool
    links: LinksReply | None
    start_angle: float | None
    body_offset: float | None
    mount: MountReply | None
    errors: ErrorsReply | None
    transmission_angle_min: float | None = Field(description="Over the used interval; limits are not applied again.")


class SolutionReply(ReplyModel):
    rank: int
    source: Literal["atlas", "refined"]
    type: TypeReply | None
    links: LinksReply
    branch: Literal[-1, 1]
    start_angle: float
    body_offset: float | None = Field(
        description="rotation = coupler angle (in -180..180 degrees at the first sample, continuous) + ground angle + this."
    )
    mount: MountReply | None
    errors: ErrorsReply
    family: str
    transmission_angle_min: float = Field(description="Over the used interval.")
    transmission_angle_min_turn: float | None = Field(
        description="Over the whole turn; null if the crank cannot turn."
    )
    condition: float = Field(description="Condition number of the motion's derivatives by all unknowns.")
    determination: DeterminationReply
    sensitivity: SensitivityReply | None = None
    rounded: RoundedReply | None = None


class SynthesizeReport(ReplyModel):
    elapsed_ms: dict[str, float]
    trace: list[tuple[float, float]] = Field(description="[milliseconds, best objective] after each round.")
    stopped_by: Literal["tolerance", "converged", "budget"]
    length_scale: float | None
    seeds: int | None = Field(description="Starting points refined; null for effort atlas.")
    windows: int | None = Field(description="Atlas windows that the answer is the best of; null for effort refine.")
    exhaustive: bool | None = Field(description="Whether all windows were considered; null for effort refine.")
    notes: list[str]


class SynthesizeReply(ReplyModel):
    status: Literal["reached", "closest", "infeasible"]
    solutions: list[SolutionReply]
    report: SynthesizeReport


def _limits(request: SynthesizeRequest) -> Limits:
    asked = request.limits
    return Limits(
        asked.family,
        asked.transmission_angle_min * request.unit,
        None if asked.pivot_box is None else tuple(asked.pivot_box),
        asked.link_min,
        asked.link_max,
    )


def _links(links: np.ndarray) -> LinksReply:
    return LinksReply(**dict(zip(("crank", "coupler", "rocker", "ground"), links.tolist())))


def _mount(solution: Solution, unit: float) -> MountReply | None:
    pose = solution.mount
    if pose is None:
        return None
    return MountReply(
        ground_angle=pose.ground_angle / unit,
        pivot_a=(pose.pivot_a.real, pose.pivot_a.imag),
        pivot_b=(pose.pivot_b.real, pose.pivot_b.imag),
        coupler_point=CouplerPointReply(radius=pose.coupler_radius, angle=pose.coupler_angle / unit),
        L_B=abs(pose.pivot_a),
        beta=float(np.angle(pose.pivot_a)) / unit,
    )


def _errors(solution: Solution, unit: float) -> ErrorsReply:
    errors = solution.errors
    turned = [None if value is None else value / unit for value in (errors.rotation_rms, errors.rotation_max)]
    return ErrorsReply(
        rotation_rms=turned[0],
        rotation_max=turned[1],
        position_rms=errors.position_rms,
        position_max=errors.position_max,
        objective=errors.objective,
    )


_ROUNDED_FIELDS = ("links", "start_angle", "body_offset", "mount", "errors", "transmission_angle_min")


def _rounded(target: Target, solution: Solution, grid: float, unit: float) -> RoundedReply:
    rounded = round_solution(target, solution, grid)
    if rounded is None:
        return RoundedReply(closes=False, **dict.fromkeys(_ROUNDED_FIELDS))
    return RoundedReply(
        closes=True,
        links=_links(rounded.links),
        start_angle=rounded.start / unit,
        body_offset=None if rounded.body_offset is None else rounded.body_offset / unit,
        mount=_mount(rounded, unit),
        errors=_errors(rounded, unit),
        transmission_angle_min=rounded.transmission_angle_min / unit,
    )


def _solutions(request: SynthesizeRequest, target: Target, solutions: list[Solution]) -> list[SolutionReply]:
    resolutions = [max(solution.errors.objective, request.tolerance) for solution in solutions]
    fixed = determinations(target, solutions, resolutions)
    changes = sensitivities(target, solutions) if request.sensitivity else [None] * len(solutions)
    return [_solution(request, target, rank, *parts) for rank, parts in enumerate(zip(solutions, fixed, changes), 1)]


def _solution(
    request: SynthesizeRequest,
    target: Target,
    rank: int,
    solution: Solution,
    fixed: Determination,
    change: Sensitivity | None,
) -> SolutionReply:
    unit = request.unit
    row = None
    if solution.row is not None:
        row = solution.row + 1
    turn = solution.transmission_angle_min_turn
    return SolutionReply(
        rank=rank,
        source="refined" if row is None else "atlas",
        type=None,
        links=_links(solution.links),
        branch=solution.branch,
        start_angle=solution.start / unit,
        body_offset=None if solution.body_offset is None else solution.body_offset / unit,
        mount=_mount(solution, unit),
        errors=_errors(solution, unit),
        family=solution.family.value,
        transmission_angle_min=solution.transmission_angle_min / unit,
        transmission_angle_min_turn=None if turn is None else turn / unit,
        condition=fixed.condition,
        determination=DeterminationReply(
            ill_posed=fixed.ill_posed,
            resolution=fixed.resolution,
            length_uncertainty=[v if np.isfinite(v) else None for v in fixed.length_uncertainty.tolist()],
        ),
        sensitivity=None
        if change is None
        else SensitivityReply(
            rotation=None if change.rotation is None else (change.rotation / unit).tolist(),
            position=None if change.position is None else change.position.tolist(),
        ),
        rounded=None if request.round_to is None else _rounded(target, solution, request.round_to, unit),
    )


def answer_synthesize(request: SynthesizeRequest, resources: Resources) -> SynthesizeReply:
    """Linkages with actual dimensions and pose, best first."""
    # what is made once, by the first request at the latest, is no part of this request's time
    _ = resources.atlas if request.effort == "atlas" else resources.levels
    begin = resources.clock()
    target = request.target(request.rotation, request.position, request.length_scale)
    limits = _limits(request)
    limits.check_against(target)
    if request.round_to is not None and target.position is None:
        raise FieldError("/round_to", "needs `position`: without it no length is actual")
    if request.effort == "atlas":
        solutions, report, elapsed = _from_atlas(request, target, limits, resources, begin)
    else:
        solutions, report, elapsed = _refined(request, target, limits, resources, begin)
    found = resources.clock()
    replies = _solutions(request, target, solutions)
    if request.effort == "atlas":
        scan = resources.atlas.scan
        types = [TypeReply(number=s.row + 1, lengths=[int(v) for v in scan.lengths[s.row]]) for s in solutions]
        replies = [reply.model_copy(update={"type": kind}) for reply, kind in zip(replies, types)]
    end = resources.clock()
    elapsed |= {"report": end - found, "total": end - begin}
    notes = rotation_notes(target)
    if replies and replies[0].determination.ill_posed:
        notes.append(
            "the problem is ill-posed: quite different linkages give this motion to within the resolution; "
            "see `determination` of each solution"
        )
    if not replies and report["stopped_by"] == "budget":
        notes.append("nothing within the limits was found before the search was cut short; that proves nothing")
    return SynthesizeReply(
        solutions=replies,
        report=SynthesizeReport(
            elapsed_ms={name: 1000 * value for name, value in elapsed.items()},
            length_scale=None if target.position is None else target.length_scale,
            notes=notes,
            **report,
        ),
        status=Status.of(solutions, request.tolerance).value,
    )


def _budget(request: SynthesizeRequest, resources: Resources) -> float:
    """Seconds that a request may search."""
    asked = np.inf if request.budget_ms is None else request.budget_ms
    return min(asked, resources.max_budget_ms) / 1000


def _from_atlas(
    request: SynthesizeRequest, target: Target, limits: Limits, resources: Resources, begin: float
) -> tuple[list[Solution], dict[str, Any], dict[str, float]]:
    scan, deadline = resources.atlas.scan, begin + _budget(request, resources)
    solutions, scanned = best_rows(scan, target, limits, request.top, _expiry(resources, deadline))
    screened = resources.clock()
    best = [(1000 * (screened - begin), solutions[0].errors.objective)] if solutions else []
    reached = Status.of(solutions, request.tolerance) is Status.REACHED
    details = {
        "trace": best,
        "stopped_by": "tolerance" if reached else ("converged" if scanned.exhaustive else "budget"),
        "seeds": None,
        "windows": scanned.windows,
        "exhaustive": scanned.exhaustive,
    }
    return solutions, details, {"screen": screened - begin}


def _refined(
    request: SynthesizeRequest, target: Target, limits: Limits, resources: Resources, begin: float
) -> tuple[list[Solution], dict[str, Any], dict[str, float]]:
    budget = _budget(request, resources)
    solutions, found = search(
        resources.levels, target, limits, request.top, request.tolerance, resources.clock, budget
    )
    searched = resources.clock()
    details = {
        "trace": [(1000 * seconds, objective) for seconds, objective in found.trace],
        "stopped_by": found.stopped_by.value,
        "seeds": found.seeds,
        "windows": None,
        "exhaustive": None,
    }
    elapsed = {"screen": found.screen_seconds, "refine": searched - begin - found.screen_seconds}
    return solutions, details, elapsed
