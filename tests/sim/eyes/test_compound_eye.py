"""Compound eyes: their fields, photons, ray weights, and errors."""

import numpy as np
import pytest
from scipy.spatial import KDTree

import optics
import sim
from optics.spectra.spectrum import daylight
from sim.eyes.ommatidial_sampling import PATTERNS, OmmatidialSampling

GUIDE = optics.Waveguide(1.9e-6)
SMALL, LARGE = (optics.Ommatidium(optics.FacetLens(d, 0.75 * d), GUIDE) for d in (16e-6, 32e-6))
AHEAD = [[1.0, 0.0, 0.0]]
BUDGET = optics.PhotonBudget()


def test_equal_ommatidia_are_one_kind():
    eye = sim.CompoundEye(sim.hexagonal_patch(1, 5.0), [SMALL, LARGE, SMALL, SMALL, LARGE, SMALL, SMALL])
    kinds, index = eye.kinds
    assert kinds == (SMALL, LARGE)
    assert index.tolist() == [0, 1, 0, 0, 1, 0, 0]
    assert eye.solid_angles[0] == pytest.approx(eye.acceptance(0).integrals)
    assert eye.solid_angles[4] == pytest.approx(eye.acceptance(1).integrals)


def test_photons_are_those_of_the_same_eye_made_of_a_mount():
    """The `photons` of a mount's eye are those of a signal of 1, which a waveguide reaches only with more light than
    that of white.
    """
    eye = sim.CompoundEye(AHEAD, SMALL, photon_budget=BUDGET)
    fov = np.degrees(2 * np.arctan(GUIDE.diameter / 2 / SMALL.lens.object_focal_length()))
    mount = optics.Eye(
        SMALL.pupil,
        (1, 1),
        fov_deg=fov,
        sensor_width=GUIDE.diameter,
        waveguide=GUIDE,
        full_aperture=2 * SMALL.pupil.radius,
        photon_budget=BUDGET,
    )
    accepted = np.asarray(mount.kernel(1)).sum(axis=(1, 2))
    bands = mount.spectral_bands
    white = mount.aperture_throughput * (bands.weights * daylight(bands.wavelengths)) @ accepted
    assert eye.photons[:, 0] == pytest.approx(mount.photons * white, rel=5e-3)


def test_a_facet_with_more_light_catches_more_photons_in_its_own_type():
    types = [[0, 2], [2, 1]]
    eye = sim.CompoundEye([[0.0, 0.0], [40.0, 0.0]], [SMALL, LARGE], types=types, photon_budget=BUDGET)
    assert eye.channels == 2
    for ommatidium, kind in enumerate((SMALL, LARGE)):
        alone = sim.CompoundEye(AHEAD, kind, photon_budget=BUDGET)
        assert eye.photons[:, ommatidium] == pytest.approx(alone.photons[types[ommatidium], 0])


def test_a_wider_facet_with_the_same_focal_length_catches_more_photons():
    """Its acceptance angle hardly changes, but its area is four times as large. The rhabdom accepts the cone of light
    from either facet.
    """
    narrow, wide = (
        sim.CompoundEye(
            AHEAD, optics.Ommatidium(optics.FacetLens(d, 24e-6), optics.Waveguide(4e-6)), photon_budget=BUDGET
        )
        for d in (12e-6, 24e-6)
    )
    assert np.all(wide.photons > 2.5 * narrow.photons)
    assert np.all(wide.photons < 4 * narrow.photons)


def test_the_mirror_image_has_the_same_ommatidia_on_the_other_side():
    eye = sim.CompoundEye([[30.0, 10.0], [60.0, 0.0]], [SMALL, LARGE], types=[[0], [1]]).with_mirror_image()
    assert len(eye) == 4
    assert eye.directions[2:] == pytest.approx(eye.directions[:2] * [1, -1, 1])
    assert eye.ommatidium == (SMALL, LARGE, SMALL, LARGE)
    assert eye.types.ravel().tolist() == [0, 1, 0, 1]
    assert eye.fov_deg == pytest.approx(120)


@pytest.mark.parametrize("rays", [1, 7, 300])
def test_weights_of_rays_sum_to_the_acceptance_in_each_band(rays):
    eye = sim.CompoundEye(sim.hexagonal_patch(1, 5.0), SMALL)
    sensor = OmmatidialSampling(eye).sensor(rays)
    weights = sensor.facets.weights.reshape(7, rays, eye.bands)
    expected = eye.solid_angles / eye.solid_angles.mean(axis=1, keepdims=True)
    assert weights.sum(axis=1) == pytest.approx(expected, rel=1e-5)
    assert np.linalg.norm(sensor.directions, axis=1) == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize(("rays", "error"), [(16, 0.03), (64, 0.01), (1024, 1e-3)])
