"""Requests of a live client: what an answer leaves goes to the next, for a while, and one client does not take everything."""

import asyncio
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app import live
from app.live import Lives
from app.main import create_app
from app.problems import Superseded
from app.settings import Settings

TURN = np.linspace(0, 2 * np.pi, 12, endpoint=False)
PATH = np.column_stack([60 * np.cos(TURN), 30 * np.sin(TURN)]) + np.random.default_rng(3).normal(size=(12, 2))
QUESTION = {"position": PATH.tolist(), "timing": "free", "closed": True, "top": 2}


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with TestClient(create_app(Settings(with_atlas=False))) as client:
        yield client


def ask(client: TestClient, **more: Any) -> tuple[bool, float]:
    reply = client.post("/v1/synthesize", json=QUESTION | more)
    assert reply.status_code == 200, reply.text
    told = reply.json()
    return told["report"]["live"]["continued"], told["solutions"][0]["errors"]["objective"]


def test_an_answer_goes_on_from_the_last_under_its_id(client) -> None:
    begun = [ask(client, live="one client") for _ in range(3)]
    assert [continued for continued, _ in begun] == [False, True, True]
    assert begun[2][1] <= begun[1][1] * (1 + 1e-9) and begun[1][1] <= begun[0][1] * (1 + 1e-9)
    assert ask(client, live="one client", budget_ms=1)[1] <= begun[2][1] * (1 + 1e-9)
    assert ask(client, live="another client")[0] is False
    assert client.post("/v1/synthesize", json=QUESTION | {"budget_ms": 50}).json()["report"]["live"] is None


def test_a_refused_request_leaves_what_there_was(client) -> None:
    ask(client, live="refused once")
    wrong = client.post("/v1/synthesize", json=QUESTION | {"live": "refused once", "tolerances": {"rotation": 1}})
    assert wrong.status_code == 422
    assert ask(client, live="refused once")[0] is True


def test_of_a_client_that_asks_much_only_the_newest_request_is_computed(client) -> None:
    ask(client, live="a busy client")
    asked = QUESTION | {"live": "a busy client"}
    with ThreadPoolExecutor(6) as many:
        replies = list(many.map(lambda k: client.post("/v1/synthesize", json=asked), range(6)))
    codes = sorted(reply.status_code for reply in replies)
    assert set(codes) == {200, 503} and codes.count(503) >= 3
    assert all("newer request" in reply.json()["detail"] for reply in replies if reply.status_code == 503)


# -- what is kept -----------------------------------------------------------------------------------------------------


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


async def answered(
    lives: Lives, name: str | None, state: bytes, clock: Clock | None = None, took: float = 0.0
) -> bytes:
    """The state that a request finds; it leaves another."""
    async with lives.turn(name) as kept:
        before, kept.state = kept.state, state
        if clock:
            clock.now += took
    return before


def test_a_state_is_kept_for_a_minute() -> None:
    async def run() -> None:
        clock = Clock()
        lives = Lives(clock)
        assert await answered(lives, "an id", b"one") == b""
        clock.now += 59.9
        assert await answered(lives, "an id", b"two") == b"one", "a minute from the last answer"
        clock.now += 59.9
        assert len(lives) == 1
        clock.now += 0.2
        assert len(lives) == 0 and await answered(lives, "an id", b"") == b""

    asyncio.run(run())


def test_a_state_goes_by_itself(monkeypatch) -> None:
    async def run() -> None:
        lives = Lives()
        await answered(lives, "an id", b"one")
        assert len(lives._kept) == 1
        await asyncio.sleep(0.1)
        assert not lives._kept, "though nobody has asked"

    monkeypatch.setattr(live, "SECONDS", 0.03)
    asyncio.run(run())


def test_so_many_ids_and_bytes_are_kept_at_most() -> None:
    async def run() -> None:
        lives = Lives(Clock())
        for k in range(live.MOST):
            await answered(lives, f"id {k}", b"state")
        assert await answered(lives, "id 0", b"state") == b"state"
        await answered(lives, "one more", b"state")
        assert len(lives) == live.MOST
        assert await answered(lives, "id 0", b"state") == b"state", "the one unused for longest has gone"
        assert await answered(lives, "id 1", b"x" * (live.MOST_BYTES + 1)) == b""
        assert await answered(lives, "id 1", b"") == b"", "too large to be kept"
        assert await answered(lives, None, b"state") == b"" == await answered(lives, None, b"")

    asyncio.run(run())


def test_an_older_request_that_waits_is_given_up() -> None:
    async def run() -> None:
        lives, order = Lives(), []

        async def request(k: int) -> None:
            async with lives.turn("an id") as kept:
                order.append(k)
                await asyncio.sleep(0.05)
                kept.state = str(k).encode()

        first = asyncio.create_task(request(0))
        while not order:
            await asyncio.sleep(0)
        ended = await asyncio.gather(*map(request, range(1, 5)), return_exceptions=True)
        await first
        assert order == [0, 4] and [type(one) for one in ended[:3]] == 3 * [Superseded]
        # one that has its place in the queue, but is not yet computed, is given up too
        async with lives.turn("an id") as kept:
            newer = asyncio.create_task(request(6))
            await asyncio.sleep(0)
            with pytest.raises(Superseded):
                kept.begin()
        await newer
        assert order == [0, 4, 6]

    asyncio.run(run())


def test_between_two_answers_as_much_time_passes_as_the_first_took(monkeypatch) -> None:
    async def run() -> None:
        lives = Lives(clock)
        for _ in range(3):
            await answered(lives, "an id", b"", clock, took=0.06)
        assert slept == pytest.approx([0.0, 0.06, 0.06])

    clock, slept = Clock(), []

    async def sleep(seconds: float) -> None:
        slept.append(seconds)
        clock.now += seconds

    monkeypatch.setattr(live.asyncio, "sleep", sleep)

    asyncio.run(run())
