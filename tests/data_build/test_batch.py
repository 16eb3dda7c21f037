"""The build: the same bytes however it is run, resumable, atomic, and its command line."""

import contextlib
import errno
import hashlib
import io
import json
import os
import pty
import random
import resource
import signal
import subprocess
import termios
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from data_build import batch
from data_build.batch import BuildLocked, build_atlas, compute_shard, local_executor
from data_build.cli import EXIT_DAMAGED, EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, EXIT_USAGE, main
from synthesis.atlas.file import encode_atlas, load_atlas, write_image
from synthesis.atlas.table import COLUMNS, CURVE, UNITS, AtlasRule
from synthesis.fourbar.dimension_types import TypeRule, count_types, enumerate_types
from tests.conftest import PATIENCE, make_atlas, some_of, until
from tests.data_build.conftest import OPTIONS, RULE, Here, left_in, start

SLOW = ["--perimeter", "400", "--samples", "64", "--jobs", "2"]
BRIEF = ["--perimeter", "300", "--samples", "32", "--jobs", "2"]


@pytest.fixture
def command() -> Iterator:
    """The command line in this process; puts the signal handler back."""
    before = signal.getsignal(signal.SIGTERM)
    yield lambda *arguments: main([str(argument) for argument in arguments])
    signal.signal(signal.SIGTERM, before)


# -- the same bytes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 3])
def test_number_of_jobs_changes_no_byte(jobs, out, wanted) -> None:
    seen: list[tuple[int, int]] = []
    with local_executor(jobs) as executor:
        built = build_atlas(RULE, out, executor, lambda *counts: seen.append(counts))
    assert out.read_bytes() == wanted and left_in(out.parent) == ["atlas.h5"]
    atlas = load_atlas(out)
    assert built == (len(atlas), atlas.content_hash(), atlas.curve_error.max(), atlas.generator)
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]


def test_a_shard_is_a_pure_function() -> None:
    assert compute_shard(RULE, 2) == compute_shard(RULE, 2)
    sizes = [len(np.load(io.BytesIO(compute_shard(RULE, shard)))["average"]) for shard in range(3)]
    assert sizes[:2] == [batch.SHARD_TYPES] * 2 and sum(sizes) == len(enumerate_types(RULE.types))


def test_no_types_give_an_atlas_without_types(out) -> None:
    build_atlas(AtlasRule(TypeRule(10, 9), 16), out, Here())
    assert len(load_atlas(out)) == 0


