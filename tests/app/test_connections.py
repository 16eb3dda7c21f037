"""Clients that are slow, many, half gone or rude, against a real server; and turns of short and long requests."""

import asyncio
import json
import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
import uvicorn
from starlette.routing import Route

from app import bodies, computed, connections
from app.computed import LargeBodies, Threads
from app.connections import protocol_of
from app.main import create_app
from app.problems import SlowBody
from app.resources import ServiceResources
from app.settings import Settings
from tests.conftest import PATIENCE, listening, until

NEEDLE = b"POST /v1/knotter/needle HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\n"
NEEDLE += b"Content-Length: 2\r\n\r\n{}"
LIVEZ = b"GET /livez HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n"


@contextmanager
def serving(app: Any = None, ending: int = 1, **settings: Any) -> Iterator[tuple[int, uvicorn.Server]]:
    """The service; at its end clients have that many seconds."""
    chosen = Settings(atlas="none", **settings)
    options = {"http": protocol_of(chosen), "timeout_graceful_shutdown": ending, "ws": "none"}
    with listening(app or create_app(chosen), **options) as found:
        yield found


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with serving(header_seconds=0.5, body_seconds=0.8, max_connections=20) as (port, _):
        yield port


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), PATIENCE)


def everything(client: socket.socket) -> bytes:
    """What comes until the connection is closed."""
    received = bytearray()
    try:
        while part := client.recv(1 << 16):
            received += part
    except ConnectionResetError:
        pass
    return bytes(received)


def said(reply: bytes) -> tuple[int, dict[str, Any]]:
    """Status and problem of a reply."""
    head, _, body = reply.partition(b"\r\n\r\n")
    assert b"application/problem+json" in head
    return int(head.split()[1]), json.loads(body)


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (b"GET /livez HT", 408),
        (NEEDLE[:-1], 408),
        (NEEDLE[:-1].replace(b"Length: 2", b"Length: 900000"), 408),
        (b"\x16\x03\x01 no HTTP\r\n\r\n", 400),
        (b"GET /livez HTTP/1.1\r\nHost: a\r\nContent-Length: x\r\n\r\n", 400),
        (NEEDLE.replace(b"Content-Length: 2", b"Content-Length: 2\r\nTransfer-Encoding: chunked"), 400),
    ],
    ids=["header", "body", "large body", "no HTTP", "length", "two lengths"],
)
def test_what_does_not_come_or_is_no_request_is_told_and_closed(sent, status, port) -> None:
    with closing(connected(port)) as client:
        client.sendall(sent)
        found, problem = said(everything(client))
        assert found == problem["status"] == status


def test_one_who_speaks_no_http_again_and_again_is_slowed_down(port) -> None:
    """Two that began again at once took a third of the time of the process that talks to the clients."""
    count, end = 0, time.monotonic() + 0.5
    while time.monotonic() < end:
        with closing(connected(port)) as client:
            client.sendall(b"hello\r\n\r\n")
            client.sendall(b"hello\r\n\r\n")
            assert said(everything(client))[0] == 400
        count += 1
    assert count <= 6


def test_one_who_says_nothing_is_closed_without_a_word(port) -> None:
    with closing(connected(port)) as client:
        assert everything(client) == b""


def test_between_two_requests_there_is_time(port) -> None:
    with closing(connected(port)) as client:
        for pause in (0.0, 0.7):  # more than a header's time
            time.sleep(pause)
            client.sendall(NEEDLE)
            received = client.recv(1 << 16)
            assert received.startswith(b"HTTP/1.1 200")
            while not received.endswith(b"}"):  # head and body may come apart
                received += client.recv(1 << 16)


@pytest.mark.parametrize("request_bytes", [NEEDLE, LIVEZ], ids=["needle", "livez"])
def test_a_client_that_has_closed_its_own_side_is_answered(request_bytes, port) -> None:
    with closing(connected(port)) as client:
        client.sendall(request_bytes)
        client.shutdown(socket.SHUT_WR)
        assert b"HTTP/1.1 200" in everything(client)


