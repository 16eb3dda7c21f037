"""Everyday questions, nearly all without an exact answer, sent to the service with its defaults: errors, times, what must hold.

``python -m benchmarks.everyday`` asks all rows of `tests.everyday.battery`; ``--every 10`` each tenth. For each row and kind of
limits the budgets are asked one after the other, and the replies are held against what must hold whatever the machine: no
server error, more time never worse, a larger family never worse than its part, and nothing lost that was known.
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
from benchmarks.service import Service, running, serve_command
from synthesis.defects import LEAVES_SAMPLES
from tests.everyday.battery import BUDGETS, KINDS, Row, group_of, limited, rows

WORSE = 1.01
"""Times that an objective may be above that of a smaller budget, or of a smaller family."""
LONGER = 1.2
"""Of its budget that an answer may take."""
EXACT = 1e-9
"""Objectives below are exact, and their differences rounding."""


class Reply(NamedTuple):
    """What a service answered."""

    name: str
    kind: str
    budget: int | None
    code: int
    status: str
    objective: float | None
    """J of the best; None where there is no linkage."""
    seconds: float
    """From the request to the whole reply."""
    strays: bool = False
    """Whether the best goes astray between samples: one that stays comes before it, though farther off."""

    @property
    def error(self) -> float:
        """J, infinite where there is none, the same for all exact ones."""
        return np.inf if self.objective is None else max(self.objective, EXACT)


def ask(service: Service, row: Row, kind: str, budget: int | None) -> Reply:
    """One question."""
    request = limited(row, kind) | ({} if budget is None else {"budget_ms": budget})
    client = replace(service, connection=http.client.HTTPConnection("127.0.0.1", service.port))
    begin = time.perf_counter()
    answer = client.ask("POST", f"/v2/{row.route}", json.dumps(request).encode())
    seconds = time.perf_counter() - begin
    client.connection.close()
    told = answer.json() if answer.status == 200 else {}
    best = next(iter(told.get("solutions", ())), None)
    objective = None if best is None else best["errors"]["objective"]
    strays = best is not None and (best.get("excursion") or 0.0) > LEAVES_SAMPLES
    return Reply(row.name, kind, budget, answer.status, told.get("status", ""), objective, seconds, strays)


def faults(replies: Sequence[Reply]) -> list[str]:
    """A sentence for everything that must not be among the replies to one row, whatever the machine's speed."""
    found = []
    for one in replies:
        where = f"{one.name}, {one.kind}, {one.budget or 'no'} ms"
        if one.code != 200:
            found.append(f"{where}: answered with {one.code}")
        elif one.objective is None and one.status not in ("infeasible", "unknown"):
            found.append(f"{where}: {one.status} without a linkage")
        for other in replies:
            if other.strays and not one.strays:
                continue
            more = other.kind == one.kind and (other.budget or 1e9) < (one.budget or 1e9)
            if more and one.error > WORSE * other.error:
                found.append(f"{where}: {one.error:.3g}, but {other.error:.3g} with {other.budget} ms")
            larger = (other.kind, one.kind) == ("preset", "any") and other.budget == one.budget
            if larger and one.error > WORSE * other.error:
                found.append(f"{where}: {one.error:.3g}, but {other.error:.3g} among full cranks")
    return found


def late(replies: Iterable[Reply]) -> list[str]:
    """The replies that took longer than their budget allows."""
    over = [one for one in replies if one.budget is not None and one.seconds > LONGER * one.budget / 1000]
    return [f"{one.name}, {one.kind}, {one.budget} ms: {1000 * one.seconds:.0f} ms" for one in over]


def asked(service: Service, row: Row, kinds: Sequence[str] = KINDS, budgets: Sequence[Any] = BUDGETS) -> list[Reply]:
    """The replies to one row, within each kind of limits and with each budget."""
    return [ask(service, row, kind, budget) for kind in kinds for budget in budgets]


def measure(
    every: Annotated[int, "each so many-th row"] = 1, clients: Annotated[int, "asked by so many at a time"] = 1
) -> Iterator[dict[str, Any]]:
    """All rows; results by group of rows and kind of limits."""
    with running(serve_command) as service, ThreadPoolExecutor(clients) as pool:
        for row in rows()[:3]:
            ask(service, row, "any", 100)  # what the first request of a kind makes is made
        replies = list(pool.map(lambda row: asked(service, row), rows()[::every]))
    yield {
        "requests": sum(map(len, replies)),
        "faults": [sentence for some in replies for sentence in faults(some)],
        "late": [sentence for some in replies for sentence in late(some)],
        "rows": [summary(group, kind, replies) for group in GROUPS for kind in KINDS],
        "errors": {
            some[0].name: {one.kind: report.finite(one.error) for one in some if one.budget is None}
            for some in replies
        },
    }


GROUPS = ("drawn", "drawn by hand", "poses", "poses, angles missing", "points", "functions", "in step with a crank")


def summary(group: str, kind: str, replies: Sequence[Sequence[Reply]]) -> dict[str, Any]:
    """Times and errors of one group of rows within one kind of limits."""
    own = [[one for one in some if one.kind == kind] for some in replies if group_of(some[0].name) == group]
    out: dict[str, Any] = {"group": group, "limits": kind, "cases": len(own)}
    for budget in BUDGETS[:-1]:
        pairs = [({one.budget: one for one in some}[budget], some[-1]) for some in own]
        out[f"near_{budget}"] = float(np.mean([a.error <= WORSE * b.error for a, b in pairs])) if pairs else None
    last = [some[-1] for some in own]
    out["exact"] = float(np.mean([one.error <= EXACT for one in last])) if last else None
    out["median_ms"] = 1000 * float(np.median([one.seconds for one in last])) if last else None
    out["longest_ms"] = 1000 * max((one.seconds for one in last), default=0.0)
    return out


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table, and the counts of what must not be."""
    shown = [row for row in results["rows"] if row["cases"] > 1]
    return report.tables("everyday", {"groups": shown}) | {
        "count": f"{results['requests']:,}",
        "faults": str(len(results["faults"])),
        "late": str(len(results["late"])),
    }


if __name__ == "__main__":
    report.run(measure)
