"""sRGB against published values of IEC 61966-2-1."""

import numpy as np

from sim.scene.color import decode_srgb, encode_srgb


def test_known_values():
    np.testing.assert_allclose(decode_srgb(0.5), 0.214041, atol=1e-6)
    np.testing.assert_allclose(decode_srgb(np.array([0, 1.0])), [0, 1])
    # The two branches meet.
    np.testing.assert_allclose(decode_srgb(0.04045), 0.04045 / 12.92)
    np.testing.assert_allclose(decode_srgb(0.0404500001), 0.04045 / 12.92, rtol=1e-4)


def test_colour_science_agrees():
    from colour.models import eotf_sRGB

    x = np.linspace(0, 1, 101)
    np.testing.assert_allclose(decode_srgb(x), eotf_sRGB(x), atol=1e-12)
    np.testing.assert_allclose(encode_srgb(decode_srgb(x)), x, atol=1e-6)
