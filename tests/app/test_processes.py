"""The service as processes: what becomes of a request that takes too much, of a process that ends, and of the service's end."""

import asyncio
import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from app import processes
from app.bodies import Held
from app.computed import SMALL, Question
from app.computer import Head, Task
from app.live import Lives
from app.registry import all_queries
from app.resources import INDEX
from app.server import default_workers, listening
from app.settings import Settings
from app.turns import Turns
from linkage_atlas import Cancelled
from synthesis.atlas.table import AtlasRule
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from tests.conftest import PATIENCE, atlas_bytes, some_of, started, until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere threads compute")
SERVICE = """
import os, sys
from app import cli
from app.scenes import knotter, lift
from app.registry import all_queries
from app.supervisor import Supervisor
from synthesis.slider import SliderTypeRule

SliderTypeRule.__init__.__defaults__ = (40, *SliderTypeRule.__init__.__defaults__[1:])

def answer(kind):
    def spin(body, resources):
        while True:
            sum(range(10**6))  # looks at no watch

    def hoard(body, resources):
        kept = []
        while True:
            kept.append(bytearray(1 << 20))

    def die(body, resources):
        os.kill(os.getpid(), 11)

    def fail(body, resources):
        raise RuntimeError("a fault")

    return {"spin": spin, "hoard": hoard, "die": die, "fail": fail}[kind]

for query in all_queries():
    for path, kind in {"/v1/lift/batch": "spin", "/v1/knotter/curves": "hoard", "/v1/knotter/fit": "die",
                       "/v1/knotter/tolerance": "fail"}.items():
        if query.path == path:
            object.__setattr__(query, "answer", answer(kind))
say = Supervisor._say
Supervisor._say = lambda self, *words, **more: print(words[0], flush=True) or say(self, *words, **more)
raise SystemExit(cli.main(["serve", "--port", "0", "--workers", "2", *sys.argv[1:]]))
"""
"""The command, where some questions are answered badly, the slider-cranks beside an atlas are few, and what the supervisor
says is logged."""
SLOW_PARTS = """
from app.resources import ServiceResources
from pathlib import Path
from time import sleep
make = ServiceResources.make

def slowly(self, part):
    while not (self.settings.atlas.parent / "go").exists():
        sleep(0.01)
    make(self, part)

ServiceResources.make = slowly
"""
NO_ROOM = """
import os
from pathlib import Path
fork = os.fork

def limited():
    if Path("FULL").exists():
        raise BlockingIOError(11, "Resource temporarily unavailable")
    return fork()

os.fork = limited
"""
BODIES = {query.path: next(iter(query.examples.values())) for query in all_queries()}
NEEDLE = "/v1/knotter/needle"


class Running:
    """A service and its processes: the supervisor, the front, and those that compute."""

    def __init__(self, process: subprocess.Popen[str], port: int, log: Path) -> None:
        self.process, self.port, self.log = process, port, log
        until(lambda: len(self.computing) == 2)

    def children(self) -> list[int]:
        return children_of(self.process.pid)

    @property
    def computing(self) -> set[int]:
        return {number for number in self.children() if ignores(number)}

    @property
    def front(self) -> int:
        return int(re.findall(r"Started server process \[(\d+)\]", self.log.read_text())[-1])

    def sent(self, path: str, body: Any = None) -> http.client.HTTPConnection:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        content = json.dumps(BODIES[path] if body is None else body)
        connection.request("POST", path, content, {"Content-Type": "application/json"})
        return connection

    def get(self, path: str) -> Any:
        with closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)) as connection:
            connection.request("GET", path)
            return json.load(connection.getresponse())

    def post(self, path: str, body: Any = None) -> tuple[int, dict[str, Any]]:
        with closing(self.sent(path, body)) as connection:
            reply = connection.getresponse()
            return reply.status, json.load(reply)


def children_of(number: int) -> list[int]:
    try:
        return list(map(int, Path(f"/proc/{number}/task/{number}/children").read_text().split()))
    except OSError:
        return []


def status(number: int) -> str:
    try:
        return Path(f"/proc/{number}/status").read_text()
    except OSError:
        return ""


