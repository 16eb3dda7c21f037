"""The compiled kernel against its own source run as Python, and against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_triangular

from synthesis import kernel
from tests.oracles.kernel import uncompiled


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
