"""Verdicts on linkages on two guides: against following them step by step, and laws. ``benchmarks.guided`` has 2,000 cases."""

from dataclasses import replace

import numpy as np
import pytest

from synthesis.fourbar.joints import joints_at
from synthesis.fourbar.passage import verdicts
from synthesis.guided.passage import Circuits, passage, verdict
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, four_bar, on_guides
from tests.conftest import some_of
from tests.oracles.guided_cases import DRIVES, NAMES, random_case
from tests.oracles.guided_tracker import follow


@pytest.mark.parametrize("cases", some_of([1, 12], 1))
@pytest.mark.parametrize(("guide", "driver", "other"), DRIVES, ids=NAMES)
def test_what_is_said_is_what_following_the_linkage_finds(guide, driver, other, cases) -> None:
    random = np.random.default_rng(24)  # with it the first cases are driven, not driven, or on two circuits
    seen = 0
    while seen < cases:
        case = random_case(random, guide, driver, other)
        if case.near:
            continue
        seen += 1
        found, followed = passage(case.linkage, case.coordinate, case.side), follow(case.linkage, case.poses)
        assert (bool(found.driven[0]), bool(found.circuit[0])) == (followed.driven, followed.circuit), case


@pytest.mark.parametrize(("guide", "driver", "other"), DRIVES, ids=NAMES)
def test_the_verdict_is_the_same_reversed_mirrored_moved_and_scaled(guide, driver, other) -> None:
    random = np.random.default_rng(22)
    for _ in range(30):
        case = random_case(random, guide, driver, other)
        if case.near:
            continue
        linkage, q, side = case.linkage, case.coordinate, case.side
        flipped = linkage.mirrored().branch * linkage.branch
        wanted = _flags(linkage, q, side)
        assert _flags(linkage, q[::-1], side[::-1]) == wanted
        assert _flags(linkage.mirrored(), -q if driver.turns else q, flipped * side) == wanted
        assert _flags(linkage.moved(0.4, 1 - 2j), q, side) == wanted
        assert _flags(linkage.scaled(8.0), q if driver.turns else 8 * q, side) == wanted
        if driver.turns:
            around = q + 2 * np.pi * random.integers(-2, 3, q.size)
            assert _flags(linkage, around, side) == wanted


def _flags(linkage: Linkage, q: np.ndarray, side: np.ndarray) -> tuple[bool, ...]:
    found = passage(linkage, q, side)
    return tuple(bool(one[0]) for one in (found.order, found.branch, found.circuit, found.driven))


def test_a_four_bar_is_judged_as_before() -> None:
    random = np.random.default_rng(23)
    seen = 0
    for _ in range(300):
        linkage = four_bar(
            tuple(random.uniform(0.5, 3, 4)), int(random.choice([-1, 1])), 0.0, 1j, 0.4, (1.0, 0.5), 0.2
        )
        travel = random.uniform(-2.5, 2.5, 4)
        if random.random() < 0.6:
            travel = np.sort(travel)
        if not joints_at(linkage, travel).closed:
            continue
        seen += 1
        side = np.full(4, linkage.branch)
        (known,) = verdicts([linkage], travel[None], side[None])
        guided = linkage
        assert verdict(guided, guided.start + travel) == known
    assert seen > 60


def test_reasons_name_the_drive_and_what_could_drive_instead() -> None:
    made = on_guides((Rail(0j, 0.0, 2 + 0j), Circle(0j, 1.0, 0j)), Driver.SLIDER)
    assert Circuits(made).meet
    there, back = made.body(2.9), made.body(1.1)
    assert np.isfinite([there.rotation[0], back.rotation[0]]).all()
    found = verdict(made, [2.9, 1.1, 2.0])
    assert found.driver is None or found.driver == "crank"
    assert "a slider that moves one way does not pass samples" in " ".join(found.reasons)
    # out and back through both ends of the stroke: the crank does it, the slider does not
    q = np.array([2.0, 2.8, 2.0, 1.2])
    found = verdict(made, q, np.array([1, 1, -1, -1]) * made.branch)
    assert found.driver == "crank" and found.circuit and not found.branch
    assert "only the crank can drive the linkage through the samples, not the slider" in found.reasons
    assert verdict(made, [1.5, 2.0, 2.5]).driver == "slider"
    assert verdict(made, [1.5, 2.0, 2.5], closed=True).driver == "crank"  # which turns fully, so that it comes round


def test_two_circuits_of_a_rail_and_a_slot_are_told_apart_by_the_sign_of_the_travel() -> None:
    # |e| < |h|: the slider cannot pass below the pin
    made = on_guides((Rail(0j, 0.0, 0j), Slot(0.5j, 1j, 0.0)), Driver.SLIDER)
    assert np.isnan(made.body(0.1).rotation[0])
    assert verdict(made, [1.0, 2.0, 3.0]).driver == "slider"
    found = verdict(made, [-2.0, 1.0, 2.0])
    assert not found.circuit and "different circuits" in " ".join(found.reasons)
    through = replace(made, local_guides=(made.guides[0], Slot(1j, 0.5j, 0.0)))
    assert verdict(through, [-2.0, 1.0, 2.0]).driver == "slider"
    assert isinstance(made.guides[1], Slot) and not isinstance(made.guides[0], Circle)
