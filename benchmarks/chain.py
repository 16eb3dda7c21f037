"""The chain on a U-shaped slide: published numbers, speed, fits, stability, other tracks; fills docs/chain.md.

Everything but the times is reproducible to the last printed digit. Times are medians and are compared within one run only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import brentq

from benchmarks.report import BLUE, GREY, INK, ORANGE, RED, bare, figure, note, publish, repeat, significant, table
from synthesis.chain import crescent as chain
from synthesis.chain.closure import Chain, closing_links
from synthesis.chain.export import bezier, smooth_nodes
from synthesis.chain.fit import fit_error, fit_slot
from synthesis.chain.report import chord_error, report, wheel_conflict
from synthesis.chain.slot import Slot, find_slot
from synthesis.chain.track import Segment, Track, arc, line
from synthesis.errors import FieldError
from synthesis.one_variable import bisect
from tests.oracles import chain as oracle

L, N, R1 = 131.0, 16, 181.78
PRINTED = {"wheel_radius": 92.63, "lower_radius": 381.5, "eccentricity": 90.22}
PHASES, SEARCHED = 9001, 91
"""Phases of all errors and times; those at which one phase after another is computed, for a time per phase."""
ORDERS = {
    "chebyshev": [2, 3, 4, 5, 6, 8, 10, 12, 14],
    "spline": [9, 18, 45, 90, 180, 360],
    "fourier": [2, 4, 8, 16, 32, 64],
    "polynomial": [4, 6, 8, 10, 12, 16, 20, 24, 32, 40],
}
LABELS = {
    "chebyshev": "Chebyshev between crossings",
    "spline": "periodic cubic spline",
    "fourier": "Fourier series",
    "polynomial": "one polynomial y(x)",
}
ORIGINS = {"axis": 0.0, "wheel": R1 + PRINTED["wheel_radius"], "metre": 1e3, "five": 5e3}
"""Where x is counted from by raw powers, mm to the right of the track's own origin."""


def window(slot: Slot, count: int = PHASES) -> np.ndarray:
    """Phases over the slot's window, both ends included."""
    return np.linspace(slot.start, slot.end, count)


def middle_of(track: Track, segment: int) -> float:
    return float(track.joints[segment] + track.length[segment] / 2)


def moved(track: Track, away: float) -> Track:
    """The same track far from the drawing's origin."""
    return Track([segment._replace(x=segment.x + away, y=segment.y + away) for segment in track.segments])


# Opponents: the next pin by a search along the path


def next_by_bracketing(path: oracle.Path, s: float, pitch: float, direction: int = 1) -> float:
    """scipy's brentq on the distance, one pin at a time."""
    x, y = path.point(s)

    def excess(u: float) -> float:
        px, py = path.point(s + direction * u)
        return math.hypot(px - x, py - y) - pitch

    return s + direction * brentq(excess, 0.99 * pitch, 1.6 * pitch, xtol=1e-300, rtol=8.9e-16)


def next_by_halving(track: Track, s: np.ndarray, pitch: float, direction: int = 1) -> np.ndarray:
    """The same search by bisection, for all phases at once."""
    pin = track.points(track.place(s))

    def short(u: np.ndarray) -> np.ndarray:
        return np.abs(track.points(track.place(s + direction * u)) - pin) < pitch

    inside, _ = bisect(short, np.full(s.shape, 0.99 * pitch), np.full(s.shape, 1.6 * pitch))
    return s + direction * inside


def pins_by_search(slot: Slot, phases: np.ndarray, following: Any, points: Any) -> np.ndarray:
    """All pins, shape (n, links), from ``following(s, direction)`` and ``points(s)`` of arrays."""
    ahead, behind = [phases], [phases]
    for _ in range(slot.free - 2):
        ahead.append(following(ahead[-1], 1))
    for _ in range(slot.chain.links - slot.free):
        behind.append(following(behind[-1], -1))
    a, b = points(ahead[-1]), points(behind[-1])
    h = np.abs(b - a) / 2
    free = (a + b) / 2 + 1j * (b - a) / (2 * h) * np.sqrt(slot.chain.pitch**2 - h**2)
    return np.stack([*map(points, ahead), free, *map(points, behind[:0:-1])], axis=1)


