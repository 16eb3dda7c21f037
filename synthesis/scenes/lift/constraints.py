"""Constraints that make a lift buildable, and the best design that satisfies them.

A design that meets the stroke consists of five lengths and the closed length of its cylinder. Each constraint is a
slack of such a design, at each of a number of poses if it depends on the pose. Numbers in parentheses are equations
of the source named in `synthesis.scenes.lift.pose`. The collinear start (31) and the order of the sides (35) of the
source apply only if ``start`` is "collinear".

The search variables are l2, gamma, l3 and the closed length; b follows from the cylinder length at the start. With
the collinear start, l3 and b follow from (31) and (32). Every design therefore meets the stroke exactly. The best of
a set of evenly distributed designs are the starting points of a sequential quadratic program with at most four
variables, whose linear constraints are the slacks in all poses. All starting points are processed at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, rising_root
from synthesis.quadratic import minimise_quadratics
from synthesis.scenes.lift.motion import constraint_error
from synthesis.scenes.lift.optimum import OPTIONS as OPTIMUM_OPTIONS
from synthesis.scenes.lift.optimum import (
    Evaluator,
    Optimum,
    StrokeDesign,
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
    design_constants,
    joints,
    pose_at_turn,
    third_side,
)
from synthesis.work import Work


@dataclass(frozen=True)
class LiftSearchOptions:
    """Options of the search within constraints.

    Distances in the search space are fractions of the variables' ranges.
    """

    search_nodes: int = 65
    """Number of poses from start to top at which a design is checked during the search."""
    coarse_nodes: int = 17
    """Number of poses from start to top at which an initial design is checked."""
    fine_nodes: int = 257
    """Number of poses from start to top at which a finalist is checked."""
    dead_point_nodes: int = 33
    """Number of poses below the start between which the dead point is isolated."""
    measured_nodes: int = 2001
    """Number of poses from start to top for the values that are reported."""
    spread_designs: int = 4096
    """Number of initial designs on each side of the cylinder pivot."""
    ranked_designs: int = 1024
    """Number of initial designs with the smallest violations, for which the objective is computed."""
    starts: int = 32
    """Number of starting points of the local search."""
    start_distance: float = 0.08
    """Smallest distance between two starting points."""
    iterations: int = 30
    """Largest number of iterations from each starting point."""
    finalists: int = 3
    """Number of local optima refined with `fine_nodes` poses."""
    fine_iterations: int = 20
    """Largest number of iterations for each finalist."""
    difference_step: float = 1e-6
    """Step of the central differences."""
    first_radius: float = 0.15
    """Initial trust-region radius."""
    fine_radius: float = 0.02
    """Initial trust-region radius for a finalist."""
    max_radius: float = 0.5
    """Largest trust-region radius."""
    min_radius: float = 1e-8
    """Trust-region radius at which the local search ends."""
    penalties: tuple[float, float] = (30.0, 300.0)
    """Penalty factors of the largest violation, relative to the logarithm of the objective. The second factor is used
    if the first factor leads to no admissible design."""
    margin: float = 5e-5
    """Margin by which a design stays within a limit that is checked at nodes, so that it also holds between the
    nodes."""
    single_margin: float = 1e-5
    """Margin by which a design stays within a limit that does not depend on the pose."""
    strict_margin: float = 1e-3
    """Smallest difference of l5 and l3, as a fraction of the top height, for the strict inequality (36)."""
    active_tolerance: float = 2e-3
    """Slack, in units of the limit, below which a constraint counts as active."""
    l3_factor: float = 1 + 1e-6
    """Smallest ratio of l3 to half of the stroke. At 1, A would only just reach the start."""
    closed_tolerance: float = 1e-12
    """Relative width below which a range counts as a single value, and largest violation that rounding may cause."""


OPTIONS = LiftSearchOptions()

SLACK_UNITS = {
    **dict.fromkeys(("acceleration<=max", "jerk<=max", "extension<=max", "force_ratio<=max"), "of its limit"),
    **dict.fromkeys(("rise_time>=min", "rise_time<=max"), "of its limit"),
    "dead_point>=min": "of the closed length",
    "transmission>=min": "in the sine of the angle",
}
"""Unit of the slack of a constraint, for messages; the slack of a length is a fraction of the top height."""

Range = tuple[float | None, float | None]


@dataclass(frozen=True)
class Constraints:
    """Limits of a design; None means no limit.

    Lengths, speeds and times are in the units of the task, and angles are in radians.
    """

    lengths: dict[str, Range]
    """Range of each of l2, l3, l4, l5 and b (37)."""
    closed_length: tuple[float, float]
    """Range of the cylinder length at the start."""
    extension_max: float | None = None
    """Largest ratio of the cylinder length at the top to the closed length."""
    dead_point_min: float | None = None
    """Smallest difference of the cylinder lengths at the start and at the dead point below it, as a fraction of the
    closed length.
    """
    acceleration_max: float | None = None
    """Largest absolute acceleration of the platform."""
    jerk_max: float | None = None
    """Largest absolute jerk of the platform."""
    rise_time: Range = (None, None)
    """Range of the time of the rise."""
    envelope: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    """Smallest x, smallest y, largest x and largest y of all joints."""
    transmission_min: float | None = None
    """Smallest angle between the cylinder and the direction in which it cannot move B."""
    force_ratio_max: float | None = None
    """Largest ratio of cylinder force to load."""
    start: Literal["any", "collinear"] = "any"
    """"collinear" if A, B and O must be in line at the start, as in the source."""


@dataclass(frozen=True)
class PlatformRates:
    """Motion of the platform in each pose."""

    pose: Pose
    """The poses."""
    gain: Any
    """ds/dl1, the ratio of platform speed to cylinder speed."""
    velocity: Any
    """First time derivative of the height."""
    acceleration: Any
    """Second time derivative of the height."""
    jerk: Any
    """Third time derivative of the height."""


def platform_rates(pose: Pose, cylinder: Cylinder, speed: Any) -> PlatformRates:
    """Compute speed, acceleration and jerk of the platform.

    With g = ds/dl1, g2 = (s'' - g l1'') / l1'^2 and g3 = (s''' - 3 g2 l1' l1'' - g l1''') / l1'^3, the derivatives
    with respect to the cylinder length, v = g v_l, a = g2 v_l^2 + g a_l and j = g3 v_l^3 + 3 g2 v_l a_l.

    Parameters
    ----------
    pose : Pose
    cylinder : Cylinder
        The drive; only its acceleration is used.
    speed : float or ndarray
        Speed of the cylinder in each pose.

    Returns
    -------
    PlatformRates
    """
    l3, k2, c_height = pose.design.l3, pose.constants.k_squared, pose.c_height
    sin, cos, s, s1, s2 = pose.sin_turn, pose.cos_turn, pose.height, pose.height_1, pose.height_2
    # s'' = s'^2 / s - s w with w = l3 cos T (k^2 + l3^2) / c_height^3
    factor = (k2 + l3 * l3) * l3 / (c_height * c_height * c_height)
    w, w1 = cos * factor, sin * factor * (3 * l3 * l3 * cos * cos / (c_height * c_height) - 1)
    s3 = (s1 / s) * (2 * s2 - s1 * (s1 / s)) - s1 * w - s * w1
    y1, y2, y3 = s1 + pose.across, s2 + pose.down, s3 - pose.across
    half_square_3 = -3 * pose.down * pose.across - pose.x * pose.down + 3 * y1 * y2 + pose.y * y3
    length_1, length_2 = pose.length_1, pose.length_2
    length_3 = (half_square_3 - 3 * length_1 * length_2) / pose.length
    g, al = pose.gain, cylinder.acceleration
    g2 = (s2 - g * length_2) / (length_1 * length_1)
    g3 = (s3 - 3 * g2 * length_1 * length_2 - g * length_3) / (length_1 * length_1 * length_1)
    acceleration = g2 * speed * speed + g * al
    return PlatformRates(pose, g, g * speed, acceleration, speed * (g3 * speed * speed + 3 * g2 * al))


def cylinder_speeds(pose: Pose, cylinder: Cylinder, closed_length: Any, top_length: Any) -> Any:
    """Return the signed speed of the cylinder in poses; NaN if the cylinder has come to rest before."""
    signed_acceleration = cylinder.acceleration * np.sign(cylinder.speed)
    travel = pose.length - closed_length if cylinder.speed > 0 else top_length - pose.length
    speed_squared = cylinder.speed * cylinder.speed + 2 * signed_acceleration * travel
    return np.sign(cylinder.speed) * np.sqrt(np.where(speed_squared >= 0, speed_squared, np.nan))


def sample_turns(candidates: StrokeDesign, nodes: int) -> Floats:
    """Return turns from start to top, shape (n, nodes), closely spaced near the start, where the rates change fastest."""
    fraction = np.linspace(0.0, 1.0, nodes)
    return np.asarray(candidates.turn)[:, None] * (1 - fraction * fraction)


def as_columns(design: Design) -> Design:
    """Return designs of shape (n,) as columns of shape (n, 1), to broadcast against poses."""
    return Design(*(np.asarray(value)[:, None] for value in design.as_tuple()))


def dead_point_lengths(candidates: StrokeDesign) -> Floats:
    """Return the cylinder length at the first dead point below the start, shape (n,).

    The result is the length at the start if the start is past a dead point. Dead points are isolated on a grid of
    turns; only `synthesis.scenes.lift.pose.dead_point` also finds a pair of dead points between neighbouring nodes.
    """
    design, gamma = as_columns(candidates.design), np.asarray(candidates.gamma)[:, None]
    constants = design_constants(design, gamma)
    start_turn = np.asarray(candidates.turn)
    fraction = np.linspace(0.0, 1.0, OPTIONS.dead_point_nodes) ** 1.5
    turns = start_turn[:, None] + (start_turn[:, None] + 0.5) * fraction
    rising = pose_at_turn(design, turns, constants).half_square_1 > 0
    node = np.maximum(np.argmax(rising, axis=1), 1)
    rows = np.arange(start_turn.size)

    def pose_of_candidates(turn: Floats) -> Pose:
        return pose_at_turn(candidates.design, turn, design_constants(candidates.design, candidates.gamma))

    def rate(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_of_candidates(turn)
        return pose.half_square_1, pose.half_square_2

    low, high = turns[rows, node - 1], turns[rows, node]
    has_dead_point = rising[rows, node]
    root = rising_root(rate, low, high, 0.5 * (low + high))
    lengths = pose_of_candidates(np.where(has_dead_point, root, turns[:, -1])).length
    return np.where(rising[:, 0], candidates.closed_length, lengths)


def slacks(
    candidates: StrokeDesign, task: Task, limits: Constraints, nodes: int = OPTIONS.search_nodes
) -> dict[str, Floats]:
    """Compute the slacks of all constraints.

    Parameters
    ----------
    candidates : StrokeDesign
        n designs that meet the stroke.
    task : Task
    limits : Constraints
    nodes : int
        Number of poses from start to top.

    Returns
    -------
    dict of str to ndarray, shape (n, 1) or (n, nodes)
        Slack by the name of the constraint, in units of the limit. A negative slack is a violation.
        NaN if a design cannot be assembled.
    """
    column_design = as_columns(candidates.design)
    constants = design_constants(column_design, np.asarray(candidates.gamma)[:, None])
    pose = pose_at_turn(column_design, sample_turns(candidates, nodes), constants)
    return (
        _length_slacks(candidates, task, limits)
        | _transmission_slacks(candidates, pose, limits)
        | _motion_slacks(candidates, pose, task, limits)
        | _envelope_slacks(pose, limits, task.high)
    )


def _range_slacks(
    name: str, value: Any, bounds: Range, top_height: float, unit: float | None = None
) -> dict[str, Any]:
    """Return the slacks of a value in a range, in units of the limit unless `unit` is given."""
    lower, upper = bounds
    value = np.asarray(value)
    value = value[:, None] if value.ndim == 1 else value
    result = {}
    if lower is not None:
        result[f"{name}>=min"] = (value - lower) / (unit or abs(lower) or top_height)
    if upper is not None:
        result[f"{name}<=max"] = (upper - value) / (unit or abs(upper) or top_height)
    return result


def _length_slacks(candidates: StrokeDesign, task: Task, limits: Constraints) -> dict[str, Any]:
    """Return the slacks that depend on the lengths only, in units of the top height."""
    design, high = candidates.design, task.high
    result: dict[str, Any] = {}
    for name, bounds in limits.lengths.items():
        result |= _range_slacks(name, getattr(design, name), bounds, high, high)
    result |= _range_slacks("closed_length", candidates.closed_length, limits.closed_length, high, high)
    result["l3<l5"] = ((design.l5 - design.l3) / high - OPTIONS.strict_margin)[:, None]
    if limits.start == "collinear":
        result["l3<=l2"] = ((design.l2 - design.l3) / high)[:, None]
        result["l4<=l2"] = ((design.l2 - design.l4) / high)[:, None]
    return result


def _transmission_slacks(candidates: StrokeDesign, pose: Pose, limits: Constraints) -> dict[str, Any]:
    """Return the slacks of transmission angle, extension and distance from the dead point."""
    closed_length, top_length = np.asarray(candidates.closed_length)[:, None], pose.length[:, -1:]
    # the cylinder lengthens during the whole rise: its rate keeps its sign, and the transmission angle is not 0
    transmission_sine = -pose.length_1 / np.hypot(pose.down, pose.height_1 + pose.across)
    smallest_sine = np.sin(limits.transmission_min or 0.0)
    result = {"transmission>=min": transmission_sine - max(smallest_sine, 1e-6)}
    if limits.extension_max is not None:
        result["extension<=max"] = 1 - top_length / (limits.extension_max * closed_length)
    if limits.dead_point_min is not None:
        distance = 1 - dead_point_lengths(candidates)[:, None] / closed_length
        result["dead_point>=min"] = distance - limits.dead_point_min
    return result


def _motion_slacks(candidates: StrokeDesign, pose: Pose, task: Task, limits: Constraints) -> dict[str, Any]:
    """Return the slacks that depend on the drive: stopping, acceleration, jerk, force ratio and rise time."""
    cylinder, high = task.cylinder, task.high
    closed_length, top_length = np.asarray(candidates.closed_length)[:, None], pose.length[:, -1:]
    result: dict[str, Any] = {}
    with np.errstate(all="ignore"):
        speed = cylinder_speeds(pose, cylinder, closed_length, top_length)
        rates = platform_rates(pose, cylinder, speed)
    if cylinder.acceleration * np.sign(cylinder.speed) < 0:
        stopping_distance = cylinder.speed * cylinder.speed / (2 * abs(cylinder.acceleration))
        result["stopping"] = (stopping_distance - (top_length - closed_length)) / high
    for name, values, upper in (
        ("acceleration", rates.acceleration, limits.acceleration_max),
        ("jerk", rates.jerk, limits.jerk_max),
    ):
        if upper is not None:
            # there are no rates after the cylinder has come to rest
            result[f"{name}<=max"] = np.where(np.isnan(speed), 0.0, 1 - np.abs(values) / upper)
    if limits.force_ratio_max is not None:
        result["force_ratio<=max"] = 1 - np.abs(pose.gain) / limits.force_ratio_max
    if any(bound is not None for bound in limits.rise_time):
        result |= _range_slacks("rise_time", _duration(top_length - closed_length, cylinder), limits.rise_time, high)
    return result


def _duration(travel: Any, cylinder: Cylinder) -> Any:
    """Return the time of the rise; see `synthesis.scenes.lift.motion.travel_time`."""
    speed, signed_acceleration = abs(cylinder.speed), cylinder.acceleration * np.sign(cylinder.speed)
    return 2 * travel / (speed + np.sqrt(np.maximum(speed * speed + 2 * signed_acceleration * travel, 0.0)))


def _envelope_slacks(pose: Pose, limits: Constraints, top_height: float) -> dict[str, Any]:
    """Return the slacks of the moving joints A, B and C in the box.

    D lies below A, and `check_constraints` covers O and the height of A.
    """
    positions = joints(pose)
    moving = np.stack([positions[name] for name in "ABC"], axis=-1)
    x, y = moving.real, moving.imag[..., 1:]
    names = ("x_min>=min", "y_min>=min", "x_max<=max", "y_max<=max")
    result = {}
    for name, bound, values, side in zip(names, limits.envelope, (x, y, x, y), (1, 1, -1, -1)):
        if bound is not None:
            result[name] = side * ((values.min(axis=-1) if side > 0 else values.max(axis=-1)) - bound) / top_height
    return result


def minimum_slacks(slacks_by_name: dict[str, Floats]) -> dict[str, Floats]:
    """Return the smallest slack of each constraint over the poses, shape (n,)."""
    return {name: np.min(values, axis=1) for name, values in slacks_by_name.items()}


def check_constraints(limits: Constraints, top_height: float) -> None:
    """Raise an error for constraints that no design can satisfy.

    Raises
    ------
    FieldError
        A range is empty, or the box excludes the cylinder pivot or the top height. ``constraint`` is the name of the
        field.
    """
    ranges = {**limits.lengths, "closed_length": limits.closed_length, "rise_time": limits.rise_time}
    for name, (low, high) in ranges.items():
        if low is not None and high is not None and low > high:
            message = f"the lower end of the range, {low:.9g}, must not be above the upper end, {high:.9g}"
            raise constraint_error(name, f"/constraints/{name}", low - high, message)
    for k, (bound, side, required) in enumerate(zip(limits.envelope, (1, 1, -1, -1), (0.0, 0.0, 0.0, top_height))):
        if bound is not None and side * (bound - required) > 0:
            content = f"the top of the stroke at {required:.9g}" if required else "the cylinder pivot at (0, 0)"
            message = f"the box must contain {content}; found {bound:.9g}"
            raise constraint_error("envelope", f"/constraints/envelope/{k}", abs(bound - required), message)


def measured_values(candidate: StrokeDesign, task: Task) -> dict[str, float]:
    """Return the constrained quantities of one design, evaluated at `LiftSearchOptions.measured_nodes` poses.

    Parameters
    ----------
    candidate : StrokeDesign
        A single design.
    task : Task

    Returns
    -------
    dict of str to float
        Values by the name of the quantity, in the units of `Constraints`.
    """
    batch = StrokeDesign(
        Design(*(np.array([value], dtype=float) for value in candidate.design.as_tuple())),
        *(np.array([value], dtype=float) for value in (candidate.gamma, candidate.turn, candidate.closed_length)),
    )
    column_design, cylinder = as_columns(batch.design), task.cylinder
    constants = design_constants(column_design, batch.gamma[:, None])
    pose = pose_at_turn(column_design, sample_turns(batch, OPTIONS.measured_nodes), constants)
    closed_length, top_length = float(candidate.closed_length), float(pose.length[0, -1])
    rates = platform_rates(pose, cylinder, cylinder_speeds(pose, cylinder, closed_length, top_length))
    points = np.concatenate([positions.ravel() for positions in joints(pose).values()])
    transmission_sine = -pose.length_1 / np.hypot(pose.down, pose.height_1 + pose.across)
    return {
        **candidate.design.as_dict(),
        "closed_length": closed_length,
        "extension": top_length / closed_length,
        "dead_point": 1 - float(pose_at_turn(candidate.design, dead_point(candidate.design)).length) / closed_length,
        "acceleration": float(np.max(np.abs(rates.acceleration))),
        "jerk": float(np.max(np.abs(rates.jerk))),
        "rise_time": float(_duration(top_length - closed_length, cylinder)),
        "transmission": float(np.arcsin(np.clip(np.min(transmission_sine), -1.0, 1.0))),
        "force_ratio": float(np.max(np.abs(pose.gain))),
        "x_min": float(points.real.min()),
        "y_min": float(points.imag.min()),
        "x_max": float(points.real.max()),
        "y_max": float(points.imag.max()),
    }


@dataclass(frozen=True)
class ConstraintRow:
    """One limit and the value of a design."""

    name: str
    """Name of the constrained quantity."""
    value: float
    """Value of the design."""
    kind: Literal["least", "most"]
    """`least` for a lower limit, `most` for an upper limit."""
    limit: float
    """The limit."""
    active: bool
    """True if the limit determines the design."""

    @property
    def satisfied(self) -> bool:
        """Return whether the design satisfies the limit."""
        return self.value >= self.limit if self.kind == "least" else self.value <= self.limit


def constraint_rows(limits: Constraints, values: dict[str, float], active: Sequence[str] = ()) -> list[ConstraintRow]:
    """List every limit with the value of a design.

    Parameters
    ----------
    limits : Constraints
    values : dict of str to float
        Result of `measured_values`.
    active : sequence of str
        Names of the active constraints, as in `Optimum`.

    Returns
    -------
    list of ConstraintRow
    """
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
    kinds: tuple[tuple[Literal["least", "most"], str], ...] = (("least", ">=min"), ("most", "<=max"))
    return [
        ConstraintRow(name, values[name], kind, limit, name + suffix in active)
        for name, pair in ranges.items()
        for limit, (kind, suffix) in zip(pair, kinds)
        if limit is not None
    ]


@dataclass(frozen=True)
class DesignSpace:
    """Search variables of a task within its constraints; each variable is scaled to 0 .. 1."""

    task: Task
    """Drive, stroke and objective."""
    limits: Constraints
    """Ranges of the lengths, and the kind of start."""

    @property
    def count(self) -> int:
        """Return the number of variables: l2, gamma, and if they are free, l3 and the closed length."""
        return 2 + (self.limits.start == "any") + self._closed_is_free

    @property
    def _closed_is_free(self) -> bool:
        low, high = self.limits.closed_length
        return high - low > OPTIONS.closed_tolerance * high

    def designs(self, points: Floats, side: Floats) -> StrokeDesign:
        """Return the designs for points of the search space.

        Parameters
        ----------
        points : ndarray, shape (n, count)
            Scaled variables.
        side : ndarray, shape (n,)
            1 if B starts between the slide and the cylinder pivot, -1 if it starts beyond the pivot.

        Returns
        -------
        StrokeDesign
            NaN if a design cannot be assembled at the start.
        """
        low, high = self.task.low, self.task.high
        coordinates = iter(np.clip(points, 0.0, 1.0).T)

        def next_length(name: str, lower: float, upper: float) -> Floats:
            first, last = self.limits.lengths.get(name, (None, None))
            first, last = max(first or 0.0, lower), min(np.inf if last is None else last, upper)
            return np.asarray(first + (last - first) * next(coordinates))

        def next_closed_length() -> Any:
            first, last = self.limits.closed_length
            return first + (last - first) * (next(coordinates) if self._closed_is_free else 0.0)

        open_end = OPTIMUM_OPTIONS.open_end
        l2 = next_length("l2", 1e-6 * high, np.inf)
        angle_fraction = open_end + (1 - 2 * open_end) * next(coordinates)
        with np.errstate(all="ignore"):
            if self.limits.start == "any":
                # if l3 were below half of the stroke, A could not go down to the start
                l3 = next_length("l3", OPTIONS.l3_factor * 0.5 * (high - low), 0.5 * high)
                gamma, closed_length = np.pi * angle_fraction, next_closed_length()
                turn = angle_or_flat(low, l3, high - l3)
                across, y = l2 * np.sin(turn - gamma), low - l2 * np.cos(turn - gamma)
                x_squared = (closed_length - y) * (closed_length + y)
                b = across + side * np.sqrt(np.where(x_squared > 0, x_squared, np.nan))
                b = np.where(b > 0, b, np.nan)
                design = Design(l2, l3, third_side(l2, l3, gamma), high - l3, b)
            else:
                closed_length = next_closed_length()
                gamma = angle_fraction * angle_limit(l2, closed_length, low)
                design = design_from_angle(l2, gamma, closed_length, low, high)
                turn = np.arctan2(design.b, low) + gamma
        return StrokeDesign(design, gamma, turn, np.broadcast_to(closed_length, l2.shape))


class _LinearModel(NamedTuple):
    """Objective and constraints of n points, linearised in the k search variables."""

    value: Floats
    """Logarithm of the objective, shape (n,)."""
    gradient: Floats
    """Derivatives of the value, shape (n, k)."""
    slack: Floats
    """Slacks minus their margins, shape (n, m)."""
    jacobian: Floats
    """Derivatives of the slacks, shape (n, m, k)."""

    def select(self, rows: Any) -> _LinearModel:
        """Return the model of some of the points."""
        return _LinearModel(*(array[rows] for array in self))

    def lagrangian_gradient(self, multipliers: Floats) -> Floats:
        """Return the gradient of the Lagrangian, shape (n, k)."""
        return self.gradient - np.einsum("nmk,nm->nk", self.jacobian, multipliers)


class _Search:
    """Multistart of sequential quadratic programs, run for all starting points at once."""

    def __init__(self, task: Task, limits: Constraints, work: Work) -> None:
        self.space, self.limits, self.work = DesignSpace(task, limits), limits, work
        self.evaluator = Evaluator(task, work)
        self.penalty = OPTIONS.penalties[0]

    def objective(self, candidates: StrokeDesign) -> Floats:
        """Return the logarithm of the objective; infinite if a design does not lift."""
        value = self.evaluator.moments(candidates.design, candidates.gamma, candidates.closed_length)[0]
        return np.log(np.where(value > 0, value, np.inf))

    def reduced_slacks(self, candidates: StrokeDesign, nodes: int) -> Floats:
        """Return all slacks of each design minus a margin, shape (n, m); -10 if a design cannot be assembled.

        In a narrow range the two margins meet in the middle, and a range of a single value has no margin.
        """
        self.work.go_on()
        by_name = slacks(candidates, self.space.task, self.limits, nodes)
        margins: dict[str, Any] = {
            name: OPTIONS.margin if values.shape[1] > 1 else OPTIONS.single_margin for name, values in by_name.items()
        }
        for lower, upper in ((name, name.replace(">=min", "<=max")) for name in by_name):
            if lower != upper and upper in by_name:
                margins[lower] = margins[upper] = np.minimum(margins[lower], 0.5 * (by_name[lower] + by_name[upper]))
        stacked = np.concatenate([by_name[name] - margins[name] for name in by_name], axis=1)
        return np.where(np.isfinite(stacked), np.clip(stacked, -10.0, 10.0), -10.0)

    def starting_points(self) -> tuple[Floats, Floats]:
        """Return points and sides of the best initial designs, at a minimum distance from each other.

        Designs are ranked by the logarithm of the objective plus a penalty for violated constraints.
        """
        points, sides = self._spread_points()
        candidates = self.space.designs(points, sides)
        self.work.go_on()
        by_name = minimum_slacks(slacks(candidates, self.space.task, self.limits, OPTIONS.coarse_nodes))
        violation = np.sum(
            [np.where(np.isfinite(slack), np.clip(-slack, 0.0, 1.0), 1.0) for slack in by_name.values()], axis=0
        )
        ranked = np.argsort(violation, kind="stable")[: OPTIONS.ranked_designs]
        value = self.objective(candidates.select(ranked)) + self.penalty * violation[ranked] / 10
        chosen: list[int] = []
        for index in ranked[np.argsort(value, kind="stable")]:
            is_distant = (
                np.abs(points[index] - points[selected]).max() > OPTIONS.start_distance
                or sides[index] != sides[selected]
                for selected in chosen
            )
            if all(is_distant):
                chosen.append(int(index))
            if len(chosen) == OPTIONS.starts:
                break
        return np.clip(points[chosen], 1e-4, 1 - 1e-4), sides[chosen]

    def _spread_points(self) -> tuple[Floats, Floats]:
        """Return points and sides of the initial designs, evenly distributed in every projection.

        The points are the additive recurrence whose increments are powers of the generalised golden ratio.
        """
        count = self.space.count
        roots = np.roots([1.0, *([0.0] * (count - 1)), -1.0, -1.0])
        increments = 1 / float(np.max(roots.real[np.abs(roots.imag) < 1e-12])) ** np.arange(1, count + 1)
        points = (0.5 + np.arange(1, OPTIONS.spread_designs + 1)[:, None] * increments) % 1.0
        sides = (1.0, -1.0) if self.space.limits.start == "any" else (1.0,)
        return np.tile(points, (len(sides), 1)), np.repeat(sides, OPTIONS.spread_designs)

    def linearise(self, points: Floats, side: Floats, nodes: int) -> _LinearModel:
        """Evaluate objective and constraints with their derivatives, by central differences within the ranges."""
        n, k = points.shape
        step = OPTIONS.difference_step
        steps = step * np.eye(k)
        stencil = np.concatenate([points[:, None], points[:, None] + steps, points[:, None] - steps], axis=1)
        candidates = self.space.designs(stencil.reshape(-1, k), np.repeat(side, 2 * k + 1))
        value = self.objective(candidates).reshape(n, 2 * k + 1)
        reduced = self.reduced_slacks(candidates, nodes).reshape(n, 2 * k + 1, -1)
        with np.errstate(invalid="ignore"):
            gradient = (value[:, 1 : k + 1] - value[:, k + 1 :]) / (2 * step)
            jacobian = (reduced[:, 1 : k + 1] - reduced[:, k + 1 :]).transpose(0, 2, 1) / (2 * step)
        return _LinearModel(value[:, 0], np.where(np.isfinite(gradient), gradient, 0.0), reduced[:, 0], jacobian)

    def descend(
        self, points: Floats, side: Floats, nodes: int, iterations: int, first_radius: float
    ) -> tuple[Floats, Floats]:
        """Run the sequential quadratic programs.

        Parameters
        ----------
        points : ndarray, shape (n, k)
            Starting points, which are overwritten.
        side : ndarray, shape (n,)
            Side of each starting point; see `DesignSpace.designs`.
        nodes : int
            Number of poses at which the constraints are evaluated.
        iterations : int
            Largest number of iterations.
        first_radius : float
            Initial trust-region radius.

        Returns
        -------
        points : ndarray, shape (n, k)
            Points with the smallest merit function.
        merit : ndarray, shape (n,)
        """
        n, k = points.shape
        radii, hessian = np.full(n, first_radius), np.tile(np.eye(k), (n, 1, 1))
        model = self.linearise(points, side, nodes)
        merit = self.merit(model)
        for _ in range(iterations):
            running = np.nonzero((radii > OPTIONS.min_radius) & np.isfinite(merit))[0]
            if not running.size:
                break
            self.work.go_on()
            local, radius = model.select(running), radii[running]
            step, multipliers = _quadratic_step(local, hessian[running], points[running], radius, self.penalty)
            trial_points = np.clip(
                points[running] + step, 2 * OPTIONS.difference_step, 1 - 2 * OPTIONS.difference_step
            )
            trial = self.linearise(trial_points, side[running], nodes)
            trial_merit = self.merit(trial)
            better = trial_merit < merit[running] - 1e-13
            step_size = np.abs(step).max(axis=1)
            enlarged = np.where(step_size > 0.9 * radius, 2 * radius, radius)
            radii[running] = np.where(
                better, np.minimum(enlarged, OPTIONS.max_radius), 0.3 * np.minimum(step_size, radius)
            )
            step_taken = trial_points - points[running]
            change = trial.lagrangian_gradient(multipliers) - local.lagrangian_gradient(multipliers)
            finite = np.isfinite(trial_merit)
            updated = running[finite]
            hessian[updated] = _damped_bfgs(hessian[updated], step_taken[finite], change[finite])
            accepted = running[better]
            points[accepted], merit[accepted] = trial_points[better], trial_merit[better]
            for array, values in zip(model, trial):
                array[accepted] = values[better]
        return points, merit

    def merit(self, model: _LinearModel) -> Floats:
        """Return the merit function: the logarithm of the objective plus the penalty of the largest violation."""
        return np.asarray(model.value + self.penalty * np.maximum(0.0, -model.slack.min(axis=1)))


def _quadratic_step(
    model: _LinearModel, hessian: Floats, points: Floats, radius: Floats, penalty: float
) -> tuple[Floats, Floats]:
    """Return the step within the trust region that minimises the quadratic model, and the multipliers.

    An additional unknown is the largest violation, with the same penalty as in the merit function.
    """
    n, k = points.shape
    m = model.slack.shape[1]
    program_hessian = np.zeros((n, k + 1, k + 1))
    program_hessian[:, :k, :k] = hessian
    program_hessian[:, k, k] = 1e-6
    unit = np.tile(np.eye(k), (n, 1, 1))
    matrix = np.zeros((n, m + 2 * k + 1, k + 1))
    matrix[:, :m, :k], matrix[:, :m, k], matrix[:, m, k] = model.jacobian, 1.0, 1.0
    matrix[:, m + 1 : m + 1 + k, :k], matrix[:, m + 1 + k :, :k] = unit, -unit
    # up to the ends of the ranges minus the difference step, with room for an interior point
    edge, room = 2 * OPTIONS.difference_step, 1e-3 * OPTIONS.difference_step
    low = np.minimum(radius[:, None], np.maximum(points - edge, room))
    high = np.minimum(radius[:, None], np.maximum(1 - edge - points, room))
    bound = np.concatenate([model.slack, np.zeros((n, 1)), low, high], axis=1)
    inside = np.zeros((n, k + 1))
    inside[:, k] = np.maximum(0.0, -model.slack.min(axis=1)) + 0.1
    gradient = np.concatenate([model.gradient, np.full((n, 1), penalty)], axis=1)
    solution, multipliers = minimise_quadratics(program_hessian, gradient, matrix, bound, inside, 1e-10)
    return solution[:, :k], multipliers[:, :m]


def _damped_bfgs(hessian: Floats, step: Floats, change: Floats) -> Floats:
    """Return Powell's damped BFGS update of positive definite matrices (Nocedal and Wright, procedure 18.2)."""
    hessian_step = np.einsum("nij,nj->ni", hessian, step)
    model_curvature, curvature = np.einsum("ni,ni->n", step, hessian_step), np.einsum("ni,ni->n", step, change)
    with np.errstate(all="ignore"):
        theta = np.where(
            curvature >= 0.2 * model_curvature, 1.0, 0.8 * model_curvature / (model_curvature - curvature)
        )[:, None]
        damped = theta * change + (1 - theta) * hessian_step
        updated = hessian - hessian_step[:, :, None] * hessian_step[:, None, :] / model_curvature[:, None, None]
        denominator = np.einsum("ni,ni->n", step, damped)[:, None, None]
        updated = updated + damped[:, :, None] * damped[:, None, :] / denominator
    finite = np.isfinite(updated).all(axis=(1, 2))
    usable = finite & (model_curvature > 1e-24) & (np.abs(updated).max(axis=(1, 2)) < 1e8)
    return np.where(usable[:, None, None], updated, hessian)


