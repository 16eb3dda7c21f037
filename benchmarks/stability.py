"""Numerical stability in extreme cases, against arithmetic of 50 digits (`make stability`)."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from mpmath import mp, mpf

from benchmarks import product, report
from benchmarks.report import Times
from tests.oracles.classes import change_point, is_crank_rocker, make_case, simplex
from tests.oracles.recompute import DIGITS, LINKS, REACHED, close_by_circles, compare

EPSILON = float(np.finfo(float).eps)
Request = dict[str, Any]


EXTREMES = tomllib.loads((report.ROOT / "benchmarks" / "extremes.toml").read_text())


def row(name: str, cases: int, worst: str, numbers: dict[str, Any], **columns: Any) -> dict[str, Any]:
    """A line of the report: one of `EXTREMES`, on how many cases, and the worst that came out, a format of the numbers."""
    words = {key: text.format(**columns) for key, text in EXTREMES[name].items()}
    words["worst"] = worst.format(**numbers) if numbers else worst
    print("{tried}: {worst}".format(**words), flush=True)
    return {**words, "cases": cases, "numbers": numbers}


def folding_angles(random: np.random.Generator, count: int) -> np.ndarray:
    """Crank angles, most of them near where the linkage folds flat: 0 and pi."""
    angles = random.choice([0.0, np.pi], count) + 10.0 ** random.uniform(-12, 0, count) * random.choice(
        [-1, 1], count
    )
    return np.where(random.random(count) < 0.8, angles, random.uniform(0, 6.28, count))


def theta2_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """Worst error of theta2 in radians."""
    exact = close_by_circles(lengths, branch, crank).theta2
    found = product.close_loop(lengths, crank).coupler_angle(np.array(branch))
    with mp.workdps(DIGITS):
        # where L1 > L4 both are continuous, but may begin a whole turn apart
        turn = 2 * mp.pi * mp.nint((mpf(found[0]) - exact[0]) / (2 * mp.pi))
        return max(abs(float(mpf(mine) - turn - true)) for mine, true in zip(found, exact))


def textbook_error(lengths: np.ndarray, branch: int, crank: np.ndarray) -> float:
    """Return the angle by the arccos form, up to whole turns."""
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
        numbers = dict(zip(("theta2", "textbook", "gradient"), np.max(errors, axis=0)))
        worst = "{theta2:.1e} rad (arccos form: {textbook:.1e}); derivatives {gradient:.1e} relative"
        yield row("change-point-angle", 12 * len(errors), worst, numbers, low=low, high=high)
    for exponent in (-200, -100, 100, 200):
        errors = []
        for _ in range(20):
            lengths = np.ldexp(simplex(random, is_crank_rocker), round(exponent * np.log2(10)))
            crank = random.uniform(0, 6.28, 8)
            errors.append((theta2_error(lengths, 1, crank), gradient_error(lengths, 1, crank[:2])))
        numbers = dict(zip(("theta2", "gradient"), np.max(errors, axis=0)))
        worst = "{theta2:.1e} rad; derivatives {gradient:.1e} relative"
        yield row("scale-angle", 8 * len(errors), worst, numbers, exponent=exponent)
    errors = []
    for _ in range(40):
        crank = random.uniform(0, 6.28) + np.linspace(0, 10.0 ** random.uniform(-9, -3), 8)
        errors.append(theta2_error(simplex(random, is_crank_rocker), 1, crank))
    yield row("short-span-angle", 8 * len(errors), "{theta2:.1e} rad", {"theta2": max(errors)})
    random, count = np.random.default_rng(2), 400
    problem = product.GivenProblem(product.target_of(make_case("any order", 3).request), product.GrashofChart())
    unknowns = random.uniform((-5, -30, -12, 0), (5, 3, 12, 6.28), (count, 4))
    seeds = product.candidates_at(unknowns[:, :3], random.choice([-1.0, 1.0], count), unknowns[:, 3])
    seeds = problem.measured(seeds)
    systems = [system for system in problem.linearised(seeds.timed, 1e-3) if system is not None]
    finite = len(systems) == count and all(np.all(np.isfinite(system["rows"])) for system in systems)
    worse = int(np.sum(product.refine(problem, seeds.timed, 60).cost > seeds.cost))
    text = f"{worse} worse than their seed; numbers {'all finite' if finite else 'NOT all finite'}"
    yield row("chart-ends", count, text, {"worse": worse, "finite": finite})


def drawn(kind: str, cases: int, samples: int = 32) -> list[tuple[Request, dict[str, Any]]]:
    """Requests of a class and their truths."""
    drawn_cases = [make_case(kind, 20_000 + seed, samples) for seed in range(cases)]
    return [(case.request, case.truth) for case in drawn_cases]


def rescaled(request: Request, truth: dict[str, Any], scale: float) -> tuple[Request, dict[str, Any]]:
    """Return the request in another unit of length; for the truth only the links."""
    links = {name: value * scale for name, value in truth["links"].items()}
    return request | {"position": (np.array(request["position"]) * scale).tolist()}, truth | {"links": links}


def shifted(request: Request, extents: float) -> Request:
    """Return the request moved by a multiple of its extent."""
    points = np.array(request["position"])
    shift = extents * np.max(np.linalg.norm(points - points.mean(0), axis=1))
    return request | {"position": (points + shift).tolist()}


def extremes(cases: int) -> Iterator[tuple[str, dict[str, Any], list[tuple[Request, dict[str, Any] | None]]]]:
    """Return all kinds of numerically difficult requests, each with its truth; slow kinds with half of the cases."""
    half, plain = max(3, cases // 2), drawn("any order", cases)
    for kind in ("tiny span", "tiny crank", "change point", "offset 1e6"):
        yield kind.replace(" ", "-"), {}, drawn(kind, cases)
    yield "offset-1e12", {}, [(shifted(request, 1e12), truth) for request, truth in plain]
    for what, kind in (("rotation and position", "any order"), ("rotation only", "rotation only")):
        yield "three-samples", {"what": what}, drawn(kind, cases, 3)
    yield "many-samples", {}, drawn("any order", cases, 1024)
    for scale in (1e-9, 1e9, 1e-40, 1e40):
        requests = [rescaled(request, truth, scale) for request, truth in drawn("any order", half)]
        yield "scale-up" if scale > 1e9 else "scale", {"scale": scale}, requests
    yield "fast-motion", {}, [(request | {"crank_span": 0.2}, None) for request, _ in drawn("any order", half)]
    yield "noise", {}, drawn("noise", half)


def length_gap(solution: dict[str, Any], truth: dict[str, Any], with_position: bool) -> np.ndarray:
    """Return the logarithms of the ratios of the four lengths to the lengths that produced the motion."""
    mine, true = (np.array([linkage["links"][name] for name in LINKS]) for linkage in (solution, truth))
    if not with_position:
        mine, true = mine / mine[3], true / true[3]
    return np.abs(np.log(mine / true))


def synthesis(resources: product.ServiceResources, cases: int) -> Iterator[dict[str, Any]]:
    """Measure recomputed J, agreement with the reported errors, and the determination of the lengths."""
    for name, columns, requests in extremes(cases):
        times, compared, gaps, ill_posed, covered = Times(), [], [], 0, 0
        for request, truth in requests:
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
            "objective": max(comparison.objective for comparison in compared),
            "reached": sum(comparison.objective < REACHED for comparison in compared),
            "disagreement": max(comparison.gap for comparison in compared),
            "roundings": max(comparison.gap / (EPSILON * comparison.size) for comparison in compared),
            "length_gap": max(gaps, default=0.0),
            "within_said": covered,
            "ill_posed": ill_posed,
            "median_processor_ms": 1000 * times.median.processor,
        }
        text = f"J {{objective:.1e}}, {{reached}} of {len(compared)} below 1e-9; "
        text += "reported J off by {disagreement:.1e} ({roundings:.0f} roundings)"
        if gaps:
            text += f"; lengths off by up to {{length_gap:.1e}}, {{within_said}} of {len(gaps)} within ten times what the "
            text += "reply says; called ill-posed {ill_posed} times"
        yield row(name, len(compared), text, numbers, **columns)


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/background/measurements.md."""
    tables: dict[str, list[dict[str, Any]]] = {}
    for part in ("kinematics", "synthesis"):
        for found in results["parts"][part]:
            known = bool(found["numbers"].get("length_gap"))  # the linkage that the motion was made with
            numbers = found["numbers"] | {
                "gap": report.power(found["numbers"]["length_gap"]) if known else "-",
                "said": f"{found['numbers']['within_said']} of {found['cases']}" if known else "-",
            }
            tables.setdefault(part, []).append(found | numbers)
    return report.tables("stability", tables)


def measure(cases: Annotated[int, "of each class of synthesis"] = 20) -> Iterator[dict[str, Any]]:
    """Every extreme class."""
    warnings.simplefilter("error")
    resources = product.prepared_service()
    parts = {"kinematics": kinematics(), "synthesis": synthesis(resources, cases)}
    yield {"digits": DIGITS, "parts": {title: list(rows) for title, rows in parts.items()}}


if __name__ == "__main__":
    report.run(measure)
