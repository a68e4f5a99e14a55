"""Stored arrays are read-only, and writing into any array that optics returns changes no later result."""

from dataclasses import fields, is_dataclass
from importlib import import_module
from inspect import isclass

import numpy as np
import pytest

import optics
from optics.numerics.read_only import ReadOnlyArrays, read_only

# Each of these checks the samples that users pass in, copies them and makes the copy read-only.
CHECKED = {"BSplineRelief", "HeightMap", "MaskMap", "PixelRelief", "Polygon", "WavefrontMap"}
VIEW = {"shape": (33, 33), "tolerance": 1e-2}


def stored(thing, name="", seen=None):
    """Yield the name and value of every array that an object of optics stores, also in its parts."""
    seen = set() if seen is None else seen
    if id(thing) in seen:
        return
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        yield name, thing
    elif isinstance(thing, (list, tuple)):
        for index, part in enumerate(thing):
            yield from stored(part, f"{name}[{index}]", seen)
    elif type(thing).__module__.startswith("optics"):
        for key, part in getattr(thing, "__dict__", {}).items():
            if not key.startswith("_"):
                yield from stored(part, f"{name}.{key}", seen)


def pupil():
    return optics.Pupil(25e-6, thin_lens_focal_length=240e-6, wavefront=optics.Zernike({(3, 1): 0.05}))


def an_eye(lens=True):
    return optics.Eye(
        optics.Pupil(8e-6) if lens else None, resolution=(3, 4), fov_deg=20, sensor_width=20e-6, noise_sigma=0.0
    )


def a_wave():
    return np.random.default_rng(3).normal(size=(16, 17)) + 1j


RESULTS = {
    "psf": lambda: optics.psf(pupil(), [500e-9, 600e-9], field=True, **VIEW),
    "batch": lambda: optics.psf_batch([pupil()], [500e-9], **VIEW),
    "of a batch": lambda: optics.psf_batch([pupil()], [500e-9], **VIEW).result(0),
    "mtf": lambda: optics.mtf(optics.psf(pupil(), **VIEW), tolerance=0.2),
    "white": lambda: optics.white_psf(pupil(), waves=17, shape=(9, 9), tolerance=0.1),
    "vector": lambda: optics.vector_focus(pupil(), 500e-9, shape=(9, 9), tolerance=0.05),
    "propagate": lambda: optics.propagate(a_wave(), dx=1e-6, wavelength=500e-9, distance=1e-5, tolerance=0.1),
    "through": lambda: optics.propagate_through(
        [optics.FreeSpace(1e-5)], a_wave(), dx=1e-6, wavelength=500e-9, tolerance=0.1
    ),
    "eye": an_eye,
    "psf of an eye": lambda: an_eye().psf(),
    "psf of a perfect eye": lambda: an_eye(lens=False).psf(),
    "apposition eye": lambda: optics.AppositionEye(
        optics.Ommatidium(optics.FacetLens(12e-6, 14e-6), optics.Waveguide(2e-6)), 2, 1.5
    ),
    "outline": lambda: optics.union(optics.Disk(0.3), optics.Disk(0.3, (0.5, 0.1))).outline,
}


@pytest.mark.parametrize("name", RESULTS)
def test_stored_arrays_are_read_only(name):
    result = RESULTS[name]()
    for attribute in ("psf", "field", "mtf", "directions", "turning", "tangent"):
        getattr(result, attribute, None)  # computed and stored at the first access
    found = dict(stored(result))
    assert found
    assert {place for place, array in found.items() if array.flags.writeable} == set()


def test_every_result_class_locks_its_arrays():
    """New classes with arrays in their fields cannot be forgotten."""
    classes = [getattr(import_module(f"optics.{home}"), name) for name, home in optics._CONTENTS.items()]
    with_arrays = {
        kind.__name__: kind
        for kind in classes
        if isclass(kind) and is_dataclass(kind) and any("np.ndarray" in str(field.type) for field in fields(kind))
    }
    assert {name for name, kind in with_arrays.items() if not issubclass(kind, ReadOnlyArrays)} == CHECKED
    assert len(with_arrays) > len(CHECKED) + 5
    samples = np.zeros((4, 4))
    for name in CHECKED - {"Polygon"}:
        assert not any(array.flags.writeable for _, array in stored(with_arrays[name](samples)))
        assert samples.flags.writeable


def test_normalising_the_image_of_a_psf_leaves_its_measures():
    result = optics.psf(pupil(), **VIEW)
    before = optics.encircled_energy(result, 3e-6)
    image = result.psf
    with pytest.raises(ValueError, match="read-only"):
        image /= image.max()
    copied = result.psf.copy()
    copied /= copied.max()
    np.testing.assert_array_equal(optics.encircled_energy(result, 3e-6), before)


def test_the_users_own_array_stays_writable():
    given = np.random.default_rng(5).random((1, 9, 9))
    result = optics.PSFResult(given, 1e-6, np.array([500e-9]), 240e-6, pupil(), ())
    assert not result.psf.flags.writeable
    assert given.flags.writeable
    assert not read_only(given).flags.writeable


def returned(result, eye, rng):
    """Compute everything that functions return from a PSF and an eye, as a list of arrays."""
    cells = np.random.default_rng(1).random((eye.bands, 6, 8))
    transfer = optics.mtf(result, tolerance=0.2)
    found = [
        *(result.x, result.y, result.power, result.power_error, result.cutoff, result.window_sums, result.sum_error),
        *optics.strehl_ratio(result, with_error=True),
        *optics.encircled_energy(result, [1e-6, 2e-6], with_error=True),
        *optics.image_quality(result, 1e5, tolerance=0.2, with_error=True),
        transfer.profile([0.0, 1e5]),
        *(eye.kernel(2), eye.see(cells, 2), eye.psf().psf, eye.psf().wavelengths, eye.psf().power),
        eye.in_bands(optics.illuminant("A")),
        *stored_of(eye),
    ]
    kept = [np.array(array) for array in found]
    for array in found:
        if array.flags.writeable:
            array[...] = rng.normal(size=array.shape) * 1e3
    return kept


def stored_of(eye):
    return [array for _, array in stored(eye)]


@pytest.mark.parametrize("lens", [True, False])
def test_writing_into_what_functions_return_changes_nothing_later(lens):
    rng = np.random.default_rng(2)
    result, eye = optics.psf(pupil(), [500e-9, 600e-9], **VIEW), an_eye(lens)
    first = returned(result, eye, rng)
    for before, after in zip(first, returned(result, eye, rng), strict=True):
        np.testing.assert_array_equal(before, after)
