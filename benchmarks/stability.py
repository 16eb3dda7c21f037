"""Numerical stability in extreme cases, against arithmetic of 50 digits (`make stability`)."""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp, mpf

from app.resources import ServiceResources
from app.settings import Settings
from benchmarks.acceptance import REACHED, Times, answer, compare, target_of
from benchmarks.classes import is_crank_rocker, make_case, simplex
from benchmarks.recompute import DIGITS, close_by_circles
from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import close_loop
from synthesis.search.refine import Problem, refine
from synthesis.search.search import FullCrankChart

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "benchmarks" / "results" / "stability.json"
PAGE = ROOT / "docs" / "stability.md"
EPSILON = float(np.finfo(float).eps)
LINKS = ("crank", "coupler", "rocker", "ground")


@dataclass
class Row:
    """A line of the report."""

    tried: str
    cases: int
    worst: str
    does: str
    cannot: str
    numbers: dict[str, float] = field(default_factory=dict)


# -- kinematics -------------------------------------------------------------------------------------------------------


def folding_lengths(random: np.random.Generator, excess: float) -> np.ndarray:
    """Crank-rocker or double-crank whose Grashof excess is about ``excess`` of the perimeter, at least one rounding."""
    while True:
        lengths = simplex(random, is_crank_rocker)
        longest = int(np.argmax(lengths))
        others = np.delete(lengths, [0, longest])
        lengths[longest] = others.sum() - lengths[0] - excess
        if lengths[longest] > others.max() and lengths[0] < others.min() and is_crank_rocker(lengths):
            return lengths if random.random() < 0.5 else lengths[::-1].copy()


def folding_angles(random: np.random.Generator, count: int) -> np.ndarray:
    """Crank angles, most of them near where the linkage folds flat: 0 and pi."""
    near = 10.0 ** random.uniform(-12, 0, count) * random.choice([-1, 1], count)
    return np.where(
        random.random(count) < 0.8, random.choice([0.0, np.pi], count) + near, random.uniform(0, 6.28, count)
    )


def theta2_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> tuple[float, float]:
    """Worst error of theta2 in radians; and of the textbook arccos form, for comparison."""
    exact = close_by_circles(lengths.tolist(), branch, crank.tolist())
    found = close_loop(lengths, crank).coupler_angle(np.array(branch))
    with mp.workdps(DIGITS):
        # where L1 > L4 both are continuous, but may begin a whole turn apart
        turn = 2 * mp.pi * mp.nint((mpf(float(found[0])) - exact.theta2[0]) / (2 * mp.pi))
        errors = [abs(float(mpf(float(mine)) - turn - true)) for mine, true in zip(found, exact.theta2)]
    l1, l2, l3, l4 = lengths / lengths.max()
    with np.errstate(all="ignore"):
        diagonal = l4 - l1 * np.exp(1j * crank)
        cosine = (l2**2 + np.abs(diagonal) ** 2 - l3**2) / (2 * l2 * np.abs(diagonal))
        textbook = np.angle(diagonal) + branch * np.arccos(np.clip(cosine, -1, 1))
    gaps = [float(mpf(float(mine)) - true) for mine, true in zip(textbook, exact.theta2)]
    return max(errors), max(abs(gap - 2 * np.pi * round(gap / (2 * np.pi))) for gap in gaps)


def gradient_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """Worst error of the five derivatives of theta2, relative to the largest (in logarithms of the lengths)."""
    found = close_loop(lengths, crank).coupler_angle_gradient(np.array(branch))
    worst = 0.0
    for t, mine in zip(crank, found):
        with mp.workdps(DIGITS):
            point = [mpf(float(value)) for value in (*lengths, t)]
            weight = [*point[:4], mpf(1)]
            true = []
            for k in range(5):
                step = weight[k] * mpf(10) ** -20
                ends = [
                    close_exactly([value + (sign * step if j == k else 0) for j, value in enumerate(point)], branch)
                    for sign in (1, -1)
                ]
                true.append((ends[0] - ends[1]) / (2 * step) * weight[k])
            gaps = [abs(mpf(float(value)) * w - right) for value, w, right in zip(mine, weight, true)]
            worst = max(worst, float(max(gaps) / max(abs(right) for right in true)))
    return worst


