"""The tables of ``docs/scaling.md`` and ``docs/img/growth.svg``, from what `growth` and `throughput` measured.

``python -m benchmarks.scaling`` writes them anew without measuring. The prose between the tables is written by hand.
"""

from __future__ import annotations

import bisect
import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from app.settings import Settings
from synthesis.fourbar.dimension_types import MAX_PERIMETER, TypeRule, count_types

ROOT = Path(__file__).parents[1]
GROWTH = ROOT / "benchmarks" / "results" / "growth.json"
THROUGHPUT = ROOT / "benchmarks" / "results" / "throughput.json"
PAGE = ROOT / "docs" / "scaling.md"
FIGURE = ROOT / "docs" / "img" / "growth.svg"
LARGE = 200
"""Perimeter from which on what every process costs at any size is small beside what grows."""
BILLION = 10**9
HOST_BYTES = 48e9
"""Memory for the atlas on a host of 64 GB; the rest is for requests, the file while it is read, and the system."""
TOP, ROW_BYTES = 10, 40
"""Rows of a reply between hosts, and bytes of one: error, number, start, branch, offset, each of 8."""


class Exponents(NamedTuple):
    """e in quantity ~ types^e: over all perimeters, and over those from `LARGE` on; NaN for fewer than two."""

    overall: float
    large: float

    @property
    def best(self) -> float:
        """The one that says more of larger atlases."""
        return self.large if math.isfinite(self.large) else self.overall


def slope(types: Sequence[float], values: Sequence[float | None]) -> float:
    """Slope of the least-squares line of log values against log types. Law: 3 types^e has the slope e."""
    if len(types) < 2 or None in values:
        return math.nan
    return float(np.polyfit(np.log(types), np.log(np.array(values, dtype=float)), 1)[0])


QUANTITIES = {
    "build_s": "build, seconds",
    "build_peak_bytes": "build, memory of the largest process",
    "file_bytes": "file",
    "ready_s": "start until /readyz, seconds",
    "resident_bytes": "resident memory when ready",
    "peak_bytes_asked": "peak memory after all requests",
    "scan_bytes": "prepared scan",
    "median_ms": "request, median",
    "p99_ms": "request, 99th percentile",
    "evaluated": "windows evaluated exactly, median",
    "similarity_deg": "error of the best row, median",
}


def exponents(rows: Sequence[dict[str, Any]]) -> dict[str, Exponents]:
    """How each of `QUANTITIES` grows with the number of types."""
    large = [row for row in rows if row["perimeter"] >= LARGE]

    def of(some: Sequence[dict[str, Any]], name: str) -> float:
        return slope([row["types"] for row in some], [row[name] for row in some])

    return {name: Exponents(of(rows, name), of(large, name)) for name in QUANTITIES}


# -- words ------------------------------------------------------------------------------------------------------------


def table(head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 1) -> str:
    """A Markdown table; the columns behind the first ones are numbers."""
    rule = ["---"] * text_columns + ["--:"] * (len(head) - text_columns)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *rows))


