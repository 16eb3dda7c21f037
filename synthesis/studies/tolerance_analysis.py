"""Tolerance analysis of linkages as manufactured: Monte Carlo simulation and first-order propagation.

Dimensions deviate by the tolerance of lengths, and fixed points by the tolerance of positions. In each joint the pin lies against
the wall of its hole in a direction that does not turn with the drive. All deviations are constant over the motion, so that a
linkage as manufactured is a linkage of the same kind: play moves the fixed point of its guide. The drive keeps its coordinate;
directions of rails and slots are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.pose import whole_turns
from synthesis.studies.sensitivity import Deviation, Deviations, derivatives, deviated
from synthesis.target import TURN
from synthesis.work import Work

SHARES = (0.05, 0.50, 0.95)
"""Quantiles that a study gives, as fractions of the simulated linkages."""
_BLOCK = 2**17
"""Number of positions of simulated linkages in a block: a few megabytes for each array."""
_DIRECTIONS = np.exp(1j * np.pi * (np.arange(128) + 0.5) / 256)
"""Directions in a quarter of the plane, for means over all directions."""
_QUANTILE_STEPS = 8
"""Newton steps to a quantile; the fifth is accurate to seven digits."""
_POSE_STEPS = 12
"""Largest number of Newton steps to a pose."""
_SMALL_STEP = 3e-6
"""Relative length of the last Newton step to a pose; a further step would be its square."""
_CLOSED = 1e-9
"""Largest error of a closed loop, as a fraction of the linkage's size."""


class Tolerances(NamedTuple):
    """Tolerances of manufacture, in the user's unit of length, at least 0 each."""

    links: float = 0.0
    """Half the width of the uniform distribution of each length."""
    pivots: float = 0.0
    """Half the width of the uniform distribution of each coordinate of a fixed point."""
    clearance: float = 0.0
    """Diameter of a hole minus that of its pin, in all joints."""


class Source(NamedTuple):
    """A deviation that contributes to the error: a length, or a point of the plane."""

    name: str
    tolerance: str
    """Field of `Tolerances` that bounds it."""
    effects: tuple[tuple[int, str, complex], ...]
    """Changed guides, fields of their `Deviation`, and factors of the change."""

    @property
    def is_length(self) -> bool:
        """True for a real number."""
        return self.name.endswith(" length")

    def unit(self, value: complex) -> Deviations:
        """Return the deviations for a value of the source."""
        return _summed([(self, value)])


@dataclass(frozen=True)
class Spread:
    """Quantiles of an error at n positions, in radians or the user's unit of length; infinite if too many loops are open."""

    simulated: Floats
    """Quantiles (n, 3) of `SHARES`."""
    linear: Floats
    """First-order quantiles (n, 3) for normally distributed deviations of the same variance."""
    worst: Floats
    """Quantiles (3,) of the largest error of each linkage over the samples."""
    contributions: Floats
    """Fraction (sources,) of the first-order variance due to each source, in the mean over samples that are not dead."""


@dataclass(frozen=True)
class Study:
    """Errors of linkages as manufactured, against the linkage as designed at the same coordinate of the drive."""

    sources: tuple[str, ...]
    """Names of the sources."""
    position: Spread | None
    """Distance of the body point; None without a body point."""
    rotation: Spread
    """Absolute difference of the rotation."""
    count: int
    """Number of simulated linkages."""
    open_share: float
    """Fraction of the linkages that do not close at every sample."""


_SOURCES: dict[type[Circle] | type[Rail] | type[Slot], tuple[tuple[str, str, str], ...]] = {
    Circle: (
        ("{} length", "links", "radius"),
        ("{} body point", "links", "body_point"),
        ("{} pivot", "pivots", "fixed"),
        ("clearance at the {} pivot", "clearance", "fixed"),
        ("clearance at the {} pin", "clearance", "fixed"),
    ),
    Rail: (
        ("{} body point", "links", "body_point"),
        ("{} rail", "pivots", "fixed"),
        ("clearance at the {} pin", "clearance", "fixed"),
        ("clearance in the {} rail", "clearance", "fixed"),
    ),
    Slot: (
        ("{} slot", "links", "body_point"),
        ("{} pin", "pivots", "fixed"),
        ("clearance at the {} pin", "clearance", "fixed"),
        ("clearance in the {} slot", "clearance", "fixed"),
    ),
}
"""Name, tolerance and field of the sources of each guide."""


