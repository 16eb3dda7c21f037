"""Plates and pins in layers as a user asks for them: whether a linkage can be built so that nothing collides, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Annotated, Literal, NamedTuple, TypedDict

import numpy as np

from linkage_atlas.arguments import (
    Fields,
    box,
    check_names,
    flag,
    number,
    one_of,
    pair,
    pointing,
    sequence,
    whole_number,
)
from linkage_atlas.part_settings import PART_SETTINGS, PartSettings
from linkage_atlas.records import KEPT, Record
from synthesis.assembly import stacks
from synthesis.assembly.driven_machine import Strut, motor_driven, strut_driven
from synthesis.assembly.keep_out import ENVELOPE, outside
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine, Sizes
from synthesis.assembly.parts import Heights, parts_of
from synthesis.assembly.shapes import crosses_itself, signed_area
from synthesis.assembly.sizes import check_sizes
from synthesis.assembly.stacks import ABOVE, BELOW, BOARDS, BOTH, Arrangement, StackRequest, arrange
from synthesis.drives.six_bar import Motor
from synthesis.errors import FieldError
from synthesis.linkage import Linkage
from synthesis.mechanism import Box
from synthesis.target import MAX_LENGTH, Interval
from synthesis.work import Work

ASSEMBLY = (
    *PART_SETTINGS,
    "boards",
    "heads",
    "body",
    "mounts",
    "layers_most",
    "envelope",
    "keep_out",
    "drive",
)
"""What may be asked of an assembly, by the names of the HTTP contract."""
MOST_CORNERS = 200
"""Corners of a body's outline at most."""
LAYERS_MOST, MOST_LAYERS = 6, 8
"""Layers that are tried unless a request says so, and at most."""
MOUNTS = (BELOW, ABOVE, BOTH)
"""How a fixed pin may be held."""
FIXED_PINS = ("A", "B", "M", "G", "A1", "A2", "B1", "B2")
"""Pins on the ground: of links on circles and of slots, of a motor or a cylinder, and the posts of rails."""
MOST_TOLD = 5
"""Places outside of the envelope, or in boxes, that sentences name."""
SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Of the default hole, tried in turn."""
NOT_SAID = "tilt of long pins, play and tolerances of thickness are not in the clearance"

Status = Annotated[str, Literal["free", "blocked", "touching"]]
Part = Annotated[str, Literal["plate", "pin", "post", "head", "board"]]
Cause = Annotated[str, Literal["pair", "loop"]]
Collision = TypedDict("Collision", {"pair": list[str], "from": float, "to": float})
"""Two parts, and the crank angles between which they collide; over the seam of a whole turn ``to`` lies beyond it."""


class LeastGap(NamedTuple):
    """How near two parts of one layer come."""

    value: float
    """The distance of their outlines less the clearance."""
    pair: tuple[str, str]
    crank_angle: float


class Stop(NamedTuple):
    """Where the motion ends; all null where nothing ends it."""

    crank_angle: float | None
    cause: Annotated[str | None, Cause | None]
    """Two parts collide, or the loop itself ends."""
    pair: tuple[str, str] | None
    """The parts that collide there."""


class Stops(NamedTuple):
    """The ends of the motion on both sides of the used interval, or where that is blocked, of the longest free part of it."""

    low: Stop
    high: Stop


class HeldPin(NamedTuple):
    """A pin, or a post within one link."""

    name: str
    layers: tuple[int, int]
    """The lowest and the highest that it fills; 0 is the board below, one more than the count the board above."""
    held: Annotated[str, Literal["one", "two"]]
    """On how many sides."""


class ThroughShaft(NamedTuple):
    """Whether a fixed pivot can be held from both sides."""

    both_sides: bool
    because: str | None
    """What passes over it; null where nothing does."""


class Slit(NamedTuple):
    """A slit along which a pin slides: the ends that its middle reaches."""

    first: tuple[float, float]
    last: tuple[float, float]
    pin: str


class Hole(NamedTuple):
    """A hole and the pin or post that it is for."""

    at: tuple[float, float]
    pin: str


@dataclass(frozen=True)
class AssemblyPart(Record):
    """A part: everything within a radius of a core, between two heights, in the frame of its link."""

    name: str
    """crank, coupler, rocker, rail, motor_crank, rod, body, bar; pin_D, post_P, head_D_below, board_below."""
    kind: Part
    link: str
    """Whose frame it is: from the link's first joint, x to its second (crank A to D, coupler D to C, rocker B to C); the ground's
    from A in the axes of the request. A body on guides: from D, or the point of its slot, in its own axes."""
    core: list[tuple[float, float]]
    """A point, the ends of a line, or the corners of a polygon, counter-clockwise."""
    radius: float
    holes: list[Hole]
    layers: tuple[int, int]
    """The lowest and the highest that it fills."""
    z: tuple[float, float]
    """Its lower and upper face; layer 1 begins at 0."""
    slits: list[Slit]
    """Of rails, and of a body with a slot; as wide as a hole."""


class PartSizes(NamedTuple):
    """Sizes that were used, those of the request or the defaults, in the unit of the lengths."""

    hole: float
    """Diameter of the pins."""
    width: float
    """Of the plates."""
    clearance: float
    """Least gap that is wanted of parts that pass one another."""
    thickness: float
    """Of the plates."""
    washer: float
    """Between two layers."""


@dataclass(frozen=True)
class Assembly(Record):
    """Layers of a linkage's plates, and whether they pass one another over the used interval: proved, not sampled."""

    status: Status
    """free: nothing comes nearer than the clearance; touching: something may just reach it; blocked: no layers are free."""
    count: int
    """Layers."""
    layers: dict[str, int]
    """Of each plate, from 1; where blocked, those that are free over the longest part of the motion."""
    mounts: dict[str, str]
    """How each fixed pin is held: below, above or below+above; none with a bar."""
    least_gap: LeastGap | None
    """Of all parts that share a layer; null where none do, or where blocked."""
    stops: Stops
    collisions: list[Collision]
    """Of the layers told; empty where they are free. Also of plates with "envelope" and "keep_out 1", which no layers free."""
    touches: list[Collision]
    """Where parts may just reach one another."""
    longest_free: tuple[float, float] | None
    """Where blocked, the longest part of the used interval without a collision; null where there is none."""
    pins: list[HeldPin]
    shaft: dict[str, ThroughShaft]
    """Of each fixed pivot."""
    fewer: dict[str, Collision | None]
    """By a number of layers, one less: what stops the best arrangement in so few; null where plates on one pin need more."""
    others: int
    """Further free arrangements in as many layers."""
    tried: int
    """Arrangements that were looked at; those that a part of them excludes count once."""
    exhaustive: bool
    """Whether all were, of as many layers, or where blocked of `layers_most`."""
    sizes: PartSizes
    parts: list[AssemblyPart]
    reasons: list[str]
    """Sentences."""
    machine: Machine = field(metadata=KEPT, repr=False)
    """Plates and pins in radians."""
    arrangement: Arrangement = field(metadata=KEPT, repr=False)
    """What was found, in radians."""
    settings: PartSettings = field(metadata=KEPT, repr=False)
    """All sizes, the defaults filled in."""
    given: PartSettings = field(metadata=KEPT, repr=False)
    """The sizes of the request."""
    driven_hinge: str = field(default="", metadata=KEPT, repr=False)
    """Name of the link with a drive in its hinge; empty without such a drive."""

    @property
    def free(self) -> bool:
        """Whether nothing collides."""
        return self.status == "free"


