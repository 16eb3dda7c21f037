"""The atlas file: a checked header of 512 bytes, then an HDF5 image with the features of the types and the tree of the scan.

The header lies in what HDF5 calls the user block, so any HDF5 reader opens the file. It holds a SHA-256 of everything after it,
which is compared before HDF5 parses a byte. `docs/file_format.md` describes the datasets.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import os
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import h5py
import numpy as np
from numpy.typing import NDArray

from synthesis.atlas import haar
from synthesis.atlas.table import (
    COLUMNS,
    CURVE,
    FEATURES,
    SCHEMA,
    UNITS,
    AtlasRule,
    Features,
    Series,
    compute_features,
    compute_series,
    content_hash,
)
from synthesis.atlas.tree import PIECES, Level, Tree, build_tree, level_sizes
from synthesis.errors import AtlasError, AtlasFault

HEADER_BYTES = 512
MAX_TYPES = 8_000_000
"""Largest number of types that is read unless the caller sets another limit."""
_MAGIC = "linkage-atlas"
_CHUNK_BYTES = 1 << 20
_MAX_CHUNK_BYTES = 1 << 23
_MAX_REST_BYTES = 1 << 21
"""Largest number of bytes of a file beside its arrays."""
_MAX_TEXT = 4096
"""Longest text of an attribute, in characters."""
_FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE}
_CHECKED_ROWS = 256
_TREE_UNITS = {
    "tree_rows": "row of the type at each leaf, -1 for a place that is left over",
    "tree_series": "radians: winding, 0, then cosine and sine coefficients of harmonics 1 to 31; roots first, types last",
    "tree_errors": "radians, radians per radian: largest errors of the series below, and of their derivatives",
    "tree_slopes": "radians per radian: largest difference of a slope below a node from its own, in each of 36 pieces of a turn",
    "tree_bends": "radians per square radian: the same of the second derivative",
}


def _refuse(fault: AtlasFault, detail: str) -> NoReturn:
    raise AtlasError(fault, detail)


@dataclass(frozen=True)
class StoredAtlas:
    """Contents of an atlas without the features, which stay in the file (`read_features`)."""

    rule: AtlasRule
    generator: dict[str, str]
    content_sha256: str
    lengths: NDArray[Any]
    tree: Tree
    sha256: str = ""
    """Hash in the header of the file."""


def _header(sha256: str, size: int) -> bytes:
    text = f"{_MAGIC} {SCHEMA}\nsha256 {sha256}\nbytes {size}\n"
    return text.encode().ljust(HEADER_BYTES - 1, b" ") + b"\n"


def _datasets(count: int, rule: AtlasRule) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return data type and shape of each dataset of an atlas."""
    *nodes, leaves = level_sizes(count)
    combined, above = sum(nodes) + leaves, sum(nodes)
    found = {name: (FEATURES[name], shape) for name, shape in rule.shapes.items()}
    return found | {
        "tree_rows": ("<i4", (leaves,)),
        "tree_series": ("<f4", (combined, COLUMNS)),
        "tree_errors": ("<f4", (combined, 2)),
        "tree_slopes": ("<f4", (above, PIECES)),
        "tree_bends": ("<f4", (above, PIECES)),
    }


# -- writing -------------------------------------------------------------------------------------------------------------


