"""Finished function generators, their errors recomputed from their own numbers: at the samples, or over the whole interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.export.layout import closed_motions
from synthesis.four_bar import FULL_CRANK, Family, close_loop, family, principal, transmission_angle_over
from synthesis.fourbar.mechanism import FourBar
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits, in_family
from synthesis.linkage import Linkage, with_links
from synthesis.pose import rotation_residual, whole_turns
from synthesis.sheet import csv_text
from synthesis.solution import looks_of
from synthesis.target import Interval, Samples, Target


@dataclass(frozen=True)
class ExtremeOptions:
    """Options of the examination of error curves over the interval."""

    rounding: float = 1e-13
    """A reversal between two inputs below this angle in radians is rounding."""
    steps: int = 720
    """Smallest number of steps in which the interval is examined; more steps with more samples."""
    peaks: int = 24
    """Number of largest extremes of an error curve that are stored."""
    level: float = 1e-3
    """Relative difference from the largest extreme up to which an extreme counts as an alternation."""


OPTIONS = ExtremeOptions()


@dataclass(frozen=True)
class FunctionErrors:
    """Errors of the angle of a rocker, in radians.

    Attributes
    ----------
    rms : float
        Weighted rms error at the samples.
    max : float
        Largest error: over the whole interval if the largest error is minimized, otherwise at the samples.
    alternations : int or None
        Number of extremes of alternating sign that are as large as the largest error, over the whole interval; None if the
        interval was not examined.
    objective : float
        Minimized quantity: rms, or the largest weighted error.
    """

    rms: float
    max: float
    alternations: int | None
    objective: float


@dataclass(frozen=True)
class Generator:
    """Linkage whose rocker makes a given function; the ground is 1 unless a length is given.

    Attributes
    ----------
    linkage : Linkage
    offset : float
        output = theta3 + offset with theta3 in (-pi, pi] at the first sample.
    errors : FunctionErrors
    family : Family
    transmission_angle_min : float
        Exact minimum over the used interval.
    transmission_angle_min_turn : float or None
        Minimum over the whole turn; None if the crank does not turn fully.
    """

    linkage: Linkage
    offset: float
    errors: FunctionErrors
    family: Family
    transmission_angle_min: float
    transmission_angle_min_turn: float | None

    @property
    def identity(self) -> Floats:
        """Return numbers that distinguish linkages."""
        return np.array([*(np.array(self.linkage.links) / max(self.linkage.links)), self.linkage.branch])

    @property
    def looks(self) -> Floats:
        """Return numbers of which two linkages that look alike in a drawing differ by less than 1."""
        return looks_of(self.linkage)

    def mirrored(self) -> Generator:
        """The linkage in a mirror, for the mirrored function."""
        return replace(self, linkage=self.linkage.mirrored(), offset=-self.offset)


def exchanged(linkage: Linkage) -> Linkage:
    """Exchange coupler and rocker: the new rocker turns as the coupler of this linkage turned, plus half a turn.

    theta3(L1, L2, L3, L4; branch) = theta2(L1, L3, L2, L4; -branch) + pi, up to whole turns.
    """
    crank, coupler, rocker, ground = linkage.links
    exchanged = with_links(linkage, (crank, rocker, coupler, ground))
    return replace(exchanged, branch=-linkage.branch, body_offset=None)


class Extremes(NamedTuple):
    """The largest sizes of error curves between their zeros, in order along the interval; padded with size 0."""

    crank: Floats
    """(n, q): crank angle from the first sample."""
    size: Floats
    """(n, q), at least 0."""
    sign: Floats


def rocker_angles(linkages: Sequence[Linkage], travel: Floats) -> Floats:
    """theta3 at crank angles (n, M) or (M,) from the first sample, in (-pi, pi] at the first sample, (n, M)."""
    links, branch = (
        np.array([linkage.links for linkage in linkages]),
        np.array([linkage.branch for linkage in linkages]),
    )
    start = np.array([linkage.start for linkage in linkages])[:, None]
    travel = np.broadcast_to(travel, (len(linkages), np.shape(travel)[-1]))
    crank = np.concatenate([start, start + travel], axis=1)
    return principal(close_loop(links, crank).rocker_angle(branch))[:, 1:]


def look(target: TargetFunction) -> Floats:
    """Crank angles at which an error curve is looked at before its extremes are refined.

    They are denser towards the ends, down to a thousand millionth of the interval: there x^p may begin with an infinite slope,
    and a rocker at a dead position too.
    """
    steps = max(OPTIONS.steps, 2 * target.crank.size)
    cosine = (1 - np.cos(np.linspace(0.0, np.pi, steps + 1))) / 2
    close_to_ends = np.logspace(-9, -3, 49)
    share = np.unique(
        np.concatenate([cosine, np.linspace(0.0, 1.0, steps // 2 + 1), close_to_ends, 1 - close_to_ends])
    )
    return share * target.crank[-1]


def extremes(error: Callable[[Floats], Floats], crank: Floats, max_extremes: int) -> Extremes:
    """Find the extremes of error curves: the largest error of each interval of constant sign, refined.

    Parameters
    ----------
    error : callable
        ``error(crank) -> values``, both (n, q), at the crank angles of each candidate.
    crank : ndarray, shape (M,)
        Initial grid.
    max_extremes : int
        Largest number of extremes of a curve.
    """
    values = error(crank[None, :])
    size = np.abs(values)
    inner = np.pad(size, ((0, 0), (1, 1)), constant_values=-1.0)
    peak = (size >= inner[:, :-2]) & (size > inner[:, 2:])
    height = np.where(peak, size, -1.0)
    indices = np.sort(np.argsort(-height, axis=1, kind="stable")[:, :max_extremes], axis=1)
    height = np.take_along_axis(height, indices, axis=1)
    left, right = crank[np.maximum(indices - 1, 0)], crank[np.minimum(indices + 1, crank.size - 1)]
    at, value = crank[indices], np.take_along_axis(values, indices, axis=1)
    for shrink in (1.0, 0.1, 0.02):
        # a parabola through three places, closer and closer together
        here, beside = np.abs(value), (at + shrink * (left - at), at + shrink * (right - at))
        (a, c), (before, after) = beside, np.split(np.abs(error(np.concatenate(beside, axis=1))), 2, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # a candidate that does not close is infinitely far off
            bend = (after - here) * (a - at) - (before - here) * (c - at)
            vertex = at + 0.5 * ((after - here) * (a - at) ** 2 - (before - here) * (c - at) ** 2) / bend
        inside = (vertex > np.minimum(a, c)) & (vertex < np.maximum(a, c))
        moved = np.where(inside, vertex, at)
        there = error(moved)
        better = np.abs(there) > here
        at, value = np.where(better, moved, at), np.where(better, there, value)
    size = np.where(height >= 0, np.abs(value), 0.0)
    return Extremes(at, size, np.sign(value))


def alternations(found: Extremes) -> list[int]:
    """Count, for each curve, the extremes of alternating sign that are as large as the largest."""
    counts = []
    for size, sign in zip(found.size, found.sign):
        level = sign[(size > 0) & (size >= (1 - OPTIONS.level) * size.max())]
        counts.append(int(level.size > 0) + int(np.count_nonzero(np.diff(level))))
    return counts


def errors_of(
    target: TargetFunction, gap: Callable[[Floats], Floats], count: int, largest: bool, residual: Floats
) -> list[FunctionErrors]:
    """Errors of ``count`` candidates from their gaps: at inputs (n, M) by ``gap``, at the samples ``residual`` (n, N).

    ``largest``: whether the largest error over the interval counts, or the root of the mean square at the samples.
    """
    rms = np.sqrt(target.mean(residual**2))
    if not largest:
        worst = np.abs(target.mean.zero_missing(residual)).max(axis=1)
        return [
            FunctionErrors(float(rms_error), float(largest_error), None, float(rms_error))
            for rms_error, largest_error in zip(rms, worst)
        ]

    def error(crank: Floats) -> Floats:
        crank = np.broadcast_to(crank, (count, crank.shape[-1]))
        return np.where(target.weight(crank) > 0, gap(crank), 0.0)

    def weighted(crank: Floats) -> Floats:
        return target.weight(np.broadcast_to(crank, (count, crank.shape[-1]))) * error(crank)

    found = plain = extremes(weighted, look(target), OPTIONS.peaks)
    if target.weights is not None:
        plain = extremes(error, look(target), OPTIONS.peaks)
    columns = zip(rms.tolist(), plain.size.max(axis=1).tolist(), alternations(found), found.size.max(axis=1).tolist())
    return [FunctionErrors(*column) for column in columns]


def how_they_turn(links: Floats, used: Interval) -> list[tuple[Family, float, float | None]]:
    """Return the family of linkages (n, 4), and their smallest transmission angles over the used interval and over a turn.

    The first is 0 if a linkage does not close over its interval of theta1, the second None if its crank does not turn fully.
    """
    first, last = (
        np.stack([np.broadcast_to(end, len(links)), np.full(len(links), turn_end)])
        for end, turn_end in zip(used, (0.0, np.pi))
    )
    used_angles, turn = transmission_angle_over(links, Interval(first, last))
    families = [Family(name) for name in family(links)]
    return [
        (name, smallest, over_turn if name in FULL_CRANK else None)
        for name, smallest, over_turn in zip(families, np.nan_to_num(used_angles).tolist(), turn.tolist())
    ]


def finished(
    target: TargetFunction, linkages: Sequence[Linkage], largest: bool, offsets: Floats | None = None
) -> list[Generator]:
    """Build generators with their errors.

    Parameters
    ----------
    target : TargetFunction
    linkages : sequence of Linkage
        Linkages that close over the interval.
    largest : bool
        True if the largest error over the interval counts, False for the rms error at the samples.
    offsets : ndarray, shape (n,), optional
        Offsets up to whole turns; default: the given offset, or the offset of the smallest rms error.
    """
    if not linkages:
        return []
    angle = rocker_angles(linkages, target.crank)
    offset = rotation_residual(replace(target.target, offset=target.offset), angle)[0]
    if offsets is not None:
        offset = offsets + whole_turns(offset - offsets)

    def gap(crank: Floats) -> Floats:
        return np.asarray(target.curve(crank) - offset[:, None] - rocker_angles(linkages, crank))

    errors = errors_of(target, gap, len(linkages), largest, target.output - angle - offset[:, None])
    links, start = (
        np.array([linkage.links for linkage in linkages]),
        np.array([linkage.start for linkage in linkages]),
    )
    turning = how_they_turn(links, target.interval.after(start))
    return [Generator(linkage, float(offset[k]), errors[k], *turning[k]) for k, linkage in enumerate(linkages)]


class Generators(FourBar):
    """The four-bar as the search for motions sees it, whose answers are function generators of a ground's length.

    The search is for linkages with coupler and rocker exchanged.
    """

    def __init__(self, target: TargetFunction, ground: float) -> None:
        self.function, self.ground = target, ground

    def assess(
        self, target: Target, linkages: Sequence[Linkage], /, *, rows: Sequence[int] | None = None
    ) -> list[Any]:
        """Return the linkages exchanged back, as generators with the errors of their rockers."""
        return finished(self.function, [exchanged(linkage).scaled(self.ground) for linkage in linkages], False)

    def within(self, samples: Samples, limits: Limits, solutions: Sequence[Any]) -> list[Any]:
        """Return the solutions of the family that close over the interval."""
        if not solutions:
            return []
        accepted = in_family(limits.family, np.array([solution.linkage.links for solution in solutions]))
        return [
            solution for solution, keep in zip(solutions, accepted) if keep and solution.transmission_angle_min > 0
        ]


def turning_back(
    target: TargetFunction, output: Callable[[Floats], Floats], tolerance: float
) -> tuple[float, float] | None:
    """Return the total angle by which an output turns back and the fraction at which it does so most; None if it is monotonic.

    ``tolerance``: largest step back between two angles that counts as rounding. The result is None if the target turns back.
    """
    sense = np.sign(target.output[-1] - target.output[0])
    if not np.all(np.diff(target.output) * sense > 0):
        return None
    angles = look(target)
    steps = np.diff(output(angles)) * sense
    if np.all(steps > -tolerance):
        return None
    return float(-steps[steps < 0].sum()), float(abs(angles[int(np.argmin(steps))] / target.crank[-1]))


def fraction_back(target: TargetFunction, linkage: Linkage) -> float:
    """Return the fraction of the output's range by which a rocker turns back on the way."""
    back = turning_back(target, partial(_rocker_angle, linkage), OPTIONS.rounding)
    return 0.0 if back is None else back[0] / float(np.ptp(target.output))


