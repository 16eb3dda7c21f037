"""Machines and their parts for tests of solids, and slow counterparts: overlap by polygons, a STEP file by its topology."""

from __future__ import annotations

import json
import re
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np

from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine, Sizes
from synthesis.assembly.parts import Heights
from synthesis.assembly.shapes import distances, nearest_on
from synthesis.assembly.stacks import Arrangement, StackRequest, arrange
from synthesis.linkage import Linkage, four_bar
from synthesis.solids.mesh import ring_of
from synthesis.solids.solid import FITS, Manufacture, Solid, Solids, solids_of
from synthesis.target import Interval
from synthesis.work import Work

TABLE = json.loads((Path(__file__).parents[1] / "reference/assembly.json").read_text())["linkages"]
SASH = [-40 - 30j, 50 - 30j, 50 + 30j, 10 + 30j, 10 + 16j, -10 + 16j, -10 + 30j, -40 + 30j]
"""A body whose outline is not convex."""


def linkage_of(case) -> Linkage:
    point = case["body_point"]
    return four_bar(
        tuple(case["links"]),
        case["branch"],
        np.deg2rad(case["start"]),
        10 + 5j,
        np.deg2rad(case["ground"]),
        None if point is None else (point[0], np.deg2rad(point[1])),
    )


def built(name: str, boards: str = "both", heads: bool = False, fit: str = "H7", body=()) -> Solids:
    """The parts of a worked linkage."""
    machine, found = arranged(name, boards, heads, body)
    assert found.status == "free", (name, boards, heads)
    return solids_of(machine, found.stack, manufacture(machine, fit), 1.0)


def manufacture(machine: Machine, fit: str = "H7", unit: float = 1.0) -> Manufacture:
    """Aluminium and steel, in sheets of half a hole or the thickness that a fit needs."""
    thick = max(0.5 * machine.hole, FITS[fit].plate / unit)
    return Manufacture(FITS[fit], "aluminium", "steel", Heights(thick, max(0.2 * thick, FITS[fit].washer / unit)))


def arranged(name: str, boards: str = "both", heads: bool = False, body=()) -> tuple[Machine, Arrangement]:
    case = TABLE[name]
    sizes = Sizes(*(case[size] for size in ("hole", "width", "clearance")))
    machine = as_plates(linkage_of(case), Interval(*np.deg2rad(case["used"])), sizes, body=body, bar=boards == "bar")
    return machine, arrange(machine, StackRequest(boards, heads=heads), Work())


def places_of(machine: Machine, count: int) -> np.ndarray:
    return np.linspace(machine.used.first, machine.used.last, count)


def deepest(solids: Solids, count: int) -> tuple[float, tuple[str, str]]:
    """Return the largest depth by which a part reaches into another over the used interval; negative if all parts
    are apart.

    A pin in its own hole counts by the radii, and must be in the middle; the other parts by polygons.
    """
    worst, who = -np.inf, ("", "")
    posed = [solids.posed(travel) for travel in places_of(solids.machine, count)]
    turns = np.array([[position.turn for position in positions] for positions in posed])
    shifts = np.array([[position.shift for position in positions] for positions in posed])
    rings = [ring_of(part.prism.contours[0]) for part in solids.parts]
    for (i, first), (j, second) in combinations(enumerate(solids.parts), 2):
        if min(first.up + first.prism.height, second.up + second.prism.height) - max(first.up, second.up) <= 1e-9:
            continue
        # parts of the same body do not move against each other
        positions = slice(1) if first.body == second.body else slice(None)
        deep = _in_hole(first, second, shifts[0, [i, j]], turns[0, [i, j]])
        deep = _in_slit(first, second, shifts[:, [i, j]], turns[:, [i, j]]) if deep is None else deep
        if deep is None:
            drawn = [turns[positions, k][:, None] * rings[k] + shifts[positions, k][:, None] for k in (i, j)]
            gaps = distances(*drawn)
            deep = 1.0 if gaps.min() == 0 else -float(gaps.min())
        if deep > worst:
            worst, who = deep, (first.name, second.name)
    return worst, who


def _in_hole(first: Solid, second: Solid, at, turn) -> float | None:
    """Return the excess of a pin over the hole that it is in; None for other parts."""
    for pin, plate, here, there, direction in (
        (first, second, at[0], at[1], turn[1]),
        (second, first, at[1], at[0], turn[0]),
    ):
        if pin.prism.diameter is not None and not pin.prism.holes:
            for hole in plate.prism.holes:
                if len(hole.core) == 1 and abs(hole.core[0] * direction + there - here) < 1e-9:
                    return float(pin.prism.diameter / 2 - hole.radius)
    return None


def _in_slit(first: Solid, second: Solid, at, turn) -> float | None:
    """Return the distance by which a pin leaves its slit in any position; None for other parts."""
    for pin, plate, k in ((first, second, 0), (second, first, 1)):
        if pin.prism.diameter is not None and not pin.prism.holes:
            for hole in plate.prism.holes:
                positions = (at[:, k] - at[:, 1 - k]) / turn[:, 1 - k]
                off = max(abs(nearest_on(hole.core, complex(position)) - position) for position in positions)
                if len(hole.core) > 1 and off < hole.radius / 2:
                    return float(off + pin.prism.diameter / 2 - hole.radius)
    return None


def step_shells(text: str) -> list[dict]:
    """Return the shells of a STEP file by name: faces, edges, corners, and true if every edge is used once in each
    direction.
    """
    entities = dict(re.findall(r"#(\d+)=(.*?);\n", text, re.S))
    used = set(re.findall(r"#(\d+)", " ".join(entities.values())))
    assert used <= entities.keys(), "a reference leads nowhere"
    found = []
    for entity in entities.values():
        match = re.fullmatch(r"MANIFOLD_SOLID_BREP\('(.*)',#(\d+)\)", entity)
        if not match:
            continue
        faces = re.findall(r"#(\d+)", entities[match[2]])
        directions, corners, bounds = Counter(), set(), 0
        for face in faces:
            inside = re.search(r"\(((?:#\d+,?)+)\)", entities[face])[1]
            for bound in re.findall(r"#(\d+)", inside):
                bounds += 1
                loop = re.search(r"#(\d+)", entities[bound])[1]
                for edge in re.findall(r"#(\d+)", entities[loop]):
                    curve, sign = re.fullmatch(
                        r"ORIENTED_EDGE\('',\*,\*,#(\d+),\.([TF])\.\)", entities[edge]
                    ).groups()
                    directions[curve, sign] += 1
                    corners |= set(re.findall(r"#(\d+)", entities[curve])[:2])
        edges = {curve for curve, _ in directions}
        closed = all(directions[curve, sign] == 1 for curve in edges for sign in "TF")
        found.append(
            {
                "name": match[1],
                "closed": closed,
                # each bound beyond the first of a face is a ring
                "euler": len(corners) - len(edges) + len(faces) - (bounds - len(faces)),
            }
        )
    return found
