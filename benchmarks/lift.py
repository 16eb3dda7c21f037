"""The lift's figures: tables and pictures of docs/lift.md, and the integration that the closed form replaces.

Run ``python -m benchmarks.lift``; it writes ``benchmarks/results/lift.json``, the pictures ``docs/img/lift_*.png``
and the tables between the markers of ``docs/lift.md``. All searches are deterministic; only run times differ.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from synthesis.lift.loops import (
    angular_velocities,
    condition,
    largest_residual,
    link_angles,
    loop_residuals,
    velocity_by_instant_centre,
)
from synthesis.lift.motion import acceleration, motion, velocity
from synthesis.lift.objective import Evaluator, Objective, Task, project
from synthesis.lift.optimum import optimize, optimize_batch
from synthesis.lift.pose import Cylinder, Design, dead_point, pose_at_height, pose_at_turn, turn_at_length
from synthesis.lift.published import published_for

INITIAL = Design(300.0, 180.0, 240.0, 330.0, 480.0)
OPTIMUM = Design(351.9, 162.8, 351.9, 347.2, 535.8)
CYLINDER = Cylinder(220.0, 100.0)


def acceleration_equation(design: Design, cylinder: Cylinder) -> Callable[[float, np.ndarray], np.ndarray]:
    """The system (14) as y' = f(t, y), y = (theta1..5, s, omega1..5, v_s): what a stepwise simulation integrates."""
    l2, l3, l4, l5, _ = design.as_tuple()
    matrix, right = np.zeros((6, 6)), np.zeros(6)
    matrix[1, 5] = matrix[3, 5] = -1.0

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        angles, w = y[:5].tolist(), y[6:11].tolist()
        (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5) = map(math.cos, angles), map(math.sin, angles)
        l1 = cylinder.length + cylinder.speed * t + 0.5 * cylinder.acceleration * t * t
        vl, al = cylinder.speed + cylinder.acceleration * t, cylinder.acceleration
        matrix[0, 0] = matrix[4, 0] = -l1 * s1
        matrix[1, 0] = matrix[5, 0] = l1 * c1
        matrix[0, 1], matrix[1, 1] = -l2 * s2, l2 * c2
        matrix[2, 2], matrix[3, 2] = -l3 * s3, l3 * c3
        matrix[4, 3], matrix[5, 3] = -l4 * s4, l4 * c4
        matrix[2, 4], matrix[3, 4] = -l5 * s5, l5 * c5
        matrix[4, 4], matrix[5, 4] = l5 * s5, -l5 * c5
        x = -al * c1 + 2 * w[0] * vl * s1 + w[0] * w[0] * l1 * c1
        z = -al * s1 - 2 * w[0] * vl * c1 + w[0] * w[0] * l1 * s1
        w2, w3, w4, w5 = (rate * rate for rate in w[1:])
        right[:] = (
            x + w2 * l2 * c2,
            z + w2 * l2 * s2,
            w3 * l3 * c3 + w5 * l5 * c5,
            w3 * l3 * s3 + w5 * l5 * s5,
            x + w4 * l4 * c4 - w5 * l5 * c5,
            z + w4 * l4 * s4 - w5 * l5 * s5,
        )
        return np.concatenate([y[6:], np.linalg.solve(matrix, right)])

    return rates


def start_state(design: Design, cylinder: Cylinder) -> np.ndarray:
    """The exact first state of `acceleration_equation`."""
    start = motion(design, cylinder, [0.0])
    return np.concatenate(
        [
            link_angles(design, start.pose)[0],
            start.pose.height,
            angular_velocities(design, start.pose, start.cylinder_speed)[0],
            start.velocity,
        ]
    )


def euler_step(f: Callable, t: float, y: np.ndarray, h: float) -> np.ndarray:
    """One step of Euler's rule."""
    return y + h * f(t, y)


def rk4_step(f: Callable, t: float, y: np.ndarray, h: float) -> np.ndarray:
    """One step of the classical Runge-Kutta rule."""
    a = f(t, y)
    b = f(t + 0.5 * h, y + 0.5 * h * a)
    c = f(t + 0.5 * h, y + 0.5 * h * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(t + h, y + h * c))


