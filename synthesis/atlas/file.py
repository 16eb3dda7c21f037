"""The atlas as the bytes of its file: a checked header of 512 bytes, then an HDF5 image.

HDF5 never touches a disk here: the image is built and read in memory. The header lies in what HDF5 calls the user block,
so any HDF5 reader opens the file. It holds a SHA-256 of everything behind it, which is compared *before* HDF5 parses a byte.
"""

from __future__ import annotations

import hashlib
import io
import json
import stat
import unicodedata
import zlib
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from synthesis.atlas import haar
from synthesis.atlas.rows import compute_rows
from synthesis.atlas.table import COLUMNS, SCHEMA, Atlas, AtlasRule
from synthesis.errors import AtlasError, AtlasFault
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, count_types, enumerate_types

HEADER_BYTES = 512
MAGIC = "linkage-atlas"
CHUNK_BYTES = 1 << 20
MAX_TYPES = 8_000_000
"""Types that are read unless the caller sets another limit."""
MAX_REST_BYTES = 1 << 20
"""Most bytes of a file beside its arrays: names, attributes, and where the chunks are."""
MAX_TEXT = 4096
"""Longest text of an attribute, in characters."""
SAMPLED_ROWS = 256
"""Rows that are computed again when a file is loaded."""

_UNITS = {
    "lengths": "whole numbers L1 crank, L2 coupler, L3 rocker, L4 ground; type number n is row n - 1",
    "average": "radians: Haar average of the periodic part of the coupler angle over one turn of the crank",
    "details": "radians: Haar details, (mean of first half - mean of second half) / 2 of each block, coarse to fine: "
    "level n, block l (from 0) is column 2^n - 1 + l",
    "winding": "turns of the coupler in one turn of the crank; coupler angle = winding * crank angle + periodic part",
    "curve_error": "radians: bound of the error, at any crank angle, of the stored curve's band-limited interpolation "
    "(all harmonics below samples / 2)",
}
_CURVE = (
    "coupler angle theta2 (measured from the ground line A->B, branch +1: C left of D->B) at crank angles "
    "2 pi k / samples, k = 0 .. samples - 1, the end not repeated; branch -1: theta2(x) = -theta2_plus(-x)"
)


def _header(sha256: str, size: int) -> bytes:
    text = f"{MAGIC} {SCHEMA}\nsha256 {sha256}\nbytes {size}\n"
    return text.encode().ljust(HEADER_BYTES - 1, b" ") + b"\n"