def significant(value: float | None, digits: int = 3) -> str:
    """A number to so many digits, without powers of ten: 0.0123, 1.23, 12,300; a dash for what was not measured."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0:
        return "0"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, places):,.{max(places, 0)}f}"


def size(value: float | None) -> str:
    """Bytes as MB, GB or TB."""
    if value is None or not math.isfinite(value):
        return "-"
    unit, name = next(
        (u, n) for u, n in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")) if value >= u or n == "kB"
    )
    return f"{significant(value / unit)} {name}"


def duration(seconds: float) -> str:
    """Seconds as ms, s, minutes or hours."""
    for unit, name, least in ((3600, "hours", 2), (60, "minutes", 2), (1, "s", 1)):
        if seconds >= unit * least:
            return f"{significant(seconds / unit)} {name}"
    return f"{significant(1000 * seconds)} ms"


def percent(share: float) -> str:
    """A share in percent."""
    return f"{significant(100 * share, 2)} %"


# -- growth -----------------------------------------------------------------------------------------------------------


def growth_parts(growth: dict[str, Any]) -> dict[str, str]:
    """The tables of one atlas after the other."""
    rows = growth["rows"]
    built = [
        [
            f"{row['perimeter']:,}",
            f"{row['types']:,}",
            str(row["samples"]),
            significant(row["build_s"]),
            size(row["build_peak_bytes"]),
            size(row["file_bytes"]),
            significant(row["file_bytes"] / row["types"]),
        ]
        for row in rows
    ]
    served = [
        [
            f"{row['perimeter']:,}",
            significant(row["ready_s"]),
            size(row["resident_bytes"]),
            size(row["peak_bytes"]),
            significant(row["scan_bytes"] / row["types"]),
            significant(row["median_ms"]),
            significant(row["p99_ms"]),
            f"{row['evaluated']:,.0f} of {row['windows']:,}",
            significant(row["similarity_deg"], 2),
        ]
        for row in rows
    ]
    percentile = "; their 99th percentile is the largest of them" if growth["requests"] < 100 else ""
    grown = [
        [QUANTITIES[name], *(f"{value:.2f}" if math.isfinite(value) else "-" for value in found)]
        for name, found in exponents(rows).items()
    ]
    return {
        "build": table(
            ["perimeter", "types", "samples", "build, s", "its memory", "file", "file, bytes a type"], built, 0
        ),
        "growth": table(
            [
                "perimeter",
                "ready, s",
                "resident",
                "peak",
                "scan, bytes a type",
                "request, median ms",
                "99 %, ms",
                "windows evaluated",
                "best row, degrees",
            ],
            served,
            0,
        ),
        "requests": f"{growth['requests']} requests to each atlas, {growth['machine']['cores']} cores{percentile}.",
        "exponents": table(["quantity ~ types^e", "e, all perimeters", f"e, from {LARGE} on"], grown),
        "refusal": refusal_text(growth["refusal"]),
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


# -- throughput -------------------------------------------------------------------------------------------------------


def throughput_parts(throughput: dict[str, Any]) -> dict[str, str]:
    """The tables of requests and of too many requests."""
    loads, overloads, clients = [], [], []
    for service in throughput["services"]:
        name, livez = service["service"], service["livez"]
        clients.append(
            [name, significant(livez["per_second"]), significant(livez["p50_ms"], 2), size(service["peak_bytes"])]
        )
        loads += [
            [
                load["path"],
                name,
                str(load["clients"]),
                significant(load["per_second"]),
                significant(load.get("p50_ms")),
                significant(load.get("p99_ms")),
                percent(load["share_503"]),
                significant(load.get("service_cores"), 2),
                significant(load["client_cores"], 2),
            ]
            for load in service["loads"]
        ]
        overloads += [
            [
                load["path"],
                name,
                "wait" if load["patient"] else "ask again",
                significant(load["per_second"]),
                significant(load.get("p99_ms")),
                percent(load["share_503"]),
                f"{load['with_retry_after']:,} of {load['replies'] - load['served'] - load['others']:,}",
                f"{load['others']:,}",
                significant(load.get("livez_p99_ms")),
            ]
            for load in service["overload"]
        ]
    loads.sort(key=lambda row: row[0])  # stable: the order of services stays
    overloads.sort(key=lambda row: row[0])
    heads = ["route", "service", "clients", "answered / s", "median, ms", "99 %, ms", "503"]
    heads_overload = [
        *heads[:2],
        "after a 503",
        heads[3],
        heads[5],
        "503",
        "with Retry-After",
        "others",
        "/livez 99 %, ms",
    ]
    return {
        "throughput": table([*heads, "its cores", "clients' cores"], loads, 2),
        "ratios": ratios_text(throughput["services"]),
        "clients": table(["service", "/livez / s", "median, ms", "peak memory"], clients),
        "overload": table(heads_overload, overloads, 3),
    }


def ratios_text(services: Sequence[dict[str, Any]]) -> str:
    """How much more two services answer than one, with the most clients."""
    rates = {
        row["service"]: {load["path"]: load["per_second"] for load in row["loads"]} for row in services
    }  # the last load of a route is that of the most clients
    one, two = (rates[name] for name in ("one service", "two services"))
    most = max(load["clients"] for load in services[0]["loads"])
    ratios = " and ".join(f"{significant(two[path] / one[path], 2)} times the requests to {path}" for path in one)
    return f"With {most} clients two services answer {ratios} that one does."


# -- a billion types --------------------------------------------------------------------------------------------------


def billion_parts(growth: dict[str, Any]) -> dict[str, str]:
    """The arithmetic of 10^9 types, from the largest atlas that was measured."""
    largest = growth["rows"][-1]
    types, cores = largest["types"], growth["machine"]["cores"]
    perimeter = bisect.bisect_left(range(MAX_PERIMETER), BILLION, key=lambda p: count_types(TypeRule(max(p, 4))))
    total = count_types(TypeRule(perimeter))
    file = largest["file_bytes"] / types
    memory = (largest["peak_bytes_asked"] or largest["scan_bytes"]) / types
    shards = math.ceil(total * memory / HOST_BYTES)
    share = total / shards
    found = exponents(growth["rows"])
    growing, nearer = found["median_ms"].best, found["similarity_deg"].best
    rate = types / largest["build_s"]
    median = largest["median_ms"] / 1000 * (share / types) ** growing
    slowest = median * largest["p99_ms"] / largest["median_ms"]
    ready = largest["ready_s"] * share / types
    rows = [
        ["perimeter", "the first with 10^9 types", f"{perimeter:,}"],
        ["types", f"P^3 / {perimeter**3 / total:.1f}", f"{total:,}"],
        ["files", f"{significant(file)} bytes a type", size(total * file)],
        ["memory", f"{significant(memory)} bytes a type at most, while starting or asked", size(total * memory)],
        ["shards", f"{size(HOST_BYTES)} of a host's 64 GB", f"{shards:,}"],
        ["types of a shard", "types / shards", f"{share:,.0f}"],
        ["build, one host", f"{rate:,.0f} types a second on {cores} cores", duration(total / rate)],
        ["build, all hosts", "one host's / shards", duration(total / rate / shards)],
        ["start", f"{significant(1e6 * largest['ready_s'] / types)} s a million types", duration(ready)],
        [
            "request, a shard",
            f"{significant(largest['median_ms'])} ms x (types / {types:,})^{growing:.2f}",
            duration(median),
        ],
        [
            "request, the slowest",
            f"a shard's median x {largest['p99_ms'] / largest['median_ms']:.2f}, the largest over the median",
            duration(slowest),
        ],
        [
            "error of the best row, median",
            f"{significant(largest['similarity_deg'], 2)} degrees x (types / {types:,})^{nearer:.2f}",
            f"{significant(largest['similarity_deg'] * (total / types) ** nearer, 2)} degrees",
        ],
        ["replies to merge", f"shards x {TOP} rows x {ROW_BYTES} bytes", size(shards * TOP * ROW_BYTES)],
        [
            "work if no shard knew the others' limit",
            f"shards^(1 - {growing:.2f}), of one atlas's",
            f"{significant(shards ** (1 - growing), 2)} times",
        ],
    ]
    return {
        "billion": f"From perimeter {largest['perimeter']:,}, {largest['samples']} samples:\n\n"
        + table(["what", "how", "how much"], rows, 2)
    }


# -- picture and page -------------------------------------------------------------------------------------------------


def draw(rows: Sequence[dict[str, Any]]) -> None:
    """Seconds, milliseconds and bytes against types, each with its exponent; the same bytes for the same rows."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    panels = {
        "seconds": {"build_s": ("build", 1), "ready_s": ("start until ready", 1)},
        "request, ms": {"p99_ms": ("99th percentile", 1), "median_ms": ("median", 1)},
        "memory and file, MB": {
            "build_peak_bytes": ("build, largest process", 1e-6),
            "resident_bytes": ("service, resident", 1e-6),
            "file_bytes": ("file", 1e-6),
        },
    }
    style = {
        "font.size": 9.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#e4e4e4",
        "grid.linewidth": 0.7,
        "axes.axisbelow": True,
        "svg.hashsalt": "linkage-atlas",
    }
    found = exponents(rows)
    with mpl.rc_context(style):
        figure, grid = plt.subplots(1, 3, figsize=(11.5, 3.9), layout="constrained")
        for axes, (unit, curves) in zip(grid, panels.items()):
            for (name, (label, factor)), colour, marker in zip(
                curves.items(), ("#3a86c8", "#0b6e4f", "#b8860b"), "so^"
            ):
                known = [(row["types"], row[name] * factor) for row in rows if row[name] is not None]
                if known:
                    text = f"{label}: types^{found[name].best:.2f}"
                    axes.plot(*zip(*known), color=colour, marker=marker, markersize=5, linewidth=1.8, label=text)
            axes.set(xscale="log", yscale="log", xlabel="types")
            axes.set_title(unit, loc="left", fontsize=10)
            axes.minorticks_off()
            axes.legend(frameon=False, fontsize=9, loc="upper left")
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** 0.35)  # room for the legend
        FIGURE.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(FIGURE, metadata={"Date": None})
        plt.close(figure)


def fill(text: str, parts: dict[str, str]) -> str:
    """A page with each part between its marks ``<!-- name -->`` and ``<!-- /name -->``.

    Raises
    ------
    ValueError
        The page has no such marks, or has them twice.
    """
    for name, part in parts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        text, count = pattern.subn(lambda found, part=part: f"{found[1]}{part}\n{found[2]}", text)
        if count != 1:
            raise ValueError(f"the page has {count} places for {name}, wanted one")
    return text


def parts() -> dict[str, str]:
    """Every part of the page that what was measured so far gives."""
    found: dict[str, str] = {}
    if GROWTH.exists():
        growth = json.loads(GROWTH.read_text())
        found |= growth_parts(growth) | billion_parts(growth)
    if THROUGHPUT.exists():
        found |= throughput_parts(json.loads(THROUGHPUT.read_text()))
    return found


def write() -> None:
    """The page's tables and the picture."""
    PAGE.write_text(fill(PAGE.read_text(), parts()))
    if GROWTH.exists():
        draw(json.loads(GROWTH.read_text())["rows"])


if __name__ == "__main__":
    write()
