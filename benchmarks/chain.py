"""Measures the chain scene, draws its pictures and writes the tables of docs/chain.md.

Run ``python -m benchmarks.chain`` from the root of the source tree. Everything but the times is reproducible to the
last printed digit; times are medians on the machine at hand and are compared within one run only.
"""

from __future__ import annotations

import json
import math
import re
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import brentq

from synthesis.chain import crescent as chain
from synthesis.chain.closure import Chain, closing_links
from synthesis.chain.fit import fit_error, fit_slot
from synthesis.chain.report import chord_error, report, wheel_conflict
from synthesis.chain.slot import Slot
from synthesis.chain.track import Segment, Track, arc, line, stadium

ROOT = Path(__file__).parents[1]
DOC, IMAGES, RESULTS = (
    ROOT / "docs" / "chain.md",
    ROOT / "docs" / "img",
    ROOT / "benchmarks" / "results" / "chain.json",
)
L, N, R1 = 131.0, 16, 181.78
PHASES = 9001

INK, TRACK, LINK, SLOT, WALL, SOFT = "#1b2631", "#8a99a8", "#34495e", "#c0392b", "#2471a3", "#d5dbe1"
COLOURS = {"chebyshev": "#c0392b", "spline": "#2471a3", "fourier": "#b9770e", "polynomial": "#5b6b7b"}
LABELS = {
    "chebyshev": "Chebyshev between crossings",
    "spline": "periodic cubic spline",
    "fourier": "Fourier series",
    "polynomial": "one polynomial y(x)",
}


def median_time(function: Callable[[], object], repeats: int = 9) -> float:
    """Median wall time in seconds."""
    function()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def pins_by_bracketing(crescent: chain.Crescent, slot: Slot, phase: float) -> np.ndarray:
    """All pins of one phase by brentq on the distance along the path: the named opponent."""
    track = crescent.track
    centres = [(-R1 - crescent.wheel_radius, 0), (0, crescent.eccentricity), (R1 + crescent.wheel_radius, 0), (0, 0)]
    radii = [1 / abs(s.curvature) for s in track.segments]
    starts = [0.0, math.pi + crescent.xi, -crescent.xi, 0.0]
    joints, total = track.joints.tolist(), track.total

    def point(s: float) -> tuple[float, float]:
        s %= total
        i = 0 if s < joints[1] else 1 if s < joints[2] else 2 if s < joints[3] else 3
        angle = starts[i] + (s - joints[i]) / radii[i] * (-1 if i == 3 else 1)
        x, y = centres[i]
        return x + radii[i] * math.cos(angle), y + radii[i] * math.sin(angle)

    def following(s: float, direction: int) -> float:
        x, y = point(s)

        def excess(u: float) -> float:
            px, py = point(s + direction * u)
            return math.hypot(px - x, py - y) - L

        return s + direction * brentq(excess, 0.99 * L, 1.6 * L, xtol=1e-300, rtol=8.9e-16)

    ahead, behind = [phase], [phase]
    for _ in range(slot.free - 2):
        ahead.append(following(ahead[-1], 1))
    for _ in range(N - slot.free):
        behind.append(following(behind[-1], -1))
    a, b = np.array(point(ahead[-1])), np.array(point(behind[-1]))
    half = (b - a) / 2
    h = math.hypot(*half)
    free = a + half + np.array([-half[1], half[0]]) / h * math.sqrt(L * L - h * h)
    return np.array([*map(point, ahead), free, *map(point, behind[:0:-1])])


# Measurements