def test_a_client_of_http_1_0_is_told_nothing_but_the_answer(port) -> None:
    """RFC 9110, 15.2: it knows no replies that come before it."""
    scan = NEEDLE.replace(b"needle", b"scan").replace(b"HTTP/1.1", b"HTTP/1.0")
    for half_closed in (False, True):
        with closing(connected(port)) as client:
            client.sendall(scan)
            if half_closed:
                client.shutdown(socket.SHUT_WR)
            assert everything(client)[:12] == (b"" if half_closed else b"HTTP/1.1 200")


@pytest.mark.parametrize("form", ["chunks", "header"])
def test_little_is_received_at_once(form, port, monkeypatch) -> None:
    """400 kB in chunks of one byte held up everyone for seconds."""
    sizes, plain = [], connections.Connection.data_received

    def received(self, data: bytes) -> None:
        sizes.append(len(data))
        plain(self, data)

    monkeypatch.setattr(connections.Connection, "data_received", received)
    with closing(connected(port)) as client:
        if form == "chunks":
            body = b"".join(b"1\r\n%c\r\n" % one for one in b"{}".ljust(20_000))
            head = NEEDLE[:-2].replace(b"Content-Length: 2", b"Transfer-Encoding: chunked")
            client.sendall(head + body + b"0\r\n\r\n")
            assert client.recv(12) == b"HTTP/1.1 200"
        else:
            client.sendall(LIVEZ[:-2] + b"a:\r\n" * 20_000)
            assert said(everything(client))[0] == 431
    assert max(sizes) <= 8192


def test_a_half_closed_client_of_a_long_request_is_answered(monkeypatch, port) -> None:
    monkeypatch.setattr(connections, "_PROBE_SECONDS", 0.05)
    from app.scenes import knotter

    plain, probed = knotter.answer_needle, threading.Event()
    query = next(query for query in knotter.QUERIES if query.path.endswith("needle"))
    slow = lambda *arguments: probed.wait(PATIENCE) and plain(*arguments)  # noqa: E731
    object.__setattr__(query, "answer", slow)
    try:
        with closing(connected(port)) as client:
            client.sendall(NEEDLE)
            client.shutdown(socket.SHUT_WR)
            received = b""
            while received.count(b"HTTP/1.1 100") < 2:
                received += (part := client.recv(1 << 16))
                assert part
            probed.set()
            assert b"HTTP/1.1 200" in received + everything(client)
    finally:
        probed.set()
        object.__setattr__(query, "answer", plain)


def test_idle_connections_make_room(port) -> None:
    with ExitStack() as stack:
        idle = [stack.enter_context(closing(connected(port))) for _ in range(60)]
        for client in idle[:10]:
            client.sendall(NEEDLE[:-1])
        with closing(connected(port)) as client:
            client.sendall(LIVEZ)
            assert everything(client).startswith(b"HTTP/1.1 200")


def test_of_connections_that_come_at_once_as_many_are_closed_as_are_too_many() -> None:
    """Each closed the same one, and there were soon more than files: for a second nobody was let in."""
    with serving(max_connections=20, header_seconds=1000.0) as (port, server), ExitStack() as stack:
        there = server.server_state.connections
        for _ in range(60):
            stack.enter_context(closing(connected(port)))
        with closing(connected(port)) as client:
            client.sendall(LIVEZ)
            assert everything(client).startswith(b"HTTP/1.1 200"), "after all of them"
        until(lambda: 0 < len(there) <= 20)


def test_no_more_connections_than_files() -> None:
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    assert protocol_of(Settings(max_connections=10**9)).most < files
    assert protocol_of(Settings(max_connections=100)).most == 100


def test_an_unfinished_body_holds_no_one_up_at_the_end() -> None:
    with serving(ending=1000, body_seconds=1000.0) as (port, server), closing(connected(port)) as client:
        client.sendall(NEEDLE[:-1])
        until(lambda: server.server_state.tasks)
        server.should_exit = True
        everything(client)  # the client's patience is less than the service's


