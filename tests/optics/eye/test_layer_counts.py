"""Numbers of depth layers and field zones of `Eye.sight`: what is requested is computed, and nothing else."""

import numpy as np
import pytest

from optics import Eye, Pupil

LENS = Eye(Pupil(30e-6, thin_lens_focal_length=240e-6), (3, 5), 30.0, bands=1)
NEAR_AND_FAR = (1e-3, 1e-2)


def counts(z, **requested):
    """Return the numbers of nodes along depth, y and x for which kernels were computed, and those that are reported."""
    bank = LENS.sight(2, z, light_from="centres", **requested)
    computed = tuple(1 + max(node[axis] for node in bank.kernels) for axis in range(3))
    assert len(bank.kernels) == np.prod(computed)
    assert tuple(n for choice in bank.choices for n in choice.counts) == computed
    return computed


@pytest.mark.parametrize("layers", [1, 2, 3])
def test_the_requested_layers_are_computed(layers):
    assert counts(NEAR_AND_FAR, depth_layers=layers) == (layers, 1, 1)


@pytest.mark.parametrize("layers", [1, 4, "auto"])
def test_one_distance_has_one_layer(layers):
    """All distances are equal, so that more layers would be equal, too."""
    assert counts(2e-3, depth_layers=layers) == (1, 1, 1)
    assert counts([2e-3, 2e-3], depth_layers=layers) == (1, 1, 1)


@pytest.mark.parametrize("zones", [1, 3])
def test_the_requested_zones_are_along_the_longer_side(zones):
    layers, down, right = counts(2e-3, field_zones=zones)
    assert (layers, right) == (1, zones)
    assert 1 <= down <= zones


def test_the_largest_numbers():
    assert counts(2e-3, depth_layers=64) == (1, 1, 1)
    for name in ("depth_layers", "field_zones"):
        for wrong in (0, 65, -1):
            with pytest.raises(ValueError, match=rf"{name} = {wrong}: must be a whole number in \[1, 64\]"):
                LENS.sight(2, NEAR_AND_FAR, **{name: wrong})


def test_layers_are_equidistant_in_inverse_distance():
    """The middle one of three layers is the kernel of the harmonic mean of the distances."""
    bank = LENS.sight(2, NEAR_AND_FAR, 3, light_from="centres")
    for layer, z in enumerate((1e-2, 2 / (1 / 1e-3 + 1 / 1e-2), 1e-3)):
        alone = LENS.sight(2, z, light_from="centres").kernels[0, 0, 0]
        found = bank.kernels[layer, 0, 0]
        np.testing.assert_allclose(np.asarray(found), np.asarray(alone), atol=1e-6 * np.asarray(alone).max())
