"""Poses and paths with free crank angles as a problem of the multistart search."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.defects import ONE_POSITION
from synthesis.descents import Pool, Timed
from synthesis.excursions import LEAVES_SAMPLES, SHORTEST_CHORD
from synthesis.four_bar import transmission_angle_over
from synthesis.free.joint import JointProblem
from synthesis.free.limited import limited_problem
from synthesis.free.screen import way_along
from synthesis.limits import Limits
from synthesis.mechanism import Chart
from synthesis.poses import Poses
from synthesis.search.crank_driven import CrankDriven, Refinements
from synthesis.search.options import SELECTED_EARLY, Schedule, SearchOptions
from synthesis.target import TURN
from synthesis.work import Work


@dataclass(frozen=True)
class FreeTimingOptions(SearchOptions):
    """Options of the search with free crank angles."""

    schedule: Schedule = SELECTED_EARLY
    flipped: float = 0.3
    max_samples: int = 64
    """Number of samples up to which the search uses all."""
    thinned_samples: int = 32
    """Number of samples that the search uses of a longer motion."""
    span_max: float = 0.97
    """Largest perturbed span of the crank angles, relative to the limit on the span."""
    span_width: float = 0.25
    """Width of the perturbations of the span's logarithm."""
    nearest_steps: int = 6
    """Number of steps of the crank angles alone, on all samples."""
    transmission_min: float = 1e-4
    """Transmission angle in radians below which rounding decides whether a linkage closes between the samples."""
    panel: float = radians(12.0)
    """Largest crank angle of a chord by which the path between samples is measured."""


class FreeTiming(CrankDriven):
    """Poses or a path with free crank angles.

    A long basin is recognised by its timing: shapes and even costs change along it, the differences of its crank angles
    hardly do.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    chart : Chart
    tolerance : float
    work : Work
    samples : int
        Number of samples of the search.
    within_limits : bool
        Whether the search satisfies the limits; otherwise only answers do.
    options : FreeTimingOptions
    """

    options: FreeTimingOptions

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        chart: Chart,
        tolerance: float,
        work: Work,
        samples: int,
        within_limits: bool,
        options: FreeTimingOptions,
    ) -> None:
        self.poses, self._indices = poses, poses.spread(samples)
        self.thin = poses if self._indices.size == poses.samples else poses.at(self._indices)
        self._shift = poses.off(self.thin)
        self.plain = JointProblem(poses, chart)
        self.within = self.plain if limits.only_family else limited_problem(poses, chart, limits)
        self.search = self.within if within_limits else self.plain
        if self.thin is not poses:
            bounded = self.search.limited
            self.search = limited_problem(self.thin, chart, limits) if bounded else JointProblem(self.thin, chart)
        problems = Refinements(self.plain, self.within, self.search)
        super().__init__(problems, self.thin is poses, tolerance, work, options)

    def signature(self, pool: Pool) -> tuple[Floats, Floats]:
        """Return the timing, and its span."""
        timing = pool.timed.angles - pool.timed.angles[:, :1]
        return timing, np.abs(timing).max(axis=1, initial=0.0)

    def strays(self, pool: Pool) -> Flags:
        """Return whether candidates leave the path between samples, measured by chords."""
        timed = pool.timed
        if not (self.poses.ordered and timed.branch.size):
            return super().strays(pool)
        at_all = timed.angles.shape[1] == self.poses.samples
        poses, problem = (self.poses, self.plain) if at_all else (self.thin, self.search)
        excursion, rotation = problem.excursions(timed, SHORTEST_CHORD, self.options.panel)
        return np.asarray((excursion > LEAVES_SAMPLES) | poses.turned_otherwise(rotation))

    def usable(self, pool: Pool) -> Flags:
        """Return whether answers pass the samples at different crank angles, and close between the samples, (n,)."""
        timed, start = pool.timed, pool.timed.angles[:, :1]
        drive = np.sort(timed.angles % TURN, axis=1)
        gaps = np.diff(drive, axis=1, append=drive[:, :1] + TURN)
        apart = gaps.min(axis=1) > ONE_POSITION * np.ptp(timed.angles, axis=1)
        interval = self.poses.used(self.poses.whole(timed.angles - start)).interval.after(start[:, 0])
        transmission = transmission_angle_over(self.chart.shape(timed.shape).lengths, interval)
        return np.asarray(apart & (transmission > self.options.transmission_min))

    def perturbed_angles(self, timed: Timed) -> Floats:
        """Return crank angles with another start and another span."""
        random, options, count = self.random, self.options, len(timed.branch)
        along = timed.angles - timed.angles[:, :1]
        factor = np.exp(options.span_width * random.standard_t(3, size=(count, 1)))
        largest = options.span_max * self.poses.span_max / np.maximum(np.abs(along[:, -1:]), 1e-9)
        start = timed.angles[:, :1] + self.chart.hop[-1] * random.standard_t(3, size=(count, 1))
        return np.asarray(start + along * np.minimum(factor, largest))

    def complete(self, pool: Pool) -> Pool:
        """Refine candidates of the search on all samples."""
        timed = self.plain.nearest(self.at_all_samples(pool.timed), self.options.nearest_steps)
        problem = self.within if self.search.limited else self.plain
        completed = problem.descended(timed, [self.options.completion], 0.1 * self.tolerance, self.work)
        steps = np.diff(completed.timed.angles, axis=1)
        strict = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1) | (not self.poses.ordered)
        return completed.take(strict) if strict.any() else completed

    def at_all_samples(self, timed: Timed, power: float = 1.0) -> Timed:
        """Return candidates of the search with guessed crank angles at all samples (see `way_along`)."""
        if self.on_all_samples:
            return timed
        direction = way_along(self.poses, power)
        angles = np.stack([np.interp(direction, direction[self._indices], own) for own in timed.angles])
        return timed._replace(angles=angles, pose=self._shifted(timed, self._shift))

    def at_search_samples(self, timed: Timed) -> Timed:
        """Return candidates at all samples as candidates of the search."""
        if self.on_all_samples:
            return timed
        return timed._replace(angles=timed.angles[:, self._indices], pose=self._shifted(timed, -self._shift))

    @staticmethod
    def _shifted(timed: Timed, shift: complex) -> np.ndarray:
        """Return poses relative to the mean of other samples."""
        return timed.pose + np.array([shift, 0, 0])
