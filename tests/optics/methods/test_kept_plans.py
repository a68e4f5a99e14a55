"""Plans keep what does not depend on the wavefront. A kept value must not serve another aperture, window or light."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from optics.elements import light_geometry
from optics.elements.beam import Beam
from optics.elements.light_stack import LightStack
from optics.methods import single_stack, window_geometry
from optics.methods.problem import Problem
from optics.methods.window_images import window_image_errors
from optics.methods.window_plan import WindowPlan
from optics.methods.window_sampling import window_sampling

WAVEFRONT = optics.Zernike({(3, 1): 0.08, (2, 0): 0.05, (4, -2): 0.03})
LENS = optics.Pupil(100e-6, wavefront=WAVEFRONT, thin_lens_focal_length=1.5e-3)
VIEW = {"wavelengths": [550e-9], "sensor_distance": 1.5e-3, "dx": 1e-6, "shape": (33, 33), "tolerance": 1e-2}
RELIEF = optics.BSplineRelief(4e-7 * np.random.default_rng(1).random((4, 4)))
CHANGES = {
    "as before": (LENS, {}),
    "radius": (replace(LENS, aperture_radius=99e-6), {}),
    "aperture": (replace(LENS, aperture=optics.Annulus(0.3)), {}),
    "other hole": (replace(LENS, aperture=optics.Annulus(0.31)), {}),
    "slit": (replace(LENS, aperture=optics.Slit(1.2, 1.2)), {}),
    "focal length": (replace(LENS, thin_lens_focal_length=1.49e-3), {}),
    "medium": (replace(LENS, medium_n=1.01), {}),
    "medium before": (replace(LENS, object_n=1.01), {"source_distance": 0.2}),
    "mask": (replace(LENS, mask=optics.GaussianMask(90e-6)), {}),
    "relief": (replace(LENS, height=RELIEF), {}),
    "index of the relief": (replace(LENS, height=RELIEF, n=1.51), {}),
    "map": (replace(LENS, height=1e-7 * np.random.default_rng(1).random((9, 9))), {}),
    "another wavefront": (replace(LENS, wavefront=optics.Zernike({(3, 1): 0.09, (2, 0): 0.05, (4, -2): 0.03})), {}),
    "other modes": (replace(LENS, wavefront=optics.Zernike({(3, 1): 0.08, (2, 2): 0.05, (4, -2): 0.03})), {}),
    "larger wavefront": (replace(LENS, wavefront=replace(WAVEFRONT, radius=101e-6)), {}),
    "wavelength": (LENS, {"wavelengths": [551e-9]}),
    "distance": (LENS, {"sensor_distance": 1.501e-3}),
    "source": (LENS, {"source_distance": 0.2}),
    "angle": (LENS, {"source_angle": (1e-3, 0.0)}),
    "pitch": (LENS, {"dx": 1.01e-6}),
    "shape": (LENS, {"shape": (33, 34)}),
    "centre": (LENS, {"centre": (1e-6, 0.0)}),
    "tolerance": (LENS, {"tolerance": 5e-3}),
    "dtype": (LENS, {"dtype": "float64"}),
    "field": (LENS, {"field": True}),
}


def found(name):
    """The PSF of a new pupil, since plans of the same pupil are kept as a whole."""
    pupil, changed = CHANGES[name]
    result = optics.psf(replace(pupil), **{**VIEW, **changed})
    assert result.for_window
    return result


def forget():
    for cached in (light_geometry._kept, window_geometry._kept, single_stack._small, single_stack._large):
        cached.cache_clear()


@pytest.fixture(scope="module")
def fresh():
    """Results of which each is computed without kept values."""
    results = {}
    for name in CHANGES:
        forget()
        results[name] = found(name)
    forget()
    return results


@pytest.mark.parametrize("order", [1, -1], ids=["forwards", "backwards"])
def test_kept_values_do_not_change_results(fresh, order):
    """Each change follows the unchanged PSF, and another change before."""
    for name in list(CHANGES)[::order]:
        for each in ("as before", name, name):
            again = found(each)
            np.testing.assert_array_equal(again.psf, fresh[each].psf, err_msg=each)
            assert again.plan == fresh[each].plan, each


def test_plans_of_one_window_are_kept():
    """A second wavefront of the same pupil and window is planned from the same geometry; a batch keeps nothing."""
    forget()
    found("as before")
    found("another wavefront")
    assert window_geometry._kept.cache_info()[:2] == (1, 1)
    optics.psf_batch([LENS, replace(LENS, aperture_radius=90e-6)], [550e-9], 1.5e-3, dx=1e-6, shape=(33, 33))
    assert window_geometry._kept.cache_info().currsize == 1


def test_few_windows_are_kept():
    most = window_geometry._kept.cache_info().maxsize
    for count in range(most + 3):
        optics.plan(LENS, 550e-9, 1.5e-3, dx=1e-6 + 1e-9 * count, shape=(33, 33), tolerance=1e-2)
    assert window_geometry._kept.cache_info().currsize == most


def test_the_check_keeps_its_sums_for_one_tolerance():
    """A smaller tolerance needs more interpolation points."""
    pupil, window = optics.Pupil(100e-6, thin_lens_focal_length=300e-6), optics.Grid((33, 33), 2e-6)
    stack = LightStack((Beam(pupil, optics.PointSource(), 550e-9, 300e-6),))
    plan, image = WindowPlan(stack, window, np.array([0.1])), np.ones((1, 33, 33), np.float32)
    errors = []
    for tolerances in ((0.1, 0.03), (0.03,)):
        _, finer = plan.samples(np.array([0]))
        errors.append([window_image_errors(stack, finer, image, window, each)[0] for each in tolerances][-1])
    assert errors[0] == errors[1]


def test_rays_are_kept_for_one_geometry():
    stack = LightStack((Beam(LENS, optics.PointSource(), 550e-9, 1.5e-3),))
    geometry, rows = window_geometry.window_geometry(stack, optics.Grid((33, 33), 1e-6)), []
    for numbers in ((0.1, 0.02), (0.1, 0.03), (0.2, 0.03), (0.1, 0.02)):
        factor = geometry.ray_factor(21, *map(np.array, zip(numbers)))
        rows.append((*factor.samples.steepest, *factor.samples.elsewhere))
    assert rows == [(0.1, 0.02), (0.1, 0.03), (0.2, 0.03), (0.1, 0.02)]


@pytest.mark.parametrize(("side", "kept"), [(362, 16), (363, 2)])
def test_few_stacks_of_many_samples_are_kept(side, kept):
    """A stack keeps arrays of all its samples."""
    forget()
    pupil = sampling_of(LENS).pupil
    stacks = [
        single_stack.single_stack(replace(pupil, grid=optics.Grid((side, side), 1e-4 + 1e-6 * i))) for i in range(16)
    ]
    again = single_stack.single_stack(replace(pupil, grid=optics.Grid((side, side), 1e-4)))
    assert (again is stacks[0]) == (kept == 16)
    counts = [cached.cache_info().currsize for cached in (single_stack._small, single_stack._large)]
    assert counts == ([kept, 0] if side == 362 else [0, kept])


def sampling_of(pupil):
    """Return the samples of a PSF of this pupil."""
    beam = Beam(pupil, optics.PointSource(), 550e-9, 1.5e-3)
    return window_sampling(Problem.from_beam(beam, optics.Grid((33, 33), 1e-6), 1e-2))
