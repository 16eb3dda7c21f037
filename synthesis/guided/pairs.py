"""Pairs of guides of any kind as functions of their dimensions: poses that they allow, errors, limits and derivatives.

The first guide of a pair is the driven guide. Its *drive* is the angle of a crank, the travel of a slider along its rail, the
extension of a cylinder (a slot whose pin is pushed along it), or the angle of the body (a slot that is turned about its pin).

The pose closest to a given pose that both guides allow is found by Newton steps (Gauss-Helmert): with both distances e, their
derivatives B by (gamma, x, y) and the weights W of the pose ::

    S = B W^-1 B' = L L',   corrected = given - W^-1 B' S^-1 (e + B (given - corrected)),   rows L^-1 e of the least squares

so that the square of the rows is the square of the weighted correction. Branch and drive do not enter; they are limits. The
derivatives of the poses by the dimensions, -W^-1 B' S^-1 de, omit terms of the order of the correction times a curvature.

There are ten unknowns: for each guide the moving point m, the direction b and offset s of the normal of the curve at a constant
foot O, and the curvature k, which is missing for a rail or slot. A point Y = X - O - s e^{i b} has from the curve the distance ::

    F = k |Y|^2 / 2 - Re(e^{-ib} Y),   w = sqrt(1 + 2 k F),   distance = 2 F / (1 + w),   n = (k Y - e^{ib}) / w

A rail is the centre of this chart, k = 0, not its boundary: circles with a radius of 1e8 lengths keep full precision.

If the drive is given, three equations determine a pose: both distances and the drive. The rows are the weighted differences from
the given poses, and an eleventh unknown is the drive at the first sample. If the drive does not reach its value, the closest
pose that the guides allow is used, with a row for the missing part of the drive.

Within limits c >= 0 the cost is J squared plus rho sum min(0, c)^2, whose weight rho increases from stage to stage. The limits
are evaluated at the corrected poses with the derivatives above. `synthesis.kernels.pair_rows` computes both.

*Guides* lead a body through its poses: points of the body that move on circles or rails, and lines of the body that pass through
a pin.

Positions are measured from their mean and divided by the length scale, P, with R = e^{i gamma}. A point m of the body is at
X = P + R m. On a *rail* it stays on a line of the ground, on a *circle* at a constant distance from a pivot; a *slot* is a line
of the body that contains a pin c of the ground. In the inverse motion, (P, R) -> (-conj(R) P, conj(R)), body and ground
are exchanged: there a slot is a rail, and the pin is the point that moves on it. So the same formulas hold for all three, see
`Guides`.


 Rails need no search. With the normal n of the line, its distance h from the origin and k = conj(m) n, the distance of a pose is
 ::

    n . (Re P, Im P) + [Re R, Im R, -1] . (Re k, Im k, h)

which is linear except for |n| = 1: with Q the projector that removes the columns {1, Re R, Im R}, n is the eigenvector of the
smallest eigenvalue of the 2 x 2 matrix (positions' Q positions), and this eigenvalue over N is the smallest mean square distance.
Four poses always have exactly one exact rail and one exact slot; three poses have one in every direction.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats, rows_at, rows_of_all
from synthesis.free.dyads import Body, Dyads
from synthesis.kernels import pair_rows
from synthesis.least_squares import Evaluation, minimise
from synthesis.limits import REACH, Limits, Reach
from synthesis.mechanism import Box
from synthesis.poses import Poses
from synthesis.work import Work


class Guides(NamedTuple):
    """Circles, rails and slots, (n,) each, lengths over the length scale; of a slot everything is of the inverse motion."""

    point: Complexes
    """Moving point: a point of the body; for a slot the pin, a point of the ground."""
    foot: Complexes
    """A point of the curve that it runs on, in the ground; of a slot in the body."""
    normal: Floats
    """Direction of the curve's normal there; of a circle towards its centre."""
    curvature: Floats
    """1 / radius; 0 of rails and slots."""
    inverse: Flags
    """True for a slot."""

    def take(self, indices: Any) -> Guides:
        """Select guides."""
        return rows_at(self, indices)

    def joined(self, *following: Guides) -> Guides:
        """Return these guides followed by others."""
        return rows_of_all(self, *following)

    @property
    def straight(self) -> Flags:
        """Return flags of rails and slots."""
        return self.curvature == 0

    @property
    def centre(self) -> Complexes:
        """Centres of the circles; of the others the foot."""
        bent = np.where(self.straight, 1.0, self.curvature)
        return np.where(self.straight, self.foot, self.foot + np.exp(1j * self.normal) / bent)


