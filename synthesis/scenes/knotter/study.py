"""Verdicts of several conditions over a grid of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats
from synthesis.scenes.knotter.conditions import Condition, ConditionResult
from synthesis.scenes.knotter.mechanism import Mechanism
from synthesis.work import Work


@dataclass(frozen=True)
class StudyResult:
    """Verdicts of several conditions over a grid."""

    grid: Mapping[str, Floats]
    """Value of each grid parameter for each item, shape (items,); the last parameter varies fastest."""
    conditions: Mapping[str, ConditionResult]
    """Result of each condition, by name."""
    feasible: Flags
    """True for items that satisfy all conditions, shape (items,)."""
    margin: Floats
    """Smallest margin of all conditions, shape (items,)."""


def study(
    mechanism: Mechanism,
    grid: Mapping[str, Sequence[float]],
    conditions: Sequence[Condition],
    work: Work | None = None,
) -> StudyResult:
    """Evaluate conditions for every combination of some parameters.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    grid : mapping
        Values of each parameter that varies.
    conditions : sequence of Condition
        The conditions.
    work : Work, optional
        Time budget and cancellation, checked before each few items of each condition.

    Returns
    -------
    StudyResult
        Verdicts; the result of an item does not depend on the other items of the grid.

    Raises
    ------
    FieldError
        The grid is empty, points coincide or are collinear, a law is not defined over the range of a condition, or
        the evaluation would take too many pieces.
    """
    for name, values in grid.items():
        if len(values) == 0:
            raise FieldError(
                f"/grid/{name}", "the grid is empty: at least one value is needed", constraint="min_length"
            )
    axes = np.meshgrid(*(np.asarray(values, float) for values in grid.values()), indexing="ij")
    item_values = {name: axis.ravel() for name, axis in zip(grid, axes)}
    items = len(next(iter(item_values.values()))) if item_values else 1
    mechanism = mechanism.with_parameters(**item_values)
    for condition in conditions:
        condition.check(mechanism)
    work, results = work or Work(), {}
    for condition in conditions:
        results[condition.name] = condition.evaluate(mechanism, items, work)
    return StudyResult(
        item_values,
        results,
        np.logical_and.reduce([np.ones(items, bool), *(result.holds for result in results.values())]),
        np.minimum.reduce([np.full(items, np.inf), *(result.margin for result in results.values())]),
    )
