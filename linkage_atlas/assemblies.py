"""Plates and pins in layers: requests, and arrangements in which nothing collides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import Annotated, Any, Literal, NamedTuple, TypedDict

import numpy as np

from linkage_atlas.arguments import (
    Fields,
    box,
    build,
    check_names,
    flag,
    mapping,
    one_of,
    pointing,
    read_fields,
    whole_number,
)
from linkage_atlas.attached_drives import read_attached
from linkage_atlas.notes import counted
from linkage_atlas.part_settings import PART_SETTINGS, PartSettings, PartSizes
from linkage_atlas.records import PYTHON_ONLY, Record, xy
from synthesis.assembly import stacks
from synthesis.assembly.driven_machine import Strut, motor_driven, strut_driven
from synthesis.assembly.keep_out import ENVELOPE, outside
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine, Sizes
from synthesis.assembly.machine import Stop as MotionEnd
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

MOST_CORNERS = 200
"""Maximum number of corners of a body's outline."""
LAYERS_MOST, MOST_LAYERS = 6, 8
"""Default and largest value of `layers_max`."""
MOUNTS = (BELOW, ABOVE, BOTH)
"""Mounts of a fixed pin."""
FIXED_PINS = ("A", "B", "M", "G", "A1", "A2", "B1", "B2")
"""Pins on the ground: of links on circles and of slots, of a motor or a cylinder, and the posts of rails."""
MOST_TOLD = 5
"""Maximum number of collisions with boxes that the reasons name."""
SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Fractions of the default hole, tried in turn."""
NOT_CONSIDERED = "tilt of long pins, play and tolerances of thickness are not included in the clearance"

Status = Annotated[str, Literal["free", "blocked", "touching"]]
Part = Annotated[str, Literal["plate", "pin", "post", "head", "board"]]
Cause = Annotated[str, Literal["pair", "loop"]]
Collision = TypedDict("Collision", {"pair": list[str], "from": float, "to": float})
"""Two parts, and the crank angles between which they collide; over the seam of a whole turn ``to`` lies beyond it."""


class LeastGap(NamedTuple):
    """Smallest gap between two parts of the same layer."""

    value: float
    """Distance of their outlines minus the clearance."""
    pair: tuple[str, str]
    crank_angle: float


class Stop(NamedTuple):
    """End of the motion; all fields are null if nothing ends it."""

    crank_angle: float | None
    cause: Annotated[str | None, Cause | None]
    """`pair`: two parts collide; `loop`: the loop opens."""
    pair: tuple[str, str] | None
    """The parts that collide there."""


class Stops(NamedTuple):
    """Ends of the motion on both sides of the used interval; if it is blocked, of its longest free part."""

    low: Stop
    high: Stop


class HeldPin(NamedTuple):
    """Pin, or post within a single link."""

    name: str
    layers: tuple[int, int]
    """Lowest and highest layer that it fills; 0 is the board below, and `count` + 1 the board above."""
    sides: Annotated[str, Literal["one", "two"]]
    """Number of sides on which it is held."""


class ThroughShaft(NamedTuple):
    """Support of a fixed pivot."""

    both_sides: bool
    blocking_parts: str | None
    """Parts that pass over the pivot; null if it can be held from both sides."""


class Slit(NamedTuple):
    """Slit along which a pin slides, between the ends that the middle of the pin reaches."""

    first: tuple[float, float]
    last: tuple[float, float]
    pin: str


class Hole(NamedTuple):
    """Hole for a pin or post."""

    centre: tuple[float, float]
    pin: str


@dataclass(frozen=True)
class AssemblyPart(Record):
    """Part that fills everything within a radius of a core, between two heights, in the frame of its link."""

    name: str
    """crank, coupler, rocker, rail, motor_crank, rod, body, bar; pin_D, post_P, head_D_below, board_below."""
    kind: Part
    link: str
    """Link whose frame is used: its origin is the first joint, and x points to the second one (crank A to D, coupler D to C,
    rocker B to C). The frame of the ground lies in A and has the axes of the request; the frame of a body on guides lies in D, or
    in the point of its slot, and has the axes of the body."""
    core: list[tuple[float, float]]
    """Point, ends of a line, or corners of a polygon, counter-clockwise."""
    radius: float
    holes: list[Hole]
    layers: tuple[int, int]
    """Lowest and highest layer that it fills."""
    z: tuple[float, float]
    """Heights of the lower and upper face; layer 1 begins at 0."""
    slits: list[Slit]
    """Slits of rails, and of a body with a slot; as wide as a hole."""


@dataclass(frozen=True)
class Assembly(Record):
    """Layers of a linkage's plates, and their collisions over the used interval, which are proved and not sampled.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.FourBar(30, 60, 70, 50).assembly(hole=6, width=18).status
    'free'
    """

    status: Status
    """free: no gap is below the clearance; touching: a gap may just reach it; blocked: no layers are free."""
    count: int
    """Number of layers."""
    layers: dict[str, int]
    """Layer of each plate, from 1; if blocked, the layers that are free over the longest part of the motion."""
    mounts: dict[str, str]
    """Mount of each fixed pin: below, above or below+above; empty with a bar."""
    smallest_gap: LeastGap | None
    """Smallest gap of parts that share a layer; null if no parts do, or if blocked."""
    stops: Stops
    collisions: list[Collision]
    """Collisions in these layers; empty if they are free.

    They include collisions of plates with "envelope" and "keep_out 1", for which no layers help.
    """
    touches: list[Collision]
    """Intervals in which parts may just touch."""
    longest_free: tuple[float, float] | None
    """If blocked, the longest part of the used interval without a collision; null if there is no such part."""
    pins: list[HeldPin]
    pivot_supports: dict[str, ThroughShaft]
    """Support of each fixed pivot."""
    fewer_layers: dict[str, Collision | None]
    """For each smaller number of layers the collision that stops the best arrangement.

    It is null if plates on a pin need more layers.
    """
    other_arrangements: int
    """Number of further free arrangements with the same number of layers."""
    arrangements_examined: int
    """Number of arrangements that were examined; arrangements with the same collision in common count once."""
    exhaustive: bool
    """True if all arrangements of this number of layers were examined, or if blocked of up to `layers_max`."""
    sizes: PartSizes
    parts: list[AssemblyPart] = field(repr=False)
    reasons: list[str]
    """Sentences."""
    machine: Machine = field(metadata=PYTHON_ONLY, repr=False)
    """Plates and pins in radians."""
    arrangement: Arrangement = field(metadata=PYTHON_ONLY, repr=False)
    """The arrangement in radians."""
    settings: PartSettings = field(metadata=PYTHON_ONLY, repr=False)
    """The sizes of the request."""
    driven_hinge: str = field(default="", metadata=PYTHON_ONLY, repr=False)
    """Name of the link with a drive in its hinge; empty without such a drive."""

    @property
    def free(self) -> bool:
        """True if nothing collides."""
        return self.status == "free"


class AskedAssembly(NamedTuple):
    """Checked request for an assembly."""

    settings: PartSettings
    arranged: StackRequest
    body: tuple[complex, ...] = ()
    envelope: Box | None = None
    keep_out: tuple[Box, ...] = ()
    drive: Motor | Strut | str | None = None
    """Motor with its rod, or cylinder; for a drive in a hinge the name of its link."""

    def within(self, envelope: Box | None, keep_out: Sequence[Box]) -> AskedAssembly:
        """Return the request with the boxes of the limits, if it has no boxes of its own."""
        own = envelope if self.envelope is None else self.envelope
        return self._replace(envelope=own, keep_out=self.keep_out or tuple(keep_out))


def read_assembly(request: Fields | Literal[True], where: str = "assembly/") -> AskedAssembly:
    """Check a request for an assembly: a mapping with some of `ASSEMBLY`, or True for the defaults.

    ``where``: path of the fields in error messages.
    """
    read = read_fields(where, {} if request is True else request, ASSEMBLY)
    settings = PartSettings(**{name: read.pop(name) for name in PART_SETTINGS if name in read})
    boards, heads, layers_max = read.pop("boards", BELOW), read.pop("pin_heads", False), read.pop("layers_max", None)
    mounts = _mounts(f"{where}mounts", read.pop("mounts", {}), boards)
    return AskedAssembly(settings, StackRequest(boards, heads, layers_max or LAYERS_MOST, mounts), **read)


def _arranged_drive(name: str, drive: object) -> Motor | Strut | str:
    """Read a drive of a reply, whose parts are arranged with the linkage; for a drive in a hinge return its link."""
    found = read_attached(name, drive)
    if found.kind == "rotary":
        return found.link
    if found.kind == "dyad":
        return Motor(found.link, found.ground, *found.sizes, found.pin)
    return Strut(found.link, found.on, found.pin, found.ground, found.sizes)


def _mounts(name: str, value: Fields, boards: str) -> dict[str, str]:
    """Return the required mounts of fixed pins, which the boards must allow."""
    if value and boards == "bar":
        raise FieldError(f"/{name}", "has no effect with a bar, which holds its pins itself; remove this field")
    allowed = {"below": MOUNTS[:1], "above": MOUNTS[1:2], "both": MOUNTS}[boards] if value else ()
    check_names(f"/{name}", value, FIXED_PINS, "fixed pin")
    for pin, mount in value.items():
        if mount not in allowed:
            raise FieldError(
                f"/{name}/{pin}", f"must be {' or '.join(allowed)} with boards {boards}; it is {mount!r}"
            )
    return build(dict, value)


def _outline(name: str, value: object) -> tuple[complex, ...]:
    """Return the corners of a body's outline, counter-clockwise."""
    try:
        points = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        points = np.zeros(0)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise FieldError(f"/{name}", "must be corners [x, y] with finite numbers")
    if np.abs(points).max(initial=0.0) > MAX_LENGTH:
        raise FieldError(f"/{name}", f"must have corners within {MAX_LENGTH:g} of the body point")
    corners = [complex(*point) for point in points]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if not 3 <= len(corners) <= MOST_CORNERS:
        raise FieldError(f"/{name}", f"must have 3 to {MOST_CORNERS} corners; it has {len(corners)}")
    if crosses_itself(corners):
        raise FieldError(f"/{name}", "has an outline that crosses or touches itself; give a simple outline")
    return tuple(corners if signed_area(corners) > 0 else corners[::-1])


