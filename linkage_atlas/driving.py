"""What drives a linkage over its way: rotary drives, actuators, motors that turn on, knees that lock it, and springs.

Data flow: read what is asked, each thing by its field; make its `LinkMotions` over its used interval, and the torque
that the load asks of it; look for each kind on each link; describe what was found, and why there is nothing elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import (
    bounded,
    box,
    check_above_zero,
    check_names,
    check_top,
    column,
    flag,
    known_fields,
    millimetres_in,
    number,
    one_of,
    pair,
    radians_in,
)
from linkage_atlas.catalogues import PRESSURE, read_actuators, read_springs
from linkage_atlas.linkages import FourBar, GuidedLinkage, given_linkage
from linkage_atlas.motions import Motion
from linkage_atlas.records import KEPT, Record, Values, Vectors, plane, xy
from linkage_atlas.six_bars import SixBarLinkage, on_hinge
from linkage_atlas.studies import read_load
from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.drives.actuator import (
    COARSE_GRID,
    GRID,
    Actuator,
    Knee,
    Placement,
    Question,
    Refused,
    Row,
    Sizes,
    Unfit,
    Wanted,
    best_of_rows,
    locked,
)
from synthesis.drives.links import (
    GROUND,
    SAMPLES,
    LinkMotions,
    ends_of,
    hinged_at,
    largest,
    motions_at,
    motions_of,
)
from synthesis.drives.six_bar import (
    LARGEST_RATIO,
    MOTOR_CRANK,
    ROD,
    Driven,
    Joint,
    Motor,
    about_pivot,
    driven,
    joints_of,
    on_any_link,
    rod_joints,
)
from synthesis.drives.six_bar import SixBar as Swung
from synthesis.drives.springs import (
    Behaviour,
    Fitted,
    Room,
    best_pair,
    best_spring,
    fitted,
    one_spring,
    pairs_of,
    potential_of,
    springs_on_pendulums,
    two_springs,
)
from synthesis.drives.springs import Spring as Placed
from synthesis.errors import FieldError
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.analysis import Load, Pull, forces, on_links
from synthesis.guided.linkage import Circle, Driver, LinkMotion, Rail, Slot, of_four_bar
from synthesis.guided.linkage import GuidedLinkage as Guided
from synthesis.mechanism import Box
from synthesis.target import MAX_LENGTH, TURN, Interval, Target
from synthesis.work import Work

One = TypeVar("One")
KINDS = ("rotary", "actuator", "cylinder", "dyad", "toggle")
"""Of drives; a cylinder is an actuator."""
SPRING_KINDS = ("tension", "gas")
MOST_DRIVES, MOST_SPRINGS, MOST_MASSES = 8, 4, 20
"""Entries of a request."""
FAR = 1e6
"""Times the linkage's size, or of its size, that a length or a place may be: beyond, coordinates lose their digits."""
FINE = 961
"""Positions at which what is reported of a motor is computed."""
_DRIVE_FIELDS: dict[str, tuple[str, ...]] = {
    "rotary": ("links", "transmission_angle_min"),
    "actuator": (
        "retracted", "stroke", "catalogue", "pressure", "links", "on", "ground_box", "reach_max", "arm_min", "dead_length",
        "rod", "extends",
    ),
    "dyad": ("links", "time_ratio", "motor_box", "pin_radius", "reach_max", "transmission_angle_min"),
    "toggle": ("links", "at", "over_centre", "knee", "ground_box", "reach_max", "arm_min"),
}  # fmt: skip
_SPRING_FIELDS = (
    "between", "catalogue", "stiffness", "ground_box", "reach_max", "clear", "holds", "hand_force_max",
)  # fmt: skip
_HOLDS_AT = ("closed", "open")
"""The first and the last position of a linkage that springs are to hold."""
_ABOVE_ZERO = (
    "retracted", "stroke", "reach_max", "pin_radius", "time_ratio", "pressure", "rod", "stiffness", "clear",
    "hand_force_max",
)  # fmt: skip
_STEEL = 210_000.0
"""Newtons a square millimetre, of a rod that buckles."""
_LEAST_ARM = 0.1
"""Of the largest arm that there can be: the least one where none is asked for."""
_USUAL, _HARDLY_MORE = 1.4, 1.05
"""Strokes that an actuator is long when retracted, where nothing is said; and how many times the least force that may cost."""
_OVER_CENTRE = 5.0
"""Degrees by which a knee goes beyond its line, where nothing is said."""
_DWELL = 0.01
"""Part of the way within which a linkage counts as standing still at its end."""
_HELPS = 0.5
"""Largest part of the rms torque that a spring of a catalogue may leave."""
_CARRIES_ALONE = 0.1
"""Part of the rms torque up to which a single spring is enough if two springs are possible."""
_HOLD_MARGIN = 0.02
"""Torque with which an end that holds is pressed onto its stop, as a part of the peak torque without springs."""
_STOPS = {
    "rotary": "two stops, or position control",
    "actuator": "none: its own ends of stroke are the ends of the way",
    "dyad": "none: the motor passes both ends with the linkage at rest",
    "toggle": "one, for the knee beyond its line",
}
_HOLDS = {
    "rotary": "with a worm gear or a brake",
    "actuator": "a spindle does, a cylinder with its valves shut",
    "dyad": "near its dead centres",
}


class DriveCurve(NamedTuple):
    """A drive over the way, at even steps of what the linkage is computed by (the crank angle of a four-bar)."""

    crank_angle: Floats
    """From the first sample on; of a linkage that a slide drives its travel."""
    length: Values | None = None
    """Of an actuator, of the line from motor to pin, or of a knee."""
    arm: Values | None = None
    """Moment arm: change of length a radian of the crank."""
    force: Values | None = None
    """Pushing is positive; of the rod of a motor forwards. Null without a load."""
    torque: Values | None = None
    """Of a rotary drive, or of the motor forwards. Null without a load."""
    ground: Vectors | None = None
    """Where the end on ground, or on the other link, is."""
    pin: Vectors | None = None
    """Where the pin is."""
    knee: Vectors | None = None
    """Of a motor its crank's end forwards, of a knee its joint."""


class SixBarLink(NamedTuple):
    """A link and the joints that it has."""

    name: str
    joints: list[str]


class SixBar(NamedTuple):
    """A motor and a rod on a linkage: together six links."""

    crank: float
    """The motor's."""
    coupler: float
    """The rod."""
    kind: str
    """`watt_2` on a link with a fixed pivot, `stephenson_3` on any other, `crank_rocker` on a hinged link."""
    time_ratio: float
    """Of the slower way over the other, at a constant speed of the motor."""
    transmission_angle_min: float
    """Between rod and normal of the pin's path, over both ways."""
    motor_torque_max: float | None
    """Over both ways; null without a load."""
    motor_turn: tuple[float, float]
    """Of the motor forwards and backwards, counter-clockwise positive; together a whole turn."""
    dwell: tuple[float, float]
    """Turn of the motor while the linkage is within 1 % of its way of the first end, and of the last."""
    motor_angle: Annotated[Floats, list[float]]
    """At even steps over a whole turn, from the first end on."""
    crank_angle: Values
    """Of the linkage, there."""
    motor_torque: Values | None
    """There; zero at both ends."""
    rod_force: Values | None
    """There: what rod, motor and the motor's bearing carry; compression positive."""
    motor_pin: Vectors
    """There: the end of the motor's crank."""
    driver: str
    """The link that is turned."""
    joints: dict[str, tuple[float, float]]
    """By name, at the first sample, forwards: A to D of the linkage, P its body point, M the motor, K and Q the rod's ends."""
    links: list[SixBarLink]
    """The ground among them, and the coupler, which is the body."""


class Buckling(NamedTuple):
    """Of a rod of steel as long as the whole actuator, pinned at both ends (Euler)."""

    critical_force: float
    """At the longest position in compression."""
    safety: float | None
    """Least of critical force over compression; null where nothing is compressed."""


class Lock(NamedTuple):
    """A knee that goes over its centre."""

    handle: float
    """Length of the link on the ground."""
    strut: float
    """Length of the link on the pin."""
    over_centre: float
    at: Literal["first", "last"]
    overshoot: float
    """Crank angle beyond the end while the knee passes its line."""
    handle_torque_max: float | None
    holds: bool | None
    """Whether the load presses it onto its stop; null without a load."""


class PinPeaks(NamedTuple):
    """The largest force in each pin of a four-bar over the way, with this drive and the load."""

    pivot_a: float
    crank_pin: float
    coupler_pin: float
    pivot_b: float