def in_one_step(atlas) -> bytes:
    """The file of an atlas, each array written whole into an image in memory."""
    with h5py.File.in_memory(libver=("v110", "v110")) as file:
        own = {"schema": 1, "rule": json.dumps(atlas.rule.as_json(), sort_keys=True), "curve": CURVE}
        own |= {"normalisation": "mean", "levels": int(np.log2(atlas.samples)), "samples": atlas.samples}
        own |= {"generator": json.dumps(atlas.generator, sort_keys=True), "content_sha256": atlas.content_hash()}
        file.attrs.update(own)
        for name, dtype in COLUMNS.items():
            values = getattr(atlas, name).astype(dtype)
            chunks = (min(len(values), (1 << 20) // values[:1].nbytes), *values.shape[1:])
            options = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
            dataset = file.create_dataset(name, data=values, track_times=False, chunks=chunks, **options)
            dataset.attrs["units"] = UNITS[name]
        file.flush()
        image = file.id.get_file_image()
    header = f"linkage-atlas 1\nsha256 {hashlib.sha256(image).hexdigest()}\nbytes {len(image)}\n"
    return header.encode().ljust(511) + b"\n" + image


@pytest.mark.parametrize(("perimeter", "samples"), [(140, 16), (200, 256)])
def test_columns_in_parts_give_the_file_of_whole_ones(perimeter, samples, tmp_path) -> None:
    """Chunks of the image and parts of a column end in different places; of many chunks of details HDF5 puts others between."""
    rule = AtlasRule(TypeRule(perimeter, 2), samples)
    atlas = make_atlas(rule)
    wanted = in_one_step(atlas)
    assert encode_atlas(atlas) == wanted
    for size in (1000, len(atlas))[: 1 + (samples == 16)]:

        def parts(name: str, size: int = size) -> list[np.ndarray]:
            column = getattr(atlas, name)
            return [column[first : first + size] for first in range(0, len(column), size)]

        header, content = write_image(tmp_path / "image", rule, atlas.generator, parts)
        assert header.encode() + (tmp_path / "image").read_bytes() == wanted
        assert content == atlas.content_hash()


def test_a_part_that_changes_while_the_file_is_written_is_noticed(out, wanted) -> None:
    def damage(done: int, total: int) -> None:
        if done == total:
            part = out.with_name("atlas.h5.parts") / "shard-000001"
            data = bytearray(part.read_bytes())
            data[len(data) // 2] ^= 1
            part.write_bytes(data)

    with pytest.raises(OSError, match="has changed since it was written"):
        build_atlas(RULE, out, Here(), damage)
    assert not out.exists()
    build_atlas(RULE, out, Here())
    assert out.read_bytes() == wanted


def test_a_build_holds_some_shards_and_not_the_table(out, monkeypatch) -> None:
    """Ten times the types take no more memory: what a shard is made of, and what waits to be written."""
    monkeypatch.setattr(batch, "SHARD_TYPES", 256)
    monkeypatch.setattr(batch, "_SUBMITTED", 4)
    peaks = []
    for perimeter in (100, 220):
        rule = AtlasRule(TypeRule(perimeter, 2), 64)
        tracemalloc.start()
        build_atlas(rule, out, Here())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert count_types(rule.types) > 10 * count_types(TypeRule(100, 2)) and peaks[1] < 1.5 * peaks[0]


# -- resuming ---------------------------------------------------------------------------------------------------------


def test_a_build_goes_on_from_its_parts(out, wanted) -> None:
    out.with_name("atlas.h5.parts").mkdir()
    for shard in (0, 1):  # as_completed gives finished ones in no order: put two parts there by hand
        parts = batch._Parts(out.with_name("atlas.h5.parts"), RULE)
        parts.write(shard, compute_shard(RULE, shard))
    again = Here()
    build_atlas(RULE, out, again)
    assert again.ran == [2] and out.read_bytes() == wanted and left_in(out.parent) == ["atlas.h5"]


@pytest.mark.parametrize("damage", ["flip", "cut", "empty", "other_rule", "swapped", "folder_of_temporaries"])
def test_damaged_parts_are_made_again(damage, out, wanted) -> None:
    folder = out.with_name("atlas.h5.parts")
    folder.mkdir()
    parts = batch._Parts(folder, AtlasRule(TypeRule(200, 3), 16) if damage == "other_rule" else RULE)
    for shard in range(3):
        parts.write(shard, compute_shard(RULE, shard))
    part = folder / "shard-000001"
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    changed = {"flip": data, "cut": data[:-5], "empty": b"", "swapped": (folder / "shard-000000").read_bytes()}
    if damage in changed:
        part.write_bytes(changed[damage])
    (folder / ".shard-000002.77.tmp").write_bytes(b"half")
    again = Here()
    build_atlas(RULE, out, again)
    assert again.ran == {"other_rule": [0, 1, 2], "folder_of_temporaries": []}.get(damage, [1])
    assert out.read_bytes() == wanted and left_in(out.parent) == ["atlas.h5"]


def test_a_failing_worker_leaves_the_old_file(out) -> None:
    with pytest.raises(RuntimeError, match="worker lost"):
        build_atlas(RULE, out, Here(failing=1))
    assert not out.exists()
    out.write_bytes(b"old")
    with pytest.raises(RuntimeError, match="worker lost"):
        build_atlas(RULE, out, Here(failing=1))
    assert out.read_bytes() == b"old" and left_in(out.parent) == ["atlas.h5", "atlas.h5.parts"]


def test_a_second_builder_is_turned_away(out, wanted, command, capsys) -> None:
    codes: list[int] = []

    def second(done: int, total: int) -> None:
        if done == 0:
            with pytest.raises(BuildLocked, match=r"atlas\.h5 is running"):
                build_atlas(RULE, out, Here())
            codes.append(command("build", "--out", out, *OPTIONS, "--jobs", 1))

    build_atlas(RULE, out, Here(), second)
    assert codes == [EXIT_USAGE] and "another build" in capsys.readouterr().err
    assert out.read_bytes() == wanted
    build_atlas(RULE, out, Here())  # the lock is free again


def test_only_its_own_leftovers_are_removed(out) -> None:
    mine = [".atlas.h5.4711.tmp"]
    others = [".atlas.h5.new.4711.tmp", ".atlas.h5.tmp", ".other.4711.tmp"]
    for name in mine + others:
        (out.parent / name).write_bytes(b"half")
    build_atlas(RULE, out, Here())
    assert left_in(out.parent) == sorted(["atlas.h5", *others])


# -- a full disk ------------------------------------------------------------------------------------------------------


def test_a_disk_that_cannot_sync_leaves_the_old_file(out, command, capsys, monkeypatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    out.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", full)
    assert command("build", "--out", out, *OPTIONS, "--jobs", 1) == EXIT_FAILED
    assert "No space left" in capsys.readouterr().err
    assert out.read_bytes() == b"old" and left_in(out.parent) == ["atlas.h5", "atlas.h5.parts"]


@pytest.mark.parametrize("limit", [100, 100_000], ids=["first_part", "the_file"])
def test_a_disk_that_fills_up_leaves_the_old_file(limit, out, wanted) -> None:
    out.write_bytes(b"old")
    if limit > 100:
        with pytest.raises(OSError):  # leaves all parts, so that only the file itself is too large
            build_atlas(RULE, out.parent / "atlas.h5", Here(), _raise_when_done)
    build = start(
        *["--out", out, *OPTIONS, "--jobs", 1],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # compiled modules would be cut short too, and stay so
    )
    _, errors = build.communicate(timeout=PATIENCE)
    assert build.returncode == EXIT_FAILED and errors.startswith("cannot write") and "Traceback" not in errors
    assert out.read_bytes() == b"old" and left_in(out.parent) == ["atlas.h5", "atlas.h5.parts"]
    assert not list(out.with_name("atlas.h5.parts").glob(".*"))
    build_atlas(RULE, out, Here())
    assert out.read_bytes() == wanted


def _raise_when_done(done: int, total: int) -> None:
    if done == total:
        raise OSError("stop here")


# -- the command line -------------------------------------------------------------------------------------------------


def test_build_verify_and_info(out, wanted, command, capsys) -> None:
    assert command("build", "--out", out, *OPTIONS, "--jobs", 1, "--json") == EXIT_OK
    captured = capsys.readouterr()
    built = json.loads(captured.out)
    assert captured.err == "", "a progress bar where there is no terminal"
    assert out.read_bytes() == wanted
    assert (built["file"], built["bytes"], built["rule"]) == (str(out), len(wanted), RULE.as_json())
    assert built["types"] == len(enumerate_types(RULE.types))
    assert built["content_sha256"] == load_atlas(out).content_hash()
    for name, extra in (("verify", {"status": "sound"}), ("info", {"bytes": len(wanted)})):
        assert command(name, out, "--json") == EXIT_OK
        told = json.loads(capsys.readouterr().out)
        assert told.items() >= extra.items() and all(told[key] == built[key] for key in set(told) - {"status"})
        assert command(name, out) == EXIT_OK
        assert f"{built['types']:,}" in capsys.readouterr().out


def test_damaged_files_exit_3(out, command, capsys) -> None:
    out.write_bytes(encode_atlas(make_atlas(AtlasRule(TypeRule(60), 16)))[:-1])
    for name in ("verify", "info"):
        assert command(name, out) == EXIT_DAMAGED
        captured = capsys.readouterr()
        assert captured.out == "" and "checksum" in captured.err and str(out) in captured.err
        assert command(name, out.with_name("none.h5")) == EXIT_USAGE
        assert "no atlas file" in capsys.readouterr().err


WRONG = {"--perimeter 3": "perimeter", "--perimeter many": "perimeter", "--perimeter 10000": "bytes of details"}
WRONG |= {"--smallest 0": "smallest", "--samples 100": "power of two", "--order any": "order"}
WRONG |= {"--jobs 0": "at least 1", "--out no/such/folder/atlas.h5": "no folder", "--colour": "colour"}


@pytest.mark.parametrize("arguments", WRONG)
def test_wrong_usage_exits_2(arguments, command, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        code = command("build", *arguments.split())
    except SystemExit as leaving:  # argparse leaves by itself
        code = leaving.code
    assert code == EXIT_USAGE and WRONG[arguments] in capsys.readouterr().err and left_in(tmp_path) == []


def test_a_terminal_gets_a_progress_bar(out) -> None:
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))
    build = start("--out", out, *OPTIONS, "--jobs", 1, stderr=theirs)
    os.close(theirs)
    drawn = b""
    with contextlib.suppress(OSError):  # what Linux says when the other side is closed
        while more := os.read(ours, 1 << 16):
            drawn += more
    build.communicate(timeout=PATIENCE)
    os.close(ours)
    drawn = drawn.decode()
    assert build.returncode == EXIT_OK and "shard" in drawn and "100%" in drawn


@pytest.mark.parametrize("sent", some_of([signal.SIGTERM, signal.SIGINT], 1))
def test_an_interrupted_build_exits_130_and_keeps_its_parts(sent, out) -> None:
    build = start("--out", out, *SLOW)
    parts = out.with_name("atlas.h5.parts")
    until(lambda: list(parts.glob("shard-*")) or build.poll() is not None)
    build.send_signal(sent)
    told, errors = build.communicate(timeout=PATIENCE)
    assert build.returncode == EXIT_INTERRUPTED, errors
    assert told == "" and errors == "interrupted; the same command goes on from here\n"
    assert not out.exists() and list(parts.glob("shard-*"))


# -- kills ------------------------------------------------------------------------------------------------------------


def processes_with(mark: str) -> list[int]:
    """Processes that inherited an environment variable."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            ended = "State:\tZ" in (folder / "status").read_text()
            if not ended and mark.encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def build_whole(out: Path) -> None:
    build = start("--out", out, *BRIEF)
    _, errors = build.communicate(timeout=PATIENCE)
    assert build.returncode == EXIT_OK, errors


@pytest.mark.fault
def test_200_kills_end_in_the_identical_file(tmp_path) -> None:
    reference = tmp_path / "reference" / "atlas.h5"
    reference.parent.mkdir()
    began = time.monotonic()
    build_whole(reference)
    whole = time.monotonic() - began
    wanted = reference.read_bytes()
    out = tmp_path / "atlas.h5"
    mark = f"LINKAGE_ATLAS_TEST={tmp_path}"
    rng = random.Random(1)
    kills = finished = 0
    while kills < 200:
        build = start("--out", out, *BRIEF, env=os.environ | dict([mark.split("=", 1)]))
        try:
            build.wait(rng.uniform(0.1, 1.2) * whole)
        except subprocess.TimeoutExpired:
            kills += 1
            build.kill()
        build.communicate()
        until(lambda: not processes_with(mark))
        assert not out.exists() or out.read_bytes() == wanted
        if build.returncode == EXIT_OK:
            finished += 1
            assert out.exists() and left_in(tmp_path) == ["atlas.h5", "reference"]
            out.unlink()
    build_whole(out)
    assert out.read_bytes() == wanted and left_in(tmp_path) == ["atlas.h5", "reference"]
    assert finished > 0
