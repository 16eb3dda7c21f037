"""Performance profiles: which share of the requests a method solves within a factor of the best time, and what it fails at.

Requests with crank angles, poses without, and requests within limits; every method has the same cases, one after the other
in the same process, in processor time. *Random starts* are what one writes without this package: scipy's least squares over
the dimensions and the mounting as they are, from random ones until it is exact (within limits: SLSQP, `benchmarks.limited`).
pylinkage's answers count as they are and after ten least-squares steps from the best three. A request is solved where J is
below 1e-9, within limits where J is at most 1.01 times the least of all methods.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from benchmarks import baselines, limited, product, report
from benchmarks.figures import BLUE, BROWN, GREEN, GREY, ORANGE, PURPLE, figure
from benchmarks.report import Times
from tests.oracles.classes import make_case
from tests.oracles.free_classes import free_case, free_request, recompute_free
from tests.oracles.limited_classes import make_limited

OURS, PUBLISHED, STARTS, EVOLUTION = "linkage-atlas", "published table", "random starts", "differential evolution"
RAW, POLISHED = "pylinkage", "pylinkage, polished"
COLOURS = dict(zip((OURS, PUBLISHED, STARTS, EVOLUTION, RAW, POLISHED), (GREEN, BROWN, BLUE, PURPLE, GREY, ORANGE)))
TIMED, FREE, LIMITED = "crank angles given", "poses alone", "within limits"
CLASSES = ("plain", "any order", "double-crank", "uneven crank angles", "tiny crank", "change point")
FREE_POSES = (5, 6, 8, 12)
LIMITED_KINDS = ("broken", "boxed", "machine")
REACHED, CLOSE = 1e-9, 1.01
FACTORS = (1, 2, 5, 10, 100)
RANDOM_STARTS, POLISH_STEPS, POLISHED_ANSWERS, SUBSETS = 20, 10, 3, 9
GENERATIONS, FREE_GENERATIONS = 1280, 300


class Motion(NamedTuple):
    """Poses about the origin and of size 1; without crank angles these are unknowns too."""

    rotation: np.ndarray
    position: np.ndarray
    crank: np.ndarray | None

    @classmethod
    def of(cls, rotation: np.ndarray, position: np.ndarray, crank: np.ndarray | None) -> Motion:
        centred = position - position.mean()
        return cls(rotation, centred / np.max(np.abs(centred)), crank)

    def residual(self, x: np.ndarray, branch: float) -> np.ndarray:
        """Errors whose squares add up to J^2; x: logarithms of the lengths, offset, ground angle, pivot A, arm, crank angles."""
        crank_length, coupler, rocker, ground = np.exp(np.clip(x[:4], -30, 30))
        offset, turned, pivot, arm = x[4], np.exp(1j * x[5]), complex(x[6], x[7]), complex(x[8], x[9])
        pin = crank_length * np.exp(1j * (x[10:] if self.crank is None else x[10] + self.crank))
        toward = ground - pin
        distance = np.abs(toward)
        along = (distance**2 + coupler**2 - rocker**2) / (2 * distance)
        square = coupler**2 - along**2
        direction = (along + 1j * branch * np.sqrt(np.maximum(square, 0))) * toward / distance
        rotation = np.angle(np.exp(1j * (self.rotation - np.angle(direction) - x[5] - offset)))
        miss = self.position - pivot - turned * (pin + arm * direction / np.maximum(np.abs(direction), 1e-300))
        open_by = np.sqrt(np.maximum(-square, 0)) / coupler
        return np.concatenate([rotation, miss.real, miss.imag, open_by]) / np.sqrt(len(rotation))

    def cost(self, x: np.ndarray, branch: float) -> float:
        """J, infinite where the crank does not pass the poses in their order, turning one way by at most a turn."""
        found = float(np.linalg.norm(self.residual(x, branch)))
        if self.crank is None:
            steps = np.diff(np.unwrap(x[10:]))
            if not (np.all(steps > 0) or np.all(steps < 0)) or abs(steps.sum()) > product.TURN:
                return np.inf
        return found if np.isfinite(found) else np.inf


def from_random_starts(motion: Motion, seed: int) -> float:
    """Least J of least squares from so many random linkages, until one is exact."""
    random, best, count = np.random.default_rng([5, seed]), np.inf, len(motion.rotation)
    for _ in range(RANDOM_STARTS):
        first, sense = random.uniform(0, product.TURN), random.choice([-1.0, 1.0])
        angles = first + sense * np.linspace(0, random.uniform(0.7, product.TURN), count)
        x = np.concatenate(
            [
                random.uniform(np.log(0.3), np.log(5), 4),
                random.uniform(0, product.TURN, 2),
                random.normal(0, 2, 4),
                angles if motion.crank is None else [first],
            ]
        )
        branch = float(random.choice([-1, 1]))
        done = least_squares(motion.residual, x, method="lm", args=(branch,), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        best = min(best, motion.cost(done.x, branch))
        if best < REACHED:
            break
    return best


def pylinkage_answers(motion: Motion, seed: int) -> list[tuple[float, np.ndarray, float]]:
    """J, unknowns and branch of all answers to the subsets of poses, either pivoted link as the crank, the best first."""
    from pylinkage.synthesis import Pose, motion_generation

    found, subsets = [], baselines.pose_subsets(len(motion.rotation), seed)
    for _ in range(SUBSETS):
        for chosen in next(subsets):
            poses = [Pose(p.real, p.imag, r) for p, r in zip(motion.position[chosen], motion.rotation[chosen])]
            for answer in motion_generation(poses, max_solutions=50, require_grashof=False).raw_solutions:
                pivots = [complex(*answer.ground_pivot_a), complex(*answer.ground_pivot_d)]
                pins = [complex(*answer.crank_pivot_b), complex(*answer.coupler_pivot_c)]
                for a, b in ((0, 1), (1, 0)):
                    x, branch = _unknowns(motion, int(chosen[0]), (pivots[a], pivots[b]), (pins[a], pins[b]))
                    if np.all(np.isfinite(x)):
                        found.append((motion.cost(x, branch), x, branch))
    return sorted(found, key=lambda pair: pair[0])


def _unknowns(
    motion: Motion, first: int, pivots: tuple[complex, complex], pins: tuple[complex, complex]
) -> tuple[np.ndarray, float]:
    """A four-bar by its joints at one pose as `Motion.residual` takes it, and its branch."""
    ground, coupler = pivots[1] - pivots[0], pins[1] - pins[0]
    lengths = np.abs([pins[0] - pivots[0], coupler, pins[1] - pivots[1], ground])
    with np.errstate(all="ignore"):
        arm = (motion.position[first] - pins[0]) / (coupler / abs(coupler)) if coupler else np.nan
        turned = np.exp(1j * (motion.rotation - motion.rotation[first]))
        placed = motion.position + turned * (
            pins[0] - motion.position[first]
        )  # the crank pin where the body is wanted
        angles = np.unwrap(np.angle((placed - pivots[0]) * np.conj(ground)))
        start = angles if motion.crank is None else [angles[first] - motion.crank[first]]
        offset = motion.rotation[first] - np.angle(coupler)
        head = [*np.log(lengths), offset, np.angle(ground), pivots[0].real, pivots[0].imag, arm.real, arm.imag]
    # offset and ground angle together turn the body: the first counts from the direction of the coupler in the plane
    return np.concatenate([head, start]), 1.0 if (np.conj(pivots[1] - pins[0]) * coupler).imag > 0 else -1.0


def polished(motion: Motion, answers: list[tuple[float, np.ndarray, float]]) -> float:
    """Least J of the best answers after some least-squares steps."""
    best = answers[0][0] if answers else np.inf
    for _, x, branch in answers[:POLISHED_ANSWERS]:
        done = least_squares(
            motion.residual, x, method="trf", x_scale="jac", args=(branch,), max_nfev=POLISH_STEPS + 1, xtol=None
        )
        best = min(best, motion.cost(done.x, branch))
    return best


class Runs:
    """Milliseconds and J of each method by case."""

    def __init__(self) -> None:
        self.cases: list[str] = []
        self.methods: dict[str, dict[str, list[float | None]]] = {}

    def note(self, method: str, seconds: float, found: float | None) -> None:
        lists = self.methods.setdefault(method, {"ms": [], "J": []})
        lists["ms"].append(float(f"{1000 * seconds:.4g}"))
        lists["J"].append(None if found is None or not np.isfinite(found) else float(f"{found:.3g}"))

    def take(self, method: str, solve: Callable[[], float | None]) -> None:
        times = Times()
        found = times.run(solve)
        self.note(method, times.processor[0], found)

    def with_pylinkage(self, motion: Motion, seed: int) -> None:
        times = Times()
        answers = times.run(pylinkage_answers, motion, seed)
        self.note(RAW, times.processor[0], answers[0][0] if answers else np.inf)
        more = times.run(polished, motion, answers)
        self.note(POLISHED, sum(times.processor), more)

    def plain(self) -> dict[str, Any]:
        return {"cases": self.cases, "methods": self.methods}


def best_of(solutions: Any) -> float:
    """J of the first solution; infinite without one."""
    found = solutions[0] if isinstance(solutions, tuple) else solutions
    return found[0].errors.objective if found else np.inf


def searched(
    tables: product.SeedTables, target: product.Target, limits: product.Limits, top: int = 1
) -> Callable[[], float]:
    """The search for motions at given crank angles, until it ends."""
    return lambda: best_of(product.search(tables, target, limits, top, 1e-10, product.ProcessorWork(None)))


def measure_timed(cases: int, tables: product.SeedTables, published: product.Scan) -> Runs:
    """Requests with crank angles that a four-bar performs exactly."""
    runs, limits = Runs(), product.Limits()
    for kind in CLASSES:
        for seed in range(cases // len(CLASSES)):
            target = product.counter_clockwise(product.target_of(make_case(kind, 40_000 + seed).request))
            motion = Motion.of(target.rotation, target.position, target.crank)
            runs.cases.append(f"{kind} {40_000 + seed}")
            runs.take(OURS, searched(tables, target, limits))
            runs.take(PUBLISHED, lambda t=target: best_of(product.best_rows(published, t, limits, 1)))
            runs.take(STARTS, partial(from_random_starts, motion, seed))
            runs.take(EVOLUTION, partial(baselines.evolve, target, GENERATIONS, seed))
            runs.with_pylinkage(motion, seed)
    return runs


def measure_free(cases: int) -> Runs:
    """Poses without crank angles that a four-bar performs exactly."""
    runs = Runs()
    for samples in FREE_POSES:
        for seed in range(cases // len(FREE_POSES)):
            case, request = free_request(free_case(seed, samples), "motion", seed)
            motion = Motion.of(case.rotation, case.position, None)
            runs.cases.append(f"{samples} poses, seed {seed}")

            def ours(case: Any = case, request: dict[str, Any] = request) -> float:
                evaluations = [
                    recompute_free(case.position, case.rotation, solution.to_dict())
                    for solution in product.la.synthesize(**request, top=1).solutions
                ]
                return min((evaluation.objective for evaluation in evaluations if evaluation.one_way), default=np.inf)

            runs.take(OURS, ours)
            runs.take(STARTS, partial(from_random_starts, motion, seed))
            runs.take(
                EVOLUTION, partial(baselines.evolve_poses, case.position, case.rotation, FREE_GENERATIONS, seed)
            )
            runs.with_pylinkage(motion, seed)
    return runs


def measure_limited(cases: int, tables: product.SeedTables, published: product.Scan) -> Runs:
    """Requests within limits, with crank angles; pylinkage knows none."""
    runs = Runs()
    for kind in LIMITED_KINDS:
        for seed in range(cases // len(LIMITED_KINDS)):
            request = make_limited(kind, 500 + seed).request
            target, limits = product.counter_clockwise(product.target_of(request), product.limits_of(request))
            runs.cases.append(f"{kind} {500 + seed}")
            runs.take(OURS, searched(tables, target, limits))
            runs.take(PUBLISHED, lambda t=target, bounds=limits: best_of(product.best_rows(published, t, bounds, 1)))
            runs.take(STARTS, partial(limited.slsqp, target, limits))
            runs.take(EVOLUTION, partial(limited.evolution, target, limits))
    return runs


def measure(cases: Annotated[int, "of each kind of request"] = 48) -> Iterator[dict[str, Any]]:
    """The three kinds of request in turn."""
    baselines.need()
    threadpool_limits(1, "blas")
    product.la.prepare()
    tables = product.SeedTables(product.FOURBAR)
    tables.windows("full_crank")
    published = product.scan_of(product.TypeRule())
    parts: dict[str, Any] = {}
    for name, measure_part in (
        (TIMED, lambda: measure_timed(cases, tables, published)),
        (FREE, lambda: measure_free(cases)),
        (LIMITED, lambda: measure_limited(cases, tables, published)),
    ):
        parts[name] = measure_part().plain()
        yield {"requests": parts}


def solved(name: str, part: dict[str, Any]) -> dict[str, np.ndarray]:
    """Which cases each method solves."""
    found = {
        method: np.array([np.inf if error is None else error for error in lists["J"]])
        for method, lists in part["methods"].items()
    }
    smallest = np.min(list(found.values()), axis=0)
    bound = np.maximum(CLOSE * smallest, REACHED) if name == LIMITED else np.full(len(smallest), REACHED)
    return {method: np.isfinite(values) & (values <= bound) for method, values in found.items()}


def factors(name: str, part: dict[str, Any]) -> dict[str, np.ndarray]:
    """Time of each method over the best of those that solve the case; infinite where it does not."""
    good = solved(name, part)
    ms = {method: np.where(good[method], np.array(lists["ms"]), np.inf) for method, lists in part["methods"].items()}
    best = np.min(list(ms.values()), axis=0)
    return {
        method: np.divide(values, best, out=np.full(len(best), np.inf), where=np.isfinite(best))
        for method, values in ms.items()
    }


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The profile in numbers, and the failures, the method with most first."""
    shares, failures = [], []
    for name, part in results["requests"].items():
        good = solved(name, part)
        for method, over in factors(name, part).items():
            within = {f"within_{factor}": float(np.mean(over <= factor)) for factor in FACTORS}
            ms = float(np.median(part["methods"][method]["ms"]))
            shares.append(
                {"requests": name, "method": method, "cases": len(over), "ms": ms}
                | within
                | {"solved": float(np.mean(good[method]))}
            )
            found = part["methods"][method]["J"]
            missed = [
                (np.inf if J is None else J, case)
                for J, case, ok in zip(found, part["cases"], good[method])
                if not ok
            ]
            if missed:
                worst = sorted(missed, key=lambda pair: -pair[0])[:2]
                said = "; ".join(f"{case}: {report.power(J)}" for J, case in worst)
                failures.append({"requests": name, "method": method, "missed": len(missed), "worst": said})
    failures.sort(key=lambda row: -row["missed"])
    tables = report.tables("profile", {"shares": shares, "failures": failures})
    return tables | {"made": report.made_text([results["made"]])}


def draw(results: dict[str, Any]) -> None:
    """A panel for each kind of request."""
    with figure("profile.svg", 1, 3, (11, 3.9), sharey=True) as (drawing, panels):
        for axes, (name, part) in zip(panels, results["requests"].items()):
            for method, over in factors(name, part).items():
                finite = np.sort(over[np.isfinite(over)])
                x = np.concatenate([[1.0], finite, [1000.0]])
                y = 100 * np.concatenate([[0], np.arange(1, len(finite) + 1), [len(finite)]]) / len(over)
                axes.step(x, y, where="post", color=COLOURS[method], label=method)
            axes.set(xscale="log", xlim=(1, 1000), ylim=(-3, 103), title=name, xlabel="factor of the best time")
            axes.minorticks_off()
        panels[0].set_ylabel("requests solved (%)")
        drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)


if __name__ == "__main__":
    report.run(measure)
