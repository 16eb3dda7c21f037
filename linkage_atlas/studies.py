"""What a designer asks of a linkage next: how fast it moves, what its pins carry, what tolerances of manufacture do to it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import (
    bounded,
    check_above_zero,
    column,
    flag,
    known_fields,
    millimetres_in,
    number,
    one_of,
    pair,
    whole_number,
)
from linkage_atlas.assemblies import AskedAssembly, Assembly, read_assembly
from linkage_atlas.motions import MOST_STOCK, Motion
from linkage_atlas.notes import counted
from linkage_atlas.records import Record, Values, Vectors, plain, plane
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.fourbar.rounding import given_lengths, multiples
from synthesis.limits import BETWEEN_LENGTHS, Limits
from synthesis.linkage import Linkage, Mass
from synthesis.studies.forces import Load, forces, on_links
from synthesis.studies.sensitivity import changes
from synthesis.studies.tolerance_analysis import Spread, Study, Tolerances, simulate
from synthesis.target import MAX_LENGTH, MIN_LENGTH, TURN, Interval, Target
from synthesis.work import Work

MOST_SAMPLES, FEWEST_SAMPLES = 100_000, 100
"""Linkages that a tolerance study simulates at most, and the fewest where the bound of a request divides them."""
SAMPLES = 10_000
MOST_POSITIONS = 8_000_000
"""Positions of simulated linkages in all solutions of one request: a few seconds."""
POSITIONS_A_SECOND = 1_000_000
"""Of a request's budget, less than a third of which they take."""
BAND_STEPS = 48
"""Steps of the interval in which a study also gives its errors, to be drawn as a band."""
STEPS = 60
"""Steps of a curve over an interval of lengths."""
MOST_ROWS = 100_000
"""Rows of all curves in one reply."""


class OfLinks(NamedTuple):
    """A value for each of the two links that the crank drives."""

    coupler: Values
    rocker: Values


class PinForces(NamedTuple):
    """Forces in the four joints."""

    pivot_a: Vectors
    """By the ground on the crank."""
    crank_pin: Vectors
    """By the crank on the coupler."""
    coupler_pin: Vectors
    """By the rocker on the coupler."""
    pivot_b: Vectors
    """By the ground on the rocker."""


def columns_of(record: Any, *names: str) -> dict[str, Iterable[Any]]:
    """Columns of a table from fields of a record: x and y of vectors, one for each link or joint; none where a field is null."""
    columns: dict[str, Iterable[Any]] = {}
    for name in names:
        value: Any = getattr(record, name)
        parts = value._asdict() if hasattr(value, "_asdict") else value if isinstance(value, Mapping) else {"": value}
        for part, values in parts.items() if value is not None else ():
            called = name if not part else f"force_{part}" if name.endswith("forces") else f"{part}_{name}"
            if values.ndim == 1:
                columns[called] = plain(values)
            else:
                columns |= {f"{called}_{axis}": plain(values[:, k]) for k, axis in enumerate("xy")}
    return columns


@dataclass(frozen=True)
class Rates(Record):
    """A value a crank angle; null (in Python NaN) at a dead position, and where the loop does not close."""

    crank_angle: Floats
    """From the first sample on."""
    velocity: Vectors | None
    """Of the body point; null without positions."""
    acceleration: Vectors | None
    """Of the body point; null without positions."""
    angular_velocity: OfLinks
    angular_acceleration: OfLinks
    transmission_angle: Values
    crank_torque: Values | None
    """Of the drive on the crank, counter-clockwise; no friction, masses only those of the load. Null without a load."""
    pin_forces: PinForces | None
    """Null without a load."""

    def columns(self) -> dict[str, Iterable[Any]]:
        """The columns of a table, a row a crank angle; None where there is no finite value."""
        told = ("velocity", "acceleration", "pin_forces", "angular_velocity", "angular_acceleration", "crank_torque")
        blank = {f"{name}_{axis}": [None] * self.crank_angle.size for name in told[:2] for axis in "xy"}
        return blank | columns_of(self, *told)


@dataclass(frozen=True)
class Analysis(Rates):
    """Velocities, accelerations and forces at a constant speed of the crank."""

    crank_speed: float
    curve: Annotated[Rates | None, Rates]
    """The same over the used interval in steps of at most a degree."""