def measure_published(crescent: chain.Crescent, slot: Slot) -> dict:
    facts = report(slot, np.linspace(slot.start, slot.end, PHASES))
    degrees = math.degrees
    printed = chain.given_crescent(92.63, R1, 381.5, 90.22)
    rows = [
        ["links that close", "16", str(closing_links(printed.track, L))],
        ["wheel radius R0", "92.63", f"{crescent.wheel_radius:.4f}"],
        ["lower radius R2", "381.50", f"{crescent.lower_radius:.4f}"],
        ["eccentricity b", "90.22", f"{crescent.eccentricity:.4f}"],
        ["xi", "18.2 deg", f"{degrees(crescent.xi):.4f} deg"],
        ["alpha", "71.8 deg", f"{degrees(crescent.alpha):.4f} deg"],
        ["tangency residual of the printed numbers", "0 intended", f"{printed.tangency_residual:.4f}"],
        ["theta1m, start of the window", "not given", f"{degrees(slot.start / crescent.wheel_radius):.4f} deg"],
        ["depth of the slot", "not given", f"{facts.depth_max.value:.4f}"],
        ["smallest curvature radius", "not given", f"{facts.radius_min:.3f}"],
        ["largest closure defect", "not given", f"{degrees(facts.slack_max.value / R1):.4f} deg"],
        ["wheel phase conflict", "not given", f"{90 * wheel_conflict(slot, chain.RIGHT_WHEEL).value:.3f} deg"],
        ["largest chord error over 9001 phases", "not given", f"{facts.chord_error:.1e}"],
    ]
    return {"rows": rows, "chord_error": facts.chord_error}


def measure_speed(crescent: chain.Crescent, slot: Slot) -> dict:
    phases = np.linspace(slot.start, slot.end, PHASES)
    few = phases[::100]
    ours = median_time(lambda: slot.pins(phases))
    checked = median_time(lambda: chord_error(slot, phases))
    theirs = median_time(lambda: [pins_by_bracketing(crescent, slot, p) for p in few], 3) / len(few) * PHASES
    agree = np.abs(np.array([pins_by_bracketing(crescent, slot, p) for p in few]) - slot.pins(few)).max()
    whole = median_time(lambda: chain.crescent_slot(L, N, R1), 5)
    rows = [
        ["all 16 pins at 9001 phases", f"{1e3 * ours:.0f} ms", f"{1e3 * theirs:.0f} ms", f"{theirs / ours:.0f}"],
        ["the same, and their 144,016 chords checked", f"{1e3 * checked:.0f} ms", "", ""],
        ["critical closure, window and free pin", f"{1e3 * whole:.0f} ms", "", ""],
    ]
    return {"rows": rows, "largest_difference": float(agree), "seconds": [ours, checked, whole, theirs]}


def measure_fits(slot: Slot) -> list[dict]:
    phases = np.linspace(slot.start, slot.end, PHASES)
    orders = {
        "chebyshev": [2, 3, 4, 5, 6, 8, 10, 12, 14],
        "spline": [9, 18, 45, 90, 180, 360],
        "fourier": [2, 4, 8, 16, 32, 64],
        "polynomial": [4, 6, 8, 10, 12, 16, 20, 24, 32, 40],
    }
    rows = []
    for kind, values in orders.items():
        for order in values:
            fit = fit_slot(slot, kind, order)
            error = fit_error(slot, fit, phases)
            rows.append(
                {
                    "kind": kind,
                    "order": order,
                    "unknowns": fit.unknowns,
                    "normal": error.normal,
                    "chord": error.chord,
                    "condition": fit.condition,
                    "fit_ms": 1e3 * median_time(lambda kind=kind, order=order: fit_slot(slot, kind, order), 7),
                    "evaluate_us": evaluation_time(slot, fit, phases),
                }
            )
    return rows


def evaluation_time(slot: Slot, fit, phases: np.ndarray) -> float:
    """Microseconds for 1000 phases. The polynomial is given x: it does not know the phase."""
    if fit.kind == "polynomial":
        x = np.linspace(-1, 1, PHASES)
        return 1e6 * median_time(lambda: chebyshev.chebval(x, fit.data["coefficients"])) / (PHASES / 1e3)
    return 1e6 * median_time(lambda: fit.evaluate(phases)) / (PHASES / 1e3)


