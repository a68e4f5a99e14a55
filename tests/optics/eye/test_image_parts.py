"""Images on the retina and signals, from given numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics import Eye
from optics.eye import layered_image, photoreceptor, retinal_image
from optics.eye.kernel_bank import KernelBank
from optics.eye.layered_image import _Scene
from optics.eye.occlusion import Layer, visible_layers
from optics.eye.receptor_lattice import ReceptorLattice
from optics.eye.signals import signals, with_noise
from optics.numerics.precision import precision

TYPES = precision("float64")


@pytest.mark.parametrize(
    ("scene", "image", "kernel", "needed", "part"),
    [
        (20, 3, 5, 8, (0, 5)),  # 3 + 5 - 1 = 7 cells are needed, and the number stays even
        (21, 3, 5, 7, (0, 5)),
        (6, 3, 9, 6, (0, 9)),
        (3, 3, 25, 3, (9, 16)),  # from one end of the scene to the other end of the image: 2 cells in either direction
        (4, 3, 25, 4, (9, 16)),
        (9, 9, 1, 9, (0, 1)),
    ],
)
def test_parts_of_scene_and_kernel(scene, image, kernel, needed, part):
    assert retinal_image._within((scene, 30), (image, 2), (kernel, 3)) == (needed, 4)
    assert retinal_image._middle((kernel, 3), (image, 2), (scene, 30)) == (slice(*part), slice(0, 3))


def test_the_middle_of_an_image():
    image = np.arange(2 * 6 * 9).reshape(2, 6, 9)
    np.testing.assert_array_equal(retinal_image.centred(image, (2, 3)), image[:, 2:4, 3:6])
    np.testing.assert_array_equal(retinal_image.centred(image, (6, 9)), image)
    for wrong in ((3, 3), (2, 4), (8, 9), (6, 11)):
        with pytest.raises(ValueError, match=rf"radiance has 6 x 9 cells: must exceed {wrong[0]} x {wrong[1]} "):
            retinal_image.centred(image, wrong)


@pytest.mark.parametrize(("samples", "middle"), [(1, 0), (2, 1), (3, 1), (4, 2)])
def test_values_at_the_middles_of_receptors(samples, middle):
    image = np.random.default_rng(0).random((2, 2 * samples, 3 * samples))
    found = retinal_image.at_receptors(TYPES.Tensor(image), samples, TYPES).numpy()
    np.testing.assert_allclose(found, image[:, middle::samples, middle::samples])
    mean = retinal_image.receptor_average(TYPES.Tensor(image), samples, TYPES).numpy()
    np.testing.assert_allclose(mean, image.reshape(2, 2, samples, 3, samples).mean(axis=(2, 4)))


def test_means_over_rectangles():
    """An image of 4 x 4 cells for each average receptor, compared with a sum over a hundred times as many cells."""
    rows, columns = [-1.0, 0.45, 1.0], [[-1.5, -0.53, 0.25, 1.5], [-1.5, 0.0, 1.15, 1.5]]
    image = np.random.default_rng(0).random((2, 8, 12))
    found = retinal_image.mean_over(ReceptorLattice(np.array(rows), np.array(columns)), TYPES.Tensor(image), TYPES)
    fine = np.repeat(np.repeat(image, 25, axis=1), 25, axis=2)
    for i, (top, bottom) in enumerate(((0, 145), (145, 200))):
        for j in range(3):
            left, right = (round(100 * edge) + 150 for edge in columns[i][j : j + 2])
            expected = fine[:, top:bottom, left:right].mean(axis=(1, 2))
            np.testing.assert_allclose(found.numpy()[:, i, j], expected)


def test_kernels_of_one_cell():
    """Without blur, scenes are multiplied. Their margins are cut off."""
    rng = np.random.default_rng(0)
    scenes, kernels = list(rng.random((2, 3, 6, 7))), list(rng.random((2, 3, 1, 1)))
    found = retinal_image.blur(scenes, kernels, (4, 5), TYPES).numpy()
    expected = sum(kernel * scene for scene, kernel in zip(scenes, kernels, strict=True))
    np.testing.assert_allclose(found, expected[:, 1:-1, 1:-1])
    mixed = [kernels[0], np.pad(kernels[1], ((0, 0), (1, 1), (2, 2)))]
    np.testing.assert_allclose(retinal_image.blur(scenes, mixed, (4, 5), TYPES).numpy(), found)


def hidden_and_cells(*rows):
    return [
        Layer(np.array([source]), np.array([cells], bool), np.array([hiding], bool)) for source, cells, hiding in rows
    ]


@pytest.mark.parametrize("last", [True, False])
def test_layers_are_composited(monkeypatch, last):
    """Layers that hide nothing are collected until the next one that does, which passes half of the light."""
    layers = hidden_and_cells(
        ([0, 1, 2], [1, 0, 0], [0, 0, 0]),
        ([0, 0, 2], [0, 1, 0], [0, 1, 0]),
        ([0, 0, 1], [0, 1, 1], [0, 0, 1]),
        *([([0, 0, 0], [0, 0, 1], [0, 0, 0])] if last else []),
    )
    images = []

    def image(self, source, cells):
        images.append((source.tolist(), cells.astype(int).tolist()))
        return 10.0 ** len(images)

    monkeypatch.setattr(layered_image, "visible_layers", lambda depth, parallax: layers if parallax == 2.0 else 1 / 0)
    monkeypatch.setattr(_Scene, "image", image)
    monkeypatch.setattr(_Scene, "passing", lambda self, layer: 0.5)
    bank = SimpleNamespace(parallax=2.0)
    found = layered_image.retinal_image(np.ones((1, 1, 3)), np.array([[1.0, 2, 3]]), bank, (1, 3), None)
    assert found == 10 + 0.5 * 100 + (0.25 * 1000 if last else 0)
    expected = [([[0, 0, 0]], [[1, 1, 0]]), ([[0, 0, 1]], [[0, 1, 1]]), ([[0, 0, 0]], [[0, 0, 1]])]
    assert images == expected[: 3 if last else 2]


@pytest.mark.parametrize(("parallax", "depth"), [(0.0, [[1.0, 2, 3], [4, 5, 6]]), (2.0, [[1.0] * 3] * 2)])
def test_one_image_where_nothing_hides(monkeypatch, parallax, depth):
    monkeypatch.setattr(_Scene, "image", lambda self, source, cells: (source.tolist(), cells.all(), cells.shape))
    light, bank = np.ones((4, 2, 3)), SimpleNamespace(parallax=parallax)
    found = layered_image.retinal_image(light, np.array(depth), bank, (2, 3), None)
    assert found == ([[0, 1, 2], [3, 4, 5]], True, (2, 3))


def a_scene():
    """Two layers of nodes at 1/z = 0 and 1, whose kernels have the sums 0.5 and 0.25."""
    kernels = {(0, 0, 0): TYPES.Tensor(np.full((2, 1, 1), 0.5)), (1, 0, 0): TYPES.Tensor(np.full((2, 1, 1), 0.25))}
    bank = KernelBank((0.0, 1.0), (0.5, 1.5), kernels, (), parallax=1.0)
    light = np.arange(1.0, 7).reshape(2, 1, 3)
    return _Scene(light, np.array([[0.0, 0.5, 1.0]]), bank, (1, 3), TYPES)


def test_images_of_selected_cells():
    """The second cell takes its light and distance from the third one."""
    source, cells = np.array([[0, 2, 2]]), np.array([[True, True, False]])
    found = a_scene().image(source, cells).numpy()
    np.testing.assert_allclose(found, [[[0.5, 3 * 0.25, 0]], [[4 * 0.5, 6 * 0.25, 0]]])
    between = a_scene().image(np.array([[1, 1, 1]]), cells).numpy()
    np.testing.assert_allclose(between[0], [[2 * 0.375, 2 * 0.375, 0]])
    dark = a_scene().image(source, np.zeros((1, 3), bool)).numpy()
    np.testing.assert_array_equal(dark, np.zeros((2, 1, 3)))


def test_the_coverage_of_selected_cells():
    """Kernels of coverage have a sum of 1, so that a mask does not matter."""
    source, cells = np.array([[0, 2, 2]]), np.array([[True, False, True]])
    np.testing.assert_allclose(a_scene()._coverage(source, cells).numpy(), [[[1, 0, 1]]] * 2)
    layer = Layer(source, np.array([[True, True, False]]), np.array([[True, False, False]]))
    np.testing.assert_allclose(a_scene().passing(layer).numpy(), [[[0, 1, 1]]] * 2)


def layers_of(row):
    """Return level, cells, hiding cells and sources of the layers of a row of inverse distances."""
    found = list(visible_layers(np.array([row]), 1.0))
    return [tuple(np.flatnonzero(part[0]).tolist() for part in (layer.cells, layer.hiding)) for layer in found], [
        layer.source[0].tolist() for layer in found
    ]


def test_surfaces_that_continue_behind_another_one_have_no_edge_there():
    """Behind the plate, the surfaces at 0.4 and 1.2 meet. No edge between them is visible."""
    cells, sources = layers_of([0.0, 0.4, 10.0, 10.0, 1.2, 1.2])
    assert cells == [([2, 3], [2, 3]), ([3, 4, 5], []), ([0, 1, 2], [])]
    assert sources[1] == sources[2] == [0, 1, 1, 4, 4, 5]
    # The surface at 0.4 has a visible rim at 0.5, but this is no edge. Behind the plate, it meets a surface at 0.95.
    cells, _ = layers_of([0.0, 0.4, 0.5, 0.4, 10.0, 10.0, 0.95])
    assert cells == [([4, 5], [4, 5]), ([2, 5, 6], []), ([0, 1, 3, 4], [])]


def test_surfaces_with_a_visible_edge_have_it_behind_another_one_too():
    cells, sources = layers_of([0.0, 1.2, 10.0, 10.0, 1.2, 0.0])
    assert cells == [([2, 3], [2, 3]), ([1, 2, 3, 4], [1, 2, 3, 4]), ([0, 1, 2, 3, 4, 5], [])]
    assert sources == [[0, 1, 2, 3, 4, 5], [0, 1, 1, 4, 4, 5], [0, 0, 0, 5, 5, 5]]


def test_slopes_hide_nothing_of_themselves():
    """Steps of 0.4 are less than the least jump of 0.5."""
    cells, _ = layers_of([0.0, 0.4, 0.8, 1.2, 1.6])
    assert cells == [([4], []), ([3], []), ([2], []), ([0, 1], [])]
    assert layers_of([0.0, 0.5])[0] == [([1], [1]), ([0, 1], [])]


def test_own_types_and_their_weights():
    mosaic = np.array([[0, 1, 2], [2, 0, 1]])
    values = np.random.default_rng(0).random((3, 2, 3))
    found = photoreceptor.own_type(TYPES.Tensor(values), mosaic, TYPES).numpy()
    np.testing.assert_allclose(found, np.take_along_axis(values, mosaic[None], axis=0))


def test_noise_is_the_sum_of_both_kinds():
    clean = np.array([[[0.5, -0.2]], [[1.0, 2.0]]])
    for photons in (
        None,
        np.array([100.0, 400.0])[:, None, None],
        np.array([100.0, 400.0]),
        np.full(clean.shape, 50.0),
    ):
        rng, same = np.random.default_rng(1), np.random.default_rng(1)
        found = photoreceptor.noise_on(clean, photons, 0.25, rng)
        counted = clean
        if photons is not None:
            each = photons.reshape(-1, 1, 1) if photons.ndim == 1 else photons
            counted = same.poisson(np.maximum(clean, 0) * each) / each
        np.testing.assert_allclose(found, counted + 0.25 * same.standard_normal(clean.shape) - clean)


def test_limits_of_noise_and_throughput():
    rng = np.random.default_rng(0)
    assert photoreceptor.MOST_PHOTONS == 1e18
    photoreceptor.photon_noise(np.full(2, 1e3), 1e15, rng)
    photoreceptor.photon_noise(np.zeros(0), 1.0, rng)
    for sigma in (0.0, 1e6):
        photoreceptor.gaussian_noise(np.ones(2), sigma, rng)
    for call, name in (
        (lambda: photoreceptor.photon_noise(np.full(2, 1.001e3), 1e15, rng), "signal x photons"),
        (lambda: photoreceptor.photon_noise(np.ones((2, 1, 1)), np.array([1.0, 0.0]), rng), "photons"),
        (lambda: photoreceptor.photon_noise(np.array([1.0, -0.1]), 1.0, rng), "signal"),
        (lambda: photoreceptor.gaussian_noise(np.ones(2), 1.001e6, rng), "sigma"),
        (lambda: photoreceptor.throughput(-0.1), "relative_aperture"),
        (lambda: photoreceptor.throughput(1 + 2e-9), "relative_aperture"),
    ):
        with pytest.raises(ValueError, match=f"^{name} = "):
            call()
    assert photoreceptor.throughput(1 + 5e-10) == pytest.approx(1, abs=1e-15)
    assert (photoreceptor.throughput(0.0), photoreceptor.throughput(0.5, 0.25)) == (0, 0.0625)


def test_signals_of_weighted_parts():
    """Without blur, a signal is the sum over bands of a weight times the mean radiance on the receptor."""
    eye = Eye(None, (2, 3), bands=2, dtype="float64")
    rng = np.random.default_rng(0)
    light, other, weight = rng.random((2, 4, 6)), rng.random((2, 4, 6)), rng.random((2, 3))
    bank = eye.sight(2)
    found = signals(eye, [(light, 1.0), (other, weight)], bank, 2, math.inf).numpy()
    means = (part.reshape(2, 2, 2, 3, 2).mean(axis=(2, 4)) for part in (light, other))
    one, two = (np.einsum("cb,byx->cyx", eye.spectral_bands.weights, mean) for mean in means)
    np.testing.assert_allclose(found, one + weight * two)
    mosaic = Eye(
        None, (2, 3), bands=2, dtype="float64", receptors=optics.receptors_of("rgb").arranged(((0, 1), (1, 2)))
    )
    own = signals(mosaic, [(light, 1.0)], bank, 2, math.inf).numpy()
    np.testing.assert_allclose(own, np.take_along_axis(one, mosaic.mosaic[None], axis=0))
    noisy = with_noise(eye, TYPES.Tensor(one), np.random.default_rng(1)).numpy()
    np.testing.assert_allclose(noisy, one + 0.01 * np.random.default_rng(1).standard_normal(one.shape))
