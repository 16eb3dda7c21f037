"""Where shards run: processes on this machine, or a Dask cluster."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any


def _start_worker() -> None:
    """Ignore interrupts, which the parent handles, and end when the parent ends, also when it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        parent.join()
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


class _Processes(ProcessPoolExecutor):
    """Processes that are born with interrupts blocked: one that is still importing would show a traceback."""

    def submit(self, *arguments: Any, **others: Any) -> Future[Any]:
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(*arguments, **others)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


@contextlib.contextmanager
def local_executor(jobs: int) -> Iterator[Executor]:
    """``jobs`` processes; for one job a thread, which saves the start of a process."""
    if jobs == 1:
        executor: Executor = ThreadPoolExecutor(1)
    else:
        executor = _Processes(jobs, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """A Dask cluster's executor; needs the extra ``[distributed]`` here and this package on the workers."""
    try:
        from distributed import Client
    except ImportError:
        raise SystemExit("--scheduler needs the extra: pip install 'linkage-atlas[distributed]'") from None
    with Client(address, timeout="10s", set_as_default=False) as client:
        yield client.get_executor()