def measure_large_radii() -> list[list[str]]:
    """Chord errors of the step from a wheel onto an arc of radius R: closed form with arccos, and ours."""
    r0, r1, pitch = 92.63, 181.78, 131.0
    rows = []
    for radius in (1e3, 1e5, 1e6, 1e7, 1e8):
        c, a = r0 + r1, radius - r0
        alpha = math.asin(c / a)
        crescent = chain.level_crescent(r0, r1, alpha)
        track, b, xi = crescent.track, crescent.eccentricity, crescent.xi
        v = np.linspace(0.05, crescent.link_angles(pitch)[0] - 0.05, 200)
        p, q = -2 * radius * (a + r0 * np.cos(v)), 2 * r0 * radius * np.sin(v)
        m = pitch**2 - (radius**2 + a * a + r0**2 + 2 * a * r0 * np.cos(v))
        u = np.arctan2(q, p) - np.arccos(m / np.hypot(p, q))
        wheel = np.pi + xi - v
        here = np.stack([-c + r0 * np.cos(wheel), r0 * np.sin(wheel)], axis=1)
        angle = np.pi + xi + u
        there = np.stack([radius * np.cos(angle), b + radius * np.sin(angle)], axis=1)
        closed = np.abs(np.hypot(*(there - here).T) - pitch).max()
        place = track.place(r0 * wheel)
        ours = np.abs(np.hypot(*(track.points(track.step(place, pitch)) - track.points(place)).T) - pitch).max()
        rows.append([f"{radius:.0e}", f"{closed:.1e}", f"{ours:.1e}"])
    return rows


def measure_far_origin() -> list[list[str]]:
    """40 links along a stadium of whole numbers: bracketing in the drawing's coordinates, and ours."""
    radius, straight, pitch, links = 64.0, 256.0, 50.0, 40
    near = stadium(radius, straight)
    starts = np.linspace(0, near.total, 25, endpoint=False)

    def walk(track: Track) -> np.ndarray:
        place = track.place(starts)
        for _ in range(links):
            place = track.step(place, pitch)
        return track.position(place)

    def search(away: float) -> np.ndarray:
        half_turn, centre = math.pi * radius, straight / 2

        def point(s: float) -> tuple[float, float]:
            lap, s = divmod(s % near.total, half_turn + straight)
            angle = min(s, half_turn) / radius - math.pi / 2
            x = centre + radius * math.cos(angle) - max(s - half_turn, 0.0)
            y = radius * math.sin(angle)
            return (away - x, away - y) if lap else (away + x, away + y)

        ends = []
        for s in starts.tolist():
            for _ in range(links):
                x, y = point(s)

                def excess(u: float, s=s, x=x, y=y) -> float:
                    px, py = point(s + u)
                    return math.hypot(px - x, py - y) - pitch

                s += brentq(excess, 0.99 * pitch, 1.6 * pitch, xtol=1e-13)
            ends.append(s)
        return np.array(ends)

    exact = walk(near)
    rows = []
    for away in (0.0, 1e3, 1e6, 1e9):
        far = Track([segment._replace(x=segment.x + away, y=segment.y + away) for segment in near.segments])
        ours, theirs = np.abs(walk(far) - exact).max(), np.abs(search(away) - exact).max()
        rows.append([f"{away:g}", f"{theirs:.1e}", f"{ours:.1e}", f"{np.spacing(away):.1e}" if away else "-"])
    return rows


