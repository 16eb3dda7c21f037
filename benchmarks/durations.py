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

from app.fourbar import answers
from app.fourbar.answers import SHORT_MS
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings
from benchmarks import report
from tests.everyday.battery import KINDS, Row, group_of, limited, rows

TABLE = Path(answers.__file__).with_name("durations.json")
FACTOR = 3.0
MOST_SECONDS = 10.0
BRIEF = ("functions", "in step with a crank")


def chosen(every: int) -> list[Row]:
    """Each so many-th row, and all of the groups that take little."""
    return [row for k, row in enumerate(rows()) if k % every == 0 or group_of(row.name) in BRIEF]


def asked(every: int) -> list[dict[str, Any]]:
    """Processor time of each question."""
    queries = {query.path: query for query in all_queries()}
    resources = ServiceResources(Settings(with_atlas=False, max_budget_ms=1000 * MOST_SECONDS))
    resources.prepare_rest()
    found = []
    for row in chosen(every):
        query = queries[f"/v1/{row.route}"]
        for kind in KINDS:
            request = query.request.model_validate(limited(row, kind))
            times = report.Times()
            times.run(query.answer, request, resources)
            found.append({"row": row.name, "limits": kind, "seconds": times.processor[0]})
            print(found[-1], flush=True)
    return found


def kinds_of(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The same, with the kind and the samples of each request."""
    models, named = {query.path: query.request for query in all_queries()}, {row.name: row for row in rows()}
    out = []
    for one in found:
        row = named[one["row"]]
        request = models[f"/v1/{row.route}"].model_validate(limited(row, one["limits"]))
        out.append({**one, "kind": answers.kind_of(request), "samples": answers.samples_of(request)})
    return out


def table_of(found: list[dict[str, Any]]) -> dict[str, Any]:
    """The times of the table, seconds, and the power, so that as many as can be are within the factor, and near it else."""

    def middle(seconds: list[float]) -> float:
        ends = sorted(seconds)
        held = [sum(least <= other <= FACTOR**2 * least for other in ends) for least in ends]
        least = ends[int(np.argmax(held))]
        return math.sqrt(least * max(one for one in ends if one <= FACTOR**2 * least))

    def fitted(power: float) -> dict[str, Any]:
        groups = defaultdict(list)
        for one in found:
            groups[one["kind"]].append(one["seconds"] / (one["samples"] / answers.REFERENCE_SAMPLES) ** power)
        return {"power": power, "kinds": {kind: round(middle(some), 4) for kind, some in sorted(groups.items())}}

    def missed(table: dict[str, Any]) -> tuple[int, float]:
        off = [abs(math.log(ratio)) for ratio in ratios(found, table)]
        return sum(one > math.log(FACTOR) for one in off), sum(off)

    return min((fitted(round(power, 2)) for power in np.arange(0, 1.51, 0.05)), key=missed)


def ratios(found: list[dict[str, Any]], table: dict[str, Any]) -> list[float]:
    """Measured times over those of a table."""
    share = [(one["samples"] / answers.REFERENCE_SAMPLES) ** table["power"] for one in found]
    slowest = max(table["kinds"].values())
    return [one["seconds"] / part / table["kinds"].get(one["kind"], slowest) for one, part in zip(found, share)]


def measure(
    every: Annotated[int, "each so many-th row, and all of the groups that take little"] = 1,
    again: Annotated[bool, "fit what was measured before, which changes no time"] = False,
) -> Iterator[dict[str, Any]]:
    """All rows; writes the table of the service."""
    measured = report.load("durations")["measured"] if again else report.stamp()
    found = kinds_of(report.load("durations")["asked"] if again else asked(every))
    table = table_of(found)
    TABLE.write_text(json.dumps(table, indent=1) + "\n")
    within = [1 / FACTOR <= ratio <= FACTOR for ratio in ratios(found, table)]
    yield {
        "measured": measured,
        "requests": len(found),
        "within": float(np.mean(within)),
        "table": table,
        "asked": found,
    }


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """What docs/reliability.md says of it."""
    slow = [one for one in results["asked"] if one["seconds"] > SHORT_MS / 1000]
    return {
        "made": report.made_text([results["measured"]]),
        "within": f"{100 * results['within']:.0f} % of {results['requests']:,}",
        "long": f"{len(slow):,} of {results['requests']:,}",
    }


if __name__ == "__main__":
    report.run(measure)
