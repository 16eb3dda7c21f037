"""The lift's figures: the closed form against step-by-step integration, and the optima against the published designs.

Run ``python -m benchmarks.lift``; it writes ``benchmarks/results/lift.json``, the pictures ``docs/img/lift_*.png`` and
the numbers of ``docs/lift.md``. All searches are deterministic; only run times differ.
"""

from __future__ import annotations

import json
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from benchmarks import report
from benchmarks.report import BLUE, GREEN, GREY, INK, ORANGE, RED, Times, bare, figure, note, percent, significant
from synthesis.lift.loops import condition, largest_residual, smallest_condition, velocity_by_instant_centre
from synthesis.lift.motion import acceleration, motion, stroke, velocity
from synthesis.lift.objective import Evaluator, Objective, Task, equation_residuals, project
from synthesis.lift.optimum import Optimum, optimize, optimize_batch
from synthesis.lift.pose import Cylinder, Design, dead_point, pose_at_height, pose_at_turn, turn_at_length
from synthesis.lift.published import ARMS, published_for
from tests.oracles import lift as oracle

REFERENCE = json.loads((report.ROOT / "tests/reference/lift_acceptance.json").read_text())
DESIGNS = {
    "initial": Design(*REFERENCE["designs"]["initial"]),
    "published": Design(*REFERENCE["designs"]["optimum"]),
}
CYLINDER = Cylinder(220.0, 100.0)
STROKE = (200.0, 510.0)
POSES = 57_201
ROUNDINGS = 5_000


def task(objective: Objective, bound: float = 600.0, cylinder: Cylinder = CYLINDER) -> Task:
    """The published problem with another objective, bound or cylinder."""
    return Task(cylinder, *STROKE, objective, bound)


# -- measurements --------------------------------------------------------------------------------------------


