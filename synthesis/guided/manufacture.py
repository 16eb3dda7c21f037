"""Linkages on two guides as they are made against as they are designed: poses with dimensions off, derivatives, play.

The drive stands where it should; the other guide is then met by Newton's method from the pose as designed, for many linkages at
once. Deviations: radii and body points (a slot's line among them) by the tolerance of lengths, fixed pivots, pins and rails by
that of places, and play at both ends of each guide, which moves its fixed place in a direction that does not turn.
Directions of rails and slots are exact but for what their body points do.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.fourbar.tolerance_study import Study, Tolerances, compared
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.target import TURN
from synthesis.work import Work

_STEPS = 12
"""Of Newton's method at most."""
_SMALL = 1e-8
"""A step shorter than this is the last: the next would be its square."""
_CLOSED = 1e-9
"""Of the linkage's size: a loop that is not met closer than this is open."""
_STEP = 1e-6
"""Of the linkage's size: half the difference of two linkages whose motions are compared for a derivative."""


class Deviation(NamedTuple):
    """A change of one guide of many linkages, (count, 1) each or numbers."""

    radius: Floats | float = 0.0
    body_point: Complexes | complex = 0j
    fixed: Complexes | complex = 0j
    """Of its pivot, point or pin."""
    direction: Floats | float = 0.0
    """Of a rail, or of a slot in the body."""


class Source(NamedTuple):
    """What contributes to an error: a real number, or a place in the plane."""

    name: str
    guide: int
    what: str
    """Field of `Deviation`."""
    size: str
    """Which of `Tolerances` it keeps to."""


_SOURCES = {
    Circle: (
        ("{} length", "radius", "links"),
        ("{} body point", "body_point", "links"),
        ("{} pivot", "fixed", "pivots"),
        ("clearance at the {} pivot", "fixed", "clearance"),
        ("clearance at the {} pin", "fixed", "clearance"),
    ),
    Rail: (
        ("{} body point", "body_point", "links"),
        ("{} rail", "fixed", "pivots"),
        ("clearance at the {} pin", "fixed", "clearance"),
        ("clearance in the {} rail", "fixed", "clearance"),
    ),
    Slot: (
        ("{} slot", "body_point", "links"),
        ("{} pin", "fixed", "pivots"),
        ("clearance at the {} pin", "fixed", "clearance"),
        ("clearance in the {} slot", "fixed", "clearance"),
    ),
}


def sources_of(linkage: Linkage) -> list[Source]:
    """All sources of a linkage, guide by guide."""
    return [
        Source(words.format(name), place, what, size)
        for place, (name, guide) in enumerate(linkage.named_guides)
        for words, what, size in _SOURCES[type(guide)]
    ]


class _Guide:
    """A guide of many linkages, (count, 1) each."""

    def __init__(self, guide: Guide, off: Deviation) -> None:
        self.sort = type(guide)
        self.fixed = guide[0] + np.atleast_2d(off.fixed)
        self.body_point = guide.body_point + np.atleast_2d(off.body_point)
        self.radius = (guide.radius if isinstance(guide, Circle) else 0.0) + np.atleast_2d(off.radius)
        direction = guide.direction if isinstance(guide, Rail) else 0.0
        direction = guide.body_direction if isinstance(guide, Slot) else direction
        self.direction = direction + np.atleast_2d(off.direction)


