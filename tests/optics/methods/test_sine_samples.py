"""Samples in sines: every aperture, on and off the axis, reaches the tolerance; many zones need few samples."""

import dataclasses
import math

import numpy as np
import pytest

from optics import Annulus, BSplineRelief, Circle, Grid, PointSource, Polygon, Pupil, Slit, Zernike, psf
from optics.elements.beam import Beam
from optics.methods import low_rank as low_rank_module
from optics.methods.low_rank import low_rank
from optics.methods.problem import Problem
from optics.methods.pupil_sampling import GridSamples
from optics.methods.rayleigh_sommerfeld import nodes
from optics.methods.sine_samples import SineSamples, sine_samples
from optics.numerics.precision import precision

WAVE = 550e-9
APERTURES = {"circle": Circle(), "ring": Annulus(0.6), "hexagon": Polygon.regular(6), "slit": Slit(0.8, 0.3)}


def error(beam, window, tolerance):
    """Return the actual error of the PSF by "low_rank", relative to the sum over nodes in float64."""
    problem, exactly = (Problem.from_beam(beam, window, each, "float64") for each in (tolerance, 1e-3 * tolerance))
    (how,), (reference,) = low_rank(problem), nodes(exactly)
    assert isinstance(how.pupil, SineSamples)
    exact = reference.intensity(beam, exactly).numpy()
    return np.linalg.norm(how.intensity(beam, problem).numpy() - exact) / np.linalg.norm(exact)


def bent(radius, distance, aperture, seed):
    rng = np.random.default_rng(seed)
    return Pupil(
        radius, BSplineRelief(2e-6 * rng.random((4, 4))), thin_lens_focal_length=distance, aperture=aperture, n=1.5
    )


@pytest.mark.fast_cases(5)
@pytest.mark.parametrize("name", APERTURES)
@pytest.mark.parametrize("tolerance", [2e-4, 1e-5, 1e-7])
@pytest.mark.parametrize("place", [0.0, 0.7])
def test_half_the_tolerance_holds_for_every_aperture_on_and_off_the_axis(name, tolerance, place):
    """It also holds at 45°, where equal steps in the sine are several times as long on the pupil as on the axis."""
    distance = 100e-6
    source = PointSource(300e-6, (math.atan(place), -math.atan(place / 2)))
    centre = (place * distance, -place / 2 * distance)
    for seed, radius in enumerate((8e-6, 25e-6)):
        beam = Beam(bent(radius, distance, APERTURES[name], seed), source, WAVE, distance)
        window = Grid((33, 25), 0.4e-6, centre)
        assert error(beam, window, tolerance) < tolerance / 2


@pytest.mark.slow
def test_many_zones_take_no_more_samples_than_their_aberrations():
    """Near the focus of a lens, the number of samples depends on the aberrations and on the window, but not on the
    Fresnel number. The PSF agrees with the direct sum.
    """
    counts = []
    for zones in (1e2, 1e3, 1e4):
        for aperture in (0.1, 0.3):
            radius = zones * WAVE / aperture
            distance = radius / aperture
            pupil = Pupil(
                radius, wavefront=Zernike({(2, 2): 0.1, (3, 1): 0.2, (4, 0): 0.1}), thin_lens_focal_length=distance
            )
            beam = Beam(pupil, PointSource(), WAVE, distance)
            problem = Problem.from_beam(beam, Grid.square(129, WAVE / aperture / 8), 1e-3)
            counts.append(len(sine_samples(problem).at))
            assert error(beam, Grid.square(65, WAVE / aperture / 8), 1e-4) < 0.5e-4
    assert max(counts) < 1.15 * min(counts)


def test_samples_spaced_for_the_middle_alias_at_the_rim(monkeypatch):
    """The spacing in sines accounts for the longer steps at the rim. Without this factor, the error exceeds the
    tolerance.
    """
    beam = Beam(bent(40e-6, 60e-6, Circle(), 1), PointSource(), WAVE, 60e-6)
    window = Grid.square(33, 0.3e-6)
    assert error(beam, window, 1e-6) < 0.5e-6

    def too_coarse(problem):
        found = sine_samples(problem)
        stretch = (1 - found.steepest**2) ** -1.5
        across = 2 * math.ceil(found.grid.half_width / (found.grid.dx * stretch)) + 1
        return dataclasses.replace(found, grid=Grid.square(across, found.grid.dx * stretch))

    monkeypatch.setattr(low_rank_module, "sine_samples", too_coarse)
    assert error(beam, window, 1e-6) > 0.5e-6


def test_sines_that_crowd_leave_the_pupil_to_an_even_grid():
    near = Beam(bent(12e-6, 5e-6, Circle(), 0), PointSource(), WAVE, 5e-6)
    problem = Problem.from_beam(near, Grid.square(9, 0.2e-6), 1e-2)
    assert sine_samples(problem) is None
    (how,) = low_rank(problem)
    assert isinstance(how.pupil, GridSamples)


def test_a_grid_that_no_memory_holds_is_not_made():
    """A high Zernike mode increases in the soft edge beyond its circle, so that a grid would need too many samples.
    Rings of nodes still give the PSF.
    """
    bent_far = Pupil(25e-6, thin_lens_focal_length=240e-6, wavefront=Zernike({(28, 0): 0.06}))
    assert (
        sine_samples(Problem.from_beam(Beam(bent_far, PointSource(), WAVE, 240e-6), Grid.square(65, 1e-6), 1e-2))
        is None
    )
    assert psf(bent_far, [WAVE], 240e-6, dx=1e-6, shape=(65, 65), tolerance=1e-2).plan.method == "hankel"


def test_every_sample_stands_for_its_area():
    """For an open pinhole, the weights of the samples add up to its area. Equal steps in sines have areas that differ
    by the factor 1/cos⁴.
    """
    distance, radius = 50e-6, 30e-6
    beam = Beam(Pupil(radius), PointSource(), WAVE, distance)
    for centre in ((0.0, 0.0), (20e-6, -10e-6)):
        problem = Problem.from_beam(beam, Grid((9, 9), 1e-6, centre), 1e-6, "float64")
        samples = sine_samples(problem)
        assert float(np.sum(samples.field(beam, precision("float64")).re.numpy())) == pytest.approx(
            beam.pupil.area, rel=1e-6
        )
