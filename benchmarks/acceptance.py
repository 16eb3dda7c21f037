"""What the search must reach, measured on every class: `python -m benchmarks.acceptance --cases 1000`.

Requests go through the service's own models to JSON and back; errors are recomputed from the JSON numbers by
`tests.oracles.recompute`. Parts of the run may be measured one at a time (``--classes``): the result file keeps what it has of
the others, each with its own number of cases and its own stamp. What was measured by this command at this commit is not measured
again: the same command goes on where it stopped.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.heavy import heavy_within
from benchmarks.product import ServiceResources, answer, counter_clockwise, limits_of, prepared_service, target_of
from benchmarks.report import Times
from tests.oracles.classes import CLASSES, EXACT, HARD, Case, limited_case, make_case
from tests.oracles.recompute import REACHED, broken_limits, compare, recompute

EPSILON = float(np.finfo(float).eps)
LIMITS = "limits"
PARTS = (*CLASSES, LIMITS)
WORSE = 1.001
"""Times the J of the refined truth that the best solution among noise may have."""
FEWER = {"noise": 200, LIMITS: 200}
"""At most so many cases of what takes long."""
TITLES = {
    "plain": "plain crank-rocker, 30..360 degrees",
    "any order": "any order, crank shortest",
    "tiny span": "tiny span, 2..12 degrees",
    "tiny crank": "tiny crank, below 1/400 of the perimeter",
    "change point": "within 1e-8..1e-1 of a change point",
    "offset 1e6": "positions 1e6 times their size away",
    "noise": "noise of 1e-3 on everything",
    LIMITS: "random limits",
}


def wanted_share(kind: str) -> float:
    """The share of a class's cases that must reach the goal."""
    if kind in HARD:
        return 0.99
    return 1.0 if kind == "noise" else 0.999


def measure_class(kind: str, cases: int, resources: ServiceResources) -> dict[str, Any]:
    """One class: recomputed J of the best solution, agreement of reported errors, milliseconds."""
    times, stops, compared, objective, goals, references, failures = Times(), Counter(), [], [], [], [], []
    for seed in range(cases):
        case = make_case(kind, seed)
        reply = answer(case.request, resources, times)
        solutions = reply["solutions"]
        best = np.inf
        if solutions:  # the best one always, and of the others one in turn
            turn = seed % max(1, len(solutions) - 1) if kind in EXACT else 0
            both = [compare(case.request, solution) for solution in [solutions[0], *solutions[1:][turn:][:1]]]
            # inexact ones of fair size come before one out of all proportion, which is then second
            best = both[0].objective if kind in EXACT else min(one.objective for one in both)
            compared += both
        stops[reply["report"]["stopped_by"]] += 1
        if kind in EXACT:
            reached = best < REACHED
        else:
            references.append(refined_truth(case, resources))
            reached = best <= WORSE * references[-1]
        objective.append(best)
        goals.append(reached)
        if not reached:
            failures.append({"seed": seed, "objective": report.finite(best), "ms": 1000 * times.wall[-1]})
    result = {
        "cases": cases,
        "reached": float(np.mean(goals)),
        "failures": failures,
        "median_objective": report.finite(np.median(objective)),
        "worst_objective": report.finite(max(objective)),
        "worst_disagreement": max(one.gap for one in compared),
        "worst_disagreement_in_roundings": max(one.gap / (EPSILON * one.size) for one in compared),
        **times.summary(),
        "stopped_by": dict(stops),
        "short": float(np.mean(goals)) < wanted_share(kind),
    }
    if references:
        result["worst_over_reference"] = report.finite(np.max(np.array(objective) / references))
    return result


def refined_truth(case: Case, resources: ServiceResources) -> float:
    """J of the linkage whose motion was made noisy, refined on the noisy motion: of itself any fit is better."""
    asked = case.request | {"start_from": [case.truth], "local": True, "top": 1}
    return recompute(case.request, answer(asked, resources, Times())["solutions"][0]).objective


def measure_limits(cases: int, resources: ServiceResources) -> dict[str, Any]:
    """Random limited requests: limits broken by a returned solution, and whether "infeasible" is true."""
    times, statuses, broken, wrong = Times(), Counter(), [], []
    for seed in range(cases):
        request = limited_case(seed).request
        reply = answer(request, resources, times)
        statuses[reply["status"]] += 1
        for solution in reply["solutions"]:
            if names := broken_limits(request, solution):
                broken.append({"seed": seed, "rank": solution["rank"], "limits": names})
        if reply["status"] == "infeasible":
            best = heavy_within(*counter_clockwise(target_of(request), limits_of(request)))
            if best is not None:
                stopped = reply["report"]["stopped_by"]
                wrong.append({"seed": seed, "objective": best, "limits": request["limits"], "stopped_by": stopped})
    return {
        "cases": cases,
        "statuses": dict(statuses),
        "broken": broken,
        "wrongly_infeasible": wrong,
        **times.summary(),
        "short": bool(broken or wrong),
    }


def outcome(part: str, result: dict[str, Any]) -> str:
    """In words what came out for a part that is no exact class."""
    if part == "noise":
        return (
            f"J at most {result['worst_over_reference']:.3f} times that of the true linkage, refined (the first two)"
        )
    return f"{len(result['broken'])} limits broken, {len(result['wrongly_infeasible'])} times infeasible wrongly"


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of section 10 of docs/method.md; each row with its own number of cases."""
    parts = {part: results["parts"][part] for part in PARTS if part in results["parts"]}
    rows = [
        {
            "class": TITLES.get(part, part),
            "outcome": None if part in EXACT else outcome(part, result),
            "times": ", ".join(report.significant(result[f"{which}_processor_ms"]) for which in ("median", "p99")),
            **result,
        }
        for part, result in parts.items()
    ]
    stamps = [results["made"], *(part["made"] for part in parts.values() if "made" in part)]
    tables = {
        kind: [row for row in rows if (row["outcome"] is None) == (kind == "exact")] for kind in ("exact", "other")
    }
    return report.tables("acceptance", tables) | {"made": report.made_text(stamps)}


def measure(
    cases: Annotated[int, "of each class"] = 1000,
    classes: Annotated[str, "parts of the run; the others stay as they are", PARTS] = PARTS,
) -> Iterator[dict[str, Any]]:
    """The classes in turn; exit code 1 where one is short of its goal."""
    resources = prepared_service()
    answer(make_case("plain", 0).request, resources, Times())
    stamp = report.stamp()
    measured = report.load("acceptance")["parts"] if (report.RESULTS / "acceptance.json").exists() else {}
    for part in classes:
        some = min(cases, FEWER.get(part, cases))
        if measured.get(part, {}).get("made") == stamp and not stamp["commit"].endswith("+changes"):
            yield {"made": stamp, "parts": measured}
            continue
        found = measure_limits(some, resources) if part == LIMITS else measure_class(part, some, resources)
        print(part, json.dumps(found | {"failures": found.get("failures", [])[:20]}), flush=True)
        measured[part] = {**found, "made": stamp}
        yield {"made": stamp, "parts": measured}
    if short := [part for part in classes if measured[part]["short"]]:
        raise SystemExit(f"short of their goals: {', '.join(short)}")


if __name__ == "__main__":
    report.run(measure)
