"""Kinematics of the planar four-bar: closure, angles, transmission angle and their derivatives, batched.

The linkage lies in the ground frame: crank pivot A at the origin, rocker pivot B at ``L4`` on the real axis, crank pin D,
coupler pin C. Its four lengths are L1 = AD (crank), L2 = DC (coupler), L3 = BC (rocker), L4 = AB (ground). All angles are in
radians and counter-clockwise, measured from the ground line A->B. Branch +1 has C to the left of D->B, branch -1 to the right.

Everything here rests on two numbers of a position, both sums of non-negative terms wherever the crank turns fully, so that
nothing cancels up to the change point (r is the diagonal DB)::

    X = (L2 + L3)^2 - r^2 = X0 + 4 L1 L4 cos^2(theta1 / 2)
    Y = r^2 - (L3 - L2)^2 = Y0 + 4 L1 L4 sin^2(theta1 / 2)

The loop closes where X >= 0 and Y >= 0. The angle mu at D in the triangle D, B, C follows from
``tan^2(mu/2) = (L2 + L3 - r)(L3 - L2 + r) / ((L2 - L3 + r)(L2 + L3 + r))``, the transmission angle at C from
``tan^2(tau/2) = Y / X``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Floats
from synthesis.target import TURN, Interval


class Family(StrEnum):
    """Grashof family: how the links of a four-bar can turn; ``change_point`` if it can fold flat."""

    CRANK_ROCKER = "crank_rocker"
    DOUBLE_CRANK = "double_crank"
    ROCKER_CRANK = "rocker_crank"
    DOUBLE_ROCKER = "double_rocker"
    TRIPLE_ROCKER = "triple_rocker"
    CHANGE_POINT = "change_point"


FULL_CRANK = (Family.CRANK_ROCKER, Family.DOUBLE_CRANK)
"""The families whose crank turns fully."""


def _two_sum(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The sum of two floats and its rounding error, exactly (Knuth, TAOCP vol. 2, 4.2.2, theorem B)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _pair_difference(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """``(a + b) - (c + d)`` to nearly full relative accuracy, however close the two sums are."""
    left, left_error = _two_sum(a, b)
    right, right_error = _two_sum(c, d)
    return (left - right) + (left_error - right_error)


_PAIRINGS = np.array([(1, 2, 1), (3, 3, 2), (0, 0, 0), (2, 1, 3)])
"""Links that are added, and links that are subtracted, in each of the three excesses."""


def grashof_excesses(lengths: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Differences of the three pairings of the links, accurate up to the change point.

    ``lengths`` (..., 4): L1, L2, L3, L4 in any unit.

    Returns
    -------
    a, b, c : ndarray, shape (...)
        ``(L2+L4)-(L1+L3)``, ``(L3+L4)-(L1+L2)``, ``(L2+L3)-(L1+L4)`` in the same unit. Their signs name the `Family`: a product
        above zero is Grashof's condition. A zero is a change point.
    """
    pairs = np.asarray(lengths, dtype=float).take(_PAIRINGS, axis=-1)
    with np.errstate(over="ignore", invalid="ignore"):  # NaN for lengths that are not finite, or overflow when added
        found = _pair_difference(*(pairs[..., k, :] for k in range(4)))
    return found[..., 0], found[..., 1], found[..., 2]


_AT_CHANGE_POINT = 1e-12
"""Fraction of the longest link up to which a difference of two pairings counts as 0: the accuracy of given lengths."""
_CHANGE_POINT = 8
_BY_SIGNS = np.full(9, Family.TRIPLE_ROCKER, dtype=object)
"""The family by which of the three excesses are above zero, as bits."""
_BY_SIGNS[0b111], _BY_SIGNS[0b001] = Family.CRANK_ROCKER, Family.DOUBLE_CRANK
_BY_SIGNS[0b100], _BY_SIGNS[0b010] = Family.ROCKER_CRANK, Family.DOUBLE_ROCKER
_BY_SIGNS[_CHANGE_POINT] = Family.CHANGE_POINT


def family(lengths: ArrayLike) -> NDArray[np.object_]:
    """The `Family` of each linkage.

    ``lengths`` (..., 4).

    Shape (...). Law: the same for ``k * lengths`` with any power of two k, and for exchanged coupler and rocker except
    that double-rocker and rocker-crank change places.
    """
    lengths = np.asarray(lengths, dtype=float)
    a, b, c = grashof_excesses(lengths)
    smallest = np.min(np.abs([a, b, c]), axis=0)
    signs = 4 * (a > 0) + 2 * (b > 0) + (c > 0)
    names = np.empty(np.shape(a), dtype=object)
    names[...] = _BY_SIGNS[np.where(smallest <= _AT_CHANGE_POINT * lengths.max(axis=-1), _CHANGE_POINT, signs)]
    return names


