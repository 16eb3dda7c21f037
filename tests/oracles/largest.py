"""The largest request of each kind that the service takes.

`tests/app/test_memory.py` asks each at a service that gives a request `MOST_BYTES`; `benchmarks.memory` measures them.
"""

from __future__ import annotations

import base64
import functools
import json
from typing import Any, NamedTuple

import numpy as np

from synthesis.fourbar.kinematics import coupler_angle
from synthesis.scenes.knotter.d_knotter import mechanism
from synthesis.scenes.knotter.mechanism import dimensions

MOST_BYTES = 150_000_000
"""That no request within its documented sizes needs more of, above an idle process."""
SAMPLES, TOP = 1024, 100


class Largest(NamedTuple):
    """A request."""

    path: str
    body: dict[str, Any]
    seconds: float = 1.0
    """Budget of one whose search has one."""
    atlas: bool = False
    """Whether it needs an atlas."""

    @property
    def content(self) -> bytes:
        """The body's bytes."""
        body = self.body
        if self.path.startswith(("/v1/match", "/v1/synthesize", "/v1/function")):
            body = {**body, "budget_ms": 1000 * self.seconds}
        return json.dumps(body).encode()


class Moved(NamedTuple):
    """A body on the coupler of a crank-rocker, nearly: degrees, places, crank angles from the first."""

    rotation: list[float]
    position: list[list[float]]
    crank_angle: list[float]


@functools.cache
def moved(count: int = SAMPLES, span: float = 300.0, noise: float = 0.01) -> Moved:
    """So many samples over a span in degrees, off by a share of the motion's size; seeded."""
    random = np.random.default_rng(5)
    crank = np.linspace(0, np.deg2rad(span), count)
    angle = coupler_angle(np.array([30.0, 80.0, 70.0, 100.0]), 1, 0.5 + crank)
    off = noise * random.normal(size=(3, count))
    place = 30 * np.exp(1j * (0.5 + crank)) + 50 * np.exp(1j * (angle + 0.7)) + 50 * (off[0] + 1j * off[1])
    uneven = crank + 0.3 * crank[1] * np.sin(np.arange(count))
    return Moved(
        np.rad2deg(angle + off[2]).round(6).tolist(),
        np.stack([place.real, place.imag], axis=-1).round(6).tolist(),
        np.rad2deg(uneven - uneven[0]).tolist(),
    )


SPAN = {"crank_span": 300.0}
BOXES = [[1000.0 + 10 * k, 1000.0, 1005.0 + 10 * k, 1005.0] for k in range(20)]
LIMITS = {
    "preset": "practical",
    "pivot_box": [-400.0, -400.0, 400.0, 400.0],
    "envelope": [-600.0, -600.0, 600.0, 600.0],
    "keep_out": BOXES,
    "coupler_radius_max": 500.0,
    "link_min": 1.0,
}
REPORTS = {
    "sensitivity": True,
    "analysis": {"crank_speed": 60.0, "load": {"force": [3.0, -10.0], "torque": 5.0}},
    "tolerance_study": {"links": 0.1, "pivots": 0.1, "clearance": 0.05, "samples": 100_000},
}
GIVEN = {
    "links": {"crank": 30.0, "coupler": 80.0, "rocker": 70.0, "ground": 100.0},
    "branch": 1,
    "start_angle": 28.0,
    "body_offset": 0.0,
    "mount": {"ground_angle": 0.0, "pivot_a": [0.0, 0.0], "coupler_point": {"radius": 50.0, "angle": 40.0}},
}
TWO_RAILS = {
    "driver": "slider",
    "guides": [
        {"guide": "rail", "point": [0.0, 0.0], "direction": 0.0, "body_point": [0.0, 0.0]},
        {"guide": "rail", "point": [0.0, 0.0], "direction": 90.0, "body_point": [60.0, 80.0]},
    ],
    "branch": 1,
    "start": 10.0,
    "travel": [0.0, 50.0],
}
DESIGN = {"l2": 351.9, "l3": 162.8, "l4": 351.9, "l5": 347.2, "b": 535.8}
CYLINDER = {"length": 220.0, "speed": 100.0}
EXTRAS = "angles angular_velocities angular_accelerations points conditions residual instant_centre".split()
QUICK = {
    "motion, half of the rotations missing",
    "free: poses in any order",
    "free: three poses",
    "function: max",
    "lift: motion",
    "chain: slot, spline",
    "chain: slot as a table with pins",
    "chain: track of 1,000 links",
    "knotter: limit",
    "knotter: needle",
    "knotter: curves, laws of 1,000 rows",
}
"""Those that show most and are answered within about a second."""


def requests() -> dict[str, Largest]:
    """What they are, by name."""
    return {
        **_timed(),
        **_free(),
        **_sliders(),
        **_functions(),
        **_matches(),
        **_tables(),
        **_machines(),
        **_scenes(),
    }


