"""The source of `synthesis.kernel`: as it is, not compiled, it runs as plain Python, slowly."""

from __future__ import annotations

import importlib.util
from hashlib import sha256
from pathlib import Path
from types import ModuleType

from synthesis import kernel

LIBRARY = Path(kernel.__file__)
SOURCE = LIBRARY.with_name("kernel.py")


def compiled_from(source: Path, library: Path) -> bool:
    """Whether a library was compiled from a source as it is now: setup.py puts the source's hash into it."""
    return sha256(source.read_bytes()).hexdigest().encode() in library.read_bytes()


def uncompiled() -> ModuleType:
    """The source as a module of its own; arrays take the place of typed views, and Python's numbers that of C's."""
    spec = importlib.util.spec_from_file_location("uncompiled_kernel", SOURCE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