def close_exactly(point: Sequence[Any], branch: int) -> Any:
    """theta2 near one position, for numbers that are no floats: by the circles' intersection, the angle not continued."""
    l1, l2, l3, l4, t = point
    vx, vy = l4 - l1 * mp.cos(t), -l1 * mp.sin(t)
    square = vx * vx + vy * vy
    along = (square + l2 * l2 - l3 * l3) / (2 * square)
    across = branch * mp.sqrt(l2 * l2 / square - along * along)
    if l1 > l4:
        return t + mp.pi + mp.atan2(l4 * mp.sin(t), l1 - l4 * mp.cos(t)) + mp.atan2(across, along)
    return mp.atan2(vy, vx) + mp.atan2(across, along)


def kinematics(report: Callable[[Row], None]) -> None:
    """theta2 and its derivatives against 50 digits."""
    random = np.random.default_rng(1)
    for low, high in ((-15, -12), (-12, -8), (-8, -4), (-4, -1)):
        worst, textbook, slope, count = 0.0, 0.0, 0.0, 25
        for _ in range(count):
            lengths = folding_lengths(random, 10.0 ** random.uniform(low, high))
            branch, crank = int(random.choice([-1, 1])), folding_angles(random, 12)
            mine, theirs = theta2_error(lengths, branch, crank)
            worst, textbook = max(worst, mine), max(textbook, theirs)
            slope = max(slope, gradient_error(lengths, branch, crank[:3]))
        report(
            Row(
                f"coupler angle, 1e{low}..1e{high} of the perimeter from a change point, cranks near the fold",
                count * 12,
                f"{worst:.1e} rad (arccos form: {textbook:.1e}); derivatives {slope:.1e} relative",
                "every term of the closure is a sum of non-negative numbers, so the angle keeps all its digits; "
                "derivatives lose some within 1e-12, where they grow without bound",
                "at the change point itself the branches meet, and the derivatives are infinite",
                {"theta2": worst, "textbook": textbook, "gradient": slope},
            )
        )
    for power in (-200, -100, 100, 200):
        worst, slope, count = 0.0, 0.0, 20
        for _ in range(count):
            lengths = np.ldexp(simplex(random, is_crank_rocker), round(power * np.log2(10)))
            crank = random.uniform(0, 6.28, 8)
            worst = max(worst, theta2_error(lengths, 1, crank)[0])
            slope = max(slope, gradient_error(lengths, 1, crank[:2]))
        report(
            Row(
                f"coupler angle, lengths of 1e{power}",
                count * 8,
                f"{worst:.1e} rad; derivatives {slope:.1e} relative",
                "lengths are divided by a power of two first: the same bits as at any other scale",
                "-",
                {"theta2": worst, "gradient": slope},
            )
        )
    worst, count = 0.0, 40
    for _ in range(count):
        lengths = simplex(random, is_crank_rocker)
        start = random.uniform(0, 6.28)
        crank = start + np.linspace(0, 10.0 ** random.uniform(-9, -3), 8)
        worst = max(worst, theta2_error(lengths, 1, crank)[0])
    report(
        Row(
            "coupler angle over spans of 1e-9 .. 1e-3 rad",
            count * 8,
            f"{worst:.1e} rad",
            "the error is absolute: the curve's shape over the span is known to rounding over span",
            "a shape below rounding; spans under 0.1 degree are refused (below)",
            {"theta2": worst},
        )
    )


