"""The power of an eye's glass, relative to the power that focuses far objects."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evolve.config.run_config import EyeConfig
from evolve.genome.phenotype import Phenotype
from experiments.glass import blur, power
from optics import BSplineRelief

EYE = EyeConfig()
FOV = 45.0
ANIMAL = Phenotype(
    *(1, 0.0, FOV, (15, 15)),
    relative_aperture=0.4,
    relief=(0.5,) * 16,
    refractive_index=1.6,
    memory_frames=1,
    neurons=8,
)


def paraboloid(strength, radius, index=1.6):
    """Genes of the paraxial lens with `strength` times the power that focuses distant objects; a patch represents it
    exactly.
    """
    distance = EYE.sensor_width / (2 * math.tan(math.radians(FOV) / 2))
    relief = BSplineRelief.paraboloid(0.5, strength / ((index - 1) * distance * EYE.relief_height), radius)
    return tuple(relief.control_points.ravel())


@pytest.mark.parametrize("strength", [1.0, 0.3, -0.5])
def test_paraxial_lens_has_its_power(strength):
    lens = replace(ANIMAL, relief=paraboloid(strength, 0.5 * 0.4 * EYE.sensor_width))
    assert power(lens, EYE) == pytest.approx(strength, rel=1e-9)


def test_power_is_that_of_width_index_and_field():
    lens = replace(ANIMAL, relief=paraboloid(1.0, 0.5 * 0.4 * EYE.sensor_width))
    assert power(replace(lens, relative_aperture=0.8), EYE) == pytest.approx(0.25), "the same glass, twice as wide"
    assert power(replace(lens, refractive_index=1.3), EYE) == pytest.approx(0.5)
    assert power(replace(lens, refractive_index=1.0), EYE) == 0.0
    nearer = math.tan(math.radians(FOV / 2)) / math.tan(math.radians(FOV))
    assert power(replace(lens, fov_deg=2 * FOV), EYE) == pytest.approx(nearer)


def test_what_is_no_bowl_has_no_power():
    tilt = np.add.outer(np.zeros(4), np.linspace(0, 1, 4))
    saddle = np.array(paraboloid(1.0, 1e-4)).reshape(4, 4)
    saddle = saddle.mean(axis=0)[None, :] - saddle.mean(axis=1)[:, None]
    for relief in (tilt, saddle):
        assert power(replace(ANIMAL, relief=tuple(relief.ravel())), EYE) == pytest.approx(0.0, abs=1e-9)
    for height in (0.0, 0.5, 0.7):
        assert power(replace(ANIMAL, relief=(height,) * 16, relative_aperture=0.05), EYE) == 0.0, "exactly zero"


def test_finer_reliefs_and_no_glass():
    """A paraboloid's heights at the cells' centres make the same lens, up to the error of the spline through them."""
    side, radius = 12, 0.5 * 0.4 * EYE.sensor_width
    at = ((np.arange(side) + 0.5) / side * 2 - 1) * radius
    distance = EYE.sensor_width / (2 * math.tan(math.radians(FOV) / 2))
    heights = 0.5 - np.add.outer(at**2, at**2) / (2 * 0.6 * distance * EYE.relief_height)
    assert power(replace(ANIMAL, relief=tuple(heights.ravel())), EYE) == pytest.approx(1.0, rel=0.01)
    assert math.isnan(power(replace(ANIMAL, relief=None, relative_aperture=None, refractive_index=None), EYE))


def test_retinas_as_wide_as_their_receptors_have_the_same_power():
    """15 receptors of 4 µm make 60 µm of retina, whichever of the two settings is given."""
    lens = replace(ANIMAL, relief=paraboloid(1.0, 0.5 * 0.4 * EYE.sensor_width))
    pitched, wide = replace(EYE, receptor_pitch=4e-6), replace(EYE, sensor_width=60e-6)
    assert power(lens, pitched) == pytest.approx(power(lens, wide)) != pytest.approx(power(lens, EYE))


@pytest.mark.parametrize("strength", [-0.5, 0.0, 0.8, 1.0])
def test_paraxial_lens_blurs_by_what_it_falls_short_of_its_power(strength):
    """Rays through a disk of radius R land on a disk of radius |1 - P| R, whose root mean square is R / sqrt(2)."""
    radius = 0.4 * 15 / 2  # in receptors
    lens = replace(ANIMAL, relief=paraboloid(strength, 0.5 * 0.4 * EYE.sensor_width))
    expected = abs(1 - strength) * radius / math.sqrt(2)
    assert blur(lens, EYE) == pytest.approx(expected, abs=2e-3 * radius)  # 161 pixels across


def test_a_prism_moves_a_point_and_does_not_blur_it_more():
    tilt = np.add.outer(np.zeros(4), np.linspace(0, 0.5, 4))
    flat, prism = (replace(ANIMAL, relief=tuple(relief.ravel())) for relief in (0 * tilt, tilt))
    assert blur(prism, EYE) == pytest.approx(blur(flat, EYE), rel=1e-9)
    cylinder = (
        np.array(paraboloid(1.0, 0.5 * 0.4 * EYE.sensor_width)).reshape(4, 4).mean(axis=0)[None].repeat(4, axis=0)
    )
    assert 0.6 < blur(replace(ANIMAL, relief=tuple(cylinder.ravel())), EYE) / blur(flat, EYE) < 0.8, (
        "a cylinder leaves sqrt(1/2) of the blur"
    )
    assert math.isnan(blur(replace(ANIMAL, relief=None, relative_aperture=None, refractive_index=None), EYE))
