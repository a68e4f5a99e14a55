"""An oracle must reject the wrong method by far more than the bound that the package must satisfy."""

import math

import numpy as np
import pytest

from validation import reference

WAVELENGTH = 500e-9
R = np.linspace(0, 20e-6, 200)


def intensity(field):
    return np.abs(field) ** 2


def fresnel_on_axis():
    """For a radius of 20 µm at 40 µm (Fresnel number 20), Fresnel's approximation is 0 on the axis; the exact value is
    3.474.
    """
    exact = reference.circular_aperture_on_axis(20e-6, 40e-6, WAVELENGTH)
    return exact, 4 * math.sin(math.pi * 20e-6**2 / (2 * WAVELENGTH * 40e-6)) ** 2


def airy_at_f2():
    exact = intensity(reference.ideal_lens_field(R, WAVELENGTH, 75e-6, 300e-6)) / (np.pi * 75e-6**2)
    return exact, reference.airy_psf(R, WAVELENGTH, 75e-6, 300e-6)


def airy_peak_at_f1():
    radius, f = 150e-6, 300e-6
    exact = abs(reference.converging_wave_at_focus(radius, f, WAVELENGTH)) ** 2
    return exact, (np.pi * radius**2 / (WAVELENGTH * f)) ** 2


def parabolic_lens_at_f2():
    """A lens exp(-ikr²/2f) in place of a spherical wave has an ideal focus in Fresnel's approximation, but not in the
    exact theory.
    """
    radius, f = 75e-6, 300e-6
    edge_waves = (radius**2 / (2 * f) - (math.hypot(radius, f) - f)) / WAVELENGTH
    return 1.0, reference.strehl_spherical(edge_waves)


def debye_at_low_fresnel_number():
    """Debye's pattern is symmetric about the focus; at Fresnel number 2 the exact pattern is brightest in front of
    it."""
    radius, f = 100e-6, 10e-3
    z = 0.8 * f
    u = 2 * np.pi / WAVELENGTH * radius**2 * (1 / z - 1 / f)
    debye = np.pi * radius**2 / (WAVELENGTH * f) ** 2 * reference.lommel_intensity(u, 0.0)
    return reference.defocused_psf(0.0, WAVELENGTH, radius, f, z), debye


def fraunhofer_in_the_near_field():
    exact = reference.defocused_psf(R, WAVELENGTH, 20e-6, math.inf, 400e-6)
    return exact, reference.airy_psf(R, WAVELENGTH, 20e-6, 400e-6)


def tangent_in_the_far_field():
    """The pattern at 45° depends on sin θ, not on tan θ, and has the obliquity factor."""
    r, z = np.linspace(0, 16e-3, 200), 16e-3
    exact = reference.circular_aperture_fraunhofer(r, WAVELENGTH, 0.7e-6, z)
    return exact, reference.airy_psf(r, WAVELENGTH, 0.7e-6, z) * np.pi * 0.7e-6**2


def amplitude_transfer_in_place_of_the_mtf():
    f = np.linspace(0, 3e5, 50)
    return reference.circular_mtf(f, WAVELENGTH, 30e-6, 240e-6), (f < 30e-6 / (WAVELENGTH * 240e-6)).astype(float)


def energy_within_the_diameter():
    zero = reference.AIRY_ZEROS[0] / math.pi * 4 * WAVELENGTH
    exact = reference.airy_encircled_energy(zero, WAVELENGTH, 30e-6, 240e-6)
    return exact, reference.airy_encircled_energy(zero / 2, WAVELENGTH, 30e-6, 240e-6)


def beam_without_gouys_phase():
    r = np.linspace(0, 8e-6, 50)
    beam = reference.gaussian_beam(r, WAVELENGTH, 3e-6, 60e-6)
    return beam, beam * np.exp(1j * np.arctan2(60e-6, np.pi * 3e-6**2 / WAVELENGTH))


def paraxial_narrow_beam():
    r = np.linspace(0, 5e-6, 50)
    exact = reference.gaussian_field(r, WAVELENGTH, 0.6e-6, 5e-6)
    return exact, reference.gaussian_beam(r, WAVELENGTH, 0.6e-6, 5e-6)


def conjugate_time_factor():
    x = np.linspace(0, 2e-6, 50)
    wave = reference.plane_wave(x, 3e-6, WAVELENGTH, 0.6 / WAVELENGTH)
    return wave, wave.conj()


def paraxial_plane_wave():
    x, sine, z = np.linspace(0, 2e-6, 50), 0.6, 3e-6
    exact = reference.plane_wave(x, z, WAVELENGTH, sine / WAVELENGTH)
    return exact, np.exp(2j * np.pi * sine * x / WAVELENGTH - 1j * np.pi * z * sine**2 / WAVELENGTH)


def evanescent_waves_that_do_not_decay():
    wave = reference.plane_wave(np.zeros(1), 0.1e-6, WAVELENGTH, 1.5 / WAVELENGTH)
    return np.abs(wave), np.ones(1)


def talbots_paraxial_distance():
    x = np.linspace(0, 0.8e-6, 40)
    grating = {-1: 0.3, 0: 1.0, 1: 0.3}
    images = [
        intensity(reference.grating_field(x, z, WAVELENGTH, 0.8e-6, grating))
        for z in (
            reference.talbot_distance(0.8e-6, WAVELENGTH),
            reference.paraxial_talbot_distance(0.8e-6, WAVELENGTH),
        )
    ]
    return images[0], images[1]


