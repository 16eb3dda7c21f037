"""Compile the kernels of the package, each to a library beside its source: ``python setup.py build_ext --inplace``."""

import importlib.util
import os
import shlex
import sys
import sysconfig
from pathlib import Path

from setuptools import Extension, setup

from build_backend import compiler

KERNELS = (
    "synthesis.kernels.crank_loops",
    "synthesis.kernels.four_bar_limits",
    "synthesis.kernels.crank_descent",
    "synthesis.kernels.damped_steps",
    "synthesis.kernels.guide",
    "synthesis.kernels.pair_rows",
    "synthesis.kernels.quadratic_program",
    "synthesis.kernels.distinct",
    "synthesis.atlas.tree_kernel",
)

if found := compiler():
    os.environ["CC"] = found
elif importlib.util.find_spec("ziglang"):
    # The target is named, as zig else compiles for this very processor; Debian's Python.h includes from its parent folder.
    python, headers = shlex.quote(sys.executable), shlex.quote(str(Path(sysconfig.get_path("include")).parent))
    target = sysconfig.get_config_var("MULTIARCH")
    os.environ["CC"] = f"{python} -m ziglang cc -target {target} -idirafter {headers}"
    os.environ["LDSHARED"] = os.environ["CC"] + " -shared"


def extension(name: str) -> Extension:
    """Describe how to compile a module that is written in Cython's pure Python mode."""
    source = name.replace(".", "/") + ".py"
    module = Extension(
        name,
        [source],
        depends=["setup.py", "build_backend/__init__.py", *map(str, Path("synthesis/kernels").glob("*.pxd"))],
        # Cython's own complex numbers: C's look for NaN in every product
        define_macros=[("CYTHON_CCOMPLEX", "0")],
        libraries=["m"],
        # loops over eight children are vectors, whatever lies around them
        extra_compile_args=["-O3", "-g0", "-fno-math-errno", "-fno-tree-loop-vectorize"],
    )
    module.cython_directives = {
        "language_level": 3,
        "boundscheck": False,
        "wraparound": False,
        "cdivision": True,
        "initializedcheck": False,
        "infer_types": True,
    }
    return module


setup(ext_modules=[extension(name) for name in KERNELS])
