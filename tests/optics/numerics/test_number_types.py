"""Half precision is refused and lazy bits of PyTorch are readable wherever arrays enter `optics`."""

import functools

import drjit as dr
import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics.numerics import number_types

VIEW = {"sensor_distance": 240e-6, "dx": 1e-6, "shape": (9, 9)}
TRIANGLE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.0, 0.5]])


def lens(**parts):
    return optics.Pupil(30e-6, thin_lens_focal_length=240e-6, **parts)


def psf(wavelengths=550e-9, pupil=None, **changes):
    return optics.psf(pupil or lens(), wavelengths, **(VIEW | changes)).psf


@functools.cache
def light():
    return optics.psf(lens(), 550e-9, **(VIEW | {"shape": (33, 33)}))


@functools.cache
def eye():
    return optics.Eye(resolution=(3, 3), microvilli=optics.Microvilli(0.0))


def see(radiance=None, **more):
    return eye().see(np.ones((eye().bands, 24, 24)) if radiance is None else radiance, 8, **more)


@functools.cache
def ommatidium():
    return optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6))


def of_type(sample, array):
    """Return ones for these wavelengths, times the first number of `array`, in the library and type of `array`."""
    return array[0] * (
        torch.ones(len(sample), dtype=array.dtype) if torch.is_tensor(array) else np.ones(len(sample), array.dtype)
    )


