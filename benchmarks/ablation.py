"""Ablation of the searches: every heuristic is switched off in turn, and the answers and times are compared.

``python -m benchmarks.ablation --cases 40`` runs each request once with all heuristics and once without each heuristic that
its class uses, alternately, so that a drift of the machine affects all runs alike. An answer is *good* if its error
is within 1 % of the smallest error that any of these runs reached; the answer to an exact request is good below 1e-9.
Times are processor time. The first heuristic is empty: it shows the noise of the method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from typing import Annotated, Any, NamedTuple
from unittest.mock import patch

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import engine, report
from synthesis import descents
from synthesis.free import free_timing
from synthesis.free import search as free
from synthesis.guided import problem as pair_problem
from synthesis.guided import search as guided
from synthesis.guided.problem import PairProblem
from synthesis.guides import Driver, Kind
from synthesis.limits import Limits
from synthesis.poses import Poses, make_poses
from synthesis.search import crank_driven
from synthesis.search import search as timed
from synthesis.search.multistart import MultiStart
from synthesis.search.options import SELECTED_EARLY, SELECTED_LATE
from tests.oracles.guided import KINDS, random_motion

# -- requests ---------------------------------------------------------------------------------------------------------

APPROXIMATE = ("drawn path", "random poses", "within limits")
EXACT = ("timed", "path", "mixed", "change point")
FREE = ("drawn path", "random poses", "path")
FUNCTIONS = ("largest error", "function")
SLIDERS = ("sliders, approximate", "sliders, exact", "sliders, drive given")
DRIVERS = dict(zip(KINDS, (Driver.CRANK, Driver.CRANK, Driver.SLIDER, Driver.SLIDER, Driver.CYLINDER)))
REPEATED = ("timed", "path", "change point", "function", "sliders, exact")
"""Quick classes, whose number of requests is three times larger."""
NOTHING = "none"
"""Name of the empty heuristic."""
NO_SWITCH = ("uphill steps", "flipped branches", "last polish")
"""Heuristics in use that cannot be switched off."""
SOLVED = 1e-9
"""Error below which an answer is exact, so that smaller differences are rounding."""


Request = Callable[[], float]
"""Solves a request and returns the error of the best answer, or infinity."""


def requests_of(name: str, count: int) -> Iterator[Request]:
    """Yield the first requests of a class."""
    if name in SLIDERS:
        yield from (slider_request(SLIDERS.index(name), seed) for seed in range(count))
        return
    for seed in engine.CLASSES[name].seeds_of(count)[:count]:
        case = engine.CLASSES[name].case(seed)
        yield lambda case=case: engine.smallest_cost(case, case.ask())


def slider_request(kind: int, seed: int) -> Request:
    """Return a request for linkages with sliders: any kind for a wandering body, or a kind's own motion exactly or with noise."""
    if kind == 0:
        angle = (None, 30.0, 40.0)[seed % 3]
        limits = Limits("any", **({} if angle is None else {"transmission_angle_min": float(np.deg2rad(angle))}))
        kinds = [kind for kind in Kind if kind is not Kind.FOUR_BAR]
        return lambda: slider_error(wandering_body(seed), limits, kinds)
    random, mechanism = np.random.default_rng([kind, seed]), KINDS[seed % len(KINDS)]
    rotation, position, drive = random_motion(random, mechanism, 12 if kind == 2 else 6)
    poses = make_poses(rotation, position)
    if kind == 2:
        noise = 1e-3 * random.normal(size=(3, 12))
        scale = poses.length_scale
        poses = make_poses(rotation + noise[0], position + scale * (noise[1] + 1j * noise[2]), length_scale=scale)
    options = {"prescribed": drive} if kind == 2 else {}
    return lambda: slider_error(poses, Limits("any"), [Kind(mechanism)], DRIVERS[mechanism], **options)


def wandering_body(seed: int) -> Poses:
    """Return five to nineteen poses of a body that wanders and turns, without a unit of length."""
    random = np.random.default_rng(seed)
    along = np.linspace(0, 1, int(random.integers(5, 20)))

    def waves(size: float) -> Any:
        parts = [(random.normal() * size / (k + 1) ** 1.5, random.uniform(0, 6)) for k in range(3)]
        return sum(part * np.sin((k + 1) * np.pi * along * 0.7 + phase) for k, (part, phase) in enumerate(parts))

    rotation = random.uniform(0.3, 1.8) * along + waves(0.15)
    return make_poses(rotation, along * np.exp(1j * random.uniform(0, 6)) + waves(0.3) + 1j * waves(0.3))


def slider_error(*request: Any, **options: Any) -> float:
    """Return the smallest error of a search for linkages with sliders."""
    options["work"] = engine.processor_work(None)
    solutions, _ = guided.search_guided(*request, **options)
    return min((solution.errors.objective for solution in solutions), default=np.inf)


