"""Derivatives of pairs of guides agree with differences, their limits with finished linkages; huge circles keep their digits.

A wrong derivative of an error or of a limit, or a limit that a search measures otherwise than the check, would show here.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from synthesis.guided.answers import as_guides, linkage_of
from synthesis.guided.pairs import Chart, Guides, Looked, Pairs, Problem, Samples, Stage
from synthesis.guides import Circle
from synthesis.limits import Limits, Reach
from synthesis.poses import Poses, make_poses
from synthesis.violations import violations_of
from synthesis.work import Work
from tests.conftest import some_of
from tests.oracles.guided_cases import DRIVES, good_linkage

COUNT, SAMPLES, STEP = 36, 6, 1e-7
NONE = Limits(family="any")
BOX = (-0.5, -0.4, 0.6, 0.7)
EACH = {
    "transmission": Limits(family="any", transmission_angle_min=0.7),
    "arm": Limits(family="any", arm_min=0.8),
    "stroke": Limits(family="any", stroke_max=0.3),
    "longest": Limits(family="any", link_max=0.8),
    "shortest": Limits(family="any", link_min=0.9),
    "ratio": Limits(family="any", link_ratio_max=1.2),
    "coupler radius": Limits(family="any", coupler_radius_max=0.5),
    "links": Limits(family="any", links=(0.5, 0.6, None, 0.7)),
    "cylinder": Limits(family="any", cylinder_dead_length=0.7, cylinder_extended_max=0.9),
    "pivots": Limits(family="any", pivot_a=0.1 + 0.2j, pivot_b=0.3j),
    "boxes": Limits(family="any", pivot_a_box=BOX, pivot_b_box=BOX),
    "reach": Limits(family="any", pivot_reach=Reach(0.1 - 0.2j, 0.5, 0.6)),
    "keep out": Limits(family="any", keep_out=((-2.0, -2.0, 0.2, 2.0),)),
    "rail": Limits(family="any", rail_box=BOX),
    "envelope": Limits(family="any", envelope=BOX),
    "order": Limits(family="any"),
}


def guides(random: np.random.Generator, sort: np.ndarray) -> Guides:
    """Circles (0), rails (1) and slots (2) of the size of the motion."""
    point, foot = (0.5 * (random.normal(size=COUNT) + 1j * random.normal(size=COUNT)) for _ in range(2))
    bent = np.where(sort == 0, random.uniform(0.5, 2.0, COUNT), 0.0)
    return Guides(point, foot, random.uniform(0, 2 * np.pi, COUNT), bent, sort == 2)


def motion(random: np.random.Generator) -> Poses:
    along = np.linspace(0, 1, SAMPLES)
    noise = 0.03 * random.normal(size=(3, SAMPLES))
    return make_poses(0.5 * along + noise[0], along * np.exp(0.3j) + noise[1] + 1j * noise[2], ordered=False)


def pairs() -> tuple[np.random.Generator, Pairs, np.ndarray]:
    """Pairs of all sorts, and for each its branch, way and signs."""
    random = np.random.default_rng(4)
    number = np.arange(COUNT)
    built = Pairs(guides(random, number % 3), guides(random, number // 3 % 3), (number % 3 == 2) & (number % 2 == 0))
    labels = np.stack([*np.sign(random.normal(size=(2, COUNT))), 0.1 * random.random(COUNT), np.ones(COUNT)], axis=1)
    return random, built, labels


def apart(built: Guides, k: int, angle: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the distance of a guide's point from its curve by the textbook formula."""
    turned = np.exp(1j * angle)
    point = complex(built.point[k])
    at = np.conj(turned) * (point - position) if built.inverse[k] else position + turned * point
    if built.curvature[k] == 0:
        return (np.conj(np.exp(1j * built.normal[k])) * (at - built.foot[k])).real
    return np.abs(at - built.centre[k]) - 1 / built.curvature[k]


def reaching(problem: Problem, built: Pairs, labels: np.ndarray) -> np.ndarray:
    """Pairs refined without limits first, so that their poses are near."""
    found, _ = problem.descended(Chart(built), labels, Stage(60, 0.0, 6, 0.0, 1e-2), Work())
    return found


def passed() -> tuple[Poses, list[tuple[Pairs, np.ndarray, Samples, np.ndarray]]]:
    """Return a motion, and pairs with labels, nearby samples that they pass, and the drive at these samples."""
    random, built, labels = pairs()
    poses = motion(random)
    problem = Problem(samples := Samples.of(poses), NONE, poses, False)
    built = reaching(problem, built, labels)
    at, found = problem.look(Chart(built), labels, 40), []
    for k in range(COUNT):
        angle, x, y = at.poses[k].T
        gaps = [apart(guide, k, angle, x + 1j * y) for guide in built.guides]
        if np.abs(gaps).max() < 1e-9 and np.abs(at.poses[k]).max() < 5:
            own = samples._replace(angle=angle, position=x + 1j * y)
            found.append((built.take([k]), labels[[k]], own, at.drive[k]))
    assert len(found) > 0.6 * COUNT
    return poses, found


def differences(priced: Callable[[np.ndarray], float], x: np.ndarray) -> np.ndarray:
    steps = STEP * np.eye(x.size)
    return np.array([(priced(x + step) - priced(x - step)) / (2 * STEP) for step in steps])


