"""A slot by few numbers: pieces of Chebyshev series, a periodic spline, Fourier, one polynomial; and by powers.

The slot is smooth but its curvature jumps where a pin passes a joint. Pieces between these phases converge like an
analytic function; anything that runs across them is limited by the jumps, not by its conditioning.
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
from synthesis.scenes.chain.track import Place, Points, dot

FitKind = Literal["chebyshev", "spline", "fourier", "polynomial"]

ORDER_RANGE: dict[str, tuple[int, int]] = {
    "chebyshev": (1, 64),
    "spline": (4, 4096),
    "fourier": (1, 256),
    "polynomial": (1, 100),
}
"""Smallest and largest order: degree of each piece, number of knots, number of harmonics, degree."""
FOURIER_SAMPLES = 4096
DEFAULT_SAMPLES = 91
"""Of the polynomial: one a degree, as in the paper, with both ends."""


@dataclass(frozen=True)
class Fit:
    """A representation of a slot."""

    kind: FitKind
    order: int
    """Degree of each piece, number of knots, number of harmonics, or degree."""
    unknowns: int
    """Numbers that have to be stored, beside phases and frame."""
    condition: float
    """Condition number (2-norm) of the equations that were solved for them."""
    data: dict[str, Any]
    """The numbers, as plain lists, phases as arc length of P1."""
    evaluate: Callable[[Floats], Points]
    """``evaluate(phase) -> points``, both of shape (n,)."""
    slide: Callable[[Points, Points], Points] | None = None
    """Of a curve that does not say where on it the pin is: ``slide(near, centre) -> points`` on the curve, one pitch
    from ``centre`` and near ``near``, all of shape (n,)."""


@dataclass(frozen=True)
class FitError:
    """Largest errors of a fit, in the track's unit."""

    normal: float
    """Distance of the fitted slot from the exact one, square to it."""
    chord: float
    """Difference between the pitch and the free pin's links, when the pin is where the fit puts it. A curve leaves it
    free to slide: then the first link keeps its length and the last one takes the whole error."""


def fit_slot(slot: Slot, kind: FitKind, order: int, phases: Floats | None = None) -> Fit:
    """A slot's representation of one kind.

    ``order``: within `ORDER_RANGE`. ``phases``: phases, shape (n,), whose points the polynomial is fitted to; by
    default 91 over the whole window. The other kinds take their own.

    Raises `FieldError`: order out of range, fewer samples than coefficients, or a slot that this kind cannot represent.
    """
    low, high = ORDER_RANGE[kind]
    if not low <= order <= high:
        raise FieldError("/fit/order", f"{kind} takes an order from {low} to {high}, found {order}")
    if kind == "polynomial":
        phases = np.linspace(slot.start, slot.end, DEFAULT_SAMPLES) if phases is None else phases
        return _polynomial(slot, order, phases)
    return {"chebyshev": _chebyshev, "spline": _spline, "fourier": _fourier}[kind](slot, order)


class Exact(NamedTuple):
    """The slot itself at phases of shape (n,), which the errors of its representations are measured against."""

    phases: Floats
    points: Points
    normals: Points
    first: Points
    last: Points
    """The free pin's neighbours."""


def exact_slot(slot: Slot, phases: Floats) -> Exact:
    """The slot at phases of shape (n,)."""
    first, last = slot.held(phases)
    return Exact(phases, slot.hung(first, last), slot.normals(phases), first, last)


def fit_error(slot: Slot, fit: Fit, exact: Exact) -> FitError:
    """Errors of a fit against the slot itself."""
    found = fit.evaluate(exact.phases)
    normal = np.abs(dot(found - exact.points, exact.normals)).max()
    if fit.slide is not None:
        found = fit.slide(found, exact.first)
    chords = np.abs([found - exact.first, found - exact.last])
    return FitError(float(normal), float(np.abs(chords - slot.chain.pitch).max()))


def _chebyshev(slot: Slot, degree: int) -> Fit:
    """Interpolation of x and y at the Chebyshev points of each piece between two crossings."""
    breaks = slot.breaks
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    basis = chebyshev.chebvander(nodes, degree)
    # The columns are orthogonal at these points: the series follows by a product, nothing is solved.
    weights = basis.T * (2 / (degree + 1))
    weights[0] /= 2
    # About the middle of the slot, so that an origin far away costs no digits.
    origin = slot.frame[0]
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    points = slot.path((middle[:, None] + half[:, None] * nodes).ravel()).reshape(len(half), degree + 1) - origin
    series = points @ weights.T

    def evaluate(phase: Floats) -> Any:
        piece = np.clip(np.searchsorted(breaks, phase, side="right") - 1, 0, len(half) - 1)
        u = (phase - middle[piece]) / half[piece]
        return origin + chebyshev.chebval(u, series[piece].T, tensor=False)

    data = {
        "origin": [origin.real, origin.imag],
        "pieces": [
            {"phase": [float(a), float(b)], "x": xy.real.tolist(), "y": xy.imag.tolist()}
            for a, b, xy in zip(breaks[:-1], breaks[1:], series)
        ],
    }
    return Fit("chebyshev", degree, 2 * series.size, float(np.linalg.cond(basis)), data, evaluate)


