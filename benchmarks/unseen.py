"""How sure an answer is: the chance that replies name of having missed a better valley, beside what heavy searches found.

``python -m benchmarks.engine --heavy 20 --cases 100`` makes the references of the first 100 requests of each class, and
``python -m benchmarks.unseen`` asks these requests by default, and as many motions of linkages with sliders. It prints
the `odds` of `synthesis.rounds.Rounds` and of `synthesis.guided.search` that suit the answers best.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

import benchmarks.engine as engine
from benchmarks import report
from synthesis import rounds
from synthesis.guided import search as guided
from synthesis.guides import Kind
from synthesis.limits import Limits
from synthesis.poses import Poses, make_poses
from synthesis.work import Work

NAMES = ("drawn path", "random poses", "within limits")
EDGES = (0.0, 0.02, 0.05, 0.15, 0.3, 1.0)
"""Of the classes of what replies say."""
HEAVY = {"_IDLE": 80, "_ROUNDS": 120, "_SEEDS": 50, "_HOPS": 12, "_POOL": 12, "_ENDED": 4}
HEAVY_SECONDS = 3.0
"""The heavy search among linkages with sliders: numbers of `synthesis.guided.search`, and its budget."""
LITTLE = 0.1
"""What keeps numbers at 0 about which few answers tell."""


def asked(case: engine.Case, best: float) -> dict[str, Any] | None:
    """What a reply says, what that was made of, and whether it was beaten; nothing where the answer is exact."""
    kept: list[rounds.Found] = []

    class Noticed(rounds.Found):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            kept.append(self)

    before, modules = rounds.Found, (engine.la.door.search_free, engine.la.door.search)
    for one in modules:
        one.__globals__["Found"] = Noticed
    try:
        reply = case.ask()
    finally:
        for one in modules:
            one.__globals__["Found"] = before
    if not reply.solutions or reply.report.unseen is None:
        return None
    beaten = bool(engine.first_cost(case, reply) > engine.NEAR * best)
    return {
        "said": reply.report.unseen,
        "elsewhere": rounds.elsewhere(kept[0].led),
        "rounds": len(kept[0].led),
        "beaten": beaten,
    }


def fit(requests: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Both numbers, by logistic regression: Newton's method."""
    rows = np.array([[1.0, np.log(one["elsewhere"])] for one in requests])
    wanted, found = np.array([float(one["beaten"]) for one in requests]), np.zeros(2)
    for _ in range(50):
        chance = 1 / (1 + np.exp(-rows @ found))
        slope = rows.T @ (wanted - chance) - LITTLE * found
        found = found + np.linalg.solve((rows.T * (chance * (1 - chance))) @ rows + LITTLE * np.eye(2), slope)
    return found


def body_motion(seed: int) -> Poses:
    """Five to nineteen poses of a body that wanders and turns, in no unit."""
    random = np.random.default_rng(seed)
    along = np.linspace(0, 1, int(random.integers(5, 20)))

    def waves(size: float) -> Any:
        parts = [(random.normal() * size / (k + 1) ** 1.5, random.uniform(0, 6)) for k in range(3)]
        return sum(part * np.sin((k + 1) * np.pi * along * 0.7 + phase) for k, (part, phase) in enumerate(parts))

    rotation = random.uniform(0.3, 1.8) * along + waves(0.15)
    return make_poses(rotation, along * np.exp(1j * random.uniform(0, 6)) + waves(0.3) + 1j * waves(0.3))


def with_sliders(seed: int, seconds: float) -> dict[str, Any] | None:
    """The same of a search among linkages with sliders, held against one of more candidates and rounds."""
    poses, ways = body_motion(seed), guided.drives([kind for kind in Kind if kind is not Kind.FOUR_BAR], None)
    least = (None, 30.0, 40.0)[seed % 3]
    limits = Limits(family="any", **({} if least is None else {"transmission_angle_min": float(np.deg2rad(least))}))
    search = guided.Search(poses, limits, ways, guided.DEFAULT_TOLERANCE, Work())
    search.run()
    before = {name: getattr(guided, name) for name in HEAVY}
    try:
        vars(guided).update(HEAVY)
        heavy = guided.Search(poses, limits, ways, guided.DEFAULT_TOLERANCE, Work(seconds))
        heavy.run()
    finally:
        vars(guided).update(before)
    found = float(search.levels.min())
    if not guided.DEFAULT_TOLERANCE < found < np.inf:
        return None
    said = rounds.unseen(search.elsewhere, guided.ODDS)
    beaten = bool(found > engine.NEAR * heavy.levels.min())
    return {"said": said, "elsewhere": search.elsewhere, "rounds": len(search.led), "beaten": beaten}


def blocks(results: Mapping[str, Any]) -> dict[str, str]:
    """By what replies say: how many do, the mean of it, and how many were beaten."""
    tables = {
        name: estimates(results.get(key, [])) for name, key in (("estimates", "requests"), ("sliders", "sliders"))
    }
    told = report.tables("unseen", tables)
    return told if "sliders" in results else told | {"sliders": "Of linkages with sliders: not measured yet."}


def estimates(requests: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Requests in classes of what their replies say."""
    rows = []
    for low, high in pairwise(EDGES):
        some = [one for one in requests if low <= one["said"] < high]
        if some:
            rows.append(
                {
                    "between": f"{100 * low:.0f} to {100 * high:.0f} %",
                    "requests": len(some),
                    "mean": float(np.mean([one["said"] for one in some])),
                    "beaten": float(np.mean([one["beaten"] for one in some])),
                }
            )
    return rows


def measure(
    cases: Annotated[int, "of each class"] = 100, seconds: Annotated[float, "of heavy search, at least"] = 10.0
) -> Iterator[dict[str, Any]]:
    """All requests that have a reference."""
    threadpool_limits(1, "blas")
    stamp, references, requests = report.stamp(), engine.References(), []
    for name in NAMES:
        for seed in engine.CLASSES[name].some(cases):
            case = engine.CLASSES[name].case(seed)
            best, spent = references.of(name, seed, case.mark)
            told = asked(case, best) if spent >= seconds else None
            if told is not None:
                requests.append({"class": name, "seed": seed, **told})
    for crank in ("free", "given"):
        some = [one for one in requests if (one["class"] == NAMES[-1]) is (crank == "given")]
        print(f"{len(some)} requests, crank angles {crank}: odds {fit(some).round(2).tolist()}")
    motions = [one for seed in range(cases) if (one := with_sliders(seed, HEAVY_SECONDS)) is not None]
    print(f"{len(motions)} motions, linkages with sliders: odds {fit(motions).round(2).tolist()}")
    yield {"made": stamp, "requests": requests, "sliders": motions}


if __name__ == "__main__":
    report.run(measure)
