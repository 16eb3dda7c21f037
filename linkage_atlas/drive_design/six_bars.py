"""A linkage with the motor that swings it, as a user handles it: six links that move with the motor, drawings and files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.analysis import Analysis
from linkage_atlas.arguments import Fields, column, number
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.constructors import FourBar
from linkage_atlas.files import content_of
from linkage_atlas.formats import OF_PARTS
from linkage_atlas.geometry import Joints
from linkage_atlas.linkages import Linkage, given_linkage
from linkage_atlas.motions import Motion
from linkage_atlas.records import plain, plane, xy
from linkage_atlas.solids import read_solids, solids_in
from linkage_atlas.tolerance_study import Manufacture, ToleranceStudy
from synthesis.arrays import Floats
from synthesis.drives.links import ends_of
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor, SixBar, joints_of
from synthesis.errors import FieldError
from synthesis.target import TURN, Target
from synthesis.work import Work

_STEPS = 73
"""Number of rows of a table over a turn of the motor."""


class SixBarJoints(NamedTuple):
    """Position of a six-bar at n angles of its motor, with angles in the linkage's unit.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> four_bar = la.FourBar(30, 60, 70, 50, start_angle=40)
    >>> wiper = la.drives(four_bar, [{"kind": "dyad", "links": ["crank"]}], crank_angle=[0, 60]).drives[0].linkage
    >>> joints = wiper.joints([0, 90, 180])
    >>> sorted(joints.joints), joints.joints["Q"].shape
    (['A', 'B', 'C', 'D', 'K', 'M', 'Q'], (3, 2))
    """

    joints: dict[str, Floats]
    """(n, 2) for each joint: A, B, C, D of the linkage, M the motor, K between its crank and the rod, Q on the link."""
    linkage: Joints
    """Joints of the linkage itself, with body point, rotation and transmission angle."""
    travel: Floats
    """Travel of the linkage's drive from the first sample: crank angles, or lengths of a slide."""
    motor_direction: Floats
    """Direction of the motor's crank against the x axis."""
    transmission_angle: Floats
    """Angle between the rod and the normal of the path of its pin."""


