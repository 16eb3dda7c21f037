"""Studies of conditions: over a grid of parameters, at the limits of a parameter, and within tolerances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats
from synthesis.scenes.knotter.conditions import Condition, ConditionResult
from synthesis.scenes.knotter.mechanism import Mechanism, dimensions, with_dimensions
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


@dataclass(frozen=True)
class Limit:
    """Value of a parameter at which a condition begins or ceases to hold."""

    value: float
    """Last value at which the condition holds, to rounding."""
    holds_above: bool
    """True if the condition holds on the upper side of the limit."""
    result: ConditionResult
    """Result of the condition at ``value``, for a single item."""


def find_limits(
    mechanism: Mechanism,
    condition: Condition,
    parameter: str,
    between: tuple[float, float],
    samples: int = 257,
    work: Work | None = None,
) -> tuple[list[Limit], bool]:
    """Find the values of a parameter at which a condition begins or ceases to hold.

    The verdict at each sample is exact, but the search over the parameter is only as fine as its samples: a condition
    that changes twice between two neighbouring samples is not noticed.
    Each change is enclosed by repeated division of its bracket into 16 parts, down to rounding.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    condition : Condition
        The condition.
    parameter : str
        Name of the parameter.
    between : tuple of float
        Range of the parameter.
    samples : int, optional
        Number of evenly spaced values that are examined first.
    work : Work, optional
        Time budget and cancellation, checked at each evaluation.

    Returns
    -------
    limits : list of Limit
        The limits, increasing.
        The condition holds at ``Limit.value`` and fails at the next sample beyond it.
    holds_at_first : bool
        True if the condition holds at the lower end of the range.

    Raises
    ------
    FieldError
        Points coincide or are collinear, a law is not defined over the range of the condition, or the evaluation
        would take too many pieces.
    """
    condition.check(mechanism)

    def holds_at(values: Floats) -> Flags:
        return condition.evaluate(mechanism.with_parameters(**{parameter: values}), len(values), work).holds

    values = np.linspace(*between, samples)
    holds = holds_at(values)
    change = np.flatnonzero(holds[1:] != holds[:-1])
    left, right, holds_above = values[change], values[change + 1], holds[change + 1]
    fractions = np.linspace(0, 1, 17)
    resolution = (between[1] - between[0]) * 2.0**-60  # rounding of a limit near zero
    while np.any(right - left > np.maximum(2 * np.spacing(np.maximum(np.abs(left), np.abs(right))), resolution)):
        inner = left[:, None] + (right - left)[:, None] * fractions
        inner[:, -1] = right
        # Find the first change in each bracket; the verdicts at its two ends differ by construction.
        changed = holds_at(inner[:, 1:-1].ravel()).reshape(len(change), -1) == holds_above[:, None]
        changed = np.concatenate([changed, np.ones((len(change), 1), bool)], axis=1)
        first = np.argmax(changed, axis=1)[:, None]
        left = np.take_along_axis(inner, first, 1)[:, 0]
        right = np.take_along_axis(inner, first + 1, 1)[:, 0]
    limits = []
    for value, above in zip(np.where(holds_above, right, left).tolist(), holds_above.tolist()):
        at_limit = mechanism.with_parameters(**{parameter: np.array([value])})
        limits.append(Limit(value, above, condition.evaluate(at_limit, 1)))
    return limits, bool(holds[0])


@dataclass(frozen=True)
class ToleranceOptions:
    """Options of the tolerance analysis."""

    slope_step: float = 0.01
    """Step of the central differences, as a fraction of the tolerances.
    It is small because a margin may switch between its formulas within the tolerances."""
    largest_factor: float = 64.0
    """Multiple of the tolerances beyond which the failure of the worst corner is not searched."""
    factor_halvings: int = 24
    """Number of halvings of the bracket around the multiple at which the worst corner fails."""


DEFAULT_OPTIONS = ToleranceOptions()


@dataclass(frozen=True)
class ConditionTolerance:
    """Margin of a condition within the tolerances."""

    holds: bool
    """True if the condition holds with the nominal dimensions."""
    margin: float
    """Margin with the nominal dimensions."""
    linear: float
    """Nominal margin minus the sum of all sensitivities times their tolerances."""
    corner: float
    """Margin if every dimension deviates by its whole tolerance to its unfavourable side."""
    factor: float | None
    """Multiple of the tolerances at which that corner fails; null if it exceeds 64 or the condition already fails."""
    margin_min: float
    """Smallest margin of all samples."""
    share: float
    """Fraction of the samples in which the condition holds."""
    sensitivity: dict[str, float]
    """Change of the margin per unit of each dimension, largest effects within the tolerances first."""


def analyse_tolerances(
    mechanism: Mechanism,
    conditions: Mapping[str, Condition],
    tolerances: Mapping[str, float],
    samples: int,
    seed: int,
    work: Work | None = None,
    options: ToleranceOptions = DEFAULT_OPTIONS,
) -> tuple[dict[str, ConditionTolerance], float]:
    """Analyse the margins of a mechanism within the tolerances of its dimensions.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism with nominal dimensions.
    conditions : mapping
        Conditions by name.
    tolerances : mapping
        Half width of each dimension's tolerance, above 0; named as in `dimensions`.
    samples : int
        Number of draws from the uniform distribution over the tolerances; all conditions use the same draws.
    seed : int
        Seed of the draws.
    work : Work, optional
        Time budget and cancellation, checked at each evaluation.
    options : ToleranceOptions, optional
        Options of the analysis.

    Returns
    -------
    results : dict
        Result of each condition.
        ``linear`` exceeds ``corner`` only by the effect of the margin's curvature.
    share : float
        Fraction of the samples in which all conditions hold.
    """
    work = work or Work()
    nominal, names = dimensions(mechanism), list(tolerances)
    centre, half_width = np.array([nominal[name] for name in names]), np.array(list(tolerances.values()))
    draws = np.random.default_rng(seed).uniform(-1, 1, (samples, len(names)))
    all_hold, results = np.ones(samples, bool), {}

    for name, condition in conditions.items():

        def margins(deviations: Floats, condition: Condition = condition) -> Floats:
            """Return the margins at deviations in multiples of the tolerances, shape (n, dimensions)."""
            values = centre + deviations * half_width
            columns = {dimension: values[:, k] for k, dimension in enumerate(names)}
            return condition.evaluate(with_dimensions(mechanism, columns), len(values), work).margin

        steps = options.slope_step * np.eye(len(names))
        stencil = margins(np.concatenate([np.zeros((1, len(names))), steps, -steps]))
        forward, backward = stencil[1 : len(names) + 1], stencil[len(names) + 1 :]
        margin, slopes = float(stencil[0]), (forward - backward) / (2 * options.slope_step)
        worst_corner = -np.sign(slopes)

        def corner_margin(
            factor: float, worst_corner: Floats = worst_corner, margins: Callable[[Floats], Floats] = margins
        ) -> float:
            return float(margins(factor * worst_corner[None])[0])

        sampled = margins(draws) if samples else np.empty(0)
        all_hold &= sampled > 0
        order = np.argsort(-np.abs(slopes), kind="stable")
        results[name] = ConditionTolerance(
            holds=margin > 0,
            margin=margin,
            sensitivity={names[k]: float(slopes[k] / half_width[k]) for k in order},
            linear=margin - float(np.abs(slopes).sum()),
            corner=corner_margin(1.0),
            factor=_failure_factor(corner_margin, margin, options),
            margin_min=float(min(sampled.min(initial=np.inf), margin)),
            share=float(np.mean(sampled > 0)) if samples else float(margin > 0),
        )
    if not samples:
        return results, float(all(result.margin > 0 for result in results.values()))
    return results, float(np.mean(all_hold))


def _failure_factor(margin_at: Callable[[float], float], nominal: float, options: ToleranceOptions) -> float | None:
    """Return the multiple of the tolerances at which the margin of a corner first becomes zero."""
    if not nominal > 0:
        return None
    low, high = 0.0, 1.0
    while margin_at(high) > 0:
        if high >= options.largest_factor:
            return None
        low, high = high, 2 * high
    for _ in range(options.factor_halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if margin_at(middle) > 0 else (low, middle)
    return low