@dataclass(frozen=True, kw_only=True)
class GuidedRates(Record):
    """A value a place of the drive; null (in Python NaN) at a dead position, and where the loop does not close."""

    crank_angle: Floats | None = None
    """Of a crank or hinge from the first sample on."""
    travel: Floats | None = None
    """Of a slider or cylinder from the first sample on."""
    velocity: Vectors
    """Of the body point."""
    acceleration: Vectors
    """Of the body point."""
    angular_velocity: dict[str, Values]
    """Of each link that turns, by its name; the body is the coupler."""
    angular_acceleration: dict[str, Values]
    sliding_velocity: dict[str, Values]
    """Of the body point along a rail, of the pin along a slot, by the name of its slider or block."""
    transmission_angle: Values
    arm: Values
    """Moment arm of the second guide's push about the driven guide's pin."""
    drive_load: Values | None
    """Torque of a crank or hinge, counter-clockwise; force of a slider or cylinder, outwards; null without a load."""
    guide_forces: dict[str, Vectors] | None
    """By the link of each guide on the body, without friction; null without a load."""

    def columns(self) -> dict[str, Iterable[Any]]:
        """The columns of a table, a row a place of the drive; None where there is no finite value."""
        turning = ("angular_velocity", "angular_acceleration", "sliding_velocity")
        return columns_of(self, "velocity", "acceleration", "guide_forces", *turning, "drive_load")


@dataclass(frozen=True, kw_only=True)
class GuidedAnalysis(GuidedRates):
    """Velocities, accelerations and forces at a constant speed of the drive."""

    crank_speed: float
    """Of the drive: the unit of angle, or for a slider or cylinder the unit of length, a second."""
    curve: Annotated[GuidedRates | None, GuidedRates]
    """The same over the used interval."""


class AskedAnalysis(NamedTuple):
    """What an analysis is asked for: the crank's speed in the user's unit of angle, and a load."""

    crank_speed: float
    load: Load | None
    length_unit: str = "mm"
    parts: bool = False
    """Whether the links also weigh what their parts do."""

    def weighed(self, linkage: Linkage, used: Interval) -> AskedAnalysis:
        """With the masses of the linkage's parts, if those are meant."""
        if self.load is None or not self.parts:
            return self
        from linkage_atlas.solids import masses_of_parts

        found = masses_of_parts(linkage, used, self.length_unit)
        own = tuple(Mass(weight.link, weight.mass, complex(*weight.at), weight.inertia) for weight in found)
        return self._replace(load=self.load._replace(masses=self.load.masses + own), parts=False)


LINKS_WITH_MASS = ("crank", "coupler", "rocker", "body", "slider", "block", "second_slider", "second_block")
MOST_LINK_MASSES = 64
GRAVITY = 0, -9.81
"""Of masses unless a load says otherwise, m/s^2."""


def read_analysis(analysis: Mapping[str, Any], mounted: bool) -> AskedAnalysis:
    """A checked request for an analysis: ``crank_speed``, and perhaps ``load`` and ``length_unit``."""
    known_fields("analysis", analysis, ("crank_speed", "load", "length_unit"))
    if analysis.get("crank_speed") is None:
        raise FieldError("/analysis/crank_speed", "needed: how fast the crank turns")
    speed = bounded("analysis/crank_speed", analysis["crank_speed"])
    unit = analysis.get("length_unit", "mm")
    metre = millimetres_in(unit, "analysis/") / 1000
    given = analysis.get("load")
    if given is None:
        return AskedAnalysis(speed, None)
    load, parts = read_load("analysis/load", given, LINKS_WITH_MASS, mounted, MOST_LINK_MASSES)
    for place, one in enumerate(load.masses):
        if one.mass == 0:
            raise FieldError(f"/analysis/load/masses/{place}/mass", "wanted a mass above 0, found 0")
    return AskedAnalysis(speed, load._replace(metre=metre), unit, parts)


