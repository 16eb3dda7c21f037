"""What pairs of guides must keep to, as functions with derivatives: the limits of a request, one branch, and the order.

Each is at least 0 where it is kept, lengths over the length scale. A limit concerns what a kind has: a rail has no pivot, and a
linkage with one crank has no rocker. Links are the cranks, the distance of two pins of the body (coupler) and that of two pins of
the ground (ground). `family` concerns four-bars alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.fourbar.limits import REACH, Limits
from synthesis.free.poses import Poses
from synthesis.guided.linkage import Circle, Driver, Guide, GuidedLinkage, Rail, Slot
from synthesis.guided.pairs import OWN, Corrected, Curve
from synthesis.guided.solution import GuidedSolution
from synthesis.mechanism import Box
from synthesis.target import TURN, Samples

_ON_BRANCH = 1e-3
"""Least sine of the transmission angle that a search keeps: at a dead position the branches meet."""
_STEP = 1e-3
"""Least step of the drive between samples in their order, in radians or length scales."""
_ROUNDING = 1e-9
"""Part of the motion's extent, or angle, by which an answer may break a limit: what a search adds to be sure is more."""


_FEW_PLACES, _MORE = 41, 0.3
"""Places of the drive, and the part of the longest step between them, that used parts are estimated by from above."""


class Bound(NamedTuple):
    """Functions of candidates (n, k) and their derivatives by the unknowns (n, 10, k)."""

    name: str
    values: Floats
    slopes: Floats
    equal: bool = False


class Signs(NamedTuple):
    """What a candidate keeps of the pose that it begins at, (n, 1): its branch and the way that its drive goes, +1 or -1."""

    branch: Floats
    way: Floats
    margin: Floats
    """Added to the least transmission angle at the samples, for what it falls below that between them."""


