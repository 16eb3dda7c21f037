"""The best rows of an atlas as they are: mounted, within limits, different from one another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from synthesis.atlas.scan import Floats, Scan, ScanReport, Windows, window_angles, window_errors
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.pose import fit_positions
from synthesis.fourbar.solution import Solution, distinct, make_solutions
from synthesis.target import Target

MAX_LIMITED_WINDOWS = 1 << 18
"""Windows evaluated before a search within limits gives up; the report then says that it is not exhaustive."""
MAX_LIMITED_SAMPLES = 1 << 22
"""The same in samples of all windows: a request of 1,024 samples takes no longer than one of 16."""


def best_rows(
    scan: Scan, target: Target, limits: Limits, top: int, expired: Callable[[], bool] = lambda: False
) -> tuple[list[Solution], ScanReport]:
    """The best rows by the joint objective over rotation and position.

    Parameters
    ----------
    scan : Scan
    target : Target
    limits : Limits
    top : int
    expired : callable
        True ends the scan with the best found so far.

    Returns
    -------
    solutions : list of Solution
        At most ``top``, by objective; each linkage once, at its best start. Empty where no row keeps the limits.
    report : ScanReport
    """

    def exact(windows: Windows) -> Floats:
        error = window_errors(scan.lengths, target, windows)
        return np.where(_within(scan, target, limits, windows), error, np.inf)

    if not _any_row_of(limits.family, scan):
        return [], ScanReport(scan.windows, 0, True)
    most = MAX_LIMITED_WINDOWS
    if not limits.only_family:
        most = min(most, MAX_LIMITED_SAMPLES // target.samples)
    wanted = top
    while True:
        windows, report = scan.best(target, wanted, exact, most, expired)
        chosen = windows.take(_first_of_each(target, windows))
        lengths, start = scan.lengths[chosen.row], np.deg2rad(chosen.start)
        solutions = distinct(make_solutions(target, lengths, chosen.branch, start, chosen.row.tolist()), top)
        complete = len(windows.row) < wanted or not report.exhaustive
        if len(solutions) == top or complete:
            return solutions, report
        wanted *= 8


def _first_of_each(target: Target, windows: Windows) -> np.ndarray:
    """Places of the windows that can be different linkages: without positions a type and branch count once."""
    if target.position is not None:
        return np.arange(len(windows.row))
    _, first = np.unique(windows.row * 2 + (windows.branch < 0), return_index=True)
    return np.sort(first)


def _any_row_of(family: str, scan: Scan) -> bool:
    longer = scan.lengths[:, 0] > scan.lengths[:, 3]
    return bool(len(longer)) and {"crank_rocker": not longer.all(), "double_crank": longer.any()}.get(family, True)


def _within(scan: Scan, target: Target, limits: Limits, windows: Windows) -> np.ndarray:
    lengths = scan.lengths[windows.row]
    start = np.deg2rad(windows.start)
    holds = limits.family_holds(target, lengths, start)
    if limits.only_family:
        return holds
    pivot_a = pivot_b = None
    if target.position is None:
        lengths = lengths / lengths[:, 3:]
    else:
        angle = window_angles(scan.lengths, target, windows)
        fit = fit_positions(target, angle)
        scale = np.abs(fit.crank_vector) / lengths[:, 0]
        pivot_a = fit.pivot
        pivot_b = pivot_a + scale * lengths[:, 3] * np.exp(1j * (np.angle(fit.crank_vector) - start))
        lengths = lengths * np.maximum(scale, np.finfo(float).tiny)[:, None]
    slacks = limits.slacks(target, lengths, start, pivot_a, pivot_b)
    return holds & np.all(slacks >= 0, axis=-1)
