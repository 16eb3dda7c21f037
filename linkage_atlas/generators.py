"""What comes back from `function`: linkages that make a function, in the user's unit of angle, and files of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from linkage_atlas.answers import Ranked, Status, StoppedBy, Verdict
from linkage_atlas.finish import verdict_of
from linkage_atlas.linkages import FourBar, Links
from linkage_atlas.motions import Motion, radians_in
from linkage_atlas.named import Dials
from linkage_atlas.records import KEPT, Floats, Record, Values, names_of
from synthesis.errors import FieldError
from synthesis.fourbar.determination import determinations, sensitivities
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.passage import practical_faults, verdicts
from synthesis.function.answers import Generator, exchanged, rocker_angles, to_csv, turns_back
from synthesis.function.search import refit
from synthesis.function.wanted import Wanted
from synthesis.target import Target
from synthesis.work import Work

_EXCHANGED = [0, 2, 1, 3]
_SHOWN = 361
"""Places of an error curve."""


@dataclass(frozen=True)
class FunctionErrors(Record):
    """Errors of the output."""

    rms: float
    """At the samples, weighted."""
    max: float
    """Over the whole interval for objective `max`, over the samples for `rms`."""
    alternations: int | None
    """Objective `max`: extremes of the error, of alternating sign, that are as large as the largest."""
    rms_y: float | None
    """`rms` in units of y; null without `function`."""
    max_y: float | None
    objective: float
    """What was made least, in radians."""


@dataclass(frozen=True, kw_only=True)
class RoundedFunction(Record):
    """A generator whose links lie on a grid, the zeros fitted anew; null where it does not close."""

    closes: bool
    links: Links | None
    start_angle: float | None
    output_offset: float | None
    errors: FunctionErrors | None
    transmission_angle_min: float | None
    """Over the used interval; limits are not applied again."""
    linkage: FourBar | None = field(default=None, metadata=KEPT)


class ErrorCurve(NamedTuple):
    """The error over the interval."""

    input: Floats
    error: Floats
    """Wanted less made."""


@dataclass(frozen=True)
class FunctionDetermination(Record):
    """How well the function fixes each length."""

    ill_posed: bool
    """A length is not even fixed to a thousandth by the function at this resolution, whatever limits hold it."""
    resolution: float
    """Error that is considered: the objective, at least the tolerance."""
    length_uncertainty: Values
    """Relative change of crank, coupler, rocker, ground within that resolution; null: not determined at all."""


@dataclass(frozen=True, kw_only=True)
class FunctionSolution(Record):
    """A linkage that makes a function, and how well."""

    rank: int
    """From 1, by `errors.objective`."""
    links: Links
    branch: Literal[-1, 1]
    start_angle: float
    """Crank angle at the first sample, from the ground line A->B."""
    output_offset: float
    """output = rocker angle (in -180..180 degrees at the first sample, continuous) + this."""
    errors: FunctionErrors
    verdict: Verdict
    family: str
    transmission_angle_min: float
    """Over the used interval, exactly."""
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the crank cannot turn."""
    condition: float
    """Condition number of the output's derivatives by all unknowns."""
    determination: FunctionDetermination
    sensitivity: Floats | None
    """Rms change of the output per unit of crank, coupler, rocker, ground."""
    rounded: RoundedFunction | None
    error_curve: ErrorCurve | None
    linkage: FourBar = field(metadata=KEPT)
    """It moves, draws and saves itself."""


@dataclass(frozen=True)
class FunctionReport(Record):
    """How an answer came about."""

    elapsed_ms: dict[str, float]
    """Milliseconds of each stage and in total."""
    trace: list[tuple[float, float]]
    """[milliseconds, best objective] after each stage."""
    stopped_by: StoppedBy
    seeds: int
    """Starting points refined."""
    notes: list[str]


@dataclass(frozen=True)
class FunctionResult(Record, Ranked[FunctionSolution]):
    """The answer to `linkage_atlas.function`: linkages, best first, and a report; indexed and iterated as ``solutions``.

    ``status`` is "reached" (the best objective is below the tolerance), "closest", "infeasible" (none within the limits),
    or "unknown" (none was found before the time was up). ``input`` and ``output`` are the samples that were asked for,
    ``x`` and ``y`` their numbers where a function was named.
    """

    status: Status
    solutions: list[FunctionSolution]
    input: Floats
    """Crank angle at the samples, from the first."""
    output: Floats
    """Wanted rocker angle there."""
    x: Floats | None
    """The samples' x and y, where a function was named."""
    y: Floats | None
    report: FunctionReport
    wanted: Wanted = field(repr=False, metadata=KEPT)
    degrees: bool = field(default=True, metadata=KEPT)

    @property
    def _answers(self) -> list[FunctionSolution]:
        return self.solutions

    @property
    def best(self) -> FunctionSolution:
        """The best solution; IndexError where there is none."""
        return self.solutions[0]

    @property
    def linkage(self) -> FourBar:
        """The linkage of the best solution."""
        return self.best.linkage

    def render(self, kind: str, rank: int = 1, length_unit: str = "mm") -> str:
        """A solution as the text of a file: csv (the function at the samples), svg, dxf or mjcf."""
        if len(self.solutions) < rank:
            raise FieldError(
                "/limits" if not self.solutions else "/rank",
                f"there are {len(self.solutions)} linkages in this reply",
            )
        return render_function(self.wanted, self.solutions[rank - 1], kind, length_unit, self.degrees)

    def __repr__(self) -> str:
        unit = "deg" if self.degrees else "rad"
        rows = [f"  {s.rank}  {s.linkage!r}  within {s.errors.max:.3g} {unit}" for s in self.solutions]
        return "\n".join([f"{self.status}: {len(self.solutions)} linkages", *rows])


