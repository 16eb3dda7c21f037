"""A build writes the whole file or nothing, with the same bytes wherever it is computed, and the commands report
the outcome.

Catches a half-written atlas after a kill or on a full disk, bytes that depend on the number of processes, and lost
exit codes.
"""

import errno
import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import linkage_atlas as la
from app.cli import main
from app.terminal import Exit
from data_build import batch
from data_build.batch import build_atlas
from data_build.processes import executor
from tests.conftest import until
from tests.data_build.conftest import OPTIONS, RULE, start


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_bytes_do_not_depend_on_the_processes(expected_bytes, out, jobs: int) -> None:
    done = []
    with executor(jobs) as pool:
        build_atlas(RULE, out, pool, lambda *steps: done.append(steps))
    assert out.read_bytes() == expected_bytes and done == [(1, 3), (2, 3), (3, 3)]
    assert [path.name for path in out.parent.iterdir()] == ["atlas.h5"]


def test_a_failing_chunk_or_a_full_disk_leaves_the_old_file(out, monkeypatch) -> None:
    out.write_bytes(b"old")

    def lost(rule, first):
        raise RuntimeError("worker lost")

    with ThreadPoolExecutor(1) as executor:
        with monkeypatch.context() as patch, pytest.raises(RuntimeError):
            patch.setattr(batch, "compute_chunk", lost)
            build_atlas(RULE, out, executor)

        def full(handle: int) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            build_atlas(RULE, out, executor)
        assert main(["build", *OPTIONS, "--jobs", "1", "--out", str(out)]) == Exit.FAILED
    assert out.read_bytes() == b"old" and [path.name for path in out.parent.iterdir()] == ["atlas.h5"]


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, Exit.INTERRUPTED), (signal.SIGKILL, -signal.SIGKILL)])
def test_a_build_that_is_ended_writes_nothing_and_leaves_no_process(out, how, code) -> None:
    process = start("--jobs", "2", "--out", out)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    workers = until(lambda: len(found := children.read_text().split()) >= 3 and found)
    process.send_signal(how)
    output, errors = process.communicate()
    assert process.returncode == code, (output, errors)
    assert not list(out.parent.iterdir())
    assert "interrupted" in errors or how == signal.SIGKILL
    until(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))


def test_a_link_is_followed_and_what_is_no_file_is_refused(tmp_path, out, capsys) -> None:
    link = tmp_path / "link.h5"
    link.symlink_to(out)
    assert main(["build", "--perimeter", "30", "--jobs", "1", "--out", str(link)]) == Exit.OK
    assert link.is_symlink() and out.is_file() and len(la.load_atlas(link)) > 0
    for wrong in (tmp_path, "/dev/null", tmp_path / "none" / "a.h5"):
        assert main(["build", "--perimeter", "30", "--jobs", "1", "--out", str(wrong)]) == Exit.USAGE
        assert str(Path(wrong).parent if "none" in str(wrong) else wrong) in capsys.readouterr().err


def test_the_commands_say_what_a_file_holds(expected_bytes, out, capsys) -> None:
    out.write_bytes(expected_bytes)
    for command in ("info", "verify"):
        assert main([command, str(out), "--json"]) == Exit.OK
        said = json.loads(capsys.readouterr().out)
        assert (
            said["types"] == RULE.count
            and said["parameters"] == RULE.as_json()
            and said["bytes"] == len(expected_bytes)
        )
        assert said.get("status") == ("sound" if command == "verify" else None)
        assert main([command, str(out)]) == Exit.OK and "perimeter 200" in capsys.readouterr().out
        assert main([command, str(out.with_name("none.h5"))]) == Exit.USAGE
    out.write_bytes(expected_bytes[:-1])
    assert main(["info", str(out)]) == Exit.DAMAGED and "checksum" in capsys.readouterr().err
