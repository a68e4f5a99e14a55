"""The kernel of soft edges: its spectrum is 1 in the passband and 0 in the stopband, up to the ripple, and the width of
the transition needs the fewest samples.
"""

import numpy as np
import pytest
from scipy import signal
from scipy.special import j0, j1

from optics.apertures.soft_edge import SoftEdge, kaiser_beta
from optics.numerics.quadrature import gauss_legendre


def spectrum(edge, f):
    """Return the Hankel transform of the kernel at the frequency f, by quadrature."""
    u, weight = gauss_legendre(300)
    r = edge.reach * u
    return j0(2 * np.pi * np.outer(f, r)) @ (edge.reach * weight * edge.ring(r))


@pytest.mark.parametrize("ripple", [1e-1, 1e-3, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("passband", [0.0, 0.3, 1.0, 3.0, 20.0, 150.0])
def test_spectrum_keeps_its_ripple(ripple, passband):
    edge = SoftEdge.cheapest(passband, ripple, 0.25)
    assert np.abs(spectrum(edge, np.linspace(0, passband, 200)) - 1).max() < ripple
    assert np.abs(spectrum(edge, np.linspace(edge.stopband, 2 * edge.stopband, 400))).max() < ripple


def test_kaisers_rule_alone_misses_the_ripple():
    """Kaiser's rule is for one dimension. The kernel needs a margin, because side lobes from all directions of the
    plane add up at frequency 0.
    """
    edge = SoftEdge.cheapest(0.5, 1e-8, 0.25)
    bare = SoftEdge(0.5, 0.5 + kaiser_beta(1e-8) / np.pi / 0.25, (1e-8 * 9) ** (1 / 1.08))
    assert bare.reach == pytest.approx(edge.reach)
    assert np.abs(spectrum(bare, np.linspace(0, 0.5, 50)) - 1).max() > 5e-8


@pytest.mark.parametrize("half_widths", [(1.0, 1.0), (0.05, 1.0), (0.3, 0.6)])
def test_transition_is_the_cheapest(half_widths):
    edge = SoftEdge.cheapest(50.0, 1e-5, 0.25, half_widths)

    def samples(scale):
        reach = edge.reach / scale
        transition = scale * (edge.stopband - edge.passband)
        return np.prod([h + reach for h in half_widths]) * (2 * edge.passband + transition) ** 2

    assert edge.reach < 0.25
    assert samples(1.0) < min(samples(0.97), samples(1.03))


def test_reach_has_a_limit():
    assert SoftEdge.cheapest(0.5, 1e-6, 0.25).reach == pytest.approx(0.25)
    assert SoftEdge.cheapest(0.5, 1e-6, 0.1).reach == pytest.approx(0.1)


@pytest.mark.parametrize("attenuation", [30.0, 45.0, 49.9, 50.1, 80.0])
def test_kaisers_rule_is_his(attenuation):
    """For an attenuation below about 25 dB, our value is 1, in contrast to Kaiser's."""
    assert kaiser_beta(10 ** (-attenuation / 20)) == pytest.approx(signal.kaiser_beta(attenuation), rel=1e-9)
    assert kaiser_beta(0.1) == 1.0


@pytest.mark.parametrize(("passband", "ripple"), [(0.01, 0.1), (3.0, 1e-3), (200.0, 1e-3), (100.0, 1e-10)])
def test_the_kernel_is_a_jinc_under_its_window_and_sums_to_one(passband, ripple):
    """The relative accuracy also holds near the axis."""
    edge = SoftEdge(passband, 1.01 * passband + 0.5, ripple)
    r = np.append(np.linspace(0, edge.reach, 5000), edge.reach * 10.0 ** np.arange(-9, 0))
    cutoff = (edge.passband + edge.stopband) / 2
    jinc = j1(2 * np.pi * cutoff * r) * np.i0(edge.beta * np.sqrt(1 - (r / edge.reach) ** 2))
    u, weight = gauss_legendre(int(60 + 8 * edge.cycles + edge.beta))
    assert np.sum(weight * edge.reach * edge.ring(edge.reach * u)) == pytest.approx(1, abs=1e-12)
    scale = edge.ring(r) @ jinc / (jinc @ jinc)
    np.testing.assert_allclose(edge.ring(r), scale * jinc, rtol=1e-11, atol=1e-13 * np.abs(edge.ring(r)).max())
    assert edge.ring(r[-9:]) == pytest.approx(scale * jinc[-9:], rel=1e-11)
