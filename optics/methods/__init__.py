"""Ways to evaluate one diffraction integral, each with its samples, time and error.

textbook             the angular spectrum in plain NumPy: start here
problem              Problem: the integral in numbers
sampling             what every method offers
rayleigh_sommerfeld  the direct sum: the reference
angular_spectrum     on grids, whole or split
pixelated_spectrum   of pupils made of pixels
hankel               of symmetric pupils
low_rank             one matrix product
far_field            directions for each of a few nodes
fresnel              Fresnel and Fraunhofer, and how wrong they are
geometric            density of rays; the pinhole
rays                 where geometrical optics sends the light
pupil_sampling       grid or nodes in the pupil
spectral_taper       how a spectrum ends before grazing incidence
"""
