"""The clients that measure a service, and the requests that they send."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count

import numpy as np
import pytest

from benchmarks import service


def test_a_quantile_is_one_of_the_values() -> None:
    assert service.quantile(range(1, 41), 0.99) == 40
    assert service.quantile(range(1, 101), 0.99) == 99
    assert service.quantile([3, 1, 2, 4], 0.5) == 2


def test_requests_are_reproducible_and_none_is_of_the_lattice() -> None:
    bodies = service.match_bodies(4)
    assert bodies[:2] == service.match_bodies(2) and len(set(bodies)) == 4
    for request in map(json.loads, bodies):
        assert len(request["rotation"]) == 32 and 20 <= request["crank_span"] <= 300
        assert np.abs(np.diff(request["rotation"])).max() < 90  # continuous


def test_the_settings_of_a_started_service_are_the_given_ones_alone(monkeypatch) -> None:
    monkeypatch.setenv("LINKAGE_ATLAS_MAX_WAITING", "1")
    found = service.environment(atlas_max_types=7)
    assert {name: value for name, value in found.items() if name.startswith("LINKAGE")} == {
        "LINKAGE_ATLAS_ATLAS_MAX_TYPES": "7"
    }


def test_the_memory_of_a_command_is_its_own_however_much_the_measuring_process_holds() -> None:
    held = np.ones(20_000_000)
    written, seconds, peak = service.spent("-c", "print('a'); print('b')")
    assert written == b"a\nb" and 0 < seconds < 60 and 2e6 < peak < held.nbytes / 4
    with pytest.raises(RuntimeError, match="exit code 3"):
        service.spent("-c", "raise SystemExit(3)")


class RefusesEveryOther(BaseHTTPRequestHandler):
    """Answers /livez, and refuses every other request with 503 and Retry-After: 1."""

    protocol_version = "HTTP/1.1"
    number = count()

    def do_GET(self) -> None:
        self._answer(200)

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self._answer(503 if next(self.number) % 2 else 200)

    def _answer(self, status: int) -> None:
        self.send_response(status)
        if status == 503:
            self.send_header("Retry-After", "1")
        self.send_header("Content-Length", "2")
        self.end_headers()
        self.wfile.write(b"{}")

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@pytest.fixture
def refusing_port() -> Iterator[int]:
    with ThreadingHTTPServer(("127.0.0.1", 0), RefusesEveryOther) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


@pytest.mark.parametrize("patient", [True, False])
def test_patient_clients_wait_for_as_long_as_they_are_told(patient, refusing_port) -> None:
    load, beats = service.drive([refusing_port], "/v1/match", [b"{}"], 2, 0.5, patient)
    assert set(load.status) == {200, 503}
    assert {after for status, after in zip(load.status, load.retry_after) if status == 503} == {1.0}
    assert len(beats) >= 5 and min(beats) > 0
    assert len(load.status) == len(load.seconds) and load.elapsed >= 0.5
    # two clients: each is refused at most once within the half second if it waits a second then
    assert (load.status.count(503) <= 2) == patient
