"""Windows of a table: a type, a branch and a start, with their errors; and the report of a scan of them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TIE = 1e-12
"""Errors (radians, or the objective's unit) that agree to this are ties, broken by number, start, branch."""


class Windows(NamedTuple):
    """Windows as columns: row of the type (number - 1), number of the start, branch, and error."""

    row: Ints
    start: Ints
    branch: Ints
    error: Floats

    def take(self, index: NDArray[np.intp]) -> Windows:
        """The windows at some places."""
        columns: list[Any] = [column[index] for column in self]
        return Windows(*columns)


_NOTHING: Ints = np.empty(0, dtype=np.int64)
NO_WINDOWS = Windows(_NOTHING, _NOTHING, _NOTHING, np.empty(0))


def joined(parts: list[Windows]) -> Windows:
    """The windows of all parts, in order."""
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts)]
    return Windows(*columns)


def each_once(parts: list[Windows]) -> Windows:
    """The windows of all parts, each once; the errors of one window may differ in the last bits."""
    windows = joined(parts)
    _, first = np.unique(np.stack([windows.row, windows.start, windows.branch]), axis=1, return_index=True)
    return windows.take(first)


def best_of(windows: Windows, top: int) -> Windows:
    """The best ``top`` of some windows: by error, ties by number, start, branch."""
    order = np.lexsort((windows.branch < 0, windows.start, windows.row, np.round(windows.error / TIE)))
    return windows.take(order[:top])


class ScanReport(NamedTuple):
    """How much a scan looked at, and whether its answer is proved to be the best.

    ``evaluated`` are the windows whose error was computed from the lengths, after a first look at the most promising cells that
    computes those of 64 or more.
    """

    windows: int
    evaluated: int
    exhaustive: bool
