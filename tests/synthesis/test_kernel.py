"""The compiled kernel against its own source run as Python, and against LAPACK."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from synthesis import kernel
from tests.oracles.kernel import LIBRARY, SOURCE, compiled_from, uncompiled


def test_a_library_of_another_source_is_noticed(tmp_path: Path) -> None:
    other = tmp_path / "kernel.py"
    other.write_text(SOURCE.read_text() + "\n")
    assert compiled_from(SOURCE, LIBRARY) and not compiled_from(other, LIBRARY) and not compiled_from(SOURCE, SOURCE)


def test_the_library_runs_without_cython() -> None:
    code = "import sys, synthesis.kernel; sys.exit('cython' in sys.modules or 'Cython' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=SOURCE.parents[1])


@pytest.mark.parametrize("size", [1, 2, 9])
def test_triangle_compiled_as_source_and_as_lapack(size: int) -> None:
    random = np.random.default_rng(size)
    columns = np.tril(random.normal(size=(size, size)), -1) + np.diag(random.uniform(1, 2, size))
    b = random.normal(size=size)
    found, same = np.empty(size), np.empty(size)
    assert kernel.back_substitute(columns, b, found) and uncompiled().back_substitute(columns, b, same)
    np.testing.assert_allclose(found, same, rtol=1e-14)
    np.testing.assert_allclose(found, solve_triangular(columns.T, b), rtol=1e-13)


def test_triangle_without_solution() -> None:
    columns, x = np.eye(3), np.full(3, 7.0)
    columns[1, 1] = 0
    for module in (kernel, uncompiled()):
        assert not module.back_substitute(columns, np.ones(3), x) and (x == 7).all()
