"""Dimensions, joints and motion of a linkage in the units of a user."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import column, read_length_unit
from linkage_atlas.geometry import (
    AnyGuide,
    CircleGuide,
    Dimensions,
    Joints,
    Links,
    RailGuide,
    dimensions_of,
    guides_of,
)
from linkage_atlas.motions import Motion
from linkage_atlas.plotting import plot_linkage
from linkage_atlas.records import plain, plane
from synthesis.arrays import Floats
from synthesis.assembly.linkage_machine import loop_of
from synthesis.cognates import are_cognates
from synthesis.errors import FieldError
from synthesis.free.dyads import in_any_order
from synthesis.guides import Driver, Slot
from synthesis.linkage import Linkage as Plain
from synthesis.poses import Poses
from synthesis.target import TURN, Interval, Target

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TURN_STEPS = 73
"""Number of positions of a whole turn."""
_MARGIN = 0.01
"""Fraction of the way to each dead position by which a linkage is shown over less than its own range."""


class LinkageBase:
    """Dimensions, joints and motion of a linkage; see `linkage_atlas.Linkage`."""

    _linkage: Plain
    _radian: float
    _motion: Target | None
    length_unit: str | None = None
    """Unit of its lengths, taken over from the motion; None if it is unknown: files then take millimetres."""

    @classmethod
    def of(cls, linkage: Plain, radian: float, motion: Target | None, length_unit: str | None = None) -> Self:
        """Return the view of a linkage that answers a motion, whose crank angles are the travel of its drive."""
        view = object.__new__(cls)
        view._linkage, view._radian, view._motion, view.length_unit = linkage, radian, motion, length_unit
        return view

    @property
    def plain(self) -> Plain:
        """The linkage in radians, for the numerics."""
        return self._linkage

    @property
    def degrees(self) -> bool:
        """True if its angles are in degrees; otherwise they are in radians."""
        return self._radian != 1.0

    @property
    def kind(self) -> str:
        """The pair of guides: four_bar, slider_crank, swinging_block, rail_slot, two_rails or two_slots."""
        return self._linkage.kind.value

    @property
    def driver(self) -> str:
        """The drive of the first guide: crank, slider, cylinder or hinge."""
        return self._linkage.driver.value

    @property
    def branch(self) -> int:
        """+1 or -1."""
        return int(self._linkage.branch)

    @property
    def start(self) -> float:
        """The drive's coordinate at the first sample; a direction is measured from the x axis."""
        one = self._linkage
        return (one.start + one.ground_angle) / self._radian if one.driver.turns else one.start

    @property
    def guides(self) -> list[AnyGuide]:
        """The guides, the driven one first, with the used lengths of rails and slots if it answers a motion."""
        used = None if self._motion is None else self._motion.interval
        return guides_of(self._linkage, self._radian, used)

    @property
    def turns_fully(self) -> bool:
        """True if its drive turns, and can turn fully."""
        return bool(self._linkage.turns_fully)

    @property
    def _drive(self) -> str:
        """Name of its drive in sentences."""
        return "crank" if self._linkage.driver is Driver.CRANK else "drive"

    @property
    def way(self) -> Floats | None:
        """Travel of the drive over its motion in radians or lengths, (n,); None without a motion."""
        return None if self._motion is None else self._motion.way

    @property
    def _unit(self) -> float:
        """Factor from the user's unit of the drive's coordinate to radians; 1 for a length."""
        return self._radian if self._linkage.driver.turns else 1.0

    def _length(self, name: str) -> float:
        lengths = self._linkage.lengths
        if name not in lengths:
            raise AttributeError(f"a {self.kind} has no {name}")
        return lengths[name]

    def _four_bar(self, name: str) -> Plain:
        if not self._linkage.is_four_bar:
            raise AttributeError(f"a {self.kind} has no {name}; see `guides`")
        return self._linkage

    @property
    def crank(self) -> float:
        """Length of the crank."""
        return self._length("crank")

    @property
    def coupler(self) -> float:
        """Distance of the two guided points of the body."""
        return self._length("coupler")

    @property
    def rocker(self) -> float:
        """Length of the rocker."""
        return self._length("rocker")

    @property
    def ground(self) -> float:
        """Distance of the fixed pivots of a four-bar."""
        return self._four_bar("ground").links[3]

    @property
    def links(self) -> Floats:
        """Crank, coupler, rocker and ground of a four-bar, shape (4,)."""
        return np.array(self._four_bar("links").links)

    @property
    def start_angle(self) -> float:
        """Angle of the crank from the ground line at the first sample."""
        return self._four_bar("start_angle").start / self._radian

    @property
    def ground_angle(self) -> float:
        """Angle of the line from pivot A to pivot B."""
        return self._four_bar("ground_angle").ground_angle / self._radian

    @property
    def pivot_a(self) -> Floats:
        """Fixed pivot or pin of the driven guide, or the point of its rail, shape (2,)."""
        return plane(self._linkage.guides[0][0])

    @property
    def pivot_b(self) -> Floats:
        """Fixed pivot or pin of the other guide, or the point of its rail, shape (2,)."""
        return plane(self._linkage.guides[1][0])

    @property
    def coupler_point_polar(self) -> tuple[float, float] | None:
        """Radius and angle of the body point in the coupler's frame."""
        point = self._four_bar("coupler_point_polar").coupler_point_polar
        return None if point is None else (point[0], point[1] / self._radian)

    @property
    def body_offset(self) -> float | None:
        """Rotation of the body minus coupler angle and ground angle."""
        offset = self._four_bar("body_offset").body_offset
        return None if offset is None else offset / self._radian

    @property
    def family(self) -> str:
        """Grashof family: crank_rocker, double_crank, ..."""
        return str(self._four_bar("family").family)

    def is_cognate_of(self, other: LinkageBase) -> bool:
        """Check whether both are Roberts cognates: different linkages whose body points draw the same curve."""
        both = self._linkage, other._linkage
        return all(linkage.is_four_bar and linkage.mounted for linkage in both) and are_cognates(*both)

    def joints(self, travel: ArrayLike) -> Joints:
        """Return the positions of the joints and of the body.

        Parameters
        ----------
        travel : array_like, any shape
            Travel of the drive from its start: angles of a crank or hinge, lengths of a slider or cylinder. A number is taken as
            shape (1,).

        Returns
        -------
        Joints
            Arrays in the shape of ``travel``, points with x and y along a further axis.
        """
        one = self._linkage
        travel = np.atleast_1d(column("travel", travel)) * self._unit
        first, body, second = one.motions(travel.ravel())
        found = one.body(one.start + travel.ravel())

        def shaped(values: Any) -> Any:
            return np.reshape(values, travel.shape)

        pins = [
            link.origin if isinstance(guide, Slot) else body.place(guide.body_point)
            for guide, link in zip(one.guides, (first, second))
        ]
        line = one.ground_angle if one.driver.turns else 0.0
        return Joints(
            pivot_a=self.pivot_a,
            pivot_b=self.pivot_b,
            crank_pin=plane(shaped(pins[0])),
            coupler_pin=plane(shaped(pins[1])),
            body_point=plane(shaped(body.origin)) if one.mounted else None,
            crank_direction=shaped(first.angle) / self._radian,
            coupler_direction=shaped(body.angle - (one.body_offset or 0.0)) / self._radian,
            rocker_direction=shaped(second.angle) / self._radian,
            rotation=shaped(body.angle) / self._radian,
            transmission_angle=shaped(found.transmission_angle) / self._radian,
            drive=(one.start + travel + line) / self._unit,
            arm=shaped(found.arm),
        )

    def plot(self, ax: Axes | None = None, travel: ArrayLike | None = None, *, names: bool = True) -> Axes:
        """Draw the linkage with matplotlib (extra ``plot``), with the path of its body point.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; default: the current axes.
        travel : array_like, shape (n,), optional
            Travel of the drive from its start, as in `joints`, of the positions to draw; default: the start.
        names : bool
            Whether the joints A, B, C and D of a four-bar are named.

        Returns
        -------
        matplotlib.axes.Axes
        """
        values = np.zeros(1) if travel is None else np.atleast_1d(column("travel", travel)) * self._unit
        used = None if self._motion is None else self._motion.interval
        return plot_linkage(self._linkage, ax, values, used, names=names)

    def transmission_angle_min(self, first: float | None = None, last: float | None = None) -> float:
        """Return the smallest transmission angle over travel of the drive, exactly; NaN if the loop opens.

        Default: over a whole turn of a crank or hinge, or the motion that the linkage answers.
        """
        interval = Interval(0.0, TURN)
        if (first is None or last is None) and not (self._linkage.is_four_bar or self._motion is None):
            interval = self._motion.interval
        ends = [
            interval.first if first is None else first * self._unit,
            interval.last if last is None else last * self._unit,
        ]
        return self._linkage.transmission_angle_min(Interval(*ends)) / self._radian

    @property
    def dimensions(self) -> Dimensions:
        """Guides, drive, branch and start, and the lengths and mount of a four-bar, under the names of the HTTP contract."""
        return dimensions_of(self._linkage, self._radian, None if self._motion is None else self._motion.interval)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values under the names of the HTTP contract; `Linkage.from_dict` takes them back."""
        return dict(plain(self.dimensions))

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """Return a motion with the travel of the drive at its samples.

        Without a motion, or without the travel of a free motion, it is the motion that the linkage answers, or its own range.
        """
        linkage = self._linkage
        if travel is None and motion is not None and not linkage.driver.turns:
            travel = motion.travel
        if motion is None or (motion.free and travel is None):
            return self._default_motion()
        name = "crank_angle" if linkage.driver.turns else "travel"
        positions = np.zeros(0) if travel is None else column(name, travel) * self._unit
        if motion.free and positions.shape != (motion.asked.samples,):
            raise FieldError(f"/{name}", f"wanted {motion.asked.samples} numbers, found {positions.size}")
        samples = motion.samples
        if isinstance(samples, Poses) and not samples.ordered and linkage.driver.turns:
            positions = in_any_order(positions[None], TURN)[0][0]
            positions = positions - positions[0]
        return motion.over(linkage, positions).target

    def _default_motion(self) -> Target:
        """Return the motion that it answers, or a whole turn, or a drive's range between its dead positions."""
        if self._motion is not None:
            return self._motion
        if self.turns_fully:
            return Target(None, None, crank=np.linspace(0.0, TURN, _TURN_STEPS))
        loop = loop_of(self._linkage, Interval(0.0, 0.0)) if self._linkage.driver.turns else None
        if loop is None:
            raise FieldError(
                "/motion", f"this {self._drive} has no range of its own: give the motion to show it over"
            )
        range_shown = (1 - _MARGIN) * np.linspace(loop.first, loop.last, _TURN_STEPS)
        return Target(None, None, crank=range_shown, found=True)

    def unit_for(self, motion: Motion | None, length_unit: str | None) -> str | None:
        """Return the unit of lengths that is given, or that of the motion or of the linkage; None if it is unknown."""
        own = self.length_unit if motion is None or motion.length_unit is None else motion.length_unit
        return own if length_unit is None else read_length_unit(length_unit)

    def __repr__(self) -> str:
        if self._linkage.is_four_bar:
            lengths = ", ".join(f"{name}={getattr(self, name):.6g}" for name in Links._fields)
            return f"FourBar({lengths}, branch={self.branch:+d}: {self.family})"
        words = ", ".join(map(_in_words, self.guides))
        return f"Linkage({self.kind} driven by a {self.driver}: {words}, branch={self.branch:+d})"


def _in_words(guide: AnyGuide) -> str:
    if isinstance(guide, CircleGuide):
        return f"circle of radius {guide.radius:.6g} about {_point_in_words(guide.pivot)}"
    if isinstance(guide, RailGuide):
        return f"rail through {_point_in_words(guide.point)} at {guide.direction:.6g}"
    return f"slot on the pin {_point_in_words(guide.pin)}"


def _point_in_words(point: tuple[float, float]) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"
