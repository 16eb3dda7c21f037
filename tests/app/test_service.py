"""A request of the service costs at most itself, and other requests are answered whatever happens to it.

The faults caught: a search that continues for a client that has left, a dead or stuck worker that is not replaced,
short requests behind long requests, an end that waits for searches, processes that are left behind.
"""

import http.client
import json
import os
import re
import signal
import time
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from app.compute import Workers
from app.main import create_app
from app.middleware import HEADERS
from app.server import LOOPBACK
from app.settings import Settings
from tests.conftest import PATIENCE, listening, some_of, started, until
from tests.oracles.largest import requests

SHORT = ("/v2/knotter/needle", {})
RANDOM = np.random.default_rng(1)
LONG = (
    "/v2/synthesize",
    {
        "position": (100 * RANDOM.normal(size=(30, 2))).round(3).tolist(),
        "rotation": (100 * RANDOM.normal(size=30)).round(3).tolist(),
        "timing": "free",
        "tolerance": 0,
        "mechanisms": "all",
        "prefer": "size",
        "tolerances": {"position": 200, "rotation": 200},
    },
)
"""Noise that no linkage follows: the search takes more than ten seconds."""


class Running:
    """A service in this process, its workers and its port."""

    def __init__(self, port: int, workers: Workers) -> None:
        self.port, self.workers = port, workers

    def ask(self, path: str, body: Any) -> tuple[int, Any]:
        with closing(self.connected()) as connection:
            connection.request("POST", path, json.dumps(body), {"Content-Type": "application/json"})
            reply = connection.getresponse()
            return reply.status, json.loads(reply.read())

    def connected(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)

    @contextmanager
    def searching(self) -> Iterator[http.client.HTTPConnection]:
        """A client whose long request is being computed; it has left at the end of the block."""
        busy = self.busy
        with closing(self.connected()) as connection:
            connection.request("POST", LONG[0], json.dumps(LONG[1]), {"Content-Type": "application/json"})
            until(lambda: self.busy > busy)
            yield connection

    @property
    def busy(self) -> int:
        """Number of workers that compute."""
        return self.workers.count - len(self.workers.idle)

    @property
    def processes(self) -> set[int]:
        return {worker.process for worker in self.workers.idle}


@contextmanager
def serving(**settings: Any) -> Iterator[Running]:
    app = create_app(Settings(**{"with_atlas": False, "workers": 2} | settings))
    with listening(app) as (port, _):
        yield Running(port, app.state.workers)


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    with serving(max_waiting=2) as running:
        yield running


@pytest.fixture
def idle(running) -> Running:
    until(lambda: len(running.workers.idle) == 2)
    return running


# -- who waits --------------------------------------------------------------------------------------------------------


def test_short_requests_are_answered_beside_long_ones(idle) -> None:
    with idle.searching(), closing(idle.connected()) as second:
        second.request("POST", LONG[0], json.dumps(LONG[1]), {"Content-Type": "application/json"})
        until(lambda: idle.workers.waiting[True] == 1)
        assert [idle.ask(*SHORT)[0] for _ in range(3)] == [200] * 3, "one worker is free of long requests"
        status, problem = idle.ask(*LONG)
        assert status == 503 and "waiting" in problem["detail"], "half of the room to wait is for short requests"


def test_too_many_short_requests_are_refused_at_once() -> None:
    with serving(workers=1, max_waiting=0) as running, running.searching(), closing(running.connected()) as second:
        second.request("POST", SHORT[0], "{}", {"Content-Type": "application/json"})
        reply = second.getresponse()
        assert reply.status == 503 and int(reply.headers["Retry-After"]) > 0
        assert reply.headers["Content-Type"] == "application/problem+json" and reply.read()
        second.request("GET", "/livez")
        assert second.getresponse().status == 200


def test_work_ends_with_its_client(idle) -> None:
    for _ in range(5):
        with idle.searching():
            left = idle.processes
        begin = time.perf_counter()
        until(lambda: len(idle.workers.idle) == 2)
        assert time.perf_counter() - begin < 10, "the budget is 30 s"
        assert left < idle.processes, "the worker goes on with other requests"


