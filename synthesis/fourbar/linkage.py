"""A four-bar linkage in the plane: its dimensions, where it is mounted, the body point that it guides, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.fourbar.kinematics import (
    FULL_CRANK,
    Family,
    close_loop,
    family,
    principal,
    transmission_angle_over,
)
from synthesis.target import TURN, Interval


class Mass(NamedTuple):
    """A mass on a link: its centre in the link's frame, its inertia about that (mass times length squared)."""

    link: str
    mass: float
    at: complex = 0j
    inertia: float = 0.0


@dataclass(frozen=True)
class Joints:
    """Places and angles of a linkage at crank positions; every array has shape (n,).

    ``body_point`` is None where no body point is known (rotation only). Angles are those of the links against the x axis,
    in radians and continuous; ``rotation`` is the body's. NaN where the loop does not close.
    """

    pivot_a: complex
    pivot_b: complex
    crank_pin: Complexes
    coupler_pin: Complexes
    body_point: Complexes | None
    crank_angle: Floats
    coupler_angle: Floats
    rocker_angle: Floats
    rotation: Floats
    transmission_angle: Floats

    @property
    def closed(self) -> bool:
        """Whether the loop closes at every position."""
        return bool(np.all(np.isfinite(self.coupler_pin)))


@dataclass(frozen=True)
class Linkage:
    """A four-bar with actual lengths; angles in radians.

    Attributes
    ----------
    links : tuple of float
        Crank, coupler, rocker, ground; where nothing is mounted the ground is 1.
    branch : int
        +1 or -1, see `kinematics`.
    start : float
        theta1, the crank angle from the ground line, at the first sample of its motion.
    pivot_a : complex
        Fixed pivot of the crank.
    ground_angle : float
        theta4, the angle of the line from pivot A to pivot B.
    coupler_point : tuple of float or None
        Radius and angle of the body point in the coupler's frame, from the crank pin: P = D + radius e^{i (angle + theta2 +
        theta4)}. None where no position was asked for: then the linkage is not mounted.
    body_offset : float or None
        rotation = theta2 + theta4 + body_offset, theta2 in (-pi, pi] at the first sample; None where no rotation was asked for.
    """

    links: tuple[float, float, float, float]
    branch: int = 1
    start: float = 0.0
    pivot_a: complex = 0j
    ground_angle: float = 0.0
    coupler_point: tuple[float, float] | None = None
    body_offset: float | None = None

    @property
    def pivot_b(self) -> complex:
        """Fixed pivot of the rocker."""
        return complex(self.pivot_a + self.links[3] * np.exp(1j * self.ground_angle))

    @property
    def arm(self) -> complex:
        """The body point from the crank pin in the coupler's frame, L_P e^{i theta_P}; for one with a body point."""
        assert self.coupler_point is not None
        radius, angle = self.coupler_point
        return complex(radius * np.exp(1j * angle))

    @property
    def mounted(self) -> bool:
        """Whether it has a place in the user's plane."""
        return self.coupler_point is not None

    @property
    def link_ratio(self) -> float:
        """The longest link over the shortest."""
        return float(max(self.links) / min(self.links))

    @property
    def family(self) -> Family:
        """How it can turn."""
        return Family(family(np.array(self.links)).item())

    @property
    def turns_fully(self) -> bool:
        """Whether the crank can turn fully."""
        return self.family in FULL_CRANK

    def transmission_angle_min(self, interval: Interval) -> float:
        """The smallest transmission angle over crank angles from the first sample on; NaN where it does not close."""
        return float(transmission_angle_over(np.array(self.links), interval.after(self.start)))

    def body_point(self, crank: Floats, coupler: Floats) -> Complexes:
        """P at theta1 and theta2: A + L1 e^{i(theta1+theta4)} + L_P e^{i(theta_P+theta2+theta4)}; for one with a body point."""
        assert self.coupler_point is not None
        radius, angle = self.coupler_point
        pin = self.pivot_a + self.links[0] * np.exp(1j * (crank + self.ground_angle))
        return pin + radius * np.exp(1j * (angle + coupler + self.ground_angle))

    def joints(self, travel: Any) -> Joints:
        """Places and angles at crank angles (n,) measured from the first sample.

        Law: ``|D-A|, |C-D|, |C-B|`` are the links at every position, and C is the same from both sides of the loop to
        rounding.
        """
        travel = np.atleast_1d(np.asarray(travel, dtype=float))
        closure = close_loop(np.array(self.links), np.concatenate([[self.start], self.start + travel]))
        branch = np.array(self.branch)
        turn = self.ground_angle
        theta2 = principal(closure.coupler_angle(branch))[1:]
        coupler = theta2 + turn
        crank = self.start + travel + turn
        pin = self.pivot_a + self.links[0] * np.exp(1j * crank)
        return Joints(
            complex(self.pivot_a),
            self.pivot_b,
            np.where(closure.closed[1:], pin, complex(np.nan, np.nan)),
            pin + self.links[1] * np.exp(1j * coupler),
            self.body_point(self.start + travel, theta2) if self.mounted else None,
            crank,
            coupler,
            closure.rocker_angle(branch)[1:] + turn,
            coupler + (self.body_offset or 0.0),
            closure.transmission_angle[1:],
        )

    def over(self, interval: Interval, least: int = 181) -> Joints:
        """Joints at even steps of at most a degree between two crank angles from the first sample."""
        first, last = interval
        steps = max(least, int(np.ceil(np.rad2deg(abs(last - first)))) + 1)
        return self.joints(np.linspace(first, last, min(steps, 7201)))

    def turn(self) -> Joints | None:
        """Joints over a whole turn; None where the crank cannot turn fully."""
        return self.over(Interval(0.0, TURN)) if self.turns_fully else None

    def scaled(self, scale: float) -> Linkage:
        """The linkage with all lengths times a scale, where nothing is mounted."""
        crank, coupler, rocker, ground = self.links
        return replace(self, links=(crank * scale, coupler * scale, rocker * scale, ground * scale))

    def placed(self, pivot_a: complex, ground_angle: float, coupler_point: tuple[float, float]) -> Linkage:
        """The linkage at another place and with another body point."""
        return replace(self, pivot_a=pivot_a, ground_angle=ground_angle, coupler_point=coupler_point)

    def mirrored(self) -> Linkage:
        """The linkage in a mirror (the x axis)."""
        point = self.coupler_point
        return replace(
            self,
            branch=-self.branch,
            start=float(-self.start % TURN),
            pivot_a=self.pivot_a.conjugate(),
            ground_angle=-self.ground_angle,
            coupler_point=None if point is None else (point[0], -point[1]),
            body_offset=None if self.body_offset is None else -self.body_offset,
        )


