"""Dyads that guide a body through poses: a point of the body that stays on a circle.

A dyad is a point m of the body (in its frame), a fixed centre c and a radius r with |P + R m - c| = r at every pose,
R = e^{i gamma}. Written out, with a = conj(P) R and k = conj(m) c, that is linear in eight coefficients::

    [|P|^2, 1, 2 Re a, -2 Im a, -2 Re P, -2 Im P, -2 Re R, -2 Im R] . q = 0
    q = q0 [1, |m|^2 + |c|^2 - r^2, m, c, k],      conj(q_m) q_c = q0 q_k

(Bottema and Roth, Theoretical Kinematics, 1979; Ravani and Roth, J. Mech. Trans. Automation 105 (1983) 460-467; Ge, Purwar,
Zhao, Deshpande, J. Comput. Inf. Sci. Eng. 17 (2017) 031011). The three least right singular vectors of the poses' rows span
what fits them; the two real quadrics leave at most four dyads in that span: exactly those of Burmester for five poses.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.poses import Poses
from synthesis.least_squares import Evaluation, minimise

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FARTHEST = 1e4
"""Points of the body and centres beyond this many length scales are sliders, which are no four-bars."""
_POLISH_STEPS, _POLISH_STALL = 6, 0.1
"""Of dyads that are near: where they fit, two or three steps reach rounding, and the pairs are refined together anyway."""


class Dyads(NamedTuple):
    """Dyads, lengths over the length scale and from the mean position."""

    body: Complexes
    """(n,): m."""
    fixed: Complexes
    """(n,): c."""
    radius: Floats
    """(n,)"""

    def take(self, places: Any) -> Dyads:
        """Some of them."""
        return Dyads(*(column[places] for column in self))

    def joined(self, other: Dyads) -> Dyads:
        """These and others after them."""
        return Dyads(*(np.concatenate(columns) for columns in zip(self, other)))


class Body:
    """The poses that have both parts, as the dyads see them."""

    def __init__(self, poses: Poses) -> None:
        keep = poses.full
        self.position, self.turned = poses.scaled[keep], poses.turned[keep]
        root = [
            np.broadcast_to(mean.root, poses.samples)[keep] for mean in (poses.rotation_mean, poses.position_mean)
        ]
        self.rotation_root, self.position_root = root

    def places(self, body: Complexes) -> Complexes:
        """Where points of the body (n,) are, (n, N)."""
        return self.position + self.turned * body[:, None]

    def with_radius(self, body: Complexes, fixed: Complexes) -> Dyads:
        """Dyads with their mean distance as radius."""
        return Dyads(body, fixed, np.abs(self.places(body) - fixed[:, None]).mean(axis=1))


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
    """Real common points (n, 3) of two conics y' C y = 0; of nearly real ones the real part."""

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
    body: Body, dyads: Dyads, steps: int = _POLISH_STEPS, stall: float = _POLISH_STALL
) -> tuple[Dyads, Floats]:
    """Dyads after least-squares steps of their first-order errors, and those errors, rms, (n,)."""
    columns = [dyads.body.real, dyads.body.imag, dyads.fixed.real, dyads.fixed.imag, dyads.radius]
    start = np.stack(columns, axis=1)
    done = minimise(
        lambda unknowns, _: evaluate_dyads(body, unknowns), start, np.zeros(len(start)), steps, 0.0, None, stall, 1e-8
    )
    x = done.unknowns
    return Dyads(x[:, 0] + 1j * x[:, 1], x[:, 2] + 1j * x[:, 3], x[:, 4]), np.sqrt(done.cost)


def landscape(body: Body, steps: int = 20, most: int = 36) -> tuple[Dyads, Floats]:
    """The best dyads from starts all over the body, different from one another, and their errors; best first.

    A dyad has only two hard unknowns: the point of the body. Centre and radius follow from a circle through its places.
    """
    radius, angle = np.meshgrid(_RADII, np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS), indexing="ij")
    points = np.concatenate([[0j], (radius * np.exp(1j * angle)).ravel()])
    return distinct_dyads(*polished(body, circles(body, points), steps, 1e-9), most)


_RADII = (0.1, 0.25, 0.5, 1.0, 1.8, 3.2, 5.5, 9.0)
_DIRECTIONS = 14


def circles(body: Body, points: Complexes) -> Dyads:
    """Dyads of points of the body (n,): the circle through the places of each by linear least squares (Kasa)."""
    places = body.places(points)
    middle = places.mean(axis=1, keepdims=True)
    rest = places - middle
    rows = np.stack([2 * rest.real, 2 * rest.imag, np.ones(rest.shape)], axis=2)
    solution = np.einsum("nik,nk->ni", np.linalg.pinv(rows, rcond=1e-9), np.abs(rest) ** 2)
    centre = middle[:, 0] + solution[:, 0] + 1j * solution[:, 1]
    return body.with_radius(points, centre)


def distinct_dyads(dyads: Dyads, error: Floats, most: int, apart: float = 0.03) -> tuple[Dyads, Floats]:
    """The best dyads, no two nearer than ``apart`` of their size, sliders left out."""
    kept: list[int] = []
    columns = np.stack([dyads.body, dyads.fixed])
    size = np.maximum(1.0, np.abs(columns).max(axis=0))
    for place in np.argsort(error, kind="stable"):
        if len(kept) == most or not np.isfinite(error[place]):
            break
        near = np.abs(columns[:, kept] - columns[:, place, None]).max(axis=0) < apart * size[place]
        if size[place] < FARTHEST and not near.any():
            kept.append(int(place))
    return dyads.take(kept), error[kept]
