"""Makes kinematics.json beside it: closed loops by `synthesis.four_bar`, for the page's kinematics to agree with.

Run ``python -m tests.vectors.make_kinematics`` from the project's root.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from synthesis.four_bar import close_loop, family
from tests.oracles.conditions import condition_of_closure

FILE = Path(__file__).with_name("kinematics.json")
SEED = 20240817
MAX_CONDITION = 50.0
"""For cranks that do not turn fully, poses nearer to a limit position differ by more than rounding between two sines.
"""


def linkages(rng: np.random.Generator) -> list[list[float]]:
    """Crank-rockers and double-cranks, any family, near and at change points, very large and very small units."""
    rows = [
        [19, 72, 144, 165],
        [165, 144, 72, 19],
        [1, 2, 2, 1],
        [2, 1, 1, 2],
        [1, 1, 1, 1],
        [3, 4, 5, 6],
        [1, 3, 1.5, 1.2],
    ]
    for _ in range(40):
        l1, l4, u, w = rng.uniform(0.1, 2), rng.uniform(0.1, 2), rng.uniform(-4, 1), rng.uniform(-2, 2)
        total, difference = l1 + l4 + np.exp(u), abs(l4 - l1) * np.tanh(w)
        rows.append([l1, (total + difference) / 2, (total - difference) / 2, l4])
    rows += [list(rng.uniform(0.2, 2, 4)) for _ in range(40)]
    for gap in (1e-3, 1e-6, 1e-9, 1e-11):
        rows += [[1, 2, 3 + gap, 4], [2, 3.5, 2.5 + gap, 4], [4, 3, 2 + gap, 1]]
    rows += [[k * v for v in (19, 72, 144, 165)] for k in (1e-140, 1e140, 1 / 3)]
    return [[float(value) for value in row] for row in rows]


def vectors() -> list[dict]:
    rng = np.random.default_rng(SEED)
    built = []
    for row in linkages(rng):
        for branch in (1, -1):
            angles = np.concatenate([rng.uniform(-4 * np.pi, 4 * np.pi, 6), [0.5, np.pi - 1e-3, 6.0]])
            closure = close_loop(row, angles)
            full = str(family(row)[()]) in ("crank_rocker", "double_crank")
            with np.errstate(all="ignore"):
                safe = full | (condition_of_closure(row, branch, angles) < MAX_CONDITION)
            for k, angle in enumerate(angles):
                if closure.closed[k] and not safe[k]:
                    continue
                entry = {
                    "links": row,
                    "branch": branch,
                    "crank_angle": float(angle),
                    "closed": bool(closure.closed[k]),
                }
                if closure.closed[k]:
                    entry["coupler"] = float(closure.coupler_angle(branch)[k])
                    entry["rocker"] = float(closure.rocker_angle(branch)[k])
                    entry["transmission"] = float(closure.transmission_angle[k])
                entry["family"] = str(family(row)[()])
                built.append(entry)
    return built


def text() -> str:
    return "[\n" + ",\n".join(json.dumps(entry) for entry in vectors()) + "\n]\n"


if __name__ == "__main__":
    FILE.write_text(text())
    print(f"{FILE.name}: {len(vectors())} vectors")