def _asked(path: str, bodies: dict[str, Any], atlas: bool = False, always: bool = False) -> dict[str, Largest]:
    """Requests of a route for as many answers as there are, unless they say how many or refine one."""

    def whole(body: dict[str, Any]) -> dict[str, Any]:
        return body if "refine_from" in body and not always else {"top": TOP, **body}

    return {name: Largest(path, whole(body), atlas=atlas) for name, body in bodies.items()}


def first_of(count: int, body: dict[str, Any]) -> dict[str, Any]:
    """A request of so many of its samples."""
    return {name: value[:count] if isinstance(value, list) else value for name, value in body.items()}


def _timed() -> dict[str, Largest]:
    all_of = moved()
    motion: dict[str, Any] = {"rotation": all_of.rotation, "position": all_of.position, **SPAN}
    path: dict[str, Any] = {"position": all_of.position, **SPAN}
    uneven = {"rotation": all_of.rotation, "position": all_of.position, "crank_angle": all_of.crank_angle}
    missing = [None if k % 2 else value for k, value in enumerate(all_of.rotation)]
    numbers = [1.0 + 0.001 * k for k in range(SAMPLES)]
    each = {
        "weights": {"rotation": numbers, "position": numbers},
        "tolerances": {"rotation": numbers, "position": numbers},
    }
    few = moved(64)
    some: dict[str, Any] = {"rotation": few.rotation, "position": few.position, **SPAN}
    thousand = [0.5 * k for k in range(1, 1001)]
    any_family, tight = {"limits": {"family": "any"}}, {"limits": {**LIMITS, "family": "any"}}
    made = {"tolerance_study": REPORTS["tolerance_study"], "top": 1}
    bodies: dict[str, dict[str, Any]] = {
        "motion": motion,
        "motion, crank angles given one by one, weights and tolerances": {**uneven, **each},
        "motion, half of the rotations missing": {**motion, "rotation": missing},
        "motion, any family": {**motion, **any_family},
        "motion, practical": {**motion, "limits": {"preset": "practical"}, "diverse": True},
        "motion, any family within all limits": {**motion, **tight, "diverse": True},
        "rotation": {"rotation": all_of.rotation, **SPAN, **any_family},
        "path": path,
        "path, any family within all limits": {**path, **tight},
        "motion, ten turns": {**motion, "crank_span": 3600, **any_family},
        "everything reported of 20": {**motion, **REPORTS, "top": 20},
        "everything reported of one": {**motion, **REPORTS, "top": 1},
        "100,000 made linkages of 1,024 samples": {**motion, **made},
        "100,000 made linkages of 30 samples": {**first_of(30, motion), "crank_span": 8.8, **made},
        "links on a grid": {**motion, "limits": LIMITS, "round_to": 0.01},
        "links from 1,000 lengths": {**motion, "limits": LIMITS, "lengths_from": thousand},
        "links from 1,000 lengths, 64 samples": {**some, "lengths_from": thousand, "top": 5},
        "refined from a linkage": {**motion, "limits": LIMITS, "refine_from": GIVEN, **REPORTS, "round_to": 0.01},
        "path refined from a linkage of any family": {**path, **any_family, "refine_from": GIVEN},
    }
    found = _asked("/v1/synthesize", bodies)
    found["motion as a table"] = Largest("/v1/synthesize.csv", {**motion, "analysis": REPORTS["analysis"]})
    found["motion as a drawing"] = Largest("/v1/synthesize.dxf", {**path, "limits": LIMITS})
    given = {"request": {**motion, "analysis": REPORTS["analysis"]}, "solution": GIVEN}
    found["a given linkage as a table"] = Largest("/v1/export", {**given, "format": "csv"})
    of_atlas = {
        "a motion": motion,
        "a motion within limits": {**motion, **tight},
        "a path": path,
        "a path within limits": {**path, **tight, **REPORTS},
        "a short path": {"position": all_of.position, "crank_span": 5},
        "three positions": {"position": all_of.position[::400], "crank_span": 70},
        "a rotation": {"rotation": all_of.rotation, **SPAN},
    }
    rows = {f"atlas rows of {name}": {**body, "effort": "atlas"} for name, body in of_atlas.items()}
    return found | _asked("/v1/synthesize", rows, atlas=True)