def sources_of(linkage: Linkage) -> list[Source]:
    """Return the sources of error of a linkage.

    A four-bar has the length of its coupler and a body point as separate sources. The body of any other kind has two
    body points or slots instead, one for each guide.
    """
    if not linkage.is_four_bar:
        return [
            Source(name_template.format(name), tolerance, ((index, field, 1.0),))
            for index, (name, guide) in enumerate(linkage.named_guides)
            for name_template, tolerance, field in _SOURCES[type(guide)]
        ]
    first, second = linkage.guides
    coupler = second.body_point - first.body_point
    coupler_direction = complex(coupler / abs(coupler))
    return [
        Source("crank length", "links", ((0, "radius", 1.0),)),
        Source("coupler length", "links", ((1, "body_point", coupler_direction),)),
        Source("rocker length", "links", ((1, "radius", 1.0),)),
        Source("body point", "links", ((0, "body_point", -coupler_direction), (1, "body_point", -coupler_direction))),
        Source("pivot A", "pivots", ((0, "fixed", 1.0),)),
        Source("pivot B", "pivots", ((1, "fixed", 1.0),)),
        Source("clearance at pivot A", "clearance", ((0, "fixed", 1.0),)),
        Source("clearance at the crank pin", "clearance", ((0, "fixed", 1.0),)),
        Source("clearance at the coupler pin", "clearance", ((1, "fixed", -1.0),)),
        Source("clearance at pivot B", "clearance", ((1, "fixed", 1.0),)),
    ]


