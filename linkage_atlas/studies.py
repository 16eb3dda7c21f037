"""Studies that can be requested of each solution of a motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.analysis import AskedAnalysis, read_analysis
from linkage_atlas.arguments import Fields, check_above_zero, column, number
from linkage_atlas.assemblies import AskedAssembly, Assembly, read_assembly
from linkage_atlas.motions import MOST_STOCK, Motion
from linkage_atlas.tolerance_study import Manufacture, read_manufacture
from synthesis.errors import FieldError
from synthesis.limits import BETWEEN_LENGTHS, Limits
from synthesis.studies.rounding import given_lengths, multiples
from synthesis.target import MAX_LENGTH, MIN_LENGTH

DRIVE_STUDIES = ("load", "drives", "springs", "drive")
"""Studies of the drives of each solution."""
STUDIES = ("round_to", "lengths_from", "sensitivity", "analysis", "tolerance_study", "assembly", *DRIVE_STUDIES)
"""Names of the studies in the HTTP contract."""


class Studies(NamedTuple):
    """Studies that are requested of each solution; None or False: not requested."""

    round_to: float | None = None
    """Grid of the lengths."""
    lengths_from: tuple[float, ...] | None = None
    """Stock lengths."""
    sensitivity: bool = False
    analysis: AskedAnalysis | None = None
    manufacture: Manufacture | None = None
    """Tolerance study."""
    drives: Fields | None = None
    """`DRIVE_STUDIES`, unchecked."""
    assembly: AskedAssembly | None = None
    arranged: Mapping[int, Assembly] = {}
    """Assemblies that were made before, by id of the linkage."""

    @property
    def rounds(self) -> bool:
        """True if the lengths are rounded."""
        return self.round_to is not None or self.lengths_from is not None

    @property
    def long(self) -> bool:
        """True if the studies of a solution take long."""
        return self.rounds or any(study is not None for study in (self.manufacture, self.drives, self.assembly))


def read_studies(request: Fields, motion: Motion) -> Studies:
    """Check the studies of a request, some of `STUDIES`, for solutions of a motion."""
    values: dict[str, Any] = dict.fromkeys(STUDIES) | dict(request)
    positions, analysis = motion.samples.position is not None, values["analysis"]
    if motion.length_unit is not None and isinstance(analysis, Mapping):
        analysis = {"length_unit": motion.length_unit, **analysis}
    check_above_zero(round_to=values["round_to"])
    studies = Studies(
        values["round_to"],
        _lengths(values["lengths_from"]),
        bool(values["sensitivity"]),
        None if analysis is None else read_analysis(analysis, positions),
        None if values["tolerance_study"] is None else read_manufacture(values["tolerance_study"]),
        _drives(values),
        None if values["assembly"] in (None, False) else read_assembly(values["assembly"]),
    )
    if studies.assembly is not None and studies.assembly.body and not positions:
        raise FieldError("/assembly/body", "needs `position`, which fixes the position of the body")
    if studies.round_to is not None and studies.lengths_from is not None:
        raise FieldError("/lengths_from", "give either this or `round_to`")
    for name in ("round_to", "lengths_from", "tolerance_study", "drives", "springs", "drive"):
        if values[name] is not None and not positions:
            raise FieldError(f"/{name}", "needs `position`: only positions fix the size of a linkage")
    return studies


def check_lengths(studies: Studies, limits: Limits) -> None:
    """Raise FieldError if no available length satisfies the limits of a four-bar."""
    low, high, grid = limits.link_min or 0.0, limits.link_max or math.inf, studies.round_to
    lengths: Iterable[float] = studies.lengths_from or ()
    if grid is not None:  # the shortest length within the limits is one of these
        lengths = multiples(np.maximum(1.0, np.round(low / grid) + np.arange(2.0)), grid).tolist()
    if lengths and np.isnan(given_lengths(limits)).any() and not any(low <= length <= high for length in lengths):
        name = "lengths_from" if grid is None else "round_to"
        raise FieldError(f"/{name}", f"must have a length between {BETWEEN_LENGTHS}")


def _drives(values: Fields) -> Fields | None:
    drives = {name: values[name] for name in DRIVE_STUDIES if values[name] is not None}
    if not drives.keys() - {"load"}:
        if drives:
            raise FieldError("/load", "has no effect without `drives`, `springs` or `drive`")
        return None
    return drives


def _lengths(lengths: ArrayLike | None) -> tuple[float, ...] | None:
    if lengths is None:
        return None
    stock = column("lengths_from", lengths)
    if stock.ndim != 1 or not 1 <= stock.size <= MOST_STOCK:
        raise FieldError("/lengths_from", f"must have 1 to {MOST_STOCK:,} lengths")
    for index, length in enumerate(stock):
        if not MIN_LENGTH <= number(f"lengths_from/{index}", length) <= MAX_LENGTH:
            raise FieldError(f"/lengths_from/{index}", f"must be a length from {MIN_LENGTH:g} to {MAX_LENGTH:g}")
    return tuple(stock.tolist())