def made(linkage: Linkage, coordinate: Floats, first: Deviation, second: Deviation) -> tuple[Complexes, Floats]:
    """Places and rotations (count, n) of the bodies of linkages that are off, at coordinates (n,) of the drive.

    NaN where one does not close near the pose as designed, on its branch. Law: with no deviation `Linkage.body`.
    """
    driven, other = _Guide(linkage.guides[0], first), _Guide(linkage.guides[1], second)
    nominal = linkage.body(coordinate)
    size = linkage.reach
    if linkage.driver.turns:
        coordinate = coordinate + linkage.ground_angle
    with np.errstate(all="ignore"):
        if linkage.driver is Driver.HINGE:
            return _by_hinge(linkage, coordinate, driven, other, size)
        if driven.sort is Circle:
            pin = driven.fixed + driven.radius * np.exp(1j * coordinate)
        elif driven.sort is Rail:
            pin = driven.fixed + coordinate * np.exp(1j * driven.direction)
        else:
            pin = driven.fixed + 0 * coordinate
        held = driven.body_point + 0 * coordinate
        if driven.sort is Slot:
            held = held + coordinate * np.exp(1j * driven.direction)
        begin = nominal.rotation + 0 * np.real(pin)
        rotation, value, slope = _met(lambda turn: _beyond(other, pin, np.exp(1j * turn), held), begin, 1.0)
        turned = np.exp(1j * rotation)
        good = (np.abs(value) < _CLOSED * size) & (np.sign(slope) == linkage.branch)
        position = pin - turned * held
    good = good & np.isfinite(nominal.rotation)
    return np.where(good, position, np.nan), np.where(good, rotation, np.nan)


def _met(off: Callable[[Floats], tuple[Floats, Floats]], begin: Floats, size: float) -> tuple[Floats, Floats, Floats]:
    """Where something vanishes by Newton's method, what is left of it, and its slope; ``size``: of its argument."""
    at = begin
    for _ in range(_STEPS):
        value, slope = off(at)
        step = np.clip(np.nan_to_num(value / slope), -0.3 * size, 0.3 * size)
        at = at - step
        if np.abs(step).max() < _SMALL * size:
            break
    return at, *off(at)


def _off(other: _Guide, at: Complexes, turned: Complexes) -> tuple[Floats, Complexes]:
    """How far the other guide is from being kept with its body point at some place, and the direction in which that is."""
    spoke = at - other.fixed
    if other.sort is Circle:
        push = spoke / np.abs(spoke)
        return np.abs(spoke) - other.radius, push
    push = 1j * np.exp(1j * other.direction) * (turned if other.sort is Slot else 1.0)
    return dot(push, spoke), push


def _beyond(other: _Guide, pin: Complexes, turned: Complexes, held: Complexes) -> tuple[Floats, Floats]:
    """The same where the body is turned about the pin, and its derivative by the rotation."""
    arm = turned * (other.body_point - held)
    value, push = _off(other, pin + arm, turned)
    # a slot turns with the body: its fixed pin is what moves in it
    return value, dot(push, 1j * (other.fixed - pin if other.sort is Slot else arm))


def _by_hinge(
    linkage: Linkage, coordinate: Floats, driven: _Guide, other: _Guide, size: float
) -> tuple[Complexes, Floats]:
    """The slot stands in its direction: the body slides along it until the other guide holds it."""
    along = np.exp(1j * coordinate)
    rotation = coordinate - driven.direction
    turned = np.exp(1j * rotation)
    origin = driven.fixed - turned * driven.body_point
    nominal = linkage.body(coordinate)
    begin = np.real(np.conj(along) * (origin - nominal.position)) + 0 * np.real(origin)
    extension, value, slope = _met(lambda far: _slid(other, origin - far * along, turned, along), begin, size)
    position = origin - extension * along
    good = (np.abs(value) < _CLOSED * size) & (np.sign(-slope) == np.sign(nominal.sine)) & np.isfinite(nominal.sine)
    return np.where(good, position, np.nan), np.where(good, rotation + 0 * np.real(position), np.nan)


def _slid(other: _Guide, position: Complexes, turned: Complexes, along: Complexes) -> tuple[Floats, Floats]:
    """How far the other guide is from being kept, and its derivative by the extension of the slot."""
    value, push = _off(other, position + turned * other.body_point, turned)
    return value, -dot(push, along)


# -- to first order ---------------------------------------------------------------------------------------------------


