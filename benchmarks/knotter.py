"""Measures the knotter and draws its pictures: ``python -m benchmarks.knotter`` (about a minute).

Seeded; only the times differ from run to run. Every method but Brent's works on arrays of all steps of many pairs at once, and
gets the positions from the same chain: times compare ways to decide and to locate, not ways to program.
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

from benchmarks.knotter_pictures import PAIRS, PAPER_SAYS, draw, pairs_of  # noqa: F401 - `render` calls draw
from benchmarks.report import ends, lines, repeat, run, tables
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import classify, crossing_point, inside, orientations
from synthesis.scenes.knotter.d_knotter import Needle
from synthesis.scenes.knotter.mechanism import Mechanism, as_array
from synthesis.scenes.knotter.study import solve, study
from tests.oracles.knotter import Exact

TOO_CLOSE_MM = 1e-8
"""Distance from an edge at which the sum of angles cannot tell."""
TRIANGLE = tuple(np.array(d_knotter.POINTS[name]) for name in ("S3", "S4", "S5"))


def grid_of(alpha1: np.ndarray, alpha3: np.ndarray) -> tuple[Mechanism, int]:
    """All combinations, and how many there are."""
    first, third = (axis.ravel() for axis in np.meshgrid(alpha1, alpha3))
    return pairs_of(first, third), first.size


def angle_sum(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Degrees under which a point of the plane sees a triangle's edges (eqs 15 and 30): 360 inside, by arccosines."""
    total = np.zeros(len(point))
    with np.errstate(all="ignore"):
        for start, stop in ((a, b), (b, c), (c, a)):
            u, v = start - point, stop - point
            cosine = np.sum(u * v, axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))
            total += np.degrees(np.arccos(cosine))
    return total


