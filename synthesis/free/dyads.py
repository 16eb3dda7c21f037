"""Poses with rotation and position: dyads that guide the body through them, and pairs of dyads as four-bars.

Data flow of a request::

    five and more poses -> dyads (one SVD and a quartic)
      -> pairs of dyads as four-bars with crank angles -> four-bars of the family, on one branch, in the requested order
      -> joint refinement -> reached? otherwise the same with dyads from starts all over the body

A dyad is a point m of the body (in its frame), a fixed centre c and a radius r with |P + R m - c| = r at every pose,
R = e^{i gamma}. In expanded form, with a = conj(P) R and k = conj(m) c, this is linear in eight coefficients::

    [|P|^2, 1, 2 Re a, -2 Im a, -2 Re P, -2 Im P, -2 Re R, -2 Im R] . q = 0
    q = q0 [1, |m|^2 + |c|^2 - r^2, m, c, k],      conj(q_m) q_c = q0 q_k

(Bottema and Roth, Theoretical Kinematics, 1979; Ravani and Roth, J. Mech. Trans. Automation 105 (1983) 460-467; Ge, Purwar,
Zhao, Deshpande, J. Comput. Inf. Sci. Eng. 17 (2017) 031011). The right singular vectors of the poses' rows with the three
smallest singular values span the solutions; the two real quadrics leave at most four dyads in this span: Burmester's dyads for
five poses.

Two poses leave the point of the body and one coordinate of its centre free, three poses leave the point free, and four poses
leave one parameter: the points whose four positions lie on a circle form a cubic curve (Burmester's).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Flags, Floats, rows_at, rows_of_all
from synthesis.descents import Pool, Stage, Timed
from synthesis.fourbar.mechanism import AnyChart, GrashofChart
from synthesis.free.joint import JointProblem
from synthesis.least_squares import Evaluation, minimise
from synthesis.limits import in_family
from synthesis.poses import Poses
from synthesis.target import TURN
from synthesis.work import UNLIMITED, Work

# -- dyads ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DyadOptions:
    """Options of the search for pairs of dyads."""

    polish_steps: int = 6
    """Largest number of Newton steps that refine dyads; two or three reach rounding."""
    polish_stall: float = 0.1
    """Relative decrease of the error below which these steps end."""
    radii: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0, 1.8, 3.2, 5.5, 9.0)
    """Distances of the first body points, in length scales."""
    directions: int = 14
    """Number of first body points at each distance."""
    newton_steps: int = 20
    """Largest number of Newton steps to a root."""
    even: float = 0.3
    """Fraction of the difference by which angles in order move towards evenly spaced ones."""
    link_min: float = 1e-9
    """Smallest length of a link, in length scales."""
    exact_stages: tuple[Stage, ...] = (Stage(25),)
    """Stages that refine the pairs of exact dyads."""
    refined_pairs: int = 24
    """Number of pairs of inexact dyads that are refined: most of them fall into few basins."""
    near_stages: tuple[Stage, ...] = (Stage(100),)
    """Stages of that refinement."""
    paired_together: int = 1 << 18
    """Number of pairs times samples between two looks at the time: some 25 ms."""


OPTIONS = DyadOptions()


FARTHEST = 1e4
"""Points of the body and centres beyond this many length scales are sliders, which are no four-bars."""


class Dyads(NamedTuple):
    """Dyads, lengths over the length scale and from the mean position."""

    body: Complexes
    """(n,): m."""
    fixed: Complexes
    """(n,): c."""
    radius: Floats
    """(n,)"""

    def take(self, indices: Any) -> Dyads:
        """Select dyads."""
        return rows_at(self, indices)

    def joined(self, *following: Dyads) -> Dyads:
        """Return these dyads followed by others."""
        return rows_of_all(self, *following)


class Body:
    """The poses that have both parts, as the dyads see them."""

    def __init__(self, poses: Poses) -> None:
        keep = poses.full
        self.position, self.turned = poses.scaled[keep], poses.turned[keep]
        root = [
            np.broadcast_to(mean.root, poses.samples)[keep] for mean in (poses.rotation_mean, poses.position_mean)
        ]
        self.rotation_root, self.position_root = root

    def positions(self, body: Complexes) -> Complexes:
        """Return positions (n, N) of points of the body (n,)."""
        return self.position + self.turned * body[:, None]

    def with_radius(self, body: Complexes, fixed: Complexes) -> Dyads:
        """Dyads with their mean distance as radius."""
        return Dyads(body, fixed, np.abs(self.positions(body) - fixed[:, None]).mean(axis=1))


_QUADRICS = np.zeros((2, 8, 8))
for _quadric, _terms in enumerate((((2, 4, 1), (3, 5, 1), (0, 6, -1)), ((2, 5, 1), (3, 4, -1), (0, 7, -1)))):
    for _i, _j, _sign in _terms:
        _QUADRICS[_quadric, _i, _j] = _QUADRICS[_quadric, _j, _i] = _sign / 2
_ROTATION = np.linalg.qr(np.random.default_rng(7).standard_normal((3, 3)))[0]
"""Any rotation: it keeps the roots from infinity."""


def linear_dyads(body: Body) -> Dyads:
    """The dyads, up to four, in the span of the three least singular vectors of the poses' rows."""
    p, r = body.position, body.turned
    a = np.conj(p) * r
    ones = np.ones(p.size)
    rows = np.stack(
        [np.abs(p) ** 2, ones, 2 * a.real, -2 * a.imag, -2 * p.real, -2 * p.imag, -2 * r.real, -2 * r.imag], axis=1
    )
    rows *= np.minimum(body.position_root, body.rotation_root)[:, None]
    scale = np.sqrt(np.sum(rows**2, axis=0))
    scale = np.where(scale > 0, scale, 1.0)
    square: Any = np.linalg.qr(np.concatenate([rows / scale, np.zeros((8, 8))]), mode="r")
    span = np.linalg.svd(square)[2][-3:].T @ _ROTATION / scale[:, None]
    span /= np.linalg.norm(span)
    found = span @ _common_points(np.einsum("ai,qab,bj->qij", span, _QUADRICS, span)).T
    q0, m, c = found[0], found[2] + 1j * found[3], found[4] + 1j * found[5]
    size = np.maximum(np.abs(m), np.abs(c))
    proper = np.isfinite(size) & (size < FARTHEST * np.abs(q0))
    return body.with_radius(m[proper] / q0[proper], c[proper] / q0[proper])


