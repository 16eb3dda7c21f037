"""Pictures of docs/knotter.md: frames, paths of the crossings, map of margins, and errors over run times."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from benchmarks.figures import BLUE, BROWN, GREEN, INK, ORANGE, PAPER, RED, arrow, bare, figure, note
from benchmarks.report import ROOT
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import study
from synthesis.scenes.knotter.mechanism import Mechanism, as_array
from synthesis.scenes.knotter.segment_triangle import crossing_point, orientations

PUBLISHED = json.loads((ROOT / "tests" / "reference" / "knotter.json").read_text())["paper"]
PAIRS = [(alpha1, alpha3) for alpha1 in (0, 10, 20) for alpha3 in (20, 25, 30)]
ROPE, DISC, BILL, JAW = RED, BLUE, BROWN, GREEN


def knotters_at(alpha1: Any, alpha3: Any, **parameters: float) -> Mechanism:
    """Return the default knotter at pairs of spatial angles in degrees."""
    return d_knotter.mechanism({"alpha1": np.radians(alpha1), "alpha3": np.radians(alpha3), **parameters})


AZIMUTH, ELEVATION = np.radians(-62.0), np.radians(18.0)
VIEW = np.array(
    [
        [-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0],
        [-np.sin(ELEVATION) * np.cos(AZIMUTH), -np.sin(ELEVATION) * np.sin(AZIMUTH), np.cos(ELEVATION)],
    ]
)
"""Directions to the right and upwards in the drawing, in the frame of the disc's bearing."""
LABELS = {
    "wrap": {"S0": (7, 5), "S1": (-4, -13), "S3": (-1, 9), "S4": (9, -9), "S5": (9, 9), "E1": (12, -3)},
    "bite": {"S0": (9, -5), "S7": (1, -14), "O5": (15, 3), "S8": (-10, -8), "S9": (-2, 9), "E2": (9, -9)},
}
"""Offsets of the labels in the drawing, in typographic points."""
CENTRED = {"ha": "center", "va": "center"}


def triangle(axes: Any, corners: np.ndarray, colour: str, required_edge: int, edge_colour: str) -> None:
    """Draw a triangle and emphasise its required edge."""
    axes.fill(*corners.T, color=colour, alpha=0.25, lw=0)
    axes.plot(*np.vstack([corners, corners[:1]]).T, color=colour, lw=1.1)
    axes.plot(
        *corners[[required_edge, (required_edge + 1) % 3]].T,
        color=edge_colour,
        lw=3.1,
        solid_capstyle="round",
        zorder=4,
    )


