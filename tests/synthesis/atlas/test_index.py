"""The index of an atlas: the same answers as a scan prepared in memory, whatever happens to its files."""

from __future__ import annotations

import gc
import logging
import os
import shutil
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.cache import index_of
from linkage_atlas.motions import Motion
from synthesis.atlas import cells as scan_cells
from synthesis.atlas import file as file_module
from synthesis.atlas import halving, header, preparation, series, stored, trees
from synthesis.atlas import index as module
from synthesis.atlas.file import encode_atlas
from synthesis.atlas.index import Index
from synthesis.atlas.preparation import Preparation
from synthesis.atlas.scan import KIND, Scan
from synthesis.atlas.storeys import STOREYS, build_storey
from synthesis.atlas.table import AtlasRule
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.target import Target
from synthesis.work import Cancelled, Work
from tests.conftest import make_atlas

RULE = AtlasRule(TypeRule(44, 2, OrderRule.FULL_CRANK), 32)


@pytest.fixture(scope="module", autouse=True)
def small_cells() -> Any:
    """Cells of several levels, and arrays of which only a part is checked, although the atlas is small."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan_cells, "LEAF", 6)
        patch.setattr(scan_cells, "FEWEST", 2)
        patch.setattr(stored, "_SMALL", 2)
        patch.setattr(stored, "_TOGETHER", 1)
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
def index_files(tmp_path_factory, file) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("made") / "atlas.h5"
    path.write_bytes(file)
    opened(path).prepare()
    return {place.name: place.read_bytes() for place in path.parent.iterdir()}


@pytest.fixture
def ready(tmp_path, index_files) -> Path:
    """An atlas with its index, which the first process made."""
    for name, data in index_files.items():
        (tmp_path / name).write_bytes(data)
    return tmp_path / "atlas.h5"


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
    return report._replace(evaluated=other.evaluated) == other and all(
        np.array_equal(one, two) for one, two in zip(windows, others)
    )


@pytest.mark.parametrize("seed", range(3))
def test_answers_are_those_of_a_scan_prepared_in_memory_bit_for_bit(ready, in_memory, plain, seed) -> None:
    atlas = opened(ready)
    scan = atlas.scan
    for wanted in (target(seed), target(seed, positions=True)):
        found = scan.best(wanted, 12)
        assert same(found, in_memory.best(wanted, 12))
        everything = plain.best(wanted, 12)[0]
        assert all(np.array_equal(one, two) for one, two in zip(found[0], everything))
    assert [path.suffix for path in atlas.index_files] == [".index", ".spans", ".paths", ".positions"]
    assert np.array_equal(scan.error_table(target(seed)), in_memory.error_table(target(seed)))


def test_what_an_atlas_tells_is_the_same_from_its_index(path) -> None:
    atlas = la.load_atlas(path)
    opened(path).prepare()
    mapped = opened(path)
    assert mapped.index_files and mapped.stored.known_hash == atlas.content_sha256 == mapped.content_sha256
    assert mapped.describe() == atlas.describe() and repr(mapped) == repr(atlas) and len(mapped) == len(atlas)
    for number in (1, 77, len(atlas)):
        assert mapped.details_of(number) == atlas.details_of(number)
        assert mapped.type_of(number - 1) == atlas.type_of(number - 1)
    for family in ("any", "crank_rocker", "double_crank"):
        assert mapped.scan.has_family(family) == atlas.scan.has_family(family)
    assert np.array_equal(mapped.scan.lengths, atlas.scan.lengths) and mapped.scan.nbytes > 0


def test_rockers_have_a_file_of_their_own(path) -> None:
    wanted = target(4)
    expected = la.load_atlas(path).rocker_scan.best(wanted, 9)
    for _ in range(2):
        assert same(opened(path).rocker_scan.best(wanted, 9), expected)
    assert path.with_name("atlas.h5.index.rocker").exists()


def damage(place: Path, offset: int) -> None:
    with place.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)
        file.seek(offset)
        file.write(bytes([byte[0] ^ 0x10]))


def test_an_index_is_made_once(path, in_memory, index_files) -> None:
    for _ in range(2):
        atlas = opened(path)
        assert same(atlas.scan.best(target(1, True), 5), in_memory.best(target(1, True), 5))
        made = {place.name for place in path.parent.iterdir()}
        assert made == {name for name in index_files if not name.endswith((".spans", ".paths"))}  # made by `prepare`


@pytest.mark.parametrize("seed", range(8))
def test_an_answer_comes_from_no_damaged_page(ready, in_memory, seed, caplog) -> None:
    """One bit anywhere, before the file is opened or while it is open: the answer is the right one."""
    rng = np.random.default_rng(100 + seed)
    atlas = opened(ready)
    atlas.prepare()
    places = atlas.index_files
    if seed % 2:
        atlas = opened(ready)
        atlas.prepare()
    for _ in range(1 + seed % 4 * 30):
        place = places[int(rng.integers(len(places)))]
        damage(place, int(rng.integers(place.stat().st_size)))
    if seed % 4 == 0:
        atlas = opened(ready)
    for positions in (True, False):
        assert same(atlas.scan.best(target(seed, positions), 7), in_memory.best(target(seed, positions), 7))
    assert atlas.details_of(50) == la.load_atlas(ready).details_of(50)
    if seed % 4 > 1:  # thirty bits are not missed
        assert "made anew" in caplog.text
        assert same(opened(ready).scan.best(target(seed), 7), in_memory.best(target(seed), 7))


def test_the_damage_is_noticed_by_the_check_and_by_nothing_else(ready, in_memory, monkeypatch) -> None:
    """Without the comparison the answers of a damaged file differ: so it is what keeps them right."""
    place = index_of(ready)
    data = bytearray(place.read_bytes())
    half = len(data) // 8
    data[half:-half] = bytes(len(data) - 2 * half)
    place.write_bytes(data)
    monkeypatch.setattr(stored.Region, "check", lambda self, pages: None)
    try:
        answer = opened(ready).scan.best(target(1), 7)
    except AssertionError:  # the scan itself may find that numbers contradict each other
        return
    assert not same(answer, in_memory.best(target(1), 7))


@pytest.mark.parametrize("size", [0, 5000, 100_000])
def test_a_file_that_was_cut_off_is_made_anew(ready, in_memory, size) -> None:
    atlas = opened(ready)
    atlas.prepare()
    for place in atlas.index_files:
        with place.open("r+b") as file:
            file.truncate(size)
    for again in (atlas, opened(ready)):
        assert same(again.scan.best(target(2, True), 7), in_memory.best(target(2, True), 7))
    assert len(opened(ready).index_files) == 1


@pytest.mark.parametrize("change", ["atlas", "code", "series"])
def test_an_index_of_something_else_is_not_used(ready, change, monkeypatch, caplog) -> None:
    if change == "atlas":
        ready.write_bytes(encode_atlas(make_atlas(AtlasRule(TypeRule(60, 2), 32))))
    elif change == "code":
        monkeypatch.setattr(module, "code_version", lambda: {"code": "another"})
    else:
        monkeypatch.setattr("linkage_atlas.atlases.KIND", KIND._replace(series_error=1e-5))
    with caplog.at_level(logging.WARNING):
        atlas = opened(ready)
    assert not atlas.index_files and len(caplog.records) == 1 and "another version" in caplog.text
    wanted = la.load_atlas(ready)
    assert len(atlas) == len(wanted) and same(atlas.scan.best(target(0), 5), wanted.scan.best(target(0), 5))
    assert opened(ready).index_files


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
    assert not read and atlas.index_files and atlas.type_of(7) == la.load_atlas(path).type_of(7)
    read.clear()
    path.touch()
    assert opened(path).index_files and len(read) == 1
    damage(path, path.stat().st_size // 2)
    with pytest.raises(la.AtlasError) as found:
        opened(path)
    assert found.value.fault is la.AtlasFault.CHECKSUM


def test_an_index_that_is_made_in_small_parts_has_the_same_bytes(path, tmp_path, monkeypatch) -> None:
    made = []
    monkeypatch.setattr(
        "os.cpu_count", lambda: 1
    )  # of two threads, which of them comes first decides where an array lies
    for at_once, copied, points, part in ((1 << 18, 1 << 14, 1 << 18, 1 << 26), (16, 7, 1 << 13, 1 << 14)):
        monkeypatch.setattr(trees, "PART_BYTES", part)
        monkeypatch.setattr(trees, "_AT_ONCE", part)
        monkeypatch.setattr(halving, "AT_ONCE", at_once)
        monkeypatch.setattr(series, "_COPIED_AT_ONCE", copied)
        monkeypatch.setattr(scan_cells, "_POINTS_AT_ONCE", points)
        place = tmp_path / f"index-{at_once}"
        la.load_atlas(path, index=place).prepare()
        made.append(
            [place.with_name(place.name + end).read_bytes() for end in ("", ".positions", ".spans", ".paths")]
        )
    assert made[0] == made[1]
    assert len(list(tmp_path.glob("index-*"))) == 8  # and nothing else is left


@pytest.mark.parametrize("most", [5, 10**6])
def test_where_the_disk_has_little_left_an_index_of_windows_is_made_in_memory_or_left_out(
    path, in_memory, most, monkeypatch, caplog
) -> None:
    free = shutil.disk_usage(path.parent)
    monkeypatch.setattr(trees.shutil, "disk_usage", lambda folder: free._replace(free=1 << 20))
    monkeypatch.setattr(preparation, "MOST_IN_MEMORY", most)
    atlas = opened(path)
    atlas.prepare()
    assert [place.name for place in atlas.index_files] == ["atlas.h5.index", "atlas.h5.index.positions"]
    assert bool(atlas.scan.prepared.storeys) == bool(atlas.scan.prepared.path_storeys) == (most > len(atlas))
    assert "as many are to be left" in caplog.text
    assert same(atlas.scan.best(target(0), 5), in_memory.best(target(0), 5))


@pytest.mark.parametrize("steps", [0, 3, 30])
def test_making_an_index_of_windows_that_is_ended_leaves_no_file_open(path, steps) -> None:
    class Ended(Exception):
        pass

    readings = iter(range(10**6))

    def go_on() -> None:
        if next(readings) >= steps:
            raise Ended

    buckets = [cells.bucket for cells in opened(path).scan.prepared.cells]
    gc.collect()
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(Ended):
            build_storey(STOREYS[0], buckets, folder=path.parent, go_on=go_on)
        gc.collect()
    assert not before or len(os.listdir("/proc/self/fd")) <= before


def test_limits_hold_with_an_index_too(ready) -> None:
    for limits in ({"max_types": 5}, {"max_bytes": 1000}):
        with pytest.raises(la.AtlasError) as found:
            la.load_atlas(ready, index=index_of(ready), **limits)
        assert found.value.fault is la.AtlasFault.LIMIT


def test_damage_to_index_and_atlas_is_an_error_and_no_answer(ready) -> None:
    atlas = opened(ready)
    atlas.prepare()
    place = atlas.index_files[0]
    place.write_bytes(place.read_bytes()[:4096] + bytes(place.stat().st_size - 4096))
    damage(ready, ready.stat().st_size // 2)
    with pytest.raises(la.AtlasError):
        opened(ready)
    with pytest.raises(la.AtlasError):
        atlas.scan.best(target(1), 5)


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
    assert [file.name for file in path.parent.iterdir()] == ["atlas.h5"]


def full(*_: int) -> None:
    raise OSError(28, "No space left on device")


def test_series_for_positions_may_fail_alone(path, in_memory, monkeypatch, caplog) -> None:
    atlas = opened(path)
    assert atlas.scan and atlas.index_files
    monkeypatch.setattr("os.posix_fallocate", full)
    assert same(atlas.scan.best(target(3, True), 5), in_memory.best(target(3, True), 5))
    assert len(atlas.index_files) == 1 and "in memory" in caplog.text


def test_beside_a_folder_that_is_read_only_the_cache_folder_is_used(path, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert index_of(path) == path.with_name("atlas.h5.index")
    monkeypatch.setattr("os.access", lambda place, mode: False)
    place = index_of(path)
    assert place.parent == tmp_path / "cache" / "linkage-atlas" and place.name.startswith("atlas.h5-")
    other = tmp_path / "other"
    other.mkdir()
    assert index_of(other / "atlas.h5") != place
    path.with_name("atlas.h5.index").touch()  # an administrator, or an image, has one made
    assert index_of(path) == path.with_name("atlas.h5.index")


@pytest.mark.parametrize("end", ["cancelled", "out of time"])
def test_a_preparation_that_is_given_up_leaves_no_file(path, end) -> None:
    atlas = opened(path)
    if end == "cancelled":
        with pytest.raises(Cancelled):
            atlas.scan.prepare_positions(Work(cancelled=lambda: True))
    else:
        assert not atlas.scan.prepare_positions(Work(0.0))
    assert sorted(file.name for file in path.parent.iterdir()) == ["atlas.h5", "atlas.h5.index"]
    assert atlas.scan.prepare_positions(Work())


def test_threads_that_meet_the_damage_together_make_one_new_index(ready, in_memory, caplog) -> None:
    place = index_of(ready)
    data = place.read_bytes()
    place.write_bytes(data[:4096] + bytes(len(data) // 2) + data[4096 + len(data) // 2 :])
    atlas = opened(ready)
    found: dict[int, Any] = {}

    def ask(seed: int) -> None:
        found[seed] = atlas.scan.best(target(seed), 5)

    threads = [threading.Thread(target=ask, args=[seed]) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(same(found[seed], in_memory.best(target(seed), 5)) for seed in range(4))
    assert caplog.text.count("made anew") == 1


def test_a_disk_that_damages_every_file_ends_in_memory(ready, in_memory, monkeypatch, caplog) -> None:
    def damaged(self: Any, pages: Any) -> None:
        raise stored.DamagedError("a page is not what was written")

    monkeypatch.setattr(stored.Region, "check", damaged)
    atlas = opened(ready)
    assert same(atlas.scan.best(target(5), 5), in_memory.best(target(5), 5))
    assert not atlas.index_files and caplog.text.count("made anew") == 3 and "again and again" in caplog.text


def test_without_a_call_that_reserves_the_disk_zeros_are_written(path, in_memory, monkeypatch) -> None:
    monkeypatch.delattr("os.posix_fallocate")
    atlas = opened(path)
    assert same(atlas.scan.best(target(5), 5), in_memory.best(target(5), 5)) and atlas.index_files


def test_progress_goes_from_nothing_to_all(path) -> None:
    told: list[tuple[int, int]] = []
    report: Callable[[int, int], None] = lambda done, total: told.append((done, total))  # noqa: E731
    atlas = la.load_atlas(path, index=index_of(path), progress=report)
    assert not told
    atlas.prepare()
    assert told == sorted(told) and told[-1] == (2 * len(atlas), 2 * len(atlas))


def test_a_small_table_has_an_index(tmp_path) -> None:
    """One type, and so no coarse level; and none at all."""
    for rule in (AtlasRule(TypeRule(10, 2), 16), AtlasRule(TypeRule(10, 9), 16)):
        table = make_atlas(rule)
        index = Index(tmp_path / str(len(table)), "x", FOURBAR, lambda: pytest.fail("it is given"), KIND)
        made: Preparation = index.prepared(table, 1)
        again = index.opened(1)
        assert again is not None
        for prepared in (made, again):
            assert same(Scan(prepared).best(target(1), 4), Scan(table).best(target(1), 4))