@dataclass(frozen=True)
class Asked:
    """What solutions are described by."""

    wanted: Wanted
    dials: Dials | None
    degrees: bool
    largest: bool
    tolerance: float

    @property
    def radian(self) -> float:
        """Radians in one unit of angle."""
        return radians_in(self.degrees)

    @property
    def motion(self) -> Motion:
        """The interval, for drawings."""
        return Motion(Target(None, None, crank=self.wanted.crank), self.degrees)

    def errors(self, one: Generator) -> FunctionErrors:
        """A generator's errors in the user's units."""
        errors, radian = one.errors, self.radian
        unit = None if self.dials is None else self.dials.y_of_radian
        return FunctionErrors(
            errors.rms / radian,
            errors.max / radian,
            errors.alternations,
            None if unit is None else errors.rms * unit,
            None if unit is None else errors.max * unit,
            errors.objective,
        )


def described(
    asked: Asked, found: list[Generator], limits: Limits, sensitivity: bool, curves: bool
) -> list[FunctionSolution]:
    """Generators as a user reads them, best first."""
    if not found:
        return []
    wanted, radian = asked.wanted, asked.radian
    linkages = [one.linkage for one in found]
    # how a rocker's angle changes with the lengths is how the coupler's does with coupler and rocker exchanged
    others = [exchanged(one) for one in linkages]
    fixed = determinations(wanted.target, others, [max(one.errors.objective, asked.tolerance) for one in found])
    changes: list[Any] = sensitivities(wanted.target, others) if sensitivity else [None] * len(found)
    start = np.array([one.start for one in linkages])[:, None]
    side = np.broadcast_to(np.array([one.branch for one in linkages])[:, None], (len(found), wanted.crank.size))
    passed = verdicts(linkages, start + wanted.crank, side, timed=True)
    back = turns_back(wanted, linkages)
    drawn = _error_curves(asked, found) if curves else [None] * len(found)
    solutions = []
    for k, one in enumerate(found):
        faults = practical_faults(one, wanted.target, limits)
        reasons = [*passed[k].reasons, *filter(None, [back[k]]), *faults]
        determined, turn = fixed[k], one.transmission_angle_min_turn
        linkage = FourBar.of(one.linkage, asked.motion)
        solutions.append(
            FunctionSolution(
                rank=k + 1,
                links=linkage.dimensions.links,
                branch=linkage.dimensions.branch,
                start_angle=linkage.start_angle,
                linkage=linkage,
                output_offset=one.offset / radian,
                errors=asked.errors(one),
                family=one.family.value,
                transmission_angle_min=one.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                verdict=verdict_of(passed[k], None, reasons, practical=not faults),
                condition=determined.condition,
                determination=FunctionDetermination(
                    determined.ill_posed, determined.resolution, determined.length_uncertainty[_EXCHANGED]
                ),
                sensitivity=None if changes[k] is None else changes[k].rotation[_EXCHANGED] / radian,
                rounded=None,
                error_curve=drawn[k],
            )
        )
    return solutions


def _error_curves(asked: Asked, found: list[Generator]) -> list[ErrorCurve | None]:
    """Input and error of each generator over the interval."""
    wanted, radian = asked.wanted, asked.radian
    shown = np.linspace(0.0, wanted.crank[-1], _SHOWN)
    gaps = wanted.curve(shown) - rocker_angles([one.linkage for one in found], shown)
    gaps -= np.array([one.offset for one in found])[:, None]
    return [ErrorCurve(shown / radian, gap / radian) for gap in gaps]


def rounded(asked: Asked, one: Generator, grid: float, work: Work) -> RoundedFunction:
    """A generator with its links on a grid."""
    links = np.maximum(np.round(np.array(one.linkage.links) / grid), 1.0) * grid
    again = refit(asked.wanted, one, links, asked.largest, asked.tolerance, work)
    values: dict[str, Any] = dict.fromkeys(names_of(RoundedFunction)) | {"closes": False}
    if again is None:
        return RoundedFunction(**values)
    linkage = FourBar.of(again.linkage, asked.motion)
    values |= {
        "closes": True,
        "links": linkage.dimensions.links,
        "start_angle": linkage.start_angle,
        "output_offset": again.offset / asked.radian,
        "errors": asked.errors(again),
        "transmission_angle_min": again.transmission_angle_min / asked.radian,
    }
    return RoundedFunction(**values, linkage=linkage)


def render_function(wanted: Wanted, solution: Any, kind: str, length_unit: str, degrees: bool) -> str:
    """A linkage that makes a function, with `linkage` and `output_offset`, as the text of a file."""
    linkage: FourBar = solution.linkage
    if kind == "csv":
        return to_csv(wanted, linkage.plain, solution.output_offset * radians_in(degrees), radians_in(degrees))
    return linkage.render(kind, Motion(Target(None, None, crank=wanted.crank), degrees), length_unit)