# Measurements


def measure_published(crescent: chain.Crescent, slot: Slot) -> dict[str, Any]:
    facts, degrees = report(slot, window(slot)), math.degrees
    printed, printed_slot = chain.crescent_slot(L, N, R1, **PRINTED)
    try:
        chain.crescent_slot(L, 14, R1)
    except FieldError as error:
        refusal = str(error)
    return {
        "links": closing_links(printed.track, L),
        "wheel_radius": crescent.wheel_radius,
        "lower_radius": crescent.lower_radius,
        "eccentricity": crescent.eccentricity,
        "xi_deg": degrees(crescent.xi),
        "alpha_deg": degrees(crescent.alpha),
        "printed_residual": printed.tangency_residual,
        "printed_end_step": report(printed_slot, window(printed_slot, 3)).end_step,
        "start_deg": degrees(slot.start / crescent.wheel_radius),
        "depth": facts.depth_max.value,
        "radius": facts.radius_min,
        "defect_deg": degrees(facts.slack_max.value / R1),
        "conflict_deg": degrees(crescent.link_angles(L)[0]) * wheel_conflict(slot, chain.RIGHT_WHEEL).value,
        "chord_error": facts.chord_error,
        "held_chord_error": facts.held_chord_error,
        "slack": facts.slack_max.value,
        "speed": facts.free_speed,
        "cubics_error": cubics_error(slot),
        "refusal": refusal,
    }


def cubics_error(slot: Slot) -> float:
    """Largest distance of the exported cubics from the path, 91 samples."""
    t = np.linspace(0, 1, 9)
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    points = (bezier(slot, smooth_nodes(slot, 91)) @ weights).ravel()
    path = slot.path(window(slot, 4001))
    start, along = path[:-1], np.diff(path)
    share = np.clip(((points[:, None] - start) / along).real, 0, 1)
    return float(np.abs(points[:, None] - start - share * along).min(axis=1).max())


def measure_speed(crescent: chain.Crescent, slot: Slot) -> dict[str, Any]:
    """Times per phase: ours and the search, each for all phases at once and one phase after another."""
    phases, few, track = window(slot), window(slot, SEARCHED), slot.chain.track
    path = oracle.crescent(crescent.wheel_radius, R1, crescent.lower_radius, crescent.eccentricity)

    def bracketing(phase: float) -> np.ndarray:
        def following(s: np.ndarray, direction: int) -> np.ndarray:
            return np.array([next_by_bracketing(path, s[0], L, direction)])

        return pins_by_search(slot, np.array([phase]), following, lambda s: np.array([complex(*path.point(s[0]))]))

    def halving() -> np.ndarray:
        return pins_by_search(
            slot, phases, lambda s, way: next_by_halving(track, s, L, way), lambda s: track.points(track.place(s))
        )

    exact = slot.pins(phases)
    few_found = np.concatenate([bracketing(phase) for phase in few])
    differences = [np.abs(few_found - slot.pins(few)).max(), np.abs(halving() - exact).max()]
    one_by_one = few[:, None]
    return {
        "ours_ms": 1e3 * repeat(lambda: slot.pins(phases), 9).median.wall,
        "search_ms": 1e3 * repeat(halving, 3, 0).median.wall,
        "ours_single_ms": 1e3 * repeat(lambda: [slot.pins(phase) for phase in one_by_one], 3).median.wall / SEARCHED,
        "search_single_ms": 1e3 * repeat(lambda: [bracketing(phase) for phase in few], 3).median.wall / SEARCHED,
        "checked_ms": 1e3 * repeat(lambda: chord_error(slot, phases), 9).median.wall,
        "closure_ms": 1e3 * repeat(lambda: chain.crescent_slot(L, N, R1), 5).median.wall,
        "largest_difference": max(differences),
    }


