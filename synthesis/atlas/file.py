"""The atlas as the bytes of its file: a checked header of 512 bytes, then an HDF5 image.

The header lies in what HDF5 calls the user block, so any HDF5 reader opens the file. It holds a SHA-256 of everything behind it,
which is compared *before* HDF5 parses a byte. A large image is written and read a part at a time, each column after the other,
so neither takes memory that grows with the types, unless the arrays are wanted in memory.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import unicodedata
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.atlas import haar
from synthesis.atlas.cells import New
from synthesis.atlas.header import (
    HEADER_BYTES,
    MAX_TYPES,
    check_bytes,
    checked_hash,
    claimed_hash,
    header_of,
    open_atlas_file,
    refuse,
)
from synthesis.atlas.index import reserve
from synthesis.atlas.table import (
    COLUMNS,
    SCHEMA,
    UNITS,
    Atlas,
    AtlasRows,
    AtlasRule,
    Parts,
    compute_rows,
    content_hash,
)
from synthesis.errors import AtlasError, AtlasFault

CHUNK_BYTES = 1 << 20
_LIBVER = ("v110", "v110")
_FILTERS = (h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32)
"""Of the arrays, in the order in which they are written."""
MAX_REST_BYTES = 1 << 20
"""Most bytes of a file beside its arrays: names, attributes, and where the chunks are."""
MAX_TEXT = 4096
"""Longest text of an attribute, in characters."""
SAMPLED_ROWS = 256
"""Rows that are computed again when a file is loaded."""


def encode_atlas(atlas: Atlas) -> bytes:
    """The file's bytes. Law: the same bytes for the same atlas, on every run on one machine."""
    with h5py.File.in_memory(libver=_LIBVER) as file:
        _fill(file, atlas.rule, atlas.generator, atlas.content_hash(), lambda name: [getattr(atlas, name)])
        file.flush()
        body = file.id.get_file_image()
    return header_of(hashlib.sha256(body).hexdigest(), len(body)) + body


