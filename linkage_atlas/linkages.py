"""Linkages of users: their dimensions and motion, and their studies, layers, drawings and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.analysis import Analysis, analysed, read_analysis
from linkage_atlas.arguments import Fields, column, one_of, pointing, radians_in, read_length_unit
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.files import check_held, content_of, with_drive
from linkage_atlas.formats import FORMATS, kind_of
from linkage_atlas.geometry import (
    AnyGuide,
    Dimensions,
    Joints,
    Links,
    dimensions_of,
    guide_in_words,
    guides_of,
    read_guides,
    read_joints,
    read_linkage,
)
from linkage_atlas.motions import Motion
from linkage_atlas.plotting import plot_linkage
from linkage_atlas.records import Record, plain, plane
from linkage_atlas.solids import SolidParts, read_solids, solids_in, split
from linkage_atlas.tolerance_study import ToleranceStudy, read_manufacture, studied
from synthesis.arrays import Floats
from synthesis.assembly.linkage_machine import loop_of
from synthesis.cognates import are_cognates
from synthesis.errors import FieldError
from synthesis.free.dyads import in_any_order
from synthesis.guides import Driver
from synthesis.linkage import Linkage as Plain
from synthesis.poses import Poses
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TURN_STEPS = 73
"""Number of positions of a whole turn."""
_MARGIN = 0.01
"""Fraction of the way to each dead position by which a linkage is shown over less than its own range."""


class Linkage:
    """A planar linkage: a body on two guides, the first of them driven.

    `FourBar` and `SliderCrank` are its best-known kinds; `Linkage.from_points` takes the joints of a four-bar.

    Parameters
    ----------
    guides : sequence of two mappings
        Guides as in a reply: ``guide`` "circle" with ``pivot``, ``radius``, ``body_point``; "rail" with ``point``, ``direction``,
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
    length_unit: str | None = None
    """Unit of its lengths, taken over from the motion; None if it is unknown: files then take millimetres."""

    def __init__(
        self,
        guides: Sequence[Fields | AnyGuide],
        driver: str,
        branch: int = 1,
        start: float = 0.0,
        *,
        degrees: bool = True,
    ) -> None:
        self._radian = radians_in(degrees)
        self._linkage = read_guides(guides, driver, branch, start, self._radian)
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
        radian = radians_in(degrees)
        linkage = read_joints(A, D, C, B, P, rotation, radian)
        return cls.of(linkage, radian, None)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], degrees: bool = True) -> Linkage:
        """Return a linkage from the values of `to_dict`, of a solution of a reply over HTTP, or from ``joints``.

        ``joints``: arguments of `from_points` by name. Otherwise ``links`` (crank, coupler, rocker, ground) with ``branch`` and
        ``start_angle``, or ``guides`` with ``driver``, ``branch`` and ``start``. Raises `FieldError` that names the field.
        """
        radian = radians_in(degrees)
        return Linkage.of(read_linkage(values, radian), radian, None)

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
        linkage = self._linkage
        return (linkage.start + linkage.ground_angle) / self._radian if linkage.driver.turns else linkage.start

    @property
    def guides(self) -> list[AnyGuide]:
        """The guides, the driven guide first, with the used lengths of rails and slots if it answers a motion."""
        return guides_of(self._linkage, self._radian, self._used)

    @property
    def turns_fully(self) -> bool:
        """True if its drive turns, and can turn fully."""
        return bool(self._linkage.turns_fully)

    @property
    def motion_travel(self) -> Floats | None:
        """Travel of the drive over its motion in radians or lengths, (n,); None without a motion."""
        return None if self._motion is None else self._motion.way

    def sample_travel(self, motion: Motion) -> Floats | None:
        """Return the travel of the drive with which the linkage was found for a motion, in the motion's unit.

        Parameters
        ----------
        motion : Motion
            A motion of N samples.

        Returns
        -------
        ndarray, shape (N,), or None
            None if the linkage was not found for N samples.
        """
        travel, samples = self.motion_travel, len(motion)
        # a closed motion continues to its first sample
        if travel is None or travel.size - samples not in (0, 1):
            return None
        return travel[:samples] / (motion.radian if self.plain.driver.turns else 1.0)

    @property
    def _used(self) -> Interval | None:
        return None if self._motion is None else self._motion.interval

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

    def is_cognate_of(self, other: Linkage) -> bool:
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
        linkage = self._linkage
        travel = np.atleast_1d(column("travel", travel)) * self._unit
        first, body, second = linkage.motions(travel.ravel())
        found = linkage.body(linkage.start + travel.ravel())

        def shaped(values: Any) -> Any:
            return np.reshape(values, travel.shape)

        pins = [guide.contact(body.origin, body.direction) for guide in linkage.guides]
        line = linkage.ground_angle if linkage.driver.turns else 0.0
        return Joints(
            pivot_a=self.pivot_a,
            pivot_b=self.pivot_b,
            crank_pin=plane(shaped(pins[0])),
            coupler_pin=plane(shaped(pins[1])),
            body_point=plane(shaped(body.origin)) if linkage.mounted else None,
            crank_direction=shaped(first.angle) / self._radian,
            coupler_direction=shaped(body.angle - (linkage.body_offset or 0.0)) / self._radian,
            rocker_direction=shaped(second.angle) / self._radian,
            rotation=shaped(body.angle) / self._radian,
            transmission_angle=shaped(found.transmission_angle) / self._radian,
            drive=(linkage.start + travel + line) / self._unit,
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
        return plot_linkage(self._linkage, ax, values, self._used, names=names)

    def transmission_angle_min(self, first: float | None = None, last: float | None = None) -> float:
        """Return the smallest transmission angle over travel of the drive, exactly; NaN if the loop opens.

        Default: over a whole turn of a crank or hinge, or the motion that the linkage answers.
        """
        motion = None if self._linkage.is_four_bar else self._motion
        default = Interval(0.0, TURN) if motion is None else motion.interval
        begin = default.first if first is None else first * self._unit
        end = default.last if last is None else last * self._unit
        return self._linkage.transmission_angle_min(Interval(begin, end)) / self._radian

    @property
    def dimensions(self) -> Dimensions:
        """Guides, drive, branch and start, and the lengths and mount of a four-bar, under the names of the HTTP contract."""
        return dimensions_of(self._linkage, self._radian, self._used)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values under the names of the HTTP contract; `Linkage.from_dict` takes them back."""
        return dict(plain(self.dimensions))

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """Return a motion with the travel of the drive at its samples.

        Without a motion it is the motion that the linkage answers, or the travel; without both, and without the travel of a free
        motion, the linkage's own range.
        """
        linkage = self._linkage
        if travel is None and motion is not None and not linkage.driver.turns:
            travel = motion.travel
        if travel is None and (motion is None or motion.free):
            return self._default_motion()
        name = "crank_angle" if linkage.driver.turns else "travel"
        positions = np.zeros(0) if travel is None else column(name, travel) * self._unit
        if motion is None:
            return self._motion or Target(None, None, crank=positions, found=True)
        if motion.free and positions.shape != (motion.requested.samples,):
            raise FieldError(f"/{name}", f"must have {motion.requested.samples} numbers; it has {positions.size}")
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
            name = "crank" if self._linkage.driver is Driver.CRANK else "drive"
            raise FieldError("/motion", f"is required: this {name} has no range of its own")
        range_shown = (1 - _MARGIN) * np.linspace(loop.first, loop.last, _TURN_STEPS)
        return Target(None, None, crank=range_shown, found=True)

    def unit_for(self, motion: Motion | None, length_unit: str | None) -> str | None:
        """Return the unit of lengths of a request, its motion or the linkage, in this order; None if it is unknown."""
        own = self.length_unit if motion is None or motion.length_unit is None else motion.length_unit
        return own if length_unit is None else read_length_unit(length_unit)

    def __repr__(self) -> str:
        if self._linkage.is_four_bar:
            lengths = ", ".join(f"{name}={getattr(self, name):.6g}" for name in Links._fields)
            return f"FourBar({lengths}, branch={self.branch:+d}: {self.family})"
        words = ", ".join(map(guide_in_words, self.guides))
        return f"Linkage({self.kind} driven by a {self.driver}: {words}, branch={self.branch:+d})"

    def analysis(
        self,
        speed: float,
        load: Fields | None = None,
        travel: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
    ) -> Analysis:
        """Compute velocities, accelerations and, with a load, the torque or force of the drive and the forces in the joints.

        Parameters
        ----------
        speed : float
            Constant speed of the drive: of a crank or hinge, counter-clockwise, in the linkage's unit of angle per second;
            otherwise in its unit of length per second.
        load : mapping, optional
            ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it; ``masses``, a
            list of ``link`` (body, or a name as in a reply: crank, coupler, rocker), ``mass`` in kg, ``centre`` [x, y] and
            ``inertia`` in the link's frame; ``parts``, true to add the masses of `solids` with default options; ``gravity``
            [gx, gy] in m/s^2 ([0, -9.81]). With masses, forces are in newtons.
        travel : array_like, shape (n,), optional
            Travel of the drive from its start. Default: the samples of the motion that it answers (or a whole turn), with the
            `curve` over their interval.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths, which the forces of inertia depend on; default: the unit of the motion, or millimetres.

        Returns
        -------
        Analysis
        """
        unit = self.unit_for(None, length_unit) or "mm"
        request = read_analysis({"crank_speed": speed, "load": load, "length_unit": unit}, self._linkage.mounted)
        if travel is not None:
            values = np.atleast_1d(column("travel", travel)) * self._unit
            return analysed(self._linkage, request, values, self._radian)
        target = self._default_motion()
        return analysed(self._linkage, request, target.crank, self._radian, target.interval)

    def tolerance_study(self, *, work: Work | None = None, **manufacture: object) -> ToleranceStudy:
        """Compute the effect of tolerances of manufacture on the motion of the body, simulated and to first order.

        Parameters
        ----------
        links : float
            Largest deviation of each length (radii and body points of a body on two guides), evenly distributed.
        pivots : float
            Largest deviation of each coordinate of fixed parts (pivots, pins and rails), evenly distributed.
        clearance : float
            Diameter of a hole minus the diameter of its pin, in all joints: the play at both ends of each guide.
        samples : int
            Number of simulated linkages.
        seed : int
            Seed of the random numbers; equal seeds give equal results.
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
        """
        target, request = self._default_motion(), read_manufacture(manufacture)
        return studied(self._linkage, request, target.crank, target.interval, self._radian, work or Work())

    def assembly(
        self,
        motion: Motion | None = None,
        crank_angle: ArrayLike | None = None,
        *,
        travel: ArrayLike | None = None,
        work: Work | None = None,
        **options: object,
    ) -> Assembly:
        """Arrange its plates in layers in which nothing collides over the used interval, or return the best layers' collisions.

        Parameters
        ----------
        motion : Motion, optional
            Motion over whose interval the layers must be free; default: the motion that the linkage answers, or a whole turn.
        crank_angle, travel : array_like, shape (N,), optional
            For a free or no motion: crank angles from the first sample, or travel of a drive that slides.
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
        width, hole, thickness, washer, clearance, kerf, scale, length_unit
            Sizes of plates and pins, see `linkage_atlas.part_settings.PartSettings`.
        boards : {"below", "above", "both", "bar"}
            Support of the fixed pins: a board below the links, above them or on each side, or a bar, a plate like the links.
        pin_heads : bool
            Give the pins heads of 1.8 diameters, which fill a layer at each free end.
        mounts : mapping
            Required supports of fixed pins: {"A": "below+above"}.
        body : array_like, shape (n, 2)
            Outline of the body, a plate on the coupler: corners [x, y] in the frame of the body. The origin of this frame is the
            requested position, and its x axis has the requested rotation (without a rotation, the axes are those of the ground
            at the first sample). A lid of 400 by 20 whose hinged end is the body point is
            [[0, 0], [400, 0], [400, 20], [0, 20]].
        layers_max : int
            Maximum number of layers.
        envelope : array_like, shape (4,)
            Box [xmin, ymin, xmax, ymax] that contains all plates. Default: the envelope in the limits of the request.
        keep_out : sequence of array_like, shape (4,)
            Boxes that no plate may enter. Default: the boxes in the limits of the request.
        drive : mapping
            A drive of a reply. A cylinder adds two plates. A motor and its rod also add two plates, and the assembly
            is then checked over a whole turn of the motor.

        Examples
        --------
        >>> import linkage_atlas as la
        >>> la.FourBar(30, 60, 70, 50).assembly(hole=6, width=18).layers
        {'crank': 1, 'coupler': 2, 'rocker': 3}
        """
        target = self.target_of(motion, crank_angle if travel is None else travel)
        return self._arranged(target, options, work or Work(), "")

    def _arranged(self, target: Target, request: Fields, work: Work, where: str, length_unit: str = "mm") -> Assembly:
        read = read_assembly(request, where)
        read = read._replace(settings=read.settings.in_unit(length_unit))
        return assembled(self._linkage, read, target.interval, self._radian, work, where)

    def solids(
        self,
        motion: Motion | None = None,
        crank_angle: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
        work: Work | None = None,
        **options: object,
    ) -> SolidParts:
        """Return its parts as solids: plates, boards, pins, washers, with their masses; `SolidParts.save` writes their files.

        Parameters
        ----------
        motion, crank_angle, work
            See `assembly`; for a drive that slides, ``crank_angle`` is its travel.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres. Solids are in millimetres.
        fit : {"H7", "print"}
            Fit of the pins. "H7": drawn at the nominal size, with tolerances in the parts list. "print": with 0.4 mm play if
            a plate turns and 0.1 mm if it holds the pin, and with plates and gaps that a printer makes well.
        material, pins : str
            Material of plates and boards, and of pins, washers and heads: steel, stainless, aluminium, brass, plywood, acrylic,
            POM, PLA, PETG or ABS. Default: aluminium and steel; PLA for printing.
        layout : {"assembled", "bed"}
            Arrangement of the parts in STEP and 3MF. Default: assembled in STEP, side by side on the print bed in 3MF.
        allow_collisions : bool
            Make the parts even if they collide.
        **options
            See `assembly`.

        Raises
        ------
        FieldError
            If parts would collide, or a plate has no room for a hole.

        Examples
        --------
        >>> import linkage_atlas as la
        >>> parts = la.FourBar(19, 72, 144, 165).solids(material="plywood")
        >>> [mass.link for mass in parts.masses]
        ['crank', 'coupler', 'rocker']
        """
        of_assembly, of_solids = split(options)
        target = self.target_of(motion, crank_angle)
        unit = self.unit_for(motion, length_unit) or "mm"
        layers = self._arranged(target, of_assembly, work or Work(), "", unit)
        return solids_in(layers, read_solids(of_solids, ""), unit)

    def file(
        self,
        kind: str,
        motion: Motion | None = None,
        length_unit: str | None = None,
        crank_angle: ArrayLike | None = None,
        analysis: Fields | None = None,
        assembly: Fields | bool | None = None,
        solids: Fields | None = None,
        work: Work | None = None,
        drive: Fields | Record | None = None,
        *,
        travel: ArrayLike | None = None,
    ) -> bytes:
        """Return the content of a file of the linkage.

        Parameters
        ----------
        kind : {"csv", "svg", "dxf", "plates", "mjcf", "step", "3mf", "stl", "parts"}
            ``plates``: a DXF of all flat parts to cut. ``stl``: a zip archive with a file per part. ``parts``: a CSV list.
        motion, crank_angle, travel, work
            See `assembly`.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres.
        analysis : mapping, optional
            ``crank_speed`` and ``load``, see `analysis`: further columns of a CSV file.
        assembly, solids : mapping, optional
            Arguments of `assembly` (True: the defaults) and of `solids`, for files of parts and for the masses in an MJCF file.
        drive : mapping, optional
            Drive of `linkage_atlas.drives`, or its plain values. It adds columns to a CSV file, lines to a drawing, and to
            files of parts a motor and its rod or a cylinder, with the arm that carries its pin.
        """
        one_of("kind", kind, FORMATS)
        drive = drive.to_dict() if isinstance(drive, Record) else drive
        check_held(kind, assembly=assembly, solids=solids, drive=drive)
        target = self.target_of(motion, crank_angle if travel is None else travel)
        assembly, drive = with_drive(kind, assembly, drive)
        settings = read_solids(solids or {})
        scale = (unit := self.unit_for(motion, length_unit)) or "mm"
        analysis = {"length_unit": unit, **analysis} if analysis is not None and unit is not None else analysis
        read_assembly(assembly or {})  # errors of the assembly are reported even if masses are left out

        def parts(allow_collisions: bool) -> SolidParts:
            request = settings._replace(allow_collisions=True) if allow_collisions else settings
            layers = assembly if isinstance(assembly, Mapping) else {}
            return solids_in(self._arranged(target, layers, work or Work(), "assembly/", scale), request, scale)

        return content_of(self._linkage, target, self._radian, kind, unit, analysis, drive, parts)

    def render(self, kind: str, *arguments: Any, **more: Any) -> str:
        """Return the text of a file; arguments as for `file`. Raises FieldError for 3MF and STL, which are not text."""
        if kind in ("3mf", "stl"):
            raise FieldError("/kind", f"{kind} is not a text format; use `file` for its content, or `save`")
        return self.file(kind, *arguments, **more).decode()

    def save(self, path: str | Path, length_unit: str | None = None, **options: Any) -> None:
        """Write a file of the kind that its ending names.

        Drawings and tables: .csv, .svg, .dxf, .xml (MJCF, also .mjcf). Parts: .step, .3mf, .stl.zip, .parts.csv and .plates.dxf;
        their ``options`` are arguments of `Linkage.solids`. ``crank_angle``, ``drive``: see `file`.
        """
        path = Path(path)
        more: dict[str, Any] = {name: options.pop(name) for name in ("crank_angle", "drive") if name in options}
        of_assembly, of_solids = split(options)
        path.write_bytes(
            self.file(kind_of(path.name), length_unit=length_unit, assembly=of_assembly, solids=of_solids, **more)
        )

    def _repr_svg_(self) -> str | None:
        """Return a drawing, for notebooks."""
        try:
            return self.file("svg").decode()
        except FieldError:
            return None


def given_linkage(source: Any, degrees: bool) -> tuple[Linkage, Any]:
    """Return the linkage of a linkage, a solution or plain values, and the travel in plain values, if any.

    Raises `FieldError`: ``/linkage``, or the wrong field in it.
    """
    if not isinstance(source, Mapping):
        linkage = source if isinstance(source, Linkage) else getattr(source, "linkage", source)
        if not isinstance(linkage, Linkage):
            raise FieldError("/linkage", "must be a linkage such as a four-bar, a solution, or its plain values")
        return linkage, None
    travel = source.get("travel") if source.get("crank_angle") is None else source["crank_angle"]
    with pointing(lambda field: f"/linkage{field}"):
        return Linkage.from_dict(source, degrees), travel