def optimize_within(task: Task, limits: Constraints, work: Work | None = None) -> Optimum:
    """Find the best design of a task that satisfies constraints.

    The search is deterministic. It ignores the length of the task's cylinder, because the closed length is a
    variable.

    Parameters
    ----------
    task : Task
    limits : Constraints
    work : Work, optional
        Called regularly to check whether the result is still wanted.

    Returns
    -------
    Optimum
        Every slack is at least 0 in every pose, up to rounding.

    Raises
    ------
    FieldError
        No design was found that satisfies all constraints. ``constraint`` names the constraint that the nearest
        design violates most, and ``amount`` is the size of the violation in the unit given by `SLACK_UNITS`.
    """
    check_task(task)
    check_constraints(limits, task.high)
    search = _Search(task, limits, work or Work())
    # the last attempt ignores the ranges of l2 and l3, so that the error names them if they cannot be satisfied
    free = replace(limits, lengths=dict.fromkeys(("l2", "l3"), (None, task.upper_bound)))
    for search.penalty, ranges in zip((*OPTIONS.penalties, OPTIONS.penalties[1]), (limits, limits, free)):
        search.space = DesignSpace(task, ranges)
        candidates, merit = _local_optima(search)
        slacks_by_name = minimum_slacks(slacks(candidates, task, limits, 2 * OPTIONS.fine_nodes))
        worst = np.min(list(slacks_by_name.values()), axis=0)
        worst = np.where(np.isfinite(merit) & _reaches_top(candidates) & np.isfinite(worst), worst, -np.inf)
        admissible = np.nonzero(worst >= -OPTIONS.closed_tolerance)[0]
        if admissible.size:
            break
    else:
        nearest = int(np.argmax(worst))
        raise _no_design_error({name: float(slack[nearest]) for name, slack in slacks_by_name.items()})
    values = search.objective(candidates)
    best = int(admissible[np.argmin(values[admissible])])
    best_slacks = {name: float(slack[best]) for name, slack in slacks_by_name.items()}
    return _optimum(candidates.select([best]), best_slacks, search.evaluator, task)


