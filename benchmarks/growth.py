"""How build, index, start, memory and requests grow with the atlas: ``python -m benchmarks.growth [--perimeters 100 200 ...]``.

Every atlas is built, prepared, served and asked by processes of their own, as users run them; the requests are the same for
all. Then a scan in a process of its own answers motions over short, middle and long spans, in processor time of one thread. The
largest perimeter has seven million types and takes 45 GB of disk meanwhile; nothing else should run. Perimeter 2,274 has twenty
million; where the disk has no room for their index of short spans, that is left out.
"""

from __future__ import annotations

import bisect
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tqdm import tqdm

from benchmarks import report
from benchmarks.figures import curve, figure
from benchmarks.index import ANY_SIZE, NO_LIMIT, make
from benchmarks.product import MAX_PERIMETER, Settings, TypeRule, count_types, la
from benchmarks.report import Times, duration, significant, size
from benchmarks.service import build, environment, match_bodies, quantile, running, serve_command, uvicorn_command
from linkage_atlas.cache import index_of
from tests.oracles.rotations import reachable

PERIMETERS = (100, 200, 400, 800, 1600)
SAMPLES = {400: 256, 800: 128, MAX_PERIMETER: 64}
"""Samples of a curve up to each perimeter. The series of a typical curve needs 8 to 16 harmonics, which 64 samples hold twice
over; more of them would only take memory, 4 bytes a sample and type, several times over while a file is written or read."""
DEFAULT = 400
"""Perimeter of the default atlas."""
WIDE = {"perimeter": DEFAULT, "order": "full_crank", "samples": 128}
SPANS = {"short": (10, 20, 30, 45, 60, 75, 90), "middle": (105, 120, 150, 180), "long": (200, 250, 300, 360)}
"""Degrees."""
SHORTEST = 0.05
"""Least link of a motion's linkage, over its perimeter."""
WARM_UP = 5
SETTINGS = {**ANY_SIZE, "prepare_positions": False}
LARGE = 200
"""Perimeter from which on what every process costs at any size is small beside what grows."""
BILLION = 10**9
HOST_BYTES = 48e9
"""Of the index that a host of 64 GB can hold in memory; the rest is for requests and the system."""
TOP, ROW_BYTES = 10, 40
"""Rows of a reply between hosts, and bytes of one: error, number, start, branch, offset, each of 8."""


def serve(atlas: Path, bodies: Sequence[bytes]) -> dict[str, Any]:
    """Start the service on an atlas with its index and send it requests one after the other on one connection."""
    with running(serve_command, atlas=atlas, **SETTINGS) as service:
        service.need_ready()
        row: dict[str, Any] = {"ready_s": service.ready_seconds}
        row |= {"resident_bytes": service.shared_out() or None, "own_bytes": max(service.own())}
        row["scan_bytes"] = service.ask("GET", "/v1/atlas").json()["scan_bytes"]
        for body in bodies[:WARM_UP]:
            service.ask("POST", "/v1/match", body)
        times, replies = Times(), []
        for body in bodies:
            answer = times.run(service.ask, "POST", "/v1/match", body)
            if answer.status != 200:
                raise RuntimeError(f"/v1/match answered {answer.status}: {answer.body.decode()}")
            replies.append(answer.json())
        row |= {"asked_bytes": service.shared_out() or None, "asked_own_bytes": max(service.own())}
    return row | {
        "median_ms": 1000 * quantile(times.wall, 0.5),
        "p99_ms": 1000 * quantile(times.wall, 0.99),
        "windows": replies[0]["report"]["windows"],
        "evaluated": quantile([reply["report"]["evaluated"] for reply in replies], 0.5),
        "similarity_deg": quantile([reply["matches"][0]["similarity"] for reply in replies], 0.5),
        "ms": [round(1000 * value, 2) for value in times.wall],
    }