def test_a_client_that_leaves_while_it_waits_leaves_the_queue(idle) -> None:
    with idle.searching():
        with closing(idle.connected()) as second:
            second.request("POST", LONG[0], json.dumps(LONG[1]), {"Content-Type": "application/json"})
            until(lambda: idle.workers.waiting[True] == 1)
        until(lambda: idle.workers.waiting[True] == 0)


# -- dead and stuck workers -------------------------------------------------------------------------------------------


def test_a_worker_that_is_killed_costs_its_own_request_and_is_replaced(idle) -> None:
    all_cases = idle.processes
    with idle.searching() as connection:
        (process,) = all_cases - idle.processes
        os.kill(process, signal.SIGKILL)
        begin = time.perf_counter()
        reply = connection.getresponse()
        assert reply.status == 503 and "has ended unexpectedly" in json.loads(reply.read())["detail"]
        assert idle.ask(*SHORT)[0] == 200
        until(lambda: len(idle.workers.idle) == 2)
        assert process not in idle.processes and time.perf_counter() - begin < 25, "the budget is 30 s"


def test_an_idle_worker_that_is_killed_is_replaced_before_it_is_needed(idle) -> None:
    for process in (killed := idle.processes):
        os.kill(process, signal.SIGKILL)
    until(lambda: len(idle.processes) == 2 and not idle.processes & killed)
    with ThreadPoolExecutor(2) as pool:
        assert [status for status, _ in pool.map(lambda _: idle.ask(*SHORT), range(2))] == [200, 200]


def test_a_worker_that_does_not_end_is_replaced(monkeypatch) -> None:
    monkeypatch.setattr("app.compute.GRACE_SECONDS", 1.0)
    with serving(max_budget_ms=10) as running:
        (stuck, second) = sorted(running.processes)
        for process in (stuck, second):
            os.kill(process, signal.SIGSTOP)
        begin = time.perf_counter()
        status, problem = running.ask(*SHORT)
        assert status == 503 and "longer than" in problem["detail"]
        assert time.perf_counter() - begin < 30, "it is stopped after a second"
        until(lambda: len(running.workers.idle) == 2)
        assert len(running.processes & {stuck, second}) == 1, "the one that computes nothing was not asked"
        os.kill((running.processes & {stuck, second}).pop(), signal.SIGCONT)


@pytest.mark.parametrize("name", some_of(["SIGINT", "SIGTERM"], 1))
def test_the_service_ends_in_time_with_a_search_under_way(name, small_bytes, tmp_path) -> None:
    (tmp_path / "small.h5").write_bytes(small_bytes)
    command = ("-m", "app.start", "serve", "--port", "0", "--atlas", str(tmp_path / "small.h5"))
    with started(tmp_path, *command) as (process, port, log):
        workers = children(process.pid)
        running = Running(port, None)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=PATIENCE) as reply:
            assert (reply.status, json.load(reply)["status"]) == (200, "ready")
        with closing(running.connected()) as connection:
            connection.request("POST", LONG[0], json.dumps(LONG[1]), {"Content-Type": "application/json"})
            assert running.ask(*SHORT)[0] == 200, "asked later: the search is under way"
            process.send_signal(signal.Signals[name])
            begin = time.perf_counter()
            reply = connection.getresponse()
            assert reply.status == 503 and "shutting down" in json.loads(reply.read())["detail"]
            assert process.wait(PATIENCE) == 0 and time.perf_counter() - begin < 25, "the budget is 30 s"
        until(lambda: not any(map(alive, workers)))
        assert "Traceback" not in log.read_text() and "Finished server process" in log.read_text()


def test_workers_end_with_a_service_that_is_killed(tmp_path) -> None:
    with (
        pytest.raises(AssertionError),
        started(tmp_path, "-m", "app.start", "serve", "--port", "0", "--no-atlas") as (process, _, _),
    ):
        workers = children(process.pid)
        assert len(workers) >= 4, "two workers, the process that they are forked from, a tracker"
        process.kill()
        until(lambda: not any(map(alive, workers)))
        process.wait()