def _common_points(conics: Floats) -> Floats:
    """Return real common points (n, 3) of two conics y' C y = 0; the real part of nearly real points."""

    def parts(x: Any) -> list[Any]:
        return [
            [c[1, 1] + 0 * x, 2 * (c[0, 1] * x + c[1, 2]), c[0, 0] * x * x + 2 * c[0, 2] * x + c[2, 2]]
            for c in conics
        ]

    # both are quadratic in y: their resultant in x, by its values at five points
    nodes = np.exp(2j * np.pi * np.arange(5) / 5)
    (a1, b1, c1), (a2, b2, c2) = parts(nodes)
    values = (a1 * c2 - a2 * c1) ** 2 - (a1 * b2 - a2 * b1) * (b1 * c2 - b2 * c1)
    coefficients = (np.fft.fft(values) / 5).real
    x = np.roots(coefficients[::-1])
    (a1, b1, c1), (a2, b2, c2) = parts(x)
    below = a1 * b2 - a2 * b1
    y = -(a1 * c2 - a2 * c1) / np.where(np.abs(below) > 0, below, 1e-300)
    points = np.stack([x, y, np.ones_like(x)], axis=1)
    for _ in range(4):
        image = np.einsum("qij,nj->nqi", conics, points)
        value, slope = np.einsum("nqi,ni->nq", image, points), 2 * image[:, :, :2]
        determinant = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
        determinant = np.where(np.abs(determinant) > 1e-200, determinant, np.inf)
        points[:, 0] -= (slope[:, 1, 1] * value[:, 0] - slope[:, 0, 1] * value[:, 1]) / determinant
        points[:, 1] -= (slope[:, 0, 0] * value[:, 1] - slope[:, 1, 0] * value[:, 0]) / determinant
    real = np.abs(points.imag).max(axis=1) < 0.1 * np.abs(points).max(axis=1)
    return points.real[real]


