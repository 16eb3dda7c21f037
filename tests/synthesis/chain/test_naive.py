"""The chain against slow and obviously right twins: points of a path and bracketing search, no closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from synthesis.chain import crescent as chain
from synthesis.chain.closure import Chain, closing_links
from synthesis.chain.report import report, wheel_conflict
from synthesis.chain.track import Segment, Track, arc, line


class Path:
    """A closed path of ("arc", cx, cy, r, start, sweep) and ("line", x0, y0, x1, y1), by arc length."""

    def __init__(self, parts):
        self.parts = parts
        lengths = [
            part[3] * abs(part[5]) if part[0] == "arc" else math.hypot(part[3] - part[1], part[4] - part[2])
            for part in parts
        ]
        self.ends = np.cumsum(lengths)
        self.total = float(self.ends[-1])

    def point(self, s):
        s = s % self.total
        index = min(int(np.searchsorted(self.ends, s, side="right")), len(self.parts) - 1)
        t = s - (self.ends[index - 1] if index else 0.0)
        part = self.parts[index]
        if part[0] == "arc":
            _, cx, cy, r, start, sweep = part
            angle = start + math.copysign(t / r, sweep)
            return cx + r * math.cos(angle), cy + r * math.sin(angle)
        _, x0, y0, x1, y1 = part
        length = math.hypot(x1 - x0, y1 - y0)
        return x0 + (x1 - x0) * t / length, y0 + (y1 - y0) * t / length

    def points(self, s):
        return np.array([self.point(value) for value in np.atleast_1d(s)])

    def next(self, s, pitch, direction=1, cells=48):
        """First place ahead one pitch away: first change of sign on a grid that starts at one pitch, then brentq."""
        x, y = self.point(s)

        def excess(u):
            px, py = self.point(s + direction * u)
            return math.hypot(px - x, py - y) - pitch

        # No place is nearer along the path than one pitch; the search ends after one lap.
        u, width = 0.999999 * pitch, pitch / cells
        while u < self.total:
            if excess(u + width) >= 0:
                return s + direction * brentq(excess, u, u + width, xtol=1e-300, rtol=8.9e-16)
            u += width
        raise LookupError("no point")

    def after(self, s, pitch, links, direction=1):
        for _ in range(links):
            s = self.next(s, pitch, direction)
        return s


def crescent(r0, r1, r2, b):
    """The crescent's path from the joint of the upper arc with the left wheel."""
    c, a = r1 + r0, r2 - r0
    cy = (c * c + b * b - a * a) / (2 * b)
    cx = math.sqrt(c * c - cy * cy)
    xi, eps = math.atan2(b - cy, cx), math.atan2(cy, cx)
    return Path(
        [
            ("arc", -cx, cy, r0, -eps, math.pi + xi + eps),
            ("arc", 0.0, b, r2, math.pi + xi, math.pi - 2 * xi),
            ("arc", cx, cy, r0, -xi, math.pi + xi + eps),
            ("arc", 0.0, 0.0, r1, eps, -(math.pi + 2 * eps)),
        ]
    )


def stadium(radius, straight):
    h = straight / 2
    return Path(
        [
            ("arc", h, 0.0, radius, -math.pi / 2, math.pi),
            ("line", h, radius, -h, radius),
            ("arc", -h, 0.0, radius, math.pi / 2, math.pi),
            ("line", -h, -radius, h, -radius),
        ]
    )


def overrun(path, pitch, links, s):
    return path.after(s, pitch, links) - s - path.total


def least_overrun(path, pitch, links, period, cells=48):
    """Smallest overrun over a period: a grid, then bounded minimization around its lowest points."""
    grid = np.linspace(0, period, cells + 1)
    values = np.array([overrun(path, pitch, links, s) for s in grid])
    best = values.min()
    for index in np.argsort(values)[:3]:
        low, high = grid[index] - period / cells, grid[index] + period / cells
        found = minimize_scalar(
            lambda s: overrun(path, pitch, links, s), bounds=(low, high), method="bounded", options={"xatol": 1e-6}
        )
        best = min(best, found.fun)
    return float(best)


def free_pin(path, pitch, links, k, s, side_of):
    """P_k between P_(k-1) and P_(k+1): the intersection of two circles that is further from the point ``side_of``."""
    a = np.array(path.point(path.after(s, pitch, k - 2)))
    b = np.array(path.point(path.after(s, pitch, links - k, -1)))
    half = (b - a) / 2
    h = math.hypot(*half)
    normal = np.array([-half[1], half[0]]) / h * math.sqrt(pitch * pitch - h * h)
    candidates = [a + half + normal, a + half - normal]
    return max(candidates, key=lambda p: math.hypot(*(p - side_of)))


def track_of(path):
    """The same path for the code under test."""
    return Track([arc(*part[1:]) if part[0] == "arc" else line(*part[1:]) for part in path.parts])


