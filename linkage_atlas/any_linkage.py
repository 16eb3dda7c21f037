"""What a four-bar and a body on two guides are alike in for a user: unit, motion, drawings, files, and what tolerances do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import column
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.exports import content_of, with_motor
from linkage_atlas.formats import kind_of
from linkage_atlas.motions import Motion
from linkage_atlas.solids import AskedSolids, SolidParts, read_solids, solids_in, split
from linkage_atlas.studies import AskedAnalysis, Manufacture, ToleranceStudy, analysed, read_manufacture, studied
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

_TURN_STEPS = 73


class AnyLinkage(ABC):
    """A linkage with its unit of angle, and the motion that it answers if there is one."""

    _linkage: Any
    _radian: float
    _motion: Target | None
    _drive: str
    """What moves it, in a sentence."""

    @classmethod
    def of(cls, linkage: Any, radian: float, motion: Target | None) -> Self:
        """The view of a linkage that answers a motion, whose crank angles are the travel of its drive."""
        one = object.__new__(cls)
        one._linkage, one._radian, one._motion = linkage, radian, motion
        return one

    @property
    def degrees(self) -> bool:
        """Whether its angles are in degrees; else in radians."""
        return self._radian != 1.0

    @property
    def branch(self) -> int:
        """+1 or -1."""
        return int(self._linkage.branch)

    @property
    def turns_fully(self) -> bool:
        """Whether its drive turns, and can turn fully."""
        return bool(self._linkage.turns_fully)

    @property
    def way(self) -> Floats | None:
        """Travel of the drive over the motion that it answers, radians or lengths, (n,); None where it answers none."""
        return None if self._motion is None else self._motion.way

    @property
    def _unit(self) -> float:
        """Radians in the unit of the drive's coordinate; 1 for a length."""
        return self._radian

    @abstractmethod
    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """A motion with the travel of the drive at its samples; without one the motion that it answers, or a whole turn."""

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

    def _arranged(self, target: Target, asked: Mapping[str, Any], work: Work, where: str) -> Assembly:
        read = read_assembly(asked, where)
        assert read is not None
        return assembled(self._linkage, read, target.interval, self._radian, work, where)

    def solids(
        self,
        motion: Motion | None = None,
        crank_angle: ArrayLike | None = None,
        *,
        length_unit: str = "mm",
        work: Work | None = None,
        **asked: Any,
    ) -> SolidParts:
        """Its parts as solids: plates, boards, pins, washers, with their masses; `SolidParts.save` writes their files.

        Parameters
        ----------
        motion, crank_angle, work
            As of `assembly`; of a drive that slides ``crank_angle`` is its travel.
        length_unit : {"mm", "cm", "m", "in"}
            The unit of its lengths; solids are in millimetres.
        fit : {"H7", "print"}
            How pins fit. "H7": drawn at the nominal size, with tolerances in the parts list. "print": with 0.4 mm play where a
            plate turns and 0.1 mm where it holds the pin, and plates and gaps that a printer makes well.
        material, pins : str
            Of plates and boards, and of pins, washers and heads: steel, stainless, aluminium, brass, plywood, acrylic, POM, PLA,
            PETG or ABS.
        fillet : float
            Radius at the convex corners of the body's outline, in the unit of its lengths (0).
        scale : float
            Of a model (1); plays are not scaled.
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
        return self._solids(target, of_assembly, read_solids(of_solids, ""), length_unit, work or Work(), "")

    def _solids(
        self,
        target: Target,
        assembly: Mapping[str, Any],
        solids: AskedSolids,
        length_unit: str,
        work: Work,
        where: str = "assembly/",
    ) -> SolidParts:
        return solids_in(self._arranged(target, assembly, work, where), solids, assembly, length_unit)

    def file(
        self,
        kind: str,
        motion: Motion | None = None,
        length_unit: str = "mm",
        crank_angle: ArrayLike | None = None,
        analysis: Mapping[str, Any] | None = None,
        plates: Mapping[str, float] | None = None,
        assembly: Mapping[str, Any] | None = None,
        solids: Mapping[str, Any] | None = None,
        work: Work | None = None,
        drive: Mapping[str, Any] | None = None,
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
        length_unit : {"mm", "cm", "m", "in"}
            The unit of its lengths, for files that know one.
        crank_angle, travel : array_like, shape (N,), optional
            Of a motion whose timing is free: crank angles, or the place of a drive that slides, from the first sample on.
        analysis : mapping, optional
            ``crank_speed`` and ``load`` as of `analysis`: further columns of a CSV file.
        plates : mapping, optional
            ``hole``, the diameter of the holes, and ``width`` of the plates, for a DXF of the links of a four-bar alone.
        assembly, solids : mapping, optional
            How its parts are arranged and made, as of `assembly` and `solids`: for STEP and what follows it above, the masses in
            an MJCF file, and a DXF of all flat parts in place of the links alone.
        work : Work, optional
            Asked whether the answer is still wanted.
        drive : mapping, optional
            A drive of `linkage_atlas.drives` as plain values: further columns of a CSV file, a layer of a DXF file, and the drive
            of an MJCF model.
        """
        target = self.target_of(motion, crank_angle if travel is None else travel)
        assembly, drive = with_motor(kind, assembly, drive)

        def parts(nevertheless: bool) -> SolidParts:
            read = read_solids(solids)
            if nevertheless:
                read = read._replace(nevertheless=True)
            return self._solids(target, assembly or {}, read, length_unit, work or Work())

        arranged = bool(assembly or solids)
        return content_of(
            self._linkage, target, self._radian, kind, length_unit, analysis, drive, parts, plates, arranged
        )

    def render(self, kind: str, *arguments: Any, **more: Any) -> str:
        """The linkage as the text of a file; arguments as of `file`. FieldError for 3MF and STL, which are no text."""
        if kind in ("3mf", "stl"):
            raise FieldError("/kind", f"{kind} is no text: `file` has its content, and `save` writes it")
        return self.file(kind, *arguments, **more).decode()

    def save(self, path: str | Path, length_unit: str = "mm", **asked: Any) -> None:
        """Write a file; its ending says which.

        .csv, .svg, .dxf, .xml (MJCF, also .mjcf), of a four-bar .pylinkage.json; of its parts .step, .3mf, .stl.zip, .parts.csv,
        .plates.dxf, and where all joints turn .urdf and .sdf, for which ``asked`` are arguments as of `FourBar.solids`.
        """
        path = Path(path)
        of_assembly, of_solids = split(asked)
        kind = kind_of(path.name)
        path.write_bytes(self.file(kind, length_unit=length_unit, assembly=of_assembly, solids=of_solids))

    def _default_motion(self) -> Target:
        """What it is drawn over: the motion that it answers, or a whole turn."""
        if self._motion is not None:
            return self._motion
        if not self.turns_fully:
            raise FieldError(
                "/motion", f"this {self._drive} cannot turn fully: give the motion that it is to be shown over"
            )
        return Target(None, None, crank=np.linspace(0.0, TURN, _TURN_STEPS))

    def _repr_svg_(self) -> str | None:
        """A drawing, for notebooks."""
        try:
            return self.file("svg").decode()
        except FieldError:
            return None
