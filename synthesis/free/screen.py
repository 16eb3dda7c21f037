"""Starting points for paths: a coarse table of types against guessed crank angles, all windows in one matrix product.

Of e^{i theta2} each type has a short series, c_k for harmonics k. At guessed crank angles t the best A and z1 are projected
out of the harmonics, with the positions p: F = Q e^{ikt}, y = Q p, Q off {1, e^{it}}. A window that starts at s has the series
v_k = c_k e^{iks}, and with the best z2 it leaves

    |y|^2 - |v . F y*|^2 / |v R*|^2,      R from the QR decomposition of F*
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.joint import Timed
from synthesis.free.poses import Poses
from synthesis.mechanism import Chart, Mechanism
from synthesis.fourbar.charts import FullCrankChart
from synthesis.target import TURN

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_STARTS, _SAMPLES, _HARMONICS = 18, 64, 6


class Guess(NamedTuple):
    """Guessed crank angles from the first sample on, (N,)."""

    angles: Floats


class Windows(NamedTuple):
    """Types at starts for guesses, best first."""

    cost: Floats
    type: NDArray[np.intp]
    branch: Floats
    start: Floats
    guess: NDArray[np.intp]


class PathScreen:
    """Types of a mechanism with their series, prepared once.

    Parameters
    ----------
    mechanism : Mechanism
    lengths : ndarray, shape (T, d)
        Types whose crank turns fully.
    """

    def __init__(self, mechanism: Mechanism, lengths: Floats) -> None:
        self.lengths = lengths
        crank = np.arange(_SAMPLES) * (TURN / _SAMPLES)
        phasor = np.exp(1j * mechanism.body_angle(lengths, np.ones(len(lengths)), crank))
        spectrum = np.fft.fft(phasor, axis=1) / _SAMPLES
        self.harmonics = np.arange(-_HARMONICS, _HARMONICS + 1)
        series = spectrum[:, self.harmonics]
        start = np.arange(_STARTS) * (TURN / _STARTS)
        shift = np.exp(1j * start[:, None] * self.harmonics)
        # branch -1 turns like the mirror image of branch +1: conjugate coefficients
        windows = np.stack([one[:, None, :] * shift for one in (series, np.conj(series))], axis=1)
        self.start = start
        self.windows = np.concatenate([windows.real, windows.imag], axis=-1).reshape(-1, 2 * self.harmonics.size)
        self.windows = np.ascontiguousarray(self.windows, dtype=np.float32)

    def errors(self, poses: Poses, guesses: Floats) -> Floats:
        """Squared position errors over l^2, approximately, (guesses, T, 2, starts): branch +1, then -1."""
        root = np.broadcast_to(poses.position_mean.root, poses.samples)
        columns = np.exp(1j * guesses[:, :, None] * np.array([0, 1]))
        basis = np.linalg.qr(columns * root[:, None])[0]
        off = np.exp(1j * guesses[:, :, None] * self.harmonics) * root[:, None]
        off = off - basis @ (np.conj(basis).transpose(0, 2, 1) @ off)
        own = np.broadcast_to((poses.scaled * root)[:, None], (*guesses.shape, 1))
        own = own - basis @ (np.conj(basis).transpose(0, 2, 1) @ own)
        toward = np.einsum("gnk,gno->gk", off, np.conj(own))
        triangle = np.linalg.qr(off, mode="r")  # (g, m, K)
        # v . toward, and the norm of sum_k v_k off_k, as real products
        wide = np.concatenate([toward[:, None, :], triangle], axis=1)
        count, rows, size = wide.shape
        real = np.concatenate([wide.real, -wide.imag], axis=2)
        imag = np.concatenate([wide.imag, wide.real], axis=2)
        right = np.stack([real, imag], axis=2).reshape(count * rows * 2, 2 * size).astype(np.float32)
        values = (right @ self.windows.T).reshape(count, rows, 2, -1)
        squares = np.einsum("grcw,grcw->grw", values, values)
        below = squares[:, 1:].sum(axis=1)
        total = np.sum(np.abs(own[:, :, 0]) ** 2, axis=1)
        error = total[:, None] - squares[:, 0] / np.maximum(below, 1e-8)
        return np.maximum(error, 0.0).reshape(count, len(self.lengths), 2, -1)


    def seeds(self, poses: Poses, chart: Chart, most: int) -> Timed:
        return seeds(self, poses, chart, spans_and_powers(poses, np.deg2rad([35, 60, 95, 140, 190, 245, 300, 345.0]), np.array([1, 0.6])), 60, most)


def spans_and_powers(poses: Poses, spans: Floats, powers: Floats) -> Floats:
    """Guesses of the crank angles: evenly along the way of the samples, and more so the smaller the power, both directions."""
    steps = np.abs(np.diff(poses.scaled))
    steps = np.maximum(steps, 1e-3 * max(float(steps.max()), 1e-300))
    guesses = []
    for power in powers:
        way = np.concatenate([[0.0], np.cumsum(steps**power)])
        guesses += [sign * span * way / way[-1] for span in spans for sign in (1.0, -1.0)]
    return np.array(guesses)


def seeds(screen: PathScreen, poses: Poses, chart, guesses: Floats, each: int, most: int) -> Timed:
    error = screen.errors(poses, guesses)
    best = error.argmin(axis=3)
    least = np.take_along_axis(error, best[..., None], 3)[..., 0].reshape(len(guesses), -1)
    order = np.argpartition(least, each, axis=1)[:, :each]
    g = np.repeat(np.arange(len(guesses)), each)
    flat = order.ravel()
    cost = least[g, flat]
    kind, side = np.divmod(flat, 2)
    start = screen.start[best[g, kind, side]]
    x = FullCrankChart().unknowns(screen.lengths)[kind]
    span = guesses[g, -1]
    rank = np.argsort(cost, kind="stable")
    cells = np.floor(np.column_stack([x[rank] / [0.7, 1, 1], start[rank] / 0.6, span[rank] / 0.6])).astype(np.int64)
    key = ((cells + 64) @ (1 << 8 * np.arange(5))) * 2 + side[rank]
    _, first = np.unique(key, return_index=True)
    pick = rank[np.sort(first)[:most]]
    n = pick.size
    x = chart.unknowns(screen.lengths)[kind]
    return Timed(
        x[pick], np.zeros((n, 3), complex), np.zeros(n), start[pick, None] + guesses[g[pick]], 1.0 - 2.0 * side[pick]
    )
