"""Curves over short intervals of the crank as Legendre series: their coefficients, and a bound of what a few of them leave out.

With p(x) = Re sum_h c_h e^{ihx} and x = c + w v, -1 <= v <= 1, the plane wave's expansion (DLMF 10.60.7)

    e^{ihwv} = sum_k (2k + 1) i^k j_k(hw) P_k(v)        (j_k: spherical Bessel functions)

gives the coefficients a_k = Re sum_h c_h e^{ihc} (2k + 1) i^k j_k(hw). As |P_k| <= 1, what the terms above K leave of the
curve is nowhere more than

    sum_{K < k <= M} |a_k|  +  sum_h |c_h| sum_{k > M} (2k + 1) |j_k(hw)|

for any M. j_k(z) falls faster than any power once k is beyond z, so an M a little above the largest hw suffices.

The same holds for e^{i theta2} = sum_h f_h e^{ihx}. A path is fitted by {1, e^{ix}} too, whatever it is (`pose`), so
as much of e^{ix} is taken off as leaves no a_1. Of the harmonic h that leaves

    (2k + 1) i^k (j_k(hw) - j_k(w) j_1(hw) / j_1(w)) e^{ihc},   nothing for h = 0 and h = 1.
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


def _order(terms: int, reach: float) -> int:
    """M for waves of so large an argument hw."""
    return max(2 * terms, terms + 6, int(np.ceil(12 + 1.15 * reach)))


@lru_cache(maxsize=512)
def _waves(harmonics: int, half_width: float, terms: int) -> tuple[NDArray[np.complex128], Floats]:
    """(2k + 1) i^k j_k(hw) for k = 1 .. M (M, H), and the sum of their sizes above M (H,)."""
    from scipy.special import spherical_jn

    reach = harmonics * half_width
    most = _order(terms, reach)
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


TAIL = 20
"""Terms above K of which a request knows how much of them its samples see, see `PhasorExpansion.shapes`."""
LEAST_SEEN = 1 / 8
"""Part of the terms up to `TAIL` above K that is counted at least."""


class PhasorExpansion:
    """What series of e^{i theta2} are multiplied with to give their *shapes* over intervals, see `shapes`.

    Parameters
    ----------
    reach : int
        Of the series: coefficients -reach .. reach.
    centres : ndarray, shape (P,)
        Middles of the intervals, radians.
    half_width : float
        Of each interval.
    terms : int
        K.
    """

    def __init__(self, reach: int, centres: Floats, half_width: float, terms: int) -> None:
        from scipy.special import spherical_jn

        highest = reach * half_width
        most = _order(terms, highest)
        harmonic = np.arange(-reach, reach + 1)
        order = np.arange(most + _BEYOND + int(highest / 4) + 1)
        waves = spherical_jn(order[:, None], np.abs(harmonic) * half_width)
        waves[1::2, :reach] *= -1
        crank = spherical_jn(order, half_width)[:, None] * (waves[1] / waves[1, reach + 1])
        size = 2 * order[:, None] + 1
        self._beyond = (size * (np.abs(waves) + np.abs(crank)))[most + 1 :].sum(axis=0)
        own = (size * (1j ** order[:, None]) * (waves - crank))[2 : most + 1]
        turned = np.exp(1j * np.outer(harmonic, centres))
        self._matrix = (turned[:, :, None] * own.T[:, None, :]).reshape(len(harmonic), -1)
        self._shape = (len(centres), most - 1)
        self.terms = terms

    @property
    def width(self) -> int:
        """Real numbers that are computed for each series."""
        return 2 * self._shape[0] * self._shape[1]

    def shapes(self, series: NDArray[np.complex128], error: Floats) -> tuple[NDArray[np.complex128], Floats]:
        """a_3 .. a_K over a_2, and the rest over |a_2|.

        Parameters
        ----------
        series : ndarray, shape (n, 2 reach + 1)
        error : ndarray, shape (n,)
            By how much a series may be off e^{i theta2}.

        Returns
        -------
        shapes : ndarray of complex, shape (n, P, K - 2)
        rest : ndarray, shape (n, P)
            Infinite where a_2 is 0. Law: for some alpha, beta and any s from `LEAST_SEEN` to 1 that the rms of no P_k over the
            samples exceeds, K < k <= K + TAIL, the rms of e^{i theta2} - alpha - beta e^{ix} - a_2 (P_2 + sum shapes_k P_k) over
            the samples is at most s |a_2| times this.
        """
        every = (series @ self._matrix).reshape(len(series), *self._shape)
        size, own = np.abs(every), self.terms - 1
        lost = np.abs(series) @ self._beyond + error + 1e-12
        lost = lost[:, None] + size[..., own + TAIL :].sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            rest = (size[..., own : own + TAIL].sum(axis=-1) + lost / LEAST_SEEN) / size[..., 0]
            shapes = every[..., 1:own] / every[..., :1]
        return shapes, rest
