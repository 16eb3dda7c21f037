"""Commands that build, check and describe an atlas file."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from app.terminal import Exit

BUILD = "Build an atlas file."
VERIFY = "Check all contents of an atlas file."
INFO = "Describe an atlas file."


def add_build(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command ``build``."""
    parser.description = BUILD
    parser.add_argument("--out", type=Path, default=Path("atlas.h5"), help="output file (default: %(default)s)")
    parser.add_argument("--perimeter", type=int, help="sum of the lengths of each linkage (default: 400)")
    parser.add_argument("--smallest", type=int, help="length of the smallest crank (default: 2)")
    orders = "increasing (default), crank_shortest or full_crank"
    parser.add_argument("--order", help=f"orders of the four lengths that are enumerated: {orders}")
    parser.add_argument("--samples", type=int, help="number of samples of a curve, a power of two (default: 256)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="number of processes (default: one per core)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="run on the Dask cluster at this address")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=_build)


def add_verify(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command ``verify``."""
    parser.description = VERIFY
    _add_file(parser)
    parser.set_defaults(run=_verify)


def add_info(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command ``info``."""
    parser.description = INFO
    _add_file(parser)
    parser.set_defaults(run=_info)


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path)
    parser.add_argument("--json", action="store_true", help="print JSON")


def _build(options: argparse.Namespace) -> Exit:
    from linkage_atlas.atlases import build_atlas, shown_progress

    begin = time.perf_counter()
    try:
        with shown_progress() as progress:
            atlas = build_atlas(
                options.out,
                options.perimeter,
                options.smallest,
                options.order,
                options.samples,
                jobs=options.jobs,
                scheduler=options.scheduler,
                progress=progress,
            )
    except OSError as error:
        print(f"cannot write: {error}", file=sys.stderr)
        return Exit.FAILED
    return _print(options, options.out, atlas, seconds=round(time.perf_counter() - begin, 2))


def _verify(options: argparse.Namespace) -> Exit:
    from linkage_atlas import load_atlas

    atlas = load_atlas(options.file)
    atlas.check()
    return _print(options, options.file, atlas, status="sound")


def _info(options: argparse.Namespace) -> Exit:
    from linkage_atlas import load_atlas

    return _print(options, options.file, load_atlas(options.file))


def _print(options: argparse.Namespace, file: Path, atlas: Any, **facts: Any) -> Exit:
    """Print a description of an atlas and its file, as JSON or as lines."""
    values = {"file": str(file), "bytes": file.stat().st_size, **atlas.describe(), **facts}
    if options.json:
        print(json.dumps(values))
        return Exit.OK
    for name, value in values.items():
        text = ", ".join(f"{key} {part}" for key, part in value.items()) if isinstance(value, dict) else value
        print(f"{name:<16} {text:,}" if isinstance(text, int) else f"{name:<16} {text}")
    return Exit.OK