def turns_back(target: TargetFunction, linkages: Sequence[Linkage]) -> list[str | None]:
    """Return a sentence for each linkage whose rocker turns back although the target is monotonic; None for the others."""
    words = "the rocker turns back by {:.3g} degrees at {:.3g} % of the interval"
    backs = [turning_back(target, partial(_rocker_angle, linkage), OPTIONS.rounding) for linkage in linkages]
    return [back and words.format(np.rad2deg(back[0]), 100 * back[1]) for back in backs]


def _rocker_angle(linkage: Linkage, travel: Floats) -> Floats:
    return rocker_angles([linkage], travel)[0]


def to_csv(target: TargetFunction, linkage: Linkage, offset: float, unit: float) -> str:
    """Return the function at the samples as CSV; the error is the actual output minus the target output.

    Angles are divided by ``unit`` (radians in one unit of angle).
    """
    closed_motions(linkage, target.interval)
    crank, body, rocker = linkage.motions(target.crank)
    output = rocker_angles([linkage], target.crank)[0] + offset
    columns = {
        "input": target.crank,
        "output_wanted": target.output,
        "output": output,
        "error": output - target.output,
        "transmission_angle": linkage.body(linkage.start + target.crank).transmission_angle,
        "crank_direction": crank.angle,
        "coupler_direction": body.angle - (linkage.body_offset or 0.0),
        "rocker_direction": rocker.angle,
    }
    return csv_text({name: (np.asarray(values) / unit).tolist() for name, values in columns.items()})
