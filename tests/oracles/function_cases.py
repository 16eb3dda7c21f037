"""Random functions that some rocker makes exactly, and the errors of a reply recomputed, by independent arithmetic.

The rocker's angle comes from the law of cosines in the triangle of crank pin D, coupler pin C and pivot B, at 50 digits.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf
from numpy.random import Generator

from tests.oracles.classes import any_order, base_order, change_point, double_crank, tiny_crank
from tests.oracles.recompute import DIGITS, LINKS


def rocker_angles(links: Sequence[Any], branch: int, crank: Sequence[Any]) -> list[Any] | None:
    """theta3 at crank angles in radians, continuous; None where the linkage does not close."""
    with mp.workdps(DIGITS):
        l1, l2, l3, l4 = (mpf(value) for value in links)
        found = []
        for t in crank:
            t = mpf(t)
            cosine, sine = mp.cos_sin(t)
            vx, vy = l4 - l1 * cosine, -l1 * sine
            r = mp.sqrt(vx * vx + vy * vy)
            if r == 0:
                return None
            cosine_b = (r * r + l3 * l3 - l2 * l2) / (2 * r * l3)
            if abs(cosine_b) > 1:
                return None
            # D -> B; where L1 > L4 it follows the crank
            toward = mp.atan2(vy, vx) if l1 <= l4 else t + mp.pi + mp.atan2(l4 * sine, l1 - l4 * cosine)
            found.append(toward + mp.pi - branch * mp.acos(cosine_b))
        return found


@dataclass(frozen=True)
class Draw:
    """A class of functions: how lengths are drawn, and from which spans in degrees."""

    lengths: Callable[[Generator], np.ndarray]
    span: tuple[float, float] = (30.0, 360.0)


CLASSES = {
    "crank-rocker": Draw(base_order),
    "any order": Draw(any_order),
    "double-crank": Draw(double_crank),
    "change point": Draw(change_point),
    "tiny span": Draw(any_order, (2.0, 12.0)),
    "tiny crank": Draw(tiny_crank),
}
ZEROS = ("free", "input", "output", "both")


def function_case(kind: str, samples: int, zeros: str, seed: int) -> dict[str, Any]:
    """A request of /v2/function, clockwise in half of the cases, that some linkage meets; angles in degrees."""
    random = np.random.default_rng([zlib.crc32(kind.encode()), samples, ZEROS.index(zeros), seed])
    draw = CLASSES[kind]
    links, branch = draw.lengths(random), int(random.choice([-1, 1]))
    span, start = random.uniform(*draw.span) * random.choice([-1, 1]), random.uniform(0, 360)
    offset = random.uniform(-180, 180)
    with mp.workdps(DIGITS):
        unit = mp.pi / 180
        crank = [(mpf(start) + mpf(span) * m / (samples - 1)) * unit for m in range(samples)]
        angle = rocker_angles(links, branch, crank)
        output = [float(value / unit + mpf(offset)) for value in angle]
        first = float(angle[0] / unit)
    request: dict[str, Any] = {"output": output, "crank_span": span}
    if zeros in ("input", "both"):
        request["input_zero"] = start
    if zeros in ("output", "both"):
        request["output_zero"] = first + 360 * int(random.integers(-1, 2))
    return request


def recompute_rms(request: Mapping[str, Any], solution: Mapping[str, Any], largest: int = 32) -> float:
    """Return J of a solution in radians at up to a number of samples, modulo whole turns; infinite if it opens."""
    samples = len(request["output"])
    chosen = np.unique(np.linspace(0, samples - 1, min(samples, largest)).round().astype(int)).tolist()
    with mp.workdps(DIGITS):
        unit = mp.pi / 180
        start = mpf(solution["start_angle"])
        crank = [(start + mpf(request["crank_span"]) * m / (samples - 1)) * unit for m in chosen]
        angle = rocker_angles([solution["links"][name] for name in LINKS], solution["branch"], crank)
        if angle is None:
            return float("inf")
        gaps = [mpf(request["output"][m]) * unit - a for m, a in zip(chosen, angle)]
        gaps = [gap - mpf(solution["output_offset"]) * unit for gap in gaps]
        # the same number of whole turns for all samples
        turn = 2 * mp.pi * mp.nint(gaps[0] / (2 * mp.pi))
        return float(mp.sqrt(sum((gap - turn) ** 2 for gap in gaps) / len(gaps)))


def zeros_kept(request: Mapping[str, Any], solution: Mapping[str, Any]) -> bool:
    """Return true if the zeros of a solution equal the zeros of the request, modulo a turn, to rounding."""

    def same(a: float, b: float) -> bool:
        return abs((a - b + 180) % 360 - 180) < 1e-9

    if "input_zero" in request and not same(request["input_zero"], solution["start_angle"]):
        return False
    return "output_zero" not in request or same(
        request["output"][0] - request["output_zero"], solution["output_offset"]
    )
