"""The largest requests of the scenes, for `tests.oracles.largest`."""

from __future__ import annotations

from typing import Any

from synthesis.knotter.d_knotter import mechanism
from synthesis.knotter.mechanism import dimensions

Bodies = dict[str, tuple[str, dict[str, Any]]]
DESIGN = {"l2": 351.9, "l3": 162.8, "l4": 351.9, "l5": 347.2, "b": 535.8}
CYLINDER = {"length": 220.0, "speed": 100.0}
EXTRAS = [
    "angles",
    "angular_velocities",
    "angular_accelerations",
    "points",
    "conditions",
    "residual",
    "instant_centre",
]


def bodies() -> Bodies:
    """Route and body of each, by name."""
    return {**_lifts(), **_chains(), **_knotters()}


def _of(scene: str, found: Bodies) -> Bodies:
    return {f"{scene}: {name}": (f"/v1/{scene}/{path}", body) for name, (path, body) in found.items()}


def _lifts() -> Bodies:
    pneumatics = {"load": 1000.0, "mass": 20.0, "bore": 63.0, "rod": 20.0, "pressure": 6.0}
    motion = {"design": DESIGN, "cylinder": CYLINDER, "pneumatics": pneumatics, "include": EXTRAS}
    stroke = {"cylinder": CYLINDER, "stroke": [200, 510]}
    cylinders = [{"length": 200 + k, "speed": 100} for k in range(24)]
    found: Bodies = {
        "motion": ("motion", {**motion, "samples": 100_000}),
        "motion at times of one's own": (
            "motion",
            {**motion, "times": [round(k / 30_000, 6) for k in range(100_000)]},
        ),
        "motion as a table": ("motion.csv", {**motion, "samples": 100_000}),
        "optimum": ("optimize", {**stroke, "objective": {"kind": "discrete", "n": 4000}}),
        "optimum within constraints": (
            "optimize",
            {**stroke, "objective": {"kind": "discrete", "n": 4000}, "constraints": {"rise_time": [0.5, 60]}},
        ),
        "24 cylinders": (
            "batch",
            {"cylinders": cylinders, "stroke": [200, 510], "objective": {"kind": "discrete", "n": 500}},
        ),
    }
    return _of("lift", found)


def _chains() -> Bodies:
    slot = {
        "pitch": 131,
        "links": 16,
        "upper_radius": 181.78,
        "samples": 10_001,
        "include": ["outline"],
        "roller_radius": 20,
    }
    long = {**slot, "roller_radius": 1, "links": 1000, "upper_radius": 20_700, "samples": 1000}
    stadium = {"pitch": 1, "links": 1000, "stadium": {"radius": 20}, "samples": 1000, "roller_radius": 0.2}
    fits = {"chebyshev": 64, "spline": 4096, "fourier": 256, "polynomial": 100}
    listed = {"include": ["pins", "outline"]}
    found: Bodies = {
        **{
            f"slot, {kind}": ("slot", {**slot, "fit": {"kind": kind, "order": order}}) for kind, order in fits.items()
        },
        "slot, pins listed": ("slot", {**slot, "samples": 10_001, **listed}),
        "slot as a table with pins": ("slot.csv", {**slot, **listed}),
        "slot as a drawing": ("slot.dxf", slot),
        "slot of 1,000 links": ("slot", {**long, "fit": {"kind": "spline", "order": 4096}}),
        "slot of 1,000 links, 200 samples listed": ("slot", {**long, "samples": 200, **listed}),
        "track of 1,000 links": ("track", {**stadium, "fit": {"kind": "spline", "order": 4096}}),
        "track of 1,000 links, 200 samples listed": ("track", {**stadium, "samples": 200, **listed}),
        "tolerance": (
            "tolerance",
            {
                "pitch": 131,
                "links": 1000,
                "upper_radius": 20_700,
                "pitch_errors": [round(0.002 * (k - 50), 3) for k in range(101)],
                "tolerances": {"pitch": 0.001},
            },
        ),
    }
    return _of("chain", found)


def _knotters() -> Bodies:
    grid = {"alpha1": [0.1 * k for k in range(100)], "alpha3": [10 + 0.1 * k for k in range(200)]}

    others = {"alpha2": 8.0, "d1": 136.0, "D": 20.0, "d5": 54.0, "d6": 142.0, "d9": 12.0, "d10": 24.5}
    nine = {"alpha1": [k / 2 for k in range(12)], "alpha3": [20 + k / 2 for k in range(13)]}
    nine |= {name: [value, value + 0.25] for name, value in others.items()}

    def laws(rows: int) -> dict[str, Any]:
        angles = [k * 720 / (rows - 1) for k in range(rows)]
        tables = {
            name: {"table": [[a, 23.5 + ratio * a] for a in angles], "kind": "pchip", "outside": "hold"}
            for name, ratio in (("beta", 0.5), ("alpha4", 0.05))
        }
        whole = {"windows": {"wrap": [0, 720], "bite": [0, 720]}}
        return {"laws": tables, "clearance": {"over": [0, 720], "hook": "moving", "disc_radius": 40}, **whole}

    fixed = ("alpha1", "alpha3")
    known = {name: value for name, value in dimensions(mechanism({}, {}, {}, {})).items() if name not in fixed}
    unknowns = [{"name": name, "low": value - 5, "high": value + 5} for name, value in list(known.items())[:40]]
    pattern = [
        {
            "condition": ("wrap", "clearance", "bite")[k % 3],
            "alpha1": k % 20,
            "alpha3": 20 + k % 11,
            "holds": k % 2 == 0,
        }
        for k in range(200)
    ]
    found: Bodies = {
        "scan": ("scan", {"grid": grid}),
        "scan of nine parameters": ("scan", {"grid": nine}),
        "scan of nine parameters as a table": ("scan.csv", {"grid": nine}),
        "scan of 14,000 over two turns, laws of 6 rows": (
            "scan",
            {"grid": {**grid, "alpha3": grid["alpha3"][:140]}, **laws(6)},
        ),
        "scan of 500, laws of 1,000 rows": (
            "scan",
            {"grid": {**grid, "alpha1": grid["alpha1"][:5], "alpha3": grid["alpha3"][:100]}, **laws(1000)},
        ),
        "limit": ("limit", {"samples": 1025}),
        "limit, laws of 480 rows": ("limit", {"samples": 1025, **laws(480), "condition": "bite"}),
        "needle": ("needle", {}),
        "curves": ("curves", {"samples": 7201, "step": 0.01, "over": [0, 720]}),
        "curves, laws of 1,000 rows": ("curves", {"samples": 7201, "step": 0.01, "over": [0, 720], **laws(1000)}),
        "curves as a table": ("curves.csv", {"samples": 7201, "over": [0, 720]}),
        "fit": ("fit", {"unknowns": unknowns, "pattern": pattern, "draws": 350, "descents": 1, "budget_ms": 2000}),
        "fit, 2,000 draws": (
            "fit",
            {"unknowns": unknowns, "pattern": pattern[:32], "draws": 2000, "descents": 1, "budget_ms": 2000},
        ),
        "tolerance": ("tolerance", {"alpha1": 10, "alpha3": 25, "samples": 20_000}),
    }
    return _of("knotter", found)
