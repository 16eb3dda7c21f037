"""Joints of a four-bar by its closed form: an oracle for the motions of `synthesis.linkage.Linkage`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Floats
from synthesis.four_bar import close_loop, principal
from synthesis.linkage import Linkage


@dataclass(frozen=True)
class Joints:
    """Positions and angles of a linkage at crank angles; every array has shape (n,).

    ``body_point`` is None without a body point. Angles are those of the links against the x axis, in radians and continuous;
    ``rotation`` is the rotation of the body. NaN if the loop does not close.
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
        """True if the loop closes at every position."""
        return bool(np.all(np.isfinite(self.coupler_pin)))


def body_point(linkage: Linkage, crank: Floats, coupler: Floats) -> Complexes:
    """Return P at theta1 and theta2, A + L1 e^{i(theta1+theta4)} + L_P e^{i(theta_P+theta2+theta4)}, if there is a body point."""
    assert linkage.coupler_point_polar is not None
    radius, angle = linkage.coupler_point_polar
    pin = linkage.pivot_a + linkage.links[0] * np.exp(1j * (crank + linkage.ground_angle))
    return pin + radius * np.exp(1j * (angle + coupler + linkage.ground_angle))


def joints_at(linkage: Linkage, travel: ArrayLike) -> Joints:
    """Return positions and angles at crank angles (n,) measured from the first sample.

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
