"""Effect of tolerances of manufacture on the motion of a linkage: the request and the reply."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, NamedTuple, TypedDict

import numpy as np

from linkage_atlas.arguments import Fields, number, read_fields, whole_number
from linkage_atlas.records import Record, Values
from synthesis.arrays import Floats
from synthesis.linkage import Linkage
from synthesis.studies.tolerance_analysis import Spread, Tolerances, simulate
from synthesis.target import Interval
from synthesis.work import Work

MOST_SAMPLES, FEWEST_SAMPLES = 100_000, 100
"""Largest number of linkages that a study simulates, and the smallest number if the bound of a request divides them."""
SAMPLES = 10_000
MOST_POSITIONS = 8_000_000
"""Largest number of positions of simulated linkages in all solutions of one request: a few seconds."""
POSITIONS_A_SECOND = 1_000_000
"""Positions for each second of a request's budget; they take less than a third of it."""
BAND_STEPS = 48
"""Steps of the interval at which a study also gives its errors, to be drawn as a band."""


class Quantiles(NamedTuple):
    """Largest error of 5, 50 and 95 % of the simulated linkages; null (in Python infinite) if too many do not close."""

    p5: Values
    p50: Values
    p95: Values


class Worst(NamedTuple):
    """Quantiles of the largest error of each simulated linkage."""

    p5: Annotated[float, float | None]
    p50: Annotated[float, float | None]
    p95: Annotated[float, float | None]


class DeviationQuantiles(NamedTuple):
    """Quantiles of the difference between the body as made and as designed, at n positions of the drive."""

    p5: Values
    p50: Values
    p95: Values
    linear: Quantiles
    """To first order, for normally distributed deviations; null at a dead position."""
    worst: Worst
    """Quantiles of the largest error of each linkage over the samples."""

    @property
    def simulated(self) -> Quantiles:
        """Quantiles of the simulated linkages."""
        return Quantiles(self.p5, self.p50, self.p95)


class Contribution(NamedTuple):
    """Fraction, 0 to 1, that a source contributes to the variances of all samples."""

    source: str
    position: float | None
    """Fraction of the variance of the position, to first order."""
    rotation: float
    """Fraction of the variance of the rotation."""


class Largest(TypedDict):
    """Names of sources."""

    position: str | None
    rotation: str | None


class Band(NamedTuple):
    """Quantiles at positions of the drive from the first to the last sample."""

    crank_angle: Floats | None
    position: Quantiles | None
    rotation: Quantiles
    travel: Floats | None = None
    """Travel instead of crank angles for a slider or cylinder."""


@dataclass(frozen=True)
class ToleranceStudy(Record):
    """Effect of tolerances of manufacture on the motion of a body."""

    samples: int
    """Number of simulated linkages."""
    seed: int
    open_share: float
    """Fraction of them that does not close at every sample."""
    position: DeviationQuantiles | None
    """Distance of the body point from its position as designed."""
    rotation: DeviationQuantiles
    """Absolute difference of the rotation from the designed rotation."""
    largest: Largest
    """Source that contributes most; null if nothing contributes."""
    contributions: list[Contribution]
    band: Band
    """Quantiles over the used interval in even steps, to be drawn."""


class Manufacture(NamedTuple):
    """Checked request for a tolerance study."""

    tolerances: Tolerances
    samples: int = SAMPLES
    seed: int = 0


_READERS: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(Tolerances._fields, partial(number, minimum=0.0)),
    "samples": partial(whole_number, minimum=FEWEST_SAMPLES, maximum=MOST_SAMPLES),
    "seed": partial(whole_number, minimum=0, maximum=2**32 - 1),
}


def read_manufacture(study: Fields) -> Manufacture:
    """Check a request for a tolerance study: ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``."""
    read = read_fields("tolerance_study/", study, _READERS)
    tolerances = Tolerances(*(read.get(name, 0.0) for name in Tolerances._fields))
    return Manufacture(tolerances, read.get("samples", SAMPLES), read.get("seed", 0))


def share_of(manufacture: Manufacture, points: int, solutions: int, budget: float) -> Manufacture:
    """Reduce the number of samples so that all solutions fit into the bound of a request and its budget in seconds."""
    positions = min(MOST_POSITIONS, POSITIONS_A_SECOND * budget)
    samples = int(positions / ((points + BAND_STEPS + 1) * max(1, solutions)))
    return manufacture._replace(samples=max(FEWEST_SAMPLES, min(manufacture.samples, samples)))


def study_notes(request: Manufacture | None, studies: Sequence[ToleranceStudy | None]) -> list[str]:
    """Return a note if fewer linkages were simulated than requested."""
    counts = [study.samples for study in studies if study is not None]
    if request is None or not counts or counts[0] == request.samples:
        return []
    return [
        f"Each tolerance study simulates {counts[0]:,} linkages instead of {request.samples:,}, to bound the time of "
        "the request: ask for fewer solutions, or give it more time."
    ]


def studied(
    linkage: Linkage, request: Manufacture, travel: Floats, over: Interval, radian: float, work: Work
) -> ToleranceStudy:
    """Return the tolerance study at travel (n,) of the drive from the first sample, and over an interval, in the user's units."""
    band, samples, turns = np.linspace(*over, BAND_STEPS + 1), travel.size, linkage.driver.turns
    found = simulate(linkage, np.concatenate([travel, band]), samples, *request, work)
    sources = found.sources
    spreads = {"position": found.position, "rotation": found.rotation}
    none = np.zeros(len(sources))
    parts = {name: none if spread is None else spread.contributions for name, spread in spreads.items()}
    contributions = [
        Contribution(source, None if found.position is None else p, r)
        for source, p, r in zip(sources, parts["position"].tolist(), parts["rotation"].tolist())
    ]
    largest = {name: sources[int(np.argmax(part))] if part.max() > 0 else None for name, part in parts.items()}
    return ToleranceStudy(
        found.count,
        request.seed,
        found.open_share,
        None if found.position is None else _quantiles(found.position, samples, 1.0),
        _quantiles(found.rotation, samples, radian),
        Largest(position=largest["position"], rotation=largest["rotation"]),
        sorted(contributions, key=lambda source: -round(max(source.position or 0.0, source.rotation), 12)),
        Band(
            band / radian if turns else None,
            None if found.position is None else Quantiles(*found.position.simulated[samples:].T),
            Quantiles(*(found.rotation.simulated[samples:] / radian).T),
            None if turns else band,
        ),
    )


def _quantiles(spread: Spread, samples: int, unit: float) -> DeviationQuantiles:
    p5, p50, p95 = (spread.simulated[:samples] / unit).T
    linear = Quantiles(*(spread.linear[:samples] / unit).T)
    return DeviationQuantiles(p5, p50, p95, linear, Worst(*(spread.worst / unit).tolist()))
