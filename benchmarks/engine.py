"""Results and times of all kinds of searches: random requests through the public interface, compared with the best known answers.

``python -m benchmarks.engine --heavy 10 --cases 30`` computes the references of the first 30 requests of each approximate class,
``python -m benchmarks.engine --cases 30`` measures all classes, and ``--quick`` compares ten requests of each class with the
stored results and writes nothing. Only `linkage_atlas.synthesize` and `linkage_atlas.function` are called, with their defaults.
J is recomputed from the dimensions of the first solution by `tests.oracles`, and is infinite if a limit is violated. Times and
budgets are processor time.

The *reference* of a request is the smallest J that was ever measured for it, stored in ``results/engine_reference.json``. Since
some linkage has this cost, a reference stays valid when the search changes. A heavy search (`heavy`) and every run of this module
can lower it.
"""

from __future__ import annotations

import json
import re
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import cycle, pairwise
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import report
from benchmarks.battery import CLOSED, OPEN, drawn
from benchmarks.figures import BLUE, GREEN, ORANGE, PURPLE, figure
from benchmarks.named_functions import ENDS, largest_error
from synthesis.excursions import LEAVES_SAMPLES
from tests.oracles.classes import UNREACHABLE, make_case
from tests.oracles.free_classes import free_case, free_request, recompute_free
from tests.oracles.function_cases import CLASSES as FUNCTION_KINDS
from tests.oracles.function_cases import function_case, recompute_rms, zeros_kept
from tests.oracles.limited_classes import make_limited
from tests.oracles.recompute import broken_limits, recompute

EXACT = 1e-9
"""Error below which an answer is exact; differences between exact answers are rounding."""
CLOSE = 1.01
BUDGETS = (50, 100, 150, 300, 1000)
"""Milliseconds."""
FRESH = 7_000_000
"""Seeds from here on are used by nothing else."""
SAMPLES = range(8, 65)
"""Of approximate paths."""
HAND, OFF = 1.5, 0.01
"""Amplitude of a hand's tremor, for about 200 units, and noise of a curve over its size."""
RUNS = ("before", "parts")
"""Names of the run that others are held against, and of the newest, in the result file."""
ALLOWED = tuple(f"cost_{budget}" for budget in BUDGETS)
TICKS = (30, 50, 100, 200, 500, 1000, 3000)
QUANTILE = 0.95
"""Part of the requests whose J is at most as far off as the picture shows."""
QUICK, QUICK_BUDGETS = 10, (100, 300)
CASES = Path("cases")


def random_function(seed: int) -> dict[str, Any]:
    """Return a request for the smallest largest error of a random named function, which four-bars rarely make
    exactly.
    """
    random = np.random.default_rng([47, seed])
    name = str(random.choice([*ENDS]))
    first = 1.0 if name in ("log10", "ln", "reciprocal") else 0.0
    function_request: dict[str, Any] = {"name": name, "x": [first, round(float(random.uniform(*ENDS[name])), 3)]}
    function_request["output_span"] = round(float(random.uniform(60, 90) * random.choice([-1, 1])), 2)
    if name == "power":
        function_request["exponent"] = round(float(random.uniform(0.5, 3)), 2)
    limits: list[dict[str, Any]] = [{}, {"transmission_angle_min": 30}, {"family": "full_crank"}]
    limits += [{"transmission_angle_min": 30, "link_ratio_max": 5}]
    request = {
        "function": function_request,
        "crank_span": round(float(random.uniform(60, 120)), 2),
        "objective": "max",
    }
    return request | {"limits": limits[random.integers(len(limits))]}


