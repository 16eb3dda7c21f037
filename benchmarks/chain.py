"""The chain on a U-shaped slide: published numbers and speed, for docs/chain.md.

All results except times are reproducible up to rounding. A time is the smallest processor time of several runs, and
times are compared only within the same run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import brentq

from benchmarks import chain_pictures as pictures
from benchmarks import report as page
from synthesis.errors import FieldError
from synthesis.one_variable import bisect
from synthesis.scenes.chain.closure import closing_links
from synthesis.scenes.chain.crescent import Crescent, Dimensions, level_crescent
from synthesis.scenes.chain.slot import Slot, analyse_slot, chord_error, crescent_slot, wheel_conflict
from synthesis.scenes.chain.track import Track
from tests.oracles import chain as oracle

L, N, R1 = 131.0, 16, 181.78
PRINTED = {"wheel_radius": 92.63, "lower_radius": 381.5, "eccentricity": 90.22}
REFUSED = '{"pitch": 131, "links": 14, "upper_radius": 181.78}'
PHASES, SEARCHED = 9001, 91
"""Number of phases for errors and times, and number of phases that are computed individually for a time per phase."""


def next_by_bracketing(path: oracle.Path, s: float, pitch: float, direction: int = 1) -> float:
    """Find the next pin by scipy's brentq on the distance, for a single pin."""
    x, y = path.point(s)

    def excess(u: float) -> float:
        px, py = path.point(s + direction * u)
        return math.hypot(px - x, py - y) - pitch

    return s + direction * brentq(excess, 0.99 * pitch, 1.6 * pitch, xtol=1e-300, rtol=8.9e-16)


def next_by_halving(track: Track, s: np.ndarray, pitch: float, direction: int = 1) -> np.ndarray:
    """Find the next pins by bisection, for all phases at once."""
    pin = track.points(track.locate(s))

    def short(u: np.ndarray) -> np.ndarray:
        return np.abs(track.points(track.locate(s + direction * u)) - pin) < pitch

    inside, _ = bisect(short, np.full(s.shape, 0.99 * pitch), np.full(s.shape, 1.6 * pitch))
    return s + direction * inside


def pins_by_search(slot: Slot, phases: np.ndarray, following: Any, points: Any) -> np.ndarray:
    """Return all pins, shape (n, links), from ``following(s, direction)`` and ``points(s)`` of arrays."""
    ahead, behind = [phases], [phases]
    for _ in range(slot.free - 2):
        ahead.append(following(ahead[-1], 1))
    for _ in range(slot.chain.links - slot.free):
        behind.append(following(behind[-1], -1))
    a, b = points(ahead[-1]), points(behind[-1])
    h = np.abs(b - a) / 2
    free = (a + b) / 2 + 1j * (b - a) / (2 * h) * np.sqrt(slot.chain.pitch**2 - h**2)
    return np.stack([*map(points, ahead), free, *map(points, behind[:0:-1])], axis=1)


def measure_published(crescent: Crescent, slot: Slot) -> dict[str, Any]:
    facts, degrees = analyse_slot(slot, slot.phases(PHASES)), math.degrees
    printed, printed_slot = crescent_slot(Dimensions(L, N, R1, **PRINTED))
    conflict = degrees(crescent.link_angles(L)[0]) * wheel_conflict(slot)
    try:
        crescent_slot(Dimensions(L, 14, R1))
    except FieldError as error:
        refusal = str(error)
    rows = [
        ["links that close", "16", f"{closing_links(printed.track, L)}"],
        ["wheel radius R0", "92.63", f"{crescent.wheel_radius:.4f}"],
        ["lower radius R2", "381.50", f"{crescent.lower_radius:.4f}"],
        ["eccentricity b", "90.22", f"{crescent.eccentricity:.4f}"],
        ["xi", "18.2 deg", f"{degrees(crescent.xi):.4f} deg"],
        ["alpha", "71.8 deg", f"{degrees(crescent.alpha):.4f} deg"],
        ["tangency residual of the printed numbers", "0 intended", f"{printed.tangency_residual:.4f}"],
        ["theta1m, start of the window", "not given", f"{degrees(slot.start / crescent.wheel_radius):.4f} deg"],
        ["depth of the slot", "not given", f"{facts.depth_max:.4f}"],
        ["smallest curvature radius", "not given", f"{facts.radius_min:.3f}"],
        ["largest closure defect", "not given", f"{degrees(facts.slack_max.value / R1):.4f} deg"],
        ["wheel phase conflict", "not given", f"{conflict:.3f} deg"],
        [f"largest chord error over {PHASES} phases", "not given", f"{facts.chord_error:.1e}"],
    ]
    words = {
        "printed_end_step": f"{analyse_slot(printed_slot, printed_slot.phases(3)).end_step:.3f}",
        "slack": f"{facts.slack_max.value:.3f}",
        "refusal": f"    $ echo '{REFUSED}' | linkage-atlas chain slot\n    {refusal}",
    }
    return {"rows": rows, "words": words}


