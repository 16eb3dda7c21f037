"""Paths without crank angles: seeds of guessed timing, descended in stages, and hops from the best of them."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.joint import JointProblem, Refined, Timed, loose_steps, refine
from synthesis.free.poses import Poses
from synthesis.free.screen import PathScreen
from synthesis.mechanism import Chart
from synthesis.target import TURN
from synthesis.work import Work

Floats = NDArray[np.float64]


class Fresh(NamedTuple):
    start: int
    stop: int
    fine: bool = False


class Hops(NamedTuple):
    origins: int
    copies: int
    width: float = 1.0
    loose: int = 0


class Best(NamedTuple):
    most: int


class Round(NamedTuple):
    source: Any
    stages: tuple
    reason: str = ""
    log: bool = False


SCHEDULE = [
    Round(Fresh(0, 150), ((150, 8), (30, 15), (12, 40))),
    Round(Fresh(150, 600), ((450, 6), (100, 12), (40, 40))),
    Round(Hops(16, 12), ((192, 8), (60, 20), (20, 60))),
] + [Round(Hops(24, 10), ((240, 8), (60, 20), (20, 60)))] * 8 + [Round(Best(12), ((12, 500),))]

SEARCH_SAMPLES = 20
KEEP = 120
STALL = 1e-2
LOOSE = 0.5
TIRED = 2.0
FINE = None
SAME = 1e-3


def valleys(found: Refined, most: int, cell: Floats) -> Refined:
    cost, timed = found.cost, found.timed
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    first = timed.angles[:, 0]
    place = np.column_stack([timed.shape / cell[:-1], np.cos(first) / cell[-1], np.sin(first) / cell[-1], 9 * timed.branch])
    keys = np.round(place / 0.2).astype(np.int64)
    kept, seen, last = [], set(), -1
    for i in order:
        key, value = keys[i].tobytes(), cost[i] ** 0.5
        if key in seen:
            continue
        if last >= 0 and abs(value - cost[last] ** 0.5) < SAME * value and np.abs(place[i] - place[last]).max() < 1:
            continue
        seen.add(key)
        kept.append(i)
        last = i
        if len(kept) == most:
            break
    return found.take(np.array(kept, dtype=int))


class PathSearch:
    def __init__(self, poses: Poses, chart: Chart, screen: PathScreen, tolerance: float, work: Work, search_samples=SEARCH_SAMPLES) -> None:
        self.poses, self.chart, self.screen, self.tolerance, self.work = poses, chart, screen, tolerance, work
        self.kept = np.arange(poses.samples)
        if poses.samples > 1.3 * search_samples:
            self.kept = np.round(np.linspace(0, poses.samples - 1, search_samples)).astype(int)
        thin = poses if self.kept.size == poses.samples else thinned(poses, self.kept)
        self.thin = thin
        self.problem = JointProblem(thin, chart)
        self.used = Counter()
        self.fine = None
        self.random = np.random.default_rng(20)
        self.pool = None
        self.trace = []
        self.seeds = None
        self.round = -1

    def run(self, schedule=SCHEDULE):
        for k, one in enumerate(schedule):
            self.round = k
            if one.log:
                self.other(one.source.most, one.stages[0][1])
            else:
                self.descend(self.draw(one.source), one.stages)
            self.trace.append((self.work.elapsed, float(np.sqrt(self.pool.cost[0]))))
            if self.reached or self.work.expired():
                break
        return self.pool

    @property
    def reached(self):
        return self.pool.cost[0] <= self.tolerance**2

    def other(self, most, steps):
        from synthesis.fourbar.charts import FullCrankChart
        chart = FullCrankChart()
        best = self.pool.take(slice(0, most))
        t = best.timed._replace(shape=chart.unknowns(self.chart.shape(best.timed.shape).lengths))
        problem = JointProblem(self.thin, chart)
        found = refine(problem, t, steps, self.tolerance * 0.3, self.work, stall=1e-4)
        found = found._replace(timed=found.timed._replace(shape=self.chart.unknowns(chart.shape(found.timed.shape).lengths)))
        found = refine(self.problem, found.timed, 1, 0, self.work, damping=found.damping)
        self.pool = valleys(self.pool.joined(found), KEEP, self.chart.cell)

    def draw(self, source):
        match source:
            case Fresh():
                if self.seeds is None:
                    self.seeds = self.screen.seeds(self.thin, self.chart, 600)
                t = self.seeds.take(slice(source.start, source.stop))
                if source.fine:
                    if self.fine is None:
                        from synthesis.free.screen import seeds, spans_and_powers
                        g = spans_and_powers(self.thin, np.deg2rad([28, 45, 75, 115, 160, 210, 270, 320, 352.0]), np.array([1, 0.75, 0.5]))
                        self.fine = seeds(FINE, self.thin, self.chart, g, 60, 1500)
                    t = self.fine.take(slice(source.start, source.stop))
                return Refined(t, np.full(len(t.branch), np.inf), np.full(len(t.branch), 1e-3), np.zeros(len(t.branch), bool))
            case Best():
                best = self.pool.take(slice(0, source.most))
                return best._replace(ended=np.zeros(len(best.cost), bool))
            case Hops():
                tired = np.array([self.used[c] for c in self.pool.cost])
                order = np.argsort(np.log(self.pool.cost) + TIRED * tired, kind="stable")[: source.origins]
                self.used.update(self.pool.cost[order])
                best = self.pool.take(order).timed
                out = self.hops(best, source.copies, source.width) if source.copies else None
                if source.loose:
                    more = best.take(np.repeat(np.arange(len(best.branch)), source.loose))
                    more = loose_steps(self.problem, more, self.random, LOOSE)
                    n = len(more.branch)
                    more = Refined(more, np.full(n, np.inf), np.full(n, 1e-3), np.zeros(n, bool))
                    out = more if out is None else out.joined(more)
                return out

    def hops(self, best, copies, width):
        rng = self.random
        n = len(best.branch)
        t = best.take(np.repeat(np.arange(n), copies))
        n = len(t.branch)
        noise = rng.standard_t(3, size=(n, t.shape.shape[1])) * self.chart.hop[:-1] * width
        shape = self.chart.hopped(t.shape, noise)
        flip = rng.random(n) < 0.1
        shape[flip, 0] *= -1
        angles = t.angles
        span = angles[:, -1:] - angles[:, :1]
        factor = np.exp(0.25 * width * rng.standard_t(3, size=(n, 1)))
        factor = np.minimum(factor, 0.97 * self.poses.span_max / np.maximum(np.abs(span), 1e-9))
        start = angles[:, :1] + 0.3 * width * rng.standard_t(3, size=(n, 1))
        angles = start + (angles - angles[:, :1]) * factor
        branch = np.where(rng.random(n) < 0.15, -t.branch, t.branch)
        t = Timed(shape, t.pose, t.offset, angles, branch)
        return Refined(t, np.full(n, np.inf), np.full(n, 1e-3), np.zeros(n, bool))

    def descend(self, found, stages):
        parts = []
        for most, steps in stages:
            go = found.take(~found.ended)
            if most < len(go.cost):
                go = valleys(go, most, self.chart.cell)
            if not len(go.cost) or self.work.expired():
                break
            found = refine(self.problem, go.timed, steps, self.tolerance * 0.3, self.work, damping=go.damping, stall=STALL)
            parts.append(found)
            if found.cost.min() <= self.tolerance**2:
                break
        parts = parts if self.pool is None else [self.pool, *parts]
        self.pool = valleys(parts[0].joined(*parts[1:]), KEEP, self.chart.cell)


def thinned(poses: Poses, kept) -> Poses:
    from dataclasses import replace
    def some(v):
        return None if v is None else v[kept]
    return replace(poses, position=some(poses.position), rotation=some(poses.rotation),
        position_weights=some(poses.position_weights), rotation_weights=some(poses.rotation_weights))
