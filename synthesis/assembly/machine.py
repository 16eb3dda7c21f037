"""What a mechanism is built of: plates and pins with their sizes, the bodies that carry them, and how far they move.

Rails and slots are plates with a slit; a motor that turns on, and its rod, are two more plates.

Of a body on two guides, with Z the driven guide's pin, X the point that the other guide holds, and e the most that Z moves over
a cell (half its width for a slider; for a crank the radius times that), the body turns by at most

=================  ======================================================================================================
other guide        how far it turns
=================  ======================================================================================================
circle             as in a dyad: asin(e / D) + |phi(D +- e) - phi(D)|, D = |C - Z|, phi the angle at Z
rail               |asin((o +- e) / L) - asin(o / L)|, o the distance of Z from the rail, L = |X - Z|
slot               asin(e / D) + |asin(h / (D +- e)) - asin(h / D)|, D = |pin - Z|, h the distance of Z from the slot
=================  ======================================================================================================

A cylinder changes the body point that lies on Z instead, so that D and L change places. A hinge turns the body as it turns
itself; what is enclosed is how far the body slides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats
from synthesis.assembly.gaps import Shape, hull, nearest_on, nearest_room
from synthesis.assembly.movement import GROUND, Aimed, Between, Bodies, Crank, Dyad, Movement, Place, Step, turn_over
from synthesis.assembly.sizes import plate_sizes
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor, SixBar
from synthesis.errors import FieldError
from synthesis.excursions import Circuits, RoundCircuit
from synthesis.fourbar.joints import joints_at
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import BODY, Linkage
from synthesis.one_variable import bisect
from synthesis.target import TURN, Interval

CLEARANCE = 0.5 / 165
"""The default clearance, as a part of the longest link."""
WHOLE = 1e-9
"""Radians by which an interval may fall short of a turn and still be one."""
_FAR, _PLACES = 64, 360
"""Times the used way, or places of it, that are looked at beyond it for where a slide ends."""
_TOUCHES = 1e-12
"""Of the size, within which a pin at the end of its slit is still in it."""
_PINS = (("A", "D"), ("B", "C"))
"""Of each guide: its fixed pin, in a slot, and its moving one, on a rail."""
_ROUNDING = 1e-13
"""Of the way: places of the drive are found to far less."""


class Hole(NamedTuple):
    """A hole of a plate, in the plate's frame, and the pin or post that it is for."""

    at: complex
    pin: str


class Slit(NamedTuple):
    """A slit of a plate along which a pin slides, of the pin's width, between the two ends that the pin's middle reaches."""

    first: complex
    last: complex
    pin: str

    def distance(self, point: complex) -> float:
        """Of a point from the line between its ends."""
        return abs(nearest_on((self.first, self.last), point) - point)


class SlitEnd(NamedTuple):
    """A place of the drive beyond which a pin would leave its slit; ``pair``: pin and plate."""

    at: float
    pair: tuple[str, str]


@dataclass(frozen=True)
class Plate:
    """A flat part in one layer; ``shape``, ``holes`` and ``slits`` in the frame of the body that carries it."""

    name: str
    body: int
    shape: Shape
    holes: tuple[Hole, ...]
    slits: tuple[Slit, ...] = ()


@dataclass(frozen=True)
class Pin:
    """A pin, or a post within one body, that joins plates; ``places``: the same point on each body that it belongs to."""

    name: str
    places: tuple[Place, ...]
    radius: float
    joins: tuple[str, ...]
    post: bool = False
    """Whether it joins plates of one body, and turns in none."""

    @property
    def grounded(self) -> bool:
        """Whether it stands in the ground."""
        return self.places[0].body == GROUND


class Sizes(NamedTuple):
    """Sizes of the parts in the unit of the lengths; None: the default."""

    hole: float | None = None
    """Diameter of pins and their holes."""
    width: float | None = None
    """Of the plates: they reach half of it around their holes."""
    clearance: float | None = None
    """Least gap of parts that pass one another."""
    share: float = 1.0
    """Of the default hole that is taken."""