class Bounds:
    """The limits of a request, made ready for many candidates.

    ``timed``: whether the drive is given, and with it the order.
    """

    def __init__(self, limits: Limits, poses: Poses, timed: bool = False) -> None:
        self.limits, self.ordered = limits, poses.ordered and not timed
        self.span_max, self.middle, self.scale = poses.span_max, poses.middle, poses.length_scale
        self.far = None if limits.pivot_reach is None else REACH * poses.extent / self.scale

    def __call__(self, found: Corrected, signs: Signs) -> list[Bound]:
        """All bounds at candidates."""
        with np.errstate(all="ignore"):
            return list(self._all(found, _Slopes(found), signs))

    def _all(self, found: Corrected, slopes: _Slopes, signs: Signs) -> Iterator[Bound]:
        limits, scale = self.limits, self.scale
        yield from self._moving(found, slopes, signs)
        yield from self._lengths(found, slopes)
        first, second = found.at
        boxes = (limits.box("pivot_a"), limits.box("pivot_b"))
        names = ("pivot_a", "pivot_b")
        for k, (name, own) in enumerate(zip(names, boxes)):
            place, change, has = slopes.pivot(k)
            if (given := getattr(limits, name)) is not None:
                off = place - (given - self.middle) / scale
                yield _where(has, Bound(name, off.real, change.real, True))
                yield _where(has, Bound(name, off.imag, change.imag, True))
                continue
            if own is not None:
                yield from (_where(has, one) for one in self._inside("pivot_box", place, change, own))
            reach = limits.pivot_reach
            if reach is not None and (far := getattr(reach, name)) is not None:
                off = place - (reach.middle - self.middle) / scale
                yield _where(has, _within("pivot_reach", off, change, far / scale))
            for out in limits.keep_out:
                yield _where(has, self._outside(place, change, out))
        rails = [(k, at) for k, at in enumerate((first, second)) if np.any(at.guide.straight & ~at.guide.inverse)]
        for k, at in rails:
            place, change = slopes.world(k)
            has = at.guide.straight & ~at.guide.inverse
            if limits.rail_box is not None:
                yield from (_where(has, one) for one in self._inside("rail_box", place, change, limits.rail_box))
            if self.far is not None:
                yield _where(has, _within("pivot_reach", place, change, self.far))
        if limits.envelope is not None:
            moved = np.asarray(slopes.moved)
            yield from self._inside("envelope", found.position, moved, limits.envelope)
            for k in range(2):
                yield from self._inside("envelope", *slopes.world(k), limits.envelope)

    # -- what depends on the pose -----------------------------------------------------------------------------------

    def _moving(self, found: Corrected, slopes: _Slopes, signs: Signs) -> Iterator[Bound]:
        limits, scale = self.limits, self.scale
        sine = found.transmission()
        change = slopes.of(found.transmission_derivatives())
        least = np.sin(np.minimum(limits.transmission_angle_min + signs.margin, np.pi / 2 - 1e-6))
        yield Bound(
            "transmission_angle_min",
            signs.branch * sine - np.maximum(least, _ON_BRANCH),
            signs.branch[:, None] * change,
        )
        first, second = found.at
        drive, turned = found.drive(), slopes.of(found.drive_derivatives())
        angular = ~first.guide.straight | found.hinge
        steps = np.diff(drive, axis=1)
        steps = np.where(angular, steps - TURN * np.round(steps / TURN), steps)
        if self.ordered:
            gone, rate = signs.way * steps, signs.way[:, None] * np.diff(turned, axis=2)
            yield Bound("order", gone - _STEP, rate)
            total = np.sum(gone, axis=1, keepdims=True)
            room = Bound("crank_span_max", self.span_max - total, -np.sum(rate, axis=2, keepdims=True))
            yield _where(angular, room)
        if limits.arm_min is not None:
            arm, change = slopes.arm(sine, change)
            has = second.guide.inverse & ~found.hinge
            yield _where(
                has, Bound("arm_min", signs.branch * arm - limits.arm_min / scale, signs.branch[:, None] * change)
            )
        for k, at in enumerate(found.at):
            if limits.stroke_max is None and limits.link_max is None:
                break
            way, rate = at.travel()[0], slopes.of(slopes.padded(k, at.travel()[1:]))
            if limits.stroke_max is not None:
                low, high = way.argmin(axis=1)[:, None], way.argmax(axis=1)[:, None]
                ends = [np.take_along_axis(way, end, 1) for end in (low, high)]
                rates = [np.take_along_axis(rate, end[:, None], 2) for end in (low, high)]
                room = Bound("stroke_max", limits.stroke_max / scale - (ends[1] - ends[0]), rates[0] - rates[1])
                yield _where(at.guide.straight, room)
            if limits.link_max is not None:  # how far out the slot is used
                yield _where(
                    at.guide.inverse, _within("link_max", at.place, slopes.framed(k), limits.link_max / scale)
                )
        if limits.cylinder_dead_length is not None or limits.cylinder_extended_max is not None:
            length, change = slopes.extension()
            has = first.guide.inverse & ~found.hinge
            sign = np.sign(np.sum(length, axis=1, keepdims=True))
            length, change = sign * length, sign[:, None] * change
            if (dead := limits.cylinder_dead_length) is not None:
                yield _where(has, Bound("cylinder_dead_length", length - dead / scale, change))
            if (most := limits.cylinder_extended_max) is not None:
                yield _where(has, Bound("cylinder_extended_max", most / scale - length, -change))

    # -- lengths ----------------------------------------------------------------------------------------------------

    def _lengths(self, found: Corrected, slopes: _Slopes) -> Iterator[Bound]:
        limits, scale = self.limits, self.scale
        crank, coupler, _, ground = limits.links
        straight, slots = ([getattr(one, name) for one in found.guides] for name in ("straight", "inverse"))
        pivots = [~bent | slot for bent, slot in zip(straight, slots)]
        points, grounds = ~slots[0] & ~slots[1], slots[0] & slots[1]
        # cranks; of the others the distance of two points of the body, or of two pins of the ground
        lengths = [
            (*slopes.radius(0), ~straight[0], ((crank, ~straight[0]),)),
            (*slopes.radius(1), ~straight[1], ((crank, ~straight[1]),)),
            (*slopes.between_points(), points | grounds, ((coupler, points), (ground, grounds))),
            (*slopes.between_pivots(), pivots[0] & pivots[1] & ~grounds, ((ground, pivots[0] & pivots[1]),)),
        ]
        for value, change, has, given in lengths:
            if (most := limits.link_max) is not None:
                yield _where(has, Bound("link_max", most / scale - value, -change))
            if (least := limits.link_min) is not None:
                yield _where(has, Bound("link_min", value - least / scale, change))
            for length, those in given:
                if length is not None:
                    yield _where(has & those, Bound("links", value - length / scale, change, True))
        if (ratio := limits.link_ratio_max) is not None:
            for a, b in ((0, 2), (0, 3), (1, 2), (1, 3)):
                one, other = lengths[a], lengths[b]
                has = one[2] & other[2]
                for x, y in ((one, other), (other, one)):
                    yield _where(has, Bound("link_ratio_max", x[0] - y[0] / ratio, x[1] - y[1] / ratio))
        for k, guide in enumerate(found.guides):
            moved = slopes.point(k)
            if (most := limits.link_max) is not None:
                yield _where(~guide.inverse, _within("link_max", guide.point, moved, most / scale))
            if k == 0 and (most := limits.coupler_radius_max) is not None:
                yield _where(~guide.inverse, _within("coupler_radius_max", guide.point, moved, most / scale))

    # -- places -----------------------------------------------------------------------------------------------------

    def _inside(self, name: str, place: Complexes, change: Complexes, box: Box) -> Iterator[Bound]:
        low = (complex(box[0], box[1]) - self.middle) / self.scale
        high = (complex(box[2], box[3]) - self.middle) / self.scale
        yield Bound(name, place.real - low.real, change.real)
        yield Bound(name, place.imag - low.imag, change.imag)
        yield Bound(name, high.real - place.real, -change.real)
        yield Bound(name, high.imag - place.imag, -change.imag)

    def _outside(self, place: Complexes, change: Complexes, box: Box) -> Bound:
        sides = list(self._inside("keep_out", place, change, box))
        values = np.stack([-one.values for one in sides])
        nearest = values.argmax(axis=0)  # the side that is left soonest
        value = np.take_along_axis(values, nearest[None], 0)[0]
        slope = np.take_along_axis(np.stack([-one.slopes for one in sides]), nearest[None, :, None], 0)[0]
        return Bound("keep_out", value, slope)