def encode_atlas(rule: AtlasRule, features: Features, series: Series) -> bytes:
    """Return the bytes of the file. Law: the same bytes for the same arguments and versions, on every run on one machine."""
    tree = build_tree(series)
    arrays: dict[str, Any] = {"lengths": rule.lengths(), **features._asdict()}
    attributes = {
        "schema": SCHEMA,
        "rule": json.dumps(rule.as_json(), sort_keys=True),
        "curve": CURVE,
        "normalisation": "mean",
        "levels": haar.levels(rule.samples),
        "samples": rule.samples,
        "generator": json.dumps(generator_versions(), sort_keys=True),
        "content_sha256": content_hash(rule, arrays),
    }
    arrays["tree_rows"] = tree.rows
    for name in Level._fields:
        parts = [getattr(level, name) for level in tree.levels]
        arrays[f"tree_{name}"] = np.concatenate([part for part in parts if part.size] or parts)
    units = UNITS | _TREE_UNITS
    with h5py.File.in_memory(libver=("v110", "v110")) as file:
        file.attrs.update(attributes)
        for name, (dtype, shape) in _datasets(rule.count, rule).items():
            options: dict[str, Any] = {}
            if math.prod(shape):
                rows = min(shape[0], max(1, _CHUNK_BYTES // (np.dtype(dtype).itemsize * math.prod(shape[1:]))))
                options = {
                    "compression": "gzip",
                    "compression_opts": 1,
                    "shuffle": True,
                    "chunks": (rows, *shape[1:]),
                }
            dataset = file.create_dataset(name, shape, dtype, track_times=False, **options)
            if math.prod(shape):
                dataset[...] = arrays[name]
            dataset.attrs["units"] = units[name]
        file.flush()
        body: bytes = file.id.get_file_image()
    return _header(hashlib.sha256(body).hexdigest(), len(body)) + body


def generator_versions() -> dict[str, str]:
    """Return the versions of what computes and writes an atlas."""
    names = {"linkage-atlas": "linkage-atlas", "numpy": "numpy", "h5py": "h5py", "pywavelets": "PyWavelets"}
    return {name: version(package) for name, package in names.items()} | {"hdf5": h5py.version.hdf5_version}


# -- reading -------------------------------------------------------------------------------------------------------------


class _Image(io.FileIO):
    """The part of a file after the header."""

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return super().seek(offset + HEADER_BYTES * (whence == io.SEEK_SET), whence) - HEADER_BYTES

    def tell(self) -> int:
        return super().tell() - HEADER_BYTES


@contextlib.contextmanager
def _opened(
    path: Path, max_bytes: int | None = None, sha256: str | None = None
) -> Iterator[tuple[h5py.File, str, int]]:
    """Open a file whose bytes match its header: the HDF5 file, the hash, and the size of the image.

    If ``sha256`` is given, only the header is compared, with it.
    """
    try:
        if not path.is_file():
            _refuse(
                AtlasFault.MISSING, f"{path} is not a regular file" if path.exists() else f"{path} does not exist"
            )
        file: BinaryIO = path.open("rb")
    except OSError as error:
        raise AtlasError(AtlasFault.MISSING, f"{path}: {error.strerror}") from None
    with file:
        size = os.fstat(file.fileno()).st_size
        if max_bytes is not None and size > max_bytes:
            _refuse(AtlasFault.LIMIT, f"{size} bytes, at most {max_bytes}")
        head = file.read(HEADER_BYTES)
        if len(head) < HEADER_BYTES or not head.startswith(_MAGIC.encode()):
            _refuse(AtlasFault.SCHEMA, "its header is not the header of an atlas")
        if not head.startswith(f"{_MAGIC} {SCHEMA}\n".encode()):
            detail = f"its header names another schema than {SCHEMA}; `linkage-atlas build` makes a new file"
            _refuse(AtlasFault.SCHEMA, detail)
        found = sha256 or hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]  # it has readinto
        if _header(found, size - HEADER_BYTES) != head:
            _refuse(
                AtlasFault.CHECKSUM, f"{size} bytes" if sha256 is None else "it has been replaced since it was opened"
            )
        try:
            with h5py.File(_Image(file.fileno(), closefd=False), "r") as image:
                yield image, found, size - HEADER_BYTES
        except AtlasError:
            raise
        except Exception as error:  # h5py raises whatever type the state of its C library suggests
            if isinstance(error, OSError) and error.errno is not None:  # the error is that of the disk
                raise
            raise AtlasError(AtlasFault.SCHEMA, f"HDF5 cannot read it: {type(error).__name__}") from None


def load_atlas(path: Path, max_bytes: int | None = None, max_types: int = MAX_TYPES) -> StoredAtlas:
    """Verify and read an atlas file.

    ``max_bytes``, ``max_types``: refuse a larger file, or an atlas of more types, before any array is read.

    Raises `AtlasError`: missing, larger than allowed, damaged, of another schema, or with arrays that contradict its rule.
    """
    with _opened(path, max_bytes) as (file, sha256, size):
        if _attribute(file, "schema", int) != SCHEMA:
            _refuse(AtlasFault.SCHEMA, "another schema")
        try:
            rule = AtlasRule.from_json(json.loads(_attribute(file, "rule", str)))
            versions = json.loads(_attribute(file, "generator", str))
            generator = {_plain(str(name)): _plain(str(value)) for name, value in versions.items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise AtlasError(AtlasFault.SCHEMA, "its rule cannot be read") from None
        count = rule.count
        if count > max_types:
            _refuse(AtlasFault.LIMIT, f"{count} types, at most {max_types}")
        datasets = _datasets(count, rule)
        _check_datasets(file, datasets, size)
        content = _attribute(file, "content_sha256", str)
        lengths = file["lengths"][...]
        arrays = {name: file[name][...] for name in datasets if name.startswith("tree_")}
    if not np.array_equal(lengths, rule.lengths()):
        _refuse(AtlasFault.CONTENT, "the lengths do not match its rule")
    rows = arrays["tree_rows"]
    if not np.array_equal(np.sort(rows[rows != -1]), np.arange(count)):
        _refuse(AtlasFault.CONTENT, "the leaves of the tree do not match the types")
    return StoredAtlas(rule, generator, content, lengths, Tree(_levels(arrays, count), rows), sha256)


def _levels(arrays: dict[str, NDArray[Any]], count: int) -> list[Level]:
    levels, begin, sizes = [], 0, level_sizes(count)
    for number, size in enumerate(sizes):
        part, is_node = slice(begin, begin + size), number < len(sizes) - 1
        values = [arrays["tree_series"][part], arrays["tree_errors"][part]]
        values += [
            arrays[name][part] if is_node else np.empty((size, 0), "<f4") for name in ("tree_slopes", "tree_bends")
        ]
        levels.append(Level(*values))
        begin += size
    return levels


def read_features(path: Path, sha256: str, rows: slice) -> Features:
    """Read the features of some rows of a file that has been verified. Raises `AtlasError`: it is missing or was replaced."""
    with _opened(path, sha256=sha256) as (file, _, _):
        return Features(*(file[name][rows] for name in Features._fields))


def check_contents(path: Path, atlas: StoredAtlas) -> None:
    """Compare the content hash, and compute some types again from their lengths. Raises `AtlasError`.

    Sines and roots differ in their last bits between processors, so numbers need to agree only as far as that goes.
    """
    features = read_features(path, atlas.sha256, slice(None))
    if content_hash(atlas.rule, {"lengths": atlas.lengths, **features._asdict()}) != atlas.content_sha256:
        _refuse(AtlasFault.CONTENT, "the content hash differs")
    count = len(atlas.lengths)
    chosen = np.random.default_rng(0).choice(count, min(_CHECKED_ROWS, count), replace=False)
    solution = compute_features(atlas.lengths[chosen], atlas.rule.samples)
    pairs: Any = zip(features, solution)
    same = all(np.allclose(old[chosen], new, 0, 4e-6) for old, new in pairs)
    series, leaf = compute_series(atlas.lengths[chosen]), np.argsort(atlas.tree.rows, kind="stable")
    leaf = leaf[len(leaf) - count :][chosen]
    if not same or not np.allclose(atlas.tree.levels[-1].series[leaf], series.coefficients, 0, 1e-6):
        _refuse(AtlasFault.CONTENT, "features or series do not match the lengths")


def _plain(text: str) -> str:
    """Return a short text that can be shown as it is; refuse others."""
    if len(text) > _MAX_TEXT or any(unicodedata.category(mark) in ("Cc", "Cf", "Cs", "Zl", "Zp") for mark in text):
        _refuse(AtlasFault.SCHEMA, "the text of an attribute is too long or holds control characters")
    return text


def _attribute(file: h5py.File, name: str, kind: type) -> Any:
    """Read a scalar attribute after its type has been checked."""
    if name not in file.attrs:
        _refuse(AtlasFault.SCHEMA, f"attribute {name} is missing")
    info = file.attrs.get_id(name)
    is_text = info.dtype.kind == "O" and h5py.check_string_dtype(info.dtype) is not None
    if info.shape != () or not (is_text if kind is str else info.dtype.kind in "iu"):
        _refuse(AtlasFault.SCHEMA, f"attribute {name} is not a single {kind.__name__}")
    value = kind(file.attrs[name])
    return _plain(value) if kind is str else value


def _check_datasets(file: h5py.File, datasets: dict[str, tuple[str, tuple[int, ...]]], size: int) -> None:
    """Refuse anything but these plain datasets: links, external or virtual storage, foreign filters, other shapes, gaps."""
    if set(file) != set(datasets):
        _refuse(AtlasFault.SCHEMA, f"it holds {len(set(file))} entries instead of {', '.join(datasets)}")
    for name, (dtype, shape) in datasets.items():
        hard = isinstance(file.get(name, getlink=True), h5py.HardLink)
        if not hard or file.get(name, getclass=True) is not h5py.Dataset:
            _refuse(AtlasFault.SCHEMA, f"{name} is not a plain dataset of this file")
        dataset = file[name]
        creation = dataset.id.get_create_plist()
        filters = {creation.get_filter(k)[0] for k in range(creation.get_nfilters())}
        if dataset.is_virtual or dataset.external or not filters <= _FILTERS:
            _refuse(AtlasFault.SCHEMA, f"{name} uses external or virtual storage or a foreign filter")
        if dataset.dtype != np.dtype(dtype) or dataset.shape != shape:
            _refuse(
                AtlasFault.SCHEMA,
                f"{name} has type {dataset.dtype} and shape {dataset.shape}, not {dtype} and {shape}",
            )
        if dataset.chunks and math.prod(dataset.chunks) * dataset.dtype.itemsize > _MAX_CHUNK_BYTES:
            _refuse(AtlasFault.SCHEMA, f"{name} has chunks of {dataset.chunks}")
        target = math.prod(-(-s // c) for s, c in zip(shape, dataset.chunks)) if dataset.chunks else 0
        if dataset.chunks and dataset.id.get_num_chunks() != target:  # HDF5 would fill the gap silently
            _refuse(AtlasFault.CONTENT, f"{name} lacks a part of its data")
    remaining = size - sum(file[name].id.get_storage_size() for name in datasets)
    if not 0 <= remaining <= _MAX_REST_BYTES:
        _refuse(AtlasFault.SCHEMA, f"it holds {remaining:,} bytes beside its arrays")
