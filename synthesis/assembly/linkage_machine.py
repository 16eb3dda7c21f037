"""A linkage as plates and pins; rails and slots are plates with a slit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats
from synthesis.assembly.guided_body import GuidedBody
from synthesis.assembly.machine import CLEARANCE, Hole, Machine, Pin, Plate, Sizes, Stop
from synthesis.assembly.movement import GROUND, Aimed, BodyPoint, Crank, Movement, Step
from synthesis.assembly.shapes import Shape, hull, nearest_room
from synthesis.assembly.sizes import plate_sizes
from synthesis.errors import FieldError
from synthesis.guides import Circle, Rail
from synthesis.linkage import BODY, Linkage
from synthesis.one_variable import bisect
from synthesis.target import TURN, Interval

_EXTENSION = 64
"""Extension of the used interval, as a multiple of its length, that is searched for the end of the loop of a slide."""
_STEPS = 360
"""Number of steps of a slide between which the end of a slit is sought."""
_CONTACT = 1e-12
"""Distance beyond its slit at which a pin still counts as inside, as a fraction of the size."""
_ROUNDING = 1e-9
"""Amount by which the used interval of a drive that turns may exceed the range in which the loop closes, in radians."""
_PINS = (("A", "D"), ("B", "C"))
"""Fixed pin, in a slot, and moving pin, on a rail, of each guide."""


def as_plates(
    linkage: Linkage, used: Interval, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """Return a linkage as plates and pins, over an interval of travel from the first sample.

    The body's plate, the coupler, holds the pins D and C of the first and the second guide and the body point P. A link on a
    circle turns about A or B; a rail is a plate of the ground on posts A1, A2 or B1, B2, with a slit for the pin; a slot is a
    slit in the coupler for the fixed pin A or B. Slits are as long as the interval requires. The frame of the coupler begins at
    the body point of the first guide; that of a four-bar lies along its coupler.

    Parameters
    ----------
    linkage : Linkage
    used : Interval
        Travel of the drive.
    sizes : Sizes
    body : sequence of complex
        Corners, counter-clockwise, of a plate that the coupler carries, from P in axes that turn with the coupler and are
        parallel to the user's where the body's rotation is 0. A post joins it, at P if there is room.
    bar : bool
        Add a plate for the ground.

    Raises
    ------
    FieldError
        If the loop does not close over the interval, or if the body has no room for its post.
    """
    used = Interval(min(used), max(used))
    guided = linkage.by_coupler
    loop = loop_of(linkage, used)
    spans = {index: guided.used(index, used) for index, guide in enumerate(guided.guides) if guide.slides}
    origin, local = guided.guides[0][0], guided.moved(0.0, -guided.guides[0][0])
    driven, second = local.guides
    arm = abs(second.body_point - driven.body_point)
    lengths = [length for length in guided.lengths.values() if length > 0]
    lengths += [abs(high - low) for low, high in spans.values() if high > low]
    hole, width = plate_sizes(lengths, sizes.hole, sizes.width, sizes.hole_factor)
    size = max([*lengths, arm])
    sliding = [name for name, guide in guided.named_guides if guide.slides]
    names = ["ground", *(name for name in guided.link_names if name not in sliding)]
    carrier = names.index(BODY)
    plates: list[Plate] = []
    pins: list[Pin] = []
    steps: list[Step] = [GuidedBody(local, carrier)]
    # the body point in the frame of the coupler
    point = linkage.arm - driven.body_point if linkage.mounted else None
    corners, holes = [] if point is None else [point], []
    for index, (link, guide) in enumerate(local.named_guides):
        fixed, moving = _PINS[index]
        at = guide.body_point - driven.body_point
        if isinstance(guide, Circle):
            number = names.index(link)
            pivot, end = BodyPoint(GROUND, guide.pivot), complex(guide.radius)
            if index == 0:
                steps.append(Crank(number, pivot, guided.start + guided.ground_angle))
            else:
                steps.append(Aimed(number, pivot, BodyPoint(carrier, at)))
            plates.append(
                Plate(link, number, Shape((0j, end), width / 2), (Hole((0j,), fixed), Hole((end,), moving)))
            )
            pins.append(Pin(fixed, (pivot, BodyPoint(number, 0j)), hole / 2, (link,)))
            ends = BodyPoint(number, end), BodyPoint(carrier, at)
            is_carried = linkage.is_four_bar and index
            pins.append(Pin(moving, ends[::-1] if is_carried else ends, hole / 2, (link, BODY)))
        elif isinstance(guide, Rail):
            name = "rail" if "rail" not in [plate.name for plate in plates] else "second_rail"
            along = complex(np.exp(1j * guide.direction))
            low, high = (guide.point + along * value for value in spans[index])
            posts = low - 2 * hole * along, high + 2 * hole * along
            bores = Hole(posts[:1], f"{fixed}1"), Hole(posts[1:], f"{fixed}2"), Hole((low, high), moving)
            plates.append(Plate(name, GROUND, Shape(posts, width / 2), bores))
            pins += [Pin(bore.pin, (BodyPoint(GROUND, bore.core[0]),), hole / 2, (name,)) for bore in bores[:2]]
            pins.append(Pin(moving, (BodyPoint(carrier, at),), hole / 2, (BODY, name)))
        else:
            along = complex(np.exp(1j * guide.body_direction))
            low, high = (at + along * value for value in spans[index])
            holes.append(Hole((low, high), fixed))
            corners += [low, high]
            pins.append(Pin(fixed, (BodyPoint(GROUND, guide.pin),), hole / 2, (BODY,)))
            continue
        corners.append(at)
        holes.append(Hole((at,), moving))
    if linkage.is_four_bar:
        pins.sort(key=lambda pin: not pin.grounded)
    if point is not None:
        outline = tuple(complex(point + np.exp(1j * _body_turn(linkage)) * z) for z in body)
        post = _post_in(outline, point, [made.core for made in holes], hole, width) if outline else point
        if outline:
            corners.append(post)
            plates.append(Plate("body", carrier, Shape(outline, 0.0), (Hole((post,), "P"),)))
            pins.append(Pin("P", (BodyPoint(carrier, post),), hole / 2, (BODY, "body"), True))
        # a hole that would overlap another hole is left out
        if all(made.distance(post) > hole for made in holes):
            holes.append(Hole((post,), "P"))
    plates.insert(1, Plate(BODY, carrier, Shape(hull(corners), width / 2), tuple(holes)))
    if bar:
        shafts = tuple(Hole((pin.points[0].at,), pin.name) for pin in pins if pin.grounded)
        plates.append(Plate("bar", GROUND, Shape(hull([shaft.core[0] for shaft in shafts]), width / 2), shafts))
        pins = [replace(pin, joins=(*pin.joins, "bar")) if pin.grounded else pin for pin in pins]
    is_whole_turn = guided.driver.turns and loop is None and used.last - used.first >= TURN

    def slit_end(start: float, limit: float) -> Stop | None:
        if not np.isfinite(limit):  # a slide of its own drives it there
            limit = start + np.sign(limit) * (used.last - used.first)
        found = _slit_end(guided, start, limit, spans, size)
        if found is None or is_whole_turn:
            return None
        pair = next((slit.pin, plate.name) for plate in plates for slit in plate.slits if slit.pin in _PINS[found[1]])
        return Stop(found[0], pair)

    low_limit, high_limit = (used.last - TURN, used.first + TURN) if loop is None else loop
    return Machine(
        Movement(names, steps),
        tuple(plates),
        tuple(pins),
        Interval(used.first, used.first + TURN) if is_whole_turn else used,
        loop,
        hole,
        width,
        CLEARANCE * size if sizes.clearance is None else sizes.clearance,
        size,
        tuple(lengths),
        origin,
        guided.driver.turns,
        -driven.body_point,
        (slit_end(used.first, low_limit), slit_end(used.last, high_limit)),
    )


def loop_of(linkage: Linkage, used: Interval) -> Interval | None:
    """Return the travel over which the loop closes around the used interval; None if the drive turns fully.

    The end is infinite if a slide drives the loop and it still closes at `_EXTENSION` times the used interval.

    Raises
    ------
    FieldError
        If the loop does not close over the whole used interval.
    """
    first, last = used
    turns = linkage.driver.turns
    slack = min(_ROUNDING, (last - first) / 2) if turns else 0.0
    if not _closes(linkage, first + slack, last - first - 2 * slack):
        field = "links" if linkage.is_four_bar else "guides"
        raise FieldError(f"/solution/{field}", "the loop does not close over the whole used interval")
    if turns and _closes(linkage, 0.0, TURN):
        return None
    farthest = TURN if turns else _EXTENSION * (last - first)

    def end(start: float, direction: float) -> float:
        # double the distance until the loop does not close, then bisect
        closes, outside = 0.0, last - first if last > first else farthest
        while outside < farthest and _closes(linkage, start, direction * outside):
            closes, outside = outside, min(2 * outside, farthest)
        if _closes(linkage, start, direction * outside):
            return direction * np.inf

        def holds(distance: NDArray[np.floating]) -> Flags:
            return np.array([_closes(linkage, start, direction * float(distance[0]))])

        inside, _ = bisect(holds, np.array([closes]), np.array([outside]))
        return start + direction * float(inside[0])

    return Interval(end(first, -1.0), end(last, 1.0))


def _closes(linkage: Linkage, start: float, distance: float) -> bool:
    ends = sorted((linkage.start + start, linkage.start + start + distance))
    return linkage.closes_over(Interval(*ends))


def _slit_end(
    linkage: Linkage, start: float, end: float, spans: Mapping[int, tuple[float, float]], size: float
) -> tuple[float, int] | None:
    """Return the travel at which a slide first leaves its slit, and the guide; None if it does not.

    The end is sought between two coordinates of the drive, in steps of at most a degree or a 360th of the distance. ``spans`` are
    the used ranges of the guides that are rails or slots.
    """
    found: tuple[float, int] | None = None
    steps = int(np.ceil(abs(end - start) / np.deg2rad(1.0))) if linkage.driver.turns else _STEPS
    travels = np.linspace(start, end, max(steps, 2) + 1)

    def beyond(guide: int, at: NDArray[np.floating]) -> Floats:
        low, high = spans[guide]
        along = linkage.along(guide, at)
        # at the loop's end itself a place may not be known
        return np.nan_to_num(np.maximum(along - high, low - along), nan=-np.inf) - _CONTACT * size

    for guide in spans:
        out = np.flatnonzero(beyond(guide, travels) > 0)
        if out.size:
            inside = start
            if out[0]:
                ends = bisect(lambda at, guide=guide: beyond(guide, at) <= 0, travels[out[:1] - 1], travels[out[:1]])  # type: ignore[misc]
                inside = float(ends[0][0])
            if abs(inside - start) < 1e-9 * max(1.0, abs(end - start)):
                inside = start
            if found is None or abs(inside - start) < abs(found[0] - start):
                found = inside, guide
    return found


def _post_in(
    corners: Sequence[complex], point: complex, obstacles: Sequence[tuple[complex, ...]], hole: float, width: float
) -> complex:
    """Return the place of the post of a body with an outline, at the body point or near it, in the frame of its link.

    Around its hole the outline and the link's holes and slits, with cores as obstacles, leave as much material as a plate of the
    width does, or at least a half or a quarter of that. Raise `FieldError` if there is no room.
    """
    for fraction in (1.0, 0.5, 0.25):
        rim = fraction * (width - hole) / 2
        post = nearest_room(corners, obstacles, hole / 2 + rim, hole + rim, point)
        if post is not None:
            return post
    raise FieldError("/body", f"must leave room for a post with a hole of {hole:g} that joins it to the coupler")


def _body_turn(linkage: Linkage) -> float:
    """Return the angle of the body's axes in the coupler's frame.

    If the rotation of the body is unknown, its axes are parallel to the user's at the first sample.
    """
    if linkage.body_offset is not None:
        return linkage.body_offset
    return -float(linkage.body(linkage.start).rotation[0])
