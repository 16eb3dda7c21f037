"""Curves over short intervals of the crank as Legendre series: their coefficients, and a bound of what a few of them leave out.

With p(x) = Re sum_h c_h e^{ihx} and x = c + w v, -1 <= v <= 1, the plane wave's expansion (DLMF 10.60.7)

    e^{ihwv} = sum_k (2k + 1) i^k j_k(hw) P_k(v)        (j_k: spherical Bessel functions)

gives the coefficients a_k = Re sum_h c_h e^{ihc} (2k + 1) i^k j_k(hw). As |P_k| <= 1, what the terms above K leave of the
curve is nowhere more than

    sum_{K < k <= M} |a_k|  +  sum_h |c_h| sum_{k > M} (2k + 1) |j_k(hw)|

for any M. j_k(z) falls faster than any power once k is beyond z, so an M a little above the largest hw suffices.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_BEYOND = 24
"""Terms behind M that are added up; the next would be below the rounding of a double."""


def polynomials(v: Floats, terms: int) -> Floats:
    """P_1 .. P_terms at points in [-1, 1]; shape (..., terms). Law: P_k(1) = 1, and |P_k| <= 1 (DLMF 18.9.1)."""
    result = np.empty((*v.shape, terms))
    before, now = np.ones_like(v), v
    for k in range(1, terms + 1):
        result[..., k - 1] = now
        before, now = now, ((2 * k + 1) * v * now - k * before) / (k + 1)
    return result


@lru_cache(maxsize=512)
def _waves(harmonics: int, half_width: float, terms: int) -> tuple[NDArray[np.complex128], Floats]:
    """(2k + 1) i^k j_k(hw) for k = 1 .. M (M, H), and the sum of their sizes above M (H,)."""
    from scipy.special import spherical_jn

    reach = harmonics * half_width
    most = max(2 * terms, terms + 6, int(np.ceil(12 + 1.15 * reach)))
    order = np.arange(1, most + _BEYOND + int(reach / 4) + 1)
    argument = np.arange(1, harmonics + 1) * half_width
    size = (2 * order[:, None] + 1) * spherical_jn(order[:, None], argument)
    return size[:most] * (1j ** order[:most])[:, None], np.abs(size[most:]).sum(axis=0)


class Expansion:
    """What series of some length are multiplied with to give their Legendre coefficients over intervals.

    Parameters
    ----------
    harmonics : int
        Of the series: cosine and sine of each side by side.
    centres : ndarray, shape (P,)
        Middles of the intervals, radians.
    half_width : float
        Of each interval.
    terms : int
        Coefficients that are kept.
    """

    def __init__(self, harmonics: int, centres: Floats, half_width: float, terms: int) -> None:
        waves, self._beyond = _waves(harmonics, half_width, terms)
        turned = np.exp(1j * np.outer(centres, np.arange(1, harmonics + 1)))
        matrix = np.ascontiguousarray(turned[:, None, :] * waves).view(float)  # Re (C - iS)(x + iy) = Cx + Sy
        self._matrix = matrix.reshape(-1, 2 * harmonics).T
        self._shape = (len(centres), len(waves))
        self.terms = terms
        self.half_width = half_width

    @property
    def width(self) -> int:
        """Numbers that are computed for each curve."""
        return self._shape[0] * self._shape[1]

    def coefficients(self, periodic: Floats, winding: int, error: Floats) -> tuple[Floats, Floats]:
        """a_1 .. a_K of curves with their winding, and the rest: no value of a curve is further from its a_1 .. a_K.

        Parameters
        ----------
        periodic : ndarray, shape (n, 2H)
        winding : int
            Turns of the body in one of the crank: a straight line more.
        error : ndarray, shape (n,)
            By how much a series may be off its curve.

        Returns
        -------
        coefficients : ndarray, shape (n, P, K)
        rest : ndarray, shape (n, P)
            Law: at least |curve - constant - sum a_k P_k| anywhere on the interval, for some constant.
        """
        every = (periodic @ self._matrix).reshape(len(periodic), *self._shape)
        every[..., 0] += winding * self.half_width
        tail = np.hypot(periodic[:, ::2], periodic[:, 1::2]) @ self._beyond
        rest = np.abs(every[..., self.terms :]).sum(axis=-1) + (tail + error)[:, None] + 1e-12
        return every[..., : self.terms], rest
