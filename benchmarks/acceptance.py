"""What the refinement must reach, measured on every class: `python -m benchmarks.acceptance --cases 1000`.

Requests go through the service's own models to JSON and back; errors are recomputed from the JSON numbers by `recompute`.
Parts of the run may be measured one at a time (``--classes``): the result file keeps what it has of the others. Beside the
time on the clock stands that of the processor, which other work on the machine does not stretch.
"""

from __future__ import annotations

import argparse
import http.client
import json
import math
import os
import platform
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from app.motion import SynthesizeRequest, answer_synthesize
from app.resources import ServiceResources
from app.settings import Settings
from benchmarks.classes import EXACT, HARD, NAMES, UNREACHABLE, Case, generator, make_case
from benchmarks.heavy import heavy_objective, heavy_within
from benchmarks.recompute import recompute, requested_crank
from synthesis.fourbar.limits import Limits
from synthesis.target import Target

RESULT = Path(__file__).parent / "results" / "acceptance.json"
REACHED = 1e-9
EPSILON = float(np.finfo(float).eps)
LIMITS, HTTP = "limits", "http"
UNREACHABLE_CASES, LIMITED_CASES, HTTP_CASES = 60, 200, 300
UNREACHABLE_MARGIN = 1.01


class Times:
    """Milliseconds of answers: on the clock, and of the processor."""

    def __init__(self) -> None:
        self.wall: list[float] = []
        self.processor: list[float] = []

    def summary(self) -> dict[str, float]:
        """Median and 99th percentile of both."""
        return {
            "median_ms": float(np.median(self.wall)),
            "p99_ms": float(np.percentile(self.wall, 99)),
            "median_processor_ms": float(np.median(self.processor)),
            "p99_processor_ms": float(np.percentile(self.processor, 99)),
        }


def answer(request: dict[str, Any], resources: ServiceResources, times: Times) -> dict[str, Any]:
    """The reply as JSON values; timed is the way from the parsed request to the reply's text."""
    begin, processor = time.perf_counter(), time.process_time()
    text = answer_synthesize(SynthesizeRequest.model_validate(request), resources).model_dump_json()
    times.wall.append(1000 * (time.perf_counter() - begin))
    times.processor.append(1000 * (time.process_time() - processor))
    return json.loads(text)


def target_of(request: dict[str, Any]) -> Target:
    """The request as the numerics see it."""
    model = SynthesizeRequest.model_validate(request)
    return model.target(model.rotation, model.position, model.length_scale)


class Compared(NamedTuple):
    """A solution's recomputed J, and how far its reported errors are from the recomputed ones, in the objective's measure."""

    objective: float
    gap: float
    size: float
    """Largest length or distance in the solution over the length scale: the gap cannot be below its rounding."""


def compare(request: dict[str, Any], solution: dict[str, Any]) -> Compared:
    """Reported against recomputed errors of one solution."""
    mine = recompute(request, solution)
    if mine is None:
        return Compared(np.inf, np.inf, 1.0)
    reported, unit, size = solution["errors"], np.pi / 180, 1.0
    gaps = [abs(reported["objective"] - mine.objective)]
    if mine.rotation_rms is not None:
        gaps += [abs(reported[name] * unit - getattr(mine, name)) for name in ("rotation_rms", "rotation_max")]
    if mine.position_rms is not None:
        scale = target_of(request).length_scale
        gaps += [abs(reported[name] - getattr(mine, name)) / scale for name in ("position_rms", "position_max")]
        mount = solution["mount"]
        lengths = [*solution["links"].values(), mount["coupler_point"]["radius"]]
        points = [mount["pivot_a"], mount["pivot_b"], request["position"][0]]
        size = max(1.0, max(lengths) / scale, *(math.hypot(*point) / scale for point in points))
    return Compared(mine.objective, max(gaps), size)


def measure_class(kind: str, cases: int, resources: ServiceResources) -> dict[str, Any]:
    """One class: recomputed J of the best solution, agreement of reported errors, milliseconds."""
    found, compared, times, stops = [], [], Times(), Counter()
    failures: list[dict[str, float]] = []
    truths = []
    for seed in range(cases):
        case = make_case(kind, seed)
        reply = answer(case.request, resources, times)
        solutions = reply["solutions"]
        best = np.inf
        if solutions:  # the best one always, and of the others one in turn
            chosen = [solutions[0], *solutions[1:][seed % max(1, len(solutions) - 1) :][:1]]
            both = [compare(case.request, solution) for solution in chosen]
            best = both[0].objective
            compared += both
        found.append(best)
        stops[reply["report"]["stopped_by"]] += 1
        if kind == UNREACHABLE:
            truths.append(heavy_objective(target_of(case.request)))
        elif kind not in EXACT:
            truths.append(recompute(case.request, case.truth).objective)
        reached = (
            best < REACHED
            if kind in EXACT
            else best <= truths[-1] * (UNREACHABLE_MARGIN if kind == UNREACHABLE else 1.0)
        )
        if not reached:
            failures.append({"seed": seed, "objective": best, "ms": times.wall[-1]})
    objective = np.array(found)
    result = {
        "cases": cases,
        "reached": 1 - len(failures) / cases,
        "failures": failures,
        "median_objective": float(np.median(objective)),
        "worst_objective": float(objective.max()),
        "worst_disagreement": max(one.gap for one in compared),
        "worst_disagreement_in_roundings": max(one.gap / (EPSILON * one.size) for one in compared),
        **times.summary(),
        "stopped_by": dict(stops),
    }
    if truths:
        result["worst_over_reference"] = float(np.max(objective / np.array(truths)))
    return result


