"""The brightness bands of the worlds, and the page about them."""

from pathlib import Path

import numpy as np

from sim.worlds.detection import BAND_EDGES_DEG
from validation.pages.page import blanked
from validation.sim import equal_brightness
from validation.sim.equal_brightness import contrast, difference, light_seen

PAGE = Path(__file__).parents[3] / "docs/validation/equal_brightness.md"


def test_shipped_bands_are_balanced_and_even_ones_are_not():
    """Objects with bands of equal width differ by the noise level if an eye just misses their top."""
    assert abs(difference(BAND_EDGES_DEG, 2.0).mean()) < 0.2
    assert abs(difference(np.arange(1, 6) * 30.0, 2.0).mean()) > 0.8


def test_light_is_lamberts_seen_through_a_square_field():
    """For a distant sphere with one light behind the viewer, the mean of the cosine over the visible disc is 2/3."""
    (towards, level) = np.array([1.0, 0, 0]), 1.0
    lights, equal_brightness._lights = equal_brightness._lights, lambda: [(towards, level)]
    light_seen.cache_clear()
    try:
        by_latitude, by_longitude = light_seen(20.0, 0.0)
    finally:
        equal_brightness._lights = lights
        light_seen.cache_clear()
    # heading pi: the viewer stands on the side of the light
    facing = len(by_latitude) // 2
    disc = np.pi * (0.5 / 19.8) ** 2 / (2 * np.tan(np.radians(22.5))) ** 2
    np.testing.assert_allclose(by_latitude[facing].sum(), 2 / 3 * disc, rtol=0.05)  # 11 rays across the disc
    np.testing.assert_allclose(by_longitude.sum(axis=1), by_latitude.sum(axis=1))
    assert by_latitude[0].sum() < 0.02 * disc  # the other side is dark


def test_contrast_of_even_light_depends_on_the_stripes_share():
    light = np.ones((1, equal_brightness.BINS))
    np.testing.assert_allclose(contrast(light, [0.5]), 0, atol=1e-9)
    np.testing.assert_allclose(contrast(light, [0.75]), 0.5 * equal_brightness.BINS * 0.85 / 2)


def test_page_is_this_scripts(tmp_path):
    assert equal_brightness.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert blanked((tmp_path / "equal_brightness.md").read_text(encoding="utf-8")) == blanked(
        PAGE.read_text(encoding="utf-8")
    )