# -- heuristics -------------------------------------------------------------------------------------------------------


class Heuristic(NamedTuple):
    """A heuristic that can be switched off."""

    name: str
    sentence: str
    """Description for the table."""
    classes: tuple[str, ...]
    patches: Sequence[tuple[Any, str, Any]] | None
    """Object, attribute, and the attribute's value without the heuristic; None if it was deleted or cannot be switched off."""

    @property
    def state(self) -> str:
        """Say what became of the heuristic after its measurement."""
        if self.name == NOTHING:
            return "-"
        return "deleted" if self.patches is None and self.name not in NO_SWITCH else "in use"

    @contextmanager
    def switched_off(self) -> Iterator[None]:
        """Run the searches without the heuristic."""
        with ExitStack() as stack:
            for owner, attribute, value in self.patches or ():
                stack.enter_context(patch.object(owner, attribute, value))
            yield


class Gaussian:
    """Random numbers without heavy tails."""

    def __init__(self, generator: np.random.Generator) -> None:
        self.generator = generator

    def __getattr__(self, name: str) -> Any:
        return getattr(self.generator, name)

    def standard_t(self, _: float, size: Any = None) -> Any:
        """Return normal deviates in place of Student's."""
        return self.generator.standard_normal(size)


class Numpy:
    """Numpy whose generators are `Gaussian`."""

    class random:
        """Numpy's module of random numbers."""

        Generator = np.random.Generator

        @staticmethod
        def default_rng(seed: Any) -> Gaussian:
            """Return a generator without heavy tails."""
            return Gaussian(np.random.default_rng(seed))

    def __getattr__(self, name: str) -> Any:
        return getattr(np, name)


def options(**changes: Any) -> list[tuple[Any, str, Any]]:
    """Return the patches that change options of the searches among four-bars."""
    owners = ((timed, "PrescribedTimingOptions"), (free, "FreeTimingOptions"))
    return [(owner, name, partial(getattr(owner, name), **changes)) for owner, name in owners]


def schedules(**changes: Any) -> list[tuple[Any, str, Any]]:
    """Return the patches that change the stages of both searches in rounds."""
    late, early = (schedule._replace(**changes) for schedule in (SELECTED_LATE, SELECTED_EARLY))
    return [
        (timed, "PrescribedTimingOptions", partial(timed.PrescribedTimingOptions, schedule=late)),
        (free, "FreeTimingOptions", partial(free.FreeTimingOptions, schedule=early)),
    ]


def pair_options(**changes: Any) -> list[tuple[Any, str, Any]]:
    """Return the patches that change options of the search for linkages with sliders."""
    return [(guided, name, partial(getattr(guided, name), **changes)) for name in ("PairOptions", "DrivenOptions")]


def free_options(**changes: Any) -> list[tuple[Any, str, Any]]:
    """Return the patch that changes options of the search with free crank angles."""
    defaults = free.FreeSearch.__init__.__defaults__
    return [(free.FreeSearch.__init__, "__defaults__", (free.FreeSearchOptions(**changes), *defaults[1:]))]


_restored = descents.Problem.moved_onto