def ignores(number: int) -> bool:
    """Whether a process ignores SIGTERM, as those that compute do."""
    found = re.search(r"SigIgn:\t(\w+)", status(number))
    return found is not None and bool(int(found[1], 16) >> (signal.SIGTERM - 1) & 1)


def used(number: int) -> int:
    """Processor time of a process in hundredths of a second."""
    try:
        return sum(map(int, Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]))
    except OSError:
        return 0


def busy(running: Running) -> closing[http.client.HTTPConnection]:
    """A request that takes all its time, and has begun to."""
    before = {number: used(number) for number in running.computing}
    connection = running.sent("/v1/lift/batch")
    until(lambda: any(used(number) > ticks + 5 for number, ticks in before.items()))
    return closing(connection)


def answers(running: Running) -> bool:
    """Whether a service answers, whose front may have ended."""
    try:
        return running.post(NEEDLE)[0] == 200
    except OSError:
        return False


def settled(running: Running) -> bool:
    """Whether those that compute have been replaced by such as share all that was loaded."""
    _, fresh, since = running.log.read_text().rpartition("fresh\n")
    return bool(fresh) and since.count("computer\n") >= 2 and len(running.computing) == 2


@contextmanager
def serving(folder: Path, *options: str, code: str = SERVICE, **settings: Any) -> Iterator[Running]:
    with started(folder, "-c", code, *(options or ["--no-atlas"]), **settings) as found:
        yield Running(*found)
        children = children_of(found[0].pid)
    until(lambda: not any(map(status, children)))


@pytest.fixture(scope="module")
def running(tmp_path_factory) -> Iterator[Running]:
    """Answers take at most half a second of processor time and 60 MB."""
    folder = tmp_path_factory.mktemp("processes")
    with serving(folder, max_budget_ms=100, request_memory_bytes=60_000_000) as running:
        until(lambda: settled(running))
        yield running


FATES = [("/v1/lift/batch", 503, "took longer"), ("/v1/knotter/curves", 503, "more memory")]
FATES += [("/v1/knotter/fit", 503, "has ended"), ("/v1/knotter/tolerance", 500, "a fault")]


@pytest.mark.parametrize(("path", "status", "detail"), FATES, ids=["too long", "too large", "crash", "fault"])
def test_a_request_that_takes_too_much_fails_alone_and_says_so(path, status, detail, running) -> None:
    with closing(running.sent(path)) as bad:
        good = [running.post(NEEDLE)[0] for _ in range(3)]
        reply = bad.getresponse()
        problem = json.load(reply)
    assert good == [200, 200, 200]
    assert (reply.status, reply.headers.get_content_type()) == (status, "application/problem+json")
    assert problem["status"] == status and detail in problem["detail"]
    assert (status == 503) == ("Retry-After" in reply.headers)
    line = rf"503 to {path} \(\d+ bytes, after [\d.]+ s\)"
    assert (status == 503) == bool(re.search(line, running.log.read_text()))
    until(lambda: len(running.computing) == 2)
    assert running.post(NEEDLE)[0] == 200
    assert ("SIGSEGV" in running.log.read_text()) or path != "/v1/knotter/fit"


def test_a_client_that_leaves_takes_its_process_with_it(running) -> None:
    before = running.computing
    busy(running).thing.close()
    until(lambda: len(running.computing) == 2 and running.computing != before)
    assert len(before & running.computing) == 1


@pytest.fixture(scope="module")
def small_bytes() -> bytes:
    """Of still fewer types: what is tested is who makes the parts of their index."""
    return atlas_bytes(AtlasRule(TypeRule(44, 2, OrderRule.FULL_CRANK), 32))


@pytest.fixture(scope="module")
def unhurried(small_bytes, tmp_path_factory) -> Iterator[tuple[Running, Path]]:
    """Requests may take long, and there is an atlas without an index; while there is a file at the path beside it no further
    process can begin."""
    folder = tmp_path_factory.mktemp("unhurried")
    full, atlas = folder / "full", folder / "small.h5"
    atlas.write_bytes(small_bytes)
    code = NO_ROOM.replace("FULL", str(full)) + SERVICE
    with serving(folder, "--atlas", str(atlas), code=code, metrics=True) as running:
        yield running, full


