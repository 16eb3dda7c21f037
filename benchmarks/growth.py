"""How build, start, memory and request grow with the atlas: ``python -m benchmarks.growth [--perimeters 100 200 ...]``.

Every atlas is built, served and asked by processes of their own, as users run them; the requests are the same for all.
Writes ``benchmarks/results/growth.json``, and with `scaling` the tables of ``docs/scaling.md`` and ``docs/img/growth.svg``.
The largest perimeter has seven million types and takes many GB of memory; nothing else should run.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks import scaling
from benchmarks.service import (
    ROOT,
    environment,
    machine,
    match_bodies,
    quantile,
    running,
    serve_command,
    uvicorn_command,
)
from synthesis.fourbar.dimension_types import MAX_PERIMETER

PERIMETERS = (100, 200, 400, 800, 1600)
SAMPLES = {400: 256, 800: 128, MAX_PERIMETER: 64}
"""Samples of a curve up to each perimeter. The series of a typical curve needs 8 to 16 harmonics, which 64 samples hold twice
over; more of them would only take memory, 4 bytes a sample and type, several times over while a file is written or read."""
WARM_UP = 5
NO_LIMIT = 10**12


def build(perimeter: int, out: Path) -> dict[str, Any]:
    """Build an atlas in a process of its own: seconds, bytes of the file, peak memory of the largest of its processes."""
    samples = next(samples for largest, samples in SAMPLES.items() if perimeter <= largest)
    words = ["--perimeter", perimeter, "--order", "increasing", "--samples", samples, "--out", out, "--json"]
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "data_build", *map(str, words)], cwd=ROOT, stdout=subprocess.PIPE, env=environment()
    )
    built = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)  # the memory of this child alone, not of the largest so far
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stdout.close()
    if process.returncode:
        raise RuntimeError(f"the build of perimeter {perimeter} failed with exit code {process.returncode}")
    return {
        "perimeter": perimeter,
        "samples": samples,
        "types": json.loads(built)["types"],
        "build_s": time.perf_counter() - begin,
        "build_peak_bytes": usage.ru_maxrss * 1024,
        "file_bytes": out.stat().st_size,
    }


def serve(atlas: Path, bodies: Sequence[bytes]) -> dict[str, Any]:
    """Start the service on an atlas and send it requests one after the other on one connection."""
    with running(
        serve_command, atlas=atlas, atlas_max_bytes=NO_LIMIT, atlas_max_types=NO_LIMIT, prepare_positions=False
    ) as service:
        if service.ready.status != 200:
            raise RuntimeError(f"the service is not ready: {service.ready.body.decode()}")
        row: dict[str, Any] = {"ready_s": service.ready_seconds}
        row |= {"resident_bytes": service.memory("VmRSS"), "peak_bytes": service.memory("VmHWM")}
        row["scan_bytes"] = service.ask("GET", "/v1/atlas").json()["scan_bytes"]
        for body in bodies[:WARM_UP]:
            service.ask("POST", "/v1/match", body)
        seconds, replies = [], []
        for body in bodies:
            begin = time.perf_counter()
            answer = service.ask("POST", "/v1/match", body)
            seconds.append(time.perf_counter() - begin)
            if answer.status != 200:
                raise RuntimeError(f"/v1/match answered {answer.status}: {answer.body.decode()}")
            replies.append(answer.json())
        row["peak_bytes_asked"] = service.memory("VmHWM")
    return row | {
        "median_ms": 1000 * quantile(seconds, 0.5),
        "p99_ms": 1000 * quantile(seconds, 0.99),
        "windows": replies[0]["report"]["windows"],
        "evaluated": quantile([reply["report"]["evaluated"] for reply in replies], 0.5),
        "similarity_deg": quantile([reply["matches"][0]["similarity"] for reply in replies], 0.5),
        "ms": [round(1000 * value, 2) for value in seconds],
    }


def refusal(atlas: Path) -> dict[str, Any]:
    """What /readyz and /livez say where an atlas has more types than ``atlas_max_types`` allows, and how `serve` ends."""
    settings = {"atlas": atlas, "atlas_max_bytes": NO_LIMIT}
    with running(uvicorn_command, **settings) as service:
        row = {"seconds": service.ready_seconds, "status": service.ready.status}
        row |= {"livez": service.ask("GET", "/livez").status, "reply": service.ready.json()}
    if row["status"] != 200:
        ended = subprocess.run(
            serve_command(0), cwd=ROOT, env=environment(**settings), capture_output=True, check=False
        )
        row |= {"exit_code": ended.returncode}
    return row


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure every perimeter, write the numbers, the page and the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--perimeters", type=int, nargs="+", default=list(PERIMETERS))
    parser.add_argument("--requests", type=int, default=40, help="requests to each atlas (%(default)s)")
    options = parser.parse_args(arguments)
    bodies = match_bodies(options.requests)
    result: dict[str, Any] = {"machine": machine(), "requests": options.requests, "rows": []}
    for perimeter in tqdm(sorted(options.perimeters), disable=None, unit="atlas"):
        with tempfile.TemporaryDirectory() as folder:
            atlas = Path(folder) / "atlas.h5"
            row = build(perimeter, atlas) | serve(atlas, bodies)
            result["rows"].append(row)
            result["refusal"] = {"types": row["types"], **refusal(atlas)}
        shown = {name: round(value, 2) for name, value in row.items() if isinstance(value, int | float)}
        print(json.dumps(shown), flush=True)
        # after each perimeter: what has been measured is kept whatever comes
        scaling.GROWTH.write_text(json.dumps(result, indent=1) + "\n")
    scaling.write()
    for name, exponents in scaling.exponents(result["rows"]).items():
        print(f"{name:<20} types^{exponents.overall:.2f}, from 200 {exponents.large:.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
