"""Poses without crank angles: the effect of noise, and other programs on exact poses.

J is recomputed from the numbers of the reply by `tests.oracles.free_classes`; times are those of
`linkage_atlas.synthesize` with ten solutions. Exact requests, random poses and published cases are measured by
`benchmarks.engine`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import baselines, report
from benchmarks.report import Times
from tests.oracles.free_classes import free_case, free_request, recompute_free

REACHED = 1e-9
SAMPLES = (6, 10, 20, 60)
BASELINE_POSES, BASELINE_CASES, PYLINKAGE_POSES = (3, 4, 5, 8), 30, 5
GENERATIONS = 300


def measure_noise(samples: int, cases: int) -> dict[str, Any]:
    """Return J of the best solution relative to the refined exact linkages on noisy poses, and milliseconds."""
    times, ratio = Times(), []
    for seed in range(cases):
        exact = free_case(seed, samples)
        case, request = free_request(exact, "noise", seed)
        found = times.run(la.synthesize, **request)
        best = recompute_free(case.position, case.rotation, found.best.to_dict())
        smallest = np.inf
        for solution in la.synthesize(**free_request(exact, "motion", seed)[1]).solutions:
            links = solution.linkage.links
            if links.max() < 1e5 * links.min():
                polished = la.synthesize(**request, start_from=[solution.to_dict()], refine_only=True)
                smallest = min(
                    smallest, recompute_free(case.position, case.rotation, polished.best.to_dict()).objective
                )
        ratio.append(best.objective / smallest if best.one_way else np.inf)
    return {
        "samples": samples,
        "cases": cases,
        "as_good": float(np.mean(np.array(ratio) <= 1.01)),
        "worst_over_truth": report.finite(max(ratio)),
        **times.summary(),
    }


def measure_baselines() -> list[dict[str, Any]]:
    """Run differential evolution and pylinkage on the same poses; return fitting cases and times.

    All answers of pylinkage to three to five poses count; evolution also gets larger numbers of poses.
    """
    rows = []
    for samples in BASELINE_POSES:
        methods = ["linkage-atlas", "differential evolution", "pylinkage 1.3"][
            : 3 if samples <= PYLINKAGE_POSES else 2
        ]
        found: dict[str, tuple[Times, list[float]]] = {name: (Times(), []) for name in methods}
        for seed in range(BASELINE_CASES):
            case, request = free_request(free_case(seed, samples), "motion", seed)
            poses = case.position, case.rotation
            for name, (times, best) in found.items():
                if name == "pylinkage 1.3":
                    best.append(times.run(baselines.motion_through_poses, *poses))
                elif name == "differential evolution":
                    best.append(times.run(baselines.evolve_poses, *poses, GENERATIONS, seed))
                else:
                    reply = times.run(la.synthesize, **request)
                    recomputed = [recompute_free(*poses, solution.to_dict()) for solution in reply.solutions]
                    best.append(min((result.objective for result in recomputed if result.one_way), default=np.inf))
        for name, (times, best) in found.items():
            rows.append({"method": name, "samples": samples, "cases": len(best), **times.summary()})
            rows[-1] |= {
                "reached": float(np.mean(np.array(best) < REACHED)),
                "median_objective": report.finite(np.median(best)),
            }
    return rows


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md."""
    noise = [
        row | {"times": ", ".join(report.significant(row[f"{which}_processor_ms"]) for which in ("median", "p99"))}
        for row in results["noise"]
    ]
    return report.tables("free_timing", {"noise": noise, "baselines": results["baselines"]})


def measure(
    cases: Annotated[int, "number of noisy cases for each number of samples"] = 30,
) -> Iterator[dict[str, Any]]:
    """Measure the noise, then the baselines."""
    baselines.need()
    threadpool_limits(1, "blas")
    la.prepare()
    noise = [measure_noise(samples, cases) for samples in SAMPLES]
    yield {"noise": noise, "baselines": measure_baselines()}


if __name__ == "__main__":
    report.run(measure)