@dataclass(frozen=True)
class Machine:
    """A mechanism with its parts, over an interval of crank angles in radians from the first sample.

    ``origin``: where the ground's frame stands in the user's plane, whose axes it has. ``loop``: crank angles between which the
    loop closes; None where the crank turns fully. ``size``: its longest link. ``lengths``: of its links,
    which holes must be smaller than.
    """

    movement: Movement
    plates: tuple[Plate, ...]
    pins: tuple[Pin, ...]
    used: Interval
    loop: Interval | None
    hole: float
    width: float
    clearance: float
    size: float
    lengths: tuple[float, ...]
    origin: complex = 0j
    turns: bool = True
    """Whether the drive turns; otherwise its travel is a length in the unit of the linkage."""
    body_at: complex = 0j
    """In the coupler's frame, where that frame begins in which an analysis has the coupler's masses."""
    slit_ends: tuple[SlitEnd | None, SlitEnd | None] = (None, None)
    """Below and above the interval; None where no slit ends the motion before the loop does."""
    telescopes: tuple[tuple[str, str], ...] = ()
    """Pairs of plates that slide inside each other: both lie in the same layer and do not collide."""

    @property
    def whole_turn(self) -> bool:
        """Whether the interval is a turn, whose end is its beginning."""
        return self.turns and self.loop is None and self.used.last - self.used.first >= TURN - WHOLE

    def plate(self, name: str) -> Plate:
        """A plate by name."""
        return next(one for one in self.plates if one.name == name)


# -- linkages ----------------------------------------------------------------------------------------------------------


