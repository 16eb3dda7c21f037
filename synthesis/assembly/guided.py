"""A body on two guides as plates and pins: rails and slots as plates with a slit, and how far the body can be over a cell.

With Z the driven guide's pin, X the point that the other guide holds, and e the most that Z moves over a cell (half its width for
a slider; for a crank the radius times that), the body turns by at most

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

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats
from synthesis.assembly.machine import CLEARANCE, Hole, Machine, Pin, Plate, Sizes, Slit, SlitEnd, carried_by
from synthesis.assembly.movement import GROUND, Between, Bodies, Crank, Movement, Place, turn_over
from synthesis.assembly.shapes import Shape, hull
from synthesis.errors import FieldError
from synthesis.fourbar.files import plate_sizes
from synthesis.guided.linkage import Circle, Driver, GuidedLinkage, Rail, Slot
from synthesis.one_variable import bisect
from synthesis.target import TURN, Interval

_FAR, _PLACES = 64, 360
"""Times the used way, or places of it, that are looked at beyond it for where a slide ends."""
_TOUCHES = 1e-12
"""Of the size, within which a pin at the end of its slit is still in it."""
_PINS = (("A", "D"), ("B", "C"))
"""Of each guide: its fixed pin, in a slot, and its moving one, on a rail."""
BODY = 1
"""Number of the body; the links of guides on circles follow."""


@dataclass(frozen=True)
class OnGuides:
    """The body of a linkage; its frame has the body's directions and begins at the driven guide's body point."""

    linkage: GuidedLinkage

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Poses are those of `GuidedLinkage.body`."""
        one = self.linkage
        driven = one.guides[0]
        q = one.start + travel
        found = one.body(q)
        direction = np.exp(1j * found.rotation)
        bodies.direction[BODY] = direction
        bodies.origin[BODY] = found.position + direction * driven.body_point
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
        bodies.shift[BODY], bodies.turn[BODY] = shift, turn

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