def integrate(
    design: Design, cylinder: Cylinder, step: float, rule: Callable = rk4_step
) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a fixed-step integration of (14) to the last whole step before the top.

    Ends early, with a last state of NaN, when it has diverged (a singular matrix, or no finite state).
    """
    duration = float(motion(design, cylinder, [0.0]).stroke.duration)
    f = acceleration_equation(design, cylinder)
    y, states, times = start_state(design, cylinder), [], []
    with np.errstate(all="ignore"):
        for k in range(int(duration / step) + 1):
            times.append(k * step)
            states.append(y)
            try:
                y = rule(f, k * step, y, step)
            except (np.linalg.LinAlgError, OverflowError, ValueError):
                y = np.full(y.shape, np.nan)
            if not np.all(np.isfinite(y)):
                times.append((k + 1) * step)
                states.append(np.full(y.shape, np.nan))
                break
    return np.array(times), np.array(states)


def integration_error(
    design: Design, cylinder: Cylinder, times: np.ndarray, states: np.ndarray
) -> tuple[float, float]:
    """Largest error of the height against the closed form, and largest loop residual; NaN where it diverged."""
    if not np.all(np.isfinite(states)):
        return math.nan, math.nan
    length = cylinder.length + cylinder.speed * times + 0.5 * cylinder.acceleration * times**2
    height = pose_at_turn(design, turn_at_length(design, length)).height
    residuals = loop_residuals(design, states[:, :5], length, states[:, 5])
    return float(np.max(np.abs(states[:, 5] - height))), float(np.max(np.abs(residuals)))


# -- measurements --------------------------------------------------------------------------------------------

ROOT = Path(__file__).parents[1]
REPEATS = 5


def best_seconds(function: Callable[[], object], repeats: int = REPEATS) -> float:
    """The least wall time of a few runs."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def timed(function: Callable[[], object]) -> tuple[object, float]:
    """A result and its wall time; the least of a few runs where one is short."""
    start = time.perf_counter()
    result = function()
    seconds = time.perf_counter() - start
    return result, seconds if seconds > 0.5 else min(seconds, best_seconds(function))


def measure_integration() -> list[dict]:
    """Error against run time: fixed and adaptive steps, each beside the closed form at the same times."""
    from scipy.integrate import solve_ivp

    rows = []
    for name, design in (("initial", INITIAL), ("published", OPTIMUM)):
        duration = float(motion(design, CYLINDER, [0.0]).stroke.duration)

        def record(method, setting, seconds, times, states, name=name, design=design):
            error, residual = integration_error(design, CYLINDER, times, states)
            closed = best_seconds(lambda: motion(design, CYLINDER, times).pose.height)
            rows.append(
                {
                    "design": name,
                    "method": method,
                    "setting": setting,
                    "times": len(times),
                    "height_error": None if math.isnan(error) else error,
                    "loop_residual": None if math.isnan(residual) else residual,
                    "seconds": seconds,
                    "closed_form_seconds": closed,
                    "ratio": seconds / closed,
                    "stopped_at": None if not math.isnan(error) else float(times[-1]),
                }
            )

        for method, rule, steps in (
            ("Euler", euler_step, (1e-2, 1e-3, 1e-4)),
            ("RK4", rk4_step, (1e-2, 5e-3, 2e-3, 1e-3, 1e-4)),
        ):
            for step in steps:
                (times, states), seconds = timed(
                    lambda step=step, rule=rule, design=design: integrate(design, CYLINDER, step, rule)
                )
                known = times if np.all(np.isfinite(states)) else times[times <= duration]
                record(method, f"h = {step:g} s", seconds, known, states)
        for method, tolerance in (("RK45", 1e-3), ("RK45", 1e-6), ("DOP853", 1e-10)):
            solved, seconds = timed(
                lambda method=method, tolerance=tolerance, design=design, duration=duration: solve_ivp(
                    acceleration_equation(design, CYLINDER),
                    (0.0, duration),
                    start_state(design, CYLINDER),
                    method=method,
                    rtol=tolerance,
                    atol=1e-3 * tolerance,
                    t_eval=np.linspace(0.0, duration, 573),
                )
            )
            record(method, f"rtol = {tolerance:g}", seconds, solved.t, solved.y.T)
    return rows


def measure_closed_form() -> list[dict]:
    """Run time and own error of the closed form: by turn, and from time through the scalar Newton iteration."""
    rows = []
    for name, design in (("initial", INITIAL), ("published", OPTIMUM)):
        limits = motion(design, CYLINDER, [0.0]).stroke
        times = np.linspace(0.0, float(limits.duration), 57_201)
        turns = np.linspace(float(limits.turn_bottom), 0.0, 57_201)

        def by_turn(design=design, turns=turns):
            pose = pose_at_turn(design, turns)
            return velocity(pose, 100.0), acceleration(pose, 100.0, 0.0)

        moved = motion(design, CYLINDER, times)
        rows.append(
            {
                "design": name,
                "poses": times.size,
                "by_turn_seconds": best_seconds(by_turn),
                "from_time_seconds": best_seconds(
                    lambda design=design, times=times: motion(design, CYLINDER, times, limits=None)
                ),
                "largest_residual": largest_residual(moved),
                "height_error": max(
                    abs(float(exact_height(design, length) - height))
                    for length, height in zip(moved.cylinder_length[::1144], moved.pose.height[::1144].tolist())
                ),
            }
        )
    return rows


