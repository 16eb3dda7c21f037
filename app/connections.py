"""Connections of the service: how many there are, and how long a client may take to say what it wants.

uvicorn has no limit of idle connections and none of the time of a request's header and body, nor of the time that a client takes
to read a reply; this adds them to its protocol. It also answers a client that has closed only its own side, takes addresses in
absolute form and an empty line before a request (RFC 9112), and says as problem+json what is wrong with what is no HTTP.
"""

from __future__ import annotations

import asyncio
import resource
import sys
from collections.abc import Iterator
from itertools import chain, repeat
from typing import Any, ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from app import problems
from app.bodies import PIECE_BYTES
from app.settings import Settings

BACKLOG = 128
"""Connections that the system accepts before the service sees the first of them."""
ACCEPTED_AT_ONCE = 8
"""Of them, between two looks at what else there is to do."""
_OTHER_FILES = 96
_RECEIVED_AT_ONCE = 1 << 13
"""Bytes: in chunks of one byte each the others wait for some milliseconds while they are read."""
_AHEAD = 1 << 16
"""Bytes of further requests that are read before the first is answered."""
_PROBES = (0.01, 0.005, 0.02, 0.1)
"""Seconds before the first signs of life to a client that has closed its side: one that has gone altogether answers the first
with a reset, which the second finds."""
_PROBE_SECONDS = 0.4
"""Between all further ones."""
DOUBT_SECONDS = 0.02
"""After which one that has gone is known to have."""
_PAUSE_SECONDS = 0.1
"""Before one that speaks no HTTP is told so: some begin again at once."""


def protocol_of(settings: Settings) -> type[Connection]:
    """The protocol of a service with these settings, for uvicorn's ``http``."""
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = max(16, min(settings.max_connections, files - BACKLOG - _OTHER_FILES))
    seconds = {phase: getattr(settings, f"{phase}_seconds") for phase in ("header", "body", "reply")}
    limits = {"most": most, "seconds": seconds}
    return type("Connection", (Connection,), limits)


class Connection(H11Protocol):
    """A connection with limits."""

    most: ClassVar[int]
    seconds: ClassVar[dict[str, float]]
    drains: ClassVar[bool] = False
    """Whether the service ends because another one answers in its place: then what is being asked is answered."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=0)  # told of whatever the client has not yet taken
        transport.max_size = _RECEIVED_AT_ONCE  # type: ignore[attr-defined]
        self._unread: asyncio.TimerHandle | None = None
        self._left = self.seconds["reply"]
        self._phase: str | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._since = self.loop.time()
        if len(self.connections) > self.most:
            self._make_room()
        self._expect("header")

    def connection_lost(self, exc: Exception | None) -> None:
        self._expect(None)
        self._read()
        super().connection_lost(exc)
        if self._answers:
            self.scope["state"].get("leave", bool)()

    @property
    def _answers(self) -> bool:
        """Whether a request is being received or answered."""
        return self.cycle is not None and not self.cycle.response_complete

    @property
    def _computes(self) -> bool:
        """Whether its client waits for an answer that is being computed, or for its turn."""
        return self._answers and not self.cycle.response_started and self.scope["method"] == "POST"

    def _make_room(self) -> None:
        """Close the oldest connection that no answer is being computed for; this one where there is none."""
        there: list[Any] = [one for one in self.connections if not one.transport.is_closing()]
        if len(there) > self.most:
            free = [one for one in there if one is not self and (one._phase or not one._computes)]
            (min(free, key=lambda one: (one._phase == "body", one._since)) if free else self).transport.abort()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._read()
        if self._phase is None:
            self._since = self.loop.time()
        self._left += self.seconds["reply"] * PIECE_BYTES / 1_000_000
        self._unread = self.loop.call_later(self._left, self.transport.abort)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._read()

    def _read(self) -> None:
        """The client has taken all that was sent."""
        if self._unread is not None:
            self._left = self._unread.when() - self.loop.time()
            self._unread.cancel()
            self._unread = None

    def data_received(self, data: bytes) -> None:
        if self.conn.their_state is h11.MUST_CLOSE:
            return  # it has said that nothing more comes
        super().data_received(data)
        if self.drains and self.cycle is not None:
            self.cycle.keep_alive = False
        if self._answers and self.cycle.more_body:
            self._expect("body")
        elif self._answers:
            self._expect(None)
            if len(self.conn.trailing_data[0]) <= _AHEAD:
                self.flow.resume_reading()  # uvicorn stops where something follows, and would not see the client leave
            else:
                self._doubt()
        elif self.timeout_keep_alive_task is None:
            self._expect("header")

    def _get_upgrade(self) -> None:
        """Other protocols are not spoken; uvicorn would say so in the log each time."""

    def handle_events(self) -> None:
        """Leave out empty lines before a request."""
        if self.conn.their_state is h11.IDLE:
            said, _ = self.conn.trailing_data
            self.conn._receive_buffer.maybe_extract_at_most(len(said) - len(said.lstrip(b"\r\n")))
        super().handle_events()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._left = self.seconds["reply"]
        if not self._answers:
            self._expect(None)  # uvicorn's own limit between two requests
        self._since = self.loop.time()

    def _expect(self, phase: str | None) -> None:
        """Give the client its time for a part of a request."""
        if phase == self._phase:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._phase, self._since = phase, self.loop.time()
        self._timer = self.loop.call_later(self.seconds[phase], self._too_slow) if phase else None

    def _too_slow(self) -> None:
        if self._phase == "header" and not self.conn.trailing_data[0]:
            self.transport.close()  # it has said nothing at all
        else:
            self._refuse(
                408, f"the {self._phase} of the request did not come in {self.seconds[self._phase or '']:g} s"
            )

    def send_400_response(self, msg: str) -> None:
        self.flow.pause_reading()
        refused = (400, "this is no request of HTTP/1.1")
        if getattr(sys.exception(), "error_status_hint", 400) == 431:
            refused = (431, "the header of the request is too long")
        self.loop.call_later(_PAUSE_SECONDS, self._refuse, *refused)

    def _refuse(self, status: int, detail: str) -> None:
        if self.transport.is_closing():
            return
        if not (self.cycle is not None and self.cycle.response_started and not self.cycle.response_complete):
            self.transport.write(problems.raw(status, detail))
        self.transport.close()

    def shutdown(self) -> None:
        """End at once where a request is not complete, unless the service `drains`."""
        if not self._phase:
            super().shutdown()
        elif not self.drains:
            self.transport.abort()
        elif self.cycle is not None:
            self.cycle.keep_alive = False

    def eof_received(self) -> Any:
        """Keep the connection of a client that has sent its request and waits for the answer."""
        if not self._answers or self.cycle.more_body or self.scope["http_version"] == "1.0":
            return None  # HTTP/1.0 knows no sign of life
        self.cycle.keep_alive = False
        self.scope["state"]["half_closed"] = True
        self._doubt()
        return True

    def _doubt(self) -> None:
        """From now on ask by signs of life whether the client is there."""
        seconds = chain(_PROBES, repeat(_PROBE_SECONDS))
        self.loop.call_later(next(seconds), self._probe, seconds)

    def _probe(self, seconds: Iterator[float]) -> None:
        """A sign of life, which a client ignores that is there; without it no one learns that it has gone."""
        if self._answers and not self.transport.is_closing():
            if not self.cycle.response_started:
                self.transport.write(self.conn.send(h11.InformationalResponse(status_code=100, headers=[])) or b"")
            self.loop.call_later(next(seconds), self._probe, seconds)
