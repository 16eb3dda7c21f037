"""The dearest requests of each kind that the service accepts."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

from synthesis.four_bar import coupler_angle
from synthesis.scenes.knotter.d_knotter import mechanism
from synthesis.scenes.knotter.mechanism import dimensions

SAMPLES, TOP = 1024, 100


class Largest(NamedTuple):
    """A request, answered within a second if its search has a budget; ``atlas`` is true if it needs an atlas."""

    path: str
    body: dict[str, Any]
    atlas: bool = False

    @property
    def content(self) -> bytes:
        """Return the bytes of the body."""
        searches = self.path.startswith(("/v2/match", "/v2/synthesize", "/v2/function"))
        return json.dumps(self.body | ({"budget_ms": 1000} if searches else {})).encode()


def coupler_motion(samples: int, noise: float) -> dict[str, Any]:
    """Return rotations and positions of a coupler over 300 degrees; the noise is a fraction of the motion's size."""
    crank = 0.5 + np.linspace(0, np.deg2rad(300), samples)
    angle = coupler_angle(np.array([30.0, 80.0, 70.0, 100.0]), 1, crank)
    errors = noise * np.random.default_rng(5).normal(size=(3, samples))
    position = 30 * np.exp(1j * crank) + 50 * np.exp(1j * (angle + 0.7)) + 50 * (errors[0] + 1j * errors[1])
    pairs = np.stack([position.real, position.imag], axis=-1).round(6).tolist()
    return {"rotation": np.rad2deg(angle + errors[2]).round(6).tolist(), "position": pairs}