def read_load(
    field: str,
    given: Any,
    links: Sequence[str],
    mounted: bool,
    most: int,
    *also: str,
    link: str | None = None,
    middles: Mapping[str, complex] | None = None,
) -> tuple[Load, bool]:
    """A checked load with at most so many masses of ``links``, and whether parts weigh too.

    ``mounted``: whether there is a body point. ``also``: names of further fields, which are read elsewhere. ``link``: of a mass
    that names none. ``middles``: where those masses are, by link, that have no place; default: where the link's frame begins.
    """
    known_fields(field, given, ("force", "torque", "masses", "parts", "gravity", *also))
    given = {name: value for name, value in given.items() if value is not None}
    force = pair(f"{field}/force", given.get("force", (0, 0)), words="[fx, fy]")
    if force and not mounted:
        raise FieldError(f"/{field}/force", "acts at the body point, but without `position` there is none")
    torque = bounded(f"{field}/torque", given.get("torque", 0))
    gravity = pair(f"{field}/gravity", given.get("gravity", GRAVITY), words="[gx, gy]")
    masses = given.get("masses", ())
    if not isinstance(masses, Sequence) or isinstance(masses, str) or len(masses) > most:
        raise FieldError(f"/{field}/masses", f"wanted a list of at most {most} masses")
    read = tuple(
        _mass(f"{field}/masses/{k}", mass, links, mounted, link, middles or {}) for k, mass in enumerate(masses)
    )
    return Load(force, torque, read, gravity), flag(f"{field}/parts", given.get("parts"))


def _mass(
    field: str, given: Any, links: Sequence[str], mounted: bool, default: str | None, middles: Mapping[str, complex]
) -> Mass:
    known_fields(field, given, ("link", "mass", "at", "inertia"))
    given = {name: value for name, value in given.items() if value is not None}
    link: Any = one_of(f"{field}/link", given.get("link", default), links)
    if link == "body" and not mounted:
        raise FieldError(
            f"/{field}/link", "without `position` there is no body point that the body's frame begins in"
        )
    if "mass" not in given:
        raise FieldError(f"/{field}/mass", "needed: in kg")
    sizes = {name: bounded(f"{field}/{name}", given.get(name, 0)) for name in ("mass", "inertia")}
    for name, found in sizes.items():
        if found < 0:
            raise FieldError(f"/{field}/{name}", f"wanted at least 0, found {found:g}")
    at = pair(f"{field}/at", given["at"], MAX_LENGTH) if "at" in given else middles.get(link, 0j)
    return Mass(link, sizes["mass"], at, sizes["inertia"])


def analysed(
    linkage: Linkage,
    asked: AskedAnalysis,
    travel: Floats,
    radian: float,
    over: Interval | None = None,
) -> Any:
    """An `Analysis` or `GuidedAnalysis` at travel (n,) of the drive from the first sample, and over an interval."""
    asked = asked.weighed(linkage, over or Interval(float(travel.min()), float(travel.max())))
    record: tuple[Any, Any] = (Analysis, Rates) if linkage.is_four_bar else (GuidedAnalysis, GuidedRates)
    curve = None
    if over is not None:
        along = over.by_degrees() if linkage.driver.turns else np.linspace(*over, STEPS + 1)
        curve = record[1](**_rates(linkage, asked, along, radian))
    return record[0](**_rates(linkage, asked, travel, radian), crank_speed=asked.crank_speed, curve=curve)


def _rates(linkage: Linkage, asked: AskedAnalysis, travel: Floats, radian: float) -> dict[str, Any]:
    turns = linkage.driver.turns
    speed = asked.crank_speed * (radian if turns else 1.0)
    first, body, other = linkage.motions(travel)
    held = None
    if asked.load is not None:
        held = forces(linkage, travel, on_links(asked.load._replace(speed=speed), linkage))
    found = linkage.body(linkage.start + travel)
    values: dict[str, Any] = {
        "crank_angle": travel / radian if turns else None,
        "velocity": plane(body.velocity * speed),
        "acceleration": plane(body.acceleration * speed**2),
        "transmission_angle": found.transmission_angle / radian,
    }
    if linkage.is_four_bar:
        bare = {} if linkage.mounted else {"velocity": None, "acceleration": None}
        pins = None if held is None else (held.driven_ground, held.driven, held.other, held.other_ground)
        return (
            values
            | bare
            | {
                "angular_velocity": OfLinks(*(one.rate * speed / radian for one in (body, other))),
                "angular_acceleration": OfLinks(*(one.rate_change * speed**2 / radian for one in (body, other))),
                "crank_torque": None if held is None else held.drive,
                "pin_forces": None if pins is None else PinForces(*map(plane, pins)),
            }
        )
    turning = [link for link in (first, body, other) if not link.name.endswith("slider")]
    sliding = {
        one.name: linkage.along_rate(place, travel) * speed
        for place, one in enumerate((first, other))
        if not one.name.endswith(("crank", "rocker"))
    }
    on_body = None if held is None else {first.name: plane(held.driven), other.name: plane(held.other)}
    return values | {
        "travel": None if turns else travel,
        "angular_velocity": {link.name: link.rate * speed / radian for link in turning},
        "angular_acceleration": {link.name: link.rate_change * speed**2 / radian for link in turning},
        "sliding_velocity": sliding,
        "arm": found.arm,
        "drive_load": None if held is None else held.drive,
        "guide_forces": on_body,
    }


