"""What a designer asks of a linkage next: how fast it moves, what its pins carry, what tolerances of manufacture do to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkage_atlas.motions import number
from synthesis.errors import FieldError
from synthesis.fourbar.analysis import Load, curve_over, forces, rates
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.tolerance_study import SOURCES, Spread, Study, Tolerances, simulate
from synthesis.target import TURN, Interval
from synthesis.work import Work

Floats = NDArray[np.float64]

LARGEST = 1e12
"""Of a crank speed, a force and a torque, in the user's units."""
MOST_SAMPLES, FEWEST_SAMPLES = 100_000, 100
"""Linkages that a tolerance study simulates at most, and the fewest where the bound of a request divides them."""
SAMPLES = 10_000
MOST_POSITIONS = 8_000_000
"""Positions of simulated linkages in all solutions of one request: a few seconds."""
BAND_STEPS = 48
"""Steps of the interval in which a study also gives its errors, to be drawn as a band."""
MOST_ROWS = 100_000
"""Rows of all curves in one reply."""


class OfLinks(NamedTuple):
    """A value for each of the two links that the crank drives, (n,) each."""

    coupler: Floats
    rocker: Floats


class PinForces(NamedTuple):
    """Forces in the four joints, (n, 2) each.

    By the ground on the crank, by the crank on the coupler, by the rocker on the coupler, by the ground on the rocker.
    """

    pivot_a: Floats
    crank_pin: Floats
    coupler_pin: Floats
    pivot_b: Floats


@dataclass(frozen=True)
class Analysis:
    """Velocities, accelerations and forces at n crank angles; NaN at a dead position and where the loop does not close.

    Attributes
    ----------
    crank_speed : float
        Counter-clockwise, constant, in the unit of angle a second.
    crank_angle : ndarray, shape (n,)
        From the start angle on.
    velocity, acceleration : ndarray, shape (n, 2), or None
        Of the body point, in lengths a second (squared); None where there is none.
    angular_velocity, angular_acceleration : OfLinks
        In the unit of angle a second (squared).
    transmission_angle : ndarray, shape (n,)
    crank_torque : ndarray, shape (n,), or None
        Of the drive on the crank, counter-clockwise, force times length, against the load alone: links without mass, pins without
        friction. None without a load.
    pin_forces : PinForces or None
    curve : Analysis or None
        The same over the used interval in steps of at most a degree.
    """

    crank_speed: float
    crank_angle: Floats
    velocity: Floats | None
    acceleration: Floats | None
    angular_velocity: OfLinks
    angular_acceleration: OfLinks
    transmission_angle: Floats
    crank_torque: Floats | None
    pin_forces: PinForces | None
    curve: Analysis | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract; null where there is no finite value."""
        found: dict[str, Any] = {
            "crank_angle": _plain(self.crank_angle),
            "velocity": _plain(self.velocity),
            "acceleration": _plain(self.acceleration),
            "angular_velocity": _named(self.angular_velocity),
            "angular_acceleration": _named(self.angular_acceleration),
            "transmission_angle": _plain(self.transmission_angle),
            "crank_torque": _plain(self.crank_torque),
            "pin_forces": None if self.pin_forces is None else _named(self.pin_forces),
        }
        if self.curve is None:
            return found
        return {"crank_speed": self.crank_speed, **found, "curve": self.curve.to_dict()}

    def columns(self) -> dict[str, Iterable[Any]]:
        """The columns of a table, a row a crank angle; None where there is no finite value."""
        blank = [None] * self.crank_angle.size
        plane = {"velocity": self.velocity, "acceleration": self.acceleration}
        columns: dict[str, Iterable[Any]] = {}
        if self.pin_forces is not None:
            plane |= {f"force_{name}": force for name, force in self.pin_forces._asdict().items()}
        for name, values in plane.items():
            for k, axis in enumerate("xy"):
                columns[f"{name}_{axis}"] = blank if values is None else _plain(values[:, k])
        for name in ("angular_velocity", "angular_acceleration"):
            for link, values in getattr(self, name)._asdict().items():
                columns[f"{link}_{name}"] = _plain(values)
        if self.crank_torque is not None:
            columns["crank_torque"] = _plain(self.crank_torque)
        return columns


class Drive(NamedTuple):
    """What an analysis is asked for: the crank's speed in the user's unit of angle, and a load."""

    crank_speed: float
    load: Load | None


def read_drive(analysis: Mapping[str, Any], mounted: bool) -> Drive:
    """A checked request for an analysis: ``crank_speed``, and perhaps ``load`` with ``force`` and ``torque``."""
    _known("analysis", analysis, ("crank_speed", "load"))
    if analysis.get("crank_speed") is None:
        raise FieldError("/analysis/crank_speed", "needed: how fast the crank turns")
    speed = _bounded("analysis/crank_speed", analysis["crank_speed"])
    load = analysis.get("load")
    if load is None:
        return Drive(speed, None)
    _known("analysis/load", load, ("force", "torque"))
    force = load.get("force")
    pair = np.zeros(2)
    if force is not None:
        if np.shape(force) != (2,):
            raise FieldError("/analysis/load/force", "wanted two numbers [fx, fy]")
        pair = np.array([_bounded("analysis/load/force", value) for value in force])
    if pair.any() and not mounted:
        raise FieldError("/analysis/load/force", "acts at the body point, but without `position` there is none")
    torque = 0.0 if load.get("torque") is None else _bounded("analysis/load/torque", load["torque"])
    return Drive(speed, Load(complex(*pair), torque))


def analysed(linkage: Linkage, drive: Drive, travel: Floats, radian: float, over: Interval | None = None) -> Analysis:
    """An analysis at crank angles (n,) in radians from the first sample, and over an interval."""
    found = rates(linkage, travel, drive.crank_speed * radian)
    held = None if drive.load is None else forces(linkage, travel, drive.load)
    return Analysis(
        drive.crank_speed,
        travel / radian,
        _plane(found.velocity),
        _plane(found.acceleration),
        OfLinks(found.coupler_velocity / radian, found.rocker_velocity / radian),
        OfLinks(found.coupler_acceleration / radian, found.rocker_acceleration / radian),
        linkage.joints(travel).transmission_angle / radian,
        None if held is None else held.crank_torque,
        None if held is None else PinForces(*(_plane(force) for force in held[1:])),
        None if over is None else analysed(linkage, drive, curve_over(over), radian),
    )


def check_rows(solutions: int, interval: Interval | None) -> None:
    """FieldError where the curves of so many solutions make too large a reply; None: an interval of at most a turn."""
    rows = solutions * curve_over(Interval(0.0, TURN) if interval is None else interval).size
    if rows > MOST_ROWS:
        most = MOST_ROWS * solutions // rows
        raise FieldError(
            "/top", f"with `analysis` over this interval wanted at most {most} linkages, found {solutions}"
        )


# -- tolerances of manufacture ----------------------------------------------------------------------------------------


class Quantiles(NamedTuple):
    """5, 50 and 95 % of the made linkages are at most so far off: (n,) each, or numbers; infinite where too many do not close."""

    p5: Any
    p50: Any
    p95: Any


class Made(NamedTuple):
    """An error of the body as made against the body as designed, at n crank angles."""

    simulated: Quantiles
    linear: Quantiles
    """To first order, for normally distributed deviations; NaN at a dead position."""
    worst: Quantiles
    """Numbers: of each made linkage's largest error over the samples."""


