"""Sample four-bars through two, three or four poses, and judge them by closing the loop at many crank angles.

Nothing of the software is imported: centres and body points are drawn, the loop is closed by intersecting two
circles, and a linkage counts if it passes the poses in order on the same branch without opening in between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

STEPS = 24
"""Crank angles at which the loop is closed between the first pose and the last."""


class Task(NamedTuple):
    """Poses of a body and a box for both pivots."""

    position: np.ndarray
    """(N,), complex."""
    rotation: np.ndarray
    """(N,), radians."""
    box: tuple[float, float, float, float]


def random_task(seed: int, poses: int) -> Task:
    """Draw a lid or flap: it turns by 20 to 150 degrees and moves by a distance like its own size, nearly evenly."""
    random = np.random.default_rng([seed, poses])
    turn = np.deg2rad(random.uniform(20, 150)) * random.choice([-1, 1])
    end = random.uniform(0.3, 1.5) * np.exp(1j * random.uniform(-np.pi, np.pi))
    share = np.linspace(0, 1, poses)
    share[1:-1] += random.uniform(-0.1, 0.1, poses - 2)
    bend = 0.3 * random.uniform(-1, 1) * 1j * end * np.sin(np.pi * share)
    width, height = random.uniform(0.5, 2.0, 2)
    corner = end / 2 + complex(*random.uniform(-1.0, 0.2, 2)) - complex(width, height) / 2 * random.uniform(0, 1)
    return Task(
        end * share + bend, turn * share, (corner.real, corner.imag, corner.real + width, corner.imag + height)
    )


class Sampled(NamedTuple):
    """Usable four-bars among the sampled linkages."""

    longest: np.ndarray
    """(n,): longest link."""
    transmission: np.ndarray
    """(n,): smallest transmission angle at the crank angles examined, in radians."""


def sampled_four_bars(task: Task, dyads: int = 60_000, seed: int = 0) -> Sampled:
    """Return the usable four-bars of random pairs of dyads: 35 degrees of transmission angle and links of ratio 10."""
    random = np.random.default_rng(seed)
    turned = np.exp(1j * task.rotation)
    low, high = complex(*task.box[:2]), complex(*task.box[2:])
    centre = random.uniform(low.real, high.real, dyads) + 1j * random.uniform(low.imag, high.imag, dyads)
    if len(turned) == 4:
        centre = random.permutation(_centre_points(task, turned, centre))
    seen = np.conj(turned) * (centre[:, None] - task.position)
    along = seen[:, 1] - seen[:, 0]
    with np.errstate(all="ignore"):
        if len(turned) == 2:
            point = seen[:, 0] + along / 2 + 0.5j * along * np.tan(random.uniform(-1.4, 1.4, dyads))
        else:
            second = seen[:, 2] - seen[:, 0]
            area = 2 * (np.conj(along) * second).imag
            point = seen[:, 0] + 1j * (along * np.abs(second) ** 2 - second * np.abs(along) ** 2) / area
    proper = np.isfinite(point)
    centre, point = centre[proper], point[proper]
    half = centre.size // 2
    return _usable(task, turned, centre[:half], point[:half], centre[half : 2 * half], point[half : 2 * half])


def _centre_points(task: Task, turned: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points of the centre-point curve between pairs of points: where the radii of three and four poses agree."""

    def fault(centre: np.ndarray) -> np.ndarray:
        x1, x2, x3, x4 = (np.conj(turned) * (centre[:, None] - task.position)).T
        return ((x1 - x3) * (x2 - x4) * np.conj((x1 - x4) * (x2 - x3))).imag

    ends = np.array(np.split(points[: points.size // 2 * 2], 2))
    values = np.array([fault(end) for end in ends])
    across = np.sign(values[0]) != np.sign(values[1])
    (low, high), sign = ends[:, across], np.sign(values[0, across])
    for _ in range(60):
        middle = (low + high) / 2
        same = np.sign(fault(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low


def _usable(task, turned, a, m, b, n) -> Sampled:
    pins = [task.position + turned * p[:, None] for p in (m, n)]
    l1, l3 = np.abs(pins[0][:, 0] - a), np.abs(pins[1][:, 0] - b)
    l2, l4 = np.abs(n - m), np.abs(b - a)
    links = np.stack([l1, l2, l3, l4])
    first = np.angle(pins[0] - a[:, None])
    longest, transmission = [np.empty(0)], [np.empty(0)]
    extent = np.abs(task.position[:, None] - task.position).max()
    fits = (links.max(0) <= 10 * links.min(0)) & (links.min(0) >= 0.05 * extent) & (links.max(0) <= 10 * extent)
    side = np.sign((np.conj(b[:, None] - pins[0]) * (pins[1] - pins[0])).imag)
    fits &= np.all(side == side[:, :1], axis=1)
    used = np.zeros(a.size, dtype=bool)
    for sense in (1, -1):
        steps = (sense * np.diff(first, axis=1)) % (2 * np.pi)
        total = steps.sum(axis=1)
        ok = np.flatnonzero(fits & (total < 2 * np.pi) & ~used)
        angle = first[ok, :1] + sense * total[ok, None] * np.linspace(0, 1, STEPS)
        pin = a[ok, None] + l1[ok, None] * np.exp(1j * angle)
        gap = b[ok, None] - pin
        distance = np.abs(gap)
        cosine = (l2[ok, None] ** 2 + l3[ok, None] ** 2 - distance**2) / (2 * l2[ok] * l3[ok])[:, None]
        closes = np.all(np.abs(cosine) < 1, axis=1)
        smallest = np.min(np.arccos(np.clip(np.abs(cosine), 0, 1)), axis=1)
        good = closes & (smallest >= np.deg2rad(35))
        used[ok[good]] = True
        longest.append(links.max(0)[ok[good]])
        transmission.append(smallest[good])
    return Sampled(np.concatenate(longest), np.concatenate(transmission))