def nice(number: int) -> int:
    return os.getpriority(os.PRIO_PROCESS, number)


def test_long_requests_stand_back_further_while_others_wait(unhurried) -> None:
    running, _ = unhurried

    def waiting() -> bool:
        with closing(http.client.HTTPConnection("127.0.0.1", running.port, timeout=PATIENCE)) as connection:
            connection.request("GET", "/metrics")
            return b"linkage_atlas_waiting 2.0" in connection.getresponse().read()

    until(lambda: len(running.computing) == 2)
    usual = max(map(nice, running.computing))
    with busy(running), closing(running.sent("/v1/lift/batch")), closing(running.sent("/v1/lift/batch")):
        until(waiting)
        first = max(running.computing, key=nice)
        assert nice(first) == usual, "it began while nobody waited"
        os.kill(first, signal.SIGKILL)  # its place goes to the second, while the third waits
        back = min(usual + 10, 19)  # the system knows no more
        until(lambda: first not in running.computing and max(map(nice, running.computing), default=0) == back)
    until(lambda: len(running.computing) == 2 and max(map(nice, running.computing)) == usual)


def test_one_process_goes_before_the_others_and_is_never_given_a_long_request(running) -> None:
    for _ in range(2):  # also the one that takes its place
        until(lambda: len(running.computing) == 2)
        quick, other = sorted(running.computing, key=nice)
        assert nice(quick) < nice(other)
        for _ in range(2):
            with busy(running):  # and takes its process along
                assert running.post(NEEDLE)[0] == 200
            until(lambda other=other: other not in running.computing and len(running.computing) == 2)
            assert quick in running.computing
            (other,) = running.computing - {quick}
        os.kill(quick, signal.SIGKILL)
        until(lambda quick=quick: quick not in running.computing)


def test_long_addresses_are_cut_in_the_log(running) -> None:
    assert running.get(f"/nowhere/{'x' * 5000}")["status"] == 404
    until(lambda: "/nowhere/" in running.log.read_text())
    (line,) = (line for line in running.log.read_text().splitlines() if "/nowhere/" in line)
    assert len(line) < 600 and line.endswith("404 Not Found")


def test_a_process_that_is_killed_is_replaced(running) -> None:
    before = running.computing
    for number in before:
        os.kill(number, signal.SIGKILL)
    until(lambda: len(running.computing) == 2 and not before & running.computing)
    assert [running.post(NEEDLE)[0] for _ in range(4)] == [200] * 4


def test_long_bodies_are_read_elsewhere_and_wait_with_the_long_ones(running) -> None:
    motion = {**BODIES["/v1/lift/motion"], "times": [0.001 * k for k in range(2000)]}
    motion.pop("samples", None)
    assert len(json.dumps(motion)) > SMALL
    assert running.post("/v1/lift/motion", motion)[0] in (200, 503)
    status, problem = running.post("/v1/lift/motion", {**motion, "times": [0.001] * 2000 + ["x"]})
    assert status == 422 and problem["errors"][0]["pointer"].startswith("#/times")
    assert running.post("/v1/lift/motion", {f"k{k}": 1 for k in range(2500)})[0] == 400


def test_whoever_ends_is_seen_though_no_one_wishes_anything(running) -> None:
    """The supervisor once waited for a wish that did not come, when a signal had woken it."""
    for _ in range(4):
        before = running.computing
        for number in before:
            os.kill(number, signal.SIGKILL)
            time.sleep(0.02)
        until(lambda before=before: len(running.computing) == 2 and not before & running.computing)


def test_a_front_that_is_killed_is_replaced_and_listens_on_the_same_port(running) -> None:
    before = running.front
    os.kill(before, signal.SIGKILL)
    until(lambda: len(running.computing) == 2 and running.front != before)

    until(lambda: answers(running))