@pytest.mark.parametrize("sent", [b"", NEEDLE[:30], NEEDLE[:-1]], ids=["nothing yet", "in its header", "in its body"])
def test_who_has_begun_to_ask_is_answered_where_another_service_takes_over(sent) -> None:
    with serving(ending=1000) as (port, server), closing(connected(port)) as client:
        until(lambda: server.server_state.connections)
        client.sendall(sent)
        there = server.server_state.connections
        until(lambda: [one for one in there if one.cycle or one.conn.trailing_data[0] == sent])
        server.config.http.drains = True
        server.should_exit = True
        until(lambda: not server.servers[0].is_serving())
        client.sendall(NEEDLE[len(sent) :])
        assert everything(client).startswith(b"HTTP/1.1 200")


def test_who_asks_for_another_protocol_is_answered_in_this_one(port, caplog) -> None:
    with closing(connected(port)) as client:
        client.sendall(LIVEZ.replace(b"Connection: close", b"Connection: close, Upgrade\r\nUpgrade: h2c"))
        assert everything(client).startswith(b"HTTP/1.1 200")
    assert not [one for one in caplog.records if one.levelname == "WARNING"]


def test_an_address_in_absolute_form_is_taken(port) -> None:
    with closing(connected(port)) as client:
        client.sendall(LIVEZ.replace(b"/livez", b"http://a/livez"))
        assert everything(client).startswith(b"HTTP/1.1 200")


LAST = NEEDLE.replace(b"Host: a", b"Host: a\r\nConnection: close")
BEFORE = [[b"\r\n" + LIVEZ], [b"\r\n", LIVEZ], [b"\r", b"\n", LIVEZ]]
BETWEEN = [[NEEDLE + b"\r\n" + LIVEZ], [NEEDLE, b"\r\n", LIVEZ]]


@pytest.mark.parametrize(
    ("parts", "answers"), [*((p, 1) for p in [*BEFORE, [LAST, b"\r\n"]]), *((p, 2) for p in BETWEEN)]
)
def test_empty_lines_around_a_request_are_left_out(parts, answers, port) -> None:
    """RFC 9112, 2.2. A packet with nothing but an empty line once held up the service for ever."""
    with closing(connected(port)) as client:
        for part in parts:
            client.sendall(part)
            time.sleep(0.02)
        received = everything(client)
    assert received.count(b"HTTP/1.1 ") == received.count(b"HTTP/1.1 200") == answers


def test_empty_lines_of_a_body_that_nobody_reads_count_as_its_bytes(port) -> None:
    """What follows would be taken for the rest of it: behind a proxy another client's request."""
    with closing(connected(port)) as client:
        client.sendall(NEEDLE[:-2].replace(b"/v1/knotter/needle", b"/nowhere").replace(b"Length: 2", b"Length: 8"))
        received = client.recv(1 << 16)
        client.sendall(b"{}")
        time.sleep(0.05)
        client.sendall(b"\r\n\r\n{}" + LIVEZ)
        received += everything(client)
    assert [received.count(status) for status in (b"HTTP/1.1 404", b"HTTP/1.1 200", b"HTTP/1.1 ")] == [1, 1, 2]


def test_what_is_no_request_is_told_with_the_headers_of_every_reply(port) -> None:
    with closing(connected(port)) as client:
        client.sendall(b"no HTTP\r\n\r\n")
        assert b"content-security-policy: default-src 'none'" in everything(client).lower()


@pytest.fixture
def unread(request, monkeypatch) -> Iterator[tuple[int, uvicorn.Server]]:
    """A service whose clients may be slow to read, some for long, with a large reply at /large."""
    monkeypatch.setattr(bodies.Held, "most", bodies.Held.most)
    seconds = getattr(request, "param", 1.0)
    with serving(max_connections=20, reply_seconds=seconds, reply_memory_bytes=100 << 20) as (port, server):
        large = Route("/large", lambda _: bodies.Reply(b"x" * (24 << 20)))
        server.config.app.router.routes.insert(0, large)
        yield port, server


def test_clients_that_do_not_read_make_room_and_are_cut_off(unread) -> None:
    port, _ = unread
    with ExitStack() as stack:
        for _ in range(40):
            client = stack.enter_context(closing(connected(port)))
            client.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
        with closing(connected(port)) as client:
            client.sendall(LIVEZ)
            assert everything(client).startswith(b"HTTP/1.1 200")
        until(lambda: bodies.Held.total == 0)