@dataclass(frozen=True, kw_only=True)
class Drive(Record):
    """A drive at its place, and what it asks and gives."""

    kind: Literal["rotary", "actuator", "dyad", "toggle"]
    link: str
    """That it moves."""
    on: str = GROUND
    """Link that carries its other end."""
    name: str | None = None
    """Of the row of the catalogue."""
    price: float | None = None
    ground_point: tuple[float, float] | None = None
    """Its other end; on another link at the first position."""
    motor: tuple[float, float] | None = None
    pin: tuple[float, float] | None = None
    """In the plane, at the first position."""
    pin_on_link: tuple[float, float] | None = None
    """In the link's frame."""
    length: tuple[float, float] | None = None
    """At the first position and at the last."""
    retracted: float | None = None
    stroke: float | None = None
    extends: bool | None = None
    """From the first position to the last."""
    swing: float
    """Of the link that it moves."""
    arm_min: float | None = None
    """A radian of the crank."""
    peak_force: float | None = None
    """Null without a load."""
    peak_torque: float | None = None
    """Null without a load."""
    holding: tuple[float, float] | None = None
    """Force or torque at the first position and at the last; null without a load."""
    bound: float | None = None
    """No actuator of this stroke has a smaller peak force."""
    over_bound: float | None = None
    """Peak force over it: 1.01 is as good as it gets."""
    transmission_angle_min: float | None = None
    """Of a rotary drive; of a motor see `six_bar`."""
    buckling: Annotated[Buckling | None, Buckling] = None
    stops: str
    """That must be built."""
    holds: str
    """Whether it holds without power."""
    envelope: tuple[float, float, float, float] | None = None
    """Range of its pins: xmin, ymin, xmax, ymax."""
    curve: DriveCurve
    pin_forces: Annotated[PinPeaks | None, PinPeaks] = None
    """Of a four-bar with a load; of a motor forwards and backwards."""
    six_bar: SixBar | None = None
    lock: Lock | None = None
    linkage: SixBarLinkage | FourBar | None = field(default=None, metadata=KEPT, repr=False, compare=False)
    """Of a motor, the linkage with it, that moves, draws and exports itself; on a hinge a four-bar, whose rocker the link is."""


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
        is_spring = self.kind in SPRING_KINDS
        what = (
            f"{self.kind} spring between {self.link.replace('-', ' and ')}"
            if is_spring
            else f"{self.kind} on the {self.link}"
        )
        return f"no {what}{'' if self.name is None else f' ({self.name})'}: {self.reason}"


class TorqueSize(NamedTuple):
    """Of a torque over the way."""

    rms: float
    peak: float


class BeforeAfter(NamedTuple):
    """Of the drive's torque, without a spring and with it."""

    before: TorqueSize
    after: TorqueSize


class SpringCurve(NamedTuple):
    """A spring over the way."""

    crank_angle: Floats
    length: Values
    force: Values
    """Pull; a gas spring's is negative."""
    torque: Values
    """What the drive then gives, with all springs of the set."""
    hand_force: Values | None
    """With `hand`: what a hand there gives along its path; positive towards the last position."""
    ends: Annotated[Floats, list[tuple[tuple[float, float], tuple[float, float]]]]
    """(n, 2, 2): where its ends are."""


class Holds(NamedTuple):
    """Ends at which the linkage rests on its stop, without a drive and without friction."""

    closed: bool
    """At the first position."""
    open: bool
    """At the last position."""


@dataclass(frozen=True, kw_only=True)
class Spring(Record):
    """A spring at its place. Those with the same `set` work together."""

    kind: Literal["tension", "gas"]
    set: int
    name: str | None
    """Of the row of the catalogue."""
    between: tuple[str, str]
    points: tuple[tuple[float, float], tuple[float, float]]
    """Its ends in the plane, at the first position."""
    points_on_links: tuple[tuple[float, float], tuple[float, float]]
    """The same in the links' frames."""
    stiffness: float
    free_length: float
    """At which it pulls with its preload."""
    preload: float
    length: tuple[float, float]
    """Least and most."""
    torque: BeforeAfter
    exact: bool
    """Balanced in every position, by springs of zero free length."""
    pin_forces: Annotated[PinPeaks | None, PinPeaks] = None
    """Of a four-bar, with all springs of the set and the rest of the torque at the crank."""
    stays: str
    """What the linkage does by itself at both ends, without friction."""
    holds: Annotated[Holds, Holds]
    """Ends at which the linkage rests on its stop, without friction."""
    hand_force_max: float | None = None
    """Largest absolute force of a hand over the motion; null without `hand` or `hand_force_max`."""
    curve: SpringCurve


class TorqueCurve(NamedTuple):
    """What the load asks of a drive at the crank."""

    crank_angle: Floats
    torque: Values
    work: float
    """Over the way; negative where the load gives it."""
    amount: float
    """The integral of the torque's amount: over a stroke it is the least peak force."""


@dataclass(frozen=True)
class Drives(Record):
    """The answer to `linkage_atlas.drives`: what was found, the best first within each kind, and why nothing elsewhere."""

    drives: list[Drive]
    refused: list[Refusal]
    springs: list[Spring]
    torque: TorqueCurve
    notes: list[str]
    machine: LinkMotions = field(metadata=KEPT, repr=False)

    def best(self, kind: str) -> Drive | None:
        """The best of a kind; None where there is none."""
        return next((one for one in self.drives if one.kind == kind), None)

    def __repr__(self) -> str:
        rows = [f"{len(self.drives)} drives, {len(self.springs)} springs"]
        for one in self.drives:
            length = "" if one.length is None else f", {one.length[0]:.4g} to {one.length[1]:.4g} long"
            force = "" if one.peak_force is None else f", force at most {one.peak_force:.4g}"
            torque = "" if one.peak_torque is None else f", torque at most {one.peak_torque:.4g}"
            named = "" if one.name is None else f" ({one.name})"
            rows.append(f"  {one.kind}{named} on the {one.link}{length}{force}{torque}")
        for spring in self.springs:
            before, after = spring.torque.before.rms, spring.torque.after.rms
            left = f"{100 * after / before:.3g} % of the torque left" if before > 0 else "nothing to carry"
            rows.append(
                f"  {spring.kind} spring {'-'.join(spring.between)}, stiffness {spring.stiffness:.4g}: {left}"
            )
        rows += [f"  {refusal.sentence}" for refusal in self.refused]
        return "\n".join([*rows, *(f"note: {note}" for note in self.notes)])


# -- what is asked ----------------------------------------------------------------------------------------------------


class AskedDrives(NamedTuple):
    """A checked request, in the units of the linkage and in radians."""

    load: Load
    drives: tuple[Mapping[str, Any], ...]
    springs: tuple[Mapping[str, Any], ...]
    hand: complex | None
    millimetres: float

    @property
    def loaded(self) -> bool:
        """Whether anything acts."""
        return bool(self.load.force or self.load.torque or self.load.masses)


