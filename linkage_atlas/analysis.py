"""Velocities, accelerations and forces of a linkage whose drive moves at a constant speed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from linkage_atlas.arguments import Fields, bounded, flag, known_fields, millimetres_in, one_of, pair
from linkage_atlas.records import Record, Values, Vectors, plain, plane
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.link_motion import Mass
from synthesis.linkage import Linkage
from synthesis.studies.forces import Load, forces, on_links
from synthesis.target import MAX_LENGTH, TURN, Interval

STEPS = 60
"""Number of steps of a curve over an interval of lengths."""
MOST_ROWS = 100_000
"""Largest number of rows of all curves in one reply."""
LINKS_WITH_MASS = ("crank", "coupler", "rocker", "body", "slider", "block", "second_slider", "second_block")
MOST_LINK_MASSES = 64
GRAVITY = 0, -9.81
"""Default gravity of masses, m/s^2."""


class PinForces(NamedTuple):
    """Forces in the joints, without friction."""

    pivot_a: Vectors
    """Force of the ground and of a sliding drive on the link of the driven guide."""
    crank_pin: Vectors
    """Force of the link of the driven guide on the body."""
    coupler_pin: Vectors
    """Force of the link of the other guide on the body."""
    pivot_b: Vectors
    """Force of the ground on the link of the other guide."""


@dataclass(frozen=True, kw_only=True)
class Rates(Record):
    """Values at each position of the drive; null (in Python NaN) at a dead position, and if the loop does not close."""

    crank_angle: Floats | None = None
    """Angle of a crank or hinge from the first sample."""
    travel: Floats | None = None
    """Travel of a slider or cylinder from the first sample."""
    velocity: Vectors | None
    """Velocity of the body point; null without positions."""
    acceleration: Vectors | None
    """Acceleration of the body point; null without positions."""
    angular_velocity: dict[str, Values]
    """By the name of each link that turns; the body is the coupler."""
    angular_acceleration: dict[str, Values]
    sliding_velocity: dict[str, Values]
    """Velocity of the body point along a rail, or of the pin along a slot, by the name of its slider or block."""
    transmission_angle: Values
    arm: Values
    """Moment arm of the second guide's push about the driven guide's pin."""
    drive_load: Values | None
    """Torque of a crank or hinge, counter-clockwise; force of a slider or cylinder, outwards; null without a load."""
    pin_forces: PinForces | None
    """Null without a load."""

    def columns(self) -> dict[str, Iterable[object]]:
        """Return columns of a table with a row for each position; None if there is no finite value."""
        values = self.transmission_angle
        blank = {f"{name}_{axis}": [None] * values.size for name in ("velocity", "acceleration") for axis in "xy"}
        turning = "angular_velocity", "angular_acceleration", "sliding_velocity"
        return blank | columns_of(self, "velocity", "acceleration", "pin_forces", *turning, "drive_load")


@dataclass(frozen=True, kw_only=True)
class Analysis(Rates):
    """Velocities, accelerations and forces at a constant speed of the drive."""

    crank_speed: float
    """Speed of the drive per second, in the unit of angle, or for a slider or cylinder in the unit of length."""
    curve: Annotated[Rates | None, Rates]
    """Values over the used interval, for angles in steps of at most a degree."""


def columns_of(record: Any, *names: str) -> dict[str, Iterable[object]]:
    """Return columns of a table from fields of a record: for each link or joint, and x and y of vectors; none for null fields."""
    columns: dict[str, Iterable[object]] = {}
    for name in names:
        value: Any = getattr(record, name)
        parts = value._asdict() if hasattr(value, "_asdict") else value if isinstance(value, Mapping) else {"": value}
        for part, values in parts.items() if value is not None else ():
            head = name if not part else f"force_{part}" if name.endswith("forces") else f"{part}_{name}"
            if values.ndim == 1:
                columns[head] = plain(values)
            else:
                columns |= {f"{head}_{axis}": plain(values[:, k]) for k, axis in enumerate("xy")}
    return columns


class AskedAnalysis(NamedTuple):
    """Checked request for an analysis: the speed of the drive in the user's unit, and a load."""

    crank_speed: float
    load: Load | None
    length_unit: str = "mm"
    parts: bool = False
    """True if the masses of the parts are added."""

    def weighed(self, linkage: Linkage, used: Interval) -> AskedAnalysis:
        """Return the request with the masses of the linkage's parts, if they are requested."""
        if self.load is None or not self.parts:
            return self
        from linkage_atlas.solids import masses_of_parts

        found = masses_of_parts(linkage, used, self.length_unit)
        own = tuple(weight.as_mass() for weight in found)
        return self._replace(load=self.load._replace(masses=self.load.masses + own), parts=False)


def read_analysis(analysis: Fields, mounted: bool) -> AskedAnalysis:
    """Check a request for an analysis: ``crank_speed``, and optionally ``load`` and ``length_unit``."""
    analysis = known_fields("analysis", analysis, ("crank_speed", "load", "length_unit"))
    if "crank_speed" not in analysis:
        raise FieldError("/analysis/crank_speed", "is required: the speed of the crank")
    speed = bounded("analysis/crank_speed", analysis["crank_speed"])
    unit = analysis.get("length_unit", "mm")
    metre = millimetres_in(unit, "analysis/") / 1000
    if "load" not in analysis:
        return AskedAnalysis(speed, None)
    load, parts = read_load("analysis/load", analysis["load"], LINKS_WITH_MASS, mounted, MOST_LINK_MASSES)
    for index, mass in enumerate(load.masses):
        if mass.mass == 0:
            raise FieldError(f"/analysis/load/masses/{index}/mass", "must be a mass above 0; it is 0")
    return AskedAnalysis(speed, load._replace(metre=metre), str(unit), parts)


