"""Starting points for paths: a coarse table of types against guessed crank angles, all windows in a single matrix product.

Each type has a short series of e^{i theta2}, c_k for harmonics k. At guessed crank angles t the best A and z1 are projected
out of the harmonics, with the positions p: F = Q e^{ikt}, y = Q p, Q projecting off {1, e^{it}}. A window that starts at s has
the series v_k = c_k e^{iks}, and with the best z2 the remaining error is

    |y|^2 - |v . F y*|^2 / |v R*|^2,      R from the QR decomposition of F*
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from synthesis.arrays import Floats
from synthesis.descents import Timed
from synthesis.four_bar import coupler_angle, grashof_excesses
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.limits import in_family
from synthesis.mechanism import Chart
from synthesis.poses import Poses
from synthesis.search.seeds import first_in_cells
from synthesis.target import TURN


@dataclass(frozen=True)
class ScreenOptions:
    """Options of the screen of paths."""

    perimeter: int = 28
    """Sum of the lengths of a type."""
    starts: int = 18
    """Number of starts of each type."""
    samples: int = 64
    """Number of crank angles from which a series is computed."""
    harmonics: int = 6
    """Largest harmonic of a series."""
    each: int = 60
    """Number of types and branches that seeds take from each guess."""
    closed_powers: tuple[float, ...] = (1.0, 0.8, 0.6, 0.4, 0.2)
    """Powers of the distance between samples of a closed path."""
    together: int = 8
    """Number of guesses that are compared together: all products would take hundreds of megabytes."""
    missing_weight: float = 3.0
    """Weight of the squared transmission angle in radians that a window lacks, beside J squared."""
    crank_cell: float = 0.7
    """Difference of the logarithm of crank over ground above which two seeds differ."""
    start_cell: float = 0.6
    """Difference of start above which two seeds differ."""
    span_cell: float = 0.6
    """Difference of span above which two seeds differ."""
    span_fraction: float = 0.95
    """Fraction of the largest allowed span that a guess may use."""
    spans: tuple[float, ...] = tuple(np.deg2rad([35, 60, 95, 140, 190, 245, 300, 345]))
    """Guessed crank angles from the first sample to the last, in radians; each is tried in both directions."""
    powers: tuple[float, ...] = (1.0, 0.6)
    """Powers of the distance between samples of an open path: at 1 the crank turns with the distance of the point."""
    seeds: int = 600
    """Largest number of seeds."""


OPTIONS = ScreenOptions()


Missing = Callable[[Floats, Floats, Floats], Floats]
"""Function that returns the violation of limits on shape by lengths (..., d) while the crank turns between two angles (...)."""


class PathScreen:
    """Types of four-bars whose crank turns fully, with their series, prepared once.

    Parameters
    ----------
    family : str
        Family of `limits.FAMILIES`.
    """

    def __init__(self, family: str) -> None:
        lengths = enumerate_types(TypeRule(OPTIONS.perimeter, 1, OrderRule.FULL_CRANK)).astype(float)
        self.lengths = lengths = lengths[in_family(family, lengths)]
        self.cells = _coordinates(lengths)
        crank = np.linspace(0.0, TURN, OPTIONS.samples, endpoint=False)
        phasor = np.exp(1j * coupler_angle(lengths, np.ones(len(lengths)), crank))
        spectrum = np.fft.fft(phasor, axis=1) / OPTIONS.samples
        self.harmonics = np.arange(-OPTIONS.harmonics, OPTIONS.harmonics + 1)
        series = spectrum[:, self.harmonics]
        start = np.arange(OPTIONS.starts) * (TURN / OPTIONS.starts)
        shift = np.exp(1j * start[:, None] * self.harmonics)
        # branch -1 turns like the mirror image of branch +1: conjugate coefficients
        windows = np.stack([window[:, None, :] * shift for window in (series, np.conj(series))], axis=1)
        self.start: Floats = start.astype(float)
        self.windows = np.concatenate([windows.real, windows.imag], axis=-1).reshape(-1, 2 * self.harmonics.size)
        self.windows = np.ascontiguousarray(self.windows, dtype=np.float32)

    def errors(self, poses: Poses, guesses: Floats) -> Floats:
        """J squared, approximately, (guesses, T, 2, starts): branch +1, then -1; of rotations by the chords of their errors."""
        return np.concatenate(
            [self._errors(poses, guesses[k : k + OPTIONS.together]) for k in range(0, len(guesses), OPTIONS.together)]
        )

    def _errors(self, poses: Poses, guesses: Floats) -> Floats:
        root = np.broadcast_to(poses.position_mean.root, poses.samples)
        columns = np.exp(1j * guesses[:, :, None] * np.array([0, 1]))
        basis = np.linalg.qr(columns * root[:, None])[0]
        turned = np.exp(1j * guesses[:, :, None] * self.harmonics)
        off = turned * root[:, None]
        off = off - basis @ (np.conj(basis).transpose(0, 2, 1) @ off)
        own = np.broadcast_to((poses.scaled * root)[:, None], (*guesses.shape, 1))
        own = own - basis @ (np.conj(basis).transpose(0, 2, 1) @ own)
        toward = np.einsum("gnk,gno->gk", off, np.conj(own))
        triangle = np.linalg.qr(off, mode="r")  # (g, m, K)
        # v . toward, and the norm of sum_k v_k off_k, as real products; and with rotations v . mean(turned e^{-i gamma})
        rows = [toward[:, None, :], triangle]
        if poses.rotation is not None:
            rows.insert(0, poses.rotation_mean((turned * np.conj(poses.turned)[:, None]).transpose(0, 2, 1))[:, None])
        wide = np.concatenate(rows, axis=1)
        count, height, size = wide.shape
        real = np.concatenate([wide.real, -wide.imag], axis=2)
        imag = np.concatenate([wide.imag, wide.real], axis=2)
        right = np.stack([real, imag], axis=2).reshape(count * height * 2, 2 * size).astype(np.float32)
        values = (right @ self.windows.T).reshape(count, height, 2, -1)
        squares = np.einsum("grcw,grcw->grw", values, values)
        aligned = squares[:, 0] if poses.rotation is not None else None
        squares = squares[:, len(rows) - 2 :]
        total = np.sum(np.abs(own[:, :, 0]) ** 2, axis=1)
        error = np.maximum(total[:, None] - squares[:, 0] / np.maximum(squares[:, 1:].sum(axis=1), 1e-8), 0.0)
        if aligned is not None:
            error += 2 * np.maximum(1 - np.sqrt(aligned), 0.0)
        return error.reshape(count, len(self.lengths), 2, -1)

    def seeds(self, poses: Poses, chart: Chart, missing: Missing | None = None) -> Timed:
        """Return starting points for a path, best first, at most one in each cell of shape, start, span and branch.

        For each type, branch and guess only the best start counts, and for each guess the best few types and branches,
        since the errors of different guesses do not show which guess is right.

        Parameters
        ----------
        poses : Poses
        chart : Chart
            Chart of the shapes of the candidates.
        missing : callable, optional
            Violation of the limits on shape and crank angles by windows, in radians.
        """
        guesses = self.timing_of(poses)
        error = self.errors(poses, guesses)
        if missing is not None:
            spans, which = np.unique(guesses[:, -1], return_inverse=True)
            short: Floats = missing(self.lengths[:, None], self.start, self.start + spans[:, None, None])
            error += (OPTIONS.missing_weight * short**2).astype(np.float32)[which][:, :, None]
        best = error.argmin(axis=3)
        smallest = np.take_along_axis(error, best[..., None], 3)[..., 0].reshape(len(guesses), -1)
        each = min(OPTIONS.each, smallest.shape[1] - 1)
        guess = np.repeat(np.arange(len(guesses)), each)
        window = np.argpartition(smallest, each, axis=1)[:, :each].ravel()
        rank = np.argsort(smallest[guess, window], kind="stable")
        guess, window = guess[rank], window[rank]
        kind, side = np.divmod(window, 2)
        start, span = self.start[best[guess, kind, side]], guesses[guess, -1]
        coordinates = np.column_stack([self.cells[kind], start / OPTIONS.start_cell, span / OPTIONS.span_cell, side])
        pick = first_in_cells(coordinates)[: OPTIONS.seeds]
        return Timed(
            chart.unknowns(self.lengths[kind[pick]]),
            np.zeros((pick.size, 3), dtype=complex),
            np.zeros(pick.size),
            start[pick, None] + guesses[guess[pick]],
            1.0 - 2.0 * side[pick],
        )

    def timing_of(self, poses: Poses) -> Floats:
        """Guesses of the crank angles from the first sample on, (guesses, N); of a closed way all pass it once in a turn."""
        widest = OPTIONS.span_fraction * poses.span_max
        spans = {TURN} if poses.closed else {min(span, widest) for span in OPTIONS.spans}
        powers = OPTIONS.closed_powers if poses.closed else OPTIONS.powers
        progressions = (way_along(poses, power) for power in powers)
        return _within(
            np.array(
                [
                    sign * span * progression
                    for progression in progressions
                    for span in sorted(spans)
                    for sign in (1.0, -1.0)
                ]
            ),
            widest,
        )


def _coordinates(lengths: Floats) -> Floats:
    """Return coordinates (T, 3) of types; seeds in different unit cells differ."""
    a, b, c = grashof_excesses(lengths)
    crank, ground = lengths[:, 0], lengths[:, 3]
    side = np.where(crank > ground, -0.5, 0.5)
    logarithms = [np.log(crank / ground) / OPTIONS.crank_cell, np.log(c / (crank + ground)), side * np.log(a / b)]
    return np.stack(logarithms, axis=1)


@cache
def path_screen(family: str) -> PathScreen:
    """Return the screen of a family, which the first call makes."""
    return PathScreen(family)


def _within(crank: Floats, widest: float) -> Floats:
    """Return crank angles (n, N) from zero, scaled down if they exceed the allowed span."""
    return np.asarray(crank * np.minimum(1.0, widest / np.abs(crank[:, -1:])))


def way_along(poses: Poses, power: float) -> Floats:
    """Return the strictly increasing relative distance (N,) of the samples along the path; a closed path ends at the first.

    Parameters
    ----------
    poses : Poses
    power : float
        Exponent of the distance between neighbouring samples.
    """
    progress = np.cumsum(_steps(poses) ** power)
    return np.concatenate([[0.0], progress[: poses.samples - 1]]) / progress[-1]


def _steps(poses: Poses) -> Floats:
    """Distances between neighbouring samples, none of them zero, (N - 1,); of a closed way the last to the first too, (N,)."""
    steps = np.abs(np.diff(poses.scaled, append=poses.scaled[:1] if poses.closed else []))
    return np.maximum(steps, 1e-3 * max(float(steps.max()), 1e-300))