ASSEMBLY: dict[str, Callable[[str, Any], Any]] = {
    **PART_SETTINGS,
    "boards": partial(one_of, known=BOARDS),
    "pin_heads": flag,
    "body": _outline,
    "mounts": mapping,
    "layers_max": partial(whole_number, minimum=1, maximum=MOST_LAYERS),
    "envelope": box,
    "keep_out": lambda field, boxes: tuple(box(f"{field}/{k}", corners) for k, corners in enumerate(boxes)),
    "drive": _arranged_drive,
}
"""Fields of a request for an assembly, with the functions that check them."""


def machine_of(linkage: Linkage, request: AskedAssembly, used: Interval, where: str = "assembly/") -> Machine:
    """Return plates and pins of a linkage with the requested sizes, and with standard sizes by default.

    If the default hole leaves no material, the largest of its `SHARES` that leaves some is used. Raises `FieldError` if all of
    them leave none.
    """
    if request.body and not linkage.mounted:
        raise FieldError(f"/{where}body", "needs `position`, which fixes the position of the body")
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
        machine = plates_of(Sizes(*completed[:3]), request.body)
    check_sizes(machine.lengths, machine.hole, machine.width, f"/{where}".rstrip("/"))
    fixed = [pin.name for pin in machine.pins if pin.grounded]
    for pin in request.arranged.mounts:
        if pin not in fixed:
            raise FieldError.no_such(f"/{where}mounts", pin, fixed, "fixed pin")
    for plate in machine.plates:
        for hole, next_hole in combinations([hole for hole in plate.holes if len(hole.core) == 1], 2):
            distance = abs(hole.core[0] - next_hole.core[0])
            if not distance > machine.hole:
                holes = f"holes of {machine.hole:.6g} for {hole.pin} and {next_hole.pin}, {distance:.6g} apart,"
                raise FieldError(f"/{where}hole", f"{holes} would overlap in the {plate.name}")
    return machine


