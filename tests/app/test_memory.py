"""No request within its documented sizes needs more than 150 MB: the largest of each kind, of a service that gives no more."""

import http.client
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.conftest import PATIENCE, started
from tests.oracles.largest import MOST_BYTES, QUICK, requests
from tests.oracles.memory import answered

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere threads compute, without a limit of memory"
)
ROOT = Path(__file__).parents[2]
LARGEST = requests()
NEEDS_ROCKERS = "match: rocker"
FEWER = QUICK - {"free: three poses", "chain: slot, spline", "knotter: limit"}
"""Of each scene, of searches in time and without, of functions, and of a table."""


class Running:
    """A service with one worker."""

    def __init__(self, process: subprocess.Popen[str], port: int) -> None:
        self.process, self.port = process, port

    def ask(self, path: str, content: bytes) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("POST", path, content, {"Content-Type": "application/json"})
        reply = connection.getresponse()
        status, body = reply.status, reply.read()
        connection.close()
        return status, body

    def check(self, name: str) -> None:
        seen = answered(self.process.pid, self.ask, LARGEST[name], every=1e-3)
        assert seen.status == 200, seen.reply  # its limit sees also what lies between two looks
        assert seen.peak <= MOST_BYTES


@contextmanager
def serving(folder: Path, *options: str) -> Iterator[Running]:
    command = ("-m", "app.start", "serve", "--port", "0", "--workers", "1", *options)
    with started(folder, *command, request_memory_bytes=MOST_BYTES) as (process, port, _):
        yield Running(process, port)


def kinds(atlas: bool) -> list:
    """Names of requests that do or do not need an atlas; the default run takes those that are answered soon."""
    names = [name for name, request in LARGEST.items() if request.atlas is atlas]
    return [pytest.param(name, marks=[] if name in FEWER else [pytest.mark.wide]) for name in names]


@pytest.fixture(scope="module")
def service(tmp_path_factory) -> Iterator[Running]:
    """Without an atlas."""
    with serving(tmp_path_factory.mktemp("memory"), "--no-atlas") as running:
        yield running


@pytest.fixture(scope="module")
def service_with_atlas(atlas_path, tmp_path_factory) -> Iterator[Running]:
    """With the default atlas."""
    with serving(tmp_path_factory.mktemp("memory"), "--atlas", str(atlas_path)) as running:
        assert running.ask(LARGEST[NEEDS_ROCKERS].path, LARGEST[NEEDS_ROCKERS].content)[0] == 200
        yield running


@pytest.mark.parametrize("name", kinds(atlas=False))
def test_the_largest_request_is_answered_with_little_memory(name, service) -> None:
    service.check(name)


@pytest.mark.parametrize("name", kinds(atlas=True))
def test_the_largest_request_to_the_atlas_is_answered_with_little_memory(name, service_with_atlas) -> None:
    service_with_atlas.check(name)


def test_every_route_that_computes_has_a_largest_request() -> None:
    from app.registry import all_queries

    assert {query.path for query in all_queries()} <= {request.path for request in LARGEST.values()}
