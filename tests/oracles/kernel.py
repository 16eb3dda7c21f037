"""The source of `synthesis.kernel`: as it is, not compiled, it runs as plain Python, slowly."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import cython  # noqa: F401 - it names a module of C's functions itself
import numpy as np

from synthesis import kernel

LIBRARY = Path(kernel.__file__)
SOURCE = LIBRARY.with_name("kernel.py")
C_FUNCTIONS = {
    **{
        name: getattr(np, name)
        for name in ("copysign", "cos", "exp", "fabs", "floor", "isfinite", "log", "rint", "sin", "sqrt")
    },
    "atan2": np.arctan2,
}
"""As numpy has them: where Python's raise, C's and these give NaN or infinity."""


def compiled_from(source: Path, library: Path) -> bool:
    """Whether a library was compiled from a source as it is now: setup.py puts the source's hash into it."""
    return sha256(source.read_bytes()).hexdigest().encode() in library.read_bytes()


@cache
def uncompiled() -> ModuleType:
    """The source as a module of its own; arrays take the place of typed views, and numpy's numbers that of C's."""
    libc = ModuleType("cython.cimports.libc.math")
    vars(libc).update(C_FUNCTIONS)
    spec = importlib.util.spec_from_file_location("uncompiled_kernel", SOURCE)
    module = importlib.util.module_from_spec(spec)
    with patch.dict(sys.modules, {libc.__name__: libc}):
        spec.loader.exec_module(module)
    module.Loop.guide = 0  # as C begins
    return module
