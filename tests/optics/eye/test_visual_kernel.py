"""Size of the window that kernels are summed from: the share of rays in it, and extra samples around it."""

import numpy as np
import pytest

from optics import BSplineRelief, Eye, PointSource, Pupil
from optics.eye import visual_kernel
from optics.eye.cell_integrals import Tiles, cell_integrals
from optics.eye.visual_kernel import BESIDE, _half_side, spot_of
from optics.numerics.grid import Grid
from optics.point_spread.pictures import pictures


@pytest.mark.parametrize("share", [0.5, 0.9, 0.995])
def test_a_square_holds_the_share_of_rays_and_no_more(share):
    relief = BSplineRelief(np.random.default_rng(2).random((4, 4)) * 1e-5)
    slopes = Pupil(30e-6, relief).slopes(550e-9, PointSource())
    behind, centre = (300e-6, 1.33), (4e-6, -9e-6)
    half = _half_side(slopes, behind, centre, share)
    x, y = slopes.rays(*behind)
    farthest = np.maximum(abs(x - centre[0]), abs(y - centre[1]))
    assert np.mean(farthest < half) <= share <= np.mean(farthest <= half)


def test_splines_err_at_their_ends():
    """Light is as bright at the last cell as in the middle, and has 3.5 samples per wave. Four additional samples at
    either end reduce the error there by a factor of 24; the test requires a factor of 10.
    """
    size, count, waves = 4.0, 15, 1 / 3.5
    edges = (np.arange(count + 1) - count / 2) * size
    exact = size + np.diff(np.sin(2 * np.pi * waves * edges)) / (2 * np.pi * waves)

    def error(beside):
        samples = Grid((1, int(size * count) + 2 * beside + 1), 1.0)
        light = 1 + np.cos(2 * np.pi * waves * samples.x)
        return abs(cell_integrals(light.size, 1.0, Tiles(count, size, False)) @ light - exact).max()

    assert error(BESIDE) < 0.1 * error(0)


def test_kernels_have_samples_beside_the_square_that_holds_their_light(monkeypatch):
    spots, windows = [], []

    def spot(*args):
        spots.append(spot_of(*args))
        return spots[-1]

    def noted(requests, **how):
        windows.extend(request.problem.window for request in requests)
        return pictures(requests, **how)

    eye = Eye(Pupil(15e-6, thin_lens_focal_length=250e-6), (3, 3), 45.0)
    assert eye.spectral_bands.wavelengths.size  # this choice computes kernels of its own
    monkeypatch.setattr(visual_kernel, "spot_of", spot)
    monkeypatch.setattr(visual_kernel, "pictures", noted)
    eye.kernel(16)
    assert windows
    for window in windows:
        beside = (window.own_half_width - spots[-1].half) / window.dx
        assert 4 - 1e-9 <= beside < 5.5, "half a sample belongs to the outermost one"
