"""Samples of a motion without crank angles: what is asked for, and the request with angles once they are known."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from synthesis.target import TURN, Samples

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class Poses(Samples):
    """Samples whose crank angles are free. Rotations count modulo a turn.

    Attributes
    ----------
    ordered : bool
        Whether the crank passes the samples in the order given, turning one way.
    span_max : float
        The crank turns by no more than this from the first sample to the last, in radians; at most a turn.
    """

    ordered: bool = True
    span_max: float = TURN

    @cached_property
    def middle(self) -> complex:
        """Mean position."""
        return complex(self.position_mean(self.position)) if self.position is not None else 0j

    @cached_property
    def scaled(self) -> Complexes:
        """Positions from their mean over the length scale; zeros without positions."""
        if self.position is None:
            return np.zeros(self.samples, dtype=complex)
        return (
            self.position_mean.given(self.position) - self.position_mean.given(np.full(self.samples, self.middle))
        ) / self.length_scale

    @cached_property
    def turned(self) -> Complexes:
        """e^{i gamma}; ones without rotations."""
        return np.ones(self.samples, dtype=complex) if self.rotation is None else np.exp(1j * self.rotation)

    @cached_property
    def full(self) -> NDArray[np.int64]:
        """Samples that have both a rotation and a position."""
        given = np.ones(self.samples, dtype=bool)
        for part, weights in ((self.rotation, self.rotation_weights), (self.position, self.position_weights)):
            given &= (part is not None) if weights is None else weights > 0
        return np.flatnonzero(given)