def adaptive(design: Design, method: str, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of an integration of (14) with steps of its own choice."""
    from scipy.integrate import solve_ivp

    equation, start = oracle.Loops(design).equation(CYLINDER), oracle.start_state(design, CYLINDER)
    even = np.linspace(0.0, float(stroke(design, CYLINDER).duration), 573)
    options = {"rtol": tolerance, "atol": 1e-3 * tolerance, "t_eval": even}
    solved = solve_ivp(equation, even[[0, -1]], start, method=method, **options)
    return solved.t, solved.y.T


def measure_integration() -> list[dict]:
    """Error against run time: fixed and adaptive steps, each beside the closed form at the same times."""
    cases: list[tuple] = [
        ("Euler", f"h = {h:g} s", oracle.integrate, CYLINDER, h, oracle.euler_step) for h in (1e-2, 1e-3, 1e-4)
    ]
    cases += [("RK4", f"h = {h:g} s", oracle.integrate, CYLINDER, h) for h in (1e-2, 5e-3, 2e-3, 1e-3, 1e-4)]
    adaptives = (("RK45", 1e-3), ("RK45", 1e-6), ("DOP853", 1e-10))
    cases += [(method, f"rtol = {rtol:g}", adaptive, method, rtol) for method, rtol in adaptives]
    rows = []
    for (name, design), (method, setting, run, *options) in product(DESIGNS.items(), cases):
        clock = Times()
        times, states = clock.run(run, design, *options)
        for _ in range(4 if clock.wall[0] < 0.5 else 0):
            clock.run(run, design, *options)
        error, residual = oracle.integration_error(design, CYLINDER, times, states)
        reached = times[times <= stroke(design, CYLINDER).duration]
        closed = report.repeat(partial(motion, design, CYLINDER, reached)).least.processor
        seconds, diverged = clock.least.processor, np.isnan(error)
        row = {"design": name, "method": method, "setting": setting, "times": len(reached), "seconds": seconds}
        row |= {"height_error": None if diverged else error, "loop_residual": None if diverged else residual}
        rows.append({**row, "ratio": seconds / closed, "stopped_at": times[-1] if diverged else None})
    return rows


def measure_closed_form() -> list[dict]:
    """Run time and own error of the closed form: by turn, and from time through the scalar Newton iteration."""
    rows = []
    for name, design in DESIGNS.items():
        moved = motion(design, CYLINDER, samples=POSES)
        turns, exact = np.linspace(float(moved.stroke.turn_bottom), 0.0, POSES), oracle.Exact(design)

        def by_turn(design=design, turns=turns):
            pose = pose_at_turn(design, turns)
            return velocity(pose, 100.0), acceleration(pose, 100.0, 0.0)

        some = zip(moved.cylinder_length[::1144].tolist(), moved.pose.height[::1144].tolist())
        error = max(abs(float(exact.height_at_length(length) - height)) for length, height in some)
        row = {"design": name, "largest_residual": largest_residual(moved), "height_error": error}
        row["by_turn_ms"] = 1e3 * report.repeat(by_turn).least.processor
        row["from_time_ms"] = 1e3 * report.repeat(partial(motion, design, CYLINDER, samples=POSES)).least.processor
        rows.append(row)
    return rows


def measure_published() -> dict:
    """f of the published design with its lengths moved within +-0.05 mm, and on the constraints, with both sums."""
    spread = np.random.default_rng(7).uniform(-0.05, 0.05, (5, ROUNDINGS))
    designs = Design(*(value + spread[k] for k, value in enumerate(DESIGNS["published"].as_tuple())))
    values = Evaluator(task(Objective("discrete")))(designs)
    values = values[np.isfinite(values)]
    on_constraints = project(ARMS[CYLINDER.length], ARMS[CYLINDER.length], CYLINDER.length, *STROKE)
    sums = [
        float(Evaluator(task(Objective("discrete", include_start=flag)))(on_constraints)) for flag in (True, False)
    ]
    least, most = float(np.min(values)), float(np.max(values))
    initial = DESIGNS["initial"]
    closed_l5 = initial.l5 + equation_residuals(initial, CYLINDER.length, *STROKE)["(32) closure"]
    found = {"samples": ROUNDINGS, "least": least, "most": most, "f": sums[0], "f_as_printed": sums[1]}
    return {**found, "closed_l5_of_initial": closed_l5}


def relative_error(value: float, exact: Any) -> float:
    """Of a number of many digits: its difference is rounded only once it is taken."""
    return float(abs(value - exact) / abs(exact))


def measure_stability() -> dict[str, list[dict]]:
    """Speed, condition number and relative errors towards the dead point and towards the top, both designs."""
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
                    "condition": float(condition(design, turn)),
                    "relative_error": relative_error(float(pose.gain), gain),
                }
                if end == "dead_point":
                    row["turn_from_length_error"] = abs(float(turn_at_length(design, float(pose.length))) - turn)
                else:
                    gain = exact.gain(exact.turn_at_height(height))
                    others = {
                        "from_height_error": float(pose_at_height(design, height).gain),
                        "arccos_error": oracle.arccos_gain(design, height),
                        "instant_centre_error": float(velocity_by_instant_centre(design, 1.0, height)),
                    }
                    row |= {key: relative_error(value, gain) for key, value in others.items()}
                    row["below_top"] = float(design.l3 + design.l5 - height)
                found[end].append(row)
    return found


def optimum_row(wanted: Task, optimum: Optimum) -> dict[str, Any]:
    """An optimum, and f of the published design on the same constraints."""
    row = {"design": optimum.design.as_dict(), "f": optimum.objective, "duration": optimum.duration}
    return row | {"f_of_published": published_for(wanted, optimum).objective, "active": optimum.active}


def measure_table_2() -> list[dict]:
    """Table 2 as printed, projected, and our optimum; one search for all speeds of one length."""
    by_speed, by_length = REFERENCE["table_2_speeds"], REFERENCE["table_2"]
    cylinders = {Cylinder(CYLINDER.length, float(speed)): value for speed, value in by_speed.items()}
    cylinders |= {Cylinder(float(length), CYLINDER.speed): row["printed"] for length, row in by_length.items()}
    tasks = [task(Objective("discrete"), cylinder=cylinder) for cylinder in cylinders]
    rows = []
    for wanted, value, optimum in zip(tasks, cylinders.values(), optimize_batch(tasks)):
        length, speed = wanted.cylinder.length, wanted.cylinder.speed
        printed = {"length": length, "speed": speed, "printed_l2": ARMS[length], "printed_f": value}
        rows.append(printed | optimum_row(wanted, optimum))
    return rows


def measure_optima() -> list[dict]:
    """Optima of all objectives and some bounds, with their search time."""
    cases = [("discrete", n, bound) for n, bound in ((310, 600.0), (31, 1e3), (100, 1e3), (1000, 1e3))]
    cases += [("as printed", 310, bound) for bound in (600.0, 1e3)]
    cases += [("continuous", None, bound) for bound in (600.0, 1e3, 4e3)]
    cases += [("normalized", None, bound) for bound in (600.0, 4e3)]
    rows = []
    for kind, n, bound in cases:
        objective = Objective(kind) if n is None else Objective("discrete", n, kind == "discrete")
        times, wanted = Times(), task(objective, bound)
        optimum = times.run(optimize, wanted)
        case = {"kind": kind, "n": n, "bound": bound, "seconds": times.processor[0]}
        rows.append(case | optimum_row(wanted, optimum))
    return rows


def measure_designs(optimum: dict[str, float]) -> list[dict]:
    """What the motions of the three designs are like."""
    rows = []
    for name, design in {**DESIGNS, "optimum": Design(**optimum)}.items():
        moved = motion(design, CYLINDER, samples=100_001)
        limits, start = moved.stroke, float(moved.cylinder_length[0])
        least, turn = smallest_condition(design, limits)
        rows.append(
            {
                "design": name,
                "lengths": design.as_dict(),
                "duration": float(limits.duration),
                "height": float(limits.height_bottom),
                "velocity": float(moved.velocity[0]),
                "acceleration": float(moved.acceleration[0]),
                "early_velocity": float(motion(design, CYLINDER, [0.05]).velocity[0]),
                "above_dead_point": start - float(limits.length_dead),
                "extension": float(limits.length_top) / start,
                "lowest_b": float(np.min(moved.pose.y)),
                "share_within": {str(w): float(np.mean(np.abs(moved.velocity - 50) <= w)) for w in (5, 10)},
                "least_condition": least,
                "least_condition_time": (float(pose_at_turn(design, turn).length) - start) / CYLINDER.speed,
            }
        )
    return rows


# -- the documents' numbers ----------------------------------------------------------------------------------


TABLES = {
    "designs": ": {what} | before: {initial} | published: {published} | optimum (n = 310): {optimum}",
    "integration": "design: {design} | method: {method} | step or tolerance: {setting} | "
    "max height error (mm): {height} | max loop residual (mm): {loops} | run time (s): {seconds:.3g} | "
    "times the closed form's: {times}",
    "closed_form": "design: {design} | by turn (ms): {by_turn_ms:.1f} | from time (ms): {from_time_ms:.1f} | "
    "max height error (mm): {height_error:.1e} | max loop residual (mm): {largest_residual:.1e}",
    "dead_point": "design: {design} | distance d (rad): {distance:.0e} | v_s (mm/s): {speed:.3g} | "
    "condition: {condition:.3g} | rel. error of v_s: {relative_error:.0e} | "
    "turn from length, error (rad): {turn_from_length_error:.0e}",
    "top": "design: {design} | turn (rad): {distance:.0e} | below the top (mm): {below_top:.1e} | "
    "v_s (mm/s): {speed:.3g} | condition: {condition:.4g} | by turn: {relative_error:.0e} | "
    "by height: {from_height_error:.0e} | plain arccos: {arccos_error:.0e} | instant centre: {instant_centre_error:.0e}",
    "table_2": "l1': {length:g} | v_l: {speed:g} | printed l2 = l4: {printed_l2:g} | printed f: {printed_f:g} | "
    "its f on the constraints: {f_of_published:.3f} | our l2 = l4: {design[l2]:.3f} | l3: {design[l3]:.3f} | "
    "l5: {design[l5]:.3f} | b: {design[b]:.3f} | our f: **{f:.3f}** | rise time (s): {duration:.3f}",
    "optima": "objective: {kind} | n: {steps} | bound: {bound:g} | l2: {design[l2]:.3f} | l3: {design[l3]:.3f} | "
    "l4: {design[l4]:.3f} | l5: {design[l5]:.3f} | b: {design[b]:.3f} | f: {f:.6g} | active: {names} | "
    "rise time (s): {duration:.2f}",
}
"""Heads and cells of the tables."""
OF_INTEGRATION = {"height": "{height_error:.1e}", "loops": "{loop_residual:.1e}", "times": "{ratio:.0f}"}
OF_DESIGNS = {
    "l2, l3, l4, l5, b": "{l2:.1f}, {l3:.1f}, {l4:.1f}, {l5:.1f}, {b:.1f}",
    "rise time (s)": "{duration:.3f}",
    "v at t = 0 (mm/s)": "{velocity:.1f}",
    "a at t = 0 (mm/s²)": "{acceleration:,.0f}",
    "dead point below the start (mm of cylinder)": "{above_dead_point:.2f}",
    "cylinder at the top, in start lengths": "{extension:.1f}",
    "lowest point of B above the pivots (mm)": "{lowest_b:.1f}",
}


def blocks(results: dict) -> dict[str, str]:
    """The text of each marker of docs/lift.md."""
    designs, optima, digits = results["designs"], results["optima"], results["published"]
    integration, table_2 = results["integration"], results["table_2"]
    initial, published, _ = designs
    rows = {
        **results["stability"],
        "designs": [
            {"what": what, **{row["design"]: cell.format(**row, **row["lengths"]) for row in designs}}
            for what, cell in OF_DESIGNS.items()
        ],
        "integration": [
            {**row, "height": f"**diverges** at {row['stopped_at']:.2f} s", "loops": "-", "times": "-"}
            if row["height_error"] is None
            else {**row, **{key: cell.format(**row) for key, cell in OF_INTEGRATION.items()}}
            for row in integration
        ],
        "closed_form": results["closed_form"],
        "table_2": table_2,
        "optima": [
            {**row, "steps": row["n"] or "-", "names": ", ".join(f"`{name}`" for name in row["active"])}
            for row in optima
        ],
    }
    tables = {}
    for name, cells in TABLES.items():
        columns = dict(cell.split(": ", 1) for cell in cells.split(" | "))
        tables[name] = report.table(rows[name], columns, text_columns=3 if name == "integration" else 1)

    def ends(values: list[float], digits: int = 1) -> str:
        return f"{min(values):.{digits}f} to {max(values):.{digits}f}"

    def change(key: str) -> str:
        return f"{100 * (published[key] / initial[key] - 1):+.0f} %".replace("-", "−")

    by_length = [row for row in table_2 if row["speed"] == CYLINDER.speed]
    # one design, printed for six speeds
    scaled = [row["printed_f"] / row["speed"] ** 2 for row in table_2 if row["length"] == CYLINDER.length]
    normalized = [row for row in optima if row["kind"] == "normalized"]
    finest = [row for row in integration if (row["method"], row["setting"]) == ("RK4", "h = 0.0001 s")]
    shares = [f"{percent(share, 3)} within ±{width}" for width, share in published["share_within"].items()]
    words = {
        "rounding": f"{digits['least']:.0f} to {digits['most']:.0f} in {digits['samples']:,} random roundings",
        "lost": f"{ends([100 * (1 - row['f'] / row['f_of_published']) for row in table_2])} %",
        "our_arms": ends([row["design"]["l2"] for row in by_length]),
        "printed_arms": ends([row["printed_l2"] for row in by_length]),
        "speed_violation": percent(max(scaled) / min(scaled) - 1),
        "search_time": f"{ends([row['seconds'] for row in optima if row['n'] in (None, 310)])} s",
        "share_of_start": percent(1 - digits["f_as_printed"] / digits["f"], 3),
        "normalized_arm": f"{normalized[0]['design']['l2']:.1f}",
        "normalized_bounds": " to ".join(f"{row['bound']:g}" for row in normalized),
        "normalized_lost": percent(1 - normalized[0]["f"] / normalized[0]["f_of_published"]),
        "printed_sum": f"{digits['f_as_printed']:.0f}",
        "initial_start": f"s(0) = {initial['height']:.4f}, v(0) = {initial['velocity']:.1f}",
        "closed_l5": f"{digits['closed_l5_of_initial']:.2f}",
        "velocity_change": change("velocity"),
        "early_velocity_change": change("early_velocity"),
        "even_shares": ", ".join(shares),
        "finest": f"{finest[0]['height_error']:.0e} mm on the initial design takes {finest[0]['ratio']:.0f} times",
        "finest_published": f"{finest[1]['height_error']:.0e} mm",
        "dead_point_below": f"{published['above_dead_point']:.2f} mm",
        "time_scale": f"{1e3 * abs(published['velocity'] / published['acceleration']):.0f} ms",
        "least_condition": f"{initial['least_condition']:.2f} before, {published['least_condition']:.2f} published",
        "least_condition_time": f"{ends([row['least_condition_time'] for row in (initial, published)], 2)} s",
    }
    return tables | words


# -- pictures ------------------------------------------------------------------------------------------------


def draw_lift(axes: Any, design: Design, turn: float, color: str, alpha: float = 1.0) -> dict[str, np.ndarray]:
    """Draw one pose; returns its joints."""
    pose = pose_at_turn(design, turn)
    points = {
        "O": (0.0, 0.0),
        "D": (-design.b, 0.0),
        "A": (-design.b, pose.height),
        "B": (pose.x, pose.y),
        "C": (design.l3 * pose.sin_turn - design.b, pose.root),
    }
    at = {name: np.array([float(value) for value in point]) for name, point in points.items()}
    axes.fill(*zip(at["A"], at["B"], at["C"]), color=color, alpha=0.18 * alpha, lw=0, zorder=2)
    for first, second, width in (("A", "B", 2.6), ("A", "C", 2.6), ("B", "C", 2.6), ("D", "C", 3.2)):
        axes.plot(*zip(at[first], at[second]), color=color, lw=width, alpha=alpha, solid_capstyle="round", zorder=3)
    barrel = at["B"] / np.hypot(*at["B"]) * 200.0
    axes.plot(*zip(at["O"], barrel), color=INK, lw=7, alpha=0.8 * alpha, solid_capstyle="butt", zorder=3)
    axes.plot(*zip(at["O"], at["B"]), color=GREY, lw=3, alpha=alpha, zorder=2.5)
    for point in at.values():
        axes.plot(*point, "o", ms=7, mfc="white", mec=INK, mew=1.5, zorder=5)
    # the platform on its slide
    (x, y), slide = at["A"], (-40, 590)
    axes.plot([x - 55, x + 55], [y + 14, y + 14], color=color, lw=5, alpha=alpha, zorder=3, solid_capstyle="butt")
    axes.plot([x, x], slide, color=GREY, lw=1.2, ls=(0, (6, 4)), zorder=1)
    return at


def picture_model() -> None:
    """The mechanism with its names, and three poses of its rise."""
    design = DESIGNS["initial"]
    bottom, bold = float(stroke(design, CYLINDER).turn_bottom), {"fontsize": 13, "weight": "bold"}
    with figure("lift_model.png", 1, 2, size=(11.6, 5.4)) as (_, (left, right)):
        turn = float(turn_at_length(design, 262.0))
        at = draw_lift(left, design, turn, BLUE)
        note(left, "slide  x = −b", (-480, 575), (8, 0))
        for name, offset in {"O": (10, -16), "D": (-16, -16), "A": (-24, -14), "B": (10, 2), "C": (10, 4)}.items():
            note(left, name, at[name], offset, **bold)
        for text, first, second, share, offset in (
            ("l2", "A", "B", 0.78, (-18, -10)),
            ("l3", "A", "C", 0.5, (-4, 8)),
            ("l4", "B", "C", 0.5, (9, 4)),
            ("l5", "D", "C", 0.28, (8, -8)),
            ("cylinder l1(t)", "O", "B", 0.5, (-20, 18)),
        ):
            note(left, text, (1 - share) * at[first] + share * at[second], offset, fontsize=11, style="italic")
        s = at["A"][1]
        for text, first, second, offset in (
            ("s", (-560, 0), (-560, s), (-14, 0)),
            ("b", (-480, -75), (0, -75), (0, -15)),
        ):
            left.annotate("", first, xytext=second, arrowprops={"arrowstyle": "<->", "color": INK, "lw": 1})
            middle = (0.5 * (first[0] + second[0]), 0.5 * (first[1] + second[1]))
            note(left, text, middle, offset, style="italic", fontsize=12)
        arc = np.linspace(-np.pi / 2, -np.pi / 2 + turn, 40)
        left.plot(-480 + 62 * np.cos(arc), s + 62 * np.sin(arc), color=ORANGE, lw=2, zorder=4)
        note(left, "T", (-480 + 72, s - 62), color=ORANGE, **bold)
        for x in (0.0, -480.0):
            left.plot([x - 26, x + 26], [-14, -14], color=INK, lw=2)
        left.set_title("One angle, the turn T, gives every pose")
        for share, alpha in ((1.0, 0.35), (0.55, 0.6), (0.0, 1.0)):
            draw_lift(right, design, share * bottom, BLUE, alpha)
        path = pose_at_turn(design, np.linspace(0, bottom, 200))
        corner = design.l3 * path.sin_turn - design.b, path.root
        for (x, y), color, label in (((path.x, path.y), ORANGE, "path of B"), (corner, GREEN, "path of C")):
            right.plot(x, y, color=color, lw=1.6, ls="--", zorder=4, label=label)
        right.legend(loc="upper right")
        right.set_title("From the collinear start to the top")
        for axes in (left, right):
            bare(axes, xlim=(-780, 90), ylim=(-110, 600))


def looks(results: dict) -> list[tuple[str, Design, str, str]]:
    """Name, design, colour and dashes of the three designs that are compared."""
    styles = (("before", GREY, "-"), ("published", BLUE, "-"), ("optimum (n = 310)", ORANGE, "--"))
    return [
        (name, Design(**row["lengths"]), color, dash) for row, (name, color, dash) in zip(results["designs"], styles)
    ]


def picture_motion(results: dict) -> None:
    """Height, velocity and acceleration over time: before, published, optimum."""
    starts = results["designs"]
    with figure("lift_motion.png", 3, 1, size=(8.6, 9.0), sharex=True) as (_, panels):
        for (name, design, color, dash), shift in zip(looks(results), (0, -14, 14)):
            duration = float(stroke(design, CYLINDER).duration)
            moved = motion(design, CYLINDER, duration * np.linspace(0, 1, 4001) ** 2)
            for axes, values in zip(panels, (moved.pose.height, moved.velocity, moved.acceleration)):
                axes.plot(moved.time, values, color=color, ls=dash, lw=2.2, label=name)
            panels[0].plot(duration, STROKE[1], "o", color=color, ms=6)
            note(panels[0], f"{duration:.2f} s", (duration, STROKE[1]), (shift, 8), ha="center", color=color)
        panels[0].set(ylabel="height s  (mm)", ylim=(180, 560))
        panels[0].legend(loc="lower right")
        panels[1].set(ylabel="velocity  (mm/s)", ylim=(0, 150))
        panels[1].axhline(50, color=INK, lw=0.8, ls=":")
        panels[2].set(ylabel="acceleration  (mm/s²)", ylim=(-70, 15), xlabel="time  (s)")
        for axes, key, unit, at, text_at in (
            (panels[1], "velocity", "mm/s", (0.02, 146), (1.0, 132)),
            (panels[2], "acceleration", "mm/s²", (0.12, -68), (1.0, -60)),
        ):
            values = ", ".join(significant(row[key]).replace("-", "−") for row in starts)
            text, arrow = f"off the scale at t = 0: {values} {unit}", {"arrowstyle": "->", "color": INK, "lw": 0.8}
            axes.annotate(text, at, xytext=text_at, arrowprops=arrow, fontsize=9)


def picture_integration(results: dict) -> None:
    """Error against run time."""
    styles = {
        "Euler": (GREY, "s", 3e1),
        "RK4": (BLUE, "o", 3e2),
        "RK45": (GREEN, "^", 3e1),
        "DOP853": (RED, "D", 3e1),
    }
    with figure("lift_integration.png", 1, 2, size=(11.2, 4.6), sharey=True) as (_, panels):
        for axes, own in zip(panels, results["closed_form"]):
            for method, (color, marker, level) in styles.items():
                rows = [
                    row for row in results["integration"] if (row["design"], row["method"]) == (own["design"], method)
                ]
                some = [row for row in rows if row["height_error"] is not None]
                points = [row["seconds"] for row in some], [row["height_error"] for row in some]
                axes.loglog(*points, marker=marker, color=color, lw=1.4, ms=7, label=method)
                for row in (row for row in rows if row["height_error"] is None):
                    axes.plot(row["seconds"], level, marker="x", color=color, ms=9, mew=2.2)
                    text = f"{method}, {row['setting']}: diverges"
                    note(axes, text, (row["seconds"], level), (8, -4), fontsize=8.5)
            star = {"ms": 17, "color": ORANGE, "mec": INK, "mew": 0.6, "label": f"closed form,\n{POSES:,} poses"}
            axes.plot(1e-3 * own["from_time_ms"], own["height_error"], "*", **star)
            axes.set(title=f"{own['design']} design", xlabel="run time  (s)")
        panels[0].set(ylabel="largest error of the height  (mm)", ylim=(1e-14, 3e3))
        panels[1].legend(loc="lower right")


def picture_objective() -> None:
    """The objectives along l4 = l2: why n decides, why the continuous one has no optimum, and why one has."""
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    arms, dot = np.geomspace(150, 2000, 1500), {"ms": 7, "mec": INK, "mew": 0.6}
    designs = project(arms, arms, CYLINDER.length, *STROKE)
    with figure("lift_objective.png", 1, 2, size=(11.2, 4.6)) as (_, (left, right)):
        for n, color in zip((100, 200, 310, 1000), ("#bfdbfe", "#60a5fa", BLUE, "#1e3a5f")):
            values = Evaluator(task(Objective("discrete", n)))(designs)
            left.plot(arms, values, color=color, lw=2.2, label=f"discrete, n = {n}")
            left.plot(arms[np.nanargmin(values)], np.nanmin(values), "o", color=color, **dot)
        values = Evaluator(task(Objective("continuous")))(designs)
        left.plot(arms, values, color=ORANGE, lw=2.2, ls="--", label="continuous")
        left.axvline(ARMS[CYLINDER.length], color=INK, lw=0.8, ls=":")
        note(left, "published", (ARMS[CYLINDER.length], 1530), (4, 0), fontsize=9)
        left.set(xlim=(50, 2200), ylim=(0, 1600), ylabel="f  (mm²/s²)")
        left.set_title("f rewards slowness; its optimum moves with n")
        left.legend(loc="upper left", frameon=True, framealpha=1.0, edgecolor="none")
        values = Evaluator(task(Objective("normalized")))(designs)
        at = int(np.nanargmin(values))
        right.plot(arms, values, color=GREEN, lw=2.4)
        right.plot(arms[at], values[at], "o", color=GREEN, **dot)
        note(right, f"l2 = {arms[at]:.0f}", (arms[at], values[at]), (0, -18), ha="center")
        right.set(ylim=(0.09, 0.2), ylabel="f / v̄²", title="Normalized: an optimum of its own")
        for axes in (left, right):
            axes.set(xscale="log", xlabel="l2 = l4  (mm)", xticks=[200, 300, 500, 1000, 2000])
            axes.xaxis.set_major_formatter(ScalarFormatter())
            axes.xaxis.set_minor_formatter(NullFormatter())


def picture_designs(results: dict) -> None:
    """Before, published and optimum at the start and at the top, to one scale."""
    with figure("lift_designs.png", 1, 3, size=(12.5, 3.4), sharey=True) as (_, panels):
        for axes, (name, design, color, _) in zip(panels, looks(results)):
            limits = stroke(design, CYLINDER)
            draw_lift(axes, design, float(limits.turn_bottom), color, alpha=0.55)
            draw_lift(axes, design, 0.0, color)
            path = pose_at_turn(design, np.linspace(0, float(limits.turn_bottom), 200))
            axes.plot(path.x, path.y, color=INK, lw=1.1, ls=":", zorder=4)
            axes.set_title(f"{name}: {float(limits.duration):.2f} s")
            bare(axes, xlim=(-970, 90), ylim=(-110, 590))


def draw(results: dict) -> None:
    """The pictures of given results."""
    picture_model()
    picture_motion(results)
    picture_integration(results)
    picture_objective()
    picture_designs(results)


def main() -> None:
    """Measure, and write the results, the pictures and the documents' numbers."""
    optima = measure_optima()
    results = {
        "integration": measure_integration(),
        "closed_form": measure_closed_form(),
        "published": measure_published(),
        "stability": measure_stability(),
        "table_2": measure_table_2(),
        "optima": optima,
        "designs": measure_designs(optima[0]["design"]),
    }
    report.publish("lift", results)


if __name__ == "__main__":
    main()
