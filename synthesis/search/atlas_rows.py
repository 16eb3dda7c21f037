"""Rows of an atlas as they are: mounted on a motion, and within limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, rows_at
from synthesis.atlas.scan import Scan
from synthesis.atlas.windows import ScanReport, Windows
from synthesis.constraints import keeps
from synthesis.fourbar.mechanism import mounted
from synthesis.limits import Limits
from synthesis.mechanism import Placed
from synthesis.pose import fit_positions
from synthesis.ranking import distinct
from synthesis.solution import Solution, assess
from synthesis.target import Target
from synthesis.work import UNLIMITED, Work

MAX_LIMITED_WINDOWS = 1 << 18
"""Windows evaluated before a search within limits gives up; the report is then not exhaustive."""
MAX_LIMITED_SAMPLES = 1 << 22
"""Limit on the samples of all evaluated windows: a request of 1,024 samples takes no longer than a request of 16."""


def best_rows(
    scan: Scan, target: Target, limits: Limits, top: int, work: Work = UNLIMITED, tolerance: float = -1.0
) -> tuple[list[Solution], ScanReport]:
    """Return the best rows by the joint objective over rotation and position, mounted and within limits.

    ``work``: once it has expired the scan ends with the best found so far. ``tolerance``: a row as good as this is good enough,
    see `Scan.best`.

    Returns
    -------
    solutions : list of Solution
        At most ``top``, by objective; each linkage once, at its best start. Empty if no row satisfies the limits.
    report : ScanReport
    """

    def exact(windows: Windows) -> Floats:
        error = scan.errors(target, windows)
        return np.where(_within(scan, target, limits, windows), error, np.inf)

    if not scan.has_family(limits.family):
        return [], ScanReport(scan.windows, 0, True)
    max_windows = MAX_LIMITED_WINDOWS
    if not limits.only_family:
        max_windows = min(max_windows, MAX_LIMITED_SAMPLES // target.samples)
    count = top
    while True:
        windows, report = scan.best(target, count, exact, max_windows, work, tolerance)
        chosen = rows_at(windows, _first_of_each(target, windows))
        linkages = mounted(target, scan.lengths[chosen.row], chosen.branch, scan.start_angles(chosen))
        solutions = distinct(assess(target, linkages, rows=chosen.row.tolist()), top)
        complete = len(windows.row) < count or not report.exhaustive
        if len(solutions) == top or complete:
            return solutions, report
        count *= 8


def _first_of_each(target: Target, windows: Windows) -> NDArray[np.intp]:
    """Return the indices of windows that can be different linkages: without positions a type and branch count once."""
    if target.position is not None:
        return np.arange(len(windows.row))
    _, first = np.unique(windows.row * 2 + (windows.branch < 0), return_index=True)
    return np.sort(first)


def _within(scan: Scan, target: Target, limits: Limits, windows: Windows) -> NDArray[np.bool_]:
    """Return which windows satisfy the limits."""
    lengths, start = scan.lengths[windows.row], scan.start_angles(windows)
    placed = Placed(lengths, windows.branch.astype(float), target.interval.after(start))
    if not limits.only_family and target.position is not None:
        fit = fit_positions(target, scan.angles(target, windows))
        scale = np.maximum(np.abs(fit.crank_vector) / lengths[:, 0], np.finfo(float).tiny)
        turned = np.angle(fit.crank_vector) - start
        placed = placed._replace(
            lengths=lengths * scale[:, None], pivot=fit.pivot, turned=turned, coupler=fit.coupler_vector
        )
    return keeps(target, limits, placed)
