"""What the index of an atlas costs and saves: ``python -m benchmarks.index --atlases atlas.h5 [wide.h5 ...]``.

For every atlas: the first start of the service, which makes the index; `linkage-atlas index` by itself; then the service with
the index, a second one beside it, and one without.
Processor time, so that a busy machine tells the same; memory as Linux counts it: what a process has for itself (unique), and
what all have mapped too (resident).
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.service import Service, match_bodies, running, serve_command, spent
from linkage_atlas.atlases import index_of

NO_LIMIT = 10**12
ANY_SIZE = {"atlas_max_bytes": NO_LIMIT, "atlas_max_types": NO_LIMIT}
"""Settings of a service that takes an atlas of any size."""
PARTS = ("cells", "positions", "short_spans")
ASKED = ("first_cpu_ms", "mean_cpu_ms", "asked_resident_bytes", "asked_unique_bytes")
"""What is not told of the first start, which goes on working behind the requests."""


def make(atlas: Path, **settings: Any) -> dict[str, Any]:
    """Make the index by the command: processor seconds, peak memory, bytes of each of its parts and of all."""
    start = "from app.cli import main; raise SystemExit(main())"
    _, seconds, peak = spent("-c", start, "index", "--atlas", str(atlas), **{**ANY_SIZE, **settings})
    parts = {part.name: list(part.iterdir()) for part in index_of(atlas).iterdir() if part.is_dir()}
    sizes = {part: sum(file.stat().st_size for file in files) for part, files in parts.items()}
    return {
        "make_cpu_s": seconds,
        "make_peak_bytes": peak,
        "disk_bytes": sum(sizes.values()),
        **{f"{name}_bytes": size for name, size in sizes.items()},
    }


def memory(service: Service) -> dict[str, int]:
    """Bytes of all its processes, what they share counted once, and those that the largest shares with no other and no file."""
    return {"resident": service.shared_out(), "unique": max(service.own(), default=0)}


def ready(service: Service) -> dict[str, Any]:
    """What a service took until it was ready."""
    service.need_ready()
    row: dict[str, Any] = {"ready_cpu_s": sum(service.cpu_seconds().values()), "ready_s": service.ready_seconds}
    row |= {f"ready_{name}_bytes": value for name, value in memory(service).items()}
    return row | {"peak_bytes": service.peak()}


def started(service: Service, bodies: Sequence[bytes]) -> dict[str, Any]:
    """Of a service that is ready: what it took, and what the first and the other requests take."""
    row, spent = ready(service), []
    for body in bodies:
        before = sum(service.cpu_seconds().values())
        if service.ask("POST", "/v1/match", body).status != 200:
            raise RuntimeError("/v1/match failed")
        spent.append(sum(service.cpu_seconds().values()) - before)
    row |= {"first_cpu_ms": 1000 * spent[0], "mean_cpu_ms": 1000 * float(np.mean(spent[len(spent) // 2 :]))}
    return row | {f"asked_{name}_bytes": value for name, value in memory(service).items()}


def measured(atlas: Path, bodies: Sequence[bytes]) -> dict[str, Any]:
    """One atlas: its index is made by a first start and by the command, opened by one process and by another, and not used."""
    with tempfile.TemporaryDirectory(dir=atlas.parent) as folder:
        link = Path(folder) / atlas.name
        link.symlink_to(atlas.resolve())
        limits = {"atlas": link, **ANY_SIZE}
        with running(serve_command, **limits) as service:
            anew = dict.fromkeys(ASKED) | ready(service)
        shutil.rmtree(index_of(link))
        row = {"file_bytes": atlas.stat().st_size, "anew": anew, **make(link)}
        with running(serve_command, **limits) as first:
            row["first"] = started(first, bodies)
            row["types"] = first.ask("GET", "/v1/atlas").json()["types"]
            with running(serve_command, **limits) as second:
                row["second"] = started(second, bodies)
        with running(serve_command, **limits, index=False, prepare_positions=False) as plain:
            row["without"] = started(plain, bodies)
    print(json.dumps(row), flush=True)
    return row


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of the index in docs/scaling.md."""
    starts = []
    for row in results["rows"]:
        types = row["types"]
        for name, words in (
            ("anew", "the first, which makes it"),
            ("first", "with the index"),
            ("second", "a second process beside it"),
            ("without", "in memory"),
        ):
            starts.append({"types": types, "start": words, **row[name]})
    return report.tables("index", {"starts": starts})


def measure(
    atlases: Annotated[Path, "atlas files"] = (Path("atlas.h5"),), requests: Annotated[int, "to each service"] = 40
) -> Iterator[dict[str, Any]]:
    """Every atlas in turn."""
    bodies, rows = match_bodies(requests), []
    for atlas in atlases:
        rows.append(measured(atlas, bodies))
        yield {"requests": requests, "rows": rows}


if __name__ == "__main__":
    report.run(measure)