def measure_fits(slot: Slot) -> list[dict[str, Any]]:
    phases, rows = window(slot), []
    for kind, orders in ORDERS.items():
        for order in orders:
            fit = fit_slot(slot, kind, order)
            error = fit_error(slot, fit, phases)

            def evaluate(fit: Any = fit) -> Any:
                if fit.kind == "polynomial":  # it is given x: it does not know the phase
                    return chebyshev.chebval(np.linspace(-1, 1, PHASES), fit.data["coefficients"])
                return fit.evaluate(phases)

            made = repeat(lambda kind=kind, order=order: fit_slot(slot, kind, order), 7).median.wall
            rows.append({"kind": kind, "order": order, "unknowns": fit.unknowns, "condition": fit.condition})
            rows[-1] |= {"normal": error.normal, "chord": error.chord, "fit_ms": 1e3 * made}
            rows[-1]["evaluate_us"] = 1e9 * repeat(evaluate, 9).median.wall / PHASES
    return rows


def measure_large_radii() -> list[dict[str, float]]:
    """Chord errors of the step from a wheel onto an arc of radius R: the paper's arccos form, and ours."""
    r0, rows = PRINTED["wheel_radius"], []
    for radius in (1e3, 1e5, 1e6, 1e7, 1e8):
        crescent = chain.level_crescent(r0, R1, math.asin((r0 + R1) / (radius - r0)))
        track, xi = crescent.track, crescent.xi
        v = np.linspace(0.05, crescent.link_angles(L)[0] - 0.05, 200)
        here = r0 * np.exp(1j * (np.pi + xi - v)) - (r0 + R1)
        u = oracle.Transfer(L, r0, R1, radius).f_back(v)
        there = 1j * crescent.eccentricity + radius * np.exp(1j * (np.pi + xi + u))
        place = track.place(r0 * (np.pi + xi - v))
        chords = {"arccos": there - here, "ours": track.points(track.step(place, L)) - track.points(place)}
        rows.append({"radius": radius} | {name: np.abs(np.abs(c) - L).max() for name, c in chords.items()})
    return rows


def measure_far_origin(slot: Slot) -> dict[str, Any]:
    """40 links along a stadium of whole numbers: bracketing in the drawing's coordinates, and ours."""
    near, path, pitch, links = chain.stadium(64.0, 256.0), oracle.stadium(64.0, 256.0), 50.0, 40
    starts, rows = np.linspace(0, near.total, 25, endpoint=False), []
    exact = near.position(near.advance(near.place(starts), pitch, links))
    for away in (0.0, 1e3, 1e6, 1e9):
        far_path = oracle.Path(
            [
                (
                    kind,
                    *(value + away for value in values[: 2 if kind == "arc" else 4]),
                    *values[2:][: 3 * (kind == "arc")],
                )
                for kind, *values in path.parts
            ]
        )
        far, found = moved(near, away), starts.tolist()
        for _ in range(links):
            found = [next_by_bracketing(far_path, s, pitch) for s in found]
        ours = far.position(far.advance(far.place(starts), pitch, links))
        errors = {"search": np.abs(found - exact).max(), "ours": np.abs(ours - exact).max()}
        rows.append({"away": away, **errors, "spacing": float(np.spacing(away)) if away else None})
    track = slot.chain.track
    far_slot = find_slot(Chain(moved(track, 1e8), L, N), middle_of(track, chain.UPPER_ARC))
    return {"rows": rows, "slot_chord_at_1e8": chord_error(far_slot, window(far_slot, 91))}


