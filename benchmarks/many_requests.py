"""Studies of plain requests: what a request costs beside the single one, and what a second process brings (docs/scaling.md)."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from app.study import answer
from benchmarks import report
from linkage_atlas.batch import Question
from tests.oracles.classes import make_case

JOBS = (1, 2)
FEW = 2
"""Requests of a study that is all start."""


def bodies(count: int) -> list[bytes]:
    """Requests of class plain: rotation and positions that a crank-rocker makes exactly."""
    return [json.dumps(make_case("plain", seed).request).encode() for seed in range(count)]


def singles(requests: list[bytes]) -> float:
    """Processor seconds of all requests, one after the other in this process, once it is warm."""
    questions = [Question(k, text, "") for k, text in enumerate(requests, 1)]
    for question in questions[:10]:
        answer_line("synthesize", False, None, question)
    begin = time.process_time()
    for question in questions:
        answer_line("synthesize", False, None, question)
    return time.process_time() - begin


def studied(requests: list[bytes], jobs: int) -> dict[str, float]:
    """Seconds of a study by the command: on the clock, and of the processor in all its processes."""
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "requests.ndjson", Path(folder) / "results.ndjson"
        file.write_bytes(b"\n".join(requests) + b"\n")
        words = ["study", str(file), "--out", str(out), "--no-preset", "--jobs", str(jobs)]
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, "-m", "app.start", *words], check=True, stderr=subprocess.DEVNULL)
        wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        assert out.read_bytes().count(b"\n") == len(requests)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall": wall, "processor": processor}


def measure(
    requests: Annotated[int, "in a study"] = 2_000, rounds: Annotated[int, "of each number of processes"] = 1
) -> Iterator[dict[str, Any]]:
    """Singles and studies in turn; what a start costs is measured apart and taken off."""
    many = bodies(requests)
    load = os.getloadavg()[0]
    found: dict[int, list[dict[str, float]]] = {jobs: [] for jobs in JOBS}
    alone = []
    for _ in range(rounds):
        alone.append(singles(many))
        for jobs in JOBS:
            start, whole = studied(many[:FEW], jobs), studied(many, jobs)
            found[jobs].append({name: whole[name] - start[name] for name in whole} | {"start": start["wall"]})
    single = min(alone)
    rows: list[dict[str, Any]] = []
    for jobs in JOBS:
        best = {name: min(one[name] for one in found[jobs]) for name in ("wall", "processor", "start")}
        rows.append(
            {"jobs": jobs, **best, "per_second": requests / best["wall"], "over_single": best["processor"] / single}
        )
    for row in rows:
        row["speedup"] = rows[0]["wall"] / row["wall"]
    yield {"requests": requests, "rounds": rounds, "load": load, "single": single, "rows": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table, and what it is of."""
    of = f"{results['requests']:,} requests, the best of {results['rounds']}; load when it began: {results['load']:.1f}."
    return report.tables("many_requests", {"studies": results["rows"]}) | {"of": of}


if __name__ == "__main__":
    report.run(measure)
