"""Closed-form poses of the pneumatic lift, its dead points, and the turn for a cylinder length.

A rigid triangle ABC is guided at A by the vertical slide x = -b.
A cylinder OB of length l1(t) pushes corner B, and a link DC guides corner C.
O = (0, 0) is the pivot of the cylinder, D = (-b, 0) is the pivot of the link, and A = (-b, s) carries the platform.
The lengths are AB = l2, AC = l3, BC = l4 and DC = l5.

One angle, the *turn* T = angle DAC, determines the whole pose in closed form. T = 0 is the top position, with C
straight below A and s = l3 + l5; T increases as the platform goes down. In the symbols of the source, T = mu + pi/2
where mu is the direction of AC, and theta3 = mu + pi. The *working branch* is the range of T from the top to the
first dead point, in which the cylinder length is monotonic.

Source: Gan, Meng, Li, Zhou, "Kinematic simulation and optimization of a pneumatic linkage lifting mechanism",
Machinery Design & Manufacture 2020-3. Numbers in parentheses are its equations.

Lengths are in the user's unit and angles in radians. Array arguments broadcast against each other.
The fields of a design or a cylinder may be arrays; batch axes come first. Poses that cannot be assembled are NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from synthesis.one_variable import EPSILON, Floats, bisect, rising_root

DEAD_POINT_NODES = 128
"""Number of nodes in a quarter turn of each of the two grids on which dead points are isolated."""
NODES_PER_BLOCK = 1 << 15
"""Number of designs times nodes in a quarter turn whose dead points are searched at a time."""


Length = Annotated[Any, float]
"""A float or an array; a single number in a reply."""
LENGTHS = ("l2", "l3", "l4", "l5", "b")
"""Names of the lengths of a design."""


@dataclass(frozen=True)
class Design:
    """The five fixed lengths of one lift, or arrays that broadcast for many lifts."""

    l2: Length
    """AB, from the platform joint to the cylinder joint; a side of the triangle."""
    l3: Length
    """AC, from the platform joint to the link joint; a side of the triangle."""
    l4: Length
    """BC, the third side of the triangle."""
    l5: Length
    """DC, the link between the fixed pivot D and the triangle."""
    b: Length
    """Horizontal distance from the slide to the cylinder pivot O."""

    def as_tuple(self) -> tuple[Any, Any, Any, Any, Any]:
        """Return the lengths in the order (l2, l3, l4, l5, b)."""
        return self.l2, self.l3, self.l4, self.l5, self.b

    def as_dict(self) -> dict[str, float]:
        """Return the lengths of a single design as plain numbers."""
        return dict(zip(LENGTHS, (float(value) for value in self.as_tuple())))


@dataclass(frozen=True)
class Cylinder:
    """The cylinder as a drive with constant acceleration; lengthening counts as positive."""

    length: Any
    """Length l1' in the lowest position of the platform."""
    speed: Any = 1.0
    """Rate of change of the length at the start. If it is negative, the cylinder retracts and the motion starts at
    the top."""
    acceleration: Any = 0.0
    """Constant second derivative of the length."""


def half_angle_squares(side_1: Any, side_2: Any, opposite: Any) -> tuple[Any, Any]:
    """Return the squared sine and cosine of half an angle of a triangle, times 4 side_1 side_2.

    The angle lies between ``side_1`` and ``side_2``, and ``opposite`` is the third side. Both results are products of
    sums and differences, so flat triangles keep their digits, unlike with an inverse cosine. The first result is
    negative if the third side is too short for a triangle, the second if it is too long.
    """
    sine_term = (opposite - (side_1 - side_2)) * (opposite + (side_1 - side_2))
    return sine_term, (side_1 + side_2 + opposite) * ((side_1 - opposite) + side_2)


def triangle_angle(side_1: Any, side_2: Any, opposite: Any, may_be_flat: bool = False) -> Any:
    """Return the angle between two sides of a triangle, given the third side.

    It is NaN if the strict triangle inequality (34) is violated; if the triangle may be flat, a rounding error past flat
    counts as flat.
    """
    sine_term, cosine_term = (
        np.where((term > 0) | may_be_flat, np.maximum(term, 0.0), np.nan)
        for term in half_angle_squares(side_1, side_2, opposite)
    )
    return 2 * np.arctan2(np.sqrt(sine_term), np.sqrt(cosine_term))


def third_side(side_1: Any, side_2: Any, angle: Any) -> Any:
    """Return the side of a triangle opposite a given angle, as the square root of a sum of positive terms."""
    return np.sqrt((side_1 - side_2) ** 2 + 4 * side_1 * side_2 * np.sin(0.5 * angle) ** 2)


