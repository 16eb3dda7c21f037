"""Poses and paths without crank angles: recovery and run time of random exact requests, noise, public cases, and baselines.

``python -m benchmarks.free_timing`` measures the classes (``--classes`` some of them; the others stay as they are);
``--public DIR`` instead the published cases that lie in a folder, each a JSON file with its citation. J is recomputed from
the reply's numbers by `tests.oracles.free_classes`; times are those of `linkage_atlas.synthesize`, ten solutions with all
that is told of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import baselines, report
from benchmarks.heavy import heavy_poses
from benchmarks.report import Times
from tests.oracles.free_classes import FreeCase, free_case, free_request, recompute_free

REACHED = 1e-9
MOTION = (5, 6, 8, 10, 15, 30, 60, 100)
FEW, MIXED, SWINGING = (2, 3, 4), (5, 6, 8, 10, 15, 30, 60, 100), (5, 6, 10, 30)
PATHS = (6, 8, 9, 10, 12, 15, 20, 30, 60, 100)
NOISY = (6, 10, 20, 60)
KINDS = {"motion": MOTION, "few": FEW, "mixed": MIXED, "any family": SWINGING, "noise": NOISY, "path": PATHS}
CLASSES = tuple(f"{kind} {samples}" for kind, sizes in KINDS.items() for samples in sizes)
RANDOM = (6, 10, 20)
RANDOM_CLASSES = tuple(f"random {samples}" for samples in RANDOM)
BASELINE_POSES, BASELINE_CASES, PYLINKAGE_POSES = (3, 4, 5, 8), 30, 5
GENERATIONS = 300


def measure_class(name: str, cases: int) -> dict[str, Any]:
    """One class: recomputed J of the best solution that keeps the order, and milliseconds."""
    kind, samples = name.rsplit(" ", 1)
    times, objective, reference, many, failures = Times(), [], [], [], []
    for seed in range(cases):
        case, request = free_request(free_case(seed, int(samples), swinging=kind == "any family"), kind, seed)
        found = times.run(la.synthesize, **request)
        told = [one.to_dict() for one in found.solutions]
        done = [recompute_free(case.position, case.rotation, one) for one in told]
        best = min((one.objective for one in done if one.one_way), default=np.inf)
        objective.append(best)
        many.append(sum(one.objective < REACHED and one.one_way for one in done))
        if kind == "noise":
            reference.append(truth_polished(case))
        elif best >= REACHED:
            failures.append({"seed": seed, "objective": report.finite(best)})
    result = {
        "cases": cases,
        "reached": float(np.mean(np.array(objective) < REACHED)),
        "nearly": float(np.mean(np.array(objective) < 1e-6)),
        "median_objective": report.finite(np.median(objective)),
        "worst_objective": report.finite(max(objective)),
        "ten": float(np.mean(np.array(many) >= 10)),
        "failures": failures[:50],
        **times.summary(),
    }
    if reference:
        ratio = np.array(objective) / reference
        result |= {"as_good": float(np.mean(ratio <= 1.01)), "worst_over_truth": report.finite(ratio.max())}
    return result


def measure_random(name: str, cases: int) -> dict[str, Any]:
    """Poses drawn at random, which no four-bar makes: J beside that of a heavy search, and milliseconds of both."""
    samples, ours, theirs, ratio = int(name.split()[1]), Times(), Times(), []
    for seed in range(cases):
        random = np.random.default_rng([55, samples, seed])
        rotation = random.uniform(-1, 1, samples)
        position = random.standard_normal(samples) + 1j * random.standard_normal(samples)
        found = ours.run(la.synthesize, np.rad2deg(rotation), position, timing="free", limits={"preset": "none"})
        told = recompute_free(position, rotation, found.best.to_dict()) if found.solutions else None
        least = theirs.run(heavy_poses, rotation, position)
        ratio.append(told.objective / least if told is not None and told.one_way else np.inf)
    heavy = theirs.summary()
    return {
        "cases": cases,
        "as_good": float(np.mean(np.array(ratio) <= 1.01)),
        "worst": report.finite(max(ratio)),
        "heavy_processor_ms": heavy["median_processor_ms"],
        **ours.summary(),
    }


def truth_polished(case: FreeCase) -> float:
    """J of the true linkage refined on the noisy samples: what a search should not be above."""
    from synthesis.fourbar.charts import FullCrankChart
    from synthesis.free.joint import JointProblem, Timed, refine
    from synthesis.free.poses import make_poses

    problem = JointProblem(make_poses(case.rotation, case.position), FullCrankChart())
    shape = problem.chart.unknowns(case.lengths[None])
    branch, pose = np.array([float(case.branch)]), np.zeros((1, 3), dtype=complex)
    start = Timed(shape, pose, np.zeros(1), case.theta1[None], branch)
    offset = np.angle(np.exp(1j * (case.rotation - problem.turned(start).body.angle)).mean(axis=1))
    return float(np.sqrt(refine(problem, start._replace(offset=offset), 300).cost[0]))


def measure_baselines() -> list[dict[str, Any]]:
    """Differential evolution and pylinkage beside ours on the same poses: how many fit, of how many cases, in which time.

    Of pylinkage all answers to three to five poses count; evolution is also given more poses.
    """
    skipped, rows = baselines.missing(), []
    for samples in BASELINE_POSES:
        found: dict[str, tuple[Times, list[float]]] = {"linkage-atlas": (Times(), [])}
        if "scipy" not in skipped:
            found["differential evolution"] = Times(), []
        if "pylinkage" not in skipped and samples <= PYLINKAGE_POSES:
            found["pylinkage 1.3"] = Times(), []
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
                    told = [recompute_free(*poses, one.to_dict()) for one in reply.solutions]
                    best.append(min((one.objective for one in told if one.one_way), default=np.inf))
        for name, (times, best) in found.items():
            rows.append({"method": name, "samples": samples, "cases": len(best), **times.summary()})
            rows[-1] |= {
                "reached": float(np.mean(np.array(best) < REACHED)),
                "median_objective": report.finite(np.median(best)),
            }
    return rows


def public_case(path: Path) -> list[dict[str, Any]]:
    """The rows of a published case: its motion or path, by the family that is found best, errors as in its source."""
    told = json.loads(path.read_text())
    if told["kind"] not in ("motion", "path"):
        return []
    position = np.array(told["position"]) @ [1, 1j]
    closed = bool(abs(position[0] - position[-1]) < 1e-9 * np.ptp(position.real))
    rows = []
    for family in ("full_crank", "any") if told["kind"] == "motion" else ("full_crank",):
        times = Times()
        request = {"rotation": told.get("rotation"), "position": position, "degrees": False}
        request |= {"limits": {"family": family, "preset": "none"}, "length_scale": told.get("length_scale")}
        timed = told.get("crank_angle")
        request |= {"crank_angle": np.subtract(timed, timed[0])} if timed else {"timing": "free", "closed": closed}
        found = times.run(la.synthesize, **request)
        rows.append(
            {
                "case": told["name"],
                "timing": "given" if timed else "free",
                "citation": told["citation"],
                "samples": position.size,
                "family": family,
                "best_known": {name: value for name, value in told["best_known"].items() if name != "who"},
                "position_rms": found.best.errors.position_rms if found.solutions else None,
                "sse": position.size * found.best.errors.position_rms**2 if found.solutions else None,
                "rotation_rms_deg": np.rad2deg(found.best.errors.rotation_rms) if told.get("rotation") else None,
                "ms": 1000 * times.processor[0],
                "links": found.best.linkage.links.tolist() if found.solutions else None,
            }
        )
    return rows


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/free_timing.md."""
    parts = results["parts"]
    rows = []
    for name in CLASSES + RANDOM_CLASSES:
        if name in parts:
            found = parts[name]
            times = ", ".join(report.significant(found[f"{which}_processor_ms"]) for which in ("median", "p99"))
            rows.append({"class": name.rsplit(" ", 1)[0], "samples": name.rsplit(" ", 1)[1], "times": times, **found})
    exact = [row for row in rows if row["class"] not in ("noise", "random")]
    drawn = [row for row in rows if row["class"] == "random"]
    noisy = [row for row in rows if row["class"] == "noise"]
    stamps = [results["made"], *(part["made"] for part in parts.values())]
    public = [
        row
        | {
            "known": ", ".join(f"{name} {value}" for name, value in row["best_known"].items()),
            "longest": max(row["links"]) if row["links"] else None,
            "turn": report.significant(row["rotation_rms_deg"]),
        }
        for row in results.get("public", [])
    ]
    tables = {
        "exact": exact,
        "noise": noisy,
        "random": drawn,
        "public": public,
        "baselines": results.get("baselines", []),
    }
    return report.tables("free_timing", tables) | {"made": report.made_text(stamps)}


