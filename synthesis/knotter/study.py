"""Conditions over a grid of a mechanism's parameters, and the limits of a condition in one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.knotter.conditions import Condition, Result
from synthesis.knotter.mechanism import Mechanism
from synthesis.one_variable import Flags, Floats
from synthesis.work import Work


@dataclass(frozen=True)
class StudyResult:
    """The verdicts over a grid.

    Attributes
    ----------
    grid : mapping of str to ndarray, shape (items,)
        Each item's value of every grid parameter; the last parameter varies fastest.
    conditions : mapping of str to Result
    feasible : ndarray of bool, shape (items,)
        Where all conditions hold.
    margin : ndarray, shape (items,)
        The smallest margin of all conditions.
    """

    grid: Mapping[str, Floats]
    conditions: Mapping[str, Result]
    feasible: Flags
    margin: Floats


def study(
    mechanism: Mechanism,
    grid: Mapping[str, Sequence[float]],
    conditions: Sequence[Condition],
    work: Work | None = None,
) -> StudyResult:
    """Every condition for every combination of the grid's parameters; ``work`` is asked before each few items of each condition.

    Raises
    ------
    FieldError
        An empty grid, degenerate points, a law that is not defined over a condition's range, too much work.

    Notes
    -----
    Law: an item's result does not depend on the other items of the grid.
    """
    for name, values in grid.items():
        if len(values) == 0:
            raise FieldError(
                f"/grid/{name}", "the grid is empty: at least one value is needed", constraint="min_length"
            )
    axes = np.meshgrid(*(np.asarray(values, float) for values in grid.values()), indexing="ij")
    flat = {name: axis.ravel() for name, axis in zip(grid, axes)}
    items = len(next(iter(flat.values()))) if flat else 1
    mechanism = mechanism.with_parameters(**flat)
    for condition in conditions:
        condition.check(mechanism)
    work, results = work or Work(), {}
    for condition in conditions:
        results[condition.name] = condition.evaluate(mechanism, items, work)
    return StudyResult(
        flat,
        results,
        np.logical_and.reduce([np.ones(items, bool), *(result.holds for result in results.values())]),
        np.minimum.reduce([np.full(items, np.inf), *(result.margin for result in results.values())]),
    )


@dataclass(frozen=True)
class Limit:
    """A parameter's value at which a verdict changes.

    Attributes
    ----------
    value : float
        The last value at which the condition holds, to rounding.
    holds_above : bool
        Whether it holds on the upper side.
    result : Result
        The condition at ``value``, arrays of one item.
    """

    value: float
    holds_above: bool
    result: Result


def solve(
    mechanism: Mechanism,
    condition: Condition,
    parameter: str,
    between: tuple[float, float],
    samples: int = 257,
    work: Work | None = None,
) -> tuple[list[Limit], bool]:
    """Every limit of a condition in one parameter that ``samples`` evenly spaced values tell apart, increasing.

    Also whether the condition holds at the first value, which tells always from never when there is no limit.

    Notes
    -----
    Where the condition holds between two samples only, neither sees it: the verdict at a sample is exact, the search
    over the parameter is as fine as its samples. Each change is then cut into 16 until next to nothing is left.
    Law: the condition holds at ``value`` and fails at the next samples beyond it. ``work`` is asked at each evaluation.
    """
    condition.check(mechanism)

    def verdict(values: Floats) -> Flags:
        return condition.evaluate(mechanism.with_parameters(**{parameter: values}), len(values), work).holds

    values = np.linspace(*between, samples)
    holds = verdict(values)
    at = np.flatnonzero(holds[1:] != holds[:-1])
    left, right, rises = values[at], values[at + 1], holds[at + 1]
    cut = np.linspace(0, 1, 17)
    finest = (between[1] - between[0]) * 2.0**-60  # what rounding leaves of a limit near zero
    while np.any(right - left > np.maximum(2 * np.spacing(np.maximum(np.abs(left), np.abs(right))), finest)):
        inner = left[:, None] + (right - left)[:, None] * cut
        inner[:, -1] = right
        # The first change in the bracket: its ends differ by construction.
        state = verdict(inner[:, 1:-1].ravel()).reshape(len(at), -1) == rises[:, None]
        state = np.concatenate([state, np.ones((len(at), 1), bool)], axis=1)
        first = np.argmax(state, axis=1)[:, None]
        left = np.take_along_axis(inner, first, 1)[:, 0]
        right = np.take_along_axis(inner, first + 1, 1)[:, 0]
    limits = []
    for value, above in zip(np.where(rises, right, left).tolist(), rises.tolist()):
        at_limit = mechanism.with_parameters(**{parameter: np.array([value])})
        limits.append(Limit(value, above, condition.evaluate(at_limit, 1)))
    return limits, bool(holds[0])