def evaluate_dyads(body: Body, unknowns: Floats, derivatives: bool = True) -> Evaluation:
    """First-order errors of dyads (n, 5: m, c, r) in the objective's measure; see `polished`."""
    m, c, radius = unknowns[:, 0] + 1j * unknowns[:, 1], unknowns[:, 2] + 1j * unknowns[:, 3], unknowns[:, 4:]
    arm = body.turned * m[:, None]
    gap = body.position + arm - c[:, None]
    distance = np.abs(gap)
    normal = gap / np.where(distance > 0, distance, 1.0)
    swing = (np.conj(normal) * 1j * arm).real
    # a distance error is made up by moving and turning the pose: the cheapest way counts
    weight = 1 / np.sqrt(1 / body.position_root**2 + (swing / body.rotation_root) ** 2)
    residual = (distance - radius) * weight
    stack = np.empty((len(unknowns), 6, residual.shape[1]))
    along = np.conj(normal) * body.turned
    stack[:, 0], stack[:, 1] = along.real * weight, -along.imag * weight
    stack[:, 2], stack[:, 3] = -normal.real * weight, -normal.imag * weight
    stack[:, 4], stack[:, 5] = -weight, residual
    cost = np.einsum("nk,nk->n", residual, residual)
    return Evaluation(np.where(np.isfinite(cost), cost, np.inf), stack)


def polished(
    body: Body,
    dyads: Dyads,
    steps: int = OPTIONS.polish_steps,
    stall: float = OPTIONS.polish_stall,
    work: Work = UNLIMITED,
) -> tuple[Dyads, Floats]:
    """Refine dyads by least-squares steps of their first-order errors within the time; return dyads and rms errors (n,)."""
    columns = [dyads.body.real, dyads.body.imag, dyads.fixed.real, dyads.fixed.imag, dyads.radius]
    start = np.stack(columns, axis=1)
    done = minimise(
        lambda unknowns, _: evaluate_dyads(body, unknowns), start, np.zeros(len(start)), steps, 0.0, work, stall, 1e-8
    )
    x = done.unknowns
    return Dyads(x[:, 0] + 1j * x[:, 1], x[:, 2] + 1j * x[:, 3], x[:, 4]), np.sqrt(done.cost)


def landscape(body: Body, steps: int = 20, max_count: int = 36, work: Work = UNLIMITED) -> tuple[Dyads, Floats]:
    """Return the best dyads from starts all over the body, different from each other, and their errors; best first.

    A dyad has only two nonlinear unknowns, the coordinates of the point of the body. Centre and radius follow from a circle
    through its positions.
    """
    radius, angle = np.meshgrid(
        OPTIONS.radii, np.arange(OPTIONS.directions) * (2 * np.pi / OPTIONS.directions), indexing="ij"
    )
    points = np.concatenate([[0j], (radius * np.exp(1j * angle)).ravel()])
    return distinct_dyads(*polished(body, circles(body, points), steps, 1e-9, work), max_count)


def circles(body: Body, points: Complexes) -> Dyads:
    """Dyads of points of the body (n,): the circle through the places of each by linear least squares (Kasa)."""
    points_in_plane = body.positions(points)
    middle = points_in_plane.mean(axis=1, keepdims=True)
    offsets = points_in_plane - middle
    rows = np.stack([2 * offsets.real, 2 * offsets.imag, np.ones(offsets.shape)], axis=2)
    solution = np.einsum("nik,nk->ni", np.linalg.pinv(rows, rcond=1e-9), np.abs(offsets) ** 2)
    centre = middle[:, 0] + solution[:, 0] + 1j * solution[:, 1]
    return body.with_radius(points, centre)


def distinct_dyads(dyads: Dyads, error: Floats, max_count: int, apart: float = 0.03) -> tuple[Dyads, Floats]:
    """The best dyads, no two nearer than ``apart`` of their size, sliders left out."""
    chosen: list[int] = []
    columns = np.stack([dyads.body, dyads.fixed])
    size = np.maximum(1.0, np.abs(columns).max(axis=0))
    for index in np.argsort(error, kind="stable"):
        if len(chosen) == max_count or not np.isfinite(error[index]):
            break
        close = np.abs(columns[:, chosen] - columns[:, index, None]).max(axis=0) < apart * size[index]
        if size[index] < FARTHEST and not close.any():
            chosen.append(int(index))
    return dyads.take(chosen), error[chosen]


# -- two, three and four poses -------------------------------------------------------------------------------------


