"""The sources of `synthesis.kernels` run uncompiled, as plain Python: an oracle for the compiled libraries, slow."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import patch

import cython  # noqa: F401 - the module of C's functions is replaced below
import numpy as np

from synthesis import kernels
from synthesis.kernels import (
    codes,
    crank_descent,
    crank_loops,
    damped_steps,
    distinct,
    four_bar_limits,
    guide,
    pair_rows,
    plane,
    quadratic_program,
)

FOLDER = Path(kernels.__file__).parent
COMPILED = (crank_loops, four_bar_limits, crank_descent, damped_steps, guide, pair_rows, quadratic_program, distinct)
"""Each module after those that it uses."""
C_FUNCTIONS = {
    **{
        name: getattr(np, name)
        for name in ("copysign", "cos", "exp", "fabs", "floor", "isfinite", "log", "rint", "sin", "sqrt")
    },
    "atan2": np.arctan2,
}
"""The functions of numpy: C's also return NaN or infinity where Python's raise an exception."""


def _joined(modules: list[ModuleType]) -> SimpleNamespace:
    return SimpleNamespace(**{name: value for module in modules for name, value in vars(module).items()})


def compiled() -> SimpleNamespace:
    """Return the contents of all compiled modules in a single namespace."""
    return _joined([codes, *COMPILED])


@cache
def uncompiled() -> SimpleNamespace:
    """Return the same names from the sources; arrays replace typed views, and numpy's numbers replace C's."""
    libc = ModuleType("cython.cimports.libc.math")
    vars(libc).update(C_FUNCTIONS)
    prefix = f"cython.cimports.{kernels.__name__}."
    loaded = {libc.__name__: libc, f"{prefix}codes": codes, f"{prefix}plane": plane}
    with patch.dict(sys.modules, loaded):
        for library in COMPILED:
            name = library.__name__.rpartition(".")[2]
            spec = importlib.util.spec_from_file_location(f"uncompiled_{name}", FOLDER / f"{name}.py")
            assert spec is not None and spec.loader is not None
            sys.modules[prefix + name] = loaded[prefix + name] = module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
    return _joined([module for name, module in loaded.items() if name.startswith(prefix)])
