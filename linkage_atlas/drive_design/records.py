"""Records of a reply about drives: for each kind of drive, for springs, and for missing drives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args, overload

from linkage_atlas.notes import counted
from linkage_atlas.plotting import plot_curves
from linkage_atlas.records import PYTHON_ONLY, Ranked, Record, Values, Vectors
from synthesis.arrays import Floats
from synthesis.drives.links import GROUND, LinkMotions

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point = tuple[float, float]
SpringKind = Literal["tension", "gas", "compression", "torsion"]
SPRING_KINDS: tuple[SpringKind, ...] = get_args(SpringKind)
NAMES = {"rotary": "rotary drive", "actuator": "actuator", "dyad": "motor with a rod"}
"""Name of each kind of drive in a sentence."""

# -- curves over the motion -------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Curve(Record):
    """A drive or a spring over the motion."""

    crank_angle: Floats
    """At even steps from the first sample on; the travel of a linkage that a slider or cylinder drives."""


@dataclass(frozen=True, kw_only=True)
class RotaryCurve(_Curve):
    """A rotary drive over the motion."""

    torque: Values | None
    """Null without a load."""


@dataclass(frozen=True, kw_only=True)
class _PinCurve(_Curve):
    """A drive between two ends over the motion."""

    length: Values
    """Distance from the other end, or from the motor, to the pin."""
    force: Values | None
    """Compression is positive. Null without a load."""
    ground: Vectors
    """Position of the end on the ground or on the other link, or of the motor."""
    pin: Vectors
    """Position of the pin."""


@dataclass(frozen=True, kw_only=True)
class ActuatorCurve(_PinCurve):
    """An actuator over the motion."""

    arm: Values
    """Moment arm: change of length per radian of the crank."""


@dataclass(frozen=True, kw_only=True)
class MotorCurve(_PinCurve):
    """A motor and its rod over the motion, forwards."""

    torque: Values | None
    """Torque of the motor. Null without a load."""
    knee: Vectors
    """End of the motor's crank."""


# -- parts of drives --------------------------------------------------------------------------------------------------


class PinPeaks(NamedTuple):
    """Largest force in each pin of a four-bar over the motion, with the drive and the load."""

    pivot_a: float
    crank_pin: float
    coupler_pin: float
    pivot_b: float


class SixBarLink(NamedTuple):
    """A link and the names of its joints."""

    name: str
    joints: list[str]


class SixBar(NamedTuple):
    """A motor and a rod on a linkage: together six links."""

    crank: float
    """Length of the motor's crank."""
    coupler: float
    """Length of the rod."""
    kind: str
    """`watt_2` on a link with a fixed pivot, `stephenson_3` on any other, `crank_rocker` on a hinged link."""
    time_ratio: float
    """Time of the slower direction over time of the faster one, at a constant speed of the motor."""
    transmission_angle_min: float
    """Smallest angle between the rod and the normal of its pin's path, in both directions."""
    motor_torque_max: float | None
    """In both directions; null without a load."""
    motor_turn: tuple[float, float]
    """Turn of the motor forwards and backwards, counter-clockwise positive; together a whole turn."""
    dwell: tuple[float, float]
    """Turn of the motor while the linkage is within 1 % of its motion from the first end, and from the last."""
    motor_angle: Annotated[Floats, list[float]]
    """At even steps over a whole turn, from the first end on."""
    crank_angle: Values
    """Crank angle of the linkage at these motor angles."""
    motor_torque: Values | None
    """Torque of the motor at these motor angles; zero at both ends."""
    rod_force: Values | None
    """Force that rod, motor crank and motor bearing carry; compression positive."""
    motor_pin: Vectors
    """End of the motor's crank at these motor angles."""
    driver: str
    """The link that is turned."""
    joints: dict[str, Point]
    """By name, at the first sample, forwards: A to D of the linkage, P its body point, M the motor, K and Q the rod's ends."""
    links: list[SixBarLink]
    """The ground among them, and the coupler, which is the body."""


