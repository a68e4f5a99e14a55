"""Light from a facet in a rhabdom's modes: against the paraxial formulas, and the field in the focus itself."""

import math

import numpy as np
import pytest
from scipy.special import jv

import optics
from optics import FacetLens, Ommatidium, Pupil, Waveguide, snyder_acceptance
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.rayleigh_sommerfeld import direct_sum
from optics.numerics.precision import precision
from optics.ommatidia import radiation
from optics.ommatidia.ommatidium import coupled_modes

WAVE, D, FOCAL = 500e-9, 25e-6, 50e-6  # a fly's facet at f/2
LENS = Pupil(D / 2, thin_lens_focal_length=1.34 * FOCAL, medium_n=1.34, object_n=1.0)


def formulas(mode, angles):
    """Return the power in a mode, up to a constant factor, by the published formulas. The overlap of Fraunhofer's field
    in the focal plane with the mode ψ is ∫ F(ρ) J_l(kρθ) ρ dρ over the facet, with F(ρ) = ∫ ψ(r) J_l(krρ/f) r dr.
    """
    k = 2 * math.pi / WAVE
    r, rho = np.linspace(0, 12e-6, 3001), np.linspace(0, D / 2, 801)
    psi = mode.field(r, 0.0) * r
    spread = np.trapezoid(psi * jv(mode.l, k / FOCAL * np.outer(rho, r)), r, axis=1)
    return np.trapezoid(spread * rho * jv(mode.l, k * np.outer(angles, rho)), rho, axis=1) ** 2


def width(angles, seen):
    """Return the full width at half maximum of a symmetric curve, given on one side of the axis."""
    last = np.flatnonzero(seen >= seen.max() / 2)[-1]
    share = (seen[last] - seen.max() / 2) / (seen[last] - seen[last + 1])
    return 2 * math.degrees(angles[last] + share * (angles[last + 1] - angles[last]))


def test_acceptance_angle_of_a_fly_is_that_of_the_formulas():
    """A facet of 25 µm at f/2 is in front of a rhabdomere of 1.4 µm, which has one mode at 500 nm: Δρ = 1.398°. The
    formulas are paraxial and have an error of 2e-3 at f/2.
    """
    eye = Ommatidium(LENS, Waveguide(1.4e-6))
    [mode] = eye.modes(WAVE)
    angles = np.radians(np.linspace(0, 1.5, 3001))
    found = math.degrees(eye.acceptance_angle(WAVE))
    assert found == pytest.approx(1.398, rel=1e-3)
    assert width(angles, formulas(mode, angles)) == pytest.approx(found, rel=3e-3)
    # The result is neither the Airy disk's nor the rhabdomere's width, nor both as Gaussians.
    assert abs(math.degrees(snyder_acceptance(D, FOCAL, 1.4e-6, WAVE)) - 1.398) > 0.5
    assert math.degrees(1.03 * WAVE / D) < 1.2