def rounded_polygon(rng):
    """A convex polygon with its corners rounded: lines and arcs of one radius, in any place."""
    corners = int(rng.integers(3, 8))
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    while np.any(np.diff(np.append(angles, angles[0] + 2 * np.pi)) > 0.9 * np.pi):
        angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    centres = rng.uniform(-1e3, 1e3, 2) + 300 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    radius = rng.uniform(40, 90)
    parts = []
    edges = np.roll(centres, -1, axis=0) - centres
    headings = np.arctan2(edges[:, 1], edges[:, 0])
    for index, (centre, edge, heading) in enumerate(zip(centres, edges, headings)):
        right = radius * np.array([np.sin(heading), -np.cos(heading)])
        parts.append(("line", *(centre + right), *(centre + right + edge)))
        sweep = (headings[(index + 1) % corners] - heading) % (2 * np.pi)
        parts.append(("arc", *centres[(index + 1) % corners], radius, heading - np.pi / 2, sweep))
    return Path(parts)


def random_path(rng):
    kind = rng.integers(3)
    if kind == 0:
        return stadium(rng.uniform(40, 120), rng.uniform(50, 500))
    if kind == 1:
        r0, r1, xi = rng.uniform(40, 150), rng.uniform(80, 300), rng.uniform(0.05, 1.2)
        r2 = r0 + (r0 + r1) / math.cos(xi) * rng.uniform(0.995, 1.005)
        return crescent(r0, r1, r2, (r0 + r1) * math.tan(xi))
    return rounded_polygon(rng)


@pytest.mark.parametrize("seed", range(60))
def test_600_steps_agree_with_bracketing_search(seed) -> None:
    rng = np.random.default_rng(seed)
    path = random_path(rng)
    track = track_of(path)
    pitch = rng.uniform(15, 75)
    place = track.place(rng.uniform(0, track.total))
    s = float(track.position(place)[0])
    ours, theirs = [], []
    direction = 1 if seed % 3 else -1
    for _ in range(600):
        place = track.step(place, pitch, direction)
        s = path.next(s, pitch, direction, cells=4)
        ours.append(float(track.position(place)[0]))
        theirs.append(s)
    assert np.abs(np.array(ours) - theirs).max() < 1e-9
    assert np.abs(track.points(place) - path.point(s)).max() < 1e-9


# Unseen sizes: pitch, links, upper radius, wheel radius (None: four pins a turn).
UNSEEN = [
    (100.0, 16, 140.0, None),
    (25.4, 24, 70.0, None),
    (60.0, 21, 120.0, 55.0),
    (1.5, 12, 1.3, 0.9),
    (500.0, 19, 900.0, 420.0),
]


@pytest.mark.parametrize(("pitch", "links", "upper", "wheel"), UNSEEN)
def test_unseen_sizes_agree_with_bracketing_search(pitch, links, upper, wheel) -> None:
    ours, slot = chain.crescent_slot(pitch, links, upper, wheel)
    wheel = ours.wheel_radius
    tolerance = 1e-6 * pitch
    period = wheel * 2 * math.asin(pitch / (2 * wheel))

    def least(xi):
        b = (wheel + upper) * math.tan(xi)
        r2 = wheel + (wheel + upper) / math.cos(xi)
        return least_overrun(crescent(wheel, upper, r2, b), pitch, links, period, cells=20)

    near = ours.xi
    xi = brentq(least, near - 1e-3, near + 1e-3, xtol=1e-12)
    r2, b = wheel + (wheel + upper) / math.cos(xi), (wheel + upper) * math.tan(xi)
    assert ours.lower_radius == pytest.approx(r2, abs=tolerance)
    assert ours.eccentricity == pytest.approx(b, abs=tolerance)

    path = crescent(wheel, upper, ours.lower_radius, ours.eccentricity)
    phases = np.linspace(slot.start, slot.end, 13)
    # Phases beyond the wheel's end are those of the pin that follows.
    on_wheel = [(s, 0) if s <= path.ends[0] else (s - period, 1) for s in phases]
    origin = np.zeros(2)
    expected = [free_pin(path, pitch, links, slot.free + shift, s, origin) for s, shift in on_wheel]
    assert np.abs(slot.path(phases) - expected).max() < tolerance
    facts = report(slot, phases)
    depths = np.hypot(*np.array(expected).T) - upper
    assert facts.depth_max.value >= depths.max() - tolerance
    assert facts.end_step < tolerance

    # The smallest curvature radius, by differences inside each smooth piece, up to its ends.
    h = 2e-5 * period
    pieces = [(a, c) for a, c in zip(slot.breaks[:-1], slot.breaks[1:]) if c - a > 20 * h]
    dense = np.concatenate([np.linspace(a + 2 * h, c - 2 * h, 401) for a, c in pieces])
    before, at, after = (slot.path(dense + step) for step in (-h, 0, h))
    v, a = (after - before) / (2 * h), (after - 2 * at + before) / h**2
    radius = np.hypot(*v.T) ** 3 / np.abs(v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0])
    assert facts.radius_min == pytest.approx(radius.min(), rel=2e-3)


