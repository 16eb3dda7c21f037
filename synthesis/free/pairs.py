"""Four-bars from pairs of dyads: crank and rocker guide the body by one dyad each, and the crank angles follow."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.dyads import Body, Dyads
from synthesis.target import TURN

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

_EVEN = 0.3
"""Part of the way from angles that were put in order to evenly spaced ones."""
_SHORTEST = 1e-9
"""A link below this part of the length scale is none."""


class Pairs(NamedTuple):
    """Four-bars whose first dyad is the crank's; lengths over the length scale."""

    lengths: Floats
    """(n, 4): crank, coupler, rocker, ground."""
    branch: Floats
    """(n,): that of most samples."""
    one_branch: Flags
    """(n,): whether all samples lie on it."""
    angles: Floats
    """(n, N): theta1 at the samples, in (-pi, pi]."""
    pose: Complexes
    """(n, 3): A, z1, z2."""
    offset: Floats
    """(n,): of the rotation."""

    def take(self, places: Any) -> Pairs:
        """Some of them."""
        columns: Any = (column[places] for column in self)
        return Pairs(*columns)


def pairs_of(body: Body, dyads: Dyads) -> Pairs:
    """All ordered pairs of dyads as four-bars."""
    count = dyads.radius.size
    crank, rocker = (index.ravel() for index in np.indices((count, count)))
    crank, rocker = crank[crank != rocker], rocker[crank != rocker]
    coupler = dyads.body[rocker] - dyads.body[crank]
    ground = dyads.fixed[rocker] - dyads.fixed[crank]
    lengths = np.stack([dyads.radius[crank], np.abs(coupler), dyads.radius[rocker], np.abs(ground)], axis=1)
    some = np.min(lengths, axis=1) > _SHORTEST
    crank, rocker, coupler, ground, lengths = (part[some] for part in (crank, rocker, coupler, ground, lengths))
    pins = body.places(dyads.body)
    arms = pins - dyads.fixed[:, None]
    turn = np.angle(ground)
    angles = np.angle(arms[crank] * np.exp(-1j * turn)[:, None])
    diagonal = dyads.fixed[rocker, None] - pins[crank]
    side = (np.conj(diagonal) * (pins[rocker] - pins[crank])).imag
    branch = np.where(np.sum(side > 0, axis=1) * 2 >= side.shape[1], 1.0, -1.0)
    offset = turn - np.angle(coupler)
    pose = np.stack(
        [dyads.fixed[crank], lengths[:, 0] * np.exp(1j * turn), -dyads.body[crank] * np.exp(1j * offset)], axis=1
    )
    return Pairs(lengths, branch, np.all(side * branch[:, None] > 0, axis=1), angles, pose, offset)


def in_order(angles: Floats, span_max: float = TURN) -> tuple[Floats, Flags]:
    """Crank angles (n, N) made continuous in the direction that passes the samples in their order, and which do so.

    Returns
    -------
    angles : ndarray, shape (n, N)
        Rising or falling strictly where the order holds.
    holds : ndarray of bool, shape (n,)
        Whether the crank passes the samples one way within ``span_max``.
    """
    steps = np.diff(angles, axis=1)
    ahead = steps % TURN
    back = -((-steps) % TURN)
    rising = ahead.sum(axis=1) <= -back.sum(axis=1)
    way = np.where(rising[:, None], ahead, back)
    total = np.abs(way.sum(axis=1))
    straight = np.concatenate([angles[:, :1], angles[:, :1] + np.cumsum(way, axis=1)], axis=1)
    return straight, np.all(way != 0, axis=1) & (total < min(span_max, TURN) * (1 + 1e-12))


def in_any_order(angles: Floats, span_max: float) -> tuple[Floats, Flags]:
    """Crank angles (n, N) on the shortest arc that holds all, and for which that is short enough."""
    within = np.sort(angles % TURN, axis=1)
    gaps = np.diff(np.concatenate([within, within[:, :1] + TURN], axis=1), axis=1)
    largest = gaps.argmax(axis=1)
    begin = np.take_along_axis(within, ((largest + 1) % within.shape[1])[:, None], 1)
    along = begin + (angles - begin) % TURN
    along -= TURN * np.round(along[:, :1] / TURN)
    return along, TURN - gaps.max(axis=1) <= span_max * (1 + 1e-12)


def put_in_order(angles: Floats, span_max: float = TURN) -> Floats:
    """Crank angles (n, N) near the given ones that rise or fall strictly within the span: starting points for noisy samples.

    Neighbours are taken to be less than half a turn apart, and an angle that steps back is put just after its neighbour.
    """
    steps = np.diff(angles, axis=1)
    steps -= TURN * np.round(steps / TURN)
    way = np.where(steps.sum(axis=1, keepdims=True) >= 0, 1.0, -1.0)
    along = np.concatenate([np.zeros((len(angles), 1)), np.cumsum(way * steps, axis=1)], axis=1)
    rising, falling = np.maximum.accumulate(along, axis=1), np.minimum.accumulate(along[:, ::-1], axis=1)[:, ::-1]
    along = (rising + falling) / 2
    # room between neighbours: an angle may move by less than the gap in a step
    even = np.linspace(0.0, 1.0, angles.shape[1]) * np.maximum(along[:, -1:] - along[:, :1], 1e-3)
    along += _EVEN * (along[:, :1] + even - along)
    along *= np.minimum(1.0, 0.98 * min(span_max, TURN) / (along[:, -1:] - along[:, :1]))
    return angles[:, :1] + way * along
