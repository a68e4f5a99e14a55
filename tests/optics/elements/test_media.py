"""Media in front of and behind a pupil, and their dispersion: refraction, and the human eye's chromatic focus."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import optics
from optics import BSplineRelief, Cornu, Pupil, RefractiveIndex, Sellmeier, Zernike, medium
from validation.reference import relative_l2

R, WAVE = 40e-6, 550e-9


def centroid(result):
    image = result.psf[0]
    return (image.sum(axis=0) @ result.x) / image.sum(), (image.sum(axis=1) @ result.y) / image.sum()


@pytest.mark.parametrize(("before", "behind"), [(1.0, 1.33), (1.33, 1.0), (1.336, 1.336)])
def test_snell_bends_what_comes_aslant(before, behind):
    """Light that arrives at the angle θ reaches the sensor at z tan θ', where n₀ sin θ = n sin θ'."""
    angle, z = (0.3, -0.15), 400e-6
    tx, ty = np.tan(angle)
    sine = before / behind * np.array([tx, ty]) / math.sqrt(1 + tx * tx + ty * ty)
    at = z * sine / math.sqrt(1 - sine @ sine)
    pupil = Pupil(R / 4, thin_lens_focal_length=z, medium_n=behind, object_n=before)
    result = optics.psf(pupil, [WAVE], z, source_angle=angle, dx=4e-6, shape=(41, 41), centre=tuple(at))
    assert centroid(result) == pytest.approx(at, abs=1.5e-6)
    unbent = z * np.tan(angle)
    assert before == behind or np.hypot(*(unbent - at)) > 20e-6


def test_a_point_before_the_lens_has_its_image_at_n_over_z():
    """The distance z of the image of a point at the distance s satisfies n/z = n/f - n₀/s at every wavelength."""
    s, water = 8e-3, medium("water")
    pupil = Pupil(R, thin_lens_focal_length=1e-3, medium_n=water, object_n=1.0)
    z = pupil.image_distance(s)
    assert water.at(WAVE) / z == pytest.approx(water.at(WAVE) / 1e-3 - 1 / s, rel=1e-12)
    asked = {"source_distance": s, "dx": 0.5e-6, "shape": (9, 9)}
    assert optics.strehl_ratio(optics.psf(pupil, [WAVE], **asked))[0] == pytest.approx(1, abs=2e-3)
    in_one_medium = 1 / (1 / 1e-3 - 1 / s)
    assert optics.strehl_ratio(optics.psf(pupil, [WAVE], in_one_medium, **asked))[0] < 0.99
    both = Pupil(R, thin_lens_focal_length=1e-3, medium_n=medium("vitreous"), object_n=water)
    assert optics.strehl_ratio(optics.psf(both, [450e-9, 650e-9], 1e-3, dx=0.5e-6, shape=(9, 9))).min() > 0.998


@pytest.mark.parametrize("source", [math.inf, 5e-3])
def test_picture_is_the_direct_sum(source):
    """The direct sum has the index n₀ to the source, n - n₀ through the glass, and n behind it."""
    z, before, behind, glass = 300e-6, 1.1, 1.4, 1.6
    relief = BSplineRelief(np.random.default_rng(2).random((4, 4)) * 1e-6)
    pupil = Pupil(R, relief, glass, behind, z, wavefront=Zernike({(3, 1): 0.05}), object_n=before)
    kind = {"dx": 1e-6, "shape": (9, 9), "tolerance": 1e-5}
    found = optics.psf(pupil, [WAVE], z, source_distance=source, **kind)
    n = 200
    square, weight = np.polynomial.legendre.leggauss(n)
    rho, theta = np.meshgrid(np.sqrt((square + 1) / 2), 2 * np.pi * np.arange(n) / n)
    x, y, area = R * rho * np.cos(theta), R * rho * np.sin(theta), np.tile(weight, (n, 1)) * np.pi * R**2 / 2 / n
    from optics.numerics.precision import precision

    types = precision("float64")
    height = relief.height(types.Float64(x.ravel() / R), types.Float64(y.ravel() / R)).numpy().reshape(x.shape)
    r2 = x * x + y * y
    path = (glass - before) * height - behind * (np.sqrt(r2 + z * z) - z)
    path -= pupil.wavefront.at(x / R, y / R)
    path += 0 if math.isinf(source) else before * (np.sqrt(r2 + source**2) - source)
    k, expected = 2 * np.pi / WAVE, np.zeros((9, 9))
    for row, py in enumerate(found.y):
        for column, px in enumerate(found.x):
            length = np.sqrt((px - x) ** 2 + (py - y) ** 2 + z * z)
            kernel = z / (2 * np.pi * length**2) * (1 / length - 1j * k * behind)
            expected[row, column] = abs(np.sum(area * kernel * np.exp(1j * k * (path + behind * length)))) ** 2
    assert relative_l2(found.psf[0], expected / (np.pi * R**2)) < 1e-5


def test_methods_agree_between_media():
    pupil = Pupil(R, BSplineRelief(np.ones((4, 4))), 1.5, medium("aqueous"), 300e-6, object_n=1.0)
    kind = {"dx": 1e-6, "shape": (15, 15), "source_distance": 4e-3, "sensor_distance": 310e-6}
    exact = optics.psf(pupil, [WAVE], method="rayleigh_sommerfeld", tolerance=1e-6, dtype="float64", **kind).psf
    for method in ("low_rank", "angular_spectrum", "split_angular_spectrum", "far_field", "hankel"):
        assert relative_l2(optics.psf(pupil, [WAVE], method=method, **kind).psf, exact) < 1e-3
    [batch] = optics.psf_batch([pupil], [WAVE], 310e-6, [4e-3], dx=1e-6, shape=(15, 15), tolerance=1e-2).psf
    assert relative_l2(batch[0], exact) < 1e-2


@pytest.mark.parametrize(
    ("name", "nm", "published"),
    [
        ("water", 589.3, 1.3334),  # IAPWS at 20 °C: 1.33336
        ("water", 404.7, 1.3428),
        ("water", 768.2, 1.3290),
        ("aqueous", 555, 1.3360),
        ("vitreous", 555, 1.3360),
        ("cornea", 555, 1.3760),
        ("chromatic_eye", 589, 1.3330),
    ],
)
def test_media_are_as_published(name, nm, published):
    assert medium(name).at(nm * 1e-9) == pytest.approx(published, abs=4e-4)


def test_curves():
    um = 0.6
    assert Sellmeier((0.5, 0.1), (0.01, 0.02)).at(600e-9) == pytest.approx(
        math.sqrt(1 + 0.5 * um**2 / (um**2 - 0.01) + 0.1 * um**2 / (um**2 - 0.02))
    )
    assert Cornu(1.3, 0.005, 0.2).at(600e-9) == pytest.approx(1.3 + 0.005 / 0.4)
    assert RefractiveIndex(1.3, 3e-15, 2e-28, 1e-41).at(600e-9) == pytest.approx(
        1.3 + 3e-3 / um**2 + 2e-4 / um**4 + 1e-5 / um**6
    )


def best_distance(eye, wavelength, near):
    """Distance behind the pupil at which the PSF is sharpest [m]."""

    def blur(z):
        seen = optics.psf(eye, [wavelength], z, dx=0.5e-6, shape=(3, 3), tolerance=1e-5, dtype="float64")
        return -float(optics.strehl_ratio(seen)[0])

    return minimize_scalar(blur, bounds=(0.96 * near, 1.04 * near), method="bounded", options={"xatol": near * 1e-6}).x


@pytest.mark.slow
def test_longitudinal_chromatic_aberration_of_the_human_eye():
    """The eye is one refracting surface with a radius of 5.55 mm between air and the medium of Thibos et al. (1992).
    Its focus at each wavelength λ [µm] agrees with their fit to observers, Rx = 1.68524 - 0.63346/(λ - 0.21410) [D]
    (eq. 5).
    """
    humour, surface = medium("chromatic_eye"), 5.55e-3
    cornea = BSplineRelief.paraboloid(0.0, 1 / surface, 0.5e-3)
    eye = Pupil(0.5e-3, cornea, n=humour, medium_n=humour, object_n=1.0)
    paraxial = humour.at(589e-9) * surface / (humour.at(589e-9) - 1)
    at_589 = best_distance(eye, 589e-9, paraxial)
    assert at_589 == pytest.approx(paraxial, rel=5e-3)
    for nm in (420, 500, 700):
        n = humour.at(nm * 1e-9)
        refraction = n / at_589 - n / best_distance(eye, nm * 1e-9, at_589)
        published = 1.68524 - 0.63346 / (nm / 1000 - 0.21410)
        assert refraction == pytest.approx(published, abs=0.03)
    assert abs(1.68524 - 0.63346 / (0.42 - 0.2141)) > 1.3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: medium("wine"), "medium = 'wine'"),
        (lambda: Pupil(R, medium_n=0.5), "medium_n = 0.5"),
        (lambda: Pupil(R, object_n="water"), "object_n = 'water'"),
        (lambda: Sellmeier((), ()), r"strengths = \(\)"),
        (lambda: Sellmeier((1.0,), (0.1, 0.2)), "2 poles_um2"),
        (lambda: Sellmeier((1.0,), (math.nan,)), "poles_um2 = nan"),
        (lambda: Sellmeier((1.0,), (0.36,)).at(600e-9), "n = inf"),
        (lambda: Cornu(1.3, math.inf, 0.2), "b_um = inf"),
        (lambda: Cornu(1.3, 0.005, 0.7).at(600e-9), "n = inf"),
        (lambda: RefractiveIndex(1.3, 0.0, math.nan), "c = nan"),
        (
            lambda: optics.propagate_through(
                [Pupil(R, object_n=1.3), optics.FreeSpace(1e-3)], wavelength=5e-7, out_dx=1e-6, out_shape=(9, 9)
            ),
            "media that differ",
        ),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("name", ["n", "medium_n", "object_n"])
def test_a_materials_name_is_no_index(name):
    with pytest.raises(
        ValueError, match=rf"{name} = 'water': must be a number, or a curve such as optics.medium\('water"
    ):
        Pupil(R, **{name: "water"})
