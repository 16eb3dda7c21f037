"""A linkage with the motor that swings it, as a user handles it: six links that move with the motor, drawings and files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, bounded, column, known_fields, mapping, millimetres_in, number
from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.formats import OF_PARTS
from linkage_atlas.linkages import FourBar, Joints, Linkage, content_of, given_linkage
from linkage_atlas.motions import Motion
from linkage_atlas.records import Record, Values, Vectors, plain, plane, xy
from linkage_atlas.solids import read_solids
from linkage_atlas.studies import MOST_LINK_MASSES, AskedAnalysis, Manufacture, ToleranceStudy, columns_of, read_load
from synthesis.arrays import Floats
from synthesis.drives.links import ends_of
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor, SixBar, joints_of
from synthesis.errors import FieldError
from synthesis.linkage import Mass
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

_STEPS = 73
"""Rows of a table over a turn of the motor."""
_CURVE = 361
"""Angles of the motor at which an analysis is made where none are given."""


class SixBarJoints(NamedTuple):
    """Where a six-bar is at n angles of its motor. Angles in the linkage's unit."""

    joints: dict[str, Floats]
    """(n, 2) of each by its name: A, B, C, D of the linkage, M the motor, K between its crank and the rod, Q on the link."""
    linkage: Joints
    """The linkage itself, with body point, rotation and its own transmission angle."""
    travel: Floats
    """Of the linkage's drive, from the first sample on: crank angles, or lengths of a slide."""
    motor_direction: Floats
    """Of the motor's crank against the x axis."""
    transmission_angle: Floats
    """Between rod and normal of its pin's path."""


@dataclass(frozen=True, kw_only=True)
class SixBarAnalysis(Record):
    """Velocities, accelerations and forces at a constant speed of the motor, a value an angle of it."""

    motor_angle: Floats
    """From the first end on, counter-clockwise positive."""
    motor_speed: float
    travel: Values
    """Of the linkage's drive, from the first sample on."""
    velocity: Vectors | None
    """Of the body point; null without positions."""
    acceleration: Vectors | None
    angular_velocity: dict[str, Values]
    """Of each link by its name."""
    angular_acceleration: dict[str, Values]
    transmission_angle: Values
    """Between rod and normal of its pin's path."""
    motor_torque: Values | None
    """Counter-clockwise; pins without friction. Null without a load."""
    pin_forces: dict[str, Vectors] | None
    """In each joint by its name, on the later link of the two; of a slide across it. Null without a load."""

    def columns(self) -> dict[str, Iterable[object]]:
        """The columns of a table, a row an angle of the motor."""
        turning = ("angular_velocity", "angular_acceleration")
        return columns_of(self, "velocity", "acceleration", "pin_forces", *turning, "motor_torque")