class Case(NamedTuple):
    """A request and what judges an answer to it."""

    request: dict[str, Any]
    cost: Callable[[dict[str, Any]], float]
    """Function that returns J of a solution in the form of a reply; infinite if it violates the request."""
    search: Callable[..., Any] = la.synthesize
    top: int = 10
    """Number of solutions: larger for requests whose most accurate linkage cannot be used and is therefore ranked last."""

    def ask(self, budget: float | None = None, **more: Any) -> Any:
        """Return the reply ranked by error, with a budget in seconds of processor time unless ``work`` has another clock."""
        request = {"top": self.top, "work": processor_work, **self.request, **more}
        if self.search is la.synthesize:
            request = {"prefer": "error"} | request
        if request.get("timing") != "free":
            request["limits"] = {"preset": "none"} | request.get("limits", {})
        return self.search(**request, budget=budget)

    @property
    def mark(self) -> int:
        """Return a hash of the request, for which a reference is valid."""
        text = json.dumps(self.request, sort_keys=True)
        return zlib.crc32(re.sub(r"\d+\.\d+", lambda number: f"{float(number[0]):.6g}", text).encode())


def processor_work(budget: float | None) -> la.Work:
    """Work measured in processor time, which other processes do not lengthen."""
    return la.Work(budget, clock=time.process_time)


# -- the classes ------------------------------------------------------------------------------------------------------


def in_time(request: dict[str, Any]) -> Case:
    """A request with crank angles, without limits or within some."""

    def cost(solution: dict[str, Any]) -> float:
        found = recompute(request, solution)
        broken = found is None or broken_limits({"limits": {}} | request, solution)
        return np.inf if broken else found.objective

    return Case(request, cost)


def untimed(position: np.ndarray, rotation: np.ndarray | None, request: dict[str, Any]) -> Case:
    """A request without crank angles: order and limits are checked, and for approximate requests the excursion."""
    may_stray = request["limits"].get("preset") != "practical"

    def cost(solution: dict[str, Any]) -> float:
        found = recompute_free(position, rotation, solution)
        stays = may_stray or (solution["excursion"] or 0.0) <= LEAVES_SAMPLES
        return found.objective if found.one_way and stays and not broken_limits(request, solution) else np.inf

    return Case(request, cost)


def timed_exact(kind: str, seed: int) -> Case:
    return in_time(make_case(kind, seed, 32 if kind == "change point" else 16).request)


def free_exact(kind: str, samples: int, seed: int) -> Case:
    case, request = free_request(free_case(seed, samples, kind == "any family"), kind, seed)
    return untimed(case.position, case.rotation, request)


def path(kind: str, seed: int) -> Case:
    """A path that no four-bar makes exactly, within the practical limits."""
    random = np.random.default_rng([41, seed])
    count = int(random.choice(SAMPLES))
    request: dict[str, Any] = {}
    if kind == "smooth closed":
        turn = np.exp(2j * np.pi * np.arange(count) / count)
        parts = random.standard_normal((6, 2)) @ [1, 1j] / np.array([1, 1, 4, 4, 9, 9])
        path_points = 100 * sum(part * turn**power for part, power in zip(parts, (1, -1, 2, -2, 3, -3)))
        request["closed"] = True
    elif kind == "rocker with noise":
        case = free_case(seed, count)
        size = np.max(np.abs(case.position - case.position.mean()))
        path_points = case.position + OFF * size * (random.standard_normal((count, 2)) @ [1, 1j]) / np.sqrt(2)
    else:
        drawing = drawn(str(random.choice(list(CLOSED | OPEN))), count, HAND)
        turned = np.exp(1j * random.uniform(0, 2 * np.pi))
        x, y = (
            (turned * (np.array(drawing["position"]) @ [1, 1j]) * random.uniform(0.5, 2)).view(float).reshape(-1, 2).T
        )
        path_points = x * random.uniform(0.6, 1) + 1j * y
        request["closed"] = drawing.get("closed", False)
    position = np.column_stack([path_points.real, path_points.imag]).round(3)
    request |= {"position": position.tolist(), "timing": "free", "limits": {"preset": "practical"}}
    return untimed(position @ [1, 1j], None, request)


def poses(samples: int, seed: int) -> Case:
    """Poses drawn at random, passed in the order given, by four-bars of any family within the practical limits."""
    random = np.random.default_rng([55, samples, seed])
    rotation = np.rad2deg(random.uniform(-1, 1, samples)).round(6)
    position = random.standard_normal((samples, 2)).round(6)
    request = {"rotation": rotation.tolist(), "position": position.tolist(), "timing": "free"}
    request["limits"] = {"family": "any", "preset": "practical"}
    return untimed(position @ [1, 1j], np.deg2rad(rotation), request)._replace(top=200)


