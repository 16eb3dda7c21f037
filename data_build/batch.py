"""The batch job and its commands: enumerate dimension types, compute them in chunks, and write the atlas file.

A chunk depends only on the rule and its first row, so the file has the same bytes for any number of processes, and on a Dask
cluster even if workers fail. The file is written once, after the computation, so that a reader sees either the old or the new
file.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from synthesis.atlas.file import StoredAtlas, check_contents, encode_atlas, load_atlas
from synthesis.atlas.table import KINDS, AtlasRule, Features, Series, compute_features, compute_series
from synthesis.errors import AtlasError, AtlasFault, FieldError
from synthesis.fourbar.dimension_types import OrderRule

CHUNK_TYPES = 4096
EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_DAMAGED, EXIT_INTERRUPTED = 0, 1, 2, 3, 130
MAX_BUILD_BYTES = 8_000_000_000
"""Largest array of details of a build, which holds it in memory; a larger rule is refused as a mistake."""


def _start_worker() -> None:
    """Ignore interrupts, which the parent handles, and end when the parent ends, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        parent.join()
        os._exit(1)

    if parent is not None:
        threading.Thread(target=follow, daemon=True).start()


@contextlib.contextmanager
def local_executor(jobs: int) -> Iterator[Executor]:
    """Provide an executor of ``jobs`` processes; a single job runs in a thread, which starts faster."""
    executor: Executor = ThreadPoolExecutor(1)
    if jobs > 1:
        executor = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Provide the executor of a Dask cluster; requires the extra ``[distributed]``, and this package on the workers."""
    try:
        from distributed import Client
    except ImportError:
        raise SystemExit("--scheduler needs Dask: pip install distributed") from None
    with Client(address, timeout="10s", set_as_default=False) as client:
        yield client.get_executor()


def compute_chunk(rule: AtlasRule, first: int) -> tuple[Features, Series]:
    """Compute features and series of the types of a chunk."""
    lengths, mechanism = rule.lengths(first, first + CHUNK_TYPES), rule.kind.mechanism
    return compute_features(lengths, rule.samples, mechanism), compute_series(lengths, mechanism)


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
        ``out`` exists and is not a regular file.
    OSError
        The file cannot be written; an existing file is unchanged.
    """
    out = out.resolve()
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


# -- commands ------------------------------------------------------------------------------------------------------------


def main(argv: Sequence[str] | None = None, prog: str = "linkage-atlas") -> int:
    """Run a batch command; return the exit code: 0 done, 1 failed, 2 usage, 3 damaged data, 130 interrupted."""
    parser = argparse.ArgumentParser(prog=prog, description="Build and check atlas files.")
    add_commands(parser.add_subparsers(metavar="COMMAND", required=True))
    options = parser.parse_args(argv)
    try:
        values = options.run(options)
        if options.json:
            print(json.dumps(values))
            return EXIT_OK
        for name, value in values.items():
            text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
            print(f"{name:<16} {text:,}" if isinstance(text, int) else f"{name:<16} {text}")
        return EXIT_OK
    except KeyboardInterrupt:
        print("interrupted; no file was written", file=sys.stderr)
        return EXIT_INTERRUPTED
    except AtlasError as error:
        print(f"{options.file}: {error}", file=sys.stderr)
        return EXIT_USAGE if error.fault is AtlasFault.MISSING else EXIT_DAMAGED
    except FieldError as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"cannot write: {error}", file=sys.stderr)
        return EXIT_FAILED


def _count(text: str) -> int:
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, found {number}")
    return number


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the commands `build`, `verify` and `info`, which build, check and describe an atlas file.

    Each sets ``run``, a function of the parsed options that returns the values to print.
    """
    build = commands.add_parser("build", help="Build an atlas file.", description="Build an atlas file.")
    build.add_argument("--out", type=Path, default=Path("atlas.h5"), help="output file (default: %(default)s)")
    build.add_argument(
        "--kind", choices=list(KINDS), default="four_bar", help="kind of linkage (default: %(default)s)"
    )
    build.add_argument(
        "--perimeter",
        type=int,
        help="sum of the lengths of each linkage (default: 400 for four_bar, 640 for slider_crank)",
    )
    build.add_argument("--smallest", type=int, help="length of the smallest crank (default: 2)")
    orders = [rule.value for rule in OrderRule]
    build.add_argument(
        "--order", choices=orders, help=f"orders of the four lengths that are enumerated (default: {orders[0]})"
    )
    build.add_argument("--samples", type=int, help="number of samples of a curve, a power of two (default: 256)")
    build.add_argument(
        "--jobs", type=_count, default=os.cpu_count() or 1, help="number of processes (default: number of cores)"
    )
    build.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster at this address")
    build.set_defaults(run=_build)
    verify = commands.add_parser(
        "verify", help="Check all contents of an atlas file.", description="Check all contents of an atlas file."
    )
    verify.set_defaults(run=lambda options: {"status": "sound", **_describe(options, check_contents)})
    info = commands.add_parser("info", help="Describe an atlas file.", description="Describe an atlas file.")
    info.set_defaults(run=_describe)
    for command in (build, verify, info):
        command.add_argument("--json", action="store_true", help="print JSON")
    for command in (verify, info):
        command.add_argument("file", type=Path)


def _describe(options: Any, check: Callable[[Path, StoredAtlas], None] = lambda path, atlas: None) -> dict[str, Any]:
    atlas = load_atlas(options.file)
    check(options.file, atlas)
    facts = {"file": str(options.file), "bytes": options.file.stat().st_size, "types": len(atlas.lengths)}
    facts |= {"rule": atlas.rule.as_json(), "content_sha256": atlas.content_sha256, "generator": atlas.generator}
    return facts


def _build(options: Any) -> dict[str, Any]:
    rule, started = (
        AtlasRule.of(options.kind, options.perimeter, options.smallest, options.order, options.samples),
        time.perf_counter(),
    )
    if (size := rule.count * rule.samples * 4) > MAX_BUILD_BYTES:
        raise FieldError(
            "/perimeter",
            f"requires {size:,} bytes of details, but at most {MAX_BUILD_BYTES:,} are allowed; reduce it",
        )
    if not options.out.parent.is_dir():
        raise FieldError("/out", f"the folder {options.out.parent} does not exist")
    chosen = dask_executor(options.scheduler) if options.scheduler else local_executor(options.jobs)
    with chosen as executor, tqdm(disable=None, unit="chunk", desc="atlas", file=sys.stderr) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        build_atlas(rule, options.out, executor, progress)
    options.file = options.out
    return {**_describe(options), "seconds": round(time.perf_counter() - started, 2)}
