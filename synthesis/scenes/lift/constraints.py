"""Constraints that make a lift buildable.

A design that meets the stroke consists of five lengths and the closed length of its cylinder. Each constraint is a
slack of such a design, at each of a number of poses if it depends on the pose. Numbers in parentheses are equations
of the source named in `synthesis.scenes.lift.pose`. The collinear start (31) and the order of the sides (35) of the
source apply only if ``start`` is "collinear".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from synthesis.one_variable import Floats
from synthesis.scenes.lift.motion import acceleration, constraint_error
from synthesis.scenes.lift.optimum import StrokeDesign, Task, driven_speed
from synthesis.scenes.lift.pose import (
    DEAD_POINT_NODES,
    LENGTHS,
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
    dead_point_nodes: int = 8
    """Number of nodes in a quarter turn on which the dead points of designs are isolated in the search."""
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
    iterations: int = 15
    """Largest number of iterations from each starting point, and again for each finalist."""
    finalists: int = 3
    """Number of local optima refined with `fine_nodes` poses."""
    difference_step: float = 1e-6
    """Step of the central differences."""
    first_radius: float = 0.15
    """Initial trust-region radius."""
    gain: float = 1e-11
    """Relative decrease of the objective predicted by a step below which the local search ends."""
    rank_penalty: float = 3.0
    """Penalty factor of the violations of an initial design, relative to the logarithm of the objective."""
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

OWN_UNIT = ("extension", "acceleration", "jerk", "rise_time", "force_ratio")
"""Quantities whose slack is a fraction of their limit."""
PLAIN_UNIT = {"dead_point": "of the closed length", "transmission": "in the sine of the angle"}
"""Quantities whose slack is the difference from their limit, with its unit in messages.
The slack of all others, which are lengths, is a fraction of the top height."""

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

    @property
    def ranges(self) -> dict[str, Range]:
        """Return the range of each of the `quantities`."""
        left, bottom, right, top = self.envelope
        return {
            **self.lengths,
            "closed_length": self.closed_length,
            "extension": (None, self.extension_max),
            "dead_point": (self.dead_point_min, None),
            "acceleration": (None, self.acceleration_max),
            "jerk": (None, self.jerk_max),
            "rise_time": self.rise_time,
            "transmission": (self.transmission_min, None),
            "force_ratio": (None, self.force_ratio_max),
            "x_min": (left, None),
            "y_min": (bottom, None),
            "x_max": (None, right),
            "y_max": (None, top),
        }


def jerk(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> Any:
    """Return the jerk of the platform, the third time derivative of its height.

    With g = ds/dl1, g2 = (s'' - g l1'') / l1'^2 and g3 = (s''' - 3 g2 l1' l1'' - g l1''') / l1'^3, the derivatives
    with respect to the cylinder length, the velocity is g v_l, the acceleration g2 v_l^2 + g a_l, and the jerk
    g3 v_l^3 + 3 g2 v_l a_l.
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
    g2 = (s2 - pose.gain * length_2) / (length_1 * length_1)
    g3 = (s3 - 3 * g2 * length_1 * length_2 - pose.gain * length_3) / (length_1 * length_1 * length_1)
    return cylinder_speed * (g3 * cylinder_speed * cylinder_speed + 3 * g2 * cylinder_acceleration)