@dataclass(frozen=True)
class ToleranceStudy:
    """What tolerances of manufacture do to the motion of a body.

    Attributes
    ----------
    samples : int
        Linkages that were simulated.
    seed : int
    open_share : float
        The part of them that does not close at every sample.
    position, rotation : Made or None
        Distance of the body point, and absolute difference of the rotation, from those as designed, at the samples.
    contributions : dict
        Name of each source to its parts, 0 to 1, in the variances of position (None without a body point) and rotation, to
        first order, over all samples.
    band : tuple
        Crank angles over the used interval, and `Quantiles` of position (None without a body point) and rotation there.
    """

    samples: int
    seed: int
    open_share: float
    position: Made | None
    rotation: Made
    contributions: dict[str, tuple[float | None, float]]
    band: tuple[Floats, Quantiles | None, Quantiles]

    @property
    def largest(self) -> dict[str, str | None]:
        """The source that contributes most to the error of position and of rotation; None where nothing contributes."""
        found: dict[str, str | None] = {}
        for kind, name in enumerate(("position", "rotation")):
            parts = {source: both[kind] or 0.0 for source, both in self.contributions.items()}
            source = max(parts, key=lambda one: parts[one])
            found[name] = source if parts[source] > 0 else None
        return found

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract; null where there is no finite value."""
        angles, position, rotation = self.band
        ranked = sorted(self.contributions.items(), key=lambda item: -max(part or 0.0 for part in item[1]))
        return {
            "samples": self.samples,
            "seed": self.seed,
            "open_share": self.open_share,
            "position": None if self.position is None else _made(self.position),
            "rotation": _made(self.rotation),
            "largest": self.largest,
            "contributions": [{"source": name, "position": p, "rotation": r} for name, (p, r) in ranked],
            "band": {
                "crank_angle": _plain(angles),
                "position": None if position is None else _named(position),
                "rotation": _named(rotation),
            },
        }


class Manufacture(NamedTuple):
    """What a tolerance study is asked for."""

    tolerances: Tolerances
    samples: int = SAMPLES
    seed: int = 0


def read_manufacture(study: Mapping[str, Any]) -> Manufacture:
    """A checked request for a tolerance study: ``links``, ``pivots``, ``clearance``, ``samples``, ``seed``."""
    _known("tolerance_study", study, ("links", "pivots", "clearance", "samples", "seed"))
    sizes = [
        0.0 if study.get(name) is None else number(f"tolerance_study/{name}", study[name], 0.0)
        for name in Tolerances._fields
    ]
    counts = []
    for name, default, least, most in (("samples", SAMPLES, FEWEST_SAMPLES, MOST_SAMPLES), ("seed", 0, 0, 2**32 - 1)):
        value = default if study.get(name) is None else study[name]
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not least <= value <= most:
            raise FieldError(f"/tolerance_study/{name}", f"wanted a whole number from {least} to {most:,}")
        counts.append(int(value))
    return Manufacture(Tolerances(*sizes), *counts)


def share_of(manufacture: Manufacture, points: int, solutions: int) -> Manufacture:
    """The study that each of several solutions can have within the bound of a request."""
    most = MOST_POSITIONS // ((points + BAND_STEPS + 1) * max(1, solutions))
    return manufacture._replace(samples=max(FEWEST_SAMPLES, min(manufacture.samples, most)))


def study_notes(asked: Manufacture | None, solutions: Sequence[Any]) -> list[str]:
    """What a user should know of the studies of solutions."""
    studies = [one.tolerance_study for one in solutions]
    if asked is None or not studies or studies[0].samples == asked.samples:
        return []
    return [
        f"each tolerance study simulates {studies[0].samples:,} linkages instead of {asked.samples:,}, to bound the time of the "
        "request: ask for fewer solutions"
    ]


def studied(
    linkage: Linkage, manufacture: Manufacture, travel: Floats, over: Interval, radian: float, work: Work
) -> ToleranceStudy:
    """A tolerance study at crank angles (n,) in radians from the first sample, and over an interval."""
    band = np.linspace(*over, BAND_STEPS + 1)
    every = np.concatenate([travel, band])
    found = simulate(linkage, every, travel.size, *manufacture, work)
    parts = [[None] * len(SOURCES) if s is None else s.contributions for s in (found.position, found.rotation)]
    return ToleranceStudy(
        found.count,
        manufacture.seed,
        found.open_share,
        None if found.position is None else _of(found.position, travel.size, 1.0),
        _of(found.rotation, travel.size, radian),
        {name: (None if p is None else float(p), float(r)) for name, p, r in zip(SOURCES, *parts)},
        (band / radian, *_bands(found, travel.size, radian)),
    )


def _bands(found: Study, samples: int, radian: float) -> tuple[Quantiles | None, Quantiles]:
    position = None if found.position is None else Quantiles(*found.position.simulated[samples:].T)
    return position, Quantiles(*(found.rotation.simulated[samples:] / radian).T)


def _of(spread: Spread, samples: int, unit: float) -> Made:
    return Made(
        Quantiles(*(spread.simulated[:samples] / unit).T),
        Quantiles(*(spread.linear[:samples] / unit).T),
        Quantiles(*(spread.worst / unit).tolist()),
    )


# -- plain values -----------------------------------------------------------------------------------------------------


def _known(field: str, values: Mapping[str, Any], names: tuple[str, ...]) -> None:
    if not isinstance(values, Mapping):
        raise FieldError(f"/{field}", f"wanted a mapping of {', '.join(names)}")
    for name in values:
        if name not in names:
            raise FieldError.no_such(f"/{field}", name, names)


def _bounded(field: str, value: Any) -> float:
    found = number(field, value)
    if abs(found) > LARGEST:
        raise FieldError(f"/{field}", f"wanted at most {LARGEST:g} either way, found {found:g}")
    return found


def _plane(points: Any) -> Any:
    """Complex points as (..., 2)."""
    return None if points is None else np.stack([points.real, points.imag], axis=-1)


def _plain(values: Any) -> Any:
    """Numbers, and rows of numbers, with None for what is not finite."""
    if values is None:
        return None
    values = np.asarray(values)
    good: Any = np.isfinite(values)
    if values.ndim < 2:
        plain: Any = np.where(good, values.astype(object), None)
        return plain.tolist()
    return [row if fine else None for row, fine in zip(values.tolist(), good.all(axis=-1))]


def _named(values: Any) -> dict[str, Any]:
    return {name: _plain(value) for name, value in values._asdict().items()}


def _made(values: Made) -> dict[str, Any]:
    return {**_named(values.simulated), "linear": _named(values.linear), "worst": _named(values.worst)}
