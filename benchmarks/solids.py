"""Files of solid parts of the gallery and of machines with slits and motors: how long each takes and is (`make solids`)."""

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


PRINTED: dict[str, Any] = {"boards": "both", "fit": "print"}
CIRCLE = {"guide": "circle", "pivot": [3, -4], "radius": 20, "body_point": [5, 2]}
RAIL = {"guide": "rail", "point": [0, 6], "direction": 10, "body_point": [50, 8]}
SLOT = {"guide": "slot", "pin": [60, 5], "body_point": [3, 1], "body_direction": 4}
UPRIGHT = {"guide": "rail", "point": [0, 0], "direction": 100, "body_point": [0, 4]}
ON_GUIDES = {
    "Slider-crank": ([CIRCLE, RAIL], "crank", 30, [0, 10, 25]),
    "Swinging block": ([CIRCLE, SLOT], "crank", 30, [0, 10, 25]),
    "Rail and slot": ([UPRIGHT, SLOT], "slider", 12, [0, 10, 25]),
    "Two rails": ([UPRIGHT, RAIL], "slider", 12, [0, 10, 25]),
}
"""Guides, drive, where it starts, and its travel."""


def machines() -> Iterator[tuple[str, SolidParts]]:
    """Parts of all machines, made to be printed, boards on both sides."""
    yield from gallery()
    for title, (guides, driver, start, travel) in ON_GUIDES.items():
        linkage = la.Linkage(guides, driver, start=start)
        motion = la.Motion(position=linkage.joints(travel).body_point, timing="free")
        yield title, linkage.solids(motion, travel, **PRINTED)
    four_bar = la.FourBar(30, 60, 70, 50, start_angle=40, coupler_point_polar=(40, 30))
    for link in ("crank", "coupler"):
        dyad = [{"kind": "dyad", "links": [link]}]
        driven = la.drives(four_bar, dyad, crank_angle=[0, 60]).drives[0].linkage
        yield f"Motor and rod on the {link}", driven.solids(**PRINTED)


def gallery() -> Iterator[tuple[str, SolidParts]]:
    """The parts of the first solution of each machine that has layers."""
    for example in json.loads(GALLERY.read_text()):
        fields = {name: example["request"][name] for name in MOTION if name in example["request"]}
        motion = la.Motion(**fields, degrees=example["request"].get("angle_unit", "deg") == "deg")
        for solution in example["reply"]["solutions"]:
            linkage = la.Linkage.from_dict(solution, motion.degrees)
            try:
                yield example["title"], linkage.solids(motion, solution["crank_angle"], **PRINTED)
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
            try:
                for _ in range(runs):
                    content = times.run(parts.file, kind)
            except la.FieldError:  # robots are written where all joints turn
                continue
            row[f"{kind}_ms"], row[f"{kind}_kb"] = 1000 * times.median.processor, len(content) / 1000
        rows.append(row)
        yield {"files": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """What the files take."""
    rows = results["files"]
    took = ", ".join(
        f"{report.ends([row[f'{kind}_ms'] for row in rows if f'{kind}_ms' in row], 0)} ms ({kind.upper()})"
        for kind in ("step", "3mf", "stl", "urdf", "sdf")
    )
    largest = max(row[f"{kind}_kb"] for row in rows for kind in ("step", "3mf", "stl"))
    return {"files": f"{took}, at most {largest:.0f} kB"}


if __name__ == "__main__":
    report.run(measure)
