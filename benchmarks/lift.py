"""Figures of the lift: accuracy and run time of the closed form, and the optima beside the published designs.

Run ``python -m benchmarks.lift`` to write ``benchmarks/results/lift.json``, the pictures ``docs/img/lift_*.png`` and
the numbers of ``docs/lift.md``. All searches are deterministic; only run times differ between runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import lift_pictures as pictures
from benchmarks import report
from benchmarks.lift_pictures import ARMS, CYLINDER, DESIGNS, POSES, REFERENCE, STROKE, on_constraints, task
from benchmarks.report import Times, ends, percent, repeat
from synthesis.scenes.lift.constrained import optimize, source_limits
from synthesis.scenes.lift.motion import acceleration, angular_velocities, link_angles, motion, stroke, velocity
from synthesis.scenes.lift.optimum import Evaluator, Objective, Optimum, Task, optimum_motion
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    dead_point,
    design_constants,
    pose_at_height,
    pose_at_turn,
    third_side,
    turn_at_length,
)
from tests.oracles import lift as oracle

ROUNDINGS = 5_000
"""Number of random roundings of the published design."""
FITTED_LENGTHS = (250.0,)
"""Cylinder lengths with an incompletely printed arm. Two digits are lost; (31) gives them from the printed b."""
SLOPE_STEP = 1e-4
"""Relative step of l2 for the slope along l4 = l2."""
EVEN = 310
"""Number n of height steps in the comparisons, with heights 1 mm apart."""


# -- fixed steps ---------------------------------------------------------------------------------------------


def equation_of(loops: oracle.Loops, cylinder: Cylinder):
    """Return (14) as y' = f(t, y) with y = (theta1..5, s, omega1..5, v_s), for a step-by-step simulation."""

    def derivative(t, y):
        l1 = cylinder.length + cylinder.speed * t + 0.5 * cylinder.acceleration * t * t
        vl = cylinder.speed + cylinder.acceleration * t
        change = loops.accelerations(y[:5].tolist(), y[6:11].tolist(), l1, vl, cylinder.acceleration)
        return np.concatenate([y[6:], change])

    return derivative


def start_state(design: Design, cylinder: Cylinder):
    """Return the exact initial state of `equation_of`."""
    start = motion(design, cylinder, [0.0])
    rates = angular_velocities(start.pose, start.cylinder_speed)[0]
    return np.concatenate([link_angles(start.pose)[0], start.pose.height, rates, start.velocity])


def euler_step(f, t, y, h):
    """Make a step of the explicit Euler method."""
    return y + h * f(t, y)


def rk4_step(f, t, y, h):
    """Make a step of the classical Runge-Kutta method."""
    a = f(t, y)
    b = f(t + 0.5 * h, y + 0.5 * h * a)
    c = f(t + 0.5 * h, y + 0.5 * h * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(t + h, y + h * c))


def integrate(design: Design, cylinder: Cylinder, step: float, rule=rk4_step):
    """Integrate (14) with fixed steps up to the last whole step before the top, and return times and states.

    If the integration diverges (a singular matrix, or a state that is not finite), it ends early with a state of NaN.
    """
    duration = float(motion(design, cylinder, [0.0]).stroke.duration)
    f, y = equation_of(oracle.Loops(design), cylinder), start_state(design, cylinder)
    states = [y]
    with np.errstate(all="ignore"):
        for k in range(int(duration / step)):
            try:
                y = rule(f, k * step, y, step)
            except (np.linalg.LinAlgError, OverflowError, ValueError):
                y = np.full(y.shape, np.nan)
            if not np.all(np.isfinite(y)):
                states.append(np.full(y.shape, np.nan))
                break
            states.append(y)
    return step * np.arange(len(states)), np.array(states)


