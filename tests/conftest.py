"""Shared fixtures: the default atlas, built once a session, a small atlas, and the service without an atlas."""

import copy
import ctypes
import fcntl
import gc
import math
import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import reduce
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from _pytest.assertion import rewrite
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers
from xdist.scheduler import LoadFileScheduling

from app.main import create_app
from app.settings import Settings
from data_build.batch import build_atlas
from data_build.processes import executor
from synthesis.atlas.file import encode_atlas
from synthesis.atlas.table import AtlasRule, compute_features, compute_series
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.work import Work

if (
    signal.getsignal(signal.SIGINT) == signal.SIG_IGN
):  # a job in the background: what the tests start would ignore it too
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Every run tries the same examples, and a slow machine is no failure. Hypothesis would also draw numbers that it finds in the
# modules loaded by then, which are others in each process of the tests; and parse all of them for it.
providers.is_local_module_file = lambda path: False
settings.register_profile(
    "suite", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=False
)
settings.load_profile("suite")

# Memory that a test frees is kept for the next: the system clears each page that it hands out again. What the
# tests start as processes of their own has the system's usual settings.
if hasattr(ctypes.CDLL(None), "mallopt"):
    for option, size in ((-1, 512 << 20), (-3, 32 << 20)):  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD
        ctypes.CDLL(None).mallopt(option, size)


PATIENCE = 300.0
"""Seconds until a condition is considered lost; enough for a machine that is ten times slower than usual."""


def until(condition: Callable[[], Any]) -> Any:
    """Return the value of a condition, once it holds."""
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.01)
    return found


def pytest_configure(config: pytest.Config) -> None:
    """Compile the bytecode of the tests once, before several processes would each compile it."""
    if getattr(config.option, "numprocesses", None) and not sys.dont_write_bytecode:
        halves = [multiprocessing.get_context("fork").Process(target=compile_tests, args=(config, k)) for k in (0, 1)]
        for half in halves:
            half.start()
        for half in halves:
            half.join()


def pytest_collection_finish() -> None:
    """Freeze imported and collected objects: the garbage collector skips them and runs less often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadFileScheduling:
    """Each file runs in a single process, and all files that need a browser in the same process."""

    class Files(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "tests/e2e" if file.startswith("tests/e2e/") else file

    return Files(config, log)


def compile_tests(config: pytest.Config, first: int) -> None:
    """Every second test module with its assertions rewritten, as pytest stores it: a clean checkout has none of them.

    pytest offers no name for it; without it each of its processes does the work of all.
    """
    for path in sorted(Path(__file__).parent.rglob("test_*.py"))[first::2]:
        stored = rewrite.get_cache_dir(path) / (path.stem + rewrite.PYC_TAIL)
        if rewrite._read_pyc(path, stored) is None:
            stored.parent.mkdir(exist_ok=True)
            source_hash, code = rewrite._rewrite_test(path, config)
            rewrite._write_pyc(config.stash[rewrite.assertstate_key], code, source_hash, stored)


def some_of(cases: Sequence[Any], default: int) -> list[Any]:
    """Return cases for `parametrize`, a tuple for several names: the default run takes the first ``default`` of them."""
    marks = [[pytest.mark.wide] * (k >= default) for k, _ in enumerate(cases)]
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark) for case, mark in zip(cases, marks)
    ]


def changed(body: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A copy of a request with other values at some places, such as ``design.l2``; ``-design.l2`` removes it."""
    body = copy.deepcopy(body)
    for path, value in changes.items():
        *parents, last = path.removeprefix("-").split(".")
        at = reduce(lambda part, name: part[int(name) if isinstance(part, list) else name], parents, body)
        if path.startswith("-"):
            at.pop(last, None)
        else:
            at[last] = value
    return body


def ticking(seconds: float) -> Callable[[float | None], Work]:
    """Return a function that starts work whose clock advances by some seconds at each reading, the same everywhere."""
    return lambda budget: Work(budget, clock=count(step=seconds).__next__)


COUNTED_BUDGETS = (5, 18, 40, 78, 160, 500)
"""Budgets of work that is ``ticking(1.0)``: its clock counts how often it is read."""


def never_rising(errors: Sequence[float]) -> bool:
    """Check that no error is 1 % above an earlier error; errors below 1e-9 are rounding."""
    smallest = math.inf
    for error in errors:
        if max(error, 1e-9) > 1.01 * smallest:
            return False
        smallest = min(smallest, max(error, 1e-9))
    return True


def finite(value: Any) -> bool:
    """Return true if all numbers of a reply are finite; NaN and infinities are written as words."""
    if isinstance(value, dict | list):
        return all(map(finite, value.values() if isinstance(value, dict) else value))
    return value not in ("NaN", "Infinity", "-Infinity") and not (
        isinstance(value, float) and not math.isfinite(value)
    )


@contextmanager
def listening(app: Any, **options: Any) -> Iterator[tuple[int, uvicorn.Server]]:
    """A real server in this process: its port, and itself. It has ended afterwards."""
    server = uvicorn.Server(uvicorn.Config(app, log_config=None, **options))
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        until(lambda: server.started or not thread.is_alive())
        assert server.started
        yield listener.getsockname()[1], server
        server.should_exit = True
        thread.join(PATIENCE)
        assert not thread.is_alive()


@contextmanager
def started(folder: Path, *command: str, **settings: Any) -> Iterator[tuple[subprocess.Popen[str], int, Path]]:
    """Run a service as a process with exactly these settings: process, port and log. It ends well afterwards."""
    log = folder / "log"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LINKAGE_ATLAS_")}
    environment |= {f"LINKAGE_ATLAS_{name.upper()}": str(value) for name, value in settings.items()}
    arguments, root = [sys.executable, *command], Path(__file__).parents[1]
    with log.open("w") as file:
        process = subprocess.Popen(arguments, cwd=root, env=environment, stdout=file, stderr=file, text=True)
    try:
        pattern = r"running on http://127.0.0.1:(\d+)"
        found = until(lambda: re.search(pattern, log.read_text()) or process.poll() is not None)
        assert found is not True, log.read_text()
        yield process, int(found[1]), log
    finally:
        process.terminate()
        assert process.wait(PATIENCE) == 0


def atlas_bytes(rule: AtlasRule) -> bytes:
    """Return the file of an atlas, made without the batch."""
    lengths = rule.lengths()
    return encode_atlas(rule, compute_features(lengths, rule.samples), compute_series(lengths))


@pytest.fixture(scope="session")
def atlas_path(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The file of the default atlas; the first of the xdist workers builds it, the others wait."""
    folder = tmp_path_factory.getbasetemp()
    folder = folder if worker_id == "master" else folder.parent
    path = folder / "default_atlas.h5"
    with (folder / "default_atlas.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            with executor(1) as pool:
                build_atlas(AtlasRule(), path, pool)
    return path


@pytest.fixture(scope="session")
def small_bytes() -> bytes:
    """Return the file of an atlas of crank-rockers and double-cranks of perimeter 60, 32 samples."""
    return atlas_bytes(AtlasRule(TypeRule(60, 2, OrderRule.FULL_CRANK), 32))


@pytest.fixture(scope="session")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """Start the service for requests that need no atlas; its atlas does not exist, whatever lies in the working
    folder.
    """
    settings = Settings(atlas=tmp_path_factory.mktemp("service") / "none.h5", workers=1)
    with TestClient(create_app(settings)) as client:
        yield client
