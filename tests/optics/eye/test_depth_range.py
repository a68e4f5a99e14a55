"""Distances of a scene, and the layers into which they are divided."""

import math

import numpy as np
import pytest

from optics.eye.depth_range import MOST_DISTINCT, MOST_NODES, DepthRange, inverse_distances_in, layers_for
from tests.optics.device_types import Float64


def test_distances_are_sorted_from_the_farthest_to_the_nearest():
    found = DepthRange.from_distances(np.array([[2.0, math.inf], [0.5, 2.0]]))
    assert (found.distances, found.only) == ((math.inf, 2.0, 0.5), None)
    assert found.each() == [math.inf, 2.0, 0.5]
    assert [found.distance(place) for place in (-1, 0, 1)] == [math.inf, 1.0, 0.5]
    assert found.layers(1) == [1.0]
    assert found.layers(3)[::2] == [math.inf, 0.5]
    alone = DepthRange.from_distances(3.0)
    assert (alone.distances, alone.only, alone.distance(0.7)) == ((3.0,), 3.0, 3.0)


def test_a_distance_may_carry_derivatives():
    z = Float64(2.0)
    found = DepthRange.from_distances(z)
    assert found.distances == (2.0,)
    assert found.only is z
    np.testing.assert_array_equal(inverse_distances_in((2, 3), z), np.full((2, 3), 0.5))
    for call in (DepthRange.from_distances, lambda bad: inverse_distances_in((2, 3), bad)):
        with pytest.raises(ValueError, match=r"^z = "):
            call(Float64(-1.0))


@pytest.mark.parametrize(("count", "layers"), [(1, "auto"), (2, "distinct"), (17, "distinct"), (18, "auto")])
def test_few_distances_have_a_layer_each(count, layers):
    assert MOST_DISTINCT == 17
    z = np.arange(1.0, count + 1)
    found, distances = layers_for(z)
    assert found == layers
    assert distances == (tuple(z[::-1]) if layers == "distinct" else (z[-1], z[0]))


@pytest.mark.parametrize("count", [MOST_NODES, MOST_NODES + 1])
def test_the_largest_number_of_distinct_distances(count):
    assert MOST_NODES == 64
    found = DepthRange.from_distances(np.arange(1.0, count + 1))
    if count == MOST_NODES:
        assert len(found.each()) == count
        return
    with pytest.raises(ValueError, match=r"^depth_layers = 'distinct' and z holds 65 distances: must be at most 64"):
        found.each()


@pytest.mark.parametrize(
    ("z", "reason"),
    [
        (np.ones((3, 2)), r"z has shape \(3, 2\): must be one distance or one per cell, \(2, 3\)"),
        (np.full((2, 3), np.nan), "z is empty or holds NaN"),
        ([], "z is empty or holds NaN"),
        ("far", "z = 'far': must be a distance"),
        (np.array([[1.0, 2, 3], [1, 0, 2]]), "z = 0.0"),
        (-1.0, "z = -1.0"),
    ],
)
def test_bad_distances_are_named(z, reason):
    with pytest.raises(ValueError, match=f"^{reason}"):
        inverse_distances_in((2, 3), z)


def test_inverse_distances_of_cells():
    np.testing.assert_array_equal(inverse_distances_in((2, 3), 4.0), np.full((2, 3), 0.25))
    z = np.array([[1.0, 2, 4], [math.inf, 5, 10]])
    np.testing.assert_array_equal(inverse_distances_in((2, 3), z), [[1, 0.5, 0.25], [0, 0.2, 0.1]])