def limited(kind: str, seed: int) -> Case:
    return in_time((make_case(UNREACHABLE, seed) if kind == UNREACHABLE else make_limited(kind, seed)).request)


def exact_function(kind: str, samples: int, zeros: str, seed: int) -> Case:
    request = function_case(kind, samples, zeros, seed)

    def cost(solution: dict[str, Any]) -> float:
        return recompute_rms(request, solution) if zeros_kept(request, solution) else np.inf

    return Case(request, cost, la.function, top=50)


def largest(seed: int) -> Case:
    """A function by its name whose largest error is to be least; J is that error in degrees."""
    request = random_function(seed)

    def cost(solution: dict[str, Any]) -> float:
        passed = solution | {"crank_angle": [0.0, request["crank_span"]]}
        limits = {"family": "any"} | request["limits"]
        return (
            np.inf
            if broken_limits({"timing": "free", "limits": limits}, passed)
            else largest_error(request, solution)
        )

    return Case(request, cost, la.function)


class Class(NamedTuple):
    """Requests of a row of the tables."""

    makers: tuple[Callable[[int], Case], ...]
    """From a seed; a request is made by each in turn."""
    asked: str
    """Description of the requests."""
    exact: bool = True
    seeds: tuple[int, ...] = ()
    """Seeds that precede the fresh seeds."""
    many: int = 1
    """Number of cases relative to other classes."""

    def seeds_of(self, count: int) -> list[int]:
        """Return the first seeds: the preceding seeds, then fresh seeds."""
        return [*self.seeds, *range(FRESH, FRESH + count * self.many)][: count * self.many]

    def case(self, seed: int) -> Case:
        """The case of a seed."""
        index, kind = divmod(seed - FRESH, len(self.makers))
        return self.makers[0](seed) if seed in self.seeds else self.makers[kind](FRESH + index)


TIMED = ("plain", "any order", "double-crank", "clockwise", "uneven crank angles")
EXACT_POSES = (5, 6, 8, 10, 15, 30, 60, 100)
EXACT_POINTS = (8, 9, 10, 12, 15, 20, 30, 60, 100)
FUNCTIONS = ((8, "free"), (32, "free"), (200, "free"), (5, "input"), (32, "output"), (32, "both"))
"""Samples and zeros that are given."""
PATHS = ("smooth closed", "rocker with noise", "by hand")
LIMITED = ("broken", "boxed", "machine", UNREACHABLE)
NEAR_CHANGE_POINTS = (445, 3109, 3594)
"""Seeds that ended at 1e-5."""
CLASSES = {
    "timed": Class(tuple(partial(timed_exact, kind) for kind in TIMED), "8 / 40 ms", many=5),
    "motion": Class(tuple(partial(free_exact, "motion", n) for n in EXACT_POSES), "5 ms", many=5),
    "few poses": Class(tuple(partial(free_exact, "few", n) for n in (2, 3, 4)), "-"),
    "motion, any family": Class(tuple(partial(free_exact, "any family", n) for n in (5, 6, 10, 30)), "-"),
    "mixed": Class((partial(free_exact, "mixed", 8),), "99 % below 1 s; 99.5 %"),
    "path": Class(tuple(partial(free_exact, "path", n) for n in EXACT_POINTS), "25 / 400 ms; 99 %"),
    "function": Class(
        tuple(partial(exact_function, kind, *options) for kind in FUNCTION_KINDS for options in FUNCTIONS),
        "8 ms",
        many=5,
    ),
    "change point": Class((partial(timed_exact, "change point"),), "all", seeds=NEAR_CHANGE_POINTS, many=5),
    "drawn path": Class(tuple(partial(path, kind) for kind in PATHS), "300 ms, 95 %; 100 ms, 75 %", exact=False),
    "random poses": Class(tuple(partial(poses, n) for n in (6, 10, 20)), "150 ms, 98 %", exact=False),
    "within limits": Class(tuple(partial(limited, kind) for kind in LIMITED), "70 ms, 99 %", exact=False),
    "largest error": Class((largest,), "300 ms", exact=False),
}
APPROXIMATE = tuple(name for name, class_of_cases in CLASSES.items() if not class_of_cases.exact)


