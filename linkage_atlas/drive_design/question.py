"""Requests for drives and springs, checked and in the units of the linkage; angles in radians."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.analysis import read_load
from linkage_atlas.arguments import (
    LARGEST,
    Fields,
    bounded,
    box,
    build,
    column,
    flag,
    known_fields,
    mapping,
    number,
    one_of,
    pair,
    positive,
    sequence,
    whole_number,
)
from linkage_atlas.catalogues import PRESSURE, read_actuators, read_springs, read_torsion_springs
from linkage_atlas.drive_design.records import SPRING_KINDS
from synthesis.arrays import Floats
from synthesis.drives.catalogue import CatalogueRow
from synthesis.drives.crank_rocker import MAX_TIME_RATIO
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.springs import SpringRow, TorsionRow
from synthesis.errors import FieldError
from synthesis.mechanism import Box
from synthesis.studies.forces import Load, PointForce
from synthesis.target import MAX_LENGTH

KINDS = ("rotary", "actuator", "cylinder", "dyad")
"""Kinds of drives; a cylinder is an actuator."""
MAX_DRIVES, MAX_SPRINGS, MAX_MASSES = 8, 4, 20
"""Largest number of entries in a request."""
MAX_COUNT = 8
"""Largest number of equal actuators or springs side by side."""
SIZE_RATIO = 1e6
"""Largest ratio of a length to the size of the linkage, either way; beyond it coordinates lose their digits."""
MAX_TARGET_VALUES = 1000
"""Largest number of values of a wanted curve."""


@dataclass(frozen=True, kw_only=True)
class RotaryRequest:
    """A rotary drive at a fixed pivot."""

    links: list[str]
    transmission_angle_min: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ActuatorRequest:
    """An actuator or cylinder between a link and the ground, or another link."""

    links: list[str]
    retracted: float | None = None
    stroke: float | None = None
    catalogue: object = None
    pressure: float | None = None
    base_link: str = GROUND
    ground_box: Box | None = None
    reach_max: float | None = None
    arm_min: float | None = None
    dead_length: float | None = None
    rod: float | None = None
    extends: bool | None = None
    pin_box: Box | None = None
    """In the frame of the link."""
    ground_point: complex | None = None
    """The other end, in the plane at the first position; with a pin both ends are given and nothing is searched."""
    pin: complex | None = None
    """In the plane at the first position."""
    pin_on_link: complex | None = None
    """In the frame of the link."""
    count: int = 1
    """Number of equal actuators side by side."""
    rows: list[CatalogueRow] = field(default_factory=list)
    """Rows of the catalogue."""


@dataclass(frozen=True, kw_only=True)
class MotorRequest:
    """A motor that turns continuously, with a rod."""

    links: list[str]
    time_ratio: float | None = None
    motor_box: Box | None = None
    pin_radius: float | None = None
    reach_max: float | None = None
    transmission_angle_min: float = 0.0
    motor: complex | None = None
    """Position of the motor; with a pin both ends are given and nothing is searched."""
    pin: complex | None = None
    """In the plane at the first position."""
    pin_on_link: complex | None = None
    """In the frame of the link."""


DriveRequest = RotaryRequest | ActuatorRequest | MotorRequest


class Holding(NamedTuple):
    """Ends of the motion at which springs press the linkage onto its stop."""

    closed: bool
    """The first position."""
    open: bool
    """The last position."""
    force_min: float | None
    """Smallest force of a hand that leaves such an end."""


class TargetCurve(NamedTuple):
    """A torque of the drive, or a force of a hand, at even steps of the motion, which springs approximate."""

    quantity: Literal["torque", "hand_force"]
    values: Floats

    def at(self, share: Floats) -> Floats:
        """Return the wanted values at fractions of the motion, interpolated linearly."""
        return np.interp(share, np.linspace(0.0, 1.0, self.values.size), self.values)


@dataclass(frozen=True, kw_only=True)
class SpringRequest:
    """Springs that carry the load."""

    kind: Literal["tension", "gas", "compression", "torsion"]
    between: tuple[str, str] | None = None
    catalogue: object = None
    stiffness: float | None = None
    ground_box: Box | None = None
    reach_max: float | None = None
    pivot_distance_min: float | None = None
    count: int = 1
    """Number of equal springs side by side."""
    holds: Holding | None = None
    hand_force_max: float | None = None
    target: TargetCurve | None = None
    rows: list[SpringRow] = field(default_factory=list)
    """Rows of a catalogue of linear springs; without any rows springs are ideal."""
    torsion_rows: list[TorsionRow] = field(default_factory=list)
    """Rows of a catalogue of torsion springs."""

    @property
    def has_goal(self) -> bool:
        """True if springs have a task without a load: a wanted curve, or an end to hold with a force."""
        return self.target is not None or (self.holds is not None and self.holds.force_min is not None)


class DriveQuestion(NamedTuple):
    """A checked request, in the units of the linkage and in radians."""

    load: Load
    drives: tuple[DriveRequest, ...]
    springs: tuple[SpringRequest, ...]
    hand_point: complex | None
    millimetres: float

    @property
    def loaded(self) -> bool:
        """True if a force, a torque or a mass acts."""
        load = self.load
        return bool(load.force or load.torque or load.masses or any(acting.force for acting in load.forces))


class Reader:
    """Checks of a request for a linkage.

    Parameters
    ----------
    machine : LinkMotions
        The linkage over its motion.
    radian : float
        Radians in the user's unit of angle.
    millimetres : float
        Millimetres in the user's unit of length.
    is_example : bool
        The linkage is only an example, so that lengths need not be in proportion to it.
    """

    def __init__(
        self, machine: LinkMotions, radian: float, millimetres: float = 1.0, is_example: bool = False
    ) -> None:
        self.machine, self.radian, self.millimetres = machine, radian, millimetres
        self.extent = None if is_example else machine.extent

    def question(
        self, load: object, drives: object, springs: object, hand_point: ArrayLike | None = None
    ) -> DriveQuestion:
        """Check a whole request; raise FieldError with the name of a field."""
        checked_hand = None if hand_point is None else pair("hand_point", hand_point, MAX_LENGTH)
        if hand_point is not None and not springs:
            raise FieldError("/hand_point", "needs `springs`: give a spring, or remove this field")
        return DriveQuestion(
            self._load(load or {}),
            tuple(self.drive(f"drives/{k}", entry) for k, entry in enumerate(_list("drives", drives, MAX_DRIVES))),
            tuple(
                self.spring(f"springs/{k}", entry) for k, entry in enumerate(_list("springs", springs, MAX_SPRINGS))
            ),
            checked_hand,
            self.millimetres,
        )

    def _load(self, value: object) -> Load:
        machine = self.machine
        links, mounted = (*machine.links, "body"), machine.body is not None
        more, middles = ("speed", "forces"), machine.middles
        load, parts = read_load("load", value, links, mounted, MAX_MASSES, *more, link="body", middles=middles)
        values = mapping("load", value)
        entries = _list("load/forces", values.get("forces"), MAX_MASSES)
        acting = tuple(self._point_force(f"load/forces/{k}", entry) for k, entry in enumerate(entries))
        if parts:
            raise FieldError(
                "/load/parts", "is available for a single linkage only: use /v2/drives, or `linkage_atlas.drives`"
            )
        speed = bounded("load/speed", values.get("speed") or 0.0) * (self.radian if machine.turns else 1.0)
        return load._replace(speed=speed, metre=self.millimetres / 1000, forces=acting)

    def _point_force(self, at: str, entry: object) -> PointForce:
        entry = known_fields(at, entry, ("link", "point", "force"))
        names = [*self.machine.links, *(["body"] if self.machine.body is not None else [])]
        link = one_of(f"{at}/link", entry.get("link"), names)
        middle = self.machine.middles.get(link, 0j)
        point = pair(f"{at}/point", entry["point"], MAX_LENGTH) if "point" in entry else middle
        return PointForce(link, point, pair(f"{at}/force", entry.get("force"), words="[fx, fy]"))

    def drive(self, at: str, entry: object) -> DriveRequest:
        """Check an entry of ``drives``."""
        kind = one_of(f"{at}/kind", entry.get("kind") if isinstance(entry, Mapping) else None, KINDS)
        links = list(self.machine.links)
        match kind:
            case "rotary":
                pivoted = [name for name, link in self.machine.links.items() if link.pivot is not None]
                return build(RotaryRequest, self._fields(at, entry, RotaryRequest, pivoted))
            case "dyad":
                request = build(MotorRequest, self._fields(at, entry, MotorRequest, links))
                if not 1 / MAX_TIME_RATIO <= (request.time_ratio or 1.0) <= MAX_TIME_RATIO:
                    raise FieldError(
                        f"/{at}/time_ratio", f"must be a ratio from {1 / MAX_TIME_RATIO:g} to {MAX_TIME_RATIO:g}"
                    )
                searched = ("motor_box", "time_ratio", "pin_radius", "reach_max")
                _check_given_ends(at, request, "motor", searched)
                return request
        return self._actuator(at, self._fields(at, entry, ActuatorRequest, links))

    def _actuator(self, at: str, values: Fields) -> ActuatorRequest:
        names, request = self.machine.links, build(ActuatorRequest, values)
        if request.base_link not in (GROUND, *names):
            raise FieldError(
                f"/{at}/base_link", f"must be ground or one of {', '.join(names)}; it is {request.base_link!r}"
            )
        if set(request.links) == {request.base_link}:
            raise FieldError(
                f"/{at}/base_link",
                f"must differ from the link that the actuator moves; both are {request.base_link!r}",
            )
        searched = ("ground_box", "pin_box", "reach_max", "dead_length", "extends", "arm_min")
        _check_given_ends(at, request, "ground_point", searched)
        if not isinstance(request.extends, (bool, type(None))):
            raise FieldError(f"/{at}/extends", "must be true or false")
        if request.catalogue is not None:
            for name in ("retracted", "stroke", "dead_length"):
                if name in values:
                    raise FieldError(f"/{at}/{name}", "give either this or `catalogue`")
            pressure = PRESSURE if request.pressure is None else request.pressure
            rows = read_actuators(f"{at}/catalogue", request.catalogue, self.millimetres, pressure)
            return replace(request, rows=rows)
        if request.pressure is not None:
            raise FieldError(
                f"/{at}/pressure",
                "applies only to a catalogue with bores; give such a catalogue, or remove this field",
            )
        return request

    def spring(self, at: str, entry: object) -> SpringRequest:
        """Check an entry of ``springs``."""
        kind = one_of(f"{at}/kind", entry.get("kind") if isinstance(entry, Mapping) else None, SPRING_KINDS)
        values = self._fields(at, entry, SpringRequest)
        links = (GROUND, *self.machine.links)
        if "between" in values:
            both = sequence(values["between"])
            if len(both) != 2 or both[0] == both[1] or any(name not in links for name in both):
                raise FieldError(f"/{at}/between", f"must be two different links of {', '.join(links)}")
            values["between"] = (both[1], both[0]) if both[1] == GROUND else (both[0], both[1])
        is_real = kind != "tension" or "catalogue" in values
        behaviour, ends = ("holds", "hand_force_max", "target"), ("ground_box", "reach_max", "pivot_distance_min")
        if is_real:
            refused = {"stiffness": "applies only to ideal springs; remove this field or the catalogue"}
        else:
            ideal = "needs springs of a `catalogue`: with ideal springs the linkage stays at every position"
            fixed = "applies only to springs of a `catalogue`: the balance fixes the ends of ideal springs"
            refused = dict.fromkeys(behaviour, ideal) | dict.fromkeys(ends, fixed)
        if kind == "torsion":
            endless = "applies only to springs with two ends; a torsion spring sits in a joint"
            refused = dict.fromkeys(ends, endless) | refused
        for name in refused:
            if name in values:
                raise FieldError(f"/{at}/{name}", refused[name])
        if "holds" in values:
            values["holds"] = self._holding(f"{at}/holds", values["holds"])
        if "target" in values:
            values["target"] = self._curve(f"{at}/target", values["target"])
        if "hand_force_max" in values:
            self._check_hand(f"{at}/hand_force_max")
        catalogue = f"{at}/catalogue", values.get("catalogue")
        if kind == "torsion":
            values["torsion_rows"] = read_torsion_springs(*catalogue, self.millimetres, self.radian)
        elif is_real:
            values["rows"] = read_springs(*catalogue, kind, self.millimetres)
        return build(SpringRequest, {"kind": kind, **values})

    def _check_hand(self, at: str) -> None:
        if self.machine.body is None:
            raise FieldError(f"/{at}", "needs `position`, because the hand moves the body")

    def _holding(self, at: str, entry: object) -> Holding:
        entry, force = known_fields(at, entry, Holding._fields), None
        if "force_min" in entry:
            self._check_hand(f"{at}/force_min")
            force = bounded(f"{at}/force_min", positive(f"{at}/force_min", entry["force_min"], "number"))
        return Holding(flag(f"{at}/closed", entry.get("closed")), flag(f"{at}/open", entry.get("open")), force)

    def _curve(self, at: str, entry: object) -> TargetCurve:
        entry = known_fields(at, entry, ("torque", "hand_force"))
        if len(entry) != 1:
            raise FieldError(f"/{at}", "give either `torque` or `hand_force`")
        (name,) = entry
        if name == "hand_force":
            self._check_hand(f"{at}/hand_force")
        values = np.atleast_1d(column(f"{at}/{name}", entry[name]))
        if values.ndim != 1 or not 2 <= values.size <= MAX_TARGET_VALUES or not np.all(np.abs(values) <= LARGEST):
            raise FieldError(
                f"/{at}/{name}", f"must have 2 to {MAX_TARGET_VALUES} finite numbers, at even steps of the motion"
            )
        return TargetCurve("torque" if name == "torque" else "hand_force", values)

    def _fields(self, at: str, entry: object, request: type, links: Sequence[str] | None = None) -> dict[str, object]:
        """Return the fields of an entry after a check of numbers, boxes and links."""
        names = [item.name for item in fields(request) if item.name not in ("kind", "rows", "torsion_rows")]
        entry = known_fields(at, entry, ("kind", *names))
        del entry["kind"]
        values = {name: self._value(f"{at}/{name}", name, value) for name, value in entry.items()}
        if links is not None:
            values["links"] = _links(f"{at}/links", values.get("links"), links)
        return values

    def _value(self, at: str, name: str, value: object) -> object:
        match name:
            case "retracted" | "stroke" | "reach_max" | "pin_radius" | "rod" | "pivot_distance_min":
                return self._length(at, positive(at, value, "number"))
            case "arm_min" | "dead_length":
                return self._length(at, number(at, value, 0.0))
            case "time_ratio" | "pressure" | "stiffness" | "hand_force_max":
                return bounded(at, positive(at, value, "number"), MAX_LENGTH)
            case "transmission_angle_min":
                return number(at, value, 0.0) * self.radian
            case "ground_box" | "motor_box" | "pin_box":
                sides = box(at, value, flat=True)
                self._check_near(at, max(map(abs, sides)))
                return sides
            case "ground_point" | "motor" | "pin" | "pin_on_link":
                point = pair(at, value, MAX_LENGTH)
                self._check_near(at, abs(point))
                return point
            case "count":
                return whole_number(at, value, 1, MAX_COUNT)
        return value

    def _length(self, at: str, value: float) -> float:
        """Return a length that is in proportion to the linkage, if the linkage is known."""
        extent = self.extent
        if extent is not None and value and not extent / SIZE_RATIO <= value <= extent * SIZE_RATIO:
            size = f"{SIZE_RATIO:g} times the linkage's size"
            raise FieldError(f"/{at}", f"must be a length between {extent:.4g} / {size} and {extent:.4g} * {size}")
        return bounded(at, value, MAX_LENGTH)

    def _check_near(self, at: str, distance: float) -> None:
        if self.extent is not None and distance > self.extent * SIZE_RATIO:
            raise FieldError(f"/{at}", f"lies farther than {SIZE_RATIO:g} times the linkage's size from the origin")


def _check_given_ends(at: str, request: ActuatorRequest | MotorRequest, end: str, searched: Sequence[str]) -> None:
    """Raise FieldError unless both ends of a drive are given, for a single link and without fields of a search, or neither is."""
    is_given = getattr(request, end) is not None
    if is_given != (request.pin is not None or request.pin_on_link is not None):
        missing = "pin" if is_given else end
        boxes = [name for name in searched if name.endswith("_box")]
        raise FieldError(
            f"/{at}/{missing}",
            f"is required beside the other end; to search for both ends, use {' and '.join(boxes)} instead",
        )
    if not is_given:
        return
    if request.pin is not None and request.pin_on_link is not None:
        raise FieldError(f"/{at}/pin", "give either this or `pin_on_link`")
    if len(request.links) != 1:
        raise FieldError(f"/{at}/links", "must name the link that carries the given pin")
    for name in searched:
        if getattr(request, name) is not None:
            raise FieldError(f"/{at}/{name}", "applies only to a search, but both ends are given; remove this field")


def _list(name: str, value: object, max_entries: int) -> Sequence[Fields]:
    """Return the entries of a list; an entry that is no mapping is refused where its kind is read."""
    entries = () if value is None else value
    if not isinstance(entries, Sequence) or isinstance(entries, str) or len(entries) > max_entries:
        raise FieldError(f"/{name}", f"must be a list of at most {max_entries}")
    return entries


def _links(at: str, value: object, names: Sequence[str]) -> list[str]:
    if value is None:
        return list(names)
    if not (items := sequence(value)):
        raise FieldError(f"/{at}", f"must be a list of names from {', '.join(names)}")
    return list(dict.fromkeys(one_of(f"{at}/{k}", name, names) for k, name in enumerate(items)))
