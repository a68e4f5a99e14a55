"""The vector focus of any pupil: against Richards and Wolf's integrals, a sum of plane waves, and scalar theory."""

import math

import numpy as np
import pytest

import optics
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.vector_sum import VectorSum
from optics.numerics.grid import Grid

WAVE, F = 500e-9, 1e-3
HEXAGON = optics.Polygon.regular(6, 17.0)


def lens(sine, aplanatic=False, **others):
    return optics.Pupil(F * (sine if aplanatic else math.tan(math.asin(sine))), thin_lens_focal_length=F, **others)


@pytest.mark.parametrize("sine", [0.5, 0.9])
@pytest.mark.parametrize(("apodization", "defocus"), [("flat", 0.0), ("flat", 0.4e-6), ("aplanatic", 0.0)])
def test_the_sum_over_the_pupil_is_richards_and_wolfs(sine, apodization, defocus):
    pupil, jones = lens(sine, apodization == "aplanatic"), np.array([1, 0.5j]) / math.sqrt(1.25)
    window = {"dx": 0.05e-6, "shape": (41, 35)}
    expected = optics.vector_focus(pupil, WAVE, F + defocus, polarization=jones, apodization=apodization, **window)
    beam = Beam(pupil, PointSource(), WAVE, F + defocus)
    found = VectorSum(beam, Grid((41, 35), 0.05e-6), apodization == "aplanatic").components()
    field = np.tensordot(jones, found[:6].reshape(2, 3, 41, 35), axes=1)
    np.testing.assert_allclose(field, expected.field, atol=1e-8 * np.abs(expected.field).max())
    np.testing.assert_allclose(np.abs(found[6]) ** 2, expected.scalar, atol=1e-8 * expected.scalar.max())


def test_a_polygon_of_many_corners_has_the_published_spot():
    """365 by 270 nm at NA 0.9 and 500 nm, through the sum."""
    round_ = lens(0.9, aplanatic=True, aperture=optics.Polygon.regular(96))
    options = {"apodization": "aplanatic", "polarization": (1, 0), "dx": 5e-9, "shape": (161, 161)}
    spot = optics.vector_focus(round_, WAVE, **options)
    along, across = (5 * np.count_nonzero(cut > cut.max() / 2) for cut in (spot.psf[80], spot.psf[:, 80]))
    assert along == pytest.approx(365, abs=6)
    assert across == pytest.approx(270, abs=6)


def plane_waves(pupil, angle, jones, centre, places):
    """Every ray a plane wave, its field turned by Rodrigues' matrices: a midpoint sum over a square of points."""
    n, radius, k = 401, pupil.radius, 2 * math.pi / WAVE
    at = ((np.arange(n) + 0.5) / n * 2 - 1) * radius
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    inside = np.hypot(x, y) <= radius
    x, y = x[inside], y[inside]
    before = np.array([math.tan(angle[0]), math.tan(angle[1]), 1.0])
    before /= np.linalg.norm(before)
    there = np.stack([centre[0] - x, centre[1] - y, np.full(len(x), F)])
    d = np.sqrt((there**2).sum(axis=0))
    path = before[0] * x + before[1] * y - (np.hypot(np.hypot(x, y), F) - F) + d
    e = turn(turn(np.array([*jones, 0.0]), np.array([0.0, 0.0, 1.0]), before)[:, None], before[:, None], there / d)
    waves = np.exp(1j * k * (path[:, None] + (there[:2] / d).T @ places)) * (F / d**2)[:, None]
    return e @ waves * (at[1] - at[0]) ** 2 / WAVE / math.sqrt(pupil.area)


def turn(field, before, after):
    w, c = np.cross(before, after, axis=0), (before * after).sum(axis=0)
    once = np.cross(w, np.broadcast_to(field, w.shape), axis=0)
    return field + once + np.cross(w, once, axis=0) / (1 + c)


def test_light_aslant_is_a_sum_of_plane_waves():
    """10° and -5° off the axis of a circle at NA 0.3; the window lies about the image."""
    pupil, angle, jones = lens(0.3), (0.17, -0.09), np.array([0.6, 0.8j])
    found = optics.vector_focus(pupil, WAVE, polarization=jones, source_angle=angle, dx=0.4e-6, shape=(5, 5))
    assert found.centre == pytest.approx([F * math.tan(at) for at in angle])
    x, y = (found.grid.moved((0.0, 0.0)).x, found.grid.moved((0.0, 0.0)).y)
    places = np.stack([axis.ravel() for axis in np.meshgrid(x, y)])
    expected = plane_waves(pupil, angle, jones, found.centre, places).reshape(3, 5, 5)
    phase = np.vdot(expected, found.field) / abs(np.vdot(expected, found.field))
    assert np.abs(found.field - phase * expected).max() < 5e-3 * np.abs(expected).max()


