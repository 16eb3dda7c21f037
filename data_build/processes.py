"""Processes of batch jobs, studies and the service: they end with their parent; and the executor of a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager


def follow_parent(*ignored: signal.Signals) -> None:
    """Ignore signals that the parent handles, and end this process when the parent ends, even if it is killed."""
    for name in ignored:
        signal.signal(name, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        parent.join()
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


@contextmanager
def executor(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Provide an executor of ``jobs`` processes, or of the Dask cluster at an address; a single job runs in a thread.

    A cluster needs the extra ``[distributed]`` here, and this package on its workers.
    """
    if scheduler:
        from distributed import Client

        with Client(scheduler, timeout="10s", set_as_default=False) as client:
            yield client.get_executor()
        return
    pool: Executor = ThreadPoolExecutor(1)  # a thread starts faster
    if jobs > 1:
        pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), follow_parent, (signal.SIGINT,))
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
