"""The pneumatic lift: pose, velocity and acceleration of a cylinder-driven lifting linkage, without integration.

A rigid triangle ABC hangs with A on the vertical slide x = -b. A cylinder OB of length l1(t) pushes its corner B, a
link DC holds its corner C. O = (0, 0) is the cylinder's pivot, D = (-b, 0) the link's, A = (-b, s) the platform;
AB = l2, AC = l3, BC = l4, DC = l5. One number, the *turn* T = angle DAC, gives every pose in closed form: T = 0 is
the top (C straight below A, s = l3 + l5) and grows downwards. In the source's symbols T = mu + pi/2 with mu the
direction of AC and theta3 = mu + pi.

Source: Gan, Meng, Li, Zhou, "Kinematic simulation and optimization of a pneumatic linkage lifting mechanism",
Machinery Design & Manufacture 2020-3. Numbers in parentheses are its equations. Its loops (7)-(12) and the linear
systems (13), (14) are in `synthesis.lift_loops`, as an independent check.

Lengths are in the user's unit, angles in radians. Every array argument broadcasts; a design or a cylinder may hold
arrays, with batch axes leading. What cannot be assembled is NaN in the array functions, and a `FieldError` that
names the constraint and the amount in `motion`, the function for one lift.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.errors import FieldError

EPSILON = float(np.finfo(float).eps)
MAX_ITERATIONS = 80
"""Newton steps at most; a bracket of a turn is halved to one unit in the last place well before that."""
SEARCH_NODES = 128
"""Nodes of each of the two grids in a quarter turn on which the dead points are isolated."""
SEARCH_BLOCK = 256
"""Designs whose dead points are searched at a time: bounds the memory of a batch."""


@dataclass(frozen=True)
class Design:
    """The five fixed lengths of a lift; floats or arrays that broadcast."""

    l2: Any
    l3: Any
    l4: Any
    l5: Any
    b: Any

    def as_tuple(self) -> tuple[Any, Any, Any, Any, Any]:
        """The lengths in the order (l2, l3, l4, l5, b)."""
        return self.l2, self.l3, self.l4, self.l5, self.b

    def as_dict(self) -> dict[str, float]:
        """The lengths of one design as plain numbers."""
        return dict(zip(("l2", "l3", "l4", "l5", "b"), (float(value) for value in self.as_tuple())))


@dataclass(frozen=True)
class Cylinder:
    """The drive: length in the lowest position, and speed and constant acceleration of that length.

    A negative speed retracts the cylinder: the motion starts at the top. Both rates count lengthening as positive.
    """

    length: Any
    speed: Any = 1.0
    acceleration: Any = 0.0


@dataclass(frozen=True)
class Shape:
    """What all poses of a design share: the triangle's angle gamma at A, and k^2 = l5^2 - l3^2."""

    cos_gamma: np.ndarray
    sin_gamma: np.ndarray
    gamma: np.ndarray
    k_squared: np.ndarray


