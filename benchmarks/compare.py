"""Compare the searches with another checkout: the same requests in pairs, alternately, each in its own process.

``python -m benchmarks.compare --tree ../before --cases 30`` asks the requests of `benchmarks.engine` of each class in both
trees; the other tree has its own interpreter in ``.venv`` and its own `benchmarks.engine`. An answer is *good* if its
error is within 1 % of the smaller one of the pair; the answer to an exact request is good below 1e-9. Times are processor time.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks import engine, report

WORKER = """
import json, os, sys, time
sys.path.insert(0, ".")
replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
from threadpoolctl import threadpool_limits
import linkage_atlas as la
from benchmarks import engine
threadpool_limits(1, "blas")
la.prepare()
for line in sys.stdin:
    name, seed, top = json.loads(line)
    case = engine.CLASSES[name].case(seed)
    options = {"top": top} | ({"prefer": "error"} if case.search is la.synthesize else {})
    begin = time.process_time()
    reply = case.ask(**options)
    seconds = time.process_time() - begin
    costs = [case.cost(solution.to_dict()) for solution in reply.solutions]
    replies.write(json.dumps([min(costs, default=float('inf')), 1000 * seconds]) + "\\n")
    replies.flush()
"""
"""Program that answers the requests whose class and seed it reads."""


class Worker:
    """A process that answers the requests of a tree."""

    def __init__(self, tree: Path) -> None:
        command = [str(tree.resolve() / ".venv" / "bin" / "python"), "-c", WORKER]
        self.process = subprocess.Popen(command, cwd=tree, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, name: str, seed: int) -> tuple[float, float]:
        """Return the smallest error of the answers, and milliseconds."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(json.dumps([name, seed, engine.CLASSES[name].case(seed).top]) + "\n")
        self.process.stdin.flush()
        cost, milliseconds = json.loads(self.process.stdout.readline())
        return cost, milliseconds


def row(name: str, part: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a class."""
    cost, milliseconds = (np.array(part[key], dtype=float) for key in ("cost", "ms"))
    cost = np.maximum(np.where(np.isnan(cost), np.inf, cost), engine.EXACT)  # None if nothing was found
    good = cost <= engine.CLOSE * cost.min(axis=1, keepdims=True)
    before, after = np.median(milliseconds, axis=0)
    return {
        "class": name,
        "cases": len(cost),
        "good_before": report.percent(float(good[:, 0].mean()), 3),
        "good": report.percent(float(good[:, 1].mean()), 3),
        "before": engine.ms(before),
        "after": engine.ms(after),
        "ratio": f"{after / before:.2f}",
    }


def blocks(results: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of docs/background/measurements.md."""
    rows = [row(name, part) for name, part in results["classes"].items()]
    return report.tables("compare", {"classes": rows}) | {"other": results["other"]}


def measure(
    tree: Annotated[Path, "checkout of another version, with its environment in .venv"] = Path("../before"),
    cases: Annotated[int, "requests of each class; five times as many of the quick classes"] = 30,
    classes: Annotated[str, "classes to run", tuple(engine.CLASSES)] = tuple(engine.CLASSES),
) -> Iterator[dict[str, Any]]:
    """Ask both trees alternately."""
    other = subprocess.run(["git", "rev-parse", "--short=9", "HEAD"], cwd=tree, capture_output=True, text=True)
    workers, parts = [Worker(tree), Worker(Path())], report.known("compare").get("classes", {})
    for name in classes:
        seeds = engine.CLASSES[name].seeds_of(cases)
        for worker in workers:
            worker.ask(name, seeds[0])  # tables are built once
        pairs = []
        for number, seed in enumerate(seeds):
            order = workers[:: -1 if number % 2 else 1]
            found = [worker.ask(name, seed) for worker in order][:: -1 if number % 2 else 1]
            pairs.append(found)
        parts[name] = {
            "cost": [[report.finite(float(f"{cost:.6g}")) for cost, _ in pair] for pair in pairs],
            "ms": [[round(milliseconds, 2) for _, milliseconds in pair] for pair in pairs],
        }
        print(row(name, parts[name]), flush=True)
        yield {"other": other.stdout.strip(), "classes": parts}


if __name__ == "__main__":
    report.run(measure)
