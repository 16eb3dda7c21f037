"""The question about unknown dimensions: values that reproduce a prescribed pattern of verdicts."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from app.query import Angles, Count, PositiveNumber, Query, ReplyModel, RequestModel, Resources, reply_model
from app.scenes.knotter.machine import (
    DECIMALS,
    Bounded,
    ConditionName,
    MachineRequest,
    Provenance,
    machine_of,
    provenance,
    unit_of,
)
from app.terminal import DEGREES, Units, table
from linkage_atlas import FieldError, OutOfTime
from synthesis.scenes.knotter.fit import (
    Direction,
    Pattern,
    PrescribedVerdicts,
    directions,
    fit_pattern,
    rank,
    single_ranges,
)
from synthesis.scenes.knotter.mechanism import dimensions

MAX_UNKNOWNS = 40
"""Largest number of unknown dimensions."""
MAX_ENTRIES = 200
"""Largest number of verdicts in a pattern."""
MAX_DRAWS = 2000
"""Largest number of random sets of dimensions."""
MAX_DESCENTS = 20
"""Largest number of sets of dimensions that are improved."""
DEFAULT_RANGES = {
    "d1": (40.0, 250.0),
    "D": (-150.0, 150.0),
    "beta.lead": (0.0, 90.0),
    "beta.ratio": (0.2, 1.1),
    "S1.j": (-30.0, 30.0),
    "S5.k": (0.0, 12.0),
    "S10.i": (20.0, 80.0),
    "S10.k": (0.0, 80.0),
}
"""Ranges in degrees and mm of the unknowns that decide the verdicts of tables 1 and 2 of the source."""
PAIRS = [(alpha1, alpha3) for alpha1 in (0, 10, 20) for alpha3 in (20, 25, 30)]
"""Pairs (alpha1, alpha3) of the source's tables, in degrees."""
NO_WRAP = ((0, 20), (10, 20))
"""Pairs for which the rope does not wrap round the bill."""
MEETS_DISC = ((0, 25), (20, 20))
"""Pairs for which the jaw meets the disc."""
PUBLISHED = [
    *({"condition": "wrap", "alpha1": a, "alpha3": b, "holds": (a, b) not in NO_WRAP} for a, b in PAIRS),
    *(
        {"condition": "clearance", "alpha1": a, "alpha3": b, "holds": (a, b) not in MEETS_DISC}
        for a, b in PAIRS
        if (a, b) not in NO_WRAP
    ),
]
"""Verdicts of the source's tables 1 (9 entries) and 2 (7 entries)."""

DimensionName = Annotated[str, Field(max_length=20, pattern=r"^[A-Za-z0-9]+(\.(lead|ratio|i|j|k))?$")]


class WantedEntry(RequestModel):
    """Prescribed verdict of a condition for a pair of spatial angles."""

    condition: ConditionName
    alpha1: Bounded = Field(json_schema_extra={"unit": "angle"})
    alpha3: Bounded = Field(json_schema_extra={"unit": "angle"})
    holds: bool


class UnknownRange(RequestModel):
    """An unknown dimension and the range that is searched."""

    name: DimensionName = Field(
        description="Parameter (d1), lead or ratio of a linear law (beta.lead), or coordinate of a point (S1.j)."
    )
    low: Bounded
    high: Bounded
    start: Bounded | None = Field(
        None, description="Initial value of an additional descent; give it for all unknowns or for none."
    )


