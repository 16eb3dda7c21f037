"""Layers of plates agree with the acceptance table and with a search without pruning.

A free arrangement that is missed, or a blocked arrangement called free, would show here.
"""

import numpy as np
import pytest

from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Sizes
from synthesis.assembly.stacks import BOARDS, StackRequest, StackSearch, arrange
from synthesis.linkage import four_bar
from synthesis.target import TURN, Interval
from synthesis.work import Work
from tests.oracles.assembly import disagreements, free_stacks
from tests.oracles.four_bar_joints import joints_at
from tests.oracles.solids import TABLE, linkage_of

CLOSE = 1.5e-7
"""The table has seven digits, the last rounded; in degrees or units of length."""


def machine_of(case, **more):
    sizes = Sizes(*(case[name] for name in ("hole", "width", "clearance")))
    return as_plates(linkage_of(case), Interval(*np.deg2rad(case["used"])), sizes, **more)


def in_order(layers):
    return [layers[name] for name in ("crank", "coupler", "rocker")]


@pytest.mark.parametrize("name", TABLE)
def test_layers_and_stops_are_those_of_the_table(name) -> None:
    case = TABLE[name]
    below = arrange(machine_of(case), StackRequest("below"), Work())
    if expected := case["below"].get("layers"):
        assert below.status == "free"
        assert in_order(below.stack.layers) == expected
        for stop, at in zip((below.low, below.high), case["stops"]):
            assert (stop is None) == (at is None)
            if stop is not None:
                assert stop.pair is None
                assert np.rad2deg(stop.at) == pytest.approx(at, abs=CLOSE)
    else:
        assert below.status == "blocked"
        assert below.tried == case["below"]["tried"]
        assert np.rad2deg(below.free) == pytest.approx(case["below"]["free"], abs=CLOSE)
        assert {*below.low.pair, *below.high.pair} == set(case["below"]["pair"].split())
    both = arrange(machine_of(case), StackRequest("both"), Work())
    assert both.status == "free"
    assert in_order(both.stack.layers) == case["both"]["layers"]
    assert [both.stack.mounts[pin] for pin in "AB"] == case["both"]["mounts"]
    if "stops" in case["both"]:
        assert np.rad2deg([both.low.at, both.high.at]) == pytest.approx(case["both"]["stops"], abs=CLOSE)
    heads = arrange(machine_of(case), StackRequest("below", heads=True), Work())
    assert (in_order(heads.stack.layers) if heads.status == "free" else None) == case["heads"]


def random_machines(seed, count, **more):
    rng = np.random.default_rng(seed)
    while count:
        mount = tuple(10 ** rng.uniform(-0.6, 0, 4)), int(rng.choice([-1, 1])), rng.uniform(0, TURN), 0j, 0.0
        linkage = four_bar(*mount, (rng.uniform(0, 0.6), rng.uniform(0, TURN)))
        span = float(rng.choice([TURN, rng.uniform(0.2, 3.0)]))
        if joints_at(linkage, np.linspace(0, span, 200)).closed:
            count -= 1
            yield as_plates(linkage, Interval(0.0, span), Sizes(), **more)


def test_proofs_agree_with_shapely_at_many_places() -> None:
    for machine in random_machines(20351, 8):
        pairs, compared, wrong = disagreements(machine, StackSearch(machine, StackRequest("below"), Work()))
        assert compared > 500 * pairs and not wrong


@pytest.mark.parametrize("boards", BOARDS)
def test_the_search_finds_what_going_through_all_arrangements_finds(boards) -> None:
    statuses = set()
    square = (-0.1 - 0.1j, 0.1 - 0.1j, 0.1 + 0.1j, -0.1 + 0.1j)
    for number, machine in enumerate(random_machines(5, 6, body=square, bar=boards == "bar")):
        if number % 2:
            machine = next(random_machines(100 + number, 1, bar=boards == "bar"))
        search = StackSearch(machine, StackRequest(boards), Work())

        def hits(first, second, search=search) -> bool:
            return not search.proofs[search.pair(first, second)].free

        found = search.solve()
        count, stacks = free_stacks(machine, boards, hits, len(machine.plates))
        statuses.add(found.status)
        assert (found.status == "free") == bool(stacks)
        if stacks:
            assert found.stack.count == count
            assert found.alternatives == len(stacks) - 1
            assert (found.stack.layers, found.stack.mounts) in stacks
    assert "free" in statuses


def test_a_blocked_machine_is_free_where_it_says_and_stopped_where_it_says() -> None:
    """A shaft through A that the coupler passes over: both pivots held on both sides."""
    case = TABLE["E4"]
    found = arrange(machine_of(case), StackRequest("both", mounts={"A": "below+above", "B": "below+above"}), Work())
    assert found.status == "blocked"
    first, last = np.rad2deg(found.free)
    # across the seam of the turn as a single interval
    assert (first, last) == pytest.approx((334.5168847, 360 + 245.4003876), abs=1e-6)
    assert set(found.low.pair) == set(found.high.pair) == {"coupler", "A"}
    assert np.rad2deg(found.low.at) == pytest.approx(first, abs=1e-9)
    assert np.rad2deg(found.high.at) == pytest.approx(last, abs=1e-9)
    assert [collision.pair for collision in found.collisions] == [("coupler", "A")]