def read_load(
    field: str,
    values: Any,
    links: Sequence[str],
    mounted: bool,
    max_parts: int,
    *also: str,
    link: str | None = None,
    middles: Mapping[str, complex] | None = None,
) -> tuple[Load, bool]:
    """Check a load; return it, and whether the masses of the parts are added.

    Parameters
    ----------
    field : str
        Name of the load in the request.
    values : mapping
        The load.
    links : sequence of str
        Links that may have a mass.
    mounted : bool
        True if there is a body point.
    max_parts : int
        Maximum number of masses.
    *also : str
        Names of further fields, which are read elsewhere.
    link : str, optional
        Link of a mass that names none.
    middles : mapping, optional
        Centre of a mass without ``centre``, by link; default: the origin of the link's frame.
    """
    values = known_fields(field, values, ("force", "torque", "masses", "parts", "gravity", *also))
    force = pair(f"{field}/force", values.get("force", (0, 0)), words="[fx, fy]")
    if force and not mounted:
        raise FieldError(
            f"/{field}/force", "acts at the body point, which needs `position`; give `position`, or remove the force"
        )
    torque = bounded(f"{field}/torque", values.get("torque", 0))
    gravity = pair(f"{field}/gravity", values.get("gravity", GRAVITY), words="[gx, gy]")
    masses = values.get("masses", ())
    if not isinstance(masses, Sequence) or isinstance(masses, str) or len(masses) > max_parts:
        raise FieldError(f"/{field}/masses", f"must be a list of at most {max_parts} masses")
    more = links, mounted, link, middles or {}
    read = tuple(_mass(f"{field}/masses/{k}", mass, *more) for k, mass in enumerate(masses))
    return Load(force, torque, read, gravity), flag(f"{field}/parts", values.get("parts"))


def _mass(
    field: str, values: Any, links: Sequence[str], mounted: bool, default: str | None, middles: Mapping[str, complex]
) -> Mass:
    values = known_fields(field, values, ("link", "mass", "centre", "inertia"))
    link: Any = one_of(f"{field}/link", values.get("link", default), links)
    if link == "body" and not mounted:
        raise FieldError(
            f"/{field}/link", "the frame of the body needs `position`; give `position`, or name another link"
        )
    if "mass" not in values:
        raise FieldError(f"/{field}/mass", "is required, in kg")
    sizes = {name: bounded(f"{field}/{name}", values.get(name, 0)) for name in ("mass", "inertia")}
    for name, found in sizes.items():
        if found < 0:
            raise FieldError(f"/{field}/{name}", f"must be at least 0; it is {found:g}")
    centre = pair(f"{field}/centre", values["centre"], MAX_LENGTH) if "centre" in values else middles.get(link, 0j)
    return Mass(link, sizes["mass"], centre, sizes["inertia"])


def analysed(
    linkage: Linkage, request: AskedAnalysis, travel: Floats, radian: float, over: Interval | None = None
) -> Analysis:
    """Return the analysis at travel (n,) of the drive from the first sample, and its curve over an interval."""
    request = request.weighed(linkage, over or Interval(float(travel.min()), float(travel.max())))
    curve = None
    if over is not None:
        along = over.by_degrees() if linkage.driver.turns else np.linspace(*over, STEPS + 1)
        curve = Rates(**_rates(linkage, request, along, radian))
    return Analysis(**_rates(linkage, request, travel, radian), crank_speed=request.crank_speed, curve=curve)


def _rates(linkage: Linkage, request: AskedAnalysis, travel: Floats, radian: float) -> dict[str, Any]:
    turns = linkage.driver.turns
    speed = request.crank_speed * (radian if turns else 1.0)
    links = linkage.motions(travel)
    body, poses = links[1], linkage.body(linkage.start + travel)
    held = None
    if request.load is not None:
        held = forces(linkage, travel, on_links(request.load._replace(speed=speed), linkage))
    pins = None if held is None else (held.driven_ground, held.driven, held.undriven, held.undriven_ground)
    turning = [link for link in links if not link.name.endswith("slider")]
    sliding = [(index, link) for index, link in enumerate(links[::2]) if not link.name.endswith(("crank", "rocker"))]
    return {
        "crank_angle": travel / radian if turns else None,
        "travel": None if turns else travel,
        "velocity": plane(body.velocity * speed) if linkage.mounted else None,
        "acceleration": plane(body.acceleration * speed**2) if linkage.mounted else None,
        "angular_velocity": {link.name: link.rate * speed / radian for link in turning},
        "angular_acceleration": {link.name: link.rate_change * speed**2 / radian for link in turning},
        "sliding_velocity": {link.name: linkage.along_rate(index, travel) * speed for index, link in sliding},
        "transmission_angle": poses.transmission_angle / radian,
        "arm": poses.arm,
        "drive_load": None if held is None else held.drive,
        "pin_forces": None if pins is None else PinForces(*map(plane, pins)),
    }


def check_rows(solutions: int, interval: Interval | None) -> None:
    """Raise FieldError if the curves of the solutions make too large a reply; None: an interval of at most a turn."""
    rows = solutions * (Interval(0.0, TURN) if interval is None else interval).by_degrees().size
    if rows > MOST_ROWS:
        max_solutions = MOST_ROWS * solutions // rows
        raise FieldError(
            "/top", f"must be at most {max_solutions} with `analysis` over this interval; it is {solutions}"
        )