def measure_high_degree(slot: Slot) -> list[list[str]]:
    """One polynomial by raw powers of x from several origins (QR), and in scaled Chebyshev polynomials."""
    samples = slot.path(np.linspace(slot.start, slot.end, 91))
    dense = slot.path(np.linspace(slot.start, slot.end, PHASES))

    def raw(degree: int, shift: float) -> float:
        q, r = np.linalg.qr(np.vander(samples[:, 0] + shift, degree + 1))
        with np.errstate(all="ignore"):
            try:
                coefficients = np.linalg.solve(r, q.T @ samples[:, 1])
            except np.linalg.LinAlgError:
                return math.inf
            error = np.abs(np.polyval(coefficients, dense[:, 0] + shift) - dense[:, 1]).max()
        return float(error)

    rows = []
    for degree in (4, 8, 10, 16, 24, 32, 40):
        fit = fit_slot(slot, "polynomial", degree)
        ours = np.abs(fit.evaluate(slot.start + slot.chain.period * np.linspace(0, 1, PHASES)) - dense)[:, 1].max()
        cells = [f"{raw(degree, shift):.2g}" for shift in (0.0, R1 + 92.63, 1000.0, 5000.0)]
        rows.append([str(degree), *cells, f"{ours:.2g}", f"{fit.condition:.3g}"])
    return rows


# Pictures


def draw_track(ax, track: Track, **style) -> None:
    points = track.points(track.place(np.linspace(0, track.total, 2000)))
    ax.plot(points[:, 0], points[:, 1], **style)


def draw_chain(ax, slot: Slot, phase: float, numbers: bool = False, size: float = 5.0) -> None:
    pins = slot.pins(np.array([phase]))[0]
    loop = np.vstack([pins, pins[:1]])
    ax.plot(loop[:, 0], loop[:, 1], color=LINK, lw=1.3, zorder=3)
    ax.plot(pins[:, 0], pins[:, 1], "o", ms=size, mfc="white", mec=LINK, mew=1.4, zorder=4)
    k = slot.free - 1
    ax.plot(*pins[k], "o", ms=size + 1, mfc=SLOT, mec=SLOT, zorder=5)
    if numbers:
        for index, pin in enumerate(pins):
            upper = abs(pin[0]) < 1.05 * R1 and pin[1] > -200 and pin[1] < 60
            away = -pin if upper else pin - np.array([0.0, -60.0])
            ax.annotate(
                f"P{index + 1}",
                pin,
                xytext=16 * away / np.hypot(*away),
                textcoords="offset points",
                ha="center",
                va="center",
                fontsize=8,
                color=SLOT if index == k else INK,
            )


def clean(ax) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(labelsize=8, colors=INK)
    ax.grid(color=SOFT, lw=0.5)
    ax.set_axisbelow(True)