def slopes_agree(problem: Problem, chart: Chart, labels: np.ndarray, x: np.ndarray, weight: float = 0.5) -> bool:
    """Check the derivatives of a pair if its poses close; return true if it violates a limit there."""

    def at(x: np.ndarray) -> Looked:
        return problem.look(Chart(chart.pairs_at(x[None, :10])), labels, 12, x[10:] if x.size > 10 else None)

    def priced(x: np.ndarray) -> float:
        return float((at(x).cost + weight * at(x).excess)[0])

    here = at(x)
    if here.closed[0]:
        own = np.concatenate([chart.labels, labels], axis=1)
        own_unknowns = np.concatenate([chart.start[0], x[10:]])[None]
        _, rows = problem._kernel.linearise(own_unknowns, own, weight, 12)
        found = 2 * rows[0, :-1] @ rows[0, -1]
        expected = differences(priced, x)
        assert np.allclose(found, expected, atol=2e-5 * max(1.0, np.abs(expected).max())), found - expected
    return bool(here.excess[0] > 1e-3)


@pytest.mark.parametrize(
    ("name", "driven"),
    some_of([(name, bool((k + second) % 2)) for second in (0, 1) for k, name in enumerate(EACH)], 16),
)
def test_slopes_of_errors_and_limits(name, driven):
    """At poses that the pairs pass: there the derivatives are exact. Given the drive they are everywhere."""
    broken, bent = 0, np.random.default_rng(6)
    poses, all_cases = passed()
    poses = replace(poses, ordered=name == "order")
    for built, labels, samples, drive in all_cases:
        turns = not (built.first.straight & ~built.hinge)[0]
        prescribed = (np.unwrap(drive) if turns else drive) - drive[0]
        problem = Problem(samples._replace(drive=prescribed if driven else 0 * prescribed), EACH[name], poses, driven)
        begin = Chart(built).start + (1e-4 if driven else 1e-9) * bent.normal(size=10)
        chart = Chart(Chart(built).pairs_at(begin))
        x = np.concatenate([chart.start[0], drive[:1]])[: 11 if driven else 10]

        broken += slopes_agree(problem, chart, labels, x)
    assert broken > 2


def poses_of(poses: Poses) -> np.ndarray:
    """Return rotation and position in the units of the search, (N, 3)."""
    scaled = (poses.position - poses.middle) / poses.length_scale
    return np.stack([poses.rotation, scaled.real, scaled.imag], axis=1)


@pytest.mark.parametrize("name", EACH)
def test_a_search_avoids_what_a_finished_linkage_violates(name) -> None:
    """The search measures limits at samples; these are dense, so that both differ little."""
    random, violated, satisfied = np.random.default_rng(9), 0, 0
    drives = [drive for drive in DRIVES if drive[::2] != (Circle, Circle)]
    for drive, size in [(drive, size) for drive in drives for size in (1.0, 0.5, 0.2, 0.1)]:
        linkage = good_linkage(random, drive, 0.0, 1.0, 0.3).scaled(size)
        travel = np.linspace(0.0, 1.0 if linkage.driver.turns else size, 120)
        body = linkage.body(linkage.start + travel)
        poses = make_poses(body.rotation, body.position, ordered=False)
        chart = Chart(Pairs(*(as_guides(guide, poses) for guide in linkage.guides), np.array([drive[1] == "hinge"])))
        solution = linkage_of(chart.pairs.guides, drive[1], poses, poses_of(poses), None)
        violation = max(violations_of(solution, poses, EACH[name]).values(), default=0.0)
        problem = Problem(Samples.of(poses), EACH[name], poses, False)
        branch = np.sign(problem.look(chart, np.zeros((1, 3)), 12).sines[0])
        worst = problem.look(chart, np.array([[branch, 1.0, 1.0]]), 12).worst[0] * poses.length_scale / poses.extent
        assert worst > 0 or violation < 0.02, (linkage, violation)
        assert violation > 0 or worst < 0.02, (linkage, worst)
        violated, satisfied = violated + (violation > 0.02), satisfied + (violation == 0)
    assert satisfied > 3 and (violated > 3 or name == "order"), (satisfied, violated)


@pytest.mark.parametrize("radius", [1e2, 1e4, 1e8])
def test_a_circle_of_any_radius_keeps_its_digits(radius):
    """Ten places of an arc of chord 2: the curvature that fits them best is its own."""
    along = np.linspace(-1, 1, 10) / radius
    position = radius * np.sin(along) + 1j * 2 * radius * np.sin(along / 2) ** 2
    poses = make_poses(np.zeros(10), position)
    samples = Samples.of(poses)._replace(position=position)
    unit, no = np.ones(1), np.zeros(1, dtype=bool)
    circle = Guides(0j * unit, 0j * unit, np.pi / 2 * unit, 1 / radius * unit, no)
    slot = Guides(0j * unit, 0j * unit, np.pi / 2 * unit, 0 * unit, ~no)
    found = Problem(samples, NONE, poses, False).look(Chart(Pairs(circle, slot, no)), np.zeros((1, 4)), 1)
    assert np.isfinite(found.cost[0])
    found = Problem(samples, NONE, poses, False).look(Chart(Pairs(circle, circle, no)), np.zeros((1, 4)), 1)
    assert found.cost[0] < 1e-26
