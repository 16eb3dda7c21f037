"""Length and moment arm of a straight element between two links, for many placements, with derivatives.

The element joins a point G of an observer to a point q of a link that moves relative to the observer. Its moment arm is the
derivative dL/dphi of its length L by the drive's parameter phi.
"""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.link_motion import LinkMotion


def lengths_and_arms(link: LinkMotion, middle: complex, grounds: Complexes, pins: Complexes) -> tuple[Floats, Floats]:
    """Return the lengths and moment arms of m placements at n positions by products of matrices.

    L^2 and L dL/dphi, which is the real part of ``conj(v) Q'`` with v = X + R q - G and Q' = X' + i w R q, are expanded to
    coefficients (8, n) of 1, G, q, conj(G) q and |G|^2 + |q|^2, with G measured from ``middle``.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link relative to the observer, at n positions.
    middle : complex
        Origin of the expansion; a point near the link loses the fewest digits.
    grounds, pins : ndarray of complex, shape (m,)
        Ends in the observer's frame and in the link's frame.

    Returns
    -------
    lengths, arms : ndarray, shape (m, n)
    """
    x, r, speed, rate = link.origin - middle, link.direction, link.velocity, link.rate
    zero = np.zeros(x.size)

    def coefficients(unit: Floats, ground: Complexes, pin: Complexes, product: Complexes, squares: Floats) -> Floats:
        return np.array([unit, ground.real, ground.imag, pin.real, -pin.imag, product.real, -product.imag, squares])

    pin_slope = np.conj(speed) * r + 1j * rate * np.conj(x) * r
    slope = coefficients(dot(x, speed), -speed, pin_slope, -1j * rate * r, zero)
    square = coefficients(np.abs(x) ** 2, -2 * x, 2 * np.conj(x) * r, -2 * r, zero + 1)
    g = grounds - middle
    product, squares = np.conj(g) * pins, np.abs(g) ** 2 + np.abs(pins) ** 2
    basis = np.stack(
        [np.ones(g.size), g.real, g.imag, pins.real, pins.imag, product.real, product.imag, squares], axis=1
    )
    # the expanded square rounds below 0 only if the length vanishes
    length = np.sqrt(np.maximum(basis @ square, 1e-300))
    return length, (basis @ slope) / length


def leverage_derivatives(
    link: LinkMotion, along: Complexes, length: Floats, speed: Complexes, size: float
) -> tuple[Floats, Floats]:
    """Return the derivatives of length and moment arm by the coordinates of both ends.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link relative to the observer, at n positions.
    along : ndarray of complex, shape (n,)
        Unit vector from G to the pin.
    length : ndarray, shape (n,)
    speed : ndarray of complex, shape (n,)
        Derivative of the pin's position by the drive's parameter.
    size : float
        Length of one unit of the coordinates.

    Returns
    -------
    lengths, arms : ndarray, shape (n, 4)
        Derivatives by the coordinates of G and of the pin.
    """
    turned = link.direction[:, None] * np.array([0, 0, 1, 1j]) * size
    dv = turned - np.array([1, 1j, 0, 0]) * size
    back = np.conj(along)[:, None]
    lengths = np.real(back * dv)
    dn = (dv - along[:, None] * lengths) / length[:, None]
    return lengths, np.real(np.conj(dn) * speed[:, None]) + np.real(back * 1j * link.rate[:, None] * turned)