def triangle_angle(side: Any, other: Any, opposite: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle between two sides of a triangle, from the third: its cosine, its sine and itself.

    Half-angle form, so that flat triangles keep their digits. NaN where the strict triangle inequality (34) fails.
    Law: the three angles of a triangle add up to pi.
    """
    side, other, opposite = (np.asarray(value, dtype=float) for value in (side, other, opposite))
    low = (opposite - (side - other)) * (opposite + (side - other))
    high = (side + other + opposite) * (side + other - opposite)
    proper = (low > 0) & (high > 0)
    low, high = np.where(proper, low, np.nan), np.where(proper, high, np.nan)
    product = 4 * side * other
    return (
        (high - low) / product,
        2 * np.sqrt(low) * np.sqrt(high) / product,
        2 * np.arctan2(np.sqrt(low), np.sqrt(high)),
    )


def shape(design: Design) -> Shape:
    """The constants of a design; NaN unless the triangle is proper (34) and l3 < l5 (36)."""
    cos_gamma, sin_gamma, gamma = triangle_angle(design.l2, design.l3, design.l4)
    k_squared = (np.asarray(design.l5, dtype=float) - design.l3) * (np.asarray(design.l5, dtype=float) + design.l3)
    return Shape(cos_gamma, sin_gamma, gamma, np.where(k_squared > 0, k_squared, np.nan))


@dataclass(frozen=True)
class Pose:
    """Poses and their derivatives by the turn T (suffixes ``_1`` and ``_2``), all of one shape.

    ``height`` is s, ``(x, y)`` the corner B, ``length`` the cylinder's length l1, ``root`` the height of C over D.
    """

    turn: np.ndarray
    sin_turn: np.ndarray
    cos_turn: np.ndarray
    root: np.ndarray
    height: np.ndarray
    height_1: np.ndarray
    height_2: np.ndarray
    x: np.ndarray
    y: np.ndarray
    x_1: np.ndarray
    y_1: np.ndarray
    x_2: np.ndarray
    y_2: np.ndarray
    length: np.ndarray
    length_1: np.ndarray
    length_2: np.ndarray


def pose_at_turn(design: Design, turn: Any) -> Pose:
    """Closed-form poses at given turns.

    Written without cancellation: with k^2 = l5^2 - l3^2 the root is a sum of squares, s' is a product, and below the
    level of C the height is k^2 / (root + l3 |cos T|) instead of a difference. At turn 0, s' is 0 exactly.

    Laws: length^2 = x^2 + y^2; AB, AC, BC and DC keep their lengths; each derivative is the limit of differences.
    """
    turn = np.asarray(turn, dtype=float)
    return _pose(design, shape(design), turn, np.sin(turn), np.cos(turn))


def pose_at_height(design: Design, height: Any) -> Pose:
    """Closed-form poses at given heights, with C on the side of the cylinder (0 <= turn <= pi).

    NaN outside l5 - l3 <= s <= l5 + l3. No inverse cosine: half the digits would be lost towards the top.
    """
    height = np.asarray(height, dtype=float)
    # the triangle ADC: sides s and l3 at A, opposite l5; the factors are those of the source's cos and sin of mu
    down = (design.l5 + (design.l3 - height)) * (design.l5 - (design.l3 - height))
    up = ((height - design.l5) + design.l3) * (height + design.l3 + design.l5)
    inside = (down >= 0) & (up >= 0) & (height > 0)
    product = 4 * design.l3 * np.where(inside, height, np.nan)
    down, up = np.sqrt(np.where(inside, down, np.nan)), np.sqrt(np.where(inside, up, np.nan))
    sin_turn, cos_turn = 2 * down * up / product, (up - down) * (up + down) / product
    return _pose(design, shape(design), 2 * np.arctan2(down, up), sin_turn, cos_turn)


def _pose(design: Design, form: Shape, turn: np.ndarray, sin_turn: np.ndarray, cos_turn: np.ndarray) -> Pose:
    l2, l3, k2 = design.l2, design.l3, form.k_squared
    level = l3 * cos_turn  # how far C hangs below A
    root = np.sqrt(k2 + level * level)
    # root + level as such where it is a sum; where it would cancel, k^2 = (root + level)(root - level) is divided
    both = root + np.abs(level)
    s = np.where(level >= 0, both, k2 / both)
    ratio = -l3 * sin_turn / root
    s_1 = s * ratio
    s_2 = s * (ratio * ratio - level * (k2 + l3 * l3) / (root * root * root))
    cos_ab = cos_turn * form.cos_gamma + sin_turn * form.sin_gamma
    sin_ab = sin_turn * form.cos_gamma - cos_turn * form.sin_gamma
    across, down = l2 * sin_ab, l2 * cos_ab
    x, y = across - design.b, s - down
    x_1, y_1 = down, s_1 + across
    x_2, y_2 = -across, s_2 + down
    length = np.hypot(x, y)
    length_1 = (x * x_1 + y * y_1) / length
    length_2 = (x_1 * x_1 + y_1 * y_1 + x * x_2 + y * y_2 - length_1 * length_1) / length
    return Pose(turn, sin_turn, cos_turn, root, s, s_1, s_2, x, y, x_1, y_1, x_2, y_2, length, length_1, length_2)


def _half_square_rates(design: Design, turn: Any) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivative of l1^2 / 2 by the turn: their zeros are the dead points, also where l1 is 0."""
    pose = pose_at_turn(design, turn)
    first = pose.x * pose.x_1 + pose.y * pose.y_1
    return first, pose.x_1**2 + pose.y_1**2 + pose.x * pose.x_2 + pose.y * pose.y_2


def _rising_root(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], low: Any, high: Any, guess: Any, noise: Any
) -> np.ndarray:
    """Roots of functions that rise from negative at `low` to positive at `high`: Newton, kept in bounds by halving.

    ``function(x)`` returns value and slope; `noise` is the value that rounding alone can make. NaN stays NaN.
    """
    low, high, x = np.broadcast_arrays(low, high, guess)
    # a hair of room, so that a root at the very end is stepped onto and not halved towards
    pad = 4 * EPSILON * np.maximum(np.abs(low), np.abs(high))
    first, last = low, high
    low, high = low - pad, high + pad
    x = np.clip(x, first, last)
    settled = np.isnan(x)
    for _ in range(MAX_ITERATIONS):
        value, slope = function(x)
        low, high = np.where(value < 0, x, low), np.where(value > 0, x, high)
        step = np.divide(value, slope, out=np.full(x.shape, np.nan), where=slope > 0)
        newton = x - step
        following = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        near = (np.abs(value) <= noise) | (np.abs(following - x) <= 2 * EPSILON * np.abs(x)) | np.isnan(value)
        # what has settled stays: a batch gives to the last bit what its members give one by one
        x = np.where(settled | (value == 0), x, following)
        settled = settled | near
        if settled.all():
            break
    return np.clip(x, first, last)