def children(number: int) -> list[int]:
    """All processes below a process."""
    lists = Path(f"/proc/{number}/task").glob("*/children")
    found = [int(child) for each in lists for child in each.read_text().split()]
    return [each for child in found for each in (child, *children(child))]


def alive(number: int) -> bool:
    try:
        return " Z " not in Path(f"/proc/{number}/stat").read_text()
    except OSError:
        return False


# -- budgets ----------------------------------------------------------------------------------------------------------

LARGEST = requests()


@pytest.fixture(scope="module")
def quick() -> Iterator[TestClient]:
    with TestClient(create_app(Settings(with_atlas=False, max_budget_ms=1000))) as client:
        yield client


@pytest.mark.timed
@pytest.mark.parametrize("name", LARGEST)
def test_the_largest_requests_keep_their_budget(name, quick) -> None:
    largest = LARGEST[name]
    begin = time.perf_counter()
    reply = quick.post(largest.path, content=largest.content, headers={"content-type": "application/json"})
    assert reply.status_code in (200, 503), reply.text[:300]
    assert time.perf_counter() - begin < 1.2 * 1.0 + 0.9, (
        "at 1.2 times the budget, at least a second later, it is ended"
    )


# -- hosts, headers, figures ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def local() -> Iterator[TestClient]:
    settings = Settings(with_atlas=False, workers=1, allowed_hosts=LOOPBACK, metrics=True)
    with TestClient(create_app(settings), base_url="http://localhost") as client:
        yield client


@pytest.mark.parametrize("host", ["localhost:8000", "127.0.0.1", "[::1]:8000", "LOCALHOST"])
def test_the_machine_itself_is_let_in(host, local) -> None:
    assert local.get("/livez", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "", "a@localhost"]
)
def test_foreign_names_are_refused(host, local) -> None:
    for path in ("/", "/livez", "/static/main.js"):
        assert local.get(path, headers={"host": host}).status_code == 400


@pytest.mark.parametrize(
    "path", ["/", "/livez", "/docs", "/static/main.js", "/nowhere", "/v2/match", "/openapi.json"]
)
def test_every_reply_has_the_headers_of_security(path, local) -> None:
    headers = local.get(path).headers
    assert headers["content-security-policy"].startswith("default-src 'none'")
    assert all(headers[name] == value for name, value in HEADERS.items())
    assert ("'unsafe-inline'" in headers["content-security-policy"]) == (path == "/docs"), "its library needs it"


def test_a_service_that_was_started_without_an_atlas_says_what_needs_one(local) -> None:
    assert local.get("/readyz").status_code == 200
    for path, more in (("/v2/match", {}), ("/v2/synthesize", {"effort": "atlas"})):
        reply = local.post(path, json={"rotation": [0, 8, 19], "crank_span": 90} | more)
        assert reply.status_code == 503 and "started without an atlas" in reply.json()["detail"]
        assert "retry-after" not in reply.headers, "waiting does not help"


def test_replies_are_compressed_for_clients_that_take_it(local) -> None:
    body = {"position": [[0, 0], [40, 8], [75, 30]], "rotation": [0, 15, 40], "timing": "free", "budget_ms": 100}
    reply = local.post("/v2/synthesize", json=body, headers={"accept-encoding": "gzip"})
    assert reply.headers["content-encoding"] == "gzip" and reply.json()["solutions"]


def test_the_dashboard_asks_for_figures_that_there_are(local) -> None:
    local.post(SHORT[0], json={})
    local.get("/nowhere")
    text = local.get("/metrics").text
    found = {(row.name, row.labels.get("handler"), row.labels.get("status")): row.value
             for family in text_string_to_metric_families(text) for row in family.samples}  # fmt: skip
    assert found["http_requests_total", SHORT[0], "200"] >= 1
    assert found["linkage_atlas_waiting", None, None] == 0
    dashboard = (Path(__file__).parents[2] / "deploy" / "grafana.json").read_text()
    expected = set(re.findall(r"(?:linkage_atlas|http)_\w+", dashboard))
    assert expected and expected <= {name for name, _, _ in found}


def test_without_the_setting_there_are_no_figures(client) -> None:
    assert client.get("/metrics").status_code == 404