def as_plates(
    linkage: Linkage, used: Interval, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """A linkage as plates and pins, over an interval of travel from the first sample.

    The body's plate coupler holds pins D and C of the first and the second guide, and the body point P. On a circle a link turns
    about A or B; a rail is a plate of the ground on posts A1, A2 or B1, B2, with a slit for the pin; a slot is a slit in the
    coupler for the fixed pin A or B. Slits are as long as the interval needs. A four-bar is a body on two circles whose frame
    lies along its coupler.

    ``body``: corners of a plate that the coupler carries, counter-clockwise, from P in axes that turn with the coupler and lie as
    the user's do where the body's rotation is 0; a post joins it, at P if there is room. ``bar``: the ground is a plate too.

    Raises `FieldError`: for a loop that does not close over the interval, and a body without room for its post.
    """
    first, last = min(used), max(used)
    four_bar, guided = linkage.is_four_bar, linkage.by_coupler
    loop = loop_of(linkage, Interval(first, last))
    spans = {
        place: guided.used(place, Interval(first, last))
        for place, one in enumerate(guided.guides)
        if not isinstance(one, Circle)
    }
    driven, other = guided.guides
    origin = driven[0]
    local = guided.moved(0.0, -origin)
    arm = abs(other.body_point - driven.body_point)
    if four_bar:
        lengths = [*linkage.links]
        point = linkage.arm if linkage.mounted else None
        turn = body_turn(linkage)
        names = ["ground", "crank", BODY, "rocker"]
    else:
        lengths = [length for length in guided.lengths.values() if length > 0]
        lengths += [abs(high - low) for low, high in spans.values() if high > low]
        point, turn = -driven.body_point, 0.0
        names = ["ground", BODY, *(name for name, one in guided.named_guides if isinstance(one, Circle))]
    hole, width = plate_sizes(lengths, sizes.hole, sizes.width, sizes.share)
    size = max([*lengths, arm])
    carrier = names.index(BODY)
    plates: list[Plate] = []
    pins: list[Pin] = []
    steps: list[Step] = [] if four_bar else [OnGuides(local, carrier)]
    corners, holes, slits = [] if point is None else [point], [], []
    for place, (link, one) in enumerate(local.named_guides):
        fixed, moving = _PINS[place]
        at = one.body_point - driven.body_point
        if isinstance(one, Circle):
            number = names.index(link)
            pivot, end = Place(GROUND, one.pivot), complex(one.radius)
            if place == 0:
                steps.append(Crank(number, pivot, guided.start + guided.ground_angle))
            elif four_bar:
                pin = Place(names.index("crank"), complex(lengths[0]))
                steps.append(Dyad(carrier, number, pin, pivot, abs(at), one.radius, guided.branch))
            else:
                steps.append(Between(number, pivot, Place(carrier, at), one.radius))
            plates.append(Plate(link, number, Shape((0j, end), width / 2), (Hole(0j, fixed), Hole(end, moving))))
            pins.append(Pin(fixed, (pivot, Place(number, 0j)), hole / 2, (link,)))
            ends = Place(number, end), Place(carrier, at)
            pins.append(Pin(moving, ends[::-1] if four_bar and place else ends, hole / 2, (link, BODY)))
        elif isinstance(one, Rail):
            name = "rail" if "rail" not in [plate.name for plate in plates] else "second_rail"
            along = complex(np.exp(1j * one.direction))
            low, high = (one.point + along * value for value in spans[place])
            posts = low - 2 * hole * along, high + 2 * hole * along
            plates.append(
                Plate(
                    name,
                    GROUND,
                    Shape(posts, width / 2),
                    (Hole(posts[0], f"{fixed}1"), Hole(posts[1], f"{fixed}2")),
                    (Slit(low, high, moving),),
                )
            )
            pins += [
                Pin(f"{fixed}{k + 1}", (Place(GROUND, post),), hole / 2, (name,)) for k, post in enumerate(posts)
            ]
            pins.append(Pin(moving, (Place(carrier, at),), hole / 2, (BODY, name)))
        else:
            along = complex(np.exp(1j * one.body_direction))
            low, high = (at + along * value for value in spans[place])
            slits.append(Slit(low, high, fixed))
            corners += [low, high]
            pins.append(Pin(fixed, (Place(GROUND, one.pin),), hole / 2, (BODY,)))
            continue
        corners.append(at)
        holes.append(Hole(at, moving))
    if four_bar:
        pins.sort(key=lambda pin: not pin.grounded)
    if point is not None:
        kept = [*((at, at) for at, _ in holes), *((one.first, one.last) for one in slits)]
        sash, post = carried_by(body, point, turn, kept, hole, width)
        if sash:
            corners.append(post)
            plates.append(Plate("body", carrier, Shape(sash, 0.0), (Hole(post, "P"),)))
            pins.append(Pin("P", (Place(carrier, post),), hole / 2, (BODY, "body"), True))
        # a hole that would run into another one is left out
        if all(abs(post - at) > hole for at, _ in holes) and all(one.distance(post) > hole for one in slits):
            holes.append(Hole(post, "P"))
    plates.insert(1, Plate(BODY, carrier, Shape(hull(corners), width / 2), tuple(holes), tuple(slits)))
    if bar:
        fixed_at = {pin.name: pin.places[0].at for pin in pins if pin.grounded}
        core = tuple(fixed_at.values()) if four_bar else hull([*fixed_at.values()])
        bores = tuple(Hole(at, name) for name, at in fixed_at.items())
        plates.append(Plate("bar", GROUND, Shape(core, width / 2), bores))
        pins = [replace(pin, joins=(*pin.joins, "bar")) if pin.grounded else pin for pin in pins]
    whole = guided.driver.turns and loop is None and last - first >= TURN
    ends_of_slits: list[SlitEnd | None] = []
    for begin, far in ((first, last - TURN), (last, first + TURN)):
        reach = far if loop is None else loop[len(ends_of_slits)]
        if not np.isfinite(reach):  # a slide of its own drives it there
            reach = begin + np.sign(reach) * (last - first)
        left = _slit_end(guided, begin, float(reach), spans, size)
        if left is None:
            ends_of_slits.append(None)
            continue
        at, guide = left
        pair = next((slit.pin, one.name) for one in plates for slit in one.slits if slit.pin in _PINS[guide])
        ends_of_slits.append(SlitEnd(at, pair))
    return Machine(
        Movement(names, steps),
        tuple(plates),
        tuple(pins),
        Interval(first, first + TURN if whole else last),
        loop,
        hole,
        width,
        CLEARANCE * size if sizes.clearance is None else sizes.clearance,
        size,
        tuple(lengths),
        origin,
        guided.driver.turns,
        0j if four_bar else -driven.body_point,
        (None, None) if whole else (ends_of_slits[0], ends_of_slits[1]),
    )


def loop_of(linkage: Linkage, used: Interval) -> Interval | None:
    """Travel over which the loop closes about that used; None where the drive turns fully.

    Infinite where a slide drives it and the loop goes on for `_FAR` times the used way. Raises `FieldError`: where it does not
    close over all that is used.
    """
    if linkage.is_four_bar:
        return _loop_of_four_bar(linkage, used)
    first, last = used
    if not linkage.closes_over(used.after(linkage.start)):
        raise FieldError("/solution/guides", "the loop does not close over the whole used interval")
    if linkage.turns_fully:
        return None
    most = TURN if linkage.driver.turns else _FAR * (last - first)

    def end(begin: float, way: float) -> float:
        # what is known to close, and what is not: doubled until it does not, then halved
        closes, far = 0.0, last - first if last > first else most
        while far < most and _closes(linkage, begin, way * far):
            closes, far = far, min(2 * far, most)
        if _closes(linkage, begin, way * far):
            return way * np.inf

        def holds(by: NDArray[np.floating]) -> Flags:
            return np.array([_closes(linkage, begin, way * float(by[0]))])

        inside, _ = bisect(holds, np.array([closes]), np.array([far]))
        return begin + way * float(inside[0])

    return Interval(end(first, -1.0), end(last, 1.0))


def _loop_of_four_bar(linkage: Linkage, used: Interval) -> Interval | None:
    """The same, from its circuit."""
    lengths = np.array([linkage.links])
    circuits = Circuits.of(lengths)
    if circuits.turns.item():
        return None
    middle = linkage.start + (used.first + used.last) / 2
    circuit, _ = RoundCircuit.through(lengths, np.array([[middle]]), np.array([[float(linkage.branch)]]))
    low, width = circuit.low.item(), circuit.width.item()
    turns = TURN * np.floor((middle - low) / TURN)
    first = low + turns - linkage.start
    slack = 1e-9
    if used.first < first - slack or used.last > first + width + slack:
        fault = used.first if used.first < first - slack else used.last
        raise FieldError(
            "/solution/links", f"the four links do not close {np.rad2deg(fault):.6g} degrees after the start"
        )
    return Interval(min(first, used.first), max(first + width, used.last))


def _closes(linkage: Linkage, begin: float, by: float) -> bool:
    ends = sorted((linkage.start + begin, linkage.start + begin + by))
    return linkage.closes_over(Interval(*ends))


def _slit_end(
    linkage: Linkage, begin: float, end: float, spans: Mapping[int, tuple[float, float]], size: float
) -> tuple[float, int] | None:
    """Where between two places of the drive a slide first leaves what is used of it, and which; None where none does.

    ``spans``: of each guide that is a rail or a slot. It is found between steps of at most a degree, or of a 360th of the way.
    """
    found: tuple[float, int] | None = None
    steps = int(np.ceil(abs(end - begin) / np.deg2rad(1.0))) if linkage.driver.turns else _PLACES
    places = np.linspace(begin, end, max(steps, 2) + 1)

    def beyond(guide: int, at: NDArray[np.floating]) -> Floats:
        low, high = spans[guide]
        along = linkage.along(guide, at)
        # at the loop's end itself a place may not be known
        return np.nan_to_num(np.maximum(along - high, low - along), nan=-np.inf) - _TOUCHES * size

    for guide in spans:
        out = np.flatnonzero(beyond(guide, places) > 0)
        if out.size:
            inside = begin
            if out[0]:
                ends = bisect(lambda at, guide=guide: beyond(guide, at) <= 0, places[out[:1] - 1], places[out[:1]])  # type: ignore[misc]
                inside = float(ends[0][0])
            if abs(inside - begin) < 1e-9 * max(1.0, abs(end - begin)):
                inside = begin
            if found is None or abs(inside - begin) < abs(found[0] - begin):
                found = inside, guide
    return found


def carried_by(
    body: Sequence[complex],
    point: complex,
    turn: float,
    kept: Sequence[tuple[complex, complex]],
    hole: float,
    width: float,
) -> tuple[tuple[complex, ...], complex]:
    """A body's outline in the frame of the link that carries it, and where its post stands: at the body point, or near it.

    Around its hole the outline, and the link's other holes and slits, which are ``kept``, leave as much as a plate of the width
    does, or where they cannot a half or a quarter of that. ``point``, ``turn``: the body's frame in the link's. Without an
    outline the post's place is the body point.
    """
    corners = tuple(complex(point + np.exp(1j * turn) * z) for z in body)
    if not corners:
        return corners, point
    for share in (1.0, 0.5, 0.25):
        rim = share * (width - hole) / 2
        post = nearest_room(corners, kept, hole / 2 + rim, hole + rim, point)
        if post is not None:
            return corners, post
    raise FieldError("/body", f"leaves no room for a post with a hole of {hole:g} that joins it to the coupler")


def body_turn(linkage: Linkage) -> float:
    """Angle of the body's axes in the coupler's frame; where no rotation is known they lie as the user's at the first sample."""
    if linkage.body_offset is not None:
        return linkage.body_offset
    return -float(joints_at(linkage, np.zeros(1)).coupler_angle[0])


# -- a body on guides over a cell ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OnGuides:
    """The body of a linkage; its frame has the body's directions and begins at the driven guide's body point."""

    linkage: Linkage
    body: int = 1

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Poses are those of `Linkage.body`."""
        one = self.linkage
        driven = one.guides[0]
        q = one.start + travel
        found = one.body(q)
        direction = np.exp(1j * found.rotation)
        bodies.direction[self.body] = direction
        bodies.origin[self.body] = found.position + direction * driven.body_point
        if one.driver is Driver.HINGE:
            turn, shift = half, self._slides(q, half)
        else:
            turn = self._turns(q, half)
            if isinstance(driven, Circle):
                shift = driven.radius * np.minimum(2.0, half)
            elif isinstance(driven, Rail):
                shift = half
            else:
                shift = half + (np.abs(q) + half) * np.minimum(2.0, turn)
        bodies.shift[self.body], bodies.turn[self.body] = shift, turn

    def _turns(self, q: Floats, half: Floats) -> Floats:
        """With the drive's pin Z known."""
        one = self.linkage
        driven, other = one.guides
        slides = isinstance(driven, Slot)
        e = half if not isinstance(driven, Circle) else driven.radius * np.minimum(2.0, half)
        if isinstance(driven, Circle):
            z = driven.pivot + driven.radius * np.exp(1j * q)
        elif isinstance(driven, Rail):
            z = driven.point + q * np.exp(1j * driven.direction)
        else:
            z = np.full(q.shape, driven.pin)
        on_body = np.full(q.shape, driven.body_point)
        if isinstance(driven, Slot):
            on_body = on_body + q * np.exp(1j * driven.body_direction)
        arm = other.body_point - on_body
        # what varies over the cell, by at most e, and what does not
        if isinstance(other, Circle):
            spread = np.abs(other.pivot - z)
            varies, still = (np.abs(arm), spread) if slides else (spread, np.abs(arm))
            return turn_over(float(still.flat[0]), other.radius, varies, e)
        if isinstance(other, Rail):
            beside = np.imag((z - other.point) * np.exp(-1j * other.direction))
            length = np.abs(arm)
            return _by_length(beside, length, e) if slides else _by_offset(beside, length, e)
        offset = np.imag(arm * np.exp(-1j * other.body_direction))
        length = np.abs(other.pin - z)
        return _by_offset(offset, length, e) if slides else _by_length(offset, length, e)

    def _slides(self, q: Floats, half: Floats) -> Floats:
        """With a hinge: how far the driven guide's body point moves."""
        one = self.linkage
        driven, other = one.guides
        assert isinstance(driven, Slot)
        found = one.body(q)
        at = found.position + np.exp(1j * found.rotation) * driven.body_point
        arm = (other.body_point - driven.body_point) * np.exp(-1j * driven.body_direction)
        turn = np.minimum(2.0, half)
        if isinstance(other, Circle):
            between = driven.pin - other.pivot
            moves = abs(between) * turn
            beside = np.abs(np.imag(np.conj(np.exp(1j * q)) * between + arm))
            near, far = np.maximum(beside - moves, 0.0), beside + moves
            root = _root(other.radius, beside)
            span = np.maximum(np.abs(_root(other.radius, near) - root), np.abs(_root(other.radius, far) - root))
            slide = moves + span
        elif isinstance(other, Rail):
            low, high = q - half - other.direction, q + half - other.direction
            # the sine over the cell: between its ends, or its extreme
            sines = np.abs(np.stack([np.sin(low), np.sin(high)]))
            apart = (np.floor(low / np.pi) != np.floor(high / np.pi)) | (half >= np.pi)
            least = np.where(apart, 0.0, sines.min(axis=0))
            middle = np.abs(np.sin(q - other.direction))
            between = driven.pin - other.point
            top = np.abs(np.imag((between + arm * np.exp(1j * q)) * np.exp(-1j * other.direction)))
            known = least > 0
            safe = np.where(known, least, 1.0)
            slide = np.where(
                known, abs(arm) * turn / safe + top * turn / (safe * np.where(known, middle, 1.0)), np.inf
            )
        else:
            tilt = abs(np.sin(other.body_direction - driven.body_direction))
            slide = abs(driven.pin - other.pin) * turn / tilt
        return np.asarray(slide + (np.abs(at - driven.pin) + slide) * turn)


def _root(radius: float, beside: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum((radius - beside) * (radius + beside), 0.0)))


