"""Constraints that make a lift buildable.

A design that meets the stroke consists of five lengths and the closed length of its cylinder. Each constraint is a
slack of such a design, at each of a number of poses if it depends on the pose. Numbers in parentheses are equations
of the source named in `synthesis.scenes.lift.pose`. The collinear start (31) and the order of the sides (35) of the
source apply only if ``start`` is "collinear".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from synthesis.one_variable import Floats, rising_root
from synthesis.scenes.lift.motion import constraint_error
from synthesis.scenes.lift.optimum import (
    StrokeDesign,
    Task,
)
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    dead_point,
    design_constants,
    joints,
    pose_at_turn,
)


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
    single_margin: float = 1e-7
    """Margin by which a design stays within a limit that does not depend on the pose."""
    strict_margin: float = 1e-3
    """Smallest difference of l5 and l3, as a fraction of the top height, for the strict inequality (36)."""
    active_tolerance: float = 2e-3
    """Slack, in units of the limit, below which a constraint counts as active."""
    l3_factor: float = 1 + 1e-6
    """Smallest ratio of l3 to half of the stroke. At 1, A would only just reach the start."""
    search_limit: float = 100.0
    """Largest length in the problem of the source, in units of top height plus cylinder length. With longer lengths,
    the last digit of a length determines the dead point."""
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
    if limits.closed_length[0] < limits.closed_length[1]:
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
    kind: Literal["minimum", "maximum"]
    """`least` for a lower limit, `most` for an upper limit."""
    limit: float
    """The limit."""
    active: bool
    """True if the limit determines the design."""

    @property
    def satisfied(self) -> bool:
        """Return whether the design satisfies the limit."""
        return self.value >= self.limit if self.kind == "minimum" else self.value <= self.limit


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
    kinds: tuple[tuple[Literal["minimum", "maximum"], str], ...] = (("minimum", ">=min"), ("maximum", "<=max"))
    return [
        ConstraintRow(name, values[name], kind, limit, name + suffix in active)
        for name, pair in ranges.items()
        for limit, (kind, suffix) in zip(pair, kinds)
        if limit is not None
    ]