class SixBarLinkage(Linkage):
    """A linkage that a motor swings through a rod while it turns on: a Watt II or Stephenson III six-bar.

    Angles of the motor count, counter-clockwise, from the first end of the way, where its crank and the rod lie in a line.

    Parameters
    ----------
    linkage : Linkage, Solution or mapping
        That is driven.
    drive : Drive or mapping
        Of kind "dyad", as `linkage_atlas.drives` finds it: its ``link``, ``motor``, ``pin_on_link``, and of its ``six_bar`` the
        ``crank`` and the ``coupler``.
    crank_angle : array_like, shape (n,), optional
        The way: the least and the largest of these places of the linkage's drive, from the first sample on. Default: those of the
        motion that it answers.
    degrees : bool
        Unit of angles, where the linkage does not say it.

    Raises
    ------
    FieldError
        Naming the argument; ``/drive`` for a motor that does not swing the linkage over its way.

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
    _drive = "motor"
    has_motor = True

    def __init__(
        self, linkage: object, drive: object, crank_angle: ArrayLike | None = None, *, degrees: bool = True
    ) -> None:
        base, own = given_linkage(linkage, degrees)
        if base.has_motor:
            raise FieldError("/linkage", "wanted a four-bar or a body on guides: this one has a motor already")
        own = own if crank_angle is None else crank_angle
        if own is not None:
            travel = np.atleast_1d(column("crank_angle", own)) * base._unit
        elif base.way is not None:
            travel = base.way
        else:
            raise FieldError("/crank_angle", "needed: this linkage answers no motion that would say its way")
        kind = drive.get("kind") if isinstance(drive, Mapping) else getattr(drive, "kind", None)
        if kind != "dyad":
            raise FieldError(
                "/drive", "wanted a drive of kind dyad as a reply has it, with its motor, pin_on_link and six_bar"
            )
        read = read_assembly({"drive": drive}, "")
        assert read is not None and isinstance(read.drive, Motor)
        self._base, self._radian, self._motion, self._samples = base, base._radian, None, travel
        self.length_unit = base.length_unit
        self._linkage = SixBar.of(base.plain, ends_of(travel), read.drive)

    @classmethod
    def of_view(cls, linkage: Linkage, six: SixBar, samples: Floats) -> SixBarLinkage:
        """Of a linkage and a motor that were found together; ``samples`` (n,): places of its drive, radians or lengths."""
        six_bar = object.__new__(cls)
        six_bar._base, six_bar._radian, six_bar._motion, six_bar._samples = linkage, linkage._radian, None, samples
        six_bar.length_unit = linkage.length_unit
        six_bar._linkage = six
        return six_bar

    # -- what it is ---------------------------------------------------------------------------------------------------

    @property
    def linkage(self) -> Linkage:
        """The linkage that is driven."""
        return self._base

    @property
    def kind(self) -> str:
        """`watt_2` where the rod moves a link with a fixed pivot, `stephenson_3` on any other."""
        return self._linkage.kind

    @property
    def branch(self) -> int:
        """Of the linkage that is driven."""
        return self._base.branch

    @property
    def turns_fully(self) -> bool:
        """Always: that is what the motor is for."""
        return True

    @property
    def motor(self) -> Floats:
        """Where the motor is, shape (2,)."""
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
        """That the rod moves."""
        return self._linkage.motor.link

    @property
    def ends(self) -> tuple[float, float]:
        """Between which places of the linkage's drive it swings, from the first sample on."""
        first, last = self._linkage.used
        return first / self._base._unit, last / self._base._unit

    @property
    def turn(self) -> tuple[float, float]:
        """How far the motor turns forwards, to the last end, and then back to the first; counter-clockwise positive."""
        forwards, backwards = self._linkage.turn
        return forwards / self._radian, backwards / self._radian

    @property
    def time_ratio(self) -> float:
        """Of the slower way over the other, at a constant speed of the motor."""
        angles = sorted(map(abs, self.turn))
        return angles[1] / angles[0]

    @property
    def way(self) -> Floats:
        """Radians of the motor at which it passes, forwards, the samples of the motion that the linkage answers, (n,)."""
        return self._linkage.forwards(self._samples)

    # -- how it moves -------------------------------------------------------------------------------------------------

    def joints(self, motor: ArrayLike) -> SixBarJoints:  # type: ignore[override]
        """Where it is.

        Parameters
        ----------
        motor : array_like, any shape
            Angles of the motor from the first end on, any number of turns; a number is taken as shape (1,).
        """
        six = self._linkage
        turned = np.atleast_1d(column("motor", motor)) * self._radian
        flat = turned.ravel()
        machine = six.machine(flat)
        travel = np.reshape(six.travel(flat), turned.shape) / self._base._unit
        return SixBarJoints(
            {
                joint.name: plane(np.broadcast_to(joint.place, flat.shape).reshape(turned.shape))
                for joint in joints_of(self._base.plain, six.motor, machine)
            },
            self._base.joints(travel),
            travel,
            (six.start + turned) / self._radian,
            np.reshape(six.transmission(machine), turned.shape) / self._radian,
        )

    def transmission_angle_min(self) -> float:  # type: ignore[override]
        """The least angle between rod and normal of its pin's path, of 721 angles of a turn."""
        six = self._linkage
        return float(six.transmission(six.machine(np.linspace(0.0, TURN, 721))).min()) / self._radian

    def dwell(self, share: float = 0.01) -> tuple[float, float]:
        """How far the motor turns while the linkage is within a share of its way of the first end, and of the last."""
        if not 0 < number("share", share) < 0.5:
            raise FieldError("/share", f"wanted a number between 0 and 0.5, found {share}")
        first, last = self._linkage.dwell(share)
        return first / self._radian, last / self._radian

    def analysis(
        self,
        motor_speed: float,
        load: Fields | None = None,
        motor: ArrayLike | None = None,
        *,
        length_unit: str | None = None,
    ) -> SixBarAnalysis:
        """Velocities, accelerations and, with a load, the motor's torque and the forces in all seven joints.

        Parameters
        ----------
        motor_speed : float
            Of the motor, constant, counter-clockwise: in the linkage's unit of angle a second.
        load : mapping, optional
            As of `Linkage.analysis`; ``masses`` also of the links motor_crank and rod, whose frames begin at the motor and at the
            end of its crank and lie along them.
        motor : array_like, shape (n,), optional
            Angles of the motor from the first end on. Default: a whole turn.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths, which the forces of inertia depend on; default: the unit of the motion, or millimetres.
        """
        six, speed = self._linkage, bounded("motor_speed", motor_speed) * self._radian
        turned = np.linspace(0.0, TURN, _CURVE)
        if motor is not None:
            turned = np.atleast_1d(column("motor", motor)) * self._radian
        machine, held = six.machine(turned), None
        unit = self.unit_for(None, length_unit) or "mm"
        metre = millimetres_in(unit) / 1000
        if load is not None:
            links = (*machine.links, "body")
            read, parts = read_load(
                "load", load, links, machine.body is not None, MOST_LINK_MASSES, middles=machine.middles
            )
            masses = read.masses
            if parts:
                weights = self.solids(length_unit=unit, nevertheless=True).masses
                masses += tuple(Mass(link.link, link.mass, complex(*link.at), link.inertia) for link in weights)
            read = read._replace(masses=masses, speed=speed, metre=metre)
            held = six.reactions(machine, joints_of(self._base.plain, six.motor, machine), read)
        turning = {name: link for name, link in machine.links.items() if not name.endswith("slider")}
        body = machine.body
        return SixBarAnalysis(
            motor_angle=turned / self._radian,
            motor_speed=float(motor_speed),
            travel=six.travel(turned) / self._base._unit,
            velocity=None if body is None else plane(body.velocity * speed),
            acceleration=None if body is None else plane(body.acceleration * speed**2),
            angular_velocity={name: link.rate * speed / self._radian for name, link in turning.items()},
            angular_acceleration={name: link.rate_change * speed**2 / self._radian for name, link in turning.items()},
            transmission_angle=six.transmission(machine) / self._radian,
            motor_torque=None if held is None else held.torque,
            pin_forces=None if held is None else {name: plane(force) for name, force in held.forces.items()},
        )

    # -- what it becomes ----------------------------------------------------------------------------------------------

    def _arranged(self, target: Target, request: Fields, work: Work, where: str, length_unit: str = "mm") -> Assembly:
        if "drive" in request:
            raise FieldError(f"/{where}drive", "is this six-bar's own motor")
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
        analysis: Fields | None = None,
        assembly: Fields | bool | None = None,
        solids: Fields | None = None,
        work: Work | None = None,
    ) -> bytes:
        """The six-bar as the content of a file.

        Parameters
        ----------
        kind : {"csv", "svg", "dxf", "mjcf", "plates", "step", "3mf", "stl", "urdf", "sdf", "parts"}
            Drawings and models stand at the first sample of a motion, otherwise at the first end, and so do parts.
        motion : Motion, optional
            What was asked of the linkage, to be drawn with it; with given crank angles.
        length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
            Unit of its lengths; default: the unit of the motion, or millimetres.
        motor : array_like, shape (n,), optional
            Angles of the motor that are the rows of a CSV file. Default: a turn in steps of 5 degrees.
        analysis : mapping, optional
            ``motor_speed`` and ``load`` as of `analysis`: further columns of a CSV file.
        assembly, solids, work
            As of `Linkage.file`.
        """
        length_unit = self.unit_for(motion, length_unit)
        if kind in (*OF_PARTS, "plates"):
            turn = self.target_of(None, None)
            return self._solids(turn, assembly or {}, read_solids(solids), length_unit or "mm", work or Work()).file(
                kind
            )
        base, plain = self._base, self._base.plain
        if kind == "csv":
            return self._table(motor, analysis, length_unit)
        first, last = self._linkage.used
        target = base._motion if motion is None else base.target_of(motion, None)
        if target is None:
            # drawings and models stand at travel 0: here at the first end
            plain = replace(plain, start=plain.start + first)
            target = Target(None, None, crank=np.linspace(0.0, last - first, _STEPS), found=True)
        shown = type(base).of(plain, self._radian, target)
        return shown.file(kind, length_unit=length_unit, drive=self.drive)

    def _table(self, motor: ArrayLike | None, analysis: Fields | None, length_unit: str | None) -> bytes:
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
        if analysis is not None:
            known_fields("analysis", analysis, ("motor_speed", "load"))
            if analysis.get("motor_speed") is None:
                raise FieldError("/analysis/motor_speed", "needed: how fast the motor turns")
            analysed = self.analysis(
                bounded("analysis/motor_speed", analysis["motor_speed"]),
                None if analysis.get("load") is None else mapping("analysis/load", analysis["load"]),
                turned,
                length_unit=length_unit,
            )
            more |= analysed.columns()
        rows = Target(None, None, crank=found.travel * self._base._unit, found=True)
        return content_of(self._base.plain, rows, self._radian, "csv", length_unit, None, None, more=more)

    @property
    def drive(self) -> dict[str, object]:
        """Its motor, as a reply has a drive."""
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
        """Plain values; `from_dict` takes them back."""
        return {"linkage": self._base.to_dict(), "drive": plain(self.drive), "crank_angle": list(self.ends)}

    @classmethod
    def from_dict(cls, values: Fields, degrees: bool = True) -> SixBarLinkage:
        """A six-bar from what `to_dict` gives."""
        for name in ("linkage", "drive", "crank_angle"):
            if values.get(name) is None:
                raise FieldError(f"/{name}", "needed")
        return cls(values["linkage"], values["drive"], column("crank_angle", values["crank_angle"]), degrees=degrees)

    # -- what it leaves to the linkage --------------------------------------------------------------------------------

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """A whole turn of the motor."""
        _no_motion(motion, travel)
        return Target(None, None, crank=np.linspace(0.0, TURN, _STEPS))

    def made_within(self, manufacture: Manufacture, target: Target, work: Work) -> ToleranceStudy:
        """Refused: tolerances are simulated of the linkage itself."""
        raise FieldError("/linkage", "tolerances are simulated of the linkage itself: `linkage.tolerance_study`")

    def analysed(self, request: AskedAnalysis, travel: Floats, over: Interval | None = None) -> object:
        """Refused: see `analysis`, whose speed is the motor's."""
        raise FieldError("/linkage", "of a six-bar see `analysis`, whose speed is the motor's")

    def __repr__(self) -> str:
        return (
            f"SixBarLinkage({self.kind}: {MOTOR_CRANK} {self.motor_crank:.6g}, {ROD} {self.rod:.6g} "
            f"on the {self.link} of {self._base!r})"
        )


def _no_motion(motion: Motion | None, travel: object) -> None:
    if motion is not None or travel is not None:
        raise FieldError("/motion", "a six-bar moves over a turn of its motor: leave this")


def on_hinge(six: SixBar, radian: float) -> Linkage:
    """A motor and rod on a link that turns about a fixed pivot: a four-bar, whose rocker the link is."""
    motor, link = six.motor, six.machine(np.zeros(1)).links[six.motor.link]
    pivot = complex(link.origin[0])
    knee, pin = complex(six.knee(np.zeros(1))[0]), complex(link.place(motor.pin)[0])
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
