"""The atlas file: what it holds, and everything that must be refused."""

import hashlib
import io
import json
import os
import tracemalloc
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from synthesis.atlas import haar
from synthesis.atlas.file import decode_atlas, encode_atlas, load_atlas
from synthesis.atlas.header import HEADER_BYTES, MAGIC, check_bytes
from synthesis.atlas.index import temporary_arrays
from synthesis.atlas.table import COLUMNS, Atlas, AtlasRule
from synthesis.errors import AtlasError, AtlasFault, FieldError
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from tests.conftest import make_atlas

ARRAYS = ("lengths", "average", "details", "winding", "curve_error")


def fault_of(data: bytes, **limits: int) -> AtlasFault:
    with pytest.raises(AtlasError) as caught:
        decode_atlas(data, **limits)
    return caught.value.fault


def with_header(body: bytes) -> bytes:
    """A body behind a header that matches it."""
    text = f"{MAGIC} 1\nsha256 {hashlib.sha256(body).hexdigest()}\nbytes {len(body)}\n"
    return text.encode().ljust(HEADER_BYTES - 1, b" ") + b"\n" + body


# -- what it holds ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rule", [AtlasRule(TypeRule(60), 16), AtlasRule(TypeRule(64, 9, OrderRule.FULL_CRANK), 64)])
def test_round_trip(rule) -> None:
    atlas = make_atlas(rule)
    data = encode_atlas(atlas)
    back = decode_atlas(data)
    assert data == encode_atlas(atlas) == encode_atlas(back)
    assert (back.rule, back.generator, len(back)) == (rule, atlas.generator, len(atlas))
    for name in ARRAYS:
        assert np.array_equal(getattr(back, name), getattr(atlas, name)) and not getattr(back, name).flags.writeable
    assert back.content_hash() == atlas.content_hash()


PACKED = {
    "as_written": {"compression": "gzip", "shuffle": True, "fletcher32": True},
    "gzip_alone": {"compression": "gzip"},
    "shuffled_without_sums": {"compression": "gzip", "shuffle": True},
    "sums_alone": {"fletcher32": True},
    "plain": {},
}


@pytest.mark.parametrize("rows", [7, 64, 1 << 12])
@pytest.mark.parametrize("how", PACKED)
def test_arrays_are_those_that_hdf5_reads_however_they_are_packed(how, rows) -> None:
    atlas = make_atlas(AtlasRule(TypeRule(60, 6), 16))

    def pack(file: h5py.File) -> None:
        for name in ARRAYS:
            values = taken(file, name)
            chunks = (min(rows, len(values)), *values.shape[1:])
            file.create_dataset(name, data=values, chunks=chunks, **PACKED[how])

    data = edited(encode_atlas(atlas), pack)
    back = decode_atlas(data)
    with h5py.File(io.BytesIO(data[HEADER_BYTES:])) as file:
        for name in ARRAYS:
            read = file[name][()]
            assert read.tobytes() == getattr(back, name).tobytes() == getattr(atlas, name).tobytes()


@pytest.mark.parametrize("whole", [True, False], ids=["whole rows", "parts of rows"])
def test_chunks_of_parts_of_rows_are_put_together(whole) -> None:
    atlas = make_atlas(AtlasRule(TypeRule(60, 6), 16))

    pack = stored(name="details", chunks=(13, 15 if whole else 4), **PACKED["as_written"])
    assert np.array_equal(decode_atlas(edited(encode_atlas(atlas), pack)).details, atlas.details)


def test_an_atlas_without_types_is_an_atlas() -> None:
    assert len(decode_atlas(encode_atlas(make_atlas(AtlasRule(TypeRule(10, 9), 16))))) == 0