def assembled(
    linkage: Linkage, request: AskedAssembly, used: Interval, radian: float, work: Work, where: str = "assembly/"
) -> Assembly:
    """Arrange the plates of a linkage over an interval of its drive's travel from the first sample, in the user's units.

    ``radian``: radians in the user's unit of angle; the travel of a sliding drive is a length.
    """
    machine = machine_of(linkage, request, used, where)
    turning = (radian, " rad" if radian == 1.0 else " degrees")
    words = _Words(machine, request.arranged, *(turning if machine.turns else (1.0, "")))
    with pointing(lambda field: f"/{where}{field.lstrip('/')}"):
        found = arrange(machine, request.arranged, work)
    reasons = words.reasons(found)
    if found.status == "blocked" and request.arranged.boards in ("below", "above") and not request.arranged.mounts:
        two_sided = arrange(machine, request.arranged._replace(boards="both"), work)
        if two_sided.status == "free":
            held = ", ".join(f"{pin} {mount}" for pin, mount in two_sided.stack.mounts.items())
            reasons.insert(1, f"with boards on both sides {two_sided.stack.count} layers are free: {held}")
    beyond = outside(machine, request.envelope, request.keep_out, work)
    if beyond:
        # these collisions do not depend on the layers
        found = replace(found, status="blocked", collisions=(*beyond, *found.collisions))
        others = len(beyond) - MOST_TOLD
        more = [f"and {counted(others, 'further violation')} of the envelope or keep-out boxes"] if others > 0 else []
        reasons = [*map(words.beyond, beyond[:MOST_TOLD]), *more, *reasons]
    return _described(request, found, reasons, words)