def refusal(atlas: Path) -> dict[str, Any]:
    """What /readyz and /livez say where an atlas has more types than ``atlas_max_types`` allows, and how `serve` ends."""
    settings = {"atlas": atlas, "atlas_max_bytes": NO_LIMIT}
    with running(uvicorn_command, **settings) as service:
        row = {"seconds": service.ready_seconds, "status": service.ready.status}
        row |= {"livez": service.ask("GET", "/livez").status, "reply": service.ready.json()}
    if row["status"] != 200:
        ended = subprocess.run(
            serve_command(0), cwd=report.ROOT, env=environment(**settings), capture_output=True, check=False
        )
        row |= {"exit_code": ended.returncode}
    return row


def answer_spans(atlas: Path, requests: int) -> dict[str, Any]:
    """Processor milliseconds of the scan over the spans of each class, the better of two runs of each; all in this process."""
    scan = la.load_atlas(atlas, max_bytes=NO_LIMIT, max_types=NO_LIMIT, index=index_of(atlas)).scan
    scan.threads = 1
    row: dict[str, Any] = {}
    for name, spans in SPANS.items():
        spent = []
        for number, span in zip(range(requests), cycle(spans)):
            target, times = reachable(f"growth {name}", number, span, SHORTEST), Times()
            for _ in range(2):
                times.run(scan.best, target, TOP)
            spent.append(1000 * times.least.processor)
        row[f"{name}_ms"], row[f"{name}_90_ms"] = quantile(spent, 0.5), quantile(spent, 0.9)
    return row


def in_a_process(atlas: Path, requests: int) -> dict[str, Any]:
    """`answer_spans` in a process of its own."""
    code = f"from benchmarks.growth import *; print(json.dumps(answer_spans(Path({str(atlas)!r}), {requests})))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=report.ROOT, env=environment(), stdout=subprocess.PIPE, check=True
    )
    told: dict[str, Any] = json.loads(done.stdout)
    return told


QUANTITIES = {
    "build_s": "build, seconds",
    "build_peak_bytes": "build, memory of the largest process",
    "file_bytes": "file",
    "make_cpu_s": "index, processor seconds",
    "make_peak_bytes": "index, memory while it is made",
    "disk_bytes": "index, files",
    "ready_s": "start until /readyz, seconds",
    "resident_bytes": "resident memory when ready",
    "asked_bytes": "resident memory after all requests",
    "median_ms": "request, median",
    "p99_ms": "request, 99th percentile",
    "evaluated": "windows evaluated exactly, median",
    "similarity_deg": "error of the best row, median",
    **{f"{name}_ms": f"scan, {name} spans, median processor time" for name in SPANS},
}


WITHOUT_SPANS = ("make_cpu_s", "make_peak_bytes", "disk_bytes", "median_ms", "p99_ms", "evaluated", "short_ms")
"""Quantities that are others where an atlas has no index of short spans."""


def slope(types: Sequence[float], values: Sequence[float | None]) -> float:
    """Slope of the least-squares line of log values against log types. Law: 3 types^e has the slope e."""
    if len(types) < 2 or None in values:
        return math.nan
    return float(np.polyfit(np.log(types), np.log(np.array(values, dtype=float)), 1)[0])


def exponents(rows: Sequence[dict[str, Any]], least: int = 0) -> dict[str, float]:
    """e in quantity ~ types^e for each of `QUANTITIES`, over the perimeters from one on; NaN for fewer than two."""
    some = [row for row in rows if row["perimeter"] >= least]
    return {name: slope([row["types"] for row in some], [row[name] for row in some]) for name in QUANTITIES}