def exact_height(design: Design, length: float) -> object:
    """The height of the platform at a cylinder length in 60 digits."""
    import mpmath

    with mpmath.workdps(60):
        l2, l3, l4, l5, b = (mpmath.mpf(value) for value in design.as_tuple())
        gamma = mpmath.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))

        def height(turn):
            return mpmath.sqrt(l5**2 - (l3 * mpmath.sin(turn)) ** 2) + l3 * mpmath.cos(turn)

        def excess(turn):
            x, y = l2 * mpmath.sin(turn - gamma) - b, height(turn) - l2 * mpmath.cos(turn - gamma)
            return mpmath.sqrt(x * x + y * y) - mpmath.mpf(length)

        return height(mpmath.findroot(excess, float(turn_at_length(design, length))))


def measure_rounding() -> dict:
    """What the last printed digit is worth: f of the published design with its lengths moved within +-0.05 mm."""
    rng = np.random.default_rng(7)
    spread = rng.uniform(-0.05, 0.05, (5, 5000))
    designs = Design(*(value + spread[k] for k, value in enumerate(OPTIMUM.as_tuple())))
    values = Evaluator(Task(CYLINDER, 200.0, 510.0, Objective("discrete"), 600.0))(designs)
    return {
        "samples": values.size,
        "least": float(np.min(values)),
        "most": float(np.max(values[np.isfinite(values)])),
    }


def exact_speed(design: Design, turn: object) -> object:
    """ds/dl1 at a turn in 60 digits."""
    import mpmath

    l2, l3, l4, l5, b = (mpmath.mpf(value) for value in design.as_tuple())
    gamma = mpmath.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    turn = mpmath.mpf(turn)
    r = mpmath.sqrt(l5**2 - (l3 * mpmath.sin(turn)) ** 2)
    s = r + l3 * mpmath.cos(turn)
    s1 = -l3 * mpmath.sin(turn) * s / r
    x, y = l2 * mpmath.sin(turn - gamma) - b, s - l2 * mpmath.cos(turn - gamma)
    rate = x * l2 * mpmath.cos(turn - gamma) + y * (s1 + l2 * mpmath.sin(turn - gamma))
    return s1 * mpmath.sqrt(x * x + y * y) / rate


def exact_turn(design: Design, height: float) -> object:
    """The turn at a height in 60 digits."""
    import mpmath

    l3, l5, s = (mpmath.mpf(value) for value in (design.l3, design.l5, height))
    return mpmath.acos((l3 * l3 + s * s - l5 * l5) / (2 * l3 * s))


def printed_arccos_speed(design: Design, height: float) -> float:
    """v_s / v_l with the direction of AC from a plain arccos of the height, the formula as it comes to mind."""
    l2, l3, l4, l5, b = design.as_tuple()
    turn = math.acos(min(1.0, max(-1.0, (l3**2 + height**2 - l5**2) / (2 * l3 * height))))
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    r = math.sqrt(l5**2 - (l3 * math.sin(turn)) ** 2)
    s1 = -l3 * l3 * math.sin(turn) * math.cos(turn) / r - l3 * math.sin(turn)
    x, y = l2 * math.sin(turn - gamma) - b, height - l2 * math.cos(turn - gamma)
    rate = x * l2 * math.cos(turn - gamma) + y * (s1 + l2 * math.sin(turn - gamma))
    return s1 * math.hypot(x, y) / rate


def measure_stability() -> dict[str, list[dict]]:
    """Speed, condition number and relative errors towards the dead point and towards the top, both designs."""
    import mpmath

    mpmath.mp.dps = 60
    table: dict[str, list[dict]] = {"dead point": [], "top": []}
    for name, design in (("initial", INITIAL), ("published", OPTIMUM)):
        dead = float(dead_point(design))
        for distance in (1e-1, 1e-2, 1e-4, 1e-6, 1e-8):
            turn = dead - distance
            pose = pose_at_turn(design, turn)
            found, exact = float(velocity(pose, 1.0)), exact_speed(design, turn)
            again = float(turn_at_length(design, float(pose.length)))
            table["dead point"].append(
                {
                    "design": name,
                    "distance": distance,
                    "speed": 100 * found,
                    "condition": float(condition(design, turn)),
                    "relative_error": float(abs(found / exact - 1)),
                    "turn_from_length_error": abs(again - turn),
                }
            )
        for distance in (1e-1, 1e-2, 1e-4, 1e-6):
            pose = pose_at_turn(design, distance)
            exact = exact_speed(design, distance)
            height = float(pose.height)
            by_height = float(velocity(pose_at_height(design, height), 1.0))
            at_height = exact_speed(design, exact_turn(design, height))
            table["top"].append(
                {
                    "design": name,
                    "distance": distance,
                    "below_top": float(design.l3 + design.l5 - height),
                    "speed": 100 * float(velocity(pose, 1.0)),
                    "condition": float(condition(design, distance)),
                    "relative_error": float(abs(float(velocity(pose, 1.0)) / exact - 1)),
                    "from_height_error": float(abs(by_height / at_height - 1)),
                    "arccos_error": float(abs(printed_arccos_speed(design, height) / at_height - 1)),
                    "instant_centre_error": float(
                        abs(float(velocity_by_instant_centre(design, 1.0, height)) / at_height - 1)
                    ),
                }
            )
    return table


