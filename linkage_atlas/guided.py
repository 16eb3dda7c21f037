"""A body on two guides as a user handles it: cranks, rails and slots, angles in degrees (or radians), drawings and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.any_linkage import AnyLinkage
from linkage_atlas.arguments import column, number, one_of, pair, radians_in
from linkage_atlas.motions import Motion
from linkage_atlas.records import plain, plane, xy
from linkage_atlas.studies import GuidedAnalysis, read_analysis
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.guided import linkage as guided
from synthesis.guided.linkage import DRIVERS, Circle, Driver, Guide, Rail, Slot
from synthesis.guided.solution import as_target
from synthesis.target import Interval, Target

DriverName = Literal["crank", "slider", "cylinder", "hinge"]
OtherKindName = Literal["slider_crank", "swinging_block", "rail_slot", "two_rails", "two_slots"]
KindName = Literal["four_bar", OtherKindName]
LARGEST = 1e100
"""Of a place or a length that is given."""


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
    """The least and the largest place on the rail, from its point along its direction, over the used interval."""


class SlotGuide(NamedTuple):
    """A line of the body through a fixed pin."""

    guide: Literal["slot"]
    pin: tuple[float, float]
    body_point: tuple[float, float]
    """A point of the line in the body's frame."""
    body_direction: float
    """Angle of the line in the body's frame."""
    used: tuple[float, float] | None
    """The least and the largest place of the pin in the slot, from the body point along its direction, over the used interval."""


AnyGuide = CircleGuide | RailGuide | SlotGuide


def guides_of(linkage: guided.GuidedLinkage, radian: float, used: Interval | None) -> list[AnyGuide]:
    """The guides of a linkage, the driven one first, in the user's unit of angle; ``used``: travel from the first sample."""

    def ends(place: int) -> tuple[float, float] | None:
        return None if used is None else linkage.used(place, used)

    found: list[AnyGuide] = []
    for place, one in enumerate(linkage.guides):
        point = xy(one.body_point)
        if isinstance(one, Circle):
            found.append(CircleGuide("circle", xy(one.pivot), one.radius, point))
        elif isinstance(one, Rail):
            found.append(RailGuide("rail", xy(one.point), one.direction / radian, point, ends(place)))
        else:
            found.append(SlotGuide("slot", xy(one.pin), point, one.body_direction / radian, ends(place)))
    return found


class GuidedJoints(NamedTuple):
    """Where a body on two guides is at n places of the drive; NaN where the loop does not close. Angles in the linkage's unit."""

    body_point: Floats
    """(n, 2): the origin of the body's frame, the requested position."""
    rotation: Floats
    """(n,): of the body."""
    guided: tuple[Floats, Floats]
    """(n, 2) of each guide: its body point on a circle or rail, its fixed pin in a slot."""
    drive: Floats
    """(n,): the drive's coordinate, an angle or a length."""
    transmission_angle: Floats
    arm: Floats
    """(n,): moment arm of the second guide's push about the driven guide's pin."""


