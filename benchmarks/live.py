"""How near the answers are that follow a drag: 60 ms of the processor each, beside searches that take their time.

``python -m benchmarks.live`` drags a point of drawn paths, a pose among random ones, and a sample of motions whose crank angles
are given, by twenty small moves each, and asks after every move as the page does, with what the last answer left. At every
fourth move the same is asked of a search of one second; J is recomputed by `tests.oracles`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from benchmarks import report
from benchmarks.engine import FRESH, PATHS, Case, in_time, path, poses, untimed
from tests.oracles.classes import make_case

MOVES, EVERY = 20, 4
FAR = 0.2
"""By how much of the motion's extent a sample is dragged."""
TOP = 3
"""As the page asks for."""
NEAR, FIRST_MS = 1.05, 30
SECONDS = 1.0
"""Of the searches that answers are held against."""
EXACT = 1e-9


class Drag(NamedTuple):
    """A request whose samples move."""

    request: dict[str, Any]
    at: int
    """The sample that is dragged."""

    def moved(self, move: int, way: complex) -> Case:
        """The request after so many moves."""
        request = dict(self.request)
        places = [list(place) for place in request["position"]]
        share = way * FAR * move / MOVES
        places[self.at] = [places[self.at][0] + share.real, places[self.at][1] + share.imag]
        request["position"] = places
        position = np.array(places) @ [1, 1j]
        rotation = request.get("rotation")
        if request.get("timing") == "free":
            return untimed(position, None if rotation is None else np.deg2rad(rotation), request)
        return in_time(request)


def drag_of(case: Case, seed: int) -> Iterator[Case]:
    """The case, and after each move."""
    random = np.random.default_rng([77, seed])
    position = np.array(case.request["position"]) @ [1, 1j]
    extent = float(np.max(np.abs(position - position.mean())))
    drag, way = Drag(case.request, int(random.integers(len(position)))), extent * np.exp(2j * np.pi * random.random())
    for move in range(MOVES + 1):
        yield drag.moved(move, way)


def timed(seed: int) -> Case:
    return in_time(make_case("plain", seed, 16).request)


CLASSES: dict[str, tuple[Callable[[int], Case], ...]] = {
    "drawn path": tuple(partial(path, kind) for kind in PATHS),
    "random poses": tuple(partial(poses, count) for count in (4, 6, 10, 20)),
    "crank angles given": (timed,),
}


def measured(case: Case, live: la.Live) -> dict[str, Any]:
    """J of a live reply, its processor time and that of its first answer, in ms."""
    begin = time.process_time()
    reply = case.ask(live=live, top=TOP)
    took = 1000 * (time.process_time() - begin)
    cost = case.cost(reply.best.to_dict()) if reply.solutions else np.inf
    first = reply.report.trace[0][0] if reply.report.trace else np.inf
    return {"cost": float(cost), "ms": took, "first": first, "state": len(live.state)}


def drag(case: Case, seed: int, seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """A row a move, with the least J known where a longer search was made."""
    live = la.Live()
    for move, now in enumerate(drag_of(case, seed)):
        row = {"move": move, **measured(now, live)}
        if move and move % EVERY == 0:
            reply = now.ask(seconds)
            row["final"] = min(now.cost(reply.best.to_dict()) if reply.solutions else np.inf, row["cost"])
        yield row


def near(row: dict[str, Any]) -> bool:
    """Whether an answer is as good as that of a longer search, to 5 %."""
    return bool(max(row["cost"], EXACT) <= NEAR * max(row["final"], EXACT))


def measure_class(name: str, drags: int) -> dict[str, Any]:
    """A row of the table."""
    makers, rows = CLASSES[name], []
    for seed in range(drags):
        rows += drag(makers[seed % len(makers)](FRESH + seed // len(makers)), seed)
    held = [row for row in rows if "final" in row]
    begun, further = ([row for row in rows if (row["move"] > 0) is later] for later in (False, True))
    told = {"class": name, "drags": drags, "near": float(np.mean([near(row) for row in held])), "held": len(held)}
    told |= {"soon": float(np.mean([row["first"] <= FIRST_MS for row in rows]))}
    for which, some in (("begun", begun), ("further", further)):
        told |= {f"{which}_first": float(np.median([row["first"] for row in some]))}
        told |= {f"{which}_ms": float(np.median([row["ms"] for row in some]))}
        told |= {f"{which}_ms_most": float(np.percentile([row["ms"] for row in some], 99))}
    return told | {"state": max(row["state"] for row in rows)}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/http.md."""
    rows = [row | {"times": f"{row['further_ms']:.0f} / {row['further_ms_most']:.0f}"} for row in results["rows"]]
    return report.tables("live", {"drags": rows})


def measure(drags: Annotated[int, "of each class"] = 60) -> Iterator[dict[str, Any]]:
    """The classes in turn."""
    threadpool_limits(1, "blas")
    la.prepare()
    stamp, rows = report.stamp(), []
    for name in CLASSES:
        rows.append(measure_class(name, drags))
        print(rows[-1], flush=True)
    yield {"made": stamp, "rows": rows}


if __name__ == "__main__":
    report.run(measure)
