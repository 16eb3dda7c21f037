"""First answers to everyday requests with free crank angles: balanced answers of any family and smallest errors of full cranks.

The second was the former default. The requests are random lids and flaps, straight lines, drawn paths, and user
requests.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import report
from benchmarks.battery import drawn
from benchmarks.figures import BLUE, GREY, ORANGE, figure
from synthesis.ranking import CRITERIA, PREFERENCES

BEFORE = {"prefer": "error", "limits": {"family": "full_crank"}}
USER_REQUESTS = {
    "line of 10 points": {"position": [[k, k] for k in range(10)]},
    "shelf in a cabinet": {
        "rotation": [0, 0, 0],
        "position": [[2, 172], [28.15, 166.2], [42.55, 143.6]],
        "limits": {"pivot_box": [0, 170, 40, 250]},
    },
    "three poses in a box": {
        "rotation": [0, 15, 40],
        "position": [[0, 0], [40, 8], [75, 30]],
        "limits": {"pivot_box": [-30, -30, 100, 60]},
    },
    "lid that goes over": {
        "rotation": [0, 180],
        "position": [[15, 10], [0, 15]],
        "limits": {"pivot_box": [0, 0, 15, 10]},
    },
}
"""User requests without their timing."""


def lid(seed: int) -> dict[str, Any]:
    """Draw seven poses of a lid or flap that turns by 40 to 110 degrees, rounded to a tenth."""
    random = np.random.default_rng([seed, 7])
    share = np.linspace(0, 1, 7)
    turn = random.uniform(40, 110) * random.choice([-1, 1])
    end, bend = random.uniform(100, 400) * np.exp(1j * random.uniform(-np.pi, np.pi)), random.uniform(-0.4, 0.4)
    path = end * (share + 1j * bend * np.sin(np.pi * share))
    return {"rotation": np.round(turn * share, 1), "position": np.round(np.column_stack([path.real, path.imag]), 1)}


def line(seed: int) -> dict[str, Any]:
    """Draw points of a straight line in a random direction."""
    random = np.random.default_rng([seed, 8])
    along = np.linspace(0, 100, int(random.integers(6, 25))) * np.exp(1j * random.uniform(0, np.pi))
    return {"position": np.column_stack([along.real, along.imag])}


def path(seed: int) -> dict[str, Any]:
    """Draw an open path by a wobbly hand."""
    shapes = ("slanting line", "wave", "arc", "hook", "corner", "S", "step")
    return {"position": drawn(shapes[seed % len(shapes)], (8, 16, 24)[seed % 3], 1.0)["position"]}


GROUPS = {"lids and flaps": lid, "straight lines": line, "drawn paths": path}


def first_answer(request: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Solve a request; return the measures of the first answer, and the error of the most accurate answer over the extent."""
    limits = request.get("limits", {}) | options.get("limits", {})
    start = time.process_time()
    found = la.synthesize(**request | options | {"timing": "free", "limits": limits})
    seconds = time.process_time() - start
    most_accurate = min(found, key=lambda solution: solution.errors.objective)
    return {
        "size": found.best.size,
        "transmission": found.best.transmission_angle_min,
        "error": found.best.errors.objective,
        "least": most_accurate.errors.objective,
        "ms": 1000 * seconds,
    }


def summary(group: str, options: str, answers: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the medians of first answers."""
    columns = {name: np.array([answer[name] for answer in answers]) for name in answers[0]}
    return {
        "group": group,
        "options": options,
        "cases": len(answers),
        "size": float(np.median(columns["size"])),
        "size_p90": float(np.quantile(columns["size"], 0.9)),
        "transmission": float(np.median(columns["transmission"])),
        "comfortable": float(np.mean(columns["transmission"] >= 40)),
        "error": float(np.median(columns["error"])),
        "ms": float(np.median(columns["ms"])),
    }


def measure(cases: Annotated[int, "number of cases of each group"] = 20) -> Iterator[dict[str, Any]]:
    """Measure all groups with both options, one after the other."""
    la.prepare()
    la.synthesize([0, 10], [[0, 0], [1, 1]], timing="free")  # the work of the first request is not timed
    rows, points = [], []
    with threadpool_limits(1):
        tasks = {group: [draw_task(seed) for seed in range(cases)] for group, draw_task in GROUPS.items()}
        for group, requests in (tasks | {name: [request] for name, request in USER_REQUESTS.items()}).items():
            pairs = [(first_answer(request, BEFORE), first_answer(request, {})) for request in requests]
            before, now = (list(column) for column in zip(*pairs))
            rows += [summary(group, "least error of full cranks", before), summary(group, "balanced", now)]
            points += [
                {"size": [old["size"], new["size"]], "transmission": [old["transmission"], new["transmission"]]}
                for old, new in pairs
            ]
        yield {"rows": rows, "points": points}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the table of the document and the table of the rule."""
    criteria = [*CRITERIA.items(), *((f"`{name}`", criterion) for name, criterion in PREFERENCES.items())]
    rule = [{"criterion": name, "rule": criterion.rule} for name, criterion in criteria]
    return report.tables("first_answers", {"rows": results["rows"], "rule": rule})


def draw(results: dict[str, Any]) -> None:
    """Draw size and transmission angle of each pair of first answers."""
    with figure("first_answers.svg", size=(7, 4.2)) as (_, (axes,)):
        for point in results["points"]:
            axes.plot(point["size"], point["transmission"], color=GREY, lw=0.7, zorder=1)
        for column, (name, color) in enumerate((("least error of full cranks", ORANGE), ("balanced", BLUE))):
            sizes, angles = ([point[key][column] for point in results["points"]] for key in ("size", "transmission"))
            axes.plot(sizes, angles, "o", ms=4, color=color, label=name)
        axes.set(xscale="log", xlabel="size, extents of the motion", ylabel="transmission angle, degrees")
        axes.legend(loc="upper right")


if __name__ == "__main__":
    report.run(measure)