def integration_error(design: Design, cylinder: Cylinder, times, states) -> tuple[float, float]:
    """Return the largest error of the height and the largest loop residual; NaN if the integration diverged."""
    if not np.all(np.isfinite(states)):
        return math.nan, math.nan
    length = cylinder.length + cylinder.speed * times + 0.5 * cylinder.acceleration * times**2
    height = pose_at_turn(design, turn_at_length(design, length)).height
    residuals = oracle.loop_residuals(design, states[:, :5], length, states[:, 5])
    return float(np.max(np.abs(states[:, 5] - height))), float(np.max(np.abs(residuals)))


def arccos_gain(design: Design, height: float) -> float:
    """Return v_s / v_l, with the direction of AC from a plain arccos of the height."""
    l2, l3, l4, l5, b = design.as_tuple()
    turn = math.acos(min(1.0, max(-1.0, (l3**2 + height**2 - l5**2) / (2 * l3 * height))))
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    r = math.sqrt(l5**2 - (l3 * math.sin(turn)) ** 2)
    s1 = -l3 * l3 * math.sin(turn) * math.cos(turn) / r - l3 * math.sin(turn)
    x, y = l2 * math.sin(turn - gamma) - b, height - l2 * math.cos(turn - gamma)
    rate = x * l2 * math.cos(turn - gamma) + y * (s1 + l2 * math.sin(turn - gamma))
    return s1 * math.hypot(x, y) / rate


