"""Verdicts of a knotter that is made within tolerances: which dimension matters, the worst corner, and seeded samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from synthesis.knotter.conditions import Condition
from synthesis.knotter.dimensions import dimensions, varied
from synthesis.knotter.mechanism import Mechanism
from synthesis.one_variable import Floats
from synthesis.work import Work

LARGEST_FACTOR = 64.0
"""Multiple of the tolerances beyond which the worst corner is not sought."""
HALVINGS = 24


@dataclass(frozen=True)
class Spread:
    """One condition within the tolerances.

    Attributes
    ----------
    margin : float
        Of the nominal dimensions; positive where the condition holds.
    sensitivity : dict of str to float
        Change of the margin per unit of each dimension that has a tolerance.
    linear : float
        The margin less the sum of the sizes of all sensitivities times their tolerances.
    corner : float
        The margin where every dimension is at the end of its tolerance that the sensitivity names.
    factor : float
        The multiple of the tolerances at which that corner's verdict changes; infinite beyond `LARGEST_FACTOR`, NaN where the
        condition fails as it is.
    least : float
        The smallest margin of all samples.
    share : float
        The share of the samples in which the condition holds.
    """

    margin: float
    sensitivity: dict[str, float]
    linear: float
    corner: float
    factor: float
    least: float
    share: float


def spread(
    mechanism: Mechanism,
    conditions: Mapping[str, Condition],
    tolerances: Mapping[str, float],
    samples: int,
    seed: int,
    work: Work | None = None,
) -> tuple[dict[str, Spread], float]:
    """Each condition of one mechanism within its tolerances, and the share of the samples in which all of them hold.

    Parameters
    ----------
    tolerances : mapping
        Half width of each dimension's tolerance (of `dimensions`), above 0.
    samples : int
        Even draws from the box of the tolerances, the same for all conditions.

    Notes
    -----
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
        found[name] = Spread(
            margin=margin,
            sensitivity=dict(zip(names, (slopes / half).tolist())),
            linear=margin - float(np.abs(slopes).sum()),
            corner=along(1.0),
            factor=_factor(along, margin),
            least=float(min(sampled.min(initial=np.inf), margin)),
            share=float(np.mean(sampled > 0)) if samples else float(margin > 0),
        )
    return found, float(np.mean(holding)) if samples else float(all(one.margin > 0 for one in found.values()))


def _factor(margin_at: Callable[[float], float], nominal: float) -> float:
    """The multiple of the tolerances at which the margin along a corner first becomes zero."""
    if not nominal > 0:
        return float("nan")
    low, high = 0.0, 1.0
    while margin_at(high) > 0:
        if high >= LARGEST_FACTOR:
            return float("inf")
        low, high = high, 2 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if margin_at(middle) > 0 else (low, middle)
    return low
