"""The lift's pose: closed form by one angle, the branches of the cylinder's length, and the dead point between them.

A rigid triangle ABC hangs with A on the vertical slide x = -b. A cylinder OB of length l1(t) pushes its corner B, a
link DC holds its corner C. O = (0, 0) is the cylinder's pivot, D = (-b, 0) the link's, A = (-b, s) the platform;
AB = l2, AC = l3, BC = l4, DC = l5. One number, the *turn* T = angle DAC, gives every pose in closed form: T = 0 is
the top (C straight below A, s = l3 + l5) and grows downwards. In the source's symbols T = mu + pi/2 with mu the
direction of AC and theta3 = mu + pi.

Source: Gan, Meng, Li, Zhou, "Kinematic simulation and optimization of a pneumatic linkage lifting mechanism",
Machinery Design & Manufacture 2020-3. Numbers in parentheses are its equations. Its loops (7)-(12) are in
`synthesis.scenes.lift.motion`, as an independent check.

Lengths are in the user's unit, angles in radians. Every array argument broadcasts; a design or a cylinder may hold
arrays, with batch axes leading. What cannot be assembled is NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from synthesis.one_variable import EPSILON, Flags, Floats, bisect, rising_root

SEARCH_NODES = 128
"""Nodes of each of the two grids in a quarter turn on which the dead points are isolated."""
SEARCH_BLOCK = 256
"""Designs whose dead points are searched at a time."""


Length = Annotated[Any, float]
"""A float or an array; one number in a reply."""


@dataclass(frozen=True)
class Design:
    """The five fixed lengths.

    Numbers of one lift, or arrays that broadcast, of many.
    """

    l2: Length
    l3: Length
    l4: Length
    l5: Length
    b: Length

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


def half_angle_squares(side: Any, other: Any, opposite: Any) -> tuple[Any, Any]:
    """Squared sine and cosine of half the angle between two sides of a triangle, times 4 side other.

    Products of sums and differences, so that flat triangles keep their digits, unlike an inverse cosine's. The first
    is negative where the third side is too short for a triangle, the second where it is too long.
    """
    low = (opposite - (side - other)) * (opposite + (side - other))
    return low, (side + other + opposite) * ((side - opposite) + other)


def triangle_angle(side: Any, other: Any, opposite: Any) -> tuple[Floats, Floats, Floats]:
    """Angle between two sides of a triangle, from the third: its cosine, its sine and itself.

    NaN where the strict triangle inequality (34) fails. Law: the three angles of a triangle add up to pi.
    """
    side, other, opposite = (np.asarray(value, dtype=float) for value in (side, other, opposite))
    low, high = half_angle_squares(side, other, opposite)
    proper = (low > 0) & (high > 0)
    low, high = np.where(proper, low, np.nan), np.where(proper, high, np.nan)
    product = 4 * side * other
    return (
        (high - low) / product,
        2 * np.sqrt(low) * np.sqrt(high) / product,
        2 * np.arctan2(np.sqrt(low), np.sqrt(high)),
    )


def angle_or_flat(side: Any, other: Any, opposite: Any) -> Any:
    """Angle between two sides of a triangle that may be flat: rounding past flat counts as flat."""
    low, high = half_angle_squares(side, other, opposite)
    return 2 * np.arctan2(np.sqrt(np.maximum(low, 0.0)), np.sqrt(np.maximum(high, 0.0)))


def third_side(side: Any, other: Any, angle: Any) -> Any:
    """The side of a triangle opposite a given angle, as a root of positive terms."""
    return np.sqrt((side - other) ** 2 + 4 * side * other * np.sin(0.5 * angle) ** 2)


@dataclass(frozen=True)
class Shape:
    """What all poses of a design share: the triangle's angle gamma at A, and k^2 = l5^2 - l3^2."""

    cos_gamma: Any
    sin_gamma: Any
    gamma: Any
    k_squared: Any


def shape(design: Design, gamma: Any | None = None) -> Shape:
    """The constants of a design; NaN unless the triangle is proper (34) and l3 < l5 (36).

    `gamma` is the triangle's angle at A where it is known better than from the three sides.
    """
    if gamma is None:
        cos_gamma, sin_gamma, gamma = triangle_angle(design.l2, design.l3, design.l4)
    else:
        cos_gamma, sin_gamma = np.cos(gamma), np.sin(gamma)
    k_squared = (np.asarray(design.l5, dtype=float) - design.l3) * (np.asarray(design.l5, dtype=float) + design.l3)
    return Shape(cos_gamma, sin_gamma, gamma, np.where(k_squared > 0, k_squared, np.nan))