def integrate_adaptively(design: Design, method: str, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Integrate (14) with adaptive steps and return times and states."""
    equation, start = equation_of(oracle.Loops(design), CYLINDER), start_state(design, CYLINDER)
    even = np.linspace(0.0, float(stroke(design, CYLINDER).duration), 573)
    options = {"rtol": tolerance, "atol": 1e-3 * tolerance, "t_eval": even}
    solved = solve_ivp(equation, even[[0, -1]], start, method=method, **options)
    return solved.t, solved.y.T


def measure_integration() -> Iterator[dict[str, Any]]:
    """Measure error and run time of fixed and adaptive steps, and the run time of the closed form at the same times."""
    fixed = {"Euler": (euler_step, (1e-2, 1e-3, 1e-4)), "RK4": (rk4_step, (1e-2, 5e-3, 2e-3, 1e-3, 1e-4))}
    cases: list[tuple] = [
        (name, f"h = {h:g} s", integrate, CYLINDER, h, rule) for name, (rule, steps) in fixed.items() for h in steps
    ]
    adaptives = (("RK45", 1e-3), ("RK45", 1e-6), ("DOP853", 1e-10))
    cases += [(method, f"rtol = {rtol:g}", integrate_adaptively, method, rtol) for method, rtol in adaptives]
    for (name, design), (method, setting, run, *options) in product(DESIGNS.items(), cases):
        clock, first = Times(), Times()
        times, states = first.run(run, design, *options)  # warm-up run, which is not counted
        for _ in range(5 if first.wall[0] < 0.5 else 2):
            clock.run(run, design, *options)
        error, residual = integration_error(design, CYLINDER, times, states)
        reached = times[times <= stroke(design, CYLINDER).duration]
        closed = repeat(partial(motion, design, CYLINDER, reached)).minimum.processor
        seconds, diverged = clock.minimum.processor, np.isnan(error)
        row = {"design": name, "method": method, "setting": setting, "times": len(reached), "seconds": seconds}
        row |= {"height_error": None if diverged else error, "loop_residual": None if diverged else residual}
        yield {**row, "ratio": seconds / closed, "stopped_at": times[-1] if diverged else None}


def closed_form_rates(design: Design, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity and acceleration by the closed form."""
    pose = pose_at_turn(design, turns)
    return velocity(pose, CYLINDER.speed), acceleration(pose, CYLINDER.speed, 0.0)


def measure_closed_form() -> Iterator[dict[str, Any]]:
    """Measure run time and error of the closed form, from the turn and from the time."""
    for name, design in DESIGNS.items():
        trajectory = motion(design, CYLINDER, samples=POSES)
        turns, exact = np.linspace(float(trajectory.stroke.turn_bottom), 0.0, POSES), oracle.Exact(design)
        samples = zip(trajectory.cylinder_length[::1144].tolist(), trajectory.pose.height[::1144].tolist())
        error = max(abs(float(exact.height_at_length(length) - height)) for length, height in samples)
        row = {"design": name, "largest_residual": oracle.largest_residual(trajectory), "height_error": error}
        row["by_turn_ms"] = 1e3 * repeat(partial(closed_form_rates, design, turns)).minimum.processor
        row["from_time_ms"] = 1e3 * repeat(partial(motion, design, CYLINDER, samples=POSES)).minimum.processor
        yield row


def measure_published() -> dict:
    """Compute f of the published design with lengths changed by up to 0.05 mm, and on the constraints with both sums."""
    spread = np.random.default_rng(7).uniform(-0.05, 0.05, (5, ROUNDINGS))
    designs = Design(*(value + spread[k] for k, value in enumerate(DESIGNS["published"].as_tuple())))
    values = Evaluator(task(Objective("discrete")))(designs)
    values = values[np.isfinite(values)]
    tasks = {"f": task(Objective("discrete")), "f_as_printed": task(Objective("discrete", include_start=False))}
    sums = {name: Evaluator(problem)(on_constraints(problem)) for name, problem in tasks.items()}
    initial = DESIGNS["initial"]
    theta = np.arctan2(initial.b, STROKE[0]) + float(design_constants(initial).gamma)
    closed_l5 = float(third_side(initial.l3, STROKE[0], theta))
    found = {"samples": ROUNDINGS, "least": values.min(), "most": values.max(), **sums}
    return {**found, "closed_l5_of_initial": closed_l5}


def measure_steps() -> dict[str, Any]:
    """Compare the five printed f with the model for several n, and find the n at which each printed arm is optimal.

    The values on the constraints are fitted by least squares over n. An arm is optimal if f along l2 = l4 is
    stationary.
    """
    arms = {length: arm for length, arm in ARMS.items() if length not in FITTED_LENGTHS}
    printed = np.array([REFERENCE["table_2"][f"{length:g}"]["printed"] for length in arms])

    def f(n: int, length: float, stretch: float = 1.0) -> float:
        problem = task(Objective("discrete", n), cylinder=Cylinder(length, CYLINDER.speed))
        return float(Evaluator(problem)(on_constraints(problem, stretch)))

    def slope(n: int, length: float) -> float:
        return f(n, length, 1 + SLOPE_STEP) - f(n, length, 1 - SLOPE_STEP)

    misses = {n: np.array([f(n, length) for length in arms]) - printed for n in range(290, 341)}
    rms = {n: float(np.sqrt(np.mean(miss**2))) for n, miss in misses.items()}
    best = min(rms, key=lambda n: rms[n])
    stationary = [min(range(100, 341), key=lambda n: abs(slope(n, length))) for length in arms]
    found = {"fitted": best, "rms_fitted": rms[best], "even": EVEN, "rms_even": rms[EVEN]}
    return found | {"most_even": float(np.max(np.abs(misses[EVEN]) / printed)), "stationary": stationary}


def relative_error(value: float, exact: Any) -> float:
    """Return the relative error of a number; the difference from the exact value is formed before it is rounded."""
    return float(abs(value - exact) / abs(exact))


def measure_stability() -> dict[str, list[dict]]:
    """Compute speed and relative errors near the dead point and near the top, for both designs."""
    found: dict[str, list[dict]] = {"dead_point": [], "top": []}
    for name, design in DESIGNS.items():
        exact, dead = oracle.Exact(design), float(dead_point(design))
        for end, distances in (("dead_point", (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)), ("top", (1e-1, 1e-2, 1e-4, 1e-6))):
            for distance in distances:
                turn = dead - distance if end == "dead_point" else distance
                pose = pose_at_turn(design, turn)
                height, gain = float(pose.height), exact.gain(turn)
                row = {
                    "design": name,
                    "distance": distance,
                    "speed": 100 * float(pose.gain),
                    "relative_error": relative_error(float(pose.gain), gain),
                }
                if end == "dead_point":
                    row["turn_from_length_error"] = abs(float(turn_at_length(design, float(pose.length))) - turn)
                else:
                    gain = exact.gain(exact.turn_at_height(height))
                    gains = {
                        "from_height_error": float(pose_at_height(design, height).gain),
                        "arccos_error": arccos_gain(design, height),
                    }
                    row |= {key: relative_error(value, gain) for key, value in gains.items()}
                    row["below_top"] = float(design.l3 + design.l5 - height)
                found[end].append(row)
    return found


def optimum_row(problem: Task, optimum: Optimum) -> dict[str, Any]:
    """Return an optimum with f of the published design on the same constraints."""
    row = {
        "design": optimum.design.as_dict(),
        "f": optimum.objective,
        "duration": optimum_motion(optimum, problem).rise_time,
    }
    published = float(Evaluator(problem)(on_constraints(problem)))
    return row | {"f_of_published": published, "active": optimum.active}


def measure_table_2() -> Iterator[dict[str, Any]]:
    """Compare table 2 as printed and projected with our optimum."""
    by_speed, by_length = REFERENCE["table_2_speeds"], REFERENCE["table_2"]
    cylinders = {Cylinder(CYLINDER.length, float(speed)): value for speed, value in by_speed.items()}
    cylinders |= {Cylinder(float(length), CYLINDER.speed): row["printed"] for length, row in by_length.items()}
    tasks = [task(Objective("discrete"), cylinder=cylinder) for cylinder in cylinders]
    for problem, value in zip(tasks, cylinders.values()):
        optimum = optimize(problem, source_limits(problem))
        length, speed = problem.cylinder.length, problem.cylinder.speed
        printed = {"length": length, "speed": speed, "printed_l2": ARMS[length], "printed_f": value}
        yield printed | optimum_row(problem, optimum)


def measure_optima() -> Iterator[dict[str, Any]]:
    """Find the optima of all objectives for several bounds, with their search time."""
    cases = [("discrete", n, bound) for n, bound in ((310, 600.0), (31, 1e3), (100, 1e3), (1000, 1e3))]
    cases += [("as printed", 310, bound) for bound in (600.0, 1e3)]
    cases += [("continuous", None, bound) for bound in (600.0, 1e3, 4e3)]
    cases += [("normalized", None, bound) for bound in (600.0, 4e3)]
    for kind, n, bound in cases:
        objective = Objective(kind) if n is None else Objective("discrete", n, kind == "discrete")
        times, problem = Times(), task(objective, bound)
        optimum = times.run(optimize, problem, source_limits(problem))
        case = {"kind": kind, "n": n, "bound": bound, "seconds": times.processor[0]}
        yield case | optimum_row(problem, optimum)


def measure_designs(optimum: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Compute the motions of the three designs."""
    for name, design in {**DESIGNS, "optimum": Design(**optimum)}.items():
        trajectory = motion(design, CYLINDER, samples=100_001)
        limits, start = trajectory.stroke, float(trajectory.cylinder_length[0])
        yield (
            {
                "design": name,
                "lengths": design.as_dict(),
                "duration": float(limits.duration),
                "height": float(limits.height_bottom),
                "velocity": float(trajectory.velocity[0]),
                "acceleration": float(trajectory.acceleration[0]),
                "early_velocity": float(motion(design, CYLINDER, [0.05]).velocity[0]),
                "above_dead_point": start - float(limits.length_dead),
                "extension": float(limits.length_top) / start,
                "lowest_b": float(np.min(trajectory.pose.y)),
                "share_within": {str(w): float(np.mean(np.abs(trajectory.velocity - 50) <= w)) for w in (5, 10)},
            }
        )


DESIGN_ROWS = {
    "l2, l3, l4, l5, b": "{l2:.1f}, {l3:.1f}, {l4:.1f}, {l5:.1f}, {b:.1f}",
    "rise time (s)": "{duration:.3f}",
    "v at t = 0 (mm/s)": "{velocity:.1f}",
    "a at t = 0 (mm/s²)": "{acceleration:,.0f}",
    "cylinder length from the dead point to the start (mm)": "{above_dead_point:.2f}",
    "cylinder length at the top / at the start": "{extension:.1f}",
    "lowest position of B above the pivots (mm)": "{lowest_b:.1f}",
}


def blocks(results: dict) -> dict[str, str]:
    """Return the text of each marker in docs/lift.md."""
    designs, optima, digits = results["designs"], results["optima"], results["published"]
    integration, table_2 = results["integration"], results["table_2"]
    initial, published, _ = designs
    rows = {
        **results,
        "table_2": [
            {**row, "arm": f"{row['printed_l2']:g}{mark}", "value": f"{row['printed_f']:g}{mark}"}
            for row in table_2
            if row["speed"] == CYLINDER.speed  # at other speeds f is proportional to the square of the speed
            # two digits of the fitted row are lost in print: the arm follows from (31) and f from the model
            for mark in (" (fitted)" if row["length"] in FITTED_LENGTHS else "",)
        ],
        "designs": [
            {"what": what, **{row["design"]: cell.format(**row, **row["lengths"]) for row in designs}}
            for what, cell in DESIGN_ROWS.items()
        ],
    }

    def change(key: str) -> str:
        return f"{100 * (published[key] / initial[key] - 1):+.0f} %".replace("-", "−")

    # the same design is printed for six speeds
    scaled = [row["printed_f"] / row["speed"] ** 2 for row in table_2 if row["length"] == CYLINDER.length]
    normalized = [row for row in optima if row["kind"] == "normalized"]
    finest = [row for row in integration if (row["method"], row["setting"]) == ("RK4", "h = 0.0001 s")]
    steps = results["steps"]
    shares = [f"{percent(share, 3)} within ±{width}" for width, share in published["share_within"].items()]
    words = {
        "rounding": f"{digits['least']:.0f} to {digits['most']:.0f} in {digits['samples']:,} random roundings",
        "lost": f"{ends([100 * (1 - row['f'] / row['f_of_published']) for row in table_2])} %",
        "steps": f"n = {steps['fitted']} (rms {steps['rms_fitted']:.2f})",
        "steps_even": f"{steps['rms_even']:.2f}, at most {percent(steps['most_even'])}",
        "speed_violation": percent(max(scaled) / min(scaled) - 1),
        "normalized_lost": percent(1 - normalized[0]["f"] / normalized[0]["f_of_published"]),
        "printed_sum": f"{digits['f_as_printed']:.0f}",
        "initial_start": f"s(0) = {initial['height']:.4f}, v(0) = {initial['velocity']:.1f}",
        "closed_l5": f"{digits['closed_l5_of_initial']:.2f}",
        "velocity_change": change("velocity"),
        "early_velocity_change": change("early_velocity"),
        "even_shares": ", ".join(shares),
        "finest_error": f"{finest[0]['height_error']:.0e} mm",
        "finest_ratio": f"{finest[0]['ratio']:.0f}",
        "finest_published": f"{finest[1]['height_error']:.0e} mm",
        "height_error": f"{max(row['height_error'] for row in results['closed_form']):.0e} mm",
        "dead_point_error": f"{max(row['relative_error'] for row in results['stability']['dead_point']):.0e}",
    }
    return report.tables("lift", rows) | words


draw = pictures.draw


def measure() -> Iterator[dict[str, Any]]:
    """Run all measurements."""
    optima = list(measure_optima())
    yield {
        "integration": list(measure_integration()),
        "closed_form": list(measure_closed_form()),
        "published": measure_published(),
        "steps": measure_steps(),
        "stability": measure_stability(),
        "table_2": list(measure_table_2()),
        "optima": optima,
        "designs": list(measure_designs(optima[0]["design"])),
    }


if __name__ == "__main__":
    report.run(measure)
