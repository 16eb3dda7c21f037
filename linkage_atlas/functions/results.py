"""Results of functions: linkages with their errors, and files of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from linkage_atlas.arguments import (
    radians_in,
)
from linkage_atlas.functions.question import Dial, Scales
from linkage_atlas.geometry import AnyGuide, DriverName, KindName, Links
from linkage_atlas.linkages import Linkage
from linkage_atlas.notes import counted
from linkage_atlas.records import PYTHON_ONLY, Ranked, Record
from linkage_atlas.results import Report, StatusName
from linkage_atlas.solutions import Determination, Verdict
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.function.answers import to_csv
from synthesis.function.target_function import TargetFunction
from synthesis.function.travel_laws import ANGLE, LENGTH
from synthesis.sheet import csv_text
from synthesis.target import Target


@dataclass(frozen=True)
class FunctionErrors(Record):
    """Errors of the output, in its unit."""

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
    """Minimised error: in radians, or for travel as a fraction of the largest wanted travel."""


class ErrorCurve(NamedTuple):
    """Error of the output over the interval."""

    input: Floats
    error: Floats
    """Made output minus wanted output, in the unit of the output."""


@dataclass(frozen=True, kw_only=True)
class TravelSolution(Record):
    """Linkage with a slider or a cylinder that makes a function, with its errors."""

    rank: int
    """Rank from 1, in the order of `FunctionErrors.objective`."""
    kind: KindName
    driver: DriverName
    """Driven part: crank, slider or cylinder."""
    lengths: dict[str, float]
    """By name: crank, rod, offset; crank, ground; rod, angle; pin_distance, slot_offset."""
    guides: list[AnyGuide]
    """Guides of the body, the driven guide first."""
    branch: Literal[-1, 1]
    start: float
    """The drive's coordinate at the first sample: direction of the crank, place along the rail, or length of the cylinder."""
    input_zero: float
    """The input at the first sample: the crank's angle from the rail or the ground line, or the place of slider or cylinder."""
    output_offset: float
    """output = the linkage's own + this: an angle of the crank or lever, or a place of slider or cylinder."""
    errors: FunctionErrors
    verdict: Verdict
    transmission_angle_min: float
    """Over the used interval, exactly."""
    error_curve: ErrorCurve | None
    linkage: Linkage = field(metadata=PYTHON_ONLY)
    """Linkage with methods to move, draw and save it."""


@dataclass(frozen=True, kw_only=True)
class RoundedFunction(Record):
    """Generator whose links lie on a grid, with zeros fitted again; null if it does not close."""

    closes: bool
    links: Links | None = None
    start_angle: float | None = None
    output_offset: float | None = None
    errors: FunctionErrors | None = None
    transmission_angle_min: float | None = None
    """Over the used interval; limits are not applied again."""
    linkage: Linkage | None = field(default=None, metadata=PYTHON_ONLY)


@dataclass(frozen=True, kw_only=True)
class FunctionSolution(Record):
    """Linkage that makes a function, with its errors.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> solution = la.function([0, 50, 100], input=[0, 5, 10], top=1).best
    >>> solution.verdict.works, solution.errors.max < 1e-6, solution.transmission_angle_min > 40
    (True, True, True)
    """

    rank: int
    """From 1: exact ones by merit, others by `FunctionErrors.objective`, uneven ones behind (function.md)."""
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
    determination: Determination
    """Determination of all lengths; 0 for a prescribed length."""
    sensitivity: Floats | None
    """Rms change of the output per unit of crank, coupler, rocker, ground."""
    rounded: RoundedFunction | None
    error_curve: ErrorCurve | None
    linkage: Linkage = field(metadata=PYTHON_ONLY)
    """Linkage with methods to move, draw and save it."""