@cache
def heuristics() -> tuple[Heuristic, ...]:
    """Return all heuristics; the first is empty."""
    empty = lambda *_: iter(())  # noqa: E731
    return tuple(
        Heuristic(*row)
        for row in (
            (
                NOTHING,
                "Nothing is switched off: noise of the method.",
                (*APPROXIMATE, *EXACT, *FUNCTIONS, *SLIDERS),
                [],
            ),
            (
                "uphill steps",
                "A step that increases the cost is accepted if it continues the direction of the step before.",
                (*APPROXIMATE, *EXACT),
                None,
            ),
            (
                "geodesic correction",
                "A second-order correction bends each step along the curvature of the residual.",
                (*APPROXIMATE, *EXACT),
                None,
            ),
            (
                "merged samples",
                "Neighbouring samples that a step would exchange move to a common crank angle.",
                FREE,
                None,
            ),
            ("multipliers", "Limits have Lagrange multipliers in addition to a growing penalty.", APPROXIMATE, None),
            (
                "restoration",
                "Newton steps move a candidate onto the limits that it still violates.",
                APPROXIMATE,
                [(descents.Problem, "moved_onto", lambda problem, timed, _=0: _restored(problem, timed, 0))],
            ),
            (
                "reuse penalty",
                "A basin is used less often as the origin of perturbations the more often it was used.",
                APPROXIMATE,
                None,
            ),
            (
                "loose perturbations",
                "Half of the perturbations move along directions in which the cost is flat.",
                (*APPROXIMATE, "path"),
                None,
            ),
            (
                "realigned perturbations",
                "Perturbed candidates are tried with the crank angles that fit their new shape best as well.",
                FREE,
                None,
            ),
            (
                "exchanged families",
                "A tenth of the perturbations exchange crank-rocker and double-crank.",
                (*APPROXIMATE, "path"),
                None,
            ),
            ("flipped branches", "Some perturbations change the branch.", (*APPROXIMATE, "path"), None),
            ("three widths", "Perturbations are wide, medium and narrow in turn.", APPROXIMATE, None),
            (
                "heavy tails",
                "Perturbations follow Student's distribution with 3 degrees of freedom.",
                (*APPROXIMATE, "path", "change point"),
                [(crank_driven, "np", Numpy())],
            ),
            ("later restarts", "Every third round starts from new seeds.", APPROXIMATE, None),
            (
                "straying candidates last",
                "Candidates that leave the path between samples count with twice their error.",
                ("drawn path", "random poses"),
                [(free_timing.FreeTiming, "strays", crank_driven.CrankDriven.strays)],
            ),
            (
                "distinct basins",
                "The pool keeps one candidate of each basin.",
                (*APPROXIMATE, "path"),
                options(pool_distance=0.0),
            ),
            (
                "selection after a few steps",
                "Only the best 12 basins of a round continue after 15 to 27 steps.",
                APPROXIMATE,
                schedules(survivors=1000),
            ),
            (
                "descents to the end",
                "The best new basins of each round are refined to convergence.",
                APPROXIMATE,
                schedules(leading=0),
            ),
            ("last polish", "The best four answers are refined once more at the end.", APPROXIMATE, None),
            (
                "fewer samples",
                "Long requests are searched on a few samples and refined on all.",
                (*APPROXIMATE, "path"),
                options(max_samples=10**6) + free_options(exact_samples=10**6),
            ),
            (
                "two guesses between samples",
                "Crank angles between the few samples are guessed by two rules.",
                ("path",),
                None,
            ),
            (
                "promising candidates only",
                "A candidate is refined on all samples only if it is near the best answer.",
                ("path", "within limits"),
                None,
            ),
            (
                "rounds without limits",
                "Rounds without limits on 12 samples look for an exact path beside the others.",
                ("drawn path", "path"),
                [(free.FreeSearch, "_exact", empty)],
            ),
            (
                "dyads as seeds",
                "The four-bars that pairs of dyads give are among the first seeds.",
                ("random poses",),
                None,
            ),
            (
                "early end of the larger family",
                "The search among all four-bars ends soon if the first rounds do not improve on full cranks.",
                ("random poses",),
                free_options(idle_beyond_full_cranks=np.inf),
            ),
            (
                "seeds next to change points",
                "A round starts from shapes at the far ends of the chart.",
                ("change point", "timed"),
                None,
            ),
            (
                "perturbations of exact candidates",
                "A round starts from 480 perturbations of the best 40 candidates.",
                ("change point", "timed"),
                None,
            ),
            (
                "early look at narrow basins",
                "The eight best seeds continue for 60 steps before a second round of seeds.",
                ("change point", "timed"),
                None,
            ),
            (
                "calibrated odds",
                "A logistic curve estimates the chance that a better basin was missed (`report.unseen`).",
                APPROXIMATE,
                None,
            ),
            ("sliders: reuse penalty", "The same penalty in the search for linkages with sliders.", SLIDERS, None),
            ("sliders: one guide moves", "In half of the perturbations one guide hardly moves.", SLIDERS, None),
            (
                "sliders: relatives",
                "A basin of one kind and drive is also a start for the others.",
                SLIDERS,
                [(PairProblem, "relatives", lambda *_: None)],
            ),
            ("sliders: heavy tails", "The same distribution for sliders.", SLIDERS, [(pair_problem, "np", Numpy())]),
            (
                "sliders: tightened limits",
                "A descent is repeated for the transmission angle that is missing between samples.",
                SLIDERS,
                None,
            ),
            (
                "sliders: second seeds",
                "Drives without an answer start again from the pairs that violate the limits least.",
                SLIDERS,
                None,
            ),
            (
                "sliders: new basins only",
                "Only basins that were not refined before are refined to convergence.",
                SLIDERS,
                [(MultiStart, "_unlike_converged", lambda _, found: np.ones(found.cost.size, dtype=bool))],
            ),
            (
                "sliders: last polish",
                "The best answer of each drive is refined on all samples at the end.",
                SLIDERS,
                pair_options(polish=()),
            ),
            (
                "sliders: F test of circle against rail",
                "A large circle is replaced by a rail if the samples do not distinguish them.",
                SLIDERS,
                None,
            ),
            ("sliders: calibrated odds", "The same estimate for linkages with sliders.", SLIDERS, None),
            (
                "functions: restored candidates",
                "Candidates that violate a limit slightly are moved back within it.",
                FUNCTIONS,
                None,
            ),
            (
                "functions: straight steps",
                "Steps are straight in Freudenstein's numbers, in which the closure is linear.",
                FUNCTIONS,
                None,
            ),
            (
                "functions: answers of the motion search",
                "The best linkages for the same motion are starting points too.",
                FUNCTIONS,
                None,
            ),
            (
                "functions: alternatives end early",
                "Candidates behind the best end before their error curve is level.",
                FUNCTIONS,
                None,
            ),
        )
    )


