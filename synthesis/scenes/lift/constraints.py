"""What a lift must keep to so that it can be built, and the optimum within it.

A design that meets the stroke has five lengths and the closed length of its cylinder; each constraint is a slack of such
designs, at each of a number of poses where it is about the motion. Numbers in parentheses are the equations of the source
named in `synthesis.scenes.lift.pose`; (31) and (35), its collinear start and its order of the sides, are kept where ``start`` is
"collinear" and dropped otherwise.

The search gives a design by l2, gamma, l3 and the closed length; b follows from the length of the cylinder at the start, or,
with the collinear start, l3 and b from (31) and (32), so that every design meets the stroke exactly. The best of a spread of
designs are descended along their constraints, all at once: a sequential quadratic program in at most four variables each,
whose linear rows are the slacks at all poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, rising_root
from synthesis.quadratic import minimise_quadratics
from synthesis.scenes.lift.motion import refusal
from synthesis.scenes.lift.optimum import (
    OPEN_END,
    Built,
    Evaluator,
    Optimum,
    Task,
    angle_limit,
    check_task,
    design_from_angle,
)
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    angle_or_flat,
    dead_point,
    joints,
    pose_at_turn,
    shape,
    third_side,
)
from synthesis.work import Work

SEARCH_NODES = 65
"""Poses of a design while it is searched, from the start to the top."""
FINE_NODES = 257
"""Poses when the best are brought onto their constraints."""
PAST_NODES = 33
"""Poses past the start between which the dead point is isolated."""
STRICT = 1e-3
"""Share of the top height by which l3 stays below l5, a strict inequality (36)."""
MEASURED_NODES = 2001
SPREAD = 4096
"""Designs of the first look, on each side of the cylinder's pivot."""
COARSE_NODES = 17
NEAR = 1024
"""Designs of the first look whose objective is computed: those that break the constraints least."""
STARTS = 32
APART = 0.08
"""Distance between two starts, in units of the ranges."""
ROUNDS, FINE_ROUNDS = 30, 20
LAST = 3
"""Descents that are finished on `FINE_NODES` poses."""
STEP = 1e-6
"""Of the differences that slopes are taken by, in units of the ranges."""
MARGIN, SINGLE_MARGIN = 5e-5, 1e-5
"""Share of a limit by which a design stays inside, so that poses between the nodes do too; of a limit that no pose is about."""
REACH, LEAST_REACH = 0.15, 1e-8
"""First and last length of a step, in units of the ranges."""
WEIGHTS = 30.0, 300.0
"""Of the worst broken constraint beside the logarithm of the objective; the larger one where nothing is found by the other."""
ACTIVE = 2e-3
"""Slack, in units of the limit, below which a constraint holds a design."""
REACHES = 1 + 1e-6
"""Share by which l3 stays above half of the stroke, where A would only just come down to the start."""
CLOSED = 1e-12
"""Share of its end below which a range is one value, and of a limit that rounding may break."""

SLACK_UNITS = {
    **dict.fromkeys(("acceleration<=max", "jerk<=max", "extension<=max", "force_ratio<=max"), "of its limit"),
    **dict.fromkeys(("rise_time>=min", "rise_time<=max"), "of its limit"),
    "dead_point>=min": "of the closed length",
    "transmission>=min": "in the sine of the angle",
}
"""What a slack is counted in; a length's in the top height."""

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

    Laws: each is the time derivative of the one before; v and a are `synthesis.scenes.lift.motion`'s.
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

    Isolated between even turns; a narrower pair of dead points is for `synthesis.scenes.lift.pose.dead_point` to find.
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
            # past where the cylinder rests there are no rates
            found[f"{name}<=max"] = np.where(np.isnan(speed), 0.0, 1 - np.abs(values) / most)
    if limits.force_ratio_max is not None:
        found["force_ratio<=max"] = 1 - np.abs(pose.gain) / limits.force_ratio_max
    if any(bound is not None for bound in limits.rise_time):
        within("rise_time", _duration(top - closed, drive), limits.rise_time)
    _envelope(found, pose, limits, high)
    return found


def _duration(travel: Any, drive: Cylinder) -> Any:
    """The time of the rise; see `synthesis.scenes.lift.motion.travel_time`."""
    speed, along = abs(drive.speed), drive.acceleration * np.sign(drive.speed)
    return 2 * travel / (speed + np.sqrt(np.maximum(speed * speed + 2 * along * travel, 0.0)))


