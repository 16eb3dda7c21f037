"""Geometry of a linkage that all files share: pins, rails and slots over the used interval, and the requested poses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.errors import FieldError
from synthesis.guides import Kind, Rail, Slot
from synthesis.link_motion import LinkMotion
from synthesis.linkage import Linkage
from synthesis.target import TURN, Interval, Target

FARTHEST = 1e9
"""Largest distance of a fixed point from the origin, in lengths of the linkage, at which coordinates still resolve its shape."""
LARGEST_MM = 1e12
"""Largest coordinate of a DXF or MJCF file in millimetres: beyond, their readers lose digits."""
_OVERHANG = 0.06
"""Fraction of the size by which rails and slots extend beyond their used ends."""
SLIDER_LENGTH = 0.05
"""Half the length of a slider or block, as a fraction of the size."""


@dataclass(frozen=True)
class Layout:
    """A linkage over the used interval of a motion, and at its first sample."""

    linkage: Linkage
    links: tuple[LinkMotion, ...]
    """Moving links over the used interval."""
    first: tuple[LinkMotion, ...]
    """Moving links at the first sample."""
    strokes: tuple[tuple[float, float] | None, tuple[float, float] | None]
    """Smallest and largest used coordinate of each rail or slot; None for a circle."""

    @property
    def body(self) -> LinkMotion:
        """Return the body at the first sample."""
        return self.first[1]

    @cached_property
    def path(self) -> Complexes | None:
        """Return the path of the body point over the used interval; None without a body point."""
        return self.links[1].origin if self.linkage.mounted else None

    @cached_property
    def pins(self) -> tuple[complex, complex]:
        """Return for each guide its body point at the first sample, or the fixed pin of a slot."""
        first, second = (complex(pins_of(self.linkage, index, self.body)[0]) for index in (0, 1))
        return first, second

    @cached_property
    def size(self) -> float:
        """Return the largest length of a link or of a used part of a rail or slot."""
        lengths = [*self.linkage.lengths.values(), *(high - low for low, high in filter(None, self.strokes))]
        return max([*lengths, *([] if self.ground is None else [self.ground[0]])])

    @cached_property
    def fixed(self) -> dict[str, complex]:
        """Return the fixed points by name: pivots of circles and pins of slots."""
        guides = zip("AB", self.linkage.guides)
        return {name: guide[0] for name, guide in guides if guide.has_pin}

    @cached_property
    def moving(self) -> dict[str, complex]:
        """Return the moving pins by name: body points on circles and rails."""
        guides = zip("DC", self.linkage.guides, self.pins)
        return {name: pin for name, guide, pin in guides if guide.holds_point}

    @cached_property
    def ground(self) -> tuple[float, complex, complex] | None:
        """Return length and ends of the ground line; None if a guide is a rail."""
        if len(self.fixed) < 2:
            return None
        first, second = self.linkage.local_guides
        return abs(second[0] - first[0]), self.fixed["A"], self.fixed["B"]

    @cached_property
    def bars(self) -> list[tuple[float, complex, complex]]:
        """Return length and ends of crank, coupler and rocker, without links that slide or carry a slot."""
        lengths, joints, names = self.linkage.lengths, self.fixed | self.moving, self.linkage.link_names
        ends = zip(names, (("A", "D"), ("D", "C"), ("C", "B")))
        return [(lengths[name], joints[a], joints[b]) for name, (a, b) in ends if a in joints and b in joints]

    def track(self, index: int) -> Complexes | None:
        """Return both ends of a rail, or of a slot at the first sample; None for a circle."""
        guide, stroke = self.linkage.guides[index], self.strokes[index]
        if stroke is None:
            return None
        ends = np.array([stroke[0] - _OVERHANG * self.size, stroke[1] + _OVERHANG * self.size])
        if not guide.holds_point:
            return self.body.position(0j)[0] + self.body.direction[0] * guide.body_at(ends)
        return guide.ground_at(ends)

    def tracks(self, kind: type[Rail] | type[Slot]) -> list[Complexes]:
        """Return the ends of all rails, or of all slots."""
        tracks = [self.track(index) for index in (0, 1) if isinstance(self.linkage.guides[index], kind)]
        return [track for track in tracks if track is not None]

    @cached_property
    def blocks(self) -> list[Complexes]:
        """Return the corners of each slider and of the block of each slot, at the first sample."""
        half = self.size * SLIDER_LENGTH / 2
        corners = np.array([-2 - 1j, 2 - 1j, 2 + 1j, -2 + 1j]) * half / 1.5
        blocks = []
        for guide, pin in zip(self.linkage.guides, self.pins):
            if guide.slides:
                along = -1j * guide.push(self.body.origin, self.body.direction)[0]
                blocks.append(pin + corners * along)
        return blocks

    @cached_property
    def outline(self) -> Complexes:
        """Return the body at the first sample: its guided points, or the middle of a slot, and the body point."""
        corners = list(self.pins)
        for index, guide in enumerate(self.linkage.guides):
            track = self.track(index)
            if not guide.holds_point and track is not None:
                corners[index] = complex(track.mean())
        return np.array([*corners, *([self.body.origin[0]] if self.linkage.mounted else [])])

    def check_size(self, unit_mm: float) -> None:
        """Raise `FieldError` for a linkage whose coordinates in millimetres a reader of the file would not resolve."""
        points = [
            *self.links[1].origin,
            *self.links[1].position(self.linkage.guides[1].body_point),
            *self.fixed.values(),
        ]
        if not 1e-9 <= self.size * unit_mm or not float(np.max(np.abs(points))) * unit_mm <= LARGEST_MM:
            raise FieldError("/length_unit", f"must give a drawing between 1e-9 and {LARGEST_MM:.0e} mm in size")


def layout_of(linkage: Linkage, interval: Interval) -> Layout:
    """Return the layout of a linkage over an interval of travel from its first sample.

    Raises
    ------
    FieldError
        For a linkage that is too far from the origin, or that does not close at a position of the interval.
    """
    links = closed_motions(linkage, interval)
    first, second = (
        linkage.used(index, interval) if guide.slides else None for index, guide in enumerate(linkage.guides)
    )
    return Layout(linkage, links, linkage.motions(np.zeros(1)), (first, second))


def closed_motions(linkage: Linkage, interval: Interval) -> tuple[LinkMotion, ...]:
    """Return the moving links over an interval of travel; `FieldError` as in `layout_of`."""
    travel, four_bar = linkage.travel_over(interval), linkage.kind is Kind.FOUR_BAR
    for index, guide in enumerate(linkage.guides):
        if not max(abs(guide[0].real), abs(guide[0].imag)) <= FARTHEST * linkage.reach:
            field = "mount/pivot_a" if four_bar else f"guides/{index}"
            raise FieldError(
                f"/solution/{field}", f"lies more than {FARTHEST:.0e} link lengths from the origin; move the origin"
            )
    links = linkage.motions(travel)
    closed = np.isfinite(links[1].angle)
    if not closed.all():
        opening = travel[int(np.argmin(closed))]
        where = f"{np.rad2deg(opening):.6g} degrees" if linkage.driver.turns else f"{opening:.6g}"
        field, words = "guides", "both guides cannot hold the body"
        if four_bar:
            field, words = "links", "the four links do not close"
        raise FieldError(f"/solution/{field}", f"{words} {where} after the start")
    return links


def pins_of(linkage: Linkage, index: int, body: LinkMotion) -> Complexes:
    """Return the body point of a guide at each position (n,), or the fixed pin of a slot."""
    return linkage.guides[index].contact(body.origin, body.direction)


def turn_path(linkage: Linkage) -> Complexes | None:
    """Return the path of the body point over a whole turn of the drive; None without one, or if the drive cannot turn fully."""
    if not linkage.mounted or not linkage.turns_fully:
        return None
    path = linkage.body(linkage.start + linkage.travel_over(Interval(0.0, TURN))).position
    return path if np.all(np.isfinite(path)) else None


def requested_positions(target: Target) -> Complexes:
    """Return the requested positions, without missing samples."""
    position = target.requested.position
    return np.empty(0, dtype=complex) if position is None else position[np.isfinite(position)]


def requested_poses(target: Target, turned: Floats) -> Iterable[tuple[complex, float]]:
    """Return position and rotation of each requested pose; ``turned`` (N,) replaces rotations that were not requested."""
    rotation, positions, _ = target.requested
    if positions is None:
        return []
    rotations = turned if rotation is None else np.where(np.isnan(rotation), turned, rotation)
    return ((position, turn) for position, turn in zip(positions, rotations) if np.isfinite(position))


def name_of(linkage: Linkage) -> str:
    """Return the name of a linkage for titles."""
    return f"{linkage.kind.replace('_', '-')} linkage"


def unit_in_words(length_unit: str | None) -> str:
    """Return the end of a title that names the unit of lengths, if it is known."""
    return f"; lengths in {length_unit}" if length_unit else ""
