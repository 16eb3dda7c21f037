"""What comes back from `function`: linkages that make a function, in the user's unit of angle, and files of them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkage_atlas.answers import Ranked, Report, Verdict, listed
from linkage_atlas.linkages import FourBar
from linkage_atlas.motions import Motion, radians_in
from linkage_atlas.named import Dials
from synthesis.errors import FieldError
from synthesis.fourbar.determination import Determination, determinations, sensitivities
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.verdict import practical_faults, verdicts
from synthesis.function.answers import Generator, exchanged, rocker_angles, to_csv, turns_back
from synthesis.function.search import refit
from synthesis.function.wanted import Wanted
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

_EXCHANGED = [0, 2, 1, 3]
_SHOWN = 361
"""Places of an error curve."""


@dataclass(frozen=True)
class FunctionErrors:
    """Errors of the output: ``rms`` and ``max`` in the unit of angle, ``objective`` in radians.

    ``max`` is over the whole interval for objective "max", else at the samples; ``alternations`` (objective "max") says how many
    extremes of the error, of alternating sign, are as large as the largest. ``rms_y`` and ``max_y`` are the same in units of y,
    where y = f(x) was asked for.
    """

    rms: float
    max: float
    alternations: int | None
    rms_y: float | None
    max_y: float | None
    objective: float


@dataclass(frozen=True)
class RoundedFunction:
    """A generator whose links lie on a grid, the zeros fitted anew; limits are not applied again."""

    linkage: FourBar
    output_offset: float
    errors: FunctionErrors
    transmission_angle_min: float


@dataclass(frozen=True)
class FunctionSolution:
    """A linkage that makes a function, and how well.

    Attributes
    ----------
    rank : int
        From 1, by ``errors.objective``.
    linkage : FourBar
        Its ``start_angle`` is the crank angle at the first sample.
    output_offset : float
        output = rocker angle (in -180..180 degrees at the first sample, continuous) + this.
    errors : FunctionErrors
    family : str
    transmission_angle_min : float
        Over the used interval, exactly.
    transmission_angle_min_turn : float or None
        Over the whole turn; None where the crank cannot turn fully.
    verdict : Verdict
    condition : float
        Condition number of the output's derivatives by all unknowns.
    determination : Determination
    sensitivity : ndarray, shape (4,), or None
        Rms change of the output per unit of crank, coupler, rocker, ground, if asked for.
    rounded : RoundedFunction or None
    error_curve : tuple of ndarray or None
        Input and error (wanted less made) over the interval, if asked for.
    """

    rank: int
    linkage: FourBar
    output_offset: float
    errors: FunctionErrors
    family: str
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    verdict: Verdict
    condition: float
    determination: Determination
    sensitivity: Floats | None
    rounded: RoundedFunction | None
    error_curve: tuple[Floats, Floats] | None
    asked_to_round: bool = field(default=False, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        rounded: dict[str, Any] | None = None
        if self.asked_to_round:
            rounded = {"closes": self.rounded is not None}
            names = ("links", "start_angle", "output_offset", "errors", "transmission_angle_min")
            rounded |= dict.fromkeys(names)
            if self.rounded is not None:
                rounded |= _described(self.rounded.linkage, self.rounded.output_offset) | {
                    "errors": vars(self.rounded.errors),
                    "transmission_angle_min": self.rounded.transmission_angle_min,
                }
                del rounded["branch"]
        fixed = self.determination
        return {
            "rank": self.rank,
            **_described(self.linkage, self.output_offset),
            "errors": vars(self.errors),
            "verdict": self.verdict.to_dict(),
            "family": self.family,
            "transmission_angle_min": self.transmission_angle_min,
            "transmission_angle_min_turn": self.transmission_angle_min_turn,
            "condition": self.condition,
            "determination": {
                "ill_posed": fixed.ill_posed,
                "resolution": fixed.resolution,
                "length_uncertainty": [v if np.isfinite(v) else None for v in fixed.length_uncertainty.tolist()],
            },
            "sensitivity": listed(self.sensitivity),
            "rounded": rounded,
            "error_curve": None
            if self.error_curve is None
            else dict(zip(("input", "error"), (one.tolist() for one in self.error_curve))),
        }


def _described(linkage: FourBar, offset: float) -> dict[str, Any]:
    plain = linkage.to_dict()
    return {name: plain[name] for name in ("links", "branch", "start_angle")} | {"output_offset": offset}


@dataclass(frozen=True)
class FunctionResult(Ranked[FunctionSolution]):
    """The answer to `linkage_atlas.function`: linkages, best first, and a report; indexed and iterated as ``solutions``.

    ``status`` is "reached" (the best objective is below the tolerance), "closest", "infeasible" (none within the limits),
    or "unknown" (none was found before the time was up). ``input`` and ``output`` are the samples that were asked for,
    ``x`` and ``y`` their numbers where a function was named.
    """

    status: str
    solutions: list[FunctionSolution]
    report: Report
    input: Floats
    output: Floats
    x: Floats | None
    y: Floats | None
    wanted: Wanted = field(repr=False)
    degrees: bool = True

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

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract."""
        report = vars(self.report).copy()
        for name in ("length_scale", "windows", "exhaustive"):
            del report[name]
        return {
            "status": self.status,
            "solutions": [one.to_dict() for one in self.solutions],
            "input": self.input.tolist(),
            "output": self.output.tolist(),
            "x": listed(self.x),
            "y": listed(self.y),
            "report": report,
        }

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
        solutions.append(
            FunctionSolution(
                rank=k + 1,
                linkage=FourBar.of(one.linkage, asked.motion),
                output_offset=one.offset / radian,
                errors=asked.errors(one),
                family=one.family.value,
                transmission_angle_min=one.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                verdict=Verdict(
                    passed[k].order, passed[k].branch, passed[k].circuit, None, not faults, tuple(reasons)
                ),
                condition=determined.condition,
                determination=replace(determined, length_uncertainty=determined.length_uncertainty[_EXCHANGED]),
                sensitivity=None if changes[k] is None else changes[k].rotation[_EXCHANGED] / radian,
                rounded=None,
                error_curve=drawn[k],
            )
        )
    return solutions


