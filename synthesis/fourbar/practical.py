"""Whether one would build a linkage: the practical limits, and which of them a solution breaks."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from synthesis.fourbar.excursion import LEAVES_SAMPLES
from synthesis.fourbar.limits import Reach
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Samples

TRANSMISSION_ANGLE = np.deg2rad(35.0)
"""Least over the used interval: below it friction grows, and play in the pins shows."""
TRANSMISSION_ANGLE_TURN = np.deg2rad(15.0)
"""Least over the whole turn, where the crank turns fully."""
LINK_RATIO = 10.0
"""Most of the longest link over the shortest."""
REACH = 10.0
"""No link, and no distance of a pivot from the motion's middle, is longer than this many extents of the motion."""


_ROUNDED = 1e-9
"""Part by which a limit may seem broken that is kept to rounding."""


def practical_limits(samples: Samples, given: dict[str, Any]) -> dict[str, Any]:
    """The practical limits as arguments of `limits.Limits`; one that is given replaces them where it says the same.

    Parameters
    ----------
    samples : Samples
        The motion, whose extent limits lengths and distances.
    given : dict
        Arguments of `limits.Limits` that a request gives.
    """
    asked: dict[str, Any] = {
        "transmission_angle_min": TRANSMISSION_ANGLE,
        "transmission_angle_min_turn": TRANSMISSION_ANGLE_TURN,
        "link_ratio_max": LINK_RATIO,
    }
    if samples.position is not None:
        far, middle = REACH * samples.extent, complex(samples.position_mean(samples.position))
        asked["link_max"] = max(far, given.get("link_min", 0.0), *(one or 0.0 for one in given.get("links", ())), 0.0)
        places = [
            None if given.keys() & {name, f"{name}_box", "pivot_box", "envelope"} else far
            for name in ("pivot_a", "pivot_b")
        ]
        asked["pivot_reach"] = Reach(middle, *places)
    lengths = [one for one in given.get("links", ()) if one is not None]
    if lengths:
        asked["link_ratio_max"] = max(LINK_RATIO, max(lengths) / min(lengths))
    return asked | given


def placed_by(limits: object, pivot: str) -> bool:
    """Whether limits themselves say where a fixed pivot, ``pivot_a`` or ``pivot_b``, lies."""
    return any(getattr(limits, name, None) is not None for name in (pivot, f"{pivot}_box", "pivot_box", "envelope"))


class Built(Protocol):
    """What practical limits look at."""

    @property
    def linkage(self) -> Linkage:
        """The linkage."""

    @property
    def transmission_angle_min(self) -> float:
        """Over the used interval."""

    @property
    def transmission_angle_min_turn(self) -> float | None:
        """Over the whole turn; None where the crank does not turn fully."""


class Asked(Protocol):
    """The limits of a request that may take the place of practical ones; 0 or None where it gives none."""

    @property
    def transmission_angle_min(self) -> float:
        """Over the used interval."""

    @property
    def transmission_angle_min_turn(self) -> float:
        """Over the whole turn."""

    @property
    def link_ratio_max(self) -> float | None:
        """Longest link over the shortest."""

    @property
    def link_max(self) -> float | None:
        """Longest link."""


def practical_faults(solution: Built, samples: Samples, limits: Asked, excursion: float | None = None) -> list[str]:
    """A sentence for each practical limit that a solution breaks; what a request limits itself is judged by its own limit.

    Parameters
    ----------
    solution : Solution, or whatever is built like one
    samples : Samples
        The motion; without positions lengths are ratios, and only those are judged.
    limits : Limits
        Of the request.
    excursion : float, optional
        Of the body point between samples, see `excursion.excursions`.
    """
    linkage, faults = solution.linkage, []

    def angle(found: float, wanted: float, where: str) -> None:
        if found < wanted - _ROUNDED:
            degrees = np.rad2deg([found, wanted])
            faults.append(f"transmission angle {degrees[0]:.3g} degrees {where}, below {degrees[1]:.3g}")

    angle(
        solution.transmission_angle_min, limits.transmission_angle_min or TRANSMISSION_ANGLE, "over the used interval"
    )
    if solution.transmission_angle_min_turn is not None:
        least = limits.transmission_angle_min_turn or TRANSMISSION_ANGLE_TURN
        angle(solution.transmission_angle_min_turn, least, "over the whole turn")
    ratio, most = max(linkage.links) / min(linkage.links), limits.link_ratio_max or LINK_RATIO
    if ratio > most * (1 + _ROUNDED):
        faults.append(f"longest link {ratio:.3g} times the shortest, above {most:g}")
    if samples.position is not None:
        extent, middle = samples.extent, complex(samples.position_mean(samples.position))
        longest = max(linkage.links)
        if limits.link_max is None and longest > REACH * extent:
            faults.append(f"longest link {longest / extent:.3g} times the motion's extent, above {REACH:g}")
        pivots = {"pivot_a": linkage.pivot_a, "pivot_b": linkage.pivot_b}
        far = [abs(place - middle) / extent for name, place in pivots.items() if not placed_by(limits, name)]
        if far and max(far) > REACH * (1 + _ROUNDED):
            faults.append(f"a fixed pivot {max(far):.3g} extents from the motion's middle, above {REACH:g}")
    if excursion is not None and excursion > LEAVES_SAMPLES:
        faults.append(
            f"the body point goes {excursion:.3g} times as far between two samples as they are apart, above {LEAVES_SAMPLES:g}"
        )
    return faults


def size_of(linkage: Linkage, samples: Samples) -> float | None:
    """Largest of the links, the coupler point's radius and the pivots' distances from the motion's middle, over its extent.

    None without positions.
    """
    if samples.position is None or linkage.coupler_point is None:
        return None
    middle = complex(samples.position_mean(samples.position))
    reach = (abs(linkage.pivot_a - middle), abs(linkage.pivot_b - middle))
    return float(max(*linkage.links, linkage.coupler_point[0], *reach)) / samples.extent