def picture_track(crescent: chain.Crescent, slot: Slot) -> None:
    fig, (ax, zoom) = plt.subplots(2, 1, figsize=(9.2, 9.4), height_ratios=[1.45, 1], layout="constrained")
    draw_track(ax, slot.chain.track, color=TRACK, lw=5, alpha=0.45, solid_capstyle="round")
    draw_chain(ax, slot, slot.start + 0.5235 * slot.chain.period, numbers=True)
    path = slot.path(np.linspace(slot.start, slot.end, 400))
    ax.plot(path[:, 0], path[:, 1], color=SLOT, lw=2.2)
    c = R1 + crescent.wheel_radius
    b = crescent.eccentricity
    for x, y, name in ((0, 0, "O1"), (0, b, "O2"), (-c, 0, "C left"), (c, 0, "C right")):
        ax.plot(x, y, "+", color=INK, ms=9, mew=1.2)
        ax.annotate(name, (x, y), xytext=(7, 5), textcoords="offset points", fontsize=8.5, color=INK)
    dimensions = (
        ((0, 0), -35, R1, f"R1 = {R1:.2f}"),
        ((0, b), -107, crescent.lower_radius, f"R2 = {crescent.lower_radius:.3f}"),
        ((-c, 0), 128, crescent.wheel_radius, f"R0 = {crescent.wheel_radius:.3f}"),
    )
    for (x, y), angle, radius, label in dimensions:
        end = (x + radius * math.cos(math.radians(angle)), y + radius * math.sin(math.radians(angle)))
        ax.annotate("", end, (x, y), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 0.8})
        share = 0.5 if radius > R1 - 1 else 0.62
        ax.text(
            x + share * (end[0] - x),
            y + share * (end[1] - y),
            label,
            fontsize=8.5,
            ha="center",
            va="center",
            color=INK,
            bbox={"fc": "white", "ec": "none", "pad": 1.2},
        )
    ax.set_aspect("equal")
    ax.set_xlim(-405, 405)
    ax.set_ylim(-325, 115)
    ax.axis("off")
    ax.set_title("Track (grey), chain of 16 links and compensation slot (red), mm", fontsize=11, color=INK)

    angle = np.linspace(-0.42, 0.42, 300)
    zoom.plot(R1 * np.sin(angle), -R1 * np.cos(angle), color=TRACK, lw=1.6, label="bare upper arc, R1")
    zoom.plot(path[:, 0], path[:, 1], color=SLOT, lw=2, label="slot of the free pin")
    roller = 20.0
    normals = slot.normals(np.linspace(slot.start, slot.end, 400))
    for sign in (1, -1):
        wall = path + sign * roller * normals
        zoom.plot(
            wall[:, 0], wall[:, 1], color=WALL, lw=1, ls="--", label="walls for a 20 mm roller" if sign > 0 else None
        )
    crossings = slot.path(np.array([crossing.phase for crossing in slot.crossings]))
    zoom.plot(crossings[:, 0], crossings[:, 1], "D", ms=4.5, color=INK, label="a pin passes a joint: curvature jumps")
    bottom = path[np.argmin(path[:, 1])]
    zoom.annotate(
        "depth 4.203",
        (bottom[0], bottom[1]),
        xytext=(0, 32),
        textcoords="offset points",
        ha="center",
        fontsize=8.5,
        color=SLOT,
    )
    clean(zoom)
    zoom.set_aspect("equal")
    zoom.set_xlim(-92, 92)
    zoom.set_ylim(-212, -142)
    zoom.legend(fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2, frameon=False)
    fig.savefig(IMAGES / "chain_track.png", dpi=150)
    plt.close(fig)


def picture_defect(crescent: chain.Crescent, slot: Slot) -> None:
    fig, axes = plt.subplots(3, 1, figsize=(8.4, 7.6), sharex=True)
    to_deg = math.degrees(1) / crescent.wheel_radius
    phases = np.linspace(slot.start, slot.end, 1200)
    axes[0].plot(phases * to_deg, np.degrees(slot.slack(phases) / R1), color=INK, lw=1.8)
    axes[0].set_ylabel("closure defect, deg", fontsize=9)
    axes[1].plot(phases * to_deg, slot.depth(phases), color=SLOT, lw=1.8)
    axes[1].set_ylabel("depth of the slot, mm", fontsize=9)
    for a, b in zip(slot.breaks[:-1], slot.breaks[1:]):
        inner = np.linspace(a + 1e-6, b - 1e-6, 300)
        axes[2].plot(inner * to_deg, slot.curvature(inner), color=WALL, lw=1.8)
    axes[2].set_ylabel("curvature of the slot, 1/mm", fontsize=9)
    axes[2].set_xlabel("theta1, deg", fontsize=9)
    for ax in axes:
        clean(ax)
        for crossing in slot.crossings:
            ax.axvline(crossing.phase * to_deg, color=TRACK, lw=0.8, ls=":")
    names = ("left wheel", "lower arc", "right wheel", "upper arc")
    axes[0].set_ylim(-0.06, 1.32)
    for crossing in slot.crossings:
        axes[0].text(
            crossing.phase * to_deg,
            1.2,
            f"P{crossing.pin} onto {names[crossing.segment]}",
            fontsize=8,
            ha="center",
            color=INK,
            bbox={"fc": "white", "ec": "none", "pad": 1},
        )
    fig.suptitle("One period: the chain fits the bare track at its two ends only", fontsize=11, color=INK)
    fig.tight_layout()
    fig.savefig(IMAGES / "chain_defect.png", dpi=150)
    plt.close(fig)