def measure_speed(crescent: Crescent, slot: Slot) -> dict[str, Any]:
    """Measure the time per phase of the closed form and of the search, for all phases at once and for individual phases."""
    phases, few, track = slot.phases(PHASES), slot.phases(SEARCHED), slot.chain.track
    path = oracle.crescent(crescent.wheel_radius, R1, crescent.lower_radius, crescent.eccentricity)

    def bracketing(phase: float) -> np.ndarray:
        def following(s: np.ndarray, direction: int) -> np.ndarray:
            return np.array([next_by_bracketing(path, s[0], L, direction)])

        return pins_by_search(slot, np.array([phase]), following, lambda s: np.array([complex(*path.point(s[0]))]))

    def halving() -> np.ndarray:
        return pins_by_search(
            slot,
            phases,
            lambda s, direction: next_by_halving(track, s, L, direction),
            lambda s: track.points(track.locate(s)),
        )

    few_found = np.concatenate([bracketing(phase) for phase in few])
    differences = [np.abs(few_found - slot.pins(few)).max(), np.abs(halving() - slot.pins(phases)).max()]

    def milliseconds(work: Any, runs: int = 9) -> float:
        return 1e3 * page.repeat(work, runs).minimum.processor

    def row(task: str, by: str, ours: float, search: float) -> dict[str, Any]:
        return {"task": task, "by": by, "ours_ms": ours, "search_ms": search, "ratio": search / ours}

    single = milliseconds(lambda: [slot.pins(few[at : at + 1]) for at in range(SEARCHED)], 3) / SEARCHED
    searched = milliseconds(lambda: [bracketing(phase) for phase in few], 3) / SEARCHED
    at_once = milliseconds(lambda: slot.pins(phases)), milliseconds(halving, 3)
    return {
        "rows": [
            row(f"all pins at {PHASES} phases, all phases at once", "bisection", *at_once),
            row("all pins of one phase", "brentq", single, searched),
        ],
        "checked_ms": milliseconds(lambda: chord_error(slot, phases)),
        "closure_ms": milliseconds(lambda: crescent_slot(Dimensions(L, N, R1)), 5),
        "largest_difference": max(differences),
    }


def arc_angle(wheel_angles: np.ndarray, wheel_radius: float, arc_radius: float) -> np.ndarray:
    """Return the angle on the lower arc of the pin before a pin on the wheel, both from the tangent point."""
    a, r, cos = arc_radius - wheel_radius, wheel_radius, np.cos(wheel_angles)
    p, q = -2 * arc_radius * (a + r * cos), 2 * r * arc_radius * np.sin(wheel_angles)
    return np.arctan2(q, p) - np.arccos((L**2 - (arc_radius**2 + a**2 + r**2 + 2 * a * r * cos)) / np.hypot(p, q))


def measure_large_radii() -> Iterator[dict[str, Any]]:
    """Measure the chord errors of a step from a wheel onto an arc of radius R, by the arccos form of the source and by ours."""
    r0 = PRINTED["wheel_radius"]
    for radius in (1e3, 1e5, 1e6, 1e7, 1e8):
        crescent = level_crescent(r0, R1, math.asin((r0 + R1) / (radius - r0)))
        track, xi = crescent.track, crescent.xi
        v = np.linspace(0.05, crescent.link_angles(L)[0] - 0.05, 200)
        here = r0 * np.exp(1j * (np.pi + xi - v)) - (r0 + R1)
        u = arc_angle(v, r0, radius)
        there = 1j * crescent.eccentricity + radius * np.exp(1j * (np.pi + xi + u))
        position = track.locate(r0 * (np.pi + xi - v))
        chords = {"arccos": there - here, "ours": track.points(track.advance(position, L)) - track.points(position)}
        yield {"radius": radius} | {name: np.abs(np.abs(c) - L).max() for name, c in chords.items()}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables and figures of docs/chain.md."""
    speed, words = results["speed"], results["published"]["words"]
    at_once, large = speed["rows"][0], results["large_radii"][-1]
    return {
        "published": page.lines(["quantity", "published", "ours"], results["published"]["rows"], 3),
        **{name: words[name] for name in ("printed_end_step", "slack", "refusal")},
        "speed_ours": f"{at_once['ours_ms']:.0f} ms",
        "speed_ratio": f"{at_once['ratio']:.0f}",
        "speed_difference": f"{speed['largest_difference']:.0e} mm",
        "large_radii": f"{max(row['ours'] for row in results['large_radii']):.1e} mm at radii up to {large['radius']:.0e} mm",
        "arccos_error": f"{large['arccos']:.1e} mm",
    }


def draw(results: dict[str, Any]) -> None:
    """Draw the pictures of docs/chain.md."""
    crescent, slot = crescent_slot(Dimensions(L, N, R1))
    pictures.draw_track(crescent, slot)
    pictures.draw_defect(crescent, slot)


def measure() -> Iterator[dict[str, Any]]:
    """Run all measurements."""
    crescent, slot = crescent_slot(Dimensions(L, N, R1))
    yield {
        "published": measure_published(crescent, slot),
        "speed": measure_speed(crescent, slot),
        "large_radii": list(measure_large_radii()),
    }


if __name__ == "__main__":
    page.run(measure)
