"""Atlases: opened from a file, built, or found in their usual places."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from data_build.processes import executor, follow_parent
from linkage_atlas.geometry import AtlasType
from linkage_atlas.notes import counted
from synthesis.atlas.scan import Scan
from synthesis.atlas.table import SCHEMA, AtlasRule
from synthesis.errors import FieldError

if TYPE_CHECKING:
    from synthesis.atlas.file import StoredAtlas  # imports HDF5, which searches do not need


class Atlas:
    """A verified atlas: the dimension types of a rule, ready to be matched.

    Parameters
    ----------
    stored : synthesis.atlas.file.StoredAtlas
        Contents of the file.
    path : Path
        The file.

    Examples
    --------
    >>> import tempfile, linkage_atlas as la
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     atlas = la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1)
    >>> len(atlas), atlas[1].lengths, sum(dimension_type.lengths[0] == 2 for dimension_type in atlas)
    (38, [2, 5, 16, 17], 14)
    """

    def __init__(self, stored: StoredAtlas, path: Path) -> None:
        self.rule, self.lengths, self._stored, self._path = stored.rule, stored.lengths, stored, path

    def __len__(self) -> int:
        return len(self.lengths)

    def __getitem__(self, number: int) -> AtlasType:
        """Return a type by its number, from 1 as in the source. Raises `IndexError` if there is none of this number."""
        if not 1 <= number <= len(self):
            raise IndexError(f"there is no type {number}: the atlas has types 1 to {len(self):,}")
        return self.type_of(number - 1)

    def __iter__(self) -> Iterator[AtlasType]:
        return map(self.type_of, range(len(self)))

    @cached_property
    def scan(self) -> Scan:
        """Scan of the types."""
        return Scan(self.lengths, self._stored.tree)

    def type_of(self, row: int) -> AtlasType:
        """Return the type of a row, counted from 0."""
        return AtlasType(row + 1, self.lengths[row].tolist())

    def check(self) -> None:
        """Check all contents of its file, and compute some types again. Raises `AtlasError`."""
        from synthesis.atlas.file import check_contents

        check_contents(self._path, self._stored)

    def describe(self) -> dict[str, object]:
        """Describe its contents as plain values."""
        return {
            "types": len(self),
            "schema_version": SCHEMA,
            "content_sha256": self._stored.content_sha256,
            "parameters": self.rule.as_json(),
            "generator": self._stored.generator,
        }

    def __repr__(self) -> str:
        rule = ", ".join(f"{name} {value}" for name, value in self.rule.as_json().items())
        return f"Atlas({counted(len(self), 'type')}: {rule})"


def load_atlas(path: str | Path | None = None, max_bytes: int | None = None, max_types: int | None = None) -> Atlas:
    """Open and verify the atlas of a file, which is then ready to be matched.

    Parameters
    ----------
    path : str or Path, optional
        Path of the atlas file. Default: the atlas that `match` uses.
    max_bytes, max_types : int, optional
        Largest size of the file, and largest number of types; a larger file is refused before its arrays are read.

    Returns
    -------
    Atlas
        The atlas, ready to be matched.

    Raises
    ------
    AtlasError
        If the file is missing, larger than allowed, damaged, or not an atlas of this version.

    Examples
    --------
    >>> import tempfile, linkage_atlas as la
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1)
    ...     la.load_atlas(f"{folder}/small.h5")[1]
    AtlasType(number=1, lengths=[2, 5, 16, 17])
    """
    from synthesis.atlas import file

    path = find_atlas(jobs=1) if path is None else Path(path)
    stored = file.load_atlas(path, max_bytes, file.MAX_TYPES if max_types is None else max_types)
    return Atlas(stored, path)


@lru_cache(maxsize=2)
def _opened(path: Path, stamp: tuple[int, int]) -> Atlas:
    return load_atlas(path)


def as_atlas(atlas: Atlas | str | Path) -> Atlas:
    """Return an atlas, or open its file; an unchanged file is opened once. Raises `AtlasError` or `FieldError`."""
    if isinstance(atlas, Atlas):
        return atlas
    if not isinstance(atlas, str | os.PathLike):
        raise FieldError("/atlas", f"must be an Atlas or the path of its file, found {type(atlas).__name__}")
    path = Path(atlas).absolute()
    try:
        status = path.stat()
    except OSError:
        return load_atlas(path)
    return _opened(path, (status.st_size, status.st_mtime_ns))


def build_atlas(
    path: str | Path,
    perimeter: int | None = None,
    smallest: int | None = None,
    order: str | None = None,
    samples: int | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Atlas:
    """Enumerate the dimension types of a rule, compute their features and write the atlas file.

    Parameters
    ----------
    path : str or Path
        Path of the file, which is written completely or not at all.
    perimeter : int, optional
        Sum of the integer lengths of a type. Default: 400.
    smallest : int, optional
        Smallest length of the shortest link. Default: 2.
    order : {"increasing", "crank_shortest", "full_crank"}, optional
        Order of the lengths.
    samples : int, optional
        Number of samples of a curve over the turn, a power of two. Default: 256.
    jobs : int, optional
        Number of processes. Default: the number of cores. Several processes need a script that can be imported.
    scheduler : str, optional
        Address of a Dask cluster to run on; needs the extra ``[distributed]`` here and this package on its workers.
    progress : callable
        Function that is called as ``progress(done, total)`` after each chunk.

    Returns
    -------
    Atlas
        The atlas of the file.

    Examples
    --------
    >>> import tempfile, linkage_atlas as la
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     len(la.build_atlas(f"{folder}/small.h5", perimeter=40, samples=16, jobs=1))
    38
    """
    from data_build.batch import build_atlas as build

    rule = AtlasRule.of(perimeter, smallest, order, samples)
    with executor(jobs or os.cpu_count() or 1, scheduler) as pool:
        build(rule, Path(path), pool, progress)
    return load_atlas(path)


@contextmanager
def shown_progress() -> Iterator[Callable[[int, int], None]]:
    """Show the progress of a build on standard error, if it is a terminal."""
    from tqdm import tqdm

    with tqdm(disable=None, unit="chunk", desc="atlas", file=sys.stderr) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield progress


# -- the default atlas: in this folder, or in the user's cache folder ----------------------------------------------------

__all__ = ["Atlas", "as_atlas", "build_atlas", "executor", "find_atlas", "follow_parent", "load_atlas"]
HERE = Path("atlas.h5")


def cached_atlas() -> Path:
    """Return the path of the default atlas in the user's cache folder; the file may not exist yet.

    Its name contains the version, as another version may compute other rows.
    """
    from platformdirs import user_cache_path

    return user_cache_path("linkage-atlas", appauthor=False) / f"atlas-{version('linkage-atlas')}-{SCHEMA}.h5"


def find_atlas(here: Path = HERE, jobs: int | None = None) -> Path:
    """Return the path of the atlas in this folder, or of the default atlas, which is built by ``jobs`` processes if necessary."""
    if here.exists():
        return here
    path = cached_atlas()
    if not path.exists():
        import fcntl

        path.parent.mkdir(parents=True, exist_ok=True)
        with path.with_suffix(".lock").open("w") as lock:  # a second command waits for the atlas of the first
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                print(f"no atlas here: building the default one (once, some seconds) as {path}", file=sys.stderr)
                with shown_progress() as progress:
                    build_atlas(path, jobs=jobs, progress=progress)
    return path


@cache
def default_atlas() -> Atlas:
    """Return the atlas that `find_atlas` finds, opened once.

    It is built by a single process, as several processes need a script that can be imported.
    """
    return load_atlas(find_atlas(jobs=1))
