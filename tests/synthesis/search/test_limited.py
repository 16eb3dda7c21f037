"""The search within limits: its problems' derivatives, its descents, and that what it finds keeps what was asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import linkage_atlas as la
from linkage_atlas.limits import read_limits
from synthesis.fourbar.charts import GrashofChart, LengthsChart
from synthesis.fourbar.limits import Constraints, Limits
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.search.problems import Descended, Plan, PosedProblem, ShapeProblem, descend, restored
from synthesis.search.search import LimitedSearch
from synthesis.search.seeds import Windows
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.oracles.classes import make_case
from tests.oracles.limited_classes import make_limited
from tests.oracles.recompute import broken_limits, recompute

LAW = settings(max_examples=15, deadline=None)
LIMITS = Limits("any", 0.5, link_min=0.3, pivot_box=(-3.0, -3.0, 3.0, 3.0))


@pytest.fixture(scope="module")
def windows() -> Windows:
    return Windows(FOURBAR, FOURBAR.bounded_types("full_crank"))


def target_of(request: dict[str, Any]) -> Target:
    parts = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return la.Motion(**{name: request.get(name) for name in parts}).target


def posed_problem(seed: int, chart: Any, weighted: bool = False) -> tuple[PosedProblem, np.ndarray, np.ndarray]:
    """A problem and candidates that close."""
    random, samples = np.random.default_rng(seed), 14
    weights = random.uniform(0.1, 2, (2, samples)) if weighted else (None, None)
    position = np.cumsum(random.normal(size=samples)) + 1j * np.cumsum(random.normal(size=samples))
    rotation = np.cumsum(random.normal(size=samples)) / 5
    target = make_target(rotation, position, 3.0, rotation_weights=weights[0], position_weights=weights[1])
    middle = complex(target.position_mean(target.position))
    problem = PosedProblem(target, chart, Constraints(LIMITS, middle, target.length_scale))
    shapes = random.uniform(0.2, 1.0, (20, 4))
    lengths = GrashofChart(scaled=False).shape(shapes).lengths
    rest = np.column_stack([random.uniform(0, 6, 20), random.normal(size=(20, 5))])
    return problem, np.hstack([chart.unknowns(lengths), rest]), random.choice([-1.0, 1.0], 20)


@pytest.mark.parametrize("weighted", [False, True], ids=["all alike", "weighted"])
@pytest.mark.parametrize("chart", [GrashofChart(scaled=False), LengthsChart()], ids=lambda one: type(one).__name__)
def test_derivatives_are_those_of_central_differences(chart, weighted) -> None:
    problem, unknowns, branch = posed_problem(1, chart, weighted)
    rows, limits = problem.evaluate(unknowns, branch).stack, problem.constrained(unknowns, branch)
    for k in range(problem.unknowns):
        step = 1e-6 * np.eye(problem.unknowns)[k]
        ahead, behind = (problem.evaluate(unknowns + sign * step, branch).stack[:, -1] for sign in (1, -1))
        np.testing.assert_allclose(rows[:, k], (ahead - behind) / 2e-6, atol=1e-6 * (1 + np.abs(rows[:, k]).max()))
        ahead, behind = (problem.constrained(unknowns + sign * step, branch).values for sign in (1, -1))
        gap = np.abs(limits.slopes[:, :, k] - (ahead - behind) / 2e-6)
        assert np.quantile(gap, 0.98) < 1e-6 * (1 + np.abs(limits.slopes).max())


@LAW
@given(st.integers(0, 10_000), st.sampled_from(["shape", "pose"]))
@example(13, "pose")
@example(123, "pose")
@example(205, "pose")
def test_no_candidate_is_worse_than_its_seed(seed, kind) -> None:
    """By the augmented Lagrangian of a single weight; restoring never leaves more broken than it finds."""
    problem, unknowns, branch = posed_problem(seed, GrashofChart(scaled=False))
    if kind == "shape":
        plain = Constraints(Limits(transmission_angle_min=0.6))
        problem = ShapeProblem(problem.target, GrashofChart(), plain)
        unknowns = np.hstack([problem.chart.within(unknowns[:, :4]), unknowns[:, 4:5]])

    def merit(at: np.ndarray) -> np.ndarray:
        lacking = np.maximum(1e-7 - problem.constrained(at, branch).values, 0.0)
        return problem.evaluate(at, branch).cost + 3.0 * np.sum(lacking**2, axis=1)

    found = descend(problem, unknowns, branch, Plan(12, (3.0,), 100), Work())
    assert np.all(merit(found.unknowns) <= merit(unknowns) * (1 + 1e-9))
    assert np.all(restored(problem, found).broken <= found.broken * (1 + 1e-9))


def test_equations_are_met_by_each_step_and_to_rounding_in_the_end(windows) -> None:
    target = target_of(make_case("unreachable", 3).request)
    middle, scale = complex(target.position_mean(target.position)), target.length_scale
    limits = Limits(pivot_b=middle + scale * (1 - 2j), links=(0.7 * scale, None, None, None))
    way = FOURBAR.bounded(target, limits)[0]
    run = LimitedSearch(target, way, windows, Work(), lambda cost: None)
    found, problem = run.search(10), run.whole
    assert found.branch.size
    for linkage in problem.linkages(FOURBAR, found.unknowns, found.branch, target):
        assert abs(linkage.pivot_b - limits.pivot_b) < 1e-12 * scale * 4
        assert abs(linkage.links[0] / (0.7 * scale) - 1) < 1e-12
    nothing = np.empty(0)
    seeds = windows.seeds(problem, way.on_shape, way.boxes)
    on_them = restored(problem, Descended(seeds.unknowns[:20], seeds.branch[:20], nothing, nothing))
    down = descend(problem, on_them.unknowns, on_them.branch, Plan(10, (1.0, 10.0), 5), Work())
    moved = np.abs(problem.constrained(down.unknowns, down.branch).values[:, :3])
    assert np.median(moved) < 1e-3


def test_windows_come_in_the_best_pose_that_boxes_leave(windows) -> None:
    """Against the same fit by least squares over a dense grid of places for both pivots."""
    target = target_of(make_case("unreachable", 5).request)
    middle, scale = complex(target.position_mean(target.position)), target.length_scale
    low, high = middle - scale * (1 + 1j), middle + scale * (1 + 0.5j)
    limits = Limits(pivot_box=(low.real, low.imag, high.real, high.imag))
    way = FOURBAR.bounded(target, limits)[0]
    problem = PosedProblem(target.condensed(12), way.chart, way.constraints)
    seeds = windows.seeds(problem, way.on_shape, way.boxes)
    cost = problem.evaluate(seeds.unknowns[:2], seeds.branch[:2]).cost
    for unknowns, branch, mine in zip(seeds.unknowns[:2], seeds.branch[:2], cost):
        with_pivots = _with_pivots(problem, unknowns, branch)
        places = [complex(x, y) for x in np.linspace(-1, 1, 9) for y in np.linspace(-1, 0.5, 9)]
        assert mine <= min(with_pivots(a, b) for a in places for b in places) + 0.02


def _with_pivots(problem: PosedProblem, unknowns: np.ndarray, branch: float) -> Callable[[complex, complex], float]:
    """J squared of a shape and start with pivots A and B at given places and the best z2."""
    target, start = problem.target, unknowns[problem.size]
    lengths = problem.chart.shape(unknowns[None, : problem.size]).lengths
    angle = FOURBAR.body_angle(lengths, np.array([branch]), start + target.crank)[0]
    gap = target.rotation - angle
    turned = target.rotation_mean((gap - target.rotation_mean(gap)) ** 2)
    mean, arm = target.position_mean, np.exp(1j * angle)
    crank = lengths[0, 0] / lengths[0, 3] * np.exp(1j * (start + target.crank))

    def squared(a: complex, b: complex) -> float:
        if abs(b - a) < 1e-9:
            return np.inf
        rest = problem.scaled - a - (b - a) * crank
        rest = rest - arm * mean(np.conj(arm) * rest)
        return float(mean(np.abs(rest) ** 2) + turned)

    return squared


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


@pytest.mark.parametrize(("kind", "seed", "best"), [("boxed", 13, 0.9055), ("boxed", 37, 0.3576)])
def test_limits_that_are_hard_to_keep_do_not_hide_the_best(kind, seed, best) -> None:
    """Candidates that move better but break limits must not crowd out those that keep them."""
    found = la.synthesize(**make_limited(kind, seed).request, top=3)
    assert found.best.errors.objective < 1.01 * best


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
    note = next(note for note in reply.report.notes if note.startswith("link_min excludes"))
    eased = float(note.split(" at ")[1].split()[0])
    again = la.synthesize(**request, limits={"link_min": 0.999 * eased, "pivot_box": box}, top=1)
    assert again.solutions
    cut = la.synthesize(**request, limits={"link_min": 4 * extent, "pivot_box": box}, top=1, budget=1e-6)
    assert cut.status == "unknown" and not cut.solutions


def test_diverse_solutions_lie_farther_apart() -> None:
    request = make_case("unreachable", 6, 12).request
    plain, spread = (la.synthesize(**request, top=5, diverse=diverse) for diverse in (False, True))
    best = plain.solutions[0].errors.objective
    assert spread.solutions[0].errors.objective == best
    assert all(one.errors.objective <= 2 * best for one in spread.solutions)

    def apart(result: la.Result) -> float:
        rows = np.array([np.log(one.linkage.links) for one in result.solutions])
        return float(np.mean(np.abs(rows[:, None] - rows)))

    assert apart(spread) > apart(plain)


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