class AskedAssembly(NamedTuple):
    """What is asked of an assembly, checked."""

    settings: PartSettings
    body: tuple[complex, ...]
    arranged: StackRequest
    envelope: Box | None = None
    keep_out: tuple[Box, ...] = ()
    drive: Motor | Strut | str | None = None
    """A motor with its rod, a cylinder or a knee; of a drive in a hinge its link."""

    def within(self, envelope: Box | None, keep_out: Sequence[Box]) -> AskedAssembly:
        """With the boxes of a request's limits, where it has none of its own."""
        return self._replace(
            envelope=self.envelope if envelope is None or self.envelope is not None else envelope,
            keep_out=self.keep_out or tuple(keep_out),
        )


def read_assembly(request: Fields | bool, where: str = "assembly/") -> AskedAssembly | None:
    """A checked request for an assembly: some of `ASSEMBLY`, or true for the defaults; None where none is asked for.

    ``where``: what stands before its fields in the names that errors have.
    """
    if isinstance(request, bool):
        request = {} if request else None  # type: ignore[assignment]
    if request is None:
        return None
    if not isinstance(request, Mapping):
        raise FieldError(f"/{where.rstrip('/')}", f"wanted true, or a mapping of {', '.join(ASSEMBLY)}")
    check_names(f"/{where}".rstrip("/"), request, ASSEMBLY)
    values = dict.fromkeys(ASSEMBLY) | {name: value for name, value in request.items() if value is not None}
    boards = one_of(f"{where}boards", values["boards"] or "below", BOARDS)
    layers_max = LAYERS_MOST if values["layers_most"] is None else values["layers_most"]
    layers_max = whole_number(f"{where}layers_most", layers_max, 1, MOST_LAYERS)
    heads = flag(f"{where}heads", values["heads"])
    return AskedAssembly(
        PartSettings.read(values, where),
        () if values["body"] is None else _outline(f"{where}body", values["body"]),
        StackRequest(boards, heads, layers_max, _mounts(f"{where}mounts", values["mounts"], boards)),
        None if values["envelope"] is None else box(f"{where}envelope", values["envelope"]),
        tuple(box(f"{where}keep_out/{k}", out) for k, out in enumerate(values["keep_out"] or ())),
        None if values["drive"] is None else read_drive(f"{where}drive", values["drive"]),
    )


