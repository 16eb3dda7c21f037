"""What answers need beyond their request: the atlas, the levels of the search, a clock. Each is made once, when needed."""

from __future__ import annotations

import contextlib
import ctypes
import os
import threading
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from threadpoolctl import threadpool_limits

from app.settings import Settings
from synthesis.atlas.file import Atlas, load_atlas
from synthesis.atlas.scan import Scan
from synthesis.errors import AtlasError
from synthesis.search.search import Levels


@dataclass(frozen=True)
class LoadedAtlas:
    """A verified atlas and its scan; the file itself is closed."""

    atlas: Atlas
    scan: Scan
    load_seconds: float

    def describe(self) -> dict[str, Any]:
        """What is loaded, as plain JSON values."""
        return {
            "types": len(self.atlas),
            "schema_version": self.atlas.schema,
            "content_sha256": self.content_sha256,
            "parameters": self.atlas.rule.as_json(),
            "generator": self.atlas.generator,
            "scan_bytes": self.scan.nbytes,
            "load_ms": 1000 * self.load_seconds,
        }

    @cached_property
    def content_sha256(self) -> str:
        return self.atlas.content_hash()


class ServiceResources:
    """Loads what is asked for, once; a scene's request asks for neither atlas nor levels, and pays for neither."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.max_budget_ms = settings.max_budget_ms
        self.failure: AtlasError | None = None
        # Several requests at a time, each with small matrices: threads inside a product would only wait for each other.
        self._blas = threadpool_limits(1, "blas")

    @cached_property
    def atlas(self) -> LoadedAtlas:
        """The atlas, loaded and verified. Raises AtlasError; once `prepare` has met one, that one, and reads nothing."""
        if self.failure is not None:
            raise self.failure
        begin = self.clock()
        atlas = load_atlas(self.settings.atlas, self.settings.atlas_max_bytes, self.settings.atlas_max_types)
        scan = Scan(atlas, threads=os.cpu_count() or 1)
        return LoadedAtlas(atlas, scan, self.clock() - begin)

    @cached_property
    def levels(self) -> Levels:
        """The coarse levels of the search."""
        return Levels()

    def prepare(self) -> None:
        """Load everything now; an atlas that cannot be used is remembered as the `failure` and not raised."""
        _ = self.levels
        try:
            _ = self.atlas.content_sha256
        except AtlasError as error:
            self.failure = error
        _give_back_memory()

    def prepare_positions(self, stopping: threading.Event) -> None:
        """Prepare the scan for requests with positions too, if that is set and there is an atlas; until told to stop."""

        def checkpoint() -> None:
            if stopping.is_set():
                raise _Stopped

        if self.settings.prepare_positions and self.failure is None:
            with contextlib.suppress(_Stopped):
                self.atlas.scan.prepare_positions(checkpoint)
                _give_back_memory()

    def clock(self) -> float:
        """Seconds of a monotonic clock."""
        return time.perf_counter()


class _Stopped(Exception):
    """The service ends."""


def _give_back_memory() -> None:
    """Return to the system what preparing has freed: glibc keeps it otherwise, about 130 MB with the default atlas."""
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library has no such function, and no need of it
        return
    trim(0)