class Motion(NamedTuple):
    """Poses as guides see them, (N,): P, R, and square roots of the weights of rotation and position."""

    position: Complexes
    turned: Complexes
    rotation_root: Floats
    position_root: Floats
    inverted: bool = False

    @classmethod
    def of(cls, body: Body) -> Self:
        """The poses that have both parts."""
        return cls(body.position, body.turned, body.rotation_root, body.position_root)

    @property
    def inverse(self) -> Motion:
        """The motion of the ground as the body sees it."""
        turned = np.conj(self.turned)
        return self._replace(position=-turned * self.position, turned=turned, inverted=not self.inverted)

    def positions(self, points: Complexes) -> Complexes:
        """Return the positions (n, N) of points (n,)."""
        return self.position + self.turned * points[:, None]

    @property
    def root(self) -> Floats:
        """Square roots of the weights of a distance."""
        return np.minimum(self.rotation_root, self.position_root)

    def lines(self, point: Complexes, foot: Complexes, normal: Floats) -> Guides:
        """Points (n,) and the lines that they run on as rails, or as slots where the motion is inverted."""
        return Guides(point, foot, normal, np.zeros(point.size), np.full(point.size, self.inverted))


class Straight:
    """Lines of a motion, from the 2 x 2 form whose smallest eigenvalue is the smallest squared error."""

    def __init__(self, motion: Motion) -> None:
        self.motion, root = motion, motion.root
        position, turned = motion.position, motion.turned
        self._mean = complex(np.sum(root**2 * turned) / np.sum(root**2))
        off = turned - self._mean
        # for small rotations {1, R} have a condition of one over the squared span, so normal equations are avoided
        columns = np.stack([off.real, off.imag, -np.ones(position.size)], axis=1) * root[:, None]
        self._scale = np.linalg.norm(columns, axis=0)
        self._scale[self._scale == 0] = 1.0
        self._columns = columns / self._scale
        basis: Any = np.linalg.qr(self._columns)[0]
        residual = np.stack([position.real, position.imag], axis=1) * root[:, None]
        for _ in range(2):
            residual = residual - basis @ (basis.T @ residual)
        self._rest = residual

    def stationary(self) -> tuple[Guides, Floats]:
        """The best line and, square to it, the worst of its kind; and their rms distances (2,)."""
        _, size, across = np.linalg.svd(self._rest, full_matrices=False)  # eigenvectors of the form, to full accuracy
        return self.along(np.arctan2(across[::-1, 1], across[::-1, 0])), size[::-1]

    def along(self, normals: Floats) -> Guides:
        """The best points and lines of given normals (n,), that is with the least rms distance."""
        motion, root = self.motion, self.motion.root
        n = np.exp(1j * normals)
        across = (np.conj(n)[:, None] * motion.position).real * root
        solved: Any = np.linalg.lstsq(self._columns, -across.T, rcond=1e-14)[0]
        k_real, k_imag, height = solved / self._scale[:, None]
        height = height + self._mean.real * k_real + self._mean.imag * k_imag
        point = np.conj((k_real + 1j * k_imag) / n)
        middle = motion.positions(point).mean(axis=1)
        # the foot of the places' mean on the line
        foot = middle + n * (height - (np.conj(n) * middle).real)
        return motion.lines(point, foot, normals)


def lines_of(motion: Motion, points: Complexes) -> Guides:
    """The line that each point (n,) comes nearest to, by the least rms distance of its places."""
    moved = motion.positions(points)
    weight = motion.root**2 / np.sum(motion.root**2)
    middle = moved @ weight
    offsets = moved - middle[:, None]
    along = np.angle((offsets**2) @ weight) / 2  # the direction of the largest spread
    return motion.lines(points, middle, along + np.pi / 2)


def as_circles(body: Body, dyads: Dyads) -> Guides:
    """Dyads of two hinges as guides, each with the foot nearest to the middle of its places."""
    middle = body.positions(dyads.body).mean(axis=1)
    inward = dyads.fixed - middle
    normal = np.angle(np.where(np.abs(inward) > 1e-12 * dyads.radius, inward, 1.0))
    foot = dyads.fixed - dyads.radius * np.exp(1j * normal)
    return Guides(dyads.body, foot, normal, 1 / dyads.radius, np.zeros(dyads.radius.size, dtype=bool))


# -- pairs ----------------------------------------------------------------------------------------------------------------


OWN = 5
"""Unknowns of a guide: m (2), b, s, k."""
_UNKNOWN = 1e10
"""Inverse weight of a missing component of a sample; its correction starts again at each step."""


