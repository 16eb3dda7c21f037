"""The lift within constraints: what they cost, and the search beside differential evolution of 200,000 evaluations.

Run ``python -m benchmarks.lift_constrained``; it writes ``benchmarks/results/lift_constrained.json`` and numbers of
``docs/lift.md``. Objective and constraints are the product's own for both searches: what is compared is the search. What a
design is like is recomputed by ``tests.oracles.lift``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from benchmarks import report
from benchmarks.report import Times, percent
from synthesis.scenes.lift.constraints import constraint_rows, optimize_within
from synthesis.scenes.lift.optimum import optimize
from tests.oracles import lift as oracle
from tests.oracles.lift_constrained import cases, evolved


def measure(evaluations: Annotated[int, "of the differential evolution"] = 200_000) -> Iterator[dict[str, Any]]:
    """Each set: our optimum and time, the evolution's, what the design is like by independent code, the cost."""
    rows = []
    for name, (task, wanted) in cases().items():
        clock = Times()
        found = clock.run(optimize_within, task, wanted)
        for _ in range(2):
            clock.run(optimize_within, task, wanted)
        other = Times()
        best, count = other.run(evolved, task, wanted, evaluations)
        design, closed = found.stroke_design.design, float(found.stroke_design.closed_length)
        values = oracle.measures(design, closed, task.cylinder.speed, task.low, task.high)
        free = optimize(task)
        rows.append(
            {
                "set": name,
                "objective": task.objective.kind,
                "design": design.as_dict(),
                "closed": closed,
                "f": found.objective,
                "active": found.active,
                "seconds": clock.median.processor,
                "values": values,
                "broken": [row.name for row in constraint_rows(wanted, values) if not row.satisfied],
                "evolution_f": best,
                "evolution_evaluations": count,
                "evolution_seconds": other.processor[0],
                "worse_by": found.objective / best - 1,
                "unconstrained_f": free.objective,
                "cost": found.objective / free.objective - 1,
            }
        )
        yield {"sets": rows}


def blocks(results: dict) -> dict[str, str]:
    """The text of each marker of docs/lift.md."""
    rows = results["sets"]
    first = rows[0]
    shown = [
        {
            **row,
            "names": ", ".join(f"`{name}`" for name in row["active"]),
            "worse": f"{100 * row['worse_by']:+.2f} %".replace("-", "−"),
        }
        for row in rows
    ]
    words = {
        "cost": f"{100 * first['cost']:+.0f} %".replace("-", "−"),
        "worst": percent(max(0.0, *(row["worse_by"] for row in rows))),
        "broken": f"{sum(len(row['broken']) for row in rows)} of {len(rows)} designs break a constraint",
    }
    return report.tables("lift_constrained", {"sets": shown}) | words


if __name__ == "__main__":
    report.run(measure)
