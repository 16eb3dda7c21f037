"""The search within limits: its seeds, its descents, and that what it finds keeps what was asked."""

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import linkage_atlas as la
from linkage_atlas.limits import read_limits
from synthesis.descents import Stage, Timed
from synthesis.fourbar.limits import Constraints, Limits
from synthesis.fourbar.mechanism import FOURBAR, GrashofChart
from synthesis.rounds import Found
from synthesis.search import problems
from synthesis.search.problems import GivenProblem
from synthesis.search.search import GivenRounds
from synthesis.search.seeds import Windows
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.conftest import some_of
from tests.oracles.classes import make_case
from tests.oracles.limited_classes import make_limited
from tests.oracles.recompute import broken_limits, recompute

LAW = settings(max_examples=15, deadline=None)
LIMITS = Limits("any", 0.5, link_min=0.3, pivot_box=(-3.0, -3.0, 3.0, 3.0))


@pytest.fixture(scope="module")
def windows() -> Windows:
    return Windows(FOURBAR, FOURBAR.bounded_types("full_crank"))


def motion_of(request: dict[str, Any]) -> la.Motion:
    parts = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return la.Motion(**{name: request.get(name) for name in parts})


def target_of(request: dict[str, Any]) -> Target:
    return motion_of(request).target


def drawn(seed: int, posed: bool) -> tuple[GivenProblem, Timed]:
    """A motion that no linkage is bound to perform, within limits, and candidates in random poses."""
    random, samples = np.random.default_rng(seed), 14
    position = np.cumsum(random.normal(size=samples)) + 1j * np.cumsum(random.normal(size=samples))
    target = make_target(np.cumsum(random.normal(size=samples)) / 5, position, 3.0)
    constraints = Constraints(Limits(transmission_angle_min=0.6))
    if posed:
        constraints = Constraints(LIMITS, target.middle, target.length_scale)
    chart = GrashofChart()
    shape = chart.within(random.uniform(0.2, 1.0, (20, 4)))
    start, pose = random.uniform(0, 6, 20), random.normal(size=(20, 6)).view(complex)
    timed = problems.given(shape, random.choice([-1.0, 1.0], 20), start, pose)
    return GivenProblem(target, chart, constraints, posed), timed


@LAW
@given(st.integers(0, 10_000), st.booleans())
@example(1, True)
@example(13, True)
@example(123, True)
@example(205, True)
def test_no_candidate_is_worse_than_its_seed(seed, posed) -> None:
    """By J squared and the squares of broken limits of a single weight; moving onto limits breaks none more."""
    problem, timed = drawn(seed, posed)
    begin = problem.descended(timed, [Stage(0, weight=1.7)])
    found = problem.descended(timed, [Stage(12, weight=1.7)])
    assert np.all(found.cost <= begin.cost)
    lacking = problem.lacking(found.timed)
    # a limit counts from its margin on
    assert np.all(found.cost >= problem.measured(found.timed, posed=not posed).cost + 1.7**2 * lacking[0] - 1e-12)
    assert np.all(problem.moved_onto(found.timed)[1] <= lacking[1])


def test_equations_are_met_to_rounding_in_the_end(windows) -> None:
    target = target_of(make_case("unreachable", 3).request)
    scale = target.length_scale
    limits = Limits(pivot_b=target.middle + scale * (1 - 2j), links=(0.7 * scale, None, None, None))
    way, found = FOURBAR.bounded(target, limits)[0], Found(1e-10, lambda least: None)
    run = GivenRounds(target, way, limits.family, found, Work())
    for _ in run.closest(run.seeds(windows), 4):
        pass
    pool = found.pools[way.chart]
    assert pool.cost.size > 5
    for linkage in run.within.linkages(FOURBAR, pool):
        assert abs(linkage.pivot_b - limits.pivot_b) < 1e-12 * scale * 4
        assert abs(linkage.links[0] / (0.7 * scale) - 1) < 1e-12
    seeds = windows.seeds(run.within, way.on_shape, way.boxes).take(slice(0, 20))
    down = run.within.descended(seeds, [Stage(10, weight=10.0)])
    assert np.median(run.within.lacking(down.timed)[1]) < 1e-2
    on_them, broken = run.within.moved_onto(down.timed)
    assert np.mean(broken < 1e-13) > 0.9 and np.isfinite(on_them.cost).all()