def read_drive(name: str, drive: object) -> Motor | Strut | str:
    """Read a drive as a reply has it, whose parts are arranged with the linkage; of a drive in a hinge its link."""

    def of(record: object, name_of_part: str) -> object:
        return record.get(name_of_part) if isinstance(record, Mapping) else getattr(record, name_of_part, None)

    def length(record: object, name_of_part: str, at: str = "") -> float:
        found = _length(f"{name}/{at}{name_of_part}", of(record, name_of_part))
        if found is None:
            raise FieldError(f"/{name}/{at}{name_of_part}", "needed: give the drive as a reply has it")
        return found

    kind = one_of(f"{name}/kind", of(drive, "kind"), ("rotary", "actuator", "dyad", "toggle"))
    link = of(drive, "link")
    if not isinstance(link, str):
        raise FieldError(f"/{name}/link", f"wanted the name of a link, found {link!r}")
    if kind == "rotary":
        return link
    if kind == "dyad":
        motor, six_bar = pair(f"{name}/motor", of(drive, "motor"), np.inf), of(drive, "six_bar")
        pin = pair(f"{name}/pin_on_link", of(drive, "pin_on_link"), np.inf)
        return Motor(link, motor, length(six_bar, "crank", "six_bar/"), length(six_bar, "coupler", "six_bar/"), pin)
    pin = pair(f"{name}/pin_on_link", of(drive, "pin_on_link"), np.inf)
    end, on = pair(f"{name}/ground_point", of(drive, "ground_point"), np.inf), str(of(drive, "on") or "ground")
    if kind == "actuator":
        return Strut(link, on, pin, end, (length(drive, "retracted"), length(drive, "stroke")))
    lock, knee = of(drive, "lock"), sequence(of(of(drive, "curve"), "knee"))
    if not knee:
        raise FieldError(f"/{name}/curve/knee", "needed: give the drive as a reply has it")
    top, knee_pin = (
        pair(f"{name}/{at}", value, np.inf) for at, value in (("curve/knee/0", knee[0]), ("pin", of(drive, "pin")))
    )
    side = np.sign(np.imag(np.conj(knee_pin - end) * (top - end)))
    # the end that is locked is bent the other way than all others
    side = side if of(drive, "extends") in (True, None) else -side
    return Strut(
        link, "ground", pin, end, (length(lock, "handle", "lock/"), length(lock, "strut", "lock/")), int(side) or 1
    )


def _length(name: str, value: object) -> float | None:
    if value is None:
        return None
    found = number(name, value, 0.0)
    if not found > 0:
        raise FieldError(f"/{name}", f"wanted a length above 0, found {found:g}")
    return found