def test_rays_find_the_light_of_a_smooth_scene(rays, error):
    """Light falls off around a direction up and to the left, as a Gaussian; the reference is a sum over the table."""

    def light(right, up):
        return np.exp(-((right + 0.03) ** 2 + (up - 0.02) ** 2) / (2 * 0.04**2))

    eye = sim.CompoundEye(AHEAD, SMALL)
    sensor, table = OmmatidialSampling(eye).sensor(rays), eye.acceptance(0)
    power = table.values * table.solid_angles
    expected = (power * light(-table.sines, table.sines[:, None])).sum(axis=(1, 2)) / power.sum(axis=(1, 2))
    weights = sensor.facets.weights / sensor.facets.weights.sum(axis=0)
    found = weights.T @ light(*sensor.directions[:, :2].T)
    assert found == pytest.approx(expected, rel=error)


def test_neighbours_have_different_rays():
    sensor = OmmatidialSampling(sim.CompoundEye([[a, 0.0] for a in range(PATTERNS)], SMALL)).sensor(5)
    local = sensor.directions.reshape(PATTERNS, 5, 3)[:, :, 1]  # upwards
    assert len(np.unique(np.round(np.sort(local, axis=1), 5), axis=0)) > PATTERNS / 3


def test_facets_may_touch_but_not_overlap():
    apart = np.degrees(2 * np.arcsin(16e-6 / 400e-6 / 2))
    eye = sim.CompoundEye(sim.hexagonal_patch(1, apart * 1.01), SMALL, radius=400e-6)
    assert OmmatidialSampling(eye).sensor(1).facets.origins == pytest.approx(
        eye.directions[:, [1, 2, 0]] * [-4e-4, 4e-4, 4e-4]
    )
    with pytest.raises(ValueError, match=r"facets \d+ and \d+ overlap: they are 1.52e-05 m apart"):
        sim.CompoundEye(sim.hexagonal_patch(1, apart * 0.95), SMALL, radius=400e-6)
    mixed = [SMALL] * 6 + [LARGE]
    with pytest.raises(ValueError, match="overlap"):
        sim.CompoundEye(sim.hexagonal_patch(1, apart * 1.01), mixed, radius=400e-6)


def test_a_radius_that_is_far_too_small_is_refused_without_a_list_of_all_pairs(monkeypatch):
    """For 30,000 ommatidia, the list would take 7 GB."""
    monkeypatch.setattr(KDTree, "query_pairs", lambda *_, **__: pytest.fail("all pairs are listed"))
    with pytest.raises(ValueError, match=r"overlap: they are .* m apart, less than their diameter, for radius = 1e-06"):
        sim.CompoundEye(sim.whole_head(30.0), SMALL, radius=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"directions": [[10.0, 0.0], [10.0, 0.0]]}, "facets 0 and 1 overlap: they are in the same direction"),
        ({"directions": []}, "no ommatidium: must contain at least one direction"),
        ({"directions": np.broadcast_to(np.zeros(3), (10**7, 3))}, "10000000 ommatidia: must be at most 1000000"),
        ({"ommatidium": [SMALL, LARGE]}, "must be an Ommatidium, or one for each of 1 directions"),
        ({"ommatidium": [3]}, r"ommatidium\[0\] = 3: must be a kind of Ommatidium"),
        ({"types": [[3]]}, r"types has shape \(1, 1\): must be an array \(1, channel\) of indices from 0 to 2"),
        ({"types": [[0], [1]]}, r"types has shape \(2, 1\)"),
        ({"receptors": optics.Receptors((550, 450), ((0, 1),))}, "receptors have a mosaic: must have none"),
        ({"radius": -1.0}, "radius"),
        ({"noise_sigma": -1.0}, "noise_sigma"),
        ({"bands": 0}, "bands"),
        ({"photon_budget": 3}, "photon_budget = 3: must be a kind of PhotonBudget"),
    ],
)
def test_bad_eyes_name_the_argument(options, message):
    with pytest.raises(ValueError, match=message):
        sim.CompoundEye(**{"directions": AHEAD, "ommatidium": SMALL, **options})


def test_the_short_description_names_facets_and_receptors_but_no_directions():
    eye = sim.CompoundEye(AHEAD, SMALL)
    assert repr(eye) == f"<CompoundEye of 1 ommatidium, 0° wide, facet 16 µm, {eye.receptors!r}>"
    mixed = sim.CompoundEye([[0.0, 0.0], [40.0, 0.0]], [LARGE, SMALL])
    assert repr(mixed) == f"<CompoundEye of 2 ommatidia, 80° wide, first facet 32 µm, {eye.receptors!r}>"
