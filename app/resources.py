"""What answers need beyond their request: the atlas, loaded once when it is needed, and a watch over their time."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import linkage_atlas as la
from app.query import build_models
from app.settings import Settings

PARTS: tuple[str, ...] = ()
"""Parts that are prepared in the background: none, as the atlas is one file."""
INDEX = "index"


_TAKES_MEMORY = 50
"""Rows of a matrix that is large enough for it."""


class Unprepared(Exception):
    """What an answer needs is not there, and is not to be made by the process that answers; the message names it."""


class ServiceResources:
    """Loads what is asked for, once: a scene's request never loads the atlas."""

    def __init__(
        self, settings: Settings, find_atlas: Callable[[Settings], Path] = lambda settings: settings.atlas
    ) -> None:
        self.settings = settings
        self._find_atlas = find_atlas
        self.max_budget_ms = settings.max_budget_ms
        self.failure: la.AtlasError | None = None
        self.load_seconds = 0.0
        self.alone = False
        """Whether this process answers one request at a time, within bounds of its own."""
        self.makes = True
        # Several requests at a time, each with small matrices: threads inside a product would only wait for each other.
        import numpy  # noqa: F401  # for only a library that is loaded is limited

        self._blas = threadpool_limits(1, "blas")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of scipy's own, which is loaded where it is needed

    @property
    def atlas(self) -> la.Atlas:
        """The atlas, loaded and verified. Raises AtlasError: the one that `load` met, if it met one, without reading again."""
        return self._loaded

    @cached_property
    def _loaded(self) -> la.Atlas:
        if self.failure is not None:
            raise self.failure
        if not self.settings.with_atlas:
            raise la.AtlasError(la.AtlasFault.NOT_WANTED, "--no-atlas; searching needs none")
        begin = time.perf_counter()
        limits = {"max_bytes": self.settings.atlas_max_bytes, "max_types": self.settings.atlas_max_types}
        atlas = la.load_atlas(self._find_atlas(self.settings), **limits)
        _ = atlas.scan
        self.load_seconds = time.perf_counter() - begin
        return atlas

    def describe_atlas(self) -> dict[str, Any]:
        """What is loaded, as plain JSON values."""
        atlas = self.atlas
        return {**atlas.describe(), "scan_bytes": atlas.scan.nbytes, "load_ms": 1000 * self.load_seconds}

    def work(self, budget: float | None = None, cancelled: Callable[[], bool] | None = None) -> la.Work:
        """A watch over the time of an answer, in seconds, and over whether it is still wanted."""
        return la.Work(budget, cancelled, processor_clock() if self.alone else time.perf_counter)

    def live(self) -> la.Live:
        """Nothing: who answers one request for itself has no last answer."""
        return la.Live()

    def load(self) -> None:
        """Load what a match needs now; an atlas that cannot be used is remembered as the `failure` and not raised."""
        try:
            if self.settings.with_atlas:
                _ = self.atlas.content_sha256
        except la.AtlasError as error:
            self.failure = error
        _ = la.match
        give_back_memory()
        gc.freeze()  # what is loaded stays: looking through it again and again would hold up everyone

    def leave_index(self) -> None:
        """Do nothing: the atlas is one file, which is read when it is loaded."""

    missing_index = ""

    def renew(self) -> None:
        """Do nothing, as `leave_index`."""

    def prepare_rest(self) -> None:
        """Have now what the first answer of each kind would else import or make: searches, their tables, models."""
        import scipy.interpolate  # noqa: F401 - the first spline would

        self._blas = threadpool_limits(1, "blas")  # scipy has a library of its own
        build_models()
        la.prepare()
        give_back_memory()
        gc.freeze()

    def look(self) -> None:
        """Do nothing, as `leave_index`."""

    def missing(self) -> list[str]:
        """Return no parts: nothing is made in the background."""
        return []

    def make(self, part: str, cancelled: Callable[[], bool] | None = None) -> None:
        """Do nothing, as `leave_index`."""


def processor_clock() -> Callable[[], float]:
    """A clock of this process's processor time, so that an answer is as good on a busy machine; but at least half the time."""
    processor, passed = time.process_time(), time.perf_counter()
    return lambda: max(time.process_time() - processor, (time.perf_counter() - passed) / 2)


def take_working_memory() -> None:
    """Have the libraries of linear algebra map their working memory now, 34 MB each, of which little is used.

    Each does so at its first call, and waits for it forever where the process may not have it.
    """
    np.linalg.qr(np.ones((_TAKES_MEMORY, _TAKES_MEMORY)))
    if linalg := sys.modules.get("scipy.linalg"):  # imported with what all processes share, or not at all yet
        linalg.lapack.dgbsv(1, 1, np.ones((4, 3)), np.ones(3))


_given_back = 0.0


def give_back_memory(every: float = 0.0) -> None:
    """Return to the system what has been freed, unless that was done less than ``every`` seconds ago.

    glibc keeps it otherwise, after preparing about 130 MB with the default atlas.
    """
    global _given_back
    now = time.monotonic()
    if now - _given_back < every:
        return
    _given_back = now
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # other C libraries have no such function
        return
    trim(0)