def _by_offset(offset: Floats, length: Floats, e: Floats) -> Floats:
    """asin(offset / length), the offset varying by at most e."""
    middle = _asin(offset / length)
    ends = _asin((offset - e) / length), _asin((offset + e) / length)
    return np.asarray(np.maximum(np.abs(ends[0] - middle), np.abs(ends[1] - middle)))


def _by_length(offset: Floats, length: Floats, e: Floats) -> Floats:
    """asin(offset / length) and the direction of the length, which varies by at most e."""
    low, high = np.maximum(length - e, np.abs(offset)), length + e
    known = (e < length) & (low > 0)
    safe = np.where(known, low, 1.0)
    middle = _asin(offset / length)
    span = np.maximum(np.abs(_asin(offset / safe) - middle), np.abs(_asin(offset / high) - middle))
    return np.where(known, np.arcsin(np.where(known, e / length, 0.0)) + span, np.inf)


def _asin(sine: Floats) -> Floats:
    """asin of what rounding or a cell's end may lead beyond 1, stable near it."""
    inside = np.clip(sine, -1.0, 1.0)
    return np.asarray(np.arctan2(inside, np.sqrt((1.0 - inside) * (1.0 + inside))))


# -- a motor and its rod ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Swung:
    """The bodies of a linkage that a motor swings through its way and back.

    On either way the place of its drive is monotone in the motor's angle. So over a cell it stays between the places at both ends
    of the cell, and one end of the way where a dead centre lies within; the linkage's own movement encloses the rest.
    """

    six: SixBar
    plain: Movement

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """``travel``, ``half`` (m,): of the motor."""
        middle = self.six.travel(travel)
        spread = np.zeros(travel.shape)
        wide = half > 0
        if wide.any():
            here, by = travel[wide], np.minimum(half[wide], np.pi)
            ends = self.six.travel(np.concatenate([here - by, here + by])).reshape(2, -1)
            off = np.abs(ends - middle[wide]).max(axis=0)
            for angle, end in zip((0.0, self.six.last), self.six.used):
                within = np.abs((here - angle + np.pi) % TURN - np.pi) <= by
                off = np.where(within, np.maximum(off, np.abs(end - middle[wide])), off)
            spread[wide] = off + _ROUNDING * abs(self.six.used[1] - self.six.used[0])
        found = self.plain.bodies(middle, spread)
        for all_of, some in zip(bodies, found):
            all_of[: len(some)] = some