def test_a_client_that_reads_a_little_now_and_then_is_cut_off(unread, monkeypatch) -> None:
    """Once each 64 kB had all of the time, and a large reply was held for hours."""
    port, _ = unread
    plain = connections.Connection.connection_made

    def made(self, transport) -> None:  # as `app.server.listening` has it: the system takes little
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 16)
        plain(self, transport)

    monkeypatch.setattr(connections.Connection, "connection_made", made)
    with closing(socket.socket()) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        client.connect(("127.0.0.1", port))
        client.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
        until(lambda: bodies.Held.total > 0)
        read = 0
        while bodies.Held.total:
            read += len(client.recv(1 << 16))
            time.sleep(0.1)
        assert read < 12 << 20


def test_what_unread_replies_took_is_given_back(unread, monkeypatch) -> None:
    """Once the front kept tens of megabytes of them."""
    port, _ = unread
    given: list[int] = []
    monkeypatch.setattr(bodies, "give_back_memory", lambda: given.append(bodies.Held.total))
    with closing(connected(port)) as client:
        client.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
        until(lambda: bodies.Held.total > 1 << 20)
    until(lambda: given)
    assert set(given) == {0}
    with closing(connected(port)) as client:
        client.sendall(LAST)
        assert everything(client).startswith(b"HTTP/1.1 200")
    assert len(given) == 1, "not for each short reply"


@pytest.mark.parametrize("unread", [PATIENCE], indirect=True)
def test_replies_that_are_not_read_hold_only_so_much(unread) -> None:
    port, _ = unread
    with ExitStack() as stack:
        starts = []
        for _ in range(6):
            client = stack.enter_context(closing(connected(port)))
            client.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\n\r\n")
            starts.append(client.recv(12))
        assert starts.count(b"HTTP/1.1 200") >= 4 and b"HTTP/1.1 503" in starts
    until(lambda: bodies.Held.total == 0)


@pytest.mark.parametrize("unread", [PATIENCE], indirect=True)
def test_a_client_that_reads_gets_a_large_reply_whole(unread) -> None:
    port, _ = unread
    with closing(connected(port)) as client:
        client.sendall(b"GET /large HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n")
        received = everything(client)
    assert len(received.partition(b"\r\n\r\n")[2]) == 24 << 20


@pytest.mark.parametrize(
    ("more", "seconds"), [(b"", 1000.0), (b"\r\n", 1000.0), (b"G", 1000.0), (b"G" * 100_000, 0.1)]
)
def test_requests_whose_clients_have_gone_leave_their_places(more, seconds, monkeypatch) -> None:
    """Those, too, who have sent more behind their request: once a byte of it hid that they went."""
    monkeypatch.setattr(connections, "_PROBE_SECONDS", seconds)
    begun = threading.Event()

    class Computing(Threads):
        async def answer(self, request, question, content):
            async def compute(place, queued, cancelled):
                begun.set()
                while not cancelled():
                    await asyncio.sleep(0.01)

            return await self._turns.turn(request, compute)

    settings = Settings(atlas="none", max_concurrent=1)
    resources = ServiceResources(settings)
    app = create_app(settings, resources, lambda turns: Computing(resources, turns))
    with serving(app) as (port, _):
        turns = app.state.turns
        with closing(connected(port)) as first:
            first.sendall(NEEDLE)
            assert begun.wait(PATIENCE)
            first.sendall(more)
            for _ in range(2):
                with closing(connected(port)) as client:
                    client.sendall(NEEDLE)
                    until(lambda: turns.waiting == 1)
                    client.sendall(more)
                    time.sleep(0.05)
                until(lambda: turns.waiting == 0)
        until(lambda: turns.computing == 0)