# -- references -------------------------------------------------------------------------------------------------------

REFERENCE = report.RESULTS / "engine_reference.json"
SHIFTS = (0.003, 0.01, 0.03)
"""Noise on the samples, over their size, from whose answers a heavy search descends."""
HEAVY = 10
"""Seconds of a heavy search."""
TRY = 1.0
"""Seconds of each try but the first."""


class References:
    """Smallest known J of each case, by class and seed, with the seconds of heavy search that were spent on it.

    The file is read again and written completely at each improvement, so that several processes can share it.
    """

    def __init__(self) -> None:
        self.known: dict[str, dict[str, list[float]]] = {}
        self.read()

    def read(self) -> None:
        self.known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}

    def of(self, name: str, seed: int, mark: int) -> tuple[float, float]:
        """Return J and seconds; infinity and zero for a new request."""
        found, cost, seconds = self.known.get(name, {}).get(str(seed), (mark, np.inf, 0.0))
        return (np.inf if cost is None else cost, seconds) if found == mark else (np.inf, 0.0)

    def improve(self, name: str, seed: int, mark: int, cost: float, seconds: float = 0.0) -> None:
        """Store a J if it is smaller, and the seconds that were spent."""
        self.read()
        before, spent = self.of(name, seed, mark)
        if cost >= before * (1 - 1e-6) and not seconds:
            return
        entry = [mark, report.finite(float(f"{min(cost, before):.7g}")), round(spent + seconds, 1)]
        self.known.setdefault(name, {})[str(seed)] = entry
        lines = [
            f' "{name}": {{\n'
            + ",\n".join(f'  "{s}": {json.dumps(costs[s])}' for s in sorted(costs, key=int))
            + "\n }"
            for name, costs in sorted(self.known.items())
        ]
        REFERENCE.with_suffix(".part").write_text("{\n" + ",\n".join(lines) + "\n}\n")
        REFERENCE.with_suffix(".part").replace(REFERENCE)


def shifted(request: Mapping[str, Any], random: np.random.Generator, by: float) -> dict[str, Any]:
    """The request with its samples moved at random, which leads a search into other valleys."""
    out = dict(request)
    if "position" in out:
        position = np.array(out["position"])
        size = np.max(np.linalg.norm(position - position.mean(axis=0), axis=1))
        out["position"] = (position + by * size * random.standard_normal(position.shape)).tolist()
    if out.get("rotation") is not None:
        out["rotation"] = (
            np.array(out["rotation"]) + np.rad2deg(by) * random.standard_normal(len(out["rotation"]))
        ).tolist()
    for name in ("function", "crank_span") if "function" in out else ():
        value = out[name]
        part = 1 + by * random.standard_normal()
        out[name] = value | {"output_span": value["output_span"] * part} if name == "function" else value * part
    return out


def heavy(case: Case, seconds: float, random: np.random.Generator) -> float:
    """Return the smallest J of the search for the request, and of answers to similar requests after their refinement for it."""
    begin, best = (
        time.process_time(),
        min((case.cost(solution.to_dict()) for solution in case.ask().solutions), default=np.inf),
    )
    for by in cycle(SHIFTS):
        if time.process_time() - begin > seconds or best <= EXACT:
            return best
        for solution in case.ask(TRY, **shifted(case.request, random, by), top=5).solutions:
            try:
                ends = case.ask(start_from=[solution.to_dict()], refine_only=True, top=1).solutions
            except la.FieldError:  # too distant from the request to start there
                continue
            best = min([best, *(case.cost(end.to_dict()) for end in ends)])
    return best


