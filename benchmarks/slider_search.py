"""The search for linkages with sliders: exact motions, and given drives with and without noise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from benchmarks import report
from benchmarks.report import Times
from synthesis.guided.pairs import Stage
from synthesis.guided.problem import DrivenPairProblem
from synthesis.guided.search import PairSearch, search_guided
from synthesis.guided.seeds import drives
from synthesis.guides import Driver, Kind
from synthesis.limits import Limits
from synthesis.poses import make_poses
from synthesis.work import Work
from tests.oracles.guided import KINDS, random_motion

_DRIVERS = dict(zip(KINDS, (Driver.CRANK, Driver.CRANK, Driver.SLIDER, Driver.SLIDER, Driver.CYLINDER)))
_ANY = Limits(family="any")
_EXACT = 1e-9


def measure(
    cases: Annotated[int, "of each kind and number of poses"] = 100,
    given: Annotated[int, "of each kind with given drive"] = 40,
) -> Iterator[dict[str, Any]]:
    """Exact motions, and given drives."""
    rows = [_exact(kind, poses, cases) for kind in KINDS for poses in (4, 5, 6, 10, 30)]
    yield {"exact": [row for row in rows if row["cases"]], "given": [_given_drive(kind, given) for kind in KINDS]}


def _exact(kind: str, poses: int, cases: int) -> dict[str, Any]:
    """Motions of random linkages of a kind, driven as they were made; where nothing is found the error counts as 1."""
    random, times, worst, found = np.random.default_rng([poses, KINDS.index(kind)]), Times(), 0.0, 0
    if poses == 4 and kind != "rail_slot":
        cases = 0
    for _ in range(cases):
        rotation, position, _ = random_motion(random, kind, poses)
        target = make_poses(rotation, position)
        solutions, _ = times.run(search_guided, target, _ANY, [Kind(kind)], _DRIVERS[kind])
        smallest = min((solution.errors.objective for solution in solutions), default=np.inf)
        found += smallest < _EXACT
        worst = max(worst, smallest if np.isfinite(smallest) else 1.0)
    row: dict[str, Any] = {"kind": kind, "poses": poses, "cases": cases}
    if cases:
        row |= {"share": found / cases, "worst": worst} | times.summary()
    return row


def _given_drive(kind: str, cases: int) -> dict[str, Any]:
    """Twelve poses at a given drive: exact, and with noise of 1e-3 compared with the descent from the linkage they are of."""
    random, times, exact, close = np.random.default_rng(KINDS.index(kind)), Times(), 0, 0
    drive_types = drives([Kind(kind)], _DRIVERS[kind])
    for _ in range(cases):
        rotation, position, drive = random_motion(random, kind, 12)
        poses = make_poses(rotation, position)
        truth = PairSearch(poses, _ANY, drive_types, 1e-10, Work(), drive)
        times.run(truth.run)
        exact += truth.incumbents.smallest < _EXACT
        off = 1e-3 * random.normal(size=(3, 12))
        noisy = make_poses(
            rotation + off[0], position + poses.length_scale * (off[1] + 1j * off[2]), length_scale=poses.length_scale
        )
        search = PairSearch(noisy, _ANY, drive_types, 1e-10, Work(), drive)
        search.run()
        if np.isfinite(truth.incumbents.smallest):
            assert isinstance(search.problem, DrivenPairProblem)
            stages = (Stage(60, 1.0, 8, 1e-6, 1e-3),)
            descended = np.sqrt(search.problem.timed(truth.incumbents.pools[None], stages).cost.min())
            close += bool(search.incumbents.smallest <= 1.01 * descended)
    return {
        "kind": kind,
        "driver": _DRIVERS[kind].value,
        "cases": cases,
        "exact": exact / cases,
        "near": close / cases,
    } | times.summary()


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables, and the exact motions in words."""
    rows = results["exact"]
    kinds = []
    for kind in KINDS:
        own = [row for row in rows if row["kind"] == kind]
        minima = {name: [row[f"{name}_processor_ms"] for row in own] for name in ("median", "p99")}
        kinds.append(
            {
                "kind": kind,
                "poses": ", ".join(str(row["poses"]) for row in own),
                "cases": sum(row["cases"] for row in own),
                "share": sum(row["share"] * row["cases"] for row in own) / sum(row["cases"] for row in own),
                "worst": max(row["worst"] for row in own),
                **{name: f"{min(values):.2g} to {max(values):.2g}" for name, values in minima.items()},
            }
        )
    drives = results["given"]
    exact, close = (sum(round(row[name] * row["cases"]) for row in drives) for name in ("exact", "near"))
    return report.tables("slider_search", {"exact": kinds}) | {
        "given": f"{exact:,} of {sum(row['cases'] for row in drives):,} below 1e-9; with noise of a thousandth {close:,} "
        "within 1 % of the descent from the linkage that made them, in "
        f"{report.ends([row['median_processor_ms'] for row in drives])} ms at the median of each kind"
    }


if __name__ == "__main__":
    report.run(measure)
