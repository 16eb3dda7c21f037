"""Unknown dimensions of a knotter from a wanted pattern of verdicts, over HTTP and on the command line."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import Angles, Count, PositiveNumber, Query, ReplyModel, RequestModel, Resources
from app.scenes.knotter_machine import DECIMALS, machine_of, provenance, unit_of
from app.scenes.knotter_models import (
    Bounded,
    ConditionName,
    MachineRequest,
    Provenance,
)
from app.tables import DEGREES, Units, table
from linkage_atlas import FieldError

MAX_UNKNOWNS, MAX_ENTRIES = 40, 200
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
"""Of the unknowns that decide about the source's tables 1 and 2, in degrees and mm."""
PAIRS = [(one, three) for one in (0, 10, 20) for three in (20, 25, 30)]
NO_WRAP, MEETS_DISC = ((0, 20), (10, 20)), ((0, 25), (20, 20))
PUBLISHED = [
    *({"condition": "wrap", "alpha1": a, "alpha3": b, "holds": (a, b) not in NO_WRAP} for a, b in PAIRS),
    *(
        {"condition": "clearance", "alpha1": a, "alpha3": b, "holds": (a, b) not in MEETS_DISC}
        for a, b in PAIRS
        if (a, b) not in NO_WRAP
    ),
]
"""The source's tables 1 (9 entries) and 2 (7 entries)."""

DimensionName = Annotated[str, Field(max_length=20, pattern=r"^[A-Za-z0-9]+(\.(lead|ratio|i|j|k))?$")]


class WantedEntry(RequestModel):
    """One verdict of the pattern."""

    condition: ConditionName
    alpha1: Bounded = Field(json_schema_extra={"unit": "angle"})
    alpha3: Bounded = Field(json_schema_extra={"unit": "angle"})
    holds: bool


class UnknownRange(RequestModel):
    """A dimension that is sought within a range."""

    name: DimensionName = Field(
        description="A parameter (d1), lead or ratio of a linear law (beta.lead), or a point's coordinate (S1.j)."
    )
    low: Bounded
    high: Bounded
    start: Bounded | None = Field(
        None, description="Where one more search begins; all unknowns or none must have one."
    )


