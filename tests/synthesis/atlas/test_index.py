"""The index of an atlas: the same answers as a scan prepared in memory, whatever happens to its files."""

import gc
import hashlib
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from data_build.cli import main as batch
from linkage_atlas.atlases import index_of
from linkage_atlas.motions import Motion
from synthesis.atlas import cells as scan_cells
from synthesis.atlas import file as file_module
from synthesis.atlas import header, preparation, window_index
from synthesis.atlas import index as module
from synthesis.atlas.file import encode_atlas
from synthesis.atlas.index import Index, InMemory, Part
from synthesis.atlas.preparation import Preparation
from synthesis.atlas.scan import KIND, Scan
from synthesis.atlas.table import AtlasRule
from synthesis.atlas.window_index import INTERVALS, build_window_index
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.target import Target
from synthesis.work import Cancelled, Work
from tests.conftest import PATIENCE, make_atlas, some_of

RULE = AtlasRule(TypeRule(28, 2, OrderRule.FULL_CRANK), 32)
PARTS = ["cells", "short_spans", "positions"]


@pytest.fixture(scope="module", autouse=True)
def small_cells() -> Any:
    """Cells of several levels, although the atlas is small."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan_cells, "LEAF", 6)
        patch.setattr(scan_cells, "FEWEST", 2)
        yield


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> bytes:
    return encode_atlas(make_atlas(RULE))


@pytest.fixture
def path(tmp_path, file) -> Path:
    """An atlas without an index."""
    path = tmp_path / "atlas.h5"
    path.write_bytes(file)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory, file) -> Path:
    """The folder of an atlas with its index."""
    path = tmp_path_factory.mktemp("made") / "atlas.h5"
    path.write_bytes(file)
    opened(path).prepare()
    return path.parent


@pytest.fixture
def ready(tmp_path, made) -> Path:
    """An atlas with its index, which the first process made."""
    shutil.copytree(made, tmp_path / "atlas")
    return tmp_path / "atlas" / "atlas.h5"


@pytest.fixture(scope="module")
def in_memory(small_cells) -> Scan:
    return Scan(make_atlas(RULE))


@pytest.fixture(scope="module")
def plain(small_cells) -> Scan:
    return Scan(make_atlas(RULE), cells=False)


def opened(path: Path) -> la.Atlas:
    return la.load_atlas(path, index=index_of(path))


def target(seed: int, positions: bool = False) -> Target:
    rng = np.random.default_rng(seed)
    samples, span = int(rng.integers(3, 30)), float(np.exp(rng.uniform(np.log(2), np.log(400))))
    shape = [
        rng.normal(scale=2, size=samples).cumsum(),
        np.linspace(0, rng.normal() * span / 2, samples),
        20 * np.sin(np.linspace(0, rng.uniform(1, 7), samples)),
    ][seed % 3]
    points = (rng.normal(size=samples) + 1j * rng.normal(size=samples)) if positions else None
    return Motion(shape, points, span).target


def same(found: Any, wanted: Any) -> bool:
    """The same answers; how many windows were evaluated for them depends on whether short spans have their index yet."""
    (windows, report), (others, other) = found, wanted
    alike = all(np.array_equal(one, two) for one, two in zip(windows, others))
    return alike and report._replace(evaluated=other.evaluated) == other


def damage(place: Path, offset: int) -> None:
    with place.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)
        file.seek(offset)
        file.write(bytes([byte[0] ^ 0x10]))


def names(folder: Path) -> list[str]:
    """What a folder holds, hidden files left out."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def full(*_: int) -> None:
    raise OSError(28, "No space left on device")


# -- answers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_answers_are_those_of_a_scan_prepared_in_memory_bit_for_bit(ready, in_memory, plain, seed) -> None:
    atlas = opened(ready)
    scan = atlas.scan
    for wanted in (target(seed), target(seed, positions=True)):
        found = scan.best(wanted, 12)
        assert same(found, in_memory.best(wanted, 12))
        everything = plain.best(wanted, 12)[0]
        assert all(np.array_equal(one, two) for one, two in zip(found[0], everything))
    assert [path.name for path in atlas.index_files] == PARTS
    assert np.array_equal(scan.error_table(target(seed)), in_memory.error_table(target(seed)))


