"""Bodies to requests and replies to bytes, in steps so short that the service answers others meanwhile.

Parsing and writing JSON hold the interpreter, on whatever thread they run. So a body is counted before it is parsed, and a
reply is written piece by piece.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import to_json
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from app import problems
from app.query import Invalid, Numbers, RequestModel, invalid
from app.resources import give_back_memory
from linkage_atlas.records import names_of, plain

MAX_KEYS = 2_000
"""Keys of a body: the largest request has a few hundred."""
MAX_CONTAINERS = 12_000
"""Objects and arrays of a body: a thousand rows in each table of a knotter."""
MAX_VALUES = 120_000
"""Values of a body: the times of a lift's motion are at most 100,000."""
_LISTED_AT_ONCE = 256
PIECE_BYTES = 1 << 16
"""Bytes of a reply that are sent, and passed between processes, at once."""
GIVEN_BACK = 1 << 22
"""Bytes of replies after which the system is given back what they took, once their clients have all of them."""
_DEPTH = 2
"""Levels of a reply whose fields are written one by one."""


def read_request(content: bytes, model: type[RequestModel]) -> RequestModel:
    """The request in a body.

    Raises
    ------
    problems.Malformed
        No JSON, or an object with a key twice.
    Invalid
        JSON that is no such request.
    """
    check_counts(content)
    try:
        values = json.loads(content, object_pairs_hook=_once)
    except (ValueError, RecursionError):
        raise problems.Malformed("the body is not valid JSON", "not valid JSON") from None
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise invalid(error, model) from None


def check_counts(content: bytes) -> None:
    """Refuse a body that is none or holds too much, before it is parsed; raises as `read_request` does."""
    if not content:
        raise Invalid([{"loc": (), "msg": "the body is empty"}])
    counts = {
        "keys": (content.count(b":"), MAX_KEYS),
        "objects and arrays": (content.count(b"{") + content.count(b"["), MAX_CONTAINERS),
        "values": (content.count(b",") + 1, MAX_VALUES),
    }
    for name, (found, most) in counts.items():
        if found > most:
            raise problems.Malformed(f"the body has more than {most:,} {name}")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose keys are all different: of two alike one would be lost unnoticed."""
    values = dict(pairs)
    if len(values) < len(pairs):
        raise problems.Malformed("an object of the body has a key twice")
    return values


def json_pieces(value: Any, depth: int = _DEPTH, of_record: bool = False) -> Iterator[bytes]:
    """The JSON of a reply in pieces; together they are what is written at once."""
    if isinstance(value, BaseModel):
        value = value.__dict__
    elif names := names_of(type(value)):
        value, of_record = {name: getattr(value, name) for name in names}, True
    if isinstance(value, dict) and depth:
        mark = b"{"
        for name, part in value.items():
            yield mark + to_json(name) + b":"
            yield from json_pieces(part, depth - 1, of_record)
            mark = b","
        yield b"}" if value else b"{}"
    elif isinstance(value, Numbers) or (isinstance(value, (list, tuple)) and len(value) > _LISTED_AT_ONCE):
        mark = b"["
        for first in range(0, len(value), _LISTED_AT_ONCE):
            some = value[first : first + _LISTED_AT_ONCE]
            yield mark + to_json(plain(some) if of_record else some, inf_nan_mode="strings")[1:-1]
            mark = b","
        yield b"]" if value else b"[]"
    else:
        yield to_json(plain(value) if of_record else value, inf_nan_mode="strings")


def _gathered(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """The same bytes in pieces of about the size that is sent at once."""
    held, size = [], 0
    for piece in pieces:
        held.append(piece)
        size += len(piece)
        if size >= PIECE_BYTES:
            yield b"".join(held)
            held, size = [], 0
    if held:
        yield b"".join(held)


class Held:
    """Bytes of a reply that its client has not yet taken; ``Held.total`` is of all replies of this process.

    Raises `problems.Unread` where they would be more than ``Held.most``; a short reply, or one alone, is always sent.
    """

    total = most_since = 0
    most = 64_000_000

    def __init__(self, size: int) -> None:
        self._left = 0
        if size > PIECE_BYTES and 0 < Held.total > Held.most - size:
            raise problems.Unread
        self.take(-size)

    def take(self, size: int) -> None:
        """So many bytes are sent, of which at most what is left was held."""
        size = min(size, self._left)
        self._left -= size
        Held.total -= size
        Held.most_since = max(Held.most_since, Held.total)

    def __del__(self) -> None:
        self.take(self._left)
        if Held.most_since > GIVEN_BACK and not Held.total:
            Held.most_since = 0
            give_back_memory()


class Reply(Response):
    """A reply that is sent piece by piece, as fast as its client takes it; what has been sent is given back.

    Parameters
    ----------
    content : model or bytes
    media_type : str
    headers : dict, optional
    held : Held, optional
        What is held of it from now on; default: all of it, once it is sent.
    """

    turn = asyncio.Lock()
    """Of the service: one piece of all its large replies is sent between two looks at what else there is to do."""

    def __init__(
        self,
        content: Any,
        media_type: str = "application/json",
        headers: dict[str, str] | None = None,
        held: Held | None = None,
    ) -> None:
        if isinstance(content, bytes):
            whole = memoryview(content)
            pieces = [whole[k : k + PIECE_BYTES] for k in range(0, len(content), PIECE_BYTES)]
        else:
            pieces = list(_gathered(json_pieces(content)))
        self.pieces, self.size = pieces, sum(map(len, pieces))
        self._held = held
        super().__init__(None, media_type=media_type, headers={**(headers or {}), "Content-Length": str(self.size)})

    @classmethod
    def relayed(cls, status: int, headers: list[tuple[bytes, bytes]], pieces: list[bytes], held: Held) -> Reply:
        """A reply that another process has written, its bytes held already."""
        reply = cls.__new__(cls)
        reply.pieces, reply.size, reply._held = pieces, sum(map(len, pieces)), held
        reply.status_code, reply.raw_headers, reply.background = status, headers, None
        return reply

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        held = self._held or Held(self.size)
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        self.pieces.reverse()
        while self.pieces:
            piece = self.pieces.pop()
            if self.size > PIECE_BYTES:
                async with Reply.turn:
                    await asyncio.sleep(0)
            await send({"type": "http.response.body", "body": piece, "more_body": bool(self.pieces)})
            held.take(len(piece))
        if not self.size:
            await send({"type": "http.response.body", "body": b"", "more_body": False})