def _free() -> dict[str, Largest]:
    all_of = moved()
    poses: dict[str, Any] = {"rotation": all_of.rotation, "position": all_of.position}
    path: dict[str, Any] = {"position": all_of.position}
    eight, place, far = moved(8, 200, 0.02), moved(SAMPLES, 200, 0.02), moved(noise=3.0)
    mixed = {
        "position": eight.position,
        "rotation": [None if k in (2, 4, 5) else value for k, value in enumerate(eight.rotation)],
    }
    sparse = [value if k % 128 == 0 else None for k, value in enumerate(all_of.rotation)]
    turns = [None if k % 3 == 2 else value for k, value in enumerate(place.rotation)]
    gaps = [None if k % 3 == 1 else value for k, value in enumerate(place.position)]
    practical = {"preset": "practical"}
    any_family, tight = {"limits": {"family": "any"}}, {"limits": {**LIMITS, "family": "any"}}
    both = {"limits": {**practical, "family": "any"}}
    four = {name: poses[name][::250][:4] for name in ("rotation", "position")}
    none = {"rotation": far.rotation, "position": far.position}
    bodies: dict[str, dict[str, Any]] = {
        "poses": poses,
        "poses, any family": {**poses, **any_family},
        "poses, any family, practical": {**poses, **both, "diverse": True},
        "poses, any family within all limits": {**poses, **tight},
        "poses in any order": {**poses, "order": "any", **both},
        "poses, closed": {**poses, "closed": True, **both},
        "poses within a span": {**poses, "crank_span_max": 320, **both},
        "poses, everything reported": {**poses, **REPORTS, "round_to": 0.01, "limits": practical, "top": 20},
        "poses, links from 1,000 lengths": {**poses, "lengths_from": [0.5 * k for k in range(1, 1001)]},
        "poses refined from a linkage": {
            **poses,
            "refine_from": {**GIVEN, "crank_angle": all_of.crank_angle},
            **REPORTS,
        },
        "poses refined from a linkage without crank angles": {**poses, "refine_from": GIVEN, **tight},
        "path": path,
        "path, any family": {**path, **any_family},
        "path, any family, practical": {**path, **both, "diverse": True},
        "path, any family within all limits": {**path, **tight, "closed": True},
        "path refined from a linkage": {**path, "refine_from": GIVEN, **tight},
        "poses with rotations at eight": {**poses, "rotation": sparse, **both},
        "rotations and positions, each missing at some": {"rotation": turns, "position": gaps, **both},
        "eight samples, three without rotation": {**mixed, **both},
        "eight samples, three without rotation, all limits": {**mixed, **tight, "order": "any"},
        "four poses": {**four, **both, **REPORTS},
        "three poses": {**first_of(3, four), **tight, "diverse": True},
        "two poses": {**first_of(2, four), **tight},
        "poses of no linkage": none,
        "poses of no linkage in any order": {**none, "order": "any", **any_family},
        "path of no linkage": {"position": far.position, **tight},
    }
    return _asked("/v1/synthesize", {f"free: {name}": {**body, "timing": "free"} for name, body in bodies.items()})


def _sliders() -> dict[str, Largest]:
    """Searches among linkages with sliders."""
    all_of = moved()
    poses: dict[str, Any] = {"rotation": all_of.rotation, "position": all_of.position, "mechanisms": "all"}
    free, travel = (
        {**poses, "timing": "free"},
        {**poses, "travel": [30 - 30 * np.cos(k / 400) for k in range(SAMPLES)]},
    )
    stock = {"lengths_from": [0.5 * k for k in range(1, 1001)]}
    tight = {"limits": {**LIMITS, "family": "any"}, "diverse": True}
    bodies: dict[str, dict[str, Any]] = {
        "poses": {**free, **tight},
        "poses, everything reported": {**free, **REPORTS},
        "poses on two rails, links from 1,000 lengths": {**free, **stock, "mechanisms": ["two_rails"]},
        "two rails, a study": {**free, "mechanisms": ["two_rails"], "tolerance_study": REPORTS["tolerance_study"]},
        "crank angles": {**poses, **SPAN, **tight},
        "travel": travel,
        "travel within all limits": {**travel, **tight},
    }
    return _asked("/v1/synthesize", {f"sliders: {name}": body for name, body in bodies.items()})


def _functions() -> dict[str, Largest]:
    x = np.linspace(1, 2, SAMPLES)
    table = {"table": np.stack([x, np.log10(x)], axis=-1).tolist(), "output_span": 90}
    named = {"name": "log10", "x": [1, 2], "output_span": 90, "samples": SAMPLES}
    output = np.rad2deg(np.log(x) + 0.002 * np.random.default_rng(6).normal(size=SAMPLES)).round(6).tolist()
    common = {"crank_span": 60, "sensitivity": True, "curves": True}
    limits = {"limits": {"preset": "practical", "links": {"ground": 100}}, "round_to": 0.01}
    given = {"links": GIVEN["links"], "branch": 1, "start_angle": 28.0, "output_offset": 0.0}
    weights = {"weights": [1.0 + 0.001 * k for k in range(SAMPLES)]}
    bodies: dict[str, dict[str, Any]] = {
        "rms": {**common, "function": table},
        "rms, noise": {**common, "output": output, **weights},
        "rms within limits": {**common, "function": named, **limits, "one_way": True},
        "max": {**common, "function": named, "objective": "max"},
        "max, noise": {**common, "output": output, **weights, "objective": "max"},
        "max within limits": {**common, "function": table, "objective": "max", **limits, "one_way": True},
        "refined from a linkage": {**common, "function": named, "objective": "max", **limits, "refine_from": given},
    }
    return _asked("/v1/function", {f"function: {name}": body for name, body in bodies.items()}, always=True)