def cases(rng):
    """Return a valid array and a function of it for each entry point, by name."""
    heights, row, places = rng.random((8, 8)) * 1e-7, 0.01 * rng.random(10), 0.5 * rng.random(4)
    waves, plane = np.array([500e-9, 550e-9]), rng.random((8, 8)) + 1j * rng.random((8, 8))
    shapes = {
        "Circle": optics.Circle(),
        "Annulus": optics.Annulus(0.3),
        "Rings": optics.Rings([0.25, 0.5]),
        "Disk": optics.Disk(0.5),
        "Oblong": optics.Oblong(0.5, 0.4),
        "Polygon": optics.Polygon(TRIANGLE),
        "Slit": optics.Slit(0.5, 0.4),
        "Spider": optics.Spider(3, 0.1),
        "union": optics.union(optics.Disk(0.5), optics.Oblong(0.5, 0.9)),
        "Bitmap": optics.Bitmap(np.ones((4, 4))),
    }
    contains = {f"{name}.contains": (places, lambda a, s=shape: s.contains(a, a)) for name, shape in shapes.items()}
    return contains | {
        "Pupil.height": (heights, lambda a: psf(pupil=lens(height=a))),
        "HeightMap": (heights, lambda a: psf(pupil=lens(height=optics.HeightMap(a)))),
        "PixelRelief": (heights, lambda a: psf(pupil=lens(height=optics.PixelRelief(a)))),
        "BSplineRelief": (heights[:4, :4], lambda a: psf(pupil=lens(height=optics.BSplineRelief(a)))),
        "WavefrontMap": (heights, lambda a: psf(pupil=lens(wavefront=optics.WavefrontMap(a)))),
        "MaskMap": (rng.random() + 0 * heights, lambda a: psf(pupil=lens(mask=optics.MaskMap(a)))),
        "phase_pupil": (rng.random((8, 8)), lambda a: psf(pupil=optics.phase_pupil(30e-6, a))),
        "Zernike": (row, lambda a: list(optics.Zernike(a).modes.values())),
        "Zernike of modes": (row[0], lambda a: psf(pupil=lens(wavefront=optics.Zernike({(2, 0): a})))),
        "Zernike.from_noll": (row, lambda a: list(optics.Zernike.from_noll(a).modes.values())),
        "Zernike.from_fringe": (row, lambda a: list(optics.Zernike.from_fringe(a).modes.values())),
        "Zernike.at": (places, lambda a: optics.Zernike({(2, 0): 0.1}).at(a, a)),
        "Polygon": (TRIANGLE * rng.uniform(0.5, 1), lambda a: optics.Polygon(a).vertices),
        "Rings": (np.array([0.25, rng.uniform(0.3, 1)]), lambda a: optics.Rings(a).radii),
        "Bitmap": (np.ones((4, 4)), lambda a: optics.Bitmap(a).image),
        "wavelengths": (waves, psf),
        "wavelength": (waves[0], psf),
        "sensor_distance": (np.array(240e-6), lambda a: psf(sensor_distance=a)),
        "radius": (np.array(30e-6), lambda a: psf(pupil=optics.Pupil(a))),
        "centre": (np.array([0.0, 1e-6]), lambda a: psf(centre=a)),
        "source": (np.array([0.0, 0.01]), lambda a: psf(source_angle=a)),
        "psf_batch": (waves, lambda a: optics.psf_batch([lens()], a, **VIEW).psf),
        "through_focus": (np.array([230e-6, 250e-6]), lambda a: through_focus(a)),
        "mtf": (np.array([0.98]), lambda a: optics.mtf(light(), a).mtf),
        "encircled_energy": (np.array([1e-6, 2e-6]), lambda a: optics.encircled_energy(light(), a)),
        "encircled_energy's centre": (np.array([0, 1e-6]), lambda a: optics.encircled_energy(light(), [1e-6], a)),
        "polarization": (np.array([1, 0.5, 0.2, 0]), lambda a: polarised(a)),
        "Jones vector": (np.array([1.0, 0.5j]), lambda a: polarised(a)),
        "white_psf": (places, lambda a: optics.white_psf(lens(), lambda nm: of_type(nm, a), **VIEW).psf),
        "Spectrum of values": (places, lambda a: optics.Spectrum((300.0, 400, 500, 600), a).values),
        "Spectrum of nm": (400 + 100 * np.sort(places), lambda a: optics.Spectrum(a, (1.0,) * 4).wavelengths_nm),
        "Spectrum.at": (waves, lambda a: optics.Spectrum((300.0, 800.0), (0.1, 1.0)).at(a)),
        "mean_human_mtf": (10 * places, lambda a: optics.mean_human_mtf(a, 3e-3)),
        "propagate": (plane, lambda a: propagated(a)),
        "propagate a real field": (plane.real, lambda a: propagated(a)),
        "propagate_through": (plane, lambda a: stacked(a)),
        "Eye.see": (rng.random((4, 24, 24)), see),
        "z": (np.array(rng.random()), lambda a: see(z=a)),
        "z of cells": (0.5 + rng.random((24, 24)), lambda a: see(z=a)),
        "degree": (rng.random((24, 24)), lambda a: see(polarization=(a, 30.0))),
        "Eye.sight": (np.array([0.5, 1.0]), lambda a: next(iter(eye().sight(8, a, tolerance=0.1).kernels.values()))),
        "Eye.in_bands": (places, lambda a: eye().in_bands(lambda wave: of_type(wave, a))),
        "fov_deg": (np.array(40.0), lambda a: [optics.Eye(resolution=(3, 3), fov_deg=a).sensor_distance]),
        "Mode.field": (1e-7 * places, lambda a: optics.Waveguide(2e-6).modes(550e-9)[0].field(a, a)),
        "Ommatidium": (places / 100, lambda a: ommatidium().sensitivity(a, a, 550e-9)),
        "AppositionEye.see": (places, lambda a: apposition(a)),
    }


def through_focus(distances):
    view = {name: value for name, value in VIEW.items() if name != "sensor_distance"}
    return [r.psf for r in optics.through_focus(lens(), distances, wavelengths=550e-9, **view).results]


def polarised(polarization):
    return optics.vector_focus(lens(), 550e-9, polarization=polarization, **VIEW).psf


def propagated(u):
    return optics.propagate(u, dx=1e-6, wavelength=550e-9, distance=1e-4).u


def stacked(u):
    return optics.propagate_through([optics.FreeSpace(1e-4)], u, wavelength=550e-9, dx=1e-6).u


def apposition(array):
    found = optics.AppositionEye(ommatidium(), 1, 5.0)
    return found.see(lambda x, y: of_type(x.ravel(), array).reshape(x.shape))


