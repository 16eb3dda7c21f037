"""The largest request of each kind that the service takes.

`tests/app/test_memory.py` asks each at a service that gives a request `MOST_BYTES`; `benchmarks.memory` measures them.
"""

from __future__ import annotations

import functools
import json
from typing import Any, NamedTuple

import numpy as np

from synthesis.fourbar.kinematics import coupler_angle
from tests.oracles import largest_scenes

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
QUICK = {
    "motion, half of the rotations missing",
    "free: poses in any order",
    "free: poses with rotations at eight",
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
    return {**_timed(), **_free(), **_functions(), **_matches(), **_scenes()}


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
    bodies: dict[str, dict[str, Any]] = {
        "motion": {**motion, "top": TOP},
        "motion, crank angles given one by one, weights and tolerances": {**uneven, **each, "top": TOP},
        "motion, half of the rotations missing": {**motion, "rotation": missing, "top": TOP},
        "motion, any family": {**motion, "limits": {"family": "any"}, "top": TOP},
        "motion, practical": {**motion, "limits": {"preset": "practical"}, "top": TOP, "diverse": True},
        "motion, any family within all limits": {
            **motion,
            "limits": {**LIMITS, "family": "any"},
            "top": TOP,
            "diverse": True,
        },
        "rotation": {"rotation": all_of.rotation, **SPAN, "top": TOP, "limits": {"family": "any"}},
        "path": {**path, "top": TOP},
        "path, any family within all limits": {**path, "limits": {**LIMITS, "family": "any"}, "top": TOP},
        "motion, ten turns": {**motion, "crank_span": 3600, "limits": {"family": "any"}, "top": TOP},
        "everything reported of 20": {**motion, **REPORTS, "top": 20},
        "everything reported of one": {**motion, **REPORTS, "top": 1},
        "100,000 made linkages of 1,024 samples": {**motion, "tolerance_study": REPORTS["tolerance_study"], "top": 1},
        "100,000 made linkages of 30 samples": {
            "rotation": all_of.rotation[:30],
            "position": all_of.position[:30],
            "crank_span": 8.8,
            "tolerance_study": REPORTS["tolerance_study"],
            "top": 1,
        },
        "links on a grid": {**motion, "limits": LIMITS, "round_to": 0.01, "top": TOP},
        "links from 1,000 lengths": {
            **motion,
            "limits": LIMITS,
            "lengths_from": [0.5 * k for k in range(1, 1001)],
            "top": TOP,
        },
        "links from 1,000 lengths, 64 samples": {**some, "lengths_from": [0.5 * k for k in range(1, 1001)], "top": 5},
        "refined from a linkage": {**motion, "limits": LIMITS, "refine_from": GIVEN, **REPORTS, "round_to": 0.01},
        "path refined from a linkage of any family": {**path, "limits": {"family": "any"}, "refine_from": GIVEN},
    }
    found = {name: Largest("/v1/synthesize", body) for name, body in bodies.items()}
    found["motion as a table"] = Largest("/v1/synthesize.csv", {**motion, "analysis": REPORTS["analysis"]})
    found["motion as a drawing"] = Largest("/v1/synthesize.dxf", {**path, "limits": LIMITS})
    given = {"request": {**motion, "analysis": REPORTS["analysis"]}, "solution": GIVEN}
    found["a given linkage as a table"] = Largest("/v1/export", {**given, "format": "csv"})
    rows = {"effort": "atlas", "top": TOP}
    of_atlas = {
        "atlas rows of a motion": {**motion, **rows},
        "atlas rows of a motion within limits": {**motion, **rows, "limits": {**LIMITS, "family": "any"}},
        "atlas rows of a path": {**path, **rows},
        "atlas rows of a path within limits": {**path, **rows, "limits": {**LIMITS, "family": "any"}, **REPORTS},
        "atlas rows of a short path": {"position": all_of.position, "crank_span": 5, **rows},
        "atlas rows of three positions": {"position": all_of.position[::400], "crank_span": 70, **rows},
        "atlas rows of a rotation": {"rotation": all_of.rotation, **SPAN, **rows},
    }
    return found | {name: Largest("/v1/synthesize", body, atlas=True) for name, body in of_atlas.items()}


def _free() -> dict[str, Largest]:
    all_of = moved()
    poses: dict[str, Any] = {"timing": "free", "rotation": all_of.rotation, "position": all_of.position}
    path: dict[str, Any] = {"timing": "free", "position": all_of.position}
    eight, place, far = moved(8, 200, 0.02), moved(SAMPLES, 200, 0.02), moved(noise=3.0)
    mixed = {
        "timing": "free",
        "position": eight.position,
        "rotation": [None if k in (2, 4, 5) else value for k, value in enumerate(eight.rotation)],
    }
    sparse = [value if k % 128 == 0 else None for k, value in enumerate(all_of.rotation)]
    gaps = [None if k % 3 == 1 else value for k, value in enumerate(place.position)]
    any_family, practical = {"family": "any"}, {"preset": "practical"}
    tight = {**LIMITS, "family": "any"}
    four = {name: poses[name][::250][:4] for name in ("rotation", "position")}
    bodies: dict[str, dict[str, Any]] = {
        "poses": {**poses, "top": TOP},
        "poses, any family": {**poses, "limits": any_family, "top": TOP},
        "poses, any family, practical": {**poses, "limits": {**practical, **any_family}, "top": TOP, "diverse": True},
        "poses, any family within all limits": {**poses, "limits": tight, "top": TOP},
        "poses in any order": {**poses, "order": "any", "limits": {**practical, **any_family}, "top": TOP},
        "poses, closed": {**poses, "closed": True, "limits": {**practical, **any_family}, "top": TOP},
        "poses within a span": {**poses, "crank_span_max": 320, "limits": {**practical, **any_family}, "top": TOP},
        "poses, everything reported": {**poses, **REPORTS, "round_to": 0.01, "limits": practical, "top": 20},
        "poses, links from 1,000 lengths": {**poses, "lengths_from": [0.5 * k for k in range(1, 1001)], "top": TOP},
        "poses refined from a linkage": {
            **poses,
            "refine_from": {**GIVEN, "crank_angle": all_of.crank_angle},
            **REPORTS,
        },
        "poses refined from a linkage without crank angles": {**poses, "refine_from": GIVEN, "limits": tight},
        "path": {**path, "top": TOP},
        "path, any family": {**path, "limits": any_family, "top": TOP},
        "path, any family, practical": {**path, "limits": {**practical, **any_family}, "top": TOP, "diverse": True},
        "path, any family within all limits": {**path, "limits": tight, "top": TOP, "closed": True},
        "path refined from a linkage": {**path, "refine_from": GIVEN, "limits": tight},
        "poses with rotations at eight": {
            **poses,
            "rotation": sparse,
            "limits": {**practical, **any_family},
            "top": TOP,
        },
        "rotations and positions, each missing at some": {
            "timing": "free",
            "rotation": [None if k % 3 == 2 else value for k, value in enumerate(place.rotation)],
            "position": gaps,
            "limits": {**practical, **any_family},
            "top": TOP,
        },
        "eight samples, three without rotation": {**mixed, "limits": {**practical, **any_family}, "top": TOP},
        "eight samples, three without rotation, all limits": {**mixed, "limits": tight, "top": TOP, "order": "any"},
        "four poses": {"timing": "free", **four, "limits": {**practical, **any_family}, "top": TOP, **REPORTS},
        "three poses": {
            "timing": "free",
            **{k: v[:3] for k, v in four.items()},
            "limits": tight,
            "top": TOP,
            "diverse": True,
        },
        "two poses": {"timing": "free", **{k: v[:2] for k, v in four.items()}, "limits": tight, "top": TOP},
        "poses of no linkage": {"timing": "free", "rotation": far.rotation, "position": far.position, "top": TOP},
        "poses of no linkage in any order": {
            "timing": "free",
            "rotation": far.rotation,
            "position": far.position,
            "order": "any",
            "limits": any_family,
            "top": TOP,
        },
        "path of no linkage": {"timing": "free", "position": far.position, "limits": tight, "top": TOP},
    }
    return {f"free: {name}": Largest("/v1/synthesize", body) for name, body in bodies.items()}


def _functions() -> dict[str, Largest]:
    x = np.linspace(1, 2, SAMPLES)
    table = {"table": np.stack([x, np.log10(x)], axis=-1).tolist(), "output_span": 90}
    named = {"name": "log10", "x": [1, 2], "output_span": 90, "samples": SAMPLES}
    output = np.rad2deg(np.log(x) + 0.002 * np.random.default_rng(6).normal(size=SAMPLES)).round(6).tolist()
    common = {"crank_span": 60, "top": TOP, "sensitivity": True, "curves": True}
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
    return {f"function: {name}": Largest("/v1/function", body) for name, body in bodies.items()}


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


def _scenes() -> dict[str, Largest]:
    return {name: Largest(path, body) for name, (path, body) in largest_scenes.bodies().items()}