class Buckling(NamedTuple):
    """Euler's load of a steel rod as long as the whole actuator, pinned at both ends."""

    critical_force: float
    """At the longest position in compression."""
    safety: float | None
    """Smallest ratio of critical force to compression; null if the actuator is never compressed."""


# -- one record for each kind of drive --------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Drive(Record):
    """Fields that every drive has."""

    kind: str
    link: str
    """The link that is moved."""
    swing: float
    """Rotation of this link over the motion."""
    stops: str
    """Stops that must be built."""
    holds: str
    """Description of the load that the drive holds without power."""
    pin_forces: Annotated[PinPeaks | None, PinPeaks] = None
    """Largest pin forces of a four-bar with a load; for a motor over both directions."""


@dataclass(frozen=True, kw_only=True)
class RotaryDrive(_Drive):
    """A rotary drive at a fixed pivot."""

    kind: Literal["rotary"] = "rotary"
    motor: Point
    """The pivot."""
    peak_torque: float | None
    """Null without a load."""
    holding: Point | None
    """Torque at the first position and at the last; null without a load."""
    transmission_angle_min: float | None
    """Smallest transmission angle of a four-bar that is driven at this pivot."""
    curve: RotaryCurve

    @property
    def summary(self) -> str:
        """Describe the drive in a line."""
        return f"{NAMES[self.kind]} on the {self.link}{_at_most('torque', self.peak_torque)}"


@dataclass(frozen=True, kw_only=True)
class _PinnedDrive(_Drive):
    """Fields of a drive that acts on a pin of the link."""

    pin: Point
    """In the plane, at the first position."""
    pin_on_link: Point
    """In the link's frame."""
    length: tuple[float, float]
    """Distance from the other end to the pin at the first position and at the last."""
    extends: bool
    """True if this distance grows from the first position to the last."""
    peak_force: float | None
    """Null without a load."""
    envelope: tuple[float, float, float, float]
    """Range of its pins: xmin, ymin, xmax, ymax."""

    @property
    def _span(self) -> str:
        return f"{self.length[0]:.4g} to {self.length[1]:.4g} long"


@dataclass(frozen=True, kw_only=True)
class ActuatorDrive(_PinnedDrive):
    """An actuator or a cylinder between two links."""

    kind: Literal["actuator"] = "actuator"
    base_link: str = GROUND
    """Link that carries the other end."""
    name: str | None
    """Name of the row of the catalogue."""
    price: float | None
    count: int
    """Number of equal actuators side by side; forces are values of a single actuator."""
    ground_point: Point
    """The other end, in the plane at the first position."""
    retracted: float
    stroke: float
    arm_min: float
    """Smallest moment arm: change of length per radian of the crank."""
    holding: Point | None
    """Force at the first position and at the last; null without a load."""
    peak_force_bound: float | None
    """No actuator with this change of length has a smaller peak force."""
    peak_force_ratio: float | None
    """Peak force over this bound: 1.01 is close to the best possible."""
    buckling: Annotated[Buckling | None, Buckling] = None
    curve: ActuatorCurve

    @property
    def summary(self) -> str:
        """Describe the drive in a line."""
        row = "" if self.name is None else f" ({self.name})"
        return f"actuator{row} on the {self.link}, {self._span}{_at_most('force', self.peak_force)}"


@dataclass(frozen=True, kw_only=True)
class MotorDrive(_PinnedDrive):
    """A motor that turns continuously, with a rod."""

    kind: Literal["dyad"] = "dyad"
    motor: Point
    peak_torque: float | None
    """Null without a load."""
    curve: MotorCurve
    six_bar: SixBar

    @property
    def summary(self) -> str:
        """Describe the drive in a line."""
        loads = _at_most("force", self.peak_force) + _at_most("torque", self.peak_torque)
        return f"{NAMES[self.kind]} on the {self.link}, {self._span}{loads}"


