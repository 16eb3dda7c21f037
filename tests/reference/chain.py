"""Recomputes what it can of chain.json by the twins in `tests.oracles.chain`, without the code under test.

``python -m tests.reference.chain`` prints each number beside the copied one.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from tests.oracles import chain as oracle

PITCH, LINKS, R1, FREE = 131.0, 16, 181.78, 14
R0 = PITCH / math.sqrt(2)
COPIED = json.loads(Path(__file__).with_suffix(".json").read_text())


class Layout:
    """A crescent and its free pin, by search along the path; angles of P1 in degrees."""

    def __init__(self, r0: float, r2: float, b: float) -> None:
        self.path, self.r0 = oracle.crescent(r0, R1, r2, b), r0
        self.period = 2 * math.degrees(math.asin(PITCH / (2 * r0)))

    def way(self, degrees: float) -> float:
        return math.radians(degrees) * self.r0

    def free_pin(self, degrees: float) -> complex:
        shift = int(self.way(degrees) > self.path.ends[0])  # then P1's place is taken by the link behind it
        s = self.way(degrees - shift * self.period)
        return complex(*oracle.free_pin(self.path, PITCH, LINKS, FREE + shift, s, np.zeros(2)))

    def neighbours_apart(self, degrees: float) -> float:
        """theta13 - theta15, radians."""
        shift = int(self.way(degrees) > self.path.ends[0])
        s = self.way(degrees - shift * self.period)
        before = complex(*self.path.point(self.path.after(s, PITCH, FREE + shift - 2)))
        after = complex(*self.path.point(self.path.after(s, PITCH, LINKS - FREE - shift, -1)))
        return float(np.angle(before / after))

    def defect(self, degrees: float) -> float:
        return math.degrees(4 * math.asin(PITCH / (2 * R1)) - self.neighbours_apart(degrees))

    def depth(self, degrees: float) -> float:
        return abs(self.free_pin(degrees)) - R1

    def passes(self, pin: int, joint: int) -> float:
        """Angle of P1 at which a pin passes the end of a segment (-1: the joint at the path's start)."""
        s = float(self.path.ends[joint])
        if pin > FREE:
            return math.degrees(self.path.after(s, PITCH, LINKS + 1 - pin) - self.path.total) / self.r0
        return math.degrees(self.path.after(s, PITCH, pin - 1, -1)) / self.r0


def largest(function, low: float, high: float) -> tuple[float, float]:
    """Place and value of the largest value of a smooth function with one peak, by a parabola through a fine grid."""
    for _ in range(3):
        x = np.linspace(low, high, 41)
        y = np.array([function(value) for value in x])
        at = int(np.clip(np.argmax(y), 1, 39))
        low, high = x[at - 1], x[at + 1]
    bend = y[at - 1] - 2 * y[at] + y[at + 1]
    share = 0.5 * (y[at - 1] - y[at + 1]) / bend if bend else 0.0
    return float(x[at] + share * (x[1] - x[0])), float(y[at])


def critical_lower_radius() -> float:
    """The state in which links P6P7 and P14P15 are centred on the axis: f(7 dd/2) - pi/2 = g(3 du/2)."""

    def excess(r2: float) -> float:
        relations = oracle.Transfer(PITCH, R0, R1, r2)
        xi = math.acos((R1 + R0) / (r2 - R0))
        wheel = math.pi + xi - relations.f(math.pi / 2 - xi - 3.5 * relations.dd)
        return wheel - math.pi / 2 - relations.g(math.pi / 2 - 1.5 * relations.du)

    return brentq(excess, 381.0, 382.0, xtol=1e-12)


def recomputed() -> dict[str, dict]:
    """The numbers by section and name, as chain.json has them."""
    r2 = critical_lower_radius()
    relations = oracle.Transfer(PITCH, R0, R1, r2)
    start = math.degrees(relations.g(math.pi / 2 - 1.5 * relations.du))
    b = math.sqrt((r2 - R0) ** 2 - (R1 + R0) ** 2)
    ours = Layout(R0, r2, b)
    samples = [ours.free_pin(start + degrees) for degrees in COPIED["canonical"]["samples_deg"]]
    at, defect = largest(ours.defect, 60.0, 95.0)
    ends = [ours.free_pin(start), ours.free_pin(start + 90)]
    canonical = {
        "delta_upper_deg": math.degrees(relations.du),
        "lower_radius": r2,
        "eccentricity": b,
        "xi_deg": math.degrees(math.acos((R1 + R0) / (r2 - R0))),
        "phase_start_deg": start,
        "events_deg": [ours.passes(pin, joint) for pin, joint in ((10, 1), (12, 2), (16, -1), (2, 0))],
        "defect_max_deg": defect,
        "defect_max_theta1_deg": at,
        "slack_max": math.radians(defect) * R1,
        "depth_max": largest(ours.depth, 60.0, 95.0)[1],
        "y_min": -largest(lambda degrees: -ours.free_pin(degrees).imag, 60.0, 95.0)[1],
        "ends": [[end.real, end.imag] for end in ends],
        "x": [point.real for point in samples],
        "y": [point.imag for point in samples],
        "end_step_at_other_starts_deg": {
            start: ours.depth(float(start)) for start in COPIED["canonical"]["end_step_at_other_starts_deg"]
        },
    }
    sizes = (COPIED["published"][name] for name in ("wheel_radius", "lower_radius", "eccentricity"))
    r0, r2, b = sizes
    printed = Layout(r0, r2, b)
    least, _ = largest(lambda degrees: -printed.defect(degrees), 15.0, 22.0)
    as_printed = {
        "tangency_residual": math.hypot(R1 + r0, b) - (r2 - r0),
        "delta_lower_deg": 2 * math.degrees(math.asin(PITCH / (2 * r2))),
        "defect_max_deg": largest(printed.defect, 60.0, 95.0)[1],
        "defect_min_deg": printed.defect(least),
        "depth_max": largest(printed.depth, 60.0, 95.0)[1],
        "end_step": printed.depth(least),
    }
    return {"canonical": canonical, "as_printed": as_printed}


if __name__ == "__main__":
    for section, values in recomputed().items():
        for name, value in values.items():
            print(f"{section}.{name}\n  copied     {COPIED[section][name]}\n  recomputed {value}")