@pytest.mark.slow
def test_wide_slow_lenses_are_the_formulas_limit():
    """The formulas ignore oblique rays, and the phase e^{iknx²/2f} in the focal plane. A pupil 16 times as wide at f/8,
    with a rhabdom 4 times as wide and of the same V, has the same pattern at a sixteenth of the angles.
    """
    lens = Pupil(16 * D / 2, thin_lens_focal_length=64 * 1.34 * FOCAL, medium_n=1.34, object_n=1.0)
    core = math.sqrt(1.34**2 + (1.363**2 - 1.34**2) / 16)
    eye = Ommatidium(lens, Waveguide(4 * 1.4e-6, core, 1.34))
    angles = np.radians(np.linspace(0, 1.5, 3001))
    [mode] = Ommatidium(LENS, Waveguide(1.4e-6)).modes(WAVE)
    found = 16 * math.degrees(eye.acceptance_angle(WAVE))
    assert found == pytest.approx(width(angles, formulas(mode, angles)), rel=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("diameter", [1.4e-6, 2.2e-6])
def test_every_mode_takes_what_the_formulas_say(diameter):
    """The directions are along x, where the sine modes receive no light. Powers are relative to the peak of the first
    mode.
    """
    eye, angles = Ommatidium(LENS, Waveguide(diameter)), np.radians(np.linspace(0, 2.5, 12))
    found = eye.mode_power(angles, 0 * angles, WAVE)
    expected = np.array([0 * angles if mode.sine else formulas(mode, angles) for mode in eye.modes(WAVE)])
    np.testing.assert_allclose(found / found.max(), expected / expected.max(), atol=0.015)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("wavefront", [None, optics.Zernike({(1, 1): 0.06, (3, -1): 0.08})], ids=["even", "lopsided"])
@pytest.mark.parametrize("angle", [(0.0, 0.0), (0.02, -0.01)])
def test_modes_take_the_overlap_with_the_field_in_the_focus(angle, wavefront):
    """The reference is the overlap of the facet's field and the mode in the plane of the rhabdom's end. Light from a
    point on one side travels to the other side.
    """
    lens, guide = FacetLens(20e-6, 13e-6, -60e-6, 6e-6), Waveguide(1.8e-6, 1.37, 1.34)
    eye = Ommatidium(lens.pupil(wavefront=wavefront), guide, lens.focal_length() + 3e-6)
    pupil, z, types = eye.pupil, lens.focal_length() + 3e-6, precision("float64")
    dx, n = 0.1e-6, 140
    at = (np.arange(n) - n / 2 + 0.5) * dx
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    beam = Beam(pupil, PointSource(math.inf, (-angle[0], -angle[1])), WAVE, z)
    field = (
        direct_sum(beam, (pupil.aperture, 15.0, 7.0, False), types.Float64(x), types.Float64(y), types).numpy().ravel()
    )
    expected = [abs(np.sum(mode.field(x, y) * field) * dx**2) ** 2 / pupil.area for mode in eye.modes(WAVE)]
    np.testing.assert_allclose(eye.mode_power(*angle, WAVE), expected, atol=2e-4)


@pytest.mark.slow
def test_a_wide_guide_takes_what_falls_on_it():
    """Dozens of modes act like no waveguide: they collect the light within the core, and little of the light around
    it."""
    eye = Ommatidium(LENS, Waveguide(4e-6, 1.42, 1.34))
    light = optics.psf(LENS, [WAVE], dx=0.1e-6, shape=(81, 81))
    taken = eye.mode_power(np.array([0.0, 4e-6 / FOCAL]), 0.0, WAVE).sum(axis=0)
    assert len(eye.modes(WAVE)) > 30
    assert taken[0] == pytest.approx(optics.encircled_energy(light, 2e-6)[0, 0], abs=0.02)
    assert taken[1] < 0.05


def test_defocus_and_absorption_change_what_is_seen():
    guide = Waveguide(2e-6)
    focused, blurred = (Ommatidium(LENS, guide, z) for z in (None, 1.34 * FOCAL + 15e-6))
    assert blurred.sensitivity(0.0, 0.0, WAVE) < 0.8 * focused.sensitivity(0.0, 0.0, WAVE)
    # A long rhabdom absorbs all light of higher modes, too, which reach further out.
    short, long = (Ommatidium(LENS, Waveguide(2e-6, length=at)) for at in (5e-6, 2e-3))
    assert short.sensitivity(0.0, 0.0, WAVE) < 0.05
    assert long.sensitivity(0.0, 0.0, WAVE) == pytest.approx(float(focused.sensitivity(0.0, 0.0, WAVE)), rel=1e-3)
    assert short.acceptance_angle(WAVE) < long.acceptance_angle(WAVE)


def test_hexagons_see_nearly_alike_all_around():
    eye = Ommatidium(FacetLens(25e-6, 20e-6), Waveguide(1.4e-6))
    along, across = (eye.acceptance_angle(WAVE, azimuth) for azimuth in (0.0, 90.0))
    assert along == pytest.approx(across, rel=0.02)
    turned = eye.sensitivity(0.01 * math.cos(math.pi / 3), 0.01 * math.sin(math.pi / 3), WAVE)
    assert turned == pytest.approx(float(eye.sensitivity(0.01, 0.0, WAVE)), rel=1e-4)


@pytest.mark.parametrize("wavelength", [400e-9, 450e-9, 550e-9])
def test_colours_have_foci_of_their_own_behind_glass_that_disperses(wavelength):
    """The reference is a lens with the index at this wavelength, and a rhabdom at the same distance from its front,
    because the principal plane of a thick lens also depends on the index. Without dispersion, violet light would be in
    focus.
    """
    glass, shape = optics.RefractiveIndex.from_abbe(1.5, abbe_number=15.0), (25e-6, 24e-6, -40e-6, 20e-6)
    guide, lens = Waveguide(1.6e-6), FacetLens(*shape, n=glass)
    behind_front = lens.principal_planes()[1] + lens.focal_length()
    alone = FacetLens(*shape, n=float(glass.at(wavelength)))
    same = Ommatidium(alone, guide, behind_front - alone.principal_planes()[1])
    angles, seen = np.radians(np.linspace(-2, 2, 9)), Ommatidium(lens, guide)
    found = seen.mode_power(angles, 0.0, wavelength)
    np.testing.assert_allclose(found, same.mode_power(angles, 0.0, wavelength), rtol=1e-9, atol=1e-12)
    achromatic = Ommatidium(lens.pupil(), guide).mode_power(0.0, 0.0, wavelength).sum()
    lost = 1 - seen.mode_power(0.0, 0.0, wavelength).sum() / achromatic
    assert lost == pytest.approx(0, abs=1e-9) if wavelength == 550e-9 else lost > 0.1


def test_superposition_narrows_what_one_facet_blurs():
    """Light of many facets that arrives in phase is diffracted by the whole aperture instead of a single facet
    (Stavenga 2006).
    """
    narrow = Waveguide(0.8e-6, 1.38, 1.34)
    whole = Pupil(30e-6, aperture=optics.hexagonal_segments(1), thin_lens_focal_length=0.2e-3, medium_n=1.34)
    facet = Pupil(30e-6 / 2.65, aperture=optics.Polygon.regular(6), thin_lens_focal_length=0.2e-3, medium_n=1.34)
    assert Ommatidium(whole, narrow).acceptance_angle(WAVE) < 0.5 * Ommatidium(facet, narrow).acceptance_angle(WAVE)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ommatidium(1.0, Waveguide(2e-6)), "lens = 1.0"),
        (lambda: Ommatidium(LENS, 2e-6), "rhabdom = 2e-06"),
        (lambda: Ommatidium(LENS, Waveguide(2e-6), -1.0), "distance = -1.0"),
        (lambda: Ommatidium(LENS, Waveguide(2e-6)).sensitivity(1.0, 0.0), r"abs\(angle_x\) = 1.0"),
        (lambda: Ommatidium(LENS, Waveguide(2e-6)).acceptance_angle(5.0), "wavelength = 5.0"),
        (lambda: Ommatidium(LENS, Waveguide(2e-6)).acceptance_angle(azimuth_deg=math.nan), "azimuth_deg = nan"),
    ],
)
def test_bad_input_names_itself(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_fields_of_thin_rhabdoms_reach_far(monkeypatch):
    """A mode at V = 1 falls by a factor e over five core radii. A field of twelve radii misses 0.3 % of the power;
    forty radii are enough.
    """
    thin = Ommatidium(FacetLens(25e-6, 30e-6), Waveguide(0.64e-6))
    power = {}
    for radii in (12.0, radiation.FARTHEST, 400.0):
        monkeypatch.setattr(radiation, "FARTHEST", radii)
        coupled_modes.cache_clear()
        power[radii] = thin.mode_power(np.zeros(1), np.zeros(1))[0, 0]
    few, chosen, many = power.values()
    # the missing part is proportional to the field at the limit, or its square
    assert chosen == pytest.approx(many, rel=2e-5)
    assert few < 0.998 * many