@pytest.mark.parametrize(
    ("name", "succeeded"), some_of([("SIGHUP", True), ("SIGHUP", False), ("SIGTERM", False), ("SIGINT", False)], 1)
)  # the others: test_command_line.py
def test_the_end_is_told_to_clients_and_leaves_no_process(name, succeeded, tmp_path) -> None:
    """Nor a successor that has not yet begun."""
    if signal.getsignal(getattr(signal, name)) == signal.SIG_IGN:
        pytest.skip(f"{name} is ignored here, as under nohup, and a service keeps to that")
    with serving(tmp_path, ending_seconds=2.5) as running:
        until(lambda: settled(running))
        before, successors = set(running.children()), set()
        with busy(running) as asked:
            if succeeded:
                os.kill(running.process.pid, signal.SIGUSR1)
                successors = until(lambda: set(running.children()) - before)
            for number in [running.process.pid, *before]:  # as a terminal's Ctrl-C, or a service manager, does
                os.kill(number, getattr(signal, name))
            reply = asked.getresponse()
            assert reply.status == 503, running.log.read_text()
            assert "ending" in json.load(reply)["detail"]
        assert running.process.wait(PATIENCE) == 0
        until(lambda: not any(map(status, successors)))
        log = running.log.read_text()
        assert "Traceback" not in log


def test_a_successor_takes_over_without_a_refused_request(tmp_path) -> None:
    with serving(tmp_path, max_budget_ms=1000) as running:
        statuses, ended = [], threading.Event()

        def ask() -> None:
            while not ended.wait(0.02):
                statuses.append(running.post(NEEDLE)[0])

        asking = [threading.Thread(target=ask) for _ in range(2)]
        with busy(running) as asked:
            for thread in asking:
                thread.start()
            os.kill(running.process.pid, signal.SIGUSR1)
            assert running.process.wait(PATIENCE) == 0
            # it took all of its time, and not only that until the end
            assert "this service allows" in json.load(asked.getresponse())["detail"]
        before = len(statuses)
        until(lambda: len(statuses) > before + 10)
        ended.set()
        for thread in asking:
            thread.join()
        assert set(statuses) == {200}
        front = re.findall(r"Started server process \[(\d+)\]", running.log.read_text())[-1]
        successor = int(re.search(r"PPid:\s*(\d+)", status(int(front)))[1])
        os.kill(successor, signal.SIGTERM)
        until(lambda: not status(successor))


def test_where_the_system_has_no_room_for_a_process_the_service_goes_on(unhurried) -> None:
    """Once it ended with the first that could not begin."""
    running, full = unhurried
    until(lambda: len(running.computing) == 2)
    supervisor = running.process.pid
    files = os.listdir(f"/proc/{supervisor}/fd")
    full.touch()
    os.kill(supervisor, signal.SIGUSR1)
    for number in running.computing:
        os.kill(number, signal.SIGKILL)
    until(lambda: running.log.read_text().count("No further process can begin") >= 4)
    assert running.get("/livez") == {"status": "ok"}
    os.kill(running.front, signal.SIGKILL)
    until(lambda: not running.children())
    full.unlink()
    until(lambda: len(running.computing) == 2)
    until(lambda: answers(running))
    assert len(os.listdir(f"/proc/{supervisor}/fd")) <= len(files)


@pytest.fixture(scope="module")
def indexed(small_bytes, tmp_path_factory) -> Iterator[tuple[Running, Path]]:
    """A service that makes parts of the index of a small atlas, and where they lie."""
    folder = tmp_path_factory.mktemp("indexed")
    (folder / "small.h5").write_bytes(small_bytes)
    with serving(folder, "--atlas", str(folder / "small.h5")) as running:
        until(lambda: running.get("/readyz") == {"status": "ready", "preparing": []})
        yield running, folder / "small.h5.index"


ROTATION = {"rotation": [0, 5, 12, 20, 31], "crank_span": 80}


def test_whichever_process_computes_goes_on_for_a_live_client(indexed) -> None:
    told = []
    for k in range(3):
        position = [[0, 0], [30, 12], [55, 30 + k], [60, 55], [42, 70]]
        body = {"position": position, "timing": "free", "top": 2, "live": "dragged there"}
        found, reply = indexed[0].post("/v1/synthesize", body)
        assert found == 200 and reply["solutions"]
        told.append(reply["report"]["live"]["continued"])
    assert told == [False, True, True]


