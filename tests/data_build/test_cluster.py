"""Commands on a Dask cluster that loses a worker write the bytes of a single process.

A lost or doubled chunk after the death of a worker would show here.
"""

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import linkage_atlas as la
from app.cli import main
from app.study import Question, answer_line, answers
from data_build.batch import build_atlas
from data_build.processes import executor
from tests.data_build.conftest import RULE

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers as processes of their own; a worker that is killed is started again."""
    distributed = pytest.importorskip("distributed")  # here: every process of the tests reads this file
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options, worker_dashboard_address=None, silence_logs=50) as cluster:
        yield cluster


def losing_a_worker(cluster: Any, lost: list[int]) -> Callable[[int, int], None]:
    """Return a report of progress that kills a worker after the first step."""

    def lose_one(done: int, total: int) -> None:
        if done < total and not lost:
            lost.append(next(iter(cluster.workers.values())).process.pid)
            os.kill(lost[0], signal.SIGKILL)

    return lose_one


def test_a_build_that_loses_a_worker_gives_the_same_bytes(cluster, expected_bytes, out) -> None:
    lost: list[int] = []
    with executor(1, cluster.scheduler_address) as pool:
        build_atlas(RULE, out, pool, losing_a_worker(cluster, lost))
    assert lost and out.read_bytes() == expected_bytes
    options = ["--perimeter", "60", "--scheduler", cluster.scheduler_address, "--out", str(out)]
    assert main(["build", *options]) == 0 and len(la.load_atlas(out)) == 192


def square(question: Question) -> bytes:
    time.sleep(0.1)
    return answer_line(question, {"square": int(question.text) ** 2})


def test_a_study_that_loses_a_worker_gives_the_same_answers(cluster, tmp_path) -> None:
    questions, lost = [Question(k + 1, b"%d" % k, f"{k:04x}") for k in range(20)], []
    lose = losing_a_worker(cluster, lost)
    lines = []
    for line in answers(square, questions, tmp_path / "answers", 1, cluster.scheduler_address):
        lines.append(line)
        lose(len(lines), len(questions))
    assert lines == [square(question) for question in questions] and lost