def jacobian_of_refinement(report: Callable[[Row], None]) -> None:
    """Refinement's own derivatives at the far ends of the chart, where change points lie."""
    target = target_of(make_case("any order", 3).request)
    problem = Problem(target, FullCrankChart())
    random = np.random.default_rng(2)
    unknowns = np.column_stack(
        [
            random.uniform(-5, 5, 400),
            random.uniform(-30, 3, 400),
            random.uniform(-12, 12, 400),
            random.uniform(0, 6.28, 400),
        ]
    )
    branch = random.choice([-1.0, 1.0], 400)
    state = problem.evaluate(unknowns, branch)
    finite = bool(np.all(np.isfinite(state.stack)))
    done = refine(problem, unknowns, branch, 60)
    worse = int(np.sum(done.cost > state.cost))
    report(
        Row(
            "refinement from the far ends of the chart (excess down to 1e-13, L1/L4 from 1/150 to 150)",
            400,
            f"{worse} worse than their seed; numbers {'all finite' if finite else 'NOT all finite'}",
            "derivatives are capped at 1e8, steps at 1.5 in a logarithm, the damping does the rest",
            "the capped derivatives are not exact: convergence there is slow, not quadratic",
            {"worse": worse, "finite": float(finite)},
        )
    )


# -- synthesis --------------------------------------------------------------------------------------------------------


def length_gap(solution: dict[str, Any], truth: dict[str, Any], with_position: bool) -> np.ndarray:
    """How far the four lengths are from those the motion was made with, as logarithms of ratios."""
    mine, true = (np.array([one["links"][name] for name in LINKS]) for one in (solution, truth))
    if not with_position:
        mine, true = mine / mine[3], true / true[3]
    return np.abs(np.log(mine / true))


def synthesis_row(
    tried: str,
    requests: list[tuple[dict[str, Any], dict[str, Any] | None]],
    resources: ServiceResources,
    does: str,
    cannot: str,
) -> Row:
    """One class of requests: recomputed J, agreement, and how well the lengths are determined and said to be."""
    times = Times()
    worst = gap = roundings = furthest = 0.0
    ill_posed = covered = reached = told = 0
    for request, truth in requests:
        best = answer(request, resources, times)["solutions"][0]
        mine = compare(request, best)
        worst, gap = max(worst, mine.objective), max(gap, mine.gap)
        roundings = max(roundings, mine.gap / (EPSILON * mine.size))
        reached += mine.objective < REACHED
        fixed = best["determination"]
        ill_posed += fixed["ill_posed"]
        if truth is not None:
            away = length_gap(best, truth, "position" in request)
            said = np.array([np.inf if value is None else value for value in fixed["length_uncertainty"]])
            furthest = max(furthest, float(away.max()))
            told += 1
            # ten times: the uncertainty is of first order, at the resolution of the motion
            covered += bool(np.all(away <= 10 * said + 1e-9))
    cases = len(requests)
    text = f"J {worst:.1e}, {reached} of {cases} below 1e-9; reported J off by {gap:.1e} ({roundings:.0f} roundings)"
    if told:
        text += f"; lengths off by up to {furthest:.1e}, {covered} of {told} within what the reply says"
        text += f"; called ill-posed {ill_posed} times"
    numbers = {
        "objective": worst,
        "reached": reached,
        "disagreement": gap,
        "roundings": roundings,
        "length_gap": furthest,
        "within_said": covered,
        "ill_posed": ill_posed,
        "median_processor_ms": times.summary()["median_processor_ms"],
    }
    return Row(tried, cases, text, does, cannot, numbers)


def drawn(
    kind: str, cases: int, first: int = 20_000, samples: int = 32
) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Requests of a class and their truths."""
    made = [make_case(kind, first + seed, samples) for seed in range(cases)]
    return [(case.request, case.truth) for case in made]


def rescaled(request: dict[str, Any], scale: float) -> dict[str, Any]:
    """A request in another unit of length."""
    return request | {"position": (np.array(request["position"]) * scale).tolist()}


def rescaled_truth(truth: dict[str, Any], scale: float) -> dict[str, Any]:
    """A truth's links in another unit of length."""
    return truth | {"links": {name: value * scale for name, value in truth["links"].items()}}


