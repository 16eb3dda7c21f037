"""No request within its documented sizes needs more than 150 MB: the largest of each kind, of a service that gives no more."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.largest import MOST_BYTES, QUICK, Largest, requests
from benchmarks.memory import answered, prepared
from benchmarks.service import Service, running, serve_command

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere threads compute, without a limit of memory"
)
LARGEST = requests()
SETTINGS = {"workers": 1, "request_memory_bytes": MOST_BYTES}


def kinds(atlas: bool) -> list:
    """Names of requests that do or do not need an atlas; the default run takes those that are answered soon."""
    return [
        pytest.param(name, marks=[] if name in QUICK else [pytest.mark.wide])
        for name, request in LARGEST.items()
        if request.atlas is atlas
    ]


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    """Without an atlas."""
    with running(serve_command, with_atlas=False, **SETTINGS) as service:
        yield service


@pytest.fixture(scope="module")
def service_with_atlas(atlas_path: Path, tmp_path_factory) -> Iterator[Service]:
    """With the default atlas, and all that is prepared of it."""
    copy = tmp_path_factory.mktemp("memory") / "atlas.h5"
    copy.symlink_to(atlas_path)
    with running(serve_command, atlas=copy, **SETTINGS) as service:
        prepared(service)
        yield service


@pytest.mark.parametrize("name", kinds(atlas=False))
def test_the_largest_request_is_answered_with_little_memory(name, service) -> None:
    check(service, LARGEST[name])


@pytest.mark.parametrize("name", kinds(atlas=True))
def test_the_largest_request_to_the_atlas_is_answered_with_little_memory(name, service_with_atlas) -> None:
    check(service_with_atlas, LARGEST[name])


def check(service: Service, request: Largest) -> None:
    seen = answered(service, request)
    assert seen.status == 200, seen.reply
    assert seen.peak <= MOST_BYTES


def test_every_route_that_computes_has_a_largest_request() -> None:
    from app.registry import all_queries

    assert {query.path for query in all_queries()} <= {request.path for request in LARGEST.values()}
