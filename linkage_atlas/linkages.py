"""Linkages as users handle them, four-bars and bodies on guides: angles in degrees or radians, plain arrays, drawings, files."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import (
    check_names,
    column,
    millimetres_in,
    number,
    one_of,
    pair,
    pointing,
    radians_in,
    read_length_unit,
)
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.formats import FORMATS, HELD, OF_PARTS, kind_of
from linkage_atlas.motions import Motion
from linkage_atlas.part_settings import PartSettings
from linkage_atlas.plotting import plot_linkage
from linkage_atlas.records import Record, plain, plane, xy
from linkage_atlas.solids import SLIDES, AskedSolids, SolidParts, read_solids, solids_in, split
from linkage_atlas.studies import (
    AskedAnalysis,
    Manufacture,
    ToleranceStudy,
    analysed,
    read_analysis,
    read_manufacture,
    studied,
)
from synthesis.arrays import Floats, cross
from synthesis.assembly.linkage_machine import loop_of
from synthesis.assembly.sizes import plate_sizes
from synthesis.drives.attached import COLOUR, LAYER, Attached
from synthesis.drives.links import GROUND, LinkMotions, ends_of, motions_at
from synthesis.drives.six_bar import Motor, SixBar
from synthesis.errors import FieldError
from synthesis.export.drawings import to_dxf, to_svg
from synthesis.export.simulation import ONLY_FOUR_BARS, to_mjcf, to_pylinkage
from synthesis.export.tables import to_csv
from synthesis.fourbar.joints import are_cognates
from synthesis.guides import DRIVERS, Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage as Plain
from synthesis.linkage import Mass, four_bar, on_guides
from synthesis.sheet import More
from synthesis.solution import target_of
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TURN_STEPS = 73
_MARGIN = 0.01
"""Fraction of the way to each dead position by which a linkage is shown over less than its own range."""


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


def guides_of(linkage: Plain, radian: float, used: Interval | None) -> list[AnyGuide]:
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


class Joints(NamedTuple):
    """Positions of a linkage's joints over the travel of its drive; NaN if the loop does not close.

    Arrays have the shape of the travel, points a further axis (2,). Angles are in the linkage's unit, directions against the x
    axis.
    """

    pivot_a: Floats
    """(2,): fixed pivot of the crank, or the fixed pin or the point of the rail of another driven guide."""
    pivot_b: Floats
    """(2,): fixed pivot of the rocker, or the fixed pin or the point of the rail of another guide."""
    crank_pin: Floats
    """Guided point of the driven guide: its body point on a circle or rail, its fixed pin in a slot."""
    coupler_pin: Floats
    """Guided point of the other guide."""
    body_point: Floats | None
    """None if the linkage guides no point."""
    crank_direction: Floats
    """Direction of the crank; of a rail or slot its own."""
    coupler_direction: Floats
    rocker_direction: Floats
    """Direction of the rocker; of a rail or slot its own."""
    rotation: Floats
    """Rotation of the body."""
    transmission_angle: Floats
    drive: Floats
    """The drive's coordinate, an angle or a length."""
    arm: Floats
    """Moment arm of the second guide's push about the pin of the driven guide."""


class Links(NamedTuple):
    """Lengths of a four-bar; the ground is the distance of its fixed pivots."""

    crank: float
    coupler: float
    rocker: float
    ground: float


class CouplerPoint(NamedTuple):
    """The body point in the coupler's frame, from the crank pin."""

    radius: float
    angle: float


class Mount(NamedTuple):
    """Where a linkage stands, and which point it guides."""

    ground_angle: float
    """Angle of the line from pivot A to pivot B."""
    pivot_a: tuple[float, float]
    """Fixed pivot of the crank."""
    pivot_b: tuple[float, float]
    """Fixed pivot of the rocker."""
    coupler_point: Annotated[CouplerPoint | None, CouplerPoint]
    """P = D + radius e^(i (angle + coupler angle + ground angle)), D the crank pin."""
    L_B: float
    """Distance of pivot A from the origin."""
    beta: float
    """Angle of pivot A as seen from the origin."""


class Dimensions(NamedTuple):
    """A linkage as a reply holds it."""

    links: Links
    branch: Any
    start_angle: float
    body_offset: float | None
    mount: Mount | None