@dataclass(frozen=True)
class Pose:
    """Poses of a design and their derivatives by the turn T (suffixes ``_1`` and ``_2``), all of one shape.

    ``height`` is s, ``(x, y)`` the corner B, ``across`` and ``down`` where B is from A, ``root`` the height of C over
    D, ``length`` the cylinder's length l1; ``half_square`` is l1^2 / 2, whose derivatives are finite also where l1
    is 0. Second derivatives are computed when they are first asked for.
    """

    design: Design
    form: Shape
    sin_turn: Any
    cos_turn: Any
    root: Any
    height: Any
    height_1: Any
    across: Any
    down: Any
    x: Any
    y: Any
    length: Any
    half_square_1: Any

    @cached_property
    def turn(self) -> Any:
        """The turn, 0 to 2 pi."""
        return np.arctan2(self.sin_turn, self.cos_turn) % (2 * np.pi)

    @cached_property
    def length_1(self) -> Any:
        """Derivative of the cylinder's length, negative on the working branch."""
        return self.half_square_1 / self.length

    @cached_property
    def gain(self) -> Any:
        """ds/dl1: the platform's speed over the cylinder's; infinite at a dead point, negative past it."""
        rate = self.half_square_1
        return np.divide(self.length * self.height_1, rate, out=np.full(np.shape(rate), np.inf), where=rate != 0)

    @cached_property
    def height_2(self) -> Any:
        """Second derivative of the height."""
        l3, root = self.design.l3, self.root
        bend = l3 * self.cos_turn * (self.form.k_squared + l3 * l3) / (root * root * root)
        return self.height_1 * (self.height_1 / self.height) - self.height * bend

    @cached_property
    def half_square_2(self) -> Any:
        """Second derivative of l1^2 / 2."""
        turning = self.down * self.height + self.across * (self.design.b + self.height_1)
        return turning + self.height_2 * self.y + self.height_1 * (self.height_1 + self.across)

    @cached_property
    def length_2(self) -> Any:
        """Second derivative of the cylinder's length."""
        return (self.half_square_2 - self.length_1 * self.length_1) / self.length


def pose_at_turn(design: Design, turn: Any, form: Shape | None = None) -> Pose:
    """Closed-form poses at given turns; `form` is the design's `shape`, when it is known already.

    Written without cancellation: with k^2 = l5^2 - l3^2 the root is a sum of squares, s' is a product, and below the
    level of C the height is k^2 / (root + l3 |cos T|) instead of a difference. At turn 0, s' is 0 exactly.

    Laws: length^2 = x^2 + y^2; AB, AC, BC and DC keep their lengths; each derivative is the limit of differences.
    """
    turn = np.asarray(turn, dtype=float)
    return _pose(design, shape(design) if form is None else form, np.sin(turn), np.cos(turn))


def pose_at_height(design: Design, height: Any, form: Shape | None = None, clip: bool = False) -> Pose:
    """Closed-form poses at given heights, with C on the side of the cylinder (0 <= turn <= pi).

    Outside l5 - l3 <= s <= l5 + l3 it is NaN, or with `clip` the end. No inverse cosine: half the digits would be
    lost towards the top.
    """
    height = np.asarray(height, dtype=float)
    # the triangle ADC: sides s and l3 at A, opposite l5
    low, high = half_angle_squares(height, design.l3, design.l5)
    if clip:
        low, high = np.maximum(low, 0.0), np.maximum(high, 0.0)
    inside = (low >= 0) & (high >= 0) & (height > 0)
    product = np.where(inside, 4 * design.l3 * height, np.nan)
    sin_turn = 2 * np.sqrt(np.where(inside, low * high, np.nan)) / product
    return _pose(design, shape(design) if form is None else form, sin_turn, (high - low) / product)


def _pose(design: Design, form: Shape, sin_turn: Any, cos_turn: Any) -> Pose:
    l2, l3, k2 = design.l2, design.l3, form.k_squared
    level = l3 * cos_turn  # how far C hangs below A
    root = np.sqrt(k2 + level * level)
    # root + level as such where it is a sum; where it would cancel, k^2 = (root + level)(root - level) is divided
    both = root + np.abs(level)
    s = np.where(level >= 0, both, k2 / both)
    s_1 = -l3 * sin_turn * s / root
    down = l2 * (cos_turn * form.cos_gamma + sin_turn * form.sin_gamma)
    across = l2 * (sin_turn * form.cos_gamma - cos_turn * form.sin_gamma)
    x, y = across - design.b, s - down
    # x x' + y y', in which two products cancel each other
    half_square_1 = across * s - design.b * down + s_1 * y
    return Pose(design, form, sin_turn, cos_turn, root, s, s_1, across, down, x, y, np.hypot(x, y), half_square_1)


