"""Where the atlas is that nobody named, and where its index is: here, or in the user's cache folder; each is made once."""

from __future__ import annotations

import hashlib
import os
import sys
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from linkage_atlas.atlases import Atlas


HERE = Path("atlas.h5")


def _folder() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("linkage-atlas", appauthor=False)


def cached_atlas() -> Path:
    """The default atlas in the user's cache folder, which need not be there yet.

    Its name says the version: another one may make other rows.
    """
    return _folder() / f"atlas-{version('linkage-atlas')}.h5"


def find_atlas(here: Path = HERE, jobs: int | None = None) -> Path:
    """The atlas of this folder, or else the default one, which is built by so many processes first if it must be."""
    if here.exists():
        return here
    place = cached_atlas()
    if not place.exists():
        import fcntl

        from linkage_atlas.atlases import build_atlas

        place.parent.mkdir(parents=True, exist_ok=True)
        with place.with_suffix(".lock").open("w") as lock:  # a second command waits for the first one's atlas
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not place.exists():
                print(f"no atlas here: building the default one (once, some seconds) as {place}", file=sys.stderr)
                build_atlas(place, jobs=jobs, progress=_Bar("atlas", "shard"))
    return place


@cache
def default_atlas() -> Atlas:
    """The atlas that `find_atlas` finds, opened once.

    It is built by one process: more need a script that can be imported.
    """
    return open_atlas(find_atlas(jobs=1))


@cache
def default_slider_cranks() -> Atlas:
    """The default atlas of slider-cranks, its scan kept beside the default atlas, which it does not need."""
    from linkage_atlas.atlases import slider_cranks
    from synthesis.atlas.index import Index

    place = index_of(HERE if HERE.exists() else cached_atlas())
    with suppress(OSError):  # then it is prepared in memory
        place.parent.mkdir(parents=True, exist_ok=True)
    return slider_cranks(Index(place, ""))


def index_of(atlas: Path) -> Path:
    """The file of an atlas's index: beside it, or in the user's cache folder where there is none and none can be written."""
    beside = atlas.with_name(atlas.name + ".index")
    if beside.exists() or os.access(beside.parent, os.W_OK):
        return beside
    name = hashlib.sha256(os.fsencode(atlas.resolve())).hexdigest()[:16]
    return _folder() / f"{atlas.name}-{name}.index"


def open_atlas(atlas: Path, index: bool = True, **limits: Any) -> Atlas:
    """The atlas of a file, its scan in an ``index`` if that is wanted, which is made, with a bar, when the scan is first wanted.

    ``limits`` are those of `linkage_atlas.load_atlas`.
    """
    from linkage_atlas.atlases import load_atlas

    if not index:
        return load_atlas(atlas, **limits)
    place = index_of(atlas)
    if place.parent != atlas.parent:
        with suppress(OSError):  # then everything is prepared in memory
            place.parent.mkdir(parents=True, exist_ok=True)
    return load_atlas(atlas, **limits, index=place, progress=_Bar("index", "types"))


class _Bar:
    """A bar on the terminal, from the first part to the last."""

    def __init__(self, what: str, unit: str) -> None:
        self._what, self._unit = what, unit
        self._bar: Any = None

    def __call__(self, done: int, total: int) -> None:
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                total=total, disable=None, unit=self._unit, desc=self._what, file=sys.stderr, unit_scale=True
            )
        self._bar.update(done - self._bar.n)
        if done >= total:
            self._bar.close()
            self._bar = None
