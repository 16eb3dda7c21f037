"""What a designer asks of a body on two guides next: how fast it moves, what its guides carry, what tolerances do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from linkage_atlas.arguments import MILLIMETRES
from linkage_atlas.records import Record, Values, Vectors, plain, plane
from linkage_atlas.studies import BAND_STEPS, Drive, Manufacture, ToleranceStudy, described_study
from synthesis.arrays import Floats
from synthesis.fourbar.analysis import CURVE_LEAST, CURVE_STEP
from synthesis.guided.analysis import Load, Mass, forces
from synthesis.guided.linkage import BODY, GuidedLinkage
from synthesis.guided.manufacture import dimensions_of, simulate, slopes, sources_of
from synthesis.target import Interval, Target
from synthesis.work import Work

STEPS = 60
"""Steps of a curve over an interval of lengths."""


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
        columns: dict[str, Iterable[Any]] = {}
        plane = {"velocity": self.velocity, "acceleration": self.acceleration}
        plane |= {f"force_{name}": force for name, force in (self.guide_forces or {}).items()}
        for name, values in plane.items():
            for k, axis in enumerate("xy"):
                columns[f"{name}_{axis}"] = plain(values[:, k])
        for kind in ("angular_velocity", "angular_acceleration", "sliding_velocity"):
            for link, one in getattr(self, kind).items():
                columns[f"{link}_{kind}"] = plain(one)
        if self.drive_load is not None:
            columns["drive_load"] = plain(self.drive_load)
        return columns


@dataclass(frozen=True, kw_only=True)
class GuidedAnalysis(GuidedRates):
    """Velocities, accelerations and forces at a constant speed of the drive."""

    crank_speed: float
    """Of the drive: the unit of angle, or for a slider or cylinder the unit of length, a second."""
    curve: Annotated[GuidedRates | None, GuidedRates]
    """The same over the used interval."""


def analysed(
    linkage: GuidedLinkage, drive: Drive, travel: Floats, radian: float, over: Interval | None = None
) -> GuidedAnalysis:
    """An analysis at travel (n,) of the drive from the first sample, and over an interval."""
    drive = drive.weighed(linkage, over or Interval(float(travel.min()), float(travel.max())))
    curve = None if over is None else GuidedRates(**_rates(linkage, drive, curve_over(linkage, over), radian))
    return GuidedAnalysis(**_rates(linkage, drive, travel, radian), crank_speed=drive.crank_speed, curve=curve)


def curve_over(linkage: GuidedLinkage, over: Interval) -> Floats:
    """Travel over an interval, both ends included, in even steps: of at most a degree for angles."""
    first, last = over
    steps = STEPS
    if linkage.driver.turns:
        steps = max(CURVE_LEAST, int(np.ceil(abs(last - first) / CURVE_STEP * (1 - 1e-12))))
    return np.linspace(first, last, steps + 1)


def studied(
    linkage: GuidedLinkage, manufacture: Manufacture, travel: Floats, over: Interval, radian: float, work: Work
) -> ToleranceStudy:
    """A tolerance study at travel (n,) of the drive from the first sample, and over an interval."""
    band = np.linspace(*over, BAND_STEPS + 1)
    found = simulate(linkage, np.concatenate([travel, band]), travel.size, *manufacture, work)
    names = [source.name for source in sources_of(linkage)]
    turns = linkage.driver.turns
    return described_study(found, names, manufacture, travel.size, band / radian if turns else band, radian, turns)


class Change(NamedTuple):
    """What a dimension does to the motion."""

    dimension: str
    rotation: float | None
    """Rms change of rotation over the samples per unit of the dimension; null where no rotation was asked for."""
    position: float | None
    """Rms change of position."""


def changes(linkage: GuidedLinkage, target: Target, radian: float) -> list[Change]:
    """Rms changes of the motion per unit of each dimension, all else held: lengths, and per unit of angle directions."""
    found = []
    for name, guide, unit in dimensions_of(linkage):
        place, turn = slopes(linkage, linkage.start + target.crank, [(guide, unit)])
        scale = radian if unit.direction else 1.0
        rms = [
            None if given is None else float(np.sqrt(mean(np.abs(slope) ** 2))) * scale
            for given, mean, slope in (
                (target.rotation, target.rotation_mean, turn[0] / radian),
                (target.position, target.position_mean, place[0]),
            )
        ]
        found.append(Change(name, *rms))
    return found


def _rates(linkage: GuidedLinkage, drive: Drive, travel: Floats, radian: float) -> dict[str, Any]:
    turns = linkage.driver.turns
    speed = drive.crank_speed * (radian if turns else 1.0)
    links = linkage.links(travel)
    body, found = links[1], linkage.body(linkage.start + travel)
    held = None
    if drive.load is not None:
        masses = [Mass(BODY if one.link == "body" else one.link, *one[1:]) for one in drive.masses]
        load = Load(drive.load.force, drive.load.torque, masses, drive.gravity, MILLIMETRES[drive.length_unit] / 1000)
        held = forces(linkage, travel, load, speed)
    sliding = {
        name: linkage.along_rate(place, travel) * speed
        for place, name in enumerate((links[0].name, links[2].name))
        if not name.endswith(("crank", "rocker"))
    }
    turning = [link for link in links if not link.name.endswith("slider")]
    return {
        "crank_angle": travel / radian if turns else None,
        "travel": None if turns else travel,
        "velocity": plane(body.place_rate * speed),
        "acceleration": plane(body.place_second * speed**2),
        "angular_velocity": {link.name: link.direction_rate * speed / radian for link in turning},
        "angular_acceleration": {link.name: link.direction_second * speed**2 / radian for link in turning},
        "sliding_velocity": sliding,
        "transmission_angle": found.transmission_angle / radian,
        "arm": found.arm,
        "drive_load": None if held is None else held.drive,
        "guide_forces": None
        if held is None
        else {links[0].name: plane(held.driven), links[2].name: plane(held.other)},
    }
