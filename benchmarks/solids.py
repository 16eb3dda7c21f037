"""Files of solid parts of the page's gallery: how many parts, how long each file takes and how long it is (`make solids`)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import linkage_atlas as la
from benchmarks import report
from benchmarks.report import Times
from linkage_atlas.solids import SolidParts

GALLERY = Path(__file__).parents[1] / "app/static/examples.json"
MOTION = ("rotation", "position", "crank_span", "crank_angle", "timing", "order", "closed", "weights", "tolerances")
"""Fields of a request that say the motion."""
KINDS = ("step", "3mf", "stl", "urdf", "sdf")


def machines() -> Iterator[tuple[str, SolidParts]]:
    """The parts of the first solution of each machine that has layers, boards on both sides."""
    for one in json.loads(GALLERY.read_text()):
        asked = {name: one["request"][name] for name in MOTION if name in one["request"]}
        motion = la.Motion(**asked, degrees=one["request"].get("angle_unit", "deg") == "deg")
        for solution in one["reply"]["solutions"]:
            linkage = la.FourBar.from_dict(solution, motion.degrees)
            try:
                yield one["title"], linkage.solids(motion, solution["crank_angle"], boards="both", fit="print")
            except la.FieldError:
                continue
            break


def measure(runs: Annotated[int, "of each file, the median of which counts"] = 9) -> Iterator[dict[str, Any]]:
    """Each machine with its five files."""
    rows = []
    for title, parts in machines():
        row: dict[str, Any] = {"machine": title, "parts": len(parts.parts), "wall": parts.thinnest_wall.value}
        for kind in KINDS:
            times = Times()
            for _ in range(runs):
                content = times.run(parts.file, kind)
            row[f"{kind}_ms"], row[f"{kind}_kb"] = 1000 * times.median.processor, len(content) / 1000
        rows.append(row)
        yield {"files": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """What the files take."""
    rows = results["files"]
    took = ", ".join(
        f"{report.ends([row[f'{kind}_ms'] for row in rows], 0)} ms ({kind.upper()})"
        for kind in ("step", "3mf", "stl", "urdf", "sdf")
    )
    largest = max(row[f"{kind}_kb"] for row in rows for kind in ("step", "3mf", "stl"))
    return {"files": f"{took}, at most {largest:.0f} kB"}


if __name__ == "__main__":
    report.run(measure)