class Pairs(NamedTuple):
    """Pairs of guides; the first guide is driven."""

    first: Guides
    second: Guides
    hinge: Flags
    """(n,): whether the first, a slot, is turned about its pin; otherwise its pin is pushed along it."""

    @property
    def guides(self) -> tuple[Guides, Guides]:
        """Both."""
        return self.first, self.second

    def take(self, indices: Any) -> Pairs:
        """Select pairs."""
        return rows_at(self, indices)

    def joined(self, *following: Pairs) -> Pairs:
        """Return these pairs followed by others."""
        return rows_of_all(self, *following)

    @property
    def number(self) -> int:
        """Number of pairs."""
        return self.hinge.size


class Samples(NamedTuple):
    """Given poses (N,) and what their corrections cost."""

    angle: Floats
    position: Complexes
    rotation_variance: Floats
    """1 / weight of the rotation; a very large number if it is missing."""
    position_variance: Floats
    rotation_missing: Flags
    position_missing: Flags
    drive: Floats
    """Drive from the first sample, if it is given: radians, or a length over the length scale."""

    @classmethod
    def of(cls, poses: Poses, drive: Floats | None = None) -> Samples:
        """Return the samples of a request, divided by its length scale and measured from its mean position."""
        rotation = poses.rotation if poses.rotation is not None else np.zeros(poses.samples)
        assert poses.position is not None
        roots = [
            np.broadcast_to(mean.root, poses.samples) if part is not None else np.zeros(poses.samples)
            for mean, part in ((poses.rotation_mean, poses.rotation), (poses.position_mean, poses.position))
        ]
        missing = [root == 0 for root in roots]
        variances = [
            np.where(gone, _UNKNOWN, 1 / np.where(gone, 1.0, root) ** 2) for gone, root in zip(missing, roots)
        ]
        position = (poses.position - poses.middle) / poses.length_scale
        travel = np.zeros(poses.samples) if drive is None else drive
        return cls(
            np.asarray(rotation, dtype=float), position, variances[0], variances[1], missing[0], missing[1], travel
        )

    @property
    def number(self) -> int:
        """Number of candidates."""
        return self.angle.size


class Chart:
    """The unknowns (n, 10) of pairs, about the pairs that they begin at."""

    def __init__(self, pairs: Pairs) -> None:
        self.pairs = pairs
        self.bent = [np.maximum(1.0, np.abs(pair.curvature)) for pair in pairs[:2]]
        """Unit of each curvature."""

    @property
    def start(self) -> Floats:
        """The unknowns of the pairs themselves."""
        columns = []
        for pair, unit in zip(self.pairs[:2], self.bent):
            columns += [
                pair.point.real,
                pair.point.imag,
                pair.normal,
                np.zeros(pair.normal.size),
                pair.curvature / unit,
            ]
        return np.stack(columns, axis=1)

    @property
    def labels(self) -> Floats:
        """Constants of each candidate beside its unknowns, (n, 11)."""
        columns: list[Any] = [self.pairs.hinge]
        for pair, unit in zip(self.pairs[:2], self.bent):
            columns += [pair.foot.real, pair.foot.imag, unit, pair.inverse, pair.straight]
        return np.stack([np.asarray(column, dtype=float) for column in columns], axis=1)

    def pairs_at(self, unknowns: Floats) -> Pairs:
        """Pairs of unknowns."""
        guides = []
        for k, (pair, unit) in enumerate(zip(self.pairs[:2], self.bent)):
            x = unknowns[:, OWN * k : OWN * (k + 1)]
            foot = pair.foot + x[:, 3] * np.exp(1j * x[:, 2])
            curvature = np.where(pair.straight, 0.0, x[:, 4] * unit)
            guides.append(Guides(x[:, 0] + 1j * x[:, 1], foot, x[:, 2], curvature, pair.inverse))
        return Pairs(guides[0], guides[1], self.pairs.hinge)


class Looked(NamedTuple):
    """Candidates (n,) at the poses that they allow."""

    cost: Floats
    """J squared; infinite if the pair does not close."""
    closed: Flags
    """True if the pair closes at all poses."""
    worst: Floats
    """The most by which a limit is broken; the order of the samples apart."""
    merit: Floats
    """Mean squares of violations, at most 1 each, summed over the limits."""
    excess: Floats
    """Sum of the squares."""
    sines: Floats
    """Sum of the sines of the transmission angle: their sign is the branch."""
    gone: Floats
    """Way of the drive from the first sample to the last."""
    extension: Floats
    """Mean length of a cylinder, with its sign."""
    poses: Floats
    """(n, N, 3): rotation and position."""
    drive: Floats
    """(n, N): coordinate of the drive, an angle modulo a turn, or a way over the length scale."""