def quantities(
    candidates: StrokeDesign, task: Task, nodes: int, dead_point_nodes: int = OPTIONS.dead_point_nodes
) -> dict[str, Floats]:
    """Compute the quantities that the constraints limit.

    Parameters
    ----------
    candidates : StrokeDesign
        n designs that meet the stroke.
    task : Task
    nodes : int
        Number of poses from start to top, closely spaced near the start, where the rates change fastest.
    dead_point_nodes : int
        See `synthesis.scenes.lift.pose.dead_point`; 0: without ``dead_point``.

    Returns
    -------
    dict of str to ndarray, shape (n, 1) or (n, nodes)
        Values by name, in the units of `Constraints`, but the sine of the transmission angle. The box contains the joints
        that move in its direction: A, B and C horizontally, B and C vertically. Beyond the length at which the cylinder
        stops, its speed is 0.
    """
    built = candidates.select(np.s_[:, None])
    fraction = np.linspace(0.0, 1.0, nodes)
    turns = built.turn * (1 - fraction * fraction)
    pose = pose_at_turn(built.design, turns, design_constants(built.design, built.gamma))
    cylinder, top_length = replace(task.cylinder, length=built.closed_length), pose.length[:, -1:]
    positions = joints(pose)
    moving = np.stack([positions[name] for name in "ABC"])
    x, y = moving.real, moving.imag[1:]
    result: dict[str, Floats] = dict(zip(LENGTHS, built.design.as_tuple()))
    with np.errstate(all="ignore"):
        speed = driven_speed(pose, cylinder) * np.ones_like(pose.length)
        drive = np.sign(cylinder.speed) * speed, cylinder.acceleration
        result |= {
            "closed_length": built.closed_length,
            "extension": top_length / built.closed_length,
            "acceleration": np.abs(acceleration(pose, *drive)),
            "jerk": np.abs(jerk(pose, *drive)),
            "rise_time": 2 * (top_length - built.closed_length) / (speed[:, :1] + speed[:, -1:]),
            # the cylinder lengthens during the whole rise: its rate keeps its sign
            "transmission": -pose.length_1 / np.hypot(pose.down, pose.height_1 + pose.across),
            "force_ratio": np.abs(pose.gain),
            "x_min": x.min(axis=0),
            "y_min": y.min(axis=0),
            "x_max": x.max(axis=0),
            "y_max": y.max(axis=0),
        }
    if dead_point_nodes:
        design = candidates.design
        lowest = np.asarray(pose_at_turn(design, dead_point(design, dead_point_nodes)).length)
        result["dead_point"] = 1 - lowest[:, None] / built.closed_length
    return result


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
        Slack by the name of the constraint. A negative slack is a violation. NaN if a design cannot be assembled.
    """
    dead_point_nodes = 0 if limits.dead_point_min is None else OPTIONS.dead_point_nodes
    values, design, high = quantities(candidates, task, nodes, dead_point_nodes), candidates.design, task.high
    # the transmission angle is never 0, because the cylinder must lengthen
    transmission: dict[str, Range] = {
        "transmission": (max(float(np.sin(limits.transmission_min or 0.0)), 1e-6), None)
    }
    ranges = limits.ranges | transmission
    if limits.closed_length[0] == limits.closed_length[1]:
        del ranges["closed_length"]
    result = {"l3<l5": ((design.l5 - design.l3) / high - OPTIONS.strict_margin)[:, None]}
    if limits.start == "collinear":
        result["l3<=l2"] = ((design.l2 - design.l3) / high)[:, None]
        result["l4<=l2"] = ((design.l2 - design.l4) / high)[:, None]
    cylinder = task.cylinder
    if cylinder.acceleration * np.sign(cylinder.speed) < 0:
        stopping_distance = cylinder.speed * cylinder.speed / (2 * abs(cylinder.acceleration))
        travel = (values["extension"] - 1) * values["closed_length"]
        result["stopping"] = (stopping_distance - travel) / high
    for name, bounds in ranges.items():
        for suffix, sign, bound in zip((">=min", "<=max"), (1, -1), bounds):
            if bound is not None:
                unit = (abs(bound) or 1.0) if name in OWN_UNIT else 1.0 if name in PLAIN_UNIT else high
                result[name + suffix] = sign * (values[name] - bound) / unit
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
    """Return the extreme of each of the `quantities` of one design at `LiftSearchOptions.measured_nodes` poses.

    The transmission angle is in radians, and the box contains all joints.
    """
    values = quantities(candidate.select(np.newaxis), task, OPTIONS.measured_nodes, DEAD_POINT_NODES)
    fixed = {"x_min": -candidate.design.b, "y_min": 0.0, "x_max": 0.0, "y_max": task.high}
    result = {}
    for name, column in values.items():
        fold = np.min if name in ("transmission", "x_min", "y_min") else np.max
        result[name] = float(fold([fold(column), fixed.get(name, fold(column))]))
    result["transmission"] = float(np.arcsin(np.clip(result["transmission"], -1.0, 1.0)))
    return result


@dataclass(frozen=True)
class ConstraintRow:
    """One limit and the value of a design."""

    name: str
    """Name of the constrained quantity."""
    value: float
    """Value of the design."""
    kind: Literal["minimum", "maximum"]
    """Lower or upper limit."""
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
    """
    kinds: tuple[tuple[Literal["minimum", "maximum"], str], ...] = (("minimum", ">=min"), ("maximum", "<=max"))
    return [
        ConstraintRow(name, values[name], kind, limit, name + suffix in active)
        for name, bounds in limits.ranges.items()
        for limit, (kind, suffix) in zip(bounds, kinds)
        if limit is not None
    ]