def slopes(linkage: Linkage, coordinate: Floats, changes: list[tuple[int, Deviation]]) -> tuple[Complexes, Floats]:
    """Derivatives (changes, n) of place and rotation by changes, each of one guide by a unit of its own; NaN where dead."""
    places: list[Complexes] = []
    turns: list[Floats] = []
    size = linkage.reach
    for guide, unit in changes:
        ends = []
        step = _STEP * (1.0 if unit.direction else size)
        for sign in (1.0, -1.0):
            off = Deviation(*(np.array([[sign * step * value]]) for value in unit))
            pair = (off, Deviation()) if guide == 0 else (Deviation(), off)
            ends.append(made(linkage, coordinate, *pair))
        places.append((ends[0][0][0] - ends[1][0][0]) / (2 * step))
        turns.append((ends[0][1][0] - ends[1][1][0]) / (2 * step))
    return np.array(places), np.array(turns)


def dimensions_of(linkage: Linkage) -> list[tuple[str, int, Deviation]]:
    """Every dimension by name, the guide that it belongs to, and a unit of it; directions last, in radians."""
    found: list[tuple[str, int, Deviation]] = []
    turned: list[tuple[str, int, Deviation]] = []
    for place, (name, guide) in enumerate(linkage.named_guides):
        fixed = {Circle: "pivot", Rail: "rail", Slot: "pin"}[type(guide)]
        if isinstance(guide, Circle):
            found.append((f"{name} length", place, Deviation(radius=1.0)))
        else:
            turned.append((f"{name} direction", place, Deviation(direction=1.0)))
        for axis, unit in (("x", 1.0), ("y", 1j)):
            found.append((f"{name} body point {axis}", place, Deviation(body_point=unit)))
            found.append((f"{name} {fixed} {axis}", place, Deviation(fixed=unit)))
    return found + turned


# -- the study --------------------------------------------------------------------------------------------------------


def simulate(
    linkage: Linkage, travel: Floats, samples: int, tolerances: Tolerances, count: int, seed: int, work: Work
) -> Study:
    """Made linkages against the one as designed; arguments and laws as of `fourbar.tolerance_study.simulate`."""
    random = np.random.default_rng(seed)
    sources = sources_of(linkage)
    offs = [Deviation(), Deviation()]
    for source in sources:
        size = float(getattr(tolerances, source.size))
        if source.what == "radius":
            off = size * random.uniform(-1, 1, (count, 1))
        elif source.size == "clearance":
            off = size / 2 * np.exp(1j * random.uniform(0, TURN, (count, 1)))
        else:
            off = size * (random.uniform(-1, 1, (count, 2)) @ [1, 1j])[:, None]
        before = getattr(offs[source.guide], source.what)
        offs[source.guide] = offs[source.guide]._replace(**{source.what: before + off})
    coordinate = linkage.start + travel
    nominal = linkage.body(coordinate)
    first_order = _first_order(linkage, coordinate, sources, tolerances)

    def positions(places: slice) -> tuple[Complexes, Floats]:
        return made(linkage, coordinate[places], offs[0], offs[1])

    return compared((nominal.position, nominal.rotation), positions, first_order, samples, count, work)


def _first_order(
    linkage: Linkage, coordinate: Floats, sources: list[Source], tolerances: Tolerances
) -> tuple[Floats, Floats, Floats]:
    """Derivatives of place (sources, n, 2, 2) and rotation (sources, n, 2, 1) by each source's coordinates; variances."""
    units: dict[tuple[int, str], list[Deviation]] = {}
    for source in sources:
        both = [1.0, 0.0] if source.what == "radius" else [1.0, 1j]
        changed: list[dict[str, Any]] = [{source.what: unit} for unit in both]
        units[source.guide, source.what] = [Deviation(**one) for one in changed]
    known = {key: slopes(linkage, coordinate, [(key[0], unit) for unit in pair]) for key, pair in units.items()}
    rotation = np.stack([known[one.guide, one.what][1].T for one in sources])[..., None]
    place = np.stack([known[one.guide, one.what][0].T for one in sources])
    variances = [
        (tolerances.clearance / 2) ** 2 / 2 if one.size == "clearance" else getattr(tolerances, one.size) ** 2 / 3
        for one in sources
    ]
    return np.stack([place.real, place.imag], axis=-1), rotation, np.array(variances)