def check_rows(solutions: int, interval: Interval | None) -> None:
    """FieldError where the curves of so many solutions make too large a reply; None: an interval of at most a turn."""
    rows = solutions * (Interval(0.0, TURN) if interval is None else interval).by_degrees().size
    if rows > MOST_ROWS:
        most = MOST_ROWS * solutions // rows
        raise FieldError(
            "/top", f"with `analysis` over this interval wanted at most {counted(most, 'linkage')}, found {solutions}"
        )


# -- tolerances of manufacture ----------------------------------------------------------------------------------------


class Quantiles(NamedTuple):
    """5, 50 and 95 % of the linkages made are at most so far off; null (in Python infinite) where too many do not close."""

    p5: Values
    p50: Values
    p95: Values


class Worst(NamedTuple):
    """The same of a single number."""

    p5: Annotated[float, float | None]
    p50: Annotated[float, float | None]
    p95: Annotated[float, float | None]


class Made(NamedTuple):
    """An error of the body as made against the body as designed: quantiles of the linkages simulated, at n crank angles."""

    p5: Values
    p50: Values
    p95: Values
    linear: Quantiles
    """To first order, for normally distributed deviations; null at a dead position."""
    worst: Worst
    """Of each linkage's largest error over the samples."""

    @property
    def simulated(self) -> Quantiles:
        """The quantiles of the linkages simulated."""
        return Quantiles(self.p5, self.p50, self.p95)


class Contribution(NamedTuple):
    """The part of one source, 0 to 1, in the variances of all samples."""

    source: str
    position: float | None
    """Its part, 0 to 1, in the variance of the position to first order."""
    rotation: float
    """Its part in the variance of the rotation."""


class Largest(TypedDict):
    """Names of sources."""

    position: str | None
    rotation: str | None


class Band(NamedTuple):
    """Quantiles at crank angles from the first to the last sample."""

    crank_angle: Floats | None
    position: Quantiles | None
    rotation: Quantiles
    travel: Floats | None = None
    """In place of crank angles where the drive is a slider or cylinder."""


@dataclass(frozen=True)
class ToleranceStudy(Record):
    """What tolerances of manufacture do to the motion of a body."""

    samples: int
    """Linkages that were simulated."""
    seed: int
    open_share: float
    """The part of them that does not close at every sample."""
    position: Made | None
    """Distance of the body point from where it is as designed."""
    rotation: Made
    """Absolute difference of the rotation from that as designed."""
    largest: Largest
    """The source that contributes most; null where nothing does."""
    contributions: list[Contribution]
    band: Band
    """The quantiles over the used interval in even steps, to be drawn."""


class Manufacture(NamedTuple):
    """What a tolerance study is asked for."""

    tolerances: Tolerances
    samples: int = SAMPLES
    seed: int = 0


def read_manufacture(study: Mapping[str, Any]) -> Manufacture:
    """A checked request for a tolerance study: ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``."""
    known_fields("tolerance_study", study, ("links", "pivots", "clearance", "samples", "seed"))
    sizes = [
        0.0 if study.get(name) is None else number(f"tolerance_study/{name}", study[name], 0.0)
        for name in Tolerances._fields
    ]
    counts = []
    for name, default, least, most in (("samples", SAMPLES, FEWEST_SAMPLES, MOST_SAMPLES), ("seed", 0, 0, 2**32 - 1)):
        value = default if study.get(name) is None else study[name]
        counts.append(whole_number(f"tolerance_study/{name}", value, least, most))
    return Manufacture(Tolerances(*sizes), *counts)