def _mounts(name: str, value: object, boards: str) -> dict[str, str]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise FieldError(f"/{name}", "wanted a mapping such as {'A': 'below'}")
    if value and boards == "bar":
        raise FieldError(f"/{name}", "a bar is a plate itself: its pins stand in no board")
    allowed = {"below": MOUNTS[:1], "above": MOUNTS[1:2], "both": MOUNTS}[boards] if value else ()
    for pin, mount in value.items():
        if pin not in FIXED_PINS:
            raise FieldError.no_such(f"/{name}", pin, FIXED_PINS, "fixed pin")
        if mount not in allowed:
            raise FieldError(f"/{name}/{pin}", f"wanted {' or '.join(allowed)} with boards {boards}, found {mount!r}")
    return dict(value)


def _outline(name: str, value: object) -> tuple[complex, ...]:
    """The corners of a body's outline, counter-clockwise."""
    try:
        points = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        points = np.zeros(0)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise FieldError(f"/{name}", "wanted corners [x, y], all finite")
    if np.abs(points).max(initial=0.0) > MAX_LENGTH:
        raise FieldError(f"/{name}", f"wanted corners within {MAX_LENGTH:g} of the body point")
    corners = [complex(*point) for point in points]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if not 3 <= len(corners) <= MOST_CORNERS:
        raise FieldError(f"/{name}", f"wanted 3 to {MOST_CORNERS} corners, found {len(corners)}")
    if crosses_itself(corners):
        raise FieldError(f"/{name}", "the outline crosses or touches itself")
    return tuple(corners if signed_area(corners) > 0 else corners[::-1])


def machine_of(linkage: Linkage, request: AskedAssembly, used: Interval, where: str = "assembly/") -> Machine:
    """Return plates and pins of a linkage with the requested sizes, and with standard sizes by default.

    If the default hole leaves no material, the largest of its `SHARES` that leaves some is used. Raises `FieldError` if all of
    them leave none.
    """
    if request.body and not linkage.mounted:
        raise FieldError(f"/{where}body", "needs `position`: without it nothing says where the body is")
    for share in SHARES:
        try:
            return _machine(linkage, request, share, used, where)
        except FieldError as error:
            if request.settings.hole is not None or error.field not in (f"/{where}body", f"/{where}hole"):
                raise
            refused = error
    raise refused


def _machine(linkage: Linkage, request: AskedAssembly, share: float, used: Interval, where: str) -> Machine:
    bar = request.arranged.boards == "bar"

    def plates_of(sizes: Sizes, outline: Sequence[complex]) -> Machine:
        if isinstance(request.drive, Motor):
            return motor_driven(linkage, used, request.drive, sizes, outline, bar)
        if isinstance(request.drive, Strut):
            return strut_driven(linkage, used, request.drive, sizes, outline, bar)
        return as_plates(linkage, used, sizes, outline, bar)

    with pointing(lambda field: f"/{where}{field.lstrip('/')}" if field.startswith(("/drive", "/body")) else field):
        rough = plates_of(request.settings.sizes._replace(hole_factor=share), ())
        completed = request.settings.completed(rough.hole, rough.width, rough.clearance)
        machine = plates_of(completed.sizes, request.body)
    check_sizes(machine.lengths, machine.hole, machine.width, f"/{where}".rstrip("/"))
    fixed = [pin.name for pin in machine.pins if pin.grounded]
    for pin in request.arranged.mounts:
        if pin not in fixed:
            raise FieldError.no_such(f"/{where}mounts", pin, fixed, "fixed pin")
    for plate in machine.plates:
        for hole, next_hole in combinations(plate.holes, 2):
            if not abs(hole.at - next_hole.at) > machine.hole:
                holes = f"holes of {machine.hole:.6g} for {hole.pin} and {next_hole.pin}, {abs(hole.at - next_hole.at):.6g} apart,"
                raise FieldError(f"/{where}hole", f"{holes} would run into one another in the {plate.name}")
    return machine


class Reading(NamedTuple):
    """How places of the drive are told."""

    radian: float
    """Radians in the user's unit of angle; 1 for lengths."""
    behind: str
    """The unit in sentences; of a length none."""