@dataclass(frozen=True)
class DesignConstants:
    """Quantities shared by all poses of a design."""

    cos_gamma: Any
    """Cosine of the triangle's angle at A."""
    sin_gamma: Any
    """Sine of the triangle's angle at A."""
    gamma: Any
    """The triangle's angle at A, between AB and AC."""
    k_squared: Any
    """k^2 = l5^2 - l3^2."""


def design_constants(design: Design, gamma: Any | None = None) -> DesignConstants:
    """Return the constants of a design; NaN unless the triangle is proper (34) and l3 < l5 (36).

    ``gamma`` is the triangle's angle at A, if it is known more accurately than it follows from the three sides.
    """
    gamma = triangle_angle(design.l2, design.l3, design.l4) if gamma is None else gamma
    k_squared = (np.asarray(design.l5, dtype=float) - design.l3) * (np.asarray(design.l5, dtype=float) + design.l3)
    return DesignConstants(np.cos(gamma), np.sin(gamma), gamma, np.where(k_squared > 0, k_squared, np.nan))


@dataclass(frozen=True)
class Pose:
    """Poses of a design and their derivatives with respect to the turn T, all of the same shape.

    The suffixes ``_1`` and ``_2`` denote the first and second derivative.
    Second derivatives are computed when they are first used.
    """

    design: Design
    """The design, with fields that broadcast against the pose."""
    constants: DesignConstants
    """Constants of the design."""
    sin_turn: Any
    """Sine of the turn."""
    cos_turn: Any
    """Cosine of the turn."""
    c_height: Any
    """Height of C above D."""
    height: Any
    """Height s of the platform A above D."""
    height_1: Any
    """First derivative of the height."""
    across: Any
    """Horizontal distance of B from A, positive to the right."""
    down: Any
    """Vertical distance of B below A."""
    x: Any
    """Horizontal coordinate of B."""
    y: Any
    """Vertical coordinate of B."""
    length: Any
    """Length l1 of the cylinder."""
    half_square_1: Any
    """First derivative of l1^2 / 2, which is finite even if l1 is 0."""

    @cached_property
    def turn(self) -> Any:
        """Return the turn, from 0 to 2 pi."""
        return np.arctan2(self.sin_turn, self.cos_turn) % (2 * np.pi)

    @cached_property
    def length_1(self) -> Any:
        """Return the first derivative of the cylinder length, which is negative on the working branch."""
        return self.half_square_1 / self.length

    @cached_property
    def gain(self) -> Any:
        """Return ds/dl1, the ratio of platform speed to cylinder speed.

        The ratio is infinite at a dead point and negative past it.
        """
        rate = self.half_square_1
        return np.divide(self.length * self.height_1, rate, out=np.full(np.shape(rate), np.inf), where=rate != 0)

    @cached_property
    def height_2(self) -> Any:
        """Return the second derivative of the height."""
        l3, c_height = self.design.l3, self.c_height
        curvature_term = l3 * self.cos_turn * (self.constants.k_squared + l3 * l3) / (c_height * c_height * c_height)
        return self.height_1 * (self.height_1 / self.height) - self.height * curvature_term

    @cached_property
    def half_square_2(self) -> Any:
        """Return the second derivative of l1^2 / 2."""
        rotation_term = self.down * self.height + self.across * (self.design.b + self.height_1)
        return rotation_term + self.height_2 * self.y + self.height_1 * (self.height_1 + self.across)

    @cached_property
    def length_2(self) -> Any:
        """Return the second derivative of the cylinder length."""
        return (self.half_square_2 - self.length_1 * self.length_1) / self.length


def pose_at_turn(design: Design, turn: Any, constants: DesignConstants | None = None) -> Pose:
    """Compute poses at turns (rad) in closed form; ``constants`` are the `design_constants`, if they are already known.

    The formulas avoid cancellation. With k^2 = l5^2 - l3^2, the height of C is the root of a sum of squares and s' is
    a product. If C lies above A, the height of A is k^2 / (c_height + l3 |cos T|) instead of a difference. The
    derivative s' is exactly 0 at turn 0.
    """
    turn = np.asarray(turn, dtype=float)
    return _pose(design, design_constants(design) if constants is None else constants, np.sin(turn), np.cos(turn))