def _search_nodes(design: Design) -> np.ndarray:
    """Turns from 0 to 2 pi, shape (..., nodes), dense where C passes the level of A or of D's opposite side.

    When l3 comes near l5 the height has a corner of width kappa = k / l3 at a quarter turn; the spacing follows it.
    """
    kappa = (np.sqrt(shape(design).k_squared) / design.l3)[..., None]
    even = np.linspace(-1.0, 1.0, 2 * SEARCH_NODES + 1)
    cluster = kappa * np.sinh(even * np.arcsinh(0.5 * np.pi / kappa))
    flat = np.broadcast_to(0.5 * np.pi * even, cluster.shape)
    half = np.clip(np.sort(np.concatenate([cluster, flat], axis=-1), axis=-1), -0.5 * np.pi, 0.5 * np.pi)
    return np.concatenate([0.5 * np.pi + half, 1.5 * np.pi + half], axis=-1)


def dead_point(design: Design) -> np.ndarray:
    """The turn of the dead point below the top: the first one from the top at which dl1/dT = 0, shape (...).

    From there to the top the cylinder lengthens steadily; that stretch is the working branch. NaN where the design
    cannot be assembled, and where the cylinder would have to shorten to come to the top (`top_lever` <= 0).

    Law: dl1/dT < 0 between 0 and the dead point, and 0 at it.
    """
    fields = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in design.as_tuple()))
    flat = [field.reshape(-1) for field in fields]
    turns = np.full(flat[0].shape, np.nan)
    for start in range(0, turns.size, SEARCH_BLOCK):
        block = slice(start, start + SEARCH_BLOCK)
        turns[block] = _dead_points_of_block(Design(*(field[block] for field in flat)))
    return turns.reshape(fields[0].shape)[()]


