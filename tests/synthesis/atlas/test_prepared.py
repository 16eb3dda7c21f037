"""The file of prepared arrays: equal to what was written or an error, whatever happened to it."""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthesis.atlas import prepared
from synthesis.atlas.prepared import Prepared, Writer, make_prepared, open_prepared
from synthesis.atlas.stored import PAGE, DamagedError
from tests.data_build.test_batch import ROOT

KEY = {"of": "a test", "lengths": (5, 8)}
RNG = np.random.default_rng(19)
ARRAYS: dict[str, Any] = {
    "rows": RNG.random((900, 73)),
    "wide": RNG.random((11, 3, 700)).astype("f4"),
    "levels": RNG.random((24, 170, 64)).astype("f4"),
    "numbers": np.arange(40),
    "large": RNG.integers(0, 9, 1 << 19).astype("i1"),
    "empty": np.empty((0, 3)),
}


def fill(writer: Writer) -> dict[str, Any]:
    for name, values in ARRAYS.items():
        writer.put(name, values)
    return {"types": 900}


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "atlas.index"


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("index") / "atlas.index"
    make_prepared(path, KEY, fill)
    return path.read_bytes()


def read_all(index: Prepared) -> dict[str, Any]:
    return {name: np.asarray(values) for name, values in index.arrays.items()}


def equal(found: dict[str, Any]) -> bool:
    return found.keys() == ARRAYS.keys() and all(np.array_equal(found[name], ARRAYS[name]) for name in found)


def test_what_was_written_is_read(path) -> None:
    index = make_prepared(path, KEY, fill)
    assert equal(read_all(index)) and index.about == {"types": 900} and index.nbytes == path.stat().st_size
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    again = make_prepared(path, KEY, lambda writer: pytest.fail("it is there"))
    assert equal(read_all(again))
    assert not np.asarray(again.arrays["rows"][:3]).flags.writeable


@given(st.data())
def test_a_stored_array_is_used_as_numpys(tmp_path_factory, written, data) -> None:
    path = tmp_path_factory.mktemp("index") / "atlas.index"
    path.write_bytes(written)
    index = Prepared(path, KEY)
    name = data.draw(st.sampled_from(["rows", "wide", "levels", "numbers", "large"]))
    stored, values = index.arrays[name], ARRAYS[name]
    if values.ndim == 3 and data.draw(st.booleans()):
        row = data.draw(st.integers(-len(values), len(values) - 1))
        stored, values = stored[row], values[row]
    if data.draw(st.booleans()) and values.ndim > 1:
        shape = (-1, *values.shape[1:-1], 1, values.shape[-1])
        stored, values = stored.reshape(*shape), values.reshape(*shape)
    count = len(values)
    rows = np.array(data.draw(st.lists(st.integers(0, count - 1), max_size=9)), dtype=int)
    assert np.array_equal(stored.take(rows, mode="clip"), values[rows])
    assert np.array_equal(stored[rows - count], values[rows])
    assert np.array_equal(np.take(stored, rows[:, None], axis=0, mode="clip"), values[rows[:, None]])
    bounds = st.none() | st.integers(-count - 2, count + 2)
    part = slice(data.draw(bounds), data.draw(bounds), data.draw(st.sampled_from([None, 1, 3])))
    assert np.array_equal(stored[part], values[part])
    assert (stored.shape, stored.dtype, stored.nbytes, len(stored)) == (
        values.shape,
        values.dtype,
        values.nbytes,
        count,
    )


def test_a_number_outside_is_an_error(path) -> None:
    index = make_prepared(path, KEY, fill)
    for rows in (900, -901, np.array([900])):
        with pytest.raises(IndexError):
            index.arrays["numbers"][rows]
    with pytest.raises(ValueError, match="axis 0"):
        index.arrays["rows"].take(np.arange(3), axis=1)