def draw_frames() -> None:
    """Draw the frames and the rope at the wrap and at the bite of the pair (10, 25), in parallel projection."""
    knotter, turn = knotters_at(10.0, 25.0), np.linspace(0, 2 * np.pi, 300)
    with figure("knotter_frames.png", 1, 2, (11.5, 4.7), sharex=True, sharey=True) as (_, panels):
        for axes, condition, colour, mark in zip(
            panels, (d_knotter.wrap(), d_knotter.bite()), (BILL, JAW), ("E1", "E2")
        ):
            name, entry = condition.name, condition.evaluate(knotter, 1)
            alpha = entry.enter[0]

            def projected(point: Any, frame: str, alpha: float = alpha) -> np.ndarray:
                return VIEW @ as_array(knotter.transform(point, frame, "seat", alpha), ())

            rim = VIEW @ np.array([30 * np.cos(turn), 0 * turn, 30 * np.sin(turn)])
            axes.fill(*rim, color=DISC, alpha=0.10, lw=0)
            axes.plot(*rim, color=DISC)
            sweep = VIEW @ as_array(knotter.position(condition.segment[1], "seat", turn), turn.shape)
            axes.plot(*sweep, color=BILL, lw=0.7, ls=(0, (5, 3)), alpha=0.8)
            bodies = (
                ("u3", DISC, "disc u3", (22, -46)),
                ("u4", BILL, "bill u4", (-58, -4) if name == "wrap" else (-44, 8)),
                ("u5", JAW, "jaw u5", (-56, 8)),
            )
            for frame, tone, label, offset in bodies:
                origin = projected((0.0, 0.0, 0.0), frame)
                for axis, letter in zip(np.eye(3), "ijk"):
                    tip = projected(17 * axis, frame)
                    arrow(axes, origin, tip, color=tone, lw=1.2, shrinkA=0, shrinkB=0)
                    beyond = origin + (tip - origin) * (1 + 3.0 / max(np.linalg.norm(tip - origin), 3.0))
                    axes.text(*beyond, letter, fontsize=8, color=tone, **CENTRED)
                note(axes, label, origin, offset, color=tone, fontsize=9, weight="bold")
            hinge = [projected((0.0, 0.0, 0.0), frame) for frame in ("u4", "u5")]
            axes.plot(*np.transpose(hinge), color=JAW, lw=1.0, ls=":")
            corners = {corner: projected(*knotter.points[corner][::-1]) for corner in condition.triangle}
            triangle(axes, np.array(list(corners.values())), colour, condition.required_edge, colour)
            ends = {end: projected(*knotter.points[end][::-1]) for end in condition.segment}
            axes.plot(*np.transpose(list(ends.values())), color=ROPE, lw=2.2, marker="o", ms=4.5)
            crossing = projected(entry.point[0], condition.frame)
            axes.plot(*crossing, "o", mfc=PAPER, mec=ROPE, ms=8, mew=1.8, zorder=5)
            for point, position in {**corners, **ends, mark: crossing}.items():
                tone = colour if point in corners else ROPE
                note(axes, point, position, LABELS[name][point], color=tone, fontsize=8.5, **CENTRED)
            edge = condition.edge_names[condition.required_edge]
            axes.set_title(f"{name}: {mark} enters through {edge} at $\\alpha$ = {np.degrees(alpha):.4f}°")
            bare(axes)
        low, bottom = axes.get_xlim()[0], axes.get_ylim()[0] + 3
        axes.plot([low + 4, low + 24], [bottom] * 2, color=INK, lw=2)
        note(axes, "20 mm", (low + 14, bottom), (0, 7), ha="center", fontsize=8)


