"""What a search leaves for the next one of nearly the same question: linkages in the user's unit, as rows of numbers."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.descents import Timed
from synthesis.fourbar.limits import in_family
from synthesis.fourbar.linkage import Linkage
from synthesis.mechanism import Chart
from synthesis.target import Samples

MOST = 24
"""Linkages that are kept: with 1,024 crank angles each they take 200 kB."""
_ALONE = 13
"""Numbers of a row beside its crank angles."""


class Kept(NamedTuple):
    """Linkages, best first; independent of the chart and the length scale of the search that found them."""

    searches: int
    """That have led to them: the next one goes on with other seeds."""
    links: Floats
    """(n, 4): crank, coupler, rocker, ground"""
    branch: Floats
    start: Floats
    """theta1 at the first sample."""
    pivot: Complexes
    turn: Floats
    """Ground angles."""
    coupler: Complexes
    """z2: the arm at theta2 = 0, in the plane; zero without positions."""
    offset: Floats
    crank: Floats
    """(n, N): crank angles from the first sample, of all samples that were asked for."""

    @classmethod
    def of(cls, found: Sequence[tuple[Linkage, Floats]], searches: int) -> Kept:
        """Linkages and their crank angles."""
        linkages, cranks = [one for one, _ in found], [crank for _, crank in found]
        arms = [0j if one.coupler_point is None else one.arm * np.exp(1j * one.ground_angle) for one in linkages]
        return cls(
            searches,
            np.array([one.links for one in linkages], dtype=float).reshape(-1, 4),
            np.array([one.branch for one in linkages], dtype=float),
            np.array([one.start for one in linkages], dtype=float),
            np.array([one.pivot_a for one in linkages], dtype=complex),
            np.array([one.ground_angle for one in linkages], dtype=float),
            np.array(arms, dtype=complex),
            np.array([one.ground_angle + (one.body_offset or 0.0) for one in linkages], dtype=float),
            np.array(cranks, dtype=float).reshape(len(linkages), -1 if linkages else 0),
        )

    @classmethod
    def unpacked(cls, state: bytes) -> Kept:
        """What `packed` gave; nothing of no bytes."""
        if not state:
            return cls.of([], 0)
        rows = np.load(io.BytesIO(state), allow_pickle=False)
        branch, start, turn, offset, searches = rows[:, 4:9].T
        pivot, coupler = rows[:, 9:13].copy().view(complex).T
        return cls(int(searches[0]), rows[:, :4], branch, start, pivot, turn, coupler, offset, rows[:, _ALONE:])

    def packed(self) -> bytes:
        """Them as bytes; none where there are none. Law: ``unpacked(packed())`` has the same numbers."""
        if not len(self.branch):
            return b""
        alone = [self.branch, self.start, self.turn, self.offset, np.full(len(self.branch), float(self.searches))]
        places = [self.pivot.real, self.pivot.imag, self.coupler.real, self.coupler.imag]
        file = io.BytesIO()
        np.save(file, np.column_stack([self.links, *alone, *places, self.crank]), allow_pickle=False)
        return file.getvalue()

    def take(self, places: Any) -> Kept:
        """Some of them."""
        return Kept(self.searches, *(column[places] for column in self[1:]))

    def among(self, family: str) -> Kept:
        """Those of a family; of ``any`` those whose cranks do not turn fully: full cranks are sought before."""
        full = in_family("full_crank", self.links)
        return self.take(~full if family == "any" else in_family(family, self.links))

    def mirrored(self) -> Kept:
        """Them in a mirror (the x axis)."""
        return self._replace(
            branch=-self.branch,
            start=-self.start,
            pivot=np.conj(self.pivot),
            turn=-self.turn,
            coupler=np.conj(self.coupler),
            offset=-self.offset,
            crank=-self.crank,
        )

    def candidates(self, samples: Samples, chart: Chart, crank: Floats) -> Timed:
        """They as candidates for samples, in a chart, at crank angles (n, m) from the first sample."""
        scale = samples.length_scale
        z1 = self.links[:, 0] / scale * np.exp(1j * self.turn)
        pose = np.stack([(self.pivot - samples.middle) / scale, z1, self.coupler / scale], axis=1)
        shape = chart.unknowns(self.links)
        return Timed(shape, pose, self.offset, self.start[:, None] + crank, self.branch)

    def at(self, samples: int) -> Floats:
        """Crank angles (n, N) at so many samples: where some were added or removed, evenly between those there were."""
        before = self.crank.shape[1]
        if before == samples:
            return self.crank
        places = np.linspace(0, before - 1, samples)
        return np.array([np.interp(places, np.arange(before), one) for one in self.crank]).reshape(-1, samples)
