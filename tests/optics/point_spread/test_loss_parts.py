"""Losses of windows, light on disks and polarisation, from given samples, against sums written out here."""

import math
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.numerics.accuracy import AccuracyError
from optics.numerics.grid import Grid
from optics.point_spread import disk_sum, vector_focus, window_loss
from optics.point_spread.disk_sum import DiskSum
from optics.point_spread.window_loss import ErrorCauses
from tests.optics.device_types import Float64

RNG = np.random.default_rng(1)
IMAGE = RNG.random((5, 8)).astype(np.float32)


def spectrum(image):
    """Return the spectrum on a square grid of frequencies, with the frequency 0 in the middle."""
    side = max(image.shape)
    f = (np.arange(side) - side // 2) / side
    down, across = (np.exp(-2j * np.pi * np.outer(f, np.arange(n))) for n in image.shape)
    return down @ image @ across.T


def test_totals_and_first_wavelengths_of_causes():
    causes = ErrorCauses(*RNG.random((3, 4)))
    np.testing.assert_allclose(causes.total, causes.lost + causes.rest)
    np.testing.assert_array_equal(causes.first(3).light, causes.light[:3])


@pytest.mark.parametrize(("n", "start"), [(8, 0.5), (5, 0.7), (1, 0.5)])
def test_fades_towards_the_ends_of_a_row(n, start):
    """A fade is cos² of a quarter of a turn from its start on. Ends of rows are half their length away."""
    expected = []
    for k in range(n):
        away = abs(k - n // 2) / max(n / 2, 1)
        expected.append(math.cos(math.pi / 2 * min(max(away - start, 0) / (1 - start), 1)) ** 2)
    np.testing.assert_allclose(window_loss._fade(n, start), expected, atol=1e-15)


def test_spectra_on_a_square_grid():
    np.testing.assert_allclose(window_loss._spectrum(IMAGE), spectrum(IMAGE), atol=1e-5)


def outer_light(image, part):
    """Return the light outside an inner window, which extends by a part of the half width on either side."""
    outer = image.astype(float).copy()
    for i, j in np.ndindex(*image.shape):
        if all(abs(k - n // 2) <= round(part * n / 2) for k, n in zip((i, j), image.shape, strict=True)):
            outer[i, j] = 0
    return outer


@pytest.mark.parametrize(("shape", "parts"), [((5, 8), 2), ((21, 30), 3)])
def test_lost_light_like_the_outer_light(shape, parts):
    """The result is the root mean square over three inner windows; those without outer light do not count."""
    image = RNG.random(shape)
    kept = [part for part in (outer_light(image, at) for at in (0.5, 0.7, 0.9)) if part.any()]
    assert len(kept) == parts
    squares = [np.abs(spectrum(part) / part.sum()) ** 2 for part in kept]
    found = window_loss._like_the_rest(image, 0.25)
    np.testing.assert_allclose(found, 0.25 * np.sqrt(sum(squares) / parts))
    assert not window_loss._like_the_rest(np.zeros(shape), 0.25).any()


@pytest.mark.parametrize("lost", [0.02, 5.0])
def test_errors_of_contrasts_by_light_outside(lost):
    """The largest estimate of nine frequencies counts, plus all lost light near the frequency 0; at most all of it."""
    image = IMAGE.astype(float)
    early, late = (
        spectrum(image * (1 - np.outer(window_loss._fade(5, at), window_loss._fade(8, at)))) for at in (0.5, 0.7)
    )
    estimate = np.abs(early) + np.abs(early - late) + window_loss._like_the_rest(image, lost)
    found = window_loss.spectrum_of_loss(IMAGE, lost)
    for i, j in np.ndindex(8, 8):
        nine = [estimate[(i + a) % 8, (j + b) % 8] for a in (-1, 0, 1) for b in (-1, 0, 1)]
        near = math.exp(-((i - 4) ** 2 + (j - 4) ** 2) / 4)
        assert found[i, j] == pytest.approx(min(max(nine) + lost * near, lost), rel=1e-5)


class Light:
    """A field on 9 x 11 samples around (1, -2)."""

    dx, centre = 0.5, (1.0, -2.0)
    grid = Grid((9, 11), 0.5, (1.0, -2.0))
    psf = 0.05 * RNG.random((9, 11))
    plan = SimpleNamespace(predicted_error=1e-3)
    towards = SimpleNamespace(cutoff=0.25)


def test_room_around_a_point():
    """Samples extend by 2.5 m along x and by 2 m along y."""
    assert disk_sum._room(Light, (1.0, -2.0)) == pytest.approx(2)
    assert disk_sum._room(Light, (2.0, -2.0)) == pytest.approx(1.5)
    assert disk_sum._room(Light, (0.25, -2.0)) == pytest.approx(1.75)
    assert disk_sum._room(Light, (1.0, -1.0)) == pytest.approx(1)
    assert disk_sum._room(Light, (1.0, -2.5)) == pytest.approx(1.5)


def test_light_on_a_disk(monkeypatch):
    """The weights are those of a soft disk around the given centre. Lengths are in units of 1/cutoff."""
    asked = []
    monkeypatch.setattr(disk_sum, "_around", lambda *given: asked.append(given) or Light)
    table = SimpleNamespace(at=lambda at, types: 2 * at)
    monkeypatch.setattr(disk_sum, "disk_table", lambda kernel, radius: asked.append((kernel, radius)) or table)
    found = DiskSum.over(Light, 0.75, (0.5, -2.5))
    assert asked[0] == (Light, Light.towards, (0.5, -2.5), 0.75)
    assert asked[1] == (disk_sum._kernel(0.5, 0.25), pytest.approx(0.75 * 0.25))
    distance = np.hypot(Light.grid.x - 0.5, Light.grid.y[:, None] + 2.5)
    np.testing.assert_allclose(found.share, 2 * 0.25 * distance, rtol=1e-6)
    value, error = found.integrate(IMAGE[0, 0] * np.ones((9, 11)))
    assert value == pytest.approx(float(IMAGE[0, 0]) * found.share.sum() * 0.25)
    own = 1e-3 * np.linalg.norm(Light.psf) * np.linalg.norm(found.share) * 0.25
    assert found.light_error == pytest.approx(own)
    bright = math.pi * 0.75**2 * Light.psf.max()
    assert bright < 1
    assert error == pytest.approx(own + 1e-6 * bright)
    wide = DiskSum(Light, found.share, 100.0)
    assert wide.integrate(Light.psf)[1] == pytest.approx(own + 1e-6)
    DiskSum.over(Light, 2.0 * (1 + 5e-10))
    for given, reason in (((2.0 * (1 + 2e-9),), "radius = 2 m: must end within"), ((0.1, (3.6, -2.0)), "centre = ")):
        with pytest.raises(ValueError, match=f"^{reason}"):
            DiskSum.over(Light, *given)
    monkeypatch.setattr(Light, "towards", None)
    with pytest.raises(AccuracyError, match="light is not from vector_focus"):
        DiskSum.over(Light, 0.5)


def test_kernels_of_disks():
    """All frequencies up to 1 pass, and those from 1/(dx · cutoff) - 1 on are blocked."""
    kernel = disk_sum._kernel(0.5, 0.25)
    assert kernel == type(kernel)(1.0, 7.0, 1e-5)


def stokes(jones):
    """Return the sum of the Stokes parameters of Jones vectors."""
    x, y = np.asarray(jones).T
    cross = (x.conj() * y).sum()
    x, y = (np.abs(x) ** 2).sum(), (np.abs(y) ** 2).sum()
    return x + y, x - y, 2 * cross.real, 2 * cross.imag


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ((3.0, 4.0j), 1),
        ((1j, -2.0), 1),
        ((2.0, 0.5, -0.25, 0.75), 2),
        ((2.0, 0.0, 0.0, 2.0), 1),
        ((5.0, 0, 0, 0), 2),
        (None, 2),
    ],
)
def test_polarisation_is_a_sum_of_parts(given, parts):
    vectors, found = vector_focus._polarised(given)
    assert vectors.shape == (parts, 2)
    expected = (1, 0, 0, 0) if given is None else given
    if len(expected) == 2:
        expected = stokes([np.array(expected) / np.linalg.norm(expected)])
    np.testing.assert_allclose(found, np.array(expected) / expected[0], atol=1e-12)
    np.testing.assert_allclose(stokes(vectors), found, atol=1e-12)


@pytest.mark.parametrize(
    "given",
    [
        (0, 0),
        (1, 2, 3),
        "x",
        (1, 1j, 0, 0),
        (0.0, 0, 0, 0),
        (-1.0, 0, 0, 0),
        (1.0, 1 + 2e-9, 0, 0),
        (1.0, np.nan, 0, 0),
    ],
)
def test_polarisation_that_does_not_exist(given):
    with pytest.raises(ValueError, match=r"^polarization = .*: must be a Jones vector"):
        vector_focus._polarised(given)
    assert vector_focus._polarised((1.0, 1 + 5e-10, 0, 0))[0].shape == (1, 2)


@pytest.mark.parametrize(("sine", "good"), [(1.47, True), (1.4701, False)])
def test_rays_behind_the_pupil(sine, good):
    """The sine in the medium is at most 0.98; its index is 1.5."""
    asked = []

    def slopes(*given):
        asked.append(given)
        return SimpleNamespace(steepest_inside=sine)

    beam = SimpleNamespace(pupil=SimpleNamespace(slopes=slopes), wavelength=5e-7, source="source", index=1.5)
    if good:
        vector_focus._check_rays(beam)
        assert asked == [(5e-7, "source")]
        return
    with pytest.raises(AccuracyError, match=r"^rays leave the pupil with a sine of 0\.98.*: must be at most 0\.98"):
        vector_focus._check_rays(beam)


def aplanatic(radius=3e-3, distance=4e-3, angle=(0.0, 0.0), focal=4e-3, **parts):
    given = {"height": None, "wavefront": None, "mask": None} | parts
    pupil = SimpleNamespace(radius=radius, thin_lens_focal_length=focal, **given)
    return SimpleNamespace(
        pupil=pupil, distance=distance, index=1.5, wavelength=5e-7, source=SimpleNamespace(angle=angle)
    )


@pytest.mark.parametrize(
    "given",
    [{"height": 1}, {"wavefront": 1}, {"mask": 1}, {"angle": (0.1, 0.0)}, {"focal": None}, {"radius": 4e-3}],
)
def test_aplanatic_lenses(given):
    """The Fresnel number n R²/(λ z) is at least 20, and the radius is below the distance."""
    vector_focus._check_aplanatic(aplanatic())
    vector_focus._check_aplanatic(aplanatic(radius=3.9999e-3))
    with pytest.raises(ValueError, match=r"^apodization = 'aplanatic': must be an ideal lens"):
        vector_focus._check_aplanatic(aplanatic(**given))
    least = math.sqrt(20 * 5e-7 * 4e-3 / 1.5)
    vector_focus._check_aplanatic(aplanatic(radius=least * (1 + 1e-9)))
    with pytest.raises(AccuracyError, match=r"^Fresnel number 20: must be at least 20"):
        vector_focus._check_aplanatic(aplanatic(radius=least * (1 - 1e-6)))


def test_derivatives_of_vector_foci_are_refused():
    radius = Float64(1e-5)
    dr.enable_grad(radius)
    with pytest.raises(ValueError, match=r"^pupil"):
        vector_focus._check_plain(optics.Pupil(radius), 5e-7)