def test_what_an_atlas_tells_is_the_same_from_its_index(path) -> None:
    atlas = la.load_atlas(path)
    opened(path).prepare()
    mapped = opened(path)
    assert mapped.index_files and mapped.content_sha256 == atlas.content_sha256
    assert mapped.describe() == atlas.describe() and repr(mapped) == repr(atlas) and len(mapped) == len(atlas)
    for number in (1, 77, len(atlas)):
        assert mapped.details_of(number) == atlas.details_of(number)
        assert mapped.type_of(number - 1) == atlas.type_of(number - 1)
    for family in ("any", "crank_rocker", "double_crank"):
        assert mapped.scan.has_family(family) == atlas.scan.has_family(family)
    assert np.array_equal(mapped.scan.lengths, atlas.scan.lengths) and mapped.scan.nbytes > 0
    path.write_bytes(encode_atlas(make_atlas(AtlasRule(TypeRule(60, 2), 32))))
    with pytest.raises(la.AtlasError):  # the details of another atlas are none of this one
        mapped.details_of(2)
    assert mapped.details_of(1) == atlas.details_of(1)  # what has been read is kept


def test_rockers_have_a_part_of_their_own(path) -> None:
    wanted = target(4)
    expected = la.load_atlas(path).rocker_scan.best(wanted, 9)
    for _ in range(2):
        assert same(opened(path).rocker_scan.best(wanted, 9), expected)
    assert names(index_of(path)) == ["cells", "rocker_cells"]


def test_a_plain_atlas_reads_nothing_of_its_index_and_leaves_nothing(path, in_memory) -> None:
    """It stands in for an index that cannot be read, whichever part is asked for."""
    atlas = opened(path)
    atlas.prepare()
    expected = atlas.rocker_scan.best(target(4), 9)
    for file in index_of(path).glob("*/*.npy"):
        os.truncate(file, 0)
    before, plain = sorted(path.parent.rglob("*")), atlas.plain()
    for wanted in (target(2), target(3, positions=True)):
        best, _ = plain.scan.best(wanted, 12)
        assert all(np.array_equal(one, two) for one, two in zip(best, in_memory.best(wanted, 12)[0]))
    assert all(np.array_equal(one, two) for one, two in zip(plain.rocker_scan.best(target(4), 9)[0], expected[0]))
    assert plain.describe() == atlas.describe() and plain.details_of(7) == atlas.details_of(7)
    assert sorted(path.parent.rglob("*")) == before and not plain.index_files
    assert not any(cells.levels for cells in plain.scan.prepared.cells)
    in_no_file = la.load_atlas(path)
    assert in_no_file.plain() is in_no_file


def test_an_index_is_made_once(path, in_memory, monkeypatch) -> None:
    for _ in range(2):
        atlas = opened(path)
        assert same(atlas.scan.best(target(1, True), 5), in_memory.best(target(1, True), 5))
        assert names(path.parent) == ["atlas.h5", "atlas.h5.index"]
        assert names(index_of(path)) == ["cells", "positions"]  # short spans are made by `prepare`
        monkeypatch.setattr(module, "_make", lambda *_: pytest.fail("it is there"))


def test_progress_goes_from_nothing_to_all(path) -> None:
    told: list[tuple[int, int]] = []
    report: Callable[[int, int], None] = lambda done, total: told.append((done, total))  # noqa: E731
    atlas = la.load_atlas(path, index=index_of(path), progress=report)
    assert not told
    atlas.prepare()
    assert told == sorted(told) and told[-1] == (2 * len(atlas), 2 * len(atlas))


@pytest.mark.parametrize("rule", [AtlasRule(TypeRule(10, 2), 16), AtlasRule(TypeRule(10, 9), 16)])
def test_a_small_table_has_an_index(tmp_path, rule) -> None:
    """One type, and so no coarse level; and none at all."""
    table = make_atlas(rule)
    for load in (lambda: table, lambda: pytest.fail("it is there")):
        prepared = Preparation(table.mechanism, load, KIND, parts=Index(tmp_path / "index", "x"))
        prepared.prepare_short_spans(Work())
        assert same(Scan(prepared).best(target(1), 4), Scan(table).best(target(1), 4))


# -- its key ----------------------------------------------------------------------------------------------------------


