"""Guides, joints and dimensions of a linkage as requests and replies hold them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import (
    Fields,
    build,
    check_names,
    check_required,
    mapping,
    number,
    one_of,
    pair,
    pointing,
    positive,
)
from linkage_atlas.records import Record, xy
from synthesis.arrays import Floats, cross
from synthesis.errors import FieldError
from synthesis.guides import DRIVERS, Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage as Plain
from synthesis.linkage import as_lengths, four_bar, on_guides
from synthesis.target import TURN, Interval

DriverName = Literal["crank", "slider", "cylinder", "hinge"]
OtherKindName = Literal["slider_crank", "swinging_block", "rail_slot", "two_rails", "two_slots"]
KindName = Literal["four_bar", OtherKindName]
LARGEST = 1e100
"""Largest coordinate or length in a request."""


class CircleGuide(NamedTuple):
    """A point of the body on a circle: a crank or rocker. Body points are in the body's frame."""

    guide: Literal["circle"]
    pivot: tuple[float, float]
    radius: float
    body_point: tuple[float, float]


class RailGuide(NamedTuple):
    """A point of the body on a line of the ground."""

    guide: Literal["rail"]
    point: tuple[float, float]
    direction: float
    """Angle of the rail against the x axis."""
    body_point: tuple[float, float]
    used: tuple[float, float] | None
    """Smallest and largest coordinate on the rail over the used interval, from its point along its direction."""


class SlotGuide(NamedTuple):
    """A line of the body through a fixed pin."""

    guide: Literal["slot"]
    pin: tuple[float, float]
    body_point: tuple[float, float]
    """A point of the line in the body's frame."""
    body_direction: float
    """Angle of the line in the body's frame."""
    used: tuple[float, float] | None
    """Smallest and largest coordinate of the pin in the slot over the used interval, from the body point along its direction."""


AnyGuide = CircleGuide | RailGuide | SlotGuide


def guide_in_words(guide: AnyGuide) -> str:
    """Return a guide in words, with the used length of a rail or slot if it is known."""
    if isinstance(guide, CircleGuide):
        return f"circle of radius {guide.radius:.6g} about {_point_in_words(guide.pivot)}"
    used = "" if guide.used is None else f", used from {guide.used[0]:.6g} to {guide.used[1]:.6g}"
    if isinstance(guide, RailGuide):
        return f"rail through {_point_in_words(guide.point)} at {guide.direction:.6g}{used}"
    return f"slot on the pin {_point_in_words(guide.pin)}{used}"


def _point_in_words(point: tuple[float, float]) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def guides_of(linkage: Plain, radian: float, used: Interval | None) -> list[AnyGuide]:
    """Return the guides of a linkage, the driven guide first, in the user's unit of angle.

    ``used``: travel from the first sample that the motion uses, if it is known.
    """
    guides: list[AnyGuide] = []
    for index, guide in enumerate(linkage.guides):
        values: dict[str, Any] = {name: _outward(name, value, radian) for name, value in guide._asdict().items()}
        if isinstance(guide, Circle):
            guides.append(CircleGuide("circle", **values))
            continue
        values["used"] = None if used is None else linkage.used(index, used)
        guides.append(RailGuide("rail", **values) if isinstance(guide, Rail) else SlotGuide("slot", **values))
    return guides


def _outward(name: str, value: complex | float, radian: float) -> object:
    if isinstance(value, complex):
        return xy(value)
    return value / radian if name.endswith("direction") else value


@dataclass(frozen=True)
class AtlasType(Record):
    """Dimension type of the atlas."""

    number: int
    """Number of the dimension type, from 1."""
    lengths: list[int]
    """L1 crank, L2 coupler, L3 rocker, L4 ground; of a slider-crank r crank, l rod, e offset of the rail from the pivot."""


