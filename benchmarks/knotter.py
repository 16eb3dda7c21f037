"""Measure the knotter and draw its pictures: ``python -m benchmarks.knotter`` (about a minute).

The measurement is seeded; only the times differ between runs.
Except for Brent's method, every method works on arrays of all steps of many pairs at once.
All of them compute the positions by the same chain, so that the times compare methods and not implementations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from typing import Any

import mpmath as mp
import numpy as np
from scipy.optimize import brentq

from benchmarks.knotter_pictures import PAIRS, PUBLISHED, draw, knotters_at  # noqa: F401 - `render` calls draw
from benchmarks.report import ends, lines, repeat, run, tables
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.d_knotter import Needle
from synthesis.scenes.knotter.mechanism import Mechanism, as_array
from synthesis.scenes.knotter.segment_triangle import crosses_inside, crossing_point, orientations
from synthesis.scenes.knotter.study import study
from tests.oracles.knotter import Exact

TOO_CLOSE_MM = 1e-8
"""Distance from an edge below which the sum of angles is unreliable."""
TRIANGLE = tuple(np.array(d_knotter.POINTS[name]) for name in ("S3", "S4", "S5"))
"""Triangle of the wrap."""


def grid_of(alpha1: np.ndarray, alpha3: np.ndarray) -> tuple[Mechanism, int]:
    """Return the knotters of all combinations, and their number."""
    first, third = (axis.ravel() for axis in np.meshgrid(alpha1, alpha3))
    return knotters_at(first, third), first.size


def angle_sum(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the sum of the angles (degrees) subtended by a triangle's edges at a point (eqs 15 and 30), 360 inside."""
    total = np.zeros(len(point))
    with np.errstate(all="ignore"):
        for start, stop in ((a, b), (b, c), (c, a)):
            u, v = start - point, stop - point
            cosine = np.sum(u * v, axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
            total += np.degrees(np.arccos(cosine))
    return total


def predicate_errors() -> Iterator[dict[str, Any]]:
    """Compute the percentage of wrong verdicts near the edge S3S4, compared with rational arithmetic."""
    random = np.random.default_rng(2018)
    a, b, c = TRIANGLE
    along = b - a
    inward = np.cross(along, (1.0, 0.0, 0.0))
    inward *= np.sign(inward @ (c - a)) / np.linalg.norm(inward)
    for distance in (1e-1, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        side = np.repeat([1.0, -1.0], 400)
        point = a + random.uniform(0.02, 0.98, (800, 1)) * along + (side * distance)[:, None] * inward
        exact = np.array([all(u > 0 for u in _exact_sides(row, a, b, c)) for row in point])
        total = angle_sum(point, a, b, c)
        row = {"distance_mm": distance, "equal_360": _percent((total == 360.0) != exact)}
        for exponent in (-9, -6, -3):
            row[f"within_1e{exponent}"] = _percent((np.abs(total - 360.0) <= 10.0**exponent) != exact)
        row["nan"] = _percent(np.isnan(total))
        p, q = np.add(point, (3.0, 0.0, 0.0)), np.subtract(point, (2.0, 0.0, 0.0))
        signs = orientations(tuple(p.T), tuple(q.T), tuple(a), tuple(b), tuple(c))
        row["orientation"] = _percent(crosses_inside(signs) != exact)
        yield row


def _exact_sides(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> list[Fraction]:
    """Return three numbers that are all positive if the point lies inside, in rational arithmetic."""
    p, a, b, c = ([Fraction(float(x)) for x in corner[1:]] for corner in (point, a, b, c))

    def area(u, v, w) -> Fraction:
        return (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])

    total_area = area(a, b, c)
    return [area(u, v, p) * total_area for u, v in ((a, b), (b, c), (c, a))]


def _percent(wrong: np.ndarray) -> float:
    return float(100.0 * np.mean(wrong))


def scan_entries(items: Mechanism, count: int, step: float, method: str = "orientations") -> np.ndarray:
    """Find the entries by a scan of the whole range.

    Methods: ``orientations`` returns the first step inside, ``straight line`` interpolates back from it, and ``sum of
    angles`` returns the first step inside by the criterion of the source, within 1e-6 degrees.
    """
    driver = np.radians(np.arange(0.0, 180.0, step))
    chunk = max(1, 50_000 // len(driver))
    entries = []
    for start in range(0, count, chunk):
        item = np.arange(start, min(start + chunk, count))
        shape, row = (len(item), len(driver)), np.arange(len(item))
        corners = d_knotter.wrap().positions(items.select(item[:, None]), driver)
        if method == "sum of angles":
            points = as_array(crossing_point(*corners), shape).reshape(3, -1).T
            inside = (np.abs(angle_sum(points, *TRIANGLE) - 360.0) <= 1e-6).reshape(shape)
        else:
            signs = as_array(orientations(*corners), shape)
            inside = crosses_inside(signs)
        first = np.argmax(inside, axis=1)
        entry = np.where(inside[row, first], driver[first], np.nan)
        if method == "straight line":
            before, after = signs[:, row, first - 1], signs[:, row, first]
            with np.errstate(all="ignore"):
                fraction = np.where(before * after < 0, before / (before - after), 0.0).max(axis=0)
            entry = entry - (1 - fraction) * np.radians(step)
        entries.append(entry)
    return np.concatenate(entries)


def rope_of(alpha1: float, alpha3: float) -> Callable[[float], tuple]:
    """Return S0 and S1 in u4 as a function of the bill's angle, written without arrays for a single angle at a time."""
    sizes, senses, law = d_knotter.mechanism().parameters, d_knotter.SENSES, d_knotter.assumed_laws()["beta"]
    x, _, z = d_knotter.POINTS["S0"]
    first, third, second = -senses["alpha"] * alpha1, -senses["alpha"] * alpha3, d_knotter.ALPHA2
    c1, s1, c3, s3, c2, s2 = (
        function(angle) for angle in (first, third, second) for function in (math.cos, math.sin)
    )
    c13, s13 = c1 * c3 - s1 * s3, s1 * c3 + c1 * s3
    y = -sizes["D"] * c13 + sizes["d1"] * s3
    low = -sizes["D"] * s13 - sizes["d1"] * c3

    def ends(alpha: float) -> tuple:
        beta = senses["beta"] * (law.lead + law.ratio * alpha)
        across, up = math.cos(beta) * x + math.sin(beta) * z, math.cos(beta) * z - math.sin(beta) * x
        i, j, k = across + sizes["d5"], y - s13 * up, low + c13 * up
        i, k = c2 * i + s2 * k, c2 * k - s2 * i + sizes["d6"]
        c, s = math.cos(alpha), math.sin(alpha)
        return (c * i - s * j, s * i + c * j, k), d_knotter.POINTS["S1"]

    return ends


def brent_entries(items: Mechanism, count: int, step: float = 5.0) -> np.ndarray:
    """Find the entries by a coarse grid and Brent's method.

    The entry is the last root, before the first grid point inside, of the orientations that change sign there.
    """
    driver, corners = np.radians(np.arange(0.0, 180.0, step)), [d_knotter.POINTS[name] for name in ("S3", "S4", "S5")]
    item, row = np.arange(count), np.arange(count)
    signs = as_array(
        orientations(*d_knotter.wrap().positions(items.select(item[:, None]), driver)), (count, len(driver))
    )
    inside = crosses_inside(signs)
    first = np.argmax(inside, axis=1)
    changed = signs[:, row, first - 1] * signs[:, row, first] < 0
    angles = [np.broadcast_to(items.parameters[name], (count,)).tolist() for name in ("alpha1", "alpha3")]
    entry = np.full(count, np.nan)
    for number in np.flatnonzero(inside[row, first]):
        ends = rope_of(*(angle[number] for angle in angles))
        low, high = driver[first[number] - 1], driver[first[number]]

        def orientation(alpha: float, index: int, ends: Callable = ends) -> float:
            return orientations(*ends(alpha), *corners)[index]

        bracketed = np.flatnonzero(changed[:, number])
        entry[number] = max(brentq(orientation, low, high, args=(index,), xtol=1e-14) for index in bracketed)
    return entry


def cell_entries(items: Mechanism, count: int) -> np.ndarray:
    """Find the entries by the method of this project."""
    return d_knotter.wrap().evaluate(items, count).enter


def pair_by_pair(items: Mechanism, count: int, entries: Callable = cell_entries) -> np.ndarray:
    """Find the entries by a separate call for each pair."""
    return np.concatenate([entries(items.select(np.array([row])), 1) for row in range(count)])


def event_errors() -> list[dict]:
    """Measure the largest error over the nine pairs, compared with 40 digits, and the time per pair for 900 pairs."""
    nine = knotters_at(*map(np.array, zip(*PAIRS)))
    many, count = grid_of(np.linspace(0, 20, 30), np.linspace(20, 30, 30))
    found = d_knotter.wrap().evaluate(nine, 9)
    with mp.workdps(40):
        exact = [
            Exact(*pair).root("wrap", int(edge) - 2, entry)
            for pair, edge, entry in zip(PAIRS, found.entered_by, found.enter)
        ]
    methods: dict[str, Any] = {"cells, 900 pairs at once": cell_entries, "cells, one pair at a time": pair_by_pair}
    for method, steps in (("sum of angles", (1, 0.1)), ("orientations", (1, 0.1, 0.01)), ("straight line", (1, 0.1))):
        methods |= {
            f"scan, {method}, {step:g} deg": partial(scan_entries, step=step, method=method) for step in steps
        }
    methods["grid of 5 deg and Brent, 900 pairs at once"] = brent_entries
    methods["grid of 5 deg and Brent, one pair at a time"] = partial(pair_by_pair, entries=brent_entries)
    times = {
        name: repeat(lambda method=method: method(many, count), 1 if "one pair" in name else 5).minimum.processor
        for name, method in methods.items()
    }
    return [
        {
            "method": name,
            "max_error_deg": max(
                abs(float(mp.degrees(float(entry) - x))) for entry, x in zip(method(nine, 9), exact)
            ),
            "ms_per_pair": 1e3 * times[name] / count,
            "time_over_cells": times[name] / times["cells, 900 pairs at once"],
        }
        for name, method in methods.items()
    ]


def short_windows(closing: float) -> Iterator[dict[str, Any]]:
    """Determine which scans find the window that closes as d5 grows, and whether the cells find it."""
    for distance in (1.0, 0.3, 0.03, 1e-2, 1e-4, 1e-6, 1e-8):
        item = knotters_at(10, 25, d5=closing - distance)
        found = d_knotter.wrap().evaluate(item, 1)
        row = {"short_of_mm": distance, "width_deg": float(np.degrees(found.leave[0] - found.enter[0]))}
        row |= {f"scan_{step:g}": bool(np.isfinite(scan_entries(item, 1, step)[0])) for step in (2, 1, 0.1, 0.01)}
        yield {**row, "cells": bool(found.holds[0])}


def closing_length() -> float:
    """Return the largest d5 at which the pair (10, 25) wraps the rope, by bisection of the exact verdict."""
    low, high = 54.0, 120.0
    while (middle := 0.5 * (low + high)) not in (low, high):
        holds = d_knotter.wrap().evaluate(knotters_at(10.0, 25.0, d5=middle), 1).holds[0]
        low, high = (middle, high) if holds else (low, middle)
    return low


def figures() -> dict:
    """Compute the quantities that the source prints, and the figures of single pairs in the document."""
    needle = Needle()
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    result = study(d_knotter.mechanism(), grid, d_knotter.conditions())
    wrap, clearance = result.conditions["wrap"], result.conditions["clearance"]
    chosen, best = PAIRS.index((10, 25)), int(np.argmax(result.margin))
    limiting = min(result.conditions, key=lambda name: result.conditions[name].margin[chosen])
    closing = closing_length()
    index = {f"{alpha1},{alpha3}": row for row, (alpha1, alpha3) in enumerate(PAIRS)}
    return {
        "alpha2_range": list(np.degrees(needle.free_range())),
        "alpha2_whole": needle.smallest_whole_degree(),
        "d5_at_8": float(needle.d5(d_knotter.ALPHA2)),
        "alpha2_for_54": float(np.degrees(needle.angles_for_d5(54.0)[0])),
        "wrap": {key: bool(wrap.holds[index[key]]) for key in PUBLISHED["wrap_pattern"]},
        "clearance": {key: bool(clearance.value[index[key]] < 0) for key in PUBLISHED["clearance_pattern"]},
        "feasible": [list(PAIRS[row]) for row in np.flatnonzero(result.feasible)],
        "sample_mm": float(clearance.value[chosen]),
        "worst_mm": float(clearance.worst[chosen]),
        "worst_deg": float(np.degrees(clearance.worst_driver[chosen])),
        "chosen": {"margin_mm": float(result.margin[chosen]), "limited_by": limiting},
        "best": {"pair": list(PAIRS[best]), "margin_mm": float(result.margin[best])},
        "closing_d5_mm": closing,
        "closing_deg": float(np.degrees(d_knotter.wrap().evaluate(knotters_at(10.0, 25.0, d5=closing), 1).enter[0])),
    }


def agreement(computed: dict[str, bool], printed: dict[str, bool]) -> list[str]:
    """Return the number of pairs that hold in print and here, and a comment on their agreement."""
    wrong = [key for key in printed if computed[key] != printed[key]]
    comment = (
        f"different verdicts at {', '.join(wrong)}" if wrong else "the same pairs; the inputs are fitted to them"
    )
    return [
        f"{sum(printed.values())} of {len(printed)}",
        f"{sum(computed.values())} of {len(computed)}, {comment}",
    ]


def pair_names(pairs: list) -> str:
    """Return pairs as text."""
    return ", ".join(f"({alpha1}, {alpha3})" for alpha1, alpha3 in pairs)


def published_rows(found: dict) -> list[list[str]]:
    """Return the rows of the table that compares published figures with the figures of this project."""
    low, high = found["alpha2_range"]
    limit, d5 = PUBLISHED["alpha2_limit"], PUBLISHED["d5"]
    truncated = int(found["d5_at_8"]) == d5
    d5_comment = f"the source truncates it to {d5}" if truncated else f"the source prints {d5}"
    is_first = found["alpha2_whole"] == limit
    limit_comment = f"the first whole degree is {limit if is_first else found['alpha2_whole']}"
    feasible = pair_names(found["feasible"])
    feasible += "; the inputs are fitted to the two rows above" if found["feasible"] == PUBLISHED["feasible"] else ""
    return [
        ["needle free (eq 4)", f"alpha2 > {limit} deg", f"{low:.6f} < alpha2 < {high:.6f} deg; {limit_comment}"],
        ["d5 at alpha2 = 8 deg (eq 5)", f"{d5} mm", f"{found['d5_at_8']:.6f} mm; {d5_comment}"],
        ["alpha2 for d5 = 54 mm", "8 deg", f"{found['alpha2_for_54']:.6f} deg"],
        ["wrap holds", *agreement(found["wrap"], PUBLISHED["wrap_pattern"])],
        ["clearance holds at 270 deg", *agreement(found["clearance"], PUBLISHED["clearance_pattern"])],
        ["feasible pairs", pair_names(PUBLISHED["feasible"]), feasible],
    ]


def blocks(results: dict) -> dict[str, str]:
    """Return the tables and figures of docs/knotter.md."""
    found = results["figures"]
    chosen, best = found["chosen"], found["best"]
    missed = max(row["width_deg"] for row in results["short_windows"] if row["scan_0.01"] is not True)
    found_by_cells = min(row["width_deg"] for row in results["short_windows"] if row["cells"] is True)
    close = [row for row in results["predicates"] if row["distance_mm"] <= TOO_CLOSE_MM]
    percentages = [row[f"within_1e-{digits}"] for row in close for digits in (9, 6, 3)]
    return {
        **tables(
            "knotter", results | {"events": [row for row in results["events"] if "orientations" not in row["method"]]}
        ),
        "windows": (
            f"a scan with a step of 0.01° misses a window of {missed:.3g}°, but the cells find a window of "
            f"{found_by_cells:.3g}°"
        ),
        "published": lines(["quantity", "published", "here"], published_rows(found), 3),
        "worst": f"{found['worst_mm']:.4f} mm at {found['worst_deg']:.4f}°, compared with {found['sample_mm']:.4f} mm at 270°",
        "chosen": f"a margin of {chosen['margin_mm']:.1f} mm, which is limited by the {chosen['limited_by']}",
        "best": f"{pair_names([best['pair']])} has the largest margin, {best['margin_mm']:.1f} mm",
        "closing": (
            f"d5 = {found['closing_d5_mm']:.9f} mm, where E1 passes through the vertex S4 at "
            f"alpha = {found['closing_deg']:.9f}°"
        ),
        "predicates": (
            f"at {TOO_CLOSE_MM:.0e} mm or less from the edge, {ends(percentages, 0)} % of its verdicts are wrong for any "
            f"tolerance from 1e-9° to 1e-3°, compared with {max(row['orientation'] for row in close):.0f} % of the "
            "verdicts by orientations"
        ),
    }


def measure() -> Iterator[dict[str, Any]]:
    """Measure everything."""
    found = figures()
    yield {
        "figures": found,
        "predicates": list(predicate_errors()),
        "events": event_errors(),
        "short_windows": list(short_windows(found["closing_d5_mm"])),
    }


if __name__ == "__main__":
    run(measure)
