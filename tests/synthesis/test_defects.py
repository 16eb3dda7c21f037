"""Verdicts agree with trackers that follow each linkage round its circuit, with laws and with obvious cases.

These tests would catch a defect that is not reported, or is reported of a linkage that works, for any kind of linkage.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import settings

from synthesis.defects import passage, shared_positions, verdict
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, four_bar, on_guides
from synthesis.target import TURN, Target
from tests.conftest import some_of
from tests.oracles import tracker
from tests.oracles.guided_cases import DRIVES, NAMES, random_case
from tests.oracles.guided_tracker import follow

laws = settings(derandomize=True, max_examples=100, deadline=None)
KINDS = [(shortest, grashof) for shortest in range(4) for grashof in (True, False)]


def lengths_of(rng: np.random.Generator, shortest: int, grashof: bool, excess: float | None = None) -> np.ndarray:
    """Return four lengths, the shortest at an index; ``excess`` moves them from a change point by a fraction of the
    perimeter.
    """
    while True:
        sides = np.sort(rng.dirichlet(np.ones(4)))
        if excess is not None:
            sides[3] = sides[1] + sides[2] - sides[0] + (-excess if grashof else excess)
        if (
            sides[0] < 0.01
            or sides[3] > 0.98 * sides[:3].sum()
            or (sides[0] + sides[3] < sides[1] + sides[2]) != grashof
        ):
            continue
        if sides[3] < sides[2]:
            continue
        return np.insert(rng.permutation(sides[1:]), shortest, sides[0]) / sides.sum()


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
        positions = rng.uniform() + rng.choice([-1, 1]) * np.cumsum(gaps / gaps.sum()) * rng.choice([0.15, 0.4, 0.99])
        states = [circuit.at(position * circuit.length) for position in positions]
        if min(abs(side) for state in states for side in tracker.sides(circuit.lengths, state)) > 1e-3:
            return [
                (tracker.angles(circuit.lengths, state)[0], 1 if tracker.sides(circuit.lengths, state)[0] > 0 else -1)
                for state in states
            ]


def changed(rng: np.random.Generator, samples: list[tuple[float, int]]) -> dict[str, list[tuple[float, int]]]:
    """Return the samples unchanged, with two samples swapped, and with a sample replaced by its mirror image."""
    first, second = rng.choice(len(samples), 2, replace=False)
    swapped, mirrored = list(samples), list(samples)
    swapped[first], swapped[second] = samples[second], samples[first]
    mirrored[first] = (-samples[first][0], -samples[first][1])
    return {"as they are": samples, "swapped": swapped, "mirrored": mirrored}


def disagreements(count: int, seed: int = 1) -> tuple[list[str], Counter[str]]:
    """Return verdicts on random mechanisms that differ from the tracker's, and the number of times that each
    verdict was given.
    """
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
                request = {"ordered": ordered, "closed": closed}
                linkage = four_bar(tuple(lengths))
                found = verdict(linkage, angle + turns, side, **request)
                truth = tracker.judge(circuit, samples, **request)
                same = tracker.Judgement(found.order, found.branch, found.circuit, found.driver) == truth
                if found.uncertain:
                    seen[f"uncertain, {'same' if same else 'other'}"] += 1
                    continue
                seen[f"{name}, {'' if ordered else 'un'}ordered{', closed' if closed else ''}: {found.driver}"] += 1
                seen["circuit defect"] += not found.circuit
                seen["branch defect, no circuit defect"] += found.circuit and not found.branch
                seen["order defect alone"] += found.circuit and found.branch and not found.order
                if not same:
                    wrong.append(f"{number} {name} {request} {lengths.tolist()} {samples}: {found}, tracked {truth}")
    return wrong, seen


@pytest.mark.parametrize("count", [32, pytest.param(120, marks=pytest.mark.wide)])
def test_as_the_tracker(count) -> None:
    wrong, seen = disagreements(count)
    assert not wrong
    # nothing is agreed upon for want of cases
    drivers = Counter(case.rpartition(": ")[2] for case in seen.elements() if ": " in case)
    assert min(drivers[name] for name in ("crank", "rocker", "None")) > count / 3
    defects = ("circuit defect", "branch defect, no circuit defect", "order defect alone")
    assert min(seen[name] for name in defects) > count / 3


# -- every kind of linkage ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cases", some_of([1, 12], 1))
@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_as_followed_step_by_step(guide, driver, second, cases) -> None:
    random = np.random.default_rng(24)  # the first cases are driven, not driven, or on two circuits
    seen = 0
    while seen < cases:
        case = random_case(random, guide, driver, second)
        if case.close:
            continue
        seen += 1
        found, traced = passage(case.linkage, case.coordinate, case.side), follow(case.linkage, case.poses)
        assert (found.driven, found.circuit) == (traced.driven, traced.circuit), case


def flags_of(linkage: Linkage, coordinate: np.ndarray, side: np.ndarray) -> tuple[bool, ...]:
    found = passage(linkage, coordinate, side)
    return found.order, found.branch, found.circuit, found.driven


@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_the_same_reversed_mirrored_moved_and_scaled(guide, driver, second) -> None:
    random = np.random.default_rng(22)
    for _ in range(30):
        case = random_case(random, guide, driver, second)
        if case.close:
            continue
        linkage, q, side = case.linkage, case.coordinate, case.side
        flipped = linkage.mirrored().branch * linkage.branch
        expected = flags_of(linkage, q, side)
        assert flags_of(linkage, q[::-1], side[::-1]) == expected
        assert flags_of(linkage.mirrored(), -q if driver.turns else q, flipped * side) == expected
        assert flags_of(linkage.moved(0.4, 1 - 2j), q, side) == expected
        assert flags_of(linkage.scaled(8.0), q if driver.turns else 8 * q, side) == expected
        if driver.turns:
            assert flags_of(linkage, q + TURN * random.integers(-2, 3, q.size), side) == expected


def test_reasons_name_the_drive_and_a_drive_that_works_instead() -> None:
    pump = on_guides((Rail(0j, 0.0, 2 + 0j), Circle(0j, 1.0, 0j)), Driver.SLIDER)
    found = verdict(pump, [2.9, 1.1, 2.0])
    assert found.driver is None or found.driver == "crank"
    assert "a slider that moves in one direction does not pass samples" in " ".join(found.reasons)
    # out and back through both ends of the stroke: the crank does it, the slider does not
    found = verdict(pump, [2.0, 2.8, 2.0, 1.2], np.array([1, 1, -1, -1]) * pump.branch)
    assert found.driver == "crank" and found.circuit and not found.branch
    assert "only the crank can drive the linkage through the samples, not the slider" in found.reasons
    assert verdict(pump, [1.5, 2.0, 2.5]).driver == "slider"
    assert verdict(pump, [1.5, 2.0, 2.5], closed=True).driver == "crank"  # which turns fully, so that it comes round


def test_two_circuits_of_a_rail_and_a_slot_are_distinguished_by_the_sign_of_the_travel() -> None:
    # |e| < |h|: the slider cannot pass below the pin
    apart = on_guides((Rail(0j, 0.0, 0j), Slot(0.5j, 1j, 0.0)), Driver.SLIDER)
    assert np.isnan(apart.body(0.1).rotation[0])
    assert verdict(apart, [1.0, 2.0, 3.0]).driver == "slider"
    found = verdict(apart, [-2.0, 1.0, 2.0])
    assert not found.circuit and "different circuits" in " ".join(found.reasons)
    passing = replace(apart, local_guides=(apart.guides[0], Slot(1j, 0.5j, 0.0)))
    assert verdict(passing, [-2.0, 1.0, 2.0]).driver == "slider"


# -- obvious cases -----------------------------------------------------------------------------------------------------


CRANK_ROCKER = (2, 7, 6, 8)


def judged(links, degrees, side=1, **request):
    angle = np.deg2rad(degrees)
    return verdict(four_bar(links), angle, np.broadcast_to(side, angle.shape), **request)


def said(verdict):
    return verdict.order, verdict.branch, verdict.circuit, verdict.driver


GOOD = (True, True, True, "crank")


def test_a_crank_that_turns_fully() -> None:
    assert said(judged(CRANK_ROCKER, [0, 40, 90, 200, 350])) == GOOD
    assert judged(CRANK_ROCKER, [0, 40, 90, 200, 350]).reasons == ()
    assert said(judged(CRANK_ROCKER, [350, 10 + 720, 30], -1, closed=True)) == GOOD, "over zero, and whole turns"
    assert said(judged(CRANK_ROCKER, [30, 10, -10, 200])) == GOOD, "clockwise"
    assert said(judged(CRANK_ROCKER, [0, 90, 200, 360])) == GOOD, "the last sample repeats the first"
    assert said(judged(CRANK_ROCKER, [20, 20, 90, 200])) == GOOD, "a sample twice"
    swapped = judged(CRANK_ROCKER, [0, 90, 40, 200])
    assert said(swapped) == (False, True, True, None)
    assert swapped.reasons == (
        "a crank that turns in one direction does not pass samples 2 and 3 in this order",
        "neither crank nor rocker can drive the linkage through the samples, turning in one direction",
    )
    assert said(judged(CRANK_ROCKER, [0, 90, 40, 200], ordered=False)) == GOOD
    apart = judged(CRANK_ROCKER, [0, 40, 90, 200, 350], [1, 1, 1, 1, -1])
    assert said(apart) == (True, False, False, None)
    assert apart.reasons[:2] == (
        "samples 4 and 5 lie on different branches",
        "samples 4 and 5 lie on different circuits: the linkage would have to be disassembled between them",
    )


# -- samples at the same position of the drive


APART = np.array([0, 1j, 2, 3])
ALIKE = np.array([0, 1j, 1j + 1e-5, 3])


@pytest.mark.parametrize(
    ("crank", "fields", "turns", "named"),
    [
        ([0, 1, 2, 3], {"position": APART}, True, None),
        ([0, 1, 1 + 1e-12, 3], {"position": APART}, True, "samples 2 and 3"),
        ([0, -1, -1 - 1e-12, -TURN], {"position": APART}, True, "samples 1/4 and 2/3"),
        ([0, 2, 1, 2 - TURN], {"position": APART}, True, "samples 2 and 4"),  # in any order
        ([0, 1e-12, 2e-12, 3e-12], {"position": APART}, False, None),  # a short distance, but different positions
        ([0, 1, 1, TURN], {"position": APART}, False, "samples 2 and 3"),
        ([0, 1, 1, 3], {"position": APART, "position_weights": np.array([1.0, 1, 0, 1])}, True, None),
        ([0, 1, 1, 3], {"position": ALIKE}, True, None),
        ([0, 1, 1, 3], {"position": ALIKE, "rotation": np.array([0.0, 1, 2, 3])}, True, "samples 2 and 3"),
        ([0, 1, 1, 3], {"position": ALIKE, "rotation": np.array([0, 1, 1 + TURN, 3])}, True, None),
    ],
)
def test_samples_at_one_position_of_the_drive(crank, fields, turns, named) -> None:
    """Samples at the same position of the drive are reported if their targets differ; missing values do not differ."""
    motion = Target(**{"rotation": None, **fields}, crank=np.array(crank, dtype=float))
    assert [note.split(" share one ")[0] for note in shared_positions(motion, turns)] == ([named] if named else [])
