"""Forces two ways, and tolerances simulated and to first order (`make studies`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

import linkage_atlas as la
from benchmarks import report
from benchmarks.report import Times
from tests.oracles.classes import make_case

CLASS = "any order"
ANGLES = ((10.0, 90.0), (1.0, 10.0), (0.1, 1.0), (1e-3, 0.1))
"""Classes of transmission angles in degrees."""
SIZES = (1e-4, 1e-3, 1e-2, 3e-2)
"""Tolerances over the motion's extent."""


def cases(count: int) -> Iterator[tuple[dict[str, Any], la.Result]]:
    """Random motions of crank-rockers with the exact answer."""
    for seed in range(count):
        request = make_case(CLASS, seed).request
        names = ("rotation", "position", "crank_span", "crank_angle")
        motion = {name: request[name] for name in names if name in request}
        found = la.synthesize(**motion, top=1, degrees=request.get("angle_unit", "deg") == "deg")
        if found.solutions:
            yield motion, found


def forces(count: int) -> list[dict[str, Any]]:
    """How well the torque by statics and that by virtual work agree, by transmission angle."""
    random = np.random.default_rng(1)
    gaps: dict[tuple[float, float], list[float]] = {bounds: [] for bounds in ANGLES}
    while min(map(len, gaps.values())) < count:
        lengths = random.uniform(1, 100, 4)
        linkage = la.FourBar(
            *lengths, coupler_point_polar=(random.uniform(0, 100), random.uniform(-180, 180)), degrees=False
        )
        # half of the places near where coupler and rocker lie on a line
        reach = (lengths[0] ** 2 + lengths[3] ** 2 - (lengths[1] + lengths[2]) ** 2) / (2 * lengths[0] * lengths[3])
        toggle_angles = np.arccos(reach) - 10.0 ** random.uniform(-12, 0, 50) if abs(reach) < 1 else np.empty(0)
        force, torque = random.normal(size=2) * 100, float(random.normal() * 1000)
        crank = np.concatenate([random.uniform(0, 2 * np.pi, 50), toggle_angles])
        found = linkage.analysis(1.0, {"force": force, "torque": torque}, crank)
        assert found.velocity is not None and found.drive_load is not None
        parts = np.column_stack([found.velocity * force, found.angular_velocity.coupler * torque])
        gap = np.abs(found.drive_load + parts.sum(axis=1)) / np.abs(parts).sum(axis=1)
        for low, high in ANGLES:
            inside = np.rad2deg(found.transmission_angle)
            gaps[low, high] += gap[(inside > low) & (inside <= high)].tolist()
    return [
        {"low": low, "high": high, "places": len(values), "median": float(np.median(values)), "worst": max(values)}
        for (low, high), values in gaps.items()
    ]


def tolerances(solved: list[tuple[dict[str, Any], la.Result]]) -> list[dict[str, Any]]:
    """The first order against the simulation, by the size of the tolerances."""
    rows = []
    for size in SIZES:
        times, ratios, unclosed = Times(), [], []
        for motion, found in solved:
            position = np.array(motion["position"])
            extent = float(np.linalg.norm(position - position.mean(axis=0), axis=1).max())
            sizes = {name: size * extent for name in ("links", "pivots", "clearance")}
            study = times.run(found.linkage.tolerance_study, **sizes)
            unclosed.append(study.open_share)
            ratio = study.position.linear.p95 / study.position.simulated.p95
            ratios += ratio[np.isfinite(ratio)].tolist()
        low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
        rows.append(
            {
                "size": size,
                "cases": len(solved),
                "low": low,
                "median": middle,
                "high": high,
                "unclosed": float(np.mean(unclosed)),
                "ms": 1000 * times.median.processor,
            }
        )
    return rows


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The figures of docs/background/measurements.md."""
    forces = results["tables"]["forces"]
    return report.tables("studies", {"tolerances": results["tables"]["tolerances"]}) | {
        "forces": report.power(max(row["worst"] for row in forces))
    }


def measure(count: Annotated[int, "motions"] = 30) -> Iterator[dict[str, Any]]:
    """Every table."""
    solved = list(cases(count))
    tables = {"forces": forces(2000), "tolerances": tolerances(solved)}
    yield {"tables": tables}


if __name__ == "__main__":
    report.run(measure)
