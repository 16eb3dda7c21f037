"""Verdicts against a tracker that follows each linkage round its circuit, laws, and cases whose answer one can see."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.verdict import from_the_rocker, passage, verdicts
from synthesis.target import TURN
from tests.oracles import tracker

laws = settings(derandomize=True, max_examples=100, deadline=None)
KINDS = [(shortest, grashof) for shortest in range(4) for grashof in (True, False)]


def lengths_of(rng: np.random.Generator, shortest: int, grashof: bool, excess: float | None = None) -> np.ndarray:
    """Four lengths with the shortest at a place; at a change point but for ``excess``, of the perimeter, where given."""
    while True:
        one = np.sort(rng.dirichlet(np.ones(4)))
        if excess is not None:
            one[3] = one[1] + one[2] - one[0] + (-excess if grashof else excess)
        if one[0] < 0.01 or one[3] > 0.98 * one[:3].sum() or (one[0] + one[3] < one[1] + one[2]) != grashof:
            continue
        if one[3] < one[2]:
            continue
        return np.insert(rng.permutation(one[1:]), shortest, one[0]) / one.sum()


def start_of(rng: np.random.Generator, lengths: np.ndarray) -> tuple[float, int]:
    """A configuration that closes."""
    while True:
        angle, side = float(rng.uniform(-np.pi, np.pi)), int(rng.choice([-1, 1]))
        if tracker.configuration(lengths, angle, side) is not None:
            return angle, side


def samples_on(rng: np.random.Generator, circuit: tracker.Circuit) -> list[tuple[float, int]]:
    """Samples in cyclic order over a part of a circuit, or all of it, none within 1e-3 of a dead position."""
    while True:
        gaps = rng.uniform(0.2, 1, size=rng.integers(4, 9))
        places = rng.uniform() + rng.choice([-1, 1]) * np.cumsum(gaps / gaps.sum()) * rng.choice([0.15, 0.4, 0.99])
        states = [circuit.at(place * circuit.length) for place in places]
        if min(abs(one) for state in states for one in tracker.sides(circuit.lengths, state)) > 1e-3:
            return [
                (tracker.angles(circuit.lengths, state)[0], 1 if tracker.sides(circuit.lengths, state)[0] > 0 else -1)
                for state in states
            ]


def changed(rng: np.random.Generator, samples: list[tuple[float, int]]) -> dict[str, list[tuple[float, int]]]:
    """The samples as they are, with two of them swapped, and with one replaced by its mirror image."""
    one, other = rng.choice(len(samples), 2, replace=False)
    swapped, mirrored = list(samples), list(samples)
    swapped[one], swapped[other] = samples[other], samples[one]
    mirrored[one] = (-samples[one][0], -samples[one][1])
    return {"as they are": samples, "swapped": swapped, "mirrored": mirrored}


def disagreements(count: int, seed: int = 1) -> tuple[list[str], Counter[str]]:
    """Verdicts on random mechanisms that are not those of the tracker, and how often each verdict was given."""
    rng = np.random.default_rng(seed)
    wrong, seen = [], Counter()
    for number in range(count):
        # every eighth is near a change point
        excess = None if number % 8 else 10 ** rng.uniform(-8, -2)
        lengths = lengths_of(rng, *KINDS[number // 8 % 8 if excess else number % 8], excess)
        circuit = tracker.track(lengths, *start_of(rng, lengths))
        for name, samples in changed(rng, samples_on(rng, circuit)).items():
            turns = TURN * rng.integers(-2, 3, size=len(samples))
            angle, side = np.array(samples).T
            for ordered, closed in ((True, False), (True, True), (False, False)):
                asked = {"ordered": ordered, "closed": closed}
                linkage = Linkage(tuple(lengths))
                (found,) = verdicts([linkage], [angle + turns], [side], **asked)
                truth = tracker.judge(circuit, samples, **asked)
                same = tracker.Judgement(found.order, found.branch, found.circuit, found.driver) == truth
                if found.uncertain:
                    seen[f"uncertain, {'same' if same else 'other'}"] += 1
                    continue
                seen[f"{name}, {'' if ordered else 'un'}ordered{', closed' if closed else ''}: {found.driver}"] += 1
                seen["circuit defect"] += not found.circuit
                seen["branch defect, no circuit defect"] += found.circuit and not found.branch
                seen["order defect alone"] += found.circuit and found.branch and not found.order
                if not same:
                    wrong.append(f"{number} {name} {asked} {lengths.tolist()} {samples}: {found}, tracked {truth}")
    return wrong, seen