@dataclass(frozen=True)
class FunctionResult(Record, Ranked[FunctionSolution | TravelSolution]):
    """The answer to `linkage_atlas.function`: linkages, best first, and a report; indexed and iterated as ``solutions``.

    ``status`` is "reached" (the best objective is below the tolerance), "closest", "infeasible" (none within the limits),
    or "unknown" (none was found before the time was up). ``input`` and ``output`` are the samples of the request,
    ``x`` and ``y`` their numbers if a function was named.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> result = la.function([0, 50, 100], input=[0, 5, 10], top=3)
    >>> result.status, len(result), result.best is result[0]
    ('reached', 3, True)
    """

    status: StatusName
    solutions: list[FunctionSolution | TravelSolution]
    """Of functions from angle to angle the first, with travel the second."""
    input: Floats
    """Crank angle, or travel, at the samples, from the first."""
    output: Floats
    """Wanted rocker angle, or travel, there."""
    x: Floats | None
    """The samples' x and y, where a function was named."""
    y: Floats | None
    report: Report
    target: TargetFunction = field(repr=False, metadata=PYTHON_ONLY)
    degrees: bool = field(default=True, metadata=PYTHON_ONLY)
    dial: Dial = field(default=Dial("angle", "angle"), repr=False, metadata=PYTHON_ONLY)
    scales: Scales = field(default=Scales(1.0, 1.0, 1.0), repr=False, metadata=PYTHON_ONLY)

    @property
    def _results(self) -> list[FunctionSolution | TravelSolution]:
        return self.solutions

    @property
    def best(self) -> FunctionSolution | TravelSolution:
        """The best solution; IndexError without solutions."""
        return self.solutions[0]

    @property
    def linkage(self) -> Linkage:
        """The linkage of the best solution."""
        return self.best.linkage

    def render(self, kind: str, rank: int = 1, length_unit: str = "mm") -> str:
        """Return a solution as the text of a file: csv (the function at the samples), svg, dxf or mjcf.

        The column ``error`` of the CSV file is output got minus output wanted.
        """
        if len(self.solutions) < rank:
            raise FieldError(
                "/limits" if not self.solutions else "/rank",
                f"this reply has {counted(len(self.solutions), 'linkage')}",
            )
        chosen = self.solutions[rank - 1]
        linkage, offset = chosen.linkage, chosen.output_offset
        return render(self.target, self.scales, self.dial, linkage, offset, kind, length_unit)

    def __repr__(self) -> str:
        unit = ("deg" if self.degrees else "rad") if self.dial.output == "angle" else "(length)"
        rows = [f"  {s.rank}  {s.linkage!r}  within {s.errors.max:.3g} {unit}" for s in self.solutions]
        notes = [f"note: {note}" for note in self.report.notes]
        return "\n".join([f"{self.status}: {counted(len(self.solutions), 'linkage')}", *rows, *notes])


def render(
    target: TargetFunction,
    scales: Scales,
    dial: Dial,
    linkage: Linkage,
    output_offset: float,
    kind: str,
    length_unit: str,
) -> str:
    """Return a linkage that makes a function as the text of a file; ``output_offset`` in the unit of the output."""
    radian = radians_in(linkage.degrees)
    travel = target.crank * (1.0 if dial.input == ANGLE else scales.length)
    if kind != "csv":
        shown = Linkage.of(linkage.plain, radian, Target(None, None, crank=travel))
        return shown.render(kind, length_unit=None if kind == "svg" else length_unit)
    if linkage.plain.is_four_bar:
        return to_csv(target, linkage.plain, output_offset * radian, radian)
    plain = linkage.plain
    body = plain.body(plain.start + travel)
    computed = own_output(linkage, dial, np.concatenate([[0.0], travel]))[1:] + output_offset
    output = target.output / scales.output
    columns = {
        "input": target.crank / scales.input,
        "output_wanted": output,
        "output": computed,
        "error": computed - output,
        "transmission_angle": body.transmission_angle / radian,
        "drive": (plain.start + travel) / (radian if plain.driver.turns else 1.0),
    }
    return csv_text({name: np.asarray(values).tolist() for name, values in columns.items()})


def own_output(linkage: Linkage, dial: Dial, travel: Floats) -> Floats:
    """Return the own output of a linkage over travel (n,) of its drive, in the user's unit; angles are continuous.

    For a crank or lever it is the direction, in (-180, 180] degrees at the first value; for a slider or cylinder its position.
    """
    plain = linkage.plain
    if dial.output == LENGTH:
        return plain.along(1, travel)
    links = plain.motions(travel)
    name = plain.link_names[2]
    direction = next(link.angle for link in links if link.name == name) if name != "block" else links[1].angle
    direction = np.unwrap(direction)
    turns = 2 * np.pi * np.round(direction[0] / (2 * np.pi))
    return (direction - turns) / radians_in(linkage.degrees)