@pytest.mark.parametrize("seed", range(12))
def test_closing_links_is_the_smallest_number_that_is_not_stretched(seed) -> None:
    rng = np.random.default_rng(1000 + seed)
    path, pitch = random_path(rng), rng.uniform(30, 75)
    first = path.parts[0]
    length = path.ends[0]
    if first[0] == "line" or length < 1.05 * 2 * first[3] * math.asin(pitch / (2 * first[3])):
        pitch = 0.4 * min(length, 75)
    track = track_of(path)
    links = closing_links(track, pitch)
    period = Chain(track, pitch, links).period
    least = least_overrun(path, pitch, links, period, cells=12)
    assert Chain(track, pitch, links).least_overrun().value == pytest.approx(least, abs=1e-7 * pitch)
    assert least >= -1.1e-6 * pitch
    assert least_overrun(path, pitch, links - 1, period, cells=12) < 0


def test_wheel_conflict_by_the_angles_of_the_pins() -> None:
    crescent_, slot = chain.crescent_slot(131, 16, 181.78)
    phases = np.linspace(slot.start, slot.end, 2001)
    pins = slot.pins(phases)
    r0, centre = crescent_.wheel_radius, crescent_.upper_radius + crescent_.wheel_radius
    # The pins on the right wheel, wherever they are: all mark the same angle modulo one link, 90 deg.
    relative = pins - [centre, 0.0]
    on = (np.abs(np.hypot(relative[..., 0], relative[..., 1]) - r0) < 1e-9) & (relative[..., 0] > -r0 + 1e-6)
    angle = np.where(on, np.arctan2(relative[..., 1], relative[..., 0]), np.nan)
    lead = np.nanmax(np.where(on, (angle - phases[:, None] / r0) % (np.pi / 2), np.nan), axis=1)
    lead = np.unwrap(lead, period=np.pi / 2)
    assert np.ptp(lead) == pytest.approx(wheel_conflict(slot, chain.RIGHT_WHEEL).value * np.pi / 2, abs=1e-6)


def test_a_narrow_hairpin_takes_the_first_place_not_another() -> None:
    """The pitch exceeds the hairpin's width: the far run is nearer than the place ahead on the same run."""
    path = stadium(10.0, 200.0)
    track = track_of(path)
    for s in np.linspace(0, path.total, 57):
        for direction in (1, -1):
            ours = track.position(track.step(track.place(s), 35.0, direction))[0]
            assert ours == pytest.approx(path.next(s, 35.0, direction, cells=200), abs=1e-9)


def test_a_track_in_meanders_agrees_with_bracketing_search() -> None:
    """Arcs of both senses and more than half a turn."""
    r = 50.0
    lobes = 5
    ring = 2 * r / (2 * math.sin(math.pi / lobes))
    centres = [ring * np.array([math.cos(a), math.sin(a)]) for a in 2 * np.pi * np.arange(lobes) / lobes]
    # Inner arcs of radius rho touch two neighbouring lobes from outside.
    rho = 30.0
    apart = math.hypot(*(centres[1] - centres[0])) / 2
    # Move the lobes apart so that there is room between them.
    scale = 1.3
    centres = [scale * c for c in centres]
    apart *= scale
    far = scale * ring * math.cos(math.pi / lobes) + math.sqrt((r + rho) ** 2 - apart**2)
    parts = []
    for index in range(lobes):
        here, there = centres[index], centres[(index + 1) % lobes]
        middle = 2 * math.pi * (index + 0.5) / lobes
        before = 2 * math.pi * (index - 0.5) / lobes
        dip = far * np.array([math.cos(middle), math.sin(middle)])
        dip_before = far * np.array([math.cos(before), math.sin(before)])
        a0 = math.atan2(*(dip_before - here)[::-1])
        a1 = math.atan2(*(dip - here)[::-1])
        parts.append(("arc", *here, r, a0, (a1 - a0) % (2 * math.pi)))
        b0, b1 = math.atan2(*(here - dip)[::-1]), math.atan2(*(there - dip)[::-1])
        parts.append(("arc", *dip, rho, b0, -((b0 - b1) % (2 * math.pi))))
    path = Path(parts)
    track = track_of(path)
    for s in np.linspace(0, path.total, 41):
        for pitch in (5.0, 33.0, 55.0):
            ours = track.position(track.step(track.place(s), pitch))[0]
            assert ours == pytest.approx(path.next(s, pitch, cells=100), abs=1e-9)


def test_segments_of_the_crescent_are_those_of_the_twin() -> None:
    track = chain.given_crescent(92.63, 181.78, 381.5, 90.22).track
    path = crescent(92.63, 181.78, 381.5, 90.22)
    assert track.total == pytest.approx(path.total, rel=1e-14)
    s = np.linspace(0, path.total, 100, endpoint=False)
    assert np.abs(track.points(track.place(s)) - path.points(s)).max() < 1e-11
    assert isinstance(track.segments[0], Segment)
