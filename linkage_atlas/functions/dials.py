"""Functions by name, by table or of Python on two linear dials, as samples of input and output angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, check_names, column, number, one_of, radians_in
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.target import MAX_SAMPLES, MIN_SAMPLES

RealFunction: TypeAlias = Callable[[Any], ArrayLike]
"""Function of a number or of an array of numbers, as a user gives it."""
MIN_PAIRS = 2
"""Minimum number of pairs of a function; two leave freedom, and the answers are a spread of exact linkages."""
SAMPLES = 101
LARGEST = 1e100
_RANGE = 8193
_OF_ANGLES: dict[str, Callable[[Floats], Floats]] = {"sin": np.sin, "cos": np.cos, "tan": np.tan}
_PLAIN: dict[str, Callable[[Floats], Floats]] = {
    "log10": np.log10, "ln": np.log, "exp": np.exp, "reciprocal": lambda x: 1 / x
}  # fmt: skip
NAMES = (*_PLAIN, *_OF_ANGLES, "power")
"""Names of functions."""
FIELDS = ("name", "table", "x", "exponent", "output_span", "samples")


@dataclass(frozen=True)
class Dials:
    """Function on two dials, in radians.

    ``x``, ``y`` (N,): the samples. ``input``, ``output`` (N,): crank angle from the first sample, and wanted rocker
    angle from there. ``y_of_radian``: change of y per radian of the output dial. ``exact``: the wanted rocker
    angle at any crank angle; None for a table.
    """

    x: Floats
    y: Floats
    input: Floats
    output: Floats
    y_of_radian: float
    exact: Callable[[Floats], Floats] | None


def read_dials(function: Fields, crank_span: float | None, degrees: bool) -> Dials:
    """Return the checked dials of a function by name or table; ``crank_span`` in radians. See `linkage_atlas.function`.

    In place of a name ``of`` may be a callable.
    """
    fields = {name: value for name, value in function.items() if value is not None}
    check_names("/function", (name for name in fields if name != "of"), FIELDS)
    if crank_span is None:
        raise FieldError("/crank_span", "is required for a `function`")
    if "output_span" not in fields:
        raise FieldError("/function/output_span", "is required: the angle through which the rocker turns")
    span = number("function/output_span", fields["output_span"]) * radians_in(degrees)
    if not 0 < abs(span) <= 20 * np.pi:
        raise FieldError("/function/output_span", "must be an angle other than 0, of at most ten turns")
    if ("name" in fields) + ("table" in fields) + ("of" in fields) != 1:
        raise FieldError("/function/name", "give either `name` or `table`")
    if "table" in fields:
        for name in ("x", "exponent", "samples"):
            if name in fields:
                raise FieldError(f"/function/{name}", "applies only to a function by `name`; remove it")
        x, y = _table(fields["table"])
        of = None
    else:
        x, y, of = _sampled(fields, degrees)
    # of a named function the dial is as long as the function is high, however it is sampled
    range_values = y if of is None else of(np.linspace(x[0], x[-1], _RANGE))
    low, high = float(range_values.min()), float(range_values.max())
    if not high > low:
        raise FieldError(
            "/function",
            "has the same y everywhere, so that the rocker would not turn; choose another function or range",
        )
    # if both ends are at the same height, the rocker turns in the direction in which y grows
    sign = -1.0 if y[0] - y[-1] > 1e-9 * (high - low) else 1.0
    scale, first = sign * span / (high - low), float(y[0])
    crank = (x - x[0]) / (x[-1] - x[0]) * crank_span
    exact = None
    if of is not None:
        curve, begin, end = of, float(x[0]), float(x[-1])

        def exact(crank: Floats) -> Floats:
            share = np.clip(crank / crank_span, 0.0, 1.0)
            return scale * (curve(begin * (1 - share) + end * share) - first)

    return Dials(x, y, crank, scale * (y - first), (high - low) / abs(span), exact)


def _table(table: object) -> tuple[Floats, Floats]:
    rows = column("function/table", table)
    if rows.ndim != 2 or rows.shape[1] != 2 or not MIN_PAIRS <= len(rows) <= MAX_SAMPLES:
        raise FieldError("/function/table", f"must have {MIN_PAIRS} to {MAX_SAMPLES} pairs [x, y]")
    if np.any(bad := ~np.isfinite(rows).all(axis=1)):
        raise FieldError(f"/function/table/{int(np.argmax(bad))}", "must have finite numbers")
    x, y = rows.T
    steps = np.diff(x) * np.sign(x[-1] - x[0])
    if np.any(back := steps <= 1e-9 * abs(x[-1] - x[0])):
        index = int(np.argmax(back)) + 1
        raise FieldError(
            f"/function/table/{index}",
            "x must either increase or decrease from sample to sample; this value does not",
        )
    return x.copy(), y.copy()


def _sampled(fields: Fields, degrees: bool) -> tuple[Floats, Floats, Callable[[Floats], Floats]]:
    one_of("function/name", fields.get("name", NAMES[0]), NAMES)
    if "x" not in fields:
        raise FieldError("/function/x", "is required: [first, last]")
    ends = column("function/x", fields["x"])
    if ends.shape != (2,) or not np.all(np.isfinite(ends)) or ends[0] == ends[1]:
        raise FieldError("/function/x", "must be two different finite numbers [first, last]")
    samples = fields.get("samples", SAMPLES)
    if not isinstance(samples, (int, np.integer)) or not MIN_SAMPLES <= samples <= MAX_SAMPLES:
        raise FieldError("/function/samples", f"must be a whole number from {MIN_SAMPLES} to {MAX_SAMPLES}")
    called = fields.get("of")
    of = partial(_called, called) if callable(called) else _named(fields, ends, degrees)
    x = np.linspace(ends[0], ends[1], samples)
    with np.errstate(all="ignore"):
        y = of(x)
    if not np.all(np.isfinite(y)) or np.abs(y).max() > LARGEST:
        raise FieldError("/function/x", "the function is too large in this range; choose another range")
    return x, y, of


def _called(of: RealFunction, x: Floats) -> Floats:
    """Return the values of a callable, which may take arrays or only numbers; FieldError if a value is not finite."""
    with np.errstate(all="ignore"):
        try:
            y = np.asarray(of(x))
        except Exception:  # the function may take numbers only; if it fails for a number, the error names it
            y = np.empty(0)
        if y.shape != x.shape or y.dtype.kind not in "iuf":
            y = np.array([_value(of, value) for value in x.ravel().tolist()]).reshape(x.shape)
    if np.any(bad := ~(np.abs(y) <= LARGEST)):
        found, at = y[bad].flat[0], x[bad].flat[0]
        raise FieldError("/output", f"must have finite values of at most {LARGEST:g}; it is {found:g} at x = {at:g}")
    return y.astype(float)


def _value(of: RealFunction, x: float) -> float:
    try:
        return float(np.asarray(of(x)))
    except Exception as error:
        raise FieldError("/output", f"the function fails at x = {x:g}: {error}") from error


def _named(fields: Fields, ends: Floats, degrees: bool) -> Callable[[Floats], Floats]:
    name = str(fields["name"])
    if (name == "power") != ("exponent" in fields):
        raise FieldError(
            "/function/exponent", "is required for the function 'power', and applies to no other function"
        )
    exponent, radian = number("function/exponent", fields.get("exponent", 0.0)), radians_in(degrees)
    turns = np.floor(ends * radian / np.pi - 0.5)
    if name == "tan" and turns[0] != turns[1]:
        raise FieldError("/function/x", "tan has a pole in this range; choose another range")
    low, high = sorted(ends)
    if name in ("log10", "ln") and low <= 0:
        raise FieldError("/function/x", f"{name} needs x above 0")
    if low <= 0 <= high and (name == "reciprocal" or (name == "power" and exponent < 0)):
        raise FieldError("/function/x", "the function has a pole at 0, which is in this range; choose another range")
    if low < 0 and name == "power" and exponent != np.round(exponent):
        raise FieldError("/function/x", "a fractional power needs x of at least 0")
    if name == "power":
        return lambda x: np.asarray(np.power(x, exponent))
    return (lambda x: _OF_ANGLES[name](x * radian)) if name in _OF_ANGLES else _PLAIN[name]