# -- limits -----------------------------------------------------------------------------------------------------------


def limited_case(seed: int) -> Case:
    """A request with random limits, of which the linkage it was made from keeps some."""
    random = generator(LIMITS, seed)
    kind = str(
        random.choice(["plain", "any order", "double-crank", "clockwise", "position only", "rotation only", "noise"])
    )
    case = make_case(kind, 100_000 + seed)
    truth, request = case.truth, dict(case.request)
    limits: dict[str, Any] = {"family": str(random.choice(["full_crank", "crank_rocker", "double_crank", "any"]))}
    chosen = random.random(4) < 0.5
    if chosen[0] or not chosen.any():
        limits["transmission_angle_min"] = random.uniform(5, 55)
    links = np.array(list(truth["links"].values()))
    if truth["mount"] is None:
        links = links / links[3]
    if chosen[1]:
        limits["link_min"] = float(links.min() * random.uniform(0.3, 1.5))
    if chosen[2]:
        limits["link_max"] = float(links.max() * random.uniform(0.7, 3.0))
    if chosen[3] and truth["mount"] is not None:
        pivot = np.array(truth["mount"]["pivot_a"]) + random.uniform(-0.3, 0.3, 2)
        half = random.uniform(0.1, 1.0, 2)
        limits["pivot_box"] = [*(pivot - half).tolist(), *(pivot + half).tolist()]
    return Case(kind, seed, request | {"limits": limits}, truth)


def broken_limits(request: dict[str, Any], solution: dict[str, Any]) -> list[str]:
    """Limits that a solution breaks, checked on its JSON numbers alone."""
    limits, broken = request["limits"], []
    links = np.array([solution["links"][name] for name in ("crank", "coupler", "rocker", "ground")])
    l1, l2, l3, l4 = links
    if "link_min" in limits and links.min() < limits["link_min"]:
        broken.append("link_min")
    if "link_max" in limits and links.max() > limits["link_max"]:
        broken.append("link_max")
    if "pivot_box" in limits:
        xmin, ymin, xmax, ymax = limits["pivot_box"]
        for x, y in (solution["mount"]["pivot_a"], solution["mount"]["pivot_b"]):
            if not (xmin <= x <= xmax and ymin <= y <= ymax):
                broken.append("pivot_box")
    # Grashof: shortest + longest < the other two, in exact arithmetic; the family is named by the shortest link
    shortest, *middle, longest = sorted(Fraction(float(value)) for value in links)
    grashof = shortest + longest < sum(middle)
    crank_rocker, double_crank = grashof and l1 == links.min(), grashof and l4 == links.min()
    allowed = {
        "full_crank": crank_rocker or double_crank,
        "crank_rocker": crank_rocker,
        "double_crank": double_crank,
        "any": True,
    }
    if not allowed[limits["family"]]:
        broken.append("family")
    crank = np.array([float(t) for t in requested_crank(request)])
    fine = np.radians(solution["start_angle"]) + np.linspace(crank[0], crank[-1], 4001)
    square = l1**2 + l4**2 - 2 * l1 * l4 * np.cos(fine)
    cosine = (l2**2 + l3**2 - square) / (2 * l2 * l3)
    if np.abs(cosine).max() > 1 + 1e-9:
        broken.append("closure")
    elif "transmission_angle_min" in limits:
        least = np.degrees(np.arccos(np.minimum(np.abs(cosine), 1.0)).min())
        if least < limits["transmission_angle_min"] - 1e-9:
            broken.append("transmission_angle_min")
    return broken


def measure_limits(cases: int, resources: ServiceResources) -> dict[str, Any]:
    """Random limited requests: limits broken by a returned solution, and whether "infeasible" is true."""
    times, statuses = Times(), Counter()
    broken: list[dict[str, Any]] = []
    wrong: list[dict[str, Any]] = []
    for seed in range(cases):
        case = limited_case(seed)
        reply = answer(case.request, resources, times)
        statuses[reply["status"]] += 1
        for solution in reply["solutions"]:
            if names := broken_limits(case.request, solution):
                broken.append({"seed": seed, "rank": solution["rank"], "limits": names})
        if reply["status"] == "infeasible":
            asked = case.request["limits"]
            box = asked.get("pivot_box")
            limits = Limits(
                asked["family"],
                np.radians(asked.get("transmission_angle_min", 0.0)),
                None if box is None else tuple(box),
                asked.get("link_min"),
                asked.get("link_max"),
            )
            best = heavy_within(target_of(case.request), limits)
            if best is not None:
                stopped = reply["report"]["stopped_by"]
                wrong.append(
                    {"seed": seed, "kind": case.kind, "objective": best, "limits": asked, "stopped_by": stopped}
                )
    return {
        "cases": cases,
        "statuses": dict(statuses),
        "broken": broken,
        "wrongly_infeasible": wrong,
        **times.summary(),
    }