Drive = RotaryDrive | ActuatorDrive | MotorDrive


def _at_most(quantity: str, value: float | None) -> str:
    return "" if value is None else f", {quantity} at most {value:.4g}"


# -- springs ----------------------------------------------------------------------------------------------------------


class TorqueSize(NamedTuple):
    """Size of a torque over the motion."""

    rms: float
    peak: float


class BeforeAfter(NamedTuple):
    """Torque of the drive without a spring and with it."""

    before: TorqueSize
    after: TorqueSize


@dataclass(frozen=True, kw_only=True)
class _EffectCurve(_Curve):
    """Effect of springs over the motion."""

    torque: Values
    """Torque that the drive gives with all springs of the set."""
    hand_force: Values | None
    """With `hand`: force of a hand along the path of this point; positive towards the last position."""


@dataclass(frozen=True, kw_only=True)
class SpringCurve(_EffectCurve):
    """A spring over the motion."""

    length: Values
    force: Values
    """Pull; that of a gas spring is negative."""
    ends: Annotated[Floats, list[tuple[Point, Point]]]
    """(n, 2, 2): positions of its ends."""


@dataclass(frozen=True, kw_only=True)
class TorsionCurve(_EffectCurve):
    """A torsion spring over the motion."""

    twist: Values
    moment: Values


class Holds(NamedTuple):
    """Ends at which the linkage rests on its stop, without a drive and without friction."""

    closed: bool
    """At the first position."""
    open: bool
    """At the last position."""


@dataclass(frozen=True, kw_only=True)
class _SpringEffect(Record):
    """Fields that every spring has. Springs with the same `set` work together."""

    kind: str
    set: int
    count: int
    """Number of equal springs side by side; stiffness, preload, forces and moments are values of a single spring."""
    name: str | None
    """Name of the row of the catalogue."""
    between: tuple[str, str]
    torque: BeforeAfter
    deviation: Annotated[BeforeAfter | None, BeforeAfter] = None
    """With `target`: difference between the torque of the drive and the target torque."""
    pin_forces: Annotated[PinPeaks | None, PinPeaks] = None
    """Largest pin forces of a four-bar with all springs of the set and the remaining torque at the crank."""
    motion_at_ends: str
    """Motion of the linkage at both ends without a drive and without friction."""
    holds: Annotated[Holds, Holds]
    """Ends at which the linkage rests on its stop, without friction."""
    hand_force_max: float | None = None
    """Largest absolute force of a hand over the whole motion; null without `hand`, `hand_force_max` or a force in `target`."""

    @property
    def summary(self) -> str:
        """Describe the spring in a line."""
        before, after = self.torque.before.rms, self.torque.after.rms
        left = f"{100 * after / before:.3g} % of the torque left" if before > 0 else "nothing to carry"
        kind = f"{self.kind} spring"
        row = f" ({self.name})" if self.name and kind not in self.name else ""
        return f"{self.name if self.name and not row else kind}{row} {'-'.join(self.between)}, {self._size}: {left}"

    @property
    def _size(self) -> str:
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class TorsionSpring(_SpringEffect):
    """A torsion spring in a joint."""

    kind: Literal["torsion"] = "torsion"
    point: Point
    """The joint in the plane, at the first position."""
    rate: float
    """Moment per unit of angle."""
    preload: float
    """Moment at a twist of zero."""
    direction: Literal[-1, 1]
    """1 if the twist grows with the angle of the second link from the first."""
    twist: tuple[float, float]
    """Smallest and largest."""
    curve: TorsionCurve

    @property
    def _size(self) -> str:
        return f"rate {self.rate:.4g}"


