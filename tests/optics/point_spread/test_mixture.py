"""Sums over wavelengths."""

import drjit as dr
import numpy as np
import pytest

from optics.point_spread.mixture import mixed
from tests.optics.device_types import TensorXf64

RNG = np.random.default_rng(0)
WEIGHTS = np.array([[0.2, 0.9, -0.1], [0.5, 0.0, 0.5]])


@pytest.mark.parametrize("shape", [(3, 4, 5), (3, 7), (3, 1, 1)])
@pytest.mark.parametrize("kind", [np.float32, TensorXf64])
def test_it_is_numpys_tensordot(shape, kind):
    values = RNG.random(shape)
    found = mixed(values.astype(kind) if kind is np.float32 else kind(values), WEIGHTS)
    assert found.shape == (2, *shape[1:])
    np.testing.assert_allclose(found.numpy(), np.tensordot(WEIGHTS, values, axes=1), rtol=1e-6)


def test_derivatives_are_the_weights():
    values = TensorXf64(RNG.random((3, 2, 2)))
    dr.enable_grad(values)
    dr.backward(dr.sum(mixed(values, WEIGHTS).array))
    np.testing.assert_allclose(dr.grad(values).numpy()[:, 0, 1], WEIGHTS.sum(axis=0))
