"""Even and odd numbers of samples describe the same light: no array is shifted by half a sample.

Windows and fields have sample n//2 at their centre. Reliefs, wavefronts and masks have a sample at the centre of each
cell of a square. Receptors fill the retina evenly. A shift by half a sample changes each result below by a few percent.
"""

import numpy as np
import pytest

import optics

WAVE, Z = 550e-9, 240e-6
LENS = {"aperture_radius": 30e-6, "thin_lens_focal_length": Z}
SMOOTH = optics.Zernike({(3, 1): 0.15, (2, -2): 0.1, (3, -3): 0.05})


def seen(pupil, shape=(65, 65)):
    return optics.psf(pupil, [WAVE], Z, dx=0.6e-6, shape=shape, tolerance=1e-4)


@pytest.mark.parametrize("shape", [(64, 64), (65, 64), (64, 66)])
def test_windows_and_their_measures(shape):
    odd, even = seen(optics.Pupil(**LENS, wavefront=SMOOTH)), seen(optics.Pupil(**LENS, wavefront=SMOOTH), shape)
    height, width = min(shape[0], 64), min(shape[1], 64)
    middle = [
        each.psf[0][n // 2 - height // 2 :, m // 2 - width // 2 :][:height, :width]
        for each in (odd, even)
        for n, m in [each.psf.shape[1:]]
    ]
    assert np.abs(middle[0] - middle[1]).max() < 1e-5 * middle[0].max()  # rounding in float32
    assert optics.strehl_ratio(even) == pytest.approx(optics.strehl_ratio(odd), rel=1e-4)
    radii = np.array([3e-6, 8e-6])
    assert optics.encircled_energy(even, radii) == pytest.approx(optics.encircled_energy(odd, radii), rel=1e-4)
    # The windows of the two MTFs differ by a row or a column, with a part of 1e-4 of the light.
    frequencies = np.array([5e4, 1e5])
    profiles = [optics.mtf(each).profile(frequencies) for each in (odd, even)]
    assert profiles[1] == pytest.approx(profiles[0], rel=2e-3)


SAMPLED = {
    "height": lambda x, y: {"height": 1e-6 * (0.3 * x + 0.2 * y * y - 0.1 * x * y)},
    "wavefront": lambda x, y: {"wavefront": optics.WavefrontMap(1e-6 * (0.3 * x + 0.2 * y * y - 0.1 * x * y))},
    "mask": lambda x, y: {"mask": optics.MaskMap(0.5 + 0.3 * x - 0.1 * y * y)},
}


@pytest.mark.parametrize("kind", SAMPLED)
def test_samples_over_the_pupil(kind):
    """Cubic splines through the samples reproduce these polynomials exactly."""
    images = []
    for n in (16, 17):
        at = (np.arange(n) + 0.5) * 2 / n - 1
        images.append(seen(optics.Pupil(**LENS, **SAMPLED[kind](at[None, :], at[:, None]))).psf)
    assert np.abs(images[0] - images[1]).max() < 1e-5 * images[0].max()


def test_pixels_of_a_relief():
    """Every second border between 8 pixels is a border between 4 pixels."""
    coarse = 4e-7 * np.random.default_rng(0).random((4, 4))
    images = [
        seen(optics.Pupil(**LENS, height=optics.PixelRelief(heights)), (24, 25)).psf
        for heights in (coarse, np.kron(coarse, np.ones((2, 2))))
    ]
    assert np.abs(images[0] - images[1]).max() < 2e-4 * images[0].max()


def test_fields_between_planes():
    x = (np.arange(129) - 64) * 0.5e-6
    u = np.exp(-((x[None, :] - 3e-6) ** 2 + (x[:, None] + 5e-6) ** 2) / 8e-6**2).astype(complex)
    given = {"dx": 0.5e-6, "wavelength": WAVE, "distance": 1e-4, "tolerance": 1e-5}
    odd = optics.propagate(u, **given).u
    for even, part in (
        (optics.propagate(u[:-1, :-1], **given).u, np.s_[:-1, :-1]),
        (optics.propagate(u, **given, out_shape=(100, 102)).u, np.s_[14:114, 13:115]),
    ):
        assert np.abs(odd[part] - even).max() < 2e-5 * np.abs(odd).max()


@pytest.mark.parametrize(
    ("resolution", "cells", "waveguide"),
    [((8, 10), (3, 4), None), ((9, 7), (3, 4), None), ((8, 7), (3, 4), None), ((8, 7), (4,), optics.Waveguide(4e-6))],
)
def test_retinas(resolution, cells, waveguide):
    """The signals of a scene that is rotated by 180° are rotated by 180°, for even and odd numbers of cells."""
    lens = optics.Pupil(25e-6, thin_lens_focal_length=Z)
    eye = optics.Eye(lens, resolution, noise_sigma=0, bands=1, receptors=(550,), waveguide=waveguide)
    for s in cells:
        scene = np.random.default_rng(s).random((1, resolution[0] * s + 4, resolution[1] * s + 4))
        for light_from in ("cells", "centres"):
            bank = eye.sight(s, light_from=light_from)
            upright, turned = (eye.see(each, s, sight=bank) for each in (scene, scene[:, ::-1, ::-1]))
            assert np.abs(turned[:, ::-1, ::-1] - upright).max() < 1e-6 * upright.max()
