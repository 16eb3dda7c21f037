"""A fitted slot as polynomials in powers of a parameter from 0 to 1, piece by piece, as controls of machine tools take them."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly
from numpy.polynomial.polynomial import polyval

from synthesis.chain.fit import Exact, Fit
from synthesis.chain.slot import Slot
from synthesis.one_variable import Floats


@dataclass(frozen=True)
class PowerPiece:
    """x and y of a piece of the track are ``sum c_k t^k`` with t from 0 to 1.

    Attributes
    ----------
    phase : (float, float) or None
        Phases at t = 0 and 1, in proportion between them; None where t counts x and not the phase.
    x, y : ndarray, shape (degree + 1,)
        Coefficients in the drawing's coordinates, lowest power first.
    """

    phase: tuple[float, float] | None
    x: Floats
    y: Floats


def power_basis(slot: Slot, fit: Fit, decimals: int | None = None) -> list[PowerPiece]:
    """A Chebyshev or polynomial fit by powers; none for other kinds, which are no polynomials in x and y.

    Coefficients are rounded to ``decimals`` if that is given: each moves the track by half a unit of the last place at most.
    """
    pieces: list[PowerPiece] = []
    if fit.kind == "chebyshev":
        origin = fit.data["origin"]
        for piece in fit.data["pieces"]:
            x, y = (_powers(np.array(piece[name])) for name in "xy")
            x[0], y[0] = x[0] + origin[0], y[0] + origin[1]
            pieces.append(PowerPiece(tuple(piece["phase"]), x, y))
    elif fit.kind == "polynomial":
        low, high = fit.data["x"]
        across = _powers(np.array(fit.data["coefficients"]))
        along = np.zeros_like(across)
        along[:2] = (low, high - low)[: len(along)]
        points = complex(*fit.data["origin"]) * (np.arange(len(along)) == 0) + slot.frame[1] * (along + 1j * across)
        pieces.append(PowerPiece(None, points.real, points.imag))
    if decimals is None:
        return pieces
    return [PowerPiece(p.phase, np.round(p.x, decimals), np.round(p.y, decimals)) for p in pieces]


def power_error(slot: Slot, pieces: list[PowerPiece], exact: Exact) -> float:
    """Largest distance, square to the slot, of the pieces from the slot itself."""
    phases = exact.phases
    if pieces[0].phase is None:
        x = slot.in_frame(exact.points).real
        first, last = (complex(polyval(t, pieces[0].x), polyval(t, pieces[0].y)) for t in (0.0, 1.0))
        low, high = (slot.in_frame(np.array([at]))[0].real for at in (first, last))
        which, t = np.zeros(len(phases), dtype=int), (x - low) / (high - low)
    else:
        bounds = np.array([piece.phase for piece in pieces])
        which = np.clip(np.searchsorted(bounds[:, 0], phases, side="right") - 1, 0, len(pieces) - 1)
        t = (phases - bounds[which, 0]) / (bounds[which, 1] - bounds[which, 0])
    found = np.empty(len(phases), dtype=complex)
    for index, piece in enumerate(pieces):
        on = which == index
        found[on] = polyval(t[on], piece.x) + 1j * polyval(t[on], piece.y)
    return float(np.abs(((found - exact.points) * np.conj(exact.normals)).real).max())


def _powers(series: Floats) -> Floats:
    """Coefficients over t in 0 .. 1 of a Chebyshev series over u = 2 t - 1 in -1 .. 1."""
    powers = cheb2poly(series)
    shifted = np.zeros(len(series))
    for k, coefficient in enumerate(powers):
        for j in range(k + 1):
            shifted[j] += coefficient * comb(k, j) * 2.0**j * (-1.0) ** (k - j)
    return shifted