def sampled_dyads(body: Body, count: int, random: np.random.Generator) -> Dyads:
    """Dyads (about ``count``) that fit up to four poses exactly; radius from the first pose."""
    poses = body.position.size
    if poses == 4:
        points = _burmester_points(body, count, random)
    else:
        points = np.concatenate([_cloud(count - count // 2, random), _near_poles(body, count // 2, random)])
    points = points[np.abs(points) < FARTHEST]  # a pole is at infinity where two poses have the same rotation
    moved = body.positions(points)
    centre = _between(moved, random) if poses == 2 else circumcentre(moved[:, 0], moved[:, 1], moved[:, 2])
    proper = np.isfinite(centre) & (np.abs(centre) < FARTHEST)
    return body.with_radius(points[proper], centre[proper])


def _cloud(count: int, random: np.random.Generator) -> Complexes:
    """Points of the body about its origin, as often within a length scale as beyond it."""
    radius = 2.0 * random.uniform(0, 1, count) / random.uniform(0.3, 1, count)
    return radius * np.exp(2j * np.pi * random.uniform(0, 1, count))


def _near_poles(body: Body, count: int, random: np.random.Generator) -> Complexes:
    """Points of the body near those that two poses share: there cranks are short beside the motion."""
    first, second = np.triu_indices(body.position.size, 1)
    pick = random.integers(0, first.size, count)
    first, second = first[pick], second[pick]
    with np.errstate(all="ignore"):
        pole = (body.position[second] - body.position[first]) / (body.turned[first] - body.turned[second])
    pole = np.where(np.isfinite(pole), pole, np.inf)
    return pole + 10.0 ** random.uniform(-3, 0, count) * np.exp(2j * np.pi * random.uniform(0, 1, count))


def _between(moved: Complexes, random: np.random.Generator) -> Complexes:
    """Centres at equal distance from two places, at random along their perpendicular bisector."""
    chord = moved[:, 1] - moved[:, 0]
    return (moved[:, 0] + moved[:, 1]) / 2 + 1j * chord * np.tan(random.uniform(-1.4, 1.4, len(moved)))


def circumcentre(p: Complexes, q: Complexes, r: Complexes) -> Complexes:
    """Return centres of the circles through three points; not finite if they lie on a line."""
    a, b = q - p, r - p
    with np.errstate(divide="ignore", invalid="ignore"):
        below = 2 * (np.conj(a) * b).imag
        return p + 1j * (a * np.abs(b) ** 2 - b * np.abs(a) ** 2) / below


def _burmester_points(body: Body, count: int, random: np.random.Generator) -> Complexes:
    """Return body points whose four positions lie on a circle, near random points."""
    base, directions = _cloud(count, random), np.exp(1j * np.pi * random.uniform(0, 1, count))
    points = _on_cubic(body.position, body.turned, base, directions)
    return points[np.isfinite(points)]


def centre_points(body: Body, base: Complexes, directions: Complexes) -> Complexes:
    """Return points of Burmester's centre-point curve of four poses on lines (n,), near the base of each.

    Seen from the body the fixed plane moves as the body moves in it: centre points are the circle points of that motion. The
    number is not finite for a line on which none was found.
    """
    inverse = np.conj(body.turned)
    return _on_cubic(-inverse * body.position, inverse, base, directions)


def _on_cubic(position: Complexes, turned: Complexes, base: Complexes, directions: Complexes) -> Complexes:
    """Return points of the circle-point curve of a moving plane on lines (n,), by Newton's method from the base of each.

    With X_i the four positions of a point, the curve is Im[(X1 - X3)(X2 - X4) conj((X1 - X4)(X2 - X3))] = 0.
    """
    nodes = np.array([-1.5, -0.5, 0.5, 1.5])
    points = (base[:, None] + directions[:, None] * nodes).ravel()
    x1, x2, x3, x4 = position[:, None] + turned[:, None] * points
    values = ((x1 - x3) * (x2 - x4) * np.conj((x1 - x4) * (x2 - x3))).imag.reshape(base.size, 4)
    a, b, c, d = np.linalg.inv(np.vander(nodes)) @ values.T
    root, step = np.zeros(base.size), np.full(base.size, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(OPTIONS.newton_steps):
            step = (((a * root + b) * root + c) * root + d) / ((3 * a * root + 2 * b) * root + c)
            root = root - step
        converged = np.abs(step) <= 1e-12 * np.maximum(1.0, np.abs(root))
    return base + directions * np.where(converged, root, np.nan)


# -- pairs of dyads ------------------------------------------------------------------------------------------------


class Pairs(NamedTuple):
    """Four-bars whose first dyad is the crank's; lengths over the length scale."""

    lengths: Floats
    """(n, 4): crank, coupler, rocker, ground."""
    branch: Floats
    """(n,): branch of most samples."""
    one_branch: Flags
    """(n,): whether all samples lie on it."""
    angles: Floats
    """(n, N): theta1 at the samples, in (-pi, pi]."""
    pose: Complexes
    """(n, 3): A, z1, z2."""
    offset: Floats
    """(n,): of the rotation."""

    def take(self, indices: Any) -> Pairs:
        """Select pairs."""
        return rows_at(self, indices)


def pairs_of(body: Body, dyads: Dyads, cranks: slice = slice(None)) -> Pairs:
    """Return all ordered pairs of dyads as four-bars, or those with some of them as cranks."""
    count = dyads.radius.size
    crank, rocker = (index.ravel() for index in np.indices((count, count))[:, cranks])
    different = crank != rocker
    return paired(body, dyads.take(crank[different]), dyads.take(rocker[different]))[0]


def paired(body: Body, crank: Dyads, rocker: Dyads) -> tuple[Pairs, NDArray[np.intp]]:
    """Return four-bars of cranks and rockers (n,), and the indices of those that are no point."""
    coupler, ground = rocker.body - crank.body, rocker.fixed - crank.fixed
    lengths = np.stack([crank.radius, np.abs(coupler), rocker.radius, np.abs(ground)], axis=1)
    proper = np.flatnonzero((lengths.min(axis=1) > OPTIONS.link_min) & (lengths.max(axis=1) < FARTHEST))
    crank, rocker = crank.take(proper), rocker.take(proper)
    coupler, ground, lengths = coupler[proper], ground[proper], lengths[proper]
    crank_pins, coupler_pins = body.positions(crank.body), body.positions(rocker.body)
    turn = np.angle(ground)
    angles = np.angle((crank_pins - crank.fixed[:, None]) * np.exp(-1j * turn)[:, None])
    diagonal = rocker.fixed[:, None] - crank_pins
    side = (np.conj(diagonal) * (coupler_pins - crank_pins)).imag
    branch = np.where(np.sum(side > 0, axis=1) * 2 >= side.shape[1], 1.0, -1.0)
    offset = turn - np.angle(coupler)
    pose = np.stack([crank.fixed, lengths[:, 0] * np.exp(1j * turn), -crank.body * np.exp(1j * offset)], axis=1)
    return Pairs(lengths, branch, np.all(side * branch[:, None] > 0, axis=1), angles, pose, offset), proper


def in_order(angles: Floats, span_max: float = TURN, shorter: bool = True) -> tuple[Floats, Flags]:
    """Make crank angles (n, N) continuous in the direction that passes the samples in their order on the shorter path.

    Returns
    -------
    angles : ndarray, shape (n, N)
        Strictly increasing or decreasing if the order is satisfied.
    holds : ndarray of bool, shape (n,)
        True if the crank passes the samples in a single direction within ``span_max``.
    """
    steps = np.diff(angles, axis=1)
    ahead = steps % TURN
    back = -((-steps) % TURN)
    rising = (ahead.sum(axis=1) <= -back.sum(axis=1)) == shorter
    path = np.where(rising[:, None], ahead, back)
    total = np.abs(path.sum(axis=1))
    straight = np.concatenate([angles[:, :1], angles[:, :1] + np.cumsum(path, axis=1)], axis=1)
    return straight, np.all(path != 0, axis=1) & (total < min(span_max, TURN) * (1 + 1e-12))


def in_any_order(angles: Floats, span_max: float) -> tuple[Floats, Flags]:
    """Crank angles (n, N) on the shortest arc that holds all, and for which that is short enough."""
    within = np.sort(angles % TURN, axis=1)
    gaps = np.diff(np.concatenate([within, within[:, :1] + TURN], axis=1), axis=1)
    largest = gaps.argmax(axis=1)
    begin = np.take_along_axis(within, ((largest + 1) % within.shape[1])[:, None], 1)
    along = begin + (angles - begin) % TURN
    along -= TURN * np.round(along[:, :1] / TURN)
    return along, TURN - gaps.max(axis=1) <= span_max * (1 + 1e-12)


def put_in_order(angles: Floats, span_max: float = TURN) -> Floats:
    """Return strictly monotonic crank angles (n, N) within the span, close to the given angles, as starts for noisy samples.

    Neighbours are assumed to be less than half a turn apart, and an angle that steps back is placed just after its neighbour.
    """
    steps = np.diff(angles, axis=1)
    steps -= TURN * np.round(steps / TURN)
    sense = np.where(steps.sum(axis=1, keepdims=True) >= 0, 1.0, -1.0)
    along = np.concatenate([np.zeros((len(angles), 1)), np.cumsum(sense * steps, axis=1)], axis=1)
    rising, falling = np.maximum.accumulate(along, axis=1), np.minimum.accumulate(along[:, ::-1], axis=1)[:, ::-1]
    along = (rising + falling) / 2
    # room between neighbours: an angle may move by less than the gap in a step
    even = np.linspace(0.0, 1.0, angles.shape[1]) * np.maximum(along[:, -1:] - along[:, :1], 1e-3)
    along += OPTIONS.even * (along[:, :1] + even - along)
    along *= np.minimum(1.0, 0.98 * min(span_max, TURN) / (along[:, -1:] - along[:, :1]))
    return angles[:, :1] + sense * along


# -- the search ----------------------------------------------------------------------------------------------------


FEW = 4
"""Largest number of poses that infinitely many dyads fit exactly."""


def chart_of(family: str) -> AnyChart | GrashofChart:
    """The chart in which four-bars of one of `limits.FAMILIES` are refined."""
    return AnyChart() if family == "any" else GrashofChart()


def four_bars(poses: Poses, body: Body, dyads: Dyads, family: str, work: Work, repair: bool = False) -> Timed:
    """Return the pairs of dyads that belong to the family, lie on one branch and pass the poses in the requested order.

    With ``repair``, pairs that nearly do so are included, with their angles put in order. If the time runs out, the pairs of the
    first dyads as cranks are returned.
    """
    count = dyads.radius.size
    few = max(1, OPTIONS.paired_together // (max(count, 1) * poses.samples))
    parts: list[Timed] = []
    for k in range(0, max(count, 1), few):
        if parts and work.expired():
            break
        parts.append(_four_bars(poses, pairs_of(body, dyads, slice(k, k + few)), family, repair))
    return parts[0].joined(*parts[1:])


def _four_bars(poses: Poses, pairs: Pairs, family: str, repair: bool) -> Timed:
    if poses.ordered:
        angles, holds = in_order(pairs.angles, poses.span_max)
        if repair:
            angles = np.where(holds[:, None], angles, put_in_order(pairs.angles, poses.span_max))
    else:
        angles, holds = in_any_order(pairs.angles, poses.span_max)
    keep = np.flatnonzero((holds & pairs.one_branch | repair) & in_family(family, pairs.lengths))
    pairs = pairs.take(keep)
    shape = chart_of(family).unknowns(pairs.lengths)
    return Timed(shape, pairs.pose, pairs.offset, angles[keep], pairs.branch)


def exact_motion(poses: Poses, family: str, tolerance: float, work: Work) -> tuple[Pool, Dyads]:
    """Find the four-bars of a family that guide a body through five and more poses exactly, within milliseconds.

    Returns
    -------
    pool : Pool
        Four-bars of the dyads, refined.
    dyads : Dyads
    """
    body = Body(poses)
    dyads = linear_dyads(body)
    dyads, _ = polished(body, dyads) if dyads.radius.size else (dyads, None)
    starts = four_bars(poses, body, dyads, family, work)
    # five poses have several exact four-bars
    alternatives = np.inf if poses.samples == FEW + 1 else 1.0
    problem = JointProblem(poses, chart_of(family))
    return problem.descended(
        starts, OPTIONS.exact_stages, 0.3 * tolerance, work, steps_after_first=alternatives
    ), dyads


def near_motion(poses: Poses, family: str, dyads: Dyads, tolerance: float, work: Work) -> Pool:
    """Find four-bars of a family near poses that no dyad fits exactly, from dyads all over the body beside some others."""
    body, problem = Body(poses), JointProblem(poses, chart_of(family))
    everywhere, _ = landscape(body, work=work)
    pool = problem.measured(four_bars(poses, body, everywhere.joined(dyads), family, work, repair=True))
    best = pool.best(OPTIONS.refined_pairs)
    return problem.descended(best.timed, OPTIONS.near_stages, 0.3 * tolerance, work).joined(pool)