@pytest.mark.parametrize("kind", ["broken", "boxed", "machine", "kept"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_found_keeps_every_limit(kind, seed) -> None:
    request = make_limited(kind, seed).request
    reply = la.synthesize(**request, top=4).to_dict()
    assert reply["solutions"]
    for solution in reply["solutions"]:
        assert broken_limits(request, solution) == []
    if kind == "kept":
        assert recompute(request, reply["solutions"][0]).objective < 1e-9


BOXED = [
    0.3407, 0.1491, 0.09562, 0.5419, 0.1466, 0.2858, 0.2101, 0.6646, 0.113, 0.3274, 0.3486, 0.2593, 0.181, 0.9055,
    0.06044, 0.5297, 0.2169, 0.1514, 0.2361, 0.3575, 0.1795, 0.4176, 0.4458, 0.3789, 0.2063, 0.2618, 0.0833, 0.2264,
    0.3471, 0.3635, 0.3143, 0.2648, 0.3243, 0.3062, 0.3748, 0.1446, 0.1303, 0.3576, 0.4906, 0.2558,
]  # fmt: skip
"""The least J that any search found for the first requests with boxes, long ones too."""


@pytest.mark.parametrize("seeds", some_of([range(10), range(10, 40)], 1))
def test_limits_that_are_hard_to_keep_do_not_hide_the_best(seeds) -> None:
    """Candidates that move better but break limits must not crowd out those that keep them."""
    over = []
    for seed in seeds:
        found = la.synthesize(**make_limited("boxed", seed).request, top=1)
        over.append(found.best.errors.objective / BOXED[seed])
    assert np.mean(np.array(over) > 1.01) <= 0.1 and max(over) < 1.1


def test_an_exact_linkage_in_a_narrow_valley_that_just_keeps_its_limits() -> None:
    """A few steps lead near it, still outside of its limits: it must be followed to its end before it is judged."""
    request = make_limited("kept", 55).request
    solution = la.synthesize(**request, top=1).to_dict()["solutions"][0]
    assert broken_limits(request, solution) == []
    assert recompute(request, solution).objective < 1e-9


def named(middle: np.ndarray, extent: float) -> dict[str, Any]:
    """Each limit for a motion of this size at this place."""
    box = _box(middle, extent)
    return {
        "transmission_angle_min_turn": 20.0,
        "link_ratio_max": 2.5,
        "links": {"rocker": 1.3 * extent},
        "pivot_a": (middle + np.array([extent, -extent])).tolist(),
        "pivot_b": (middle - extent).tolist(),
        "pivot_a_box": box,
        "pivot_b_box": box,
        "keep_out": [_box(middle, 1.2 * extent), _box(middle + 2 * extent, 0.5 * extent)],
        "coupler_radius_max": 1.2 * extent,
        "envelope": _box(middle, 2.2 * extent),
        "preset": "practical",
    }


def _box(middle: np.ndarray, half: float) -> list[float]:
    return [*(middle - half).tolist(), *(middle + half).tolist()]


def place_of(request: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Middle and extent of a request's positions."""
    position = np.array(request["position"])
    middle = position.mean(axis=0)
    return middle, float(np.linalg.norm(position - middle, axis=1).max())


def named_and_timed() -> list:
    """Each limit with crank angles given and free; the default run takes one of the two, in turn."""
    return [
        pytest.param(name, timing, marks=[pytest.mark.wide] * ((k + other) % 2))
        for k, name in enumerate(named(np.zeros(2), 1.0))
        for other, timing in enumerate(("given", "free"))
    ]


@pytest.mark.parametrize(("name", "timing"), named_and_timed())
def test_each_limit_is_kept(name, timing) -> None:
    request = dict(make_case("unreachable", len(name), 10).request)
    middle, extent = place_of(request)
    request["limits"] = {name: named(middle, extent)[name]}
    if timing == "free":
        del request["crank_span"]
        request["timing"] = "free"
    reply = la.synthesize(**request, top=2).to_dict()
    assert reply["solutions"]
    if name == "preset":
        kept = {"transmission_angle_min": 35, "transmission_angle_min_turn": 15, "link_ratio_max": 10}
        request["limits"] = kept | {"link_max": 10 * extent}
    for solution in reply["solutions"]:
        assert broken_limits(request, solution) == []


def test_a_field_beside_the_preset_replaces_its_value() -> None:
    request = make_case("unreachable", 2, 10).request
    position = np.array(request["position"])
    motion = la.Motion(request["rotation"], position, request["crank_span"])
    read = read_limits
    assert read({"preset": "practical"}, motion).transmission_angle_min == pytest.approx(np.radians(35))
    mine = read({"preset": "practical", "transmission_angle_min": 50, "pivot_a": [0, 0], "link_max": 7}, motion)
    assert mine.transmission_angle_min == pytest.approx(np.radians(50)) and mine.link_max == 7
    assert mine.pivot_reach.pivot_a is None and mine.pivot_reach.pivot_b == pytest.approx(10 * motion.samples.extent)
    with pytest.raises(la.FieldError, match="preset"):
        read({"preset": "pretty"}, motion)


def test_what_excludes_everything_is_named() -> None:
    request = make_case("any order", 4, 12).request
    middle, extent = place_of(request)
    box = _box(middle, 0.5 * extent)
    reply = la.synthesize(**request, limits={"link_min": 4 * extent, "pivot_box": box}, top=1)
    assert reply.status == "infeasible"
    note = next(note for note in reply.report.notes if "(`limits.link_min`)" in note)
    eased = float(note.split("; with links of at least ")[1].split()[0])
    again = la.synthesize(**request, limits={"link_min": eased, "pivot_box": box}, top=1)
    assert again.solutions
    cut = la.synthesize(**request, limits={"link_min": 4 * extent, "pivot_box": box}, top=1, budget=1e-6)
    assert cut.status == "unknown" and not cut.solutions


def test_diverse_solutions_lie_farther_apart() -> None:
    """Over several requests: those of one may lie far apart by chance."""
    apart: dict[bool, float] = {False: 0.0, True: 0.0}
    for seed in range(6):
        request, best = make_case("unreachable", seed, 12).request, []
        for diverse in apart:
            found = la.synthesize(**request, top=5, diverse=diverse).solutions
            best.append(found[0].errors.objective)
            assert not diverse or all(one.errors.objective <= 2 * best[0] for one in found)
            rows = np.array([np.log(one.linkage.links) for one in found])
            apart[diverse] += float(np.mean(np.abs(rows[:, None] - rows)))
        assert best[0] == best[1]
    assert apart[True] > 1.1 * apart[False]


def test_determination_leaves_out_what_limits_hold() -> None:
    """A length at its limit has no uncertainty; the others move as the best linkage does when the motion is disturbed."""
    request = make_limited("boxed", 1, 12).request
    position, (_, extent) = np.array(request["position"]), place_of(request)
    limits = {"links": {"ground": 1.5 * extent}}
    plain = {name: request[name] for name in ("rotation", "crank_span")}
    best = la.synthesize(position=position, **plain, limits=limits, top=1).solutions[0]
    held = best.determination
    assert "links.ground" in held.at_limits and held.length_uncertainty[3] < 1e-12
    random, size = np.random.default_rng(2), 1e-5
    for _ in range(3):
        noise = random.normal(size=position.shape)
        noise *= size * extent / np.sqrt(np.mean(np.sum(noise**2, axis=1)))
        moved = la.synthesize(position=position + noise, **plain, limits=limits, top=1).solutions[0]
        change = np.abs(np.log(moved.linkage.links) - np.log(best.linkage.links))
        assert np.all(change <= 1.05 * size * held.length_uncertainty / held.resolution + 1e-8)
