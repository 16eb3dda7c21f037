"""A second mechanism through the same search: what `synthesis.mechanism` asks for is all that the search needs to know.

The toy is a slider-crank whose rod is the body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from synthesis.atlas import window_search
from synthesis.atlas.scan import Scan
from synthesis.atlas.table import make_table
from synthesis.atlas.windows import Windows, best_of, joined
from synthesis.pose import fit_positions, objective
from synthesis.ranking import Errors, motion_errors
from synthesis.search.search import search
from synthesis.search.seeds import SeedTables
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.oracles.slider_crank import SliderCrankChart, body_angle


@dataclass(frozen=True)
class SliderCrank:
    lengths: np.ndarray
    start: float
    pose: tuple[complex, float, complex]
    errors: Errors | None = None

    @property
    def identity(self) -> np.ndarray:
        return self.lengths / self.lengths[0]

    @property
    def looks(self) -> np.ndarray:
        return 50 * self.identity


class Mechanism:
    branches = (1,)
    coarse_types = np.array(
        [[1.0, 1 + abs(e) + x, e] for x in np.geomspace(0.05, 20, 7) for e in np.linspace(-3, 3, 7)]
    )

    def winding(self, lengths: np.ndarray) -> np.ndarray:
        return np.zeros(len(lengths), dtype=int)

    def body_angle(self, lengths: np.ndarray, branch: Any, crank: np.ndarray) -> np.ndarray:
        return body_angle(lengths, crank)

    def in_family(self, family: str, lengths: np.ndarray) -> np.ndarray:
        return np.ones(len(lengths), dtype=bool)

    def charts(self, family: str) -> list[SliderCrankChart]:
        return [SliderCrankChart()]

    def bounded(self, target: Target, limits: Any) -> list[Any]:
        return []

    def within(self, target: Target, limits: Any, solutions: list[Any]) -> list[Any]:
        return solutions

    def mounted(self, target: Target, lengths: np.ndarray, branch: Any, start: np.ndarray) -> list[SliderCrank]:
        if target.position is None:
            return [SliderCrank(row, at, (0j, 0.0, 0j)) for row, at in zip(lengths, start)]
        fit = fit_positions(target, body_angle(lengths, start[:, None] + target.crank))
        scaled = lengths * (np.abs(fit.crank_vector) / lengths[:, 0])[:, None]
        pose = zip(fit.pivot, np.angle(fit.crank_vector) - start, fit.coupler_vector)
        return [SliderCrank(*one) for one in zip(scaled, start, pose)]

    def assess(self, target: Target, linkages: list[SliderCrank], rows: Any = None) -> list[SliderCrank]:
        crank = np.array([one.start for one in linkages])[:, None] + target.crank
        angle = body_angle(np.array([one.lengths for one in linkages]), crank)
        pivot, turn, arm = (np.array(column)[:, None] for column in zip(*(one.pose for one in linkages)))
        r = np.array([[one.lengths[0]] for one in linkages])
        points = pivot + r * np.exp(1j * (crank + turn)) + arm * np.exp(1j * angle)
        return [replace(one, errors=errors) for one, errors in zip(linkages, motion_errors(target, angle, points)[1])]


class Mirrored(Mechanism):
    """The same with a second branch, of which the law of `synthesis.mechanism` holds."""

    branches = (1, -1)

    def body_angle(self, lengths: np.ndarray, branch: Any, crank: np.ndarray) -> np.ndarray:
        side = np.reshape(branch, (-1, 1))
        return side * body_angle(lengths, side * crank)


ANY = SimpleNamespace(family="full_crank", only_family=True)


def test_random_slider_cranks_are_recovered() -> None:
    tables = SeedTables(Mechanism())
    for seed in range(20):  # every other one with positions too
        random = np.random.default_rng(seed)
        lengths, start = (
            SliderCrankChart().shape(random.uniform([[-2, -2]], [[1.5, 2]])).lengths,
            random.uniform(0, 6),
        )
        crank = np.linspace(0, random.uniform(2, 6), 24)
        angle = body_angle(lengths, start + crank)[0]
        pivot, z1, z2 = random.normal(size=3) + 1j * random.normal(size=3)
        position = pivot + z1 * np.exp(1j * crank) + z2 * np.exp(1j * angle) if seed % 2 else None
        target = make_target(angle + random.uniform(-3, 3), position, crank_angle=crank)
        solutions, _ = search(tables, target, ANY, 3)
        assert solutions[0].errors.objective < 1e-9, seed


STARTS = 360


def every_window(mechanism: Mechanism, lengths: np.ndarray, target: Target) -> Windows:
    """All windows with their errors, type after type and branch after branch."""
    start, found = np.arange(STARTS), []
    crank = np.deg2rad(start)[:, None] + target.crank
    for row, one in enumerate(lengths):
        for branch in mechanism.branches:
            same = np.full(STARTS, branch)
            error = objective(target, mechanism.body_angle(np.tile(one, (STARTS, 1)), same, crank))
            found.append(Windows(np.full(STARTS, row), start, same, error))
    return joined(found)


@pytest.fixture
def always_by_the_index(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Short spans are answered by the index, however many windows are left: for so few types the cells do better."""
    for name in ("MOST_LEAVES", "LARGEST_LIMIT", "MOST_WINDOWS", "MOST_PLACED"):
        monkeypatch.setattr(window_search, name, np.inf)
    answered: list[int] = []
    ask = window_search.WindowSearch.candidates

    def counted(*arguments: Any) -> Any:
        near = ask(*arguments)
        answered.append(near is not None)
        return near

    monkeypatch.setattr(window_search.WindowSearch, "candidates", counted)
    return answered


@pytest.mark.parametrize("mechanism", [Mechanism(), Mirrored()], ids=["one branch", "two branches"])
@pytest.mark.parametrize("span", [20.0, 75.0, 360.0])
def test_the_scan_finds_the_best_windows_of_all_branches_that_there_are(mechanism, span, always_by_the_index) -> None:
    random = np.random.default_rng(int(span))
    lengths = SliderCrankChart().shape(random.uniform([[-2, -2]], [[1.5, 2]], (24, 2))).lengths
    scan = Scan(make_table(mechanism, lengths, 64))
    assert scan.windows == len(lengths) * STARTS * len(mechanism.branches)
    crank = np.deg2rad(np.linspace(0, span, 13))
    wanted = -body_angle(lengths[:1] * [1, 1.02, 1], 0.3 - crank)[0]  # nearly what a second branch would do
    position = np.array([1, 0.3, -0.8]) @ [np.ones(13), np.exp(1j * crank), np.exp(1j * wanted)]
    targets = [
        make_target(turned, points, crank_angle=crank)
        for turned, points in ((wanted, None), (None, position), (wanted, position), (np.zeros(13), None))
    ]
    every = [every_window(mechanism, lengths, target) for target in targets]
    for by_index in (False, True):
        if by_index:
            scan.prepare_short_spans(Work())
        for target, windows in zip(targets, every):
            for top in (1, 50, 3000):
                found, report = scan.best(target, top)
                best = best_of(windows, top)
                assert report.exhaustive
                np.testing.assert_allclose(found.error, best.error, rtol=1e-9, atol=1e-12)
                for column, wished in zip(found[:3], best[:3]):
                    np.testing.assert_array_equal(column, wished)
    assert any(always_by_the_index) == (span < 100)
    assert scan.error_table(targets[0]).shape == (len(lengths), len(mechanism.branches), STARTS)
