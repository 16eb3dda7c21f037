"""Placements of an actuator on a link that turns about a fixed pivot, in closed form up to a single unknown.

With alpha the angle at the pivot between the ground point G and the pin, ``L^2 = S - T cos alpha``. Retracted length and stroke
determine S and T from alpha at the retracted end; S and T determine the distances of G and the pin from the pivot. So a
single unknown is left. The direction of G is free: it is chosen so that G lies in its box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats
from synthesis.drives.placements import TOLERANCE, Actuator, Placement, PlacementTask, Refusal
from synthesis.mechanism import Box, outside
from synthesis.one_variable import closer_looks


@dataclass(frozen=True)
class PivotOptions:
    """Resolution of the search over the angle at the pivot."""

    angles: int = 2001
    """Number of angles at which the force is evaluated first."""
    dead_angle: float = 1e-3
    """Smallest distance of an angle from 0 and pi, where too many digits are lost, in radians."""
    refinements: tuple[int, ...] = (33,) * 8
    """Number of nodes of each refinement between two neighbours."""
    directions: int = 720
    """Number of directions in which a circle about the pivot is intersected with the box."""


OPTIONS = PivotOptions()


def place_about_pivot(
    task: PlacementTask, actuator: Actuator, options: PivotOptions = OPTIONS
) -> Placement | Refusal:
    """Return the placement with the smallest peak force on a link that turns about a pivot, or why there is none."""
    link, limits = task.link, task.limits
    assert link.pivot is not None
    turned = np.unwrap(np.angle(link.direction))
    swing = float(np.ptp(turned))
    needed = actuator.stroke / (2 * np.sin(min(swing, np.pi) / 2))
    if needed > limits.reach + TOLERANCE * task.size or swing >= np.pi - 2 * options.dead_angle:
        return Refusal("reach", float(needed))
    steps = np.diff(turned) * np.sign(turned[-1] - turned[0])
    if steps.min() <= 0:
        k = int(np.argmin(steps))
        return Refusal("dead", float(task.at[k]), (k, k + 1))
    families = [
        _PivotedPlacements(task, actuator, np.abs(turned - turned[0 if extends else -1]), extends, options)
        for extends in task.directions
    ]
    minima = [family.best() for family in families]
    found = [(worst, family, alpha) for family, (worst, alpha) in zip(families, minima) if np.isfinite(worst)]
    if not found:
        return min((family.refusal() for family in families), key=lambda refusal: refusal.reason)
    _, family, alpha = min(found, key=lambda row: row[0])
    ground, pin = family.ends(alpha)
    return task.evaluate(ground, pin)


class _PivotedPlacements:
    """All placements for one direction: a curve in alpha, the angle at the pivot at the retracted end."""

    def __init__(
        self, task: PlacementTask, actuator: Actuator, turned: Floats, extends: bool, options: PivotOptions
    ) -> None:
        self.task, self.extends, self.turned, self.options = task, extends, turned, options
        self.room = 0.0  # allowed violation of the reach, used if no placement satisfies it exactly
        self.low, self.high = actuator.retracted, actuator.retracted + actuator.stroke
        self.swing = float(turned.max())
        self.rate = np.abs(task.link.rate)
        dead_angle = options.dead_angle
        self.alphas = np.linspace(dead_angle, np.pi - self.swing - dead_angle, options.angles)
        left, bottom, right, top = task.limits.box
        pivot = task.link.pivot
        assert pivot is not None
        across = max(left - pivot.real, 0.0, pivot.real - right), max(bottom - pivot.imag, 0.0, pivot.imag - top)
        self.nearest = float(np.hypot(*across))
        corners = np.array([complex(x, y) for x in (left, right) for y in (bottom, top)])
        self.farthest = float(np.abs(corners - pivot).max())

    def sizes(self, alpha: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return S, T, and the longer and the shorter distance from the pivot; NaN if there are none."""
        half = self.swing / 2
        # cos(a) - cos(a + swing) as a product
        fall = 2 * np.sin(alpha + half) * np.sin(half)
        t = (self.high - self.low) * (self.high + self.low) / fall
        # S - T = L0^2 - T (1 - cos alpha), and similarly S + T, without the difference of S and T
        less = self.low**2 - 2 * t * np.sin(alpha / 2) ** 2
        more = self.low**2 + 2 * t * np.cos(alpha / 2) ** 2
        with np.errstate(invalid="ignore"):
            sum_, difference = np.sqrt(more), np.sqrt(less)
        return self.low**2 + t * np.cos(alpha), t, (sum_ + difference) / 2, (sum_ - difference) / 2

    def arms(self, alpha: Floats) -> Floats:
        """Return the absolute moment arms, (alphas, n)."""
        s, t, _, _ = self.sizes(alpha)
        # sine and cosine of the sums from the sines and cosines of the terms
        start, turned = np.exp(1j * alpha), np.exp(1j * self.turned)
        sine = np.outer(start.imag, turned.real) + np.outer(start.real, turned.imag)
        cosine = np.outer(start.real, turned.real) - np.outer(start.imag, turned.imag)
        with np.errstate(invalid="ignore"):
            length = np.sqrt(s[:, None] - t[:, None] * cosine)
            return np.asarray(t[:, None] / 2 * sine / length * self.rate)

    def evaluate(self, alpha: Floats) -> tuple[Floats, Flags, Flags, Floats]:
        """Return the largest burden over arm, if reach and box are satisfied, if the arm is, and the smallest arm."""
        arm = self.arms(alpha)
        _, _, longer, shorter = self.sizes(alpha)
        inside = self._inside(longer, shorter) | self._inside(shorter, longer)
        arm_min = arm.min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.max(self.task.burden / arm, axis=1)
        return value, inside & np.isfinite(value), arm_min >= self.task.limits.arm, arm_min

    def _inside(self, ground: Floats, pin: Floats) -> Flags:
        with np.errstate(invalid="ignore"):
            flags: Flags = (
                (pin <= self.task.limits.reach + self.room) & (ground >= self.nearest) & (ground <= self.farthest)
            )
        return flags

    def best(self) -> tuple[float, float]:
        """Return the smallest objective and its alpha; infinity if no placement satisfies the limits."""
        alphas = self.alphas
        value, inside, strong, _ = self.evaluate(alphas)
        good = inside & strong
        if not good.any():
            self.room = TOLERANCE * self.task.size
            alphas = self._between()
            value, inside, strong, _ = self.evaluate(alphas)
            good = inside & strong
        if not good.any():
            return np.inf, 0.0

        def cost(alpha: NDArray[np.floating]) -> Floats:
            value, inside, strong, _ = self.evaluate(np.asarray(alpha.ravel(), dtype=float))
            return np.where(inside & strong, value, np.inf).reshape(alpha.shape)

        # each refinement contains the best node before it, so that it never gets worse, not even at the end of the limits
        k = int(np.argmin(np.where(good, value, np.inf)))
        low, high = alphas[[max(k - 1, 0)]], alphas[[min(k + 1, alphas.size - 1)]]
        minimum, alpha = closer_looks(cost, low, high, self.options.refinements)
        return float(minimum[0]), float(alpha[0])

    def _between(self) -> Floats:
        """Return the angles with the smallest violation of reach, box and arm, each between two neighbours."""

        def violation(alpha: NDArray[np.floating]) -> Floats:
            flat, limits = np.asarray(alpha.ravel(), dtype=float), self.task.limits
            _, _, longer, shorter = self.sizes(flat)
            arm_min = self.arms(flat).min(axis=1)
            alternatives = [
                np.maximum.reduce([pin - limits.reach, self.nearest - ground, ground - self.farthest])
                for ground, pin in ((longer, shorter), (shorter, longer))
            ]
            found = np.maximum(np.minimum(*alternatives), limits.arm - arm_min)
            return np.where(np.isfinite(found), found, np.inf).reshape(alpha.shape)

        values = np.concatenate([[np.inf], violation(self.alphas), [np.inf]])
        k = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]) & np.isfinite(values[1:-1]))
        step = self.alphas[1] - self.alphas[0]
        middle = closer_looks(violation, self.alphas[k] - step, self.alphas[k] + step, self.options.refinements)[1]
        return np.column_stack([middle - step, middle, middle + step]).ravel()

    def ends(self, alpha: float) -> tuple[complex, complex]:
        """Return the ground point and the pin, turned about the pivot so that the ground point lies in its box."""
        task, link = self.task, self.task.link
        assert link.pivot is not None
        _, _, longer, shorter = (float(value[0]) for value in self.sizes(np.array([alpha])))
        ground, pin = (longer, shorter) if self._inside(np.array(longer), np.array(shorter)) else (shorter, longer)
        rising = np.sign(link.swing())
        angles = np.linspace(0.0, 2 * np.pi, self.options.directions, endpoint=False)
        direction = direction_into_box(link.pivot, ground, task.limits.box, angles)
        # from the ground point's direction to the pin's: alpha at the retracted end, growing while the actuator extends
        turn = rising * (alpha if self.extends else -(alpha + self.swing))
        at_first = link.pivot + pin * np.exp(1j * (direction + turn))
        return complex(link.pivot + ground * np.exp(1j * direction)), link.point_at(complex(at_first))

    def refusal(self) -> Refusal:
        """Return the limit that no placement satisfies."""
        value, inside, _, arm_min = self.evaluate(self.alphas)
        if not np.isfinite(value).any():
            return Refusal("stroke", float(self.high - self.low))
        if not inside.any():
            _, _, longer, shorter = self.sizes(self.alphas)
            if np.nanmin(shorter) > self.task.limits.reach:
                return Refusal("reach", float(np.nanmin(shorter)))
            return Refusal("box", float(self.nearest if np.nanmax(longer) < self.nearest else np.nanmin(longer)))
        return Refusal("arm", float(np.max(np.where(inside, arm_min, -np.inf))))


