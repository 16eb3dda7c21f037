"""How far the body of a four-bar as it is made lies from that of the four-bar as designed: simulated, and to first order.

Three kinds of deviation act. Lengths: crank, coupler, rocker, and the two coordinates of the body point in the coupler. Places:
both fixed pivots. Play: in each of the four joints the pin lies against the wall of its hole, in a direction that does not turn
with the crank. Since all are constant over the motion, the four-bar as made is again a four-bar: play of the crank's pins moves
its pivot A, that of the rocker's pins its pivot B. The drive holds the crank's direction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.four_bar import close_loop
from synthesis.fourbar.joints import joints_at
from synthesis.linkage import Linkage
from synthesis.pose import whole_turns
from synthesis.target import TURN
from synthesis.work import Work

SHARES = (0.05, 0.50, 0.95)
"""The quantiles that a study gives: as many of all linkages made are at most so far off."""
_BLOCK = 2**17
"""Positions of made linkages that are computed at once: a few megabytes an array."""
_WAY = np.exp(1j * np.pi * (np.arange(128) + 0.5) / 256)
"""Directions in a quarter of the plane, for means over all directions."""
_STEPS = 8
"""To the last digit: the fifth is good to seven."""


class Tolerances(NamedTuple):
    """Of manufacture, in the user's unit of length, at least 0 each."""

    links: float = 0.0
    """Each length lies evenly within this of its nominal value, either way."""
    pivots: float = 0.0
    """So does each coordinate of a fixed pivot."""
    clearance: float = 0.0
    """Diameter of a hole less that of its pin, in all four joints."""


SOURCES = (
    "crank length",
    "coupler length",
    "rocker length",
    "body point",
    "pivot A",
    "pivot B",
    "clearance at pivot A",
    "clearance at the crank pin",
    "clearance at the coupler pin",
    "clearance at pivot B",
)
"""What contributes to the error, in this order; each a real number (the lengths) or a place in the plane."""
_LENGTHS = 3


@dataclass(frozen=True)
class Spread:
    """Quantiles of an error at n crank angles, radians or the user's unit of length; infinite where too many do not close."""

    simulated: Floats
    """(n, 3): for each of `SHARES`."""
    linear: Floats
    """(n, 3): the same to first order, for normally distributed deviations of the same variance."""
    worst: Floats
    """(3,): of each made linkage's largest error over the samples."""
    contributions: Floats
    """(10,): the part of each of `SOURCES` in the variance to first order, in the mean over the samples that are not dead."""


@dataclass(frozen=True)
class Study:
    """What made linkages do.

    ``position``, ``rotation``: distance of the body point, and absolute difference of the rotation, from those as
    designed at the same crank angle. ``position`` is None where the linkage guides no body point. ``count``: how many
    linkages were simulated. ``open_share``: the part of them that does not close at every sample.
    """

    position: Spread | None
    rotation: Spread
    count: int
    open_share: float


def simulate(
    linkage: Linkage, travel: Floats, samples: int, tolerances: Tolerances, count: int, seed: int, work: Work
) -> Study:
    """Made linkages against the one as designed.

    Law: with tolerances k times as large, ``linear`` is k times as large, and so is ``simulated`` in the limit of small
    k.

    Parameters
    ----------
    travel : ndarray, shape (n,)
        Crank angles from the first sample: those of the samples come first.
    samples : int
        How many of ``travel`` are samples; worst errors and contributions are over these.
    count : int
        How many linkages to simulate.
    seed : int
        The same seed makes the same linkages.
    work : Work
        Asked between blocks whether the answer is still wanted.
    """
    linkage = replace(linkage, pivot_a=0j)  # where it stands takes digits, and changes nothing
    made = _Made.of(linkage, tolerances, count, np.random.default_rng(seed))
    nominal = joints_at(linkage, travel)
    by_rotation, by_position = _derivatives(linkage, travel)
    designed = nominal.body_point, nominal.coupler_angle
    first_order = by_position, by_rotation, _variances(tolerances)

    def positions(places: slice) -> tuple[Complexes, Floats]:
        return made.positions(travel[places])

    return compared(designed, positions, first_order, samples, count, work)


