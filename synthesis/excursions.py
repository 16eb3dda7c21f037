"""Excursions of the body point between samples: length of the curve over the distance of neighbouring samples.

A path may meet every sample and make a loop between two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from synthesis.linkages import body_motions
from synthesis.poses import Poses
from synthesis.solution import Solution

LEAVES_SAMPLES = 2.5
"""Excursion above which the curve leaves the samples in between."""
SHORTEST_CHORD = 0.05
"""Smallest distance of two samples in an excursion, as a fraction of the length scale."""
CHORDS = 48
"""Chords of the curve between two samples, which are denser towards the samples."""


def excursions_of(solutions: Sequence[Solution], poses: Poses) -> list[float | None]:
    """Return the excursion of the body point of each solution; None if the loop opens between samples.

    It is the largest ratio, over neighbouring samples in the order in which they are passed, of the length of the curve between
    them to their distance; a distance below `SHORTEST_CHORD` of the motion's extent counts as this distance. Above
    `LEAVES_SAMPLES` the curve makes a detour between two samples. If the order is free, the widest gap is omitted.

    The result is at least 1. It does not change if the samples are reversed, or if linkage and motion are scaled.
    """
    found: list[float | None] = [None] * len(solutions)
    parts = (1 - np.cos(np.linspace(0.0, np.pi, CHORDS + 1))) / 2  # the curve may be fast beside a sample
    for turns in (True, False):
        rows = [k for k, solution in enumerate(solutions) if solution.linkage.driver.turns == turns]
        if not rows:
            continue
        travel = np.array([solutions[k].travel for k in rows])
        travel = travel if poses.ordered else np.sort(travel)
        travel = poses.there_and_back(travel) if turns else travel
        steps = travel[:, :-1, None] + np.diff(travel)[..., None] * parts
        curve = body_motions([solutions[k].linkage for k in rows], steps.reshape(len(rows), -1))
        points = curve.position.reshape(steps.shape)
        arcs, chords = np.abs(np.diff(points)).sum(axis=-1), np.abs(points[..., -1] - points[..., 0])
        largest = np.max(arcs / np.maximum(chords, SHORTEST_CHORD * poses.extent), axis=-1)
        for k, value in zip(rows, largest.tolist()):
            found[k] = max(1.0, value) if math.isfinite(value) else None
    return found


def excursion_faults(excursion: float | None) -> list[str]:
    """Describe an excursion that leaves the samples."""
    if excursion is None or excursion <= LEAVES_SAMPLES:
        return []
    found = f"the body point goes {excursion:.3g} times as far between two samples as they are apart"
    return [f"{found}, above {LEAVES_SAMPLES:g}"]
