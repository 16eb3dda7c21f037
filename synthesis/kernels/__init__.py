"""Compiled numerics of the searches: geometry and limits of cranks, descents, quadratic programs, deduplication.

The modules are written in Cython's pure Python mode: they are compiled when the package is installed, and the tests also run
them uncompiled. The ``.pxd`` files declare what one compiled module uses of another; `plane` and `codes` are stated twice, once
in Python and once as inline functions and numbers of C.
"""
