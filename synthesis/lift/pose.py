"""The lift's pose: closed form by one angle, the branches of the cylinder's length, and the dead point between them.

A rigid triangle ABC hangs with A on the vertical slide x = -b. A cylinder OB of length l1(t) pushes its corner B, a
link DC holds its corner C. O = (0, 0) is the cylinder's pivot, D = (-b, 0) the link's, A = (-b, s) the platform;
AB = l2, AC = l3, BC = l4, DC = l5. One number, the *turn* T = angle DAC, gives every pose in closed form: T = 0 is
the top (C straight below A, s = l3 + l5) and grows downwards. In the source's symbols T = mu + pi/2 with mu the
direction of AC and theta3 = mu + pi.

Source: Gan, Meng, Li, Zhou, "Kinematic simulation and optimization of a pneumatic linkage lifting mechanism",
Machinery Design & Manufacture 2020-3. Numbers in parentheses are its equations. Its loops (7)-(12) and the linear
systems (13), (14) are in `synthesis.lift.loops`, as an independent check.

Lengths are in the user's unit, angles in radians. Every array argument broadcasts; a design or a cylinder may hold
arrays, with batch axes leading. What cannot be assembled is NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

EPSILON = float(np.finfo(float).eps)
MAX_ITERATIONS = 80
"""Newton steps at most; a bracket of a turn is halved to one unit in the last place well before that."""
GUESS_NODES = 513
"""Nodes of the table of first guesses; two Newton steps remain."""
SMALL_STEP = 1e-9
"""A Newton step this small, in units of the distance to the nearer end of the bracket, is the last one needed."""
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


def _length_and_rate(design: Design, form: Shape, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """l1 and dl1/dT alone, as in `_pose`: what the Newton iteration needs of a pose."""
    sin_turn, cos_turn = np.sin(turn), np.cos(turn)
    level = design.l3 * cos_turn
    root = np.sqrt(form.k_squared + level * level)
    both = root + np.abs(level)
    s = np.where(level >= 0, both, form.k_squared / both)
    down = design.l2 * (cos_turn * form.cos_gamma + sin_turn * form.sin_gamma)
    across = design.l2 * (sin_turn * form.cos_gamma - cos_turn * form.sin_gamma)
    x, y = across - design.b, s - down
    length = np.hypot(x, y)
    return length, (x * down + y * (across - design.l3 * sin_turn * s / root)) / length


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
        # the next error is about step^2 / distance to where the slope vanishes, which is not within the bracket
        near |= np.abs(step) <= SMALL_STEP * np.minimum(x - first, last - x)
        # what has settled stays: a batch gives to the last bit what its members give one by one
        x = np.where(settled | (value == 0), x, following)
        settled = settled | near
        if settled.all():
            break
    return np.clip(x, first, last)


def _sign_changes(function: Callable[[np.ndarray], tuple[np.ndarray, Any]], nodes: np.ndarray) -> np.ndarray:
    """Where a function changes its sign between neighbouring nodes; halving where it gives no slope (None)."""
    values = function(nodes)[0]
    at = np.nonzero((values[:-1] < 0) != (values[1:] < 0))[0]
    sign = np.where(values[at] < 0, 1.0, -1.0)

    def rising(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slope = function(x)
        return sign * value, np.full(x.shape, np.nan) if slope is None else sign * slope

    return _rising_root(rising, nodes[at], nodes[at + 1], 0.5 * (nodes[at] + nodes[at + 1]), 0.0)


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
    first guess is the cubic in w with the right ends and end slopes, or a table over w when there are many lengths.

    Laws: ``pose_at_turn(design, result).length`` is `length`; the result falls as `length` grows.
    """
    turn_dead = dead_point(design) if turn_dead is None else np.asarray(turn_dead, dtype=float)
    bottom, top = pose_at_turn(design, turn_dead), pose_at_turn(design, 0.0)
    length, square = np.asarray(length, dtype=float), top.length - bottom.length
    # no branch where rounding leaves nothing between its ends
    inside = (length >= bottom.length) & (length <= top.length) & (square > 0)
    length, turn_dead = np.broadcast_arrays(np.where(inside, length, np.nan), turn_dead)
    square = np.where(square > 0, square, np.nan)
    w = np.sqrt(np.where(inside, length - bottom.length, np.nan) / square)
    if turn_dead.size > GUESS_NODES and all(np.ndim(value) == 0 for value in design.as_tuple()):
        # many lengths of one design: a table of the branch, dense towards the dead point, costs less than the steps
        nodes = turn_dead.flat[0] * (1 - np.linspace(0.0, 1.0, GUESS_NODES) ** 2)
        lengths = np.maximum.accumulate(pose_at_turn(design, nodes).length)
        guess = np.interp(w, np.sqrt((lengths - lengths[0]) / (lengths[-1] - lengths[0])), nodes)
    else:
        slope_low = -np.sqrt(2 * square / np.where(bottom.length_2 > 0, bottom.length_2, np.inf))
        slope_top = 2 * square / top.length_1
        u = 1 - w
        guess = u * u * ((1 + 2 * w) * turn_dead + w * slope_low) - w * w * u * slope_top
    guess = np.where(np.isfinite(guess) | ~inside, guess, 0.5 * turn_dead)
    form = shape(design)

    def shortage(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found, rate = _length_and_rate(design, form, turn)
        return length - found, -rate

    noise = 2 * EPSILON * (length + design.b + design.l2)
    return _rising_root(shortage, 0 * turn_dead, turn_dead, guess, noise)[()]


def turns_at_length(design: Design, length: float) -> np.ndarray:
    """All turns in [0, 2 pi) of one design at one cylinder length, the highest platform first.

    The platform is above D in all of them; each has a mirror image below (height -s). The working branch is at most
    one of them: the only one with its turn below `dead_point`.
    """
    nodes = _search_nodes(Design(*(np.asarray(value, dtype=float) for value in design.as_tuple())))
    # the turns of extreme rate among the nodes leave no two dead points between neighbours
    nodes = np.union1d(nodes, _sign_changes(lambda turn: (_half_square_rates(design, turn)[1], None), nodes))
    extremes = _sign_changes(lambda turn: _half_square_rates(design, turn), nodes)
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
