"""Wavefronts as Zernike polynomials and as samples: order, sign and normalisation, and their PSFs."""

import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Pupil, Slit, WavefrontMap, Zernike
from optics.elements.wavefront import mode
from tests.optics.device_types import Float64, TensorXf64, UInt32

R, F, WAVE = 60e-6, 1e-3, 550e-9
MODES = [(n, m) for n in range(9) for m in range(-n, n + 1, 2)]
RNG = np.random.default_rng(5)
RANDOM = {key: float(RNG.normal(0, 0.06)) for key in MODES if key[0] in range(2, 7)}
ASKED = {"wavelengths": [WAVE], "sensor_distance": F, "dx": 1.5e-6, "shape": (15, 15)}


def disk(n, spokes):
    """Return nodes x, y and weights for the mean over the unit disk: Gauss-Legendre nodes in ρ², and equidistant
    angles.
    """
    square, weight = np.polynomial.legendre.leggauss(n)
    rho, angle = np.meshgrid(np.sqrt((square + 1) / 2), np.arange(spokes) * 2 * np.pi / spokes)
    return rho * np.cos(angle), rho * np.sin(angle), np.broadcast_to(weight / 2 / spokes, rho.shape)


def eye(wavefront, **others):
    return Pupil(R, thin_lens_focal_length=F, wavefront=wavefront, **others)


def written_out(rho, theta):
    """Return the Zernike polynomials of Thibos et al. (2002), table 2, by index."""
    r, s, c = rho, np.sin, np.cos
    return [
        1 + 0 * r,
        2 * r * s(theta),
        2 * r * c(theta),
        math.sqrt(6) * r**2 * s(2 * theta),
        math.sqrt(3) * (2 * r**2 - 1),
        math.sqrt(6) * r**2 * c(2 * theta),
        math.sqrt(8) * r**3 * s(3 * theta),
        math.sqrt(8) * (3 * r**3 - 2 * r) * s(theta),
        math.sqrt(8) * (3 * r**3 - 2 * r) * c(theta),
        math.sqrt(8) * r**3 * c(3 * theta),
        math.sqrt(10) * r**4 * s(4 * theta),
        math.sqrt(10) * (4 * r**4 - 3 * r**2) * s(2 * theta),
        math.sqrt(5) * (6 * r**4 - 6 * r**2 + 1),
        math.sqrt(10) * (4 * r**4 - 3 * r**2) * c(2 * theta),
        math.sqrt(10) * r**4 * c(4 * theta),
    ]


def test_order_and_polynomials_are_those_of_the_standard():
    rho, theta = RNG.random(40), RNG.random(40) * 2 * np.pi
    x, y = rho * np.cos(theta), rho * np.sin(theta)
    for j, expected in enumerate(written_out(rho, theta)):
        found = Zernike([0.0] * j + [1.0]).at(x, y)
        np.testing.assert_allclose(found, 1e-6 * expected, atol=1e-19)


def test_they_are_orthonormal():
    x, y, weight = disk(24, 48)
    values = np.array([mode(n, m, x, y) for n, m in [*MODES, (20, 0), (21, -7), (30, 0), (30, 2)]])
    gram = np.einsum("ayx,byx,yx->ab", values, values, weight)
    # The product of two modes of order 30 has degree 60; 48 spokes distinguish angular orders up to 24 apart.
    np.testing.assert_allclose(gram, np.eye(len(values)), atol=1e-11)


def test_root_mean_square():
    x, y, weight = disk(20, 40)
    wavefront = Zernike({**RANDOM, (0, 0): 3.0})
    height = Zernike(RANDOM).at(x, y)
    assert wavefront.rms == pytest.approx(math.sqrt((height**2 * weight).sum()), rel=1e-12)


