"""The batch on the command line: build, verify, info."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from data_build.batch import BuildLocked, build_atlas, dask_executor, local_executor
from synthesis.atlas.file import load_atlas
from synthesis.atlas.index import check_index, temporary_arrays
from synthesis.atlas.table import KINDS, MIN_SAMPLES, SCHEMA, Atlas, AtlasRule
from synthesis.errors import AtlasError, AtlasFault, FieldError
from synthesis.fourbar.dimension_types import OrderRule

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_DAMAGED, EXIT_INTERRUPTED = 0, 1, 2, 3, 130
MAX_BUILD_BYTES = 100_000_000_000
"""Largest table of details that a build makes: more is asked for by mistake, or not for one disk."""


def main(argv: Sequence[str] | None = None, prog: str = "linkage-atlas") -> int:
    """Run one batch command; returns the exit code: 0 ok, 1 failed, 2 usage, 3 damaged data, 130 interrupted."""
    try:
        options = _parser(prog).parse_args(argv)
        code = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except BrokenPipeError:  # nobody reads what is said; what was made is there
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return EXIT_INTERRUPTED
    except AtlasError as error:
        print(f"{options.file}: {error}", file=sys.stderr)
        return EXIT_USAGE if error.fault is AtlasFault.MISSING else EXIT_DAMAGED
    except (FieldError, BuildLocked) as error:
        print(error, file=sys.stderr)
        return EXIT_USAGE
    except OSError as error:
        print(f"cannot write: {error}", file=sys.stderr)
        return EXIT_FAILED


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, found {number}")
    return number


def _parser(prog: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=prog, description="Builds and checks atlas files.")
    add_commands(parser.add_subparsers(metavar="COMMAND", required=True))
    return parser


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the batch's commands to those of a parser."""
    default = AtlasRule()

    build = commands.add_parser("build", help="build an atlas file", description="Builds an atlas file.")
    build.add_argument(
        "--out",
        type=Path,
        default=Path("atlas.h5"),
        help="the file to write; a symbolic link is followed, what is no regular file is refused (default: %(default)s)",
    )
    build.add_argument("--kind", choices=list(KINDS), default=default.types.kind, help="of linkages (%(default)s)")
    sums = ", ".join(f"{AtlasRule.of(kind).types.perimeter} of {kind}" for kind in KINDS)
    build.add_argument("--perimeter", type=int, help=f"sum of the lengths of a type ({sums})")
    build.add_argument("--smallest", type=int, help=f"smallest crank ({default.types.smallest})")
    orders = [rule.value for rule in OrderRule]
    build.add_argument("--order", choices=orders, help=f"of a four-bar's lengths ({orders[0]})")
    build.add_argument(
        "--samples", type=int, default=default.samples, help="samples of a curve, a power of two (%(default)s)"
    )
    build.add_argument("--jobs", type=_count, default=os.cpu_count() or 1, help="processes (default: one a core)")
    build.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster at this address instead")
    build.add_argument("--json", action="store_true", help="print what was built as JSON")
    build.set_defaults(run=_build)

    for name, text in (
        ("verify", "read a whole file, and the index beside it, and say whether they are sound"),
        ("info", "say what a file holds"),
    ):
        command = commands.add_parser(name, help=text, description=text.capitalize() + ".")
        command.add_argument("file", type=Path)
        command.add_argument("--json", action="store_true")
        command.set_defaults(run=_verify if name == "verify" else _info)


def describe(atlas: Atlas) -> dict[str, Any]:
    """What a file holds, as plain JSON values."""
    return {
        "types": len(atlas),
        "schema": atlas.schema,
        "rule": atlas.rule.as_json(),
        "content_sha256": atlas.content_hash(),
        "curve_error_max": float(atlas.curve_error.max(initial=0)),
        "generator": atlas.generator,
    }


def _print(values: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(values))
        return
    for name, value in values.items():
        text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
        print(f"{name:<16} {text:,}" if isinstance(text, int) else f"{name:<16} {text}")


def _build(options: argparse.Namespace) -> int:
    rule = AtlasRule.of(options.kind, options.perimeter, options.smallest, options.order, options.samples)
    size = rule.count * rule.samples * 4
    if size > MAX_BUILD_BYTES:
        raise FieldError("/perimeter", f"gives {size:,} bytes of details, a build makes at most {MAX_BUILD_BYTES:,}")
    if not options.out.parent.is_dir():
        raise FieldError("/out", f"there is no folder {options.out.parent}")
    # A flag and no exception: raised inside a destructor or a weak reference's callback it would be lost.
    asked_to_stop = threading.Event()
    for name in (signal.SIGTERM, signal.SIGINT):
        if signal.getsignal(name) is not signal.SIG_IGN:
            signal.signal(name, lambda *_: asked_to_stop.set())
    started = time.perf_counter()
    chosen = dask_executor(options.scheduler) if options.scheduler else local_executor(options.jobs)
    # disable=None: tqdm draws on a terminal and is silent elsewhere
    with chosen as executor, tqdm(disable=None, unit="shard", desc="atlas", file=sys.stderr) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        built = build_atlas(rule, options.out, executor, progress, asked_to_stop.is_set)
    summary = {
        "file": str(options.out),
        "bytes": options.out.stat().st_size,
        "types": built.types,
        "schema": SCHEMA,
        "rule": rule.as_json(),
        "content_sha256": built.content_sha256,
        "curve_error_max": built.curve_error_max,
        "generator": built.generator,
    }
    _print({**summary, "seconds": round(time.perf_counter() - started, 2)}, options.json)
    return EXIT_OK


def _load(file: Path) -> Atlas:
    """The atlas of a file, its arrays on disk beside it, or else in memory."""
    most = MAX_BUILD_BYTES // MIN_SAMPLES // 4
    with contextlib.suppress(OSError):
        return load_atlas(file, max_types=most, new=temporary_arrays(file.parent))
    return load_atlas(file, max_types=most)


def _verify(options: argparse.Namespace) -> int:
    atlas = _load(options.file)
    count = check_index(options.file.with_name(options.file.name + ".index"))
    index = {"index_files": count} if count else {}
    _print({"file": str(options.file), "status": "sound", **index, **describe(atlas)}, options.json)
    return EXIT_OK


def _info(options: argparse.Namespace) -> int:
    atlas = _load(options.file)
    _print({"file": str(options.file), "bytes": options.file.stat().st_size, **describe(atlas)}, options.json)
    return EXIT_OK