class GuidedLinkage(AnyLinkage):
    """A body held by two guides, the first of them driven.

    Parameters
    ----------
    guides : sequence of two mappings
        As a reply has them: ``guide`` "circle" with ``pivot``, ``radius``, ``body_point``; "rail" with ``point``, ``direction``,
        ``body_point``; "slot" with ``pin``, ``body_point``, ``body_direction``. Body points are in the body's frame.
    driver : {"crank", "slider", "cylinder", "hinge"}
        What moves the first guide: a crank its circle, a slider its rail, a cylinder or a hinge its slot.
    branch : int
        Sign of the sine of the transmission angle.
    start : float
        The drive's coordinate at the first sample: the direction of crank or slot in the plane, the place along rail or slot.
    degrees : bool
        Unit of every angle in and out.

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> crank = {"guide": "circle", "pivot": [0, 0], "radius": 1, "body_point": [0, 0]}
    >>> rail = {"guide": "rail", "point": [0, 0.3], "direction": 0, "body_point": [2, 0]}
    >>> pump = la.GuidedLinkage([crank, rail], "crank")
    >>> pump.kind, pump.turns_fully
    ('slider_crank', True)
    >>> pump.joints([50]).rotation.round(6).tolist()
    [-13.475068]
    """

    _linkage: guided.GuidedLinkage
    _drive = "drive"

    def __init__(
        self,
        guides: Sequence[Mapping[str, Any] | AnyGuide],
        driver: str,
        branch: int = 1,
        start: float = 0.0,
        *,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        if isinstance(guides, (str, Mapping)) or len(guides) != 2:
            raise FieldError("/guides", f"wanted two guides, found {len(guides)}")
        read = [read_guide(f"guides/{place}", one, radian) for place, one in enumerate(guides)]
        if Driver(one_of("driver", driver, get_args(DriverName))) not in (known := DRIVERS[type(read[0])]):
            what = type(read[0]).__name__.lower()
            raise FieldError(
                "/driver", f"the first guide is a {what}, driven by {' or '.join(known)}, found {driver!r}"
            )
        if branch not in (-1, 1):
            raise FieldError("/branch", f"wanted 1 or -1, found {branch}")
        turns = Driver(driver).turns
        begin = number("start", start) * (radian if turns else 1.0)
        self._linkage = guided.GuidedLinkage((read[0], read[1]), Driver(driver), int(branch), begin)
        check_apart(self._linkage)
        self._radian = radian
        self._motion: Target | None = None

    @property
    def plain(self) -> guided.GuidedLinkage:
        """The same in radians, as the numerics have it."""
        return self._linkage

    # -- what it is ---------------------------------------------------------------------------------------------------

    @property
    def kind(self) -> str:
        """Which guides it has: slider_crank, swinging_block, rail_slot, two_rails, two_slots or four_bar."""
        return self._linkage.kind.value

    @property
    def driver(self) -> str:
        """What moves the first guide: crank, slider, cylinder or hinge."""
        return self._linkage.driver.value

    @property
    def start(self) -> float:
        """The drive's coordinate at the first sample."""
        return self._linkage.start / self._unit

    @property
    def guides(self) -> list[AnyGuide]:
        """The guides, the driven one first, with the parts of rails and slots that the motion uses, where it answers one."""
        used = None if self._motion is None else self._motion.interval
        return guides_of(self._linkage, self._radian, used)

    @property
    def _unit(self) -> float:
        """Radians in the unit of the drive's coordinate; 1 for a length."""
        return self._radian if self._linkage.driver.turns else 1.0

    # -- how it moves -------------------------------------------------------------------------------------------------

    def joints(self, travel: ArrayLike) -> GuidedJoints:
        """Where the body and its guided points are.

        Parameters
        ----------
        travel : array_like, shape (n,) or a number
            Of the drive from its start on: angles of a crank or hinge, lengths of a slider or cylinder.
        """
        one = self._linkage
        q = one.start + np.atleast_1d(column("travel", travel)) * self._unit
        found = one.body(q)
        turned = np.exp(1j * found.rotation)
        points = [
            plane(np.where(np.isfinite(found.rotation), guide.pin, np.nan))
            if isinstance(guide, Slot)
            else plane(found.position + turned * guide.body_point)
            for guide in one.guides
        ]
        return GuidedJoints(
            plane(found.position),
            found.rotation / self._radian,
            (points[0], points[1]),
            q / self._unit,
            found.transmission_angle / self._radian,
            found.arm,
        )

    def transmission_angle_min(self, first: float | None = None, last: float | None = None) -> float:
        """The smallest transmission angle over travel of the drive, exactly; NaN where it opens.

        Default: over the motion that it answers, or else over a whole turn.
        """
        if first is None or last is None:
            interval = self._default_motion().interval
        ends = [
            interval.first if first is None else first * self._unit,
            interval.last if last is None else last * self._unit,
        ]
        return self._linkage.transmission_angle_over(Interval(*ends).after(self._linkage.start)) / self._radian

    def analysis(
        self, speed: float, load: Mapping[str, Any] | None = None, travel: ArrayLike | None = None
    ) -> GuidedAnalysis:
        """Velocities, accelerations and, with a load, the torque or force of the drive and the forces of the guides.

        Parameters
        ----------
        speed : float
            Of the drive, constant: in the unit of angle of a crank or hinge, or the unit of length, a second.
        load : mapping, optional
            ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it.
        travel : array_like, shape (n,), optional
            Of the drive from its start on. Default: the samples of the motion that it answers (or a whole turn), with the
            `curve` over their interval.
        """
        asked = read_analysis({"crank_speed": speed, "load": load}, True)
        found: GuidedAnalysis = self._analysed_at(asked, "travel", travel)
        return found

    # -- what it becomes ----------------------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract; `from_dict` takes them back."""
        return {
            "kind": self.kind,
            "driver": self.driver,
            "guides": plain(self.guides),
            "branch": self.branch,
            "start": self.start,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], degrees: bool = True) -> GuidedLinkage:
        """A linkage from what `to_dict` gives, or from a solution of a reply over HTTP.

        Without ``branch`` and ``start`` there is nothing to go by: they are needed beside ``guides`` and ``driver``.
        """
        for name in ("guides", "driver", "branch", "start"):
            if values.get(name) is None:
                raise FieldError(f"/{name}", "needed")
        return cls(values["guides"], values["driver"], values["branch"], values["start"], degrees=degrees)

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """A motion with the travel of the drive at its samples; without one the default."""
        if motion is None:
            return self._default_motion()
        if motion.free and travel is None:
            name = "crank_angle" if self._linkage.driver.turns else "travel"
            raise FieldError(f"/{name}", "needed: the motion's timing is free")
        place = np.zeros(0) if travel is None else column("travel", travel) * self._unit
        if motion.free and place.shape != (motion.asked.samples,):
            raise FieldError("/travel", f"wanted {motion.asked.samples} numbers, found {place.size}")
        return as_target(motion.samples, self._linkage, place)

    def __repr__(self) -> str:
        words = []
        for one in self.guides:
            if isinstance(one, CircleGuide):
                words.append(f"circle of radius {one.radius:.6g} about {_words(one.pivot)}")
            elif isinstance(one, RailGuide):
                words.append(f"rail through {_words(one.point)} at {one.direction:.6g}")
            else:
                words.append(f"slot on the pin {_words(one.pin)}")
        return f"GuidedLinkage({self.kind} driven by a {self.driver}: {', '.join(words)}, branch={self.branch:+d})"


