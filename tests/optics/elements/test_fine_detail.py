"""Light scattered off the rays: frequencies of ripples and masks, without the frequencies that slopes already
describe."""

import math

import drjit as dr
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from optics import (
    Annulus,
    BSplineRelief,
    GaussianMask,
    HeightMap,
    MaskMap,
    PixelRelief,
    Pupil,
    WavefrontMap,
    Zernike,
)
from optics.elements.fine_detail import power_beyond, reach_of
from optics.elements.transmittance import Mask

R, WAVE = 30e-6, 550e-9
AT = (np.arange(96) + 0.5) * 2 / 96 - 1


def ripple(cycles):
    """Return samples of cos(2πfx), whose mean square is 1/2."""
    return np.broadcast_to(np.cos(2 * np.pi * cycles * AT), (96, 96))


@pytest.mark.parametrize("cycles", [2.0, 7.0, 12.5])
def test_a_ripple_is_found_where_it_is(cycles):
    beyond = power_beyond(ripple(cycles))
    assert reach_of(beyond, math.sqrt(0.49)) == pytest.approx(cycles, abs=0.25)
    assert reach_of(beyond, math.sqrt(0.51)) == 0
    assert reach_of(power_beyond(ripple(cycles).T), math.sqrt(0.49)) == pytest.approx(cycles, abs=0.25)


def test_cubics_are_no_detail():
    x, y = AT, AT[:, None]
    assert power_beyond(1e6 * (1 + x**3) * (2 - y + y**3)).max() < 1e-12
    assert power_beyond(np.ones((4, 4))).max() == 0
    assert power_beyond((x**2 + y**2) ** 3).max() > 1e-4


@pytest.mark.parametrize("phase", [0.2, 1.0])
@pytest.mark.parametrize("of", ["height", "wavefront", "wide wavefront"])
def test_ripples_in_a_phase_count_by_their_phase(of, phase):
    """A ripple of small amplitude φ [rad] sends φ²/2 of the light to orders at its frequency."""
    waves = phase * WAVE / (2 * math.pi)
    wide = 1.5 if of == "wide wavefront" else 1.0
    pupil = {
        "height": Pupil(R, HeightMap(waves / 0.5 * ripple(8.0))),
        "wavefront": Pupil(R, wavefront=WavefrontMap(waves * ripple(8.0))),
        "wide wavefront": Pupil(R, wavefront=WavefrontMap(waves * ripple(12.0), radius=1.5 * R)),
    }[of]
    assert pupil.scatter(WAVE, 0.45 * phase**2) * R == pytest.approx(8, abs=0.3 * wide)
    assert pupil.scatter(WAVE, 0.55 * phase**2) < 1 / R


def test_a_mask_counts_by_its_share_of_what_it_lets_through():
    """The mask (1 + cos)/2 transmits 3/8 of the light, of which a third (1/8 of all light) is in the orders. The same
    holds if the mask is the middle of a wider map.
    """
    own, wide = MaskMap((1 + ripple(6.0)) / 2), MaskMap((1 + ripple(9.0)) / 2, reach=1.5 * R)
    for mask in (own, wide):
        assert Pupil(R, mask=mask).scatter(WAVE, 0.3) * R == pytest.approx(6, abs=0.3)
        assert Pupil(R, mask=mask).scatter(WAVE, 0.37) * R < 1
    assert Pupil(R, mask=MaskMap(np.full((9, 9), 0.3))).scatter(WAVE, 1e-6) == 0


def test_a_gaussian_mask_spreads_as_a_beam_does():
    """The fraction exp(-2π²w²f²) of the power of a Gaussian beam of waist w lies beyond the frequency f."""
    reach = Pupil(R, mask=GaussianMask(R / 10)).scatter(WAVE, 0.01)
    assert math.exp(-2 * (math.pi * R / 10 * reach) ** 2) == pytest.approx(0.01)


def test_several_share_what_may_be_lost():
    """The elements share the allowed loss. Each of them also scatters light that the others have scattered."""
    mask, wavefront = GaussianMask(R / 10), WavefrontMap(0.2 * WAVE / 2 / math.pi * ripple(8.0))
    both = Pupil(R, mask=mask, wavefront=wavefront).scatter(WAVE, 0.02)
    assert both == pytest.approx(
        Pupil(R, mask=mask).scatter(WAVE, 0.01) + Pupil(R, wavefront=wavefront).scatter(WAVE, 0.01)
    )


def test_what_slopes_tell_scatters_nothing():
    relief = BSplineRelief(1e-5 * np.random.default_rng(0).random((4, 4)))
    lens = HeightMap(1e-4 * (AT**2 + AT[:, None] ** 2))
    for pupil in (Pupil(R), Pupil(R, relief), Pupil(R, lens), Pupil(R, wavefront=Zernike({(4, 0): 1.0}))):
        assert pupil.scatter(WAVE, 1e-6) == 0
    assert Pupil(R, HeightMap(1e-6 * ripple(8.0)), n=1.0).scatter(WAVE, 1e-6) == 0


def test_a_mask_of_ones_own_reaches_as_far_as_its_band():
    class Cosine(Mask):
        def amplitude(self, x, y, radius):
            raise NotImplementedError

        def bandwidth(self, level, radius):
            return 5 / radius if level < 0.5 else 0.0

    assert Cosine().detail(0.16, R) == 5 / R
    assert Cosine().detail(0.36, R) == 0


def test_what_a_mask_scatters_is_a_share_of_what_comes_through_the_opening():
    """A mask scatters equally far if it is evenly dimmed, or if the user has defined it as a function. A bright middle
    covered by a ring has no effect: the ring's faint stripes carry most of its light.
    """
    dim, full = (MaskMap(level * (1 + ripple(8.0)) / 2) for level in (0.1, 1.0))
    reaches = [Pupil(R, mask=mask).scatter(WAVE, 0.02) * R for mask in (dim, full)]
    assert reaches[0] == pytest.approx(reaches[1])
    assert reaches[1] > 7
    assert Pupil(R, mask=Faint()).scatter(WAVE, 0.02) * R == 5
    at = (np.arange(128) + 0.5) / 64 - 1
    middle = np.hypot(at, at[:, None]) < 0.6
    stripes = np.broadcast_to(0.02 * (1 + np.cos(2 * np.pi * 20 * at)), (128, 128))
    mask = MaskMap(gaussian_filter(np.where(middle, 1.0, stripes), 4) * middle + stripes * ~middle)
    assert Pupil(R, mask=mask, aperture=Annulus(0.8)).scatter(WAVE, 0.02) * R > 19


class Faint(Mask):
    """A mask with stripes of five per radius, of amplitude 0.05."""

    def amplitude(self, x, y, radius):
        return 0.05 * (1 + dr.cos(10 * math.pi * x)) / 2

    def bandwidth(self, level, radius):
        return 5 / radius if level < 0.0125 else 0.0


def test_parts_that_scatter_nothing_take_no_share():
    pixels = PixelRelief(1e-7 * np.random.default_rng(0).random((16, 16)))
    alone = Pupil(R, pixels).scatter(WAVE, 0.04)
    assert 0 < alone < math.inf
    assert Pupil(R, pixels, wavefront=Zernike({(2, 0): 0.01})).scatter(WAVE, 0.04) == alone