def test_positive_defocus_is_a_myopes():
    """An eye that is myopic by D dioptres has a stronger lens, 1/f' = 1/f + D. Its defocus is c = D R²/(4√3)."""
    dioptres = 30.0
    strong = {"sensor_distance": 1 / (1 / F + dioptres), "tolerance": 1e-5, "dx": 1e-6, "shape": (31, 31)}
    myope = Zernike({(2, 0): 1e6 * dioptres * R**2 / (4 * math.sqrt(3))})
    lens = Pupil(R, thin_lens_focal_length=1 / (1 / F + dioptres))
    expected, found = (optics.psf(pupil, **strong).psf for pupil in (lens, eye(myope)))
    assert np.abs(found - expected).max() < 2e-3 * expected.max()
    other = optics.psf(eye(Zernike({(2, 0): -myope.modes[2, 0]})), **strong).psf
    assert np.abs(other - expected).max() > 0.01 * expected.max()


@pytest.mark.parametrize("key", [(1, 1), (1, -1)])
def test_light_goes_away_from_where_the_wavefront_is_ahead(key):
    """The wavefront W = 2c x/R deflects light by the angle -2c/R."""
    c = 0.5
    picture = optics.psf(eye(Zernike({key: c})), [WAVE], F, dx=0.5e-6, shape=(129, 129), tolerance=1e-2)
    place = np.unravel_index(picture.psf[0].argmax(), picture.psf[0].shape)
    found = (picture.x[place[1]], picture.y[place[0]])
    turned = -2 * c * 1e-6 / R * F
    assert found == pytest.approx((turned, 0) if key == (1, 1) else (0, turned), abs=0.5e-6)