def measure(
    cases: Annotated[int, "of each class; 300 at most for paths and noise, 60 for random poses"] = 1000,
    classes: Annotated[str, "parts of the run; the others stay as they are", CLASSES + RANDOM_CLASSES] = (
        CLASSES + RANDOM_CLASSES
    ),
    public: Annotated[Path | None, "measure the published cases of this folder instead"] = None,
) -> Iterator[dict[str, Any]]:
    """The classes in turn, then the baselines; or the published cases."""
    threadpool_limits(1, "blas")
    la.prepare()
    stamp = report.stamp()
    path = report.RESULTS / "free_timing.json"
    kept = report.load("free_timing") if path.exists() else {"parts": {}}
    if public is not None:
        rows = [row for file in sorted(public.glob("*.json")) for row in public_case(file)]
        yield {**kept, "made": stamp, "public": rows}
        return
    for name in classes:
        if name in RANDOM_CLASSES:
            found = measure_random(name, min(cases, 60))
        else:
            few = name.startswith(("path", "noise"))
            found = measure_class(name, min(cases, 300) if few else cases)
        print(name, json.dumps(found), flush=True)
        kept["parts"][name] = {**found, "made": stamp}
        yield {**kept, "made": stamp}
    yield {**kept, "made": stamp, "baselines": measure_baselines()}


if __name__ == "__main__":
    report.run(measure)
