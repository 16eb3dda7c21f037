"""A requested motion and limits as a user gives them: plain arrays, in degrees or radians, checked by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from synthesis.errors import FieldError
from synthesis.fourbar.limits import Limits
from synthesis.target import MAX_LENGTH, MAX_SAMPLES, MIN_LENGTH, MIN_SAMPLES, Target, make_target

__all__ = [
    "LIMITS",
    "MAX_LENGTH",
    "MAX_SAMPLES",
    "MIN_LENGTH",
    "MIN_SAMPLES",
    "Motion",
    "number",
    "radians_in",
    "read_limits",
]

LIMITS = ("transmission_angle_min", "pivot_box", "link_min", "link_max", "family")
"""Names of the limits, as over HTTP."""


def radians_in(degrees: bool) -> float:
    """Radians in one unit of angle."""
    return np.pi / 180 if degrees else 1.0


@dataclass(frozen=True)
class Motion:
    """A checked motion in its user's unit of angle.

    Attributes
    ----------
    target : Target
        The same in radians.
    degrees : bool
    """

    target: Target
    degrees: bool = True

    @classmethod
    def of(
        cls,
        rotation: ArrayLike | None = None,
        position: ArrayLike | None = None,
        crank_span: float | None = None,
        crank_angle: ArrayLike | None = None,
        length_scale: float | None = None,
        degrees: bool = True,
    ) -> Motion:
        """The motion of a request; see `linkage_atlas.synthesize` for what the arguments mean.

        Raises
        ------
        FieldError
            Naming the argument and the sample.
        """
        radian = radians_in(degrees)
        with np.errstate(over="ignore"):
            return cls(
                make_target(
                    None if rotation is None else _numbers("rotation", rotation) * radian,
                    None if position is None else _points(position),
                    None if crank_span is None else number("crank_span", crank_span) * radian,
                    None if crank_angle is None else _numbers("crank_angle", crank_angle) * radian,
                    None if length_scale is None else number("length_scale", length_scale),
                ),
                degrees,
            )

    @property
    def radian(self) -> float:
        """Radians in one unit of angle."""
        return radians_in(self.degrees)

    def notes(self) -> list[str]:
        """What a user should know about a rotation that looks wrapped."""
        if self.target.rotation is None:
            return []
        jump = np.abs(np.diff(self.target.rotation))
        if jump.max() <= np.pi:
            return []
        place = int(np.argmax(jump))
        return [
            f"rotation jumps by more than half a turn from sample {place} to {place + 1}; it is taken as continuous, "
            "so if that is a wrap at 180 or 360 degrees, unwrap it"
        ]


def number(field: str, value: Any, least: float = -np.inf) -> float:
    """A finite number of at least ``least``, or a FieldError that names the argument."""
    try:
        found = float(value)
    except (TypeError, ValueError):
        raise FieldError(f"/{field}", f"wanted a number, found {value!r}") from None
    if not (np.isfinite(found) and found >= least):
        bound = "" if least == -np.inf else f" of at least {least:g}"
        raise FieldError(f"/{field}", f"wanted a finite number{bound}")
    return found


def _numbers(name: str, values: ArrayLike) -> Any:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise FieldError(f"/{name}", "wanted numbers") from None


def _points(position: ArrayLike) -> Any:
    points = np.asarray(position)
    if not np.iscomplexobj(points):
        points = _numbers("position", position)
        if points.ndim != 2 or points.shape[1] != 2:
            raise FieldError("/position", f"wanted shape (N, 2), found {points.shape}")
        # not x + 1j y: with an infinite y that would make x a NaN
        points = np.ascontiguousarray(points).view(complex)[:, 0]
    return points


def read_limits(limits: Mapping[str, Any] | None, motion: Motion) -> Limits:
    """The limits of a request, checked against its motion."""
    given = dict(limits or {})
    for name in given:
        if name not in LIMITS:
            raise FieldError(f"/limits/{name}", f"there is no such limit; there are {', '.join(LIMITS)}")
    given = {name: value for name, value in given.items() if value is not None}
    for name in ("transmission_angle_min", "link_min", "link_max"):
        if name in given:
            given[name] = number(f"limits/{name}", given[name])
    if "transmission_angle_min" in given:
        given["transmission_angle_min"] *= motion.radian
    if "pivot_box" in given:
        box = _numbers("limits/pivot_box", given["pivot_box"])
        if box.shape != (4,):
            raise FieldError("/limits/pivot_box", f"wanted [xmin, ymin, xmax, ymax], found {box.size} numbers")
        given["pivot_box"] = tuple(box.tolist())
    checked = Limits(**given)
    checked.check_against(motion.target)
    return checked
