"""A rotation request in the form that goes down the tree: directions, a row of each for every window, and weights of pieces.

`docs/method.md`, section 5, derives the formulas. A window is a start and a branch; windows are numbered by all starts of branch
+1, then all starts of branch -1, whose samples lie at the crank angles -(s + t) and turn the other way.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats, Singles
from synthesis.atlas.table import COLUMNS, HARMONICS
from synthesis.atlas.tree import PIECES
from synthesis.target import TURN, Target

STARTS = 360
"""Starts of a window: every whole degree."""
DIRECTIONS = 8
"""Directions along which a request is compared with curves, unless it has fewer samples."""
LONGEST_BEND = np.deg2rad(120.0)
"""Longest span for which the bound by second derivatives is used."""
_DEPENDENT = 1e-7
"""A direction of which the others leave less than this fraction is left out."""
_ROUNDING = 2.0**-23
"""Rounding of a product and its addition in single precision, with as much again for rounded factors."""


@lru_cache(maxsize=1)
def _phases() -> NDArray[np.complex64]:
    """Return e^{ihs} of all starts and harmonics."""
    start = np.arange(STARTS) * (TURN / STARTS)
    return np.exp(1j * np.outer(start, np.arange(1, HARMONICS + 1))).astype(np.complex64)


class RotationRequest:
    """Request matrices for the tree; ``amplitudes`` (HARMONICS,) are the largest of any of its series.

    Attributes
    ----------
    target : ndarray, shape (directions,)
        Components of the centred target.
    rows : ndarray of float32, shape (windows, directions, COLUMNS)
        The product with a series gives the components of its curve in a window.
    weights : ndarray of float32, shape (windows, 2, pieces)
        Factors of squared slopes and of second derivatives in the pieces of the turn from ``first_piece`` (windows,) on.
    spread : float
        Root mean square of the crank angle less its mean.
    rounding : ndarray, shape (2,)
        Bounds of the rounding of the first component and of all others together.
    """

    def __init__(self, target: Target, amplitudes: Floats) -> None:
        assert target.rotation is not None
        mean = target.rotation_mean
        crank, root = target.crank, np.broadcast_to(mean.root, target.samples)
        centred = target.rotation - target.rotation[0]
        centred = centred - mean(centred)
        centred -= mean(centred)  # the first time a large constant leaves its rounding
        along = crank - mean(crank)
        self.spread = float(np.sqrt(mean(along**2)))
        directions = _directions(along * root, centred * root, crank, root)
        self.target: Floats = directions @ (centred * root)
        # the line first, then those in which the target is largest
        order = np.concatenate([[0], 1 + np.argsort(-np.abs(self.target[1:]), kind="stable")])
        self.target, directions = self.target[order], directions[order]
        weighted = directions * root
        factors: Complexes = weighted @ np.exp(1j * np.outer(crank, np.arange(1, HARMONICS + 1)))
        self.rows: Singles = np.zeros((2 * STARTS, len(weighted), COLUMNS), np.float32)
        turned = factors.astype(np.complex64) * _phases()[:, None, :]
        for side in (0, 1):
            part = self.rows[side * STARTS : (side + 1) * STARTS]
            part[:, :, 2::2] = turned.real if side == 0 else -turned.real
            part[:, :, 3::2] = turned.imag
            part[:, :, 0] = weighted @ along
        # the kernel adds up the highest harmonics first, so that the largest terms are rounded least
        terms = np.abs(factors) @ (amplitudes * (2 * np.arange(1, HARMONICS + 1) + 6))
        sizes = _ROUNDING * (terms + 6 * np.abs(weighted @ along))
        sizes += 1e-14 * np.linalg.norm(self.target)
        self.rounding = np.array([sizes[0], np.sqrt(np.sum(sizes[1:] ** 2))])
        self.weights, self.first_piece = _piece_weights(target)


def _directions(line: Floats, target: Floats, crank: Floats, root: Floats) -> Floats:
    """Return orthonormal directions, all orthogonal to a constant: the line, waves, and what they leave of the target."""
    samples, wave = crank.size, crank - crank[0]
    columns = [root, line]
    for harmonic in range(1, DIRECTIONS // 2 + 1):
        columns += [root * np.cos(harmonic * wave), root * np.sin(harmonic * wave)]
    found: list[Floats] = []
    for column in [*columns[:DIRECTIONS], target]:
        remaining, size = column, np.linalg.norm(column)
        for _ in range(2):  # the second time removes the rounding of the first
            for direction in found:
                remaining = remaining - direction * (direction @ remaining)
        if np.linalg.norm(remaining) > _DEPENDENT * size and len(found) < samples:
            found.append(remaining / np.linalg.norm(remaining))
    return np.array(found[1:]).reshape(-1, samples)


def _piece_weights(target: Target) -> tuple[Singles, NDArray[np.int32]]:
    """Integrate the kernels of both bounds over the pieces of the turn, for every window."""
    order = np.argsort(target.crank, kind="stable")
    crank, mean = target.crank[order], target.rotation_mean
    weight = np.broadcast_to(mean.root, crank.size)[order] ** 2
    low, high, gap = crank[0], crank[-1], np.diff(crank)
    u = crank - low
    before, moment, square = (np.cumsum(weight * u**power) for power in (0, 1, 2))
    slope = before[:-1] * (moment[-1] - moment[:-1]) - (before[-1] - before[:-1]) * moment[:-1]
    slope = np.maximum(slope, 0.0)
    slope_integral = np.concatenate([[0.0], np.cumsum(slope * gap)])
    # norm of what constant and line leave of max(t - u, 0); convex between samples, so chords are above it
    after, after_moment, after_square = (total[-1] - total for total in (before, moment, square))
    first = after_moment - u * after
    centre = moment[-1]
    spread = max(square[-1] - centre**2, 1e-300)
    along = (after_square - u * after_moment) - centre * first
    norm = after_square - 2 * u * after_moment + u**2 * after - first**2 - along**2 / spread
    norm = np.sqrt(np.maximum(norm, 0.0)) + 1e-7 * (high - low)
    bend_integral = np.concatenate([[0.0], np.cumsum((norm[1:] + norm[:-1]) / 2 * gap)])

    def bend(position: Floats) -> Floats:
        interval = np.clip(np.searchsorted(crank, position, side="right") - 1, 0, crank.size - 2)
        inside = np.clip(position - crank[interval], 0.0, gap[interval])
        rise = (norm[interval + 1] - norm[interval]) / gap[interval]
        return bend_integral[interval] + norm[interval] * inside + rise * inside**2 / 2

    start, piece = np.arange(STARTS) * (TURN / STARTS), TURN / PIECES
    begin = np.concatenate([start + low, -(start + high)])
    first_piece = np.floor(begin / piece + 1e-9).astype(np.int64)
    count = int(np.ceil((high - low) / piece - 1e-9)) + 1
    edges = (first_piece[:, None] + np.arange(count + 1)) * piece
    inside: Any = edges - np.tile(start, 2)[:, None]
    inside[STARTS:] = -edges[STARTS:] - start[:, None]
    slopes = np.abs(np.diff(np.interp(inside, crank, slope_integral), axis=1))
    bends = np.abs(np.diff(bend(inside), axis=1))
    if high - low > LONGEST_BEND:
        bends[:] = 1e6
    if count > PIECES:  # the window covers some pieces more than once
        first_piece[:] = np.floor(begin / piece + 1e-9)
        turns = -(-count // PIECES)
        padded = np.pad(np.stack([slopes, bends], axis=1), ((0, 0), (0, 0), (0, turns * PIECES - count)))
        slopes, bends = np.moveaxis(padded.reshape(len(begin), 2, turns, PIECES).sum(axis=2), 1, 0)
    weights = (np.stack([slopes, bends], axis=1) * (1 + 1e-5)).astype(np.float32)
    return np.ascontiguousarray(weights), (first_piece % PIECES).astype(np.int32)