def motor_driven(
    linkage: Linkage,
    used: Interval,
    motor: Motor,
    sizes: Sizes,
    body: Sequence[complex] = (),
    bar: bool = False,
) -> Machine:
    """A linkage that a motor moves from one end of an interval to the other and back; the drive's travel is the motor's turn.

    Further plates: motor_crank and rod; further pins: M, the motor's shaft, K between both, Q on the link.

    Raises `FieldError`: for a motor that does not move the linkage over the interval, and a rod on a link that is no plate.
    """
    six = SixBar.of(linkage, used, motor)

    lengths = (*as_plates(linkage, used, sizes).lengths, motor.crank, motor.rod)
    hole, width = plate_sizes(lengths, sizes.hole, sizes.width, sizes.share)
    plain = as_plates(linkage, used, Sizes(hole, width, sizes.clearance), body, bar)
    if motor.link not in plain.movement.names:
        raise FieldError("/drive/link", f"the rod moves the {motor.link}, which is no plate: it is not arranged")
    link = plain.movement.names.index(motor.link)
    pin = motor.pin + plain.body_at if motor.link == BODY else motor.pin
    at = motor.at - plain.origin
    cranked, rod = len(plain.movement.names), len(plain.movement.names) + 1
    end, held = Place(cranked, complex(motor.crank)), Place(link, pin)
    movement = Movement(
        (*plain.movement.names, MOTOR_CRANK, ROD),
        (
            Swung(six, plain.movement),
            Crank(cranked, Place(GROUND, at), six.start),
            Between(rod, end, held, motor.rod),
        ),
    )
    free = not any(one.name == "P" for one in plain.pins)
    plates = [_with_pin(one, pin, hole, "Q", free) if one.name == motor.link else one for one in plain.plates]
    if bar:
        plates = [_with_pin(one, at, hole, "M", free) if one.name == "bar" else one for one in plates]
    for name, number, reach, ends in (
        (MOTOR_CRANK, cranked, motor.crank, ("M", "K")),
        (ROD, rod, motor.rod, ("K", "Q")),
    ):
        shape = Shape((0j, complex(reach)), width / 2)
        plates.append(Plate(name, number, shape, (Hole(0j, ends[0]), Hole(complex(reach), ends[1]))))
    joins = (MOTOR_CRANK, "bar") if bar else (MOTOR_CRANK,)
    pins = (
        *plain.pins,
        Pin("M", (Place(GROUND, at), Place(cranked, 0j)), hole / 2, joins),
        Pin("K", (end, Place(rod, 0j)), hole / 2, (MOTOR_CRANK, ROD)),
        Pin("Q", (Place(rod, complex(motor.rod)), held), hole / 2, (ROD, motor.link)),
    )
    return replace(
        plain,
        movement=movement,
        plates=tuple(plates),
        pins=pins,
        used=Interval(0.0, TURN),
        loop=None,
        slit_ends=(None, None),
        size=max(plain.size, motor.rod),
        lengths=lengths,
        turns=True,
    )


