"""Function generation: smallest largest errors of named functions, and baselines.

Largest errors are evaluated at 2,001 evenly spaced points and recomputed from the numbers of the reply by
`benchmarks.named_functions`. Baselines are the differential evolution of scipy over the same five unknowns, and
the function generation of pylinkage through 3 to 5 precision points at every pair of dial zeros of a grid. Exact
functions are measured by `benchmarks.engine`.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import baselines, report
from benchmarks.named_functions import SAMPLES, largest_error, wanted_output
from benchmarks.report import Times
from synthesis.constraints import keeps
from synthesis.mechanism import Placed
from synthesis.target import Target
from tests.oracles.free_classes import close

RUNS = 10
RATIO = 20.0
ZERO_STEP = 10.0
"""Step between two zeros of a dial for pylinkage, degrees."""


class NamedFunction(NamedTuple):
    """A named function on its dials, and its best known error."""

    name: str
    function: dict[str, Any]
    crank_span: float
    known: float | None = None
    """Smallest largest error known before, degrees."""
    limits: Mapping[str, Any] = MappingProxyType({})


def _named(name: str, first: float, last: float, span: float, **more: Any) -> dict[str, Any]:
    return {"name": name, "x": [first, last], "output_span": span, **more}


FUNCTIONS = (
    NamedFunction("log10 x, 1..2", _named("log10", 1, 2, 90), 60, 0.0469, {"transmission_angle_min": 30}),
    NamedFunction("log10 x, 1..2", _named("log10", 1, 2, 90), 60, 0.00697),
    NamedFunction("sin x, 0..90", _named("sin", 0, 90, 60), 120, 0.0402),
    NamedFunction("sin x, 0..90", _named("sin", 0, 90, 90), 90, 0.190),
    NamedFunction("x^2, 0..1", _named("power", 0, 1, 90, exponent=2), 90, 0.0590),
    NamedFunction("x^1.5, 1..4", _named("power", 1, 4, 90, exponent=1.5), 90, 0.00485),
    NamedFunction("ln x, 1..3", _named("ln", 1, 3, 90), 90),
    NamedFunction("exp x, 0..1", _named("exp", 0, 1, 90), 90),
    NamedFunction("tan x, 0..45", _named("tan", 0, 45, 90), 90),
    NamedFunction("1/x, 1..2", _named("reciprocal", 1, 2, -90), 90),
    NamedFunction("x^0.5, 0..1", _named("power", 0, 1, 90, exponent=0.5), 90),
    NamedFunction("x^0.5, 1..4", _named("power", 1, 4, 90, exponent=0.5), 90),
    NamedFunction("x^3, 0..1", _named("power", 0, 1, 90, exponent=3), 90),
    NamedFunction("cos x, 0..90", _named("cos", 0, 90, -90), 90),
    NamedFunction("cos x, 0..60", _named("cos", 0, 60, -60), 90),
    NamedFunction("sin x, 0..180", _named("sin", 0, 180, 60), 120),
    NamedFunction("exp x, 0..2", _named("exp", 0, 2, 90), 120, None, {"transmission_angle_min": 40}),
    NamedFunction(
        "ln x, 1..3", _named("ln", 1, 3, 90), 90, None, {"transmission_angle_min": 30, "link_ratio_max": 5}
    ),
    NamedFunction("1/x, 1..2", _named("reciprocal", 1, 2, 90), 90, None, {"family": "full_crank"}),
)


def answer(request: dict[str, Any]) -> la.FunctionResult:
    """Return the reply of `linkage_atlas`."""
    return la.function(**request)


# -- least largest errors ---------------------------------------------------------------------------------------------


def rocker_angle(links: np.ndarray, branch: int, crank: np.ndarray) -> np.ndarray:
    """Return theta3 at crank angles, continuous, by intersecting circles; NaN if the loop is open."""
    _, pin = close(links, branch, crank)
    with np.errstate(invalid="ignore"):
        return np.unwrap(np.angle(pin - links[3]))


def dense(case: NamedFunction) -> tuple[np.ndarray, np.ndarray]:
    """Return crank angles and outputs in radians at evenly spaced points of the interval."""
    return np.deg2rad(np.linspace(0, case.crank_span, SAMPLES)), np.deg2rad(wanted_output(case.function))


def measure_function(case: NamedFunction) -> dict[str, Any]:
    """Measure our answer: largest error, alternations, linkage and time, and equality of the bytes of `RUNS` runs."""
    request: dict[str, Any] = {"function": case.function, "crank_span": case.crank_span, "objective": "max"}
    times, replies = Times(), []
    for _ in range(RUNS):
        found = times.run(answer, {**request, "limits": dict(case.limits)})
        replies.append(json.dumps(found.to_dict()["solutions"]))
    best = found.solutions[0].to_dict()
    return {
        "name": case.name,
        "spans": f"{case.crank_span:g}/{case.function['output_span']:g}",
        "limits": ", ".join(f"{name} {value}" for name, value in case.limits.items()) or "none",
        "known": case.known,
        "error": largest_error(request, best),
        "told": best["errors"]["max"],
        "error_y": best["errors"]["max_y"],
        "alternations": best["errors"]["alternations"],
        "family": best["family"],
        "transmission": best["transmission_angle_min"],
        "links": [best["links"][name] for name in ("crank", "coupler", "rocker", "ground")],
        "stopped_by": found.report.stopped_by,
        "same_bytes": len(set(replies)) == 1,
        **times.summary(),
    }


def measure_evolution(case: NamedFunction, seeds: int = 1) -> dict[str, Any]:
    """Run the differential evolution of scipy on both branches; the offset is the middle of the range of the gap."""
    from scipy.optimize import differential_evolution

    from linkage_atlas.limits import read_function_limits

    crank, output = dense(case)
    target = Target(output, None, crank=crank)
    limits = read_function_limits(case.limits, target, True).over(1.0)
    coarse = slice(None, None, 10)
    few, aims = crank[coarse], output[coarse]
    best, times = (np.inf, None), Times()

    def errors(unknowns: np.ndarray, branch: int) -> np.ndarray:
        ratios, start = np.exp(unknowns[:3]), unknowns[3]
        links = np.concatenate([ratios, np.ones((1, ratios.shape[1]))])[:, :, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            _, pin = close(links, branch, start[:, None] + few)
            gap = aims - np.unwrap(np.angle(pin - 1), axis=1)
        size = (gap.max(axis=1) - gap.min(axis=1)) / 2
        shapes = Placed(links[:, :, 0].T, np.full(start.shape, float(branch)), target.interval.after(start))
        within = keeps(target, limits, shapes)
        return np.where(np.isfinite(size) & within, size, 10.0)

    box = [(-np.log(RATIO), np.log(RATIO))] * 3 + [(0, 2 * np.pi)]
    for branch in (1, -1):
        for seed in range(seeds):
            found = times.run(
                differential_evolution,
                lambda x, branch=branch: errors(x, branch),
                box,
                vectorized=True,
                updating="deferred",
                popsize=40,
                maxiter=600,
                tol=1e-10,
                seed=seed,
                polish=False,
            )
            if found.fun < best[0]:
                best = (float(found.fun), (found.x, branch))
    if best[1] is None or best[0] >= 10:
        return {"evolution": None, "evolution_s": sum(times.processor)}
    (x, branch) = best[1]
    angle = rocker_angle(np.append(np.exp(x[:3]), 1.0), branch, x[3] + crank)
    gap = np.rad2deg(output - angle)
    return {"evolution": float(np.ptp(gap) / 2), "evolution_s": sum(times.processor)}


def measure_pylinkage(case: NamedFunction) -> dict[str, Any]:
    """Run the function generation of pylinkage through 3, 4 and 5 Chebyshev points at a grid of zeros."""
    from pylinkage.synthesis import function_generation

    crank, output = dense(case)
    zeros = np.deg2rad(np.arange(0.0, 360.0, ZERO_STEP))
    found: dict[str, Any] = {}
    for points in (3, 4, 5):
        share = (1 - np.cos((2 * np.arange(points) + 1) * np.pi / (2 * points))) / 2
        inputs, outputs = share * crank[-1], np.interp(share, np.linspace(0, 1, SAMPLES), output)
        times, best, answers = Times(), np.inf, 0
        for start in zeros:
            for first in zeros:
                pairs = [(float(start + a), float(first + b)) for a, b in zip(inputs, outputs)]
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    result = times.run(function_generation, pairs, require_grashof=False)
                for raw in result.raw_solutions:
                    answers += 1
                    links = np.array([raw.crank_length, raw.coupler_length, raw.rocker_length, raw.ground_length])
                    for branch in (1, -1):
                        gap = output + first - rocker_angle(links, branch, start + crank)
                        size = np.abs(gap - 2 * np.pi * np.round(gap[0] / (2 * np.pi))).max()
                        best = min(best, np.rad2deg(size)) if np.isfinite(size) else best
        found |= {
            f"pylinkage_{points}": report.finite(best),
            f"pylinkage_{points}_answers": answers,
            f"pylinkage_{points}_s": sum(times.processor),
        }
    return found


# -- documents --------------------------------------------------------------------------------------------------------


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md."""
    functions = [
        row
        | {
            "best_known": "-" if row["known"] is None else f"{row['known']:g}",
            "evolution": row.get("evolution"),
            "pylinkage": min((row[f"pylinkage_{k}"] for k in (3, 4, 5) if f"pylinkage_{k}" in row), default=None),
        }
        for row in results["functions"]
    ]
    beaten = sum(row["evolution"] > 1.01 * row["error"] for row in functions)
    better = sum(row["evolution"] < 0.99 * row["error"] for row in functions)
    free = [row for row in functions if row["limits"] == "none"]
    worse = sum(row["pylinkage"] > row["error"] for row in free)
    return report.tables("function", {"functions": [row for row in functions if row["known"] is not None]}) | {
        "all": f"Of all {len(functions)} functions differential evolution's error is larger by more than 1 % in {beaten} and "
        f"smaller by as much in {better}; of the {len(free)} without limits pylinkage's is larger in {worse}"
    }


def measure() -> Iterator[dict[str, Any]]:
    """Measure each function and its baselines."""
    baselines.need()
    threadpool_limits(1, "blas")
    la.prepare()
    la.function([0, 1, 3], 30)
    rows = []
    for case in FUNCTIONS:
        rows.append(measure_function(case) | measure_evolution(case) | measure_pylinkage(case))
        print(json.dumps(rows[-1]), flush=True)
    yield {"functions": rows}


if __name__ == "__main__":
    report.run(measure)
