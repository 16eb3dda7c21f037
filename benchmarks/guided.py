"""Verdicts on linkages on two guides, compared with a step-by-step simulation: all pairs of guides, all drives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from synthesis.defects import passage
from tests.oracles.guided_cases import DRIVES, NAMES, random_case
from tests.oracles.guided_tracker import follow


def measure(
    cases: Annotated[int, "number of cases of each pair of guides and drive"] = 170,
    seed: Annotated[int, "seed of the cases"] = 2,
) -> Iterator[dict[str, Any]]:
    """Count, for each pair of guides and drive, all cases, cases near a dead position, accepted cases and disagreements."""
    rows = []
    for name, drive in zip(NAMES, DRIVES):
        random = np.random.default_rng(seed)
        row = {
            "drive": name.replace("-", ", ").lower(),
            "cases": cases,
            "near": 0,
            "driven": 0,
            "circuit": 0,
            "off": 0,
        }
        for _ in range(cases):
            case = random_case(random, *drive)
            if case.close:
                row["near"] += 1
                continue
            said, found = passage(case.linkage, case.coordinate, case.side), follow(case.linkage, case.poses)
            row["driven"] += found.driven
            row["circuit"] += found.circuit
            row["off"] += (said.driven, said.circuit) != (found.driven, found.circuit)
        rows.append({key: int(value) if key != "drive" else value for key, value in row.items()})
    total = {key: sum(row[key] for row in rows) for key in rows[0] if key != "drive"}
    yield {"verdicts": rows, "total": total}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the table, and a sentence with the totals."""
    total = results["total"]
    compared = total["cases"] - total["near"]
    return {
        "words": f"{total['off']} disagreements in {compared:,} comparisons; {total['near']} further cases have a sample "
        "nearer than 0.01 to a dead position, or are all but at a change point, and are left out",
    }


if __name__ == "__main__":
    report.run(measure)
