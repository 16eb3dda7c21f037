"""Functions by name: the requested outputs, and the largest error of a reply by independent arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.oracles.free_classes import close
from tests.oracles.recompute import LINKS

SAMPLES = 2001
_DEGREE = np.pi / 180
NAMED: dict[str, Callable[..., Any]] = {
    "log10": np.log10,
    "ln": np.log,
    "exp": np.exp,
    "reciprocal": np.reciprocal,
    "sin": lambda x: np.sin(x * _DEGREE),
    "cos": lambda x: np.cos(x * _DEGREE),
    "tan": lambda x: np.tan(x * _DEGREE),
}
"""The functions of a request by their name, of arguments in its units; a power is made of its exponent."""
ENDS = {"log10": (1.5, 4), "ln": (1.5, 4), "exp": (0.5, 2), "reciprocal": (1.5, 3), "sin": (45, 90), "cos": (45, 90)}
ENDS |= {"tan": (30, 50), "power": (0.8, 2)}
"""From where to where the right end of x is drawn."""


def wanted_output(request: Mapping[str, Any]) -> np.ndarray:
    """The output of a function by its name in degrees, from 0 on, at even places of its interval."""
    x = np.linspace(*request["x"], SAMPLES)
    y = x ** request["exponent"] if request["name"] == "power" else NAMED[request["name"]](x)
    high = np.ptp(y)
    direction = -1 if y[0] - y[-1] > 1e-9 * high else 1  # the sign of the span is that from the first to the last
    return direction * request["output_span"] * (y - y[0]) / high


def largest_error(request: Mapping[str, Any], solution: Mapping[str, Any]) -> float:
    """Largest error in degrees at the places, whole turns left out; infinite where the linkage opens."""
    links = [solution["links"][name] for name in LINKS]
    crank = (solution["start_angle"] + np.linspace(0, request["crank_span"], SAMPLES)) * _DEGREE
    _, pin = close(links, solution["branch"], crank)
    gap = (
        wanted_output(request["function"]) - np.unwrap(np.angle(pin - links[3])) / _DEGREE - solution["output_offset"]
    )
    error = float(np.abs(gap - 360 * np.round(gap[0] / 360)).max())
    return error if np.isfinite(error) else np.inf
