"""The bridge to PyTorch: gradients equal central differences for every input, and a design converges."""

import math
import pydoc
import warnings

import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics import BSplineRelief, HeightMap, PixelRelief, Pupil
from optics.elements.relief import Relief
from optics.numerics import renamed

R, UM = 15e-6, 1e-6
VIEW = {"sensor_distance": 150e-6, "dx": 1e-6, "shape": (21, 17)}
SMALL = {"dx": 1e-6, "shape": (9, 8), "dtype": "float64", "tolerance": 1e-5}
RNG = np.random.default_rng(0)
WIDE, SQUARE = RNG.random((4, 7)), RNG.random((5, 5))
LENS = {"aperture_radius": R, "thin_lens_focal_length": 150e-6}


CHECK = {"rtol": 1e-3, "atol": 1e-6, "nondet_tol": 1e-9, "fast_mode": True}  # parallel sums differ by rounding


def asking(value, **options):
    return torch.tensor(value, **{"dtype": torch.float64, "requires_grad": True, **options})


def lens(**parts):
    return Pupil(**{**LENS, **parts})


# Every input that may require a gradient -> its value near 1, and the arguments of `psf` made of it.
INPUTS = {
    "control points": (SQUARE[:4, :4], lambda v: {"pupil": lens(height=BSplineRelief(v * UM))}),
    "wide samples": (WIDE, lambda v: {"pupil": lens(height=HeightMap(v * UM))}),
    "an array of 4 x 4 samples": (SQUARE[:4, :4], lambda v: {"pupil": lens(height=v * UM)}),
    "pixels": (SQUARE, lambda v: {"pupil": lens(height=PixelRelief(v * UM))}),
    "index": (1.5, lambda v: {"pupil": lens(height=WIDE * UM, n=v)}),
    "radius": (15.0, lambda v: {"pupil": lens(aperture_radius=v * UM)}),
    "focal length": (150.0, lambda v: {"pupil": lens(thin_lens_focal_length=v * UM)}),
    "vector of Zernike": (0.1 * RNG.random(6), lambda v: {"pupil": lens(wavefront=optics.Zernike(v))}),
    "mode of Zernike": (0.1, lambda v: {"pupil": lens(wavefront=optics.Zernike({(2, 0): v, (3, 1): 0.05}))}),
    "Noll's numbers": (0.1 * RNG.random(4), lambda v: {"pupil": lens(wavefront=optics.Zernike.from_noll(v))}),
    "wavefront map": (WIDE, lambda v: {"pupil": lens(wavefront=optics.WavefrontMap(v * UM, 16e-6))}),
    "mask": (0.5 + 0.05 * WIDE, lambda v: {"pupil": lens(mask=optics.MaskMap(v))}),
    "waist": (10.0, lambda v: {"pupil": lens(mask=optics.GaussianMask(v * UM))}),
    "phase": (SQUARE, lambda v: {"pupil": optics.phase_pupil(R, v, thin_lens_focal_length=150e-6)}),
    "sensor distance": (150.0, lambda v: {"sensor_distance": v * UM}),
    "row of sensor distances": ([140.0, 160.0], lambda v: {"sensor_distance": v * UM}),
    "source distance": (3.0, lambda v: {"source_distance": v * 1e-3}),
    "angle": ([0.01, -0.02], lambda v: {"source_angle": v}),
    "angle of light along the axis": ([0.0, 0.0], lambda v: {"source_angle": v}),
}
# These cover an array, a scalar, a mask, a distance and an angle; all others run in the slow part.
FAST = {
    "control points",
    "pixels",
    "mode of Zernike",
    "waist",
    "row of sensor distances",
    "angle of light along the axis",
}


def spread(name, value, **options):
    given = {"pupil": lens(), "sensor_distance": 160e-6, **INPUTS[name][1](value)}
    return optics.torch.psf(given.pop("pupil"), 550e-9, **given, **SMALL, **options)


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in FAST else pytest.mark.slow) for n in INPUTS])
def test_gradients_of_every_input(name):
    """The reference is a difference of PSFs without derivatives, which may be computed by another method. The tolerance
    is therefore small.
    """
    value = asking(INPUTS[name][0])
    step = 1e-5 * max(1.0, float(value.detach().abs().max()))
    assert torch.autograd.gradcheck(lambda v: spread(name, v) * 1e-9, (value,), eps=step, **CHECK)


@pytest.mark.slow
def test_gradients_through_means_over_pixels():
    value = asking(WIDE)
    assert torch.autograd.gradcheck(
        lambda v: spread("wide samples", v, pixel_means=True) * 1e-9,
        (value,),
        eps=1e-5,
        **CHECK,
    )