def search_heavily(names: Sequence[str], cases: int, seconds: float) -> None:
    """Run the heavy search for the first cases of each class in turn, up to a total number of seconds."""
    references = References()
    for number in range(cases):
        for name in names:
            seed = CLASSES[name].seeds_of(cases)[number]
            case = CLASSES[name].case(seed)
            before, spent = references.of(name, seed, case.mark)
            if spent >= seconds or before <= EXACT:
                continue
            found = heavy(case, seconds - spent, np.random.default_rng([seed, int(10 * spent)]))
            references.improve(name, seed, case.mark, found, seconds - spent)
            print(f"{time.strftime('%H:%M:%S')} {number} {name} {seed}: {before:.6g} -> {found:.6g}", flush=True)


# -- measuring --------------------------------------------------------------------------------------------------------


def measure_class(
    name: str, cases: int, budgets: Sequence[int], references: References, keep: bool
) -> dict[str, Any]:
    """Return seeds, milliseconds and J of the cases of a class, and for an approximate class the J of each budget."""
    kind, times, out = CLASSES[name], report.Times(), {"seed": [], "cost": []}
    out |= {} if kind.exact else {f"cost_{budget}": [] for budget in budgets}
    for maker in kind.makers:  # what the first request of a kind makes is made
        maker(FRESH - 1).ask(budget=0.5)
    for seed in kind.seeds_of(cases):
        case = kind.case(seed)
        replies = {"cost": times.run(case.ask)}
        if not kind.exact:
            replies |= {f"cost_{budget}": case.ask(budget / 1000) for budget in budgets}
        found = {which: smallest_cost(case, reply) for which, reply in replies.items()}
        out["seed"].append(seed)
        for which, cost in found.items():
            out[which].append(report.finite(float(f"{cost:.7g}")))
        if keep and not kind.exact:
            references.improve(name, seed, case.mark, min(found.values()))
    return {"cases": len(out["seed"]), **out, "ms": [round(1000 * seconds, 3) for seconds in times.processor]}


def smallest_cost(case: Case, reply: Any) -> float:
    """Return the smallest J of the solutions; infinite if there is none."""
    return min((case.cost(solution.to_dict()) for solution in reply.solutions), default=np.inf)


def costs(part: Mapping[str, Any], which: str) -> np.ndarray:
    """Return each J; infinite if there was no solution."""
    return np.array([np.inf if cost is None else cost for cost in part[which]])


def over(name: str, part: Mapping[str, Any], which: str, references: References) -> np.ndarray:
    """Return each J over its reference, or over `EXACT` in exact classes; NaN without a reference."""
    if CLASSES[name].exact:
        return costs(part, which) / EXACT
    known = [references.known.get(name, {}).get(str(seed), (0, None, 0))[1] for seed in part["seed"]]
    best = np.array([np.nan if cost is None else cost for cost in known])
    return np.maximum(costs(part, which), EXACT) / np.maximum(best, EXACT)


def row(name: str, part: Mapping[str, Any], references: References) -> dict[str, Any]:
    """Return the row of a class in the tables."""
    ratio = over(name, part, "cost", references)
    judged = np.isfinite(ratio) | np.isinf(ratio)
    order = [k for k in np.argsort(-np.where(judged, ratio, 0.0), kind="stable") if judged[k] and ratio[k] > CLOSE]
    out = {
        "class": name,
        "asked": CLASSES[name].asked,
        "cases": len(part["ms"]),
        "median": float(np.median(part["ms"])),
        "p99": float(np.percentile(part["ms"], 99)),
        "good": share(ratio),
        "worst": [f"{part['seed'][k]} ({ratio[k]:.3g})" for k in order[:5]],
        "none": sum(cost is None for cost in part["cost"]),
    }
    budgets = [which for which in ALLOWED if which in part]
    out |= {which.replace("cost", "good"): share(over(name, part, which, references)) for which in budgets}
    cost_rows = [np.maximum(costs(part, which), EXACT) for which in (*budgets, "cost")]
    fewer = [more > CLOSE * less for less, more in pairwise(cost_rows)]
    return out | {"less_for_more": int(np.sum(fewer))}


def share(ratio: np.ndarray) -> float | None:
    """The part of the judged cases that is near enough."""
    judged = ratio[~np.isnan(ratio)]
    return float(np.mean(judged <= CLOSE)) if judged.size else None


