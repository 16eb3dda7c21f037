"""Where the atlas is that nobody named: here, or in the user's cache folder, where the default one is built once."""

from __future__ import annotations

import fcntl
import sys
from pathlib import Path

from platformdirs import user_cache_path
from tqdm import tqdm

import linkage_atlas as la
from app.settings import Settings


def cached_atlas() -> Path:
    """The default atlas in the user's cache folder, which need not be there yet.

    Its name says the version: another one may make other rows.
    """
    return user_cache_path("linkage-atlas", appauthor=False) / f"atlas-{la.__version__}.h5"


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


def build_default(place: Path) -> None:
    """Build the default atlas at a place, with a bar on the terminal; a build that was cut off goes on from where it was."""
    print(f"no atlas here: building the default one (once, some seconds) as {place}", file=sys.stderr)
    with tqdm(disable=None, unit="shard", desc="atlas", file=sys.stderr) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        la.build_atlas(place, progress=progress)
