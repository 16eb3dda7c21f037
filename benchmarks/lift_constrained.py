"""The lift within constraints: cost of the constraints, and the search compared with a differential evolution.

Run ``python -m benchmarks.lift_constrained`` to write ``benchmarks/results/lift_constrained.json`` and numbers of
``docs/lift.md``. Both searches use the objective and the constraints of the product, so only the search is compared.
``tests.oracles.lift`` recomputes the constrained quantities of the designs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from benchmarks import report
from benchmarks.report import Times, percent
from synthesis.scenes.lift.constrained import optimize, source_limits
from synthesis.scenes.lift.constraints import constraint_rows
from tests.oracles import lift as oracle
from tests.oracles.lift_constrained import cases, evolution_optimum


def measure(evaluations: Annotated[int, "of the differential evolution"] = 200_000) -> Iterator[dict[str, Any]]:
    """Measure each set: our optimum and time, the result of the evolution, the recomputed quantities, and the cost."""
    rows = []
    for name, (task, limits) in cases().items():
        clock = Times()
        found = clock.run(optimize, task, limits)
        for _ in range(2):
            clock.run(optimize, task, limits)
        evolution_clock = Times()
        best, count = evolution_clock.run(evolution_optimum, task, limits, evaluations)
        design, closed = found.stroke_design.design, float(found.stroke_design.closed_length)
        values = oracle.constrained_quantities(design, closed, task.cylinder.speed, task.low, task.high)
        free = optimize(task, source_limits(task))
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
                "broken": [row.name for row in constraint_rows(limits, values) if not row.satisfied],
                "evolution_f": best,
                "evolution_evaluations": count,
                "evolution_seconds": evolution_clock.processor[0],
                "worse_by": found.objective / best - 1,
                "unconstrained_f": free.objective,
                "cost": found.objective / free.objective - 1,
            }
        )
        yield {"sets": rows}


def blocks(results: dict) -> dict[str, str]:
    """Return the text of each marker in docs/lift.md."""
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
        "broken": f"{sum(len(row['broken']) for row in rows)} of {len(rows)} designs violate a constraint",
    }
    return report.tables("lift_constrained", {"sets": shown}) | words


if __name__ == "__main__":
    report.run(measure)