def joints(pose: Pose) -> dict[str, NDArray[np.complex128]]:
    """The joints A, B, C of poses and the pivots O, D, as x + i y."""
    design = pose.design
    turns = np.shape(pose.height)
    return {
        "O": np.zeros(turns, complex),
        "D": np.full(turns, -design.b, complex),
        "A": -design.b + 1j * np.asarray(pose.height),
        "B": np.asarray(pose.x) + 1j * np.asarray(pose.y),
        "C": design.l3 * np.asarray(pose.sin_turn) - design.b + 1j * np.asarray(pose.root),
    }


def top_length(design: Design, form: Shape) -> Any:
    """The cylinder's length at the top."""
    x, y = design.b + design.l2 * form.sin_gamma, design.l3 + design.l5 - design.l2 * form.cos_gamma
    return np.hypot(x, y)


def top_lever(design: Design, form: Shape | None = None) -> Any:
    """The lever b cos gamma + (l3 + l5) sin gamma; the cylinder lengthens towards the top where it is positive.

    At the top l1 dl1/dT = -l2 times this, so that it is the sign of the working branch. NaN without a triangle.
    """
    form = shape(design) if form is None else form
    return design.b * form.cos_gamma + (np.asarray(design.l3, dtype=float) + design.l5) * form.sin_gamma


def by_blocks(function: Callable[..., Any], size: int, *fields: Any) -> Any:
    """Values of a function of arrays, computed for at most `size` members at a time: bounds the memory.

    ``function``: ``function(*columns) -> values`` for columns of shape (n,), values of shape (..., n). ``size``:
    members at a time. ``*fields``: broadcast against each other; the values have their shape in place of the last axis.
    """
    arrays = np.broadcast_arrays(*(np.asarray(field, dtype=float) for field in fields))
    flat = [array.reshape(-1) for array in arrays]
    parts = [function(*(column[at : at + size] for column in flat)) for at in range(0, max(flat[0].size, 1), size)]
    values = np.concatenate(parts, axis=-1)
    return values.reshape((*values.shape[:-1], *arrays[0].shape))[()]


def _search_nodes(design: Design) -> Floats:
    """Turns from 0 to 2 pi, shape (..., nodes), dense where C passes the level of A or of D's opposite side.

    When l3 comes near l5 the height has a corner of width kappa = k / l3 at a quarter turn; the spacing follows it.
    """
    kappa = (np.sqrt(shape(design).k_squared) / design.l3)[..., None]
    even = np.linspace(-1.0, 1.0, 2 * SEARCH_NODES + 1)
    cluster = kappa * np.sinh(even * np.arcsinh(0.5 * np.pi / kappa))
    flat = np.broadcast_to(0.5 * np.pi * even, cluster.shape)
    half = np.clip(np.sort(np.concatenate([cluster, flat], axis=-1), axis=-1), -0.5 * np.pi, 0.5 * np.pi)
    return np.concatenate([0.5 * np.pi + half, 1.5 * np.pi + half], axis=-1)


def dead_point(design: Design) -> Any:
    """The turn of the dead point below the top: the first one from the top at which dl1/dT = 0, shape (...).

    From there to the top the cylinder lengthens steadily; that stretch is the working branch. NaN where the design
    cannot be assembled, and where the cylinder would have to shorten to come to the top (`top_lever` <= 0).

    Law: dl1/dT < 0 between 0 and the dead point, and 0 at it.
    """
    return by_blocks(_dead_points, SEARCH_BLOCK, *design.as_tuple())


