"""Eyes of animals: published angles and acuities, and eyes that other functions accept."""

import math

import numpy as np
import pytest

import optics
from optics import animals
from optics.animals.camera_eyes import goldfish_lens
from optics.animals.compound_eyes import HONEYBEES

COMPOUND = {
    "honeybee": (331, 2.1),
    "fruit_fly": (721, 5.0),
    "blowfly": (1261, 1.3),
    "dragonfly": (1261, 0.24),
    "megalopta": (331, 1.4),
}
CAMERA = {"human": 69.7, "mouse": 0.5, "eagle": 140.0, "goldfish": 60 / 26, "jumping_spider": 12.5}


@pytest.mark.parametrize("name", COMPOUND)
def test_compound_eyes_have_directions_and_one_ommatidium(name):
    eye = getattr(animals, name)()
    count, spacing = COMPOUND[name]
    assert isinstance(eye, optics.AppositionEye)
    assert eye.directions.shape == (count, 2)
    gaps = np.linalg.norm(eye.directions - eye.directions[count // 2], axis=1)
    assert np.sort(gaps)[1:7] == pytest.approx(np.full(6, math.radians(spacing)))
    assert getattr(animals, name)(rings=1).directions.shape == (7, 2)


@pytest.mark.parametrize("species", HONEYBEES)
def test_honeybees_differ_in_their_facets(species):
    eye, facet = animals.honeybee(species, rings=1), HONEYBEES[species]
    assert eye.ommatidium.lens.diameter == facet.diameter
    assert eye.ommatidium.lens.object_focal_length() == pytest.approx(facet.focal_length)
    assert eye.ommatidium.rhabdom.length == facet.length


def test_a_bees_facet_sees_a_scene():
    """A bar one tenth of the ommatidia wide dims only the ommatidia that look at it."""
    eye = animals.honeybee(rings=4)
    signals = eye.see(lambda x, y: np.where(np.abs(x) < math.radians(2.5), 0.0, 1.0) + 0 * y)
    middle = np.abs(eye.directions[:, 0]) < 1e-9
    assert signals[middle].max() < 0.35
    assert signals[np.abs(eye.directions[:, 0]) > math.radians(6)].min() > 0.9


@pytest.mark.parametrize("name", CAMERA)
def test_camera_eyes_resolve_the_published_grating(name):
    eye = getattr(animals, name)()
    assert isinstance(eye, optics.Eye)
    per_degree = eye.resolution[1] / eye.fov_deg  # small fields: angles are proportional to lengths
    assert per_degree / 2 == pytest.approx(CAMERA[name], rel=0.05)
    assert eye.relative_aperture == pytest.approx(1.0)


def test_the_smallest_pupil_of_an_eagle_passes_157_cycles_per_degree():
    assert math.radians(2 * animals.eagle().pupil.radius / 550e-9) == pytest.approx(157)


def test_an_eye_of_a_mouse_gives_signals_of_two_receptor_types():
    eye = animals.mouse(8)
    assert eye.see(np.ones((eye.bands, 16, 16)), 2).shape == (2, 8, 8)


def test_the_two_kinds_of_spider_eyes():
    fine, coarse = (animals.jumping_spider(eye=eye) for eye in ("principal", "secondary"))
    assert fine.fov_deg / fine.resolution[1] == pytest.approx(2.4 / 60, rel=1e-3)
    assert coarse.fov_deg / coarse.resolution[1] == pytest.approx(0.7, rel=0.02)


def test_the_lens_of_a_goldfish_has_matthiessens_ratio_and_the_media_of_a_fish():
    lens = goldfish_lens()
    assert lens.focal_length() / lens.radius == pytest.approx(2.5, rel=1e-6)
    water = float(optics.medium("water").at(550e-9))
    assert float(lens.index(lens.radius)) == pytest.approx(water)
    core = [float(lens.index(0.0, at)) for at in (450e-9, 550e-9, 650e-9)]
    assert core == sorted(core, reverse=True)
    # Perlmann & Longsworth 1948: the increment over water at 450 nm and at 650 nm, relative to that at 550 nm.
    over = [
        value - float(optics.medium("water").at(at)) for value, at in zip(core, (450e-9, 550e-9, 650e-9), strict=True)
    ]
    law = [0.940 + 2e4 / nm**2 for nm in (450, 550, 650)]
    assert over[0] / over[1] == pytest.approx(law[0] / law[1], rel=3e-3)
    assert over[2] / over[1] == pytest.approx(law[2] / law[1], rel=3e-3)


def test_cirolana_accepts_light_from_a_wide_angle():
    assert animals.cirolana().describe().acceptance_angle_deg == pytest.approx(45, rel=0.07)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: animals.honeybee("melifera"), "species"),
        (lambda: animals.honeybee(rings=61), "rings"),
        (lambda: animals.jumping_spider(eye="median"), "eye"),
        (lambda: animals.human(0), "receptors_across"),
        (lambda: animals.human(pupil_diameter=9e-3), "aperture_radius"),
        (lambda: animals.goldfish(radius=-1.0), "radius"),
    ],
)
def test_invalid_arguments_raise(call, message):
    with pytest.raises(ValueError, match=message):
        call()
