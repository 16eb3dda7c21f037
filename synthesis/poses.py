"""Samples of a motion without crank angles, and their conversion to a target once the crank angles are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.errors import FieldError
from synthesis.target import MIN_SPAN, TURN, Samples, Target, read_samples

MIN_POSES = 2
"""Fewest samples that fix anything."""
_STARTS = 32
"""Largest number of samples from which shorter ways through all samples begin."""
HALF = np.pi * (1 + 1e-9)
"""Half a turn with a margin for rounding: angles that differ by less are not unwrapped."""


@dataclass(frozen=True, kw_only=True)
class Poses(Samples):
    """Samples whose crank angles are free. Rotations count modulo a turn.

    Attributes
    ----------
    ordered : bool
        True if the crank has to pass the samples in the given order while it turns in a single direction.
    closed : bool
        True if the path continues from the last sample to the first.
    span_max : float
        Largest rotation of the crank from the first sample to the last, in radians; at most a turn.
    requested : Samples or None
        Samples of the request including the last sample, if it repeats the first sample of a closed path. The search omits
        this last sample; the first sample has the weights of both.
    """

    ordered: bool = True
    closed: bool = False
    span_max: float = TURN
    requested: Samples | None = None

    def whole(self, crank: Floats) -> Floats:
        """Return crank angles (..., N) of all requested samples; a repeated first sample follows a turn later."""
        return crank if self.requested is None else _round(crank)

    def there_and_back(self, crank: Floats) -> Floats:
        """Return crank angles (..., N) of all requested samples; on a closed path the first sample is repeated at the end."""
        return _round(crank) if self.closed and crank.shape[-1] == self.samples else crank

    def spins(self, rotation: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
        """Compare the rotation of a body between neighbouring samples with the requested rotation.

        The requested rotation is the difference of the angles of both samples. If it exceeds half a turn, an angle may have
        been wrapped, so the difference without whole turns is accepted too.

        Parameters
        ----------
        rotation : ndarray, shape (..., M)
            Continuous rotation at the crank angles of `there_and_back`, with any offset.

        Returns
        -------
        indices : ndarray, shape (G,)
            Requested samples with an angle; G is 0 if the order of the samples is free.
        prescribed : ndarray, shape (G - 1,)
            Requested rotations in radians.
        turned : ndarray, shape (..., G - 1)
            Rotations of the body; NaN if they are as requested.
        """
        samples = self.requested if self.requested is not None and rotation.shape[-1] > self.samples else self
        if samples.rotation is None or not self.ordered:
            return np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((*rotation.shape[:-1], 0))
        with_angle = np.flatnonzero(
            np.ones(samples.samples) if samples.rotation_weights is None else samples.rotation_weights
        )
        target, indices = samples.rotation[with_angle], with_angle
        if rotation.shape[-1] > samples.samples and 0 in with_angle:  # then from the last sample to the first
            indices, target = np.append(with_angle, samples.samples), np.append(target, target[0])
        prescribed, turned = np.diff(target), np.diff(rotation[..., indices], axis=-1)
        extra = np.round((turned - prescribed) / TURN)
        wrapped = np.where(np.abs(prescribed) > HALF, -np.round(prescribed / TURN), 0.0)
        return indices, prescribed, np.where((extra == 0) | (extra == wrapped), np.nan, turned)

    def turned_otherwise(self, rotation: Floats) -> Flags:
        """Return flags (...) of bodies that turn between two samples by another angle than requested, see `spins`."""
        return np.asarray(~np.all(np.isnan(self.spins(rotation)[2]), axis=-1))

    def at(self, indices: NDArray[np.intp]) -> Poses:
        """Select samples; the length scale does not change."""
        names = ("rotation", "position", "rotation_weights", "position_weights")
        part: dict[str, Any] = {
            name: None if (values := getattr(self, name)) is None else values[indices] for name in names
        }
        return replace(self, **part)

    @cached_property
    def detour(self) -> float:
        """Ratio of the path length through the samples in their order to the shortest path length that is known.

        Distances combine rotations with positions over the length scale, as the objective does. Shorter paths are built by
        starting at a sample and visiting the nearest remaining sample. The ratio is 1 if a rotation or a position is missing.
        """
        if self.rotation is None or self.full.size < self.samples or self.samples < 3:
            return 1.0
        gaps = np.hypot(*(np.abs(column[:, None] - column) for column in (self.scaled, self.turned)))
        starts = self.spread(_STARTS)
        length, at, row = np.zeros(starts.size), starts, np.arange(starts.size)
        left = np.ones((starts.size, self.samples), dtype=bool)
        for _ in range(self.samples - 1):
            left[row, at] = False
            beside = np.where(left, gaps[at], np.inf)
            at = beside.argmin(axis=1)
            length += beside[row, at]
        return float(np.trace(gaps, 1) / min(length.min(), np.trace(gaps, 1)))

    @cached_property
    def turned(self) -> Complexes:
        """Rotations as unit complex numbers e^{i gamma}; 1 without rotations."""
        return np.ones(self.samples, dtype=complex) if self.rotation is None else np.exp(1j * self.rotation)

    @cached_property
    def full(self) -> NDArray[np.intp]:
        """Samples that have both a rotation and a position."""
        complete = np.ones(self.samples, dtype=bool)
        for part, weights in ((self.rotation, self.rotation_weights), (self.position, self.position_weights)):
            complete &= part is not None if weights is None else weights > 0
        return np.flatnonzero(complete)

    def used(self, crank: Floats) -> Target:
        """Return a target with crank angles (n, N) and length scale only, which is sufficient to evaluate limits."""
        return Target(None, None, self.length_scale, crank=crank, found=True, closed=self.closed)

    def timed(self, crank: Floats, rotation: Floats | None) -> Target:
        """Return the request as a target with known crank angles, for one or several linkages.

        Parameters
        ----------
        crank : ndarray, shape (..., N)
            Crank angles of all requested samples from the first sample.
        rotation : ndarray, shape (..., N), or None
            Rotation of the body at these samples. Requested rotations are shifted by whole turns to be closest to it.
        """
        complete = self if self.requested is None else self.requested
        turns, moved = complete.rotation, np.zeros(1)
        if turns is not None:
            assert rotation is not None
            moved = TURN * np.round((rotation - turns) / TURN)
            turns = turns + moved
        return Target(
            turns,
            complete.position,
            complete.length_scale,
            complete.rotation_weights,
            complete.position_weights,
            crank=crank,
            found=True,
            closed=self.closed,
            moved=moved,
        )


def _round(crank: Floats) -> Floats:
    """Append the crank angle of the first sample, a turn later."""
    sense = np.where(crank[..., -1:] >= crank[..., :1], 1.0, -1.0)
    return np.concatenate([crank, crank[..., :1] + sense * TURN], axis=-1)


def spin_faults(poses: Poses, rotation: Floats) -> list[str]:
    """Describe the first two samples between which a body turns by another angle than requested, see `Poses.spins`."""
    indices, prescribed, turned = poses.spins(rotation)
    wrong = np.flatnonzero(~np.isnan(turned))
    if not wrong.size:
        return []
    k = int(wrong[0])
    first, last = (int(index) % (poses.requested or poses).samples + 1 for index in indices[k : k + 2])
    degrees = np.rad2deg([turned[k], prescribed[k]])
    return [f"the body turns by {degrees[0]:.4g} degrees from sample {first} to {last}, not by {degrees[1]:.4g}"]


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
    """Check the fields of a request and return `Poses`; the arguments are described in `target.make_target`.

    If the last sample of a closed path repeats the first, it is omitted, and the first sample gets its weights.

    Raises
    ------
    FieldError
        If a field is invalid; the error names the field and the sample.
    """
    if position is None:
        raise FieldError(
            "/position", "is required with free crank angles, because rotations do not determine the linkage"
        )
    part, _ = read_samples(
        rotation, position, length_scale, rotation_weights, position_weights, min_samples=MIN_POSES
    )
    if span_max is not None and not MIN_SPAN <= span_max <= TURN * (1 + 1e-12):
        low, high = np.rad2deg([MIN_SPAN, TURN])
        raise FieldError("/crank_span_max", f"must be {low:g} to {high:g} degrees; it is {np.rad2deg(span_max):g}")
    options: dict[str, Any] = {
        "ordered": ordered,
        "closed": closed,
        "span_max": TURN if span_max is None else min(span_max, TURN),
    }
    if closed and len(part["position"]) > MIN_POSES and _returns(Samples(**part)):
        return _without_the_last(Samples(**part), options)
    return Poses(**part, **options)


def _returns(samples: Samples) -> bool:
    """Return True if the last sample repeats the first, except for rounding."""
    for weights in (samples.rotation_weights, samples.position_weights):
        if weights is not None and min(weights[0], weights[-1]) == 0:
            return False
    assert samples.position is not None
    if abs(samples.position[-1] - samples.position[0]) > 1e-9 * samples.extent:
        return False
    return samples.rotation is None or abs(np.exp(1j * (samples.rotation[-1] - samples.rotation[0])) - 1) < 1e-9


def _without_the_last(samples: Samples, options: dict[str, Any]) -> Poses:
    """Remove the last sample of a request and add its weights to the first sample."""

    def weights(own: Floats | None) -> Floats:
        weight = np.ones(samples.samples) if own is None else own
        return np.concatenate([[weight[0] + weight[-1]], weight[1:-1]])

    assert samples.position is not None
    return Poses(
        rotation=None if samples.rotation is None else samples.rotation[:-1],
        position=samples.position[:-1],
        length_scale=samples.length_scale,
        rotation_weights=None if samples.rotation is None else weights(samples.rotation_weights),
        position_weights=weights(samples.position_weights),
        requested=samples,
        **options,
    )