def compared(
    designed: tuple[Complexes | None, Floats],
    made: Callable[[slice], tuple[Complexes, Floats]],
    first_order: tuple[Floats | None, Floats, Floats],
    samples: int,
    count: int,
    work: Work,
) -> Study:
    """Body points and directions (count, n) of linkages ``made``, at some of n places, against those ``designed``, (n,).

    ``first_order``: derivatives of place and direction by the sources, and the variances of these.
    """
    point, direction = designed
    quantiles: list[list[Floats]] = [[], []]
    worst = np.zeros((2, count))
    step = max(1, _BLOCK // count)
    for places in (slice(first, first + step) for first in range(0, direction.size, step)):
        work.check()
        there, turned = made(places)
        turned = turned - direction[places]
        gaps = [np.abs(turned - whole_turns(turned))]
        if point is not None:
            gaps.append(np.abs(there - point[places]))
        inside = np.arange(direction.size)[places] < samples
        for kind, gap in enumerate(gaps):
            gap = np.broadcast_to(np.where(np.isnan(gap), np.inf, gap), (count, gap.shape[1]))
            quantiles[kind].append(quantiles_of(gap))
            if inside.any():
                worst[kind] = np.maximum(worst[kind], gap[:, inside].max(axis=1))
    by_position, by_rotation, variances = first_order

    def spread(kind: int, derivatives: Floats) -> Spread:
        return Spread(
            np.concatenate(quantiles[kind]),
            linear_quantiles(derivatives, variances),
            quantiles_of(worst[kind][:, None])[0],
            contributions_of(derivatives[:, :samples], variances),
        )

    position = None if by_position is None else spread(1, by_position)
    return Study(position, spread(0, by_rotation), count, float(np.mean(np.isinf(worst[0]))))


def quantiles_of(values: Floats) -> Floats:
    """For each of `SHARES` the least value (count, n) that so many do not exceed, (n, 3)."""
    places = [max(0, int(np.ceil(share * len(values))) - 1) for share in SHARES]
    return np.partition(values, places, axis=0)[places].T


class _Made(NamedTuple):
    """Linkages as made, (count,) each, relative to the plane: equivalent four-bars, see the module's head."""

    origin: Complexes
    """The crank's centre moved by the play of its pins."""
    links: Floats
    """(count, 4)"""
    turn: Floats
    """Directions of the ground line."""
    point: Complexes
    """The body point in the coupler's frame."""
    branch: int
    start: float
    """Direction of the crank at the first sample."""

    @classmethod
    def of(cls, linkage: Linkage, tolerances: Tolerances, count: int, random: np.random.Generator) -> _Made:
        lengths = tolerances.links * random.uniform(-1, 1, (count, _LENGTHS))
        offset: Any
        offset, pivot_a, pivot_b = (
            size * (random.uniform(-1, 1, (count, 2)) @ [1, 1j])
            for size in (tolerances.links, tolerances.pivots, tolerances.pivots)
        )
        play = tolerances.clearance / 2 * np.exp(1j * random.uniform(0, TURN, (count, 4)))
        links = np.array(linkage.links[:_LENGTHS]) + lengths
        moved_a = pivot_a + play[:, 0] + play[:, 1]
        moved_b = pivot_b + play[:, 3] - play[:, 2]
        along = np.exp(1j * linkage.ground_angle)
        # the ground line in its own frame, in which it turns by little
        ground = linkage.links[3] + (moved_b - moved_a) / along
        point = linkage.arm if linkage.mounted else 0j
        return cls(
            linkage.pivot_a + moved_a,
            np.concatenate([links, np.abs(ground)[:, None]], axis=1),
            linkage.ground_angle + np.angle(ground),
            point + offset,
            linkage.branch,
            linkage.start + linkage.ground_angle,
        )

    def positions(self, travel: Floats) -> tuple[Complexes, Floats]:
        """Body points and directions of the coupler at crank angles, (count, n); NaN where one does not close."""
        crank = self.start + travel
        closure = close_loop(self.links, crank - self.turn[:, None])
        direction = closure.coupler_angle(np.array(self.branch)) + self.turn[:, None]
        pin = self.origin[:, None] + self.links[:, :1] * np.exp(1j * crank)
        return pin + self.point[:, None] * np.exp(1j * direction), direction


def _derivatives(linkage: Linkage, travel: Floats) -> tuple[Floats, Floats | None]:
    """Derivatives of the body's rotation (sources, n, 2, 1) and place (sources, n, 2, 2), by both coordinates of each source.

    From the loop's differential, its real part after multiplication by the conjugate of e3. A length is a source with a first
    coordinate only; coordinates of the body point are those of the coupler. NaN at a dead position.
    """
    closure = close_loop(np.array(linkage.links), linkage.start + travel)
    slope = closure.coupler_angle_gradient(np.array(linkage.branch))
    turn = linkage.ground_angle
    e1 = np.exp(1j * (closure.crank_angle + turn))
    e2 = np.exp(1j * (closure.coupler_angle(np.array(linkage.branch)) + turn))
    e3 = np.exp(1j * (closure.rocker_angle(np.array(linkage.branch)) + turn))
    none = np.zeros(travel.size)
    # a ground vector that changes by g turns the coupler like a rocker that changes by Re(g conj(e3))
    by_ground = np.stack([slope[:, 2] * e3.real, slope[:, 2] * e3.imag], axis=-1)
    turned = [np.stack([slope[:, k], none], axis=-1) for k in range(_LENGTHS)] + [np.zeros((travel.size, 2))]
    # pivot A, pivot B, and the play at A, crank pin, coupler pin, B: which way each moves the ground vector
    turned += [sign * by_ground for sign in (-1, 1, -1, -1, -1, 1)]
    rotation = np.stack(turned)
    if not linkage.mounted:
        return rotation[..., None], None
    arm = 1j * linkage.arm * e2
    place = rotation * arm[:, None]
    place[0, :, 0] += e1
    place[3] += np.stack([e2, 1j * e2], axis=-1)
    for source in (4, 6, 7):
        place[source] += [1, 1j]
    return rotation[..., None], np.stack([place.real, place.imag], axis=-1)


def _variances(tolerances: Tolerances) -> Floats:
    """Of one coordinate of each source: even over an interval, or on a circle."""
    links, pivots, clearance = tolerances
    even = [links**2 / 3] * 4 + [pivots**2 / 3] * 2
    return np.array(even + [(clearance / 2) ** 2 / 2] * 4)


def linear_quantiles(derivatives: Floats, variances: Floats) -> Floats:
    """Quantiles (n, 3) of the length of a normally distributed error with the covariance that the sources give.

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
    square = _WAY.real**2 + ratio[:, None, None] ** 2 * _WAY.imag**2
    # log P is convex in the square of R: Newton's method from beyond the root lands before it and then rises to it
    wanted = np.log(1 - np.array(SHARES))
    beyond = np.broadcast_to(-2 * wanted, (len(size), len(SHARES)))
    for _ in range(_STEPS):
        parts = np.exp(-beyond[..., None] / (2 * square))
        total = parts.sum(axis=-1)
        beyond = np.maximum(
            beyond + (np.log(total / _WAY.size) - wanted) * 2 * total / (parts / square).sum(axis=-1), 0.0
        )
    return np.where(known[:, None], np.sqrt(beyond) * largest[:, None], np.nan)


def contributions_of(derivatives: Floats, variances: Floats) -> Floats:
    """The part of each source in the variance, (sources,), in the mean over the samples; zeros where nothing contributes."""
    known = np.all(np.isfinite(derivatives), axis=(0, 2, 3))
    square = variances * np.sum(derivatives[:, known] ** 2, axis=(1, 2, 3))
    total = square.sum()
    return square / total if total > 0 else np.zeros_like(square)
