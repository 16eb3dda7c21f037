"""Compute the reference figures of ``knotter.json`` in 40 digits: ``python -m tests.reference.make_knotter``.

Only the equations of `tests.oracles.knotter` are used, none of the code under test.
The published figures under ``paper`` and the inputs of ``REF_PRINT`` are copied from the existing file.
The run takes about a minute.
"""

from __future__ import annotations

import json
from pathlib import Path

import mpmath as mp
import numpy as np

from tests.oracles.knotter import SIZES, Exact

FILE = Path(__file__).with_name("knotter.json")
PAIRS = [(alpha1, alpha3) for alpha1 in (0, 10, 20) for alpha3 in (20, 25, 30)]
EDGES = {"wrap": ("S3S4", "S4S5", "S5S3"), "bite": ("O5S8", "S8S9", "S9O5")}
STEP = 0.25
"""Step of the scan that brackets events, degrees."""


def inside(machine: Exact, event: str, degrees: float) -> tuple[bool, list]:
    """Return True if the rope crosses the triangle, and the sides of the three edges."""
    alpha = mp.radians(degrees)
    sides = [machine.side(event, edge, alpha) for edge in range(3)]
    return 0 < getattr(machine, event)(alpha)[1] < 1 and len({mp.sign(side) for side in sides}) == 1, sides


def first_window(machine: Exact, event: str, low: float, high: float) -> tuple:
    """Return the angle and edge of the first entry, and the angle at which the rope leaves or None, in degrees."""
    angles = np.arange(low, high + STEP / 2, STEP)
    states = [inside(machine, event, angle) for angle in angles]
    start = next(k for k in range(1, len(angles)) if states[k][0] and not states[k - 1][0])
    stop = next((k for k in range(start, len(angles)) if not states[k][0]), None)

    def passed_edges(k: int) -> list:
        changed = [edge for edge in range(3) if states[k][1][edge] * states[k - 1][1][edge] < 0]
        ends = [mp.radians(angles[k - 1]), mp.radians(angles[k])]
        return [(mp.degrees(machine.root(event, edge, *ends)), EDGES[event][edge]) for edge in changed]

    return (*max(passed_edges(start)), None if stop is None else min(passed_edges(stop))[0])


def crossing_before_entry(machine: Exact, step: float) -> list:
    """Return E1 at the last step of the source's scan before the rope is inside."""
    angles = np.arange(0, 180, step)
    entry = next(k for k, angle in enumerate(angles) if inside(machine, "wrap", angle)[0])
    return list(machine.wrap(mp.radians(angles[entry - 1]))[0])


def needle() -> dict:
    """Evaluate eqs 4 and 5 with the printed lengths."""

    def clearance(degrees):
        c, s = mp.cos(mp.radians(degrees)), mp.sin(mp.radians(degrees))
        return 22 * c + 39 * s - 16 / c - 10

    def d5(degrees):
        c, s = mp.cos(mp.radians(degrees)), mp.sin(mp.radians(degrees))
        return 30 * mp.sin(mp.radians(15)) + 22 * c + (142 + 39) * s

    best = mp.findroot(lambda degrees: mp.diff(clearance, degrees), 39)
    return {
        "L_roots": [mp.findroot(clearance, guess) for guess in (6, 62)],
        "L_max": [clearance(best), best],
        "L": {str(degrees): clearance(degrees) for degrees in (0, 6, 7, 8, 10)},
        "d5": {str(degrees): d5(degrees) for degrees in (7, 8, 9)},
        "alpha2_for_54": mp.findroot(lambda degrees: d5(degrees) - 54, 8),
    }


def figures(file: dict) -> dict:
    """Compute all figures except those copied from the file."""
    pair = {f"{alpha1},{alpha3}": Exact(alpha1, alpha3, round_angles=False) for alpha1, alpha3 in PAIRS}
    chosen, at_270 = pair["10,25"], mp.radians(270)
    wrap = {}
    for key, machine in pair.items():
        angle, edge, leave = first_window(machine, "wrap", 0, 180)
        wrap[key] = [angle, edge, *machine.wrap(mp.radians(angle))[0], leave]
    bites = {key: first_window(pair[key], "bite", 270, 360) for key in file["bite"]}
    bite = {}
    for key, (angle, edge, _) in bites.items():
        (x, z), _, (_, s8, s9) = pair[key].bite(mp.radians(angle))
        assert edge == "S8S9"
        bite[key] = [angle, mp.hypot(x - s8[0], z - s8[1]) / mp.hypot(s9[0] - s8[0], s9[1] - s8[1])]
    worst = {
        key: mp.findroot(lambda a, machine=pair[key]: mp.diff(machine.depth, a), at_270)
        for key in file["worst_angle"]
    }
    e2 = chosen.bite(mp.radians(bites["10,25"][0]))[0]

    def at_s4(d5, alpha):
        (y, z), _, _ = Exact(10, 25, round_angles=False, d5=d5).wrap(alpha)
        return [y - 8, z + 28]

    closing = mp.findroot(at_s4, (mp.mpf(74.5), mp.radians(126)))
    printed = file["REF_PRINT"]
    inputs = {**SIZES, **printed["parameters"], **printed["laws"]["beta"]}

    def print_machine(key: str) -> Exact:
        return Exact(*map(int, key.split(",")), printed["points"], False, **inputs)

    return needle() | {
        "S0_u4_10_25": {str(at): list(chosen.disc_in_bill(mp.radians(at))) for at in (0, 90, 180, 270)},
        "wrap": wrap,
        "S10_j3_at_270": {key: pair[key].depth(at_270) for key in file["S10_j3_at_270"]},
        "worst_angle": {key: mp.degrees(at) for key, at in worst.items()},
        "worst_10_25": chosen.depth(worst["10,25"]),
        "bite": bite,
        "E2_10_25": [e2[0], 0, e2[1]],
        "closing_d5": [closing[0], mp.degrees(closing[1])],
        "REF_PRINT": {
            **printed,
            "E1_before_hit": {
                key: crossing_before_entry(print_machine(key), printed["scan_step"])
                for key in printed["E1_before_hit"]
            },
        },
        "REF_scan_step_2": {key: crossing_before_entry(pair[key], 2) for key in file["REF_scan_step_2"]},
    }


def rounded(value):
    """Round every computed number to twelve decimals."""
    if isinstance(value, dict):
        return {name: rounded(item) for name, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return round(float(value), 12) if isinstance(value, mp.mpf) else value


def main() -> None:
    """Rewrite the file."""
    file = json.loads(FILE.read_text())
    with mp.workdps(40):
        contents = {"paper": file["paper"], **rounded(figures(file))}
    lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in contents.items()]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