class Joints(NamedTuple):
    """Positions of a linkage's joints over the travel of its drive; NaN if the loop does not close.

    Arrays have the shape of the travel, points a further axis (2,). Angles are in the linkage's unit, directions against the x
    axis.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> joints = la.FourBar(19, 72, 144, 165).joints([0, 90, 180])
    >>> joints.crank_pin.shape, joints.rotation.shape
    ((3, 2), (3,))
    """

    pivot_a: Floats
    """(2,): fixed pivot of the crank, or the fixed pin or the point of the rail of another driven guide."""
    pivot_b: Floats
    """(2,): fixed pivot of the rocker, or the fixed pin or the point of the rail of another guide."""
    crank_pin: Floats
    """Guided point of the driven guide: its body point on a circle or rail, its fixed pin in a slot."""
    coupler_pin: Floats
    """Guided point of the other guide."""
    body_point: Floats | None
    """None if the linkage guides no point."""
    crank_direction: Floats
    """Direction of the crank; of a rail or slot its own."""
    coupler_direction: Floats
    rocker_direction: Floats
    """Direction of the rocker; of a rail or slot its own."""
    rotation: Floats
    """Rotation of the body."""
    transmission_angle: Floats
    drive: Floats
    """The drive's coordinate, an angle or a length."""
    arm: Floats
    """Moment arm of the second guide's push about the pin of the driven guide."""


class Links(NamedTuple):
    """Lengths of a four-bar; the ground is the distance of its fixed pivots."""

    crank: float
    coupler: float
    rocker: float
    ground: float


class CouplerPoint(NamedTuple):
    """The body point in the coupler's frame, from the crank pin."""

    radius: float
    angle: float


class Mount(NamedTuple):
    """Position of a four-bar in the plane, and the point that it guides."""

    ground_angle: float
    """Angle of the line from pivot A to pivot B."""
    pivot_a: tuple[float, float]
    """Fixed pivot of the crank."""
    pivot_b: tuple[float, float]
    """Fixed pivot of the rocker."""
    coupler_point_polar: Annotated[CouplerPoint | None, CouplerPoint]
    """P = D + radius e^(i (angle + coupler angle + ground angle)), D the crank pin."""


@dataclass(frozen=True, kw_only=True)
class Dimensions(Record):
    """Dimensions of a linkage in a reply; fields that its kind does not have are null."""

    kind: KindName
    driver: DriverName
    """Drive of the first guide."""
    guides: list[AnyGuide] | None
    """The driven guide first; body points and directions are in the body's frame. Null if nothing is mounted."""
    branch: Literal[-1, 1]
    """For a four-bar +1 if the coupler pin lies to the left of the line from the crank pin to pivot B; otherwise the sign of the
    sine of the transmission angle."""
    start: float
    """The drive's coordinate at the first sample: direction of crank or slot in the plane, position along rail or slot."""
    links: Links | None
    """Lengths of a four-bar."""
    start_angle: float | None
    """Crank angle of a four-bar from the ground line at the first sample."""
    body_offset: float | None
    """For a four-bar: rotation = coupler angle (in -180..180 degrees at the first sample, continuous) + ground angle + this."""
    mount: Mount | None
    """Position of a four-bar in the plane; null if it is not mounted."""


def dimensions_of(linkage: Plain, radian: float, used: Interval | None = None) -> Dimensions:
    """Return the dimensions of a linkage; ``used``: travel that the motion uses, if it is known."""
    mount, point, is_four_bar = None, None, linkage.is_four_bar
    if is_four_bar and (linkage.mounted or linkage.pivot_a or linkage.ground_angle):
        point = linkage.coupler_point_polar
        mount = Mount(
            ground_angle=linkage.ground_angle / radian,
            pivot_a=xy(linkage.pivot_a),
            pivot_b=xy(linkage.pivot_b),
            coupler_point_polar=None if point is None else CouplerPoint(point[0], point[1] / radian),
        )
    offset = linkage.body_offset if is_four_bar else None
    return Dimensions(
        kind=linkage.kind.value,
        driver=linkage.driver.value,
        guides=guides_of(linkage, radian, used) if linkage.mounted else None,
        branch=1 if linkage.branch > 0 else -1,
        start=(linkage.start + linkage.ground_angle) / radian if linkage.driver.turns else linkage.start,
        links=Links(*map(float, linkage.links)) if is_four_bar else None,
        start_angle=linkage.start / radian if is_four_bar else None,
        body_offset=None if offset is None else offset / radian,
        mount=mount,
    )


