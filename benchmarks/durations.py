"""What everyday questions take, by their kind: makes the table by which the service tells short requests from long ones.

``python -m benchmarks.durations`` asks the rows of `tests.everyday.battery` without a budget, in this process, and fits a time
for each kind of request and one power of the number of samples.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from app.fourbar import durations
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings
from benchmarks import report
from tests.everyday.battery import KINDS, limited, rows

TABLE = Path(durations.__file__).with_name("durations.json")
FACTOR = 3.0
MOST_SECONDS = 10.0


def asked(every: int) -> list[dict[str, Any]]:
    """Kind, samples and processor time of each question."""
    queries = {query.path: query for query in all_queries()}
    resources = ServiceResources(Settings(with_atlas=False, max_budget_ms=1000 * MOST_SECONDS))
    resources.prepare_rest()
    found = []
    for row in rows()[::every]:
        query = queries[f"/v1/{row.route}"]
        for kind in KINDS:
            request = query.request.model_validate(limited(row, kind))
            times = report.Times()
            times.run(query.answer, request, resources)
            one = {"row": row.name, "limits": kind, "kind": durations.kind_of(request), "seconds": times.processor[0]}
            found.append(one | {"samples": durations.samples_of(request)})
            print(one, flush=True)
    return found


def table_of(found: list[dict[str, Any]]) -> dict[str, Any]:
    """The times of the table, seconds: the power that leaves the logarithms least scattered about the middle of their kinds."""

    def middles(power: float) -> dict[str, float]:
        groups = defaultdict(list)
        for one in found:
            share = (one["samples"] / durations.REFERENCE_SAMPLES) ** power
            groups[one["kind"]].append(math.log(one["seconds"] / share))
        return {kind: math.exp((min(logs) + max(logs)) / 2) for kind, logs in sorted(groups.items())}

    def scatter(power: float) -> float:
        return float(
            np.mean([abs(math.log(ratio)) for ratio in ratios(found, {"power": power, "kinds": middles(power)})])
        )

    power = min(np.arange(0, 1.51, 0.05).tolist(), key=scatter)
    return {"power": round(power, 2), "kinds": {kind: round(one, 4) for kind, one in middles(power).items()}}


def ratios(found: list[dict[str, Any]], table: dict[str, Any]) -> list[float]:
    """Measured times over those of a table."""
    share = [(one["samples"] / durations.REFERENCE_SAMPLES) ** table["power"] for one in found]
    slowest = max(table["kinds"].values())
    return [one["seconds"] / part / table["kinds"].get(one["kind"], slowest) for one, part in zip(found, share)]


def measure(every: Annotated[int, "each so many-th row"] = 1) -> Iterator[dict[str, Any]]:
    """All rows; writes the table of the service."""
    found = asked(every)
    table = table_of(found)
    TABLE.write_text(json.dumps(table, indent=1) + "\n")
    within = [1 / FACTOR <= ratio <= FACTOR for ratio in ratios(found, table)]
    yield {"requests": len(found), "within": float(np.mean(within)), "table": table, "asked": found}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """What docs/reliability.md says of it."""
    slow = [one for one in results["asked"] if one["seconds"] > 0.1]
    return {
        "within": f"{100 * results['within']:.0f} % of {results['requests']:,}",
        "long": f"{len(slow):,} of {results['requests']:,}",
    }


if __name__ == "__main__":
    report.run(measure)