def _envelope(found: dict[str, Any], pose: Pose, limits: Constraints, high: float) -> None:
    """A, B and C within the box; the pivot D is below A, and O and how high A is are facts (`check_constraints`)."""
    places = joints(pose)
    moving = np.stack([places[name] for name in "ABC"], axis=-1)
    x, y = moving.real, moving.imag[..., 1:]
    names = ("x_min>=min", "y_min>=min", "x_max<=max", "y_max<=max")
    for name, bound, values, side in zip(names, limits.envelope, (x, y, x, y), (1, 1, -1, -1)):
        if bound is not None:
            found[name] = side * ((values.min(axis=-1) if side > 0 else values.max(axis=-1)) - bound) / high


def least(found: dict[str, Floats]) -> dict[str, Floats]:
    """The least slack of each constraint over its poses, (n,)."""
    return {name: np.min(values, axis=1) for name, values in found.items()}


def check_constraints(limits: Constraints, top: float) -> None:
    """Refuse constraints that no design can keep: empty ranges, or a box without the cylinder's pivot or the top height.

    Raises `FieldError`: with ``constraint`` the field's name.
    """
    ranges = {**limits.lengths, "closed_length": limits.closed_length, "rise_time": limits.rise_time}
    for name, (low, high) in ranges.items():
        if low is not None and high is not None and low > high:
            message = f"the range must not be empty: {low:.9g} is above {high:.9g}"
            raise refusal(name, f"/constraints/{name}", low - high, message)
    for k, (bound, side, held) in enumerate(zip(limits.envelope, (1, 1, -1, -1), (0.0, 0.0, 0.0, top))):
        if bound is not None and side * (bound - held) > 0:
            what = f"the top of the stroke at {held:.9g}" if held else "the cylinder's pivot at (0, 0)"
            message = f"the box must hold {what}, found {bound:.9g}"
            raise refusal("envelope", f"/constraints/envelope/{k}", abs(bound - held), message)


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
    at = np.concatenate([place.ravel() for place in joints(pose).values()])
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
        "x_min": float(at.real.min()),
        "y_min": float(at.imag.min()),
        "x_max": float(at.real.max()),
        "y_max": float(at.imag.max()),
    }


@dataclass(frozen=True)
class ConstraintRow:
    """One limit beside what a design has, the least or the most that it may have, and whether it holds the design."""

    name: str
    value: float
    kind: Literal["least", "most"]
    limit: float
    active: bool

    @property
    def kept(self) -> bool:
        """Whether the design keeps to it."""
        return self.value >= self.limit if self.kind == "least" else self.value <= self.limit


def rows_of(limits: Constraints, values: dict[str, float], active: Sequence[str] = ()) -> list[ConstraintRow]:
    """Every limit beside the value of `measured`; ``active`` as an `Optimum` names them."""
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
    ends: tuple[tuple[Literal["least", "most"], str], ...] = (("least", ">=min"), ("most", "<=max"))
    return [
        ConstraintRow(name, values[name], kind, limit, name + suffix in active)
        for name, pair in ranges.items()
        for limit, (kind, suffix) in zip(pair, ends)
        if limit is not None
    ]


@dataclass(frozen=True)
class Space:
    """The variables of a task within its constraints, each from 0 to 1."""

    task: Task
    limits: Constraints

    @property
    def count(self) -> int:
        """Variables: l2, gamma, and as far as they are free, l3 and the closed length."""
        return 2 + (self.limits.start == "any") + self._closed_is_free

    @property
    def _closed_is_free(self) -> bool:
        low, high = self.limits.closed_length
        return high - low > CLOSED * high

    def designs(self, place: Floats, side: Floats) -> Built:
        """The designs at places (n, count); ``side`` -1: B starts on the far side of the cylinder's pivot."""
        low, high = self.task.low, self.task.high
        at = iter(np.clip(place, 0.0, 1.0).T)

        def between(name: str, least_end: float, most_end: float) -> Floats:
            first, last = self.limits.lengths.get(name, (None, None))
            first, last = max(first or 0.0, least_end), min(np.inf if last is None else last, most_end)
            return np.asarray(first + (last - first) * next(at))

        l2, turning = between("l2", 1e-6 * high, np.inf), OPEN_END + (1 - 2 * OPEN_END) * next(at)
        closed_low, closed_high = self.limits.closed_length
        with np.errstate(all="ignore"):
            if self.limits.start == "any":
                # below half of the stroke C cannot hang A so low
                l3, gamma = between("l3", REACHES * 0.5 * (high - low), 0.5 * high), np.pi * turning
                closed = closed_low + (closed_high - closed_low) * (next(at) if self._closed_is_free else 0.0)
                l5 = high - l3
                turn = angle_or_flat(low, l3, l5)
                across, y = l2 * np.sin(turn - gamma), low - l2 * np.cos(turn - gamma)
                square = (closed - y) * (closed + y)
                b = across + side * np.sqrt(np.where(square > 0, square, np.nan))
                b = np.where(b > 0, b, np.nan)
                design = Design(l2, l3, third_side(l2, l3, gamma), l5, b)
            else:
                closed = closed_low + (closed_high - closed_low) * (next(at) if self._closed_is_free else 0.0)
                gamma = turning * angle_limit(l2, closed, low)
                design = design_from_angle(l2, gamma, closed, low, high)
                turn = np.arctan2(design.b, low) + gamma
        return Built(design, gamma, turn, np.broadcast_to(closed, l2.shape))


