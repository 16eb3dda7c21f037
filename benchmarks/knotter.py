"""Measure the knotter and draw its pictures: ``python -m benchmarks.knotter``. The measurement is seeded."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from benchmarks.knotter_pictures import PAIRS, PUBLISHED, draw, knotters_at  # noqa: F401 - `render` calls draw
from benchmarks.report import ends, lines, run
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import study
from synthesis.scenes.knotter.d_knotter import Needle
from synthesis.scenes.knotter.mechanism import Mechanism
from synthesis.scenes.knotter.segment_triangle import crosses_inside, orientations

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
    return [f"{sum(printed.values())} of {len(printed)}", f"{sum(computed.values())} of {len(computed)}, {comment}"]


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
    close = [row for row in results["predicates"] if row["distance_mm"] <= TOO_CLOSE_MM]
    percentages = [row[f"within_1e-{digits}"] for row in close for digits in (9, 6, 3)]
    return {
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
    yield {"figures": found, "predicates": list(predicate_errors())}


if __name__ == "__main__":
    run(measure)
