"""What may go wrong around a build: places that are no files, full disks, signals at any time, readers that leave."""

import errno
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from data_build import batch
from data_build.batch import build_atlas, local_executor
from data_build.cli import EXIT_INTERRUPTED, EXIT_OK, EXIT_USAGE, main
from synthesis.atlas.file import encode_atlas
from synthesis.atlas.table import AtlasRule
from synthesis.errors import FieldError
from synthesis.fourbar.dimension_types import TypeRule, count_types
from tests.conftest import PATIENCE, make_atlas
from tests.data_build.conftest import OPTIONS, ROOT, RULE, Here, left_in, start


@pytest.mark.parametrize("kind", ["fifo", "folder", "device", "link to a device", "link to nowhere", "link"])
def test_only_regular_files_are_replaced(kind, out, wanted, capsys, monkeypatch) -> None:
    device = out.with_name("device")
    target = out.with_name("target.h5")
    if kind == "fifo":
        os.mkfifo(out)
    elif kind == "folder":
        out.mkdir()
    elif kind.startswith("link"):
        target.write_bytes(b"old") if kind == "link" else None
        out.symlink_to("/dev/null" if kind == "link to a device" else target)
    else:
        out, device = Path("/dev/null"), out
    code = main(["build", "--out", str(out), *OPTIONS, "--jobs", "1"])
    if kind in ("link", "link to nowhere"):
        assert code == EXIT_OK and out.is_symlink() and target.read_bytes() == wanted
    else:
        assert code == EXIT_USAGE and "no regular file" in capsys.readouterr().err
        assert not Path("/dev/null").is_file() and not list(device.parent.glob("*.parts"))


def test_a_target_that_became_a_device_is_not_replaced(out) -> None:
    def become_a_fifo(done: int, total: int) -> None:
        if done == total:
            os.mkfifo(out)

    with pytest.raises(FieldError, match="no regular file"), local_executor(1) as executor:
        build_atlas(RULE, out, executor, become_a_fifo)
    assert not out.is_file()


def test_folders_in_place_of_shards_are_made_again(out, wanted) -> None:
    parts = out.with_name("atlas.h5.parts")
    (parts / "shard-000001" / "deeper").mkdir(parents=True)
    build_atlas(RULE, out, Here())
    assert out.read_bytes() == wanted and left_in(out.parent) == ["atlas.h5"]


def test_a_closed_output_ends_quietly_with_the_file_kept(out, wanted) -> None:
    build = start("--out", out, *OPTIONS, "--jobs", 1, "--json")
    build.stdout.close()
    with build.stderr:
        assert build.wait(PATIENCE) == EXIT_OK and build.stderr.read() == ""
    assert out.read_bytes() == wanted


def test_a_stop_is_heeded_between_shards_and_before_the_file_is_written(out) -> None:
    for after in range(3):
        shutil.rmtree(out.with_name("atlas.h5.parts"), ignore_errors=True)
        answers = [False] * after + [True]
        with pytest.raises(KeyboardInterrupt):
            build_atlas(RULE, out, Here(), stopped=lambda answers=answers: answers.pop(0))
        assert not out.exists() and not answers


def test_an_interrupt_inside_a_callback_is_not_lost(out) -> None:
    """A weak reference's callback swallows every exception: the signal must be no exception there."""
    script = (
        "import os, signal, sys, weakref\n"
        "from data_build import batch, cli\n"
        "class Thing: pass\n"
        "plain = batch._Parts.write\n"
        "def write(self, shard, payload):\n"
        "    plain(self, shard, payload)\n"
        "    thing = Thing()\n"
        "    ref = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGINT))\n"
        "    del thing\n"
        "batch._Parts.write = write\n"
        "raise SystemExit(cli.main(sys.argv[1:]))\n"
    )
    arguments = [sys.executable, "-c", script, "build", "--out", str(out), *OPTIONS, "--jobs", "1"]
    done = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == EXIT_INTERRUPTED and "Exception ignored" not in done.stderr, done.stderr


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(("entry", "command"), [("data_build", []), ("app.start", ["match"])])
def test_an_interrupt_while_importing_shows_no_traceback(entry, command, name) -> None:
    script = (
        "import os, runpy, signal, sys, time\n"
        "class Hook:\n"
        "    def find_spec(self, module, *_):\n"
        "        if module == 'pydantic' or module == 'h5py':\n"
        f"            os.kill(os.getpid(), signal.{name}); time.sleep(9)\n"
        "sys.meta_path.insert(0, Hook())\n"
        f"sys.argv = ['x', *{command}, '--help']; runpy.run_module('{entry}', run_name='__main__')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    assert (done.stdout, done.stderr) == ("", "") and done.returncode == -getattr(signal, name)


def test_whichever_write_fails_the_old_file_is_kept(out, monkeypatch) -> None:
    """Every call that may fail on a disk, one after the other: the old file or the new one, and the next build succeeds."""
    rule = AtlasRule(TypeRule(60, 2), 16)
    wanted = encode_atlas(make_atlas(rule))
    monkeypatch.setattr(batch, "SHARD_TYPES", count_types(rule.types) // 3 + 1)
    out.write_bytes(b"old")
    calls = {"left": -1}
    codes = (errno.ENOSPC, errno.EIO)  # in turn

    def failing(plain):
        def call(*arguments, **others):
            calls["left"] -= 1
            if calls["left"] == 0:
                raise OSError(codes[nth % 2], os.strerror(codes[nth % 2]))
            return plain(*arguments, **others)

        return call

    class Disk:
        """A file whose writes may fail."""

        def __init__(self, file) -> None:
            self.file = file
            self.write = failing(file.write)
            self.flush = failing(file.flush)

        def __enter__(self):
            return self

        def __exit__(self, *_) -> None:
            self.file.close()

        def fileno(self) -> int:
            return self.file.fileno()

    plain_open = Path.open

    def opened(path, mode="r", *arguments, **others):
        file = plain_open(path, mode, *arguments, **others)
        return Disk(file) if mode == "wb" else file

    monkeypatch.setattr(Path, "open", opened)
    for name in ("fsync", "posix_fallocate", "truncate"):
        monkeypatch.setattr(os, name, failing(getattr(os, name)))
    monkeypatch.setattr(Path, "replace", failing(Path.replace))
    monkeypatch.setattr(Path, "mkdir", failing(Path.mkdir))
    failures = 0
    for nth in range(1, 60):
        shutil.rmtree(out.with_name("atlas.h5.parts"), ignore_errors=True)  # the whole way again
        calls["left"] = nth
        try:
            build_atlas(rule, out, Here())
        except OSError as error:
            failures += 1
            assert error.errno == codes[nth % 2] and out.read_bytes() in (b"old", wanted)
            continue
        break
    calls["left"] = -1
    build_atlas(rule, out, Here())
    assert out.read_bytes() == wanted and left_in(out.parent) == ["atlas.h5"] and failures >= 10