# -- over HTTP --------------------------------------------------------------------------------------------------------


def measure_http(cases: int) -> dict[str, Any]:
    """The plain class over HTTP: one client on one kept connection."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "uvicorn", "app.main:create_app", "--factory", "--port", str(port)]
    server = subprocess.Popen([*command, "--log-level", "warning"], cwd=Path(__file__).parents[1])
    try:
        connection = _connect(port, server)
        headers = {"content-type": "application/json"}
        times = []
        for seed in range(cases + 10):
            body = json.dumps(make_case("plain", seed).request)
            begin = time.perf_counter()
            connection.request("POST", "/v1/synthesize", body, headers)
            response = connection.getresponse()
            content = response.read()
            times.append(1000 * (time.perf_counter() - begin))
            if response.status != 200:
                raise RuntimeError(f"seed {seed}: status {response.status}: {content[:200]!r}")
    finally:
        server.terminate()
        server.wait()
    times = times[10:]  # the first requests warm up
    return {"cases": cases, "median_ms": float(np.median(times)), "p99_ms": float(np.percentile(times, 99))}


def _connect(port: int, server: subprocess.Popen[bytes]) -> http.client.HTTPConnection:
    for _ in range(600):
        if server.poll() is not None:
            raise RuntimeError(f"the server ended with exit code {server.returncode}")
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        try:
            connection.request("GET", "/livez")
            connection.getresponse().read()
        except OSError:
            time.sleep(0.1)
        else:
            return connection
    raise RuntimeError("the server did not answer within a minute")


# -- all of it --------------------------------------------------------------------------------------------------------


def measure(part: str, cases: int, resources: ServiceResources) -> dict[str, Any]:
    """One class, or `LIMITS`, or `HTTP`."""
    if part == LIMITS:
        return measure_limits(min(cases, LIMITED_CASES), resources)
    if part == HTTP:
        return measure_http(min(cases, HTTP_CASES))
    return measure_class(part, min(cases, UNREACHABLE_CASES) if part == UNREACHABLE else cases, resources)


def row(part: str, result: dict[str, Any]) -> str:
    """One line of the table."""
    names = ("median_ms", "p99_ms", "median_processor_ms", "p99_processor_ms")
    times = " ".join(f"{result[name]:9.1f}" if name in result else "" for name in names)
    if part == HTTP:
        return f"{part:20s} {result['cases']:6d} {'':51s} {times}"
    if part == LIMITS:
        text = f"{len(result['broken'])} limits broken, {len(result['wrongly_infeasible'])} wrongly infeasible"
        return f"{part:20s} {result['cases']:6d} {text:51s} {times}"
    share = f"{100 * result['reached']:9.2f} %"
    worst = result.get("worst_over_reference")
    worst = f"{result['worst_objective']:14.1e}" if worst is None else f"{worst:12.4f} x"
    gap = f"{result['worst_disagreement']:12.1e} {result['worst_disagreement_in_roundings']:10.0f}"
    return f"{part:20s} {result['cases']:6d} {share} {worst} {gap} {times}"


def wanted_share(kind: str) -> float | None:
    """The share of cases that must reach the goal."""
    if kind in HARD:
        return 0.99
    return {"noise": 1.0, UNREACHABLE: 0.95}.get(kind, 0.999 if kind in EXACT else None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the table, write the result file."""
    parts = (*NAMES, LIMITS, HTTP)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--classes", nargs="+", choices=parts, default=parts, metavar="CLASS", help=", ".join(parts))
    parser.add_argument("--output", type=Path, default=RESULT)
    options = parser.parse_args(arguments)
    resources = ServiceResources(Settings())
    _ = resources.levels
    answer(make_case("plain", 0).request, resources, Times())
    report = json.loads(options.output.read_text()) if options.output.exists() else {"parts": {}}
    report["machine"] = {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()}
    header = (
        "class",
        "cases",
        "reached",
        "worst J / ratio",
        "reported off",
        "roundings",
        "median ms",
        "p99 ms",
        "of cpu",
        "p99 of cpu",
    )
    print("{:20s} {:>6s} {:>11s} {:>14s} {:>12s} {:>10s} {:>9s} {:>9s} {:>9s} {:>9s}".format(*header))
    short = False
    for part in options.classes:
        result = measure(part, options.cases, resources)
        report["parts"][part] = result
        print(row(part, result), flush=True)
        wanted = wanted_share(part)
        if wanted is not None and result["reached"] < wanted:
            short = True
            seeds = ", ".join(f"{f['seed']} ({f['objective']:.1e})" for f in result["failures"][:20])
            print(f"  short of {100 * wanted:g} %; seeds: {seeds}")
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(report, indent=1) + "\n")
    return int(short)


if __name__ == "__main__":
    raise SystemExit(main())