def share_of(manufacture: Manufacture, points: int, solutions: int, budget: float) -> Manufacture:
    """The study that each of several solutions can have within the bound of a request and its budget in seconds."""
    positions = min(MOST_POSITIONS, POSITIONS_A_SECOND * budget)
    most = int(positions / ((points + BAND_STEPS + 1) * max(1, solutions)))
    return manufacture._replace(samples=max(FEWEST_SAMPLES, min(manufacture.samples, most)))


def study_notes(asked: Manufacture | None, solutions: Sequence[Any]) -> list[str]:
    """Return a note if fewer linkages were simulated than requested."""
    studies = [one.tolerance_study for one in solutions]
    if asked is None or not studies or studies[0].samples == asked.samples:
        return []
    return [
        f"Each tolerance study simulates {studies[0].samples:,} linkages instead of {asked.samples:,}, to bound the time of the "
        "request: ask for fewer solutions, or give it more time."
    ]


def studied(
    linkage: Linkage, asked: Manufacture, travel: Floats, over: Interval, radian: float, work: Work
) -> ToleranceStudy:
    """A tolerance study at travel (n,) of the drive from the first sample, and over an interval."""
    band, samples = np.linspace(*over, BAND_STEPS + 1), travel.size
    found = simulate(linkage, np.concatenate([travel, band]), samples, *asked, work)
    return described_study(found, asked, samples, band, radian, linkage.driver.turns)


@dataclass(frozen=True)
class Sensitivity:
    """Change of the motion per unit of each length, everything else held: rms over the samples, (4,) each."""

    rotation: Floats | None
    """Rms change of rotation per unit of crank, coupler, rocker, ground."""
    position: Floats | None
    """Rms change of position per unit of crank, coupler, rocker, ground."""


def sensitivity_of(linkage: Linkage, target: Target, radian: float) -> Sensitivity:
    """Return the sensitivity of a four-bar to its lengths."""
    _, rotation, position = zip(*changes(linkage, target, radian))
    return Sensitivity(*(None if values[0] is None else np.array(values) for values in (rotation, position)))


def described_study(
    found: Study, manufacture: Manufacture, samples: int, band: Floats, radian: float, turns: bool = True
) -> ToleranceStudy:
    """Return a study in the user's units; its first positions are the ``samples``, the others those of ``band``."""
    sources = found.sources
    both = {"position": found.position, "rotation": found.rotation}
    parts = {name: np.zeros(len(sources)) if one is None else one.contributions for name, one in both.items()}
    contributions = [
        Contribution(source, None if found.position is None else p, r)
        for source, p, r in zip(sources, parts["position"].tolist(), parts["rotation"].tolist())
    ]
    most = {name: sources[int(np.argmax(part))] if part.max() > 0 else None for name, part in parts.items()}
    return ToleranceStudy(
        found.count,
        manufacture.seed,
        found.open_share,
        None if found.position is None else _made(found.position, samples, 1.0),
        _made(found.rotation, samples, radian),
        Largest(position=most["position"], rotation=most["rotation"]),
        sorted(contributions, key=lambda source: -round(max(source.position or 0.0, source.rotation), 12)),
        Band(
            band / radian if turns else None,
            None if found.position is None else Quantiles(*found.position.simulated[samples:].T),
            Quantiles(*(found.rotation.simulated[samples:] / radian).T),
            None if turns else band,
        ),
    )


def _made(spread: Spread, samples: int, unit: float) -> Made:
    p5, p50, p95 = (spread.simulated[:samples] / unit).T
    linear = Quantiles(*(spread.linear[:samples] / unit).T)
    return Made(p5, p50, p95, linear, Worst(*(spread.worst / unit).tolist()))


# -- what is asked of each solution -----------------------------------------------------------------------------------

DRIVE_STUDIES = ("load", "drives", "springs", "drive")
"""Those of them that say what is to drive each solution."""
STUDIES = ("round_to", "lengths_from", "sensitivity", "analysis", "tolerance_study", "assembly", *DRIVE_STUDIES)
"""What may be asked of each solution beyond the linkage itself, by the names of the HTTP contract."""


