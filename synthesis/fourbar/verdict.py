"""How a four-bar passes the samples of a motion: in order or not, on one branch, on one circuit, and driven from which side.

A linkage that reaches every sample may still fail as a machine: the crank must turn back between two samples (order defect),
pass a dead position where coupler and rocker lie on a line (branch defect), or the linkage must be taken apart and assembled
the other way round (circuit defect). The words are those of Chase and Mirth, "Circuits and branches of single-degree-of-freedom
planar linkages", ASME Journal of Mechanical Design 115 (1993), 223-230.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from synthesis.fourbar.excursion import LEAVES_SAMPLES
from synthesis.fourbar.limits import (
    LINK_RATIO,
    REACH,
    TRANSMISSION_ANGLE,
    TRANSMISSION_ANGLE_TURN,
    Limits,
    placed_by,
)
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.passage import Flags, Passage, from_the_rocker, passage
from synthesis.target import Samples

NAMED = 3
"""A reason names as many samples, or pairs of neighbours, and counts the rest."""
_ROUNDED = 1e-9
"""Part by which a limit may seem broken that is kept to rounding."""


@dataclass(frozen=True)
class Verdict:
    """How a linkage passes the samples of its motion.

    Attributes
    ----------
    order : bool
        Judged by the crank angles alone: a crank that turns one way passes them in the order asked for.
    branch : bool
        The sign of sin(theta2 - theta3) is the same at all samples.
    circuit : bool
        All samples, and all between, lie on one circuit.
    driver : str or None
        "crank": it drives the linkage through all samples in order, turning one way (order, branch and circuit are true);
        "rocker": the crank cannot, but the rocker can; None: neither can.
    uncertain : bool
        Nearer to a change point than `passage.NEAR_CHANGE_POINT`.
    reasons : tuple of str
        A sentence for each defect; samples count from 1.
    """

    order: bool
    branch: bool
    circuit: bool
    driver: str | None
    uncertain: bool
    reasons: tuple[str, ...]


def verdicts(
    linkages: Sequence[Linkage],
    crank_angle: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> list[Verdict]:
    """The `Verdict` of each linkage; arguments as of `passage`, one row a linkage."""
    if not linkages:
        return []
    lengths = np.array([one.links for one in linkages])
    angle, side = np.asarray(crank_angle, dtype=float), np.asarray(side)
    crank = passage(lengths, angle, side, ordered=ordered, closed=closed, timed=timed)
    rest = np.flatnonzero(crank.circuit & ~crank.driven)
    by_rocker = np.zeros(len(lengths), dtype=bool)
    if rest.size:
        other = from_the_rocker(lengths[rest], angle[rest], side[rest])
        by_rocker[rest] = passage(*other, ordered=ordered, closed=closed).driven
    found = []
    columns = (crank.order, crank.branch, crank.circuit, crank.uncertain, crank.driven, by_rocker)
    for k, (order, branch, circuit, uncertain, driven, otherwise) in enumerate(
        zip(*(one.tolist() for one in columns))
    ):
        driver = "crank" if driven else "rocker" if otherwise else None
        reasons = _reasons(crank, k, driver) if uncertain or not driven else ()
        found.append(Verdict(order, branch, circuit, driver, uncertain, reasons))
    return found


def _reasons(crank: Passage, k: int, driver: str | None) -> tuple[str, ...]:
    """A sentence for each defect of linkage ``k``."""
    reasons = []
    if not np.all(crank.closes[k]):
        numbers = [str(place + 1) for place in np.flatnonzero(~crank.closes[k])]
        reasons.append(f"the linkage does not close at {_listed(numbers)}")
    if np.any(flags := crank.open_between[k]):
        reasons.append(f"the linkage does not close everywhere between {_named(flags)}")
    if np.any(flags := crank.other_branch[k]):
        reasons.append(f"{_named(flags)} lie on different branches")
    if np.any(flags := crank.other_circuit[k]):
        reasons.append(
            f"{_named(flags)} lie on different circuits: the linkage would have to be taken apart between them"
        )
    if np.all(crank.closes[k]) and np.any(flags := crank.out_of_order[k] & ~crank.other_circuit[k]):
        first = int(np.argmax(flags)) + 1
        reasons.append(f"a crank that turns one way does not pass samples {first} and {first + 1} in this order")
    if crank.no_return[k]:
        reasons.append("the crank only swings: turning one way it does not come from the last sample to the first")
    if driver == "rocker":
        reasons.append("only the rocker can drive the linkage through the samples, not the crank")
    elif driver is None:
        reasons.append("neither crank nor rocker can drive the linkage through the samples, turning one way")
    if crank.uncertain[k]:
        reasons.append("the linkage is so near a change point that it may pass from one circuit to the other")
    return tuple(reasons)


def _named(flags: Flags) -> str:
    """The pairs of neighbours (N - 1,) that are flagged: "samples 2 and 3", "samples 2/3, 7/8"."""
    first = np.flatnonzero(flags) + 1
    return _listed(f"{first[0]} {first[0] + 1}".split() if first.size == 1 else [f"{k}/{k + 1}" for k in first])


def _listed(names: list[str]) -> str:
    """Samples by name, the first few: "sample 2", "samples 2 and 3", "samples 2, 3, 4 and 5 more"."""
    if len(names) == 1:
        return f"sample {names[0]}"
    rest = len(names) - NAMED
    named, last = (names[:NAMED], f"{rest} more") if rest > 0 else (names[:-1], names[-1])
    return f"samples {', '.join(named)} and {last}"


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


def practical_faults(solution: Built, samples: Samples, limits: Limits, excursion: float | None = None) -> list[str]:
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
