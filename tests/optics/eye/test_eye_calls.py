"""Arguments that eyes pass on, and kernels of receptors, from given numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics import AccuracyError, Eye, Pupil
from optics.eye import eye as module
from optics.eye import receptor_kernel as kernels_of
from optics.eye.guided_field import Guide
from optics.eye.kernel_bank import KernelBank
from optics.eye.kernel_interpolation import NodeError
from optics.eye.receptor_lattice import ReceptorLattice
from optics.numerics.precision import precision

TENSOR = precision("float64").Tensor
# A focal length of 1e-4, and receptors 3e-5 high and 2e-5 wide.
FIELD = {"resolution": (4, 10), "fov_deg": 90.0, "sensor_width": 2e-4, "bands": 2}
TALL = {"vertical_fov_deg": 2 * math.degrees(math.atan(0.6))}
HALVES = ReceptorLattice(np.array([-2.0, -1.4, 0, 1, 2]), np.tile(np.arange(11.0) - 5, (4, 1)))
LENS = Pupil(2e-5, thin_lens_focal_length=1e-4)


def prepared(monkeypatch, eye, samples, *given, **named):
    """Return the arguments with which an eye prepares kernels, those of its kernel at a place, and the bank."""
    found = SimpleNamespace(kernels=[])
    bank = KernelBank((0.0,), (1.0, 1.0), {(0, 0, 0): np.zeros((2, 1, 1))}, ())

    def prepare(kernel_at, resolution, s, z, counts, within, **others):
        vars(found).update(resolution=resolution, s=s, z=z, counts=counts, within=within, **others)
        found.kernel = kernel_at(7.0, 0.5, -0.25)
        return bank

    monkeypatch.setattr(module, "prepare", prepare)
    monkeypatch.setattr(
        module, "receptor_kernel", lambda *args: found.kernels.append(args) or TENSOR(np.ones((2, 4, 3)))
    )
    found.bank = eye.sight(samples, *given, **named)
    return found


def test_kernels_for_a_sight(monkeypatch):
    eye = Eye(LENS, **FIELD, **TALL, eccentricity_deg=(20.0, -10.0), tolerance=3e-2)
    found = prepared(monkeypatch, eye, 3, [1.0, 2.0], 5, 7)
    assert (found.resolution, found.s, found.z, found.counts, found.within) == ((4, 10), 3, [1.0, 2.0], (5, 7), 3e-2)
    assert found.kernel.shape == (2, 5, 3)
    [(own, retina, z, place, from_cell)] = found.kernels
    assert (own, z, from_cell, retina.samples) == (eye, 7.0, True, 3)
    aside, below = math.tan(math.radians(20)), math.tan(math.radians(10))
    assert place == pytest.approx((aside + 0.5 * 1.0, below - 0.25 * 0.6))
    assert found.mean == 3
    assert found.white() == pytest.approx(1.0)
    assert (found.bank.averaged, found.bank.parallax) == (True, pytest.approx(3 * eye.parallax))


def test_defaults_of_a_sight(monkeypatch):
    found = prepared(monkeypatch, Eye(**FIELD), 4)
    assert (found.z, found.counts, found.within) == (math.inf, ("auto", 1), 1e-2)
    assert found.kernels[0][-1] is True
    centres = prepared(monkeypatch, Eye(**FIELD), 4, light_from="centres", tolerance=0.5)
    assert (centres.kernels[0][-1], centres.within) == (False, 0.5)
    for wrong in ({"light_from": "edges"}, {"tolerance": 0.51}, {"tolerance": 0.9e-6}):
        with pytest.raises(ValueError, match=f"^{next(iter(wrong))} = "):
            prepared(monkeypatch, Eye(**FIELD), 4, **wrong)
    for wrong in (0, 65):
        with pytest.raises(ValueError, match=r"^samples_per_receptor = "):
            prepared(monkeypatch, Eye(**FIELD), wrong)


@pytest.mark.parametrize(
    ("others", "samples", "mean"),
    [
        ({"density": HALVES}, 10, 6),  # the lowest receptor has 0.6 of the average height
        ({"density": HALVES}, 3, 1),
        ({"density": HALVES}, 1, 1),
        ({"pupil": LENS, "waveguide": optics.Waveguide(2e-6)}, 10, 1),
    ],
)
def test_errors_are_averaged_over_the_smallest_receptor(monkeypatch, others, samples, mean):
    eye = Eye(**FIELD, **TALL, **others)
    found = prepared(monkeypatch, eye, samples)
    assert found.mean == mean
    assert found.bank.averaged == ("waveguide" not in others)


def test_white_behind_a_mask_and_with_waveguides(monkeypatch):
    mask = optics.MaskMap(np.full((4, 4), 0.5))
    dim = Eye(Pupil(5e-5, mask=mask), **FIELD)
    assert prepared(monkeypatch, dim, 2).white() == pytest.approx(0.25, rel=1e-3)
    assert dim.white_signal == pytest.approx(0.25 * 0.25, rel=1e-3)
    guided = Eye(LENS, **FIELD, waveguide=optics.Waveguide(2e-6))
    monkeypatch.setattr(module, "white_share", lambda kernel, bands: kernel.sum() / 60)
    found = prepared(monkeypatch, guided, 2)
    assert found.white() == pytest.approx(0.4)
    assert guided.white_signal == pytest.approx(0.4 * 0.2**2)
    assert found.kernels[-1][1].samples == 1
    assert guided.throughput == pytest.approx(0.2**2)


def test_the_retina_of_a_kernel(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "receptor_kernel", lambda *args: asked.append(args) or TENSOR(np.ones((2, 1, 1))))
    eye = Eye(LENS, **FIELD, **TALL, eccentricity_deg=(20.0, -10.0), pupil_turned=True, most_seconds=9.0)
    eye.kernel(4)
    eye.kernel(64, 2.0, (0.0, 45.0))
    (_, retina, z, place, from_cell), (_, _, near, up, _) = asked
    assert (z, from_cell, near) == (math.inf, False, 2.0)
    assert place == pytest.approx((math.tan(math.radians(20)), math.tan(math.radians(10))))
    assert up == pytest.approx((0.0, -1.0))
    assert retina.distance == pytest.approx(1e-4)
    assert retina.cell == pytest.approx((7.5e-6, 5e-6))
    assert retina.size == pytest.approx((1.2e-4, 2e-4))
    assert (retina.samples, retina.pupil_turned, retina.most_seconds) == (4, True, 9.0)
    assert (retina.tolerance, retina.dtype, len(retina.wavelengths)) == (1e-2, "float32", 2)
    Eye(LENS, **FIELD, waveguide=optics.Waveguide(2e-6)).kernel(1)
    assert asked[-1][-1] is True
    for wrong in (0, 65):
        with pytest.raises(ValueError, match=r"^samples_per_receptor = "):
            eye.kernel(wrong)
    with pytest.raises(ValueError, match=r"^direction_deg = "):
        eye.kernel(4, direction_deg=(81.0, 0.0))


def test_psfs_of_eyes(monkeypatch):
    asked = []
    monkeypatch.setattr(module, "retinal_psf", lambda *args: asked.append(args) or "psf")
    eye = Eye(LENS, **FIELD, eccentricity_deg=(0.0, 45.0))
    assert eye.psf(2.0) == "psf"
    [(pupil, retina, z, place)] = asked
    assert (pupil, retina.samples, z, place) == (LENS, 4, 2.0, pytest.approx((0.0, -1.0)))
    perfect = Eye(**FIELD).psf()
    assert perfect.psf.shape == (2, 1, 1)
    assert (perfect.dx, perfect.pupil.radius) == (pytest.approx(2e-5), pytest.approx(1e-4))
    for call in (eye.psf, lambda z: eye.kernel(2, z)):
        with pytest.raises(ValueError, match=r"^z = 0"):
            call(0)


def test_scenes_that_need_too_many_kernels(monkeypatch):
    def refuses(self, *given):
        assert given == (2, [1.0, 9.0], "auto")
        raise NodeError("too many")

    monkeypatch.setattr(Eye, "sight", refuses)
    with pytest.raises(AccuracyError, match=r"^z from 1 to 9 m needs .* at the eye's tolerance of 0\.01: .* 17 diff"):
        Eye(**FIELD)._sight_for(2, [1.0, 9.0], "auto")


def test_bands_are_chosen_for_the_smallest_receptors(monkeypatch):
    asked = []

    def bands_for(eye, retina, direction):
        asked.append((retina, direction))
        return optics.SpectralBands.uniform(3)

    monkeypatch.setattr(module, "bands_for", bands_for)
    eye = Eye(**(FIELD | {"bands": "auto"}), **TALL, density=HALVES, eccentricity_deg=(0.0, -45.0))
    assert eye.bands == 3
    [(retina, direction)] = asked
    assert retina.cell == pytest.approx((0.6 * 3e-5 / 2, 1e-5))
    assert (retina.samples, retina.wavelengths.size) == (2, 0)
    assert direction == pytest.approx((0.0, 1.0))


@pytest.mark.parametrize("guided", [False, True])
def test_kernels_for_the_choice_of_bands(monkeypatch, guided):
    """Kernels of squares are averaged over the receptor, and white is dimmed by the mask alone."""
    asked = []
    monkeypatch.setattr(kernels_of, "receptor_kernel", lambda *args: asked.append(args) or np.ones((2, 3, 3)))
    monkeypatch.setattr(kernels_of, "choose_bands", lambda *args: asked.append(args) or "bands")
    retina = Eye(LENS, **FIELD)._retina(2)
    eye = SimpleNamespace(
        tolerance=0.1,
        receptors="rgb",
        pupil=SimpleNamespace(transmission=0.25),
        waveguide=optics.Waveguide(2e-6) if guided else None,
    )
    assert kernels_of.bands_for(eye, retina, (0.1, 0.2)) == "bands"
    [(tolerance, receptors, kernels, *others)] = asked
    assert (tolerance, receptors, others) == (0.1, "rgb", [] if guided else [2, 0.25])
    assert kernels(np.array([4e-7])).shape == (2, 3, 3)
    own, on, z, direction, from_cell = asked[-1]
    assert (own, on.wavelengths.tolist(), z, direction, from_cell) == (eye, [4e-7], math.inf, (0.1, 0.2), guided)
    eye.pupil = None
    assert kernels_of.bands_for(eye, retina, (0.1, 0.2)) == "bands"
    assert asked[-1] == (0.1, "rgb")


def test_kernels_of_each_kind_of_receptor(monkeypatch):
    calls = []
    monkeypatch.setattr(kernels_of, "visual_kernel", lambda *args: calls.append(args) or "square")
    monkeypatch.setattr(kernels_of, "guided_kernel", lambda *args: calls.append(args) or "guided")
    perfect, square = Eye(**FIELD), Eye(LENS, **FIELD)
    guided = Eye(LENS, **FIELD, **TALL, waveguide=optics.Waveguide(2e-6))
    retina = guided._retina(5)
    one = kernels_of.receptor_kernel(perfect, retina, 2.0, (0.1, 0.2), True).numpy()
    np.testing.assert_array_equal(one, np.ones((2, 1, 1)))
    assert kernels_of.receptor_kernel(square, retina, 2.0, (0.1, 0.2), True) == "square"
    assert kernels_of.receptor_kernel(guided, retina, 2.0, (0.1, 0.2), False) == "guided"
    assert calls[0] == (LENS, retina, 2.0, (0.1, 0.2), True)
    *given, guide = calls[1]
    assert given == [LENS, retina, 2.0, (0.1, 0.2)]
    assert guide == Guide(guided.waveguide, pytest.approx(1e-4), 5, False)


def test_the_share_of_white_that_kernels_transmit():
    wavelengths = np.array([450e-9, 650e-9])
    bands = SimpleNamespace(weights=np.array([[1.0, 0.5], [0.2, 3.0]]), wavelengths=wavelengths)
    kernels = np.stack([np.full((2, 3), 0.1), np.full((2, 3), 0.05)])
    light = kernels_of.daylight(wavelengths) * [0.6, 0.3]
    expected = (1.2 * light[0] + 3.5 * light[1]) / 2
    assert kernels_of.white_share(kernels, bands) == pytest.approx(expected)


@pytest.mark.parametrize("dense", [False, True])
@pytest.mark.parametrize("direction", [None, (3.0, 4.0)])
def test_tables_of_eyes(monkeypatch, dense, direction):
    """The table is that of a single receptor if receptors differ, or if a direction is given."""
    asked = []
    calls = SimpleNamespace(white_signal=0.5, psf=lambda z: ("psf", z), kernel=lambda cells, z: ("kernel", cells, z))
    eye = Eye(**FIELD, **TALL, density=HALVES if dense else None)

    def described(own, light, result, kernel):
        asked.append((own, light, result, kernel(4)))
        return SimpleNamespace()

    monkeypatch.setattr(module, "receptor_in", lambda own, toward: calls if (own, toward) == (eye, direction) else None)
    monkeypatch.setattr(module, "describe", described)
    monkeypatch.setattr(module, "spacing_range", lambda own: "range")
    monkeypatch.setattr(module, "replace", lambda found, **given: given)
    monkeypatch.setattr(Eye, "psf", lambda self, z: calls.psf(z))
    monkeypatch.setattr(Eye, "kernel", lambda self, cells, z: calls.kernel(cells, z))
    found = eye.describe(2.0, direction)
    own = eye if not dense and direction is None else calls
    assert asked == [(own, 1.0 if own is eye else 0.5, ("psf", 2.0), ("kernel", 4, 2.0))]
    assert (found == {"interommatidial_range_deg": "range"}) == dense
