"""Representations of a slot by a small number of parameters.

A slot can be represented by piecewise Chebyshev series, a periodic spline, a Fourier series or a single polynomial,
and a Chebyshev series or polynomial by powers of a parameter. The slot is smooth, but its curvature jumps when a pin
passes a joint. Pieces between these phases converge like an analytic function. The accuracy of a representation
across the jumps is limited by them and not by its conditioning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import comb
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.chebyshev import cheb2poly
from numpy.polynomial.polynomial import polyval

from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.slot import Slot
from synthesis.scenes.chain.track import Points, TrackPosition, dot

FitKind = Literal["chebyshev", "spline", "fourier", "polynomial"]
"""Kind of representation."""

ORDER_RANGE: dict[str, tuple[int, int]] = {
    "chebyshev": (1, 64),
    "spline": (4, 4096),
    "fourier": (1, 256),
    "polynomial": (1, 100),
}
"""Smallest and largest order: degree of each piece, number of knots, number of harmonics, or degree."""
FOURIER_SAMPLES = 4096
"""Number of samples over the period for a Fourier series."""
DEFAULT_SAMPLES = 91
"""Number of samples for a polynomial: the angles in whole degrees including both ends, as in the source."""


@dataclass(frozen=True)
class Fit:
    """A representation of a slot."""

    kind: FitKind
    """Kind of representation."""
    order: int
    """Degree of each piece, number of knots, number of harmonics, or degree."""
    unknowns: int
    """Number of stored parameters, not counting phases and frame."""
    condition: float
    """Condition number (2-norm) of the equations solved for the parameters."""
    data: dict[str, Any]
    """The parameters as plain lists, with phases as arc length of P1."""
    evaluate: Callable[[Floats], Points]
    """``evaluate(phase) -> points``, both of shape (n,)."""
    slide: Callable[[Points, Points], Points] | None = None
    """For a curve y(x), which does not depend on the phase: ``slide(guess, centre) -> points`` on the curve, one pitch
    from ``centre`` and close to ``guess``, all of shape (n,).
    """


@dataclass(frozen=True)
class FitError:
    """Largest errors of a fit, in the unit of the track."""

    normal: float
    """Distance of the fitted slot from the exact slot, in the direction of the normal."""
    chord: float
    """Difference between the pitch and the links of the free pin at its fitted position. On a curve y(x) the pin can
    slide until the first link has its exact length; the last link then has the whole error.
    """


def fit_slot(slot: Slot, kind: FitKind, order: int, phases: Floats | None = None) -> Fit:
    """Fit a representation to a slot.

    Parameters
    ----------
    slot : Slot
    kind : {"chebyshev", "spline", "fourier", "polynomial"}
    order : int
        A value within `ORDER_RANGE`.
    phases : ndarray, shape (n,), optional
        Phases of the points to which a polynomial is fitted; by default 91 over the whole window. The other kinds use
        sampling points of their own.

    Returns
    -------
    Fit

    Raises
    ------
    FieldError
        The order is out of range, there are fewer samples than coefficients, or the kind cannot represent this slot.
    """
    low, high = ORDER_RANGE[kind]
    if not low <= order <= high:
        raise FieldError("/fit/order", f"the order of {kind} must be from {low} to {high}; found {order}")
    if kind == "polynomial":
        phases = np.linspace(slot.start, slot.end, DEFAULT_SAMPLES) if phases is None else phases
        return _polynomial(slot, order, phases)
    return {"chebyshev": _chebyshev, "spline": _spline, "fourier": _fourier}[kind](slot, order)


class ExactSlot(NamedTuple):
    """The exact slot at n phases, with which representations are compared."""

    phases: Floats
    """Phases, shape (n,)."""
    points: Points
    """Points of the slot, shape (n,)."""
    normals: Points
    """Unit normals of the slot, shape (n,)."""
    first: Points
    """Points of the neighbour P(k-1), shape (n,)."""
    last: Points
    """Points of the neighbour P(k+1), shape (n,)."""


def exact_slot(slot: Slot, phases: Floats) -> ExactSlot:
    """Evaluate the exact slot.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)

    Returns
    -------
    ExactSlot
    """
    first, last = slot.neighbour_points(phases)
    return ExactSlot(phases, slot.hang_between(first, last), slot.normals(phases), first, last)


def fit_error(slot: Slot, fit: Fit, exact: ExactSlot) -> FitError:
    """Compute the errors of a fit.

    Parameters
    ----------
    slot : Slot
    fit : Fit
    exact : ExactSlot
        The exact slot at the phases at which the errors are measured.

    Returns
    -------
    FitError
    """
    fitted = fit.evaluate(exact.phases)
    normal = np.abs(dot(fitted - exact.points, exact.normals)).max()
    if fit.slide is not None:
        fitted = fit.slide(fitted, exact.first)
    chords = np.abs([fitted - exact.first, fitted - exact.last])
    return FitError(float(normal), float(np.abs(chords - slot.chain.pitch).max()))


def _chebyshev(slot: Slot, degree: int) -> Fit:
    """Interpolate x and y at the Chebyshev points of each piece between two crossings."""
    breaks = slot.breaks
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    basis = chebyshev.chebvander(nodes, degree)
    # the columns are orthogonal at these points, so a matrix product gives the series
    weights = basis.T * (2 / (degree + 1))
    weights[0] /= 2
    # relative to the middle of the slot, to keep all digits if the origin is far away
    origin = slot.frame[0]
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    points = slot.path((middle[:, None] + half[:, None] * nodes).ravel()).reshape(len(half), degree + 1) - origin
    series = points @ weights.T

    def evaluate(phase: Floats) -> Any:
        piece = np.clip(np.searchsorted(breaks, phase, side="right") - 1, 0, len(half) - 1)
        scaled = (phase - middle[piece]) / half[piece]
        return origin + chebyshev.chebval(scaled, series[piece].T, tensor=False)

    data = {
        "origin": [origin.real, origin.imag],
        "pieces": [
            {"phase": [float(a), float(b)], "x": xy.real.tolist(), "y": xy.imag.tolist()}
            for a, b, xy in zip(breaks[:-1], breaks[1:], series)
        ],
    }
    return Fit("chebyshev", degree, 2 * series.size, float(np.linalg.cond(basis)), data, evaluate)


class _AlongBase:
    """Coordinates of a slot along the segment that it replaces, periodic in the phase.

    The coordinates are the depth, and the arc length minus its linear part ``start + slope * phase``, with the phase
    measured from the start of the window.
    """

    def __init__(self, slot: Slot) -> None:
        if len(slot.base) > 1:
            raise FieldError(
                "/fit/kind",
                "this slot replaces parts of several segments, so it is not periodic in the coordinates of a segment; "
                "use 'chebyshev'",
            )
        (start, end), _ = slot.foot(slot.path(np.array([slot.start, slot.end])))
        self.slot = slot
        self.line = {"start": float(start), "slope": float(end - start) / slot.chain.period}

    def _linear(self, phase: Floats) -> Floats:
        return self.line["start"] + self.line["slope"] * (phase - self.slot.start)

    def values(self, phase: Floats) -> Floats:
        """Return both coordinates, shape (n, 2)."""
        along, depth = self.slot.foot(self.slot.path(phase))
        return np.stack([along - self._linear(phase), depth], axis=1)

    def points(self, phase: Floats, values: Floats) -> Points:
        """Convert coordinates to points of the drawing."""
        segment = np.full(len(phase), self.slot.base[0][0])
        position = TrackPosition(segment, values[:, 0] + self._linear(phase), np.zeros_like(segment))
        return self.slot.chain.track.beside(position, self.slot.outward * values[:, 1])


def _spline(slot: Slot, knots: int) -> Fit:
    """Fit a periodic cubic spline to depth and arc length along the base (r and phi on an arc) over the phase."""
    from scipy.interpolate import CubicSpline

    base = _AlongBase(slot)
    phases = slot.start + slot.chain.period * np.arange(knots + 1) / knots
    values = base.values(phases)
    values[-1] = values[0]  # equal up to rounding, but the periodic end condition requires equal numbers
    spline = CubicSpline(phases, values, bc_type="periodic")
    along, depth = values[:-1].T.tolist()
    data = {**base.line, "phase": phases[:-1].tolist(), "along": along, "depth": depth}
    # for evenly spaced knots, the circulant matrix [1 4 1] has the eigenvalues 4 + 2 cos(2 pi j/n)
    eigenvalues = 4 + 2 * np.cos(2 * np.pi * np.arange(knots) / knots)
    condition = float(eigenvalues.max() / eigenvalues.min())
    return Fit("spline", knots, 2 * knots, condition, data, lambda phase: base.points(phase, spline(phase)))


def _fourier(slot: Slot, harmonics: int) -> Fit:
    """Fit a Fourier series to depth and arc length along the base over the period."""
    base, period = _AlongBase(slot), slot.chain.period
    values = base.values(slot.start + period * np.arange(FOURIER_SAMPLES) / FOURIER_SAMPLES)
    spectrum = np.fft.rfft(values, axis=0)[: harmonics + 1] / FOURIER_SAMPLES
    spectrum[1:] *= 2

    def evaluate(phase: Floats) -> Points:
        # Horner's scheme for the sum of c_m z^m needs one complex product per harmonic and no table of powers
        z = np.exp(2j * np.pi * (phase - slot.start) / period)[:, None]
        total = np.zeros((len(phase), 2), dtype=complex)
        for coefficient in spectrum[::-1]:
            total = total * z + coefficient
        return base.points(phase, total.real)

    data: dict[str, Any] = dict(base.line)
    for name, series in zip(("along", "depth"), spectrum.T):
        data |= {f"{name}_cos": series.real.tolist(), f"{name}_sin": (-series[1:].imag).tolist()}
    # the columns 1, cos and sin are orthogonal on a uniform grid; only their lengths differ
    return Fit("fourier", harmonics, 2 * (2 * harmonics + 1), float(np.sqrt(2)), data, evaluate)


def _polynomial(slot: Slot, degree: int, phases: Floats) -> Fit:
    """Fit a polynomial y(x) in the frame of the slot by least squares, in Chebyshev polynomials of the scaled x.

    The form is the same as in the source. The scaling keeps the condition number small at any degree and for any
    origin, unlike with powers of x.
    """
    if degree + 1 > len(phases):
        raise FieldError(
            "/fit/order", f"a polynomial of degree {degree} needs at least {degree + 1} samples; found {len(phases)}"
        )
    points = slot.in_frame(slot.path(phases))
    if not np.all(np.diff(points.real) < 0):
        raise FieldError("/fit/kind", "this slot is not a function y(x), because it turns back; use 'chebyshev'")
    ends = slot.in_frame(slot.path(np.array([slot.start, slot.end]))).real
    low, high = float(ends.min()), float(ends.max())
    stretch = 2 / (high - low)
    design = chebyshev.chebvander(stretch * (points.real - low) - 1, degree)
    series, _, _, singular = np.linalg.lstsq(design, points.imag, rcond=None)
    slope = chebyshev.chebder(series) * stretch

    def curve(x: Floats) -> Points:
        return slot.from_frame(x + 1j * chebyshev.chebval(stretch * (x - low) - 1, series))

    def slide(guess: Points, centre: Points) -> Points:
        centre, x = slot.in_frame(centre), slot.in_frame(guess).real
        # Newton's method needs no bracket, because the start differs from the root only by
        # the error of the fit, which is small compared to the pitch
        for _ in range(6):
            u = stretch * (x - low) - 1
            link = x + 1j * chebyshev.chebval(u, series) - centre
            derivative = link.real + link.imag * chebyshev.chebval(u, slope)
            error = 0.5 * (np.abs(link) ** 2 - slot.chain.pitch**2)
            x = np.clip(
                x - error / np.where(derivative == 0, np.inf, derivative), low - 0.5 / stretch, high + 0.5 / stretch
            )
        return curve(x)

    origin, direction = slot.frame
    data = {
        "origin": [origin.real, origin.imag],
        "angle": float(np.angle(direction)),
        "x": [low, high],
        "coefficients": series.tolist(),
    }
    condition = float(singular[0] / singular[-1])
    return Fit(
        "polynomial",
        degree,
        degree + 1,
        condition,
        data,
        lambda phases_: curve(slot.in_frame(slot.path(phases_)).real),
        slide,
    )


@dataclass(frozen=True)
class PowerPiece:
    """Piece of the slot whose coordinates x and y are ``sum c_k t^k`` with t from 0 to 1."""

    phase: tuple[float, float] | None
    """Phases at t = 0 and t = 1, with a linear relation between t and the phase; None if t is proportional to x
    instead."""
    x: Floats
    """Coefficients of x in the coordinates of the drawing, lowest power first, shape (degree + 1,)."""
    y: Floats
    """Coefficients of y in the coordinates of the drawing, lowest power first, shape (degree + 1,)."""


def power_basis(slot: Slot, fit: Fit, decimals: int | None = None) -> list[PowerPiece]:
    """Convert a Chebyshev or polynomial fit to powers.

    Parameters
    ----------
    slot : Slot
    fit : Fit
    decimals : int, optional
        Number of decimals of the coefficients. Each rounded coefficient moves the slot by at most half a unit of the
        last decimal.

    Returns
    -------
    list of PowerPiece
        Empty for the other kinds, which are not polynomials in x and y.
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
    return [PowerPiece(piece.phase, np.round(piece.x, decimals), np.round(piece.y, decimals)) for piece in pieces]


