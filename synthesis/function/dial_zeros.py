"""Zeros of the dials for which a single four-bar meets four or five pairs of a function.

Freudenstein's equations of four pairs are dependent only for zeros for which the determinant of the rows (cos psi, cos
phi, 1, cos(phi - psi)) vanishes. If a zero is prescribed, it is a quadratic form in the cosine and the sine of the
other zero, which has two roots in each half turn. Two such forms, of the first four pairs and of the first three with
the fifth, have a common root if their resultant vanishes. The resultant is a polynomial of degree eight in the tangent
of the first zero, so that at most eight four-bars meet five pairs (Bottema and Roth, Theoretical Kinematics, 1979,
chapter VIII, for the equal number of pivots through five poses).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Floats


@dataclass(frozen=True)
class ZeroOptions:
    """Options of the zeros of the dials for five pairs."""

    samples: int = 32
    """Number of given zeros at which the resultant, of order four in twice the angle, is sampled."""
    near_circle: float = 0.05
    """Distance from the unit circle up to which a root of the resultant may be real except for rounding."""
    newton_steps: int = 12
    """Number of Newton steps on all five equations."""
    solved: float = 1e-9
    """Residual of the equations above which a root is discarded."""


OPTIONS = ZeroOptions()


def quadratic_forms(fixed: Floats, turning: Floats) -> Floats:
    """Return the determinants of four pairs as quadratic forms.

    Parameters
    ----------
    fixed : ndarray, shape (n, 4)
        Angles of a dial from the ground line.
    turning : ndarray, shape (4,)
        Angles of the other dial; an angle x is subtracted from all of them.

    Returns
    -------
    ndarray, shape (n, 3)
        Coefficients of cos(x)^2, cos(x) sin(x) and sin(x)^2.
    """
    difference = fixed - turning
    cosine, ones = np.cos(fixed), np.ones_like(fixed)
    first = np.cos(turning) * ones, np.sin(turning) * ones
    last = np.cos(difference), -np.sin(difference)

    def determinant(i: int, j: int) -> Floats:
        return np.linalg.det(np.stack([first[i], cosine, ones, last[j]], axis=2))

    return np.stack([determinant(0, 0), determinant(0, 1) + determinant(1, 0), determinant(1, 1)], axis=1)


def zeros_of_four_pairs(fixed: Floats, turning: Floats) -> Floats:
    """Return the two angles x (n, 2), up to half turns, of `quadratic_forms`; NaN if there are none."""
    a, b, c = quadratic_forms(fixed, turning).T
    with np.errstate(invalid="ignore"):
        half = np.arctan2(np.sqrt(b * b - 4 * a * c), -(a + c))
    middle = np.arctan2(b, a - c)
    return np.stack([middle - half, middle + half], axis=1) / 2


def zeros_of_five_pairs(crank: Floats, output: Floats) -> tuple[Floats, Floats]:
    """Return the starts and offsets (n,), up to half turns, of the four-bars that meet five pairs (5,) in radians."""
    first, second = [0, 1, 2, 3], [0, 1, 2, 4]
    start: Floats = np.linspace(0.0, np.pi, OPTIONS.samples, endpoint=False)

    def forms(at: Floats) -> tuple[Floats, Floats]:
        phi = at[:, None] + crank
        return quadratic_forms(phi[:, first], output[first]).T, quadratic_forms(phi[:, second], output[second]).T

    (a, b, c), (d, e, f) = forms(start)
    resultant = (a * f - c * d) ** 2 - (a * e - b * d) * (b * f - c * e)
    waves = np.fft.fft(resultant)
    roots = np.roots(waves[np.arange(4, -5, -1)])
    start = np.asarray(np.angle(roots[np.abs(np.abs(roots) - 1) < OPTIONS.near_circle]) / 2, dtype=float)
    offset = zeros_of_four_pairs((start[:, None] + crank)[:, first], output[first])
    start, offset = np.repeat(start, 2), offset.ravel()
    known = np.isfinite(offset)
    return _refined(crank, output, start[known], offset[known])


def _refined(crank: Floats, output: Floats, start: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """Return the zeros after Newton steps on all five equations, without those that do not converge."""
    phi, psi = start[:, None] + crank, output - offset[:, None]
    matrix = np.stack([np.cos(psi), -np.cos(phi), np.ones_like(phi)], axis=2)
    ratios = (np.linalg.pinv(matrix) @ np.cos(phi - psi)[:, :, None])[:, :, 0]
    unknowns = np.column_stack([ratios, start, offset])
    residual = np.full(phi.shape, np.inf)
    for _ in range(OPTIONS.newton_steps):
        first, second, third, at, shift = unknowns.T[:, :, None]
        phi, psi = at + crank, output - shift
        turned = np.sin(phi - psi)
        residual = first * np.cos(psi) - second * np.cos(phi) + third - np.cos(phi - psi)
        columns = [
            np.cos(psi),
            -np.cos(phi),
            np.ones_like(phi),
            second * np.sin(phi) + turned,
            first * np.sin(psi) + turned,
        ]
        jacobian = np.stack(columns, axis=2)
        finite = np.isfinite(jacobian).all(axis=(1, 2))
        unknowns[finite] -= (np.linalg.pinv(jacobian[finite]) @ residual[finite, :, None])[:, :, 0]
    solved = np.abs(residual).max(axis=1, initial=0.0) < OPTIONS.solved
    return unknowns[solved, 3], unknowns[solved, 4]
