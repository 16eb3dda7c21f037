"""Follow a body on two guides step by step in rotation and position, by predictor and corrector.

Only the conditions of the guides are shared with the product, and no formula: not poses, branches, circuits or
coordinates that close.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from synthesis.guides import Circle, Driver, Guide, Rail
from synthesis.linkage import Linkage

STEP = 0.01
"""Length of a step, in radians and in lengths relative to unity plus the distance from the origin."""
MOST_STEPS = 4000
DISTANT = 300.0
"""Beyond this distance from the origin a way counts as endless."""


def condition(guide: Guide, pose: np.ndarray) -> tuple[float, np.ndarray]:
    """g and its derivatives by (gamma, x, y) at a pose (3,)."""
    turned = np.exp(1j * pose[0])
    arm = turned * guide.body_point
    point = complex(pose[1], pose[2]) + arm
    if isinstance(guide, Circle):
        spoke = point - guide.pivot
        push = spoke / abs(spoke)
        return abs(spoke) - guide.radius, np.array([np.real(np.conj(push) * 1j * arm), push.real, push.imag])
    if isinstance(guide, Rail):
        push = 1j * np.exp(1j * guide.direction)
        value = np.real(np.conj(push) * (point - guide.point))
        return value, np.array([np.real(np.conj(push) * 1j * arm), push.real, push.imag])
    push = 1j * turned * np.exp(1j * guide.body_direction)
    gap = guide.pin - point
    turning = np.real(np.conj(1j * push) * gap) - np.real(np.conj(push) * 1j * arm)
    return np.real(np.conj(push) * gap), np.array([turning, -push.real, -push.imag])


def drive_of(linkage: Linkage, pose: np.ndarray) -> float:
    """Return the coordinate of the drive, angles within a turn."""
    guide = linkage.guides[0]
    point = complex(pose[1], pose[2]) + np.exp(1j * pose[0]) * guide.body_point
    if isinstance(guide, Circle):
        return float(np.angle(point - guide.pivot))
    if isinstance(guide, Rail):
        return float(np.real(np.exp(-1j * guide.direction) * (point - guide.point)))
    if linkage.driver is Driver.HINGE:
        return float(pose[0])
    return float(np.real(np.exp(-1j * (pose[0] + guide.body_direction)) * (guide.pin - point)))


def _equations(linkage: Linkage, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    both = [condition(guide, pose) for guide in linkage.guides]
    return np.array([value for value, _ in both]), np.array([slopes for _, slopes in both])


def _scale(pose: np.ndarray) -> np.ndarray:
    size = 1 + np.hypot(pose[1], pose[2])
    return np.array([1.0, size, size])


def walk(linkage: Linkage, start: np.ndarray, sense: int) -> tuple[np.ndarray, bool]:
    """Return poses (n, 3) from a start in a direction, and true if they come back to it."""
    poses, tangent = [start], None
    for number in range(MOST_STEPS):
        pose = poses[-1]
        scale = _scale(pose)
        slopes = _equations(linkage, pose)[1] * scale
        direction = np.cross(*slopes)
        direction /= np.linalg.norm(direction)
        direction *= sense if tangent is None else np.sign(direction @ tangent)
        tangent = direction
        reached = pose + STEP * direction * scale
        for _ in range(4):
            values, slopes = _equations(linkage, reached)
            slopes = slopes * scale
            reached = reached - scale * (slopes.T @ np.linalg.solve(slopes @ slopes.T, values))
        if np.hypot(reached[1], reached[2]) > DISTANT:
            break
        if number > 20 and _apart(reached, start) < 0.6 * STEP:
            return np.array(poses), True
        poses.append(reached)
    return np.array(poses), False


def _apart(first: np.ndarray, second: np.ndarray) -> float:
    gap = (first - second) / _scale(second)
    gap[0] = np.angle(np.exp(1j * gap[0]))
    return float(np.linalg.norm(gap))


@dataclass(frozen=True)
class Course:
    """Result of following a linkage from its first sample."""

    circuit: bool
    """True if all samples were met, whichever direction the drive moved."""
    driven: bool
    """True if the drive passes them in their order, moving in the same direction."""


def follow(linkage: Linkage, samples: np.ndarray) -> Course:
    """``samples`` (N, 3): poses that keep both guides."""
    ahead, round_trip = walk(linkage, samples[0], 1)
    behind = ahead[:1] if round_trip else walk(linkage, samples[0], -1)[0]
    track = np.concatenate([behind[::-1], ahead[1:]])
    if round_trip:
        track = np.concatenate([track, track[:1]])
    drive = np.array([drive_of(linkage, pose) for pose in track])
    if linkage.driver.turns:
        drive = np.unwrap(drive)
    first = len(behind) - 1
    positions = []
    length = len(track) - 1 if round_trip else len(track)
    for sample in samples:
        gap = (track - sample) / _scale(sample)
        gap[:, 0] = np.angle(np.exp(1j * gap[:, 0]))
        distance = np.linalg.norm(gap, axis=1)
        nearest = int(np.argmin(distance[:length]))
        if distance[nearest] > 0.8 * STEP:
            return Course(False, False)
        candidates = []
        for low in (nearest - 1, nearest):
            if not round_trip and not 0 <= low < length - 1:
                continue
            begin, end = gap[low % length], gap[low % length + 1]
            direction = end - begin
            part = float(np.clip(-(begin @ direction) / (direction @ direction), 0, 1))
            candidates.append((float(np.linalg.norm(begin + part * direction)), low % length + part))
        positions.append(min(candidates)[1])
    positions[0] = float(first)
    steps = np.sign(np.diff(drive))
    return Course(True, any(_passes(positions, steps, direction, round_trip) for direction in (1, -1)))


def _passes(positions: list[float], steps: np.ndarray, direction: int, round_trip: bool) -> bool:
    """Return true if samples are met in order and in a direction along the track before the drive turns back."""
    length = len(steps)
    offsets = [direction * (position - positions[0]) for position in positions]
    if round_trip:
        offsets = [0.0] + [offset % length for offset in offsets[1:]]
    if any(b <= a for a, b in pairwise(offsets)):
        return False
    begin = int(positions[0])
    run = 0
    sense = None
    while run < length:
        k = begin + run if direction > 0 else begin - 1 - run
        if round_trip:
            k %= length
        if not 0 <= k < length:
            break
        sense = steps[k] if sense is None else sense
        if steps[k] != sense:
            break
        run += 1
    # the reversal lies within the step after the run
    return max(offsets) <= run + 1