def read_guide(field: str, given: Mapping[str, Any] | AnyGuide, radian: float) -> Guide:
    """A checked guide as the numerics have it; ``used`` is not needed."""
    values: Mapping[str, Any] = given if isinstance(given, Mapping) else given._asdict()
    sort = one_of(f"{field}/guide", values.get("guide"), ("circle", "rail", "slot"))

    def place(name: str) -> complex:
        return pair(f"{field}/{name}", values.get(name, ()), LARGEST)

    def amount(name: str) -> float:
        if values.get(name) is None:
            raise FieldError(f"/{field}/{name}", "needed")
        return number(f"{field}/{name}", values[name])

    point = place("body_point")
    if sort == "circle":
        if not 0 < amount("radius") <= LARGEST:
            raise FieldError(f"/{field}/radius", f"wanted a length above 0, found {values['radius']}")
        return Circle(place("pivot"), amount("radius"), point)
    if sort == "rail":
        return Rail(place("point"), amount("direction") * radian, point)
    return Slot(place("pin"), point, amount("body_direction") * radian)


def check_apart(linkage: guided.GuidedLinkage) -> None:
    """FieldError for two guides that hold the body to one condition, or that never let it turn."""
    first, second = linkage.guides
    alike = isinstance(first, (Circle, Rail)) and isinstance(second, (Circle, Rail))
    if alike and first.body_point == second.body_point:
        raise FieldError("/guides/1/body_point", "both guides lead the same point of the body")
    if isinstance(first, (Circle, Slot)) and isinstance(second, (Circle, Slot)) and first[0] == second[0]:
        raise FieldError("/guides/1", "both guides go by the same fixed place")
    if (
        isinstance(first, Rail)
        and isinstance(second, Rail)
        and abs(np.sin(first.direction - second.direction)) < 1e-3
    ):
        raise FieldError("/guides/1/direction", "the rails are parallel: the body cannot turn")
    if isinstance(first, Slot) and isinstance(second, Slot):
        if abs(np.sin(first.body_direction - second.body_direction)) < 1e-3:
            raise FieldError("/guides/1/body_direction", "the slots are parallel: the body cannot turn")


def _words(point: tuple[float, float]) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"
