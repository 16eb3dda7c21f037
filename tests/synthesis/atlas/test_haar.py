"""Curves at uneven crank angles are resampled exactly up to cubics.

A sample at a wrong crank angle would show here.
"""

import numpy as np
import pytest

from synthesis.atlas import haar


@pytest.mark.parametrize("samples", [3, 5, 8, 16, 33])
@pytest.mark.parametrize("sign", [1, -1])
def test_resampling_keeps_cubics(samples, sign) -> None:
    uneven = sign * np.cumsum(np.random.default_rng(samples).uniform(0.5, 1.5, samples))
    cubics = np.array([uneven**power for power in range(4 if samples > 3 else 3)])
    even, curve = haar.resample(uneven, cubics)
    size = 2 ** int(np.ceil(np.log2(samples)))
    assert even.size == size and curve.shape == (len(cubics), size)
    assert even[[0, -1]] == pytest.approx(uneven[[0, -1]])
    for power, row in enumerate(curve):
        assert row == pytest.approx(even**power, rel=1e-10, abs=1e-10)