def _described(request: AskedAssembly, found: Arrangement, reasons: list[str], words: _Words) -> Assembly:
    """Describe an arrangement in the units of the user."""
    machine, radian, stack = words.machine, words.radian, found.stack
    sizes = request.settings.completed(machine.hole, machine.width, machine.clearance)
    parts = parts_of(machine, stack, Heights(sizes.thickness, sizes.washer))

    def collision(collision: stacks.Collision) -> Collision:
        return {"pair": list(collision.pair), "from": collision.first / radian, "to": collision.last / radian}

    def end(stop: MotionEnd | None) -> Stop:
        if stop is None:
            return Stop(None, None, None)
        return Stop(stop.at / radian, "loop" if stop.pair is None else "pair", stop.pair)

    return Assembly(
        status=found.status,
        count=stack.count,
        layers=stack.layers,
        mounts=stack.mounts,
        smallest_gap=None
        if found.min_gap is None
        else LeastGap(found.min_gap[1].gap, found.min_gap[0], found.min_gap[1].at / radian),
        stops=Stops(end(found.low), end(found.high)),
        collisions=[*map(collision, found.collisions)],
        touches=[*map(collision, found.touches)],
        longest_free=None if found.free is None else (found.free.first / radian, found.free.last / radian),
        pins=[
            HeldPin(name, span, "two" if stack.mounts.get(name) == BOTH else "one")
            for name, span in stack.pins.items()
        ],
        pivot_supports={
            name: ThroughShaft(not passes, words.passing(name, passes)) for name, passes in found.passes.items()
        },
        fewer_layers={str(count): None if stop is None else collision(stop) for count, stop in found.fewer.items()},
        other_arrangements=found.alternatives,
        arrangements_examined=found.tried,
        exhaustive=found.exhaustive,
        sizes=sizes._replace(hole=machine.hole, width=machine.width),
        parts=[
            AssemblyPart(
                part.name,
                part.kind,
                machine.movement.names[part.body],
                [xy(z) for z in part.shape.core],
                part.shape.radius,
                [Hole(xy(hole.core[0]), hole.pin) for hole in part.holes if len(hole.core) == 1],
                part.layers,
                part.z,
                [Slit(xy(hole.core[0]), xy(hole.core[1]), hole.pin) for hole in part.holes if len(hole.core) > 1],
            )
            for part in parts
        ],
        reasons=reasons,
        machine=machine,
        arrangement=found,
        settings=request.settings,
        driven_hinge=request.drive if isinstance(request.drive, str) else "",
    )