def read_guide(field: str, guide: Fields | AnyGuide, radian: float) -> Guide:
    """Check a guide and return it for the numerics; ``used`` is not needed."""
    values: Fields = guide if isinstance(guide, Mapping) else guide._asdict()
    sort = one_of(f"{field}/guide", values.get("guide"), ("circle", "rail", "slot"))

    def point(name: str) -> complex:
        return pair(f"{field}/{name}", values.get(name, ()), LARGEST)

    def amount(name: str) -> float:
        if values.get(name) is None:
            raise FieldError(f"/{field}/{name}", "is required")
        return number(f"{field}/{name}", values[name])

    body_point = point("body_point")
    if sort == "circle":
        if not 0 < amount("radius") <= LARGEST:
            raise FieldError(f"/{field}/radius", f"must be a length above 0; it is {values['radius']}")
        return Circle(point("pivot"), amount("radius"), body_point)
    if sort == "rail":
        return Rail(point("point"), amount("direction") * radian, body_point)
    return Slot(point("pin"), body_point, amount("body_direction") * radian)


def read_four_bar(values: Fields, radian: float) -> Plain:
    """Check ``links``, ``branch``, ``start_angle``, ``body_offset`` and ``mount`` of a four-bar, see `linkage_atlas.FourBar`."""
    links, mount = mapping("links", values["links"]), mapping("mount", values.get("mount") or {})
    check_required("links/", links, Links._fields)
    check_required("", values, ("branch", "start_angle"))
    lengths = {name: positive(f"links/{name}", links[name]) for name in Links._fields}
    longest = max(lengths, key=lambda name: lengths[name])
    shorter = [name for name in lengths if name != longest]
    if lengths[longest] > (together := sum(lengths[name] for name in shorter)) * (1 + 1e-12):
        raise FieldError(
            f"/links/{longest}",
            f"the linkage cannot be assembled; {longest} {lengths[longest]:g} is longer than {shorter[0]}, {shorter[1]} and "
            f"{shorter[2]} together, {together:g}",
        )
    point, offset = mount.get("coupler_point_polar"), values.get("body_offset")
    if point is not None:
        polar = mapping("mount/coupler_point_polar", point)
        radius, angle = (
            number(f"mount/coupler_point_polar/{name}", polar.get(name)) for name in CouplerPoint._fields
        )
    return four_bar(
        as_lengths(lengths.values()),
        _read_branch(values["branch"]),
        number("start_angle", values["start_angle"]) * radian,
        pair("mount/pivot_a", mount.get("pivot_a", (0.0, 0.0)), np.inf),
        number("mount/ground_angle", mount.get("ground_angle", 0.0)) * radian,
        None if point is None else (radius, angle * radian),
        None if offset is None else number("body_offset", offset) * radian,
    )