def _local_optima(search: _Search) -> tuple[StrokeDesign, Floats]:
    """Return the finalists of a multistart and their merit."""
    points, side = search.starting_points()
    points, merit = search.descend(points, side, OPTIONS.search_nodes, OPTIONS.iterations, OPTIONS.first_radius)
    order = np.argsort(merit, kind="stable")[: OPTIONS.finalists]
    points, side = points[order], side[order]
    points, merit = search.descend(points, side, OPTIONS.fine_nodes, OPTIONS.fine_iterations, OPTIONS.fine_radius)
    return search.space.designs(points, side), merit


def _optimum(best: StrokeDesign, best_slacks: dict[str, float], evaluator: Evaluator, task: Task) -> Optimum:
    """Build the result from the best design, shape (1,), and its slacks."""
    value, mean = evaluator.moments(best.design, best.gamma, best.closed_length)[:, 0]
    design = Design(*(float(field[0]) for field in best.design.as_tuple()))
    stroke_design = StrokeDesign(design, float(best.gamma[0]), float(best.turn[0]), float(best.closed_length[0]))
    start = pose_at_turn(design, stroke_design.turn)
    equations = {
        "start": float(start.height) - task.low,
        "closed length": float(start.length) - stroke_design.closed_length,
        "(33) stroke": design.l3 + design.l5 - task.high,
    }
    active = tuple(name for name, slack in best_slacks.items() if slack <= OPTIONS.active_tolerance)
    return Optimum(stroke_design, float(value), float(mean), active, best_slacks, equations, evaluator.evaluations)


def _reaches_top(candidates: StrokeDesign) -> Flags:
    """Return whether no dead point lies between start and top."""
    return np.asarray(dead_point(candidates.design) > np.asarray(candidates.turn))


def _no_design_error(slacks_by_name: dict[str, float]) -> FieldError:
    """Build the error that lists the violations of the nearest design, the largest violation first."""
    violations = {
        name: -slacks_by_name[name]
        for name in sorted(slacks_by_name, key=slacks_by_name.__getitem__)
        if not slacks_by_name[name] >= -OPTIONS.closed_tolerance
    }
    if not violations or not all(map(np.isfinite, violations.values())):
        message = "no design with lengths within their ranges was found that meets the stroke; widen the ranges"
        return constraint_error("assembly", "/constraints", 0.0, message)
    parts = (f"{name} by {by:.3g} {SLACK_UNITS.get(name, 'of the top height')}" for name, by in violations.items())
    message = f"no design was found that satisfies all constraints; the nearest design violates {', '.join(parts)}"
    name, amount = next(iter(violations.items()))
    return constraint_error(name, "/constraints", amount, message)