@pytest.mark.parametrize("relief", [BSplineRelief, HeightMap, PixelRelief])
def test_values_are_those_of_psf(relief):
    points = RNG.random((4, 4)) * 2e-6
    here = optics.torch.psf(Pupil(R, relief(asking(points))), [500e-9, 600e-9], **VIEW)
    there = optics.psf(Pupil(R, relief(points)), [500e-9, 600e-9], **VIEW)
    assert (here.shape, here.dtype) == ((2, 21, 17), torch.float32)
    assert np.linalg.norm(here.detach().numpy() - there.psf) < 1e-3 * np.linalg.norm(there.psf)
    plain = optics.torch.psf(Pupil(R, relief(points)), [500e-9, 600e-9], **VIEW)
    assert np.linalg.norm(plain.numpy() - there.psf) < 1e-3 * np.linalg.norm(there.psf)
    tight = [call(Pupil(R, relief(points)), 5e-7, **VIEW, tolerance=1e-5) for call in (optics.torch.psf, optics.psf)]
    np.testing.assert_array_equal(tight[0].numpy(), tight[1].psf)


def test_axes_of_pupils_distances_and_wavelengths():
    heights, distances = asking(RNG.random((2, 4, 4)) * 1e-6), asking([140e-6, 150e-6, 160e-6])
    view = SMALL | {"tolerance": 1e-3}
    pupils = [lens(height=BSplineRelief(each)) for each in heights]
    waves, sources = [500e-9, 600e-9], [2e-3, 3e-3, math.inf]
    found = optics.torch.psf(pupils, waves, distances, sources, **view)
    alone = [
        [optics.torch.psf(p, waves, z, s, **view) for z, s in zip(distances, sources, strict=True)] for p in pupils
    ]
    torch.testing.assert_close(found, torch.stack([torch.stack(row) for row in alone]), rtol=1e-12, atol=0)
    both = [torch.autograd.grad((found**2).sum(), part, retain_graph=True)[0] for part in (heights, distances)]
    squares = sum((each**2).sum() for row in alone for each in row)
    for part, grad in zip((heights, distances), both, strict=True):
        other = torch.autograd.grad(squares, part, retain_graph=True)[0]
        torch.testing.assert_close(grad, other, rtol=1e-9, atol=1e-9 * float(other.abs().max()))
    assert optics.torch.psf(pupils, 5e-7, 150e-6, **view).shape == (2, 1, 9, 8)
    assert optics.torch.psf(pupils[:1], waves, 150e-6, sources, **view).shape == (1, 3, 2, 9, 8)
    assert optics.torch.psf(pupils[0], waves, [150e-6], **view).shape == (1, 2, 9, 8)


@pytest.mark.parametrize(("shape", "dx", "centre"), [((4, 3), 4e-6, (2e-6, -1e-6)), ((5, 6), 0.4e-6, (0.0, 0.0))])
def test_means_over_pixels(shape, dx, centre):
    """An odd number of samples covers each pixel, and their mean is close to the mean over the pixel."""
    n, pupil, z = 61, lens(height=BSplineRelief(RNG.random((4, 4)) * 1e-6)), 160e-6
    x, y = (at - dx / n * (n - 1) / 2 * (side % 2 == 0) for at, side in zip(centre, shape[::-1], strict=True))
    fine = {"dx": dx / n, "shape": (n * shape[0], n * shape[1]), "centre": (x, y)}
    exact = optics.psf(pupil, [500e-9], z, **fine, tolerance=1e-5).psf.reshape(shape[0], n, shape[1], n).mean((1, 3))
    own = {"dx": dx, "shape": shape, "centre": centre}
    found = optics.torch.psf(pupil, [500e-9], z, **own, pixel_means=True)[0].numpy()
    assert np.linalg.norm(found - exact) < 1e-3 * np.linalg.norm(exact)
    points = optics.torch.psf(pupil, [500e-9], z, **own)[0].numpy()
    assert np.linalg.norm(points - exact) > 3e-3 * np.linalg.norm(exact)
    cells = optics.torch.psf(pupil, [500e-9], z, **own, method="geometric", pixel_means=True)
    torch.testing.assert_close(cells, optics.torch.psf(pupil, [500e-9], z, **own, method="geometric"))


def test_each_gradient_has_the_precision_and_shape_of_its_tensor():
    heights, focal = asking(SQUARE, dtype=torch.float32), asking(150e-6)
    pupil = lens(height=HeightMap(heights * UM), thin_lens_focal_length=focal)
    optics.torch.psf(pupil, 550e-9, **VIEW).sum().backward()
    assert (heights.grad.dtype, heights.grad.shape) == (torch.float32, (5, 5))
    assert (focal.grad.dtype, focal.grad.shape) == (torch.float64, ())