def _within(name: str, off: Complexes, change: Complexes, far: float) -> Bound:
    size = np.abs(off)
    along = np.conj(off) / np.maximum(size, 1e-12)
    return Bound(name, far - size, -(along[:, None] * change).real)


def _where(has: Flags, bound: Bound) -> Bound:
    """A bound of those candidates that have what it concerns; the others keep it."""
    has = has[:, :1] if has.ndim == 2 else has[:, None]
    values = np.where(has, bound.values, 0.0 if bound.equal else 1.0)
    return bound._replace(values=values, slopes=np.where(has[:, None], bound.slopes, 0.0))


class _Slopes:
    """Derivatives by all ten unknowns, the poses' own among them."""

    def __init__(self, found: Corrected) -> None:
        self.found = found
        _, self.turned, self.moved = found.derivatives()
        self.size = self.turned.shape[1]

    def of(self, parts: tuple[Floats, Floats, Complexes]) -> Floats:
        """Of what has derivatives by the unknowns, by gamma and by the position."""
        own, by_angle, by_position = parts
        if own.shape[1] < self.size:
            own = np.concatenate([own, np.zeros((len(own), self.size - own.shape[1], own.shape[2]))], axis=1)
        return own + by_angle[:, None] * self.turned + (np.conj(by_position)[:, None] * self.moved).real

    def padded(self, k: int, parts: tuple[Floats, Complexes, Floats]) -> tuple[Floats, Floats, Complexes]:
        """Derivatives of one guide's own as those of the pair."""
        by_angle, by_position, own = parts
        return _pad(own, k, self.size), by_angle, by_position

    def world(self, k: int) -> tuple[Complexes, Complexes]:
        """The place where a guide's point is in the ground, and its derivatives, (n, N) and (n, 10, N)."""
        place, by_angle, by_position, by_point = self.found.at[k].world()
        change = by_angle[:, None] * self.turned + by_position[:, None] * self.moved
        change[:, OWN * k] += by_point
        change[:, OWN * k + 1] += 1j * by_point
        return place, change

    def framed(self, k: int) -> Complexes:
        """Derivatives of the place in the guide's own frame."""
        at = self.found.at[k]
        change = at.by_angle[:, None] * self.turned + at.by_position[:, None] * self.moved
        change[:, OWN * k] += at.frame
        change[:, OWN * k + 1] += 1j * at.frame
        return change

    def point(self, k: int) -> Complexes:
        """Derivatives of the running point, (n, 10, 1)."""
        out = np.zeros((len(self.turned), self.size, 1), dtype=complex)
        out[:, OWN * k], out[:, OWN * k + 1] = 1.0, 1j
        return out

    def pivot(self, k: int) -> tuple[Complexes, Complexes, Flags]:
        """A fixed pivot or pin (n, 1), its derivatives (n, 10, 1), and which candidates have one."""
        guide = self.found.guides[k]
        change = np.where(guide.inverse[:, None], self.point(k), _pad(_centre_change(guide), k, self.size))
        return np.where(guide.inverse, guide.point, guide.centre), change, guide.inverse | ~guide.straight

    def radius(self, k: int) -> tuple[Floats, Floats]:
        """Radius of a circle, (n, 1)."""
        guide = self.found.guides[k]
        bent = np.where(guide.straight, 1.0, guide.curvature)
        out = np.zeros((len(bent), OWN, 1))
        out[:, 4] = np.where(guide.straight, 0.0, -np.sign(bent) * guide.unit / bent**2)
        return 1 / np.abs(bent), _pad(out, k, self.size)

    def between_points(self) -> tuple[Floats, Floats]:
        """Distance of the running points: of two points of the body, or of two pins of the ground."""
        one, other = self.found.guides
        return _distance(other.point - one.point, self.point(1) - self.point(0))

    def between_pivots(self) -> tuple[Floats, Floats]:
        """Distance of the fixed pivots and pins."""
        (one, change, _), (other, other_change, _) = self.pivot(0), self.pivot(1)
        return _distance(other - one, other_change - change)

    def arm(self, sine: Floats, change: Floats) -> tuple[Floats, Floats]:
        """|X - Z| times the sine of the transmission angle."""
        (z, z_change), (x, x_change) = self.world(0), self.world(1)
        size, rate = _distance(x - z, x_change - z_change)
        return size * sine, size[:, None] * change + sine[:, None] * rate

    def extension(self) -> tuple[Floats, Floats]:
        """Of a cylinder: from its pin to the body point, see `reference`; signed."""
        found = self.found
        guide, other = found.guides
        way, by_angle, by_position, own = found.at[0].travel()
        change = self.of((_pad(own, 0, self.size), by_angle, by_position))
        along = np.conj(1j * guide.inward)
        # the other guide's body point on the slot; of two slots where they meet
        from_origin = other.point - guide.origin
        foot = (along * from_origin).real
        shift = np.zeros_like(change[:, :, :1])
        moved = self.point(1)
        shift += (along[:, None] * moved).real
        shift[:, 2] += -(np.conj(guide.inward) * from_origin).real
        meets, meets_change = self._crossing()
        foot = np.where(other.inverse, meets, foot)
        shift = np.where(other.inverse[:, None], meets_change, shift)
        return way - foot, change - shift

    def _crossing(self) -> tuple[Floats, Floats]:
        """Where two slots of the body meet, along the first from its origin."""
        guide, other = self.found.guides
        gap = other.origin + other.offset * other.inward - guide.origin - guide.offset * guide.inward
        along = 1j * guide.inward
        below = (np.conj(other.inward) * along).real
        below = np.where(np.abs(below) > 1e-12, below, 1e-12)
        value = (np.conj(other.inward) * gap).real / below
        out = np.zeros((len(value), self.size, 1))
        across = np.conj(other.inward)
        swung = -guide.offset * (across * along).real + value * (across * guide.inward).real
        out[:, 2] = swung / below
        out[:, 3] = -(across * guide.inward).real / below
        out[:, 7] = (np.conj(1j * other.inward) * (gap - value * along)).real / below
        out[:, 8] = 1.0 / below
        return value, out