def compare(names: Sequence[str], before: Mapping[str, Any]) -> None:
    """Print the results of the first cases of each class, each beside the result of the same cases in a stored run."""
    references, heads = (
        References(),
        "ms, before, ratio|good, before|100 ms, before|300 ms, before|better, worse|worst seeds",
    )
    print("".join(f"{head:20}" for head in ("class", *heads.split("|"))))
    for name in names:
        now, then = measure_class(name, QUICK, QUICK_BUDGETS, references, keep=False), before.get(name, {"seed": []})
        indices = [then["seed"].index(seed) for seed in now["seed"] if seed in then["seed"]]
        if len(indices) < len(now["seed"]):
            print(f"{name:20}is not in the run that is kept")
            continue
        old = {which: [values[k] for k in indices] for which, values in then.items() if isinstance(values, list)}
        new, was = row(name, now, references), row(name, old, references)
        mine, theirs = (np.maximum(costs(part, "cost"), EXACT) for part in (now, old))
        words = [f"{ms(new['median'])}  {ms(was['median'])}  {new['median'] / was['median']:.2f}"]
        words += [f"{percent(new.get(name))}  {percent(was.get(name))}" for name in ("good", "good_100", "good_300")]
        words += [f"{np.sum(mine * CLOSE < theirs)}  {np.sum(mine > CLOSE * theirs)}"]
        print("".join(f"{word:20}" for word in (name, *words)) + "  ".join(new["worst"]), flush=True)


def percent(value: float | None) -> str:
    return "-" if value is None else report.percent(value, 3)


def ms(value: float) -> str:
    return report.significant(value, 2 if value < 1000 else 3)


# -- published paths --------------------------------------------------------------------------------------------------

LINKS = 10
"""The longest link over the size of the motion, under which the best known values hold."""


def published(folder: Path) -> Iterator[dict[str, Any]]:
    """A row a published case of a folder: root mean square of the positions with growing budgets, beside the best known."""
    for file in sorted(folder.glob("*.json")):
        published_request = json.loads(file.read_text())
        if published_request.get("kind") not in ("motion", "path"):
            continue
        position, rotation = np.array(published_request["position"]), published_request.get("rotation")
        size = float(np.max(np.linalg.norm(position - position.mean(axis=0), axis=1)))
        closed = bool(np.linalg.norm(position[0] - position[-1]) < 1e-9 * size)
        crank = published_request.get("crank_angle")
        request: dict[str, Any] = {"position": position, "rotation": rotation, "degrees": False}
        request |= {"crank_angle": np.subtract(crank, crank[0])} if crank else {"timing": "free", "closed": closed}
        family = "full_crank" if rotation is None else "any"
        request |= {"limits": {"preset": "none", "link_max": LINKS * size, "family": family}}
        request |= (
            {"length_scale": published_request["length_scale"]} if published_request.get("length_scale") else {}
        )
        case, times = Case(request, lambda _: np.inf), report.Times()
        best = times.run(case.ask)
        known = published_request["best_known"]
        rms = known.get("rms", known.get("pos", np.sqrt(known.get("sse", np.nan) / len(position))))
        yield {
            "case": published_request["name"],
            "citation": published_request["citation"],
            "timing": "given" if crank else "free",
            "samples": len(position),
            "family": family,
            "known": rms,
            "rms": placed(best),
            "ms": 1000 * times.processor[0],
            **{f"rms_{budget}": placed(case.ask(budget / 1000)) for budget in BUDGETS},
        }


def placed(reply: Any) -> float | None:
    return reply.best.errors.position_rms if reply.solutions else None