class PatternFitRequest(MachineRequest):
    """Unknown dimensions, and the pattern of verdicts that they must reproduce."""

    unknowns: Annotated[list[UnknownRange], Field(max_length=MAX_UNKNOWNS)] | None = Field(
        None,
        description="Unknown dimensions; default: the eight that decide the verdicts of the source's two tables.",
    )
    pattern: Annotated[list[WantedEntry], Field(min_length=1, max_length=MAX_ENTRIES)] | None = Field(
        None,
        description="Prescribed verdicts; default: those of the source, 9 of the wrap and 7 of the clearance at 270 degrees.",
    )
    draws: Annotated[Count, Field(ge=0, le=MAX_DRAWS)] = Field(
        128, description="Number of seeded random sets of dimensions; 0: only `start` is used."
    )
    descents: Annotated[Count, Field(ge=0, le=MAX_DESCENTS)] = Field(
        4, description="Number of the best random sets that are improved; 0: `start` is evaluated without a descent."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0
    budget_ms: PositiveNumber = Field(
        20_000,
        le=600_000,
        description="Time limit. When it is reached, the reply contains the best set found so far; `individual_ranges` "
        "and `directions` are null if no time is left for them.",
    )


BOUNDS_FRACTION = 0.3
"""Fraction of the budget that is reserved for the ranges and directions of the best set."""
MIN_SECONDS = 0.05
"""Smallest budget, so that the search evaluates a set even on a busy machine."""
DirectionReply = reply_model(Direction)


class EntryMargin(ReplyModel):
    """Margin of a verdict of the pattern."""

    condition: str
    alpha1: float
    alpha3: float
    prescribed: bool
    margin: float = Field(description="Positive if the verdict is as prescribed.")


class SetReply(ReplyModel):
    """A set of dimensions."""

    values: dict[str, float]
    margin: float = Field(description="Smallest margin of the pattern; positive if the whole pattern is reproduced.")


class PatternFitReply(Provenance):
    """The best set of dimensions, alternatives, and the freedom that the pattern leaves."""

    status: Literal["reproduced", "not reproduced"]
    values: dict[str, float]
    margin: float
    entries: list[EntryMargin]
    individual_ranges: dict[str, list[float]] | None = Field(
        description="Range of each unknown in which the pattern is reproduced while all other unknowns are constant."
    )
    directions: list[DirectionReply] | None = Field(
        description="Orthogonal directions in the space of the unknowns, in increasing order of their effect on the margins."
    )
    rank: int | None = Field(description="Number of directions that change a margin to first order.")
    free: int | None = Field(
        description="Number of unknowns minus the rank: directions that change no margin to first order."
    )
    other_sets: list[SetReply] = Field(description="Sets that the other descents found.")
    draws: int
    reproducing_draws: int = Field(description="Number of random sets that reproduce the pattern without a descent.")
    start_margin: float | None = Field(description="Smallest margin at `start`; null if there is no start.")


def answer_fit(request: PatternFitRequest, resources: Resources) -> PatternFitReply:
    """Find dimensions that reproduce a pattern, and the freedom that the pattern leaves."""
    total = resources.work(max(request.budget_ms / 1000, MIN_SECONDS))
    work, angles = total.extended(-BOUNDS_FRACTION), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    # alpha1 and alpha3 are prescribed by the pattern
    unknowns = _unknowns_of(request, sorted({*dimensions(mechanism)} - {"alpha1", "alpha3"}))
    prescribed, entries = _prescribed_verdicts(request, mechanism, conditions, angles)
    names = [unknown.name for unknown in unknowns]
    units = np.array([unit_of(name, angles) for name in names])
    ranges = {unknown.name: (unknown.low * unit, unknown.high * unit) for unknown, unit in zip(unknowns, units)}
    pattern = Pattern(mechanism, prescribed, ranges)
    starts = [unknown.start for unknown in unknowns]
    start = None if starts[0] is None else pattern.normalise(np.array(starts, float) * units)
    start_margin = None if start is None else float(pattern.margins(start[None], work)[0].min())
    draws = request.draws if request.descents else 0
    sets, reproducing_draws = fit_pattern(pattern, draws, request.descents, request.seed, start, work)
    best = sets[0]
    reproduced = best.smallest_margin > 0
    bounds: dict[str, Any] = dict.fromkeys(("individual_ranges", "directions", "rank", "free"))
    with suppress(OutOfTime):  # the bounds stay null
        if reproduced and best.slopes is not None:
            intervals = single_ranges(pattern, best.unknowns, total)
            axes = directions(pattern, best, total)
            bounds = {
                "individual_ranges": {
                    name: [low / u, high / u] for name, (low, high), u in zip(names, intervals, units)
                },
                "directions": [replace(axis, vector=dict(zip(names, axis.vector.tolist()))) for axis in axes],
                "rank": rank(axes),
                "free": len(names) - rank(axes),
            }

    def values(normalised: Any) -> dict[str, float]:
        return dict(zip(names, (pattern.denormalise(normalised) / units).tolist()))

    return PatternFitReply(
        status="reproduced" if reproduced else "not reproduced",
        values=values(best.unknowns),
        margin=best.smallest_margin,
        entries=[
            {**entry.model_dump(exclude={"holds"}), "prescribed": entry.holds, "margin": float(margin)}
            for entry, margin in zip(entries, best.margins)
        ],
        **bounds,
        other_sets=[SetReply(values=values(found.unknowns), margin=found.smallest_margin) for found in sets[1:]],
        draws=request.draws,
        reproducing_draws=reproducing_draws,
        start_margin=start_margin,
        **provenance(request, names),
    )


def _unknowns_of(request: PatternFitRequest, known: list[str]) -> list[UnknownRange]:
    """Return the unknowns of a request, or the default unknowns, and check them against the ``known`` dimensions."""
    unknowns = request.unknowns
    if unknowns is None:
        unit = _degree(request)
        scale = {name: unit if name == "beta.lead" else 1.0 for name in DEFAULT_RANGES}
        unknowns = [
            UnknownRange(name=name, low=scale[name] * low, high=scale[name] * high)
            for name, (low, high) in DEFAULT_RANGES.items()
        ]
    names = [unknown.name for unknown in unknowns]
    undefined = [name for name in names if name not in known]
    for index, unknown in enumerate(unknowns):
        field = f"/unknowns/{index}"
        if unknown.name in undefined:
            message = f"not a dimension that can be unknown: {', '.join(undefined)}"
            raise FieldError(f"{field}/name", message, known=known)
        if names.index(unknown.name) != index:
            raise FieldError(f"{field}/name", f"{unknown.name} is listed twice; remove one of the two")
        if not unknown.low < unknown.high:
            raise FieldError(f"{field}/high", "must be larger than low")
        if unknown.start is not None and not unknown.low <= unknown.start <= unknown.high:
            raise FieldError(f"{field}/start", "must be between low and high")
    starts = [unknown.start for unknown in unknowns]
    if len({start is None for start in starts}) > 1:
        raise FieldError("/unknowns", "give a start for all unknowns or for none")
    if not unknowns or ((request.draws == 0 or request.descents == 0) and starts[0] is None):
        message = "the search has no initial values; give draws and descents, or a start for each unknown"
        raise FieldError("/draws", message)
    return unknowns


def _prescribed_verdicts(
    request: PatternFitRequest, mechanism: Any, conditions: dict[str, Any], angles: Angles
) -> tuple[list[PrescribedVerdicts], list[WantedEntry]]:
    """Return the pattern of a request, or the published pattern, grouped by condition, and its entries in the same order."""
    entries, unit = request.pattern, _degree(request)
    if entries is None:
        rows = [{**row, "alpha1": unit * row["alpha1"], "alpha3": unit * row["alpha3"]} for row in PUBLISHED]
        entries = [WantedEntry.model_validate(row) for row in rows]
    if request.pattern is None and request.clearance.angle_range is None:
        # the source evaluates the clearance at a single angle
        at = conditions["clearance"].at
        conditions = conditions | {"clearance": replace(conditions["clearance"], over=(at, at))}
    prescribed, ordered = [], []
    for name, condition in conditions.items():
        group = [entry for entry in entries if entry.condition == name]
        if group:
            condition.check(mechanism)
            columns = {
                axis: np.array([angles.inward(getattr(entry, axis)) for entry in group])
                for axis in ("alpha1", "alpha3")
            }
            prescribed.append(PrescribedVerdicts(condition, columns, np.array([entry.holds for entry in group])))
            ordered += group
    return prescribed, ordered


def _degree(request: PatternFitRequest) -> float:
    """Return the size of a degree in the unit of the request."""
    return 1.0 if request.angle_unit == "deg" else math.radians(1.0)


def fit_table(reply: PatternFitReply, units: Units = DEGREES) -> str:
    """Return a row for each unknown, the free directions, and the other sets."""
    reproduced = sum(entry.margin > 0 for entry in reply.entries)
    intervals = reply.individual_ranges or {}
    rows = [
        [name, f"{value:.6g}", *(f"{bound:.6g}" for bound in intervals.get(name, ("", "")) if bound != "")]
        for name, value in reply.values.items()
    ]
    margin = units.value(reply.margin, units.length, 4)
    lines = [
        f"{reply.status}: {reproduced} of {len(reply.entries)} verdicts, smallest margin {margin}",
        table(["unknown", "value", *(["reproduced from", "to"] if intervals else [])], rows),
    ]
    if reply.directions is not None:
        ends = [f"{direction.backward + direction.forward:.3g}" for direction in reply.directions]
        lines.append(
            f"{reply.free} of {len(reply.values)} directions are free to first order; fraction of the ranges over which the "
            "pattern is reproduced along each direction:"
        )
        lines.append("  " + ", ".join(ends))
    lines += [
        f"alternative: margin {alternative.margin:.4g}{units.behind(units.length)}, "
        + ", ".join(f"{name} {value:.5g}" for name, value in alternative.values.items())
        for alternative in reply.other_sets
    ]
    return "\n".join(lines)


FIT = Query(
    command="knotter fit",
    summary="Find unknown dimensions that reproduce a prescribed pattern of verdicts, and the freedom that it leaves.",
    answer=answer_fit,
    table=fit_table,
    is_long=lambda request: True,
)
