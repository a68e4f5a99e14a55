"""Figures of an eye against closed forms, and its view against rays."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from evolve.analysis.white_light import WhiteLight
from evolve.episodes.recorder import record
from evolve.report import eye_figures
from evolve.report.eye_figures import diffraction_limit, relief_heights
from evolve.report.markup import html
from evolve.report.views import through_optics
from optics.spectra.bands import daylight


@pytest.mark.slow
def test_noise_free_view_is_what_the_animal_sees(run):
    """The convolution of the fine image agrees with rays drawn from the receptive fields."""
    calm = replace(run.config, eye=replace(run.config.eye, noise_sigma=0.0, rays_per_receptor=64))
    episode = record(replace(run, config=calm), radiance_every=64)
    eye = episode.eyes.eye()
    views = np.array([[through_optics(eye, one) for one in frame] for frame in episode.radiance])
    seen = episode.signals[episode.radiance_frames]
    assert seen.max() > 0.02  # at most a² = 0.09
    # the remaining error comes from edges of objects between 64 rays, and from the scene beyond the image, which the
    # view can only estimate
    error = np.sqrt(np.mean((views - seen) ** 2))
    assert error < 0.03 * seen.max()
    for turned in (views[..., ::-1, :], views[..., ::-1]):
        assert np.sqrt(np.mean((turned - seen) ** 2)) > 3 * error


def test_height_map_is_the_pupils():
    """A paraboloid is in the space of the genes, and its height is a closed form."""
    radius, curvature = 30e-6, 8e3
    relief = optics.BSplineRelief.paraboloid(20e-6, curvature, radius)
    heights, inside = relief_heights(optics.Pupil(radius, relief))
    n = len(heights)
    x = radius * ((np.arange(n) + 0.5) / n * 2 - 1)
    np.testing.assert_allclose(heights, 20e-6 - curvature * (x[:, None] ** 2 + x**2) / 2, atol=1e-15)
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.01)


@pytest.mark.parametrize("aperture", [optics.Slit(0.4, 1.6), optics.Polygon.regular(3, 90.0), optics.Annulus(0.5)])
def test_height_map_ends_where_the_pupil_does(aperture):
    _, inside = relief_heights(optics.Pupil(30e-6, aperture=aperture))
    # edges are resolved to pixels of 1/80 of the radius
    assert 4 * inside.mean() == pytest.approx(aperture.area, rel=0.03)


def test_mtf_of_a_perfect_lens_is_the_diffraction_limit():
    """The PSF's window omits up to 1 % of the light, which raises the contrast by the same share."""
    eye = optics.Eye(optics.Pupil(20e-6, thin_lens_focal_length=100e-6 / np.tan(np.radians(22.5))), (15, 15), 45.0)
    light = WhiteLight.from_eye(eye)
    frequency = np.array([0.1, 0.3, 0.5, 0.8]) * optics.mtf(light.psf).cutoff.max()
    contrast = optics.mtf(light.white).profile(frequency)[0]
    np.testing.assert_allclose(contrast, diffraction_limit(light, frequency), atol=0.01)


def test_diffraction_limit_weighs_the_bands_by_their_light():
    """The contrast is 0 beyond the shortest band's cutoff. At the cutoff of the longest band, only the shorter bands
    contribute.
    """
    eye = optics.Eye(optics.Pupil(20e-6, thin_lens_focal_length=241e-6), (15, 15), 45.0, bands=2)
    light = WhiteLight.from_eye(eye)
    short, long = optics.mtf(light.psf).cutoff
    s = long / short
    weights = eye.spectral_bands.weights.mean(axis=0) * daylight(eye.spectral_bands.wavelengths)
    expected = weights[0] * 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    np.testing.assert_allclose(diffraction_limit(light, np.array([0.0, long, short])), [1, expected, 0], atol=1e-6)


def test_height_map_lies_the_right_way_up():
    points = np.zeros((4, 4))
    points[3] = 1e-6  # row index and y grow together
    heights, _ = relief_heights(optics.Pupil(30e-6, optics.BSplineRelief(points)))
    assert heights[-1].mean() > 100 * max(heights[0].mean(), 1e-12)


@pytest.mark.slow
def test_the_mtf_is_drawn_beside_its_limit_up_to_the_cutoff(run, monkeypatch):
    drawn = []
    monkeypatch.setattr(eye_figures, "inline", lambda figure, *_: drawn.append(figure.axes[0]) or html("picture"))
    light = WhiteLight.from_eye(
        optics.Eye(optics.Pupil(20e-6, thin_lens_focal_length=optics.Eye().sensor_distance), (5, 5))
    )
    eye_figures._mtf(light)
    limit, contrast, nyquist = (line.get_xydata() for line in drawn[0].lines)
    np.testing.assert_allclose(contrast[:, 0], limit[:, 0])
    np.testing.assert_allclose(limit[-1, 0], optics.mtf(light.psf).cutoff.max() * light.per_degree)
    assert contrast[0, 1] > 0.9 > contrast[-1, 1]
    assert (contrast[:, 1] <= limit[:, 1] + 0.03).all()
    np.testing.assert_allclose(nyquist[:, 0], light.per_degree / (2 * light.eye.receptor_pitch))


def test_a_figure_that_cannot_be_known_is_one_line(monkeypatch):
    """A figure that cannot be computed is replaced by one line, and the others are drawn."""

    def refused(*_, **__):
        raise optics.AccuracyError("the MTF needs 4097 x 4097 samples")

    class Animal:
        refractive_index = 1.5

        def eye(self, *_):
            pupil = optics.Pupil(20e-6, thin_lens_focal_length=optics.Eye().sensor_distance)
            return optics.Eye(pupil, (5, 5))

    monkeypatch.setattr(optics, "mtf", refused)
    page = str(eye_figures.eye_figures(Animal(), None))
    assert "<b>Contrast.</b> It cannot be computed: the MTF needs 4097 x 4097 samples." in page
    assert page.count("<figure") == 3
    monkeypatch.setattr(WhiteLight, "from_eye", refused)
    page = str(eye_figures.eye_figures(Animal(), None))
    assert "<b>Point spread function.</b> It cannot be computed" in page
    assert page.count("<figure") == 1