Cognate = tuple[tuple[float, float, float, float], tuple[complex, complex]]
"""Lengths crank, coupler, rocker, ground, and the fixed pivots of crank and rocker."""

_NEAR = 1e-4


def cognates(linkage: Linkage) -> list[Cognate]:
    """The two others of a mounted linkage; each may be driven from either side.

    Law: the cognates of a cognate are the linkage itself and the other one.
    """
    l1, l2, l3, l4 = linkage.links
    part = linkage.arm / l2
    a, b = linkage.pivot_a, linkage.pivot_b
    third = complex(a + part * (b - a))
    first, second = abs(part), abs(1 - part)
    return [
        ((first * l2, first * l1, first * l3, first * l4), (a, third)),
        ((second * l1, second * l3, second * l2, second * l4), (third, b)),
    ]


def are_cognates(one: Linkage, other: Linkage) -> bool:
    """Whether two mounted linkages are cognates of each other, to 1e-4 of their size."""
    mine = (other.links, (other.pivot_a, other.pivot_b))
    return any(
        _alike(lengths, pivots, *mine) or _alike(lengths[2::-1] + lengths[3:], pivots[::-1], *mine)
        for lengths, pivots in cognates(one)
    )


def _alike(
    lengths: tuple[float, ...], pivots: tuple[complex, ...], other: tuple[float, ...], others: tuple[complex, ...]
) -> bool:
    size = max(other)
    gaps = [abs(a - b) for a, b in zip(lengths + pivots, other + others)]
    return max(gaps) < _NEAR * size
