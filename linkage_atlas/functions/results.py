"""Results of functions: linkages with their errors, and files of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from linkage_atlas.arguments import radians_in
from linkage_atlas.functions.question import Dial, FunctionQuestion
from linkage_atlas.geometry import AnyGuide, DriverName, KindName, Links
from linkage_atlas.linkages import Linkage
from linkage_atlas.notes import counted
from linkage_atlas.records import PYTHON_ONLY, Record
from linkage_atlas.results import Report, Solved, StatusName
from linkage_atlas.solutions import Determination, Verdict
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.export.layout import closed_motions
from synthesis.function.laws import LENGTH
from synthesis.sheet import csv_text
from synthesis.target import Interval


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
class AnyFunctionSolution(Record):
    """Linkage that makes a function, with its errors."""

    rank: int
    """From 1: exact ones by merit, others by `FunctionErrors.objective`, uneven ones behind (function.md)."""
    branch: Literal[-1, 1]
    output_offset: float
    """output = the linkage's own + this: an angle (in -180..180 degrees at the first sample, continuous) or a position."""
    errors: FunctionErrors
    verdict: Verdict
    transmission_angle_min: float
    """Over the used interval, exactly."""
    error_curve: ErrorCurve | None
    linkage: Linkage = field(metadata=PYTHON_ONLY)
    """Linkage with methods to move, draw and save it."""


@dataclass(frozen=True, kw_only=True)
class TravelSolution(AnyFunctionSolution):
    """Linkage with a slider or a cylinder that makes a function, with its errors."""

    kind: KindName
    driver: DriverName
    """Driven part: crank, slider or cylinder."""
    lengths: dict[str, float]
    """By name: crank, rod, offset; crank, ground; rod, angle; pin_distance, slot_offset."""
    guides: list[AnyGuide]
    """Guides of the body, the driven guide first."""
    start: float
    """The drive's coordinate at the first sample: direction of the crank, place along the rail, or length of the cylinder."""
    input_zero: float
    """The input at the first sample: the crank's angle from the rail or the ground line, or the place of slider or cylinder."""


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
class FunctionSolution(AnyFunctionSolution):
    """Four-bar that makes a function, with its errors.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> solution = la.function([0, 50, 100], input=[0, 5, 10], top=1).best
    >>> solution.verdict.works, solution.errors.max < 1e-6, solution.transmission_angle_min > 40
    (True, True, True)
    """

    links: Links
    start_angle: float
    """Crank angle at the first sample, from the ground line A->B."""
    family: str
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the crank cannot turn."""
    determination: Determination
    """Determination of all lengths; 0 for a prescribed length."""
    sensitivity: Floats | None
    """Rms change of the output per unit of crank, coupler, rocker, ground."""
    rounded: RoundedFunction | None


@dataclass(frozen=True)
class FunctionResult(Record, Solved[FunctionSolution | TravelSolution]):
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
    question: FunctionQuestion = field(repr=False, metadata=PYTHON_ONLY)

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
        return render(self.question, chosen.linkage, chosen.output_offset, kind, length_unit)

    def __repr__(self) -> str:
        unit = "(length)" if self.question.dial.output == LENGTH else "deg" if self.question.degrees else "rad"
        rows = [f"  {s.rank}  {s.linkage!r}  within {s.errors.max:.3g} {unit}" for s in self.solutions]
        notes = [f"note: {note}" for note in self.report.notes]
        return "\n".join([f"{self.status}: {counted(len(self.solutions), 'linkage')}", *rows, *notes])


def render(question: FunctionQuestion, linkage: Linkage, output_offset: float, kind: str, length_unit: str) -> str:
    """Return a linkage that makes a function as the text of a file; ``output_offset`` in the unit of the output."""
    target, scales, plain, radian = question.function, question.scales, linkage.plain, question.radian
    travel = question.travel
    if kind != "csv":
        shown = Linkage.of(plain, radian, question.target)
        return shown.render(kind, length_unit=None if kind == "svg" else length_unit)
    closed_motions(plain, Interval(0.0, float(travel[-1])))
    made = own_output(linkage, question.dial, np.concatenate([[0.0], travel]))[1:] + output_offset
    wanted = target.output / scales.output
    columns: dict[str, Floats] = {
        "input": target.crank / scales.input,
        "output_wanted": wanted,
        "output": made,
        "error": made - wanted,
        "transmission_angle": plain.body(plain.start + travel).transmission_angle / radian,
    }
    if plain.is_four_bar:
        links = zip(("crank", "coupler", "rocker"), plain.motions(travel))
        columns |= {f"{name}_direction": link.angle / radian for name, link in links}
    else:
        columns["drive"] = (plain.start + travel) / (radian if plain.driver.turns else 1.0)
    return csv_text({name: np.asarray(values).tolist() for name, values in columns.items()})


def own_output(linkage: Linkage, dial: Dial, travel: Floats) -> Floats:
    """Return the own output of a linkage over travel (n,) of its drive, in the user's unit; angles are continuous.

    For a rocker, crank or lever it is the direction, in (-180, 180] degrees at the first value; for a slider or cylinder its
    position.
    """
    plain = linkage.plain
    if dial.output == LENGTH:
        return plain.along(1, travel)
    links = plain.motions(travel)
    name = plain.link_names[2]
    direction = next(link.angle for link in links if link.name == name) if name != "block" else links[1].angle
    if not plain.is_four_bar:
        direction = np.unwrap(direction)
    turns = 2 * np.pi * np.round(direction[0] / (2 * np.pi))
    return (direction - turns) / radians_in(linkage.degrees)
