"""The batch job: enumerate dimension types, compute them in chunks, and write the atlas file.

A chunk depends only on the rule and its first row, so the file has the same bytes for any number of processes, and on a Dask
cluster even if workers fail. The file is written once, after the computation, so that a reader sees either the old or the new
file.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from synthesis.atlas.file import encode_atlas
from synthesis.atlas.table import AtlasRule, Features, Series, compute_features, compute_series
from synthesis.errors import FieldError

CHUNK_TYPES = 4096
MAX_BUILD_BYTES = 8_000_000_000
"""Largest array of details of a build, which holds it in memory; a larger rule is refused as a mistake."""


def compute_chunk(rule: AtlasRule, first: int) -> tuple[Features, Series]:
    """Compute features and series of the types of a chunk."""
    lengths = rule.lengths(first, first + CHUNK_TYPES)
    return compute_features(lengths, rule.samples), compute_series(lengths)


def replace_file(path: Path, data: bytes) -> None:
    """Write a file so that a reader sees the old content or all of the new content, also after a power failure."""
    if os.path.lexists(path) and not path.is_file():
        raise FieldError("/out", f"{path} exists and is not a regular file")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def build_atlas(
    rule: AtlasRule, out: Path, executor: Executor, progress: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """Build an atlas and write it to a file.

    Parameters
    ----------
    rule : AtlasRule
        Dimension types and samples of the atlas.
    out : Path
        File of the atlas; a symbolic link is followed.
    executor : Executor
        Executor of the chunks.
    progress : callable
        ``progress(done, total)`` is called after each chunk.

    Raises
    ------
    FieldError
        The rule needs too much memory, ``out`` is not a regular file, or its folder does not exist.
    OSError
        The file cannot be written; an existing file is unchanged.
    """
    if (size := rule.count * rule.samples * 4) > MAX_BUILD_BYTES:
        message = f"requires {size:,} bytes of details, but at most {MAX_BUILD_BYTES:,} are allowed; reduce it"
        raise FieldError("/perimeter", message)
    out = out.resolve()
    if not out.parent.is_dir():
        raise FieldError("/out", f"the folder {out.parent} does not exist")
    if os.path.lexists(out) and not out.is_file():
        raise FieldError("/out", f"{out} exists and is not a regular file")
    starts = range(0, max(rule.count, 1), CHUNK_TYPES)
    chunks = []
    for chunk in executor.map(compute_chunk, [rule] * len(starts), starts):
        chunks.append(chunk)
        progress(len(chunks), len(starts))
    features = Features(*map(np.concatenate, zip(*(chunk[0] for chunk in chunks))))
    series = Series(*map(np.concatenate, zip(*(chunk[1] for chunk in chunks))))
    replace_file(out, encode_atlas(rule, features, series))
