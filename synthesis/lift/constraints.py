"""What a lift must keep to so that it can be built: bounds, cylinder, dead point, acceleration, jerk, space, transmission.

A design that meets the stroke has five lengths and the closed length of its cylinder; each constraint is a slack of such
designs, at each of a number of poses where it is about the motion. Numbers in parentheses are the equations of the source
named in `synthesis.lift.pose`; (31) and (35), its collinear start and its order of the sides, are kept where ``start`` is
"collinear" and dropped otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from synthesis.lift.motion import refusal
from synthesis.lift.objective import Task
from synthesis.lift.pose import Cylinder, Design, Pose, dead_point, pose_at_turn, shape
from synthesis.one_variable import Floats, rising_root

SEARCH_NODES = 65
"""Poses of a design while it is searched, from the start to the top."""
FINE_NODES = 257
"""Poses when the best are brought onto their constraints."""
PAST_NODES = 33
"""Poses past the start between which the dead point is isolated."""
STRICT = 1e-3
"""Share of the top height by which l3 stays below l5, a strict inequality (36)."""

Range = tuple[float | None, float | None]


@dataclass(frozen=True)
class Constraints:
    """Limits of a design; None stands for no limit. Lengths, speeds and times in the task's units, angles in radians.

    ``lengths``: the range of each of l2, l3, l4, l5, b (37). ``closed_length``: the range of the cylinder's length at the
    start. ``extension_max``: length at the top over the closed length. ``dead_point_min``: cylinder length between the
    start and the dead point below it, as a share of the closed length. ``acceleration_max``, ``jerk_max``: of the
    platform, in size. ``rise_time``: range. ``envelope``: smallest and largest x and y of all joints. ``transmission_min``:
    angle of the cylinder to the direction in which it cannot move B. ``force_ratio_max``: cylinder force over load.
    """

    lengths: dict[str, Range]
    closed_length: tuple[float, float]
    extension_max: float | None = None
    dead_point_min: float | None = None
    acceleration_max: float | None = None
    jerk_max: float | None = None
    rise_time: Range = (None, None)
    envelope: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    transmission_min: float | None = None
    force_ratio_max: float | None = None
    start: Literal["any", "collinear"] = "any"


@dataclass(frozen=True)
class Built:
    """Designs that meet the stroke, with the triangle's angle gamma at A, the turn at the start and the closed length."""

    design: Design
    gamma: Any
    turn: Any
    closed: Any

    def taken(self, rows: Any) -> Built:
        """Some of them."""
        fields = (np.asarray(value)[rows] for value in (*self.design.as_tuple(), self.gamma, self.turn, self.closed))
        *lengths, gamma, turn, closed = fields
        return Built(Design(*lengths), gamma, turn, closed)


@dataclass(frozen=True)
class Run:
    """The platform's motion over poses: its speed, acceleration and jerk, and the gain ds/dl1 at each."""

    pose: Pose
    gain: Any
    velocity: Any
    acceleration: Any
    jerk: Any