class Recorded(InMemory):
    """Parts in memory and a digest of them: of sums to six digits, as the last bits differ from one processor to another."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()

    def part(self, *arguments: Any) -> Part:
        part = super().part(*arguments)
        self.digest.update(str(part.about.get("groups")).encode())
        for name, values in sorted(part.arrays.items()):
            size = np.abs(values.ravel().astype(complex))
            sums = [size.sum(), (size**2).sum(), size @ np.linspace(0, 1, size.size)]
            text = f"{name} {values.dtype.str} {values.shape} {' '.join(f'{value:.5e}' for value in sums)}"
            self.digest.update(text.encode())
        return part


def test_other_numbers_have_another_version() -> None:
    """Where this fails, raise `VERSION`, and write it and the digest here."""
    table, parts = make_atlas(AtlasRule(TypeRule(44, 2, OrderRule.FULL_CRANK), 32)), Recorded()
    prepared = Preparation(table.mechanism, lambda: table, KIND, parts=parts)
    prepared.prepare_positions(Work())
    prepared.prepare_short_spans(Work())
    assert (module.VERSION, parts.digest.hexdigest()[:16]) == (1, "503e6c46c095700f")


@pytest.mark.parametrize("change", ["atlas", "version"])
def test_an_index_of_something_else_is_not_used(ready, change, monkeypatch, caplog) -> None:
    if change == "atlas":
        ready.write_bytes(encode_atlas(make_atlas(AtlasRule(TypeRule(60, 2), 32))))
    else:
        monkeypatch.setattr(module, "VERSION", 0)
    with caplog.at_level(logging.WARNING):
        atlas = opened(ready)
        assert not atlas.index_files and atlas.scan
    assert len(caplog.records) == 1 and "another version" in caplog.text
    wanted = la.load_atlas(ready)
    assert len(atlas) == len(wanted) and same(atlas.scan.best(target(0), 5), wanted.scan.best(target(0), 5))
    assert [path.name for path in opened(ready).scan.prepared._parts.folders] == ["cells"]


def test_arrays_are_plain_npy_files(ready) -> None:
    for part in opened(ready).index_files:
        told = json.loads((part / "manifest.json").read_text())["part"]["arrays"]
        assert told.keys() == {file.stem for file in part.glob("*.npy")}
        for name, one in told.items():
            values = np.load(part / f"{name}.npy")
            assert values.dtype.str == one["dtype"] and list(values.shape) == one["shape"]


def test_no_header_is_parsed_as_python(ready, monkeypatch) -> None:
    """CPython 3.11 raises SystemError where another thread parses Python meanwhile."""
    monkeypatch.setattr("ast.literal_eval", full)
    atlas = opened(ready)
    atlas.prepare()
    assert atlas.scan and [path.name for path in atlas.index_files] == PARTS


def test_a_damaged_atlas_is_refused_though_its_index_is_sound(ready) -> None:
    damage(ready, ready.stat().st_size // 2)
    with pytest.raises(la.AtlasError) as found:
        opened(ready)
    assert found.value.fault is la.AtlasFault.CHECKSUM
    ready.unlink()
    with pytest.raises(la.AtlasError) as found:
        opened(ready)
    assert found.value.fault is la.AtlasFault.MISSING


def test_an_atlas_that_was_compared_is_not_read_again(path, monkeypatch) -> None:
    """A start with an index reads the header; one with a file that was written since, if only a byte of it, all of it."""
    opened(path).prepare()
    read: list[Path] = []
    whole = header.checked_hash
    for reader in (header, file_module):
        monkeypatch.setattr(reader, "checked_hash", lambda file: read.append(file.name) or whole(file))
    atlas = opened(path)
    assert not read and atlas.type_of(7) == la.load_atlas(path).type_of(7)
    read.clear()
    path.touch()
    assert opened(path) and len(read) == 1
    damage(path, path.stat().st_size // 2)
    with pytest.raises(la.AtlasError) as found:
        opened(path)
    assert found.value.fault is la.AtlasFault.CHECKSUM


@pytest.mark.parametrize("limits", [{"max_types": 5}, {"max_bytes": 1000}])
def test_limits_hold_with_an_index_too(ready, limits) -> None:
    with pytest.raises(la.AtlasError) as found:
        la.load_atlas(ready, index=index_of(ready), **limits)
    assert found.value.fault is la.AtlasFault.LIMIT


# -- damage -----------------------------------------------------------------------------------------------------------


CUT = ("cut off", "longer")
CHANGES = (*CUT, "missing", "header", "manifest")
DAMAGED = [(PARTS[(j + shift) % 3], change) for shift in range(3) for j, change in enumerate(CHANGES)]
"""The first five have each change and each part: all parts are opened by the same lines."""


@pytest.mark.parametrize(("part", "change"), some_of(DAMAGED, 5))
def test_a_part_that_is_not_what_was_written_is_made_anew(ready, in_memory, part, change, caplog) -> None:
    folder = index_of(ready) / part
    array = sorted(folder.glob("*.npy"))[0]
    if change == "manifest":
        damage(folder / "manifest.json", 200)
    elif change == "header":
        data = array.read_bytes()
        array.write_bytes(data.replace(b"(", b" (").replace(b"  }", b" }", 1)[: len(data)].replace(b"<", b">", 1))
    elif change == "missing":
        array.unlink()
    else:
        os.truncate(array, array.stat().st_size + (100 if change == "longer" else -1))
    atlas = opened(ready)
    atlas.prepare()
    assert same(atlas.scan.best(target(2, True), 7), in_memory.best(target(2, True), 7))
    said = {"missing": "", "manifest": "manifest.json is not"} | dict.fromkeys(CUT, "cut off, or longer")
    assert f"{array.name} is" in caplog.text or change in ("missing", "manifest")
    assert said.get(change, "is not what was written") in caplog.text
    assert batch(["verify", str(ready)]) == 0


def test_every_flipped_bit_is_found_by_verify(ready, capsys) -> None:
    assert batch(["verify", str(ready)]) == 0
    assert "index_files" in capsys.readouterr().out
    rng = np.random.default_rng(1)
    files = sorted(index_of(ready).glob("*/*.*"))
    for place in [files[k] for k in rng.choice(len(files), 25, replace=False)]:
        at = int(rng.integers(place.stat().st_size))
        damage(place, at)
        assert batch(["verify", str(ready)]) == 3
        told = capsys.readouterr()
        assert not told.out and str(place) in told.err and "next start" in told.err
        damage(place, at)
    assert batch(["verify", str(ready)]) == 0


# -- making -----------------------------------------------------------------------------------------------------------


def test_an_index_that_is_made_in_small_parts_has_the_same_bytes(path, tmp_path, monkeypatch) -> None:
    made = []
    for points, run in ((1 << 18, 1 << 26), (1 << 13, 1 << 14)):
        monkeypatch.setattr(window_index, "RUN_BYTES", run)
        monkeypatch.setattr(window_index, "_AT_ONCE", run)
        monkeypatch.setattr(scan_cells, "_POINTS_AT_ONCE", points)
        place = tmp_path / f"index-{run}"
        la.load_atlas(path, index=place).prepare()
        made.append({str(file.relative_to(place)): file.read_bytes() for file in place.glob("*/*")})
    assert made[0] == made[1] and len(made[0]) > 100
    assert len(list(tmp_path.glob("index-*"))) == 2  # and nothing else is left


@pytest.mark.parametrize("most", [5, 10**6])
def test_where_the_disk_has_little_left_an_index_of_windows_is_made_in_memory_or_left_out(
    path, in_memory, most, monkeypatch, caplog
) -> None:
    free = shutil.disk_usage(path.parent)
    monkeypatch.setattr(window_index.shutil, "disk_usage", lambda folder: free._replace(free=1 << 17))
    monkeypatch.setattr(preparation, "MOST_IN_MEMORY", most)
    atlas = opened(path)
    atlas.prepare()
    assert [place.name for place in atlas.index_files] == ["cells", "positions"] == names(index_of(path))
    assert bool(atlas.scan.prepared.short_spans) == (most > len(atlas))
    assert "as many are to be left" in caplog.text
    assert same(atlas.scan.best(target(0), 5), in_memory.best(target(0), 5))


@pytest.mark.parametrize("steps", [0, 3, 12])
def test_making_an_index_of_windows_that_is_ended_leaves_no_file_open(path, steps) -> None:
    class Ended(Exception):
        pass

    readings = iter(range(10**6))

    def go_on() -> None:
        if next(readings) >= steps:
            raise Ended

    groups = [cells.group for cells in opened(path).scan.prepared.cells]
    gc.collect()
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(Ended):
            build_window_index(INTERVALS[0], groups, lambda *_: pytest.fail("not yet"), path.parent, go_on)
        gc.collect()
    assert not before or len(os.listdir("/proc/self/fd")) <= before


@pytest.mark.parametrize("failure", ["no such folder", "full disk"])
def test_where_nothing_can_be_written_it_is_prepared_in_memory(path, in_memory, failure, monkeypatch, caplog) -> None:
    place = index_of(path)
    if failure == "full disk":
        monkeypatch.setattr("os.posix_fallocate", full)
    else:
        place = place.parent / "none" / "atlas.index"
    atlas = la.load_atlas(path, index=place)
    assert same(atlas.scan.best(target(3, True), 5), in_memory.best(target(3, True), 5))
    assert not atlas.index_files and "in memory" in caplog.text
    assert not place.exists() or names(place) == []
    assert atlas.details_of(3) == la.load_atlas(path).details_of(3)


def test_series_for_positions_may_fail_alone(path, in_memory, monkeypatch, caplog) -> None:
    atlas = opened(path)
    assert atlas.scan and atlas.index_files
    monkeypatch.setattr("os.posix_fallocate", full)
    assert same(atlas.scan.best(target(3, True), 5), in_memory.best(target(3, True), 5))
    assert len(atlas.index_files) == 1 and "in memory" in caplog.text


def test_without_a_call_that_reserves_the_disk_zeros_are_written(path, in_memory, monkeypatch) -> None:
    monkeypatch.delattr("os.posix_fallocate")
    atlas = opened(path)
    assert same(atlas.scan.best(target(5), 5), in_memory.best(target(5), 5)) and atlas.index_files


def test_beside_a_folder_that_is_read_only_the_cache_folder_is_used(path, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert index_of(path) == path.with_name("atlas.h5.index")
    monkeypatch.setattr("os.access", lambda place, mode: False)
    place = index_of(path)
    assert place.parent == tmp_path / "cache" / "linkage-atlas" and place.name.startswith("atlas.h5-")
    other = tmp_path / "other"
    other.mkdir()
    assert index_of(other / "atlas.h5") != place
    path.with_name("atlas.h5.index").mkdir()  # an administrator, or an image, has one made
    assert index_of(path) == path.with_name("atlas.h5.index")


@pytest.mark.parametrize("end", ["cancelled", "out of time"])
def test_a_preparation_that_is_given_up_leaves_no_file(path, end) -> None:
    atlas = opened(path)
    if end == "cancelled":
        with pytest.raises(Cancelled):
            atlas.scan.prepare_positions(Work(cancelled=lambda: True))
    else:
        atlas.scan.prepared._load = lambda: pytest.fail("there is no time to read the atlas")
        assert not atlas.scan.prepare_positions(Work(0.0))
        atlas = opened(path)
    assert names(index_of(path)) == ["cells"]
    assert atlas.scan.prepare_positions(Work())


MAKING = """
import sys, time
from pathlib import Path
import numpy as np
from synthesis.atlas.index import Index

def fill(new, folder):
    new("values", float, (9,))[...] = np.arange(9.0)
    print("begins", flush=True)
    time.sleep(float(sys.argv[2]))
    return {}

print(Index(Path(sys.argv[1]), "x").part("some", fill).arrays["values"].sum(), flush=True)
"""


def making(folder: Path, seconds: float) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", MAKING, str(folder), str(seconds)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_of_several_processes_one_makes_a_part(tmp_path) -> None:
    processes = [making(tmp_path / "index", 0.5) for _ in range(3)]
    told = [process.communicate(timeout=PATIENCE)[0] for process in processes]
    assert sum("begins" in text for text in told) == 1 and all("36.0" in text for text in told)


def test_what_a_killed_process_leaves_is_removed(tmp_path) -> None:
    process = making(tmp_path / "index", 60)
    assert process.stdout is not None and process.stdout.readline() == "begins\n"
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert list((tmp_path / "index").glob(".some.tmp/*.npy"))
    assert making(tmp_path / "index", 0).communicate(timeout=PATIENCE)[0] == "begins\n36.0\n"
    assert names(tmp_path / "index") == ["some"] and not list((tmp_path / "index").glob(".*.tmp"))
