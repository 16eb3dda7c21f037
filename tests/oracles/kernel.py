"""The source of `synthesis.kernel`, not compiled: the same lines run as plain Python, slowly."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from synthesis import kernel

SOURCE = Path(kernel.__file__).with_name("kernel.py")


def uncompiled() -> ModuleType:
    """The source as a module of its own; arrays take the place of typed views, and Python's numbers that of C's."""
    spec = importlib.util.spec_from_file_location("uncompiled_kernel", SOURCE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