def measure_high_degree(slot: Slot) -> dict[str, Any]:
    """One polynomial by raw powers of x from several origins (QR), and in scaled Chebyshev polynomials."""
    samples, phases = slot.path(window(slot, 91)), window(slot)
    dense = slot.path(phases)

    def raw(degree: int, shift: float) -> float:
        with np.errstate(all="ignore"):
            q, r = np.linalg.qr(np.vander(samples.real + shift, degree + 1))
            coefficients = np.linalg.solve(r, q.T @ samples.imag)
            return float(np.abs(np.polyval(coefficients, dense.real + shift) - dense.imag).max())

    rows = []
    for degree in (4, 8, 10, 16, 24, 32, 40):
        fit = fit_slot(slot, "polynomial", degree)
        ours = np.abs((fit.evaluate(phases) - dense).imag).max()
        rows.append({"degree": degree, **{name: raw(degree, shift) for name, shift in ORIGINS.items()}})
        rows[-1] |= {"ours": ours, "condition": fit.condition}
    normal = {degree: fit_error(slot, fit_slot(slot, "polynomial", degree), phases).normal for degree in range(2, 41)}
    best = min(normal, key=lambda degree: normal[degree])
    # raw powers may be a little better by chance: the samples are fitted, the errors are those between them
    as_well = [row["degree"] for row in rows if row["axis"] < 1.05 * row["ours"]]
    return {"rows": rows, "best_degree": best, "best_normal": normal[best], "raw_as_well_to": max(as_well)}


def rounded_triangle(side: float, radius: float) -> Track:
    """Three lines and three arcs, travelled counterclockwise."""
    corners = side / math.sqrt(3) * np.exp(1j * np.radians([210, 330, 90]))
    segments: list[Segment] = []
    for here, there in zip(corners, np.roll(corners, -1)):
        heading = float(np.angle(there - here))
        out = -1j * radius * np.exp(1j * heading)
        a, b = here + out, there + out
        segments.append(line(a.real, a.imag, b.real, b.imag))
        segments.append(arc(there.real, there.imag, radius, heading - math.pi / 2, 2 * math.pi / 3))
    return Track(segments)


def other_tracks() -> dict[str, Slot]:
    """Four more chains on four more tracks."""
    stadium = chain.critical_stadium(50.0, 16, 60.0)
    side = brentq(lambda side: Chain(rounded_triangle(side, 70.0), 40.0, 30).least_overrun().value, 180, 330)
    triangle = rounded_triangle(side, 70.0)
    return {
        "crescent, 24 links of 25.4": chain.crescent_slot(25.4, 24, 70.0)[1],
        "crescent, wheels of six pins": chain.crescent_slot(60.0, 23, 120.0, 60.0)[1],
        "stadium, straight from the closure": find_slot(Chain(stadium, 50.0, 16), middle_of(stadium, 2)),
        "rounded triangle, 30 links": find_slot(Chain(triangle, 40.0, 30), middle_of(triangle, 3)),
    }


def measure_tracks() -> list[dict[str, Any]]:
    rows = []
    for label, slot in other_tracks().items():
        facts = report(slot, window(slot, 501))
        rows.append({"track": label, "pitch": slot.chain.pitch, "links": slot.chain.links})
        rows[-1] |= {"slack": facts.slack_max.value, "depth": facts.depth_max.value, "radius": facts.radius_min}
        rows[-1] |= {"end_step": facts.end_step, "chord": facts.chord_error}
    return rows


def measure_free_pin_places() -> list[dict[str, Any]]:
    """Slack, depth and gain of a stadium's slot on its half circle and on its straight run."""
    rows = []
    for links in (12, 16, 20):
        track, row = chain.critical_stadium(50.0, links, 50 / math.sqrt(2)), {"links": links}
        for name, segment in (("arc", 2), ("run", 1)):
            facts = report(find_slot(Chain(track, 50.0, links), middle_of(track, segment)), np.zeros(1))
            gain = facts.condition if math.isfinite(facts.condition) else None
            row |= {
                f"{name}_slack": facts.slack_max.value,
                f"{name}_depth": facts.depth_max.value,
                f"{name}_gain": gain,
            }
        rows.append(row)
    return rows