class Studies(NamedTuple):
    """What is asked of each solution; None or False: not asked for."""

    round_to: float | None = None
    """A grid for the links."""
    lengths_from: tuple[float, ...] | None = None
    """Stock lengths for the links."""
    sensitivity: bool = False
    analysis: AskedAnalysis | None = None
    manufacture: Manufacture | None = None
    """Of a tolerance study."""
    drives: Mapping[str, Any] | None = None
    """Of `DRIVE_STUDIES`, as it was given."""
    assembly: AskedAssembly | None = None
    arranged: Mapping[int, Assembly] = {}
    """Assemblies that were made before, by id of the linkage."""

    @property
    def rounds(self) -> bool:
        """Whether lengths that can be had are asked for."""
        return self.round_to is not None or self.lengths_from is not None

    @property
    def long(self) -> bool:
        """Whether each solution takes long enough to look at the time after it."""
        long = (self.round_to, self.lengths_from, self.manufacture, self.drives, self.assembly)
        return any(one is not None for one in long)


def read_studies(given: Mapping[str, Any], motion: Motion) -> Studies:
    """The checked studies of a request, some of `STUDIES`, for solutions of a motion."""
    values = dict.fromkeys(STUDIES) | dict(given)
    positions = motion.samples.position is not None
    check_above_zero(round_to=values["round_to"])
    asked = Studies(
        values["round_to"],
        _lengths(values["lengths_from"]),
        bool(values["sensitivity"]),
        None if values["analysis"] is None else read_analysis(_in_unit(values["analysis"], motion), positions),
        None if values["tolerance_study"] is None else read_manufacture(values["tolerance_study"]),
        _drives(values),
        None if values["assembly"] is None else read_assembly(values["assembly"]),
    )
    if asked.assembly is not None and asked.assembly.body and not positions:
        raise FieldError("/assembly/body", "needs `position`: without it nothing says where the body is")
    if asked.round_to is not None and asked.lengths_from is not None:
        raise FieldError("/lengths_from", "give either this or `round_to`")
    for name in ("round_to", "lengths_from", "tolerance_study", "drives", "springs", "drive"):
        if values[name] is not None and not positions:
            raise FieldError(f"/{name}", "needs `position`: only positions fix the size of a linkage")
    return asked


def _in_unit(analysis: Any, motion: Motion) -> Any:
    """Return an analysis in the motion's unit of length, unless it has its own."""
    if motion.length_unit is None or not isinstance(analysis, Mapping):
        return analysis
    return {"length_unit": motion.length_unit, **analysis}


def check_lengths(asked: Studies, limits: Limits) -> None:
    """FieldError where the limits leave a four-bar no length that it can have."""
    low, high, grid = limits.link_min or 0.0, limits.link_max or math.inf, asked.round_to
    lengths: Iterable[float] = asked.lengths_from or ()
    if grid is not None:  # the shortest that is long enough is one of these
        lengths = multiples(np.maximum(1.0, np.round(low / grid) + np.arange(2.0)), grid).tolist()
    if lengths and np.isnan(given_lengths(limits)).any() and not any(low <= length <= high for length in lengths):
        name = "lengths_from" if grid is None else "round_to"
        raise FieldError(f"/{name}", f"none of the lengths is within {BETWEEN_LENGTHS}")


def _drives(values: Mapping[str, Any]) -> Mapping[str, Any] | None:
    given = {name: values[name] for name in DRIVE_STUDIES if values[name] is not None}
    if not given.keys() - {"load"}:
        if given:
            raise FieldError("/load", "has no effect without `drives`, `springs` or `drive`")
        return None
    return given


def _lengths(lengths: ArrayLike | None) -> tuple[float, ...] | None:
    if lengths is None:
        return None
    stock = column("lengths_from", lengths)
    if stock.ndim != 1 or not 1 <= stock.size <= MOST_STOCK:
        raise FieldError("/lengths_from", f"wanted 1 to {MOST_STOCK:,} lengths")
    for place, length in enumerate(stock):
        if not MIN_LENGTH <= number(f"lengths_from/{place}", length) <= MAX_LENGTH:
            raise FieldError(f"/lengths_from/{place}", f"wanted a length from {MIN_LENGTH:g} to {MAX_LENGTH:g}")
    return tuple(stock.tolist())
