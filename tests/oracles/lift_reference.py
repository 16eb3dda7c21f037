"""Generator of tests/reference/lift_acceptance.json, from the printed digits and from `tests.oracles.lift`.

Run ``python -m tests.oracles.lift_reference``. It takes about a minute and prints each number that changes. The
printed digits and the tolerances are constants of this module. All other numbers are computed and rounded to the
stored digits. Only `integration_error` is a comparison with `synthesis.scenes.lift`.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from synthesis.scenes.lift.optimum import Objective, Task
from synthesis.scenes.lift.pose import Cylinder, Design
from tests.oracles.lift import (
    DIGITS,
    Exact,
    Loops,
    closed_designs,
    integrate,
    integration_error,
    moments,
    pose,
    search,
)

FILE = Path(__file__).parents[1] / "reference" / "lift_acceptance.json"
CYLINDER = Cylinder(220.0, 100.0)
LENGTHS = {"initial": (300, 180, 240, 330, 480), "optimum": (351.9, 162.8, 351.9, 347.2, 535.8)}
DESIGNS = {name: Design(*map(float, lengths)) for name, lengths in LENGTHS.items()}
ARMS = {"200": 347.4, "210": 353.9, "220": 351.9, "230": 348.9, "240": 356.3, "250": 354.6}
PRINTED = {"200": 321.5, "210": 326.3, "220": 337.5, "230": 348.9, "240": 353.5, "250": 364.5}
PRINTED_BY_SPEED = {"70": 169.4, "80": 216.0, "90": 280.0, "110": 408.4, "120": 497.8}
START_TOLERANCES = {"initial": (1e-5, 1e-3, 0.05), "optimum": (1e-5, 1e-3, 1.0)}
START_DIGITS = {"initial": (6, 5, 3), "optimum": (6, 5, 2)}
OBJECTIVES = {
    "continuous": (Objective("continuous"), 4),
    "discrete": (Objective("discrete"), 3),
    "printed": (Objective("discrete", include_start=False), 3),
}
OPTIMA: list[dict[str, Any]] = [
    {"kind": "discrete", "n": 310, "bound": 600, "l2": 0.1, "l4": 0.1, "objective": (4, 1e-4, 1e-3)},
    {"kind": "discrete", "n": 310, "bound": 1000, "l2": 0.1, "l4": 0.1, "objective": (4, 1e-4, 1e-3)},
    {"kind": "continuous", "bound": 600, "l2": 0.01, "l4": 0.01, "b": 1e-3, "objective": (4, 1e-3, 1e-3)},
    {"kind": "continuous", "bound": 1000, "l2": 0.001, "l4": 0.001, "b": 0.01, "objective": (4, 1e-3, 1e-3)},
    {"kind": "printed", "n": 310, "bound": 600, "l2": 0.01, "l4": 0.01, "b": 1e-3, "objective": (3, 1e-3, 1e-3)},
    {"kind": "printed", "n": 310, "bound": 1000, "l2": 0.001, "l4": 0.1, "b": 0.01, "objective": (3, 1e-3, 1e-3)},
    {"kind": "discrete", "n": 100, "bound": 1000, "l2": 0.1, "l4": 0.1, "objective": (2, 0.01, 0.01)},
    {"kind": "discrete", "n": 1000, "bound": 1000, "l2": 0.1, "l4": 0.1, "objective": (2, 0.01, 0.01)},
]
"""Cases with the tolerance of each length, and the digits and the lower and upper tolerance of the objective."""


def task(objective: Objective, bound: float = 600.0, length: float = 220.0) -> Task:
    """Return the published problem with another objective, bound or cylinder."""
    return Task(replace(CYLINDER, length=length), 200.0, 510.0, objective, bound)


def motion(name: str, time: float) -> tuple[float, float, float]:
    """Return height, velocity and acceleration."""
    return Exact(DESIGNS[name]).motion(CYLINDER, CYLINDER.speed * time)


def duration(name: str) -> float:
    return (pose(DESIGNS[name], 0.0)["length"] - CYLINDER.length) / CYLINDER.speed


def link_angles(design: Design, turn: float) -> list[float]:
    """Return the directions of OB, BA, CA, BC and DC in (0, 2 pi), from the joints."""
    joints = pose(design, turn)
    a, b = complex(-design.b, joints["height"]), complex(joints["x"], joints["y"])
    c = a + design.l3 * complex(math.sin(turn), -math.cos(turn))
    directions = (b, a - b, a - c, c - b, c + design.b)
    return [math.atan2(direction.imag, direction.real) % (2 * math.pi) for direction in directions]


def condition(design: Design, turn: float) -> float:
    """Return the condition number of the Jacobian of the loops, with lengths in units of the top height."""
    scaled = Design(*(value / (design.l3 + design.l5) for value in design.as_tuple()))
    loops = Loops(scaled)
    loops.rates(link_angles(scaled, turn), pose(scaled, turn)["length"], 1.0)
    return float(np.linalg.cond(loops.matrix))


def assemblies(design: Design) -> list[float]:
    """Return the heights of all poses above ground at the shortest cylinder length, in descending order."""

    def excess(turn: float) -> float:
        return pose(design, turn)["length"] - CYLINDER.length

    turns = np.linspace(0, 2 * math.pi, 20_001)
    signs = np.array([excess(turn) < 0 for turn in turns])
    at = np.nonzero(signs[:-1] != signs[1:])[0]
    return sorted(
        (pose(design, brentq(excess, turns[k], turns[k + 1], xtol=1e-14))["height"] for k in at), reverse=True
    )


def dead_point_length(design: Design) -> float:
    """Return the smallest length of the cylinder on the branch of the rise."""
    exact = Exact(design)
    with mpmath.workdps(DIGITS):
        guess = float(exact.turn_at_length(CYLINDER.length))
        return float(exact.length(mpmath.findroot(lambda turn: mpmath.diff(exact.length, turn), guess + 0.05)))


def time_shares(design: Design) -> dict[str, float]:
    """Return the fractions of the rise in which the velocity, by differences, is close to 50 mm/s."""
    turns = np.linspace(float(Exact(design).turn_at_length(CYLINDER.length)), 0.0, 100_001)
    poses = [pose(design, turn) for turn in turns]
    times, heights = (np.diff([at[key] for at in poses]) for key in ("length", "height"))
    off = np.abs(CYLINDER.speed * heights / times - 50)
    return {str(width): round(float(np.sum(times[off <= width]) / np.sum(times)), 4) for width in (5, 10, 15)}


def closing(design: Design) -> dict[str, float]:
    """Return sa by (31), and l5 by the law of cosines (32) at the start of the stroke."""
    l2, l3, l4, _, b = design.as_tuple()
    sa = math.sqrt((CYLINDER.length + l2) ** 2 - b**2)
    start = math.atan2(b, 200) + math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    return {"sa": round(sa, 4), "l5": round(math.sqrt(l3**2 + 200**2 - 2 * 200 * l3 * math.cos(start)), 4)}


def optimum(row: dict[str, Any]) -> dict[str, Any]:
    """Compute a row of `optima`; each tolerance becomes [value, tolerance]."""
    objective = replace(OBJECTIVES[row["kind"]][0], n=row.get("n", 310))
    value, design = search(task(objective, float(row["bound"])), polish=True)
    result = dict(row)
    for name in {"l2", "l4", "b"} & set(row):
        result[name] = [round(float(getattr(design, name)), 3), row[name]]
    digits, *tolerances = row["objective"]
    return result | {"objective": [round(value, digits), *tolerances]}


def reference() -> dict[str, Any]:
    """Return the content of the file."""
    initial, best = DESIGNS["initial"], DESIGNS["optimum"]
    exact = Exact(initial)
    start_turn = float(exact.turn_at_length(CYLINDER.length))
    angles = link_angles(initial, start_turn)
    (projected,) = closed_designs(351.9, 351.9, task(Objective("discrete")))
    designs = {**DESIGNS, "projected": projected}
    starts = {
        name: {
            key: [round(value, digits), tolerance]
            for key, value, digits, tolerance in zip(
                ("height", "velocity", "acceleration"), motion(name, 0.0), START_DIGITS[name], START_TOLERANCES[name]
            )
        }
        for name in DESIGNS
    }
    ends = {
        name: {"time": [round(duration(name), 6), 1e-6], "length": [round(pose(design, 0.0)["length"], 6), 1e-5]}
        for name, design in DESIGNS.items()
    }
    top = pose(initial, 0.0)
    ends["initial"]["B"] = [round(top["x"], 6), round(top["y"], 6)]
    with mpmath.workdps(DIGITS):
        # at the top: ds/dT = 0, so that the acceleration is v_l^2 s'' / l1'^2
        top_acceleration = mpmath.diff(exact.height, 0, 2) * (CYLINDER.speed / mpmath.diff(exact.length, 0)) ** 2
    late = minimize_scalar(
        lambda time: -motion("optimum", time)[1], bounds=(0.5, 7.0), method="bounded", options={"xatol": 1e-6}
    )
    height, velocity, _ = motion("optimum", late.x)
    printed_arm = float(ARMS["220"])
    table_2 = {}
    for length in ARMS:
        problem = task(Objective("discrete"), length=float(length))
        (on_constraints,) = closed_designs(ARMS[length], ARMS[length], problem)
        table_2[length] = {
            "arm": ARMS[length],
            "printed": PRINTED[length],
            "projected": round(moments(on_constraints, problem)[0], 3),
            "optimum": round(search(problem, polish=True)[0], 3),
        }
    return {
        "designs": {name: list(lengths) for name, lengths in LENGTHS.items()},
        "cylinder": {"length": 220, "speed": 100},
        "projected": {
            "arms": [printed_arm, printed_arm],
            **{name: round(float(getattr(projected, name)), 4) for name in ("l3", "l5", "b")},
        },
        "start": starts,
        "angles_deg": [round(math.degrees(angle), 6) for angle in angles],
        "angular_velocities": [round(float(w), 6) for w in Loops(initial).rates(angles, 220.0, 100.0)[:5]],
        "end": ends,
        "height_at_time": {
            "initial": {str(time): round(motion("initial", time)[0], 6) for time in (1, 2, 3, 4, 5)},
            "optimum": {str(time): round(motion("optimum", time)[0], 6) for time in (1, 3, 5, 7)},
        },
        "velocity_at_time": {
            "initial": {str(time): round(motion("initial", time)[1], 6) for time in (0.1, 1, 3, 5)},
            "optimum": {str(time): round(motion("optimum", time)[1], 6) for time in (0.2, 1, 3, 5)},
        },
        "acceleration_at_time": {str(time): round(motion("initial", time)[2], 5) for time in (0.1, 1, 5)},
        "acceleration_at_top": round(float(top_acceleration), 5),
        "velocity_at_height": {
            str(s): round(float(CYLINDER.speed * exact.gain(exact.turn_at_height(s))), 6)
            for s in (250, 300, 400, 500)
        },
        "largest_late_velocity": {"velocity": round(velocity, 4), "height": round(height, 2)},
        "velocity_ratio": {
            str(time): round(motion("optimum", time)[1] / motion("initial", time)[1], 4)
            for time in (0, 0.05, 0.1, 0.2)
        },
        "time_share_about_50": time_shares(best),
        "dead_point_length": {name: round(dead_point_length(design), 5) for name, design in DESIGNS.items()},
        "condition": {
            name: {
                "start": round(condition(design, float(Exact(design).turn_at_length(CYLINDER.length))), 2),
                "top": round(condition(design, 0.0), 2),
            }
            for name, design in DESIGNS.items()
        },
        "assemblies": {name: [round(s, 4) for s in assemblies(design)] for name, design in DESIGNS.items()},
        "constraints": {"initial": closing(initial), "optimum": closing(best)},
        "objective": {
            kind: {
                name: round(moments(design, task(objective), 100_000)[0], digits) for name, design in designs.items()
            }
            for kind, (objective, digits) in OBJECTIVES.items()
        },
        "mean_velocity": {
            name: round(moments(design, task(Objective("continuous")), 100_000)[1], 5)
            for name, design in DESIGNS.items()
        },
        "table_2": table_2,
        "table_2_speeds": PRINTED_BY_SPEED,
        "objective_per_squared_speed": round(moments(projected, task(Objective("discrete")))[0] / 1e4, 10),
        "optima": [optimum(row) for row in OPTIMA],
        "integration_error": {
            f"{h:g}": float(f"{integration_error(initial, CYLINDER, *integrate(initial, CYLINDER, h))[0]:.1e}")
            for h in (1e-2, 1e-3)
        },
    }


def changes(old: Any, new: Any, path: str = "") -> list[str]:
    """List the differences between two contents."""
    if isinstance(old, dict) and isinstance(new, dict) and set(old) == set(new):
        return [line for key in old for line in changes(old[key], new[key], f"{path}/{key}")]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [line for k, pair in enumerate(zip(old, new)) for line in changes(*pair, f"{path}/{k}")]
    return [] if old == new else [f"{path}: {old} -> {new}"]


def layout(value: Any, indent: str = "") -> str:
    """Format JSON with line breaks where a line would be too long."""
    text = json.dumps(value)
    if len(indent) + len(text) <= 110 or not isinstance(value, dict | list):
        return text
    deeper = indent + "  "
    if isinstance(value, dict):
        parts, ends = [f"{json.dumps(key)}: {layout(part, deeper)}" for key, part in value.items()], "{}"
    else:
        parts, ends = [layout(part, deeper) for part in value], "[]"
    return f"{ends[0]}\n{deeper}" + f",\n{deeper}".join(parts) + f"\n{indent}{ends[1]}"


def main() -> None:
    """Write the file and print the differences from the previous one."""
    content = reference()
    print("\n".join(changes(json.loads(FILE.read_text()), content)) or "nothing changes")
    FILE.write_text(layout(content) + "\n")


if __name__ == "__main__":
    main()