def foretold(rows: Sequence[dict[str, Any]], row: dict[str, Any]) -> str:
    """What the growth over smaller atlases says of a larger one, beside what was measured of it."""
    found, last = exponents(rows, LARGE), rows[-1]
    cells = []
    for name, what in QUANTITIES.items():
        if name not in WITHOUT_SPANS:
            value = last[name] * (row["types"] / last["types"]) ** found[name]
            say = size if "bytes" in name else significant
            cells.append([what, say(value), say(row[name]), significant(row[name] / value)])
    return report.lines([f"{row['types']:,} types", "foretold", "measured", "measured / foretold"], cells)


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of growth and the arithmetic of a billion types in docs/scaling.md."""
    every, wide = results["rows"], results["wide"]
    rows = [row for row in every if "short_spans_bytes" in row]
    (requests,) = {len(row["ms"]) for row in (*every, wide)}
    shares = [{f"{name}_a_type": row[f"{name}_bytes"] / row["types"] for name in ("file", "disk")} for row in every]
    told = [row | share for row, share in zip(every, shares)]
    overall, large = exponents(rows), exponents(rows, LARGE)
    grown = [
        [what, *(f"{found[name]:.2f}".replace("nan", "-") for found in (overall, large))]
        for name, what in QUANTITIES.items()
    ]
    default = [row for row in rows if row["perimeter"] == DEFAULT]
    compared = [*default, wide, *(row for row in every if row["types"] > wide["types"])]
    percentile = "; their 99th percentile is the largest of them" if requests < 100 else ""
    cores = rows[-1]["made"]["machine"]["cores"]
    return {
        **report.tables("growth", {"build": told, "served": told, "spans": compared}),
        "requests": f"{requests} requests to each atlas, {cores} cores{percentile}.",
        "exponents": report.lines(["quantity ~ types^e", "e, all perimeters", f"e, from {LARGE} on"], grown),
        "refusal": refusal_text(results["refusal"]),
        "billion": billion(rows, cores),
        "foretold": foretold(rows, every[-1]) if every[-1] not in rows else "Not measured.",
        "stamps": report.made_text([row["made"] for row in (*every, wide)]),
    }


def refusal_text(refusal: dict[str, Any]) -> str:
    """What a service says to the largest atlas under its default limit."""
    limit = Settings.model_fields["atlas_max_types"].default
    if refusal["status"] == 200:
        return f"The largest of these atlases has {refusal['types']:,} types and is within the default limit of {limit:,}."
    return (
        f"Under the default `atlas_max_types` of {limit:,} the atlas of {refusal['types']:,} types is refused after "
        f"{significant(refusal['seconds'])} s: `/readyz` answers {refusal['status']} with "
        f'"{refusal["reply"]["detail"]}", `/livez` {refusal["livez"]}; `linkage-atlas serve` ends with exit code '
        f"{refusal['exit_code']}."
    )


def billion(rows: Sequence[dict[str, Any]], cores: int) -> str:
    """The arithmetic of 10^9 types, from the largest atlas that was measured with all of its index."""
    largest = rows[-1]
    types = largest["types"]
    perimeter = bisect.bisect_left(range(MAX_PERIMETER), BILLION, key=lambda p: count_types(TypeRule(max(p, 4))))
    total = count_types(TypeRule(perimeter))
    file = largest["file_bytes"] / types
    memory = largest["disk_bytes"] / types
    shards = math.ceil(total * memory / HOST_BYTES)
    share = total / shards
    found = exponents(rows, LARGE)
    growing, nearer = found["median_ms"], found["similarity_deg"]
    rate = types / largest["build_s"]
    shortest, error, making = largest["median_ms"], largest["similarity_deg"], largest["make_cpu_s"] / types
    median, tail = shortest / 1000 * (share / types) ** growing, largest["p99_ms"] / shortest
    grown, furthest = f"(types / {types:,})", significant(error * (total / types) ** nearer, 2)
    repeated = significant(shards ** (1 - growing), 2)
    rows = [
        ["perimeter", "the first with 10^9 types", f"{perimeter:,}"],
        ["types", f"P^3 / {perimeter**3 / total:.1f}", f"{total:,}"],
        ["files", f"{significant(file)} bytes a type", size(total * file)],
        ["indexes", f"{significant(memory)} bytes a type, on disk", size(total * memory)],
        [
            "shards",
            f"an index of {size(HOST_BYTES)}, so that all of it can be in a host's memory of 64 GB",
            f"{shards:,}",
        ],
        ["types of a shard", "types / shards", f"{share:,.0f}"],
        ["build, one host", f"{rate:,.0f} types a second on {cores} cores", duration(total / rate)],
        ["build, all hosts", "one host's / shards", duration(total / rate / shards)],
        ["index, all hosts", f"{significant(1e6 * making)} s of one core a million types", duration(making * share)],
        ["request, a shard", f"{significant(shortest)} ms x {grown}^{growing:.2f}", duration(median)],
        [
            "request, the slowest",
            f"a shard's median x {tail:.2f}, the largest over the median",
            duration(median * tail),
        ],
        [
            "error of the best row, median",
            f"{significant(error, 2)} degrees x {grown}^{nearer:.2f}",
            f"{furthest} degrees",
        ],
        ["replies to merge", f"shards x {TOP} rows x {ROW_BYTES} bytes", size(shards * TOP * ROW_BYTES)],
        [
            "work if no shard knew the others' limit",
            f"shards^(1 - {growing:.2f}), of one atlas's",
            f"{repeated} times",
        ],
    ]
    head = f"From perimeter {largest['perimeter']:,}, {largest['samples']} samples:\n\n"
    return head + report.lines(["what", "how", "how much"], rows, 2)


PANELS = {
    "seconds": {"build_s": ("build", 1), "ready_s": ("start until ready", 1)},
    "request, ms": {"p99_ms": ("99th percentile", 1), "median_ms": ("median", 1)},
    "memory and file, MB": {
        "build_peak_bytes": ("build, largest process", 1e-6),
        "resident_bytes": ("service, resident", 1e-6),
        "file_bytes": ("file", 1e-6),
    },
}


def draw(results: dict[str, Any]) -> None:
    """Seconds, milliseconds and bytes against types, each with its exponent."""
    rows = results["rows"]
    found = exponents(rows, LARGE)
    with figure("growth.svg", 1, len(PANELS), size=(11.5, 3.9)) as (_, grid):
        for axes, (unit, curves) in zip(grid, PANELS.items()):
            for (name, (label, factor)), marker in zip(curves.items(), "so^"):
                scaled = [{"types": row["types"], name: row[name] and row[name] * factor} for row in rows]
                text = f"{label}: types^{found[name]:.2f}"
                curve(axes, scaled, "types", name, marker=marker, markersize=5, label=text)
            axes.set(xscale="log", yscale="log", xlabel="types", title=unit)
            axes.minorticks_off()
            axes.legend(loc="upper left")
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** 0.35)  # room for the legend


def measured(rule: dict[str, Any], bodies: Sequence[bytes]) -> tuple[dict[str, Any], dict[str, Any]]:
    """An atlas: built, prepared, served, scanned; and refused by a service with the default limit."""
    with tempfile.TemporaryDirectory() as folder:
        atlas = Path(folder) / "atlas.h5"
        row = {**rule, **build(atlas, **rule), **make(atlas, prepare_positions=False)}
        row |= serve(atlas, bodies) | in_a_process(atlas, len(bodies)) | {"made": report.stamp()}
        print(json.dumps({name: value for name, value in row.items() if name != "ms"}), flush=True)
        return row, {"types": row["types"], **refusal(atlas)}


def measure(
    perimeters: Annotated[int, "of the atlases"] = PERIMETERS,
    requests: Annotated[int, "to each atlas"] = 40,
    wide: Annotated[int, "1: the wider atlas too", (0, 1)] = 1,
) -> Iterator[dict[str, Any]]:
    """Every perimeter in turn, from the smallest, after the wider atlas. What is left out keeps its figures."""
    bodies = match_bodies(requests)
    results = {"rows": [], **report.known("growth")}
    results.pop("made", None)
    if wide:
        results["wide"], _ = measured(WIDE, bodies)
    for perimeter in tqdm(sorted(perimeters), disable=None, unit="atlas"):
        samples = next(samples for largest, samples in SAMPLES.items() if perimeter <= largest)
        row, refused = measured({"perimeter": perimeter, "order": "increasing", "samples": samples}, bodies)
        others = [known for known in results["rows"] if known["perimeter"] != perimeter]
        results["rows"] = sorted([*others, row], key=lambda known: known["perimeter"])
        if row is results["rows"][-1]:
            results["refusal"] = refused
        yield results


if __name__ == "__main__":
    report.run(measure)