class _AlongBase:
    """A slot in the coordinates of the one segment that it replaces, periodic in the phase.

    They are arc length less its linear part ``start + slope * phase``, phase from the window's start, and depth.
    """

    def __init__(self, slot: Slot) -> None:
        if len(slot.base) > 1:
            raise FieldError(
                "/fit/kind",
                "this slot replaces pieces of several segments, so it is not periodic in the coordinates of one; "
                "take 'chebyshev'",
            )
        (start, end), _ = slot.foot(slot.path(np.array([slot.start, slot.end])))
        self.slot = slot
        self.line = {"start": float(start), "slope": float(end - start) / slot.chain.period}

    def _linear(self, phase: Floats) -> Floats:
        return self.line["start"] + self.line["slope"] * (phase - self.slot.start)

    def values(self, phase: Floats) -> Floats:
        """Both coordinates, shape (n, 2)."""
        along, depth = self.slot.foot(self.slot.path(phase))
        return np.stack([along - self._linear(phase), depth], axis=1)

    def points(self, phase: Floats, values: Floats) -> Points:
        """The drawing's points of coordinates."""
        segment = np.full(len(phase), self.slot.base[0][0])
        place = Place(segment, values[:, 0] + self._linear(phase), np.zeros_like(segment))
        return self.slot.chain.track.beside(place, self.slot.outward * values[:, 1])


def _spline(slot: Slot, knots: int) -> Fit:
    """Periodic cubic spline of depth and arc length along the base (on an arc: of r and phi) over the phase."""
    from scipy.interpolate import CubicSpline

    base = _AlongBase(slot)
    phases = slot.start + slot.chain.period * np.arange(knots + 1) / knots
    values = base.values(phases)
    values[-1] = values[0]  # equal but for rounding; the periodic end condition asks for equal numbers
    spline = CubicSpline(phases, values, bc_type="periodic")
    along, depth = values[:-1].T.tolist()
    data = {**base.line, "phase": phases[:-1].tolist(), "along": along, "depth": depth}
    # Evenly spaced knots: the circulant matrix [1 4 1] has eigenvalues 4 + 2 cos(2 pi j/n).
    eigenvalues = 4 + 2 * np.cos(2 * np.pi * np.arange(knots) / knots)
    condition = float(eigenvalues.max() / eigenvalues.min())
    return Fit("spline", knots, 2 * knots, condition, data, lambda phase: base.points(phase, spline(phase)))


def _fourier(slot: Slot, harmonics: int) -> Fit:
    """Fourier series of depth and arc length along the base over the period."""
    base, period = _AlongBase(slot), slot.chain.period
    values = base.values(slot.start + period * np.arange(FOURIER_SAMPLES) / FOURIER_SAMPLES)
    spectrum = np.fft.rfft(values, axis=0)[: harmonics + 1] / FOURIER_SAMPLES
    spectrum[1:] *= 2

    def evaluate(phase: Floats) -> Points:
        # Clenshaw's recurrence for the sum of c_m z^m: one complex product a harmonic, no table of powers.
        z = np.exp(2j * np.pi * (phase - slot.start) / period)[:, None]
        total = np.zeros((len(phase), 2), dtype=complex)
        for coefficient in spectrum[::-1]:
            total = total * z + coefficient
        return base.points(phase, total.real)

    data: dict[str, Any] = dict(base.line)
    for name, series in zip(("along", "depth"), spectrum.T):
        data |= {f"{name}_cos": series.real.tolist(), f"{name}_sin": (-series[1:].imag).tolist()}
    # Columns 1, cos, sin on an even grid are orthogonal; only their lengths differ.
    return Fit("fourier", harmonics, 2 * (2 * harmonics + 1), float(np.sqrt(2)), data, evaluate)


def _polynomial(slot: Slot, degree: int, phases: Floats) -> Fit:
    """One polynomial y(x) in the slot's own frame, least squares in Chebyshev polynomials of the scaled x.

    The paper's form. Scaling keeps the conditioning harmless at any degree and any origin; the raw powers are not.
    """
    if degree + 1 > len(phases):
        raise FieldError(
            "/fit/order", f"a polynomial of degree {degree} needs at least {degree + 1} samples, found {len(phases)}"
        )
    points = slot.in_frame(slot.path(phases))
    if not np.all(np.diff(points.real) < 0):
        raise FieldError("/fit/kind", "this slot is no function y(x): it turns back; take 'chebyshev'")
    ends = slot.in_frame(slot.path(np.array([slot.start, slot.end]))).real
    low, high = float(ends.min()), float(ends.max())
    stretch = 2 / (high - low)
    design = chebyshev.chebvander(stretch * (points.real - low) - 1, degree)
    series, _, _, singular = np.linalg.lstsq(design, points.imag, rcond=None)
    slope = chebyshev.chebder(series) * stretch

    def curve(x: Floats) -> Points:
        return slot.from_frame(x + 1j * chebyshev.chebval(stretch * (x - low) - 1, series))

    def slide(near: Points, centre: Points) -> Points:
        centre, x = slot.in_frame(centre), slot.in_frame(near).real
        # Newton without brackets: the start is off by the fit's error only, which is small beside the pitch
        for _ in range(6):
            u = stretch * (x - low) - 1
            link = x + 1j * chebyshev.chebval(u, series) - centre
            away = link.real + link.imag * chebyshev.chebval(u, slope)
            error = 0.5 * (np.abs(link) ** 2 - slot.chain.pitch**2)
            x = np.clip(x - error / np.where(away == 0, np.inf, away), low - 0.5 / stretch, high + 0.5 / stretch)
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
        "polynomial", degree, degree + 1, condition, data, lambda p: curve(slot.in_frame(slot.path(p)).real), slide
    )


@dataclass(frozen=True)
class PowerPiece:
    """x and y of a piece of the track are ``sum c_k t^k`` with t from 0 to 1."""

    phase: tuple[float, float] | None
    """Phases at t = 0 and 1, in proportion between them; None where t counts x and not the phase."""
    x: Floats
    y: Floats
    """Coefficients in the drawing's coordinates, lowest power first, shape (degree + 1,)."""


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