def measure_table_2() -> list[dict]:
    """Table 2 as printed, projected, and our optimum; one search for all speeds of one length."""
    printed = {200.0: 321.5, 210.0: 326.3, 220.0: 337.5, 230.0: 348.9, 240.0: 353.5, 250.0: 364.5}
    speeds = {70.0: 169.4, 80.0: 216.0, 90.0: 280.0, 110.0: 408.4, 120.0: 497.8}
    cylinders = [(220.0, speed, value) for speed, value in speeds.items()]
    cylinders += [(length, 100.0, value) for length, value in printed.items()]
    tasks = [
        Task(Cylinder(length, speed), 200.0, 510.0, Objective("discrete"), 600.0) for length, speed, _ in cylinders
    ]
    rows = []
    for (length, speed, value), task, optimum in zip(cylinders, tasks, optimize_batch(tasks)):
        published = published_for(task, optimum)
        rows.append(
            {
                "length": length,
                "speed": speed,
                "printed_l2": published.design.l2,
                "printed_f": value,
                "projected_f": published.objective,
                "design": optimum.design.as_dict(),
                "f": optimum.objective,
                "duration": optimum.duration,
            }
        )
    return rows


def measure_optima() -> list[dict]:
    """Optima of all objectives and some bounds, with their search time."""
    rows = []
    cases = [
        ("discrete", 310, True, 600.0),
        ("discrete", 31, True, 1000.0),
        ("discrete", 100, True, 1000.0),
        ("discrete", 1000, True, 1000.0),
        ("as printed", 310, False, 600.0),
        ("as printed", 310, False, 1000.0),
        ("continuous", 310, True, 600.0),
        ("continuous", 310, True, 1000.0),
        ("continuous", 310, True, 4000.0),
        ("normalized", 310, True, 600.0),
        ("normalized", 310, True, 4000.0),
    ]
    for kind, n, include_start, bound in cases:
        objective = Objective("discrete" if kind == "as printed" else kind, n, include_start)
        task = Task(CYLINDER, 200.0, 510.0, objective, bound)
        start = time.perf_counter()
        optimum = optimize(task)
        rows.append(
            {
                "kind": kind,
                "n": n if objective.kind == "discrete" else None,
                "bound": bound,
                "design": optimum.design.as_dict(),
                "f": optimum.objective,
                "active": list(optimum.active),
                "duration": optimum.duration,
                "seconds": time.perf_counter() - start,
                "evaluations": optimum.evaluations,
            }
        )
    return rows


# -- pictures ------------------------------------------------------------------------------------------------

INK, GREY, BLUE, ORANGE, GREEN, RED = "#1f2933", "#9aa5b1", "#2563a8", "#d97706", "#2f855a", "#b83232"


def _style() -> object:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update(
        {
            "font.size": 10,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.edgecolor": GREY,
            "axes.labelcolor": INK,
            "text.color": INK,
            "xtick.color": INK,
            "ytick.color": INK,
            "axes.grid": True,
            "grid.color": "#e4e7eb",
            "axes.axisbelow": True,
            "legend.frameon": False,
            "figure.dpi": 150,
            "savefig.bbox": "tight",
        }
    )
    return plt


def joints(design: Design, turn: float) -> dict[str, tuple[float, float]]:
    """The five joints of a pose."""
    pose = pose_at_turn(design, turn)
    return {
        "O": (0.0, 0.0),
        "D": (-design.b, 0.0),
        "A": (-design.b, float(pose.height)),
        "B": (float(pose.x), float(pose.y)),
        "C": (float(design.l3 * pose.sin_turn - design.b), float(pose.root)),
    }