def extension(found: Corrected) -> Floats:
    """Of candidates whose first guide is a slot: from the body point that it is measured from to the pin, (n, 1), on average."""
    return np.mean(_Slopes(found).extension()[0], axis=1, keepdims=True)


def _pad(own: Any, k: int, size: int) -> Any:
    out = np.zeros((len(own), size, own.shape[2]), dtype=own.dtype)
    out[:, OWN * k : OWN * (k + 1)] = own
    return out


def _distance(gap: Complexes, change: Complexes) -> tuple[Floats, Floats]:
    size = np.abs(gap)
    along = np.conj(gap) / np.maximum(size, 1e-12)
    return size, (along[:, None] * change).real


def _centre_change(guide: Curve) -> Complexes:
    """Derivatives of a circle's centre by its unknowns, (n, 5, 1)."""
    bent = np.where(guide.straight, 1.0, guide.curvature)
    out = np.zeros((len(bent), OWN, 1), dtype=complex)
    out[:, 2] = 1j * (guide.offset + 1 / bent) * guide.inward
    out[:, 3] = guide.inward
    out[:, 4] = np.where(guide.straight, 0.0, -guide.inward * guide.unit / bent**2)
    return out


# -- of finished linkages -----------------------------------------------------------------------------------------------

_BY_ENDS = {"stroke_max", "rail_box", "pivot_reach", "link_max", "cylinder_dead_length", "cylinder_extended_max"}
"""Limits of what is used of rails and slots."""
Used = tuple[float, float] | None
"""The least and the largest place in use of a rail or slot; None of a circle."""