def draw_paths() -> None:
    """Draw the paths of the rope's crossings in the planes of the two triangles, for the nine pairs."""
    from matplotlib.lines import Line2D

    tones, dashes, chosen = (BLUE, GREEN, ORANGE), ("-", "--", ":"), knotters_at(10.0, 25.0)
    with figure("knotter_paths.png", 1, 2, (11, 4.8)) as (drawing, panels):
        for axes, condition, plane, colour in zip(
            panels, (d_knotter.wrap(), d_knotter.bite()), ([1, 2], [0, 2]), (BILL, JAW)
        ):
            driver = np.linspace(*condition.window, 1500)
            for row, pair in enumerate(PAIRS):
                item, tone = knotters_at(*map(float, pair)), tones[row // 3]
                positions = condition.positions(item, driver)
                s_p, s_q, *_ = orientations(*positions)
                crossing = as_array(crossing_point(*positions), driver.shape)[plane]
                axes.plot(*np.where(s_p * s_q < 0, crossing, np.nan), color=tone, ls=dashes[row % 3], lw=1.1)
                found = condition.evaluate(item, 1)
                spot = found.point[0][plane]  # NaN, and not drawn, where the rope never enters
                axes.plot(*spot, "o", ms=5.5, mfc=tone if found.holds[0] else PAPER, mec=tone, mew=1.3, zorder=5)
            positions = condition.positions(chosen, condition.evaluate(chosen, 1).enter[0])
            corners = np.array([as_array(corner, ())[plane] for corner in positions[2:]])
            triangle(axes, corners, colour, condition.required_edge, ROPE)
            for name, corner in zip(condition.triangle, corners):
                away = corner - corners.mean(axis=0)
                note(axes, name, corner, tuple(13 * away / np.linalg.norm(away)), **CENTRED)
            margin = 0.2 * np.ptp(corners, axis=0).max()
            low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        panels[0].set(title="Wrap: paths of E1 in the bill's plane", xlabel="j of u4, mm", ylabel="k of u4, mm")
        panels[1].set(title="Bite: paths of E2 in the jaw's plane", xlabel="i of u5, mm", ylabel="k of u5, mm")
        keys = [Line2D([], [], color=tone, label=f"$\\alpha_1$ = {a}°") for tone, a in zip(tones, (0, 10, 20))]
        keys += [Line2D([], [], color=INK, ls=d, label=f"$\\alpha_3$ = {a}°") for d, a in zip(dashes, (20, 25, 30))]
        keys += [Line2D([], [], color=ROPE, lw=3, label="required edge"), *dots("entry, holds", "entry, fails")]
        drawing.legend(handles=keys, loc="outside lower center", ncol=9, fontsize=8)


def dots(holds: str, fails: str) -> list[Any]:
    """Return two legend entries."""
    from matplotlib.lines import Line2D

    rows = ((INK, holds), (PAPER, fails))
    return [Line2D([], [], ls="", marker="o", mfc=fill, mec=INK, label=label) for fill, label in rows]


def draw_map() -> None:
    """Draw the smallest margin over (alpha1, alpha3), with the limit of each condition and the published pairs."""
    first, third = np.linspace(-5, 30, 281), np.linspace(15, 40, 251)
    grid = {"alpha1": np.radians(first), "alpha3": np.radians(third)}
    result, shape = study(d_knotter.mechanism(), grid, d_knotter.conditions()), (len(first), len(third))
    margin = result.margin.reshape(shape).T
    with figure("knotter_map.png", size=(8.2, 5.6)) as (drawing, (axes,)):
        axes.contourf(first, third, margin, [-1e9, 0], colors=["#f3efe9"])
        levels = np.arange(0, np.ceil(margin.max()) + 0.5, 1.0)
        filled = axes.contourf(first, third, margin, levels, cmap="YlGn", extend="max")
        axes.clabel(axes.contour(first, third, margin, levels[1:], colors=INK, linewidths=0.5), fmt="%g", fontsize=7)
        for condition, colour in zip(d_knotter.conditions(), (BILL, DISC, JAW)):
            own = result.conditions[condition.name].margin.reshape(shape).T
            axes.contour(first, third, own, [0.0], colors=colour, linewidths=2.2)
            axes.plot([], [], color=colour, lw=2.2, label=f"limit of the {condition.name}")
        box = {"boxstyle": "round,pad=0.15", "fc": PAPER, "ec": "none", "alpha": 0.8}
        for pair in PAIRS:
            fill = INK if list(pair) in PUBLISHED["feasible"] else PAPER
            axes.plot(*pair, "o", ms=8, mfc=fill, mec=INK, mew=1.4, zorder=5)
            note(axes, f"{pair[0]}, {pair[1]}", pair, (8, 5), fontsize=8, zorder=6, bbox=box)
        keys = [*axes.get_legend_handles_labels()[0], *dots("published: ties", "published: fails")]
        drawing.legend(handles=keys, loc="outside lower center", ncol=5, fontsize=8)
        drawing.colorbar(filled, ax=axes, label="smallest margin, mm", pad=0.02)
        axes.set(
            xlabel=r"disc's spatial angle $\alpha_1$, degrees", ylabel=r"bill's spatial angle $\alpha_3$, degrees"
        )
        axes.set_title("Pairs that tie the knot, and their margins")


def draw(results: dict) -> None:
    """Draw all pictures; the geometry is computed again."""
    draw_frames()
    draw_paths()
    draw_map()
