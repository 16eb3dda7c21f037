"""Questions as people ask them: drawn paths, poses of everyday machines, functions; nearly none has an exact answer.

Each row is a name, the request as it is sent to the service, and what a good answer to it has: the objective J that the best
linkage within the practical limits has at most, in `good.toml` (``python -m benchmarks.good`` writes it).
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
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
# Each is a curve over 0..1 of some 200 units, closed if it comes back to its beginning.


def _polyline(*corners: complex) -> Callable[[Any], Points]:
    direction = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    real, imag = np.real(corners), np.imag(corners)
    return lambda s: (
        np.interp(s * direction[-1], direction, real) + 1j * np.interp(s * direction[-1], direction, imag)
    )


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
    direction = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(fine)))])
    at = np.linspace(0, direction[-1], count, endpoint=not closed)
    points = np.interp(at, direction, fine.real) + 1j * np.interp(at, direction, fine.imag)
    random = np.random.default_rng([count, *map(ord, shape)])
    noise = random.standard_normal(count + 4) + 1j * random.standard_normal(count + 4)
    # the hand wobbles slowly if there are many points
    slow = np.convolve(noise, np.ones(5) / np.sqrt(5), mode="valid") if count > 8 else noise[:count]
    points = points + wobble * slow
    request: dict[str, Any] = {"position": [[round(p.real, 1), round(p.imag, 1)] for p in points.tolist()]}
    return request | {"timing": "free"} | ({"closed": True} if closed else {})


# -- bodies that are carried ------------------------------------------------------------------------------------------
QUESTIONS = tomllib.loads(Path(__file__).with_name("questions.toml").read_text())
POSES, POINTS, FUNCTIONS = (QUESTIONS[kind] for kind in ("poses", "points", "functions"))


def carried(table: str) -> dict[str, Any]:
    """The request of a table of poses or points."""
    rows = [[None if cell == "." else float(cell) for cell in row.split()] for row in table.split(";")]
    request: dict[str, Any] = {"position": [None if row[0] is None else row[:2] for row in rows], "timing": "free"}
    if len(rows[0]) == 3:
        request["rotation"] = [row[2] for row in rows]
    return request


# -- motions in step with a crank --------------------------------------------------------------------------------------


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
    family = {}
    if request.get("timing") == "free":  # the least error of full cranks, beside which any family is never worse
        request["prefer"], family = "error", {"family": "full_crank"}
    if kind == "none":
        return request | {"limits": {"preset": "none"} | family}
    if kind == "any":
        return request | {"limits": {"family": "any", "preset": "practical"}}
    if kind == "box" and "position" in request:
        positions = np.array([position for position in request["position"] if position is not None])
        low, high = positions.min(axis=0), positions.max(axis=0)
        size = float(np.max(high - low))
        # a frame below and to the left, as wide as the motion: pivots may lie there and nowhere else
        box = [low[0] - size, low[1] - size, high[0], low[1] + 0.5 * size]
        return request | {
            "limits": {"pivot_box": [round(float(side), 3) for side in box], "preset": "practical"} | family
        }
    if kind == "box":
        return request | {"limits": {"link_min": 0.3, "link_max": 3, "preset": "practical"}}
    return request | {"limits": {"preset": "practical"} | family}


KINDS = ("none", "preset", "box", "any")
BUDGETS = (100, 300, 1000, None)
