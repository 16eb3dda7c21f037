"""What tests of the batch share: a rule of three shards, its file, and the command in a process of its own."""

import signal
import subprocess
import sys
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from synthesis.atlas.file import encode_atlas
from synthesis.atlas.table import AtlasRule
from synthesis.fourbar.dimension_types import TypeRule
from tests.conftest import make_atlas

ROOT = Path(__file__).parents[2]
RULE = AtlasRule(TypeRule(200, 2), 16)
"""Three shards."""
OPTIONS = ["--perimeter", "200", "--smallest", "2", "--samples", "16"]


class Here(Executor):
    """Runs shards at once in this thread, notes which, and fails at one of them."""

    def __init__(self, failing: int | None = None) -> None:
        self.failing = failing
        self.ran: list[int] = []

    def submit(self, function, rule, shard):
        future: Future = Future()
        if shard == self.failing:
            future.set_exception(RuntimeError("worker lost"))
        else:
            self.ran.append(shard)
            future.set_result(function(rule, shard))
        return future


@pytest.fixture(scope="session")
def wanted() -> bytes:
    """The file of `RULE`, without the batch."""
    return encode_atlas(make_atlas(RULE))


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "atlas.h5"


def start(*arguments: object, **options) -> subprocess.Popen:
    """The command line in a process of its own."""
    # shells start background jobs with SIGINT ignored, which children inherit: what is tested here is that it interrupts
    usual = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL), "text": True}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | usual | options
    return subprocess.Popen([sys.executable, "-m", "data_build", *map(str, arguments)], cwd=ROOT, **pipes)


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
