"""The compiled part of the package: synthesis/kernel.py, made a library beside it (``make kernel``)."""

from setuptools import Extension, setup

kernel = Extension("synthesis.kernel", ["synthesis/kernel.py"], extra_compile_args=["-O3", "-g0"])
kernel.cython_directives = {
    "language_level": 3,
    "boundscheck": False,
    "wraparound": False,
    "cdivision": True,
    "initializedcheck": False,
}

setup(ext_modules=[kernel])
