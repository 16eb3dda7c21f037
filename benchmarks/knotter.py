"""Measures the knotter and draws its pictures: ``python -m benchmarks.knotter``.

Writes ``benchmarks/results/knotter.json``, ``docs/img/knotter_*.png`` and the tables between the markers of
``docs/knotter.md``. Seeded; only the times differ from run to run, and they are printed as ratios.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import mpmath as mp
import numpy as np

from synthesis.knotter import d_knotter
from synthesis.knotter.mechanism import Mechanism
from synthesis.knotter.segment_triangle import classify, crossing_point, inside, orientations
from synthesis.knotter.needle import Needle
from synthesis.knotter.study import solve, study

ROOT = Path(__file__).parents[1]
PAIRS = [(alpha1, alpha3) for alpha1 in (0, 10, 20) for alpha3 in (20, 25, 30)]
PUBLISHED_FEASIBLE = {(0, 30), (10, 25), (10, 30), (20, 25), (20, 30)}
LINE_1, LINE_3 = np.linspace(0.0, 20.0, 30), np.linspace(20.0, 30.0, 30)
REPEATS = 5


def machine(alpha1: float, alpha3: float, **others: float) -> Mechanism:
    """The reference knotter at a pair in degrees."""
    return d_knotter.mechanism({"alpha1": float(np.radians(alpha1)), "alpha3": float(np.radians(alpha3)), **others})


def seconds(function: Callable[[], object]) -> float:
    """The best of a few runs."""
    best = np.inf
    for _ in range(REPEATS):
        start = time.process_time()
        function()
        best = min(best, time.process_time() - start)
    return best


# Predicates


def angle_sum(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Degrees under which a point of the plane sees a triangle's edges (eqs 15 and 30): 360 inside, by arccosines."""
    total = np.zeros(len(point))
    with np.errstate(all="ignore"):
        for start, stop in ((a, b), (b, c), (c, a)):
            u, v = start - point, stop - point
            cosine = np.sum(u * v, axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
            total += np.degrees(np.arccos(cosine))
    return total


def predicate_errors() -> list[dict]:
    """Wrong verdicts beside the edge S3S4, in percent; the truth by rational arithmetic."""
    random = np.random.default_rng(2018)
    a, b, c = (np.array(d_knotter.POINTS[name]) for name in ("S3", "S4", "S5"))
    along = b - a
    inward = np.cross(along, (1.0, 0.0, 0.0))
    inward *= np.sign(inward @ (c - a)) / np.linalg.norm(inward)
    rows = []
    for distance in (1e-1, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        side = np.repeat([1.0, -1.0], 400)
        point = a + random.uniform(0.02, 0.98, (800, 1)) * along + (side * distance)[:, None] * inward
        truth = np.array([all(u > 0 for u in _exact_sides(row, a, b, c)) for row in point])
        total = angle_sum(point, a, b, c)
        row = {"distance_mm": distance, "equal_360": _percent((total == 360.0) != truth)}
        for tolerance in (1e-9, 1e-6, 1e-3):
            row[f"within_{tolerance:g}"] = _percent((np.abs(total - 360.0) <= tolerance) != truth)
        row["nan"] = _percent(np.isnan(total))
        p, q = np.add(point, (3.0, 0.0, 0.0)), np.subtract(point, (2.0, 0.0, 0.0))
        row["orientation"] = _percent(
            inside(orientations(tuple(p.T), tuple(q.T), tuple(a), tuple(b), tuple(c))) != truth
        )
        row["classify"] = _percent((classify(p, q, a, b, c) == 0) != truth)
        rows.append(row)
    return rows


def _exact_sides(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> list[Fraction]:
    p, a, b, c = ([Fraction(float(x)) for x in at[1:]] for at in (point, a, b, c))

    def area(u, v, w) -> Fraction:
        return (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])

    whole = area(a, b, c)
    return [area(u, v, p) * whole for u, v in ((a, b), (b, c), (c, a))]


def _percent(wrong: np.ndarray) -> float:
    return float(100.0 * np.mean(wrong))


def predicate_times() -> dict:
    """The sum of angles against the orientations on the same 100,000 crossings."""
    random = np.random.default_rng(7)
    a, b, c = (np.array(d_knotter.POINTS[name]) for name in ("S3", "S4", "S5"))
    point = random.dirichlet((1, 1, 1), 100_000) @ np.array([a, b, c])
    p, q = tuple(np.add(point, (3.0, 0.0, 0.0)).T), tuple(np.subtract(point, (2.0, 0.0, 0.0)).T)
    corners = tuple(a), tuple(b), tuple(c)
    total = angle_sum(point, a, b, c)
    return {
        "angle_sum_over_orientations": seconds(lambda: angle_sum(point, a, b, c))
        / seconds(lambda: inside(orientations(p, q, *corners))),
        "inside_and_equal_360_percent": _percent(total == 360.0),
        "largest_miss_of_360_degrees": float(np.nanmax(np.abs(total - 360.0))),
        "inside_by_orientations_percent": _percent(inside(orientations(p, q, *corners))),
    }


# Events: error against run time


def exact_entry(alpha1: float, alpha3: float, guess: float, edge: int) -> mp.mpf:
    """The wrap's entry in 40 digits, near a guess."""
    names = ("S3", "S4", "S5")
    (y0, z0), (y1, z1) = (d_knotter.POINTS[names[k % 3]][1:] for k in (edge, edge + 1))
    first, third = mp.mpf(float(np.radians(alpha1))), mp.mpf(float(np.radians(alpha3)))

    def side(alpha: mp.mpf) -> mp.mpf:
        r = _rotation("j", -(mp.mpf(float(np.radians(23.5))) + alpha / 2)) * mp.matrix(d_knotter.POINTS["S0"])
        r = _rotation("i", first) * (r - mp.matrix([0, 20, 0])) + mp.matrix([54, 0, -136])
        r = _rotation("j", mp.mpf(d_knotter.ALPHA2)) * (_rotation("i", third) * r) + mp.matrix([0, 0, 142])
        p, q = _rotation("k", alpha) * r, mp.matrix(d_knotter.POINTS["S1"])
        at = p + p[0] / (p[0] - q[0]) * (q - p)
        return (y1 - y0) * (at[2] - z0) - (z1 - z0) * (at[1] - y0)

    with mp.workdps(40):
        return mp.findroot(side, mp.mpf(guess))


def _rotation(axis: str, angle: mp.mpf) -> mp.matrix:
    c, s = mp.cos(angle), mp.sin(angle)
    rows = {
        "i": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "j": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "k": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return mp.matrix(rows[axis])


def scanned_entries(items: Mechanism, count: int, step: float, interpolate: bool = False) -> np.ndarray:
    """The entries by a scan of the whole range: the first step inside, or a straight line back from it.

    All steps of a few items at once, which is as fast as numpy makes a scan.
    """
    driver = np.radians(np.arange(0.0, 180.0, step))
    few = max(1, 50_000 // len(driver))
    found = []
    for start in range(0, count, few):
        item = np.arange(start, min(start + few, count))[:, None]
        shape = (len(item), len(driver))
        positions = d_knotter.wrap().positions(items.item(item), driver)
        signs = np.array([np.broadcast_to(u, shape) for u in orientations(*positions)])
        hits = inside(tuple(signs))
        at = np.argmax(hits, axis=1)
        row = np.arange(len(item))
        entry = np.where(hits[row, at], driver[at], np.nan)
        if interpolate:
            before, after = signs[:, row, at - 1], signs[:, row, at]
            with np.errstate(all="ignore"):
                share = np.where(before * after < 0, before / (before - after), 0.0).max(axis=0)
            entry = entry - (1 - share) * np.radians(step)
        found.append(entry)
    return np.concatenate(found)


def summed_entry(item: Mechanism, step: float) -> float:
    """The source's way: a loop over the steps, the crossing by the quotient, inside if the angles add up to 360."""
    a, b, c = (np.array(d_knotter.POINTS[name]) for name in ("S3", "S4", "S5"))
    condition = d_knotter.wrap()
    for degrees in np.arange(0.0, 180.0, step):
        corners = condition.positions(item, np.radians(degrees))
        point = np.array([crossing_point(*corners)])
        if abs(angle_sum(point, a, b, c)[0] - 360.0) <= 1e-6:
            return np.radians(degrees)
    return np.nan


def event_errors() -> list[dict]:
    """Largest error over the nine pairs, and time per pair, of 900 pairs at once, as a multiple of the cells'."""
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    nine = {name: np.array(np.radians(column)) for name, column in zip(grid, np.transpose(PAIRS))}
    many = {name: values.ravel() for name, values in zip(grid, np.meshgrid(*np.radians([LINE_1, LINE_3])))}
    cells = d_knotter.wrap().evaluate(d_knotter.mechanism(nine), 9)
    exact = [
        exact_entry(*pair, float(cells.enter[row]), int(cells.opened_by[row]) - 2) for row, pair in enumerate(PAIRS)
    ]
    methods = {}
    for step in (1.0, 0.1, 0.01):
        methods[f"scan, {step:g} deg"] = lambda of, count, step=step: scanned_entries(of, count, step)
    for step in (1.0, 0.1):
        methods[f"scan and straight line, {step:g} deg"] = lambda of, count, step=step: scanned_entries(
            of, count, step, True
        )
    methods["cells, 900 pairs at once"] = lambda of, count: d_knotter.wrap().evaluate(of, count).enter

    def error(found: np.ndarray) -> float:
        return max(abs(float(mp.degrees(mp.mpf(float(at)) - truth))) for at, truth in zip(found, exact))

    rows = [
        {
            "method": name,
            "max_error_deg": error(method(d_knotter.mechanism(nine), 9)),
            "ms_per_pair": 1e3 * seconds(lambda method=method: method(d_knotter.mechanism(many), 900)) / 900,
        }
        for name, method in methods.items()
    ]
    items = [machine(*pair) for pair in PAIRS]
    loop = [summed_entry(item, 1.0) for item in items]
    spent = 1e3 * seconds(lambda: [summed_entry(item, 1.0) for item in items]) / 9
    rows.insert(0, {"method": "loop and sum of angles, 1 deg", "max_error_deg": error(loop), "ms_per_pair": spent})
    alone = 1e3 * seconds(lambda: [d_knotter.wrap().evaluate(item, 1) for item in items]) / 9
    rows.append({"method": "cells, one pair", "max_error_deg": rows[-1]["max_error_deg"], "ms_per_pair": alone})
    for row in rows:
        row["time_over_cells"] = row["ms_per_pair"] / rows[-2]["ms_per_pair"]
    return rows


def short_windows() -> list[dict]:
    """Which scan sees the window that closes as d5 grows, and what the cells find."""
    (limit,), _ = solve(machine(10, 25), d_knotter.wrap(), "d5", (20.0, 120.0))
    rows = []
    for short_of in (1.0, 0.3, 0.03, 1e-2, 1e-4, 1e-6, 1e-8):
        item = machine(10, 25, d5=limit.value - short_of)
        found = d_knotter.wrap().evaluate(item, 1)
        row = {"short_of_mm": short_of, "width_deg": float(np.degrees(found.leave[0] - found.enter[0]))}
        for step in (2.0, 1.0, 0.1, 0.01):
            row[f"scan_{step:g}"] = bool(np.isfinite(scanned_entries(item, 1, step)[0]))
        row["cells"] = bool(found.holds[0])
        rows.append(row)
    return rows


def grid_time() -> dict:
    """101 x 101 pairs under the three conditions, and under the wrap alone against a scan of 0.1 degrees."""
    first, third = np.meshgrid(np.radians(np.linspace(0, 30, 101)), np.radians(np.linspace(15, 35, 101)))
    items, count = d_knotter.mechanism({"alpha1": first.ravel(), "alpha3": third.ravel()}), first.size
    start = time.process_time()
    holds = [condition.evaluate(items, count).holds for condition in d_knotter.conditions()]
    whole = time.process_time() - start
    start = time.process_time()
    d_knotter.wrap().evaluate(items, count)
    wrap = time.process_time() - start
    start = time.process_time()
    scanned_entries(items, count, 0.1)
    scan = time.process_time() - start
    return {
        "pairs": count,
        "seconds": whole,
        "feasible": int(np.logical_and.reduce(holds).sum()),
        "scan_0.1_over_cells_wrap": scan / wrap,
    }


# Published against ours


def published() -> list[list[str]]:
    """Rows of what the source prints and what comes out here."""
    needle = Needle()
    low, high = np.degrees(needle.free_range())
    length = needle.lay(d_knotter.ALPHA2)
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    result = study(d_knotter.mechanism(), grid, d_knotter.conditions())
    feasible = ", ".join(f"({PAIRS[row][0]}, {PAIRS[row][1]})" for row in np.flatnonzero(result.feasible))
    if {PAIRS[row] for row in np.flatnonzero(result.feasible)} != PUBLISHED_FEASIBLE:
        raise ValueError(f"the feasible pairs are no longer the published ones: {feasible}")
    return [
        ["needle free (eq 4)", "alpha2 > 7 deg", f"{low:.6f} < alpha2 < {high:.6f} deg; 7 is the first whole degree"],
        ["d5 at alpha2 = 8 deg (eq 5)", "54 mm", f"{length:.6f} mm; 54 is that cut off, not rounded"],
        ["alpha2 for d5 = 54 mm", "8 deg", f"{np.degrees(needle.angles_for_lay(54.0)[0]):.6f} deg"],
        ["wrap holds, 9 pairs", "7 of 9", f"{result.conditions['wrap'].holds.sum()} of 9, the same ones"],
        ["clearance holds, 7 pairs", "5 of 7", "5 of 7, the same ones"],
        ["feasible pairs", feasible, "the same five"],
    ]


# Pictures

INK, PAPER, ROPE, DISC, BILL, HOOK = "#22303c", "#ffffff", "#c8553d", "#4a7c8c", "#8a6d3b", "#588157"


def _style(plt) -> None:
    plt.rcParams.update(
        {
            "font.family": "DejaVu Sans",
            "font.size": 9,
            "axes.edgecolor": INK,
            "axes.labelcolor": INK,
            "text.color": INK,
            "xtick.color": INK,
            "ytick.color": INK,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "figure.dpi": 150,
        }
    )


AZIMUTH, ELEVATION = np.radians(-62.0), np.radians(18.0)
RIGHT = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
UP = np.array([-np.sin(ELEVATION) * np.cos(AZIMUTH), -np.sin(ELEVATION) * np.sin(AZIMUTH), np.cos(ELEVATION)])
LABELS = {
    "wrap": {"S0": (7, 5), "S1": (-4, -13), "S3": (-1, 9), "S4": (9, -9), "S5": (9, 9), "E1": (12, -3)},
    "bite": {"S0": (9, -5), "S7": (1, -14), "O5": (15, 3), "S8": (-10, -8), "S9": (-2, 9), "E2": (9, -9)},
}
"""Offsets of the labels of the drawing, in points."""


def draw_frames(plt, path: Path) -> None:
    """The frames and the rope at the wrap and at the bite, pair (10, 25), in parallel projection from the bearing."""
    item = machine(10, 25)
    scenes = (
        ("wrap", d_knotter.wrap(), BILL, "E1"),
        ("bite", d_knotter.bite(), HOOK, "E2"),
    )
    figure, panels = plt.subplots(1, 2, figsize=(11.5, 4.7), sharex=True, sharey=True)
    for axes, (name, condition, colour, mark) in zip(panels, scenes):
        found = condition.evaluate(item, 1)
        alpha = found.enter[0]

        def drawn(point: tuple, frame: str, alpha=alpha) -> np.ndarray:
            at = np.array([float(x) for x in item.carry(point, frame, "seat", np.float64(alpha))])
            return np.array([RIGHT @ at, UP @ at])

        turn = np.linspace(0, 2 * np.pi, 300)
        rim = np.array([RIGHT, UP]) @ np.array([30 * np.cos(turn), 0 * turn, 30 * np.sin(turn)])
        axes.fill(*rim, color=DISC, alpha=0.10, lw=0)
        axes.plot(*rim, color=DISC, lw=1.8)
        sweep = [np.broadcast_to(x, turn.shape) for x in item.position(condition.segment[1], "seat", turn)]
        axes.plot(*(np.array([RIGHT, UP]) @ np.array(sweep)), color=BILL, lw=0.7, ls=(0, (5, 3)), alpha=0.8)
        bodies = (
            ("u3", DISC, "disc u3", (22, -46)),
            ("u4", BILL, "bill u4", (-58, -4) if name == "wrap" else (-44, 8)),
            ("u5", HOOK, "hook u5", (-56, 8)),
        )
        for frame, tone, label, offset in bodies:
            origin = drawn((0.0, 0.0, 0.0), frame)
            for axis, letter in zip(np.eye(3), "ijk"):
                tip = drawn(tuple(17 * axis), frame)
                axes.annotate(
                    "",
                    tip,
                    origin,
                    arrowprops={"arrowstyle": "-|>", "color": tone, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
                )
                beyond = origin + (tip - origin) * (1 + 3.0 / max(np.linalg.norm(tip - origin), 3.0))
                axes.text(*beyond, letter, fontsize=8, color=tone, ha="center", va="center")
            axes.annotate(label, origin, offset, textcoords="offset points", color=tone, fontsize=9, weight="bold")
        axes.plot(
            *np.transpose([drawn((0.0, 0.0, 0.0), "u4"), drawn((0.0, 0.0, 0.0), "u5")]), color=HOOK, lw=1.0, ls=":"
        )
        corners = {corner: drawn(*item.points[corner][::-1]) for corner in condition.triangle}
        outline = np.array(list(corners.values()))
        axes.fill(*outline.T, color=colour, alpha=0.30, lw=0)
        axes.plot(*np.vstack([outline, outline[:1]]).T, color=colour, lw=1.2)
        wanted = outline[[condition.enter, (condition.enter + 1) % 3]]
        axes.plot(*wanted.T, color=colour, lw=3.2, solid_capstyle="round")
        ends = {end: drawn(*item.points[end][::-1]) for end in condition.segment}
        axes.plot(*np.transpose(list(ends.values())), color=ROPE, lw=2.2, marker="o", ms=4.5)
        crossing = drawn(tuple(found.point[0]), condition.frame)
        axes.plot(*crossing, "o", mfc=PAPER, mec=ROPE, ms=8, mew=1.8)
        tones = {**dict.fromkeys(corners, colour), **dict.fromkeys(ends, ROPE), mark: ROPE}
        for point, at in {**corners, **ends, mark: crossing}.items():
            axes.annotate(
                point,
                at,
                LABELS[name][point],
                textcoords="offset points",
                color=tones[point],
                fontsize=8.5,
                ha="center",
                va="center",
            )
        edge = condition.edge_names[condition.enter]
        axes.set_title(f"{name}: {mark} enters through {edge} at $\\alpha$ = {np.degrees(alpha):.4f}°", fontsize=11)
        axes.set_aspect("equal")
        axes.set_axis_off()
    low = axes.get_xlim()[0]
    axes.plot([low + 4, low + 24], [axes.get_ylim()[0] + 3] * 2, color=INK, lw=2)
    axes.annotate(
        "20 mm", (low + 14, axes.get_ylim()[0] + 3), (0, 7), textcoords="offset points", ha="center", fontsize=8
    )
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def draw_paths(plt, path: Path) -> None:
    """Where the rope's crossing runs in the planes of the two triangles, at the nine pairs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8))
    tones = plt.get_cmap("viridis")(np.linspace(0.05, 0.85, 3))
    for axes, condition, plane, names in (
        (left, d_knotter.wrap(), (1, 2), ("S3", "S4", "S5")),
        (right, d_knotter.bite(), (0, 2), ("O5", "S8", "S9")),
    ):
        for (alpha1, alpha3), row in zip(PAIRS, range(9)):
            item = machine(alpha1, alpha3)
            driver = np.linspace(*condition.window, 1500)
            corners = condition.positions(item, driver)
            signs = orientations(*corners)
            crossing = np.array([np.broadcast_to(x, driver.shape) for x in crossing_point(*corners)])[list(plane)]
            crossing = np.where(signs[0] * signs[1] < 0, crossing, np.nan)
            dash = ("-", "--", ":")[row % 3]
            axes.plot(*crossing, color=tones[row // 3], ls=dash, lw=1.1, alpha=0.9)
            found = condition.evaluate(item, 1)
            if found.windows[0]:
                spot = found.point[0][list(plane)]
                fill = tones[row // 3] if found.holds[0] else PAPER
                axes.plot(*spot, "o", ms=5.5, mfc=fill, mec=tones[row // 3], mew=1.3, zorder=5)
        at = condition.evaluate(machine(10, 25), 1).enter[0]
        corners = np.array([[float(x) for x in c] for c in condition.positions(machine(10, 25), np.float64(at))[2:]])
        corners = corners[:, list(plane)]
        axes.fill(*corners.T, color=BILL if axes is left else HOOK, alpha=0.18, lw=0)
        axes.plot(*np.vstack([corners, corners[:1]]).T, color=BILL if axes is left else HOOK, lw=1.0)
        wanted = corners[[condition.enter, (condition.enter + 1) % 3]]
        axes.plot(*wanted.T, color=ROPE, lw=3, solid_capstyle="round", zorder=4)
        for name, corner in zip(names, corners):
            away = corner - corners.mean(axis=0)
            axes.annotate(
                name, corner, 13 * away / np.linalg.norm(away), textcoords="offset points", ha="center", va="center"
            )
        margin = 0.2 * np.ptp(corners, axis=0).max()
        low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.grid(color="#dde3e6", lw=0.6)
    left.set(title="Wrap: paths of E1 in the bill's plane", xlabel="j of u4, mm", ylabel="k of u4, mm")
    right.set(title="Bite: paths of E2 in the hook's plane", xlabel="i of u5, mm", ylabel="k of u5, mm")
    lines = [plt.Line2D([], [], color=tone, label=f"$\\alpha_1$ = {a}°") for tone, a in zip(tones, (0, 10, 20))]
    lines += [
        plt.Line2D([], [], color=INK, ls=dash, label=f"$\\alpha_3$ = {a}°")
        for dash, a in zip(("-", "--", ":"), (20, 25, 30))
    ]
    lines += [plt.Line2D([], [], color=ROPE, lw=3, label="wanted edge")]
    lines += [plt.Line2D([], [], ls="", marker="o", mfc=INK, mec=INK, label="entry, holds")]
    lines += [plt.Line2D([], [], ls="", marker="o", mfc=PAPER, mec=INK, label="entry, fails")]
    figure.legend(handles=lines, loc="lower center", ncol=9, frameon=False, fontsize=8)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    figure.savefig(path)
    plt.close(figure)


def draw_map(plt, path: Path) -> None:
    """Feasible pairs and the smallest margin over (alpha1, alpha3), with the limit of each condition."""
    first, third = np.linspace(-5, 30, 281), np.linspace(15, 40, 251)
    result = study(
        d_knotter.mechanism(), {"alpha1": np.radians(first), "alpha3": np.radians(third)}, d_knotter.conditions()
    )
    shape = (len(first), len(third))
    margin = result.margin.reshape(shape)
    figure, axes = plt.subplots(figsize=(8.2, 5.6))
    axes.contourf(first, third, margin.T, [-1e9, 0], colors=["#f3efe9"])
    levels = np.arange(0, np.ceil(margin.max()) + 0.5, 1.0)
    filled = axes.contourf(first, third, margin.T, levels, cmap="YlGn", extend="max")
    lines = axes.contour(first, third, margin.T, levels[1:], colors=INK, linewidths=0.5)
    axes.clabel(lines, fmt="%g", fontsize=7)
    for condition, colour in zip(d_knotter.conditions(), (BILL, DISC, HOOK)):
        limits = []
        for alpha1 in np.linspace(-5, 30, 36):
            found, _ = solve(machine(alpha1, 25), condition, "alpha3", tuple(np.radians([15, 40])), samples=65)
            limits += [(alpha1, np.degrees(limit.value)) for limit in found]
        axes.plot(*np.transpose(limits), color=colour, lw=2.2)
    label = {"boxstyle": "round,pad=0.15", "fc": PAPER, "ec": "none", "alpha": 0.8}
    for pair in PAIRS:
        good = pair in PUBLISHED_FEASIBLE
        axes.plot(*pair, "o", ms=8, mfc=INK if good else PAPER, mec=INK, mew=1.4, zorder=5)
        axes.annotate(
            f"{pair[0]}, {pair[1]}", pair, (8, 5), textcoords="offset points", fontsize=8, zorder=6, bbox=label
        )
    handles = [
        plt.Line2D([], [], color=c, lw=2.2, label=f"limit of the {n}")
        for n, c in (("wrap", BILL), ("clearance", DISC), ("bite", HOOK))
    ]
    handles += [plt.Line2D([], [], ls="", marker="o", ms=7, mfc=INK, mec=INK, label="published: ties")]
    handles += [plt.Line2D([], [], ls="", marker="o", ms=7, mfc=PAPER, mec=INK, label="published: fails")]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncol=5, frameon=False, fontsize=8)
    figure.colorbar(filled, ax=axes, label="smallest margin, mm", pad=0.02)
    axes.set(xlabel=r"disc's spatial angle $\alpha_1$, degrees", ylabel=r"bill's spatial angle $\alpha_3$, degrees")
    axes.set_title("Which pairs tie the knot, and how far they are from failing", fontsize=11)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def draw_errors(plt, path: Path, events: list[dict]) -> None:
    """Error against run time of each way to find the entry."""
    figure, axes = plt.subplots(figsize=(7.6, 4.6))
    groups = {
        "loop": ("#9a8c98", "loop and sum of angles"),
        "scan,": (DISC, "scan"),
        "scan and": (BILL, "scan and straight line"),
        "cells": (ROPE, "cells"),
    }
    for start, (colour, label) in groups.items():
        rows = [row for row in events if row["method"].startswith(start)]
        axes.plot(
            [r["ms_per_pair"] for r in rows],
            [r["max_error_deg"] for r in rows],
            "o-",
            color=colour,
            lw=1.2,
            label=label,
        )
        for row in rows:
            text = row["method"].split(", ")[-1]
            axes.annotate(
                text, (row["ms_per_pair"], row["max_error_deg"]), (6, 6), textcoords="offset points", fontsize=7.5
            )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="time per pair, ms",
        ylabel="largest error of the entry, degrees",
        ylim=(1e-14, 30),
    )
    axes.margins(x=0.18)
    axes.grid(color="#dde3e6", lw=0.6)
    axes.legend(frameon=False, loc="center right")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


# Tables into the docs


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    return "\n".join(["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)])


def write_tables(tables: dict[str, str]) -> None:
    """Replaces what stands between ``<!-- name -->`` and ``<!-- /name -->`` in the page."""
    page = ROOT / "docs" / "knotter.md"
    text = page.read_text()
    for name, body in tables.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        text, count = pattern.subn(lambda found, body=body: f"{found[1]}{body}\n{found[2]}", text)
        if count != 1:
            raise ValueError(f"{page.name} has no place for the table {name}")
    page.write_text(text)


def main() -> None:
    """Measure, draw, write."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    results = {
        "predicates": predicate_errors(),
        "predicate_times": predicate_times(),
        "events": event_errors(),
        "short_windows": short_windows(),
        "grid": grid_time(),
    }
    (ROOT / "benchmarks" / "results" / "knotter.json").write_text(json.dumps(results, indent=2) + "\n")
    _style(plt)
    images = ROOT / "docs" / "img"
    images.mkdir(parents=True, exist_ok=True)
    draw_frames(plt, images / "knotter_frames.png")
    draw_paths(plt, images / "knotter_paths.png")
    draw_map(plt, images / "knotter_map.png")
    draw_errors(plt, images / "knotter_errors.png", results["events"])

    yes = {True: "found", False: "missed"}
    times, grid = results["predicate_times"], results["grid"]
    predicates = [
        [f"{row['distance_mm']:.0e}", *(f"{value:.1f}" for name, value in row.items() if name != "distance_mm")]
        for row in results["predicates"]
    ]
    write_tables(
        {
            "published": table(["quantity", "published", "here"], published()),
            "predicates": table(
                ["off the edge, mm", "= 360", "± 1e-9°", "± 1e-6°", "± 1e-3°", "NaN", "orientations", "filtered"],
                predicates,
            ),
            "predicate_times": (
                "On 100,000 points inside the triangle the sum equals 360.0 for "
                f"{times['inside_and_equal_360_percent']:.1f} % and misses it by up to "
                f"{times['largest_miss_of_360_degrees']:.1e}°; the orientations are right for "
                f"{times['inside_by_orientations_percent']:.0f} %. The sum takes "
                f"{times['angle_sum_over_orientations']:.1f} times as long."
            ),
            "grid": (
                f"A grid of 101 × 101 pairs with the three conditions took {grid['seconds']:.1f} s of one core "
                f"({grid['feasible']} pairs are feasible). Under the wrap alone a scan of 0.1° of the same pairs "
                f"takes {grid['scan_0.1_over_cells_wrap']:.1f} times as long as the cells."
            ),
            "events": table(
                ["method", "largest error, degrees", "time per pair / cells, 900 at once"],
                [
                    [r["method"], f"{r['max_error_deg']:.1e}", f"{float(format(r['time_over_cells'], '.2g')):g}"]
                    for r in results["events"]
                ],
            ),
            "windows": table(
                ["d5 short of closing, mm", "window, degrees", "scan 2°", "1°", "0.1°", "0.01°", "cells"],
                [
                    [
                        f"{r['short_of_mm']:.0e}",
                        f"{r['width_deg']:.3g}",
                        *(yes[r[f"scan_{s:g}"]] for s in (2.0, 1.0, 0.1, 0.01)),
                        yes[r["cells"]],
                    ]
                    for r in results["short_windows"]
                ],
            ),
        }
    )
    print(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