BODY = coupler_motion(SAMPLES, 0.01)
TIMED = BODY | {"crank_span": 300}
NO_LINKAGE = coupler_motion(SAMPLES, 3.0)
LIMITS = {
    "preset": "practical",
    "family": "any",
    "pivot_box": [-400, -400, 400, 400],
    "envelope": [-600, -600, 600, 600],
    "keep_out": [[1000 + 10 * k, 1000, 1005 + 10 * k, 1005] for k in range(20)],
    "coupler_radius_max": 500,
    "link_min": 1,
}
REPORTS = {
    "sensitivity": True,
    "analysis": {"crank_speed": 60, "load": {"force": [3, -10], "torque": 5}},
    "tolerance_study": {"links": 0.1, "pivots": 0.1, "clearance": 0.05, "samples": 100_000},
}
LENGTHS = {"lengths_from": [0.5 * k for k in range(1, 1001)]}
LINKAGE = {
    "links": {"crank": 30, "coupler": 80, "rocker": 70, "ground": 100},
    "branch": 1,
    "start_angle": 28,
    "body_offset": 0,
    "mount": {"ground_angle": 0, "pivot_a": [0, 0], "coupler_point_polar": {"radius": 50, "angle": 40}},
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


def requests() -> dict[str, Largest]:
    """Return the requests by name."""
    return {**_searches(), **_of_atlas(), **_machines(), **_lifts(), **_chains(), **_knotters()}


def _searches() -> dict[str, Largest]:
    path = {"position": BODY["position"]}
    tight, free, all_cases = {"limits": LIMITS, "diverse": True}, {"timing": "free"}, {"mechanisms": "all"}
    travel = [30 - 30 * np.cos(k / 400) for k in range(SAMPLES)]
    sparse = [turn if k % 128 == 0 else None for k, turn in enumerate(BODY["rotation"])]
    bodies: dict[str, dict[str, Any]] = {
        "motion within all limits": TIMED | tight,
        "motion, ten turns": TIMED | {"crank_span": 3600, "limits": {"family": "any"}},
        "rotation": {"rotation": BODY["rotation"], "crank_span": 300, "limits": {"family": "any"}},
        "path within all limits": path | tight | {"crank_span": 300},
        "everything reported of 20": TIMED | REPORTS | {"top": 20},
        "links from 1,000 lengths": TIMED | LENGTHS | {"limits": LIMITS},
        "free: poses in any order": BODY
        | free
        | {"order": "any", "limits": {"preset": "practical", "family": "any"}},
        "free: poses within all limits": BODY | free | tight,
        "free: everything reported of 20": BODY | free | REPORTS | {"round_to": 0.01, "top": 20},
        "free: closed path within all limits": path | free | tight | {"closed": True},
        "free: rotations at eight of the poses": BODY | free | {"rotation": sparse},
        "free: four poses": {name: values[::250][:4] for name, values in BODY.items()} | free | tight | REPORTS,
        "free: poses of no linkage": NO_LINKAGE | free | {"order": "any"},
        "sliders: free poses within all limits": BODY | free | all_cases | tight,
        "sliders: two rails from 1,000 lengths": BODY | free | LENGTHS | {"mechanisms": ["two_rails"]},
        "sliders: crank angles": TIMED | all_cases | tight,
        "sliders: travel": BODY | all_cases | tight | {"travel": travel},
    }
    found = {name: Largest("/v2/synthesize", {"top": TOP, **body}) for name, body in bodies.items()}
    found["motion as a drawing"] = Largest("/v2/synthesize.dxf", TIMED | {"limits": LIMITS})
    x = np.linspace(1, 2, SAMPLES)
    output = np.rad2deg(np.log(x) + 0.002 * np.random.default_rng(6).normal(size=SAMPLES)).round(6).tolist()
    named = {"name": "log10", "x": [1, 2], "output_span": 90, "samples": SAMPLES}
    limits = {"limits": {"preset": "practical", "links": {"ground": 100}}, "round_to": 0.01, "one_way": True}
    for objective in ("rms", "max"):
        function = {"crank_span": 60, "sensitivity": True, "curves": True, "top": TOP, "objective": objective}
        found[f"function: {objective}"] = Largest("/v2/function", function | {"output": output})
        within = Largest("/v2/function", function | limits | {"function": named})
        found[f"function: {objective} within limits"] = within
    return found


def _of_atlas() -> dict[str, Largest]:
    match = {"rotation": BODY["rotation"], "top": 1000, "features": True}
    rows = {"effort": "atlas", "top": TOP, "limits": LIMITS}
    bodies: dict[str, tuple[str, dict[str, Any]]] = {
        "match: coupler": ("match", match | {"crank_span": 300}),
        "match: ten turns": ("match", match | {"crank_span": 3600}),
        "match: short span": ("match", match | {"rotation": BODY["rotation"][:100], "crank_span": 5}),
        "atlas rows of a motion": ("synthesize", TIMED | rows),
        "atlas rows of a path": ("synthesize", {"position": BODY["position"], "crank_span": 300} | rows | REPORTS),
    }
    return {name: Largest(f"/v2/{route}", body, atlas=True) for name, (route, body) in bodies.items()}


def _machines() -> dict[str, Largest]:
    request = {"rotation": [0, 20, 45, 70], "position": [[0, 0], [30, 10], [60, 35], [70, 70]], "crank_span": 70}
    request |= {"limits": {"keep_out": LIMITS["keep_out"]}}
    angles, radii = np.arange(200) * np.pi / 100, 60 - 25 * (np.arange(200) % 2)
    star = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).tolist()
    plates = {"body": star, "boards": "both", "heads": True, "layers_max": 6}
    drives = [{"kind": "actuator", "catalogue": "iso_15552", "arm_min": 1}, {"kind": "dyad"}, {"kind": "rotary"}]
    rows = [f"{1 + k},{20 + k % 50},{200 + k}" for k in range(200)]
    springs = [{"kind": "tension", "catalogue": "\n".join(["stiffness,free_length,longest", *rows])}] * 4
    driven = {"load": {"force": [0, -100]}, "drives": drives, "springs": springs}
    poses = {"rotation": [0, 20], "position": [[10, 0], [60, 0]], "timing": "free"}
    of_linkage, of_rails = {"linkage": LINKAGE, "request": request}, {"linkage": TWO_RAILS}
    return {
        "assembly: a star of 200 corners": Largest("/v2/assembly", of_linkage | plates),
        "assembly: a star on two rails": Largest("/v2/assembly", of_rails | plates | {"request": poses}),
        "drives: a catalogue, a motor and springs": Largest("/v2/drives", of_linkage | driven | {"top": 20}),
        "drives: of two rails": Largest("/v2/drives", of_rails | {"drives": [{"kind": "actuator"}] * 8, "top": 50}),
    }