HALF = r"must be float32 or float64, not (float16|bfloat16|complex32), whose steps"
CALLED = "white_psf", "Eye.in_bands", "AppositionEye.see"  # with functions, which cannot return a list
SLOW = "AppositionEye.see"  # takes 5 s
NAMES = list(cases(np.random.default_rng(0)))


def lazy(array):
    """Return a tensor of these numbers that PyTorch has yet to conjugate or negate."""
    if np.iscomplexobj(array):
        return torch.tensor(array.conj()).conj()
    tensor = torch.complex(torch.zeros(np.shape(array), dtype=torch.float64), torch.tensor(-array))
    return tensor.conj().imag


def half(array):
    """Return the numbers in several types of half precision."""
    tensor = torch.tensor(array)
    if np.iscomplexobj(array):
        return [tensor.to(torch.complex32)]
    coarse = np.float16(array)
    found = [coarse, tensor.half(), tensor.bfloat16()]
    return found if coarse.ndim == 0 else [*found, list(coarse)]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n == SLOW else ()) for n in NAMES])
def test_lazy_tensors_and_half_precision(name):
    array, compute = cases(np.random.default_rng(5))[name]
    expected = np.asarray(compute(array))
    tensor = lazy(array)
    assert tensor.is_conj() or tensor.is_neg()
    for value in [tensor, list(tensor)] if tensor.ndim == 1 and name not in CALLED else [tensor]:
        np.testing.assert_allclose(np.asarray(compute(value)), expected, rtol=1e-6)
    for value in half(array)[: 3 if name in CALLED else 4]:
        with pytest.raises(ValueError, match=HALF):
            compute(value)


@pytest.mark.parametrize("name", ["heights", "radius", "n"])
def test_the_torch_interface(name):
    given = {
        "heights": torch.rand(8, 8, dtype=torch.float64) * 1e-7,
        "radius": torch.tensor(30e-6),
        "n": torch.tensor(1.5),
    }
    view = VIEW | {"wavelengths": 550e-9}
    expected = optics.torch.psf(**given, **view)
    tensor = lazy(given[name].double().numpy())
    torch.testing.assert_close(optics.torch.psf(**(given | {name: tensor}), **view), expected)
    for value in half(given[name].numpy())[1:3]:
        with pytest.raises(ValueError, match=f"{name}: must be float32 or float64"):
            optics.torch.psf(**(given | {name: value}), **view)


@pytest.mark.parametrize("make", ["HeightMap", "PixelRelief", "WavefrontMap", "MaskMap", "Zernike"])
def test_half_precision_of_drjit(make):
    from drjit.llvm.ad import Float16, TensorXf16

    values = Float16([0.1] * 4) if make == "Zernike" else TensorXf16(dr.full(Float16, 1e-3, 16), (4, 4))
    with pytest.raises(ValueError, match=r"must be float32 or float64, not (Float16|TensorXf16)"):
        getattr(optics, make)(values)


@pytest.mark.parametrize("value", [np.float16(30e-6), torch.tensor(30e-6).half(), torch.tensor(30e-6).bfloat16()])
def test_half_precision_of_a_number(value):
    with pytest.raises(ValueError, match="aperture_radius: must be float32 or float64"):
        optics.Pupil(value)


def test_other_containers_of_half_precision():
    for values in (memoryview(np.ones((4, 4), np.float16)), [[1.0, np.float16(1)], [1.0, 1.0]]):
        with pytest.raises(ValueError, match="must be float32 or float64, not float16"):
            optics.HeightMap(values)


def test_nothing_else_is_changed():
    """Values without lazy bits are returned as they are, and usual types are accepted."""
    for value in (1.0, "text", [1, [2.0, "x"]], (1, 2), None, torch.ones(2), np.ones(2), {"a": 1}):
        assert number_types.readable("x", value) is value
        assert number_types.full_precision("x", value) is value
    for dtype in (np.float32, np.float64, np.longdouble, np.int8, np.uint64, bool):
        assert optics.HeightMap(np.zeros((4, 4), dtype)).span == 0
