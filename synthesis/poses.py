"""Samples of a motion without crank angles: what is asked for, and the request with angles once they are known."""

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
"""Half a turn: angles that differ by no more are taken as they are."""


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
    asked : Samples or None
        The request with its last sample, where that repeats the first of a closed way: it is left out here, and the first
        counts for both.
    """

    ordered: bool = True
    closed: bool = False
    span_max: float = TURN
    asked: Samples | None = None

    def whole(self, crank: Floats) -> Floats:
        """Crank angles (..., N) of all samples that were asked for: a last one that repeats the first comes a turn later."""
        return crank if self.asked is None else _round(crank)

    def there_and_back(self, crank: Floats) -> Floats:
        """Crank angles (..., N) of all samples that were asked for, of a closed way with the first once more at its end."""
        return _round(crank) if self.closed and crank.shape[-1] == self.samples else crank

    def spins(self, rotation: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
        """By how much a body turns from each sample with an angle to the next, where that is not what was asked for.

        Asked for is the difference of both angles; one of more than half a turn may be an angle that was wrapped, and less
        whole turns it is as good. Law: a body that turns as its angles say, or as they say unwrapped, spins nowhere.

        ``rotation`` (..., M): continuous, at the crank angles of `there_and_back`, with any offset.

        Returns
        -------
        given : ndarray, shape (G,)
            Samples with an angle, of all that were asked for; G is 0 where the order does not count.
        asked : ndarray, shape (G - 1,)
            In radians.
        turned : ndarray, shape (..., G - 1)
            NaN where the body turns as it should.
        """
        one = self.asked if self.asked is not None and rotation.shape[-1] > self.samples else self
        if one.rotation is None or not self.ordered:
            return np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros((*rotation.shape[:-1], 0))
        given = np.flatnonzero(np.ones(one.samples) if one.rotation_weights is None else one.rotation_weights)
        wanted, places = one.rotation[given], given
        if rotation.shape[-1] > one.samples and 0 in given:  # and on to the first
            places, wanted = np.append(given, one.samples), np.append(wanted, wanted[0])
        asked, turned = np.diff(wanted), np.diff(rotation[..., places], axis=-1)
        extra = np.round((turned - asked) / TURN)
        wrapped = np.where(np.abs(asked) > HALF, -np.round(asked / TURN), 0.0)
        return places, asked, np.where((extra == 0) | (extra == wrapped), np.nan, turned)

    def turned_otherwise(self, rotation: Floats) -> Flags:
        """Whether a body turns otherwise than asked for between two samples, (...); ``rotation`` as of `spins`."""
        return np.asarray(~np.all(np.isnan(self.spins(rotation)[2]), axis=-1))

    def at(self, kept: NDArray[np.intp]) -> Poses:
        """The poses at some samples; their length scale stays."""
        names = ("rotation", "position", "rotation_weights", "position_weights")
        part: dict[str, Any] = {
            name: None if (given := getattr(self, name)) is None else given[kept] for name in names
        }
        return replace(self, **part)

    @cached_property
    def detour(self) -> float:
        """Ratio of the way through the samples in their order to the shortest way that is known.

        Distances combine positions over the length scale and rotations, as the objective does. Each shorter way leads from one of
        the samples to the nearest that is left. The ratio is 1 if a rotation or a position is missing.
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
        """e^{i gamma}; ones without rotations."""
        return np.ones(self.samples, dtype=complex) if self.rotation is None else np.exp(1j * self.rotation)

    @cached_property
    def full(self) -> NDArray[np.intp]:
        """Samples that have both a rotation and a position."""
        given = np.ones(self.samples, dtype=bool)
        for part, weights in ((self.rotation, self.rotation_weights), (self.position, self.position_weights)):
            given &= part is not None if weights is None else weights > 0
        return np.flatnonzero(given)

    def used(self, crank: Floats) -> Target:
        """Crank angles (n, N) and length scale alone: all that limits need to know of the request."""
        return Target(None, None, self.length_scale, crank=crank, found=True, closed=self.closed)

    def timed(self, crank: Floats, rotation: Floats | None) -> Target:
        """The request with crank angles from the first sample, of one linkage or of several.

        Parameters
        ----------
        crank : ndarray, shape (..., N)
            Of all samples that were asked for.
        rotation : ndarray, shape (..., N), or None
            The body's rotation there: those asked for are moved by whole turns to lie nearest to it.
        """
        asked = self if self.asked is None else self.asked
        turns, moved = asked.rotation, np.zeros(1)
        if turns is not None:
            assert rotation is not None
            moved = TURN * np.round((rotation - turns) / TURN)
            turns = turns + moved
        return Target(
            turns,
            asked.position,
            asked.length_scale,
            asked.rotation_weights,
            asked.position_weights,
            crank=crank,
            found=True,
            closed=self.closed,
            moved=moved,
        )


