"""Four-bars that pass two to four poses exactly: sample the exact family densely, then improve the best within it.

Data flow::

    poses -> centres where the limits allow pivots, each with the body point that circles it
      -> random pairs of such dyads as four-bars -> those without defects and within the limits
      -> the best of different regions -> moved within the exact family towards lower merit

A dyad is a fixed centre c and a body point m that keeps its distance from c at all poses. Seen from the body, the centre takes
the positions c_i = conj(R_i) (c - P_i), and m is equally far from all of them (kinematic inversion; Bottema and Roth,
Theoretical Kinematics, 1979, chapter VIII). Two poses leave m one free number along the perpendicular bisector of c_1 c_2;
for three, m is the circumcentre; for four, c must lie on Burmester's centre-point curve, a cubic. Every pair of such dyads
passes the poses exactly, so the improvement never has to trade exactness for anything else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Flags, Floats, rows_at, rows_of_all
from synthesis.constraints import Constraints
from synthesis.descents import Timed
from synthesis.exact_family import ImprovementOptions, improved
from synthesis.excursions import LEAVES_SAMPLES, SHORTEST_CHORD
from synthesis.four_bar import coupler_angle, transmission_angle_over
from synthesis.fourbar.mechanism import AnyChart
from synthesis.free.dyads import FEW, Body, Dyads, Pairs, centre_points, circumcentre, in_any_order, in_order, paired
from synthesis.free.joint import JointProblem
from synthesis.limits import Limits, in_family
from synthesis.mechanism import Box, Placed
from synthesis.poses import Poses
from synthesis.ranking import distinct_rows, merit
from synthesis.target import Interval
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class FewPosesOptions(ImprovementOptions):
    """Options of the search for four-bars through two to four poses; steps are fractions of the motion's extent, or radians."""

    pairs: int = 20_000
    """Random pairs of dyads in a batch, for two and three poses."""
    pairs_on_curves: int = 6_000
    """The same for four poses, whose centres lie on a curve."""
    batches: int = 3
    """Maximum number of batches."""
    batches_around_obstacles: int = 8
    """The same if obstacles are given."""
    obstacle_steps: int = 24
    """Number of crank angles over the motion at which links are compared with obstacles."""
    enough: int = 200
    """Number of usable four-bars after which no further batch is drawn."""
    nearest: float = 0.05
    """Smallest distance of a sampled pivot from the motion's middle where no box is given, over the motion's extent."""
    farthest: float = 5.0
    """Largest such distance."""
    detour: float = 0.98
    """Fraction of the largest detour that candidates may take, since chords measure it a little short."""
    chord: float = np.deg2rad(12.0)
    """Largest crank angle between the ends of a chord of the path, in radians."""
    tilt: float = 1.4
    """Largest angle at c_1 between the chord c_1 c_2 and m, in radians, for two poses."""
    equal_rotation: float = 1e-9
    """Largest difference of two rotations that count as equal, in radians."""


NONE_CLEAR = "No linkage was found that passes the poses and whose links stay out of the boxes (`assembly.keep_out`)."


class Obstacles(NamedTuple):
    """Boxes that no link may enter over the motion."""

    boxes: Sequence[Box]
    """In the user's unit of length."""
    width: Callable[[Floats], Floats]
    """Width of the links, shape (n,), by the lengths of n linkages, shape (n, 4); all in the user's unit."""


class Parameters(NamedTuple):
    """Free numbers of exact four-bars, shape (n,) each; lengths over the length scale, from the mean position."""

    crank_pivot: Complexes
    crank_tilt: Floats
    """Angle at c_1 between the chord c_1 c_2 and the body point, in radians; used for two poses only."""
    rocker_pivot: Complexes
    rocker_tilt: Floats


class Candidates(NamedTuple):
    """Exact four-bars without defects and within the limits."""

    parameters: Parameters
    lengths: Floats
    """(n, 4): crank, coupler, rocker, ground over the length scale."""
    timed: Timed
    merit: Floats
    """(n,): see `synthesis.ranking.merit`."""
    origin: NDArray[np.intp]
    """(n,): index of each in the parameters that were evaluated."""

    def take(self, indices: Any) -> Candidates:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Candidates) -> Candidates:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)


