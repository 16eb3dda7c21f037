"""What one request multiplies the series of a table with, to get errors of windows and bounds of them.

All groups of `series` share what a request gives: its means <f e^{iht}> over the samples, for all harmonics h at once, times
the phases e^{ihs} of the starts, which no request changes. A matrix has one row a window: branch +1 at all starts, then
branch -1 if there is one. Formulae and bounds are those of `scan`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.series import Complexes, Floats, Ints, Phasors, SeriesGroup, gather
from synthesis.pose import fixed_columns
from synthesis.target import TURN, Mean, Target

ROUNDING = 1e-13
"""Rounding of a mean squared rotation error, for a target of variance 1."""
_HARMONICS_AT_ONCE = 16


def start_angles(starts: int) -> Floats:
    """theta1 of evenly spaced starts, radians."""
    return np.arange(starts, dtype=float) * (TURN / starts)


@lru_cache(maxsize=8)
def _phases(highest: int, starts: int) -> Complexes:
    """e^{ihs} for all starts and h = 0 .. highest."""
    phases = np.exp(1j * np.outer(start_angles(starts), np.arange(highest + 1)))
    phases.flags.writeable = False
    return phases


class Matrices:
    """What one request multiplies the series of an atlas with; what groups share is made once, when first asked for.

    ``highest``: highest harmonic of any series or square. ``branches``: of the mechanism: 2, or 1.
    """

    def __init__(self, target: Target, highest: int, starts: int, branches: int = 2) -> None:
        self.target = target
        self.branches = branches
        self.highest = highest
        self.starts = starts
        blocks = -(-(highest + 1) // _HARMONICS_AT_ONCE)
        coarse = np.exp(1j * np.outer(_HARMONICS_AT_ONCE * np.arange(blocks), target.crank))
        self._coarse = {mean.total: coarse / mean.total for mean in (target.rotation_mean, target.position_mean)}
        self._fine = np.exp(1j * np.outer(target.crank, np.arange(_HARMONICS_AT_ONCE)))
        self._averages: dict[int | None, Floats] = {}
        self._along: dict[int, tuple[Floats, Floats]] = {}
        self._position: dict[int, PositionMatrices] = {}

    def means(self, values: NDArray[Any], mean: Mean) -> Complexes:
        """<f e^{iht}> over the samples for values f of them, h = 0 .. highest."""
        return ((self._coarse[mean.total] * mean.weighted(values)) @ self._fine).ravel()[: self.highest + 1]

    @cached_property
    def phases(self) -> Complexes:
        """e^{ihs}, (starts, highest + 1)."""
        return _phases(self.highest, self.starts)

    def _of_branches(self, shifted: Complexes, sign: int = 1) -> Complexes:
        """What a series is multiplied with to give its mean, for all starts of all branches.

        A mirrored window has the increments -t and the starts -s, and the target ``sign`` times the one that the means are
        of: that conjugates every term.
        """
        return np.concatenate([shifted, sign * np.conj(shifted)][: self.branches])

    def average(self, mean: Mean) -> Floats:
        """For the mean of a series, cosine and sine side by side, (windows, 2 highest)."""
        key = None if mean.weights is None else id(mean)
        if key not in self._averages:
            means = self.means(np.ones(self.target.samples), mean)
            self._averages[key] = self._of_branches(self.phases[:, 1:] * means[1:]).view(float)
        return self._averages[key]

    def _times(self, values: Floats) -> Floats:
        """For the mean of a series times values of the samples, (windows, 2 harmonics), of half of all harmonics."""
        harmonics = self.highest // 2 + 1
        means = self.means(values, self.target.rotation_mean)
        return self._of_branches(self.phases[:, 1:harmonics] * means[1:harmonics], -1).view(float)

    def _turned(self, winding: int) -> tuple[Floats, Floats]:
        """The centred target less the winding, and what series are multiplied with for the mean of their product with it."""
        if winding not in self._along:
            assert self.target.rotation is not None
            rotation = self.target.rotation - winding * self.target.crank
            mean = self.target.rotation_mean
            centred = rotation - mean(rotation)
            centred -= mean(centred)  # a large constant leaves a mean of its rounding at the first time
            self._along[winding] = centred, self._times(centred)
        return self._along[winding]

    @cached_property
    def _line(self) -> tuple[Floats, Floats]:
        """The crank angle, centred and of mean square 1, and what series are multiplied with for their slope over it."""
        mean = self.target.rotation_mean
        line = self.target.crank - mean(self.target.crank)
        line /= np.sqrt(mean(line**2))
        return line, self._times(line)

    def rotation(self, group: SeriesGroup) -> RotationMatrix:
        """For the mean squared rotation error."""
        harmonics, mean = 2 * group.harmonics, self.target.rotation_mean
        centred, along = self._turned(group.winding)
        line, slopes = self._line
        return RotationMatrix(
            np.concatenate([self.average(mean)[:, : 2 * harmonics], -2 * along[:, :harmonics]], axis=1),
            float(mean(centred**2)),
            np.ascontiguousarray(slopes[:, :harmonics]),
            float(mean(centred * line)),
        )

    def position(self, harmonics: int) -> PositionMatrices:
        """For the mean squared position error of phasors of some harmonics."""
        if harmonics not in self._position:
            ahead, behind, size = self._position_means
            turn = self.phases[:, np.abs(np.arange(-harmonics, harmonics + 1))]
            turn = np.concatenate([np.conj(turn[:, :harmonics]), turn[:, harmonics:]], axis=1)
            columns = []
            for forward, backward in zip(ahead, behind):
                shifted = turn * np.concatenate([backward[harmonics:0:-1], forward[: harmonics + 1]])
                columns.append(self._of_branches(shifted))
            self._position[harmonics] = PositionMatrices(
                np.stack(columns), self.average(self.target.position_mean)[:, : 4 * harmonics], size
            )
        return self._position[harmonics]

    @cached_property
    def _position_means(self) -> tuple[list[Complexes], list[Complexes], float]:
        """<conj(c) e^{iht}> and its counterpart at -h for three columns c, and the norm of the rest.

        The columns are the fixed parts {1, e^{it}} made orthonormal, and the positions over l that are left, made a unit.
        """
        mean, fixed = self.target.position_mean, fixed_columns(self.target)
        size = float(np.sqrt(mean(np.abs(fixed.rest) ** 2)))
        columns = [fixed.one, fixed.turned, fixed.rest / size if size > 0 else fixed.rest]
        ahead = [self.means(np.conj(c), mean) for c in columns]
        return ahead, [np.conj(self.means(c, mean)) for c in columns], size


@dataclass(frozen=True)
class RotationMatrix:
    """What the series of types are multiplied with to give mean squared errors and slopes, one row a window.

    ``columns`` (windows, 6H): the means over p^2 (4H), then -2 times those over p times the target (2H). ``variance``:
    of the target. ``slopes`` (windows, 2H): the means over p times the line. ``slope``: the mean of the target times
    the line.
    """

    columns: Floats
    variance: float
    slopes: Floats
    slope: float

    @property
    def rounding(self) -> float:
        """Rounding of a mean squared error."""
        return ROUNDING * (1 + self.variance)

    def mean_square_error(self, group: SeriesGroup, part: slice) -> Floats:
        """D of all windows of some types, (n, windows)."""
        result = self._error(group.series[part], self.columns.T)
        result += (group.mean_square[part] + self.variance)[:, None]
        return result

    def of_windows(self, series: Floats, windows: Ints) -> Floats:
        """D, less the type's ``mean_square`` and the variance, of some windows of some groups of types.

        ``series`` (groups, types, 6H). ``windows`` (groups, windows).

        Shape (groups, types, windows).
        """
        return self._error(series, gather(self.columns, windows).transpose(0, 2, 1))

    def of_pairs(self, series: Floats, windows: Ints) -> Floats:
        """The same of one window of each of some types; (n, 6H) and (n,) to (n,)."""
        return self._error(series[:, None], gather(self.columns, windows)[:, :, None])[:, 0, 0]

    def slopes_of_windows(self, periodic: Floats, windows: Ints) -> Floats:
        """Distance of a type's slope from the target's, shaped as by `of_windows`; ``periodic`` (groups, types, 2H).

        The slope is the mean of a curve times a line of mean 0 and mean square 1, so by Cauchy and Schwarz no error is
        less than this.
        """
        result = periodic @ gather(self.slopes, windows).transpose(0, 2, 1)
        result -= self.slope
        return np.abs(result, out=result)

    def _error(self, series: Floats, columns: Floats) -> Floats:
        third = columns.shape[-2] // 3  # the means over p itself are the first third of the rows, those up to H
        result = series @ columns
        mean = series[..., 2 * third :] @ columns[..., :third, :]
        np.multiply(mean, mean, out=mean)
        result -= mean
        return result


@dataclass(frozen=True)
class PositionMatrices:
    """What phasors are multiplied with, to bound the mean squared position error (over l^2)."""

    columns: Complexes
    """(3, windows, 2K + 1): for the inner products with the two fixed parts and with the unit of the rest."""
    modulus: Floats
    size: float

    @cached_property
    def rows(self) -> Complexes:
        """All three with one column a window, side by side: as a whole they make a faster product."""
        return np.ascontiguousarray(self.columns.reshape(-1, self.columns.shape[-1]).T)

    def mean_square_error(self, phasors: Phasors, part: Any) -> Floats:
        """Lower bounds of the mean squared position error over l^2, (n, windows)."""
        along = np.split(phasors.series[part] @ self.rows, 3, axis=1)
        whole = phasors.modulus_mean[part][:, None] + phasors.modulus[part] @ self.modulus.T
        return self._bound(along, whole, phasors.error[part][:, None])

    def of_windows(self, phasors: Phasors, places: Ints, windows: Ints) -> Floats:
        """The same of some windows of some groups of types, (groups, types, windows).

        ``places`` (groups, types). ``windows`` (groups, windows).
        """
        series = gather(phasors.series, places)
        along = [series @ gather(columns, windows).transpose(0, 2, 1) for columns in self.columns]
        modulus = gather(self.modulus, windows).transpose(0, 2, 1)
        whole = phasors.modulus_mean[places][..., None] + phasors.modulus[places] @ modulus
        return self._bound(along, whole, phasors.error[places][..., None])

    def _bound(self, along: list[Complexes], whole: Floats, error: Floats) -> Floats:
        first, second, rest = (product.real**2 + product.imag**2 for product in along)
        square = np.maximum(whole - first - second, 1e-30)
        left = np.sqrt(np.maximum(1.0 - rest / square - 1e-14 / square, 0.0))
        norm = np.maximum(np.sqrt(square) - error - 1e-8, 1e-30)
        return (self.size * np.maximum(left - error / norm, 0.0)) ** 2