def write_image(path: Path, rule: AtlasRule, generator: dict[str, str], parts: Parts) -> tuple[str, str]:
    """Write what is behind the header to a file of its own, from columns in parts, each of which is asked for twice.

    HDF5 writes to disk itself here. Where it finds no place it ends the process, so the place is reserved first: that of the
    arrays before they are compressed.

    Raises `OSError`: the disk is full, or the place cannot be written.

    Returns
    -------
    header, content_sha256 : str
        Law: the header and the file's bytes are those of `encode_atlas`.
    """
    content = content_hash(rule, parts)
    with h5py.File(path, "w", libver=_LIBVER) as file:
        raw = sum(math.prod(shape) * np.dtype(COLUMNS[name]).itemsize for name, shape in rule.shapes.items())
        with path.open("r+b") as place:
            reserve(place.fileno(), 0, raw + raw // 64 + MAX_REST_BYTES)
        _fill(file, rule, generator, content, parts)
        file.flush()
        size = file.id.get_filesize()
    os.truncate(path, size)
    with path.open("rb") as image:
        return header_of(hashlib.file_digest(image, "sha256").hexdigest(), size).decode(), content


def _fill(file: h5py.File, rule: AtlasRule, generator: dict[str, str], content: str, parts: Parts) -> None:
    """Write attributes and columns. The order of all steps decides where HDF5 puts what, and so the file's bytes."""
    file.attrs.update(
        {
            "schema": SCHEMA,
            "rule": json.dumps(rule.as_json(), sort_keys=True),
            "curve": rule.kind.curve,
            "normalisation": "mean",
            "levels": haar.levels(rule.samples),
            "samples": rule.samples,
            "generator": json.dumps(generator, sort_keys=True),
            "content_sha256": content,
        }
    )
    for name, shape in rule.shapes.items():
        dtype = np.dtype(COLUMNS[name])
        options: dict[str, Any] = {}
        if math.prod(shape):
            rows = min(shape[0], max(1, CHUNK_BYTES // (dtype.itemsize * math.prod(shape[1:]))))
            options = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
            options["chunks"] = (rows, *shape[1:])
        written = file.create_dataset(name, shape, dtype, track_times=False, **options)
        first = 0
        for part in parts(name):
            if len(part):
                written[first : first + len(part)] = part
            first += len(part)
        dataset = written  # this closes the one before, which writes its last chunk
        dataset.attrs["units"] = rule.kind.lengths if name == "lengths" else UNITS[name]


def _check_rest(file: h5py.File, size: int) -> None:
    """Refuse a file that holds much beside its arrays, before any of it is read: the texts of the attributes are short."""
    if set(file) != set(COLUMNS):
        refuse(AtlasFault.SCHEMA, f"it holds {len(set(file))} entries, wanted {', '.join(COLUMNS)}")
    stored = 0
    for name in COLUMNS:
        if file.get(name, getclass=True) is not h5py.Dataset or not isinstance(
            file.get(name, getlink=True), h5py.HardLink
        ):
            refuse(AtlasFault.SCHEMA, f"{name} is no plain dataset of this file")
        stored += file[name].id.get_storage_size()
    if not 0 <= size - stored <= MAX_REST_BYTES:
        refuse(AtlasFault.SCHEMA, f"it holds {size - stored:,} bytes beside its arrays")


def _plain(text: str) -> str:
    """A short text that can be shown as it is."""
    if len(text) > MAX_TEXT or any(unicodedata.category(mark) in ("Cc", "Cf", "Cs", "Zl", "Zp") for mark in text):
        refuse(AtlasFault.SCHEMA, "an attribute's text is too long or holds control characters")
    return text


def _attribute(file: h5py.File, name: str, kind: type) -> Any:
    """A scalar attribute, read after its type has been checked, its size by `_check_rest`."""
    if name not in file.attrs:
        refuse(AtlasFault.SCHEMA, f"attribute {name} is missing")
    info = file.attrs.get_id(name)
    is_text = info.dtype.kind == "O" and h5py.check_string_dtype(info.dtype) is not None
    if info.shape != () or not (is_text if kind is str else info.dtype.kind in "iu"):
        refuse(AtlasFault.SCHEMA, f"attribute {name} is not a single {kind.__name__}")
    value = kind(file.attrs[name])
    return _plain(value) if kind is str else value


def _dataset(file: h5py.File, name: str, shape: tuple[int, ...], new: New) -> NDArray[Any]:
    """One array, read after checks for external data, fill values and decompressed size."""
    dataset = file[name]
    creation = dataset.id.get_create_plist()
    filters = tuple(creation.get_filter(k)[0] for k in range(creation.get_nfilters()))
    if dataset.is_virtual or dataset.external or not set(filters) <= set(_FILTERS):
        refuse(AtlasFault.SCHEMA, f"{name} uses external or virtual storage or a foreign filter")
    if dataset.dtype != np.dtype(COLUMNS[name]) or dataset.shape != shape:
        refuse(AtlasFault.SCHEMA, f"{name} has type {dataset.dtype} and shape {dataset.shape}, wanted {shape}")
    if dataset.chunks and np.prod(dataset.chunks, dtype=float) * dataset.dtype.itemsize > 4 * CHUNK_BYTES:
        refuse(AtlasFault.SCHEMA, f"{name} has chunks of {dataset.chunks}")
    if dataset.chunks:
        complete = dataset.id.get_num_chunks() == np.prod(
            [-(-s // c) for s, c in zip(shape, dataset.chunks)], dtype=int
        )
    else:
        complete = dataset.id.get_storage_size() == dataset.nbytes
    if not complete:  # HDF5 would fill the gap silently
        refuse(AtlasFault.CONTENT, f"{name} lacks a part of its data")
    if dataset.chunks:
        largest = int(math.prod(dataset.chunks) * dataset.dtype.itemsize * 1.01) + 64  # one that cannot be compressed
        sizes: list[int] = []
        dataset.id.chunk_iter(lambda chunk: sizes.append(chunk.size))
        if max(sizes, default=0) > largest:  # it would inflate to more than a chunk
            refuse(AtlasFault.SCHEMA, f"{name} has a chunk of {max(sizes):,} bytes, at most {largest:,}")
    values = new(name, COLUMNS[name], shape)
    if values.size:
        rows = dataset.chunks[0] if dataset.chunks else 1
        rows *= max(1, CHUNK_BYTES // (rows * values[:1].nbytes))
        for first in range(0, len(values), rows):
            part = np.s_[first : first + rows]
            dataset.read_direct(values, part, part)
    values.flags.writeable = False
    return values


class _Image(io.FileIO):
    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """As of a file."""
        return super().seek(offset + HEADER_BYTES * (whence == io.SEEK_SET), whence) - HEADER_BYTES

    def tell(self) -> int:
        """As of a file."""
        return super().tell() - HEADER_BYTES


def _in_memory(name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    return np.empty(shape, dtype)


def decode_atlas(data: bytes, max_types: int = MAX_TYPES) -> Atlas:
    """The atlas in a file's bytes, as `load_atlas` has it. Law: ``decode_atlas(encode_atlas(atlas))`` holds the same arrays."""
    return _decoded(io.BytesIO(check_bytes(data)), len(data) - HEADER_BYTES, max_types, _in_memory)


def _decoded(image: Any, size: int, max_types: int, new: New) -> Atlas:
    try:
        with h5py.File(image, "r") as file:
            _check_rest(file, size)
            atlas, claimed = _read(file, max_types, new)
    except AtlasError:
        raise
    except Exception as error:  # h5py raises whatever type its C library's state suggests
        if isinstance(error, OSError) and error.errno is not None:  # the disk's, and not HDF5's about the image
            raise
        raise AtlasError(AtlasFault.SCHEMA, f"HDF5 cannot read it: {type(error).__name__}") from None
    _check_rows(atlas)
    if (found := atlas.content_hash()) != claimed:
        refuse(AtlasFault.CONTENT, "the content hash differs")
    _check_sample(atlas, found)
    return replace(atlas, known_hash=found)


def _check_rows(atlas: Atlas) -> None:
    """Refuse rows that are of other types than the rule's, or whose numbers cannot be."""
    if not np.array_equal(atlas.lengths, atlas.rule.lengths()):
        refuse(AtlasFault.CONTENT, "the lengths are not those of its rule")
    for name in ("average", "details", "curve_error"):
        values = getattr(atlas, name)
        if not (values.min(initial=0) > -20 and values.max(initial=0) < 20):  # NaN fails both
            refuse(AtlasFault.CONTENT, f"{name} is not finite")
    if np.any((atlas.winding < 0) | (atlas.winding > 1)) or np.any(atlas.curve_error < 0):
        refuse(AtlasFault.CONTENT, "winding or curve_error is out of range")
    if np.any(atlas.winding != atlas.mechanism.winding(atlas.lengths.astype(float))):
        refuse(AtlasFault.CONTENT, "winding is not that of the lengths")


def _check_sample(atlas: Atlas, seed: str) -> None:
    """Compute some rows again from their lengths, and compare: a file of other curves is refused, however sound its bytes are.

    Sines and roots differ in their last bits from one processor to another, so rows need to agree only as far as that goes.
    """
    count = len(atlas)
    chosen = np.random.default_rng(int(seed, 16)).choice(count, min(SAMPLED_ROWS, count), replace=False)
    again = compute_rows(atlas.lengths[chosen], atlas.samples, atlas.mechanism)
    for name, absolute, relative in (("average", 1e-9, 0.0), ("details", 4e-6, 0.0), ("curve_error", 2e-6, 1e-3)):
        values, wanted = getattr(atlas, name)[chosen], getattr(again, name)
        if not np.allclose(values, wanted, relative, absolute):
            refuse(AtlasFault.CONTENT, f"{name} is not what the lengths give")


def load_atlas(
    path: Path,
    max_bytes: int | None = None,
    max_types: int = MAX_TYPES,
    sha256: str | None = None,
    new: New = _in_memory,
) -> Atlas:
    """The verified atlas of a file, of the one whose header says ``sha256`` if that is given; nothing of it stays open.

    ``max_bytes``, ``max_types``: refuse a larger file, or an atlas of more types, before any of its arrays is read.
    ``new``: where its arrays lie.

    Raises `AtlasError`: missing, larger than allowed, damaged, not of this schema, or its arrays are not what its rule
    enumerates. Raises `OSError`: there is no place for its arrays.
    """
    with open_atlas_file(path, max_bytes) as file:
        found = checked_hash(file)
        if sha256 is not None and found != sha256:
            refuse(AtlasFault.CHECKSUM, "it has been replaced meanwhile")
        return _decoded(_Image(file.fileno(), closefd=False), file.tell() - HEADER_BYTES, max_types, new)


def _read(file: h5py.File, max_types: int, new: New) -> tuple[Atlas, str]:
    if _attribute(file, "schema", int) != SCHEMA:
        refuse(AtlasFault.SCHEMA, "another schema")
    try:
        rule_values = json.loads(_attribute(file, "rule", str))
        versions = json.loads(_attribute(file, "generator", str))
        generator = {_plain(str(k)): _plain(str(v)) for k, v in versions.items()}
        rule = AtlasRule.from_json(rule_values)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise AtlasError(AtlasFault.SCHEMA, "its rule cannot be read") from None
    types = rule.shapes["lengths"][0]
    if types > max_types:
        refuse(AtlasFault.LIMIT, f"{types} types, at most {max_types}")
    arrays: dict[str, Any] = {name: _dataset(file, name, shape, new) for name, shape in rule.shapes.items()}
    return Atlas(mechanism=rule.kind.mechanism, rule=rule, generator=generator, **arrays), _attribute(
        file, "content_sha256", str
    )


@lru_cache(maxsize=256)  # unpacking what it lies in takes milliseconds
def load_row(path: Path, sha256: str, row: int) -> AtlasRows:
    """One row of a file that has been verified: of the one whose header says ``sha256``.

    Raises `AtlasError`: it is missing, has been replaced, or the row cannot be read.
    """
    with open_atlas_file(path, None) as file:
        if claimed_hash(file.read(HEADER_BYTES)) != sha256:
            refuse(AtlasFault.CHECKSUM, "it has been replaced meanwhile")
        try:
            with h5py.File(_Image(file.fileno(), closefd=False), "r") as image:
                return AtlasRows(*(image[name][row : row + 1] for name in AtlasRows._fields))
        except Exception as error:
            raise AtlasError(AtlasFault.CHECKSUM, f"row {row + 1}: {type(error).__name__}") from None


def generator_versions() -> dict[str, str]:
    """Versions of what computes and writes an atlas, for its ``generator`` attribute."""
    hdf5 = {"h5py": h5py.__version__, "hdf5": h5py.version.hdf5_version}
    return {
        "linkage-atlas": version("linkage-atlas"),
        "numpy": np.__version__,
        **hdf5,
        "pywavelets": version("PyWavelets"),
    }