class PatternFitRequest(MachineRequest):
    """Which dimensions reproduce a pattern of verdicts?"""

    unknowns: Annotated[list[UnknownRange], Field(max_length=MAX_UNKNOWNS)] | None = Field(
        None, description="blank: the eight that decide about the source's two tables."
    )
    pattern: Annotated[list[WantedEntry], Field(min_length=1, max_length=MAX_ENTRIES)] | None = Field(
        None, description="blank: the source's, 9 verdicts of the wrap and 7 of the clearance at 270 degrees."
    )
    draws: Annotated[Count, Field(ge=0, le=2000)] = Field(
        128, description="Seeded draws over the ranges; 0: only from `start`."
    )
    descents: Annotated[Count, Field(ge=0, le=20)] = Field(
        4, description="How many of the best draws are improved; 0: `start` is judged as it is."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0
    budget_ms: PositiveNumber = Field(
        20_000, le=600_000, description="After so long the best set so far is the answer."
    )


class DirectionReply(ReplyModel):
    """A direction of the unknowns along which the pattern is kept for a while."""

    strength: float = Field(
        description="How fast the margins change along it, length per share of the ranges; 0: not at all."
    )
    back: float = Field(description="How far the pattern is kept, in shares of the ranges; to their ends at most.")
    forth: float
    vector: dict[str, float] = Field(description="In shares of the ranges, of length 1.")


class EntryMargin(ReplyModel):
    """One verdict of the pattern."""

    condition: str
    alpha1: float
    alpha3: float
    wanted: bool
    margin: float = Field(description="Positive where the verdict is the wanted one.")


class SetReply(ReplyModel):
    """One set of dimensions."""

    values: dict[str, float]
    margin: float = Field(description="The smallest of the pattern's margins; positive where all of it comes out.")


class PatternFitReply(Provenance):
    """The best set, others, and how little the pattern determines them."""

    status: Literal["reproduced", "not reproduced"]
    values: dict[str, float]
    margin: float
    entries: list[EntryMargin]
    alone: dict[str, list[float]] | None = Field(
        description="The range of each unknown in which the pattern is kept while the others stay."
    )
    directions: list[DirectionReply] | None = Field(
        description="Orthogonal, those that change the margins least first."
    )
    rank: int | None = Field(description="Directions that change the margins to first order; the others are free.")
    free: int | None = Field(description="Unknowns less the rank: directions that no margin sees to first order.")
    others: list[SetReply] = Field(description="Sets of the other starts.")
    draws: int
    draws_kept: int = Field(description="Draws over the ranges that reproduce the pattern as they are.")
    start_margin: float | None = Field(description="Smallest margin at `start`; null without one.")


def answer_fit(request: PatternFitRequest, resources: Resources) -> PatternFitReply:
    """Dimensions that reproduce a pattern, and how non-unique they are."""
    import numpy as np

    from synthesis.knotter.dimensions import dimensions
    from synthesis.knotter.fit import LONGER, Pattern, Wanted, directions, rank, search, single_ranges

    work, angles = resources.work(request.budget_ms / 1000), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    unit_in = 1.0 if request.angle_unit == "deg" else math.radians(1.0)
    unknowns = request.unknowns
    if unknowns is None:
        scale = {name: unit_in if name == "beta.lead" else 1.0 for name in DEFAULT_RANGES}
        unknowns = [
            UnknownRange(name=name, low=scale[name] * low, high=scale[name] * high)
            for name, (low, high) in DEFAULT_RANGES.items()
        ]
    known, names = dimensions(mechanism), [one.name for one in unknowns]
    for index, one in enumerate(unknowns):
        field = f"/unknowns/{index}"
        if one.name not in known or names.index(one.name) != index or one.name in ("alpha1", "alpha3"):
            raise FieldError(
                f"{field}/name", f"no dimension of this machine, or twice: {one.name}", known=sorted(known)
            )
        if not one.low < one.high:
            raise FieldError(f"{field}/high", "the range must run from a smaller to a larger value")
        if one.start is not None and not one.low <= one.start <= one.high:
            raise FieldError(f"{field}/start", "the start must lie in the range")
    starts = [one.start for one in unknowns]
    if any(start is None for start in starts) and any(start is not None for start in starts):
        raise FieldError("/unknowns", "give a start to all unknowns or to none")
    if not unknowns or ((request.draws == 0 or request.descents == 0) and starts[0] is None):
        raise FieldError("/draws", "there is nothing to begin with: draws and descents, or a start, are wanted")
    entries = request.pattern
    if entries is None:
        rows = [{**row, "alpha1": unit_in * row["alpha1"], "alpha3": unit_in * row["alpha3"]} for row in PUBLISHED]
        entries = [WantedEntry.model_validate(row) for row in rows]
    if request.pattern is None and request.clearance.over is None:
        # the source judges the clearance at one angle
        at = conditions["clearance"].at
        conditions["clearance"] = type(conditions["clearance"])(**{**vars(conditions["clearance"]), "over": (at, at)})
    wanted, order = [], []
    for name, condition in conditions.items():
        part = [entry for entry in entries if entry.condition == name]
        if part:
            condition.check(mechanism)
            columns = {
                axis: np.array([angles.inward(getattr(entry, axis)) for entry in part])
                for axis in ("alpha1", "alpha3")
            }
            wanted.append(Wanted(condition, columns, np.array([entry.holds for entry in part])))
            order += part
    units = np.array([unit_of(name, angles) for name in names])
    ranges = {one.name: (one.low * unit, one.high * unit) for one, unit in zip(unknowns, units)}
    pattern = Pattern(mechanism, wanted, ranges)
    start = None if starts[0] is None else pattern.shares(np.array(starts, float) * units)
    start_margin = None if start is None else float(pattern.margins(start[None], work)[0].min())
    found, kept = search(
        pattern, request.draws if request.descents else 0, request.descents, request.seed, start, work
    )
    best, after = found[0], work.extended(LONGER)
    reproduced = best.worst > 0
    alone = single_ranges(pattern, best.share, after) if reproduced else None
    ways = directions(pattern, best, after) if reproduced else None

    def values(share: Any) -> dict[str, float]:
        return dict(zip(names, (pattern.values(share) / units).tolist()))

    return PatternFitReply(
        status="reproduced" if reproduced else "not reproduced",
        values=values(best.share),
        margin=best.worst,
        entries=[
            EntryMargin(
                condition=entry.condition,
                alpha1=entry.alpha1,
                alpha3=entry.alpha3,
                wanted=entry.holds,
                margin=float(margin),
            )
            for entry, margin in zip(order, best.margins)
        ],
        alone=None
        if alone is None
        else {name: [low / u, high / u] for name, (low, high), u in zip(names, alone, units)},
        directions=None
        if ways is None
        else [
            DirectionReply(
                strength=way.strength, back=way.back, forth=way.forth, vector=dict(zip(names, way.vector.tolist()))
            )
            for way in ways
        ],
        rank=None if ways is None else rank(ways),
        free=None if ways is None else len(names) - rank(ways),
        others=[SetReply(values=values(one.share), margin=one.worst) for one in found[1:]],
        draws=request.draws,
        draws_kept=kept,
        start_margin=start_margin,
        **provenance(request, names),
    )


def fit_table(reply: PatternFitReply, units: Units = DEGREES) -> str:
    """The set, and how far each unknown may move."""
    held = sum(entry.margin > 0 for entry in reply.entries)
    alone = reply.alone or {}
    rows = [
        [name, f"{value:.6g}", *(f"{bound:.6g}" for bound in alone.get(name, ("", "")) if bound != "")]
        for name, value in reply.values.items()
    ]
    margin = units.value(reply.margin, units.length, 4)
    lines = [
        f"{reply.status}: {held} of {len(reply.entries)} verdicts, smallest margin {margin}",
        table(["unknown", "value", *(["kept from", "to"] if alone else [])], rows),
    ]
    if reply.directions is not None:
        ends = [f"{way.back + way.forth:.3g}" for way in reply.directions]
        lines.append(
            f"{reply.free} of {len(reply.values)} directions are free to first order; along each the pattern is kept over"
        )
        lines.append("  " + ", ".join(ends) + " of the ranges")
    lines += [
        f"another set: margin {one.margin:.4g}{units.behind(units.length)}, "
        + ", ".join(f"{k} {v:.5g}" for k, v in one.values.items())
        for one in reply.others
    ]
    return "\n".join(lines)


REFERENCE = {
    "d1": 136,
    "D": 20,
    "beta.lead": 23.5,
    "beta.ratio": 0.5,
    "S1.j": 14,
    "S5.k": 0,
    "S10.i": 59,
    "S10.k": 31.5,
}

FIT = Query(
    path="/v1/knotter/fit",
    command="knotter fit",
    summary="Which unknown dimensions reproduce a wanted pattern of verdicts, and how little the pattern determines them?",
    request=PatternFitRequest,
    reply=PatternFitReply,
    answer=answer_fit,
    table=fit_table,
    shows_units=True,
    examples={
        "published_pattern": {"seed": 1},
        "defaults": {
            "draws": 0,
            "descents": 0,
            "unknowns": [
                {"name": name, "low": low, "high": high, "start": REFERENCE[name]}
                for name, (low, high) in DEFAULT_RANGES.items()
            ],
        },
    },
    is_long=lambda request: True,
)