def test_no_flipped_bit_is_read(path, written) -> None:
    rng = np.random.default_rng(1)
    places = [*range(0, len(written), len(written) // 300), *rng.integers(0, len(written), 200)]
    places += [*rng.integers(0, PAGE, 30), *range(len(written) - 1200, len(written), 11)]
    noticed = 0
    for place in places:
        damaged = bytearray(written)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            assert equal(
                read_all(Prepared(path, KEY))
            )  # between two arrays there are bytes that nothing is read from
        except DamagedError:
            noticed += 1
    assert noticed > 0.9 * len(places)


def test_pages_that_never_reached_the_disk_are_noticed(path, written) -> None:
    """After a power failure any of the pages of a new file may be empty: none of them is read as an array."""
    pages, rng = -(-len(written) // PAGE), np.random.default_rng(3)
    held = {page for page in range(pages) if any(written[page * PAGE : (page + 1) * PAGE])}
    for lost in (
        {0},
        {pages - 1},
        *(set(rng.choice(pages, count, replace=False)) for count in (1, 3, pages // 2, pages)),
    ):
        left = bytearray(written)
        for page in lost:
            left[page * PAGE : (page + 1) * PAGE] = bytes(len(left[page * PAGE : (page + 1) * PAGE]))
        path.write_bytes(left)
        if lost & held:
            with pytest.raises(DamagedError):
                read_all(Prepared(path, KEY))
        else:
            assert equal(read_all(Prepared(path, KEY)))


def test_a_page_damaged_while_the_file_is_open_is_noticed_when_it_is_asked_for(path, written) -> None:
    path.write_bytes(written)
    index = Prepared(path, KEY)
    offset = written.index(ARRAYS["rows"][500].tobytes())
    with path.open("r+b") as file:
        file.seek(offset)
        file.write(b"\xff" * 8)
    rows = index.arrays["rows"]
    assert np.array_equal(rows[np.array([3, 899])], ARRAYS["rows"][[3, 899]])
    for asked in (lambda: rows[498:502], lambda: rows[np.array([500])], lambda: rows.take(np.array([7, 500]))):
        with pytest.raises(DamagedError):
            asked()
    assert np.array_equal(rows[:3], ARRAYS["rows"][:3])


def test_a_file_cut_off_while_it_is_open_is_an_error_and_no_bus_error(path, written) -> None:
    path.write_bytes(written)
    index = Prepared(path, KEY)
    os.truncate(path, 3 * PAGE)
    with pytest.raises(DamagedError):
        index.arrays["large"][:]
    assert np.array_equal(index.arrays["rows"][:10], ARRAYS["rows"][:10])


@pytest.mark.parametrize("size", [0, 1, PAGE - 1, PAGE, 5 * PAGE, -1, 7])
def test_a_file_of_another_size_is_written_again(path, written, size, caplog) -> None:
    path.write_bytes(written[:size] if size < 7 or size >= PAGE - 1 else written + b"\0" * size)
    assert open_prepared(path, KEY) is None
    assert equal(read_all(make_prepared(path, KEY, fill)))
    assert path.read_bytes() == written and len(caplog.records) == 1


@pytest.mark.parametrize("other", [{**KEY, "of": "another"}, {}, {**KEY, "more": 1}])
def test_a_file_of_another_key_is_written_again(path, other, caplog) -> None:
    make_prepared(path, other, fill)
    assert open_prepared(path, KEY) is None and "another" in caplog.text
    assert equal(read_all(make_prepared(path, KEY, fill)))


def test_a_file_that_is_none_is_not_opened(path, caplog) -> None:
    assert open_prepared(path, KEY) is None and not caplog.records
    os.mkfifo(path)
    assert open_prepared(path, KEY) is None and "regular" in caplog.text
    path.unlink()
    path.mkdir()
    with pytest.raises(OSError):
        make_prepared(path, KEY, fill)
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_dropped_file_is_gone_unless_it_is_another(path) -> None:
    old = make_prepared(path, KEY, fill)
    path.unlink()
    new = make_prepared(path, KEY, fill)
    old.drop()
    assert path.exists() and equal(read_all(old))
    new.drop()
    assert not path.exists()
    new.drop()


def test_a_failure_leaves_nothing(path) -> None:
    def fails(writer: Writer) -> dict[str, Any]:
        writer.put("numbers", ARRAYS["numbers"])
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        make_prepared(path, KEY, fails)
    assert not list(path.parent.iterdir())


def test_a_full_disk_is_an_error_and_the_old_file_stays(path, monkeypatch) -> None:
    make_prepared(path, {"old": 1}, fill)
    old, (soft, hard) = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        with pytest.raises(OSError) as found:
            make_prepared(path, KEY, fill)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)
    assert found.value.errno in (errno.EFBIG, errno.ENOSPC)
    assert path.read_bytes() == old and [file.name for file in path.parent.iterdir()] == [path.name]


WRITE = """
import sys, time
from pathlib import Path
import numpy as np
from synthesis.atlas.prepared import make_prepared
path, slow = Path(sys.argv[1]), float(sys.argv[2])
def fill(writer):
    print("writing", flush=True)
    writer.put("numbers", np.arange(5000))
    time.sleep(slow)
    return {}
index = make_prepared(path, {"of": "two"}, fill)
assert np.array_equal(index.arrays["numbers"][:], np.arange(5000))
print("read", flush=True)
"""


def start(path: Path, slow: float) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", WRITE, str(path), str(slow)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )


def test_of_several_processes_one_writes(path) -> None:
    running = [start(path, 0.3) for _ in range(3)]
    told = [process.communicate(timeout=60)[0].split() for process in running]
    assert sorted(told) == [["read"], ["read"], ["writing", "read"]]
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_one_that_was_killed_leaves_nothing_that_is_used(path) -> None:
    killed = start(path, 60)
    assert killed.stdout is not None and killed.stdout.readline() == "writing\n"
    waiting = start(path, 0)
    time.sleep(0.3)
    killed.kill()
    killed.communicate()
    assert waiting.communicate(timeout=60)[0].split() == ["writing", "read"]
    assert [file.name for file in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("where", [1 << 60, 3, 12 * PAGE])
def test_places_outside_of_the_file_are_no_arrays(path, where, monkeypatch) -> None:
    """All checksums right, but not the directory."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT)
    writer = Writer(handle)
    writer.put("numbers", ARRAYS["numbers"])
    dumps = json.dumps
    kind, shape, _ = writer._arrays["numbers"]

    def elsewhere(values: dict[str, Any]) -> str:
        return dumps({**values, "arrays": {"numbers": (kind, shape, where)}} if "arrays" in values else values)

    monkeypatch.setattr(prepared.json, "dumps", elsewhere)
    writer.finish(KEY, {})
    monkeypatch.undo()
    os.close(handle)
    assert open_prepared(path, KEY) is None
