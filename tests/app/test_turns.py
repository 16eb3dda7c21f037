"""Turns of the requests that compute, and what a client leaves behind that goes away: nothing."""

import asyncio
import http.client
import json
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from app.main import create_app
from app.problems import Ending, Overloaded
from app.registry import all_queries, worked_example
from app.resources import ServiceResources
from app.settings import Settings
from app.turns import Place, Turns
from tests.conftest import PATIENCE, listening, until
from tests.oracles.largest import requests

SOON = 15.0
"""Seconds in which a step of a search is over, also on a busy machine; a search that goes on takes twice as many."""
EXAMPLE = worked_example()
_RANDOM = np.random.default_rng(7)
NOISE = {
    "rotation": (0.3 * _RANDOM.normal(size=64).cumsum()).tolist(),
    "position": _RANDOM.normal(size=(64, 2)).tolist(),
    "crank_span": 300,
    "limits": {"family": "any", "transmission_angle_min": 40, "pivot_box": [-1, -1, 1, 1]},
}
"""Out of reach of every linkage, within limits: the longest search there is."""
CYLINDERS = [{"length": 200 + k, "speed": 100} for k in range(24)]
STROKE = {"stroke": [200, 510], "objective": {"kind": "discrete", "n": 500}}


class Slow(ServiceResources):
    """A clock whose readings take their time: the search in noise takes all of its 30 s on every machine."""

    def work(self, budget: float | None = None, cancelled: Callable[[], bool] | None = None) -> la.Work:
        def clock() -> float:
            time.sleep(0.05)
            return time.perf_counter()

        return la.Work(budget, cancelled, clock)


class Service:
    """A real server in this process, with one place to compute and one to wait."""

    def __init__(self, port: int, turns: Turns) -> None:
        self.port, self._turns = port, turns

    @property
    def computing(self) -> int:
        return self._turns.computing

    @property
    def waiting(self) -> int:
        return self._turns.waiting

    def post(
        self, path: str, body: dict[str, Any], connection: http.client.HTTPConnection | None = None
    ) -> http.client.HTTPConnection:
        """The connection, a new one unless given, over which the request has been sent."""
        connection = connection or http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("POST", path, json.dumps(body), {"content-type": "application/json"})
        return connection


@pytest.fixture(scope="module")
def resources(tmp_path_factory) -> ServiceResources:
    return Slow(Settings(atlas=tmp_path_factory.mktemp("turns") / "none", max_concurrent=1, max_waiting=1))


@pytest.fixture(scope="module")
def service(resources) -> Iterator[Service]:
    app = create_app(resources=resources)
    with listening(app) as (port, _):
        yield Service(port, app.state.turns)


LONG = {"synthesize": NOISE, "synthesize.svg": NOISE, "export": {"request": NOISE}}
LONG["lift/batch"] = {"cylinders": CYLINDERS, **STROKE}


@pytest.mark.parametrize("path", LONG)
def test_work_ends_soon_after_its_client_has_gone(path, service, caplog) -> None:
    connection = service.post(f"/v1/{path}", LONG[path])
    until(lambda: service.computing == 1)
    time.sleep(0.3)  # into the search
    assert service.computing == 1
    connection.close()
    begin = time.monotonic()
    until(lambda: service.computing == 0)
    assert time.monotonic() - begin < SOON
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


def test_nothing_is_computed_for_a_client_that_went_while_it_waited(service, monkeypatch) -> None:
    searched = []

    def recording(*arguments, top, **others):
        searched.append(top)
        return synthesize(*arguments, top=top, **others)

    synthesize = la.synthesize
    monkeypatch.setattr(la, "synthesize", recording)
    computing = service.post("/v1/synthesize", {**NOISE, "top": 11})
    until(lambda: searched == [11])
    impatient = service.post("/v1/synthesize", {**NOISE, "top": 12})
    until(lambda: service.waiting == 1)
    with closing(service.post("/v1/synthesize", EXAMPLE)) as refused:
        assert refused.getresponse().status == 503
    impatient.close()
    until(lambda: service.waiting == 0)
    assert service.computing == 1
    with closing(service.post("/v1/synthesize", {**EXAMPLE, "top": 1})) as patient:
        until(lambda: service.waiting == 1)
        assert service.computing == 1, "the first still computes"
        computing.close()
        assert patient.getresponse().status == 200
    assert searched == [11, 1]


def test_a_client_that_stays_is_answered_again_and_again(service) -> None:
    """The end of one request on a connection is not taken for the client's leaving."""
    body = {**EXAMPLE, "top": 1}
    with closing(service.post("/v1/synthesize", body)) as connection:
        first = connection.getresponse()
        assert first.status == 200 and json.load(first)["status"] == "reached"
        again = service.post("/v1/synthesize", body, connection).getresponse()
        assert again.status == 200 and json.load(again)["status"] == "reached"


@pytest.fixture(scope="module")
def prepared(small_bytes, tmp_path_factory) -> ServiceResources:
    """A small atlas with all that is made of it."""
    path = tmp_path_factory.mktemp("prepared") / "small.h5"
    path.write_bytes(small_bytes)
    resources = ServiceResources(Settings(atlas=path))
    resources.load()
    resources.prepare_rest()
    return resources


