"""Enclosures and plates of bodies on two guides agree with shapely at many positions.

A slit that is too short, or a body outside its enclosure, would show here.
"""

import numpy as np
import pytest

from synthesis.assembly.guided_body import GuidedBody
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Sizes
from synthesis.assembly.movement import GROUND, Aimed, BodyPoint, Movement
from synthesis.assembly.stacks import StackRequest, StackSearch
from synthesis.guides import DRIVERS, Circle, Driver, Rail, Slot
from synthesis.linkage import on_guides
from synthesis.target import TURN, Interval
from synthesis.work import Work
from tests.oracles.assembly import disagreements, nearest, sliders

DIRECTIONS = [(driver, second, drive) for driver in DRIVERS for second in DRIVERS for drive in DRIVERS[driver]]


def random_point(rng, size=1.0) -> complex:
    return complex(*rng.normal(size=2)) * size


def guide(rng, kind):
    if kind is Circle:
        return Circle(random_point(rng, 2.0), float(rng.uniform(0.3, 2.0)), random_point(rng))
    if kind is Rail:
        return Rail(random_point(rng, 2.0), float(rng.uniform(0, TURN)), random_point(rng))
    return Slot(random_point(rng, 2.0), random_point(rng), float(rng.uniform(0, TURN)))


@pytest.mark.parametrize(
    "direction",
    DIRECTIONS,
    ids=lambda direction: "-".join([direction[0].__name__, direction[1].__name__, direction[2]]),
)
def test_no_body_leaves_its_enclosure(direction) -> None:
    """Cells of all widths, many of them next to dead positions; and the bounds are not loose everywhere."""
    first, second, drive = direction
    rng, seen, worst = np.random.default_rng(DIRECTIONS.index(direction)), 0, 0.0
    while seen < 25:
        guides = guide(rng, first), guide(rng, second)
        linkage = on_guides(guides, drive, int(rng.choice([-1, 1])), rng.uniform(-3, 3))
        half = 10 ** rng.uniform(-6, -0.3)
        with np.errstate(all="ignore"):
            if not linkage.closes_over(Interval(linkage.start - half, linkage.start + half)):
                continue
        seen += 1
        names, steps = ["ground", "coupler"], [GuidedBody(linkage)]
        driven, last = linkage.guides
        if isinstance(last, Circle):
            names.append("rocker")
            ends = BodyPoint(GROUND, last.pivot), BodyPoint(1, last.body_point - driven.body_point)
            steps.append(Aimed(2, *ends))
        movement = Movement(names, steps)
        cell = movement.bodies(np.array([0.0]), np.array([half]))
        moved = movement.bodies(half * np.linspace(-1, 1, 65))
        for body in range(1, len(names)):
            point = BodyPoint(body, random_point(rng))
            distant = np.abs(moved.point(point) - cell.point(point)[0]).max()
            spread = cell.spread(point)[0]
            assert distant <= spread * (1 + 1e-9) + 1e-9, (body, half)
            worst = max(worst, distant / spread)
    assert worst > 0.4


def test_proofs_of_sliders_agree_with_shapely() -> None:
    for machine in sliders(11):
        search = StackSearch(machine, StackRequest("below"), Work())
        assert disagreements(machine, search)[2] == 0
        found = search.solve()
        assert found.status == "free"
        assert nearest(machine, found) > -1e-9


def test_rails_are_plates_on_posts_with_slits_as_long_as_the_motion() -> None:
    """A slider-crank by formulas: the pin runs over the stroke of crank 1, rod 2, offset 0.3."""
    crank, rail = Circle(0j, 1.0, 0j), Rail(0.3j, 0.0, 2 + 0j)
    machine = as_plates(on_guides((crank, rail), Driver.CRANK, 1, 0.0), Interval(0.0, TURN), Sizes())
    (slit,) = machine.plate("rail").slits
    stroke = np.sqrt((2 + 1) ** 2 - 0.3**2) - np.sqrt((2 - 1) ** 2 - 0.3**2)
    assert abs(slit.core[1] - slit.core[0]) == pytest.approx(stroke)
    assert {pin.name for pin in machine.pins} == {"A", "D", "B1", "B2", "C"}
    posts = [pin for pin in machine.pins if pin.post]
    assert all(pin.grounded and pin.joins == ("rail",) for pin in posts)


def test_a_pin_in_a_slit_meets_the_other_pins_of_its_plate() -> None:
    """A slot whose pin passes the body's other pin: collides though both are joined to the coupler."""
    crank, slot = Circle(0j, 1.0, 0j), Slot(1.5 + 0j, 0j, 0.0)
    linkage = on_guides((crank, slot), Driver.CRANK, 1, np.pi / 2)
    machine = as_plates(linkage, Interval(0.0, 1.0), Sizes(0.3, 0.6, 0.0))
    names = StackSearch(machine, StackRequest("below"), Work()).sliding
    assert names == {("coupler", frozenset(("B", "D")))}
    # at travel -pi / 2 the crank points at the pin: 0.5 apart
    close = as_plates(linkage, Interval(-1.5, 1.0), Sizes(0.45, 0.9, 0.2))
    found = StackSearch(close, StackRequest("below"), Work()).solve()
    assert any(set(collision.pair) == {"B", "D"} for collision in found.collisions)


def test_the_motion_ends_where_a_slit_or_the_loop_does() -> None:
    """Compare with consecutive positions of the drive and the loop's own conditions."""
    seen = set()
    for machine in sliders(24):
        step = machine.movement.steps[0]
        assert isinstance(step, GuidedBody)
        linkage, (first, last) = step.linkage, machine.used
        if machine.whole_turn:
            assert machine.slit_ends == (None, None)
            continue
        slid = [index for index, guide in enumerate(linkage.guides) if not isinstance(guide, Circle)]
        spans = {position: linkage.used(position, machine.used) for position in slid}
        for begin, direction, end, k in ((first, -1, machine.slit_ends[0], 0), (last, 1, machine.slit_ends[1], 1)):
            bound = None if machine.loop is None else machine.loop[k]
            if bound is not None and np.isfinite(bound):
                inside, outside = (sorted((begin, bound + direction * by)) for by in (-1e-9, 1e-9))
                assert linkage.closes_over(Interval(linkage.start + inside[0], linkage.start + inside[1]))
                assert not linkage.closes_over(Interval(linkage.start + outside[0], linkage.start + outside[1]))
            reach = TURN - (last - first) if linkage.driver.turns else 2 * (last - first)
            reach = reach if bound is None else min(reach, abs(bound - begin))
            positions = begin + direction * np.linspace(0, 1, 4001) * reach
            off = []
            for index, (low, high) in spans.items():
                along = linkage.along(index, positions)
                off.append(np.nan_to_num(np.maximum(along - high, low - along), nan=-1) > 1e-9 * machine.size)
            left = np.flatnonzero(np.any(off, axis=0))
            if end is None:
                assert not left.size
                seen.add("loop")
                continue
            assert end.pair[0] in "ABCD"
            assert direction * (end.at - begin) >= -1e-12
            seen.add("at once" if end.at == begin else "later")
            if left.size:
                assert direction * (positions[left[0]] - end.at) >= -1e-6 * reach
                assert direction * (positions[max(left[0] - 1, 0)] - end.at) <= 1e-6 * reach
    assert {"at once", "later"} <= seen