def pose_at_height(design: Design, height: Any, constants: DesignConstants | None = None) -> Pose:
    """Compute poses at heights of the platform above D in closed form, with C on the side of the cylinder (0 <= turn <= pi).

    The turn is not computed by an inverse cosine, which would lose half of the digits near the top. A height outside
    l5 - l3 <= s <= l5 + l3 is replaced by the nearer end.
    """
    height = np.asarray(height, dtype=float)
    # the triangle ADC: sides s and l3 at A, opposite l5
    sine_term, cosine_term = (np.maximum(term, 0.0) for term in half_angle_squares(height, design.l3, design.l5))
    product = 4 * design.l3 * np.where(height > 0, height, np.nan)
    constants = design_constants(design) if constants is None else constants
    return _pose(
        design, constants, 2 * np.sqrt(sine_term * cosine_term) / product, (cosine_term - sine_term) / product
    )


def _pose(design: Design, constants: DesignConstants, sin_turn: Any, cos_turn: Any) -> Pose:
    l2, l3, k2 = design.l2, design.l3, constants.k_squared
    level = l3 * cos_turn  # height of A above C
    c_height = np.sqrt(k2 + level * level)
    # add c_height and level if both are positive; otherwise divide k^2 = (c_height + level)(c_height - level)
    height_sum = c_height + np.abs(level)
    s = np.where(level >= 0, height_sum, k2 / height_sum)
    s_1 = -l3 * sin_turn * s / c_height
    down = l2 * (cos_turn * constants.cos_gamma + sin_turn * constants.sin_gamma)
    across = l2 * (sin_turn * constants.cos_gamma - cos_turn * constants.sin_gamma)
    x, y = across - design.b, s - down
    # x x' + y y', after two products have cancelled
    half_square_1 = across * s - design.b * down + s_1 * y
    return Pose(
        design, constants, sin_turn, cos_turn, c_height, s, s_1, across, down, x, y, np.hypot(x, y), half_square_1
    )


def joints(pose: Pose) -> dict[str, NDArray[np.complex128]]:
    """Return the moving joints A, B, C and the fixed pivots O, D of poses as x + i y, of the shape of the poses."""
    design = pose.design
    dimensions = np.shape(pose.height)
    return {
        "O": np.zeros(dimensions, complex),
        "D": np.full(dimensions, -design.b, complex),
        "A": -design.b + 1j * np.asarray(pose.height),
        "B": np.asarray(pose.x) + 1j * np.asarray(pose.y),
        "C": design.l3 * np.asarray(pose.sin_turn) - design.b + 1j * np.asarray(pose.c_height),
    }


def top_length(design: Design, constants: DesignConstants) -> Any:
    """Return the cylinder length at the top."""
    x, y = design.b + design.l2 * constants.sin_gamma, design.l3 + design.l5 - design.l2 * constants.cos_gamma
    return np.hypot(x, y)


def top_lever(design: Design, constants: DesignConstants | None = None) -> Any:
    """Return the lever b cos gamma + (l3 + l5) sin gamma.

    The cylinder lengthens towards the top if the lever is positive, because l1 dl1/dT = -l2 times the lever at the
    top. The result is NaN if the sides do not form a triangle.
    """
    constants = design_constants(design) if constants is None else constants
    return design.b * constants.cos_gamma + (np.asarray(design.l3, dtype=float) + design.l5) * constants.sin_gamma


def evaluate_in_blocks(function: Callable[..., Any], size: int, *fields: Any) -> Any:
    """Evaluate a function of arrays for at most `size` members at a time, to bound the memory.

    Parameters
    ----------
    function : callable
        ``function(*columns) -> values`` for columns of shape (n,) and values of shape (..., n).
    size : int
        Number of members evaluated at a time.
    *fields : float or ndarray
        Arguments that broadcast against each other. Their common shape replaces the last axis of the values.
    """
    arrays = np.broadcast_arrays(*(np.asarray(field, dtype=float) for field in fields))
    flat = [array.reshape(-1) for array in arrays]
    parts = [
        function(*(column[first : first + size] for column in flat)) for first in range(0, max(flat[0].size, 1), size)
    ]
    values = np.concatenate(parts, axis=-1)
    return values.reshape((*values.shape[:-1], *arrays[0].shape))[()]


def _dead_point_nodes(design: Design, count: int) -> Floats:
    """Return turns from 0 to 2 pi, shape (..., nodes), clustered at a quarter and three quarters of a turn.

    If l3 is close to l5, the height has a corner of width kappa = k / l3 there, and the spacing follows it.
    """
    kappa = (np.sqrt(design_constants(design).k_squared) / design.l3)[..., None]
    even = np.linspace(-1.0, 1.0, 2 * count + 1)
    cluster = kappa * np.sinh(even * np.arcsinh(0.5 * np.pi / kappa))
    flat = np.broadcast_to(0.5 * np.pi * even, cluster.shape)
    half = np.clip(np.sort(np.concatenate([cluster, flat], axis=-1), axis=-1), -0.5 * np.pi, 0.5 * np.pi)
    return np.concatenate([0.5 * np.pi + half, 1.5 * np.pi + half], axis=-1)


