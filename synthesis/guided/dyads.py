"""What leads a body through its poses: points of it that run on circles or rails, and lines of it that run through a pin.

Positions are over the length scale from their mean, P, with R = e^{i gamma}. A point m of the body is at X = P + R m. On a
*rail* it stays on a line of the ground, on a *circle* at a distance from a pivot; a *slot* is a line of the body that a pin c of
the ground stays on. In the inverse motion, (P, R) -> (-conj(R) P, conj(R)), body and ground are exchanged: there a slot is a
rail, and the pin is the point that runs on it. So one set of formulas serves all three, see `Guides`.

Rails need no search. With the normal n of the line, its distance h from the origin and k = conj(m) n, a pose's distance is ::

    n . (Re P, Im P) + [Re R, Im R, -1] . (Re k, Im k, h)

linear but for |n| = 1: with Q the projector off the columns {1, Re R, Im R}, n is the eigenvector of the least eigenvalue of the
2 x 2 matrix (places' Q places), whose value over N is the mean square distance: the least there is. Four poses have exactly one
exact rail, and one exact slot, always; three have one in every direction.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.free.dyads import Body, Dyads


class Guides(NamedTuple):
    """Circles, rails and slots, (n,) each, lengths over the length scale; of a slot everything is of the inverse motion."""

    point: Complexes
    """What runs: a point of the body; of a slot the pin, a point of the ground."""
    foot: Complexes
    """A point of the curve that it runs on, in the ground; of a slot in the body."""
    normal: Floats
    """Direction of the curve's normal there; of a circle towards its centre."""
    curvature: Floats
    """1 / radius; 0 of rails and slots."""
    inverse: Flags
    """Whether it is a slot."""

    def take(self, places: Any) -> Guides:
        """Some of them."""
        return Guides(*(column[places] for column in self))

    def joined(self, *others: Guides) -> Guides:
        """These and others after them."""
        return Guides(*(np.concatenate(columns) for columns in zip(self, *others)))

    @property
    def straight(self) -> Flags:
        """Which are rails or slots."""
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

    @classmethod
    def of(cls, body: Body) -> Self:
        """The poses that have both parts."""
        return cls(body.position, body.turned, body.rotation_root, body.position_root)

    @property
    def inverse(self) -> Motion:
        """The motion of the ground as the body sees it."""
        turned = np.conj(self.turned)
        return self._replace(position=-turned * self.position, turned=turned)

    def places(self, points: Complexes) -> Complexes:
        """Where points (n,) are, (n, N)."""
        return self.position + self.turned * points[:, None]

    @property
    def root(self) -> Floats:
        """Square roots of the weights of a distance."""
        return np.minimum(self.rotation_root, self.position_root)


class Lines(NamedTuple):
    """Points (n,) and the lines that they run on."""

    point: Complexes
    foot: Complexes
    normal: Floats

    def as_guides(self, inverse: bool) -> Guides:
        """Them as rails, or as slots where they are of the inverse motion."""
        count = self.point.size
        return Guides(self.point, self.foot, self.normal, np.zeros(count), np.full(count, inverse))


class Straight:
    """The lines of a motion, from the 2 x 2 form whose least eigenvalue is the best one's error squared."""

    def __init__(self, motion: Motion) -> None:
        self.motion, root = motion, motion.root
        place, turned = motion.position, motion.turned
        self._mean = complex(np.sum(root**2 * turned) / np.sum(root**2))
        off = turned - self._mean
        # small rotations: {1, R} have a condition of one over the span squared, so never normal equations
        columns = np.stack([off.real, off.imag, -np.ones(place.size)], axis=1) * root[:, None]
        self._scale = np.linalg.norm(columns, axis=0)
        self._scale[self._scale == 0] = 1.0
        self._columns = columns / self._scale
        basis: Any = np.linalg.qr(self._columns)[0]
        rest = np.stack([place.real, place.imag], axis=1) * root[:, None]
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        self._rest = rest

    def stationary(self) -> tuple[Lines, Floats]:
        """The best line and, square to it, the worst of its kind; and their rms distances (2,)."""
        _, size, across = np.linalg.svd(self._rest, full_matrices=False)  # eigenvectors of the form, to full accuracy
        return self.along(np.arctan2(across[::-1, 1], across[::-1, 0])), size[::-1]

    def along(self, normals: Floats) -> Lines:
        """The best points and lines of given normals (n,), that is with the least rms distance."""
        motion, root = self.motion, self.motion.root
        n = np.exp(1j * normals)
        across = (np.conj(n)[:, None] * motion.position).real * root
        solved: Any = np.linalg.lstsq(self._columns, -across.T, rcond=1e-14)[0]
        k_real, k_imag, height = solved / self._scale[:, None]
        height = height + self._mean.real * k_real + self._mean.imag * k_imag
        point = np.conj((k_real + 1j * k_imag) / n)
        middle = motion.places(point).mean(axis=1)
        # the foot of the places' mean on the line
        foot = middle + n * (height - (np.conj(n) * middle).real)
        return Lines(point, foot, normals)


def lines_of(motion: Motion, points: Complexes) -> Lines:
    """The line that each point (n,) comes nearest to, by the least rms distance of its places."""
    places = motion.places(points)
    weight = motion.root**2 / np.sum(motion.root**2)
    middle = places @ weight
    rest = places - middle[:, None]
    along = np.angle((rest**2) @ weight) / 2  # the direction of the largest spread
    return Lines(points, middle, along + np.pi / 2)


def as_circles(body: Body, dyads: Dyads) -> Guides:
    """Dyads of two hinges as guides, each with the foot nearest to the middle of its places."""
    middle = body.places(dyads.body).mean(axis=1)
    inward = dyads.fixed - middle
    normal = np.angle(np.where(np.abs(inward) > 1e-12 * dyads.radius, inward, 1.0))
    foot = dyads.fixed - dyads.radius * np.exp(1j * normal)
    return Guides(dyads.body, foot, normal, 1 / dyads.radius, np.zeros(dyads.radius.size, dtype=bool))