class SixBarLinkage(Linkage):
    """Linkage that a continuously turning motor swings through a rod: a Watt II or Stephenson III six-bar.

    Motor angles are measured counter-clockwise from the first end of the motion, where its crank and the rod are collinear.

    Parameters
    ----------
    linkage : Linkage, Solution or mapping
        Linkage that is driven.
    drive : Drive or mapping
        Drive of kind "dyad" from `linkage_atlas.drives`: its ``link``, ``motor``, ``pin_on_link``, ``crank`` and ``coupler``
        of its ``six_bar``.
    crank_angle : array_like, shape (n,), optional
        Travel of the linkage's drive from the first sample; the motion goes from the smallest to the largest value.
        Default: the travel of the motion that the linkage answers.
    degrees : bool
        Unit of angles, if the linkage does not define it.

    Raises
    ------
    FieldError
        If an argument is wrong; ``/drive`` if the motor does not swing the linkage over its motion.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> four_bar = la.FourBar(30, 60, 70, 50, start_angle=40)
    >>> wiper = la.drives(four_bar, [{"kind": "dyad", "links": ["crank"]}], crank_angle=[0, 60]).drives[0].linkage
    >>> wiper.kind, round(wiper.dwell(0.01)[0], 1)
    ('watt_2', 24.0)
    >>> wiper.joints(180).travel.round(6).tolist()
    [60.0]
    """

    _linkage: SixBar  # type: ignore[assignment]
    has_motor = True

    def __init__(
        self, linkage: object, drive: object, crank_angle: ArrayLike | None = None, *, degrees: bool = True
    ) -> None:
        base, own = given_linkage(linkage, degrees)
        if base.has_motor:
            raise FieldError("/linkage", "must be a linkage without a motor; this linkage has a motor already")
        own = own if crank_angle is None else crank_angle
        if own is not None:
            travel = np.atleast_1d(column("crank_angle", own)) * base._unit
        elif base.motion_travel is not None:
            travel = base.motion_travel
        else:
            raise FieldError("/crank_angle", "is required, because this linkage has no motion that defines its range")
        kind = drive.get("kind") if isinstance(drive, Mapping) else getattr(drive, "kind", None)
        if kind != "dyad":
            raise FieldError(
                "/drive", "must be a drive of kind dyad as a reply has it, with its motor, pin_on_link and six_bar"
            )
        read = read_assembly({"drive": drive}, "")
        assert read is not None and isinstance(read.drive, Motor)
        self._base, self._radian, self._motion, self._samples = base, base._radian, None, travel
        self.length_unit = base.length_unit
        self._linkage = SixBar.of(base.plain, ends_of(travel), read.drive)

    @classmethod
    def of_view(cls, linkage: Linkage, six: SixBar, samples: Floats) -> SixBarLinkage:
        """Build a six-bar from a linkage and its motor; ``samples`` (n,): travel of its drive, in radians or lengths."""
        six_bar = object.__new__(cls)
        six_bar._base, six_bar._radian, six_bar._motion, six_bar._samples = linkage, linkage._radian, None, samples
        six_bar.length_unit = linkage.length_unit
        six_bar._linkage = six
        return six_bar

    # -- dimensions ---------------------------------------------------------------------------------------------------

    @property
    def linkage(self) -> Linkage:
        """Linkage that is driven."""
        return self._base

    @property
    def kind(self) -> str:
        """`watt_2` if the rod moves a link with a fixed pivot, otherwise `stephenson_3`."""
        return self._linkage.kind

    @property
    def branch(self) -> int:
        """Branch of the driven linkage."""
        return self._base.branch

    @property
    def turns_fully(self) -> bool:
        """True: the motor turns fully."""
        return True

    @property
    def motor(self) -> Floats:
        """Position of the motor, shape (2,)."""
        return plane(self._linkage.motor.at)

    @property
    def motor_crank(self) -> float:
        """Length of the motor's crank."""
        return self._linkage.motor.crank

    @property
    def rod(self) -> float:
        """Length of the rod."""
        return self._linkage.motor.rod

    @property
    def link(self) -> str:
        """Name of the link that the rod moves."""
        return self._linkage.motor.link

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest travel of the linkage's drive, from the first sample."""
        first, last = self._linkage.used
        return first / self._base._unit, last / self._base._unit

    @property
    def turn(self) -> tuple[float, float]:
        """Motor angles of the forward motion, to the last end, and of the return motion; counter-clockwise positive."""
        forwards, backwards = self._linkage.turn
        return forwards / self._radian, backwards / self._radian

    @property
    def time_ratio(self) -> float:
        """Duration of the slower direction divided by that of the faster one, at a constant speed of the motor."""
        angles = sorted(map(abs, self.turn))
        return angles[1] / angles[0]

    @property
    def motion_travel(self) -> Floats:
        """Motor angles in radians of the samples of the motion in the forward direction, (n,)."""
        return self._linkage.forwards(self._samples)

    # -- motion -------------------------------------------------------------------------------------------------

    def joints(self, motor: ArrayLike) -> SixBarJoints:  # type: ignore[override]
        """Return the positions of all joints.

        Parameters
        ----------
        motor : array_like, any shape
            Motor angles from the first end, over any number of turns; a number has the shape (1,).
        """
        six = self._linkage
        turned = np.atleast_1d(column("motor", motor)) * self._radian
        flat = turned.ravel()
        joints = joints_of(self._base.plain, six.machine(flat)) + six.rod_joints(flat)
        travel = np.reshape(six.travel(flat), turned.shape) / self._base._unit
        return SixBarJoints(
            {
                joint.name: plane(np.broadcast_to(joint.position, flat.shape).reshape(turned.shape))
                for joint in joints
            },
            self._base.joints(travel),
            travel,
            (six.start + turned) / self._radian,
            np.reshape(six.transmission(flat), turned.shape) / self._radian,
        )

    def transmission_angle_min(self) -> float:  # type: ignore[override]
        """Return the smallest transmission angle of the rod, at 721 motor angles of a turn."""
        return float(self._linkage.transmission(np.linspace(0.0, TURN, 721)).min()) / self._radian

    def dwell(self, share: float = 0.01) -> tuple[float, float]:
        """Return the motor angles over which the linkage is within a fraction of its motion from the first and the last end."""
        if not 0 < number("share", share) < 0.5:
            raise FieldError("/share", f"must be a number between 0 and 0.5; it is {share}")
        first, last = self._linkage.dwell(share)
        return first / self._radian, last / self._radian

    # -- files ----------------------------------------------------------------------------------------------

    def _arranged(self, target: Target, request: Fields, work: Work, where: str, length_unit: str = "mm") -> Assembly:
        if "drive" in request:
            raise FieldError(f"/{where}drive", "must not be the motor of this six-bar; choose another drive")
        read = read_assembly({**request, "drive": self.drive}, where)
        assert read is not None
        read = read._replace(settings=read.settings.in_unit(length_unit))
        return assembled(self._base.plain, read, self._linkage.used, self._radian, work, where)

    def file(  # type: ignore[override]
        self,
        kind: str,
        motion: Motion | None = None,
        length_unit: str | None = None,
        motor: ArrayLike | None = None,
        assembly: Fields | bool | None = None,
        solids: Fields | None = None,
        work: Work | None = None,
    ) -> bytes:
        """Return the content of a file with the six-bar.

        Parameters
        ----------
        kind : {"csv", "svg", "dxf", "plates", "step", "3mf", "stl", "urdf", "sdf", "parts"}
            Drawings, models and parts show the first sample of a motion, or else the first end.
        motion : Motion, optional
            Required motion with given crank angles, which is drawn with the linkage.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres.
        motor : array_like, shape (n,), optional
            Motor angles of the rows of a CSV file. Default: a turn in steps of 5 degrees.
        assembly, solids, work
            See `Linkage.file`.
        """
        length_unit = self.unit_for(motion, length_unit)
        if kind in (*OF_PARTS, "plates"):
            layers, unit = assembly if isinstance(assembly, Mapping) else {}, length_unit or "mm"
            arranged = self._arranged(self.target_of(None, None), layers, work or Work(), "assembly/", unit)
            return solids_in(arranged, read_solids(solids), unit).file(kind)
        base, plain = self._base, self._base.plain
        if kind == "csv":
            return self._table(motor, length_unit)
        first, last = self._linkage.used
        target = base._motion if motion is None else base.target_of(motion, None)
        if target is None:
            # drawings and models show the linkage at travel 0, which is set to the first end
            plain = replace(plain, start=plain.start + first)
            target = Target(None, None, crank=np.linspace(0.0, last - first, _STEPS), found=True)
        shown = type(base).of(plain, self._radian, target)
        return shown.file(kind, length_unit=length_unit, drive=self.drive)

    def _table(self, motor: ArrayLike | None, length_unit: str | None) -> bytes:
        turned = np.linspace(0.0, TURN, _STEPS) / self._radian
        if motor is not None:
            turned = np.atleast_1d(column("motor", motor))
        found = self.joints(turned)
        more: dict[str, object] = {
            "motor_angle": turned,
            "motor_direction": found.motor_direction,
            "rod_transmission_angle": found.transmission_angle,
        }
        for name in "KQ":
            more |= {f"{name}_{axis}": found.joints[name][:, k] for k, axis in enumerate("xy")}
        rows = Target(None, None, crank=found.travel * self._base._unit, found=True)
        return content_of(self._base.plain, rows, self._radian, "csv", length_unit, None, None, more=more)

    @property
    def drive(self) -> dict[str, object]:
        """Motor and rod in the form of a drive of a reply."""
        motor = self._linkage.motor
        return {
            "kind": "dyad",
            "link": motor.link,
            "motor": xy(motor.at),
            "pin_on_link": xy(motor.pin),
            "extends": self._linkage.extends,
            "six_bar": {"crank": motor.crank, "coupler": motor.rod},
        }

    def to_dict(self) -> dict[str, object]:
        """Return plain values, from which `from_dict` builds the six-bar again."""
        return {"linkage": self._base.to_dict(), "drive": plain(self.drive), "crank_angle": list(self.ends)}

    @classmethod
    def from_dict(cls, values: Fields, degrees: bool = True) -> SixBarLinkage:
        """Build a six-bar from the values of `to_dict`."""
        for name in ("linkage", "drive", "crank_angle"):
            if values.get(name) is None:
                raise FieldError(f"/{name}", "is required")
        return cls(values["linkage"], values["drive"], column("crank_angle", values["crank_angle"]), degrees=degrees)

    # -- questions that only the linkage answers --------------------------------------------------------------------------------

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """Return a whole turn of the motor."""
        _no_motion(motion, travel)
        return Target(None, None, crank=np.linspace(0.0, TURN, _STEPS))

    def made_within(self, manufacture: Manufacture, target: Target, work: Work) -> ToleranceStudy:
        """Raise FieldError, because tolerances are simulated for the linkage without its motor."""
        raise FieldError(
            "/linkage", "tolerances are simulated for the linkage without the motor: use `linkage.tolerance_study`"
        )

    def analysis(self, *_: object, **__: object) -> Analysis:
        """Raise FieldError, because speeds and forces are computed for the linkage without its motor."""
        raise FieldError(
            "/linkage", "speeds and forces are computed for the linkage without the motor: use `linkage.analysis`"
        )

    def __repr__(self) -> str:
        return (
            f"SixBarLinkage({self.kind}: {MOTOR_CRANK} {self.motor_crank:.6g}, {ROD} {self.rod:.6g} "
            f"on the {self.link} of {self._base!r})"
        )


def _no_motion(motion: Motion | None, travel: object) -> None:
    if motion is not None or travel is not None:
        raise FieldError("/motion", "must be left out: a six-bar moves over a turn of its motor")


def on_hinge(six: SixBar, radian: float) -> Linkage:
    """Return motor, rod and a link with a fixed pivot as a four-bar whose rocker is the link."""
    motor, link = six.motor, six.machine(np.zeros(1)).links[six.motor.link]
    pivot = complex(link.origin[0])
    knee, pin = complex(six.knee(np.zeros(1))[0]), complex(link.position(motor.pin)[0])
    line = float(np.angle(pivot - motor.at))
    return FourBar(
        motor.crank,
        motor.rod,
        abs(motor.pin),
        abs(pivot - motor.at),
        1 if np.imag(np.conj(pivot - knee) * (pin - knee)) > 0 else -1,
        start_angle=(six.start - line) / radian,
        pivot_a=xy(motor.at),
        ground_angle=line / radian,
        degrees=radian != 1.0,
    )
