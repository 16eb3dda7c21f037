"""Where the atlas is that nobody named, and where its index is: here, or in the user's cache folder; each is made once."""

from __future__ import annotations

import fcntl
import hashlib
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from platformdirs import user_cache_path
from tqdm import tqdm

import linkage_atlas as la
from app.settings import Settings


def _folder() -> Path:
    return user_cache_path("linkage-atlas", appauthor=False)


def cached_atlas() -> Path:
    """The default atlas in the user's cache folder, which need not be there yet.

    Its name says the version: another one may make other rows.
    """
    return _folder() / f"atlas-{la.__version__}.h5"


def find_atlas(settings: Settings) -> Path:
    """The atlas that is set, or ``atlas.h5`` of this folder, or else the default one, which is built first if it must be.

    One that is set or named is not built: a wrong name is told, not filled.
    """
    if "atlas" in settings.model_fields_set or settings.atlas.exists():
        return settings.atlas
    place = cached_atlas()
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.with_suffix(".lock").open("w") as lock:  # a second command waits for the first one's atlas
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not place.exists():
                build_default(place)
    return place


def index_of(atlas: Path) -> Path:
    """The file of an atlas's index: beside it, or in the user's cache folder where there is none and none can be written."""
    beside = atlas.with_name(atlas.name + ".index")
    if beside.exists() or os.access(beside.parent, os.W_OK):
        return beside
    name = hashlib.sha256(os.fsencode(atlas.resolve())).hexdigest()[:16]
    return _folder() / f"{atlas.name}-{name}.index"


def open_atlas(atlas: Path, settings: Settings) -> la.Atlas:
    """The atlas of a file, its scan in an index if that is set; the index is made, with a bar, when the scan is first wanted."""
    limits = {"max_bytes": settings.atlas_max_bytes, "max_types": settings.atlas_max_types}
    if not settings.index:
        return la.load_atlas(atlas, **limits)
    place = index_of(atlas)
    if place.parent != atlas.parent:
        with suppress(OSError):  # then everything is prepared in memory
            place.parent.mkdir(parents=True, exist_ok=True)
    return la.load_atlas(atlas, **limits, index=place, progress=_Bar("index", "types"))


class _Bar:
    """A bar on the terminal, from the first part to the last."""

    def __init__(self, what: str, unit: str) -> None:
        self._what, self._unit = what, unit
        self._bar: tqdm[Any] | None = None

    def __call__(self, done: int, total: int) -> None:
        if self._bar is None:
            self._bar = tqdm(
                total=total, disable=None, unit=self._unit, desc=self._what, file=sys.stderr, unit_scale=True
            )
        self._bar.update(done - self._bar.n)
        if done >= total:
            self._bar.close()
            self._bar = None


def build_default(place: Path) -> None:
    """Build the default atlas at a place, with a bar on the terminal; a build that was cut off goes on from where it was."""
    print(f"no atlas here: building the default one (once, some seconds) as {place}", file=sys.stderr)
    la.build_atlas(place, progress=_Bar("atlas", "shard"))
