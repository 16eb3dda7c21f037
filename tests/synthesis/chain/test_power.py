"""Fits by powers of a parameter from 0 to 1: the same curve as the fit, its rounding, and what is lost at high degrees."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from synthesis.chain import crescent as chain
from synthesis.chain.fit import exact_slot, fit_error, fit_slot, power_basis, power_error


@pytest.fixture(scope="module")
def slot():
    return chain.crescent_slot(131.0, 16, 181.78)[1]


@pytest.fixture(scope="module")
def exact(slot):
    return exact_slot(slot, np.linspace(slot.start, slot.end, 3001))


def horner(coefficients, t: Fraction) -> Fraction:
    total = Fraction(0)
    for coefficient in reversed(coefficients):
        total = total * t + Fraction(float(coefficient))
    return total


@pytest.mark.parametrize(
    ("kind", "order"), [("chebyshev", 1), ("chebyshev", 8), ("chebyshev", 12), ("polynomial", 12)]
)
def test_powers_are_the_same_curve(kind, order, slot, exact) -> None:
    fit = fit_slot(slot, kind, order)
    pieces = power_basis(slot, fit)
    assert power_error(slot, pieces, exact) == pytest.approx(fit_error(slot, fit, exact).normal, abs=1e-9)
    if kind == "chebyshev":
        for piece in pieces:
            for share in (0, 1, 3, 8):
                phase = piece.phase[0] + share / 8 * (piece.phase[1] - piece.phase[0])
                found = [float(horner(row, Fraction(share, 8))) for row in (piece.x, piece.y)]
                # just inside: at a break two pieces meet
                inside = np.clip(phase, piece.phase[0] + 1e-9, piece.phase[1] - 1e-9)
                assert complex(*found) == pytest.approx(complex(fit.evaluate(np.array([inside]))[0]), abs=1e-7)


@pytest.mark.parametrize("decimals", [2, 4, 6])
def test_rounded_coefficients_move_the_track_by_their_last_place(decimals, slot, exact) -> None:
    fit = fit_slot(slot, "chebyshev", 8)
    moved = power_error(slot, power_basis(slot, fit, decimals), exact)
    assert moved <= fit_error(slot, fit, exact).normal + 9 * np.sqrt(2) * 0.5 * 10.0**-decimals
    assert moved > 1e-2 * 10.0**-decimals


def test_high_degrees_lose_their_digits_and_the_error_says_so(slot, exact) -> None:
    assert power_error(slot, power_basis(slot, fit_slot(slot, "chebyshev", 64)), exact) > 1.0


def test_a_series_that_is_no_polynomial_has_no_powers(slot) -> None:
    assert power_basis(slot, fit_slot(slot, "fourier", 8)) == power_basis(slot, fit_slot(slot, "spline", 9)) == []