class ExactFamily:
    """The four-bars that pass two to four poses exactly within limits.

    Parameters
    ----------
    poses : Poses
        Two to four samples, each with rotation and position.
    limits : Limits
    options : FewPosesOptions
    obstacles : Obstacles, optional
    """

    def __init__(
        self, poses: Poses, limits: Limits, options: FewPosesOptions, obstacles: Obstacles | None = None
    ) -> None:
        self.poses, self.limits, self.options, self.obstacles = poses, limits, options, obstacles
        self.body = Body(poses)
        self.number = self.body.position.size
        self.extent = poses.extent / poses.length_scale
        self.random = np.random.default_rng(20)
        self._constraints = Constraints(limits, poses.middle, poses.length_scale, exact=False)
        self._problem = JointProblem(poses, AnyChart())
        self._boxes = [self._box(name) for name in ("pivot_a", "pivot_b")]
        self.level = self.number == 2 and abs(self.body.turned[1] - self.body.turned[0]) < options.equal_rotation
        """Only parallelograms are drawn, which hold a body level between two poses of equal rotation."""
        self.count = options.pairs_on_curves if self.number == 4 else options.pairs
        if self.number > 2 and limits.pivot_a is not None and limits.pivot_b is not None:
            self.count = 1  # both pivots are given, and nothing else is free

    def _box(self, pivot: str) -> Box | None:
        """Return the region that the limits leave a pivot, over the length scale; None if they leave it anywhere."""
        box, point = self.limits.box(f"{pivot}_box"), getattr(self.limits, pivot)
        if point is not None:
            box = (point.real, point.imag, point.real, point.imag)
        if box is None:
            return None
        low, high = (
            (complex(*corner) - self.poses.middle) / self.poses.length_scale for corner in (box[:2], box[2:])
        )
        return low.real, low.imag, high.real, high.imag

    # -- sampling and moving ----------------------------------------------------------------------------------------

    def sample(self) -> Parameters:
        """Draw a batch of parameters."""
        count, tilt = self.count, self.options.tilt
        tilts = self.random.uniform(-tilt, tilt, (2, count))
        crank, rocker = (self._sampled_centres(box) for box in self._boxes)
        return Parameters(crank, tilts[0], rocker, tilts[1])

    def _sampled_centres(self, box: Box | None) -> Complexes:
        """Draw centres: evenly in a box, and about the motion with evenly distributed logarithms of the distance."""
        options, random, count = self.options, self.random, self.count
        logarithms = np.log(self.extent) + random.uniform(np.log(options.nearest), np.log(options.farthest), count)
        about = np.exp(logarithms + 2j * np.pi * random.uniform(0, 1, count))
        if box is None:
            return self._on_curve(about)
        within = random.uniform(box[0], box[2], count) + 1j * random.uniform(box[1], box[3], count)
        inside = (about.real > box[0]) & (about.real < box[2]) & (about.imag > box[1]) & (about.imag < box[3])
        return self._on_curve(np.where(inside & (np.arange(count) % 2 == 0), about, within))

    def _on_curve(self, centres: Complexes) -> Complexes:
        """Return for four poses points of the centre-point curve, each on a random line through a centre; else the centres."""
        if self.number < 4:
            return centres
        directions = np.exp(1j * np.pi * self.random.uniform(0, 1, centres.size))
        return centre_points(self.body, centres, directions)

    def moved(self, parameters: Parameters, step: float) -> Parameters:
        """Return random neighbours of parameters: heavy-tailed, and clipped to the pivots' boxes."""
        crank, rocker = (
            self._moved_centres(centres, box, step * self.extent)
            for centres, box in zip((parameters.crank_pivot, parameters.rocker_pivot), self._boxes)
        )
        limit = self.options.tilt
        tilts = [
            np.clip(tilt + step * self.random.standard_normal(tilt.size), -limit, limit)
            for tilt in (parameters.crank_tilt, parameters.rocker_tilt)
        ]
        return Parameters(crank, tilts[0], rocker, tilts[1])

    def _moved_centres(self, centres: Complexes, box: Box | None, step: float) -> Complexes:
        size = step * 10.0 ** self.random.uniform(-1.5, 0.0, centres.size)
        real, imaginary = centres.view(float).reshape(-1, 2).T + size * self.random.standard_normal((2, centres.size))
        if box is not None:
            real, imaginary = np.clip(real, box[0], box[2]), np.clip(imaginary, box[1], box[3])
        return self._on_curve(real + 1j * imaginary)

    # -- evaluation -------------------------------------------------------------------------------------------------

    def dyads(self, centres: Complexes, tilts: Floats) -> Dyads:
        """Return the dyads of centres; their numbers are not finite if there is none."""
        seen = np.conj(self.body.turned) * (centres[:, None] - self.body.position)
        with np.errstate(all="ignore"):
            if self.number == 2:
                points = (seen[:, 0] + seen[:, 1]) / 2 + 0.5j * (seen[:, 1] - seen[:, 0]) * np.tan(tilts)
            else:
                points = circumcentre(*seen.T[:3])
            return self.body.with_radius(points, centres)

    def evaluate(self, parameters: Parameters) -> Candidates:
        """Return the four-bars of parameters that have no defect and keep the limits."""
        with np.errstate(all="ignore"):
            crank = self.dyads(parameters.crank_pivot, parameters.crank_tilt)
            tilt = parameters.crank_tilt if self.level else parameters.rocker_tilt
            rocker = self.dyads(parameters.rocker_pivot, tilt)
            pairs, origin = paired(self.body, crank, rocker)
        usable = np.flatnonzero(pairs.one_branch & in_family(self.limits.family, pairs.lengths))
        pairs, origin = pairs.take(usable), origin[usable]
        angles, holds = self._crank_angles(pairs)
        used = Interval(angles.min(axis=1), angles.max(axis=1))
        transmission = np.where(holds, np.nan_to_num(transmission_angle_over(pairs.lengths, used)), 0.0)
        selected = np.flatnonzero((transmission > 0) & (transmission >= self.limits.transmission_angle_min))
        pairs, origin, angles, transmission = (
            pairs.take(selected),
            origin[selected],
            angles[selected],
            transmission[selected],
        )
        inside = self._within_limits(pairs, angles)
        inside = inside[self._clear(pairs.take(inside), angles[inside])]
        pairs, origin, angles, transmission = pairs.take(inside), origin[inside], angles[inside], transmission[inside]
        timed = Timed(AnyChart().unknowns(pairs.lengths), pairs.pose, pairs.offset, angles, pairs.branch)
        crank_pivot, ground, arm = pairs.pose.T[0], pairs.lengths[:, 3], np.abs(pairs.pose[:, 2])
        rocker_pivot = crank_pivot + pairs.pose[:, 1] * (ground / pairs.lengths[:, 0])
        size = np.max([*pairs.lengths.T, arm, np.abs(crank_pivot), np.abs(rocker_pivot)], axis=0) / self.extent
        ratio = pairs.lengths.max(axis=1) / pairs.lengths.min(axis=1)
        merits = merit(size, transmission, np.ptp(angles, axis=1), ratio)
        return Candidates(rows_at(parameters, origin), pairs.lengths, timed, merits, origin)

    def _crank_angles(self, pairs: Pairs) -> tuple[Floats, NDArray[np.bool_]]:
        """Return crank angles that pass the poses one way within the largest span, and which four-bars have such.

        Where both senses are possible the shorter swing is taken, unless the loop opens on it.
        """
        if not self.poses.ordered:
            return in_any_order(pairs.angles, self.poses.span_max)
        angles, holds = in_order(pairs.angles, self.poses.span_max)
        opens = np.isnan(transmission_angle_over(pairs.lengths, Interval(angles[:, 0], angles[:, -1])))
        other, other_holds = in_order(pairs.angles, self.poses.span_max, shorter=False)
        change = (opens | ~holds) & other_holds
        return np.where(change[:, None], other, angles), holds | change

    def _within_limits(self, pairs: Pairs, angles: Floats) -> NDArray[np.intp]:
        """Return the indices of the four-bars that keep the limits."""
        if not pairs.branch.size or self.limits.only_family:
            return np.arange(pairs.branch.size)
        a, z1, z2 = pairs.pose.T
        placed = Placed(pairs.lengths, pairs.branch, Interval(angles[:, 0], angles[:, -1]), a, np.angle(z1), z2)
        found = self._constraints(placed, derivatives=False)
        inside = np.all(np.where(found.equal, np.abs(found.values) < 1e-9, found.values >= 0), axis=1)
        return np.flatnonzero(inside)

    def _clear(self, pairs: Pairs, angles: Floats) -> NDArray[np.bool_]:
        """Check that no bar of four-bars, and no edge of their couplers, enters an obstacle at crank angles over the motion."""
        clear, obstacles = np.ones(pairs.branch.size, dtype=bool), self.obstacles
        if obstacles is None:
            return clear
        scale, steps = self.poses.length_scale, np.linspace(0.0, 1.0, self.options.obstacle_steps)
        crank = angles[:, :1] + (angles[:, -1:] - angles[:, :1]) * steps
        pivot_a, ground_vector, point = (column[:, None] for column in pairs.pose.T)
        turned = np.exp(1j * coupler_angle(pairs.lengths, pairs.branch, crank))
        crank_length, coupler, _, ground = (column[:, None] for column in pairs.lengths.T)
        pivot_b = pivot_a + ground_vector * (ground / crank_length)
        pin_a = pivot_a + ground_vector * np.exp(1j * crank)
        pin_b = pin_a + ground_vector * (coupler / crank_length) * turned
        body = pin_a + point * turned
        margin = obstacles.width(pairs.lengths * scale) / scale
        ends = (pivot_a, pin_a), (pin_a, pin_b), (pivot_b, pin_b), (pin_a, body), (pin_b, body)
        for left, low, right, high in obstacles.boxes:
            centre = (complex(left + right, low + high) / 2 - self.poses.middle) / scale
            half = np.array([right - left, high - low]) / (2 * scale) + margin[:, None] / 2
            for end, other in ends:
                clear &= ~np.any(_touches((end + other) / 2 - centre, (other - end) / 2, half), axis=1)
        return clear

    def usable(self, candidates: Candidates) -> Candidates:
        """Return the candidates whose body takes no detour between poses."""
        return candidates.take(np.flatnonzero(self.stays(candidates)))

    def order(self, candidates: Candidates) -> tuple[Floats | Flags, ...]:
        """Return the merit."""
        return (candidates.merit,)

    def stays(self, candidates: Candidates) -> NDArray[np.bool_]:
        """Check that the body takes no detour between poses: neither its point nor its rotation."""
        if not candidates.merit.size:
            return np.ones(0, dtype=bool)
        detour, rotation = self._problem.excursions(candidates.timed, SHORTEST_CHORD, self.options.chord)
        return np.asarray((detour <= self.options.detour * LEAVES_SAMPLES) & ~self.poses.turned_otherwise(rotation))


