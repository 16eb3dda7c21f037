"""Commands on a Dask cluster that loses a worker write the bytes of a single process.

A lost or doubled chunk after the death of a worker would show here.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from app.cli import main
from data_build.batch import build_atlas, dask_executor
from tests.app.test_study import study
from tests.conftest import PATIENCE
from tests.data_build.conftest import RULE

ROOT = Path(__file__).parents[2]
REQUESTS = 24


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers as processes of their own; a worker that is killed is started again."""
    distributed = pytest.importorskip("distributed")  # here: every process of the tests reads this file
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options, worker_dashboard_address=None, silence_logs=50) as cluster:
        yield cluster


def command(*words: object) -> subprocess.Popen[str]:
    arguments = [sys.executable, "-m", "app.start", *map(str, words)]
    return subprocess.Popen(arguments, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def bytes_in(folder: Path) -> int:
    """Count the bytes of all files; a file may disappear meanwhile."""
    size = 0
    for file in folder.glob("**/*"):
        with contextlib.suppress(FileNotFoundError):
            size += file.stat().st_size * file.is_file()
    return size


def lose_a_worker(cluster: Any, process: subprocess.Popen[str], after: Path, size: int) -> None:
    """Kill the computing worker once a number of bytes of a result are written; the command still ends well."""
    while bytes_in(after) < size:
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.01)
    os.kill(next(iter(cluster.workers.values())).process.pid, signal.SIGKILL)
    assert process.poll() is None, "it was killed in the middle"
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, output


def test_a_build_that_loses_a_worker_gives_the_same_bytes(cluster, expected_bytes, out) -> None:
    lost: list[int] = []

    def lose_one(done: int, total: int) -> None:
        if done < total and not lost:
            lost.append(next(iter(cluster.workers.values())).process.pid)
            os.kill(lost[0], signal.SIGKILL)

    with dask_executor(cluster.scheduler_address) as executor:
        build_atlas(RULE, out, executor, lose_one)
    assert lost and out.read_bytes() == expected_bytes
    options = ["--perimeter", "60", "--scheduler", cluster.scheduler_address, "--out", str(out)]
    assert main(["build", *options]) == 0 and len(la.load_atlas(out)) == 192


def test_a_study_that_loses_a_worker_gives_the_same_bytes(cluster, tmp_path) -> None:
    rng, rows = np.random.default_rng(5), []
    for _ in range(REQUESTS):
        crank = la.FourBar(1, *rng.uniform(2, 3, 2), 2.9, start_angle=rng.uniform(0, 360))
        rows.append({"rotation": crank.joints(np.linspace(0, 90, 9)).rotation.tolist(), "crank_span": 90, "top": 1})
    requests, folder = tmp_path / "requests.ndjson", tmp_path / "beside"
    requests.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert study(requests, "--jobs", "1", "--out", tmp_path / "alone.ndjson") == 0
    folder.mkdir()
    process = command("study", requests, "--scheduler", cluster.scheduler_address, "--out", folder / "out.ndjson")
    lose_a_worker(cluster, process, folder, 5_000)
    assert (folder / "out.ndjson").read_bytes() == (tmp_path / "alone.ndjson").read_bytes()
    found = [list(la.study(rows[:4], **where)) for where in ({"jobs": 1}, {"scheduler": cluster.scheduler_address})]
    assert found[0] == found[1], "from Python too"