def encode_atlas(atlas: Atlas) -> bytes:
    """The file's bytes. Law: the same bytes for the same atlas, on every run on one machine."""
    with h5py.File.in_memory(libver=("v110", "v110")) as file:
        file.attrs.update(
            {
                "schema": atlas.schema,
                "rule": json.dumps(atlas.rule.as_json(), sort_keys=True),
                "curve": _CURVE,
                "normalisation": "mean",
                "levels": haar.levels(atlas.rule.samples),
                "samples": atlas.rule.samples,
                "generator": json.dumps(atlas.generator, sort_keys=True),
                "content_sha256": atlas.content_hash(),
            }
        )
        for name, dtype in COLUMNS.items():
            values = np.asarray(getattr(atlas, name), dtype=dtype)
            options: dict[str, Any] = {}
            if values.size:
                row_bytes = values.dtype.itemsize * int(np.prod(values.shape[1:], dtype=int))
                rows = min(len(values), max(1, CHUNK_BYTES // row_bytes))
                options = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
                options["chunks"] = (rows, *values.shape[1:])
            dataset = file.create_dataset(name, data=values, track_times=False, **options)
            dataset.attrs["units"] = _UNITS[name]
        file.flush()
        body = file.id.get_file_image()
    return _header(hashlib.sha256(body).hexdigest(), len(body)) + body


def _refuse(fault: AtlasFault, detail: str) -> None:
    raise AtlasError(fault, detail)


def _check_rest(file: h5py.File, size: int) -> None:
    """Refuse a file that holds much beside its arrays, before any of it is read: the texts of the attributes are short."""
    if set(file) != set(COLUMNS):
        _refuse(AtlasFault.SCHEMA, f"it holds {len(set(file))} entries, wanted {', '.join(COLUMNS)}")
    stored = 0
    for name in COLUMNS:
        if file.get(name, getclass=True) is not h5py.Dataset or not isinstance(
            file.get(name, getlink=True), h5py.HardLink
        ):
            _refuse(AtlasFault.SCHEMA, f"{name} is no plain dataset of this file")
        stored += file[name].id.get_storage_size()
    if not 0 <= size - stored <= MAX_REST_BYTES:
        _refuse(AtlasFault.SCHEMA, f"it holds {size - stored:,} bytes beside its arrays")


def _plain(text: str) -> str:
    """A short text that can be shown as it is."""
    if len(text) > MAX_TEXT or any(unicodedata.category(mark) in ("Cc", "Cf", "Cs", "Zl", "Zp") for mark in text):
        _refuse(AtlasFault.SCHEMA, "an attribute's text is too long or holds control characters")
    return text


def _attribute(file: h5py.File, name: str, kind: type) -> Any:
    """A scalar attribute, read after its type has been checked, its size by `_check_rest`."""
    if name not in file.attrs:
        _refuse(AtlasFault.SCHEMA, f"attribute {name} is missing")
    info = file.attrs.get_id(name)
    is_text = info.dtype.kind == "O" and h5py.check_string_dtype(info.dtype) is not None
    if info.shape != () or not (is_text if kind is str else info.dtype.kind in "iu"):
        _refuse(AtlasFault.SCHEMA, f"attribute {name} is not a single {kind.__name__}")
    value = kind(file.attrs[name])
    return _plain(value) if kind is str else value


def _dataset(file: h5py.File, name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """One array, read after checks for external data, fill values and decompressed size."""
    dataset = file[name]
    creation = dataset.id.get_create_plist()
    filters = {creation.get_filter(k)[0] for k in range(creation.get_nfilters())}
    allowed = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
    if dataset.is_virtual or dataset.external or not filters <= allowed:
        _refuse(AtlasFault.SCHEMA, f"{name} uses external or virtual storage or a foreign filter")
    if dataset.dtype != np.dtype(COLUMNS[name]) or dataset.shape != shape:
        _refuse(AtlasFault.SCHEMA, f"{name} has type {dataset.dtype} and shape {dataset.shape}, wanted {shape}")
    if dataset.chunks and np.prod(dataset.chunks, dtype=float) * dataset.dtype.itemsize > 4 * CHUNK_BYTES:
        _refuse(AtlasFault.SCHEMA, f"{name} has chunks of {dataset.chunks}")
    if dataset.chunks:
        complete = dataset.id.get_num_chunks() == np.prod(
            [-(-s // c) for s, c in zip(shape, dataset.chunks)], dtype=int
        )
    else:
        complete = dataset.id.get_storage_size() == dataset.nbytes
    if h5py.h5z.FILTER_DEFLATE in filters:
        _check_inflation(dataset)
    if not complete:  # HDF5 would fill the gap silently
        _refuse(AtlasFault.CONTENT, f"{name} lacks a part of its data")
    values = dataset[()]
    values.flags.writeable = False
    return values


def _check_inflation(dataset: h5py.Dataset) -> None:
    """Refuse chunks that inflate to more than a chunk: HDF5 would inflate them completely, to a thousand times their size."""
    chunks: list[Any] = []
    dataset.id.chunk_iter(chunks.append)
    size = int(np.prod(dataset.chunks)) * dataset.dtype.itemsize
    for chunk in chunks:
        _, stored = dataset.id.read_direct_chunk(chunk.chunk_offset)
        inflater = zlib.decompressobj()
        if chunk.filter_mask or len(inflater.decompress(stored, size + 1)) != size or len(inflater.unused_data) > 4:
            _refuse(AtlasFault.SCHEMA, f"{dataset.name} has a chunk that does not inflate to its size")


def check_bytes(data: bytes) -> memoryview:
    """The HDF5 image behind a header that it matches; AtlasError otherwise. Costs one SHA-256 and parses nothing."""
    body = memoryview(data)[HEADER_BYTES:]
    _check_header(data[:HEADER_BYTES], hashlib.sha256(body).hexdigest(), len(body))
    return body


def _check_header(head: bytes, sha256: str, size: int) -> None:
    if len(head) < HEADER_BYTES or not head.startswith(MAGIC.encode()):
        _refuse(AtlasFault.SCHEMA, "its header is not an atlas's")
    if not head.startswith(f"{MAGIC} {SCHEMA}\n".encode()):
        _refuse(AtlasFault.SCHEMA, f"its header names another schema than {SCHEMA}")
    if _header(sha256, size) != head:
        _refuse(AtlasFault.CHECKSUM, f"{size} bytes behind the header")


def file_hash(path: Path, max_bytes: int | None = None) -> str:
    """The SHA-256 in an atlas file's header, which all behind it has been compared with; nothing is parsed.

    Raises
    ------
    AtlasError
        Missing, larger than allowed, or not what was written.
    """
    with _open(path, max_bytes) as file:
        try:
            head = file.read(HEADER_BYTES)
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]  # it has readinto
            _check_header(head, sha256, file.tell() - len(head))
        except OSError as error:
            raise AtlasError(AtlasFault.MISSING, f"{path}: {error.strerror}") from None
    return sha256


def _open(path: Path, max_bytes: int | None) -> BinaryIO:
    """A regular file of at most so many bytes, open for reading."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            _refuse(AtlasFault.MISSING, f"{path} is no regular file")
        if max_bytes is not None and status.st_size > max_bytes:
            _refuse(AtlasFault.LIMIT, f"{status.st_size} bytes, at most {max_bytes}")
        return path.open("rb")
    except OSError as error:
        raise AtlasError(AtlasFault.MISSING, f"{path}: {error.strerror}") from None


def decode_atlas(data: bytes, max_types: int = MAX_TYPES) -> Atlas:
    """The atlas in a file's bytes.

    Parameters
    ----------
    data : bytes
        The whole file.
    max_types : int
        Refuse an atlas of more types before any of its arrays is read.

    Returns
    -------
    Atlas
        Law: ``decode_atlas(encode_atlas(atlas))`` holds the same arrays.

    Raises
    ------
    AtlasError
        Where the bytes are not those that were written, not of this schema, or the arrays are not what the rule enumerates.
    """
    body = check_bytes(data)
    try:
        with h5py.File(io.BytesIO(body), "r") as file:
            _check_rest(file, len(body))
            atlas, claimed = _read(file, max_types)
    except AtlasError:
        raise
    except Exception as error:  # h5py raises whatever type its C library's state suggests
        raise AtlasError(AtlasFault.SCHEMA, f"HDF5 cannot read it: {type(error).__name__}") from None
    if not np.array_equal(atlas.lengths, enumerate_types(atlas.rule.types)):
        _refuse(AtlasFault.CONTENT, "the lengths are not those of its rule")
    for name in ("average", "details", "curve_error"):
        values = getattr(atlas, name)
        if values.size and not (values.min() > -20 and values.max() < 20):  # NaN fails both
            _refuse(AtlasFault.CONTENT, f"{name} is not finite")
    if np.any((atlas.winding < 0) | (atlas.winding > 1)) or np.any(atlas.curve_error < 0):
        _refuse(AtlasFault.CONTENT, "winding or curve_error is out of range")
    if (found := atlas.content_hash()) != claimed:
        _refuse(AtlasFault.CONTENT, "the content hash differs")
    _check_sample(atlas, found)
    return replace(atlas, known_hash=found)


def _check_sample(atlas: Atlas, seed: str) -> None:
    """Compute some rows again from their lengths, and compare: a file of other curves is refused, however sound its bytes are.

    Sines and roots differ in their last bits from one processor to another, so rows need to agree only as far as that goes.
    """
    if np.any(atlas.winding != atlas.mechanism.winding(atlas.lengths.astype(float))):
        _refuse(AtlasFault.CONTENT, "winding is not that of the lengths")
    chosen = np.random.default_rng(int(seed, 16)).permutation(len(atlas))[:SAMPLED_ROWS]
    again = compute_rows(atlas.lengths[chosen], atlas.samples, atlas.mechanism)
    for name, absolute, relative in (("average", 1e-9, 0.0), ("details", 4e-6, 0.0), ("curve_error", 2e-6, 1e-3)):
        values, wanted = getattr(atlas, name)[chosen], getattr(again, name)
        if not np.allclose(values, wanted, relative, absolute):
            _refuse(AtlasFault.CONTENT, f"{name} is not what the lengths give")


def load_atlas(
    path: Path, max_bytes: int | None = None, max_types: int = MAX_TYPES, sha256: str | None = None
) -> Atlas:
    """The verified atlas of a file, of the one whose header says ``sha256`` if that is given; nothing of it stays open.

    Raises
    ------
    AtlasError
        Missing, larger than allowed, damaged, foreign, or inconsistent.
    """
    with _open(path, max_bytes) as file:
        try:
            data = file.read()
        except OSError as error:
            raise AtlasError(AtlasFault.MISSING, f"{path}: {error.strerror}") from None
    if sha256 is not None and f"sha256 {sha256}\n".encode() not in data[:HEADER_BYTES]:
        _refuse(AtlasFault.CHECKSUM, "it has been replaced meanwhile")
    return decode_atlas(data, max_types)


def _read(file: h5py.File, max_types: int) -> tuple[Atlas, str]:
    if _attribute(file, "schema", int) != SCHEMA:
        _refuse(AtlasFault.SCHEMA, "another schema")
    try:
        rule_values = json.loads(_attribute(file, "rule", str))
        versions = json.loads(_attribute(file, "generator", str))
        generator = {_plain(str(k)): _plain(str(v)) for k, v in versions.items()}
        rule = AtlasRule(
            TypeRule(int(rule_values["perimeter"]), int(rule_values["smallest"]), OrderRule(rule_values["order"])),
            int(rule_values["samples"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise AtlasError(AtlasFault.SCHEMA, "its rule cannot be read") from None
    types = count_types(rule.types)
    if types > max_types:
        _refuse(AtlasFault.LIMIT, f"{types} types, at most {max_types}")
    shapes = {"lengths": (types, 4), "details": (types, rule.samples - 1)}
    arrays: dict[str, Any] = {name: _dataset(file, name, shapes.get(name, (types,))) for name in COLUMNS}
    return Atlas(rule=rule, generator=generator, **arrays), _attribute(file, "content_sha256", str)


def generator_versions() -> dict[str, str]:
    """Versions of what computes and writes an atlas, for its ``generator`` attribute."""
    return {
        "linkage-atlas": version("linkage-atlas"),
        "numpy": np.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "pywavelets": version("PyWavelets"),
    }
