"""The slot as piecewise Chebyshev series.

The slot is smooth, but its curvature jumps when a pin passes a joint. The pieces lie between these phases, where the
series converge like those of an analytic function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.slot import Slot
from synthesis.scenes.chain.track import Points, dot

MAX_ORDER = 64
"""Largest degree of the pieces."""


@dataclass(frozen=True)
class Fit:
    """Chebyshev series of a slot, one for each piece between two crossings."""

    origin: complex
    """Point to which the series are relative, so that they keep all digits if the origin of the drawing is far away."""
    breaks: Floats
    """Phases of the ends of the pieces, shape (n + 1,)."""
    series: NDArray[np.complex128]
    """Coefficients of x + i y of each piece over its range of phases, scaled to -1 .. 1, shape (n, order + 1)."""

    def evaluate(self, phase: Floats) -> Any:
        """Return the points of the fitted slot at phases, both of shape (n,)."""
        piece = np.clip(np.searchsorted(self.breaks, phase, side="right") - 1, 0, len(self.series) - 1)
        t = (phase - self.breaks[piece]) / np.diff(self.breaks)[piece]
        return self.origin + chebyshev.chebval(2 * t - 1, self.series[piece].T, tensor=False)


@dataclass(frozen=True)
class FitError:
    """Largest errors of a fit, in the unit of the track."""

    normal: float
    """Distance of the fitted slot from the exact slot, in the direction of the normal."""
    chord: float
    """Difference between the pitch and the links of the free pin at its fitted position."""


def fit_slot(slot: Slot, order: int) -> Fit:
    """Interpolate a slot at the Chebyshev points of each piece between two crossings.

    Parameters
    ----------
    slot : Slot
    order : int
        Degree of each piece, from 1 to `MAX_ORDER`.

    Returns
    -------
    Fit

    Raises
    ------
    FieldError
        The order is out of range.
    """
    if not 1 <= order <= MAX_ORDER:
        raise FieldError("/fit/order", f"the order must be from 1 to {MAX_ORDER}; found {order}")
    breaks, origin = slot.breaks, slot.frame[0]
    nodes = np.cos(np.pi * (np.arange(order + 1) + 0.5) / (order + 1))
    # the columns are orthogonal at these points, so a matrix product gives the series
    weights = chebyshev.chebvander(nodes, order).T * (2 / (order + 1))
    weights[0] /= 2
    middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * np.diff(breaks)
    points = slot.path((middle[:, None] + half[:, None] * nodes).ravel()).reshape(len(half), order + 1) - origin
    return Fit(origin, breaks, points @ weights.T)


class ExactSlot(NamedTuple):
    """The exact slot at n phases, with which a fit is compared."""

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
    """Evaluate the exact slot at phases, shape (n,)."""
    first, last = slot.neighbour_points(phases)
    return ExactSlot(phases, slot.hang_between(first, last), slot.normals(phases), first, last)


def fit_error(slot: Slot, fit: Fit, exact: ExactSlot) -> FitError:
    """Compute the errors of a fit at the phases of the exact slot."""
    fitted = fit.evaluate(exact.phases)
    normal = np.abs(dot(fitted - exact.points, exact.normals)).max()
    chords = np.abs([fitted - exact.first, fitted - exact.last])
    return FitError(float(normal), float(np.abs(chords - slot.chain.pitch).max()))