class Stage(NamedTuple):
    """A part of a descent."""

    steps: int
    weight: float
    """Weight rho of violated limits against J squared; 0 without limits."""
    sweeps: int
    """Newton's steps of each pose."""
    stall: float = 3e-4
    """Relative decrease of the cost below which a step is the last one of a candidate."""
    damping: float = 1e-2


_NUMBERS = (
    "arm_min", "stroke_max", "link_max", "link_min", "link_ratio_max", "coupler_radius_max", "cylinder_extended_max",
)  # fmt: skip


def numbers_of(limits: Limits, poses: Poses, timed: bool) -> dict[str, Any]:
    """Return the limits of a request for `pair_rows.PairRows`; each value is at least 0 if the limit is satisfied.

    Lengths are divided by the length scale, positions are measured from the mean position. ``timed``: True if the drive, and with
    it the order, is given.
    """
    own, nowhere = limits.relative(poses.middle, poses.length_scale), complex(np.nan, np.nan)
    reach = own.pivot_reach or Reach(0j, None, None)

    def box(sides: Box | None) -> Floats:
        return np.full(4, np.nan) if sides is None else np.array(sides)

    pivots = [nowhere if pivot is None else pivot for pivot in (own.pivot_a, own.pivot_b)]
    crank, coupler, _, ground = own.links
    return {
        "transmission": own.transmission_angle_min,
        "ordered": poses.ordered and not timed,
        "span_max": poses.span_max,
        "crank": crank,
        "coupler": coupler,
        "ground": ground,
        **{name: getattr(own, name) for name in _NUMBERS},
        "cylinder_dead_length": own.dead_length,
        "pivots": np.array(pivots).view(float).reshape(2, 2),
        "pivot_boxes": np.stack([box(own.box("pivot_a_box")), box(own.box("pivot_b_box"))]),
        "reach_middle": reach.middle,
        "reaches": np.array([np.nan if radius is None else radius for radius in (reach.pivot_a, reach.pivot_b)]),
        "rail_boxes": np.stack([box(own.rail_box_of("pivot_a")), box(own.rail_box_of("pivot_b"))]),
        "far": None if own.pivot_reach is None else REACH * poses.extent / poses.length_scale,
        "envelope": box(own.envelope),
        "keep_out": np.array([box(out) for out in own.keep_out]).reshape(-1, 4),
    }


class Problem:
    """Samples and limits of a request made ready for many candidates; ``driven``: whether the drive is given."""

    def __init__(self, samples: Samples, limits: Limits, poses: Poses, driven: bool) -> None:
        self.samples = samples
        columns = [samples.angle, samples.position.real, samples.position.imag, *samples[2:]]
        table = np.ascontiguousarray(np.stack(columns, axis=1), dtype=float)
        self._kernel = pair_rows.PairRows(table, numbers_of(limits, poses, driven), driven)

    def look(
        self, chart: Chart, labels: Floats, sweeps: int, start: Floats | None = None, bounded: bool = True
    ) -> Looked:
        """Evaluate candidates without a descent; ``start`` (n,): drive at the first sample, if it is given."""
        table, poses, drive = self._kernel.evaluate_candidates(
            _with(chart, start), _joined(chart, labels), sweeps, bounded
        )
        cost, closed, worst, merit, excess, sines, gone, extension = table.T
        return Looked(cost, closed > 0, worst, merit, excess, sines, gone, extension, poses, drive)

    def descended(
        self, chart: Chart, labels: Floats, stage: Stage, work: Work, start: Floats | None = None
    ) -> tuple[Pairs, Floats]:
        """Run a descent; return pairs and drive at the first sample (n,); unchanged candidates if the time is over.

        ``labels`` (n, 3): branch, direction of the drive, and direction along which the drive is measured.
        """

        def evaluate(unknowns: Floats, labels: Floats) -> Evaluation:
            return Evaluation(*self._kernel.linearise(unknowns, labels, stage.weight, stage.sweeps))

        found = minimise(
            evaluate,
            _with(chart, start),
            _joined(chart, labels),
            stage.steps,
            work=work,
            stall=stage.stall,
            damping=stage.damping,
        )
        return chart.pairs_at(found.unknowns), found.unknowns[:, -1]


def _with(chart: Chart, start: Floats | None) -> Floats:
    return chart.start if start is None else np.concatenate([chart.start, start[:, None]], axis=1)


def _joined(chart: Chart, labels: Floats) -> Floats:
    return np.concatenate([chart.labels, labels], axis=1)
