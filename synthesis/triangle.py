"""Angles of triangles from their sides, free of cancellation near a dead centre."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats


def angle_at(adjacent: Floats | float, opposite: Floats | float, r: Floats) -> Floats:
    """Return the angle between two sides of a triangle, from its three sides.

    Half of the angle is computed from its sine and cosine, in which differences are taken before sums.
    Neither loses digits near a dead-centre position.

    Parameters
    ----------
    adjacent, r : ndarray or float
        Sides that enclose the angle.
    opposite : ndarray or float
        Side opposite the angle.

    Returns
    -------
    ndarray
        The angle, 0 to pi.
    """
    sine_square = np.maximum((opposite - (adjacent - r)) * (opposite + (adjacent - r)), 0.0)
    cosine_square = np.maximum((adjacent + r - opposite) * (adjacent + r + opposite), 0.0)
    return np.asarray(2 * np.arctan2(np.sqrt(sine_square), np.sqrt(cosine_square)))


class Triangle(NamedTuple):
    """Triangles Z, C, X by four factors of 16 times its squared area, each free of cancellation, (n,).

    Sides: distance D = |ZC|, arm L = |ZX|, radius r = |CX|.
    """

    total: Floats
    """L + r + D"""
    beyond: Floats
    """L + r - D"""
    less_arm: Floats
    """D + r - L"""
    less_radius: Floats
    """D + L - r"""

    @classmethod
    def of(cls, varying: Floats, still: Floats, radius: float, shorter: Floats, longer: Floats) -> Triangle:
        """Build the triangle from its constant and its varying side.

        If the arm varies instead of the distance, exchange ``beyond`` and ``less_arm``.

        Parameters
        ----------
        varying, still : ndarray
            The side that varies, and the constant side.
        radius : float
            The third side.
        shorter : ndarray
            Square of (still + radius) less the square of the varying side.
        longer : ndarray
            Square of the varying side less the square of (still - radius).
        """
        total = varying + still + radius
        outer, inner = varying + radius - still, varying + still - radius
        larger = np.maximum(outer, inner)
        smaller = longer / np.where(larger > 0, larger, 1.0)
        first = outer > inner
        return cls(total, shorter / total, np.where(first, larger, smaller), np.where(first, smaller, larger))

    @property
    def root(self) -> Floats:
        """L r sin mu."""
        return np.sqrt(self.total * self.beyond) * np.sqrt(self.less_arm * self.less_radius) / 2

    @property
    def at_z(self) -> Floats:
        """Angle between ZC and ZX."""
        return 2 * np.arctan2(np.sqrt(self.beyond * self.less_arm), np.sqrt(self.total * self.less_radius))

    @property
    def at_c(self) -> Floats:
        """Angle between CZ and CX."""
        return 2 * np.arctan2(np.sqrt(self.beyond * self.less_radius), np.sqrt(self.total * self.less_arm))

    @property
    def at_x(self) -> Floats:
        """Acute angle between the lines XZ and XC."""
        sine_squared, cosine_squared = self.total * self.beyond, self.less_arm * self.less_radius
        return 2 * np.arctan2(
            np.sqrt(np.minimum(sine_squared, cosine_squared)), np.sqrt(np.maximum(sine_squared, cosine_squared))
        )