# The document


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables and figures of docs/chain.md."""
    own, speed, fits, degrees = (results[name] for name in ("published", "speed", "fits", "high_degree"))
    published = [
        ("links that close", "16", f"{own['links']}"),
        ("wheel radius R0", "92.63", f"{own['wheel_radius']:.4f}"),
        ("lower radius R2", "381.50", f"{own['lower_radius']:.4f}"),
        ("eccentricity b", "90.22", f"{own['eccentricity']:.4f}"),
        ("xi", "18.2 deg", f"{own['xi_deg']:.4f} deg"),
        ("alpha", "71.8 deg", f"{own['alpha_deg']:.4f} deg"),
        ("tangency residual of the printed numbers", "0 intended", f"{own['printed_residual']:.4f}"),
        ("theta1m, start of the window", "not given", f"{own['start_deg']:.4f} deg"),
        ("depth of the slot", "not given", f"{own['depth']:.4f}"),
        ("smallest curvature radius", "not given", f"{own['radius']:.3f}"),
        ("largest closure defect", "not given", f"{own['defect_deg']:.4f} deg"),
        ("wheel phase conflict", "not given", f"{own['conflict_deg']:.3f} deg"),
        (f"largest chord error over {PHASES} phases", "not given", f"{own['chord_error']:.1e}"),
    ]
    compared = [
        (f"all pins at {PHASES} phases, all phases at once", "ours_ms", "search_ms", "bisection"),
        ("all pins of one phase", "ours_single_ms", "search_single_ms", "brentq"),
    ]
    by_order = {(row["kind"], row["order"]): row for row in fits}
    error = "{:.1e}".format
    return {
        "published": table(
            [dict(zip("qpo", row)) for row in published], {"quantity": "{q}", "published": "{p}", "ours": "{o}"}
        ),
        "speed": table(
            [{"task": task, "a": speed[a], "b": speed[b], "by": by} for task, a, b, by in compared],
            {
                "task": "{task}",
                "search by": "{by}",
                "ours, ms": lambda row: significant(row["a"]),
                "search, ms": lambda row: significant(row["b"]),
                "ratio": lambda row: significant(row["b"] / row["a"], 2),
            },
            text_columns=2,
        ),
        "checked_ms": significant(speed["checked_ms"], 2),
        "closure_ms": significant(speed["closure_ms"], 2),
        "agreement": f"{speed['largest_difference']:.0e}",
        "fits": table(
            fits,
            {
                "representation": lambda row: LABELS[row["kind"]],
                "order": "{order}",
                "numbers": "{unknowns}",
                "normal, mm": "{normal:.1e}",
                "chord, mm": "{chord:.1e}",
                "condition": "{condition:.3g}",
                "fit, ms": "{fit_ms:.1f}",
                "1000 points, us": "{evaluate_us:.0f}",
            },
        ),
        "chebyshev_8": f"{by_order['chebyshev', 8]['normal']:.0e}",
        "best_degree": str(degrees["best_degree"]),
        "best_normal": f"{degrees['best_normal']:.3f}",
        "radii": table(
            results["large_radii"],
            {"radius, mm": "{radius:.0e}", "arccos form, mm": "{arccos:.1e}", "ours, mm": "{ours:.1e}"},
        ),
        "origins": table(
            results["far_origin"]["rows"],
            {
                "origin away by, mm": "{away:g}",
                "search in drawing coordinates, mm": "{search:.1e}",
                "ours, mm": "{ours:.1e}",
                "spacing of numbers there, mm": lambda row: error(row["spacing"]) if row["spacing"] else "-",
            },
        ),
        "slot_far_away": f"{results['far_origin']['slot_chord_at_1e8']:.0e}",
        "degrees": table(
            degrees["rows"],
            {
                "degree": "{degree}",
                "x from axis": "{axis:.2g}",
                "from wheel centre": "{wheel:.2g}",
                "1 m away": "{metre:.2g}",
                "5 m away": "{five:.2g}",
                "ours": "{ours:.2g}",
                "our condition": "{condition:.3g}",
            },
        ),
        "raw_as_well_to": str(degrees["raw_as_well_to"]),
        "tracks": table(
            results["tracks"],
            {
                "track": "{track}",
                "pitch": "{pitch:g}",
                "links": "{links}",
                "slack": "{slack:.4f}",
                "depth": "{depth:.4f}",
                "smallest radius": "{radius:.3f}",
                "step at ends": "{end_step:.1e}",
                "chord error": "{chord:.1e}",
            },
        ),
        "places": table(
            results["free_pin_places"],
            {
                "links": "{links}",
                "slack on arc": "{arc_slack:.3f}",
                "depth on arc": "{arc_depth:.3f}",
                "gain": "{arc_gain:.2f}",
                "slack on run": "{run_slack:.3f}",
                "depth on run": "{run_depth:.3f}",
                "gain there": lambda row: "without bound" if row["run_gain"] is None else f"{row['run_gain']:.2f}",
            },
        ),
        "printed_end_step": f"{own['printed_end_step']:.3f}",
        "radius": f"{own['radius']:.2f}",
        "held_chord_error": f"{own['held_chord_error']:.3f}",
        "slack": f"{own['slack']:.3f}",
        "conflict": f"{own['conflict_deg']:.3f}",
        "speed_range": "{:.3f} to {:.3f}".format(*own["speed"]),
        "cubics_error": f"{own['cubics_error']:.0e}",
        "refusal": '    $ echo \'{"pitch": 131, "links": 14, "upper_radius": 181.78}\' | linkage-atlas chain slot\n    '
        + own["refusal"],
    }


# Pictures


def plot(axes: Any, points: np.ndarray, *style: Any, **options: Any) -> None:
    axes.plot(points.real, points.imag, *style, **options)


def draw_slot(axes: Any, slot: Slot, phase: float, size: float) -> np.ndarray:
    """Track, chain and slot; returns the pins."""
    track, pins = slot.chain.track, slot.pins(np.array([phase]))[0]
    outline = track.points(track.place(np.linspace(0, track.total, 2000)))
    plot(axes, outline, color=GREY, lw=5, alpha=0.45)
    plot(axes, np.append(pins, pins[0]), "o-", color=INK, lw=1.3, ms=size, mfc="white", zorder=3)
    plot(axes, slot.path(window(slot, 400)), color=RED, lw=2.2, zorder=4)
    plot(axes, pins[[slot.free - 1]], "o", ms=size + 1, color=RED, zorder=5)
    bare(axes)
    return pins


def draw_track(crescent: chain.Crescent, slot: Slot) -> None:
    c, b = R1 + crescent.wheel_radius, crescent.eccentricity
    with figure("chain_track.png", 2, 1, (9.2, 9.4), height_ratios=[1.45, 1]) as (_, (top, zoom)):
        pins = draw_slot(top, slot, slot.start + 0.5235 * slot.chain.period, 5.0)
        for index, pin in enumerate(pins):
            upper = abs(pin.real) < 1.05 * R1 and -200 < pin.imag < 60
            away = -pin if upper else pin + 60j
            away *= 16 / abs(away)
            colour = RED if index == slot.free - 1 else INK
            style = {"ha": "center", "va": "center", "fontsize": 8, "color": colour}
            note(top, f"P{index + 1}", (pin.real, pin.imag), (away.real, away.imag), **style)
        for place, name in ((0, "O1"), (1j * b, "O2"), (-c, "C left"), (c, "C right")):
            place = complex(place)
            top.plot(place.real, place.imag, "+", color=INK, ms=9)
            note(top, name, (place.real, place.imag), (7, 5), fontsize=8.5)
        for centre, degrees, radius, name in (
            (0, -35, R1, "R1"),
            (1j * b, -107, crescent.lower_radius, "R2"),
            (-c, 128, crescent.wheel_radius, "R0"),
        ):
            end = centre + radius * np.exp(1j * math.radians(degrees))
            start, label = complex(centre), centre + 0.55 * (end - centre)
            arrow = {"arrowstyle": "-|>", "color": INK, "lw": 0.8}
            top.annotate("", (end.real, end.imag), (start.real, start.imag), arrowprops=arrow)
            box = {"fc": "white", "ec": "none", "pad": 1.2}
            top.text(label.real, label.imag, f"{name} = {radius:.3f}", fontsize=8.5, ha="center", bbox=box)
        top.set_title(f"Track (grey), chain of {N} links and compensation slot (red), mm")
        plot(zoom, -1j * R1 * np.exp(1j * np.linspace(-0.42, 0.42, 300)), color=GREY, label="bare upper arc, R1")
        path, normals = slot.path(window(slot, 400)), slot.normals(window(slot, 400))
        plot(zoom, path, color=RED, label="slot of the free pin")
        for sign, name in ((1, "walls for a 20 mm roller"), (-1, None)):
            plot(zoom, path + 20 * sign * normals, color=BLUE, lw=1, ls="--", label=name)
        crossings = slot.path(np.array([crossing.phase for crossing in slot.crossings]))
        plot(zoom, crossings, "D", ms=4.5, color=INK, label="a pin passes a joint: curvature jumps")
        zoom.set(aspect="equal", xlim=(-92, 92), ylim=(-212, -142))
        zoom.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2)


def draw_defect(crescent: chain.Crescent, slot: Slot) -> None:
    phases, unit = window(slot, 1200), crescent.wheel_radius * math.radians(1)
    with figure("chain_defect.png", 3, 1, (8.4, 7.6), sharex=True) as (drawing, (defect, depth, curvature)):
        defect.plot(phases / unit, np.degrees(slot.slack(phases) / R1), color=INK)
        defect.set(ylabel="closure defect, deg", ylim=(-0.06, 1.32))
        depth.plot(phases / unit, slot.depth(phases), color=RED)
        depth.set_ylabel("depth of the slot, mm")
        for a, b in zip(slot.breaks[:-1], slot.breaks[1:]):
            inner = np.linspace(a + 1e-6, b - 1e-6, 300)
            curvature.plot(inner / unit, slot.curvature(inner), color=BLUE)
        curvature.set(ylabel="curvature of the slot, 1/mm", xlabel="theta1, deg")
        names = ("left wheel", "lower arc", "right wheel", "upper arc")
        for crossing in slot.crossings:
            for axes in (defect, depth, curvature):
                axes.axvline(crossing.phase / unit, color=GREY, lw=0.8, ls=":")
            label, box = f"P{crossing.pin} onto {names[crossing.segment]}", {"fc": "white", "ec": "none", "pad": 1}
            defect.text(crossing.phase / unit, 1.2, label, fontsize=8, ha="center", bbox=box)
        drawing.suptitle("One period: the chain fits the bare track at its two ends only")


def draw(results: dict[str, Any]) -> None:
    """The pictures of docs/chain.md."""
    crescent, slot = chain.crescent_slot(L, N, R1)
    draw_track(crescent, slot)
    draw_defect(crescent, slot)
    with figure("chain_fits.png", 1, 2, (10, 4.4), sharey=True) as (drawing, panels):
        for (kind, label), colour in zip(LABELS.items(), (RED, BLUE, ORANGE, GREY)):
            mine = [row for row in results["fits"] if row["kind"] == kind]
            for axes, key in zip(panels, ("unknowns", "evaluate_us")):
                axes.loglog(
                    [row[key] for row in mine], [row["normal"] for row in mine], "o-", color=colour, label=label
                )
        panels[0].set(xlabel="stored numbers", ylabel="largest normal error, mm")
        panels[1].set_xlabel("run time for 1000 points, microseconds")
        panels[0].axhline(0.01, color=GREY, lw=1, ls="--")
        panels[0].legend(loc="lower left")
        drawing.suptitle("Error of each representation of the slot")
    with figure("chain_tracks.png", 2, 2, (10, 7.2)) as (_, panels):
        for axes, row, (label, slot) in zip(panels, results["tracks"], other_tracks().items()):
            draw_slot(axes, slot, 0.5 * (slot.start + slot.end), 3.6)
            axes.set_title(f"{label}\nslot {row['depth']:.3f} deep")


def main() -> None:
    """Measure, and fill the document."""
    crescent, slot = chain.crescent_slot(L, N, R1)
    results = {
        "published": measure_published(crescent, slot),
        "speed": measure_speed(crescent, slot),
        "fits": measure_fits(slot),
        "large_radii": measure_large_radii(),
        "far_origin": measure_far_origin(slot),
        "high_degree": measure_high_degree(slot),
        "tracks": measure_tracks(),
        "free_pin_places": measure_free_pin_places(),
    }
    publish("chain", results)


if __name__ == "__main__":
    main()
