"""Fixtures of the tests of the batch: the command in a process of its own, and the file that it must write."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from synthesis.atlas.table import AtlasRule
from synthesis.fourbar.dimension_types import TypeRule
from tests.conftest import atlas_bytes

ROOT = Path(__file__).parents[2]
RULE = AtlasRule(TypeRule(200, 2), 16)
"""Three chunks."""
OPTIONS = ["--perimeter", "200", "--smallest", "2", "--samples", "16"]


@pytest.fixture(scope="session")
def expected_bytes() -> bytes:
    """Return the file of `RULE`, made without the batch."""
    return atlas_bytes(RULE)


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "atlas.h5"


def start(*arguments: object, **options) -> subprocess.Popen:
    """Start the batch in a process of its own."""
    # shells start background jobs with SIGINT ignored, which children inherit
    usual = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL), "text": True}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | usual | options
    return subprocess.Popen([sys.executable, "-m", "app.start", "build", *map(str, arguments)], cwd=ROOT, **pipes)