@dataclass(frozen=True, kw_only=True)
class Spring(_SpringEffect):
    """A tension, compression or gas spring in its place."""

    kind: Literal["tension", "gas", "compression"]
    points: tuple[Point, Point]
    """Ends of the spring in the plane, at the first position."""
    points_on_links: tuple[Point, Point]
    """Ends of the spring in the frames of the links."""
    stiffness: float
    free_length: float
    """Length at which it pulls with its preload."""
    preload: float
    length: tuple[float, float]
    """Smallest and largest of the whole motion."""
    exact: bool
    """Balanced in every position, by springs of zero free length."""
    curve: SpringCurve

    @property
    def _size(self) -> str:
        return f"stiffness {self.stiffness:.4g}"


AnySpring = Spring | TorsionSpring


# -- the reply --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Refusal(Record):
    """Drive or spring that is missing, with the reason."""

    kind: str
    link: str
    name: str | None
    """Name of the row of the catalogue, if the refusal concerns a row."""
    reason: str

    @property
    def sentence(self) -> str:
        """Name the missing drive or spring, its link or links, and the reason."""
        subject = f"{self.kind} on the {self.link}"
        if self.kind in SPRING_KINDS:
            subject = f"{self.kind} spring between {self.link.replace('-', ' and ')}"
        return f"no {subject}{'' if self.name is None else f' ({self.name})'}: {self.reason}"


class TorqueCurve(NamedTuple):
    """Torque that the load requires from a drive at the crank."""

    crank_angle: Floats
    torque: Values
    work: float
    """Over the motion; negative if the load gives it."""
    amount: float
    """Integral of the absolute torque: divided by a stroke it is the smallest possible peak force."""


@dataclass(frozen=True)
class Drives(Record, Ranked[Drive]):
    """Answer of `linkage_atlas.drives`: drives, the best first within each kind, springs, and reasons for what is missing.

    It is indexed and iterated as ``drives``.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> found = la.drives(la.FourBar(19, 72, 144, 165), [{"kind": "rotary"}], crank_angle=[0, 60], load={"torque": 10})
    >>> len(found), found.best("rotary").kind, found.best("actuator")
    (2, 'rotary', None)
    """

    drives: list[Drive]
    refused: list[Refusal]
    springs: list[AnySpring]
    torque: TorqueCurve
    notes: list[str]
    machine: LinkMotions = field(metadata=PYTHON_ONLY, repr=False)

    @property
    def _results(self) -> list[Drive]:
        return self.drives

    @overload
    def best(self, kind: Literal["rotary"]) -> RotaryDrive | None: ...
    @overload
    def best(self, kind: Literal["actuator"]) -> ActuatorDrive | None: ...
    @overload
    def best(self, kind: Literal["dyad"]) -> MotorDrive | None: ...
    def best(self, kind: str) -> Drive | None:
        """Return the best drive of a kind; None if there is none."""
        return next((drive for drive in self.drives if drive.kind == kind), None)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the force and torque of the best drive with matplotlib (extra ``plot``).

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; default: the current axes.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If no drive was found, with the reason, or if no load was given.
        """
        if not self.drives:
            reason = self.refused[0].sentence if self.refused else "the request names no drive (`drives`)"
            raise ValueError(f"There is no drive to draw: {reason}.")
        kind, curve = self.drives[0].kind, self.drives[0].curve
        values = {name: getattr(curve, name, None) for name in ("force", "torque")}
        curves = {f"{name} of the {kind}": known for name, known in values.items() if known is not None}
        if not curves:
            raise ValueError(f"The {kind} has no force or torque to draw: give a `load`.")
        return plot_curves(curve.crank_angle, curves, ax, "travel from the first sample", "force or torque")

    def __repr__(self) -> str:
        rows = [f"{counted(len(self.drives), 'drive')}, {counted(len(self.springs), 'spring')}"]
        rows += [f"  {drive.summary}" for drive in self.drives]
        rows += [f"  {spring.summary}" for spring in self.springs]
        rows += [f"  {refusal.sentence}" for refusal in self.refused]
        return "\n".join([*rows, *(f"note: {note}" for note in self.notes)])