def used_of(solution: GuidedSolution) -> tuple[Used, Used]:
    """What both guides use, exactly."""
    first, second = (
        None if isinstance(guide, Circle) else solution.linkage.used(place, solution.interval)
        for place, guide in enumerate(solution.linkage.guides)
    )
    return first, second


def _no_more_than(solution: GuidedSolution) -> tuple[Used, Used]:
    """What both guides use, or a little more: from few places, and so in a hundredth of the time."""
    travel = np.linspace(*solution.interval, _FEW_PLACES)
    found: list[Used] = []
    for place, guide in enumerate(solution.linkage.guides):
        if isinstance(guide, Circle):
            found.append(None)
            continue
        at = solution.linkage.along(place, travel)
        low, high = float(np.min(at)), float(np.max(at))
        spare = _MORE * float(np.max(np.abs(np.diff(at))))
        found.append((low - spare, high + spare))
    return found[0], found[1]


def lengths_of(solution: GuidedSolution) -> dict[str, float]:
    """The links: crank and rocker, the distance of two points of the body (coupler), that of two pins of the ground (ground)."""
    circles = [guide for guide in solution.linkage.guides if isinstance(guide, Circle)]
    found = {name: one.radius for name, one in zip(("crank", "rocker"), circles)}
    points = [guide.body_point for guide in solution.linkage.guides if not isinstance(guide, Slot)]
    if len(points) == 2:
        found["coupler"] = abs(points[1] - points[0])
    pins = [_pin(guide) for guide in solution.linkage.guides if not isinstance(guide, Rail)]
    if len(pins) == 2:
        found["ground"] = abs(pins[1] - pins[0])
    return found


def _slot_ends(solution: GuidedSolution, ends: tuple[Used, Used]) -> list[complex]:
    """Both ends of the used part of each slot, in the body."""
    return [
        complex(guide.body_point + end * np.exp(1j * guide.body_direction))
        for guide, used in zip(solution.linkage.guides, ends)
        if isinstance(guide, Slot) and used is not None
        for end in used
    ]


def _pin(guide: Guide) -> complex:
    assert not isinstance(guide, Rail)
    return guide.pivot if isinstance(guide, Circle) else guide.pin


def broken_limits(solution: GuidedSolution, samples: Samples, limits: Limits) -> dict[str, float]:
    """By how much a linkage breaks limits over what it uses, by name: as a part of the motion's extent, or in radians."""
    broken = _broken(solution, samples, limits, _no_more_than(solution))
    return _broken(solution, samples, limits, used_of(solution)) if broken.keys() & _BY_ENDS else broken


