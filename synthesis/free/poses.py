"""Samples of a motion without crank angles: what is asked for, and the request with angles once they are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.target import MIN_SPAN, TURN, Samples, Target, read_samples

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MIN_POSES = 2
"""Fewest samples that fix anything."""


@dataclass(frozen=True, kw_only=True)
class Poses(Samples):
    """Samples whose crank angles are free. Rotations count modulo a turn.

    Attributes
    ----------
    ordered : bool
        Whether the crank passes the samples in the order given, turning one way, either way.
    closed : bool
        Whether the way leads from the last sample on to the first.
    span_max : float
        The crank turns by no more than this from the first sample to the last, in radians; at most a turn.
    """

    ordered: bool = True
    closed: bool = False
    span_max: float = TURN

    @cached_property
    def middle(self) -> complex:
        """Mean position."""
        return 0j if self.position is None else complex(self.position_mean(self.position))

    @cached_property
    def scaled(self) -> Complexes:
        """Positions from their mean over the length scale; zeros where there is none."""
        if self.position is None:
            return np.zeros(self.samples, dtype=complex)
        return self.position_mean.given((self.position - self.middle) / self.length_scale)

    @cached_property
    def turned(self) -> Complexes:
        """e^{i gamma}; ones without rotations."""
        return np.ones(self.samples, dtype=complex) if self.rotation is None else np.exp(1j * self.rotation)

    @cached_property
    def full(self) -> NDArray[np.intp]:
        """Samples that have both a rotation and a position."""
        given = np.ones(self.samples, dtype=bool)
        for part, weights in ((self.rotation, self.rotation_weights), (self.position, self.position_weights)):
            given &= part is not None if weights is None else weights > 0
        return np.flatnonzero(given)

    def timed(self, crank: Floats, rotation: Floats | None) -> Target:
        """The request with crank angles from the first sample, of one linkage or of several.

        Parameters
        ----------
        crank : ndarray, shape (..., N)
        rotation : ndarray, shape (..., N), or None
            The body's rotation there: those asked for are moved by whole turns to lie nearest to it.
        """
        asked = self.rotation
        if asked is not None:
            assert rotation is not None
            asked = asked + TURN * np.round((rotation - asked) / TURN)
        return Target(
            asked,
            self.position,
            self.length_scale,
            self.rotation_weights,
            self.position_weights,
            crank=crank,
            found=True,
        )

    def mirrored(self) -> Poses:
        """The request in a mirror (the x axis)."""
        return replace(
            self,
            rotation=None if self.rotation is None else -self.rotation,
            position=None if self.position is None else np.conj(self.position),
        )


def make_poses(
    rotation: Floats | None = None,
    position: NDArray[np.complex128] | None = None,
    length_scale: float | None = None,
    rotation_weights: Floats | None = None,
    position_weights: Floats | None = None,
    ordered: bool = True,
    closed: bool = False,
    span_max: float | None = None,
) -> Poses:
    """Checked `Poses`; arguments as of `target.make_target`.

    A closed path whose last sample repeats the first loses that sample: it says nothing more.

    Raises
    ------
    FieldError
        Naming the field and the sample.
    """
    if position is None:
        raise FieldError(
            "/position",
            "needed where the crank angles are free: any rotation within the coupler's swing is met at some crank angle",
        )
    part, _ = read_samples(rotation, position, length_scale, rotation_weights, position_weights, least=MIN_POSES)
    if span_max is not None and not MIN_SPAN <= span_max <= TURN * (1 + 1e-12):
        low, high = np.rad2deg([MIN_SPAN, TURN])
        raise FieldError("/crank_span_max", f"wanted {low:g} to {high:g} degrees, found {np.rad2deg(span_max):g}")
    poses = Poses(**part, ordered=ordered, closed=closed, span_max=TURN if span_max is None else min(span_max, TURN))
    return poses
