"""Quick returns and steering: functions that are defined by a few numbers instead of pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from linkage_atlas.arguments import Fields, check_required, positive, radians_in, read_fields
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.function.quick_return import excess_angle
from synthesis.target import MAX_LENGTH

_STEERING_SAMPLES = 41
QUICK_RETURN_NOTE = (
    "The output moves slowly while the crank turns by the first {slow:.6g} degrees and returns while it turns by {fast:.6g}. "
    "For a slow motion the other way let the crank turn clockwise."
)
TOO_QUICK = "No slider-crank whose crank turns fully has a time ratio of 3 or more."
SLIDER_CRANKS = (
    "With this stroke and time ratio a slider-crank has a crank of {crank[0]:.3g} to {crank[1]:.3g}, a rod of at least {rod:.3g} "
    "and a transmission angle of at most {transmission:.3g} degrees."
)
NO_CRANK_ROCKER = "No crank-rocker with this swing and time ratio was found."
CRANK_ROCKERS = "With this swing and time ratio the transmission angle of a crank-rocker is at most {:.3g} degrees."
STEERING_NOTE = (
    "Input: the left wheel, output: the right wheel, counter-clockwise from straight ahead; the left kingpin is A, the right one "
    "B, and the car drives at right angles to A->B, to its left."
)


@dataclass(frozen=True)
class QuickReturn:
    """A wanted quick return: a stroke or a swing, and the time ratio of the slow to the fast motion."""

    alpha: float
    """Angle in radians by which the slow motion takes more than half a turn of the crank."""
    stroke: float | None
    swing: float | None
    """In the unit of angle of the request."""
    degrees: bool

    @property
    def pairs(self) -> dict[str, object]:
        """The ends of both motions as arguments of `linkage_atlas.function`."""
        half, turn = (np.pi + self.alpha) / radians_in(self.degrees), 2 * np.pi / radians_in(self.degrees)
        size = self.stroke if self.stroke is not None else self.swing
        unit = {"output_unit": "length"} if self.stroke is not None else {}
        return {"input": [0.0, half, turn], "output": [0.0, size, 0.0], **unit}

    @property
    def note(self) -> str:
        """A sentence on both motions."""
        slow = 180 + np.rad2deg(self.alpha)
        return QUICK_RETURN_NOTE.format(slow=slow, fast=360 - slow)


def read_quick_return(value: object, degrees: bool) -> QuickReturn:
    """Return a checked quick return; see `linkage_atlas.function`."""
    radian = radians_in(degrees)
    read = read_fields("quick_return/", value, dict.fromkeys(("stroke", "swing", "time_ratio"), positive))
    if ("stroke" in read) == ("swing" in read):
        raise FieldError(
            "/quick_return", "give either `stroke`, the travel of a slider, or `swing`, the angle of a rocker"
        )
    check_required("quick_return/", read, ("time_ratio",))
    stroke, swing, ratio = read.get("stroke"), read.get("swing"), read["time_ratio"]
    if not 1 <= ratio <= 100:
        raise FieldError(
            "/quick_return/time_ratio",
            f"must be from 1 to 100, the duration of the slow over the fast motion; it is {ratio:g}",
        )
    if stroke is not None and stroke > MAX_LENGTH:
        raise FieldError("/quick_return/stroke", f"must be at most {MAX_LENGTH:g}")
    if swing is not None and not swing * radian < np.pi:
        raise FieldError("/quick_return/swing", "must be an angle between 0 and half a turn")
    return QuickReturn(excess_angle(ratio), stroke, swing, degrees)


def read_steering(value: object, degrees: bool) -> tuple[Floats, Floats, float]:
    """Return angles of the left and of the right wheel from straight ahead in the request's unit, and the track.

    The axes of all wheels meet in a point (R. Ackermann's condition): cot(outer) - cot(inner) = track / wheelbase.
    """
    names = ("track", "wheelbase", "angle")
    values = read_fields("steering/", value, dict.fromkeys(names, positive))
    check_required("steering/", values, names)
    inner = values["angle"] * radians_in(degrees)
    if inner > np.deg2rad(80):
        raise FieldError("/steering/angle", "must be at most 80 degrees for the inner wheel")
    ratio = values["track"] / values["wheelbase"]
    outer = float(ackermann(np.array([inner]), ratio)[0])
    left = np.linspace(-outer, inner, _STEERING_SAMPLES)
    radian = radians_in(degrees)
    return left / radian, ackermann(left, ratio) / radian, values["track"]


def ackermann(left: Floats, ratio: float) -> Floats:
    """Return the angles of the right wheel for angles of the left wheel, in radians; ``ratio``: track over wheelbase."""
    if np.any(np.abs(left) >= np.pi / 2):
        return np.full_like(left, np.nan)
    return np.arctan2(np.tan(left), 1 + ratio * np.tan(left))


def with_ground(limits: Fields | None, track: float) -> dict[str, object]:
    """Return limits whose ground is the track; raise FieldError for another ground."""
    named = dict(limits or {})
    own = named.get("links")
    links = {name: value for name, value in own.items() if value is not None} if isinstance(own, Mapping) else {}
    if links.get("ground", track) != track:
        raise FieldError("/limits/links/ground", f"must be left out: the ground is the track, {track:g}")
    return named | {"links": links | {"ground": track}}