class Linkage:
    """A planar linkage: a body that is held by two guides, the first of them driven.

    `FourBar` and `SliderCrank` are its best-known kinds; `Linkage.from_points` takes the joints of a four-bar.

    Parameters
    ----------
    guides : sequence of two mappings
        As a reply has them: ``guide`` "circle" with ``pivot``, ``radius``, ``body_point``; "rail" with ``point``, ``direction``,
        ``body_point``; "slot" with ``pin``, ``body_point``, ``body_direction``. Body points are in the body's frame.
    driver : {"crank", "slider", "cylinder", "hinge"}
        Drive of the first guide: a crank moves a circle, a slider a rail, a cylinder or a hinge a slot.
    branch : int
        Sign of the sine of the transmission angle.
    start : float
        The drive's coordinate at the first sample: the direction of crank or slot in the plane, or the position along rail or
        slot.
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
    >>> pump = la.Linkage([crank, rail], "crank")
    >>> pump.kind, pump.turns_fully
    ('slider_crank', True)
    >>> pump.joints([50]).rotation.round(6).tolist()
    [-13.475068]
    """

    _linkage: Plain
    _radian: float
    _motion: Target | None
    has_motor: ClassVar[bool] = False
    """Whether a motor and its rod belong to it."""
    length_unit: str | None = None
    """Unit of its lengths, taken over from the motion; None if it is unknown: files then take millimetres."""

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
        self._linkage = on_guides((read[0], read[1]), Driver(driver), int(branch), begin)
        check_apart(self._linkage)
        self._radian = radian
        self._motion: Target | None = None

    @classmethod
    def of(cls, linkage: Plain, radian: float, motion: Target | None, length_unit: str | None = None) -> Self:
        """Return the view of a linkage that answers a motion, whose crank angles are the travel of its drive."""
        view = object.__new__(cls)
        view._linkage, view._radian, view._motion, view.length_unit = linkage, radian, motion, length_unit
        return view

    @classmethod
    def from_points(
        cls,
        A: ArrayLike,
        D: ArrayLike,
        C: ArrayLike,
        B: ArrayLike,
        P: ArrayLike | None = None,
        *,
        rotation: float = 0.0,
        degrees: bool = True,
    ) -> Linkage:
        """Return the four-bar whose joints lie at points of the plane at the first sample.

        Parameters
        ----------
        A, B : array_like, shape (2,)
            Fixed pivots of crank and rocker.
        D, C : array_like, shape (2,)
            Pins of the crank and of the rocker on the coupler.
        P : array_like, shape (2,), optional
            Body point; default: the linkage guides no point.
        rotation : float
            Rotation of the body in this position.
        degrees : bool
            Unit of every angle in and out.

        Raises
        ------
        FieldError
            Naming the point that coincides with its neighbour.

        Examples
        --------
        >>> import linkage_atlas as la
        >>> linkage = la.Linkage.from_points((0, 0), (0, 3), (4, 6), (6, 0), P=(2, 7))
        >>> linkage.crank, linkage.coupler, linkage.ground, linkage.family
        (3.0, 5.0, 6.0, 'crank_rocker')
        >>> linkage.joints(0).body_point.round(12).tolist()
        [[2.0, 7.0]]
        """
        a, d, c, b = (pair(name, point, LARGEST) for name, point in zip("ADCB", (A, D, C, B)))
        for name, other, vector in (("D", "A", d - a), ("C", "D", c - d), ("B", "C", b - c), ("B", "A", b - a)):
            if not vector:
                raise FieldError(f"/{name}", f"wanted a point apart from {other}: they lie at the same place")
        radian = radians_in(degrees)
        ground, crank, coupler = b - a, d - a, c - d
        turn = float(np.angle(ground))
        side = float(cross(b - d, coupler))
        point = None
        if P is not None:
            arm = (pair("P", P, LARGEST) - d) / coupler * abs(coupler)
            point = (abs(arm), float(np.angle(arm)))
        linkage = four_bar(
            (abs(crank), abs(coupler), abs(c - b), abs(ground)),
            1 if side >= 0 else -1,
            float(np.angle(crank / ground)) % TURN,
            a,
            turn,
            point,
            number("rotation", rotation) * radian - float(np.angle(coupler / ground)) - turn,
        )
        return cls.of(linkage, radian, None)

    # -- what it is ---------------------------------------------------------------------------------------------------

    @property
    def plain(self) -> Plain:
        """The same in radians, as the numerics have it."""
        return self._linkage

    @property
    def degrees(self) -> bool:
        """Whether its angles are in degrees; else in radians."""
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
        """Whether its drive turns, and can turn fully."""
        return bool(self._linkage.turns_fully)

    @property
    def _drive(self) -> str:
        """Word for its drive in sentences."""
        return "crank" if self._linkage.driver is Driver.CRANK else "drive"

    @property
    def way(self) -> Floats | None:
        """Travel of the drive over the motion that it answers, radians or lengths, (n,); None if it answers none."""
        return None if self._motion is None else self._motion.way

    @property
    def _unit(self) -> float:
        """Radians in the unit of the drive's coordinate; 1 for a length."""
        return self._radian if self._linkage.driver.turns else 1.0

    # -- lengths and a four-bar's own -----------------------------------------------------------------------------------

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
    def coupler_point(self) -> tuple[float, float] | None:
        """Radius and angle of the body point in the coupler's frame."""
        point = self._four_bar("coupler_point").coupler_point
        return None if point is None else (point[0], point[1] / self._radian)

    @property
    def body_offset(self) -> float | None:
        """Rotation of the body less coupler angle and ground angle."""
        offset = self._four_bar("body_offset").body_offset
        return None if offset is None else offset / self._radian

    @property
    def family(self) -> str:
        """How it can turn: crank_rocker, double_crank, ..."""
        return str(self._four_bar("family").family)

    def is_cognate_of(self, other: Linkage) -> bool:
        """Whether both are Roberts cognates: different linkages whose body points draw the same curve."""
        both = self._linkage, other._linkage
        return all(one.is_four_bar and one.mounted for one in both) and are_cognates(*both)

    # -- how it moves -------------------------------------------------------------------------------------------------

    def joints(self, travel: ArrayLike) -> Joints:
        """Return where the joints and the body are.

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

    def analysis(
        self,
        speed: float,
        load: Mapping[str, Any] | None = None,
        travel: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
    ) -> Any:
        """Return velocities, accelerations and, with a load, the torque or force of the drive and the forces in the joints.

        Parameters
        ----------
        speed : float
            Constant speed of the drive: of a crank or hinge counter-clockwise in the linkage's unit of angle a second, else in
            its unit of length a second.
        load : mapping, optional
            ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it; ``masses``, a
            list of ``link`` (body, or a name as in a reply: crank, coupler, rocker), ``mass`` in kg, centre ``at`` [x, y] and
            ``inertia`` in the link's frame; ``parts``, true for also what `solids` weigh by default; ``gravity`` [gx, gy] in
            m/s^2 ([0, -9.81]). With masses forces are in newtons.
        travel : array_like, shape (n,), optional
            Travel of the drive from its start. Default: the samples of the motion that it answers (or a whole turn), with the
            `curve` over their interval.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths, which the forces of inertia depend on; default: the unit of the motion, or millimetres.

        Returns
        -------
        Analysis or GuidedAnalysis
            The first for a four-bar.
        """
        unit = self.unit_for(None, length_unit) or "mm"
        given = {"crank_speed": speed, "load": load, "length_unit": unit}
        asked = read_analysis(given, self._linkage.mounted)
        return self._analysed_at(asked, "travel", travel)

    def tolerance_study(self, *, work: Work | None = None, **manufacture: Any) -> ToleranceStudy:
        """What tolerances of manufacture do to the motion of the body, simulated and to first order.

        Parameters
        ----------
        links, pivots : float
            Lengths (of a body on two guides radii and body points), and coordinates of what is fixed (pivots, pins and rails),
            lie evenly within this of their nominal values, either way.
        clearance : float
            Diameter of a hole less that of its pin, in all joints: the play at both ends of each guide.
        samples, seed : int
            How many linkages are made by chance (10,000), and which (0).
        work : Work, optional
            Asked whether the answer is still wanted.
        """
        return self.made_within(read_manufacture(manufacture), self._default_motion(), work or Work())

    def made_within(self, manufacture: Manufacture, target: Target, work: Work) -> ToleranceStudy:
        """A tolerance study that has been read, over a motion."""
        return studied(self._linkage, manufacture, target.crank, target.interval, self._radian, work)

    def analysed(self, asked: AskedAnalysis, travel: Floats, over: Interval | None = None) -> Any:
        """An analysis that has been read, at travel (n,) of the drive in radians or lengths, and over an interval."""
        return analysed(self._linkage, asked, travel, self._radian, over)

    def _analysed_at(self, asked: AskedAnalysis, name: str, travel: ArrayLike | None) -> Any:
        """The same at travel in the user's unit, or over the motion that it answers."""
        if travel is not None:
            return self.analysed(asked, np.atleast_1d(column(name, travel)) * self._unit)
        target = self._default_motion()
        return self.analysed(asked, target.crank, target.interval)

    def assembly(
        self,
        motion: Motion | None = None,
        crank_angle: ArrayLike | None = None,
        *,
        travel: ArrayLike | None = None,
        work: Work | None = None,
        **asked: Any,
    ) -> Assembly:
        """Layers of its plates in which nothing collides over the used interval, proved; or what stops the best ones.

        Parameters
        ----------
        motion : Motion, optional
            Over whose interval; default: the motion that the linkage answers, or else a whole turn.
        crank_angle, travel : array_like, shape (N,), optional
            Of a motion whose timing is free: crank angles, or the place of a drive that slides, from the first sample on.
        work : Work, optional
            Asked whether the answer is still wanted.
        width, hole, clearance : float
            Width of the plates, diameter of the pins, and the least gap of parts that pass one another.
        thickness, washer : float
            Of the plates, and of the washers between layers.
        kerf, scale : float
            Width of the cut, for plates to cut (0), and scale of a model (1); plays and kerf are not scaled.
        length_unit : {"mm", "cm", "m", "in"}
            The unit of its lengths ("mm"): default sizes are standard ones in millimetres.
        boards : {"below", "above", "both", "bar"}
            Where the fixed pins stand: in a board on either side or both, or in a bar, a plate of its own.
        heads : bool
            Whether pins have heads, of 1.8 diameters, that fill a layer at each free end.
        mounts : mapping
            How fixed pins must be held: {"A": "below+above"}.
        body : array_like, shape (n, 2)
            Outline of the body, a plate that the coupler carries: in the body's frame, from the body point.
        layers_most : int
            Layers at most (6).

        Examples
        --------
        >>> import linkage_atlas as la
        >>> la.FourBar(30, 60, 70, 50).assembly(hole=6, width=18).layers
        {'crank': 1, 'coupler': 2, 'rocker': 3}
        """
        target = self.target_of(motion, crank_angle if travel is None else travel)
        return self._arranged(target, asked, work or Work(), "")

    def _arranged(
        self, target: Target, asked: Mapping[str, Any], work: Work, where: str, length_unit: str = "mm"
    ) -> Assembly:
        read = read_assembly(asked, where)
        assert read is not None
        read = read._replace(settings=read.settings.in_unit(length_unit))
        return assembled(self._linkage, read, target.interval, self._radian, work, where)

    def solids(
        self,
        motion: Motion | None = None,
        crank_angle: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
        work: Work | None = None,
        **asked: Any,
    ) -> SolidParts:
        """Its parts as solids: plates, boards, pins, washers, with their masses; `SolidParts.save` writes their files.

        Parameters
        ----------
        motion, crank_angle, work
            As of `assembly`; of a drive that slides ``crank_angle`` is its travel.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres. Solids are in millimetres.
        fit : {"H7", "print"}
            How pins fit. "H7": drawn at the nominal size, with tolerances in the parts list. "print": with 0.4 mm play where a
            plate turns and 0.1 mm where it holds the pin, and plates and gaps that a printer makes well.
        material, pins : str
            Of plates and boards, and of pins, washers and heads: steel, stainless, aluminium, brass, plywood, acrylic, POM, PLA,
            PETG or ABS.
        fillet : float
            Radius at the convex corners of the body's outline, in the unit of its lengths (0).
        layout : {"assembled", "bed"}
            Where parts stand in STEP (assembled) and 3MF (beside one another on the bed) unless it says otherwise.
        nevertheless : bool
            Also where parts would collide (False).
        **asked
            As of `assembly`.

        Raises
        ------
        FieldError
            Where parts would collide, or a plate has no room for a hole.

        Examples
        --------
        >>> import linkage_atlas as la
        >>> parts = la.FourBar(19, 72, 144, 165).solids(material="plywood")
        >>> [one.link for one in parts.masses]
        ['crank', 'coupler', 'rocker']
        """
        of_assembly, of_solids = split(asked)
        target = self.target_of(motion, crank_angle)
        unit = self.unit_for(motion, length_unit) or "mm"
        return self._solids(target, of_assembly, read_solids(of_solids, ""), unit, work or Work(), "")

    def _solids(
        self,
        target: Target,
        assembly: Mapping[str, Any] | bool,
        solids: AskedSolids,
        length_unit: str,
        work: Work,
        where: str = "assembly/",
    ) -> SolidParts:
        assembly = {} if isinstance(assembly, bool) else assembly
        return solids_in(self._arranged(target, assembly, work, where, length_unit), solids, length_unit)

    def file(
        self,
        kind: str,
        motion: Motion | None = None,
        length_unit: str | None = None,
        crank_angle: ArrayLike | None = None,
        analysis: Mapping[str, Any] | None = None,
        assembly: Mapping[str, Any] | bool | None = None,
        solids: Mapping[str, Any] | None = None,
        work: Work | None = None,
        drive: Mapping[str, Any] | Record | None = None,
        *,
        travel: ArrayLike | None = None,
    ) -> bytes:
        """The linkage as the content of a file.

        Parameters
        ----------
        kind : {"csv", "svg", "dxf", "plates", "mjcf", "pylinkage", "step", "3mf", "stl", "urdf", "sdf", "parts"}
            ``plates``: a DXF of the links as plates to cut. ``stl``: a zip file with a file a part. ``parts``: a list (CSV).
        motion : Motion, optional
            What was asked for; default: the motion that the linkage answers, or else a whole turn.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres.
        crank_angle, travel : array_like, shape (N,), optional
            Of a motion whose timing is free: crank angles, or the place of a drive that slides, from the first sample on.
        analysis : mapping, optional
            ``crank_speed`` and ``load`` as of `analysis`: further columns of a CSV file.
        assembly, solids : mapping, optional
            How its parts are arranged (True: by default) and made, as of `assembly` and `solids`: for STEP and what follows it
            above, the masses in an MJCF file, and a DXF of all flat parts in place of the links alone.
        work : Work, optional
            Asked whether the answer is still wanted.
        drive : mapping, optional
            A drive of `linkage_atlas.drives`, or its plain values: further columns of a CSV file, lines of a drawing, the drive
            of an MJCF model, and of files of parts a motor and its rod or a cylinder, with the arm that carries its pin.
        """
        one_of("kind", kind, FORMATS)
        if isinstance(drive, Record):
            drive = drive.to_dict()
        check_held(kind, assembly=assembly, solids=solids, drive=drive)
        target = self.target_of(motion, crank_angle if travel is None else travel)
        assembly, drive = with_drive(kind, assembly, drive)
        arranged = bool(assembly or solids)
        made = read_solids(solids or {})
        unit = self.unit_for(motion, length_unit)
        if analysis is not None and unit is not None:
            analysis = {"length_unit": unit, **analysis}
        read_assembly(assembly or {})  # what is wrong there is told also where masses are left out

        def parts(nevertheless: bool) -> SolidParts:
            asked = made._replace(nevertheless=True) if nevertheless else made
            return self._solids(target, assembly or {}, asked, unit or "mm", work or Work())

        return content_of(self._linkage, target, self._radian, kind, unit, analysis, drive, parts, arranged)

    def unit_for(self, motion: Motion | None, length_unit: str | None) -> str | None:
        """Return the unit of lengths that is given, or that of the motion or of the linkage; None if it is unknown."""
        own = self.length_unit if motion is None or motion.length_unit is None else motion.length_unit
        return own if length_unit is None else read_length_unit(length_unit)

    def render(self, kind: str, *arguments: Any, **more: Any) -> str:
        """The linkage as the text of a file; arguments as of `file`. FieldError for 3MF and STL, which are no text."""
        if kind in ("3mf", "stl"):
            raise FieldError("/kind", f"{kind} is no text: `file` has its content, and `save` writes it")
        return self.file(kind, *arguments, **more).decode()

    def save(self, path: str | Path, length_unit: str | None = None, **asked: Any) -> None:
        """Write a file; its ending says which.

        .csv, .svg, .dxf, .xml (MJCF, also .mjcf), of a four-bar .pylinkage.json; of its parts .step, .3mf, .stl.zip, .parts.csv,
        .plates.dxf, and where all joints turn .urdf and .sdf, for which ``asked`` are arguments as of `Linkage.solids`.
        ``drive``: as of `file`.
        """
        path = Path(path)
        drive = asked.pop("drive", None)
        of_assembly, of_solids = split(asked)
        kind = kind_of(path.name)
        more = {} if drive is None else {"drive": drive}
        path.write_bytes(self.file(kind, length_unit=length_unit, assembly=of_assembly, solids=of_solids, **more))

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

    def _repr_svg_(self) -> str | None:
        """A drawing, for notebooks."""
        try:
            return self.file("svg").decode()
        except FieldError:
            return None

    # -- what it becomes ----------------------------------------------------------------------------------------------

    @property
    def dimensions(self) -> Dimensions:
        """Lengths, branch, start and mount under the names of the HTTP contract."""
        one, mount = self._four_bar("dimensions"), None
        if one.mounted or one.pivot_a or one.ground_angle:
            mount = Mount(
                ground_angle=one.ground_angle / self._radian,
                pivot_a=(one.pivot_a.real, one.pivot_a.imag),
                pivot_b=(one.pivot_b.real, one.pivot_b.imag),
                coupler_point=None if self.coupler_point is None else CouplerPoint(*self.coupler_point),
                L_B=abs(one.pivot_a),
                beta=float(np.angle(one.pivot_a)) / self._radian,
            )
        return Dimensions(
            Links(*map(float, one.links)), one.branch, one.start / self._radian, self.body_offset, mount
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract; `from_dict` takes them back."""
        if self._linkage.is_four_bar:
            return dict(plain(self.dimensions))
        return {
            "kind": self.kind,
            "driver": self.driver,
            "guides": plain(self.guides),
            "branch": self.branch,
            "start": self.start,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], degrees: bool = True) -> Linkage:
        """Return a linkage from the values of `to_dict`, of a solution of a reply over HTTP, or from ``joints``.

        ``joints``: arguments of `from_points` by name. Else ``links`` (crank, coupler, rocker, ground) with ``branch``, or
        ``guides`` with ``driver``, ``branch`` and ``start``.
        """
        if values.get("joints") is not None:
            return _from_joints(values["joints"], degrees)
        if values.get("guides") is not None and values.get("links") is None:
            for name in ("guides", "driver", "branch", "start"):
                if values.get(name) is None:
                    raise FieldError(f"/{name}", "needed")
            return cls(values["guides"], values["driver"], values["branch"], values["start"], degrees=degrees)
        mount = values.get("mount") or {}
        point = mount.get("coupler_point")
        with pointing(lambda field: f"/links{field}" if field.lstrip("/") in Links._fields else field):
            return FourBar(
                **{name: values["links"][name] for name in Links._fields},
                branch=values["branch"],
                start_angle=values.get("start_angle", 0.0),
                pivot_a=mount.get("pivot_a", (0.0, 0.0)),
                ground_angle=mount.get("ground_angle", 0.0),
                coupler_point=None if point is None else (point["radius"], point["angle"]),
                body_offset=values.get("body_offset"),
                degrees=degrees,
            )

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """Return a motion with the travel of the drive at its samples.

        Without a motion, or without the travel of a free motion, it is the motion that the linkage answers, or its own range.
        """
        one = self._linkage
        if travel is None and motion is not None and not one.driver.turns:
            travel = motion.travel
        if motion is None or (motion.free and travel is None):
            return self._default_motion()
        name = "crank_angle" if one.driver.turns else "travel"
        positions = np.zeros(0) if travel is None else column(name, travel) * self._unit
        if motion.free and positions.shape != (motion.asked.samples,):
            raise FieldError(f"/{name}", f"wanted {motion.asked.samples} numbers, found {positions.size}")
        if one.is_four_bar:
            return motion.of_solution(one, positions).target
        return target_of(motion.samples, one, positions)

    def __repr__(self) -> str:
        if self._linkage.is_four_bar:
            lengths = ", ".join(f"{name}={getattr(self, name):.6g}" for name in Links._fields)
            return f"FourBar({lengths}, branch={self.branch:+d}: {self.family})"
        words = []
        for one in self.guides:
            if isinstance(one, CircleGuide):
                words.append(f"circle of radius {one.radius:.6g} about {_words(one.pivot)}")
            elif isinstance(one, RailGuide):
                words.append(f"rail through {_words(one.point)} at {one.direction:.6g}")
            else:
                words.append(f"slot on the pin {_words(one.pin)}")
        return f"Linkage({self.kind} driven by a {self.driver}: {', '.join(words)}, branch={self.branch:+d})"


class FourBar(Linkage):
    """Constructor of a four-bar linkage from its lengths, branch, pose and body point.

    Parameters
    ----------
    crank, coupler, rocker, ground : float
        Lengths in any unit.
    branch : int
        +1: the coupler pin C lies to the left of the line from the crank pin D to pivot B; -1: to the right.
    start_angle : float
        Angle of the crank from the ground line at the first sample: where `joints` begins.
    pivot_a : array_like, shape (2,)
        Fixed pivot of the crank.
    ground_angle : float
        Angle of the line from pivot A to pivot B.
    coupler_point : tuple of float, optional
        Radius and angle of the body point in the coupler's frame, from the crank pin.
    body_offset : float, optional
        Rotation of the body minus coupler angle and ground angle.
    degrees : bool
        Unit of every angle in and out.

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> linkage = la.FourBar(19, 72, 144, 165, branch=1)
    >>> linkage.family
    'crank_rocker'
    >>> linkage.joints([0, 90]).crank_pin.round(6).tolist()
    [[19.0, 0.0], [0.0, 19.0]]
    """

    def __init__(
        self,
        crank: float,
        coupler: float,
        rocker: float,
        ground: float,
        branch: int = 1,
        *,
        start_angle: float = 0.0,
        pivot_a: ArrayLike = (0.0, 0.0),
        ground_angle: float = 0.0,
        coupler_point: tuple[float, float] | None = None,
        body_offset: float | None = None,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        lengths = {"crank": crank, "coupler": coupler, "rocker": rocker, "ground": ground}
        for name, length in lengths.items():
            if not number(name, length) > 0:
                raise FieldError(f"/{name}", f"wanted a length above 0, found {length}")
        longest = max(lengths, key=lambda name: lengths[name])
        others = [name for name in lengths if name != longest]
        if lengths[longest] > (together := sum(lengths[name] for name in others)) * (1 + 1e-12):
            raise FieldError(
                f"/{longest}",
                f"the linkage cannot be assembled: {longest} {lengths[longest]:g} is longer than {others[0]}, {others[1]} and "
                f"{others[2]} together, {together:g}",
            )
        if branch not in (-1, 1):
            raise FieldError("/branch", f"wanted 1 or -1, found {branch}")
        point = None if coupler_point is None else (float(coupler_point[0]), float(coupler_point[1]) * radian)
        self._linkage = four_bar(
            (float(crank), float(coupler), float(rocker), float(ground)),
            int(branch),
            float(start_angle) * radian,
            pair("pivot_a", pivot_a, np.inf),
            float(ground_angle) * radian,
            point,
            None if body_offset is None else float(body_offset) * radian,
        )
        self._radian = radian
        self._motion: Target | None = None


class SliderCrank(Linkage):
    """Constructor of a crank that drives a slider on a straight rail by a rod, which is the body.

    Parameters
    ----------
    crank, rod : float
        Lengths in any unit.
    offset : float
        Distance of the rail from the crank's pivot, to the left of the rail's direction.
    branch : int
        +1: the slider lies ahead of the crank pin along the rail; -1: behind it.
    start_angle : float
        Angle of the crank from the rail at the first sample.
    pivot : array_like, shape (2,)
        Fixed pivot of the crank.
    rail_angle : float
        Direction of the rail.
    coupler_point : tuple of float, optional
        Radius and angle of the body point from the crank pin, the angle from the rod; default: the slider's pin.
    degrees : bool
        Unit of every angle in and out.

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> pump = la.SliderCrank(20, 70, offset=5)
    >>> pump.kind, pump.turns_fully
    ('slider_crank', True)
    >>> pump.joints([0, 180]).coupler_pin.round(6).tolist()
    [[89.8212, 5.0], [49.8212, 5.0]]
    """

    def __init__(
        self,
        crank: float,
        rod: float,
        offset: float = 0.0,
        branch: int = 1,
        *,
        start_angle: float = 0.0,
        pivot: ArrayLike = (0.0, 0.0),
        rail_angle: float = 0.0,
        coupler_point: tuple[float, float] | None = None,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        for name, length in {"crank": crank, "rod": rod}.items():
            if not 0 < number(name, length) <= LARGEST:
                raise FieldError(f"/{name}", f"wanted a length above 0, found {length}")
        if abs(number("offset", offset)) > (crank + rod) * (1 + 1e-12):
            raise FieldError(
                "/offset", f"the linkage cannot be assembled: crank and rod reach {crank + rod:g}, found {offset:g}"
            )
        turn, at = rail_angle * radian, pair("pivot", pivot, LARGEST)
        radius, angle = (rod, 0.0) if coupler_point is None else coupler_point
        arm = number("coupler_point", radius) * complex(np.exp(1j * angle * radian))
        rail = at + 1j * offset * complex(np.exp(1j * turn))
        super().__init__(
            [
                CircleGuide("circle", xy(at), float(crank), xy(-arm)),
                RailGuide("rail", xy(rail), rail_angle, xy(rod - arm), None),
            ],
            "crank",
            branch,
            start_angle + rail_angle,
            degrees=degrees,
        )


def _from_joints(joints: Any, degrees: bool) -> Linkage:
    """Return the four-bar of a mapping with the arguments of `Linkage.from_points`."""
    names = ("A", "D", "C", "B", "P", "rotation")
    if not isinstance(joints, Mapping):
        raise FieldError("/joints", "wanted the points A, D, C, B and perhaps P")
    check_names("/joints", joints, names)
    for name in names[:4]:
        if joints.get(name) is None:
            raise FieldError(f"/joints/{name}", "needed")
    given = {name: value for name, value in joints.items() if value is not None}
    with pointing(lambda field: f"/joints/{field.lstrip('/')}"):
        return Linkage.from_points(**given, degrees=degrees)


def assembly(linkage: Any, motion: Motion | None = None, **asked: Any) -> Assembly:
    """Arrange the plates of a linkage in layers in which nothing collides.

    Parameters
    ----------
    linkage : Linkage, Solution or mapping
        The linkage, or its plain values as ``to_dict`` or a reply gives them, in the motion's unit of angle (degrees
        without a motion).
    motion : Motion, optional
        Motion over whose interval the layers must be free. Default: the motion that the linkage answers, or else its own range.
    **asked
        Arguments of `Linkage.assembly`.

    Returns
    -------
    Assembly
        Layers, collisions and parts.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.assembly(la.FourBar(19, 72, 144, 165)).status
    'free'
    """
    one, travel = given_linkage(linkage, motion is None or motion.degrees)
    for name in ("crank_angle", "travel") if one is not linkage else ():
        travel = getattr(linkage, name, None) if travel is None else travel
    crank = asked.pop("crank_angle", None)
    return one.assembly(motion, travel if crank is None else crank, **asked)


def given_linkage(given: Any, degrees: bool) -> tuple[Linkage, Any]:
    """Return a linkage that is given as such, as a solution or as plain values; and of those the travel of its drive, if any.

    Raises `FieldError`: ``/linkage``, or the wrong field within.
    """
    if not isinstance(given, Mapping):
        one = given if isinstance(given, Linkage) else getattr(given, "linkage", given)
        if not isinstance(one, Linkage):
            raise FieldError(
                "/linkage", "wanted a linkage, a four-bar or on two guides, a solution, or its plain values"
            )
        return one, None
    travel = given.get("travel") if given.get("crank_angle") is None else given["crank_angle"]
    try:
        return Linkage.from_dict(given, degrees), travel
    except (KeyError, TypeError):
        raise FieldError("/linkage", "wanted links (crank, coupler, rocker, ground), branch, start_angle") from None


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


def check_apart(linkage: Plain) -> None:
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


_FOUR_BARS_ONLY = {
    "pylinkage": ONLY_FOUR_BARS,
    **{kind: SLIDES.format(kind) for kind in ("urdf", "sdf")},
}
"""Why there is no file of some kinds of a body on two guides."""


def check_format(kind: str, mechanisms: Sequence[str]) -> None:
    """FieldError for a file that is written for four-bars only, where none of the kinds asked for is one."""
    if kind in _FOUR_BARS_ONLY and "four_bar" not in mechanisms:
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])


def check_held(kind: str, **given: Any) -> None:
    """FieldError for what a file of a kind does not hold."""
    given["assembly"], given["drive"] = with_drive(kind, given["assembly"], given["drive"])
    for name, kinds in HELD.items():
        if given[name] and kind not in kinds:
            raise FieldError(f"/{name}", f"a file of the kind {kind!r} holds none: ask for {' or '.join(kinds)}")


def content_of(
    linkage: Plain,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str | None,
    analysis: Mapping[str, Any] | None,
    drive: Mapping[str, Any] | None,
    parts: Callable[[bool], Any] | None = None,
    arranged: bool = False,
    more: Mapping[str, Any] | None = None,
) -> bytes:
    """The content of a file; see `Linkage.file` for what the arguments mean.

    ``parts``: makes the `SolidParts` of a four-bar, with an error where they collide, or (True) nevertheless.
    ``arranged``: plates are those of an assembly, not the links alone. ``more``: further columns of a CSV file.
    ``length_unit``: None if it is unknown, which CSV and SVG do not mention and other files take as millimetres.
    """
    one_of("kind", kind, FORMATS)
    attached = drive_on(linkage, target, drive)
    layer = None if attached is None else More(LAYER, COLOUR, attached.draw)
    if kind == "csv":
        more = _analysis_columns(linkage, target, radian, analysis) | dict(more or {})
        more |= {} if attached is None else attached.columns()
        more |= {"length_unit": [length_unit] * target.samples} if length_unit else {}
        return to_csv(linkage, target, radian, more).encode()
    if kind == "svg":
        return to_svg(linkage, target, None if attached is None else attached.shown(), length_unit).encode()
    if kind == "pylinkage":
        return to_pylinkage(linkage, target, length_unit).encode()
    unit_mm = millimetres_in(length_unit or "mm")
    if kind in (*OF_PARTS, "plates"):
        assert parts is not None
        if kind != "plates" or arranged or not linkage.is_four_bar:
            return parts(False).file(kind)
        from synthesis.solids.plates import to_plates

        settings = PartSettings(length_unit=length_unit)
        hole, width = plate_sizes(linkage.links)
        settings = settings.completed(hole, width, 0.0)
        return to_plates(linkage, unit_mm, settings.hole, settings.width).encode()
    if kind == "dxf":
        return to_dxf(linkage, target, unit_mm, layer).encode()
    if kind != "mjcf":
        raise FieldError("/kind", f"there is no writer for {kind!r}")
    assert parts is not None
    try:
        masses = {one.link: Mass(one.link, one.mass, complex(*one.at), one.inertia) for one in parts(True).masses}
    except FieldError:
        masses = None  # no plates of these sizes: the file says so
    text = to_mjcf(linkage, target, unit_mm, masses)
    return (text if attached is None else attached.simulated(text, unit_mm / 1000)).encode()


def _analysis_columns(
    linkage: Plain, target: Target, radian: float, analysis: Mapping[str, Any] | None
) -> dict[str, Any]:
    if analysis is None:
        return {}
    asked = read_analysis(analysis, linkage.mounted)
    columns: dict[str, Any] = analysed(linkage, asked, target.crank, radian).columns()
    return columns


def drive_on(linkage: Plain, target: Target, drive: Mapping[str, Any] | None) -> Attached | None:
    """A drive of a reply on a linkage at the samples of a motion."""
    if drive is None:
        return None
    found = _attached(drive, motions_at(linkage, target.crank))
    if found.kind != "dyad":
        return found
    motor = Motor(found.link, found.ground, *found.sizes, found.pin)
    try:
        return replace(found, six_bar=SixBar.of(linkage, ends_of(target.way), motor))
    except FieldError:
        return found  # moved by hand, it does not swing the linkage: its ends alone are told


def with_drive(
    kind: str, assembly: Mapping[str, Any] | bool | None, drive: Mapping[str, Any] | None
) -> tuple[Mapping[str, Any] | bool | None, Mapping[str, Any] | None]:
    """Return an assembly with a drive: in files of parts a motor and its rod, or a cylinder, are two of them."""
    if not isinstance(drive, Mapping) or kind not in (*OF_PARTS, "plates"):
        return assembly, drive
    return {**(assembly if isinstance(assembly, Mapping) else {}), "drive": drive}, None


def _attached(given: Mapping[str, Any], machine: LinkMotions) -> Attached:
    """A drive of a reply, as it came, on a machine at its samples."""
    if not isinstance(given, Mapping):
        raise FieldError("/drive", "wanted a drive of a reply, as plain values")
    kind, link = given.get("kind"), given.get("link")
    if kind not in ("rotary", "actuator", "dyad", "toggle"):
        raise FieldError("/drive/kind", f"wanted a drive of a reply, found {kind!r}")
    on = given.get("on") or GROUND
    for name in (link, on):
        if name not in (GROUND, *machine.links):
            raise FieldError("/drive/link", f"wanted one of {', '.join(machine.links)}, found {name!r}")
    where = given.get("motor") if kind in ("rotary", "dyad") else given.get("ground_point")
    ground = pair(f"drive/{'motor' if kind in ('rotary', 'dyad') else 'ground_point'}", where, math.inf)
    pin = 0j if kind == "rotary" else pair("drive/pin_on_link", given.get("pin_on_link"), math.inf)
    part, names = {
        "rotary": ({}, ()),
        "actuator": (given, ("retracted", "stroke")),
        "dyad": (given.get("six_bar") or {}, ("crank", "coupler")),
        "toggle": (given.get("lock") or {}, ("handle", "strut")),
    }[kind]
    sizes = [number(f"drive/{name}", part.get(name)) for name in names]
    if any(not size > 0 for size in sizes):
        raise FieldError("/drive", f"wanted {' and '.join(names)} above 0")
    knee = (given.get("curve") or {}).get("knee") if kind == "toggle" else None
    return Attached(
        machine,
        kind,
        str(link),
        on,
        ground,
        pin,
        (sizes[0], sizes[1]) if sizes else (0.0, 0.0),
        bool(given.get("extends", True)),
        None if not knee or knee[0] is None else pair("drive/curve/knee/0", knee[0], math.inf),
    )