@dataclass(frozen=True)
class Strut:
    """A drive between the ground, or a link, and a pin of another link: a cylinder, or the two links of a knee.

    Attributes
    ----------
    link, on : str
        The link with the pin, and what carries the other end.
    pin : complex
        In the frame of ``link``.
    end : complex
        The other end in the plane at the first sample.
    sizes : tuple of float
        Retracted length and stroke of a cylinder; lengths of handle and strut of a knee.
    knee : int
        0 for a cylinder; for a knee +1 where its joint lies to the left of the line from end to pin, or -1.
    """

    link: str
    on: str
    pin: complex
    end: complex
    sizes: tuple[float, float]
    knee: int = 0


CYLINDER, PISTON_ROD, HANDLE, STRUT = "cylinder", "piston_rod", "handle", "strut"
_TUBE, _OVERLAP = 0.85, 0.05
"""Fractions of the retracted length: length of a cylinder's tube, and smallest overlap of tube and rod."""


def strut_driven(
    linkage: Linkage,
    used: Interval,
    drive: Strut,
    sizes: Sizes,
    body: Sequence[complex] = (),
    bar: bool = False,
) -> Machine:
    """Return a linkage with a cylinder or a knee, over an interval of the linkage's own travel.

    Further plates: cylinder and piston_rod, which slides inside it, or handle and strut; further pins: G, the end on the ground
    or on a link, K between handle and strut, Q on the link that is moved. The plate of that link reaches to Q.

    Raises `FieldError`: for an end on a link that is no plate.
    """
    plain = as_plates(linkage, used, sizes, body, bar)
    names, hole, width = plain.movement.names, plain.hole, plain.width
    for name in (drive.link, drive.on):
        if name != names[GROUND] and name not in [plate.name for plate in plain.plates]:
            raise FieldError("/drive/link", f"an end is on the {name}, which is no plate: it is not arranged")
    link, on = names.index(drive.link), names.index(drive.on)
    pin = drive.pin + plain.body_at if drive.link == BODY else drive.pin
    still = plain.movement.bodies(np.zeros(1))
    end = complex((drive.end - plain.origin - still.origin[on, 0]) / still.direction[on, 0])
    foot, held = Place(on, end), Place(link, pin)
    first, second = len(names), len(names) + 1
    both = (HANDLE, STRUT) if drive.knee else (CYLINDER, PISTON_ROD)
    eye = Hole(0j, "G"), Hole(0j, "Q")
    steps: list[Step] = []
    pins: list[Pin] = []
    if drive.knee:
        near, far = drive.sizes
        steps.append(Dyad(first, second, foot, held, near, far, drive.knee))
        plates = [
            Plate(name, number, Shape((0j, complex(reach)), width / 2), (hole_, Hole(complex(reach), "K")))
            for name, number, reach, hole_ in zip(both, (first, second), drive.sizes, eye)
        ]
        pins.append(Pin("K", (Place(first, complex(near)), Place(second, complex(far))), hole / 2, both))
    else:
        retracted, stroke = drive.sizes
        steps += [Aimed(first, foot, held), Aimed(second, held, foot)]
        rod = stroke + (1 - _TUBE + _OVERLAP) * retracted
        radii = width / 2, hole / 2 + (width - hole) / 4
        plates = [
            Plate(name, number, Shape((0j, complex(reach)), radius), (hole_,))
            for name, number, reach, radius, hole_ in zip(both, (first, second), (_TUBE * retracted, rod), radii, eye)
        ]
    free = not any(one.name == "P" for one in plain.pins)
    carriers = [(drive.link, pin, "Q")]
    if on != GROUND:
        carriers.append((drive.on, end, "G"))
    elif bar:
        carriers.append(("bar", end, "G"))
    own = list(plain.plates)
    for name, at, called in carriers:
        own = [_with_pin(one, at, hole, called, free) if one.name == name else one for one in own]
    foot_joins = both[:1] if on == GROUND and not bar else (both[0], "bar" if on == GROUND else drive.on)
    pins = [
        *plain.pins,
        Pin("G", (foot, Place(first, 0j)), hole / 2, foot_joins),
        *pins,
        Pin("Q", (Place(second, 0j), held), hole / 2, (both[1], drive.link)),
    ]
    return replace(
        plain,
        movement=Movement((*names, *both), (*plain.movement.steps, *steps)),
        plates=(*own, *plates),
        pins=tuple(pins),
        size=max(plain.size, sum(drive.sizes)),
        telescopes=() if drive.knee else (both,),
    )


def _with_pin(plate: Plate, at: complex, hole: float, pin: str, free: bool) -> Plate:
    """A plate that reaches to one more pin; ``free``: a hole for the body point alone gives way to it."""
    core = hull((*plate.shape.core, at))
    holes = [one for one in plate.holes if not (free and one.pin == "P" and abs(one.at - at) <= hole)]
    return replace(plate, shape=Shape(core, plate.shape.radius), holes=(*holes, Hole(at, pin)))