def draw_lift(axes: object, design: Design, turn: float, color: str, alpha: float = 1.0, full: bool = True) -> dict:
    """Draw one pose; returns its joints."""
    from matplotlib.patches import Polygon

    at = joints(design, turn)
    axes.add_patch(
        Polygon([at["A"], at["B"], at["C"]], closed=True, fc=color, ec=color, alpha=0.18 * alpha, lw=0, zorder=2)
    )
    for first, second, width in (("A", "B", 2.6), ("A", "C", 2.6), ("B", "C", 2.6), ("D", "C", 3.2)):
        axes.plot(*zip(at[first], at[second]), color=color, lw=width, alpha=alpha, solid_capstyle="round", zorder=3)
    o, b = np.array(at["O"]), np.array(at["B"])
    middle = o + (b - o) / np.hypot(*(b - o)) * 200.0
    axes.plot(*zip(o, middle), color=INK, lw=7, alpha=0.8 * alpha, solid_capstyle="butt", zorder=3)
    axes.plot(*zip(o, b), color=GREY, lw=3, alpha=alpha, zorder=2.5)
    if full:
        for name in at:
            axes.plot(*at[name], "o", ms=7, mfc="white", mec=INK, mew=1.5, zorder=5)
    # the platform on its slide
    x, y = at["A"]
    axes.plot([x - 55, x + 55], [y + 14, y + 14], color=color, lw=5, alpha=alpha, zorder=3, solid_capstyle="butt")
    return at


def picture_model() -> None:
    """The mechanism with its names, and the poses along the rise before and after."""
    plt = _style()
    figure, panels = plt.subplots(1, 2, figsize=(11.6, 5.4))
    limits = motion(INITIAL, CYLINDER, [0.0]).stroke
    axes = panels[0]
    turn = float(turn_at_length(INITIAL, 262.0))
    at = draw_lift(axes, INITIAL, turn, BLUE)
    axes.plot([-480, -480], [-40, 590], color=GREY, lw=1.2, ls=(0, (6, 4)), zorder=1)
    axes.annotate("slide  x = −b", (-480, 575), xytext=(8, 0), textcoords="offset points", color=INK)
    for name, (dx, dy) in {"O": (10, -16), "D": (-16, -16), "A": (-24, -14), "B": (10, 2), "C": (10, 4)}.items():
        axes.annotate(name, at[name], xytext=(dx, dy), textcoords="offset points", fontsize=13, weight="bold")
    for text, first, second, share, offset in (
        ("l2", "A", "B", 0.78, (-18, -10)),
        ("l3", "A", "C", 0.5, (-4, 8)),
        ("l4", "B", "C", 0.5, (9, 4)),
        ("l5", "D", "C", 0.28, (8, -8)),
        ("cylinder l1(t)", "O", "B", 0.5, (-20, 18)),
    ):
        middle = (1 - share) * np.array(at[first]) + share * np.array(at[second])
        axes.annotate(text, middle, xytext=offset, textcoords="offset points", fontsize=11, style="italic")
    axes.annotate("", (-560, 0), xytext=(-560, at["A"][1]), arrowprops={"arrowstyle": "<->", "color": INK, "lw": 1})
    axes.annotate(
        "s", (-560, at["A"][1] / 2), xytext=(-14, 0), textcoords="offset points", style="italic", fontsize=12
    )
    axes.annotate("", (-480, -75), xytext=(0, -75), arrowprops={"arrowstyle": "<->", "color": INK, "lw": 1})
    axes.annotate("b", (-240, -75), xytext=(0, -15), textcoords="offset points", style="italic", fontsize=12)
    arc = np.linspace(-np.pi / 2, -np.pi / 2 + turn, 40)
    axes.plot(-480 + 62 * np.cos(arc), at["A"][1] + 62 * np.sin(arc), color=ORANGE, lw=2, zorder=4)
    axes.annotate("T", (-480 + 72, at["A"][1] - 62), color=ORANGE, fontsize=13, weight="bold")
    for x in (0.0, -480.0):
        axes.plot([x - 26, x + 26], [-14, -14], color=INK, lw=2)
    axes.set_title("One angle, the turn T, gives every pose", loc="left", weight="bold")
    for axes, (design, color) in zip(panels[1:], ((INITIAL, BLUE),)):
        for share, alpha in ((1.0, 0.35), (0.55, 0.6), (0.0, 1.0)):
            draw_lift(axes, design, share * float(limits.turn_bottom), color, alpha=alpha)
        path = pose_at_turn(design, np.linspace(0, float(limits.turn_bottom), 200))
        axes.plot(path.x, path.y, color=ORANGE, lw=1.6, ls="--", zorder=4, label="path of B")
        axes.plot(
            design.l3 * path.sin_turn - design.b, path.root, color=GREEN, lw=1.6, ls="--", zorder=4, label="path of C"
        )
        axes.plot([-480, -480], [-40, 590], color=GREY, lw=1.2, ls=(0, (6, 4)), zorder=1)
        axes.legend(loc="upper right")
        axes.set_title("From the collinear start to the top", loc="left", weight="bold")
    for axes in panels:
        axes.set_aspect("equal")
        axes.grid(False)
        axes.axis("off")
    panels[0].set_xlim(-780, 90)
    panels[0].set_ylim(-110, 600)
    panels[1].set_xlim(-780, 90)
    panels[1].set_ylim(-110, 600)
    figure.savefig(ROOT / "docs/img/lift_model.png")
    plt.close(figure)


