"""The best pupil: measures against closed forms, the sharpest pinhole against Rayleigh's, and the page against its
store."""

from pathlib import Path

import numpy as np
import pytest

from experiments.best_pupil import RESOLUTION, SCENE, Row, best, computed, measures, page, rayleigh
from experiments.store import Origin, read_rows
from optics.numerics import backend

RESULTS = Path(__file__).parents[2] / "docs/results"


def test_measures_of_a_perfect_image_are_closed_forms():
    quality, contrast, bits = measures(np.ones(257), 0.25, 0.01)
    assert contrast == pytest.approx(1 - 0.01 / 0.25)
    assert quality == pytest.approx(0.25 * contrast)
    # A fraction π/4 of the receptors' square of frequencies lies within Nyquist's circle; half a logarithm per
    # receptor.
    assert bits == pytest.approx(np.pi / 4 * 0.5 * np.log2(1 + (SCENE * 0.25 / 0.01) ** 2), rel=1e-4)


def test_contrast_below_the_noise_counts_for_nothing():
    falling = np.linspace(1, 0, 1001)
    assert measures(falling, 1.0, 0.5)[1] == pytest.approx(0.125, rel=1e-3)
    assert measures(falling, 0.1, 0.2)[:2] == (0.0, 0.0)


def test_optimum_is_that_of_the_parabola():
    apertures = np.geomspace(0.05, 0.5, 8)
    rows = [Row("hole", a, 0.01, 0.0, 1 - np.log(a / 0.21) ** 2, a, 0.0, 0.0, 0.0) for a in apertures]
    assert best(rows, "hole", 0.01, "contrast") == pytest.approx(0.21)
    assert best(rows, "hole", 0.01, "bits") == 0.5, "the best value is the last one tried"


@pytest.mark.slow
def test_with_little_noise_the_best_hole_is_rayleighs_pinhole():
    """Rayleigh judged sharpness by eye at one wavelength, so the criterion differs by up to 15 %. Geometry alone would
    close the pupil, and diffraction alone would open it."""
    backend.require()
    rows = computed(tuple(np.geomspace(0.07, 0.2, 6)), (0.001,))
    assert best(rows, "hole", 0.001, "contrast") == pytest.approx(rayleigh(), rel=0.15)
    assert best(rows, "lens", 0.001, "contrast") == pytest.approx(0.2), "a lens gains from every increase in aperture"


@pytest.mark.slow
def test_stripes_are_seen_best_where_a_disk_of_blur_takes_least():
    """Behind a pinhole, light falls on a disk as wide as the pinhole. With the relative aperture a, the width L of the
    retina and the frequency f of the stripes, their amplitude is a² 2 J1(x) / x, where x = π a L f. It is greatest at
    the first zero of J0. The tolerance is 8 %, because the disk behind a pinhole of three Fresnel zones is brighter in
    its middle. It is 25 % for the narrowest stripes, because diffraction determines the width of the disk if the
    pinhole contains less than one zone. If the width of the stripes were wrong by a factor of two, so would be the
    aperture.
    """
    backend.require()
    rows = computed(tuple(np.geomspace(0.06, 0.9, 25)), (0.01,))
    for width, tolerance in ((1, 0.25), (2, 0.08), (4, 0.08)):
        frequency = RESOLUTION / (2 * width)  # pairs of stripes per width of the retina
        found = best(rows, "hole", 0.01, f"stripes_{width}")
        assert found == pytest.approx(2.405 / (np.pi * frequency), rel=tolerance)
        assert best(rows, "lens", 0.01, f"stripes_{width}") == pytest.approx(0.9)
    beyond = [row for row in rows if row.pupil == "hole" and row.relative_aperture > 4.2 / (np.pi * RESOLUTION / 4)]
    assert beyond
    assert max(row.stripes_2 for row in beyond) == 0.0, "contrast is reversed"


def test_page_is_what_its_store_says():
    rows, origin = read_rows(Row, RESULTS / "data/best_pupil.csv"), Origin.read(RESULTS / "data/best_pupil.json")
    assert page(rows, origin).markdown == (RESULTS / "best_pupil.md").read_text()
