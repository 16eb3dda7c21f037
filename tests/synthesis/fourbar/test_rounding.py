"""Rounded links lie on the grid or in the stock, and no small change of the other dimensions is better.

A linkage that does not close, or that is not refitted, would show here.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import mounted
from synthesis.limits import Limits
from synthesis.linkage import with_links
from synthesis.solution import Solution, assess
from synthesis.studies import four_bar_rounding as rounding
from synthesis.studies.four_bar_rounding import OPTIONS, best_from_stock
from synthesis.target import Target, make_target
from synthesis.work import Work


def exact_case(seed: int, with_rotation: bool = True, crank_length: float = 20.0) -> tuple[Target, Solution]:
    """A target of a crank-rocker of lengths near 20 .. 80, and that crank-rocker."""
    random = np.random.default_rng(seed)
    lengths = np.array([crank_length, 52.0, 61.0, 74.0]) + random.uniform(-5, 5, 4)
    start, branch = random.uniform(0, 6), int(random.choice([-1, 1]))
    crank = np.linspace(0, random.uniform(1, 6), 24)
    angle = coupler_angle(lengths, np.array(branch), start + crank)
    turned = np.exp(1j * random.uniform(0, 6))
    position = 10 - 3j + turned * (lengths[0] * np.exp(1j * (start + crank)) + (15 + 9j) * np.exp(1j * angle))
    target = make_target(angle if with_rotation else None, position, crank_angle=crank)
    return target, assess(target, mounted(target, lengths[None], [branch], [start]))[0]


# -- stock ------------------------------------------------------------------------------------------------------------


def naive_best(target: Target, solution: Solution, stock: list[float]) -> float:
    """Return the smallest objective of all combinations, each as its own grid, from many starts."""
    best = np.inf
    for links in itertools.product(stock, repeat=4):
        linkage = with_links(solution.linkage, links)
        if linkage.family.value not in ("crank_rocker", "double_crank"):
            continue
        for start in np.linspace(0, 2 * np.pi, 90, endpoint=False):
            angle = coupler_angle(np.array(links), np.array(linkage.branch), start + target.crank)
            if np.isnan(angle).any():
                continue
            # A and z projected out by a plain least-squares solver; the rotation of the ground by its closed form
            columns = np.stack([np.ones_like(angle), np.exp(1j * angle)], axis=1)
            both = np.stack([target.position, links[0] * np.exp(1j * (start + target.crank))], axis=1)
            remaining = both - columns @ np.linalg.lstsq(columns, both, rcond=None)[0]
            direction = np.vdot(remaining[:, 1], remaining[:, 0])
            gap = remaining[:, 0] - direction / abs(direction) * remaining[:, 1]
            turned = target.rotation - angle
            cost = np.mean(np.abs(gap) ** 2) / target.length_scale**2 + np.var(turned)
            best = min(best, cost)
    return float(np.sqrt(best))


@pytest.mark.parametrize("seed", range(2))
def test_the_best_of_a_small_stock_is_as_good_as_a_naive_search(seed, monkeypatch) -> None:
    target, solution = exact_case(seed)
    target = target.thinned(9)
    stock = [18.0, 53.0, 70.0]
    found = best_from_stock(target, solution, stock, Limits(), 1000, Work())
    assert found.exhaustive and found.tried == found.combinations == 81
    monkeypatch.setattr(rounding, "OPTIONS", replace(OPTIONS, max_fitted=0))
    assert best_from_stock(target, solution, stock, Limits(), 1000, Work()).exhaustive is False, "none was refined"
    assert set(found.solution.linkage.links) <= set(stock)
    assert found.solution.errors.objective <= naive_best(target, solution, stock) * (1 + 1e-9)
