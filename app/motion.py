"""The four-bar's questions: /v1/match and /v1/synthesize, their models and their answers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from app.query import AngleUnit, Count, Number, Query, ReplyModel, RequestModel, Resources
from synthesis.atlas_search import best_rows
from synthesis.haar import features, resample
from synthesis.limits import Limits
from synthesis.scan import Windows, window_angles
from synthesis.solution import Solution, principal
from synthesis.target import MAX_SAMPLES, MIN_SAMPLES, Target, make_target

MAX_TOP = 1000

Curve = Annotated[list[Number], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)]
Point = Annotated[list[Number], Field(min_length=2, max_length=2)]
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
    features: bool = Field(
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
    even, resampled = resample(crank, curve)
    average, details = features(resampled)
    return FeaturesReply(
        samples=resampled.size,
        resampled=resampled is not curve,
        average=float(average / unit),
        details=[float(value / unit) for value in details],
    )


def answer_match(request: MatchRequest, resources: Resources) -> MatchesReply:
    """The best rows by rotation alone; no pose is computed."""
    begin = resources.clock()
    unit = request.unit
    target = request.target(request.rotation, None, None)
    scan = resources.atlas.scan
    windows, report = scan.best(target, request.top)
    screened = resources.clock()
    _, angles = window_angles(scan.lengths, target, windows)
    matches = []
    for rank, angle in enumerate(angles, 1):
        angle = principal(angle)
        lengths = [int(value) for value in scan.lengths[windows.row[rank - 1]]]
        matches.append(
            MatchReply(
                rank=rank,
                type=TypeReply(number=int(windows.row[rank - 1]) + 1, lengths=lengths),
                start_angle=float(np.deg2rad(windows.start[rank - 1]) / unit)
                if unit == 1.0
                else float(windows.start[rank - 1]),
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