def test_a_graph_serves_several_passes_and_no_second_derivative():
    value = asking(SQUARE[:4, :4])
    image = spread("control points", value)
    first, other = (torch.autograd.grad(image.sum() * k, value, retain_graph=True)[0] for k in (1, 2))
    torch.testing.assert_close(2 * first, other)
    assert first.abs().max() > 0
    (slope,) = torch.autograd.grad(image.sum(), value, create_graph=True)
    with pytest.raises(
        RuntimeError, match=r"^optics.torch.psf has no second derivatives: must be differentiated once$"
    ):
        slope.sum().backward()
    with torch.no_grad():
        assert not spread("control points", value).requires_grad


@pytest.mark.slow
def test_a_lens_is_learnt_by_adam():
    """The lens improves from a weak lens to the focus: an image loss in torch, the optics in Dr.Jit."""
    weak = 0.5 * BSplineRelief.paraboloid(0.0, 1 / (0.5 * 150e-6), 12e-6).control_points
    lens = optics.torch.PointSpread(12e-6, heights=BSplineRelief(weak), unit=0.1e-6, **VIEW)
    x, y = (torch.arange(n) - n // 2 for n in (17, 21))
    spot = torch.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / (2 * 3.0**2))
    optimiser = torch.optim.Adam(lens.parameters(), lr=1.0)
    losses = []
    for _ in range(25):
        optimiser.zero_grad()
        loss = -torch.log((lens() * spot).sum() * 1e-12)
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < losses[0] - 0.3
    found = optics.psf(Pupil(12e-6, BSplineRelief(lens.heights.detach().numpy())), **VIEW)
    before = optics.psf(Pupil(12e-6, BSplineRelief(weak)), **VIEW)
    assert optics.strehl_ratio(found)[0] > 1.3 * optics.strehl_ratio(before)[0]


def test_the_module_learns_any_relief():
    for relief in (BSplineRelief, HeightMap, PixelRelief):
        start, more = relief(SQUARE[:4, :4] * UM), {"thin_lens_focal_length": 150e-6}
        module = optics.torch.PointSpread(R, heights=start, pupil=more, **VIEW)
        np.testing.assert_allclose(module.relief.detach(), SQUARE[:4, :4])
        image = module()
        expected = optics.torch.psf(lens(height=relief(asking(SQUARE[:4, :4] * UM))), **VIEW)
        torch.testing.assert_close(image, expected)
        image.sum().backward()
        assert module.relief.grad.abs().max() > 0
    with pytest.raises(ValueError, match=r"must be a BSplineRelief, HeightMap or PixelRelief"):
        optics.torch.PointSpread(R, heights=SomeRelief(), **VIEW)


class SomeRelief(Relief):
    knots = 1

    def height(self, x, y):
        return 0 * x

    def bandwidth(self, level):
        return 0.0


def former(heights, **view):
    return optics.torch.psf(heights, radius=R, **view)


def test_former_calls_work_and_the_guess_warns_once(monkeypatch):
    monkeypatch.setattr(renamed, "_warned", set())
    points = torch.tensor(SQUARE[:4, :4] * UM)
    with pytest.warns(
        FutureWarning, match=r"heights of 4 x 4 are taken as control points: pass optics\.BSpline"
    ) as seen:
        found = former(points, **VIEW)
    assert seen[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        torch.testing.assert_close(former(points, n=1.5, pupil={}, **VIEW), found)
        torch.testing.assert_close(optics.torch.psf(heights=points, radius=R, **VIEW), found)
        torch.testing.assert_close(optics.torch.psf(Pupil(R, BSplineRelief(points)), **VIEW), found)
        samples = torch.tensor(SQUARE * UM)
        torch.testing.assert_close(former(samples, **VIEW), optics.torch.psf(Pupil(R, samples), **VIEW))
        assert optics.torch.PointSpread(R, **VIEW).relief.shape == (4, 4)
    monkeypatch.setattr(renamed, "_warned", set())
    with pytest.warns(FutureWarning, match="heights of 4 x 4") as seen:
        optics.torch.PointSpread(R, heights=points, **VIEW)
    assert seen[0].filename == __file__


def test_help_starts_with_our_own_functions():
    text = pydoc.plain(pydoc.render_doc(optics.torch)).splitlines()
    own = [row for row, line in enumerate(text) if line.strip().startswith(("psf(pupil", "PointSpread(radius"))]
    assert own[0] < own[1] < 12 < text.index("CLASSES")


def test_one_wavelength_may_stand_alone():
    for wavelengths in (500e-9, [500e-9]):
        assert optics.torch.PointSpread(15e-6, wavelengths, **VIEW)().shape == (1, 21, 17)