def _error_curves(asked: Asked, found: list[Generator]) -> list[tuple[Floats, Floats] | None]:
    """Input and error of each generator over the interval."""
    wanted, radian = asked.wanted, asked.radian
    shown = np.linspace(0.0, wanted.crank[-1], _SHOWN)
    gaps = wanted.curve(shown) - rocker_angles([one.linkage for one in found], shown)
    gaps -= np.array([one.offset for one in found])[:, None]
    return [(shown / radian, gap / radian) for gap in gaps]


def rounded(asked: Asked, one: Generator, grid: float, work: Work) -> RoundedFunction | None:
    """A generator with its links on a grid; None where that does not close."""
    links = np.maximum(np.round(np.array(one.linkage.links) / grid), 1.0) * grid
    again = refit(asked.wanted, one, links, asked.largest, asked.tolerance, work)
    if again is None:
        return None
    return RoundedFunction(
        FourBar.of(again.linkage, asked.motion),
        again.offset / asked.radian,
        asked.errors(again),
        again.transmission_angle_min / asked.radian,
    )


def render_function(wanted: Wanted, solution: Any, kind: str, length_unit: str, degrees: bool) -> str:
    """A linkage that makes a function, with `linkage` and `output_offset`, as the text of a file."""
    linkage: FourBar = solution.linkage
    if kind == "csv":
        return to_csv(wanted, linkage.plain, solution.output_offset * radians_in(degrees), radians_in(degrees))
    return linkage.render(kind, Motion(Target(None, None, crank=wanted.crank), degrees), length_unit)