def _touches(middle: Complexes, along: Complexes, half: Floats) -> NDArray[np.bool_]:
    """Check whether segments (n, m) touch a box of half sizes (n, 2).

    ``middle``: of the segments from the centre of the box; ``along``: half their vectors.
    """
    width, height = half[:, :1], half[:, 1:]
    touching = np.abs(middle.real) <= width + np.abs(along.real)
    touching &= np.abs(middle.imag) <= height + np.abs(along.imag)
    across = np.abs((np.conj(along) * middle).imag)
    return touching & (across <= width * np.abs(along.imag) + height * np.abs(along.real))


def is_few(poses: Poses) -> bool:
    """Check that there are two to four samples, each with rotation and position: infinitely many four-bars pass them."""
    return poses.full.size == poses.samples <= FEW


def exact_four_bars(
    poses: Poses,
    limits: Limits,
    work: Work = UNLIMITED,
    options: FewPosesOptions | None = None,
    obstacles: Obstacles | None = None,
) -> Candidates:
    """Search for good four-bars that pass two to four poses exactly.

    Parameters
    ----------
    poses : Poses
        Two to four samples, each with rotation and position.
    limits : Limits
        No length may be given (``limits.links``): four-bars of given lengths cannot be sampled.
    work : Work, optional
        The search ends once it has expired.
    options : FewPosesOptions, optional
    obstacles : Obstacles, optional
        That no link enters.

    Returns
    -------
    Candidates
        Within the limits. First the best of each region by merit, then all others by merit; those that take a detour between
        poses come last. Empty if none was found.
    """
    options = options or FewPosesOptions()
    family = ExactFamily(poses, limits, options, obstacles)
    sampled = family.evaluate(family.sample())
    if family.level and not sampled.merit.size:
        family.level = False
        sampled = family.evaluate(family.sample())
    for _ in range((options.batches if obstacles is None else options.batches_around_obstacles) - 1):
        if sampled.merit.size >= options.enough or work.expired():
            break
        sampled = sampled.joined(family.evaluate(family.sample()))
    best = sampled.take(np.argsort(sampled.merit, kind="stable")[: options.examined])
    stays = family.stays(best)
    seeds = best.take(np.flatnonzero(stays)) if stays.any() else best
    found = improved(family, seeds.take(_regions(family, seeds, options.regions)), work).joined(best)
    found = found.take(np.lexsort((found.merit, ~family.stays(found))))
    first = _regions(family, found, found.merit.size)
    return found.take([*first, *np.setdiff1d(np.arange(found.merit.size), first)])


def _regions(family: ExactFamily, candidates: Candidates, maximum: int) -> NDArray[np.intp]:
    """Return the indices of the first candidates that differ from all before them in some pivot or length."""
    numbers = np.stack([*candidates.timed.pose.T, *candidates.lengths.T], axis=1)
    return distinct_rows(numbers, family.options.region_size * family.extent, maximum)