def dead_point(design: Design, nodes: int = DEAD_POINT_NODES) -> Any:
    """Return the dead point below the top of each design, which is the end of the working branch.

    It is the first turn from the top at which dl1/dT = 0; the derivative is negative between the top and this turn. NaN
    if the design cannot be assembled, or if the cylinder would have to shorten to reach the top (`top_lever` <= 0).
    ``nodes``: nodes in a quarter turn of each of the two grids on which dead points are isolated.
    """
    return evaluate_in_blocks(partial(_dead_points, nodes), NODES_PER_BLOCK // nodes, *design.as_tuple())


def _dead_points(count: int, *lengths: Floats) -> Floats:
    design = Design(*lengths)
    nodes = _dead_point_nodes(design, count)
    pose = pose_at_turn(Design(*(value[:, None] for value in lengths)), nodes)
    first, second = pose.half_square_1, pose.half_square_2
    lifts = first[:, 0] < 0
    rows = np.arange(lifts.size)
    end_index = np.argmax(first > 0, axis=1)  # the length is periodic, so each working branch ends
    low, high = nodes[rows, end_index - 1], nodes[rows, end_index]
    # two dead points between neighbouring nodes appear only as a peak of the rate: evaluate the top of each peak
    peaks = (first[:, :-1] < 0) & (first[:, 1:] < 0) & (second[:, :-1] > 0) & (second[:, 1:] < 0)
    peaks &= (np.arange(nodes.shape[1] - 1) < end_index[:, None]) & lifts[:, None]
    row, column = np.nonzero(peaks)
    peak_designs, left = Design(*(value[row] for value in lengths)), nodes[row, column]
    peak, _ = bisect(lambda turn: pose_at_turn(peak_designs, turn).half_square_2 > 0, left, nodes[row, column + 1])
    crossing_peaks = np.nonzero(pose_at_turn(peak_designs, peak).half_square_1 >= 0)[0]
    for peak_index in crossing_peaks[::-1]:  # in reverse order, so that the first peak of a design is assigned last
        low[row[peak_index]], high[row[peak_index]] = left[peak_index], peak[peak_index]

    def rate(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(design, turn)
        return pose.half_square_1, pose.half_square_2

    low, high = np.where(lifts, low, np.nan), np.where(lifts, high, np.nan)
    return rising_root(rate, low, high, 0.5 * (low + high))


def turn_at_length(design: Design, length: Any, turn_dead: Any | None = None) -> Any:
    """Find the turn on the working branch at given cylinder lengths; NaN if the branch does not reach a length.

    The method is a scalar Newton iteration for the turn, bracketed by the top and the dead point.
    Near the dead point l1 is quadratic in the turn, so the turn is smooth in w = sqrt(l1 - l1_dead).
    The initial guess is the cubic in w with the correct values and slopes at both ends.

    Parameters
    ----------
    design : Design
    length : float or ndarray
        Cylinder lengths.
    turn_dead : float or ndarray, optional
        The `dead_point` of the design, if it is already known.
    """
    turn_dead = dead_point(design) if turn_dead is None else np.asarray(turn_dead, dtype=float)
    constants = design_constants(design)
    bottom, top = pose_at_turn(design, turn_dead, constants), pose_at_turn(design, 0.0, constants)
    length, length_span = np.asarray(length, dtype=float), top.length - bottom.length
    # there is no branch if its two ends coincide up to rounding
    reachable = (length >= bottom.length) & (length <= top.length) & (length_span > 0)
    length, turn_dead = np.broadcast_arrays(np.where(reachable, length, np.nan), turn_dead)
    length_span = np.where(length_span > 0, length_span, np.nan)
    w = np.sqrt(np.where(reachable, length - bottom.length, np.nan) / length_span)
    slope_low = -np.sqrt(2 * length_span / np.where(bottom.length_2 > 0, bottom.length_2, np.inf))
    slope_top = 2 * length_span / top.length_1
    v = 1 - w
    guess = v * v * ((1 + 2 * w) * turn_dead + w * slope_low) - w * w * v * slope_top
    guess = np.where(np.isfinite(guess) | ~reachable, guess, 0.5 * turn_dead)

    def shortage(turn: Floats) -> tuple[Floats, Floats]:
        pose = pose_at_turn(design, turn, constants)
        return length - pose.length, -pose.length_1

    noise = 2 * EPSILON * (length + design.b + design.l2)
    return rising_root(shortage, 0 * turn_dead, turn_dead, guess, noise)[()]
