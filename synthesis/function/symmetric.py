"""Symmetric four-bars for functions: steering linkages, whose left and right arm are mirror images.

Input and output are measured from the position in which the linkage is its own mirror image, an isosceles trapezoid.
With the arm a over the ground and the angle t of the left arm there, the coupler is 1 - 2 a cos(t), and the right arm
has the angle 180 - t. Only these two numbers are free, so that both are searched on a grid whose best cells are
refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Floats
from synthesis.constraints import keeps
from synthesis.four_bar import close_loop
from synthesis.function.answers import Generator, finished
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits
from synthesis.linkage import as_lengths, four_bar
from synthesis.mechanism import Placed
from synthesis.pose import whole_turns
from synthesis.ranking import APART, distinct
from synthesis.work import Work


@dataclass(frozen=True)
class SymmetricOptions:
    """Options of the search for symmetric four-bars."""

    arm_min: float = 0.1
    """Shortest arm over the ground if no limit is smaller; in shorter arms the play of the pins turns a wheel considerably.
    """
    arm_max: float = 0.2
    """Longest arm over the ground if no limit is larger; longer arms need much room and reduce the error only slightly.
    """
    arms: int = 12
    """Arms on the grid."""
    angles: int = 360
    """Angles on the grid."""
    error_samples: int = 65
    """Number of inputs at which the largest error is evaluated."""
    cells: int = 12
    """Number of cells of the grid that are refined."""
    refined: int = 5
    """Points of a refinement along each free number."""
    rounds: int = 24
    """Refinements, each of half the size."""


class SymmetricProblem:
    """A function, limits, and the errors of symmetric four-bars.

    Parameters
    ----------
    target : TargetFunction
    first : tuple of float
        Input and output at the first sample, from the symmetric position, in radians.
    limits : Limits
        Limits, with lengths over the ground.
    largest : bool
        The objective is the largest error over the interval; otherwise the root mean square error at the samples.
    options : SymmetricOptions
    """

    def __init__(
        self,
        target: TargetFunction,
        first: tuple[float, float],
        limits: Limits,
        largest: bool,
        options: SymmetricOptions,
    ) -> None:
        self.function, self.first, self.limits, self.largest, self.options = target, first, limits, largest, options
        crank, _, rocker, _ = limits.links
        length = crank if crank is not None else rocker
        ratio = limits.link_ratio_max  # a limit that the usual range of arms satisfies does not widen the range
        tight = ratio is not None and ratio * options.arm_max < 1 + 2 * options.arm_max
        bounded = limits.link_min is not None or limits.link_max is not None or tight
        self.arms = (
            (length, length)
            if length is not None
            else (limits.link_min or options.arm_min, limits.link_max or (1.0 if bounded else options.arm_max))
        )
        if largest:
            self.crank = (1 - np.cos(np.linspace(0.0, np.pi, options.error_samples))) / 2 * target.crank[-1]
            self.weight = target.weight(self.crank)
        else:
            self.crank = target.crank
            self.weight = np.broadcast_to(target.mean.root, target.crank.shape)
        self.output = target.curve(self.crank)

    def lengths(self, arm: Floats, angle: Floats) -> Floats:
        """Return the lengths (n, 4) over the ground; not positive if there is no coupler."""
        return np.stack([arm, 1 - 2 * arm * np.cos(angle), arm, np.ones_like(arm)], axis=1)

    def branch(self, arm: Floats, angle: Floats) -> Floats:
        """Return the branches (n,)."""
        pin = arm * np.exp(1j * angle)
        return np.where(np.imag(np.conj(1 - pin) * (1 - 2 * arm * np.cos(angle))) > 0, 1.0, -1.0)

    def cost(self, arm: Floats, angle: Floats) -> Floats:
        """Return the objective (n,); infinite if a four-bar does not close or violates a limit."""
        lengths, branch = self.lengths(arm, angle), self.branch(arm, angle)
        start = angle + self.first[0]
        good = np.flatnonzero(lengths.min(axis=1) > 0)
        cost = np.full(arm.size, np.inf)
        if not good.size:
            return cost
        used = self.function.interval.after(start[good])
        inside = keeps(self.function.target, self.limits, Placed(lengths[good], branch[good], used))
        good = good[inside]
        output = close_loop(lengths[good], start[good, None] + self.crank).rocker_angle(branch[good])
        # output from the symmetric position, in which the right arm has the angle pi - t
        gap = self.output - self.function.output[0] + self.first[1] - (output - (np.pi - angle[good])[:, None])
        gap -= whole_turns(gap[:, :1])
        size = np.abs(gap) * self.weight
        cost[good] = size.max(axis=1) if self.largest else np.sqrt(np.sum(size * size, axis=1))
        return np.where(np.isnan(cost), np.inf, cost)

    def search(self, work: Work) -> tuple[Floats, Floats]:
        """Return arms and angles (n,) of distinct local minima, best first."""
        options, (shortest, longest) = self.options, self.arms
        arms = np.geomspace(shortest, longest, options.arms if longest > shortest else 1)
        angles = np.linspace(-np.pi, np.pi, options.angles, endpoint=False)
        cost = self.cost(np.repeat(arms, angles.size), np.tile(angles, arms.size)).reshape(arms.size, -1)
        lowest = (cost <= np.roll(cost, 1, axis=1)) & (cost <= np.roll(cost, -1, axis=1)) & np.isfinite(cost)
        rows, columns = np.nonzero(lowest)
        order = np.argsort(cost[rows, columns], kind="stable")[: options.cells]
        best = np.stack([np.log(arms[rows[order]]), angles[columns[order]]], axis=1)
        step = np.array([np.log(longest / shortest) / max(arms.size - 1, 1), 2 * np.pi / angles.size])
        offsets = np.linspace(-1.0, 1.0, options.refined)
        shifts = np.stack([axis.ravel() for axis in np.meshgrid(offsets, offsets, indexing="ij")], axis=1)
        for _ in range(options.rounds):
            if work.expired() or not len(best):
                break
            trials = best[:, None] + shifts * step
            trials[:, :, 0] = np.clip(trials[:, :, 0], np.log(shortest), np.log(longest))
            costs = self.cost(np.exp(trials[:, :, 0].ravel()), trials[:, :, 1].ravel()).reshape(trials.shape[:2])
            best = trials[np.arange(len(best)), np.argmin(costs, axis=1)]
            step = step / 2
        return np.exp(best[:, 0]), best[:, 1]


def symmetric_four_bars(
    target: TargetFunction,
    first: tuple[float, float],
    limits: Limits,
    largest: bool,
    top: int,
    work: Work,
    options: SymmetricOptions | None = None,
) -> list[Generator]:
    """Search for distinct symmetric four-bars that make a function, the smallest error first.

    ``first``: input and output at the first sample, from the symmetric position, in radians. ``limits``: lengths in the
    unit of the ground, which is 1 if it is not prescribed.
    """
    ground = limits.links[3] or 1.0
    problem = SymmetricProblem(target, first, limits.over(ground), largest, options or SymmetricOptions())
    arms, angles = problem.search(work)
    lengths, branches = problem.lengths(arms, angles) * ground, problem.branch(arms, angles)
    length = limits.links[0] if limits.links[0] is not None else limits.links[2]
    if length is not None:  # restore the prescribed value to the last bit
        lengths[:, [0, 2]] = length
    linkages = [
        four_bar(as_lengths(row), int(branch), float(angle + first[0]))
        for row, branch, angle in zip(lengths, branches, angles)
    ]
    offsets = target.output[0] - first[1] - (np.pi - angles)
    found = [
        generator
        for generator in finished(target, linkages, largest, offsets)
        if generator.transmission_angle_min > 0
    ]
    return distinct(found, top, APART)