def _tables() -> dict[str, Largest]:
    """A table of as many samples and columns as the body has room for."""
    rows = "".join(f"{k},12.3456789,-98.7654321,{'1.25,' * 120}\n" for k in range(SAMPLES))
    table = "Frame,x [mm],y [mm]," + ",".join(f"column {k}" for k in range(120)) + "\n" + rows
    content = base64.b64encode(table.encode()).decode()
    return {"table of 123 columns": Largest("/v1/motion", {"file": content})}


def _matches() -> dict[str, Largest]:
    all_of, most = moved(), {"top": 1000, "features": True}
    still = [1e-7 * value for value in np.random.default_rng(7).normal(size=SAMPLES)]
    bodies: dict[str, dict[str, Any]] = {
        "coupler": {"rotation": all_of.rotation, **SPAN, **most},
        "rocker": {"rotation": all_of.rotation, **SPAN, **most, "curve": "rocker"},
        "crank angles given one by one": {"rotation": all_of.rotation, "crank_angle": all_of.crank_angle, **most},
        "nearly no motion": {"rotation": still, "crank_span": 0.1, **most},
        "short span": {"rotation": all_of.rotation[:100], "crank_span": 5, **most},
        "ten turns": {"rotation": all_of.rotation, "crank_span": 3600, **most},
    }
    return {f"match: {name}": Largest("/v1/match", body, atlas=True) for name, body in bodies.items()}


Bodies = dict[str, tuple[str, dict[str, Any]]]


def _machines() -> dict[str, Largest]:
    request = {"rotation": [0.0, 20.0, 45.0, 70.0], "crank_span": 70.0, "limits": {"keep_out": LIMITS["keep_out"]}}
    request |= {"position": [[0.0, 0.0], [30.0, 10.0], [60.0, 35.0], [70.0, 70.0]]}
    star = [
        [r * np.cos(k * np.pi / 100), r * np.sin(k * np.pi / 100)] for k in range(200) for r in [60 - 25 * (k % 2)]
    ]
    asked: dict[str, Any] = {"linkage": GIVEN, "request": request}
    plates = {"body": star, "boards": "both", "heads": True, "layers_most": 6}
    drives = [{"kind": "actuator", "catalogue": "iso_15552", "arm_min": 1.0}, {"kind": "dyad"}, {"kind": "rotary"}]
    springs = [{"kind": "tension", "between": ["ground", "coupler"]}, {"kind": "gas", "between": ["ground", "crank"]}]
    driven = {"load": {"force": [0.0, -100.0]}, "drives": drives, "springs": springs, "top": 20}
    rows = [f"{1 + k},{20 + k % 50},{200 + k}" for k in range(200)]
    bought = {"kind": "tension", "catalogue": "\n".join(["stiffness,free_length,longest", *rows])}
    rails = {"linkage": TWO_RAILS, "drives": [{"kind": "actuator"}] * 8, "springs": springs[:1] * 4, "top": 50}
    poses = {"rotation": [0.0, 20.0], "position": [[10.0, 0.0], [60.0, 0.0]], "timing": "free"}
    fine = {"width": 0.1, "hole": 0.01, "thickness": 0.01, "washer": 0.0, "clearance": 0.0, "boards": "bar"}
    return {
        "assembly: a star of 200 corners": Largest("/v1/assembly", {**asked, **plates}),
        "assembly: a star between thin links": Largest("/v1/assembly", {"linkage": GIVEN, **plates, **fine}),
        "assembly: a star on two rails": Largest("/v1/assembly", {"linkage": TWO_RAILS, "request": poses, **plates}),
        "drives: a catalogue, a motor and springs": Largest("/v1/drives", {**asked, **driven}),
        "drives: four times two of 200 springs": Largest("/v1/drives", {**asked, **driven, "springs": [bought] * 4}),
        "drives: of a body on two rails": Largest("/v1/drives", {**driven, **rails}),
    }


def _scenes() -> dict[str, Largest]:
    return {
        f"{scene}: {name}": Largest(f"/v1/{scene}/{path}", body)
        for scene, bodies in (("lift", _lifts()), ("chain", _chains()), ("knotter", _knotters()))
        for name, (path, body) in bodies.items()
    }


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
    return found


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
    return found


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
    return found