def jerky_run(pose: Pose, cylinder: Cylinder, speed: Any) -> Run:
    """Speed, acceleration and jerk of the platform at poses, for a cylinder of given speed there.

    With g = ds/dl1, g2 = (s'' - g l1'') / l1'^2 and g3 = (s''' - 3 g2 l1' l1'' - g l1''') / l1'^3, its derivatives by the
    cylinder's length: v = g v_l, a = g2 v_l^2 + g a_l, j = g3 v_l^3 + 3 g2 v_l a_l.

    Laws: each is the time derivative of the one before; v and a are `synthesis.lift.motion`'s.
    """
    l3, k2, root = pose.design.l3, pose.form.k_squared, pose.root
    sin, cos, s, s1, s2 = pose.sin_turn, pose.cos_turn, pose.height, pose.height_1, pose.height_2
    # s'' = s'^2 / s - s w with w = l3 cos T (k^2 + l3^2) / root^3
    cube = (k2 + l3 * l3) * l3 / (root * root * root)
    w, w_1 = cos * cube, sin * cube * (3 * l3 * l3 * cos * cos / (root * root) - 1)
    s3 = (s1 / s) * (2 * s2 - s1 * (s1 / s)) - s1 * w - s * w_1
    y1, y2, y3 = s1 + pose.across, s2 + pose.down, s3 - pose.across
    third = -3 * pose.down * pose.across - pose.x * pose.down + 3 * y1 * y2 + pose.y * y3
    l_1, l_2 = pose.length_1, pose.length_2
    l_3 = (third - 3 * l_1 * l_2) / pose.length
    gain = pose.gain
    second = (s2 - gain * l_2) / (l_1 * l_1)
    third = (s3 - 3 * second * l_1 * l_2 - gain * l_3) / (l_1 * l_1 * l_1)
    along = cylinder.acceleration
    acceleration = second * speed * speed + gain * along
    return Run(pose, gain, gain * speed, acceleration, speed * (third * speed * speed + 3 * second * along))


def speeds_at(pose: Pose, cylinder: Cylinder, closed: Any, top: Any) -> Any:
    """The cylinder's speed at poses, with its sign; NaN where it has come to rest before."""
    along = cylinder.acceleration * np.sign(cylinder.speed)
    covered = pose.length - closed if cylinder.speed > 0 else top - pose.length
    square = cylinder.speed * cylinder.speed + 2 * along * covered
    return np.sign(cylinder.speed) * np.sqrt(np.where(square >= 0, square, np.nan))


def turns_of(built: Built, nodes: int) -> Floats:
    """Turns from the start to the top, shape (n, nodes), closer towards the start, where a lift changes fastest."""
    share = np.linspace(0.0, 1.0, nodes)
    return np.asarray(built.turn)[:, None] * (1 - share * share)


def columns(design: Design) -> Design:
    """Designs (n,) as columns (n, 1), to broadcast against poses."""
    return Design(*(np.asarray(value)[:, None] for value in design.as_tuple()))