def picture_fits(rows: list[dict]) -> None:
    fig, axes = plt.subplots(1, 2, figsize=(10, 4.4), sharey=True)
    for kind, colour in COLOURS.items():
        mine = [row for row in rows if row["kind"] == kind]
        normal = [row["normal"] for row in mine]
        for ax, key in zip(axes, ("unknowns", "evaluate_us")):
            ax.plot([row[key] for row in mine], normal, "o-", ms=4.5, lw=1.3, color=colour, label=LABELS[kind])
    for ax, label in zip(axes, ("stored numbers", "run time for 1000 points, microseconds")):
        clean(ax)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel(label, fontsize=9)
    axes[0].set_ylabel("largest normal error, mm", fontsize=9)
    axes[0].axhline(0.01, color=TRACK, lw=1, ls="--")
    axes[0].text(5, 0.0068, "0.01 mm", fontsize=8, color=INK, va="top")
    axes[0].legend(fontsize=8, frameon=False, loc="lower left")
    fig.suptitle("Error of each representation of the slot", fontsize=11, color=INK)
    fig.tight_layout()
    fig.savefig(IMAGES / "chain_fits.png", dpi=150)
    plt.close(fig)


def rounded_triangle(side: float, radius: float) -> Track:
    """Three lines and three arcs, travelled counterclockwise."""
    corners = [side * np.array([math.cos(a), math.sin(a)]) / math.sqrt(3) for a in np.radians([210, 330, 90])]
    segments: list[Segment] = []
    for index, corner in enumerate(corners):
        there = corners[(index + 1) % 3]
        heading = math.atan2(*(there - corner)[::-1])
        out = radius * np.array([math.sin(heading), -math.cos(heading)])
        segments.append(line(*(corner + out), *(there + out)))
        segments.append(arc(*there, radius, heading - math.pi / 2, 2 * math.pi / 3))
    return Track(segments)


def picture_tracks() -> list[list[str]]:
    """Four more chains on four more tracks; returns their table."""
    made = []
    for label, pitch, links, upper, wheel in (
        ("crescent, 24 links of 25.4", 25.4, 24, 70.0, None),
        ("crescent, wheels of six pins", 60.0, 23, 120.0, 60.0),
    ):
        _, slot = chain.crescent_slot(pitch, links, upper, wheel)
        made.append((label, slot))
    track = chain.critical_stadium(50.0, 16, 60.0)
    made.append(
        (
            "stadium, straight from the closure",
            chain.track_slot(track, 50.0, 16, track.joints[2] + track.length[2] / 2),
        )
    )
    side = brentq(lambda side: Chain(rounded_triangle(side, 70.0), 40.0, 30).least_overrun().value, 180, 330)
    track = rounded_triangle(side, 70.0)
    made.append(
        ("rounded triangle, 30 links", chain.track_slot(track, 40.0, 30, track.joints[3] + track.length[3] / 2))
    )
    fig, axes = plt.subplots(2, 2, figsize=(10, 7.2))
    rows = []
    for ax, (label, slot) in zip(axes.ravel(), made):
        facts = report(slot, np.linspace(slot.start, slot.end, 501))
        draw_track(ax, slot.chain.track, color=TRACK, lw=4, alpha=0.45)
        draw_chain(ax, slot, 0.5 * (slot.start + slot.end), size=3.6)
        path = slot.path(np.linspace(slot.start, slot.end, 300))
        ax.plot(path[:, 0], path[:, 1], color=SLOT, lw=2.2, zorder=6)
        ax.set_aspect("equal", adjustable="datalim")
        ax.axis("off")
        ax.margins(0.06)
        ax.set_title(f"{label}\nslot {facts.depth_max.value:.3f} deep", fontsize=9.5, color=INK)
        rows.append(
            [
                label,
                f"{slot.chain.pitch:g}",
                str(slot.chain.links),
                f"{facts.slack_max.value:.4f}",
                f"{facts.depth_max.value:.4f}",
                f"{facts.radius_min:.3f}",
                f"{facts.end_step:.1e}",
                f"{facts.chord_error:.1e}",
            ]
        )
    fig.tight_layout()
    fig.savefig(IMAGES / "chain_tracks.png", dpi=150)
    plt.close(fig)
    return rows