class _Search:
    def __init__(self, task: Task, limits: Constraints, work: Work) -> None:
        self.space, self.limits, self.work = Space(task, limits), limits, work
        self.evaluator = Evaluator(task, work)
        self.weight = WEIGHTS[0]

    def objective(self, built: Built) -> Floats:
        """The logarithm of the objective; infinite where there is none."""
        value = self.evaluator.moments(built.design, built.gamma, built.closed)[0]
        return np.log(np.where(value > 0, value, np.inf))

    def rows(self, built: Built, nodes: int) -> Floats:
        """All slacks of each design less a margin, (n, m); very negative where it cannot be assembled.

        In a range the margins meet in the middle at most: one that is a single value has none.
        """
        self.work.go_on()
        found = slacks(built, self.space.task, self.limits, nodes)
        less: dict[str, Any] = {
            name: MARGIN if values.shape[1] > 1 else SINGLE_MARGIN for name, values in found.items()
        }
        for low, most in ((name, name.replace(">=min", "<=max")) for name in found):
            if low != most and most in found:
                less[low] = less[most] = np.minimum(less[low], 0.5 * (found[low] + found[most]))
        together = np.concatenate([found[name] - less[name] for name in found], axis=1)
        return np.where(np.isfinite(together), np.clip(together, -10.0, 10.0), -10.0)

    def spread(self) -> tuple[Floats, Floats]:
        """Places and sides of the starts: the best admissible ones, and those that miss least, apart from one another."""
        count = self.space.count
        # the additive sequence with the generalised golden ratio: even in every projection, and the same each time
        ratio = np.roots([1.0, *([0.0] * (count - 1)), -1.0, -1.0])
        share = 1 / float(np.max(ratio.real[np.abs(ratio.imag) < 1e-12])) ** np.arange(1, count + 1)
        places = (0.5 + np.arange(1, SPREAD + 1)[:, None] * share) % 1.0
        both = (1.0, -1.0) if self.space.limits.start == "any" else (1.0,)
        sides = np.repeat(both, SPREAD)
        places = np.tile(places, (len(both), 1))
        built = self.space.designs(places, sides)
        self.work.go_on()
        found = least(slacks(built, self.space.task, self.limits, COARSE_NODES))
        missing = np.sum([np.where(np.isfinite(one), np.clip(-one, 0.0, 1.0), 1.0) for one in found.values()], axis=0)
        near = np.argsort(missing, kind="stable")[:NEAR]
        value = self.objective(built.taken(near)) + self.weight * missing[near] / 10
        chosen: list[int] = []
        for at in near[np.argsort(value, kind="stable")]:
            apart = (
                np.abs(places[at] - places[other]).max() > APART or sides[at] != sides[other] for other in chosen
            )
            if all(apart):
                chosen.append(int(at))
            if len(chosen) == STARTS:
                break
        return np.clip(places[chosen], 1e-4, 1 - 1e-4), sides[chosen]

    def linear(self, place: Floats, side: Floats, nodes: int) -> tuple[Floats, Floats, Floats, Floats]:
        """Objective, slacks and their slopes, by central differences within the ranges."""
        n, k = place.shape
        steps = STEP * np.eye(k)
        around = np.concatenate([place[:, None], place[:, None] + steps, place[:, None] - steps], axis=1)
        built = self.space.designs(around.reshape(-1, k), np.repeat(side, 2 * k + 1))
        value = self.objective(built).reshape(n, 2 * k + 1)
        rows = self.rows(built, nodes).reshape(n, 2 * k + 1, -1)
        with np.errstate(invalid="ignore"):
            slope = (value[:, 1 : k + 1] - value[:, k + 1 :]) / (2 * STEP)
            matrix = (rows[:, 1 : k + 1] - rows[:, k + 1 :]).transpose(0, 2, 1) / (2 * STEP)
        return value[:, 0], np.where(np.isfinite(slope), slope, 0.0), rows[:, 0], matrix

    def descend(self, place: Floats, side: Floats, nodes: int, rounds: int, reach: float) -> tuple[Floats, Floats]:
        """Places after sequential quadratic programs, and their merit."""
        n, k = place.shape
        reaches, hessian = np.full(n, reach), np.tile(np.eye(k), (n, 1, 1))
        value, slope, rows, matrix = self.linear(place, side, nodes)
        merit = self.merit(value, rows)
        for _ in range(rounds):
            running = np.nonzero((reaches > LEAST_REACH) & np.isfinite(merit))[0]
            if not running.size:
                break
            self.work.go_on()
            step, multipliers = _program(
                hessian[running],
                slope[running],
                rows[running],
                matrix[running],
                place[running],
                reaches[running],
                self.weight,
            )
            there = np.clip(place[running] + step, 2 * STEP, 1 - 2 * STEP)
            tried = self.linear(there, side[running], nodes)
            new = self.merit(tried[0], tried[2])
            better = new < merit[running] - 1e-13
            size = np.abs(step).max(axis=1)
            grown = np.where(size > 0.9 * reaches[running], 2 * reaches[running], reaches[running])
            reaches[running] = np.where(better, np.minimum(grown, 0.5), 0.3 * np.minimum(size, reaches[running]))
            moved = there - place[running]
            before = slope[running] - np.einsum("nmk,nm->nk", matrix[running], multipliers)
            after = tried[1] - np.einsum("nmk,nm->nk", tried[3], multipliers)
            finite = np.isfinite(new)
            hessian[running[finite]] = _updated(hessian[running[finite]], moved[finite], (after - before)[finite])
            at = running[better]
            place[at], merit[at] = there[better], new[better]
            for held, fresh in zip((value, slope, rows, matrix), tried):
                held[at] = fresh[better]
        return place, merit

    def merit(self, value: Floats, rows: Floats) -> Floats:
        """What a descent lowers: the objective's logarithm and the worst broken slack."""
        return np.asarray(value + self.weight * np.maximum(0.0, -rows.min(axis=1)))


