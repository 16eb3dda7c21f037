"""Two, three and four poses: the infinitely many dyads that guide a body exactly, sampled evenly.

Two poses leave the point of the body and one number of its centre free, three leave the point free, four leave one number:
the points whose four places lie on a circle are a cubic curve (Burmester's).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.free.dyads import FARTHEST, Body, Dyads

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def sampled_dyads(body: Body, count: int, random: np.random.Generator) -> Dyads:
    """Dyads (about ``count``) that fit up to four poses exactly; radius from the first pose."""
    poses = body.position.size
    if poses == 4:
        points = _burmester_points(body, count, random)
    else:
        points = np.concatenate([_cloud(count - count // 2, random), _near_poles(body, count // 2, random)])
    points = points[np.abs(points) < FARTHEST]  # a pole is at infinity where two poses have the same rotation
    places = body.places(points)
    centre = _between(places, random) if poses == 2 else _circumcentre(places[:, 0], places[:, 1], places[:, 2])
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
    with np.errstate(divide="ignore", invalid="ignore"):
        pole = (body.position[second] - body.position[first]) / (body.turned[first] - body.turned[second])
    pole = np.where(np.isfinite(pole), pole, np.inf)
    return pole + 10.0 ** random.uniform(-3, 0, count) * np.exp(2j * np.pi * random.uniform(0, 1, count))


def _between(places: Complexes, random: np.random.Generator) -> Complexes:
    """Centres at equal distance from two places, at random along their perpendicular bisector."""
    chord = places[:, 1] - places[:, 0]
    return (places[:, 0] + places[:, 1]) / 2 + 1j * chord * np.tan(random.uniform(-1.4, 1.4, len(places)))


def _circumcentre(p: Complexes, q: Complexes, r: Complexes) -> Complexes:
    """Centres of the circles through three points; not finite where they lie on a line."""
    a, b = q - p, r - p
    with np.errstate(divide="ignore", invalid="ignore"):
        below = 2 * (np.conj(a) * b).imag
        return p + 1j * (a * np.abs(b) ** 2 - b * np.abs(a) ** 2) / below


def _burmester_points(body: Body, count: int, random: np.random.Generator) -> Complexes:
    """Points whose four places lie on a circle: where lines through the body meet Burmester's cubic curve.

    Its equation is Im[(X1 - X3)(X2 - X4) conj((X1 - X4)(X2 - X3))] = 0.
    """
    lines = max(1, count // 2)
    base, along = _cloud(lines, random), np.exp(1j * np.pi * random.uniform(0, 1, lines))
    nodes = np.array([-1.5, -0.5, 0.5, 1.5])
    x = body.places((base[:, None] + along[:, None] * nodes).ravel())
    x1, x2, x3, x4 = x.T
    values = ((x1 - x3) * (x2 - x4) * np.conj((x1 - x4) * (x2 - x3))).imag.reshape(lines, 4)
    cubic = values @ np.linalg.inv(np.vander(nodes)).T
    lead = np.where(np.abs(cubic[:, :1]) > 0, cubic[:, :1], 1e-300)
    companion = np.zeros((lines, 3, 3))
    companion[:, 0] = -cubic[:, 1:] / lead
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    usable = np.all(np.isfinite(companion), axis=(1, 2))
    roots = np.linalg.eigvals(companion[usable])
    for _ in range(2):
        slope = (3 * cubic[usable, :1] * roots + 2 * cubic[usable, 1:2]) * roots + cubic[usable, 2:3]
        value = ((cubic[usable, :1] * roots + cubic[usable, 1:2]) * roots + cubic[usable, 2:3]) * roots + cubic[
            usable, 3:
        ]
        roots = roots - value / np.where(np.abs(slope) > 0, slope, 1.0)
    real = np.abs(roots.imag) < 1e-9 * np.maximum(1.0, np.abs(roots))
    points = base[usable, None] + along[usable, None] * roots.real
    return points[real]
