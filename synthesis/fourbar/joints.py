"""The joints of a four-bar at crank angles, and its cognates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Floats
from synthesis.four_bar import close_loop, principal
from synthesis.linkage import Lengths, Linkage


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


def body_point(linkage: Linkage, crank: Floats, coupler: Floats) -> Complexes:
    """Return P at theta1 and theta2, A + L1 e^{i(theta1+theta4)} + L_P e^{i(theta_P+theta2+theta4)}, if there is a body point."""
    assert linkage.coupler_point is not None
    radius, angle = linkage.coupler_point
    pin = linkage.pivot_a + linkage.links[0] * np.exp(1j * (crank + linkage.ground_angle))
    return pin + radius * np.exp(1j * (angle + coupler + linkage.ground_angle))


def joints_at(linkage: Linkage, travel: ArrayLike) -> Joints:
    """Return places and angles at crank angles (n,) measured from the first sample.

    Law: ``|D-A|, |C-D|, |C-B|`` are the links at every position, and C is the same from both sides of the loop to rounding.
    """
    travel = np.atleast_1d(np.asarray(travel, dtype=float))
    closure = close_loop(np.array(linkage.links), np.concatenate([[linkage.start], linkage.start + travel]))
    branch = np.array(linkage.branch)
    turn = linkage.ground_angle
    theta2 = principal(closure.coupler_angle(branch))[1:]
    coupler = theta2 + turn
    crank = linkage.start + travel + turn
    pin = linkage.pivot_a + linkage.links[0] * np.exp(1j * crank)
    return Joints(
        complex(linkage.pivot_a),
        linkage.pivot_b,
        np.where(closure.closed[1:], pin, complex(np.nan, np.nan)),
        pin + linkage.links[1] * np.exp(1j * coupler),
        body_point(linkage, linkage.start + travel, theta2) if linkage.mounted else None,
        crank,
        coupler,
        closure.rocker_angle(branch)[1:] + turn,
        coupler + (linkage.body_offset or 0.0),
        closure.transmission_angle[1:],
    )


Cognate = tuple[Lengths, tuple[complex, complex]]
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