# -- documents --------------------------------------------------------------------------------------------------------


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/background/measurements.md."""
    references = References()
    newest = [row(name, results["parts"][name], references) for name in CLASSES if name in results["parts"]]
    rows = [
        {
            "class": row["class"],
            "parts": f"{ms(row['median'])} / {ms(row['p99'])}",
            "parts_good": percent(row["good"]),
            "parts_cases": f"{row['cases']:,}",
        }
        for row in newest
    ]
    soon = [row for row in newest if not CLASSES[row["class"]].exact]
    for result in soon:
        result |= {which: percent(value) for which, value in result.items() if which.startswith("good")}
    worst = [row | {"worst": ", ".join(row["worst"])} for row in newest if row["worst"]]
    known = [seconds for costs_of_case in references.known.values() for _, _, seconds in costs_of_case.values()]
    public = results.get("published_parts", {"rows": []})["rows"]
    tables = report.tables("engine", {"classes": rows, "soon": soon, "worst": worst, "published": public})
    return tables | {
        "references": f"{len(known):,} requests have a reference, "
        f"{sum(seconds >= HEAVY for seconds in known):,} of them such a search",
        "made": report.made_text([part["made"] for part in results["parts"].values()]),
    }


def draw(results: dict[str, Any]) -> None:
    """Draw the fraction of the requests close to their reference, and the ratio of the others to it, against run time."""
    references, newest = References(), RUNS[-1] if RUNS[-1] in results else RUNS[0]
    with figure("engine.svg", 1, 2) as (drawing, panels):
        for name, colour in zip(APPROXIMATE, (BLUE, GREEN, ORANGE, PURPLE)):
            for run in RUNS:
                part = results.get(run, {}).get(name)
                if part is None:
                    continue
                ratio = np.array([over(name, part, which, references) for which in (*ALLOWED, "cost")])
                ratio = ratio[:, ~np.isnan(ratio).any(axis=0)]
                worst_ratio = 100 * (np.quantile(ratio, QUANTILE, axis=1, method="higher") - 1)
                style = {"color": colour} | ({} if run == newest else {"alpha": 0.45, "linestyle": "--"})
                for axes, y in zip(panels, (100 * np.mean(ratio <= CLOSE, axis=1), np.maximum(worst_ratio, 0.01))):
                    axes.plot(BUDGETS, y[:-1], label=name if run == newest else None, marker="o", ms=4, **style)
                    axes.plot(np.median(part["ms"]), y[-1], marker="*", ms=11, **style)
        for axes in panels:
            axes.set(xscale="log", xlabel="processor time allowed (ms); star: without a budget, at its median")
            axes.set_xticks(TICKS, [f"{tick:,}" for tick in TICKS], minor=False)
            axes.minorticks_off()
        panels[0].set(ylim=(-3, 103), ylabel="requests within 1 % of the best known J (%)")
        panels[1].set(yscale="log", ylabel=f"J above the best known, {100 * QUANTILE:.0f} % of the requests (%)")
        drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        drawing.suptitle("Requests without an exact answer" + ("; dashed: before" if newest == RUNS[-1] else ""))


def measure(
    cases: Annotated[int, "of each class"] = 200,
    classes: Annotated[str, "parts of the run; the others stay as they are", tuple(CLASSES)] = tuple(CLASSES),
    public: Annotated[Path, "folder of the published cases, left out where there is none"] = CASES,
    before: Annotated[bool, "keep this run as the one that others are held against"] = False,
    quick: Annotated[bool, "compare ten cases of each class with that run, and write nothing"] = False,
    heavy: Annotated[float, "measure nothing, but search for references: up to so many seconds a case"] = 0.0,
) -> Iterator[dict[str, Any]]:
    """The classes in turn, then the published cases."""
    threadpool_limits(1, "blas")
    la.prepare()
    stored = report.known("engine")
    if heavy:
        search_heavily([name for name in classes if name in APPROXIMATE], cases, heavy)
        report.render(["engine"])
        return
    if quick:
        compare(classes, stored.get("before", {}))
        return
    stamp, references, run = report.stamp(), References(), RUNS[not before]
    for name in classes:
        part = measure_class(name, cases, BUDGETS, references, keep=True)
        stored = stored | {"made": stamp, run: {**stored.get(run, {}), name: {"made": stamp, **part}}}
        print(name, json.dumps(row(name, part, References())), flush=True)
        yield stored
    if public.is_dir():
        yield stored | {f"published_{run}": {"made": stamp, "rows": list(published(public))}}


if __name__ == "__main__":
    report.run(measure)