def read_joints(
    a: ArrayLike, d: ArrayLike, c: ArrayLike, b: ArrayLike, p: ArrayLike | None, rotation: float, radian: float
) -> Plain:
    """Check the joints of a four-bar and return it, see `linkage_atlas.Linkage.from_points`."""
    pivot_a, crank_pin, coupler_pin, pivot_b = (
        pair(name, point, LARGEST) for name, point in zip("ADCB", (a, d, c, b))
    )
    crank, coupler = crank_pin - pivot_a, coupler_pin - crank_pin
    rocker, ground = pivot_b - coupler_pin, pivot_b - pivot_a
    for name, neighbour, link in (("D", "A", crank), ("C", "D", coupler), ("B", "C", rocker), ("B", "A", ground)):
        if not link:
            raise FieldError(f"/{name}", f"must differ from {neighbour}; the two points coincide")
    turn, point = float(np.angle(ground)), None
    if p is not None:
        arm = (pair("P", p, LARGEST) - crank_pin) / coupler * abs(coupler)
        point = (abs(arm), float(np.angle(arm)))
    return four_bar(
        (abs(crank), abs(coupler), abs(rocker), abs(ground)),
        1 if cross(pivot_b - crank_pin, coupler) >= 0 else -1,
        float(np.angle(crank / ground)) % TURN,
        pivot_a,
        turn,
        point,
        number("rotation", rotation) * radian - float(np.angle(coupler / ground)) - turn,
    )


def read_guides(
    guides: Sequence[Fields | AnyGuide], driver: object, branch: object, start: object, radian: float
) -> Plain:
    """Check two guides and their drive and return the linkage, see `linkage_atlas.Linkage`."""
    if isinstance(guides, (str, Mapping)) or len(guides) != 2:
        raise FieldError("/guides", f"must have two guides; it has {len(guides)}")
    first, second = (read_guide(f"guides/{index}", guide, radian) for index, guide in enumerate(guides))
    drive, known = Driver(one_of("driver", driver, tuple(Driver))), DRIVERS[type(first)]
    if drive not in known:
        name = type(first).__name__.lower()
        raise FieldError(
            "/driver", f"must be {' or '.join(known)}, because the first guide is a {name}; it is {driver!r}"
        )
    begin = number("start", start) * (radian if drive.turns else 1.0)
    linkage = on_guides((first, second), drive, _read_branch(branch), begin)
    check_apart(linkage)
    return linkage


def read_linkage(values: Fields, radian: float) -> Plain:
    """Check the plain values of a linkage and return it, see `linkage_atlas.Linkage.from_dict`."""
    values = mapping("linkage", values)
    if values.get("joints") is not None:
        joints = mapping("joints", values["joints"])
        check_names("/joints", joints, ("A", "D", "C", "B", "P", "rotation"))
        check_required("joints/", joints, "ADCB")
        points = [joints.get(name) for name in "ADCBP"]
        with pointing(lambda field: f"/joints{field}"):
            return build(read_joints, {"rotation": joints.get("rotation") or 0.0, "radian": radian}, *points)
    if values.get("links") is None:
        if values.get("guides") is None:
            forms = "or give `joints`, or two `guides` with `driver`, `branch` and `start`"
            raise FieldError("/links", f"is required; {forms}")
        names = ("guides", "driver", "branch", "start")
        check_required("", values, names)
        return build(read_guides, {**{name: values[name] for name in names}, "radian": radian})
    return read_four_bar(values, radian)


def _read_branch(branch: object) -> int:
    if branch not in (-1, 1):
        raise FieldError("/branch", f"must be 1 or -1; it is {branch}")
    return 1 if branch == 1 else -1


def check_apart(linkage: Plain) -> None:
    """Raise FieldError for two guides that hold the body to one condition, or that never let it turn."""
    first, second = linkage.guides
    both_points = first.holds_point and second.holds_point
    if both_points and first.body_point == second.body_point:
        raise FieldError("/guides/1/body_point", "must differ from the body point of the first guide")
    if first.has_pin and second.has_pin and first[0] == second[0]:
        raise FieldError("/guides/1", "must have another fixed point than the first guide")
    for kind, name in ((Rail, "direction"), (Slot, "body_direction")):
        if isinstance(first, kind) and isinstance(second, kind):
            if abs(np.sin(getattr(first, name) - getattr(second, name))) < 1e-3:
                message = f"must not be parallel to the first {kind.__name__.lower()}: the body could not turn"
                raise FieldError(f"/guides/1/{name}", message)