class _Words(NamedTuple):
    """Sentences about the layers of a machine."""

    machine: Machine
    request: StackRequest
    radian: float
    """Radians in the user's unit of angle; 1 for lengths."""
    behind: str
    """Unit of the drive's coordinate in sentences; empty for lengths."""

    def at(self, value: float) -> str:
        """Return a coordinate of the drive with its unit."""
        return f"{value / self.radian:.6g}{self.behind}"

    def part(self, name: str) -> str:
        """Return the name of a part in a sentence: "the crank", "pin B", "the head of pin A"."""
        if name.startswith("head "):
            return f"the head of pin {name.removeprefix('head ')}"
        return f"the {name}" if any(plate.name == name for plate in self.machine.plates) else f"pin {name}"

    def both(self, pair: Sequence[str]) -> str:
        return " and ".join(map(self.part, pair))

    def between(self, first: float, last: float) -> str:
        return f"from {first / self.radian:.6g} to {self.at(last)}"

    def collide(self, collision: stacks.Collision) -> str:
        return f"{self.both(collision.pair)} collide {self.between(*collision[1:])}"

    def beyond(self, collision: stacks.Collision) -> str:
        wall, plate = collision.pair
        what = "leaves the envelope" if wall == ENVELOPE else f"enters {wall.replace('_', '-')}"
        return f"{self.part(plate)} {what} {self.between(*collision[1:])}"

    def passing(self, pin: str, passes: Sequence[stacks.Collision]) -> str | None:
        """Return which parts pass over a pivot; None if it can be held from both sides."""
        passages = [
            f"the {name} passes over {pin} {self.between(first, last)}"
            for pair, first, last in passes
            for name in pair
            if name != pin
        ]
        return "; ".join(passages) or None

    def reasons(self, found: Arrangement) -> list[str]:
        """Return what was found, why there are not fewer layers, and what ends the motion."""
        layers = sorted(set(found.stack.layers.values()))
        plates = [", ".join(name for name, own in found.stack.layers.items() if own == layer) for layer in layers]
        said = "; ".join(f"layer {layer}: {names}" for layer, names in zip(layers, plates))
        reasons = self._blocked(found, said) if found.status == "blocked" else [said]
        for touch in found.touches:
            where = f"{self.both(touch.pair)} come near the clearance {self.between(*touch[1:])}"
            reasons.append(f"{where}: the computation cannot decide on which side")
        for count, stops in found.fewer.items():
            if stops is not None:
                reasons.append(f"not in {counted(count, 'layer')}: there {self.collide(stops)}")
        for name, passes in found.passes.items():
            if passes:
                reasons.append(f"{name} is held from one side: {self.passing(name, passes)}")
        slits = {end.pair for end in self.machine.slit_ends if end is not None}
        if found.status != "blocked":
            for which, stop in (("lower", found.low), ("upper", found.high)):
                if stop is not None:
                    cause = "the loop ends" if stop.pair is None else f"{self.both(stop.pair)} collide"
                    if stop.pair is not None and stop.pair in slits:
                        cause = f"{self.part(stop.pair[0])} is at the end of its slit"
                    reasons.append(f"{which} end of the motion at {self.at(stop.at)}: {cause}")
        if any(plate.name == "rod" for plate in self.machine.plates):
            reasons.append("crank angles are angles of the motor from the first sample")
        loop = self.machine.loop
        if slits and loop is not None and np.isfinite(loop).any():
            ends = [f"{end} end at {self.at(at)}" for end, at in zip(("lower", "upper"), loop) if np.isfinite(at)]
            reasons.append(f"with longer slits the loop itself would end: {', '.join(ends)}")
        return [*reasons, NOT_CONSIDERED]

    def _blocked(self, found: Arrangement, said: str) -> list[str]:
        if found.exhaustive:
            searched = f"no arrangement of up to {self.request.max_layers} layers is free over the used interval"
        else:
            searched = f"none of the {found.tried:,} examined arrangements is free over the used interval"
        part = "has a collision at every position" if found.free is None else f"is free {self.between(*found.free)}"
        best = "the best" if found.best_known else "the best of the examined arrangements"
        reasons = [searched, f"{best} ({said}) {part}"]
        ends = [end for end in (found.low, found.high) if end is not None and end.pair is not None]
        for parts in dict.fromkeys(end.pair for end in ends if end.pair is not None):
            at = " and ".join(self.at(end.at) for end in ends if end.pair == parts)
            reasons.append(f"{self.both(parts)} collide at {at}")
        return reasons + ([*map(self.collide, found.collisions)] if found.free is None else [])
