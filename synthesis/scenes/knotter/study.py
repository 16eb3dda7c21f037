"""Conditions over a grid of a mechanism's parameters, their limits in one of them, and their verdicts within tolerances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats
from synthesis.scenes.knotter.conditions import Condition, Result
from synthesis.scenes.knotter.mechanism import Mechanism, dimensions, varied
from synthesis.work import Work


@dataclass(frozen=True)
class StudyResult:
    """The verdicts over a grid."""

    grid: Mapping[str, Floats]
    """Each item's value of every grid parameter; the last parameter varies fastest, shape (items,)."""
    conditions: Mapping[str, Result]
    feasible: Flags
    """Where all conditions hold, shape (items,)."""
    margin: Floats
    """The smallest margin of all conditions, shape (items,)."""


def study(
    mechanism: Mechanism,
    grid: Mapping[str, Sequence[float]],
    conditions: Sequence[Condition],
    work: Work | None = None,
) -> StudyResult:
    """Every condition for every combination of the grid's parameters; ``work`` is asked before each few items of each condition.

    Raises `FieldError`: an empty grid, degenerate points, a law that is not defined over a condition's range, too much
    work.

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
    """A parameter's value at which a verdict changes."""

    value: float
    """The last value at which the condition holds, to rounding."""
    holds_above: bool
    """Whether it holds on the upper side."""
    result: Result
    """The condition at ``value``, arrays of one item."""


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

    Where the condition holds between two samples only, neither sees it: the verdict at a sample is exact, the search
    over the parameter is as fine as its samples. Each change is then cut into 16 until next to nothing is left. Law:
    the condition holds at ``value`` and fails at the next samples beyond it. ``work`` is asked at each evaluation.
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


LARGEST_FACTOR = 64.0
"""Multiple of the tolerances beyond which the worst corner is not sought."""
HALVINGS = 24


@dataclass(frozen=True)
class Spread:
    """One condition within the tolerances."""

    holds: bool
    """With the nominal dimensions."""
    margin: float
    linear: float
    """The margin less all sensitivities times their tolerances."""
    corner: float
    """The margin where every dimension is off to its worse side."""
    factor: float | None
    """The multiple of the tolerances at which that corner fails; null: beyond 64, or it fails as it is."""
    least: float
    """The smallest margin of all samples."""
    share: float
    """The share of the samples in which the condition holds."""
    sensitivity: dict[str, float]
    """Change of the margin per unit of each dimension, largest effects first."""


def spread(
    mechanism: Mechanism,
    conditions: Mapping[str, Condition],
    tolerances: Mapping[str, float],
    samples: int,
    seed: int,
    work: Work | None = None,
) -> tuple[dict[str, Spread], float]:
    """Each condition of one mechanism within its tolerances, and the share of the samples in which all of them hold.

    ``tolerances``: half width of each dimension's tolerance (of `dimensions`), above 0. ``samples``: even draws from
    the box of the tolerances, the same for all conditions.

    Law: the linear margin is never above the corner's by more than the margin's curvature makes.
    """
    work = work or Work()
    nominal, names = dimensions(mechanism), list(tolerances)
    centre, half = np.array([nominal[name] for name in names]), np.array(list(tolerances.values()))
    draws = np.random.default_rng(seed).uniform(-1, 1, (samples, len(names)))
    holding, found = np.ones(samples, bool), {}

    for name, condition in conditions.items():

        def margins(shifts: Floats, condition: Condition = condition) -> Floats:
            """Margins where the dimensions are off by shares of their tolerances, shape (n, dimensions)."""
            at = centre + shifts * half
            columns = {dimension: at[:, k] for k, dimension in enumerate(names)}
            return condition.evaluate(varied(mechanism, columns), len(at), work).margin

        # steps of a hundredth of the tolerances: within the box a margin may change its branch
        steps = 0.01 * np.eye(len(names))
        both = margins(np.concatenate([np.zeros((1, len(names))), steps, -steps]))
        margin, slopes = float(both[0]), (both[1 : len(names) + 1] - both[len(names) + 1 :]) / 0.02
        worst = -np.sign(slopes)

        def along(factor: float, worst: Floats = worst, margins: Callable[[Floats], Floats] = margins) -> float:
            return float(margins(factor * worst[None])[0])

        sampled = margins(draws) if samples else np.empty(0)
        holding &= sampled > 0
        order = np.argsort(-np.abs(slopes), kind="stable")
        found[name] = Spread(
            holds=margin > 0,
            margin=margin,
            sensitivity={names[k]: float(slopes[k] / half[k]) for k in order},
            linear=margin - float(np.abs(slopes).sum()),
            corner=along(1.0),
            factor=_factor(along, margin),
            least=float(min(sampled.min(initial=np.inf), margin)),
            share=float(np.mean(sampled > 0)) if samples else float(margin > 0),
        )
    return found, float(np.mean(holding)) if samples else float(all(one.margin > 0 for one in found.values()))


def _factor(margin_at: Callable[[float], float], nominal: float) -> float | None:
    """The multiple of the tolerances at which the margin along a corner first becomes zero."""
    if not nominal > 0:
        return None
    low, high = 0.0, 1.0
    while margin_at(high) > 0:
        if high >= LARGEST_FACTOR:
            return None
        low, high = high, 2 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if margin_at(middle) > 0 else (low, middle)
    return low
