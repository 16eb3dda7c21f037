"""The most expensive requests of each kind that the service accepts without an atlas."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

from synthesis.four_bar import coupler_angle

SAMPLES, TOP = 1024, 100


class Largest(NamedTuple):
    """A request that is answered within a second if its search has a budget."""

    path: str
    body: dict[str, Any]

    @property
    def content(self) -> bytes:
        """Return the bytes of the body."""
        searches = self.path.startswith(("/v2/synthesize", "/v2/function"))
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


def requests() -> dict[str, Largest]:
    """Return the requests by name."""
    return {**_searches(), **_machines(), **_scenes()}


def _searches() -> dict[str, Largest]:
    path = {"position": BODY["position"]}
    tight, free, all_kinds = {"limits": LIMITS, "diverse": True}, {"timing": "free"}, {"mechanisms": "all"}
    bodies: dict[str, dict[str, Any]] = {
        "motion within all limits": TIMED | tight,
        "everything reported of 20": TIMED | REPORTS | {"top": 20},
        "links from 1,000 lengths": TIMED | LENGTHS | {"limits": LIMITS},
        "free: poses of no linkage": NO_LINKAGE | free | {"order": "any"},
        "free: everything reported of 20": BODY | free | REPORTS | {"round_to": 0.01, "top": 20},
        "free: closed path within all limits": path | free | tight | {"closed": True},
        "sliders: free poses within all limits": BODY | free | all_kinds | tight,
    }
    found = {name: Largest("/v2/synthesize", {"top": TOP, **body}) for name, body in bodies.items()}
    x = np.linspace(1, 2, SAMPLES)
    output = np.rad2deg(np.log(x) + 0.002 * np.random.default_rng(6).normal(size=SAMPLES)).round(6).tolist()
    function = {"crank_span": 60, "sensitivity": True, "curves": True, "top": TOP, "objective": "max"}
    return found | {"function": Largest("/v2/function", function | {"output": output})}


def _machines() -> dict[str, Largest]:
    request = {"rotation": [0, 20, 45, 70], "position": [[0, 0], [30, 10], [60, 35], [70, 70]], "crank_span": 70}
    angles, radii = np.arange(200) * np.pi / 100, 60 - 25 * (np.arange(200) % 2)
    star = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).tolist()
    of_linkage = {"linkage": LINKAGE, "request": request | {"limits": {"keep_out": LIMITS["keep_out"]}}}
    drives = [{"kind": "actuator", "catalogue": "iso_15552", "arm_min": 1}, {"kind": "dyad"}, {"kind": "rotary"}]
    rows = [f"{1 + k},{20 + k % 50},{200 + k}" for k in range(200)]
    springs = [{"kind": "tension", "catalogue": "\n".join(["stiffness,free_length,longest", *rows])}] * 4
    driven = {"load": {"force": [0, -100]}, "drives": drives, "springs": springs, "top": 20}
    plates = {"body": star, "boards": "both", "pin_heads": True, "layers_max": 6}
    return {
        "assembly: a star of 200 corners": Largest("/v2/assembly", of_linkage | plates),
        "drives: a catalogue, a motor and springs": Largest("/v2/drives", of_linkage | driven),
    }


def _scenes() -> dict[str, Largest]:
    cylinder, objective = {"length": 220, "speed": 100}, {"kind": "discrete", "n": 4000}
    constraints = {"rise_time": [0.5, 60]}
    lift = {"cylinder": cylinder, "stroke": [200, 510], "objective": objective, "constraints": constraints}
    chain = {"pitch": 131, "links": 1000, "upper_radius": 20_700, "samples": 200}
    grid = {"alpha1": [0.1 * k for k in range(100)], "alpha3": [10 + 0.1 * k for k in range(200)]}
    return {
        "lift: optimum": Largest("/v2/lift/optimize", lift),
        "chain: slot of 1,000 links": Largest("/v2/chain/slot", chain),
        "knotter: scan": Largest("/v2/knotter/scan", {"grid": grid}),
    }