def measure_free_pin_places() -> list[list[str]]:
    """Slack and depth of a stadium's slot on its half circle and on its straight run."""
    rows = []
    for links in (12, 16, 20):
        radius = 50 / math.sqrt(2)
        track = chain.critical_stadium(50.0, links, radius)
        cells = [str(links)]
        for segment in (2, 1):
            middle = float(track.joints[segment] + track.length[segment] / 2)
            facts = report(chain.track_slot(track, 50.0, links, middle), np.zeros(1))
            cells += [f"{facts.slack_max.value:.3f}", f"{facts.depth_max.value:.3f}"]
            cells.append("without bound" if math.isinf(facts.condition) else f"{facts.condition:.2f}")
        rows.append(cells)
    return rows


# The document


def table(header: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def fill(text: str, name: str, content: str) -> str:
    """Replace what stands between a table's two marks."""
    pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end {name} -->)", re.DOTALL)
    if not pattern.search(text):
        raise SystemExit(f"docs/chain.md has no place for the table '{name}'")
    return pattern.sub(lambda match: f"{match[1]}{content}\n{match[2]}", text)


def main() -> None:
    """Measure, draw, write."""
    crescent, slot = chain.crescent_slot(L, N, R1)
    published, speed, fits = measure_published(crescent, slot), measure_speed(crescent, slot), measure_fits(slot)
    radii, origins, degrees = measure_large_radii(), measure_far_origin(), measure_high_degree(slot)
    IMAGES.mkdir(exist_ok=True)
    picture_track(crescent, slot)
    picture_defect(crescent, slot)
    picture_fits(fits)
    tracks = picture_tracks()
    places = measure_free_pin_places()
    RESULTS.parent.mkdir(exist_ok=True)
    results = {
        "published": published,
        "speed": speed,
        "fits": fits,
        "large_radii": radii,
        "far_origin": origins,
        "high_degree": degrees,
        "tracks": tracks,
        "free_pin_places": places,
    }
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    fit_rows = [
        [
            LABELS[row["kind"]],
            str(row["order"]),
            str(row["unknowns"]),
            f"{row['normal']:.1e}",
            f"{row['chord']:.1e}",
            f"{row['condition']:.3g}",
            f"{row['fit_ms']:.1f}",
            f"{row['evaluate_us']:.0f}",
        ]
        for row in fits
    ]
    text = DOC.read_text()
    text = fill(text, "published", table(["quantity", "published", "ours"], published["rows"]))
    text = fill(text, "speed", table(["task", "ours", "bracketing search", "ratio"], speed["rows"]))
    header = [
        "representation",
        "order",
        "numbers",
        "normal, mm",
        "chord, mm",
        "condition",
        "fit, ms",
        "1000 points, us",
    ]
    text = fill(text, "fits", table(header, fit_rows))
    text = fill(text, "radii", table(["radius, mm", "arccos form, mm", "ours, mm"], radii))
    header = ["origin away by, mm", "search in drawing coordinates, mm", "ours, mm", "spacing of numbers there, mm"]
    text = fill(text, "origins", table(header, origins))
    header = ["degree", "x from axis", "from wheel centre", "1 m away", "5 m away", "ours", "our condition"]
    text = fill(text, "degrees", table(header, degrees))
    header = ["track", "pitch", "links", "slack", "depth", "smallest radius", "step at ends", "chord error"]
    text = fill(text, "tracks", table(header, tracks))
    header = ["links", "slack on arc", "depth on arc", "gain", "slack on run", "depth on run", "gain there"]
    text = fill(text, "places", table(header, places))
    DOC.write_text(text)


if __name__ == "__main__":
    main()
