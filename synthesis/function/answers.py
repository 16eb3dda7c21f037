"""Finished function generators, their errors recomputed from their own numbers: at the samples, or over the whole interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.four_bar import Family
from synthesis.function.laws import ANGLE, FOUR_BAR, FunctionLimits
from synthesis.function.problem import AnyLaw, FunctionProblem
from synthesis.function.target_function import TargetFunction
from synthesis.limits import in_family
from synthesis.linkage import Linkage
from synthesis.pose import whole_turns
from synthesis.scores import NEAR_CHANGE_POINT
from synthesis.solution import identity_of, looks_of
from synthesis.target import TURN, Interval


@dataclass(frozen=True)
class ExtremeOptions:
    """Options of the examination of error curves over the interval."""

    rounding: float = 1e-12
    """A reversal between two inputs below this fraction of the output's range is rounding."""
    steps: int = 720
    """Smallest number of steps in which the interval is examined; more steps with more samples."""
    peaks: int = 24
    """Number of largest extremes of an error curve that are stored."""
    level: float = 1e-3
    """Relative difference from the largest extreme up to which an extreme counts as an alternation."""


OPTIONS = ExtremeOptions()
LOCKED = float(np.deg2rad(5.0))
"""Transmission angle below which a linkage nearly locks."""


class FunctionErrors(NamedTuple):
    """Errors of an output, in radians or over the scale."""

    rms: float
    """Weighted rms error at the samples."""
    max: float
    """Largest error: over the whole interval if the largest error is minimized, otherwise at the samples."""
    alternations: int | None
    """Number of extremes of alternating sign that are as large as the largest error, over the whole interval; None if the
    interval was not examined."""
    objective: float
    """Minimized quantity: rms, or the largest weighted error."""


@dataclass(frozen=True)
class Generator:
    """Linkage whose output makes a given function; lengths over the scale."""

    law: AnyLaw
    lengths: Floats
    """(k,): lengths of the law."""
    branch: int
    zero: float
    """Input at the first sample."""
    offset: float
    """Added to the linkage's own output, whose angle lies in (-pi, pi] at the first sample, to give the output."""
    errors: FunctionErrors
    linkage: Linkage
    transmission_angle_min: float
    """Exact minimum over the used interval."""
    transmission_angle_min_turn: float | None
    """Minimum over the whole turn of a four-bar; None if the crank does not turn fully."""

    @property
    def identity(self) -> Floats:
        """Return numbers that distinguish linkages."""
        return identity_of(self.linkage)

    @property
    def looks(self) -> Floats:
        """Return numbers that differ by less than 1 for linkages whose pictures look the same."""
        return looks_of(self.linkage)

    @property
    def usable(self) -> bool:
        """True if the rocker of a four-bar stays away from dead positions and from a change point."""
        change_point = self.linkage.family is Family.CHANGE_POINT
        return self.transmission_angle_min >= (NEAR_CHANGE_POINT if change_point else LOCKED)

    def mirrored(self) -> Generator:
        """Return the four-bar in a mirror, for the mirrored function."""
        return replace(
            self, branch=-self.branch, zero=-self.zero, offset=-self.offset, linkage=self.linkage.mirrored()
        )

    def output(self, travel: Floats) -> Floats:
        """Return the output at inputs (M,) from the first sample, continuous."""
        unknowns = np.zeros((1, 5))
        unknowns[0, : self.law.size], unknowns[0, 3] = self.law.unknowns(self.lengths), self.zero
        inputs = np.concatenate([[0.0], travel])
        value = self.law.at(unknowns, np.array([float(self.branch)]), inputs[None], derivatives=False).value[0]
        if self.law.output == ANGLE:
            value = np.unwrap(value) if self.law.wraps else value
            value = value - whole_turns(value[0])
        return value[1:] + self.offset


class Extremes(NamedTuple):
    """The largest sizes of error curves between their zeros, in order along the interval; padded with size 0."""

    crank: Floats
    """(n, q): crank angle from the first sample."""
    size: Floats
    """(n, q), at least 0."""
    sign: Floats


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


def finished(problem: FunctionProblem, unknowns: Floats, branch: Floats) -> list[Generator]:
    """Return linkages at unknowns (n, 5), which close over the interval, with their errors.

    For least squares the offsets are fitted again.
    """
    target = problem.function
    if not problem.largest:
        root = np.broadcast_to(target.mean.root, target.crank.shape)
        unknowns = problem.with_offset(unknowns, branch, target.crank, root)
    residual = problem.gap(unknowns, branch, target.crank)
    law, lengths, sides = problem.law.plain(unknowns, branch)
    shapes = np.zeros((len(branch), 3))
    shapes[:, : law.size] = law.unknowns(lengths)
    plain = np.column_stack([shapes, unknowns[:, 3:]])
    own = law.at(plain, sides, np.zeros((len(branch), 1)), derivatives=False).value[:, 0]
    own = own - whole_turns(own) if law.output == ANGLE else own
    offsets = (target.output[0] - residual[:, 0] - own).tolist()
    columns = lengths, sides.astype(int).tolist(), unknowns[:, 3].tolist()
    linkages = [law.linkage(*row) for row in zip(*columns)]
    angles = np.nan_to_num(law.transmission(linkages, target.interval)).tolist()
    turns: list[float | None] = [None] * len(linkages)
    if law is FOUR_BAR:
        full = in_family("full_crank", np.array([linkage.links for linkage in linkages]).reshape(-1, 4))
        over_turn = law.transmission(linkages, Interval(0.0, TURN)).tolist()
        turns = [angle if turns_fully else None for angle, turns_fully in zip(over_turn, full)]
    errors = _errors_of(problem, unknowns, branch, residual)
    return [Generator(law, *row) for row in zip(*columns, offsets, errors, linkages, angles, turns)]