def _dead_points_of_block(design: Design) -> np.ndarray:
    nodes = _search_nodes(design)
    tall = Design(*(value[:, None] for value in design.as_tuple()))
    first, second = _half_square_rates(tall, nodes)
    works = first[:, 0] < 0
    rows = np.arange(works.size)
    end = np.argmax(first > 0, axis=1)  # the length is periodic, so a working branch has an end
    low, high = nodes[rows, end - 1], nodes[rows, end]
    # two dead points between neighbouring nodes show only as a peak of the rate: look at the top of each peak
    peaks = (first[:, :-1] < 0) & (first[:, 1:] < 0) & (second[:, :-1] > 0) & (second[:, 1:] < 0)
    peaks &= np.arange(nodes.shape[1] - 1) < end[:, None]
    row, column = np.nonzero(peaks & works[:, None])
    if row.size:
        some = Design(*(value[row] for value in design.as_tuple()))
        left, right = nodes[row, column], nodes[row, column + 1]

        def falling_rate(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            rate = -_half_square_rates(some, turn)[1]
            return rate, np.full(rate.shape, np.nan)  # no third derivative: halving

        peak = _rising_root(falling_rate, left, right, 0.5 * (left + right), 0.0)
        for at in np.nonzero(_half_square_rates(some, peak)[0] >= 0)[0][::-1]:  # downwards: the first one stays
            low[row[at]], high[row[at]] = left[at], peak[at]
    low, high = np.where(works, low, np.nan), np.where(works, high, np.nan)
    root = _rising_root(lambda turn: _half_square_rates(design, turn), low, high, 0.5 * (low + high), 0.0)
    return np.where(works, root, np.nan)


def top_lever(design: Design) -> np.ndarray:
    """The lever b cos gamma + (l3 + l5) sin gamma; the cylinder lengthens towards the top where it is positive.

    At the top l1 dl1/dT = -l2 times this, so that it is the sign of the working branch. NaN without a triangle.
    """
    form = shape(design)
    return design.b * form.cos_gamma + (np.asarray(design.l3, dtype=float) + design.l5) * form.sin_gamma


def turn_at_length(design: Design, length: Any, turn_dead: Any | None = None) -> np.ndarray:
    """The turn on the working branch at given cylinder lengths; NaN where that branch has no such length.

    A scalar Newton iteration in the turn, bracketed by the top and the dead point (`turn_dead`, found when not
    given). Near the dead point l1 is quadratic in the turn, hence the turn is smooth in w = sqrt(l1 - l1_dead): the
    cubic in w with the right ends and end slopes is the first guess, and two to four steps remain.

    Laws: ``pose_at_turn(design, result).length`` is `length`; the result falls as `length` grows.
    """
    turn_dead = dead_point(design) if turn_dead is None else np.asarray(turn_dead, dtype=float)
    bottom, top = pose_at_turn(design, turn_dead), pose_at_turn(design, 0.0)
    length = np.asarray(length, dtype=float)
    inside = (length >= bottom.length) & (length <= top.length)
    length, turn_dead = np.broadcast_arrays(np.where(inside, length, np.nan), turn_dead)
    width = np.sqrt(top.length - bottom.length)
    w = np.sqrt(np.where(inside, length - bottom.length, np.nan)) / width
    slope_low = -width * np.sqrt(2 / np.where(bottom.length_2 > 0, bottom.length_2, np.inf))
    slope_high = 2 * width * width / top.length_1
    rest = 1 - w
    guess = rest * rest * ((1 + 2 * w) * turn_dead + w * slope_low) - w * w * rest * slope_high
    form = shape(design)

    def shortage(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pose = _pose(design, form, turn, np.sin(turn), np.cos(turn))
        return length - pose.length, -pose.length_1

    noise = 2 * EPSILON * (length + design.b + design.l2)
    return _rising_root(shortage, 0 * turn_dead, turn_dead, guess, noise)[()]


def turns_at_length(design: Design, length: float) -> np.ndarray:
    """All turns in [0, 2 pi) of one design at one cylinder length, the highest platform first.

    The platform is above D in all of them; each has a mirror image below (height -s). The working branch is at most
    one of them: the only one with its turn below `dead_point`.
    """
    nodes = _search_nodes(Design(*(np.asarray(value, dtype=float) for value in design.as_tuple())))
    rate, _ = _half_square_rates(design, nodes)
    at = np.nonzero((rate[:-1] < 0) != (rate[1:] < 0))[0]
    sign = np.where(rate[at] < 0, 1.0, -1.0)

    def signed_rate(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first, second = _half_square_rates(design, turn)
        return sign * first, sign * second

    extremes = _rising_root(signed_rate, nodes[at], nodes[at + 1], 0.5 * (nodes[at] + nodes[at + 1]), 0.0)
    edges = np.concatenate([[0.0], extremes, [2 * np.pi]])
    ends = pose_at_turn(design, edges).length
    low, high = edges[:-1], edges[1:]
    direction = np.sign(ends[1:] - ends[:-1])
    holds = (length - ends[:-1]) * (length - ends[1:]) <= 0
    low, high, direction = low[holds], high[holds], direction[holds]

    def excess(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pose = pose_at_turn(design, turn)
        return direction * (pose.length - length), direction * pose.length_1

    turns = np.unique(_rising_root(excess, low, high, 0.5 * (low + high), 0.0) % (2 * np.pi))
    distinct = np.concatenate([[True], np.diff(turns) > 8 * EPSILON]) if turns.size else np.zeros(0, dtype=bool)
    turns = turns[distinct]
    return turns[np.argsort(-pose_at_turn(design, turns).height, kind="stable")]


@dataclass(frozen=True)
class Stroke:
    """The stretch of the working branch between the cylinder's shortest length and the top, shape (...) each.

    ``duration`` is the time for it, up or down; NaN where the cylinder stops before the end.
    """

    turn_bottom: np.ndarray
    turn_dead: np.ndarray
    length_dead: np.ndarray
    length_top: np.ndarray
    height_bottom: np.ndarray
    height_top: np.ndarray
    duration: np.ndarray


def stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The strokes of a batch of designs and cylinders; NaN where a lift cannot be assembled or does not work."""
    turn_dead = dead_point(design)
    turn_bottom = turn_at_length(design, cylinder.length, turn_dead)
    length_dead, top = pose_at_turn(design, turn_dead).length, pose_at_turn(design, 0.0)
    bottom = pose_at_turn(design, turn_bottom)
    travel = top.length - cylinder.length
    duration = travel_time(np.where(np.isnan(turn_bottom), np.nan, travel), cylinder.speed, cylinder.acceleration)
    return Stroke(turn_bottom, turn_dead, length_dead, top.length, bottom.height, top.height, duration)


def travel_time(travel: Any, speed: Any, acceleration: Any) -> np.ndarray:
    """Time in which the cylinder first covers `travel` >= 0 in the direction of its speed; NaN if it stops before.

    t = 2 e / (|v| + sqrt(v^2 + 2 a e)), with a counted along the speed: no cancellation for small a. A root that is
    zero to rounding counts as zero: the cylinder comes to rest just at the end.

    Law: |v| t + a t^2 / 2 = e.
    """
    travel, speed, acceleration = (np.asarray(value, dtype=float) for value in (travel, speed, acceleration))
    along = acceleration * np.sign(speed)
    square = speed * speed + 2 * along * travel
    square = np.where(np.abs(square) <= 8 * EPSILON * speed * speed, 0.0, square)
    final = np.sqrt(np.where(square >= 0, square, np.nan))
    total = np.abs(speed) + final
    return np.divide(2 * travel, total, out=np.full(total.shape, np.nan), where=total > 0)[()]


@dataclass(frozen=True)
class Motion:
    """A motion of one lift: the stroke, and over `time` the cylinder and the platform."""

    design: Design
    stroke: Stroke
    time: np.ndarray
    cylinder_length: np.ndarray
    cylinder_speed: np.ndarray
    cylinder_acceleration: float
    pose: Pose
    velocity: np.ndarray
    acceleration: np.ndarray


def velocity(pose: Pose, cylinder_speed: Any) -> np.ndarray:
    """Velocity of the platform, v_s = v_l s' / l1', the solution of (13)."""
    return cylinder_speed * pose.height_1 / pose.length_1


def acceleration(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> np.ndarray:
    """Acceleration of the platform, the solution of (14).

    a_s = v_l^2 (s'' l1' - s' l1'') / l1'^3 + a_l s' / l1'. Law: the time derivative of `velocity`.
    """
    turn_rate = cylinder_speed / pose.length_1
    bend = pose.height_2 - pose.height_1 / pose.length_1 * pose.length_2
    return turn_rate * turn_rate * bend + cylinder_acceleration * (pose.height_1 / pose.length_1)


def motion(
    design: Design, cylinder: Cylinder, times: Any | None = None, samples: int = 201, limits: Stroke | None = None
) -> Motion:
    """The motion of one lift, at given times or at `samples` even ones from start to end.

    Rising starts at the cylinder's length, lowering (speed < 0) at the top. `limits` are those of `checked_stroke`,
    when they are known already.

    Raises
    ------
    FieldError
        With ``constraint`` and ``amount``: see `checked_stroke`; ``time`` for times outside of the motion.
    """
    limits = checked_stroke(design, cylinder) if limits is None else limits
    if times is None:
        times = np.linspace(0.0, float(limits.duration), samples)
    times = np.asarray(times, dtype=float)
    _check_times(times, float(limits.duration))
    rising = cylinder.speed > 0
    shortest, longest = float(cylinder.length), float(limits.length_top)
    start, end = (shortest, longest) if rising else (longest, shortest)
    length = start + times * (cylinder.speed + 0.5 * cylinder.acceleration * times)
    length = np.where(times >= limits.duration * (1 - EPSILON), end, np.clip(length, shortest, longest))
    pose = pose_at_turn(design, turn_at_length(design, length, limits.turn_dead))
    speed = cylinder.speed + cylinder.acceleration * times
    return Motion(
        design,
        limits,
        times,
        length,
        speed,
        float(cylinder.acceleration),
        pose,
        velocity(pose, speed),
        acceleration(pose, speed, cylinder.acceleration),
    )


TIME_ROOM = 1e-12
"""Relative room for a time that is meant to be the very end but was rounded on its way."""


def _check_times(times: np.ndarray, duration: float) -> None:
    wrong = np.nonzero(~((times >= 0) & (times <= duration * (1 + TIME_ROOM))))[0]
    if wrong.size:
        at = int(wrong[0])
        found = float(times[at])
        amount = -found if found < 0 else found - duration
        raise FieldError(
            f"/times/{at}",
            f"the motion lasts from 0 to {duration:.9g}, found {found:.9g}",
            constraint="time",
            amount=amount,
            rise_time=duration,
        )


def checked_stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The stroke of one lift, or the constraint that it fails and by how much.

    Raises
    ------
    FieldError
        ``constraint`` is one of ``triangle`` (34), ``l3<l5`` (36), ``top_lever`` (the cylinder must shorten to come
        to the top), ``dead_point`` (length at or below the dead point's: no such pose, or none that lifts),
        ``cylinder_length`` (no pose: longer than at the top), ``speed`` (zero) or ``stopping`` (the cylinder comes
        to rest before the end). ``amount`` >= 0 is by how much, in the lengths' unit.
    """
    l2, l3, l4, l5, _ = (float(value) for value in design.as_tuple())
    sides = {"l2": l2, "l3": l3, "l4": l4}
    longest = max(sides, key=lambda name: sides[name])
    others = [name for name in sides if name != longest]
    if np.isnan(triangle_angle(l2, l3, l4)[2]):
        excess = (sides[longest] - sides[others[0]]) - sides[others[1]]
        raise FieldError(
            "/design",
            f"no triangle ABC: {longest} must be less than {others[0]} + {others[1]}, it is {excess:.9g} too long",
            constraint="triangle",
            amount=max(excess, 0.0),
        )
    if not l3 < l5:
        raise FieldError(
            "/design",
            f"the loop of slide and link does not close in every position: l3 must be less than l5, "
            f"it is {l3 - l5:.9g} too long",
            constraint="l3<l5",
            amount=l3 - l5,
        )
    if float(cylinder.speed) == 0:
        raise FieldError(
            "/cylinder/speed", "the cylinder stands still: its speed must not be 0", constraint="speed", amount=0.0
        )
    limits = stroke(design, cylinder)
    length, dead, top = float(cylinder.length), float(limits.length_dead), float(limits.length_top)
    lever = float(top_lever(design))
    if np.isnan(limits.turn_dead):
        raise FieldError(
            "/design",
            f"the cylinder would have to shorten to come to the top: the lever b cos(gamma) + (l3 + l5) sin(gamma) "
            f"must be positive, it is {lever:.9g}",
            constraint="top_lever",
            amount=max(-lever, 0.0),
        )
    if not length > dead:
        raise FieldError(
            "/cylinder/length",
            f"no pose that lifts at this length: the dead point is at {dead:.9g}, {dead - length:.9g} above",
            constraint="dead_point",
            amount=dead - length,
            dead_point_length=dead,
        )
    if not length < top:
        raise FieldError(
            "/cylinder/length",
            f"no stroke: the top is at cylinder length {top:.9g}, {length - top:.9g} below",
            constraint="cylinder_length",
            amount=length - top,
            length_top=top,
        )
    if np.isnan(limits.duration):
        reach = float(cylinder.speed) ** 2 / (2 * abs(float(cylinder.acceleration)))
        raise FieldError(
            "/cylinder/acceleration",
            f"the cylinder comes to rest after {reach:.9g} of {top - length:.9g}: the stroke is not reached",
            constraint="stopping",
            amount=(top - length) - reach,
        )
    return limits