def assembled(
    linkage: Linkage,
    request: AskedAssembly,
    used: Interval,
    radian: float,
    work: Work,
    where: str = "assembly/",
) -> Assembly:
    """The assembly of a linkage over an interval of its drive's travel from the first sample, in the user's units.

    ``radian``: radians in the user's unit of angle; the travel of a drive that slides is a length.
    """
    machine = machine_of(linkage, request, used, where)
    unit = Reading(radian, " rad" if radian == 1.0 else " degrees") if machine.turns else Reading(1.0, "")
    with pointing(lambda field: f"/{where}{field.lstrip('/')}"):
        found = arrange(machine, request.arranged, work)
    reasons = _reasons(machine, found, request.arranged, unit)
    if found.status == "blocked" and request.arranged.boards in ("below", "above") and not request.arranged.mounts:
        two_sided = arrange(machine, request.arranged._replace(boards="both"), work)
        if two_sided.status == "free":
            held = ", ".join(f"{pin} {mount}" for pin, mount in two_sided.stack.mounts.items())
            reasons.insert(1, f"with boards on both sides {two_sided.stack.count} layers are free: {held}")
    beyond = outside(machine, request.envelope, request.keep_out, work)
    if beyond:
        # no layer helps
        found = replace(found, status="blocked", collisions=(*beyond, *found.collisions))
        more = [f"and so {len(beyond) - MOST_TOLD} times more"] * (len(beyond) > MOST_TOLD)
        reasons = [*(_beyond(collision, machine, unit) for collision in beyond[:MOST_TOLD]), *more, *reasons]
    return described(machine, request, found, reasons, unit)


def described(
    machine: Machine, request: AskedAssembly, found: Arrangement, reasons: list[str], unit: Reading
) -> Assembly:
    """What was found as a user reads it."""
    settings = request.settings.completed(machine.hole, machine.width, machine.clearance)
    stack, heights = found.stack, Heights.of(machine, settings.thickness, settings.washer)
    names = machine.movement.names
    return Assembly(
        status=found.status,
        count=stack.count,
        layers=stack.layers,
        mounts=stack.mounts,
        least_gap=None
        if found.min_gap is None
        else LeastGap(found.min_gap[1].gap, found.min_gap[0], found.min_gap[1].at / unit.radian),
        stops=Stops(_stop(found.low, unit), _stop(found.high, unit)),
        collisions=[_collision(one, unit) for one in found.collisions],
        touches=[_collision(one, unit) for one in found.touches],
        longest_free=None if found.free is None else (found.free.first / unit.radian, found.free.last / unit.radian),
        pins=[
            HeldPin(name, span, "two" if stack.mounts.get(name) == BOTH else "one")
            for name, span in stack.pins.items()
        ],
        shaft={name: ThroughShaft(one.both_sides, _passing(name, one, unit)) for name, one in found.shaft.items()},
        fewer={str(count): None if one is None else _collision(one, unit) for count, one in found.fewer.items()},
        others=found.alternatives,
        tried=found.tried,
        exhaustive=found.exhaustive,
        sizes=PartSizes(machine.hole, machine.width, machine.clearance, heights.thickness, heights.washer),
        parts=[
            AssemblyPart(
                one.name,
                one.kind,
                names[one.body],
                [(z.real, z.imag) for z in one.shape.core],
                one.shape.radius,
                [Hole((hole.at.real, hole.at.imag), hole.pin) for hole in one.holes],
                one.layers,
                one.z,
                [
                    Slit((slit.first.real, slit.first.imag), (slit.last.real, slit.last.imag), slit.pin)
                    for slit in one.slits
                ],
            )
            for one in parts_of(machine, stack, heights)
        ],
        reasons=reasons,
        machine=machine,
        arrangement=found,
        settings=settings,
        given=request.settings,
        driven_hinge=request.drive if isinstance(request.drive, str) else "",
    )


def _collision(collision: stacks.Collision, unit: Reading) -> Collision:
    return {"pair": list(collision.pair), "from": collision.first / unit.radian, "to": collision.last / unit.radian}


def _stop(stop: stacks.Stop | None, unit: Reading) -> Stop:
    if stop is None:
        return Stop(None, None, None)
    return Stop(stop.at / unit.radian, "loop" if stop.pair is None else "pair", stop.pair)


# -- in words -----------------------------------------------------------------------------------------------------------


def _angle(value: float, unit: Reading) -> str:
    """A place of the drive with its unit."""
    return f"{value / unit.radian:.6g}{unit.behind}"


