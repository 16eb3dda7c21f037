"""Pictures of docs/lift.md: the mechanism, its motions, errors against run time, the objectives and three designs."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from benchmarks.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, arrow, bare, curve, figure, note
from benchmarks.report import ROOT, significant
from synthesis.scenes.lift.motion import motion, stroke
from synthesis.scenes.lift.optimum import Evaluator, Objective, Task
from synthesis.scenes.lift.pose import Cylinder, Design, pose_at_turn, turn_at_length
from tests.oracles import lift as oracle

REFERENCE = json.loads((ROOT / "tests/reference/lift_acceptance.json").read_text())
DESIGNS = {"initial": Design(*REFERENCE["designs"]["initial"]), "published": Design(*REFERENCE["designs"]["optimum"])}
CYLINDER = Cylinder(220.0, 100.0)
STROKE = (200.0, 510.0)
"""Heights of the published designs at the start and at the top, mm."""
ARMS = {float(length): row["arm"] for length, row in REFERENCE["table_2"].items()}
"""Printed l2 = l4 by cylinder length l1', mm."""
POSES = 57_201
"""Number of poses for which time and error of the closed form are measured."""


def task(objective: Objective, bound: float = 600.0, cylinder: Cylinder = CYLINDER) -> Task:
    """Return the published problem with another objective, bound or cylinder."""
    return Task(cylinder, *STROKE, objective, bound)


def on_constraints(problem: Task, stretch: float = 1.0) -> Design:
    """Return the published design for a problem, projected onto the constraints that its rounded digits violate."""
    arm = stretch * ARMS[problem.cylinder.length]
    return oracle.closed_designs(arm, arm, problem)[0]


def draw_lift(axes: Any, design: Design, turn: float, color: str, alpha: float = 1.0) -> dict[str, np.ndarray]:
    """Draw a pose and return its joints."""
    pose = pose_at_turn(design, turn)
    points = {
        "O": (0.0, 0.0),
        "D": (-design.b, 0.0),
        "A": (-design.b, pose.height),
        "B": (pose.x, pose.y),
        "C": (design.l3 * pose.sin_turn - design.b, pose.c_height),
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
    """Draw the mechanism with its symbols, and three poses of its rise."""
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
        for text, ends, offset in (("s", [(-560, s), (-560, 0)], (-14, 0)), ("b", [(0, -75), (-480, -75)], (0, -15))):
            arrow(left, *ends, shape="<->", lw=1)
            note(left, text, np.mean(ends, axis=0), offset, style="italic", fontsize=12)
        arc = np.linspace(-np.pi / 2, -np.pi / 2 + turn, 40)
        left.plot(-480 + 62 * np.cos(arc), s + 62 * np.sin(arc), color=ORANGE, lw=2, zorder=4)
        note(left, "T", (-480 + 72, s - 62), color=ORANGE, **bold)
        for x in (0.0, -480.0):
            left.plot([x - 26, x + 26], [-14, -14], color=INK, lw=2)
        left.set_title("One angle, the turn T, gives every pose")
        for share, alpha in ((1.0, 0.35), (0.55, 0.6), (0.0, 1.0)):
            draw_lift(right, design, share * bottom, BLUE, alpha)
        path = pose_at_turn(design, np.linspace(0, bottom, 200))
        corner = design.l3 * path.sin_turn - design.b, path.c_height
        for (x, y), color, label in (((path.x, path.y), ORANGE, "path of B"), (corner, GREEN, "path of C")):
            right.plot(x, y, color=color, lw=1.6, ls="--", zorder=4, label=label)
        right.legend(loc="upper right")
        right.set_title("From the collinear start to the top")
        for axes in (left, right):
            bare(axes, xlim=(-780, 90), ylim=(-110, 600))


def looks(results: dict) -> list[tuple[str, Design, str, str]]:
    """Return name, design, colour and line style of the three designs that are compared."""
    styles = (("before", GREY, "-"), ("published", BLUE, "-"), ("optimum (n = 310)", ORANGE, "--"))
    return [
        (name, Design(**row["lengths"]), color, dash) for row, (name, color, dash) in zip(results["designs"], styles)
    ]


def picture_motion(results: dict) -> None:
    """Draw height, velocity and acceleration over time, for the three designs."""
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
            arrow(axes, text_at, at, f"off the scale at t = 0: {values} {unit}", "->")


def picture_integration(results: dict) -> None:
    """Draw error against run time."""
    styles = {
        "Euler": (GREY, "s", 3e1),
        "RK4": (BLUE, "o", 3e2),
        "RK45": (GREEN, "^", 3e1),
        "DOP853": (RED, "D", 3e1),
    }
    with figure("lift_integration.png", 1, 2, size=(11.2, 4.6), sharey=True) as (_, panels):
        for axes, own in zip(panels, results["closed_form"]):
            for method, (color, marker, level) in styles.items():
                case = own["design"], method
                rows = [row for row in results["integration"] if (row["design"], row["method"]) == case]
                look = {"marker": marker, "color": color, "lw": 1.4, "ms": 7, "label": method}
                curve(axes, rows, "seconds", "height_error", **look)
                for row in (row for row in rows if row["height_error"] is None):
                    axes.plot(row["seconds"], level, marker="x", color=color, ms=9, mew=2.2)
                    text = f"{method}, {row['setting']}: diverges"
                    note(axes, text, (row["seconds"], level), (8, -4), fontsize=8.5)
            star = {"ms": 17, "color": ORANGE, "mec": INK, "mew": 0.6, "label": f"closed form,\n{POSES:,} poses"}
            axes.plot(1e-3 * own["from_time_ms"], own["height_error"], "*", **star)
            axes.set(title=f"{own['design']} design", xlabel="run time  (s)", xscale="log", yscale="log")
        panels[0].set(ylabel="largest error of the height  (mm)", ylim=(1e-14, 3e3))
        panels[1].legend(loc="lower right")


def picture_objective() -> None:
    """Draw the objectives along l4 = l2: the discrete optimum depends on n, the continuous objective has none inside."""
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    arms, dot = np.geomspace(150, 2000, 1500), {"ms": 7, "mec": INK, "mew": 0.6}
    designs = [oracle.closed_designs(arm, arm, task(Objective("continuous"))) for arm in arms]
    kept = [found[0] for found in designs if found]
    arms = np.array([design.l2 for design in kept])
    designs = Design(*np.array([design.as_tuple() for design in kept]).T)
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
    """Draw the three designs at the start and at the top, to the same scale."""
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
    """Draw all pictures."""
    picture_model()
    picture_motion(results)
    picture_integration(results)
    picture_objective()
    picture_designs(results)