@pytest.mark.parametrize("medium_n", [1.0, 1.336])
def test_picture_is_the_direct_sum(medium_n):
    pupil = eye(Zernike(RANDOM), medium_n=medium_n)
    result = optics.psf(pupil, **ASKED, tolerance=1e-5, dtype="float64")
    x, y, weight = (part.ravel() for part in disk(60, 120))
    rho, theta = np.hypot(x, y), np.arctan2(y, x)
    written = written_out(rho, theta)
    found = sum(c * written[(n * (n + 2) + m) // 2] for (n, m), c in RANDOM.items() if n <= 4)
    for (n, m), c in RANDOM.items():
        if n > 4:
            a, k = abs(m), (n - abs(m)) // 2
            terms = [
                (-1) ** s * math.comb(n - s, s) * math.comb(n - 2 * s, k - s) * rho ** (n - 2 * s) for s in range(k + 1)
            ]
            angular = np.cos(a * theta) if m >= 0 else np.sin(a * theta)
            found = found + c * math.sqrt((2 - (m == 0)) * (n + 1)) * sum(terms) * angular
    path = -1e-6 * found - medium_n * (np.hypot(rho * R, F) - F)
    k = 2 * np.pi / WAVE
    seen = np.empty((15, 15))
    for i, eta in enumerate(result.y):
        for j, xi in enumerate(result.x):
            length = np.sqrt((x * R - xi) ** 2 + (y * R - eta) ** 2 + F**2)
            kernel = F / (2 * np.pi * length**2) * (1 / length - 1j * k * medium_n)
            wave = np.exp(1j * k * (path + medium_n * length))
            seen[i, j] = abs((kernel * wave * weight).sum() * np.pi * R**2) ** 2
    seen /= np.pi * R**2
    assert np.linalg.norm(result.psf[0] - seen) < 2e-5 * np.linalg.norm(seen)


@pytest.mark.parametrize("key", [(2, 0), (4, 0), (2, 2), (3, 3), (4, -2)])
def test_strehl_ratio_goes_to_mahajans(key):
    """Mahajan's formula exp(-(2πσ/λ)²) has an error of fourth order: half the aberration gives a sixteenth of the
    error.
    """
    far = 20e-3  # where all rays are too flat for obliquity to matter
    one = {"wavelengths": [WAVE], "sensor_distance": far, "shape": (1, 1), "tolerance": 1e-8, "dtype": "float64"}
    ideal = optics.psf(Pupil(R, thin_lens_focal_length=far), **one).psf[0, 0, 0]
    errors = []
    for turns in (0.05, 0.025):
        wavefront = Zernike({key: 1e6 * turns * WAVE})
        assert wavefront.rms == pytest.approx(turns * WAVE)
        ratio = optics.psf(Pupil(R, thin_lens_focal_length=far, wavefront=wavefront), **one).psf[0, 0, 0] / ideal
        errors.append(abs(ratio - math.exp(-((2 * math.pi * turns) ** 2))))
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.1)


def test_samples_are_the_polynomials():
    x = (np.arange(48) + 0.5) / 24 - 1
    wavefront = Zernike(RANDOM)
    samples = WavefrontMap(wavefront.at(x, x[:, None]))
    expected, found = (optics.psf(eye(each), **ASKED, tolerance=1e-4).psf for each in (wavefront, samples))
    assert np.linalg.norm(found - expected) < 2e-3 * np.linalg.norm(expected)


@pytest.mark.parametrize("kind", ["zernike", "map"])
def test_wider_than_the_pupil(kind):
    """The pupil has a quarter of the defocus if the wavefront is defined over twice the radius of the pupil."""
    x = (np.arange(32) + 0.5) / 16 - 1
    wide = Zernike({(2, 0): 0.8}, radius=2 * R)
    if kind == "map":
        wide = WavefrontMap(wide.at(x, x[:, None]), 2 * R)
    expected, found = (optics.psf(eye(each), **ASKED, tolerance=1e-5).psf for each in (Zernike({(2, 0): 0.2}), wide))
    assert np.linalg.norm(found - expected) < 3e-5 * np.linalg.norm(expected)


def asking(numbers):
    found = Float64(numbers)
    dr.enable_grad(found)
    return found


def brightness(wavefront):
    """Return the PSF at one sample next to the axis."""
    result = optics.psf(eye(wavefront), [WAVE], F, dx=2e-6, shape=(3, 3), tolerance=1e-5, dtype="float64")
    return dr.gather(Float64, dr.ravel(result.tensor), UInt32(5))


def slope(function, at, step=1e-4):
    return (function(at + step) - function(at - step)) / (2 * step)


def test_derivatives_by_vector_and_by_name():
    vector = np.array([0.0, 0.02, 0, 0.05, 0.08, 0, -0.03])
    for index, key in ((1, (1, -1)), (4, (2, 0)), (5, (2, 2))):

        def changed(value, index=index):
            return brightness(Zernike([*vector[:index], value, *vector[index + 1 :]])).numpy()[0]

        expected = slope(changed, vector[index])
        asked = asking(vector)
        dr.backward(brightness(Zernike(asked)))
        assert dr.grad(asked).numpy()[index] == pytest.approx(expected, rel=1e-4)
        named = asking(float(vector[index]))
        rest = {(1, -1): 0.02, (2, -2): 0.05, (2, 0): 0.08, (3, -3): -0.03}
        dr.backward(brightness(Zernike({**rest, key: named})))
        assert dr.grad(named).numpy()[0] == pytest.approx(expected, rel=1e-4)


def test_derivatives_of_samples():
    samples = RNG.normal(0, 2e-8, (5, 5))

    def changed(value):
        other = samples.copy()
        other[2, 3] = value * 1e-6
        return brightness(WavefrontMap(other)).numpy()[0]

    asked = TensorXf64(samples)
    dr.enable_grad(asked)
    dr.backward(brightness(WavefrontMap(asked)))
    assert dr.grad(asked).numpy()[2, 3] * 1e-6 == pytest.approx(slope(changed, samples[2, 3] * 1e6), rel=1e-4)


def test_a_population_has_them_too():
    pupils = [eye(Zernike({(2, 2): c})) for c in (0.1, 0.2)]
    batch = optics.psf_batch(pupils, [WAVE], F, dx=1.5e-6, shape=(15, 15), tolerance=1e-2)
    for index, pupil in enumerate(pupils):
        alone = optics.psf(pupil, **ASKED, tolerance=1e-3).psf
        assert np.linalg.norm(batch.psf[index, 0] - alone) < 1e-2 * np.linalg.norm(alone)


def test_beside_a_relief_of_pixels():
    """A stepped relief is combined with a wavefront: a lens made of pixels compensates half a wave of defocus."""
    steps = optics.PixelRelief(np.where(np.add.outer(np.arange(8), np.arange(8)) % 2, 2e-7, 0))
    bent = 1e6 * 40.0 * R**2 / (4 * math.sqrt(3))
    plain = Pupil(R, steps, thin_lens_focal_length=1 / (1 / F + 40.0), aperture=Slit(1, 1))
    both = eye(Zernike({(2, 0): bent}), height=steps, aperture=Slit(1, 1))
    expected, found = (optics.psf(pupil, **ASKED, tolerance=1e-4).psf for pupil in (plain, both))
    assert np.linalg.norm(found - expected) < 5e-3 * np.linalg.norm(expected)


def test_vector_focus_takes_wavefronts():
    """The Strehl ratios of spherical aberration, and of astigmatism, which is not rotationally symmetric, agree with
    Maréchal's formula.
    """
    assert eye(Zernike({(4, 0): 0.1, (2, 2): 0.0})).rotationally_symmetric(WAVE)
    round_, ideal = (
        optics.vector_focus(Pupil(2 * R, thin_lens_focal_length=F, wavefront=each), WAVE)
        for each in (Zernike({(4, 0): 0.06}), None)
    )
    ratio = round_.psf.max() / ideal.psf.max()
    assert ratio == pytest.approx(math.exp(-((2 * math.pi * 0.06 / 0.55) ** 2)), abs=0.02)
    aside = optics.vector_focus(Pupil(2 * R, thin_lens_focal_length=F, wavefront=Zernike({(2, 2): 0.06})), WAVE)
    assert aside.psf.max() / ideal.psf.max() == pytest.approx(ratio, abs=0.01)
    with pytest.raises(ValueError, match="without relief, wavefront or mask"):
        optics.vector_focus(
            Pupil(2 * R, thin_lens_focal_length=F, wavefront=Zernike([1])), WAVE, apodization="aplanatic"
        )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Zernike({(2, 1): 0.1}), r"coefficients_um has \(2, 1\): must be modes \(n, m\) with n up to 30"),
        (lambda: Zernike({(2, 4): 0.1}), r"coefficients_um has \(2, 4\)"),
        (lambda: Zernike({4: 0.1}), "coefficients_um has 4"),
        (lambda: Zernike({(2, 0): math.nan}), r"coefficients_um\[2, 0\] = nan: must be finite"),
        (lambda: Zernike([]), r"coefficients_um has shape \(0,\): must be"),
        (lambda: Zernike("defocus"), "coefficients_um: must be real numbers"),
        (lambda: Zernike([math.inf]), "coefficients_um holds NaN or infinity"),
        (lambda: Zernike([0.1], radius=0), "radius = 0: must be greater than 0"),
        (lambda: WavefrontMap(np.zeros(3)), r"samples has shape \(3,\): must be \(rows, columns\)"),
        (lambda: WavefrontMap(np.full((2, 2), np.nan)), "samples holds NaN or infinity: must be finite"),
        (lambda: eye(Zernike([0.1], radius=R / 2)), "wavefront is known over a radius of 3e-05 m: must be"),
        (lambda: eye({(2, 0): 0.1}), "wavefront = .*: must be a kind of Aberration, such as Zernike"),
        (lambda: eye(WavefrontMap([[0, 0.1], [0.1, 0]])), r"wavefront spans 0.1 m: must be at most 0.006 m"),
    ],
)
def test_bad_wavefronts(make, message):
    with pytest.raises(ValueError, match=message) as error:
        make()
    assert "\n" not in str(error.value)
