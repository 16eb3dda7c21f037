"""Functions with travel, angle to travel by slider-cranks, beside the textbook's design through three Chebyshev points.

The first is an exercise whose solution is printed: crank from 45 to 135 degrees, slider from 100 to 30 mm, its displacement as
the square of the crank's rotation (k1 = 96.4 mm, crank 48.2 mm: qna.carrieradda.com, questions 26130 and 26177). The design is
recomputed here by the method, Freudenstein's equation of the slider-crank s^2 + k3 = k1 s cos t + k2 sin t through three points,
compared with what is printed, and its error taken over 2,001 places. For the other functions, which are those that function
generators are shown with, no printed error of a slider-crank could be checked; the method is tried at all zeros of a grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import linkage_atlas as la
from benchmarks import report
from benchmarks.report import Times
from synthesis.arrays import Floats

PRINTED_K1, PRINTED_CRANK = 96.4, 48.2
POINTS = 2001
CASES: tuple[
    tuple[str, dict[str, Any], Callable[[Floats], Floats], float, float, tuple[float, float] | None], ...
] = (
    (
        "x^2, 0..1 (exercise)",
        {"name": "power", "exponent": 2, "x": [0, 1]},
        lambda u: u**2,
        90.0,
        -70.0,
        (45.0, 100.0),
    ),
    ("log10 x, 1..2", {"name": "log10", "x": [1, 2]}, lambda u: np.log10(1 + u) / np.log10(2), 60.0, 50.0, None),
    (
        "x^1.5, 1..4",
        {"name": "power", "exponent": 1.5, "x": [1, 4]},
        lambda u: ((1 + 3 * u) ** 1.5 - 1) / 7,
        90.0,
        50.0,
        None,
    ),
    ("sin x, 0..90", {"name": "sin", "x": [0, 90]}, lambda u: np.sin(u * np.pi / 2), 90.0, 50.0, None),
    ("exp x, 0..1", {"name": "exp", "x": [0, 1]}, lambda u: np.expm1(u) / np.expm1(1), 90.0, 50.0, None),
)
"""Name, function, its share of the output over the share of the input, crank span, travel, zeros that are given."""


def three_points(curve: Callable[[Floats], Floats], crank: float, travel: float, zeros: tuple[float, float]) -> Any:
    """Crank, rod, offset through three Chebyshev points, and the largest error; None where there is no such linkage."""
    share = 0.5 - 0.5 * np.cos((2 * np.arange(1, 4) - 1) * np.pi / 6)
    t, s = np.deg2rad(zeros[0] + crank * share), zeros[1] + travel * curve(share)
    try:
        k = np.linalg.solve(np.stack([s * np.cos(t), np.sin(t), -np.ones(3)], axis=1), s**2)
    except np.linalg.LinAlgError:
        return None
    size = k[0] / 2
    if not abs(size) > 1e-9:
        return None
    offset = k[1] / (2 * size)
    square = size**2 + offset**2 - k[2]
    if not square > 0:
        return None
    rod, fractions = np.sqrt(square), np.linspace(0.0, 1.0, POINTS)
    t, target = np.deg2rad(zeros[0] + crank * fractions), zeros[1] + travel * curve(fractions)
    across = offset - size * np.sin(t)
    if np.any(np.abs(across) >= rod):
        return None
    side = 1.0 if np.interp(share[0], fractions, target - size * np.cos(t)) > 0 else -1.0
    gap = np.abs(size * np.cos(t) + side * np.sqrt(rod**2 - across**2) - target).max()
    return [float(abs(size)), float(rod), float(offset)], float(gap)


def best_of_zeros(curve: Callable[[Floats], Floats], crank: float, travel: float) -> Any:
    """The best such design over starts of whole tens of degrees and places of the slider up to six travels away."""
    found = [
        three_points(curve, crank, travel, (start, zero * abs(travel)))
        for start in range(0, 360, 10)
        for zero in np.linspace(-6, 6, 49)
    ]
    return min((result for result in found if result is not None), key=lambda result: result[1])


def measure() -> Iterator[dict[str, Any]]:
    """All functions."""
    rows = []
    for name, function, curve, crank, travel, zeros in CASES:
        request: dict[str, Any] = {
            "function": {**function, "output_span": travel},
            "crank_span": crank,
            "output_unit": "length",
            "objective": "max",
            "top": 1,
        }
        times = Times()
        free = times.run(lambda request=request: la.function(**request)).best
        practical = la.function(**request, limits={"preset": "practical"}).best
        design, error = (
            best_of_zeros(curve, crank, travel) if zeros is None else three_points(curve, crank, travel, zeros)
        )
        row = {"name": name, "dials": f"{crank:g}/{travel:g}", "design": design, "three_points": error}
        if zeros is not None:
            if abs(design[0] - PRINTED_CRANK) > 0.05:
                raise SystemExit(f"the printed crank is {PRINTED_CRANK}, recomputed {design[0]}")
            same = la.function(**request, input_zero=zeros[0], output_zero=zeros[1]).best
            row |= {"same_zeros": same.errors.max}
        row |= {
            "free": free.errors.max,
            "alternations": free.errors.alternations,
            "transmission": free.transmission_angle_min,
            "lengths": list(free.lengths.values()),
            "practical": practical.errors.max,
            "practical_lengths": list(practical.lengths.values()),
            "ms": 1000 * times.median.processor,
        }
        rows.append(row)
        print(row, flush=True)
    yield {"rows": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/function.md."""

    def lengths(values: list[float]) -> str:
        return ", ".join(f"{value:.4g}" for value in values)

    rows = [
        [
            row["name"],
            row["dials"],
            f"{row['three_points']:.3g}",
            f"{row['same_zeros']:.3g}" if "same_zeros" in row else "-",
            f"{row['free']:.3g}",
            f"{row['transmission']:.1f}",
            lengths(row["lengths"]),
            f"{row['practical']:.3g}",
            lengths(row["practical_lengths"]),
            f"{row['ms']:.0f}",
        ]
        for row in results["rows"]
    ]
    head = ["function", "crank, degrees / travel, mm", "three points", "same zeros", "free zeros"]
    head += ["transmission angle", "crank, rod, offset", "practical limits", "crank, rod, offset", "processor ms"]
    return {"functions": report.lines(head, rows, 2)}


if __name__ == "__main__":
    report.run(measure)