def _scaled(lengths: ArrayLike) -> tuple[Floats, NDArray[Any]]:
    """Return lengths over a power of two near the longest length, so that squares neither overflow nor vanish; exact."""
    lengths = np.asarray(lengths, dtype=float)
    if lengths.shape[-1:] != (4,):
        raise ValueError(f"lengths must have the shape (..., 4); it is {lengths.shape}")
    with np.errstate(invalid="ignore"):
        _, exponent = np.frexp(np.max(np.abs(lengths), axis=-1, keepdims=True))
    good = np.all(np.isfinite(lengths) & (lengths > 0), axis=-1)
    scaled = np.where(good[..., None], np.ldexp(lengths, -exponent), np.nan)
    return scaled, exponent[..., 0]


@dataclass(frozen=True)
class Closure:
    """Closed loop at given crank angles; further angles are computed on access.

    Attributes
    ----------
    lengths : ndarray, shape (..., 1, 4)
        Lengths over ``2**exponent``.
    crank_angle : ndarray, shape (..., N)
        theta1 in radians.
    excess_x, excess_y : ndarray, shape (..., N)
        X and Y of the module's head, in scaled units; NaN if the loop does not close.
    diagonal : ndarray, shape (..., N)
        r = DB in scaled units.
    closed : ndarray of bool, shape (..., N)
    exponent : ndarray of int, shape (...)
    """

    lengths: Floats
    crank_angle: Floats
    excess_x: Floats
    excess_y: Floats
    diagonal: Floats
    closed: NDArray[np.bool_]
    exponent: NDArray[Any]

    @cached_property
    def diagonal_angle(self) -> Floats:
        """arg(B - D), continuous in the crank angle; it follows the crank once a turn where L1 > L4."""
        l1, l4 = self.lengths[..., 0], self.lengths[..., 3]
        half_sine = np.sin(self.crank_angle / 2)
        sine = np.sin(self.crank_angle)
        longer = l1 > l4
        # B - D = L4 - L1 e^{i theta1} = -e^{i theta1} (L1 - L4 e^{-i theta1}): the bracket of the longer of the two
        # has a positive real part, so its argument needs no unwrapping.
        big, small = np.where(longer, l1, l4), np.where(longer, l4, l1)
        angle = np.arctan2(-small * sine * np.where(longer, -1.0, 1.0), (big - small) + 2 * small * half_sine**2)
        return np.where(longer, self.crank_angle - np.pi + angle, angle)

    def _half_angle(self, shorter: Floats, longer: Floats) -> tuple[Floats, Floats]:
        """Square roots of numerator and denominator of tan^2 of half the triangle's angle beside ``shorter``."""
        r = self.diagonal
        difference = longer - shorter
        larger = r + np.abs(difference)
        safe = np.where(larger > 0, larger, 1.0)
        smaller = np.where(larger > 0, self.excess_y / safe, np.nan)
        ahead = np.where(difference >= 0, larger, smaller)
        behind = np.where(difference >= 0, smaller, larger)
        total = r + shorter + longer
        return np.sqrt(ahead * self.excess_x / total), np.sqrt(behind * total)

    @cached_property
    def coupler_half_angle(self) -> tuple[Floats, Floats]:
        """Sine and cosine of half the angle at D between D->B and D->C, times a common positive factor."""
        return self._half_angle(self.lengths[..., 1], self.lengths[..., 2])

    def coupler_angle(self, branch: ArrayLike) -> Floats:
        """theta2, the angle of D->C, continuous in the crank angle; NaN where the loop does not close.

        ``branch`` (...).

        Shape (..., N). Law: ``theta2(theta1, -1) = -theta2(-theta1, +1)``, up to whole turns where L1 > L4.
        """
        sine, cosine = self.coupler_half_angle
        return self.diagonal_angle + np.asarray(branch)[..., None] * (2 * np.arctan2(sine, cosine))

    def rocker_angle(self, branch: ArrayLike) -> Floats:
        """theta3, the angle of B->C, shape (..., N). Law: ``L1 e^{i t1} + L2 e^{i t2} = L4 + L3 e^{i t3}``."""
        sine, cosine = self._half_angle(self.lengths[..., 2], self.lengths[..., 1])
        return self.diagonal_angle + np.pi - np.asarray(branch)[..., None] * (2 * np.arctan2(sine, cosine))

    @property
    def transmission_angle(self) -> Floats:
        """Acute angle between coupler and rocker, 0 (dead) to pi/2 (best), shape (..., N)."""
        x, y = self.excess_x, self.excess_y
        return 2 * np.arctan2(np.sqrt(np.minimum(x, y)), np.sqrt(np.maximum(x, y)))

    def coupler_angle_gradient(self, branch: ArrayLike) -> Floats:
        """Derivatives of theta2 by L1, L2, L3, L4 (per unit of length) and theta1, shape (..., N, 5).

        They are the real part of the differential of the loop, multiplied by e^{-i theta3}. They grow like 1 /
        sin(transmission angle), and are NaN at a dead position.
        """
        sign = np.asarray(branch, dtype=float)[..., None]
        l1, l3 = self.lengths[..., 0], self.lengths[..., 2]
        t1, t2, t3 = self.crank_angle, self.coupler_angle(branch), self.rocker_angle(branch)
        # L2 sin(t2 - t3), by sin(tau) = sqrt(X Y) / (2 L2 L3) without the loss of a difference of angles.
        lever = -sign * np.sqrt(self.excess_x * self.excess_y) / (2 * l3)
        lever = np.where(lever != 0, lever, np.nan)
        numerators = np.stack(
            [np.cos(t1 - t3), np.cos(t2 - t3), -np.ones_like(t3), -np.cos(t3), -l1 * np.sin(t1 - t3)], axis=-1
        )
        gradient = numerators / lever[..., None]
        with np.errstate(over="ignore"):  # infinite per unit of length if the lengths are nearly zero
            gradient[..., :4] = np.ldexp(gradient[..., :4], -self.exponent[..., None, None])
        return gradient


