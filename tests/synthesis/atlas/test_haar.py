"""Haar features agree with explicit block means.

A wrong order or scale of the details would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas import haar

laws = settings(derandomize=True, max_examples=40, deadline=None)
curves = st.builds(
    lambda j, seed, size: np.random.default_rng(seed).normal(scale=size, size=2**j),
    st.integers(1, 9),
    st.integers(0, 2**32),
    st.sampled_from([1e-9, 1.0, 1e9]),
)


@laws
@given(curves)
def test_inverse_gives_the_curve_back(curve) -> None:
    back = haar.curve_from_features(*haar.features(curve))
    assert np.allclose(back, curve, rtol=0, atol=1e-14 * np.abs(curve).max())


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