def test_flat_rays_aslant_keep_their_polarisation():
    """A slow lens 0.3 rad off its axis: the chief ray goes straight on, its field at right angles to it."""
    narrow = optics.Pupil(0.1e-3, thin_lens_focal_length=F)
    light = optics.vector_focus(narrow, WAVE, polarization=(1, 0), source_angle=(0.3, 0.0), dx=1e-6, shape=(3, 3))
    ex, ey, ez = light.intensity.sum(axis=(1, 2)) / light.psf.sum()
    assert ex == pytest.approx(math.cos(0.3) ** 2, abs=3e-3)
    assert ez == pytest.approx(math.sin(0.3) ** 2, abs=3e-3)
    assert ey < 1e-3


def test_hexagons_with_coma_are_scalar_theorys_where_rays_are_flat():
    wavefront = optics.Zernike({(3, 1): 0.08, (2, -2): 0.05})
    pupil = optics.Pupil(0.1e-3, thin_lens_focal_length=F, aperture=HEXAGON, wavefront=wavefront)
    window = {"dx": 0.5e-6, "shape": (33, 33)}
    exact = optics.psf(pupil, [WAVE], F, dtype="float64", tolerance=1e-6, **window).psf[0]
    found = optics.vector_focus(pupil, WAVE, **window)
    assert np.linalg.norm(found.scalar - exact) < 2e-3 * np.linalg.norm(exact)
    assert found.scalar_error < 0.01


def test_turning_pupil_and_polarisation_turns_the_picture():
    """By 90°, in the plane whose rows run along y."""
    one, other = (lens(0.8, aperture=optics.Polygon.regular(6, angle)) for angle in (17.0, 107.0))
    window = {"dx": 0.05e-6, "shape": (41, 41)}
    before = optics.vector_focus(one, WAVE, polarization=(1, 0), **window).psf
    after = optics.vector_focus(other, WAVE, polarization=(0, 1), **window).psf
    wrong = optics.vector_focus(other, WAVE, polarization=(1, 0), **window).psf
    turned = np.rot90(before, -1)
    np.testing.assert_allclose(after, turned, atol=1e-6 * after.max())
    assert np.abs(wrong - turned).max() > 0.05 * after.max()


def test_no_light_is_lost_among_components():
    found = optics.vector_focus(lens(0.7, aperture=HEXAGON), WAVE, dx=0.1e-6, shape=(201, 201))
    assert found.psf.sum() == pytest.approx(found.scalar.sum(), rel=2e-3)
    assert found.intensity[2].sum() > 0.1 * found.psf.sum()


def test_stokes_parameters_say_the_same_as_jones_vectors():
    pupil, window = lens(0.8, aperture=HEXAGON), {"dx": 0.05e-6, "shape": (21, 21)}
    jones = np.array([0.8, 0.6j])
    by_jones = optics.vector_focus(pupil, WAVE, polarization=jones, **window)
    by_stokes = optics.vector_focus(pupil, WAVE, polarization=by_jones.polarization, **window)
    np.testing.assert_allclose(by_jones.polarization, (1, 0.28, 0, 0.96))
    np.testing.assert_allclose(by_stokes.intensity, by_jones.intensity, atol=1e-9 * by_jones.psf.max())
    overlap = np.vdot(by_stokes.field, by_jones.field) / np.vdot(by_jones.field, by_jones.field).real
    assert abs(overlap) == pytest.approx(1)  # turned the other way round, circular light is at right angles to it
    # Half polarised light is half unpolarised.
    plain = optics.vector_focus(pupil, WAVE, **window)
    half = optics.vector_focus(pupil, WAVE, polarization=(2, *by_jones.polarization[1:]), **window)
    mean = (plain.intensity + by_jones.intensity) / 2
    np.testing.assert_allclose(half.intensity, mean, atol=1e-9 * plain.psf.max())
    assert half.field is None
    assert len(half.parts) == 2


def test_one_ring_ends_where_it_ends():
    """A disk of .6 R is a circle of that radius."""
    view = {"dx": 0.4e-6, "shape": (9, 9)}
    part = optics.Pupil(200e-6, thin_lens_focal_length=800e-6, aperture=optics.Rings([0, 0.6]))
    disk = optics.Pupil(120e-6, thin_lens_focal_length=800e-6)
    seen, whole = (optics.vector_focus(one, 550e-9, **view) for one in (part, disk))
    assert seen.intensity == pytest.approx(whole.intensity, rel=1e-4, abs=1e-6 * whole.intensity.max())