def guided(
    linkage: GuidedLinkage, used: Interval, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """A linkage on two guides as plates and pins, over an interval of travel from the first sample.

    The body's plate coupler holds pins D and C of the first and the second guide, and the body point P. On a circle a link turns
    about A or B; a rail is a plate of the ground on posts A1, A2 or B1, B2, with a slit for the pin; a slot is a slit in the
    coupler for the fixed pin A or B. Slits are as long as the interval needs.

    ``body``, ``bar``: as of `machine.four_bar`, corners in the body's frame. Raises `FieldError`: where the loop does not close.
    """
    first, last = min(used), max(used)
    if not linkage.closes_over(Interval(linkage.start + first, linkage.start + last)):
        raise FieldError("/solution/guides", "the loop does not close over the whole used interval")
    spans = {
        place: linkage.used(place, Interval(first, last))
        for place, one in enumerate(linkage.guides)
        if not isinstance(one, Circle)
    }
    driven, other = linkage.guides
    origin = _fixed(driven)
    local = GuidedLinkage(
        (_shifted(driven, origin), _shifted(other, origin)), linkage.driver, linkage.branch, linkage.start
    )
    lengths = [one.radius for one in linkage.guides if isinstance(one, Circle)]
    lengths += [abs(high - low) for low, high in spans.values() if high > low]
    arm = abs(other.body_point - driven.body_point)
    lengths += [arm] if arm > 0 and not any(isinstance(one, Slot) for one in linkage.guides) else []
    hole, width = plate_sizes(lengths, sizes.hole, sizes.width)
    size = max([*lengths, arm])
    plates: list[Plate] = []
    pins: list[Pin] = []
    steps: list[OnGuides | Between | Crank] = [OnGuides(local)]
    names = ["ground", "coupler"]
    corners, holes, slits = [-driven.body_point], [], []
    for place, one in enumerate(local.guides):
        fixed, moving = ("A", "D") if place == 0 else ("B", "C")
        at = one.body_point - driven.body_point
        if isinstance(one, Circle):
            number, name = len(names), linkage.link_names[0 if place == 0 else 2]
            names.append(name)
            if place == 0:
                steps.append(Crank(number, Place(GROUND, one.pivot), linkage.start))
            else:
                steps.append(Between(number, Place(GROUND, one.pivot), Place(BODY, at), one.radius))
            end = complex(one.radius)
            plates.append(Plate(name, number, Shape((0j, end), width / 2), (Hole(0j, fixed), Hole(end, moving))))
            pins.append(Pin(fixed, (Place(GROUND, one.pivot), Place(number, 0j)), hole / 2, (name,)))
            pins.append(Pin(moving, (Place(number, end), Place(BODY, at)), hole / 2, (name, "coupler")))
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
            pins.append(Pin(moving, (Place(BODY, at),), hole / 2, ("coupler", name)))
        else:
            along = complex(np.exp(1j * one.body_direction))
            low, high = (at + along * value for value in spans[place])
            slits.append(Slit(low, high, fixed))
            corners += [low, high]
            pins.append(Pin(fixed, (Place(GROUND, one.pin),), hole / 2, ("coupler",)))
            continue
        corners.append(at)
        holes.append(Hole(at, moving))
    sash, post = carried_by(body, -driven.body_point, 0.0)
    if sash:
        corners.append(post)
        plates.append(Plate("body", BODY, Shape(sash, 0.0), (Hole(post, "P"),)))
        pins.append(Pin("P", (Place(BODY, post),), hole / 2, ("coupler", "body"), True))
    if all(abs(post - at) > hole for at, _ in holes) and all(one.distance(post) > hole for one in slits):
        holes.append(Hole(post, "P"))
    plates.insert(1, Plate("coupler", BODY, Shape(hull(corners), width / 2), tuple(holes), tuple(slits)))
    if bar:
        grounded = [pin for pin in pins if pin.grounded]
        plates.append(
            Plate(
                "bar",
                GROUND,
                Shape(hull([pin.places[0].at for pin in grounded]), width / 2),
                tuple(Hole(pin.places[0].at, pin.name) for pin in grounded),
            )
        )
        pins = [replace(pin, joins=(*pin.joins, "bar")) if pin.grounded else pin for pin in pins]
    whole = linkage.turns_fully and last - first >= TURN
    loop = _loop_of(linkage, first, last)
    ends: list[SlitEnd | None] = []
    for begin, far in ((first, last - TURN), (last, first + TURN)):
        reach = far if loop is None else loop[len(ends)]
        if not np.isfinite(reach):  # a slide of its own drives it there
            reach = begin + np.sign(reach) * (last - first)
        left = _slit_end(linkage, begin, float(reach), spans, size)
        if left is None:
            ends.append(None)
            continue
        at, guide = left
        name = next(plate.name for plate in plates for slit in plate.slits if slit.pin in _PINS[guide])
        pin = next(slit.pin for plate in plates for slit in plate.slits if slit.pin in _PINS[guide])
        ends.append(SlitEnd(at, (pin, name)))
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
        linkage.driver.turns,
        -driven.body_point,
        (None, None) if whole else (ends[0], ends[1]),
    )


def _loop_of(linkage: GuidedLinkage, first: float, last: float) -> Interval | None:
    """Travel over which the loop closes about that used; None where the drive turns fully.

    Infinite where a slide drives it and the loop goes on for `_FAR` times the used way.
    """
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


def _closes(linkage: GuidedLinkage, begin: float, by: float) -> bool:
    ends = sorted((linkage.start + begin, linkage.start + begin + by))
    return linkage.closes_over(Interval(*ends))


def _slit_end(
    linkage: GuidedLinkage, begin: float, end: float, spans: Mapping[int, tuple[float, float]], size: float
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


def _fixed(one: Circle | Rail | Slot) -> complex:
    return one.pivot if isinstance(one, Circle) else one.point if isinstance(one, Rail) else one.pin


def _shifted(one: Circle | Rail | Slot, origin: complex) -> Circle | Rail | Slot:
    """A guide with another place as the origin of the plane."""
    if isinstance(one, Circle):
        return one._replace(pivot=one.pivot - origin)
    return one._replace(point=one.point - origin) if isinstance(one, Rail) else one._replace(pin=one.pin - origin)
