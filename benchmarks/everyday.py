"""Everyday requests, nearly all without an exact answer, sent to the service with its defaults: errors, times, properties.

``python -m benchmarks.everyday`` sends all rows of `benchmarks.battery`; ``--step 10`` every tenth row. For each row and kind
of limits the budgets are tried in turn, and the replies are checked for properties that hold on any machine: no server error, no
worse result with more time or a larger family, and no known answer lost.
"""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from benchmarks import report
from benchmarks.battery import BUDGETS, KINDS, Row, group_of, limited, rows
from benchmarks.service import Service, running, serve_command
from synthesis.excursions import LEAVES_SAMPLES

WORSE = 1.01
"""Largest ratio of an objective to the objective of a smaller budget or a smaller family."""
LONGER = 1.2
"""Largest response time as a multiple of the budget."""
EXACT = 1e-9
"""Objectives below are exact, and their differences rounding."""


class Reply(NamedTuple):
    """Reply of a service."""

    name: str
    kind: str
    budget: int | None
    code: int
    status: str
    objective: float | None
    """J of the best solution; None without a linkage."""
    seconds: float
    """From the request to the whole reply."""
    strays: bool = False
    """True if the best solution leaves the path between samples; any solution that does not is listed before it."""

    @property
    def error(self) -> float:
        """J, equal for all exact solutions; infinite without a solution."""
        return np.inf if self.objective is None else max(self.objective, EXACT)


def ask(service: Service, row: Row, kind: str, budget: int | None) -> Reply:
    """One question."""
    request = limited(row, kind) | ({} if budget is None else {"budget_ms": budget})
    client = replace(service, connection=http.client.HTTPConnection("127.0.0.1", service.port))
    begin = time.perf_counter()
    answer = client.ask("POST", f"/v2/{row.route}", json.dumps(request).encode())
    seconds = time.perf_counter() - begin
    client.connection.close()
    content = answer.json() if answer.status == 200 else {}
    best = next(iter(content.get("solutions", ())), None)
    objective = None if best is None else best["errors"]["objective"]
    strays = best is not None and (best.get("excursion") or 0.0) > LEAVES_SAMPLES
    return Reply(row.name, kind, budget, answer.status, content.get("status", ""), objective, seconds, strays)


def faults(replies: Sequence[Reply]) -> list[str]:
    """Return a sentence for each property that the replies to a row violate, independent of the machine's speed."""
    found = []
    for reply in replies:
        where = f"{reply.name}, {reply.kind}, {reply.budget or 'no'} ms"
        if reply.code != 200:
            found.append(f"{where}: answered with {reply.code}")
        elif reply.objective is None and reply.status not in ("infeasible", "unknown"):
            found.append(f"{where}: {reply.status} without a linkage")
        for rival in replies:
            if rival.strays and not reply.strays:
                continue
            more = rival.kind == reply.kind and (rival.budget or 1e9) < (reply.budget or 1e9)
            if more and reply.error > WORSE * rival.error:
                found.append(f"{where}: {reply.error:.3g}, but {rival.error:.3g} with {rival.budget} ms")
            larger = (rival.kind, reply.kind) == ("preset", "any") and rival.budget == reply.budget
            if larger and reply.error > WORSE * rival.error:
                found.append(f"{where}: {reply.error:.3g}, but {rival.error:.3g} among full cranks")
    return found


def late(replies: Iterable[Reply]) -> list[str]:
    """The replies that took longer than their budget allows."""
    over = [reply for reply in replies if reply.budget is not None and reply.seconds > LONGER * reply.budget / 1000]
    return [f"{reply.name}, {reply.kind}, {reply.budget} ms: {1000 * reply.seconds:.0f} ms" for reply in over]


def replies_to(
    service: Service, row: Row, kinds: Sequence[str] = KINDS, budgets: Sequence[Any] = BUDGETS
) -> list[Reply]:
    """Return the replies to a row, for each kind of limits and each budget."""
    return [ask(service, row, kind, budget) for kind in kinds for budget in budgets]


def measure(
    step: Annotated[int, "each so many-th row"] = 1, clients: Annotated[int, "asked by so many at a time"] = 1
) -> Iterator[dict[str, Any]]:
    """All rows; results by group of rows and kind of limits."""
    with running(serve_command) as service, ThreadPoolExecutor(clients) as pool:
        for row in rows()[:3]:
            ask(service, row, "any", 100)  # what the first request of a kind makes is made
        replies = list(pool.map(lambda row: replies_to(service, row), rows()[::step]))
    yield {
        "requests": sum(map(len, replies)),
        "faults": [sentence for group in replies for sentence in faults(group)],
        "late": [sentence for group in replies for sentence in late(group)],
        "rows": [summary(group, kind, replies) for group in GROUPS for kind in KINDS],
        "errors": {
            group[0].name: {reply.kind: report.finite(reply.error) for reply in group if reply.budget is None}
            for group in replies
        },
    }


GROUPS = ("drawn", "drawn by hand", "poses", "poses, angles missing", "points", "functions", "in step with a crank")


def summary(group: str, kind: str, replies: Sequence[Sequence[Reply]]) -> dict[str, Any]:
    """Return times and errors of a group of rows with the same kind of limits."""
    own = [[reply for reply in row if reply.kind == kind] for row in replies if group_of(row[0].name) == group]
    out: dict[str, Any] = {"group": group, "limits": kind, "cases": len(own)}
    for budget in BUDGETS[:-1]:
        pairs = [({reply.budget: reply for reply in row}[budget], row[-1]) for row in own]
        out[f"near_{budget}"] = float(np.mean([a.error <= WORSE * b.error for a, b in pairs])) if pairs else None
    last = [row[-1] for row in own]
    out["exact"] = float(np.mean([reply.error <= EXACT for reply in last])) if last else None
    out["median_ms"] = 1000 * float(np.median([reply.seconds for reply in last])) if last else None
    out["longest_ms"] = 1000 * max((reply.seconds for reply in last), default=0.0)
    return out


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table, and the counts of what must not be."""
    shown = [row for row in results["rows"] if row["cases"] > 1]
    usual = sorted(row["median_ms"] for row in shown if row["limits"] == "preset")
    return report.tables("everyday", {"groups": shown}) | {
        "usual": f"{usual[0]:.0f} ms to {usual[-1]:.0f} ms",
        "count": f"{results['requests']:,}",
        "faults": str(len(results["faults"])),
        "late": str(len(results["late"])),
    }


if __name__ == "__main__":
    report.run(measure)
