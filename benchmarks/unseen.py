"""How sure an answer is: the chance that replies name of having missed a better valley, beside what heavy searches found.

``python -m benchmarks.engine --heavy 20 --cases 100`` makes the references of the first 100 requests of each class, and
``python -m benchmarks.unseen`` asks these requests by default. It prints the `odds` of `synthesis.rounds.Rounds` that suit the
answers best.
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

NAMES = ("drawn path", "random poses", "within limits")
EDGES = (0.0, 0.02, 0.05, 0.15, 0.3, 1.0)
"""Of the classes of what replies say."""
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


def blocks(results: Mapping[str, Any]) -> dict[str, str]:
    """By what replies say: how many do, the mean of it, and how many were beaten."""
    requests, rows = results["requests"], []
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
    return report.tables("unseen", {"estimates": rows})


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
    yield {"made": stamp, "requests": requests}


if __name__ == "__main__":
    report.run(measure)