def test_any_hdf5_reader_opens_it(small_bytes, small_atlas, tmp_path) -> None:
    (tmp_path / "atlas.h5").write_bytes(small_bytes)
    with h5py.File(tmp_path / "atlas.h5") as file:
        assert file.userblock_size == HEADER_BYTES and set(file) == set(ARRAYS)
        attributes = dict(file.attrs)
        rule = {"perimeter": 60, "smallest": 2, "order": "full_crank", "samples": 32}
        assert json.loads(attributes["rule"]) == rule
        assert (attributes["schema"], attributes["samples"], attributes["levels"]) == (1, 32, 5)
        assert attributes["normalisation"] == "mean"
        assert attributes["content_sha256"] == small_atlas.content_hash()
        assert set(json.loads(attributes["generator"])) >= {"linkage-atlas", "numpy", "h5py", "hdf5"}
        assert "branch -1" in attributes["curve"]
        for name in ARRAYS:
            assert file[name].attrs["units"] and np.array_equal(file[name][()], getattr(small_atlas, name))


@pytest.mark.parametrize("samples", [16, 32, 256])
def test_curves_and_features_over_any_span_follow_from_the_file_alone(samples) -> None:
    atlas = make_atlas(AtlasRule(TypeRule(60, 4, OrderRule.FULL_CRANK), samples))
    rng = np.random.default_rng(samples)
    rows = rng.choice(len(atlas), 300)
    spectrum = np.fft.rfft(atlas.curves(rows))[:, : samples // 2] / samples
    spectrum[:, 1:] *= 2
    for _ in range(5):
        start, span = rng.uniform(0, 2 * np.pi), rng.uniform(-6, 6)
        crank = start + np.linspace(0, span, 128)
        series = (spectrum @ np.exp(1j * np.outer(np.arange(samples // 2), crank))).real
        from_file = series + atlas.winding[rows, None] * crank
        curve = coupler_angle(atlas.lengths[rows].astype(float), np.ones(len(rows)), crank)
        error = atlas.curve_error[rows]
        assert np.all(np.abs(from_file - curve).max(axis=1) <= error + 1e-14)
        for found, wanted in zip(haar.features(from_file), haar.features(curve)):
            assert np.all(np.abs(found - wanted).reshape(len(rows), -1).max(axis=1) <= error + 1e-14)


@pytest.mark.parametrize("samples", [8, 15, 48, 8192, 0, -16])
def test_samples_are_a_power_of_two_in_range(samples) -> None:
    with pytest.raises(FieldError) as caught:
        AtlasRule(samples=samples)
    assert caught.value.field == "/samples" and str(samples) in caught.value.message


# -- damage -----------------------------------------------------------------------------------------------------------


def assert_bit_flips_are_refused(data: bytes, positions: np.ndarray, bits: np.ndarray) -> None:
    damaged = bytearray(data)
    for position, bit in zip(positions.tolist(), bits.tolist()):
        damaged[position] ^= 1 << bit
        with pytest.raises(AtlasError) as caught:
            decode_atlas(damaged)
        assert caught.value.fault in (AtlasFault.CHECKSUM, AtlasFault.SCHEMA)
        damaged[position] ^= 1 << bit
    assert damaged == data


@pytest.fixture(scope="module")
def tiny_bytes() -> bytes:
    return encode_atlas(make_atlas(AtlasRule(TypeRule(60, 6), 16)))


def test_every_flipped_bit_is_refused(tiny_bytes) -> None:
    rng = np.random.default_rng(1)
    # every byte of the header, the start of the HDF5 image, and anywhere
    spread = rng.integers(HEADER_BYTES, len(tiny_bytes), 1500)
    positions = np.concatenate([np.arange(HEADER_BYTES + 500), spread])
    assert_bit_flips_are_refused(tiny_bytes, positions, rng.integers(8, size=positions.size))


@pytest.mark.fault
def test_a_thousand_bit_flips_of_the_default_atlas_are_refused(atlas_path) -> None:
    data = atlas_path.read_bytes()
    rng = np.random.default_rng(2)
    assert_bit_flips_are_refused(data, rng.integers(len(data), size=1000), rng.integers(8, size=1000))


def test_every_truncation_and_extension_is_refused(tiny_bytes) -> None:
    lengths = [*range(HEADER_BYTES + 3), *np.linspace(HEADER_BYTES, len(tiny_bytes) - 1, 200).astype(int)]
    for length in lengths:
        wanted = AtlasFault.SCHEMA if length < HEADER_BYTES else AtlasFault.CHECKSUM
        assert fault_of(tiny_bytes[:length]) is wanted
    assert fault_of(tiny_bytes + b"\0") is AtlasFault.CHECKSUM


def test_damage_is_found_before_hdf5_parses_a_byte(tiny_bytes, monkeypatch) -> None:
    monkeypatch.setattr(h5py, "File", lambda *_: pytest.fail("parsed"))
    with pytest.raises(AtlasError):
        decode_atlas(tiny_bytes[:-1])
    assert check_bytes(tiny_bytes) == tiny_bytes[HEADER_BYTES:]


# -- foreign files ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content", [b"", b"hello\n", b"linkage-atlas", b"\x89HDF\r\n\x1a\n" * 400, b"linkage-atlas 2\n" * 99]
)
def test_foreign_bytes_are_refused(content) -> None:
    assert fault_of(content) is AtlasFault.SCHEMA
    assert fault_of(with_header(content)) is AtlasFault.SCHEMA


def test_a_later_schema_is_named(tiny_bytes) -> None:
    with pytest.raises(AtlasError, match="another schema than 1"):
        decode_atlas(tiny_bytes.replace(b"linkage-atlas 1\n", b"linkage-atlas 2\n", 1))


def test_places_that_hold_no_file(tmp_path, tiny_bytes) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    for path in (tmp_path, tmp_path / "fifo", tmp_path / "dangling", tmp_path / "a" / "b", Path("/dev/zero")):
        with pytest.raises(AtlasError) as caught:
            load_atlas(path)
        assert caught.value.fault is AtlasFault.MISSING
    (tmp_path / "atlas.h5").write_bytes(tiny_bytes)
    for limits in ({"max_bytes": len(tiny_bytes) - 1}, {"max_types": 5}):
        with pytest.raises(AtlasError) as caught:
            load_atlas(tmp_path / "atlas.h5", **limits)
        assert caught.value.fault is AtlasFault.LIMIT
    assert len(load_atlas(tmp_path / "atlas.h5", len(tiny_bytes))) > 5


def test_arrays_on_disk_are_the_same_and_take_no_memory(tmp_path) -> None:
    atlas = make_atlas(AtlasRule(TypeRule(200, 2), 64))
    (tmp_path / "atlas.h5").write_bytes(encode_atlas(atlas))
    peaks = []
    for others in ({"new": temporary_arrays(tmp_path)}, {}):
        tracemalloc.start()
        loaded = load_atlas(tmp_path / "atlas.h5", **others)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        for name in ARRAYS:
            assert np.array_equal(getattr(loaded, name), getattr(atlas, name))
            assert not getattr(loaded, name).flags.writeable
    assert peaks[0] < peaks[1] - 0.9 * atlas.details.nbytes
    assert [path.name for path in tmp_path.iterdir()] == ["atlas.h5"]


# -- hostile HDF5 behind a header that matches ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tiny() -> Atlas:
    return make_atlas(AtlasRule(TypeRule(60, 6), 16))


def edited(data: bytes, edit) -> bytes:
    """The file after ``edit(file)``, behind a matching header."""
    image = io.BytesIO(data[HEADER_BYTES:])
    with h5py.File(image, "r+") as file:
        edit(file)
    return with_header(image.getvalue())


def swap(make, name: str = "average"):
    """An edit that puts ``make(file, values)`` in place of a dataset."""
    return lambda file: make(file, taken(file, name))


def taken(file: h5py.File, name: str) -> np.ndarray:
    """The values of a dataset, which the file no longer has."""
    values = file[name][()]
    del file[name]
    return values


def stored(change=lambda values: {"data": values}, name: str = "average", **options):
    """An edit that stores a dataset in another way: ``change(values)`` says of which values or which shape."""
    return swap(lambda file, values: file.create_dataset(name, **change(values), **options), name)


def linked(to):
    return swap(lambda file, _: file.__setitem__("average", to))


def set_attribute(name: str, value):
    def edit(file: h5py.File) -> None:
        del file.attrs[name]
        file.attrs[name] = value

    return edit


def set_rule(**changes):
    return lambda file: set_attribute("rule", json.dumps(json.loads(file.attrs["rule"]) | changes))(file)


def set_value(name: str, value):
    return lambda file: file[name].__setitem__(0, value)


def empty(values: np.ndarray) -> dict[str, object]:
    """The shape of a dataset alone."""
    return {"shape": values.shape, "dtype": values.dtype}


def virtual(file: h5py.File, values: np.ndarray) -> None:
    layout = h5py.VirtualLayout(values.shape, values.dtype)
    layout[:] = h5py.VirtualSource("elsewhere.h5", "average", values.shape)
    file.create_virtual_dataset("average", layout)


def deflate_bomb(file: h5py.File, values: np.ndarray, **filters: bool) -> None:
    chunks = file.create_dataset("average", **empty(values), chunks=values.shape, compression="gzip", **filters)
    squeeze = zlib.compressobj(9)
    block = bytes(1 << 24)
    bomb = b"".join(squeeze.compress(block) for _ in range(8)) + squeeze.flush()  # 128 MiB in 128 KiB
    chunks.id.write_direct_chunk((0,), bomb)


INFINITE = '{"perimeter": 1e999, "smallest": 2, "order": "increasing", "samples": 16}'
BOMBS = {
    "deflate_bomb": swap(deflate_bomb),
    "deflate_bomb_as_written": swap(lambda f, v: deflate_bomb(f, v, shuffle=True, fletcher32=True)),
}
HOSTILE = {
    "external_link": linked(h5py.ExternalLink("other.h5", "/average")),
    "soft_link": linked(h5py.SoftLink("/curve_error")),
    "hard_link_to_another": swap(lambda f, _: f.__setitem__("average", f["curve_error"])),
    "group": swap(lambda f, _: f.create_group("average")),
    "named_type": linked(np.dtype("f8")),
    "external_storage": stored(lambda v: {**empty(v), "external": [("/etc/hostname", 0, v.nbytes)]}),
    "virtual": swap(virtual),
    "wrong_type": stored(lambda v: {"data": v.astype("f4")}),
    "big_endian": stored(lambda v: {"data": v.astype(">f8")}),
    "objects": stored(lambda v: {"shape": v.shape}, dtype=h5py.string_dtype()),
    "references": stored(lambda v: {"shape": v.shape}, dtype=h5py.ref_dtype),
    "sequences": stored(lambda v: {"shape": v.shape}, dtype=h5py.vlen_dtype(np.float64)),
    "huge_shape": stored(lambda v: {"shape": (1 << 50,)}, dtype="f8", chunks=(1 << 16,)),
    "huge_chunk": stored(lambda v: {"shape": v.shape}, dtype="f8", chunks=(1 << 28,), maxshape=(None,)),
    "scalar": stored(lambda v: {"data": 1.0}),
    "nothing": stored(lambda v: {"data": h5py.Empty("f8")}),
    "one_row_less": stored(lambda v: {"data": v[1:]}),
    "foreign_filter": stored(compression="lzf"),
    "scale_offset": stored(name="lengths", scaleoffset=8),
    "missing_dataset": lambda f: f.__delitem__("winding"),
    "extra_dataset": lambda f: f.create_dataset("extra", data=1),
    "extra_group": lambda f: f.create_group("extra"),
    "missing_attribute": lambda f: f.attrs.__delitem__("content_sha256"),
    "schema_as_text": set_attribute("schema", "1"),
    "schema_of_another": set_attribute("schema", 2),
    "schema_as_array": set_attribute("schema", np.ones(7, dtype=int)),
    "hash_as_number": set_attribute("content_sha256", 7),
    "rule_is_no_json": set_attribute("rule", "{"),
    "rule_is_a_list": set_attribute("rule", "[]"),
    "rule_is_deep": set_attribute("rule", "[" * 30_000),
    "rule_has_infinity": set_attribute("rule", INFINITE),
    "rule_of_huge_perimeter": set_rule(perimeter=10**30),
    "rule_of_no_order": set_rule(order="any"),
    "rule_of_odd_samples": set_rule(samples=17),
    "generator_is_a_list": set_attribute("generator", "[1]"),
    "generator_of_20_MB": set_attribute("generator", json.dumps({"numpy": "1" * 20_000_000})),
    "rule_of_60_MB": set_attribute("rule", "1" * 60_000_000),
    "other_attribute_of_20_MB": lambda f: f.attrs.__setitem__("more", "1" * 20_000_000),
    "generator_of_long_text": set_attribute("generator", json.dumps({"numpy": "1" * 5000})),
    "generator_with_a_lone_surrogate": set_attribute("generator", '{"numpy": "\\ud800"}'),
    "generator_with_an_escape": set_attribute("generator", json.dumps({"numpy": "\x1b[31m2"})),
    "generator_with_an_escape_in_a_name": set_attribute("generator", json.dumps({"\x9b2J": "2"})),
    "generator_that_writes_backwards": set_attribute("generator", json.dumps({"numpy": "\u202e2"})),
    "generator_of_bytes": set_attribute("generator", b'{"numpy": "\xff"}'),
}


def renewed(change):
    """An edit of the arrays with the hash of the new ones: consistent in itself, and not what the lengths give."""

    def edit(file: h5py.File) -> None:
        change(file)
        arrays = {name: file[name][()] for name in COLUMNS}
        changed = Atlas(rule=AtlasRule(TypeRule(60, 6), 16), generator={}, **arrays)
        set_attribute("content_sha256", changed.content_hash())(file)

    return edit


def scaled(name: str, factor: float):
    def edit(file: h5py.File) -> None:
        file[name][...] = (file[name][()] * factor).astype(file[name].dtype)

    return renewed(edit)


HOSTILE_CONTENT = {
    "renewed_average": scaled("average", 1 + 1e-6),
    "renewed_details": scaled("details", 1.001),
    "renewed_details_of_one_row": renewed(lambda f: f["details"].__setitem__((0, 3), f["details"][0, 3] + 1e-4)),
    "renewed_error_too_small": scaled("curve_error", 0.5),
    "renewed_error_too_large": scaled("curve_error", 2.0),
    "renewed_winding": renewed(lambda f: f["winding"].__setitem__(0, 1 - f["winding"][0])),
    "missing_chunks": stored(empty, chunks=(7,)),
    "never_written": stored(empty),
    "nan": set_value("average", np.nan),
    "infinite_details": set_value("details", np.inf),
    "large": set_value("average", 1e300),
    "negative_error": set_value("curve_error", -1e-9),
    "nan_error": set_value("curve_error", np.nan),
    "winding_of_two": set_value("winding", 2),
    "other_lengths": set_value("lengths", [6, 7, 23, 24]),
    "other_value": set_value("details", 0.125),
    "hash": set_attribute("content_sha256", "0" * 64),
}


@pytest.mark.parametrize("name", [*HOSTILE, *HOSTILE_CONTENT, *BOMBS, "rule_beyond_the_limit"])
def test_hostile_hdf5_is_refused_without_a_crash_or_much_memory(name, tiny_bytes, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    wanted = AtlasFault.CONTENT if name in HOSTILE_CONTENT else AtlasFault.SCHEMA
    if name == "rule_beyond_the_limit":
        edit, wanted = set_rule(perimeter=10_000, order="full_crank"), AtlasFault.LIMIT
    else:
        edit = (HOSTILE | HOSTILE_CONTENT | BOMBS)[name]
    data = edited(tiny_bytes, edit)
    tracemalloc.start()
    try:
        assert fault_of(data) is wanted
        assert tracemalloc.get_traced_memory()[1] < (120e6 if name == "rule_of_60_MB" else 400e6)
    finally:
        tracemalloc.stop()


def test_the_unharmed_image_passes_the_same_way(tiny_bytes, tiny) -> None:
    assert decode_atlas(edited(tiny_bytes, lambda file: None)).content_hash() == tiny.content_hash()