def drives(
    linkage: Any = None,
    drives: Sequence[Mapping[str, Any]] = ({"kind": "rotary"}, {"kind": "actuator"}, {"kind": "dyad"}),
    *,
    load: Mapping[str, Any] | None = None,
    springs: Sequence[Mapping[str, Any]] = (),
    motion: Motion | None = None,
    crank_angle: ArrayLike | None = None,
    rocker: Mapping[str, Any] | None = None,
    hand: ArrayLike | None = None,
    length_unit: str | None = None,
    top: int = 5,
    degrees: bool = True,
    budget: float | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Drives:
    """What drives a linkage over its way: the best drives of each kind, and springs that carry its load.

    Parameters
    ----------
    linkage : FourBar, GuidedLinkage, Solution or mapping, optional
        A `GuidedLinkage` too, driven by a crank, slider, cylinder or hinge. Or None with ``rocker``.
    drives : sequence of mapping
        Each with its ``kind``: "rotary", "actuator" (or "cylinder"), "dyad", "toggle", and its wishes by name, see
        docs/drives.md.
    load : mapping, optional
        ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it; ``masses``:
        [{"link", "mass", "at": [x, y], "inertia"}], ``at`` in the link's frame (default: its middle, of the body its point);
        ``gravity`` [gx, gy] (default [0, -9.81]); ``speed``, at which the crank turns steadily: then masses resist. Without a
        load the largest least moment arm counts.
    springs : sequence of mapping
        Each with its ``kind``, "tension" or "gas", and its wishes by name, see docs/drives.md: ``between``, two links or
        the ground (default: the best of all pairs); ``holds``, {"open": True, "closed": True}; ``hand_force_max``.
    motion : Motion, optional
        What the linkage answers; default: its own.
    crank_angle : array_like, shape (n,), optional
        Crank angles from the start angle on, in place of a motion: their first and last are the ends of the way.
    rocker : mapping, optional
        In place of a linkage a link on a hinge: ``pivot`` [x, y], ``start`` and ``swing`` (angles), ``length``.
    hand : array_like, shape (2,), optional
        A place on the body at the first position, for the force of a hand there.
    length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
        Unit of its lengths, for the bundled catalogues; forces are then in newtons. Default: the unit of the motion, or
        millimetres.
    top : int
        Drives of each kind at most.
    degrees : bool
        Unit of angles, where the linkage does not say it.
    budget : float, optional
        Seconds.
    work : callable
        Makes what watches over time and cancellation from a budget in seconds.

    Returns
    -------
    Drives

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> flap = {"pivot": [0, 0], "start": 0, "swing": 60, "length": 400}
    >>> asked = [{"kind": "actuator", "retracted": 255, "stroke": 150, "ground_box": [-300, -400, 300, 0], "reach_max": 300}]
    >>> found = la.drives(rocker=flap, drives=asked, load={"force": [0, -100]})
    >>> round(found.best("actuator").peak_force, 1)
    238.6
    """
    check_top(top)
    check_above_zero(budget=budget)
    watch = work(budget)
    if length_unit is None:
        length_unit = next((unit for one in (motion, linkage) if (unit := _unit_of(one))), "mm")
    millimetres = millimetres_in(length_unit)
    if rocker is not None:
        if any(one is not None for one in (linkage, motion, crank_angle)):
            raise FieldError("/rocker", "stands for a linkage and its way: give either these or this")
        place = _Place.of_rocker(rocker, radians_in(degrees))
    else:
        place = _place_of(linkage, motion, crank_angle, degrees)
    own = (load or {}).get("masses") or ()
    if load is not None and load.get("parts"):
        load = {**load, "parts": False, "masses": [*(load.get("masses") or ()), *place.masses_of_parts(length_unit)]}
    asked = read_asked(place.machine, load, drives, springs, hand, place.radian, millimetres)
    check_sizes(asked, place.machine.extent)
    found = found_drives(place, asked, top, watch)
    if not asked.load.speed and any(mass.get("inertia") for mass in own):
        found.notes.append("load.masses: inertia counts at a speed alone, and load.speed gives none")
    return found


class _Place(NamedTuple):
    """A linkage over its way: coarse and fine, and where on it the samples of its motion lie."""

    poses: Callable[[Floats], LinkMotions]
    """At any places of its drive."""
    machine: LinkMotions
    fine: LinkMotions
    radian: float
    samples: Floats
    view: FourBar | GuidedLinkage | None
    """As the user has it; None of a link on a hinge."""

    @property
    def linkage(self) -> Linkage | None:
        """A four-bar, which ideal springs are computed of."""
        return self.view.plain if isinstance(self.view, FourBar) else None

    def masses_of_parts(self, length_unit: str) -> list[dict[str, Any]]:
        """What the links weigh as plates and pins that are made by default."""
        from linkage_atlas.solids import masses_of_parts

        if self.view is None:
            raise FieldError("/load/parts", "a link on a hinge has no parts: give its masses")
        return masses_of_parts(self.view.plain, ends_of(self.samples), length_unit)

    @classmethod
    def of(
        cls,
        linkage: Linkage | Guided,
        crank: Floats,
        radian: float,
        target: Target | None = None,
        length_unit: str | None = None,
    ) -> _Place:
        """A linkage over the way between the least and the largest travel of its drive at the samples, perhaps of a motion."""
        ends, four_bar = ends_of(crank), isinstance(linkage, Linkage)
        if not abs(ends.last - ends.first) > (1e-6 if four_bar else 0.0):
            field, what = ("crank_angle", "crank angle") if four_bar else ("travel", "place of the drive")
            raise FieldError(f"/{field}", f"the way has no length: its first and last {what} are the same")
        if isinstance(linkage, Guided) and not linkage.closes_over(ends.after(linkage.start)):
            raise FieldError("/linkage", "does not close over its way")
        coarse, fine = (motions_of(linkage, ends, many) for many in (SAMPLES, FINE))
        kind = FourBar if four_bar else GuidedLinkage
        view = kind.of(linkage, radian, target, length_unit)
        place = cls(lambda at: motions_at(linkage, at), coarse, fine, radian, crank, view)
        place.check()
        return place

    @property
    def unit(self) -> float:
        """Of the drive's parameter: radians in the user's angle, or 1 for a length."""
        return self.radian if self.machine.turns else 1.0

    def told(self, at: float) -> str:
        """A place of the drive, in words."""
        angle = " radians" if self.radian == 1 else " degrees"
        return f"{at / self.unit:.6g}" + angle * self.machine.turns

    def check(self) -> None:
        """FieldError where the linkage has no velocities at some place of its way, or lies too far from the origin."""
        far = max(float(np.abs(one.origin).max()) for one in self.machine.links.values())
        if far > FAR * self.machine.extent:
            raise FieldError("/linkage", f"lies farther than {FAR:g} times its size from the origin: move the origin")
        for one in self.fine.links.values():
            bad = ~np.isfinite(one.rate)
            if bad.any():
                at = self.told(self.fine.at[int(np.argmax(bad))])
                raise FieldError("/linkage", f"does not close, or is dead, at {at} of its drive's way")

    @classmethod
    def of_rocker(cls, given: Mapping[str, Any], radian: float) -> _Place:
        check_names("/rocker", given, ("pivot", "start", "swing", "length"))
        given = {"pivot": (0, 0), "start": 0, "length": 1} | {
            name: value for name, value in given.items() if value is not None
        }
        swing = number("rocker/swing", given.get("swing")) * radian
        if not 1e-3 <= abs(swing) < np.pi:
            raise FieldError("/rocker/swing", "wanted an angle of less than half a turn, and not of nothing")
        length = number("rocker/length", given["length"])
        if not 0 < length <= MAX_LENGTH:
            raise FieldError("/rocker/length", "wanted a length above 0")
        pivot = pair("rocker/pivot", given["pivot"], MAX_LENGTH)
        start = number("rocker/start", given["start"]) * radian

        def poses(at: Floats) -> LinkMotions:
            return hinged_at(pivot, start, length, at)

        machine, fine = (poses(np.linspace(0.0, swing, many)) for many in (SAMPLES, FINE))
        place = cls(poses, machine, fine, radian, machine.at[[0, -1]], None)
        place.check()
        return place

    def poses_around(self, low: float, high: float) -> str:
        """Between which samples of the motion two places of the drive lie, in words."""
        middle, samples = (low + high) / 2, self.samples
        last = samples.size - 1
        for k in range(last):
            if (samples[k] - middle) * (samples[k + 1] - middle) <= 0:
                round_again = k + 1 == last and abs(abs(samples[last] - samples[0]) - TURN) < 1e-9
                if round_again and last == 1:
                    return ""
                return f"between poses {k + 1} and {1 if round_again else k + 2}, "
        return ""


def _unit_of(given: Any) -> str | None:
    """Return the unit of lengths of a motion, a linkage or a solution; None if it is unknown."""
    unit: str | None = getattr(getattr(given, "linkage", given), "length_unit", None)
    return unit


def _place_of(linkage: Any, motion: Motion | None, crank_angle: ArrayLike | None, degrees: bool) -> _Place:
    """The linkage over the way that a motion, its own or given crank angles say."""
    given = None if crank_angle is None else np.atleast_1d(column("crank_angle", crank_angle))
    one, own = given_linkage(linkage, degrees if motion is None else motion.degrees)
    if given is None and own is not None:
        given = np.asarray(column(f"linkage/{'travel' if isinstance(one, GuidedLinkage) else 'crank_angle'}", own))
    if not isinstance(one, (FourBar, GuidedLinkage)):
        raise FieldError("/linkage", "wanted a four-bar or a body on guides: this one has a motor already")
    radian, target, four_bar = radians_in(one.degrees), None, isinstance(one, FourBar)
    if motion is not None:
        turns = isinstance(one, FourBar) or one._linkage.driver.turns
        if motion.free and given is None and turns:
            raise FieldError("/linkage/crank_angle", "needed: the motion's crank angles are free")
        if motion.free and given is None and motion.travel is None:
            raise FieldError("/linkage/travel", "needed: the motion's timing is free")
        target = one.target_of(motion, given)
        way = target.way
    elif given is not None:
        if four_bar and (given.size < 2 or not np.all(np.isfinite(given))):
            raise FieldError("/crank_angle", "wanted two finite crank angles or more")
        way = given * one._unit
    elif one.way is not None:
        way, target = one.way, one._motion
    else:
        raise FieldError("/crank_angle", "needed: this linkage answers no motion that would say its way")
    return _Place.of(one.plain, way, radian, target, one.length_unit)


def read_asked(
    machine: LinkMotions,
    load: Mapping[str, Any] | None,
    wanted: Sequence[Mapping[str, Any]] | None,
    springs: Sequence[Mapping[str, Any]] | None,
    hand: ArrayLike | None,
    radian: float,
    millimetres: float,
) -> AskedDrives:
    """A checked request."""
    held = None if hand is None else pair("hand", hand, MAX_LENGTH)
    if held is not None and not springs:
        raise FieldError("/hand", "needs `springs`, which tell the force of a hand there")
    return AskedDrives(
        _load(machine, load or {}, radian, millimetres),
        tuple(
            _drive(f"drives/{k}", one, machine, radian, millimetres) for k, one in enumerate(_list("drives", wanted))
        ),
        tuple(_spring(f"springs/{k}", one, machine, millimetres) for k, one in enumerate(_list("springs", springs))),
        held,
        millimetres,
    )


def check_sizes(asked: AskedDrives, extent: float) -> None:
    """FieldError for lengths and places that are out of all proportion to the linkage."""
    lengths = ("retracted", "stroke", "reach_max", "pin_radius", "dead_length", "clear", "arm_min", "rod")
    for name, wishes in (("drives", asked.drives), ("springs", asked.springs)):
        for k, field_, value in ((k, field_, wish[field_]) for k, wish in enumerate(wishes) for field_ in wish):
            at, size = f"/{name}/{k}/{field_}", f"{FAR:g} times the linkage's size"
            if field_ in lengths and value and not extent / FAR <= value <= extent * FAR:
                raise FieldError(at, f"wanted a length within {size} of {extent:.4g}, either way")
            if field_ in ("ground_box", "motor_box") and max(map(abs, value)) > extent * FAR:
                raise FieldError(at, f"lies farther than {size} from the origin")


def check_asked(given: Mapping[str, Any], radian: float) -> None:
    """FieldError for what no linkage can be asked, before there is one; as of `driven_solution`."""
    way = Interval(0.0, 0.2)
    circle, slot = Circle(0j, 1.0, 0j), Slot(3.0 + 0.5j, 1.0 + 0.2j, 0.1)
    rail = Rail(2.0 + 0.3j, 0.0, 2.0 + 0j)
    machines = [motions_of(Linkage((2.0, 3.0, 4.0, 3.5), 1, 1.0, coupler_point=(1.0, 0.0)), way, 3)]
    machines += [motions_of(Guided((circle, one), Driver.CRANK, 1, 0.5), way, 3) for one in (slot, rail)]
    errors = []
    for one in machines:
        try:
            _read_study(one, given, radian)
            return
        except FieldError as error:
            errors.append(error)
    raise errors[0]


def _read_study(
    machine: LinkMotions, given: Mapping[str, Any], radian: float
) -> tuple[AskedDrives, Mapping[str, Any] | None]:
    """What `load`, `drives`, `springs` and `drive` ask of a solution; and of it the last, checked."""
    asked = read_asked(machine, given.get("load"), given.get("drives"), given.get("springs"), None, radian, 1.0)
    if given.get("drive") is None:
        return asked, None
    return asked, _drive("drive", given["drive"], machine, radian, 1.0)


def driven_solution(
    linkage: Linkage | Guided, crank: Floats, given: Mapping[str, Any], radian: float, work: Work
) -> dict[str, Any]:
    """The fields of a solution that `load`, `drives`, `springs` and `drive` ask for: `drive`'s, then the best of each kind.

    ``crank`` (n,): travel of its drive at the samples, radians or lengths. ``given``: in the user's units.
    """
    try:
        place = _Place.of(linkage, crank, radian)
        asked, wish = _read_study(place.machine, given, radian)
        wishes = (*asked.drives, *([] if wish is None else [wish]))
        check_sizes(asked._replace(drives=wishes), place.machine.extent)
    except FieldError as error:
        refused = [Refusal("any", "linkage", None, error.message)]
        return {"drives": [], "refused": refused, "springs": [], "drivable": None if "drive" not in given else False}
    found = found_drives(place, asked, 1, work)
    if wish is None:
        return {"drives": found.drives, "refused": found.refused, "springs": found.springs}
    only = found_drives(place, asked._replace(drives=(wish,), springs=()), 1, work)
    return {
        "drives": [*only.drives, *found.drives],
        "refused": [*only.refused, *found.refused],
        "springs": found.springs,
        "drivable": bool(only.drives),
    }


def _list(name: str, given: Sequence[Mapping[str, Any]] | None) -> Sequence[Mapping[str, Any]]:
    most = MOST_DRIVES if name == "drives" else MOST_SPRINGS
    found = () if given is None else given
    if isinstance(found, (Mapping, str)) or len(found) > most:
        raise FieldError(f"/{name}", f"wanted a list of at most {most}")
    return found


def _load(machine: LinkMotions, given: Mapping[str, Any], radian: float, millimetres: float) -> Load:
    links, mounted = (*machine.links, "body"), machine.body is not None
    load, parts = read_load("load", given, links, mounted, MOST_MASSES, "speed", link="body", middles=machine.middles)
    if parts:
        raise FieldError("/load/parts", "for one linkage only: /v1/drives, or `linkage_atlas.drives`")
    speed = bounded("load/speed", given.get("speed") or 0.0) * (radian if machine.turns else 1.0)
    return load._replace(speed=speed, metre=millimetres / 1000)


def _drive(
    at: str, given: Mapping[str, Any], machine: LinkMotions, radian: float, millimetres: float
) -> dict[str, Any]:
    """One entry of `drives`, with what it does not say filled in."""
    kind = one_of(f"{at}/kind", given.get("kind") if isinstance(given, Mapping) else None, KINDS)
    kind = "actuator" if kind == "cylinder" else kind
    wish = _wish(at, given, _DRIVE_FIELDS[kind], radian) | {"kind": kind}
    pivoted = [name for name, one in machine.links.items() if one.pivot is not None]
    wish["links"] = _links(
        f"{at}/links", wish.get("links"), machine, pivoted if kind == "rotary" else list(machine.links)
    )
    if not 1 / LARGEST_RATIO <= wish.get("time_ratio", 1.0) <= LARGEST_RATIO:
        raise FieldError(f"/{at}/time_ratio", f"wanted a ratio from {1 / LARGEST_RATIO:g} to {LARGEST_RATIO:g}")
    if kind == "toggle":
        defaults: dict[str, Any] = {"at": "last", "over_centre": np.deg2rad(_OVER_CENTRE), "knee": 0.5}
        wish = defaults | wish
        if wish["at"] not in ("first", "last"):
            raise FieldError(f"/{at}/at", f"wanted 'first' or 'last', found {wish['at']!r}")
        if wish["over_centre"] > np.pi / 3:
            raise FieldError(f"/{at}/over_centre", "wanted at most 60 degrees")
        wish["knee"] = number(f"{at}/knee", wish["knee"])
        if not 0.1 <= wish["knee"] <= 0.9:
            raise FieldError(f"/{at}/knee", "wanted the handle's part of both links, from 0.1 to 0.9")
    if kind == "actuator":
        wish.setdefault("on", GROUND)
        if wish["on"] not in (GROUND, *machine.links):
            raise FieldError(f"/{at}/on", f"wanted ground or one of {', '.join(machine.links)}, found {wish['on']!r}")
        if set(wish["links"]) == {wish["on"]}:
            raise FieldError(f"/{at}/on", f"wanted ground or another link than it moves, found {wish['on']!r}")
        if not isinstance(wish.get("extends", True), bool):
            raise FieldError(f"/{at}/extends", "wanted true or false")
        if "catalogue" in wish:
            for name in ("retracted", "stroke", "dead_length"):
                if name in wish:
                    raise FieldError(f"/{at}/{name}", "give either this or `catalogue`")
            wish["rows"], wish["rods"] = read_actuators(
                f"{at}/catalogue", wish["catalogue"], millimetres, wish.get("pressure", PRESSURE)
            )
        elif "pressure" in wish:
            raise FieldError(f"/{at}/pressure", "of a catalogue with bores; there is none")
    return wish


def _wish(at: str, given: Mapping[str, Any], fields: tuple[str, ...], radian: float) -> dict[str, Any]:
    """What an entry says, its numbers and boxes checked."""
    known_fields(at, given, ("kind", *fields))
    wish = {name: value for name, value in given.items() if value is not None}
    for name, value in wish.items():
        field_ = f"{at}/{name}"
        if name in _ABOVE_ZERO:
            check_above_zero(**{field_: value})
            wish[name] = bounded(field_, value, MAX_LENGTH)
        elif name in ("arm_min", "dead_length"):
            wish[name] = number(field_, value, 0.0)
        elif name in ("transmission_angle_min", "over_centre"):
            wish[name] = number(field_, value, 0.0) * radian
        elif name in ("ground_box", "motor_box"):
            wish[name] = box(field_, value, flat=True)
    return wish


def _spring(at: str, given: Mapping[str, Any], machine: LinkMotions, millimetres: float) -> dict[str, Any]:
    """One entry of `springs`, checked."""
    kind = one_of(f"{at}/kind", given.get("kind") if isinstance(given, Mapping) else None, SPRING_KINDS)
    wish = _wish(at, given, _SPRING_FIELDS, 1.0)
    names = (GROUND, *machine.links)
    if "between" in wish:
        both = wish["between"]
        if isinstance(both, str) or len(both) != 2 or both[0] == both[1] or any(one not in names for one in both):
            raise FieldError(f"/{at}/between", f"wanted two different ones of {', '.join(names)}")
        wish["between"] = (both[1], both[0]) if both[1] == GROUND else (both[0], both[1])
    real = kind == "gas" or "catalogue" in wish
    for name in ("holds", "hand_force_max"):
        if name in wish and not real:
            raise FieldError(
                f"/{at}/{name}",
                "needs springs of a `catalogue`: ideal springs balance the load at every position, so that it stays anywhere",
            )
    if "holds" in wish:
        known_fields(f"{at}/holds", wish["holds"], _HOLDS_AT)
        wish["holds"] = {name: flag(f"{at}/holds/{name}", wish["holds"].get(name)) for name in _HOLDS_AT}
    if "hand_force_max" in wish and machine.body is None:
        raise FieldError(f"/{at}/hand_force_max", "needs `position`: without it there is no body for a hand to move")
    if real:
        wish["kinds"] = read_springs(f"{at}/catalogue", wish.get("catalogue"), kind, millimetres)
        if "stiffness" in wish:
            raise FieldError(f"/{at}/stiffness", "of ideal springs, which need no catalogue")
    return wish


def _links(at: str, given: Any, machine: LinkMotions, names: list[str]) -> list[str]:
    if given is None:
        return names
    if isinstance(given, str) or not given:
        raise FieldError(f"/{at}", f"wanted a list of some of {', '.join(names)}")
    return list(dict.fromkeys(one_of(f"{at}/{k}", name, names) for k, name in enumerate(given)))


# -- what is found ----------------------------------------------------------------------------------------------------


def found_drives(place: _Place, asked: AskedDrives, top: int, work: Work) -> Drives:
    """The best drives of each kind, and springs."""
    with np.errstate(all="ignore"):
        search = _Search(place, asked, top, work)
        for wish in asked.drives:
            search.LOOKS[wish["kind"]](search, wish)
        for number_, wish in enumerate(asked.springs, 1):
            if work.expired():
                break
            search.spring(wish, number_)
    found = sorted(search.found, key=lambda row: row[0])
    kept = [one for kind in search.LOOKS for one in [one for _, one in found if one.kind == kind][:top]]
    torque = TorqueCurve(search.curve_at, search.torque, search.net, search.amount)
    if work.expired():
        search.notes.append("the time was up: not every place was looked at")
    return Drives(kept, search.refused, search.springs, torque, search.notes, place.machine)


class _Search:
    """All that is looked for on one linkage, and what was found."""

    def __init__(self, place: _Place, asked: AskedDrives, top: int, work: Work) -> None:
        self.place, self.asked, self.top, self.work = place, asked, top, work
        self.machine, self.fine = place.machine, place.fine
        self.torque = self.machine.torque(asked.load)
        fine = self.fine.torque(asked.load)
        step = (self.fine.at[-1] - self.fine.at[0]) / (FINE - 1)
        self.net = float(_simpson(fine) * step)
        self.amount = float(_simpson(np.abs(fine)) * abs(step))
        self.loaded = asked.loaded and bool(np.any(self.torque))
        # of a machine whose drive turns, angles in the user's unit
        self.unit = place.unit
        self.curve_at = self.machine.at / self.unit
        self.found: list[tuple[tuple[float, ...], Drive]] = []
        self.refused: list[Refusal] = []
        self.springs: list[Spring] = []
        self.notes: list[str] = []
        bodies = [] if self.machine.body is None else [self.machine.body]
        pivots = [one.pivot for one in self.machine.links.values() if one.pivot is not None]
        left, low, right, high = _envelope(*(one.origin for one in [*self.machine.links.values(), *bodies]), *pivots)
        room = max(right - left, high - low, self.machine.extent) / 2
        self.box: Box = (left - room, low - room, right + room, high + room)
        if asked.drives and not self.loaded and any(one["kind"] != "rotary" for one in asked.drives):
            self.notes.append(
                "no load was given: each has the best leverage that was found, and there are no forces to tell"
            )

    def _reach(self, wish: Mapping[str, Any], name: str) -> float:
        """How far a pin may be from its link's origin: what is asked, or the link's own size."""
        return float(wish.get("reach_max", self.machine.reaches.get(name, self.machine.extent)))

    def _pins(self, machine: LinkMotions, *ways: Sequence[Pull]) -> PinPeaks | None:
        """The largest pin forces of a four-bar with what drives it, of a motor on each of its ways."""
        if self.place.linkage is None or not self.loaded:
            return None
        linkage, load = of_four_bar(self.place.linkage), on_links(self.asked.load, self.place.linkage)
        held = [forces(linkage, machine.at, load, pulls) for pulls in ways]
        pins = [(one.driven_ground, one.driven, one.other, one.other_ground) for one in held]
        return PinPeaks(*(float(np.abs(pin).max()) for pin in zip(*pins)))

    def refuse(self, kind: str, link: str, reason: str, name: str | None = None) -> None:
        self.refused.append(Refusal(kind, link, name, reason))

    def _too_flat(self, kind: str, wish: Mapping[str, Any], link: str, words: str, angle: float | None) -> bool:
        """Whether a transmission angle is less than asked for; then it is refused."""
        least = wish.get("transmission_angle_min", 0.0)
        if angle is None or angle >= least:
            return False
        self.refuse(kind, link, f"{words} {np.rad2deg(angle):.4g}, below {np.rad2deg(least):.4g} degrees")
        return True

    def _keep(self, rank: tuple[float, ...], kind: Any, link: str, holds: str | None = None, **more: Any) -> None:
        """Keep a drive that was found; the least ``rank`` is the best."""
        swing = abs(self.machine.links[link].swing()) / self.place.radian
        drive = Drive(kind=kind, link=link, swing=swing, stops=_STOPS[kind], holds=holds or _HOLDS[kind], **more)
        self.found.append((rank, drive))

    def _told(self, value: One) -> One | None:
        """What is null without a load."""
        return value if self.loaded else None

    def _ends_of(self, found: Placement, pin: Complexes, arm: float, push: float, pull: float) -> dict[str, Any]:
        """Where an actuator or a knee is, and its `_extremes`."""
        return {
            "ground_point": xy(found.ground),
            "pin": xy(pin[0]),
            "pin_on_link": xy(found.pin),
            "length": _both_ends(found.length),
            "extends": found.extends,
            "arm_min": arm,
            "peak_force": self._told(max(push, pull)),
            "holding": self._told(_both_ends(found.force)),
        }

    # -- rotary --------------------------------------------------------------------------------------------------------

    def rotary(self, wish: Mapping[str, Any]) -> None:
        """A drive at a fixed pivot."""
        for name in wish["links"]:
            link = self.machine.links[name]
            rates = self.fine.links[name].rate
            if np.any(rates * rates[0] <= 0):
                k = int(np.argmax(rates * rates[0] <= 0))
                at = self.place.told(self.fine.at[k])
                where = self.place.poses_around(*self.fine.at[[max(k - 1, 0), k]])
                self.refuse("rotary", name, f"dead point {where}at {at}: the {name} turns back there")
                continue
            angle = self._pressure(name)
            if self._too_flat("rotary", wish, name, "its transmission angle falls to", angle):
                continue
            torque = self.torque / link.rate
            peak = None
            if self.loaded:

                def needed(at: Floats, name: str = name) -> Floats:
                    machine = self.place.poses(at)
                    return np.abs(machine.torque(self.asked.load) / machine.links[name].rate)

                peak = largest(needed, self.machine.at)
            self._keep(
                (peak or 0.0,),
                "rotary",
                name,
                motor=None if link.pivot is None else xy(link.pivot),
                peak_torque=peak,
                holding=self._told(_both_ends(torque)),
                transmission_angle_min=None if angle is None else angle / self.place.radian,
                curve=DriveCurve(self.curve_at, torque=self._told(torque)),
                pin_forces=self._pins(
                    self.machine, [Pull(name, link.origin, 0 * link.origin, torque)] * (name == "rocker")
                ),
            )

    def _pressure(self, name: str) -> float | None:
        """The least transmission angle with a four-bar driven at its crank or rocker."""
        links = self.fine.links
        if self.place.linkage is None or set(links) != {"crank", "coupler", "rocker"}:
            return None
        coupler, other = links["coupler"].direction, links["rocker" if name == "crank" else "crank"].direction
        return float(np.min(np.arctan2(np.abs(cross(coupler, other)), np.abs(dot(coupler, other)))))

    # -- actuators -----------------------------------------------------------------------------------------------------

    def _wanted(self, wish: Mapping[str, Any], name: str, link: LinkMotion, stroke: float | None = None) -> Wanted:
        """What a placement keeps to, with a least arm for a stroke (default: the longest) where none is asked for."""
        reach = self._reach(wish, name)
        least = _LEAST_ARM * (stroke or link.longest_way(reach)) / self.machine.span
        return Wanted(wish.get("ground_box", self.box), reach, wish.get("arm_min", least), wish.get("extends"))

    def actuator(self, wish: Mapping[str, Any]) -> None:
        """An actuator or cylinder between a link and the ground, or another link."""
        rows: list[Row] | None = wish.get("rows")
        for name in wish["links"]:
            if name == wish["on"]:
                continue
            if self.work.expired():
                return
            link = self.machine.seen(name, wish["on"])
            shortest = wish.get("stroke") if rows is None else min(row.actuator.stroke for row in rows)
            retracted, stroke = wish.get("retracted"), wish.get("stroke")
            wanted = self._wanted(wish, name, link, shortest)
            fine, question = (
                Question(link, self.machine.at, self.torque, wanted, grid, self.amount)
                for grid in (GRID, COARSE_GRID)
            )
            if rows is not None:
                bought, unfit = best_of_rows(question, rows, self.top, self.work)
                for place, one in enumerate(bought):
                    self._placed(wish, name, question, one.placement, one.row.actuator, one.row, place)
                if not bought:
                    self._none_fits(name, question, unfit)
                elif unfit:
                    self.notes.append(f"actuator on the {name}: {self._unfit(unfit)}")
                continue
            dead = wish.get("dead_length", 0.0)
            sizes = Actuator(retracted or question.size, stroke or question.size)
            if retracted and stroke:
                found = fine.best(sizes, self.work)
            else:
                found = question.best_of_sizes(Sizes(sizes, retracted is None, stroke is None, dead), self.work)
                if retracted is None and isinstance(found, Placement):
                    found = self._usual(fine, found, dead, stroke is None)
            if isinstance(found, Refused):
                self.refuse("actuator", name, self._sentence(found, question, sizes, stroke is None))
            else:
                low, high = float(found.length[[0, -1]].min()), float(found.length[[0, -1]].max())
                self._placed(wish, name, question, found, Actuator(low, high - low), None, 0)

    def _usual(self, question: Question, best: Placement, dead: float, stroke_free: bool) -> Placement:
        """An actuator of usual length in place of the best of any length, which may be longer than need be or not be had."""
        low, high = np.sort(best.length[[0, -1]]).tolist()
        whole = high - low
        had = dead > 0 or low >= _USUAL * whole * (1 - 1e-9)
        for share in (1.0, 0.85, 0.7, 0.55) if stroke_free and not had else (1.0,):
            stroke = share * whole
            for length in [stroke + dead] if dead else [_USUAL * stroke, 2 * stroke]:
                if self.work.expired() or (had and length >= low):
                    return best
                one = question.best(Actuator(length, stroke), self.work)
                if isinstance(one, Placement) and (not had or one.worst <= _HARDLY_MORE * best.worst):
                    return one
        return best

    def _placed(
        self,
        wish: Mapping[str, Any],
        name: str,
        question: Question,
        found: Placement,
        sizes: Actuator,
        row: Row | None,
        rank: int,
    ) -> None:
        if self._turns_back(wish, name, found):
            return
        rod = wish.get("rod") if row is None else wish["rods"].get(row.name, wish.get("rod"))
        most = _, push, pull = self._extremes(wish["on"], name, found)
        peak = max(push, pull)
        if row is not None and self.loaded and (push > row.push or pull > row.pull):
            self.refuse("actuator", name, f"needs a force of {peak:.4g} between the positions looked at", row.name)
            return
        ground, pin = self._ends(self.machine, wish["on"], name, found)
        bound = self._told(question.bound(sizes.stroke))
        worth: tuple[float, ...] = (found.worst,)
        if row is not None:
            worth = (math.inf if row.price is None else row.price, max(row.push, row.pull), found.worst)
        self._keep(
            (*worth, float(rank)),
            "actuator",
            name,
            on=wish["on"],
            name=None if row is None else row.name,
            price=None if row is None else row.price,
            **self._ends_of(found, pin, *most),
            retracted=sizes.retracted,
            stroke=sizes.stroke,
            bound=bound,
            over_bound=None if bound is None else peak / bound,
            buckling=None if rod is None or not self.loaded else self._buckling(wish["on"], name, found, rod),
            envelope=_envelope(ground, pin),
            pin_forces=self._pins(self.fine, self._pulls(wish["on"], name, found)),
            curve=DriveCurve(
                self.curve_at,
                found.length,
                found.arm,
                self._told(found.force),
                ground=plane(ground),
                pin=plane(pin),
            ),
        )

    def _turns_back(self, wish: Mapping[str, Any], name: str, found: Placement) -> bool:
        """Whether between the positions looked at the arm vanishes after all; then it is refused."""
        _, arm = self.fine.seen(name, wish["on"]).leverage(found.ground, found.pin)
        bad = arm * found.arm[0] <= 0
        if bad.any():
            at = self.place.told(self.fine.at[int(np.argmax(bad))])
            self.refuse(
                "actuator", name, f"dead point at {at} of the best placement, between the positions looked at"
            )
        return bool(bad.any())

    def _along(self, on: str, name: str, found: Placement, at: Floats) -> tuple[Floats, Floats, Floats]:
        """Length, arm and force of an actuator or a knee at places of the drive."""
        # the frame of a link that carries the other end lies as the plane does at the first position
        machine = self.place.poses(np.append(self.machine.at[0], at))
        length, arm = machine.seen(name, on).leverage(found.ground, found.pin)
        return length[1:], arm[1:], (machine.torque(self.asked.load) / arm)[1:]

    def _ends(self, machine: LinkMotions, on: str, name: str, found: Placement) -> tuple[Complexes, Complexes]:
        """Where both ends of an actuator go."""
        return machine.end(on, machine.point_on(on, found.ground)), machine.end(name, found.pin)

    def _pulls(self, on: str, name: str, found: Placement) -> list[Pull]:
        """What an actuator does to both links, at the fine positions."""
        ground, pin = self._ends(self.fine, on, name, found)
        length, _, force = self._along(on, name, found, self.fine.at)
        push = force * (pin - ground) / length
        return [Pull(name, pin, push), Pull(on, ground, -push)]

    def _most(self, on: str, name: str, found: Placement, of: Callable[[Floats, Floats, Floats], Floats]) -> float:
        """The largest value over the whole way of something that length, arm and force make."""
        return largest(lambda at: of(*self._along(on, name, found, at)), self.machine.at)

    def _extremes(self, on: str, name: str, found: Placement) -> tuple[float, float, float]:
        """Over the whole way the least moment arm, and the largest forces that an actuator pushes and pulls with."""
        return (
            -self._most(on, name, found, lambda length, arm, force: -np.abs(arm)),
            self._most(on, name, found, lambda length, arm, force: force),
            self._most(on, name, found, lambda length, arm, force: -force),
        )

    def _buckling(self, on: str, name: str, found: Placement, rod: float) -> Buckling:
        euler = np.pi**2 * _STEEL * self.asked.millimetres**2 * np.pi / 64 * rod**4
        worst = self._most(on, name, found, lambda length, arm, force: force * length**2)
        if worst <= 0:
            return Buckling(euler / float(found.length.max()) ** 2, None)
        longest = self._most(on, name, found, lambda length, arm, force: np.where(force > 0, length, 0.0))
        return Buckling(euler / longest**2, euler / worst)

    def _sentence(self, refused: Refused, question: Question, sizes: Actuator, free: bool) -> str:
        """Why an actuator finds no place, with the number that binds."""
        wanted, stroke = question.wanted, sizes.stroke
        what = "an actuator of free stroke" if free else f"stroke {stroke:.6g}"
        match refused.reason:
            case "reach":
                about = "the pivot" if question.link.pivot is not None else "the link's origin"
                return f"{what} needs a pin at {refused.needed:.4g} from {about}; reach_max is {wanted.reach:.6g}"
            case "box":
                return (
                    f"{what} needs a ground point at {refused.needed:.4g} from the pivot; ground_box has none there"
                )
            case "dead":
                low, high = refused.between or (0, 1)
                where = self.place.poses_around(*question.at[[low, high]])
                at = self.place.told(refused.needed)
                return f"{what}: even the best place that was found has a dead point {where}at {at}"
            case "arm":
                return f"{what}: the largest least arm found is {refused.needed:.4g}; arm_min is {wanted.arm:.4g}"
            case "knee":
                return f"the handle of the best knee turns back at {self.place.told(refused.needed)}, whichever way it bends"
        if refused.needed > 0 and not free:
            most = max(stroke - refused.needed, 0.0)
            return f"{what} is longer than any pin of the link goes from a point of ground_box: at most {most:.4g}"
        return f"{what} from {sizes.retracted:.6g} on fits no point of ground_box: no pin is so near, or so far, at both ends"

    def _none_fits(self, name: str, question: Question, unfit: list[Unfit]) -> None:
        """A line for the row that comes nearest, and how many others there are."""
        weak = [(why, max(row.push, row.pull), row.name) for row, why in unfit if isinstance(why, float)]
        if weak:
            force, most, called = min(weak, key=lambda one: one[0] / one[1])
            self.refuse("actuator", name, f"needs a force of {force:.4g}, and it gives {most:.4g}", called)
        placeless = [(row, why) for row, why in unfit if isinstance(why, Refused)]
        if placeless:
            row, why = min(placeless, key=lambda one: one[0].actuator.stroke)
            self.refuse("actuator", name, self._sentence(why, question, row.actuator, False), row.name)
        if len(unfit) > 2:
            self.notes.append(f"actuator on the {name}: {self._unfit(unfit)}")

    def _unfit(self, unfit: list[Unfit]) -> str:
        weak = sum(isinstance(one.why, float) for one in unfit)
        return f"{weak} rows of the catalogue are too weak and {len(unfit) - weak} find no place"

    # -- motors --------------------------------------------------------------------------------------------------------

    def dyad(self, wish: Mapping[str, Any]) -> None:
        """A motor that turns on, and a rod."""
        ratio = wish.get("time_ratio")
        for name in wish["links"]:
            if self.work.expired():
                return
            link, fine = self.machine.links[name], self.fine.links[name]
            reach = self._reach(wish, name)
            if link.pivot is not None:
                radius = wish.get("pin_radius", min(reach, 0.8 * self.machine.reaches.get(name, reach)))
                given, box = "pin_radius" in wish, wish.get("motor_box")
                found = about_pivot(link, self.torque, ratio, radius, given, box, reach=reach)
            else:
                radius = wish.get("pin_radius", reach)
                box = wish.get("motor_box", self.box)
                found = on_any_link(link, self.machine.at, self.torque, ratio, radius, box, self.work)
            if isinstance(found, str):
                self.refuse("dyad", name, found)
                continue
            torque = self.fine.torque(self.asked.load)
            whole = driven(fine, torque, found.motor, found.pin, found.crank, found.rod, found.extends)
            if whole is None:
                self.refuse("dyad", name, "the best motor's rod turns back between the positions looked at")
                continue
            if not self._too_flat("dyad", wish, name, "the best transmission angle is", whole.least_angle):
                self._motor(name, whole)

    def _motor(self, name: str, whole: Driven) -> None:
        coarse = slice(None, None, (FINE - 1) // (self.machine.at.size - 1))
        fine = self.fine.links[name]
        pin = fine.place(whole.pin)
        six = Swung(
            self.place.poses,
            Interval(*self.fine.at[[0, -1]].tolist()),
            Motor(name, whole.motor, whole.crank, whole.rod, whole.pin),
        )
        bar = self._six_bar(name, six, whole)
        motor = np.full(FINE, whole.motor)
        self._keep(
            (-bar.transmission_angle_min,),
            "dyad",
            name,
            motor=xy(whole.motor),
            pin=xy(pin[0]),
            pin_on_link=xy(whole.pin),
            length=_both_ends(whole.length),
            extends=whole.extends,
            peak_torque=bar.motor_torque_max,
            peak_force=self._told(float(np.abs(whole.rod_force).max())),
            envelope=_envelope(pin, *whole.crank_pin, motor),
            pin_forces=self._pins(
                self.fine,
                *(
                    [Pull(name, pin, force * (pin - knee) / whole.rod)]
                    for force, knee in zip(whole.rod_force, whole.crank_pin)
                ),
            ),
            curve=DriveCurve(
                self.curve_at,
                whole.length[coarse],
                force=self._told(whole.rod_force[0][coarse]),
                torque=self._told(whole.motor_torque[0][coarse]),
                ground=plane(motor[coarse]),
                pin=plane(pin[coarse]),
                knee=plane(whole.crank_pin[0][coarse]),
            ),
            six_bar=bar,
            linkage=on_hinge(six, self.place.radian)
            if self.place.view is None
            else SixBarLinkage.of_view(self.place.view, six, self.place.samples),
        )

    def _six_bar(self, name: str, six: Swung, whole: Driven) -> SixBar:
        """The whole turn of a motor at even steps."""
        radian, motor = self.place.radian, six.motor
        even = six.sense * np.linspace(0.0, TURN, 121)
        machine, at = six.machine(even), six.travel(even)
        plain = self.place.poses(at)
        rod, arm = machine.links[ROD], machine.links[MOTOR_CRANK].direction * motor.crank
        force = plain.torque(self.asked.load) / dot(rod.direction, plain.links[name].speed(motor.pin))
        torque = force * dot(rod.direction, 1j * arm)
        (forwards, backwards), dwell = six.turn, six.dwell(_DWELL)
        joints = self._joints(six)
        places = {one.name: xy(one.place[0]) for one in joints}
        on = {
            link: [one.name for one in joints if link in (one.first, one.second)] for link in (GROUND, *machine.links)
        }
        if self.place.view is not None and machine.body is not None:
            places["P"] = xy(six.machine(six.forwards(np.zeros(1))).link("body").origin[0])
            on["coupler"].append("P")
        return SixBar(
            motor.crank,
            motor.rod,
            "crank_rocker" if self.place.view is None else six.kind,
            whole.time_ratio,
            whole.least_angle / radian,
            self._told(float(np.abs(whole.motor_torque).max())),
            (forwards / radian, backwards / radian),
            (dwell[0] / radian, dwell[1] / radian),
            (six.start + even) / radian,
            at / self.unit,
            self._told(torque),
            self._told(force),
            plane(six.knee(even)),
            MOTOR_CRANK,
            places,
            [SixBarLink(link, names) for link, names in on.items()],
        )

    def _joints(self, six: Swung) -> list[Joint]:
        """Of a six-bar at the first sample, forwards; of a link on a hinge B is its pivot."""
        machine = six.machine(six.forwards(np.zeros(1)))
        if self.place.view is not None:
            return joints_of(self.place.view.plain, six.motor, machine)
        return [
            Joint("B", GROUND, six.motor.link, machine.links[six.motor.link].origin),
            *rod_joints(six.motor, machine),
        ]

    # -- knees ---------------------------------------------------------------------------------------------------------

    def toggle(self, wish: Mapping[str, Any]) -> None:
        """A knee that locks one end."""
        for name in wish["links"]:
            if self.work.expired():
                return
            link = self.machine.links[name]
            wanted = self._wanted(wish, name, link)
            last = wish["at"] == "last"
            found = locked(
                link, self.machine.at, self.torque, wanted, last, wish["over_centre"], wish["knee"], self.work
            )
            if isinstance(found, Refused):
                question = Question(link, self.machine.at, self.torque, wanted._replace(extends=last))
                self.refuse("toggle", name, self._sentence(found, question, Actuator(1.0, 1.0), True))
                continue
            self._locked(wish, name, found)

    def _locked(self, wish: Mapping[str, Any], name: str, found: Knee) -> None:
        place, link = found.placement, self.machine.links[name]
        if self._turns_back({"on": GROUND}, name, place):
            return
        pin = link.place(place.pin)
        still = np.full(pin.size, place.ground)
        lock = Lock(
            found.handle,
            found.strut,
            wish["over_centre"] / self.place.radian,
            wish["at"],
            found.overshoot / self.unit,
            self._told(float(np.abs(found.handle_torque).max())),
            self._told(found.holds),
        )
        held = "with its knee on the stop" if found.holds else "not: the load pulls its knee straight"
        self._keep(
            (not found.holds, place.worst),
            "toggle",
            name,
            held if self.loaded else "where the load pushes the strut together",
            **self._ends_of(place, pin, *self._extremes(GROUND, name, place)),
            peak_torque=lock.handle_torque_max,
            envelope=_envelope(still, pin, found.knee),
            curve=DriveCurve(
                self.curve_at,
                place.length,
                place.arm,
                self._told(place.force),
                self._told(found.handle_torque),
                plane(still),
                plane(pin),
                plane(found.knee),
            ),
            lock=lock,
        )

    # -- springs -------------------------------------------------------------------------------------------------------

    def spring(self, wish: Mapping[str, Any], number_: int) -> None:
        """Springs that take load off the drive: ideal ones without a catalogue, else those of the catalogue that do best."""
        kind, between = wish["kind"], wish.get("between")
        words = "any two links" if between is None else "-".join(between)
        if not self.loaded:
            self.refuse(kind, words, "there is no load to balance")
            return
        found = self._bought(wish) if "kinds" in wish else self._ideal(between, wish.get("stiffness"))
        if isinstance(found, str):
            self.refuse(kind, words, found)
        else:
            self._sprung(kind, number_, found, "kinds" not in wish, wish)

    def _bought(self, wish: Mapping[str, Any]) -> Fitted | str:
        """Find springs of a catalogue, or return a sentence with the reason for a refusal."""
        room = Room(
            wish.get("ground_box", self.box),
            float(wish.get("reach_max", self.machine.extent)),
            float(wish.get("clear", 0.05 * self.machine.extent)),
        )
        behaviour, kinds, between = self._behaviour(wish), wish["kinds"], wish.get("between")
        pairs = pairs_of(self.machine) if between is None else [between]
        found = best_spring(self.machine, self.torque, pairs, kinds, room, self.work, behaviour)
        pivoted = [(GROUND, name) for name, link in self.machine.links.items() if link.pivot is not None]
        if between is None and len(pivoted) > 1 and not self.work.expired():
            if isinstance(found, str) or not self._suffices(found, behaviour, _CARRIES_ALONE):
                two = best_pair(self.machine, self.torque, pivoted[:2], kinds, room, self.work, behaviour)
                if not isinstance(two, str) and (isinstance(found, str) or self._better(two, found, behaviour)):
                    found = two
        if isinstance(found, str) or self._suffices(found, behaviour, _HELPS):
            return found
        return self._no_help(found, behaviour)

    def _behaviour(self, wish: Mapping[str, Any]) -> Behaviour | None:
        """Read the limits that an entry of `springs` sets on the torque with its springs."""
        holds, force = wish.get("holds", {}), wish.get("hand_force_max")
        if not any(holds.values()) and force is None:
            return None
        return Behaviour(
            self.machine.sense,
            _HOLD_MARGIN * float(np.abs(self.torque).max()),
            bool(holds.get("closed")),
            bool(holds.get("open")),
            None if force is None else force * np.abs(self._hand_speed()),
        )

    def _hand_speed(self) -> Complexes:
        """Return the velocity of the hand's place, by default the body point, per unit of the drive's coordinate."""
        body = self.machine.body
        assert body is not None
        return body.speed(0j if self.asked.hand is None else body.point_at(self.asked.hand))

    def _lacks(self, found: Fitted, behaviour: Behaviour | None) -> float:
        """Return by which torque springs violate a behaviour; 0 up to rounding."""
        lacks = 0.0 if behaviour is None else float(behaviour.violation(found.torque))
        return lacks if lacks > 1e-5 * float(np.abs(self.torque).max()) else 0.0

    def _suffices(self, found: Fitted, behaviour: Behaviour | None, share: float) -> bool:
        """Check that springs show the requested behaviour, or without such a request leave at most a part of the torque."""
        if behaviour is not None:
            return self._lacks(found, behaviour) == 0
        return found.rms <= share * _size(self.torque).rms

    def _better(self, one: Fitted, other: Fitted, behaviour: Behaviour | None) -> bool:
        return (self._lacks(one, behaviour), one.rms) < (self._lacks(other, behaviour), other.rms)

    def _no_help(self, found: Fitted, behaviour: Behaviour | None) -> str:
        """Say what the best springs leave."""
        where = " and ".join(
            f"{kind.name if kind else 'spring'} from {spring.between[0]} to {spring.between[1]}"
            for kind, spring in zip(found.kinds, found.springs)
        )
        if behaviour is None:
            share = 100 * found.rms / _size(self.torque).rms
            return f"the best ({where}) leaves {share:.3g} % of the rms torque: a spring is returned if it leaves at most half"
        wrong = []
        first, last = found.torque[[0, -1]] * self.machine.sense
        if behaviour.holds_first and first < behaviour.margin:
            wrong.append("does not hold the first position (closed)")
        if behaviour.holds_last and -last < behaviour.margin:
            wrong.append("does not hold the last position (open)")
        if behaviour.torque_max is not None and np.any(np.abs(found.torque) > behaviour.torque_max):
            wrong.append(f"needs a hand force of {np.abs(found.torque / self._hand_speed()).max():.4g}")
        return f"no spring of the catalogue behaves so: the nearest ({where}) {' and '.join(wrong)}"

    def _ideal(self, between: tuple[str, str] | None, stiffness: float | None) -> Fitted | str:
        """Springs of zero free length that balance in every position, or why there are none."""
        linkage, load = self.place.linkage, self.asked.load
        if load.torque or load.speed:
            return "a torque, or inertia, has no potential that springs of zero free length carry: give a catalogue"
        if linkage is None:
            return self._ideal_pendulums(between, stiffness)
        potential = potential_of(linkage, load)
        if between is None:
            return fitted(self.machine, self.torque, two_springs(potential, stiffness))
        found = one_spring(potential, between)
        if isinstance(found, Placed):
            if stiffness is not None and abs(stiffness - found.stiffness) > 1e-9 * stiffness and between[0] != GROUND:
                return (
                    f"the only spring between {between[0]} and {between[1]} has the stiffness {found.stiffness:.6g}"
                )
            if stiffness is not None and between in ((GROUND, "crank"), (GROUND, "rocker")):
                both = two_springs(potential, stiffness)
                found = next(one for one in both if one.between == between)
            return fitted(self.machine, self.torque, [found])
        if math.isinf(found):
            return f"one spring between {between[0]} and {between[1]} does not balance this load; two springs do: leave `between`"
        return f"one spring would need the stiffness {found:.6g}, below 0; two springs balance it: leave `between`"

    def _ideal_pendulums(self, between: tuple[str, str] | None, stiffness: float | None) -> Fitted | str:
        """Springs of zero free length on a body on guides, or on a link on a hinge."""
        guided = None if self.place.view is None else self.place.view.plain
        assert not isinstance(guided, Linkage)
        springs = springs_on_pendulums(guided, self.machine, self.torque, stiffness)
        if springs is None:
            kind = "link on a hinge" if guided is None else guided.kind.value
            return f"no springs of zero free length on a {kind} balance this load in every position: give a catalogue"
        if not springs:
            return "the drive carries nothing that springs could balance"
        if between is not None and (len(springs) > 1 or springs[0].between != between):
            where = " and ".join("-".join(one.between) for one in springs)
            return f"one spring between {between[0]} and {between[1]} does not balance this load; {where} do: leave `between`"
        return fitted(self.machine, self.torque, springs)

    def _sprung(self, kind: Any, number_: int, found: Fitted, exact: bool, wish: Mapping[str, Any]) -> None:
        sizes = BeforeAfter(_size(self.torque), _size(found.torque))
        if found.rms > _HELPS * sizes.before.rms:
            share = 100 * found.rms / sizes.before.rms
            self.notes.append(
                f"springs of set {number_} show the requested behaviour, but leave {share:.3g} % of the rms torque of the drive"
            )
        hand = None
        if self.machine.body is not None and (self.asked.hand is not None or "hand_force_max" in wish):
            hand = found.torque / np.abs(self._hand_speed()) * self.machine.sense
        signs = found.torque[[0, -1]] * self.machine.sense
        quiet = 1e-9 * max(sizes.before.peak, 1e-300)
        holds = Holds(bool(signs[0] >= -quiet), bool(signs[1] <= quiet))
        words = ["stays" if abs(one) <= quiet else "falls back" if one > 0 else "goes on" for one in signs]
        first = {"stays": "stays", "falls back": "is pressed onto its stop", "goes on": "opens by itself"}[words[0]]
        last = {"stays": "stays", "falls back": "closes by itself", "goes on": "is held open"}[words[1]]
        both = [[*map(self.machine.end, spring.between, spring.points)] for spring in found.springs]
        pulls: list[Pull] = []
        for spring, length, (one, other) in zip(found.springs, found.lengths, both):
            # over a length of 0 a spring of zero free length has no force either
            pull = spring.force(length) / np.maximum(length, 1e-300) * (other - one)
            pulls += [Pull(spring.between[0], one, pull), Pull(spring.between[1], other, -pull)]
        pins = self._pins(self.machine, pulls)
        for spring, row, length, places in zip(found.springs, found.kinds, found.lengths, both):
            ends = plane(np.stack(places, axis=1))
            self.springs.append(
                Spring(
                    kind=kind,
                    set=number_,
                    name=None if row is None else row.name,
                    between=spring.between,
                    points=(_both_ends(ends[0, 0]), _both_ends(ends[0, 1])),
                    points_on_links=(xy(spring.points[0]), xy(spring.points[1])),
                    stiffness=spring.stiffness,
                    free_length=spring.free_length,
                    preload=spring.preload,
                    length=(float(length.min()), float(length.max())),
                    torque=sizes,
                    exact=exact,
                    pin_forces=pins,
                    stays=f"first position: {first}; last: {last}",
                    holds=holds,
                    hand_force_max=None if hand is None else float(np.abs(hand).max()),
                    curve=SpringCurve(self.curve_at, length, spring.force(length), found.torque, hand, ends),
                )
            )

    LOOKS: ClassVar = {"rotary": rotary, "actuator": actuator, "dyad": dyad, "toggle": toggle}
    """What looks for each kind, in the order of a reply."""


def _simpson(values: Floats) -> float:
    """The integral over even steps of 1, by Simpson's rule; an odd number of values."""
    return float((values[0] + values[-1] + 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()) / 3)


def _size(torque: Floats) -> TorqueSize:
    return TorqueSize(float(np.sqrt(np.mean(torque**2))), float(np.abs(torque).max()))


def _both_ends(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[-1])


def _envelope(*places: Any) -> tuple[float, float, float, float]:
    every = np.concatenate([np.atleast_1d(one) for one in places])
    return float(every.real.min()), float(every.imag.min()), float(every.real.max()), float(every.imag.max())