def _program(
    hessian: Floats, slope: Floats, rows: Floats, matrix: Floats, place: Floats, reach: Floats, weight: float
) -> tuple[Floats, Floats]:
    """The step within a reach that lowers the model most, its worst broken slack weighed like in the merit; multipliers."""
    n, k = place.shape
    m = rows.shape[1]
    wide = np.zeros((n, k + 1, k + 1))
    wide[:, :k, :k] = hessian
    wide[:, k, k] = 1e-6
    unit = np.tile(np.eye(k), (n, 1, 1))
    full = np.zeros((n, m + 2 * k + 1, k + 1))
    full[:, :m, :k], full[:, :m, k], full[:, m, k] = matrix, 1.0, 1.0
    full[:, m + 1 : m + 1 + k, :k], full[:, m + 1 + k :, :k] = unit, -unit
    # to the ends of the ranges, less the steps of the slopes, and with room for a point inside
    low = np.minimum(reach[:, None], np.maximum(place - 2 * STEP, 1e-3 * STEP))
    high = np.minimum(reach[:, None], np.maximum(1 - 2 * STEP - place, 1e-3 * STEP))
    bound = np.concatenate([rows, np.zeros((n, 1)), low, high], axis=1)
    inside = np.zeros((n, k + 1))
    inside[:, k] = np.maximum(0.0, -rows.min(axis=1)) + 0.1
    gradient = np.concatenate([slope, np.full((n, 1), weight)], axis=1)
    found, multipliers = minimise_quadratics(wide, gradient, full, bound, inside, 1e-10)
    return found[:, :k], multipliers[:, :m]