def picture_motion(optimum: Design) -> None:
    """Height, velocity and acceleration over time: before, published, optimum."""
    plt = _style()
    figure, panels = plt.subplots(3, 1, figsize=(8.6, 9.0), sharex=True)
    for name, design, color, dash, shift in (
        ("before", INITIAL, GREY, "-", 0),
        ("published", OPTIMUM, BLUE, "-", -14),
        ("optimum (discrete, n = 310)", optimum, ORANGE, "--", 14),
    ):
        duration = float(motion(design, CYLINDER, [0.0]).stroke.duration)
        times = duration * np.linspace(0, 1, 4001) ** 2
        moved = motion(design, CYLINDER, times)
        for axes, values in zip(panels, (moved.pose.height, moved.velocity, moved.acceleration)):
            axes.plot(times, values, color=color, ls=dash, lw=2.2, label=name)
        panels[0].plot(duration, 510, "o", color=color, ms=6)
        panels[0].annotate(
            f"{duration:.2f} s",
            (duration, 510),
            xytext=(shift, 8),
            textcoords="offset points",
            ha="center",
            color=color,
        )
    panels[0].set_ylabel("height s  (mm)")
    panels[0].set_ylim(180, 560)
    panels[0].legend(loc="lower right")
    panels[1].set_ylabel("velocity  (mm/s)")
    panels[1].set_ylim(0, 150)
    panels[1].axhline(50, color=INK, lw=0.8, ls=":")
    panels[1].annotate(
        "the first instant is off the scale: 257, 278 and 299 mm/s at t = 0",
        (0.02, 146),
        xytext=(1.0, 132),
        arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.8},
        fontsize=9,
    )
    panels[2].set_ylabel("acceleration  (mm/s²)")
    panels[2].set_ylim(-70, 15)
    panels[2].set_xlabel("time  (s)")
    panels[2].annotate(
        "the first instant is off the scale: −7.2·10³, −5.6·10⁴ and −9.1·10⁴ mm/s²",
        (0.12, -68),
        xytext=(1.0, -60),
        arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.8},
        fontsize=9,
    )
    figure.align_ylabels(panels)
    figure.tight_layout()
    figure.savefig(ROOT / "docs/img/lift_motion.png")
    plt.close(figure)


def picture_integration(rows: list[dict], closed: list[dict]) -> None:
    """Error against run time."""
    plt = _style()
    figure, panels = plt.subplots(1, 2, figsize=(11.2, 4.6), sharey=True)
    styles = {"Euler": (GREY, "s"), "RK4": (BLUE, "o"), "RK45": (GREEN, "^"), "DOP853": (RED, "D")}
    for axes, name in zip(panels, ("initial", "published")):
        for method, (color, marker) in styles.items():
            some = [row for row in rows if row["design"] == name and row["method"] == method and row["height_error"]]
            axes.loglog(
                [row["seconds"] for row in some],
                [row["height_error"] for row in some],
                marker=marker,
                color=color,
                lw=1.4,
                ms=7,
                label=method,
            )
            for row in rows:
                if row["design"] == name and row["method"] == method and row["height_error"] is None:
                    level = 3e2 if method == "RK4" else 3e1
                    axes.plot(row["seconds"], level, marker="x", color=color, ms=9, mew=2.2)
                    axes.annotate(
                        f"{method}, {row['setting']}: diverges",
                        (row["seconds"], level),
                        xytext=(8, -4),
                        textcoords="offset points",
                        fontsize=8.5,
                    )
        own = next(row for row in closed if row["design"] == name)
        axes.plot(
            own["from_time_seconds"],
            own["height_error"],
            "*",
            ms=17,
            color=ORANGE,
            mec=INK,
            mew=0.6,
            label="closed form,\n57,201 poses",
        )
        axes.set_title(f"{name} design", loc="left", weight="bold")
        axes.set_xlabel("run time  (s)")
    panels[0].set_ylabel("largest error of the height  (mm)")
    panels[0].set_ylim(1e-14, 3e3)
    panels[1].legend(loc="lower right", fontsize=9)
    figure.tight_layout()
    figure.savefig(ROOT / "docs/img/lift_integration.png")
    plt.close(figure)