def power_error(slot: Slot, pieces: list[PowerPiece], exact: ExactSlot) -> float:
    """Compute the error of a slot in powers.

    Parameters
    ----------
    slot : Slot
    pieces : list of PowerPiece
    exact : ExactSlot
        The exact slot at the phases at which the error is measured.

    Returns
    -------
    float
        Largest distance from the exact slot, in the direction of its normal.
    """
    phases = exact.phases
    if pieces[0].phase is None:
        x = slot.in_frame(exact.points).real
        first, last = (complex(polyval(t, pieces[0].x), polyval(t, pieces[0].y)) for t in (0.0, 1.0))
        low, high = (slot.in_frame(np.array([end]))[0].real for end in (first, last))
        piece_index, t = np.zeros(len(phases), dtype=int), (x - low) / (high - low)
    else:
        bounds = np.array([piece.phase for piece in pieces])
        piece_index = np.clip(np.searchsorted(bounds[:, 0], phases, side="right") - 1, 0, len(pieces) - 1)
        t = (phases - bounds[piece_index, 0]) / (bounds[piece_index, 1] - bounds[piece_index, 0])
    points = np.empty(len(phases), dtype=complex)
    for index, piece in enumerate(pieces):
        belongs = piece_index == index
        points[belongs] = polyval(t[belongs], piece.x) + 1j * polyval(t[belongs], piece.y)
    return float(np.abs(((points - exact.points) * np.conj(exact.normals)).real).max())


def _powers(series: Floats) -> Floats:
    """Convert a Chebyshev series in u = 2 t - 1 from -1 to 1 to coefficients of powers of t from 0 to 1."""
    powers = cheb2poly(series)
    shifted = np.zeros(len(series))
    for k, coefficient in enumerate(powers):
        for j in range(k + 1):
            shifted[j] += coefficient * comb(k, j) * 2.0**j * (-1.0) ** (k - j)
    return shifted