def _updated(hessian: Floats, step: Floats, change: Floats) -> Floats:
    """Powell's damped update of positive definite matrices; Nocedal and Wright, procedure 18.2."""
    along = np.einsum("nij,nj->ni", hessian, step)
    curve, have = np.einsum("ni,ni->n", step, along), np.einsum("ni,ni->n", step, change)
    with np.errstate(all="ignore"):
        share = np.where(have >= 0.2 * curve, 1.0, 0.8 * curve / (curve - have))[:, None]
        damped = share * change + (1 - share) * along
        fresh = hessian - along[:, :, None] * along[:, None, :] / curve[:, None, None]
        fresh = fresh + damped[:, :, None] * damped[:, None, :] / np.einsum("ni,ni->n", step, damped)[:, None, None]
    good = np.isfinite(fresh).all(axis=(1, 2)) & (curve > 1e-24) & (np.abs(fresh).max(axis=(1, 2)) < 1e8)
    return np.where(good[:, None, None], fresh, hessian)


def optimize_within(task: Task, limits: Constraints, work: Work | None = None) -> Optimum:
    """The best design of a task that keeps to constraints; deterministic.

    The length of the task's cylinder is not used: the closed length is one of the variables, within its range.

    Raises
    ------
    FieldError
        Where no design was found that keeps to all: ``constraint`` names the one that the nearest breaks most, and
        ``amount`` by how much, in what `SLACK_UNITS` says.

    Law: every slack is at least 0 at any pose, to rounding.
    """
    check_task(task)
    check_constraints(limits, task.high)
    search = _Search(task, limits, work or Work())
    # last with l2 and l3 as free as the other lengths, to name their ranges where these cannot be kept
    free = replace(limits, lengths=dict.fromkeys(("l2", "l3"), (None, task.upper_bound)))
    for search.weight, ranges in zip((*WEIGHTS, WEIGHTS[1]), (limits, limits, free)):
        search.space = Space(task, ranges)
        place, side = search.spread()
        place, merit = search.descend(place, side, SEARCH_NODES, ROUNDS, REACH)
        order = np.argsort(merit, kind="stable")[:LAST]
        place, side = place[order], side[order]
        place, merit = search.descend(place, side, FINE_NODES, FINE_ROUNDS, 0.02)
        built = search.space.designs(place, side)
        found = least(slacks(built, task, limits, 2 * FINE_NODES))
        worst = np.min(list(found.values()), axis=0)
        worst = np.where(np.isfinite(merit) & _lifts(built) & np.isfinite(worst), worst, -np.inf)
        admissible = np.nonzero(worst >= -CLOSED)[0]
        if admissible.size:
            break
    else:
        raise _none_found({name: float(one[int(np.argmax(worst))]) for name, one in found.items()})
    values = search.objective(built)
    at = int(admissible[np.argmin(values[admissible])])
    one = built.taken([at])
    value, mean = search.evaluator.moments(one.design, one.gamma, one.closed)[:, 0]
    mine = {name: float(slack[at]) for name, slack in found.items()}
    active = tuple(name for name, slack in mine.items() if slack <= ACTIVE)
    single = Design(*(float(field[0]) for field in one.design.as_tuple()))
    result = Built(single, float(one.gamma[0]), float(one.turn[0]), float(one.closed[0]))
    start = pose_at_turn(single, result.turn)
    equations = {
        "start": float(start.height) - task.low,
        "closed length": float(start.length) - result.closed,
        "(33) stroke": single.l3 + single.l5 - task.high,
    }
    return Optimum(result, float(value), float(mean), active, mine, equations, search.evaluator.evaluations)


def _lifts(built: Built) -> Flags:
    """Whether no dead point lies between start and top."""
    return np.asarray(dead_point(built.design) > np.asarray(built.turn))


def _none_found(mine: dict[str, float]) -> FieldError:
    """The error that names what the nearest design breaks, the most broken first."""
    broken = {name: -mine[name] for name in sorted(mine, key=mine.__getitem__) if not mine[name] >= -CLOSED}
    if not broken or not all(map(np.isfinite, broken.values())):
        message = "no design was found that meets the stroke with lengths within their ranges"
        return refusal("assembly", "/constraints", 0.0, message)
    fails = (f"{name} by {by:.3g} {SLACK_UNITS.get(name, 'of the top height')}" for name, by in broken.items())
    message = f"no design within all constraints was found: the nearest fails {', '.join(fails)}"
    name, amount = next(iter(broken.items()))
    return refusal(name, "/constraints", amount, message)