def picture_objective() -> None:
    """The objectives along l4 = l2: why n decides, why the continuous one has no optimum, and why one has."""
    plt = _style()
    figure, panels = plt.subplots(1, 2, figsize=(11.2, 4.6))
    arms = np.geomspace(150, 2000, 1500)
    designs = project(arms, arms, 220.0, 200.0, 510.0)
    axes = panels[0]
    shades = ("#bfdbfe", "#60a5fa", BLUE, "#1e3a5f")
    for n, color in zip((100, 200, 310, 1000), shades):
        values = Evaluator(Task(CYLINDER, 200.0, 510.0, Objective("discrete", n), 1e4))(designs)
        axes.plot(arms, values, color=color, lw=2.2, label=f"discrete, n = {n}")
        axes.plot(arms[np.nanargmin(values)], np.nanmin(values), "o", color=color, ms=7, mec=INK, mew=0.6)
    values = Evaluator(Task(CYLINDER, 200.0, 510.0, Objective("continuous"), 1e4))(designs)
    axes.plot(arms, values, color=ORANGE, lw=2.2, ls="--", label="continuous")
    axes.axvline(351.9, color=INK, lw=0.8, ls=":")
    axes.annotate("published", (351.9, 1530), xytext=(4, 0), textcoords="offset points", fontsize=9)
    axes.set_xscale("log")
    axes.set_ylim(0, 1600)
    axes.set_xlim(50, 2200)
    axes.set_ylabel("f  (mm²/s²)")
    axes.set_title("f rewards slowness; its optimum moves with n", loc="left", weight="bold")
    axes.legend(loc="upper left", fontsize=9, frameon=True, framealpha=1.0, edgecolor="none")
    axes = panels[1]
    values = Evaluator(Task(CYLINDER, 200.0, 510.0, Objective("normalized"), 1e4))(designs)
    axes.plot(arms, values, color=GREEN, lw=2.4)
    at = int(np.nanargmin(values))
    axes.plot(arms[at], values[at], "o", color=GREEN, ms=8, mec=INK, mew=0.6)
    axes.annotate(
        f"l2 = {arms[at]:.0f}", (arms[at], values[at]), xytext=(0, -18), textcoords="offset points", ha="center"
    )
    axes.set_xscale("log")
    axes.set_ylim(0.09, 0.2)
    axes.set_ylabel("f / v̄²")
    axes.set_title("Normalized: an optimum of its own", loc="left", weight="bold")
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    for axes in panels:
        axes.set_xlabel("l2 = l4  (mm)")
        axes.set_xticks([200, 300, 500, 1000, 2000])
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.xaxis.set_minor_formatter(NullFormatter())
    figure.tight_layout()
    figure.savefig(ROOT / "docs/img/lift_objective.png")
    plt.close(figure)


def picture_designs(optimum: Design) -> None:
    """Before, published and optimum at the start and at the top, to one scale."""
    plt = _style()
    figure, panels = plt.subplots(1, 3, figsize=(12.5, 4.6), sharey=True)
    for axes, (name, design, color) in zip(
        panels, (("before", INITIAL, GREY), ("published", OPTIMUM, BLUE), ("optimum", optimum, ORANGE))
    ):
        limits = motion(design, CYLINDER, [0.0]).stroke
        draw_lift(axes, design, float(limits.turn_bottom), color, alpha=0.55)
        draw_lift(axes, design, 0.0, color)
        path = pose_at_turn(design, np.linspace(0, float(limits.turn_bottom), 200))
        axes.plot(path.x, path.y, color=INK, lw=1.1, ls=":", zorder=4)
        axes.plot([-design.b, -design.b], [-30, 570], color=GREY, lw=1.1, ls=(0, (6, 4)), zorder=1)
        axes.set_title(f"{name}: {float(limits.duration):.2f} s", loc="left", weight="bold")
        axes.set_aspect("equal")
        axes.set_xlim(-970, 90)
        axes.set_ylim(-110, 590)
        axes.axis("off")
    figure.tight_layout()
    figure.savefig(ROOT / "docs/img/lift_designs.png")
    plt.close(figure)


# -- tables --------------------------------------------------------------------------------------------------


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))