def _broken(solution: GuidedSolution, samples: Samples, limits: Limits, ends: tuple[Used, Used]) -> dict[str, float]:
    """The same where the used parts of rails and slots are known."""
    extent, middle = samples.extent, samples.middle
    linkage = solution.linkage
    missing: dict[str, float] = {}

    def least(name: str, by: float) -> None:
        if by > _ROUNDING:
            missing[name] = max(missing.get(name, 0.0), by)

    least("transmission_angle_min", limits.transmission_angle_min - solution.transmission_angle_min)
    if solution.transmission_angle_min == 0.0:
        least("transmission_angle_min", 1.0)
    turn = solution.transmission_angle_min_turn
    if turn is not None and linkage.driver is Driver.CRANK:
        least("transmission_angle_min_turn", limits.transmission_angle_min_turn - turn)
    for guide, name in zip(linkage.guides, ("pivot_a", "pivot_b")):
        if isinstance(guide, Rail):
            continue
        place = _pin(guide)
        if (given := getattr(limits, name)) is not None:
            least(name, abs(place - given) / extent)
        elif (box := limits.box(name)) is not None:
            least("pivot_box", _outside(place, box) / extent)
        reach = limits.pivot_reach
        if reach is not None and (far := getattr(reach, name)) is not None:
            least("pivot_reach", (abs(place - reach.middle) - far) / extent)
        for out in limits.keep_out:
            least("keep_out", -_outside(place, out) / extent)
    for guide, used in zip(linkage.guides, ends):
        if used is None:
            continue
        if limits.stroke_max is not None:
            least("stroke_max", (used[1] - used[0] - limits.stroke_max) / extent)
        if isinstance(guide, Rail):
            for end in used:
                place = complex(guide.point + end * np.exp(1j * guide.direction))
                if limits.rail_box is not None:
                    least("rail_box", _outside(place, limits.rail_box) / extent)
                if limits.pivot_reach is not None:
                    least("pivot_reach", abs(place - middle) / extent - REACH)
    if linkage.driver is Driver.CYLINDER:
        used = ends[0]
        assert used is not None
        low, high = sorted(np.abs(used)) if used[0] * used[1] > 0 else (0.0, max(np.abs(used)))
        least("cylinder_dead_length", ((limits.cylinder_dead_length or 0.0) - low) / extent)
        least("cylinder_extended_max", (high - (limits.cylinder_extended_max or np.inf)) / extent)
    if limits.arm_min is not None and isinstance(linkage.guides[1], Slot) and linkage.driver is not Driver.HINGE:
        q = linkage.start + linkage.over(solution.interval)
        least("arm_min", (limits.arm_min - float(np.nan_to_num(np.min(linkage.body(q).arm)))) / extent)
    _lengths(solution, limits, extent, ends, least)
    if limits.envelope is not None:
        q = linkage.start + linkage.over(solution.interval)
        for way in _traced(linkage, q):
            box = limits.envelope
            least("envelope", float(np.max([_outside(one, box) for one in way])) / extent)
    return missing


def _lengths(
    solution: GuidedSolution,
    limits: Limits,
    extent: float,
    ends: tuple[Used, Used],
    least: Callable[[str, float], None],
) -> None:
    lengths = lengths_of(solution)
    for length in lengths.values():
        least("link_max", (length - (limits.link_max or np.inf)) / extent)
        least("link_min", ((limits.link_min or 0.0) - length) / extent)
    for name, given in zip(("crank", "coupler", "rocker", "ground"), limits.links):
        if given is not None and name in lengths:
            least(f"links.{name}", abs(lengths[name] - given) / extent)
    if limits.link_ratio_max is not None and len(lengths) > 1:
        least("link_ratio_max", max(lengths.values()) / min(lengths.values()) / limits.link_ratio_max - 1)
    body = [guide.body_point for guide in solution.linkage.guides if not isinstance(guide, Slot)]
    for point in (*body, *_slot_ends(solution, ends)):
        least("link_max", (abs(point) - (limits.link_max or np.inf)) / extent)
    first = solution.linkage.guides[0]
    if limits.coupler_radius_max is not None and not isinstance(first, Slot):
        least("coupler_radius_max", (abs(first.body_point) - limits.coupler_radius_max) / extent)


def _traced(linkage: GuidedLinkage, q: Floats) -> list[Complexes]:
    """Where the body point and both joints are."""
    body = linkage.body(q)
    turned = np.exp(1j * body.rotation)
    found = [body.position]
    for guide in linkage.guides:
        found.append(np.array([guide.pin]) if isinstance(guide, Slot) else body.position + turned * guide.body_point)
        if isinstance(guide, Circle):
            found.append(np.array([guide.pivot]))
    return found


def _outside(place: complex, box: Box) -> float:
    """How far a place lies outside of a box; negative inside: how far from its nearest side."""
    return max(box[0] - place.real, box[1] - place.imag, place.real - box[2], place.imag - box[3])