def _round(crank: Floats) -> Floats:
    """Crank angles (..., N), and that of the first sample once more, a turn later."""
    way = np.where(crank[..., -1:] >= crank[..., :1], 1.0, -1.0)
    return np.concatenate([crank, crank[..., :1] + way * TURN], axis=-1)


def spin_faults(poses: Poses, rotation: Floats) -> list[str]:
    """A sentence for the first two samples between which a body turns otherwise than asked for; arguments of `Poses.spins`."""
    places, asked, turned = poses.spins(rotation)
    wrong = np.flatnonzero(~np.isnan(turned))
    if not wrong.size:
        return []
    k = int(wrong[0])
    first, last = (int(place) % (poses.asked or poses).samples + 1 for place in places[k : k + 2])
    degrees = np.rad2deg([turned[k], asked[k]])
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
    """Checked `Poses`; arguments as of `target.make_target`.

    Of a closed way whose last sample repeats the first only the first is searched for, and counts for both.

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
    part, _ = read_samples(
        rotation, position, length_scale, rotation_weights, position_weights, min_samples=MIN_POSES
    )
    if span_max is not None and not MIN_SPAN <= span_max <= TURN * (1 + 1e-12):
        low, high = np.rad2deg([MIN_SPAN, TURN])
        raise FieldError("/crank_span_max", f"wanted {low:g} to {high:g} degrees, found {np.rad2deg(span_max):g}")
    way: dict[str, Any] = {
        "ordered": ordered,
        "closed": closed,
        "span_max": TURN if span_max is None else min(span_max, TURN),
    }
    if closed and len(part["position"]) > MIN_POSES and _returns(Samples(**part)):
        return _without_the_last(Samples(**part), way)
    return Poses(**part, **way)


def _returns(samples: Samples) -> bool:
    """Whether the last sample repeats the first, to rounding."""
    for weights in (samples.rotation_weights, samples.position_weights):
        if weights is not None and min(weights[0], weights[-1]) == 0:
            return False
    assert samples.position is not None
    if abs(samples.position[-1] - samples.position[0]) > 1e-9 * samples.extent:
        return False
    return samples.rotation is None or abs(np.exp(1j * (samples.rotation[-1] - samples.rotation[0])) - 1) < 1e-9


def _without_the_last(samples: Samples, way: dict[str, Any]) -> Poses:
    """The same request without its last sample, whose weight the first takes over."""

    def weights(own: Floats | None) -> Floats:
        every = np.ones(samples.samples) if own is None else own
        return np.concatenate([[every[0] + every[-1]], every[1:-1]])

    assert samples.position is not None
    return Poses(
        rotation=None if samples.rotation is None else samples.rotation[:-1],
        position=samples.position[:-1],
        length_scale=samples.length_scale,
        rotation_weights=None if samples.rotation is None else weights(samples.rotation_weights),
        position_weights=weights(samples.position_weights),
        asked=samples,
        **way,
    )
