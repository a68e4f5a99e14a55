"""Closed forms and converged quadratures in float64, with which the packages are compared.

These modules do not import the packages. Each function states its formula and source. The time factor is exp(-iωt).
Fields omit the carrier exp(ikz), so their phase stays small. Lengths are in m, aberrations in waves.

waves                plane waves, Gaussian beams, edges
circular             circular apertures: Airy pattern and field on the axis
rayleigh_sommerfeld  the exact integral of a circular pupil with an ideal lens
richards_wolf        the vector focus
defocus              light near a focus: Lommel's functions
aberrations          Zernike's polynomials and Strehl ratios
apertures            Fourier transforms of openings
gratings             orders, efficiencies, self-images
lenses               focal lengths of lenses, zone plates and pinholes
measures             differences between results, and orders of convergence
"""

from validation.reference.aberrations import (
    RMS_PER_WAVE,
    marechal_strehl,
    noll_index,
    strehl_astigmatism,
    strehl_coma,
    strehl_defocus,
    strehl_of_wavefront,
    strehl_spherical,
    zernike,
)
from validation.reference.circular import (
    AIRY_ZEROS,
    airy_encircled_energy,
    airy_psf,
    circular_aperture_fraunhofer,
    circular_aperture_on_axis,
    circular_aperture_power,
    circular_mtf,
    converging_wave_at_focus,
)
from validation.reference.defocus import (
    defocused_psf,
    lommel_intensity,
)
from validation.reference.gratings import (
    binary_grating_efficiency,
    blazed_grating_efficiency,
    grating_field,
    paraxial_talbot_distance,
    sinusoidal_grating_efficiency,
    staircase_grating_efficiency,
    talbot_distance,
)
from validation.reference.lenses import (
    PINHOLE_FRESNEL_NUMBER,
    diffractive_focal_length,
    kinoform_on_axis,
    pinhole_radius,
    refractive_focal_length,
    thin_lens_image_distance,
)
from validation.reference.measures import (
    order_of_convergence,
    relative_l2,
)
from validation.reference.rayleigh_sommerfeld import (
    ideal_lens_field,
    ideal_lens_profile,
)
from validation.reference.waves import (
    gaussian_beam,
    gaussian_evanescent_power,
    gaussian_field,
    knife_edge_field,
    plane_wave,
    slit_field,
)

__all__ = [
    "AIRY_ZEROS",
    "PINHOLE_FRESNEL_NUMBER",
    "RMS_PER_WAVE",
    "airy_encircled_energy",
    "airy_psf",
    "binary_grating_efficiency",
    "blazed_grating_efficiency",
    "circular_aperture_fraunhofer",
    "circular_aperture_on_axis",
    "circular_aperture_power",
    "circular_mtf",
    "converging_wave_at_focus",
    "defocused_psf",
    "diffractive_focal_length",
    "gaussian_beam",
    "gaussian_evanescent_power",
    "gaussian_field",
    "grating_field",
    "ideal_lens_field",
    "ideal_lens_profile",
    "kinoform_on_axis",
    "knife_edge_field",
    "lommel_intensity",
    "marechal_strehl",
    "noll_index",
    "order_of_convergence",
    "paraxial_talbot_distance",
    "pinhole_radius",
    "plane_wave",
    "refractive_focal_length",
    "relative_l2",
    "sinusoidal_grating_efficiency",
    "slit_field",
    "staircase_grating_efficiency",
    "strehl_astigmatism",
    "strehl_coma",
    "strehl_defocus",
    "strehl_of_wavefront",
    "strehl_spherical",
    "talbot_distance",
    "thin_lens_image_distance",
    "zernike",
]
