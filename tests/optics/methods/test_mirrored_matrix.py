"""Products with mirrored matrices, against the plain products."""

import math

import numpy as np
import pytest

import optics
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import mirrored_matrix
from optics.methods.mirrored_matrix import MirroredMatrix
from optics.methods.window_images import window_images
from optics.methods.window_plan import WindowPlan
from validation.reference import relative_l2

RNG = np.random.default_rng(2)


@pytest.mark.parametrize("rows", [1, 2, 7, 8])
@pytest.mark.parametrize("columns", [1, 2, 5, 6])
def test_the_product_is_that_of_the_whole_matrix(rows, columns):
    whole = RNG.normal(size=(3, 2 * (rows // 2) + 1, columns)) + 1j * RNG.normal(size=(3, 1, columns))
    whole = (whole + whole[:, ::-1, ::-1])[:, :rows]
    other = RNG.normal(size=(3, columns, 4)) + 0j
    np.testing.assert_allclose(MirroredMatrix.from_matrix(whole) @ other, whole @ other, atol=1e-12)


@pytest.mark.parametrize("shape", [(65, 65), (64, 66)])
@pytest.mark.parametrize(("rank", "crossed"), [(1, False), (1, True), (2, False), (3, False)])
def test_psfs_of_large_windows_are_sums_with_mirrored_matrices(monkeypatch, shape, rank, crossed):
    window = optics.Grid(shape, 0.6e-6)
    pupil = optics.Pupil(150e-6, wavefront=optics.Zernike({(3, 1): 0.2}), thin_lens_focal_length=1e-3)
    stack = LightStack((Beam(pupil, optics.PointSource(), 550e-9, 1e-3),))
    products = []

    def product(matrix, other, own=MirroredMatrix.__matmul__):
        products.append(other.shape)
        return own(matrix, other)

    monkeypatch.setattr(MirroredMatrix, "__matmul__", product)

    def image(least):
        monkeypatch.setattr(mirrored_matrix, "LEAST_PRODUCTS", least)
        samples, _ = WindowPlan(stack, window, np.array([1e-2])).samples(np.array([0]))
        return window_images(stack, samples, rank, crossed, window, "float64")

    plain = image(math.inf)
    assert not products
    assert relative_l2(image(0.0), plain) < 1e-8
    assert len(products) == 4 if crossed else 2


def test_only_windows_about_the_axis_are_mirrored():
    many = np.array([300])
    assert mirrored_matrix.mirroring_share(optics.Grid((513, 513), 1e-6), many) < 1
    assert mirrored_matrix.mirroring_share(optics.Grid((513, 513), 1e-6, (0.0, 1e-9)), many) == 1
    assert mirrored_matrix.mirroring_share(optics.Grid((65, 65), 1e-6), np.array([73])) == 1
