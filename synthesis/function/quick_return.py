"""Quick-return linkages by their dead centres: slider-cranks of a given stroke, crank-rockers of a given swing, and a time ratio.

At both dead centres crank and rod (or coupler) lie on a line through the crank pivot A: the far end E of the output's
motion is at the distance p = rod + crank from A, the near end N at q = rod - crank. The slow motion takes half a turn
of the crank plus the angle alpha, the fast motion half a turn less alpha, so that A sees the ends under the angle
alpha::

    time ratio = (180 + alpha) / (180 - alpha),   EN^2 = p^2 + q^2 - 2 p q cos(alpha)

(H. Alt, Der Übertragungswinkel und seine Bedeutung für das Konstruieren periodischer Getriebe, Werkstattstechnik 26
(1932) 61-65; E. Söylemez, Mechanisms, section 7.1). A single number remains free, q over EN.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.constraints import keeps
from synthesis.four_bar import close_loop, transmission_angle_over
from synthesis.function.answers import Generator, generators_of, within_limits
from synthesis.function.few_pairs import function_merit
from synthesis.function.laws import ANGLE, FunctionLimits
from synthesis.function.problem import FunctionProblem
from synthesis.function.target_function import TargetFunction
from synthesis.function.travel_laws import LAWS
from synthesis.guides import Kind
from synthesis.limits import LINKS
from synthesis.mechanism import Placed
from synthesis.ranking import distinct_rows, merit
from synthesis.target import TURN, Interval


@dataclass(frozen=True)
class QuickReturnOptions:
    """Options of quick-return linkages by their dead centres."""

    rounding: float = 1e-9
    """Fraction by which rounding may violate a limit that an answer meets exactly."""
    exact: float = 1e-6
    """Error of a crank-rocker in radians below which it is exact except for rounding."""
    samples: int = 1500
    """Number of members of a family that are rated."""
    apart: float = 0.1
    """Smallest difference of two answers in some length, over the longest."""
    nearest: float = 1e-2
    """Smallest distance of the near end from the crank pivot, over the distance of both ends."""
    farthest: float = 1e2
    """Largest such distance."""


OPTIONS = QuickReturnOptions()


class SliderCranks(NamedTuple):
    """Slider-cranks of stroke 1 whose slow motion leads away from the crank pivot; the crank turns counter-clockwise."""

    lengths: Floats
    """(n, 3): crank, rod, and the offset of the rail, which lies below the crank pivot."""
    start: Floats
    """(n,): direction of the crank at the near dead centre."""
    near: Floats
    """(n,): position of the slider along the rail there."""


class CrankRockers(NamedTuple):
    """Four-bars whose rocker rises from a dead centre to the other; some may not be crank-rockers, or turn too fast."""

    lengths: Floats
    """(n, 4): crank, coupler, rocker and ground over the ground."""
    branch: Floats
    """(n,)"""
    start: Floats
    """(n,): crank angle at the first dead centre."""


def excess_angle(time_ratio: float) -> float:
    """Return alpha in radians, by which the slow motion takes more than half a turn of the crank."""
    return np.pi * (time_ratio - 1) / (time_ratio + 1)


def slider_cranks(alpha: float, near_end: Floats) -> SliderCranks:
    """Return the slider-cranks with the distance q (n,) of the near end over the stroke; 0 < q < cot(alpha)."""
    sine, cosine = np.sin(alpha), np.cos(alpha)
    far_end = near_end * cosine + np.sqrt(1 - (near_end * sine) ** 2)
    offset = 0.0 - far_end * near_end * sine
    along = np.sqrt((near_end - offset) * (near_end + offset))
    lengths = np.stack([(far_end - near_end) / 2, (far_end + near_end) / 2, offset], axis=1)
    return SliderCranks(lengths, np.arctan2(offset, along) + np.pi, along)


def all_slider_cranks(alpha: float, prescribed: Sequence[tuple[int, float]] = ()) -> SliderCranks:
    """Return the slider-cranks of the family, or only those with prescribed lengths (index, value over the stroke).

    The family is empty from alpha = 90 degrees, a time ratio of 3: the crank could not turn fully.
    """
    if alpha >= np.pi / 2:
        return slider_cranks(alpha, np.empty(0))
    last = 1 / np.tan(alpha) if alpha > 0 else np.inf
    near_ends = (
        np.geomspace(OPTIONS.nearest, OPTIONS.farthest, OPTIONS.samples)
        if last > OPTIONS.farthest
        else last * _between(OPTIONS.samples)
    )
    for index, value in prescribed:
        near_ends = _roots(lambda q: np.abs(slider_cranks(alpha, q).lengths), index, abs(value), near_ends)
    return slider_cranks(alpha, near_ends)


def all_crank_rockers(alpha: float, swing: float, prescribed: Sequence[tuple[int, float]] = ()) -> CrankRockers:
    """Return candidates for crank-rockers of a swing in radians, or only those with prescribed lengths over the ground.

    The rocker turns counter-clockwise while the crank turns by half a turn and alpha.
    """
    last = min(OPTIONS.farthest, 1 / np.sin(alpha)) if alpha > 0 else OPTIONS.farthest
    near_ends = np.geomspace(OPTIONS.nearest, last * (1 - 1e-9), OPTIONS.samples)
    found = []
    for first, side in itertools.product((-1, 1), (-1, 1)):
        at = partial(_crank_rockers, alpha, swing, first, side)
        chosen = near_ends
        for index, value in prescribed:
            chosen = _roots(lambda q, at=at: at(q).lengths, index, value, chosen)  # type: ignore[misc]
        found.append(at(chosen))
    candidates = CrankRockers(*(np.concatenate(columns) for columns in zip(*found)))
    good = (
        np.isfinite(candidates.lengths).all(axis=1) & (candidates.lengths.min(axis=1) > 0) & (candidates.branch != 0)
    )
    return CrankRockers(*(column[good] for column in candidates))


def _crank_rockers(alpha: float, swing: float, first: int, side: int, q: Floats) -> CrankRockers:
    """Return candidates with the distance q (n,) of the near end over the distance of both ends.

    The rocker has the length 1 and its pivot in the origin. ``first``: 1 if the motion begins at the far dead centre,
    -1 at the near dead centre. ``side``: side of the chord of both ends on which the crank pivot lies.
    """
    chord, sine = 2 * np.sin(swing / 2), np.sin(alpha)
    q = q * chord
    begin, end = np.exp(-0.5j * swing), np.exp(0.5j * swing)
    far_end, near_end = (begin, end) if first > 0 else (end, begin)
    p = q * np.cos(alpha) + np.sqrt(np.maximum(chord**2 - (q * sine) ** 2, 0.0))
    along = (q * q - p * p + chord**2) / (2 * chord)
    beside = np.sqrt(np.maximum((q - along) * (q + along), 0.0))
    pivot = near_end + (far_end - near_end) / chord * (along + 1j * side * beside)
    ground = np.abs(pivot)
    lengths = np.stack([(p - q) / 2, (p + q) / 2, np.ones_like(q), ground], axis=1) / ground[:, None]
    pin = begin - pivot
    crank = pin if first > 0 else -pin
    start = np.angle(crank / -pivot)
    joint = pivot + lengths[:, 0] * ground * crank / np.abs(crank)
    branch = np.sign(np.imag(np.conj(-joint) * (begin - joint)))
    return CrankRockers(lengths, branch, start)


def slider_crank_answers(target: TargetFunction, alpha: float, limits: FunctionLimits, top: int) -> list[Generator]:
    """Return distinct slider-cranks within limits, the most practical first."""
    law = next(law for law in LAWS if (law.kind, law.input) == (Kind.SLIDER_CRANK, ANGLE))
    if "offset" in limits.prescribed:
        limits = replace(limits, prescribed={**limits.prescribed, "offset": -abs(limits.prescribed["offset"])})
    family = all_slider_cranks(alpha, _prescribed(limits, law.lengths))
    crank, rod, _ = family.lengths.T
    transmission = slider_crank_transmission(family)
    merits = merit(rod, transmission, np.zeros_like(rod), rod / crank)
    order = np.argsort(merits, kind="stable")
    order = order[transmission[order] >= limits.relative.transmission_angle_min * (1 - OPTIONS.rounding)]
    unknowns = np.column_stack([law.unknowns(family.lengths), family.start, -family.near])
    problem, found = FunctionProblem(target, law, limits, False), list[Generator]()
    for index in order.tolist():
        shape = family.lengths[index]
        apart = [np.abs(other.lengths - shape).max() / max(shape[1], other.lengths[1]) for other in found]
        if min(apart, default=np.inf) > OPTIONS.apart:
            found += filter(None, within_limits(problem, unknowns[[index]], np.ones(1)))
        if len(found) == top:
            break
    return found


def slider_crank_transmission(family: SliderCranks) -> Floats:
    """Return the smallest transmission angles (n,) over a turn, in radians."""
    crank, rod, offset = family.lengths.T
    sine = np.sqrt(np.maximum((rod - crank - np.abs(offset)) * (rod + crank + np.abs(offset)), 0.0)) / rod
    return np.arcsin(np.minimum(sine, 1.0))


def exact_crank_rockers(
    target: TargetFunction, alpha: float, prescribed: Sequence[tuple[int, float]] = ()
) -> CrankRockers:
    """Return the candidates of `all_crank_rockers` that do not turn too fast on the way and stay on their branch."""
    found = all_crank_rockers(alpha, float(np.ptp(target.output)), prescribed)
    output = close_loop(found.lengths, found.start[:, None] + target.crank).rocker_angle(found.branch)
    exact = np.all(np.abs(output - output[:, :1] - target.output) < OPTIONS.exact, axis=1)
    return CrankRockers(*(column[exact] for column in found))


def crank_rocker_transmission(lengths: Floats) -> Floats:
    """Return the smallest transmission angles (n,) over a turn, in radians; NaN if the crank does not turn fully."""
    return transmission_angle_over(lengths, Interval(np.zeros(len(lengths)), np.full(len(lengths), TURN)))


def crank_rocker_answers(target: TargetFunction, alpha: float, limits: FunctionLimits, top: int) -> list[Generator]:
    """Return distinct crank-rockers within limits, the most practical first."""
    family = "crank_rocker" if limits.limits.family == "any" else limits.limits.family
    limits = replace(limits, limits=replace(limits.limits, family=family))
    lengths, branch, start = exact_crank_rockers(target, alpha, _prescribed(limits, LINKS[:3]))
    used = Interval(start, start + TURN)
    inside = keeps(target.target, limits.relative, Placed(lengths, branch, used), OPTIONS.rounding)
    lengths, branch, start = lengths[inside], branch[inside], start[inside]
    merits = function_merit(lengths, crank_rocker_transmission(lengths), limits.limits.links[3] is not None)
    order = np.argsort(merits, kind="stable")
    order = order[distinct_rows((lengths / lengths.max(axis=1, keepdims=True))[order], OPTIONS.apart, top)]
    return generators_of(target, limits, lengths[order], branch[order], start[order])


def _prescribed(limits: FunctionLimits, names: Sequence[str]) -> list[tuple[int, float]]:
    """Return the indices and values over the scale of the prescribed lengths among those of some names."""
    given = limits.prescribed
    return [(index, given[name] / limits.scale) for index, name in enumerate(names) if name in given]


def _between(count: int) -> Floats:
    """Return numbers between 0 and 1 that are denser towards both ends."""
    return (1 - np.cos(np.linspace(0.0, np.pi, count + 2)[1:-1])) / 2


def _roots(lengths: Callable[[Floats], Floats], index: int, target: float, parameters: Floats) -> Floats:
    """Return the parameters at which a length of a family has a given value, to rounding."""
    from scipy.optimize import brentq

    def gap(q: Floats) -> Floats:
        return lengths(q)[:, index] - target

    with np.errstate(all="ignore"):
        value = gap(parameters)
    changes = np.flatnonzero(np.isfinite(value[1:] * value[:-1]) & (np.sign(value[1:]) != np.sign(value[:-1])))
    roots = [
        brentq(lambda q: float(gap(np.array([q]))[0]), parameters[k], parameters[k + 1], xtol=1e-15) for k in changes
    ]
    return np.array(roots)
