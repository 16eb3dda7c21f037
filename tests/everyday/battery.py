"""150 questions as people ask them: drawn paths, poses of everyday machines, functions; nearly none has an exact answer.

Each row is a name, the request as it is sent to the service, and what a good answer to it has: the objective J that the best
linkage within the practical limits has at most, in `good.toml` (``python -m tests.everyday.good`` writes it).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.complex128]


class Row(NamedTuple):
    """One question."""

    name: str
    route: str
    request: dict[str, Any]


# -- drawn paths ------------------------------------------------------------------------------------------------------
# Each is a curve over 0..1 of some 200 units, closed where it comes back to its beginning.


def _polyline(*corners: complex) -> Callable[[Any], Points]:
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    real, imag = np.real(corners), np.imag(corners)
    return lambda s: np.interp(s * way[-1], way, real) + 1j * np.interp(s * way[-1], way, imag)


def _turn(s: Any) -> Points:
    return np.exp(2j * np.pi * np.asarray(s))


CLOSED: dict[str, Callable[[Any], Points]] = {
    "oval": lambda s: 100 * _turn(s).real + 45j * _turn(s).imag,
    "circle": lambda s: 80 * _turn(s),
    "tilted oval": lambda s: (100 * _turn(s).real + 30j * _turn(s).imag) * np.exp(0.6j),
    "D": lambda s: (
        np.where(
            np.asarray(s) < 0.45, -90 + np.asarray(s) / 0.45 * 180, 90 * np.cos((np.asarray(s) - 0.45) / 0.55 * np.pi)
        )
        + 1j * np.where(np.asarray(s) < 0.45, 0.0, 60 * np.sin((np.asarray(s) - 0.45) / 0.55 * np.pi))
    ),
    "rectangle": _polyline(0, 180, 180 + 80j, 80j, 0),
    "square": _polyline(0, 100, 100 + 100j, 100j, 0),
    "triangle": _polyline(0, 160, 60 + 120j, 0),
    "eight": lambda s: 100 * np.sin(2 * np.pi * np.asarray(s)) + 45j * np.sin(4 * np.pi * np.asarray(s)),
    "teardrop": lambda s: 80 * _turn(s).real + 50j * _turn(s).imag * np.sin(np.pi * np.asarray(s)) ** 1.5,
    "banana": lambda s: (140 + 25 * _turn(s).real) * np.exp(1j * (np.pi / 2 + 0.8 * _turn(s).imag)),
}
OPEN: dict[str, Callable[[Any], Points]] = {
    "line": _polyline(0, 200),
    "slanting line": _polyline(0, 170 + 90j),
    "wave": lambda s: 200 * np.asarray(s) + 40j * np.sin(2 * np.pi * np.asarray(s)),
    "long wave": lambda s: 200 * np.asarray(s) + 25j * np.sin(4 * np.pi * np.asarray(s)),
    "arc": lambda s: 100 * np.exp(1j * np.pi * (0.9 - 0.8 * np.asarray(s))),
    "hook": lambda s: 150 * np.asarray(s) + 90j * np.asarray(s) ** 4,
    "corner": _polyline(0, 120, 120 + 90j),
    "U": _polyline(100j, 0, 90, 90 + 100j),
    "zigzag": _polyline(0, 70 + 50j, 120, 190 + 50j),
    "S": lambda s: 60 * np.tanh(4 * (np.asarray(s) - 0.5)) + 140j * np.asarray(s),
    "spiral": lambda s: (30 + 70 * np.asarray(s)) * np.exp(4.5j * np.asarray(s)),
    "step": lambda s: 180 * np.asarray(s) + 70j / (1 + np.exp(-14 * (np.asarray(s) - 0.5))),
}


def drawn(shape: str, count: int, wobble: float = 0.0) -> dict[str, Any]:
    """The request that a drawn shape becomes: points evenly along it, moved by a wobbly hand, rounded to a tenth."""
    closed = shape in CLOSED
    fine = (CLOSED | OPEN)[shape](np.linspace(0, 1, 2001))
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(fine)))])
    at = np.linspace(0, way[-1], count, endpoint=not closed)
    points = np.interp(at, way, fine.real) + 1j * np.interp(at, way, fine.imag)
    random = np.random.default_rng([count, *map(ord, shape)])
    noise = random.standard_normal(count + 4) + 1j * random.standard_normal(count + 4)
    # the hand wobbles slowly where there are many points
    slow = np.convolve(noise, np.ones(5) / np.sqrt(5), mode="valid") if count > 8 else noise[:count]
    points = points + wobble * slow
    request: dict[str, Any] = {"position": [[round(p.real, 1), round(p.imag, 1)] for p in points.tolist()]}
    return request | {"timing": "free"} | ({"closed": True} if closed else {})


# -- bodies that are carried ------------------------------------------------------------------------------------------
# x, y and angle of each pose, in mm and degrees; ".": missing.

POSES = {
    "casement": "0 0 0; 40 8 8; 80 22 17; 118 42 27; 150 66 38; 178 95 50; 198 128 62; 210 160 75",
    "casement, three poses": "0 0 0; 40 8 15; 75 30 40",
    "garage door": "0 0 90; 60 400 80; 180 800 60; 420 1200 38; 800 1500 18; 1250 1650 6; 1700 1700 0",
    "garage door, five poses": "0 0 90; 150 700 65; 500 1300 35; 1000 1600 12; 1600 1700 0",
    "bucket": "0 0 0; 60 150 -2; 95 320 2; 110 500 12; 130 690 25; 190 880 38; 300 1050 45; 450 1180 48",
    "bucket that tips": "0 0 0; 10 120 5; 30 240 12; 65 350 25; 120 430 48; 190 460 78; 250 440 105",
    "bonnet": "0 0 0; -30 60 6; -55 130 13; -70 210 21; -75 300 30; -70 390 39; -55 480 48",
    "boot lid": "0 0 0; 20 90 10; 60 175 22; 120 250 36; 195 305 52; 275 335 68; 350 340 82",
    "landing gear": "0 0 -90; 70 12 -75; 135 45 -58; 190 95 -40; 228 160 -22; 245 230 -5; 240 295 8",
    "landing gear, four poses": "0 0 -90; 110 30 -62; 200 110 -32; 245 230 0",
    "knee": "0 0 0; 3 6 20; 8 11 40; 14 14 60; 20 15 80; 26 14 100; 31 11 120",
    "gripper": "0 0 0; 2 9 0; 5 18 1; 9 27 2; 14 35 5; 20 42 9",
    "gripper that stays level": "0 0 0; 8 15 0; 18 28 0; 30 38 0; 44 45 0",
    "wiper blade": "0 0 0; 60 110 18; 160 200 36; 285 255 55; 420 265 74; 540 225 93; 630 150 110",
    "desk lamp": "0 0 0; 30 55 0; 70 100 0; 120 130 0; 175 145 0",
    "pick and place": "0 0 0; 0 40 0; 30 80 0; 90 95 0; 150 80 0; 180 40 0; 180 0 0",
    "pick, turn and place": "0 0 0; 10 60 15; 60 110 45; 130 120 75; 190 80 90; 210 20 90",
    "oven door": "0 0 90; 40 -8 75; 85 -30 58; 125 -65 40; 155 -110 22; 170 -160 6; 170 -190 0",
    "kitchen flap": "0 0 0; 20 60 12; 60 115 28; 115 155 46; 180 175 64; 250 170 80; 315 145 90",
    "tipping body": "0 0 0; -20 30 8; -45 70 17; -75 120 27; -108 180 37; -140 250 46; -165 320 54",
    "sofa bed": "0 0 0; 120 90 10; 270 150 20; 440 165 25; 610 130 20; 760 60 10; 880 0 0",
    "folding step": "0 0 90; 60 -20 70; 120 -70 48; 165 -140 26; 190 -215 6; 195 -240 0",
    "window vent": "0 0 0; 4 20 5; 10 42 10; 18 66 15; 28 92 20; 40 120 25",
    "hospital bed": "0 0 0; -15 40 8; -40 85 17; -75 130 27; -120 170 38; -175 200 50; -235 215 62",
    "drawbridge": "0 0 0; -10 80 10; -40 165 22; -90 245 35; -160 310 49; -245 350 63; -340 360 77",
    "solar panel": "0 0 10; 30 20 20; 55 45 31; 74 76 42; 86 110 53; 90 146 64",
    "hatch that slides and turns": "0 0 0; 80 5 0; 160 12 2; 240 25 8; 310 55 20; 365 105 38; 400 170 58",
    "seat": "0 0 0; 35 -4 3; 72 -10 7; 110 -20 12; 150 -33 18; 190 -50 25",
    "monitor arm": "0 0 0; 60 40 3; 110 100 4; 140 170 2; 150 245 0; 140 320 -3",
    "hinge of a cupboard": "0 0 0; 12 6 14; 21 16 29; 27 29 44; 29 43 60; 27 57 76; 21 69 92",
    "tailgate": "0 0 0; 45 20 12; 100 60 26; 160 125 42; 215 215 60; 255 325 80",
    "poses from a sketch": "10 15 5; 45 60 30; 110 80 65; 180 60 80; 230 10 85",
    "table of six": "0 0 0; 10 20 10; 30 30 20; 60 30 30; 100 20 40; 150 0 50",
    "turning in place": "0 0 0; 5 2 30; 8 6 60; 8 12 90; 4 16 120",
    "shuttle there and back": "0 0 0; 100 10 5; 200 0 0; 100 -10 -5",
    "two poses": "0 0 0; 120 80 60",
    "flap, angles at both ends": "0 0 0; 20 60 .; 60 115 .; 115 155 .; 180 175 .; 250 170 80",
    "bucket, angles at four": "0 0 0; 60 150 .; 95 320 2; 110 500 .; 130 690 25; 190 880 .; 300 1050 .; 450 1180 48",
    "bonnet, every second angle": "0 0 0; -30 60 .; -55 130 13; -70 210 .; -75 300 30; -70 390 .; -55 480 48",
    "lamp, first and last level": "0 0 0; 30 55 .; 70 100 .; 120 130 .; 175 145 0",
    "knee, some angles": "0 0 0; 3 6 .; 8 11 40; 14 14 .; 20 15 80; 26 14 .; 31 11 120",
    "gear, one angle missing": "0 0 -90; 70 12 -75; 135 45 .; 190 95 -40; 228 160 -22; 245 230 -5",
    "wiper, only the ends": "0 0 0; 60 110 .; 160 200 .; 285 255 .; 420 265 .; 540 225 .; 630 150 110",
    "place missing in the middle": "0 0 0; 40 8 8; . . 17; 118 42 27; 150 66 38; . . 50; 198 128 62",
}
# positions of a point alone
POINTS = {
    "needle bar": "0 0; 1 6; 1.5 13; 1 20; 0 26; -1 20; -1.5 13; -1 6",
    "pump jack": "0 0; 8 150; 12 330; 10 520; 0 700; -12 520; -16 330; -10 150",
    "walking foot": "0 0; 40 0; 80 0; 120 0; 160 0; 150 35; 110 60; 60 62; 15 40",
    "film claw": "0 0; 0 5; 0 10; 0 15; 0 20; 4 20; 6 15; 6 10; 6 5; 4 0",
    "stirrer": "0 0; 50 20; 80 70; 70 130; 20 160; -40 140; -70 90; -50 30",
    "crane hook": "0 0; 25 1; 50 1; 75 0; 100 0; 125 -1; 150 0",
    "five points": "0 0; 30 40; 80 50; 120 30; 140 -10",
    "three points": "0 0; 50 40; 120 50",
    "round numbers": "0 0; 100 0; 200 50; 300 150; 350 300; 350 450",
    "points in metres": "0 0; 0.12 0.05; 0.25 0.08; 0.39 0.09; 0.54 0.07; 0.66 0.02",
    "far from the origin": "5000 3000; 5040 3030; 5090 3045; 5140 3040; 5180 3015; 5200 2975",
}


def carried(table: str) -> dict[str, Any]:
    """The request of a table of poses or points."""
    rows = [[None if cell == "." else float(cell) for cell in row.split()] for row in table.split(";")]
    request: dict[str, Any] = {"position": [None if row[0] is None else row[:2] for row in rows], "timing": "free"}
    if len(rows[0]) == 3:
        request["rotation"] = [row[2] for row in rows]
    return request


# -- functions and motions in step with a crank -----------------------------------------------------------------------

_LOG = {"function": {"name": "log10", "x": [1, 2], "output_span": 60}, "crank_span": 60}
FUNCTIONS: dict[str, dict[str, Any]] = {
    "x^1.5": {"function": {"name": "power", "exponent": 1.5, "x": [0, 1], "output_span": 90}, "crank_span": 90},
    "x^2": {"function": {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 60}, "crank_span": 90},
    "root": {"function": {"name": "power", "exponent": 0.5, "x": [0.1, 1], "output_span": 80}, "crank_span": 100},
    "log": _LOG,
    "log, largest error": _LOG | {"objective": "max"},
    "sine": {"function": {"name": "sin", "x": [0, 90], "output_span": 90}, "crank_span": 90},
    "tangent": {"function": {"name": "tan", "x": [0, 45], "output_span": 90}, "crank_span": 90},
    "1/x": {"function": {"name": "reciprocal", "x": [1, 2], "output_span": 90}, "crank_span": 90},
    "toggle": {"output": [0, 22, 40, 54, 64, 71, 75, 77, 78], "crank_span": 80},
    "toggle, few": {"input": [0, 20, 45, 70], "output": [0, 30, 52, 58]},
    "pairs": {"input": [0, 30, 55, 85, 110], "output": [0, 18, 38, 66, 84]},
    "pairs, falling": {"input": [0, 25, 50, 80], "output": [60, 48, 30, 0]},
    "steering": {"input": [-40, -20, 0, 20, 40], "output": [-32, -17.5, 0, 23.5, 53]},
    "even": {"output": [0, 10, 20, 30, 40, 50, 60], "crank_span": 120},
    "dwell": {"output": [0, 0.5, 0, 4, 14, 30, 46, 58, 64], "crank_span": 160},
}


def timed(table: str, span: float) -> dict[str, Any]:
    """A motion in even steps of a crank."""
    request = carried(table)
    del request["timing"]
    return request | {"crank_span": span}


TIMED = {
    "casement in step with a motor": timed(POSES["casement"], 70),
    "bucket in step": timed(POSES["bucket"], 120),
    "stirrer, one turn": timed(POINTS["stirrer"], 315),
    "wave in step": {name: part for name, part in drawn("wave", 24).items() if name != "timing"}
    | {"crank_span": 180},
    "rotation alone": {"rotation": [0, 6, 15, 27, 40, 52, 60], "crank_span": 90},
}


def rows() -> list[Row]:
    """All questions."""
    out = []
    for shape in CLOSED | OPEN:
        counts = (5, 12, 24) if shape in ("oval", "D", "rectangle", "eight", "line", "wave") else (8, 24)
        out += [Row(f"{shape}, {n} points", "synthesize", drawn(shape, n)) for n in counts]
        wobbly = (8, 24, 60) if len(counts) == 3 else (12, 60)[: 1 + (len(shape) % 2)]
        out += [Row(f"{shape}, {n} points by hand", "synthesize", drawn(shape, n, 1.5)) for n in wobbly]
    out += [Row(name, "synthesize", carried(table)) for name, table in (POSES | POINTS).items()]
    out += [Row(name, "function", request) for name, request in FUNCTIONS.items()]
    out += [Row(name, "synthesize", request) for name, request in TIMED.items()]
    return out


def group_of(name: str) -> str:
    """The group of a row, by its name."""
    if name in FUNCTIONS:
        return "functions"
    if name in TIMED:
        return "in step with a crank"
    if name in POSES:
        return "poses, angles missing" if "." in POSES[name].split() else "poses"
    if name in POINTS:
        return "points"
    return "drawn by hand" if name.endswith("by hand") else "drawn"


def limited(row: Row, kind: str) -> dict[str, Any]:
    """The request of a row within limits of a kind: "none", "preset", "box" or "any"."""
    request = dict(row.request)
    if kind == "none":
        return request | {"limits": {"preset": "none"}}
    if kind == "any":
        return request | {"limits": {"family": "any", "preset": "practical"}}
    if kind == "box" and "position" in request:
        places = np.array([place for place in request["position"] if place is not None])
        low, high = places.min(axis=0), places.max(axis=0)
        size = float(np.max(high - low))
        # a frame below and to the left, as wide as the motion: pivots may lie there and nowhere else
        box = [low[0] - size, low[1] - size, high[0], low[1] + 0.5 * size]
        return request | {"limits": {"pivot_box": [round(float(side), 3) for side in box], "preset": "practical"}}
    if kind == "box":
        return request | {"limits": {"link_min": 0.3, "link_max": 3, "preset": "practical"}}
    return request | {"limits": {"preset": "practical"}}


KINDS = ("none", "preset", "box", "any")
BUDGETS = (100, 300, 1000, None)
