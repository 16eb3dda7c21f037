"""What the benchmarks of growth and throughput compute from what they measure, and the clients that measure it."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import count

import numpy as np
import pytest

from benchmarks import retrieval, scaling, service


def test_the_page_shows_what_was_measured() -> None:
    text = scaling.PAGE.read_text()
    assert text == scaling.fill(text, scaling.parts()), "python -m benchmarks.scaling writes it anew"
    told = json.loads(retrieval.RESULT.read_text())
    assert retrieval.tables(told) in text, "python -m benchmarks.retrieval --redraw writes it anew"
    assert {"build", "growth", "exponents", "throughput", "overload", "billion"} <= set(scaling.parts())


def test_the_picture_is_the_same_every_time(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    rows = json.loads(scaling.GROWTH.read_text())["rows"]
    pictures = []
    for name in ("first.svg", "second.svg"):
        monkeypatch.setattr(scaling, "FIGURE", tmp_path / name)
        scaling.draw(rows)
        pictures.append((tmp_path / name).read_bytes())
    assert pictures[0] == pictures[1] and b"<dc:date>" not in pictures[0]


def test_a_part_without_its_place_is_an_error() -> None:
    assert scaling.fill("<!-- a -->\nold\n<!-- /a -->", {"a": r"\1 new"}) == "<!-- a -->\n\\1 new\n<!-- /a -->"
    for text in ("", 2 * "<!-- a -->\n<!-- /a -->\n"):
        with pytest.raises(ValueError, match="places for a"):
            scaling.fill(text, {"a": "new"})


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 0.45])
def test_the_slope_of_a_power_is_its_exponent(exponent) -> None:
    types = [1e3, 2e4, 7e6]
    assert scaling.slope(types, [3 * n**exponent for n in types]) == pytest.approx(exponent, abs=1e-12)
    assert np.isnan(scaling.slope(types[:1], [1.0])) and np.isnan(scaling.slope(types[:2], [1.0, None]))


def test_a_quantile_is_one_of_the_values() -> None:
    assert service.quantile(range(1, 41), 0.99) == 40
    assert service.quantile(range(1, 101), 0.99) == 99
    assert service.quantile([3, 1, 2, 4], 0.5) == 2


@pytest.mark.parametrize(
    ("value", "text"), [(12345.6, "12,300"), (1.0, "1.00"), (0.01234, "0.0123"), (0, "0"), (None, "-"), (np.nan, "-")]
)
def test_numbers_are_rounded_to_three_digits(value, text) -> None:
    assert scaling.significant(value) == text


def test_sizes_and_durations_have_units() -> None:
    assert [scaling.size(10.0**k) for k in (0, 3, 6, 9, 12)] == [
        "0.00100 kB",
        "1.00 kB",
        "1.00 MB",
        "1.00 GB",
        "1.00 TB",
    ]
    assert [scaling.duration(s) for s in (0.5, 90, 600, 36000)] == ["500 ms", "90.0 s", "10.0 minutes", "10.0 hours"]


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
