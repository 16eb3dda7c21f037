"""Linkages of users: how they are made, analysed, arranged in layers, drawn and written to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, get_args

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.analysis import Analysis, AskedAnalysis, analysed, read_analysis
from linkage_atlas.arguments import Fields, check_names, column, number, one_of, pair, pointing, radians_in
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.files import check_held, content_of, with_drive
from linkage_atlas.formats import FORMATS, kind_of
from linkage_atlas.geometry import LARGEST, AnyGuide, DriverName, Links, check_apart, read_four_bar, read_guide
from linkage_atlas.linkage_base import LinkageBase
from linkage_atlas.motions import Motion
from linkage_atlas.records import Record
from linkage_atlas.solids import AskedSolids, SolidParts, read_solids, solids_in, split
from linkage_atlas.tolerance_study import Manufacture, ToleranceStudy, read_manufacture, studied
from synthesis.arrays import Floats, cross
from synthesis.errors import FieldError
from synthesis.guides import DRIVERS, Driver
from synthesis.linkage import four_bar, on_guides
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work


class Linkage(LinkageBase):
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

    has_motor: ClassVar[bool] = False
    """True if a motor and its rod belong to it."""

    def __init__(
        self,
        guides: Sequence[Fields | AnyGuide],
        driver: str,
        branch: int = 1,
        start: float = 0.0,
        *,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        if isinstance(guides, (str, Mapping)) or len(guides) != 2:
            raise FieldError("/guides", f"wanted two guides, found {len(guides)}")
        read = [read_guide(f"guides/{index}", guide, radian) for index, guide in enumerate(guides)]
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

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], degrees: bool = True) -> Linkage:
        """Return a linkage from the values of `to_dict`, of a solution of a reply over HTTP, or from ``joints``.

        ``joints``: arguments of `from_points` by name. Otherwise ``links`` (crank, coupler, rocker, ground) with ``branch``, or
        ``guides`` with ``driver``, ``branch`` and ``start``.
        """
        if values.get("joints") is not None:
            return _from_joints(values["joints"], degrees)
        if values.get("guides") is not None and values.get("links") is None:
            for name in ("guides", "driver", "branch", "start"):
                if values.get(name) is None:
                    raise FieldError(f"/{name}", "needed")
            return cls(values["guides"], values["driver"], values["branch"], values["start"], degrees=degrees)
        mount, radian = values.get("mount") or {}, radians_in(degrees)
        point = mount.get("coupler_point_polar")
        with pointing(lambda field: f"/links{field}" if field.lstrip("/") in Links._fields else field):
            linkage = read_four_bar(
                {name: values["links"][name] for name in Links._fields},
                values["branch"],
                values.get("start_angle", 0.0),
                mount.get("pivot_a", (0.0, 0.0)),
                mount.get("ground_angle", 0.0),
                None if point is None else (point["radius"], point["angle"]),
                values.get("body_offset"),
                radian,
            )
        return Linkage.of(linkage, radian, None)

    def analysis(
        self,
        speed: float,
        load: Fields | None = None,
        travel: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
    ) -> Analysis:
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
        Analysis
        """
        unit = self.unit_for(None, length_unit) or "mm"
        given = {"crank_speed": speed, "load": load, "length_unit": unit}
        asked = read_analysis(given, self._linkage.mounted)
        return self._analysed_at(asked, "travel", travel)

    def tolerance_study(self, *, work: Work | None = None, **manufacture: object) -> ToleranceStudy:
        """Return the effect of tolerances of manufacture on the motion of the body, simulated and to first order.

        Parameters
        ----------
        links, pivots : float
            Lengths (of a body on two guides radii and body points), and coordinates of fixed parts (pivots, pins and rails),
            lie evenly within this of their nominal values, either way.
        clearance : float
            Diameter of a hole minus the diameter of its pin, in all joints: the play at both ends of each guide.
        samples, seed : int
            How many linkages are made by chance (10,000), and which (0).
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
        """
        return self.made_within(read_manufacture(manufacture), self._default_motion(), work or Work())

    def made_within(self, manufacture: Manufacture, target: Target, work: Work) -> ToleranceStudy:
        """Return a tolerance study over a motion."""
        return studied(self._linkage, manufacture, target.crank, target.interval, self._radian, work)

    def analysed(self, asked: AskedAnalysis, travel: Floats, over: Interval | None = None) -> Analysis:
        """Return an analysis at travel (n,) of the drive in radians or lengths, and over an interval."""
        return analysed(self._linkage, asked, travel, self._radian, over)

    def _analysed_at(self, asked: AskedAnalysis, name: str, travel: ArrayLike | None) -> Analysis:
        """Return an analysis at travel in the user's unit, or over the motion that the linkage answers."""
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
        **asked: object,
    ) -> Assembly:
        """Return layers of its plates in which nothing collides over the used interval, or the collisions of the best layers.

        Parameters
        ----------
        motion : Motion, optional
            Over whose interval; default: the motion that the linkage answers, or else a whole turn.
        crank_angle, travel : array_like, shape (N,), optional
            Of a motion whose timing is free: crank angles, or the place of a drive that slides, from the first sample on.
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
        width, hole, clearance : float
            Width of the plates, diameter of the pins, and the smallest gap between moving parts.
        thickness, washer : float
            Of the plates, and of the washers between layers.
        kerf, scale : float
            Width of the cut, for plates to cut (0), and scale of a model (1); plays and kerf are not scaled.
        length_unit : {"mm", "cm", "m", "in"}
            The unit of its lengths ("mm"): default sizes are standard ones in millimetres.
        boards : {"below", "above", "both", "bar"}
            Support of the fixed pins: in a board on either side or both, or in a bar, a plate of its own.
        heads : bool
            Whether pins have heads, of 1.8 diameters, that fill a layer at each free end.
        mounts : mapping
            How fixed pins must be held: {"A": "below+above"}.
        body : array_like, shape (n, 2)
            Outline of the body, a plate that the coupler carries: in the body's frame, from the body point.
        layers_max : int
            Layers at most (6).

        Examples
        --------
        >>> import linkage_atlas as la
        >>> la.FourBar(30, 60, 70, 50).assembly(hole=6, width=18).layers
        {'crank': 1, 'coupler': 2, 'rocker': 3}
        """
        target = self.target_of(motion, crank_angle if travel is None else travel)
        return self._arranged(target, asked, work or Work(), "")

    def _arranged(self, target: Target, asked: Fields, work: Work, where: str, length_unit: str = "mm") -> Assembly:
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
        **asked: object,
    ) -> SolidParts:
        """Return its parts as solids: plates, boards, pins, washers, with their masses; `SolidParts.save` writes their files.

        Parameters
        ----------
        motion, crank_angle, work
            As of `assembly`; of a drive that slides ``crank_angle`` is its travel.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres. Solids are in millimetres.
        fit : {"H7", "print"}
            How pins fit. "H7": drawn at the nominal size, with tolerances in the parts list. "print": with 0.4 mm play if a
            plate turns and 0.1 mm where it holds the pin, and plates and gaps that a printer makes well.
        material, pins : str
            Of plates and boards, and of pins, washers and heads: steel, stainless, aluminium, brass, plywood, acrylic, POM, PLA,
            PETG or ABS.
        fillet : float
            Radius at the convex corners of the body's outline, in the unit of its lengths (0).
        layout : {"assembled", "bed"}
            Position of the parts in STEP (assembled) and 3MF (side by side on the bed); default: as in brackets.
        allow_collisions : bool
            Make the parts even if they collide (False).
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
        >>> [mass.link for mass in parts.masses]
        ['crank', 'coupler', 'rocker']
        """
        of_assembly, of_solids = split(asked)
        target = self.target_of(motion, crank_angle)
        unit = self.unit_for(motion, length_unit) or "mm"
        return self._solids(target, of_assembly, read_solids(of_solids, ""), unit, work or Work(), "")

    def _solids(
        self,
        target: Target,
        assembly: Fields | bool,
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
        kind : {"csv", "svg", "dxf", "plates", "mjcf", "pylinkage", "step", "3mf", "stl", "urdf", "sdf", "parts"}
            ``plates``: a DXF of the links as plates to cut. ``stl``: a zip file with a file a part. ``parts``: a list (CSV).
        motion : Motion, optional
            Requested motion; default: the motion that the linkage answers, or else a whole turn.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres.
        crank_angle, travel : array_like, shape (N,), optional
            Of a motion whose timing is free: crank angles, or the place of a drive that slides, from the first sample on.
        analysis : mapping, optional
            ``crank_speed`` and ``load``, see `analysis`: further columns of a CSV file.
        assembly, solids : mapping, optional
            How its parts are arranged (True: by default) and made, see `assembly` and `solids`: for STEP and what follows it
            above, the masses in an MJCF file, and a DXF of all flat parts instead of only the links.
        work : Work, optional
            Limits the time, and ends the computation if the result is no longer needed.
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
        read_assembly(assembly or {})  # errors of the assembly are reported even if masses are left out

        def parts(allow_collisions: bool) -> SolidParts:
            asked = made._replace(allow_collisions=True) if allow_collisions else made
            return self._solids(target, assembly or {}, asked, unit or "mm", work or Work())

        return content_of(self._linkage, target, self._radian, kind, unit, analysis, drive, parts, arranged)

    def render(self, kind: str, *arguments: Any, **more: Any) -> str:
        """Return the text of a file; arguments as for `file`. Raises FieldError for 3MF and STL, which are not text."""
        if kind in ("3mf", "stl"):
            raise FieldError("/kind", f"{kind} is no text: `file` has its content, and `save` writes it")
        return self.file(kind, *arguments, **more).decode()

    def save(self, path: str | Path, length_unit: str | None = None, **asked: Any) -> None:
        """Write a file of the kind that its ending names.

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

    def _repr_svg_(self) -> str | None:
        """Return a drawing, for notebooks."""
        try:
            return self.file("svg").decode()
        except FieldError:
            return None


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


def assembly(linkage: object, motion: Motion | None = None, **options: Any) -> Assembly:
    """Arrange the plates of a linkage in layers in which nothing collides.

    Parameters
    ----------
    linkage : Linkage, Solution or mapping
        The linkage, or its plain values as ``to_dict`` or a reply gives them, in the motion's unit of angle (degrees
        without a motion).
    motion : Motion, optional
        Motion over whose interval the layers must be free. Default: the motion that the linkage answers, or else its own range.
    **options
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
    view, travel = given_linkage(linkage, motion is None or motion.degrees)
    for name in ("crank_angle", "travel") if view is not linkage else ():
        travel = getattr(linkage, name, None) if travel is None else travel
    crank = options.pop("crank_angle", None)
    return view.assembly(motion, travel if crank is None else crank, **options)


def given_linkage(given: Any, degrees: bool) -> tuple[Linkage, Any]:
    """Return a linkage that is given as a linkage, a solution or plain values, and the travel in plain values, if any.

    Raises `FieldError`: ``/linkage``, or the wrong field in it.
    """
    if not isinstance(given, Mapping):
        linkage = given if isinstance(given, Linkage) else getattr(given, "linkage", given)
        if not isinstance(linkage, Linkage):
            raise FieldError(
                "/linkage", "wanted a linkage, a four-bar or on two guides, a solution, or its plain values"
            )
        return linkage, None
    travel = given.get("travel") if given.get("crank_angle") is None else given["crank_angle"]
    try:
        return Linkage.from_dict(given, degrees), travel
    except (KeyError, TypeError):
        raise FieldError("/linkage", "wanted links (crank, coupler, rocker, ground), branch, start_angle") from None