def _lifts() -> dict[str, Largest]:
    cylinder, objective = {"length": 220, "speed": 100}, {"kind": "discrete", "n": 4000}
    design = {"l2": 351.9, "l3": 162.8, "l4": 351.9, "l5": 347.2, "b": 535.8}
    include = ["angles", "angular_velocities", "angular_accelerations", "points", "conditions", "residual"]
    optimum = {"cylinder": cylinder, "stroke": [200, 510], "objective": objective}
    motion = {"design": design, "cylinder": cylinder, "include": include}
    times = [round(k / 30_000, 6) for k in range(100_000)]
    cylinders = [{"length": 200 + k, "speed": 100} for k in range(24)]
    batch = {"cylinders": cylinders, "stroke": [200, 510], "objective": objective | {"n": 500}}
    return {
        "lift: motion": Largest("/v2/lift/motion", motion | {"samples": 100_000}),
        "lift: motion at given times": Largest("/v2/lift/motion", motion | {"times": times}),
        "lift: optimum": Largest("/v2/lift/optimize", optimum | {"constraints": {"rise_time": [0.5, 60]}}),
        "lift: 24 cylinders": Largest("/v2/lift/batch", batch),
    }


def _chains() -> dict[str, Largest]:
    slot = {"pitch": 131, "links": 16, "upper_radius": 181.78, "samples": 10_001, "include": ["pins", "outline"]}
    long = {"pitch": 131, "links": 1000, "upper_radius": 20_700}
    stadium = {"pitch": 1, "links": 1000, "stadium": {"radius": 20}, "samples": 1000, "roller_radius": 0.2}
    errors = {"pitch_errors": [round(0.002 * (k - 50), 3) for k in range(101)], "tolerances": {"pitch": 0.001}}
    spline = {"fit": {"kind": "spline", "order": 4096}}
    return {
        "chain: slot": Largest("/v2/chain/slot", slot | spline),
        "chain: slot of 1,000 links": Largest("/v2/chain/slot", long | spline),
        "chain: track of 1,000 links": Largest("/v2/chain/track", stadium | spline),
        "chain: tolerance": Largest("/v2/chain/tolerance", long | errors),
    }


def _knotters() -> dict[str, Largest]:
    angles = [k * 720 / 999 for k in range(1000)]
    laws = {
        name: {"table": [[a, 23.5 + ratio * a] for a in angles], "kind": "pchip", "outside": "hold"}
        for name, ratio in (("beta", 0.5), ("alpha4", 0.05))
    }
    two_turns = {"laws": laws, "windows": {"wrap": [0, 720], "bite": [0, 720]}}
    two_turns["clearance"] = {"over": [0, 720], "hook": "moving", "disc_radius": 40}
    grid = {"alpha1": [0.1 * k for k in range(100)], "alpha3": [10 + 0.1 * k for k in range(200)]}
    few = {"alpha1": grid["alpha1"][:5], "alpha3": grid["alpha3"][:100]}
    known = dimensions(mechanism({}, {}, {}, {})).items()
    unknowns = [{"name": n, "low": v - 5, "high": v + 5} for n, v in known if n not in grid][:40]
    pattern = [
        {"condition": name, "alpha1": k % 20, "alpha3": 20 + k % 11, "holds": k % 2 == 0}
        for k, name in zip(range(200), 67 * ("wrap", "clearance", "bite"))
    ]
    bodies: dict[str, tuple[str, dict[str, Any]]] = {
        "scan": ("scan", {"grid": grid}),
        "scan of 500, laws of 1,000 rows": ("scan", {"grid": few} | two_turns),
        "limit": ("limit", {"samples": 1025}),
        "curves": ("curves", {"samples": 7201, "step": 0.01, "over": [0, 720]} | two_turns),
        "fit": ("fit", {"unknowns": unknowns, "pattern": pattern, "draws": 350, "descents": 1, "budget_ms": 2000}),
        "tolerance": ("tolerance", {"alpha1": 10, "alpha3": 25, "samples": 20_000}),
    }
    return {f"knotter: {name}": Largest(f"/v2/knotter/{path}", body) for name, (path, body) in bodies.items()}
