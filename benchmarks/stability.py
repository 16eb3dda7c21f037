"""Numerical stability in extreme cases, against arithmetic of 50 digits (`make stability`)."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import numpy as np
from mpmath import mp, mpf

from benchmarks import product, report
from benchmarks.report import Times
from tests.oracles.classes import change_point, is_crank_rocker, make_case, simplex
from tests.oracles.recompute import DIGITS, LINKS, REACHED, close_by_circles, compare

EPSILON = float(np.finfo(float).eps)
Request = dict[str, Any]


def row(tried: str, cases: int, worst: str, does: str, cannot: str, **numbers: Any) -> dict[str, Any]:
    """A line of the report: what was tried on how many cases, the worst that came out (a format of the numbers), and why."""
    worst = worst.format(**numbers)
    print(f"{tried}: {worst}", flush=True)
    return {"tried": tried, "cases": cases, "worst": worst, "does": does, "cannot": cannot, "numbers": numbers}


def folding_angles(random: np.random.Generator, count: int) -> np.ndarray:
    """Crank angles, most of them near where the linkage folds flat: 0 and pi."""
    near = random.choice([0.0, np.pi], count) + 10.0 ** random.uniform(-12, 0, count) * random.choice([-1, 1], count)
    return np.where(random.random(count) < 0.8, near, random.uniform(0, 6.28, count))


def theta2_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """Worst error of theta2 in radians."""
    exact = close_by_circles(lengths, branch, crank).theta2
    found = product.close_loop(lengths, crank).coupler_angle(np.array(branch))
    with mp.workdps(DIGITS):
        # where L1 > L4 both are continuous, but may begin a whole turn apart
        turn = 2 * mp.pi * mp.nint((mpf(found[0]) - exact[0]) / (2 * mp.pi))
        return max(abs(float(mpf(mine) - turn - true)) for mine, true in zip(found, exact))


def textbook_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """The same for the arccos form, up to whole turns."""
    l1, l2, l3, l4 = lengths / lengths.max()
    with np.errstate(all="ignore"):
        diagonal = l4 - l1 * np.exp(1j * crank)
        cosine = (l2**2 + np.abs(diagonal) ** 2 - l3**2) / (2 * l2 * np.abs(diagonal))
        found = np.angle(diagonal) + branch * np.arccos(np.clip(cosine, -1, 1))
    gaps = [float(mpf(mine) - true) for mine, true in zip(found, close_by_circles(lengths, branch, crank).theta2)]
    return max(abs(gap - 2 * np.pi * round(gap / (2 * np.pi))) for gap in gaps)


def gradient_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """Worst error of the five derivatives of theta2, relative to the largest (in logarithms of the lengths)."""
    found = product.close_loop(lengths, crank).coupler_angle_gradient(np.array(branch))
    worst = 0.0
    for t, mine in zip(crank, found):
        with mp.workdps(DIGITS):
            point = [mpf(value) for value in (*lengths, t)]
            weight, true = [*point[:4], mpf(1)], []
            for k in range(5):
                step = weight[k] * mpf(10) ** -20
                moved = [[value + sign * step * (j == k) for j, value in enumerate(point)] for sign in (1, -1)]
                above, below = (close_by_circles(at[:4], branch, at[4:]).theta2[0] for at in moved)
                true.append((above - below) / (2 * step) * weight[k])
            gaps = [abs(mpf(value) * w - right) for value, w, right in zip(mine, weight, true)]
            worst = max(worst, float(max(gaps) / max(abs(right) for right in true)))
    return worst


def kinematics() -> Iterator[dict[str, Any]]:
    """theta2 and its derivatives against 50 digits; refinement where the derivatives are largest."""
    random = np.random.default_rng(1)
    for low, high in ((-15, -12), (-12, -8), (-8, -4), (-4, -1)):
        errors = []
        for _ in range(25):
            where = change_point(random, low, high), int(random.choice([-1, 1])), folding_angles(random, 12)
            errors.append((theta2_error(*where), textbook_error(*where), gradient_error(*where[:2], where[2][:3])))
        yield row(
            f"coupler angle, 1e{low}..1e{high} of the perimeter from a change point, cranks near the fold",
            12 * len(errors),
            "{theta2:.1e} rad (arccos form: {textbook:.1e}); derivatives {gradient:.1e} relative",
            "every term of the closure is a sum of non-negative numbers, so the angle keeps all its digits; "
            "derivatives lose some within 1e-12, where they grow without bound",
            "at the change point itself the branches meet, and the derivatives are infinite",
            **dict(zip(("theta2", "textbook", "gradient"), np.max(errors, axis=0))),
        )
    for exponent in (-200, -100, 100, 200):
        errors = []
        for _ in range(20):
            lengths = np.ldexp(simplex(random, is_crank_rocker), round(exponent * np.log2(10)))
            crank = random.uniform(0, 6.28, 8)
            errors.append((theta2_error(lengths, 1, crank), gradient_error(lengths, 1, crank[:2])))
        yield row(
            f"coupler angle, lengths of 1e{exponent}",
            8 * len(errors),
            "{theta2:.1e} rad; derivatives {gradient:.1e} relative",
            "lengths are divided by a power of two first: the same bits as at any other scale",
            "-",
            **dict(zip(("theta2", "gradient"), np.max(errors, axis=0))),
        )
    errors = []
    for _ in range(40):
        crank = random.uniform(0, 6.28) + np.linspace(0, 10.0 ** random.uniform(-9, -3), 8)
        errors.append(theta2_error(simplex(random, is_crank_rocker), 1, crank))
    yield row(
        "coupler angle over spans of 1e-9 .. 1e-3 rad",
        8 * len(errors),
        "{theta2:.1e} rad",
        "the error is absolute: the curve's shape over the span is known to rounding over span",
        "a shape below rounding; spans under 0.1 degree are refused (below)",
        theta2=max(errors),
    )
    random, count = np.random.default_rng(2), 400
    problem = product.ProjectedProblem(product.target_of(make_case("any order", 3).request), product.FullCrankChart())
    unknowns = random.uniform((-5, -30, -12, 0), (5, 3, 12, 6.28), (count, 4))
    branch = random.choice([-1.0, 1.0], count)
    state = problem.evaluate(unknowns, branch)
    finite = bool(np.all(np.isfinite(state.stack)))
    worse = int(np.sum(product.refine(problem, unknowns, branch, 60).cost > state.cost))
    yield row(
        "refinement from the far ends of the chart (excess down to 1e-13, L1/L4 from 1/150 to 150)",
        count,
        f"{worse} worse than their seed; numbers {'all finite' if finite else 'NOT all finite'}",
        "derivatives are capped at 1e8, steps at 1.5 in a logarithm, the damping does the rest",
        "the capped derivatives are not exact: convergence there is slow, not quadratic",
        worse=worse,
        finite=finite,
    )


class Extreme(NamedTuple):
    """A kind of requests that is hard on the numbers, each with the linkage it was made from."""

    tried: str
    requests: list[tuple[Request, dict[str, Any] | None]]
    does: str
    cannot: str = "-"


def drawn(kind: str, cases: int, samples: int = 32) -> list[tuple[Request, dict[str, Any]]]:
    """Requests of a class and their truths."""
    made = [make_case(kind, 20_000 + seed, samples) for seed in range(cases)]
    return [(case.request, case.truth) for case in made]


def rescaled(request: Request, truth: dict[str, Any], scale: float) -> tuple[Request, dict[str, Any]]:
    """The same in another unit of length; of the truth the links alone."""
    links = {name: value * scale for name, value in truth["links"].items()}
    return request | {"position": (np.array(request["position"]) * scale).tolist()}, truth | {"links": links}


def shifted(request: Request, extents: float) -> Request:
    """The same so many of its extents away."""
    points = np.array(request["position"])
    shift = extents * np.max(np.linalg.norm(points - points.mean(0), axis=1))
    return request | {"position": (points + shift).tolist()}


def extremes(cases: int) -> Iterator[Extreme]:
    """All kinds; the slower ones with half of the cases."""
    half = max(3, cases // 2)
    yield Extreme(
        "tiny span, 2..12 degrees",
        drawn("tiny span", cases),
        "refined by singular values, never by normal equations; says that the lengths are not determined",
        "find the original linkage: quite different ones perform the motion to rounding",
    )
    yield Extreme(
        "tiny crank, below 1/400 of the perimeter",
        drawn("tiny crank", cases),
        "reaches the motion; the uncertainty of the lengths comes with each solution",
        "beat rounding: the motion is a 1/400 of the linkage, so its numbers hold three digits less",
    )
    yield Extreme(
        "within 1e-8..1e-1 of a change point",
        drawn("change point", cases),
        "the chart puts change points at infinity: no step crosses one, branches cannot mix",
        "promise the branch of the built linkage: clearances decide at a fold that close",
    )
    yield Extreme(
        "positions 1e6 times their extent from the origin",
        drawn("offset 1e6", cases),
        "takes the mean off before anything else",
        "J below 1e6 roundings (1e-10): the request's own numbers hold no more",
    )
    yield Extreme(
        "positions 1e12 times their extent from the origin",
        [(shifted(request, 1e12), truth) for request, truth in drawn("any order", cases)],
        "fits what the rounded positions say: as noise of 1e-4",
        "reach 1e-9: the positions hold four digits of the motion",
    )
    for what, kind in (("rotation and position", "any order"), ("rotation only", "rotation only")):
        yield Extreme(
            f"N = 3, {what}",
            drawn(kind, cases, 3),
            "answers, and says that the problem is ill-posed",
            "determine lengths from three samples: fewer equations than unknowns",
        )
    yield Extreme(
        "N = 1024, rotation and position", drawn("any order", cases, 1024), "searches on 64 samples, polishes on all"
    )
    for scale in (1e-9, 1e9, 1e-40, 1e40):
        yield Extreme(
            f"lengths x {scale:.0e}",
            [rescaled(request, truth, scale) for request, truth in drawn("any order", half)],
            "everything is relative to the motion's extent",
            "coordinates above 1e50 are refused" if scale > 1e9 else "-",
        )
    yield Extreme(
        "a motion of 30..360 degrees asked for within 0.2 degrees of crank",
        [(request | {"crank_span": 0.2}, None) for request, _ in drawn("any order", half)],
        "returns the closest there is",
        "reach it: no four-bar turns its coupler that fast",
    )
    yield Extreme(
        "noise of 1e-3 on everything",
        drawn("noise", half),
        "the best fit, as good as the true linkage's or better",
        "give back the true lengths: the reply says how far they may be off",
    )


def length_gap(solution: dict[str, Any], truth: dict[str, Any], with_position: bool) -> np.ndarray:
    """How far the four lengths are from those the motion was made with, as logarithms of ratios."""
    mine, true = (np.array([one["links"][name] for name in LINKS]) for one in (solution, truth))
    if not with_position:
        mine, true = mine / mine[3], true / true[3]
    return np.abs(np.log(mine / true))


def synthesis(resources: product.ServiceResources, cases: int) -> Iterator[dict[str, Any]]:
    """Recomputed J, agreement of what is reported, and how well the lengths are determined and said to be."""
    for kind in extremes(cases):
        times, compared, gaps, ill_posed, covered = Times(), [], [], 0, 0
        for request, truth in kind.requests:
            best = product.answer(request, resources, times)["solutions"][0]
            compared.append(compare(request, best))
            fixed = best["determination"]
            ill_posed += fixed["ill_posed"]
            if truth is not None:
                away = length_gap(best, truth, "position" in request)
                said = np.array([np.inf if value is None else value for value in fixed["length_uncertainty"]])
                gaps.append(float(away.max()))
                # ten times: the uncertainty is of first order, at the resolution of the motion
                covered += bool(np.all(away <= 10 * said + 1e-9))
        numbers = {
            "objective": max(one.objective for one in compared),
            "reached": sum(one.objective < REACHED for one in compared),
            "disagreement": max(one.gap for one in compared),
            "roundings": max(one.gap / (EPSILON * one.size) for one in compared),
            "length_gap": max(gaps, default=0.0),
            "within_said": covered,
            "ill_posed": ill_posed,
            "median_processor_ms": 1000 * times.median.processor,
        }
        text = f"J {{objective:.1e}}, {{reached}} of {len(compared)} below 1e-9; "
        text += "reported J off by {disagreement:.1e} ({roundings:.0f} roundings)"
        if gaps:
            text += f"; lengths off by up to {{length_gap:.1e}}, {{within_said}} of {len(gaps)} within what the reply says"
            text += "; called ill-posed {ill_posed} times"
        yield row(kind.tried, len(compared), text, kind.does, kind.cannot, **numbers)


def refusals(resources: product.ServiceResources) -> Iterator[dict[str, Any]]:
    """What is refused, by name of the field, and why."""
    base = make_case("any order", 1).request
    points = np.array(base["position"])
    turning_back = {name: value for name, value in base.items() if name != "crank_span"}
    turning_back["crank_angle"] = [0.0, 5.0, 4.0, *range(10, 10 + len(points) - 3)]
    shapeless = "double precision tells such a curve from a line in too few digits"
    extent = "positions whose extent is their rounding (offset 1e16)"
    tried = {
        "a crank span of 0.05 degrees": (base | {"crank_span": 0.05}, shapeless),
        "a crank span of 3601 degrees": (
            base | {"crank_span": 3601.0},
            "the motion repeats itself: ten turns will do",
        ),
        "all positions at one point": (base | {"position": [[1.0, 2.0]] * len(points)}, "every linkage would do"),
        extent: (base | {"position": (points + 1e16).tolist()}, "the request's numbers hold no motion"),
        "coordinates of 1e51": (base | {"position": (points * 1e51).tolist()}, "squares would come near overflow"),
        "crank angles that turn back": (turning_back, "the motion is not one of a turning crank"),
    }
    for what, (request, why) in tried.items():
        try:
            product.answer(request, resources, Times())
            text = "NOT refused"
        except product.FieldError as error:
            text = f"refused: {error}"
        except ValueError as error:  # of the request's model: field, what is wrong with it, where to read on
            field, problem = str(error).splitlines()[1:3]
            text = f"refused: {field}: {problem.strip().split(' [')[0]}"
        yield row(what, 1, text.replace("{", "{{").replace("}", "}}"), "a 422 that names the field", why)


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/stability.md."""
    return {
        part: report.table(rows, **report.TABLES["stability"]["parts"]) for part, rows in results["parts"].items()
    }


def measure(cases: Annotated[int, "of each class of synthesis"] = 20) -> Iterator[dict[str, Any]]:
    """Every extreme class."""
    warnings.simplefilter("error")
    resources = product.prepared_service()
    parts = {"kinematics": kinematics(), "synthesis": synthesis(resources, cases), "refused": refusals(resources)}
    yield {"digits": DIGITS, "parts": {title: list(rows) for title, rows in parts.items()}}


if __name__ == "__main__":
    report.run(measure)