def within_limits(problem: FunctionProblem, unknowns: Floats, branch: Floats) -> list[Generator | None]:
    """Return linkages at unknowns (n, 5) as generators; None for those that do not close, or violate a limit."""
    target, limits, answers = problem.function, problem.limits.relative, list[Generator | None]([None] * len(branch))
    if problem.law.input == ANGLE:
        unknowns = np.column_stack([unknowns[:, :3], unknowns[:, 3] % TURN, unknowns[:, 4]])
    closes = np.flatnonzero(np.isfinite(problem.gap(unknowns, branch, target.crank)).all(axis=1))
    generators = finished(problem, unknowns[closes], branch[closes])
    if not generators:
        return answers
    law, linkages = generators[0].law, [generator.linkage for generator in generators]
    holds = law.keeps(target, limits, linkages, np.array([generator.lengths for generator in generators]))
    for index, generator, keep in zip(closes.tolist(), generators, holds.tolist()):
        if keep and not (target.one_way and turning_back(target, generator)):
            answers[index] = generator
    return answers


def _errors_of(problem: FunctionProblem, unknowns: Floats, branch: Floats, residual: Floats) -> list[FunctionErrors]:
    """Return the errors of candidates with the errors ``residual`` (n, N) at the samples."""
    target = problem.function
    residual = target.mean.zero_missing(residual)
    rms = np.sqrt(target.mean(residual**2)).tolist()
    if not problem.largest:
        return [
            FunctionErrors(*row) for row in zip(rms, np.abs(residual).max(axis=1).tolist(), [None] * len(rms), rms)
        ]

    def error(crank: Floats) -> Floats:
        return np.where(target.weight(crank) > 0, problem.gap(unknowns, branch, crank), 0.0)

    def weighted(crank: Floats) -> Floats:
        return target.weight(crank) * error(crank)

    found = plain = extremes(weighted, look(target), OPTIONS.peaks)
    if target.weights is not None:
        plain = extremes(error, look(target), OPTIONS.peaks)
    columns = zip(rms, plain.size.max(axis=1).tolist(), alternations(found), found.size.max(axis=1).tolist())
    return [FunctionErrors(*column) for column in columns]


def generators_of(
    target: TargetFunction, limits: FunctionLimits, lengths: Floats, branch: Floats, start: Floats
) -> list[Generator]:
    """Return four-bars of lengths (n, 4) that make a function by least squares, with their errors."""
    return finished(FunctionProblem(target, FOUR_BAR, limits, False), FOUR_BAR.unknowns_of(lengths, start), branch)


def exchanged_back(target: TargetFunction, limits: FunctionLimits, linkages: Sequence[Linkage]) -> list[Generator]:
    """Return four-bars whose couplers make a motion as generators whose rockers make it, with coupler and rocker exchanged.

    Only generators of the family that close over the interval are returned.
    """
    columns = np.array([(*linkage.links, linkage.branch, linkage.start) for linkage in linkages]).reshape(-1, 6)
    lengths, branch, start = columns[:, [0, 2, 1, 3]], -columns[:, 4], columns[:, 5]
    found = generators_of(target, limits, lengths, branch, start)
    links = np.array([generator.linkage.links for generator in found]).reshape(-1, 4)
    accepted = zip(found, in_family(limits.limits.family, links))
    return [generator for generator, keep in accepted if keep and generator.transmission_angle_min > 0]


def turning_back(target: TargetFunction, generator: Generator) -> tuple[float, float] | None:
    """Return by how much an output turns back, and the fraction of the interval at which it does so most.

    None if the output is monotonic except for rounding, or the target turns back too.
    """
    span = target.output[-1] - target.output[0]
    if not np.all(np.diff(target.output) * np.sign(span) > 0):
        return None
    inputs = look(target)
    steps = np.diff(generator.output(inputs)) * np.sign(span)
    if np.all(steps > -OPTIONS.rounding * abs(span)):
        return None
    return float(-steps[steps < 0].sum()), float(abs(inputs[int(np.argmin(steps))] / target.crank[-1]))


def fraction_back(target: TargetFunction, generator: Generator) -> float:
    """Return the fraction of the output's range by which a linkage turns back on the way."""
    back = turning_back(target, generator)
    return 0.0 if back is None else back[0] / float(np.ptp(target.output))
