"""Studies as a user runs them: each result is the single request's, bad lines are named, kills lose and double nothing."""

import io
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest

import linkage_atlas as la
from app import cli
from app.terminal import Exit
from tests.conftest import PATIENCE

ROOT = Path(__file__).parents[2]
TIMES = ("elapsed_ms", "trace")


def rotations(count: int) -> list[dict]:
    """Plain requests: motions of random linkages, met exactly within milliseconds."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(count):
        crank = la.FourBar(1, *rng.uniform(2, 3, 2), 2.9, start_angle=rng.uniform(0, 360))
        span = float(rng.uniform(40, 200))
        rotation = crank.joints(np.linspace(0, span, 9)).rotation.tolist()
        found.append({"rotation": rotation, "crank_span": span, "top": 1})
    return found


@pytest.fixture
def requests(tmp_path) -> Path:
    path = tmp_path / "requests.ndjson"
    path.write_text("".join(json.dumps(line) + "\n" for line in rotations(6)))
    return path


def study(*arguments: object) -> int:
    handlers = [signal.getsignal(name) for name in (signal.SIGTERM, signal.SIGINT)]
    try:
        return cli.main(["study", *map(str, arguments)])
    finally:
        for name, handler in zip((signal.SIGTERM, signal.SIGINT), handlers):
            signal.signal(name, handler)


def test_each_result_is_the_single_requests(requests, tmp_path, capsys, monkeypatch) -> None:
    out = tmp_path / "results.ndjson"
    assert study(requests, "--out", out, "--jobs", 1) == Exit.OK
    assert "6 requests, 6 answered" in capsys.readouterr().err
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    for row, request in list(zip(lines, requests.read_text().splitlines()))[::2]:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(request.encode())))
        assert cli.main(["synthesize", "--json"]) == Exit.OK
        single = json.loads(capsys.readouterr().out)
        for name in TIMES:
            del single["report"][name]
        assert single.pop("request") == json.loads(request)
        assert row["reply"] == single


def test_a_bad_line_has_one_line_of_error(tmp_path, capsys) -> None:
    path, out = tmp_path / "requests.ndjson", tmp_path / "results.ndjson"
    good = json.dumps({"alpha2": 9})
    bad = ["nonsense", '{"alpha2": "9"}', "[1]", '{"alpha2": NaN}', '{"nothing": 1}', "x,y", "\xff\xfe"]
    path.write_text("\n".join(["", good, *bad, "", good]), encoding="latin1")
    assert study(path, "--out", out, "--command", "knotter needle", "--jobs", 1) == Exit.FAILED
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert [row["line"] for row in rows] == [2, 3, 4, 5, 6, 7, 8, 9, 11]
    assert ["error" in row for row in rows] == [False, *[True] * 7, False]
    assert rows[2]["error"].startswith("alpha2: ") and rows[0]["reply"] == rows[-1]["reply"]
    assert "9 requests, 2 answered, 7 refused; the first: line 3: " in capsys.readouterr().err


def killed_and_resumed(requests: Path, out: Path, kills: int, jobs: int, seed: int) -> int:
    """Run a study, killing it at random moments; return the number of kills that met it at work."""
    rng = random.Random(seed)
    command = [sys.executable, "-m", "app.start", "study", str(requests), "--out", str(out), "--jobs", str(jobs)]
    command.append("--no-preset")
    total = len(requests.read_text().splitlines())
    met = 0
    for kill in range(kills + 1):
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=PIPE, stderr=PIPE)
        if kill < kills:
            size = out.stat().st_size if out.exists() else 0
            share = (total - (out.read_bytes().count(b"\n") if size else 0)) / (kills - kill + 1)
            expected = size + int(rng.uniform(0.05, 0.5) * share * 900)
            while process.poll() is None and (out.stat().st_size if out.exists() else 0) < expected:
                time.sleep(0.001)
            time.sleep(rng.uniform(0, 0.02))
            process.kill()
        messages = process.communicate(timeout=PATIENCE)[1].decode()
        met += process.returncode == -signal.SIGKILL
        assert "Traceback" not in messages
    assert process.returncode == 0, messages
    return met


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of a file's size")
def test_a_study_goes_on_once_a_full_disk_has_room_again(requests, tmp_path) -> None:
    import resource

    expected, out = tmp_path / "wanted.ndjson", tmp_path / "results.ndjson"
    assert study(requests, "--out", expected, "--jobs", 1) == Exit.OK
    size, command = expected.stat().st_size, [sys.executable, "-m", "app.start", "study", requests, "--out", out]
    for largest, code, reported in ((size // 2, Exit.FAILED, "cannot write"), (2 * size, Exit.OK, "answered")):
        limits = lambda largest=largest: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))  # noqa: E731
        options = {"cwd": ROOT, "capture_output": True, "text": True, "preexec_fn": limits}
        done = subprocess.run([*command, "--jobs", "1"], **options, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
        assert (done.returncode, reported in done.stderr) == (code, True), done.stderr
    assert out.read_bytes() == expected.read_bytes()


@pytest.mark.fault
def test_a_hundred_kills_change_no_byte(tmp_path) -> None:
    requests = tmp_path / "requests.ndjson"
    requests.write_text("".join(json.dumps(line) + "\n" for line in rotations(10_000)))
    expected, out = tmp_path / "wanted.ndjson", tmp_path / "results.ndjson"
    assert study(requests, "--out", expected, "--jobs", 2, "--no-preset") == Exit.OK
    assert killed_and_resumed(requests, out, 100, 2, 2) >= 90
    assert out.read_bytes() == expected.read_bytes()


def test_an_interrupt_ends_a_study_that_can_be_gone_on_with(tmp_path) -> None:
    requests, out = tmp_path / "requests.ndjson", tmp_path / "results.ndjson"
    requests.write_text("".join(json.dumps(line) + "\n" for line in rotations(400)))
    command = [sys.executable, "-m", "app.start", "study", str(requests), "--out", str(out), "--jobs", "2"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=PIPE, stderr=PIPE)
    while process.poll() is None and not (out.exists() and out.stat().st_size):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    messages = process.communicate(timeout=PATIENCE)[1].decode()
    assert process.returncode == Exit.INTERRUPTED
    assert messages.strip() == "interrupted; run the same command again to continue"
    done = out.read_bytes()
    assert done.endswith(b"\n") and 0 < done.count(b"\n") < 400