def test_connections_do_not_wait_for_acknowledgements() -> None:
    """uvicorn's own sockets for several processes are not known to be TCP, and so keep Nagle's algorithm."""
    seen: list[int] = []

    async def accept() -> None:
        done = asyncio.Event()

        def connected(reader: Any, writer: asyncio.StreamWriter) -> None:
            known = writer.get_extra_info("socket")
            seen.append(known.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()
            done.set()

        (listener,) = listening("127.0.0.1", 0)
        server = await asyncio.start_server(connected, sock=listener)
        client = threading.Thread(target=lambda: socket.create_connection(listener.getsockname()).close())
        client.start()
        await done.wait()
        client.join()
        server.close()

    asyncio.run(accept())
    assert seen == [1]


def test_the_system_takes_little_of_what_a_client_does_not_read() -> None:
    """Some megabytes of each connection otherwise: time to copy them and memory that nothing counts."""
    (listener,) = listening("127.0.0.1", 0)
    with listener, socket.socket() as client:
        listener.listen()
        client.connect(listener.getsockname())
        server, _ = listener.accept()
        with server:
            server.setblocking(False)
            taken = 0
            with contextlib.suppress(BlockingIOError):
                while True:
                    taken += server.send(b"x" * 10_000)
    assert taken < 1 << 20


def test_all_addresses_of_a_host_have_the_same_port() -> None:
    listeners = listening("localhost", 0)
    try:
        assert len({listener.getsockname()[1] for listener in listeners}) == 1
        listeners[0].listen()
        with pytest.raises(OSError):
            listening(*listeners[0].getsockname()[:2])
    finally:
        for listener in listeners:
            listener.close()


def test_short_requests_have_a_process_whatever_the_machine() -> None:
    assert 2 <= default_workers() <= 4


class _Gone:
    """A request whose client has left."""

    client = None

    async def receive(self) -> dict[str, str]:
        return {"type": "http.disconnect"}


@pytest.mark.parametrize("long", [False, True])
def test_a_short_answer_is_finished_though_its_client_has_gone(long, monkeypatch) -> None:
    """Once each client that asked and left at once cost a process: two of them, which ask 90 times a second, ten a second."""
    monkeypatch.setattr(processes, "_SHORT_SECONDS", 1000.0)

    async def story() -> bool:
        ended: list[bool] = []
        turns = Turns(1)
        computing = processes.Processes(turns, Settings())
        process = processes._Process(0, None, quick=False)

        async def ask(task: Task) -> tuple[Head, list[bytes], Held]:
            for _ in range(20):
                await asyncio.sleep(0)
            return Head(200, [], 0, False), [], Held(0)

        process.ask, process.close = ask, lambda: ended.append(True)
        turns.add(process)
        with contextlib.suppress(Cancelled):
            await computing._asked(_Gone(), Task("", b"", 0.0, False), long)
        assert turns.computing == 0
        return bool(ended)

    assert asyncio.run(story()) == long


@pytest.mark.parametrize(("part", "waits"), [("cells", 1), (INDEX, 2)])
def test_a_part_that_cannot_be_kept_is_made_once_for_all_and_once_for_the_answer(part, waits) -> None:
    """Once it was made for all a second time, in vain; of a damaged index a second one may have come between."""
    waited, asked = [], []

    class Computing(processes.Processes):
        async def _made(self, part: str) -> None:
            waited.append(part)

        async def _asked(self, request: Any, task: Task, *_: Any) -> tuple[Head, list[bytes], Held]:
            asked.append(task.makes)
            return Head(200 if task.makes else 0, [], 0, False, part), [], Held(0)

    async def story() -> int:
        computing = Computing(Turns(1), Settings())
        computing._lives = Lives()
        query = next(query for query in all_queries() if query.path == NEEDLE)
        question = Question(NEEDLE, query.request, query.answer, lambda body: False)
        return (await computing.answer(_Gone(), question, b"{}")).status_code

    assert asyncio.run(story()) == 200
    assert waited == [part] * waits and asked == [False, False, True]