def test_nothing_is_computed_for_clients_that_ask_and_leave_at_once(monkeypatch) -> None:
    """Once each that came to a free process took it along."""
    monkeypatch.setattr(computed, "DOUBT_SECONDS", 1.0)  # for the first two signs of life, on however busy a machine
    asked, held, go = [], threading.Event(), threading.Event()

    def hold() -> None:
        held.set()
        go.wait(PATIENCE)

    class Computing(Threads):
        async def answer(self, request, question, content):
            asked.append(question.path)
            return await super().answer(request, question, content)

    settings = Settings(atlas="none")
    resources = ServiceResources(settings)
    app = create_app(settings, resources, lambda turns: Computing(resources, turns))
    with serving(app) as (port, server):
        server.servers[0].get_loop().call_soon_threadsafe(hold)
        assert held.wait(PATIENCE)
        for _ in range(20):
            with closing(connected(port)) as client:
                client.sendall(NEEDLE)
        go.set()  # all have closed before the service sees the first of them
        with closing(connected(port)) as client:
            client.sendall(NEEDLE)
            client.shutdown(socket.SHUT_WR)
            assert b"HTTP/1.1 200" in everything(client)
    assert len(asked) == 1


def test_what_is_shared_is_not_counted_while_it_is_sent() -> None:
    before, held = bodies.Held.total, bodies.Held(0)
    held.take(1000)
    assert bodies.Held.total == before


class Sender:
    """A request with a large body from an address, of which so many bytes come every so many seconds."""

    def __init__(self, host: str, part: int, pause: float) -> None:
        self.headers = {"content-length": "100000"}
        self.client, self.state = SimpleNamespace(host=host), SimpleNamespace()
        self._parts, self._pause = [b" " * part] * (100_000 // part), pause

    async def stream(self) -> Any:
        for part in self._parts:
            yield part
            await asyncio.sleep(self._pause)


def received(senders: list[Sender], places: int, seconds: float) -> list[float]:
    """When each body was there, or was given up (negative)."""
    large = LargeBodies(places, seconds)
    large.PATIENCE = 0.2

    async def one(sender: Sender, begin: float) -> float:
        try:
            assert len(await large.read(sender)) == 100_000
            return time.perf_counter() - begin
        except SlowBody:
            return begin - time.perf_counter()

    async def story() -> list[float]:
        begin = time.perf_counter()
        return await asyncio.gather(*(one(sender, begin) for sender in senders))

    return asyncio.run(story())


def test_a_large_body_that_falls_behind_loses_its_place() -> None:
    silent, slow, steady = Sender("a", 10, 1000.0), Sender("b", 10_000, 0.5), Sender("c", 10_000, 0.02)
    gave_up, too_slow, there = received([silent, slow, steady], 16, 1.0)
    assert -PATIENCE < gave_up <= -0.2 and -PATIENCE < too_slow <= -0.3 and there > 0


def test_one_address_has_half_of_the_places() -> None:
    hogs = [Sender("a", 10, 1000.0) for _ in range(6)]
    *_, own, other = received([*hogs, Sender("a", 50_000, 0.0), Sender("b", 50_000, 0.0)], 4, 1000.0)
    assert 0 < other < own and own >= 3 * 0.2, "three times two of one address, then its last"


def test_large_bodies_that_do_not_come_keep_no_place(monkeypatch) -> None:
    monkeypatch.setattr(LargeBodies, "PATIENCE", 0.5)
    head = NEEDLE[:-2].replace(b"Length: 2", b"Length: 900000")
    with serving(body_seconds=1000.0) as (port, _), ExitStack() as stack:
        for _ in range(18):
            client = stack.enter_context(closing(connected(port)))
            client.sendall(head + b" " * 100)
        with closing(connected(port)) as client:
            client.sendall(head + b"{}".ljust(900000))
            assert client.recv(12) == b"HTTP/1.1 200"


def test_nothing_is_kept_of_large_bodies_whose_clients_have_gone_before_their_turn() -> None:
    """Some hundred a second took 200 MB, since each waited with its first 64 kB."""
    head = NEEDLE[:-2].replace(b"Length: 2", b"Length: 900000")
    with serving(body_seconds=1000.0) as (port, server), ExitStack() as stack:
        tasks = server.server_state.tasks
        for _ in range(8):
            client = stack.enter_context(closing(connected(port)))
            client.sendall(head + b" " * 800_000)
        until(lambda: len(tasks) == 8)
        for _ in range(5):
            with closing(connected(port)) as client:
                client.sendall(head + b" " * 1000)
                until(lambda: len(tasks) == 9)
            until(lambda: len(tasks) == 8)