def close_loop(lengths: ArrayLike, crank_angle: ArrayLike) -> Closure:
    """Close the loop of linkages at crank angles.

    ``lengths`` (..., 4): L1, L2, L3, L4 in any unit; a linkage with a length that is not positive and finite never
    closes. ``crank_angle`` (..., N): theta1 in radians; leading axes are broadcast against the leading axes of
    ``lengths``.

    If the loop does not close, the result is NaN and ``closed == False``, never a wrong number. Law: angles are
    the same for ``k * lengths``, bit for bit if k is a power of two.
    """
    scaled, exponent = _scaled(lengths)
    a, b, c = grashof_excesses(scaled)
    angle = np.asarray(crank_angle, dtype=float)
    if not (finite := np.isfinite(angle)).all():
        angle = np.where(finite, angle, np.nan)
    scaled = scaled[..., None, :]
    l1, l4 = scaled[..., 0], scaled[..., 3]
    product = 4 * l1 * l4
    half = angle / 2
    sine2, cosine2 = product * np.sin(half) ** 2, product * np.cos(half) ** 2
    x = (c * scaled[..., 0, :].sum(-1))[..., None] + cosine2
    y = (a * b)[..., None] + sine2
    r = np.sqrt((l4 - l1) ** 2 + sine2)
    if np.any(negative := c[..., None] < 0):
        # X0 < 0: both terms of X may dwarf it; then its own factors lose less.
        longest = scaled[..., 1] + scaled[..., 2]
        x = np.where(negative & (cosine2 > longest**2), (longest - r) * (longest + r), x)
    closed = (x >= 0) & (y >= 0) & (r > 0)
    if not closed.all():
        x, y = np.where(closed, x, np.nan), np.where(closed, y, np.nan)
    shape = closed.shape
    return Closure(
        np.broadcast_to(scaled, (*shape[:-1], 1, 4)), np.broadcast_to(angle, shape), x, y, r, closed, exponent
    )


def coupler_angle(lengths: ArrayLike, branch: ArrayLike, crank_angle: ArrayLike) -> Floats:
    """Return theta2 of linkages at crank angles, shape (..., N): `close_loop` and `Closure.coupler_angle` combined."""
    return close_loop(lengths, crank_angle).coupler_angle(branch)


def transmission_angle_over(lengths: ArrayLike, interval: Interval) -> Floats:
    """The smallest transmission angle while the crank moves between two angles, exactly and not by samples.

    The diagonal r grows with sin^2(theta1/2), and the transmission angle is smallest where r is smallest or largest: at an
    end of the interval, or at theta1 = 0 or pi (modulo a turn) inside it.

    ``lengths`` (..., 4). ``interval``: of theta1, its ends of shape (...).

    Shape (...). Radians, 0 to pi/2; NaN where the linkage does not close over the whole interval. Law: never above the
    transmission angle at any crank angle of the interval.
    """
    first, last = (np.asarray(end, dtype=float) for end in interval)
    low, high = np.minimum(first, last), np.maximum(first, last)
    inner = TURN * np.ceil(low / TURN)
    outer = TURN * np.ceil((low - np.pi) / TURN) + np.pi
    candidates = np.stack(
        np.broadcast_arrays(low, high, np.where(inner <= high, inner, low), np.where(outer <= high, outer, low)),
        axis=-1,
    )
    closure = close_loop(lengths, candidates)
    angles = np.where(closure.closed, closure.transmission_angle, np.nan)
    return np.min(angles, axis=-1)


def principal(angle: Floats) -> Floats:
    """Continuous curves of angles (..., N), moved by whole turns so that the first sample lies in (-pi, pi]."""
    first = angle[..., :1]
    wrapped = np.arctan2(np.sin(first), np.cos(first))
    return angle - TURN * np.round((first - wrapped) / TURN)


def wrap(angle: float) -> float:
    """An angle in (-pi, pi]."""
    wrapped = float(np.arctan2(np.sin(angle), np.cos(angle)))
    return np.pi if wrapped <= -np.pi else wrapped