def synthesis(report: Callable[[Row], None], resources: ServiceResources, cases: int) -> None:
    """The whole answer on extreme classes."""
    report(
        synthesis_row(
            "tiny span, 2..12 degrees",
            drawn("tiny span", cases),
            resources,
            "refined by singular values, never by normal equations; says that the lengths are not determined",
            "find the original linkage: quite different ones perform the motion to rounding",
        )
    )
    report(
        synthesis_row(
            "tiny crank, below 1/400 of the perimeter",
            drawn("tiny crank", cases),
            resources,
            "reaches the motion; the uncertainty of the lengths comes with each solution",
            "beat rounding: the motion is a 1/400 of the linkage, so its numbers hold three digits less",
        )
    )
    report(
        synthesis_row(
            "within 1e-8..1e-1 of a change point",
            drawn("change point", cases),
            resources,
            "the chart puts change points at infinity: no step crosses one, branches cannot mix",
            "promise the branch of the built linkage: clearances decide at a fold that close",
        )
    )
    report(
        synthesis_row(
            "positions 1e6 times their extent from the origin",
            drawn("offset 1e6", cases),
            resources,
            "takes the mean off before anything else",
            "J below 1e6 roundings (1e-10): the request's own numbers hold no more",
        )
    )
    far = []
    for request, truth in drawn("any order", cases):
        points = np.array(request["position"])
        shift = 1e12 * np.max(np.linalg.norm(points - points.mean(0), axis=1))
        far.append((request | {"position": (points + shift).tolist()}, truth))
    report(
        synthesis_row(
            "positions 1e12 times their extent from the origin",
            far,
            resources,
            "fits what the rounded positions say: as noise of 1e-4",
            "reach 1e-9: the positions hold four digits of the motion",
        )
    )
    for samples, kind in ((3, "any order"), (3, "rotation only"), (1024, "any order")):
        report(
            synthesis_row(
                f"N = {samples}, {'rotation only' if kind == 'rotation only' else 'rotation and position'}",
                drawn(kind, cases, samples=samples),
                resources,
                "answers, and says that the problem is ill-posed"
                if samples == 3
                else "searches on 64 samples, polishes on all",
                "determine lengths from three samples: fewer equations than unknowns" if samples == 3 else "-",
            )
        )
    for scale in (1e-9, 1e9, 1e-40, 1e40):
        pairs = [(rescaled(r, scale), rescaled_truth(t, scale)) for r, t in drawn("any order", max(3, cases // 2))]
        report(
            synthesis_row(
                f"lengths x {scale:.0e}",
                pairs,
                resources,
                "everything is relative to the motion's extent",
                "coordinates above 1e50 are refused" if scale > 1e9 else "-",
            )
        )
    turns = [(make_case("any order", 20_000 + seed), seed) for seed in range(max(3, cases // 2))]
    many = []
    for case, _ in turns:
        request = {"crank_span": 0.2, "rotation": case.request["rotation"], "position": case.request["position"]}
        many.append((request, None))
    report(
        synthesis_row(
            "a motion of 30..360 degrees asked for within 0.2 degrees of crank",
            many,
            resources,
            "returns the closest there is",
            "reach it: no four-bar turns its coupler that fast",
        )
    )
    report(
        synthesis_row(
            "noise of 1e-3 on everything",
            drawn("noise", max(3, cases // 2)),
            resources,
            "the best fit, as good as the true linkage's or better",
            "give back the true lengths: the reply says how far they may be off",
        )
    )


def refusals(report: Callable[[Row], None], resources: ServiceResources) -> None:
    """What is refused, by name of the field, and why."""
    base = make_case("any order", 1).request
    points = np.array(base["position"])
    shapeless = "double precision tells such a curve from a line in too few digits"
    turning_back = {k: v for k, v in base.items() if k != "crank_span"}
    turning_back["crank_angle"] = [0.0, 5.0, 4.0, *range(10, 10 + len(points) - 3)]
    tried = [
        ("a crank span of 0.05 degrees", base | {"crank_span": 0.05}, shapeless),
        (
            "a crank span of 3601 degrees",
            base | {"crank_span": 3601.0},
            "the motion repeats itself: ten turns will do",
        ),
        ("all positions at one point", base | {"position": [[1.0, 2.0]] * len(points)}, "every linkage would do"),
        (
            "positions whose extent is their rounding (offset 1e16)",
            base | {"position": (points + 1e16).tolist()},
            "the request's numbers hold no motion",
        ),
        ("coordinates of 1e51", base | {"position": (points * 1e51).tolist()}, "squares would come near overflow"),
        ("crank angles that turn back", turning_back, "the motion is not one of a turning crank"),
    ]
    for what, request, why in tried:
        try:
            answer(request, resources, Times())
            text = "NOT refused"
        except FieldError as error:
            text = f"refused: {error}"
        except ValueError as error:
            text = f"refused: {str(error).splitlines()[-1].strip()}"
        report(Row(what, 1, text, "a 422 that names the field", why, {}))


# -- page -------------------------------------------------------------------------------------------------------------

HEAD = """# Numerical stability

Written by `make stability`; do not edit. Errors of angles and derivatives are against arithmetic of {digits} digits on
the very same double-precision inputs; errors of answers are recomputed from the numbers of the reply by
`benchmarks/recompute.py` (circle intersection, {digits} digits). A *rounding* is 2.2e-16 of the largest length or distance
in a solution over the motion's size. Lengths are compared with those of the linkage the motion was made with, as
logarithms; *within what the reply says* is within ten times its `length_uncertainty`. numpy warnings were errors in this run.
"""
NOTES = """
## What it cannot do

- **Determine what the motion does not.** Over tiny spans and from three samples quite different linkages perform the motion
  to rounding. J is then as small as ever; the lengths are not those one started from. Each solution carries its condition
  number and the relative uncertainty of its lengths (`determination`), and the report a note. That uncertainty is of
  first order: it does not tell of an altogether different linkage, far away, that performs the motion as well.
- **Beat the request's own rounding.** Positions far from the origin hold fewer digits of the motion; J cannot fall below
  that, and does not pretend to: the objective is evaluated from the numbers of the reply.
- **Evaluate a giant linkage to the last digit.** Where an alternative solution is 1e7 times as large as the motion, its
  reported errors are off by 1e7 roundings of 1: the cancellation lies in its numbers, not in the formula.
- **Decide a branch at a change point.** At the fold both branches meet and derivatives are infinite. The chart keeps all
  candidates on one side of it; a built linkage is held there by nothing.
"""


def markdown(rows: dict[str, list[Row]]) -> str:
    """The page."""
    lines = [HEAD.format(digits=DIGITS)]
    for title, part in rows.items():
        lines += [
            f"## {title}",
            "",
            "| what was tried | cases | worst error | what the software does | what it cannot do |",
        ]
        lines.append("|---|--:|---|---|---|")
        lines += [f"| {row.tried} | {row.cases} | {row.worst} | {row.does} | {row.cannot} |" for row in part]
        lines.append("")
    return "\n".join(lines) + NOTES


def main(arguments: Sequence[str] | None = None) -> int:
    """Run every extreme class, write the page and the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20, help="requests of each class of synthesis")
    options = parser.parse_args(arguments)
    warnings.simplefilter("error")
    begin = time.perf_counter()
    resources = ServiceResources(Settings())
    rows: dict[str, list[Row]] = {}

    def into(title: str) -> Callable[[Row], None]:
        part = rows.setdefault(title, [])

        def add(row: Row) -> None:
            part.append(row)
            print(f"{row.tried}: {row.worst}", flush=True)

        return add

    kinematics(into("Kinematics"))
    jacobian_of_refinement(into("Kinematics"))
    synthesis(into("Synthesis"), resources, options.cases)
    refusals(into("Refused"), resources)
    RESULT.parent.mkdir(parents=True, exist_ok=True)
    parts = {title: [vars(row) for row in part] for title, part in rows.items()}
    stored = {"digits": DIGITS, "seconds": round(time.perf_counter() - begin), "parts": parts}
    RESULT.write_text(json.dumps(stored, indent=1) + "\n")
    PAGE.write_text(markdown(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