def tables(results: dict) -> dict[str, str]:
    """The tables of the documentation by name."""
    out = {}
    rows = []
    for row in results["integration"]:
        diverged = row["height_error"] is None
        rows.append(
            [
                row["design"],
                row["method"],
                row["setting"],
                f"**diverges** at {row['stopped_at']:.2f} s" if diverged else f"{row['height_error']:.1e}",
                "–" if diverged else f"{row['loop_residual']:.1e}",
                f"{row['seconds']:.3g}",
                "–" if diverged else f"{row['ratio']:.0f}",
            ]
        )
    head = [
        "design",
        "method",
        "step or tolerance",
        "max height error (mm)",
        "max loop residual (mm)",
        "run time (s)",
    ]
    out["integration"] = markdown([*head, "times the closed form's"], rows)
    out["closed_form"] = markdown(
        ["design", "poses", "by turn (ms)", "from time (ms)", "max height error (mm)", "max loop residual (mm)"],
        [
            [
                row["design"],
                f"{row['poses']:,}",
                f"{1e3 * row['by_turn_seconds']:.1f}",
                f"{1e3 * row['from_time_seconds']:.1f}",
                f"{row['height_error']:.1e}",
                f"{row['largest_residual']:.1e}",
            ]
            for row in results["closed_form"]
        ],
    )
    out["dead_point"] = markdown(
        [
            "design",
            "distance d (rad)",
            "v_s (mm/s)",
            "condition",
            "rel. error of v_s",
            "turn from length, error (rad)",
        ],
        [
            [
                row["design"],
                f"{row['distance']:.0e}",
                f"{row['speed']:.3g}",
                f"{row['condition']:.3g}",
                f"{row['relative_error']:.0e}",
                f"{row['turn_from_length_error']:.0e}",
            ]
            for row in results["stability"]["dead point"]
        ],
    )
    out["top"] = markdown(
        [
            "design",
            "turn (rad)",
            "below the top (mm)",
            "v_s (mm/s)",
            "condition",
            "by turn",
            "by height",
            "plain arccos",
            "instant centre",
        ],
        [
            [
                row["design"],
                f"{row['distance']:.0e}",
                f"{row['below_top']:.1e}",
                f"{row['speed']:.3g}",
                f"{row['condition']:.4g}",
                f"{row['relative_error']:.0e}",
                f"{row['from_height_error']:.0e}",
                f"{row['arccos_error']:.0e}",
                f"{row['instant_centre_error']:.0e}",
            ]
            for row in results["stability"]["top"]
        ],
    )
    out["table_2"] = markdown(
        [
            "l1'",
            "v_l",
            "printed l2 = l4",
            "printed f",
            "its f on the constraints",
            "our l2 = l4",
            "l3",
            "l5",
            "b",
            "our f",
            "rise time (s)",
        ],
        [
            [
                f"{row['length']:g}",
                f"{row['speed']:g}",
                f"{row['printed_l2']:g}",
                f"{row['printed_f']:g}",
                f"{row['projected_f']:.3f}",
                *(f"{row['design'][name]:.3f}" for name in ("l2", "l3", "l5", "b")),
                f"**{row['f']:.3f}**",
                f"{row['duration']:.3f}",
            ]
            for row in results["table_2"]
        ],
    )
    out["optima"] = markdown(
        ["objective", "n", "bound", "l2", "l3", "l4", "l5", "b", "f", "active", "rise time (s)"],
        [
            [
                row["kind"],
                "–" if row["n"] is None else str(row["n"]),
                f"{row['bound']:g}",
                *(f"{row['design'][name]:.3f}" for name in ("l2", "l3", "l4", "l5", "b")),
                f"{row['f']:.6g}",
                ", ".join(f"`{name}`" for name in row["active"]),
                f"{row['duration']:.2f}",
            ]
            for row in results["optima"]
        ],
    )
    return out


def write_tables(path: Path, contents: dict[str, str]) -> None:
    """Replace what stands between ``<!-- table: name -->`` and ``<!-- end -->``."""
    text = path.read_text()
    for name, table in contents.items():
        start, end = f"<!-- table: {name} -->\n", "\n<!-- end -->"
        if start not in text:
            raise SystemExit(f"{path.name} has no place for the table '{name}'")
        head, rest = text.split(start, 1)
        text = head + start + table + end + rest.split(end, 1)[1]
    path.write_text(text)


def main() -> None:
    """Measure, write the results, the tables and the pictures."""
    results = {
        "integration": measure_integration(),
        "closed_form": measure_closed_form(),
        "rounding": measure_rounding(),
        "stability": measure_stability(),
        "table_2": measure_table_2(),
        "optima": measure_optima(),
    }
    target = ROOT / "benchmarks/results/lift.json"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(results, indent=1) + "\n")
    draw(results)


def draw(results: dict) -> None:
    """The tables and pictures of given results."""
    optimum = Design(**results["optima"][0]["design"])
    write_tables(ROOT / "docs/lift.md", tables(results))
    (ROOT / "docs/img").mkdir(parents=True, exist_ok=True)
    picture_model()
    picture_motion(optimum)
    picture_integration(results["integration"], results["closed_form"])
    picture_objective()
    picture_designs(optimum)


if __name__ == "__main__":
    main()