# -- measuring --------------------------------------------------------------------------------------------------------


def measure_class(name: str, cases: int) -> dict[str, Any]:
    """Run the requests of a class with and without each heuristic that it uses. Return errors and milliseconds."""
    switches = [switch for switch in heuristics() if name in switch.classes and switch.patches is not None]
    runs: dict[str, dict[str, list[Any]]] = {"": {"error": [], "ms": []}}
    runs |= {switch.name: {"error": [], "ms": []} for switch in switches}
    prepared = False
    for request in requests_of(name, cases * (3 if name in REPEATED else 1)):
        if not prepared:
            request()  # tables are built once
            prepared = True
        for key, switch in {"": None, **{switch.name: switch for switch in switches}}.items():
            times = report.Times()
            with ExitStack() as stack:
                if switch is not None:
                    stack.enter_context(switch.switched_off())
                error = times.run(request)
            runs[key]["error"].append(report.finite(float(f"{error:.6g}")))
            runs[key]["ms"].append(round(1000 * times.processor[0], 2))
    return {"runs": runs}


def floats(values: Sequence[float | None]) -> np.ndarray:
    """Return errors as an array; None is infinite."""
    return np.array([np.inf if value is None else value for value in values])


def judged(part: Mapping[str, Any]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the errors relative to the smallest known error, and the milliseconds, by heuristic."""
    errors = {name: np.maximum(floats(run["error"]), SOLVED) for name, run in part["runs"].items()}
    best = np.min(list(errors.values()), axis=0)
    best[~np.isfinite(best)] = 1.0
    return {name: (errors[name] / best, np.array(part["runs"][name]["ms"])) for name in errors}


def blocks(results: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of docs/background/measurements.md: a row for each heuristic."""
    parts = {name: judged(part) for name, part in results["classes"].items()}
    rows = []
    for heuristic in heuristics():
        names = [name for name in heuristic.classes if heuristic.name in parts.get(name, {})]
        if not names:
            continue
        # the first run of a request may fill caches: times are compared with the second run
        pair = ("" if heuristic.name == NOTHING else NOTHING, heuristic.name)
        ratios = [[parts[name][key][0] for name in names] for key in pair]
        times = [[parts[name][key][1] for name in names] for key in pair]
        before, after = (np.concatenate(ratio) for ratio in ratios)
        # each class counts alike, whatever its requests cost
        slower = np.exp(np.mean([np.log(b.sum() / a.sum()) for a, b in zip(*times)]))
        lost = float(np.mean(before <= engine.CLOSE) - np.mean(after <= engine.CLOSE))
        rows.append(
            {
                "name": heuristic.name,
                "sentence": heuristic.sentence,
                "requests": before.size,
                "good": report.percent(float(np.mean(before <= engine.CLOSE)), 3),
                "without": report.percent(float(np.mean(after <= engine.CLOSE)), 3),
                "worse": int(np.sum(after > engine.CLOSE * before)),
                "better": int(np.sum(before > engine.CLOSE * after)),
                "time": f"{100 * (slower - 1):+.0f} %",
                "state": heuristic.state,
                "worth": "-" if heuristic.name == NOTHING else "yes" if lost > 0.01 or slower > 1.1 else "no",
            }
        )
    origin = report.made_text([part["made"] for part in results["classes"].values()])
    return report.tables("ablation", {"heuristics": rows}) | {"made": origin}


def measure(
    cases: Annotated[int, "requests of each class; three times as many of the quick classes"] = 40,
    classes: Annotated[str, "classes to run", (*APPROXIMATE, *EXACT, *FUNCTIONS, *SLIDERS)] = (
        *APPROXIMATE,
        *EXACT,
        *FUNCTIONS,
        *SLIDERS,
    ),
) -> Iterator[dict[str, Any]]:
    """Run the classes in turn."""
    threadpool_limits(1, "blas")
    la.prepare()
    results, stamp = report.known("ablation"), report.stamp()
    for name in classes:
        part = {"made": stamp, **measure_class(name, cases)}
        results = {"made": stamp, "classes": {**results.get("classes", {}), name: part}}
        print(name, flush=True)
        yield results


if __name__ == "__main__":
    report.run(measure)
