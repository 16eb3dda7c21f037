"""The requested motion: crank angles, and the rotation or the positions, or both, that belong to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError

Floats = NDArray[np.float64]

MIN_SAMPLES, MAX_SAMPLES = 3, 1024
MIN_SPAN = np.deg2rad(0.1)
"""Smallest crank span: below it a curve has no shape that double precision could tell from a line."""
MAX_SPAN = np.deg2rad(3600.0)
MIN_STEP = 1e-9
"""Smallest step of the crank between samples, as part of the span."""
MAX_ROTATION = 1e6
"""Largest rotation in radians: beyond it double precision keeps fewer than ten digits behind the point."""
MIN_LENGTH, MAX_LENGTH = 1e-50, 1e50
"""Lengths and coordinates lie between: squares, and quotients of squares, neither over- nor underflow."""


@dataclass(frozen=True)
class Target:
    """A requested motion, in radians and the user's unit of length.

    Attributes
    ----------
    crank : ndarray, shape (N,)
        Crank angle from the first sample on; ``crank[0] == 0``, strictly rising or strictly falling (clockwise).
    rotation : ndarray, shape (N,), or None
        Rotation of the body, taken as continuous as it is given.
    position : ndarray of complex, shape (N,), or None
        A point of the body, x + i y.
    length_scale : float
        l of the objective; 1 without positions.
    """

    crank: Floats
    rotation: Floats | None
    position: NDArray[np.complex128] | None
    length_scale: float = 1.0

    @property
    def samples(self) -> int:
        return self.crank.size

    @cached_property
    def extent(self) -> float:
        """Largest distance of a position from the mean position."""
        return float(np.max(np.abs(self.position - self.position.mean())))

    @property
    def span(self) -> float:
        """Crank angle from the first to the last sample, signed."""
        return float(self.crank[-1])


def make_target(
    rotation: Floats | None = None,
    position: NDArray[np.complex128] | None = None,
    crank_span: float | None = None,
    crank_angle: Floats | None = None,
    length_scale: float | None = None,
) -> Target:
    """A checked `Target`.

    Parameters
    ----------
    rotation, position : ndarray, shape (N,), optional
        At least one; 3 to 1,024 samples.
    crank_span : float, optional
        Evenly spaced crank angles from 0 to this, both ends included; negative for a clockwise crank.
    crank_angle : ndarray, shape (N,), optional
        In place of ``crank_span``: angles from any zero; what counts is the increment from the first.
    length_scale : float, optional
        Default: the largest distance of a position from the mean position.

    Raises
    ------
    FieldError
        Naming the field and the sample.
    """
    named = {"rotation": rotation, "position": position, "crank_angle": crank_angle}
    if position is not None:
        named["position"] = np.asarray(position, dtype=complex)
    given = {name: np.asarray(values) for name, values in named.items() if values is not None}
    if rotation is None and position is None:
        raise FieldError("", "give `rotation`, `position` or both")
    for name, values in given.items():
        if values.ndim != 1 or not MIN_SAMPLES <= values.size <= MAX_SAMPLES:
            raise FieldError(f"/{name}", f"wanted {MIN_SAMPLES} to {MAX_SAMPLES} samples, found {values.size}")
        if not np.all(np.isfinite(values)):
            raise FieldError(f"/{name}/{int(np.argmin(np.isfinite(values)))}", "wanted a finite number")
    if len(sizes := {name: values.size for name, values in given.items()}) > 1 and len(set(sizes.values())) > 1:
        counted = ", ".join(f"{name} has {size}" for name, size in sizes.items())
        raise FieldError(f"/{list(sizes)[-1]}", f"wanted the same number of samples everywhere, but {counted}")
    if rotation is not None and np.any(large := np.abs(given["rotation"]) > MAX_ROTATION):
        raise FieldError(f"/rotation/{int(np.argmax(large))}", f"wanted at most {MAX_ROTATION:g} radians either way")
    crank = _crank(crank_span, given.get("crank_angle"), next(iter(given.values())).size)
    scale = 1.0
    if position is not None:
        scale = _length_scale(given["position"], length_scale)
    elif length_scale is not None:
        raise FieldError("/length_scale", "weighs positions, but there are none")
    return Target(
        crank,
        given["rotation"].astype(float) if rotation is not None else None,
        given["position"].astype(complex) if position is not None else None,
        scale,
    )


def _crank(crank_span: float | None, crank_angle: Floats | None, samples: int) -> Floats:
    if (crank_span is None) == (crank_angle is None):
        raise FieldError("/crank_span", "give either `crank_span` or `crank_angle`")
    if crank_angle is None:
        if not np.isfinite(crank_span):
            raise FieldError("/crank_span", "wanted a finite number")
        field, crank = "/crank_span", np.linspace(0.0, float(crank_span), samples)
    else:
        field, crank = "/crank_angle", crank_angle.astype(float) - float(crank_angle[0])
    span = abs(crank[-1])
    if not MIN_SPAN <= span <= MAX_SPAN:
        low, high, found = np.rad2deg([MIN_SPAN, MAX_SPAN, span])
        raise FieldError(field, f"the crank must turn by {low:g} to {high:g} degrees, found {found:g}")
    steps = np.diff(crank) * np.sign(crank[-1])
    short = steps <= MIN_STEP * span
    if np.any(short):
        place = int(np.argmax(short)) + 1
        raise FieldError(
            f"{field}/{place}", "the crank must turn one way: this angle does not go on from the one before"
        )
    return crank


def _length_scale(position: NDArray[np.complex128], length_scale: float | None) -> float:
    largest = float(max(np.max(np.abs(position.real)), np.max(np.abs(position.imag))))
    for field, length in (("/position", largest or None), ("/length_scale", length_scale)):
        if length is not None and not MIN_LENGTH <= length <= MAX_LENGTH:
            raise FieldError(field, f"wanted lengths between {MIN_LENGTH:g} and {MAX_LENGTH:g}")
    spread = float(np.max(np.abs(position - position.mean())))
    if spread <= 64 * np.finfo(float).eps * largest:
        raise FieldError("/position", "all positions are the same point: a motion without extent fixes no linkage")
    return float(length_scale) if length_scale is not None else spread