def direction_into_box(pivot: complex, radius: float, box: Box, angles: Floats) -> float:
    """Return a direction in which a circle about a pivot lies in a box: the middle of its longest arc in the box.

    Parameters
    ----------
    pivot : complex
    radius : float
    box : Box
    angles : ndarray, shape (n,)
        Even angles over a turn at which the circle is compared with the box first, in radians.
    """
    inside = outside(pivot + radius * np.exp(1j * angles), box) <= 0
    if inside.all():
        return 0.0
    if not inside.any():  # the arc lies between two of the angles, or the circle only touches the box
        return _direction_of_short_arc(pivot, radius, box)
    first_outside = int(np.argmin(inside))
    ends = np.flatnonzero(np.diff(np.roll(inside, -first_outside), append=False))
    first, last = ends[::2] + 1, ends[1::2]
    k = int(np.argmax(last - first))
    return float((angles[1] - angles[0]) * (first_outside + (first[k] + last[k]) / 2))


def _direction_of_short_arc(pivot: complex, radius: float, box: Box) -> float:
    """Return the direction into a box from the circle's intersections with the box's lines and its extreme points."""
    left, bottom, right, top = box
    nearest = complex(min(max(pivot.real, left), right), min(max(pivot.imag, bottom), top))
    corners = [complex(x, y) for x in (left, right) for y in (bottom, top)]
    lines = [(0.0, left - pivot.real), (0.0, right - pivot.real)]
    lines += [(np.pi / 2, bottom - pivot.imag), (np.pi / 2, top - pivot.imag)]
    crossings = [np.angle(point - pivot) for point in (nearest, *corners)]
    crossings += [
        normal + sign * np.arccos(distance / radius)
        for normal, distance in lines
        if abs(distance) <= radius
        for sign in (1, -1)
    ]
    ends = np.sort(np.mod(crossings, 2 * np.pi))
    ends = np.append(ends, ends[0] + 2 * np.pi)
    candidates = np.concatenate([(ends[1:] + ends[:-1]) / 2, ends])
    violations = np.maximum(outside(pivot + radius * np.exp(1j * candidates), box), 0.0)
    return float(candidates[np.argmin(violations)])