def predicate_errors() -> Iterator[dict[str, Any]]:
    """Wrong verdicts beside the edge S3S4, in percent; the truth by rational arithmetic."""
    random = np.random.default_rng(2018)
    a, b, c = TRIANGLE
    along = b - a
    inward = np.cross(along, (1.0, 0.0, 0.0))
    inward *= np.sign(inward @ (c - a)) / np.linalg.norm(inward)
    for distance in (1e-1, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        side = np.repeat([1.0, -1.0], 400)
        point = a + random.uniform(0.02, 0.98, (800, 1)) * along + (side * distance)[:, None] * inward
        truth = np.array([all(u > 0 for u in _exact_sides(row, a, b, c)) for row in point])
        total = angle_sum(point, a, b, c)
        row = {"distance_mm": distance, "equal_360": _percent((total == 360.0) != truth)}
        for exponent in (-9, -6, -3):
            row[f"within_1e{exponent}"] = _percent((np.abs(total - 360.0) <= 10.0**exponent) != truth)
        row["nan"] = _percent(np.isnan(total))
        p, q = np.add(point, (3.0, 0.0, 0.0)), np.subtract(point, (2.0, 0.0, 0.0))
        signs = orientations(tuple(p.T), tuple(q.T), tuple(a), tuple(b), tuple(c))
        row["orientation"] = _percent(inside(signs) != truth)
        row["classify"] = _percent((classify(p, q, a, b, c) == 0) != truth)
        yield row


def _exact_sides(point: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> list[Fraction]:
    p, a, b, c = ([Fraction(float(x)) for x in at[1:]] for at in (point, a, b, c))

    def area(u, v, w) -> Fraction:
        return (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])

    whole = area(a, b, c)
    return [area(u, v, p) * whole for u, v in ((a, b), (b, c), (c, a))]


def _percent(wrong: np.ndarray) -> float:
    return float(100.0 * np.mean(wrong))


def scanned(items: Mechanism, count: int, step: float, way: str = "orientations") -> np.ndarray:
    """The entries by a scan of the whole range: the first step inside, or a straight line back from it.

    Ways: ``orientations``, ``straight line`` (the same, interpolated), ``sum of angles`` (the source's, within 1e-6).
    """
    driver = np.radians(np.arange(0.0, 180.0, step))
    few = max(1, 50_000 // len(driver))
    found = []
    for start in range(0, count, few):
        item = np.arange(start, min(start + few, count))
        shape, row = (len(item), len(driver)), np.arange(len(item))
        corners = d_knotter.wrap().positions(items.item(item[:, None]), driver)
        if way == "sum of angles":
            points = as_array(crossing_point(*corners), shape).reshape(3, -1).T
            hits = (np.abs(angle_sum(points, *TRIANGLE) - 360.0) <= 1e-6).reshape(shape)
        else:
            signs = as_array(orientations(*corners), shape)
            hits = inside(signs)
        at = np.argmax(hits, axis=1)
        entry = np.where(hits[row, at], driver[at], np.nan)
        if way == "straight line":
            before, after = signs[:, row, at - 1], signs[:, row, at]
            with np.errstate(all="ignore"):
                share = np.where(before * after < 0, before / (before - after), 0.0).max(axis=0)
            entry = entry - (1 - share) * np.radians(step)
        found.append(entry)
    return np.concatenate(found)


def rope_of(alpha1: float, alpha3: float) -> Callable[[float], tuple]:
    """S0 and S1 in u4 over the bill's angle: the chain of the default machine, written out for one angle at a time."""
    sizes, senses, law = d_knotter.mechanism().parameters, d_knotter.SENSES, d_knotter.reference_laws()["beta"]
    x, _, z = d_knotter.POINTS["S0"]
    first, third, second = -senses["alpha"] * alpha1, -senses["alpha"] * alpha3, d_knotter.ALPHA2
    c1, s1, c3, s3, c2, s2 = (part(angle) for angle in (first, third, second) for part in (math.cos, math.sin))
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


def bracketed(items: Mechanism, count: int, step: float = 5.0) -> np.ndarray:
    """The entries by the first inside of a grid: the last root by Brent's method of the orientations that changed before it."""
    driver, corners = np.radians(np.arange(0.0, 180.0, step)), [d_knotter.POINTS[name] for name in ("S3", "S4", "S5")]
    item, row = np.arange(count), np.arange(count)
    signs = as_array(
        orientations(*d_knotter.wrap().positions(items.item(item[:, None]), driver)), (count, len(driver))
    )
    hits = inside(signs)
    at = np.argmax(hits, axis=1)
    changed = signs[:, row, at - 1] * signs[:, row, at] < 0
    angles = [np.broadcast_to(items.parameters[name], (count,)).tolist() for name in ("alpha1", "alpha3")]
    entry = np.full(count, np.nan)
    for number in np.flatnonzero(hits[row, at]):
        ends = rope_of(*(angle[number] for angle in angles))
        low, high = driver[at[number] - 1], driver[at[number]]

        def sign(alpha: float, which: int, ends: Callable = ends) -> float:
            return orientations(*ends(alpha), *corners)[which]

        rooted = np.flatnonzero(changed[:, number])
        entry[number] = max(brentq(sign, low, high, args=(which,), xtol=1e-14) for which in rooted)
    return entry


def cells(items: Mechanism, count: int) -> np.ndarray:
    """The entries of the product."""
    return d_knotter.wrap().evaluate(items, count).enter


def one_by_one(items: Mechanism, count: int, entries: Callable = cells) -> np.ndarray:
    """The same, a call for each pair."""
    return np.concatenate([entries(items.item(np.array([row])), 1) for row in range(count)])


def event_errors() -> list[dict]:
    """Largest error over the nine pairs against 40 digits, and time per pair of 900 pairs as a multiple of the cells'."""
    nine = pairs_of(*map(np.array, zip(*PAIRS)))
    many, count = grid_of(np.linspace(0, 20, 30), np.linspace(20, 30, 30))
    found = d_knotter.wrap().evaluate(nine, 9)
    with mp.workdps(40):
        exact = [
            Exact(*pair).root("wrap", int(edge) - 2, at)
            for pair, edge, at in zip(PAIRS, found.opened_by, found.enter)
        ]
    methods: dict[str, Any] = {"cells, 900 pairs at once": cells, "cells, one pair at a time": one_by_one}
    for way, steps in (("sum of angles", (1, 0.1)), ("orientations", (1, 0.1, 0.01)), ("straight line", (1, 0.1))):
        methods |= {f"scan, {way}, {step:g} deg": partial(scanned, step=step, way=way) for step in steps}
    methods["grid of 5 deg and Brent, 900 pairs at once"] = bracketed
    methods["grid of 5 deg and Brent, one pair at a time"] = partial(one_by_one, entries=bracketed)
    times = {
        name: repeat(lambda method=method: method(many, count), 1 if "one pair" in name else 5).least.processor
        for name, method in methods.items()
    }
    return [
        {
            "method": name,
            "max_error_deg": max(abs(float(mp.degrees(float(at) - x))) for at, x in zip(method(nine, 9), exact)),
            "ms_per_pair": 1e3 * times[name] / count,
            "time_over_cells": times[name] / times["cells, 900 pairs at once"],
        }
        for name, method in methods.items()
    ]


def short_windows(closing: float) -> Iterator[dict[str, Any]]:
    """Which scan sees the window that closes as d5 grows, and what the cells find."""
    for short_of in (1.0, 0.3, 0.03, 1e-2, 1e-4, 1e-6, 1e-8):
        item = pairs_of(10, 25, d5=closing - short_of)
        found = d_knotter.wrap().evaluate(item, 1)
        row = {"short_of_mm": short_of, "width_deg": float(np.degrees(found.leave[0] - found.enter[0]))}
        row |= {f"scan_{step:g}": bool(np.isfinite(scanned(item, 1, step)[0])) for step in (2, 1, 0.1, 0.01)}
        yield {**row, "cells": bool(found.holds[0])}


def figures() -> dict:
    """What comes out for what the source prints, and the figures of single pairs that the page names."""
    needle = Needle()
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    result = study(d_knotter.mechanism(), grid, d_knotter.conditions())
    wrap, clearance = result.conditions["wrap"], result.conditions["clearance"]
    chosen, best = PAIRS.index((10, 25)), int(np.argmax(result.margin))
    limiting = min(result.conditions, key=lambda name: result.conditions[name].margin[chosen])
    (closing,), _ = solve(pairs_of(10.0, 25.0), d_knotter.wrap(), "d5", (20.0, 120.0))
    here = {f"{one},{three}": row for row, (one, three) in enumerate(PAIRS)}
    return {
        "alpha2_range": list(np.degrees(needle.free_range())),
        "alpha2_whole": needle.smallest_whole_degree(),
        "d5_at_8": float(needle.lay(d_knotter.ALPHA2)),
        "alpha2_for_54": float(np.degrees(needle.angles_for_lay(54.0)[0])),
        "wrap": {key: bool(wrap.holds[here[key]]) for key in PAPER_SAYS["wrap_pattern"]},
        "clearance": {key: bool(clearance.value[here[key]] < 0) for key in PAPER_SAYS["clearance_pattern"]},
        "feasible": [list(PAIRS[row]) for row in np.flatnonzero(result.feasible)],
        "sample_mm": float(clearance.value[chosen]),
        "worst_mm": float(clearance.worst[chosen]),
        "worst_deg": float(np.degrees(clearance.worst_driver[chosen])),
        "chosen": {"margin_mm": float(result.margin[chosen]), "limited_by": limiting},
        "best": {"pair": list(PAIRS[best]), "margin_mm": float(result.margin[best])},
        "closing_d5_mm": closing.value,
        "closing_deg": float(np.degrees(closing.result.enter[0])),
    }


def agreement(ours: dict[str, bool], printed: dict[str, bool]) -> list[str]:
    """How many hold in print and here, and whether they are the same pairs."""
    wrong = [key for key in printed if ours[key] != printed[key]]
    same = "the same ones; inputs fitted to this" if not wrong else f"another verdict at {', '.join(wrong)}"
    return [f"{sum(printed.values())} of {len(printed)}", f"{sum(ours.values())} of {len(ours)}, {same}"]


def pair_names(pairs: list) -> str:
    """Pairs as a list in words."""
    return ", ".join(f"({one}, {three})" for one, three in pairs)


def blocks(results: dict) -> dict[str, str]:
    """The page's tables and figures."""
    found = results["figures"]
    chosen, best, (low, high) = found["chosen"], found["best"], found["alpha2_range"]
    whole, cut_off = PAPER_SAYS["alpha2_limit"], PAPER_SAYS["d5"]
    kept = "that cut off, not rounded" if int(found["d5_at_8"]) == cut_off else "another length"
    first = "the first whole degree" if found["alpha2_whole"] == whole else f"not the first, {found['alpha2_whole']}"
    same = pair_names(found["feasible"])
    same += "; inputs fitted to the two rows above" if found["feasible"] == PAPER_SAYS["feasible"] else ""
    published = [
        ["needle free (eq 4)", f"alpha2 > {whole} deg", f"{low:.6f} < alpha2 < {high:.6f} deg; {whole} is {first}"],
        ["d5 at alpha2 = 8 deg (eq 5)", f"{cut_off} mm", f"{found['d5_at_8']:.6f} mm; {cut_off} is {kept}"],
        ["alpha2 for d5 = 54 mm", "8 deg", f"{found['alpha2_for_54']:.6f} deg"],
        ["wrap holds", *agreement(found["wrap"], PAPER_SAYS["wrap_pattern"])],
        ["clearance holds at 270 deg", *agreement(found["clearance"], PAPER_SAYS["clearance_pattern"])],
        ["feasible pairs", pair_names(PAPER_SAYS["feasible"]), same],
    ]
    missed = max(row["width_deg"] for row in results["short_windows"] if row["scan_0.01"] is not True)
    found_by_cells = min(row["width_deg"] for row in results["short_windows"] if row["cells"] is True)
    close = [row for row in results["predicates"] if row["distance_mm"] <= TOO_CLOSE_MM]
    shares = [row[f"within_1e-{digits}"] for row in close for digits in (9, 6, 3)]
    return {
        **tables(
            "knotter", results | {"events": [row for row in results["events"] if "orientations" not in row["method"]]}
        ),
        "windows": f"a scan of 0.01° misses one of {missed:.3g}°, the cells find one of {found_by_cells:.3g}°",
        "published": lines(["quantity", "published", "here"], published, 3),
        "worst": f"{found['worst_mm']:.4f} mm at {found['worst_deg']:.4f}°, against {found['sample_mm']:.4f} mm at 270°",
        "chosen": f"{chosen['margin_mm']:.1f} mm to spare, and what limits it is the {chosen['limited_by']}",
        "best": f"{pair_names([best['pair']])} has most: {best['margin_mm']:.1f} mm",
        "closing": (
            f"d5 = {found['closing_d5_mm']:.9f} mm, where E1 passes through the vertex S4 at "
            f"alpha = {found['closing_deg']:.9f}°"
        ),
        "predicates": (
            f"{TOO_CLOSE_MM:.0e} mm and less off the edge {ends(shares, 0)} % of its verdicts are wrong with any tolerance from "
            f"1e-9° to 1e-3°, of the orientations {max(row['orientation'] for row in close):.0f} %"
        ),
    }


def measure() -> Iterator[dict[str, Any]]:
    """All of it."""
    found = figures()
    yield {
        "figures": found,
        "predicates": list(predicate_errors()),
        "events": event_errors(),
        "short_windows": list(short_windows(found["closing_d5_mm"])),
    }


if __name__ == "__main__":
    run(measure)