def _part(name: str, machine: Machine) -> str:
    """A part in a sentence: "the crank", "pin B", "the head of pin A"."""
    if name.startswith("head "):
        return f"the head of pin {name.removeprefix('head ')}"
    return f"the {name}" if any(plate.name == name for plate in machine.plates) else f"pin {name}"


def _both(pair: Sequence[str], machine: Machine) -> str:
    return " and ".join(_part(name, machine) for name in pair)


def _between(collision: stacks.Collision, unit: Reading) -> str:
    return f"from {collision.first / unit.radian:.6g} to {_angle(collision.last, unit)}"


def _beyond(collision: stacks.Collision, machine: Machine, unit: Reading) -> str:
    wall, plate = collision.pair
    what = "leaves the envelope" if wall == ENVELOPE else f"enters {wall.replace('_', '-')}"
    return f"{_part(plate, machine)} {what} {_between(collision, unit)}"


def _passing(pin: str, shaft: stacks.Shaft, unit: Reading) -> str | None:
    if shaft.both_sides:
        return None
    passages = [
        f"the {_other(collision.pair, pin)} passes over {pin} {_between(collision, unit)}"
        for collision in shaft.passes
    ]
    return "; ".join(passages)


def _other(pair: Sequence[str], pin: str) -> str:
    return next(name for name in pair if name != pin)


def _reasons(machine: Machine, found: Arrangement, asked: StackRequest, unit: Reading) -> list[str]:
    stack = found.stack
    slits = {end.pair for end in machine.slit_ends if end is not None}
    by_layer: dict[int, list[str]] = {}
    for plate, layer in stack.layers.items():
        by_layer.setdefault(layer, []).append(plate)
    said = "; ".join(f"layer {layer}: {', '.join(by_layer[layer])}" for layer in sorted(by_layer))
    reasons = []
    if found.status == "blocked":
        if found.exhaustive:
            reasons.append(f"no arrangement of up to {asked.max_layers} layers is free over the used interval")
        else:
            reasons.append(
                f"none of the {found.tried:,} arrangements that were looked at is free over the used interval"
            )
        best = found.free
        part = (
            "is free nowhere"
            if best is None
            else f"is free from {best.first / unit.radian:.6g} to {_angle(best.last, unit)}"
        )
        best_said = "the best" if found.best_known else "the best of those looked at"
        reasons.append(f"{best_said} ({said}) {part}")
        ends = [one for one in (found.low, found.high) if one is not None and one.pair is not None]
        for pair in dict.fromkeys(one.pair for one in ends if one.pair is not None):
            at = " and ".join(_angle(one.at, unit) for one in ends if one.pair == pair)
            reasons.append(f"{_both(pair, machine)} collide at {at}")
        for one in found.collisions if best is None else ():
            reasons.append(f"{_both(one.pair, machine)} collide {_between(one, unit)}")
    else:
        reasons.append(said)
    for one in found.touches:
        reasons.append(
            f"{_both(one.pair, machine)} may just reach the clearance {_between(one, unit)}: that is not decided"
        )
    for count, stops in found.fewer.items():
        if stops is not None:
            layers_said = f"not in {count} layer{'s' if count != 1 else ''}"
            reasons.append(f"{layers_said}: there {_both(stops.pair, machine)} collide {_between(stops, unit)}")
    for name, shaft in found.shaft.items():
        if not shaft.both_sides:
            reasons.append(f"{name} is held from one side: {_passing(name, shaft, unit)}")
    if found.status != "blocked":
        for which, stop in (("lower", found.low), ("upper", found.high)):
            if stop is not None:
                cause = "the loop ends" if stop.pair is None else f"{_both(stop.pair, machine)} collide"
                if stop.pair in slits:
                    cause = f"{_part(stop.pair[0], machine)} is at the end of its slit"
                reasons.append(f"{which} end of the motion at {_angle(stop.at, unit)}: {cause}")
    if any(one.name == "rod" for one in machine.plates):
        reasons.append("crank angles are those of the motor, from the first sample on")
    loop = machine.loop
    if slits and loop is not None and np.isfinite(loop).any():
        told = [
            f"{which} end at {_angle(at, unit)}" for which, at in zip(("lower", "upper"), loop) if np.isfinite(at)
        ]
        reasons.append(f"with longer slits the loop itself would end: {', '.join(told)}")
    reasons.append(NOT_SAID)
    return reasons