def simulate(
    linkage: Linkage, travel: Floats, samples: int, tolerances: Tolerances, count: int, seed: int, work: Work
) -> Study:
    """Compare linkages as manufactured with the linkage as designed.

    Law: with tolerances k times as large, ``linear`` is k times as large, and so is ``simulated`` in the limit of small k.

    Parameters
    ----------
    linkage : Linkage
        The linkage as designed.
    travel : ndarray, shape (n,)
        Travel of the drive from the first sample, radians or lengths; the samples come first.
    samples : int
        Number of samples in ``travel``; worst errors and contributions are over these.
    tolerances : Tolerances
        Tolerances of manufacture.
    count : int
        Number of linkages to simulate.
    seed : int
        Seed of the random deviations.
    work : Work
        Checked between blocks.

    Returns
    -------
    Study
        Quantiles of the errors of position and rotation.
    """
    linkage = linkage.moved(0.0, -linkage.guides[0][0])  # distance from the origin costs digits, and changes nothing
    coordinate = linkage.start + travel
    sources = sources_of(linkage)
    deviations = _drawn(sources, tolerances, count, np.random.default_rng(seed))
    nominal = linkage.body(coordinate)
    quantiles: list[list[Floats]] = [[], []]
    worst = np.zeros((2, count))
    step = max(1, _BLOCK // count)
    for block in (slice(first, first + step) for first in range(0, travel.size, step)):
        work.check()
        position, rotation = manufactured(linkage, coordinate[block], *deviations)
        turned = rotation - nominal.rotation[block]
        inside = np.arange(travel.size)[block] < samples
        errors: list[Floats] = [np.abs(turned - whole_turns(turned)), np.abs(position - nominal.position[block])]
        for index, error in enumerate(errors):
            error = np.broadcast_to(np.where(np.isnan(error), np.inf, error), (count, error.shape[1]))
            quantiles[index].append(_quantiles_of(error))
            if inside.any():
                worst[index] = np.maximum(worst[index], error[:, inside].max(axis=1))
    units = [(1.0, 0.0) if source.is_length else (1.0, 1j) for source in sources]
    changes = [source.unit(value) for source, pair in zip(sources, units) for value in pair]
    by_position, by_rotation = derivatives(linkage, coordinate, changes)
    variances = np.array([_variance(source, tolerances) for source in sources])

    def spread(index: int, slopes: Floats) -> Spread:
        by_source = slopes.reshape(len(sources), 2, travel.size, -1).swapaxes(1, 2)
        return Spread(
            np.concatenate(quantiles[index]),
            linear_quantiles(by_source, variances),
            _quantiles_of(worst[index][:, None])[0],
            _contributions_of(by_source[:, :samples], variances),
        )

    plane = np.stack([by_position.real, by_position.imag], axis=-1)
    return Study(
        tuple(source.name for source in sources),
        spread(1, plane) if linkage.mounted else None,
        spread(0, by_rotation),
        count,
        float(np.mean(np.isinf(worst[0]))),
    )


def _drawn(sources: Sequence[Source], tolerances: Tolerances, count: int, random: np.random.Generator) -> Deviations:
    """Return random deviations of linkages, (count, 1) each: lengths are drawn first, then points, then play."""
    lengths = [source for source in sources if source.is_length]
    play = [source for source in sources if source.tolerance == "clearance"]
    points = [source for source in sources if source not in lengths and source not in play]
    values: list[tuple[Source, Any]] = []
    drawn = tolerances.links * random.uniform(-1, 1, (count, len(lengths)))
    values += [(source, drawn[:, [index]]) for index, source in enumerate(lengths)]
    for source in points:
        size = float(getattr(tolerances, source.tolerance))
        values.append((source, size * (random.uniform(-1, 1, (count, 2)) @ [1, 1j])[:, None]))
    drawn = tolerances.clearance / 2 * np.exp(1j * random.uniform(0, TURN, (count, len(play))))
    values += [(source, drawn[:, [index]]) for index, source in enumerate(play)]
    return _summed(values)


def _summed(values: Sequence[tuple[Source, Any]]) -> Deviations:
    """Return the deviations of both guides for values of sources."""
    found = [Deviation(), Deviation()]
    for source, value in values:
        for index, field, factor in source.effects:
            found[index] = found[index]._replace(**{field: getattr(found[index], field) + factor * value})
    return found[0], found[1]


def _variance(source: Source, tolerances: Tolerances) -> float:
    """Return the variance of one coordinate of a source, distributed evenly over an interval or on a circle."""
    size = float(getattr(tolerances, source.tolerance))
    return (size / 2) ** 2 / 2 if source.tolerance == "clearance" else size**2 / 3


# -- poses of linkages as manufactured --------------------------------------------------------------------------------


class _Locked(NamedTuple):
    """Poses of bodies that can still turn about a pin, or slide along a slot, with the drive locked."""

    position: Complexes
    rotation: Floats
    moves: Complexes
    """Derivative of the position by the turn, or by the slide."""
    turns: float
    """Derivative of the rotation."""


def manufactured(
    linkage: Linkage, coordinate: Floats, first: Deviation, second: Deviation
) -> tuple[Complexes, Floats]:
    """Return positions and rotations (count, n) of the bodies of linkages with deviations (count, 1), or (n,) for numbers.

    With the drive locked, the other guide is met by Newton's method from the pose as designed, for all linkages at once. NaN if
    the loop does not close on the branch of the linkage. Law: without deviations `Linkage.body`.

    Parameters
    ----------
    linkage : Linkage
        The linkage as designed.
    coordinate : ndarray, shape (n,)
        Coordinates of the drive.
    first, second : Deviation
        Changes of both guides.
    """
    driven, other = deviated(linkage.guides[0], first), deviated(linkage.guides[1], second)
    with np.errstate(all="ignore"):
        nominal = linkage.body(coordinate)
        drive = coordinate + linkage.ground_angle if linkage.driver.turns else coordinate
        along = np.exp(1j * drive)
        pin, held, size = driven[0] + 0 * drive, driven.body_point + 0 * drive, 1.0
        if driven.holds_point:
            pin = driven.ground_at(drive)
        elif linkage.driver is Driver.CYLINDER:
            held = driven.body_at(drive)
        begin, side = nominal.rotation + 0 * np.real(pin), np.full(drive.shape, linkage.branch)
        if linkage.driver is Driver.HINGE:
            rotation, size, side = drive - driven.body_direction, linkage.reach, -np.sign(nominal.sine)
            origin = pin - np.exp(1j * rotation) * held
            begin = dot(along, origin - nominal.position)

        def locked(value: Floats) -> _Locked:
            if linkage.driver is Driver.HINGE:
                return _Locked(origin - value * along, rotation, -along, 0.0)
            arm = np.exp(1j * value) * held
            return _Locked(pin - arm, value, -1j * arm, 1.0)

        at = begin
        for _ in range(_POSE_STEPS):
            gap, slope = _gap(other, locked(at))
            step = np.clip(np.nan_to_num(gap / slope), -0.3 * size, 0.3 * size)
            at = at - step
            if np.abs(step).max() < _SMALL_STEP * size:
                break
        pose = locked(at)
        gap, slope = _gap(other, pose)
        good = (np.abs(gap) < _CLOSED * linkage.reach) & (np.sign(slope) == side) & np.isfinite(nominal.rotation)
        return np.where(good, pose.position, np.nan), np.where(good, pose.rotation, np.nan)


def _gap(guide: Any, pose: _Locked) -> tuple[Floats, Floats]:
    """Return the distance of the bodies from a guide, and its derivative by the turn or slide."""
    turned = np.exp(1j * pose.rotation)
    arm, push = turned * guide.body_point, guide.push(pose.position, turned)
    spoke, velocity = pose.position + arm - guide[0], pose.moves + 1j * pose.turns * arm
    if isinstance(guide, Slot):  # a slot turns with the body
        velocity = velocity - 1j * pose.turns * spoke
    radius = guide.radius if isinstance(guide, Circle) else 0.0
    return dot(push, spoke) - radius, dot(push, velocity)


# -- quantiles --------------------------------------------------------------------------------------------------------


def _quantiles_of(values: Floats) -> Floats:
    """Return the quantiles (n, 3) of values (count, n) for each of `SHARES`."""
    indices = [max(0, int(np.ceil(share * len(values))) - 1) for share in SHARES]
    return np.partition(values, indices, axis=0)[indices].T


def linear_quantiles(derivatives: Floats, variances: Floats) -> Floats:
    """Return quantiles (n, 3) of the length of a normally distributed error with the covariance of the sources.

    In the axes of its covariance the error is ``rho (s1 cos psi, s2 sin psi)``, rho Rayleigh distributed, psi even; so
    ``P(length > R) = mean over psi of exp(-R^2 / (2 (s1^2 cos^2 psi + s2^2 sin^2 psi)))``, which for s2 = 0 is Craig's form
    of erfc (J. W. Craig, MILCOM 1991).
    """
    with np.errstate(invalid="ignore"):
        covariance = np.einsum("s,snci,sncj->nij", variances, derivatives, derivatives)
    known = np.all(np.isfinite(covariance), axis=(1, 2))
    size = np.sqrt(np.maximum(np.linalg.eigvalsh(np.where(known[:, None, None], covariance, 0.0)), 0.0))
    largest, second = size[:, -1], size[:, 0] if size.shape[1] == 2 else 0.0 * size[:, 0]
    ratio = second / np.where(largest > 0, largest, 1.0)
    square = _DIRECTIONS.real**2 + ratio[:, None, None] ** 2 * _DIRECTIONS.imag**2
    # log P is convex in the square of R: Newton's method from beyond the root lands before it and then rises to it
    logarithms = np.log(1 - np.array(SHARES))
    beyond = np.broadcast_to(-2 * logarithms, (len(size), len(SHARES)))
    for _ in range(_QUANTILE_STEPS):
        parts = np.exp(-beyond[..., None] / (2 * square))
        total = parts.sum(axis=-1)
        beyond = np.maximum(
            beyond + (np.log(total / _DIRECTIONS.size) - logarithms) * 2 * total / (parts / square).sum(axis=-1), 0.0
        )
    return np.where(known[:, None], np.sqrt(beyond) * largest[:, None], np.nan)


def _contributions_of(derivatives: Floats, variances: Floats) -> Floats:
    """Return the fraction (sources,) of each source in the mean variance over the samples; zeros without any deviation."""
    known = np.all(np.isfinite(derivatives), axis=(0, 2, 3))
    square = variances * np.sum(derivatives[:, known] ** 2, axis=(1, 2, 3))
    total = square.sum()
    return square / total if total > 0 else np.zeros_like(square)
