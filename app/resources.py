"""Resources of an answer: the atlas, which is loaded when it is first needed, and time limits."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path

from threadpoolctl import threadpool_limits

import linkage_atlas as la
from app.settings import Settings


def opened(path: Path) -> la.Atlas:
    """Open an atlas file, ready for matching."""
    atlas = la.load_atlas(path)
    _ = atlas.scan
    return atlas


class ServiceResources:
    """The atlas and the time limits of a process.

    Parameters
    ----------
    settings : Settings
        Settings of the service.
    find_atlas : callable, optional
        ``find_atlas(settings)`` returns the file of the atlas; default: the configured file.
    cancelled : callable, optional
        ``cancelled()`` returns True if the current answer was cancelled.
    """

    def __init__(
        self,
        settings: Settings,
        find_atlas: Callable[[Settings], Path] = lambda settings: settings.atlas,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self.settings = settings
        self.max_budget_ms = settings.max_budget_ms
        self._find_atlas, self._cancelled = find_atlas, cancelled
        import numpy  # noqa: F401 - only a loaded library can be limited

        self._blas = threadpool_limits(1, "blas")  # threads do not pay off for small matrices

    @property
    def atlas(self) -> la.Atlas:
        """The atlas, loaded and verified; raises `AtlasError` if it cannot be used."""
        if isinstance(self._loaded, la.AtlasError):
            raise self._loaded
        return self._loaded

    @cached_property
    def _loaded(self) -> la.Atlas | la.AtlasError:
        if not self.settings.with_atlas:
            return la.AtlasError(la.AtlasFault.NOT_WANTED, "the service was started without an atlas (--no-atlas)")
        try:
            return opened(self._find_atlas(self.settings))
        except la.AtlasError as error:
            return error

    def work(self, budget: float | None = None) -> la.Work:
        """Start the clock of an answer, with a budget in seconds; the work also ends if the client disconnects."""
        if self._cancelled is not None:  # in a worker every answer has a budget
            longest = self.max_budget_ms / 1000
            budget = longest if budget is None else min(budget, longest)
        return la.Work(budget, self._cancelled)
