"""Poses and paths whose crank angles are free, beside shape and pose, made ready for descents."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis import kernel
from synthesis.arrays import Complexes, Floats
from synthesis.descents import Problem, Timed
from synthesis.free.poses import Poses
from synthesis.mechanism import BodyAngles, Chart


class Turned(NamedTuple):
    """Crank and body of candidates at their angles."""

    crank: Complexes
    """(n, N): e^{i phi}"""
    body: BodyAngles


def phasor(angle: Floats) -> Complexes:
    """e^{i angle}; several times faster than the exponential of complex numbers."""
    out = np.empty(angle.shape, dtype=complex)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out


class JointProblem(Problem):
    """Poses, a chart and limits made ready for many candidates."""

    def __init__(self, poses: Poses, chart: Chart, limits: kernel.Limits | None = None) -> None:
        super().__init__(poses, chart, limits, ordered=poses.ordered, span_max=poses.span_max, closed=poses.closed)
        self.posed = self.limited
        self.poses, self.rotation, self.position = poses, poses.rotation, poses.scaled
        self.rotation_root = np.broadcast_to(poses.rotation_mean.root, poses.samples)
        self.position_root = np.broadcast_to(poses.position_mean.root, poses.samples)

    def turned(self, timed: Timed) -> Turned:
        """Crank and body of candidates at their angles."""
        return Turned(phasor(timed.angles), self.chart.at(timed.shape, timed.angles, timed.branch, derivatives=False))

    def facing(self, timed: Timed) -> Timed:
        """Candidates of unknown offset with one that is right to within their own error, from the mean direction of the gaps."""
        return self.measured(timed, posed=False, facing=True).timed