def _dead_points(*lengths: Floats) -> Floats:
    design = Design(*lengths)
    nodes = _search_nodes(design)
    pose = pose_at_turn(Design(*(value[:, None] for value in lengths)), nodes)
    first, second = pose.half_square_1, pose.half_square_2
    works = first[:, 0] < 0
    rows = np.arange(works.size)
    end = np.argmax(first > 0, axis=1)  # the length is periodic, so a working branch has an end
    low, high = nodes[rows, end - 1], nodes[rows, end]
    # two dead points between neighbouring nodes show only as a peak of the rate: look at the top of each peak
    peaks = (first[:, :-1] < 0) & (first[:, 1:] < 0) & (second[:, :-1] > 0) & (second[:, 1:] < 0)
    peaks &= (np.arange(nodes.shape[1] - 1) < end[:, None]) & works[:, None]
    row, column = np.nonzero(peaks)
    some, left = Design(*(value[row] for value in lengths)), nodes[row, column]
    peak, _ = bisect(lambda turn: pose_at_turn(some, turn).half_square_2 > 0, left, nodes[row, column + 1])
    passes = np.nonzero(pose_at_turn(some, peak).half_square_1 >= 0)[0]
    for at in passes[::-1]:  # downwards: the first one of a design stays
        low[row[at]], high[row[at]] = left[at], peak[at]

    def rate(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(design, turn)
        return pose.half_square_1, pose.half_square_2

    low, high = np.where(works, low, np.nan), np.where(works, high, np.nan)
    return rising_root(rate, low, high, 0.5 * (low + high))


def turn_at_length(design: Design, length: Any, turn_dead: Any | None = None) -> Any:
    """The turn on the working branch at given cylinder lengths; NaN where that branch has no such length.

    A scalar Newton iteration in the turn, bracketed by the top and the dead point (`turn_dead`, found when not
    given). Near the dead point l1 is quadratic in the turn, hence the turn is smooth in w = sqrt(l1 - l1_dead): the
    first guess is the cubic in w with the right ends and end slopes.

    Laws: ``pose_at_turn(design, result).length`` is `length`; the result falls as `length` grows.
    """
    turn_dead = dead_point(design) if turn_dead is None else np.asarray(turn_dead, dtype=float)
    form = shape(design)
    bottom, top = pose_at_turn(design, turn_dead, form), pose_at_turn(design, 0.0, form)
    length, square = np.asarray(length, dtype=float), top.length - bottom.length
    # no branch where rounding leaves nothing between its ends
    inside = (length >= bottom.length) & (length <= top.length) & (square > 0)
    length, turn_dead = np.broadcast_arrays(np.where(inside, length, np.nan), turn_dead)
    square = np.where(square > 0, square, np.nan)
    w = np.sqrt(np.where(inside, length - bottom.length, np.nan) / square)
    slope_low = -np.sqrt(2 * square / np.where(bottom.length_2 > 0, bottom.length_2, np.inf))
    slope_top = 2 * square / top.length_1
    u = 1 - w
    guess = u * u * ((1 + 2 * w) * turn_dead + w * slope_low) - w * w * u * slope_top
    guess = np.where(np.isfinite(guess) | ~inside, guess, 0.5 * turn_dead)

    def shortage(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(design, turn, form)
        return length - pose.length, -pose.length_1

    noise = 2 * EPSILON * (length + design.b + design.l2)
    return rising_root(shortage, 0 * turn_dead, turn_dead, guess, noise)[()]


def turns_at_length(design: Design, length: float) -> Floats:
    """All turns in [0, 2 pi) of one design at one cylinder length, the highest platform first.

    The platform is above D in all of them; each has a mirror image below (height -s). The working branch is at most
    one of them: the only one with its turn below `dead_point`.
    """

    def sign_changes(rate: Callable[[Pose], Floats], nodes: Floats) -> Floats:
        negative = rate(pose_at_turn(design, nodes)) < 0
        at = np.nonzero(negative[:-1] != negative[1:])[0]

        def as_before(turn: Floats) -> Flags:
            return np.equal(rate(pose_at_turn(design, turn)) < 0, negative[at])

        return bisect(as_before, nodes[at], nodes[at + 1])[0]

    nodes = _search_nodes(Design(*(np.asarray(value, dtype=float) for value in design.as_tuple())))
    # the turns of extreme rate among the nodes leave no two dead points between neighbours
    nodes = np.union1d(nodes, sign_changes(lambda pose: pose.half_square_2, nodes))
    edges = np.concatenate([[0.0], sign_changes(lambda pose: pose.half_square_1, nodes), [2 * np.pi]])
    excess = pose_at_turn(design, edges).length - length
    holds = excess[:-1] * excess[1:] <= 0
    low, high, direction = edges[:-1][holds], edges[1:][holds], np.sign(np.diff(excess))[holds]

    def rising_excess(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(design, turn)
        return direction * (pose.length - length), direction * pose.length_1

    turns = np.unique(rising_root(rising_excess, low, high, 0.5 * (low + high)) % (2 * np.pi))
    turns = turns[np.diff(turns, prepend=-1.0) > 8 * EPSILON]
    return turns[np.argsort(-pose_at_turn(design, turns).height, kind="stable")]
