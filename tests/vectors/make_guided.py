"""Makes guided.json beside it: poses by `synthesis.linkage`, for the page's kinematics to agree with.

Run ``python -m tests.vectors.make_guided`` from the project's root.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import linkage_atlas as la
from tests.oracles.guided_cases import DRIVES, random_linkage

FILE = Path(__file__).with_name("guided.json")
SEED = 71
DEAD = 0.05
"""Transmission angle in radians, below which two ways of rounding differ by more than rounding."""


def vectors() -> list[dict]:
    random = np.random.default_rng(SEED)
    built = []
    for drive in DRIVES:
        for _ in range(10):
            linkage = random_linkage(random, *drive)
            solution = la.Linkage.of(linkage, np.pi / 180, None).to_dict()
            travel = random.uniform(-1.5, 1.5, 4)
            found = linkage.body(linkage.start + travel)
            for k in range(4):
                closed = bool(np.isfinite(found.rotation[k]))
                if closed and found.transmission_angle[k] < DEAD:
                    continue
                # the page takes lengths as if they were degrees
                coordinate = travel[k] if drive[1].turns else np.deg2rad(travel[k])
                entry = {"solution": solution, "travel": float(coordinate), "closed": closed}
                if closed:
                    position = complex(found.position[k])
                    entry |= {
                        "rotation": float(found.rotation[k]),
                        "place": [position.real, position.imag],
                        "transmission": float(found.transmission_angle[k]),
                    }
                built.append(entry)
    return built


def text() -> str:
    return "[\n" + ",\n".join(json.dumps(entry) for entry in vectors()) + "\n]\n"


if __name__ == "__main__":
    FILE.write_text(text())
    print(f"{FILE.name}: {len(vectors())} vectors")