class Abandoned(ServiceResources):
    """A client that is asked for twice, then it has gone."""

    left = 2

    def work(self, budget: float | None = None, cancelled: Callable[[], bool] | None = None) -> la.Work:
        return la.Work(budget, self.gone)

    def gone(self) -> bool:
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/v1/match", {"rotation": NOISE["rotation"], "crank_span": 300, "top": 1000}),
        ("/v1/synthesize", {**NOISE, "effort": "atlas"}),
        ("/v1/synthesize", NOISE),
        ("/v1/synthesize", {**NOISE, "limits": {}}),
        ("/v1/lift/optimize", {"cylinder": CYLINDERS[0], **STROKE}),
        ("/v1/lift/batch", {"cylinders": CYLINDERS, **STROKE}),
        ("/v1/lift/batch", {"cylinders": CYLINDERS, **STROKE, "upper_bound": 20}),
        ("/v1/synthesize", {**NOISE, "crank_span": None, "timing": "free", "mechanisms": "all"}),
        ("/v1/synthesize", {**NOISE, "crank_span": None, "travel_span": 9, "mechanisms": "all"}),
        ("/v1/drives", requests()["drives: four times two of 200 springs"].body),
        ("/v1/assembly", requests()["assembly: a star between thin links"].body),
        ("/v1/function", {"output": NOISE["rotation"], "crank_span": 60, "output_unit": "length"}),
    ],
)
def test_long_work_asks_the_clock_throughout(path, body, prepared, monkeypatch) -> None:
    query = next(query for query in all_queries() if query.path == path)
    monkeypatch.setattr(prepared, "__class__", Abandoned)
    monkeypatch.setattr(prepared, "left", Abandoned.left)
    with pytest.raises(la.Cancelled):
        query.answer(query.request(**body), prepared)
    assert prepared.left == -1


class Patient:
    def __init__(self, host: str = "") -> None:
        self.client = SimpleNamespace(host=host)

    async def receive(self) -> dict[str, str]:
        await asyncio.Event().wait()
        return {}


def turns_of(places: int, waiting: int) -> Turns:
    """One of whose places, if there are two, none is given to a long request."""
    turns = Turns(waiting)
    turns.add(*(Place(quick=k == 0 and places > 1) for k in range(places)))
    return turns


async def steps(length: int) -> None:
    """So many turns of the loop."""
    for _ in range(length):
        await asyncio.sleep(0)


def outcome(turns: Turns, story: Any) -> Any:
    """What a story tells, whose requests compute for so many steps and return as the how manyth they end."""
    ended = count()

    async def tell() -> Any:
        def ask(length: int, long: bool, host: str = "") -> asyncio.Task[Any]:
            async def work(place: Place, queued: float, cancelled: Any) -> int:
                await steps(length)
                return next(ended)

            return asyncio.create_task(turns.turn(Patient(host), work, long))

        return await story(ask)

    return asyncio.run(tell())


@pytest.mark.parametrize("places", [2, 3, 5])
def test_short_requests_do_not_wait_for_long_ones(places) -> None:
    async def story(ask):
        long = [ask(4000, True) for _ in range(places)]  # one to each place, if they were let
        await steps(50)
        short = [ask(10, False) for _ in range(10)]
        last_short, first_long = max(await asyncio.gather(*short)), min(await asyncio.gather(*long))
        return first_long - last_short

    assert outcome(turns_of(places, 64), story) > 0


def test_long_requests_do_not_wait_for_ever() -> None:
    async def story(ask):
        short = [ask(20, False) for _ in range(40)]
        long = [ask(20, True) for _ in range(3)]
        return max(await asyncio.gather(*long)) < max(await asyncio.gather(*short))

    for places in (1, 2, 3):
        assert outcome(turns_of(places, 64), story)


@pytest.mark.parametrize("long", [False, True])
def test_who_asks_for_much_waits_for_himself(long) -> None:
    """One address that asked sixty times at once held the turns of all, and all the room to wait."""

    async def story(ask):
        much = [ask(100, long, "greedy") for _ in range(60)]
        await steps(5)
        few = [ask(100, long, f"modest {number}") for number in range(4)]
        few = await asyncio.gather(*few)
        return few, await asyncio.gather(*much, return_exceptions=True)

    few, much = outcome(turns_of(2, 16), story)
    served = [one for one in much if isinstance(one, int)]
    assert sum(one < max(few) for one in served) <= 8
    assert sum(isinstance(one, Overloaded) for one in much) == 60 - len(served) and 4 <= len(served) <= 18


def test_long_requests_leave_room_to_wait() -> None:
    async def story(ask):
        long = [ask(1000, True) for _ in range(100)]
        await steps(50)
        short = [ask(1, False) for _ in range(5)]
        return await asyncio.gather(*long, return_exceptions=True), await asyncio.gather(*short)

    long, short = outcome(turns_of(2, 16), story)
    assert sum(isinstance(one, Overloaded) for one in long) == 100 - 1 - 8 and len(short) == 5


def test_the_end_of_the_service_ends_its_work() -> None:
    turns = turns_of(2, 4)

    async def story() -> Any:
        begun = asyncio.Event()

        async def work(place: Place, queued: float, cancelled: Any) -> None:
            watch = la.Work(cancelled=cancelled)
            while not watch.expired():
                begun.set()
                await steps(1)

        task = asyncio.create_task(turns.turn(Patient(), work))
        await begun.wait()
        turns.stopping.set()
        return await asyncio.gather(task, return_exceptions=True)

    assert isinstance(asyncio.run(story())[0], Ending)


def test_the_time_in_the_queue_is_said(client) -> None:
    timing = client.post("/v1/knotter/needle", json={}).headers["server-timing"]
    assert timing.startswith("queue;dur=") and ", answer;dur=" in timing


def test_of_many_that_come_at_once_no_more_than_may_wait_are_let_in() -> None:
    async def story(ask):
        first = await asyncio.gather(*(ask(50, False) for _ in range(50)), return_exceptions=True)
        return [*first, await ask(0, False)]

    *first, later = outcome(turns_of(2, 4), story)
    assert sum(isinstance(one, int) for one in first) == 6
    assert sum(isinstance(one, Overloaded) for one in first) == 44
    assert isinstance(later, int), "places are given back"