def geometric_shadow_of_an_edge():
    x = np.linspace(-10e-6, 10e-6, 200)
    return intensity(reference.knife_edge_field(x, WAVELENGTH, 50e-6)), (x > 0).astype(float)


def sinc_of_a_near_slit():
    x = np.linspace(-20e-6, 20e-6, 200)
    far = np.sinc(2 * 10e-6 * x / (WAVELENGTH * 100e-6)) * 20e-6 / math.sqrt(WAVELENGTH * 100e-6)
    return intensity(reference.slit_field(x, 10e-6, WAVELENGTH, 100e-6)), far**2


def sawtooth_turned_round():
    return reference.blazed_grating_efficiency(1, 0.8), reference.blazed_grating_efficiency(-1, 0.8)


def four_levels_as_a_sawtooth():
    return reference.staircase_grating_efficiency(1, 4), reference.blazed_grating_efficiency(1, 1.0)


def amplitude_grating_in_place_of_a_phase_grating():
    """A grating of chrome instead of glass has an efficiency of (1/π)² = 10 % instead of (2/π)² = 40.5 %."""
    return reference.binary_grating_efficiency(1, 0.5), (1 / math.pi) ** 2


def spherical_balanced_with_the_wrong_sign():
    return reference.strehl_spherical(1.0, -1.0), reference.strehl_spherical(1.0, 1.0)


def coma_balanced_with_the_wrong_sign():
    return reference.strehl_coma(0.8, -0.8 * 2 / 3), reference.strehl_coma(0.8, 0.8 * 2 / 3)


def astigmatism_balanced_with_the_wrong_sign():
    return reference.strehl_astigmatism(0.8, -0.4), reference.strehl_astigmatism(0.8, 0.4)


def radians_for_waves():
    return reference.strehl_defocus(0.5), reference.strehl_defocus(0.5 / (2 * math.pi))


def unnormalised_zernike():
    """The mode ρ² without normalisation has the root mean square 1/(2√3) instead of 1."""
    return reference.marechal_strehl(0.1), reference.marechal_strehl(0.1 * reference.RMS_PER_WAVE["defocus"])


def image_in_the_focal_plane():
    image = reference.thin_lens_image_distance(2e-3, 6e-3)
    peaks = [reference.defocused_psf(0.0, WAVELENGTH, 60e-6, image, z) for z in (image, 2e-3)]
    return peaks[0], peaks[1]


def glass_that_disperses_like_a_grating():
    """Blue light (440 nm) passes a lens made for 550 nm."""
    return reference.refractive_focal_length(1e-3, 1.53), reference.diffractive_focal_length(
        1e-3 / 0.52, 550e-9, 440e-9
    )


def pinhole_as_its_shadow():
    """The PSF of geometric optics is the reciprocal of the aperture's area."""
    radius = reference.pinhole_radius(WAVELENGTH, 1e-3)
    return reference.defocused_psf(0.0, WAVELENGTH, radius, math.inf, 1e-3), 1 / (np.pi * radius**2)


# Ten times the bounds in the tests of optics.
CASES = {
    fresnel_on_axis: 1e-4,
    airy_at_f2: 1e-6,
    airy_peak_at_f1: 2e-5,
    parabolic_lens_at_f2: 1e-2,
    debye_at_low_fresnel_number: 0.1,
    fraunhofer_in_the_near_field: 1e-2,
    tangent_in_the_far_field: 1e-2,
    amplitude_transfer_in_place_of_the_mtf: 2e-2,
    energy_within_the_diameter: 5e-3,
    beam_without_gouys_phase: 1e-8,
    paraxial_narrow_beam: 2e-4,
    conjugate_time_factor: 1e-3,
    paraxial_plane_wave: 1e-3,
    evanescent_waves_that_do_not_decay: 0.1,
    talbots_paraxial_distance: 1e-2,
    geometric_shadow_of_an_edge: 2e-2,
    sinc_of_a_near_slit: 5e-2,
    sawtooth_turned_round: 0.6,
    four_levels_as_a_sawtooth: 0.2,
    amplitude_grating_in_place_of_a_phase_grating: 0.6,
    spherical_balanced_with_the_wrong_sign: 2e-2,
    coma_balanced_with_the_wrong_sign: 1e-2,
    astigmatism_balanced_with_the_wrong_sign: 1e-2,
    radians_for_waves: 1e-2,
    unnormalised_zernike: 3e-2,
    image_in_the_focal_plane: 3e-2,
    glass_that_disperses_like_a_grating: 0.1,
    pinhole_as_its_shadow: 2e-2,
}


class TestTheWrongMethodFails:
    @pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
    def test_by_ten_times_what_the_package_is_allowed(self, case):
        exact, wrong = case()
        assert reference.relative_l2(wrong, exact) > CASES[case]

    def test_the_known_case(self):
        exact, fresnel = fresnel_on_axis()
        assert exact == pytest.approx(3.474, abs=5e-4)
        assert fresnel == pytest.approx(0, abs=1e-12)