def dead_lengths(built: Built) -> Floats:
    """The cylinder's length at the first dead point below the start, (n,); its length at the start where that is past one.

    Isolated between even turns; a narrower pair of dead points is for `synthesis.lift.pose.dead_point` to find.
    """
    design, gamma = columns(built.design), np.asarray(built.gamma)[:, None]
    form = shape(design, gamma)
    turn = np.asarray(built.turn)
    share = np.linspace(0.0, 1.0, PAST_NODES) ** 1.5
    turns = turn[:, None] + (turn[:, None] + 0.5) * share
    rising = pose_at_turn(design, turns, form).half_square_1 > 0
    at = np.maximum(np.argmax(rising, axis=1), 1)
    rows = np.arange(turn.size)

    def rate(where: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(built.design, where, shape(built.design, built.gamma))
        return pose.half_square_1, pose.half_square_2

    low, high = turns[rows, at - 1], turns[rows, at]
    found = rising[rows, at]
    root = rising_root(rate, low, high, 0.5 * (low + high))
    lowest = pose_at_turn(built.design, np.where(found, root, turns[:, -1]), shape(built.design, built.gamma)).length
    return np.where(rising[:, 0], built.closed, lowest)


def slacks(built: Built, task: Task, limits: Constraints, nodes: int = SEARCH_NODES) -> dict[str, Floats]:
    """The slacks of all constraints by name, (n, 1) or (n, nodes) each, in units of the limit; negative where one fails.

    NaN where a design cannot be assembled.
    """
    design, drive, high = built.design, task.cylinder, task.high
    found: dict[str, Any] = {}

    def within(name: str, value: Any, bounds: Any, unit: float | None = None) -> None:
        low, most = bounds
        value = np.asarray(value)
        value = value[:, None] if value.ndim == 1 else value
        if low is not None:
            found[f"{name}>=min"] = (value - low) / (unit or abs(low) or high)
        if most is not None:
            found[f"{name}<=max"] = (most - value) / (unit or abs(most) or high)

    for name, bounds in limits.lengths.items():
        within(name, getattr(design, name), bounds, high)
    within("closed_length", built.closed, limits.closed_length, high)
    found["l3<l5"] = ((design.l5 - design.l3) / high - STRICT)[:, None]
    if limits.start == "collinear":
        found["l3<=l2"] = ((design.l2 - design.l3) / high)[:, None]
        found["l4<=l2"] = ((design.l2 - design.l4) / high)[:, None]
    wide = columns(design)
    form = shape(wide, np.asarray(built.gamma)[:, None])
    pose = pose_at_turn(wide, turns_of(built, nodes), form)
    closed, top = np.asarray(built.closed)[:, None], pose.length[:, -1:]
    # the cylinder lengthens all the way: its rate keeps its sign, and the transmission angle is not 0
    push = -pose.length_1 / np.hypot(pose.down, pose.height_1 + pose.across)
    least = np.sin(limits.transmission_min or 0.0)
    found["transmission>=min"] = push - max(least, 1e-6)
    if limits.extension_max is not None:
        found["extension<=max"] = 1 - top / (limits.extension_max * closed)
    if limits.dead_point_min is not None:
        share = 1 - dead_lengths(built)[:, None] / closed
        found["dead_point>=min"] = share - limits.dead_point_min
    with np.errstate(all="ignore"):
        speed = speeds_at(pose, drive, closed, top)
        run = jerky_run(pose, drive, speed)
    if drive.acceleration * np.sign(drive.speed) < 0:
        reach = drive.speed * drive.speed / (2 * abs(drive.acceleration))
        found["stopping"] = (reach - (top - closed)) / high
    for name, values, most in (
        ("acceleration", run.acceleration, limits.acceleration_max),
        ("jerk", run.jerk, limits.jerk_max),
    ):
        if most is not None:
            values = np.where(np.isfinite(values), values, np.inf)
            found[f"{name}<=max"] = 1 - np.abs(values) / most
    if limits.force_ratio_max is not None:
        found["force_ratio<=max"] = 1 - np.abs(pose.gain) / limits.force_ratio_max
    if any(bound is not None for bound in limits.rise_time):
        within("rise_time", _duration(top - closed, drive), limits.rise_time)
    _envelope(found, pose, limits, high)
    return found


def _duration(travel: Any, drive: Cylinder) -> Any:
    """The time of the rise; see `synthesis.lift.motion.travel_time`."""
    speed, along = abs(drive.speed), drive.acceleration * np.sign(drive.speed)
    return 2 * travel / (speed + np.sqrt(np.maximum(speed * speed + 2 * along * travel, 0.0)))


def _envelope(found: dict[str, Any], pose: Pose, limits: Constraints, high: float) -> None:
    """The joints that move, A, B and C, within the box; the pivot D is below A, and O is a fact (`check_constraints`)."""
    x = np.stack(np.broadcast_arrays(pose.x, pose.design.l3 * pose.sin_turn - pose.design.b, -pose.design.b), axis=-1)
    y = np.stack(np.broadcast_arrays(pose.y, pose.root, pose.height), axis=-1)
    names = ("x_min>=min", "y_min>=min", "x_max<=max", "y_max<=max")
    for name, bound, values, side in zip(names, limits.envelope, (x, y, x, y), (1, 1, -1, -1)):
        if bound is not None:
            found[name] = side * ((values.min(axis=-1) if side > 0 else values.max(axis=-1)) - bound) / high


def least(found: dict[str, Floats]) -> dict[str, Floats]:
    """The least slack of each constraint over its poses, (n,)."""
    return {name: np.min(values, axis=1) for name, values in found.items()}


def check_constraints(limits: Constraints) -> None:
    """Refuse constraints that no design can keep: empty ranges, or a box without the cylinder's pivot.

    Raises
    ------
    FieldError
        With ``constraint`` the field's name.
    """
    ranges = {**limits.lengths, "closed_length": limits.closed_length, "rise_time": limits.rise_time}
    for name, (low, high) in ranges.items():
        if low is not None and high is not None and low > high:
            message = f"the range must not be empty: {low:.9g} is above {high:.9g}"
            raise refusal(name, f"/constraints/{name}", low - high, message)
    left, bottom, right, top = limits.envelope
    for k, (bound, side) in enumerate(zip((left, bottom, right, top), (1, 1, -1, -1))):
        if bound is not None and side * bound > 0:
            message = f"the box must hold the cylinder's pivot at (0, 0), found {bound:.9g}"
            raise refusal("envelope", f"/constraints/envelope/{k}", abs(bound), message)


MEASURED_NODES = 2001


def measured(built: Built, task: Task) -> dict[str, float]:
    """What the constraints are about, of one design over `MEASURED_NODES` poses; ``transmission`` in radians."""
    one = Built(
        Design(*(np.array([value], dtype=float) for value in built.design.as_tuple())),
        *(np.array([value], dtype=float) for value in (built.gamma, built.turn, built.closed)),
    )
    wide, drive = columns(one.design), task.cylinder
    pose = pose_at_turn(wide, turns_of(one, MEASURED_NODES), shape(wide, one.gamma[:, None]))
    closed, top = float(built.closed), float(pose.length[0, -1])
    run = jerky_run(pose, drive, speeds_at(pose, drive, closed, top))
    x = np.concatenate([pose.x[0], (wide.l3 * pose.sin_turn - wide.b)[0], [0.0, -float(built.design.b)]])
    y = np.concatenate([pose.y[0], pose.root[0], pose.height[0], [0.0]])
    push = -pose.length_1 / np.hypot(pose.down, pose.height_1 + pose.across)
    return {
        **built.design.as_dict(),
        "closed_length": closed,
        "extension": top / closed,
        "dead_point": 1 - float(pose_at_turn(built.design, dead_point(built.design)).length) / closed,
        "acceleration": float(np.max(np.abs(run.acceleration))),
        "jerk": float(np.max(np.abs(run.jerk))),
        "rise_time": float(_duration(top - closed, drive)),
        "transmission": float(np.arcsin(np.clip(np.min(push), -1.0, 1.0))),
        "force_ratio": float(np.max(np.abs(pose.gain))),
        "x_min": float(x.min()),
        "y_min": float(y.min()),
        "x_max": float(x.max()),
        "y_max": float(y.max()),
    }


@dataclass(frozen=True)
class Row:
    """One limit beside what a design has: ``least`` says that the value may not be less, else not more."""

    name: str
    value: float
    limit: float
    least: bool

    @property
    def kept(self) -> bool:
        """Whether the design keeps to it."""
        return self.value >= self.limit if self.least else self.value <= self.limit


def rows_of(limits: Constraints, values: dict[str, float]) -> list[Row]:
    """Every limit beside the value of `measured`."""
    left, bottom, right, top = limits.envelope
    ranges: dict[str, Range] = {
        **limits.lengths,
        "closed_length": limits.closed_length,
        "extension": (None, limits.extension_max),
        "dead_point": (limits.dead_point_min, None),
        "acceleration": (None, limits.acceleration_max),
        "jerk": (None, limits.jerk_max),
        "rise_time": limits.rise_time,
        "transmission": (limits.transmission_min, None),
        "force_ratio": (None, limits.force_ratio_max),
        "x_min": (left, None),
        "y_min": (bottom, None),
        "x_max": (None, right),
        "y_max": (None, top),
    }
    return [
        Row(name, values[name], limit, least_end)
        for name, pair in ranges.items()
        for limit, least_end in zip(pair, (True, False))
        if limit is not None
    ]
