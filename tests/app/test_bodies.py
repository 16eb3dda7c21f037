"""Bodies are bounded before they are parsed; replies are written piece by piece, and are the same bytes."""

import asyncio

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app import bodies
from app.bodies import MAX_CONTAINERS, MAX_KEYS, MAX_VALUES, json_pieces, read_request
from app.problems import Invalid, Malformed
from app.query import Column, Numbers, Places, ReplyModel, json_of, reply_model
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings

MODEL = {query.path: query.request for query in all_queries()}
QUERIES = {query.path: query for query in all_queries()}


MALFORMED = {
    "keys": "{" + ",".join(f'"k{k}":1' for k in range(MAX_KEYS + 1)) + "}",
    "arrays": '{"position":[' + ",".join(["[]"] * (MAX_CONTAINERS + 1)) + "]}",
    "values": '{"times":[' + ",".join("1" * (MAX_VALUES + 1)) + "]}",
    "depth": '{"rotation":' + "[" * 5000 + "]" * 5000 + "}",
    "depth of objects without an end": '{"rotation":' * 10_000,
    "digits": '{"rotation":[1,2,' + "9" * 5000 + "]}",
    "very many digits": '{"rotation":[1,2,' + "9" * 100_000 + "]}",
    "key twice": '{"rotation":[1,2,3],"crank_span":70,"rotation":[1,2,4]}',
    "key twice within": '{"limits":{"family":"any","family":"full_crank"}}',
    "no JSON": "{",
}


@pytest.mark.parametrize("why", MALFORMED)
def test_what_cannot_be_read_is_malformed(why, client) -> None:
    content = MALFORMED[why]
    with pytest.raises(Malformed):
        read_request(content.encode(), MODEL["/v1/match"])
    reply = client.post("/v1/match", content=content, headers={"content-type": "application/json"})
    assert reply.status_code == 400 and reply.json()["errors"][0]["pointer"] == "#"
    assert len(reply.content) < 1000


@pytest.mark.parametrize("path", MODEL)
def test_a_body_within_the_bounds_that_is_no_request_is_refused_shortly(path) -> None:
    content = "{" + ",".join(f'"k{k}":[1]' for k in range(MAX_KEYS)) + "}"
    with pytest.raises(Invalid) as error:
        read_request(content.encode(), MODEL[path])
    assert error.value.errors and all(row["loc"] for row in error.value.errors)


def test_a_list_of_nothing_but_errors_ends_at_the_first() -> None:
    content = '{"times":[' + ",".join(['""'] * 100_000) + "]}"
    with pytest.raises(Invalid) as error:
        read_request(content.encode(), MODEL["/v1/lift/motion"])
    assert sum(row["loc"][0] == "times" for row in error.value.errors) == 1


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=8) | st.dictionaries(st.text(max_size=4), inner, max_size=5),
    max_leaves=40,
)


class Holder(ReplyModel):
    first: object
    second: object = None


@settings(max_examples=25)
@given(VALUES, st.integers(0, 3))
def test_pieces_are_what_is_written_at_once(value, depth) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bodies, "_LISTED_AT_ONCE", 3)
        model = Holder(first=value, second=[value] * 4)
        joined = b"".join(json_pieces(model, depth))
    assert joined == model.model_dump_json().encode()


@pytest.mark.parametrize("more", [-1, 0, 1])
def test_no_piece_of_a_reply_is_empty(more: int) -> None:
    """An empty one would stay in the process's connection, and be read as the answer to the next request."""
    content = {"words": "x" * (bodies.PIECE_BYTES - len('{"words":""}') + more)}
    reply = bodies.Reply(content)
    assert reply.size == bodies.PIECE_BYTES + more
    assert all(reply.pieces)


def test_a_reply_is_that_of_the_model() -> None:
    """Those of the scenes: tests/app/scenes/test_scenes.py."""
    query = QUERIES["/v1/function"]
    body = next(iter(query.examples.values()))
    answer = query.answer(query.request.model_validate(body), ServiceResources(Settings(atlas="none")))
    assert b"".join(json_pieces(answer)) == json_of(answer)
    assert query.reply is type(answer) and reply_model(query.reply).model_validate_json(json_of(answer))


def test_the_length_of_a_reply_is_said(client) -> None:
    path = "/v1/knotter/needle"
    reply = client.post(path, json=next(iter(QUERIES[path].examples.values())))
    assert reply.status_code == 200 and reply.headers["content-length"] == str(len(reply.content))


def test_others_come_between_the_pieces_of_a_reply() -> None:
    """The loss of its connection among them: once each further piece left a line in the log."""
    seen: list[str] = []

    async def send(message) -> None:
        seen.append(message["type"])

    async def story() -> None:
        asyncio.get_running_loop().call_soon(seen.append, "lost")
        await bodies.Reply(b"x" * (3 * bodies.PIECE_BYTES))({}, None, send)

    asyncio.run(story())
    assert seen.index("lost") <= 2 and len(seen) == 5


def test_of_all_large_replies_one_piece_is_sent_at_a_time() -> None:
    """Once each sent a piece between two looks at what else there was to do: a hundred that did not read held everyone up."""
    sent = 0
    most = 0

    async def send(message) -> None:
        nonlocal sent
        sent += message["type"] == "http.response.body"

    async def story() -> None:
        nonlocal most
        large = b"x" * (4 * bodies.PIECE_BYTES)
        replies = [asyncio.create_task(bodies.Reply(large)({}, None, send)) for _ in range(50)]
        while not all(map(asyncio.Task.done, replies)):
            before = sent
            await asyncio.sleep(0)
            most = max(most, sent - before)

    asyncio.run(story())
    assert sent == 200 and most <= 2


def test_a_long_reply_is_sent_in_pieces_and_given_back() -> None:
    reply = bodies.Reply(Holder(first=[1.25] * 400_000))
    sent: list[bytes] = []

    async def send(message) -> None:
        sent.append(message.get("body", b""))

    asyncio.run(reply({}, None, send))
    assert max(map(len, sent)) < 1 << 19 and sum(map(len, sent)) == reply.size
    assert not reply.pieces


@pytest.mark.parametrize("count", [0, 1, 255, 256, 257, 1000])
def test_numbers_kept_as_an_array_are_written_like_a_list(count) -> None:
    class Columns(ReplyModel):
        column: Column
        places: Places

    values = np.random.default_rng(count).normal(size=(count, 3))
    values[:1] = np.nan
    kept = Columns(column=Numbers(values[:, 0]), places=Numbers(values[:, 1:]))
    told = Columns(column=values[:, 0].tolist(), places=list(map(tuple, values[:, 1:].tolist())))
    assert b"".join(json_pieces(kept)) == b"".join(json_pieces(told)) == kept.model_dump_json().encode()
    assert kept.model_dump_json() == told.model_dump_json() and len(kept.column) == count
